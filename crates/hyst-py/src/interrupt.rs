//! Long work that Ctrl-C ends: it runs on a thread of its own, while the caller's thread looks for signals and hands on what it reports.

use std::panic::resume_unwind;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread;
use std::time::Duration;

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
    mut tell: impl FnMut(Python<'_>, News) -> PyResult<()> + Send,
) -> PyResult<T> {
    let stop = Arc::new(AtomicBool::new(false));
    py.detach(|| {
        thread::scope(|scope| {
            let (reports, reported) = channel();
            let own = Arc::clone(&stop);
            let worker = thread::Builder::new().stack_size(STACK).spawn_scoped(scope, move || work(&own, reports))?;
            let mut raised = None;
            loop {
                let looked = match reported.recv_timeout(LOOK) {
                    Ok(news) => Python::attach(|py| tell(py, news)),
                    Err(RecvTimeoutError::Timeout) => Python::attach(|py| py.check_signals()),
                    Err(RecvTimeoutError::Disconnected) => break,
                };
                if let Err(error) = looked {
                    raised.get_or_insert(error);
                    stop.store(true, Ordering::Relaxed);
                }
            }
            let done = worker.join().unwrap_or_else(|panic| resume_unwind(panic));
            raised.map_or(Ok(done), Err)
        })
    })
}
