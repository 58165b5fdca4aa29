//! Options of the connection to a device, and limits of its runs.

use std::time::Duration;

use crate::wire::Mode;

/// Options of the connection to a device, and limits of its runs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RemoteOptions {
    /// Time to wait for an answer before the request is sent again.
    pub repeat: Duration,
    /// Time without any answer after which the device counts as lost.
    pub lost: Duration,
    /// Watchdog time: silence of this host after which the device ramps to rest \[s\].
    pub silence_s: f64,
    /// Lowest and highest voltage of a run \[V\]; by default those of the device.
    pub voltage: Option<(f64, f64)>,
    /// Slew limit \[V/s\]; by default that of the device.
    pub slew_v_per_s: Option<f64>,
    /// Highest permitted temperature \[°C\].
    pub hottest_degc: f64,
    /// Meaning of the drive samples: voltages or references.
    pub mode: Mode,
    /// Largest permitted tracking error \[output unit\].
    pub error: f64,
    /// Whether the device estimates the external force with the uploaded observer.
    pub force: bool,
    /// Number of the run, different for each run.
    ///
    /// The caller chooses it at random, so that two programs do not use the same number.
    pub session: u32,
}

impl RemoteOptions {
    /// Returns options for run number `session`: the limits of the device, and a watchdog time of 0.5 s.
    #[must_use]
    pub const fn with_session(session: u32) -> Self {
        Self {
            repeat: Duration::from_millis(50),
            lost: Duration::from_secs(2),
            silence_s: 0.5,
            voltage: None,
            slew_v_per_s: None,
            hottest_degc: f64::INFINITY,
            mode: Mode::Voltage,
            error: f64::INFINITY,
            force: false,
            session,
        }
    }
}
