//! A device made of software, behind a line: for trying and testing what runs on hosts.

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

/// Periods that are made up for when this computer was late; more than that the device's clock loses.
const MOST_LATE: u32 = 1000;
/// Of them, those that are made up for before the line is heard again: a host would seem silent that was not.
const AT_ONCE: u32 = 20;
/// Hosts at a time; another is hung up on.
const MOST_HOSTS: usize = 8;

/// The host's clock as the device's.
struct Pace {
    due: Instant,
}

impl Pace {
    fn new() -> Self {
        Self { due: Instant::now() }
    }

    /// Makes up for what has passed, and gives how long there is until the next period.
    fn follow<C: Control, const Q: usize, const M: usize>(
        &mut self,
        device: &mut Device<C, Q, M>,
        board: &mut impl Board,
    ) -> Duration {
        let period = Duration::from_secs_f64(1.0 / f64::from(device.rate_hz().max(1.0)));
        let mut late = 0;
        while late < AT_ONCE && self.due <= Instant::now() {
            device.tick(board);
            self.due += period;
            late += 1;
        }
        if Instant::now().saturating_duration_since(self.due) > period * MOST_LATE {
            self.due = Instant::now();
        }
        self.due.saturating_duration_since(Instant::now())
    }

    /// Answers what has come.
    fn answer<C: Control, const Q: usize, const M: usize>(
        &mut self,
        device: &mut Device<C, Q, M>,
        deframer: &mut Deframer,
        mut fresh: &[u8],
        mut send: impl FnMut(&[u8]) -> io::Result<()>,
    ) -> io::Result<()> {
        while let Some(request) = deframer.next::<Request>(&mut fresh) {
            // What was changed on the way is asked again.
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

/// Serves a device at `line` on the host's clock, until `stop` says so or the line is gone.
///
/// # Errors
/// When the line is gone.
pub fn serve<C: Control, const Q: usize, const M: usize>(
    device: &mut Device<C, Q, M>,
    board: &mut impl Board,
    line: &mut impl Line,
    mut stop: impl FnMut() -> bool,
) -> io::Result<()> {
    let (mut deframer, mut bytes, mut pace) = (Deframer::new(), [0; 4096], Pace::new());
    while !stop() {
        let patience = pace.follow(device, board);
        let came = line.receive(&mut bytes, patience)?;
        pace.answer(device, &mut deframer, &bytes[..came], |frame| line.send(frame))?;
    }
    Ok(())
}

/// What a host's socket has to say: its number, and what came, or nothing when it is gone.
type Heard = (usize, Option<Vec<u8>>);

/// A host at a socket.
struct Host {
    number: usize,
    stream: TcpStream,
    deframer: Deframer,
}

impl Drop for Host {
    fn drop(&mut self) {
        // Who reads from it hears the end.
        let _ = self.stream.shutdown(Shutdown::Both);
    }
}

impl Host {
    /// With a thread that reads from it.
    fn new<'s>(threads: &'s Scope<'s, '_>, number: usize, stream: TcpStream, heard: Sender<Heard>) -> io::Result<Self> {
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

/// Serves a device to all who come to `listener` until `stop` says so: as on a bus, one may stop what another has started. Its clock goes on
/// without any of them, and with it its watchdog.
///
/// # Errors
/// When the listener cannot be asked without waiting.
pub fn serve_at<C: Control, const Q: usize, const M: usize>(
    listener: &TcpListener,
    device: &mut Device<C, Q, M>,
    board: &mut impl Board,
    mut stop: impl FnMut() -> bool,
) -> io::Result<()> {
    listener.set_nonblocking(true)?;
    let (heard, inbox): (Sender<Heard>, Receiver<Heard>) = channel();
    std::thread::scope(|threads| {
        let (mut hosts, mut next, mut pace) = (Vec::<Host>::new(), 0, Pace::new());
        while !stop() {
            let patience = pace.follow(device, board);
            if let Ok((stream, _)) = listener.accept()
                && hosts.len() < MOST_HOSTS
            {
                // A host that is gone already is no end.
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

/// The simulated plant as amplifier and sensors.
#[derive(Debug)]
pub struct PlantBoard {
    plant: Plant,
    volts: f64,
    samples: Vec<Sample>,
    last: Shown,
}

impl PlantBoard {
    /// With the plant's clock at `rate_hz`.
    ///
    /// # Errors
    /// When the plant cannot run at that rate.
    pub fn new(mut plant: Plant, rate_hz: f64) -> Result<Self, PlantError> {
        plant.start(rate_hz)?;
        let volts = plant.present_v();
        Ok(Self { plant, volts, samples: Vec::new(), last: Shown::default() })
    }

    /// What a device with this plant says of itself; `follows`: that it has a controller.
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
        // What the plant cannot do shows as a sensor without a number: the device stops by itself.
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
