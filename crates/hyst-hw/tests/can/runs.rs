//! Runs of a device over a CAN bus, observed and disturbed by can-utils.

use std::io::{BufRead, BufReader};
use std::ops::ControlFlow;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::Duration;

use hyst_hw::wire::{Board, Device, Identity, Open, Shown, State, Unit};
use hyst_hw::{CanLine, FROM_DEVICE, Line, RecordOptions, Remote, RemoteOptions, SocketCan, TO_DEVICE, record, serve};

use super::interface::{Program, Virtual, until};

/// Number of samples of a run.
const ROWS: usize = 1500;
const RATE_HZ: f64 = 1000.0;

/// An amplifier whose sensor shows half the voltage of the previous period.
struct Half(f32);

impl Board for Half {
    fn measure(&mut self) -> Shown {
        Shown { output: 0.5 * self.0, temperature_degc: 20.0, load_n: 0.0 }
    }
    fn put_out(&mut self, volts: f32) {
        self.0 = volts;
    }
}

fn identity() -> Identity {
    Identity {
        name: b"half".iter().copied().collect(),
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

/// Runs a device over these lines and checks that every sample arrives with the requested drive.
pub(crate) fn run(host: impl Line, mut line: impl Line + Send + 'static) {
    let stop = Arc::new(AtomicBool::new(false));
    let stopped = Arc::clone(&stop);
    let device = thread::spawn(move || {
        let (mut device, mut board) = (Device::<Open, 256, 0>::new(identity(), Open), Half(0.0));
        serve(&mut device, &mut board, &mut line, || stopped.load(Ordering::Relaxed)).expect("the bus stays");
        (device.state(), board.0)
    });
    let options = RemoteOptions {
        // In one of the tests, foreign frames destroy most answers, so requests are repeated many times.
        repeat: Duration::from_millis(40),
        lost: Duration::from_secs(120),
        silence_s: 60.0,
        ..RemoteOptions::with_session(11)
    };
    let mut remote = Remote::open(host, "bus", options).expect("the device answers");
    assert_eq!(remote.identity().name, "half".as_bytes());
    let drive: Vec<f64> = (0..ROWS).map(|k| 50.0 - 50.0 * (k as f64 * 0.02).cos()).collect();
    let recording =
        record(&mut remote, std::slice::from_ref(&drive), &RecordOptions::at(RATE_HZ), |_| ControlFlow::Continue(()))
            .expect("the run is complete");
    let samples = &recording.segments[0].samples;
    assert_eq!(samples.len(), ROWS);
    for (k, (sample, volts)) in samples.iter().zip(&drive).enumerate() {
        assert_eq!(sample.drive_v, f64::from(*volts as f32), "sample {k}");
        assert_eq!(sample.output, 0.5 * sample.drive_v, "sample {k}");
    }
    stop.store(true, Ordering::Relaxed);
    assert_eq!(device.join().expect("the device ends"), (State::Idle, 0.0));
}

/// Returns both ends of a connection on this interface.
fn lines(interface: &str, fd: bool) -> (CanLine<SocketCan>, CanLine<SocketCan>) {
    let open = |to, from| {
        let bus = SocketCan::open(interface, fd).unwrap();
        bus.hear_only(from).unwrap();
        CanLine::new(bus, to, from, fd)
    };
    (open(TO_DEVICE, FROM_DEVICE), open(FROM_DEVICE, TO_DEVICE))
}

/// Returns the frames that candump sees from now on, as identifier and data.
fn dump(interface: &'static str) -> (Program, Receiver<String>) {
    let mut candump = Program::start("candump", &["-L", interface]);
    let stdout = candump.0.stdout.take().expect("it is piped");
    let (to, lines) = channel();
    thread::spawn(move || {
        // "(1436509052.249713) vcan0 6A0#0100CCCCCCCCCCCC"
        for line in BufReader::new(stdout).lines().map_while(Result::ok) {
            let frame = line.split(' ').nth(2).unwrap_or(&line).to_owned();
            if to.send(frame).is_err() {
                break;
            }
        }
    });
    until("candump sees nothing", || {
        cansend(interface, "7FF#");
        lines.try_recv().is_ok_and(|frame| frame == "7FF#")
    });
    (candump, lines)
}

fn cansend(interface: &str, frame: &str) {
    let status = Command::new("cansend").args([interface, frame]).status().expect("cansend is installed");
    assert!(status.success(), "cansend {frame}");
}

/// Returns the number of frames, and the number of frames with the maximum length.
fn seen(frames: &Receiver<String>, fd: bool) -> (usize, usize) {
    let (mut all, mut longest) = (0, 0);
    for frame in frames.try_iter().filter(|frame| frame.starts_with("6A")) {
        // "##" and a digit with flags; the lowest one is bit-rate switching.
        let (id, data) = match frame.split_once("##") {
            Some((id, data)) if fd && matches!(data.as_bytes().first(), Some(b'1' | b'5')) => (id, &data[1..]),
            None if !fd => frame.split_once('#').unwrap_or_else(|| panic!("{frame}")),
            _ => panic!("{frame}"),
        };
        assert!(["6A0", "6A1"].contains(&id), "{frame}");
        let lengths: &[usize] = if fd { &[8, 12, 16, 20, 24, 32, 48, 64] } else { &[8] };
        assert!(lengths.contains(&(data.len() / 2)), "{frame}");
        assert!(data.bytes().all(|digit| digit.is_ascii_hexdigit()), "{frame}");
        all += 1;
        longest += usize::from(data.len() == 128);
    }
    (all, longest)
}

#[test]
#[ignore = "needs a machine with CAN interfaces: cargo xtask can"]
fn a_run_over_classic_frames_is_complete() {
    let bus = Virtual::up("run", false);
    let (_candump, frames) = dump(bus.name);
    let (host, device) = lines(bus.name, false);
    run(host, device);
    let (all, longest) = seen(&frames, false);
    println!("candump saw {all} frames");
    assert!(all > ROWS && longest == 0);
}

#[test]
#[ignore = "needs a machine with CAN interfaces: cargo xtask can"]
fn a_run_over_fd_frames_is_complete() {
    let bus = Virtual::up("run-fd", true);
    let (_candump, frames) = dump(bus.name);
    let (host, device) = lines(bus.name, true);
    run(host, device);
    let (all, longest) = seen(&frames, true);
    println!("candump saw {all} frames, {longest} of 64 bytes");
    assert!(all > ROWS / 10 && longest > ROWS / 20);
}

/// Foreign frames, and invalid frames with the identifiers of the connection.
const FOREIGN: [&str; 12] = [
    "123#DEADBEEF",
    "6A1#300000",
    "6A1#320000",
    "6A0#2111111111111111",
    "6A1#1014010203040506",
    "6A1#1FFF010203040506",
    "6A0#03010203",
    "6A1#07FFFFFFFFFFFFFF",
    "6A1#R",
    "000006A1#0700112233445566",
    "1FFFFFFF#",
    "6A0#",
];

#[test]
#[ignore = "needs a machine with CAN interfaces: cargo xtask can"]
fn foreign_frames_do_not_disturb_a_run() {
    for fd in [false, true] {
        let bus = Virtual::up(if fd { "foreign-fd" } else { "foreign" }, fd);
        let over = Arc::new(AtomicBool::new(false));
        let (ends, name) = (Arc::clone(&over), bus.name);
        let others = thread::spawn(move || {
            let mut sent = 0;
            for frame in FOREIGN.iter().cycle() {
                if ends.load(Ordering::Relaxed) && sent >= FOREIGN.len() {
                    break;
                }
                cansend(name, frame);
                if fd {
                    cansend(name, &format!("6A1##1{}", "00".repeat(64)));
                }
                sent += 1;
            }
            sent
        });
        let (host, device) = lines(bus.name, fd);
        run(host, device);
        over.store(true, Ordering::Relaxed);
        let sent = others.join().unwrap();
        println!("a run with {sent} foreign frames in between");
        assert!(sent >= FOREIGN.len());
    }
}
