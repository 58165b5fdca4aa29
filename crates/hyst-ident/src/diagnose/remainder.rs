//! Classifies the residual of the extended model.

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

/// Number of parts of a record; the residual has to be small in each of them.
const PARTS: usize = 20;

/// Input of the classification.
pub(super) struct Material<'a> {
    pub(super) found: &'a Search,
    pub(super) hypothesis: &'a Hypothesis,
    /// Simulation of the extended model.
    pub(super) after: &'a Simulation,
    /// The simulations without and with the effects found, on the record whose drive is slope-limited like the
    /// amplifier's output; `None` without such a limit.
    pub(super) amplified: Option<&'a (Simulation, Simulation)>,
    pub(super) samples: &'a Samples,
    /// Cross-validated RMSE of the finest base \[output unit\].
    pub(super) richest: f64,
    /// Residual on the basis of the search with the effects found there, before the check for a curve \[output unit\].
    pub(super) on_search_basis: Option<&'a [f64]>,
    /// Unit of the drive.
    pub(super) input: &'a str,
}

/// Classifies the remainder as noise, misfit of the base model, or unexplained.
pub(super) fn judge(m: &Material<'_>) -> Remainder {
    let Material { found, hypothesis: h, after, amplified, samples, richest, on_search_basis, input } = *m;
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
        (true, false) if h.effects.drift.is_some() => Some("in addition to the drift the zero wanders"),
        (true, false) => Some("the zero wanders"),
        (false, true) => Some("the gain wanders"),
        (false, false) => None,
    };
    let wanders = wanders.map(|what| {
        format!(
            "{what} in time, and no listed effect explains it; look for an unrecorded cause (a load, a temperature, a slipping mount)"
        )
    });
    let limited = h.slew_limit.map(|v_per_s| {
        let limit = short(v_per_s);
        let left = |s: &Simulation| percent(s.errors.as_ref().map_or(f64::NAN, |e| e.rmse));
        let helped = amplified.map_or(String::new(), |(without, with)| {
            format!(
                " (with the drive limited in this way the residual is {:.2} % of span, {:.2} % without the effects found)",
                left(with),
                left(without)
            )
        });
        format!(
            "the output does not follow a drive steeper than {limit} {input}/s, as behind a current-limited amplifier{helped}; no model \
             corrects that: record with a drive below this slope (`excite --slew`) and stay below it in use"
        )
    });
    let unlisted: Vec<String> = limited.into_iter().chain(wanders).collect();
    if !unlisted.is_empty() {
        let what = format!("{:.2} % of span: {}", percent(rmse), unlisted.join("; "));
        return left(RemainderKind::Unexplained, what);
    }
    if rmse <= MIN_RMSE_RATIO * found.noise {
        return left(
            RemainderKind::None,
            format!(
                "the remainder is noise: {:.3} % of span, noise floor {:.3} %",
                percent(rmse),
                percent(found.noise)
            ),
        );
    }
    // The search ran on a richer, rate-independent basis. What that basis explains is misfit of the base model.
    let above = (rmse * rmse - noise2).max(f64::MIN_POSITIVE);
    let screening_share = 1.0 - (richest * richest - noise2).max(0.0) / above;
    let residual: Vec<f64> = samples.output.iter().zip(&after.predicted).map(|(y, p)| y - p).collect();
    let counts: Vec<bool> = after.settling.iter().map(|s| !s).collect();
    if screening_share < HALF {
        let undetermined_variance =
            history::undetermined_variance(samples, &residual, &counts).unwrap_or(f64::INFINITY);
        let determined_share = 1.0 - (undetermined_variance - noise2).max(0.0) / above;
        if determined_share >= HALF {
            let what = format!(
                "{:.2} % of span: {:.0} % of its variance is a function of the input and its history; this base model and the finer ones tried \
                 are too coarse for it",
                percent(rmse),
                100.0 * determined_share
            );
            return left(RemainderKind::BaseCapacity, what);
        }
        let flicker =
            |residual: &[f64], counts: &[bool]| colour::flicker(residual, &samples.segments, counts, found.noise);
        if let Some(exponent) = flicker(&residual, &counts) {
            let what = format!(
                "the remainder is noise: {:.3} % of span; its power falls as 1/f^{exponent:.1}, like the flicker noise of \
                 a sensor, down to a white floor of {:.3} %",
                percent(rmse),
                percent(found.noise)
            );
            return left(RemainderKind::None, what);
        }
        // The misfit of this base is not noise, but the residual on a finer one may be.
        let searched: Vec<bool> = samples.settling.iter().map(|s| !s).collect();
        let on_finer = on_search_basis.filter(|_| screening_share >= MINOR_SHARE);
        if let Some((residual, exponent)) = on_finer.and_then(|r| Some((r, flicker(r, &searched)?))) {
            let counted: Vec<f64> = residual.iter().zip(&searched).filter(|(_, s)| **s).map(|(r, _)| *r).collect();
            let what = format!(
                "{:.2} % of span; the residual of a finer rate-independent base model is {:.2} % and is noise: its power falls as \
                 1/f^{exponent:.1}, like the flicker noise of a sensor; the rest is a function of the input's history that this base \
                 model is too coarse for",
                percent(rmse),
                percent(rms(&counted))
            );
            return left(RemainderKind::BaseCapacity, what);
        }
        let (rows, hysteresis) = samples.hysteresis();
        if is_within_law_accuracy(&residual, &rows, &hysteresis, found.noise) {
            let hysteresis = rms(&hysteresis);
            let what = format!(
                "{:.2} % of span is above the noise floor of {:.2} %; the excess is {:.1} % of the hysteresis, which is within the accuracy \
                 of a hysteresis model",
                percent(rmse),
                percent(found.noise),
                100.0 * above.sqrt() / hysteresis
            );
            return left(RemainderKind::BaseCapacity, what);
        }
    }
    let map = "a function of the input's history that this base model is too coarse for";
    let (kind, rest) = if screening_share >= DOMINANT_SHARE
        || (screening_share >= HALF && richest <= MIN_RMSE_RATIO * found.noise)
    {
        (RemainderKind::BaseCapacity, format!("nearly all of it is {map}"))
    } else if screening_share >= HALF {
        let rest = format!(
            "{:.0} % of its variance is {map}; the rest is also above the noise floor of {:.2} %, and no listed effect explains it",
            100.0 * screening_share,
            percent(found.noise)
        );
        (RemainderKind::BaseCapacity, rest)
    } else if screening_share >= MINOR_SHARE {
        let rest = format!(
            "no listed effect explains it, and only {:.0} % of its variance is {map}; look for an unrecorded cause (a load, a temperature)",
            100.0 * screening_share
        );
        (RemainderKind::Unexplained, rest)
    } else {
        let what = format!(
            "{:.2} % of span is above the noise floor of {:.2} %, and no listed effect explains it",
            percent(rmse),
            percent(found.noise)
        );
        return left(RemainderKind::Unexplained, what);
    };
    let richer = format!("a finer rate-independent base model would leave {:.2} %", percent(richest));
    left(kind, format!("{:.2} % of span; {richer}: {rest}", percent(rmse)))
}

/// Returns whether a residual is as small as the misfit of another hysteresis law: at most [`LAW_ACCURACY`] of the
/// hysteresis, in each part of the record. The hysteresis is that of the part or of the whole record, whichever is
/// larger.
fn is_within_law_accuracy(residual: &[f64], rows: &[usize], hysteresis: &[f64], noise: f64) -> bool {
    let whole = rms(hysteresis);
    let rows_each = rows.len().div_ceil(PARTS).max(1);
    rows.chunks(rows_each).zip(hysteresis.chunks(rows_each)).all(|(rows, hysteresis)| {
        let left = rows.iter().map(|k| residual[*k] * residual[*k]).sum::<f64>() / rows.len() as f64;
        (left - noise * noise).max(0.0).sqrt() <= LAW_ACCURACY * rms(hysteresis).max(whole)
    })
}

impl Remainder {
    /// Adds two remarks: the record repeats one loop \[Hz\]; effects found on a richer basis do not improve this base
    /// model.
    pub(super) fn with_remarks(mut self, only_loop: Option<f64>, useless: &[Effect]) -> Self {
        let of_shapes = self.kind != RemainderKind::None && self.change.is_none();
        if let Some(hz) = only_loop.filter(|_| of_shapes) {
            self.description += &format!(
                "; the record repeats one loop at {hz:.4} Hz: rate-dependence, resonance, asymmetry and saturation cannot be separated from \
                 the shape of the hysteresis, nor a delay from a lag; drive several frequencies and amplitudes"
            );
        }
        if !useless.is_empty() && self.change.is_none() {
            let names: Vec<&str> = useless.iter().map(|e| e.name()).collect();
            self.description += &format!(
                "; on a finer base model {} would explain a part, but this base model does not improve with it: fit a finer one first",
                names.join(", ")
            );
        }
        self
    }
}
