//! Logs of runs: MCAP files of samples, read as records.
//!
//! A log says every sample as JSON on the channel [`TOPIC`]; a metadata record `run` says what ran, and the model is attached as `model.json`. Of a log
//! that was cut off, as by a loss of power, everything up to the cut is read; of one that was damaged, every chunk that was not.

mod records;

use std::collections::BTreeMap;

use mcap::records::{Metadata, Record as Entry};
use serde::{Deserialize, Deserializer, Serialize};

use super::error::RecordError;
use super::{OutputUnit, Record};
pub use records::LogRecords;
use records::MAGIC;

/// Channel of the samples.
pub const TOPIC: &str = "/actuator/sample";
/// Channel of what happens on the way.
pub const EVENTS: &str = "/actuator/event";

/// One sample of a log, as it stands there.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub struct LogSample {
    /// Time of the device's clock \[s\].
    pub time_s: f64,
    /// Segment, from 0.
    pub segment: u64,
    /// What it is part of: `approach`, `record` or `retreat`.
    pub phase: String,
    /// Voltage that was applied \[V\].
    pub drive_v: f64,
    /// Measured output \[output unit\]; no number where the sensor showed none.
    #[serde(deserialize_with = "or_none")]
    pub output: f64,
    /// Wanted output \[output unit\].
    pub reference: Option<f64>,
    /// Temperature \[°C\].
    pub temperature_degc: Option<f64>,
    /// Load \[N\].
    pub load_n: Option<f64>,
    /// Force that was estimated on the way \[N\].
    pub estimated_force_n: Option<f64>,
}

/// Something that happened on the way.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
pub struct LogEvent {
    /// Time of the device's clock \[s\].
    pub time_s: f64,
    /// What, in one word.
    pub kind: String,
    /// What, in a sentence.
    pub text: String,
}

/// JSON has no other word for what is no number than null.
fn or_none<'de, D: Deserializer<'de>>(from: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(from)?.unwrap_or(f64::NAN))
}

impl LogSample {
    /// Whether it belongs to what was asked for, and not to a ramp before or after.
    pub fn is_record(&self) -> bool {
        self.phase == "record"
    }
}

/// A log as read.
#[derive(Clone, Debug, Default)]
pub struct RunLog {
    /// What ran, by key: device, unit, version and more; with its name and a point in front what other metadata records say.
    pub metadata: BTreeMap<String, String>,
    /// The text of the model's file, if one made the drive.
    pub model: Option<String>,
    /// The samples, in order.
    pub samples: Vec<LogSample>,
    /// What happened on the way, in order.
    pub events: Vec<LogEvent>,
    /// What is missing of the run.
    pub lost: Losses,
}

/// What a log lost of the run that it tells.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Losses {
    /// Whether its writer was cut off: the log was never closed.
    pub cut_off: bool,
    /// Chunks and other records that are left out because they are damaged.
    pub damaged: usize,
    /// Holes in time within a segment, where samples are lost; behind each another segment begins.
    pub holes: usize,
}

impl Losses {
    /// Those of several logs together.
    pub(super) fn and(self, other: Self) -> Self {
        Self {
            cut_off: self.cut_off || other.cut_off,
            damaged: self.damaged + other.damaged,
            holes: self.holes + other.holes,
        }
    }
}

/// A step in time of so many periods is a hole.
const HOLE: f64 = 1.5;

/// Whether these are the bytes of an MCAP file.
pub fn is_log(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

/// Whether these are the bytes of a log of a run, and no other program's MCAP file with messages of its own.
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
    /// Reads a log; `name` stands for the file in messages.
    ///
    /// # Errors
    /// If the bytes are no MCAP file, or one without samples of a run.
    pub fn parse(name: &str, bytes: &[u8]) -> Result<Self, RecordError> {
        let foreign = |what: String| RecordError::Log { file: name.to_owned(), what };
        let mut entries = LogRecords::new(bytes).ok_or_else(|| foreign("it is no MCAP file".to_owned()))?;
        let mut log = Self::default();
        let (mut channel, mut happened) = (None, None);
        log.lost.cut_off = true;
        // What is not whole at the end is what a cut takes.
        for entry in &mut entries {
            match entry {
                Entry::Metadata(Metadata { name, metadata }) if name == "run" => log.metadata.extend(metadata),
                // What was asked for, and what was known only at the end, as how the device's clock went.
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
                        .map_err(|error| foreign(format!("message {number} of {TOPIC} is no sample: {error}")))?;
                    log.samples.push(sample);
                }
                Entry::Channel(c) if c.topic == EVENTS && c.message_encoding == "json" => happened = Some(c.id),
                // What is said there is for people: one that is no event is no reason to leave the samples.
                Entry::Message { header, data } if Some(header.channel_id) == happened => {
                    log.events.extend(serde_json::from_slice::<LogEvent>(&data));
                }
                Entry::Footer(_) => log.lost.cut_off = false,
                _ => {}
            }
        }
        log.lost.damaged = entries.damaged();
        log.split_at_holes();
        match channel {
            Some(_) => Ok(log),
            None if log.lost.cut_off && log.lost.damaged == 0 => {
                Err(foreign(format!("it was cut off before the channel {TOPIC}: nothing of a run is in it")))
            }
            None => Err(foreign(format!("it has no channel {TOPIC} of JSON messages"))),
        }
    }

    /// What the actuator did meanwhile is not known: the rows behind a hole are no continuation of those before it.
    fn split_at_holes(&mut self) {
        let rate = self.metadata.get("sample_rate_hz").and_then(|rate| rate.parse::<f64>().ok());
        let Some(longest) = rate.map(|rate| HOLE / rate).filter(|longest| longest.is_finite() && *longest > 0.0) else {
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

    /// Unit of output and reference; `None` where the log does not say it.
    pub fn unit(&self) -> Option<OutputUnit> {
        self.metadata.get("output_column").and_then(|column| OutputUnit::of_column(column))
    }

    /// The samples that make a record: what was asked for, without rows in which a device that looks ahead had no reference yet.
    pub fn record_samples(&self) -> Vec<&LogSample> {
        self.chosen(false)
    }

    /// The samples that belong to a record: those that were asked for, or the ramps too.
    fn chosen(&self, with_ramps: bool) -> Vec<&LogSample> {
        let has = |of: fn(&LogSample) -> Option<f64>| self.samples.iter().any(|s| of(s).is_some());
        let (thermometer, load, followed) = (has(|s| s.temperature_degc), has(|s| s.load_n), has(|s| s.reference));
        let shown = |s: &LogSample| {
            s.output.is_finite() && (!thermometer || s.temperature_degc.is_some()) && (!load || s.load_n.is_some())
        };
        // A sensor that has lost its number has ended the run.
        let end = self.samples.len() - usize::from(self.samples.last().is_some_and(|last| !shown(last)));
        let mut follows = None;
        let wanted = |s: &&LogSample| {
            follows = s.reference.map(|_| s.segment).or(follows);
            // The first rows of a device that looks ahead have no reference: its output is later.
            with_ramps || s.is_record() && (!followed || follows == Some(s.segment))
        };
        self.samples[..end].iter().filter(wanted).filter(|s| s.output.is_finite()).collect()
    }

    /// Why there is nothing of what was asked for.
    fn why_empty(&self) -> String {
        let samples = self.samples.len();
        if self.lost.damaged > 0 {
            return format!(
                "{} pieces of it are damaged, and of the {samples} samples that are left none is of it",
                self.lost.damaged
            );
        }
        if samples == 0 {
            return "it ends before the first sample; let the run come further".to_owned();
        }
        if self.samples.iter().any(LogSample::is_record) {
            return "the sensor shows no number there; look at it, and run again".to_owned();
        }
        format!("its samples, {samples} in all, are of the ramps before and after; let the run come further")
    }

    /// The samples as a record file: those that were asked for, or the ramps too.
    ///
    /// # Errors
    /// If the log does not say its unit.
    pub fn csv(&self, name: &str, with_ramps: bool) -> Result<String, RecordError> {
        let no_unit = || RecordError::Log {
            file: name.to_owned(),
            what: "its metadata do not say the unit of the output".into(),
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
        // A column that some samples lack has no place in a record.
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
    /// A log's samples as a record, checked as a record file is; lines in messages are those of [`RunLog::csv`].
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

    /// A sample of a segment; what is `None` is not there.
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
    fn a_record_has_neither_ramps_nor_late_rows_nor_the_one_that_lost_its_sensor() {
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
    fn behind_a_hole_in_time_another_segment_begins() {
        let times = [(0, 0), (1, 0), (2, 0), (5, 0), (6, 0), (9, 1), (10, 1)];
        let mut log = log(times.map(|(k, segment)| sample(k, segment, "record", None, None)).to_vec());
        log.metadata.insert("sample_rate_hz".into(), "1".into());
        log.split_at_holes();
        let segments: Vec<u64> = log.samples.iter().map(|s| s.segment).collect();
        assert_eq!((segments, log.lost.holes), (vec![0, 0, 0, 1, 1, 2, 2], 1));
    }

    #[test]
    fn a_column_with_holes_is_left_out_and_its_rows_are_not() {
        let log = log((0..6).map(|k| sample(k, 0, "record", None, (k % 2 == 1).then_some(20.0))).collect());
        let text = log.csv("run.mcap", false).unwrap();
        assert_eq!((text.lines().count(), text.contains("temperature")), (7, false));
    }
}
