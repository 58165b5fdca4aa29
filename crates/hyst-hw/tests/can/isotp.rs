//! ISO-TP of the kernel at the other end of a [`CanLine`].

use std::io::{Read, Write};
use std::os::fd::OwnedFd;
use std::time::{Duration, Instant};

use hyst_hw::{CanLine, FROM_DEVICE, Line, SocketCan, TO_DEVICE};
use socket2::{Domain, Protocol, Type};
use socketcan::{CanAddr, CanSocket, Socket, SocketOptions, StandardId};

use super::interface::Virtual;

/// Constants of linux/can.h and linux/can/isotp.h.
const ISOTP: i32 = 6;
const LEVEL: i32 = 100 + ISOTP;
const OPTIONS: i32 = 1;
const FLOW: i32 = 2;
const FRAMES: i32 = 5;
/// Frames are padded, and received frames must have the right length and padding byte.
const FILL: u32 = 0x4 | 0x8 | 0x10 | 0x20;

/// Longest message that both ends accept (bytes).
const LONGEST: usize = hyst_hw::wire::MAX_FRAME;

/// Settings of the kernel's end.
#[derive(Clone, Copy, Debug)]
struct Settings {
    fd: bool,
    fill: bool,
    /// Block size and minimum separation time (STmin), as encoded in the standard.
    block: u8,
    pause: u8,
}

/// Opens the kernel's end, in the role of the device.
fn kernel(interface: &str, settings: Settings) -> CanSocket {
    let kind = (Domain::from(libc::AF_CAN), Type::DGRAM, Protocol::from(ISOTP));
    let socket = socket2::Socket::new(kind.0, kind.1, Some(kind.2)).expect("the kernel has can-isotp");
    let socket = CanSocket::from(OwnedFd::from(socket));
    if settings.fill {
        let [a, b, c, d] = FILL.to_ne_bytes();
        // Flags, time, address, padding byte to send, padding byte to expect, address.
        let options: [u8; 12] = [a, b, c, d, 0, 0, 0, 0, 0, 0xaa, 0xcc, 0];
        socket.set_socket_option(LEVEL, OPTIONS, &options).unwrap();
    }
    socket.set_socket_option(LEVEL, FLOW, &[settings.block, settings.pause, 0]).unwrap();
    if settings.fd {
        socket.set_socket_option(LEVEL, FRAMES, &[72u8, 64, 0]).unwrap();
    }
    let id = |id: u32| StandardId::new(id as u16).unwrap();
    let address = CanAddr::from_iface_isotp(interface, id(TO_DEVICE), id(FROM_DEVICE)).unwrap();
    let raw = socket.as_raw_socket();
    raw.bind(&address.into_sock_addr()).unwrap();
    raw.set_read_timeout(Some(Duration::from_secs(20))).unwrap();
    socket
}

/// Returns bytes that are different for every message.
fn message(length: usize, salt: usize) -> Vec<u8> {
    (0..length).map(|i| (i * 7 + length * 13 + salt * 101) as u8).collect()
}

/// Exchanges messages of these lengths in both directions and returns their number.
fn exchange(interface: &str, settings: Settings, lengths: impl Iterator<Item = usize>) -> usize {
    let mut peer = kernel(interface, settings);
    let bus = SocketCan::open(interface, settings.fd).unwrap();
    bus.hear_only(FROM_DEVICE).unwrap();
    let mut line = CanLine::new(bus, TO_DEVICE, FROM_DEVICE, settings.fd);
    let mut count = 0;
    for length in lengths {
        let there = message(length, 1);
        line.send(&there).unwrap();
        let mut bytes = [0; 4095];
        let received =
            peer.read(&mut bytes).unwrap_or_else(|error| panic!("{settings:?}, {length} bytes there: {error}"));
        assert_eq!(bytes[..received], there, "{settings:?}, {length} bytes there");

        let back = message(length, 2);
        peer.write_all(&back).unwrap();
        let (mut received, began) = (0, Instant::now());
        while received < length && began.elapsed() < Duration::from_secs(20) {
            received += line.receive(&mut bytes[received..], Duration::from_millis(100)).unwrap();
        }
        assert_eq!(bytes[..received], back, "{settings:?}, {length} bytes back");
        count += 2;
    }
    count
}

#[test]
#[ignore = "needs a machine with CAN interfaces: cargo xtask can"]
fn messages_of_every_length_pass_in_classic_frames() {
    let bus = Virtual::up("isotp", false);
    let settings = Settings { fd: false, fill: true, block: 0, pause: 0 };
    let count = exchange(bus.name, settings, 1..=LONGEST);
    println!("{count} messages of 1 to {LONGEST} bytes");
}

#[test]
#[ignore = "needs a machine with CAN interfaces: cargo xtask can"]
fn messages_of_every_length_pass_in_fd_frames() {
    let bus = Virtual::up("isotp-fd", true);
    let settings = Settings { fd: true, fill: true, block: 0, pause: 0 };
    let count = exchange(bus.name, settings, 1..=LONGEST);
    println!("{count} messages of 1 to {LONGEST} bytes");
}

#[test]
#[ignore = "needs a machine with CAN interfaces: cargo xtask can"]
fn block_size_and_separation_time_are_respected() {
    let bus = Virtual::up("isotp-slow", true);
    let lengths = [1, 7, 8, 20, 62, 63, 100, 300, LONGEST];
    let mut count = 0;
    for (fd, fill) in [(false, false), (false, true), (true, false), (true, true)] {
        for (block, pause) in [(1, 0), (3, 0xf3), (0, 2), (15, 0xf9)] {
            count += exchange(bus.name, Settings { fd, fill, block, pause }, lengths.into_iter());
        }
    }
    println!("{count} messages in blocks and with pauses");
}
