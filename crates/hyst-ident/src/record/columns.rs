//! The roles of columns, the `--map` arguments that assign them, and how a file is read.

use super::unit::{OutputUnit, TimeUnit};

/// The columns that a caller needs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Need {
    /// Time, input and output: a record to train or test on.
    InputAndOutput,
    /// Time and input; the output is read if the file has one: a record to simulate.
    Input,
    /// Time and output; an input column is copied without being read: a reference.
    Output,
    /// Time and input; no other column is read: a drive to play.
    Drive,
    /// Time and output, and the surroundings that a model uses; no other column is read: a reference of this model.
    Reference {
        /// Whether temperatures are read if the file has them.
        temperature: bool,
        /// Whether loads are read if the file has them.
        load: bool,
    },
}

/// Why a `--map` argument was refused.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum MapError {
    /// Not of the form `name=column`.
    #[error("--map \"{argument}\" does not have the form NAME=COLUMN; type for example --map voltage_v=Vin")]
    Malformed {
        /// The argument.
        argument: String,
    },
    /// The left side is not a column name of the record format.
    #[error(
        "--map \"{argument}\": \"{name}\" is not a column name of the record format; \
         the left side must be one of segment, {}, {}, {}, temperature_degc, load_n",
        Role::Time.accepted(), Role::Input.accepted(), Role::Output.accepted()
    )]
    UnknownName {
        /// The argument.
        argument: String,
        /// Its left side.
        name: String,
    },
    /// A sign or factor of a role that allows neither.
    #[error("--map \"{argument}\": {role} cannot have a sign or a factor; remove it")]
    Signless {
        /// The argument.
        argument: String,
        /// The role that it names.
        role: &'static str,
    },
    /// Two arguments give the same role to two columns.
    #[error("--map \"{first}\" and --map \"{second}\" both name {role}; keep one")]
    RoleTwice {
        /// The first argument.
        first: String,
        /// The second argument.
        second: String,
        /// The role that both name.
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

/// Assigns columns of a file to names of the record format (`--map voltage_v=Vin`).
///
/// A minus before the column (`--map displacement_um=-Sensor`) inverts the sign of an input, an output or a load. A
/// factor (`--map displacement_um=2.5*CH2`) converts the values of the column to the unit of the name; a unit in the
/// file is then ignored. A mapped role is read from the mapped column only: `--map displacement_um=displacement_um`
/// also selects one of two possible outputs. The default maps nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ColumnMap {
    pub(crate) entries: Vec<Entry>,
}

/// One `--map`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Entry {
    pub(crate) role: Role,
    /// The name in the record format.
    pub(crate) canonical: String,
    pub(crate) column: String,
    /// The factor from the values of the column to those of the role; −1 inverts the sign.
    pub(crate) factor: Option<f64>,
    /// The argument as the user typed it.
    argument: String,
}

impl ColumnMap {
    /// Parses arguments of the form `name=column`.
    ///
    /// # Errors
    /// If an argument is malformed, its left side is unknown, or two arguments contradict each other.
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
            let (column, factor) = factor_of(column);
            if name.is_empty() || column.is_empty() {
                return Err(malformed());
            }
            let Some(role) = Role::of_column(name) else {
                return Err(MapError::UnknownName { argument: argument.to_owned(), name: name.to_owned() });
            };
            if factor.is_some() && !matches!(role, Role::Input | Role::Output | Role::Load) {
                return Err(MapError::Signless { argument: argument.to_owned(), role: role.words() });
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
            entries.push(Entry { role, canonical, column: column.to_owned(), factor, argument });
        }
        Ok(Self { entries })
    }
}

/// How a file is read.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reading {
    /// The columns whose role or unit the headings do not state.
    pub map: ColumnMap,
    /// The sample rate of files without times \[Hz\]. If it is given, times in the file are ignored.
    pub rate: Option<f64>,
}

impl From<&ColumnMap> for Reading {
    fn from(map: &ColumnMap) -> Self {
        Self { map: map.clone(), rate: None }
    }
}

/// Splits the right side of a `--map` into column and factor: `-Sensor`, `2.5*CH2`.
fn factor_of(column: &str) -> (&str, Option<f64>) {
    let number = |text: &str| text.trim().parse::<f64>().ok().filter(|factor| factor.is_finite() && *factor != 0.0);
    if let Some((factor, rest)) = column.split_once('*').and_then(|(factor, rest)| Some((number(factor)?, rest))) {
        return (rest.trim(), Some(factor));
    }
    column.strip_prefix('-').map_or((column, None), |rest| (rest.trim(), Some(-1.0)))
}

/// The role of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    Segment,
    Time,
    Input,
    Output,
    Temperature,
    Load,
}

/// Returns whether `name` is a column name of an input: `voltage_v` or `<quantity>_in_<unit>`.
pub fn is_input_column(name: &str) -> bool {
    Role::of_column(name) == Some(Role::Input)
}

impl Role {
    /// Returns the role of a name of the record format. Inputs other than a voltage are named `<quantity>_in_<unit>`.
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

    /// Returns the role as one word.
    pub(crate) fn word(self) -> &'static str {
        self.words().trim_start_matches("the ")
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

    pub(crate) fn accepted(self) -> String {
        match self {
            Self::Segment => "segment".to_owned(),
            Self::Time => TimeUnit::ALL.map(TimeUnit::column).join("|"),
            Self::Input => "voltage_v (or QUANTITY_in_UNIT)".to_owned(),
            Self::Output => OutputUnit::ALL.map(OutputUnit::column).join("|"),
            Self::Temperature => "temperature_degc".to_owned(),
            Self::Load => "load_n".to_owned(),
        }
    }

    /// Returns an example of a column name with this role.
    pub(crate) fn example(self) -> &'static str {
        match self {
            Self::Segment => "segment",
            Self::Time => "time_s",
            Self::Input => "voltage_v",
            Self::Output => "displacement_um",
            Self::Temperature => "temperature_degc",
            Self::Load => "load_n",
        }
    }
}
