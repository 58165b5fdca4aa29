//! Estimates the drive history of each segment from a fit.

use super::candidates::Candidates;
use super::first_rows::level;
use super::histories::continued;
use crate::samples::Samples;
use crate::settle::{centre, first_cycles, windows};

/// Returns the drive history of each segment after which a fit follows its first rows [`Candidates::best`]; empty for
/// segments that are not in `asked`. About 340 combinations of reversals are tried over the start-up window, at most
/// half of the segment. `residual` is that of the fit in all rows; `surely` marks the segments in which a memory other
/// than rest is expected. `motion_in` returns the motion that the fit predicts for other rows.
///
/// # Errors
/// Those of `motion_in`.
pub(crate) fn recalled<E>(
    samples: &Samples,
    residual: &[f64],
    asked: &[bool],
    surely: &[bool],
    motion_in: impl Fn(&Samples) -> Result<Vec<f64>, E> + Sync,
) -> Result<Vec<Vec<f64>>, E> {
    let (windows, cycles) = (windows(samples), first_cycles(samples));
    let centred = centre(samples, residual, &windows, &samples.blind);
    let of_segment = |i: usize| -> Result<Vec<f64>, E> {
        let (start, window) = (samples.segments[i].start, windows[i]);
        if window == 0 || !asked[i] {
            return Ok(Vec::new());
        }
        let beginning = samples.beginning(i, window);
        // The residual changes only by the change of the motion.
        let motion = |past: &[f64]| {
            let after = Samples { pasts: vec![past.to_vec()], ..beginning.clone() };
            motion_in(&after)
        };
        let level = level(samples, &centred, &windows, i);
        let now = motion(&beginning.pasts[0])?;
        let squares = |past: &[f64]| {
            let left = motion(past).ok()?;
            let left = now.iter().zip(left).zip(&centred[start..start + window]).zip(&beginning.blind);
            Some(left.filter(|(_, blind)| !**blind).map(|(((now, then), r), _)| (r + now - then).powi(2)).sum::<f64>())
        };
        let mut candidates = Candidates::new(samples.input[start], samples.input_range());
        // Or the device was cycled before as in the segment itself.
        let others = cycles[i].map(|rows| samples.input[start..start + rows].to_vec()).into_iter();
        let others = others.chain(continued(samples, i));
        let known = beginning.pasts.iter().filter(|past| !past.is_empty()).cloned();
        others.chain(known).for_each(|past| candidates.add(past));
        Ok(candidates.best(level, surely[i], |past| squares(past).unwrap_or(f64::INFINITY)))
    };
    (0..asked.len()).map(of_segment).collect()
}
