//! The commands that a page of the guide shows, and whether they print what the page shows.
//!
//! A block marked `console` holds commands, each behind `$ `, and below each its output. A line `...` stands for any number of lines. The commands of a
//! page run from top to bottom in one folder. Figures may differ by 1 %: the last bits of another processor are not those of the page.

use std::env;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::{Lab, hystctl, root};

/// Largest relative difference of two figures that count as equal.
const TOLERANCE: f64 = 0.01;
/// The line that stands for any number of lines.
const ANY: &str = "...";

/// A command of a page.
#[derive(Debug, PartialEq)]
pub struct Shown {
    /// The line of the page on which it begins, from 1.
    pub line: usize,
    /// The command, with the lines of its here-document.
    pub command: String,
    /// The lines that the page shows below it.
    pub output: Vec<String>,
}

/// The folder of the guide.
pub fn folder() -> PathBuf {
    root().join("docs/guide")
}

/// The pages of the guide, by their paths below its folder.
///
/// # Panics
/// When the folder cannot be read.
pub fn pages() -> Vec<String> {
    let mut names = Vec::new();
    let mut folders = vec![folder()];
    while let Some(some) = folders.pop() {
        for entry in fs::read_dir(&some).expect("the guide has a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "md") {
                let name = path.strip_prefix(folder()).expect("it is below the folder");
                names.push(name.to_string_lossy().into_owned());
            }
        }
    }
    names.sort();
    names
}

/// The commands of a page in order.
///
/// # Panics
/// When a console block does not begin with a command, or a here-document has no end.
pub fn commands(page: &str) -> Vec<Shown> {
    let mut found: Vec<Shown> = Vec::new();
    let mut is_console = false;
    let mut until: Option<String> = None;
    let mut is_first = false;
    for (at, line) in page.lines().enumerate() {
        if let Some(end) = &until {
            let command = &mut found.last_mut().expect("a here-document belongs to a command").command;
            command.push('\n');
            command.push_str(line);
            until = (line != end).then(|| end.clone());
        } else if line.starts_with("```") {
            is_first = line == "```console";
            is_console = is_first;
        } else if is_console {
            if let Some(command) = line.strip_prefix("$ ") {
                until = here_document(command);
                found.push(Shown { line: at + 1, command: command.to_owned(), output: Vec::new() });
            } else {
                assert!(!is_first, "line {}: a console block begins with a command behind \"$ \"", at + 1);
                found.last_mut().expect("output follows a command").output.push(line.to_owned());
            }
            is_first = false;
        }
    }
    assert!(until.is_none(), "a here-document does not end");
    found
}

/// The word that ends the here-document of a command.
fn here_document(command: &str) -> Option<String> {
    let (_, word) = command.split_once("<<")?;
    Some(word.split_whitespace().next()?.trim_matches('\'').to_owned())
}

/// Runs the commands of a page in an empty folder. Returns a message for each that does not print what the page shows.
///
/// # Panics
/// When the page cannot be read or `bash` cannot be started.
pub fn differences(page: &Path) -> String {
    let text = fs::read_to_string(page).unwrap_or_else(|error| panic!("{}: {error}", page.display()));
    let lab = Lab::new();
    let mut found = String::new();
    for shown in commands(&text) {
        let printed = printed(&lab, &shown.command);
        let lines: Vec<&str> = printed.lines().collect();
        if !matches(&shown.output, &lines) {
            let Shown { line, command, output } = shown;
            writeln!(found, "line {line}: {command}\nthe page shows\n{}\nit prints\n{printed}", output.join("\n"))
                .expect("a string takes any text");
        }
    }
    found
}

/// What a command prints to both outputs.
fn printed(lab: &Lab, command: &str) -> String {
    let programs = hystctl().parent().expect("a program is in a folder");
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

/// Whether printed lines are the shown ones, in which [`ANY`] stands for any number of lines.
fn matches<S: AsRef<str>>(shown: &[S], printed: &[&str]) -> bool {
    let Some((first, rest)) = shown.split_first() else { return printed.is_empty() };
    if first.as_ref() == ANY {
        return (0..=printed.len()).any(|skipped| matches(rest, &printed[skipped..]));
    }
    printed.split_first().is_some_and(|(line, others)| same_line(first.as_ref(), line) && matches(rest, others))
}

/// Whether two lines have the same words, or figures that agree within [`TOLERANCE`].
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
    fn commands_have_their_documents_and_output() {
        let page = "Text\n```console\n$ cat > a <<'END'\n1\nEND\n$ cat a\n1\n```\n```sh\n$ not run\n```\n";
        let found = commands(page);
        assert_eq!(found[0], Shown { line: 3, command: "cat > a <<'END'\n1\nEND".into(), output: Vec::new() });
        assert_eq!(found[1], Shown { line: 6, command: "cat a".into(), output: vec!["1".into()] });
        assert_eq!(found.len(), 2);
    }

    #[test]
    fn dots_stand_for_any_lines_and_figures_may_differ_by_a_hundredth() {
        assert!(matches(&["a", "...", "d 1.00"], &["a", "b", "c", "d 1.009"]));
        assert!(!matches(&["a", "...", "d 1.00"], &["a", "b", "c", "d 1.02"]));
        assert!(!matches(&["a"], &["a", "b"]));
        assert!(!matches::<&str>(&[], &["a"]));
    }
}
