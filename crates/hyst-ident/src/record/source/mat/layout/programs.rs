//! Structs of particular programs.

use std::hash::{DefaultHasher, Hash, Hasher};

use super::super::tree::{Array, Fields, Structs, Value};
use super::about::About;
use super::{Layout, Scope};
use crate::record::source::gather::{Clock, Column};

/// Fields with the values of a signal.
const DATA: [&str; 3] = ["Data", "values", "Value"];
/// Fields with the name of a signal.
const NAME: [&str; 3] = ["Name", "label", "blockName"];
/// Fields with the unit of a signal.
const UNIT: [&str; 2] = ["Unit", "Units"];

/// A clock and its number of rows.
type Times = Option<(Clock, usize)>;

impl Layout<'_> {
    /// Adds the columns of a struct of a known program. Returns the numbers of the fields that it has read.
    pub(super) fn programs(
        &mut self,
        scope: Scope<'_>,
        fields: Fields<'_, '_>,
        columns: &mut Vec<Column>,
    ) -> Result<Vec<usize>, String> {
        if let (Some((x_at, x)), Some((y_at, y))) = (structs_in(fields, "X"), structs_in(fields, "Y"))
            && y.iter().all(|fields| fields.get(&DATA).is_some())
        {
            self.control_desk(scope, x, y, columns)?;
            return Ok(vec![x_at, y_at]);
        }
        if let Some((signals_at, signals)) = structs_in(fields, "signals")
            && let Some((time_at, time)) = fields.get(&["time"])
        {
            // Simulink writes times in seconds.
            let times = self.time(&scope.path_of(&fields.names[time_at]), time, Some("s"), columns)?;
            for (k, signal) in signals.iter().enumerate() {
                let path = scope.path_of(&format!("{}({})", fields.names[signals_at], k + 1));
                self.signal(Scope { path: &path, ..scope }, scope.path, signal, times, columns)?;
            }
            return Ok(vec![time_at, signals_at]);
        }
        let Some((data_at, data)) = fields.get(&DATA).filter(|(_, data)| data.is_numbers()) else {
            return Ok(Vec::new());
        };
        if let Some((time_at, time)) = fields.get(&["Time"]).filter(|(_, time)| time.is_numbers()) {
            let unit = inner(fields, "TimeInfo").and_then(|info| info.text(&UNIT));
            let times = self.time(&scope.path_of(&fields.names[time_at]), time, unit, columns)?;
            // A list of texts may name the columns of a table with a time.
            let lists = super::lists(fields);
            let about = About { unit: unit_of(fields), lists: &lists, ..about(scope, times) };
            self.numbers(&scope.path_of(&fields.names[data_at]), data, &about, columns)?;
            return Ok(vec![time_at, data_at]);
        }
        let even = inner(fields, "TimeInfo").and_then(|info| {
            let scalar = |name: &str| info.get(&[name])?.1.scalar();
            let step = scalar("Increment").filter(|step| *step > 0.0 && step.is_finite())?;
            Some((
                Clock::Even { start: scalar("Start").filter(|start| start.is_finite()).unwrap_or(0.0), step },
                *data.dims.last()?,
            ))
        });
        if even.is_some() || fields.text(&NAME).is_some() || fields.text(&UNIT).is_some() {
            self.signal(scope, scope.path, fields, even, columns)?;
            return Ok(vec![data_at]);
        }
        Ok(Vec::new())
    }

    /// Adds the columns of dSPACE ControlDesk: X has the time axes, Y the signals, each with the number of its axis.
    fn control_desk(
        &mut self,
        scope: Scope<'_>,
        x: &Structs<'_>,
        y: &Structs<'_>,
        columns: &mut Vec<Column>,
    ) -> Result<(), String> {
        let mut axes: Vec<Times> = Vec::with_capacity(x.elements.len());
        for (k, axis) in x.iter().enumerate() {
            let before = columns.len();
            let path = scope.path_of(&format!("X({})", k + 1));
            self.signal(Scope { path: &path, ..scope }, scope.path, axis, None, columns)?;
            axes.push(match &mut columns[before..] {
                [only] => {
                    only.clock = Clock::Unknown;
                    self.next_identity += 1;
                    only.identity = Some(self.next_identity);
                    Some((Clock::Column(self.next_identity), only.values.len()))
                }
                _ => None,
            });
        }
        for (k, signal) in y.iter().enumerate() {
            let path = scope.path_of(&format!("Y({})", k + 1));
            let number =
                signal.get(&["XIndex"]).and_then(|(_, number)| number.scalar()).map_or(1.0, |number| number.max(1.0));
            let times = axes.get(number as usize - 1).or(axes.first()).copied().flatten();
            self.signal(Scope { path: &path, ..scope }, scope.path, signal, times, columns)?;
        }
        Ok(())
    }

    /// Adds the columns of a struct with the name, unit and values of a signal. `owner` is the enclosing struct.
    fn signal(
        &mut self,
        scope: Scope<'_>,
        owner: &str,
        fields: Fields<'_, '_>,
        times: Times,
        columns: &mut Vec<Column>,
    ) -> Result<(), String> {
        let Some((at, data)) = fields.get(&DATA) else { return Ok(()) };
        let about =
            About { label: fields.text(&NAME).map(|name| (name, owner)), unit: unit_of(fields), ..about(scope, times) };
        self.numbers(&scope.path_of(&fields.names[at]), data, &about, columns)
    }

    /// Adds a time column, unless an earlier column has the same times. Many signals of a file share one clock.
    fn time(
        &mut self,
        path: &str,
        time: &Array<'_>,
        unit: Option<&str>,
        columns: &mut Vec<Column>,
    ) -> Result<Times, String> {
        let before = columns.len();
        self.numbers(path, time, &About { unit: unit.map(str::to_owned), ..About::new(Clock::Unknown) }, columns)?;
        let (earlier, [own]) = columns.split_at_mut(before) else { return Ok(None) };
        let mut hasher = DefaultHasher::new();
        own.values.iter().for_each(|value| value.to_bits().hash(&mut hasher));
        let hash = hasher.finish();
        let bits = |column: &Column| column.values.iter().map(|value| value.to_bits()).collect::<Vec<u64>>();
        if let Some(identity) = self.clocks.get(&hash)
            && let Some(same) = earlier.iter().find(|column| column.identity == Some(*identity))
            && same.unit == own.unit
            && bits(same) == bits(own)
        {
            let times = (Clock::Column(*identity), own.values.len());
            columns.truncate(before);
            return Ok(Some(times));
        }
        self.next_identity += 1;
        own.identity = Some(self.next_identity);
        self.clocks.insert(hash, self.next_identity);
        Ok(Some((Clock::Column(self.next_identity), own.values.len())))
    }
}

/// Returns the field `name` if it is a struct.
fn structs_in<'t, 'a>(fields: Fields<'t, 'a>, name: &str) -> Option<(usize, &'t Structs<'a>)> {
    let at = fields.names.iter().position(|own| own == name)?;
    match &fields.values.get(at)?.value {
        Value::Structs(structs) if !structs.elements.is_empty() => Some((at, structs)),
        _ => None,
    }
}

fn inner<'t, 'a>(fields: Fields<'t, 'a>, name: &str) -> Option<Fields<'t, 'a>> {
    fields.get(&[name])?.1.structs()?.iter().next()
}

fn unit_of(fields: Fields<'_, '_>) -> Option<String> {
    fields.text(&UNIT).or_else(|| inner(fields, "DataInfo")?.text(&UNIT)).map(str::to_owned)
}

fn about<'t>(scope: Scope<'_>, times: Times) -> About<'t> {
    About { clock_rows: times.map(|(_, rows)| rows), ..About::new(times.map_or(scope.clock(), |(clock, _)| clock)) }
}
