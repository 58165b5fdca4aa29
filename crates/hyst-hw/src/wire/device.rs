//! The device's side of the protocol: answers to requests, and the work in each period of the clock.
//!
//! There is no line, no clock and no pin here. Firmware and tests provide their own.

use heapless::{Deque, Vec};

use super::lasting::Lasting;
use super::message::{
    Ask, Chunk, Exchange, Fault, Field, Identity, MOST_SAMPLES, Measured, Mode, PROTOCOL, Refusal, Reply, Request,
    Start, State, Status, Tell, model_sum,
};

/// Sensor readings.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Shown {
    /// The output, in the device's unit.
    pub output: f32,
    /// Temperature \[°C\]; 0 without a sensor.
    pub temperature_degc: f32,
    /// Load \[N\]; 0 without a sensor.
    pub load_n: f32,
}

/// The amplifier and the sensors.
pub trait Board {
    /// Reads the sensors.
    fn measure(&mut self) -> Shown;
    /// Sets the output voltage \[V\].
    fn put_out(&mut self, volts: f32);
}

/// A controller that follows references: an inverse, a feedback, or both.
pub trait Control {
    /// Loads a model, a [block of `hyst-core`](https://docs.rs/hyst-core).
    ///
    /// Returns whether the controller can run it.
    fn load(&mut self, block: &[u8]) -> bool;
    /// Returns whether a model is loaded.
    fn ready(&self) -> bool;
    /// Prepares a run with this period \[s\] that begins at rest; returns whether it can follow references.
    ///
    /// All slow work is done here. With `force`, the external force is estimated in each period; the present force, at
    /// drive `volts`, counts as zero.
    fn prepare(&mut self, period: f32, shown: &Shown, volts: f32, force: bool) -> bool;
    /// Returns the external force \[N\] from the voltage of this period and the readings at its end.
    ///
    /// `None` without an observer.
    fn force(&mut self, volts: f32, shown: &Shown) -> Option<f32>;
    /// Begins at the first reference, from the present readings and voltage.
    fn begin(&mut self, reference: f32, shown: &Shown, volts: f32);
    /// Returns the drive for the reference \[V\], before the limits of the run.
    fn step(&mut self, reference: f32, shown: &Shown) -> f32;
    /// Reports the applied drive, after the limits of the run \[V\].
    fn applied(&mut self, volts: f32);
    /// Returns whether a limit keeps the output away from the reference.
    fn limited(&self) -> bool;
    /// Returns the reference for the next measured output.
    ///
    /// A controller with preview gets references before they are due.
    fn due(&self) -> Option<f32>;
}

/// No controller: the device only plays voltages.
#[derive(Debug, Clone, Copy, Default)]
pub struct Open;

impl Control for Open {
    fn load(&mut self, _: &[u8]) -> bool {
        false
    }
    fn ready(&self) -> bool {
        false
    }
    fn prepare(&mut self, _: f32, _: &Shown, _: f32, _: bool) -> bool {
        false
    }
    fn force(&mut self, _: f32, _: &Shown) -> Option<f32> {
        None
    }
    fn begin(&mut self, _: f32, _: &Shown, _: f32) {}
    fn step(&mut self, reference: f32, _: &Shown) -> f32 {
        reference
    }
    fn applied(&mut self, _: f32) {}
    fn limited(&self) -> bool {
        false
    }
    fn due(&self) -> Option<f32> {
        None
    }
}

/// Time after which a saturated drive or a too large tracking error is a fault \[s\].
///
/// Devices and hosts use the same value.
pub const PATIENCE_S: f32 = 0.5;
/// Longest watchdog time of a run \[s\].
const MAX_SILENCE_S: f32 = 60.0;

/// A device with room for `Q` drives and samples and for `M` bytes of a model.
#[derive(Debug)]
pub struct Device<C, const Q: usize, const M: usize> {
    identity: Identity,
    control: C,
    model: Vec<u8, M>,
    /// Checksum and length of the model that is being received.
    sum: u32,
    total: u32,
    /// Whether the model is complete and the controller can run it.
    loaded: bool,
    state: State,
    run: Start,
    /// Whether there was a run since power-up.
    started: bool,
    tick: u32,
    present_v: f32,
    /// Last sensor readings.
    shown: Shown,
    /// Drives that are not yet played.
    queue: Deque<f32, Q>,
    received: u32,
    /// Samples that the host does not have yet; the last one has number `measured - 1`.
    history: Deque<Measured, Q>,
    measured: u32,
    /// Whether a drive was applied but not yet measured.
    out: bool,
    /// The present reference.
    reference: Option<f32>,
    /// Periods without a valid request of the host.
    silent_periods: u32,
    saturated: Lasting,
    off_reference: Lasting,
}

impl<C: Control, const Q: usize, const M: usize> Device<C, Q, M> {
    /// Returns a device at rest.
    pub fn new(identity: Identity, control: C) -> Self {
        let present_v = identity.rest_v;
        let (follows, rate_hz) = (identity.follows, identity.max_rate_hz);
        let identity = Identity { queue: Q as u32, model: if follows { M as u32 } else { 0 }, ..identity };
        Self {
            identity,
            control,
            model: Vec::new(),
            sum: 0,
            total: 0,
            loaded: false,
            state: State::Idle,
            run: Start {
                session: 0,
                mode: Mode::Voltage,
                rate_hz,
                low_v: present_v,
                high_v: present_v,
                slew_v_per_s: 1.0,
                hottest_degc: f32::INFINITY,
                error: f32::INFINITY,
                silence_s: 1.0,
                force: false,
            },
            started: false,
            tick: 0,
            present_v,
            shown: Shown::default(),
            queue: Deque::new(),
            received: 0,
            history: Deque::new(),
            measured: 0,
            out: false,
            reference: None,
            silent_periods: 0,
            saturated: Lasting::default(),
            off_reference: Lasting::default(),
        }
    }

    /// Returns the state.
    pub fn state(&self) -> State {
        self.state
    }

    /// Returns the rate at which [`tick`](Self::tick) must be called \[Hz\].
    ///
    /// It is the rate of the last run, or the largest rate before the first run.
    pub fn rate_hz(&self) -> f32 {
        self.run.rate_hz
    }

    /// Returns the status.
    pub fn status(&self) -> Status {
        // A drive needs a place in the queue, and later one in the history.
        let waiting = self.queue.len() + self.history.len() + usize::from(self.out);
        let free = Q.saturating_sub(waiting) as u32;
        Status {
            state: self.state,
            session: self.run.session,
            tick: self.tick,
            present_v: self.present_v,
            output: self.shown.output,
            received: self.received,
            room: self.received.saturating_add(free),
            measured: self.measured,
        }
    }

    /// Runs one period of the clock: measures the effect of the last drive and applies the next one.
    pub fn tick(&mut self, board: &mut impl Board) {
        let shown = board.measure();
        self.shown = shown;
        self.tick = self.tick.wrapping_add(1);
        let watches = self.state == State::Running && self.run.force;
        let force_n = if watches { self.control.force(self.present_v, &shown) } else { None };
        if core::mem::take(&mut self.out) {
            let Shown { output, temperature_degc, load_n } = shown;
            let sample =
                Measured { tick: self.tick, drive_v: self.present_v, output, temperature_degc, load_n, force_n };
            // There is room: a drive is accepted only if there is room for its sample.
            let _ = self.history.push_back(sample);
            self.measured = self.measured.wrapping_add(1);
        }
        self.watch(&shown);
        match self.state {
            State::Idle => {}
            State::Running => self.play(board, &shown),
            State::Stopping | State::Fault(_) => self.come_to_rest(board),
        }
    }

    /// Counts periods that have passed without a [`tick`](Self::tick), because other work took too long.
    ///
    /// No drive is applied for them, but time and watchdog count them. Periods during the preparation of a run are not
    /// counted: the host waits for the answer then.
    pub fn missed(&mut self, periods: u32) {
        if self.state == State::Running && self.tick == 0 {
            return;
        }
        self.tick = self.tick.wrapping_add(periods);
        self.silent_periods = self.silent_periods.saturating_add(periods);
    }

    fn step_v(&self) -> f32 {
        self.run.slew_v_per_s / self.run.rate_hz
    }

    fn watch(&mut self, shown: &Shown) {
        if self.state != State::Running {
            return;
        }
        self.silent_periods = self.silent_periods.saturating_add(1);
        let patience = PATIENCE_S * self.run.rate_hz;
        let has_number = shown.output.is_finite() && shown.temperature_degc.is_finite() && shown.load_n.is_finite();
        let fault = if !has_number {
            Some(Fault::Sensor)
        } else if self.identity.temperature && shown.temperature_degc > self.run.hottest_degc {
            Some(Fault::Temperature)
        } else if self.silent_periods as f32 > (self.run.silence_s * self.run.rate_hz).max(2.0) {
            Some(Fault::Silence)
        } else {
            self.reference.and_then(|_| self.control.due()).and_then(|reference| {
                let away = (reference - shown.output).abs() > self.run.error;
                self.off_reference.step(away, patience).then_some(Fault::TrackingError)
            })
        };
        if let Some(fault) = fault {
            self.fail(fault);
        }
    }

    fn fail(&mut self, fault: Fault) {
        self.state = State::Fault(fault);
        self.queue.clear();
        self.reference = None;
    }

    /// Applies the next drive; without one, holds the last voltage or reference.
    fn play(&mut self, board: &mut impl Board, shown: &Shown) {
        let next = self.queue.pop_front();
        let wanted = match (self.run.mode, next, self.reference) {
            (Mode::Nothing, next, _) => {
                self.out = next.is_some();
                return;
            }
            (Mode::Voltage, Some(volts), _) => volts,
            (Mode::Voltage, None, _) | (Mode::Reference, None, None) => return,
            (Mode::Reference, Some(reference), None) => {
                self.reference = Some(reference);
                self.control.begin(reference, shown, self.present_v);
                self.control.step(reference, shown)
            }
            (Mode::Reference, Some(reference), Some(_)) | (Mode::Reference, None, Some(reference)) => {
                self.reference = Some(reference);
                self.control.step(reference, shown)
            }
        };
        let (low, high, step) = (self.run.low_v, self.run.high_v, self.step_v());
        let wanted = if wanted.is_finite() { wanted } else { self.present_v };
        let inside = wanted.clamp(low, high);
        let beyond = self.run.mode == Mode::Reference && self.control.limited();
        self.present_v = inside.clamp(self.present_v - step, self.present_v + step);
        board.put_out(self.present_v);
        self.control.applied(self.present_v);
        self.out = next.is_some();
        if self.saturated.step(beyond, PATIENCE_S * self.run.rate_hz) {
            self.fail(Fault::Saturation);
        }
    }

    fn come_to_rest(&mut self, board: &mut impl Board) {
        let (rest, step) = (self.identity.rest_v, self.step_v());
        if self.present_v != rest {
            self.present_v = rest.clamp(self.present_v - step, self.present_v + step);
            board.put_out(self.present_v);
        } else if self.state == State::Stopping {
            self.state = State::Idle;
        }
    }

    /// Answers a request.
    pub fn answer(&mut self, request: &Request) -> Reply {
        let tell = match &request.ask {
            Ask::Hello => Tell::Version(PROTOCOL),
            Ask::Describe => Tell::Identity(self.identity.clone()),
            Ask::Start(start) => self.with_status(|device| device.start(start)),
            Ask::Exchange(exchange) => match self.exchange(exchange) {
                Ok(tell) => tell,
                Err(refusal) => Tell::Refused(refusal, self.status()),
            },
            Ask::Stop => self.with_status(|device| {
                device.stop();
                Ok(())
            }),
            Ask::Emergency => self.with_status(|device| {
                // It replaces an earlier fault: a host that has read only that one must not clear the emergency stop.
                device.fail(Fault::Emergency);
                Ok(())
            }),
            Ask::Clear(fault) => self.with_status(|device| device.clear(*fault)),
            Ask::Status => Tell::Status(self.status()),
            Ask::Model(chunk) => match self.take_model(chunk) {
                Ok(bytes) => Tell::ModelBytes(bytes),
                Err(refusal) => Tell::Refused(refusal, self.status()),
            },
        };
        Reply { number: request.number, tell }
    }

    /// Runs an action and answers with the status.
    fn with_status(&mut self, action: impl FnOnce(&mut Self) -> Result<(), Refusal>) -> Tell {
        match action(self) {
            Ok(()) => Tell::Status(self.status()),
            Err(refusal) => Tell::Refused(refusal, self.status()),
        }
    }

    fn start(&mut self, start: &Start) -> Result<(), Refusal> {
        if self.started && start.session == self.run.session {
            // A repeated request. A run that has ended does not begin again.
            let same = self.state == State::Running && self.run == *start;
            return if same { Ok(()) } else { Err(Refusal::Session) };
        }
        if self.state != State::Idle {
            return Err(Refusal::State);
        }
        let i = &self.identity;
        let within = |x: f32, low: f32, high: f32| x >= low && x <= high;
        for (fits, field) in [
            (within(start.rate_hz, i.min_rate_hz, i.max_rate_hz), Field::Rate),
            (
                start.low_v >= i.min_v
                    && start.high_v <= i.max_v
                    && within(i.rest_v, start.low_v, start.high_v)
                    && start.low_v < start.high_v,
                Field::Voltage,
            ),
            (start.slew_v_per_s > 0.0 && start.slew_v_per_s <= i.max_slew_v_per_s, Field::Slew),
            (start.silence_s > 0.0 && start.silence_s <= MAX_SILENCE_S, Field::Silence),
            (!start.hottest_degc.is_nan(), Field::Temperature),
            (start.error > 0.0, Field::Error),
        ] {
            if !fits {
                return Err(Refusal::Start(field));
            }
        }
        let follows = (start.mode == Mode::Reference || start.force)
            && self.control.prepare(1.0 / start.rate_hz, &self.shown, self.present_v, start.force);
        if start.mode == Mode::Reference && !(self.loaded && self.control.ready()) {
            return Err(Refusal::NoModel);
        }
        if start.mode == Mode::Reference && !follows {
            return Err(Refusal::Model);
        }
        self.run = *start;
        self.started = true;
        self.state = State::Running;
        self.queue.clear();
        self.history.clear();
        (self.tick, self.received, self.measured, self.silent_periods) = (0, 0, 0, 0);
        (self.saturated, self.off_reference) = (Lasting::default(), Lasting::default());
        (self.out, self.reference) = (false, None);
        Ok(())
    }

    fn stop(&mut self) {
        if self.state == State::Running {
            self.state = State::Stopping;
            self.queue.clear();
            self.reference = None;
        }
    }

    fn clear(&mut self, fault: Fault) -> Result<(), Refusal> {
        match self.state {
            State::Fault(present) if present == fault && self.present_v == self.identity.rest_v => {
                self.state = State::Idle;
            }
            State::Idle => {}
            _ => return Err(Refusal::State),
        }
        Ok(())
    }

    fn exchange(&mut self, exchange: &Exchange) -> Result<Tell, Refusal> {
        if !self.started || exchange.session != self.run.session {
            return Err(Refusal::Session);
        }
        // Drop the samples that the host has, up to the last measured one.
        let kept = self.measured.wrapping_sub(self.history.len() as u32);
        for _ in kept..exchange.heard.min(self.measured) {
            self.history.pop_front();
        }
        if self.state == State::Running {
            self.take_drives(exchange)?;
            // Only an accepted request resets the watchdog.
            self.silent_periods = 0;
        }
        let first = self.measured.wrapping_sub(self.history.len() as u32);
        let samples = self.history.iter().take(MOST_SAMPLES).copied().collect();
        Ok(Tell::Samples { status: self.status(), first, samples })
    }

    fn take_drives(&mut self, exchange: &Exchange) -> Result<(), Refusal> {
        // Skip drives that are already received; after a gap, accept none.
        let Some(known) = self.received.checked_sub(exchange.first) else { return Ok(()) };
        let Some(fresh) = exchange.drives.get(known as usize..) else { return Ok(()) };
        let (low, high) = match self.run.mode {
            Mode::Voltage => (self.run.low_v, self.run.high_v),
            Mode::Reference | Mode::Nothing => (f32::MIN, f32::MAX),
        };
        if let Some(k) = fresh.iter().position(|drive| !(low..=high).contains(drive)) {
            return Err(Refusal::Drive(self.received.wrapping_add(k as u32)));
        }
        let room = (self.status().room - self.received) as usize;
        for drive in fresh.iter().take(room) {
            if self.queue.push_back(*drive).is_err() {
                break;
            }
            self.received += 1;
        }
        Ok(())
    }

    fn take_model(&mut self, chunk: &Chunk) -> Result<u32, Refusal> {
        if self.state == State::Running {
            return Err(Refusal::State);
        }
        if chunk.total as usize > M || !self.identity.follows {
            return Err(Refusal::ModelSize);
        }
        // A part of another model restarts the upload. Repeated parts of the same model are skipped.
        if chunk.sum != self.sum || chunk.total != self.total {
            self.model.clear();
            (self.loaded, self.sum, self.total) = (false, chunk.sum, chunk.total);
        }
        let have = self.model.len() as u32;
        let Some(known) = have.checked_sub(chunk.offset) else { return Err(Refusal::ModelGap) };
        if let Some(fresh) = chunk.bytes.get(known as usize..)
            && !self.loaded
        {
            if self.model.len() + fresh.len() > chunk.total as usize || self.model.extend_from_slice(fresh).is_err() {
                return Err(Refusal::ModelSize);
            }
            if self.model.len() == chunk.total as usize {
                self.loaded = model_sum(&self.model) == self.sum && self.control.load(&self.model);
                if !self.loaded {
                    self.model.clear();
                    return Err(Refusal::Model);
                }
            }
        }
        Ok(self.model.len() as u32)
    }
}
