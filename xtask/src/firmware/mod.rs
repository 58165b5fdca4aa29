//! The firmware check: the core on a Cortex-M4F.
//!
//! - The core has no dependency that needs an operating system.
//! - All models build for the target, and no function of them can panic.
//! - In QEMU they compute the same bits as on this machine, within a bounded stack.
//! - `docs/firmware.md` contains their present costs.
//! - The reference firmware passes the tests with a host over a serial line.

mod figures;
mod link;
mod toolchain;

use crate::command::{Outcome, cargo, output, passes, root, target};
use figures::Figures;
use std::fs;
use std::path::Path;
use std::process::Command;
use toolchain::{NotRun, TARGET, Toolchain};

/// Permitted dependencies of the core, all `no_std`: always, and those of optional features.
const ALWAYS: &[&str] = &["hyst-core", "libm"];
const ON_DEMAND: &[&str] = &[
    "byteorder",
    "cobs",
    "crc",
    "crc-catalog",
    "hash32",
    "heapless",
    "postcard",
    "serde",
    "serde_core",
    "stable_deref_trait",
    "thiserror",
];

/// Runs the check; `write`: writes `docs/firmware.md` instead of comparing it.
pub(crate) fn check(write: bool) -> Outcome {
    match steps(write) {
        Ok(()) => Outcome::Passed,
        Err(Ended::Failed(why)) => {
            if !why.is_empty() {
                eprintln!("error: {why}");
            }
            Outcome::Failed
        }
        Err(Ended::NotRun(why)) => Outcome::Skipped(why),
    }
}

/// Reason why the check did not pass.
enum Ended {
    Failed(String),
    NotRun(String),
}

impl From<String> for Ended {
    fn from(why: String) -> Self {
        Self::Failed(why)
    }
}

fn steps(write: bool) -> Result<(), Ended> {
    depends_on_no_std()?;
    let firmware = root().join("tests/firmware");
    same_libm(&firmware)?;
    done(cargo().args(["fmt", "--all", "--check"]).current_dir(&firmware))?;
    let toolchain = Toolchain::find().map_err(|how| {
        Ended::NotRun(format!("no compiler for {TARGET}, so only dependencies were checked; type {how}"))
    })?;
    eprintln!("{} for {TARGET}", toolchain.version);

    let target = target().join("firmware");
    let built = target.join(TARGET).join("release");
    done(
        toolchain
            .cargo("build", &target)
            .args(["--release", "--package", "hyst-core", "--all-features"])
            .current_dir(root()),
    )?;
    if toolchain.lints {
        let strict = ["--release", "--locked", "--workspace", "--", "-D", "warnings"];
        done(toolchain.cargo("clippy", &target).args(strict).current_dir(&firmware))?;
    }
    done(toolchain.cargo("build", &target).args(["--release", "--locked"]).current_dir(&firmware))?;

    // Optimised for speed (as measured) and for size, because the optimiser leaves different bounds checks.
    let library = built.join("libhyst_bare.a");
    let small = target.join("small");
    let for_size = ["--release", "--locked", "--package", "hyst-bare", "--config", "profile.release.opt-level='s'"];
    done(toolchain.cargo("build", &small).args(for_size).current_dir(&firmware))?;
    let small = small.join(TARGET).join("release/libhyst_bare.a");
    cannot_panic(&toolchain, &library, "3")?;
    cannot_panic(&toolchain, &small, "s")?;

    let printed = target.join("agree.txt");
    match toolchain::emulate(&built.join("agree"), &printed) {
        Ok(()) => {}
        Err(NotRun::Failed) => return Err(Ended::Failed(String::new())),
        Err(NotRun::Missing(what)) => {
            return Err(Ended::NotRun(format!(
                "the firmware builds and cannot panic, but was not run; this needs {what}"
            )));
        }
    }
    let agree = ["test", "--quiet", "--workspace", "--test", "agree", "--", "--nocapture", "--include-ignored"];
    done(cargo().args(agree).env("HYST_FIRMWARE", &printed))?;
    let line = [
        "test",
        "--quiet",
        "--workspace",
        "--test",
        "servo",
        "--",
        "--nocapture",
        "--test-threads=1",
        "--ignored",
        "--skip",
        "learns",
    ];
    done(cargo().args(line).env("HYST_SERVO", built.join("servo")))?;

    let figures = Figures::collect(&toolchain, &library, &small, &printed)?;
    let document = root().join("docs/firmware.md");
    let result = if write { figures.write(&document) } else { figures.compare(&document) };
    Ok(result?)
}

/// Checks that no function of the library can panic.
fn cannot_panic(toolchain: &Toolchain, library: &Path, level: &str) -> Result<(), String> {
    let functions = link::functions(library)?;
    let found = link::can_panic(toolchain, library, &functions)?;
    let all = functions.len();
    if all > 0 && found.is_empty() {
        eprintln!("{all} functions link without a panic at opt-level {level}");
        return Ok(());
    }
    Err(format!("{} of {all} functions can panic at opt-level {level}: {}", found.len(), found.join(" ")))
}

/// Checks that host and firmware use the same version of `libm`.
fn same_libm(firmware: &Path) -> Result<(), String> {
    let version = |folder: &Path| {
        let lock = folder.join("Cargo.lock");
        let text = fs::read_to_string(&lock).map_err(|error| format!("{}: {error}", lock.display()))?;
        let version = text.split("name = \"libm\"\n").nth(1).and_then(|rest| rest.lines().next().map(str::to_owned));
        version.ok_or_else(|| format!("{} has no libm", lock.display()))
    };
    let (host, device) = (version(&root())?, version(firmware)?);
    if host == device {
        Ok(())
    } else {
        Err(format!(
            "different versions of libm: {host} in Cargo.lock, {device} in tests/firmware/Cargo.lock; \
             type `cargo update -p libm` in one of the two folders"
        ))
    }
}

/// Checks that all dependencies of the core are on the list of `no_std` packages.
fn depends_on_no_std() -> Result<(), String> {
    let tree = |features: &str| {
        let arguments =
            ["tree", "--package", "hyst-core", features, "--edges", "normal,no-proc-macro", "--prefix", "none"];
        let tree = output(cargo().args(arguments).args(["--format", "{p}"])).ok_or("cargo tree failed")?;
        Ok::<Vec<String>, String>(tree.lines().filter_map(|l| l.split(' ').next()).map(str::to_owned).collect())
    };
    for (features, allowed) in
        [("--no-default-features", ALWAYS.to_vec()), ("--all-features", [ALWAYS, ON_DEMAND].concat())]
    {
        if let Some(name) = tree(features)?.iter().find(|name| !name.is_empty() && !allowed.contains(&name.as_str())) {
            return Err(format!(
                "hyst-core ({features}) depends on {name}; if it is no_std, add it to the list in xtask/src/firmware/mod.rs"
            ));
        }
    }
    let source = root().join("crates/hyst-core/src/lib.rs");
    let source = fs::read_to_string(&source).map_err(|error| format!("{}: {error}", source.display()))?;
    if source.contains("#![no_std]") {
        Ok(())
    } else {
        Err("crates/hyst-core/src/lib.rs does not contain #![no_std]".to_owned())
    }
}

fn done(command: &mut Command) -> Result<(), Ended> {
    match passes(command) {
        Outcome::Passed => Ok(()),
        _ => Err(Ended::Failed(String::new())),
    }
}
