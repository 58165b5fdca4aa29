//! Section of the named effects: parameters, evidence and alternatives of each.

use std::collections::{BTreeMap, BTreeSet};

use hyst_ident::diagnose::Finding;

use super::html::{Page, Table, escaped};
use super::{Contents, figures, words};
use crate::text::short;

/// Writes the section.
pub(super) fn write(page: &mut Page, c: &Contents<'_>) {
    page.section("effects", "Missing effects");
    let effects = &c.diagnosis.findings.effects;
    if effects.is_empty() {
        page.paragraph("", "No effect was named: none explains the residual well enough");
        not_named(page, c);
        return;
    }
    page.paragraph(
        "soft",
        "Each plot compares the extended model with the same model without this effect; nothing is fitted again. The difference is the \
         contribution of the effect. Residuals are measured minus predicted output",
    );
    page.raw(
        "<p class=\"soft hint\">Drag across a plot to zoom; double-click to reset. On a touch screen two fingers zoom, one finger moves, \
         and a double tap resets. With the keyboard + and - zoom, arrow keys move, and Escape resets. \
         Click the name of a curve to hide or show it.</p>",
    );
    for (i, finding) in effects.iter().enumerate() {
        page.raw(&format!("<h3 class=\"effect\">{}</h3>", escaped(finding.name)));
        let (names, probability) = (words::with_ties(finding), words::probability(finding.probability));
        page.paragraph("", &format!("Probability that {names} acts: {probability}"));
        page.list(&finding.evidence);
        page.raw("<div class=\"side\">");
        page.table(&parameters(finding));
        page.table(&candidates(finding, c.unit()));
        page.raw("</div>");
        for other in finding.ties() {
            let text = format!(
                "This record cannot distinguish {} from {}. The simpler effect is named; of two equally simple effects, \
                 the one with the smaller error. The end of the section Remainder has a command for a drive that \
                 distinguishes them",
                finding.name, other.name
            );
            page.paragraph("note", &text);
        }
        // The pictures of a second mode are those of the first.
        if i == 0 || effects[i - 1].name != finding.name {
            figures::write(page, &figures::of(&c.diagnosis.pictures, Some(finding.name)));
        }
    }
    not_named(page, c);
}

/// Writes suspected effects and limits of detection.
fn not_named(page: &mut Page, c: &Contents<'_>) {
    let findings = &c.diagnosis.findings;
    let suspects = words::suspects(findings);
    if !suspects.is_empty() {
        page.raw("<h3>Suspected effects</h3>");
        page.list(&suspects);
    }
    let limits = words::limits(findings);
    if !limits.is_empty() {
        page.raw("<h3>Limits of detection</h3>");
        page.paragraph(
            "soft",
            "For each effect that is not named, the smallest size that this record would have shown",
        );
        let mut table = Table::new("Limits of detection").words("effect").numbers("size").words("meaning");
        limits.iter().for_each(|(name, size, of)| table.row(&[name, size, of]));
        page.table(&table);
    }
}

/// Returns the table of parameters: one row per parameter, or per element of parameters in lists.
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
    let head = Table::new("Parameters with standard errors").words("element");
    let mut table = lists.keys().fold(head, |table, list| table.numbers(list));
    let rows = lists.values().flat_map(|list| list.keys().copied()).collect::<BTreeSet<usize>>();
    for i in rows {
        let cells = lists.values().map(|list| list.get(&i).copied().unwrap_or_default().to_owned());
        table.row(&std::iter::once(i.to_string()).chain(cells).collect::<Vec<_>>());
    }
    table
}

/// Returns the table of the named effect and its alternatives with their cross-validated errors.
fn candidates(finding: &Finding, unit: &str) -> Table {
    let mut table = Table::new("Alternatives").words("effect").numbers(&format!("cross-validated RMSE [{unit}]"));
    table.named_row(&[format!("{}, named", finding.name), short(finding.cv_rmse_after)]);
    for other in &finding.alternatives {
        let tie = if other.indistinguishable { ", indistinguishable" } else { "" };
        table.row(&[format!("{}{tie}", other.name), short(other.cv_rmse)]);
    }
    table.row(&["no effect".to_owned(), short(finding.cv_rmse_before)]);
    table
}
