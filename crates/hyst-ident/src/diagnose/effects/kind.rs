//! Classes of effects.

use serde::{Deserialize, Serialize};

/// Class of an effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EffectKind {
    /// Rate-dependent hysteresis: the loop changes with the rate of the drive.
    Rate,
    /// The output continues to move after the drive has stopped.
    SlowMemory,
    /// Linear dynamics: the output is late, smoothed or ringing.
    LinearDynamics,
    /// A memoryless curve at the output or the input of the hysteresis.
    OutputShape,
    /// The output follows the measured temperature.
    Temperature,
    /// The output follows the measured load.
    Load,
    /// The zero moves with time, independently of the drive.
    Time,
    /// A periodic signal in the sensor.
    Tone,
}
