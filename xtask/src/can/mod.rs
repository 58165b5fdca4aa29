//! The CAN check: tests against other implementations.
//!
//! - `peers.rs`: slcan and ISO-TP against python-can and can-isotp, over a pseudo terminal.
//! - `machine.rs`: the CAN sockets of Linux, in a virtual machine, because most kernels that run checks do not have
//!   them.
//! - `packages.rs`, `image.rs`: the packages and the disk image of this machine.
//! - `programs.rs`: the test programs and the marks in their output.

mod image;
mod machine;
mod packages;
mod peers;
mod programs;

use crate::command::Outcome;

/// Runs both parts; the result contains the reason if a part cannot run.
pub(crate) fn check() -> Outcome {
    match (peers::check(), machine::check()) {
        (Outcome::Failed, _) | (_, Outcome::Failed) => Outcome::Failed,
        (Outcome::Skipped(one), Outcome::Skipped(other)) => Outcome::Skipped(format!("{one}; {other}")),
        (Outcome::Skipped(why), _) | (_, Outcome::Skipped(why)) => Outcome::Skipped(why),
        (Outcome::Passed, Outcome::Passed) => Outcome::Passed,
    }
}
