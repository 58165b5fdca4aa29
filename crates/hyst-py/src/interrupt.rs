//! Long work that Ctrl-C ends: it runs on a thread of its own, while the caller's thread looks for signals and hands on what it reports.

use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::{Duration, Instant};

use pyo3::prelude::*;

/// How often signals are looked for.
const LOOK: Duration = Duration::from_millis(50);
/// As much as a main thread has \[bytes\].
const STACK: usize = 8 << 20;

/// Does `work`, which is given a flag that ends it and a way to report; each piece of news goes to `tell` on the caller's thread. Where a signal
/// raises, or `tell` does, the work is ended and the exception is raised once it is over.
pub(crate) fn interruptible<T: Send, News: Send>(
    py: Python<'_>,
    work: impl FnOnce(&Arc<AtomicBool>, Sender<News>) -> T + Send,
    tell: impl FnMut(Python<'_>, News) -> PyResult<()> + Send,
) -> PyResult<T> {
    let (done, raised) = until_interrupted(py, work, tell)?;
    raised.map_or(Ok(done), Err)
}

/// As [`interruptible`]; what was done when an exception had ended it, and that exception.
pub(crate) fn until_interrupted<T: Send, News: Send>(
    py: Python<'_>,
    work: impl FnOnce(&Arc<AtomicBool>, Sender<News>) -> T + Send,
    mut tell: impl FnMut(Python<'_>, News) -> PyResult<()> + Send,
) -> PyResult<(T, Option<PyErr>)> {
    let stop = Arc::new(AtomicBool::new(false));
    py.detach(|| {
        thread::scope(|scope| {
            let (reports, reported) = channel();
            let own = Arc::clone(&stop);
            let worker = thread::Builder::new().stack_size(STACK).spawn_scoped(scope, move || work(&own, reports))?;
            let (mut raised, mut looked) = (None, Instant::now());
            loop {
                let news = match reported.recv_timeout(LOOK) {
                    Ok(news) => Some(news),
                    Err(RecvTimeoutError::Timeout) => None,
                    Err(RecvTimeoutError::Disconnected) => break,
                };
                // What reports without a pause is looked after all the same.
                let is_due = looked.elapsed() >= LOOK;
                if is_due {
                    looked = Instant::now();
                }
                let seen = Python::attach(|py| {
                    if is_due {
                        py.check_signals()?;
                    }
                    news.filter(|_| raised.is_none()).map_or(Ok(()), |news| tell(py, news))
                });
                if let Err(error) = seen {
                    raised.get_or_insert(error);
                    stop.store(true, Ordering::Relaxed);
                }
            }
            let done = worker.join().unwrap_or_else(|panic| resume_unwind(panic));
            Ok((done, raised))
        })
    })
}
