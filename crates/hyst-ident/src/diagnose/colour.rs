//! Whether a remainder is a sensor's noise, although it is not white.
//!
//! The electronics of sensors have flicker noise: its power falls as 1/f. What a device does by itself (a force, the room's temperature, a mount
//! that slips, the gain of a worn element) wanders or jumps, and its power falls as 1/f² or faster. So the exponent tells the two apart:
//! white 0, flicker 1, wandering 2. It is read off the octaves in which the power exceeds the white noise floor.

use std::ops::Range;

use crate::criteria::HALF;
use crate::linear::{Hann, windows};

/// Exponents between those of white noise and of a random walk that are nearer to flicker noise.
const FLICKER: Range<f64> = 0.5..1.5;
/// Octaves that have to count.
const LEAST_OCTAVES: usize = 4;
/// Root mean square by which the octaves may scatter around the power law, as a logarithm to base 10: a tone or a mode stands out further.
const SCATTER: f64 = 0.25;
/// Excess kurtosis up to which a sample is as good as normal: jumps, bursts and what acts at the turns alone have more or less.
const NORMAL: f64 = 1.0;
/// Windows of the spectrum that the longest stretch of rows holds, without overlap.
const WINDOWS: usize = 4;

/// The exponent p of noise whose power falls as `1/fᵖ` and that a sensor may have; `None` if `residual` is something else, or white.
/// `counts` are the rows to look at, `white` the standard deviation of the white noise \[unit of the residual\].
pub(super) fn flicker(residual: &[f64], segments: &[Range<usize>], counts: &[bool], white: f64) -> Option<f64> {
    let runs: Vec<Range<usize>> = segments.iter().flat_map(|s| runs(s, counts)).collect();
    let rows = || runs.iter().cloned().flatten().map(|k| residual[k]);
    let n = rows().count() as f64;
    let mean = rows().sum::<f64>() / n.max(1.0);
    let moment = |power: i32| rows().map(|r| (r - mean).powi(power)).sum::<f64>() / n.max(1.0);
    let kurtosis = moment(4) / moment(2).powi(2) - 3.0;
    let length = runs.iter().map(ExactSizeIterator::len).max().unwrap_or(0) / WINDOWS;
    if length < 1 << (LEAST_OCTAVES + 2) || kurtosis.is_nan() || kurtosis.abs() > NORMAL {
        return None;
    }
    let hann = Hann::new(length);
    let mut power = vec![0.0; length / 2 + 1];
    let mut energy = 0.0;
    for window in windows(&runs, length) {
        power.iter_mut().zip(hann.spectrum(&residual[window])).for_each(|(p, x)| *p += x.norm_sqr());
        energy += hann.energy();
    }
    // Octaves from the third line on: the window smears the removed mean over the first two.
    let octaves = (1..).map(|i| 1usize << i).take_while(|first| 2 * first <= length / 2);
    let points: Vec<[f64; 2]> = octaves
        .map(|first| {
            let mean = power[first..2 * first].iter().sum::<f64>() / (first as f64 * energy);
            [(first as f64).log10(), mean - white * white]
        })
        .filter(|[_, above]| *above > HALF * white * white)
        .map(|[f, above]| [f, above.log10()])
        .collect();
    if points.len() < LEAST_OCTAVES {
        return None;
    }
    let n = points.len() as f64;
    let mean = |i: usize| points.iter().map(|p| p[i]).sum::<f64>() / n;
    let (f, y) = (mean(0), mean(1));
    let slope = points.iter().map(|p| (p[0] - f) * (p[1] - y)).sum::<f64>()
        / points.iter().map(|p| (p[0] - f).powi(2)).sum::<f64>();
    let scatter = (points.iter().map(|p| (p[1] - y - slope * (p[0] - f)).powi(2)).sum::<f64>() / n).sqrt();
    (FLICKER.contains(&-slope) && scatter <= SCATTER).then_some(-slope)
}

/// Stretches of rows of a segment that count.
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

    /// Relaxers an octave apart, whose powers add up to 1/f.
    fn pink(normal: &mut dyn FnMut() -> f64, x: &mut [f64; 14]) -> f64 {
        for (i, x) in x.iter_mut().enumerate() {
            let keep = (-1.0 / f64::from(1 << i)).exp();
            *x = keep * *x + (1.0 - keep * keep).sqrt() * normal();
        }
        x.iter().sum::<f64>() / 14f64.sqrt()
    }

    #[test]
    fn flicker_noise_is_told_from_what_wanders_and_from_white_noise() {
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
    fn a_short_record_tells_nothing() {
        assert_eq!(flicker(&[0.1; 90], std::slice::from_ref(&(0..90)), &[true; 90], 0.1), None);
    }
}
