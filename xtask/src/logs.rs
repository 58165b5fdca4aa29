//! Logs of runs, read by programs of others: Foxglove's Go library and its command line.

use std::env;
use std::ffi::OsStr;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::OnceLock;

use crate::command::{Outcome, build, cargo, passes, program, root, target, which};

/// Where the command line comes from.
const TOOL: &str = "github.com/foxglove/mcap/go/cli/mcap@latest";
const GO: &str = "go";

/// A folder with logs of every kind of run, made once; `None` if they could not be.
pub(crate) fn made() -> Option<PathBuf> {
    static MADE: OnceLock<Option<PathBuf>> = OnceLock::new();
    let make = || {
        let folder = target().join("logs");
        // What an older version has left is no log of this one.
        let _ = std::fs::remove_dir_all(&folder);
        let example = ["build", "--workspace", "--tests", "--example", "every_log"];
        let (Outcome::Passed, Outcome::Passed) = (build(), passes(cargo().args(example))) else { return None };
        let make = target().join("debug/examples").join(format!("every_log{}", env::consts::EXE_SUFFIX));
        let made = passes(Command::new(make).current_dir(root()).env("HYSTCTL", program()).arg(&folder));
        matches!(made, Outcome::Passed).then_some(folder)
    };
    MADE.get_or_init(make).clone()
}

/// Reads every record of every log with the Go library (`tests/mcap`).
pub(crate) fn library() -> Outcome {
    if which(GO).is_none() {
        return Outcome::Skipped(
            "there is no Go, which reads the logs (https://go.dev/dl, Debian: `apt-get install golang`)".to_owned(),
        );
    }
    let Some(folder) = made() else { return Outcome::Failed };
    let mut read = Command::new(GO);
    read.args(["run", "."]).arg(folder).current_dir(root().join("tests").join("mcap")).env("GOWORK", "off");
    passes(&mut read)
}

/// Looks at every log with `mcap doctor` and `mcap info`.
pub(crate) fn tool() -> Outcome {
    let Some(tool) = found() else {
        return Outcome::Skipped(format!(
            "there is no `mcap` on the path, and `go install {TOOL}` gives none; https://mcap.dev/guides/cli tells how to get it"
        ));
    };
    let Some(folder) = made() else { return Outcome::Failed };
    let Ok(entries) = std::fs::read_dir(&folder) else { return Outcome::Failed };
    let mut logs: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    logs.retain(|path| path.extension() == Some(OsStr::new("mcap")));
    logs.sort();
    let mut bad = 0;
    for log in &logs {
        for what in ["doctor", "info"] {
            match Command::new(&tool).arg(what).arg(log).output() {
                // The doctor's warnings are what it prints: of a sound file it says nothing but its name.
                Ok(said) if said.status.success() && (what == "info" || silent(&said.stdout)) => {}
                said => {
                    bad += 1;
                    eprintln!("error: mcap {what} {}: {said:?}", log.display());
                }
            }
        }
    }
    eprintln!("{} logs, {bad} complaints", logs.len());
    if bad == 0 && !logs.is_empty() { Outcome::Passed } else { Outcome::Failed }
}

fn silent(said: &[u8]) -> bool {
    String::from_utf8_lossy(said).lines().all(|line| line.trim().is_empty() || line.starts_with("Examining "))
}

/// The program `mcap`: on the path, or in the target folder, where it is installed if that can be done.
fn found() -> Option<PathBuf> {
    let tools = target().join("tools");
    let own = tools.join(format!("mcap{}", env::consts::EXE_SUFFIX));
    which("mcap").or_else(|| own.is_file().then(|| own.clone())).or_else(|| {
        let mut install = Command::new(which(GO)?);
        install.args(["install", TOOL]).env("GOBIN", &tools).env("GOWORK", "off").stdin(Stdio::null());
        eprintln!("go install {TOOL}");
        (install.status().is_ok_and(|status| status.success()) && own.is_file()).then_some(own)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_doctor_that_warns_is_not_silent() {
        assert!(silent(b"") && silent(b"Examining a.mcap\n"));
        assert!(!silent(b"Examining a.mcap\nDuplicate schema records in data section with ID 1\n"));
    }
}
