//! A device that returns its drive, in the same program or at the other end of a line.

use std::convert::Infallible;

use hyst_hw::wire::{Board, Identity, Shown, Unit};
use hyst_hw::{Capabilities, Daq, OutputUnit, Sample, VoltageRange};

/// Device whose output is 0.2 times its drive, without delay.
#[derive(Debug)]
pub struct Echo {
    capabilities: Capabilities,
    rate_hz: f64,
    drive_v: f64,
    samples: u64,
}

impl Default for Echo {
    fn default() -> Self {
        let capabilities = Capabilities {
            device: "echo".to_owned(),
            voltage: VoltageRange { min_v: 0.0, max_v: 100.0, rest_v: 0.0 },
            max_slew_v_per_s: f64::INFINITY,
            min_rate_hz: 1.0,
            max_rate_hz: 1e6,
            max_block: 256,
            output: OutputUnit::Micrometre,
            temperature: true,
            load: true,
            queued: false,
        };
        Self { capabilities, rate_hz: 1.0, drive_v: 0.0, samples: 0 }
    }
}

impl Daq for Echo {
    type Error = Infallible;

    fn capabilities(&self) -> &Capabilities {
        &self.capabilities
    }
    fn present_v(&self) -> f64 {
        self.drive_v
    }
    fn start(&mut self, rate_hz: f64) -> Result<f64, Infallible> {
        self.rate_hz = rate_hz;
        Ok(rate_hz)
    }
    fn exchange(&mut self, drive_v: &[f64], measured: &mut Vec<Sample>) -> Result<usize, Infallible> {
        for volts in drive_v {
            self.samples += 1;
            let time_s = self.samples as f64 / self.rate_hz;
            let output = 0.2 * volts;
            measured.push(Sample {
                time_s,
                drive_v: *volts,
                output,
                temperature_degc: Some(22.0 + 0.01 * output),
                load_n: Some(0.1 * output),
                force_n: None,
            });
        }
        self.drive_v = drive_v.last().copied().unwrap_or(self.drive_v);
        Ok(drive_v.len())
    }
    fn rest(&mut self, _: f64) -> Result<(), Infallible> {
        self.drive_v = 0.0;
        Ok(())
    }
    fn stop(&mut self) -> Result<(), Infallible> {
        self.drive_v = 0.0;
        Ok(())
    }
}

/// The same device as a board.
#[derive(Debug, Default)]
pub struct EchoBoard {
    volts: f32,
}

impl Board for EchoBoard {
    fn measure(&mut self) -> Shown {
        Shown { output: 0.2 * self.volts, temperature_degc: 22.0, load_n: 0.02 * self.volts }
    }
    fn put_out(&mut self, volts: f32) {
        self.volts = volts;
    }
}

/// Returns the identity of a device with that board.
pub fn identity() -> Identity {
    Identity {
        name: b"echo".iter().copied().collect(),
        min_v: 0.0,
        max_v: 100.0,
        rest_v: 0.0,
        max_slew_v_per_s: 1e6,
        min_rate_hz: 1.0,
        // Faster than any line, so that the line limits the throughput of a run.
        max_rate_hz: 200e3,
        output: Unit::Micrometre,
        temperature: true,
        load: true,
        follows: false,
        queue: 0,
        model: 0,
    }
}
