//! Tests whether a remainder that is not white is sensor noise.
//!
//! Sensor electronics have flicker noise, whose power falls as 1/f. A disturbance of the device (a force, the room
//! temperature, a slipping mount, the gain of a worn element) drifts or jumps; its power falls as 1/f² or faster. So
//! the exponent separates them: white 0, flicker 1, random walk 2. It is fitted over the octaves in which the power
//! exceeds the white noise floor.

use std::ops::Range;

use crate::criteria::HALF;
use crate::linear::{Hann, windows};

/// Exponents that are closer to flicker noise than to white noise or to a random walk.
const FLICKER_EXPONENTS: Range<f64> = 0.5..1.5;
/// Minimum number of octaves.
const MIN_OCTAVES: usize = 4;
/// Maximum RMS scatter of the octaves around the power law, in decades: a tone or a mode exceeds it.
const MAX_SCATTER: f64 = 0.25;
/// Maximum magnitude of the excess kurtosis of a nearly normal sample. Jumps, bursts and errors at turning points have
/// more.
const MAX_EXCESS_KURTOSIS: f64 = 1.0;
/// Number of windows of the spectrum in the longest run of rows, without overlap.
const WINDOWS: usize = 4;

/// Returns the exponent p if the residual is sensor noise with a power of `1/fᵖ`; `None` if it is something else or
/// white.
/// `counts` marks the rows to use, `white` is the standard deviation of the white noise \[unit of the residual\].
pub(super) fn flicker(residual: &[f64], segments: &[Range<usize>], counts: &[bool], white: f64) -> Option<f64> {
    let runs: Vec<Range<usize>> = segments.iter().flat_map(|s| runs(s, counts)).collect();
    let rows = || runs.iter().cloned().flatten().map(|k| residual[k]);
    let n = rows().count() as f64;
    let mean = rows().sum::<f64>() / n.max(1.0);
    let moment = |power: i32| rows().map(|r| (r - mean).powi(power)).sum::<f64>() / n.max(1.0);
    let kurtosis = moment(4) / moment(2).powi(2) - 3.0;
    let length = runs.iter().map(ExactSizeIterator::len).max().unwrap_or(0) / WINDOWS;
    if length < 1 << (MIN_OCTAVES + 2) || kurtosis.is_nan() || kurtosis.abs() > MAX_EXCESS_KURTOSIS {
        return None;
    }
    let hann = Hann::new(length);
    let mut power = vec![0.0; length / 2 + 1];
    let mut energy = 0.0;
    for window in windows(&runs, length) {
        power.iter_mut().zip(hann.spectrum(&residual[window])).for_each(|(p, x)| *p += x.norm_sqr());
        energy += hann.energy();
    }
    // Octaves from the third line on: the window spreads the removed mean over the first two.
    let octaves = (1..).map(|i| 1usize << i).take_while(|first| 2 * first <= length / 2);
    let points: Vec<[f64; 2]> = octaves
        .map(|first| {
            let mean = power[first..2 * first].iter().sum::<f64>() / (first as f64 * energy);
            [(first as f64).log10(), mean - white * white]
        })
        .filter(|[_, above]| *above > HALF * white * white)
        .map(|[f, above]| [f, above.log10()])
        .collect();
    if points.len() < MIN_OCTAVES {
        return None;
    }
    let n = points.len() as f64;
    let mean = |i: usize| points.iter().map(|p| p[i]).sum::<f64>() / n;
    let (f, y) = (mean(0), mean(1));
    let slope = points.iter().map(|p| (p[0] - f) * (p[1] - y)).sum::<f64>()
        / points.iter().map(|p| (p[0] - f).powi(2)).sum::<f64>();
    let scatter = (points.iter().map(|p| (p[1] - y - slope * (p[0] - f)).powi(2)).sum::<f64>() / n).sqrt();
    (FLICKER_EXPONENTS.contains(&-slope) && scatter <= MAX_SCATTER).then_some(-slope)
}

/// Returns the contiguous runs of rows of a segment that count.
fn runs(segment: &Range<usize>, counts: &[bool]) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for k in segment.clone().filter(|k| counts[*k]) {
        match runs.last_mut() {
            Some(run) if run.end == k => run.end += 1,
            _ => runs.push(k..k + 1),
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};

    const ROWS: usize = 16_000;

    fn exponent(of: impl Fn(usize, &mut dyn FnMut() -> f64) -> f64) -> Option<f64> {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(4);
        let mut normal = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
        let residual: Vec<f64> = (0..ROWS).map(|k| of(k, &mut normal)).collect();
        flicker(&residual, std::slice::from_ref(&(0..ROWS)), &[true; ROWS], 0.3)
    }

    /// Sum of first-order processes one octave apart: its power falls as 1/f.
    fn pink(normal: &mut dyn FnMut() -> f64, x: &mut [f64; 14]) -> f64 {
        for (i, x) in x.iter_mut().enumerate() {
            let keep = (-1.0 / f64::from(1 << i)).exp();
            *x = keep * *x + (1.0 - keep * keep).sqrt() * normal();
        }
        x.iter().sum::<f64>() / 14f64.sqrt()
    }

    #[test]
    fn flicker_noise_is_separated_from_random_walk_and_white_noise() {
        let state = std::cell::RefCell::new([0.0; 14]);
        let pink = exponent(|_, normal| pink(normal, &mut state.borrow_mut()) + 0.3 * normal()).unwrap();
        assert!((0.7..1.3).contains(&pink), "{pink}");
        let walk = std::cell::Cell::new(0.0);
        let step = |normal: &mut dyn FnMut() -> f64| {
            walk.set(0.999 * walk.get() + 0.1 * normal());
            walk.get() + 0.3 * normal()
        };
        assert_eq!(exponent(|_, normal| step(normal)), None);
        assert_eq!(exponent(|_, normal| 0.3 * normal()), None);
        assert_eq!(exponent(|k, normal| 3.0 * (0.05 * k as f64).sin() + 0.3 * normal()), None);
    }

    #[test]
    fn a_short_record_gives_no_exponent() {
        assert_eq!(flicker(&[0.1; 90], std::slice::from_ref(&(0..90)), &[true; 90], 0.1), None);
    }
}
