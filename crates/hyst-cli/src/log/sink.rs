//! The file of a log, and a thread that flushes waiting samples to it and syncs it to the disk.

use std::fs::File;
use std::io::{self, BufWriter, IntoInnerError};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use mcap::records::MessageHeader;
use mcap::{McapError, Writer};

/// Maximum time that a sample waits before it is written, by the wall clock and by the device's clock.
/// A program that dies loses at most 1 s of samples, including those that were on their way to this computer.
const MAX_DELAY: Duration = Duration::from_millis(500);

/// Interval at which the file is synced to the disk.
/// A power failure loses at most this, [`MAX_DELAY`] and the write time of the disk.
const SYNC_INTERVAL: Duration = Duration::from_secs(1);

/// The writer of an open log.
pub(super) type Open = Writer<BufWriter<File>>;

/// Writes messages to a log; a thread flushes and syncs the file in time.
pub(super) struct Sink {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

struct Shared {
    state: Mutex<State>,
    /// Signals that a message waits to be written or that the file is closed.
    changed: Condvar,
}

struct State {
    /// `None` once the log is closed.
    writer: Option<Open>,
    /// Arrival and device time \[s\] of the oldest message that waits to be written.
    since: Option<(Instant, f64)>,
    /// Number of messages taken.
    written: u32,
    /// Number of messages that are in the file.
    saved: u32,
    /// Whether the file has data that were not synced to the disk.
    unsynced: bool,
    /// Error of the thread, reported by the next call.
    failure: Option<io::Error>,
}

impl Sink {
    /// Creates a sink; `file` is the file that `writer` writes to.
    pub(super) fn new(writer: Open, file: File) -> io::Result<Self> {
        let state = State { writer: Some(writer), since: None, written: 0, saved: 0, unsynced: true, failure: None };
        let shared = Arc::new(Shared { state: Mutex::new(state), changed: Condvar::new() });
        let watched = Arc::clone(&shared);
        let thread = std::thread::Builder::new().name("log".to_owned()).spawn(move || watched.watch(&file))?;
        Ok(Self { shared, thread: Some(thread) })
    }

    /// Appends a message with a device time \[s\].
    pub(super) fn append(&self, channel_id: u16, time_s: f64, data: &[u8]) -> io::Result<()> {
        let mut state = self.shared.lock();
        if let Some(failure) = state.failure.take() {
            return Err(failure);
        }
        // Device clocks start at zero; a negative time would become zero.
        let log_time = (time_s * 1e9).round() as u64;
        let header = MessageHeader { channel_id, sequence: state.written, log_time, publish_time: log_time };
        state.open()?.write_to_known_channel(&header, data).map_err(into_io_error)?;
        state.written = state.written.wrapping_add(1);
        match state.since {
            None => {
                state.since = Some((Instant::now(), time_s));
                self.shared.changed.notify_one();
            }
            Some((_, first_s)) if time_s - first_s >= MAX_DELAY.as_secs_f64() => state.flush()?,
            Some(_) => {}
        }
        Ok(())
    }

    /// Calls `write` with the writer, then flushes the file.
    pub(super) fn write_with<T>(&self, write: impl FnOnce(&mut Open) -> Result<T, McapError>) -> io::Result<T> {
        let mut state = self.shared.lock();
        if let Some(failure) = state.failure.take() {
            return Err(failure);
        }
        let done = write(state.open()?).map_err(into_io_error)?;
        state.flush()?;
        Ok(done)
    }

    /// Number of messages so far.
    pub(super) fn written(&self) -> u32 {
        self.shared.lock().written
    }

    /// Number of messages that are in the file.
    pub(super) fn saved(&self) -> u32 {
        self.shared.lock().saved
    }

    /// Writes summary and footer, and syncs the file to the disk.
    pub(super) fn close(mut self) -> io::Result<()> {
        let writer = self.stop();
        if let Some(failure) = self.shared.lock().failure.take() {
            return Err(failure);
        }
        let mut writer = writer.ok_or_else(closed)?;
        writer.finish().map_err(into_io_error)?;
        let file = writer.into_inner().into_inner().map_err(IntoInnerError::into_error)?;
        file.sync_all()
    }

    /// Ends the thread and returns the writer; `None` if it was taken before.
    fn stop(&mut self) -> Option<Open> {
        let writer = self.shared.lock().writer.take();
        self.shared.changed.notify_one();
        if let Some(thread) = self.thread.take() {
            // A panic of the thread must not keep the log from being closed.
            let _ = thread.join();
        }
        writer
    }
}

impl Drop for Sink {
    fn drop(&mut self) {
        // The dropped writer closes its file if it can.
        drop(self.stop());
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Flushes messages that have waited for [`MAX_DELAY`] and syncs the file, until it is closed.
    fn watch(&self, file: &File) {
        let mut state = self.lock();
        let mut synced = Instant::now();
        while state.writer.is_some() {
            let write_in = state.since.map(|(began, _)| MAX_DELAY.saturating_sub(began.elapsed()));
            let sync_in = state.unsynced.then(|| SYNC_INTERVAL.saturating_sub(synced.elapsed()));
            if write_in == Some(Duration::ZERO) {
                // The next call reports a failure.
                let done = state.flush();
                state.failure = state.failure.take().or(done.err());
            } else if sync_in == Some(Duration::ZERO) {
                state.unsynced = false;
                drop(state);
                // Without the lock: the run continues while the disk syncs.
                let done = file.sync_data();
                synced = Instant::now();
                state = self.lock();
                state.failure = state.failure.take().or(done.err());
            } else {
                state = match write_in.into_iter().chain(sync_in).min() {
                    None => self.changed.wait(state).unwrap_or_else(PoisonError::into_inner),
                    Some(timeout) => {
                        self.changed.wait_timeout(state, timeout).unwrap_or_else(PoisonError::into_inner).0
                    }
                };
            }
        }
    }
}

impl State {
    fn open(&mut self) -> io::Result<&mut Open> {
        self.writer.as_mut().ok_or_else(closed)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.since = None;
        self.open()?.flush().map_err(into_io_error)?;
        (self.saved, self.unsynced) = (self.written, true);
        Ok(())
    }
}

fn closed() -> io::Error {
    io::Error::other("the log is closed")
}

/// Converts an error of the MCAP writer; an error of the system is not changed.
pub(super) fn into_io_error(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        other => io::Error::other(other),
    }
}
