//! The even time grid of rounded times.
//!
//! A 750 Hz record with six decimals has the times 0.000000, 0.001333, 0.002667. Its steps differ, but it is even to
//! the last printed digit. Let `t_k` be the printed times of a segment and `r` the printed resolution. The segment is
//! even if one period `h` fits every row: `|t_k − t_0 − k·h| ≤ r`. Each row gives a lower and an upper bound of `h`, so
//! the valid periods form an interval. [`fit`] returns the simplest number in it.

use std::ops::Range;

use rayon::prelude::*;

/// The printed resolution of times, in decimals of a second.
///
/// Both values are needed: `decimals` limits times with fixed decimals (`10.920000`), `digits` limits times with a
/// fixed number of digits (`10.9213`, `1.09213e1`).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Printed {
    /// The maximum number of digits after the decimal point.
    pub(crate) decimals: i32,
    /// The maximum number of digits without leading zeros.
    pub(crate) digits: i32,
}

impl Printed {
    /// The resolution of times that were never printed.
    pub(crate) const EXACT: Self = Self { decimals: 30, digits: 30 };

    /// Updates the maxima with one printed number.
    pub(crate) fn take(&mut self, text: &[u8]) {
        let (mut digits, mut decimals) = (0, 0);
        let (mut leading, mut after_point) = (true, false);
        let mut exponent = 0;
        for (at, byte) in text.iter().enumerate() {
            match byte {
                b'0'..=b'9' => {
                    leading &= *byte == b'0';
                    digits += i32::from(!leading);
                    decimals += i32::from(after_point);
                }
                b'.' => after_point = true,
                b'e' | b'E' => {
                    exponent = std::str::from_utf8(&text[at + 1..]).ok().and_then(|e| e.parse().ok()).unwrap_or(0);
                    break;
                }
                _ => {}
            }
        }
        self.digits = self.digits.max(digits);
        self.decimals = self.decimals.max(decimals.saturating_sub(exponent).clamp(-300, 300));
    }

    /// Updates the maxima with those of other rows.
    pub(crate) fn join(&mut self, other: Self) {
        self.digits = self.digits.max(other.digits);
        self.decimals = self.decimals.max(other.decimals);
    }

    /// Returns the resolution of the last printed digit.
    fn resolution(self) -> Resolution {
        let fixed = 10_f64.powi(-self.decimals);
        // A double has 17 digits: with more printed digits only its own rounding counts.
        let below =
            if self.digits > 17 { f64::INFINITY } else { 10_f64.powi(self.digits.saturating_sub(self.decimals)) };
        Resolution { fixed, below, digits: self.digits }
    }
}

/// The printed resolution as a function of time.
#[derive(Clone, Copy, Debug)]
struct Resolution {
    /// One unit of the last decimal \[s\], for times smaller than `below`.
    fixed: f64,
    /// The time from which `digits` limits the resolution \[s\].
    below: f64,
    /// The number of printed digits.
    digits: i32,
}

impl Resolution {
    /// Returns one unit of the last printed digit of the time `t` \[s\].
    fn at(self, t: f64) -> f64 {
        if t.abs() < self.below {
            return self.fixed;
        }
        // The offset of 1e-3 decades prevents 10 from being classified as 9.99….
        let leading = (t.abs().log10() + 1e-3).floor();
        let own = || 10_f64.powf(leading + 1.0 - f64::from(self.digits));
        if leading.is_finite() { self.fixed.max(own()) } else { self.fixed }
    }
}

/// The sample period of a segment.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub(crate) struct Period {
    /// The period \[s\].
    pub(crate) value: f64,
    /// The shortest and the longest valid period \[s\].
    pub(crate) fits: (f64, f64),
}

/// The reason why no period fits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Fault {
    /// A row is not on the grid of its segment.
    Uneven { row: usize, expected: f64 },
    /// No segment has two rows.
    TooShort,
}

/// The interval of periods that fit the rows seen so far.
#[derive(Clone, Copy)]
struct Fits {
    low: f64,
    high: f64,
}

impl Fits {
    const ALL: Self = Self { low: 0.0, high: f64::INFINITY };

    fn narrow(&mut self, step: f64, tolerance: f64, k: f64) {
        self.low = self.low.max((step - tolerance) / k);
        self.high = self.high.min((step + tolerance) / k);
    }

    fn and(self, other: Self) -> Self {
        Self { low: self.low.max(other.low), high: self.high.min(other.high) }
    }

    fn has(self, h: f64) -> bool {
        self.low <= h && h <= self.high
    }

    fn is_empty(self) -> bool {
        self.low.is_nan() || self.high.is_nan() || self.low > self.high
    }
}

/// Fits the period of each segment of increasing times \[s\].
///
/// Segments share one period if their times allow it, because a longer segment determines the period more accurately.
/// The error is the first uneven row.
pub(crate) fn fit(time: &[f64], segments: &[Range<usize>], printed: Printed) -> Result<Vec<Period>, Fault> {
    if let Some(period) = shared(time, segments, printed)? {
        return Ok(vec![period; segments.len()]);
    }
    // Longest first: a segment that is too short to determine its own period then joins the first group.
    let mut by_length: Vec<usize> = (0..segments.len()).collect();
    by_length.sort_by_key(|s| std::cmp::Reverse(segments[*s].len()));
    let mut groups: Vec<(Fits, Vec<usize>)> = Vec::new();
    for segment in by_length {
        let t = &time[segments[segment].clone()];
        let [own] = fits(t, printed, [slack(t)]);
        match groups.iter_mut().find(|(fits, _)| !fits.and(own).is_empty()) {
            Some((fits, group)) => {
                *fits = fits.and(own);
                group.push(segment);
            }
            None => groups.push((own, vec![segment])),
        }
    }
    let mut periods = vec![None; segments.len()];
    for (_, mut group) in groups {
        group.sort_unstable();
        let rows: Vec<Range<usize>> = group.iter().map(|s| segments[*s].clone()).collect();
        let period = shared(time, &rows, printed)?;
        for (segment, rows) in group.into_iter().zip(rows) {
            periods[segment] = if period.is_some() { period } else { shared(time, &[rows], printed)? };
        }
    }
    periods.into_iter().map(|period| period.ok_or(Fault::TooShort)).collect()
}

/// Rows per parallel task.
const PART_ROWS: usize = 1 << 16;

/// Returns the tolerance of a row in addition to the printed resolution \[s\].
///
/// Times that are accumulated step by step drift by more than one rounding. A millionth of a period is negligible.
fn slack(t: &[f64]) -> f64 {
    rounding(t) + 1e-6 * if t.len() < 2 { 0.0 } else { mean_step(t) }
}

/// Returns the valid periods of the times of a segment, for each slack \[s\].
fn fits<const N: usize>(t: &[f64], printed: Printed, slacks: [f64; N]) -> [Fits; N] {
    let Some(start) = t.first() else { return [Fits::ALL; N] };
    let resolution = printed.resolution();
    let first = resolution.at(*start);
    let part = |(part, times): (usize, &[f64])| {
        let mut own = [Fits::ALL; N];
        for (k, tk) in (part * PART_ROWS..).zip(times).skip(usize::from(part == 0)) {
            let r = resolution.at(*tk).max(first);
            for (own, slack) in own.iter_mut().zip(slacks) {
                own.narrow(tk - start, r + slack, k as f64);
            }
        }
        own
    };
    if t.len() <= PART_ROWS {
        return part((0, t));
    }
    // The result does not depend on the order of the rows.
    let both = |a: [Fits; N], b: [Fits; N]| std::array::from_fn(|n| a[n].and(b[n]));
    t.par_chunks(PART_ROWS).enumerate().map(part).reduce(|| [Fits::ALL; N], both)
}

/// Returns the rounding error of sums and differences of the times \[s\].
fn rounding(time: &[f64]) -> f64 {
    4.0 * f64::EPSILON * time.iter().fold(0.0_f64, |m, t| m.max(t.abs()))
}

/// Returns the common period of segments; `None` if each segment is even but they have no period in common.
fn shared(time: &[f64], segments: &[Range<usize>], printed: Printed) -> Result<Option<Period>, Fault> {
    let Some(longest) = segments.iter().filter(|rows| rows.len() >= 2).max_by_key(|rows| rows.len()) else {
        return Err(Fault::TooShort);
    };
    let guess = mean_step(&time[longest.clone()]);
    let rounding = rounding(time);
    let slack = rounding + 1e-6 * guess;
    let (mut strict, mut all) = (Fits::ALL, Fits::ALL);
    let mut odd = None;
    for rows in segments {
        let [own, exact] = fits(&time[rows.clone()], printed, [slack, rounding]);
        (all, strict) = (all.and(own), strict.and(exact));
        if own.is_empty() && odd.is_none() {
            odd = Some(rows);
        }
    }
    // Every segment is even, but no period fits all of them.
    if all.is_empty() && odd.is_none() {
        return Ok(None);
    }
    if let Some(fault) = gap(time, segments, printed, guess) {
        return Err(fault);
    }
    // One segment is uneven.
    if let Some(rows) = odd {
        return Err(uneven(&time[rows.clone()], printed, slack, rows.start));
    }
    let grid = Grid { time, segments, printed, rounding, strict };
    let value = grid.simplest(guess).clamp(all.low, all.high);
    if !(value > 0.0 && value.is_finite()) {
        return Err(Fault::TooShort);
    }
    Ok(Some(Period { value, fits: (all.low, all.high) }))
}

fn mean_step(t: &[f64]) -> f64 {
    (t[t.len() - 1] - t[0]) / (t.len() - 1) as f64
}

struct Grid<'a> {
    time: &'a [f64],
    segments: &'a [Range<usize>],
    printed: Printed,
    rounding: f64,
    strict: Fits,
}

impl Grid<'_> {
    /// Returns the period that equals its printed value, else that of a whole rate \[Hz\], else `guess`.
    fn simplest(&self, guess: f64) -> f64 {
        let spelled = || self.spelled_out(guess);
        let whole = || whole_rate(guess, self.strict);
        // With many decimals every period equals its printed value, so a whole rate takes precedence.
        let coarse = 10_f64.powi(-self.printed.decimals) > 1e-9 * guess;
        let found = if coarse { spelled().or_else(whole) } else { whole().or_else(spelled) };
        found
            .or_else(|| whole_rate(guess, Fits { low: guess * (1.0 - 1e-9), high: guess * (1.0 + 1e-9) }))
            .unwrap_or(guess)
    }

    /// Returns the period rounded to the decimals of the times, if it reproduces every printed time exactly.
    fn spelled_out(&self, guess: f64) -> Option<f64> {
        let decimals = self.printed.decimals.clamp(0, 12);
        let scale = 10_f64.powi(decimals);
        let h = (guess * scale).round() / scale;
        let on_grid = |rows: &Range<usize>| {
            let t = &self.time[rows.clone()];
            t.iter().enumerate().all(|(k, tk)| (tk - t[0] - k as f64 * h).abs() <= self.rounding)
        };
        (h > 0.0 && self.segments.iter().all(on_grid)).then_some(h)
    }
}

/// Returns the period of the whole rate \[Hz\] near `1 / guess` with the most trailing zeros that fits.
fn whole_rate(guess: f64, fits: Fits) -> Option<f64> {
    let rate = 1.0 / guess;
    if !(0.5..1e15).contains(&rate) {
        return None;
    }
    (0..=rate.log10().ceil() as i32).rev().map(|zeros| 10_f64.powi(zeros)).find_map(|unit| {
        let whole = (rate / unit).round() * unit;
        (whole > 0.0 && fits.has(1.0 / whole)).then(|| 1.0 / whole)
    })
}

/// Finds a missing row if the period is at most three printed units.
///
/// At 1 kHz with three decimals, a missing row shows as 0.003, 0.005. This is one unit off the grid, which rounding of
/// a slightly lower rate could also explain. Rounding makes such long steps regularly. Long steps that occur once or
/// twice, or in less than 5 % of the rows, are gaps. If a period has more than three units, the tolerance of one unit
/// detects every gap.
fn gap(time: &[f64], segments: &[Range<usize>], printed: Printed, guess: f64) -> Option<Fault> {
    let resolution = printed.resolution();
    let is_coarse = |row: &usize| guess <= 3.0 * resolution.at(time[*row]);
    let steps = || segments.iter().flat_map(|rows| rows.clone().skip(1)).filter(is_coarse);
    // Early exit for most records: all steps are equal within the resolution.
    let (mut low, mut high, mut finest) = (f64::INFINITY, 0.0_f64, f64::INFINITY);
    for row in steps() {
        let step = time[row] - time[row - 1];
        (low, high, finest) = (low.min(step), high.max(step), finest.min(resolution.at(time[row])));
    }
    if high - low <= 0.5 * finest || high < low {
        return None;
    }
    let mut lengths: Vec<f64> = steps().map(|row| time[row] - time[row - 1]).collect();
    let count = lengths.len();
    let usual = *lengths.select_nth_unstable_by((count - 1) / 2, f64::total_cmp).1;
    let is_odd = |row: &usize| (time[*row] - time[*row - 1] - usual).abs() > 0.5 * resolution.at(time[*row]);
    let odd = steps().filter(is_odd).count();
    let row = steps().find(is_odd)?;
    (odd < 3 || 20 * odd < count).then(|| Fault::Uneven { row, expected: time[row - 1] + usual })
}

/// Returns the first row that is not on the grid of an uneven segment.
fn uneven(t: &[f64], printed: Printed, slack: f64, first_row: usize) -> Fault {
    let mut steps: Vec<f64> = t.windows(2).map(|w| w[1] - w[0]).collect();
    // The lower median: a missing row (longer step) is more likely than an added one.
    let middle = (steps.len() - 1) / 2;
    let usual = *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
    let resolution = printed.resolution();
    let tolerance = |tk: f64| resolution.at(tk) + slack;
    // A row that is missing, added or shifted makes a step that differs from the usual one.
    let jump = t.windows(2).position(|w| (w[1] - w[0] - usual).abs() > 2.0 * tolerance(w[1]));
    if let Some(k) = jump {
        return Fault::Uneven { row: first_row + k + 1, expected: t[k] + usual };
    }
    // Otherwise the rate drifts: return the row that is farthest from the mean grid.
    let h = mean_step(t);
    let off = |k: usize| (t[k] - t[0] - k as f64 * h).abs();
    let k = (1..t.len()).max_by(|a, b| off(*a).total_cmp(&off(*b))).unwrap_or(0);
    Fault::Uneven { row: first_row + k, expected: t[0] + k as f64 * h }
}

#[cfg(test)]
mod tests;
