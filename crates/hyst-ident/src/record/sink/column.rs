//! A column of a record, for writing.

use std::borrow::Cow;

/// A column of a record.
pub(super) struct Column<'a> {
    pub(super) name: &'a str,
    /// The symbol of the unit; empty for the segment.
    pub(super) unit: &'static str,
    pub(super) values: Cow<'a, [f64]>,
}
