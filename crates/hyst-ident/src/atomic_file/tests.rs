//! Files are written completely or not at all, and older files are kept where that is promised.

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
fn a_failure_keeps_the_older_file_and_leaves_no_fragment() {
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
fn create_atomic_does_not_replace_a_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.json");
    create_atomic(&path, |out| out.write_all(b"first")).unwrap();
    let refused = |path: &Path| create_atomic(path, |out| out.write_all(b"second")).unwrap_err().source.kind();
    assert_eq!(refused(&path), io::ErrorKind::AlreadyExists);
    assert_eq!(refused(folder.path()), io::ErrorKind::AlreadyExists);
    // A file that appears while the content is written is kept too.
    let late = folder.path().join("late.json");
    let error = create_atomic(&late, |_| fs::write(&late, "theirs")).unwrap_err();
    assert_eq!(error.source.kind(), io::ErrorKind::AlreadyExists);
    assert_eq!(fs::read_to_string(&path).unwrap(), "first");
    assert_eq!(fs::read_to_string(&late).unwrap(), "theirs");
    assert_eq!(names(folder.path()), ["late.json", "model.json"]);
}

#[test]
fn older_files_are_kept_under_numbered_names() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    let write = |text: &str| write_beside_older(&path, |out| out.write_all(text.as_bytes())).unwrap();
    assert_eq!(write("first"), None);
    fs::write(folder.path().join("a.csv.~1~"), "somebody's").unwrap();
    let name = write("second").unwrap();
    assert_eq!(name, folder.path().join("a.csv.~2~"));
    write("third").unwrap();
    let read = |name: &str| fs::read_to_string(folder.path().join(name)).unwrap();
    assert_eq!(["a.csv", "a.csv.~1~", "a.csv.~2~", "a.csv.~3~"].map(read), ["third", "somebody's", "first", "second"]);
    // A failure changes no names.
    write_beside_older(&path, |_| Err(io::Error::other("no"))).unwrap_err();
    assert_eq!(names(folder.path()).len(), 4);
}

#[test]
fn a_file_with_the_same_content_or_without_content_is_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a");
    let write = |bytes: &[u8]| {
        write_beside_older(&path, |out| out.write_all(bytes)).unwrap().map(|older| fs::read(older).unwrap())
    };
    let long = vec![7; 100_000];
    let other = [&long[..99_999], &[8]].concat();
    assert_eq!(write(&long), None);
    assert_eq!(write(&long), None);
    assert_eq!(write(&other), Some(long.clone()));
    assert_eq!(write(b""), Some(other));
    assert_eq!(write(&long), None);
    assert_eq!(names(folder.path()).len(), 3);
}

#[cfg(target_os = "linux")]
#[test]
fn the_error_names_the_file_and_the_folder_but_no_temporary_file() {
    // Nobody can create a file in this folder.
    let message = check_writable("/proc/sys/model.json").unwrap_err().to_string();
    assert!(message.starts_with("/proc/sys/model.json: cannot be written: no file can be created"), "{message}");
    assert!(message.contains("folder /proc/sys:") && !message.contains(".hyst-"), "{message}");
}

#[test]
fn check_writable_creates_no_file() {
    let folder = tempfile::tempdir().unwrap();
    check_writable(folder.path().join("new.csv")).unwrap();
    assert!(names(folder.path()).is_empty());
    check_writable(folder.path()).unwrap_err();
    check_writable(folder.path().join("absent").join("new.csv")).unwrap_err();
}

#[test]
fn a_folder_is_refused_as_target_and_must_exist() {
    let folder = tempfile::tempdir().unwrap();
    let write = |path: &Path| write_atomic(path, |_| Ok(())).unwrap_err().to_string();
    assert!(write(folder.path()).contains("directory"));
    let message = write(&folder.path().join("absent/out.csv"));
    assert!(message.contains("out.csv: cannot be written") && message.contains("does not exist"), "{message}");
    assert!(names(folder.path()).is_empty());
}

#[test]
fn a_read_only_file_is_not_replaced() {
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
