//! Ending a long computation from another thread.
//!
//! A diagnosis fits thousands of times, on all cores, deep in calls whose errors are those of the numerics. What is stopped unwinds from there to
//! the call that can be stopped, as rust-analyzer's queries do, and becomes an ordinary error there; nothing is printed. A program that aborts where others unwind (`panic = "abort"`) ends with it.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Whether a computation shall end. Clones share it.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<AtomicBool>);

/// What unwinds.
struct Stopped;

impl From<Arc<AtomicBool>> for Stop {
    fn from(flag: Arc<AtomicBool>) -> Self {
        Self(flag)
    }
}

impl Stop {
    /// Ends what runs with it.
    pub fn stop(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Whether it was stopped.
    pub fn is_stopped(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// Unwinds to [`until_stopped`] where it was stopped.
    pub(crate) fn check(&self) {
        if self.is_stopped() {
            resume_unwind(Box::new(Stopped));
        }
    }
}

/// What `compute` returns; `None` where a [`Stop::check`] within it has ended it.
pub(crate) fn until_stopped<T>(compute: impl FnOnce() -> T) -> Option<T> {
    // What it was computing is dropped: nobody sees it half done.
    match catch_unwind(AssertUnwindSafe(compute)) {
        Ok(done) => Some(done),
        Err(cause) if cause.is::<Stopped>() => None,
        Err(panic) => resume_unwind(panic),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;

    #[test]
    fn a_stop_ends_work_on_all_threads_and_other_panics_pass() {
        let stop = Stop::default();
        let sum = || (0..1000_u64).into_par_iter().inspect(|_| stop.check()).sum::<u64>();
        assert_eq!(until_stopped(sum), Some(499_500));
        stop.stop();
        assert_eq!(until_stopped(sum), None);
        let passed = catch_unwind(|| until_stopped(|| panic!("another")));
        assert_eq!(passed.unwrap_err().downcast_ref::<&str>(), Some(&"another"));
    }
}
