//! What no diagnosis has on its list.

use serde::{Deserialize, Serialize};

/// A section `[[disturbance]]`: something that happens to the actuator or its sensor and is none of the effects that a
/// diagnosis can name. A load or a temperature that is not recorded is another.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Disturbance {
    /// The reading jumps once and stays.
    Jump {
        /// By how much (µm).
        um: f64,
        /// When, on the lab's clock (s).
        at_s: f64,
    },
    /// The hysteresis' displacement is `1 + share` times as large from a moment on.
    GainStep {
        /// Relative change.
        share: f64,
        /// When, on the lab's clock (s).
        at_s: f64,
    },
    /// Bursts of Gaussian noise in the reading, one at a random moment of every `every_s`.
    Bursts {
        /// Standard deviation (µm).
        um: f64,
        /// How long each lasts (s).
        seconds: f64,
        /// Time for one burst (s).
        every_s: f64,
    },
    /// The sensor's zero wanders like a random walk: a dozen sines whose amplitudes fall with their frequency.
    Wander {
        /// Sum of the amplitudes: the zero stays within this (µm).
        um: f64,
        /// Period of the slowest sine (s).
        period_s: f64,
    },
    /// The mount slips to another place each time the drive rises past a voltage.
    Slip {
        /// The mount stays within this distance of its first place (µm).
        um: f64,
        /// The voltage (V).
        at_v: f64,
    },
    /// The amplifier's current is limited: what it puts out follows the drive no faster than this.
    SlewLimit {
        /// Steepest slope (V/s).
        v_per_s: f64,
    },
}
