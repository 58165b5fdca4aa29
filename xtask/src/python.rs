//! The Python check: pip installs the package in a fresh environment, and tests compare it with references.
//!
//! The package is built in the development profile.

use std::env;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::command::Outcome;

/// Packages that the tests need.
const NEEDED: &[&str] = &[
    "numpy",
    "scipy",
    "pandas",
    "polars",
    "scikit-learn",
    "matplotlib",
    "pytest",
    "pytest-xdist",
    "mypy",
    "pyright[nodejs]",
    "pyarrow",
    "nbformat",
    "nbclient",
    "ipykernel",
    "ray",
    "control",
    "tqdm",
    "hypothesis",
    "mcap",
    "pymcap-cli==0.34.0",
    "jsonschema",
];
/// Interpreters, in the order in which they are tried.
const INTERPRETERS: &[&str] =
    &["python3", "python", "python3.14", "python3.13", "python3.12", "python3.11", "python3.10"];
/// Program that succeeds if the interpreter can build and test the package.
const SUITABLE: &str = "import sys, venv, ensurepip; sys.exit(sys.version_info < (3, 10))";
pub(crate) const INSTALL: &str =
    "no Python 3.10 or newer with the module venv was found (Debian: `apt-get install python3-venv`)";

/// Returns an interpreter that is new enough and can create environments.
pub(crate) fn interpreter() -> Option<&'static str> {
    let suitable = |python: &&str| {
        Command::new(python).args(["-c", SUITABLE]).output().is_ok_and(|output| output.status.success())
    };
    INTERPRETERS.iter().copied().find(suitable)
}

/// Returns the interpreter of an environment.
pub(crate) fn program(environment: &Path) -> PathBuf {
    environment.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" })
}

pub(crate) fn check() -> Outcome {
    let root = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."));
    let Some(python) = interpreter() else { return Outcome::Skipped(INSTALL.to_owned()) };
    let Some(logs) = crate::logs::made() else { return Outcome::Failed };
    let own = root.join("target").join("python-tests");
    // The other checks have already compiled most of the wheel in this profile.
    let builds = [("MATURIN_PEP517_ARGS", "--profile dev")];
    let run = |program: &Path, arguments: &[&str], environment: &[(&str, &str)]| {
        let mut command = Command::new(program);
        command.current_dir(root).args(arguments).env("HYST_LOGS", &logs);
        // Packages of the caller's environment must not be used.
        command.env_remove("PYTHONPATH").env_remove("PYTHONHOME").env_remove("VIRTUAL_ENV");
        command.envs(environment.iter().copied());
        match command.status() {
            Ok(status) => status.success(),
            Err(error) => {
                eprintln!("error: {} could not be started: {error}", program.display());
                false
            }
        }
    };
    let own_python = program(&own);
    let package = PathBuf::from("crates").join("hyst-py").display().to_string();
    let package = format!(".{}{package}", std::path::MAIN_SEPARATOR);
    let install = [&["-m", "pip", "install", "--quiet", "--disable-pip-version-check", &package], NEEDED].concat();
    let tests = ["-m", "pytest", "-q", "-rs", "-n", "auto", "-p", "no:cacheprovider", "tests/python"];
    let passed = run(Path::new(python), &["-m", "venv", "--clear", &own.display().to_string()], &[])
        && run(&own_python, &install, &builds)
        && run(&own_python, &tests, &[]);
    if passed { Outcome::Passed } else { Outcome::Failed }
}
