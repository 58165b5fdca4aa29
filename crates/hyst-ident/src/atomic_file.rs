//! Files that are written whole or not at all.
//!
//! The content goes to a temporary file in the target's folder, which takes the target's name only when everything is
//! on the disk. A command that fails half-way leaves an older file as it was, and no fragment.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// A file could not be written; whatever stood at the path is unchanged.
#[derive(Debug, thiserror::Error)]
#[error("{}: cannot be written: {source}", path.display())]
pub struct AtomicFileError {
    /// The path as it was given.
    pub path: PathBuf,
    /// What went wrong.
    pub source: io::Error,
}

/// Writes what `content` writes to the file at `path`, replacing an older one.
///
/// A symbolic link stays one: the file behind it is replaced. What is no regular file (as `/dev/stdout`) cannot be
/// replaced and is written directly.
///
/// # Errors
/// When the folder is missing or not writable, `path` is a folder, or `content` fails; nothing has changed then.
pub fn write_atomic(
    path: impl AsRef<Path>,
    content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), AtomicFileError> {
    let path = path.as_ref();
    put(path, Older::Replaced, content).map_err(|source| AtomicFileError { path: path.to_owned(), source })
}

/// As [`write_atomic`], but nothing that is there already is replaced.
///
/// # Errors
/// As [`write_atomic`], and with [`AlreadyExists`](io::ErrorKind::AlreadyExists) when there is something at `path`.
pub fn create_atomic(
    path: impl AsRef<Path>,
    content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), AtomicFileError> {
    let path = path.as_ref();
    put(path, Older::Kept, content).map_err(|source| AtomicFileError { path: path.to_owned(), source })
}

/// What becomes of an older file.
#[derive(Clone, Copy, PartialEq)]
enum Older {
    Replaced,
    Kept,
}

fn put(path: &Path, older: Older, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    // A link that leads nowhere is something, too.
    if older == Older::Kept && path.symlink_metadata().is_ok() {
        return Err(io::ErrorKind::AlreadyExists.into());
    }
    // Of the target, if there is one: the temporary file has to lie beside what it replaces.
    let target = match path.canonicalize() {
        Ok(target) => target,
        Err(error) if error.kind() == io::ErrorKind::NotFound => path.to_owned(),
        Err(error) => return Err(error),
    };
    let existing = target.metadata().ok();
    match &existing {
        Some(metadata) if metadata.is_dir() => return Err(io::ErrorKind::IsADirectory.into()),
        Some(metadata) if !metadata.is_file() => {
            return write_through(File::options().write(true).open(path)?, content);
        }
        // Renaming would replace a file that its owner protects.
        Some(metadata) if metadata.permissions().readonly() => {
            return Err(io::Error::new(io::ErrorKind::PermissionDenied, "the file is read-only"));
        }
        _ => {}
    }
    if target.file_name().is_none() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "the path has no file name"));
    }
    let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if !folder.is_dir() {
        let message = format!("the folder {} does not exist", folder.display());
        return Err(io::Error::new(io::ErrorKind::NotFound, message));
    }
    let mut temporary = in_folder(folder)?;
    {
        let mut buffered = BufWriter::new(temporary.as_file_mut());
        content(&mut buffered)?;
        buffered.flush()?;
    }
    if let Some(metadata) = existing {
        temporary.as_file().set_permissions(metadata.permissions())?;
    }
    temporary.as_file().sync_all()?;
    let named = match older {
        Older::Replaced => temporary.persist(&target),
        // Somebody else may have made one meanwhile.
        Older::Kept => temporary.persist_noclobber(&target),
    };
    named.map_err(|error| error.error)?;
    Ok(())
}

fn write_through(file: File, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let mut buffered = BufWriter::new(file);
    content(&mut buffered)?;
    buffered.flush()
}

/// A temporary file that everybody may read whom the process lets, not its owner alone.
fn in_folder(folder: &Path) -> io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".hyst-").suffix(".part");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // The process's umask applies.
        builder.permissions(std::fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> =
            fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_is_written_and_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.csv");
        for text in ["one", "a longer two", "3"] {
            write_atomic(&path, |out| out.write_all(text.as_bytes())).unwrap();
            assert_eq!(fs::read_to_string(&path).unwrap(), text);
        }
        assert_eq!(names(folder.path()), ["out.csv"]);
    }

    #[test]
    fn a_failure_leaves_the_older_file_and_no_fragment() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.csv");
        fs::write(&path, "older").unwrap();
        let error = write_atomic(&path, |out| {
            out.write_all(&[b'x'; 100_000])?;
            Err(io::Error::other("the model diverged"))
        })
        .unwrap_err();
        let message = error.to_string();
        assert!(message.contains("out.csv") && message.contains("the model diverged"), "{message}");
        assert_eq!(fs::read_to_string(&path).unwrap(), "older");
        assert_eq!(names(folder.path()), ["out.csv"]);
    }

    #[test]
    fn what_is_created_replaces_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("model.json");
        create_atomic(&path, |out| out.write_all(b"first")).unwrap();
        let refused = |path: &Path| create_atomic(path, |out| out.write_all(b"second")).unwrap_err().source.kind();
        assert_eq!(refused(&path), io::ErrorKind::AlreadyExists);
        assert_eq!(refused(folder.path()), io::ErrorKind::AlreadyExists);
        // One that appears while the content is written is kept as well.
        let late = folder.path().join("late.json");
        let error = create_atomic(&late, |_| fs::write(&late, "theirs")).unwrap_err();
        assert_eq!(error.source.kind(), io::ErrorKind::AlreadyExists);
        assert_eq!(fs::read_to_string(&path).unwrap(), "first");
        assert_eq!(fs::read_to_string(&late).unwrap(), "theirs");
        assert_eq!(names(folder.path()), ["late.json", "model.json"]);
    }

    #[test]
    fn folders_are_no_targets_and_have_to_exist() {
        let folder = tempfile::tempdir().unwrap();
        let write = |path: &Path| write_atomic(path, |_| Ok(())).unwrap_err().to_string();
        assert!(write(folder.path()).contains("directory"));
        let message = write(&folder.path().join("absent/out.csv"));
        assert!(message.contains("out.csv: cannot be written") && message.contains("does not exist"), "{message}");
        assert!(names(folder.path()).is_empty());
    }

    #[test]
    fn a_read_only_file_stays_as_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("model.json");
        fs::write(&path, "older").unwrap();
        let mut permissions = path.metadata().unwrap().permissions();
        permissions.set_readonly(true);
        fs::set_permissions(&path, permissions).unwrap();
        let message = write_atomic(&path, |out| out.write_all(b"newer")).unwrap_err().to_string();
        assert!(message.contains("model.json") && message.contains("read-only"), "{message}");
        assert_eq!(fs::read_to_string(&path).unwrap(), "older");
    }

    #[cfg(unix)]
    #[test]
    fn links_permissions_and_devices_are_respected() {
        use std::os::unix::fs::{PermissionsExt, symlink};
        let folder = tempfile::tempdir().unwrap();
        let (path, link) = (folder.path().join("out.csv"), folder.path().join("link.csv"));
        fs::write(&path, "older").unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).unwrap();
        symlink("out.csv", &link).unwrap();
        write_atomic(&link, |out| out.write_all(b"newer")).unwrap();
        assert!(link.symlink_metadata().unwrap().is_symlink());
        assert_eq!(fs::read_to_string(&path).unwrap(), "newer");
        assert_eq!(path.metadata().unwrap().permissions().mode() & 0o777, 0o640);

        write_atomic("/dev/null", |out| out.write_all(b"x")).unwrap();
        assert!(!Path::new("/dev/null").metadata().unwrap().is_file());
    }
}
