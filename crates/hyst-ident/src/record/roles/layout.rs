//! The columns of a file and their roles.

use crate::record::error::Place;
use crate::record::heading::Unit;
use crate::record::source::Head;

/// A column with a role.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Choice {
    /// The number of the column, counted from 0.
    pub(crate) column: usize,
    /// The name in the record format.
    pub(crate) canonical: String,
    /// The unit in the file, if it differs from the unit of `canonical`.
    pub(crate) unit: Option<Unit>,
    /// The factor that is applied to the values after a conversion.
    pub(crate) factor: Option<f64>,
}

/// The source of the times.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Clock {
    /// A column, and the number of its unit per second.
    Column { column: usize, per_second: f64 },
    /// Even times \[s\].
    Even { start: f64, step: f64 },
}

/// The columns of a file by role.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Layout {
    pub(crate) segment: Option<usize>,
    pub(crate) time: Clock,
    pub(crate) input: Option<Choice>,
    pub(crate) output: Option<Choice>,
    pub(crate) temperature: Option<Choice>,
    pub(crate) load: Option<Choice>,
    /// One sentence per column that does not have a name and unit of the record format.
    pub(crate) notes: Vec<String>,
}

/// The columns of a file, with the names that messages use.
pub(crate) struct File<'a> {
    pub(crate) name: &'a str,
    pub(crate) header: Option<Place>,
    pub(crate) heads: &'a [Head],
    /// Columns of text, each with an example of a cell.
    pub(crate) texts: &'a [(String, String)],
    /// Columns that count the rows, if they were searched. They are neither inputs nor outputs.
    pub(crate) counters: &'a [usize],
}
