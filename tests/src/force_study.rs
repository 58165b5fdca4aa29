//! LFDM, IFM and Bouc-Wen as models of the free displacement in a force observer, after Zhu et al. (sections 3.2, 4.2
//! and 4.3). The simulated actuator has random relays with viscous walls; a random force acts on its compliant end.

use std::f64::consts::TAU;
use std::ops::ControlFlow;

use hyst_core::{AffineFit, Env, ForceParams, Stage};
use hyst_hw::{Plant, PlantConfig};
use hyst_ident::compare::{Compared, Comparison, compare};
use hyst_ident::fit::FitOptions;
use hyst_ident::model::{Kind, Model};
use hyst_ident::record::{OutputUnit, Record};

use crate::{measured, viscous_relays};

/// Rows per second.
const RATE: f64 = 1000.0;
/// Mean travel \[µm/V\].
const GAIN: f64 = 0.065;
/// Stiffness against which the force acts \[N/µm\], as in the paper; the study estimates it from the record.
pub const STIFFNESS: f64 = 1.08;
/// The paper's three models.
pub const MODELS: [Kind; 3] = [Kind::Ifm, Kind::Lfdm, Kind::BoucWen];
/// Share of the force's deflection that the position loop compensates.
const LOOP_SHARE: f64 = 0.8;

/// Results of a force observer with one model of the free displacement.
#[derive(Clone, Debug)]
pub struct Observed {
    /// The model, with its errors on the identification and on the test record.
    pub model: Compared,
    /// κ and χ \[µm\] of `x ≈ κ x̂₀ + χ` without force.
    pub affine: (f64, f64),
    /// k_out \[N/µm\] from a least-squares fit to the calibration.
    pub stiffness: f64,
    /// RMS and largest force error after the calibration \[N\].
    pub force: (f64, f64),
}

/// Result of the study.
#[derive(Clone, Debug)]
pub struct ForceStudy {
    /// Models, sorted by RMSE on the test record.
    pub models: Vec<Observed>,
    /// Span of the test record \[µm\].
    pub span: f64,
    /// Largest force \[N\].
    pub force: f64,
}

fn actuator(seed: u64) -> PlantConfig {
    viscous_relays(seed, GAIN, [-2.0, 10.0], 0.002)
}

fn rows(seconds: f64, u: impl Fn(f64) -> f64) -> Vec<f64> {
    (0..(seconds * RATE) as usize).map(|k| u(k as f64 / RATE)).collect()
}

/// Returns a smooth rise from 0 to `to` in the first 0.1 s.
fn rise(t: f64, to: f64) -> f64 {
    to * (0.5 - 0.5 * (TAU * 5.0 * t.min(0.1)).cos())
}

/// Returns a sine whose amplitude varies nonlinearly \[V\].
fn identification(t: f64) -> f64 {
    let amplitude = 0.25 + 0.75 * (TAU * 0.2 * t).sin().powi(2);
    90.0 * amplitude * (0.5 - 0.5 * (TAU * 10.0 * t).cos())
}

/// Returns the sum of sines at the paper's five frequencies \[V\].
fn composition(t: f64) -> f64 {
    let tones = [(5.0, 14.0, 0.3), (10.0, 10.0, 1.9), (15.0, 8.0, 4.1), (20.0, 6.0, 2.6), (30.0, 4.0, 5.5)];
    let at = |t: f64| 48.0 + tones.iter().map(|(hz, a, p): &(f64, f64, f64)| a * (TAU * hz * t + p).sin()).sum::<f64>();
    if t < 0.1 { rise(t, at(0.0)) } else { at(t - 0.1) }
}

/// Returns a random force: tones up to 6 Hz with random phases \[N\], at most about 1.5 N.
fn random_force(seed: u64) -> impl Fn(f64) -> f64 {
    let mut state = seed;
    let tones: Vec<(f64, f64)> = (0..24)
        .map(|k| {
            // Knuth's linear congruential generator.
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (0.13 + 0.25 * f64::from(k), TAU * (state >> 11) as f64 / (1_u64 << 53) as f64)
        })
        .collect();
    move |t| 0.2 * tones.iter().map(|(hz, phase)| (TAU * hz * t + phase).sin()).sum::<f64>()
}

/// Runs the study on the actuator of a seed. The force acts after the first third of `seconds`; it is known in the
/// second third (calibration).
///
/// # Panics
/// If one of the steps fails.
pub fn run(seed: u64, seconds: f64, evaluations: Option<u64>) -> ForceStudy {
    let mut plant = Plant::new(actuator(seed)).expect("the actuator is valid");
    let mut record = |drive: &[f64], name: &str| measured(&mut plant, &[drive], RATE, OutputUnit::Micrometre, name);
    let train = record(&rows(seconds / 3.0, identification), "identification");
    let test = record(&rows(seconds / 3.0, composition), "composition");
    let options = FitOptions { seed, evaluations, ..FitOptions::default() };
    let comparison = compare(&train, Some(&test), &MODELS, &options, &mut |_| ControlFlow::Continue(()));
    let Comparison { models, skipped, .. } = comparison.expect("the records suit the models");
    assert!(skipped.is_empty(), "{skipped:?}");

    let force_at = random_force(seed);
    let force: Vec<f64> = rows(seconds, |t| if t < seconds / 3.0 { 0.0 } else { force_at(t) });
    // 3 ± 2 µm, plus the correction of the position loop.
    let working = |t: f64| rise(t, (3.0 - 2.0 * (TAU * t).cos()) / GAIN);
    let drive: Vec<f64> = force
        .iter()
        .zip(rows(seconds, working))
        .map(|(f, u)| (u - LOOP_SHARE * f / STIFFNESS / GAIN).clamp(0.0, 100.0))
        .collect();
    let free = record(&drive, "working");
    let loaded: Vec<f64> =
        free.output().unwrap_or_default().iter().zip(&force).map(|(x, f)| x + f / STIFFNESS).collect();
    let models = models.into_iter().map(|model| observe(model, &free, &loaded, &force)).collect();
    let output = test.output().unwrap_or_default();
    let span =
        output.iter().copied().fold(f64::NEG_INFINITY, f64::max) - output.iter().copied().fold(f64::INFINITY, f64::min);
    ForceStudy { models, span, force: force.iter().fold(0.0, |m, f| f64::max(m, f.abs())) }
}

/// Fits κ and χ to the first third and k_out to the second; computes the errors of the last third.
fn observe(model: Compared, free: &Record, loaded: &[f64], force: &[f64]) -> Observed {
    let third = loaded.len() / 3;
    let plain = ForceParams { stiffness: 1.0, kappa: 1.0, chi: 0.0 };
    // With unit stiffness the observer returns measured minus free displacement.
    let modelled: Vec<f64> =
        loaded.iter().zip(observed_force(&model.fit.model, free, loaded, &plain)).map(|(x, d)| x - d).collect();
    let mut affine = AffineFit::default();
    // Without the initial rise.
    for k in third / 10..third {
        affine.add(modelled[k], loaded[k]);
    }
    let (kappa, chi) = affine.solve().expect("the free displacement is not constant");
    let unit = observed_force(&model.fit.model, free, loaded, &ForceParams { stiffness: 1.0, kappa, chi });
    let known = third..2 * third;
    let cross: f64 = known.clone().map(|k| force[k] * unit[k]).sum();
    let squares: f64 = known.map(|k| unit[k] * unit[k]).sum();
    let stiffness = cross / squares;
    let estimated = observed_force(&model.fit.model, free, loaded, &ForceParams { stiffness, kappa, chi });
    let errors: Vec<f64> = (2 * third..loaded.len()).map(|k| estimated[k] - force[k]).collect();
    let rms = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64).sqrt();
    let largest = errors.iter().fold(0.0, |m, e| f64::max(m, e.abs()));
    Observed { model, affine: (kappa, chi), stiffness, force: (rms, largest) }
}

/// Returns the observer's force in each row \[N\].
fn observed_force(model: &Model, free: &Record, loaded: &[f64], params: &ForceParams) -> Vec<f64> {
    let chain = model.build(free.sample_period()).expect("the model is valid");
    let mut state = chain.state();
    let observer = params.observer(chain).expect("the stiffness is positive");
    let env = Env::default();
    let row = |(k, (u, x)): (usize, (&f64, &f64))| {
        if k == 0 { observer.reset(&mut state, &env, *u, *x) } else { observer.step(&mut state, &env, *u, *x) }
    };
    free.input().iter().zip(loaded).enumerate().map(row).collect()
}
