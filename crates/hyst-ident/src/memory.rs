//! The drive history before a segment.
//!
//! A model's memory is virgin at the start of a segment. An actuator that was cycled before the record, or that rests
//! away from 0 V, has another memory. A memory that wipes out keeps only the extremes in force (Mayergoyz, Mathematical
//! Models of Hysteresis, 1991), so a few reversals of the drive describe it. They are the initial condition of the
//! record and are estimated from its first rows.

use std::ops::Range;

use hyst_core::Error;
use rayon::prelude::*;

use crate::base::{Basis, Drag};
use crate::criteria::{LAW_ACCURACY, MIN_PAST_RATIO, MIN_RMSE_DROP, MIN_RMSE_RATIO, MINOR_SHARE, NEGLIGIBLE_SHARE};
use crate::metrics::rms;
use crate::nested::{Fitted, Problem};
use crate::samples::Samples;
use crate::settle::{centre, first_cycles, windows};

/// Number of reversal levels that are tried over the range of the record.
const LEVELS: usize = 13;
/// Number of further levels on either side of the range.
const LEVELS_BEYOND: usize = 6;
/// Number of reversals of a decaying drive (demagnetisation).
const DECAY_REVERSALS: usize = 16;
/// Number of amplitudes of such a drive.
const DECAY_AMPLITUDES: usize = 6;
/// Rows from one reversal to the next.
const ROWS_PER_REVERSAL: usize = 16;
/// Number of times that the step of a reversal's level is halved: to 1/1500 of the range.
const HALVINGS: usize = 7;

/// Candidate drive histories of a segment: drives from 0 V that end just before its first voltage.
pub(crate) struct Candidates {
    /// First voltage of the segment \[V\].
    u0: f64,
    /// Distance of two levels \[V\].
    step: f64,
    /// Drives with few reversals: the levels of these \[V\].
    reversals: Vec<Vec<f64>>,
    others: Vec<Vec<f64>>,
}

impl Candidates {
    /// Histories with one or two reversals, and decaying drives.
    pub(crate) fn new(u0: f64, (low, high): (f64, f64)) -> Self {
        let (span, inside) = (high - low, LEVELS - 1);
        let level = |i: usize| low + span * (i as f64 - LEVELS_BEYOND as f64) / inside as f64;
        // Levels outside of the range too: a device driven to one side is poled there, and wide play operators come to
        // rest at any voltage.
        let levels = || (0..LEVELS + 2 * LEVELS_BEYOND).map(level).filter(|u| (u - u0).abs() > 1e-9 * span);
        let mut reversals: Vec<Vec<f64>> = levels().map(|u| vec![u]).collect();
        // Two reversals on the same side of `u0` wipe each other out.
        for first in levels() {
            let opposite = levels().filter(|second| (second - u0) * (first - u0) < 0.0);
            reversals.extend(opposite.map(|second| vec![first, second]));
        }
        let amplitude = |i: usize| span * i as f64 / DECAY_AMPLITUDES as f64;
        let others = (1..=DECAY_AMPLITUDES).map(|i| decay(u0, amplitude(i))).collect();
        Self { u0, step: span / inside as f64, reversals, others }
    }

    /// Adds another history.
    pub(crate) fn add(&mut self, past: Vec<f64>) {
        self.others.push(past);
    }

    /// Returns the history with the smallest Σ residual² of the first rows (`squares`); empty if none explains them.
    /// The error above `level`, the Σ residual² of as many other rows, must fall by [`MIN_PAST_RATIO`]. Near 0 V a
    /// memory of rest and a sensor transient are plausible too. There the history must explain all but a
    /// [`NEGLIGIBLE_SHARE`] of the error, or the error must fall to that of other rows: a cycled actuator keeps a
    /// remanence at 0 V, and no sensor transient has the shape of a loop.
    pub(crate) fn best(&self, level: f64, away: bool, squares: impl Fn(&[f64]) -> f64 + Sync) -> Vec<f64> {
        let from_rest = squares(&[]);
        let stands_out = MIN_RMSE_RATIO * MIN_RMSE_RATIO * level;
        if from_rest < stands_out {
            return Vec::new();
        }
        let with_reversals: Vec<f64> =
            self.reversals.par_iter().map(|levels| squares(&path(levels, self.u0))).collect();
        let with_others: Vec<f64> = self.others.par_iter().map(|past| squares(past)).collect();
        let least = |all: &[f64]| all.iter().copied().enumerate().min_by(|a, b| a.1.total_cmp(&b.1));
        let refined =
            least(&with_reversals).map(|(at, error)| self.refined(self.reversals[at].clone(), error, &squares));
        let other = least(&with_others).map(|(at, error)| (self.others[at].clone(), error));
        let best = refined.into_iter().chain(other).min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((past, least)) = best.filter(|(_, least)| *least < f64::INFINITY) else { return Vec::new() };
        let helps = MIN_PAST_RATIO * MIN_PAST_RATIO * (least - level).max(0.0) < from_rest - level;
        let explains_all = least - level <= NEGLIGIBLE_SHARE * (from_rest - level);
        if helps && (away || explains_all || least < stands_out) { past } else { Vec::new() }
    }

    /// Moves each reversal to the level with the smallest error, in steps that are halved. Returns the history and its
    /// error.
    fn refined(&self, mut reversals: Vec<f64>, mut least: f64, squares: &impl Fn(&[f64]) -> f64) -> (Vec<f64>, f64) {
        let mut step = self.step;
        for _ in 0..HALVINGS {
            step /= 2.0;
            for at in 0..reversals.len() {
                for by in [-step, step] {
                    let mut moved = reversals.clone();
                    moved[at] += by;
                    let error = squares(&path(&moved, self.u0));
                    if error < least {
                        (reversals, least) = (moved, error);
                        break;
                    }
                }
            }
        }
        (path(&reversals, self.u0), least)
    }
}

/// How a device may have reached the start of a segment.
#[derive(Clone, Copy)]
enum History {
    /// Demagnetised at `u0`, or at rest there from the start: wide play operators are at the first voltage.
    Demagnetised,
    /// Cycled before as in the segment itself.
    Cycled,
    /// At rest since the end of the previous segment, and driven on from there.
    Continued,
    /// Driven to the upper or the lower end of the range.
    FromAbove,
    FromBelow,
}

impl History {
    const ALL: [Self; 5] = [Self::Demagnetised, Self::Cycled, Self::Continued, Self::FromAbove, Self::FromBelow];

    /// Returns the drive before a segment; `None` if this history is impossible.
    fn past(self, samples: &Samples, segment: usize) -> Option<Vec<f64>> {
        let rows = samples.segments[segment].clone();
        let (u0, (low, high)) = (samples.input[rows.start], samples.input_range());
        Some(match self {
            Self::Demagnetised => decay(u0, high - low),
            Self::Cycled => samples.input[rows.start..rows.start + first_cycles(samples)[segment]?].to_vec(),
            Self::Continued => continued(samples, segment)?,
            Self::FromAbove => path(&[high], u0),
            Self::FromBelow => path(&[low], u0),
        })
    }
}

/// Returns the record with the histories that minimise `squares`, the Σ residual² of a fit. One history is chosen for
/// the first segment and one for all others, among the segments in `asked`.
pub(crate) fn with_histories<E>(
    samples: &Samples,
    asked: &[bool],
    squares: &mut dyn FnMut(&Samples) -> Result<f64, E>,
) -> Result<Samples, E> {
    let mut best = samples.clone();
    let mut least = squares(&best)?;
    for first in [true, false] {
        let known = best.clone();
        let enough = (1.0 - MIN_RMSE_DROP).powi(2) * least;
        for history in History::ALL {
            let mut after = known.clone();
            let mut is_new = false;
            for segment in (0..samples.segments.len()).filter(|i| asked[*i] && (*i == 0) == first) {
                if let Some(past) = history.past(&after, segment) {
                    (after.pasts[segment], is_new) = (past, true);
                }
            }
            if is_new {
                let left = squares(&after)?;
                if left < least.min(enough) {
                    (best, least) = (after, left);
                }
            }
        }
    }
    Ok(best)
}

/// Returns the drive before a segment that continues the previous one of the same file; `None` for the first.
pub(crate) fn continued(samples: &Samples, segment: usize) -> Option<Vec<f64>> {
    let last = segment.checked_sub(1)?;
    let of_one_file = samples.file_of_segment[last] == samples.file_of_segment[segment];
    let earlier = samples.pasts.get(last).into_iter().flatten();
    let drive = earlier.chain(&samples.input[samples.segments[last].clone()]);
    of_one_file.then(|| path(&in_force(drive), samples.input[samples.segments[segment].start]))
}

/// Returns the reversals of a drive from 0 V that a memory with wiping-out still contains at its end.
fn in_force<'a>(drive: impl Iterator<Item = &'a f64>) -> Vec<f64> {
    let mut turns: Vec<f64> = vec![0.0];
    for u in drive.copied() {
        // A continued motion is not a reversal. A motion beyond an earlier reversal wipes out that one and the one
        // after it.
        while let [.., a, b] = turns[..]
            && ((u - b) * (b - a) >= 0.0 || (turns.len() > 2 && (u - a) * (b - a) <= 0.0))
        {
            let continues = (u - b) * (b - a) >= 0.0;
            turns.truncate(turns.len() - if continues { 1 } else { 2 });
        }
        turns.push(u);
    }
    turns.remove(0);
    turns
}

/// Returns a drive that oscillates about `u0` with decreasing amplitude, as in demagnetisation \[V\].
fn decay(u0: f64, amplitude: f64) -> Vec<f64> {
    let turn = |k: usize| {
        let size = amplitude * (1.0 - k as f64 / DECAY_REVERSALS as f64);
        u0 + if k.is_multiple_of(2) { size } else { -size }
    };
    path(&(0..DECAY_REVERSALS).map(turn).collect::<Vec<f64>>(), u0)
}

/// Returns a drive from 0 V from reversal to reversal and towards `u0`, without `u0` itself.
fn path(turns: &[f64], u0: f64) -> Vec<f64> {
    let mut from = 0.0;
    let mut path = vec![from];
    for to in turns.iter().copied().chain([u0]) {
        path.extend((1..=ROWS_PER_REVERSAL).map(|i| from + (to - from) * i as f64 / ROWS_PER_REVERSAL as f64));
        from = to;
    }
    path.pop();
    path
}

/// Returns which segments start away from 0 V. Near 0 V the memory is that of rest.
pub(crate) fn away(samples: &Samples) -> Vec<bool> {
    let (low, high) = samples.input_range();
    let reach = low.abs().max(high.abs());
    samples.segments.iter().map(|s| samples.input[s.start].abs() > MINOR_SHARE * reach).collect()
}

/// Returns which segments have a larger error in their first rows than in other rows. `residual` is that of a fit
/// without those rows.
pub(crate) fn standing_out(samples: &Samples, residual: &[f64]) -> Vec<bool> {
    first_rows(samples, residual).iter().map(|rows| rows.stand_out()).collect()
}

/// Returns the segments as [`standing_out`] does. Near 0 V a segment counts only if the fit follows the hysteresis in
/// the other rows: they do not contain the first rise of a virgin actuator, and a fit without a missing effect may have
/// a larger error there.
pub(crate) fn standing_out_where_followed(samples: &Samples, residual: &[f64]) -> Vec<bool> {
    let accuracy = LAW_ACCURACY * rms(&samples.hysteresis().1);
    let rows = first_rows(samples, residual);
    let counts = |(rows, away): (&FirstRows, bool)| {
        let is_followed = away || rows.usual <= rows.count as f64 * accuracy * accuracy;
        is_followed && rows.stand_out()
    };
    rows.iter().zip(away(samples)).map(counts).collect()
}

/// Errors of a fit in the first rows of a segment, and in as many other rows \[Σ residual²\].
struct FirstRows {
    count: usize,
    squares: f64,
    usual: f64,
}

impl FirstRows {
    fn stand_out(&self) -> bool {
        self.squares >= MIN_RMSE_RATIO * MIN_RMSE_RATIO * self.usual
    }
}

fn first_rows(samples: &Samples, residual: &[f64]) -> Vec<FirstRows> {
    let windows = windows(samples);
    let centred = centre(samples, residual, &windows, &samples.blind);
    let of = |i: usize| {
        let start = samples.segments[i].start;
        let rows: Vec<usize> = (start..start + windows[i]).filter(|k| !samples.blind[*k]).collect();
        let squares = rows.iter().map(|k| centred[*k] * centred[*k]).sum();
        FirstRows { count: rows.len(), squares, usual: level(samples, &centred, &windows, i) }
    };
    (0..samples.segments.len()).map(of).collect()
}

/// A drive with the history of each segment before it.
pub(crate) struct WithPast {
    pub(crate) drive: Vec<f64>,
    pub(crate) segments: Vec<Range<usize>>,
    /// The rows that belong to the record.
    own: Vec<Range<usize>>,
}

impl WithPast {
    pub(crate) fn new(drive: &[f64], segments: &[Range<usize>], pasts: &[Vec<f64>]) -> Self {
        let mut all = Self { drive: Vec::with_capacity(drive.len()), segments: Vec::new(), own: Vec::new() };
        for (i, segment) in segments.iter().enumerate() {
            let start = all.drive.len();
            let past = pasts.get(i).map_or(&[][..], Vec::as_slice);
            all.drive.extend(past);
            all.drive.extend(&drive[segment.clone()]);
            all.segments.push(start..all.drive.len());
            all.own.push(start + past.len()..all.drive.len());
        }
        all
    }

    /// Returns the rows of the record from a column over all rows.
    pub(crate) fn own(&self, column: &[f64]) -> Vec<f64> {
        self.own.iter().flat_map(|rows| column[rows.clone()].iter().copied()).collect()
    }
}

/// Returns the columns with the indices `of` of a basis over a drive, each segment after its history.
pub(crate) fn columns(
    basis: &dyn Basis,
    of: Range<usize>,
    drive: &[f64],
    segments: &[Range<usize>],
    pasts: &[Vec<f64>],
    drag: &Drag,
) -> Vec<Vec<f64>> {
    if pasts.iter().all(Vec::is_empty) {
        return basis.columns(of, drive, segments, drag);
    }
    let all = WithPast::new(drive, segments, pasts);
    let columns = basis.columns(of, &all.drive, &all.segments, drag);
    columns.iter().map(|column| all.own(column)).collect()
}

/// Returns `Σᵢ wᵢ φᵢ` over a drive, each segment after its history, if that takes less work than the columns.
pub(crate) fn combined(
    basis: &dyn Basis,
    weights: &[f64],
    drive: &[f64],
    segments: &[Range<usize>],
    pasts: &[Vec<f64>],
    drag: &Drag,
) -> Option<Vec<f64>> {
    if pasts.iter().all(Vec::is_empty) {
        return basis.combined(weights, drive, segments, drag);
    }
    let all = WithPast::new(drive, segments, pasts);
    basis.combined(weights, &all.drive, &all.segments, drag).map(|v| all.own(&v))
}

/// Returns the drive history of each segment after which a fit follows its first rows [`Candidates::best`]; empty for
/// segments that are not in `asked`. About 340 combinations of reversals are tried over the start-up window, at most
/// half of the segment. `residual` is that of the fit in all rows; `surely` marks the segments in which a memory other
/// than rest is expected.
///
/// # Errors
/// If a stage of the fit cannot be built.
pub(crate) fn recalled(
    problem: &Problem<'_>,
    fitted: &Fitted,
    residual: &[f64],
    asked: &[bool],
    surely: &[bool],
) -> Result<Vec<Vec<f64>>, Error> {
    let samples = problem.samples;
    let (windows, cycles) = (windows(samples), first_cycles(samples));
    let centred = centre(samples, residual, &windows, &samples.blind);
    let of_segment = |i: usize| -> Result<Vec<f64>, Error> {
        let (start, window) = (samples.segments[i].start, windows[i]);
        if window == 0 || !asked[i] {
            return Ok(Vec::new());
        }
        let beginning = samples.beginning(i, window);
        // The residual changes only by the change of the motion.
        let motion = |past: &[f64]| {
            let after = Samples { pasts: vec![past.to_vec()], ..beginning.clone() };
            problem.motion_in(fitted, &after)
        };
        let level = level(samples, &centred, &windows, i);
        let now = motion(&beginning.pasts[0])?;
        let squares = |past: &[f64]| {
            let left = motion(past).ok()?;
            let left = now.iter().zip(left).zip(&centred[start..start + window]).zip(&beginning.blind);
            Some(left.filter(|(_, blind)| !**blind).map(|(((now, then), r), _)| (r + now - then).powi(2)).sum::<f64>())
        };
        let mut candidates = Candidates::new(samples.input[start], samples.input_range());
        // Or the device was cycled before as in the segment itself.
        let others = cycles[i].map(|rows| samples.input[start..start + rows].to_vec()).into_iter();
        let others = others.chain(continued(samples, i));
        let known = beginning.pasts.iter().filter(|past| !past.is_empty()).cloned();
        others.chain(known).for_each(|past| candidates.add(past));
        Ok(candidates.best(level, surely[i], |past| squares(past).unwrap_or(f64::INFINITY)))
    };
    (0..asked.len()).map(of_segment).collect()
}

/// Returns the `new` history of each segment, or the old one where that is empty.
pub(crate) fn kept(old: &[Vec<f64>], new: Vec<Vec<f64>>) -> Vec<Vec<f64>> {
    new.into_iter().zip(old).map(|(new, old)| if new.is_empty() { old.clone() } else { new }).collect()
}

/// Returns the Σ residual² that the start-up window of a segment would have with the mean square of the rows outside of
/// all windows. `centred` is the residual without the sensor's zero.
pub(crate) fn level(samples: &Samples, centred: &[f64], windows: &[usize], segment: usize) -> f64 {
    let others = samples.segments.iter().zip(windows).flat_map(|(s, w)| s.start + w..s.end);
    let others = others.filter(|k| !samples.blind[*k]).map(|k| centred[k] * centred[k]);
    let (sum, rows) = others.fold((0.0, 0usize), |(sum, rows), square| (sum + square, rows + 1));
    let start = samples.segments[segment].start;
    let own = (start..start + windows[segment]).filter(|k| !samples.blind[*k]).count();
    sum * own as f64 / rows.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::{PiBasis, PreisachBasis};
    use crate::fit::{FitOptions, fit_settled};

    const PAST: [f64; 3] = [0.0, 95.0, 20.0];

    /// A record of a few play operators that were driven up and back before the record starts at 45 V; later the drive
    /// covers the whole range.
    fn samples() -> Samples {
        let turns = [45.0, 70.0, 30.0, 60.0, 5.0, 100.0, 0.0, 90.0, 10.0, 100.0, 0.0, 60.0];
        let leg = |pair: &[f64]| {
            let (from, to) = (pair[0], pair[1]);
            (0..150).map(move |i| from + (to - from) * f64::from(i) / 150.0).collect::<Vec<_>>()
        };
        let input: Vec<f64> = turns.windows(2).flat_map(leg).collect();
        let whole = std::slice::from_ref(&(0..input.len())).to_vec();
        let plays =
            PiBasis { thresholds: vec![8.0, 17.0, 31.0, 42.0], floor: 0.0, virgin: f64::INFINITY, falls: false };
        let past = path(&PAST[1..], 45.0);
        let columns = columns(&plays, 0..5, &input, &whole, &[past], &Drag::NONE);
        let noise = |k: usize| 0.005 * (1e3 * (k as f64).sin()).sin();
        let weights = [0.1, 0.02, 0.015, 0.02, 0.01];
        let output = (0..input.len())
            .map(|k| columns.iter().zip(weights).map(|(c, w)| w * c[k]).sum::<f64>() + noise(k))
            .collect();
        Samples::of_columns(1e-3, input, output)
    }

    #[test]
    fn a_drive_history_acts_like_the_same_drive_in_a_record() {
        let samples = samples();
        let past = path(&PAST[1..], 45.0);
        assert!(past[0] == 0.0 && past.last().is_some_and(|u| (20.0..45.0).contains(u)), "{past:?}");
        let with: Vec<f64> = past.iter().chain(&samples.input).copied().collect();
        let all = std::slice::from_ref(&(0..with.len())).to_vec();
        for basis in [&PiBasis::for_samples(&samples) as &dyn Basis, &PreisachBasis::for_samples(&samples, 8)] {
            let of = 0..basis.len();
            let pasts = std::slice::from_ref(&past);
            let own = columns(basis, of.clone(), &samples.input, &samples.segments, pasts, &Drag::NONE);
            let whole = basis.columns(of, &with, &all, &Drag::NONE);
            assert!(own.iter().zip(&whole).all(|(own, whole)| *own == whole[past.len()..]));
        }
    }

    /// With the drive history, no row is a start-up row on either base.
    #[test]
    fn a_record_that_begins_in_mid_cycle_is_followed_from_its_first_row() {
        for kind in 0..2 {
            let mut samples = samples();
            let bases: [Box<dyn Basis>; 2] =
                [Box::new(PiBasis::for_samples(&samples)), Box::new(PreisachBasis::for_samples(&samples, 12))];
            let (fitted, left) =
                fit_settled(&mut samples, bases[kind].as_ref(), &FitOptions::default(), &String::new).unwrap();
            assert!(!samples.pasts[0].is_empty() && samples.settling.iter().all(|s| !s), "{kind}: {:?}", samples.pasts);
            // The noise is at most 5 nm; the thresholds of the base differ from those of the actuator.
            let largest = left.iter().fold(0.0, |m: f64, r| m.max(r.abs()));
            assert!(largest < 0.1, "{kind}: {largest}, RMSE {}", fitted.rmse());
        }
    }

    #[test]
    fn a_memory_keeps_the_reversals_that_were_not_exceeded_later() {
        let kept = |drive: &[f64]| in_force(drive.iter());
        assert_eq!(kept(&[1.0, 2.0, 5.0, 3.0, 4.0]), [5.0, 3.0, 4.0]);
        // A closed loop is wiped out, wherever it is in the drive.
        assert_eq!(kept(&[5.0, 3.0, 4.0, 2.0, 4.5]), [5.0, 2.0, 4.5]);
        assert_eq!(kept(&[5.0, 3.0, 4.0, 2.0, 6.0]), [6.0]);
        assert_eq!(kept(&[]), [0.0; 0]);
    }

    /// The reversals in force have the same effect as the whole drive.
    #[test]
    fn the_reversals_in_force_replace_the_whole_drive() {
        let drive: Vec<f64> =
            (0..900).map(|k| 50.0 + 45.0 * (0.05 * f64::from(k)).sin() * (0.011 * f64::from(k)).cos()).collect();
        let (u0, after) = (drive[899], [70.0, 30.0, 60.0]);
        let whole: Vec<f64> = drive.iter().chain(&after).copied().collect();
        let short: Vec<f64> = path(&in_force(drive.iter()), u0).into_iter().chain([u0]).chain(after).collect();
        let plays =
            PiBasis { thresholds: vec![4.0, 11.0, 23.0, 46.0], floor: 0.0, virgin: f64::INFINITY, falls: false };
        let last = |drive: &[f64]| {
            let columns = plays.columns(0..5, drive, std::slice::from_ref(&(0..drive.len())), &Drag::NONE);
            columns.iter().map(|c| c[drive.len() - 1]).collect::<Vec<_>>()
        };
        assert_eq!(last(&whole), last(&short));
    }

    /// Two segments of one drive, the second starting where the first ends. This history is found among the others.
    #[test]
    fn a_segment_that_continues_the_previous_one_is_recognised() {
        let u = |k: usize| 50.0 + 45.0 * (0.02 * k as f64).sin() * (1.0 - k as f64 / 1600.0);
        let input: Vec<f64> = (0..1200).map(u).collect();
        let whole = std::slice::from_ref(&(0..1200)).to_vec();
        let plays =
            PiBasis { thresholds: vec![6.0, 15.0, 30.0, 40.0], floor: 0.0, virgin: f64::INFINITY, falls: false };
        let columns = plays.columns(0..5, &input, &whole, &Drag::NONE);
        let output = (0..1200).map(|k| columns.iter().map(|c| 0.05 * c[k]).sum()).collect();
        let samples = Samples {
            segments: vec![0..700, 700..1200],
            file_of_segment: vec![0, 0],
            pasts: vec![Vec::new(); 2],
            ..Samples::of_columns(1e-3, input, output)
        };
        let squares = |samples: &Samples| {
            let Samples { input, segments, pasts, .. } = samples;
            let columns = columns_after(&plays, input, segments, pasts);
            (0..1200)
                .map(|k| (samples.output[k] - columns.iter().map(|c| 0.05 * c[k]).sum::<f64>()).powi(2))
                .sum::<f64>()
        };
        let best = with_histories(&samples, &[false, true], &mut |samples| Ok::<_, ()>(squares(samples))).unwrap();
        assert_eq!(best.pasts, [Vec::new(), continued(&samples, 1).unwrap()]);
        assert!(squares(&best) < 1e-3 * squares(&samples));
        // A segment of another file is not continued.
        assert!(continued(&Samples { file_of_segment: vec![0, 1], ..samples }, 1).is_none());
    }

    fn columns_after(plays: &PiBasis, drive: &[f64], segments: &[Range<usize>], pasts: &[Vec<f64>]) -> Vec<Vec<f64>> {
        columns(plays, 0..5, drive, segments, pasts, &Drag::NONE)
    }

    #[test]
    fn a_drive_history_near_rest_has_to_explain_the_whole_error() {
        let near = Candidates { u0: 0.0, step: 0.0, reversals: Vec::new(), others: vec![vec![1.0], vec![2.0]] };
        let squares = |past: &[f64]| match past.first() {
            None => 100.0,
            Some(past) if *past == 1.0 => 9.0,
            Some(_) => 40.0,
        };
        assert_eq!(near.best(1.0, true, squares), [1.0]);
        assert!(near.best(1.0, false, squares).is_empty(), "nine times the level");
        assert_eq!(near.best(8.0, false, squares), [1.0]);
        assert!(near.best(60.0, true, squares).is_empty(), "the first rows have no larger error");
    }

    #[test]
    fn a_reversal_between_two_levels_is_found() {
        let candidates = Candidates::new(10.0, (0.0, 120.0));
        let squares = |past: &[f64]| {
            let levels: Vec<f64> = past.iter().skip(ROWS_PER_REVERSAL).step_by(ROWS_PER_REVERSAL).copied().collect();
            if let [first, second] = levels[..] { (first - 77.3).powi(2) + (second + 21.9).powi(2) } else { 1e4 }
        };
        let past = candidates.best(1e-3, false, squares);
        let (first, second) = (past[ROWS_PER_REVERSAL], past[2 * ROWS_PER_REVERSAL]);
        assert!((first - 77.3).abs() < 0.1 && (second + 21.9).abs() < 0.1, "{past:?}");
    }

    /// An actuator at 0 V also remembers an earlier drive. The amplitude falls, so only the first rise shows the lower
    /// half.
    #[test]
    fn a_record_that_begins_at_0_v_after_use_is_followed_from_its_first_row() {
        let input: Vec<f64> =
            (0..3000).map(|k| 50.0 - 50.0 * (1.0 - f64::from(k) / 4000.0) * (f64::from(k) / 80.0).cos()).collect();
        let plays =
            PiBasis { thresholds: vec![8.0, 17.0, 31.0, 42.0], floor: 0.0, virgin: f64::INFINITY, falls: false };
        let whole = std::slice::from_ref(&(0..input.len())).to_vec();
        let columns = columns_after(&plays, &input, &whole, &[path(&[100.0], 0.0)]);
        let noise = |k: usize| 0.02 * (1e3 * (k as f64).sin()).sin();
        let output = (0..input.len()).map(|k| columns.iter().map(|c| 0.05 * c[k]).sum::<f64>() + noise(k)).collect();
        let mut samples = Samples::of_columns(1e-3, input, output);
        let basis = PiBasis::for_samples(&samples);
        let (fitted, _) = fit_settled(&mut samples, &basis, &FitOptions::default(), &String::new).unwrap();
        assert!(!samples.pasts[0].is_empty());
        assert!(samples.settling.iter().all(|s| !s));
        let hysteresis = rms(&samples.hysteresis().1);
        assert!(fitted.rmse() < LAW_ACCURACY * hysteresis, "{} of {hysteresis}", fitted.rmse());
    }

    #[test]
    fn a_record_from_rest_needs_no_drive_history() {
        let input: Vec<f64> = (0..2000).map(|k| 50.0 - 50.0 * (f64::from(k) / 80.0).cos()).collect();
        let plays = PiBasis { thresholds: vec![8.0, 17.0, 31.0], floor: 0.0, virgin: f64::INFINITY, falls: false };
        let whole = std::slice::from_ref(&(0..input.len())).to_vec();
        let columns = plays.columns(0..4, &input, &whole, &Drag::NONE);
        let output = (0..input.len()).map(|k| columns.iter().map(|c| 0.05 * c[k]).sum()).collect();
        let mut samples = Samples::of_columns(1e-3, input, output);
        let basis = PiBasis::for_samples(&samples);
        fit_settled(&mut samples, &basis, &FitOptions::default(), &String::new).unwrap();
        assert!(samples.pasts[0].is_empty());
    }
}
