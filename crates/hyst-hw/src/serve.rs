//! A device made of software, behind a line: for trying and testing what runs on hosts.

use std::io;
use std::net::TcpListener;
use std::time::{Duration, Instant};

use crate::daq::{Daq, Sample};
use crate::plant::Plant;
use crate::plant::error::PlantError;
use crate::remote::{Line, Tcp};
use crate::wire::{Board, Control, Deframer, Device, Identity, MAX_FRAME, MOST_NAME, Request, Shown, Unit, encode};

/// Periods that are made up for when this computer was late; more than that the device's clock loses.
const MOST_LATE: u32 = 1000;
/// Of them, those that are made up for before the line is heard again: a host would seem silent that was not.
const AT_ONCE: u32 = 20;

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
    let (mut deframer, mut bytes, mut frame) = (Deframer::new(), [0; 4096], [0; MAX_FRAME]);
    let mut due = Instant::now();
    while !stop() {
        let period = Duration::from_secs_f64(1.0 / f64::from(device.rate_hz().max(1.0)));
        let mut late = 0;
        while late < AT_ONCE && due <= Instant::now() {
            device.tick(board);
            due += period;
            late += 1;
        }
        if Instant::now().saturating_duration_since(due) > period * MOST_LATE {
            due = Instant::now();
        }
        let patience = due.saturating_duration_since(Instant::now());
        let came = line.receive(&mut bytes, patience)?;
        let mut fresh = &bytes[..came];
        while let Some(request) = deframer.next::<Request>(&mut fresh) {
            // What was changed on the way is asked again.
            let Ok(request) = request else { continue };
            let before = device.rate_hz();
            let reply = device.answer(&request);
            if device.rate_hz() != before {
                due = Instant::now();
            }
            let bytes = encode(&reply, &mut frame).map_err(io::Error::other)?;
            line.send(bytes)?;
        }
    }
    Ok(())
}

/// Serves a device to whoever comes to `listener`, one after the other, until `stop` says so. Between two of them its clock goes on, and with it
/// its watchdog.
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
    while !stop() {
        let mut host = None;
        serve(device, board, &mut Nobody, || {
            host = listener.accept().ok();
            host.is_some() || stop()
        })?;
        if let Some((stream, _)) = host {
            stream.set_nonblocking(false)?;
            // A host that is gone is no end.
            let _ = Tcp::over(stream).and_then(|mut line| serve(device, board, &mut line, &mut stop));
        }
    }
    Ok(())
}

/// A line without a host.
struct Nobody;

impl Line for Nobody {
    fn send(&mut self, _: &[u8]) -> io::Result<()> {
        Ok(())
    }

    fn receive(&mut self, _: &mut [u8], patience: Duration) -> io::Result<usize> {
        std::thread::sleep(patience);
        Ok(0)
    }
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
