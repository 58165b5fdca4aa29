//! Commands within another program: nothing is printed, the results come back, and the device may be one of the program's own.
//!
//! ```
//! use hyst_cli::host::{Host, command};
//!
//! let ended = command(["hystctl", "excite", "sine", "--high", "100", "-o", "-"].map(Into::into), Host::default());
//! assert_eq!(ended.exit, 0, "{:?}", ended.error);
//! assert!(ended.stdout.starts_with(b"segment,time_s,voltage_v"));
//! ```

use std::cell::RefCell;
use std::ffi::OsString;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use clap::Parser;
use hyst_hw::Daq;
use hyst_ident::stop::Stop;
use serde::Serialize;

use crate::cli::Cli;
use crate::commands;
use crate::exit::{Classified, CommandError, Exit};

/// The device of the program that runs the command; on the command line it is `--daq host:`.
pub trait HostDaq: Daq<Error = HostDaqError> + Send {
    /// Lets it come to rest no steeper than this from now on \[V/s\].
    fn gentle(&mut self, slew_v_per_s: f64);
}

/// What a device of the host says.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct HostDaqError {
    /// In words, with what to do.
    pub message: String,
    /// Whether the request was refused and nothing moved; otherwise the device is lost.
    pub refused: bool,
}

impl Classified for HostDaqError {
    fn exit(&self) -> Exit {
        if self.refused { Exit::BadInput } else { Exit::DeviceLost }
    }
}

/// Takes a line.
pub type Say = Box<dyn FnMut(&str) + Send>;

/// What a program lends a command.
#[derive(Default)]
pub struct Host {
    /// Its device, for commands with `--daq host:`.
    pub daq: Option<Box<dyn HostDaq>>,
    /// Once it is true what runs ends: a run comes to rest, a search has its best so far.
    pub stop: Arc<AtomicBool>,
    /// Is given each line that the command line prints to stderr.
    pub say: Option<Say>,
}

/// How a command ended.
#[derive(Clone, Debug, Default)]
pub struct Ended {
    /// The exit code of the command line: 0 done, 1 failed, 2 bad arguments or input, 3 device lost or data at risk.
    pub exit: u8,
    /// Why it did not end with 0, as the command line says it.
    pub error: Option<String>,
    /// The report in words.
    pub text: String,
    /// The report as `--json` prints it.
    pub json: Option<serde_json::Value>,
    /// What else went to stdout.
    pub stdout: Vec<u8>,
}

/// What a running command has of its host.
struct Lent {
    host: Host,
    ended: Ended,
}

thread_local! {
    /// A command runs on the thread that called it.
    static LENT: RefCell<Option<Lent>> = const { RefCell::new(None) };
}

/// Runs one command on this thread; `arguments` begin with the name of the program.
pub fn command(arguments: impl IntoIterator<Item = OsString>, host: Host) -> Ended {
    // What is lent goes back, even if a command panics; a command within another leaves that as it was.
    let _back = Back(LENT.replace(Some(Lent { host, ended: Ended::default() })));
    let done = match Cli::try_parse_from(arguments) {
        Ok(cli) => commands::dispatch(cli.command),
        Err(asked) if asked.use_stderr() => Err(CommandError::bad_input(asked.to_string().trim_end())),
        Err(help) => return Ended { text: help.to_string(), ..Ended::default() },
    };
    let ended = LENT.take().map(|lent| lent.ended).unwrap_or_default();
    match done {
        Ok(()) => ended,
        Err(error) => Ended { exit: error.exit() as u8, error: Some(error.text()), ..ended },
    }
}

/// What a command found in its place.
struct Back(Option<Lent>);

impl Drop for Back {
    fn drop(&mut self) {
        LENT.set(self.0.take());
    }
}

/// Whether a command of this thread runs within another program.
pub(crate) fn is_lent() -> bool {
    LENT.with_borrow(Option::is_some)
}

/// What ends a run.
pub(crate) fn stop() -> Option<Arc<AtomicBool>> {
    LENT.with_borrow(|lent| lent.as_ref().map(|lent| Arc::clone(&lent.host.stop)))
}

/// What ends a computation.
pub(crate) fn stopping() -> Stop {
    stop().map_or_else(Stop::default, Stop::from)
}

/// Whether a search continues.
pub(crate) fn going() -> ControlFlow<()> {
    if stopping().is_stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}

/// The host's device, once.
pub(crate) fn daq() -> Option<Box<dyn HostDaq>> {
    LENT.with_borrow_mut(|lent| lent.as_mut().and_then(|lent| lent.host.daq.take()))
}

/// Gives the host what would go to stdout; false where there is no host.
pub(crate) fn take_stdout(bytes: &[u8]) -> bool {
    with(|lent| lent.ended.stdout.extend_from_slice(bytes))
}

/// Gives the host a line for stderr; false where there is no host.
pub(crate) fn take_said(text: &str) -> bool {
    // Taken out meanwhile: a host that says something may run a command of its own.
    let Some(Some(mut say)) = LENT.with_borrow_mut(|lent| lent.as_mut().map(|lent| lent.host.say.take())) else {
        return is_lent();
    };
    say(text);
    with(|lent| lent.host.say = Some(say))
}

/// Gives the host a report; `Ok(false)` where there is no host.
pub(crate) fn take_report(text: &str, json: &impl Serialize) -> Result<bool, CommandError> {
    if !is_lent() {
        return Ok(false);
    }
    let value = serde_json::to_value(json).map_err(CommandError::failed)?;
    Ok(with(|lent| {
        lent.ended.text = text.trim_end().to_owned();
        lent.ended.json = Some(value);
    }))
}

fn with(use_it: impl FnOnce(&mut Lent)) -> bool {
    LENT.with_borrow_mut(|lent| lent.as_mut().map(use_it)).is_some()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_within_another_leaves_that_as_it_was() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("drive.csv");
        // What is something else is set aside, which is said.
        std::fs::write(&path, "nothing of the kind").unwrap();
        let words = |last: &str| ["hystctl", "excite", "sine", "--high", "100", "-o", last].map(OsString::from);
        let (said, inner) = std::sync::mpsc::channel();
        let say: Say = Box::new(move |_| {
            let _ = said.send(command(words("-"), Host::default()));
        });
        let outer = command(words(&path.display().to_string()), Host { say: Some(say), ..Host::default() });
        assert_eq!((outer.exit, outer.json.is_some(), outer.stdout.len()), (0, true, 0), "{:?}", outer.error);
        let inner: Vec<Ended> = inner.try_iter().collect();
        assert!(!inner.is_empty() && inner.iter().all(|ended| ended.exit == 0 && !ended.stdout.is_empty()));
        assert!(!is_lent());
    }
}
