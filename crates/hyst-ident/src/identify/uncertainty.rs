//! What the record says about each parameter, and what it cannot say.

use hyst_core::{Params, Sampling};
use nalgebra::{DMatrix, SymmetricEigen};
use rayon::prelude::*;

use super::family::Family;
use super::profile::Interval;
use crate::Samples;
use crate::drive::{Drive, Passes};
use crate::model::{Base, Operator};

/// Relative step of the difference quotients.
const STEP: f64 = 1e-5;
/// A parameter that may be off by more than this share of its scale is not determined.
const VAGUE: f64 = 0.5;
/// An error of this share of its scale is a small one.
const SOME: f64 = 0.05;
/// By how much the others make a parameter less certain that is known only together with them.
const ALONE: f64 = 20.0;
/// Share of a direction's largest entry from which on a parameter takes part in a trade.
const PART: f64 = 0.1;
/// Lags over which the residual's correlation is summed.
const LAGS: usize = 200;

/// How well a parameter is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Determined {
    /// The record determines it.
    Yes,
    /// It is known, and known to be about zero: within two standard errors.
    NearZero,
    /// Only together with others: alone it would be known twenty times as well, and it may be off by more than a twentieth. What
    /// the model does with this record is known; this number is not.
    Together,
    /// The record does not determine it: its standard error is more than half of its own size.
    No,
}

/// One identified parameter.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Parameter {
    /// Its path in the model's file; elements of lists with their number, `weights[3]`.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its standard error: of noise as large, and as correlated, as what the model leaves.
    pub std_error: f64,
    /// How well it is known.
    pub determined: Determined,
}

/// Parameters that can be changed together without a trace in the record.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct TradeOff {
    /// Names, and by how much each changes, as a share of its scale; the largest change is 1.
    pub changes: Vec<(String, f64)>,
    /// How far along this direction the record lets the parameters go: one standard error, in the same shares.
    pub std_error: f64,
}

/// The parameters of a model with what the record says about them.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Estimate {
    /// The parameters.
    pub parameters: Vec<Parameter>,
    /// Correlation of each two of them.
    pub correlations: Vec<Vec<f64>>,
    /// Directions that the record does not determine.
    pub trade_offs: Vec<TradeOff>,
    /// Root mean square of what is left \[y\].
    pub left: f64,
    /// By how much what is left is correlated: rows per independent one.
    pub rows_per_independent: f64,
    #[serde(skip)]
    covariance: DMatrix<f64>,
}

impl Estimate {
    /// Standard error of a quantity with this gradient with respect to [`parameters`](Self::parameters): a product, a ratio.
    pub fn std_error_of(&self, gradient: &[f64]) -> f64 {
        let g = nalgebra::DVector::from_column_slice(gradient);
        (g.transpose() * &self.covariance * &g)[(0, 0)].max(0.0).sqrt()
    }

    /// Takes in what a section of the likelihood says of a searched parameter: one that is allowed up to a side of its bounds, or over
    /// more than its own size, is not determined, whatever the slope at the optimum says.
    pub(super) fn widen(&mut self, name: &str, interval: Interval) {
        let Some(p) = self.parameters.iter_mut().find(|p| p.name == name) else { return };
        let width = interval.high - interval.low;
        // The interval is that of two standard errors to either side.
        p.std_error = p.std_error.max(0.25 * width);
        if width > 2.0 * p.value.abs() && interval.open {
            p.determined = Determined::No;
        }
    }

    /// The parameter of that name.
    pub fn parameter(&self, name: &str) -> Option<&Parameter> {
        self.parameters.iter().find(|p| p.name == name)
    }

    /// Names of what the record does not determine, or only together with others.
    pub fn undetermined(&self) -> Vec<&str> {
        let vague = |p: &&Parameter| matches!(p.determined, Determined::No | Determined::Together);
        self.parameters.iter().filter(vague).map(|p| p.name.as_str()).collect()
    }
}

/// Names and values of a model's parameters in the order of their visit.
pub(crate) fn parameters_of(base: &Base) -> Vec<(String, f64)> {
    let mut list: Vec<(String, f64)> = Vec::new();
    base.clone().visit(&mut |meta, x| list.push((meta.name.to_owned(), *x)));
    let name = |i: usize| {
        let same = |j: &usize| list[*j].0 == list[i].0;
        if (0..list.len()).filter(same).count() > 1 {
            format!("{}[{}]", list[i].0, (0..i).filter(same).count())
        } else {
            list[i].0.clone()
        }
    };
    (0..list.len()).map(|i| (name(i), list[i].1)).collect()
}

/// The model with its `which`-th parameter changed.
fn changed(base: &Base, which: usize, to: f64) -> Base {
    let (mut other, mut i) = (base.clone(), 0);
    other.visit(&mut |_, x| {
        if i == which {
            *x = to;
        }
        i += 1;
    });
    other
}

/// Standard errors of the parameters of `base`, which was fitted to the settled rows of `samples` together with sensor zeros.
///
/// The covariance is `σ² κ (JᵀJ)⁻¹` with J the slopes of the output by central differences, σ² the mean square of
/// what is left and κ its rows per independent one.
pub(crate) fn estimate(
    family: &dyn Family,
    base: &Base,
    samples: &Samples,
    zero_per_record: bool,
    residual: &[f64],
) -> Estimate {
    let all = parameters_of(base);
    let which: Vec<usize> = (0..all.len()).filter(|i| family.identified(&all[*i].0)).collect();
    let (low, high) = samples.input_range();
    let drive = Drive::new(samples, family.between_samples(), Passes::Once);
    let cx = Sampling { period: drive.period() };
    let simulated = |base: &Base| {
        let operator = Operator::new(base, [low, high], &cx).ok()?;
        let mut y = vec![0.0; samples.len()];
        drive.run(&operator, &mut y);
        Some(y)
    };
    let scale = |i: usize| {
        let own = all[i].1.abs();
        let scale = family.scale(base, &all[i].0).unwrap_or(own);
        if scale > 0.0 { scale } else { 1.0 }
    };
    // Slopes per scale, the mean of each file (or of all) taken off: the zeros are fitted too.
    let slope = |i: &usize| -> Vec<f64> {
        let step = STEP * scale(*i);
        let side = |sign: f64| simulated(&changed(base, *i, all[*i].1 + sign * step));
        let (up, down) = (side(1.0), side(-1.0));
        let of = |a: &[f64], b: &[f64], width: f64| a.iter().zip(b).map(|(a, b)| (a - b) / width * scale(*i)).collect();
        let mut slope: Vec<f64> = match (up, down) {
            (Some(a), Some(b)) => of(&a, &b, 2.0 * step),
            // At a bound of the model there is one side only.
            (Some(a), None) => simulated(base).map_or_else(Vec::new, |y| of(&a, &y, step)),
            (None, Some(b)) => simulated(base).map_or_else(Vec::new, |y| of(&y, &b, step)),
            (None, None) => Vec::new(),
        };
        slope.resize(samples.len(), 0.0);
        centre(&mut slope, samples, zero_per_record);
        slope
    };
    let slopes: Vec<Vec<f64>> = which.par_iter().map(slope).collect();
    let settled: Vec<usize> = (0..samples.len()).filter(|k| !samples.settling[*k]).collect();
    let n = which.len();
    let normal = DMatrix::from_fn(n, n, |i, j| settled.iter().map(|k| slopes[i][*k] * slopes[j][*k]).sum::<f64>());
    let zeros = if zero_per_record { samples.files() } else { 1 };
    let freedom = settled.len().saturating_sub(n + zeros).max(1) as f64;
    let squares: f64 = residual.iter().map(|r| r * r).sum();
    let correlated = rows_per_independent(residual);
    let variance = squares / freedom * correlated;

    let eigen = SymmetricEigen::new(normal.clone());
    let most = eigen.eigenvalues.amax().max(f64::MIN_POSITIVE);
    // What the difference quotients cannot tell from nothing.
    let floor = 1e-13 * most;
    let mut covariance = DMatrix::zeros(n, n);
    let mut trade_offs = Vec::new();
    for (i, value) in eigen.eigenvalues.iter().enumerate() {
        let direction = eigen.eigenvectors.column(i);
        let spread = variance / value.max(floor);
        covariance += direction * direction.transpose() * spread;
        let std_error = spread.sqrt();
        let largest = direction.iter().fold(0.0f64, |m, x| if x.abs() > m.abs() { *x } else { m });
        if std_error * largest.abs() > SOME {
            let entries = direction.iter().zip(&which).filter(|(x, _)| x.abs() > PART * largest.abs());
            let changes = entries.map(|(x, i)| (all[*i].0.clone(), x / largest)).collect();
            trade_offs.push(TradeOff { changes, std_error: std_error * largest.abs() });
        }
    }
    trade_offs.sort_by(|a, b| b.std_error.total_cmp(&a.std_error));
    let size = |i: usize| covariance[(i, i)].max(0.0).sqrt();
    // Standard error if all others were known.
    let alone = |i: usize| (variance / normal[(i, i)].max(f64::MIN_POSITIVE)).sqrt();
    let parameter = |i: usize| {
        let (name, value) = all[which[i]].clone();
        let (share, std_error) = (size(i), size(i) * scale(which[i]));
        let determined = if share > VAGUE {
            Determined::No
        } else if share > SOME && share > ALONE * alone(i) {
            Determined::Together
        } else if value.abs() < 2.0 * std_error {
            Determined::NearZero
        } else {
            Determined::Yes
        };
        Parameter { name, value, std_error, determined }
    };
    let parameters: Vec<Parameter> = (0..n).map(parameter).collect();
    let correlations = (0..n)
        .map(|i| (0..n).map(|j| covariance[(i, j)] / (size(i) * size(j)).max(f64::MIN_POSITIVE)).collect())
        .collect();
    let natural = DMatrix::from_fn(n, n, |i, j| covariance[(i, j)] * scale(which[i]) * scale(which[j]));
    Estimate {
        parameters,
        correlations,
        trade_offs,
        left: (squares / residual.len().max(1) as f64).sqrt(),
        rows_per_independent: correlated,
        covariance: natural,
    }
}

fn centre(slope: &mut [f64], samples: &Samples, zero_per_record: bool) {
    let files = if zero_per_record { samples.files() } else { 1 };
    for file in 0..files {
        let own: Vec<usize> = samples
            .segments
            .iter()
            .zip(&samples.file_of_segment)
            .filter(|(_, f)| !zero_per_record || **f == file)
            .flat_map(|(s, _)| s.clone())
            .filter(|k| !samples.settling[*k])
            .collect();
        let mean = own.iter().map(|k| slope[*k]).sum::<f64>() / own.len().max(1) as f64;
        own.iter().for_each(|k| slope[*k] -= mean);
    }
}

/// `1 + 2 Σ ρₗ` over the first lags at which the correlation is clearly positive: by how much a mean over the rows varies more
/// than if they were independent.
fn rows_per_independent(residual: &[f64]) -> f64 {
    let n = residual.len();
    let mean = residual.iter().sum::<f64>() / n.max(1) as f64;
    let variance: f64 = residual.iter().map(|r| (r - mean) * (r - mean)).sum();
    if variance.is_nan() || variance <= 0.0 {
        return 1.0;
    }
    let noise = 2.0 / (n as f64).sqrt();
    let mut sum = 1.0;
    for lag in 1..LAGS.min(n / 4) {
        let products = residual.iter().zip(&residual[lag..]).map(|(a, b)| (a - mean) * (b - mean));
        let rho = products.sum::<f64>() / variance;
        if rho < noise {
            break;
        }
        sum += 2.0 * rho;
    }
    sum
}
