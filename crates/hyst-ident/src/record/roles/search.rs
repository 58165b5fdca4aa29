//! Search for the column of a role: by `--map`, by names of the record format, by units, and by words.

use super::headings::Headings;
use super::layout::Choice;
use super::messages::{MAX_LISTED, Problems, quoted};
use super::words::{contrary, words_of};
use crate::record::columns::{ColumnMap, Entry, Role};
use crate::record::error::RecordError;
use crate::record::heading::{Dimension, Unit, leaf};

impl Headings<'_> {
    /// Finds the columns that `map` names: by the whole name, by its last part, or by number.
    pub(super) fn mapped(&self, map: &ColumnMap) -> Result<Vec<(Role, Choice)>, RecordError> {
        let of = |entry: &Entry| {
            let by = |is: &dyn Fn(&str) -> bool| {
                let mut found = self.columns().filter(|at| is(self.name(*at)));
                found.next().filter(|_| found.next().is_none())
            };
            let number = || entry.column.parse::<usize>().ok()?.checked_sub(1).filter(|at| self.columns().contains(at));
            let column = by(&|name| name == entry.column)
                .or_else(|| by(&|name| leaf(name) == entry.column))
                .or_else(|| self.file.heads.iter().position(|head| head.path.as_deref() == Some(&entry.column)))
                .or_else(number)
                .or_else(|| self.part_of_table(&entry.column))
                .ok_or_else(|| self.not_there(entry))?;
            let unit = self.headings[column].unit;
            // The stated unit of a time column is often wrong, so the unit of the map applies.
            // A factor applies to the values in the file and replaces their unit; −1 only inverts the sign.
            let scaled = entry.factor.is_some_and(|factor| factor != -1.0);
            let unit = match (Unit::of_canonical(&entry.canonical), unit.filter(|_| !scaled)) {
                (Some(own), Some(unit)) if entry.role != Role::Time && unit != own => {
                    if unit.dimension != own.dimension {
                        return Err(self.other_dimension(entry, unit));
                    }
                    Some(unit)
                }
                _ => None,
            };
            Ok((entry.role, Choice { column, canonical: entry.canonical.clone(), unit, factor: entry.factor }))
        };
        map.entries.iter().map(of).collect()
    }

    /// Finds the column `table[2]` of a table with named columns.
    pub(super) fn part_of_table(&self, name: &str) -> Option<usize> {
        let (table, number) = name.strip_suffix(']')?.rsplit_once('[')?;
        let number = number.parse::<usize>().ok()?.checked_sub(1)?;
        let table = format!("{}/", table.trim_end_matches('/'));
        let own = |at: &usize| self.name(*at).strip_prefix(&table).is_some_and(|rest| !rest.contains('/'));
        self.columns().filter(own).nth(number)
    }

    /// Finds the column with `role`. If it is required and not found, adds a problem.
    pub(super) fn find(&self, role: Role, required: bool, taken: &[usize], problems: &mut Problems) -> Option<Choice> {
        let free = || self.columns().filter(|at| !taken.contains(at));
        let plain = |column: usize| {
            let canonical = leaf(self.name(column)).to_owned();
            // A row of units or an attribute overrides the unit in the name.
            let own = Unit::of_canonical(&canonical);
            let stated = self.file.heads[column].unit.as_deref().and_then(Unit::parse);
            let unit = stated.filter(|unit| own.is_some_and(|own| own != *unit && own.dimension == unit.dimension));
            Choice { column, canonical, unit, factor: None }
        };
        let voltage = || free().filter(|at| leaf(self.name(*at)) == "voltage_v");
        let volts = |at: &usize| self.headings[*at].unit.is_some_and(|unit| unit.dimension == Dimension::Voltage);
        // Names of the record format.
        let is_own = |at: &usize| {
            let name = leaf(self.name(*at));
            // `<quantity>_in_<unit>` is an input only if no column is in volts, and never with a unit of time or
            // temperature.
            let other = role == Role::Input && name != "voltage_v";
            let odd = || {
                name.rsplit_once("_in_")
                    .and_then(|(_, unit)| Unit::parse(unit))
                    .is_some_and(|unit| matches!(unit.dimension, Dimension::Time | Dimension::Temperature))
            };
            Role::of_column(name) == Some(role) && !(other && (odd() || free().any(|at| volts(&at))))
        };
        let mut own = free().filter(is_own);
        match (own.next(), own.next()) {
            // A voltage takes precedence over other inputs.
            (Some(_), Some(_)) if role == Role::Input && voltage().count() == 1 => return voltage().next().map(plain),
            (Some(first), Some(second)) => {
                let hint = match (role, leaf(self.name(second))) {
                    (Role::Output, "force_n") => {
                        "; if \"force_n\" is the load that acts on the actuator: --map load_n=force_n"
                    }
                    _ => "",
                };
                let what =
                    format!("{} and {} both could be {}{hint}", self.quoted(first), self.quoted(second), role.words());
                problems.add(role, Some(first), what);
                return None;
            }
            (Some(only), None) => return Some(plain(only)),
            (None, _) => {}
        }
        // Headings that state a unit.
        let measured: Vec<usize> = free().filter(|at| self.could_be(role, *at, required)).collect();
        let chosen = match *measured.as_slice() {
            [] => None,
            [only] if required && role != Role::Segment && self.contradicts(role, only) => {
                let what = format!(
                    "{} is probably not {}: its name suggests {}",
                    self.quoted(only),
                    role.words(),
                    contrary(role)
                );
                problems.add(role, Some(only), what);
                return None;
            }
            [only] => Some(only),
            ref several => match self.preferred(role, several).as_slice() {
                [best] => Some(*best),
                _ if !required => None,
                _ => {
                    let names =
                        several.iter().map(|at| self.quoted(*at)).take(MAX_LISTED).collect::<Vec<_>>().join(", ");
                    problems.add(role, Some(several[0]), format!("{names} each could be {}", role.words()));
                    return None;
                }
            },
        };
        if role == Role::Segment {
            return chosen.map(|column| Choice { column, canonical: "segment".to_owned(), unit: None, factor: None });
        }
        if let Some(column) = chosen {
            return self.headings[column].unit.map(|unit| {
                let canonical = unit.canonical(role).to_owned();
                let own = Unit::of_canonical(&canonical);
                Choice {
                    column,
                    unit: Some(unit).filter(|unit| role == Role::Time || own != Some(*unit)),
                    canonical,
                    factor: None,
                }
            });
        }
        // Words without a unit: of the heading, otherwise of the path before it.
        let without = |at: &usize| self.headings[*at].unit.is_none();
        // A single letter is weak evidence: a column "X" that counts the rows is not a position.
        let letter = |at: &usize| leaf(self.name(*at)).chars().count() == 1;
        let without = |at: &usize| without(at) && !(letter(at) && self.is_counter(role, *at));
        let worded = |at: &usize| without(at) && self.headings[*at].suggests(words_of(role));
        let unknown = free().filter(worded).find(|at| required || self.states_unknown_unit(role, *at));
        let by_path = |at: &usize| without(at) && self.is_unstated(*at) && self.path_suggests(role, *at);
        let unknown = unknown.or_else(|| if required { free().find(by_path) } else { None });
        match unknown {
            Some(at) => {
                let why = match &self.headings[at].unknown {
                    Some(unit) => format!("the unit {} is not known", quoted(unit)),
                    None => "its unit is not stated".to_owned(),
                };
                problems.add(role, Some(at), format!("{} may be {}, but {why}", self.quoted(at), role.words()));
            }
            _ if required && self.text_of(role).is_some() => {
                let (name, example) = self.text_of(role).unwrap_or_default();
                problems.add(
                    role,
                    None,
                    format!("{} may be {}, but it holds text: {}", quoted(name), role.words(), quoted(example)),
                );
            }
            _ if required => {
                let which = if self.is_without_names() { "the columns have no names, and none" } else { "no heading" };
                let what =
                    format!("{which} states a unit of {} (expected for example {})", role.words(), role.accepted());
                problems.add(role, None, what);
            }
            _ => {}
        }
        None
    }
}
