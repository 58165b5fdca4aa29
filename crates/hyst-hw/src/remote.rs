//! A device at the other end of a line, with the interface [`Daq`].

mod can;
mod clock;
mod interfaces;
mod lines;
mod retransmit;
mod slcan;
#[cfg(target_os = "linux")]
mod socketcan;

use std::io;
use std::time::{Duration, Instant};

use crate::daq::{Capabilities, Daq, OutputUnit, Sample, VoltageRange};
use crate::wire::{
    Ask, Chunk, Deframer, Exchange, Fault, FrameError, Identity, MAX_FRAME, MOST_CHUNK, MOST_DRIVES, Measured, Mode,
    PROTOCOL, Refusal, Reply, Request, Start, State, Status, Tell, Unit, encode, model_sum,
};

use clock::Clock;
use retransmit::Retransmit;

pub use can::{Bus, CanLine, FROM_DEVICE, TO_DEVICE};
pub use clock::ClockFit;
pub use interfaces::{Interface, interfaces};
pub use lines::{OpenError, Port, Serial, Tcp, ports};
pub use slcan::Slcan;
#[cfg(target_os = "linux")]
pub use socketcan::{SocketCan, SocketCanError};

/// Time in which a device must come to rest, in addition to its ramp.
const REST_TIMEOUT: Duration = Duration::from_secs(20);
/// Time by which drives are sent ahead \[s\].
///
/// It bridges short delays of the host, and is short enough for a quick stop.
const LOOKAHEAD_S: f64 = 0.25;
/// Longest wait for an answer, as a multiple of the first wait.
const MAX_BACKOFF: u32 = 8;
/// Minimum number of requests within the device's watchdog time.
///
/// A slower line sends as many as it can carry.
const MIN_REQUESTS_PER_SILENCE: u32 = 8;
/// Margin for sensor noise at both ends of the reference range, as a share of the range.
const REFERENCE_MARGIN: f64 = 0.05;

/// A line that carries bytes in both directions: a serial port, a socket, or the frames of a bus.
pub trait Line {
    /// Sends all of `bytes`.
    ///
    /// # Errors
    /// If the connection is lost.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Waits for bytes for at most `patience` and returns how many were received; 0 is not an error.
    ///
    /// # Errors
    /// If the connection is lost.
    fn receive(&mut self, bytes: &mut [u8], patience: Duration) -> io::Result<usize>;

    /// Returns the present time on this line. A simulated line may have its own clock.
    fn now(&mut self) -> Instant {
        Instant::now()
    }

    /// Waits for `time`.
    fn pause(&mut self, time: Duration) {
        std::thread::sleep(time);
    }
}

impl<L: Line + ?Sized> Line for Box<L> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        (**self).send(bytes)
    }

    fn receive(&mut self, bytes: &mut [u8], patience: Duration) -> io::Result<usize> {
        (**self).receive(bytes, patience)
    }

    fn now(&mut self) -> Instant {
        (**self).now()
    }

    fn pause(&mut self, time: Duration) {
        (**self).pause(time);
    }
}

/// Errors of a device at the other end of a line.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RemoteError {
    /// The connection is lost.
    #[error(
        "{line}: the connection is lost: {source}; a running device ramps to rest by its watchdog; \
         check the cable and the power supply, then run again"
    )]
    Line {
        /// Name of the line.
        line: String,
        /// Error of the operating system.
        source: io::Error,
    },
    /// No answer, or only damaged ones, arrived in time.
    #[error("{line}: no answer within {seconds} s ({broken} damaged frames received): {advice}")]
    Silent {
        /// Name of the line.
        line: String,
        /// Waiting time \[s\].
        seconds: f64,
        /// Number of damaged frames that arrived.
        broken: u32,
        /// What to do.
        advice: &'static str,
    },
    /// Host and device use different versions of the protocol.
    #[error(
        "{line}: the device speaks version {device} of the protocol, this program version {PROTOCOL}; update the older one"
    )]
    Version {
        /// Name of the line.
        line: String,
        /// Version of the device.
        device: u16,
    },
    /// The device refuses the request.
    #[error("{line}: {refusal}")]
    Refused {
        /// Name of the line.
        line: String,
        /// Reason.
        refusal: Refusal,
    },
    /// The device ended an earlier run with a fault that is not yet cleared.
    #[error(
        "{line}: fault {} of an earlier run is not cleared ({fault}): the device does not start; \
         fix the cause, then type hystctl stop --clear (or give --clear to run)",
        fault.code()
    )]
    Standing {
        /// Name of the line.
        line: String,
        /// The fault.
        fault: Fault,
    },
    /// The device ended the run with a fault.
    #[error("{line}: the device ended the run and ramps to rest (fault {}): {fault}", fault.code())]
    Fault {
        /// Name of the line.
        line: String,
        /// The fault.
        fault: Fault,
    },
    /// The run was stopped, but not by this program.
    #[error(
        "{line}: another program stopped the device; it ramps to rest; find out which program uses the device, then run again"
    )]
    Stopped {
        /// Name of the line.
        line: String,
    },
    /// The device no longer knows the run.
    #[error("{line}: the device no longer knows this run: {refusal}; check whether it was switched off and on")]
    Left {
        /// Name of the line.
        line: String,
        /// Refusal of the device.
        refusal: Refusal,
    },
    /// The device does not come to rest.
    #[error("{line}: the device is not at rest after {seconds} s and may still be driven; switch its amplifier off")]
    Restless {
        /// Name of the line.
        line: String,
        /// Waiting time \[s\].
        seconds: f64,
    },
    /// The device answers, but its clock has stopped.
    #[error(
        "{line}: the device answers, but has played and measured nothing for {seconds} s: \
         its clock has stopped, and its watchdog with it; switch its amplifier off"
    )]
    Stands {
        /// Name of the line.
        line: String,
        /// Waiting time \[s\].
        seconds: f64,
    },
    /// The device does not support the sample rate.
    #[error(
        "{line}: {asked_hz} Hz is outside the device's {low_hz} to {high_hz} Hz; \
         give --rate (excite, record, references such as sine:), or resample the file"
    )]
    Rate {
        /// Name of the line.
        line: String,
        /// Requested rate \[Hz\].
        asked_hz: f64,
        /// Slowest rate \[Hz\].
        low_hz: f64,
        /// Fastest rate \[Hz\].
        high_hz: f64,
    },
    /// A value is out of range.
    #[error("{what} = {value}: {advice}")]
    Value {
        /// Name of the value.
        what: &'static str,
        /// The value.
        value: f64,
        /// What to give instead.
        advice: &'static str,
    },
    /// The answer does not match the request.
    #[error(
        "{line}: the device's answer does not match the request; check that its firmware speaks hystctl's protocol"
    )]
    Answer {
        /// Name of the line.
        line: String,
    },
    /// The calls are out of order.
    #[error("calls out of order: start the device before exchange, and stop it before the next start")]
    Order,
}

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

/// A device at the other end of a line.
#[derive(Debug)]
pub struct Remote<L> {
    line: L,
    name: String,
    options: RemoteOptions,
    deframer: Deframer,
    number: u32,
    identity: Identity,
    capabilities: Capabilities,
    run: Option<Run>,
    /// Clock comparison of the present or the last run.
    clock: Option<Clock>,
    /// Times at which the last request was sent and its answer arrived; `None` if ambiguous.
    round_trip: Option<(Instant, Instant)>,
    /// Answer times on this line.
    retransmit: Retransmit,
    present_v: f64,
    /// Slew rate of the next run, set by [`gentle`](Remote::gentle) \[V/s\].
    gentle: f64,
    broken: u32,
    /// First error of the operating system on a lost connection. Later errors contain less information.
    gone: Option<(io::ErrorKind, String)>,
}

/// State of a run on the host.
#[derive(Debug, Clone, Copy)]
struct Run {
    session: u32,
    rate_hz: f64,
    /// Number of drives that the device has received.
    sent: u32,
    /// Number of samples that have arrived.
    heard: u32,
    /// Number of the first drive for which the device has no room.
    room: u32,
    /// Maximum number of drives that wait on the device. It bounds the delay of a change of the drive.
    lookahead: u32,
    /// Periods since the run began. The device's own count wraps at 2³².
    ticks: u64,
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
            Tell::Version(device) => return Err(RemoteError::Version { line: remote.name, device }),
            _ => return Err(remote.unexpected_answer()),
        }
        let Tell::Identity(identity) = remote.ask(Ask::Describe)? else { return Err(remote.unexpected_answer()) };
        remote.capabilities = capabilities(&identity, &remote.name);
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
            line,
            name,
            options,
            deframer: Deframer::new(),
            // Answers to requests of an earlier program have other numbers.
            number: options.session.rotate_left(16),
            capabilities: capabilities(&no_device, "nobody"),
            identity: no_device,
            run: None,
            clock: None,
            round_trip: None,
            retransmit: Retransmit::default(),
            present_v: 0.0,
            gentle: f64::INFINITY,
            broken: 0,
            gone: None,
        }
    }

    /// Returns name, ranges and abilities of the device.
    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// Returns the line.
    pub fn line_mut(&mut self) -> &mut L {
        &mut self.line
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
                _ => return Err(self.unexpected_answer()),
            }
        }
        Err(self.unexpected_answer())
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
        let (mut moved, mut at_v, mut status) = (self.line.now(), first.present_v, first);
        loop {
            match (status.state, fault) {
                (State::Idle, _) => return Ok(fault),
                (State::Running, _) => return Err(self.refused(Refusal::State)),
                (State::Fault(now), seen) if seen != Some(now) => {
                    return Err(RemoteError::Standing { line: self.name.clone(), fault: now });
                }
                // The slew limit of the ended run is unknown here, so only a standstill counts.
                _ if self.since(moved) > REST_TIMEOUT => {
                    return Err(RemoteError::Restless { line: self.name.clone(), seconds: REST_TIMEOUT.as_secs_f64() });
                }
                (State::Fault(now), _) if status.present_v == self.identity.rest_v => {
                    return self.ask_status(Ask::Clear(now)).map(|_| fault);
                }
                (State::Fault(_) | State::Stopping, _) => self.line.pause(Duration::from_millis(20)),
            }
            status = self.status()?;
            if status.present_v != at_v {
                (moved, at_v) = (self.line.now(), status.present_v);
            }
        }
    }

    /// Refuses an exchange without progress: the clock of the device has stopped, and its watchdog with it.
    fn require_progress(&self, taken: usize, measured: &[Sample]) -> Result<(), RemoteError> {
        if taken > 0 || !measured.is_empty() {
            return Ok(());
        }
        Err(RemoteError::Stands { line: self.name.clone(), seconds: self.answer_timeout().as_secs_f64() })
    }

    /// Returns the time without an answer after which the device counts as lost.
    ///
    /// At least four sample periods.
    fn answer_timeout(&self) -> Duration {
        let periods = self.run.map_or(0.0, |run| 4.0 / run.rate_hz);
        self.options.lost.max(Duration::from_secs_f64(periods.min(1e4)))
    }

    /// Returns the time in which the device must come to rest at its slew limit.
    fn rest_timeout(&self) -> Duration {
        let slew = self.slew();
        let ramp = f64::from(self.identity.max_v - self.identity.min_v) / slew.max(f64::MIN_POSITIVE);
        REST_TIMEOUT + Duration::from_secs_f64(ramp.clamp(0.0, 1e6))
    }

    /// Returns the time since `then`, on the line's clock.
    fn since(&mut self, then: Instant) -> Duration {
        self.line.now().saturating_duration_since(then)
    }

    fn unexpected_answer(&self) -> RemoteError {
        RemoteError::Answer { line: self.name.clone() }
    }

    fn refused(&self, refusal: Refusal) -> RemoteError {
        RemoteError::Refused { line: self.name.clone(), refusal }
    }

    fn gone(&mut self, source: io::Error) -> RemoteError {
        let (kind, said) = self.gone.get_or_insert_with(|| (source.kind(), source.to_string()));
        RemoteError::Line { line: self.name.clone(), source: io::Error::new(*kind, said.clone()) }
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
                Err(RemoteError::Standing { line: self.name.clone(), fault })
            }
            Tell::Refused(refusal, _) => Err(self.refused(refusal)),
            _ => Err(self.unexpected_answer()),
        }
    }

    /// Sends a request, repeatedly if necessary, and returns the answer.
    fn ask(&mut self, ask: Ask) -> Result<Tell, RemoteError> {
        self.number = self.number.wrapping_add(1);
        let request = Request { number: self.number, ask };
        let mut buffer = [0; MAX_FRAME];
        let frame = encode(&request, &mut buffer).map_err(|_| self.unexpected_answer())?;
        let began = self.line.now();
        let mut bytes = [0; 4096];
        let silence = Duration::from_secs_f64(self.options.silence_s);
        let (mut repeat, mut asked) =
            (self.retransmit.first(self.options.repeat, silence.min(self.answer_timeout()) / 2), 0);
        // One request within the watchdog time is enough, so several are tried.
        let longest = (MAX_BACKOFF * repeat).min(silence / MIN_REQUESTS_PER_SILENCE).max(repeat);
        while self.since(began) < self.answer_timeout() {
            // A zero ends an incomplete earlier frame.
            self.line.send(&[0]).and_then(|()| self.line.send(frame)).map_err(|source| self.gone(source))?;
            let sent = self.line.now();
            asked += 1;
            while let Some(patience) = repeat.checked_sub(self.since(sent)).filter(|d| !d.is_zero()) {
                let came = self.line.receive(&mut bytes, patience).map_err(|source| self.gone(source))?;
                let mut fresh = &bytes[..came];
                while let Some(reply) = self.deframer.next::<Reply>(&mut fresh) {
                    match reply {
                        Ok(reply) if reply.number == self.number => {
                            // If the request was sent twice, it is unknown which one was answered.
                            self.round_trip = (asked == 1).then(|| (sent, self.line.now()));
                            let took = self.since(began);
                            self.retransmit.answered(self.number, asked, took);
                            return Ok(reply.tell);
                        }
                        // A second answer to a request that was sent twice.
                        Ok(reply) => self.retransmit.answered_again(reply.number),
                        Err(FrameError::Message) if matches!(request.ask, Ask::Hello) => {
                            return Err(self.unexpected_answer());
                        }
                        Err(_) => self.broken += 1,
                    }
                }
            }
            // Wait longer each time, so that a slow line does not fill with requests.
            repeat = (2 * repeat).min(longest);
        }
        let advice = match request.ask {
            Ask::Hello if self.broken > 0 => {
                "other data arrives there: check the port, the baud rate and that the firmware speaks this protocol"
            }
            Ask::Hello => "check the port, the baud rate, that the device is powered and that no other program uses it",
            Ask::Emergency => {
                "ASSUME THAT NOTHING WAS STOPPED: switch the amplifier off, or press Ctrl-C in the terminal of the run; then check hystctl status"
            }
            _ => "a device that still runs ramps to rest by its watchdog; check the cable, then hystctl status",
        };
        let seconds = self.answer_timeout().as_secs_f64();
        Err(RemoteError::Silent { line: self.name.clone(), seconds, broken: self.broken, advice })
    }

    /// Sends one exchange request of a run and returns the number of accepted drives.
    fn exchange_once(
        &mut self,
        run: &mut Run,
        drive_v: &[f64],
        measured: &mut Vec<Sample>,
    ) -> Result<usize, RemoteError> {
        let ahead = run.lookahead.saturating_sub(run.sent.wrapping_sub(run.heard));
        let free = run.room.saturating_sub(run.sent).min(ahead) as usize;
        let drives = drive_v.iter().take(free.min(MOST_DRIVES)).map(|v| *v as f32).collect();
        let exchange = Exchange { session: run.session, heard: run.heard, first: run.sent, drives };
        match self.ask(Ask::Exchange(exchange))? {
            Tell::Samples { status, first, samples } => {
                if let (Some(clock), Some((asked, answered))) = (&mut self.clock, self.round_trip) {
                    // The full period count, from the known periods and the device's 32-bit count.
                    let periods = run.ticks + u64::from(status.tick.wrapping_sub(run.ticks as u32));
                    clock.add_reading(asked, answered, periods);
                }
                if status.state != State::Running {
                    // Fetch the remaining samples: they show what led to the end of the run.
                    let mut whole = self.append_samples(run, first, &samples, measured);
                    for _ in 0..status.measured.wrapping_sub(run.heard) {
                        whole = whole && run.heard != status.measured && self.fetch_samples(run, measured);
                    }
                    let line = self.name.clone();
                    return Err(match status.state {
                        State::Fault(fault) => RemoteError::Fault { line, fault },
                        _ => RemoteError::Stopped { line },
                    });
                }
                let taken = status.received.wrapping_sub(run.sent) as usize;
                if taken > drive_v.len() || !self.append_samples(run, first, &samples, measured) {
                    return Err(self.unexpected_answer());
                }
                (run.sent, run.room) = (status.received, status.room);
                self.present_v = match drive_v[..taken].last() {
                    Some(last) => *last,
                    None => self.present_v,
                };
                Ok(taken)
            }
            Tell::Refused(refusal, status) => match (status.state, refusal) {
                (State::Fault(fault), _) => Err(RemoteError::Fault { line: self.name.clone(), fault }),
                (_, Refusal::Drive(_)) => Err(self.refused(refusal)),
                _ => Err(RemoteError::Left { line: self.name.clone(), refusal }),
            },
            _ => Err(self.unexpected_answer()),
        }
    }

    /// Fetches samples of a run that has ended; returns whether any arrived.
    fn fetch_samples(&mut self, run: &mut Run, measured: &mut Vec<Sample>) -> bool {
        let drives = heapless::Vec::new();
        let exchange = Exchange { session: run.session, heard: run.heard, first: run.sent, drives };
        match self.ask(Ask::Exchange(exchange)) {
            Ok(Tell::Samples { first, samples, .. }) => {
                !samples.is_empty() && self.append_samples(run, first, &samples, measured)
            }
            _ => false,
        }
    }

    /// Appends samples that follow the last one; returns whether there is no gap.
    fn append_samples(&self, run: &mut Run, first: u32, samples: &[Measured], measured: &mut Vec<Sample>) -> bool {
        let Some(known) = run.heard.checked_sub(first) else { return samples.is_empty() };
        for sample in samples.iter().skip(known as usize) {
            run.heard = run.heard.wrapping_add(1);
            run.ticks += u64::from(sample.tick.wrapping_sub(run.ticks as u32));
            let has = |there: bool, value: f32| there.then_some(f64::from(value));
            measured.push(Sample {
                time_s: run.ticks as f64 / run.rate_hz,
                drive_v: f64::from(sample.drive_v),
                output: f64::from(sample.output),
                temperature_degc: has(self.identity.temperature, sample.temperature_degc),
                load_n: has(self.identity.load, sample.load_n),
                force_n: sample.force_n.map(f64::from),
            });
        }
        true
    }

    /// Exchanges until the device has accepted a drive or measured a sample.
    fn exchange_until_progress(&mut self, drive_v: &[f64], measured: &mut Vec<Sample>) -> Result<usize, RemoteError> {
        let mut run = self.run.ok_or(RemoteError::Order)?;
        let (before, began) = (measured.len(), self.line.now());
        loop {
            let outcome = self.exchange_once(&mut run, drive_v, measured);
            self.run = Some(run);
            let taken = outcome?;
            let outstanding = run.sent != run.heard;
            if taken > 0 || measured.len() > before || !outstanding && drive_v.is_empty() {
                return Ok(taken);
            }
            if self.since(began) > self.answer_timeout() {
                // The runner reports this as a stalled device.
                return Ok(0);
            }
            self.line.pause(Duration::from_micros(200));
        }
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

impl<L: Line> Daq for Remote<L> {
    type Error = RemoteError;

    fn capabilities(&self) -> &Capabilities {
        &self.capabilities
    }

    fn present_v(&self) -> f64 {
        self.present_v
    }

    fn start(&mut self, rate_hz: f64) -> Result<f64, RemoteError> {
        if self.run.is_some() {
            return Err(RemoteError::Order);
        }
        let o = self.options;
        let i = &self.identity;
        let &Capabilities { min_rate_hz: low_hz, max_rate_hz: high_hz, .. } = &self.capabilities;
        if !(low_hz..=high_hz).contains(&f64::from(rate_hz as f32)) {
            return Err(RemoteError::Rate { line: self.name.clone(), asked_hz: rate_hz, low_hz, high_hz });
        }
        let (low, high) = o.voltage.map_or((i.min_v, i.max_v), |(low, high)| (low as f32, high as f32));
        let start = Start {
            session: o.session,
            mode: o.mode,
            rate_hz: rate_hz as f32,
            low_v: low,
            high_v: high,
            slew_v_per_s: self.slew() as f32,
            hottest_degc: o.hottest_degc as f32,
            error: o.error as f32,
            silence_s: o.silence_s as f32,
            force: o.force,
        };
        let status = match self.ask_status(Ask::Start(start)) {
            Err(error @ (RemoteError::Silent { .. } | RemoteError::Answer { .. })) => {
                // The run may have begun although the answer was lost.
                let _ = self.ask(Ask::Stop);
                return Err(error);
            }
            other => other?,
        };
        let rate_hz = f64::from(rate_hz as f32);
        self.clock = Some(Clock::new(1.0 / rate_hz, self.line.now()));
        let lookahead = (LOOKAHEAD_S * rate_hz).ceil().clamp(8.0, 1e6) as u32;
        self.run = Some(Run { session: o.session, rate_hz, sent: 0, heard: 0, room: status.room, lookahead, ticks: 0 });
        if o.mode == Mode::Reference {
            // Ramps begin and end at the present output. The margin allows for the sensor's noise.
            let (range, output) = (&mut self.capabilities.voltage, f64::from(status.output));
            let margin = REFERENCE_MARGIN * (range.max_v - range.min_v);
            range.min_v = range.min_v.min(output - margin);
            range.max_v = range.max_v.max(output + margin);
            range.rest_v = output;
        }
        // The next run of this program has another number.
        self.options.session = o.session.wrapping_add(1);
        Ok(rate_hz)
    }

    fn exchange(&mut self, drive_v: &[f64], measured: &mut Vec<Sample>) -> Result<usize, RemoteError> {
        let range = self.capabilities.voltage;
        if let Some(bad) = drive_v.iter().find(|v| !range.contains(**v)) {
            let advice = match self.options.mode {
                Mode::Voltage | Mode::Nothing => {
                    "give voltages within the device's range; nothing of the block was applied"
                }
                Mode::Reference => "give references within the range of the run; nothing of the block was applied",
            };
            return Err(RemoteError::Value { what: "drive", value: *bad, advice });
        }
        self.exchange_until_progress(drive_v, measured)
    }

    fn rest(&mut self, seconds: f64) -> Result<(), RemoteError> {
        if !(0.0..=1e6).contains(&seconds) {
            return Err(RemoteError::Value { what: "rest", value: seconds, advice: "give a time from 0 to 1e6 s" });
        }
        let Some(run) = self.run else { return Ok(()) };
        // The samples are discarded; the exchange only resets the watchdog.
        let VoltageRange { min_v, max_v, rest_v: rest } = self.capabilities.voltage;
        let slew = match self.options.mode {
            Mode::Voltage | Mode::Nothing => self.slew(),
            // The whole range in one second.
            Mode::Reference => (max_v - min_v).max(f64::MIN_POSITIVE),
        };
        let step = slew / run.rate_hz;
        let (from, ramp) = (self.present_v, ((self.present_v - rest).abs() / step).ceil() as usize);
        let total = ramp + (seconds * run.rate_hz).round() as usize;
        let volts = |k: usize| if k + 1 >= ramp { rest } else { from + (rest - from) * (k + 1) as f64 / ramp as f64 };
        let (mut sent, mut discarded) = (0, Vec::new());
        while sent < total {
            discarded.clear();
            let block: Vec<f64> = (sent..total.min(sent + MOST_DRIVES)).map(volts).collect();
            let taken = self.exchange_until_progress(&block, &mut discarded)?;
            self.require_progress(taken, &discarded)?;
            sent += taken;
        }
        while self.run.is_some_and(|run| run.heard != run.sent) {
            discarded.clear();
            let taken = self.exchange_until_progress(&[], &mut discarded)?;
            self.require_progress(taken, &discarded)?;
        }
        Ok(())
    }

    fn clock(&self) -> Option<ClockFit> {
        self.clock.as_ref()?.fit()
    }

    fn stop(&mut self) -> Result<(), RemoteError> {
        if self.run.is_none() {
            return Ok(());
        }
        let (began, longest) = (self.line.now(), self.rest_timeout());
        loop {
            let status = self.ask_status(Ask::Stop)?;
            let at_rest = matches!(status.state, State::Fault(_)) && status.present_v == self.identity.rest_v;
            if status.state == State::Idle || at_rest {
                self.run = None;
                return Ok(());
            }
            if self.since(began) > longest {
                return Err(RemoteError::Restless { line: self.name.clone(), seconds: longest.as_secs_f64() });
            }
            self.line.pause(Duration::from_millis(2));
        }
    }
}

#[cfg(test)]
mod tests;
