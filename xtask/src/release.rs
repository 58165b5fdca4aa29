//! `cargo xtask release`: what has to pass before a version is published.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::command::{self, Outcome, output, passes, root, target, which};

/// Maximum size of the program `hystctl` \[MB\].
const MAX_PROGRAM_MB: f64 = 15.0;
const DENY: &str = "cargo-deny";
const MDBOOK: &str = "mdbook";

/// Parts of messages of cargo that cannot reach the registry.
const UNREACHABLE: [&str; 3] = ["download of config.json failed", "Could not connect to server", "Could not resolve"];

fn missing(tool: &str, what: &str) -> Outcome {
    Outcome::Skipped(format!("{tool} is missing, which {what}; install it with `cargo install --locked {tool}`"))
}

fn text(file: &str) -> String {
    std::fs::read_to_string(root().join(file)).unwrap_or_default()
}

/// Returns the value of the first line `key = "value"` or `key: value`.
fn value<'a>(text: &'a str, key: &str) -> Option<&'a str> {
    let of = |line: &'a str| line.strip_prefix(key)?.trim_start().strip_prefix(['=', ':']).map(str::trim);
    text.lines().find_map(of).map(|value| value.trim_matches('"'))
}

/// Checks that all files state the version of the workspace.
pub(crate) fn versions() -> Outcome {
    let manifest = text("Cargo.toml");
    let Some(version) = value(&manifest, "version") else {
        eprintln!("error: Cargo.toml: no line `version = \"…\"`; add it to [workspace.package]");
        return Outcome::Failed;
    };
    let mut wrong = Vec::new();
    for name in ["hyst-core", "hyst-ident", "hyst-hw", "hyst-cli"] {
        let wanted = format!("{name} = {{ path = \"crates/{name}\", version = \"{version}\" }}");
        if !manifest.lines().any(|line| line == wanted) {
            wrong.push(format!("Cargo.toml, [workspace.dependencies]: expected `{wanted}`"));
        }
    }
    if value(&text("CITATION.cff"), "version") != Some(version) {
        wrong.push(format!("CITATION.cff: expected `version: {version}`"));
    }
    let heading = format!("## {version}");
    if !text("CHANGELOG.md").lines().any(|line| line == heading || line.starts_with(&format!("{heading} "))) {
        wrong.push(format!("CHANGELOG.md: expected a heading `{heading}`"));
    }
    wrong.iter().for_each(|line| eprintln!("error: {line}"));
    if wrong.is_empty() { Outcome::Passed } else { Outcome::Failed }
}

/// Compares the address of the repository in the packages with the git remote `origin`.
pub(crate) fn repository() -> Outcome {
    let manifest = text("Cargo.toml");
    let stated = value(&manifest, "repository").unwrap_or_default();
    let Some(origin) = output(Command::new("git").args(["remote", "get-url", "origin"]).current_dir(root())) else {
        return Outcome::Skipped(format!(
            "there is no git remote `origin` to compare {stated} in Cargo.toml with; add it with `git remote add origin ADDRESS`"
        ));
    };
    // git@HOST:OWNER/NAME.git is https://HOST/OWNER/NAME.
    let address = origin.trim_end_matches(".git");
    let address = address
        .strip_prefix("git@")
        .map_or_else(|| address.to_owned(), |rest| format!("https://{}", rest.replacen(':', "/", 1)));
    if address == stated {
        return Outcome::Passed;
    }
    eprintln!("error: Cargo.toml: repository is {stated}, but the remote `origin` is {address}; change one of them");
    Outcome::Failed
}

/// Makes the packages of all public crates, without building them. Works before the first publication of any of them.
pub(crate) fn packages() -> Outcome {
    publish(&["--no-verify", "--allow-dirty"])
}

/// Makes the packages of all public crates and builds each from its package.
pub(crate) fn built_packages() -> Outcome {
    publish(&["--locked"])
}

fn publish(options: &[&str]) -> Outcome {
    let mut command = command::cargo();
    command.args(["publish", "--workspace", "--dry-run"]).args(options).stdin(Stdio::null()).stderr(Stdio::piped());
    let Ok(result) = command.output() else { return Outcome::Failed };
    let messages = String::from_utf8_lossy(&result.stderr);
    eprint!("{messages}");
    if result.status.success() {
        Outcome::Passed
    } else if UNREACHABLE.iter().any(|part| messages.contains(part)) {
        Outcome::Skipped("crates.io cannot be reached, which cargo needs to make a package".to_owned())
    } else {
        Outcome::Failed
    }
}

/// Checks licences, duplicates and sources of all dependencies (`deny.toml`).
pub(crate) fn dependencies() -> Outcome {
    if which(DENY).is_none() {
        return missing(DENY, "checks licences and sources of dependencies");
    }
    passes(command::cargo().args([
        "deny",
        "--workspace",
        "check",
        "--hide-inclusion-graph",
        "licenses",
        "bans",
        "sources",
    ]))
}

/// Checks the dependencies against the database of known vulnerabilities.
pub(crate) fn advisories() -> Outcome {
    if which(DENY).is_none() {
        return missing(DENY, "compares dependencies with known vulnerabilities");
    }
    if !matches!(passes(command::cargo().args(["deny", "fetch", "db"])), Outcome::Passed) {
        return Outcome::Skipped(
            "the database of vulnerabilities (https://github.com/rustsec/advisory-db) cannot be fetched".to_owned(),
        );
    }
    passes(command::cargo().args(["deny", "--workspace", "check", "--disable-fetch", "advisories"]))
}

/// Builds the guide as web pages.
pub(crate) fn guide() -> Outcome {
    let Some(mdbook) = which(MDBOOK) else { return missing(MDBOOK, "builds the guide") };
    passes(Command::new(mdbook).args(["build", "docs", "--dest-dir"]).arg(target().join("book")).current_dir(root()))
}

/// Builds `hystctl` as it is distributed and checks its size.
pub(crate) fn program() -> Outcome {
    let build = ["build", "--profile", "dist", "--locked", "--package", "hyst-cli", "--bin", "hystctl"];
    let Outcome::Passed = passes(command::cargo().args(build)) else { return Outcome::Failed };
    let file: PathBuf = target().join("dist").join(format!("hystctl{}", std::env::consts::EXE_SUFFIX));
    size(&file)
}

fn size(file: &Path) -> Outcome {
    let megabytes = match std::fs::metadata(file) {
        Ok(data) => data.len() as f64 / 1e6,
        Err(error) => {
            eprintln!("error: {}: {error}", file.display());
            return Outcome::Failed;
        }
    };
    eprintln!("{}: {megabytes:.1} MB, at most {MAX_PROGRAM_MB} MB", file.display());
    if megabytes <= MAX_PROGRAM_MB { Outcome::Passed } else { Outcome::Failed }
}

#[cfg(test)]
mod tests {
    use super::value;

    #[test]
    fn a_value_is_found_in_toml_and_yaml() {
        let toml = "[workspace.package]\nversion = \"1.2.3\"\nrust-version = \"1.89\"\n";
        assert_eq!(value(toml, "version"), Some("1.2.3"));
        assert_eq!(value("cff-version: 1.2.0\nversion: 0.1.0\n", "version"), Some("0.1.0"));
        assert_eq!(value("versions = 3\n", "version"), None);
    }
}
