//! The sample rate above the table of a sheet, such as `Sample rate [Hz]` with 1000 in the cell to the right.

use std::collections::BTreeMap;

use super::cells::Item;

/// Names of a sample period.
const PERIODS: [&str; 10] = [
    "dt",
    "ts",
    "timestep",
    "timeincrement",
    "sampletime",
    "sampleperiod",
    "sampleinterval",
    "samplingtime",
    "samplingperiod",
    "samplinginterval",
];
/// Names of a sample rate.
const RATES: [&str; 5] = ["fs", "samplerate", "samplingrate", "samplefrequency", "samplingfrequency"];

/// Returns the sample period \[s\], if one of the rows above the table states it.
pub(super) fn stated(above: &[&BTreeMap<u32, Item>]) -> Option<f64> {
    above.iter().find_map(|row| {
        let mut cells = row.values().skip_while(|item| !matches!(item, Item::Text(_)));
        let (Some(Item::Text(key)), Some(Item::Number(value))) = (cells.next(), cells.next()) else { return None };
        let next = if let Some(Item::Text(unit)) = cells.next() { Some(unit.as_str()) } else { None };
        period(key, *value, next)
    })
}

/// Returns the sample period \[s\]. The unit is in brackets after the key, or in the cell `next` after the value.
fn period(key: &str, value: f64, next: Option<&str>) -> Option<f64> {
    let (key, own) = key.split_once(['[', '(']).unwrap_or((key, ""));
    let own = own.trim_matches([')', ']', ' ']);
    let unit = if own.is_empty() { next.map_or("", str::trim) } else { own };
    let word: String = key.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect();
    if !(value > 0.0 && value.is_finite()) {
        return None;
    }
    // Division gives the double nearest to 0.001 s for 1 ms, multiplication may not.
    if PERIODS.contains(&word.as_str()) {
        match unit {
            "" | "s" | "sec" | "seconds" => Some(value),
            "ms" => Some(value / 1e3),
            "us" | "µs" | "μs" => Some(value / 1e6),
            _ => None,
        }
    } else if RATES.contains(&word.as_str()) {
        match unit.to_lowercase().as_str() {
            "" | "hz" | "1/s" | "s/s" | "sa/s" | "samples/s" => Some(1.0 / value),
            "khz" | "ks/s" | "ksa/s" => Some(1e-3 / value),
            "mhz" | "ms/s" | "msa/s" => Some(1e-6 / value),
            _ => None,
        }
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_and_periods_are_recognised() {
        assert_eq!(period("Sample rate [Hz]", 1000.0, None), Some(1e-3));
        assert_eq!(period("Sampling rate:", 10.0, Some("kHz")), Some(1e-4));
        assert_eq!(period("dt", 0.5, None), Some(0.5));
        assert_eq!(period("Sample interval (ms)", 1.0, None), Some(1e-3));
        assert_eq!(period("dt", 1.0, Some("rows")), None);
        assert_eq!(period("Amplitude", 100.0, Some("V")), None);
        assert_eq!(period("fs", -1.0, None), None);
    }
}
