//! `cargo xtask test`: the checks of the project, in the order in which they fail fastest.
//!
//! It runs all of them and ends with a table; a check that cannot run here says why and how to make it run.

mod browser;
mod can;
mod command;
mod firmware;
mod layouts;
mod logs;
mod python;

use command::{Check, Outcome};
use std::env;
use std::process::ExitCode;
use std::time::Instant;

const USAGE: &str = "\
cargo xtask test                run the checks: format, lints, tests, documentation, firmware, CAN, logs, Python
cargo xtask test --long         the same with the tests that take a minute or more each (modules `long`): 15 minutes more
cargo xtask firmware            run the firmware check alone: the core on a Cortex-M4F, in QEMU
cargo xtask firmware --table    the same, and write its figures to docs/firmware.md
cargo xtask can                 run the CAN check alone: against python-can, and in QEMU against Linux's own ISO-TP and slcan
cargo xtask fuzz [CASES]        frames and bytes by chance against whatever takes them, 1,000,000 cases of each kind; half an hour
cargo xtask logs                run the log checks alone: logs of every kind of run, read with Foxglove's Go programs
cargo xtask layouts             run the layout check alone: files that other programs write, read by hystctl as they are
cargo xtask python              run the Python check alone: the wheel in a fresh environment, against the references
";

fn main() -> ExitCode {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments[..] {
        ["test"] => test(SHORT),
        ["test", "--long"] => test(ALL),
        ["firmware"] => table(&[("firmware", timed("firmware", || firmware::check(false)))]),
        ["firmware", "--table"] => table(&[("firmware", timed("firmware", || firmware::check(true)))]),
        ["can"] => table(&[("can", timed("can", can::check))]),
        ["fuzz", ref more @ ..] => table(&[("fuzz", timed("fuzz", || fuzz(more)))]),
        ["logs"] => table(&logs()),
        ["layouts"] => table(&[("layouts", timed("layouts", layouts::check))]),
        ["python"] => table(&[("python", timed("python", python::check))]),
        [] | ["help" | "--help" | "-h"] => {
            print!("{USAGE}");
            ExitCode::SUCCESS
        }
        _ => {
            eprintln!("error: no task is called {:?}\n{USAGE}", arguments.join(" "));
            ExitCode::from(2)
        }
    }
}

const FIRST: &[Check] = &[
    Check { name: "format", arguments: &["fmt", "--all", "--check"], environment: &[] },
    Check {
        name: "lints",
        arguments: &["clippy", "--workspace", "--all-targets", "--", "-D", "warnings"],
        environment: &[],
    },
];

// Without `--lib`, which would test libraries that say they have no tests. The lints have compiled the examples, and no test runs one.
const SHORT: &[Check] = &[Check {
    name: "tests, not long ones",
    arguments: &["test", "--workspace", "--no-fail-fast", "--tests", "--", "--skip", "::long::"],
    environment: &[],
}];
const ALL: &[Check] =
    &[Check { name: "tests", arguments: &["test", "--workspace", "--no-fail-fast", "--tests"], environment: &[] }];

const AFTER_TESTS: &[Check] = &[
    Check { name: "examples in texts", arguments: &["test", "--workspace", "--doc"], environment: &[] },
    Check {
        name: "core without features",
        arguments: &[
            "clippy",
            "--package",
            "hyst-core",
            "--no-default-features",
            "--all-targets",
            "--",
            "-D",
            "warnings",
        ],
        environment: &[],
    },
    Check {
        name: "wire without std",
        arguments: &["clippy", "--package", "hyst-hw", "--no-default-features", "--", "-D", "warnings"],
        environment: &[],
    },
    Check {
        name: "documentation",
        arguments: &["doc", "--workspace", "--no-deps", "--document-private-items"],
        environment: &[("RUSTDOCFLAGS", "-D warnings")],
    },
];

fn test(tests: &'static [Check]) -> ExitCode {
    // Before the tests: one of them needs it.
    let mut results = vec![("browser", timed("browser", browser::check))];
    let run =
        |checks: &'static [Check]| checks.iter().map(|check| (check.name, timed(check.name, || command::run(check))));
    results.extend(run(FIRST));
    results.push(("build", timed("build", command::build)));
    results.extend(run(tests));
    results.extend(run(AFTER_TESTS));
    results.push(("firmware", timed("firmware", || firmware::check(false))));
    results.push(("can", timed("can", can::check)));
    results.extend(logs());
    results.push(("layouts", timed("layouts", layouts::check)));
    results.push(("python", timed("python", python::check)));
    table(&results)
}

/// Says by itself what to do with a number of cases that is none.
fn fuzz(arguments: &[&str]) -> Outcome {
    let program = ["run", "--release", "--quiet", "--package", "hyst-tests", "--example", "fuzz", "--"];
    command::passes(command::cargo().args(program).args(arguments))
}

fn logs() -> Vec<(&'static str, (Outcome, f64))> {
    let (library, tool) = ("logs, Go library", "logs, mcap doctor");
    vec![(library, timed(library, logs::library)), (tool, timed(tool, logs::tool))]
}

fn table(results: &[(&str, (Outcome, f64))]) -> ExitCode {
    eprintln!();
    let mut failed = false;
    for (name, (outcome, seconds)) in results {
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
