//! Messages about columns: notes, proposals of options, and reasons for a refusal.

use super::headings::Headings;
use super::layout::Choice;
use crate::record::columns::{ColumnMap, Entry, Role};
use crate::record::error::RecordError;
use crate::record::heading::{Dimension, Unit, leaf};

/// Maximum number of names in a message.
pub(super) const MAX_LISTED: usize = 12;
/// Scale of a sensor in an example \[µm/V\].
const EXAMPLE_SCALE: f64 = 2.0;
/// Maximum number of characters of a name in a message.
const MAX_CHARACTERS: usize = 48;

/// The problems of the columns of a file, and the roles without a column.
#[derive(Default)]
pub(super) struct Problems {
    pub(super) list: Vec<String>,
    /// Roles without a column, each with the most likely column.
    pub(super) open: Vec<(Role, Option<usize>)>,
}

impl Problems {
    pub(super) fn add(&mut self, role: Role, guess: Option<usize>, what: String) {
        self.list.push(what);
        self.open.push((role, guess));
    }
}

impl Headings<'_> {
    /// Returns the note of a column that is identified by its heading or has another unit.
    pub(super) fn reading(&self, choice: &Choice) -> Option<String> {
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
    pub(super) fn quoted(&self, column: usize) -> String {
        let unit = self.file.heads[column].unit.as_deref().map_or(String::new(), |unit| format!(" in {unit}"));
        format!("{}{unit}", quoted(self.name(column)))
    }

    pub(super) fn listed(&self) -> String {
        let names: Vec<String> = self.columns().take(MAX_LISTED).map(|at| self.quoted(at)).collect();
        let more = self.file.heads.len().saturating_sub(MAX_LISTED);
        let more = if more > 0 { format!(" and {more} more") } else { String::new() };
        format!("{}{more}", names.join(", "))
    }

    pub(super) fn not_there(&self, entry: &Entry) -> RecordError {
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

    pub(super) fn other_dimension(&self, entry: &Entry, unit: Unit) -> RecordError {
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

    /// Returns the unit of the scale of a sensor, with an example.
    fn scale(&self, at: usize) -> String {
        let volts = self.headings[at].unit.map_or("V", |unit| unit.symbol);
        format!(
            "µm/{volts}, for example --map {} for {EXAMPLE_SCALE} µm/{volts}",
            argument(Role::Output.example(), Some(EXAMPLE_SCALE), self.name(at))
        )
    }

    pub(super) fn place(&self) -> String {
        self.file.header.map_or_else(|| self.file.name.to_owned(), |place| format!("{}, {place}", self.file.name))
    }

    /// Returns what is missing if the file has fewer free columns than roles without a column.
    pub(super) fn too_few(&self, open: &[(Role, Option<usize>)], taken: &[usize]) -> Option<String> {
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
    pub(super) fn refuse(&self, problems: Problems, map: &ColumnMap, taken: &[usize]) -> RecordError {
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
        list.extend(sensor.map(|at| {
            format!("{} may be the sensor: replace GAIN by its scale in {}", self.quoted(at), self.scale(at))
        }));
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

/// Returns a name in quotation marks, shortened.
pub(super) fn quoted(name: &str) -> String {
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
