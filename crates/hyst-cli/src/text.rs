//! Formats of numbers, sentences and tables in reports.

use std::fmt::Write;

pub use hyst_ident::digits::short;
use hyst_ident::digits::{decimals_for, rounded};
use hyst_ident::identify::{TableEstimate, TableOf};
use hyst_ident::metrics::{Errors, Mape};
use hyst_ident::model::Channel;
use hyst_ident::record::{OutputUnit, Record};
use hyst_ident::simulate::Extrapolated;

/// Formats `value ± std_error` to the second significant digit of the error.
///
/// Without an error it formats only the value.
pub fn with_error(value: f64, std_error: Option<f64>) -> String {
    match std_error.filter(|error| *error > 0.0 && error.is_finite()) {
        Some(error) => {
            let decimals = decimals_for(error, 2);
            format!("{} ± {}", rounded(value, decimals), rounded(error, decimals))
        }
        None => short(value),
    }
}

/// Formats a percentage, for example `2.31 %`; `no span` for a value relative to a span of zero.
pub fn percent(x: f64) -> String {
    if x.is_finite() { format!("{} %", rounded(x, decimals_for(x, 3).clamp(0, 4))) } else { "no span".to_owned() }
}

/// Returns a sentence about how well a record determines a table of weights.
pub fn known(table: &TableEstimate) -> String {
    let (what, mean) = match table.of {
        TableOf::Cells => ("cells", "cell"),
        TableOf::Nodes => ("nodes", "node"),
    };
    format!(
        "the record determines {} of {} {what} (standard error below half of the mean {mean}); uncertain: {}, undetermined: {}, \
         at a bound: {}",
        table.determined,
        table.elements,
        table.vague(),
        table.untouched,
        table.held
    )
}

/// Formats a count, for example `1 row` or `2 rows`.
pub fn count(n: usize, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

/// Formats a list: `a`, `a and b`, `a, b and c`.
pub fn listed<S: AsRef<str>>(names: &[S]) -> String {
    match names {
        [] => String::new(),
        [only] => only.as_ref().to_owned(),
        [head @ .., last] => {
            let head: Vec<&str> = head.iter().map(AsRef::as_ref).collect();
            format!("{} and {}", head.join(", "), last.as_ref())
        }
    }
}

/// Returns the symbol of an output unit from the ending of its column.
pub fn symbol(suffix: &str) -> &str {
    OutputUnit::of_suffix(suffix).map_or(suffix, |unit| unit.symbol())
}

/// Returns the symbol of the unit that the name of a column ends in: `V` for `voltage_v`.
pub fn column_unit(column: &str) -> String {
    match column.rsplit('_').next().unwrap_or(column) {
        "v" => "V".to_owned(),
        suffix => symbol(suffix).to_owned(),
    }
}

/// Returns the unit of a record's gain, for example `µm/V`.
pub fn gain_unit(record: &Record) -> String {
    let output = record.output_unit().map_or("", OutputUnit::symbol);
    format!("{output}/{}", column_unit(record.input_column()))
}

/// Formats the errors of a prediction in one line.
pub fn errors(e: &Errors, unit: &str) -> String {
    format!(
        "RMSE {} {unit} ({} of span), largest {} {unit}, RMSE over all rows {} {unit}",
        short(e.rmse),
        percent(e.nrmse_percent),
        short(e.max_abs),
        short(e.rmse_all_rows)
    )
}

/// Counts the row from 1, as reports and JSON do.
pub fn from_one(found: Extrapolated) -> Extrapolated {
    Extrapolated { row: found.row + usize::from(found.rows > 0), ..found }
}

/// Returns a sentence about rows in which `what` is outside the range of a model; rows count from 1.
pub fn extrapolation(what: &str, found: &Extrapolated, input: &Channel) -> String {
    let Channel { low, high, unit, .. } = input;
    format!(
        "in {} the {what} is outside {} to {} {unit}, the range that the model was fitted to, by at most {} {unit} (row {})",
        count(found.rows, "row"),
        short(*low),
        short(*high),
        short(found.largest),
        found.row
    )
}

/// Formats the mean relative error and the number of rows that it leaves out.
pub fn mape(m: &Mape) -> String {
    let ratio = m.ratio.map_or_else(|| "none".to_owned(), |ratio| percent(100.0 * ratio));
    format!("MAPE {ratio} ({} below 1 % of span left out)", count(m.left_out, "row"))
}

/// Formats a table: the first column is left-aligned, the others are right-aligned.
pub fn table(rows: &[Vec<String>]) -> String {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let length = |cell: &String| cell.chars().count();
    let widths: Vec<usize> =
        (0..columns).map(|c| rows.iter().filter_map(|row| row.get(c)).map(length).max().unwrap_or(0)).collect();
    let mut text = String::new();
    for row in rows {
        for (c, (cell, width)) in row.iter().zip(&widths).enumerate() {
            // Writing to a String does not fail.
            let _ = if c == 0 { write!(text, "{cell:<width$}") } else { write!(text, "  {cell:>width$}") };
        }
        text.truncate(text.trim_end().len());
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_show_their_significant_digits() {
        assert_eq!(with_error(0.123_456, Some(0.001_234)), "0.1235 ± 0.0012");
        assert_eq!(with_error(1234.5, Some(56.0)), "1234 ± 56");
        assert_eq!(with_error(2.0, None), "2.000");
        assert_eq!([0.012_34, 12.34, f64::INFINITY].map(percent), ["0.0123 %", "12.3 %", "no span"]);
        assert_eq!(listed(&["a", "b", "c"]), "a, b and c");
        assert_eq!(count(1, "row") + &count(2, "row"), "1 row2 rows");
    }

    #[test]
    fn columns_of_tables_are_aligned() {
        let rows = [vec!["a", "b", ""], vec!["long", "1", "2.5"]].map(|r| r.iter().map(ToString::to_string).collect());
        assert_eq!(table(&rows), "a     b\nlong  1  2.5\n");
    }
}
