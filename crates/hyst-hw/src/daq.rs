//! The interface that serial devices, CAN devices and the simulated plant share.

/// Output voltages of a device.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct VoltageRange {
    /// Lowest drive (V).
    pub min_v: f64,
    /// Highest drive (V).
    pub max_v: f64,
    /// Drive at rest (V); within `min_v..=max_v`.
    pub rest_v: f64,
}

impl VoltageRange {
    /// Returns whether `volts` may be applied: finite and within the range, ends included.
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
    /// Returns the name of the output's column in a record file.
    #[must_use]
    pub const fn column(self) -> &'static str {
        match self {
            Self::Micrometre => "displacement_um",
            Self::Nanometre => "displacement_nm",
            Self::Millimetre => "displacement_mm",
            Self::Newton => "force_n",
        }
    }

    /// Returns the symbol of the unit in columns and reports: `um`, `nm`, `mm` or `n`.
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

/// Properties of a device; they do not change after it is opened.
#[derive(Debug, Clone, PartialEq)]
pub struct Capabilities {
    /// Name of the device, for logs and messages.
    pub device: String,
    /// Output voltages.
    pub voltage: VoltageRange,
    /// Largest slew rate of the output (V/s); infinite if unknown.
    pub max_slew_v_per_s: f64,
    /// Slowest sample clock (Hz).
    pub min_rate_hz: f64,
    /// Fastest sample clock (Hz).
    pub max_rate_hz: f64,
    /// Maximum number of drive samples per [`Daq::exchange`].
    pub max_block: usize,
    /// Quantity and unit of [`Sample::output`].
    pub output: OutputUnit,
    /// Whether each sample holds a temperature.
    pub temperature: bool,
    /// Whether each sample holds a load force.
    pub load: bool,
    /// Whether drives wait in a queue on the device.
    ///
    /// A measurement then arrives after later drives were sent, so this computer cannot close a control loop.
    pub queued: bool,
}

/// One row of a record: the applied drive and the measurements.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Time on the device's clock (s); it continues across segments.
    pub time_s: f64,
    /// Voltage that the device applied at `time_s` (V), as reported by the device.
    pub drive_v: f64,
    /// Measured output, in the unit of [`Capabilities::output`].
    pub output: f64,
    /// Measured temperature (°C), if the device has this channel.
    pub temperature_degc: Option<f64>,
    /// Measured load force (N), if the device has this channel.
    pub load_n: Option<f64>,
    /// Force estimated on the device (N), if it has a force observer.
    pub force_n: Option<f64>,
}

/// Begin of a run on this computer's clock, and rate error of the device's clock.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClockFit {
    /// Begin of period 0 of the run \[s since 1970-01-01 UTC\].
    pub began_unix_s: f64,
    /// Rate of the device's clock relative to this computer's, minus 1 \[ppm\].
    ///
    /// `None` if the run is too short to measure it.
    pub faster_ppm: Option<f64>,
    /// Uncertainty of the begin: half of the shortest round trip and half a period \[s\].
    pub uncertainty_s: f64,
}

/// A device that drives an actuator and measures it on one sample clock.
///
/// Order of calls: [`start`](Daq::start), then any number of [`exchange`](Daq::exchange) and
/// [`rest`](Daq::rest), then [`stop`](Daq::stop). Sample `k` after a start or rest is applied
/// and measured `k + 1` sample periods later: the drive moves from the previous voltage to the
/// new one within one period.
///
/// A device with a queue (serial, CAN) may accept fewer samples than it is given, and may return
/// measurements later than their drive. The simulated plant accepts and returns all samples at once.
pub trait Daq {
    /// Error of the device. It distinguishes a refused request (nothing was applied) from a lost device.
    type Error: std::error::Error + Send + Sync + 'static;

    /// Returns the properties of the device.
    fn capabilities(&self) -> &Capabilities;

    /// Returns the present output voltage (V); with a queue, the output after its last drive.
    fn present_v(&self) -> f64;

    /// Starts the sample clock and returns the actual rate (Hz).
    ///
    /// The actual rate may differ from `rate_hz`, for example because of a clock divider. The drive does not change.
    ///
    /// # Errors
    /// If the rate is outside the capabilities, or if the device already runs.
    fn start(&mut self, rate_hz: f64) -> Result<f64, Self::Error>;

    /// Sends drive samples (V) and appends the received measurements to `measured`.
    ///
    /// Returns the number of accepted samples, counted from the start of `drive_v`. Every accepted
    /// sample produces exactly one [`Sample`], in order. The call blocks until at least one sample
    /// is accepted or measured. With an empty `drive_v` it collects the measurements that are still
    /// outstanding. A device whose queue runs empty holds its last voltage.
    ///
    /// # Errors
    /// If a voltage is not finite or out of range. Then nothing of the block is applied, nothing is
    /// clamped, and the device continues as if the call had not been made. Other errors depend on
    /// the device; the samples in `measured` remain valid.
    fn exchange(&mut self, drive_v: &[f64], measured: &mut Vec<Sample>) -> Result<usize, Self::Error>;

    /// Compares the device's clock with this computer's clock, for the present or the last run.
    ///
    /// `None` if the device has no clock of its own, or if no measurement exists yet.
    fn clock(&self) -> Option<ClockFit> {
        None
    }

    /// Brings the drive to the rest voltage and waits for `seconds`; the next sample begins a new segment.
    ///
    /// # Errors
    /// If the duration is negative or not finite, or if the device is lost.
    fn rest(&mut self, seconds: f64) -> Result<(), Self::Error>;

    /// Stops the sample clock with the drive at the rest voltage. Has no effect on a stopped device.
    ///
    /// # Errors
    /// If the device is lost. Its drive may then still be on.
    fn stop(&mut self) -> Result<(), Self::Error>;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn range_includes_its_ends_and_refuses_values_that_are_not_finite() {
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
