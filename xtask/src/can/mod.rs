//! The CAN check: what others have written at the other end of the bus.
//!
//! - `peers.rs`: slcan and ISO-TP against python-can and can-isotp, over a pseudo terminal.
//! - `machine.rs`: the sockets of Linux, in a machine of their own, because few kernels that run checks have them.
//! - `packages.rs`, `image.rs`: what that machine is made of.

mod image;
mod machine;
mod packages;
mod peers;

use crate::command::Outcome;

/// What stands in a test's output when it was not run.
const SKIPPED: &str = "skipped: ";

/// Runs both; one that cannot run says why.
pub(crate) fn check() -> Outcome {
    match (peers::check(), machine::check()) {
        (Outcome::Failed, _) | (_, Outcome::Failed) => Outcome::Failed,
        (Outcome::Skipped(one), Outcome::Skipped(other)) => Outcome::Skipped(format!("{one}; {other}")),
        (Outcome::Skipped(why), _) | (_, Outcome::Skipped(why)) => Outcome::Skipped(why),
        (Outcome::Passed, Outcome::Passed) => Outcome::Passed,
    }
}
