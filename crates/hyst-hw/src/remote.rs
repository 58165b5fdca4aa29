//! A device at the other end of a line, as a [`Daq`].

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

/// How long a device may take to come to rest, its ramp not counted.
const LONGEST_REST: Duration = Duration::from_secs(20);
/// How far drives are sent ahead \[s\]: long enough for a host that is kept busy for a moment, short enough for a stop.
const LOOKAHEAD_S: f64 = 0.25;
/// By how many times the first wait for an answer the last ones may be longer.
const MOST_REPEATS: u32 = 8;
/// Requests in the time that a device's watchdog waits, at least; on a line that is slower than that, as many as go through.
const TRIES: u32 = 8;
/// Room for noise at the ends of a range of references, as a share of it.
const MARGIN: f64 = 0.05;

/// A line that carries bytes both ways: a serial port, a socket, frames of a bus put together.
pub trait Line {
    /// Sends all of `bytes`.
    ///
    /// # Errors
    /// When the line is gone.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Waits for at most `patience`, and gives how many bytes came; none is no error.
    ///
    /// # Errors
    /// When the line is gone.
    fn receive(&mut self, bytes: &mut [u8], patience: Duration) -> io::Result<usize>;

    /// What time it is at this line. A line that is simulated may have a clock of its own.
    fn now(&mut self) -> Instant {
        Instant::now()
    }

    /// Lets some time pass.
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

/// What can go wrong with a device at the other end of a line.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RemoteError {
    /// The line is gone.
    #[error(
        "{line}: the line is gone: {source}; look at the cable and whether the device is powered, then start again"
    )]
    Line {
        /// What the line is called.
        line: String,
        /// What the system said.
        source: io::Error,
    },
    /// Nothing, or nothing whole, came back.
    #[error("{line}: no answer within {seconds} s ({broken} broken frames came): {advice}")]
    Silent {
        /// What the line is called.
        line: String,
        /// How long was waited \[s\].
        seconds: f64,
        /// Frames that came but were broken.
        broken: u32,
        /// What to do.
        advice: &'static str,
    },
    /// Host and device speak different versions.
    #[error(
        "{line}: the device speaks version {device} of the protocol, this program version {PROTOCOL}; update the older one"
    )]
    Version {
        /// What the line is called.
        line: String,
        /// The device's version.
        device: u16,
    },
    /// The device does not do what was asked.
    #[error("{line}: {refusal}")]
    Refused {
        /// What the line is called.
        line: String,
        /// Why.
        refusal: Refusal,
    },
    /// The device ended an earlier run by itself, and nobody has looked at it since.
    #[error(
        "{line}: the device stands with a fault ({}) of an earlier run: {fault}; when that is mended, clear it (hystctl stop --clear, or run --clear)",
        fault.code()
    )]
    Standing {
        /// What the line is called.
        line: String,
        /// Why.
        fault: Fault,
    },
    /// The device ended the run by itself.
    #[error("{line}: the device ended the run (fault {}): {fault}", fault.code())]
    Fault {
        /// What the line is called.
        line: String,
        /// Why.
        fault: Fault,
    },
    /// The run is over, and nobody here has ended it.
    #[error("{line}: the device was told to stop, and not by this program; does another one talk to it?")]
    Stopped {
        /// What the line is called.
        line: String,
    },
    /// The device does not know the run any more.
    #[error("{line}: the device has left the run: {refusal}; was it switched off and on?")]
    Left {
        /// What the line is called.
        line: String,
        /// What it said.
        refusal: Refusal,
    },
    /// The device does not come to rest.
    #[error("{line}: the device does not come to rest within {seconds} s; switch its amplifier off")]
    Restless {
        /// What the line is called.
        line: String,
        /// How long was waited \[s\].
        seconds: f64,
    },
    /// The device answers and does nothing.
    #[error(
        "{line}: the device answers and has neither played nor measured anything for {seconds} s: its clock stands, and with it its watchdog; switch its amplifier off"
    )]
    Stands {
        /// What the line is called.
        line: String,
        /// How long was waited \[s\].
        seconds: f64,
    },
    /// A rate that the device does not run at.
    #[error(
        "{line}: {asked_hz} Hz; the device runs at {low_hz} to {high_hz} Hz: bring the record to such a rate (excite, record and references like sine: take --rate)"
    )]
    Rate {
        /// What the line is called.
        line: String,
        /// What was asked for \[Hz\].
        asked_hz: f64,
        /// Slowest \[Hz\].
        low_hz: f64,
        /// Fastest \[Hz\].
        high_hz: f64,
    },
    /// A value that cannot be asked for.
    #[error("{what} = {value}: {advice}")]
    Value {
        /// Name of the value.
        what: &'static str,
        /// The value.
        value: f64,
        /// What to give instead.
        advice: &'static str,
    },
    /// The device answers what was not asked.
    #[error("{line}: the device answers something else than what was asked; is it hystctl's protocol?")]
    Answer {
        /// What the line is called.
        line: String,
    },
    /// Out of order.
    #[error("the device runs already, or does not run: start it first, stop it last")]
    Order,
}

/// How a device is talked to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RemoteOptions {
    /// How long to wait for an answer before the request is sent again.
    pub repeat: Duration,
    /// How long to go without any answer before the device counts as lost.
    pub lost: Duration,
    /// Silence of this host after which the device comes to rest \[s\].
    pub silence_s: f64,
    /// Lowest and highest voltage of a run \[V\]; the device's own if not given.
    pub voltage: Option<(f64, f64)>,
    /// Steepest slope \[V/s\]; the device's own if not given.
    pub slew_v_per_s: Option<f64>,
    /// Highest temperature \[°C\].
    pub hottest_degc: f64,
    /// Whether voltages are driven, or references followed.
    pub mode: Mode,
    /// Greatest tracking error \[output unit\].
    pub error: f64,
    /// Whether the device estimates the external force, with the observer that was handed over.
    pub force: bool,
    /// Number of the run: another one for each. Drawn by the caller, so that two programs do not meet in one.
    pub session: u32,
}

impl RemoteOptions {
    /// Voltages within the device's own limits; half a second of silence; run number `session`.
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
    /// Of the run, or of the last one.
    clock: Option<Clock>,
    /// When the last request was sent and its answer came, if that is known.
    round_trip: Option<(Instant, Instant)>,
    /// How long answers take on this line.
    retransmit: Retransmit,
    present_v: f64,
    /// Slope that the next run needs \[V/s\].
    gentle: f64,
    broken: u32,
    /// What the system said when the line went: what it says of a line that is gone tells less.
    gone: Option<(io::ErrorKind, String)>,
}

/// What is known of a run.
#[derive(Debug, Clone, Copy)]
struct Run {
    session: u32,
    rate_hz: f64,
    /// Drives that the device has had.
    sent: u32,
    /// Samples that have come.
    heard: u32,
    /// Number of the first drive that it has no room for.
    room: u32,
    /// Most drives that wait on the device: what is decided here acts no later than that.
    lookahead: u32,
    /// Periods since the run began, as many as there are: the device's count begins anew after 2³².
    ticks: u64,
}

impl<L: Line> Remote<L> {
    /// Greets the device at the other end of `line`, which messages call `name`.
    ///
    /// # Errors
    /// When nobody answers, or in another version.
    pub fn open(line: L, name: impl Into<String>, options: RemoteOptions) -> Result<Self, RemoteError> {
        let mut remote = Self::unknown(line, name.into(), options);
        match remote.ask(Ask::Hello)? {
            Tell::Version(PROTOCOL) => {}
            Tell::Version(device) => return Err(RemoteError::Version { line: remote.name, device }),
            _ => return Err(remote.odd()),
        }
        let Tell::Identity(identity) = remote.ask(Ask::Describe)? else { return Err(remote.odd()) };
        remote.capabilities = capabilities(&identity, &remote.name);
        remote.identity = identity;
        // Where it stands, which need not be where it rests.
        remote.status()?;
        Ok(remote)
    }

    /// Before anything was said.
    fn unknown(line: L, name: String, options: RemoteOptions) -> Self {
        let nobody = Identity {
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
            // An answer to an earlier program's request is told from one to this one's.
            number: options.session.rotate_left(16),
            capabilities: capabilities(&nobody, "nobody"),
            identity: nobody,
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

    /// What the device is.
    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// The line.
    pub fn line_mut(&mut self) -> &mut L {
        &mut self.line
    }

    /// Hands over a model, with which the device follows references.
    ///
    /// # Errors
    /// When the device has no room for it or cannot run it, or is lost.
    pub fn upload(&mut self, block: &[u8]) -> Result<(), RemoteError> {
        let (total, sum) = (block.len() as u32, model_sum(block));
        let mut offset = 0;
        // Each part brings it on; parts that do not are those of a device that is none.
        for _ in 0..=2 * block.len().div_ceil(MOST_CHUNK) {
            let end = block.len().min(offset as usize + MOST_CHUNK);
            let bytes = block[offset as usize..end].iter().copied().collect();
            match self.ask(Ask::Model(Chunk { offset, total, sum, bytes }))? {
                Tell::ModelBytes(have) if have >= total => return Ok(()),
                Tell::ModelBytes(have) => offset = have,
                Tell::Refused(Refusal::ModelGap, _) => offset = 0,
                Tell::Refused(refusal, _) => return Err(self.refused(refusal)),
                _ => return Err(self.odd()),
            }
        }
        Err(self.odd())
    }

    /// How the device stands. Nothing changes by that, and for the watchdog of a run it is no sign of life.
    ///
    /// # Errors
    /// When the device is lost.
    pub fn status(&mut self) -> Result<Status, RemoteError> {
        self.stated(Ask::Status)
    }

    /// Lets the device only measure in its next runs: what it is given is not put out.
    pub fn observe(&mut self) {
        self.options.mode = Mode::Nothing;
    }

    /// Drives and ramps of the next run are no steeper than this \[V/s\], unless the options say something else: a fault then ramps to rest as gently
    /// as the run itself went.
    pub fn gentle(&mut self, slew_v_per_s: f64) {
        self.gentle = slew_v_per_s;
    }

    /// Steepest slope of a run \[V/s\].
    fn slew(&self) -> f64 {
        let most = f64::from(self.identity.max_slew_v_per_s);
        self.options.slew_v_per_s.unwrap_or(most.min(self.gentle))
    }

    /// Hands over what [`recipe_head`](crate::wire::recipe_head) and a model's block make, and from then on drives are references \[output unit\] between
    /// `low` and `high`, which the device follows: the ramps before and after a run begin and end where the output is now.
    ///
    /// # Errors
    /// When the device follows no references, has no room for the model or cannot run it, or is lost.
    pub fn follow(&mut self, recipe: &[u8], (low, high): (f64, f64)) -> Result<(), RemoteError> {
        if self.run.is_some() {
            return Err(RemoteError::Order);
        }
        self.upload(recipe)?;
        self.options.mode = Mode::Reference;
        // It stands: told to stop, it says where.
        let output = f64::from(self.stated(Ask::Stop)?.output);
        self.capabilities.voltage = VoltageRange { min_v: low.min(output), max_v: high.max(output), rest_v: output };
        Ok(())
    }

    /// An emergency stop of the device at the other end of `line`, whatever it does: nothing is asked before.
    ///
    /// # Errors
    /// When nobody answers.
    pub fn stop_at(line: L, name: impl Into<String>, options: RemoteOptions) -> Result<Status, RemoteError> {
        Self::unknown(line, name.into(), options).stated(Ask::Emergency)
    }

    /// Ends whatever the device does and keeps it from starting again before [`clear`](Self::clear).
    ///
    /// # Errors
    /// When the device is lost.
    pub fn emergency_stop(&mut self) -> Result<(), RemoteError> {
        self.run = None;
        self.stated(Ask::Emergency).map(|_| ())
    }

    /// Clears the fault that the device has now, if there is one, once it is at rest; on its way there it is waited for. Gives the fault.
    ///
    /// # Errors
    /// When the device runs, does not come to rest, is lost, or has another fault meanwhile: an emergency stop, say, which is none of those
    /// that this was asked to clear.
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
                // The ramp is as steep as the run that has ended was to be, which nobody here knows.
                _ if self.since(moved) > LONGEST_REST => {
                    return Err(RemoteError::Restless { line: self.name.clone(), seconds: LONGEST_REST.as_secs_f64() });
                }
                (State::Fault(now), _) if status.present_v == self.identity.rest_v => {
                    return self.stated(Ask::Clear(now)).map(|_| fault);
                }
                (State::Fault(_) | State::Stopping, _) => self.line.pause(Duration::from_millis(20)),
            }
            status = self.status()?;
            if status.present_v != at_v {
                (moved, at_v) = (self.line.now(), status.present_v);
            }
        }
    }

    /// That a device which answers has done something at last: one whose clock has stopped has no watchdog either.
    fn goes_on(&self, taken: usize, measured: &[Sample]) -> Result<(), RemoteError> {
        if taken > 0 || !measured.is_empty() {
            return Ok(());
        }
        Err(RemoteError::Stands { line: self.name.clone(), seconds: self.lost().as_secs_f64() })
    }

    /// How long to go without an answer: a slow clock gives no news for a while.
    fn lost(&self) -> Duration {
        let periods = self.run.map_or(0.0, |run| 4.0 / run.rate_hz);
        self.options.lost.max(Duration::from_secs_f64(periods.min(1e4)))
    }

    /// How long the device may take to come to rest at its slew.
    fn longest_rest(&self) -> Duration {
        let slew = self.slew();
        let ramp = f64::from(self.identity.max_v - self.identity.min_v) / slew.max(f64::MIN_POSITIVE);
        LONGEST_REST + Duration::from_secs_f64(ramp.clamp(0.0, 1e6))
    }

    /// Time since `then`, on the line's clock.
    fn since(&mut self, then: Instant) -> Duration {
        self.line.now().saturating_duration_since(then)
    }

    fn odd(&self) -> RemoteError {
        RemoteError::Answer { line: self.name.clone() }
    }

    fn refused(&self, refusal: Refusal) -> RemoteError {
        RemoteError::Refused { line: self.name.clone(), refusal }
    }

    fn gone(&mut self, source: io::Error) -> RemoteError {
        let (kind, said) = self.gone.get_or_insert_with(|| (source.kind(), source.to_string()));
        RemoteError::Line { line: self.name.clone(), source: io::Error::new(*kind, said.clone()) }
    }

    /// Asks for something that is answered by a status.
    fn stated(&mut self, ask: Ask) -> Result<Status, RemoteError> {
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
            _ => Err(self.odd()),
        }
    }

    /// Asks until there is an answer.
    fn ask(&mut self, ask: Ask) -> Result<Tell, RemoteError> {
        self.number = self.number.wrapping_add(1);
        let request = Request { number: self.number, ask };
        let mut buffer = [0; MAX_FRAME];
        let frame = encode(&request, &mut buffer).map_err(|_| self.odd())?;
        let began = self.line.now();
        let mut bytes = [0; 4096];
        let silence = Duration::from_secs_f64(self.options.silence_s);
        let (mut repeat, mut asked) = (self.retransmit.first(self.options.repeat, silence.min(self.lost()) / 2), 0);
        // A watchdog that hears one of so many requests is content.
        let longest = (MOST_REPEATS * repeat).min(silence / TRIES).max(repeat);
        while self.since(began) < self.lost() {
            // A zero ends what a line may have left of an earlier frame.
            self.line.send(&[0]).and_then(|()| self.line.send(frame)).map_err(|source| self.gone(source))?;
            let sent = self.line.now();
            asked += 1;
            while let Some(patience) = repeat.checked_sub(self.since(sent)).filter(|d| !d.is_zero()) {
                let came = self.line.receive(&mut bytes, patience).map_err(|source| self.gone(source))?;
                let mut fresh = &bytes[..came];
                while let Some(reply) = self.deframer.next::<Reply>(&mut fresh) {
                    match reply {
                        Ok(reply) if reply.number == self.number => {
                            // Asked twice, it is not known which one was answered.
                            self.round_trip = (asked == 1).then(|| (sent, self.line.now()));
                            let took = self.since(began);
                            self.retransmit.answered(self.number, asked, took);
                            return Ok(reply.tell);
                        }
                        // Of a request that was sent twice.
                        Ok(reply) => self.retransmit.answered_again(reply.number),
                        Err(FrameError::Message) if matches!(request.ask, Ask::Hello) => return Err(self.odd()),
                        Err(_) => self.broken += 1,
                    }
                }
            }
            // A line that is slow, and not deaf, would only be filled.
            repeat = (2 * repeat).min(longest);
        }
        let advice = match request.ask {
            Ask::Hello if self.broken > 0 => {
                "something else speaks there: is this the right port, its speed the device's, its firmware one that speaks this protocol?"
            }
            Ask::Hello => {
                "is this the right port, its speed the device's, the device powered, and no other program talking to it?"
            }
            Ask::Emergency => {
                "TAKE IT THAT NOTHING WAS STOPPED: switch the amplifier off, or press Ctrl-C where the run goes on; hystctl status tells"
            }
            _ => "look at the cable; its watchdog brings a device that still runs to rest",
        };
        let seconds = self.lost().as_secs_f64();
        Err(RemoteError::Silent { line: self.name.clone(), seconds, broken: self.broken, advice })
    }

    /// One request of a run: gives how many drives were taken.
    fn trade(&mut self, run: &mut Run, drive_v: &[f64], measured: &mut Vec<Sample>) -> Result<usize, RemoteError> {
        let ahead = run.lookahead.saturating_sub(run.sent.wrapping_sub(run.heard));
        let free = run.room.saturating_sub(run.sent).min(ahead) as usize;
        let drives = drive_v.iter().take(free.min(MOST_DRIVES)).map(|v| *v as f32).collect();
        let exchange = Exchange { session: run.session, heard: run.heard, first: run.sent, drives };
        match self.ask(Ask::Exchange(exchange))? {
            Tell::Samples { status, first, samples } => {
                if let (Some(clock), Some((asked, answered))) = (&mut self.clock, self.round_trip) {
                    // The device's count, from the periods that are known of.
                    let periods = run.ticks + u64::from(status.tick.wrapping_sub(run.ticks as u32));
                    clock.tell(asked, answered, periods);
                }
                if status.state != State::Running {
                    // What led to it is what one wants to see.
                    let mut whole = self.hear(run, first, &samples, measured);
                    for _ in 0..status.measured.wrapping_sub(run.heard) {
                        whole = whole && run.heard != status.measured && self.hear_more(run, measured);
                    }
                    let line = self.name.clone();
                    return Err(match status.state {
                        State::Fault(fault) => RemoteError::Fault { line, fault },
                        _ => RemoteError::Stopped { line },
                    });
                }
                let taken = status.received.wrapping_sub(run.sent) as usize;
                if taken > drive_v.len() || !self.hear(run, first, &samples, measured) {
                    return Err(self.odd());
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
            _ => Err(self.odd()),
        }
    }

    /// Asks for samples of a run that is over; whether some came.
    fn hear_more(&mut self, run: &mut Run, measured: &mut Vec<Sample>) -> bool {
        let drives = heapless::Vec::new();
        let exchange = Exchange { session: run.session, heard: run.heard, first: run.sent, drives };
        match self.ask(Ask::Exchange(exchange)) {
            Ok(Tell::Samples { first, samples, .. }) => {
                !samples.is_empty() && self.hear(run, first, &samples, measured)
            }
            _ => false,
        }
    }

    /// Takes samples that follow those that have come; whether they do.
    fn hear(&self, run: &mut Run, first: u32, samples: &[Measured], measured: &mut Vec<Sample>) -> bool {
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

    /// Waits until the device has done something more.
    fn trade_until_news(&mut self, drive_v: &[f64], measured: &mut Vec<Sample>) -> Result<usize, RemoteError> {
        let mut run = self.run.ok_or(RemoteError::Order)?;
        let (before, began) = (measured.len(), self.line.now());
        loop {
            let outcome = self.trade(&mut run, drive_v, measured);
            self.run = Some(run);
            let taken = outcome?;
            let outstanding = run.sent != run.heard;
            if taken > 0 || measured.len() > before || !outstanding && drive_v.is_empty() {
                return Ok(taken);
            }
            if self.since(began) > self.lost() {
                // The runner calls that a stalled device.
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
        let status = match self.stated(Ask::Start(start)) {
            Err(error @ (RemoteError::Silent { .. } | RemoteError::Answer { .. })) => {
                // It may have begun all the same.
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
            // Ramps begin and end where the output is now, wherever its sensor's noise puts it.
            let (range, output) = (&mut self.capabilities.voltage, f64::from(status.output));
            let margin = MARGIN * (range.max_v - range.min_v);
            range.min_v = range.min_v.min(output - margin);
            range.max_v = range.max_v.max(output + margin);
            range.rest_v = output;
        }
        // The next run of this program is another one.
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
                Mode::Reference => {
                    "give references within the range that was agreed on; nothing of the block was applied"
                }
            };
            return Err(RemoteError::Value { what: "drive", value: *bad, advice });
        }
        self.trade_until_news(drive_v, measured)
    }

    fn rest(&mut self, seconds: f64) -> Result<(), RemoteError> {
        if !(0.0..=1e6).contains(&seconds) {
            return Err(RemoteError::Value { what: "rest", value: seconds, advice: "give a time from 0 to 1e6 s" });
        }
        let Some(run) = self.run else { return Ok(()) };
        // Its samples are nobody's: the device is only kept from missing its host.
        let VoltageRange { min_v, max_v, rest_v: rest } = self.capabilities.voltage;
        let slew = match self.options.mode {
            Mode::Voltage | Mode::Nothing => self.slew(),
            // From one end to the other in a second.
            Mode::Reference => (max_v - min_v).max(f64::MIN_POSITIVE),
        };
        let step = slew / run.rate_hz;
        let (from, ramp) = (self.present_v, ((self.present_v - rest).abs() / step).ceil() as usize);
        let total = ramp + (seconds * run.rate_hz).round() as usize;
        let volts = |k: usize| if k + 1 >= ramp { rest } else { from + (rest - from) * (k + 1) as f64 / ramp as f64 };
        let (mut sent, mut nobody) = (0, Vec::new());
        while sent < total {
            nobody.clear();
            let block: Vec<f64> = (sent..total.min(sent + MOST_DRIVES)).map(volts).collect();
            let taken = self.trade_until_news(&block, &mut nobody)?;
            self.goes_on(taken, &nobody)?;
            sent += taken;
        }
        while self.run.is_some_and(|run| run.heard != run.sent) {
            nobody.clear();
            let taken = self.trade_until_news(&[], &mut nobody)?;
            self.goes_on(taken, &nobody)?;
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
        let (began, longest) = (self.line.now(), self.longest_rest());
        loop {
            let status = self.stated(Ask::Stop)?;
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
