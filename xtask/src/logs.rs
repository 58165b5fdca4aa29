//! The log checks: Foxglove's Go library and its command-line program read logs of runs.

use std::env;
use std::ffi::OsStr;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::OnceLock;

use crate::command::{Outcome, build, cargo, passes, program, root, target, which};

/// Go package of the command-line program.
const TOOL: &str = "github.com/foxglove/mcap/go/cli/mcap@latest";
const GO: &str = "go";

/// Writes logs of all kinds of runs, once, and returns their folder; `None` if that fails.
pub(crate) fn made() -> Option<PathBuf> {
    static MADE: OnceLock<Option<PathBuf>> = OnceLock::new();
    let make = || {
        let folder = target().join("logs");
        // Logs of an earlier version must not be checked.
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
            "Go is missing, which reads the logs (https://go.dev/dl, Debian: `apt-get install golang`)".to_owned(),
        );
    }
    let Some(folder) = made() else { return Outcome::Failed };
    let mut read = Command::new(GO);
    read.args(["run", "."]).arg(folder).current_dir(root().join("tests").join("mcap")).env("GOWORK", "off");
    passes(&mut read)
}

/// Checks every log with `mcap doctor` and `mcap info`.
pub(crate) fn tool() -> Outcome {
    let Some(tool) = found() else {
        return Outcome::Skipped(format!(
            "there is no `mcap` on the path, and `go install {TOOL}` failed; https://mcap.dev/guides/cli explains the installation"
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
                // For a valid file, `mcap doctor` prints only its name; every other line is a warning.
                Ok(output) if output.status.success() && (what == "info" || has_no_warnings(&output.stdout)) => {}
                output => {
                    bad += 1;
                    eprintln!("error: mcap {what} {}: {output:?}", log.display());
                }
            }
        }
    }
    eprintln!("{} logs, {bad} errors and warnings", logs.len());
    if bad == 0 && !logs.is_empty() { Outcome::Passed } else { Outcome::Failed }
}

fn has_no_warnings(printed: &[u8]) -> bool {
    String::from_utf8_lossy(printed).lines().all(|line| line.trim().is_empty() || line.starts_with("Examining "))
}

/// Returns the program `mcap`: on the path, or in the target folder, where Go installs it.
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
    fn lines_other_than_the_file_name_are_warnings() {
        assert!(has_no_warnings(b"") && has_no_warnings(b"Examining a.mcap\n"));
        assert!(!has_no_warnings(b"Examining a.mcap\nDuplicate schema records in data section with ID 1\n"));
    }
}
