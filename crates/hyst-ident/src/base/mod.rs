//! Hysteresis bases as columns: each operator is linear in its weights, `v = Σᵢ wᵢ φᵢ(u)`.

pub(crate) mod choice;
mod drag;
mod linearised;
pub(crate) mod past;
mod pi;
mod preisach;
mod rated;
mod screening;
mod travel;

pub(crate) use drag::{Drag, DragParams};
pub(crate) use linearised::LinearisedBasis;
pub(crate) use pi::{PiBasis, PlaysWithSlopes, play_column};
pub(crate) use preisach::PreisachBasis;
pub(crate) use rated::RatedBasis;
pub(crate) use screening::{ROWS_PER_UNKNOWN, ScreeningBasis};

use std::ops::Range;

use nalgebra::DMatrix;

use crate::Samples;
use crate::lsq::Bounds;

/// Number of columns that pass through an operator or a filter together, so that the processor can overlap their steps.
pub(crate) const SIDE_BY_SIDE: usize = 4;

/// Returns the columns with the other sign if the output falls while the drive rises.
fn with_sign(falls: bool, mut columns: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    if falls {
        columns.iter_mut().flatten().for_each(|x| *x = -*x);
    }
    columns
}

/// A family of operators that are linear in their weights.
///
/// Every column is zero for a device at rest at 0 V with virgin memory. So the stages behind the operator scale the
/// motion and not an arbitrary zero.
pub(crate) trait Basis: Sync {
    /// Returns the columns φᵢ with the indices `of` over the rows of `drive`; the memory is reset at the start of each
    /// segment. A basis without [drag](Self::drags) ignores `drag`.
    fn columns(&self, of: Range<usize>, drive: &[f64], segments: &[Range<usize>], drag: &Drag) -> Vec<Vec<f64>>;
    /// Returns the values of the same columns in these rows, which ascend.
    fn columns_at(
        &self,
        of: Range<usize>,
        drive: &[f64],
        segments: &[Range<usize>],
        drag: &Drag,
        rows: &[usize],
    ) -> Vec<Vec<f64>> {
        let columns = self.columns(of, drive, segments, drag);
        columns.iter().map(|column| rows.iter().map(|k| column[*k]).collect()).collect()
    }
    /// Returns the best number of columns for one pass over the drive.
    fn together(&self) -> usize {
        8
    }
    /// Returns `Σᵢ wᵢ φᵢ` over the rows of `drive`, if that takes less work than the columns; `None` otherwise.
    fn combined(&self, _weights: &[f64], _drive: &[f64], _segments: &[Range<usize>], _drag: &Drag) -> Option<Vec<f64>> {
        None
    }
    /// Returns whether a search on this basis may add play operators whose thresholds grow with the rate. Next to an
    /// operator of another kind they take up its misfit.
    fn may_widen(&self) -> bool {
        true
    }
    /// Returns the same basis for another record, if its columns depend on more than drive and segments.
    fn over(&self, _samples: &Samples) -> Option<Box<dyn Basis>> {
        None
    }
    /// Returns whether the operator has a rate-dependent form (drag).
    fn drags(&self) -> bool {
        true
    }
    /// Returns whether the operator is odd: a drive mirrored about its middle mirrors the output, for all weights. Such
    /// a basis cannot bend one end of a loop, so asymmetry is a separate effect. Other bases bend with their weights.
    fn is_odd(&self) -> bool {
        false
    }
    /// Returns whether a weight is zero if its column is the same in all rows that count.
    fn is_zero_unless_moved(&self) -> bool {
        false
    }
    /// Returns the bounds of the weights.
    fn bounds(&self) -> Vec<Bounds>;
    /// Returns a regularisation matrix for the weights, to be added to normal equations with the mean diagonal `level`;
    /// `None` if none is needed.
    fn penalty(&self, level: f64) -> Option<DMatrix<f64>>;
    /// Returns the number of columns.
    fn len(&self) -> usize {
        self.bounds().len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two segments with minor loops, each with virgin memory at its start.
    fn samples() -> Samples {
        let input: Vec<f64> =
            (0..900).map(|k| f64::from(k) * 0.02).map(|t| 20.0 * t.sqrt() * (1.0 - t.cos())).collect();
        let output = input.iter().map(|u| 0.1 * u).collect();
        let segments = vec![0..500, 500..input.len()];
        Samples { segments, file_of_segment: vec![0, 0], ..Samples::of_columns(1e-3, input, output) }
    }

    fn agrees(basis: &dyn Basis, samples: &Samples, drag: &Drag) {
        let weights: Vec<f64> = (0..basis.len()).map(|i| 0.3 + (1.7 * i as f64).sin().powi(2)).collect();
        let all = basis.columns(0..basis.len(), &samples.input, &samples.segments, drag);
        assert_eq!(all.len(), basis.len());
        // Independent of how many columns are computed at a time.
        for together in [1, 3, 8] {
            for first in (0..basis.len()).step_by(together) {
                let of = first..(first + together).min(basis.len());
                assert_eq!(basis.columns(of.clone(), &samples.input, &samples.segments, drag), all[of]);
            }
        }
        let rows: Vec<usize> = (0..samples.len()).filter(|k| k % 7 == 3 || *k > 890).collect();
        let in_rows = basis.columns_at(0..basis.len(), &samples.input, &samples.segments, drag, &rows);
        for (all, some) in all.iter().zip(&in_rows) {
            assert!(rows.iter().map(|k| all[*k]).eq(some.iter().copied()));
        }
        let combined = basis.combined(&weights, &samples.input, &samples.segments, drag).unwrap();
        for (k, combined) in combined.iter().enumerate() {
            let sum: f64 = all.iter().zip(&weights).map(|(column, w)| w * column[k]).sum();
            assert!((sum - combined).abs() < 1e-9 * (1.0 + sum.abs()), "row {k}: {sum} {combined}");
        }
    }

    #[test]
    fn rows_after_a_history_are_those_of_the_record() {
        let samples = samples();
        let basis = PreisachBasis::for_samples(&samples, 5);
        let (drive, segments, pasts) = (&samples.input, &samples.segments, [vec![], vec![165.0, 4.0]]);
        let all = past::columns(&basis, 2..9, drive, segments, &pasts, &Drag::NONE);
        let rows = [0, 1, 499, 500, 503, 899];
        let some = past::columns_at(&basis, 2..9, (drive, segments, &pasts), &Drag::NONE, &rows);
        assert_eq!(some, all.iter().map(|column| rows.map(|k| column[k]).to_vec()).collect::<Vec<_>>());
        assert_ne!(all, past::columns(&basis, 2..9, drive, segments, &[], &Drag::NONE));
    }

    #[test]
    fn the_output_of_an_operator_is_the_sum_of_its_columns() {
        let samples = samples();
        let viscous = DragParams { seconds: 2e-3, volt_seconds: 1e-4 }.over(&samples);
        let screening = ScreeningBasis::for_samples(&samples, true, None);
        agrees(&screening, &samples, &Drag::NONE);
        agrees(&screening, &samples, &viscous);
        let odd = ScreeningBasis::odd(&samples, true);
        agrees(&odd, &samples, &Drag::NONE);
        agrees(&odd, &samples, &viscous);
        agrees(&PreisachBasis::for_samples(&samples, 8), &samples, &Drag::NONE);
        // A drive to both sides has no virgin strip.
        let input: Vec<f64> = samples.input.iter().map(|u| u - 60.0).collect();
        let both = Samples { input, ..samples };
        agrees(&PreisachBasis::for_samples(&both, 9), &both, &Drag::NONE);
    }
}
