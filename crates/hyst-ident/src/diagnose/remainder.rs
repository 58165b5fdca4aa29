//! What is left when every effect that was found has been added.

use super::findings::{Remainder, RemainderKind};
use super::search::Search;
use super::{colour, history};
use crate::criteria::{DOMINANT_SHARE, HALF, LAW_ACCURACY, MIN_RMSE_RATIO, MINOR_SHARE};
use crate::digits::short;
use crate::metrics::rms;
use crate::model::Effect;
use crate::nested::Hypothesis;
use crate::samples::Samples;
use crate::simulate::Simulation;

/// Parts of a record in each of which a residual has to be small.
const PARTS: usize = 20;

/// Whether the rest is noise, lack of capacity of the base, or unexplained. `amplified` is what the model says, without and with what was
/// found, about the record as an amplifier drives it that does not follow every slope. The drive is in the unit `input`.
pub(super) fn judge(
    found: &Search,
    h: &Hypothesis,
    after: &Simulation,
    amplified: Option<&(Simulation, Simulation)>,
    samples: &Samples,
    richest: f64,
    input: &str,
) -> Remainder {
    let noise2 = found.noise * found.noise;
    let rmse = after.errors.as_ref().map_or(0.0, |e| e.rmse);
    let span = samples.output_span();
    let settled = || samples.settled_output();
    let n = settled().count().max(1) as f64;
    let mean = settled().sum::<f64>() / n;
    let variance = settled().map(|y| (y - mean) * (y - mean)).sum::<f64>() / n;
    let share = rmse * rmse / variance.max(f64::MIN_POSITIVE);
    let left = |kind, description: String| Remainder {
        kind,
        variance_share: share,
        change: None,
        slew_limit: h.slew_limit,
        description,
        places: Vec::new(),
    };
    let percent = |x: f64| 100.0 * x / span.max(f64::MIN_POSITIVE);
    let wanders = match (h.zero_wanders, h.gain_wanders) {
        (true, true) => Some("the zero and the gain wander"),
        (true, false) if h.effects.drift.is_some() => Some("beyond the drift the zero wanders"),
        (true, false) => Some("the zero wanders"),
        (false, true) => Some("the gain wanders"),
        (false, false) => None,
    };
    let wanders = wanders.map(|what| {
        format!(
            "{what} in time as no effect of the list does; look for what was not recorded (a load, a temperature, a mount that slips)"
        )
    });
    let limited = h.slew_limit.map(|v_per_s| {
        let limit = short(v_per_s);
        let left = |s: &Simulation| percent(s.errors.as_ref().map_or(f64::NAN, |e| e.rmse));
        let helped = amplified.map_or(String::new(), |(without, with)| {
            format!(
                " (of what such an amplifier makes of the drive the model misses {:.2} %, {:.2} % without what was found)",
                left(with),
                left(without)
            )
        });
        format!(
            "the drive is not followed where it is steeper than {limit} {input}/s, as by an amplifier whose current is limited{helped}; no model \
             makes up for that: measure with a drive below that slope (`excite --slew`), and keep to it"
        )
    });
    let nameless: Vec<String> = limited.into_iter().chain(wanders).collect();
    if !nameless.is_empty() {
        let what = format!("{:.2} % of span: {}", percent(rmse), nameless.join("; "));
        return left(RemainderKind::Unexplained, what);
    }
    if rmse <= MIN_RMSE_RATIO * found.noise {
        return left(
            RemainderKind::None,
            format!(
                "what is left is noise: {:.3} % of span, against a floor of {:.3} %",
                percent(rmse),
                percent(found.noise)
            ),
        );
    }
    // The search ran on a richer, rate-independent base: what that one takes is the base's.
    let above = (rmse * rmse - noise2).max(f64::MIN_POSITIVE);
    let taken = 1.0 - (richest * richest - noise2).max(0.0) / above;
    let residual: Vec<f64> = samples.output.iter().zip(&after.predicted).map(|(y, p)| y - p).collect();
    let counts: Vec<bool> = after.settling.iter().map(|s| !s).collect();
    if taken < HALF {
        let undecided = history::undecided(samples, &residual, &counts).unwrap_or(f64::INFINITY);
        let decided = 1.0 - (undecided - noise2).max(0.0) / above;
        if decided >= HALF {
            let what = format!(
                "{:.2} % of span: {:.0} % of its variance comes back where the input and its history do, so that it is a map of them that this base, \
                 and the richer ones that were tried, are too coarse for",
                percent(rmse),
                100.0 * decided
            );
            return left(RemainderKind::BaseCapacity, what);
        }
        if let Some(exponent) = colour::flicker(&residual, &samples.segments, &counts, found.noise) {
            let what = format!(
                "what is left is noise: {:.3} % of span; its power falls with the frequency to the power of {exponent:.1}, like the flicker noise of \
                 a sensor, down to a white floor of {:.3} %",
                percent(rmse),
                percent(found.noise)
            );
            return left(RemainderKind::None, what);
        }
        let (rows, hysteresis) = samples.hysteresis();
        if is_as_of_another_law(&residual, &rows, &hysteresis, found.noise) {
            let hysteresis = rms(&hysteresis);
            let what = format!(
                "{:.2} % of span stands above the noise floor of {:.2} %; that is {:.1} % of the hysteresis, and no law of hysteresis describes an \
                 actuator more closely",
                percent(rmse),
                percent(found.noise),
                100.0 * above.sqrt() / hysteresis
            );
            return left(RemainderKind::BaseCapacity, what);
        }
    }
    let map = "a map of the input's history that this base is too coarse for";
    let (kind, rest) = if taken >= DOMINANT_SHARE || (taken >= HALF && richest <= MIN_RMSE_RATIO * found.noise) {
        (RemainderKind::BaseCapacity, format!("nearly all of it is {map}"))
    } else if taken >= HALF {
        let rest = format!(
            "{:.0} % of its variance is {map}; the rest stands above the noise floor of {:.2} % too, and no effect of the list explains it",
            100.0 * taken,
            percent(found.noise)
        );
        (RemainderKind::BaseCapacity, rest)
    } else if taken >= MINOR_SHARE {
        let rest = format!(
            "no effect of the list explains it, and only {:.0} % of its variance is {map}; look for what was not recorded (a load, a temperature)",
            100.0 * taken
        );
        (RemainderKind::Unexplained, rest)
    } else {
        let what = format!(
            "{:.2} % of span stands above the noise floor of {:.2} %, and no effect of the list explains it",
            percent(rmse),
            percent(found.noise)
        );
        return left(RemainderKind::Unexplained, what);
    };
    let richer = format!("a richer rate-independent base would leave {:.2} %", percent(richest));
    left(kind, format!("{:.2} % of span; {richer}: {rest}", percent(rmse)))
}

/// Whether a residual is nowhere larger than what a model of another law misses: in each part of the record, at most [`LAW_ACCURACY`] of the hysteresis
/// of that part or of the whole record.
fn is_as_of_another_law(residual: &[f64], rows: &[usize], hysteresis: &[f64], noise: f64) -> bool {
    let whole = rms(hysteresis);
    let rows_each = rows.len().div_ceil(PARTS).max(1);
    rows.chunks(rows_each).zip(hysteresis.chunks(rows_each)).all(|(rows, hysteresis)| {
        let left = rows.iter().map(|k| residual[*k] * residual[*k]).sum::<f64>() / rows.len() as f64;
        (left - noise * noise).max(0.0).sqrt() <= LAW_ACCURACY * rms(hysteresis).max(whole)
    })
}

impl Remainder {
    /// With what else has to be said: that the record repeats one loop \[Hz\], and which effects of a rich base do not help this one.
    pub(super) fn beside(mut self, only_loop: Option<f64>, useless: &[Effect]) -> Self {
        let of_shapes = self.kind != RemainderKind::None && self.change.is_none();
        if let Some(hz) = only_loop.filter(|_| of_shapes) {
            self.description += &format!(
                "; the record repeats one loop at {hz:.4} Hz, in which rate-dependence, resonance, asymmetry and saturation look like a hysteresis of another shape, and whatever is late looks alike: drive several frequencies and amplitudes"
            );
        }
        if !useless.is_empty() && self.change.is_none() {
            let names: Vec<&str> = useless.iter().map(|e| e.name()).collect();
            self.description += &format!(
                "; on a richer base {} would explain a part, but this base does not follow better with it: fit a richer one first",
                names.join(", ")
            );
        }
        self
    }
}
