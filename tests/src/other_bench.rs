//! A device with other physics: an actuator of [`other_physics`](crate::other_physics) with the interface of the
//! simulated plant.
//!
//! It shares only the interface with the crates: the delay interpolates, lag and mode are integrated in small steps,
//! creep is a sum of relaxations with other time constants than the models'.

use std::collections::VecDeque;
use std::convert::Infallible;

use hyst_hw::{Capabilities, Daq, OutputUnit, Sample, VoltageRange};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

use crate::other_physics::Law;

/// Properties of the device.
#[derive(Clone, Copy, Debug)]
pub struct Bench {
    /// Seed of the law's parameters and of the noise.
    pub seed: u64,
    /// Hysteresis law.
    pub law: Law,
    /// Sample rate \[Hz\].
    pub rate_hz: f64,
    /// Highest drive \[V\], from 0.
    pub volts: f64,
    /// Travel \[µm\].
    pub stroke_um: f64,
    /// Standard deviation of the sensor noise \[µm\].
    pub noise_um: f64,
    /// Delay \[s\].
    pub delay_s: f64,
    /// Time constant of the amplifier \[s\]; 0 for none.
    pub lag_s: f64,
    /// Creep from 10 ms to 100 s, as a share of the travel; 0 for none.
    pub creep: f64,
    /// Frequency \[Hz\] and damping of the mode, if any.
    pub mode: Option<(f64, f64)>,
}

/// Integration steps per sample.
const STEPS: u32 = 16;

/// The device.
pub struct OtherDevice {
    bench: Bench,
    capabilities: Capabilities,
    memory: Box<dyn FnMut(f64) -> f64 + Send>,
    /// Shares of the linear part and of the memory.
    shares: (f64, f64),
    rng: ChaCha8Rng,
    now: u64,
    drive_v: f64,
    /// Drives in the delay line, the newest last.
    delay_line: VecDeque<f64>,
    lagged: f64,
    creep: Vec<(f64, f64)>,
    mode: (f64, f64),
    at_rest_um: f64,
    ageing: Option<Ageing>,
}

/// A slow linear change of the device.
#[derive(Clone, Copy, Debug)]
pub struct Ageing {
    /// Duration \[s\].
    pub seconds: f64,
    /// Relative decrease of the gain.
    pub gain: f64,
    /// Relative increase of the loop width.
    pub loop_width: f64,
    /// First sample.
    start: u64,
}

impl OtherDevice {
    /// Creates a device at rest at 0 V.
    pub fn new(bench: Bench) -> Self {
        let mut law = ChaCha8Rng::seed_from_u64(bench.seed + 1);
        let mut memory = bench.law.memory(&mut law);
        let shares = (0.2 + 0.2 * law.random::<f64>(), 0.15 + 0.25 * law.random::<f64>());
        let at_rest_um = bench.stroke_um * (-shares.0 + shares.1 * memory(-1.0));
        let rest_v = 0.0;
        let capabilities = Capabilities {
            device: format!("{:?} {}", bench.law, bench.seed),
            voltage: VoltageRange { min_v: 0.0, max_v: bench.volts, rest_v },
            max_slew_v_per_s: f64::INFINITY,
            min_rate_hz: bench.rate_hz,
            max_rate_hz: bench.rate_hz,
            max_block: 4096,
            output: OutputUnit::Micrometre,
            temperature: false,
            load: false,
            queued: false,
        };
        let creep = (0..9).map(|i| (0.011 * f64::powf(3.3, f64::from(i)), 0.0)).collect();
        Self {
            rng: ChaCha8Rng::seed_from_u64(bench.seed ^ 0x9E37_79B9),
            bench,
            capabilities,
            memory,
            shares,
            now: 0,
            drive_v: rest_v,
            delay_line: VecDeque::new(),
            lagged: -1.0,
            creep,
            mode: (0.0, 0.0),
            at_rest_um,
            ageing: None,
        }
    }

    /// Starts ageing: within `seconds`, the gain falls by the share `gain` and the loop widens by the share
    /// `loop_width`.
    pub fn age(&mut self, seconds: f64, gain: f64, loop_width: f64) {
        self.ageing = Some(Ageing { seconds, gain, loop_width, start: self.now });
    }

    /// Returns the present shares of the linear part and the memory.
    fn shares_now(&self) -> (f64, f64) {
        let (linear, memory) = self.shares;
        self.ageing.map_or(self.shares, |ageing| {
            let done = ((self.now - ageing.start) as f64 / self.bench.rate_hz / ageing.seconds).min(1.0);
            let wider = memory * ageing.loop_width * done;
            let gain = 1.0 - ageing.gain * done;
            (gain * (linear - wider), gain * (memory + wider))
        })
    }

    /// Returns the properties of the device.
    pub fn bench(&self) -> Bench {
        self.bench
    }

    fn sample(&mut self, volts: f64) -> Sample {
        let Bench { rate_hz, lag_s, mode, creep, stroke_um, noise_um, delay_s, .. } = self.bench;
        let h = 1.0 / rate_hz / f64::from(STEPS);
        // A delay that is not a whole number of samples interpolates between two samples.
        let delay = delay_s * rate_hz;
        let depth = delay.ceil() as usize + 2;
        let before = 2.0 * self.drive_v / self.bench.volts - 1.0;
        if self.delay_line.is_empty() {
            self.delay_line.extend(std::iter::repeat_n(before, depth));
        }
        self.delay_line.push_back(2.0 * volts / self.bench.volts - 1.0);
        while self.delay_line.len() > depth {
            self.delay_line.pop_front();
        }
        let delayed = |back: f64| {
            let line = &self.delay_line;
            let at = (line.len() - 1) as f64 - back;
            let (low, part) = (at.floor().max(0.0) as usize, at.fract());
            line[low] * (1.0 - part) + line[(low + 1).min(line.len() - 1)] * part
        };
        let (from, to) = (delayed(delay + 1.0), delayed(delay));
        let shares = self.shares_now();
        let mut y = 0.0;
        for i in 1..=STEPS {
            let x = from + (to - from) * f64::from(i) / f64::from(STEPS);
            self.lagged = if lag_s > 0.0 { self.lagged + (x - self.lagged) * (h / lag_s) } else { x };
            let motion = stroke_um * (shares.0 * self.lagged + shares.1 * (self.memory)(self.lagged)) - self.at_rest_um;
            let mut slow = 0.0;
            for (tau, state) in &mut self.creep {
                *state += (motion - *state) * (h / *tau);
                slow += *state;
            }
            let with_creep = motion + creep * slow / 9.0;
            y = match mode {
                Some((hz, damping)) => {
                    let omega = std::f64::consts::TAU * hz;
                    self.mode.1 +=
                        h * (omega * omega * (with_creep - self.mode.0) - 2.0 * damping * omega * self.mode.1);
                    self.mode.0 += h * self.mode.1;
                    self.mode.0
                }
                None => with_creep,
            };
        }
        self.drive_v = volts;
        self.now += 1;
        let normal = (0..12).map(|_| self.rng.random::<f64>()).sum::<f64>() - 6.0;
        let output = y + noise_um * normal;
        Sample {
            time_s: self.now as f64 / rate_hz,
            drive_v: volts,
            output,
            temperature_degc: None,
            load_n: None,
            force_n: None,
        }
    }
}

impl Daq for OtherDevice {
    type Error = Infallible;

    fn capabilities(&self) -> &Capabilities {
        &self.capabilities
    }
    fn present_v(&self) -> f64 {
        self.drive_v
    }
    fn start(&mut self, _: f64) -> Result<f64, Infallible> {
        Ok(self.bench.rate_hz)
    }
    fn exchange(&mut self, drive_v: &[f64], measured: &mut Vec<Sample>) -> Result<usize, Infallible> {
        measured.extend(drive_v.iter().map(|u| self.sample(*u)).collect::<Vec<_>>());
        Ok(drive_v.len())
    }
    fn rest(&mut self, seconds: f64) -> Result<(), Infallible> {
        for _ in 0..(seconds * self.bench.rate_hz) as u64 {
            self.sample(0.0);
        }
        Ok(())
    }
    fn stop(&mut self) -> Result<(), Infallible> {
        self.drive_v = 0.0;
        Ok(())
    }
}
