//! Estimates the frequency response from a periodic drive by averages over its periods.

use nalgebra::Complex;
use realfft::RealFftPlanner;

use super::error::{require, require_one_period};
use super::{FrequencyResponse, LinearError, Method, ResponseLine};
use crate::Samples;

/// Maximum difference of the inputs of two equal periods, as a share of the span.
const INPUT_TOLERANCE: f64 = 1e-3;
/// Minimum amplitude of a line of the drive, as a share of the strongest one.
const MIN_LINE_SHARE: f64 = 0.01;

/// Estimates the response at the lines of a periodic drive, without leakage. The standard error follows from the
/// scatter between periods.
///
/// A period is used if its input equals that of the period before: the structure has then settled for at least one
/// period, and fades are left out. The coherence is `|H|² / (|H|² + s²)`, where s² is the variance of H of one period.
///
/// # Errors
/// If the period is not a whole number of rows, or fewer than two periods repeat.
pub fn periodic_response(samples: &Samples, period_s: f64) -> Result<FrequencyResponse, LinearError> {
    require("period_s", period_s, period_s.is_finite() && period_s > 0.0, "a positive number of seconds")?;
    require_one_period(samples)?;
    let rows = period_s / samples.period;
    let length = rows.round() as usize;
    let reason = |reason: String| LinearError::NotPeriodic { seconds: period_s, reason };
    if (rows - rows.round()).abs() > 1e-3 || length < 4 {
        return Err(reason(format!("it has {rows:.3} rows, but must be a whole number of at least 4 rows")));
    }
    let (low, high) = samples.input_range();
    let same = |at: usize| {
        let (before, now) = (&samples.input[at - length..at], &samples.input[at..at + length]);
        before.iter().zip(now).all(|(a, b)| (a - b).abs() <= INPUT_TOLERANCE * (high - low))
    };
    let fft = RealFftPlanner::<f64>::new().plan_fft_forward(length);
    let spectrum = |x: &[f64]| {
        let (mut x, mut spectrum) = (x.to_vec(), fft.make_output_vec());
        // Cannot fail: the lengths come from the planner.
        let _ = fft.process(&mut x, &mut spectrum);
        spectrum
    };
    let starts =
        samples.segments.iter().flat_map(|s| (s.start + length..(s.end + 1).saturating_sub(length)).step_by(length));
    let used: Vec<[Vec<Complex<f64>>; 2]> = starts
        .filter(|at| same(*at))
        .map(|at| [&samples.input, &samples.output].map(|x| spectrum(&x[at..at + length])))
        .collect();
    if used.len() < 2 {
        let found = format!("{} periods have the same drive as the period before; two are needed", used.len());
        return Err(reason(found));
    }
    let n = used.len() as f64;
    let mean = |column: usize, i: usize| used.iter().map(|p| p[column][i]).sum::<Complex<f64>>() / n;
    let inner = 1..length.div_ceil(2);
    let (u, y): (Vec<_>, Vec<_>) = inner.clone().map(|i| (mean(0, i), mean(1, i))).unzip();
    let strongest = u.iter().fold(0.0_f64, |most, u| most.max(u.norm()));
    if strongest == 0.0 {
        return Err(LinearError::Constant { column: "input" });
    }
    let (mut lines, mut linear, mut other) = (Vec::new(), 0.0, 0.0);
    for (i, (u, y)) in inner.zip(u.into_iter().zip(y)) {
        if u.norm() < MIN_LINE_SHARE * strongest {
            other += y.norm_sqr();
            continue;
        }
        linear += y.norm_sqr();
        let h = y / u;
        let scatter = used.iter().map(|p| (p[1][i] - h * p[0][i]).norm_sqr()).sum::<f64>() / (n - 1.0);
        let one = scatter / u.norm_sqr();
        let size = h.norm_sqr().max(f64::MIN_POSITIVE);
        // Half of the variance is parallel to H, half perpendicular.
        let relative = (one / n / 2.0 / size).sqrt();
        lines.push(ResponseLine::new(i as f64 / period_s, h, size / (size + one), relative));
    }
    let unexcited_share = if linear > 0.0 { (other / linear).sqrt() } else { 0.0 };
    Ok(FrequencyResponse { method: Method::Periodic { period_s, periods: used.len(), unexcited_share }, lines })
}
