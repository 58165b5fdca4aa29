//! Columns with other times than the output.

use super::error::RecordError;
use super::heading::{Dimension, Heading};
use super::roles::{Choice, Clock, Layout};
use super::source::{Axis, Contents, Wanted};

/// Interpolates columns with other times linearly to the times of the output (without an output: of the input).
///
/// Before the first and after the last value of a column the result is NaN. Returns one note per interpolated column.
pub(super) fn align_to_output(
    contents: &dyn Contents,
    layout: &Layout,
    values: &mut [Option<Vec<f64>>; 4],
) -> Result<Vec<String>, RecordError> {
    let heads = contents.heads();
    let choices = [&layout.input, &layout.output, &layout.temperature, &layout.load];
    let Some(main) = layout.output.as_ref().or(layout.input.as_ref()) else { return Ok(Vec::new()) };
    let axis = |choice: &Choice| heads[choice.column].axis;
    // A time column named by --map, or a rate, applies to all columns.
    let named = match (layout.time.clone(), axis(main)) {
        (Clock::Column { column, .. }, Axis::Column(own)) => column != own,
        (Clock::Column { .. }, _) => true,
        (Clock::Even { step, .. }, Axis::Even { step: own, .. }) => step != own,
        (Clock::Even { .. }, _) => true,
    };
    let (Some(rows), false) = (values[usize::from(layout.output.is_some())].as_ref().map(Vec::len), named) else {
        return Ok(Vec::new());
    };
    let times = |axis: Axis, rows: usize| -> Result<Vec<f64>, RecordError> {
        match axis {
            Axis::Even { start, step } => Ok((0..rows).map(|k| start + k as f64 * step).collect()),
            Axis::Column(column) => {
                let unit = Heading::parse(&heads[column].name, heads[column].unit.as_deref()).unit;
                let per_second =
                    unit.filter(|unit| unit.dimension == Dimension::Time).map_or(1.0, |unit| unit.per_base);
                let read = contents.values(Wanted::all(&[column]))?.remove(0).numbers;
                Ok(read.into_iter().map(|t| t / per_second).collect())
            }
            Axis::Unknown => Ok(Vec::new()),
        }
    };
    let mut wanted = None;
    let mut notes = Vec::new();
    for (choice, values) in choices.into_iter().zip(values) {
        let (Some(choice), Some(values)) = (choice, values) else { continue };
        let own = axis(choice);
        if own == axis(main) || own == Axis::Unknown {
            continue;
        }
        let from = times(own, values.len())?;
        let to = match &wanted {
            Some(to) => to,
            None => wanted.insert(times(axis(main), rows)?),
        };
        if from == *to || from.len() != values.len() {
            continue;
        }
        *values = interpolated(&from, values, to);
        notes.push(format!(
            "\"{}\" is sampled at other times: interpolated to the times of \"{}\"",
            heads[choice.column].name, heads[main.column].name
        ));
    }
    Ok(notes)
}

/// Longest step in time that is interpolated, as a multiple of the usual step.
const MAX_STEP: f64 = 1.75;

/// Interpolates values at increasing times `from` to the times `to`; NaN outside.
fn interpolated(from: &[f64], values: &[f64], to: &[f64]) -> Vec<f64> {
    let mut steps: Vec<f64> = from.windows(2).map(|t| t[1] - t[0]).collect();
    if steps.iter().any(|step| *step <= 0.0 || step.is_nan()) {
        return vec![f64::NAN; to.len()];
    }
    steps.sort_unstable_by(f64::total_cmp);
    let usual = steps.get(steps.len() / 2).copied().unwrap_or(0.0);
    // A time that is outside by rounding only counts as inside.
    let slack = 1e-6 * usual;
    let (Some(first), Some(last)) = (from.first(), from.last()) else { return vec![f64::NAN; to.len()] };
    to.iter()
        .map(|t| {
            if *t < first - slack || *t > last + slack || !t.is_finite() {
                return f64::NAN;
            }
            let after = from.partition_point(|own| own <= t).clamp(1, from.len().max(2) - 1).min(from.len() - 1);
            let before = after.saturating_sub(1);
            let step = from[after] - from[before];
            if step > MAX_STEP * usual {
                f64::NAN
            } else if step > 0.0 {
                values[before] + (values[after] - values[before]) * (t - from[before]) / step
            } else {
                values[before]
            }
        })
        .collect()
}
