//! Runs the programs of the checks.

use std::env;
use std::ffi::OsStr;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::OnceLock;
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Result of a check.
#[derive(Clone)]
pub(crate) enum Outcome {
    Passed,
    Failed,
    Skipped(String),
}

/// A check that is a cargo command.
pub(crate) struct Check {
    pub(crate) name: &'static str,
    pub(crate) arguments: &'static [&'static str],
    pub(crate) environment: &'static [(&'static str, &'static str)],
}

/// Returns the folder of the workspace.
pub(crate) fn root() -> PathBuf {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    package.parent().unwrap_or(package).to_owned()
}

/// Returns a command of the same cargo that started this program, in the folder of the workspace.
pub(crate) fn cargo() -> Command {
    // Cargo sets this variable for its subcommands.
    let mut command = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(root());
    if let Some(program) = BUILT.get() {
        command.env("HYSTCTL", program);
    }
    command
}

/// Path of the program `hystctl`, after it is built.
static BUILT: OnceLock<PathBuf> = OnceLock::new();

/// Arguments of cargo that build the whole workspace.
///
/// All checks use the whole workspace: for a single package, cargo builds most dependencies again, with
/// fewer features. Tests use `hystctl` from this build.
pub(crate) const BUILD: [&str; 5] = ["build", "--workspace", "--lib", "--bins", "--tests"];

pub(crate) fn build() -> Outcome {
    let outcome = passes(cargo().args(BUILD));
    if matches!(outcome, Outcome::Passed) {
        let _ = BUILT.set(program());
    }
    outcome
}

/// Returns the path of the built `hystctl`.
pub(crate) fn program() -> PathBuf {
    target().join("debug").join(format!("hystctl{}", env::consts::EXE_SUFFIX))
}

pub(crate) fn run(check: &Check) -> Outcome {
    passes(cargo().args(check.arguments).envs(check.environment.iter().copied()))
}

/// Runs tests, prints their output and adds the name and reason of each ignored test.
pub(crate) fn run_tests(check: &Check, ignored: &mut Vec<String>) -> Outcome {
    let mut command = cargo();
    command.args(check.arguments).envs(check.environment.iter().copied()).stdout(Stdio::piped());
    let Ok(mut child) = command.spawn() else { return Outcome::Failed };
    for line in child.stdout.take().into_iter().flat_map(|stdout| BufReader::new(stdout).lines()).map_while(Result::ok)
    {
        println!("{line}");
        let name = line.strip_prefix("test ").and_then(|line| line.split_once(" ... ignored"));
        ignored.extend(name.map(|(name, reason)| format!("{name}{}", reason.replacen(", ", ": ", 1))));
    }
    match child.wait() {
        Ok(status) if status.success() => Outcome::Passed,
        _ => Outcome::Failed,
    }
}

/// Runs a command; passes if it exits successfully.
pub(crate) fn passes(command: &mut Command) -> Outcome {
    match command.status() {
        Ok(status) if status.success() => Outcome::Passed,
        Ok(_) => Outcome::Failed,
        Err(error) => {
            eprintln!("error: {} could not be started: {error}", command.get_program().display());
            Outcome::Failed
        }
    }
}

/// Runs a command and returns its output; `None` if it fails.
pub(crate) fn output(command: &mut Command) -> Option<String> {
    let output = command.output().ok().filter(|o| o.status.success())?;
    Some(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// Waits for a program for at most `limit`; then ends it and returns `None`.
pub(crate) fn wait(mut child: Child, limit: Duration) -> Option<ExitStatus> {
    let start = Instant::now();
    while start.elapsed() < limit {
        match child.try_wait() {
            Ok(Some(status)) => return Some(status),
            Ok(None) => sleep(Duration::from_millis(20)),
            Err(_) => break,
        }
    }
    // It may already have ended, so errors are ignored.
    let _ = child.kill();
    let _ = child.wait();
    None
}

/// Returns the path of a program on the search path.
pub(crate) fn which(program: impl AsRef<OsStr>) -> Option<PathBuf> {
    let path = env::var_os("PATH")?;
    env::split_paths(&path).map(|folder| folder.join(program.as_ref())).find(|file| file.is_file())
}

/// Returns the target folder.
pub(crate) fn target() -> PathBuf {
    env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), |folder| root().join(folder))
}

/// Returns whether this program runs as root.
pub(crate) fn as_root() -> bool {
    output(Command::new("id").arg("-u")).is_some_and(|id| id == "0")
}

/// Runs a command without its standard output; returns whether it exits successfully.
pub(crate) fn passes_quietly(command: &mut Command) -> bool {
    command.stdin(Stdio::null()).stdout(Stdio::null()).status().is_ok_and(|status| status.success())
}

/// Installs Debian packages, if this program runs as root; returns whether that succeeds.
pub(crate) fn install(packages: &[&str]) -> bool {
    if !as_root() || which("apt-get").is_none() {
        return false;
    }
    let apt = |arguments: &[&str]| {
        let mut command = Command::new("apt-get");
        passes_quietly(command.args(["-qq"]).args(arguments).env("DEBIAN_FRONTEND", "noninteractive"))
    };
    let install = [&["install", "-y", "--no-install-recommends"], packages].concat();
    eprintln!("apt-get install {}", packages.join(" "));
    apt(&install) || (apt(&["update"]) && apt(&install))
}
