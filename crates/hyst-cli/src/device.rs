//! The device that an argument names, whichever kind it is.

use std::time::{SystemTime, UNIX_EPOCH};

use hyst_hw::wire::Fault;
use hyst_hw::{
    CanLine, Capabilities, ClockFit, Daq, FROM_DEVICE, Line, Plant, PlantError, Remote, RemoteError, RemoteOptions,
    Sample, Serial, Slcan, TO_DEVICE, Tcp,
};

use crate::cli::Device;
use crate::exit::{Classified, CommandError, CommandResult, Exit};
use crate::host::{self, HostDaq, HostDaqError};
use crate::input;

/// A device of any kind.
pub(crate) enum AnyDevice {
    Plant(Box<Plant>),
    /// At the other end of a line.
    Remote(Box<Remote<Box<dyn Line>>>),
    /// Of the program that runs the command.
    Host(Box<dyn HostDaq>),
}

/// What any of them may say.
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

/// What a run may be told beyond its drive.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Wishes {
    /// Seed of a simulated plant's noise.
    pub(crate) noise: Option<u64>,
    /// Lowest and highest voltage \[V\].
    pub(crate) voltage: Option<(f64, f64)>,
    /// Steepest slope \[V/s\].
    pub(crate) slew_v_per_s: Option<f64>,
    /// Whether the device estimates the external force.
    pub(crate) force: bool,
    /// Silence of this computer after which the device comes to rest \[s\].
    pub(crate) silence_s: Option<f64>,
    /// Highest temperature \[°C\].
    pub(crate) hottest_degc: Option<f64>,
    /// Greatest tracking error \[output unit\].
    pub(crate) error: Option<f64>,
}

impl AnyDevice {
    /// Opens it. Nothing moves by that.
    pub(crate) fn open(device: &Device, wishes: &Wishes) -> CommandResult<Self> {
        if let Device::Simulated(described) = device {
            return Ok(Self::Plant(Box::new(input::plant(described, wishes.noise)?)));
        }
        if *device == Device::Host {
            return host::daq().map(Self::Host).ok_or_else(|| CommandError::bad_input(NO_HOST));
        }
        let lost = |error: RemoteError| CommandError::from(DeviceError::from(error));
        let (line, name) = line(device)?;
        let remote = Remote::open(line, name, options(wishes)).map_err(lost)?;
        Ok(Self::Remote(Box::new(remote)))
    }

    /// Clears the fault of an earlier run, and gives it.
    pub(crate) fn clear(&mut self) -> Result<Option<Fault>, DeviceError> {
        match self {
            // It begins with the command that plays it.
            Self::Plant(_) | Self::Host(_) => Ok(None),
            Self::Remote(remote) => Ok(remote.clear()?),
        }
    }

    /// The device at the other end of a line.
    pub(crate) fn remote(&mut self) -> Option<&mut Remote<Box<dyn Line>>> {
        match self {
            Self::Plant(_) | Self::Host(_) => None,
            Self::Remote(remote) => Some(remote),
        }
    }

    /// Lets it come to rest and stay there, without a word before; gives its name and what it put out then \[V\].
    pub(crate) fn emergency_stop(device: &Device) -> CommandResult<(String, f64)> {
        let (line, name) = line(device)?;
        let status = Remote::stop_at(line, name.clone(), options(&Wishes::default()));
        Ok((name, f64::from(status.map_err(DeviceError::from)?.present_v)))
    }
}

/// How a device is talked to.
fn options(wishes: &Wishes) -> RemoteOptions {
    // No two runs have the same number, so that a late request of one does nothing to another.
    let clock = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos());
    let session = (clock ^ (clock >> 32)) as u32 ^ std::process::id().rotate_left(16);
    let usual = RemoteOptions::with_session(session);
    RemoteOptions {
        voltage: wishes.voltage,
        slew_v_per_s: wishes.slew_v_per_s,
        silence_s: wishes.silence_s.unwrap_or(usual.silence_s),
        hottest_degc: wishes.hottest_degc.unwrap_or(f64::INFINITY),
        error: wishes.error.unwrap_or(f64::INFINITY),
        force: wishes.force,
        ..usual
    }
}

const NO_HOST: &str = "the device of the program that runs the command can only be played, by one command at a time";

/// The line to a device, and what it is called.
fn line(device: &Device) -> CommandResult<(Box<dyn Line>, String)> {
    let port = |port: &str, baud| Serial::open(port, baud).map_err(|error| CommandError::new(Exit::DeviceLost, error));
    let gone = |message: String| CommandError::new(Exit::DeviceLost, anyhow::anyhow!("{message}"));
    let (line, name): (Box<dyn Line>, &String) = match device {
        Device::Simulated(_) => {
            return Err(CommandError::bad_input(
                "a simulated plant runs in the command that plays it; press Ctrl-C there",
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
                gone(format!("{address}: nobody answers: {error}; is the simulator or the bridge running?"))
            })?;
            (Box::new(line), address)
        }
    };
    Ok((line, name.clone()))
}

/// The device on the bus behind an interface.
#[cfg(target_os = "linux")]
fn can(interface: &str, fd: bool) -> CommandResult<Box<dyn Line>> {
    let bus = hyst_hw::SocketCan::open(interface, fd).map_err(|error| CommandError::new(Exit::DeviceLost, error))?;
    bus.hear_only(FROM_DEVICE).map_err(|error| CommandError::new(Exit::DeviceLost, error))?;
    Ok(Box::new(CanLine::new(bus, TO_DEVICE, FROM_DEVICE, fd)))
}

/// Other systems have no interfaces for CAN.
#[cfg(not(target_os = "linux"))]
fn can(interface: &str, _fd: bool) -> CommandResult<Box<dyn Line>> {
    let advice = "can: devices need Linux; an adapter at a serial port works here too (slcan:PORT)";
    Err(CommandError::new(Exit::BadInput, anyhow::anyhow!("{interface}: {advice}")))
}

impl AnyDevice {
    /// Lets the device only measure: what it is given is not put out.
    pub(crate) fn observe(&mut self) {
        match self {
            // It is given the voltage at which it rests.
            Self::Plant(_) | Self::Host(_) => {}
            Self::Remote(remote) => remote.observe(),
        }
    }

    /// Lets the device come to rest no steeper than this \[V/s\], where no slew was wished for.
    pub(crate) fn gentle(&mut self, slew_v_per_s: f64) {
        match self {
            // It is gone with the command that plays it.
            Self::Plant(_) => {}
            Self::Host(daq) => daq.gentle(slew_v_per_s),
            Self::Remote(remote) => remote.gentle(slew_v_per_s),
        }
    }

    /// Lets the device follow references with this controller; drives are references from then on.
    pub(crate) fn follow(&mut self, recipe: &[u8], range: (f64, f64)) -> Result<(), CommandError> {
        match self {
            // They have no controller, and need none: what they measure comes at once.
            Self::Plant(_) | Self::Host(_) => Ok(()),
            Self::Remote(remote) => Ok(remote.follow(recipe, range).map_err(DeviceError::from)?),
        }
    }
}

/// The same call on whichever it is.
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
