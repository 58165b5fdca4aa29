//! Sets a `cfg` for each thing outside of the project that some tests need. A test that needs a missing one is ignored,
//! with the reason.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::{env, fs};

/// Where package managers install programs.
const PACKAGES: &str = "/usr/bin";

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-env-changed=HYST_DATA");
    println!("cargo::rerun-if-env-changed=PATH");
    // A package that is installed later.
    if Path::new(PACKAGES).is_dir() {
        println!("cargo::rerun-if-changed={PACKAGES}");
    }
    let needed = [
        ("records", records as fn() -> bool),
        ("c_compiler", || runs("cc", &["--version"])),
        ("browser", browser),
        ("full_device", || Path::new("/dev/full").exists()),
        ("may_mount", || runs("unshare", &["--mount", "--map-root-user", "mount", "-t", "tmpfs", "none", "/mnt"])),
        ("file_permissions", file_permissions),
        ("other_user", || file_permissions() || runs_as_other_user()),
    ];
    for (name, is_there) in needed {
        println!("cargo::rustc-check-cfg=cfg({name})");
        if is_there() {
            println!("cargo::rustc-cfg={name}");
        }
    }
}

/// Measured and practice records: the folder `HYST_DATA`, else a folder next to the workspace.
fn records() -> bool {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    env::var_os("HYST_DATA").map_or(beside, PathBuf::from).is_dir()
}

fn browser() -> bool {
    let names = ["chromium", "chromium-browser", "google-chrome"];
    let folders: Vec<PathBuf> = env::split_paths(&env::var_os("PATH").unwrap_or_default()).collect();
    folders.iter().any(|folder| names.iter().any(|name| folder.join(name).is_file()))
}

/// Returns whether file permissions apply to this user; they do not apply to root.
fn file_permissions() -> bool {
    let folder = PathBuf::from(env::var_os("OUT_DIR").unwrap_or_default()).join("read-only");
    let lock = |locked: bool| {
        let mut permissions = fs::metadata(&folder)?.permissions();
        permissions.set_readonly(locked);
        fs::set_permissions(&folder, permissions)
    };
    let locked = fs::create_dir_all(&folder).and_then(|()| lock(true)).is_ok();
    locked && fs::write(folder.join("probe"), "").is_err()
}

/// Returns whether another user may run programs of the target folder.
fn runs_as_other_user() -> bool {
    let Some(folder) = env::var_os("OUT_DIR").and_then(|folder| folder.into_string().ok()) else { return false };
    runs("setpriv", &["--reuid=65534", "--regid=65534", "--clear-groups", "test", "-x", &folder])
}

fn runs(program: &str, arguments: &[&str]) -> bool {
    let mut command = Command::new(program);
    command.args(arguments).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    command.status().is_ok_and(|status| status.success())
}
