//! The checksum of the file that holds a record.

use std::path::Path;

use sha2::{Digest, Sha256};

use super::checked::Record;
use super::error::RecordError;

impl Record {
    /// Sets the SHA-256 of the file that holds the record.
    ///
    /// Models that are fitted to the record store this checksum.
    pub fn kept_as(self, file: &[u8]) -> Self {
        self.kept_with(sum_of(file))
    }

    pub(super) fn kept_with(mut self, sum: String) -> Self {
        if let [source] = self.sources.as_mut_slice() {
            source.sha256 = Some(sum);
        }
        self
    }

    /// Sets the SHA-256 of the file at `path`, which is read in blocks.
    pub(super) fn kept_in(self, path: &Path) -> Result<Self, RecordError> {
        let io = |source| RecordError::Io { file: path.display().to_string(), source };
        let mut sum = Sha256::new();
        std::io::copy(&mut std::fs::File::open(path).map_err(io)?, &mut sum).map_err(io)?;
        Ok(self.kept_with(format!("{:x}", sum.finalize())))
    }
}

/// Returns the SHA-256 of the bytes of a file, in hexadecimal digits.
pub(super) fn sum_of(file: &[u8]) -> String {
    format!("{:x}", Sha256::digest(file))
}
