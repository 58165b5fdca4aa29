//! The source files of a workspace.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

/// Endings of source files.
const ENDINGS: [&str; 5] = ["go", "js", "py", "pyi", "rs"];
/// Folders of build results.
const RESULTS: [&str; 2] = ["__pycache__", "target"];
/// Files at the root of a crate.
const ROOTS: [&str; 2] = ["lib.rs", "main.rs"];

/// A Rust file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Source {
    /// Path in the folder of the crate's root file, with `/` between its parts.
    pub file: String,
    /// Its text.
    pub text: String,
}

/// A library or program of several files.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Crate {
    /// Folder of its root file in the workspace, with `/` between its parts.
    pub folder: String,
    /// Its files.
    pub sources: Vec<Source>,
}

/// Returns the libraries and programs of the workspace in `root`.
///
/// # Errors
/// When a file cannot be read.
pub fn crates(root: &Path) -> io::Result<Vec<Crate>> {
    let files = files(root)?;
    let folders: Vec<&Path> = files
        .iter()
        .filter(|file| ROOTS.iter().any(|name| file.ends_with(name)))
        .filter_map(|file| file.parent())
        .collect();
    let mut crates: BTreeMap<&Path, Vec<Source>> = BTreeMap::new();
    for file in files.iter().filter(|file| file.extension().is_some_and(|ending| ending == "rs")) {
        // A file that belongs to no root file is a program of its own.
        let Some(folder) = file.ancestors().find(|folder| folders.contains(folder)) else { continue };
        let source = Source { file: shown(file.strip_prefix(folder).unwrap_or(file)), text: fs::read_to_string(file)? };
        crates.entry(folder).or_default().push(source);
    }
    let of =
        |(folder, sources): (&Path, _)| Crate { folder: shown(folder.strip_prefix(root).unwrap_or(folder)), sources };
    Ok(crates.into_iter().map(of).collect())
}

/// Returns the source files in `root` with more than `most` lines, each with its number of lines.
///
/// # Errors
/// When a file cannot be read.
pub fn long_files(root: &Path, most: usize) -> io::Result<Vec<(String, usize)>> {
    let mut long = Vec::new();
    for file in files(root)? {
        let lines = fs::read_to_string(&file)?.lines().count();
        if lines > most {
            long.push((shown(file.strip_prefix(root).unwrap_or(&file)), lines));
        }
    }
    Ok(long)
}

/// Returns all source files below a folder in order, without hidden folders and build results.
fn files(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut entries = fs::read_dir(folder)?.collect::<io::Result<Vec<_>>>()?;
    entries.sort_by_key(fs::DirEntry::file_name);
    let mut found = Vec::new();
    for entry in entries {
        let (path, name) = (entry.path(), entry.file_name());
        let (name, kind) = (name.to_string_lossy(), entry.file_type()?);
        if kind.is_dir() && !name.starts_with('.') && !RESULTS.contains(&&*name) {
            found.extend(files(&path)?);
        } else if kind.is_file() && path.extension().is_some_and(|ending| ENDINGS.iter().any(|known| ending == *known))
        {
            found.push(path);
        }
    }
    Ok(found)
}

/// Returns a path with `/` between its parts.
fn shown(path: &Path) -> String {
    path.iter().map(|part| part.to_string_lossy()).collect::<Vec<_>>().join("/")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Writes files with these texts into a new folder.
    fn folder(files: &[(&str, &str)]) -> tempfile::TempDir {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in files {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }
        folder
    }

    #[test]
    fn files_belong_to_the_nearest_root_file() {
        let folder = folder(&[
            ("one/build.rs", ""),
            ("one/src/lib.rs", "mod a;"),
            ("one/src/a/b.rs", "x"),
            ("one/src/tests/main.rs", ""),
            ("one/target/lib.rs", ""),
            (".hidden/lib.rs", ""),
        ]);
        let source = |file: &str, text: &str| Source { file: file.to_owned(), text: text.to_owned() };
        let library =
            Crate { folder: "one/src".to_owned(), sources: vec![source("a/b.rs", "x"), source("lib.rs", "mod a;")] };
        let program = Crate { folder: "one/src/tests".to_owned(), sources: vec![source("main.rs", "")] };
        assert_eq!(crates(folder.path()).unwrap(), [library, program]);
    }

    #[test]
    fn long_files_of_all_languages_are_found() {
        let folder =
            folder(&[("a.rs", "1\n2\n3\n"), ("b/c.py", "1\n2\n3"), ("d.py", "1\n2\n"), ("e.csv", "1\n2\n3\n")]);
        let long = |name: &str| (name.to_owned(), 3);
        assert_eq!(long_files(folder.path(), 2).unwrap(), [long("a.rs"), long("b/c.py")]);
    }
}
