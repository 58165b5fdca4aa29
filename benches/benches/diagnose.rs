//! Time and memory of a diagnosis for records of 10,000, 100,000 and 1,000,000 rows.
//!
//! The times depend on the machine. The last column is constant if the cost is linear in the number of rows.

use std::ops::ControlFlow;
use std::time::Instant;

use hyst_hw::{Bed, Daq, Plant, PlantConfig, RecordOptions};
use hyst_ident::diagnose::{DiagnoseOptions, diagnose};
use hyst_ident::excite::{Identification, Limits};
use hyst_ident::fit::{FitOptions, fit};
use hyst_ident::model::Kind;
use hyst_ident::record::{Columns, OutputUnit, Record};

/// Returns a record of the identification drive on an actuator with creep, with about `rows` rows.
fn record(rows: f64) -> Record {
    let seconds = 36.0;
    let rate_hz = rows / seconds;
    let mut config = PlantConfig::random_on(Bed::Plays, 5, &["creep", "lag"]).expect("a valid actuator");
    config.sensor.max_rate_hz = 100_000.0;
    let mut plant = Plant::new(config).expect("a valid actuator");
    let range = plant.capabilities().voltage;
    let limits = Limits { rate_hz, lo_v: range.min_v, hi_v: range.max_v, slew_v_per_s: None };
    let drive = Identification::at_rate(rate_hz, 5).drive(&limits).expect("a valid drive");
    let segments: Vec<&[f64]> = drive.segments().iter().map(|rows| &drive.voltage()[rows.clone()]).collect();
    let recording = hyst_hw::record(&mut plant, &segments, &RecordOptions::at(rate_hz), |_| ControlFlow::Continue(()))
        .expect("a simulated actuator plays a drive within its range");
    let samples = || recording.segments.iter().flat_map(|s| &s.samples);
    let labels = (0..).zip(&recording.segments).flat_map(|(k, s)| std::iter::repeat_n(k, s.samples.len()));
    Record::from_samples(Columns {
        name: "bench".into(),
        segment: Some(labels.collect()),
        time: samples().map(|s| s.time_s).collect(),
        input: Some(samples().map(|s| s.drive_v).collect()),
        output: Some((OutputUnit::Micrometre, samples().map(|s| s.output).collect())),
        ..Columns::default()
    })
    .expect("a recording is a valid record")
}

/// Returns the peak memory of the process \[MB\]; `None` if the system does not report it.
fn peak_megabytes() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find(|line| line.starts_with("VmHWM:"))?;
    line.split_whitespace().nth(1)?.parse::<f64>().ok().map(|kb| kb / 1024.0)
}

fn main() {
    println!("{:>9} {:>10} {:>9} {:>12} {:>14}", "rows", "base", "seconds", "peak MB", "s per 10 k rows");
    for rows in [1e4, 1e5, 1e6] {
        let record = record(rows);
        for kind in [Kind::Pi, Kind::Preisach] {
            let model = fit(&record, kind, &FitOptions::default()).expect("a fit");
            let started = Instant::now();
            let found = diagnose(&record, None, &model, &DiagnoseOptions::default(), &|_| {}).expect("a diagnosis");
            let seconds = started.elapsed().as_secs_f64();
            let named: Vec<&str> = found.findings.effects.iter().map(|e| e.name.name()).collect();
            let memory = peak_megabytes().map_or_else(|| "?".into(), |m| format!("{m:.0}"));
            let per_10k = 1e4 * seconds / record.rows() as f64;
            println!(
                "{:>9} {:>10} {seconds:>9.1} {memory:>12} {per_10k:>14.2}   {named:?}",
                record.rows(),
                kind.name()
            );
        }
    }
}
