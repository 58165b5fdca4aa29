//! Requests of the host and answers of the device.
//!
//! The host sends requests, the device answers. The answer repeats the number of its request. Drives and samples are
//! numbered from the start of a run; sample `k` is measured with drive `k`. So lost, duplicated and late requests do no
//! harm: the host repeats a request, and the device ignores drives that it already has. A stop request does not contain
//! the number of the run, so that every host may stop the device. A late stop request therefore also stops a newer run.

use core::fmt;

use heapless::Vec;
use serde::{Deserialize, Serialize};

/// Version of these messages. Host and device must have the same version.
pub const PROTOCOL: u16 = 2;
/// Maximum number of drives in a request.
pub const MOST_DRIVES: usize = 64;
/// Maximum number of samples in an answer.
pub const MOST_SAMPLES: usize = 17;
/// Maximum length of a name (bytes).
pub const MOST_NAME: usize = 32;
/// Maximum number of bytes of a model in a request.
pub const MOST_CHUNK: usize = 256;

/// A request.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Request {
    /// Number of the request, which the answer repeats.
    pub number: u32,
    /// Content of the request.
    pub ask: Ask,
}

/// Content of a request.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Ask {
    /// Asks for the version of the protocol. This request and its answer are the same in every version.
    Hello,
    /// Asks for the identity of the device.
    Describe,
    /// Starts a run: the clock starts, the output does not change.
    Start(Start),
    /// Sends drives and asks for samples.
    Exchange(Exchange),
    /// Ramps to rest within the slew limit.
    Stop,
    /// Ramps to rest; the device does not start again before the fault is cleared.
    Emergency,
    /// Clears this fault at rest. Another fault, which the host has not read, is not cleared.
    Clear(Fault),
    /// Sends a part of a model.
    Model(Chunk),
    /// Asks for the status.
    Status,
}

/// Mode and limits of a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Start {
    /// Number of the run, chosen by the host and different for each run.
    ///
    /// Requests of an older run are refused.
    pub session: u32,
    /// Meaning of the drives.
    pub mode: Mode,
    /// Sample rate \[Hz\].
    pub rate_hz: f32,
    /// Lowest voltage \[V\].
    pub low_v: f32,
    /// Highest voltage \[V\].
    pub high_v: f32,
    /// Slew limit \[V/s\].
    pub slew_v_per_s: f32,
    /// Highest permitted temperature \[°C\].
    pub hottest_degc: f32,
    /// Largest permitted tracking error \[output unit\]; used only with references.
    pub error: f32,
    /// Watchdog time: silence of the host after which the device ramps to rest \[s\].
    pub silence_s: f32,
    /// Whether the device estimates the external force, with the uploaded observer.
    pub force: bool,
}

/// Meaning of the drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Mode {
    /// Voltages \[V\].
    Voltage,
    /// References \[output unit\]; the device follows them with its controller.
    Reference,
    /// None: each drive only requests a sample, and the output does not change.
    Nothing,
}

/// A block of drives, and the number of samples that the host has.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Exchange {
    /// The run.
    pub session: u32,
    /// Number of samples that the host has; the answer continues from there.
    pub heard: u32,
    /// Number of the first drive.
    pub first: u32,
    /// The drives.
    pub drives: Vec<f32, MOST_DRIVES>,
}

/// A part of a model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Chunk {
    /// Position of the part in the model (bytes).
    pub offset: u32,
    /// Length of the whole model (bytes).
    pub total: u32,
    /// [Checksum](model_sum) of the whole model. It prevents a mixture of two models.
    pub sum: u32,
    /// The bytes of the part.
    pub bytes: Vec<u8, MOST_CHUNK>,
}

/// Returns the CRC-32C (Castagnoli) of a model.
///
/// The head and the block of a controller end with their own CRC-32. A second CRC with the same polynomial would not
/// depend on their content, so this one has another polynomial.
pub fn model_sum(bytes: &[u8]) -> u32 {
    crc::Crc::<u32>::new(&crc::CRC_32_ISCSI).checksum(bytes)
}

/// An answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Reply {
    /// Number of the request.
    pub number: u32,
    /// Content of the answer.
    pub tell: Tell,
}

/// Content of an answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[allow(clippy::large_enum_variant, reason = "no heap, so the variant cannot be boxed")]
pub enum Tell {
    /// Version of the protocol.
    Version(u16),
    /// Identity of the device.
    Identity(Identity),
    /// Status of the device.
    Status(Status),
    /// Status of the device, and measured samples.
    Samples {
        /// Status of the device.
        status: Status,
        /// Number of the first sample.
        first: u32,
        /// The samples.
        samples: Vec<Measured, MOST_SAMPLES>,
    },
    /// Number of bytes of the model that the device has.
    ModelBytes(u32),
    /// Reason why the request is refused, and status of the device.
    Refused(Refusal, Status),
}

/// Name, ranges and abilities of a device.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Identity {
    /// Name of the device, in UTF-8.
    pub name: Vec<u8, MOST_NAME>,
    /// Lowest voltage \[V\].
    pub min_v: f32,
    /// Highest voltage \[V\].
    pub max_v: f32,
    /// Voltage at rest \[V\].
    pub rest_v: f32,
    /// Largest slew rate \[V/s\].
    pub max_slew_v_per_s: f32,
    /// Slowest sample clock \[Hz\].
    pub min_rate_hz: f32,
    /// Fastest sample clock \[Hz\].
    pub max_rate_hz: f32,
    /// Unit of the output.
    pub output: Unit,
    /// Whether the device measures a temperature.
    pub temperature: bool,
    /// Whether the device measures a load.
    pub load: bool,
    /// Whether the device can follow references.
    pub follows: bool,
    /// Length of the drive queue.
    pub queue: u32,
    /// Maximum size of a model (bytes).
    pub model: u32,
}

/// Unit of a device's output.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Unit {
    /// Micrometre.
    Micrometre,
    /// Nanometre.
    Nanometre,
    /// Millimetre.
    Millimetre,
    /// Newton.
    Newton,
}

/// Status of a device.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Status {
    /// State of the device.
    pub state: State,
    /// Number of the present or last run.
    pub session: u32,
    /// Periods of the clock since the run began.
    pub tick: u32,
    /// Present output voltage \[V\].
    pub present_v: f32,
    /// Present sensor reading, in the device's unit.
    pub output: f32,
    /// Number of drives received without a gap since the run began.
    pub received: u32,
    /// Number of the first drive for which the device has no room.
    pub room: u32,
    /// Number of measured samples.
    pub measured: u32,
}

/// State of a device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum State {
    /// At rest.
    Idle,
    /// In a run: the device plays the received drives and holds the last one.
    Running,
    /// Ramping to rest.
    Stopping,
    /// Ramping to rest or at rest after a fault, which must be cleared before the next run.
    Fault(Fault),
}

/// Reason why a run ended with a fault.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Fault {
    /// Watchdog: no valid request from the host within the time that the run allows.
    Silence,
    /// Emergency stop.
    Emergency,
    /// The temperature is too high.
    Temperature,
    /// A sensor reading is not a number.
    Sensor,
    /// The tracking error is larger than the run allows.
    TrackingError,
    /// The drive has been at a limit for too long, and the output does not reach the reference.
    Saturation,
}

impl Fault {
    /// Returns the number of the fault, for logs and messages.
    pub const fn code(self) -> u8 {
        match self {
            Self::Silence => 1,
            Self::Emergency => 2,
            Self::Temperature => 3,
            Self::Sensor => 4,
            Self::TrackingError => 5,
            Self::Saturation => 6,
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Silence => {
                "the host was silent for longer than the run allows (--silence); check the line, and what kept the host busy"
            }
            Self::Emergency => "an emergency stop was requested",
            Self::Temperature => {
                "the temperature is above the limit of the run (--hottest); let the actuator cool, or raise the limit"
            }
            Self::Sensor => "a sensor reading is not a number; check its cable, its range, and whether the loop oscillates",
            Self::TrackingError => {
                "the output is further from the reference than the run allows (--max-error); check what blocks the actuator"
            }
            Self::Saturation => {
                "the drive is at a limit and the output does not reach the reference; \
                 reduce or shift the reference, or check what blocks the actuator"
            }
        })
    }
}

/// Reason why a device refuses a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Refusal {
    /// The device is not in the state that the request needs.
    State,
    /// The request belongs to another run.
    Session,
    /// A value of the start request is outside the device's range.
    Start(Field),
    /// A drive is out of range or not a number; no drive of the request was accepted.
    Drive(u32),
    /// The device has no model, which it needs to follow references.
    NoModel,
    /// The model is too large.
    ModelSize,
    /// An earlier part of the model is missing.
    ModelGap,
    /// The device cannot run the model.
    Model,
}

/// A value of a start request.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Field {
    /// Sample rate.
    Rate,
    /// Voltage limits.
    Voltage,
    /// Slew limit.
    Slew,
    /// Watchdog time.
    Silence,
    /// Temperature limit.
    Temperature,
    /// Largest permitted tracking error.
    Error,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::State => "the device is busy with another run, or still ramps to rest: stop that run, or wait; hystctl status prints its state",
            Self::Session => "the device is in another run, or was reset: start the run again",
            Self::Start(Field::Rate) => "the device cannot run at this rate: give another one",
            Self::Start(Field::Voltage) => "the voltage limits are outside the device's range: give other ones (--limit)",
            Self::Start(Field::Slew) => "the slew limit must be above 0 and at most that of the device (--slew)",
            Self::Start(Field::Silence) => "the permitted silence of the host must be above 0 and at most 60 s (--silence)",
            Self::Start(Field::Temperature) => "the temperature limit must be a number (--hottest)",
            Self::Start(Field::Error) => "the largest permitted tracking error must be above 0 (--max-error)",
            Self::Drive(k) => {
                return write!(f, "drive sample {k} of the run is out of range; nothing of its block was applied");
            }
            Self::NoModel => "the device has no model, which it needs to follow references: upload one first",
            Self::ModelSize => "the model is larger than the device has room for: give a smaller one",
            Self::ModelGap => "a part of the model was lost: send it again",
            Self::Model => {
                "the device cannot run this model: its kind, size or version is not supported; \
                 give a model of plays, or update the firmware"
            }
        })
    }
}

/// One sample of a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// Period of the clock, counted from the beginning of the run.
    pub tick: u32,
    /// Applied voltage \[V\].
    pub drive_v: f32,
    /// Measured output, in the device's unit.
    pub output: f32,
    /// Temperature \[°C\]; meaningless if the device does not measure it.
    pub temperature_degc: f32,
    /// Load \[N\]; meaningless if the device does not measure it.
    pub load_n: f32,
    /// Force estimated on the device \[N\], if it has a force observer.
    pub force_n: Option<f32>,
}
