//! Repair of measured rows: missing values, repeated rows, interruptions and uneven times.
//!
//! Missing values are omitted and counted, repeated rows are joined, an interruption begins a segment, and jittering
//! times are resampled to an even grid by a monotone cubic. Each repair adds a note.

use std::ops::Range;

use super::error::{Place, RecordError};
use super::grid::{self, Fault, Period, Printed};
use super::{Columns, Origin};

/// Longest run of missing inputs, temperatures or loads that is interpolated linearly \[rows\].
const MAX_INTERPOLATED_ROWS: usize = 8;
/// Largest share of differing rows with equal times that are joined. A larger share means that the times are printed
/// too coarsely.
const MAX_JOINED_SHARE: f64 = 0.02;
/// Largest share of rows without a value in a column.
const MAX_MISSING_SHARE: f64 = 0.5;
/// Shortest time step of an interruption, as a multiple of the usual step.
const MIN_GAP: f64 = 1.5;
/// Largest deviation from an even grid that the note calls jitter \[periods, rms\].
const MAX_JITTER: f64 = 0.2;
/// Largest share of steps outside 0.5 to 1.5 of the usual step. With more, the times are not resampled.
const MAX_IRREGULAR_SHARE: f64 = 0.02;
/// Largest deviation of a step around lost rows from a multiple of the usual step \[periods\].
const MAX_OFF_GRID: f64 = 0.3;
/// Largest deviation of any step from a multiple of the usual step on a clear grid \[periods\].
const MAX_OFF_CLEAR_GRID: f64 = 0.1;
/// Largest share of long steps that count as interruptions. With more, the clock itself is uneven.
const MAX_GAP_SHARE: f64 = 0.05;

/// The result of the repair.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Repaired {
    /// True for rows whose output is missing. It is interpolated and has no weight in a fit.
    pub(super) missing: Vec<bool>,
    /// The row in the file for each row, if rows were omitted or inserted.
    rows: Option<Vec<usize>>,
    /// Whether the rows differ from those of the file.
    pub(super) changed: bool,
    /// Whether the values were resampled to even times.
    pub(super) resampled: bool,
    /// The period of each segment, if the times are even.
    pub(super) periods: Option<Vec<Period>>,
    /// One sentence per repair.
    pub(super) notes: Vec<String>,
}

impl Repaired {
    /// Returns the row in the file.
    pub(super) fn row(&self, row: usize) -> usize {
        self.rows.as_ref().map_or(row, |rows| rows[row])
    }

    fn note(&mut self, note: String) {
        self.changed = true;
        self.notes.push(note);
    }
}

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

/// Returns the columns of values: input, output, temperature, load.
fn channels(samples: &mut Columns) -> impl Iterator<Item = &mut Vec<f64>> {
    let Columns { input, output, temperature, load, .. } = samples;
    [input.as_mut(), output.as_mut().map(|(_, y)| y), temperature.as_mut(), load.as_mut()].into_iter().flatten()
}

/// Removes all rows that are not in `kept`.
fn keep(samples: &mut Columns, done: &mut Repaired, kept: &[bool]) {
    let mut flags = kept.iter();
    let mut is_kept = || flags.next().copied().unwrap_or(true);
    let old = done.rows.take().unwrap_or_else(|| (0..samples.time.len()).collect());
    done.rows = Some(old.into_iter().filter(|_| is_kept()).collect());
    fn filter<T: Copy>(values: &mut Vec<T>, kept: &[bool]) {
        let mut flags = kept.iter();
        values.retain(|_| flags.next().copied().unwrap_or(true));
    }
    filter(&mut samples.time, kept);
    samples.segment.iter_mut().for_each(|labels| filter(labels, kept));
    channels(samples).for_each(|values| filter(values, kept));
    if !done.missing.is_empty() {
        filter(&mut done.missing, kept);
    }
}

fn rows_word(count: usize) -> String {
    if count == 1 { "1 row".to_owned() } else { format!("{count} rows") }
}

/// Omits rows without a time, and runs of missing inputs, temperatures or loads that are too long to interpolate.
fn omit_missing(
    samples: &mut Columns,
    done: &mut Repaired,
    is_reference: bool,
    origin: &Origin<'_>,
) -> Result<(), RecordError> {
    let rows = samples.time.len();
    let has_time: Vec<bool> = samples.time.iter().map(|t| t.is_finite()).collect();
    let count = has_time.iter().filter(|has_time| !**has_time).count();
    let mostly_missing = |file: &str, column: &str, missing: usize| RecordError::MostlyMissing {
        file: file.to_owned(),
        column: column.to_owned(),
        missing,
        rows,
    };
    if count as f64 > MAX_MISSING_SHARE * rows as f64 {
        return Err(mostly_missing(&samples.name, origin.time_column, count));
    }
    if count > 0 {
        keep(samples, done, &has_time);
        done.note(format!("{} without a time {} left out", rows_word(count), is_or_are(count)));
    }
    let output = samples.output.as_ref().map(|(unit, y)| (unit.column(), y));
    if let Some((column, y)) = output {
        let missing: Vec<bool> = y.iter().map(|y| !y.is_finite()).collect();
        let count = missing.iter().filter(|missing| **missing).count();
        if count as f64 > MAX_MISSING_SHARE * rows as f64 {
            return Err(mostly_missing(&samples.name, column, count));
        }
        if let Some(row) = missing.iter().position(|missing| *missing).filter(|_| is_reference) {
            let place = (origin.place)(done.row(row));
            return Err(RecordError::NotFinite {
                file: samples.name.clone(),
                place,
                column: column.to_owned(),
                value: "missing".to_owned(),
            });
        }
        if count > 0 {
            let first = missing.iter().position(|missing| *missing).map_or(0, |row| done.row(row) + 1);
            done.missing = missing;
            done.note(format!(
                "{} without {column} {} not fitted{}",
                rows_word(count),
                is_or_are(count),
                row_hint(count, first)
            ));
        }
    }
    let columns = [
        (samples.input_column.clone(), samples.input.as_ref()),
        ("temperature_degc".to_owned(), samples.temperature.as_ref()),
        ("load_n".to_owned(), samples.load.as_ref()),
    ];
    let mut kept = vec![true; samples.time.len()];
    let mut notes = Vec::new();
    for (column, values) in columns.into_iter().filter_map(|(column, values)| Some((column, values?))) {
        let missing = values.iter().filter(|value| !value.is_finite()).count();
        if missing as f64 > MAX_MISSING_SHARE * rows as f64 {
            return Err(mostly_missing(&samples.name, &column, missing));
        }
        let mut left_out = 0;
        for run in runs(values) {
            // A run at an end has a value on one side only and cannot be interpolated.
            let inner = run.start > 0 && run.end < values.len();
            if run.len() > MAX_INTERPOLATED_ROWS || !inner {
                left_out += run.len();
                kept[run].fill(false);
            }
        }
        let interpolated = missing - left_out;
        if interpolated > 0 {
            notes.push(format!("{} without {column}: interpolated", rows_word(interpolated)));
        }
        if left_out > 0 {
            notes.push(format!("{} without {column} {} left out", rows_word(left_out), is_or_are(left_out)));
        }
    }
    if kept.contains(&false) {
        keep(samples, done, &kept);
    }
    notes.into_iter().for_each(|note| done.note(note));
    Ok(())
}

/// Returns the number of the only row, or of the first of several rows.
fn row_hint(count: usize, row: usize) -> String {
    if count == 1 { format!(" (row {row})") } else { format!(" (the first is row {row})") }
}

fn is_or_are(count: usize) -> &'static str {
    if count == 1 { "is" } else { "are" }
}

/// Returns the runs of missing values.
fn runs(values: &[f64]) -> Vec<Range<usize>> {
    let mut runs = Vec::new();
    let mut start = None;
    for (row, value) in values.iter().enumerate() {
        match (value.is_finite(), start) {
            (false, None) => start = Some(row),
            (true, Some(first)) => {
                runs.push(first..row);
                start = None;
            }
            _ => {}
        }
    }
    runs.extend(start.map(|first| first..values.len()));
    runs
}

/// Replaces missing values by linear interpolation; at an end by the nearest value.
fn interpolate_missing(samples: &mut Columns) {
    if channels(samples).all(|values| values.iter().all(|value| value.is_finite())) {
        return;
    }
    let time = samples.time.clone();
    for values in channels(samples) {
        for run in runs(values) {
            let before = run.start.checked_sub(1).map(|row| (time[row], values[row]));
            let after = (run.end < values.len()).then(|| (time[run.end], values[run.end]));
            for row in run {
                values[row] = match (before, after) {
                    (Some((t0, v0)), Some((t1, v1))) if t1 > t0 => v0 + (v1 - v0) * (time[row] - t0) / (t1 - t0),
                    (Some((_, v)), _) | (None, Some((_, v))) => v,
                    (None, None) => 0.0,
                };
            }
        }
    }
}

/// Periods of clocks \[s\]: a time of day without a date; a 32-bit counter of ns, µs or ms; a 16-bit counter of ms.
const CLOCK_PERIODS_S: [f64; 5] = [86_400.0, 4.294_967_296, 4_294.967_296, 4_294_967.296, 65.536];
/// Fewest rows of a run before its clock may restart.
const MIN_RUN: usize = 10;
/// Largest share of rows with a decreasing time that count as restarts. With more, the times are unsorted.
const MAX_RESTART_SHARE: f64 = 0.02;

/// Makes times increase if the clock overflows, or if it restarts for another run, which becomes a new segment.
fn unwrap_clock(samples: &mut Columns, done: &mut Repaired) {
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

/// Joins rows with the same time. Their values are averaged.
fn join_repeated(samples: &mut Columns, done: &mut Repaired) {
    let rows = samples.time.len();
    if samples.time.windows(2).all(|t| t[0] != t[1]) {
        return;
    }
    let label = |row: usize| samples.segment.as_ref().map(|labels| labels[row]);
    let repeats = |row: usize| row > 0 && samples.time[row] == samples.time[row - 1] && label(row) == label(row - 1);
    let repeated: Vec<bool> = (0..rows).map(repeats).collect();
    let count = repeated.iter().filter(|repeated| **repeated).count();
    // Times that are printed too coarsely repeat in many rows. These rows are different samples.
    let values: Vec<Vec<f64>> = channels(samples).map(|values| values.clone()).collect();
    let differs = |row: usize| values.iter().any(|v| v[row].to_bits() != v[row - 1].to_bits());
    let differing = (1..rows).filter(|row| repeated[*row] && differs(*row)).count();
    if count == 0 || differing as f64 > MAX_JOINED_SHARE * rows as f64 {
        return;
    }
    for values in channels(samples) {
        let mut first = 0;
        for row in 1..rows {
            if !repeated[row] {
                first = row;
            } else if values[row].is_finite() && values[row] != values[first] {
                let so_far = (row - first) as f64;
                values[first] = if values[first].is_finite() {
                    (values[first] * so_far + values[row]) / (so_far + 1.0)
                } else {
                    values[row]
                };
            }
        }
    }
    let kept: Vec<bool> = repeated.iter().map(|repeated| !repeated).collect();
    let at = (0..rows).find(|row| repeated[*row]).map_or(0, |row| done.row(row) + 1);
    let how = match differing {
        0 => "with the same values".to_owned(),
        more => format!("{more} with other values, which are averaged"),
    };
    keep(samples, done, &kept);
    done.note(format!("{} with the time of the row before ({how}; the first is row {at}): joined", rows_word(count)));
}

/// The kind of time column.
enum Times {
    /// Even steps in each segment.
    Even(Vec<Period>),
    /// Increasing times in these segments, with uneven steps.
    Uneven(Vec<Range<usize>>),
    /// Other times, which later checks refuse.
    Unsorted,
}

impl Times {
    fn of(samples: &Columns, printed: Printed) -> Self {
        let time = samples.time.as_slice();
        if time.len() < 2 || time.windows(2).any(|t| t[1] <= t[0]) {
            return Self::Unsorted;
        }
        let segments = match &samples.segment {
            None => std::iter::once(0..time.len()).collect(),
            Some(labels) => match super::split(labels) {
                Ok((_, segments)) => segments,
                Err(_) => return Self::Unsorted,
            },
        };
        match grid::fit(time, &segments, printed) {
            Ok(periods) => Self::Even(periods),
            Err(Fault::Uneven { .. }) => Self::Uneven(segments),
            Err(Fault::TooShort) => Self::Unsorted,
        }
    }
}

/// Inserts lost rows without values if only a few in sequence are lost. Returns whether there were any.
fn insert_lost(samples: &mut Columns, done: &mut Repaired, segments: &[Range<usize>]) -> bool {
    let rows = samples.time.len();
    // The number of rows to insert before each row.
    let mut lost = vec![0; rows];
    // On a clear grid every step is a multiple of the usual one. Then many rows may be lost.
    let mut is_clear = true;
    for rows in segments.iter().filter(|rows| rows.len() > 2) {
        let usual = usual_step(&samples.time[rows.clone()]);
        for (row, lost) in lost.iter_mut().enumerate().take(rows.end).skip(rows.start + 1) {
            let steps = (samples.time[row] - samples.time[row - 1]) / usual;
            let whole = steps.round();
            is_clear &= whole >= 1.0 && (steps - whole).abs() < MAX_OFF_CLEAR_GRID;
            if whole >= 2.0 && whole <= MAX_INTERPOLATED_ROWS as f64 + 1.0 && (steps - whole).abs() < MAX_OFF_GRID {
                *lost = whole as usize - 1;
            }
        }
    }
    let gaps = lost.iter().filter(|lost| **lost > 0).count();
    let count: usize = lost.iter().sum();
    let share = if is_clear { MAX_MISSING_SHARE } else { MAX_GAP_SHARE };
    if count == 0 || gaps as f64 > (share * rows as f64).max(1.0) {
        return false;
    }
    let times: Vec<f64> = (0..rows)
        .flat_map(|row| {
            let (end, n) = (samples.time[row], lost[row]);
            let start = if n > 0 { samples.time[row - 1] } else { end };
            (1..=n).map(move |k| start + (end - start) * k as f64 / (n + 1) as f64).chain([end])
        })
        .collect();
    fn insert<T: Copy>(values: &mut Vec<T>, lost: &[usize], with: impl Fn(usize, T) -> T) {
        let repeated = |(row, value): (usize, &T)| {
            std::iter::repeat_n(with(row, *value), lost[row]).chain([*value]).collect::<Vec<T>>()
        };
        *values = values.iter().enumerate().flat_map(repeated).collect();
    }
    samples.time = times;
    if samples.output.is_some() && done.missing.is_empty() {
        done.missing = vec![false; rows];
    }
    insert(&mut done.missing, &lost, |_, _| true);
    channels(samples).for_each(|values| insert(values, &lost, |_, _| f64::NAN));
    samples.segment.iter_mut().for_each(|labels| insert(labels, &lost, |_, label| label));
    let mut own = done.rows.take().unwrap_or_else(|| (0..rows).collect());
    insert(&mut own, &lost, |_, row| row);
    done.rows = Some(own);
    done.note(format!(
        "{} missing in the time grid: inserted with an interpolated input; the output is not fitted",
        rows_word(count)
    ));
    true
}

/// Begins a segment after each interruption and resamples uneven times. Irregular times are left to later checks.
fn make_even(samples: &mut Columns, printed: &mut Printed, done: &mut Repaired, mut segments: Vec<Range<usize>>) {
    let rows = samples.time.len();
    let mut gaps = Vec::new();
    segments = segments.into_iter().flat_map(|rows| split_at_gaps(&samples.time, rows, &mut gaps)).collect();
    if !gaps.is_empty() {
        let alone = segments.iter().filter(|rows| rows.len() < 2).count();
        let longest = gaps.iter().fold(0.0_f64, |m, g| m.max(*g));
        let before = |row: &usize| samples.time[*row] - samples.time[row - 1] == longest;
        let at = (1..rows).find(before).map_or(0, |row| done.row(row) + 1);
        let what = match gaps.len() {
            1 => format!("an interruption of {longest:.3} s before row {at}: a segment begins there"),
            more => format!(
                "{more} interruptions of up to {longest:.3} s (the longest before row {at}): a segment begins after each"
            ),
        };
        done.note(format!("{what}; the state of the actuator at its start is estimated"));
        if alone > 0 && alone < segments.len() {
            let mut kept = vec![true; rows];
            segments.iter().filter(|rows| rows.len() < 2).for_each(|rows| kept[rows.clone()].fill(false));
            relabel(samples, &segments);
            keep(samples, done, &kept);
            done.note(format!("{} between two interruptions: left out", rows_word(alone)));
        } else {
            relabel(samples, &segments);
        }
    }
    if let Times::Uneven(segments) = Times::of(samples, *printed) {
        // Later checks refuse times that do not follow a grid.
        if segments.iter().any(|rows| is_irregular(&samples.time[rows.clone()])) {
            return;
        }
        let (rms, most) = resample(samples, done, &segments);
        *printed = Printed::EXACT;
        let what = if rms > MAX_JITTER { "times are uneven: they deviate from an even grid" } else { "times jitter" };
        done.note(format!(
            "{what} by {:.2} % of a sample period (rms; at most {:.2} %): resampled to even steps by a monotone cubic",
            100.0 * rms,
            100.0 * most
        ));
    }
}

/// Sets the segment labels to 0, 1, 2 …
fn relabel(samples: &mut Columns, segments: &[Range<usize>]) {
    samples.segment =
        Some((0..).zip(segments).flat_map(|(label, rows)| std::iter::repeat_n(label, rows.len())).collect());
}

/// Returns the median step of increasing times \[s\].
fn usual_step(time: &[f64]) -> f64 {
    let mut steps: Vec<f64> = time.windows(2).map(|t| t[1] - t[0]).collect();
    let middle = (steps.len() - 1) / 2;
    *steps.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Splits a segment at its interruptions and appends their lengths \[s\] to `gaps`.
fn split_at_gaps(time: &[f64], rows: Range<usize>, gaps: &mut Vec<f64>) -> Vec<Range<usize>> {
    if rows.len() < 3 {
        return vec![rows];
    }
    let usual = usual_step(&time[rows.clone()]);
    let is_gap = |row: &usize| time[*row] - time[*row - 1] > MIN_GAP * usual;
    let starts: Vec<usize> = (rows.start + 1..rows.end).filter(is_gap).collect();
    if starts.len() as f64 > (MAX_GAP_SHARE * rows.len() as f64).max(1.0) {
        return vec![rows];
    }
    gaps.extend(starts.iter().map(|row| time[*row] - time[*row - 1]));
    let ends = starts.iter().copied().chain([rows.end]);
    std::iter::once(rows.start).chain(starts.iter().copied()).zip(ends).map(|(start, end)| start..end).collect()
}

/// Returns whether too many steps are far from the usual step.
fn is_irregular(time: &[f64]) -> bool {
    if time.len() < 3 {
        return false;
    }
    let usual = usual_step(time);
    let off = time.windows(2).filter(|t| !(0.5 * usual..=MIN_GAP * usual).contains(&(t[1] - t[0]))).count();
    off as f64 > (MAX_IRREGULAR_SHARE * time.len() as f64).max(1.0)
}

/// Resamples each segment to an even grid with the same number of rows.
///
/// Returns the rms and the maximum deviation of the times from the grid \[periods\].
fn resample(samples: &mut Columns, done: &mut Repaired, segments: &[Range<usize>]) -> (f64, f64) {
    let old = samples.time.clone();
    let (mut squares, mut most) = (0.0, 0.0_f64);
    let mut periods: Vec<f64> = Vec::new();
    for rows in segments.iter().filter(|rows| rows.len() >= 2) {
        let t = &old[rows.clone()];
        periods.push((t[t.len() - 1] - t[0]) / (t.len() - 1) as f64);
    }
    // Segments with nearly the same rate get one period, the median.
    let median = {
        let mut sorted = periods.clone();
        sorted.sort_unstable_by(f64::total_cmp);
        sorted[sorted.len() / 2]
    };
    for rows in segments.iter().filter(|rows| rows.len() >= 2) {
        let t = &old[rows.clone()];
        let own = (t[t.len() - 1] - t[0]) / (t.len() - 1) as f64;
        let shared = (own - median).abs() * (t.len() - 1) as f64;
        let h = round_period(if shared < 0.5 * median { median } else { own }, t);
        for (k, row) in rows.clone().enumerate() {
            let even = t[0] + k as f64 * h;
            let off = (old[row] - even) / h;
            squares += off * off;
            most = most.max(off.abs());
            samples.time[row] = even;
        }
    }
    let time = samples.time.clone();
    if !done.missing.is_empty() {
        let old_missing = done.missing.clone();
        for rows in segments {
            for row in rows.clone() {
                let after = rows.start + old[rows.clone()].partition_point(|t| *t < time[row]);
                let near = |row: usize| old_missing[row.clamp(rows.start, rows.end - 1)];
                done.missing[row] = near(after) || near(after.saturating_sub(1));
            }
        }
    }
    for values in channels(samples) {
        for rows in segments.iter().filter(|rows| rows.len() >= 2) {
            let moved = monotone(&old[rows.clone()], &values[rows.clone()], &time[rows.clone()]);
            values[rows.clone()].copy_from_slice(&moved);
        }
    }
    done.changed = true;
    done.resampled = true;
    ((squares / old.len() as f64).sqrt(), most)
}

/// Returns the period of the nearest whole rate \[Hz\], if the times of a segment do not distinguish it from `h`.
fn round_period(h: f64, t: &[f64]) -> f64 {
    let rate = (1.0 / h).round();
    let whole = 1.0 / rate;
    if rate >= 1.0 && (whole - h).abs() * (t.len() - 1) as f64 <= 0.5 * h { whole } else { h }
}

/// Evaluates the monotone cubic through `(t, y)` (Fritsch and Butland 1984) at increasing times `at`.
///
/// Outside the data it returns the end value. Between two values the result does not leave their range, so a step does
/// not overshoot and a constant stays exactly constant.
fn monotone(t: &[f64], y: &[f64], at: &[f64]) -> Vec<f64> {
    let n = t.len();
    let h = |k: usize| t[k + 1] - t[k];
    let secant = |k: usize| (y[k + 1] - y[k]) / h(k);
    let slope = |k: usize| {
        if k == 0 || k + 1 == n {
            return secant(k.min(n - 2));
        }
        let (before, after) = (secant(k - 1), secant(k));
        if before * after <= 0.0 {
            return 0.0;
        }
        let (w0, w1) = (2.0 * h(k) + h(k - 1), h(k) + 2.0 * h(k - 1));
        (w0 + w1) / (w0 / before + w1 / after)
    };
    let mut k = 0;
    at.iter()
        .map(|x| {
            while k + 2 < n && t[k + 1] <= *x {
                k += 1;
            }
            let x = ((x - t[k]) / h(k)).clamp(0.0, 1.0);
            if y[k] == y[k + 1] {
                return y[k];
            }
            let (x2, x3) = (x * x, x * x * x);
            let bend = (x3 - 2.0 * x2 + x) * slope(k) + (x3 - x2) * slope(k + 1);
            y[k] + (3.0 * x2 - 2.0 * x3) * (y[k + 1] - y[k]) + h(k) * bend
        })
        .collect()
}

/// Returns a function from a repaired row to its place in the file.
pub(super) fn place_of<'a>(done: &'a Repaired, place: &'a dyn Fn(usize) -> Place) -> impl Fn(usize) -> Place + 'a {
    move |row| place(done.row(row))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::record::{ColumnMap, Need, Record};

    fn read(text: &str) -> Record {
        Record::parse("run.csv", text.as_bytes(), &ColumnMap::default(), Need::InputAndOutput)
            .unwrap_or_else(|e| panic!("{e}"))
    }

    fn table(times: &[f64]) -> String {
        times.iter().fold("time_s,voltage_v,displacement_um\n".to_owned(), |text, t| {
            text + &format!("{t:.6},{:.9},{:.9}\n", (6.0 * t).sin(), 1.0 + (6.0 * t).cos())
        })
    }

    #[test]
    fn a_monotone_cubic_interpolates_without_overshoot() {
        let t: Vec<f64> = (0..30).map(|k| f64::from(k) + 0.3 * f64::from(k % 3)).collect();
        let y: Vec<f64> = t.iter().map(|t| (0.3 * t).sin()).collect();
        let at: Vec<f64> = (0..28).map(f64::from).collect();
        let worst = at.iter().zip(monotone(&t, &y, &at)).map(|(x, y)| ((0.3 * x).sin() - y).abs()).fold(0.0, f64::max);
        assert!(worst < 2e-2, "{worst}");
        for (own, y) in monotone(&t, &y, &t).iter().zip(&y) {
            assert!((own - y).abs() < 1e-12);
        }
        let square: Vec<f64> = (0..30).map(|k| if k % 10 < 5 { 0.0 } else { 100.0 }).collect();
        assert!(monotone(&t, &square, &at).iter().all(|y| (0.0..=100.0).contains(y)));
    }

    #[test]
    fn jitter_is_resampled() {
        let jitter = |k: usize| 1e-3 * k as f64 + 2e-6 * (k as f64 * 1.7).sin();
        let record = read(&table(&(0..500).map(jitter).collect::<Vec<_>>()));
        assert_eq!((record.sample_period(), record.segments().len()), (1e-3, 1));
        assert!(record.notes()[0].contains("jitter by 0.15 %"), "{:?}", record.notes());
        let worst =
            record.time().iter().zip(record.input()).map(|(t, u)| ((6.0 * t).sin() - u).abs()).fold(0.0, f64::max);
        // The times are printed with a resolution of 1 µs.
        assert!(worst < 1e-5, "{worst}");
    }

    #[test]
    fn an_interruption_begins_a_segment() {
        let times: Vec<f64> = (0..100).map(|k| 1e-3 * f64::from(k) + if k >= 40 { 2.0 } else { 0.0 }).collect();
        let record = read(&table(&times));
        assert_eq!((record.segments(), record.labels()), (&[0..40, 40..100][..], &[0, 1][..]));
        assert!(record.notes()[0].contains("an interruption of 2.001 s before row"), "{:?}", record.notes());
    }

    #[test]
    fn a_clock_that_restarts_begins_a_segment() {
        let run = |rows: i32| (0..rows).map(|k| 1e-3 * f64::from(k));
        let record = read(&table(&run(40).chain(run(60)).collect::<Vec<_>>()));
        assert_eq!((record.segments(), record.labels()), (&[0..40, 40..100][..], &[0, 1][..]));
        assert!(record.notes()[0].contains("restarts in row 41"), "{:?}", record.notes());
        assert!((record.time()[99] - 0.099).abs() < 1e-9);
    }

    #[test]
    fn times_continue_after_a_counter_overflow() {
        let times: Vec<f64> = (0..100).map(|k| (4294.9 + 1e-3 * f64::from(k)) % 4294.967296).collect();
        let record = read(&table(&times));
        assert_eq!((record.rows(), record.segments().len(), record.sample_period()), (100, 1, 1e-3));
        assert!(record.notes()[0].contains("after 4294.967296 s"), "{:?}", record.notes());
    }

    #[test]
    fn many_lost_rows_of_a_clear_grid_are_inserted() {
        let times: Vec<f64> = (0..300).filter(|k| k % 7 != 3).map(|k| 1e-3 * f64::from(k)).collect();
        let record = read(&table(&times));
        assert_eq!((record.rows(), record.segments().len()), (300, 1));
        assert!(record.notes()[0].contains("43 rows missing in the time grid"), "{:?}", record.notes());
    }

    #[test]
    fn repeated_rows_are_joined() {
        let mut times: Vec<f64> = (0..100).map(|k| 1e-3 * f64::from(k)).collect();
        times.insert(41, 0.040);
        let record = read(&table(&times));
        assert_eq!((record.rows(), record.sample_period()), (100, 1e-3));
        assert!(
            record.notes()[0]
                .contains("1 row with the time of the row before (with the same values; the first is row 42)"),
            "{:?}",
            record.notes()
        );
    }

    #[test]
    fn missing_values_are_omitted_and_counted() {
        let mut rows: Vec<String> =
            table(&(0..100).map(|k| 1e-3 * f64::from(k)).collect::<Vec<_>>()).lines().map(str::to_owned).collect();
        rows[11] = "0.010,0.06,NaN".into();
        rows[21] = "0.020,,1.9".into();
        for row in &mut rows[31..51] {
            *row = format!("{},,1.9", row.split(',').next().unwrap());
        }
        let record = read(&rows.join("\n"));
        assert_eq!((record.rows(), record.segments().len()), (80, 2));
        assert_eq!(record.missing().iter().filter(|missing| **missing).count(), 1);
        assert!((record.input()[20] - (0.12_f64).sin()).abs() < 1e-4);
        let notes = record.notes().join("; ");
        for part in [
            "1 row without displacement_um is not fitted",
            "1 row without voltage_v: interpolated",
            "20 rows without voltage_v are left out",
        ] {
            assert!(notes.contains(part), "{notes}");
        }
    }
}
