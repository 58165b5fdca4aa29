//! The reference firmware (`tests/firmware/servo`) in QEMU, at the end of a pseudo terminal.
//!
//! `HYST_SERVO` names its program, as `cargo xtask firmware` builds it; without it these tests say that they skip.

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

/// The machine, which ends with it.
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

/// QEMU with the firmware; `None` without them.
fn machine() -> Option<Machine> {
    let Some(program) = std::env::var_os("HYST_SERVO").filter(|path| Path::new(path).is_file()) else {
        println!("skipped: HYST_SERVO names no firmware; cargo xtask firmware builds it");
        return None;
    };
    let started = Command::new("qemu-system-arm")
        .args(["-machine", "mps2-an386", "-display", "none", "-monitor", "none"])
        .args(["-chardev", "pty,id=line", "-serial", "chardev:line"])
        .args(["-semihosting-config", "enable=on,target=native", "-kernel"])
        .arg(program)
        .stdout(Stdio::piped())
        .spawn();
    let Ok(mut process) = started else {
        println!("skipped: there is no qemu-system-arm");
        return None;
    };
    // "char device redirected to /dev/pts/3 (label line)"
    let mut said = String::new();
    let stdout = process.stdout.take().expect("it is piped");
    BufReader::new(stdout).read_line(&mut said).expect("QEMU says where the line is");
    let port = said.split_whitespace().find(|word| word.starts_with("/dev/")).expect("a pseudo terminal").to_owned();
    Some(Machine { process, port })
}

fn remote(machine: &Machine, session: u32, mode: Mode) -> Remote<Serial> {
    let options = RemoteOptions { mode, force: mode == Mode::Reference, ..RemoteOptions::with_session(session) };
    remote_with(machine, options)
}

fn remote_with(machine: &Machine, options: RemoteOptions) -> Remote<Serial> {
    let line = Serial::open(&machine.port, 115_200).expect("the pseudo terminal opens");
    Remote::open(line, &machine.port, options).expect("the firmware answers")
}

/// A model of about that actuator, a PID and a force observer.
fn recipe() -> Vec<u8> {
    controller(0.07, 12, RANGE_V.map(f64::from)).concat()
}

/// Sines of two frequencies that begin at rest \[µm\].
fn references(rows: usize) -> Vec<f64> {
    let at = |k: usize| std::f64::consts::TAU * k as f64 / f64::from(RATE_HZ);
    (0..rows).map(|k| 6.0 * (1.0 - (0.8 * at(k)).cos()) + 1.5 * (1.0 - (5.0 * at(k)).cos())).collect()
}

/// The same source on the host: what the device measures, drive, output and force.
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
            panic!("the device refuses");
        };
        sent = status.received as usize;
        measured.extend(samples.iter().map(|s| (s.drive_v, s.output, s.force_n)));
        device.tick(&mut actuator);
    }
    measured
}

/// A run on a new machine: rate, what was measured, and how long it took \[s\].
fn followed(references: &[f64]) -> Option<(f64, Vec<Sample>, f64)> {
    let machine = machine()?;
    // The watchdog has a test of its own; here this process may be kept waiting too.
    let (mode, wait_s) = (Mode::Reference, 20.0);
    let lost = Duration::from_secs_f64(wait_s);
    let mut remote = remote_with(
        &machine,
        RemoteOptions { mode, force: true, silence_s: wait_s, lost, ..RemoteOptions::with_session(7) },
    );
    assert!(remote.identity().follows);
    remote.upload(&recipe()).expect("the firmware takes the model");
    let rate = remote.start(RATE_HZ.into()).expect("the run starts");
    let (mut sent, mut measured) = (0, Vec::<Sample>::new());
    let began = Instant::now();
    while measured.len() < references.len() {
        sent += remote.exchange(&references[sent..], &mut measured).expect("the run goes on");
    }
    let took = began.elapsed().as_secs_f64();
    remote.stop().expect("the run stops");
    assert_eq!(measured.len(), references.len());
    Some((rate, measured, took))
}

/// Ten seconds at 500 Hz: every sample once, and the bits that the host computes. A machine that is busy may keep the emulator waiting: the device then
/// counts the periods that it missed, and goes on with the next sample.
#[test]
fn the_firmware_tracks_with_the_hosts_bits() {
    let references = references((10.0 * RATE_HZ) as usize);
    let Some((rate, measured, took)) = followed(&references) else { return };
    assert!(took > 9.0, "{took} s for ten: it is not the board's clock that runs");
    let mut missed = 0.0;
    for pair in measured.windows(2) {
        let periods = (pair[1].time_s - pair[0].time_s) * rate;
        let whole = periods.round();
        assert!(whole >= 1.0 && (periods - whole).abs() < 1e-6, "{periods} periods from {} s on", pair[0].time_s);
        missed += whole - 1.0;
    }
    println!("{missed} periods missed");
    assert!(missed < references.len() as f64, "{missed} periods missed: it does not keep up by itself");
    has_the_hosts_bits(&references, rate, &measured);
}

fn has_the_hosts_bits(references: &[f64], rate: f64, measured: &[Sample]) {
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
    // The inverse of the lag looks ahead: the output is late by as many samples.
    let errors = (0..40).map(|lead| rmse(&|k| measured[k].output - references[k.saturating_sub(lead)]));
    let least = errors.fold(f64::INFINITY, f64::min);
    println!("10 s at {rate} Hz: RMSE {least:.3} µm");
    assert!(least < 0.5, "{least} µm");
}

/// `hystctl` in the middle of a run is killed: the firmware comes to rest by its watchdog, within its slew limit.
#[test]
fn a_host_that_is_killed_leaves_the_firmware_to_its_watchdog() {
    let Some(machine) = machine() else { return };
    let lab = Lab::new();
    // 20 s, of which the first few are played.
    lab.ok("excite sine --rate 500 --high 80 --frequency 0.05 --cycles 1 -o u.csv");
    let line = format!("run --daq serial:{} --drive u.csv --log run.mcap --slew 40", machine.port);
    let mut host = lab.command(&line).stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("hystctl starts");
    sleep(Duration::from_secs(6));
    assert!(host.try_wait().expect("it can be asked").is_none(), "the run has ended by itself");
    host.kill().expect("it can be killed");
    host.wait().expect("and is gone");
    // What the device puts out from now on, as often as it says so. To ask that is no sign of life for the run.
    let mut remote = remote(&machine, 21, Mode::Voltage);
    let mut ramp = Vec::new();
    while ramp.last().is_none_or(|(volts, _)| *volts != 0.0) {
        let status = remote.status().expect("it answers");
        ramp.push((status.present_v, status.state));
        assert!(ramp.len() < 100_000, "it does not come to rest");
    }
    assert!(ramp[0].0 > 20.0, "it was killed at {} V only", ramp[0].0);
    let (_, last) = ramp[ramp.len() - 1];
    assert_eq!(last, State::Fault(Fault::Silence));
    let fallen = ramp.iter().position(|(volts, _)| *volts < ramp[0].0).expect("it falls");
    assert!(ramp[fallen..].windows(2).all(|w| w[1].0 <= w[0].0), "on the way to rest it only falls");
    // One program at a time.
    drop(remote);
    let ran = lab.run(&line);
    assert_eq!(ran.code, 2, "{ran:?}");
    assert!(ran.stderr.contains("--clear"), "{ran:?}");
    lab.ok("excite sine --rate 500 --high 4 --frequency 2 --cycles 1 -o u.csv");
    lab.ok(&format!("{line} --clear"));
    // What was logged until it was killed is there.
    let said = lab.ok("log info run.mcap.~1~ --json").json();
    assert_eq!(said["closed"], false);
    assert!(said["samples"].as_u64().is_some_and(|n| n > 1500), "{said}");
}

/// Frames on their way that are lost, changed, doubled, cut or come late.
struct Rough {
    port: Serial,
    chance: u64,
    late: Vec<u8>,
    /// Bytes that come before the next accident: how many pieces they come in is the machine's affair.
    sound: u64,
}

/// Bytes between two accidents on the way back, in the mean.
const BYTES_AN_ACCIDENT: u64 = 4000;

/// The next of a row of numbers without order (Knuth's multiplier).
fn stirred(chance: &mut u64) -> u64 {
    *chance = chance.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
    *chance >> 33
}

impl Rough {
    fn below(&mut self, n: u64) -> u64 {
        stirred(&mut self.chance) % n
    }

    fn spoiled(&mut self, bytes: &[u8]) -> Vec<u8> {
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

impl Line for Rough {
    fn send(&mut self, bytes: &[u8]) -> std::io::Result<()> {
        let spoiled = bytes.len() > 1 && self.below(6) == 0;
        let bytes = if spoiled { self.spoiled(bytes) } else { bytes.to_vec() };
        self.port.send(&bytes)
    }

    fn receive(&mut self, bytes: &mut [u8], patience: Duration) -> std::io::Result<usize> {
        let came = self.port.receive(bytes, patience)?;
        if came as u64 <= self.sound {
            self.sound -= came as u64;
            return Ok(came);
        }
        self.sound = self.below(2 * BYTES_AN_ACCIDENT);
        let spoiled = self.spoiled(&bytes[..came]);
        let kept = spoiled.len().min(bytes.len());
        bytes[..kept].copy_from_slice(&spoiled[..kept]);
        Ok(kept)
    }
}

/// Over a line that spoils one request in six and something of one answer in ten, or so, the firmware plays what it is given and nothing else, and answers a sound line afterwards.
#[test]
fn a_rough_line_does_the_firmware_no_harm() {
    let Some(machine) = machine() else { return };
    for seed in [1, 2] {
        let port = Serial::open(&machine.port, 115_200).expect("the pseudo terminal opens");
        let rough = Rough { port, chance: seed, late: Vec::new(), sound: 0 };
        let options = RemoteOptions {
            lost: Duration::from_secs(20),
            silence_s: 20.0,
            ..RemoteOptions::with_session(30 + seed as u32)
        };
        let mut remote = Remote::open(rough, "rough", options).expect("it is heard at last");
        remote.start(RATE_HZ.into()).expect("the run starts");
        let drive: Vec<f64> = (0..1000).map(|k| 30.0 - 30.0 * (0.0063 * f64::from(k)).cos()).collect();
        let (mut sent, mut measured) = (0, Vec::<Sample>::new());
        while measured.len() < drive.len() {
            sent += remote.exchange(&drive[sent..], &mut measured).expect("the run goes on");
        }
        remote.stop().expect("the run stops");
        assert_eq!(measured.len(), drive.len());
        assert!(measured.iter().zip(&drive).all(|(s, v)| s.drive_v == f64::from(*v as f32)));
    }
    // Whatever comes, and be it no frame at all.
    let mut port = Serial::open(&machine.port, 115_200).expect("the pseudo terminal opens");
    let mut chance = 1u64;
    for _ in 0..200 {
        let bytes: Vec<u8> = (0..100).map(|_| stirred(&mut chance) as u8).collect();
        port.send(&bytes).expect("it takes it");
    }
    drop(port);
    let mut remote = remote(&machine, 40, Mode::Voltage);
    assert_eq!(remote.status().expect("it answers").present_v, 0.0);
    remote.start(RATE_HZ.into()).expect("and runs");
    remote.stop().expect("and stops");
}

/// A host that goes leaves the device alone: it comes to rest by itself, within its slew limit, and says why.
#[test]
fn without_a_host_the_firmware_comes_to_rest() {
    let Some(machine) = machine() else { return };
    {
        let mut remote = remote(&machine, 11, Mode::Voltage);
        remote.start(RATE_HZ.into()).expect("the run starts");
        let drive: Vec<f64> = (0..400).map(|k| 0.2 * f64::from(k)).collect();
        let (mut sent, mut measured) = (0, Vec::new());
        while sent < drive.len() {
            sent += remote.exchange(&drive[sent..], &mut measured).expect("the run goes on");
        }
        // Neither stopped nor told: the port closes in the middle of the run.
    }
    sleep(Duration::from_millis(1500));
    let mut remote = remote(&machine, 12, Mode::Voltage);
    let refused = remote.start(RATE_HZ.into());
    assert!(matches!(refused, Err(RemoteError::Standing { fault: Fault::Silence, .. })), "{refused:?}");
    remote.clear().expect("at rest the fault can be cleared");
    assert_eq!(remote.present_v(), 0.0);
    remote.start(RATE_HZ.into()).expect("and the next run starts");
    remote.stop().expect("and stops");
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
fn hystctl_adapts_over_the_line() {
    let Some(machine) = machine() else { return };
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
#[ignore = "minutes of real time, and the emulator must not be delayed: HYST_SERVO=PROGRAM cargo test -p hyst-tests --test servo -- --ignored"]
fn hystctl_learns_over_the_line() {
    let Some(machine) = machine() else { return };
    let (lab, daq) = identified(&machine);
    let reference = "triangle:4,14,2,3";
    let learn = format!("learn --daq {daq} --model pi.json --reference {reference} --passes 5 -o learned.csv --json");
    let learned = lab.run(&learn);
    // A machine that is busy throughout holds QEMU up in every pass, and learning refuses that.
    if learned.stderr.contains("too slow") && learned.code != 0 {
        println!("skipped: learning over the line; this machine does not keep up with the device");
        return;
    }
    assert_eq!(learned.code, 0, "{}", learned.stderr);
    let learned = learned.json();
    let passes = learned["passes"].as_array().expect("passes");
    let (first, best) = (number(&learned, "/passes/0/rmse"), number(&learned, "/best") as usize);
    let last = number(&passes[best - 1], "/rmse");
    assert!(passes.len() <= 5 && last < 0.3 * first, "{learned:#}");
    println!("learned: {first:.4} to {last:.4} µm");
}
