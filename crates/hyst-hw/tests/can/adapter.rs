//! The kernel's driver of slcan adapters, with ours as the adapter at the other end of a pseudo terminal.

use std::io::ErrorKind;
use std::thread;
use std::time::Duration;

use hyst_hw::{Bus, CanLine, FROM_DEVICE, Serial, Slcan, SocketCan, TO_DEVICE, interfaces};
use serialport::{SerialPort, TTYPort};

use super::interface::{Program, here, tried, until};
use super::runs::run;

/// The interface of such an adapter; it ends with it.
struct Adapter {
    name: &'static str,
    _driver: Program,
    // Without it the terminal hangs up.
    _terminal: TTYPort,
}

/// An interface, and what is at its other end.
fn adapter(name: &'static str) -> Option<(Adapter, Slcan<Serial>)> {
    if !here() {
        return None;
    }
    let (adapter, terminal) = TTYPort::pair().unwrap();
    let path = terminal.name().expect("a pseudo terminal has a name");
    let driver = Program::start("slcand", &["-F", "-o", "-s6", &path, name]);
    // It is listed by its name a moment before it answers to it.
    let listed = || interfaces().iter().any(|interface| interface.name == name);
    until("slcand makes no interface", || listed() && tried(&["link", "set", name, "up"]));
    let bus = Slcan::open(Serial::over(Box::new(adapter)), 500_000).unwrap();
    Some((Adapter { name, _driver: driver, _terminal: terminal }, bus))
}

/// Frames with identifiers of both kinds and every length.
fn frames(count: usize) -> impl Iterator<Item = (u32, Vec<u8>)> {
    (0..count).map(|k| {
        let id = if k % 2 == 0 { k as u32 * 37 % 0x800 } else { 0x800 + k as u32 * 1_234_567 % 0x1fff_f800 };
        (id, (0..k % 9).map(|i| (k * 31 + i * 7) as u8).collect())
    })
}

/// They come, whole and in order.
fn come(bus: &mut impl Bus, count: usize) {
    for (k, (id, data)) in frames(count).enumerate() {
        let came = bus.receive(Duration::from_secs(20)).unwrap();
        assert_eq!(came, Some((id, data.iter().copied().collect())), "frame {k}");
    }
}

#[test]
fn the_kernels_driver_understands_frames_and_is_understood() {
    let Some((interface, mut far)) = adapter("slc-frames") else { return };
    let mut near = SocketCan::open(interface.name, false).unwrap();
    // More than the queue of the interface takes: the frames wait for the line.
    let count = 600;
    thread::scope(|scope| {
        scope.spawn(|| frames(count).for_each(|(id, data)| near.send(id, &data).unwrap()));
        come(&mut far, count);
    });
    thread::scope(|scope| {
        scope.spawn(|| frames(count).for_each(|(id, data)| far.send(id, &data).unwrap()));
        come(&mut near, count);
    });
    println!("{count} frames each way");
}

#[test]
fn a_run_through_the_kernels_driver() {
    let Some((interface, far)) = adapter("slc-run") else { return };
    let near = SocketCan::open(interface.name, false).unwrap();
    run(CanLine::new(near, TO_DEVICE, FROM_DEVICE, false), CanLine::new(far, FROM_DEVICE, TO_DEVICE, false));
}

#[test]
fn a_bus_that_takes_no_frames_is_told() {
    let Some((interface, far)) = adapter("slc-full") else { return };
    let mut near = SocketCan::open(interface.name, false).unwrap();
    // Nobody reads at the other end.
    let full = (0..100_000).find_map(|_| near.send(1, &[0; 8]).err()).expect("the queue has an end");
    assert_ne!(full.kind(), ErrorKind::InvalidInput);
    assert!(full.to_string().contains("bit rate"), "{full}");
    drop(far);
}
