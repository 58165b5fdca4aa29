//! The log of a run: an MCAP file that is written while the device runs.
//!
//! One channel, `/actuator/sample`, holds every sample as JSON; schema and channel metadata name the units. Another one,
//! `/actuator/event`, says what happened on the way. Chunks are
//! closed once per second of data, so that what was measured can be read even if the program dies. A metadata record
//! says what ran, and the model is attached as the file that it was.

mod contents;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufWriter, IntoInnerError};
use std::path::{Path, PathBuf};

use hyst_ident::atomic_file::set_aside;
use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, McapError, WriteOptions, Writer};
use tempfile::TempPath;

pub(crate) use contents::{LoggedEvent, LoggedModel, LoggedSample, RunInfo};
use contents::{event_schema, metadata, schema, units};

/// Channel of the samples.
pub(crate) const TOPIC: &str = "/actuator/sample";
/// Channel of what happens on the way.
const EVENTS: &str = "/actuator/event";

/// The log cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("{}: the log cannot be written", path.display())]
pub(crate) struct LogError {
    path: PathBuf,
    source: McapError,
}

/// A log while it is written.
///
/// It takes its name with the first sample: a run that is refused before anything moves leaves an older log as it was.
/// Dropped without [`finish`](Self::finish), it is still closed as well as it can be.
pub(crate) struct RunLog {
    path: PathBuf,
    /// The temporary name, until the first sample.
    unnamed: Option<TempPath>,
    /// Whether an older file of this name is set aside.
    keeps_older: bool,
    /// The name that it has got.
    older: Option<PathBuf>,
    writer: Writer<BufWriter<File>>,
    channel_id: u16,
    /// None while nothing has happened.
    event_channel: Option<u16>,
    events: u32,
    samples: u32,
    /// Lab time of the first sample that is not on the disk yet \[s\].
    unflushed_s: Option<f64>,
}

impl RunLog {
    /// Opens a log that will be called `path`.
    ///
    /// # Errors
    /// When the folder cannot be written.
    pub(crate) fn create(path: &Path, info: &RunInfo<'_>) -> Result<Self, LogError> {
        let failed = |source| LogError { path: path.to_owned(), source };
        let (file, unnamed) = temporary(path).map_err(|error| failed(error.into()))?.into_parts();
        let (writer, channel_id) = begin(file, info).map_err(failed)?;
        Ok(Self {
            path: path.to_owned(),
            unnamed: Some(unnamed),
            keeps_older: false,
            older: None,
            writer,
            channel_id,
            event_channel: None,
            events: 0,
            samples: 0,
            unflushed_s: None,
        })
    }

    /// As [`create`](Self::create); an older file is set aside instead of replaced.
    ///
    /// # Errors
    /// When the folder cannot be written.
    pub(crate) fn beside_older(path: &Path, info: &RunInfo<'_>) -> Result<Self, LogError> {
        Ok(Self { keeps_older: true, ..Self::create(path, info)? })
    }

    /// Appends one sample.
    ///
    /// # Errors
    /// When the disk refuses.
    pub(crate) fn sample(&mut self, sample: &LoggedSample) -> Result<(), LogError> {
        self.append(sample).map_err(|source| LogError { path: self.path.clone(), source })
    }

    fn append(&mut self, sample: &LoggedSample) -> Result<(), McapError> {
        self.take_name()?;
        let data = serde_json::to_vec(sample).map_err(io::Error::other)?;
        // A time before zero, which no clock here has, would become zero.
        let log_time = (sample.time_s * 1e9).round() as u64;
        let header =
            MessageHeader { channel_id: self.channel_id, sequence: self.samples, log_time, publish_time: log_time };
        self.writer.write_to_known_channel(&header, &data)?;
        self.samples = self.samples.wrapping_add(1);
        let since = *self.unflushed_s.get_or_insert(sample.time_s);
        if sample.time_s - since >= 1.0 {
            self.writer.flush()?;
            self.unflushed_s = None;
        }
        Ok(())
    }

    /// Appends what has happened, and brings it to the disk.
    ///
    /// # Errors
    /// When the disk refuses.
    pub(crate) fn event(&mut self, event: &LoggedEvent) -> Result<(), LogError> {
        self.append_event(event).map_err(|source| LogError { path: self.path.clone(), source })
    }

    fn append_event(&mut self, event: &LoggedEvent) -> Result<(), McapError> {
        self.take_name()?;
        let channel_id = match self.event_channel {
            Some(id) => id,
            None => {
                let schema = serde_json::to_vec(&event_schema()).map_err(io::Error::other)?;
                let schema_id = self.writer.add_schema("hyst.actuator.Event", "jsonschema", &schema)?;
                *self.event_channel.insert(self.writer.add_channel(schema_id, EVENTS, "json", &BTreeMap::new())?)
            }
        };
        let log_time = (event.time_s * 1e9).round() as u64;
        let header = MessageHeader { channel_id, sequence: self.events, log_time, publish_time: log_time };
        self.events = self.events.wrapping_add(1);
        self.writer.write_to_known_channel(&header, &serde_json::to_vec(event).map_err(io::Error::other)?)?;
        self.unflushed_s = None;
        self.writer.flush()
    }

    /// Adds what is known only at the end of a run.
    ///
    /// # Errors
    /// When the disk refuses.
    pub(crate) fn note(&mut self, name: &str, entries: BTreeMap<String, String>) -> Result<(), LogError> {
        let metadata = Metadata { name: name.to_owned(), metadata: entries };
        self.writer.write_metadata(&metadata).map_err(|source| LogError { path: self.path.clone(), source })
    }

    /// What it is called, or will be.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// The name that an older file has got.
    pub(crate) fn older(&self) -> Option<&Path> {
        self.older.as_deref()
    }

    /// Samples so far.
    pub(crate) fn samples(&self) -> u32 {
        self.samples
    }

    /// Writes summary and footer, and waits for the disk.
    ///
    /// # Errors
    /// When the disk refuses.
    pub(crate) fn finish(self) -> Result<(), LogError> {
        let path = self.path.clone();
        self.close().map_err(|source| LogError { path, source })
    }

    fn close(mut self) -> Result<(), McapError> {
        self.take_name()?;
        self.writer.finish()?;
        let file = self.writer.into_inner().into_inner().map_err(IntoInnerError::into_error)?;
        Ok(file.sync_all()?)
    }

    fn take_name(&mut self) -> io::Result<()> {
        let Some(temporary) = self.unnamed.take() else { return Ok(()) };
        let target = behind_links(&self.path);
        if self.keeps_older && target.is_file() {
            self.older = Some(set_aside(&target)?);
        }
        temporary.persist(&target).map_err(|error| error.error)
    }
}

/// The file that `path` leads to: a link stays one.
fn behind_links(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}

/// A file beside what `path` leads to, readable for whom the process lets.
fn temporary(path: &Path) -> io::Result<tempfile::NamedTempFile> {
    let path = behind_links(path);
    if path.exists() && !path.is_file() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "this is no regular file"));
    }
    let mut builder = tempfile::Builder::new();
    builder.prefix(".hyst-").suffix(".part");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // The process's umask applies.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new(".")))
}

/// Header, metadata, attachment, schema and channel.
fn begin(file: File, info: &RunInfo<'_>) -> Result<(Writer<BufWriter<File>>, u16), McapError> {
    let mut writer = WriteOptions::new()
        .library(concat!("hystctl ", env!("CARGO_PKG_VERSION")))
        // Chunks of one second are small: threads would only cost.
        .compression_threads(0)
        .create(BufWriter::new(file))?;
    writer.write_metadata(&Metadata { name: "run".to_owned(), metadata: metadata(info) })?;
    if let Some(LoggedModel { json, .. }) = info.model {
        writer.attach(&Attachment {
            log_time: 0,
            create_time: 0,
            name: "model.json".to_owned(),
            media_type: "application/json".to_owned(),
            data: Cow::Borrowed(json.as_bytes()),
        })?;
    }
    let unit = info.output.symbol();
    let schema = serde_json::to_vec(&schema(unit)).map_err(io::Error::other)?;
    let schema_id = writer.add_schema("hyst.actuator.Sample", "jsonschema", &schema)?;
    let channel_id = writer.add_channel(schema_id, TOPIC, "json", &units(unit))?;
    Ok((writer, channel_id))
}

#[cfg(test)]
mod tests {
    use super::*;
    use hyst_hw::Phase;
    use hyst_ident::record::OutputUnit;

    fn info() -> RunInfo<'static> {
        RunInfo { device: "test", output: OutputUnit::Micrometre, sample_rate_hz: 100.0, model: None }
    }

    fn sample(k: u32) -> LoggedSample {
        let time_s = f64::from(k) * 0.01;
        let measured =
            hyst_hw::Sample { time_s, drive_v: 1.0, output: 2.5, temperature_degc: None, load_n: None, force_n: None };
        LoggedSample::new(0, Phase::Record, &measured, Some(2.0))
    }

    fn read(path: &Path) -> Vec<serde_json::Value> {
        let bytes = std::fs::read(path).unwrap();
        let messages =
            mcap::MessageStream::new_with_options(&bytes, mcap::read::Options::IgnoreEndMagic.into()).unwrap();
        // What is not whole at the end is what a crash takes.
        messages.map_while(Result::ok).map(|message| serde_json::from_slice(&message.data).unwrap()).collect()
    }

    #[test]
    fn samples_come_back() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        let mut log = RunLog::create(&path, &info()).unwrap();
        (0..250).for_each(|k| log.sample(&sample(k)).unwrap());
        assert_eq!(log.samples(), 250);
        log.finish().unwrap();
        let read = read(&path);
        assert_eq!(read.len(), 250);
        assert_eq!(read[2]["error"], 0.5);
        assert_eq!(read[2]["phase"], "record");
        assert!(read[2].get("load_n").is_none());
        let summary = mcap::Summary::read(&std::fs::read(&path).unwrap()).unwrap().unwrap();
        assert_eq!(summary.stats.unwrap().message_count, 250);
        assert!(summary.chunk_indexes.len() >= 2);
    }

    #[test]
    fn all_but_the_last_second_is_on_the_disk_while_it_runs() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        let mut log = RunLog::create(&path, &info()).unwrap();
        (0..250).for_each(|k| log.sample(&sample(k)).unwrap());
        assert!(read(&path).len() >= 202);
        drop(log);
    }

    #[test]
    fn an_older_log_is_set_aside() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        std::fs::write(&path, "older").unwrap();
        let mut log = RunLog::beside_older(&path, &info()).unwrap();
        assert_eq!(log.older(), None);
        log.sample(&sample(0)).unwrap();
        assert_eq!(std::fs::read(log.older().unwrap()).unwrap(), b"older");
        log.finish().unwrap();
        assert_eq!(read(&path).len(), 1);
    }

    #[test]
    fn a_log_without_samples_leaves_the_older_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        std::fs::write(&path, "older").unwrap();
        drop(RunLog::create(&path, &info()).unwrap());
        assert_eq!(std::fs::read(&path).unwrap(), b"older");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
        RunLog::create(&folder.path().join("absent").join("run.mcap"), &info()).err().unwrap();
    }
}
