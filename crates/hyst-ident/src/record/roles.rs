//! Assignment of roles and units to the columns of a file.
//!
//! The order of precedence is: `--map`, names of the record format, headings with a unit (a column in volts is the
//! input, a column in micrometres the output). If two columns are possible, the words of the headings decide. A unit is
//! never assumed: if it is not stated, the message ends with the options to paste.

use super::columns::{ColumnMap, Entry, Need, Role};
use super::error::{Place, RecordError};
use super::heading::{Dimension, Heading, Unit, leaf, words};
use super::source::{Axis, Head};
use super::unit::{OutputUnit, TimeUnit};

/// A column with a role.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Choice {
    /// The number of the column, counted from 0.
    pub(crate) column: usize,
    /// The name in the record format.
    pub(crate) canonical: String,
    /// The unit in the file, if it differs from the unit of `canonical`.
    pub(crate) unit: Option<Unit>,
    /// The factor that is applied to the values after a conversion.
    pub(crate) factor: Option<f64>,
}

/// The source of the times.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Clock {
    /// A column, and the number of its unit per second.
    Column { column: usize, per_second: f64 },
    /// Even times \[s\].
    Even { start: f64, step: f64 },
}

/// The columns of a file by role.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Layout {
    pub(crate) segment: Option<usize>,
    pub(crate) time: Clock,
    pub(crate) input: Option<Choice>,
    pub(crate) output: Option<Choice>,
    pub(crate) temperature: Option<Choice>,
    pub(crate) load: Option<Choice>,
    /// One sentence per column that does not have a name and unit of the record format.
    pub(crate) notes: Vec<String>,
}

/// The columns of a file, with the names that messages use.
pub(crate) struct File<'a> {
    pub(crate) name: &'a str,
    pub(crate) header: Option<Place>,
    pub(crate) heads: &'a [Head],
    /// Columns of text, each with an example of a cell.
    pub(crate) texts: &'a [(String, String)],
    /// Columns that count the rows, if they were searched. They are neither inputs nor outputs.
    pub(crate) counters: &'a [usize],
}

/// Maximum number of names in a message.
const MAX_LISTED: usize = 12;
/// Maximum number of characters of a name in a message.
const MAX_CHARACTERS: usize = 48;

impl Layout {
    /// Finds the columns that `need` requires. A `rate` \[Hz\] replaces the times of the file.
    pub(crate) fn resolve(
        file: &File<'_>,
        map: &ColumnMap,
        need: Need,
        rate: Option<f64>,
    ) -> Result<Self, RecordError> {
        let wants_input = matches!(need, Need::InputAndOutput | Need::Input);
        let headings = file.heads.iter().map(|h| Heading::parse(&h.name, h.unit.as_deref())).collect();
        let search = Search { wants_input, file, headings };
        let mut problems = Problems::default();
        let mapped = search.mapped(map)?;
        let wants_output = matches!(need, Need::InputAndOutput | Need::Output);

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
        let output = role(Role::Output, wants_output);
        let temperature = role(Role::Temperature, false);
        let load = role(Role::Load, false);
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
    Search { wants_input: true, file, headings }.mapped(map)
}

fn per_second(canonical: &str) -> f64 {
    TimeUnit::of_column(canonical).unwrap_or(TimeUnit::Second).per_second()
}

/// The problems of the columns of a file, and the roles without a column.
#[derive(Default)]
struct Problems {
    list: Vec<String>,
    /// Roles without a column, each with the most likely column.
    open: Vec<(Role, Option<usize>)>,
}

impl Problems {
    fn add(&mut self, role: Role, guess: Option<usize>, what: String) {
        self.list.push(what);
        self.open.push((role, guess));
    }
}

struct Search<'a> {
    /// Whether the record needs an input; false for a reference.
    wants_input: bool,
    file: &'a File<'a>,
    headings: Vec<Heading>,
}

impl Search<'_> {
    fn name(&self, column: usize) -> &str {
        &self.file.heads[column].name
    }

    fn columns(&self) -> std::ops::Range<usize> {
        0..self.file.heads.len()
    }

    /// Finds the columns that `map` names: by the whole name, by its last part, or by number.
    fn mapped(&self, map: &ColumnMap) -> Result<Vec<(Role, Choice)>, RecordError> {
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
    fn part_of_table(&self, name: &str) -> Option<usize> {
        let (table, number) = name.strip_suffix(']')?.rsplit_once('[')?;
        let number = number.parse::<usize>().ok()?.checked_sub(1)?;
        let table = format!("{}/", table.trim_end_matches('/'));
        let own = |at: &usize| self.name(*at).strip_prefix(&table).is_some_and(|rest| !rest.contains('/'));
        self.columns().filter(own).nth(number)
    }

    /// Finds the column with `role`. If it is required and not found, adds a problem.
    fn find(&self, role: Role, required: bool, taken: &[usize], problems: &mut Problems) -> Option<Choice> {
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

    /// Returns whether a column counts the rows and `role` is not the time.
    fn is_counter(&self, role: Role, column: usize) -> bool {
        role != Role::Time && self.file.counters.contains(&column)
    }

    /// Returns whether all column names are numbers.
    fn is_without_names(&self) -> bool {
        (0..self.headings.len()).all(|at| self.name(at).bytes().all(|byte| byte.is_ascii_digit()))
    }

    /// Returns whether a column has no unit, neither a known nor an unknown one.
    fn is_unstated(&self, column: usize) -> bool {
        self.headings[column].unit.is_none() && self.headings[column].unknown.is_none()
    }

    /// Returns whether the name of a column, including its path, has a word of `role`, and its last part has no word of
    /// another role (as in `voltage.Time`).
    fn path_suggests(&self, role: Role, column: usize) -> bool {
        const OTHERS: [Role; 5] = [Role::Time, Role::Input, Role::Output, Role::Temperature, Role::Load];
        let own = |other: &Role| self.headings[column].suggests(words_of(*other));
        let is_another = !own(&role) && OTHERS.iter().any(own);
        !is_another && words(self.name(column)).iter().any(|word| words_of(role).contains(&word.as_str()))
    }

    /// Finds a column of text whose heading states a unit of `role`.
    fn text_of(&self, role: Role) -> Option<(&str, &str)> {
        let fits = |name: &str| {
            Role::of_column(name) == Some(role) || Heading::parse(name, None).unit.is_some_and(|unit| has(role, unit))
        };
        self.file.texts.iter().find(|(name, _)| fits(name)).map(|(name, example)| (name.as_str(), example.as_str()))
    }

    /// Returns whether the unit of a column fits `role`. If the role is not `required`, its words must fit too.
    fn could_be(&self, role: Role, column: usize, required: bool) -> bool {
        let heading = &self.headings[column];
        let Some(unit) = heading.unit else {
            return role == Role::Segment && heading.words == ["segment"];
        };
        has(role, unit)
            && match role {
                Role::Input => required || heading.suggests(INPUT),
                Role::Output => !heading.suggests(LOAD) && (required || heading.suggests(OUTPUT)),
                Role::Load => heading.suggests(LOAD),
                _ => true,
            }
    }

    /// Returns whether the words of a column contradict `role`.
    fn contradicts(&self, role: Role, column: usize) -> bool {
        let heading = &self.headings[column];
        match role {
            Role::Input => heading.suggests(NOT_INPUT) && !heading.suggests(&["drive", "input", "voltage", "command"]),
            // In a reference the output column is the target.
            Role::Output => self.wants_input && heading.suggests(NOT_OUTPUT),
            _ => false,
        }
    }

    /// Returns those of several columns that the words of their headings prefer.
    fn preferred(&self, role: Role, several: &[usize]) -> Vec<usize> {
        let with = |words: &[&str], is: bool| {
            several.iter().copied().filter(|at| self.headings[*at].suggests(words) == is).collect::<Vec<_>>()
        };
        let by_word = with(words_of(role), true);
        match role {
            // The measured output, not the reference.
            Role::Output => {
                let measured = with(COMMANDED, false);
                let by_word: Vec<usize> = by_word.into_iter().filter(|at| measured.contains(at)).collect();
                if measured.len() != 1 && by_word.len() == 1 {
                    return by_word;
                }
                let lengths =
                    |at: &usize| self.headings[*at].unit.is_some_and(|unit| unit.dimension == Dimension::Length);
                if measured.len() == 1 { measured } else { measured.iter().copied().filter(lengths).collect() }
            }
            Role::Input => {
                let driven = with(SENSOR, false);
                let by_word: Vec<usize> = by_word.into_iter().filter(|at| driven.contains(at)).collect();
                if by_word.len() == 1 { by_word } else { driven }
            }
            _ => by_word,
        }
    }

    /// Returns whether the column of an optional role ends in a unit that is not supported.
    fn states_unknown_unit(&self, role: Role, column: usize) -> bool {
        let heading = &self.headings[column];
        match role {
            Role::Temperature | Role::Load => {
                heading.words.len() == 2 && heading.unit.is_none() && UNKNOWN_UNITS.contains(&heading.words[1].as_str())
            }
            _ => false,
        }
    }

    /// Returns the note of a column that is identified by its heading or has another unit.
    fn reading(&self, choice: &Choice) -> Option<String> {
        let name = self.name(choice.column);
        let own_name = leaf(name) == choice.canonical;
        if own_name && choice.unit.is_none() && !choice.canonical.contains("_in_") {
            return None;
        }
        let own = Unit::of_canonical(&choice.canonical);
        let converted = choice.unit.zip(own).filter(|(unit, own)| unit != own);
        let converted = converted
            .map_or(String::new(), |(unit, own)| format!(", converted from {} to {}", unit.symbol, own.symbol));
        Some(format!("{} is read as {}{converted}", quoted(name), choice.canonical))
    }

    /// Returns the name of a column in quotation marks, with the unit that the file states outside the name.
    fn quoted(&self, column: usize) -> String {
        let unit = self.file.heads[column].unit.as_deref().map_or(String::new(), |unit| format!(" in {unit}"));
        format!("{}{unit}", quoted(self.name(column)))
    }

    fn listed(&self) -> String {
        let names: Vec<String> = self.columns().take(MAX_LISTED).map(|at| self.quoted(at)).collect();
        let more = self.file.heads.len().saturating_sub(MAX_LISTED);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        format!("{}{more}", names.join(", "))
    }

    fn not_there(&self, entry: &Entry) -> RecordError {
        let same = |at: &usize| self.name(*at) == entry.column || leaf(self.name(*at)) == entry.column;
        let numbers: Vec<String> =
            self.columns().filter(same).take(MAX_LISTED).map(|at| (at + 1).to_string()).collect();
        if let [first, _, ..] = numbers.as_slice() {
            let problems = format!("{} is the name of the columns {}", quoted(&entry.column), numbers.join(", "));
            let advice = format!("give the number of the column, for example --map {}={first}", entry.canonical);
            return RecordError::Columns {
                file: self.place(),
                problems,
                advice,
                options: String::new(),
                columns: self.file.heads.len() + self.file.texts.len(),
            };
        }
        let longer =
            self.columns().map(|at| self.name(at)).find(|name| name.starts_with(&format!("{} ", entry.column)));
        RecordError::MappedColumnMissing {
            file: self.place(),
            canonical: entry.canonical.clone(),
            column: entry.column.clone(),
            found: self.listed(),
            hint: match longer {
                Some(whole) => {
                    format!(
                        "; a name with spaces needs quotes: --map {}",
                        argument(&entry.canonical, entry.factor, whole)
                    )
                }
                None => String::new(),
            },
        }
    }

    fn other_dimension(&self, entry: &Entry, unit: Unit) -> RecordError {
        let what = format!(
            "--map {}={}: the column is in {}, which is not a unit of {}",
            entry.canonical, entry.column, unit.symbol, entry.canonical
        );
        RecordError::Columns {
            file: self.place(),
            problems: what,
            advice: format!(
                "map another column, or type --map '{}=GAIN*{}' with the scale GAIN per {}",
                entry.canonical,
                entry.column.replace('\'', r"'\''"),
                unit.symbol
            ),
            options: String::new(),
            columns: self.file.heads.len() + self.file.texts.len(),
        }
    }

    fn place(&self) -> String {
        self.file.header.map_or_else(|| self.file.name.to_owned(), |place| format!("{}, {place}", self.file.name))
    }

    /// Returns what is missing if the file has fewer free columns than roles without a column.
    fn too_few(&self, open: &[(Role, Option<usize>)], taken: &[usize]) -> Option<String> {
        let count = self.file.heads.len();
        let free = count.saturating_sub(taken.len());
        // --rate can replace a time column.
        let needed = open.iter().filter(|(role, _)| *role != Role::Time).count();
        if free >= needed {
            return None;
        }
        let columns = if count == 1 { "1 column".to_owned() } else { format!("{count} columns") };
        let words: Vec<&str> = open.iter().map(|(role, _)| role.word()).collect();
        let time = if words.contains(&Role::Time.word()) { " (--rate HZ replaces a time column)" } else { "" };
        let alone = if free == 1 && taken.is_empty() {
            let example = argument(Role::Output.example(), None, self.name(0));
            format!("; for a reference (an output only) type --map {example} --rate HZ")
        } else {
            String::new()
        };
        Some(format!("the file has {columns}; a record also needs: {}{time}{alone}", words.join(", ")))
    }

    /// Makes one message of all problems, with complete `--map` options.
    fn refuse(&self, problems: Problems, map: &ColumnMap, taken: &[usize]) -> RecordError {
        // A column with a unit would have been found already.
        let is_free = |at: &usize| {
            self.is_unstated(*at) && !taken.contains(at) && !problems.open.iter().any(|(_, guess)| *guess == Some(*at))
        };
        let mut free: Vec<usize> = self.columns().filter(is_free).collect();
        // Prefer a column whose path has a word of the role, otherwise the next free column.
        let mut next = |role: Role| {
            let fits = |at: &usize| !self.is_counter(role, *at);
            let place = free.iter().position(|at| fits(at) && self.path_suggests(role, *at));
            let place = place.or_else(|| free.iter().position(fits))?;
            Some(free.remove(place))
        };
        let mut open: Vec<(Role, Option<usize>)> = problems.open.clone();
        open.sort_by_key(|(role, _)| *role != Role::Time);
        // A sensor signal is often recorded as a voltage with an unknown scale.
        let driven: Vec<usize> = open
            .iter()
            .filter_map(|(role, guess)| guess.filter(|_| *role == Role::Input))
            .chain(taken.iter().copied())
            .collect();
        let volts = |at: &usize| self.headings[*at].unit.is_some_and(|unit| unit.dimension == Dimension::Voltage);
        let sensor = self.columns().filter(volts).find(|at| !driven.contains(at));
        let sensor = sensor.filter(|_| open.iter().any(|(role, guess)| *role == Role::Output && guess.is_none()));
        let mut list = problems.list;
        list.extend(
            sensor.map(|at| format!("{} may be the sensor: replace GAIN by its scale in µm/V", self.quoted(at))),
        );
        let arguments = open.iter().map(|(role, guess)| {
            if let (Role::Output, None, Some(at)) = (role, guess, sensor) {
                return format!("--map '{}=GAIN*{}'", role.example(), self.name(at).replace('\'', r"'\''"));
            }
            let known = |at: &usize| self.headings[*at].unknown.is_none();
            let column = guess.filter(known).or_else(|| next(*role));
            let canonical =
                column.and_then(|at| self.headings[at].unit).map_or(role.example(), |unit| unit.canonical(*role));
            // The unit may have a dimension that does not fit the role.
            let canonical = if Role::of_column(canonical) == Some(*role) { canonical } else { role.example() };
            format!(
                "--map {}",
                column.map_or_else(|| format!("{canonical}=COLUMN"), |at| argument(canonical, None, self.name(at)))
            )
        });
        let own = map.entries.iter().map(|e| format!("--map {}", argument(&e.canonical, e.factor, &e.column)));
        let line = own.chain(arguments).collect::<Vec<_>>().join(" ");
        if let Some(short) = self.too_few(&open, taken) {
            return RecordError::Columns {
                file: self.place(),
                problems: format!("{}; {short}", list.join("; ")),
                advice: format!("columns found: {}; put all columns into one file", self.listed()),
                options: String::new(),
                columns: self.file.heads.len() + self.file.texts.len(),
            };
        }
        let no_time = open.iter().any(|(role, guess)| *role == Role::Time && guess.is_none());
        let rate = if no_time { "; if the file has no times, give the sample rate with --rate HZ" } else { "" };
        RecordError::Columns {
            file: self.place(),
            problems: list.join("; "),
            advice: format!("columns found: {}{rate}", self.listed()),
            options: line,
            columns: self.file.heads.len() + self.file.texts.len(),
        }
    }
}

/// Returns whether values in `unit` can have `role`.
fn has(role: Role, unit: Unit) -> bool {
    match role {
        Role::Segment => false,
        Role::Time => unit.dimension == Dimension::Time,
        Role::Input => unit.dimension == Dimension::Voltage,
        Role::Output => matches!(unit.dimension, Dimension::Length | Dimension::Force),
        Role::Temperature => unit.dimension == Dimension::Temperature,
        Role::Load => unit.dimension == Dimension::Force,
    }
}

/// Returns a name in quotation marks, shortened.
fn quoted(name: &str) -> String {
    let short: String = name.chars().take(MAX_CHARACTERS).map(|c| if c.is_control() { ' ' } else { c }).collect();
    let more = if name.chars().nth(MAX_CHARACTERS).is_some() { "…" } else { "" };
    format!("\"{short}{more}\"")
}

/// Returns the right side of a `--map` option, quoted for a shell.
fn argument(canonical: &str, factor: Option<f64>, column: &str) -> String {
    let short: String = column.chars().take(4 * MAX_CHARACTERS).collect();
    let column = short.as_str();
    let factor = match factor {
        Some(-1.0) => "-".to_owned(),
        Some(factor) => format!("{factor}*"),
        None => String::new(),
    };
    let text = format!("{canonical}={factor}{column}");
    let plain = |c: char| c.is_ascii_alphanumeric() || "_-=/.,:@%+".contains(c);
    if text.chars().all(plain) { text } else { format!("'{}'", text.replace('\'', r"'\''")) }
}

const TIME: &[&str] = &["time", "t", "zeit", "timestamp", "clock", "temps"];
const INPUT: &[&str] = &[
    "voltage",
    "volt",
    "volts",
    "u",
    "v",
    "vin",
    "uin",
    "input",
    "drive",
    "command",
    "excitation",
    "ao",
    "ao0",
    "spannung",
    "actuation",
    "hv",
    "piezo",
    "amplifier",
];
const OUTPUT: &[&str] = &[
    "displacement",
    "disp",
    "position",
    "pos",
    "force",
    "weg",
    "stroke",
    "elongation",
    "extension",
    "sensor",
    "measured",
    "y",
    "z",
    "x",
    "auslenkung",
    "output",
];
const TEMPERATURE: &[&str] = &["temperature", "temp", "temperatur"];
const LOAD: &[&str] = &["load", "preload", "external"];
/// Words of a commanded position.
const COMMANDED: &[&str] = &[
    "target",
    "commanded",
    "command",
    "setpoint",
    "set",
    "reference",
    "desired",
    "wanted",
    "soll",
    "error",
    "cmd",
    "ref",
];
/// Words of a measured voltage.
const SENSOR: &[&str] = &[
    "sensor",
    "monitor",
    "mon",
    "measured",
    "feedback",
    "output",
    "out",
    "gauge",
    "adc",
    "ai",
    "cell",
    "capacitive",
    "strain",
];
/// Units of temperature or load that are not supported.
const UNKNOWN_UNITS: &[&str] = &["kg", "g", "lbf"];

/// Words of a voltage that is a sensor signal, not the input.
const NOT_INPUT: &[&str] = &["sensor", "gauge", "strain", "capacitive", "lvdt", "interferometer"];
/// Words of a position that is a reference, not a measured output.
const NOT_OUTPUT: &[&str] = &["target", "commanded", "setpoint", "desired", "wanted", "soll"];

/// Returns what a column is instead, if its words contradict `role`.
fn contrary(role: Role) -> &'static str {
    if role == Role::Input { "a sensor signal" } else { "a reference, not a measured output" }
}

fn words_of(role: Role) -> &'static [&'static str] {
    match role {
        Role::Segment => &["segment", "segments"],
        Role::Time => TIME,
        Role::Input => INPUT,
        Role::Output => OUTPUT,
        Role::Temperature => TEMPERATURE,
        Role::Load => LOAD,
    }
}

impl Unit {
    /// Returns the unit of a column name of the record format.
    pub(crate) fn of_canonical(name: &str) -> Option<Self> {
        let is_own = matches!(Role::of_column(name)?, Role::Time | Role::Output | Role::Temperature | Role::Load)
            || name == "voltage_v";
        match name.rsplit_once("_in_") {
            Some((_, unit)) => Self::parse_suffix(unit),
            None => is_own.then(|| name.rsplit_once('_')).flatten().and_then(|(_, unit)| Self::parse_suffix(unit)),
        }
    }

    /// Returns the column name of the record format for values of this unit with `role`. It has the same unit if the
    /// format supports it.
    fn canonical(self, role: Role) -> &'static str {
        match (role, self.dimension) {
            (Role::Time, _) => match self.symbol {
                "ms" => TimeUnit::Millisecond,
                "µs" => TimeUnit::Microsecond,
                _ => TimeUnit::Second,
            }
            .column(),
            (Role::Load, _) => "load_n",
            (_, Dimension::Force) => OutputUnit::Newton.column(),
            (Role::Output, _) => match self.symbol {
                "nm" => OutputUnit::Nanometre,
                "mm" => OutputUnit::Millimetre,
                _ => OutputUnit::Micrometre,
            }
            .column(),
            (Role::Temperature, _) => "temperature_degc",
            (Role::Segment, _) => "segment",
            (Role::Input, _) => "voltage_v",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn layout(names: &[&str], map: &[&str], need: Need) -> Result<Layout, String> {
        let heads: Vec<Head> = names.iter().map(|name| Head::new(*name)).collect();
        let file = File { name: "x.csv", header: Some(Place::Line(1)), heads: &heads, texts: &[], counters: &[] };
        Layout::resolve(&file, &ColumnMap::parse(map).unwrap(), need, None).map_err(|error| error.to_string())
    }

    fn train(names: &[&str]) -> Result<Layout, String> {
        layout(names, &[], Need::InputAndOutput)
    }

    fn of(choice: &Option<Choice>) -> (usize, &str, Option<&str>) {
        let choice = choice.as_ref().unwrap();
        (choice.column, &choice.canonical, choice.unit.map(|unit| unit.symbol))
    }

    #[test]
    fn columns_are_found_by_headings_with_units() {
        let found = train(&["Time (ms)", "Voltage [mV]", "Position, nm", "T (K)"]).unwrap();
        assert_eq!(found.time, Clock::Column { column: 0, per_second: 1e3 });
        assert_eq!(of(&found.input), (1, "voltage_v", Some("mV")));
        assert_eq!(of(&found.output), (2, "displacement_nm", None));
        assert_eq!(of(&found.temperature), (3, "temperature_degc", Some("K")));
        assert!(found.notes[1].contains("from mV to V"), "{:?}", found.notes);
    }

    #[test]
    fn words_decide_between_columns_with_the_same_unit() {
        let found = train(&["Time (s)", "Monitor (V)", "Drive (V)", "Target position (µm)", "Position (µm)"]).unwrap();
        assert_eq!(of(&found.input), (2, "voltage_v", None));
        assert_eq!(of(&found.output).0, 4);
        let message = train(&["Time (s)", "CH1 (V)", "CH2 (V)", "Position (µm)"]).unwrap_err();
        assert!(message.contains("\"CH1 (V)\", \"CH2 (V)\" each could be the input"), "{message}");
        assert!(message.contains("--map 'voltage_v=CH1 (V)'"), "{message}");
    }

    #[test]
    fn one_message_asks_for_all_units_that_are_not_stated() {
        let message = train(&["t", "V", "x"]).unwrap_err();
        assert!(message.contains("--map time_s=t --map voltage_v=V --map displacement_um=x"), "{message}");
        let message = train(&["1", "2", "3"]).unwrap_err();
        assert!(message.contains("--map time_s=1 --map voltage_v=2 --map displacement_um=3"), "{message}");
        assert!(message.contains("--rate"), "{message}");
        let found =
            layout(&["t", "V", "x"], &["time_s=1", "voltage_v=V", "displacement_um=-3"], Need::InputAndOutput).unwrap();
        assert_eq!(of(&found.output), (2, "displacement_um", None));
    }

    #[test]
    fn the_words_of_a_path_suggest_the_role() {
        let message = train(&["voltage.Time", "voltage.Data", "displacement.Data"]).unwrap_err();
        let map = "--map time_s=voltage.Time --map voltage_v=voltage.Data --map displacement_um=displacement.Data";
        assert!(message.contains(map), "{message}");
        assert!(message.contains("\"voltage.Data\" may be the input"), "{message}");
    }

    #[test]
    fn a_map_converts_and_refuses_another_dimension() {
        let names = ["time_s", "Vin [mV]", "displacement_um", "displacement_nm"];
        let found =
            layout(&names, &["voltage_v=Vin [mV]", "displacement_um=displacement_nm"], Need::InputAndOutput).unwrap();
        assert_eq!(of(&found.input), (1, "voltage_v", Some("mV")));
        assert_eq!(of(&found.output), (3, "displacement_um", Some("nm")));
        let message = layout(&names, &["displacement_um=Vin [mV]"], Need::InputAndOutput).unwrap_err();
        assert!(message.contains("is in mV"), "{message}");
    }

    #[test]
    fn messages_have_a_limited_length() {
        let names: Vec<String> = (0..100_000).map(|k| format!("channel{k}{}", "x".repeat(100))).collect();
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let message = train(&names).unwrap_err();
        assert!(message.len() < 2000 && message.contains("and 99988 more"), "{message}");
    }
}
