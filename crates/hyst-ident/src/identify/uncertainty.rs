//! What the record says about each parameter, and what it cannot say.

use nalgebra::{DMatrix, SymmetricEigen};

use super::profile::Interval;

/// A parameter that may be off by more than this share of its scale is not determined.
pub(super) const VAGUE: f64 = 0.5;
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
    /// Parameters at a bound: they are held there, and have no error.
    pub held: Vec<String>,
    #[serde(skip)]
    covariance: DMatrix<f64>,
}

/// What standard errors are made of: the normal equations of a fit, and what it has left.
pub(crate) struct Evidence<'a> {
    /// Names and values of the parameters.
    pub(crate) parameters: Vec<(String, f64)>,
    /// The change of each that counts as a large one.
    pub(crate) scales: Vec<f64>,
    /// `JᵀJ`, J the change of the output with each parameter, in units of its scale.
    pub(crate) normal: DMatrix<f64>,
    /// Measured minus predicted output in the rows that were fitted.
    pub(crate) residual: &'a [f64],
    /// Unknowns of the fit.
    pub(crate) unknowns: usize,
    /// Parameters at a bound.
    pub(crate) held: Vec<String>,
}

impl Estimate {
    /// Standard errors from normal equations.
    ///
    /// The covariance is `σ² κ (JᵀJ)⁻¹` with J the slopes of the output, σ² the mean square of what is left and κ its rows per
    /// independent one.
    pub(crate) fn of(evidence: Evidence<'_>) -> Self {
        let Evidence { parameters: all, scales, normal, residual, unknowns, held } = evidence;
        let n = all.len();
        let freedom = residual.len().saturating_sub(unknowns).max(1) as f64;
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
                let entries = direction.iter().zip(&all).filter(|(x, _)| x.abs() > PART * largest.abs());
                let changes = entries.map(|(x, (name, _))| (name.clone(), x / largest)).collect();
                trade_offs.push(TradeOff { changes, std_error: std_error * largest.abs() });
            }
        }
        trade_offs.sort_by(|a, b| b.std_error.total_cmp(&a.std_error));
        let size = |i: usize| covariance[(i, i)].max(0.0).sqrt();
        // Standard error if all others were known.
        let alone = |i: usize| (variance / normal[(i, i)].max(f64::MIN_POSITIVE)).sqrt();
        let parameter = |i: usize| {
            let (name, value) = all[i].clone();
            let (share, std_error) = (size(i), size(i) * scales[i]);
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
        let natural = DMatrix::from_fn(n, n, |i, j| covariance[(i, j)] * scales[i] * scales[j]);
        Estimate {
            parameters,
            correlations,
            trade_offs,
            left: (squares / residual.len().max(1) as f64).sqrt(),
            rows_per_independent: correlated,
            covariance: natural,
            held,
        }
    }

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
