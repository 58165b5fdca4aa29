//! Repair of measured rows: missing values, repeated rows, interruptions and uneven times.
//!
//! Missing values are omitted and counted, repeated rows are joined, an interruption begins a segment, and jittering
//! times are resampled to an even grid by a monotone cubic. Each repair adds a note.

mod clock;
mod cubic;
mod even;
mod lost;
mod missing;
mod repeated;
mod rows;
mod steps;
#[cfg(test)]
mod tests;

use super::assembly::{Columns, Origin};
use super::error::RecordError;
use super::grid::Printed;
use clock::unwrap_clock;
use even::make_even;
use lost::insert_lost;
use missing::{interpolate_missing, omit_missing};
use repeated::join_repeated;
use rows::Repaired;
use steps::Times;

pub(super) use rows::place_of;

/// Repairs columns of equal length. `is_reference` says that the output is a reference, which must be complete.
pub(super) fn repair(
    samples: &mut Columns,
    printed: &mut Printed,
    is_reference: bool,
    origin: &Origin<'_>,
) -> Result<Repaired, RecordError> {
    let mut done = Repaired::default();
    omit_missing(samples, &mut done, is_reference, origin)?;
    unwrap_clock(samples, &mut done);
    join_repeated(samples, &mut done);
    let mut times = Times::of(samples, *printed);
    if let Times::Uneven(segments) = &times
        && insert_lost(samples, &mut done, segments)
    {
        times = Times::of(samples, *printed);
    }
    interpolate_missing(samples);
    match times {
        Times::Even(periods) => done.periods = Some(periods),
        Times::Uneven(segments) => make_even(samples, printed, &mut done, segments),
        Times::Unsorted => {}
    }
    Ok(done)
}
