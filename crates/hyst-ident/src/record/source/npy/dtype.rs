//! Types of NumPy arrays: the fields of an element.

use super::literal::Literal;

/// Largest number of fields of an element. Structured arrays have up to a few hundred.
const MAX_FIELDS: usize = 4096;
/// Largest size of all names of fields \[bytes\]. A short header can repeat a long name.
const MAX_LETTERS: usize = 1 << 20;
/// Deepest nesting of structured types.
const MAX_DEPTH: usize = 16;

/// The type of a field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Kind {
    Float,
    Signed,
    Unsigned,
    Bool,
    /// A date and time, or a duration.
    Time {
        is_date: bool,
        tick: Tick,
    },
    /// Text with one byte per character.
    Bytes,
    /// Text with four bytes per character.
    Text,
    /// Pickled Python objects.
    Objects,
    /// Padding bytes of a structured type.
    Filler,
    /// A type that is not supported, in words.
    Other(&'static str),
}

/// The unit of times, as a fraction of a second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Tick {
    pub(crate) numerator: i128,
    pub(crate) denominator: i128,
}

/// A field of an element, or the whole element of a plain array.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Field {
    /// The name, such as `position`, `stage.position` or `force[2]`; empty for the whole element.
    pub(crate) name: String,
    pub(crate) kind: Kind,
    pub(crate) size: usize,
    pub(crate) big_endian: bool,
    pub(crate) offset: usize,
}

/// Returns the fields of an element, and its size \[bytes\].
pub(crate) fn fields(description: &Literal) -> Result<(Vec<Field>, usize), String> {
    let mut fields = Fields { list: Vec::new(), offset: 0, steps: 0, letters: 0 };
    fields.add(description, "", MAX_DEPTH)?;
    Ok((fields.list, fields.offset))
}

struct Fields {
    list: Vec<Field>,
    offset: usize,
    /// Number of types so far. It limits nested types without fields.
    steps: usize,
    /// Size of all names so far \[bytes\].
    letters: usize,
}

impl Fields {
    fn add(&mut self, description: &Literal, name: &str, depth: usize) -> Result<(), String> {
        let depth = depth.checked_sub(1).ok_or("structured types are nested too deeply; save plain arrays")?;
        (self.steps, self.letters) = (self.steps + 1, self.letters + name.len());
        if self.steps > MAX_FIELDS || self.letters > MAX_LETTERS {
            return Err(format!("an element has more than {MAX_FIELDS} fields; save each column as a separate array"));
        }
        match description {
            Literal::Text(text) => self.add_plain(text, name),
            Literal::List(records) => records.iter().try_for_each(|record| self.add_record(record, name, depth)),
            _ => Err(unknown(name)),
        }
    }

    fn add_plain(&mut self, text: &str, name: &str) -> Result<(), String> {
        let (kind, size, big_endian) = plain(text).ok_or_else(|| unknown(name))?;
        self.list.push(Field { name: name.to_owned(), kind, size, big_endian, offset: self.offset });
        self.offset = self.offset.checked_add(size).ok_or_else(|| unknown(name))?;
        Ok(())
    }

    /// Adds a field of a structured type: a name or a pair of title and name, a type, and optionally a shape.
    fn add_record(&mut self, record: &Literal, parent: &str, depth: usize) -> Result<(), String> {
        let parts = record.list().unwrap_or(&[]);
        let name = match parts.first() {
            Some(Literal::Text(name)) => Some(name.as_str()),
            Some(Literal::List(titled)) => titled.last().and_then(Literal::text),
            _ => None,
        };
        let (Some(name), Some(description)) = (name, parts.get(1)) else { return Err(unknown(parent)) };
        let name = if parent.is_empty() { name.to_owned() } else { format!("{parent}.{name}") };
        let count = match parts.get(2) {
            None => return self.add(description, &name, depth),
            Some(Literal::List(shape)) => {
                shape.iter().try_fold(1_usize, |count, length| count.checked_mul(length.integer()?))
            }
            Some(length) => length.integer(),
        };
        let count = count.filter(|count| *count <= MAX_FIELDS);
        let count = count.ok_or_else(|| {
            format!("the field \"{name}\" has more than {MAX_FIELDS} numbers; save it as a separate array")
        })?;
        (1..=count).try_for_each(|at| self.add(description, &format!("{name}[{at}]"), depth))
    }
}

fn unknown(name: &str) -> String {
    let of = if name.is_empty() { String::new() } else { format!(" of \"{name}\"") };
    format!("the type{of} is not known; save numbers of type float64")
}

/// Returns kind, size and byte order of a type such as `<f8`.
fn plain(text: &str) -> Option<(Kind, usize, bool)> {
    let rest = text.trim_start_matches(['<', '>', '|', '=']);
    let letter = rest.chars().next()?;
    let digits = rest[letter.len_utf8()..].split('[').next()?;
    let size: usize = if digits.is_empty() && letter == 'O' { 8 } else { digits.parse().ok()? };
    let kind = match (letter, size) {
        ('f', 2 | 4 | 8) => Kind::Float,
        ('f', _) => Kind::Other("floating-point numbers of more than 8 bytes"),
        ('i', 1 | 2 | 4 | 8) => Kind::Signed,
        ('u', 1 | 2 | 4 | 8) => Kind::Unsigned,
        ('b', 1) => Kind::Bool,
        ('M' | 'm', 8) => tick(rest).map_or(Kind::Other("times without a unit of fixed length"), |tick| Kind::Time {
            is_date: letter == 'M',
            tick,
        }),
        ('S' | 'a', _) => Kind::Bytes,
        ('U', _) => return Some((Kind::Text, size.checked_mul(4)?, text.starts_with('>'))),
        ('O', _) => Kind::Objects,
        ('V', _) => Kind::Filler,
        ('c', _) => Kind::Other("complex numbers"),
        _ => return None,
    };
    Some((kind, size, text.starts_with('>')))
}

/// Returns the unit of a time type such as `M8[25us]`; `None` for months and years, whose length is not fixed.
fn tick(text: &str) -> Option<Tick> {
    let inside = text.split_once('[')?.1.strip_suffix(']')?;
    let letters = inside.trim_start_matches(|c: char| c.is_ascii_digit());
    let digits = &inside[..inside.len() - letters.len()];
    let count: u32 = if digits.is_empty() { 1 } else { digits.parse().ok()? };
    let (numerator, denominator) = match letters {
        "W" => (604_800, 1),
        "D" => (86_400, 1),
        "h" => (3600, 1),
        "m" => (60, 1),
        "s" => (1, 1),
        "ms" => (1, 1_000),
        "us" | "μs" => (1, 1_000_000),
        "ns" => (1, 1_000_000_000),
        "ps" => (1, 1_000_000_000_000),
        "fs" => (1, 1_000_000_000_000_000),
        "as" => (1, 1_000_000_000_000_000_000),
        _ => return None,
    };
    Some(Tick { numerator: numerator * i128::from(count), denominator })
}
