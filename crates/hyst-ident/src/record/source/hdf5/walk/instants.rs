//! Times since a date, such as `nanoseconds since 1970-01-01` (CF conventions of netCDF).

use crate::record::source::elements::{Kind, Storage};

/// Units of time and their size \[ns\].
const UNITS: [(&[&str], i64); 7] = [
    (&["nanoseconds", "nanosecond", "ns"], 1),
    (&["microseconds", "microsecond", "us", "µs"], 1_000),
    (&["milliseconds", "millisecond", "msec", "ms"], 1_000_000),
    (&["seconds", "second", "sec", "s"], 1_000_000_000),
    (&["minutes", "minute", "min"], 60_000_000_000),
    (&["hours", "hour", "h"], 3_600_000_000_000),
    (&["days", "day", "d"], NANOSECONDS_A_DAY),
];
const NANOSECONDS_A_DAY: i64 = 86_400_000_000_000;

/// Returns seconds since the last full day before the first value; `None` if the unit does not count from a date.
///
/// A double does not resolve nanoseconds since 1970, so integers are subtracted before they are converted.
pub(super) fn seconds(unit: &str, values: &[f64], bytes: &[u8], storage: Storage) -> Option<Vec<f64>> {
    let (word, _) = unit.split_once(" since ")?;
    let word = word.trim().to_lowercase();
    let (_, nanoseconds) = UNITS.iter().find(|(names, _)| names.contains(&word.as_str()))?;
    let a_day = NANOSECONDS_A_DAY / nanoseconds;
    // Units shorter than a second divide it, longer units are whole seconds. Each conversion rounds once.
    let to_seconds = |value: f64| {
        let second = 1_000_000_000;
        if *nanoseconds < second {
            value / (second / nanoseconds) as f64
        } else {
            value * (nanoseconds / second) as f64
        }
    };
    if storage.kind == Kind::I64 {
        let whole =
            |own: &[u8; 8]| if storage.big_endian { i64::from_be_bytes(*own) } else { i64::from_le_bytes(*own) };
        let whole: Vec<i64> = bytes.chunks_exact(8).filter_map(|own| own.first_chunk()).map(whole).collect();
        let start = whole.first()?.div_euclid(a_day).checked_mul(a_day)?;
        // The smallest integer means a missing time.
        let of =
            |value: &i64| if *value == i64::MIN { f64::NAN } else { to_seconds(value.saturating_sub(start) as f64) };
        return Some(whole.iter().map(of).collect());
    }
    let start = (values.iter().find(|value| value.is_finite())? / a_day as f64).floor() * a_day as f64;
    Some(values.iter().map(|value| to_seconds(value - start)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_keep_their_nanoseconds() {
        let start = 1_709_208_000_000_000_000_i64;
        let bytes: Vec<u8> = [start, start + 1, i64::MIN].iter().flat_map(|value| value.to_le_bytes()).collect();
        let storage = Storage { kind: Kind::I64, big_endian: false };
        let found = seconds("nanoseconds since 1970-01-01", &[], &bytes, storage).unwrap();
        assert_eq!(found[..2], [43_200.0, 43_200.000_000_001]);
        assert!(found[2].is_nan());
        let storage = Storage { kind: Kind::F64, big_endian: false };
        assert_eq!(seconds("hours since 2024-01-01", &[25.0, 26.5], &[], storage).unwrap(), [3600.0, 9000.0]);
        assert_eq!(seconds("s", &[0.0], &[], storage), None);
        assert_eq!(seconds("fathoms since noon", &[0.0], &[], storage), None);
    }
}
