//! Texts from the file in messages.

/// Largest number of topics in one note.
const MAX_NAMED: usize = 8;

/// Joins the first texts and counts the others.
pub(super) fn listed(texts: &[String]) -> String {
    let more = texts.len().saturating_sub(MAX_NAMED);
    let first = texts.iter().take(MAX_NAMED).map(|text| shortened(text)).collect::<Vec<_>>().join("; ");
    if more == 0 { first } else { format!("{first}; and {more} more") }
}

/// Shortens a text from the file for a message.
pub(super) fn shortened(text: &str) -> String {
    /// Largest number of characters.
    const MAX: usize = 200;
    if text.chars().count() <= MAX { text.to_owned() } else { text.chars().take(MAX).chain(['…']).collect() }
}
