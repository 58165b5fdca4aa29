//! Findings as sentences, the same in the terminal and in a report.

use std::collections::BTreeMap;

use hyst_ident::diagnose::{
    BaseAdvice, Change, Finding, Findings, Found, LeftOut, Limit, Remainder, RemainderKind, Suspect, Verdict,
};
use hyst_ident::model::Effect;

use crate::text::{count, listed, short, symbol, with_error};

/// Returns the verdict as a sentence.
pub fn verdict(findings: &Findings) -> String {
    match (findings.verdict, findings.remainder.change) {
        (Verdict::Explained, _) => {
            let mut names: Vec<String> = findings.effects.iter().map(with_ties).collect();
            names.dedup();
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            let part = if findings.remainder.kind == RemainderKind::None { "" } else { " in part" };
            let slow = findings
                .remainder
                .slew_limit
                .map_or("", |_| "; the amplifier does not follow steep parts of the drive");
            format!("explained{part} by {}{slow}", listed(&names))
        }
        (Verdict::NothingMissing, _) => "nothing missing: the residual is at the noise floor".to_owned(),
        (Verdict::BaseTooCoarse, Some(Change::Zero)) => {
            "changed: the sensor zero differs from that of the record that the model was fitted to".to_owned()
        }
        (Verdict::BaseTooCoarse, Some(Change::Device)) => {
            "changed: the device has changed since the model was fitted".to_owned()
        }
        (Verdict::BaseTooCoarse, None) => {
            "base too coarse: the residual is hysteresis that a finer base model would describe".to_owned()
        }
        (Verdict::Unexplained, _) if findings.remainder.slew_limit.is_some() => {
            "unexplained: the amplifier does not follow steep parts of the drive".to_owned()
        }
        (Verdict::Unexplained, _) => "unexplained: the residual matches none of the known effects".to_owned(),
    }
}

/// Returns the name of an effect and those that the record cannot distinguish from it.
pub fn with_ties(effect: &Finding) -> String {
    effect.ties().fold(effect.name.name().to_owned(), |text, other| format!("{text} or {}", other.name))
}

/// Returns the kind of the remainder.
pub fn kind(remainder: &Remainder) -> &'static str {
    match (remainder.kind, remainder.change) {
        (RemainderKind::None, _) => "noise",
        (RemainderKind::BaseCapacity, None) => "misfit of the base model",
        (RemainderKind::BaseCapacity, Some(Change::Zero)) => "changed sensor zero",
        (RemainderKind::BaseCapacity, Some(Change::Device)) => "changed device",
        (RemainderKind::Unexplained, _) if remainder.slew_limit.is_some() => "drive not followed by the amplifier",
        (RemainderKind::Unexplained, _) => "unexplained",
    }
}

/// Whether the extended model has a larger error on the test record and should not be used.
///
/// Always false if the amplifier has not followed the drive, because that error is distributed differently in each
/// model.
pub fn worse_on_test(findings: &Findings) -> bool {
    findings.remainder.slew_limit.is_none()
        && findings.before.test.zip(findings.after.test).is_some_and(|(before, after)| after.rmse > 1.02 * before.rmse)
}

/// Returns a sentence about new thresholds of play operators in the extended model, if there are any.
pub fn plays_placed_anew(findings: &Findings) -> Option<String> {
    let of = |n| {
        format!(
            "the extended model has {} with new thresholds: those of the model were chosen without the effects",
            count(n, "play operator")
        )
    };
    findings.plays_placed_anew.map(of)
}

/// Formats a probability; above 0.995 further digits are not significant.
pub fn probability(p: f64) -> String {
    if p > 0.995 { "above 0.99".into() } else { format!("{p:.2}") }
}

/// Returns the suspected effects, each with the command for a record that decides.
pub fn suspects(findings: &Findings) -> Vec<String> {
    let of = |s: &Suspect| {
        let p = probability(s.probability);
        format!("{}, probability {p}; a record of this drive would decide: {}", s.name, s.command)
    };
    findings.suspects.iter().map(of).collect()
}

/// Returns a sentence about a base model that predicts the record better, if there is one.
pub fn base_advice(findings: &Findings) -> Option<String> {
    let unit = symbol(&findings.unit);
    let of = |a: &BaseAdvice| {
        let (better, own) = (short(a.cv_rmse), short(a.own_cv_rmse));
        format!(
            "with the same effects the base model {} predicts the record better than {}: cross-validated RMSE {better} {unit} \
             instead of {own} {unit}",
            a.model, findings.base
        )
    };
    findings.base_advice.as_ref().map(of)
}

/// Returns name, size and meaning of the limit of detection of each effect that was not named.
pub fn limits(findings: &Findings) -> Vec<(String, String, String)> {
    let of = |(effect, limit): (&Effect, &Limit)| match limit {
        Limit::Size { size, unit: of, meaning } => {
            (effect.to_string(), format!("{} {}", short(*size), unit(of)).trim_end().to_owned(), meaning.clone())
        }
        Limit::NotVisible { not_visible } => (effect.to_string(), "not visible".to_owned(), not_visible.clone()),
    };
    findings.limits.iter().map(of).collect()
}

/// Maximum number of spikes that are listed by row.
const MAX_SPIKES: usize = 8;

/// Returns a sentence about the rows that were left out, if there are any.
pub fn rows(findings: &Findings) -> Option<String> {
    let rows = &findings.rows;
    let LeftOut { gaps, spikes, start_up, saturated, frozen } = rows.left_out;
    let spike_rows: Vec<String> = rows.spikes.iter().take(MAX_SPIKES).map(usize::to_string).collect();
    let more = if rows.spikes.len() > MAX_SPIKES { ", …" } else { "" };
    let left_out: Vec<String> = [
        (spikes, format!("{} (rows {}{more})", count(spikes, "spike"), spike_rows.join(", "))),
        (start_up, count(start_up, "start-up row")),
        (frozen, format!("{} with a frozen sensor value", count(frozen, "row"))),
        (saturated, format!("{} at the end of the sensor's range", count(saturated, "row"))),
        (gaps, count(gaps, "gap")),
    ]
    .into_iter()
    .filter_map(|(n, text)| (n > 0).then_some(text))
    .collect();
    (!left_out.is_empty()).then(|| format!("{} used; left out: {}", count(rows.used, "row"), listed(&left_out)))
}

/// Returns name and value of each parameter, creep elements in the order of their time constants.
pub fn parameters(parameters: &BTreeMap<String, Found>) -> Vec<(&str, String)> {
    let mut sorted: Vec<_> = parameters.iter().collect();
    sorted.sort_by(|a, b| number_in(a.0).total_cmp(&number_in(b.0)));
    let value = |found: &Found| format!("{} {}", with_error(found.value, found.std_error), unit(&found.unit));
    sorted.into_iter().map(|(name, found)| (name.as_str(), value(found).trim_end().to_owned())).collect()
}

/// Returns a unit with its symbols, for example `µm/N` for `um/N`; empty for a ratio.
fn unit(unit: &str) -> String {
    let part = |part| if part == "degC" { "°C" } else { symbol(part) };
    match unit {
        "1" => String::new(),
        _ => unit.split('/').map(part).collect::<Vec<_>>().join("/"),
    }
}

/// Returns the time constant in `share_1.394s`; infinity for other names, so that they come last.
fn number_in(name: &str) -> f64 {
    let number = name.strip_prefix("share_").and_then(|rest| rest.strip_suffix('s'));
    number.and_then(|number| number.parse().ok()).unwrap_or(f64::INFINITY)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_shown_with_their_symbols() {
        assert_eq!(["um/N", "1/K", "degC", "1", "s", "um"].map(unit), ["µm/N", "1/K", "°C", "", "s", "µm"]);
    }

    #[test]
    fn creep_elements_are_sorted_by_time_constant() {
        let found = |value| Found { value, std_error: None, unit: "1".into() };
        let names = ["share_10.000s", "share_2.000s", "total"];
        let list = BTreeMap::from(names.map(|name| (name.to_owned(), found(0.01))));
        let order: Vec<&str> = parameters(&list).iter().map(|p| p.0).collect();
        assert_eq!(order, ["share_2.000s", "share_10.000s", "total"]);
    }
}
