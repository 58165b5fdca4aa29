//! Tests of operator and inverse on random models.

use crate::{BoucWen, BoucWenClassicParams, BoucWenParams, Build, Env, Stage};
use proptest::prelude::*;

fn env() -> Env<f64> {
    Env::default()
}

fn built(p: BoucWenParams) -> BoucWen<f64> {
    p.build(&()).unwrap()
}

/// Generates valid parameters. Drives over ±10 range from the linear part to deep saturation. Branches fold if
/// `fold` > 1.
fn parameters() -> impl Strategy<Value = (BoucWenParams, bool)> {
    let n = prop_oneof![Just(1.0), Just(2.0), 1.0..6.0f64];
    (n, 0.05..3.0f64, 0.01..2.0f64, -0.95..0.99f64, any::<bool>(), 0.02..1.8f64).prop_map(
        |(n, alpha, beta, ratio, negative, fold)| {
            let gamma = beta * ratio;
            if negative {
                // The minimum slope is k₀ − worst.
                let worst = 2.0 * alpha * beta / (beta - gamma);
                let p = BoucWenParams { k0: worst / fold, alpha: -alpha, beta, gamma, n };
                (p, fold > 1.0)
            } else {
                (BoucWenParams { k0: 0.05 + fold, alpha, beta, gamma, n }, false)
            }
        },
    )
}

/// Returns random jumps, sums of sines, or minor loops on a slow sweep.
fn shape(kind: u8, k: usize, random: f64) -> f64 {
    let t = k as f64;
    match kind {
        0 => random,
        1 => (libm::sin(0.05 * t) + libm::sin(0.171 * t) + libm::sin(0.61 * t)) / 3.0,
        _ => libm::sin(0.02 * t) * 0.7 + if k % 12 < 6 { 0.05 } else { -0.05 } * (k % 6) as f64,
    }
}

proptest! {
    #[test]
    fn every_reference_is_reached_with_and_without_folds(
        (p, folds) in parameters(), kind in 0..3u8, random in prop::collection::vec(-1.0..1.0f64, 150),
    ) {
        let m = built(p);
        prop_assert_eq!(m.rises(), !folds);
        let tolerance = 1e-12;
        // An output of 8 k₀ needs an input of at most 8 + g∞/k₀, plus the width of a fold.
        let reach = 10.0 + 3.0 * m.bound() / p.k0;
        let inverse = m.inverse(-reach, reach, tolerance).unwrap();
        let (mut s, mut i) = (m.state(), inverse.state());
        m.reset(&mut s, &env(), 0.0);
        inverse.reset(&mut i, &env(), 0.0);
        let steepest = m.slopes().1.max(-m.slopes().0);
        for (k, r) in random.iter().enumerate() {
            let reference = 8.0 * p.k0 * shape(kind, k, *r);
            let drive = inverse.step(&mut i, &env(), reference);
            let reached = m.step(&mut s, &env(), drive);
            // The tolerance of the search and the rounding of the terms.
            let allowed = steepest * (tolerance + 8.0 * f64::EPSILON * reach);
            prop_assert!((reached - reference).abs() <= allowed, "{reached} {reference} {allowed}");
        }
    }

    /// If every branch rises, the drive is recovered from the output.
    #[test]
    fn without_folds_the_drive_is_recovered((p, _) in parameters(), u in prop::collection::vec(-10.0..10.0f64, 100)) {
        let p = if p.alpha < 0.0 { BoucWenParams { k0: 2.5 * p.k0, ..p } } else { p };
        let m = built(p);
        prop_assert!(m.rises());
        let inverse = m.inverse(-20.0, 20.0, 1e-13).unwrap();
        let (mut s, mut i) = (m.state(), inverse.state());
        m.reset(&mut s, &env(), 0.0);
        inverse.reset(&mut i, &env(), 0.0);
        for u in &u {
            let y = m.step(&mut s, &env(), *u);
            let allowed = 2e-12 * m.slopes().1 / m.slopes().0;
            prop_assert!((inverse.step(&mut i, &env(), y) - u).abs() < allowed);
        }
    }

    #[test]
    fn memory_stays_within_its_bound(
        (p, _) in parameters(), u in prop::collection::vec(prop_oneof![-1e3..1e3f64, -1e-3..1e-3f64, -1e300..1e300f64], 200),
    ) {
        let m = built(p);
        let mut s = m.state();
        for u in &u {
            let memory = m.step(&mut s, &env(), *u) - p.k0 * u;
            // At a large input the difference of y and k₀ u has a rounding error.
            let rounding = 4.0 * f64::EPSILON * p.k0 * u.abs();
            prop_assert!(memory.is_finite());
            prop_assert!(memory.abs() <= m.bound() * (1.0 + 1e-14) + rounding);
        }
    }

    #[test]
    fn single_precision_agrees((p, _) in parameters(), u in prop::collection::vec(-10.0..10.0f64, 100)) {
        let (double, single) = (built(p), Build::<BoucWen<f32>>::build(&p, &()).unwrap());
        let (mut s, mut t) = (double.state(), single.state());
        for u in &u {
            // The same input for both, so reversals are equal.
            let u = *u as f32;
            let expected = double.step(&mut s, &env(), f64::from(u));
            let y = f64::from(single.step(&mut t, &Env::default(), u));
            let size = p.k0 * 10.0 + double.bound();
            prop_assert!((y - expected).abs() < 2e-4 * size, "{y} {expected}");
        }
    }
}

/// Published parameters of Zhu et al.: at a reversal from saturation the drive jumps by 0.022 over the fold, and the
/// output is reached.
#[test]
fn drive_jumps_over_the_fold_of_the_published_parameters() {
    let p = BoucWenClassicParams { d: 1.910, a: 0.971, b: 1.486, gamma: 1.97e-7 };
    let m: BoucWen<f64> = p.build(&()).unwrap();
    let inverse = m.inverse(-20.0, 20.0, 1e-12).unwrap();
    let (mut s, mut i) = (m.state(), inverse.state());
    let mut last = inverse.reset(&mut i, &env(), 18.0);
    m.reset(&mut s, &env(), last);
    let mut largest = 0.0f64;
    for k in 0..4000 {
        // Down and up in steps of 0.01, with minor loops.
        let reference = 18.0 - 9.0 * (1.0 - libm::cos(0.003 * f64::from(k))) + 0.4 * libm::sin(0.05 * f64::from(k));
        let drive = inverse.step(&mut i, &env(), reference);
        let reached = m.step(&mut s, &env(), drive);
        assert!((reached - reference).abs() < 1e-11, "{reached} {reference}");
        largest = largest.max((drive - last).abs());
        last = drive;
    }
    // The steepest part of the reference alone gives a step of 0.025.
    assert!((0.022..0.05).contains(&largest), "{largest}");
    // The smallest step back from saturation is the root of d s = (2A/B) (1 − e^(−B s)), without Γ.
    let at = inverse.reset(&mut i, &env(), 18.0);
    let back = at - inverse.step(&mut i, &env(), 18.0 - 1e-9);
    let fold = |s: f64| p.d * s - 2.0 * p.a / p.b * -libm::expm1(-p.b * s);
    assert!((0.02..0.025).contains(&back) && fold(back).abs() < 1e-6, "{back} {}", fold(back));
    // For the output of a drive inside the fold, the inverse finds another drive.
    m.reset(&mut s, &env(), at);
    let inside = m.step(&mut s, &env(), at - 0.01);
    inverse.reset(&mut i, &env(), 18.0);
    assert!((inverse.step(&mut i, &env(), inside) - (at - 0.01)).abs() > 0.01);
}
