//! Valid but unusual records: fits and diagnoses give a result or an error with the reason.

use hyst_core::CreepParams;
use hyst_ident::diagnose::{DiagnoseOptions, diagnose};
use hyst_ident::fit::{FitError, FitOptions, fit};
use hyst_ident::model::Kind;
use hyst_ident::record::{Columns, OutputUnit, Record};
use hyst_ident::simulate::{SimulateOptions, Simulation, Zero, simulate, simulate_with};
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Returns a record of a play operator with gain, `segments` segments of `rows` rows.
fn record(segments: usize, rows: usize, rate_hz: f64, unit: OutputUnit, scale: f64) -> Record {
    let (mut time, mut input, mut output, mut labels) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for s in 0..segments {
        let mut p = 0.0;
        for k in 0..rows {
            let x = k as f64 / rows as f64;
            let u = 50.0 * (1.0 - (40.0 * x).cos()) * (1.0 - 0.7 * x);
            p = hyst_core::play(p, u, 8.0);
            // Repeatable noise: the sine of a fast phase.
            let noise = 1e-3 * (1e4 * (u + 0.37 * k as f64)).sin();
            time.push((s * (rows + 100) + k) as f64 / rate_hz);
            input.push(u);
            output.push(scale * (0.1 * u + 0.05 * p + noise));
            labels.push(s as i64);
        }
    }
    let columns = Columns {
        name: "odd".into(),
        segment: Some(labels),
        time,
        input: Some(input),
        output: Some((unit, output)),
        ..Columns::default()
    };
    Record::from_samples(columns).unwrap()
}

/// Relays that switch only in the first rise act like a later shift of the sensor zero. If the sensor jumps and the
/// drive then exceeds its earlier range slightly, the fit must not explain the jump by many such relays.
#[test]
fn a_jump_is_not_fitted_by_relays_of_the_first_rise() {
    let make = |highest: f64| {
        let (mut p, mut time, mut input, mut output) = (0.0, Vec::new(), Vec::new(), Vec::new());
        for k in 0..12_000_u32 {
            let x = f64::from(k) / 12_000.0;
            let (top, jump) = if x < 0.5 { (highest - 0.4, 0.0) } else { (highest, 0.3) };
            let u = top * (0.5 - 0.5 * (75.0 * x).cos()) * (1.0 - 0.6 * (x % 0.5));
            p = hyst_core::play(p, u, 8.0);
            time.push(f64::from(k) * 1e-3);
            input.push(u);
            output.push(0.1 * u + 0.05 * p + jump + 1e-3 * (1e4 * (u + 0.37 * f64::from(k))).sin());
        }
        let (input, output) = (Some(input), Some((OutputUnit::Micrometre, output)));
        Record::from_samples(Columns { name: "jump".into(), time, input, output, ..Columns::default() }).unwrap()
    };
    let model = fit(&make(100.0), Kind::Preisach, &FitOptions::default()).unwrap();
    let errors = simulate(&model, &make(97.0), Zero::None).unwrap().errors.unwrap();
    // The jump is 2.2 % of the span.
    assert!(errors.nrmse_percent < 5.0, "{errors:?}");
}

fn fit_and_diagnose(record: &Record, kind: Kind) -> Result<Vec<&'static str>, FitError> {
    let model = fit(record, kind, &FitOptions::default())?;
    let d = diagnose(record, Some(record), &model, &DiagnoseOptions::default(), &|_| {})?;
    Ok(d.findings.effects.iter().map(|e| e.name.name()).collect())
}

#[test]
fn too_few_rows_are_an_error() {
    for rows in [2, 5, 20] {
        let end = fit_and_diagnose(&record(1, rows, 1000.0, OutputUnit::Micrometre, 1.0), Kind::Pi);
        assert!(matches!(end, Err(FitError::TooShort { .. } | FitError::ConstantInput { .. })), "{rows}: {end:?}");
    }
}

#[test]
fn many_segments_of_few_rows_give_a_result_or_an_error() {
    let end = fit_and_diagnose(&record(60, 4, 1000.0, OutputUnit::Micrometre, 1.0), Kind::Pi);
    assert!(end.is_ok() || matches!(end, Err(FitError::TooShort { .. } | FitError::Falling { .. })), "{end:?}");
}

#[test]
fn other_rates_and_units_change_nothing() {
    for (rate, unit, scale) in [
        (200.0, OutputUnit::Nanometre, 1e3),
        (50_000.0, OutputUnit::Newton, 0.1),
        (1000.0, OutputUnit::Millimetre, 1e-3),
    ] {
        let named = fit_and_diagnose(&record(1, 4000, rate, unit, scale), Kind::Pi).unwrap();
        assert!(named.is_empty(), "{rate} Hz: {named:?}");
    }
}

#[test]
fn no_effect_is_named_with_one_segment_and_a_preisach_base() {
    assert!(
        fit_and_diagnose(&record(1, 4000, 1000.0, OutputUnit::Micrometre, 1.0), Kind::Preisach).unwrap().is_empty()
    );
}

/// Returns a record with changed columns.
fn changed(change: impl Fn(&mut Vec<f64>, &mut Vec<f64>)) -> Record {
    let plain = record(2, 4000, 1000.0, OutputUnit::Micrometre, 1.0);
    let (mut input, mut output) = (plain.input().to_vec(), plain.output().unwrap().to_vec());
    change(&mut input, &mut output);
    let columns = Columns {
        name: "changed".into(),
        segment: Some(plain.segments().iter().zip(0..).flat_map(|(s, k)| vec![k; s.len()]).collect()),
        time: plain.time().to_vec(),
        input: Some(input),
        output: Some((OutputUnit::Micrometre, output)),
        ..Columns::default()
    };
    Record::from_samples(columns).unwrap()
}

/// A drive with a measured offset of 1 mV still starts at rest, at the edge of the Preisach plane.
#[test]
fn an_offset_of_1_mv_does_not_change_the_fit() {
    let error = |offset: f64| {
        let record = changed(|input, _| input.iter_mut().for_each(|u| *u += offset));
        let model = fit(&record, Kind::Preisach, &FitOptions::default()).unwrap();
        assert_eq!(model.fitted_on[0].settling_rows, 0);
        simulate(&model, &record, Zero::None).unwrap().errors.unwrap().rmse_all_rows
    };
    assert!(error(-1e-3) < 1.5 * error(0.0), "{} {}", error(-1e-3), error(0.0));
}

/// Without other noise, the quantisation of the output is the noise floor.
#[test]
fn a_quantised_output_is_not_unexplained() {
    let record = changed(|_, output| output.iter_mut().for_each(|y| *y = (*y / 0.02).round() * 0.02));
    let model = fit(&record, Kind::Pi, &FitOptions::default()).unwrap();
    let d = diagnose(&record, None, &model, &DiagnoseOptions::default(), &|_| {}).unwrap();
    assert!(d.findings.effects.is_empty() && d.findings.noise_floor > 0.004, "{:?}", d.findings);
}

/// Spikes in 5 % of the rows are found, counted and excluded. The lag is still found.
#[test]
fn spikes_are_counted_and_excluded() {
    let make = |spikes: bool| {
        let (mut plays, mut lagged, mut before, mut rng) = ([0.0; 16], 0.0, 0.0, ChaCha8Rng::seed_from_u64(9));
        let (mut time, mut input, mut output) = (Vec::new(), Vec::new(), Vec::new());
        for k in 0..12_000_u32 {
            let t = f64::from(k) * 1e-3;
            let u = 50.0 - 30.0 * (4.0 * t).cos() - 20.0 * (37.0 * t).cos();
            // A lag of 8 ms, in small steps.
            for i in 1..=50 {
                lagged += (before + (u - before) * f64::from(i) / 50.0 - lagged) / 400.0;
            }
            before = u;
            for (p, r) in plays.iter_mut().zip(1..) {
                *p = hyst_core::play(*p, lagged, 1.5 * f64::from(r));
            }
            let noise = 1e-2 * ((0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0);
            let (hit, size) = (rng.random::<f64>() < 0.05, 0.2 + 2.0 * rng.random::<f64>());
            let spike = if hit && spikes { size } else { 0.0 };
            time.push(t);
            input.push(u);
            output.push(0.1 * lagged + 0.003 * plays.iter().sum::<f64>() + noise + spike);
        }
        let (input, output) = (Some(input), Some((OutputUnit::Micrometre, output)));
        Record::from_samples(Columns { name: "spiked".into(), time, input, output, ..Columns::default() }).unwrap()
    };
    let found = |spikes: bool| {
        let record = make(spikes);
        let model = fit(&record, Kind::Pi, &FitOptions::default()).unwrap();
        diagnose(&record, None, &model, &DiagnoseOptions::default(), &|_| {}).unwrap()
    };
    let (clean, spiked) = (found(false).findings, found(true).findings);
    assert_eq!((clean.rows.left_out.spikes, clean.rows.spikes.len()), (0, 0), "{:?}", clean.rows);
    // About 600 spikes.
    assert!((450..650).contains(&spiked.rows.left_out.spikes), "{:?}", spiked.rows);
    assert!(spiked.rows.left_out.start_up < 600, "{:?}", spiked.rows);
    for findings in [&clean, &spiked] {
        assert_eq!(findings.effects.len(), 1, "{findings:#?}");
        let seconds = findings.effects[0].parameters["seconds"].value;
        assert!((seconds / 8e-3 - 1.0).abs() < 0.1, "{seconds}");
    }
    // Small spikes on a steep slope of the drive remain.
    let after = spiked.after.train.unwrap();
    assert!(after.rmse < 0.2 * after.rmse_all_rows, "{after:?}");
}

/// A Preisach plane of 24 cells a side has 324 unknowns: a short record is fitted with fewer, and diagnosed with a
/// coarser base.
#[test]
fn a_fit_needs_at_most_700_rows() {
    let short = record(1, 700, 200.0, OutputUnit::Micrometre, 1.0);
    for kind in [Kind::Pi, Kind::Preisach] {
        let named = fit_and_diagnose(&short, kind).unwrap();
        assert!(named.is_empty(), "{kind}: {named:?}");
    }
}

/// A record that starts in mid-cycle is simulated with its own first cycle as drive history: there are no start-up
/// rows.
#[test]
fn a_record_in_mid_cycle_is_followed_from_its_first_row() {
    let make = |first: u32, rows: u32| {
        let (mut p, mut time, mut input, mut output) = (0.0, Vec::new(), Vec::new(), Vec::new());
        for k in 0..first + rows {
            let u = 50.0 * (1.0 - (0.01 * f64::from(k)).cos());
            p = hyst_core::play(p, u, 20.0);
            if k >= first {
                time.push(f64::from(k) * 1e-3);
                input.push(u);
                output.push(0.1 * u + 0.08 * p + 1e-3 * (1e4 * (u + 0.37 * f64::from(k))).sin());
            }
        }
        let (input, output) = (Some(input), Some((OutputUnit::Micrometre, output)));
        Record::from_samples(Columns { name: "cycles".into(), time, input, output, ..Columns::default() }).unwrap()
    };
    let model = fit(&make(0, 4000), Kind::Pi, &FitOptions::default()).unwrap();
    // Starts on a falling branch, where the play operators are above the drive.
    let simulated = simulate(&model, &make(2_000, 4000), Zero::None).unwrap();
    assert_eq!(simulated.settling.iter().filter(|s| **s).count(), 0);
    assert!(simulated.errors.unwrap().nrmse_percent < 0.5, "{:?}", simulated.errors);
}

/// An actuator that rested 10 µm above the start of the record still creeps from there. The creep state is estimated
/// from the first rows and used for all later rows.
#[test]
fn a_creep_continues_from_before_the_record() {
    let triangle = |k: i32| 50.0 * (1.0 - (f64::from(k % 200) / 100.0 - 1.0).abs());
    let columns = |output: Vec<f64>| Columns {
        time: (0..4000).map(|k| 0.01 * f64::from(k)).collect(),
        input: Some((0..4000).map(triangle).collect()),
        output: Some((OutputUnit::Micrometre, output)),
        ..Columns::default()
    };
    let mut play = 0.0;
    let motion = (0..4000).map(|k| {
        let u = triangle(k);
        play = f64::clamp(play, u - 5.0, u + 5.0);
        0.4 * u + 0.2 * play
    });
    let record = Record::from_samples(columns(motion.collect())).unwrap();
    let mut model = fit(&record, Kind::Pi, &FitOptions::default()).unwrap();
    let (seconds, shares) = (vec![0.5, 5.0, 50.0], vec![0.01, 0.02, 0.02]);
    model.effects.creep = Some(CreepParams { seconds: seconds.clone(), shares: shares.clone() });

    let from_rest = SimulateOptions { at_rest: true, ..SimulateOptions::default() };
    let with_creep = simulate_with(&model, &record, &from_rest).unwrap().predicted;
    let rest =
        |k: usize| shares.iter().zip(&seconds).map(|(c, tau)| 10.0 * c * (-0.01 * k as f64 / tau).exp()).sum::<f64>();
    let noise = |k: usize| 0.003 * (1.7 * k as f64).sin();
    let output = with_creep.iter().enumerate().map(|(k, y)| y + rest(k) + noise(k)).collect();
    let record = Record::from_samples(columns(output)).unwrap();
    let found = simulate(&model, &record, Zero::None).unwrap();
    assert!((found.creep_away[0] - 10.0).abs() < 0.2, "{:?}", found.creep_away);
    let rmse = |s: &Simulation| s.errors.as_ref().unwrap().rmse;
    let ignored = simulate_with(&model, &record, &from_rest).unwrap();
    assert!(rmse(&found) < 0.1 * rmse(&ignored), "{} against {}", rmse(&found), rmse(&ignored));
    assert_eq!(ignored.creep_away, [0.0]);
}

/// Tests of a minute or more. `cargo xtask test` skips them; `cargo xtask test --long` and `cargo test` run them.
mod long {
    use super::*;

    /// Creep is found at any scale of the output, with either base.
    #[test]
    fn findings_do_not_depend_on_the_unit() {
        let creeping = |scale: f64| {
            let rows = 6000;
            let (mut p, mut slow, mut input, mut output) = (0.0, 0.0, Vec::new(), Vec::new());
            for k in 0..rows {
                // Loops for two seconds, then holds at four levels.
                let t = k as f64 * 1e-3;
                let levels = [80.0, 20.0, 60.0, 30.0];
                let u = if t < 2.0 { 50.0 * (1.0 - (9.0 * t).cos()) } else { levels[((t - 2.0) as usize).min(3)] };
                p = hyst_core::play(p, u, 8.0);
                let v = 0.1 * u + 0.05 * p;
                slow += 1e-3 / 0.4 * (v - slow);
                let noise = 1e-3 * (1e4 * (u + 0.37 * k as f64)).sin();
                input.push(u);
                output.push(scale * (v + 0.05 * slow + noise));
            }
            let time = (0..rows).map(|k| k as f64 * 1e-3).collect();
            let columns = Columns {
                name: "creeping".into(),
                time,
                input: Some(input),
                output: Some((OutputUnit::Nanometre, output)),
                ..Columns::default()
            };
            Record::from_samples(columns).unwrap()
        };
        let scales = [(Kind::Pi, 1.0), (Kind::Pi, 1e-3), (Kind::Preisach, 1e6)];
        for (kind, scale) in scales {
            assert_eq!(fit_and_diagnose(&creeping(scale), kind).unwrap(), ["creep"], "{kind} at {scale}");
        }
    }
}
