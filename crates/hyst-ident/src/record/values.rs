//! Conversion and checks of the values of columns.

use super::assembly::{ABSOLUTE_ZERO, Columns};
use super::error::{Place, RecordError};
use super::heading::Unit;
use super::roles::{Choice, Layout};

/// Converts values to the unit and sign of their role.
pub(super) fn convert(choice: &Choice, values: &mut [f64]) {
    let own = Unit::of_canonical(&choice.canonical);
    if let Some(to) = choice.unit.zip(own).and_then(|(unit, own)| unit.to(own)) {
        values.iter_mut().for_each(|value| *value = to(*value));
    }
    if let Some(factor) = choice.factor {
        values.iter_mut().for_each(|value| *value *= factor);
    }
}

/// Checks that no value overflowed during interpolation.
pub(super) fn finite(samples: &Columns, place: &dyn Fn(usize) -> Place) -> Result<(), RecordError> {
    let Columns { name, time, input_column, input, output, temperature, load, .. } = samples;
    let columns = [
        ("time_s", Some(time)),
        (input_column.as_str(), input.as_ref()),
        (output.as_ref().map_or("", |(unit, _)| unit.column()), output.as_ref().map(|(_, y)| y)),
        ("temperature_degc", temperature.as_ref()),
        ("load_n", load.as_ref()),
    ];
    for (column, values) in columns.into_iter().filter_map(|(column, values)| Some((column, values?))) {
        if let Some(row) = values.iter().position(|value| !value.is_finite()) {
            let value = format!("{} (overflow: the neighbouring values are too large)", values[row]);
            let (file, column) = (name.clone(), column.to_owned());
            return Err(RecordError::NotFinite { file, place: place(row), column, value });
        }
    }
    Ok(())
}

/// Converts segment labels to integers.
pub(super) fn integers(
    file: &str,
    values: &[f64],
    column: &str,
    place: &dyn Fn(usize) -> Place,
) -> Result<Vec<i64>, RecordError> {
    let of = |(row, value): (usize, &f64)| {
        // A double holds integers up to 2^53 ≈ 9e15 exactly.
        if value.fract() == 0.0 && value.abs() < 9e15 {
            return Ok(*value as i64);
        }
        Err(RecordError::SegmentNotInteger {
            file: file.to_owned(),
            place: place(row),
            column: column.to_owned(),
            text: value.to_string(),
        })
    };
    values.iter().enumerate().map(of).collect()
}

/// Checks that no temperature is below absolute zero.
pub(super) fn too_cold<'a>(
    file: &str,
    layout: &Layout,
    values: Option<&[f64]>,
    column: impl Fn(usize) -> &'a str,
    place: &dyn Fn(usize) -> Place,
) -> Result<(), RecordError> {
    let coldest =
        values.and_then(|values| values.iter().position(|degc| *degc < ABSOLUTE_ZERO).map(|row| (row, values[row])));
    coldest.map_or(Ok(()), |(row, degc)| {
        Err(RecordError::TooCold {
            file: file.to_owned(),
            place: place(row),
            column: layout.temperature.as_ref().map_or("", |choice| column(choice.column)).to_owned(),
            value: degc.to_string(),
        })
    })
}
