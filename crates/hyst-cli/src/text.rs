//! Numbers and tables as reports print them.

use std::fmt::Write;

pub use hyst_ident::digits::short;
use hyst_ident::digits::{decimals_for, rounded};
use hyst_ident::identify::{TableEstimate, TableOf};
use hyst_ident::metrics::{Errors, Mape};
use hyst_ident::model::Channel;
use hyst_ident::record::{OutputUnit, Record};
use hyst_ident::simulate::Extrapolated;

/// `value ± std_error`, both to the second significant digit of the standard error; the value alone without one.
pub fn with_error(value: f64, std_error: Option<f64>) -> String {
    match std_error.filter(|error| *error > 0.0 && error.is_finite()) {
        Some(error) => {
            let decimals = decimals_for(error, 2);
            format!("{} ± {}", rounded(value, decimals), rounded(error, decimals))
        }
        None => short(value),
    }
}

/// `2.31 %`, or what stands for a span of zero.
pub fn percent(x: f64) -> String {
    if x.is_finite() { format!("{} %", rounded(x, decimals_for(x, 3).clamp(0, 4))) } else { "no span".to_owned() }
}

/// How much a record says of a table of weights.
pub fn known(table: &TableEstimate) -> String {
    let (what, mean) = match table.of {
        TableOf::Cells => ("cells", "cell"),
        TableOf::Nodes => ("nodes", "node"),
    };
    format!(
        "the record determines {} of {} {what} (error below half of the mean {mean}), {} too little, {} not at all; {} at a bound",
        table.determined,
        table.elements,
        table.vague(),
        table.untouched,
        table.held
    )
}

/// `1 row`, `2 rows`.
pub fn count(n: usize, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

/// `a`, `a and b`, `a, b and c`.
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

/// The unit of an output as a person reads it, from the ending of its column.
pub fn symbol(suffix: &str) -> &str {
    OutputUnit::of_suffix(suffix).map_or(suffix, |unit| unit.symbol())
}

/// The unit that a column's name ends in, as a person reads it: `V` of `voltage_v`.
pub fn column_unit(column: &str) -> String {
    match column.rsplit('_').next().unwrap_or(column) {
        "v" => "V".to_owned(),
        suffix => symbol(suffix).to_owned(),
    }
}

/// The unit of a record's gain, as `µm/V`.
pub fn gain_unit(record: &Record) -> String {
    let output = record.output_unit().map_or("", OutputUnit::symbol);
    format!("{output}/{}", column_unit(record.input_column()))
}

/// The errors of a prediction in one line.
pub fn errors(e: &Errors, unit: &str) -> String {
    format!(
        "RMSE {} {unit} ({} of span), largest {} {unit}, RMSE over all rows {} {unit}",
        short(e.rmse),
        percent(e.nrmse_percent),
        short(e.max_abs),
        short(e.rmse_all_rows)
    )
}

/// With the row counted from 1, as people and JSON do.
pub fn from_one(found: Extrapolated) -> Extrapolated {
    Extrapolated { row: found.row + usize::from(found.rows > 0), ..found }
}

/// Where `what` leaves the range that a model was fitted to; rows count from 1.
pub fn extrapolation(what: &str, found: &Extrapolated, input: &Channel) -> String {
    let Channel { low, high, unit, .. } = input;
    format!(
        "in {} the {what} lies beyond {} to {} {unit}, the range that the model was identified on, by {} {unit} at most (row {})",
        count(found.rows, "row"),
        short(*low),
        short(*high),
        short(found.largest),
        found.row
    )
}

/// The mean relative error in one line, and what it leaves out.
pub fn mape(m: &Mape) -> String {
    let ratio = m.ratio.map_or_else(|| "none".to_owned(), |ratio| percent(100.0 * ratio));
    format!("MAPE {ratio} ({} below 1 % of span left out)", count(m.left_out, "row"))
}

/// A table: the first column flush left, the others flush right.
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
    fn numbers_show_what_is_known_of_them() {
        assert_eq!(with_error(0.123_456, Some(0.001_234)), "0.1235 ± 0.0012");
        assert_eq!(with_error(1234.5, Some(56.0)), "1234 ± 56");
        assert_eq!(with_error(2.0, None), "2.000");
        assert_eq!([0.012_34, 12.34, f64::INFINITY].map(percent), ["0.0123 %", "12.3 %", "no span"]);
        assert_eq!(listed(&["a", "b", "c"]), "a, b and c");
        assert_eq!(count(1, "row") + &count(2, "row"), "1 row2 rows");
    }

    #[test]
    fn tables_line_up() {
        let rows = [vec!["a", "b", ""], vec!["long", "1", "2.5"]].map(|r| r.iter().map(ToString::to_string).collect());
        assert_eq!(table(&rows), "a     b\nlong  1  2.5\n");
    }
}
