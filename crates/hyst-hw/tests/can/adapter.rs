//! The kernel's slcan driver, with this crate as the adapter at the other end of a pseudo terminal.

use std::io::ErrorKind;
use std::thread;
use std::time::Duration;

use hyst_hw::{Bus, CanLine, FROM_DEVICE, Serial, Slcan, SocketCan, TO_DEVICE, interfaces};
use serialport::{SerialPort, TTYPort};

use super::interface::{Program, tried, until};
use super::runs::run;

/// The interface of such an adapter, deleted on drop.
struct Adapter {
    name: &'static str,
    _driver: Program,
    // Keeps the terminal open.
    _terminal: TTYPort,
}

/// Returns an interface, and the bus at its other end.
fn adapter(name: &'static str) -> (Adapter, Slcan<Serial>) {
    let (adapter, terminal) = TTYPort::pair().unwrap();
    let path = terminal.name().expect("a pseudo terminal has a name");
    let driver = Program::start("slcand", &["-F", "-o", "-s6", &path, name]);
    // The interface is listed shortly before commands accept its name.
    let listed = || interfaces().iter().any(|interface| interface.name == name);
    until("slcand does not create an interface", || listed() && tried(&["link", "set", name, "up"]));
    let bus = Slcan::open(Serial::over(Box::new(adapter)), 500_000).unwrap();
    (Adapter { name, _driver: driver, _terminal: terminal }, bus)
}

/// Returns frames with identifiers of both kinds and every length.
fn frames(count: usize) -> impl Iterator<Item = (u32, Vec<u8>)> {
    (0..count).map(|k| {
        let id = if k % 2 == 0 { k as u32 * 37 % 0x800 } else { 0x800 + k as u32 * 1_234_567 % 0x1fff_f800 };
        (id, (0..k % 9).map(|i| (k * 31 + i * 7) as u8).collect())
    })
}

/// Checks that these frames arrive, complete and in order.
fn check_frames_arrive(bus: &mut impl Bus, count: usize) {
    for (k, (id, data)) in frames(count).enumerate() {
        let received = bus.receive(Duration::from_secs(20)).unwrap();
        assert_eq!(received, Some((id, data.iter().copied().collect())), "frame {k}");
    }
}

#[test]
#[ignore = "needs a machine with CAN interfaces: cargo xtask can"]
fn frames_pass_the_kernels_driver_in_both_directions() {
    let (interface, mut far) = adapter("slc-frames");
    let mut near = SocketCan::open(interface.name, false).unwrap();
    // More frames than the queue of the interface holds, so they wait for the line.
    let count = 600;
    thread::scope(|scope| {
        scope.spawn(|| frames(count).for_each(|(id, data)| near.send(id, &data).unwrap()));
        check_frames_arrive(&mut far, count);
    });
    thread::scope(|scope| {
        scope.spawn(|| frames(count).for_each(|(id, data)| far.send(id, &data).unwrap()));
        check_frames_arrive(&mut near, count);
    });
    println!("{count} frames each way");
}

#[test]
#[ignore = "needs a machine with CAN interfaces: cargo xtask can"]
fn a_run_through_the_kernels_driver() {
    let (interface, far) = adapter("slc-run");
    let near = SocketCan::open(interface.name, false).unwrap();
    run(CanLine::new(near, TO_DEVICE, FROM_DEVICE, false), CanLine::new(far, FROM_DEVICE, TO_DEVICE, false));
}

#[test]
#[ignore = "needs a machine with CAN interfaces: cargo xtask can"]
fn a_bus_that_accepts_no_frames_is_reported() {
    let (interface, far) = adapter("slc-full");
    let mut near = SocketCan::open(interface.name, false).unwrap();
    // The other end does not read.
    let full = (0..100_000).find_map(|_| near.send(1, &[0; 8]).err()).expect("the queue is full at some point");
    assert_ne!(full.kind(), ErrorKind::InvalidInput);
    assert!(full.to_string().contains("bit rate"), "{full}");
    drop(far);
}
