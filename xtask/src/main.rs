//! `cargo xtask test`: all checks of the project, the fastest ones first.
//!
//! It runs all checks and prints a table. For a check that cannot run, the table contains the reason and what to
//! install.

mod browser;
mod can;
mod command;
mod firmware;
mod layouts;
mod logs;
mod python;
mod release;

use command::{Check, Outcome};
use std::env;
use std::process::ExitCode;
use std::time::Instant;

const USAGE: &str = "\
cargo xtask test                run the checks: format, lints, tests, documentation, firmware, CAN, logs, layouts, Python, packages
cargo xtask test --quick        only format, lints and the unit tests of the core: for every save
cargo xtask test --long         all checks, including the tests of a minute or more (modules `long`): about 15 minutes more
cargo xtask firmware            run only the firmware check: the core on a Cortex-M4F, in QEMU
cargo xtask firmware --table    run the firmware check and write its figures to docs/firmware.md
cargo xtask can                 run only the CAN check: against python-can, and in QEMU against ISO-TP and slcan of Linux
cargo xtask fuzz [CASES]        feed random frames and bytes to all readers; default 1,000,000 cases of each kind, about 30 minutes
cargo xtask logs                run only the log checks: Foxglove's Go programs read logs of all kinds of runs
cargo xtask layouts             run only the layout check: hystctl reads files that other programs write
cargo xtask release             run the checks of a publication: packages, licences, vulnerabilities, guide, size of hystctl
cargo xtask release --quick     only those that build nothing
cargo xtask python              run only the Python check: the wheel in a fresh environment, against the references
";

fn main() -> ExitCode {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match arguments[..] {
        ["test"] => test(SHORT, LONG_TESTS_ARE_LEFT_OUT),
        ["test", "--long"] => test(ALL, ""),
        ["test", "--quick"] => quick(),
        ["firmware"] => table(&[("firmware", timed("firmware", || firmware::check(false)))]),
        ["firmware", "--table"] => table(&[("firmware", timed("firmware", || firmware::check(true)))]),
        ["can"] => table(&[("can", timed("can", can::check))]),
        ["fuzz", ref more @ ..] => table(&[("fuzz", timed("fuzz", || fuzz(more)))]),
        ["logs"] => table(&logs()),
        ["layouts"] => table(&[("layouts", timed("layouts", layouts::check))]),
        ["python"] => table(&[("python", timed("python", python::check))]),
        ["release"] => table(&[run_each(PUBLICATION), run_each(PUBLICATION_BUILDS)].concat()),
        ["release", "--quick"] => table(&run_each(PUBLICATION)),
        [] | ["help" | "--help" | "-h"] => {
            print!("{USAGE}");
            ExitCode::SUCCESS
        }
        _ => {
            eprintln!("error: unknown task {:?}; expected one of these:\n{USAGE}", arguments.join(" "));
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

// Not `--lib`: some libraries have `test = false`. Not `--examples`: the lints have compiled them, and no test runs
// one.
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

const QUICK: &[Check] = &[
    Check { name: "format", arguments: &["fmt", "--all", "--check"], environment: &[] },
    Check {
        name: "lints, not of tests",
        arguments: &["clippy", "--quiet", "--workspace", "--", "-D", "warnings"],
        environment: &[],
    },
    Check {
        name: "unit tests of the core",
        arguments: &["test", "--quiet", "--package", "hyst-core", "--lib"],
        environment: &[],
    },
];

fn quick() -> ExitCode {
    let results: Vec<_> = QUICK.iter().map(|check| (check.name, timed(check.name, || command::run(check)))).collect();
    table(&results)
}

const LONG_TESTS_ARE_LEFT_OUT: &str = "; the long tests (modules `long`) are left out, --long runs them";

fn test(tests: &'static [Check], left_out: &str) -> ExitCode {
    eprintln!(
        "all checks: about 35 minutes on two cores from nothing, 20 from built dependencies{left_out}; what cannot run here is \
         listed at the end, with the reason"
    );
    let mut ignored = Vec::new();
    // Before the tests, because one of them needs the browser.
    let mut results = vec![("browser", timed("browser", browser::check))];
    let run =
        |checks: &'static [Check]| checks.iter().map(|check| (check.name, timed(check.name, || command::run(check))));
    results.extend(run(FIRST));
    results.push(("build", timed("build", command::build)));
    results
        .extend(tests.iter().map(|check| (check.name, timed(check.name, || command::run_tests(check, &mut ignored)))));
    results.extend(run(AFTER_TESTS));
    results.extend(run_each(PACKAGES));
    results.push(("firmware", timed("firmware", || firmware::check(false))));
    results.push(("can", timed("can", can::check)));
    results.extend(logs());
    results.push(("layouts", timed("layouts", layouts::check)));
    results.push(("python", timed("python", python::check)));
    let code = table(&results);
    eprintln!("\n{} ignored tests", ignored.len());
    ignored.iter().for_each(|line| eprintln!("  {line}"));
    code
}

type Named = (&'static str, fn() -> Outcome);

/// The checks of a publication that are also part of `cargo xtask test`.
const PACKAGES: &[Named] = &[
    ("versions", release::versions),
    ("packages", release::packages),
    ("licences and sources", release::dependencies),
];

/// The checks of a publication that build nothing.
const PUBLICATION: &[Named] = &[
    PACKAGES[0],
    PACKAGES[1],
    PACKAGES[2],
    ("repository", release::repository),
    ("vulnerabilities", release::advisories),
    ("guide", release::guide),
];

/// The checks of a publication that build the program and the packages.
const PUBLICATION_BUILDS: &[Named] =
    &[("size of hystctl", release::program), ("build of the packages", release::built_packages)];

fn run_each(checks: &[Named]) -> Vec<(&'static str, (Outcome, f64))> {
    checks.iter().map(|(name, check)| (*name, timed(name, check))).collect()
}

/// Runs the fuzz example, which checks its arguments itself.
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
