//! A device over a line that loses, changes, duplicates and reorders frames.

use std::collections::VecDeque;
use std::ops::ControlFlow;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};

use super::*;
use crate::runner::STOP_CHECK_S;
use crate::wire::{Board, CanData, Device, Open, Shown};
use crate::{Cause, RecordOptions, record};
use proptest::prelude::*;

/// An amplifier whose sensor shows half the voltage of the previous period.
///
/// It stores all output voltages.
#[derive(Debug, Default)]
struct Echo {
    volts: f32,
    put_out: Vec<f32>,
}

impl Board for Echo {
    fn measure(&mut self) -> Shown {
        Shown { output: 0.5 * self.volts, temperature_degc: 20.0, load_n: 0.0 }
    }
    fn put_out(&mut self, volts: f32) {
        self.volts = volts;
        self.put_out.push(volts);
    }
}

fn identity() -> Identity {
    Identity {
        name: b"echo".iter().copied().collect(),
        min_v: -10.0,
        max_v: 100.0,
        rest_v: 0.0,
        max_slew_v_per_s: 50_000.0,
        min_rate_hz: 1.0,
        max_rate_hz: 10_000.0,
        output: Unit::Micrometre,
        temperature: true,
        load: false,
        follows: false,
        queue: 0,
        model: 0,
    }
}

/// Random numbers for the faults of the line.
#[derive(Debug)]
struct Luck(u64);

impl Luck {
    /// Returns a random number below `n`.
    fn below(&mut self, n: u64) -> u64 {
        // SplitMix64 (Steele, Lea and Flood 2014).
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let z = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) % n
    }
}

/// A device and the line to it. Each `receive` advances the time.
struct Bench {
    device: Device<Open, 128, 0>,
    board: Echo,
    deframer: Deframer,
    /// One frame in this number is faulty; none if zero.
    fault_interval: u64,
    luck: Luck,
    /// Delayed frames.
    late: Vec<Vec<u8>>,
    answers: VecDeque<u8>,
    cut: bool,
    /// Its clock has stopped: it answers, but does nothing else.
    frozen: bool,
}

impl Bench {
    fn new(fault_interval: u64, seed: u64) -> Self {
        Self {
            device: Device::new(identity(), Open),
            board: Echo::default(),
            deframer: Deframer::new(),
            fault_interval,
            luck: Luck(seed),
            late: Vec::new(),
            answers: VecDeque::new(),
            cut: false,
            frozen: false,
        }
    }

    fn pass(&mut self, periods: u32) {
        let periods = if self.frozen { 0 } else { periods };
        (0..periods).for_each(|_| self.device.tick(&mut self.board));
    }

    /// Returns the bytes of a frame that arrive.
    fn carried(&mut self, frame: &[u8]) -> Vec<u8> {
        let mut bytes = frame.to_vec();
        if self.fault_interval == 0 || self.luck.below(self.fault_interval) > 0 {
            return bytes;
        }
        let at = self.luck.below(bytes.len() as u64) as usize;
        match self.luck.below(6) {
            0 => bytes.clear(),
            1 => bytes[at] ^= 1 << self.luck.below(8),
            2 => bytes.truncate(at),
            3 => bytes.extend_from_slice(frame),
            4 => {
                // It arrives after a later frame, once or twice.
                self.late.push(bytes.clone());
                bytes.clear();
            }
            _ => drop(bytes.remove(at)),
        }
        if self.luck.below(2) == 0
            && let Some(late) = self.late.pop()
        {
            bytes.extend(late);
        }
        bytes
    }

    fn take(&mut self, bytes: &[u8]) {
        let mut fresh = bytes;
        let mut deframer = self.deframer.clone();
        while let Some(request) = deframer.next::<Request>(&mut fresh) {
            let Ok(request) = request else { continue };
            let reply = self.device.answer(&request);
            let frame = encode(&reply, &mut [0; MAX_FRAME]).unwrap().to_vec();
            let carried = self.carried(&frame);
            self.answers.extend(carried);
        }
        self.deframer = deframer;
    }
}

impl Line for &mut Bench {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        if self.cut {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        let carried = if bytes.len() > 1 { self.carried(bytes) } else { bytes.to_vec() };
        self.take(&carried);
        Ok(())
    }

    fn receive(&mut self, bytes: &mut [u8], patience: Duration) -> io::Result<usize> {
        if self.cut {
            return Err(io::ErrorKind::BrokenPipe.into());
        }
        self.pass(3);
        if self.answers.is_empty() {
            std::thread::sleep(patience.min(Duration::from_micros(300)));
        }
        let n = bytes.len().min(self.answers.len());
        self.answers.drain(..n).zip(bytes).for_each(|(from, to)| *to = from);
        Ok(n)
    }
}

fn options() -> RemoteOptions {
    RemoteOptions {
        repeat: Duration::from_millis(1),
        // The test controls the time, so the watchdog must not end the run.
        silence_s: 50.0,
        ..RemoteOptions::with_session(7)
    }
}

fn wave(n: usize) -> Vec<f64> {
    (0..n).map(|k| 50.0 - 50.0 * (k as f64 * 0.01).cos()).collect()
}

/// Plays two segments and compares the samples with the drives.
fn check_complete_run(bench: &mut Bench) {
    let mut remote = Remote::open(&mut *bench, "bench", options()).unwrap();
    let drive = [wave(700), wave(300)];
    let recording = record(&mut remote, &drive, &RecordOptions { rest_s: 0.1, ..RecordOptions::at(1000.0) }, |_| {
        ControlFlow::Continue(())
    });
    let recording = recording.unwrap();
    for (segment, drive) in recording.segments.iter().zip(&drive) {
        assert_eq!(segment.samples.len(), drive.len());
        for (sample, volts) in segment.samples.iter().zip(drive) {
            assert_eq!(sample.drive_v, f64::from(*volts as f32));
            // The output is measured one period after the drive.
            assert_eq!(sample.output, f64::from(0.5 * *volts as f32));
            assert_eq!(sample.temperature_degc, Some(20.0));
        }
        assert!(segment.samples.windows(2).all(|w| w[1].time_s > w[0].time_s));
    }
    assert_eq!(bench.device.state(), State::Idle);
    assert_eq!(bench.board.volts, 0.0);
    assert!(bench.board.put_out.iter().all(|v| (-10.0..=100.0).contains(v)));
}

#[test]
fn a_run_over_a_line_without_faults_is_complete() {
    check_complete_run(&mut Bench::new(0, 1));
}

#[test]
fn a_run_over_a_line_with_faults_is_complete() {
    for seed in 0..20 {
        check_complete_run(&mut Bench::new(4, seed));
    }
}

#[test]
fn the_watchdog_ramps_the_device_to_rest_within_the_slew_limit() {
    let mut bench = Bench::new(0, 1);
    let mut remote =
        Remote::open(&mut bench, "bench", RemoteOptions { silence_s: 0.1, slew_v_per_s: Some(1000.0), ..options() })
            .unwrap();
    remote.start(1000.0).unwrap();
    let mut measured = Vec::new();
    let drive: Vec<f64> = (1..=40).map(f64::from).collect();
    let mut sent = 0;
    while sent < drive.len() {
        sent += remote.exchange(&drive[sent..], &mut measured).unwrap();
    }
    drop(remote);
    bench.pass(40);
    assert_eq!(bench.board.volts, 40.0);
    bench.pass(100);
    assert_eq!(bench.device.state(), State::Fault(Fault::Silence));
    bench.pass(100);
    assert_eq!(bench.board.volts, 0.0);
    assert!(bench.board.put_out.windows(2).all(|w| (w[1] - w[0]).abs() <= 1.001), "{:?}", bench.board.put_out);

    // Another program gets the reason, and can start after it has cleared the fault.
    let mut remote = Remote::open(&mut bench, "bench", RemoteOptions { session: 99, ..options() }).unwrap();
    let message = remote.start(1000.0).unwrap_err().to_string();
    assert!(message.contains("stop --clear"), "{message}");
    remote.clear().unwrap();
    assert_eq!(remote.start(1000.0).unwrap(), 1000.0);
}

#[test]
fn the_device_does_not_start_before_an_emergency_stop_is_cleared() {
    let mut bench = Bench::new(0, 1);
    let mut remote = Remote::open(&mut bench, "bench", options()).unwrap();
    remote.start(1000.0).unwrap();
    let mut measured = Vec::new();
    remote.exchange(&[30.0; 20], &mut measured).unwrap();
    remote.emergency_stop().unwrap();
    remote.line_mut().pass(100);
    assert_eq!(
        (remote.line_mut().device.state(), remote.line_mut().board.volts),
        (State::Fault(Fault::Emergency), 0.0)
    );
    remote.start(1000.0).unwrap_err();
    remote.clear().unwrap();
    remote.start(1000.0).unwrap();
}

#[test]
fn refusals_of_the_device_are_reported() {
    let mut bench = Bench::new(0, 1);
    let mut remote =
        Remote::open(&mut bench, "bench", RemoteOptions { voltage: Some((0.0, 200.0)), ..options() }).unwrap();
    let message = remote.start(1000.0).unwrap_err().to_string();
    assert!(message.starts_with("bench: ") && message.contains("voltage limits"), "{message}");
    let mut remote = Remote::open(&mut bench, "bench", options()).unwrap();
    assert!(remote.start(1e6).unwrap_err().to_string().contains("rate"));
    assert!(remote.upload(&[1, 2, 3]).unwrap_err().to_string().contains("room"));
    let mut remote =
        Remote::open(&mut bench, "bench", RemoteOptions { voltage: Some((0.0, 50.0)), ..options() }).unwrap();
    let failure =
        record(&mut remote, &[vec![60.0; 10]], &RecordOptions::at(1000.0), |_| ControlFlow::Continue(())).unwrap_err();
    assert!(
        matches!(failure.cause, Cause::Device(RemoteError::Refused { refusal: Refusal::Drive(_), .. })),
        "{failure}"
    );
    assert!(bench.board.put_out.iter().all(|v| *v <= 50.0));
}

#[test]
fn a_stop_by_another_program_is_reported() {
    let mut bench = Bench::new(0, 1);
    let mut remote = Remote::open(&mut bench, "bench", options()).unwrap();
    remote.start(1000.0).unwrap();
    remote.exchange(&[30.0; 20], &mut Vec::new()).unwrap();
    remote.line_mut().device.answer(&Request { number: 1, ask: Ask::Stop });
    let error = loop {
        // The samples up to the stop arrive first.
        if let Err(error) = remote.exchange(&[30.0; 20], &mut Vec::new()) {
            break error;
        }
    };
    assert!(
        matches!(error, RemoteError::Stopped { .. }) && error.to_string().contains("another program stopped"),
        "{error}"
    );
    remote.stop().unwrap();
    assert_eq!((bench.device.state(), bench.board.volts), (State::Idle, 0.0));
}

#[test]
fn a_lost_connection_is_reported_and_the_device_comes_to_rest() {
    let mut bench = Bench::new(0, 1);
    let mut remote = Remote::open(&mut bench, "bench", RemoteOptions { silence_s: 0.05, ..options() }).unwrap();
    remote.start(1000.0).unwrap();
    remote.exchange(&[30.0; 20], &mut Vec::new()).unwrap();
    remote.line_mut().cut = true;
    let message = remote.exchange(&[30.0; 20], &mut Vec::new()).unwrap_err().to_string();
    assert!(message.contains("the connection is lost"), "{message}");
    remote.stop().unwrap_err();
    bench.pass(200);
    assert_eq!((bench.device.state(), bench.board.volts), (State::Fault(Fault::Silence), 0.0));
}

/// A serial line that is slow in both directions.
///
/// Bytes wait in a queue until all earlier bytes are transmitted.
struct Slow {
    bench: Bench,
    bytes_per_s: f64,
    now: Duration,
    began: Instant,
    /// Time of the device's last period.
    lived: Duration,
    /// Bytes in transmission, and their times of arrival.
    there: VecDeque<(Duration, Vec<u8>)>,
    back: VecDeque<(Duration, u8)>,
    busy: [Duration; 2],
    asked: Vec<u8>,
    repeats: usize,
}

impl Slow {
    fn pass(&mut self, time: Duration) {
        let (end, period) = (self.now + time, Duration::from_secs_f64(1.0 / f64::from(self.bench.device.rate_hz())));
        while self.now < end {
            self.now = end.min(self.now + Duration::from_micros(500));
            while self.lived + period <= self.now {
                self.lived += period;
                self.bench.pass(1);
            }
            while self.there.front().is_some_and(|(at, _)| *at <= self.now) {
                let (_, bytes) = self.there.pop_front().unwrap();
                let carried = if bytes.len() > 1 { self.bench.carried(&bytes) } else { bytes };
                self.bench.take(&carried);
                for byte in self.bench.answers.drain(..) {
                    self.busy[1] = self.busy[1].max(self.now) + Duration::from_secs_f64(1.0 / self.bytes_per_s);
                    self.back.push_back((self.busy[1], byte));
                }
            }
        }
    }
}

impl Line for &mut Slow {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        if bytes.len() > 1 {
            self.repeats += usize::from(self.asked == bytes);
            self.asked = bytes.to_vec();
        }
        self.busy[0] = self.busy[0].max(self.now) + Duration::from_secs_f64(bytes.len() as f64 / self.bytes_per_s);
        self.there.push_back((self.busy[0], bytes.to_vec()));
        Ok(())
    }

    fn receive(&mut self, bytes: &mut [u8], patience: Duration) -> io::Result<usize> {
        let give_up = self.now + patience;
        while self.now < give_up && self.back.front().is_none_or(|(at, _)| *at > self.now) {
            self.pass(Duration::from_micros(500));
        }
        let now = self.now;
        let count = self.back.iter().take_while(|(at, _)| *at <= now).count().min(bytes.len());
        self.back.drain(..count).zip(bytes).for_each(|((_, from), to)| *to = from);
        Ok(count)
    }

    fn now(&mut self) -> Instant {
        self.began + self.now
    }

    fn pause(&mut self, time: Duration) {
        self.pass(time);
    }
}

impl Slow {
    fn new(baud: f64, fault_interval: u64, seed: u64) -> Self {
        Self {
            bench: Bench::new(fault_interval, seed),
            bytes_per_s: baud / 10.0,
            now: Duration::ZERO,
            began: Instant::now(),
            lived: Duration::ZERO,
            there: VecDeque::new(),
            back: VecDeque::new(),
            busy: [Duration::ZERO; 2],
            asked: Vec::new(),
            repeats: 0,
        }
    }

    /// Runs for 10 s and returns the number of periods in gaps.
    fn run(&mut self, rate_hz: f64, lost_s: f64) -> f64 {
        let options = RemoteOptions {
            lost: Duration::from_secs_f64(4.0 * lost_s),
            silence_s: lost_s,
            ..RemoteOptions::with_session(7)
        };
        let mut remote = Remote::open(self, "slow", options).unwrap();
        let drive = wave((10.0 * rate_hz) as usize);
        // The host measures the answer times during the first second.
        let options = RecordOptions { settle_s: 1.0, ..RecordOptions::at(rate_hz) };
        let recording = record(&mut remote, &[&drive], &options, |_| ControlFlow::Continue(()));
        let samples = &recording.unwrap().segments[0].samples;
        let periods = (samples[samples.len() - 1].time_s - samples[0].time_s) * rate_hz;
        periods.round() - (drive.len() - 1) as f64
    }
}

#[test]
fn a_slow_line_is_not_filled_with_requests() {
    // The largest rates for lines of 19,200 and 38,400 baud.
    for (baud, rate_hz) in [(19_200.0, 50.0), (38_400.0, 100.0)] {
        let mut slow = Slow::new(baud, 0, 1);
        assert_eq!(slow.run(rate_hz, 0.5), 0.0, "{baud}");
        assert!(slow.repeats < 20, "{baud}: {} requests were repeated", slow.repeats);
    }
}

#[test]
fn faults_on_a_slow_line_cause_gaps_but_do_not_end_the_run() {
    for seed in 0..10 {
        let mut slow = Slow::new(38_400.0, 20, seed);
        let gaps = slow.run(50.0, 0.5);
        assert!(gaps < 50.0, "seed {seed}: {gaps} periods of 500");
    }
}

/// The line is nearly too slow for the rate: an answer takes most of the watchdog time.
#[test]
fn lost_frames_on_a_nearly_too_slow_line_do_not_end_the_run() {
    for seed in 0..10 {
        Slow::new(19_200.0, 30, seed).run(50.0, 0.5);
    }
}

/// Lost frames must not lengthen the wait for answers.
///
/// Otherwise each lost frame would cost more time, until the connection counts as lost.
#[test]
fn lost_frames_do_not_lengthen_the_wait_for_answers() {
    for seed in 0..20 {
        let mut lossy = Slow::new(1e6, 2, seed);
        lossy.run(100.0, 5.0);
        assert!(lossy.now.as_secs_f64() < 60.0, "seed {seed}: {:?} for ten seconds", lossy.now);
    }
}

/// The slices of a rest are whole periods, even if a period is longer than the nominal slice.
#[test]
fn a_rest_is_as_long_as_asked_for_at_any_rate() {
    for (rate_hz, rest_s) in [(1.0, 20.0), (3.0, 7.0), (10.0, 5.0), (1000.0, 2.0)] {
        let mut bench = Bench::new(0, 1);
        let mut remote = Remote::open(&mut bench, "bench", options()).unwrap();
        let drive = [vec![0.0; 3], vec![0.0; 3]];
        let options = RecordOptions { rest_s, ..RecordOptions::at(rate_hz) };
        let recording = record(&mut remote, &drive, &options, |_| ControlFlow::Continue(())).unwrap();
        let [first, second] = [0, 1].map(|k| &recording.segments[k].samples);
        let rested = second[0].time_s - first[2].time_s;
        // Each exchange advances the time of the bench.
        let talk = 10.0 * (1.0 + rest_s / STOP_CHECK_S.max(1.0 / rate_hz)) / rate_hz;
        assert!((rest_s..rest_s + talk).contains(&rested), "{rate_hz} Hz: {rested} s for {rest_s}");
    }
}

/// The host waits for the answer to its start request. This time does not count as silence of the host.
#[test]
fn a_slow_start_does_not_trigger_the_watchdog() {
    let mut bench = Bench::new(0, 1);
    let start = Start {
        session: 1,
        mode: Mode::Voltage,
        rate_hz: 1000.0,
        low_v: 0.0,
        high_v: 99.0,
        slew_v_per_s: 1000.0,
        hottest_degc: 50.0,
        error: 1.0,
        silence_s: 0.5,
        force: false,
    };
    bench.device.answer(&Request { number: 1, ask: Ask::Start(start) });
    bench.device.missed(800);
    bench.pass(1);
    assert_eq!(bench.device.state(), State::Running);
    bench.device.missed(800);
    bench.pass(1);
    assert_eq!(bench.device.state(), State::Fault(Fault::Silence));
}

/// Starts a run and drives it to 30 V.
fn driven_to_30_v(slow: &mut Slow, slew_v_per_s: f64) -> Remote<&mut Slow> {
    let options = RemoteOptions { slew_v_per_s: Some(slew_v_per_s), ..RemoteOptions::with_session(7) };
    let mut remote = Remote::open(slow, "slow", options).unwrap();
    remote.start(100.0).unwrap();
    while remote.line_mut().bench.board.volts < 30.0 {
        remote.exchange(&[30.0; 64], &mut Vec::new()).unwrap();
    }
    remote
}

#[test]
fn clear_waits_for_a_slow_ramp_and_returns_the_fault() {
    let mut slow = Slow::new(115_200.0, 0, 1);
    let mut remote = driven_to_30_v(&mut slow, 1.0);
    remote.emergency_stop().unwrap();
    // The ramp takes 30 s; the other program does not know the slew limit of the run.
    let mut remote = Remote::open(&mut slow, "slow", RemoteOptions::with_session(99)).unwrap();
    assert_eq!(remote.clear().unwrap(), Some(Fault::Emergency));
    assert_eq!(remote.clear().unwrap(), None);
    assert_eq!(slow.bench.board.volts, 0.0);
}

/// A program that has read an earlier fault, or none, does not clear a later emergency stop.
#[test]
fn an_emergency_stop_is_cleared_only_by_a_program_that_has_read_it() {
    let mut bench = Bench::new(0, 1);
    let cool = RemoteOptions { hottest_degc: 10.0, ..options() };
    let mut remote = Remote::open(&mut bench, "bench", cool).unwrap();
    remote.start(1000.0).unwrap();
    let failed = remote.exchange(&[30.0; 20], &mut Vec::new()).unwrap_err();
    let RemoteError::Fault { fault, .. } = failed else { panic!("{failed}") };
    remote.emergency_stop().unwrap();
    remote.line_mut().pass(200);
    let refused = remote.ask_status(Ask::Clear(fault)).unwrap_err();
    assert!(matches!(refused, RemoteError::Standing { fault: Fault::Emergency, .. }), "{refused}");
    assert_eq!(remote.clear().unwrap(), Some(Fault::Emergency));
    let mut remote = Remote::open(&mut bench, "bench", RemoteOptions { session: 8, ..options() }).unwrap();
    remote.start(1000.0).unwrap();
    // On a running device, clear fails at once instead of waiting for the end of the run.
    let refused = Remote::open(&mut bench, "bench", options()).unwrap().clear().unwrap_err();
    assert!(matches!(refused, RemoteError::Refused { refusal: Refusal::State, .. }), "{refused}");
    assert_eq!(bench.device.state(), State::Running);
}

#[test]
fn clear_waits_until_a_stopping_device_is_at_rest() {
    let mut slow = Slow::new(115_200.0, 0, 1);
    let mut remote = driven_to_30_v(&mut slow, 10.0);
    // The host disappears while the device is stopping.
    remote.ask_status(Ask::Stop).unwrap();
    let mut remote = Remote::open(&mut slow, "slow", RemoteOptions::with_session(99)).unwrap();
    assert_eq!(remote.status().unwrap().state, State::Stopping);
    assert_eq!(remote.clear().unwrap(), None);
    assert_eq!((slow.bench.device.state(), slow.bench.board.volts), (State::Idle, 0.0));
}

#[test]
fn a_rest_on_a_device_with_a_stopped_clock_fails() {
    let mut bench = Bench::new(0, 1);
    let hasty = RemoteOptions { lost: Duration::from_millis(50), ..options() };
    let mut remote = Remote::open(&mut bench, "bench", hasty).unwrap();
    remote.start(1000.0).unwrap();
    remote.exchange(&[30.0; 20], &mut Vec::new()).unwrap();
    remote.line_mut().frozen = true;
    let stands = remote.rest(1.0).unwrap_err();
    assert!(matches!(stands, RemoteError::Stands { .. }), "{stands}");
}

#[test]
fn a_line_without_a_device_is_reported() {
    struct Deaf;
    impl Line for Deaf {
        fn send(&mut self, _: &[u8]) -> io::Result<()> {
            Ok(())
        }
        fn receive(&mut self, _: &mut [u8], patience: Duration) -> io::Result<usize> {
            std::thread::sleep(patience);
            Ok(0)
        }
    }
    let options = RemoteOptions { lost: Duration::from_millis(20), ..options() };
    let message = Remote::open(Deaf, "/dev/ttyX", options).err().unwrap().to_string();
    assert!(message.contains("/dev/ttyX") && message.contains("check the port"), "{message}");
}

/// Serves a device on its own clock until the host disconnects.
///
/// Returns its state after 24,000 more periods.
fn served(mut line: impl Line + Send + 'static) -> std::thread::JoinHandle<(Device<Open, 128, 0>, Echo)> {
    std::thread::spawn(move || {
        let (mut device, mut board) = (Device::new(identity(), Open), Echo::default());
        // The end of the connection is expected here.
        let _ = crate::serve(&mut device, &mut board, &mut line, || false);
        (0..24_000).for_each(|_| device.tick(&mut board));
        (device, board)
    })
}

/// Plays a run over a real line, on the device's own clock.
///
/// Then the host disconnects, and the watchdog brings the device to rest.
fn run_over(host: impl Line, device: impl Line + Send + 'static) {
    let device = served(device);
    let options = RemoteOptions {
        // A busy computer may delay a thread.
        silence_s: 10.0,
        repeat: Duration::from_millis(200),
        lost: Duration::from_secs(20),
        ..options()
    };
    let mut remote = Remote::open(host, "line", options).unwrap();
    let drive = wave(900);
    let recording =
        record(&mut remote, std::slice::from_ref(&drive), &RecordOptions::at(2000.0), |_| ControlFlow::Continue(()))
            .unwrap();
    let samples = &recording.segments[0].samples;
    assert_eq!(samples.len(), drive.len());
    assert!(samples.iter().zip(&drive).all(|(s, v)| s.drive_v == f64::from(*v as f32) && s.output == 0.5 * s.drive_v));
    remote.start(2000.0).unwrap();
    remote.exchange(&[30.0; 50], &mut Vec::new()).unwrap();
    drop(remote);
    let (device, board) = device.join().unwrap();
    assert_eq!((device.state(), board.volts), (State::Fault(Fault::Silence), 0.0));
}

#[test]
fn a_run_over_a_tcp_connection() {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let host = Tcp::connect(listener.local_addr().unwrap()).unwrap();
    run_over(host, Tcp::over(listener.accept().unwrap().0).unwrap());
}

#[cfg(unix)]
#[test]
fn a_run_over_a_pseudo_terminal() {
    let (host, device) = serialport::TTYPort::pair().unwrap();
    run_over(Serial::over(Box::new(host)), Serial::over(Box::new(device)));
}

/// One end of a bus with two nodes; it checks the length of frames.
struct Wire {
    out: Sender<(u32, CanData)>,
    into: Receiver<(u32, CanData)>,
    longest: usize,
}

impl Bus for Wire {
    fn send(&mut self, id: u32, data: &[u8]) -> io::Result<()> {
        assert!(data.len() <= self.longest);
        self.out.send((id, data.iter().copied().collect())).map_err(|_| io::ErrorKind::BrokenPipe.into())
    }
    fn receive(&mut self, patience: Duration) -> io::Result<Option<(u32, CanData)>> {
        match self.into.recv_timeout(patience) {
            Ok(frame) => Ok(Some(frame)),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(io::ErrorKind::BrokenPipe.into()),
        }
    }
}

#[test]
fn a_run_over_a_can_bus() {
    for (fd, longest) in [(false, 8), (true, 64)] {
        let ((there, from_host), (back, from_device)) = (channel(), channel());
        let host = Wire { out: there, into: from_device, longest };
        let device = Wire { out: back, into: from_host, longest };
        run_over(CanLine::new(host, TO_DEVICE, FROM_DEVICE, fd), CanLine::new(device, FROM_DEVICE, TO_DEVICE, fd));
    }
}

#[test]
fn missing_ports_are_reported() {
    let message = Serial::open("/dev/tty-of-nobody", 115_200).unwrap_err().to_string();
    assert!(message.starts_with("/dev/tty-of-nobody: there is no such port"), "{message}");
    // No program listens at a port that was just closed.
    let address = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    Tcp::connect(address).unwrap_err();
}

proptest! {
    /// Arbitrary requests do not move the output beyond its range or slew limit.
    #[test]
    fn arbitrary_requests_keep_the_output_within_its_limits(seed in any::<u64>()) {
        let mut luck = Luck(seed);
        let mut bench = Bench::new(0, seed);
        let odd = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30, -1e30, 0.0, 50.0, 99.0, 101.0, -11.0];
        for _ in 0..200 {
            let mut value = || odd[luck.below(odd.len() as u64) as usize];
            let start = Start {
                session: 1, mode: Mode::Voltage, rate_hz: 1000.0, low_v: value().min(0.0), high_v: value().max(1.0),
                slew_v_per_s: value(), hottest_degc: value(), error: value(), silence_s: 1.0, force: false,
            };
            let drives: heapless::Vec<f32, MOST_DRIVES> = (0..5).map(|_| value()).collect();
            let sound = Start { low_v: 0.0, high_v: 99.0, slew_v_per_s: 5000.0, hottest_degc: 50.0, error: 1.0, ..start };
            let session = luck.below(4) as u32;
            let ask = match luck.below(8) {
                0 => Ask::Start(Start { session, ..start }),
                1 => Ask::Start(Start { session, ..sound }),
                2 if luck.below(4) == 0 => Ask::Stop,
                3 if luck.below(4) == 0 => Ask::Emergency,
                4 => Ask::Clear(if let State::Fault(fault) = bench.device.state() { fault } else { Fault::Silence }),
                _ => {
                    let have = bench.device.status().received;
                    let (heard, first) = (luck.below(20) as u32, (have + 2).saturating_sub(luck.below(5) as u32));
                    Ask::Exchange(Exchange { session, heard, first, drives })
                }
            };
            bench.device.answer(&Request { number: 1, ask });
            let periods = luck.below(4) as u32;
            bench.pass(periods);
        }
        prop_assert!(bench.board.put_out.iter().all(|v| (-10.0..=100.0).contains(v)));
        let steepest = 50_000.0 / 1000.0 * 1.001;
        let from_rest = std::iter::once(0.0).chain(bench.board.put_out.iter().copied());
        prop_assert!(from_rest.zip(&bench.board.put_out).all(|(a, b)| (b - a).abs() <= steepest));
    }
}
