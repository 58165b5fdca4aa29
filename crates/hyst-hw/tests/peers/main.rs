//! CAN over a serial line, against python-can and can-isotp at the other end of a pseudo terminal.
//!
//! `HYST_PYTHON` is the path of a Python with both packages. `cargo xtask can` prepares one and runs the tests, which
//! are ignored otherwise.
#![cfg(all(feature = "std", unix))]

use std::io::{BufRead, BufReader, Lines};
use std::process::{Child, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use hyst_hw::{Bus, CanLine, FROM_DEVICE, Line, Serial, Slcan, TO_DEVICE};
use serialport::{SerialPort, TTYPort};

/// Time limit for an answer of the peer.
const PATIENCE: Duration = Duration::from_secs(30);

/// The peer, killed on drop.
struct Peer {
    process: Child,
    said: Lines<BufReader<ChildStdout>>,
    // Keeps the terminal open until the peer has opened it.
    _terminal: TTYPort,
}

impl Drop for Peer {
    fn drop(&mut self) {
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

impl Peer {
    /// Returns the next line that the peer prints.
    fn says(&mut self) -> String {
        self.said.next().expect("the peer still runs").expect("it prints text")
    }
}

/// Starts a peer for this task and opens the adapter.
fn peer(what: &str, rest: &[&str]) -> (Peer, Slcan<Serial>) {
    let python = std::env::var_os("HYST_PYTHON").expect("HYST_PYTHON is a Python with python-can");
    let (near, mut terminal) = TTYPort::pair().expect("a pseudo terminal");
    terminal.set_exclusive(false).expect("others may open it");
    let path = terminal.name().expect("it has a name");
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/peers/peer.py");
    let mut command = Command::new(python);
    let started = command.args([script, what, &path]).args(rest).stdout(Stdio::piped()).spawn();
    let mut process = started.expect("Python starts");
    let said = BufReader::new(process.stdout.take().expect("it is piped")).lines();
    let mut peer = Peer { process, said, _terminal: terminal };
    assert_eq!(peer.says(), "ready");
    (peer, Slcan::open(Serial::over(Box::new(near)), 500_000).expect("the line is there"))
}

/// Returns alternating identifiers of both kinds, including the smallest and largest ones.
fn id(k: u32) -> u32 {
    match k {
        0 => 0,
        1 => 0x800,
        2 => 0x7ff,
        3 => 0x1fff_ffff,
        _ if k.is_multiple_of(2) => k * 37 % 0x800,
        _ => 0x800 + k * 1_234_567 % 0x1fff_f800,
    }
}

#[test]
#[ignore = "needs Python packages: cargo xtask can"]
fn frames_pass_python_can_in_both_directions() {
    let (mut peer, mut bus) = peer("frames", &[]);
    let lengths = (0..=8).cycle().take(400).chain([12, 16, 20, 24, 32, 48, 64].into_iter().cycle().take(56));
    let mut count = 0;
    for (k, length) in lengths.enumerate() {
        let id = id(k as u32);
        let data: Vec<u8> = (0..length).map(|i| (k * 31 + i * 7) as u8).collect();
        bus.send(id, &data).unwrap();
        let kind = format!("{}{}", if id > 0x7ff { 'T' } else { 't' }, if length > 8 { 'f' } else { 'c' });
        let hex: String = data.iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(peer.says(), format!("{id:x} {kind} {hex}"), "frame {k}");
        let back = bus.receive(PATIENCE).unwrap();
        assert_eq!(back, Some((id ^ 1, data.iter().rev().copied().collect())), "frame {k}");
        count += 1;
    }
    println!("{count} frames each way");
}

/// Exchanges messages in both directions and returns their number.
///
/// The lengths include those around changes of the frame format.
fn messages(fd: bool, block: &str) -> usize {
    let (mut peer, bus) = peer("isotp", &[if fd { "fd" } else { "classic" }, block]);
    let mut line = CanLine::new(bus, TO_DEVICE, FROM_DEVICE, fd).patient(PATIENCE);
    let mut count = 0;
    for length in (1..=130).chain((133..=510).step_by(13)) {
        let message: Vec<u8> = (0..length).map(|i| (i * 7 + length * 13) as u8).collect();
        line.send(&message).unwrap();
        let (mut back, mut bytes, began) = (Vec::new(), [0; 4095], Instant::now());
        while back.len() < length && began.elapsed() < PATIENCE {
            let received = line.receive(&mut bytes, Duration::from_millis(100)).unwrap();
            back.extend_from_slice(&bytes[..received]);
        }
        assert_eq!(peer.says(), length.to_string(), "block {block}, fd {fd}");
        back.reverse();
        assert_eq!(back, message, "{length} bytes, block {block}, fd {fd}");
        count += 2;
    }
    count
}

#[test]
#[ignore = "needs Python packages: cargo xtask can"]
fn messages_pass_can_isotp_in_both_directions() {
    for fd in [false, true] {
        for block in ["0", "4"] {
            let count = messages(fd, block);
            println!("{count} messages, {}, blocks of {block}", if fd { "CAN FD" } else { "classic" });
        }
    }
}
