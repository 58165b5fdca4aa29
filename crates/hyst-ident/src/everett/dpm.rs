//! Fits the dynamic Preisach model to records at several rates.

use hyst_core::{DpmParams, MirrorParams};
use serde::Serialize;

use super::mirror::{MirrorFit, MirrorProblem};
use super::{EverettError, FodReport, Surface, fod};
use crate::base::PreisachBasis;
use crate::error::FitError;
use crate::fit::convex::cells;
use crate::fit::{CELLS, Fit, FitOptions, check, fit_settled, model_of};
use crate::identify::TableEstimate;
use crate::model::{Base, Model};
use crate::record::Record;
use crate::samples::Samples;

/// Maximum rate of a segment of the classical part, as a multiple of the slowest rate.
const MAX_SLOW_RATIO: f64 = 2.0;
/// Minimum change of a branch whose rate is compared, as a share of the input's range.
const LARGE_BRANCH: f64 = 0.5;
/// Nodes of the mirror function along rate and change, as in the paper (Chen et al., section III).
const NODES: (usize, usize) = (8, 9);
/// Candidates for the travel over which a step fades, as shares of the input's range.
const FADE_SHARES: [f64; 5] = [0.01, 0.03, 0.1, 0.2, 0.4];
/// Maximum ratio of the cross-validated error to the smallest one. The longest such fade is used, because it makes the
/// smoothest drives.
const RMSE_TOLERANCE: f64 = 1.02;

/// Source of the classical part of a dynamic model.
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

/// Result of a fit of a dynamic model.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DpmReport {
    /// The classical part.
    pub classical: ClassicalPart,
    /// Number of segments that it was fitted to; 0 if the rates differ only inside the segments and all rows give both
    /// parts.
    pub slow_segments: usize,
    /// Mean rate of the slow segments, or of the slowest branch, and of the fastest one while the input moves
    /// \[input unit/s\].
    pub rates: [f64; 2],
    /// Travel over which a step at a closing loop fades \[input unit\].
    pub fade: f64,
    /// RMS residual of the classical part alone in the faster segments, or in all rows \[output unit\].
    pub rmse_classical: f64,
    /// The same of the dynamic model \[output unit\].
    pub rmse: f64,
    /// The same over segments that were left out of the fit in turn \[output unit\]. If it is much above `rmse`, more
    /// rates are needed. Absent if there is only one faster segment.
    pub rmse_left_out: Option<f64>,
    /// Smallest and largest node value of ξ.
    pub xi: [f64; 2],
    /// Nodes at a bound.
    pub bound: usize,
    /// Nodes that no row depends on: their values follow their neighbours, and the model is uncertain there.
    pub untouched: Vec<MirrorNode>,
}

/// A dynamic model with its report.
#[derive(Clone, Debug)]
pub struct DpmFit {
    /// The model.
    pub model: Model,
    /// Result of the fit.
    pub report: DpmReport,
    /// Determination of the cells of the classical part, unless it was measured, and of the nodes of the mirror
    /// function.
    pub tables: Vec<TableEstimate>,
}

impl From<DpmFit> for Fit {
    fn from(found: DpmFit) -> Self {
        let how = "convex: the classical part from the slow rows, then the nodes of the mirror function";
        Self { tables: found.tables, ..Self::at_once(found.model, how) }
    }
}

/// Fits a dynamic Preisach model: its classical part to the slow segments, its mirror function to the others.
///
/// Segments within a factor of two of the slowest rate are slow. If all are, but the branches over half of the range are
/// not, both parts are fitted to all rows. If the slow segments contain first-order descent curves, the
/// classical part is their Everett surface ([`fit_fod`](super::fit_fod)), otherwise a Preisach operator by least
/// squares. The grid of the mirror function has 8 by 9 nodes up to the highest rate and change of the records.
///
/// # Errors
/// [`EverettError::OneRate`] if all segments have one rate; errors of the fit of the classical part.
pub fn fit_dpm(record: &Record, options: &FitOptions) -> Result<DpmFit, FitError> {
    let name = || record.name();
    record.need_one_sample_period("a fit of a dynamic Preisach model")?;
    let mut samples = Samples::from_record(record);
    check(record, &samples, samples.falls)?;
    let Rates { slowest, fastest, slow, fast, only_inside } =
        Rates::of(&samples).map_err(|[slowest, fastest]| EverettError::OneRate { record: name(), slowest, fastest })?;
    let mut slow_samples = samples.segments_only(&slow);
    let mut tables = Vec::new();
    let (preisach, classical) = match Surface::measure(&name(), &slow_samples, None) {
        // Descent curves at several rates are no measurement of the classical part.
        Ok(surface) if !only_inside => {
            let (valid, report) = fod::checked(&surface, &name(), false)?;
            (valid.params(), ClassicalPart::Fod(report))
        }
        _ => {
            let basis = PreisachBasis::for_samples(&slow_samples, CELLS);
            let (fitted, residual) = fit_settled(&mut slow_samples, &basis, options, &name)?;
            tables.push(cells(&fitted, &slow_samples, &residual));
            for (s, own) in slow.iter().zip(&slow_samples.segments) {
                samples.settling[samples.segments[*s].clone()].copy_from_slice(&slow_samples.settling[own.clone()]);
            }
            (basis.spec(&fitted.weights), ClassicalPart::LeastSquares)
        }
    };
    let grid = mirror_grid(&samples);
    let fast = samples.segments_only(&fast);
    let zero_of_segment = zeros(&fast, options.zero_per_record);
    let problem =
        MirrorProblem { samples: &fast, classical: &preisach, grid: &grid, zero_of_segment: &zero_of_segment };
    let (low, high) = samples.input_range();
    let stage = |source| FitError::Stage { record: record.name(), source };
    let mut fits: Vec<(f64, MirrorFit)> = Vec::new();
    for share in FADE_SHARES {
        let fade = share * (high - low);
        fits.extend(problem.fit(fade).map_err(stage)?.map(|fit| (fade, fit)));
    }
    let error = |fit: &MirrorFit| fit.left_out.unwrap_or(fit.rmse);
    let least = fits.iter().map(|(_, fit)| error(fit)).fold(f64::INFINITY, f64::min);
    let longest = fits.into_iter().rfind(|(_, fit)| error(fit) <= RMSE_TOLERANCE * least);
    let (fade, fit) = longest.ok_or_else(|| FitError::Unsolvable { record: name() })?;
    let classical_output = problem.output(vec![1.0; grid.rates * grid.changes], fade).map_err(stage)?;
    let residuals = || fast.output.iter().zip(&classical_output).map(|(y, p)| y - p);
    let mean = residuals().sum::<f64>() / fast.len() as f64;
    let squares = residuals().map(|e| (e - mean) * (e - mean)).sum::<f64>();
    let node = |k: usize| {
        let on = |low: f64, high: f64, nodes: usize, k: usize| low + (high - low) * k as f64 / (nodes - 1) as f64;
        MirrorNode {
            rate: on(grid.rate_low, grid.rate_high, grid.rates, k / grid.changes),
            change: on(grid.change_low, grid.change_high, grid.changes, k % grid.changes),
        }
    };
    let (least, most) = crate::statistics::range(fit.mirror.weights.iter().copied());
    let report = DpmReport {
        classical,
        slow_segments: if only_inside { 0 } else { slow.len() },
        rates: [slowest, fastest],
        fade,
        rmse_classical: (squares / fast.len() as f64).sqrt(),
        rmse: fit.rmse,
        rmse_left_out: fit.left_out,
        xi: [least, most],
        bound: fit.bound,
        untouched: fit.untouched.iter().map(|k| node(*k)).collect(),
    };
    let zero = fit.zeros.iter().sum::<f64>() / fit.zeros.len() as f64;
    let base = Base::Dpm(DpmParams { preisach, mirror: fit.mirror, fade });
    let model = model_of(record, &samples, base, zero, options.seed);
    model.build(samples.period).map_err(stage)?;
    tables.push(fit.table);
    Ok(DpmFit { model, report, tables })
}

/// Division of a record by rate.
struct Rates {
    slowest: f64,
    fastest: f64,
    /// Segments of the classical part.
    slow: Vec<usize>,
    /// Segments of the mirror function: without the slow ones, whose rows would outweigh the others.
    fast: Vec<usize>,
    /// Whether the rates differ only inside the segments. Both parts are then all segments, because the slow branches
    /// alone determine few cells.
    only_inside: bool,
}

impl Rates {
    /// Divides the segments by their mean rates or, if these agree, by those of their large branches. Returns the
    /// slowest and the fastest rate if these agree too.
    fn of(samples: &Samples) -> Result<Self, [f64; 2]> {
        let all = 0..samples.segments.len();
        let rates: Vec<f64> = all.clone().map(|s| rate(&samples.input[samples.segments[s].clone()], samples)).collect();
        let range = |rates: &[f64]| {
            // Without motion there is no rate.
            let slowest = rates.iter().copied().filter(|r| *r > 0.0).fold(f64::INFINITY, f64::min);
            (slowest, rates.iter().copied().fold(0.0, f64::max))
        };
        let (slowest, fastest) = range(&rates);
        if fastest > MAX_SLOW_RATIO * slowest {
            let (slow, fast) = all.partition(|s| rates[*s] <= MAX_SLOW_RATIO * slowest);
            return Ok(Self { slowest, fastest, slow, fast, only_inside: false });
        }
        // At one frequency the rate grows with the change, and the mirror function is unknown elsewhere. So only
        // branches of comparable change count.
        let inside = large_branch_rates(samples);
        if inside.is_empty() {
            return Err([slowest, fastest]);
        }
        let (slowest, fastest) = range(&inside);
        if fastest <= MAX_SLOW_RATIO * slowest {
            return Err([slowest, fastest]);
        }
        Ok(Self { slowest, fastest, slow: all.clone().collect(), fast: all.collect(), only_inside: true })
    }
}

/// Returns the mean rate of each monotone branch over at least [`LARGE_BRANCH`] of the input's range \[input unit/s\].
fn large_branch_rates(samples: &Samples) -> Vec<f64> {
    let (low, high) = samples.input_range();
    let mut rates = Vec::new();
    for segment in &samples.segments {
        let u = &samples.input[segment.clone()];
        for branch in u.chunk_by(|a, b| b >= a).chain(u.chunk_by(|a, b| b <= a)) {
            if (branch[branch.len() - 1] - branch[0]).abs() >= LARGE_BRANCH * (high - low) {
                rates.push(rate(branch, samples));
            }
        }
    }
    rates
}

/// Returns the mean rate of a drive while it moves \[input unit/s\].
fn rate(u: &[f64], samples: &Samples) -> f64 {
    let (low, high) = crate::statistics::range(u.iter().copied());
    let moves = || u.windows(2).map(|w| (w[1] - w[0]).abs());
    // Rows at rest do not count; a step of less than a millionth of the range is rest.
    let moving = moves().filter(|m| *m > 1e-6 * (high - low)).count();
    moves().sum::<f64>() / (moving.max(1) as f64 * samples.period)
}

/// Returns the index of each segment's sensor zero: one zero for all, or one per file.
fn zeros(samples: &Samples, per_file: bool) -> Vec<usize> {
    let mut files: Vec<usize> = Vec::new();
    let mut place = |file: &usize| {
        files.iter().position(|f| f == file).unwrap_or_else(|| {
            files.push(*file);
            files.len() - 1
        })
    };
    samples.file_of_segment.iter().map(|file| if per_file { place(file) } else { 0 }).collect()
}

/// Returns a grid up to the highest mean rate since a reversal and the largest change in the records.
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
            // The first samples of a branch have exceptional rates, but contribute almost no output.
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
