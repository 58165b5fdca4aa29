//! Diagnosis of devices with laws that neither the models nor the simulated plant have: loops without closed minor
//! loops, a settling zero, loops that bend alike at both ends.

mod long;

use hyst_hw::{Bed, Plant, PlantConfig};
use hyst_ident::diagnose::{DiagnoseOptions, Diagnosis, RemainderKind, diagnose};
use hyst_ident::fit::{FitOptions, fit};
use hyst_ident::model::Kind;
use hyst_ident::record::{Columns, OutputUnit, Record};
use hyst_tests::experiment;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Returns a training and a test record with other outputs: `of` computes the new output of a segment from its time,
/// drive and output.
fn with_output(seed: u64, of: impl Fn(&[f64], &[f64], &[f64]) -> Vec<f64>) -> (Record, Record) {
    let mut plant = Plant::new(PlantConfig::random_on(Bed::Relays, seed, &[]).unwrap()).unwrap();
    let mut make = |seed: u64, name: &str| {
        let r = experiment(&mut plant, seed, name);
        let old = r.output().unwrap();
        let segment = |s: &std::ops::Range<usize>| of(&r.time()[s.clone()], &r.input()[s.clone()], &old[s.clone()]);
        let labels = r.segments().iter().zip(r.labels()).flat_map(|(s, label)| vec![*label; s.len()]);
        Record::from_samples(Columns {
            name: name.into(),
            segment: Some(labels.collect()),
            time: r.time().to_vec(),
            input: Some(r.input().to_vec()),
            output: Some((OutputUnit::Micrometre, r.segments().iter().flat_map(segment).collect())),
            ..Columns::default()
        })
        .unwrap()
    };
    let train = make(seed, "train");
    (train, make(seed + 1000, "test"))
}

fn diagnosed(kind: Kind, (train, test): &(Record, Record)) -> Diagnosis {
    let model = fit(train, kind, &FitOptions::default()).unwrap();
    diagnose(train, Some(test), &model, &DiagnoseOptions::default(), &|_| {}).unwrap()
}

fn names(d: &Diagnosis) -> Vec<&'static str> {
    d.findings.effects.iter().map(|e| e.name.name()).collect()
}

/// Returns white noise of 5 nm \[µm\], seeded by the first time of the segment.
fn noise(t: &[f64]) -> impl FnMut() -> f64 {
    let mut rng = ChaCha8Rng::seed_from_u64(t[0].to_bits());
    move || 5e-3 * (0..12).map(|_| rng.random::<f64>() - 0.5).sum::<f64>()
}

/// Returns the output of a Bouc-Wen law \[µm\], whose minor loops do not close. The drive is integrated in small steps.
fn bouc_wen(t: &[f64], u: &[f64]) -> Vec<f64> {
    let (mut z, mut from, mut noise) = (0.0_f64, u[0], noise(t));
    let follow = |to: &f64| {
        const STEPS: u32 = 24;
        let step = (to - from) / f64::from(STEPS);
        for _ in 0..STEPS {
            let closing = if step * z > 0.0 { 1.0 } else { 0.2 };
            z += step * (1.0 - closing * (z.abs() / 12.0).powf(1.4));
        }
        from = *to;
        0.3 * to - 0.12 * z + noise()
    };
    u.iter().map(follow).collect()
}

/// Loops that are point-symmetric have no asymmetry, whatever their bend. Loops that bend to one side have an
/// asymmetry.
#[test]
fn a_symmetric_bend_is_not_named_asymmetry() {
    let range = PlantConfig::random_on(Bed::Relays, 812, &[]).unwrap().actuator;
    let share = |v: f64| 2.0 * (v - range.min_v) / (range.max_v - range.min_v) - 1.0;
    let bent = |t: &[f64], u: &[f64], of: &dyn Fn(f64) -> f64| {
        let (mut plays, mut noise) = ([share(u[0]); 8], noise(t));
        let follow = |u: &f64| {
            for (p, r) in plays.iter_mut().zip([0.02, 0.06, 0.1, 0.16, 0.24, 0.34, 0.46, 0.6]) {
                *p = hyst_core::play(*p, share(*u), r);
            }
            9.0 * of(0.5 * share(*u) + plays.iter().sum::<f64>() / 16.0) + noise()
        };
        u.iter().map(follow).collect::<Vec<f64>>()
    };
    // The first flattens towards both ends of the travel, the second towards the upper end.
    let both_ends = |v: f64| (0.6 * v).tanh();
    let upper_end = |v: f64| v - 0.08 * v * v;
    let found = |of: &dyn Fn(f64) -> f64| diagnosed(Kind::Pi, &with_output(812, |t, u, _| bent(t, u, of)));
    let symmetric = found(&both_ends);
    assert!(names(&symmetric).is_empty(), "{:#?}", symmetric.findings);
    assert_eq!(symmetric.findings.remainder.kind, RemainderKind::BaseCapacity, "{:#?}", symmetric.findings);
    let asymmetric = found(&upper_end);
    assert_eq!(names(&asymmetric), ["asymmetry"], "{:#?}", asymmetric.findings);
}

/// A curve before the play operators, as the coating of a piezo distorts its field: the loop is asymmetric, and minor
/// loops are wider where the curve is steep. No curve after the hysteresis has this effect.
#[test]
fn a_curve_before_the_hysteresis_is_an_asymmetry() {
    let range = PlantConfig::random_on(Bed::Relays, 813, &[]).unwrap().actuator;
    let share = |u: f64| (u - range.min_v) / (range.max_v - range.min_v);
    let make = |t: &[f64], u: &[f64]| {
        let mut noise = noise(t);
        let mut plays = [0.0; 40];
        let follow = |u: &f64| {
            let v = share(*u) + 0.35 * share(*u).powi(2);
            plays.iter_mut().enumerate().for_each(|(i, p)| *p = hyst_core::play(*p, v, 0.014 * (i + 1) as f64));
            12.0 * (v + 0.015 * plays.iter().sum::<f64>()) + noise()
        };
        u.iter().map(follow).collect::<Vec<f64>>()
    };
    let d = diagnosed(Kind::Pi, &with_output(813, |t, u, _| make(t, u)));
    assert_eq!(names(&d), ["asymmetry"], "{:#?}", d.findings);
    assert_eq!(d.extended.effects.asymmetry.as_ref().unwrap().side, hyst_core::CurveSide::Input);
    let (before, after) = (d.findings.before.test.unwrap().rmse, d.findings.after.test.unwrap().rmse);
    assert!(after < 0.2 * before, "{before} {after}");
}

/// A Bouc-Wen base has taken up a part of the curve in its parameters. Play operators show the curve, and the base then
/// follows the device with it.
#[test]
fn a_curve_is_found_on_a_base_that_is_not_linear_in_its_parameters() {
    let of = |t: &[f64], u: &[f64]| {
        let law = bouc_wen(t, u);
        law.iter().map(|y| y - 0.008 * y * y).collect::<Vec<f64>>()
    };
    let with_curve = diagnosed(Kind::BoucWen, &with_output(815, |t, u, _| of(t, u)));
    assert_eq!(names(&with_curve), ["asymmetry"], "{:#?}", with_curve.findings);
    let (before, after) = (with_curve.findings.before.test.unwrap().rmse, with_curve.findings.after.test.unwrap().rmse);
    assert!(after < 0.2 * before, "{before} {after}");
    let without = diagnosed(Kind::BoucWen, &with_output(815, |t, u, _| bouc_wen(t, u)));
    assert!(names(&without).is_empty(), "{:#?}", without.findings);
}

/// Computes the output of a device from times and a drive.
type Device<'a> = &'a dyn Fn(&[f64], &[f64]) -> Vec<f64>;

/// Returns a record of one segment at 500 Hz.
fn one_segment(name: &str, drive: &dyn Fn(f64) -> f64, rows: usize, of: Device<'_>) -> Record {
    let time: Vec<f64> = (0..rows).map(|k| k as f64 / 500.0).collect();
    let input: Vec<f64> = time.iter().map(|t| drive(*t)).collect();
    Record::from_samples(Columns {
        name: name.into(),
        output: Some((OutputUnit::Micrometre, of(&time, &input))),
        time,
        input: Some(input),
        ..Columns::default()
    })
    .unwrap()
}

/// Returns two records that start in the middle of the range: a decaying drive, as for an actuator that was
/// demagnetised there, and a sum of two sines.
fn from_the_middle(of: Device<'_>) -> (Record, Record) {
    let sine = |hz: f64, t: f64| (std::f64::consts::TAU * hz * t).sin();
    let decaying = |t: f64| 50.0 + 47.0 * (1.0 - t / 26.0) * sine(2.0, t);
    let two_sines = |t: f64| 50.0 + 24.0 * sine(1.3, t) + 18.0 * sine(0.37, t);
    (one_segment("decaying", &decaying, 12_000, of), one_segment("two sines", &two_sines, 6000, of))
}

/// Returns play operators that are at the first voltage when the record begins, in shares of 100 V.
fn rested(u: &[f64]) -> impl FnMut(&f64) -> f64 {
    let mut plays = [0.01 * u[0]; 45];
    move |u: &f64| {
        plays.iter_mut().enumerate().for_each(|(i, p)| *p = hyst_core::play(*p, 0.01 * u, 0.011 * (i + 1) as f64));
        0.7 * 0.01 * u + 0.01 * plays.iter().sum::<f64>()
    }
}

/// A slow and a fast experiment in one file, each at its own sample rate: the drift is visible in one, the lag in the
/// other.
#[test]
fn a_lag_and_a_drift_are_found_in_a_record_of_two_sample_rates() {
    let lag = 0.004_f64;
    let settles = |t: f64| 2.0 * (1.0 - (-t / 20.0).exp());
    // Play operators after a lag, in steps of 0.2 ms, each with the drive at its midpoint: at an end, the lag would be
    // wrong by half a step.
    let make = |name: &str, parts: [(f64, f64, f64, usize); 2]| {
        let mut all = Columns { name: name.into(), segment: Some(Vec::new()), ..Columns::default() };
        let (mut input, mut output, mut start) = (Vec::new(), Vec::new(), 0.0);
        for (label, (period, hz, size, rows)) in (0..).zip(parts) {
            // A sweep to five times the frequency: a single frequency cannot distinguish a lag from a delay.
            let swept = |t: f64| hz * t * (1.0 + 2.0 * t / (rows as f64 * period));
            let drive = |t: f64| 0.5 * size * (1.0 - (std::f64::consts::TAU * swept(t)).cos());
            let (first, first_time) = ([drive(0.0)], [start]);
            let (mut rested, mut noise) = (rested(&first), noise(&first_time));
            let (mut lagged, mut t) = (drive(0.0), 0.0);
            for k in 0..rows {
                while t < k as f64 * period - 1e-6 {
                    t += 2e-4;
                    lagged += (drive(t - 1e-4) - lagged) * (1.0 - (-2e-4 / lag).exp());
                }
                let motion = rested(&lagged);
                all.time.push(start + k as f64 * period);
                all.segment.as_mut().unwrap().push(label);
                input.push(drive(k as f64 * period));
                output.push(40.0 * motion + settles(start + k as f64 * period) + noise());
            }
            start += rows as f64 * period + 1.0;
        }
        (all.input, all.output) = (Some(input), Some((OutputUnit::Micrometre, output)));
        Record::from_samples(all).unwrap()
    };
    let train = make("train", [(0.02, 0.1, 100.0, 2000), (1e-3, 7.0, 80.0, 4000)]);
    let test = make("test", [(0.01, 0.4, 60.0, 1500), (2e-3, 3.0, 90.0, 1500)]);
    assert_eq!(train.sample_periods(), [0.02, 1e-3]);
    let d = diagnosed(Kind::Pi, &(train, test));
    assert_eq!(names(&d), ["lag", "drift"], "{:#?}", d.findings);
    let (found, drift) = (d.extended.effects.lag.unwrap(), d.extended.effects.drift.unwrap());
    assert!((found.seconds / lag - 1.0).abs() < 0.05, "{found:?}");
    assert!((drift.settling / 2.0 - 1.0).abs() < 0.1 && (drift.seconds / 20.0 - 1.0).abs() < 0.1, "{drift:?}");
    let (before, after) = (d.findings.before.test.unwrap().rmse, d.findings.after.test.unwrap().rmse);
    assert!(after < 0.2 * before, "{before} {after}");
}

/// Returns the output of relays \[µm\] whose coercive voltages depend on the mean rate of the last 16 ms.
fn relays_of_the_rate(t: &[f64], u: &[f64]) -> Vec<f64> {
    const STEPS: u32 = 4;
    let mut relays: Vec<(f64, f64, f64)> = (0..1600)
        .map(|i| (f64::from(i % 40) * 1.5 - 29.25, 0.5 + f64::from(i / 40) * 1.2))
        .map(|(middle, half)| (middle, half, if middle > 0.0 { -1.0 } else { 1.0 }))
        .collect();
    let (mut noise, mut from, mut last) = (noise(t), u[0], [0.0; 8]);
    let mut row = |(k, to): (usize, &f64)| {
        last[k % 8] = (to - from).abs() / 2e-3;
        let rate = last.iter().sum::<f64>() / 8.0;
        let factor = 1.0 + 0.12 * (1.0 + rate / 20.0).ln();
        for step in 1..=STEPS {
            let v = from + (to - from) * f64::from(step) / f64::from(STEPS);
            for (middle, half, state) in &mut relays {
                if (v - *middle).abs() >= *half * factor {
                    *state = (v - *middle).signum();
                }
            }
        }
        from = *to;
        0.2 * to + 20.0 * relays.iter().map(|r| r.2).sum::<f64>() / 1600.0 + noise()
    };
    u.iter().enumerate().map(&mut row).collect()
}
