//! Runs over real lines: TCP, a pseudo terminal, a CAN bus.

use std::io;
use std::net::TcpListener;
use std::ops::ControlFlow;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::{JoinHandle, spawn};
use std::time::Duration;

#[cfg(unix)]
use super::super::Serial;
use super::super::{Bus, CanLine, FROM_DEVICE, Line, Remote, RemoteOptions, TO_DEVICE, Tcp};
use super::bench::{Echo, identity, options, wave};
use crate::wire::{CanData, Device, Fault, Open, State};
use crate::{Daq, RecordOptions, record};

/// Serves a device on its own clock until the host disconnects.
///
/// Returns its state after 24,000 more periods.
fn served(mut line: impl Line + Send + 'static) -> JoinHandle<(Device<Open, 128, 0>, Echo)> {
    spawn(move || {
        let (mut device, mut board) = (Device::new(identity(), Open), Echo::default());
        // The end of the connection is expected here.
        let _ = crate::serve(&mut device, &mut board, &mut line, || false);
        (0..24_000).for_each(|_| device.tick(&mut board));
        (device, board)
    })
}

/// Plays a run over a real line, on the device's own clock.
///
/// Then the host disconnects, and the watchdog brings the device to rest.
fn run_over(host: impl Line, device: impl Line + Send + 'static) {
    let device = served(device);
    let options = RemoteOptions {
        // A busy computer may delay a thread.
        silence_s: 10.0,
        repeat: Duration::from_millis(200),
        lost: Duration::from_secs(20),
        ..options()
    };
    let mut remote = Remote::open(host, "line", options).unwrap();
    let drive = wave(900);
    let recording =
        record(&mut remote, std::slice::from_ref(&drive), &RecordOptions::at(2000.0), |_| ControlFlow::Continue(()))
            .unwrap();
    let samples = &recording.segments[0].samples;
    assert_eq!(samples.len(), drive.len());
    assert!(samples.iter().zip(&drive).all(|(s, v)| s.drive_v == f64::from(*v as f32) && s.output == 0.5 * s.drive_v));
    remote.start(2000.0).unwrap();
    remote.exchange(&[30.0; 50], &mut Vec::new()).unwrap();
    drop(remote);
    let (device, board) = device.join().unwrap();
    assert_eq!((device.state(), board.volts), (State::Fault(Fault::Silence), 0.0));
}

#[test]
fn a_run_over_a_tcp_connection() {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let host = Tcp::connect(listener.local_addr().unwrap()).unwrap();
    run_over(host, Tcp::over(listener.accept().unwrap().0).unwrap());
}

#[cfg(unix)]
#[test]
fn a_run_over_a_pseudo_terminal() {
    let (host, device) = serialport::TTYPort::pair().unwrap();
    run_over(Serial::over(Box::new(host)), Serial::over(Box::new(device)));
}

/// One end of a bus with two nodes; it checks the length of frames.
struct Wire {
    out: Sender<(u32, CanData)>,
    into: Receiver<(u32, CanData)>,
    longest: usize,
}

impl Bus for Wire {
    fn send(&mut self, id: u32, data: &[u8]) -> io::Result<()> {
        assert!(data.len() <= self.longest);
        self.out.send((id, data.iter().copied().collect())).map_err(|_| io::ErrorKind::BrokenPipe.into())
    }
    fn receive(&mut self, patience: Duration) -> io::Result<Option<(u32, CanData)>> {
        match self.into.recv_timeout(patience) {
            Ok(frame) => Ok(Some(frame)),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(io::ErrorKind::BrokenPipe.into()),
        }
    }
}

#[test]
fn a_run_over_a_can_bus() {
    for (fd, longest) in [(false, 8), (true, 64)] {
        let ((there, from_host), (back, from_device)) = (channel(), channel());
        let host = Wire { out: there, into: from_device, longest };
        let device = Wire { out: back, into: from_host, longest };
        run_over(CanLine::new(host, TO_DEVICE, FROM_DEVICE, fd), CanLine::new(device, FROM_DEVICE, TO_DEVICE, fd));
    }
}
