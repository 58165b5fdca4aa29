//! Hysteresis bases as columns: each is linear in its weights, `v = Σᵢ wᵢ φᵢ(u)`.

mod drag;
mod linearised;
mod pi;
mod preisach;
mod rated;
mod screening;
mod travel;

pub(crate) use drag::{Drag, DragParams};
pub(crate) use linearised::LinearisedBasis;
pub(crate) use pi::{PiBasis, SlidingPlays, play_column};
pub(crate) use preisach::PreisachBasis;
pub(crate) use rated::RatedBasis;
pub(crate) use screening::{ROWS_PER_UNKNOWN, ScreeningBasis};

use std::ops::Range;

use nalgebra::DMatrix;

use crate::Samples;
use crate::lsq::Bounds;

/// Columns that run through an operator or a filter side by side: each waits for its own last sample only.
pub(crate) const BESIDE: usize = 4;

/// The columns of an operator whose output falls where the drive rises: with the other sign.
fn turned(falls: bool, mut columns: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    if falls {
        columns.iter_mut().flatten().for_each(|x| *x = -*x);
    }
    columns
}

/// A family of operators, linear in their weights.
///
/// Every column is zero for the device at rest at 0 V with virgin memory, so that stages behind it
/// scale the motion and not an arbitrary zero.
pub(crate) trait Basis: Sync {
    /// The columns φᵢ `of` these numbers over the rows of `drive`, memory reset at the start of each segment. A base that
    /// [cannot drag](Self::drags) does not look at `drag`.
    fn columns(&self, of: Range<usize>, drive: &[f64], segments: &[Range<usize>], drag: &Drag) -> Vec<Vec<f64>>;
    /// How many columns are best made in one pass over the drive.
    fn together(&self) -> usize {
        8
    }
    /// `Σᵢ wᵢ φᵢ` over the rows of `drive`, where that is less work than its columns are.
    fn combined(&self, _weights: &[f64], _drive: &[f64], _segments: &[Range<usize>], _drag: &Drag) -> Option<Vec<f64>> {
        None
    }
    /// Whether a search on it may add plays whose thresholds grow with the rate: beside an operator of another kind they take its misfit.
    fn may_widen(&self) -> bool {
        true
    }
    /// The same base over another record, where its columns depend on more than drive and segments.
    fn over(&self, _samples: &Samples) -> Option<Box<dyn Basis>> {
        None
    }
    /// Whether there is a drag: a rate-dependent form of the operator.
    fn drags(&self) -> bool {
        true
    }
    /// Whether a half turn of the drive about its middle turns the output about its middle, whatever the weights: such a base cannot bend
    /// one end of a loop, and an asymmetry is an effect that it lacks. Any other base bends by its own weights.
    fn is_odd(&self) -> bool {
        false
    }
    /// Bounds of the weights.
    fn bounds(&self) -> Vec<Bounds>;
    /// What regularises the weights, as a matrix to be added to normal equations whose mean
    /// diagonal (over the columns) is `level`; `None` if nothing has to.
    fn penalty(&self, level: f64) -> Option<DMatrix<f64>>;
    /// Number of columns.
    fn len(&self) -> usize {
        self.bounds().len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two segments with minor loops; virgin memory at the start of each.
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
        // However many are made at a time.
        for together in [1, 3, 8] {
            for first in (0..basis.len()).step_by(together) {
                let of = first..(first + together).min(basis.len());
                assert_eq!(basis.columns(of.clone(), &samples.input, &samples.segments, drag), all[of]);
            }
        }
        let combined = basis.combined(&weights, &samples.input, &samples.segments, drag).unwrap();
        for (k, combined) in combined.iter().enumerate() {
            let sum: f64 = all.iter().zip(&weights).map(|(column, w)| w * column[k]).sum();
            assert!((sum - combined).abs() < 1e-9 * (1.0 + sum.abs()), "row {k}: {sum} {combined}");
        }
    }

    #[test]
    fn what_an_operator_gives_is_the_sum_of_its_columns() {
        let samples = samples();
        let viscous = DragParams { seconds: 2e-3, volt_seconds: 1e-4 }.over(&samples);
        let screening = ScreeningBasis::for_samples(&samples, true, None);
        agrees(&screening, &samples, &Drag::NONE);
        agrees(&screening, &samples, &viscous);
        agrees(&PreisachBasis::for_samples(&samples, 8), &samples, &Drag::NONE);
        // Driven to both sides there is no virgin strip.
        let input: Vec<f64> = samples.input.iter().map(|u| u - 60.0).collect();
        let both = Samples { input, ..samples };
        agrees(&PreisachBasis::for_samples(&both, 9), &both, &Drag::NONE);
    }
}
