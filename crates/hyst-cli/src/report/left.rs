//! What is left, where it lives, and what was not measured that might explain it.

use hyst_ident::diagnose::{Breakdown, RemainderKind};

use super::html::{Page, Table};
use super::{Contents, words};
use crate::text::{percent, short};

/// The remainder.
pub(super) fn write(page: &mut Page, c: &Contents<'_>) {
    page.section("left", "What is left");
    let remainder = &c.diagnosis.findings.remainder;
    let share = percent(100.0 * remainder.variance_share);
    page.paragraph("verdict", &format!("{}, {share} of the output's variance", words::kind(remainder)));
    page.paragraph("", &remainder.description);
    page.list(&remainder.places);
    for line in words::base_advice(&c.diagnosis.findings).iter().chain(&words::rows(&c.diagnosis.findings)) {
        page.paragraph("", line);
    }
    if remainder.kind != RemainderKind::None {
        let missing = not_measured(c);
        if !missing.is_empty() {
            page.raw("<h3>What was not measured</h3>");
            page.list(&missing);
        }
    }
    page.raw("<h3>Where it lives</h3>");
    page.paragraph(
        "soft",
        "Root mean square of what the extended model leaves on the training record, part by part, and each part's share of the whole",
    );
    page.raw("<div class=\"parts\">");
    for breakdown in &c.diagnosis.breakdowns {
        page.table(&table(breakdown, c.unit()));
    }
    page.raw("</div>");
}

fn table(breakdown: &Breakdown, unit: &str) -> Table {
    let mut table = Table::new(&format!("By {}", breakdown.by))
        .words(&breakdown.by)
        .numbers(&format!("RMS [{unit}]"))
        .numbers("share");
    let largest = breakdown.parts.iter().map(|p| p.rms).fold(0.0, f64::max);
    for part in &breakdown.parts {
        let share = format!("{:.0} %", 100.0 * part.share);
        table.bar_row(&[&part.name, &short(part.rms), &share], part.rms / largest.max(f64::MIN_POSITIVE));
    }
    table
}

/// Columns that the record does not have, and what could hide there.
fn not_measured(c: &Contents<'_>) -> Vec<&'static str> {
    let mut missing = Vec::new();
    if c.train.temperature().is_none() {
        missing.push(
            "Temperature (temperature_degc): a gain that follows it cannot be named without it, and looks like a gain or a zero \
             that wanders over minutes",
        );
    }
    if c.train.load().is_none() {
        missing.push(
            "Load (load_n): an actuator that yields under a force looks like a zero that moves with whatever pushes",
        );
    }
    if c.test.is_none() {
        missing.push("A test record: errors on data that were not fitted are not known");
    }
    missing
}
