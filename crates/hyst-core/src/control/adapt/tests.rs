//! Tests of the adaptation: actuators that differ from their model in gain, loop width and zero.

use super::*;
use crate::{Env, Pi, Stage};
use proptest::prelude::*;

const N: usize = 4;
const M: usize = N + 2;
type How = Adaptation<f64, N, M>;

fn how() -> How {
    Adaptation::new((2.0, 22.0), &AdaptationOptions { sigma: 1e-3, ..AdaptationOptions::default() }).unwrap()
}

/// Loops of several sizes within 2 … 22.
fn motion(k: usize) -> f64 {
    let t = k as f64 * 1e-3;
    12.0 + 6.0 * (3.1 * t).sin() + 2.5 * (8.3 * t).sin() + 1.0 * (23.0 * t).sin()
}

/// A changed actuator as a map of the predicted output: a gain, a wider loop with other thresholds than the
/// estimator's, and a zero.
fn changed_actuator() -> (Pi<f64, 2>, f64) {
    (Pi::new(0.93, &[1.0, 3.0], &[0.03, 0.02]).unwrap(), 0.2)
}

/// Returns the maximum error of the last 10 s of a minute.
fn error(adapts: bool) -> (f64, Adapted<f64, N, M>) {
    let (how, (actuator, zero)) = (how(), changed_actuator());
    let mut s = how.begin();
    let (mut memory, mut largest) = (actuator.state(), 0.0f64);
    for k in 0..60_000 {
        let reference = motion(k);
        let aimed = how.aim(&mut s, reference);
        let y = actuator.step(&mut memory, &Env::default(), aimed) + zero;
        how.learn(&mut s, aimed, y, adapts);
        if k >= 50_000 {
            largest = largest.max((y - reference).abs());
        }
    }
    (largest, s)
}

#[test]
fn adaptation_reduces_the_error_of_a_changed_actuator() {
    let ((before, _), (after, s)) = (error(false), error(true));
    assert!(before > 0.3 && after < 0.1 * before, "{before} → {after}: {s:?}");
    let how = how();
    assert!((s.stroke_gain(&how) - 0.97).abs() < 0.02, "{}", s.stroke_gain(&how));
    assert!(s.loop_width(&how) > 0.0);
}

#[test]
fn rest_and_untrusted_measurements_cause_no_update() {
    let how = how();
    let mut s = how.begin();
    for k in 0..100_000u32 {
        assert!(!how.learn(&mut s, 7.0, 7.5 + 0.1 * f64::from(k % 7), true));
    }
    for k in 0..10_000 {
        assert!(!how.learn(&mut s, motion(k), 1.2 * motion(k), false));
        assert!(!how.learn(&mut s, motion(k), f64::NAN, true));
    }
    assert_eq!((s.gain(), s.weights(), s.zero(), s.updates()), (1.0, &[0.0; N][..], 0.0, 0));
    assert_eq!(how.aim(&mut s, 9.25), 9.25);
}

#[test]
fn aim_is_the_inverse_of_the_estimated_operator() {
    let how = how();
    let mut s = how.begin();
    s.numbers = [0.95, 0.05, -0.04, 0.03, 0.02, 0.01];
    let mut plays: Option<[f64; N]> = None;
    for k in 0..5000 {
        let r = motion(7 * k);
        let v = (how.aim(&mut s, r) - how.low) / how.span;
        let mut p = plays.unwrap_or([(r - how.low) / how.span; N]);
        how.move_plays(&mut p, v);
        plays = Some(p);
        let y = p.iter().zip(s.weights()).fold(s.zero() + s.gain() * v, |sum, (p, w)| sum + w * p);
        assert!((how.low + how.span * y - r).abs() < 1e-9, "row {k}: {y}");
    }
}

#[test]
fn options_out_of_range_are_rejected() {
    let of = |range, options: AdaptationOptions| Adaptation::<f64, N, M>::new(range, &options).unwrap_err();
    let valid = AdaptationOptions::default();
    assert!(matches!(Adaptation::<f64, N, 5>::new((0.0, 1.0), &valid), Err(Error::Capacity { needed: 6, .. })));
    for range in [(1.0, 1.0), (0.0, f64::NAN), (f64::NEG_INFINITY, 1.0)] {
        let error = of(range, valid);
        assert!(
            matches!(error, Error::OutOfRange { name: "adaptation range", .. } | Error::NonFinite("adaptation range")),
            "{range:?}: {error}"
        );
    }
    for options in [
        AdaptationOptions { sigma: 0.0, ..valid },
        AdaptationOptions { gain: 0.6, ..valid },
        AdaptationOptions { zero: f64::NAN, ..valid },
        AdaptationOptions { correction: -0.1, ..valid },
        AdaptationOptions { memory: 1e5, ..valid },
    ] {
        let error = of((0.0, 1.0), options);
        assert!(matches!(error, Error::OutOfRange { .. } | Error::NonFinite(_)), "{options:?}: {error}");
    }
}

#[test]
fn begin_at_takes_earlier_coefficients() {
    let how = how();
    let (_, learned) = error(true);
    let again = how.begin_at(*learned.numbers());
    assert_eq!((again.numbers(), again.updates()), (learned.numbers(), 0));
    assert_eq!(how.begin_at([f64::NAN; M]), how.begin());
    // Values beyond a bound are set to the bound.
    let mut far = how.begin_at([9.0; M]);
    assert_eq!(far.numbers(), &[1.2, 0.2, 0.2, 0.2, 0.2, 0.05]);
    how.set_zero(&mut far, -0.4);
    assert_eq!(far.zero(), -0.02);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]
    #[test]
    fn the_coefficients_remain_within_their_bounds_for_any_measurement(
        rows in proptest::collection::vec(
            (-1e2..1e2f64, prop_oneof![-1e3..1e3f64, Just(f64::NAN), Just(f64::INFINITY)], any::<bool>()), 1..400),
        memory in 0.1..100.0f64,
        sigma in 1e-6..0.1f64,
    ) {
        let options = AdaptationOptions { sigma, memory, ..AdaptationOptions::default() };
        let how = How::new((2.0, 22.0), &options).unwrap();
        let mut s = how.begin();
        for (k, (arbitrary, measured, trusted)) in rows.iter().enumerate() {
            let v = if k % 5 == 0 { *arbitrary } else { motion(97 * k) };
            how.learn(&mut s, v, *measured, *trusted);
            let middle = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
            for ((number, middle), bound) in s.numbers.iter().zip(middle).zip(how.bounds()) {
                prop_assert!((number - middle).abs() <= bound * (1.0 + 1e-12), "{:?}", s.numbers);
            }
            let mut slope = 0.0;
            for w in &s.numbers[..=N] {
                slope += w;
                prop_assert!(slope >= 0.4 - 1e-12);
            }
            let aimed = how.aim(&mut s, motion(31 * k));
            prop_assert!((aimed - motion(31 * k)).abs() <= how.largest_correction() * (1.0 + 1e-9));
        }
    }
}
