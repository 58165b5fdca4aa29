//! Faults, emergency stops and their clearing.

use std::time::Duration;

use super::super::{Remote, RemoteError, RemoteOptions};
use super::bench::{Bench, options};
use super::slow::Slow;
use crate::Daq;
use crate::wire::{Ask, Fault, Mode, Refusal, Request, Start, State};

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
