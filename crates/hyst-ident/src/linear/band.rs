//! The band of a record, and fewer rows for a narrow one.
//!
//! At 20 kHz the poles of a mode at 20 Hz lie within a few thousandths of 1 and of each other: rounding moves them by more
//! than noise does. In a record with a rate that suits its band they stand apart.

use super::FrequencyResponse;
use crate::Samples;

/// The highest frequency up to which the drive moves the output \[Hz\]: there the sum of coherence − ½ over all lines below is
/// greatest, so that neither a dip nor a few lines of chance decide. `None` if the coherence is below one half everywhere.
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
    /// The rows that are left.
    pub samples: Samples,
    /// Every how many rows one was kept; 1 if all were.
    pub factor: usize,
}

/// Keeps as few rows as a band \[Hz\] allows, at least 3.2 for each period of its highest frequency, after a low-pass of zero
/// phase on input and output alike: what one of them loses the other loses too, so the response stays what it was.
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
            // Beyond its ends a segment rests where it is.
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

/// A Blackman-windowed low-pass that passes 0.7 and stops 1.0 of the new Nyquist frequency; its taps sum to one.
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
