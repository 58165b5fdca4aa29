//! What is done: a line of JSON for each actuator, written and on the disk as soon as it is known.
//!
//! A line is written by one call, and a line that was cut off by a kill is no line: it is done again. Of several rows of one actuator the last counts.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde_json::Value;
use sha2::{Digest, Sha256};

use super::{Entry, Row};

/// Rows that are done, in a file.
pub struct Journal {
    file: File,
    path: PathBuf,
    /// The end of its whole lines.
    end: u64,
    done: BTreeMap<Key, Done>,
}

/// An actuator: its record and its test record.
type Key = (String, Option<String>);

fn key(entry: &Entry) -> Key {
    (entry.file.clone(), entry.test.clone())
}

/// A row that is in the journal.
struct Done {
    /// Where its line begins.
    at: u64,
    /// What it depends on, as a hash; none where a file could not be read.
    depends_on: Option<[u8; 32]>,
    failed: bool,
    has_report: bool,
}

fn depends_on(sha256: Option<&str>, options: &str) -> Option<[u8; 32]> {
    sha256.map(|sha256| Sha256::digest(format!("{sha256} {options}")).into())
}

impl Done {
    fn of(row: &Row, at: u64) -> Self {
        let has_report =
            row.outcome.as_ref().is_ok_and(|found| found.report.as_ref().is_some_and(|r| Path::new(r).exists()));
        let depends_on = depends_on(row.sha256.as_deref(), &row.options);
        Self { at, depends_on, failed: row.outcome.is_err(), has_report }
    }
}

impl Journal {
    /// Opens the journal at `path`, or begins it, to add to it. Nobody else may meanwhile.
    ///
    /// # Errors
    /// When it cannot be read or written, is no journal, or somebody else adds to it.
    pub fn open(path: &Path) -> io::Result<Self> {
        let file = OpenOptions::new().read(true).append(true).create(true).open(path)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(io::Error::other("another fleet is being written here; wait for it, or give another name"));
            }
            Err(TryLockError::Error(error)) => return Err(error),
        }
        let journal = Self::of(file, path)?;
        if journal.end < journal.file.metadata()?.len() {
            journal.file.set_len(journal.end)?;
        }
        Ok(journal)
    }

    /// Opens the journal at `path` to look at it.
    ///
    /// # Errors
    /// When it cannot be read or is no journal.
    pub fn read(path: &Path) -> io::Result<Self> {
        Self::of(File::open(path)?, path)
    }

    fn of(file: File, path: &Path) -> io::Result<Self> {
        let mut done = BTreeMap::new();
        let (mut at, mut number) = (0, 0);
        let mut reader = BufReader::new(&file);
        let mut line = Vec::new();
        loop {
            line.clear();
            let n = reader.read_until(b'\n', &mut line)? as u64;
            // A kill can only have cut the last line.
            if n == 0 || !line.ends_with(b"\n") {
                break;
            }
            number += 1;
            match serde_json::from_slice::<Row>(&line) {
                Ok(row) => {
                    let own = Done::of(&row, at);
                    done.insert(key(&row.entry), own);
                }
                // A row of another version, or one that is damaged: its actuator is done again.
                Err(_) if serde_json::from_slice::<Value>(&line).is_ok_and(|value| value.get("file").is_some()) => {}
                Err(error) => {
                    let message =
                        format!("line {number} is not a row of a fleet's journal ({error}); give another name");
                    return Err(io::Error::new(io::ErrorKind::InvalidData, message));
                }
            }
            at += n;
        }
        drop(reader);
        Ok(Self { file, path: path.to_owned(), end: at, done })
    }

    /// Whether an actuator's row is there, of these files and options, with a report where reports are wanted.
    pub fn has(&self, entry: &Entry, sha256: Option<&str>, options: &str, reports: bool) -> bool {
        // A file that could not be read may be readable now.
        let Some(wanted) = depends_on(sha256, options) else { return false };
        self.done
            .get(&key(entry))
            .is_some_and(|done| done.depends_on == Some(wanted) && (!reports || done.failed || done.has_report))
    }

    /// Adds a row; it is on the disk when this returns.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn add(&mut self, row: &Row) -> io::Result<()> {
        let mut line = serde_json::to_vec(row)?;
        line.push(b'\n');
        self.file.write_all(&line)?;
        self.file.sync_data()?;
        self.done.insert(key(&row.entry), Done::of(row, self.end));
        self.end += line.len() as u64;
        Ok(())
    }

    /// Lets others add to it; this one adds nothing more.
    ///
    /// # Errors
    /// Those of the system.
    pub fn unlock(&self) -> io::Result<()> {
        self.file.unlock()
    }

    /// How many of these actuators are done, and how many of them failed.
    pub fn count(&self, entries: &[Entry]) -> (usize, usize) {
        let done = || entries.iter().filter_map(|entry| self.done.get(&key(entry)));
        (done().count(), done().filter(|done| done.failed).count())
    }

    /// The rows of these actuators that are done, each with its place in `entries`, in their order, one at a time. Serial numbers and dates are those of
    /// `entries`.
    ///
    /// # Errors
    /// When the journal cannot be read again.
    pub fn rows<'a>(&'a self, entries: &'a [Entry]) -> io::Result<impl Iterator<Item = io::Result<(usize, Row)>> + 'a> {
        let mut file = BufReader::new(File::open(&self.path)?);
        let done = entries.iter().enumerate().filter_map(|(k, entry)| Some((k, entry, self.done.get(&key(entry))?)));
        Ok(done.map(move |(k, entry, done)| {
            file.seek(SeekFrom::Start(done.at))?;
            let mut line = Vec::new();
            file.by_ref().read_until(b'\n', &mut line)?;
            let row: Row = serde_json::from_slice(&line)?;
            Ok((k, Row { entry: entry.clone(), ..row }))
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
        assert!(journal.has(&a.entry, Some("2"), "o", false) && !journal.has(&a.entry, Some("1"), "o", false));
        assert!(!journal.has(&b.entry, Some("1"), "other", false) && !journal.has(&b.entry, None, "o", false));
        // One is not done; a serial number is that of the list.
        let numbered = Entry { serial: Some("P-7".into()), ..a.entry.clone() };
        let entries = [b.entry.clone(), row("c", "1").entry, numbered.clone()];
        let rows: Vec<(usize, Row)> = journal.rows(&entries).unwrap().map(Result::unwrap).collect();
        assert_eq!(rows, [(0, b.clone()), (2, Row { entry: numbered, ..a.clone() })]);
        // Nobody else adds to it, but anybody may look.
        assert!(Journal::open(&path).is_err());
        assert_eq!(Journal::read(&path).unwrap().count(&entries), (2, 2));
        drop(journal);
        let whole = std::fs::read(&path).unwrap();
        // However much of the last row was written.
        let last = serde_json::to_vec(&a).unwrap().len();
        for cut in [1, last / 2, last] {
            std::fs::write(&path, &whole[..whole.len() - cut]).unwrap();
            let mut journal = Journal::open(&path).unwrap();
            assert!(
                journal.has(&a.entry, Some("1"), "o", false) && journal.has(&b.entry, Some("1"), "o", false),
                "{cut}"
            );
            journal.add(&a).unwrap();
            assert_eq!(std::fs::read(&path).unwrap(), whole);
        }
        // A row that is none of this version is done again; the others stay.
        let strange = [b"{\"file\": \"b\", \"outcome\": 3}\n".as_slice(), &whole].concat();
        std::fs::write(&path, &strange).unwrap();
        assert!(Journal::open(&path).unwrap().has(&a.entry, Some("2"), "o", false));
        std::fs::write(&path, "time_s,voltage_v\n0,1\n").unwrap();
        assert!(Journal::open(&path).is_err());
        assert_eq!(std::fs::read(&path).unwrap(), b"time_s,voltage_v\n0,1\n");
    }
}
