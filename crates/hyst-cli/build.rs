//! Which state of the source is built: `git describe` of the repository, where there is one and git can be asked.

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
    // What is compiled into the program, and what a commit changes.
    for name in ["hyst-cli", "hyst-core", "hyst-hw", "hyst-ident"] {
        watch(&workspace.join("crates").join(name).join("src"));
    }
    for name in ["HEAD", "logs/HEAD"] {
        if let Some(path) = git_says(&workspace, &["rev-parse", "--git-path", name]) {
            watch(&workspace.join(path));
        }
    }
}

/// Tells cargo to look at a file or folder; one that is absent would count as changed each time.
fn watch(path: &Path) {
    if path.exists() {
        println!("cargo::rerun-if-changed={}", path.display());
    }
}

fn described(workspace: &Path) -> Option<String> {
    // The sources may lie in somebody else's repository.
    let top = PathBuf::from(git_says(workspace, &["rev-parse", "--show-toplevel"])?);
    if top.canonicalize().ok()? != workspace.canonicalize().ok()? {
        return None;
    }
    git_says(workspace, &["describe", "--always", "--dirty"])
}

fn git_says(folder: &Path, arguments: &[&str]) -> Option<String> {
    let said = Command::new("git").arg("-C").arg(folder).args(arguments).output().ok()?;
    let text = String::from_utf8(said.stdout).ok()?.trim().to_owned();
    (said.status.success() && !text.is_empty()).then_some(text)
}
