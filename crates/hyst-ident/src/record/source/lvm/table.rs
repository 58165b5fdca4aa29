//! The table of an LVM file.

use super::header::XColumns;
use super::rows::{Content, Role};
use crate::record::source::{Axis, Head, Table};

/// The name of a time column in LabVIEW.
const TIMES: &str = "X_Value";

/// Makes the table of a file.
pub(crate) fn table(content: Content) -> Result<Table, String> {
    let mut table = Table::new("LabVIEW LVM");
    table.notes.clone_from(&content.notes);
    let Content { mut columns, starts, x_columns, .. } = content;
    let rows = columns.first().map_or(0, |column| column.values.len());
    if x_columns == XColumns::Multi && starts.len() == 1 {
        // Shorter channels are padded with empty cells.
        for column in &mut columns {
            let used = column.values.iter().rposition(|value| !value.is_nan()).map_or(0, |last| last + 1);
            column.values.truncate(used);
        }
    } else if x_columns == XColumns::No && starts.len() == 1 {
        for column in &mut columns {
            let stated =
                column.samples.filter(|samples| column.values.iter().skip(*samples).all(|value| value.is_nan()));
            column.values.truncate(stated.unwrap_or(rows).max(2));
        }
    }
    let times: Vec<usize> = (0..columns.len()).filter(|at| columns[*at].role == Role::Time).collect();
    let bits = |at: usize| columns[at].values.iter().map(|value| value.to_bits());
    let are_same = times.windows(2).all(|pair| bits(pair[0]).eq(bits(pair[1])));
    let mut clock = None;
    for at in 0..columns.len() {
        let values = std::mem::take(&mut columns[at].values);
        let column = &columns[at];
        let is_time = column.role == Role::Time;
        if values.len() < 2 || is_time && are_same && clock.is_some() {
            continue;
        }
        if is_time {
            // A time column of a single channel has the name of the channel and no unit, because several columns in
            // seconds are ambiguous. The axis is in seconds in any case.
            let head = if are_same {
                Head { unit: column.unit.clone(), ..Head::new(TIMES) }
            } else {
                let of = columns.get(at + 1).map_or("", |next| next.name.as_str());
                Head { unit: column.unit.clone().filter(|unit| unit != "s"), ..Head::new(format!("{of}.{TIMES}")) }
            };
            clock = Some(table.push(head, values));
            continue;
        }
        let axis = match (clock, column.step) {
            (Some(clock), _) if table.values[clock].len() == values.len() => Axis::Column(clock),
            (None, Some(step)) => Axis::Even { start: column.start, step },
            _ => Axis::Unknown,
        };
        table.push(Head { unit: column.unit.clone(), axis, ..Head::new(column.name.clone()) }, values);
    }
    if !table.heads.iter().any(|head| head.axis != Axis::Unknown || head.name != TIMES) {
        return Err("no channel has two or more values; record at least two samples".into());
    }
    if starts.len() > 1 {
        let labels = (0..rows).map(|row| starts.partition_point(|start| *start <= row) as f64 - 1.0).collect();
        table.push(Head::new("segment"), labels);
    }
    Ok(table)
}
