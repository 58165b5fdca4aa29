//! Sets `HYST_GIT` and `HYST_VERSION` from `git describe`; without a repository or git, `HYST_GIT` is empty.

use std::env;
use std::path::{Path, PathBuf};
use std::process::Command;

fn main() {
    let package = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    let workspace = package.join("../..");
    let git = described(&workspace).unwrap_or_default();
    let version = env::var("CARGO_PKG_VERSION").unwrap_or_default();
    println!("cargo::rustc-env=HYST_GIT={git}");
    let more = if git.is_empty() { String::new() } else { format!(" ({git})") };
    println!("cargo::rustc-env=HYST_VERSION={version}{more}");
    println!("cargo::rerun-if-changed=build.rs");
    // Sources that are compiled into the program, and git files that change with a commit.
    for name in ["hyst-cli", "hyst-core", "hyst-hw", "hyst-ident"] {
        watch(&workspace.join("crates").join(name).join("src"));
    }
    for name in ["HEAD", "logs/HEAD"] {
        if let Some(path) = git_output(&workspace, &["rev-parse", "--git-path", name]) {
            watch(&workspace.join(path));
        }
    }
}

/// Asks cargo to watch a file or folder. Cargo treats a missing path as changed in every build, so it is skipped.
fn watch(path: &Path) {
    if path.exists() {
        println!("cargo::rerun-if-changed={}", path.display());
    }
}

fn described(workspace: &Path) -> Option<String> {
    // The sources may be a folder of another repository; its state is not theirs.
    let top = PathBuf::from(git_output(workspace, &["rev-parse", "--show-toplevel"])?);
    if top.canonicalize().ok()? != workspace.canonicalize().ok()? {
        return None;
    }
    git_output(workspace, &["describe", "--always", "--dirty"])
}

fn git_output(folder: &Path, arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").arg("-C").arg(folder).args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?.trim().to_owned();
    (output.status.success() && !text.is_empty()).then_some(text)
}
