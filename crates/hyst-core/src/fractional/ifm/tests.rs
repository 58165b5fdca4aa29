//! Tests of the IFM: published response, recursion of eq. 15, stability and accuracy of the inverse.

use super::super::testing::{five_sines, max_difference, measured, order, reference, run, span};
use super::super::{Exponentials, GlWeights, ShortMemory};
use super::*;
use proptest::prelude::*;
use std::vec::Vec;

const PRINTED: IfmParams = IfmParams::PRINTED;
const TEN_KHZ: Sampling = Sampling { period: 1e-4 };
type Model<T> = Ifm<T, Exponentials<T, 40>, 160>;

fn model<T: Real>(order: GlOrder, h: f64) -> Model<T> {
    IfmParams { order, ..PRINTED }.build(&Sampling { period: h }).unwrap()
}

fn drive(n: usize) -> Vec<f64> {
    (0..n).map(|k| 20.0 + 5.0 * five_sines(1e-4 * k as f64)).collect()
}

#[test]
fn printed_gains() {
    assert!((PRINTED.response(5.0).abs() - 1.70).abs() < 0.005);
    assert!((PRINTED.response(30.0).abs() - 1.54).abs() < 0.005);
    assert_eq!(PRINTED.response(0.0), Complex::from(1.7615));
}

/// The first order is within 0.08 % here.
#[test]
fn a_simulated_sine_has_the_continuous_response() {
    for (order, close) in [(GlOrder::Second, 1e-4), (GlOrder::First, 1e-3)] {
        let m = model::<f64>(order, 1e-4);
        for hz in [5.0, 10.0, 15.0, 20.0, 30.0] {
            let seen = measured(&m, hz, 1e-4, 80) / PRINTED.response(hz);
            assert!((seen.abs() - 1.0).abs() < close && seen.arg().abs() < close, "{order:?} {hz}: {seen:?}");
        }
    }
}

#[test]
fn response_agrees_with_a_simulated_sine_at_fractional_delays() {
    for tau in [0.0, 0.4e-3, 3.7e-3] {
        let (h, hz) = (1e-3, 25.0);
        let params = IfmParams { tau, ..PRINTED };
        let m: Ifm<f64, Exponentials<f64, 40>, 8> = params.build(&Sampling { period: h }).unwrap();
        let exact = m.response(Complex::polar(1.0, -2.0 * PI * hz * h));
        let seen = measured(&m, hz, h, 400);
        assert!((seen - exact).abs() < 1e-4 * exact.abs(), "{tau}: {seen:?} {exact:?}");
    }
}

/// Eq. 10, 11 and 15 as published, truncated after M samples.
#[test]
fn recursion_equals_eq_15() {
    const M: usize = 60;
    let (u, p): (_, f64) = (drive(300), 1e-4);
    let m: Ifm<f64, ShortMemory<f64, M>, 32> = PRINTED.build(&TEN_KHZ).unwrap();
    let weights = |mu| GlWeights::new(mu, GlOrder::First).take(M + 1).collect::<Vec<f64>>();
    let (wa, wb) = (weights(PRINTED.alpha), weights(PRINTED.beta));
    let (pa, pb) = (libm::pow(p, PRINTED.alpha), libm::pow(p, PRINTED.beta));
    let ud: Vec<f64> = (0..u.len()).map(|k| u[k.saturating_sub(15)] - u[k]).collect();
    let (mut h, mut x): (Vec<f64>, Vec<f64>) = (Vec::new(), Vec::new());
    for n in 0..u.len() {
        let sum_u: f64 = (0..=M.min(n)).map(|k| wa[k] * ud[n - k]).sum();
        let sum_h: f64 = (1..=M.min(n)).map(|k| wb[k] * h[n - k]).sum();
        h.push(pb / (pb + PRINTED.c) * (PRINTED.a * ud[n] + PRINTED.b / pa * sum_u - PRINTED.c / pb * sum_h));
        x.push(h[n] + PRINTED.delta * u[n]);
    }
    assert!(max_difference(&run(&m, &u), &x) < 1e-11, "{}", max_difference(&run(&m, &u), &x));
}

/// Returns whether the impulse response of the inverse grows over `n` samples.
fn grows(m: &Ifm<f64, Exponentials<f64, 32>, 32>, n: usize) -> bool {
    let inverse = IfmInverse::unchecked(m.clone());
    let x: Vec<f64> = (0..n).map(|k| if k == 1 { 1.0 } else { 0.0 }).collect();
    let u = run(&inverse, &x);
    let peak = |u: &[f64]| u.iter().fold(0.0, |p: f64, u| p.at_least(u.abs()));
    // After an overflow the output is constant.
    let last = peak(&u[n - n / 4..]);
    last > peak(&u[n / 4..n / 2]) || last > 1e100
}

/// The smallest invertible Δ is that at which the inverse becomes unstable: 1.4 with the other published
/// parameters.
#[test]
fn a_model_is_invertible_if_its_inverse_is_bounded() {
    for order in [GlOrder::First, GlOrder::Second] {
        for tau in [0.0015, 0.00153, 0.0004] {
            let at = |delta: f64| -> Ifm<f64, Exponentials<f64, 32>, 32> {
                IfmParams { delta, order, tau, ..PRINTED }.build(&TEN_KHZ).unwrap()
            };
            assert!(at(1.7615).invert().is_ok() && !grows(&at(1.7615), 20_000));
            assert!(at(0.2).invert().is_err() && grows(&at(0.2), 20_000));
            let (mut no, mut yes) = (0.2, 1.7615);
            for _ in 0..20 {
                let delta = 0.5 * (no + yes);
                if at(delta).invert().is_ok() { yes = delta } else { no = delta }
            }
            assert!(tau < 0.001 || (yes - 1.4).abs() < 0.03, "{yes}");
            assert!(grows(&at(0.98 * yes), 20_000), "{order:?} {tau} {yes}");
            assert!(!grows(&at(1.02 * yes), 20_000), "{order:?} {tau} {yes}");
        }
    }
    let flat: Model<f64> = IfmParams { delta: 0.0, ..PRINTED }.build(&TEN_KHZ).unwrap();
    assert!(matches!(flat.invert(), Err(Error::NotInvertible(_))));
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    #[test]
    fn inverse_after_and_before_is_the_identity(
        (a, b, c) in (0.0..10.0f64, 0.0..10.0f64, 0.01..10.0f64),
        (alpha, beta) in (0.0..=1.0f64, 0.0..=1.0f64),
        share in 0.05..0.9f64,
        tau in 0.0..18e-3f64,
        order in order(),
        levels in prop::collection::vec(-3.0..3.0f64, 1..15),
        hertz in prop::collection::vec(0.001..0.4f64, 0..4),
    ) {
        let cx = Sampling { period: 1e-3 };
        let built = |delta| -> Ifm<f64, Exponentials<f64, 32>, 32> {
            IfmParams { a, b, c, alpha, beta, tau, delta, order }.build(&cx).unwrap()
        };
        // Δ is chosen so that the delayed part is `share` of it.
        let echo = built(0.0);
        let largest = (0..2000)
            .map(|i| echo.response(Complex::polar(1.0, -PI * f64::from(i) / 2000.0)).abs())
            .fold(0.01, f64::max);
        let m = built(largest / share);
        let inverse = m.invert().unwrap();
        let x = reference(&levels, &hertz);
        let u = run(&inverse, &x);
        let error = max_difference(&run(&m, &u), &x);
        prop_assert!(error <= 1e-9 * span(&x), "{error}");
        let x = run(&m, &levels.repeat(40));
        let error = max_difference(&run(&inverse, &x), &levels.repeat(40));
        prop_assert!(error <= 1e-9 * 6.0, "{error}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]
    /// Random parameters within the bounds of the paper, except where a change of Δ by 10 % changes the result.
    #[test]
    fn stability_test_is_right_for_random_parameters(
        (a, b, c) in (0.0..10.0f64, 0.0..10.0f64, 0.0..10.0f64),
        (alpha, beta) in (0.0..=1.0f64, 0.0..=1.0f64),
        delta in 0.01..10.0f64,
        tau in 0.0..28e-3f64,
        order in order(),
    ) {
        let built = |delta| -> Ifm<f64, Exponentials<f64, 32>, 32> {
            IfmParams { a, b, c, alpha, beta, tau, delta, order }.build(&Sampling { period: 1e-3 }).unwrap()
        };
        let m = built(delta);
        let stable = m.invert().is_ok();
        prop_assume!(stable == built(0.9 * delta).invert().is_ok() && stable == built(1.1 * delta).invert().is_ok());
        prop_assert_eq!(grows(&m, 40_000), !stable);
        if stable {
            let x = reference(&[1.0, 3.0, -2.0], &[0.013, 0.2]);
            let u = run(&m.invert().unwrap(), &x);
            let error = max_difference(&run(&m, &u), &x);
            prop_assert!(error <= 1e-9 * span(&x), "{error}");
        }
    }
}

#[test]
fn published_model_is_inverted_with_both_memories_and_precisions() {
    let x: Vec<f64> = (0..100_000).map(|k| 30.0 + 5.0 * five_sines(1e-4 * f64::from(k))).collect();
    for order in [GlOrder::First, GlOrder::Second] {
        let m = model::<f64>(order, 1e-4);
        let u = run(&m.invert().unwrap(), &x);
        assert!(max_difference(&run(&m, &u), &x) <= 1e-12 * span(&x) && span(&u) < span(&x));
        let short: Ifm<f64, ShortMemory<f64, 100>, 32> = IfmParams { order, ..PRINTED }.build(&TEN_KHZ).unwrap();
        assert!(max_difference(&run(&short, &run(&short.invert().unwrap(), &x)), &x) <= 1e-12 * span(&x));
        let narrow = model::<f32>(order, 1e-4);
        assert!(max_difference(&run(&narrow, &run(&narrow.invert().unwrap(), &x)), &x) <= 5e-7 * span(&x));
    }
}

#[test]
fn bounded_input_gives_bounded_output_over_1e6_samples() {
    for order in [GlOrder::First, GlOrder::Second] {
        let m = model::<f64>(order, 1e-4);
        // For inputs within ±1 the output is at most the sum of the absolute impulse response.
        let impulse: Vec<f64> = (0..200_000).map(|k| if k == 1 { 1.0 } else { 0.0 }).collect();
        let bound: f64 = run(&m, &impulse).iter().map(|x| x.abs()).sum();
        let (mut s, e) = (m.state(), Env::default());
        m.reset(&mut s, &e, 0.0);
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
        assert!(highest > 1.76 && highest < bound && bound < 10.0, "{highest} {bound}");
    }
}

#[test]
fn reset_is_a_fresh_state_settled_at_the_input() {
    let m = model::<f64>(GlOrder::First, 1e-4);
    let inverse = m.invert().unwrap();
    let (mut used, mut fresh, e) = (inverse.state(), inverse.state(), Env::default());
    drive(500).iter().for_each(|x| {
        inverse.step(&mut used, &e, *x);
    });
    let u0 = inverse.reset(&mut used, &e, 2.5);
    inverse.reset(&mut fresh, &e, 2.5);
    // The ring buffer of the delay may start at another place.
    for x in drive(300) {
        assert_eq!(inverse.step(&mut used, &e, x), inverse.step(&mut fresh, &e, x));
    }
    let mut s = m.state();
    assert!((m.reset(&mut s, &e, u0) - 2.5).abs() < 1e-15);
    for _ in 0..1000 {
        assert!((m.step(&mut s, &e, u0) - 2.5).abs() < 1e-15);
    }
}

#[test]
fn a_non_finite_sample_is_replaced_by_the_last_finite_one() {
    let m = model::<f64>(GlOrder::First, 1e-4);
    let inverse = m.invert().unwrap();
    let e = Env::default();
    let (mut a, mut b, mut c, mut d) = (m.state(), m.state(), inverse.state(), inverse.state());
    let mut held = 0.0;
    for (k, u) in drive(300).iter().enumerate() {
        let odd = [f64::NAN, f64::INFINITY, *u, *u][k % 4];
        held = if odd.is_finite() { *u } else { held };
        let probed = m.probe(&a, &e, odd);
        let stepped = m.step(&mut a, &e, odd);
        assert_eq!((probed, stepped), (stepped, m.step(&mut b, &e, held)));
        assert_eq!(inverse.step(&mut c, &e, odd), inverse.step(&mut d, &e, held));
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
        }
    }
}

#[test]
fn bad_parameters_are_named() {
    let named = |p: IfmParams| match p.build(&TEN_KHZ).map(|_: Model<f64>| ()) {
        Err(Error::OutOfRange { name, .. } | Error::NonFinite(name) | Error::Capacity { name, .. }) => name,
        _ => "",
    };
    assert_eq!(named(IfmParams { a: -1.0, ..PRINTED }), "ifm.a");
    assert_eq!(named(IfmParams { b: f64::NAN, ..PRINTED }), "ifm.b");
    assert_eq!(named(IfmParams { c: -1.0, ..PRINTED }), "ifm.c");
    assert_eq!(named(IfmParams { alpha: 1.01, ..PRINTED }), "ifm.alpha");
    assert_eq!(named(IfmParams { beta: -0.01, ..PRINTED }), "ifm.beta");
    assert_eq!(named(IfmParams { tau: -1e-3, ..PRINTED }), "ifm.tau");
    assert_eq!(named(IfmParams { tau: 1.0, ..PRINTED }), "ifm.tau samples");
    assert_eq!(named(IfmParams { delta: f64::INFINITY, ..PRINTED }), "ifm.delta");
}
