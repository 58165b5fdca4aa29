//! Tests of the TD-PI model against the figures of the paper, and of its exact inverse.

use super::*;
use core::f64::consts::PI;
use proptest::prelude::*;
use std::vec::Vec;

const DEGC: [f64; 5] = [23.0, 29.0, 33.0, 35.0, 39.0];
/// Measured mean slopes of the paper \[µm/V\].
const MEASURED: [f64; 5] = [0.1509, 0.1523, 0.1606, 0.1627, 0.1735];
/// Mean slopes of the published parameters, recomputed independently.
const RECOMPUTED: [f64; 5] = [0.1475, 0.1558, 0.1615, 0.1645, 0.1706];

fn at(degc: f64) -> Env<f64> {
    Env { temperature: degc, ..Env::default() }
}

/// Returns input and output of the second cycle of 200 sin(2π 0.1 t) V at 0.2 ms.
fn cycle(degc: f64) -> Vec<(f64, f64)> {
    let model: TdPi<f64, 9> = TdPiParams::PRINTED.build(&()).unwrap();
    let mut s = model.state();
    model.reset(&mut s, &at(degc), 0.0);
    let drive = |k: u32| 200.0 * libm::sin(2.0 * PI * 0.1 * 2e-4 * f64::from(k));
    let mut loop_ = Vec::new();
    for k in 0..100_000 {
        let y = model.step(&mut s, &at(degc), drive(k));
        if k >= 50_000 {
            loop_.push((drive(k), y));
        }
    }
    loop_
}

#[test]
fn slopes_over_temperature_agree_with_the_paper() {
    for ((degc, measured), recomputed) in DEGC.iter().zip(MEASURED).zip(RECOMPUTED) {
        let pairs = cycle(*degc);
        let n = pairs.len() as f64;
        let (mu, my) = pairs.iter().fold((0.0, 0.0), |(a, b), (u, y)| (a + u / n, b + y / n));
        let (uy, uu) =
            pairs.iter().fold((0.0, 0.0), |(a, b), (u, y)| (a + (u - mu) * (y - my), b + (u - mu) * (u - mu)));
        let slope = uy / uu;
        assert!((slope - recomputed).abs() < 6e-5, "{degc} °C: {slope}");
        assert!((slope / measured - 1.0).abs() < 0.025, "{degc} °C: {slope}, measured {measured}");
        if *degc == 23.0 {
            let top = pairs.iter().fold(0.0f64, |m, (_, y)| m.max(y.abs()));
            assert!((top - 28.5).abs() < 0.15, "{top}");
        }
    }
}

#[test]
fn weights_at_r_0_follow_the_formula() {
    // The published list swaps two entries. The formula gives 0.977, 1.032, 1.070, 1.090, 1.130.
    for (degc, p0) in DEGC.iter().zip([0.977, 1.032, 1.070, 1.090, 1.130]) {
        // A rise within the first threshold moves only the r = 0 play: its slope is p₀ a₀.
        let model: TdPi<f64, 9> = TdPiParams::PRINTED.build(&()).unwrap();
        let mut s = model.state();
        model.reset(&mut s, &at(*degc), 4.0);
        let rise = model.step(&mut s, &at(*degc), 6.0);
        let mut s = model.state();
        let rise = rise - model.reset(&mut s, &at(*degc), 4.0);
        assert!((rise / (2.0 * TdPiParams::PRINTED.a0) - p0).abs() < 5e-4, "{degc}: {rise}");
    }
}

#[test]
fn eq_25_without_the_envelope_on_the_identity_disagrees_with_the_measurement() {
    // The r = 0 play is close to 0.06 u here. Replace it by p₀ u.
    let top = cycle(23.0).iter().fold(0.0f64, |m, (u, y)| m.max((y + 0.977 * (u - 0.06 * u)).abs()));
    assert!((top - 212.0).abs() < 1.0, "{top}");
}

#[test]
fn inverse_returns_30_micrometres_at_five_temperatures_and_over_a_ramp() {
    let model: TdPi<f64, 9> = TdPiParams::PRINTED.build(&()).unwrap();
    let inverse = model.invert().unwrap();
    let ramp = |k: u32| 23.0 + 16.0 * f64::from(k) / 20_000.0;
    let mut temperatures: Vec<std::boxed::Box<dyn Fn(u32) -> f64>> = std::vec![std::boxed::Box::new(ramp)];
    for degc in DEGC {
        temperatures.push(std::boxed::Box::new(move |_| degc));
    }
    for degc in temperatures {
        let (mut a, mut b) = (model.state(), inverse.state());
        for k in 0..20_000u32 {
            let t = 1e-3 * f64::from(k);
            let reference = 30.0 * libm::sin(2.0 * PI * 0.1 * t) * (1.0 - 0.3 * libm::sin(2.0 * PI * 1.7 * t));
            let e = at(degc(k));
            let drive = inverse.step(&mut b, &e, reference);
            let y = model.step(&mut a, &e, drive);
            assert!((y - reference).abs() < 1e-9 * 60.0, "{k}: {y} {reference}");
        }
    }
}

proptest! {
    /// Random models, references with reversals at every scale, and a temperature that changes at every sample.
    #[test]
    fn inverse_reaches_every_reference(
        alpha in 0.1..3.0f64,
        epsilon in 0.05..3.0f64,
        tau in 0.0..1.0f64,
        eta in -0.03..0.03f64,
        slope in 0.03..2.0f64,
        gap in 0.0..2.0f64,
        offset in -1.0..1.0f64,
        plays in 0u16..=12,
        turns in prop::collection::vec((-1.0..1.0f64, -10.0..40.0f64), 20..120),
    ) {
        let params = TdPiParams {
            alpha, epsilon, tau, eta, a0: slope, a1: offset - gap, b0: slope, b1: offset + gap, plays, reference_degc: 23.0,
        };
        let model: TdPi<f64, 12> = params.build(&()).unwrap();
        let inverse = model.invert().unwrap();
        let (mut a, mut b) = (model.state(), inverse.state());
        let span = 60.0;
        for (k, (y, degc)) in turns.iter().enumerate() {
            let e = at(*degc);
            let reference = 0.5 * span * y;
            let (drive, reached);
            if k == 0 {
                drive = inverse.reset(&mut b, &e, reference);
                reached = model.reset(&mut a, &e, drive);
            } else {
                drive = inverse.step(&mut b, &e, reference);
                reached = model.step(&mut a, &e, drive);
            }
            prop_assert!((reached - reference).abs() <= 1e-9 * span, "{k}: {reached} {reference}");
        }
    }
}

#[test]
fn drive_jumps_at_reversals_as_stated() {
    let model: TdPi<f64, 9> = TdPiParams::PRINTED.build(&()).unwrap();
    let inverse = model.invert().unwrap();
    let mut s = inverse.state();
    for k in 0..=1000 {
        inverse.step(&mut s, &at(23.0), 0.02 * f64::from(k));
    }
    let drive = inverse.step(&mut s, &at(23.0), 20.0);
    let jump = drive - inverse.step(&mut s, &at(23.0), 20.0 - 1e-9);
    assert!((jump - model.at_reference().envelope().jump(drive)).abs() < 1e-6, "{jump}");
    assert!((7.2..9.7).contains(&jump));
}

#[test]
fn a_non_finite_temperature_is_replaced_by_the_last_finite_one() {
    let model: TdPi<f64, 9> = TdPiParams::PRINTED.build(&()).unwrap();
    let (mut a, mut b) = (model.state(), model.state());
    model.step(&mut a, &at(35.0), 100.0);
    model.step(&mut b, &at(35.0), 100.0);
    assert_eq!(model.step(&mut a, &at(f64::NAN), 120.0), model.step(&mut b, &at(35.0), 120.0));
    assert_eq!(model.step(&mut a, &at(35.0), f64::NAN), model.step(&mut b, &at(35.0), 120.0));
}

#[test]
fn bad_parameters_are_named() {
    let named = |p: TdPiParams| match Build::<TdPi<f32, 9>>::build(&p, &()) {
        Err(Error::NonFinite(name) | Error::OutOfRange { name, .. }) => name,
        other => panic!("{other:?}"),
    };
    let p = TdPiParams::PRINTED;
    assert_eq!(named(TdPiParams { a0: -1.0, ..p }), "td-pi.a0");
    assert_eq!(named(TdPiParams { b1: f64::NAN, ..p }), "td-pi.b1");
    assert_eq!(named(TdPiParams { tau: -20.0, ..p }), "td-pi.tau");
    assert_eq!(named(TdPiParams { alpha: 0.0, ..p }), "td-pi.alpha");
}

#[test]
fn scaled_parameters_give_the_same_model() {
    let p = TdPiParams::PRINTED;
    let s = 3.7;
    let scaled = TdPiParams {
        alpha: p.alpha * s,
        epsilon: p.epsilon / s,
        tau: p.tau / s,
        a0: p.a0 * s,
        a1: p.a1 * s,
        b0: p.b0 * s,
        b1: p.b1 * s,
        ..p
    };
    let (a, b): (TdPi<f64, 9>, TdPi<f64, 9>) = (p.build(&()).unwrap(), scaled.build(&()).unwrap());
    let (mut x, mut y) = (a.state(), b.state());
    for k in 0..500 {
        let u = 150.0 * libm::sin(0.11 * f64::from(k));
        assert!((a.step(&mut x, &at(30.0), u) - b.step(&mut y, &at(30.0), u)).abs() < 1e-12);
    }
    assert!(matches!(
        Build::<TdPi<f64, 4>>::build(&p, &()),
        Err(Error::Capacity { name: "td-pi.plays", needed: 9, holds: 4 })
    ));
}
