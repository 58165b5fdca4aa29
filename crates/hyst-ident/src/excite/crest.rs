//! Phases for which a sum of sines has a low crest factor. The signal then has more power in the same span.

use std::f64::consts::{PI, TAU};

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use realfft::RealFftPlanner;
use realfft::num_complex::Complex;

/// Number of starts: Schroeder's phases and random ones.
const STARTS: u64 = 4;
/// Maximum number of transformed rows of a search; it takes well below a second.
const MAX_TRANSFORMED_ROWS: usize = 20_000_000;

/// Returns the ratio of peak magnitude to RMS; 1.41 for one sine.
pub(super) fn crest_factor(x: &[f64]) -> f64 {
    let peak = x.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
    let square = x.iter().map(|x| x * x).sum::<f64>() / x.len().max(1) as f64;
    if square > 0.0 { peak / square.sqrt() } else { 0.0 }
}

/// Returns Schroeder's phases `−π k (k − 1) / n`.
pub(super) fn schroeder(count: usize) -> Vec<f64> {
    (1..=count).map(|k| -PI * k as f64 * (k as f64 - 1.0) / count as f64).collect()
}

/// Returns phases of low crest factor for sines of equal amplitude with these integer numbers of cycles.
///
/// Each pass clips the sum slightly below its peak and takes the phases of its spectrum with the required amplitudes.
/// The clip level rises from pass to pass (van der Ouderaa, Schoukens and Renneboog 1988). The search starts from
/// Schroeder's phases and from three random sets; the best result is returned. The crest factor is 1.4 to 1.5 for 20 or
/// more lines from a low frequency up (Schroeder's phases: 1.7), and about 1.6 in a narrow band (1.9).
pub(super) fn low_crest(cycles: &[usize]) -> Vec<f64> {
    let common = cycles.iter().fold(0, |a, b| gcd(a, *b)).max(1);
    let lines: Vec<usize> = cycles.iter().map(|c| c / common).collect();
    let highest = lines.iter().max().copied().unwrap_or(1).max(1);
    // Eight rows per cycle of the fastest line give its peak to 2 %.
    let length = (8 * highest).next_power_of_two();
    let passes = (MAX_TRANSFORMED_ROWS / length / STARTS as usize).clamp(10, 600);
    let mut planner = RealFftPlanner::<f64>::new();
    let (forward, backward) = (planner.plan_fft_forward(length), planner.plan_fft_inverse(length));
    let (mut spectrum, mut x) = (forward.make_output_vec(), forward.make_input_vec());
    let mut best = (f64::INFINITY, schroeder(lines.len()));
    for start in 0..STARTS {
        let mut phases = schroeder(lines.len());
        if start > 0 {
            let mut random = ChaCha8Rng::seed_from_u64(start);
            phases.iter_mut().for_each(|phase| *phase = TAU * random.random::<f64>());
        }
        for pass in 0..passes {
            spectrum.fill(Complex::new(0.0, 0.0));
            // A sine of phase φ: −j e^(jφ) at its line.
            lines.iter().zip(&phases).for_each(|(l, phase)| spectrum[*l] = Complex::from_polar(0.5, phase - 0.5 * PI));
            // Cannot fail: the lengths come from the planner and the ends are real.
            let _ = backward.process(&mut spectrum, &mut x);
            let crest = crest_factor(&x);
            if crest < best.0 {
                best = (crest, phases.clone());
            }
            let clip_level = 0.75 + 0.24 * (pass as f64 / passes as f64).sqrt();
            let peak = clip_level * x.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
            x.iter_mut().for_each(|x| *x = x.clamp(-peak, peak));
            let _ = forward.process(&mut x, &mut spectrum);
            lines.iter().zip(&mut phases).for_each(|(l, phase)| *phase = spectrum[*l].arg() + 0.5 * PI);
        }
    }
    best.1
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sum(cycles: &[usize], phases: &[f64]) -> Vec<f64> {
        let rows = 20_011;
        let at = |k: usize, c: usize| TAU * ((k * c) % rows) as f64 / rows as f64;
        (0..rows).map(|k| cycles.iter().zip(phases).map(|(c, p)| (at(k, *c) + p).sin()).sum()).collect()
    }

    #[test]
    fn thirty_lines_stay_below_one_and_a_half() {
        // A narrow band is a carrier with an envelope: √2 times the crest factor of the envelope.
        let bands: [(Vec<usize>, f64); 4] = [
            ((1..=30).collect(), 1.5),
            ((5..=44).map(|k| 3 * k).collect(), 1.5),
            ((0..30).map(|k| 2 * k + 1).collect(), 1.5),
            ((100..=130).collect(), 1.65),
        ];
        for (cycles, most) in bands {
            let low = crest_factor(&sum(&cycles, &low_crest(&cycles)));
            let plain = crest_factor(&sum(&cycles, &schroeder(cycles.len())));
            assert!(low < most && low < plain - 0.1, "{} lines from {}: {low}, {plain}", cycles.len(), cycles[0]);
        }
    }

    #[test]
    fn one_line_is_a_sine() {
        assert!((crest_factor(&sum(&[3], &low_crest(&[3]))) - 2.0_f64.sqrt()).abs() < 1e-6);
        assert_eq!(crest_factor(&[0.0, 0.0]), 0.0);
    }
}
