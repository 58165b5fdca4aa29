//! Files that are written whole or not at all.
//!
//! The content goes to a temporary file in the target's folder, which takes the target's name only when everything is
//! on the disk. A command that fails half-way leaves an older file as it was, and no fragment.

use std::fs::{self, File};
use std::io::{self, BufWriter, Read, Seek, Write};
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
    put(path.as_ref(), Older::Replaced, content).map(|_| ())
}

/// As [`write_atomic`], but nothing that is there already is replaced.
///
/// # Errors
/// As [`write_atomic`], and with [`AlreadyExists`](io::ErrorKind::AlreadyExists) when there is something at `path`.
pub fn create_atomic(
    path: impl AsRef<Path>,
    content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), AtomicFileError> {
    put(path.as_ref(), Older::Kept, content).map(|_| ())
}

/// As [`write_atomic`], but an older file keeps its content under the name that is returned: `path.~1~` or the next free number.
///
/// # Errors
/// As [`write_atomic`], and when the older file cannot have another name; nothing has changed then.
pub fn write_beside_older(
    path: impl AsRef<Path>,
    content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<Option<PathBuf>, AtomicFileError> {
    put(path.as_ref(), Older::SetAside, content)
}

/// As [`write_beside_older`], but an older file of the same kind is replaced: one that begins as the new one does, with the same line of a text, or as
/// JSON, markup or binary data do. What was computed is computed anew; what is something else is kept.
///
/// # Errors
/// As [`write_beside_older`].
pub fn write_over_alike(
    path: impl AsRef<Path>,
    content: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<Option<PathBuf>, AtomicFileError> {
    put(path.as_ref(), Older::SetAsideIfOther, content)
}

/// Whether a file could be written at `path`: before work is done whose result would be lost.
///
/// # Errors
/// When the folder is missing or not writable, or there is a file that is protected.
pub fn check_writable(path: impl AsRef<Path>) -> Result<(), AtomicFileError> {
    let path = path.as_ref();
    let check = || place(path)?.map_or(Ok(()), |place| in_folder(&place.folder).map(drop));
    check().map_err(|source| AtomicFileError { path: path.to_owned(), source })
}

/// Gives the regular file `target` a second name, `target.~1~` or the next free number, under which it stays when `target` is
/// replaced. Where the file system knows no second names, the file is renamed; what fails between taking the new name and that may leave
/// an empty file there.
///
/// # Errors
/// When the folder refuses.
pub fn set_aside(target: &Path) -> io::Result<PathBuf> {
    let mut number = 1_u64;
    loop {
        let mut name = target.as_os_str().to_owned();
        name.push(format!(".~{number}~"));
        let name = PathBuf::from(name);
        match fs::hard_link(target, &name) {
            Ok(()) => return Ok(name),
            // Somebody's, perhaps of this very moment.
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => number += 1,
            // Perhaps there are no second names here.
            Err(_) => match File::options().write(true).create_new(true).open(&name) {
                // The name is taken by an empty file first: of two programs only one can make it.
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

/// What becomes of an older file.
#[derive(Clone, Copy, PartialEq)]
enum Older {
    Replaced,
    Kept,
    SetAside,
    SetAsideIfOther,
}

/// Where a file goes: under a name in a folder, perhaps instead of an older one.
struct Place {
    target: PathBuf,
    folder: PathBuf,
    existing: Option<fs::Metadata>,
}

/// Where the file at `path` goes; `None` where something stands that is no regular file.
fn place(path: &Path) -> io::Result<Option<Place>> {
    // Of the target, if there is one: the temporary file has to lie beside what it replaces.
    let target = match path.canonicalize() {
        Ok(target) => target,
        Err(error) if error.kind() == io::ErrorKind::NotFound => path.to_owned(),
        Err(error) => return Err(error),
    };
    let existing = target.metadata().ok();
    match &existing {
        Some(metadata) if metadata.is_dir() => return Err(io::ErrorKind::IsADirectory.into()),
        Some(metadata) if !metadata.is_file() => return Ok(None),
        // Renaming would replace a file that its owner protects.
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

/// How files of one kind begin.
fn kind(mut file: File) -> io::Result<Vec<u8>> {
    file.rewind()?;
    let mut head = Vec::new();
    file.take(8192).read_to_end(&mut head)?;
    let first = head.split(|byte| *byte == b'\n').find(|line| !line.trim_ascii().is_empty()).unwrap_or_default();
    let most = match first.first() {
        Some(b'{' | b'[' | b'<') => 1,
        _ if first.contains(&0) => 4,
        _ => first.len(),
    };
    Ok(first[..most.min(first.len())].to_vec())
}

/// Writes a file, and gives the name that an older one has then.
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
    // A link that leads nowhere is something, too.
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
    let replaces = existing.as_ref().is_some_and(|metadata| metadata.len() > 0 || older == Older::SetAside);
    if let Some(metadata) = existing {
        temporary.as_file().set_permissions(metadata.permissions())?;
    }
    temporary.as_file().sync_all()?;
    let keeps = replaces
        && match older {
            Older::SetAside => true,
            // One that cannot be read may be anything.
            Older::SetAsideIfOther => {
                File::open(&target).and_then(kind).ok() != Some(kind(temporary.as_file().try_clone()?)?)
            }
            Older::Replaced | Older::Kept => false,
        };
    let aside = if keeps { Some(set_aside(&target)?) } else { None };
    let named = match older {
        Older::Replaced | Older::SetAside | Older::SetAsideIfOther => temporary.persist(&target),
        // Somebody else may have made one meanwhile.
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

/// A temporary file that everybody may read whom the process lets, not its owner alone.
fn in_folder(folder: &Path) -> io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".hyst-").suffix(".part");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // The process's umask applies.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder)
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn what_is_set_aside_stays() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        let write = |text: &str| write_beside_older(&path, |out| out.write_all(text.as_bytes())).unwrap();
        assert_eq!(write("first"), None);
        fs::write(folder.path().join("a.csv.~1~"), "somebody's").unwrap();
        let name = write("second").unwrap();
        assert_eq!(name, folder.path().join("a.csv.~2~"));
        write("third").unwrap();
        let read = |name: &str| fs::read_to_string(folder.path().join(name)).unwrap();
        assert_eq!(
            ["a.csv", "a.csv.~1~", "a.csv.~2~", "a.csv.~3~"].map(read),
            ["third", "somebody's", "first", "second"]
        );
        // A failure leaves all names as they were.
        write_beside_older(&path, |_| Err(io::Error::other("no"))).unwrap_err();
        assert_eq!(names(folder.path()).len(), 4);
    }

    #[test]
    fn what_is_of_another_kind_is_set_aside_and_what_is_alike_is_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a");
        let write = |bytes: &[u8]| {
            write_over_alike(&path, |out| out.write_all(bytes)).unwrap().map(|older| fs::read(older).unwrap())
        };
        let older = |bytes: &[u8]| Some(bytes.to_vec());
        assert_eq!(write(b"time_s,voltage_v\n0,1\n"), None);
        assert_eq!(write(b"time_s,voltage_v\n0,2\n"), None);
        let record = b"time_s,voltage_v,displacement_um\n0,2,3\n";
        assert_eq!(write(record), older(b"time_s,voltage_v\n0,2\n"));
        assert_eq!(write(b"{\n  \"a\": 1}"), older(record));
        assert_eq!(write(b"{\"b\": 2}"), None);
        assert_eq!(write(b"<svg>"), older(b"{\"b\": 2}"));
        let block = b"HYST\0\x01\x02";
        assert_eq!(write(block), older(b"<svg>"));
        assert_eq!(write(b"HYST\0\x09\x08"), None);
        assert_eq!(write(b""), older(b"HYST\0\x09\x08"));
        assert_eq!(write(record), None);
        fs::write(&path, "\nnotes\n").unwrap();
        assert_eq!(write(record), older(b"\nnotes\n"));
    }

    #[test]
    fn whether_a_file_could_be_written_is_known_before() {
        let folder = tempfile::tempdir().unwrap();
        check_writable(folder.path().join("new.csv")).unwrap();
        assert!(names(folder.path()).is_empty());
        check_writable(folder.path()).unwrap_err();
        check_writable(folder.path().join("absent").join("new.csv")).unwrap_err();
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

        let aside = write_beside_older(&link, |out| out.write_all(b"newest")).unwrap().unwrap();
        assert!(link.symlink_metadata().unwrap().is_symlink());
        assert_eq!(
            (fs::read_to_string(&path).unwrap(), fs::read_to_string(&aside).unwrap()),
            ("newest".into(), "newer".into())
        );
        assert_eq!(path.metadata().unwrap().permissions().mode() & 0o777, 0o640);

        write_atomic("/dev/null", |out| out.write_all(b"x")).unwrap();
        assert_eq!(write_beside_older("/dev/null", |out| out.write_all(b"x")).unwrap(), None);
        assert!(!Path::new("/dev/null.~1~").exists());
        assert!(!Path::new("/dev/null").metadata().unwrap().is_file());
    }
}
