//! Message definitions of ROS 2 (`ros2msg`).

use std::collections::HashMap;

use super::stated_unit::stated_unit;

/// Largest number of parts of a definition that are searched for units. It may refer to others many times.
const MAX_PARTS: usize = 10_000;
/// Deepest nesting of fields that are searched for units.
const MAX_DEPTH: usize = 16;

/// A number in a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Number {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    I64,
    U64,
    F32,
    F64,
}

impl Number {
    fn parse(name: &str) -> Option<Self> {
        Some(match name {
            "bool" | "byte" | "char" | "uint8" => Self::U8,
            "int8" => Self::I8,
            "int16" => Self::I16,
            "uint16" => Self::U16,
            "int32" => Self::I32,
            "uint32" => Self::U32,
            "int64" => Self::I64,
            "uint64" => Self::U64,
            "float32" => Self::F32,
            "float64" => Self::F64,
            _ => return None,
        })
    }

    /// Returns the size \[bytes\].
    pub(crate) fn size(self) -> usize {
        match self {
            Self::I8 | Self::U8 => 1,
            Self::I16 | Self::U16 => 2,
            Self::I32 | Self::U32 | Self::F32 => 4,
            Self::I64 | Self::U64 | Self::F64 => 8,
        }
    }
}

/// The type of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    Number(Number),
    Text,
    /// The fields of the definition with this number.
    Fields(usize),
}

/// The number of values of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Count {
    One,
    Fixed(usize),
    /// The message states the number.
    Counted,
}

/// A field of a definition.
#[derive(Clone, Debug)]
pub(crate) struct Field {
    pub(crate) name: String,
    pub(crate) kind: Kind,
    pub(crate) count: Count,
    unit: Option<String>,
}

/// The definition of a message (the first) and those that it refers to.
#[derive(Clone, Debug)]
pub(crate) struct Definitions {
    pub(crate) all: Vec<Vec<Field>>,
}

/// Definitions that a schema may omit.
const BUILT_IN: &str = "MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n===\n\
                        MSG: builtin_interfaces/Duration\nint32 sec\nuint32 nanosec\n";

impl Definitions {
    /// Parses a schema. `name` is the name of the message type, such as `sensor_msgs/msg/Temperature`.
    ///
    /// # Errors
    /// If a line is not a field, or a definition is missing.
    pub(crate) fn parse(name: &str, schema: &[u8]) -> Result<Self, String> {
        let text = String::from_utf8_lossy(schema);
        let sections = sections(name, &text).into_iter().chain(sections("", BUILT_IN).into_iter().skip(1));
        let sections: Vec<Section<'_>> = sections.collect();
        let mut numbers = HashMap::new();
        for (number, section) in sections.iter().enumerate() {
            numbers.entry(section.name.as_str()).or_insert(number);
        }
        let fields = |section: &Section<'_>| {
            let package = section.name.rsplit_once('/').map_or("", |(package, _)| package);
            section.lines.iter().filter_map(|line| field(line, package, &numbers).transpose()).collect()
        };
        let all: Result<_, String> = sections.iter().map(fields).collect();
        Ok(Self { all: all? })
    }

    /// Returns the units in comments after fields, by path, with `[]` for an index.
    pub(crate) fn units(&self) -> HashMap<String, String> {
        let (mut units, mut parts) = (HashMap::new(), 0);
        let mut open = vec![(0, String::new(), 0)];
        while let Some((number, path, depth)) = open.pop() {
            for field in &self.all[number] {
                parts += 1;
                if parts > MAX_PARTS {
                    return units;
                }
                let index = if field.count == Count::One { "" } else { "[]" };
                let path = format!("{path}.{}{index}", field.name);
                match (field.kind, &field.unit) {
                    (Kind::Fields(number), _) if depth < MAX_DEPTH => open.push((number, path, depth + 1)),
                    (Kind::Number(_), Some(unit)) => drop(units.insert(path, unit.clone())),
                    _ => {}
                }
            }
        }
        units
    }
}

/// The lines of a definition.
struct Section<'a> {
    /// The name, such as `package/Type`.
    name: String,
    lines: Vec<&'a str>,
}

/// Returns the definitions of a schema. Lines of `=` separate them.
fn sections<'a>(name: &str, text: &'a str) -> Vec<Section<'a>> {
    let mut sections = vec![Section { name: without_msg(name), lines: Vec::new() }];
    for line in text.lines().map(str::trim) {
        if let Some(name) = line.strip_prefix("MSG:") {
            sections.push(Section { name: without_msg(name.trim()), lines: Vec::new() });
        } else if !line.is_empty()
            && !line.starts_with(['#', '='])
            && let Some(section) = sections.last_mut()
        {
            section.lines.push(line);
        }
    }
    sections
}

/// Converts `package/msg/Type` to `package/Type`.
fn without_msg(name: &str) -> String {
    name.replacen("/msg/", "/", 1)
}

/// Parses the field of a line; `None` for a constant.
fn field(line: &str, package: &str, numbers: &HashMap<&str, usize>) -> Result<Option<Field>, String> {
    let bad = || format!("its schema has a line that is not a field: {:?}", super::words::shortened(line));
    let (line, comment) = split_comment(line);
    let (kind, rest) = line.split_once(char::is_whitespace).ok_or_else(bad)?;
    let rest = rest.trim_start();
    let end = rest.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(rest.len());
    let (name, rest) = rest.split_at(end);
    if name.is_empty() {
        return Err(bad());
    }
    if rest.trim_start().starts_with('=') {
        return Ok(None);
    }
    let (kind, count) = match kind.split_once('[') {
        None => (kind, Count::One),
        Some((kind, bound)) => match bound.strip_suffix(']').ok_or_else(bad)? {
            bound if bound.is_empty() || bound.starts_with("<=") => (kind, Count::Counted),
            bound => (kind, Count::Fixed(bound.parse().ok().filter(|count| *count > 0).ok_or_else(bad)?)),
        },
    };
    let kind = kind.split_once("<=").map_or(kind, |(kind, _)| kind);
    let kind = match (kind, Number::parse(kind)) {
        (_, Some(number)) => Kind::Number(number),
        ("string", _) => Kind::Text,
        ("wstring", _) => {
            return Err(format!(
                "its field {name:?} is a wstring, which is not supported because its size depends on the sender"
            ));
        }
        _ => {
            let (whole, own) = (without_msg(kind), format!("{package}/{kind}"));
            let header = Some("std_msgs/Header").filter(|_| kind == "Header");
            let names = [Some(whole.as_str()), Some(own.as_str()), header];
            let number = names.into_iter().flatten().find_map(|name| numbers.get(name));
            Kind::Fields(
                *number.ok_or_else(|| format!("its schema does not define {:?}", super::words::shortened(kind)))?,
            )
        }
    };
    Ok(Some(Field { name: name.to_owned(), kind, count, unit: comment.and_then(stated_unit) }))
}

/// Splits a line into the part before a comment and the comment. A `#` in quotes does not begin a comment.
fn split_comment(line: &str) -> (&str, Option<&str>) {
    let mut quote = None;
    for (at, c) in line.char_indices() {
        match (quote, c) {
            (None, '#') => return (line[..at].trim_end(), Some(line[at + 1..].trim_start_matches('#'))),
            (None, '"' | '\'') => quote = Some(c),
            (Some(open), _) if open == c => quote = None,
            _ => {}
        }
    }
    (line, None)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn definitions_are_parsed() {
        let text = "# A sample.\nstd_msgs/Header header\nfloat64 voltage 1.5 # V\nint32 A=1\nstring NOTE = \"a # b\"\n\
                    string<=10 word \"a#b\" # none\nfloat32[3] position  # position in nm\nPoint[<=4] points\nbyte[] raw\n\
                    ====\nMSG: lab/Point\nfloat64 x # [m]\n====\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n";
        let parsed = Definitions::parse("lab/msg/Sample", text.as_bytes()).unwrap();
        let of: Vec<(&str, Kind, Count)> = parsed.all[0].iter().map(|f| (f.name.as_str(), f.kind, f.count)).collect();
        let expected = [
            ("header", Kind::Fields(2), Count::One),
            ("voltage", Kind::Number(Number::F64), Count::One),
            ("word", Kind::Text, Count::One),
            ("position", Kind::Number(Number::F32), Count::Fixed(3)),
            ("points", Kind::Fields(1), Count::Counted),
            ("raw", Kind::Number(Number::U8), Count::Counted),
        ];
        assert_eq!(of, expected);
        let units = parsed.units();
        let unit = |path| units.get(path).map(String::as_str);
        assert_eq!(
            [".voltage", ".position[]", ".points[].x", ".raw[]"].map(unit),
            [Some("V"), Some("nm"), Some("m"), None]
        );
        let of = |text: &str| Definitions::parse("lab/msg/Sample", text.as_bytes()).unwrap_err();
        assert_eq!(of("lab/Other x"), "its schema does not define \"lab/Other\"");
        assert!(of("float64[0] x").contains("not a field"));
        assert!(of("float64").contains("not a field"));
    }

    #[test]
    fn a_definition_that_refers_to_itself_does_not_loop_forever() {
        let text = "Sample[] a\nSample[] b\nfloat64 x # V\n";
        assert!(Definitions::parse("lab/msg/Sample", text.as_bytes()).unwrap().units().len() <= MAX_PARTS);
    }
}
