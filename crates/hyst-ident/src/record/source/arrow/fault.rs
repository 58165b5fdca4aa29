//! Error messages of a file that cannot be read.

/// The placeholder of the file name in lines to paste.
pub(super) const FILE: &str = "{FILE}";

/// An error message: what is wrong with a file, and what to do.
#[derive(Debug, PartialEq)]
pub(super) struct Fault(pub(super) String);

impl Fault {
    pub(super) fn new(what: impl Into<String>) -> Self {
        Self(what.into())
    }

    /// Makes the message of a damaged file.
    pub(super) fn damaged(what: impl std::fmt::Display) -> Self {
        Self(format!("{what}; the file is damaged: copy it again, or write it again with the program that made it"))
    }
}
