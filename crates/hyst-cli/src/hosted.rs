//! The command that another program runs on this thread: its resources and its result so far.

use std::cell::RefCell;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use hyst_hw::Daq;
use hyst_ident::stop::Stop;
use serde::Serialize;

use crate::exit::{Classified, CommandError, Exit};

/// A device of the program that runs the command; its argument is `--daq host:`.
pub trait HostDaq: Daq<Error = HostDaqError> + Send {
    /// Limits the slope of the ramp to rest from now on \[V/s\].
    fn gentle(&mut self, slew_v_per_s: f64);
}

/// Error of a device of the host.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct HostDaqError {
    /// What is wrong and what to do.
    pub message: String,
    /// Whether the request was refused and nothing moved; if not, the device is lost.
    pub refused: bool,
}

impl Classified for HostDaqError {
    fn exit(&self) -> Exit {
        if self.refused { Exit::BadInput } else { Exit::DeviceLost }
    }
}

/// A function that takes a line of text.
pub type Say = Box<dyn FnMut(&str) + Send>;

/// Resources of the program that runs a command.
#[derive(Default)]
pub struct Host {
    /// Device for commands with `--daq host:`.
    pub daq: Option<Box<dyn HostDaq>>,
    /// Ends the command once it is true: a run ramps to rest, a search returns its best result so far.
    pub stop: Arc<AtomicBool>,
    /// Receives each line that the command line prints to stderr.
    pub say: Option<Say>,
}

/// Result of a command.
#[derive(Clone, Debug, Default)]
pub struct Ended {
    /// The exit code of the command line.
    ///
    /// 0 done, 1 failed, 2 bad arguments or input, 3 device lost or data at risk.
    pub exit: u8,
    /// The error, as the command line prints it; `None` for exit code 0.
    pub error: Option<String>,
    /// The report as text.
    pub text: String,
    /// The report as `--json` prints it.
    pub json: Option<serde_json::Value>,
    /// Results that the command line writes to stdout.
    pub stdout: Vec<u8>,
}

/// A running command: its host and its result so far.
struct Hosted {
    host: Host,
    ended: Ended,
}

thread_local! {
    /// The command that runs on this thread, if a host runs one.
    static HOSTED: RefCell<Option<Hosted>> = const { RefCell::new(None) };
}

/// Runs `work` on this thread as a command of `host`; returns its outcome and its result.
pub(crate) fn run<T>(host: Host, work: impl FnOnce() -> T) -> (T, Ended) {
    // Restores the outer command if one command runs another, even after a panic.
    let _restore = Restore(HOSTED.replace(Some(Hosted { host, ended: Ended::default() })));
    let done = work();
    (done, HOSTED.take().map(|hosted| hosted.ended).unwrap_or_default())
}

/// Restores the outer command when dropped.
struct Restore(Option<Hosted>);

impl Drop for Restore {
    fn drop(&mut self) {
        HOSTED.set(self.0.take());
    }
}

/// Whether the command of this thread runs inside another program.
pub(crate) fn has_host() -> bool {
    HOSTED.with_borrow(Option::is_some)
}

/// Returns the flag with which the host ends a run.
pub(crate) fn stop() -> Option<Arc<AtomicBool>> {
    HOSTED.with_borrow(|hosted| hosted.as_ref().map(|hosted| Arc::clone(&hosted.host.stop)))
}

/// Returns the flag with which the host ends a computation; never set without a host.
pub(crate) fn stopping() -> Stop {
    stop().map_or_else(Stop::default, Stop::from)
}

/// Returns whether a search continues.
pub(crate) fn going() -> ControlFlow<()> {
    if stopping().is_stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}

/// Returns the device of the host; `None` after the first call.
pub(crate) fn daq() -> Option<Box<dyn HostDaq>> {
    HOSTED.with_borrow_mut(|hosted| hosted.as_mut().and_then(|hosted| hosted.host.daq.take()))
}

/// Passes bytes for stdout to the host; returns false without a host.
pub(crate) fn take_stdout(bytes: &[u8]) -> bool {
    with(|hosted| hosted.ended.stdout.extend_from_slice(bytes))
}

/// Passes a line for stderr to the host; returns false without a host.
pub(crate) fn take_line(text: &str) -> bool {
    // Taken out during the call, because the host may run another command in it.
    let Some(Some(mut say)) = HOSTED.with_borrow_mut(|hosted| hosted.as_mut().map(|hosted| hosted.host.say.take()))
    else {
        return has_host();
    };
    say(text);
    with(|hosted| hosted.host.say = Some(say))
}

/// Passes a report to the host; returns `Ok(false)` without a host.
pub(crate) fn take_report(text: &str, json: &impl Serialize) -> Result<bool, CommandError> {
    if !has_host() {
        return Ok(false);
    }
    let value = serde_json::to_value(json).map_err(CommandError::failed)?;
    Ok(with(|hosted| {
        hosted.ended.text = text.trim_end().to_owned();
        hosted.ended.json = Some(value);
    }))
}

fn with(change: impl FnOnce(&mut Hosted)) -> bool {
    HOSTED.with_borrow_mut(|hosted| hosted.as_mut().map(change)).is_some()
}
