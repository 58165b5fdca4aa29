//! The closed list of effects.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// An effect that may be behind a residual. The closed list, in the chain's order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Suspect {
    /// Dead time of the drive.
    Delay,
    /// First-order lag of the amplifier.
    Lag,
    /// A curve behind the hysteresis.
    Asymmetry,
    /// Loops that widen with the drive's rate.
    RateDependence,
    /// Gain that follows temperature.
    Temperature,
    /// Slow relaxation after the drive has stopped.
    Creep,
    /// Yielding under an external force.
    Load,
    /// A structural mode.
    Resonance,
    /// Ends of the motion.
    Saturation,
    /// Drift of the sensor.
    Drift,
    /// A tone in the sensor.
    Interference,
}

impl Suspect {
    /// All of them.
    pub const ALL: [Self; 11] = [
        Self::Delay,
        Self::Lag,
        Self::Asymmetry,
        Self::RateDependence,
        Self::Temperature,
        Self::Creep,
        Self::Load,
        Self::Resonance,
        Self::Saturation,
        Self::Drift,
        Self::Interference,
    ];

    /// The name that commands and files use.
    pub fn name(self) -> &'static str {
        match self {
            Self::Delay => "delay",
            Self::Lag => "lag",
            Self::Asymmetry => "asymmetry",
            Self::RateDependence => "rate-dependence",
            Self::Temperature => "temperature",
            Self::Creep => "creep",
            Self::Load => "load",
            Self::Resonance => "resonance",
            Self::Saturation => "saturation",
            Self::Drift => "drift",
            Self::Interference => "interference",
        }
    }
}

impl fmt::Display for Suspect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Suspect {
    type Err = String;
    fn from_str(s: &str) -> Result<Self, String> {
        let names = || Self::ALL.map(Self::name).join(", ");
        Self::ALL
            .into_iter()
            .find(|suspect| suspect.name() == s)
            .ok_or_else(|| format!("no effect is called {s:?}; it is one of {}", names()))
    }
}
