//! Playing a drive on a device and keeping what came back as a record.

use std::ops::ControlFlow;

use hyst_hw::{Daq, RecordOptions, Recording, Sample};
use hyst_ident::excite::Drive;
use hyst_ident::record::{Columns, OutputUnit, Record};

use crate::exit::{CommandError, CommandResult, Exit};

/// Plays a designed drive, segment by segment with rests between, and returns the record.
pub(super) fn record<D: Daq>(daq: &mut D, drive: &Drive, name: &str) -> CommandResult<Record> {
    let segments: Vec<&[f64]> = drive.segments().iter().map(|rows| &drive.voltage()[rows.clone()]).collect();
    let rate_hz = 1.0 / drive.to_record(name)?.sample_period();
    let recording = hyst_hw::record(daq, &segments, &RecordOptions::at(rate_hz), |_| ControlFlow::Continue(()))
        .map_err(|failure| CommandError::new(Exit::DeviceLost, anyhow::anyhow!("{failure}")))?;
    Ok(Record::from_samples(columns(&recording, name))?)
}

fn columns(recording: &Recording, name: &str) -> Columns {
    let samples = || recording.segments.iter().flat_map(|s| &s.samples);
    let all = |f: &dyn Fn(&Sample) -> Option<f64>| samples().map(f).collect::<Option<Vec<f64>>>();
    let label = |(k, s): (usize, &hyst_hw::SegmentRecord)| vec![k as i64; s.samples.len()];
    Columns {
        name: name.to_owned(),
        segment: Some(recording.segments.iter().enumerate().flat_map(label).collect()),
        time: samples().map(|s| s.time_s).collect(),
        input_column: "voltage_v".to_owned(),
        input: Some(samples().map(|s| s.drive_v).collect()),
        output: Some((OutputUnit::Micrometre, samples().map(|s| s.output).collect())),
        temperature: all(&|s| s.temperature_degc),
        load: all(&|s| s.load_n),
    }
}
