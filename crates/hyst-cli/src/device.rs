//! Devices of all kinds, as the argument `--daq` names them.

use std::time::{SystemTime, UNIX_EPOCH};

use hyst_hw::wire::Fault;
use hyst_hw::{
    CanLine, Capabilities, ClockFit, Daq, FROM_DEVICE, Line, Plant, PlantError, Remote, RemoteError, RemoteOptions,
    Sample, Serial, Slcan, TO_DEVICE, Tcp,
};

use crate::cli::Device;
use crate::exit::{Classified, CommandError, CommandResult, Exit};
use crate::hosted::{self, HostDaq, HostDaqError};
use crate::input;

/// A device of any kind.
pub(crate) enum AnyDevice {
    /// A simulated plant.
    Plant(Box<Plant>),
    /// A device at the other end of a line.
    Remote(Box<Remote<Box<dyn Line>>>),
    /// A device of the program that runs the command.
    Host(Box<dyn HostDaq>),
}

/// Error of a device.
#[derive(Debug, thiserror::Error)]
pub(crate) enum DeviceError {
    #[error(transparent)]
    Plant(#[from] PlantError),
    #[error(transparent)]
    Remote(#[from] RemoteError),
    #[error(transparent)]
    Host(#[from] HostDaqError),
}

impl Classified for DeviceError {
    fn exit(&self) -> Exit {
        match self {
            Self::Plant(error) => error.exit(),
            Self::Remote(
                RemoteError::Standing { .. }
                | RemoteError::Refused { .. }
                | RemoteError::Value { .. }
                | RemoteError::Rate { .. }
                | RemoteError::Version { .. },
            ) => Exit::BadInput,
            Self::Remote(_) => Exit::DeviceLost,
            Self::Host(error) => error.exit(),
        }
    }
}

/// Options of a device; `None` selects its default.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct DeviceOptions {
    /// Seed of the noise of a simulated plant.
    pub(crate) noise: Option<u64>,
    /// Minimum and maximum voltage \[V\].
    pub(crate) voltage: Option<(f64, f64)>,
    /// Maximum slope \[V/s\].
    pub(crate) slew_v_per_s: Option<f64>,
    /// Whether the device estimates the external force.
    pub(crate) force: bool,
    /// Timeout of the watchdog: the device ramps to rest after this time without a message \[s\].
    pub(crate) silence_s: Option<f64>,
    /// Maximum temperature \[°C\].
    pub(crate) hottest_degc: Option<f64>,
    /// Maximum tracking error \[output unit\].
    pub(crate) error: Option<f64>,
}

impl AnyDevice {
    /// Opens a device. Nothing moves.
    pub(crate) fn open(device: &Device, options: &DeviceOptions) -> CommandResult<Self> {
        if let Device::Simulated(file) = device {
            return Ok(Self::Plant(Box::new(input::plant(file, options.noise)?)));
        }
        if *device == Device::Host {
            return hosted::daq().map(Self::Host).ok_or_else(|| CommandError::bad_input(NO_HOST));
        }
        let lost = |error: RemoteError| CommandError::from(DeviceError::from(error));
        let (line, name) = line(device)?;
        let remote = Remote::open(line, name, remote_options(options)).map_err(lost)?;
        Ok(Self::Remote(Box::new(remote)))
    }

    /// Clears the fault of an earlier run and returns it.
    pub(crate) fn clear(&mut self) -> Result<Option<Fault>, DeviceError> {
        match self {
            // These devices start with the command and have no earlier fault.
            Self::Plant(_) | Self::Host(_) => Ok(None),
            Self::Remote(remote) => Ok(remote.clear()?),
        }
    }

    /// Returns the device if it is at the other end of a line.
    pub(crate) fn remote(&mut self) -> Option<&mut Remote<Box<dyn Line>>> {
        match self {
            Self::Plant(_) | Self::Host(_) => None,
            Self::Remote(remote) => Some(remote),
        }
    }

    /// Stops a device without opening a session; returns its name and the voltage at that time \[V\].
    pub(crate) fn emergency_stop(device: &Device) -> CommandResult<(String, f64)> {
        let (line, name) = line(device)?;
        let status = Remote::stop_at(line, name.clone(), remote_options(&DeviceOptions::default()));
        Ok((name, f64::from(status.map_err(DeviceError::from)?.present_v)))
    }
}

/// Returns the options of a remote device, with a new session number.
fn remote_options(options: &DeviceOptions) -> RemoteOptions {
    // Each run has its own number, so that a late request of one run does not act on another.
    let clock = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos());
    let session = (clock ^ (clock >> 32)) as u32 ^ std::process::id().rotate_left(16);
    let defaults = RemoteOptions::with_session(session);
    RemoteOptions {
        voltage: options.voltage,
        slew_v_per_s: options.slew_v_per_s,
        silence_s: options.silence_s.unwrap_or(defaults.silence_s),
        hottest_degc: options.hottest_degc.unwrap_or(f64::INFINITY),
        error: options.error.unwrap_or(f64::INFINITY),
        force: options.force,
        ..defaults
    }
}

const NO_HOST: &str = "the device of the calling program can only be played, and only by one command at a time";

/// Opens the line to a device; returns it with the name of the device.
fn line(device: &Device) -> CommandResult<(Box<dyn Line>, String)> {
    let port = |port: &str, baud| Serial::open(port, baud).map_err(|error| CommandError::new(Exit::DeviceLost, error));
    let gone = |message: String| CommandError::new(Exit::DeviceLost, anyhow::anyhow!("{message}"));
    let (line, name): (Box<dyn Line>, &String) = match device {
        Device::Simulated(_) => {
            return Err(CommandError::bad_input(
                "a simulated plant runs inside the command that plays it; press Ctrl-C in that command",
            ));
        }
        Device::Host => return Err(CommandError::bad_input(NO_HOST)),
        Device::Serial { port: name, baud } => (Box::new(port(name, *baud)?), name),
        Device::Slcan { port: name, baud, bits_per_s } => {
            let bus = Slcan::open(port(name, *baud)?, *bits_per_s)
                .map_err(|error| gone(format!("{name}: the CAN adapter cannot be opened: {error}")))?;
            (Box::new(CanLine::new(bus, TO_DEVICE, FROM_DEVICE, false)), name)
        }
        Device::Can { interface, fd } => (can(interface, *fd)?, interface),
        Device::Tcp(address) => {
            let line = Tcp::connect(address).map_err(|error| {
                gone(format!("{address}: no connection: {error}; check that the simulator or bridge is running"))
            })?;
            (Box::new(line), address)
        }
    };
    Ok((line, name.clone()))
}

/// Opens the line to the device on the CAN bus of an interface.
#[cfg(target_os = "linux")]
fn can(interface: &str, fd: bool) -> CommandResult<Box<dyn Line>> {
    let bus = hyst_hw::SocketCan::open(interface, fd).map_err(|error| CommandError::new(Exit::DeviceLost, error))?;
    bus.hear_only(FROM_DEVICE).map_err(|error| CommandError::new(Exit::DeviceLost, error))?;
    Ok(Box::new(CanLine::new(bus, TO_DEVICE, FROM_DEVICE, fd)))
}

/// Refuses CAN interfaces, which only Linux has.
#[cfg(not(target_os = "linux"))]
fn can(interface: &str, _fd: bool) -> CommandResult<Box<dyn Line>> {
    let advice = "can: devices need Linux; on this system use an adapter at a serial port (slcan:PORT)";
    Err(CommandError::new(Exit::BadInput, anyhow::anyhow!("{interface}: {advice}")))
}

impl AnyDevice {
    /// Makes the device measure only; it ignores the drive.
    pub(crate) fn observe(&mut self) {
        match self {
            // The drive of these devices is their rest voltage.
            Self::Plant(_) | Self::Host(_) => {}
            Self::Remote(remote) => remote.observe(),
        }
    }

    /// Limits the slope of the ramp to rest \[V/s\], unless the options of the device have a slope.
    pub(crate) fn gentle(&mut self, slew_v_per_s: f64) {
        match self {
            // The plant ends with the command.
            Self::Plant(_) => {}
            Self::Host(daq) => daq.gentle(slew_v_per_s),
            Self::Remote(remote) => remote.gentle(slew_v_per_s),
        }
    }

    /// Loads a controller into the device; the drives of later calls are references.
    pub(crate) fn follow(&mut self, recipe: &[u8], range: (f64, f64)) -> Result<(), CommandError> {
        match self {
            // These devices need no controller: their measurements arrive without delay.
            Self::Plant(_) | Self::Host(_) => Ok(()),
            Self::Remote(remote) => Ok(remote.follow(recipe, range).map_err(DeviceError::from)?),
        }
    }
}

/// Makes the same call on each kind of device.
macro_rules! each {
    ($device:expr, $it:ident => $call:expr) => {
        match $device {
            AnyDevice::Plant($it) => $call,
            AnyDevice::Remote($it) => $call,
            AnyDevice::Host($it) => $call,
        }
    };
}

impl Daq for AnyDevice {
    type Error = DeviceError;

    fn capabilities(&self) -> &Capabilities {
        each!(self, it => it.capabilities())
    }
    fn present_v(&self) -> f64 {
        each!(self, it => it.present_v())
    }
    fn start(&mut self, rate_hz: f64) -> Result<f64, DeviceError> {
        each!(self, it => Ok(it.start(rate_hz)?))
    }
    fn exchange(&mut self, drive_v: &[f64], measured: &mut Vec<Sample>) -> Result<usize, DeviceError> {
        each!(self, it => Ok(it.exchange(drive_v, measured)?))
    }
    fn clock(&self) -> Option<ClockFit> {
        each!(self, it => it.clock())
    }
    fn rest(&mut self, seconds: f64) -> Result<(), DeviceError> {
        each!(self, it => Ok(it.rest(seconds)?))
    }
    fn stop(&mut self) -> Result<(), DeviceError> {
        each!(self, it => Ok(it.stop()?))
    }
}
