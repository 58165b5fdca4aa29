//! Spectra of residuals: peaks and tones.

use std::ops::Range;

use realfft::RealFftPlanner;

use crate::samples::Samples;

/// Returns the power spectrum summed over the segments, each zero-padded to a common duration, and the frequency step
/// \[Hz\]. A segment contributes up to half its sample rate.
fn power(samples: &Samples, residual: &[f64]) -> (Vec<f64>, f64) {
    let seconds = samples.longest_segment().max(samples.period);
    let length = ((2.0 * seconds / samples.period).round() as usize).next_power_of_two();
    let step = 1.0 / (length as f64 * samples.period);
    let mut planner = RealFftPlanner::<f64>::new();
    let mut power = vec![0.0; length / 2 + 1];
    for (i, s) in samples.segments.iter().enumerate() {
        let fft = planner.plan_fft_forward(((1.0 / (step * samples.period_of(i))).round() as usize).max(s.len()));
        let (mut input, mut output) = (fft.make_input_vec(), fft.make_output_vec());
        let rows = &residual[s.clone()];
        let mean = rows.iter().sum::<f64>() / rows.len().max(1) as f64;
        let n = rows.len() as f64;
        for (k, (x, r)) in input.iter_mut().zip(rows).enumerate() {
            // Hann window: without it, slow parts of the residual would leak over the whole band.
            let window = 0.5 - 0.5 * (2.0 * std::f64::consts::PI * (k as f64 + 0.5) / n).cos();
            *x = window * (r - mean);
        }
        // Cannot fail: the lengths come from the planner.
        if fft.process(&mut input, &mut output).is_ok() {
            power.iter_mut().zip(&output).for_each(|(p, c)| *p += c.norm_sqr());
        }
    }
    (power, step)
}

/// Returns the height of each line above the median of its neighbourhood (a tenth of its frequency to each side).
fn prominence(power: &[f64]) -> Vec<f64> {
    let n = power.len();
    (0..n)
        .map(|i| {
            let half = (i / 10).clamp(16, 2000);
            let (a, b) = (i.saturating_sub(half), (i + half + 1).min(n));
            let step = ((b - a) / 64).max(1);
            let mut around: Vec<f64> = power[a..b].iter().step_by(step).copied().collect();
            around.sort_by(f64::total_cmp);
            power[i] / around[around.len() / 2].max(f64::MIN_POSITIVE)
        })
        .collect()
}

/// Returns the frequencies \[Hz\] of the `count` most prominent lines, most prominent first.
pub(super) fn peaks(samples: &Samples, residual: &[f64], count: usize) -> Vec<f64> {
    let (power, step) = power(samples, residual);
    let prominence = prominence(&power);
    let first = (3.0 / (samples.longest_segment() * step)).ceil() as usize;
    let mut lines: Vec<usize> = (first.max(1)..power.len().saturating_sub(1))
        .filter(|i| prominence[*i] >= prominence[i - 1] && prominence[*i] > prominence[i + 1])
        .collect();
    lines.sort_by(|a, b| prominence[*b].total_cmp(&prominence[*a]));
    lines.truncate(count);
    lines.into_iter().map(|i| i as f64 * step).collect()
}

/// Returns the frequency \[Hz\] of the strongest tone with a continuous phase on the lab clock. The most prominent
/// lines are refined by a fit of sine and cosine to the whole record, across gaps.
pub(super) fn tone(samples: &Samples, residual: &[f64]) -> Option<f64> {
    let total = samples.time.last()? - samples.time.first()?;
    let longest = samples.longest_segment();
    let around = |hz: f64, reach: f64, steps: usize| {
        (0..=2 * steps)
            .map(move |i| hz + reach * (i as f64 / steps as f64 - 1.0))
            .map(|hz| (explained(samples, &samples.segments, residual, hz), hz))
            .max_by(|a, b| a.0.total_cmp(&b.0))
    };
    peaks(samples, residual, 3)
        .into_iter()
        .filter_map(|hz| {
            // The coherent peak has a width of 1/total; the segment's spectrum locates it within 1/longest.
            let steps = ((4.0 * total / longest) as usize).clamp(4, 400);
            let (_, hz) = around(hz, 1.0 / longest, steps)?;
            around(hz, 1.0 / longest / steps as f64, 4)
        })
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, hz)| hz)
}

/// Returns the frequency \[Hz\] with the most power in a signal, its mean excluded.
pub(super) fn strongest(samples: &Samples, signal: &[f64]) -> Option<f64> {
    let (power, step) = power(samples, signal);
    let line = (1..power.len()).max_by(|a, b| power[*a].total_cmp(&power[*b]))?;
    // Also between the lines of the transform.
    let near = (-8..=8).map(|i| (line as f64 + f64::from(i) / 8.0) * step);
    let heights = near.map(|hz| {
        let of = |s| explained(samples, std::slice::from_ref(s), signal, hz);
        (samples.segments.iter().map(of).sum::<f64>(), hz)
    });
    heights.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, hz)| hz)
}

/// Returns the Σ residual² that a sine and cosine of this frequency explain in these segments.
pub(super) fn explained(samples: &Samples, segments: &[Range<usize>], residual: &[f64], hz: f64) -> f64 {
    let (mut ss, mut sc, mut cc, mut rs, mut rc) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for segment in segments.iter().filter(|segment| !segment.is_empty()) {
        // One sine and cosine per segment, then rotation: the samples of a segment are evenly spaced.
        let angle = |t: f64| 2.0 * std::f64::consts::PI * (hz * t).fract();
        let (mut s, mut c) = angle(samples.time[segment.start]).sin_cos();
        let (ds, dc) = angle(samples.period_at(segment.start)).sin_cos();
        for r in &residual[segment.clone()] {
            ss += s * s;
            sc += s * c;
            cc += c * c;
            rs += r * s;
            rc += r * c;
            (s, c) = (s * dc + c * ds, c * dc - s * ds);
        }
    }
    let det = ss * cc - sc * sc;
    if det <= 1e-9 * ss * cc { 0.0 } else { (rs * rs * cc - 2.0 * rs * rc * sc + rc * rc * ss) / det }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stop::Stop;

    #[test]
    fn a_tone_is_found_across_gaps() {
        let (h, hz) = (1e-3, 49.87);
        let starts = [0.0, 5.3, 17.1];
        let mut samples = Samples {
            period: h,
            periods: Vec::new(),
            time: Vec::new(),
            input: Vec::new(),
            output: Vec::new(),
            temperature: None,
            load: None,
            segments: Vec::new(),
            pasts: Vec::new(),
            file_of_segment: vec![0; 3],
            settling: Vec::new(),
            falls: false,
            blind: Vec::new(),
            stop: Stop::default(),
        };
        for t0 in starts {
            let first = samples.time.len();
            samples.time.extend((0..3000).map(|k| t0 + h * f64::from(k)));
            samples.segments.push(first..first + 3000);
        }
        let r: Vec<f64> =
            samples.time.iter().map(|t| (2.0 * std::f64::consts::PI * hz * t + 0.4).sin() + (0.7 * t).sin()).collect();
        let found = tone(&samples, &r).unwrap();
        assert!((found - hz).abs() < 0.01, "{found}");
    }
}
