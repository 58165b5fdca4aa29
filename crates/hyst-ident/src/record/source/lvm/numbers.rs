//! Numbers in the notation of LabVIEW.

/// The separator of cells and the decimal sign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Format {
    pub(crate) separator: char,
    pub(crate) decimal: char,
}

/// One day \[s\].
const DAY: i64 = 86_400;

/// Parses the number in a cell; NaN if the cell is empty or not a finite number.
pub(crate) fn number(cell: &str, decimal: char) -> Option<f64> {
    let cell = cell.trim();
    if cell.is_empty() {
        return Some(f64::NAN);
    }
    let parsed = if decimal == '.' { cell.parse::<f64>() } else { cell.replace(decimal, ".").parse::<f64>() };
    // An infinite number is not a measured value.
    parsed.ok().map(|number| if number.is_finite() { number } else { f64::NAN })
}

/// Returns the midnight before a time \[s since 1904\].
pub(crate) fn midnight(cell: &str, decimal: char) -> Option<i64> {
    let seconds = number(cell, decimal)?.floor();
    (seconds.abs() < 1e15).then_some((seconds as i64).div_euclid(DAY) * DAY)
}

/// Parses a number and subtracts `start`.
///
/// `start` is subtracted from the whole part, because a double does not resolve microseconds of seconds since 1904.
pub(crate) fn since(cell: &str, decimal: char, start: i64) -> Option<f64> {
    let number = number(cell, decimal)?;
    let (whole, fraction) = cell.trim().split_once(decimal).unwrap_or((cell.trim(), ""));
    let is_plain = fraction.bytes().all(|byte| byte.is_ascii_digit()) && !whole.starts_with('-');
    match whole.parse::<i64>() {
        Ok(whole) if start != 0 && is_plain => {
            let fraction: f64 = format!("0.{fraction}").parse().unwrap_or(0.0);
            Some((whole - start) as f64 + fraction)
        }
        _ => Some(number - start as f64),
    }
}
