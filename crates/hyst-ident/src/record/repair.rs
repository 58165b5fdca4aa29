//! Rows as sensors and clocks give them, made into rows that a record can hold.
//!
//! Missing values are left out and counted, rows that were written twice are joined, an interruption begins a segment, and times that
//! jitter are resampled to an even grid by a monotone cubic. Each of these leaves a note.

use std::ops::Range;

use super::error::{Place, RecordError};
use super::grid::{self, Fault, Period, Printed};
use super::{Columns, Origin};

/// Longest run of missing inputs, temperatures or loads that is bridged by a straight line \[rows\].
const MAX_BRIDGE: usize = 8;
/// Share of rows with one time beyond which the times are printed too coarsely to join them.
const MAX_JOINED_SHARE: f64 = 0.02;
/// Share of rows without a value beyond which a column is no measurement.
const MAX_MISSING_SHARE: f64 = 0.5;
/// Step in time, as a multiple of the usual one, from which on there is an interruption.
const MIN_GAP: f64 = 1.5;
/// Jitter beyond which the times are said to be uneven \[periods, rms\].
const MAX_JITTER: f64 = 0.2;
/// Share of steps below half of the usual one, or above one and a half, beyond which times follow no grid.
const MAX_WILD_SHARE: f64 = 0.02;
/// How far the times around lost rows may be off the grid \[periods\].
const MAX_OFF_GRID: f64 = 0.3;
/// The same where every step is a multiple of the usual one \[periods\].
const MAX_OFF_CLEAR_GRID: f64 = 0.1;
/// Share of steps beyond which long steps are no interruptions but the clock.
const MAX_GAP_SHARE: f64 = 0.05;

/// What became of the rows of a file.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Repaired {
    /// Rows whose output is missing; it is interpolated, and counts for nothing.
    pub(super) missing: Vec<bool>,
    /// Row of the file for each row, where rows were left out.
    rows: Option<Vec<usize>>,
    /// Whether anything differs from the file's rows.
    pub(super) changed: bool,
    /// Whether values were interpolated at even times.
    pub(super) resampled: bool,
    /// The period of each segment, where the times are even.
    pub(super) periods: Option<Vec<Period>>,
    pub(super) notes: Vec<String>,
}

impl Repaired {
    /// The row of the file.
    pub(super) fn row(&self, row: usize) -> usize {
        self.rows.as_ref().map_or(row, |rows| rows[row])
    }

    fn note(&mut self, note: String) {
        self.changed = true;
        self.notes.push(note);
    }
}

/// Repairs columns of equal length. `wanted` says that the output is a reference, which has to be complete.
pub(super) fn repair(
    samples: &mut Columns,
    printed: &mut Printed,
    wanted: bool,
    origin: &Origin<'_>,
) -> Result<Repaired, RecordError> {
    let mut done = Repaired::default();
    leave_out_without(samples, &mut done, wanted, origin)?;
    continue_clock(samples, &mut done);
    join_repeated(samples, &mut done);
    let mut times = Times::of(samples, *printed);
    if let Times::Uneven(segments) = &times
        && insert_lost(samples, &mut done, segments)
    {
        times = Times::of(samples, *printed);
    }
    bridge(samples);
    match times {
        Times::Even(periods) => done.periods = Some(periods),
        Times::Uneven(segments) => even_out(samples, printed, &mut done, segments),
        Times::Unsorted => {}
    }
    Ok(done)
}

/// The values of a row's columns.
fn channels(samples: &mut Columns) -> impl Iterator<Item = &mut Vec<f64>> {
    let Columns { input, output, temperature, load, .. } = samples;
    [input.as_mut(), output.as_mut().map(|(_, y)| y), temperature.as_mut(), load.as_mut()].into_iter().flatten()
}

/// Keeps these rows.
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

/// Leaves out rows without a time, and without an input where that is longer away than a bridge reaches.
fn leave_out_without(
    samples: &mut Columns,
    done: &mut Repaired,
    wanted: bool,
    origin: &Origin<'_>,
) -> Result<(), RecordError> {
    let rows = samples.time.len();
    let without_time: Vec<bool> = samples.time.iter().map(|t| t.is_finite()).collect();
    let count = without_time.iter().filter(|there| !**there).count();
    let few = |file: &str, column: &str, missing: usize| RecordError::MostlyMissing {
        file: file.to_owned(),
        column: column.to_owned(),
        missing,
        rows,
    };
    if count as f64 > MAX_MISSING_SHARE * rows as f64 {
        return Err(few(&samples.name, origin.time_column, count));
    }
    if count > 0 {
        keep(samples, done, &without_time);
        done.note(format!("{} without a time {} left out", rows_word(count), was(count)));
    }
    let output = samples.output.as_ref().map(|(unit, y)| (unit.column(), y));
    if let Some((column, y)) = output {
        let missing: Vec<bool> = y.iter().map(|y| !y.is_finite()).collect();
        let count = missing.iter().filter(|missing| **missing).count();
        if count as f64 > MAX_MISSING_SHARE * rows as f64 {
            return Err(few(&samples.name, column, count));
        }
        if let Some(row) = missing.iter().position(|missing| *missing).filter(|_| wanted) {
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
                was(count),
                first_of(count, first)
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
            return Err(few(&samples.name, &column, missing));
        }
        let mut left_out = 0;
        for run in runs(values) {
            // Nothing to draw a line from or to at an end.
            let inner = run.start > 0 && run.end < values.len();
            if run.len() > MAX_BRIDGE || !inner {
                left_out += run.len();
                kept[run].fill(false);
            }
        }
        let bridged = missing - left_out;
        if bridged > 0 {
            notes.push(format!("{} without {column}: interpolated", rows_word(bridged)));
        }
        if left_out > 0 {
            notes.push(format!("{} without {column} {} left out", rows_word(left_out), was(left_out)));
        }
    }
    if kept.contains(&false) {
        keep(samples, done, &kept);
    }
    notes.into_iter().for_each(|note| done.note(note));
    Ok(())
}

/// Where rows are: the number of the only one, or of the first.
fn first_of(count: usize, row: usize) -> String {
    if count == 1 { format!(" (row {row})") } else { format!(" (the first is row {row})") }
}

fn was(count: usize) -> &'static str {
    if count == 1 { "is" } else { "are" }
}

/// Runs of values that are missing.
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

/// Fills what is missing by straight lines; at an end by the nearest value.
fn bridge(samples: &mut Columns) {
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

/// Seconds after which clocks begin again: a time of day without a date, counters of 32 bits that count ns, µs or ms, one of 16 bits that counts ms.
const CLOCK_PERIODS_S: [f64; 5] = [86_400.0, 4.294_967_296, 4_294.967_296, 4_294_967.296, 65.536];
/// Rows that a run has at least before its clock may begin again.
const MIN_RUN: usize = 10;
/// Share of the rows beyond which times that decrease are in no order.
const MAX_RESTART_SHARE: f64 = 0.02;

/// Lets times increase where a clock passes the end of its period, and where it begins again for another run, which becomes a segment.
fn continue_clock(samples: &mut Columns, done: &mut Repaired) {
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
            // A day may pass within an interruption.
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
        Some(period) if *period == DAY_S => Some("the clock passes midnight: the times after it continue".to_owned()),
        Some(period) => {
            Some(format!("the clock begins again after {period} s, where its counter is full: the times continue"))
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
            "the clock begins again {}: a segment begins there, and its times follow those before",
            if starts.len() == 2 {
                format!("in row {}", done.row(starts[1]) + 1)
            } else {
                format!("{} times", starts.len() - 1)
            }
        ));
    }
}

/// Seconds of a day, and how much of it a clock without a date may go back by at midnight.
const DAY_S: f64 = 86_400.0;
const MIN_MIDNIGHT_S: f64 = 80_000.0;

/// Joins rows of one time: their values are averaged.
fn join_repeated(samples: &mut Columns, done: &mut Repaired) {
    let rows = samples.time.len();
    if samples.time.windows(2).all(|t| t[0] != t[1]) {
        return;
    }
    let label = |row: usize| samples.segment.as_ref().map(|labels| labels[row]);
    let repeats = |row: usize| row > 0 && samples.time[row] == samples.time[row - 1] && label(row) == label(row - 1);
    let repeated: Vec<bool> = (0..rows).map(repeats).collect();
    let count = repeated.iter().filter(|repeated| **repeated).count();
    // Where times are printed too coarsely, many rows share each: these are different samples.
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
        more => format!("{more} with other values, of which the mean is taken"),
    };
    keep(samples, done, &kept);
    done.note(format!("{} with the time of the row before ({how}; the first is row {at}): joined", rows_word(count)));
}

/// How times go on.
enum Times {
    /// By even steps in each segment.
    Even(Vec<Period>),
    /// They increase in these segments, but not by even steps.
    Uneven(Vec<Range<usize>>),
    /// In some other way, which the checks that come later refuse.
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

/// Puts back rows that are lost where only a few in sequence are, without values; says whether there were any.
fn insert_lost(samples: &mut Columns, done: &mut Repaired, segments: &[Range<usize>]) -> bool {
    let rows = samples.time.len();
    // Rows to insert before each row.
    let mut lost = vec![0; rows];
    // Where every step is a multiple of the usual one, many rows may be lost and the grid is clear all the same.
    let mut is_clear = true;
    for rows in segments.iter().filter(|rows| rows.len() > 2) {
        let usual = usual_step(&samples.time[rows.clone()]);
        for (row, lost) in lost.iter_mut().enumerate().take(rows.end).skip(rows.start + 1) {
            let steps = (samples.time[row] - samples.time[row - 1]) / usual;
            let whole = steps.round();
            is_clear &= whole >= 1.0 && (steps - whole).abs() < MAX_OFF_CLEAR_GRID;
            if whole >= 2.0 && whole <= MAX_BRIDGE as f64 + 1.0 && (steps - whole).abs() < MAX_OFF_GRID {
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
    done.note(format!("{} lost between others: interpolated, and not fitted", rows_word(count)));
    true
}

/// Begins a segment behind each interruption, and resamples times that jitter. Times that do not increase are left to the checks.
fn even_out(samples: &mut Columns, printed: &mut Printed, done: &mut Repaired, mut segments: Vec<Range<usize>>) {
    let rows = samples.time.len();
    let mut gaps = Vec::new();
    segments = segments.into_iter().flat_map(|rows| at_gaps(&samples.time, rows, &mut gaps)).collect();
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
        done.note(format!("{what}; the state that the actuator keeps from before is estimated"));
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
        // Times that follow no grid at all are refused by the checks that come later.
        if segments.iter().any(|rows| wild(&samples.time[rows.clone()])) {
            return;
        }
        let (rms, most) = resample(samples, done, &segments);
        *printed = Printed::EXACT;
        let what = if rms > MAX_JITTER { "times are uneven: they are off an even grid" } else { "times jitter" };
        done.note(format!(
            "{what} by {:.2} % of a sample period (rms; at most {:.2} %): resampled to even steps by a monotone cubic",
            100.0 * rms,
            100.0 * most
        ));
    }
}

/// Labels segments 0, 1, 2 …
fn relabel(samples: &mut Columns, segments: &[Range<usize>]) {
    samples.segment =
        Some((0..).zip(segments).flat_map(|(label, rows)| std::iter::repeat_n(label, rows.len())).collect());
}

/// The usual step of increasing times \[s\].
fn usual_step(time: &[f64]) -> f64 {
    let mut steps: Vec<f64> = time.windows(2).map(|t| t[1] - t[0]).collect();
    let middle = (steps.len() - 1) / 2;
    *steps.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Parts of a segment between its interruptions, whose lengths \[s\] go to `gaps`.
fn at_gaps(time: &[f64], rows: Range<usize>, gaps: &mut Vec<f64>) -> Vec<Range<usize>> {
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

/// Whether too many steps are far from the usual one.
fn wild(time: &[f64]) -> bool {
    if time.len() < 3 {
        return false;
    }
    let usual = usual_step(time);
    let off = time.windows(2).filter(|t| !(0.5 * usual..=MIN_GAP * usual).contains(&(t[1] - t[0]))).count();
    off as f64 > (MAX_WILD_SHARE * time.len() as f64).max(1.0)
}

/// Puts each segment on an even grid with its number of rows; how far its times were off it: their rms and their most, as shares of a period.
fn resample(samples: &mut Columns, done: &mut Repaired, segments: &[Range<usize>]) -> (f64, f64) {
    let old = samples.time.clone();
    let (mut squares, mut most) = (0.0, 0.0_f64);
    let mut periods: Vec<f64> = Vec::new();
    for rows in segments.iter().filter(|rows| rows.len() >= 2) {
        let t = &old[rows.clone()];
        periods.push((t[t.len() - 1] - t[0]) / (t.len() - 1) as f64);
    }
    // Segments of nearly one rate have it.
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

/// The whole rate next to a period that times of a segment cannot tell from it.
fn round_period(h: f64, t: &[f64]) -> f64 {
    let rate = (1.0 / h).round();
    let whole = 1.0 / rate;
    if rate >= 1.0 && (whole - h).abs() * (t.len() - 1) as f64 <= 0.5 * h { whole } else { h }
}

/// The monotone cubic through `(t, y)` (Fritsch and Butland 1984) at the times `at`, which increase; beyond the ends the end's value. Between
/// two values it stays between them: a step of a drive is not overshot, and what is constant stays so to the last bit.
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

/// A row of the file, as a reader finds it.
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
    fn a_monotone_cubic_follows_and_never_overshoots() {
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
        // Times are printed to the microsecond.
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
    fn a_clock_that_begins_again_begins_a_segment() {
        let run = |rows: i32| (0..rows).map(|k| 1e-3 * f64::from(k));
        let record = read(&table(&run(40).chain(run(60)).collect::<Vec<_>>()));
        assert_eq!((record.segments(), record.labels()), (&[0..40, 40..100][..], &[0, 1][..]));
        assert!(record.notes()[0].contains("begins again in row 41"), "{:?}", record.notes());
        assert!((record.time()[99] - 0.099).abs() < 1e-9);
    }

    #[test]
    fn a_full_counter_continues() {
        let times: Vec<f64> = (0..100).map(|k| (4294.9 + 1e-3 * f64::from(k)) % 4294.967296).collect();
        let record = read(&table(&times));
        assert_eq!((record.rows(), record.segments().len(), record.sample_period()), (100, 1, 1e-3));
        assert!(record.notes()[0].contains("after 4294.967296 s"), "{:?}", record.notes());
    }

    #[test]
    fn many_rows_may_be_lost_from_a_clear_grid() {
        let times: Vec<f64> = (0..300).filter(|k| k % 7 != 3).map(|k| 1e-3 * f64::from(k)).collect();
        let record = read(&table(&times));
        assert_eq!((record.rows(), record.segments().len()), (300, 1));
        assert!(record.notes()[0].contains("43 rows lost between others"), "{:?}", record.notes());
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
    fn missing_values_are_left_out_and_counted() {
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
