//! The file of a log, and the clock that writes samples to it when no others follow them and has the disk keep them.

use std::fs::File;
use std::io::{self, BufWriter, IntoInnerError};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use mcap::records::MessageHeader;
use mcap::{McapError, Writer};

/// Longest time that a sample waits to be written, on the wall's clock and on the lab's alike: a program that dies takes no more than a
/// second with it, what was on its way to this computer then included.
const MOST: Duration = Duration::from_millis(500);

/// How often the disk is asked to keep what was written to it: what a failure of power takes is no more than that, [`MOST`] and
/// what the disk needs.
const KEPT: Duration = Duration::from_secs(1);

/// An open file.
pub(super) type Open = Writer<BufWriter<File>>;

/// Takes messages; a thread of its own looks at the clock.
pub(super) struct Sink {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

struct Shared {
    state: Mutex<State>,
    /// Something waits to be written now, or nothing will any more.
    news: Condvar,
}

struct State {
    /// Until it is closed.
    writer: Option<Open>,
    /// When the first message came that waits to be written, and its lab time \[s\].
    since: Option<(Instant, f64)>,
    written: u32,
    /// Of them, those that are in the file.
    saved: u32,
    /// Whether the file has more than the disk was asked to keep.
    unkept: bool,
    /// What the disk said when nobody asked.
    failure: Option<io::Error>,
}

impl Sink {
    /// With the file that `writer` writes to.
    pub(super) fn new(writer: Open, file: File) -> io::Result<Self> {
        let state = State { writer: Some(writer), since: None, written: 0, saved: 0, unkept: true, failure: None };
        let shared = Arc::new(Shared { state: Mutex::new(state), news: Condvar::new() });
        let watched = Arc::clone(&shared);
        let thread = std::thread::Builder::new().name("log".to_owned()).spawn(move || watched.watch(&file))?;
        Ok(Self { shared, thread: Some(thread) })
    }

    /// Takes a message of a lab time \[s\].
    pub(super) fn append(&self, channel_id: u16, time_s: f64, data: &[u8]) -> io::Result<()> {
        let mut state = self.shared.lock();
        if let Some(failure) = state.failure.take() {
            return Err(failure);
        }
        // A time before zero, which no clock here has, would become zero.
        let log_time = (time_s * 1e9).round() as u64;
        let header = MessageHeader { channel_id, sequence: state.written, log_time, publish_time: log_time };
        state.open()?.write_to_known_channel(&header, data).map_err(said)?;
        state.written = state.written.wrapping_add(1);
        match state.since {
            None => {
                state.since = Some((Instant::now(), time_s));
                self.shared.news.notify_one();
            }
            Some((_, first_s)) if time_s - first_s >= MOST.as_secs_f64() => state.flush()?,
            Some(_) => {}
        }
        Ok(())
    }

    /// Does something else with the file, and writes all of it.
    pub(super) fn aside<T>(&self, does: impl FnOnce(&mut Open) -> Result<T, McapError>) -> io::Result<T> {
        let mut state = self.shared.lock();
        if let Some(failure) = state.failure.take() {
            return Err(failure);
        }
        let done = does(state.open()?).map_err(said)?;
        state.flush()?;
        Ok(done)
    }

    /// Messages so far.
    pub(super) fn written(&self) -> u32 {
        self.shared.lock().written
    }

    /// Messages that are in the file.
    pub(super) fn saved(&self) -> u32 {
        self.shared.lock().saved
    }

    /// Writes summary and footer, and waits for the disk.
    pub(super) fn close(mut self) -> io::Result<()> {
        let writer = self.stop();
        if let Some(failure) = self.shared.lock().failure.take() {
            return Err(failure);
        }
        let mut writer = writer.ok_or_else(over)?;
        writer.finish().map_err(said)?;
        let file = writer.into_inner().into_inner().map_err(IntoInnerError::into_error)?;
        file.sync_all()
    }

    /// Ends the thread; gives the file, if nobody has had it yet.
    fn stop(&mut self) -> Option<Open> {
        let writer = self.shared.lock().writer.take();
        self.shared.news.notify_one();
        if let Some(thread) = self.thread.take() {
            // It panics nowhere; if it did, the log is closed all the same.
            let _ = thread.join();
        }
        writer
    }
}

impl Drop for Sink {
    fn drop(&mut self) {
        // A writer that goes closes its file as well as it can.
        drop(self.stop());
    }
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Until the file is closed, writes what has waited for long enough, and has the disk keep it.
    fn watch(&self, file: &File) {
        let mut state = self.lock();
        let mut kept = Instant::now();
        while state.writer.is_some() {
            let write_in = state.since.map(|(began, _)| MOST.saturating_sub(began.elapsed()));
            let keep_in = state.unkept.then(|| KEPT.saturating_sub(kept.elapsed()));
            if write_in == Some(Duration::ZERO) {
                // Whoever comes next is told.
                let done = state.flush();
                state.failure = state.failure.take().or(done.err());
            } else if keep_in == Some(Duration::ZERO) {
                state.unkept = false;
                drop(state);
                // Nobody waits for the disk: a run goes on meanwhile.
                let done = file.sync_data();
                kept = Instant::now();
                state = self.lock();
                state.failure = state.failure.take().or(done.err());
            } else {
                state = match write_in.into_iter().chain(keep_in).min() {
                    None => self.news.wait(state).unwrap_or_else(PoisonError::into_inner),
                    Some(left) => self.news.wait_timeout(state, left).unwrap_or_else(PoisonError::into_inner).0,
                };
            }
        }
    }
}

impl State {
    fn open(&mut self) -> io::Result<&mut Open> {
        self.writer.as_mut().ok_or_else(over)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.since = None;
        self.open()?.flush().map_err(said)?;
        (self.saved, self.unkept) = (self.written, true);
        Ok(())
    }
}

fn over() -> io::Error {
    io::Error::other("the log is closed already")
}

/// What the system said.
pub(super) fn said(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        other => io::Error::other(other),
    }
}
