//! Findings as text for the terminal.

use std::fmt::Write;

use hyst_ident::diagnose::{Finding, Findings, FoundErrors};

use crate::report::{next::Advice, words};
use crate::text::{percent, short, symbol, table};

/// Returns verdict, errors before and after, effects, remainder and next steps.
pub(super) fn of(findings: &Findings, next: &[Advice]) -> String {
    let unit = symbol(&findings.unit);
    let mut text = format!("{}\n\n{}", words::verdict(findings), errors(findings, unit));
    // Writing to a String does not fail.
    let _ = writeln!(text, "noise floor {} {unit}", short(findings.noise_floor));
    if let Some(plays) = words::plays_placed_anew(findings) {
        let _ = writeln!(text, "{plays}");
    }
    if words::worse_on_test(findings) {
        let _ = writeln!(
            text,
            "WARNING: on the test record the extended model has a larger error; do not use it. The training record may not be\n\
             sufficient to distinguish effects: record the drive of `hystctl excite identification`."
        );
    }
    for effect in &findings.effects {
        let _ = write!(text, "\n{}", finding(effect, unit));
    }
    for suspect in words::suspects(findings) {
        let _ = writeln!(text, "\nsuspect: {suspect}");
    }
    let remainder = &findings.remainder;
    let kind = words::kind(remainder);
    let share = percent(100.0 * remainder.variance_share);
    let _ = writeln!(text, "\nremainder: {kind}, {share} of the output's variance\n  {}", remainder.description);
    for place in &remainder.places {
        let _ = writeln!(text, "  - {place}");
    }
    if let Some(advice) = words::base_advice(findings) {
        let _ = writeln!(text, "\n{advice}");
    }
    let limits = words::limits(findings);
    if !limits.is_empty() {
        let _ = writeln!(text, "\nnot named; limits of detection (smallest size that this record would have shown):");
        let rows: Vec<Vec<String>> =
            limits.into_iter().map(|(name, size, of)| vec![format!("  {name}"), size, of]).collect();
        text.push_str(&table(&rows));
    }
    if let Some(rows) = words::rows(findings) {
        let _ = writeln!(text, "\n{rows}");
    }
    for Advice { text: advice, commands } in next {
        let _ = writeln!(text, "\nnext: {advice}");
        for command in commands {
            let _ = writeln!(text, "  {command}");
        }
    }
    text
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
        "{}, probability {} (cross-validated RMSE {} {unit} without it, {} {unit} with it)\n",
        words::with_ties(effect),
        words::probability(effect.probability),
        short(effect.cv_rmse_before),
        short(effect.cv_rmse_after)
    );
    let rows = words::parameters(&effect.parameters).into_iter().map(|(name, value)| vec![format!("  {name}"), value]);
    text.push_str(&table(&rows.collect::<Vec<_>>()));
    for line in &effect.evidence {
        let _ = writeln!(text, "  - {line}");
    }
    for tie in effect.ties() {
        let rmse = short(tie.cv_rmse);
        let _ = writeln!(
            text,
            "  this record cannot distinguish it from {} (cross-validated RMSE {rmse} {unit})",
            tie.name
        );
    }
    let others: Vec<String> = effect
        .alternatives
        .iter()
        .filter(|other| !other.indistinguishable)
        .map(|other| format!("{} {} {unit}", other.name, short(other.cv_rmse)))
        .collect();
    if !others.is_empty() {
        let _ = writeln!(text, "  alternatives (cross-validated RMSE): {}", others.join(", "));
    }
    text
}
