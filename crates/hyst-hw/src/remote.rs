//! A device at the other end of a line: its connection, and the commands outside a run.

mod can;
mod clock;
mod daq;
mod error;
mod interfaces;
mod line;
mod link;
mod options;
mod retransmit;
mod run;
mod serial;
mod slcan;
#[cfg(target_os = "linux")]
mod socketcan;
mod tcp;

use std::time::Duration;

use crate::daq::{Capabilities, OutputUnit, VoltageRange};
use crate::wire::{
    Ask, Chunk, Fault, Identity, MOST_CHUNK, MOST_DRIVES, Mode, PROTOCOL, Refusal, State, Status, Tell, Unit, model_sum,
};

use clock::Clock;
use link::{Link, Timing};
use run::Run;

pub use can::{Bus, CanLine, FROM_DEVICE, TO_DEVICE};
pub use error::RemoteError;
pub use interfaces::{Interface, interfaces};
pub use line::Line;
pub use options::RemoteOptions;
pub use serial::{OpenError, Port, Serial, ports};
pub use slcan::Slcan;
#[cfg(target_os = "linux")]
pub use socketcan::{SocketCan, SocketCanError};
pub use tcp::Tcp;

/// Time in which a device must come to rest, in addition to its ramp.
const REST_TIMEOUT: Duration = Duration::from_secs(20);

/// A device at the other end of a line.
#[derive(Debug)]
pub struct Remote<L> {
    link: Link<L>,
    options: RemoteOptions,
    identity: Identity,
    capabilities: Capabilities,
    run: Option<Run>,
    /// Clock comparison of the present or the last run.
    clock: Option<Clock>,
    present_v: f64,
    /// Slew rate of the next run, set by [`gentle`](Remote::gentle) \[V/s\].
    gentle: f64,
}

impl<L: Line> Remote<L> {
    /// Opens the device at the other end of `line`; messages call the line `name`.
    ///
    /// # Errors
    /// If there is no answer, or if the device uses another version of the protocol.
    pub fn open(line: L, name: impl Into<String>, options: RemoteOptions) -> Result<Self, RemoteError> {
        let mut remote = Self::unconnected(line, name.into(), options);
        match remote.ask(Ask::Hello)? {
            Tell::Version(PROTOCOL) => {}
            Tell::Version(device) => return Err(RemoteError::Version { line: remote.link.name, device }),
            _ => return Err(remote.link.unexpected_answer()),
        }
        let Tell::Identity(identity) = remote.ask(Ask::Describe)? else { return Err(remote.link.unexpected_answer()) };
        remote.capabilities = capabilities(&identity, &remote.link.name);
        remote.identity = identity;
        // The present output may differ from the rest voltage.
        remote.status()?;
        Ok(remote)
    }

    /// Returns the connection before the first request.
    fn unconnected(line: L, name: String, options: RemoteOptions) -> Self {
        let no_device = Identity {
            name: heapless::Vec::new(),
            min_v: 0.0,
            max_v: 0.0,
            rest_v: 0.0,
            max_slew_v_per_s: 0.0,
            min_rate_hz: 0.0,
            max_rate_hz: 0.0,
            output: Unit::Micrometre,
            temperature: false,
            load: false,
            follows: false,
            queue: 0,
            model: 0,
        };
        Self {
            link: Link::new(line, name, options.session),
            options,
            capabilities: capabilities(&no_device, "nobody"),
            identity: no_device,
            run: None,
            clock: None,
            present_v: 0.0,
            gentle: f64::INFINITY,
        }
    }

    /// Returns name, ranges and abilities of the device.
    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// Returns the line.
    pub fn line_mut(&mut self) -> &mut L {
        &mut self.link.line
    }

    /// Uploads a model, with which the device follows references.
    ///
    /// # Errors
    /// If the device has no room for the model, cannot run it, or is lost.
    pub fn upload(&mut self, block: &[u8]) -> Result<(), RemoteError> {
        let (total, sum) = (block.len() as u32, model_sum(block));
        let mut offset = 0;
        // Every part makes progress on a sound device. The bound ends the upload on a faulty one.
        for _ in 0..=2 * block.len().div_ceil(MOST_CHUNK) {
            let end = block.len().min(offset as usize + MOST_CHUNK);
            let bytes = block[offset as usize..end].iter().copied().collect();
            match self.ask(Ask::Model(Chunk { offset, total, sum, bytes }))? {
                Tell::ModelBytes(have) if have >= total => return Ok(()),
                Tell::ModelBytes(have) => offset = have,
                Tell::Refused(Refusal::ModelGap, _) => offset = 0,
                Tell::Refused(refusal, _) => return Err(self.refused(refusal)),
                _ => return Err(self.link.unexpected_answer()),
            }
        }
        Err(self.link.unexpected_answer())
    }

    /// Asks the device for its state. This changes nothing and does not reset the watchdog of a run.
    ///
    /// # Errors
    /// If the device is lost.
    pub fn status(&mut self) -> Result<Status, RemoteError> {
        self.ask_status(Ask::Status)
    }

    /// Makes the device only measure in the following runs: it ignores the drives and holds its output.
    pub fn observe(&mut self) {
        self.options.mode = Mode::Nothing;
    }

    /// Limits drives and ramps of the next run to this slew rate \[V/s\].
    ///
    /// The ramp to rest after a fault has the same limit. A slew limit in the options has priority.
    pub fn gentle(&mut self, slew_v_per_s: f64) {
        self.gentle = slew_v_per_s;
    }

    /// Returns the slew limit of a run \[V/s\].
    fn slew(&self) -> f64 {
        let most = f64::from(self.identity.max_slew_v_per_s);
        self.options.slew_v_per_s.unwrap_or(most.min(self.gentle))
    }

    /// Uploads a controller; from then on, drives are references \[output unit\] that the device follows.
    ///
    /// `recipe` is a [`recipe_head`](crate::wire::recipe_head), followed by the block of a model. References are
    /// between `low` and `high`. The ramps before and after a run begin and end at the present output.
    ///
    /// # Errors
    /// If the device cannot follow references, has no room for the model, cannot run it, or is lost.
    pub fn follow(&mut self, recipe: &[u8], (low, high): (f64, f64)) -> Result<(), RemoteError> {
        if self.run.is_some() {
            return Err(RemoteError::Order);
        }
        self.upload(recipe)?;
        self.options.mode = Mode::Reference;
        // The device is at rest; the answer to a stop request contains its output.
        let output = f64::from(self.ask_status(Ask::Stop)?.output);
        self.capabilities.voltage = VoltageRange { min_v: low.min(output), max_v: high.max(output), rest_v: output };
        Ok(())
    }

    /// Sends an emergency stop to the device at the other end of `line`, without opening it first.
    ///
    /// # Errors
    /// If there is no answer.
    pub fn stop_at(line: L, name: impl Into<String>, options: RemoteOptions) -> Result<Status, RemoteError> {
        Self::unconnected(line, name.into(), options).ask_status(Ask::Emergency)
    }

    /// Stops the device; it does not start again before [`clear`](Self::clear).
    ///
    /// # Errors
    /// If the device is lost.
    pub fn emergency_stop(&mut self) -> Result<(), RemoteError> {
        self.run = None;
        self.ask_status(Ask::Emergency).map(|_| ())
    }

    /// Clears the present fault of the device and returns it; waits until the device is at rest.
    ///
    /// # Errors
    /// If the device runs, does not come to rest, is lost, or gets another fault meanwhile (for example an emergency
    /// stop). The new fault is not cleared.
    pub fn clear(&mut self) -> Result<Option<Fault>, RemoteError> {
        let first = self.status()?;
        let fault = if let State::Fault(fault) = first.state { Some(fault) } else { None };
        let (mut moved, mut at_v, mut status) = (self.link.line.now(), first.present_v, first);
        loop {
            match (status.state, fault) {
                (State::Idle, _) => return Ok(fault),
                (State::Running, _) => return Err(self.refused(Refusal::State)),
                (State::Fault(now), seen) if seen != Some(now) => {
                    return Err(RemoteError::Standing { line: self.link.name.clone(), fault: now });
                }
                // The slew limit of the ended run is unknown here, so only a standstill counts.
                _ if self.link.since(moved) > REST_TIMEOUT => {
                    return Err(RemoteError::Restless {
                        line: self.link.name.clone(),
                        seconds: REST_TIMEOUT.as_secs_f64(),
                    });
                }
                (State::Fault(now), _) if status.present_v == self.identity.rest_v => {
                    return self.ask_status(Ask::Clear(now)).map(|_| fault);
                }
                (State::Fault(_) | State::Stopping, _) => self.link.line.pause(Duration::from_millis(20)),
            }
            status = self.status()?;
            if status.present_v != at_v {
                (moved, at_v) = (self.link.line.now(), status.present_v);
            }
        }
    }

    /// Returns the time without an answer after which the device counts as lost.
    ///
    /// At least four sample periods.
    fn answer_timeout(&self) -> Duration {
        let periods = self.run.map_or(0.0, |run| 4.0 / run.rate_hz);
        self.options.lost.max(Duration::from_secs_f64(periods.min(1e4)))
    }

    fn refused(&self, refusal: Refusal) -> RemoteError {
        RemoteError::Refused { line: self.link.name.clone(), refusal }
    }

    /// Sends a request whose answer is a status.
    fn ask_status(&mut self, ask: Ask) -> Result<Status, RemoteError> {
        match self.ask(ask)? {
            Tell::Status(status) => {
                self.present_v = f64::from(match self.options.mode {
                    Mode::Voltage | Mode::Nothing => status.present_v,
                    Mode::Reference => status.output,
                });
                Ok(status)
            }
            Tell::Refused(Refusal::State, Status { state: State::Fault(fault), .. }) => {
                Err(RemoteError::Standing { line: self.link.name.clone(), fault })
            }
            Tell::Refused(refusal, _) => Err(self.refused(refusal)),
            _ => Err(self.link.unexpected_answer()),
        }
    }

    /// Sends a request, repeatedly if necessary, and returns the answer.
    fn ask(&mut self, ask: Ask) -> Result<Tell, RemoteError> {
        let timing = Timing {
            repeat: self.options.repeat,
            silence: Duration::from_secs_f64(self.options.silence_s),
            lost: self.answer_timeout(),
        };
        self.link.ask(ask, timing)
    }
}

fn capabilities(identity: &Identity, line: &str) -> Capabilities {
    Capabilities {
        device: format!("{} at {line}", String::from_utf8_lossy(&identity.name)),
        voltage: VoltageRange {
            min_v: f64::from(identity.min_v),
            max_v: f64::from(identity.max_v),
            rest_v: f64::from(identity.rest_v),
        },
        max_slew_v_per_s: f64::from(identity.max_slew_v_per_s),
        min_rate_hz: f64::from(identity.min_rate_hz),
        max_rate_hz: f64::from(identity.max_rate_hz),
        max_block: MOST_DRIVES,
        output: match identity.output {
            Unit::Micrometre => OutputUnit::Micrometre,
            Unit::Nanometre => OutputUnit::Nanometre,
            Unit::Millimetre => OutputUnit::Millimetre,
            Unit::Newton => OutputUnit::Newton,
        },
        temperature: identity.temperature,
        load: identity.load,
        queued: true,
    }
}

#[cfg(test)]
mod tests;
