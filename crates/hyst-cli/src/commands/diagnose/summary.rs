//! Findings as a person reads them.

use std::fmt::Write;

use hyst_ident::diagnose::{Finding, Findings, FoundErrors, RemainderKind, Verdict};

use crate::text::{listed, percent, short, symbol, table, with_error};

/// Verdict, errors before and after, each effect, and what is left.
pub(super) fn of(findings: &Findings) -> String {
    let unit = symbol(&findings.unit);
    let mut text = format!("{}\n\n{}", verdict(findings), errors(findings, unit));
    // Writing to a String does not fail.
    let _ = writeln!(text, "noise floor {} {unit}", short(findings.noise_floor));
    if let (Some(before), Some(after)) = (findings.before.test, findings.after.test)
        && after.rmse > 1.02 * before.rmse
    {
        let _ = writeln!(
            text,
            "WARNING: on the test record the error grew; do not use the extended model. The training record may not show\nenough to tell effects apart: record the drive of `hystctl excite identification`."
        );
    }
    for effect in &findings.effects {
        let _ = write!(text, "\n{}", finding(effect, unit));
    }
    let remainder = &findings.remainder;
    let kind = match remainder.kind {
        RemainderKind::None => "noise",
        RemainderKind::BaseCapacity => "the base's own misfit",
        RemainderKind::Unexplained => "unexplained",
    };
    let share = percent(100.0 * remainder.variance_share);
    let _ = writeln!(text, "\nremainder: {kind}, {share} of the output's variance\n  {}", remainder.description);
    text
}

fn verdict(findings: &Findings) -> String {
    match findings.verdict {
        Verdict::Explained => {
            let mut names: Vec<&str> = findings.effects.iter().map(|effect| effect.name.name()).collect();
            names.dedup();
            let part = if findings.remainder.kind == RemainderKind::None { "" } else { " in part" };
            format!("explained{part}: the model lacks {}", listed(&names))
        }
        Verdict::NothingMissing => "nothing missing: the model is at the noise floor".to_owned(),
        Verdict::BaseTooCoarse => {
            "base too coarse: what is left is a map of the input's history that a richer base would take".to_owned()
        }
        Verdict::Unexplained => "unexplained: what is left is none of the effects that are looked for".to_owned(),
    }
}

fn errors(findings: &Findings, unit: &str) -> String {
    let head =
        ["", "", &format!("RMSE [{unit}]"), "of span", &format!("max [{unit}]"), &format!("RMSE all rows [{unit}]")];
    let mut rows = vec![head.map(ToOwned::to_owned).to_vec()];
    let mut push = |record: &str, when: &str, errors: &Option<FoundErrors>| {
        if let Some(e) = errors {
            let figures = [short(e.rmse), percent(e.nrmse_percent), short(e.max_abs), short(e.rmse_all_rows)];
            rows.push([record.to_owned(), when.to_owned()].into_iter().chain(figures).collect());
        }
    };
    push("train", "before", &findings.before.train);
    push("", "after", &findings.after.train);
    push("test", "before", &findings.before.test);
    push("", "after", &findings.after.test);
    table(&rows)
}

fn finding(effect: &Finding, unit: &str) -> String {
    let mut text = format!(
        "{} (cross-validated RMSE {} {unit} without it, {} {unit} with it)\n",
        effect.name,
        short(effect.cv_rmse_before),
        short(effect.cv_rmse_after)
    );
    let parameter = |(name, found): (&String, &hyst_ident::diagnose::Found)| {
        let unit = if found.unit == "1" { "" } else { symbol(&found.unit) };
        vec![format!("  {name}"), format!("{} {unit}", with_error(found.value, found.std_error)).trim_end().to_owned()]
    };
    let mut parameters: Vec<_> = effect.parameters.iter().collect();
    parameters.sort_by(|a, b| number_in(a.0).total_cmp(&number_in(b.0)));
    text.push_str(&table(&parameters.into_iter().map(parameter).collect::<Vec<_>>()));
    for line in &effect.evidence {
        let _ = writeln!(text, "  - {line}");
    }
    for tie in effect.alternatives.iter().filter(|other| other.indistinguishable) {
        let rmse = short(tie.cv_rmse);
        let _ = writeln!(text, "  this record cannot tell it from {} (cross-validated RMSE {rmse} {unit})", tie.name);
    }
    let others: Vec<String> = effect
        .alternatives
        .iter()
        .filter(|other| !other.indistinguishable)
        .map(|other| format!("{} {} {unit}", other.name, short(other.cv_rmse)))
        .collect();
    if !others.is_empty() {
        let _ = writeln!(text, "  tried in its place: {}", others.join(", "));
    }
    text
}

/// The time constant in `share_1.394s`, so that the elements of a creep bank stand in their order; names without a
/// number come last.
fn number_in(name: &str) -> f64 {
    let number = name.strip_prefix("share_").and_then(|rest| rest.strip_suffix('s'));
    number.and_then(|number| number.parse().ok()).unwrap_or(f64::INFINITY)
}
