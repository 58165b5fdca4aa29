//! Whether a model that was fitted to other data lacks nothing but another zero or another fit.

use super::extension::Own;
use super::findings::{Change, Remainder, RemainderKind};
use crate::criteria::{HALF, MIN_RMSE_RATIO, NEGLIGIBLE_SHARE};
use crate::digits::{short, signed};
use crate::fit::FitError;
use crate::nested::Hypothesis;
use crate::record::OutputUnit;
use crate::simulate::{Zero, simulate};

/// A device that is no longer the one of the fit misses in the same way as a base that is too coarse does: a richer one would take it. But so
/// would the same base with other weights, and it misses by more than it did in the record of its fit; a coarse base may follow a small part
/// of that record better with other weights too, but misses there as it always did. `start` is what the model holds, `noise` the floor \[output unit\].
pub(super) fn told_apart(
    own: &Own<'_>,
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
            "; its drive goes up to {} {unit} beyond {} to {} {unit}, which the model was fitted to",
            short(beyond),
            short(low),
            short(high)
        );
        return Ok(Remainder { description: left.description + &seen, ..left });
    }
    let again = simulate(&own.fitted_anew(start)?, own.train, zero)?;
    let (Some(before), Some(after)) = (&own.before.errors, &again.errors) else { return Ok(left) };
    let above = |mean_square: f64| (mean_square - noise * noise).max(0.0);
    let stood = above(before.rmse * before.rmse);
    if above(after.rmse * after.rmse) > (1.0 - HALF) * stood {
        return Ok(left);
    }
    let line = Line::through(own);
    let unit = OutputUnit::of_suffix(&own.model.output.unit).map_or(own.model.output.unit.as_str(), |u| u.symbol());
    let behind_zero = above(before.rmse * before.rmse - line.mean * line.mean);
    // Another gain moves the mean too, but not alone.
    let zero_alone = behind_zero <= (1.0 - HALF) * stood && above(line.mean_square) >= (1.0 - HALF) * behind_zero;
    Ok(if zero_alone {
        let description = format!(
            "most of it is one constant: the sensor's zero stands {} {unit} from that of the record that the model was fitted to",
            signed(line.mean)
        );
        Remainder { change: Some(Change::Zero), description, ..left }
    } else {
        let description = format!(
            "{:.2} % of span; the same model, fitted to this record, would leave {:.2} %: the device is no longer the one that it was fitted to \
             (its output is {:.3} × what the model says, {} {unit} beside it)",
            before.nrmse_percent,
            after.nrmse_percent,
            line.slope,
            signed(line.offset)
        );
        Remainder { change: Some(Change::Device), description, ..left }
    })
}

/// The straight line from what the model says to what was measured, over the rows that count.
struct Line {
    slope: f64,
    offset: f64,
    /// Mean of what was measured less what the model says.
    mean: f64,
    /// Mean square of what was measured less the line.
    mean_square: f64,
}

impl Line {
    fn through(own: &Own<'_>) -> Self {
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
