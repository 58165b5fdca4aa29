//! Tests of the chain: order and effect of its stages, reset, and samples that are not finite.

use super::*;
use crate::Pi;
use std::vec::Vec;

fn chain<T: Real>() -> Chain<T, Pi<T, 4>, 16, 4> {
    let cx = Sampling { period: 1e-3 };
    Chain::new(Pi::new(0.1, &[5.0, 12.0, 25.0, 40.0], &[0.02, 0.02, 0.01, 0.01]).unwrap())
        .with_zero(-1.5)
        .with_delay(&DelayParams { seconds: 2.3e-3 }, &cx)
        .and_then(|c| c.with_lag(&LagParams { seconds: 2e-3 }, &cx))
        .and_then(|c| {
            let rate = RateParams { volts: 0.8, exponent: 0.4, reference_rate: 120.0, law: crate::RateLaw::Holds };
            c.with_rate(&rate, &cx)
        })
        .and_then(|c| c.with_temperature(&temperature(), &cx))
        .and_then(|c| c.with_creep(&CreepParams { seconds: &[0.1, 1.0, 10.0], shares: &[0.01, 0.01, 0.01] }, &cx))
        .and_then(|c| c.with_resonance(&ResonanceParams { hz: 120.0, damping: 0.03, gain: 0.9 }, &cx))
        .and_then(|c| c.with_asymmetry(&AsymmetryParams::behind([3.0, -2.0], [0.1, -0.05])))
        .and_then(|c| c.with_asymmetry(&AsymmetryParams::before([20.0, 60.0], [0.2, 0.1])))
        .and_then(|c| c.with_load(&LoadParams { per_newton: 0.02, gain_per_newton: 0.003 }))
        .and_then(|c| c.with_saturation(&SaturationParams::behind(-5.0, 14.0, 0.1)))
        .and_then(|c| c.with_drift(&DriftParams { per_second: 0.01, settling: 0.2, seconds: 2.0, since_s: 0.5 }))
        .and_then(|c| {
            c.with_interference(&InterferenceParams { hz: 50.0, amplitude: 0.05, phase: 0.3, harmonics: [0.01; 8] })
        })
        .unwrap()
}

fn temperature() -> TemperatureParams {
    TemperatureParams { per_kelvin: 0.005, reference_degc: 23.0, expansion: 0.05, direct: 0.001, seconds: 1.5 }
}

/// The hysteresis has the memory of the same drive; values that are not finite are ignored.
#[test]
fn only_the_hysteresis_has_the_memory_of_a_drive_history() {
    let past = [f64::NAN, 0.0, 70.0, 15.0, f64::INFINITY, 40.0];
    let driven = |chain: &Chain<f64, Pi<f64, 4>, 16, 4>, past: &[f64]| {
        let (mut s, e) = (chain.state(), Env::default());
        chain.reset_after(&mut s, &e, 30.0, past)
    };
    let operator = chain::<f64>().hysteresis;
    let plain = Chain::new(operator).with_falling(true);
    let (mut s, e) = (operator.state(), Env::default());
    operator.reset(&mut s, &e, 0.0);
    let expected = [70.0, 15.0, 40.0, 30.0].map(|u| operator.step(&mut s, &e, u))[3];
    assert_eq!(driven(&plain, &past), -expected);
    assert_ne!(driven(&plain, &past), driven(&plain, &[]));
    // Without a history it equals a reset, with any other stages.
    let whole = chain::<f64>();
    let mut s = whole.state();
    assert_eq!(driven(&whole, &[]), whole.reset(&mut s, &e, 30.0));
}

/// Limits of the drive act before every other stage, and on the drive history too.
#[test]
fn limits_of_the_drive_act_first() {
    let rails = SaturationParams::before(-10.0, 60.0, 0.0);
    let free = chain::<f64>();
    let limited = free.clone().with_saturation(&rails).unwrap();
    assert_eq!(limited.saturation, free.saturation);
    let (mut a, mut b, e) = (free.state(), limited.state(), Env::default());
    let (past, inside) = ([0.0, 90.0, -30.0, 40.0], [0.0, 60.0, -10.0, 40.0]);
    assert_eq!(limited.reset_after(&mut b, &e, 75.0, &past), free.reset_after(&mut a, &e, 60.0, &inside));
    for k in 0..300 {
        let u = 25.0 + 70.0 * libm::sin(0.05 * f64::from(k));
        assert_eq!(limited.step(&mut b, &e, u), free.step(&mut a, &e, u.clamp(-10.0, 60.0)), "sample {k}");
    }
}

/// With δ = −α g the gain stays and the loop widens.
#[test]
fn the_loop_widens_with_temperature_while_the_gain_stays() {
    let operator = Pi::<f64, 1>::new(0.1, &[10.0], &[0.1]).unwrap();
    let p = TemperatureParams { per_kelvin: 0.05, direct: -0.01, ..TemperatureParams::default() };
    let cx = Sampling { period: 1e-3 };
    let chain: Chain<f64, _, 1, 1> = Chain::new(operator).with_temperature(&p, &cx).unwrap();
    let at = |kelvin: f64| {
        let (mut s, e) = (chain.state(), Env { temperature: kelvin, ..Env::default() });
        chain.reset(&mut s, &e, 0.0);
        let ends = [100.0, 50.0, 0.0, 50.0, 100.0].map(|u| chain.step(&mut s, &e, u));
        // The width of the loop in its middle, and its height.
        (ends[1] - ends[3], ends[4] - ends[2])
    };
    let ((cold, height), (warm, same)) = (at(0.0), at(4.0));
    assert!((warm / cold - 1.2).abs() < 1e-12, "{cold} {warm}");
    // The gain of the sliding plays is 0.2, and α 0.2 = −δ.
    assert!((same - height - 4.0 * (0.05 * height - 0.01 * 100.0)).abs() < 1e-12, "{height} {same}");
}

fn run<T: Real>(rows: usize) -> Vec<f64> {
    let chain = chain::<T>();
    let mut s = chain.state();
    (0..rows)
        .map(|k| {
            let t = 1e-3 * k as f64;
            let u = 60.0 * (1.0 - libm::cos(9.0 * t)) * (0.6 + 0.4 * libm::sin(1.3 * t));
            let e = Env { time: T::from_f64(t), temperature: T::from_f64(23.0 + 3.0 * libm::sin(t)), load: T::ZERO };
            let u = T::from_f64(u);
            if k == 0 { chain.reset(&mut s, &e, u).to_f64() } else { chain.step(&mut s, &e, u).to_f64() }
        })
        .collect()
}

#[test]
fn single_precision_follows_double_precision() {
    let (single, double) = (run::<f32>(5000), run::<f64>(5000));
    let span = double.iter().fold(0.0f64, |m, y| m.max(y.abs()));
    for (a, b) in single.iter().zip(&double) {
        assert!((a - b).abs() < 2e-5 * span, "{a} {b}");
    }
}

#[test]
fn a_dropout_does_not_change_later_outputs() {
    let c = chain::<f64>();
    let e = Env { temperature: 24.0, ..Env::default() };
    let (mut a, mut b) = (c.state(), c.state());
    c.reset(&mut a, &e, 0.0);
    c.reset(&mut b, &e, 0.0);
    for k in 0..200 {
        let u = 0.5 * f64::from(k);
        let dropped = Env { temperature: f64::NAN, ..e };
        // A repeated sample for the first, NaN for the second.
        if k % 50 == 7 {
            assert_eq!(c.step(&mut a, &e, 0.5 * f64::from(k - 1)), c.step(&mut b, &dropped, f64::NAN));
        }
        assert_eq!(c.step(&mut a, &e, u), c.step(&mut b, &e, u));
    }
}

#[test]
fn steps_and_blocks_give_equal_outputs() {
    let c = chain::<f64>();
    let (mut a, mut b) = (c.state(), c.state());
    let e = [Env { temperature: 24.0, ..Env::default() }; 100];
    let u: Vec<f64> = (0..100).map(|k| 1.1 * f64::from(k)).collect();
    c.reset(&mut a, &e[0], 0.0);
    c.reset(&mut b, &e[0], 0.0);
    let mut y = [0.0; 100];
    c.block(&mut a, &e, &u, &mut y);
    for (u, y) in u.iter().zip(y) {
        assert_eq!(c.step(&mut b, &e[0], *u), y);
    }
}

#[test]
fn a_third_mode_exceeds_the_capacity() {
    let mode = ResonanceParams { hz: 50.0, damping: 0.1, gain: 1.0 };
    let cx = Sampling { period: 1e-3 };
    let two = chain::<f64>().with_resonance(&mode, &cx).unwrap();
    assert!(matches!(two.with_resonance(&mode, &cx), Err(Error::Capacity { holds: MAX_RESONANCES, .. })));
}

#[test]
fn a_ninth_dead_zone_exceeds_the_capacity() {
    let bent = |zones: u8| {
        let thresholds: Vec<f64> = (1..=zones).map(f64::from).collect();
        let weights = std::vec![0.1; thresholds.len()];
        chain::<f64>().with_asymmetry(&AsymmetryParams::behind(thresholds, weights))
    };
    assert!(bent(8).is_ok());
    assert!(matches!(bent(9), Err(Error::Capacity { needed: 9, holds: MAX_DEAD_ZONES, .. })));
}
