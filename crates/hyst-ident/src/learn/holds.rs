//! The reference with holds before and after it.

use crate::compensate::CompensateError;
use crate::record::{Columns, Record};

/// Returns the reference with its first value held for `rows` rows before it, and its last value for `rows` rows after
/// it.
pub(super) fn with_holds(reference: &Record, rows: usize) -> Result<Record, CompensateError> {
    let hold = |values: &[f64]| -> Vec<f64> {
        let (first, last) = (values.first().copied().unwrap_or(0.0), values.last().copied().unwrap_or(0.0));
        [&vec![first; rows], values, &vec![last; rows]].concat()
    };
    let period = reference.sample_period();
    let start = reference.time().first().copied().unwrap_or(0.0) - rows as f64 * period;
    let unit = reference.output_unit();
    Ok(Record::from_samples(Columns {
        name: reference.name(),
        time: (0..reference.rows() + 2 * rows).map(|k| start + k as f64 * period).collect(),
        output: unit.zip(reference.output().map(hold)),
        temperature: reference.temperature().map(hold),
        load: reference.load().map(hold),
        ..Columns::default()
    })?)
}
