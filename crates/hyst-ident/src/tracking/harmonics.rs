//! Gain and phase of the harmonics of a periodic reference.

use std::f64::consts::TAU;

use nalgebra::Complex;
use serde::Serialize;

use crate::statistics::range;

/// One harmonic of a periodic reference.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Harmonic {
    /// Number; 1 is the fundamental.
    pub number: usize,
    /// Frequency \[Hz\].
    pub frequency_hz: f64,
    /// Amplitude of the reference \[output unit\].
    pub amplitude: f64,
    /// Amplitude of the output divided by that of the reference.
    pub gain: f64,
    /// Phase of the output relative to the reference; negative if the output is late \[degrees\].
    pub phase_deg: f64,
}

/// Minimum amplitude of a harmonic, as a share of the strongest one.
const MIN_HARMONIC_SHARE: f64 = 5e-3;
/// Maximum count of harmonics.
const MAX_HARMONICS: usize = 8;
/// Highest number of a harmonic.
const MAX_HARMONIC_NUMBER: usize = 40;
/// Maximum deviation of the distances of turns in a periodic reference, as a share of its period.
const PERIOD_TOLERANCE: f64 = 0.01;
/// Maximum difference of the maxima, and of the minima, of a periodic reference, as a share of its span.
const EXTREMUM_TOLERANCE: f64 = 0.02;

/// Returns gain and phase over whole periods, from the first maximum (or minimum) to the last one; empty if the
/// reference is not periodic.
pub(super) fn harmonics(wanted: &[f64], measured: &[f64], turns: &[usize], rate_hz: f64) -> Vec<Harmonic> {
    // A period is the distance of every second turn; at least two periods are required.
    let same_kind: Vec<usize> = turns.iter().copied().step_by(2).collect();
    let (Some(first), Some(last)) = (same_kind.first(), same_kind.last()) else { return Vec::new() };
    let periods = same_kind.len() - 1;
    let period = (last - first) as f64 / periods.max(1) as f64;
    let regular = |w: &[usize]| ((w[1] - w[0]) as f64 - period).abs() <= PERIOD_TOLERANCE * period + 1.0;
    let (low, high) = range(wanted.iter().copied());
    let is_alike = |from: usize| {
        let (low_turn, high_turn) = range(turns.iter().skip(from).step_by(2).map(|row| wanted[*row]));
        high_turn - low_turn <= EXTREMUM_TOLERANCE * (high - low)
    };
    if periods < 2 || !same_kind.windows(2).all(regular) || !is_alike(0) || !is_alike(1) {
        return Vec::new();
    }
    let highest = MAX_HARMONIC_NUMBER.min(((period / 2.0) as usize).saturating_sub(1));
    let of: Vec<(usize, Complex<f64>, Complex<f64>)> = (1..=highest)
        .map(|number| {
            let turn = TAU * number as f64 / period;
            let sum = |x: &[f64]| -> Complex<f64> {
                let rows = x[*first..*last].iter().enumerate();
                rows.map(|(k, x)| Complex::from_polar(*x, -turn * k as f64)).sum::<Complex<f64>>()
                    * (2.0 / (last - first) as f64)
            };
            (number, sum(wanted), sum(measured))
        })
        .collect();
    let strongest = of.iter().map(|(_, r, _)| r.norm()).fold(0.0, f64::max);
    of.into_iter()
        .filter(|(_, r, _)| r.norm() > 0.0 && r.norm() >= MIN_HARMONIC_SHARE * strongest)
        .take(MAX_HARMONICS)
        .map(|(number, r, y)| Harmonic {
            number,
            frequency_hz: number as f64 * rate_hz / period,
            amplitude: r.norm(),
            gain: y.norm() / r.norm(),
            phase_deg: (y / r).arg().to_degrees(),
        })
        .collect()
}
