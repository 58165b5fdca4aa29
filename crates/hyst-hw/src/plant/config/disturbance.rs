//! Disturbances that are not effects.

use serde::{Deserialize, Serialize};

/// Section `[[disturbance]]`: a disturbance of the actuator or its sensor that is not an effect.
///
/// A diagnosis cannot name it. A load or a temperature that is not recorded is also such a disturbance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Disturbance {
    /// A single step of the reading.
    Jump {
        /// Size of the step (µm).
        um: f64,
        /// Time of the step on the lab clock (s).
        at_s: f64,
    },
    /// A step of the gain: from then on, the displacement of the hysteresis is multiplied by `1 + share`.
    GainStep {
        /// Relative change of the gain.
        share: f64,
        /// Time of the step on the lab clock (s).
        at_s: f64,
    },
    /// Bursts of Gaussian noise in the reading, one at a random time in each interval of `every_s`.
    Bursts {
        /// Standard deviation (µm).
        um: f64,
        /// Duration of a burst (s).
        seconds: f64,
        /// Interval that contains one burst (s).
        every_s: f64,
    },
    /// A random walk of the sensor's zero: the sum of 12 sines, with amplitudes that fall with frequency.
    Wander {
        /// Sum of the amplitudes (µm); the zero stays within it.
        um: f64,
        /// Period of the slowest sine (s).
        period_s: f64,
    },
    /// The mount slips to another position each time the drive rises above a voltage.
    Slip {
        /// Largest distance of the mount from its first position (µm).
        um: f64,
        /// Voltage at which the mount slips (V).
        at_v: f64,
    },
    /// The amplifier's current is limited, which limits the slew rate of its output.
    SlewLimit {
        /// Slew limit (V/s).
        v_per_s: f64,
    },
}
