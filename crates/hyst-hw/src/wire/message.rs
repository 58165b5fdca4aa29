//! What host and device say to each other.
//!
//! The host asks, the device answers; each request has a number, which its answer repeats. Everything that moves is numbered
//! from the start of a run: drive `k` of the run, sample `k` that was measured with it. A request that is lost, comes twice or
//! comes late therefore does no harm: the host asks again, and what the device has had already it passes over. To stop needs no number
//! of a run, so that anybody may: a late request for it ends at rest what it was not meant for.

use core::fmt;

use heapless::Vec;
use serde::{Deserialize, Serialize};

/// Version of these messages. A host and a device of different ones do not talk.
pub const PROTOCOL: u16 = 2;
/// Most drives in a request.
pub const MOST_DRIVES: usize = 64;
/// Most samples in an answer.
pub const MOST_SAMPLES: usize = 17;
/// Most bytes of a name.
pub const MOST_NAME: usize = 32;
/// Most bytes of a model in a request.
pub const MOST_CHUNK: usize = 256;

/// A request.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Request {
    /// The answer repeats it.
    pub number: u32,
    /// What is asked.
    pub ask: Ask,
}

/// What a host asks for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Ask {
    /// Which version is spoken. This request and its answer are the same in every version.
    Hello,
    /// What the device is and can do.
    Describe,
    /// To be driven: the clock starts, the output stays where it is.
    Start(Start),
    /// To take drives and to give samples.
    Exchange(Exchange),
    /// To come to rest, within the slew limit.
    Stop,
    /// To come to rest, and not to start again before the fault is cleared.
    Emergency,
    /// To forget this fault, once at rest: who has seen another one does not know why it stands.
    Clear(Fault),
    /// To take a part of a model.
    Model(Chunk),
    /// How it stands.
    Status,
}

/// How a run is to be done.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Start {
    /// Chosen by the host, another one for each run: requests of an older run are refused.
    pub session: u32,
    /// Whether drives are voltages, or references that the device follows.
    pub mode: Mode,
    /// Samples a second \[Hz\].
    pub rate_hz: f32,
    /// Lowest voltage \[V\].
    pub low_v: f32,
    /// Highest voltage \[V\].
    pub high_v: f32,
    /// Steepest slope \[V/s\].
    pub slew_v_per_s: f32,
    /// Highest temperature \[°C\].
    pub hottest_degc: f32,
    /// Greatest tracking error \[output unit\]; of no account where voltages are driven.
    pub error: f32,
    /// Silence of the host after which the device comes to rest \[s\].
    pub silence_s: f32,
    /// Whether the external force is estimated, by the observer of the model that was handed over.
    pub force: bool,
}

/// What a drive is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Mode {
    /// A voltage \[V\].
    Voltage,
    /// A reference \[output unit\], which the device follows with its model and its loop.
    Reference,
    /// Nothing: each asks for a sample, and the output stays where it is.
    Nothing,
}

/// A piece of drive, and how much has been heard of the samples.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Exchange {
    /// The run.
    pub session: u32,
    /// Samples that the host has: the answer goes on from there.
    pub heard: u32,
    /// Number of the first drive.
    pub first: u32,
    /// The drives.
    pub drives: Vec<f32, MOST_DRIVES>,
}

/// A part of a model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Chunk {
    /// Where it begins.
    pub offset: u32,
    /// Bytes of the whole model.
    pub total: u32,
    /// Their [check sum](model_sum): parts of two models are not put together.
    pub sum: u32,
    /// Its bytes.
    pub bytes: Vec<u8, MOST_CHUNK>,
}

/// CRC-32C (Castagnoli) of a model. Another polynomial than that of the sums at its parts' ends: over bytes that end with their own sum a CRC is the same
/// whatever the bytes are.
pub fn model_sum(bytes: &[u8]) -> u32 {
    crc::Crc::<u32>::new(&crc::CRC_32_ISCSI).checksum(bytes)
}

/// An answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Reply {
    /// Of the request.
    pub number: u32,
    /// What is answered.
    pub tell: Tell,
}

/// What a device answers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[allow(clippy::large_enum_variant, reason = "no heap: there is nothing to box it in")]
pub enum Tell {
    /// The version that is spoken.
    Version(u16),
    /// What it is and can do.
    Identity(Identity),
    /// How it stands.
    Status(Status),
    /// How it stands, and what it has measured.
    Samples {
        /// How it stands.
        status: Status,
        /// Number of the first sample.
        first: u32,
        /// The samples.
        samples: Vec<Measured, MOST_SAMPLES>,
    },
    /// How much of the model it has.
    ModelBytes(u32),
    /// That it does not do what was asked, and why; how it stands.
    Refused(Refusal, Status),
}

/// What a device is and can do.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Identity {
    /// What it calls itself, in UTF-8.
    pub name: Vec<u8, MOST_NAME>,
    /// Lowest voltage \[V\].
    pub min_v: f32,
    /// Highest voltage \[V\].
    pub max_v: f32,
    /// Voltage at rest \[V\].
    pub rest_v: f32,
    /// Steepest slope \[V/s\].
    pub max_slew_v_per_s: f32,
    /// Slowest clock \[Hz\].
    pub min_rate_hz: f32,
    /// Fastest clock \[Hz\].
    pub max_rate_hz: f32,
    /// Unit of the output.
    pub output: Unit,
    /// Whether it measures a temperature.
    pub temperature: bool,
    /// Whether it measures a load.
    pub load: bool,
    /// Whether it follows references.
    pub follows: bool,
    /// Drives that it can hold.
    pub queue: u32,
    /// Most bytes of a model.
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

/// How a device stands.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Status {
    /// What it does.
    pub state: State,
    /// The run, if there is or was one.
    pub session: u32,
    /// Periods of the clock since the run began.
    pub tick: u32,
    /// What it puts out \[V\].
    pub present_v: f32,
    /// What the sensor shows, in the device's unit.
    pub output: f32,
    /// Drives that it has had, without a gap, from the beginning of the run.
    pub received: u32,
    /// Number of the first drive for which it has no room.
    pub room: u32,
    /// Samples that it has measured.
    pub measured: u32,
}

/// What a device does.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum State {
    /// Nothing: the output stands at rest.
    Idle,
    /// A run: it plays what it is given, and holds the last of it.
    Running,
    /// It comes to rest.
    Stopping,
    /// It comes to rest or stands there; a fault has to be cleared before the next run.
    Fault(Fault),
}

/// Why a device ended a run by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Fault {
    /// Nothing was heard of the host for as long as the run allows.
    Silence,
    /// The host asked for it.
    Emergency,
    /// The temperature is too high.
    Temperature,
    /// A sensor shows what is no number.
    Sensor,
    /// The output is further from the reference than the run allows.
    TrackingError,
    /// The drive that the reference asks for lies beyond the limits, and has for too long.
    Saturation,
}

impl Fault {
    /// Number for logs.
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
                "the host was silent for longer than the run allows; look at the line and at what kept the host busy"
            }
            Self::Emergency => "an emergency stop was asked for",
            Self::Temperature => "the temperature is above the limit of the run; let it cool or raise the limit",
            Self::Sensor => "a sensor shows no number: it is past the end of its range, as where a loop oscillates, or its cable is out",
            Self::TrackingError => {
                "the output is further from the reference than the run allows; look for what holds the actuator"
            }
            Self::Saturation => {
                "the drive stands at a limit and the output stays away from its reference; shrink or shift the reference, or look for what holds the actuator"
            }
        })
    }
}

/// What a device does not do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Refusal {
    /// It is in another state than the request needs.
    State,
    /// The request is of another run.
    Session,
    /// A value of the start is out of the device's range.
    Start(Field),
    /// A drive is out of range or no number: none of the request was taken.
    Drive(u32),
    /// It has no model, and follows no reference without one.
    NoModel,
    /// The model has more bytes than there is room for.
    ModelSize,
    /// A part of the model begins beyond what has come so far.
    ModelGap,
    /// The bytes are no model that it can run.
    Model,
}

/// A value of a start.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Field {
    /// The rate.
    Rate,
    /// The voltage limits.
    Voltage,
    /// The slew limit.
    Slew,
    /// The silence.
    Silence,
    /// The temperature limit.
    Temperature,
    /// The greatest tracking error.
    Error,
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::State => "the device is busy with another run, or on its way to rest: stop that one, or wait and look (hystctl status)",
            Self::Session => "the device is in another run, or was started anew: begin again",
            Self::Start(Field::Rate) => "the device cannot run at this rate",
            Self::Start(Field::Voltage) => "the voltage limits are not within the device's own",
            Self::Start(Field::Slew) => "the slew limit is not positive, or above the device's own",
            Self::Start(Field::Silence) => "the silence that is allowed has to be positive, and a minute at most",
            Self::Start(Field::Temperature) => "the temperature limit is no number",
            Self::Start(Field::Error) => "the greatest tracking error has to be positive",
            Self::Drive(k) => {
                return write!(f, "drive {k} of the run is out of range; nothing of its block was applied");
            }
            Self::NoModel => "the device has no model to follow a reference with: upload one first",
            Self::ModelSize => "the model is larger than the device has room for",
            Self::ModelGap => "a part of the model was lost: send it again",
            Self::Model => "the device cannot run this model: its kind, its size or its version is another one",
        })
    }
}

/// One instant of a run.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// Period of the clock, from the beginning of the run.
    pub tick: u32,
    /// What was put out \[V\].
    pub drive_v: f32,
    /// The output.
    pub output: f32,
    /// Temperature \[°C\]; of no account where the device has none.
    pub temperature_degc: f32,
    /// Load \[N\]; of no account where the device has none.
    pub load_n: f32,
    /// Force that was estimated on the device \[N\], where it has a force observer.
    pub force_n: Option<f32>,
}
