//! The metadata of an array.

use crate::record::source::gather::{Clock, TextList};

/// The metadata of an array.
pub(super) struct About<'t> {
    pub(super) clock: Clock,
    /// The number of rows of the clock, if the clock is a column.
    pub(super) clock_rows: Option<usize>,
    /// The label, and the struct that states it.
    pub(super) label: Option<(&'t str, &'t str)>,
    pub(super) unit: Option<String>,
    /// Lists of texts that may name the columns.
    pub(super) lists: &'t [TextList],
}

impl About<'_> {
    pub(super) fn new(clock: Clock) -> Self {
        Self { clock, clock_rows: None, label: None, unit: None, lists: &[] }
    }
}
