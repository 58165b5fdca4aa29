//! How well the record determines each parameter.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use realfft::RealFftPlanner;
use realfft::num_complex::Complex;

/// Relative standard error above which a parameter is not determined. The error is relative to the scale, which is half
/// of the plausible range.
pub(super) const MAX_RELATIVE_ERROR: f64 = 0.5;
/// Relative standard error above which an error is not small.
const SMALL_RELATIVE_ERROR: f64 = 0.05;
/// Minimum ratio of a parameter's error to its error with all others known, for a parameter that is known only together
/// with others.
const MIN_INFLATION: f64 = 20.0;
/// Minimum entry of a parameter in a trade-off, relative to the largest one.
const MIN_TRADE_OFF_ENTRY: f64 = 0.1;

/// How well a parameter is determined.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Determined {
    /// The record determines it.
    Yes,
    /// Determined and close to zero: within two standard errors, which are small.
    NearZero,
    /// Determined only together with others.
    /// With the others known its error would be twenty times smaller, and the error exceeds a twentieth of its value.
    /// The prediction for this record is known; this number is not.
    Together,
    /// Not determined.
    /// Its standard error exceeds half of a large change, or it exceeds a twentieth and the value may be zero.
    /// A large change is half of the bounds for a searched variable (at most a factor of e). For a weight or gain it is
    /// the value that makes an output like the measured one; for a part of a curve, the whole curve.
    No,
}

/// One identified parameter.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Parameter {
    /// Path in the model's file; elements of lists with an index, `weights[3]`.
    pub name: String,
    /// Value.
    pub value: f64,
    /// Standard error, for noise of the size and the correlation of the residual.
    pub std_error: f64,
    /// How well it is determined.
    pub determined: Determined,
}

/// Parameters that can be changed together without an effect on the prediction of the record.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct TradeOff {
    /// Names and relative changes, as shares of their scales; the largest is 1.
    pub changes: Vec<(String, f64)>,
    /// Standard error along this direction, in the same shares.
    pub std_error: f64,
}

/// The parameters of a model with their standard errors and correlations.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Estimate {
    /// The parameters.
    pub parameters: Vec<Parameter>,
    /// Correlation of each pair of parameters.
    pub correlations: Vec<Vec<f64>>,
    /// Directions that the record does not determine.
    pub trade_offs: Vec<TradeOff>,
    /// Root mean square of the residual \[y\].
    pub left: f64,
    /// Correlation of the residual: rows per independent row.
    pub rows_per_independent: f64,
    /// Number of fitted numbers, including those at a bound and without sensor zeros.
    /// A file may have more parameters, if several follow from one number.
    pub fitted: usize,
    /// Parameters held at a bound; they have no standard error.
    pub held: Vec<String>,
    #[serde(skip)]
    covariance: DMatrix<f64>,
}

/// Inputs of the standard errors: the normal equations of a fit and its residual.
pub(crate) struct Evidence<'a> {
    /// Names and values of the parameters.
    pub(crate) parameters: Vec<(String, f64)>,
    /// Large change of each parameter.
    pub(crate) scales: Vec<f64>,
    /// Size that the error of a parameter is compared with: its own value, or the whole of the curve that it is a part
    /// of.
    pub(crate) sizes: Vec<f64>,
    /// Change of each parameter with each unknown of the fit, both in units of their scales.
    pub(crate) map: DMatrix<f64>,
    /// `JᵀJ`, with J the change of the output with each unknown, in units of its scale.
    pub(crate) normal: DMatrix<f64>,
    /// Residual in the rows that were fitted.
    pub(crate) noise: &'a Noise,
    /// Number of unknowns that are not at a bound, sensor zeros included.
    pub(crate) unknowns: usize,
    /// Number of fitted numbers.
    pub(crate) fitted: usize,
    /// Minimum standard error of each unknown, in units of its scale, independent of the slope at the optimum.
    pub(crate) at_least: Vec<f64>,
    /// Parameters at a bound.
    pub(crate) held: Vec<String>,
}

impl Estimate {
    /// Computes standard errors from normal equations.
    ///
    /// The covariance of the unknowns is `σ² κ (JᵀJ)⁻¹`, with J the derivatives of the output, σ² the mean square of
    /// the residual and κ the number of rows per independent row.
    pub(crate) fn of(evidence: Evidence<'_>) -> Self {
        let Evidence { parameters: all, scales, sizes, map, mut normal, .. } = evidence;
        let Evidence { noise, unknowns, fitted, at_least, held, .. } = evidence;
        let n = all.len();
        let variance = noise.variance(unknowns);
        let (covariance, _) = inverse(&normal);
        for (u, least) in at_least.iter().enumerate() {
            let own = (variance * covariance[(u, u)]).sqrt();
            if *least > own {
                // Equivalent to an output that changes less with this unknown by this factor. Correlations are kept.
                normal.row_mut(u).scale_mut(own / least);
                normal.column_mut(u).scale_mut(own / least);
            }
        }
        let (covariance, directions) = inverse(&normal);
        let covariance = &map * covariance * map.transpose() * variance;
        let mut trade_offs = Vec::new();
        for (direction, spread) in directions {
            let direction = &map * direction;
            let largest = direction.iter().fold(0.0f64, |m, x| if x.abs() > m.abs() { *x } else { m });
            let std_error = (variance * spread).sqrt() * largest.abs();
            if std_error > SMALL_RELATIVE_ERROR {
                let entries = direction.iter().zip(&all).filter(|(x, _)| x.abs() > MIN_TRADE_OFF_ENTRY * largest.abs());
                let changes = entries.map(|(x, (name, _))| (name.clone(), x / largest)).collect();
                trade_offs.push(TradeOff { changes, std_error });
            }
        }
        trade_offs.sort_by(|a, b| b.std_error.total_cmp(&a.std_error));
        let size = |i: usize| covariance[(i, i)].max(0.0).sqrt();
        // Standard error if each unknown were estimated with all others known.
        let alone = |i: usize| {
            let of = |u: usize| map[(i, u)] * map[(i, u)] / normal[(u, u)].max(f64::MIN_POSITIVE);
            (variance * (0..map.ncols()).map(of).sum::<f64>()).sqrt()
        };
        let parameter = |i: usize| {
            let (name, value) = all[i].clone();
            let (share, std_error) = (size(i), size(i) * scales[i]);
            let zero = value.abs() < 2.0 * std_error;
            let determined = if share > MAX_RELATIVE_ERROR || (zero && share > SMALL_RELATIVE_ERROR) {
                Determined::No
            } else if zero {
                Determined::NearZero
            } else if std_error > SMALL_RELATIVE_ERROR * sizes[i] && share > MIN_INFLATION * alone(i) {
                Determined::Together
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
            left: noise.rms(),
            rows_per_independent: noise.rows_per_independent,
            fitted,
            covariance: natural,
            held,
        }
    }

    /// Returns the standard error of a function of the parameters, such as a product or a ratio.
    /// `gradient` is with respect to [`parameters`](Self::parameters).
    pub fn std_error_of(&self, gradient: &[f64]) -> f64 {
        let g = DVector::from_column_slice(gradient);
        (g.transpose() * &self.covariance * &g)[(0, 0)].max(0.0).sqrt()
    }

    /// Returns the parameter with this name.
    pub fn parameter(&self, name: &str) -> Option<&Parameter> {
        self.parameters.iter().find(|p| p.name == name)
    }

    /// Returns the parameters that the record does not determine, or only together with others.
    pub fn undetermined(&self) -> Vec<&str> {
        let vague = |p: &&Parameter| matches!(p.determined, Determined::No | Determined::Together);
        self.parameters.iter().filter(vague).map(|p| p.name.as_str()).collect()
    }
}

/// Returns the inverse of normal equations, and its eigenvectors with their variances. Eigenvalues below the accuracy
/// of difference quotients are limited, so the variances stay finite.
fn inverse(normal: &DMatrix<f64>) -> (DMatrix<f64>, Vec<(DVector<f64>, f64)>) {
    let n = normal.nrows();
    let eigen = SymmetricEigen::new(normal.clone());
    let floor = 1e-13 * eigen.eigenvalues.amax().max(f64::MIN_POSITIVE);
    let of = |i: usize| (eigen.eigenvectors.column(i).into_owned(), 1.0 / eigen.eigenvalues[i].max(floor));
    let directions: Vec<_> = (0..n).map(of).collect();
    let sum = directions.iter().fold(DMatrix::zeros(n, n), |sum, (d, spread)| sum + d * d.transpose() * *spread);
    (sum, directions)
}

/// Residual of a fit in the rows that it used, treated as noise.
#[derive(Clone, Debug)]
pub(crate) struct Noise {
    squares: f64,
    rows: usize,
    /// Ratio of the variance of a mean over the rows to that of independent rows.
    rows_per_independent: f64,
}

impl Noise {
    /// Estimates the noise from measured minus predicted output, row by row; `lengths` is the number of rows of each
    /// segment.
    pub(crate) fn of(residual: &[f64], lengths: &[usize]) -> Self {
        Self {
            squares: residual.iter().map(|r| r * r).sum(),
            rows: residual.len(),
            rows_per_independent: rows_per_independent(residual, lengths),
        }
    }

    /// Returns the variance of independent rows that would make the parameters as uncertain as these correlated ones.
    pub(crate) fn variance(&self, unknowns: usize) -> f64 {
        self.squares / self.rows.saturating_sub(unknowns).max(1) as f64 * self.rows_per_independent
    }

    fn rms(&self) -> f64 {
        (self.squares / self.rows.max(1) as f64).sqrt()
    }
}

/// Returns `1 + 2 Σ ρₗ` over the first lags with a clearly positive correlation within segments: more than two of its
/// standard errors (Bartlett's), which grow with the earlier correlations. So repeating each row ten times does not
/// reduce the standard errors.
fn rows_per_independent(residual: &[f64], lengths: &[usize]) -> f64 {
    let n = residual.len();
    let mean = residual.iter().sum::<f64>() / n.max(1) as f64;
    let mut rest = residual;
    let segments: Vec<&[f64]> =
        lengths.iter().map(|length| rest.split_off(..(*length).min(rest.len())).unwrap_or_default()).collect();
    let product = |lag: usize| -> f64 {
        let of = |own: &&[f64]| -> f64 {
            own.iter().zip(own.get(lag..).unwrap_or_default()).map(|(a, b)| (a - mean) * (b - mean)).sum()
        };
        segments.iter().map(of).sum()
    };
    let variance = product(0);
    if variance.is_nan() || variance <= 0.0 {
        return 1.0;
    }
    let longest = segments.iter().map(|own| own.len()).max().unwrap_or(0);
    let mut all = Vec::new();
    let (mut sum, mut squares) = (1.0, 1.0);
    for lag in 1..longest {
        if lag == DIRECT_LAGS {
            all = products(&segments, mean, longest);
        }
        let rho = all.get(lag).copied().unwrap_or_else(|| product(lag)) / variance;
        if rho < 2.0 * (squares / n as f64).sqrt() {
            break;
        }
        sum += 2.0 * rho;
        squares += 2.0 * rho * rho;
    }
    sum
}

/// Number of lags whose products are summed directly: white noise needs no more.
const DIRECT_LAGS: usize = 16;

/// Returns the products `Σ (rₖ − mean) (rₖ₊ₗ − mean)` within segments, for all lags.
fn products(segments: &[&[f64]], mean: f64, longest: usize) -> Vec<f64> {
    let mut planner = RealFftPlanner::new();
    let mut products = vec![0.0; longest];
    for own in segments {
        autocorrelate(&mut planner, own, mean, &mut products);
    }
    products
}

/// Adds the products `Σ (rₖ − mean) (rₖ₊ₗ − mean)` of one segment, for all lags.
fn autocorrelate(planner: &mut RealFftPlanner<f64>, own: &[f64], mean: f64, products: &mut [f64]) {
    if own.is_empty() {
        return;
    }
    // Zero padding, because a transform is circular.
    let length = (2 * own.len()).next_power_of_two();
    let (forward, back) = (planner.plan_fft_forward(length), planner.plan_fft_inverse(length));
    let (mut time, mut spectrum) = (forward.make_input_vec(), forward.make_output_vec());
    time.iter_mut().zip(own).for_each(|(x, r)| *x = r - mean);
    if forward.process(&mut time, &mut spectrum).is_err() {
        return;
    }
    spectrum.iter_mut().for_each(|x| *x = Complex::new(x.norm_sqr(), 0.0));
    if back.process(&mut spectrum, &mut time).is_err() {
        return;
    }
    for (product, x) in products.iter_mut().zip(&time).take(own.len()) {
        *product += x / length as f64;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Autoregressive noise over `rows` with the coefficient `kept` and variance 1.
    fn correlated(rows: usize, kept: f64, seed: u64) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
        let mut x = normal();
        (0..rows)
            .map(|_| {
                x = kept * x + (1.0 - kept * kept).sqrt() * normal();
                x
            })
            .collect()
    }

    #[test]
    fn rows_per_independent_row_match_white_and_autoregressive_noise() {
        let white = Noise::of(&correlated(20_000, 0.0, 1), &[20_000]).rows_per_independent;
        assert!((white - 1.0).abs() < 0.1, "{white}");
        // (1 + r) / (1 − r), over far more than two hundred lags.
        for (kept, expected) in [(0.5, 3.0), (0.98, 99.0), (0.998, 999.0)] {
            let found = Noise::of(&correlated(400_000, kept, 2), &[400_000]).rows_per_independent;
            assert!((found / expected - 1.0).abs() < 0.25, "{kept}: {found}, {expected} expected");
        }
    }

    #[test]
    fn ten_repeated_rows_count_as_one() {
        let slow = correlated(4000, 0.9, 3);
        let once = Noise::of(&slow, &[4000]);
        let held: Vec<f64> = slow.iter().flat_map(|x| [*x; 10]).collect();
        let between = |k: usize| slow[k / 10] + (slow[(k / 10 + 1).min(3999)] - slow[k / 10]) * (k % 10) as f64 / 10.0;
        let smooth: Vec<f64> = (0..40_000).map(between).collect();
        for (what, finer) in [("held", held), ("on lines", smooth)] {
            let finer = Noise::of(&finer, &[40_000]);
            // Ten times the normal equations, but the same certainty.
            let ratio = finer.variance(0) / 10.0 / once.variance(0);
            assert!((ratio - 1.0).abs() < 0.2, "{what}: {ratio}");
        }
    }

    #[test]
    fn segments_are_independent() {
        // Each segment has its own level: rows of one segment are correlated, neighbours across a border are not.
        let levels = correlated(400, 0.0, 4);
        let rows: Vec<f64> = levels.iter().flat_map(|x| [*x; 50]).collect();
        let found = Noise::of(&rows, &vec![50; 400]).rows_per_independent;
        assert!((found / 50.0 - 1.0).abs() < 0.2, "{found}");
    }

    #[test]
    fn a_minimum_error_of_an_unknown_reaches_all_dependent_parameters() {
        let noise = Noise::of(&correlated(1000, 0.0, 5), &[1000]);
        let sigma = noise.variance(0).sqrt();
        // Two correlated unknowns with equal standard errors; the second parameter is the sum of both.
        let of = |at_least: f64| {
            Estimate::of(Evidence {
                parameters: vec![("a".into(), 5.0), ("b".into(), 7.0)],
                scales: vec![1.0, 2.0],
                sizes: vec![5.0, 7.0],
                map: DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.5, 0.5]),
                normal: DMatrix::from_row_slice(2, 2, &[1e4, 5e3, 5e3, 1e4]),
                noise: &noise,
                unknowns: 0,
                fitted: 2,
                at_least: vec![at_least, 0.0],
                held: Vec::new(),
            })
        };
        let (plain, wide) = (of(0.0), of(0.2));
        let one = 0.01 * sigma / 0.75f64.sqrt();
        let off = |estimate: &Estimate, expected: [f64; 2]| {
            for (i, (p, expected)) in estimate.parameters.iter().zip(expected).enumerate() {
                assert!((p.std_error / expected - 1.0).abs() < 1e-9, "{p:?}, {expected} expected");
                let gradient = [f64::from(u8::from(i == 0)), f64::from(u8::from(i == 1))];
                assert!((estimate.std_error_of(&gradient) / expected - 1.0).abs() < 1e-9, "{p:?}");
            }
        };
        off(&plain, [one, one]);
        off(&wide, [0.2, (0.04 + one * one - 0.2 * one).sqrt()]);
        assert_eq!(plain.parameters, of(0.5 * one).parameters);
    }
}
