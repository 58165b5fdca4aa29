//! The device's answers to requests.

use super::Device;
use crate::wire::control::Control;
use crate::wire::lasting::Lasting;
use crate::wire::message::{
    Ask, Chunk, Exchange, Fault, Field, MOST_SAMPLES, Mode, PROTOCOL, Refusal, Reply, Request, Start, State, Tell,
    model_sum,
};

/// Longest watchdog time of a run \[s\].
const MAX_SILENCE_S: f32 = 60.0;

impl<C: Control, const Q: usize, const M: usize> Device<C, Q, M> {
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
