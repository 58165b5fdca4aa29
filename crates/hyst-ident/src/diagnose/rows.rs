//! Counts the rows that a diagnosis used and those that it left out, by reason.

use super::findings::{LeftOut, MOST_LISTED, Rows};
use crate::clipping::clipped_rows;
use crate::frozen::frozen_rows;
use crate::record::Record;
use crate::samples::Samples;

/// Returns the row counts of a record; `samples` marks the rows that count.
pub(super) fn rows(record: &Record, samples: &Samples) -> Rows {
    let clipped = clipped_rows(&samples.output, &samples.segments);
    let all = || 0..samples.len();
    let saturated = all().filter(|k| clipped[*k]).count();
    let frozen = frozen_rows(&samples.input, &samples.output, &samples.segments);
    let spiked: Vec<usize> = all().filter(|k| samples.blind[*k] && !clipped[*k] && !frozen[*k]).collect();
    let start_up = all().filter(|k| samples.settling[*k] && !samples.blind[*k]).count();
    Rows {
        used: all().filter(|k| !samples.settling[*k]).count(),
        left_out: LeftOut {
            gaps: record.lost().holes,
            spikes: spiked.len(),
            start_up,
            saturated,
            frozen: all().filter(|k| frozen[*k] && !clipped[*k]).count(),
        },
        spikes: spiked.into_iter().take(MOST_LISTED).map(|k| k + 1).collect(),
    }
}
