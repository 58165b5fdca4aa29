//! Tests of viscous play operators: drag, rate dependence and the exact inverse.

use super::*;
use crate::{Invert, Pi};
use proptest::prelude::*;
use std::vec::Vec;

const PI: PiParams<[f64; 3]> = PiParams { gain: 0.1, thresholds: [5.0, 10.0, 20.0], weights: [0.02, 0.03, 0.01] };

fn model<T: Real>(seconds: f64, volt_seconds: f64, period: f64) -> ViscousPi<T, 3> {
    ViscousPiParams { pi: PI, seconds, volt_seconds }.build(&Sampling { period }).unwrap()
}

fn swing(k: u32) -> f64 {
    40.0 * libm::sin(0.21 * f64::from(k)) * libm::sin(0.013 * f64::from(k))
}

#[test]
fn without_drag_it_equals_the_ordinary_operator() {
    let (viscous, plain): (_, Pi<f64, 3>) = (model(0.0, 0.0, 1e-3), PI.build(&()).unwrap());
    let (mut a, mut b, e) = (viscous.state(), plain.state(), Env::default());
    for k in 0..1000 {
        assert!((viscous.step(&mut a, &e, swing(k)) - plain.step(&mut b, &e, swing(k))).abs() < 1e-13);
    }
}

/// Returns hashes of the bits of the outputs, and of the drives of the inverse, with J = 0.
fn bits<T: Real>() -> [u64; 2] {
    let mut sums = [0xcbf2_9ce4_8422_2325; 2];
    for seconds in [0.0, 2e-3, 0.03] {
        let model = model::<T>(seconds, 0.0, 1e-3);
        let inverse = model.invert().unwrap();
        let (mut a, mut b, e) = (model.state(), inverse.state(), Env::default());
        for k in 0..2000 {
            let (y, drive) = if k == 0 {
                (model.reset(&mut a, &e, T::from_f64(-30.0)), inverse.reset(&mut b, &e, T::from_f64(3.0)))
            } else {
                let u = swing(k);
                (model.step(&mut a, &e, T::from_f64(u)), inverse.step(&mut b, &e, T::from_f64(0.15 * u)))
            };
            for (sum, x) in sums.iter_mut().zip([y, drive]) {
                *sum = (*sum ^ x.to_f64().to_bits()).wrapping_mul(0x100_0000_01b3_u64);
            }
        }
    }
    sums
}

/// The hashes are those of the version before J was added.
#[test]
fn without_j_the_results_are_bit_identical_to_the_first_version() {
    assert_eq!(bits::<f32>(), [0xdd34_3a97_aa08_c7e5, 0x8699_b785_6a08_c7e5]);
    assert_eq!(bits::<f64>(), [0x749e_9aa5_3985_9006, 0x3a57_9134_c2af_43ee]);
}

/// The speed in a sample satisfies `(λ + h) v + √(J v) = o`.
#[test]
fn a_sample_satisfies_the_law() {
    let h = 1e-3;
    for (lambda, impulse) in [(0.0, 1e-9), (0.0, 0.3), (0.02, 1e-3), (0.5, 40.0), (1e-5, 1e-12)] {
        let drag = Drag::<f64>::new(lambda, impulse, h).unwrap();
        for overdrive in [1e-9, 1e-4, 0.7, 12.0, 3e4] {
            for o in [overdrive, -overdrive] {
                let (moved, slope) = drag.rooted(o);
                let v = moved.abs() / h;
                let solved = (lambda + h) * v + libm::sqrt(impulse * v);
                assert!((solved - overdrive).abs() < 1e-14 * overdrive, "{lambda} {impulse} {o}: {solved}");
                assert!(moved * o > 0.0, "moves towards the input");
                let step = 1e-4 * overdrive;
                let numeric = (drag.rooted(o + step).0 - drag.rooted(o - step).0) / (2.0 * step);
                assert!((slope - numeric).abs() < 1e-7 * slope, "{lambda} {impulse} {o}: {slope} {numeric}");
            }
        }
    }
}

/// On a ramp of rate v every sliding play lags by r + λ v + √(J v), at any sample period.
#[test]
fn lag_on_a_ramp_equals_the_drag() {
    let rate = 300.0;
    for (lambda, impulse) in [(0.02, 0.0), (0.0, 0.03), (0.01, 0.005)] {
        for h in [1e-4, 1e-2, 0.1] {
            let m = model::<f64>(lambda, impulse, h);
            let (mut s, e) = (m.state(), Env::default());
            let mut u = 0.0;
            let mut y = 0.0;
            for k in 0..(2.0 / h) as u32 {
                u = rate * h * f64::from(k);
                y = m.step(&mut s, &e, u);
            }
            let lag = lambda * rate + libm::sqrt(impulse * rate);
            let expected = 0.1 * u + PI.thresholds.iter().zip(PI.weights).map(|(r, w)| w * (u - r - lag)).sum::<f64>();
            assert!((y - expected).abs() < 1e-9, "{lambda} {impulse} {h}: {y} {expected}");
        }
    }
}

/// At four times the frequency the widening is four times as large with λ, and twice as large with J.
#[test]
fn loop_widens_with_the_rate_or_with_its_square_root() {
    let area = |m: &ViscousPi<f64, 3>, h: f64, hz: f64| {
        let (mut s, e) = (m.state(), Env::default());
        let mut area = 0.0;
        let samples = (1.0 / hz / h) as u32;
        let (mut y0, mut u0) = (0.0, 0.0);
        for k in 0..2 * samples {
            let u = 400.0 * libm::asin(libm::sin(core::f64::consts::TAU * hz * h * f64::from(k)));
            let y = m.step(&mut s, &e, u);
            if k >= samples {
                area += 0.5 * (y + y0) * (u - u0);
            }
            (y0, u0) = (y, u);
        }
        area.abs()
    };
    let h = 1e-4;
    let still = model(0.0, 0.0, h);
    let wider = |m: &ViscousPi<f64, 3>, hz| area(m, h, hz) - area(&still, h, hz);
    for (m, expected) in [(model(5e-4, 0.0, h), 4.0), (model(0.0, 2e-3, h), 2.0)] {
        let times = wider(&m, 4.0) / wider(&m, 1.0);
        assert!(wider(&m, 1.0) > 0.0 && (times - expected).abs() < 0.05 * expected, "{times} {expected}");
    }
}

/// Returns the largest error of the output of the operator after its inverse, in units of rounding: the precision of
/// the number type, times the parts of the output (positions and motions of the plays) and the steepest slope times the
/// input.
fn roundings<T: Real, const N: usize>(model: &ViscousPi<T, N>, references: &[f64]) -> f64 {
    let inverse = model.invert().unwrap();
    let (mut a, mut b, e) = (model.state(), inverse.state(), Env::default());
    let mut worst = 0.0f64;
    for (k, y) in references.iter().enumerate() {
        let y = T::from_f64(*y);
        let before = a.plays;
        let (drive, reached) = if k == 0 {
            let drive = inverse.reset(&mut b, &e, y);
            (drive, model.reset(&mut a, &e, drive))
        } else {
            let drive = inverse.step(&mut b, &e, y);
            (drive, model.step(&mut a, &e, drive))
        };
        let plays = before.iter().zip(&a.plays).zip(&model.weights);
        let scale = plays.fold(model.gain * drive.abs(), |sum, ((p, now), w)| {
            sum + w.abs() * (p.abs() + (*now - *p).abs() + drive.abs())
        });
        let error = (reached - y).abs().to_f64();
        worst = worst.max(error / (T::EPSILON * scale).to_f64().max(f64::MIN_POSITIVE));
    }
    worst
}

proptest! {
    #[test]
    fn inverse_reaches_every_reference(
        gain in 0.02..2.0f64,
        steps in prop::collection::vec((0.01..5.0f64, 0.0..1.0f64), 16),
        seconds in prop_oneof![Just(0.0), 0.0..0.05f64],
        volt_seconds in prop_oneof![Just(0.0), (-12.0..3.0f64).prop_map(libm::exp10)],
        references in prop::collection::vec(-30.0..30.0f64, 50..300),
    ) {
        let mut at = 0.0;
        let mut pi = PiParams { gain, thresholds: [0.0; 16], weights: [0.0; 16] };
        for ((r, w), (d, x)) in pi.thresholds.iter_mut().zip(&mut pi.weights).zip(&steps) {
            at += d;
            (*r, *w) = (at, *x);
        }
        let params = ViscousPiParams { pi, seconds, volt_seconds };
        let (double, single): (ViscousPi<f64, 16>, ViscousPi<f32, 16>) =
            (params.build(&Sampling { period: 1e-3 }).unwrap(), params.build(&Sampling { period: 1e-3 }).unwrap());
        let inverse = double.invert().unwrap();
        let (mut a, mut b, e) = (double.state(), inverse.state(), Env::default());
        let first = inverse.reset(&mut b, &e, references[0]);
        prop_assert!((double.reset(&mut a, &e, first) - references[0]).abs() < 60.0 * 1e-12);
        for y in &references {
            let drive = inverse.step(&mut b, &e, *y);
            prop_assert!((double.step(&mut a, &e, drive) - y).abs() < 60.0 * 1e-12);
        }
        if volt_seconds > 0.0 {
            let (of_double, of_single) = (roundings(&double, &references), roundings(&single, &references));
            prop_assert!(of_double < 6.0 && of_single < 6.0, "{of_double} {of_single}");
        }
    }

    /// Weights of either sign, a first slope much smaller than the others, overdrives of any size.
    #[test]
    fn inverse_reaches_every_reference_of_ill_conditioned_operators(
        gain in (-6.0..0.0f64).prop_map(libm::exp10),
        steps in prop::collection::vec(((-6.0..1.0f64).prop_map(libm::exp10), -1.0..1.0f64), 1..12),
        seconds in prop_oneof![Just(0.0), 0.0..0.05f64],
        volt_seconds in (-20.0..6.0f64).prop_map(libm::exp10),
        sizes in prop::collection::vec((-8.0..3.0f64, any::<bool>()), 50..200),
    ) {
        let (mut at, mut slope, mut thresholds, mut weights) = (0.0, gain, Vec::new(), Vec::new());
        for (d, w) in &steps {
            at += d;
            // The slope is at least a tenth of the gain.
            let w = if slope + w < 0.1 * gain { -w } else { *w };
            slope += w;
            thresholds.push(at);
            weights.push(w);
        }
        let params = ViscousPiParams { pi: PiParams { gain, thresholds, weights }, seconds, volt_seconds };
        let model: ViscousPi<f64, 12> = params.build(&Sampling { period: 1e-3 }).unwrap();
        let references: Vec<f64> =
            sizes.iter().map(|(size, up)| libm::exp10(*size) * if *up { 1.0 } else { -1.0 }).collect();
        let worst = roundings(&model, &references);
        prop_assert!(worst < 6.0, "{worst}");
    }

    /// For any history, the output rises with the present input.
    #[test]
    fn output_rises_with_the_present_input(
        seconds in 0.0..0.05f64,
        volt_seconds in (-9.0..2.0f64).prop_map(libm::exp10),
        before in prop::collection::vec(-60.0..60.0f64, 0..50),
        now in prop::collection::vec(-100.0..100.0f64, 2..20),
    ) {
        let m = model::<f64>(seconds, volt_seconds, 1e-3);
        let (mut s, e) = (m.state(), Env::default());
        for u in &before {
            m.step(&mut s, &e, *u);
        }
        let mut now = now;
        now.sort_by(f64::total_cmp);
        let outputs: Vec<f64> = now.iter().map(|u| m.step(&mut s.clone(), &e, *u)).collect();
        for (u, y) in now.windows(2).zip(outputs.windows(2)) {
            // By at least the gain.
            prop_assert!(y[1] - y[0] >= 0.1 * (u[1] - u[0]) - 1e-13, "{u:?} {y:?}");
        }
    }
}

#[test]
fn inputs_that_overflow_terminate_and_a_reset_clears_them() {
    fn run<T: Real>(largest: f64) {
        let m = model::<T>(0.0, 0.01, 1e-3);
        let inverse = m.invert().unwrap();
        let (mut a, mut b, e) = (m.state(), inverse.state(), Env::default());
        for scale in [largest, 0.5 * largest, 1e-3 * largest, 1.0 / largest] {
            for sign in [1.0, -1.0, -1.0, 1.0] {
                let x = T::from_f64(sign * scale);
                m.step(&mut a, &e, x);
                inverse.step(&mut b, &e, x);
            }
        }
        let first = inverse.reset(&mut b, &e, T::ONE);
        let error = m.reset(&mut a, &e, first) - T::ONE;
        assert!(error.abs() <= T::from_f64(4.0) * T::EPSILON);
        let drive = inverse.step(&mut b, &e, T::from_f64(2.0));
        assert!((m.step(&mut a, &e, drive) - T::from_f64(2.0)).abs() <= T::from_f64(8.0) * T::EPSILON);
    }
    run::<f32>(f64::from(f32::MAX));
    run::<f64>(f64::MAX);
}

#[test]
fn invalid_drag_is_rejected() {
    let build = |seconds, volt_seconds| -> Result<ViscousPi<f32, 3>, Error> {
        ViscousPiParams { pi: PI, seconds, volt_seconds }.build(&Sampling { period: 1e-3 })
    };
    let named = |name| Err(Error::OutOfRange { name, must: "zero or positive" });
    assert_eq!(build(-1e-3, 0.0), named("rate-dependence.seconds"));
    assert_eq!(build(0.0, -1e-3), named("rate-dependence.volt_seconds"));
    assert_eq!(build(0.0, f64::NAN), Err(Error::NonFinite("rate-dependence.volt_seconds")));
    assert_eq!(build(0.0, f64::MAX), Err(Error::NonFinite("rate-dependence.volt_seconds")));
}
