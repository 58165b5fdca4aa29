//! Clocks that overflow or restart.

use std::ops::Range;

use super::rows::{Repaired, relabel};
use super::steps::MIN_GAP;
use crate::record::assembly::Columns;

/// Periods of clocks \[s\]: a time of day without a date; a 32-bit counter of ns, µs or ms; a 16-bit counter of ms.
const CLOCK_PERIODS_S: [f64; 5] = [86_400.0, 4.294_967_296, 4_294.967_296, 4_294_967.296, 65.536];
/// Fewest rows of a run before its clock may restart.
const MIN_RUN: usize = 10;
/// Largest share of rows with a decreasing time that count as restarts. With more, the times are unsorted.
const MAX_RESTART_SHARE: f64 = 0.02;

/// Makes times increase if the clock overflows, or if it restarts for another run, which becomes a new segment.
pub(super) fn unwrap_clock(samples: &mut Columns, done: &mut Repaired) {
    let rows = samples.time.len();
    let back: Vec<usize> = (1..rows).filter(|row| samples.time[*row] < samples.time[row - 1]).collect();
    if back.is_empty() || back.len() as f64 > (MAX_RESTART_SHARE * rows as f64).max(1.0) {
        return;
    }
    let mut steps: Vec<f64> = samples.time.windows(2).map(|t| t[1] - t[0]).filter(|step| *step > 0.0).collect();
    if steps.is_empty() {
        return;
    }
    let middle = (steps.len() - 1) / 2;
    let usual = *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
    let (mut offset, mut starts, mut periods) = (0.0, vec![0], Vec::new());
    let (first, mut time) = (samples.time[0], samples.time.clone());
    let mut due = back.iter().copied().peekable();
    for row in 1..rows {
        if due.next_if_eq(&row).is_some() {
            let (before, own) = (samples.time[row - 1], samples.time[row]);
            let continues = |period: &&f64| {
                let step = own + **period - before;
                step > 0.0 && step <= MIN_GAP * usual && own >= 0.0
            };
            // Midnight may be within an interruption.
            let midnight = before <= DAY_S && before - own > MIN_MIDNIGHT_S && own >= 0.0;
            if let Some(period) = CLOCK_PERIODS_S.iter().find(continues).or(midnight.then_some(&DAY_S)) {
                offset += period;
                periods.push(*period);
            } else if (own - first).abs() <= 2.0 * usual && row - starts.last().unwrap_or(&0) >= MIN_RUN {
                offset = time[row - 1] + usual - own;
                starts.push(row);
            } else {
                return;
            }
        }
        time[row] = samples.time[row] + offset;
    }
    samples.time = time;
    let passed = match periods.first() {
        Some(period) if *period == DAY_S => {
            Some("the clock passes midnight: one day is added to the times after it".to_owned())
        }
        Some(period) => {
            Some(format!("the time counter overflows after {period} s: this time is added to the rows after it"))
        }
        None => None,
    };
    passed.into_iter().for_each(|note| done.note(note));
    if starts.len() > 1 {
        let labels = samples.segment.take();
        let begins = |row: usize| {
            row == 0 || starts.contains(&row) || labels.as_ref().is_some_and(|labels| labels[row] != labels[row - 1])
        };
        let segments: Vec<usize> = (0..rows).filter(|row| begins(*row)).chain([rows]).collect();
        let segments: Vec<Range<usize>> = segments.windows(2).map(|w| w[0]..w[1]).collect();
        relabel(samples, &segments);
        done.note(format!(
            "the clock restarts {}: a segment begins there, and its times are shifted to follow the rows before",
            if starts.len() == 2 {
                format!("in row {}", done.row(starts[1]) + 1)
            } else {
                format!("{} times", starts.len() - 1)
            }
        ));
    }
}

/// One day \[s\].
const DAY_S: f64 = 86_400.0;
/// Smallest decrease of a time of day at midnight \[s\].
const MIN_MIDNIGHT_S: f64 = 80_000.0;
