//! Tells a changed device or a changed sensor zero from a base model that is too coarse.

use super::findings::{Change, Remainder, RemainderKind};
use super::own_model::OwnModel;
use crate::criteria::{HALF, MIN_RMSE_RATIO, NEGLIGIBLE_SHARE};
use crate::digits::{short, signed};
use crate::fit::FitError;
use crate::nested::Hypothesis;
use crate::record::OutputUnit;
use crate::simulate::{Zero, simulate};

/// Checks whether a remainder that looks like a coarse base model is a change since the fit.
///
/// A changed device leaves the same kind of residual as a coarse base model: a finer one would explain it. In contrast
/// to a coarse base, the error is larger than on the record of the fit, and the same base with other weights explains
/// it too. `start` is the hypothesis of the model, `noise` the noise floor \[output unit\].
pub(super) fn detect_change(
    own: &OwnModel<'_>,
    start: &Hypothesis,
    noise: f64,
    zero: Zero,
    left: Remainder,
) -> Result<Remainder, FitError> {
    let (Some(fitted), Some(errors)) = (own.model.rmse, &own.before.errors) else { return Ok(left) };
    if left.kind != RemainderKind::BaseCapacity || errors.rmse <= MIN_RMSE_RATIO * fitted {
        return Ok(left);
    }
    let (input, beyond) = (&own.model.input, own.before.extrapolated.largest);
    if beyond > NEGLIGIBLE_SHARE * (input.high - input.low) {
        let (low, high, unit) = (input.low, input.high, input.symbol());
        let seen = format!(
            "; the drive goes up to {} {unit} beyond the fitted range of {} to {} {unit}",
            short(beyond),
            short(low),
            short(high)
        );
        return Ok(Remainder { description: left.description + &seen, ..left });
    }
    let again = simulate(&own.refitted_base(start)?, own.train, zero)?;
    let (Some(before), Some(after)) = (&own.before.errors, &again.errors) else { return Ok(left) };
    let above = |mean_square: f64| (mean_square - noise * noise).max(0.0);
    let stood = above(before.rmse * before.rmse);
    if above(after.rmse * after.rmse) > (1.0 - HALF) * stood {
        return Ok(left);
    }
    let line = Line::through(own);
    let unit = OutputUnit::of_suffix(&own.model.output.unit).map_or(own.model.output.unit.as_str(), |u| u.symbol());
    let behind_zero = above(before.rmse * before.rmse - line.mean * line.mean);
    // Another gain moves the mean too, but it also changes the slope.
    let zero_alone = behind_zero <= (1.0 - HALF) * stood && above(line.mean_square) >= (1.0 - HALF) * behind_zero;
    Ok(if zero_alone {
        let description = format!(
            "most of it is a constant: the sensor's zero differs by {} {unit} from the record that the model was fitted to",
            signed(line.mean)
        );
        Remainder { change: Some(Change::Zero), description, ..left }
    } else {
        let description = format!(
            "{:.2} % of span; the same model refitted to this record leaves {:.2} %: the device has changed since the fit \
             (its output is {:.3} × the predicted one, with an offset of {} {unit})",
            before.nrmse_percent,
            after.nrmse_percent,
            line.slope,
            signed(line.offset)
        );
        Remainder { change: Some(Change::Device), description, ..left }
    })
}

/// The straight line from predicted to measured output, over the rows that count.
struct Line {
    slope: f64,
    offset: f64,
    /// Mean of measured minus predicted output.
    mean: f64,
    /// Mean square of the measured output minus the line.
    mean_square: f64,
}

impl Line {
    fn through(own: &OwnModel<'_>) -> Self {
        let (said, is) = (&own.before.predicted, &own.samples.output);
        let rows = || (0..is.len()).filter(|k| !own.before.settling[*k]);
        let n = rows().count().max(1) as f64;
        let of = |x: &[f64]| rows().map(|k| x[k]).sum::<f64>() / n;
        let (said_mean, is_mean) = (of(said), of(is));
        let across = rows().map(|k| (said[k] - said_mean).powi(2)).sum::<f64>();
        let along = rows().map(|k| (said[k] - said_mean) * (is[k] - is_mean)).sum::<f64>();
        let slope = if across > 0.0 { along / across } else { 1.0 };
        let offset = is_mean - slope * said_mean;
        let mean_square = rows().map(|k| (is[k] - slope * said[k] - offset).powi(2)).sum::<f64>() / n;
        Self { slope, offset, mean: is_mean - said_mean, mean_square }
    }
}
