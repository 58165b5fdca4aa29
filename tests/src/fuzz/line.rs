//! A host, a device, and between them a line that loses, changes, cuts, doubles and swaps what it carries.

use std::collections::VecDeque;
use std::io;
use std::time::{Duration, Instant};

use hyst_hw::wire::{Deframer, Device, MAX_FRAME, Open, Request, State, encode};
use hyst_hw::{Daq, Line, Remote, RemoteError, RemoteOptions, Sample};

use super::luck::Luck;
use super::watched::{Watched, identity};

/// The line and what is at its far end, on a clock of their own.
struct Wire {
    device: Device<Open, 128, 0>,
    board: Watched,
    deframer: Deframer,
    luck: Luck,
    /// One frame in so many has an accident; none if zero.
    accident: usize,
    /// Frames that come after later ones.
    late: Vec<Vec<u8>>,
    answers: VecDeque<u8>,
    began: Instant,
    now: Duration,
    /// Time that the device has lived through.
    lived: Duration,
    /// Until when nothing gets through.
    deaf: Duration,
    /// Whether the line is gone.
    cut: bool,
    /// Whether the device waits for the end of a frame.
    begun: bool,
}

impl Wire {
    fn new(luck: Luck) -> Self {
        Self {
            device: Device::new(identity(false), Open),
            board: Watched::new(),
            deframer: Deframer::new(),
            luck,
            accident: 0,
            late: Vec::new(),
            answers: VecDeque::new(),
            began: Instant::now(),
            now: Duration::ZERO,
            lived: Duration::ZERO,
            deaf: Duration::ZERO,
            cut: false,
            begun: false,
        }
    }

    fn pass(&mut self, time: Duration) {
        self.now += time;
        loop {
            let period = Duration::from_secs_f64(1.0 / f64::from(self.device.rate_hz()));
            if self.lived + period > self.now {
                break;
            }
            self.lived += period;
            self.device.tick(&mut self.board);
        }
    }

    /// What arrives when a frame is sent.
    fn carried(&mut self, frame: &[u8]) -> Vec<u8> {
        let mut bytes = frame.to_vec();
        if self.now < self.deaf {
            return Vec::new();
        }
        if self.luck.once_in(self.accident) {
            match self.luck.below(6) {
                0 => bytes.clear(),
                1 => bytes.extend_from_slice(frame),
                2 => {
                    self.late.push(std::mem::take(&mut bytes));
                    self.late.truncate(8);
                }
                3 => bytes = [self.luck.bytes(80), bytes].concat(),
                _ => self.luck.damage(&mut bytes),
            }
        }
        if self.luck.once_in(if self.accident > 0 { 3 } else { 8 }) && !self.late.is_empty() {
            let which = self.luck.below(self.late.len());
            bytes.extend(self.late.remove(which));
        }
        bytes
    }
}

impl Line for &mut Wire {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        if self.cut {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        let arrived = if bytes.len() > 1 { self.carried(bytes) } else { bytes.to_vec() };
        self.begun = arrived.last().map_or(self.begun, |byte| *byte != 0);
        let (mut fresh, mut deframer) = (&arrived[..], self.deframer.clone());
        while let Some(request) = deframer.next::<Request>(&mut fresh) {
            let Ok(request) = request else { continue };
            let before = self.device.rate_hz();
            let reply = self.device.answer(&request);
            if self.device.rate_hz() != before {
                // Its clock begins anew.
                self.lived = self.now;
            }
            let frame = encode(&reply, &mut [0; MAX_FRAME]).expect("every answer is a frame").to_vec();
            let back = self.carried(&frame);
            self.answers.extend(back);
        }
        self.deframer = deframer;
        Ok(())
    }

    fn receive(&mut self, bytes: &mut [u8], patience: Duration) -> io::Result<usize> {
        if self.cut {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        self.pass(if self.answers.is_empty() { patience } else { Duration::from_micros(300) });
        let count = bytes.len().min(self.answers.len());
        self.answers.drain(..count).zip(bytes).for_each(|(from, to)| *to = from);
        Ok(count)
    }

    fn now(&mut self) -> Instant {
        self.began + self.now
    }

    fn pause(&mut self, time: Duration) {
        self.pass(time);
    }
}

/// What a device makes of drives within its slew.
struct Expected {
    volts: f32,
    step: f32,
}

impl Expected {
    fn drives(&mut self, drive: &[f64]) -> Vec<f32> {
        let one = |volts: &f64| {
            self.volts = (*volts as f32).clamp(self.volts - self.step, self.volts + self.step);
            self.volts
        };
        drive.iter().map(one).collect()
    }
}

/// Plays a few blocks; what comes back has to be what was sent, in order and without a gap. Else says
/// what did not go well.
fn plays(remote: &mut Remote<&mut Wire>, luck: &mut Luck, (low, high): (f64, f64), step: f32) -> Result<(), String> {
    let mut expected = Expected { volts: remote.present_v() as f32, step };
    let (mut wanted, mut measured) = (Vec::new(), Vec::<Sample>::new());
    let mut well = Ok(());
    for _ in 0..=luck.below(4) {
        let mut drive: Vec<f64> = (0..=luck.below(90)).map(|_| luck.between(low, high)).collect();
        if luck.once_in(2) {
            let held = drive[0];
            drive.fill(held);
        }
        let mut rest = &drive[..];
        while well.is_ok() && !rest.is_empty() {
            let before = measured.len();
            match remote.exchange(rest, &mut measured) {
                Ok(0) if measured.len() == before => well = Err("it takes nothing".to_owned()),
                Ok(taken) => {
                    wanted.extend(expected.drives(&rest[..taken]));
                    rest = &rest[taken..];
                }
                // What was lost with the answer may have been played all the same.
                Err(error) => {
                    wanted.extend(expected.drives(rest));
                    well = Err(error.to_string());
                }
            }
        }
        if well.is_ok() && luck.once_in(4) {
            let bad = *luck.of(&[f64::NAN, f64::INFINITY, high + 30.0, low - 30.0, 1e300]);
            if !(low..=high).contains(&bad) && !(-10.0..=100.0).contains(&bad) {
                remote.exchange(&[bad], &mut measured).expect_err("such a drive is refused");
            }
        }
    }
    while well.is_ok() && measured.len() < wanted.len() {
        let before = measured.len();
        well = match remote.exchange(&[], &mut measured) {
            Ok(_) if measured.len() == before => Err("it gives nothing".to_owned()),
            other => other.map(|_| ()).map_err(|error| error.to_string()),
        };
    }
    assert!(measured.len() <= wanted.len(), "{} samples of {} drives", measured.len(), wanted.len());
    for (k, (sample, volts)) in measured.iter().zip(&wanted).enumerate() {
        assert_eq!(sample.drive_v, f64::from(*volts), "sample {k}");
        assert_eq!(sample.output, f64::from(0.2 * volts), "sample {k}");
    }
    well
}

/// A run with accidents, a host that goes, and the next one, whom the device serves as if nothing had been.
pub(super) fn case(luck: &mut Luck) {
    let mut wire = Wire::new(luck.clone());
    wire.accident = *luck.of(&[0, 2, 4, 10, 30]);
    let (low, high) = (luck.between(-10.0, 0.0) as f32, luck.between(40.0, 100.0) as f32);
    let rate_hz = *luck.of(&[200.0, 1000.0, 4000.0]);
    let slew = *luck.of(&[400.0, 5000.0, 50_000.0]);
    let session = luck.number() as u32;
    let options = RemoteOptions {
        voltage: Some((low.into(), high.into())),
        slew_v_per_s: Some(slew),
        silence_s: luck.between(0.1, 0.6),
        repeat: Duration::from_millis(20),
        lost: Duration::from_millis(400),
        ..RemoteOptions::with_session(session)
    };
    let step = slew as f32 / rate_hz as f32;
    (wire.board.low, wire.board.high, wire.board.step) = (low, high, step);
    let range = (f64::from(low), f64::from(high));

    first_host(&mut wire, luck, options, rate_hz, (range, step));
    let rests = Duration::from_secs_f64(options.silence_s + 110.0 / slew + 20.0 / rate_hz);
    at_rest(&mut wire, rests);
    // The line is sound again, but for frames that are still on their way.
    (wire.accident, wire.deaf, wire.cut) = (0, Duration::ZERO, false);
    let options = RemoteOptions { session: session ^ 0x8000_0000, ..options };
    // A frame that has lost no more than its end is one as soon as the next host speaks.
    let all_are_in = wire.late.is_empty() && !wire.begun;
    let served = next_host(&mut wire, luck, options, rate_hz, (range, step));
    if served.is_err() || wire.device.state() != State::Idle {
        // Somebody who has gone said start or stop, and that came now. Nothing else may come between.
        assert!(!all_are_in, "the next host: {served:?}, {:?}", wire.device.state());
        wire.late.clear();
        at_rest(&mut wire, rests);
        let options = RemoteOptions { session: session ^ 0x4000_0000, ..options };
        next_host(&mut wire, luck, options, rate_hz, (range, step)).unwrap_or_else(|e| panic!("the next but one: {e}"));
    }
    assert_eq!((wire.device.state(), wire.board.volts), (State::Idle, 0.0));
}

/// Nobody is there: whatever was going on ends at rest.
fn at_rest(wire: &mut Wire, within: Duration) {
    wire.answers.clear();
    wire.pass(within);
    assert_ne!(wire.device.state(), State::Running, "it runs without a host");
    assert_eq!(wire.board.volts, 0.0, "it is not at rest: {:?}", wire.device.state());
}

/// A host that comes later plays something.
fn next_host(
    wire: &mut Wire,
    luck: &mut Luck,
    options: RemoteOptions,
    rate_hz: f64,
    (range, step): Limits,
) -> Result<(), String> {
    let said = |error: RemoteError| error.to_string();
    let mut remote = Remote::open(&mut *wire, "again", options).map_err(said)?;
    remote.clear().map_err(said)?;
    remote.start(rate_hz).map_err(said)?;
    plays(&mut remote, luck, range, step)?;
    remote.stop().map_err(said)
}

type Limits = ((f64, f64), f32);

fn first_host(wire: &mut Wire, luck: &mut Luck, options: RemoteOptions, rate_hz: f64, (range, step): Limits) {
    let Ok(mut remote) = Remote::open(&mut *wire, "fuzz", options) else { return };
    for _ in 0..=luck.below(3) {
        if luck.once_in(8) {
            let line = remote.line_mut();
            line.deaf = line.now + Duration::from_secs_f64(luck.between(0.0, 1.0));
        }
        let went = match luck.below(12) {
            0 => remote.emergency_stop().is_ok(),
            1 => remote.clear().is_ok(),
            2 => remote.rest(luck.between(0.0, 0.05)).is_ok(),
            3 => remote.stop().is_ok(),
            4 => {
                remote.line_mut().cut = true;
                false
            }
            _ => remote.start(rate_hz).is_ok() && plays(&mut remote, luck, range, step).is_ok(),
        };
        // Some hosts give up, some try again.
        if !went && luck.once_in(2) {
            return;
        }
    }
    if luck.once_in(2) {
        let _ = remote.stop();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With the waits and the watchdog that a run has by default, a bad line does not cost the run.
    #[test]
    fn accidents_do_not_wake_the_watchdog() {
        for seed in 0..20 {
            let mut wire = Wire::new(Luck::new(seed));
            wire.accident = 12;
            (wire.board.low, wire.board.high, wire.board.step) = (0.0, 80.0, 1.0);
            let options = RemoteOptions { slew_v_per_s: Some(1000.0), ..RemoteOptions::with_session(7) };
            let mut remote = Remote::open(&mut wire, "bad", options).unwrap();
            remote.start(1000.0).unwrap();
            let drive: Vec<f64> = (0..3000).map(|k| 40.0 - 40.0 * (0.01 * f64::from(k)).cos()).collect();
            let (mut sent, mut measured) = (0, Vec::new());
            while measured.len() < drive.len() {
                sent += remote.exchange(&drive[sent..], &mut measured).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
            }
            assert!(measured.iter().zip(&drive).all(|(sample, volts)| sample.drive_v == f64::from(*volts as f32)));
            remote.stop().unwrap();
        }
    }
}
