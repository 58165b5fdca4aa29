//! Finds the band of a record, and reduces the number of rows to the band.
//!
//! At 20 kHz the poles of a mode at 20 Hz are within a few thousandths of 1 and of each other. Rounding then moves them
//! by more than the noise. At a rate that matches the band they are well separated.

use super::FrequencyResponse;
use crate::Samples;

/// Returns the highest frequency up to which the drive moves the output \[Hz\]. There the sum of coherence − ½ over all
/// lower lines has its maximum, so a dip or a few random lines have no influence. `None` if the sum is never positive.
pub fn band_of(response: &FrequencyResponse) -> Option<f64> {
    let mut sum = 0.0;
    let sums = response.lines.iter().map(|line| {
        sum += line.coherence - 0.5;
        (sum, line.hz)
    });
    sums.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|(sum, _)| *sum > 0.0).map(|(_, hz)| hz)
}

/// A record with fewer rows.
#[derive(Clone, Debug)]
pub struct Decimated {
    /// The remaining rows.
    pub samples: Samples,
    /// Decimation factor: one of this number of rows was kept.
    pub factor: usize,
}

/// Reduces the rows to a band \[Hz\], with at least 3.2 rows per period of its highest frequency. The same zero-phase
/// low-pass filters input and output before, so the response does not change.
pub fn decimate(samples: &Samples, band_hz: f64) -> Decimated {
    let factor = (1.0 / (3.2 * band_hz * samples.period)).floor();
    let factor = if factor.is_finite() { factor.clamp(1.0, 1e6) as usize } else { 1 };
    if factor == 1 {
        return Decimated { samples: samples.clone(), factor };
    }
    let taps = low_pass(factor);
    let reach = taps.len() / 2;
    let mut kept = Samples {
        period: samples.period * factor as f64,
        periods: samples.periods.iter().map(|period| period * factor as f64).collect(),
        time: Vec::new(),
        input: Vec::new(),
        output: Vec::new(),
        temperature: None,
        load: None,
        falls: samples.falls,
        segments: Vec::new(),
        pasts: samples.pasts.clone(),
        file_of_segment: samples.file_of_segment.clone(),
        settling: Vec::new(),
        blind: Vec::new(),
        stop: samples.stop.clone(),
    };
    for s in &samples.segments {
        let first = kept.time.len();
        for t in s.clone().step_by(factor) {
            // The first and the last value of a segment are held outside of it.
            let filtered = |x: &[f64]| {
                taps.iter().zip(0..).map(|(w, i)| w * x[(t + i).saturating_sub(reach).clamp(s.start, s.end - 1)]).sum()
            };
            kept.time.push(samples.time[t]);
            kept.input.push(filtered(&samples.input));
            kept.output.push(filtered(&samples.output));
            kept.settling.push(samples.settling[t]);
            kept.blind.push(samples.blind[t]);
        }
        kept.segments.push(first..kept.time.len());
    }
    Decimated { samples: kept, factor }
}

/// Returns a Blackman-windowed low-pass with a pass band up to 0.7 and a stop band from 1.0 of the new Nyquist
/// frequency; the sum of its taps is 1.
fn low_pass(factor: usize) -> Vec<f64> {
    let reach = 20 * factor;
    let cutoff = 0.85 / factor as f64;
    let tap = |i: usize| {
        let x = i as f64 - reach as f64;
        let turn = std::f64::consts::TAU * (i as f64 + 1.0) / (2 * reach + 2) as f64;
        let window = 0.42 - 0.5 * turn.cos() + 0.08 * (2.0 * turn).cos();
        let angle = std::f64::consts::PI * cutoff * x;
        window * if x == 0.0 { 1.0 } else { angle.sin() / angle }
    };
    let taps: Vec<f64> = (0..=2 * reach).map(tap).collect();
    let sum: f64 = taps.iter().sum();
    taps.into_iter().map(|w| w / sum).collect()
}
