//! A device as in firmware, with drivers of `embedded-io` and `embedded-can`, and its host.

use std::collections::VecDeque;
use std::convert::Infallible;
use std::io;
use std::ops::ControlFlow;
use std::time::Duration;

use embedded_can::nb::Can;
use embedded_can::{ExtendedId, Frame, Id, StandardId};
use embedded_io::{ErrorType, Read, ReadReady, Write, WriteReady};
use hyst_hw::wire::{
    Board, CanData, CanServer, Device, Exchange, Identity, MOST_SAMPLES, Measured, Open, Reply, SerialServer, Shown,
    State, Status, Tell, Unit, encode,
};
use hyst_hw::{Bus, CanLine, FROM_DEVICE, Line, RecordOptions, Remote, RemoteOptions, TO_DEVICE, record};

#[derive(Default)]
struct Amplifier(f32);

impl Board for Amplifier {
    fn measure(&mut self) -> Shown {
        Shown { output: 0.25 * self.0, ..Shown::default() }
    }
    fn put_out(&mut self, volts: f32) {
        self.0 = volts;
    }
}

type Echo = Device<Open, 64, 0>;

fn echo() -> Echo {
    let identity = Identity {
        name: b"board".iter().copied().collect(),
        min_v: 0.0,
        max_v: 100.0,
        rest_v: 0.0,
        max_slew_v_per_s: 1e5,
        min_rate_hz: 1.0,
        max_rate_hz: 1e4,
        output: Unit::Micrometre,
        temperature: false,
        load: false,
        follows: false,
        queue: 0,
        model: 0,
    };
    Device::new(identity, Open)
}

/// A UART, ready to write only at every third query, and both ends of its line.
#[derive(Default)]
struct Uart {
    to_device: VecDeque<u8>,
    to_host: VecDeque<u8>,
    asked: u32,
}

impl ErrorType for Uart {
    type Error = Infallible;
}
impl ReadReady for Uart {
    fn read_ready(&mut self) -> Result<bool, Infallible> {
        Ok(!self.to_device.is_empty())
    }
}
impl Read for Uart {
    fn read(&mut self, bytes: &mut [u8]) -> Result<usize, Infallible> {
        Ok(bytes.iter_mut().map_while(|b| self.to_device.pop_front().map(|x| *b = x)).count())
    }
}
impl WriteReady for Uart {
    fn write_ready(&mut self) -> Result<bool, Infallible> {
        self.asked += 1;
        Ok(self.asked.is_multiple_of(3))
    }
}
impl Write for Uart {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        self.to_host.extend(bytes.first());
        Ok(bytes.len().min(1))
    }
    fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

/// The main loop of a firmware with a serial line; each `receive` of the host advances the clock.
struct SerialBoard {
    device: Echo,
    amplifier: Amplifier,
    server: SerialServer,
    uart: Uart,
}

impl Line for SerialBoard {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.uart.to_device.extend(bytes);
        Ok(())
    }
    fn receive(&mut self, bytes: &mut [u8], _: Duration) -> io::Result<usize> {
        self.device.tick(&mut self.amplifier);
        for _ in 0..200 {
            let Ok(()) = self.server.poll(&mut self.device, &mut self.uart);
        }
        Ok(bytes.iter_mut().map_while(|b| self.uart.to_host.pop_front().map(|x| *b = x)).count())
    }
}

fn check_complete_run(line: impl Line) {
    let options = RemoteOptions { silence_s: 30.0, ..RemoteOptions::with_session(5) };
    let mut remote = Remote::open(line, "board", options).unwrap();
    let drive: Vec<f64> = (0..500).map(|k| 50.0 - 50.0 * (f64::from(k) * 0.02).cos()).collect();
    let recording =
        record(&mut remote, std::slice::from_ref(&drive), &RecordOptions::at(1000.0), |_| ControlFlow::Continue(()))
            .unwrap();
    let samples = &recording.segments[0].samples;
    assert_eq!(samples.len(), drive.len());
    for (sample, volts) in samples.iter().zip(&drive) {
        assert_eq!(sample.drive_v, f64::from(*volts as f32));
        assert_eq!(sample.output, f64::from(0.25 * *volts as f32));
    }
}

#[test]
fn a_run_over_a_rarely_ready_serial_driver_is_complete() {
    check_complete_run(SerialBoard {
        device: echo(),
        amplifier: Amplifier::default(),
        server: SerialServer::new(),
        uart: Uart::default(),
    });
}

#[derive(Clone)]
struct Classic(Id, CanData);

impl Frame for Classic {
    fn new(id: impl Into<Id>, data: &[u8]) -> Option<Self> {
        Some(Self(id.into(), CanData::from_slice(data).ok().filter(|d| d.len() <= 8)?))
    }
    fn new_remote(_: impl Into<Id>, _: usize) -> Option<Self> {
        None
    }
    fn is_extended(&self) -> bool {
        matches!(self.0, Id::Extended(_))
    }
    fn is_remote_frame(&self) -> bool {
        false
    }
    fn id(&self) -> Id {
        self.0
    }
    fn dlc(&self) -> usize {
        self.1.len()
    }
    fn data(&self) -> &[u8] {
        &self.1
    }
}

#[derive(Debug)]
struct Never;

impl embedded_can::Error for Never {
    fn kind(&self) -> embedded_can::ErrorKind {
        embedded_can::ErrorKind::Other
    }
}

/// A CAN controller with one transmit mailbox.
///
/// Sometimes the next frame replaces the frame that waits there.
#[derive(Default)]
struct Controller {
    to_device: VecDeque<Classic>,
    place: Option<Classic>,
    to_host: VecDeque<Classic>,
    times: u32,
}

impl Can for Controller {
    type Frame = Classic;
    type Error = Never;
    fn transmit(&mut self, frame: &Classic) -> nb::Result<Option<Classic>, Never> {
        self.times += 1;
        if self.place.is_none() {
            self.place = Some(frame.clone());
        } else if self.times.is_multiple_of(2) {
            self.to_host.extend(self.place.replace(frame.clone()));
        } else {
            return Err(nb::Error::WouldBlock);
        }
        Ok(None)
    }
    fn receive(&mut self) -> nb::Result<Classic, Never> {
        self.to_host.extend(self.place.take());
        self.to_device.pop_front().ok_or(nb::Error::WouldBlock)
    }
}

struct CanBoard {
    device: Echo,
    amplifier: Amplifier,
    server: CanServer,
    controller: Controller,
}

impl Bus for CanBoard {
    fn send(&mut self, id: u32, data: &[u8]) -> io::Result<()> {
        // Another node also sends on the bus.
        let other = Id::Extended(ExtendedId::new(0x18da_f100).unwrap());
        let frames = [(other, &[0x10, 0x20, 1, 2, 3, 4, 5, 6][..]), (StandardId::new(id as u16).unwrap().into(), data)];
        self.controller.to_device.extend(frames.map(|(id, data)| Classic::new(id, data).unwrap()));
        Ok(())
    }
    fn receive(&mut self, _: Duration) -> io::Result<Option<(u32, CanData)>> {
        self.device.tick(&mut self.amplifier);
        self.server.poll(&mut self.device, &mut self.controller).map_err(|_| io::ErrorKind::Other)?;
        let id = |frame: &Classic| match frame.0 {
            Id::Standard(id) => u32::from(id.as_raw()),
            Id::Extended(id) => id.as_raw(),
        };
        Ok(self.controller.to_host.pop_front().map(|frame| (id(&frame), frame.1)))
    }
}

#[test]
fn a_run_over_a_can_driver_on_a_shared_bus_is_complete() {
    let board = CanBoard {
        device: echo(),
        amplifier: Amplifier::default(),
        server: CanServer::new(TO_DEVICE, FROM_DEVICE),
        controller: Controller::default(),
    };
    check_complete_run(CanLine::new(board, TO_DEVICE, FROM_DEVICE, false));
}

/// The largest answer and the largest request fit in a frame.
#[test]
fn the_largest_messages_fit_in_a_frame() {
    let status = Status {
        state: State::Fault(hyst_hw::wire::Fault::Saturation),
        session: u32::MAX,
        tick: u32::MAX,
        present_v: 1.0,
        output: 1.0,
        received: u32::MAX,
        room: u32::MAX,
        measured: u32::MAX,
    };
    let measured =
        Measured { tick: u32::MAX, drive_v: 1.0, output: 1.0, temperature_degc: 1.0, load_n: 1.0, force_n: Some(1.0) };
    let samples = std::iter::repeat_n(measured, MOST_SAMPLES).collect();
    let reply = Reply { number: u32::MAX, tell: Tell::Samples { status, first: u32::MAX, samples } };
    encode(&reply, &mut [0; hyst_hw::wire::MAX_FRAME]).unwrap();
    let drives = std::iter::repeat_n(1.0, hyst_hw::wire::MOST_DRIVES).collect();
    let ask = hyst_hw::wire::Ask::Exchange(Exchange { session: u32::MAX, heard: u32::MAX, first: u32::MAX, drives });
    encode(&hyst_hw::wire::Request { number: u32::MAX, ask }, &mut [0; hyst_hw::wire::MAX_FRAME]).unwrap();
}
