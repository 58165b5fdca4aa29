//! Reading records from files.

use std::borrow::Cow;
use std::path::Path;
use std::sync::Arc;

use super::checked::{Record, Text};
use super::checksum::sum_of;
use super::columns::{Need, Reading};
use super::contents::{of_contents, with_layout};
use super::error::RecordError;
use super::log::is_run_log;
use super::source;

impl Record {
    /// Reads and checks the file at `path`. The format is detected from its content.
    ///
    /// # Errors
    /// If the file cannot be read, or the column of a role is missing or ambiguous. The message states the file, line
    /// and column and what to do.
    pub fn read(path: impl AsRef<Path>, how: impl Into<Reading>, need: Need) -> Result<Self, RecordError> {
        Self::read_watched(path, how, need, &mut |_| {})
    }

    /// Reads as [`read`](Self::read) does and reports progress.
    ///
    /// `watch` is called with the share of a large file that has been read. A text of more than 256 MB is read in
    /// blocks. If it has more than two million rows, groups of rows are averaged into one, so memory does not grow with
    /// the size of the file.
    ///
    /// # Errors
    /// Those of [`read`](Self::read).
    pub fn read_watched(
        path: impl AsRef<Path>,
        how: impl Into<Reading>,
        need: Need,
        watch: &mut dyn FnMut(f64),
    ) -> Result<Self, RecordError> {
        let path = path.as_ref();
        if let Some(contents) = source::LargeText::open(path, watch)? {
            let record = of_contents(&path.display().to_string(), &contents, &how.into(), need)?;
            return record.kept_in(path);
        }
        let file = path.display().to_string();
        let bytes = std::fs::read(path).map_err(|source| RecordError::Io { file: file.clone(), source })?;
        Self::parse_bytes(&file, Cow::Owned(bytes), &how.into(), need)
    }

    /// Reads the bytes of a file as [`read`](Self::read) does. `name` is the file name in messages.
    ///
    /// # Errors
    /// Those of [`read`](Self::read).
    pub fn parse(name: &str, bytes: &[u8], how: impl Into<Reading>, need: Need) -> Result<Self, RecordError> {
        Self::parse_bytes(name, Cow::Borrowed(bytes), &how.into(), need)
    }

    /// The bytes of a text are kept without a copy if they are owned.
    fn parse_bytes(name: &str, bytes: Cow<'_, [u8]>, how: &Reading, need: Need) -> Result<Self, RecordError> {
        if is_run_log(&bytes) {
            return Self::parse_log(name, &bytes, &how.map, need);
        }
        // The checksum takes as long as parsing, so both run in parallel.
        let (found, sum) = rayon::join(
            || {
                let unpacked = source::unpack(name, &bytes)?;
                let contents = source::open(name, &unpacked)?;
                let found = with_layout(name, contents.as_ref(), how, need)?;
                // A UTF-8 text is kept as part of the bytes of the file; of other encodings the decoded text is kept.
                let text = contents.plain_text().filter(|_| found.is_plain).map(|text| {
                    let start = unpacked.len().saturating_sub(text.len());
                    if unpacked.ends_with(text.as_bytes()) { Ok(start) } else { Err(text.as_bytes().to_vec()) }
                });
                drop(contents);
                let unpacked = if let Cow::Owned(unpacked) = unpacked { Some(unpacked) } else { None };
                Ok((found.record, text, unpacked))
            },
            || sum_of(&bytes),
        );
        let (mut record, text, unpacked): (Self, _, _) = found?;
        record.text = text.map(|text| match text {
            Ok(start) => Text { bytes: Arc::new(unpacked.unwrap_or_else(|| bytes.into_owned())), start },
            Err(decoded) => Text { bytes: Arc::new(decoded), start: 0 },
        });
        Ok(record.kept_with(sum))
    }
}
