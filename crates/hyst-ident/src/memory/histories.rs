//! Histories of a whole record: demagnetised, cycled, continued from the previous segment, or driven to one end.

use super::reversals::{decay, in_force, path};
use crate::criteria::MIN_RMSE_DROP;
use crate::samples::Samples;
use crate::settle::first_cycles;

/// How a device may have reached the start of a segment.
#[derive(Clone, Copy)]
enum History {
    /// Demagnetised at `u0`, or at rest there from the start: wide play operators are at the first voltage.
    Demagnetised,
    /// Cycled before as in the segment itself.
    Cycled,
    /// At rest since the end of the previous segment, and driven on from there.
    Continued,
    /// Driven to the upper or the lower end of the range.
    FromAbove,
    FromBelow,
}

impl History {
    const ALL: [Self; 5] = [Self::Demagnetised, Self::Cycled, Self::Continued, Self::FromAbove, Self::FromBelow];

    /// Returns the drive before a segment; `None` if this history is impossible.
    fn past(self, samples: &Samples, segment: usize) -> Option<Vec<f64>> {
        let rows = samples.segments[segment].clone();
        let (u0, (low, high)) = (samples.input[rows.start], samples.input_range());
        Some(match self {
            Self::Demagnetised => decay(u0, high - low),
            Self::Cycled => samples.input[rows.start..rows.start + first_cycles(samples)[segment]?].to_vec(),
            Self::Continued => continued(samples, segment)?,
            Self::FromAbove => path(&[high], u0),
            Self::FromBelow => path(&[low], u0),
        })
    }
}

/// Returns the record with the histories that minimise `squares`, the Σ residual² of a fit. One history is chosen for
/// the first segment and one for all others, among the segments in `asked`.
pub(crate) fn with_histories<E>(
    samples: &Samples,
    asked: &[bool],
    squares: &mut dyn FnMut(&Samples) -> Result<f64, E>,
) -> Result<Samples, E> {
    let mut best = samples.clone();
    let mut least = squares(&best)?;
    for first in [true, false] {
        let known = best.clone();
        let enough = (1.0 - MIN_RMSE_DROP).powi(2) * least;
        for history in History::ALL {
            let mut after = known.clone();
            let mut is_new = false;
            for segment in (0..samples.segments.len()).filter(|i| asked[*i] && (*i == 0) == first) {
                if let Some(past) = history.past(&after, segment) {
                    (after.pasts[segment], is_new) = (past, true);
                }
            }
            if is_new {
                let left = squares(&after)?;
                if left < least.min(enough) {
                    (best, least) = (after, left);
                }
            }
        }
    }
    Ok(best)
}

/// Returns the drive before a segment that continues the previous one of the same file; `None` for the first.
pub(crate) fn continued(samples: &Samples, segment: usize) -> Option<Vec<f64>> {
    let last = segment.checked_sub(1)?;
    let of_one_file = samples.file_of_segment[last] == samples.file_of_segment[segment];
    let earlier = samples.pasts.get(last).into_iter().flatten();
    let drive = earlier.chain(&samples.input[samples.segments[last].clone()]);
    of_one_file.then(|| path(&in_force(drive), samples.input[samples.segments[segment].start]))
}

/// Returns the `new` history of each segment, or the old one where that is empty.
pub(crate) fn kept(old: &[Vec<f64>], new: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    new.into_iter().zip(old).map(|(new, old)| if new.is_empty() { old.clone() } else { new }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::{Basis, Drag, PiBasis, past};

    /// Two segments of one drive, the second starting where the first ends. This history is found among the others.
    #[test]
    fn a_segment_that_continues_the_previous_one_is_recognised() {
        let u = |k: usize| 50.0 + 45.0 * (0.02 * k as f64).sin() * (1.0 - k as f64 / 1600.0);
        let input: Vec<f64> = (0..1200).map(u).collect();
        let whole = std::slice::from_ref(&(0..1200)).to_vec();
        let plays =
            PiBasis { thresholds: vec![6.0, 15.0, 30.0, 40.0], floor: 0.0, virgin: f64::INFINITY, falls: false };
        let columns = plays.columns(0..5, &input, &whole, &Drag::NONE);
        let output = (0..1200).map(|k| columns.iter().map(|c| 0.05 * c[k]).sum()).collect();
        let samples = Samples {
            segments: vec![0..700, 700..1200],
            file_of_segment: vec![0, 0],
            pasts: vec![Vec::new(); 2],
            ..Samples::of_columns(1e-3, input, output)
        };
        let squares = |samples: &Samples| {
            let Samples { input, segments, pasts, .. } = samples;
            let columns = past::columns(&plays, 0..5, input, segments, pasts, &Drag::NONE);
            (0..1200)
                .map(|k| (samples.output[k] - columns.iter().map(|c| 0.05 * c[k]).sum::<f64>()).powi(2))
                .sum::<f64>()
        };
        let best = with_histories(&samples, &[false, true], &mut |samples| Ok::<_, ()>(squares(samples))).unwrap();
        assert_eq!(best.pasts, [Vec::new(), continued(&samples, 1).unwrap()]);
        assert!(squares(&best) < 1e-3 * squares(&samples));
        // A segment of another file is not continued.
        assert!(continued(&Samples { file_of_segment: vec![0, 1], ..samples }, 1).is_none());
    }
}
