//! Where results go: files that are written whole or not at all, stdout, and what is said about them.

use std::convert::Infallible;
use std::ffi::OsStr;
use std::fmt;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use hyst_ident::atomic_file::{check_writable, write_beside_older, write_over_alike};
use hyst_ident::record::WriteError;
use serde::Serialize;

use crate::exit::{CommandError, CommandResult, Exit};
use crate::host;

/// The target of one result.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Target {
    /// `-`
    Stdout,
    /// A file.
    File(PathBuf),
}

impl FromStr for Target {
    type Err = Infallible;
    fn from_str(text: &str) -> Result<Self, Infallible> {
        Ok(if text == "-" { Self::Stdout } else { Self::File(text.into()) })
    }
}

impl fmt::Display for Target {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stdout => f.write_str("stdout"),
            Self::File(path) => path.display().fmt(f),
        }
    }
}

impl Target {
    /// The file, unless it is stdout.
    pub(crate) fn file(&self) -> Option<&Path> {
        match self {
            Self::Stdout => None,
            Self::File(path) => Some(path),
        }
    }

    /// As [`write`](Self::write); an older file is set aside first.
    pub(crate) fn write_beside_older(&self, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> CommandResult {
        let Self::File(path) = self else { return self.write(content) };
        if let Some(older) = write_beside_older(path, content)? {
            tell_set_aside(path, &older);
        }
        Ok(())
    }

    /// As [`write_beside_older`](Self::write_beside_older), of what cannot be had again: where its folder refuses it, it goes to the folder for
    /// temporary files.
    pub(crate) fn write_measured(&self, content: impl Fn(&mut dyn Write) -> io::Result<()>) -> CommandResult {
        let Err(refused) = self.write_beside_older(&content) else { return Ok(()) };
        let stem = self.file().and_then(Path::file_stem).unwrap_or(OsStr::new("record")).to_string_lossy();
        // In a folder of everybody: a file of its own, that nobody can have put there.
        let refuge = || -> io::Result<PathBuf> {
            let mut file = tempfile::Builder::new().prefix(&format!("{stem}-")).suffix(".csv").tempfile()?;
            {
                let mut buffered = io::BufWriter::new(&mut file);
                content(&mut buffered)?;
                buffered.flush()?;
            }
            file.as_file().sync_all()?;
            Ok(file.into_temp_path().keep()?)
        };
        let what = match refuge() {
            Ok(path) => format!("what was measured is kept in {}: take it from there", path.display()),
            Err(_) => "what was measured is in no record".to_owned(),
        };
        Err(CommandError::new(Exit::DeviceLost, anyhow::anyhow!("{}; {what}", refused.text())))
    }

    /// Writes what `content` writes. An older file that is something else, as a record where a drive is written, keeps its content under another name.
    pub(crate) fn write(&self, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> CommandResult {
        match self {
            Self::File(path) => {
                if let Some(older) = write_over_alike(path, content)? {
                    tell_set_aside(path, &older);
                }
                Ok(())
            }
            Self::Stdout if host::is_lent() => {
                let mut bytes = Vec::new();
                content(&mut bytes)?;
                host::take_stdout(&bytes);
                Ok(())
            }
            Self::Stdout => {
                let mut out = io::BufWriter::new(Pipe(io::stdout().lock()));
                content(&mut out)?;
                Ok(out.flush()?)
            }
        }
    }
}

/// A writer that swallows what nobody reads any more: a reader that has seen enough is no error.
struct Pipe<W>(W);

impl<W: Write> Write for Pipe<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match self.0.write(bytes) {
            Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(bytes.len()),
            other => other,
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self.0.flush() {
            Err(error) if error.kind() == io::ErrorKind::BrokenPipe => Ok(()),
            other => other,
        }
    }
}

/// The error of a record's writer, for [`Target::write`].
pub(crate) fn io_error(error: WriteError) -> io::Error {
    match error {
        WriteError::Io(error) => error,
        other => io::Error::other(other),
    }
}

/// Refuses targets that cannot be written, or that would destroy what the command reads; before any work is done.
pub(crate) fn check(read: &[&Path], written: &[&Target]) -> CommandResult {
    if written.iter().filter(|target| ***target == Target::Stdout).count() > 1 {
        return Err(CommandError::bad_input("two results cannot both go to stdout; give one of them a file"));
    }
    let files: Vec<&Path> = written.iter().filter_map(|target| target.file()).collect();
    for (k, path) in files.iter().enumerate() {
        let shown = path.display();
        if read.iter().any(|other| same(path, other)) {
            let message = format!("{shown}: this file is read by the same command; give the output another name");
            return Err(CommandError::bad_input(message));
        }
        if files[..k].iter().any(|other| same(path, other)) {
            return Err(CommandError::bad_input(format!("{shown}: two outputs have this name; give them two")));
        }
        if path.is_dir() {
            return Err(CommandError::bad_input(format!("{shown}: this is a folder; give a file in it")));
        }
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        if !folder.is_dir() {
            let message = format!("{shown}: the folder {} does not exist; make it first", folder.display());
            return Err(CommandError::bad_input(message));
        }
        check_writable(path)?;
    }
    Ok(())
}

/// Says that an older file has another name now.
pub(crate) fn tell_set_aside(path: &Path, older: &Path) {
    // Behind a link it lies in another folder; else it is named as the path was given.
    let link = path.symlink_metadata().is_ok_and(|there| there.is_symlink());
    let older = older.file_name().filter(|_| !link).map_or_else(|| older.to_owned(), |name| path.with_file_name(name));
    say(&format!("note: {} was there already; it is {} now", path.display(), older.display()));
}

/// Whether two paths lead to the same file, be it there already or not.
fn same(a: &Path, b: &Path) -> bool {
    let real = |path: &Path| {
        path.canonicalize().ok().or_else(|| {
            let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
            Some(folder.canonicalize().ok()?.join(path.file_name()?))
        })
    };
    a == b || real(a).is_some_and(|a| Some(a) == real(b))
}

/// What a command says about its results: as text, or with `--json` as JSON on stdout.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Report {
    json: bool,
    text_to_stderr: bool,
}

impl Report {
    /// A report that keeps out of the way of results on stdout.
    pub(crate) fn new(json: bool, written: &[&Target]) -> CommandResult<Self> {
        let taken = written.contains(&&Target::Stdout);
        if json && taken {
            let message = "--json prints the report to stdout, where a result goes already; give the result a file";
            return Err(CommandError::bad_input(message));
        }
        Ok(Self { json, text_to_stderr: taken })
    }

    /// The same report with its text on stderr in any case.
    pub(crate) fn on_stderr(self) -> Self {
        Self { text_to_stderr: true, ..self }
    }

    /// Prints one of the two.
    pub(crate) fn print(self, text: &str, json: &impl Serialize) -> CommandResult {
        if host::take_report(text, json)? {
            Ok(())
        } else if self.json {
            print_json(json)
        } else if self.text_to_stderr {
            say(text);
            Ok(())
        } else {
            print(text)
        }
    }
}

/// JSON as files and reports hold it.
pub(crate) fn json(value: &impl Serialize) -> CommandResult<String> {
    let mut text = serde_json::to_string_pretty(value).map_err(io::Error::other)?;
    text.push('\n');
    Ok(text)
}

/// Prints JSON to stdout.
pub(crate) fn print_json(value: &impl Serialize) -> CommandResult {
    let text = json(value)?;
    Target::Stdout.write(|out| out.write_all(text.as_bytes()))
}

/// Prints a line (or more) to stdout.
pub(crate) fn print(text: &str) -> CommandResult {
    Target::Stdout.write(|out| writeln!(out, "{}", text.trim_end()))
}

/// Prints a line (or more) to stderr.
pub(crate) fn say(text: &str) {
    if host::take_said(text.trim_end()) {
        return;
    }
    // Where stderr is closed there is nobody to tell.
    let _ = writeln!(io::stderr().lock(), "{}", text.trim_end());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_read_is_never_written() {
        let folder = tempfile::tempdir().unwrap();
        let record = folder.path().join("a.csv");
        std::fs::write(&record, "x").unwrap();
        let round_about = folder.path().join(".").join("a.csv");
        let target = |path: &Path| Target::File(path.to_owned());
        let refused = |target: &Target| check(&[&record], &[target]).unwrap_err();
        refused(&target(&record));
        refused(&target(&round_about));
        refused(&target(folder.path()));
        refused(&target(&folder.path().join("absent").join("b.csv")));
        let fresh = target(&folder.path().join("b.csv"));
        check(&[&record], &[&fresh, &Target::Stdout]).unwrap();
        check(&[&record], &[&fresh, &target(&folder.path().join(".").join("b.csv"))]).unwrap_err();
        check(&[], &[&Target::Stdout, &Target::Stdout]).unwrap_err();
    }

    #[test]
    fn json_and_a_result_do_not_share_stdout() {
        let file = Target::File("a".into());
        Report::new(true, &[&file]).unwrap();
        Report::new(true, &[&Target::Stdout]).unwrap_err();
        assert!(Report::new(false, &[&Target::Stdout]).unwrap().text_to_stderr);
    }
}
