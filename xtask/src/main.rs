//! `cargo xtask test`: every check of the project, in the order in which they fail fastest.
//!
//! `cargo xtask test` runs all of them and ends with a table; a check that cannot run here says why
//! and how to make it run.

mod python;

use std::env;
use std::process::{Command, ExitCode};
use std::time::Instant;

const USAGE: &str =
    "cargo xtask test    run every check: format, lints, tests, documentation, bare-metal core, Python\n";

fn main() -> ExitCode {
    match env::args().nth(1).as_deref() {
        Some("test") => test(),
        Some("help" | "--help" | "-h") | None => {
            print!("{USAGE}");
            ExitCode::SUCCESS
        }
        Some(other) => {
            eprintln!("error: no task is called {other:?}\n{USAGE}");
            ExitCode::from(2)
        }
    }
}

/// How a check ended.
enum Outcome {
    Passed,
    Failed,
    Skipped(String),
}

/// One check: what it is, and the cargo command that does it.
struct Check {
    name: &'static str,
    arguments: &'static [&'static str],
    environment: &'static [(&'static str, &'static str)],
}

const CHECKS: &[Check] = &[
    Check { name: "format", arguments: &["fmt", "--all", "--check"], environment: &[] },
    Check {
        name: "lints",
        arguments: &["clippy", "--workspace", "--all-targets", "--", "-D", "warnings"],
        environment: &[],
    },
    // The process-level tests drive this binary.
    Check { name: "build", arguments: &["build", "--package", "hyst-cli"], environment: &[] },
    Check { name: "tests", arguments: &["test", "--workspace"], environment: &[] },
    Check {
        name: "core without features",
        arguments: &["test", "--package", "hyst-core", "--no-default-features"],
        environment: &[],
    },
    Check {
        name: "documentation",
        arguments: &["doc", "--workspace", "--no-deps", "--document-private-items"],
        environment: &[("RUSTDOCFLAGS", "-D warnings")],
    },
];

fn test() -> ExitCode {
    let mut table = Vec::new();
    for check in CHECKS {
        table.push((check.name, timed(check.name, || run(check))));
    }
    table.push(("core on bare metal", timed("core on bare metal", bare_metal)));
    table.push(("python", timed("python", python::check)));
    eprintln!();
    let mut failed = false;
    for (name, (outcome, seconds)) in &table {
        let word = match outcome {
            Outcome::Passed => "passed".to_owned(),
            Outcome::Failed => {
                failed = true;
                "FAILED".to_owned()
            }
            Outcome::Skipped(why) => format!("did not run: {why}"),
        };
        eprintln!("{name:<24} {seconds:>6.1} s  {word}");
    }
    if failed { ExitCode::FAILURE } else { ExitCode::SUCCESS }
}

fn timed(name: &str, check: impl FnOnce() -> Outcome) -> (Outcome, f64) {
    eprintln!("\n== {name}");
    let start = Instant::now();
    let outcome = check();
    (outcome, start.elapsed().as_secs_f64())
}

fn cargo() -> Command {
    // Cargo tells its subcommands which cargo they belong to.
    let mut command = Command::new(env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/.."));
    command
}

fn run(check: &Check) -> Outcome {
    let mut command = cargo();
    command.args(check.arguments).envs(check.environment.iter().copied());
    match command.status() {
        Ok(status) if status.success() => Outcome::Passed,
        Ok(_) => Outcome::Failed,
        Err(error) => {
            eprintln!("error: cargo could not be started: {error}");
            Outcome::Failed
        }
    }
}

/// A target that has no standard library: what builds for it links none.
const BARE_METAL: &str = "thumbv7em-none-eabihf";

fn bare_metal() -> Outcome {
    let installed = Command::new("rustc")
        .args(["--print", "target-libdir", "--target", BARE_METAL])
        .output()
        .ok()
        .and_then(|o| String::from_utf8(o.stdout).ok())
        .is_some_and(|dir| std::path::Path::new(dir.trim()).is_dir());
    if !installed {
        return without_std();
    }
    let arguments =
        &["build", "--package", "hyst-core", "--no-default-features", "--features", "serde", "--target", BARE_METAL];
    run(&Check { name: "", arguments, environment: &[] })
}

/// Where the target is not installed: the core and all that it depends on must declare `no_std`.
fn without_std() -> Outcome {
    let tree = cargo()
        .args([
            "tree",
            "--package",
            "hyst-core",
            "--no-default-features",
            "--edges",
            "normal",
            "--prefix",
            "none",
            "--format",
            "{p}",
        ])
        .output();
    let Ok(tree) = tree else { return Outcome::Failed };
    let packages = String::from_utf8_lossy(&tree.stdout).into_owned();
    let names: Vec<&str> = packages.lines().filter_map(|l| l.split_whitespace().next()).collect();
    let source = concat!(env!("CARGO_MANIFEST_DIR"), "/../crates/hyst-core/src/lib.rs");
    let declared = std::fs::read_to_string(source).is_ok_and(|s| s.contains("#![no_std]"));
    // libm is no_std throughout; anything else that appears here has to be looked at first.
    if declared && names.iter().all(|n| ["hyst-core", "libm"].contains(n)) {
        eprintln!("hyst-core declares no_std and depends on: {}", names.join(", "));
        Outcome::Skipped(format!(
            "checked by its dependencies instead; `rustup target add {BARE_METAL}` makes it build"
        ))
    } else {
        eprintln!("error: hyst-core must be no_std with no dependency but libm, found {names:?}");
        Outcome::Failed
    }
}
