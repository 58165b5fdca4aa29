//! Error messages of a workbook that cannot be read.

/// Largest number of cells of all sheets, and of numbers of all columns.
pub(super) const MAX_CELLS: usize = 20_000_000;

/// An error message: what is wrong with a file, and what to do.
#[derive(Debug, PartialEq)]
pub(super) struct Fault(pub(super) String);

impl Fault {
    pub(super) fn new(what: impl Into<String>) -> Self {
        Self(what.into())
    }

    /// Makes the message of a damaged file.
    pub(super) fn damaged(what: impl std::fmt::Display) -> Self {
        Self(format!(
            "{what}; the file is damaged: copy it again, or open it in a spreadsheet program and save it again"
        ))
    }

    pub(super) fn too_large() -> Self {
        let million = MAX_CELLS / 1_000_000;
        Self(format!("the workbook has more than {million} million cells; save only the sheet with the record, as CSV"))
    }
}
