//! Targets of results (files that are written completely or not at all, stdout) and reports about them.

use std::convert::Infallible;
use std::ffi::OsStr;
use std::fmt;
use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::str::FromStr;

use hyst_ident::atomic_file::{check_writable, write_beside_older};
use hyst_ident::record::WriteError;
use serde::Serialize;

use crate::exit::{CommandError, CommandResult, Exit};
use crate::hosted;

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

    /// Writes measured data as [`write`](Self::write) does.
    /// If the folder refuses the file, it goes to the folder for temporary files, because a measurement cannot be
    /// repeated.
    pub(crate) fn write_measured(&self, content: impl Fn(&mut dyn Write) -> io::Result<()>) -> CommandResult {
        let Err(refused) = self.write(&content) else { return Ok(()) };
        let stem = self.file().and_then(Path::file_stem).unwrap_or(OsStr::new("record")).to_string_lossy();
        // The temporary folder is shared: `tempfile` creates a new file and never opens an existing one.
        let fallback = || -> io::Result<PathBuf> {
            let mut file = tempfile::Builder::new().prefix(&format!("{stem}-")).suffix(".csv").tempfile()?;
            {
                let mut buffered = io::BufWriter::new(&mut file);
                content(&mut buffered)?;
                buffered.flush()?;
            }
            file.as_file().sync_all()?;
            Ok(file.into_temp_path().keep()?)
        };
        let what = match fallback() {
            Ok(path) => format!("the measured data are saved in {}; copy that file", path.display()),
            Err(_) => "the measured data are in no record".to_owned(),
        };
        Err(CommandError::new(Exit::DeviceLost, anyhow::anyhow!("{}; {what}", refused.text())))
    }

    /// Writes `content` to the target.
    /// An existing file is kept under another name, unless it has the same content.
    pub(crate) fn write(&self, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> CommandResult {
        match self {
            Self::File(path) => {
                if let Some(older) = write_beside_older(path, content)? {
                    print_renamed(path, &older);
                }
                Ok(())
            }
            Self::Stdout if hosted::has_host() => {
                let mut bytes = Vec::new();
                content(&mut bytes)?;
                hosted::take_stdout(&bytes);
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

/// Refuses to write a result of bytes to a terminal, which would show them as random characters and act on some.
/// `what` is the result, for example `a postcard block`.
pub(crate) fn refuse_terminal(target: &Target, what: &str) -> CommandResult {
    if *target != Target::Stdout || hosted::has_host() || !io::stdout().is_terminal() {
        return Ok(());
    }
    Err(CommandError::bad_input(format!(
        "{what} is binary and is not written to a terminal; give -o FILE, or send it to another program with a pipe"
    )))
}

/// A writer that ignores a broken pipe: a reader that closes early (`head`) is not an error.
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

/// Converts the error of a record's writer, for [`Target::write`].
pub(crate) fn io_error(error: WriteError) -> io::Error {
    match error {
        WriteError::Io(error) => error,
        other => io::Error::other(other),
    }
}

/// Refuses targets that cannot be written or that would overwrite an input of the command.
/// Called before any work.
pub(crate) fn check(read: &[&Path], written: &[&Target]) -> CommandResult {
    if written.iter().filter(|target| ***target == Target::Stdout).count() > 1 {
        return Err(CommandError::bad_input("two results cannot both go to stdout; give one of them a file"));
    }
    let files: Vec<&Path> = written.iter().filter_map(|target| target.file()).collect();
    for (k, path) in files.iter().enumerate() {
        let shown = path.display();
        if read.iter().any(|other| same(path, other)) {
            let message = format!("{shown}: the same command reads this file; give the output another name");
            return Err(CommandError::bad_input(message));
        }
        if files[..k].iter().any(|other| same(path, other)) {
            return Err(CommandError::bad_input(format!("{shown}: two outputs have this name; rename one of them")));
        }
        if path.is_dir() {
            return Err(CommandError::bad_input(format!("{shown}: the output is a folder; give a file in it")));
        }
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        if !folder.is_dir() {
            let message = format!("{shown}: the folder {} does not exist; create it first", folder.display());
            return Err(CommandError::bad_input(message));
        }
        check_writable(path)?;
    }
    Ok(())
}

/// Prints that an existing file was renamed.
pub(crate) fn print_renamed(path: &Path, older: &Path) {
    // The target of a link is in another folder; any other file is shown with the path as it was given.
    let link = path.symlink_metadata().is_ok_and(|metadata| metadata.is_symlink());
    let older = older.file_name().filter(|_| !link).map_or_else(|| older.to_owned(), |name| path.with_file_name(name));
    say(&format!("note: {} existed and was renamed to {}", path.display(), older.display()));
}

/// Whether two paths name the same file, which may not exist yet.
fn same(a: &Path, b: &Path) -> bool {
    let real = |path: &Path| {
        path.canonicalize().ok().or_else(|| {
            let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
            Some(folder.canonicalize().ok()?.join(path.file_name()?))
        })
    };
    a == b || real(a).is_some_and(|a| Some(a) == real(b))
}

/// The report of a command: text, or with `--json` JSON on stdout.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Report {
    json: bool,
    text_to_stderr: bool,
}

impl Report {
    /// Creates a report; its text goes to stderr if a result goes to stdout.
    ///
    /// # Errors
    /// When JSON and a result would both go to stdout.
    pub(crate) fn new(json: bool, written: &[&Target]) -> CommandResult<Self> {
        let has_result = written.contains(&&Target::Stdout);
        if json && has_result {
            let message = "--json prints the report to stdout, but a result goes there, too; give the result a file";
            return Err(CommandError::bad_input(message));
        }
        Ok(Self { json, text_to_stderr: has_result })
    }

    /// Returns the same report with its text always on stderr.
    pub(crate) fn on_stderr(self) -> Self {
        Self { text_to_stderr: true, ..self }
    }

    /// Prints the text or the JSON.
    pub(crate) fn print(self, text: &str, json: &impl Serialize) -> CommandResult {
        if hosted::take_report(text, json)? {
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

/// Formats a value as JSON for files and reports, with a newline at the end.
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

/// Prints one or more lines to stdout.
pub(crate) fn print(text: &str) -> CommandResult {
    Target::Stdout.write(|out| writeln!(out, "{}", text.trim_end()))
}

/// Prints one or more lines to stderr.
pub(crate) fn say(text: &str) {
    if hosted::take_line(text.trim_end()) {
        return;
    }
    // A closed stderr is not an error.
    let _ = writeln!(io::stderr().lock(), "{}", text.trim_end());
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inputs_folders_and_repeated_targets_are_refused_as_outputs() {
        let folder = tempfile::tempdir().unwrap();
        let record = folder.path().join("a.csv");
        std::fs::write(&record, "x").unwrap();
        let same_file = folder.path().join(".").join("a.csv");
        let target = |path: &Path| Target::File(path.to_owned());
        let refused = |target: &Target| check(&[&record], &[target]).unwrap_err();
        refused(&target(&record));
        refused(&target(&same_file));
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
