//! Lines of a text, remarks, and line numbers for messages.

/// A line, and the byte at which it begins.
pub(super) type Line<'a> = (usize, &'a str);

/// Returns the lines that are not blank.
pub(super) fn lines(text: &str, start: usize) -> impl Iterator<Item = Line<'_>> {
    let mut at = start;
    text[start..].split_inclusive('\n').filter_map(move |whole| {
        let begins = at;
        at += whole.len();
        let line = whole.trim_end_matches(['\n', '\r']);
        (!line.trim().is_empty()).then_some((begins, line))
    })
}

/// Returns a remark without its leading sign; `None` if the line is not a remark.
pub(super) fn remark(line: &str) -> Option<&str> {
    let line = line.trim_start();
    ["#", "%", "//", "!"]
        .iter()
        .find_map(|sign| line.strip_prefix(sign))
        .map(|rest| rest.trim_start_matches(['#', '%']))
}

/// Returns the number of the line with byte `at`. Only messages need it.
pub(super) fn line_at(text: &str, at: usize) -> u64 {
    1 + text.as_bytes()[..at.min(text.len())].iter().filter(|byte| **byte == b'\n').count() as u64
}

/// Returns a field for a message: one line of limited length.
pub(super) fn shortened(field: &str) -> String {
    const MAX_CHARACTERS: usize = 40;
    let field = field.trim();
    let text: String = field.chars().take(MAX_CHARACTERS).map(|c| if c.is_control() { ' ' } else { c }).collect();
    if field.chars().nth(MAX_CHARACTERS).is_some() { format!("{text}…") } else { text }
}
