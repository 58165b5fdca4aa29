//! Records as laboratories make them: other rates, offsets and signs, a single tone, a single segment, a start-up
//! transient, a sensor at the end of its range, gaps, clocks in another unit. The effect is found, or a message gives
//! advice.

use hyst_hw::{Bed, Plant, PlantConfig};
use hyst_ident::diagnose::{DiagnoseOptions, Diagnosis, diagnose};
use hyst_ident::excite::{Identification, Limits};
use hyst_ident::fit::{FitError, FitOptions, fit};
use hyst_ident::model::{Effect, Kind};
use hyst_ident::record::{ColumnMap, Columns, Need, OutputUnit, Record};
use hyst_ident::simulate::{Zero, simulate};
use hyst_tests::{Lab, measured, played};

/// Lag of the actuator \[s\].
const LAG: f64 = 0.004;

/// Returns an actuator with a lag of 4 ms, noise of 5 nm and a stroke of about 20 µm.
fn lagging() -> PlantConfig {
    let mut config = PlantConfig::random_on(Bed::Relays, 41, &["lag"]).unwrap();
    config.lag.as_mut().unwrap().seconds = LAG;
    config.sensor.max_rate_hz = 50_000.0;
    config
}

/// Plays the standard drive of 18 s at 1 kHz on an actuator.
fn record_of(config: &PlantConfig) -> Record {
    record_at(config, 1000.0, 18.0, OutputUnit::Micrometre)
}

fn record_at(config: &PlantConfig, rate_hz: f64, duration_s: f64, unit: OutputUnit) -> Record {
    let mut plant = Plant::new(config.clone()).unwrap();
    let range = hyst_hw::Daq::capabilities(&plant).voltage;
    let limits = Limits { rate_hz, lo_v: range.min_v, hi_v: range.max_v, slew_v_per_s: None };
    let standard = Identification::at_rate(rate_hz, 41);
    let hold_s = standard.hold_s * duration_s / standard.duration_s;
    let drive = Identification { duration_s, hold_s, rest_s: 0.5, ..standard }.drive(&limits).unwrap();
    played(&mut plant, &drive, rate_hz, unit, "lab")
}

/// Returns the record with changed columns.
fn changed(record: &Record, change: impl FnOnce(&mut Columns)) -> Record {
    let label = |s: &std::ops::Range<usize>, k| vec![k; s.len()];
    let mut columns = Columns {
        name: "lab".into(),
        segment: Some(record.segments().iter().zip(0..).flat_map(|(s, k)| label(s, k)).collect()),
        time: record.time().to_vec(),
        input: Some(record.input().to_vec()),
        output: record.output_unit().map(|unit| (unit, record.output().unwrap().to_vec())),
        temperature: record.temperature().map(<[f64]>::to_vec),
        ..Columns::default()
    };
    change(&mut columns);
    Record::from_samples(columns).unwrap()
}

fn outputs(columns: &mut Columns) -> &mut [f64] {
    &mut columns.output.as_mut().unwrap().1
}

fn diagnosed(record: &Record) -> Diagnosis {
    let model = fit(record, Kind::Pi, &FitOptions::default()).unwrap();
    diagnose(record, None, &model, &DiagnoseOptions::default(), &|_| {}).unwrap()
}

fn names(d: &Diagnosis) -> Vec<&'static str> {
    d.findings.effects.iter().map(|e| e.name.name()).collect()
}

/// Asserts that exactly the lag is named, with the time constant of the actuator.
#[track_caller]
fn assert_lag(record: &Record) -> Diagnosis {
    let d = diagnosed(record);
    assert_eq!(names(&d), ["lag"], "{:#?}", d.findings);
    let seconds = d.findings.effects[0].parameters["seconds"].value;
    assert!((seconds / LAG - 1.0).abs() < 0.03, "{seconds} s");
    d
}

#[test]
fn an_offset_of_many_strokes_changes_nothing() {
    assert_lag(&changed(&record_of(&lagging()), |c| outputs(c).iter_mut().for_each(|y| *y += 4321.0)));
}

#[test]
fn a_lag_is_found_in_one_segment_without_rests() {
    let config = lagging();
    let mut plant = Plant::new(config).unwrap();
    let range = hyst_hw::Daq::capabilities(&plant).voltage;
    let limits = Limits { rate_hz: 1000.0, lo_v: range.min_v, hi_v: range.max_v, slew_v_per_s: None };
    let drive =
        Identification { duration_s: 18.0, hold_s: 1.0, ..Identification::at_rate(1000.0, 41) }.drive(&limits).unwrap();
    assert_lag(&measured(&mut plant, &[drive.voltage()], 1000.0, OutputUnit::Micrometre, "lab"));
}

/// At one frequency a lag, a delay and a rate-dependence are indistinguishable: each is named with its alternatives.
#[test]
fn a_single_tone_names_indistinguishable_effects_with_their_alternatives() {
    let mut plant = Plant::new(lagging()).unwrap();
    let high = hyst_hw::Daq::capabilities(&plant).voltage.max_v;
    let drive: Vec<f64> = (0..10_000)
        .map(|k| 0.5 * high * (1.0 - (2.0 * std::f64::consts::PI * 10.0 * f64::from(k) * 1e-3).cos()))
        .collect();
    let d = diagnosed(&measured(&mut plant, &[&drive], 1000.0, OutputUnit::Micrometre, "lab"));
    let alike = [Effect::Lag, Effect::Delay, Effect::RateDependence, Effect::Resonance];
    for effect in &d.findings.effects {
        assert!(alike.contains(&effect.name), "{:#?}", d.findings);
        let others = effect.alternatives.iter().filter(|a| a.indistinguishable && alike.contains(&a.name)).count();
        assert!(others > 0, "{:#?}", d.findings);
    }
}

/// The rows of the transient are excluded, not explained by an effect.
#[test]
fn a_start_up_transient_is_excluded() {
    let record = changed(&record_of(&lagging()), |c| {
        outputs(c).iter_mut().enumerate().take(1500).for_each(|(k, y)| *y += 4.0 * (-(k as f64) / 60.0).exp());
    });
    let after = assert_lag(&record).findings.after.train.unwrap();
    assert!(after.rmse_all_rows > 1.5 * after.rmse, "{after:?}");
}

#[test]
fn missing_rows_start_a_segment_with_a_note() {
    let lab = Lab::new();
    let mut csv = Vec::new();
    record_of(&lagging()).write_csv(&mut csv).unwrap();
    let text = String::from_utf8(csv).unwrap();
    let with_gap: Vec<&str> = text.lines().take(2000).chain(text.lines().skip(2050)).collect();
    lab.write("train.csv", with_gap.join("\n"));
    let ran = lab.ok("fit train.csv --model pi -o model.json");
    assert!(ran.stderr.contains("an interruption of") && ran.stderr.contains("segment"), "{}", ran.stderr);
}

#[test]
fn a_clock_in_another_unit_is_detected() {
    let lab = Lab::new();
    let mut csv = Vec::new();
    let slow = changed(&record_of(&lagging()), |c| c.time.iter_mut().for_each(|t| *t *= 1e3));
    slow.write_csv(&mut csv).unwrap();
    lab.write("train.csv", csv);
    let ran = lab.ok("fit train.csv --model pi -o model.json");
    assert!(ran.stderr.contains("--map time_ms"), "{}", ran.stderr);
    let ran = lab.ok("fit train.csv --map time_ms=time_s --model pi -o model-ms.json");
    assert!(!ran.stderr.contains("--map time_ms"), "{}", ran.stderr);
}

/// Tests of a minute or more. `cargo xtask test` skips them; `cargo xtask test --long` and `cargo test` run them.
mod long {
    use super::*;

    /// The range of the sensor ends within the stroke: the rows at its end are reported and excluded.
    #[test]
    fn rows_at_the_end_of_the_sensor_range_are_excluded() {
        let record = record_of(&lagging());
        let (low, high) =
            record.output().unwrap().iter().fold((f64::MAX, f64::MIN), |(l, h), y| (l.min(*y), h.max(*y)));
        let end = low + 0.85 * (high - low);
        let clipped = changed(&record, |c| outputs(c).iter_mut().for_each(|y| *y = y.min(end)));
        let model = fit(&clipped, Kind::Pi, &FitOptions::default()).unwrap();
        assert!(model.fitted_on[0].settling_rows > 500, "{:?}", model.fitted_on);
        assert_lag(&clipped);

        let lab = Lab::new();
        let mut csv = Vec::new();
        clipped.write_csv(&mut csv).unwrap();
        lab.write("train.csv", csv);
        let ran = lab.ok("fit train.csv --model pi -o model.json");
        assert!(
            ran.stderr.contains("end of its range") && ran.stderr.contains("leaves these rows out"),
            "{}",
            ran.stderr
        );
    }

    #[test]
    fn a_lag_is_found_at_200_hz_and_50_khz() {
        assert_lag(&record_at(&lagging(), 200.0, 36.0, OutputUnit::Micrometre));
        // 2 s at 50 kHz: decaying loops, fast loops, stairs.
        let mut plant = Plant::new(lagging()).unwrap();
        let high = hyst_hw::Daq::capabilities(&plant).voltage.max_v;
        let row = |seconds: f64, f: &dyn Fn(f64) -> f64| -> Vec<f64> {
            (0..(seconds * 5e4) as usize).map(|k| high * f(k as f64 / 5e4)).collect()
        };
        let wave = |hz: f64, t: f64| 0.5 - 0.5 * (std::f64::consts::TAU * hz * t).cos();
        let decaying = row(1.0, &|t| wave(6.0, t) * (1.0 - 0.8 * t));
        let fast = row(0.5, &|t| wave(2.0, t) * (0.6 + 0.4 * (std::f64::consts::TAU * 45.0 * t).sin()));
        let stairs =
            row(0.5, &|t| 0.2 + 0.6 * ((7.3 * (8.0 * t).floor()).sin() * 0.5 + 0.5) * (8.0 * t).fract().min(0.2) / 0.2);
        let segments = [decaying.as_slice(), &fast, &stairs];
        assert_lag(&measured(&mut plant, &segments, 50_000.0, OutputUnit::Micrometre, "lab"));
    }

    /// The rows stay excluded although the output without the drift is not constant there. The start-up rows of a
    /// transient are excluded too.
    #[test]
    fn rows_at_the_end_of_the_range_of_a_drifting_sensor_are_excluded() {
        let record = record_of(&lagging());
        let span = record.output().unwrap().iter().fold(f64::MIN, |h, y| h.max(*y));
        let rate = 0.004 * span; // µm/s: 7 % of the stroke over the record
        let end = 0.85 * span;
        for transient in [0.0, 0.3 * span] {
            let clipped = changed(&record, |c| {
                let times = c.time.clone();
                for (k, (y, t)) in outputs(c).iter_mut().zip(times).enumerate() {
                    *y = (*y + rate * t + transient * (-(k as f64) / 60.0).exp()).min(end);
                }
            });
            let d = diagnosed(&clipped);
            assert_eq!(names(&d), ["lag", "drift"], "{:#?}", d.findings);
            let found = |k: usize, name: &str| d.findings.effects[k].parameters[name].value;
            assert!((found(0, "seconds") / LAG - 1.0).abs() < 0.03, "{} s", found(0, "seconds"));
            assert!((found(1, "per_second") / rate - 1.0).abs() < 0.05, "{} of {rate}", found(1, "per_second"));
            assert!(d.findings.after.train.unwrap().rmse < 0.01 * span, "{:?}", d.findings.after);
        }
    }

    #[test]
    fn a_lag_is_found_in_other_units() {
        assert_lag(&record_at(&lagging(), 1000.0, 18.0, OutputUnit::Newton));
        let record = record_of(&lagging());
        assert_lag(&changed(&record, |c| {
            let (unit, y) = c.output.as_mut().unwrap();
            *unit = OutputUnit::Nanometre;
            y.iter_mut().for_each(|y| *y *= 1e3);
        }));
    }

    /// A model can be fitted to a falling output. A model of a rising output is rejected with advice, and the advice
    /// works.
    #[test]
    fn a_falling_output_is_fitted_and_needs_a_falling_model() {
        let rising = record_of(&lagging());
        let falling = changed(&rising, |c| outputs(c).iter_mut().for_each(|y| *y = -*y));
        assert_lag(&falling);
        let model = fit(&rising, Kind::Pi, &FitOptions::default()).unwrap();
        let error = diagnose(&falling, None, &model, &DiagnoseOptions::default(), &|_| {}).unwrap_err();
        assert!(
            matches!(error, FitError::Falling { .. }) && error.to_string().contains("--map displacement_um=-"),
            "{error}"
        );
        // Convex and searched fits are those of the rising record with the opposite sign.
        for kind in [Kind::Pi, Kind::Preisach, Kind::BoucWen] {
            let fitted = |record: &Record| {
                let model = fit(record, kind, &FitOptions::default()).unwrap();
                simulate(&model, record, Zero::None).unwrap()
            };
            let [up, down] = [&rising, &falling].map(fitted);
            let largest = up.predicted.iter().fold(0.0, |m: f64, y| m.max(y.abs()));
            let difference = up.predicted.iter().zip(&down.predicted).fold(0.0, |m: f64, (a, b)| m.max((a + b).abs()));
            assert!(difference < 1e-3 * largest, "{kind:?}: {difference} of {largest}");
        }
        let mut csv = Vec::new();
        falling.write_csv(&mut csv).unwrap();
        let map = ColumnMap::parse(["displacement_um=-displacement_um"]).unwrap();
        assert_lag(&Record::parse("lab", &csv, &map, Need::InputAndOutput).unwrap());
    }
}
