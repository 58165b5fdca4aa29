//! Triangular and half-sine first-order descent curves on an actuator in a resonant structure, after Schirrer et al.
//! (steel truss, Figures 9 to 13), with a simulated actuator of random relays.

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
/// Frequency of the reference \[Hz\], half that of the first mode.
const REFERENCE_HZ: f64 = 10.0;
/// Number of peak heights, as in the paper.
const CURVES: u32 = 50;
/// Durations of peaks \[s\]; the middle one is also used alone.
const DURATIONS: [f64; 5] = [0.8, 0.9, 1.0, 1.15, 1.3];
/// Rest after each peak \[s\].
const REST: f64 = 0.6;

/// A surface from one kind of measurement.
#[derive(Debug)]
pub struct Identified {
    /// Kind of measurement.
    pub name: &'static str,
    /// Report of the fit.
    pub report: FodReport,
    /// Measured surface.
    pub surface: Surface,
    /// Model with this surface.
    pub model: Model,
}

/// One period of the steady state of a run with the reference.
#[derive(Debug)]
pub struct Tracking {
    /// Kind of drive.
    pub name: &'static str,
    /// Force, corrected for the phase and gain of the structure \[N\].
    pub force: Vec<f64>,
    /// RMS of force minus reference \[% of the reference's swing\].
    pub rmse_percent: f64,
}

/// Result of the study.
#[derive(Debug)]
pub struct FodStudy {
    /// Phase of the structure at the frequency of the reference \[°\].
    pub phase_deg: f64,
    /// Surfaces from triangular peaks of one and of several durations, and from half-sine peaks of one and of several.
    pub surfaces: Vec<Identified>,
    /// One period of the reference \[N\].
    pub reference: Vec<f64>,
    /// Tracking without compensation, then with the inverse of each surface.
    pub tracking: Vec<Tracking>,
}

/// Returns an actuator as in the paper: 100 to 900 V, 4 kN, in a structure whose first mode is at 20 Hz.
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

/// Returns the phase of the structure at a frequency \[rad\].
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
    let drive = Drive::new(&shapes, &limits, REST).expect("the peaks are valid");
    crate::played(plant, &drive, RATE, OutputUnit::Newton, "fod")
}

/// Runs the study on the actuator of a seed.
///
/// # Panics
/// If one of the steps fails.
pub fn run(seed: u64) -> FodStudy {
    let config = actuator(seed);
    let angle = phase(&config.modes, REFERENCE_HZ);
    let mut plant = Plant::new(config).expect("the actuator is valid");
    let measurements = [
        ("triangle, one duration", Peak::Triangle, &DURATIONS[2..3]),
        ("triangle, five durations", Peak::Triangle, &DURATIONS[..]),
        ("half-sine, one duration", Peak::HalfSine, &DURATIONS[2..3]),
        ("half-sine, five durations", Peak::HalfSine, &DURATIONS[..]),
    ];
    let surfaces: Vec<Identified> = measurements
        .into_iter()
        .map(|(name, peak, durations)| {
            let fit = fit_fod(&fod(&mut plant, peak, durations), &FodOptions::default()).expect("a surface");
            Identified { name, report: fit.report, surface: fit.surface, model: fit.model }
        })
        .collect();

    // A sine over 80 % of the force, above the remanent force at the lowest voltage after a peak. Its last periods are
    // in steady state.
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
        let drive = compensate(&s.model, &reference.expect("the reference is valid"), &CompensateOptions::default());
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

/// Returns the mean of the last periods, shifted by the phase of the structure and scaled to the reference in mean and
/// gain.
fn corrected(force: &[f64], reference: &[f64], angle: f64) -> Vec<f64> {
    let period = reference.len();
    let steady = &force[force.len() - 6 * period..];
    let mean: Vec<f64> = (0..period).map(|k| (0..6).map(|p| steady[p * period + k]).sum::<f64>() / 6.0).collect();
    // The force lags: the value of row k arrives later by the phase.
    let lag = -angle / TAU * period as f64;
    let shifted: Vec<f64> = (0..period)
        .map(|k| {
            let x = k as f64 + lag;
            let (whole, part) = (x.floor(), x - x.floor());
            let at = |i: f64| mean[(i as usize) % period];
            at(whole) + part * (at(whole + 1.0) - at(whole))
        })
        .collect();
    let average = |y: &[f64]| y.iter().sum::<f64>() / period as f64;
    let (my, mr) = (average(&shifted), average(reference));
    let cross: f64 = shifted.iter().zip(reference).map(|(y, r)| (y - my) * (r - mr)).sum();
    let squares: f64 = reference.iter().map(|r| (r - mr) * (r - mr)).sum();
    shifted.iter().map(|y| mr + (y - my) * squares / cross).collect()
}
