//! The device's side: what it does with requests and with each period of its clock. No bytes, no clock and no pins: firmware brings
//! those, tests bring others.

use heapless::{Deque, Vec};

use super::lasting::Lasting;
use super::message::{
    Ask, Chunk, Exchange, Fault, Field, Identity, MOST_SAMPLES, Measured, Mode, PROTOCOL, Refusal, Reply, Request,
    Start, State, Status, Tell, model_sum,
};

/// What the sensors show.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Shown {
    /// The output, in the device's unit.
    pub output: f32,
    /// Temperature \[°C\]; zero where there is none.
    pub temperature_degc: f32,
    /// Load \[N\]; zero where there is none.
    pub load_n: f32,
}

/// The amplifier and the sensors.
pub trait Board {
    /// What the sensors show now.
    fn measure(&mut self) -> Shown;
    /// Puts out a voltage \[V\].
    fn put_out(&mut self, volts: f32);
}

/// What follows a reference: an inverse, a controller, both.
pub trait Control {
    /// Takes a model, as [`hyst-core`'s block](https://docs.rs/hyst-core) of bytes. Gives whether it can run it.
    fn load(&mut self, block: &[u8]) -> bool;
    /// Whether there is a model to follow with.
    fn ready(&self) -> bool;
    /// Prepares a run of this period \[s\] that begins at rest: all that takes time is done here. With `force` the external force is
    /// estimated in each period, from none now at `volts` on. Gives whether references can be followed.
    fn prepare(&mut self, period: f32, shown: &Shown, volts: f32, force: bool) -> bool;
    /// Force on the output \[N\], from what was put out for this period and what is shown at its end; `None` without an observer.
    fn force(&mut self, volts: f32, shown: &Shown) -> Option<f32>;
    /// Begins to follow, at the first reference, from what is shown and put out.
    fn begin(&mut self, reference: f32, shown: &Shown, volts: f32);
    /// The drive that the reference asks for \[V\], which the limits may still change.
    fn step(&mut self, reference: f32, shown: &Shown) -> f32;
    /// What limits made of that drive \[V\].
    fn applied(&mut self, volts: f32);
    /// Whether a limit keeps the output away from its reference.
    fn limited(&self) -> bool;
    /// The reference at which the output should be when it is measured next: what looks ahead is given references before they are due.
    fn due(&self) -> Option<f32>;
}

/// Without a model: a device that only plays voltages.
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

/// How long the drive may stand at a limit, or the output be away from the reference, before that is a fault \[s\]; on a device as on its host.
pub const PATIENCE_S: f32 = 0.5;
/// Longest silence that a run may allow \[s\].
const LONGEST_SILENCE_S: f32 = 60.0;

/// A device with room for `Q` drives and samples, and for `M` bytes of a model.
#[derive(Debug)]
pub struct Device<C, const Q: usize, const M: usize> {
    identity: Identity,
    control: C,
    model: Vec<u8, M>,
    /// Check sum and length of the model whose parts come.
    sum: u32,
    total: u32,
    /// Whether all bytes of the model have come and are one that runs.
    loaded: bool,
    state: State,
    run: Start,
    /// Whether there was a run.
    started: bool,
    tick: u32,
    present_v: f32,
    /// What the sensors showed last.
    shown: Shown,
    /// Drives that wait.
    queue: Deque<f32, Q>,
    received: u32,
    /// Samples that the host has not heard yet, the last of them number `measured - 1`.
    history: Deque<Measured, Q>,
    measured: u32,
    /// A drive was put out that has not been measured yet.
    out: bool,
    /// The reference that is followed now.
    reference: Option<f32>,
    quiet: u32,
    saturated: Lasting,
    astray: Lasting,
}

impl<C: Control, const Q: usize, const M: usize> Device<C, Q, M> {
    /// At rest.
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
            quiet: 0,
            saturated: Lasting::default(),
            astray: Lasting::default(),
        }
    }

    /// What it does.
    pub fn state(&self) -> State {
        self.state
    }

    /// Rate at which [`tick`](Self::tick) has to come \[Hz\]: that of the last run, before it the fastest. Where the identity leaves a choice, the clock has to follow.
    pub fn rate_hz(&self) -> f32 {
        self.run.rate_hz
    }

    /// How it stands.
    pub fn status(&self) -> Status {
        // A drive needs a place in the queue now and one in the history later.
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

    /// One period of the clock: what the last drive made is measured, the next one is put out.
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
            // There is room: a drive is only taken where there is.
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

    /// Periods that have passed without a [`tick`](Self::tick), because something else took too long: nothing is put out for them, but they count.
    /// Those in which a run was being prepared do not: its host waited for the answer.
    pub fn missed(&mut self, periods: u32) {
        if self.state == State::Running && self.tick == 0 {
            return;
        }
        self.tick = self.tick.wrapping_add(periods);
        self.quiet = self.quiet.saturating_add(periods);
    }

    fn step_v(&self) -> f32 {
        self.run.slew_v_per_s / self.run.rate_hz
    }

    fn watch(&mut self, shown: &Shown) {
        if self.state != State::Running {
            return;
        }
        self.quiet = self.quiet.saturating_add(1);
        let patience = PATIENCE_S * self.run.rate_hz;
        let has_number = shown.output.is_finite() && shown.temperature_degc.is_finite() && shown.load_n.is_finite();
        let fault = if !has_number {
            Some(Fault::Sensor)
        } else if self.identity.temperature && shown.temperature_degc > self.run.hottest_degc {
            Some(Fault::Temperature)
        } else if self.quiet as f32 > (self.run.silence_s * self.run.rate_hz).max(2.0) {
            Some(Fault::Silence)
        } else {
            self.reference.and_then(|_| self.control.due()).and_then(|reference| {
                let away = (reference - shown.output).abs() > self.run.error;
                self.astray.step(away, patience).then_some(Fault::TrackingError)
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

    /// The next drive; without one the last voltage, or reference, is held.
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
            Ask::Start(start) => self.told(|device| device.start(start)),
            Ask::Exchange(exchange) => match self.exchange(exchange) {
                Ok(tell) => tell,
                Err(refusal) => Tell::Refused(refusal, self.status()),
            },
            Ask::Stop => self.told(|device| {
                device.stop();
                Ok(())
            }),
            Ask::Emergency => self.told(|device| {
                // Over another fault too: who has seen that one is not to clear this.
                device.fail(Fault::Emergency);
                Ok(())
            }),
            Ask::Clear(fault) => self.told(|device| device.clear(*fault)),
            Ask::Status => Tell::Status(self.status()),
            Ask::Model(chunk) => match self.take_model(chunk) {
                Ok(bytes) => Tell::ModelBytes(bytes),
                Err(refusal) => Tell::Refused(refusal, self.status()),
            },
        };
        Reply { number: request.number, tell }
    }

    fn told(&mut self, does: impl FnOnce(&mut Self) -> Result<(), Refusal>) -> Tell {
        match does(self) {
            Ok(()) => Tell::Status(self.status()),
            Err(refusal) => Tell::Refused(refusal, self.status()),
        }
    }

    fn start(&mut self, start: &Start) -> Result<(), Refusal> {
        if self.started && start.session == self.run.session {
            // Asked twice. A run that is over does not begin again.
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
            (start.silence_s > 0.0 && start.silence_s <= LONGEST_SILENCE_S, Field::Silence),
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
        (self.tick, self.received, self.measured, self.quiet) = (0, 0, 0, 0);
        (self.saturated, self.astray) = (Lasting::default(), Lasting::default());
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
            State::Fault(stands) if stands == fault && self.present_v == self.identity.rest_v => {
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
        // What it hears no more it need not keep; the host cannot have heard what was not measured.
        let kept = self.measured.wrapping_sub(self.history.len() as u32);
        for _ in kept..exchange.heard.min(self.measured) {
            self.history.pop_front();
        }
        if self.state == State::Running {
            self.take_drives(exchange)?;
            // Who asks for nothing but what is refused is no host that looks after its run.
            self.quiet = 0;
        }
        let first = self.measured.wrapping_sub(self.history.len() as u32);
        let samples = self.history.iter().take(MOST_SAMPLES).copied().collect();
        Ok(Tell::Samples { status: self.status(), first, samples })
    }

    fn take_drives(&mut self, exchange: &Exchange) -> Result<(), Refusal> {
        // Those that came before are passed over; after a gap nothing is taken.
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
        // A part of another model than the last one begins it anew; of the same one what comes twice is passed over.
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
