//! Messages about refusals, lost connections and missing devices.

use std::io;
use std::net::TcpListener;
use std::ops::ControlFlow;
use std::time::Duration;

use super::super::{Line, Remote, RemoteError, RemoteOptions, Serial, Tcp};
use super::bench::{Bench, options};
use crate::wire::{Ask, Fault, Refusal, Request, State};
use crate::{Cause, Daq, RecordOptions, record};

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

#[test]
fn missing_ports_are_reported() {
    let message = Serial::open("/dev/tty-of-nobody", 115_200).unwrap_err().to_string();
    assert!(message.starts_with("/dev/tty-of-nobody: there is no such port"), "{message}");
    // No program listens at a port that was just closed.
    let address = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    Tcp::connect(address).unwrap_err();
}
