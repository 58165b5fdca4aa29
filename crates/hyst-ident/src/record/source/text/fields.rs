//! Fields of a line.

/// The separator of fields.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Delimiter {
    One(u8),
    /// Any number of blanks.
    Blanks,
}

/// Returns the fields of a line.
pub(super) fn fields(line: &str, delimiter: Delimiter) -> Vec<&str> {
    match delimiter {
        Delimiter::Blanks => line.split_whitespace().collect(),
        Delimiter::One(byte) => quoted_fields(line, byte),
    }
}

/// Returns the fields of a line. Delimiters within quotation marks do not separate fields.
fn quoted_fields(line: &str, delimiter: u8) -> Vec<&str> {
    let delimiter = char::from(delimiter);
    if !line.contains('"') {
        return line.split(delimiter).map(str::trim).collect();
    }
    let mut fields = Vec::new();
    let (mut start, mut quoted) = (0, false);
    for (at, c) in line.char_indices() {
        match c {
            '"' => quoted = !quoted,
            _ if c == delimiter && !quoted => {
                fields.push(&line[start..at]);
                start = at + 1;
            }
            _ => {}
        }
    }
    fields.push(&line[start..]);
    fields.into_iter().map(unquoted).collect()
}

fn unquoted(field: &str) -> &str {
    let field = field.trim();
    field.strip_prefix('"').and_then(|inner| inner.strip_suffix('"')).unwrap_or(field).trim()
}
