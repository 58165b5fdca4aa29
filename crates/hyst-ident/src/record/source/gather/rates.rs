//! Sample rates and periods that a file states as one number.

/// A stated sample rate or period. A rate is preferred, because it is more often a whole number.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rate {
    /// The sample period \[s\].
    pub(crate) step: f64,
    is_rate: bool,
}

impl Rate {
    /// Returns `other` if only that is stated as a rate, else this one.
    pub(crate) fn or_better(self, other: Self) -> Self {
        if other.is_rate && !self.is_rate { other } else { self }
    }
}

/// Returns the sample period if `name` is a usual name of a sample rate or period. `unit` is its unit in the file.
pub(crate) fn step_of(name: &str, value: f64, unit: Option<&str>) -> Option<Rate> {
    let plain: String = name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect();
    let is_rate = match plain.as_str() {
        "fs" | "samplerate" | "samplingrate" | "samplefrequency" | "samplingfrequency" | "samplingratehz"
        | "sampleratehz" | "fshz" => true,
        "dt" | "ts" | "sampleperiod" | "samplingperiod" | "sampletime" | "sampleinterval" | "samplinginterval" => false,
        _ => return None,
    };
    let factor = match (is_rate, unit.map_or("", str::trim).to_lowercase().as_str()) {
        (_, "")
        | (true, "hz" | "1/s" | "s^-1" | "sa/s" | "s/s" | "samples/s")
        | (false, "s" | "sec" | "second" | "seconds") => 1.0,
        (true, "khz") => 1e3,
        (true, "mhz") => 1e6,
        (false, "ms") => 1e-3,
        (false, "us" | "µs" | "μs") => 1e-6,
        _ => return None,
    };
    let value = value * factor;
    let step = if is_rate { 1.0 / value } else { value };
    (value > 0.0 && step > 0.0 && step.is_finite()).then_some(Rate { step, is_rate })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_and_periods_are_recognised_by_name() {
        let step = |name, value, unit| step_of(name, value, unit).map(|rate| rate.step);
        assert_eq!(step("Fs", 1000.0, None), Some(1e-3));
        assert_eq!(step("sample_rate", 10.0, Some("kHz")), Some(1e-4));
        assert_eq!(step("dt", 0.5, None), Some(0.5));
        assert_eq!(step("Ts", 2.0, Some("ms")), Some(2e-3));
        assert_eq!(step("gain", 2.0, None), None);
        assert_eq!(step("fs", 0.0, None), None);
        assert_eq!(step("fs", f64::NAN, None), None);
        assert_eq!(step("dt", 1.0, Some("km")), None);
        let period = step_of("dt", 0.1, None).unwrap();
        let rate = step_of("fs", 5.0, None).unwrap();
        assert_eq!((period.or_better(rate).step, rate.or_better(period).step), (0.2, 0.2));
    }
}
