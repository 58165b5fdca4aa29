//! What a device measured, as a record.

use hyst_hw::{Recording, Sample};
use hyst_ident::record::{Columns, Extra, OutputUnit, Record};

use crate::exit::CommandResult;
use crate::output::{self, Target};
use crate::text;

/// The device's unit, as records know it.
pub(crate) fn unit(unit: hyst_hw::OutputUnit) -> OutputUnit {
    match unit {
        hyst_hw::OutputUnit::Micrometre => OutputUnit::Micrometre,
        hyst_hw::OutputUnit::Nanometre => OutputUnit::Nanometre,
        hyst_hw::OutputUnit::Millimetre => OutputUnit::Millimetre,
        hyst_hw::OutputUnit::Newton => OutputUnit::Newton,
    }
}

/// What was measured, without the ramps, as a record.
pub(crate) fn to_record(recording: &Recording, name: &str, unit: OutputUnit) -> CommandResult<Record> {
    let samples = || recording.segments.iter().flat_map(|segment| &segment.samples);
    let labels = (0..).zip(&recording.segments).flat_map(|(k, s)| std::iter::repeat_n(k, s.samples.len()));
    let columns = Columns {
        name: name.to_owned(),
        segment: Some(labels.collect()),
        time: recording.segments.iter().flat_map(|segment| times(&segment.samples)).collect(),
        input: Some(samples().map(|s| s.drive_v).collect()),
        output: Some((unit, samples().map(|s| s.output).collect())),
        // All samples of a device have a channel, or none has.
        temperature: samples().map(|s| s.temperature_degc).collect(),
        load: samples().map(|s| s.load_n).collect(),
        ..Columns::default()
    };
    Ok(Record::from_samples(columns)?)
}

/// Times of a segment, moved by less than a nanosecond so that the first one is a short number.
fn times(samples: &[Sample]) -> impl Iterator<Item = f64> {
    let first = samples.first().map_or(0.0, |sample| sample.time_s);
    let shift = (first * 1e9).round() / 1e9 - first;
    samples.iter().map(move |sample| sample.time_s + shift)
}

/// Writes what was measured until a run ended before its time, with what is known of each of its rows, and says so; also if it cannot, since
/// what ended the run is what has to be told at last.
pub(crate) fn keep_partial(
    mut recording: Recording,
    beside: Vec<(String, Vec<f64>)>,
    target: &Target,
    unit: OutputUnit,
) {
    // What a sensor without a number showed has ended the run.
    let whole = |s: &Sample| [Some(s.output), s.temperature_degc, s.load_n].into_iter().flatten().all(f64::is_finite);
    let mut kept = Vec::new();
    for segment in &mut recording.segments {
        // A row alone has no sample period.
        let enough = segment.samples.iter().filter(|sample| whole(sample)).count() > 1;
        kept.extend(segment.samples.iter().map(|sample| enough && whole(sample)));
        segment.samples.retain(|sample| enough && whole(sample));
    }
    recording.segments.retain(|segment| !segment.samples.is_empty());
    let rows: usize = recording.segments.iter().map(|segment| segment.samples.len()).sum();
    if rows == 0 {
        return;
    }
    let of_kept = |values: Vec<f64>| values.into_iter().zip(&kept).filter_map(|(value, kept)| kept.then_some(value));
    let beside: Vec<(String, Vec<f64>)> =
        beside.into_iter().map(|(name, values)| (name, of_kept(values).collect())).collect();
    let extra: Vec<Extra<'_>> = beside.iter().map(|(name, values)| Extra::numbers(name, values)).collect();
    let written = to_record(&recording, &target.to_string(), unit)
        .and_then(|record| target.write_beside_older(|out| record.write_with(out, &extra).map_err(output::io_error)));
    let rows = text::count(rows, "row");
    output::say(&match written {
        Ok(()) => format!("note: what was measured until then, {rows}, is kept in {target}"),
        Err(error) => format!("warning: what was measured until then, {rows}, cannot be kept: {}", error.text()),
    });
}
