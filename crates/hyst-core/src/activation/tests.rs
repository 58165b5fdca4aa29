//! Tests of the anti-causal inverse on published and random models.

use super::published;
use crate::{Activation, ActivationKind, ActivationParams, AntiCausal, Build, Env, Error, Invert, Sampling, Stage};
use core::f64::consts::{FRAC_PI_2, TAU};
use proptest::prelude::*;
use std::boxed::Box;
use std::vec;
use std::vec::Vec;

type Inverse = AntiCausal<f64, 1024>;

fn env() -> Env<f64> {
    Env::default()
}

fn built(kind: ActivationKind, p: ActivationParams, h: f64) -> Activation<f64> {
    (kind, p).build(&Sampling { period: h }).unwrap()
}

/// Returns the outputs of the model for a drive, from rest at its first sample.
fn run(m: &Activation<f64>, drive: &[f64]) -> Vec<f64> {
    let mut s = m.state();
    m.reset(&mut s, &env(), drive[0]);
    drive.iter().map(|u| m.step(&mut s, &env(), *u)).collect()
}

/// Returns the drive sample by sample, without its end, for which there is no preview.
fn stream(inverse: &Inverse, reference: &[f64]) -> Vec<f64> {
    let mut s = Box::new(inverse.state());
    let first = inverse.reset(&mut s, &env(), reference[0]);
    assert_eq!(inverse.reset(&mut s, &env(), reference[0]), first);
    let drive = reference.iter().skip(1).map(|z| inverse.step(&mut s, &env(), *z));
    drive.skip(inverse.lead() - 1).collect()
}

/// Returns the largest difference, without the first sample, at which the reference starts to move.
fn worst(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).skip(1).fold(0.0, |m, (a, b)| f64::max(m, (a - b).abs()))
}

fn largest_step(drive: &[f64]) -> f64 {
    drive.windows(2).fold(0.0, |m, w| f64::max(m, (w[1] - w[0]).abs()))
}

/// Returns the drive of the paper, 20 V about `middle`.
fn sine(hz: f64, middle: f64, h: f64) -> Vec<f64> {
    (0..(0.35 / h) as usize).map(|k| 20.0 * libm::sin(TAU * hz * h * k as f64 - FRAC_PI_2) + middle).collect()
}

/// Each set has one of the two inverses at each rate. This one reaches the outputs of 0–40 V (touches the switching
/// range once per period), ±20 V (crosses it) and 5–45 V (never enters it) to the stated tolerance.
#[test]
fn published_sets_are_inverted_to_the_stated_tolerance() {
    let (mut backwards, mut forwards, mut drives) = (0, 0, 0);
    for h in [1e-3, 1e-4] {
        for (kind, hz, p) in published::all() {
            let m = built(kind, p, h);
            for tolerance in [1e-9, 1e-6, 1e-3] {
                let inverse: Inverse = match m.anti_causal(tolerance) {
                    Ok(inverse) => inverse,
                    Err(error) => {
                        assert!(matches!(error, Error::NotInvertible(_)) && m.invert().is_ok(), "{error}");
                        forwards += 1;
                        continue;
                    }
                };
                assert!(m.invert().is_err());
                backwards += 1;
                for middle in [0.0, 20.0, 25.0] {
                    // Nothing is claimed if the drive returns to the switching range before the plans have met.
                    let between = if middle == 0.0 { 0.5 } else { 1.0 } / (hz * h);
                    if middle < 25.0 && inverse.switching() > 0.0 && between < 0.5 * inverse.lead() as f64 {
                        continue;
                    }
                    drives += 1;
                    let drive = sine(hz, middle, h);
                    let reference = run(&m, &drive);
                    let reached = run(&m, &stream(&inverse, &reference));
                    let dynamic = -m.rate * largest_step(&drive);
                    let error = worst(&reached, &reference) / dynamic;
                    // 1e-13 is for rounding, which includes 1/a.
                    assert!(error < tolerance + 1e-13, "{kind:?} {hz} Hz {h} s {middle} V: {error:e} {tolerance}");
                }
            }
        }
    }
    assert!(backwards > 150 && forwards > 20 && drives > 450, "{backwards} {forwards} {drives}");
}

#[test]
fn a_whole_record_is_inverted_exactly_inside_and_outside_the_switching_range() {
    for h in [1e-3, 1e-4] {
        for (kind, hz, p) in published::all() {
            let m = built(kind, p, h);
            let Ok(inverse) = m.anti_causal::<1024>(1e-3) else { continue };
            // A slow reference through zero: it stays in the switching range.
            let reference: Vec<f64> = (0..2000).map(|k| 3.0 * libm::sin(TAU * hz * h * f64::from(k)) + 0.1).collect();
            let mut drive = vec![0.0; 2000];
            let before = inverse.backward(&reference, &mut drive);
            let mut s = m.state();
            m.reset(&mut s, &env(), before);
            for (u, z) in drive.iter().zip(&reference) {
                let reached = m.step(&mut s, &env(), *u);
                assert!((reached - z).abs() < 1e-13 * (1.0 - 40.0 * m.rate), "{kind:?} {hz} {h}: {reached} {z}");
                assert!(u.abs() < 3.1 / p.k0 + p.beta * 4.0 / p.k0);
            }
        }
    }
}

/// `ln(1e9) |α|/k₀` is 23 ms for the 10 Hz set. The size of the rate term adds to it.
#[test]
fn lead_follows_from_the_zero_in_the_right_half_plane() {
    let (kind, _, p) = published::all().next().unwrap();
    let m = built(kind, p, 1e-5);
    let lead = |tolerance| m.anti_causal::<20_000>(tolerance).unwrap().lead() as f64 * 1e-5;
    let tau = -p.alpha / p.k0;
    // With a switching range the lead is doubled, at the weaker contraction. The share is smaller than the tolerance by
    // φ′/(φ′ + 2a), and by nearly two for the error of the output.
    let extra = libm::log(2.0 * (1.0 + 2.0 * tau / 1e-5));
    for tolerance in [1e-9, 1e-6, 1e-3] {
        let expected = 2.0 / 0.9 * tau * (libm::log(1.0 / tolerance) + extra);
        assert!((lead(tolerance) / expected - 1.0).abs() < 0.02, "{} {expected}", lead(tolerance));
    }
    // For 1e-9 the lead is shorter than one period of 10 Hz.
    assert!((lead(1e-9) - 0.0666).abs() < 1e-4, "{}", lead(1e-9));
    let once = m.anti_causal::<20_000>(1e-9).unwrap().with_lead(2960).unwrap();
    assert!(once.lead() == 2960 && once.with_lead(20_000).is_err());
}

#[test]
fn a_drive_outside_the_switching_range_needs_half_the_lead() {
    let p = ActivationParams { k0: 0.1516, alpha: -0.00017, beta: 0.1996, gamma: 1000.0 };
    let m = built(ActivationKind::Atan, p, 1e-4);
    for tolerance in [1e-9, 1e-6, 1e-3] {
        let whole: Inverse = m.anti_causal(tolerance).unwrap();
        let half = whole.with_lead(whole.lead() / 2).unwrap();
        let drive = sine(10.0, 25.0, 1e-4);
        let reference = run(&m, &drive);
        let error = worst(&run(&m, &stream(&half, &reference)), &reference);
        assert!(error < tolerance * -m.rate * largest_step(&drive), "{error:e}");
    }
}

/// A reference that stays in the switching range: the drive chatters within the stated bound, and leaves the range
/// again.
#[test]
fn chatter_stays_within_its_bound() {
    for h in [1e-3, 1e-4] {
        for (kind, _, p) in published::all() {
            let m = built(kind, p, h);
            let Ok(inverse) = m.anti_causal::<1024>(1e-3) else { continue };
            if inverse.switching() == 0.0 {
                continue;
            }
            let (low, high) = kind.range();
            let middle = p.beta * (low + high) / 2.0;
            let dwell = |k: usize| middle + 0.4 * p.beta * (high - low) * libm::sin(0.01 * k as f64);
            let reference: Vec<f64> = (0..3000).map(dwell).collect();
            let mut drive = vec![0.0; 3000];
            inverse.backward(&reference, &mut drive);
            assert!(drive.iter().all(|u| u.abs() <= inverse.chatter()), "{kind:?}");
            // Chatter occurs: the bound is not wide by a factor of 10.
            assert!(drive.iter().any(|u| u.abs() > 0.1 * inverse.chatter()), "{kind:?}");
            let streamed = stream(&inverse, &reference);
            assert!(streamed.iter().all(|u| u.abs() <= inverse.chatter()), "{kind:?}");
            // The error of joined plans is a fraction of the size of the activation.
            let error = worst(&run(&m, &streamed), &reference);
            assert!(error < 0.7 * p.beta * (high - low), "{kind:?} {error}");
        }
    }
}

/// The tolerance holds for the error of the output. The contraction makes this error larger than the error of the
/// drive.
#[test]
fn tolerance_holds_for_the_output() {
    let h = 1e-3;
    for ratio in [0.3, 0.45, 0.6410029281028279, 0.7] {
        let k0 = 0.5612169905862373;
        let p = ActivationParams { k0, alpha: -k0 * h / ratio, beta: 0.566188420382674, gamma: 0.733340 };
        let m = built(ActivationKind::Tanh, p, h);
        let inverse: Inverse = m.anti_causal(2.44e-6).unwrap();
        let drive: Vec<f64> = (0..3000)
            .map(|k| h * f64::from(k))
            .map(|t| {
                8.0 * libm::sin(TAU * 2.0 * t + 1.0) + 5.0 * libm::sin(TAU * 0.74 * t) + 3.0 * libm::sin(TAU * 5.8 * t)
            })
            .collect();
        let reference = run(&m, &drive);
        let reached = run(&m, &stream(&inverse, &reference));
        let from = inverse.lead();
        let error = worst(&reached[from..], &reference[from..]);
        assert!(error <= 2.44e-6 * -m.rate * largest_step(&drive), "{ratio}: {error}");
    }
}

proptest! {
    /// Random valid parameters, several frequencies and minor loops, without a switching range or outside it.
    #[test]
    fn random_models_are_inverted_to_the_stated_tolerance(
        kind in prop::sample::select(&ActivationKind::ALL[..]), k0 in 0.02..2.0f64, beta in 0.0..3.0f64, exponent in -3.0..3.0f64,
        ratio in 0.06..1.9f64, tolerance in -9.0..-2.0f64, hz in 2.0..20.0f64, phase in 0.0..6.0f64,
    ) {
        let (gamma, h) = (libm::pow(10.0, exponent), 1e-3);
        let limit = if kind == ActivationKind::Softplus { k0 + beta * gamma } else { k0 };
        let m = built(kind, ActivationParams { k0, alpha: -limit * h / ratio, beta, gamma }, h);
        let inverse: Inverse = match m.anti_causal(libm::pow(10.0, tolerance)) {
            Ok(inverse) => inverse,
            Err(error) => {
                prop_assert!(matches!(error, Error::Capacity { .. }), "{error}");
                return Ok(());
            }
        };
        // Plans start at rest. This is their largest difference from the drive.
        let margin = (1.0 + 2.0 / ratio) * TAU * hz * h * (8.0 + 5.0 * 0.37 + 3.0 * 2.9);
        let drive: Vec<f64> = (0..3000).map(|k| {
            let t = h * f64::from(k);
            let swing = 8.0 * libm::sin(TAU * hz * t + phase) + 5.0 * libm::sin(TAU * 0.37 * hz * t)
                + 3.0 * libm::sin(TAU * 2.9 * hz * t);
            // Above zero by the switching range and the margin, or about zero.
            if inverse.switching() > 0.0 { inverse.switching() + margin + 16.0 + swing } else { swing }
        }).collect();
        let reference = run(&m, &drive);
        let reached = run(&m, &stream(&inverse, &reference));
        let allowed = libm::pow(10.0, tolerance) * -m.rate * largest_step(&drive) + 1e-12 * (k0 + beta * gamma - m.rate) * drive[0].abs().max(16.0);
        // The reference starts from rest with a jump of its rate. Its effect on the plans decays within the lead.
        let from = inverse.lead().min(reached.len());
        prop_assert!(worst(&reached[from..], &reference[from..]) <= allowed, "{} {allowed}", worst(&reached[from..], &reference[from..]));
    }

    #[test]
    fn any_reference_gives_a_bounded_drive(z in prop::collection::vec(prop_oneof![-20.0..20.0f64, -0.5..0.5f64, Just(f64::NAN)], 300)) {
        let p = ActivationParams { k0: 0.15, alpha: -2e-4, beta: 0.4, gamma: 1e5 };
        let m = built(ActivationKind::Tanh, p, 1e-3);
        let inverse: Inverse = m.anti_causal(1e-6).unwrap();
        let mut drive = vec![0.0; z.len()];
        let before = inverse.backward(&z, &mut drive);
        let mut s = Box::new(inverse.state());
        inverse.reset(&mut s, &env(), 0.0);
        for u in drive.into_iter().chain([before]).chain(z.iter().map(|z| inverse.step(&mut s, &env(), *z))) {
            // (|z| + |β|)/k₀
            prop_assert!(u.abs() <= 20.4 / 0.15 + 1e-9);
        }
    }
}

#[test]
fn a_million_samples_stay_bounded_and_follow_the_reference() {
    let p = ActivationParams { k0: 0.15, alpha: -2e-4, beta: 0.4, gamma: 3000.0 };
    let m = built(ActivationKind::Softsign, p, 1e-3);
    let inverse: AntiCausal<f64, 64> = m.anti_causal(1e-4).unwrap();
    let (mut s, mut i) = (m.state(), inverse.state());
    let reference = |k: usize| 4.0 + 3.0 * libm::sin(0.05 * k as f64) * libm::cos(0.0007 * k as f64);
    inverse.reset(&mut i, &env(), reference(0));
    for k in 1..1_000_000 {
        let u = inverse.step(&mut i, &env(), reference(k));
        assert!(u.abs() < 60.0);
        if let Some(now) = k.checked_sub(inverse.lead()) {
            let reached = m.step(&mut s, &env(), u);
            assert!(now < 2 || (reached - reference(now)).abs() < 1e-4, "{now}");
        }
    }
}

#[test]
fn single_precision_agrees() {
    let p = ActivationParams { k0: 0.1516, alpha: -0.00017, beta: 0.1996, gamma: 1000.0 };
    let double = built(ActivationKind::Atan, p, 1e-3);
    let single: Activation<f32> = (ActivationKind::Atan, p).build(&Sampling { period: 1e-3 }).unwrap();
    let inverse: AntiCausal<f64, 64> = double.anti_causal(1e-6).unwrap();
    let small: AntiCausal<f32, 64> = single.anti_causal(1e-6).unwrap();
    assert_eq!(inverse.lead(), small.lead());
    let (mut s, mut t) = (inverse.state(), small.state());
    let reference = |k: u16| 4.0 + 3.0 * libm::sin(0.03 * f64::from(k));
    inverse.reset(&mut s, &env(), reference(0));
    small.reset(&mut t, &Env::default(), reference(0) as f32);
    for k in 1..2000 {
        let expected = inverse.step(&mut s, &env(), reference(k));
        let u = f64::from(small.step(&mut t, &Env::default(), reference(k) as f32));
        assert!((u - expected).abs() < 1e-4, "{u} {expected}");
    }
}

#[test]
fn models_without_an_anti_causal_inverse_are_rejected() {
    let p = ActivationParams { k0: 0.15, alpha: -1e-4, beta: 0.3, gamma: 10.0 };
    let inverse = |p, h| built(ActivationKind::Tanh, p, h).anti_causal::<64>(1e-3).map(|i| i.lead());
    assert!(inverse(p, 1e-3).is_ok());
    // h k₀ = 2|α|
    assert!(matches!(inverse(p, 2e-4 / 0.15), Err(Error::NotInvertible(_))));
    assert!(matches!(inverse(ActivationParams { alpha: 0.0, ..p }, 1e-3), Err(Error::NotInvertible(_))));
    assert!(matches!(inverse(ActivationParams { alpha: 1e-4, ..p }, 1e-3), Err(Error::NotInvertible(_))));
    assert!(matches!(inverse(ActivationParams { k0: -0.1, ..p }, 1e-3), Err(Error::NotInvertible(_))));
    assert!(matches!(inverse(p, 1e-6), Err(Error::Capacity { holds: 64, .. })));
    let falling = built(ActivationKind::Softplus, ActivationParams { beta: -0.1, gamma: 2.0, ..p }, 1e-3);
    assert!(matches!(falling.anti_causal::<64>(1e-3), Err(Error::NotInvertible(_))));
    let m = built(ActivationKind::Tanh, p, 1e-3);
    assert!(matches!(m.anti_causal::<64>(1.0), Err(Error::OutOfRange { name: "tolerance", .. })));
}

#[test]
fn an_empty_record_gives_an_empty_drive() {
    let p = ActivationParams { k0: 0.15, alpha: -1e-4, beta: 0.3, gamma: 10.0 };
    let inverse: Inverse = built(ActivationKind::Tanh, p, 1e-3).anti_causal(1e-3).unwrap();
    assert_eq!(inverse.backward(&[], &mut []), 0.0);
}
