//! Prediction and feedforward with the classical and the dynamic Preisach model, after Chen et al. (force actuator,
//! Tables 2 and 3). The simulated actuator has another rate-dependence: relays with viscous walls.

use std::f64::consts::TAU;

use hyst_hw::{Plant, PlantConfig};
use hyst_ident::compensate::{CompensateOptions, compensate};
use hyst_ident::everett::{DpmReport, FodOptions, fit_dpm, fit_fod};
use hyst_ident::excite::{DecayingSine, Drive, Forc, Limits, Peak, Shape, Triangle};
use hyst_ident::fit::{FitOptions, fit};
use hyst_ident::metrics::Errors;
use hyst_ident::model::{Kind, Model};
use hyst_ident::record::{Columns, OutputUnit, Record};
use hyst_ident::simulate::{Zero, simulate};

use crate::{measured, viscous_relays};

/// Rows per second.
const RATE: f64 = 10_000.0;
/// Slope of the linear relation that the feedforward must produce \[N/V\].
const GAIN: f64 = 0.18;
/// Frequencies of the calibration \[Hz\]. Swings up to 80 V at mean rates up to 20 V/ms cover the waveforms.
const CALIBRATION: [f64; 7] = [10.0, 20.0, 35.0, 55.0, 75.0, 100.0, 125.0];

/// Errors on one waveform \[N\].
#[derive(Clone, Debug)]
pub struct Row {
    /// The waveform.
    pub name: &'static str,
    /// RMSE of the prediction: classical model from slow curves, classical model fitted to all rates, dynamic model.
    pub predicted: [f64; 3],
    /// RMSE of tracking: without compensation, classical inverse, dynamic inverse.
    pub tracked: [f64; 3],
}

/// Result of the study.
#[derive(Clone, Debug)]
pub struct DpmStudy {
    /// Report of the fit.
    pub report: DpmReport,
    /// The four waveforms.
    pub rows: Vec<Row>,
}

/// Returns an actuator with 0.18 N/V at low rates. A relay switches after 5 mV·s of overdrive: the error of the
/// classical model is then about that of the paper's Table 2.
fn actuator(seed: u64) -> PlantConfig {
    viscous_relays(seed, GAIN, [-10.0, 30.0], 0.005)
}

/// Returns waveforms as in the paper \[V\], from rest at 0 V and between 0 and 80 V.
fn waveforms() -> [(&'static str, Vec<f64>); 4] {
    let rows = |seconds: f64, u: &dyn Fn(f64) -> f64| -> Vec<f64> {
        let lead = 0.02;
        // Each waveform starts at rest and rises to its first value in 20 ms.
        let first = u(0.0);
        (0..=((seconds + lead) * RATE) as usize)
            .map(|k| {
                let t = k as f64 / RATE;
                if t < lead { first * (0.5 - 0.5 * (0.5 * TAU * t / lead).cos()) } else { u(t - lead) }
            })
            .collect()
    };
    // Frequency and amplitude decrease: f (1 − t / 2T), e^(−t/T).
    let decaying =
        |hz: f64| rows(0.1, &|t| 40.0 + 38.0 * (-t / 0.1).exp() * (TAU * hz * (t - 0.25 * t * t / 0.1)).sin());
    let simple = rows(0.12, &|t| 40.0 + 22.0 * (TAU * 25.0 * t).sin() + 14.0 * (TAU * 58.0 * t + 0.9).sin());
    let complex = rows(0.12, &|t| {
        let tones = [(23.0, 13.0, 0.3), (41.0, 12.0, 2.1), (67.0, 9.0, 4.0), (98.0, 5.0, 1.2)];
        40.0 + tones.iter().map(|(hz, a, p)| a * (TAU * hz * t + p).sin()).sum::<f64>()
    });
    [
        ("75 Hz variable frequency sine", decaying(75.0)),
        ("50 Hz variable frequency sine", decaying(50.0)),
        ("simple arbitrary waveform", simple),
        ("complex arbitrary waveform", complex),
    ]
}

fn played(plant: &mut Plant, shapes: &[Shape], name: &str) -> Record {
    let limits = Limits { rate_hz: RATE, lo_v: 0.0, hi_v: 90.0, slew_v_per_s: None };
    let drive = Drive::new(shapes, &limits, 1.0).expect("the shapes are valid");
    crate::played(plant, &drive, RATE, OutputUnit::Newton, name)
}

/// Runs the study on the actuator of a seed.
///
/// # Panics
/// If one of the steps fails.
pub fn run(seed: u64) -> DpmStudy {
    let mut plant = Plant::new(actuator(seed)).expect("the actuator is valid");
    let curves = Shape::Forc(Forc { curves: 18, peak_s: 0.5, rest_s: 0.02, peak: Peak::HalfSine });
    let slow = played(&mut plant, &[curves], "slow");
    let calibration: Vec<Shape> = CALIBRATION
        .iter()
        .flat_map(|hz| {
            let cycles = 2;
            [
                Shape::DecayingSine(DecayingSine { frequency_hz: *hz, duration_s: f64::max(0.2, 4.0 / hz) }),
                Shape::Triangle(Triangle { frequency_hz: *hz, cycles }),
            ]
        })
        .collect();
    let calibration = played(&mut plant, &calibration, "calibration");

    let reason = "the records suit the model";
    let classical = fit_fod(&slow, &FodOptions::default()).expect(reason).model;
    let all = Record::join(vec![slow, calibration]).expect("the records are alike");
    let overall = fit(&all, Kind::Preisach, &FitOptions::default()).expect(reason);
    let dynamic = fit_dpm(&all, &FitOptions::default()).expect(reason);

    let rows = waveforms()
        .into_iter()
        .map(|(name, drive)| {
            let test = measured(&mut plant, &[&drive], RATE, OutputUnit::Newton, name);
            let predicted = [&classical, &overall, &dynamic.model].map(|model| {
                let errors = simulate(model, &test, Zero::None).expect(reason).errors;
                errors.map_or(f64::NAN, |e| e.rmse_all_rows)
            });
            let wanted: Vec<f64> = drive.iter().map(|u| GAIN * u).collect();
            let mut tracked = |drive: &[f64]| {
                let run = measured(&mut plant, &[drive], RATE, OutputUnit::Newton, name);
                let force = run.output().unwrap_or_default();
                Errors::of(&wanted, force, &vec![false; wanted.len()]).map_or(f64::NAN, |e| e.rmse)
            };
            let tracked = [
                tracked(&drive),
                tracked(&compensated(&classical, &wanted)),
                tracked(&compensated(&dynamic.model, &wanted)),
            ];
            Row { name, predicted, tracked }
        })
        .collect();
    DpmStudy { report: dynamic.report, rows }
}

fn compensated(model: &Model, wanted: &[f64]) -> Vec<f64> {
    let reference = Record::from_samples(Columns {
        name: "reference".into(),
        time: (0..wanted.len()).map(|k| k as f64 / RATE).collect(),
        output: Some((OutputUnit::Newton, wanted.iter().map(|y| y + model.zero).collect())),
        ..Columns::default()
    })
    .expect("the reference is valid");
    let options = CompensateOptions { voltage: Some((0.0, 100.0)), ..CompensateOptions::default() };
    compensate(model, &reference, &options).expect("the model has an inverse").voltage
}
