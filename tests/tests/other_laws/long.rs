//! Tests of a minute or more. `cargo xtask test` skips them; `cargo xtask test --long` and `cargo test` run them.

use super::*;

/// A settling zero is a drift, and its law is found. A zero that swings or moves in steps is not a drift.
#[test]
fn a_settling_zero_is_named_drift() {
    let settles = |t: f64| 2.0 * (1.0 - (-t / 25.0).exp());
    let records = with_output(811, |t, _, y| y.iter().zip(t).map(|(y, t)| y + settles(*t)).collect());
    let d = diagnosed(Kind::Pi, &records);
    assert_eq!(names(&d), ["drift"], "{:#?}", d.findings);
    let drift = d.extended.effects.drift.unwrap();
    assert!((drift.settling / 2.0 - 1.0).abs() < 0.1 && (drift.seconds / 25.0 - 1.0).abs() < 0.1, "{drift:?}");
    // A swinging zero.
    let swings = |t: f64| 0.3 * (0.15 * t).cos();
    let records = with_output(811, |t, _, y| y.iter().zip(t).map(|(y, t)| y + swings(*t)).collect());
    let d = diagnosed(Kind::Pi, &records);
    assert!(names(&d).is_empty(), "{:#?}", d.findings);
    assert!(d.findings.remainder.description.contains("the zero wanders"), "{:?}", d.findings.remainder);
    // A mount that slips several times.
    let slips = |t: f64| [9.0, 18.0, 27.0].into_iter().filter(|at| t > *at).count() as f64 * 0.4;
    let records = with_output(811, |t, _, y| y.iter().zip(t).map(|(y, t)| y + slips(*t)).collect());
    let d = diagnosed(Kind::Pi, &records);
    assert!(names(&d).is_empty(), "{:#?}", d.findings);
}

/// With soft stops at both ends the loop is point-symmetric, as with any symmetric bend. But the stops halve the
/// motion there.
#[test]
fn soft_stops_at_both_ends_are_named_saturation() {
    let d = diagnosed(
        Kind::Pi,
        &from_the_middle(&|t, u| {
            let (mut noise, mut rested) = (noise(t), rested(u));
            let knee = |x: f64| {
                if x.abs() < 0.2 { x } else { x.signum() * (0.2 + 0.12 * ((x.abs() - 0.2) / 0.12).tanh()) }
            };
            u.iter().map(|u| 40.0 * (0.55 + knee(rested(u) - 0.55)) + noise()).collect()
        }),
    );
    assert_eq!(names(&d), ["saturation"], "{:#?}", d.findings);
    let (before, after) = (d.findings.before.test.unwrap().rmse, d.findings.after.test.unwrap().rmse);
    assert!(after < 0.3 * before, "{before} {after}");
}

/// Relays in three clusters, driven by stairs and a slow random walk with few reversals. A base with many
/// parameters fits a part of each of the three effects and predicts poorly; no effect alone reduces its error.
#[test]
fn three_effects_are_found_together_in_a_record_of_few_reversals() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut spread = |middle: f64, by: f64| middle + by * ((0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0);
    let clusters = [(35.0, 10.0), (60.0, 6.0), (72.0, 18.0)];
    let relays: Vec<(f64, f64)> = (0..3000)
        .map(|i| {
            let (middle, half) = clusters[i % 3];
            let (middle, half) = (spread(middle, 4.0), spread(half, 2.0).abs());
            (middle - half, middle + half)
        })
        .collect();
    let degc = |t: f64| 22.0 + 4.0 * (0.05 * t).sin() + 3.0 * (0.083 * t).sin();
    // With creep, thermal expansion and a tone.
    let device = |t: &[f64], u: &[f64]| -> Vec<f64> {
        let (mut noise, mut at) = (noise(t), vec![0.0; relays.len()]);
        let taus: Vec<f64> = (0..8).map(|i| 0.2 * 3f64.powi(i)).collect();
        let mut slow = [0.0; 8];
        let mut output = |u: f64, t: f64| {
            for (s, (down, up)) in at.iter_mut().zip(&relays) {
                *s = if u > *up {
                    1.0
                } else if u < *down {
                    0.0
                } else {
                    *s
                };
            }
            let motion = 0.06 * u + 8.0 * at.iter().sum::<f64>() / relays.len() as f64;
            let follow = |(slow, tau): (&mut f64, &f64)| {
                *slow += (1.0 - (-0.02 / tau).exp()) * (motion - *slow);
                *slow
            };
            let creep: f64 = slow.iter_mut().zip(&taus).map(follow).sum();
            let hum = 0.06 * (std::f64::consts::TAU * 17.3 * t).sin();
            motion + 0.02 * creep + 0.1 * (degc(t) - degc(0.0)) + hum
        };
        u.iter().zip(t).map(|(u, t)| output(*u, *t) + noise()).collect()
    };
    let make = |name: &str, seed: u64| {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let stairs = [20.0, 40.0, 60.0, 80.0, 100.0, 75.0, 50.0, 25.0, 0.0];
        let mut input: Vec<f64> = stairs.iter().flat_map(|u| [*u; 150]).collect();
        let (mut at, mut to) = (0.0, 90.0);
        while input.len() < 4500 {
            let step = f64::clamp(to - at, -0.16, 0.16);
            at += step;
            if step == 0.0 {
                to = 100.0 * rng.random::<f64>();
            }
            input.push(at);
        }
        let time: Vec<f64> = (0..input.len()).map(|k| 0.02 * k as f64).collect();
        Record::from_samples(Columns {
            name: name.into(),
            output: Some((OutputUnit::Micrometre, device(&time, &input))),
            temperature: Some(time.iter().map(|t| degc(*t)).collect()),
            time,
            input: Some(input),
            ..Columns::default()
        })
        .unwrap()
    };
    let d = diagnosed(Kind::Preisach, &(make("train", 1), make("test", 2)));
    assert_eq!(names(&d), ["temperature", "creep", "interference"], "{:#?}", d.findings);
    let (before, after) = (d.findings.before.test.unwrap().rmse, d.findings.after.test.unwrap().rmse);
    assert!(after < 0.5 * before, "{before} {after}");
}

/// The misfit of a coarse base has power at the frequencies of the drive. A tone at another frequency is named
/// although the misfit is much larger.
#[test]
fn a_tone_is_named_despite_the_misfit_of_the_base() {
    let hum = |t: f64| 0.05 * (std::f64::consts::TAU * 47.3 * t).sin();
    let records = with_output(810, |t, u, _| bouc_wen(t, u).iter().zip(t).map(|(y, t)| y + hum(*t)).collect());
    let d = diagnosed(Kind::Pi, &records);
    assert_eq!(names(&d), ["interference"], "{:#?}", d.findings);
    assert!(d.findings.effects[0].cv_rmse_after > 0.5 * d.findings.effects[0].cv_rmse_before, "{:#?}", d.findings);
    let plain = diagnosed(Kind::Pi, &with_output(810, |t, u, _| bouc_wen(t, u)));
    assert!(names(&plain).is_empty(), "{:#?}", plain.findings);
}

/// Coercive voltages that grow with the logarithm of the mean rate over some milliseconds: neither a common
/// overdrive of all loops nor a power of the instantaneous rate.
#[test]
fn coercive_voltages_that_grow_with_the_rate_are_named_rate_dependence() {
    let drive = |t: f64| {
        let swing = 45.0 * (0.75 + 0.25 * (0.9 * t).cos());
        // From 0.5 to 12 Hz and back.
        swing * (0.5 * t + 3.6 * (1.0 - (0.3 * t).cos())).mul_add(std::f64::consts::TAU, 0.0).sin()
    };
    for kind in [Kind::Pi, Kind::Preisach] {
        let make =
            |name: &str, after: f64, rows: usize| one_segment(name, &|t| drive(t + after), rows, &relays_of_the_rate);
        let d = diagnosed(kind, &(make("train", 0.0, 12_000), make("test", 2.0, 6000)));
        assert_eq!(names(&d), ["rate-dependence"], "{kind}: {:#?}", d.findings);
        assert_eq!(d.findings.effects[0].law.as_deref(), Some("power-thresholds"), "{kind}");
        let (before, after) = (d.findings.before.test.unwrap().rmse, d.findings.after.test.unwrap().rmse);
        assert!(after < 0.6 * before, "{kind}: {before} {after}");
    }
}

/// The residual of the missing curve hides that the device rested at the first voltage; wide play operators keep
/// that state.
#[test]
fn a_curve_and_a_drift_are_found_where_the_record_begins_away_from_rest() {
    let settles = |t: f64| 3.0 * (1.0 - (-t / 6.0).exp());
    let d = diagnosed(
        Kind::Pi,
        &from_the_middle(&|t, u| {
            let (mut noise, mut rested) = (noise(t), rested(u));
            let curve = |v: f64| 40.0 * (v + 0.25 * v * v);
            u.iter().zip(t).map(|(u, t)| curve(rested(u)) + settles(*t) + noise()).collect()
        }),
    );
    assert_eq!(names(&d), ["asymmetry", "drift"], "{:#?}", d.findings);
    let drift = d.extended.effects.drift.unwrap();
    assert!((drift.settling / 3.0 - 1.0).abs() < 0.03 && (drift.seconds / 6.0 - 1.0).abs() < 0.05, "{drift:?}");
    let (before, after) = (d.findings.before.train.unwrap().rmse, d.findings.after.train.unwrap().rmse);
    assert!(after < 0.1 * before, "{before} {after}");
}

/// A Bouc-Wen model fitted to a drifting record explains a part of the drift. With an amplitude that decays over
/// time, a base with much memory explains the rest. The drift may be missed, but no other effect may be named, and
/// the error must not rise.
#[test]
fn a_drift_with_a_bouc_wen_base_gets_no_wrong_name() {
    let settles = |t: f64| 3.0 * (1.0 - (-t / 6.0).exp());
    let drifts = |t: &[f64], u: &[f64]| bouc_wen(t, u).iter().zip(t).map(|(y, t)| y + settles(*t)).collect();
    let d = diagnosed(Kind::BoucWen, &from_the_middle(&drifts));
    assert!(names(&d).iter().all(|name| *name == "drift"), "{:#?}", d.findings);
    let (before, after) = (d.findings.before.train.unwrap().rmse, d.findings.after.train.unwrap().rmse);
    assert!(after <= before, "{before} {after}");
}
