//! A host and a device over a line that loses, changes, truncates, repeats and swaps frames.

use std::collections::VecDeque;
use std::io;
use std::time::{Duration, Instant};

use hyst_hw::wire::{Deframer, Device, MAX_FRAME, Open, Request, State, encode};
use hyst_hw::{Daq, Line, Remote, RemoteError, RemoteOptions, Sample};

use super::board::{CheckedBoard, identity};
use super::random::Random;

/// The line and the device at its end, with simulated time.
struct Wire {
    device: Device<Open, 128, 0>,
    board: CheckedBoard,
    deframer: Deframer,
    random: Random,
    /// One frame in this number is disturbed; no frame if zero.
    disturbed_in: usize,
    /// Frames that arrive after later ones.
    late: Vec<Vec<u8>>,
    answers: VecDeque<u8>,
    start: Instant,
    now: Duration,
    /// Time up to which the device has run.
    device_time: Duration,
    /// Time until which no frame arrives.
    dead_until: Duration,
    /// Whether the line is disconnected.
    cut: bool,
    /// Whether the device waits for the end of a frame.
    incomplete: bool,
}

impl Wire {
    fn new(random: Random) -> Self {
        Self {
            device: Device::new(identity(false), Open),
            board: CheckedBoard::new(),
            deframer: Deframer::new(),
            random,
            disturbed_in: 0,
            late: Vec::new(),
            answers: VecDeque::new(),
            start: Instant::now(),
            now: Duration::ZERO,
            device_time: Duration::ZERO,
            dead_until: Duration::ZERO,
            cut: false,
            incomplete: false,
        }
    }

    fn pass(&mut self, time: Duration) {
        self.now += time;
        loop {
            let period = Duration::from_secs_f64(1.0 / f64::from(self.device.rate_hz()));
            if self.device_time + period > self.now {
                break;
            }
            self.device_time += period;
            self.device.tick(&mut self.board);
        }
    }

    /// Returns the bytes that arrive if a frame is sent.
    fn carried(&mut self, frame: &[u8]) -> Vec<u8> {
        let mut bytes = frame.to_vec();
        if self.now < self.dead_until {
            return Vec::new();
        }
        if self.random.once_in(self.disturbed_in) {
            match self.random.below(6) {
                0 => bytes.clear(),
                1 => bytes.extend_from_slice(frame),
                2 => {
                    self.late.push(std::mem::take(&mut bytes));
                    self.late.truncate(8);
                }
                3 => bytes = [self.random.bytes(80), bytes].concat(),
                _ => self.random.damage(&mut bytes),
            }
        }
        if self.random.once_in(if self.disturbed_in > 0 { 3 } else { 8 }) && !self.late.is_empty() {
            let which = self.random.below(self.late.len());
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
        self.incomplete = arrived.last().map_or(self.incomplete, |byte| *byte != 0);
        let (mut fresh, mut deframer) = (&arrived[..], self.deframer.clone());
        while let Some(request) = deframer.next::<Request>(&mut fresh) {
            let Ok(request) = request else { continue };
            let before = self.device.rate_hz();
            let reply = self.device.answer(&request);
            if self.device.rate_hz() != before {
                // Its clock starts again.
                self.device_time = self.now;
            }
            let frame = encode(&reply, &mut [0; MAX_FRAME]).expect("every reply fits a frame").to_vec();
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
        self.start + self.now
    }

    fn pause(&mut self, time: Duration) {
        self.pass(time);
    }
}

/// Computes the output of a device with a slew limit.
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

/// Plays some blocks. The samples must be those of the drives, in order and without a gap. Returns the error of a
/// failed exchange.
fn play(remote: &mut Remote<&mut Wire>, random: &mut Random, (low, high): (f64, f64), step: f32) -> Result<(), String> {
    let mut expected = Expected { volts: remote.present_v() as f32, step };
    let (mut wanted, mut measured) = (Vec::new(), Vec::<Sample>::new());
    let mut result = Ok(());
    for _ in 0..=random.below(4) {
        let mut drive: Vec<f64> = (0..=random.below(90)).map(|_| random.between(low, high)).collect();
        if random.once_in(2) {
            let held = drive[0];
            drive.fill(held);
        }
        let mut rest = &drive[..];
        while result.is_ok() && !rest.is_empty() {
            let before = measured.len();
            match remote.exchange(rest, &mut measured) {
                Ok(0) if measured.len() == before => result = Err("the device accepts no drive".to_owned()),
                Ok(taken) => {
                    wanted.extend(expected.drives(&rest[..taken]));
                    rest = &rest[taken..];
                }
                // The device may have played the drives although the reply was lost.
                Err(error) => {
                    wanted.extend(expected.drives(rest));
                    result = Err(error.to_string());
                }
            }
        }
        if result.is_ok() && random.once_in(4) {
            let bad = *random.of(&[f64::NAN, f64::INFINITY, high + 30.0, low - 30.0, 1e300]);
            if !(low..=high).contains(&bad) && !(-10.0..=100.0).contains(&bad) {
                remote.exchange(&[bad], &mut measured).expect_err("such a drive is rejected");
            }
        }
    }
    while result.is_ok() && measured.len() < wanted.len() {
        let before = measured.len();
        result = match remote.exchange(&[], &mut measured) {
            Ok(_) if measured.len() == before => Err("the device returns no sample".to_owned()),
            other => other.map(|_| ()).map_err(|error| error.to_string()),
        };
    }
    assert!(measured.len() <= wanted.len(), "{} samples for {} drives", measured.len(), wanted.len());
    for (k, (sample, volts)) in measured.iter().zip(&wanted).enumerate() {
        assert_eq!(sample.drive_v, f64::from(*volts), "sample {k}");
        assert_eq!(sample.output, f64::from(0.2 * volts), "sample {k}");
    }
    result
}

/// A run over a disturbed line, then the host disconnects; the device must serve the next host normally.
pub(super) fn case(random: &mut Random) {
    let mut wire = Wire::new(random.clone());
    wire.disturbed_in = *random.of(&[0, 2, 4, 10, 30]);
    let (low, high) = (random.between(-10.0, 0.0) as f32, random.between(40.0, 100.0) as f32);
    let rate_hz = *random.of(&[200.0, 1000.0, 4000.0]);
    let slew = *random.of(&[400.0, 5000.0, 50_000.0]);
    let session = random.number() as u32;
    let options = RemoteOptions {
        voltage: Some((low.into(), high.into())),
        slew_v_per_s: Some(slew),
        silence_s: random.between(0.1, 0.6),
        repeat: Duration::from_millis(20),
        lost: Duration::from_millis(400),
        ..RemoteOptions::with_session(session)
    };
    let step = slew as f32 / rate_hz as f32;
    (wire.board.low, wire.board.high, wire.board.step) = (low, high, step);
    let range = (f64::from(low), f64::from(high));

    first_host(&mut wire, random, options, rate_hz, (range, step));
    let time_to_rest = Duration::from_secs_f64(options.silence_s + 110.0 / slew + 20.0 / rate_hz);
    assert_rest(&mut wire, time_to_rest);
    // The line works again, except for frames that are still in transfer.
    (wire.disturbed_in, wire.dead_until, wire.cut) = (0, Duration::ZERO, false);
    let options = RemoteOptions { session: session ^ 0x8000_0000, ..options };
    // A frame that lacks only its end becomes valid when the next host sends.
    let nothing_pending = wire.late.is_empty() && !wire.incomplete;
    let result = next_host(&mut wire, random, options, rate_hz, (range, step));
    if result.is_err() || wire.device.state() != State::Idle {
        // Only a late start or stop of the earlier host may disturb the next host.
        assert!(!nothing_pending, "the next host: {result:?}, {:?}", wire.device.state());
        wire.late.clear();
        assert_rest(&mut wire, time_to_rest);
        let options = RemoteOptions { session: session ^ 0x4000_0000, ..options };
        next_host(&mut wire, random, options, rate_hz, (range, step))
            .unwrap_or_else(|e| panic!("the host after the next: {e}"));
    }
    assert_eq!((wire.device.state(), wire.board.volts), (State::Idle, 0.0));
}

/// Asserts that the device comes to rest without a host.
fn assert_rest(wire: &mut Wire, within: Duration) {
    wire.answers.clear();
    wire.pass(within);
    assert_ne!(wire.device.state(), State::Running, "the device runs without a host");
    assert_eq!(wire.board.volts, 0.0, "the device is not at rest: {:?}", wire.device.state());
}

/// Connects a later host and plays some blocks.
fn next_host(
    wire: &mut Wire,
    random: &mut Random,
    options: RemoteOptions,
    rate_hz: f64,
    (range, step): Limits,
) -> Result<(), String> {
    let message = |error: RemoteError| error.to_string();
    let mut remote = Remote::open(&mut *wire, "again", options).map_err(message)?;
    remote.clear().map_err(message)?;
    remote.start(rate_hz).map_err(message)?;
    play(&mut remote, random, range, step)?;
    remote.stop().map_err(message)
}

type Limits = ((f64, f64), f32);

fn first_host(wire: &mut Wire, random: &mut Random, options: RemoteOptions, rate_hz: f64, (range, step): Limits) {
    let Ok(mut remote) = Remote::open(&mut *wire, "fuzz", options) else { return };
    for _ in 0..=random.below(3) {
        if random.once_in(8) {
            let line = remote.line_mut();
            line.dead_until = line.now + Duration::from_secs_f64(random.between(0.0, 1.0));
        }
        let succeeded = match random.below(12) {
            0 => remote.emergency_stop().is_ok(),
            1 => remote.clear().is_ok(),
            2 => remote.rest(random.between(0.0, 0.05)).is_ok(),
            3 => remote.stop().is_ok(),
            4 => {
                remote.line_mut().cut = true;
                false
            }
            _ => remote.start(rate_hz).is_ok() && play(&mut remote, random, range, step).is_ok(),
        };
        // Some hosts give up, some try again.
        if !succeeded && random.once_in(2) {
            return;
        }
    }
    if random.once_in(2) {
        let _ = remote.stop();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With the default timeouts and watchdog of a run, a bad line does not stop the run.
    #[test]
    fn line_errors_do_not_trigger_the_watchdog() {
        for seed in 0..20 {
            let mut wire = Wire::new(Random::new(seed));
            wire.disturbed_in = 12;
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
