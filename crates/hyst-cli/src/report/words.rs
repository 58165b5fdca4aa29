//! Findings in words, the same on the terminal and in a report.

use std::collections::BTreeMap;

use hyst_ident::diagnose::{
    BaseAdvice, Change, Finding, Findings, Found, LeftOut, Limit, Remainder, RemainderKind, Suspect, Verdict,
};
use hyst_ident::model::Effect;

use crate::text::{count, listed, short, symbol, with_error};

/// The diagnosis in a sentence.
pub fn verdict(findings: &Findings) -> String {
    match (findings.verdict, findings.remainder.change) {
        (Verdict::Explained, _) => {
            let mut names: Vec<String> = findings.effects.iter().map(with_ties).collect();
            names.dedup();
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            let part = if findings.remainder.kind == RemainderKind::None { "" } else { " in part" };
            let slow = findings.remainder.slew_limit.map_or("", |_| "; the drive is not followed where it is steep");
            format!("explained{part}: the model lacks {}{slow}", listed(&names))
        }
        (Verdict::NothingMissing, _) => "nothing missing: the model is at the noise floor".to_owned(),
        (Verdict::BaseTooCoarse, Some(Change::Zero)) => {
            "changed: the sensor's zero is not that of the record that the model was fitted to".to_owned()
        }
        (Verdict::BaseTooCoarse, Some(Change::Device)) => {
            "changed: the device no longer does what the model was fitted to".to_owned()
        }
        (Verdict::BaseTooCoarse, None) => {
            "base too coarse: what is left is a map of the input's history that a richer base would take".to_owned()
        }
        (Verdict::Unexplained, _) if findings.remainder.slew_limit.is_some() => {
            "unexplained: the drive is not followed where it is steep".to_owned()
        }
        (Verdict::Unexplained, _) => "unexplained: what is left is none of the effects that are looked for".to_owned(),
    }
}

/// The name of an effect, and those that the record cannot tell it from.
fn with_ties(effect: &Finding) -> String {
    let alike = effect.alternatives.iter().filter(|other| other.indistinguishable);
    alike.fold(effect.name.name().to_owned(), |text, other| format!("{text} or {}", other.name))
}

/// What kind of remainder it is.
pub fn kind(remainder: &Remainder) -> &'static str {
    match (remainder.kind, remainder.change) {
        (RemainderKind::None, _) => "noise",
        (RemainderKind::BaseCapacity, None) => "the base's own misfit",
        (RemainderKind::BaseCapacity, Some(Change::Zero)) => "another zero",
        (RemainderKind::BaseCapacity, Some(Change::Device)) => "a change of the device",
        (RemainderKind::Unexplained, _) if remainder.slew_limit.is_some() => "a drive that is not followed",
        (RemainderKind::Unexplained, _) => "unexplained",
    }
}

/// Whether the error on the test record has grown, so that the extended model should not be used. Not where an amplifier has not followed
/// the drive: what that costs, each model shares out in its own way.
pub fn worse_on_test(findings: &Findings) -> bool {
    findings.remainder.slew_limit.is_none()
        && findings.before.test.zip(findings.after.test).is_some_and(|(before, after)| after.rmse > 1.02 * before.rmse)
}

/// That the plays of the extended base stand elsewhere than the model's, if they do.
pub fn plays_placed_anew(findings: &Findings) -> Option<String> {
    let of = |n| {
        format!(
            "the extended base has {} at new places: the model's own were placed while the effects stood in the record",
            count(n, "play")
        )
    };
    findings.plays_placed_anew.map(of)
}

/// A probability; the last digits of one that is nearly certain say nothing.
pub fn probability(p: f64) -> String {
    if p > 0.995 { "above 0.99".into() } else { format!("{p:.2}") }
}

/// What may act too, and how to find out.
pub fn suspects(findings: &Findings) -> Vec<String> {
    let of = |s: &Suspect| {
        let p = probability(s.probability);
        format!("{}, probability {p}; the record that would decide: {}", s.name, s.command)
    };
    findings.suspects.iter().map(of).collect()
}

/// That another kind of model explains the record better.
pub fn base_advice(findings: &Findings) -> Option<String> {
    let unit = symbol(&findings.unit);
    let of = |a: &BaseAdvice| {
        let (better, own) = (short(a.cv_rmse), short(a.own_cv_rmse));
        format!(
            "with the same effects {} explains the record better than {}: cross-validated RMSE {better} {unit} instead of {own} {unit}",
            a.model, findings.base
        )
    };
    findings.base_advice.as_ref().map(of)
}

/// Name, size and meaning of the limit of each effect that was not named.
pub fn limits(findings: &Findings) -> Vec<(String, String, String)> {
    let of = |(effect, limit): (&Effect, &Limit)| match limit {
        Limit::Size { size, unit: of, meaning } => {
            (effect.to_string(), format!("{} {}", short(*size), unit(of)).trim_end().to_owned(), meaning.clone())
        }
        Limit::NotVisible { not_visible } => (effect.to_string(), "not visible".to_owned(), not_visible.clone()),
    };
    findings.limits.iter().map(of).collect()
}

/// Rows that are told by number at most.
const TOLD: usize = 8;

/// Which rows were left out, if some were.
pub fn rows(findings: &Findings) -> Option<String> {
    let rows = &findings.rows;
    let LeftOut { gaps, spikes, start_up, saturated, frozen } = rows.left_out;
    let told: Vec<String> = rows.spikes.iter().take(TOLD).map(usize::to_string).collect();
    let more = if rows.spikes.len() > TOLD { ", …" } else { "" };
    let left: Vec<String> = [
        (spikes, format!("{} (rows {}{more})", count(spikes, "spike"), told.join(", "))),
        (start_up, format!("{} of a start-up transient", count(start_up, "row"))),
        (frozen, format!("{} in which the sensor is frozen", count(frozen, "row"))),
        (saturated, format!("{} at the end of the sensor's range", count(saturated, "row"))),
        (gaps, count(gaps, "gap")),
    ]
    .into_iter()
    .filter_map(|(n, text)| (n > 0).then_some(text))
    .collect();
    (!left.is_empty()).then(|| format!("{} used; left out: {}", count(rows.used, "row"), listed(&left)))
}

/// Name and value of every parameter, the elements of a creep bank in their order.
pub fn parameters(parameters: &BTreeMap<String, Found>) -> Vec<(&str, String)> {
    let mut sorted: Vec<_> = parameters.iter().collect();
    sorted.sort_by(|a, b| number_in(a.0).total_cmp(&number_in(b.0)));
    let value = |found: &Found| format!("{} {}", with_error(found.value, found.std_error), unit(&found.unit));
    sorted.into_iter().map(|(name, found)| (name.as_str(), value(found).trim_end().to_owned())).collect()
}

/// A unit as a person writes it, `µm/N` of `um/N`; nothing of a ratio.
fn unit(unit: &str) -> String {
    let part = |part| if part == "degC" { "°C" } else { symbol(part) };
    match unit {
        "1" => String::new(),
        _ => unit.split('/').map(part).collect::<Vec<_>>().join("/"),
    }
}

/// The time constant in `share_1.394s`; names without a number come last.
fn number_in(name: &str) -> f64 {
    let number = name.strip_prefix("share_").and_then(|rest| rest.strip_suffix('s'));
    number.and_then(|number| number.parse().ok()).unwrap_or(f64::INFINITY)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_those_of_people() {
        assert_eq!(["um/N", "1/K", "degC", "1", "s", "um"].map(unit), ["µm/N", "1/K", "°C", "", "s", "µm"]);
    }

    #[test]
    fn creep_elements_stand_in_their_order() {
        let found = |value| Found { value, std_error: None, unit: "1".into() };
        let names = ["share_10.000s", "share_2.000s", "total"];
        let list = BTreeMap::from(names.map(|name| (name.to_owned(), found(0.01))));
        let order: Vec<&str> = parameters(&list).iter().map(|p| p.0).collect();
        assert_eq!(order, ["share_2.000s", "share_10.000s", "total"]);
    }
}
