//! Parsing of printed numbers, dates and times in one pass.

use crate::record::grid::Printed;

/// A cell of a table of text.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Cell {
    Number(f64),
    /// A number with a thousands separator: `1'250.5` or, with a decimal comma, `1.250,5`.
    Grouped(f64),
    /// An empty cell, or a word for a missing value such as `NaN`.
    Missing,
    /// A date, a time of day, or both.
    Time(Moment),
    Other,
}

/// A date and time, in two numbers, because one double does not resolve seconds since 1970 to much better than a
/// microsecond.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Moment {
    /// Whole seconds since 1970, or since midnight if there is no date.
    whole: i64,
    fraction: f64,
    /// Digits after the decimal point of the seconds.
    pub(super) decimals: i32,
    /// Whether it has a date.
    dated: bool,
    /// Whether it has a time of day.
    pub(super) timed: bool,
}

impl Moment {
    /// Returns the seconds since `start`.
    pub(super) fn since(self, start: i64) -> f64 {
        (self.whole - if self.dated { start } else { 0 }) as f64 + self.fraction
    }

    /// Returns the midnight before, in seconds since 1970.
    pub(super) fn midnight(self) -> i64 {
        self.whole.div_euclid(86_400) * 86_400
    }
}

/// Powers of ten that a double represents exactly.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
    1e21, 1e22,
];

/// A number at the beginning of some bytes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Scanned {
    pub(super) value: f64,
    /// The printed digits and decimals.
    pub(super) printed: Printed,
    /// The number of bytes read.
    pub(super) bytes: usize,
}

/// Parses a cell without surrounding blanks, rounded to the nearest double.
pub(super) fn number(cell: &[u8], decimal: u8) -> Option<f64> {
    scan(cell, decimal).filter(|scanned| scanned.bytes == cell.len()).map(|scanned| scanned.value)
}

/// Parses the number at the beginning of `bytes`, rounded to the nearest double.
pub(super) fn scan(bytes: &[u8], decimal: u8) -> Option<Scanned> {
    let (negative, signs) = match bytes.first()? {
        b'-' => (true, 1),
        b'+' => (false, 1),
        _ => (false, 0),
    };
    let digits = &bytes[signs..];
    let mut mantissa = 0_u64;
    let mut run = |from: usize| {
        let mut at = from;
        while let Some(digit) = digits.get(at).map(|byte| byte.wrapping_sub(b'0')).filter(|digit| *digit < 10) {
            mantissa = mantissa.wrapping_mul(10).wrapping_add(u64::from(digit));
            at += 1;
        }
        at
    };
    let before = run(0);
    let pointed = digits.get(before) == Some(&decimal);
    let at_point = before + usize::from(pointed);
    let mut at = if pointed { run(at_point) } else { before };
    // The length of a cell fits an `i32`.
    let after = i32::try_from(at - at_point).ok()?;
    let zeros = digits[..at].iter().take_while(|byte| matches!(byte, b'0') || **byte == decimal);
    let zeros = zeros.filter(|byte| **byte == b'0').count();
    let count = i32::try_from(at - usize::from(pointed) - zeros).ok()?;
    // At least one digit.
    if at == usize::from(pointed) {
        return None;
    }
    let mut exponent = -after;
    if let Some(b'e' | b'E' | b'd' | b'D') = digits.get(at) {
        let rest = &digits[at + 1..];
        let signs = usize::from(matches!(rest.first(), Some(b'-' | b'+')));
        let own = rest[signs..].iter().take_while(|byte| byte.is_ascii_digit()).count();
        let written = std::str::from_utf8(&rest[..signs + own]).ok()?;
        exponent += written.parse::<i32>().ok().filter(|e| e.abs() < 10_000)?;
        at += 1 + written.len();
    }
    // Both operands are exact, so the result is rounded once (Clinger 1990).
    let magnitude = if count <= 19 && mantissa <= 1 << 53 && exponent.unsigned_abs() <= 22 {
        let power = POWERS[exponent.unsigned_abs() as usize];
        if exponent < 0 { mantissa as f64 / power } else { mantissa as f64 * power }
    } else {
        let text: String = digits[..at]
            .iter()
            .map(|byte| match byte {
                b'd' | b'D' => 'e',
                byte if *byte == decimal => '.',
                byte => char::from(*byte),
            })
            .collect();
        text.parse().ok()?
    };
    let printed = Printed { digits: count, decimals: (-exponent).clamp(-300, 300) };
    Some(Scanned { value: if negative { -magnitude } else { magnitude }, printed, bytes: signs + at })
}

/// Classifies a cell without surrounding blanks.
pub(super) fn cell(cell: &[u8], decimal: u8) -> Cell {
    if let Some(number) = number(cell, decimal) {
        // A number that overflows is not a measured value.
        return if number.is_finite() { Cell::Number(number) } else { Cell::Missing };
    }
    if is_missing(cell) {
        return Cell::Missing;
    }
    let Ok(text) = std::str::from_utf8(cell) else { return Cell::Other };
    grouped(text, decimal).map(Cell::Grouped).or_else(|| date_time(text).map(Cell::Time)).unwrap_or(Cell::Other)
}

/// Parses a number with a thousands separator: the same separator throughout, groups of three digits, no leading zero.
fn grouped(text: &str, decimal: u8) -> Option<f64> {
    let unsigned = text.strip_prefix(['-', '+']).unwrap_or(text);
    let (whole, _) = unsigned.split_once(char::from(decimal)).unwrap_or((unsigned, ""));
    let between = whole.chars().find(|c| !c.is_ascii_digit())?;
    // Comma or point (whichever is not the decimal sign), apostrophe, or no-break space.
    let known = ['.', ',', '\'', '\u{2019}', '\u{a0}', '\u{2009}', '\u{202f}'];
    let mut groups = whole.split(between);
    let first = groups.next()?;
    let is_grouped = known.contains(&between)
        && (1..=3).contains(&first.len())
        && !first.starts_with('0')
        && groups.all(|group| group.len() == 3 && group.bytes().all(|byte| byte.is_ascii_digit()));
    let plain = || text.chars().filter(|c| *c != between).collect::<String>();
    is_grouped.then(|| number(plain().as_bytes(), decimal)).flatten().filter(|number| number.is_finite())
}

/// Returns whether a cell is empty or a word for a missing value.
fn is_missing(cell: &[u8]) -> bool {
    const WORDS: [&str; 23] = [
        "nan",
        "na",
        "n/a",
        "#n/a",
        "null",
        "none",
        "-nan",
        "nan(ind)",
        "-nan(ind)",
        "1.#qnan",
        "-1.#ind",
        "inf",
        "+inf",
        "-inf",
        "infinity",
        "-infinity",
        "---",
        "ovld",
        "ovl",
        "ol",
        "overload",
        "overflow",
        "over",
    ];
    cell.is_empty() || cell.len() <= 10 && WORDS.iter().any(|word| cell.eq_ignore_ascii_case(word.as_bytes()))
}

/// Parses `2024-05-31T12:30:01.25`, also with a blank instead of the T, a time zone, AM or PM, or without the date.
fn date_time(text: &str) -> Option<Moment> {
    // 12-hour clock: 12 AM is midnight, 12 PM is noon.
    if let Some((clock, half)) = text.rsplit_once(' ').filter(|(_, half)| half.len() == 2) {
        let afternoon = match half.to_ascii_uppercase().as_str() {
            "AM" => 0,
            "PM" => 12 * 3600,
            _ => return date_time_of_day(text),
        };
        let mut moment = date_time_of_day(clock).filter(|moment| moment.timed)?;
        let hour = moment.whole.rem_euclid(86_400) / 3600;
        if !(1..=12).contains(&hour) {
            return None;
        }
        moment.whole += afternoon - if hour == 12 { 12 * 3600 } else { 0 };
        return Some(moment);
    }
    date_time_of_day(text)
}

/// Parses a date and time with a 24-hour clock.
fn date_time_of_day(text: &str) -> Option<Moment> {
    let (days, clock) = match text.split_once(['T', ' ']) {
        Some((date, clock)) => (Some(days(date)?), clock.trim()),
        None if text.contains(':') => (None, text),
        None => {
            return Some(Moment { whole: days(text)? * 86_400, fraction: 0.0, decimals: 0, dated: true, timed: false });
        }
    };
    let (clock, offset) = zone(clock)?;
    let mut parts = clock.split(':');
    let (hour, minute) = (whole(parts.next()?, 0..=24)?, whole(parts.next()?, 0..=59)?);
    let second = parts.next().unwrap_or("0");
    // ISO 8601 allows a decimal comma and a decimal point.
    let pointed = second.contains(['.', ',']);
    let (second, fraction) = second.split_once(['.', ',']).unwrap_or((second, "0"));
    let second = whole(second, 0..=60)?;
    if parts.next().is_some() || fraction.is_empty() || !fraction.bytes().all(|b| b.is_ascii_digit()) {
        return None;
    }
    let whole = days.unwrap_or(0) * 86_400 + hour * 3600 + minute * 60 + second - offset;
    let decimals = if pointed { fraction.len() as i32 } else { 0 };
    Some(Moment {
        whole,
        fraction: format!("0.{fraction}").parse().ok()?,
        decimals,
        dated: days.is_some(),
        timed: true,
    })
}

fn whole(text: &str, range: std::ops::RangeInclusive<i64>) -> Option<i64> {
    let plain = !text.is_empty() && text.len() <= 4 && text.bytes().all(|b| b.is_ascii_digit());
    plain.then(|| text.parse().ok()).flatten().filter(|value| range.contains(value))
}

/// Returns the days since 1970-01-01 of `2024-05-31`, `2024/05/31` or `31.05.2024`.
///
/// Hinnant's algorithm, proleptic Gregorian calendar.
fn days(date: &str) -> Option<i64> {
    let mut parts = date.split(['-', '/', '.']);
    let (mut y, m, mut d) = (parts.next()?, parts.next()?, parts.next()?);
    // 31.05.2024. With slashes the month could be first, so such dates are not accepted.
    if date.contains('.') && d.len() == 4 {
        std::mem::swap(&mut y, &mut d);
    }
    if parts.next().is_some() || y.len() != 4 {
        return None;
    }
    let (y, m, d) = (whole(y, 1..=9999)?, whole(m, 1..=12)?, whole(d, 1..=31)?);
    let y = if m <= 2 { y - 1 } else { y };
    let era = y / 400;
    let year_of_era = y - era * 400;
    let day_of_year = (153 * ((m + 9) % 12) + 2) / 5 + d - 1;
    let day_of_era = year_of_era * 365 + year_of_era / 4 - year_of_era / 100 + day_of_year;
    Some(era * 146_097 + day_of_era - 719_468)
}

/// Splits a time of day into the time without its zone and the offset of the zone \[s\].
fn zone(clock: &str) -> Option<(&str, i64)> {
    if let Some(utc) = clock.strip_suffix(['Z', 'z']) {
        return Some((utc, 0));
    }
    let Some(at) = clock.rfind(['+', '-']) else { return Some((clock, 0)) };
    let sign = if clock[at..].starts_with('-') { -1 } else { 1 };
    let (hours, minutes) = match clock[at + 1..].split_once(':') {
        Some((hours, minutes)) => (hours, minutes),
        None if clock.len() - at == 5 => clock[at + 1..].split_at_checked(2)?,
        None => (&clock[at + 1..], "0"),
    };
    Some((&clock[..at], sign * (whole(hours, 0..=14)? * 3600 + whole(minutes, 0..=59)? * 60)))
}

/// Updates `printed` with the digits of a time.
pub(super) fn take_digits(printed: &mut Printed, cell: &[u8], decimal: u8) {
    if decimal == b'.' {
        printed.take(cell);
    } else {
        // With a decimal comma the point is the thousands separator.
        let point = |byte: &u8| if *byte == decimal { b'.' } else { *byte };
        let text: Vec<u8> = cell.iter().filter(|byte| **byte != b'.').map(point).collect();
        printed.take(&text);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn numbers_equal_those_of_the_standard_library() {
        for text in [
            "0",
            "-0.5",
            "+1.25",
            "1e3",
            "1.5E-7",
            ".5",
            "5.",
            "123456789012345678901234567890",
            "0.1",
            "2.2250738585072014e-308",
            "9007199254740993",
            "18446744073709551616",
        ] {
            assert_eq!(number(text.as_bytes(), b'.'), text.parse().ok(), "{text}");
        }
        assert_eq!(number(b"1,5", b','), Some(1.5));
        assert_eq!(number(b"1.5D+02", b'.'), Some(150.0));
        for text in ["", "-", ".", "e5", "1e", "1.2.3", "1 2", "0x10", "1,5", "--1"] {
            assert_eq!(number(text.as_bytes(), b'.'), None, "{text}");
        }
    }

    #[test]
    fn thousands_may_be_grouped() {
        for (text, decimal, value) in [
            ("1,050.5", b'.', 1050.5),
            ("-1'234'567", b'.', -1_234_567.0),
            ("1.050,25", b',', 1050.25),
            ("19,999", b'.', 19_999.0),
            ("1\u{202f}050,5", b',', 1050.5),
            ("1,050e3", b'.', f64::NAN),
        ] {
            let found = cell(text.as_bytes(), decimal);
            assert_eq!(found, if value.is_nan() { Cell::Other } else { Cell::Grouped(value) }, "{text}");
        }
        for (text, decimal) in [("0,123", b'.'), ("1,05", b'.'), ("1,0500", b'.'), ("1,050'000", b'.'), (",050", b'.')]
        {
            assert_eq!(cell(text.as_bytes(), decimal), Cell::Other, "{text}");
        }
    }

    #[test]
    fn dates_are_converted_to_seconds() {
        let date_time = |text| date_time(text).map(|moment| moment.since(0));
        assert_eq!(date_time("1970-01-02"), Some(86_400.0));
        assert_eq!(date_time("2024-02-29T12:00:00Z"), Some(1_709_208_000.0));
        assert_eq!(date_time("2024-02-29 12:00:00.250"), Some(1_709_208_000.25));
        assert_eq!(date_time("2024-02-29T13:00:00+01:00"), Some(1_709_208_000.0));
        assert_eq!(date_time("00:00:01.5"), Some(1.5));
        assert_eq!(date_time("29.02.2024 12:00:00.250"), Some(1_709_208_000.25));
        assert_eq!(date_time("1:21:14.5 PM"), Some(13.0 * 3600.0 + 21.0 * 60.0 + 14.5));
        assert_eq!(date_time("12:00:01 am"), Some(1.0));
        assert_eq!(date_time("13:00:00 PM"), None);
        for wrong in ["2024-13-01", "24-01-01", "12:61:00", "abc", "2024-01-01T", "1:2:3:4", "2024-01-01T00:00:00+99"] {
            assert_eq!(date_time(wrong), None, "{wrong}");
        }
    }

    proptest! {
        #[test]
        fn printed_numbers_are_read_exactly(value in proptest::num::f64::NORMAL | proptest::num::f64::ZERO, decimals in 0..9usize) {
            prop_assert_eq!(number(value.to_string().as_bytes(), b'.'), Some(value));
            prop_assert_eq!(number(format!("{value:e}").as_bytes(), b'.'), Some(value));
            let short = format!("{:.decimals$}", value % 1e6);
            prop_assert_eq!(number(short.as_bytes(), b'.'), short.parse().ok());
        }

        #[test]
        fn no_time_of_day_panics(text in "[0-9:+aµ.T -]{1,24}") {
            let _ = cell(text.as_bytes(), b'.');
        }

        #[test]
        fn no_bytes_panic(bytes in proptest::collection::vec(any::<u8>(), 0..40)) {
            let _ = cell(&bytes, b'.');
        }
    }
}
