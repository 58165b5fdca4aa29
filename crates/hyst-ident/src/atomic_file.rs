//! Atomic writing of files.
//!
//! The content is written to a temporary file in the folder of the target. The temporary file is renamed to the target
//! when everything is on the disk. A command that fails leaves an older file unchanged, and no fragment.

use std::fs::{self, File};
use std::io::{self, BufRead, BufReader, BufWriter, Seek, Write};
use std::path::{Path, PathBuf};

/// A file could not be written. An older file at the path is unchanged.
#[derive(Debug, thiserror::Error)]
#[error("{}: cannot be written: {source}", path.display())]
pub struct AtomicFileError {
    /// The path as given by the caller.
    pub path: PathBuf,
    /// The error of the operating system.
    pub source: io::Error,
}

/// Writes the file at `path` with `content`, and replaces an older file.
///
/// A symbolic link is kept, and its target is replaced. A path that is not a regular file (such as `/dev/stdout`) is
/// written directly.
///
/// # Errors
/// If the folder is missing or not writable, `path` is a folder, or `content` fails. Nothing is changed then.
pub fn write_atomic(
    path: impl AsRef<Path>,
    content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), AtomicFileError> {
    put(path.as_ref(), Older::Replaced, content).map(|_| ())
}

/// Writes a new file as [`write_atomic`] does; an existing file is not replaced.
///
/// # Errors
/// Those of [`write_atomic`], and [`AlreadyExists`](io::ErrorKind::AlreadyExists) if `path` exists.
pub fn create_atomic(
    path: impl AsRef<Path>,
    content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), AtomicFileError> {
    put(path.as_ref(), Older::Kept, content).map(|_| ())
}

/// Writes a file as [`write_atomic`] does, but keeps an older file under another name.
///
/// Returns this name: `path.~1~` or the next free number. An older file that is empty or has the same content is
/// replaced: nothing is lost.
///
/// # Errors
/// Those of [`write_atomic`], and if the older file cannot be renamed. Nothing is changed then.
pub fn write_beside_older(
    path: impl AsRef<Path>,
    content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<Option<PathBuf>, AtomicFileError> {
    put(path.as_ref(), Older::SetAside, content)
}

/// Checks that a file can be written at `path`, before a long computation.
///
/// # Errors
/// If the folder is missing or not writable, or the file is read-only.
pub fn check_writable(path: impl AsRef<Path>) -> Result<(), AtomicFileError> {
    let path = path.as_ref();
    let check = || place(path)?.map_or(Ok(()), |place| in_folder(&place.folder).map(drop));
    check().map_err(|source| AtomicFileError { path: path.to_owned(), source })
}

/// Gives the regular file `target` a second name and returns it.
///
/// The name is `target.~1~` or the next free number. The file keeps this name when `target` is replaced. If the file
/// system has no hard links, the file is renamed. A failure between the reservation of the name and the renaming may
/// leave an empty file.
///
/// # Errors
/// If the operating system refuses the new name.
pub fn set_aside(target: &Path) -> io::Result<PathBuf> {
    let mut number = 1_u64;
    loop {
        let mut name = target.as_os_str().to_owned();
        name.push(format!(".~{number}~"));
        let name = PathBuf::from(name);
        match fs::hard_link(target, &name) {
            Ok(()) => return Ok(name),
            // The name exists, perhaps created by another program at this moment.
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => number += 1,
            // The file system may have no hard links.
            Err(_) => match File::options().write(true).create_new(true).open(&name) {
                // An empty file reserves the name: only one of two programs can create it.
                Ok(_) => {
                    return fs::rename(target, &name).map(|()| name.clone()).inspect_err(|_| {
                        let _ = fs::remove_file(&name);
                    });
                }
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => number += 1,
                Err(error) => return Err(error),
            },
        }
    }
}

/// What happens to an older file.
#[derive(Clone, Copy, PartialEq)]
enum Older {
    Replaced,
    Kept,
    SetAside,
}

/// The place of a file: its path, its folder, and the metadata of an older file.
struct Place {
    target: PathBuf,
    folder: PathBuf,
    existing: Option<fs::Metadata>,
}

/// Returns the place of the file at `path`; `None` if `path` exists and is not a regular file.
fn place(path: &Path) -> io::Result<Option<Place>> {
    // Links are resolved, because the temporary file must be in the folder of the file that it replaces.
    let target = match path.canonicalize() {
        Ok(target) => target,
        Err(error) if error.kind() == io::ErrorKind::NotFound => path.to_owned(),
        Err(error) => return Err(error),
    };
    let existing = target.metadata().ok();
    match &existing {
        Some(metadata) if metadata.is_dir() => return Err(io::ErrorKind::IsADirectory.into()),
        Some(metadata) if !metadata.is_file() => return Ok(None),
        // Renaming would replace a read-only file.
        Some(metadata) if metadata.permissions().readonly() => {
            return Err(io::Error::new(io::ErrorKind::PermissionDenied, "the file is read-only"));
        }
        _ => {}
    }
    if target.file_name().is_none() {
        return Err(io::Error::new(io::ErrorKind::InvalidInput, "the path has no file name"));
    }
    let folder = target.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new(".")).to_owned();
    if !folder.is_dir() {
        let message = format!("the folder {} does not exist", folder.display());
        return Err(io::Error::new(io::ErrorKind::NotFound, message));
    }
    Ok(Some(Place { target, folder, existing }))
}

/// Whether the file at `path` has the same bytes as `new`.
fn is_same(path: &Path, mut new: &File) -> io::Result<bool> {
    let older = File::open(path)?;
    if older.metadata()?.len() != new.metadata()?.len() {
        return Ok(false);
    }
    new.rewind()?;
    let (mut older, mut new) = (BufReader::new(older), BufReader::new(new));
    loop {
        let (a, b) = (older.fill_buf()?, new.fill_buf()?);
        let same = a.len().min(b.len());
        if same == 0 {
            return Ok(a.len() == b.len());
        }
        if a[..same] != b[..same] {
            return Ok(false);
        }
        older.consume(same);
        new.consume(same);
    }
}

/// Writes a file, and returns the new name of an older file.
fn put(
    path: &Path,
    older: Older,
    content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<Option<PathBuf>, AtomicFileError> {
    try_put(path, older, content).map_err(|source| AtomicFileError { path: path.to_owned(), source })
}

fn try_put(
    path: &Path,
    older: Older,
    content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> io::Result<Option<PathBuf>> {
    // A dangling link counts as existing.
    if older == Older::Kept && path.symlink_metadata().is_ok() {
        return Err(io::ErrorKind::AlreadyExists.into());
    }
    let Some(Place { target, folder, existing }) = place(path)? else {
        return write_through(File::options().write(true).open(path)?, content).map(|()| None);
    };
    let mut temporary = in_folder(&folder)?;
    {
        let mut buffered = BufWriter::new(temporary.as_file_mut());
        content(&mut buffered)?;
        buffered.flush()?;
    }
    let has_content = existing.as_ref().is_some_and(|metadata| metadata.len() > 0);
    if let Some(metadata) = existing {
        temporary.as_file().set_permissions(metadata.permissions())?;
    }
    temporary.as_file().sync_all()?;
    // A file that cannot be read counts as different.
    let keeps = older == Older::SetAside && has_content && !is_same(&target, temporary.as_file()).unwrap_or(false);
    let aside = if keeps { Some(set_aside(&target)?) } else { None };
    let named = match older {
        Older::Replaced | Older::SetAside => temporary.persist(&target),
        // Another program may have created the file in the meantime.
        Older::Kept => temporary.persist_noclobber(&target),
    };
    named.map_err(|error| error.error)?;
    Ok(aside)
}

fn write_through(file: File, content: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let mut buffered = BufWriter::new(file);
    content(&mut buffered)?;
    buffered.flush()
}

/// Creates a temporary file with the default permissions of the process, instead of owner-only permissions.
fn in_folder(folder: &Path) -> io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".hyst-").suffix(".part");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // The umask of the process applies.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    // The error names the temporary file, which the caller does not know.
    builder.tempfile_in(folder).map_err(|error| {
        let message = format!(
            "no file can be created in the folder {}: {}; give another folder or change its permissions",
            folder.display(),
            error.kind()
        );
        io::Error::new(error.kind(), message)
    })
}

#[cfg(test)]
mod tests;
