//! The log of a run: an MCAP file that is written while the device runs.
//!
//! One channel, `/actuator/sample`, holds every sample as JSON; schema and channel metadata name the units. Another one,
//! `/actuator/event`, says what happened on the way. Chunks are
//! closed twice a second, so that what was measured can be read even if the program dies. A metadata record
//! says what ran, and the model is attached as the file that it was.

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
use sink::{Open, Sink, said};
pub use stream::{RunStream, StreamError};

const SAMPLE_SCHEMA: &str = "hyst.actuator.Sample";
const EVENT_SCHEMA: &str = "hyst.actuator.Event";

/// The log cannot be written.
#[derive(Debug, thiserror::Error)]
#[error("{}: {}: {source}; {}", path.display(), self.what(), self.advice())]
pub struct LogError {
    path: PathBuf,
    /// Samples that can be read all the same, at least; none before there was one.
    saved: Option<u32>,
    source: io::Error,
}

impl LogError {
    fn what(&self) -> &'static str {
        if self.saved.is_some() { "the log cannot be written any further" } else { "the log cannot be written" }
    }

    fn advice(&self) -> String {
        let path = self.path.display();
        let make_room = "free space there, or log to a file on another disk";
        match self.saved {
            None => "give a file in a folder that can be written and has space".to_owned(),
            Some(0) => format!("{make_room}, and run again"),
            Some(saved) => format!(
                "{make_room}, and run again; at least the first {saved} samples are safe in it: `hystctl log recover {path} -o whole.mcap` makes a closed log of them"
            ),
        }
    }
}

/// A log while it is written.
///
/// It takes its name with the first sample: a run that is refused before anything moves leaves an older log as it was.
/// Dropped without [`finish`](Self::finish), it is still closed as well as it can be.
pub struct RunLog {
    path: PathBuf,
    sink: Sink,
    channel_id: u16,
    /// A sample as text.
    text: Vec<u8>,
    /// Whether an older file of this name is set aside.
    keeps_older: bool,
    /// The name that it has got.
    older: Option<PathBuf>,
    /// None while nothing has happened.
    event_channel: Option<u16>,
    events: u32,
    /// The temporary name, until the first sample.
    unnamed: Option<TempPath>,
}

impl RunLog {
    /// Opens a log that will be called `path`.
    ///
    /// # Errors
    /// When the folder cannot be written.
    pub fn create(path: &Path, info: &RunInfo<'_>) -> Result<Self, LogError> {
        let failed = |source| LogError { path: path.to_owned(), saved: None, source };
        let (file, unnamed) = temporary(path).map_err(failed)?.into_parts();
        // Elsewhere a lock keeps readers away; where there are none, two runs have to take care of themselves.
        #[cfg(unix)]
        let _ = file.try_lock();
        let same = file.try_clone().map_err(failed)?;
        let (writer, channel_id) = begin(file, info).map_err(said).map_err(failed)?;
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

    /// As [`create`](Self::create); an older file is set aside instead of replaced.
    ///
    /// # Errors
    /// When the folder cannot be written, or another run writes the older file.
    pub fn beside_older(path: &Path, info: &RunInfo<'_>) -> Result<Self, LogError> {
        left_alone(&behind_links(path)).map_err(|source| LogError { path: path.to_owned(), saved: None, source })?;
        Ok(Self { keeps_older: true, ..Self::create(path, info)? })
    }

    /// Appends one sample. It reaches its file within half a second, also if none follows.
    ///
    /// # Errors
    /// When the disk refuses, or has refused one before.
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

    /// Appends what has happened, and brings it to the file.
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
        let channel_id = self.sink.aside(|writer| {
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

    /// Adds a metadata record: what was asked for, or what is known only at the end of a run.
    ///
    /// # Errors
    /// As [`sample`](Self::sample).
    pub fn note(&mut self, name: &str, entries: BTreeMap<String, String>) -> Result<(), LogError> {
        let metadata = Metadata { name: name.to_owned(), metadata: entries };
        self.sink.aside(|writer| writer.write_metadata(&metadata)).map_err(|source| self.failed(source))
    }

    /// What it is called, or will be.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The name that an older file has got.
    pub fn older(&self) -> Option<&Path> {
        self.older.as_deref()
    }

    /// Samples so far.
    pub fn samples(&self) -> u32 {
        self.sink.written()
    }

    /// Writes summary and footer, and waits for the disk.
    ///
    /// # Errors
    /// When the disk refuses.
    pub fn finish(mut self) -> Result<(), LogError> {
        self.take_name().map_err(|source| self.failed(source))?;
        let (path, saved) = (self.path, Some(self.sink.saved()));
        self.sink.close().map_err(|source| LogError { path, saved, source })
    }

    fn take_name(&mut self) -> io::Result<()> {
        let Some(temporary) = self.unnamed.take() else { return Ok(()) };
        let target = behind_links(&self.path);
        if self.keeps_older && target.is_file() {
            // One may have begun since this was asked for.
            left_alone(&target)?;
            self.older = Some(set_aside(&target)?);
        }
        temporary.persist(&target).map_err(|error| error.error)
    }
}

/// Refuses a log that another run is writing: its readers would take it for this one.
fn left_alone(target: &Path) -> io::Result<()> {
    let busy = |older: File| matches!(older.try_lock_shared(), Err(TryLockError::WouldBlock));
    if target.is_file() && File::open(target).is_ok_and(busy) {
        return Err(io::Error::other("another run is writing it: give this one another name"));
    }
    Ok(())
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

/// Header, metadata, attachment, schema and channel, all of them in the file: a log that is cut off later says what ran.
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
        // Chunks of half a second are small: threads would only cost.
        .compression_threads(0)
        // A chunk goes out in one piece, so that what stands before it is whole whenever the program dies.
        .disable_seeking(true)
}

#[cfg(test)]
mod tests {
    use super::*;
    use hyst_hw::Phase;
    use hyst_ident::record::{ColumnMap, Need, OutputUnit, Record};

    fn info() -> RunInfo<'static> {
        RunInfo { device: "test", output: OutputUnit::Micrometre, sample_rate_hz: 100.0, model: None }
    }

    fn sample(k: u32) -> LoggedSample {
        sample_of(Phase::Record, k)
    }

    fn sample_of(phase: Phase, k: u32) -> LoggedSample {
        let time_s = f64::from(k) * 0.01;
        let measured =
            hyst_hw::Sample { time_s, drive_v: 1.0, output: 2.5, temperature_degc: None, load_n: None, force_n: None };
        LoggedSample::new(0, phase, &measured, Some(2.0))
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
    fn a_sample_that_none_follows_reaches_the_disk() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        let mut log = RunLog::create(&path, &info()).unwrap();
        for (k, all) in [(0, 1), (1, 2), (2, 3)] {
            log.sample(&sample(k)).unwrap();
            // It takes half a second; a busy machine is given a minute.
            let began = std::time::Instant::now();
            while read(&path).len() < all && began.elapsed().as_secs() < 60 {
                std::thread::sleep(std::time::Duration::from_millis(10));
            }
            assert_eq!(read(&path).len(), all);
            assert_eq!(log.sink.saved(), all as u32);
        }
        log.finish().unwrap();
        assert_eq!(read(&path).len(), 3);
    }

    #[test]
    fn a_log_that_has_no_sample_on_the_disk_says_what_runs() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        let mut log = RunLog::create(&path, &info()).unwrap();
        log.sample(&sample(0)).unwrap();
        let begun = hyst_ident::record::RunLog::parse("run.mcap", &std::fs::read(&path).unwrap()).unwrap();
        assert_eq!((begun.samples.len(), begun.lost.cut_off), (0, true));
        assert_eq!(begun.metadata["device"], "test");
    }

    #[test]
    fn a_log_of_a_ramp_alone_is_no_record() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run.mcap");
        let mut log = RunLog::create(&path, &info()).unwrap();
        (0..9).for_each(|k| log.sample(&sample_of(Phase::Approach, k)).unwrap());
        log.finish().unwrap();
        let refused = || Record::read(&path, &ColumnMap::default(), Need::InputAndOutput).unwrap_err().to_string();
        assert!(refused().contains("its samples, 9 in all, are of the ramps"), "{}", refused());
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
        #[cfg(unix)]
        assert!(RunLog::beside_older(&path, &info()).err().unwrap().to_string().contains("another run is writing it"));
        log.finish().unwrap();
        RunLog::beside_older(&path, &info()).unwrap();
        assert_eq!(read(&path).len(), 1);
    }

    #[cfg(unix)]
    #[test]
    fn what_is_no_file_is_refused_and_two_runs_do_not_share_a_name() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe.mcap");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        assert!(RunLog::beside_older(&pipe, &info()).err().unwrap().to_string().contains("no regular file"));
        // Both began before either had a sample.
        let path = folder.path().join("run.mcap");
        let mut first = RunLog::beside_older(&path, &info()).unwrap();
        let mut second = RunLog::beside_older(&path, &info()).unwrap();
        first.sample(&sample(0)).unwrap();
        assert!(second.sample(&sample(0)).unwrap_err().to_string().contains("another run is writing it"));
        first.finish().unwrap();
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
