//! Texts of MATLAB, which are stored column by column.

/// Returns the lines of a text with these UTF-16 codes, which are stored column by column.
pub(crate) fn from_codes(codes: &[u16], rows: usize) -> Vec<String> {
    if rows <= 1 {
        return lines(
            char::decode_utf16(codes.iter().copied()).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect(),
            1,
        );
    }
    // Rows are separated before surrogate pairs are decoded.
    let row = |row: usize| codes.iter().skip(row).step_by(rows).copied().collect::<Vec<u16>>();
    (0..rows.min(codes.len())).map(|at| String::from_utf16_lossy(&row(at)).trim_end().to_owned()).collect()
}

/// Returns the lines of a text whose characters are stored column by column.
pub(super) fn lines(characters: Vec<char>, rows: usize) -> Vec<String> {
    if characters.is_empty() {
        return Vec::new();
    }
    if rows <= 1 {
        return vec![characters.into_iter().collect()];
    }
    let row = |row: usize| characters.iter().skip(row).step_by(rows).collect::<String>().trim_end().to_owned();
    (0..rows.min(characters.len())).map(row).collect()
}
