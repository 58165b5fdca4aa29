//! What a serial device, a CAN device and the simulated plant have in common.

use crate::remote::ClockFit;

/// The voltages a device can put out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VoltageRange {
    /// Lowest drive (V).
    pub min_v: f64,
    /// Highest drive (V).
    pub max_v: f64,
    /// Drive at which the device rests (V); within `min_v..=max_v`.
    pub rest_v: f64,
}

impl VoltageRange {
    /// Whether `volts` may be applied: finite and within the range, ends included.
    #[must_use]
    pub fn contains(&self, volts: f64) -> bool {
        volts >= self.min_v && volts <= self.max_v
    }
}

/// Quantity and unit of the measured output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum OutputUnit {
    /// Displacement in micrometres.
    Micrometre,
    /// Displacement in nanometres.
    Nanometre,
    /// Displacement in millimetres.
    Millimetre,
    /// Force in newtons.
    Newton,
}

impl OutputUnit {
    /// Name of the output's column in a record file.
    #[must_use]
    pub const fn column(self) -> &'static str {
        match self {
            Self::Micrometre => "displacement_um",
            Self::Nanometre => "displacement_nm",
            Self::Millimetre => "displacement_mm",
            Self::Newton => "force_n",
        }
    }

    /// Symbol of the unit as columns and reports write it: `um`, `nm`, `mm` or `n`.
    #[must_use]
    pub const fn symbol(self) -> &'static str {
        match self {
            Self::Micrometre => "um",
            Self::Nanometre => "nm",
            Self::Millimetre => "mm",
            Self::Newton => "n",
        }
    }
}

/// What a device can do; fixed from its opening on.
#[derive(Debug, Clone, PartialEq)]
pub struct Capabilities {
    /// What the device calls itself, for logs and messages.
    pub device: String,
    /// Voltages it can put out.
    pub voltage: VoltageRange,
    /// Steepest slope of its voltage (V/s); infinite where nothing is said of it.
    pub max_slew_v_per_s: f64,
    /// Slowest sample clock (Hz).
    pub min_rate_hz: f64,
    /// Fastest sample clock (Hz).
    pub max_rate_hz: f64,
    /// Most drive samples that one [`Daq::exchange`] should be given.
    pub max_block: usize,
    /// Quantity and unit of [`Sample::output`].
    pub output: OutputUnit,
    /// Whether each sample holds a temperature.
    pub temperature: bool,
    /// Whether each sample holds a load force.
    pub load: bool,
    /// Whether drives wait in a queue, so that what is measured comes later than drives that were sent after it: no loop can be closed
    /// from here.
    pub queued: bool,
}

/// One instant of a record: what was applied and what was measured then.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Time on the device's clock (s); it goes on across segments.
    pub time_s: f64,
    /// Voltage that the device reports to have applied at `time_s` (V).
    pub drive_v: f64,
    /// Measured output, in the unit of [`Capabilities::output`].
    pub output: f64,
    /// Measured temperature (°C), where the device has that channel.
    pub temperature_degc: Option<f64>,
    /// Measured load force (N), where the device has that channel.
    pub load_n: Option<f64>,
    /// Force that the device has estimated (N), where it has a force observer.
    pub force_n: Option<f64>,
}

/// A device that drives an actuator and measures it on one sample clock.
///
/// Life of a device: idle → [`start`](Daq::start) → any number of [`exchange`](Daq::exchange) and
/// [`rest`](Daq::rest) → [`stop`](Daq::stop) → idle. Sample `k` after a start or rest is applied
/// and measured `k + 1` sample periods after it, so the drive moves from the voltage before to the
/// new one within one period.
///
/// A device with a queue (serial, CAN) may take fewer samples than it is given and may return
/// measurements later than their drive; the simulated plant takes and returns all at once.
pub trait Daq {
    /// The device's own error. It tells a refused request (nothing was applied) from a lost device.
    type Error: std::error::Error + Send + Sync + 'static;

    /// What the device can do.
    fn capabilities(&self) -> &Capabilities;

    /// Voltage that the device puts out now, or will once its queue has run (V).
    fn present_v(&self) -> f64;

    /// Starts the sample clock and returns the rate that the device really runs at (Hz): a clock
    /// divider may not meet `rate_hz` exactly. The drive stays where it is.
    ///
    /// # Errors
    /// When the rate is outside the capabilities, or the device runs already.
    fn start(&mut self, rate_hz: f64) -> Result<f64, Self::Error>;

    /// Hands over drive samples (V) and takes measurements.
    ///
    /// Returns how many samples of `drive_v` were accepted, from its start; appends to `measured`
    /// what has come in. Every accepted sample gives exactly one [`Sample`], in order. The call
    /// blocks until it has accepted or measured at least one sample; with an empty `drive_v` it
    /// collects samples that are still out. A device whose queue runs dry holds its last voltage.
    ///
    /// # Errors
    /// A voltage that is not finite or not in range refuses the whole block: nothing of it is
    /// applied, nothing is clamped, and the device goes on as if the call had not been made. Other
    /// errors are the device's own; what `measured` holds by then is valid.
    fn exchange(&mut self, drive_v: &[f64], measured: &mut Vec<Sample>) -> Result<usize, Self::Error>;

    /// The device's clock against this computer's, in this run or the last one; `None` where there is no other clock, or nothing is known yet.
    fn clock(&self) -> Option<ClockFit> {
        None
    }

    /// Brings the drive to the rest voltage and lets the device rest for `seconds`; the next
    /// sample begins a new segment.
    ///
    /// # Errors
    /// When the duration is negative or not finite, or the device is lost.
    fn rest(&mut self, seconds: f64) -> Result<(), Self::Error>;

    /// Stops the sample clock with the drive at the rest voltage. Harmless when already stopped.
    ///
    /// # Errors
    /// When the device is lost, so that its drive may still be on.
    fn stop(&mut self) -> Result<(), Self::Error>;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn range_includes_its_ends_and_refuses_what_is_not_a_number() {
        let range = VoltageRange { min_v: -10.0, max_v: 120.0, rest_v: 0.0 };
        assert!(range.contains(-10.0) && range.contains(120.0));
        for bad in [-10.1, 120.1, f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            assert!(!range.contains(bad), "{bad}");
        }
    }

    #[test]
    fn columns_end_in_their_unit() {
        for unit in [OutputUnit::Micrometre, OutputUnit::Nanometre, OutputUnit::Millimetre, OutputUnit::Newton] {
            assert!(unit.column().ends_with(&format!("_{}", unit.symbol())));
        }
    }
}
