//! What can be wrong with a plant's description, and what the plant refuses.

/// What is wrong with a description of a plant.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// Not TOML, or a field is unknown, missing or of the wrong type; the text shows the line.
    #[error("{0}")]
    Syntax(String),
    /// A value makes no sense.
    #[error("{field} = {value}: {advice}")]
    Value {
        /// Section and name, such as `creep.tau_min_s`.
        field: String,
        /// The offending value.
        value: String,
        /// What to write instead.
        advice: String,
    },
    /// An effect's name that the plant does not know.
    #[error("no effect named `{name}`; choose among {}", super::EFFECTS.join(", "))]
    UnknownEffect {
        /// The name as given.
        name: String,
    },
    /// A kind of disturbance that the plant does not know.
    #[error("no disturbance of the kind `{kind}`; choose among {}", super::DISTURBANCES.join(", "))]
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

/// What the simulated plant refuses or cannot do.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PlantError {
    /// The description makes no sense.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The sample clock cannot run at this rate.
    #[error("cannot sample at {asked_hz} Hz: choose a rate from {min_hz} to {max_hz} Hz")]
    Rate {
        /// Rate asked for (Hz).
        asked_hz: f64,
        /// Slowest rate (Hz).
        min_hz: f64,
        /// Fastest rate (Hz).
        max_hz: f64,
    },
    /// `start` while the sample clock runs.
    #[error("the sample clock runs already: stop it first")]
    Running,
    /// `exchange` while the sample clock stands.
    #[error("the sample clock does not run: start it first")]
    NotRunning,
    /// A drive sample is not a finite number; nothing of the block was applied.
    #[error("drive sample {index} is {volts}: not a finite voltage; nothing was applied")]
    NonFinite {
        /// Position in the block.
        index: usize,
        /// The value.
        volts: f64,
    },
    /// A drive sample is out of range; nothing of the block was applied.
    #[error("drive sample {index} is {volts} V, outside {min_v} to {max_v} V; nothing was applied")]
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
    /// A rest of no possible duration.
    #[error("cannot rest for {seconds} s: give a finite time of 0 s or more")]
    Rest {
        /// Duration asked for (s).
        seconds: f64,
    },
    /// The displacement left the range of the sensor's converter.
    #[error(
        "at {time_s:.4} s the sensor would have to show {value_um:.4} um: widen sensor.range_um in the plant's file, or lower the drive"
    )]
    SensorRange {
        /// Time on the lab's clock (s).
        time_s: f64,
        /// Value that cannot be shown (µm).
        value_um: f64,
    },
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_name_the_value_and_say_what_to_do() {
        let value = ConfigError::value("lag.seconds", -1.0, "give a time constant");
        assert_eq!(value.to_string(), "lag.seconds = -1: give a time constant");
        assert_eq!(PlantError::from(value.clone()).to_string(), value.to_string());
        let rate = PlantError::Rate { asked_hz: 9e9, min_hz: 1.0, max_hz: 20_000.0 };
        assert!(rate.to_string().contains("from 1 to 20000 Hz"), "{rate}");
    }
}
