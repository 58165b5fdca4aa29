//! Long work that Ctrl-C can end. It runs on a separate thread; the thread of the caller checks for signals and
//! forwards its reports.

use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

use pyo3::prelude::*;

/// Interval between two checks for signals.
const CHECK_INTERVAL: Duration = Duration::from_millis(50);
/// Stack size of the worker, as of a main thread \[bytes\].
const STACK: usize = 8 << 20;

/// Runs `work` with a stop flag and a sender of reports; `forward` gets each report on the thread of the caller. If a
/// signal or `forward` raises, the work is stopped, and the exception is raised after its end.
pub(crate) fn interruptible<T: Send, Report: Send>(
    py: Python<'_>,
    work: impl FnOnce(&Arc<AtomicBool>, Sender<Report>) -> T + Send,
    forward: impl FnMut(Python<'_>, Report) -> PyResult<()> + Send,
) -> PyResult<T> {
    let (done, raised) = until_interrupted(py, work, forward)?;
    raised.map_or(Ok(done), Err)
}

/// As [`interruptible`], but returns the result of the work and the exception that stopped it.
pub(crate) fn until_interrupted<T: Send, Report: Send>(
    py: Python<'_>,
    work: impl FnOnce(&Arc<AtomicBool>, Sender<Report>) -> T + Send,
    mut forward: impl FnMut(Python<'_>, Report) -> PyResult<()> + Send,
) -> PyResult<(T, Option<PyErr>)> {
    let stop = Arc::new(AtomicBool::new(false));
    py.detach(|| {
        thread::scope(|scope| {
            let (sender, receiver) = channel();
            let own = Arc::clone(&stop);
            let worker = thread::Builder::new().stack_size(STACK).spawn_scoped(scope, move || work(&own, sender))?;
            let (mut raised, mut last_check) = (None, Instant::now());
            loop {
                let report = match receiver.recv_timeout(CHECK_INTERVAL) {
                    Ok(report) => Some(report),
                    Err(RecvTimeoutError::Timeout) => None,
                    Err(RecvTimeoutError::Disconnected) => break,
                };
                // Signals are also checked while reports arrive without a pause.
                let is_due = last_check.elapsed() >= CHECK_INTERVAL;
                if is_due {
                    last_check = Instant::now();
                }
                let checked = Python::attach(|py| {
                    if is_due {
                        py.check_signals()?;
                    }
                    report.filter(|_| raised.is_none()).map_or(Ok(()), |report| forward(py, report))
                });
                if let Err(error) = checked {
                    raised.get_or_insert(error);
                    stop.store(true, Ordering::Relaxed);
                }
            }
            let done = worker.join().unwrap_or_else(|panic| resume_unwind(panic));
            Ok((done, raised))
        })
    })
}
