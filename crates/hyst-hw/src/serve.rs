//! A device in software behind a line, for trying and testing the host side.

use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::Scope;
use std::time::{Duration, Instant};

use crate::daq::{Daq, Sample};
use crate::plant::Plant;
use crate::plant::error::PlantError;
use crate::remote::Line;
use crate::wire::{Board, Control, Deframer, Device, Identity, MAX_FRAME, MOST_NAME, Request, Shown, Unit, encode};

/// Maximum number of late periods that are caught up.
///
/// If this computer is later than that, the device skips periods.
const MAX_LATE_PERIODS: u32 = 1000;
/// Maximum number of periods that are caught up before the line is read again.
///
/// Otherwise the watchdog could count a host as silent although its requests wait in the line.
const MAX_PERIODS_AT_ONCE: u32 = 20;
/// Maximum number of connected hosts; further connections are closed.
const MAX_HOSTS: usize = 8;

/// The clock of the device, driven by the clock of this computer.
struct Pace {
    due: Instant,
}

impl Pace {
    fn new() -> Self {
        Self { due: Instant::now() }
    }

    /// Runs the periods that are due and returns the time until the next one.
    fn run_due_periods<C: Control, const Q: usize, const M: usize>(
        &mut self,
        device: &mut Device<C, Q, M>,
        board: &mut impl Board,
    ) -> Duration {
        let period = Duration::from_secs_f64(1.0 / f64::from(device.rate_hz().max(1.0)));
        let mut late = 0;
        while late < MAX_PERIODS_AT_ONCE && self.due <= Instant::now() {
            device.tick(board);
            self.due += period;
            late += 1;
        }
        if Instant::now().saturating_duration_since(self.due) > period * MAX_LATE_PERIODS {
            self.due = Instant::now();
        }
        self.due.saturating_duration_since(Instant::now())
    }

    /// Answers the received requests.
    fn answer<C: Control, const Q: usize, const M: usize>(
        &mut self,
        device: &mut Device<C, Q, M>,
        deframer: &mut Deframer,
        mut fresh: &[u8],
        mut send: impl FnMut(&[u8]) -> io::Result<()>,
    ) -> io::Result<()> {
        while let Some(request) = deframer.next::<Request>(&mut fresh) {
            // The host repeats a damaged request.
            let Ok(request) = request else { continue };
            let before = device.rate_hz();
            let reply = device.answer(&request);
            if device.rate_hz() != before {
                self.due = Instant::now();
            }
            send(encode(&reply, &mut [0; MAX_FRAME]).map_err(io::Error::other)?)?;
        }
        Ok(())
    }
}

/// Serves a device on `line`, on the clock of this computer, until `stop` returns true.
///
/// # Errors
/// If the connection is lost.
pub fn serve<C: Control, const Q: usize, const M: usize>(
    device: &mut Device<C, Q, M>,
    board: &mut impl Board,
    line: &mut impl Line,
    mut stop: impl FnMut() -> bool,
) -> io::Result<()> {
    let (mut deframer, mut bytes, mut pace) = (Deframer::new(), [0; 4096], Pace::new());
    while !stop() {
        let patience = pace.run_due_periods(device, board);
        let came = line.receive(&mut bytes, patience)?;
        pace.answer(device, &mut deframer, &bytes[..came], |frame| line.send(frame))?;
    }
    Ok(())
}

/// Message from the reader of a connection: number of the host, and the received bytes.
///
/// `None` instead of bytes is the end of the connection.
type Received = (usize, Option<Vec<u8>>);

/// A connected host.
struct Host {
    number: usize,
    stream: TcpStream,
    deframer: Deframer,
}

impl Drop for Host {
    fn drop(&mut self) {
        // Ends the reader thread.
        let _ = self.stream.shutdown(Shutdown::Both);
    }
}

impl Host {
    /// Starts a thread that reads from the connection.
    fn new<'s>(
        threads: &'s Scope<'s, '_>,
        number: usize,
        stream: TcpStream,
        heard: Sender<Received>,
    ) -> io::Result<Self> {
        stream.set_nonblocking(false)?;
        stream.set_nodelay(true)?;
        let mut reader = stream.try_clone()?;
        threads.spawn(move || {
            let mut bytes = [0; 4096];
            while let Ok(came @ 1..) = reader.read(&mut bytes) {
                if heard.send((number, Some(bytes[..came].to_vec()))).is_err() {
                    return;
                }
            }
            let _ = heard.send((number, None));
        });
        Ok(Self { number, stream, deframer: Deframer::new() })
    }
}

/// Serves a device to all hosts that connect to `listener`, until `stop` returns true.
///
/// As on a bus, one host may stop the run of another. The clock of the device, and with it the watchdog, also runs
/// without hosts.
///
/// # Errors
/// If the listener cannot be set to non-blocking mode.
pub fn serve_at<C: Control, const Q: usize, const M: usize>(
    listener: &TcpListener,
    device: &mut Device<C, Q, M>,
    board: &mut impl Board,
    mut stop: impl FnMut() -> bool,
) -> io::Result<()> {
    listener.set_nonblocking(true)?;
    let (heard, inbox): (Sender<Received>, Receiver<Received>) = channel();
    std::thread::scope(|threads| {
        let (mut hosts, mut next, mut pace) = (Vec::<Host>::new(), 0, Pace::new());
        while !stop() {
            let patience = pace.run_due_periods(device, board);
            if let Ok((stream, _)) = listener.accept()
                && hosts.len() < MAX_HOSTS
            {
                // A host that has already disconnected is ignored.
                hosts.extend(Host::new(threads, next, stream, heard.clone()));
                next += 1;
            }
            let (number, came) = match inbox.recv_timeout(patience) {
                Ok(heard) => heard,
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => continue,
            };
            let Some(at) = hosts.iter().position(|host| host.number == number) else { continue };
            let Host { stream, deframer, .. } = &mut hosts[at];
            let answered = match came {
                Some(bytes) => pace.answer(device, deframer, &bytes, |frame| stream.write_all(frame)),
                None => Err(io::ErrorKind::UnexpectedEof.into()),
            };
            if answered.is_err() {
                hosts.swap_remove(at);
            }
        }
        Ok(())
    })
}

/// The simulated plant as the amplifier and the sensors of a device.
#[derive(Debug)]
pub struct PlantBoard {
    plant: Plant,
    volts: f64,
    samples: Vec<Sample>,
    last: Shown,
}

impl PlantBoard {
    /// Starts the plant at `rate_hz`.
    ///
    /// # Errors
    /// If the plant cannot run at this rate.
    pub fn new(mut plant: Plant, rate_hz: f64) -> Result<Self, PlantError> {
        plant.start(rate_hz)?;
        let volts = plant.present_v();
        Ok(Self { plant, volts, samples: Vec::new(), last: Shown::default() })
    }

    /// Returns the identity of a device with this plant; `follows`: the device has a controller.
    pub fn identity(&self, rate_hz: f64, follows: bool) -> Identity {
        let can = self.plant.capabilities();
        let name = "simulated plant behind a line".bytes().take(MOST_NAME).collect();
        Identity {
            name,
            min_v: can.voltage.min_v as f32,
            max_v: can.voltage.max_v as f32,
            rest_v: can.voltage.rest_v as f32,
            max_slew_v_per_s: 1e5,
            min_rate_hz: rate_hz as f32,
            max_rate_hz: rate_hz as f32,
            output: Unit::Micrometre,
            temperature: can.temperature,
            load: can.load,
            follows,
            queue: 0,
            model: 0,
        }
    }
}

impl Board for PlantBoard {
    fn measure(&mut self) -> Shown {
        self.samples.clear();
        // An error of the plant becomes a sensor reading that is not a number, which stops the device.
        let played = self.plant.exchange(&[self.volts], &mut self.samples);
        self.last = match (played, self.samples.last()) {
            (Ok(_), Some(sample)) => Shown {
                output: sample.output as f32,
                temperature_degc: sample.temperature_degc.unwrap_or_default() as f32,
                load_n: sample.load_n.unwrap_or_default() as f32,
            },
            _ => Shown { output: f32::NAN, ..self.last },
        };
        self.last
    }

    fn put_out(&mut self, volts: f32) {
        self.volts = f64::from(volts);
    }
}
