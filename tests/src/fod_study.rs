//! Triangular against half-sine first-order descent curves on an actuator in a structure that rings, as Schirrer et al. did it
//! on a steel truss (Figures 9 to 13), with a simulated actuator of random relays.

use std::f64::consts::TAU;

use hyst_hw::{Actuator, Bed, Mode, Plant, PlantConfig, Sensor};
use hyst_ident::compensate::{CompensateOptions, compensate};
use hyst_ident::everett::{FodOptions, FodReport, Surface, fit_fod};
use hyst_ident::excite::{Drive, Forc, Limits, Peak, Shape};
use hyst_ident::model::Model;
use hyst_ident::record::{Columns, OutputUnit, Record};

use crate::measured;

/// Rows per second, as in the paper.
const RATE: f64 = 1000.0;
/// The reference \[Hz\], half the first mode.
const REFERENCE_HZ: f64 = 10.0;
/// Heights of peaks, as in the paper.
const CURVES: u32 = 50;
/// Durations of peaks \[s\]; the middle one is the one that is played alone.
const DURATIONS: [f64; 5] = [0.8, 0.9, 1.0, 1.15, 1.3];
/// Rest after each peak \[s\].
const REST: f64 = 0.6;

/// A surface from one way of measuring it.
#[derive(Debug)]
pub struct Identified {
    /// Which way.
    pub name: &'static str,
    /// What was found.
    pub report: FodReport,
    /// The surface as measured.
    pub surface: Surface,
    /// The model of it.
    pub model: Model,
}

/// One run of the reference on the actuator, a period of the steady state.
#[derive(Debug)]
pub struct Tracking {
    /// Which drive.
    pub name: &'static str,
    /// Force, corrected for the structure's phase and gain \[N\].
    pub force: Vec<f64>,
    /// RMS of force minus reference \[% of the reference's swing\].
    pub rmse_percent: f64,
}

/// What the study found.
#[derive(Debug)]
pub struct FodStudy {
    /// The structure's phase at the reference's frequency \[°\].
    pub phase_deg: f64,
    /// Triangular peaks of one duration and of several, half-sine peaks likewise.
    pub surfaces: Vec<Identified>,
    /// A period of the reference \[N\].
    pub reference: Vec<f64>,
    /// Without compensation, then with the inverse of each surface.
    pub tracking: Vec<Tracking>,
}

/// The paper's kind of actuator: 100 to 900 V, 4 kN, in a structure whose first mode is at 20 Hz.
fn actuator(seed: u64) -> PlantConfig {
    let actuator = Actuator {
        min_v: 100.0,
        max_v: 900.0,
        rest_v: 100.0,
        gain_um_per_v: 5.0,
        loop_share: 0.13,
        bed: Bed::Relays,
        relays: 15_000,
    };
    let sensor =
        Sensor { range_um: [-4000.0, 10_000.0], bits: 16, noise_um: 1.0, offset_um: 20.0, max_rate_hz: 20_000.0 };
    PlantConfig {
        modes: vec![Mode { hz: 20.0, damping: 0.06, gain: 0.8 }, Mode { hz: 71.0, damping: 0.03, gain: 0.1 }],
        ..PlantConfig::bare(seed, actuator, sensor)
    }
}

/// Phase of the structure at a frequency \[rad\].
fn phase(modes: &[Mode], hz: f64) -> f64 {
    let direct = 1.0 - modes.iter().map(|m| m.gain).sum::<f64>();
    let (re, im) = modes.iter().fold((direct, 0.0), |(re, im), m| {
        let r = hz / m.hz;
        let (a, b) = (1.0 - r * r, 2.0 * m.damping * r);
        let d = a * a + b * b;
        (re + m.gain * a / d, im - m.gain * b / d)
    });
    im.atan2(re)
}

fn fod(plant: &mut Plant, peak: Peak, durations: &[f64]) -> Record {
    let limits = Limits { rate_hz: RATE, lo_v: 100.0, hi_v: 900.0, slew_v_per_s: None };
    let shape = |peak_s: &f64| Shape::Forc(Forc { curves: CURVES, peak_s: *peak_s, rest_s: REST, peak });
    let shapes: Vec<Shape> = durations.iter().map(shape).collect();
    let drive = Drive::new(&shapes, &limits, REST).expect("the peaks are sound");
    crate::played(plant, &drive, RATE, OutputUnit::Newton, "fod")
}

/// Runs the study on the actuator of a seed.
///
/// # Panics
/// When a part of it refuses what the study gives it.
pub fn run(seed: u64) -> FodStudy {
    let config = actuator(seed);
    let angle = phase(&config.modes, REFERENCE_HZ);
    let mut plant = Plant::new(config).expect("the actuator is sound");
    let ways = [
        ("triangle, one duration", Peak::Triangle, &DURATIONS[2..3]),
        ("triangle, five durations", Peak::Triangle, &DURATIONS[..]),
        ("half-sine, one duration", Peak::HalfSine, &DURATIONS[2..3]),
        ("half-sine, five durations", Peak::HalfSine, &DURATIONS[..]),
    ];
    let surfaces: Vec<Identified> = ways
        .into_iter()
        .map(|(name, peak, durations)| {
            let fit = fit_fod(&fod(&mut plant, peak, durations), &FodOptions::default()).expect("a surface is there");
            Identified { name, report: fit.report, surface: fit.surface, model: fit.model }
        })
        .collect();

    // A sine over four fifths of the force, above what is left of it at the lowest voltage after a peak; its last periods are
    // steady.
    let span = surfaces[3].surface.value(CURVES as usize, 0);
    let period = (RATE / REFERENCE_HZ) as usize;
    let at = |k: usize| span * (0.55 - 0.4 * (TAU * k as f64 / period as f64).cos());
    let wanted: Vec<f64> = (0..14 * period).map(at).collect();
    let plain: Vec<f64> = wanted.iter().map(|y| 100.0 + 800.0 * y / span).collect();
    let mut drives = vec![("none", plain)];
    for s in &surfaces {
        let reference = Record::from_samples(Columns {
            name: "reference".into(),
            time: (0..wanted.len()).map(|k| k as f64 / RATE).collect(),
            output: Some((OutputUnit::Newton, wanted.iter().map(|y| y + s.model.zero).collect())),
            ..Columns::default()
        });
        let drive = compensate(&s.model, &reference.expect("the reference is sound"), &CompensateOptions::default());
        drives.push((s.name, drive.expect("the surface has an inverse").voltage));
    }
    let reference: Vec<f64> = (0..period).map(at).collect();
    let tracking = drives
        .into_iter()
        .map(|(name, drive)| {
            let run = measured(&mut plant, &[&drive], RATE, OutputUnit::Newton, "run");
            let force = corrected(run.output().unwrap_or_default(), &reference, angle);
            let squares: f64 = force.iter().zip(&reference).map(|(f, r)| (f - r) * (f - r)).sum();
            Tracking { name, rmse_percent: 100.0 * (squares / period as f64).sqrt() / (0.8 * span), force }
        })
        .collect();
    FodStudy { phase_deg: angle.to_degrees(), surfaces, reference, tracking }
}

/// The mean of the last periods, moved by the structure's phase and fitted to the reference in mean and gain.
fn corrected(force: &[f64], reference: &[f64], angle: f64) -> Vec<f64> {
    let period = reference.len();
    let steady = &force[force.len() - 6 * period..];
    let mean: Vec<f64> = (0..period).map(|k| (0..6).map(|p| steady[p * period + k]).sum::<f64>() / 6.0).collect();
    // The force lags: what belongs to row k came later by the phase.
    let late = -angle / TAU * period as f64;
    let moved: Vec<f64> = (0..period)
        .map(|k| {
            let x = k as f64 + late;
            let (whole, part) = (x.floor(), x - x.floor());
            let at = |i: f64| mean[(i as usize) % period];
            at(whole) + part * (at(whole + 1.0) - at(whole))
        })
        .collect();
    let average = |y: &[f64]| y.iter().sum::<f64>() / period as f64;
    let (my, mr) = (average(&moved), average(reference));
    let together: f64 = moved.iter().zip(reference).map(|(y, r)| (y - my) * (r - mr)).sum();
    let own: f64 = reference.iter().map(|r| (r - mr) * (r - mr)).sum();
    moved.iter().map(|y| mr + (y - my) * own / together).collect()
}
