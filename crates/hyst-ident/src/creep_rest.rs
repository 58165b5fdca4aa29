//! The rest of a creep that began before a record.
//!
//! A model's creep begins at rest. An actuator that was moved before the record began still creeps towards where it then stood: an element that
//! is `x(0) − v(0)` away adds `c (x(0) − v(0)) exp(−t/τ)` to what it adds from rest. As the memory of the hysteresis and the phase of a tone, that is an
//! initial condition: where the first rows of a segment show it, it is taken from them, and all later rows are predicted with it. One number stands for
//! it: how far away the level was at which the actuator had rested, a time before the segment that lets the quick elements come to rest or does not.

use std::ops::Range;

use hyst_core::CreepParams;

use crate::Samples;
use crate::settle::{start_up_rows, windows};

/// Share of a segment's rows that its beginning is, and fewest rows.
const BEGINNING: usize = 10;
const FEWEST: usize = 10;
/// Share of the squares of the beginning that the rest has to take.
const LEAST_SHARE: f64 = 0.5;

/// What is left of a creep.
pub(crate) struct Rest {
    /// What it adds in each row \[y\].
    pub(crate) added: Vec<f64>,
    /// How far away the level was at which the actuator had rested before each segment \[y\]; 0 where the first rows do not show that it was.
    pub(crate) away: Vec<f64>,
}

impl Rest {
    /// Takes that of the other for each segment in which fewer rows are a start-up with it and which it follows as well in the rows that are a
    /// start-up for neither; whether there is any. Each comes with its residual and its start-up rows. `zero_is_known` unless a constant is taken from
    /// the record.
    fn take_better(
        &mut self,
        other: &Self,
        samples: &Samples,
        [(own_residual, own_starts), (residual, starts)]: [(&[f64], &[bool]); 2],
        zero_is_known: bool,
    ) -> bool {
        let mut any = false;
        for (i, segment) in samples.segments.iter().enumerate() {
            let count = |starts: &[bool]| starts[segment.clone()].iter().filter(|s| **s).count();
            let rows = || segment.clone().filter(|k| !own_starts[*k] && !starts[*k]);
            let squares = |residual: &[f64]| {
                let rows: Vec<f64> = rows().map(|k| residual[k]).collect();
                let mean = if zero_is_known { 0.0 } else { rows.iter().sum::<f64>() / rows.len().max(1) as f64 };
                rows.iter().map(|r| (r - mean).powi(2)).sum::<f64>()
            };
            if count(starts) < count(own_starts) && squares(residual) <= squares(own_residual) {
                self.away[i] = other.away[i];
                self.added[segment.clone()].copy_from_slice(&other.added[segment.clone()]);
                any = true;
            }
        }
        any
    }
}

/// What is left of a creep, with the residual and the start-up rows that remain with it. A creep that continues looks like a start-up: the rows that are
/// `settling` may be those that show it, so that it is estimated without them and with them.
pub(crate) fn continued(
    samples: &Samples,
    creep: &CreepParams<Vec<f64>>,
    residual: &[f64],
    settling: &[bool],
    span: f64,
    zero_is_known: bool,
) -> (Rest, Vec<f64>, Vec<bool>) {
    let remaining = |rest: &Rest| -> (Vec<f64>, Vec<bool>) {
        let remains: Vec<f64> = residual.iter().zip(&rest.added).map(|(r, added)| r - added).collect();
        let settling = start_up_rows(samples, &remains);
        (remains, settling)
    };
    let shown_by = |hidden: &[bool]| rest(samples, creep, residual, hidden, span, zero_is_known);
    let mut best = shown_by(settling);
    let (mut remains, mut starts) = remaining(&best);
    if settling != samples.settling {
        let other = shown_by(&samples.settling);
        let (others, other_starts) = remaining(&other);
        let with_residuals = [(&remains[..], &starts[..]), (&others, &other_starts)];
        if best.take_better(&other, samples, with_residuals, zero_is_known) {
            (remains, starts) = remaining(&best);
        }
    }
    (best, remains, starts)
}

/// What is left of a creep, by what the first rows of each segment show: a tenth of it, or as many as a start-up can last. `residual` is what the model leaves from rest, `span` that of its motion
/// \[y\]; rows that are `settling` do not count. `zero_is_known` unless a constant is taken from the record.
fn rest(
    samples: &Samples,
    creep: &CreepParams<Vec<f64>>,
    residual: &[f64],
    settling: &[bool],
    span: f64,
    zero_is_known: bool,
) -> Rest {
    let windows = windows(samples);
    let mut rest = Rest { added: vec![0.0; samples.len()], away: vec![0.0; samples.segments.len()] };
    for (i, segment) in samples.segments.iter().enumerate() {
        let Some(begins) = segment.clone().find(|k| !settling[*k]) else { continue };
        let tenth = (segment.len() / BEGINNING).max(FEWEST);
        let rows = begins..(begins + tenth).max(segment.start + windows[i]).min(segment.end);
        let period = samples.period_of(i);
        let moved_before = [0.0, tenth as f64 * period, rows.len() as f64 * period];
        let shown = moved_before.map(|before| {
            let at = |k: usize| left_of(creep, before + (k - segment.start) as f64 * period);
            shown(residual, settling, rows.clone(), &at, span, zero_is_known).map(|(away, share)| (share, away, before))
        });
        let best = shown.into_iter().flatten().max_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, away, before)) = best.filter(|(share, ..)| *share >= LEAST_SHARE) else { continue };
        rest.away[i] = away;
        for k in segment.clone() {
            rest.added[k] = away * left_of(creep, before + (k - segment.start) as f64 * period);
        }
    }
    rest
}

/// Σ residual² of some first rows of a segment, each with its time from the first one \[s\], less what the rest of a creep takes of it at most.
pub(crate) fn squares_without(creep: &CreepParams<Vec<f64>>, rows: &[(f64, f64)], span: f64) -> f64 {
    let (mut own, mut with, mut all) = (0.0, 0.0, 0.0);
    for (seconds, r) in rows {
        let x = left_of(creep, *seconds);
        own += x * x;
        with += x * r;
        all += r * r;
    }
    let away = if own > 0.0 { (with / own).clamp(-span, span) } else { 0.0 };
    all + away * (away * own - 2.0 * with)
}

/// What a step of one unit this time ago \[s\] still lacks.
fn left_of(creep: &CreepParams<Vec<f64>>, seconds: f64) -> f64 {
    creep.shares.iter().zip(&creep.seconds).map(|(c, tau)| c * (-seconds / tau).exp()).sum()
}

/// The factor, at most `span`, at which a column takes most of the squares of some rows, and the share that it takes of them; beside a constant where
/// the zero is not known.
fn shown(
    residual: &[f64],
    settling: &[bool],
    rows: Range<usize>,
    column: &dyn Fn(usize) -> f64,
    span: f64,
    zero_is_known: bool,
) -> Option<(f64, f64)> {
    let rows: Vec<usize> = rows.filter(|k| !settling[*k]).collect();
    let mean_of = |of: &dyn Fn(usize) -> f64| match zero_is_known {
        true => 0.0,
        false => rows.iter().map(|k| of(*k)).sum::<f64>() / rows.len() as f64,
    };
    let (shift, mean) = (mean_of(&|k| residual[k]), mean_of(column));
    let (mut own, mut with, mut all) = (0.0, 0.0, 0.0);
    for k in rows {
        let (x, r) = (column(k) - mean, residual[k] - shift);
        own += x * x;
        with += x * r;
        all += r * r;
    }
    // It rested somewhere within its own motion.
    let away = (with / own).clamp(-span, span);
    (own > 0.0 && all > 0.0).then(|| (away, away * (2.0 * with - away * own) / all))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_segment_takes_the_rest_that_follows_it() {
        let mut samples = Samples::of_columns(0.01, vec![0.0; 40], vec![0.0; 40]);
        samples.segments = vec![0..20, 20..40];
        let rest = |away: [f64; 2]| Rest { added: (0..40).map(|k| away[k / 20]).collect(), away: away.to_vec() };
        let starts = |rows: [usize; 2]| (0..40).map(|k| k % 20 < rows[k / 20]).collect::<Vec<bool>>();
        // A ramp of this height a row about any level.
        let ramps = |of: [f64; 2]| (0..40).map(|k| 5.0 + of[k / 20] * (k % 20) as f64).collect::<Vec<f64>>();
        let mut own = rest([1.0, 2.0]);
        let is_other = own.take_better(
            &rest([3.0, 4.0]),
            &samples,
            [(&ramps([1.0, 1.0]), &starts([5, 5])), (&ramps([0.9, 1.1]), &starts([0, 0]))],
            false,
        );
        assert!(is_other);
        assert_eq!((own.away[0], own.added[0]), (3.0, 3.0), "fewer rows are a start-up, and it errs less");
        assert_eq!((own.away[1], own.added[39]), (2.0, 2.0), "it errs more");
        let same = [(&ramps([1.0, 1.0])[..], &starts([0, 5])[..]), (&ramps([0.5, 0.5]), &starts([0, 5]))];
        assert!(!own.take_better(&rest([7.0, 7.0]), &samples, same, false), "as many rows are a start-up");
    }

    #[test]
    fn the_first_rows_say_how_far_a_creep_was_from_rest() {
        let creep = CreepParams { seconds: vec![0.5, 5.0, 50.0], shares: vec![0.01, 0.02, 0.02] };
        let mut samples = Samples::of_columns(0.01, vec![0.0; 4000], vec![0.0; 4000]);
        samples.segments = vec![0..2000, 2000..4000];
        samples.file_of_segment = vec![0, 0];
        let settling = vec![false; 4000];
        let away = [30.0, 0.0];
        let noise = |k: usize| 0.02 * (k as f64 * 1.7).sin();
        let truth: Vec<f64> = (0..4000).map(|k| away[k / 2000] * left_of(&creep, 0.01 * (k % 2000) as f64)).collect();
        for zero in [0.0, 0.3] {
            let residual: Vec<f64> = truth.iter().enumerate().map(|(k, y)| y + noise(k) + zero).collect();
            let rest = rest(&samples, &creep, &residual, &settling, 100.0, zero == 0.0);
            assert!((rest.away[0] / 30.0 - 1.0).abs() < 0.05 && rest.away[1] == 0.0, "{:?}", rest.away);
            let worst = rest.added.iter().zip(&truth).fold(0.0, |worst: f64, (a, b)| worst.max((a - b).abs()));
            assert!(worst < 0.05, "{worst}");
        }
        let nowhere = rest(&samples, &creep, &vec![0.5; 4000], &settling, 100.0, false);
        assert!(nowhere.added.iter().all(|y| *y == 0.0));
    }
}
