//! Tests of the inverse chain: the compensator drives the chain that it was built from.

use super::*;
use crate::{
    Activation, ActivationKind, ActivationParams, AntiCausal, AsymmetryParams, BoucWen, BoucWenParams, CreepParams,
    LagParams, LoadParams, Pi, ResonanceParams, SaturationParams, TemperatureParams,
};
use std::boxed::Box;
use std::vec::Vec;

const PERIOD: Sampling = Sampling { period: 1e-3 };
type Plain = Chain<f64, Pi<f64, 4>, 64, 4>;

fn pi() -> Pi<f64, 4> {
    Pi::new(0.1, &[5.0, 12.0, 25.0, 40.0], &[0.02, 0.02, 0.01, 0.01]).unwrap()
}

fn env(k: usize) -> Env<f64> {
    let t = 1e-3 * k as f64;
    Env { time: t, temperature: 23.0 + 5.0 * libm::sin(0.7 * t), load: 10.0 * libm::sin(1.3 * t) }
}

type Inverse<I> = Compensator<f64, I, 64, 4, 511>;

/// Returns the maximum |output − reference| of a chain driven by its own compensator, and the stated error.
fn worst(chain: &Plain, reference: impl Fn(usize) -> f64, rows: usize) -> (f64, f64) {
    let inverse: Box<Inverse<_>> = Box::new(chain.compensator(&PERIOD, &CompensatorOptions::default()).unwrap());
    (max_error(chain, &inverse, reference, rows), inverse.error())
}

/// Returns the maximum |output − reference| of a chain driven by a compensator, both from rest.
fn max_error<H: Stage<f64>, I: Stage<f64>>(
    chain: &Chain<f64, H, 64, 4>,
    inverse: &Inverse<I>,
    reference: impl Fn(usize) -> f64,
    rows: usize,
) -> f64 {
    let (mut s, mut i) = (chain.state(), inverse.state());
    let lead = inverse.lead();
    let at = |k: usize| reference(k.min(rows - 1));
    let mut drive = Vec::new();
    let first = inverse.reset(&mut i, &env(0), at(0));
    if lead == 0 {
        drive.push(first);
    }
    for k in 1..rows + lead {
        let u = inverse.step(&mut i, &env(k), at(k));
        if k >= lead {
            drive.push(u);
        }
    }
    let mut worst = 0.0f64;
    for (k, u) in drive.iter().enumerate() {
        let y = if k == 0 { chain.reset(&mut s, &env(k), *u) } else { chain.step(&mut s, &env(k), *u) };
        // The last value of the reference is held for the preview; the error there is not checked.
        if k + lead < rows {
            worst = worst.max((y - at(k)).abs());
        }
    }
    worst
}

fn smooth(k: usize) -> f64 {
    let t = 1e-3 * k as f64;
    3.0 * (1.0 - libm::cos(6.0 * t)) + 1.0 * (1.0 - libm::cos(41.0 * t))
}

/// The error of a step is at most the weights of the widening times the second difference of the drive.
#[test]
fn the_error_of_an_inverted_widening_is_the_second_difference_of_the_drive() {
    let widening = crate::WideningParams {
        growth: 0.3,
        exponent: 0.4,
        reference_rate: 300.0,
        seconds: 4e-3,
        thresholds: [5.0, 12.0, 25.0],
        weights: [0.02, 0.02, 0.01],
    };
    for falls in [false, true] {
        let chain = Plain::new(pi()).with_widening(&widening, &PERIOD).unwrap().with_falling(falls);
        let inverse: Box<Inverse<_>> = Box::new(chain.compensator(&PERIOD, &CompensatorOptions::default()).unwrap());
        let (mut s, mut i) = (chain.state(), inverse.state());
        let reference = |k: usize| signed(falls, smooth(k));
        let first = inverse.reset(&mut i, &env(0), reference(0));
        chain.reset(&mut s, &env(0), first);
        let (mut last, mut before, mut widest) = (first, first, 0.0f64);
        for k in 1..4000 {
            widest = widest.max(chain.widening.unwrap().at(&s.widening, last).abs());
            let u = inverse.step(&mut i, &env(k), reference(k));
            let error = (chain.step(&mut s, &env(k), u) - reference(k)).abs();
            let bound = widening.weights.iter().sum::<f64>() * (u - 2.0 * last + before).abs();
            assert!(error <= bound + 1e-12, "row {k}: {error} {bound}");
            (before, last) = (last, u);
        }
        // The widening was large enough for a test.
        assert!(widest > 0.2 * widening.extra_half_width(), "{widest}");
    }
}

/// The gain beside the hysteresis acts on the drive that is sought; the error is the second difference of the drive
/// times that gain.
#[test]
fn a_loop_width_that_changes_with_temperature_is_inverted_within_the_bound() {
    let p = TemperatureParams { per_kelvin: 0.02, reference_degc: 20.0, expansion: 0.1, direct: -2e-3, seconds: 2.0 };
    for falls in [false, true] {
        let chain = Plain::new(pi()).with_temperature(&p, &PERIOD).unwrap().with_falling(falls);
        let inverse: Box<Inverse<_>> = Box::new(chain.compensator(&PERIOD, &CompensatorOptions::default()).unwrap());
        let (mut s, mut i) = (chain.state(), inverse.state());
        let reference = |k: usize| signed(falls, smooth(k));
        let first = inverse.reset(&mut i, &env(0), reference(0));
        let start = chain.reset(&mut s, &env(0), first);
        assert!((start - reference(0)).abs() < 1e-9, "{start}");
        let (mut last, mut before, mut largest) = (first, first, 0.0f64);
        for k in 1..4000 {
            let u = inverse.step(&mut i, &env(k), reference(k));
            let error = (chain.step(&mut s, &env(k), u) - reference(k)).abs();
            let beside = chain.temperature.unwrap().direct(&s.thermal).abs();
            assert!(error <= beside * (u - 2.0 * last + before).abs() + 1e-9, "row {k}: {error}");
            (before, last, largest) = (last, u, largest.max(beside * u.abs()));
        }
        assert!(largest > 0.1, "{largest}");
    }
}

/// In the cold the loop is narrower by most of its width, so the gain beside the hysteresis is larger than that of the
/// hysteresis. The drive must not oscillate.
#[test]
fn a_large_change_of_the_loop_width_is_inverted_without_oscillation() {
    let p = TemperatureParams { per_kelvin: 0.08, reference_degc: 30.0, direct: -0.0128, ..Default::default() };
    let chain = Plain::new(pi()).with_temperature(&p, &PERIOD).unwrap();
    let inverse: Box<Inverse<_>> = Box::new(chain.compensator(&PERIOD, &CompensatorOptions::default()).unwrap());
    for kelvin in [-10.0, -5.0, 10.0] {
        let e = Env { temperature: 30.0 + kelvin, ..Env::default() };
        let (mut s, mut i) = (chain.state(), inverse.state());
        let first = inverse.reset(&mut i, &e, smooth(0));
        let start = chain.reset(&mut s, &e, first);
        assert!((start - smooth(0)).abs() < 1e-6, "{kelvin} K: {start}");
        let mut worst = 0.0f64;
        for k in 1..4000 {
            let u = inverse.step(&mut i, &e, smooth(k));
            let error = (chain.step(&mut s, &e, u) - smooth(k)).abs();
            worst = worst.max(error);
        }
        // 0.1 % of the span of the reference.
        assert!(worst < 8e-3, "{kelvin} K: {worst}");
    }
}

#[test]
fn static_stages_and_creep_are_inverted_exactly() {
    let temperature =
        TemperatureParams { per_kelvin: 0.006, reference_degc: 23.0, expansion: 0.1, direct: 0.0, seconds: 2.0 };
    let chain = Plain::new(pi())
        .with_zero(4.0)
        .with_temperature(&temperature, &PERIOD)
        .and_then(|c| c.with_creep(&CreepParams { seconds: &[0.05, 0.5, 5.0], shares: &[0.02, 0.02, 0.02] }, &PERIOD))
        .and_then(|c| c.with_asymmetry(&AsymmetryParams::behind([2.0, -0.5], [0.2, -0.1])))
        .and_then(|c| c.with_asymmetry(&AsymmetryParams::before([15.0, 45.0], [0.3, -0.2])))
        .and_then(|c| c.with_load(&LoadParams { per_newton: 0.05, gain_per_newton: 0.01 }))
        .and_then(|c| c.with_saturation(&SaturationParams::behind(-4.0, 10.0, 0.3)))
        .and_then(|c| c.with_saturation(&SaturationParams::before(-200.0, 200.0, 0.5)))
        .unwrap();
    let (rising, stated) = worst(&chain, |k| 4.0 + smooth(k), 4000);
    assert!(rising < 1e-11 && stated == 0.0, "{rising}");
    let (falling, _) = worst(&chain.with_falling(true), |k| 4.0 - 0.4 * smooth(k), 4000);
    assert!(falling < 1e-11, "{falling}");
}

#[test]
fn the_drive_of_a_compensator_stays_inside_its_limits() {
    let chain = Plain::new(pi()).with_saturation(&SaturationParams::before(-5.0, 40.0, 0.0)).unwrap();
    let inverse: Box<Inverse<_>> = Box::new(chain.compensator(&PERIOD, &CompensatorOptions::default()).unwrap());
    let (mut s, e) = (inverse.state(), Env::default());
    let drives = (0..200).map(|k| inverse.step(&mut s, &e, 20.0 * libm::sin(0.1 * f64::from(k))));
    let (low, high) = drives.fold((0.0, 0.0), |(low, high), u| (u.min(low), u.max(high)));
    assert_eq!((low, high), (-5.0, 40.0));
}

#[test]
fn a_resonance_is_inverted_within_the_stated_error() {
    for gain in [1.0, 0.9, 0.6] {
        let mode = ResonanceParams { hz: 90.0, damping: 0.02, gain };
        let chain = Plain::new(Pi::new(0.1, &[], &[]).unwrap()).with_resonance(&mode, &PERIOD).unwrap();
        let (worst, stated) = worst(&chain, smooth, 4000);
        assert!(stated < 5e-3 && worst < 8.0 * stated.max(1e-6), "gain {gain}: {worst} {stated}");
    }
}

#[test]
fn lag_delay_and_resonance_are_inverted_around_hysteresis() {
    let chain = Plain::new(pi())
        .with_delay(&DelayParams { seconds: 3.4e-3 }, &PERIOD)
        .and_then(|c| c.with_lag(&LagParams { seconds: 4e-3 }, &PERIOD))
        .and_then(|c| c.with_resonance(&ResonanceParams { hz: 110.0, damping: 0.03, gain: 0.95 }, &PERIOD))
        .unwrap();
    let (worst, stated) = worst(&chain, smooth, 4000);
    // The drive has a corner at each reversal, which a band-limited inverse of the lag cannot follow.
    assert!(stated < 5e-3 && worst < 5e-3 * 8.0, "{worst} {stated}");
}

/// The inverse of Bouc-Wen is a search. The inverse of an activation model needs preview. Both are in a chain with
/// a mode.
#[test]
fn a_compensator_accepts_a_given_inverse() {
    let mode = ResonanceParams { hz: 90.0, damping: 0.02, gain: 0.9 };
    let options = CompensatorOptions::default();

    let params = BoucWenParams { k0: 0.12, alpha: 0.05, beta: 0.02, gamma: 0.01, n: 1.0 };
    let bouc_wen: BoucWen<f64> = params.build(&()).unwrap();
    let inverse = bouc_wen.inverse(-200.0, 300.0, 1e-12).unwrap();
    let given = InverseHysteresis { inverse, lead: 0, band: None };
    let chain: Chain<f64, _, 64, 4> = Chain::new(bouc_wen).with_resonance(&mode, &PERIOD).unwrap();
    let inverse: Box<Inverse<_>> = Box::new(chain.compensator_with(given, &PERIOD, &options).unwrap());
    let error = max_error(&chain, &inverse, smooth, 4000);
    assert!(inverse.error() < 5e-3 && error < 8.0 * inverse.error(), "{error} {}", inverse.error());

    let params = ActivationParams { k0: 0.15, alpha: -1e-4, beta: 0.4, gamma: 0.05 };
    let tanh: Activation<f64> = (ActivationKind::Tanh, params).build(&PERIOD).unwrap();
    let inverse: AntiCausal<f64, 128> = tanh.anti_causal(1e-12).unwrap();
    let given = InverseHysteresis { lead: inverse.lead(), inverse, band: None };
    let chain: Chain<f64, _, 64, 4> = Chain::new(tanh).with_resonance(&mode, &PERIOD).unwrap();
    let inverse: Box<Inverse<_>> = Box::new(chain.compensator_with(given, &PERIOD, &options).unwrap());
    let error = max_error(&chain, &inverse, smooth, 4000);
    assert!(inverse.lead() > inverse.hysteresis().lead() && inverse.hysteresis().lead() > 0);
    assert!(inverse.error() < 5e-3 && error < 8.0 * inverse.error(), "{error} {}", inverse.error());
}

#[test]
fn a_band_that_needs_too_many_taps_is_rejected() {
    let slow = ResonanceParams { hz: 2.0, damping: 0.02, gain: 1.0 };
    let chain = Plain::new(pi()).with_resonance(&slow, &PERIOD).unwrap();
    let built: Result<Compensator<f64, _, 64, 4, 511>, _> = chain.compensator(&PERIOD, &CompensatorOptions::default());
    assert!(matches!(built, Err(Error::Capacity { name: "preview taps", .. })));
}
