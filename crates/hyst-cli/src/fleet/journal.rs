//! Journal of a fleet: one line of JSON for each finished actuator.
//!
//! A line is on the disk as soon as its actuator is finished. Each line is written by one call. A last line that was
//! cut off is ignored, and its actuator is processed again. If an actuator has several rows, the last one counts.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde_json::Value;
use sha2::{Digest, Sha256};

use super::row::VERSION;
use super::{Entry, Row};

/// Rows of finished actuators in a file.
pub struct Journal {
    file: File,
    path: PathBuf,
    /// Offset of the end of the last complete line.
    end: u64,
    done: BTreeMap<Key, Done>,
}

/// Key of an actuator: its record and its test record.
type Key = (String, Option<String>);

fn key(entry: &Entry) -> Key {
    (entry.file.clone(), entry.test.clone())
}

/// A row of the journal.
struct Done {
    /// Offset of its line.
    at: u64,
    /// Hash of its files and options; `None` if a file could not be read.
    depends_on: Option<[u8; 32]>,
    failed: bool,
    has_report: bool,
    /// Whether this version of the program has computed it.
    is_current: bool,
}

fn depends_on(sha256: Option<&str>, options: &str) -> Option<[u8; 32]> {
    sha256.map(|sha256| Sha256::digest(format!("{sha256} {options}")).into())
}

impl Done {
    fn of(row: &Row, at: u64) -> Self {
        let has_report =
            row.outcome.as_ref().is_ok_and(|found| found.report.as_ref().is_some_and(|r| Path::new(r).exists()));
        let depends_on = depends_on(row.sha256.as_deref(), &row.options);
        let is_current = row.options.strip_prefix(VERSION).is_some_and(|options| options.starts_with(" {"));
        Self { at, depends_on, failed: row.outcome.is_err(), has_report, is_current }
    }
}

impl Journal {
    /// Opens or creates the journal at `path` for adding rows, and locks it.
    ///
    /// # Errors
    /// When it cannot be read or written, is not a journal, or another process has locked it.
    pub fn open(path: &Path) -> io::Result<Self> {
        let file = OpenOptions::new().read(true).append(true).create(true).open(path)?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(io::Error::other("another fleet writes this journal; wait for it or give another output"));
            }
            Err(TryLockError::Error(error)) => return Err(error),
        }
        let journal = Self::of(file, path)?;
        if journal.end < journal.file.metadata()?.len() {
            journal.file.set_len(journal.end)?;
        }
        Ok(journal)
    }

    /// Opens the journal at `path` for reading.
    ///
    /// # Errors
    /// When it cannot be read or is not a journal.
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
            // Only the last line can be cut off.
            if n == 0 || !line.ends_with(b"\n") {
                break;
            }
            number += 1;
            match serde_json::from_slice::<Row>(&line) {
                Ok(row) => {
                    let own = Done::of(&row, at);
                    done.insert(key(&row.entry), own);
                }
                // A row of another version or a damaged row: its actuator is processed again.
                Err(_) if serde_json::from_slice::<Value>(&line).is_ok_and(|value| value.get("file").is_some()) => {}
                Err(error) => {
                    let message =
                        format!("line {number} is not a row of a fleet journal ({error}); give another output");
                    return Err(io::Error::new(io::ErrorKind::InvalidData, message));
                }
            }
            at += n;
        }
        drop(reader);
        Ok(Self { file, path: path.to_owned(), end: at, done })
    }

    /// Whether the journal has the row of an actuator with these files and options.
    ///
    /// With `reports`, the report must exist, too.
    pub fn has(&self, entry: &Entry, sha256: Option<&str>, options: &str, reports: bool) -> bool {
        // A file that could not be read is tried again.
        let Some(wanted) = depends_on(sha256, options) else { return false };
        self.done
            .get(&key(entry))
            .is_some_and(|done| done.depends_on == Some(wanted) && (!reports || done.failed || done.has_report))
    }

    /// Whether another version of the program has computed the row of an actuator.
    pub fn is_of_other_version(&self, entry: &Entry) -> bool {
        self.done.get(&key(entry)).is_some_and(|done| !done.is_current)
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

    /// Unlocks the journal; this process adds no more rows.
    ///
    /// # Errors
    /// When the system cannot unlock the file.
    pub fn unlock(&self) -> io::Result<()> {
        self.file.unlock()
    }

    /// Returns how many of these actuators are finished, and how many of those failed.
    pub fn count(&self, entries: &[Entry]) -> (usize, usize) {
        let done = || entries.iter().filter_map(|entry| self.done.get(&key(entry)));
        (done().count(), done().filter(|done| done.failed).count())
    }

    /// Returns the finished rows of these actuators one by one, each with its index in `entries`.
    ///
    /// The order, the serial numbers and the dates are those of `entries`.
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
    fn a_row_that_is_cut_off_is_repeated_and_the_last_row_of_an_actuator_counts() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("fleet.journal");
        let mut journal = Journal::open(&path).unwrap();
        for (file, sha) in [("a", "1"), ("b", "1"), ("a", "2")] {
            journal.add(&row(file, sha)).unwrap();
        }
        let (a, b) = (row("a", "2"), row("b", "1"));
        assert!(journal.has(&a.entry, Some("2"), "o", false) && !journal.has(&a.entry, Some("1"), "o", false));
        assert!(!journal.has(&b.entry, Some("1"), "other", false) && !journal.has(&b.entry, None, "o", false));
        // One actuator is not finished; the serial number is that of the list.
        let numbered = Entry { serial: Some("P-7".into()), ..a.entry.clone() };
        let entries = [b.entry.clone(), row("c", "1").entry, numbered.clone()];
        let rows: Vec<(usize, Row)> = journal.rows(&entries).unwrap().map(Result::unwrap).collect();
        assert_eq!(rows, [(0, b.clone()), (2, Row { entry: numbered, ..a.clone() })]);
        // A locked journal cannot be opened for adding, but can be read.
        assert!(Journal::open(&path).is_err());
        assert_eq!(Journal::read(&path).unwrap().count(&entries), (2, 2));
        drop(journal);
        let whole = std::fs::read(&path).unwrap();
        // The last row is cut off at several places.
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
        // A row of another version is processed again; the other rows are kept.
        let strange = [b"{\"file\": \"b\", \"outcome\": 3}\n".as_slice(), &whole].concat();
        std::fs::write(&path, &strange).unwrap();
        assert!(Journal::open(&path).unwrap().has(&a.entry, Some("2"), "o", false));
        std::fs::write(&path, "time_s,voltage_v\n0,1\n").unwrap();
        assert!(Journal::open(&path).is_err());
        assert_eq!(std::fs::read(&path).unwrap(), b"time_s,voltage_v\n0,1\n");
    }
}
