//! Converts recordings of a device to records.

use hyst_hw::{Recording, Sample, SegmentRecord};
use hyst_ident::record::{Columns, Extra, OutputUnit, Record};

use crate::exit::CommandResult;
use crate::output::{self, Target};
use crate::text;

/// Converts the output unit of a device to that of records.
pub(crate) fn unit(unit: hyst_hw::OutputUnit) -> OutputUnit {
    match unit {
        hyst_hw::OutputUnit::Micrometre => OutputUnit::Micrometre,
        hyst_hw::OutputUnit::Nanometre => OutputUnit::Nanometre,
        hyst_hw::OutputUnit::Millimetre => OutputUnit::Millimetre,
        hyst_hw::OutputUnit::Newton => OutputUnit::Newton,
    }
}

/// Returns the measured segments as a record, without the ramps.
pub(crate) fn to_record(recording: &Recording, name: &str, unit: OutputUnit) -> CommandResult<Record> {
    let samples = || recording.segments.iter().flat_map(|segment| &segment.samples);
    let labels = (0..).zip(&recording.segments).flat_map(|(k, s)| std::iter::repeat_n(k, s.samples.len()));
    let columns = Columns {
        name: name.to_owned(),
        segment: Some(labels.collect()),
        time: recording.segments.iter().flat_map(|segment| times(&segment.samples)).collect(),
        input: Some(samples().map(|s| s.drive_v).collect()),
        output: Some((unit, samples().map(|s| s.output).collect())),
        // A channel is in all samples of a device or in none.
        temperature: samples().map(|s| s.temperature_degc).collect(),
        load: samples().map(|s| s.load_n).collect(),
        ..Columns::default()
    };
    Ok(Record::from_samples(columns)?)
}

/// Returns the times of a segment, shifted by less than 1 ns so that the first time is a short number.
fn times(samples: &[Sample]) -> impl Iterator<Item = f64> {
    let first = samples.first().map_or(0.0, |sample| sample.time_s);
    let shift = (first * 1e9).round() / 1e9 - first;
    samples.iter().map(move |sample| sample.time_s + shift)
}

/// Returns the number of sample periods that are missing before `next`.
pub(crate) fn missing(before: &Sample, next: &Sample, rate_hz: f64) -> usize {
    let periods = ((next.time_s - before.time_s) * rate_hz).round() as usize;
    periods.saturating_sub(1)
}

/// Splits segments at gaps, because the rows of a record's segment are evenly spaced in time.
pub(crate) fn split(recording: Recording) -> Recording {
    let rate_hz = recording.rate_hz;
    let mut segments = Vec::with_capacity(recording.segments.len());
    for SegmentRecord { approach, samples, retreat } in recording.segments {
        let mut parts = samples.chunk_by(|a, b| missing(a, b, rate_hz) == 0).map(<[Sample]>::to_vec);
        segments.push(SegmentRecord { approach, samples: parts.next().unwrap_or_default(), retreat: Vec::new() });
        segments.extend(parts.map(|samples| SegmentRecord { samples, ..SegmentRecord::default() }));
        if let Some(last) = segments.last_mut() {
            last.retreat = retreat;
        }
    }
    Recording { segments, ..recording }
}

/// Further columns of a recording: a name, and one value for each row of all segments.
pub(crate) type ExtraColumns = Vec<(String, Vec<f64>)>;

/// Returns further columns as a record writes them.
pub(crate) fn extra(columns: &ExtraColumns) -> Vec<Extra<'_>> {
    columns.iter().map(|(name, values)| Extra::numbers(name, values)).collect()
}

/// Writes the data of a run that ended early and prints a note.
/// A failure is only printed, because the command reports the error that ended the run.
pub(crate) fn keep_partial(recording: Recording, columns: ExtraColumns, target: &Target, unit: OutputUnit) {
    let moved =
        recording.segments.iter().any(|s| !(s.approach.is_empty() && s.samples.is_empty() && s.retreat.is_empty()));
    let (recording, columns) = complete_rows(recording, columns);
    let rows: usize = recording.segments.iter().map(|segment| segment.samples.len()).sum();
    if rows == 0 {
        if moved {
            output::say(&format!("note: the run ended before a segment was measured; {target} is not written"));
        }
        return;
    }
    let written = to_record(&recording, &target.to_string(), unit).and_then(|record| {
        target.write_measured(|out| record.write_with(out, &extra(&columns)).map_err(output::io_error))
    });
    let rows = text::count(rows, "row");
    output::say(&match written {
        Ok(()) => format!("note: the data measured until then ({rows}) are saved in {target}"),
        Err(error) => format!("warning: the data measured until then ({rows}) could not be saved: {}", error.text()),
    });
}

/// Returns the rows and columns that a record can hold.
///
/// Rows with a sensor value that is not finite are removed. Segments are split at gaps. Segments of one row, which have
/// no sample period, are removed. Columns with a value that is not finite are removed.
fn complete_rows(mut recording: Recording, mut columns: ExtraColumns) -> (Recording, ExtraColumns) {
    let finite = |s: &Sample| [Some(s.output), s.temperature_degc, s.load_n].into_iter().flatten().all(f64::is_finite);
    let keep = |columns: &mut ExtraColumns, kept: &[bool]| {
        for (_, values) in columns {
            let mut kept = kept.iter();
            values.retain(|_| kept.next().is_some_and(|kept| *kept));
        }
    };
    let kept: Vec<bool> = recording.segments.iter().flat_map(|s| &s.samples).map(finite).collect();
    recording.segments.iter_mut().for_each(|segment| segment.samples.retain(finite));
    keep(&mut columns, &kept);
    let mut recording = split(recording);
    let lengths = recording.segments.iter().map(|segment| segment.samples.len());
    let kept: Vec<bool> = lengths.flat_map(|rows| std::iter::repeat_n(rows > 1, rows)).collect();
    recording.segments.retain(|segment| segment.samples.len() > 1);
    keep(&mut columns, &kept);
    columns.retain(|(_, values)| values.iter().all(|value| value.is_finite()));
    (recording, columns)
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Returns the sample of a period at 100 Hz.
    pub(crate) fn at(period: u32) -> Sample {
        let time_s = f64::from(period) / 100.0;
        Sample { time_s, drive_v: 0.0, output: 0.0, temperature_degc: None, load_n: None, force_n: None }
    }

    #[test]
    fn a_recording_is_split_at_gaps() {
        let of = |approach: &[u32], samples: &[u32], retreat: &[u32]| {
            let [approach, samples, retreat] =
                [approach, samples, retreat].map(|periods| periods.iter().map(|p| at(*p)).collect());
            SegmentRecord { approach, samples, retreat }
        };
        let whole = Recording { rate_hz: 100.0, segments: vec![of(&[1], &[2, 3, 6, 7], &[8]), of(&[20], &[], &[21])] };
        let parts = split(whole).segments;
        assert_eq!(parts, [of(&[1], &[2, 3], &[]), of(&[], &[6, 7], &[8]), of(&[20], &[], &[21])]);
    }

    #[test]
    fn kept_rows_keep_their_reference() {
        let lost = |period| Sample { output: f64::NAN, ..at(period) };
        let segment = |samples: &[Sample]| SegmentRecord { samples: samples.to_vec(), ..SegmentRecord::default() };
        let segments = vec![
            segment(&[at(1), at(2), lost(3), at(4), at(5), at(6)]),
            // One row on each side of a gap.
            segment(&[at(20), at(23)]),
            segment(&[at(40), at(41), lost(42)]),
        ];
        let named = |name: &str, values: Vec<f64>| (name.to_owned(), values);
        let reference: Vec<f64> = (0..11).map(f64::from).collect();
        let force = [vec![0.5; 9], vec![f64::NAN; 2]].concat();
        let kept = complete_rows(
            Recording { rate_hz: 100.0, segments },
            vec![named("reference_um", reference), named("estimated_force_n", force)],
        );
        let parts = [&[at(1), at(2)][..], &[at(4), at(5), at(6)], &[at(40), at(41)]].map(segment);
        assert_eq!(kept.0.segments, parts);
        assert_eq!(kept.1, [named("reference_um", vec![0.0, 1.0, 3.0, 4.0, 5.0, 8.0, 9.0])]);
    }
}
