//! The log of a run: an MCAP file that is written during the run.
//!
//! The channel `/actuator/sample` holds each sample as JSON; schema and channel metadata name the units. The channel
//! `/actuator/event` holds events. Chunks are closed twice a second, so that the samples can be read even if the
//! program dies. A metadata record describes the run, and the model file is attached.

mod contents;
mod recover;
mod sink;
mod stream;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::{File, TryLockError};
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

use hyst_ident::atomic_file::set_aside;
use hyst_ident::record::{EVENTS, TOPIC};
use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, McapError, WriteOptions};
use tempfile::TempPath;

pub use contents::{LoggedEvent, LoggedModel, LoggedSample, RunInfo};
use contents::{event_schema, event_units, metadata, schema, units};
pub use recover::recovered;
use sink::{Open, Sink, into_io_error};
pub use stream::{RunStream, StreamError};

const SAMPLE_SCHEMA: &str = "hyst.actuator.Sample";
const EVENT_SCHEMA: &str = "hyst.actuator.Event";

/// Error of a log that cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("{}: {}: {source}; {}", path.display(), self.what(), self.advice())]
pub struct LogError {
    path: PathBuf,
    /// Minimum number of samples in the file; `None` before the log was opened.
    saved: Option<u32>,
    source: io::Error,
}

impl LogError {
    fn what(&self) -> &'static str {
        if self.saved.is_some() { "the log cannot be continued" } else { "the log cannot be written" }
    }

    fn advice(&self) -> String {
        let path = self.path.display();
        let make_room = "free space on the disk or log to another disk";
        match self.saved {
            None => "give a file in a writable folder with free space".to_owned(),
            Some(0) => format!("{make_room}, and run again"),
            Some(saved) => format!(
                "{make_room}, and run again; the file holds at least the first {saved} samples: `hystctl log recover \
                 {path} -o whole.mcap` makes a closed log of them"
            ),
        }
    }
}

/// A log that is being written.
///
/// The file gets its name with the first sample, so a run that is refused before anything moves does not touch an
/// existing log. A log that is dropped without [`finish`](Self::finish) is closed if that is possible.
pub struct RunLog {
    path: PathBuf,
    sink: Sink,
    channel_id: u16,
    /// Buffer for a sample as JSON.
    text: Vec<u8>,
    /// Whether an existing file is renamed instead of replaced.
    keeps_older: bool,
    /// New name of the file that existed.
    older: Option<PathBuf>,
    /// `None` before the first event.
    event_channel: Option<u16>,
    events: u32,
    /// Temporary name of the file; `None` after the first sample.
    unnamed: Option<TempPath>,
}

impl RunLog {
    /// Opens a log that gets the name `path` with its first sample; it replaces an existing file.
    ///
    /// # Errors
    /// When the folder cannot be written.
    pub fn create(path: &Path, info: &RunInfo<'_>) -> Result<Self, LogError> {
        let failed = |source| LogError { path: path.to_owned(), saved: None, source };
        let (file, unnamed) = temporary(path).map_err(failed)?.into_parts();
        // Only on Unix: on Windows a lock also blocks readers. Two runs with one log name are not detected there.
        #[cfg(unix)]
        let _ = file.try_lock();
        let same = file.try_clone().map_err(failed)?;
        let (writer, channel_id) = begin(file, info).map_err(into_io_error).map_err(failed)?;
        Ok(Self {
            path: path.to_owned(),
            sink: Sink::new(writer, same).map_err(failed)?,
            channel_id,
            text: Vec::new(),
            keeps_older: false,
            older: None,
            event_channel: None,
            events: 0,
            unnamed: Some(unnamed),
        })
    }

    /// Opens a log as [`create`](Self::create) does, but renames an existing file instead of replacing it.
    ///
    /// # Errors
    /// When the folder cannot be written, or another run writes the existing file.
    pub fn beside_older(path: &Path, info: &RunInfo<'_>) -> Result<Self, LogError> {
        refuse_busy(&link_target(path)).map_err(|source| LogError { path: path.to_owned(), saved: None, source })?;
        Ok(Self { keeps_older: true, ..Self::create(path, info)? })
    }

    /// Appends one sample. It is in the file within 0.5 s, even if no sample follows.
    ///
    /// # Errors
    /// When this write or an earlier one fails.
    pub fn sample(&mut self, sample: &LoggedSample) -> Result<(), LogError> {
        self.append(sample).map_err(|source| self.failed(source))
    }

    fn append(&mut self, sample: &LoggedSample) -> io::Result<()> {
        self.take_name()?;
        self.text.clear();
        serde_json::to_writer(&mut self.text, sample)?;
        self.sink.append(self.channel_id, sample.time_s, &self.text)
    }

    fn failed(&self, source: io::Error) -> LogError {
        LogError { path: self.path.clone(), saved: Some(self.sink.saved()), source }
    }

    /// Appends an event and flushes the file.
    ///
    /// # Errors
    /// As [`sample`](Self::sample).
    pub fn event(&mut self, event: &LoggedEvent) -> Result<(), LogError> {
        self.append_event(event).map_err(|source| self.failed(source))
    }

    fn append_event(&mut self, event: &LoggedEvent) -> io::Result<()> {
        self.take_name()?;
        let data = serde_json::to_vec(event)?;
        let log_time = (event.time_s * 1e9).round() as u64;
        let (known, sequence) = (self.event_channel, self.events);
        let channel_id = self.sink.write_with(|writer| {
            let channel_id = match known {
                Some(id) => id,
                None => {
                    let schema = serde_json::to_vec(&event_schema()).map_err(io::Error::other)?;
                    let schema_id = writer.add_schema(EVENT_SCHEMA, "jsonschema", &schema)?;
                    writer.add_channel(schema_id, EVENTS, "json", &event_units())?
                }
            };
            let header = MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
            writer.write_to_known_channel(&header, &data).map(|()| channel_id)
        })?;
        self.event_channel = Some(channel_id);
        self.events = self.events.wrapping_add(1);
        Ok(())
    }

    /// Adds a metadata record, for example the arguments of a run or its results.
    ///
    /// # Errors
    /// As [`sample`](Self::sample).
    pub fn note(&mut self, name: &str, entries: BTreeMap<String, String>) -> Result<(), LogError> {
        let metadata = Metadata { name: name.to_owned(), metadata: entries };
        self.sink.write_with(|writer| writer.write_metadata(&metadata)).map_err(|source| self.failed(source))
    }

    /// Returns the path of the log, which the file gets with its first sample.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the new name of a file that existed.
    pub fn older(&self) -> Option<&Path> {
        self.older.as_deref()
    }

    /// Returns the number of samples so far.
    pub fn samples(&self) -> u32 {
        self.sink.written()
    }

    /// Writes summary and footer, and syncs the file to the disk.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn finish(mut self) -> Result<(), LogError> {
        self.take_name().map_err(|source| self.failed(source))?;
        let (path, saved) = (self.path, Some(self.sink.saved()));
        self.sink.close().map_err(|source| LogError { path, saved, source })
    }

    fn take_name(&mut self) -> io::Result<()> {
        let Some(temporary) = self.unnamed.take() else { return Ok(()) };
        let target = link_target(&self.path);
        if self.keeps_older && target.is_file() {
            // Another run may have started since this log was opened.
            refuse_busy(&target)?;
            self.older = Some(set_aside(&target)?);
        }
        temporary.persist(&target).map_err(|error| error.error)
    }
}

/// Refuses a log that another run is writing.
fn refuse_busy(target: &Path) -> io::Result<()> {
    let busy = |older: File| matches!(older.try_lock_shared(), Err(TryLockError::WouldBlock));
    if target.is_file() && File::open(target).is_ok_and(busy) {
        return Err(io::Error::other("another run is writing this file; give this run another log"));
    }
    Ok(())
}

/// Returns the file that `path` names, after links, so that a link is kept.
fn link_target(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}

/// Creates a temporary file in the folder of the target of `path`.
/// Its permissions are those of the process's umask.
fn temporary(path: &Path) -> io::Result<tempfile::NamedTempFile> {
    let path = link_target(path);
    if path.exists() && !path.is_file() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "not a regular file"));
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

/// Writes and flushes header, metadata, attachment, schema and channel.
/// A log that is cut off later still describes the run.
fn begin(file: File, info: &RunInfo<'_>) -> Result<(Open, u16), McapError> {
    let mut writer = options().create(BufWriter::new(file))?;
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
    let schema_id = writer.add_schema(SAMPLE_SCHEMA, "jsonschema", &schema)?;
    let channel_id = writer.add_channel(schema_id, TOPIC, "json", &units(unit))?;
    writer.flush()?;
    Ok((writer, channel_id))
}

fn options() -> WriteOptions {
    WriteOptions::new()
        .library(concat!("hystctl ", env!("CARGO_PKG_VERSION")))
        // Chunks of half a second are small: threads cost more than they save.
        .compression_threads(0)
        // Each chunk is written in one piece, so that all chunks before it are complete if the program dies.
        .disable_seeking(true)
}

#[cfg(test)]
mod tests;
