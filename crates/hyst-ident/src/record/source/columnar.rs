//! Common code of Parquet and Arrow: clocks, number types that Rust does not have, and metadata of columns.

mod pandas;

use super::{Axis, Table};

/// Size up to which a compressed file may always unpack \[bytes\].
const ALWAYS_UNPACKED: usize = 64 << 20;
/// Largest ratio of unpacked to packed size of larger files. Numbers rarely compress by more than a factor of 10.
const MAX_EXPANSION: usize = 200;
/// Keys of a sample rate \[Hz\].
const RATES: [&str; 4] = ["fs", "sample_rate", "samplerate", "sampling_rate"];
/// Keys of a sample period \[s\].
const PERIODS: [&str; 4] = ["dt", "ts", "sample_period", "sampleperiod"];

/// Returns the largest memory of the columns of a file of `size` bytes \[bytes\].
///
/// A few bytes can encode a billion equal values. The limit depends on the size of the file, not on the sizes stated in
/// it.
pub(super) fn unpacked_limit(size: usize) -> usize {
    ALWAYS_UNPACKED.max(size.saturating_mul(MAX_EXPANSION))
}

/// A clock of dates and times: seconds since the midnight (UTC) before its first value.
///
/// Ticks since 1970 have up to 19 digits, but a double has only 16. Ticks are therefore subtracted as integers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Clock {
    ticks_per_second: i64,
    /// Ticks from 1970 to the midnight before the first value.
    midnight: Option<i128>,
}

impl Clock {
    pub(super) fn new(ticks_per_second: i64) -> Self {
        Self { ticks_per_second, midnight: None }
    }

    /// Returns the seconds since the midnight before the ticks of the first call.
    pub(super) fn seconds(&mut self, ticks: i64) -> f64 {
        let day = 86_400 * i128::from(self.ticks_per_second);
        // The difference of two 64-bit integers may overflow 64 bits.
        let ticks = i128::from(ticks);
        let midnight = *self.midnight.get_or_insert_with(|| ticks.div_euclid(day) * day);
        (ticks - midnight) as f64 / self.ticks_per_second as f64
    }
}

/// Converts a half-precision float (IEEE 754 binary16).
pub(super) fn half(bits: u16) -> f64 {
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023));
    let magnitude = match exponent {
        0 => fraction * 2_f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1.0 + fraction / 1024.0) * 2_f64.powi(exponent - 15),
    };
    if bits >> 15 == 1 { -magnitude } else { magnitude }
}

/// Converts a decimal number: an integer with `scale` digits after the decimal point.
pub(super) fn decimal(integer: i128, scale: i32) -> f64 {
    // Powers of ten up to 10^22 are exact, so a division rounds once. A product with 0.1 would round twice.
    if scale >= 0 { integer as f64 / 10_f64.powi(scale) } else { integer as f64 * 10_f64.powi(-scale) }
}

/// Returns whether a metadata key of a column is its unit.
pub(super) fn is_unit_key(key: &str) -> bool {
    key.eq_ignore_ascii_case("unit") || key.eq_ignore_ascii_case("units")
}

/// Applies the metadata of a file to all columns: the index of a pandas table, and a sample rate or period.
pub(super) fn apply_statements<'a>(table: &mut Table, statements: impl IntoIterator<Item = (&'a str, &'a str)>) {
    let mut axis = Axis::Unknown;
    for (key, value) in statements {
        let number = || value.trim().parse::<f64>().ok().filter(|number| number.is_normal() && *number > 0.0);
        let is_one_of = |names: &[&str]| names.iter().any(|name| key.eq_ignore_ascii_case(name));
        if key == "pandas" {
            // An index has the time of each row and takes precedence over a rate.
            if let Some(column) = pandas::index_of_times(table, value) {
                axis = Axis::Column(column);
                break;
            }
        } else if let Some(step) =
            if is_one_of(&RATES) { number().map(|rate| 1.0 / rate) } else { number().filter(|_| is_one_of(&PERIODS)) }
        {
            axis = Axis::Even { start: 0.0, step };
        }
    }
    for (at, head) in table.heads.iter_mut().enumerate() {
        if axis != Axis::Column(at) {
            head.axis = axis;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::Head;
    use super::*;

    #[test]
    fn a_clock_counts_from_the_midnight_before_its_first_value() {
        let mut clock = Clock::new(1_000_000_000);
        let start = 1_715_588_474_000_000_000;
        assert_eq!(clock.seconds(start), 30_074.0);
        assert_eq!(clock.seconds(start + 123_456_789), 30_074.123_456_789);
        // 1969-12-31 23:59:59 is on the day before 1970-01-01.
        assert_eq!(Clock::new(1).seconds(-1), 86_399.0);
        let mut clock = Clock::new(1_000_000_000);
        assert!(clock.seconds(i64::MIN).is_finite() && clock.seconds(i64::MAX) > 1e10);
        assert!(Clock::new(1000).seconds(i64::MAX) < 86_400.0);
    }

    #[test]
    fn half_precision_is_converted_exactly() {
        let cases =
            [(0x3c00, 1.0), (0xc000, -2.0), (0x7bff, 65_504.0), (0x0001, 2_f64.powi(-24)), (0x3555, 0.333_251_953_125)];
        for (bits, value) in cases {
            assert_eq!(half(bits), value);
        }
        assert!(half(0x7e00).is_nan() && half(0xfc00) == f64::NEG_INFINITY);
    }

    #[test]
    fn a_decimal_is_rounded_once() {
        assert_eq!(decimal(123, 2), 1.23);
        assert_eq!(decimal(-7, 1), -0.7);
        assert_eq!(decimal(5, -3), 5000.0);
    }

    #[test]
    fn a_stated_rate_is_an_even_axis() {
        let mut table = Table::new("x");
        table.push(Head::new("u"), vec![1.0, 2.0]);
        apply_statements(&mut table, [("author", "me"), ("Fs", "1000")]);
        assert_eq!(table.heads[0].axis, Axis::Even { start: 0.0, step: 1e-3 });
        apply_statements(&mut table, [("dt", "0.5")]);
        assert_eq!(table.heads[0].axis, Axis::Even { start: 0.0, step: 0.5 });
        apply_statements(&mut table, [("dt", "-1")]);
        assert_eq!(table.heads[0].axis, Axis::Unknown);
    }
}
