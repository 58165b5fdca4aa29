//! Tests of slcan and ISO-TP against CAN packages of Python.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::command::{Outcome, cargo, passes_quietly, target};
use crate::python::{interpreter, program};

const NEEDED: &[&str] = &["python-can==4.*", "can-isotp==2.*", "pyserial==3.*"];
/// Program that succeeds if all packages are installed.
const IMPORTS: &str = "import can, isotp, serial";

/// Runs the test `peers` of `hyst-hw`.
pub(super) fn check() -> Outcome {
    if !cfg!(unix) {
        return Outcome::Skipped("slcan was not tested against python-can: this needs pseudo terminals".to_owned());
    }
    let python = match environment(&target().join("can").join("python")) {
        Ok(python) => python,
        Err(why) => return Outcome::Skipped(format!("slcan was not tested against python-can: {why}")),
    };
    let mut command = cargo();
    command.args(["test", "--workspace", "--test", "peers", "--", "--ignored", "--nocapture", "--test-threads=1"]);
    let Ok(output) = command.env("HYST_PYTHON", python).stderr(Stdio::inherit()).output() else {
        return Outcome::Failed;
    };
    let text = String::from_utf8_lossy(&output.stdout);
    eprintln!("{}", text.trim());
    let ran = text.contains("test result: ok.") && !text.contains(" 0 passed");
    if output.status.success() && ran { Outcome::Passed } else { Outcome::Failed }
}

/// Returns a Python with all packages; reuses that of an earlier run if possible.
fn environment(own: &Path) -> Result<PathBuf, String> {
    let python = program(own);
    let there = || passes_quietly(Command::new(&python).args(["-c", IMPORTS]).stderr(Stdio::null()));
    if there() {
        return Ok(python);
    }
    let base = interpreter().ok_or(crate::python::INSTALL)?;
    let install = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check"];
    let made = passes_quietly(Command::new(base).args(["-m", "venv", "--clear"]).arg(own))
        && passes_quietly(Command::new(&python).args(install).args(NEEDED));
    let how = || format!("`pip install {}` failed; check the network connection", NEEDED.join(" "));
    if made && there() { Ok(python) } else { Err(how()) }
}
