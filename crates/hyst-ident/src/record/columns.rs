//! Which column of a file plays which role.

use super::error::RecordError;
use super::unit::{OutputUnit, TimeUnit};

/// What a caller needs a record for, and hence which columns have to be there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// Time, input and output: a record to train or test on.
    InputAndOutput,
    /// Time and input; the output is read where there is one: a record to simulate.
    Input,
    /// Time and output; an input column is carried through unread: a reference to follow.
    Output,
}

/// Why a `--map` argument was refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MapError {
    /// Not of the form `name=column`.
    #[error("--map \"{argument}\" is not of the form NAME=COLUMN, as voltage_v=Vin")]
    Malformed {
        /// The argument.
        argument: String,
    },
    /// The left side is no name of the record format.
    #[error(
        "--map \"{argument}\": \"{name}\" is no column of the record format; the left side has to be one of segment, {}, {}, {}, temperature_degc, load_n",
        Role::Time.accepted(), Role::Input.accepted(), Role::Output.accepted()
    )]
    UnknownName {
        /// The argument.
        argument: String,
        /// Its left side.
        name: String,
    },
    /// A minus where a sign means nothing.
    #[error("--map \"{argument}\": {role} has no sign to turn; leave the minus out")]
    Signless {
        /// The argument.
        argument: String,
        /// What it names.
        role: &'static str,
    },
    /// Both sides are names of the record format, in different units.
    #[error(
        "--map \"{argument}\": a map only renames, and \"{column}\" is in another unit than \"{name}\"; it is read in its own with --map {column}={sign}{column}"
    )]
    OtherUnit {
        /// The argument.
        argument: String,
        /// Its left side.
        name: String,
        /// The minus of its right side, or nothing.
        sign: &'static str,
        /// Its right side, without a minus.
        column: String,
    },
    /// Two arguments give the same role to two columns.
    #[error("--map \"{first}\" and --map \"{second}\" both name {role}; keep one")]
    RoleTwice {
        /// The first argument.
        first: String,
        /// The second argument.
        second: String,
        /// What both name.
        role: &'static str,
    },
    /// Two arguments give two roles to the same column.
    #[error("--map \"{first}\" and --map \"{second}\" use the same column; keep one")]
    ColumnTwice {
        /// The first argument.
        first: String,
        /// The second argument.
        second: String,
    },
}

/// Which columns of a file stand for which names of the record format (`--map voltage_v=Vin`).
///
/// A minus before the column (`--map displacement_um=-Sensor`) turns the sign of an input, an output or a load. A mapped role is taken from the mapped column only, so that `--map displacement_um=displacement_um` also settles
/// which of two possible outputs is meant. The default maps nothing.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ColumnMap {
    entries: Vec<Entry>,
}

#[derive(Clone, Debug, PartialEq, Eq)]
struct Entry {
    role: Role,
    /// Name in the record format.
    canonical: String,
    column: String,
    /// Whether the column has the other sign.
    turned: bool,
    /// As it was given.
    argument: String,
}

impl ColumnMap {
    /// Reads arguments of the form `name=column`.
    ///
    /// # Errors
    /// When an argument is malformed, its left side is unknown, or two of them contradict each other.
    pub fn parse<I>(arguments: I) -> Result<Self, MapError>
    where
        I: IntoIterator,
        I::Item: AsRef<str>,
    {
        let mut entries: Vec<Entry> = Vec::new();
        for argument in arguments {
            let argument = argument.as_ref();
            let malformed = || MapError::Malformed { argument: argument.to_owned() };
            let (name, column) = argument.split_once('=').ok_or_else(malformed)?;
            let (name, column) = (name.trim(), column.trim());
            let (column, turned) = column.strip_prefix('-').map_or((column, false), |rest| (rest.trim(), true));
            if name.is_empty() || column.is_empty() {
                return Err(malformed());
            }
            let Some(role) = Role::of_column(name) else {
                return Err(MapError::UnknownName { argument: argument.to_owned(), name: name.to_owned() });
            };
            if turned && !matches!(role, Role::Input | Role::Output | Role::Load) {
                return Err(MapError::Signless { argument: argument.to_owned(), role: role.words() });
            }
            // A clock's unit is often named wrongly, and an odd rate shows it; of the others such a map asks for a conversion.
            if role != Role::Time && Role::of_column(column) == Some(role) && unit_of(column) != unit_of(name) {
                let (argument, name, column) = (argument.to_owned(), name.to_owned(), column.to_owned());
                return Err(MapError::OtherUnit { argument, name, sign: if turned { "-" } else { "" }, column });
            }
            for other in &entries {
                let (first, second) = (other.argument.clone(), argument.to_owned());
                if other.role == role {
                    return Err(MapError::RoleTwice { first, second, role: role.words() });
                }
                if other.column == column {
                    return Err(MapError::ColumnTwice { first, second });
                }
            }
            let (canonical, argument) = (name.to_owned(), argument.to_owned());
            entries.push(Entry { role, canonical, column: column.to_owned(), turned, argument });
        }
        Ok(Self { entries })
    }
}

/// The unit at the end of a column's name.
fn unit_of(name: &str) -> Option<&str> {
    name.split_once("_in_").or_else(|| name.rsplit_once('_')).map(|(_, unit)| unit)
}

/// What a column is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    Segment,
    Time,
    Input,
    Output,
    Temperature,
    Load,
}

/// Whether an input's column may have this name: `voltage_v`, or `<quantity>_in_<unit>`.
pub fn is_input_column(name: &str) -> bool {
    Role::of_column(name) == Some(Role::Input)
}

impl Role {
    /// The role that a name of the record format has. Inputs other than a voltage are named `<quantity>_in_<unit>`.
    pub(crate) fn of_column(name: &str) -> Option<Self> {
        match name {
            "segment" => Some(Self::Segment),
            "voltage_v" => Some(Self::Input),
            "temperature_degc" => Some(Self::Temperature),
            "load_n" => Some(Self::Load),
            _ if TimeUnit::of_column(name).is_some() => Some(Self::Time),
            _ if OutputUnit::of_column(name).is_some() => Some(Self::Output),
            _ if name.split_once("_in_").is_some_and(|(what, unit)| !what.is_empty() && !unit.is_empty()) => {
                Some(Self::Input)
            }
            _ => None,
        }
    }

    pub(crate) fn words(self) -> &'static str {
        match self {
            Self::Segment => "the segment",
            Self::Time => "the time",
            Self::Input => "the input",
            Self::Output => "the output",
            Self::Temperature => "the temperature",
            Self::Load => "the load",
        }
    }

    fn accepted(self) -> String {
        match self {
            Self::Segment => "segment".to_owned(),
            Self::Time => TimeUnit::ALL.map(TimeUnit::column).join("|"),
            Self::Input => "voltage_v (or QUANTITY_in_UNIT, as force_in_n)".to_owned(),
            Self::Output => OutputUnit::ALL.map(OutputUnit::column).join("|"),
            Self::Temperature => "temperature_degc".to_owned(),
            Self::Load => "load_n".to_owned(),
        }
    }

    fn example(self, lookalike: &str) -> &'static str {
        match self {
            Self::Segment => "segment",
            Self::Time => "time_s",
            Self::Input => "voltage_v",
            Self::Output if lookalike.starts_with(['f', 'F']) => "force_n",
            Self::Output => "displacement_um",
            Self::Temperature => "temperature_degc",
            Self::Load => "load_n",
        }
    }

    /// First words of names that suggest this role, and endings that make such a name a unit of it.
    fn suggestive(self) -> (&'static [&'static str], &'static [&'static str]) {
        match self {
            Self::Segment => (&["segment", "segments"], &[]),
            Self::Time => (&["time", "t", "timestamp"], &["ns", "min", "h", "sec", "ms", "us", "s"]),
            Self::Input => (&["voltage", "volt", "volts", "u", "v"], &["mv", "kv", "uv", "v", "volt", "volts"]),
            Self::Output => (
                &["displacement", "disp", "position", "force"],
                &["m", "cm", "pm", "um", "nm", "mm", "µm", "in", "mil", "mn", "kn", "un", "n", "lbf"],
            ),
            Self::Temperature => {
                (&["temperature", "temp"], &["c", "k", "f", "degf", "degk", "degc", "deg", "°c", "kelvin", "celsius"])
            }
            Self::Load => (&["load"], &["mn", "kn", "un", "n", "kg", "g", "lbf"]),
        }
    }

    /// Whether `name` looks like this role in a wrong unit or spelling. A column that has to be there may go by its
    /// first word alone; one that may be absent needs a unit too, since other columns are nobody's business.
    fn resembles(self, name: &str, required: bool) -> bool {
        let lower = name.to_lowercase();
        let mut words = lower.split(|c: char| !(c.is_alphanumeric() || c == '°')).filter(|word| !word.is_empty());
        let (firsts, units) = self.suggestive();
        if !words.next().is_some_and(|first| firsts.contains(&first)) {
            return false;
        }
        required
            || match words.next() {
                None => true,
                Some(unit) => units.contains(&unit) && words.next().is_none(),
            }
    }
}

/// The columns of a file by role; numbers count from 0.
#[derive(Debug)]
pub(crate) struct Layout {
    pub(crate) segment: Option<usize>,
    pub(crate) time: (usize, TimeUnit),
    pub(crate) input: Option<(usize, String)>,
    pub(crate) output: Option<(usize, OutputUnit)>,
    pub(crate) temperature: Option<usize>,
    pub(crate) load: Option<usize>,
    /// Columns that have the other sign.
    pub(crate) turned: Vec<usize>,
}

impl Layout {
    pub(crate) fn resolve(file: &str, names: &[String], map: &ColumnMap, need: Need) -> Result<Self, RecordError> {
        for (second, name) in names.iter().enumerate() {
            if let Some(first) = names[..second].iter().position(|other| other == name) {
                return Err(RecordError::DuplicateColumn {
                    file: file.to_owned(),
                    column: name.clone(),
                    first: first + 1,
                    second: second + 1,
                });
            }
        }
        let header = Header { file, names, mapped: header_map(file, names, map)? };
        let turned =
            header.mapped.iter().zip(&map.entries).filter(|(_, e)| e.turned).map(|((.., at), _)| *at).collect();
        let wants_output = matches!(need, Need::InputAndOutput | Need::Output);
        let time = header.required(Role::Time)?;
        let input = match need {
            Need::Output => None,
            Need::InputAndOutput | Need::Input => Some(header.required(Role::Input)?),
        };
        let output = if wants_output { Some(header.required(Role::Output)?) } else { header.optional(Role::Output)? };
        let index = |found: Option<(usize, &str)>| found.map(|(at, _)| at);
        Ok(Self {
            segment: index(header.optional(Role::Segment)?),
            time: (time.0, TimeUnit::of_column(time.1).unwrap_or(TimeUnit::Second)),
            input: input.map(|(at, name)| (at, name.to_owned())),
            output: output.and_then(|(at, name)| OutputUnit::of_column(name).map(|unit| (at, unit))),
            temperature: index(header.optional(Role::Temperature)?),
            load: index(header.optional(Role::Load)?),
            turned,
        })
    }
}

fn listed(names: &[String]) -> String {
    names.iter().map(|name| format!("\"{name}\"")).collect::<Vec<_>>().join(", ")
}

/// The map's entries as (role, name in the record format, column number).
fn header_map<'a>(
    file: &str,
    names: &[String],
    map: &'a ColumnMap,
) -> Result<Vec<(Role, &'a str, usize)>, RecordError> {
    let find = |e: &'a Entry| match names.iter().position(|n| *n == e.column) {
        Some(at) => Ok((e.role, e.canonical.as_str(), at)),
        None => Err(RecordError::MappedColumnMissing {
            file: file.to_owned(),
            canonical: e.canonical.clone(),
            column: e.column.clone(),
            found: listed(names),
            hint: match names.iter().find(|name| name.starts_with(&format!("{} ", e.column))) {
                Some(whole) => format!(
                    "; a name with spaces needs quotes: --map \"{}={}{whole}\"",
                    e.canonical,
                    if e.turned { "-" } else { "" }
                ),
                None => String::new(),
            },
        }),
    };
    map.entries.iter().map(find).collect()
}

struct Header<'a> {
    file: &'a str,
    names: &'a [String],
    mapped: Vec<(Role, &'a str, usize)>,
}

impl<'a> Header<'a> {
    /// The column with `role` and the record format's name for it.
    fn find(&self, role: Role) -> Result<Option<(usize, &'a str)>, RecordError> {
        if let Some((_, canonical, at)) = self.mapped.iter().find(|(mapped, ..)| *mapped == role) {
            return Ok(Some((*at, canonical)));
        }
        let free = |at: &usize| !self.mapped.iter().any(|(_, _, mapped)| mapped == at);
        let mut candidates =
            (0..self.names.len()).filter(free).filter(|at| Role::of_column(&self.names[*at]) == Some(role));
        let first = candidates.next();
        let second = candidates.next();
        drop(candidates);
        // A voltage is the input wherever there is one; other inputs count only in its absence.
        if role == Role::Input
            && let Some(at) = (0..self.names.len()).filter(free).find(|at| self.names[*at] == "voltage_v")
        {
            return Ok(Some((at, "voltage_v")));
        }
        match (first, second) {
            (Some(first), Some(second)) => Err(RecordError::AmbiguousColumn {
                file: self.file.to_owned(),
                role: role.words(),
                first: self.names[first].clone(),
                second: self.names[second].clone(),
                hint: match (role, self.names[second].as_str()) {
                    (Role::Output, "force_n") => {
                        "; if \"force_n\" is the load that acts on the actuator: --map load_n=force_n"
                    }
                    _ => "",
                },
            }),
            (first, _) => Ok(first.map(|at| (at, self.names[at].as_str()))),
        }
    }

    fn required(&self, role: Role) -> Result<(usize, &'a str), RecordError> {
        if let Some(found) = self.find(role)? {
            return Ok(found);
        }
        self.refuse_lookalike(role, true)?;
        Err(RecordError::MissingColumn {
            file: self.file.to_owned(),
            role: role.words(),
            accepted: role.accepted(),
            example: role.example(""),
            found: listed(self.names),
        })
    }

    fn optional(&self, role: Role) -> Result<Option<(usize, &'a str)>, RecordError> {
        let found = self.find(role)?;
        if found.is_none() {
            self.refuse_lookalike(role, false)?;
        }
        Ok(found)
    }

    fn refuse_lookalike(&self, role: Role, required: bool) -> Result<(), RecordError> {
        let free = |at: usize| !self.mapped.iter().any(|(_, _, mapped)| *mapped == at);
        let lookalike = self
            .names
            .iter()
            .enumerate()
            .find(|(at, name)| free(*at) && Role::of_column(name).is_none() && role.resembles(name, required));
        match lookalike {
            None => Ok(()),
            Some((_, name)) => Err(RecordError::WrongUnit {
                file: self.file.to_owned(),
                column: name.clone(),
                role: role.words(),
                accepted: role.accepted(),
                example: role.example(name),
            }),
        }
    }
}
