//! Tests of the Bouc-Wen oscillator.

use super::*;
use std::vec::Vec;

const RATE: Sampling = Sampling { period: 1.0 / 750.0 };
const NOMINAL: BoucWenOscillatorParams = BoucWenOscillatorParams::BENCHMARK;

fn env<T: Real>() -> Env<T> {
    Env::default()
}

fn built(p: BoucWenOscillatorParams) -> BoucWenOscillator<f64> {
    p.build(&RATE).unwrap()
}

/// Returns the drive of the benchmark, a multisine of 5–150 Hz and 50 N RMS.
fn force(k: usize) -> f64 {
    let t = k as f64 * RATE.period;
    (0..30).map(|i| libm::sin(31.4 * (1.0 + f64::from(i)) * t + f64::from(i * i))).sum::<f64>() * 50.0
        / libm::sqrt(15.0)
}

fn run(m: &BoucWenOscillator<f64>, u: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut s = m.state();
    m.reset(&mut s, &env(), 0.0);
    u.map(|u| m.step(&mut s, &env(), u)).collect()
}

#[test]
fn benchmark_has_the_stated_error() {
    let coarse = built(NOMINAL);
    let fine = BoucWenOscillator { substeps: 64 * coarse.substeps, substep: coarse.substep / 64.0, ..coarse };
    let (a, b) = (run(&coarse, (0..6000).map(force)), run(&fine, (0..6000).map(force)));
    let range = b.iter().fold(0.0f64, |m, y| m.max(y.abs()));
    let worst = a.iter().zip(&b).fold(0.0f64, |m, (a, b)| m.max((a - b).abs()));
    assert!((5e-4..5e-3).contains(&range), "{range}");
    assert!(worst < 2e-6 * range, "{:e}", worst / range);
}

#[test]
fn without_hysteresis_it_equals_the_linear_oscillator() {
    // α acts as a second spring: free decay of y(0) = 1 mm with m, c, k + α.
    let p = BoucWenOscillatorParams { beta: 0.0, ..NOMINAL };
    let m = built(p);
    let mut s = m.state();
    m.reset(&mut s, &env(), 100.0);
    assert!((s.motion.y - 1e-3).abs() < 1e-15);
    // The load falls to zero within the first sample. The ramp response is the integral of the step response.
    let (decay, omega) = (p.damping / (2.0 * p.mass), libm::sqrt(1e5 / 2.0 - 2.5 * 2.5));
    let h = RATE.period;
    let integral = |t: f64| {
        // ∫₀ᵗ e^(−dτ) (cos ωτ + (d/ω) sin ωτ) dτ, numerically.
        let n = 2000;
        let f = |x: f64| libm::exp(-decay * x) * (libm::cos(omega * x) + decay / omega * libm::sin(omega * x));
        (0..n).map(|i| f(t * (f64::from(i) + 0.5) / f64::from(n))).sum::<f64>() * t / f64::from(n)
    };
    for k in 1..40 {
        let y = m.step(&mut s, &env(), 0.0);
        let t = h * f64::from(k);
        let expected = 1e-3 * (integral(t) - integral(t - h)) / h;
        assert!((y - expected).abs() < 2e-9, "{k}: {y} {expected}");
    }
}

#[test]
fn slow_loading_ends_in_the_state_of_a_reset() {
    // Slow loading: the dynamic path follows the virgin curve.
    for p in [
        NOMINAL,
        BoucWenOscillatorParams { delta: 0.3, ..NOMINAL },
        BoucWenOscillatorParams { damping: 600.0, beta: 5.0, delta: 0.4, nu: 1.7, ..NOMINAL },
    ] {
        let m = built(BoucWenOscillatorParams { damping: 600.0, ..p });
        let reached = run(&m, (0..60_000).map(|k| -80.0 * (k as f64 / 50_000.0).min(1.0)));
        let mut s = m.state();
        let rest = m.reset(&mut s, &env(), -80.0);
        assert!((reached[59_999] / rest - 1.0).abs() < 1e-4, "{} {rest}", reached[59_999]);
        let held = (0..5000).map(|_| m.step(&mut s, &env(), -80.0)).last().unwrap();
        assert!((held / rest - 1.0).abs() < 1e-12, "{held} {rest}");
    }
}

#[test]
fn a_saturating_force_stays_within_its_bound() {
    let p = BoucWenOscillatorParams { delta: 0.3, ..NOMINAL };
    let bound = 5e4 / (1e3 * 1.1);
    let m = built(p);
    let mut s = m.state();
    for k in 0..1_000_000 {
        let y = m.step(&mut s, &env(), 4.0 * force(k));
        assert!(y.abs() < 0.05 && s.motion.z.abs() <= bound * 1.001, "{y} {}", s.motion.z);
    }
}

#[test]
fn hardening_benchmark_stays_bounded() {
    let m = built(NOMINAL);
    let mut s = m.state();
    for k in 0..300_000 {
        assert!(m.step(&mut s, &env(), 3.0 * force(k)).abs() < 0.02);
    }
}

#[test]
fn output_is_finite_for_any_input() {
    let m = built(NOMINAL);
    let mut s = m.state();
    for k in 0..2000 {
        let u = if k % 7 == 0 { 1e9 } else { -1e5 * f64::from(k) };
        assert!(m.step(&mut s, &env(), u).is_finite());
    }
    for bad in [f64::NAN, f64::INFINITY] {
        assert!(m.step(&mut s, &env(), bad).is_finite() && s.u.is_finite());
    }
    assert!(m.reset(&mut s, &env(), f64::NAN).is_finite());
}

#[test]
fn a_reset_clears_the_state() {
    let m = built(NOMINAL);
    let (mut used, mut fresh) = (m.state(), m.state());
    (0..500).for_each(|k| {
        m.step(&mut used, &env(), force(k));
    });
    assert_eq!(m.reset(&mut used, &env(), 30.0), m.reset(&mut fresh, &env(), 30.0));
    assert_eq!(used, fresh);
}

#[test]
fn single_precision_agrees() {
    let (double, single) = (built(NOMINAL), Build::<BoucWenOscillator<f32>>::build(&NOMINAL, &RATE).unwrap());
    let (mut s, mut t) = (double.state(), single.state());
    for k in 0..3000 {
        let u = force(k) as f32;
        let expected = double.step(&mut s, &env(), f64::from(u));
        let y = f64::from(single.step(&mut t, &env(), u));
        assert!((y - expected).abs() < 1e-6, "{y} {expected}");
    }
}

#[test]
fn a_slow_sample_rate_is_rejected() {
    let slow: Result<BoucWenOscillator<f64>, _> = NOMINAL.build(&Sampling { period: 0.1 });
    assert!(matches!(slow, Err(Error::OutOfRange { name: "sample period", .. })));
    let bad: Result<BoucWenOscillator<f64>, _> = BoucWenOscillatorParams { mass: 0.0, ..NOMINAL }.build(&RATE);
    assert!(matches!(bad, Err(Error::OutOfRange { name: "bouc-wen-oscillator.mass", .. })));
}
