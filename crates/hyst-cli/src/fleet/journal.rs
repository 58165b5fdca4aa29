//! What is done: a line of JSON for each actuator, written as soon as it is known.
//!
//! A line is written by one call, and a line that was cut off by a kill is no line: it is done again. Of several rows of one file the last counts.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::{Entry, Row};

/// Rows that are done, in a file.
pub struct Journal {
    file: File,
    path: PathBuf,
    /// For each file the byte at which its last row begins, with what the row depends on.
    done: BTreeMap<String, Done>,
}

/// A row that is in the journal.
struct Done {
    at: u64,
    /// Its files and its options.
    depends_on: (Option<String>, String),
    failed: bool,
}

impl Journal {
    /// Opens the journal at `path`, or begins it.
    ///
    /// # Errors
    /// When it cannot be read or written, or is no journal.
    pub fn open(path: &Path) -> io::Result<Self> {
        let mut file = OpenOptions::new().read(true).append(true).create(true).open(path)?;
        let mut done = BTreeMap::new();
        let (mut at, mut number) = (0, 0);
        let mut reader = BufReader::new(&file);
        let mut line = Vec::new();
        loop {
            line.clear();
            let n = reader.read_until(b'\n', &mut line)? as u64;
            if n == 0 {
                break;
            }
            number += 1;
            let whole = line.ends_with(b"\n");
            match serde_json::from_slice::<Row>(&line) {
                Ok(row) if whole => {
                    let failed = row.outcome.is_err();
                    done.insert(row.entry.file, Done { at, depends_on: (row.sha256, row.options), failed });
                }
                // A kill can only have cut the last line.
                _ if !whole => break,
                Ok(_) => break,
                Err(error) => {
                    let message =
                        format!("line {number} is no row of a fleet ({error}); give another name, or remove the file");
                    return Err(io::Error::new(io::ErrorKind::InvalidData, message));
                }
            }
            at += n;
        }
        drop(reader);
        file.set_len(at)?;
        file.seek(SeekFrom::End(0))?;
        Ok(Self { file, path: path.to_owned(), done })
    }

    /// Whether an actuator's row is there, of these files and options.
    pub fn has(&self, entry: &Entry, sha256: Option<&str>, options: &str) -> bool {
        // A file that could not be read may be readable now.
        sha256.is_some()
            && self
                .done
                .get(&entry.file)
                .is_some_and(|done| done.depends_on.0.as_deref() == sha256 && done.depends_on.1 == options)
    }

    /// Adds a row.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn add(&mut self, row: &Row) -> io::Result<()> {
        let at = self.file.seek(SeekFrom::End(0))?;
        let mut line = serde_json::to_vec(row)?;
        line.push(b'\n');
        self.file.write_all(&line)?;
        let (failed, depends_on) = (row.outcome.is_err(), (row.sha256.clone(), row.options.clone()));
        self.done.insert(row.entry.file.clone(), Done { at, depends_on, failed });
        Ok(())
    }

    /// How many of these actuators are done, and how many of them failed.
    pub fn count(&self, entries: &[Entry]) -> (usize, usize) {
        let done = || entries.iter().filter_map(|entry| self.done.get(&entry.file));
        (done().count(), done().filter(|done| done.failed).count())
    }

    /// The rows of these actuators, in their order, one at a time.
    ///
    /// # Errors
    /// When the journal cannot be read again.
    pub fn rows<'a>(&'a self, entries: &'a [Entry]) -> io::Result<impl Iterator<Item = io::Result<Row>> + 'a> {
        let mut file = BufReader::new(File::open(&self.path)?);
        let places = entries.iter().filter_map(|entry| self.done.get(&entry.file).map(|done| done.at));
        Ok(places.map(move |at| {
            file.seek(SeekFrom::Start(at))?;
            let mut line = Vec::new();
            file.by_ref().read_until(b'\n', &mut line)?;
            Ok(serde_json::from_slice(&line)?)
        }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn row(file: &str, sha: &str) -> Row {
        let entry = Entry { file: file.into(), test: None, serial: None, date: None };
        Row { entry, sha256: Some(sha.into()), options: "o".into(), took_s: 1.0, outcome: Err("no".into()) }
    }

    #[test]
    fn what_is_cut_off_is_done_again_and_the_last_row_of_a_file_counts() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("fleet.journal");
        let mut journal = Journal::open(&path).unwrap();
        for (file, sha) in [("a", "1"), ("b", "1"), ("a", "2")] {
            journal.add(&row(file, sha)).unwrap();
        }
        let (a, b) = (row("a", "2"), row("b", "1"));
        assert!(journal.has(&a.entry, Some("2"), "o") && !journal.has(&a.entry, Some("1"), "o"));
        assert!(!journal.has(&b.entry, Some("1"), "other") && !journal.has(&b.entry, None, "o"));
        let entries = [b.entry.clone(), a.entry.clone()];
        let rows: Vec<Row> = journal.rows(&entries).unwrap().map(Result::unwrap).collect();
        assert_eq!(rows, [b.clone(), a.clone()]);
        let whole = std::fs::read(&path).unwrap();
        // However much of the last row was written.
        let last = serde_json::to_vec(&a).unwrap().len();
        for cut in [1, last / 2, last] {
            std::fs::write(&path, &whole[..whole.len() - cut]).unwrap();
            let mut journal = Journal::open(&path).unwrap();
            assert!(journal.has(&a.entry, Some("1"), "o") && journal.has(&b.entry, Some("1"), "o"), "{cut}");
            journal.add(&a).unwrap();
            assert_eq!(std::fs::read(&path).unwrap(), whole);
        }
        std::fs::write(&path, "time_s,voltage_v\n0,1\n").unwrap();
        assert!(Journal::open(&path).is_err());
        assert_eq!(std::fs::read(&path).unwrap(), b"time_s,voltage_v\n0,1\n");
    }
}
