//! Programs that a check runs.

use std::env;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::OnceLock;
use std::thread::sleep;
use std::time::{Duration, Instant};

/// How a check ended.
pub(crate) enum Outcome {
    Passed,
    Failed,
    Skipped(String),
}

/// One check: what it is, and the cargo command that does it.
pub(crate) struct Check {
    pub(crate) name: &'static str,
    pub(crate) arguments: &'static [&'static str],
    pub(crate) environment: &'static [(&'static str, &'static str)],
}

/// The folder of the workspace.
pub(crate) fn root() -> PathBuf {
    let package = Path::new(env!("CARGO_MANIFEST_DIR"));
    package.parent().unwrap_or(package).to_owned()
}

/// The cargo that this was started by, in the folder of the workspace.
pub(crate) fn cargo() -> Command {
    // Cargo tells its subcommands which cargo they belong to.
    let mut command = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(root());
    if let Some(program) = BUILT.get() {
        command.env("HYSTCTL", program);
    }
    command
}

/// The program `hystctl`, once it is built and up to date.
static BUILT: OnceLock<PathBuf> = OnceLock::new();

/// The whole workspace, built once. All checks name it as a whole: of a package alone cargo builds most dependencies anew, with fewer
/// features. Tests take `hystctl` from here.
pub(crate) const BUILD: [&str; 5] = ["build", "--workspace", "--lib", "--bins", "--tests"];

pub(crate) fn build() -> Outcome {
    let outcome = passes(cargo().args(BUILD));
    if matches!(outcome, Outcome::Passed) {
        let _ = BUILT.set(program());
    }
    outcome
}

/// Where `hystctl` is built.
pub(crate) fn program() -> PathBuf {
    target().join("debug").join(format!("hystctl{}", env::consts::EXE_SUFFIX))
}

pub(crate) fn run(check: &Check) -> Outcome {
    passes(cargo().args(check.arguments).envs(check.environment.iter().copied()))
}

/// Whether the command ends well.
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

/// What the command prints, if it ends well.
pub(crate) fn output(command: &mut Command) -> Option<String> {
    let output = command.output().ok().filter(|o| o.status.success())?;
    Some(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// Waits for a program, but no longer than `limit`; `None` if it had to be ended.
pub(crate) fn wait(mut child: Child, limit: Duration) -> Option<ExitStatus> {
    let start = Instant::now();
    while start.elapsed() < limit {
        match child.try_wait() {
            Ok(Some(status)) => return Some(status),
            Ok(None) => sleep(Duration::from_millis(20)),
            Err(_) => break,
        }
    }
    // It may have ended by itself in the meantime, which is as good.
    let _ = child.kill();
    let _ = child.wait();
    None
}

/// Where a program is on the search path.
pub(crate) fn which(program: impl AsRef<OsStr>) -> Option<PathBuf> {
    let path = env::var_os("PATH")?;
    env::split_paths(&path).map(|folder| folder.join(program.as_ref())).find(|file| file.is_file())
}

/// The folder of what is built.
pub(crate) fn target() -> PathBuf {
    env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), |folder| root().join(folder))
}

/// Whether this may do anything.
pub(crate) fn as_root() -> bool {
    output(Command::new("id").arg("-u")).is_some_and(|id| id == "0")
}

/// Whether the command ends well; what it prints to standard output is nobody's.
pub(crate) fn passes_quietly(command: &mut Command) -> bool {
    command.stdin(Stdio::null()).stdout(Stdio::null()).status().is_ok_and(|status| status.success())
}

/// Installs Debian packages, where that needs nobody's leave.
pub(crate) fn install(packages: &[&str]) -> bool {
    if !as_root() || which("apt-get").is_none() {
        return false;
    }
    let apt = |arguments: &[&str]| {
        let mut command = Command::new("apt-get");
        passes_quietly(command.args(["-qq"]).args(arguments).env("DEBIAN_FRONTEND", "noninteractive"))
    };
    let ask = [&["install", "-y", "--no-install-recommends"], packages].concat();
    eprintln!("apt-get install {}", packages.join(" "));
    apt(&ask) || (apt(&["update"]) && apt(&ask))
}
