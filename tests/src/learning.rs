//! Helpers for tests of iterative learning: identification experiment, references, repeated runs, wrong models.

use std::ops::ControlFlow;

use hyst_hw::{RecordOptions, record};
use hyst_ident::diagnose::{DiagnoseOptions, diagnose};
use hyst_ident::excite::{Identification, Limits};
use hyst_ident::fit::{FitOptions, fit};
use hyst_ident::model::{Base, Kind, Model};
use hyst_ident::record::{Columns, OutputUnit, Record};

use crate::other_bench::OtherDevice;

/// Names, frequencies \[Hz\] and durations \[s\] of the references.
pub const REFERENCES: [(&str, f64, f64); 4] =
    [("triangle 1 Hz", 1.0, 4.0), ("triangle 10 Hz", 10.0, 1.0), ("triangle 30 Hz", 30.0, 0.5), ("stairs", 0.25, 4.0)];

/// Returns one of [`REFERENCES`] between two outputs \[µm\].
///
/// # Panics
/// Never: the reference is a valid record.
pub fn reference(which: usize, rate_hz: f64, low: f64, high: f64) -> Record {
    let (name, hz, seconds) = REFERENCES[which];
    let rows = (seconds * rate_hz) as usize;
    let triangle = |t: f64| 1.0 - (2.0 * (t * hz).fract() - 1.0).abs();
    // Six levels, each reached by a smooth rise in 5 % of its duration.
    let stair = |x: f64| {
        let (level, part) = ((6.0 * x).floor(), (6.0 * x).fract());
        let rise = (part / 0.05).min(1.0);
        ((level + rise * rise * (3.0 - 2.0 * rise)) / 7.0).min(1.0)
    };
    let value = |t: f64| low + (high - low) * if name == "stairs" { stair((t * hz).fract()) } else { triangle(t) };
    let time: Vec<f64> = (0..rows).map(|k| k as f64 / rate_hz).collect();
    let values = time.iter().map(|t| value(*t)).collect();
    Record::from_samples(Columns {
        name: name.into(),
        time,
        output: Some((OutputUnit::Micrometre, values)),
        ..Columns::default()
    })
    .expect("a reference")
}

/// Identifies a model of the device: standard experiment, fit and, if `diagnosed`, diagnosis.
///
/// # Panics
/// If one of them fails.
pub fn identify(device: &mut OtherDevice, diagnosed: bool) -> Model {
    let bench = device.bench();
    let limits = Limits { rate_hz: bench.rate_hz, lo_v: 0.0, hi_v: bench.volts, slew_v_per_s: None };
    let drive = Identification { duration_s: 20.0, ..Identification::at_rate(bench.rate_hz, 1) }
        .drive(&limits)
        .expect("a drive");
    let segments: Vec<&[f64]> = drive.segments().iter().map(|rows| &drive.voltage()[rows.clone()]).collect();
    let measured = record(device, &segments, &RecordOptions::at(bench.rate_hz), |_| ControlFlow::Continue(()))
        .expect("a recording");
    let (mut time, mut input, mut output, mut segment) = (vec![], vec![], vec![], vec![]);
    for (label, part) in measured.segments.iter().enumerate() {
        for s in &part.samples {
            time.push(s.time_s);
            input.push(s.drive_v);
            output.push(s.output);
            segment.push(label as i64);
        }
    }
    let record = Record::from_samples(Columns {
        name: "train".into(),
        segment: Some(segment),
        time,
        input: Some(input),
        output: Some((OutputUnit::Micrometre, output)),
        ..Columns::default()
    })
    .expect("a record");
    let base = fit(&record, Kind::Pi, &FitOptions::default()).expect("a fit");
    if !diagnosed {
        return base;
    }
    diagnose(&record, None, &base, &DiagnoseOptions::default(), &|_| {}).map_or(base, |found| found.extended)
}

/// Plays a drive `plays` times, each from rest, and returns the outputs. A first run is discarded: the memory of
/// earlier drives acts on it.
///
/// # Panics
/// Never: the device accepts every drive.
pub fn play(device: &mut OtherDevice, drive: &[f64], plays: usize) -> Vec<Vec<f64>> {
    let options = RecordOptions { settle_s: 2.0, ..RecordOptions::at(device.bench().rate_hz) };
    let segments = vec![drive; plays + 1];
    let measured = record(device, &segments, &options, |_| ControlFlow::Continue(())).expect("a recording");
    measured.segments.iter().skip(1).map(|s| s.samples.iter().map(|s| s.output).collect()).collect()
}

/// Multiplies gain and weights by a factor: the model then has a wrong gain.
///
/// # Panics
/// If the model is not of kind `pi`.
pub fn scale_gain(model: &mut Model, factor: f64) {
    let Base::Pi(pi) = &mut model.base else { panic!("a model of kind pi") };
    pi.gain *= factor;
    pi.weights.iter_mut().for_each(|weight| *weight *= factor);
}
