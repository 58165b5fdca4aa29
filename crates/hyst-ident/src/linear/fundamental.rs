//! Measures the gain over amplitude and frequency: the fundamental of sines, cycle by cycle (paper 2, Fig. 6–8).

use std::f64::consts::TAU;
use std::ops::Range;

use nalgebra::Complex;
use realfft::RealFftPlanner;
use serde::Serialize;

use super::LinearError;
use super::error::{require, require_one_period};
use crate::Samples;

/// The fundamental of a run of equal cycles.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GainPoint {
    /// Number of the segment, from 0.
    pub segment: usize,
    /// Frequency of the drive \[Hz\].
    pub hz: f64,
    /// Amplitude of the fundamental of the input \[u\].
    pub amplitude: f64,
    /// Mean of the input \[u\].
    pub bias: f64,
    /// Amplitude of the output divided by that of the input \[y/u\].
    pub gain: f64,
    /// Phase of the output relative to the input, −π to π \[rad\].
    pub phase: f64,
    /// Standard error of the gain from its scatter between cycles \[y/u\]; `None` for one cycle.
    pub gain_std_error: Option<f64>,
    /// The same for the phase \[rad\].
    pub phase_std_error: Option<f64>,
    /// RMS of harmonics 2 to 5 of the output, divided by that of the fundamental.
    pub harmonics: f64,
    /// Number of averaged cycles.
    pub cycles: usize,
}

/// Maximum relative difference of the amplitudes of consecutive cycles in a run.
const AMPLITUDE_TOLERANCE: f64 = 0.02;
/// Minimum number of cycles of a run with constant amplitude. Its fades are left out.
const MIN_RUN_CYCLES: usize = 3;
/// Minimum number of rows per cycle.
const MIN_CYCLE_ROWS: f64 = 12.0;

/// Measures gain and phase of the fundamental of every segment that is a sine.
///
/// Fits a constant and five harmonics by least squares to each cycle; a trend is not fitted, because it correlates with
/// the harmonics. Cycles of constant amplitude are averaged without the first one, the start-up. If the amplitude
/// changes (a decaying or modulated sine), each cycle is a point.
///
/// `hz` is the frequency of the drive; if not given, that of the strongest line of the input of each segment.
///
/// # Errors
/// If no segment has three cycles of at least twelve rows.
pub fn gain_map(samples: &Samples, hz: Option<f64>) -> Result<Vec<GainPoint>, LinearError> {
    require_one_period(samples)?;
    if let Some(hz) = hz {
        require("hz", hz, hz.is_finite() && hz > 0.0, "a positive number")?;
    }
    let mut points = Vec::new();
    let mut found = None;
    for (segment, rows) in samples.segments.iter().enumerate() {
        let Some(hz) = hz.or_else(|| strongest(&samples.input[rows.clone()], samples.period)) else { continue };
        let cycle = 1.0 / (hz * samples.period);
        found = Some(hz);
        let count = (rows.len() as f64 / cycle + 1e-6).floor();
        if cycle < MIN_CYCLE_ROWS || count < MIN_RUN_CYCLES as f64 {
            continue;
        }
        let at = |c: usize| rows.start + ((c as f64 * cycle).round() as usize).min(rows.len());
        let cycles: Vec<Cycle> = (0..count as usize).filter_map(|c| Cycle::of(samples, at(c)..at(c + 1), hz)).collect();
        points.extend(runs(&cycles).into_iter().map(|run| point(segment, hz, run)));
    }
    match (points.is_empty(), found) {
        (false, _) => Ok(points),
        (true, None) => Err(LinearError::NoSine { reason: "it does not move in any segment".into() }),
        (true, Some(hz)) => {
            let reason =
                format!("no segment has three cycles of {MIN_CYCLE_ROWS} rows at its strongest line, {hz:.4} Hz");
            Err(LinearError::NoSine { reason })
        }
    }
}

/// Returns the frequency of the strongest line \[Hz\].
pub(super) fn strongest(x: &[f64], period: f64) -> Option<f64> {
    let length = (4 * x.len()).next_power_of_two();
    let fft = RealFftPlanner::<f64>::new().plan_fft_forward(length);
    let (mut padded, mut spectrum) = (fft.make_input_vec(), fft.make_output_vec());
    let mean = x.iter().sum::<f64>() / x.len().max(1) as f64;
    let rows = x.len() as f64;
    for (k, (p, x)) in padded.iter_mut().zip(x).enumerate() {
        *p = (x - mean) * (0.5 - 0.5 * (TAU * (k as f64 + 0.5) / rows).cos());
    }
    fft.process(&mut padded, &mut spectrum).ok()?;
    let power: Vec<f64> = spectrum.iter().map(Complex::norm_sqr).collect();
    // Use the spectrum of the slope: the motion to mid-span and back is much larger than a small sine there, but slow.
    let slope = |i: usize| power[i] * (i as f64).powi(2);
    let top = (1..power.len().saturating_sub(1)).max_by(|a, b| slope(*a).total_cmp(&slope(*b)))?;
    if power[top] <= 0.0 {
        return None;
    }
    // The logarithm of the peak of a window is nearly a parabola.
    let [a, b, c] = [power[top - 1], power[top], power[top + 1]].map(|p| p.max(f64::MIN_POSITIVE).ln());
    let curvature = a - 2.0 * b + c;
    let shift = if curvature < 0.0 { (0.5 * (a - c) / curvature).clamp(-0.5, 0.5) } else { 0.0 };
    Some((top as f64 + shift) / (length as f64 * period))
}

/// One cycle: fundamentals of input and output, mean input, harmonics of the output.
#[derive(Clone, Copy)]
struct Cycle {
    u: Complex<f64>,
    y: Complex<f64>,
    bias: f64,
    harmonics: f64,
}

/// Number of fitted harmonics.
const HARMONICS: usize = 5;

impl Cycle {
    fn of(samples: &Samples, rows: Range<usize>, hz: f64) -> Option<Self> {
        let first = rows.start;
        let columns = 1 + 2 * HARMONICS;
        // Phases count from the first row of the record, so that they agree between cycles.
        let basis = nalgebra::DMatrix::from_fn(rows.len(), columns, |k, c| match c {
            0 => 1.0,
            c => {
                let harmonic = c.div_ceil(2) as f64;
                let angle = TAU * (hz * samples.period * (first + k) as f64).fract() * harmonic;
                if c.is_multiple_of(2) { angle.sin() } else { angle.cos() }
            }
        });
        let right = nalgebra::DMatrix::from_fn(rows.len(), 2, |k, c| {
            if c == 0 { samples.input[first + k] } else { samples.output[first + k] }
        });
        let solved = basis.svd(true, true).solve(&right, 1e-9).ok()?;
        let harmonic = |column: usize, h: usize| Complex::new(solved[(2 * h - 1, column)], -solved[(2 * h, column)]);
        let (u, y) = (harmonic(0, 1), harmonic(1, 1));
        let above = (2..=HARMONICS).map(|h| harmonic(1, h).norm_sqr()).sum::<f64>();
        Some(Self { u, y, bias: solved[(0, 0)], harmonics: (above / y.norm_sqr().max(f64::MIN_POSITIVE)).sqrt() })
    }
}

/// Returns runs of cycles of equal amplitude; if none is long enough, every cycle with sufficient amplitude.
fn runs(cycles: &[Cycle]) -> Vec<&[Cycle]> {
    let equal =
        |a: &Cycle, b: &Cycle| (a.u.norm() - b.u.norm()).abs() <= AMPLITUDE_TOLERANCE * a.u.norm().max(b.u.norm());
    let most = cycles.iter().fold(0.0_f64, |most, c| most.max(c.u.norm()));
    let strong = |c: &Cycle| c.u.norm() > AMPLITUDE_TOLERANCE * most;
    let long: Vec<&[Cycle]> = cycles
        .chunk_by(equal)
        .filter(|run| run.len() >= MIN_RUN_CYCLES && strong(&run[0]))
        .map(|run| &run[1..])
        .collect();
    if long.is_empty() { cycles.chunks(1).filter(|c| strong(&c[0])).collect() } else { long }
}

fn point(segment: usize, hz: f64, run: &[Cycle]) -> GainPoint {
    let n = run.len() as f64;
    let mean = |of: &dyn Fn(&Cycle) -> f64| run.iter().map(of).sum::<f64>() / n;
    let h = run.iter().map(|c| c.y / c.u).sum::<Complex<f64>>() / n;
    let relative = |c: &Cycle| c.y / c.u / h;
    let error = |of: &dyn Fn(&Cycle) -> f64| {
        let m = mean(of);
        let variance = run.iter().map(|c| (of(c) - m).powi(2)).sum::<f64>() / (n - 1.0);
        (run.len() > 1).then(|| (variance / n).sqrt())
    };
    GainPoint {
        segment,
        hz,
        amplitude: mean(&|c| c.u.norm()),
        bias: mean(&|c| c.bias),
        gain: h.norm(),
        phase: h.arg(),
        gain_std_error: error(&|c| relative(c).norm() * h.norm()),
        phase_std_error: error(&|c| relative(c).arg()),
        harmonics: mean(&|c| c.harmonics),
        cycles: run.len(),
    }
}
