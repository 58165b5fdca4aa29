//! The device's side of the protocol: its state, and the work in each period of the clock.
//!
//! There is no line, no clock and no pin here. Firmware and tests provide their own.

mod answer;

use heapless::{Deque, Vec};

use super::board::{Board, Shown};
use super::control::Control;
use super::lasting::Lasting;
use super::message::{Fault, Identity, Measured, Mode, Start, State, Status};

/// Time after which a saturated drive or a too large tracking error is a fault \[s\].
///
/// Devices and hosts use the same value.
pub const PATIENCE_S: f32 = 0.5;

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
}
