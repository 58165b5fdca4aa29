//! Runs commands inside another program.
//!
//! Nothing is printed: results and messages are returned to the program. The device may be one of the program.
//!
//! ```
//! use hyst_cli::host::{Host, command};
//!
//! let ended = command(["hystctl", "excite", "sine", "--high", "100", "-o", "-"].map(Into::into), Host::default());
//! assert_eq!(ended.exit, 0, "{:?}", ended.error);
//! assert!(ended.stdout.starts_with(b"segment,time_s,voltage_v"));
//! ```

use std::ffi::OsString;

use clap::Parser;

use crate::cli::Cli;
use crate::commands;
use crate::exit::CommandError;
use crate::hosted;
pub use crate::hosted::{Ended, Host, HostDaq, HostDaqError, Say};

/// Runs one command on this thread; `arguments` start with the name of the program.
pub fn command(arguments: impl IntoIterator<Item = OsString>, host: Host) -> Ended {
    let (done, ended) = hosted::run(host, || match Cli::try_parse_from(arguments) {
        Ok(cli) => commands::dispatch(cli.command).map(|()| None),
        Err(error) if error.use_stderr() => Err(CommandError::bad_input(error.to_string().trim_end())),
        Err(help) => Ok(Some(help.to_string())),
    });
    match done {
        Ok(None) => ended,
        Ok(Some(help)) => Ended { text: help, ..Ended::default() },
        Err(error) => Ended { exit: error.exit() as u8, error: Some(error.text()), ..ended },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_inside_another_does_not_change_the_outer_one() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("drive.csv");
        // A file with other content is renamed, and the note about it runs the inner command.
        std::fs::write(&path, "nothing of the kind").unwrap();
        let words = |last: &str| ["hystctl", "excite", "sine", "--high", "100", "-o", last].map(OsString::from);
        let (results, inner) = std::sync::mpsc::channel();
        let say: Say = Box::new(move |_| {
            let _ = results.send(command(words("-"), Host::default()));
        });
        let outer = command(words(&path.display().to_string()), Host { say: Some(say), ..Host::default() });
        assert_eq!((outer.exit, outer.json.is_some(), outer.stdout.len()), (0, true, 0), "{:?}", outer.error);
        let inner: Vec<Ended> = inner.try_iter().collect();
        assert!(!inner.is_empty() && inner.iter().all(|ended| ended.exit == 0 && !ended.stdout.is_empty()));
        assert!(!hosted::has_host());
    }
}
