//! Stops a long computation from another thread.
//!
//! A diagnosis makes thousands of fits, on all cores, in deep calls that only return numerical errors. A stop unwinds
//! from there to the call that can be stopped, as in the queries of rust-analyzer, and becomes an ordinary error there.
//! Nothing is printed. With `panic = "abort"` a stop ends the program.

use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Flag that a computation checks in order to end. Clones share it.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<AtomicBool>);

/// Payload of the unwinding.
struct Stopped;

impl From<Arc<AtomicBool>> for Stop {
    fn from(flag: Arc<AtomicBool>) -> Self {
        Self(flag)
    }
}

impl Stop {
    /// Ends the computations that check this flag.
    pub fn stop(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Returns whether [`stop`](Self::stop) was called.
    pub fn is_stopped(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }

    /// Unwinds to [`until_stopped`] if [`stop`](Self::stop) was called.
    pub(crate) fn check(&self) {
        if self.is_stopped() {
            resume_unwind(Box::new(Stopped));
        }
    }
}

/// Returns the result of `compute`; `None` if a [`Stop::check`] in it ended it.
pub(crate) fn until_stopped<T>(compute: impl FnOnce() -> T) -> Option<T> {
    // Unwind safe: incomplete results are dropped.
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
    fn a_stop_ends_all_threads_and_other_panics_propagate() {
        let stop = Stop::default();
        let sum = || (0..1000_u64).into_par_iter().inspect(|_| stop.check()).sum::<u64>();
        assert_eq!(until_stopped(sum), Some(499_500));
        stop.stop();
        assert_eq!(until_stopped(sum), None);
        let passed = catch_unwind(|| until_stopped(|| panic!("another")));
        assert_eq!(passed.unwrap_err().downcast_ref::<&str>(), Some(&"another"));
    }
}
