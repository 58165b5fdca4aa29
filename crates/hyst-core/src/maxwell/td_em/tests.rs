//! Tests of the temperature-dependent electromechanical model and its band-limited inverse.

use super::*;
use core::f64::consts::PI;
use proptest::prelude::*;
use std::boxed::Box;
use std::vec::Vec;

const DEGC: [f64; 5] = [23.0, 29.0, 33.0, 35.0, 39.0];
/// Measured mean slopes of the paper, and those of the published parameters, recomputed independently \[µm/V\].
const MEASURED: [f64; 5] = [0.1509, 0.1523, 0.1606, 0.1627, 0.1735];
const RECOMPUTED: [f64; 5] = [0.1484, 0.1526, 0.1582, 0.1619, 0.1709];

fn at(degc: f64) -> Env<f64> {
    Env { temperature: degc, ..Env::default() }
}

fn tube(reading: SlipReading) -> TdEm<f64, 10> {
    let printed = TdEmParams::PRINTED;
    TdEmParams { slip: MaxwellSlipParams { reading, ..printed.slip }, ..printed }
        .build(&Sampling { period: 2e-4 })
        .unwrap()
}

/// Returns mean slope and largest output of the second cycle of 200 sin(2π 0.1 t) V.
fn slope(model: &TdEm<f64, 10>, degc: f64) -> (f64, f64) {
    let mut s = model.state();
    model.reset(&mut s, &at(degc), 0.0);
    let (mut uy, mut uu, mut top) = (0.0, 0.0, 0.0f64);
    for k in 0..100_000 {
        let u = 200.0 * libm::sin(2.0 * PI * 0.1 * 2e-4 * f64::from(k));
        let y = model.step(&mut s, &at(degc), u);
        if k >= 50_000 {
            (uy, uu, top) = (uy + u * y, uu + u * u, top.max(y.abs()));
        }
    }
    (uy / uu, top)
}

#[test]
fn slopes_over_temperature_agree_with_the_paper() {
    let model = tube(SlipReading::Backlash);
    for ((degc, measured), recomputed) in DEGC.iter().zip(MEASURED).zip(RECOMPUTED) {
        let (slope, top) = slope(&model, *degc);
        assert!((slope - recomputed).abs() < 6e-5, "{degc} °C: {slope}");
        assert!((slope / measured - 1.0).abs() < 0.02, "{degc} °C: {slope}, measured {measured}");
        assert!(*degc != 23.0 || (top - 28.7).abs() < 0.06, "{top}");
    }
}

#[test]
fn published_parameters_give_4_micrometres_with_elasto_slip_elements() {
    let (_, top) = slope(&tube(SlipReading::ElastoSlip), 23.0);
    assert!((top - 4.3).abs() < 0.3, "{top}");
}

#[test]
fn parabola_gives_the_listed_couplings() {
    let model = tube(SlipReading::Backlash);
    for (degc, psi) in [(23.0, 7.2971e-4), (33.0, 7.7782e-4), (39.0, 8.4007e-4)] {
        assert!((model.coupling(degc) - psi).abs() < 2e-7, "{degc}: {}", model.coupling(degc));
    }
}

#[test]
fn inverse_keeps_its_stated_error_also_at_a_rising_temperature() {
    let model = tube(SlipReading::Backlash);
    let inverse: Box<TdEmInverse<f64, 10, 127>> = Box::new(model.band_limited(23.0, None).unwrap());
    assert!(inverse.error() < 2e-3, "{}", inverse.error());
    let lead = inverse.lead();
    let rows = 8000;
    let reference = |k: usize| 15.0 * (1.0 - libm::cos(2.0 * PI * 3.0 * 2e-4 * k.min(rows - 1) as f64));
    for ramp in [0.0, 10.0] {
        let env = |k: usize| at(23.0 + ramp * k as f64 / rows as f64);
        let (mut s, mut i) = (model.state(), inverse.state());
        inverse.reset(&mut i, &env(0), reference(0));
        let drive: Vec<f64> = (1..rows + lead).map(|k| inverse.step(&mut i, &env(k), reference(k))).collect();
        let mut worst = 0.0f64;
        model.reset(&mut s, &env(0), 0.0);
        for (k, u) in drive.iter().skip(lead - 1).enumerate() {
            let y = model.step(&mut s, &env(k), *u);
            if k + lead < rows {
                worst = worst.max((y - reference(k)).abs());
            }
        }
        // With the jumps of its drive, the bank gives exactly the current of the filter at each sample.
        assert!(worst < 30.0 * (inverse.error() + 2e-4), "{worst} {}", inverse.error());
    }
}

/// Rounding in the filter must not count as a reversal: the drive would jump across the narrowest backlash and stay
/// there.
#[test]
fn a_constant_reference_gives_a_constant_drive() {
    let model = tube(SlipReading::Backlash);
    let inverse: Box<TdEmInverse<f64, 10, 255>> = Box::new(model.band_limited(23.0, None).unwrap());
    for y in [-22.96, -3.7, 0.3, 5.1, 27.9] {
        let (mut s, mut i, e) = (model.state(), inverse.state(), at(23.0));
        let drive = inverse.reset(&mut i, &e, y);
        assert!((model.reset(&mut s, &e, drive) - y).abs() < 1e-9);
        for _ in 0..300 {
            assert_eq!(inverse.step(&mut i, &e, y), drive, "{y}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    /// Random circuits and references in the band: the error is at most the stated error times the tones.
    #[test]
    fn inverse_keeps_its_stated_error(
        hz in 300.0..1200.0f64, damping in 0.02..0.3f64, rc in 2e-4..5e-3f64, psi in 1e-4..2e-3f64,
        tones in prop::collection::vec((1.0..60.0f64, 0.1..1.0f64), 3),
    ) {
        let (mass, printed) = (0.0026442, TdEmParams::PRINTED);
        let stiffness = mass * (2.0 * PI * hz) * (2.0 * PI * hz);
        let params = TdEmParams {
            capacitance: rc / printed.resistance,
            stiffness,
            damping: 2.0 * damping * libm::sqrt(stiffness * mass),
            coupling: [psi, 0.0, 0.0],
            ..printed
        };
        let period = 2e-4;
        let model: TdEm<f64, 10> = params.build(&Sampling { period }).unwrap();
        let inverse: Box<TdEmInverse<f64, 10, 255>> = Box::new(model.band_limited(23.0, None).unwrap());
        let (lead, rows) = (inverse.lead(), 3000usize);
        let total: f64 = tones.iter().map(|(_, a)| a).sum();
        // Tones that start smoothly, so they are inside the band.
        let reference = |k: usize| {
            let t = period * k as f64;
            let fade = 0.5 - 0.5 * libm::cos(PI * (t / 0.2).min(1.0));
            fade * tones.iter().map(|(f, a)| a * (1.0 - libm::cos(2.0 * PI * f * t))).sum::<f64>()
        };
        let (mut s, mut i, e) = (model.state(), inverse.state(), at(23.0));
        inverse.reset(&mut i, &e, 0.0);
        model.reset(&mut s, &e, 0.0);
        let mut worst = 0.0f64;
        for k in 1..rows {
            let drive = inverse.step(&mut i, &e, reference(k));
            if let Some(now) = k.checked_sub(lead) {
                let y = model.step(&mut s, &e, drive);
                worst = worst.max((y - reference(now)).abs());
            }
        }
        prop_assert!(worst <= 2.0 * total * (inverse.error() + 1e-3), "{worst} {} {total}", inverse.error());
    }
}

#[test]
fn an_impossible_temperature_has_no_lasting_effect() {
    let model: TdEm<f32, 10> = TdEmParams::PRINTED.build(&Sampling { period: 1e-3 }).unwrap();
    let mut s = model.state();
    let at = |degc: f32| Env { temperature: degc, ..Env::default() };
    model.reset(&mut s, &at(23.0), 0.0);
    model.step(&mut s, &at(1e10), 100.0);
    let mut y = 0.0;
    for _ in 0..2000 {
        y = model.step(&mut s, &at(23.0), 100.0);
    }
    let mut fresh = model.state();
    assert!((y - model.reset(&mut fresh, &at(23.0), 100.0)).abs() < 1e-3, "{y}");
}

#[test]
fn output_is_bounded_at_any_period_and_temperature() {
    for period in [1e-7, 1e-3, 10.0] {
        let model: TdEm<f32, 10> = TdEmParams::PRINTED.build(&Sampling { period }).unwrap();
        let mut s = model.state();
        for k in 0..20_000u32 {
            let u = if (k / 7) % 2 == 0 { 200.0 } else { -200.0 };
            let y = model.step(&mut s, &Env { temperature: (k % 900) as f32, ..Env::default() }, u);
            assert!(y.is_finite() && y.abs() < 2e4, "{period} {k} {y}");
        }
    }
}

#[test]
fn bad_parameters_are_named() {
    let bad = TdEmParams { mass: -1.0, ..TdEmParams::PRINTED };
    let built: Result<TdEm<f64, 10>, _> = bad.build(&Sampling { period: 1e-3 });
    assert!(matches!(built, Err(Error::OutOfRange { name: "td-em.mass", .. })));
    let mut bad = TdEmParams::PRINTED;
    bad.slip.widths[3] = 0.0;
    let built: Result<TdEm<f64, 10>, _> = bad.build(&Sampling { period: 1e-3 });
    assert!(matches!(built, Err(Error::OutOfRange { name: "td-em.slip.widths", .. })));
    let built: Result<TdEm<f64, 4>, _> = TdEmParams::PRINTED.build(&Sampling { period: 1e-3 });
    assert_eq!(built, Err(Error::Capacity { name: "td-em.slip elements", needed: 10, holds: 4 }));
}
