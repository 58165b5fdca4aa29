//! The dynamic Preisach model from records at several rates.

use hyst_core::{DpmParams, MirrorParams};
use serde::Serialize;

use super::mirror::{MirrorFit, MirrorProblem};
use super::{EverettError, FodReport, Surface, fod};
use crate::base::PreisachBasis;
use crate::fit::{CELLS, FitError, FitOptions, check, fit_settled, model_of};
use crate::model::{Base, Model};
use crate::record::Record;
use crate::samples::Samples;

/// Segments whose rate is at most this many times the slowest one's belong to the classical part.
const SLOW: f64 = 2.0;
/// Nodes of the mirror along rate and change, as in the paper (Chen et al., section III).
const NODES: (usize, usize) = (8, 9);
/// Travels over which a step fades that are tried, as shares of the input's range.
const FADES: [f64; 5] = [0.05, 0.1, 0.2, 0.4, 0.8];

/// Where the classical part of a dynamic model came from.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum ClassicalPart {
    /// The first-order descent curves of the slow segments.
    Fod(FodReport),
    /// Least squares on the rows of the slow segments.
    LeastSquares,
}

/// A node of a mirror function.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MirrorNode {
    /// Rate D \[input unit/s\].
    pub rate: f64,
    /// Change P \[input unit\].
    pub change: f64,
}

/// What a fit of a dynamic model found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DpmReport {
    /// The classical part.
    pub classical: ClassicalPart,
    /// Segments that it is from.
    pub slow_segments: usize,
    /// Mean rate of the slow segments and of the fastest one while the input moves \[input unit/s\].
    pub rates: [f64; 2],
    /// Travel over which a step at a closing loop fades \[input unit\], the best of five.
    pub fade: f64,
    /// RMS residual of all rows that were fitted, of the classical part alone \[output unit\].
    pub rmse_classical: f64,
    /// The same of the dynamic model \[output unit\].
    pub rmse: f64,
    /// Smallest and largest node value of ξ.
    pub xi: [f64; 2],
    /// Nodes at a bound.
    pub bound: usize,
    /// Nodes that no row touches: their values are those of their neighbours, and the model is a guess there.
    pub untouched: Vec<MirrorNode>,
}

/// A dynamic model and what was found on the way.
#[derive(Clone, Debug)]
pub struct DpmFit {
    /// The model.
    pub model: Model,
    /// What was found.
    pub report: DpmReport,
}

/// Fits a dynamic Preisach model: its classical part to the slow segments, its mirror function to all of them.
///
/// Segments within a factor of two of the slowest rate are the slow ones. Where they hold first-order descent curves, the
/// classical part is their Everett surface ([`fit_fod`](super::fit_fod)), else a Preisach operator by least squares. The
/// mirror's grid has 8 by 9 nodes up to the highest rate and change of the records.
///
/// # Errors
/// [`EverettError::OneRate`] if all segments have one rate; else as the fit of the classical part.
pub fn fit_dpm(record: &Record, options: &FitOptions) -> Result<DpmFit, FitError> {
    let name = || record.name();
    let mut samples = Samples::from_record(record);
    check(record, &samples)?;
    let rates: Vec<f64> = (0..samples.segments.len()).map(|s| rate(&samples, s)).collect();
    // A segment in which nothing moves has no rate.
    let slowest = rates.iter().copied().filter(|r| *r > 0.0).fold(f64::INFINITY, f64::min);
    let fastest = rates.iter().copied().fold(0.0, f64::max);
    let slow: Vec<usize> = (0..rates.len()).filter(|s| rates[*s] <= SLOW * slowest).collect();
    if fastest <= SLOW * slowest {
        return Err(EverettError::OneRate { record: name(), slowest, fastest }.into());
    }
    let mut quiet = samples.segments_only(&slow);
    let (preisach, classical) = match Surface::measure(&name(), &quiet, None) {
        Ok(surface) => {
            let (valid, report) = fod::checked(&surface, &name(), false)?;
            (valid.params(), ClassicalPart::Fod(report))
        }
        Err(_) => {
            let basis = PreisachBasis::for_samples(&quiet, CELLS);
            let fitted = fit_settled(&mut quiet, &basis, options, &name)?;
            for (s, own) in slow.iter().zip(&quiet.segments) {
                samples.settling[samples.segments[*s].clone()].copy_from_slice(&quiet.settling[own.clone()]);
            }
            (basis.spec(&fitted.weights), ClassicalPart::LeastSquares)
        }
    };
    let grid = mirror_grid(&samples);
    let zero_of_segment: Vec<usize> =
        samples.file_of_segment.iter().map(|file| if options.zero_per_record { *file } else { 0 }).collect();
    let problem =
        MirrorProblem { samples: &samples, classical: &preisach, grid: &grid, zero_of_segment: &zero_of_segment };
    let (low, high) = samples.input_range();
    let stage = |source| FitError::Stage { record: record.name(), source };
    let mut best: Option<(f64, MirrorFit)> = None;
    for share in FADES {
        let fade = share * (high - low);
        let fit = problem.fit(fade).map_err(stage)?;
        if let Some(fit) = fit.filter(|fit| best.as_ref().is_none_or(|(_, b)| fit.rmse < b.rmse)) {
            best = Some((fade, fit));
        }
    }
    let (fade, fit) = best.ok_or_else(|| FitError::Unsolvable { record: name() })?;
    let plain = problem.output(vec![1.0; grid.rates * grid.changes], fade).map_err(stage)?;
    let rows = || (0..samples.len()).filter(|k| !samples.settling[*k]);
    let mean = rows().map(|k| samples.output[k] - plain[k]).sum::<f64>() / rows().count().max(1) as f64;
    let squares = rows().map(|k| (samples.output[k] - plain[k] - mean).powi(2)).sum::<f64>();
    let node = |k: usize| {
        let on = |low: f64, high: f64, nodes: usize, k: usize| low + (high - low) * k as f64 / (nodes - 1) as f64;
        MirrorNode {
            rate: on(grid.rate_low, grid.rate_high, grid.rates, k / grid.changes),
            change: on(grid.change_low, grid.change_high, grid.changes, k % grid.changes),
        }
    };
    let (least, most) = crate::samples::range(fit.mirror.weights.iter().copied());
    let report = DpmReport {
        classical,
        slow_segments: slow.len(),
        rates: [slowest, fastest],
        fade,
        rmse_classical: (squares / rows().count().max(1) as f64).sqrt(),
        rmse: fit.rmse,
        xi: [least, most],
        bound: fit.bound,
        untouched: fit.untouched.iter().map(|k| node(*k)).collect(),
    };
    let zero = fit.zeros.iter().sum::<f64>() / fit.zeros.len() as f64;
    let base = Base::Dpm(DpmParams { preisach, mirror: fit.mirror, fade });
    let model = model_of(record, &samples, base, zero, options.seed);
    model.build(samples.period).map_err(stage)?;
    Ok(DpmFit { model, report })
}

/// Mean rate of a segment while the input moves \[input unit/s\].
fn rate(samples: &Samples, segment: usize) -> f64 {
    let u = &samples.input[samples.segments[segment].clone()];
    let (low, high) = crate::samples::range(u.iter().copied());
    let moves = || u.windows(2).map(|w| (w[1] - w[0]).abs());
    // Rows at rest do not make a drive slow; a millionth of the swing is rest.
    let moving = moves().filter(|m| *m > 1e-6 * (high - low)).count();
    moves().sum::<f64>() / (moving.max(1) as f64 * samples.period)
}

/// A grid up to the highest mean rate since a reversal and the largest change that the records have.
fn mirror_grid(samples: &Samples) -> MirrorParams<Vec<f64>> {
    let (low, high) = samples.input_range();
    let mut rates = Vec::new();
    let mut largest = 0.0f64;
    for rows in &samples.segments {
        let u = &samples.input[rows.clone()];
        let (mut from, mut age, mut up) = (u[0], 0usize, true);
        for w in u.windows(2) {
            if w[1] != w[0] && (w[1] > w[0]) != up {
                (from, age, up) = (w[0], 0, w[1] > w[0]);
            }
            age += 1;
            let change = (w[1] - from).abs();
            largest = largest.max(change);
            // The first samples of a branch have rates of their own; they carry next to no output.
            if change > 0.1 * (high - low) {
                rates.push(change / (age as f64 * samples.period));
            }
        }
    }
    rates.sort_by(f64::total_cmp);
    let highest = rates.get(rates.len().saturating_sub(1 + rates.len() / 1000)).copied().unwrap_or(1.0);
    let (rates, changes) = NODES;
    MirrorParams {
        rate_low: highest / rates as f64,
        rate_high: highest,
        rates,
        change_low: -largest,
        change_high: largest,
        changes,
        weights: Vec::new(),
    }
}
