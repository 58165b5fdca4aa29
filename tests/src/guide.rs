//! Runs the commands that a page of the guide shows and compares their output with the page.
//!
//! A block marked `console` has commands, each after `$ `, and below each command its output. A line `...` matches any
//! number of lines. The commands of a page run from top to bottom in one folder. Figures may differ by 1 %: rounding
//! differs between processors.

use std::env;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::{Lab, hystctl, root};

/// Relative tolerance of figures.
const TOLERANCE: f64 = 0.01;
/// The line that matches any number of lines.
const ANY: &str = "...";

/// A command of a page.
#[derive(Debug, PartialEq)]
pub struct Shown {
    /// Line of the page at which the command begins, from 1.
    pub line: usize,
    /// The command, with the lines of its here-document.
    pub command: String,
    /// Output lines that the page shows.
    pub output: Vec<String>,
}

/// Returns the folder of the guide.
pub fn folder() -> PathBuf {
    root().join("docs/guide")
}

/// Returns the paths of the guide's pages relative to its folder, sorted.
///
/// # Panics
/// If the folder cannot be read.
pub fn pages() -> Vec<String> {
    let (mut names, guide) = (Vec::new(), folder());
    let mut folders = vec![guide.clone()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).expect("the guide has a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "md") {
                let name = path.strip_prefix(&guide).expect("the page is below the folder");
                names.push(name.to_string_lossy().into_owned());
            }
        }
    }
    names.sort();
    names
}

/// Returns the commands of a page in order.
///
/// # Panics
/// If a console block does not begin with a command, or a here-document has no end.
pub fn commands(page: &str) -> Vec<Shown> {
    let mut found: Vec<Shown> = Vec::new();
    let mut is_console = false;
    let mut end_word: Option<String> = None;
    let mut is_first = false;
    for (at, line) in page.lines().enumerate() {
        if let Some(end) = &end_word {
            let command = &mut found.last_mut().expect("a here-document belongs to a command").command;
            command.push('\n');
            command.push_str(line);
            end_word = (line != end).then(|| end.clone());
        } else if line.starts_with("```") {
            is_first = line == "```console";
            is_console = is_first;
        } else if is_console {
            if let Some(command) = line.strip_prefix("$ ") {
                end_word = here_document(command);
                found.push(Shown { line: at + 1, command: command.to_owned(), output: Vec::new() });
            } else {
                assert!(!is_first, "line {}: a console block must begin with a command after \"$ \"", at + 1);
                found.last_mut().expect("output follows a command").output.push(line.to_owned());
            }
            is_first = false;
        }
    }
    assert!(end_word.is_none(), "a here-document does not end");
    found
}

/// Returns the word that ends the here-document of a command.
fn here_document(command: &str) -> Option<String> {
    let (_, word) = command.split_once("<<")?;
    Some(word.split_whitespace().next()?.trim_matches('\'').to_owned())
}

/// Runs the commands of a page in an empty folder. Returns a message for each command whose output differs from the
/// page.
///
/// # Panics
/// If the page cannot be read or `bash` cannot be started.
pub fn differences(page: &Path) -> String {
    let text = fs::read_to_string(page).unwrap_or_else(|error| panic!("{}: {error}", page.display()));
    let lab = Lab::new();
    let mut found = String::new();
    for shown in commands(&text) {
        let printed = printed(&lab, &shown.command);
        let lines: Vec<&str> = printed.lines().collect();
        if !matches(&shown.output, &lines) {
            let Shown { line, command, output } = shown;
            writeln!(
                found,
                "line {line}: {command}\nthe page shows\n{}\nthe command prints\n{printed}",
                output.join("\n")
            )
            .expect("writing to a string cannot fail");
        }
    }
    found
}

/// Runs a command and returns its stdout and stderr together.
fn printed(lab: &Lab, command: &str) -> String {
    let programs = hystctl().parent().expect("the program is in a folder");
    let path = env::join_paths(
        std::iter::once(programs.to_owned()).chain(env::split_paths(&env::var_os("PATH").unwrap_or_default())),
    );
    let output = Command::new("bash")
        .args(["-c", &format!("exec 2>&1\n{command}")])
        .current_dir(lab.path("."))
        .env("PATH", path.expect("folders of a search path have no colon"))
        .stdin(Stdio::null())
        .output()
        .expect("bash starts");
    String::from_utf8(output.stdout).expect("hystctl prints UTF-8")
}

/// Returns whether the printed lines match the shown ones, in which [`ANY`] matches any number of lines.
fn matches<S: AsRef<str>>(shown: &[S], printed: &[&str]) -> bool {
    let Some((first, rest)) = shown.split_first() else { return printed.is_empty() };
    if first.as_ref() == ANY {
        return (0..=printed.len()).any(|skipped| matches(rest, &printed[skipped..]));
    }
    printed.split_first().is_some_and(|(line, others)| same_line(first.as_ref(), line) && matches(rest, others))
}

/// Returns whether two lines have the same words and figures that agree within 1 %.
pub fn same_line(shown: &str, printed: &str) -> bool {
    let (a, b): (Vec<&str>, Vec<&str>) = (shown.split_whitespace().collect(), printed.split_whitespace().collect());
    a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| same_word(a, b))
}

fn same_word(a: &str, b: &str) -> bool {
    let figure = |word: &str| {
        let inner = word.trim_matches(|c: char| !c.is_ascii_digit() && c != '-' && c != '.');
        inner.trim_end_matches('.').parse::<f64>().ok()
    };
    match (figure(a), figure(b)) {
        (Some(a), Some(b)) => (a - b).abs() <= TOLERANCE * a.abs().max(b.abs()),
        _ => a == b,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn commands_include_here_documents_and_output() {
        let page = "Text\n```console\n$ cat > a <<'END'\n1\nEND\n$ cat a\n1\n```\n```sh\n$ not run\n```\n";
        let found = commands(page);
        assert_eq!(found[0], Shown { line: 3, command: "cat > a <<'END'\n1\nEND".into(), output: Vec::new() });
        assert_eq!(found[1], Shown { line: 6, command: "cat a".into(), output: vec!["1".into()] });
        assert_eq!(found.len(), 2);
    }

    #[test]
    fn dots_match_any_lines_and_figures_may_differ_by_1_percent() {
        assert!(matches(&["a", "...", "d 1.00"], &["a", "b", "c", "d 1.009"]));
        assert!(!matches(&["a", "...", "d 1.00"], &["a", "b", "c", "d 1.02"]));
        assert!(!matches(&["a"], &["a", "b"]));
        assert!(!matches::<&str>(&[], &["a"]));
    }
}
