//! Section of the remainder: kind, distribution over the record, quantities that were not measured.

use hyst_ident::diagnose::{Breakdown, RemainderKind};

use super::html::{Page, Table};
use super::{Contents, words};
use crate::text::{percent, short};

/// Writes the section.
pub(super) fn write(page: &mut Page, c: &Contents<'_>) {
    page.section("remainder", "Remainder");
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
            page.raw("<h3>Quantities that were not measured</h3>");
            page.list(&missing);
        }
    }
    page.raw("<h3>Distribution over the record</h3>");
    page.paragraph(
        "soft",
        "RMS of the remainder on each part of the training record, and the share of each part in the whole",
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

/// Returns the columns that the record does not have, and how their effects appear without them.
fn not_measured(c: &Contents<'_>) -> Vec<&'static str> {
    let mut missing = Vec::new();
    if c.train.temperature().is_none() {
        missing.push(
            "Temperature (temperature_degc): without it a temperature-dependent gain cannot be named; it appears as a gain or a zero \
             that drifts over minutes",
        );
    }
    if c.train.load().is_none() {
        missing
            .push("Load (load_n): without it the deflection under a force appears as a zero that moves with the force");
    }
    if c.test.is_none() {
        missing.push("A test record: the errors on data that were not fitted are unknown");
    }
    missing
}
