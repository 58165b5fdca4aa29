//! What is left when every effect that was found has been added.

use super::findings::{Remainder, RemainderKind};
use super::finer::AT_FLOOR;
use super::search::Search;
use crate::nested::Hypothesis;
use crate::samples::Samples;
use crate::simulate::Simulation;

/// A richer base that lowers the variance above the floor by this share shows a lack of capacity.
const RICHER: f64 = 0.3;

/// Whether the rest is noise, lack of capacity of the base, or unexplained.
pub(super) fn judge(found: &Search, h: &Hypothesis, after: &Simulation, samples: &Samples, richest: f64) -> Remainder {
    let noise2 = found.noise * found.noise;
    let rmse = after.errors.as_ref().map_or(0.0, |e| e.rmse);
    let span = samples.output_span();
    let settled = || samples.output.iter().zip(&samples.settling).filter(|(_, s)| !**s).map(|(y, _)| *y);
    let n = settled().count().max(1) as f64;
    let mean = settled().sum::<f64>() / n;
    let variance = settled().map(|y| (y - mean) * (y - mean)).sum::<f64>() / n;
    let share = rmse * rmse / variance.max(f64::MIN_POSITIVE);
    let left = |kind, description: String| Remainder { kind, variance_share: share, description, places: Vec::new() };
    let percent = |x: f64| 100.0 * x / span.max(f64::MIN_POSITIVE);
    if h.zero_wanders || h.gain_wanders {
        let what = match (h.zero_wanders, h.gain_wanders) {
            (true, true) => "the zero and the gain wander",
            (true, false) => "the zero wanders",
            _ => "the gain wanders",
        };
        return left(
            RemainderKind::Unexplained,
            format!(
                "{:.2} % of span: {what} in time as no effect of the list does; look for what was not recorded (a load, a temperature, a mount that slips)",
                percent(rmse)
            ),
        );
    }
    if rmse <= AT_FLOOR * found.noise {
        return left(
            RemainderKind::None,
            format!("what is left is noise: {rmse:.3e} against a floor of {:.3e}", found.noise),
        );
    }
    // The search ran on a richer, rate-independent base: what that one takes is the base's.
    let above = (rmse * rmse - noise2).max(f64::MIN_POSITIVE);
    let taken = 1.0 - (richest * richest - noise2).max(0.0) / above;
    if taken >= RICHER {
        left(
            RemainderKind::BaseCapacity,
            format!(
                "{:.2} % of span; a richer rate-independent base would leave {:.2} %, so most of it is a map of the input's history that this base is too coarse for",
                percent(rmse),
                percent(richest)
            ),
        )
    } else {
        left(
            RemainderKind::Unexplained,
            format!(
                "{:.2} % of span stands above the noise floor of {:.2} %, and no effect of the list explains it",
                percent(rmse),
                percent(found.noise)
            ),
        )
    }
}
