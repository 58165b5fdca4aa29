//! Section of models and files with their checksums, so that the report can be verified.

use hyst_ident::record::Record;
use serde_json::Value;

use super::Contents;
use super::html::{Page, Table};
use crate::text::short;

/// Writes the section.
pub(super) fn write(page: &mut Page, c: &Contents<'_>) {
    page.section("files", "Model and files");
    let mut table = Table::new("Files").words("use").words("name").numbers("rows").words("SHA-256");
    let model_rows: usize = c.model.fitted_on.iter().map(|f| f.rows + f.settling_rows).sum();
    table.row(&["model", c.model_file, &format!("fitted to {model_rows}"), c.model_sha256]);
    records(&mut table, "training", c.train);
    if let Some(test) = c.test {
        records(&mut table, "test", test);
    }
    page.raw("<div class=\"sum\">");
    page.table(&table);
    page.raw("</div>");

    let mut stages = Table::new("Stages of the extended model in signal order").words("stage").words("parameters");
    for stage in c.diagnosis.extended.stages() {
        stages.row(&[stage.get("stage").and_then(Value::as_str).unwrap_or_default().to_owned(), numbers(&stage)]);
    }
    page.table(&stages);
    page.paragraph(
        "soft",
        &format!(
            "Report by hystctl {}; model by hystctl {} with seed {}; seed of the bootstrap {}; {} samples per second",
            env!("CARGO_PKG_VERSION"),
            c.model.version,
            c.model.seed,
            c.seed,
            short(1.0 / c.train.sample_period())
        ),
    );
}

fn records(table: &mut Table, role: &str, record: &Record) {
    for (source, rows) in record.sources().iter().zip(record.rows_of_files()) {
        let sum = source.sha256.as_deref().unwrap_or("not kept in a file");
        table.row(&[role, source.name.as_str(), &rows.len().to_string(), sum]);
    }
}

/// Maximum length of a list that is printed; of a longer list only the length is printed.
const MAX_LISTED: usize = 4;

/// Returns the parameters of a stage in one line.
fn numbers(stage: &Value) -> String {
    let Value::Object(fields) = stage else { return String::new() };
    let own =
        fields.iter().filter(|(name, _)| !["stage", "units", "std_errors", "undetermined"].contains(&name.as_str()));
    own.map(|(name, value)| format!("{name} {}", number(value))).collect::<Vec<_>>().join("; ")
}

fn number(value: &Value) -> String {
    match value {
        Value::Number(n) => n.as_f64().map_or_else(|| n.to_string(), short),
        Value::Array(values) if values.len() > MAX_LISTED => format!("({} values)", values.len()),
        Value::Array(values) => values.iter().map(number).collect::<Vec<_>>().join(", "),
        Value::Object(fields) => format!("({} fields)", fields.len()),
        Value::String(text) => text.clone(),
        other => other.to_string(),
    }
}
