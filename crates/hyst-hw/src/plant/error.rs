//! Errors of a plant's description, and errors of the plant.

use super::effects::{DISTURBANCES, EFFECTS};

/// Errors of a plant's description.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// The text is not TOML, or a field is unknown, missing or of the wrong type.
    ///
    /// The message shows the line.
    #[error("{0}")]
    Syntax(String),
    /// A value is invalid.
    #[error("{field} = {value}: {advice}")]
    Value {
        /// Section and name, such as `creep.tau_min_s`.
        field: String,
        /// The offending value.
        value: String,
        /// What to give instead.
        advice: String,
    },
    /// The plant has no effect of this name.
    #[error("no effect is named `{name}`; give one of {}", EFFECTS.join(", "))]
    UnknownEffect {
        /// The name as given.
        name: String,
    },
    /// The plant has no disturbance of this kind.
    #[error("no disturbance is of the kind `{kind}`; give one of {}", DISTURBANCES.join(", "))]
    UnknownDisturbance {
        /// The kind as given.
        kind: String,
    },
}

impl ConfigError {
    pub(crate) fn value(field: &str, value: impl ToString, advice: impl Into<String>) -> Self {
        Self::Value { field: field.to_owned(), value: value.to_string(), advice: advice.into() }
    }
}

/// Errors of the simulated plant.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlantError {
    /// The description is invalid.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The sample rate is out of range.
    #[error("cannot sample at {asked_hz} Hz: give a rate from {min_hz} to {max_hz} Hz")]
    Rate {
        /// Requested rate (Hz).
        asked_hz: f64,
        /// Slowest rate (Hz).
        min_hz: f64,
        /// Fastest rate (Hz).
        max_hz: f64,
    },
    /// `start` while the sample clock runs.
    #[error("the sample clock already runs: stop it first")]
    Running,
    /// `exchange` while the sample clock does not run.
    #[error("the sample clock does not run: start it first")]
    NotRunning,
    /// A drive sample is not a finite number; nothing of the block was applied.
    #[error("drive sample {index} is {volts}, not a finite voltage; nothing of the block was applied")]
    NonFinite {
        /// Position in the block.
        index: usize,
        /// The value.
        volts: f64,
    },
    /// A drive sample is out of range; nothing of the block was applied.
    #[error("drive sample {index} is {volts} V, outside {min_v} to {max_v} V; nothing of the block was applied")]
    OutOfRange {
        /// Position in the block.
        index: usize,
        /// The value (V).
        volts: f64,
        /// Lowest voltage (V).
        min_v: f64,
        /// Highest voltage (V).
        max_v: f64,
    },
    /// The duration of a rest is invalid.
    #[error("cannot rest for {seconds} s: give a finite time of 0 s or more")]
    Rest {
        /// Requested duration (s).
        seconds: f64,
    },
    /// The displacement is outside the range of the sensor's converter.
    #[error(
        "at {time_s:.4} s the displacement {value_um:.4} um is outside the sensor's range: \
         widen sensor.range_um in the plant's file, or reduce the drive"
    )]
    SensorRange {
        /// Time on the lab clock (s).
        time_s: f64,
        /// Displacement with the errors of the sensor (µm).
        value_um: f64,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_contain_the_value_and_what_to_do() {
        let value = ConfigError::value("lag.seconds", -1.0, "give a time constant");
        assert_eq!(value.to_string(), "lag.seconds = -1: give a time constant");
        assert_eq!(PlantError::from(value.clone()).to_string(), value.to_string());
        let rate = PlantError::Rate { asked_hz: 9e9, min_hz: 1.0, max_hz: 20_000.0 };
        assert!(rate.to_string().contains("from 1 to 20000 Hz"), "{rate}");
    }
}
