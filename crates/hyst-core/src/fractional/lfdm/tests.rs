//! Tests of the LFDM: published response, recursion of eq. 15, accuracy of the inverse.

use super::super::testing::{five_sines, max_difference, measured, order, reference, run, span};
use super::super::{Exponentials, GlWeights, ShortMemory};
use super::*;
use proptest::prelude::*;
use std::vec::Vec;

const PRINTED: LfdmParams = LfdmParams::PRINTED;
const TEN_KHZ: Sampling = Sampling { period: 1e-4 };
type Model<T> = Lfdm<T, Exponentials<T, 40>>;

fn model<T: Real>(order: GlOrder, h: f64) -> Model<T> {
    LfdmParams { order, ..PRINTED }.build(&Sampling { period: h }).unwrap()
}

fn drive(n: usize) -> Vec<f64> {
    (0..n).map(|k| 20.0 + 5.0 * five_sines(1e-4 * k as f64)).collect()
}

#[test]
fn printed_gains() {
    assert!((PRINTED.response(5.0).abs() - 4.9).abs() < 0.05);
    assert!((PRINTED.response(30.0).abs() - 3.3).abs() < 0.05);
    assert_eq!(PRINTED.response(0.0), Complex::from(6.573));
}

#[test]
fn a_simulated_sine_has_the_continuous_response() {
    for (order, h, close) in [(GlOrder::Second, 1e-4, 1e-3), (GlOrder::First, 1.0 / 30e3, 1e-3)] {
        let m = model::<f64>(order, h);
        for hz in [5.0, 10.0, 15.0, 20.0, 30.0] {
            let exact = PRINTED.response(hz);
            let seen = measured(&m, hz, h, 80) / exact;
            assert!((seen.abs() - 1.0).abs() < close && seen.arg().abs() < close, "{order:?} {hz}: {seen:?}");
        }
    }
}

/// At 10 kHz the first order has errors of 0.26 % in phase and 0.06 % in gain at 30 Hz.
#[test]
fn error_of_the_first_order_at_ten_kilohertz() {
    let error = model::<f64>(GlOrder::First, 1e-4)
        .response(Complex::polar(1.0, -2.0 * core::f64::consts::PI * 30.0 * 1e-4))
        / PRINTED.response(30.0);
    assert!((error.arg() - 2.57e-3).abs() < 1e-5 && (error.abs() - 1.0 + 5.87e-4).abs() < 1e-6, "{error:?}");
}

#[test]
fn response_agrees_with_a_simulated_sine() {
    let (h, hz) = (1e-3, 50.0);
    for order in [GlOrder::First, GlOrder::Second] {
        let z1 = Complex::polar(1.0, -2.0 * core::f64::consts::PI * hz * h);
        let long = model::<f64>(order, h);
        let short: Lfdm<f64, ShortMemory<f64, 50>> =
            LfdmParams { order, ..PRINTED }.build(&Sampling { period: h }).unwrap();
        let exact = long.response(z1);
        assert!((measured(&long, hz, h, 400) - exact).abs() < 1e-4 * exact.abs());
        let exact = short.response(z1);
        assert!((measured(&short, hz, h, 400) - exact).abs() < 1e-4 * exact.abs());
    }
}

/// Eq. 15 as published, truncated after M samples.
#[test]
fn recursion_equals_eq_15() {
    const M: usize = 60;
    let (u, h): (_, f64) = (drive(300), 1e-4);
    let m: Lfdm<f64, ShortMemory<f64, M>> = PRINTED.build(&TEN_KHZ).unwrap();
    let got = run(&m, &u);
    let weights = |mu| GlWeights::new(mu, GlOrder::First).take(M + 1).collect::<Vec<f64>>();
    let (wa, wb) = (weights(PRINTED.alpha), weights(PRINTED.beta));
    let (pa, pb) = (libm::pow(h, PRINTED.alpha), libm::pow(h, PRINTED.beta));
    let mut x: Vec<f64> = Vec::new();
    for n in 0..u.len() {
        let past = |w: &[f64], g: &dyn Fn(usize) -> f64, from: usize| -> f64 {
            (from..=M.min(n)).map(|k| w[k] * g(n - k)).sum()
        };
        let sum_u = past(&wa, &|k| u[k] - u[0], 0);
        let sum_x = past(&wb, &|k| x[k], 1);
        let rhs = PRINTED.a * (u[n] - u[0]) + PRINTED.b / pa * sum_u - PRINTED.c / pb * sum_x;
        x.push(pb / (pb + PRINTED.c) * rhs);
    }
    let x: Vec<f64> = x.iter().map(|x| x + PRINTED.a * u[0]).collect();
    assert!(max_difference(&got, &x) < 1e-11, "{}", max_difference(&got, &x));
}

#[test]
fn inverse_is_the_model_with_exchanged_parameters() {
    let inverse = model::<f64>(GlOrder::First, 1e-4).invert().unwrap();
    let exchanged = LfdmParams {
        a: 1.0 / PRINTED.a,
        b: PRINTED.c / PRINTED.a,
        c: PRINTED.b / PRINTED.a,
        alpha: PRINTED.beta,
        beta: PRINTED.alpha,
        order: GlOrder::First,
    };
    let other: Model<f64> = exchanged.build(&TEN_KHZ).unwrap();
    let x = drive(3000);
    assert!(max_difference(&run(&inverse, &x), &run(&other, &x)) < 1e-12);
    assert!(LfdmParams { a: 0.0, ..PRINTED }.build(&TEN_KHZ).map(|m: Model<f64>| m.invert()).unwrap().is_err());
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn inverse_after_and_before_is_the_identity(
        (a, b, c) in (0.01..10.0f64, 0.0..10.0f64, 0.0..10.0f64),
        (alpha, beta) in (0.0..=1.0f64, 0.0..=1.0f64),
        order in order(),
        period in -5.0..-1.0f64,
        levels in prop::collection::vec(-3.0..3.0f64, 1..15),
        hertz in prop::collection::vec(0.001..0.4f64, 0..4),
    ) {
        let params = LfdmParams { a, b, c, alpha, beta, order };
        let cx = Sampling { period: libm::pow(10.0, period) };
        let long: Lfdm<f64, Exponentials<f64, 32>> = params.build(&cx).unwrap();
        let short: Lfdm<f64, ShortMemory<f64, 50>> = params.build(&cx).unwrap();
        let x = reference(&levels, &hertz);
        let close = 1e-9 * span(&x);
        let error = max_difference(&run(&long, &run(&long.invert().unwrap(), &x)), &x);
        prop_assert!(error <= close, "{error}");
        let error = max_difference(&run(&long.invert().unwrap(), &run(&long, &x)), &x);
        prop_assert!(error <= close, "{error}");
        let error = max_difference(&run(&short, &run(&short.invert().unwrap(), &x)), &x);
        prop_assert!(error <= close, "{error}");
    }
}

#[test]
fn bounded_input_gives_bounded_output_over_1e6_samples() {
    for order in [GlOrder::First, GlOrder::Second] {
        let m = model::<f64>(order, 1e-4);
        let (mut s, e) = (m.state(), Env::default());
        m.reset(&mut s, &e, 0.0);
        // A telegraph signal with widths from 1 to 1000 samples.
        let (mut remaining, mut u, mut highest, mut seed) = (0u32, 1.0, 0.0, 1u32);
        for _ in 0..1_000_000 {
            if remaining == 0 {
                seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
                remaining = 1 + (seed >> 8) % [2, 10, 100, 1000][(seed >> 30) as usize];
                u = -u;
            }
            remaining -= 1;
            highest = m.step(&mut s, &e, u).abs().at_least(highest);
        }
        // 1/(1 + c D^β) is a positive kernel with sum 1. The derivative of ±1 is at most 2 ω₀ p^(−α).
        let bound = PRINTED.a + 2.0 * PRINTED.b * libm::pow(1e-4, -PRINTED.alpha) * libm::pow(1.5, PRINTED.alpha);
        assert!(highest > 3.0 && highest < bound, "{highest} {bound}");
    }
}

#[test]
fn reset_is_a_fresh_state_settled_at_the_input() {
    let m = model::<f64>(GlOrder::First, 1e-4);
    let (mut used, mut fresh, e) = (m.state(), m.state(), Env::default());
    drive(500).iter().for_each(|u| {
        m.step(&mut used, &e, *u);
    });
    assert_eq!(m.reset(&mut used, &e, 2.5), 2.5 * PRINTED.a);
    m.reset(&mut fresh, &e, 2.5);
    assert_eq!(used, fresh);
    for _ in 0..1000 {
        assert_eq!(m.step(&mut used, &e, 2.5), 2.5 * PRINTED.a);
    }
}

#[test]
fn a_non_finite_sample_is_replaced_by_the_last_finite_one() {
    let m = model::<f64>(GlOrder::First, 1e-4);
    let (mut a, mut b, e) = (m.state(), m.state(), Env::default());
    for (k, u) in drive(300).iter().enumerate() {
        let odd = [f64::NAN, f64::INFINITY, *u, *u][k % 4];
        let held = if odd.is_finite() { *u } else { a.last };
        let probed = m.probe(&a, &e, odd);
        let stepped = m.step(&mut a, &e, odd);
        assert_eq!((probed, stepped), (stepped, m.step(&mut b, &e, held)));
    }
    for u in [1e300, -1e300, 1e300, 0.0, 1.0] {
        assert!(!m.step(&mut a, &e, u).is_nan());
    }
}

/// Observed: 1e-7 of the span, one rounding of the output.
#[test]
fn single_precision_agrees() {
    for order in [GlOrder::First, GlOrder::Second] {
        let (wide, narrow) = (model::<f64>(order, 1e-4), model::<f32>(order, 1e-4));
        let exact = |u: f64| f64::from(u as f32);
        for u in [
            (0..1_000_000).map(|k| exact(20.0 + 5.0 * five_sines(1e-4 * f64::from(k)))).collect::<Vec<f64>>(),
            (0..1_000_000).map(|k| if k == 0 { 0.0 } else { 50.0 }).collect(),
        ] {
            let x = run(&wide, &u);
            let error = max_difference(&run(&narrow, &u), &x);
            assert!(error < 2e-7 * span(&x), "{order:?} {}", error / span(&x));
            let back = max_difference(&run(&narrow, &run(&narrow.invert().unwrap(), &x)), &x);
            assert!(back < 5e-7 * span(&x), "{order:?} {}", back / span(&x));
        }
    }
}

#[test]
fn bad_parameters_are_named() {
    let build = |p: LfdmParams, period: f64| p.build(&Sampling { period }).map(|_: Model<f64>| ());
    let named = |p: LfdmParams| match build(p, 1e-4) {
        Err(Error::OutOfRange { name, .. } | Error::NonFinite(name)) => name,
        _ => "",
    };
    assert_eq!(named(LfdmParams { a: -1.0, ..PRINTED }), "lfdm.a");
    assert_eq!(named(LfdmParams { b: f64::NAN, ..PRINTED }), "lfdm.b");
    assert_eq!(named(LfdmParams { c: f64::INFINITY, ..PRINTED }), "lfdm.c");
    assert_eq!(named(LfdmParams { alpha: 1.01, ..PRINTED }), "lfdm.alpha");
    assert_eq!(named(LfdmParams { beta: -0.01, ..PRINTED }), "lfdm.beta");
    assert!(build(PRINTED, 0.0).is_err() && build(LfdmParams { alpha: 1.0, ..PRINTED }, 1e-310).is_err());
}
