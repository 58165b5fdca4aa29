//! Errors for CAN interfaces that cannot be used.

use std::time::Duration;

use hyst_hw::{Bus, Interface, SocketCan, SocketCanError, interfaces};

use super::interface::{Virtual, ip};

#[test]
#[ignore = "needs a machine with CAN interfaces: cargo xtask can"]
fn interfaces_are_listed() {
    let (fd, classic) = (Virtual::up("found-fd", true), Virtual::down("found-classic", false));
    let interface = |bus: &Virtual, up, fd| Interface { name: bus.name.to_owned(), up, fd };
    let found = interfaces();
    assert!(found.contains(&interface(&fd, true, true)), "{found:?}");
    assert!(found.contains(&interface(&classic, false, false)), "{found:?}");
    assert!(found.iter().all(|interface| interface.name != "lo"), "{found:?}");
}

#[test]
#[ignore = "needs a machine with CAN interfaces: cargo xtask can"]
fn a_name_without_can_interface_is_reported() {
    let bus = Virtual::up("refuse-absent", true);
    for name in ["can-of-nobody", "lo", ""] {
        for fd in [false, true] {
            let error = SocketCan::open(name, fd).unwrap_err();
            let SocketCanError::Absent { interface, there } = &error else { panic!("{name}: {error}") };
            assert_eq!(interface, name);
            assert!(there.iter().any(|there| there == bus.name), "{error}");
        }
    }
}

#[test]
#[ignore = "needs a machine with CAN interfaces: cargo xtask can"]
fn an_interface_that_is_down_is_reported_with_the_command() {
    let bus = Virtual::down("refuse-down", true);
    for fd in [false, true] {
        let error = SocketCan::open(bus.name, fd).unwrap_err();
        assert!(matches!(error, SocketCanError::Down { .. }), "{error}");
        assert!(error.to_string().contains("ip link set refuse-down up"), "{error}");
    }
}

#[test]
#[ignore = "needs a machine with CAN interfaces: cargo xtask can"]
fn an_interface_without_fd_is_reported() {
    let bus = Virtual::up("refuse-fd", false);
    let error = SocketCan::open(bus.name, true).unwrap_err();
    assert!(matches!(error, SocketCanError::ClassicOnly { .. }), "{error}");
    SocketCan::open(bus.name, false).unwrap();
}

#[test]
#[ignore = "needs a machine with CAN interfaces: cargo xtask can"]
fn an_interface_that_goes_down_is_an_error() {
    let bus = Virtual::up("refuse-later", true);
    let mut can = SocketCan::open(bus.name, false).unwrap();
    assert_eq!(can.receive(Duration::ZERO).unwrap(), None);
    ip(&["link", "set", bus.name, "down"]);
    let error = can.receive(Duration::from_secs(10)).unwrap_err();
    assert!(error.to_string().contains("down"), "{error}");
    can.send(1, &[]).unwrap_err();
}

#[test]
#[ignore = "needs a machine with CAN interfaces: cargo xtask can"]
fn invalid_frames_are_refused() {
    let bus = Virtual::up("refuse-frames", true);
    let mut can = SocketCan::open(bus.name, false).unwrap();
    can.send(1, &[0; 9]).unwrap_err();
    can.send(0x2000_0000, &[]).unwrap_err();
    let mut can = SocketCan::open(bus.name, true).unwrap();
    can.send(1, &[0; 65]).unwrap_err();
}
