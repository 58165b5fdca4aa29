//! Tests of the Bouc-Wen operator.

use super::*;
use std::vec::Vec;

const PRINTED: BoucWenClassicParams = BoucWenClassicParams::PRINTED;

fn env() -> Env<f64> {
    Env::default()
}

fn built(p: BoucWenParams) -> BoucWen<f64> {
    p.build(&()).unwrap()
}

/// Integrates eq. 18 of Zhu et al. as published, with `parts` Heun steps per sample.
fn classic(p: &BoucWenClassicParams, u: &[f64], parts: usize) -> Vec<f64> {
    let (mut h, mut at) = (0.0f64, 0.0f64);
    u.iter()
        .map(|to| {
            let du = (to - at) / parts as f64;
            let slope = |h: f64| p.a * du - p.b * du.abs() * h - p.gamma * du * h.abs();
            for _ in 0..parts {
                let first = slope(h);
                h += 0.5 * (first + slope(h + first));
            }
            at = *to;
            p.d * to - h
        })
        .collect()
}

/// Integrates eq. 6 and 7 of Xie et al. as published, in the same way.
fn general(p: &BoucWenParams, u: &[f64], parts: usize) -> Vec<f64> {
    let (mut g, mut at) = (0.0f64, 0.0f64);
    u.iter()
        .map(|to| {
            let du = (to - at) / parts as f64;
            let slope = |g: f64| {
                p.alpha * du
                    - p.beta * du.abs() * libm::pow(g.abs(), p.n - 1.0) * g
                    - p.gamma * du * libm::pow(g.abs(), p.n)
            };
            for _ in 0..parts {
                let first = slope(g);
                g += 0.5 * (first + slope(g + first));
            }
            at = *to;
            p.k0 * to + g
        })
        .collect()
}

fn run(m: &BoucWen<f64>, u: &[f64]) -> Vec<f64> {
    let mut s = m.state();
    u.iter().map(|u| m.step(&mut s, &env(), *u)).collect()
}

/// Minor loops inside major loops, and jumps between small steps.
fn drive(k: usize) -> f64 {
    let t = k as f64;
    2.0 * libm::sin(0.11 * t) + 0.8 * libm::sin(0.83 * t) + if k.is_multiple_of(17) { 1.5 } else { 0.0 }
}

#[test]
fn operator_agrees_with_the_published_equation_of_zhu() {
    let u: Vec<f64> = (0..150).map(drive).collect();
    for p in [PRINTED, BoucWenClassicParams { gamma: -0.9, ..PRINTED }, BoucWenClassicParams { gamma: 1.2, ..PRINTED }]
    {
        let y = run(&p.build(&()).unwrap(), &u);
        for (y, expected) in y.iter().zip(classic(&p, &u, 2000)) {
            assert!((y - expected).abs() < 1e-6, "Γ = {}: {y} {expected}", p.gamma);
        }
    }
}

#[test]
fn operator_agrees_with_the_published_equation_of_xie() {
    let u: Vec<f64> = (0..150).map(drive).collect();
    for alpha in [0.7, -0.7] {
        for n in [1.0, 1.4, 2.0, 3.0] {
            for gamma in [-0.6, 0.0, 0.5, 1.1] {
                let p = BoucWenParams { k0: 0.4, alpha, beta: 1.1, gamma, n };
                let y = run(&built(p), &u);
                for (y, expected) in y.iter().zip(general(&p, &u, 3000)) {
                    assert!((y - expected).abs() < 4e-6, "α = {alpha}, γ = {gamma}, n = {n}: {y} {expected}");
                }
            }
        }
    }
}

#[test]
fn branches_of_the_published_parameters_fold() {
    let m: BoucWen<f64> = PRINTED.build(&()).unwrap();
    assert!(!m.rises());
    assert!((m.bound() - 0.971 / 1.486).abs() < 1e-6);
    assert!((m.slopes().0 - (1.910 - 2.0 * 0.971)).abs() < 1e-6);
    assert!((m.rises_within() - (1.910 - 0.971) / 1.486).abs() < 1e-6, "{}", m.rises_within());
    // A step back from saturation first raises the output. A step back from inside the limit does not.
    let mut s = m.state();
    let top = m.reset(&mut s, &env(), 50.0);
    assert!(m.probe(&s, &env(), 50.0 - 1e-3) > top);
    let mut s = m.state();
    let inside = m.reset(&mut s, &env(), 2.2);
    assert!(1.910 * 2.2 - inside < m.rises_within());
    assert!(m.probe(&s, &env(), 2.2 - 1e-3) < inside);
    // With 2A < d no branch folds.
    let steeper: BoucWen<f64> = BoucWenClassicParams { d: 1.95, ..PRINTED }.build(&()).unwrap();
    assert!(steeper.rises() && steeper.rises_within() == steeper.bound());
}

#[test]
fn slopes_are_the_extremes_that_occur() {
    for alpha in [0.6, -0.6] {
        for n in [1.0, 1.5, 2.0, 4.0] {
            let m = built(BoucWenParams { k0: 1.0, alpha, beta: 0.8, gamma: 0.3, n });
            let (least, greatest) = m.slopes();
            let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
            let mut s = m.state();
            for u in [30.0, -30.0, 30.0] {
                let from = s.u;
                let mut last = m.step(&mut s, &env(), from);
                for k in 1..=200_000 {
                    let to = from + (u - from) * f64::from(k) / 200_000.0;
                    let before = s.u;
                    let y = m.step(&mut s, &env(), to);
                    let slope = (y - last) / (to - before);
                    (low, high, last) = (low.min(slope), high.max(slope), y);
                }
            }
            assert!((low - least).abs() < 2e-3 && (high - greatest).abs() < 2e-3, "{low} {least} {high} {greatest}");
            assert!(low > least - 1e-9 && high < greatest + 1e-9);
        }
    }
}

#[test]
fn a_million_samples_stay_bounded() {
    for n in [1.0, 2.0, 2.7] {
        let m = built(BoucWenParams { k0: 0.1, alpha: 0.05, beta: 0.3, gamma: 0.1, n });
        let mut s = m.state();
        for k in 0..1_000_000 {
            let u = drive(k);
            assert!((m.step(&mut s, &env(), u) - 0.1 * u).abs() <= m.bound() * (1.0 + 1e-12));
        }
    }
}

#[test]
fn a_reset_clears_the_state() {
    let m = built(BoucWenParams { k0: 0.1, alpha: 0.05, beta: 0.3, gamma: 0.1, n: 1.7 });
    let (mut used, mut fresh) = (m.state(), m.state());
    (0..500).for_each(|k| {
        m.step(&mut used, &env(), drive(k));
    });
    assert_eq!(m.reset(&mut used, &env(), 1.25), m.reset(&mut fresh, &env(), 1.25));
    assert_eq!(used, fresh);
}

#[test]
fn a_non_finite_input_does_not_change_the_state() {
    let m = built(BoucWenParams { k0: 0.1, alpha: 0.05, beta: 0.3, gamma: 0.1, n: 1.7 });
    let mut s = m.state();
    let y = m.step(&mut s, &env(), 2.0);
    for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        assert_eq!(m.step(&mut s, &env(), bad), y);
        assert_eq!(m.probe(&s, &env(), bad), y);
    }
}

#[test]
fn degenerate_parameters_are_linear() {
    for (alpha, beta, gamma, slope) in [(0.0, 0.0, 0.0, 0.3), (0.0, 1.0, 0.5, 0.3), (0.2, 0.0, 0.0, 0.5)] {
        for n in [1.0, 2.0, 3.3] {
            let m = built(BoucWenParams { k0: 0.3, alpha, beta, gamma, n });
            assert!(m.rises());
            for (u, y) in [4.0, -3.0, 1.0, 1e6].iter().zip(run(&m, &[4.0, -3.0, 1.0, 1e6])) {
                assert!((y - slope * u).abs() <= 1e-12 * u.abs());
            }
        }
    }
}

#[test]
fn bad_parameters_are_named() {
    let good = BoucWenParams { k0: 0.3, alpha: 0.1, beta: 0.5, gamma: 0.2, n: 1.0 };
    let error = |p: BoucWenParams| Build::<BoucWen<f64>>::build(&p, &()).unwrap_err();
    assert_eq!(error(BoucWenParams { k0: f64::NAN, ..good }), Error::NonFinite("bouc-wen.k0"));
    for (p, field) in [
        (BoucWenParams { beta: -0.1, ..good }, "bouc-wen.beta"),
        (BoucWenParams { gamma: 0.6, ..good }, "bouc-wen.gamma"),
        (BoucWenParams { n: 0.9, ..good }, "bouc-wen.n"),
    ] {
        assert!(matches!(error(p), Error::OutOfRange { name, .. } if name == field));
    }
    let classic: Result<BoucWen<f64>, _> = BoucWenClassicParams { gamma: 2.0, ..PRINTED }.build(&());
    assert!(matches!(classic, Err(Error::OutOfRange { name: "bouc-wen.gamma", .. })));
    let flat = built(BoucWenParams { k0: 0.0, ..good });
    assert!(matches!(flat.inverse(-1.0, 1.0, 1e-9), Err(Error::NotInvertible(_))));
}
