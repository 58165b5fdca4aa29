//! Error measures between prediction and measurement.
//!
//! Every measure takes the measured and the predicted output in the same unit, and a flag per row that is `true` in the
//! start-up rows (as marked by `simulate`). Start-up rows count only in [`Errors::rmse_all_rows`]. Errors are predicted
//! − measured.

use serde::{Deserialize, Deserializer, Serialize};

/// Reason why a measure cannot be computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum MetricsError {
    /// Columns of different length.
    #[error("{column} has {found} values, but the measurement has {expected}")]
    Lengths {
        /// Name of the column.
        column: &'static str,
        /// Length of the column.
        found: usize,
        /// Length of the measurement.
        expected: usize,
    },
    /// There is no row that counts.
    #[error("no row is left to compare: all {rows} rows are start-up rows of the model")]
    NoRows {
        /// Number of rows.
        rows: usize,
    },
    /// The measurement or the prediction is NaN or infinite.
    #[error("row {row}: the error is not a finite number (measured {measured}, predicted {predicted})")]
    NotFinite {
        /// The row; the first is 0.
        row: usize,
        /// The measured value.
        measured: f64,
        /// The predicted value.
        predicted: f64,
    },
}

/// Errors of one prediction, as printed in reports.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Errors {
    /// Root mean square error over the rows that count, in the output's unit.
    pub rmse: f64,
    /// `rmse` in percent of the span (maximum − minimum) of the measured output over the same rows.
    /// For a constant output it is 0 if `rmse` is 0, otherwise infinite (`null` in JSON).
    #[serde(deserialize_with = "null_as_infinity")]
    pub nrmse_percent: f64,
    /// Maximum magnitude of the error over the rows that count, in the output's unit.
    pub max_abs: f64,
    /// Root mean square error over all rows, in the output's unit.
    pub rmse_all_rows: f64,
}

fn null_as_infinity<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    Ok(Option::<f64>::deserialize(deserializer)?.unwrap_or(f64::INFINITY))
}

impl Errors {
    /// Compares `predicted` with `measured`; `settling` flags the start-up rows.
    ///
    /// # Errors
    /// If the lengths differ, no row counts, or a value is not finite.
    pub fn of(measured: &[f64], predicted: &[f64], settling: &[bool]) -> Result<Self, MetricsError> {
        check(measured, predicted, settling)?;
        let rmse = root_mean_square(settled(measured, predicted, settling).map(|(y, p)| p - y));
        let span = span(measured, predicted, settling);
        Ok(Self {
            rmse,
            nrmse_percent: if rmse == 0.0 { 0.0 } else { 100.0 * rmse / span },
            max_abs: settled(measured, predicted, settling).fold(0.0, |most, (y, p)| f64::max(most, (p - y).abs())),
            rmse_all_rows: root_mean_square(measured.iter().zip(predicted).map(|(y, p)| p - y)),
        })
    }
}

/// Minimum magnitude of an output that an error is related to, as a share of the measured span.
const MIN_OUTPUT_SHARE: f64 = 0.01;

/// Mean absolute error relative to the measurement.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Mape {
    /// `mean |p − y| / |y|` as a ratio (1 = 100 %) over the rows that count; `None` if there are none.
    pub ratio: Option<f64>,
    /// Number of rows left out because |y| is below 1 % of the measured span.
    pub left_out: usize,
}

/// Computes the mean absolute error relative to the measurement, `mean |p − y| / |y|`.
///
/// Rows with a measured output of zero or below 1 % of its span (maximum − minimum) are left out and counted: there the
/// ratio depends on the noise and the sensor's zero more than on the model.
///
/// # Errors
/// As [`Errors::of`].
pub fn mape(measured: &[f64], predicted: &[f64], settling: &[bool]) -> Result<Mape, MetricsError> {
    check(measured, predicted, settling)?;
    let least = MIN_OUTPUT_SHARE * span(measured, predicted, settling);
    let counts = |y: f64| y != 0.0 && y.abs() >= least;
    let (mut sum, mut count, mut left_out) = (0.0, 0_usize, 0_usize);
    for (y, p) in settled(measured, predicted, settling) {
        if counts(y) {
            sum += ((p - y) / y).abs();
            count += 1;
        } else {
            left_out += 1;
        }
    }
    Ok(Mape { ratio: (count > 0).then(|| sum / count as f64), left_out })
}

/// Computes the symmetric mean absolute error, `mean |p − y| / ((|p| + |y|) / 2)`, a ratio from 0 to 2.
///
/// The ratio of a row is zero if both values are zero.
///
/// # Errors
/// As [`Errors::of`].
pub fn smape(measured: &[f64], predicted: &[f64], settling: &[bool]) -> Result<f64, MetricsError> {
    check(measured, predicted, settling)?;
    let ratio = |(y, p): (f64, f64)| if y == p { 0.0 } else { (p - y).abs() / (0.5 * p.abs() + 0.5 * y.abs()) };
    let (sum, count) = settled(measured, predicted, settling)
        .map(ratio)
        .fold((0.0, 0_usize), |(sum, count), ratio| (sum + ratio, count + 1));
    Ok(sum / count as f64)
}

/// Computes the maximum minus the minimum of the signed error, in the output's unit.
///
/// # Errors
/// As [`Errors::of`].
pub fn peak_to_valley(measured: &[f64], predicted: &[f64], settling: &[bool]) -> Result<f64, MetricsError> {
    check(measured, predicted, settling)?;
    let (low, high) = settled(measured, predicted, settling)
        .map(|(y, p)| p - y)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), e| (low.min(e), high.max(e)));
    Ok(high - low)
}

fn check(measured: &[f64], predicted: &[f64], settling: &[bool]) -> Result<(), MetricsError> {
    let expected = measured.len();
    for (column, found) in [("the prediction", predicted.len()), ("the start-up flag", settling.len())] {
        if found != expected {
            return Err(MetricsError::Lengths { column, found, expected });
        }
    }
    if let Some(row) = (0..expected).find(|row| !(predicted[*row] - measured[*row]).is_finite()) {
        return Err(MetricsError::NotFinite { row, measured: measured[row], predicted: predicted[row] });
    }
    if settling.iter().all(|settling| *settling) {
        return Err(MetricsError::NoRows { rows: expected });
    }
    Ok(())
}

/// Returns the pairs of measured and predicted values in the rows that count.
fn settled<'a>(
    measured: &'a [f64],
    predicted: &'a [f64],
    settling: &'a [bool],
) -> impl Iterator<Item = (f64, f64)> + 'a {
    measured.iter().zip(predicted).zip(settling).filter(|(_, settling)| !**settling).map(|((y, p), _)| (*y, *p))
}

/// Returns maximum − minimum of the measured output in the rows that count.
fn span(measured: &[f64], predicted: &[f64], settling: &[bool]) -> f64 {
    let (low, high) = settled(measured, predicted, settling)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (y, _)| (low.min(y), high.max(y)));
    high - low
}

fn root_mean_square(errors: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = errors.fold((0.0, 0_usize), |(sum, count), e| (sum + e * e, count + 1));
    if count == 0 { 0.0 } else { (sum / count as f64).sqrt() }
}

/// Returns `sqrt(mean(x²))`; zero for no values.
pub(crate) fn rms(x: &[f64]) -> f64 {
    (x.iter().map(|x| x * x).sum::<f64>() / x.len().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    const Y: [f64; 4] = [0.0, 1.0, 2.0, 4.0];
    const P: [f64; 4] = [9.0, 1.0, 5.0, 0.0];
    const SETTLING: [bool; 4] = [true, false, false, false];

    #[test]
    fn measures_equal_those_computed_by_hand() {
        let errors = Errors::of(&Y, &P, &SETTLING).unwrap();
        // Errors 0, 3, −4 over a span of 3, and 9 in the start-up row.
        let rmse = (25.0_f64 / 3.0).sqrt();
        assert_eq!(errors.rmse, rmse);
        assert_eq!(errors.nrmse_percent, 100.0 * rmse / 3.0);
        assert_eq!(errors.max_abs, 4.0);
        assert_eq!(errors.rmse_all_rows, (106.0_f64 / 4.0).sqrt());
        assert_eq!(peak_to_valley(&Y, &P, &SETTLING), Ok(7.0));
        assert_eq!(mape(&Y, &P, &SETTLING), Ok(Mape { ratio: Some((0.0 + 1.5 + 1.0) / 3.0), left_out: 0 }));
        assert_eq!(smape(&Y, &P, &SETTLING), Ok((0.0 + 3.0 / 3.5 + 2.0) / 3.0));
    }

    #[test]
    fn errors_have_the_json_keys_of_the_report() {
        let json = serde_json::to_string(&Errors::of(&Y, &Y, &SETTLING).unwrap()).unwrap();
        assert_eq!(json, r#"{"rmse":0.0,"nrmse_percent":0.0,"max_abs":0.0,"rmse_all_rows":0.0}"#);
    }

    #[test]
    fn a_constant_output_has_an_infinite_or_zero_nrmse() {
        let constant = Errors::of(&[1.0; 3], &[1.0; 3], &[false; 3]).unwrap();
        assert_eq!(constant.nrmse_percent, 0.0);
        let off = Errors::of(&[1.0; 3], &[2.0; 3], &[false; 3]).unwrap();
        assert_eq!(off.nrmse_percent, f64::INFINITY);
        let json = serde_json::to_string(&off).unwrap();
        assert!(json.contains(r#""nrmse_percent":null"#));
        assert_eq!(serde_json::from_str::<Errors>(&json).unwrap(), off);
    }

    #[test]
    fn rows_of_zeros_have_no_relative_error() {
        assert_eq!(mape(&[0.0], &[1.0], &[false]), Ok(Mape { ratio: None, left_out: 1 }));
        assert_eq!(smape(&[0.0], &[0.0], &[false]), Ok(0.0));
        assert_eq!(smape(&[0.0], &[1.0], &[false]), Ok(2.0));
    }

    #[test]
    fn rows_near_zero_are_left_out_and_counted() {
        // Span 100: ±0.999 is left out, ±1 is not.
        let y = [-50.0, 50.0, 0.999, -0.999, 1.0, -1.0];
        let p = [-50.0, 50.0, 9.0, 9.0, 1.5, -1.0];
        let expected = Mape { ratio: Some(0.5 / 4.0), left_out: 2 };
        assert_eq!(mape(&y, &p, &[false; 6]), Ok(expected));
        // A start-up row counts neither for the span nor for the rows left out.
        assert_eq!(
            mape(&y, &p, &[true, false, false, false, false, false]).map(|m| m.left_out),
            Ok(0),
            "the span is 51: all rows are above 1 % of it"
        );
    }

    #[test]
    fn invalid_columns_are_refused() {
        assert_eq!(Errors::of(&[], &[], &[]), Err(MetricsError::NoRows { rows: 0 }));
        assert_eq!(Errors::of(&[1.0], &[1.0], &[true]), Err(MetricsError::NoRows { rows: 1 }));
        assert!(matches!(Errors::of(&Y, &P[..3], &SETTLING), Err(MetricsError::Lengths { found: 3, expected: 4, .. })));
        assert!(matches!(smape(&Y, &P, &[]), Err(MetricsError::Lengths { column: "the start-up flag", .. })));
        // A start-up row counts in `rmse_all_rows`, so it has to be finite too.
        let diverged = [f64::NAN, 1.0, 2.0, 4.0];
        assert!(matches!(Errors::of(&Y, &diverged, &SETTLING), Err(MetricsError::NotFinite { row: 0, .. })));
        assert!(matches!(mape(&diverged, &Y, &SETTLING), Err(MetricsError::NotFinite { row: 0, .. })));
    }
}
