//! Runs of a device at the other end of a line, with the interface [`Daq`].

use std::time::Duration;

use super::clock::Clock;
use super::error::RemoteError;
use super::line::Line;
use super::run::Run;
use super::{REST_TIMEOUT, Remote};
use crate::daq::{Capabilities, ClockFit, Daq, Sample, VoltageRange};
use crate::wire::{Ask, MOST_DRIVES, Mode, Refusal, Start, State, Tell};

/// Margin for sensor noise at both ends of the reference range, as a share of the range.
const REFERENCE_MARGIN: f64 = 0.05;

impl<L: Line> Remote<L> {
    /// Refuses an exchange without progress: the clock of the device has stopped, and its watchdog with it.
    fn require_progress(&self, taken: usize, measured: &[Sample]) -> Result<(), RemoteError> {
        if taken > 0 || !measured.is_empty() {
            return Ok(());
        }
        Err(RemoteError::Stands { line: self.link.name.clone(), seconds: self.answer_timeout().as_secs_f64() })
    }

    /// Returns the time in which the device must come to rest at its slew limit.
    fn rest_timeout(&self) -> Duration {
        let slew = self.slew();
        let ramp = f64::from(self.identity.max_v - self.identity.min_v) / slew.max(f64::MIN_POSITIVE);
        REST_TIMEOUT + Duration::from_secs_f64(ramp.clamp(0.0, 1e6))
    }

    /// Sends one exchange request of a run and returns the number of accepted drives.
    fn exchange_once(
        &mut self,
        run: &mut Run,
        drive_v: &[f64],
        measured: &mut Vec<Sample>,
    ) -> Result<usize, RemoteError> {
        match self.ask(Ask::Exchange(run.next_exchange(drive_v)))? {
            Tell::Samples { status, first, samples } => {
                if let (Some(clock), Some((asked, answered))) = (&mut self.clock, self.link.round_trip) {
                    clock.add_reading(asked, answered, run.periods(status.tick));
                }
                if status.state != State::Running {
                    // Fetch the remaining samples: they show what led to the end of the run.
                    let mut whole = run.append_samples(&self.identity, first, &samples, measured);
                    for _ in 0..status.measured.wrapping_sub(run.heard) {
                        whole = whole && run.heard != status.measured && self.fetch_samples(run, measured);
                    }
                    let line = self.link.name.clone();
                    return Err(match status.state {
                        State::Fault(fault) => RemoteError::Fault { line, fault },
                        _ => RemoteError::Stopped { line },
                    });
                }
                let taken = status.received.wrapping_sub(run.sent) as usize;
                if taken > drive_v.len() || !run.append_samples(&self.identity, first, &samples, measured) {
                    return Err(self.link.unexpected_answer());
                }
                (run.sent, run.room) = (status.received, status.room);
                self.present_v = match drive_v[..taken].last() {
                    Some(last) => *last,
                    None => self.present_v,
                };
                Ok(taken)
            }
            Tell::Refused(refusal, status) => match (status.state, refusal) {
                (State::Fault(fault), _) => Err(RemoteError::Fault { line: self.link.name.clone(), fault }),
                (_, Refusal::Drive(_)) => Err(self.refused(refusal)),
                _ => Err(RemoteError::Left { line: self.link.name.clone(), refusal }),
            },
            _ => Err(self.link.unexpected_answer()),
        }
    }

    /// Fetches samples of a run that has ended; returns whether any arrived.
    fn fetch_samples(&mut self, run: &mut Run, measured: &mut Vec<Sample>) -> bool {
        match self.ask(Ask::Exchange(run.next_exchange(&[]))) {
            Ok(Tell::Samples { first, samples, .. }) => {
                !samples.is_empty() && run.append_samples(&self.identity, first, &samples, measured)
            }
            _ => false,
        }
    }

    /// Exchanges until the device has accepted a drive or measured a sample.
    fn exchange_until_progress(&mut self, drive_v: &[f64], measured: &mut Vec<Sample>) -> Result<usize, RemoteError> {
        let mut run = self.run.ok_or(RemoteError::Order)?;
        let (before, began) = (measured.len(), self.link.line.now());
        loop {
            let outcome = self.exchange_once(&mut run, drive_v, measured);
            self.run = Some(run);
            let taken = outcome?;
            let outstanding = run.sent != run.heard;
            if taken > 0 || measured.len() > before || !outstanding && drive_v.is_empty() {
                return Ok(taken);
            }
            if self.link.since(began) > self.answer_timeout() {
                // The runner reports this as a stalled device.
                return Ok(0);
            }
            self.link.line.pause(Duration::from_micros(200));
        }
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
            return Err(RemoteError::Rate { line: self.link.name.clone(), asked_hz: rate_hz, low_hz, high_hz });
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
        self.clock = Some(Clock::new(1.0 / rate_hz, self.link.line.now()));
        self.run = Some(Run::new(o.session, rate_hz, status.room));
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
        let (began, longest) = (self.link.line.now(), self.rest_timeout());
        loop {
            let status = self.ask_status(Ask::Stop)?;
            let at_rest = matches!(status.state, State::Fault(_)) && status.present_v == self.identity.rest_v;
            if status.state == State::Idle || at_rest {
                self.run = None;
                return Ok(());
            }
            if self.link.since(began) > longest {
                return Err(RemoteError::Restless { line: self.link.name.clone(), seconds: longest.as_secs_f64() });
            }
            self.link.line.pause(Duration::from_millis(2));
        }
    }
}
