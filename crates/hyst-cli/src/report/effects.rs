//! Each effect that was named: parameters, evidence, what else was tried.

use std::collections::{BTreeMap, BTreeSet};

use hyst_ident::diagnose::Finding;

use super::html::{Page, Table, escaped};
use super::{Contents, figures, words};
use crate::text::short;

/// A part for each effect.
pub(super) fn write(page: &mut Page, c: &Contents<'_>) {
    page.section("effects", "What the model lacks");
    let effects = &c.diagnosis.findings.effects;
    if effects.is_empty() {
        page.paragraph("", "No effect was named: none of them explains what is left well enough");
        not_named(page, c);
        return;
    }
    page.paragraph(
        "soft",
        "Each picture compares the extended model with the same model less that one effect, nothing fitted again: what differs is the \
         effect's own part. Residuals are measured minus predicted output",
    );
    page.raw(
        "<p class=\"soft hint\">Drag across a plot to zoom, double-click for the whole of it; with fingers: two zoom, one moves, a double \
         tap resets.</p>",
    );
    for (i, finding) in effects.iter().enumerate() {
        page.raw(&format!("<h3 class=\"effect\">{}</h3>", escaped(finding.name)));
        page.paragraph("", &format!("Probability that the name is right: {}", words::probability(finding.probability)));
        page.list(&finding.evidence);
        page.raw("<div class=\"side\">");
        page.table(&parameters(finding));
        page.table(&candidates(finding, c.unit()));
        page.raw("</div>");
        for other in finding.alternatives.iter().filter(|a| a.indistinguishable) {
            let text = format!(
                "This record cannot tell {} from {}; the simpler of the two is named, and of two that are equally simple the one with the smaller error. What would tell them apart is said under Next",
                finding.name, other.name
            );
            page.paragraph("note", &text);
        }
        // A second mode has its pictures with the first.
        if i == 0 || effects[i - 1].name != finding.name {
            figures::write(page, &figures::of(&c.diagnosis.pictures, Some(finding.name)));
        }
    }
    not_named(page, c);
}

/// What may act too, and what this record would have shown.
fn not_named(page: &mut Page, c: &Contents<'_>) {
    let findings = &c.diagnosis.findings;
    let suspects = words::suspects(findings);
    if !suspects.is_empty() {
        page.raw("<h3>Suspects</h3>");
        page.list(&suspects);
    }
    let limits = words::limits(findings);
    if !limits.is_empty() {
        page.raw("<h3>What this record would have shown</h3>");
        page.paragraph("soft", "Sizes from which on each effect that was not named would have been");
        let mut table = Table::new("Limits of detection").words("effect").numbers("size").words("of what");
        limits.iter().for_each(|(name, size, of)| table.row(&[name, size, of]));
        page.table(&table);
    }
}

/// One row a parameter; those that are lists, element by element.
fn parameters(finding: &Finding) -> Table {
    let all = words::parameters(&finding.parameters);
    let element = |name: &str| {
        let (list, rest) = name.split_once('[')?;
        Some((list.to_owned(), rest.strip_suffix(']')?.parse::<usize>().ok()?))
    };
    let mut lists: BTreeMap<String, BTreeMap<usize, &str>> = BTreeMap::new();
    for (name, value) in &all {
        if let Some((list, i)) = element(name) {
            lists.entry(list).or_default().insert(i, value);
        }
    }
    if lists.is_empty() {
        let mut table = Table::new("Parameters").words("name").numbers("value ± standard error");
        all.iter().for_each(|(name, value)| table.row(&[*name, value]));
        return table;
    }
    let head = Table::new("Parameters, with their standard errors").words("element");
    let mut table = lists.keys().fold(head, |table, list| table.numbers(list));
    let rows = lists.values().flat_map(|list| list.keys().copied()).collect::<BTreeSet<usize>>();
    for i in rows {
        let cells = lists.values().map(|list| list.get(&i).copied().unwrap_or_default().to_owned());
        table.row(&std::iter::once(i.to_string()).chain(cells).collect::<Vec<_>>());
    }
    table
}

/// What stood in its place, by its cross-validated error.
fn candidates(finding: &Finding, unit: &str) -> Table {
    let mut table = Table::new("In its place").words("effect").numbers(&format!("cross-validated RMSE [{unit}]"));
    table.named_row(&[format!("{}, as named", finding.name), short(finding.cv_rmse_after)]);
    for other in &finding.alternatives {
        let tie = if other.indistinguishable { ", indistinguishable" } else { "" };
        table.row(&[format!("{}{tie}", other.name), short(other.cv_rmse)]);
    }
    table.row(&["nothing".to_owned(), short(finding.cv_rmse_before)]);
    table
}
