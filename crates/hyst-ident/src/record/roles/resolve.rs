//! Assigns every role of a record to a column.

use super::canonical::per_second;
use super::headings::Headings;
use super::layout::{Choice, Clock, File, Layout};
use super::messages::Problems;
use crate::record::columns::{ColumnMap, Need, Role};
use crate::record::error::RecordError;
use crate::record::heading::{Dimension, Heading};
use crate::record::source::Axis;

impl Layout {
    /// Finds the columns that `need` requires. A `rate` \[Hz\] replaces the times of the file.
    pub(crate) fn resolve(
        file: &File<'_>,
        map: &ColumnMap,
        need: Need,
        rate: Option<f64>,
    ) -> Result<Self, RecordError> {
        let wants_input = matches!(need, Need::InputAndOutput | Need::Input | Need::Drive);
        let headings = file.heads.iter().map(|h| Heading::parse(&h.name, h.unit.as_deref())).collect();
        let search = Headings { wants_input, file, headings };
        let mut problems = Problems::default();
        let mapped = search.mapped(map)?;
        let wants_output = matches!(need, Need::InputAndOutput | Need::Output | Need::Reference { .. });
        // A column that the caller does not use is not read: its gaps and spikes do not matter.
        let (reads_output, reads_temperature, reads_load) = match need {
            Need::Drive => (false, false, false),
            Need::Reference { temperature, load } => (true, temperature, load),
            Need::InputAndOutput | Need::Input | Need::Output => (true, true, true),
        };

        let mut taken: Vec<usize> = mapped.iter().map(|(_, choice)| choice.column).collect();
        let mut role = |role: Role, required: bool| {
            let found = match mapped.iter().find(|(own, _)| *own == role) {
                Some((_, choice)) => Some(choice.clone()),
                None => search.find(role, required, &taken, &mut problems),
            };
            taken.extend(found.iter().map(|choice| choice.column));
            found
        };
        let segment = role(Role::Segment, false);
        let input = role(Role::Input, wants_input);
        let output = if reads_output { role(Role::Output, wants_output) } else { None };
        let temperature = if reads_temperature { role(Role::Temperature, false) } else { None };
        let load = if reads_load { role(Role::Load, false) } else { None };
        let column = output.as_ref().or(input.as_ref()).map_or(0, |choice| choice.column);
        let axis = file.heads.get(column).map_or(Axis::Unknown, |head| head.axis);
        // A rate replaces the time axis of the file.
        let stated = rate.map(|rate| Axis::Even { start: 0.0, step: 1.0 / rate }).or(match axis {
            Axis::Unknown => None,
            axis => Some(axis),
        });
        // If the file has several time columns, that of the output applies.
        let own = matches!(stated, Some(Axis::Column(_))) && !mapped.iter().any(|(role, _)| *role == Role::Time);
        let clock = if rate.is_some() || own { None } else { role(Role::Time, stated.is_none()) };
        let input = input.filter(|_| wants_input);
        let mut further = Vec::new();
        let time = match (clock.as_ref(), stated) {
            (Some(choice), _) => Some(Clock::Column {
                column: choice.column,
                per_second: choice.unit.map_or_else(|| per_second(&choice.canonical), |unit| unit.per_base),
            }),
            (None, Some(Axis::Even { start, step })) => Some(Clock::Even { start, step }),
            (None, Some(Axis::Column(column))) => {
                let unit = search.headings[column].unit.filter(|unit| unit.dimension == Dimension::Time);
                if unit.is_none() {
                    further
                        .push(format!("the times in {} have no unit: they are read as seconds", search.quoted(column)));
                }
                Some(Clock::Column { column, per_second: unit.map_or(1.0, |unit| unit.per_base) })
            }
            (None, _) => None,
        };
        let Some(time) = time.filter(|_| problems.list.is_empty()) else {
            return Err(search.refuse(problems, map, &taken));
        };
        let choices = [&clock, &input, &output, &temperature, &load];
        let notes = choices.into_iter().flatten().filter_map(|choice| search.reading(choice)).chain(further).collect();
        Ok(Self { segment: segment.map(|choice| choice.column), time, input, output, temperature, load, notes })
    }
}

/// Returns the columns that `map` names, with their roles.
///
/// # Errors
/// If a column is not in the file, or its unit has another dimension.
pub(crate) fn mapped(file: &File<'_>, map: &ColumnMap) -> Result<Vec<(Role, Choice)>, RecordError> {
    let headings = file.heads.iter().map(|h| Heading::parse(&h.name, h.unit.as_deref())).collect();
    Headings { wants_input: true, file, headings }.mapped(map)
}
