//! The layout check: `hystctl` reads files that other programs write.
//!
//! The values are compared with the written ones.

use std::path::Path;
use std::process::Command;

use crate::command::{self, Outcome, passes, passes_quietly};
use crate::python;

pub(crate) fn check() -> Outcome {
    let Some(interpreter) = python::interpreter() else { return Outcome::Skipped(python::INSTALL.to_owned()) };
    let own = command::target().join("layouts");
    let environment = own.join("environment");
    let (program, files) = (python::program(&environment), own.join("files"));
    let sources = command::root().join("tests").join("layouts");
    let python = |program: &Path| {
        let mut command = Command::new(program);
        command.current_dir(command::root());
        command.env_remove("PYTHONPATH").env_remove("PYTHONHOME").env_remove("VIRTUAL_ENV");
        command
    };
    let pip = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-r"];
    let installed = passes_quietly(python(Path::new(interpreter)).args(["-m", "venv"]).arg(&environment))
        && passes_quietly(python(&program).args(pip).arg(sources.join("requirements.txt")));
    if !installed {
        let wanted = sources.join("requirements.txt");
        return Outcome::Skipped(format!(
            "{} could not be installed; the messages of pip above have the reason",
            wanted.display()
        ));
    }
    let Outcome::Passed = command::build() else { return Outcome::Failed };
    let hystctl = command::program();
    let _ = std::fs::remove_dir_all(&files);
    match passes(python(&program).arg(sources.join("write.py")).arg(&files)) {
        Outcome::Passed => passes(python(&program).arg(sources.join("check.py")).arg(hystctl).arg(&files)),
        failed => failed,
    }
}
