//! Logs of runs: MCAP files of samples, read as records.
//!
//! A log has every sample as JSON on the channel [`TOPIC`]. The metadata record `run` describes the run, and the model
//! is attached as `model.json`. A truncated log (for example after a loss of power) is read up to its end. Of a damaged
//! log every intact chunk is read.

mod records;

use std::collections::BTreeMap;

use mcap::records::{Metadata, Record as Entry};
use serde::{Deserialize, Deserializer, Serialize};

use super::error::RecordError;
use super::losses::Losses;
use super::{OutputUnit, Record};
pub use records::LogRecords;
use records::MAGIC;

/// The channel of the samples.
pub const TOPIC: &str = "/actuator/sample";
/// The channel of the events during a run.
pub const EVENTS: &str = "/actuator/event";

/// One sample of a log.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct LogSample {
    /// Time of the clock of the device \[s\].
    pub time_s: f64,
    /// Segment, counted from 0.
    pub segment: u64,
    /// Phase of the run: `approach`, `record` or `retreat`.
    pub phase: String,
    /// Voltage that was applied \[V\].
    pub drive_v: f64,
    /// Measured output \[output unit\]; NaN if the sensor gave no value.
    #[serde(deserialize_with = "null_as_nan")]
    pub output: f64,
    /// Reference \[output unit\].
    pub reference: Option<f64>,
    /// Temperature \[°C\].
    pub temperature_degc: Option<f64>,
    /// Load \[N\].
    pub load_n: Option<f64>,
    /// Force that was estimated during the run \[N\].
    pub estimated_force_n: Option<f64>,
}

/// An event during a run.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub struct LogEvent {
    /// Time of the clock of the device \[s\].
    pub time_s: f64,
    /// The kind of event, in one word.
    pub kind: String,
    /// The event in one sentence.
    pub text: String,
}

/// Deserializes null as NaN, which JSON cannot represent.
fn null_as_nan<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(from)?.unwrap_or(f64::NAN))
}

impl LogSample {
    /// Returns whether the sample belongs to the record, and not to the ramp before or after it.
    pub fn is_record(&self) -> bool {
        self.phase == "record"
    }
}

/// The contents of a log.
#[derive(Clone, Debug, Default)]
pub struct RunLog {
    /// Metadata of the run by key: device, unit, version and more. Keys of other metadata records begin with the name
    /// of the record and a point.
    pub metadata: BTreeMap<String, String>,
    /// The text of the model file, if a model computed the drive.
    pub model: Option<String>,
    /// The samples, in order.
    pub samples: Vec<LogSample>,
    /// The events, in order.
    pub events: Vec<LogEvent>,
    /// What is missing.
    pub lost: Losses,
}

/// Longest time step without a gap \[sample periods\].
const MAX_STEP_PERIODS: f64 = 1.5;

/// Returns whether `bytes` begin as an MCAP file does.
pub fn is_log(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

/// Returns whether `bytes` are a log of a run, and not an MCAP file with messages of another program.
pub(super) fn is_run_log(bytes: &[u8]) -> bool {
    let Some(entries) = is_log(bytes).then(|| LogRecords::new(bytes)).flatten() else { return false };
    let mut messages = false;
    for entry in entries {
        match entry {
            Entry::Channel(channel) if channel.topic == TOPIC => return true,
            Entry::Message { .. } => messages = true,
            _ => {}
        }
    }
    !messages || cfg!(not(feature = "mcap-messages"))
}

impl RunLog {
    /// Parses a log. `name` is the file name in messages.
    ///
    /// # Errors
    /// If the bytes are not an MCAP file, or the file has no samples of a run.
    pub fn parse(name: &str, bytes: &[u8]) -> Result<Self, RecordError> {
        let foreign = |what: String| RecordError::Log { file: name.to_owned(), what };
        let mut entries = LogRecords::new(bytes).ok_or_else(|| foreign("it is not an MCAP file".to_owned()))?;
        let mut log = Self::default();
        let (mut channel, mut happened) = (None, None);
        log.lost.cut_off = true;
        // An incomplete entry at the end ends the iteration.
        for entry in &mut entries {
            match entry {
                Entry::Metadata(Metadata { name, metadata }) if name == "run" => log.metadata.extend(metadata),
                // The request, and results known only at the end of the run, such as the accuracy of the clock of the
                // device.
                Entry::Metadata(Metadata { name, metadata }) => {
                    log.metadata.extend(metadata.into_iter().map(|(key, value)| (format!("{name}.{key}"), value)));
                }
                Entry::Attachment { header, data, .. } if header.name == "model.json" => {
                    log.model = Some(String::from_utf8_lossy(&data).into_owned());
                }
                Entry::Channel(c) if c.topic == TOPIC && c.message_encoding == "json" => channel = Some(c.id),
                Entry::Message { header, data } if Some(header.channel_id) == channel => {
                    let number = log.samples.len() + 1;
                    let sample = serde_json::from_slice(&data)
                        .map_err(|error| foreign(format!("message {number} of {TOPIC} is not a sample: {error}")))?;
                    log.samples.push(sample);
                }
                Entry::Channel(c) if c.topic == EVENTS && c.message_encoding == "json" => happened = Some(c.id),
                // Events are information only: an invalid event does not invalidate the samples.
                Entry::Message { header, data } if Some(header.channel_id) == happened => {
                    log.events.extend(serde_json::from_slice::<LogEvent>(&data));
                }
                Entry::Footer(_) => log.lost.cut_off = false,
                _ => {}
            }
        }
        log.lost.damaged = entries.damaged();
        log.split_at_gaps();
        match channel {
            Some(_) => Ok(log),
            None if log.lost.cut_off && log.lost.damaged == 0 => {
                Err(foreign(format!("it was cut off before the channel {TOPIC} and has no samples of a run")))
            }
            None => Err(foreign(format!("it has no channel {TOPIC} of JSON messages"))),
        }
    }

    /// Begins a new segment after each gap, because the drive during the gap is not known.
    fn split_at_gaps(&mut self) {
        let rate = self.metadata.get("sample_rate_hz").and_then(|rate| rate.parse::<f64>().ok());
        let Some(longest) =
            rate.map(|rate| MAX_STEP_PERIODS / rate).filter(|longest| longest.is_finite() && *longest > 0.0)
        else {
            return;
        };
        let mut before: Option<(u64, f64)> = None;
        for sample in &mut self.samples {
            let (segment, time_s) = (sample.segment, sample.time_s);
            if before.is_some_and(|(of, then)| of == segment && time_s - then > longest) {
                self.lost.holes += 1;
            }
            before = Some((segment, time_s));
            sample.segment = segment.saturating_add(self.lost.holes as u64);
        }
    }

    /// Returns the unit of output and reference; `None` if the log does not state it.
    pub fn unit(&self) -> Option<OutputUnit> {
        self.metadata.get("output_column").and_then(|column| OutputUnit::of_column(column))
    }

    /// Returns the samples of the record, without the ramps.
    ///
    /// The first rows of a device with preview have no reference yet and are omitted too.
    pub fn record_samples(&self) -> Vec<&LogSample> {
        self.chosen(false)
    }

    /// Returns the samples of the record, with or without the ramps before and after it.
    fn chosen(&self, with_ramps: bool) -> Vec<&LogSample> {
        let has = |of: fn(&LogSample) -> Option<f64>| self.samples.iter().any(|s| of(s).is_some());
        let (thermometer, load, followed) = (has(|s| s.temperature_degc), has(|s| s.load_n), has(|s| s.reference));
        let shown = |s: &LogSample| {
            s.output.is_finite() && (!thermometer || s.temperature_degc.is_some()) && (!load || s.load_n.is_some())
        };
        // If the last sample lacks a measured value, this ended the run, and the sample is dropped.
        let end = self.samples.len() - usize::from(self.samples.last().is_some_and(|last| !shown(last)));
        let mut follows = None;
        let wanted = |s: &&LogSample| {
            follows = s.reference.map(|_| s.segment).or(follows);
            // A device with preview outputs the reference later, so its first rows have no reference.
            with_ramps || s.is_record() && (!followed || follows == Some(s.segment))
        };
        self.samples[..end].iter().filter(wanted).filter(|s| s.output.is_finite()).collect()
    }

    /// Returns why the log has no samples of the record, and what to do.
    fn why_empty(&self) -> String {
        let samples = self.samples.len();
        if self.lost.damaged > 0 {
            return format!(
                "{} parts of the log are damaged, and none of the {samples} samples in the other parts belongs to it",
                self.lost.damaged
            );
        }
        if samples == 0 {
            return "it ends before the first sample; repeat the run and let it finish".to_owned();
        }
        if self.samples.iter().any(LogSample::is_record) {
            return "the sensor gave no value; check the sensor and repeat the run".to_owned();
        }
        format!("all {samples} samples belong to the ramps before and after it; repeat the run and let it finish")
    }

    /// Returns the samples of the record as CSV in the record format, with or without the ramps.
    ///
    /// # Errors
    /// If the log does not state the unit of the output.
    pub fn csv(&self, name: &str, with_ramps: bool) -> Result<String, RecordError> {
        let no_unit = || RecordError::Log {
            file: name.to_owned(),
            what: "its metadata do not state the unit of the output (key output_column)".into(),
        };
        type Of = fn(&LogSample) -> Option<f64>;
        let unit = self.unit().ok_or_else(no_unit)?;
        let chosen = self.chosen(with_ramps);
        let reference = format!("reference_{}", unit.suffix());
        let optional: [(&str, Of); 4] = [
            (&reference, |s| s.reference),
            ("temperature_degc", |s| s.temperature_degc),
            ("load_n", |s| s.load_n),
            ("estimated_force_n", |s| s.estimated_force_n),
        ];
        // A column is written only if every sample has a value.
        let optional: Vec<(&str, Of)> = optional
            .into_iter()
            .filter(|(_, of)| !chosen.is_empty() && chosen.iter().all(|s| of(s).is_some()))
            .collect();
        let mut text = format!("segment,time_s,voltage_v,{}", unit.column());
        optional.iter().for_each(|(column, _)| text.extend([",", column]));
        text.push('\n');
        for s in chosen {
            text += &format!("{},{},{},{}", s.segment, s.time_s, s.drive_v, s.output);
            optional.iter().for_each(|(_, of)| text += &format!(",{}", of(s).unwrap_or(f64::NAN)));
            text.push('\n');
        }
        Ok(text)
    }
}

impl Record {
    /// Makes a record of the samples of a log. Lines in messages are those of [`RunLog::csv`].
    pub(super) fn parse_log(
        name: &str,
        bytes: &[u8],
        map: &super::ColumnMap,
        need: super::Need,
    ) -> Result<Self, RecordError> {
        let log = RunLog::parse(name, bytes)?;
        if log.record_samples().is_empty() {
            return Err(RecordError::NothingAsked { file: name.to_owned(), what: log.why_empty() });
        }
        let text = log.csv(name, false)?;
        let record = Self::parse(name, text.as_bytes(), map, need)?.kept_as(bytes);
        Ok(Self { lost: log.lost, ..record })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Makes a sample with optional reference and temperature.
    fn sample(k: u8, segment: u64, phase: &str, reference: Option<f64>, degc: Option<f64>) -> LogSample {
        LogSample {
            time_s: f64::from(k),
            segment,
            phase: phase.to_owned(),
            drive_v: 1.0,
            output: 2.0,
            reference,
            temperature_degc: degc,
            load_n: None,
            estimated_force_n: None,
        }
    }

    fn log(samples: Vec<LogSample>) -> RunLog {
        let metadata = BTreeMap::from([("output_column".to_owned(), "displacement_um".to_owned())]);
        RunLog { metadata, samples, ..RunLog::default() }
    }

    #[test]
    fn ramps_rows_without_a_reference_and_a_last_row_without_a_value_are_dropped() {
        let warm = Some(20.0);
        let log = log(vec![
            sample(0, 0, "approach", None, warm),
            sample(1, 0, "record", None, warm),
            sample(2, 0, "record", Some(5.0), warm),
            sample(3, 0, "record", Some(6.0), warm),
            sample(4, 1, "record", None, warm),
            sample(5, 1, "record", Some(7.0), warm),
            sample(6, 1, "record", Some(8.0), None),
        ]);
        let header = "segment,time_s,voltage_v,displacement_um,reference_um,temperature_degc\n";
        let rows = "0,2,1,2,5,20\n0,3,1,2,6,20\n1,5,1,2,7,20\n";
        assert_eq!(log.csv("run.mcap", false).unwrap(), format!("{header}{rows}"));
        let all = log.csv("run.mcap", true).unwrap();
        assert_eq!(all.lines().next(), Some("segment,time_s,voltage_v,displacement_um,temperature_degc"));
        assert_eq!(all.lines().count(), 7);
    }

    #[test]
    fn a_segment_begins_after_a_gap_in_time() {
        let times = [(0, 0), (1, 0), (2, 0), (5, 0), (6, 0), (9, 1), (10, 1)];
        let mut log = log(times.map(|(k, segment)| sample(k, segment, "record", None, None)).to_vec());
        log.metadata.insert("sample_rate_hz".into(), "1".into());
        log.split_at_gaps();
        let segments: Vec<u64> = log.samples.iter().map(|s| s.segment).collect();
        assert_eq!((segments, log.lost.holes), (vec![0, 0, 0, 1, 1, 2, 2], 1));
    }

    #[test]
    fn a_column_with_missing_values_is_dropped_but_its_rows_are_kept() {
        let log = log((0..6).map(|k| sample(k, 0, "record", None, (k % 2 == 1).then_some(20.0))).collect());
        let text = log.csv("run.mcap", false).unwrap();
        assert_eq!((text.lines().count(), text.contains("temperature")), (7, false));
    }
}
