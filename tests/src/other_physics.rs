//! Actuators of seven hysteresis laws in typical experiments. Most of the laws are neither in the models nor in the
//! simulated plant.
//!
//! They share only the record type with the crates: the laws are differential equations or relays in small steps, creep
//! is a sum of relaxations with other time constants than the models', a mode is integrated, a delay interpolates.

mod law;

use hyst_ident::model::{Effect, Kind};
use hyst_ident::record::{Columns, OutputUnit, Record};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

pub use law::Law;

/// An actuator with its effects, and the kind of model that is fitted to it.
#[derive(Clone, Debug)]
pub struct Actuator {
    /// Seed of all random values.
    pub seed: u64,
    /// Hysteresis law.
    pub law: Law,
    /// Effects in the order of the chain.
    pub effects: Vec<Effect>,
    /// Kind of the fitted model.
    pub kind: Kind,
    /// Rows of a segment with one sine; a record has about four times as many.
    pub segment_rows: usize,
}

/// Effects that an actuator can have. The asymmetry is not one of them: it is a property of the law's loop.
const DRAWN: [Effect; 9] = [
    Effect::Delay,
    Effect::Lag,
    Effect::RateDependence,
    Effect::Temperature,
    Effect::Creep,
    Effect::Load,
    Effect::Resonance,
    Effect::Drift,
    Effect::Interference,
];

impl Actuator {
    /// Returns actuator `number` of a seed. About one in six has no effect, one in three has two.
    pub fn draw(seed: u64, number: u64) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(seed.wrapping_mul(1_000_003).wrapping_add(number));
        let law = Law::ALL[rng.random_range(0..Law::ALL.len())];
        let mut effects: Vec<Effect> = Vec::new();
        let count = [0, 1, 1, 1, 2, 2][rng.random_range(0..6)];
        while effects.len() < count {
            let effect = DRAWN[rng.random_range(0..DRAWN.len())];
            // A record cannot distinguish a delay and a lag that act together.
            let late = [Effect::Delay, Effect::Lag];
            let both_late = late.contains(&effect) && effects.iter().any(|e| late.contains(e));
            if !effects.contains(&effect) && !both_late {
                effects.push(effect);
            }
        }
        effects.sort();
        let kind = if rng.random::<f64>() < 0.5 { Kind::Pi } else { Kind::Preisach };
        Self { seed: seed.wrapping_mul(7919).wrapping_add(number), law, effects, kind, segment_rows: 3500 }
    }

    /// Returns the actuator without its effects.
    pub fn bare(&self) -> Self {
        Self { effects: Vec::new(), ..self.clone() }
    }

    /// Returns a record of the actuator. Experiment 0 is the training record; other numbers are other runs of the same
    /// kind of experiment.
    ///
    /// # Panics
    /// Never: the result is a valid record.
    pub fn record(&self, experiment: u64, name: &str) -> Record {
        // Properties of the device.
        let mut device_rng = ChaCha8Rng::seed_from_u64(self.seed);
        let mut draw = |low: f64, high: f64| low + (high - low) * device_rng.random::<f64>();
        let rate = [500.0, 1000.0, 2000.0, 5000.0][(4.0 * draw(0.0, 0.999)) as usize];
        let (volts, stroke) = (draw(60.0, 160.0), draw(5.0, 40.0));
        let (linear, memory, noise) = (draw(0.4, 0.8), draw(0.15, 0.4), stroke * 10f64.powf(draw(-3.6, -2.9)));
        let style = (4.0 * draw(0.0, 0.999)) as usize;
        let sizes: Vec<f64> = (0..40).map(|_| draw(0.0, 1.0)).collect();
        let size = |at: usize, low: f64, high: f64| low * f64::powf(high / low, sizes[at]);
        let has = |effect| self.effects.contains(&effect);
        // Properties of the experiment.
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed ^ (0x9E37_79B9 + experiment));
        let h = 1.0 / rate;
        let segments = drives(style, rate, self.segment_rows, &mut rng);
        let rows: usize = segments.iter().map(Vec::len).sum();
        let time: Vec<f64> = (0..rows).map(|k| k as f64 * h).collect();
        let swing = |rng: &mut ChaCha8Rng, size: f64| {
            let (a, b, c) = (rng.random::<f64>() * 6.3, 0.5 + rng.random::<f64>(), 2.0 + rng.random::<f64>());
            let whole = rows as f64 * h;
            let at = move |t: f64| size * ((b * 6.0 * t / whole + a).sin() + 0.5 * (c * 6.0 * t / whole).sin());
            time.iter().map(|t| at(*t)).collect::<Vec<f64>>()
        };
        let degc: Vec<f64> = swing(&mut rng, 4.0).iter().map(|t| 22.0 + t).collect();
        let newtons: Vec<f64> = swing(&mut rng, 20.0);
        let thermometer = has(Effect::Temperature) || sizes[30] < 0.2;
        let load_cell = has(Effect::Load) || sizes[31] < 0.2;

        let (mut input, mut output, mut labels) = (Vec::new(), Vec::new(), Vec::new());
        for (label, x) in (0_i64..).zip(&segments) {
            let first = output.len();
            // Input of the memory.
            let mut driven = x.clone();
            if has(Effect::Delay) {
                let late = size(0, 1.2, 6.0);
                driven = (0..x.len())
                    .map(|k| {
                        let at = (k as f64 - late).max(0.0);
                        let (k, part) = (at.floor() as usize, at.fract());
                        x[k] * (1.0 - part) + x[(k + 1).min(x.len() - 1)] * part
                    })
                    .collect();
            }
            if has(Effect::Lag) {
                // In small steps; the drive is linear between samples.
                const STEPS: u32 = 32;
                let samples = size(1, 1.5, 8.0);
                let (mut y, mut from) = (driven[0], driven[0]);
                driven.iter_mut().for_each(|u| {
                    for i in 0..STEPS {
                        let at = from + (*u - from) * (f64::from(i) + 0.5) / f64::from(STEPS);
                        y += (at - y) / (samples * f64::from(STEPS));
                    }
                    (from, *u) = (*u, y);
                });
            }
            if has(Effect::RateDependence) {
                // Domain walls with a viscous drag: a power law of their speed.
                let fastest = fastest(&segments, h);
                let (most, power) = (size(2, 0.03, 0.10), 0.25 + 0.75 * sizes[3]);
                let mut v = driven[0];
                driven.iter_mut().for_each(|u| {
                    for _ in 0..8 {
                        let gap = *u - v;
                        let speed = fastest * (gap.abs() / most).powf(1.0 / power);
                        v += (speed * h / 8.0).min(gap.abs()).copysign(gap);
                    }
                    *u = v;
                });
            }
            let mut law = ChaCha8Rng::seed_from_u64(self.seed + 1);
            let z = self.law.follow(&driven, &mut law);
            let mut y: Vec<f64> =
                driven.iter().zip(&z).map(|(x, z)| stroke * (linear * 0.5 * x + memory * z)).collect();
            let rest = y[0];
            y.iter_mut().for_each(|y| *y -= rest);
            if has(Effect::Temperature) {
                let per_k = size(4, 0.002, 0.01);
                y.iter_mut().enumerate().for_each(|(k, y)| *y *= 1.0 + per_k * (degc[first + k] - 22.0));
            }
            if has(Effect::Creep) {
                let whole = size(5, 0.01, 0.03);
                let taus: Vec<f64> = (0..9).map(|i| 0.013 * f64::powf(3.7, f64::from(i))).collect();
                let mut states = vec![y[0]; taus.len()];
                y.iter_mut().for_each(|y| {
                    let mut slow = 0.0;
                    for (state, tau) in states.iter_mut().zip(&taus) {
                        *state += (*y - *state) * (1.0 - (-h / tau).exp());
                        slow += *state;
                    }
                    *y += whole * 0.57 * slow;
                });
            }
            if has(Effect::Load) {
                let per_newton = stroke * size(6, 0.0005, 0.003);
                y.iter_mut().enumerate().for_each(|(k, y)| *y += per_newton * newtons[first + k]);
            }
            if has(Effect::Resonance) {
                let (hz, damping) = (rate * size(7, 0.03, 0.12), size(8, 0.01, 0.08));
                let (omega, mut at, mut speed, mut before) = (std::f64::consts::TAU * hz, y[0], 0.0, y[0]);
                const STEPS: u32 = 40;
                y.iter_mut().for_each(|y| {
                    for i in 1..=STEPS {
                        let u = before + (*y - before) * f64::from(i) / f64::from(STEPS);
                        speed += h / f64::from(STEPS) * (omega * omega * (u - at) - 2.0 * damping * omega * speed);
                        at += h / f64::from(STEPS) * speed;
                    }
                    before = *y;
                    *y = at;
                });
            }
            input.extend(x.iter().map(|x| 0.5 * volts * (x + 1.0)));
            output.extend(y);
            labels.extend(std::iter::repeat_n(label, x.len()));
        }
        let whole = rows as f64 * h;
        let (way, settles) = (stroke * size(9, 0.01, 0.05), sizes[10] < 0.5);
        let (hum, hz) = (stroke * size(11, 0.003, 0.01), if rate > 600.0 { 50.0 } else { 50.0 + 30.0 * sizes[12] });
        let mut slow = 0.0;
        for (y, t) in output.iter_mut().zip(&time) {
            if has(Effect::Drift) {
                *y += way * if settles { 1.0 - (-4.0 * t / whole).exp() } else { t / whole };
            }
            if has(Effect::Interference) {
                *y += hum * (std::f64::consts::TAU * hz * t + 1.0).sin();
            }
            // White noise and a little red noise.
            let mut normal = || (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
            slow += 0.02 * (0.1 * normal() - slow);
            *y += noise * (normal() + slow);
        }
        Record::from_samples(Columns {
            name: name.into(),
            segment: Some(labels),
            time,
            input: Some(input),
            output: Some((OutputUnit::Micrometre, output)),
            temperature: thermometer.then_some(degc),
            load: load_cell.then_some(newtons),
            ..Columns::default()
        })
        .expect("the result is a valid record")
    }
}

/// Returns the 98th percentile of the absolute slopes of some drives.
fn fastest(segments: &[Vec<f64>], h: f64) -> f64 {
    let slopes = segments.iter().flat_map(|s| s.windows(2)).map(|w| (w[1] - w[0]).abs() / h);
    let mut slopes: Vec<f64> = slopes.collect();
    slopes.sort_by(f64::total_cmp);
    slopes[(0.98 * slopes.len() as f64) as usize]
}

/// Returns segments of a drive between −1 and 1, each from −1, with about four times `rows` in total: sines of several
/// rates and amplitudes, triangles as of a scanner, stairs with a chirp, or a random walk with holds.
fn drives(style: usize, rate: f64, rows: usize, rng: &mut ChaCha8Rng) -> Vec<Vec<f64>> {
    let mut draw = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
    let wave = |share: f64, swing: f64, triangle: bool| {
        let hz = share * rate;
        let phase = |k: usize| (hz * k as f64 / rate).fract();
        let of = |phase: f64| match triangle {
            true => 2.0 * phase.min(1.0 - phase),
            false => 0.5 - 0.5 * (std::f64::consts::TAU * phase).cos(),
        };
        (0..rows).map(|k| -1.0 + 2.0 * swing * of(phase(k))).collect::<Vec<f64>>()
    };
    match style {
        0 | 1 => {
            let of = [(0.0006, 1.0), (0.002, 0.7), (0.01, 0.9), (0.03, 0.4)];
            of.into_iter()
                .map(|(share, swing)| wave(share * draw(0.8, 1.3), swing * draw(0.9, 1.0), style == 1))
                .collect()
        }
        2 => {
            let mut stairs = Vec::with_capacity(2 * rows);
            let mut at: f64 = -1.0;
            for step in 0..14 {
                stairs.extend(std::iter::repeat_n(at, 2 * rows / 14));
                at = if step == 0 { 1.0 } else { draw(-1.0, 1.0) };
            }
            let (mut phase, mut chirp) = (0.0, Vec::with_capacity(2 * rows));
            for k in 0..2 * rows {
                phase += 0.0006 * f64::powf(80.0, k as f64 / (2 * rows) as f64);
                chirp.push(-(std::f64::consts::TAU * phase).cos());
            }
            vec![wave(0.0006, 1.0, true), stairs, chirp]
        }
        _ => {
            let mut walk = Vec::with_capacity(3 * rows);
            let (mut at, mut to, mut step, mut held): (f64, f64, f64, usize) = (-1.0, 1.0, 0.002, 0);
            while walk.len() < 3 * rows {
                if held > 0 {
                    held -= 1;
                } else if (to - at).abs() < step {
                    at = to;
                    (to, step) = (draw(-1.0, 1.0), 10f64.powf(draw(-3.0, -1.3)));
                    held = if draw(0.0, 1.0) < 0.3 { 300 } else { 0 };
                } else {
                    at += step.copysign(to - at);
                }
                walk.push(at);
            }
            vec![wave(0.0006, 1.0, false), walk]
        }
    }
}
