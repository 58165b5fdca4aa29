//! The reference firmware (`tests/firmware/servo`) in QEMU, connected by a pseudo terminal.
//!
//! `HYST_SERVO` is the path of the program that `cargo xtask firmware` builds. It then runs these tests, which are ignored
//! otherwise.

use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use hyst_hw::wire::{
    Ask, Chunk, Exchange, Fault, MOST_CHUNK, MOST_DRIVES, Mode, Reply, Request, Start, State, Tell, model_sum,
};
use hyst_hw::{Daq, Line, Remote, RemoteError, RemoteOptions, Sample, Serial};
use hyst_onboard::{OnBoard, RANGE_V, RATE_HZ, SLEW_V_PER_S, servo};
use hyst_tests::Lab;
use hyst_tests::controller::controller;
use serde_json::Value;

/// QEMU with the firmware. Dropping it stops QEMU.
struct Machine {
    process: Child,
    port: String,
}

impl Drop for Machine {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Starts QEMU with the firmware.
fn machine() -> Machine {
    let program = std::env::var_os("HYST_SERVO").filter(|path| Path::new(path).is_file());
    let program = program.expect("HYST_SERVO is the path of a firmware; cargo xtask firmware builds it");
    let started = Command::new("qemu-system-arm")
        .args(["-machine", "mps2-an386", "-display", "none", "-monitor", "none"])
        .args(["-chardev", "pty,id=line", "-serial", "chardev:line"])
        .args(["-semihosting-config", "enable=on,target=native", "-kernel"])
        .arg(program)
        .stdout(Stdio::piped())
        .spawn();
    let mut process = started.expect("qemu-system-arm starts");
    // "char device redirected to /dev/pts/3 (label line)"
    let mut text = String::new();
    let stdout = process.stdout.take().expect("it is piped");
    BufReader::new(stdout).read_line(&mut text).expect("QEMU prints the path of the terminal");
    let port = text.split_whitespace().find(|word| word.starts_with("/dev/")).expect("a pseudo terminal").to_owned();
    Machine { process, port }
}

fn remote(machine: &Machine, session: u32, mode: Mode) -> Remote<Serial> {
    let options = RemoteOptions { mode, force: mode == Mode::Reference, ..RemoteOptions::with_session(session) };
    remote_with(machine, options)
}

fn remote_with(machine: &Machine, options: RemoteOptions) -> Remote<Serial> {
    let line = Serial::open(&machine.port, 115_200).expect("the pseudo terminal opens");
    Remote::open(line, &machine.port, options).expect("the firmware answers")
}

/// Returns a controller with an approximate model of the actuator, a PID and a force observer.
fn recipe() -> Vec<u8> {
    controller(0.07, 12, RANGE_V.map(f64::from)).concat()
}

/// Returns the sum of two sines that starts at rest \[µm\].
fn references(rows: usize) -> Vec<f64> {
    let at = |k: usize| std::f64::consts::TAU * k as f64 / f64::from(RATE_HZ);
    (0..rows).map(|k| 6.0 * (1.0 - (0.8 * at(k)).cos()) + 1.5 * (1.0 - (5.0 * at(k)).cos())).collect()
}

/// Runs the same source on the host. Returns drive, output and force of each sample.
fn on_host(references: &[f64]) -> Vec<(f32, f32, Option<f32>)> {
    let (mut device, mut actuator) = (servo(), OnBoard::default());
    let ask = |device: &mut hyst_onboard::Servo, ask: Ask| -> Reply { device.answer(&Request { number: 0, ask }) };
    let bytes = recipe();
    for (i, part) in bytes.chunks(MOST_CHUNK).enumerate() {
        let chunk = Chunk {
            offset: (i * MOST_CHUNK) as u32,
            total: bytes.len() as u32,
            sum: model_sum(&bytes),
            bytes: part.iter().copied().collect(),
        };
        assert!(matches!(ask(&mut device, Ask::Model(chunk)).tell, Tell::ModelBytes(_)));
    }
    let start = Start {
        session: 1,
        mode: Mode::Reference,
        rate_hz: RATE_HZ,
        low_v: RANGE_V[0],
        high_v: RANGE_V[1],
        slew_v_per_s: SLEW_V_PER_S,
        hottest_degc: f32::INFINITY,
        error: f32::INFINITY,
        silence_s: 0.5,
        force: true,
    };
    assert!(matches!(ask(&mut device, Ask::Start(start)).tell, Tell::Status(_)));
    let (mut sent, mut measured) = (0, Vec::new());
    while measured.len() < references.len() {
        let drives = references[sent..].iter().take(MOST_DRIVES).map(|r| *r as f32).collect();
        let exchange = Exchange { session: 1, heard: measured.len() as u32, first: sent as u32, drives };
        let Tell::Samples { status, samples, .. } = ask(&mut device, Ask::Exchange(exchange)).tell else {
            panic!("the device rejects the exchange");
        };
        sent = status.received as usize;
        measured.extend(samples.iter().map(|s| (s.drive_v, s.output, s.force_n)));
        device.tick(&mut actuator);
    }
    measured
}

/// Runs the firmware on a new machine. Returns the rate, the samples and the duration \[s\].
fn followed(references: &[f64]) -> (f64, Vec<Sample>, f64) {
    let machine = machine();
    // The watchdog has a separate test; here this process may be delayed too.
    let (mode, wait_s) = (Mode::Reference, 20.0);
    let lost = Duration::from_secs_f64(wait_s);
    let mut remote = remote_with(
        &machine,
        RemoteOptions { mode, force: true, silence_s: wait_s, lost, ..RemoteOptions::with_session(7) },
    );
    assert!(remote.identity().follows);
    remote.upload(&recipe()).expect("the firmware accepts the model");
    let rate = remote.start(RATE_HZ.into()).expect("the run starts");
    let (mut sent, mut measured) = (0, Vec::<Sample>::new());
    let start = Instant::now();
    while measured.len() < references.len() {
        sent += remote.exchange(&references[sent..], &mut measured).expect("the run continues");
    }
    let duration = start.elapsed().as_secs_f64();
    remote.stop().expect("the run stops");
    assert_eq!(measured.len(), references.len());
    (rate, measured, duration)
}

/// 10 s at 500 Hz: every sample once, with the bits that the host computes. If a busy machine delays the emulator, the
/// device counts the missed periods and continues with the next sample.
#[test]
#[ignore = "needs the firmware in QEMU: cargo xtask firmware"]
fn the_firmware_tracks_with_the_bits_of_the_host() {
    let references = references((10.0 * RATE_HZ) as usize);
    let (rate, measured, duration) = followed(&references);
    assert!(duration > 9.0, "{duration} s for 10 s: the board's clock is not used");
    let mut missed = 0.0;
    for pair in measured.windows(2) {
        let periods = (pair[1].time_s - pair[0].time_s) * rate;
        let whole = periods.round();
        assert!(whole >= 1.0 && (periods - whole).abs() < 1e-6, "{periods} periods from {} s", pair[0].time_s);
        missed += whole - 1.0;
    }
    println!("{missed} periods missed");
    assert!(missed < references.len() as f64, "{missed} periods missed: it does not keep up by itself");
    assert_bits_of_host(&references, rate, &measured);
}

fn assert_bits_of_host(references: &[f64], rate: f64, measured: &[Sample]) {
    let expected = on_host(references);
    for (k, (sample, (drive, output, force))) in measured.iter().zip(&expected).enumerate() {
        assert_eq!((sample.drive_v as f32).to_bits(), drive.to_bits(), "drive of sample {k}");
        assert_eq!((sample.output as f32).to_bits(), output.to_bits(), "output of sample {k}");
        assert_eq!(sample.force_n.map(|f| (f as f32).to_bits()), force.map(f32::to_bits), "force of sample {k}");
        assert!(force.is_some());
    }
    let rmse = |of: &dyn Fn(usize) -> f64| {
        let late = measured.len() / 4..measured.len();
        (late.clone().map(|k| of(k).powi(2)).sum::<f64>() / late.len() as f64).sqrt()
    };
    // The inverse of the lag has a preview: the output is late by that many samples.
    let errors = (0..40).map(|lead| rmse(&|k| measured[k].output - references[k.saturating_sub(lead)]));
    let smallest = errors.fold(f64::INFINITY, f64::min);
    println!("10 s at {rate} Hz: RMSE {smallest:.3} µm");
    assert!(smallest < 0.5, "{smallest} µm");
}

/// The watchdog brings the firmware to rest within its slew limit.
#[test]
#[ignore = "needs the firmware in QEMU: cargo xtask firmware"]
fn after_a_killed_host_the_watchdog_stops_the_firmware() {
    let machine = machine();
    let lab = Lab::new();
    // The drive takes 20 s; only its first seconds are played.
    lab.ok("excite sine --rate 500 --high 80 --frequency 0.05 --cycles 1 -o u.csv");
    let line = format!("run --daq serial:{} --drive u.csv --log run.mcap --slew 40", machine.port);
    let mut host = lab.command(&line).stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("hystctl starts");
    sleep(Duration::from_secs(6));
    assert!(host.try_wait().expect("the host's state").is_none(), "the run has ended early");
    host.kill().expect("the host can be killed");
    host.wait().expect("the host has ended");
    // Output voltages from now on. Status requests do not reset the watchdog of the run.
    let mut remote = remote(&machine, 21, Mode::Voltage);
    let mut ramp = Vec::new();
    while ramp.last().is_none_or(|(volts, _)| *volts != 0.0) {
        let status = remote.status().expect("the device answers");
        ramp.push((status.present_v, status.state));
        assert!(ramp.len() < 100_000, "the device does not come to rest");
    }
    assert!(ramp[0].0 > 20.0, "the run was killed at only {} V", ramp[0].0);
    let (_, last) = ramp[ramp.len() - 1];
    assert_eq!(last, State::Fault(Fault::Silence));
    let fallen = ramp.iter().position(|(volts, _)| *volts < ramp[0].0).expect("the voltage falls");
    assert!(ramp[fallen..].windows(2).all(|w| w[1].0 <= w[0].0), "the voltage falls monotonically to rest");
    // Only one program can use the port.
    drop(remote);
    let ran = lab.run(&line);
    assert_eq!(ran.code, 2, "{ran:?}");
    assert!(ran.stderr.contains("--clear"), "{ran:?}");
    lab.ok("excite sine --rate 500 --high 4 --frequency 2 --cycles 1 -o u.csv");
    lab.ok(&format!("{line} --clear"));
    // The samples before the kill are in the log.
    let info = lab.ok("log info run.mcap.~1~ --json").json();
    assert_eq!(info["closed"], false);
    assert!(info["samples"].as_u64().is_some_and(|n| n > 1500), "{info}");
}

/// A line that loses, changes, repeats, truncates or delays frames.
struct FaultyLine {
    port: Serial,
    seed: u64,
    late: Vec<u8>,
    /// Number of bytes until the next error. Bytes are counted because the number of pieces depends on the machine.
    until_error: u64,
}

/// Mean number of received bytes between two errors.
const BYTES_PER_ERROR: u64 = 4000;

/// Returns the next random number (linear congruential generator, Knuth).
fn random(seed: &mut u64) -> u64 {
    *seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    *seed >> 33
}

impl FaultyLine {
    fn below(&mut self, n: u64) -> u64 {
        random(&mut self.seed) % n
    }

    fn damaged(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut bytes = bytes.to_vec();
        let at = self.below(bytes.len() as u64) as usize;
        match self.below(5) {
            0 => bytes.clear(),
            1 => bytes[at] ^= 1 << self.below(8),
            2 => bytes.truncate(at),
            3 => bytes.extend_from_within(..),
            _ => std::mem::swap(&mut bytes, &mut self.late),
        }
        bytes
    }
}

impl Line for FaultyLine {
    fn send(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        let has_error = bytes.len() > 1 && self.below(6) == 0;
        let bytes = if has_error { self.damaged(bytes) } else { bytes.to_vec() };
        self.port.send(&bytes)
    }

    fn receive(&mut self, bytes: &mut [u8], patience: Duration) -> std::io::Result<usize> {
        let count = self.port.receive(bytes, patience)?;
        if count as u64 <= self.until_error {
            self.until_error -= count as u64;
            return Ok(count);
        }
        self.until_error = self.below(2 * BYTES_PER_ERROR);
        let damaged = self.damaged(&bytes[..count]);
        let kept = damaged.len().min(bytes.len());
        bytes[..kept].copy_from_slice(&damaged[..kept]);
        Ok(kept)
    }
}

/// The line damages one request in six and about one reply in ten. The firmware must play exactly the sent drives, and
/// answer over a good line afterwards.
#[test]
#[ignore = "needs the firmware in QEMU: cargo xtask firmware"]
fn the_firmware_works_over_a_faulty_line() {
    let machine = machine();
    for seed in [1, 2] {
        let port = Serial::open(&machine.port, 115_200).expect("the pseudo terminal opens");
        let line = FaultyLine { port, seed, late: Vec::new(), until_error: 0 };
        let options = RemoteOptions {
            lost: Duration::from_secs(20),
            silence_s: 20.0,
            ..RemoteOptions::with_session(30 + seed as u32)
        };
        let mut remote = Remote::open(line, "faulty", options).expect("the device answers eventually");
        remote.start(RATE_HZ.into()).expect("the run starts");
        let drive: Vec<f64> = (0..1000).map(|k| 30.0 - 30.0 * (0.0063 * f64::from(k)).cos()).collect();
        let (mut sent, mut measured) = (0, Vec::<Sample>::new());
        while measured.len() < drive.len() {
            sent += remote.exchange(&drive[sent..], &mut measured).expect("the run continues");
        }
        remote.stop().expect("the run stops");
        assert_eq!(measured.len(), drive.len());
        assert!(measured.iter().zip(&drive).all(|(s, v)| s.drive_v == f64::from(*v as f32)));
    }
    // Random bytes without any frame.
    let mut port = Serial::open(&machine.port, 115_200).expect("the pseudo terminal opens");
    let mut seed = 1u64;
    for _ in 0..200 {
        let bytes: Vec<u8> = (0..100).map(|_| random(&mut seed) as u8).collect();
        port.send(&bytes).expect("the port accepts the bytes");
    }
    drop(port);
    let mut remote = remote(&machine, 40, Mode::Voltage);
    assert_eq!(remote.status().expect("the device answers").present_v, 0.0);
    remote.start(RATE_HZ.into()).expect("the run starts");
    remote.stop().expect("the run stops");
}

/// After the host has disconnected, the device comes to rest within its slew limit and reports the fault.
#[test]
#[ignore = "needs the firmware in QEMU: cargo xtask firmware"]
fn without_a_host_the_firmware_comes_to_rest() {
    let machine = machine();
    {
        let mut remote = remote(&machine, 11, Mode::Voltage);
        remote.start(RATE_HZ.into()).expect("the run starts");
        let drive: Vec<f64> = (0..400).map(|k| 0.2 * f64::from(k)).collect();
        let (mut sent, mut measured) = (0, Vec::new());
        while sent < drive.len() {
            sent += remote.exchange(&drive[sent..], &mut measured).expect("the run continues");
        }
        // The port closes during the run, without a stop.
    }
    sleep(Duration::from_millis(1500));
    let mut remote = remote(&machine, 12, Mode::Voltage);
    let rejected = remote.start(RATE_HZ.into());
    assert!(matches!(rejected, Err(RemoteError::Standing { fault: Fault::Silence, .. })), "{rejected:?}");
    remote.clear().expect("at rest the fault can be cleared");
    assert_eq!(remote.present_v(), 0.0);
    remote.start(RATE_HZ.into()).expect("the next run starts");
    remote.stop().expect("the next run stops");
}

/// A lab with a model of the actuator behind the line, and the line's name.
fn identified(machine: &Machine) -> (Lab, String) {
    let (lab, daq) = (Lab::new(), format!("serial:{}", machine.port));
    lab.ok("excite identification --rate 500 --high 110 --seconds 12 --slow 2 --hold 0.4 --rest 0.2 -o drive.csv");
    lab.ok(&format!("run --daq {daq} --drive drive.csv --record train.csv"));
    lab.ok("fit train.csv --model pi -o pi.json");
    (lab, daq)
}

fn number(report: &Value, path: &str) -> f64 {
    report.pointer(path).and_then(Value::as_f64).unwrap_or_else(|| panic!("{path}: {report:#}"))
}

/// A run with a model whose gain is 5 % too high.
#[test]
#[ignore = "needs the firmware in QEMU: cargo xtask firmware"]
fn hystctl_adapts_over_the_line() {
    let machine = machine();
    let (lab, daq) = identified(&machine);
    lab.ok("fit train.csv --model pi --map displacement_um=1.05*displacement_um -o high.json");
    let follow = format!("run --daq {daq} --model high.json --reference sine:4,14,1,15 --json");
    let (plain, adapted) = (lab.ok(&follow).json(), lab.ok(&format!("{follow} --adapt")).json());
    let late = |report: &Value| number(report, "/tracking/rmse_last_half");
    assert!(late(&adapted) < 0.3 * late(&plain), "{plain:#} {adapted:#}");
    assert!(number(&adapted, "/adapted/gain_percent") < -1.0, "{adapted:#}");
    println!("adapted: {:.4} to {:.4} µm", late(&plain), late(&adapted));
}

/// Five passes of learning.
#[test]
#[ignore = "minutes of real time, and the emulator must not be delayed: HYST_SERVO=PROGRAM cargo test -p hyst-tests --test servo -- --ignored learns"]
fn hystctl_learns_over_the_line() {
    let machine = machine();
    let (lab, daq) = identified(&machine);
    let reference = "triangle:4,14,2,3";
    let learn = format!("learn --daq {daq} --model pi.json --reference {reference} --passes 5 -o learned.csv --json");
    let learned = lab.run(&learn);
    // A busy machine delays QEMU in every pass, which `learn` rejects.
    assert_eq!(learned.code, 0, "{}", learned.stderr);
    let learned = learned.json();
    let passes = learned["passes"].as_array().expect("passes");
    let (first, best) = (number(&learned, "/passes/0/rmse"), number(&learned, "/best") as usize);
    let last = number(&passes[best - 1], "/rmse");
    assert!(passes.len() <= 5 && last < 0.3 * first, "{learned:#}");
    println!("learned: {first:.4} to {last:.4} µm");
}
