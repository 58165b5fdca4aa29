//! Creep that began before a record and continues in it.
//!
//! The creep of a model begins at rest. If the actuator was moved before the record, it still creeps: an element whose
//! state differs from rest by `x(0) − v(0)` adds `c (x(0) − v(0)) exp(−t/τ)` to its output from rest. This is an
//! initial condition, like the memory of the hysteresis and the phase of a tone. It is estimated from the first rows of
//! a segment, if they show it, and used for all later rows. The estimate has one number: the distance of the earlier
//! rest level. The end of the earlier motion before the segment is chosen from three times; with a longer time the fast
//! elements are at rest.

use hyst_core::CreepParams;

use crate::Samples;
use crate::settle::{start_up_rows, windows};

/// The beginning of a segment is this fraction of its rows: 1/10.
const BEGINNING_DIVISOR: usize = 10;
/// Fewest rows of the beginning.
const MIN_BEGINNING_ROWS: usize = 10;
/// Smallest share of the sum of squares of the beginning that the continued creep must explain.
const MIN_EXPLAINED_SHARE: f64 = 0.5;

/// The creep that continues from before each segment.
pub(crate) struct Rest {
    /// Its contribution to the output in each row \[y\].
    pub(crate) added: Vec<f64>,
    /// Rest level before each segment minus the output in its first row \[y\]; 0 if the first rows show no continued
    /// creep.
    pub(crate) away: Vec<f64>,
}

/// The data from which the continued creep is estimated.
#[derive(Clone, Copy)]
pub(crate) struct Estimate<'a> {
    pub(crate) samples: &'a Samples,
    pub(crate) creep: &'a CreepParams<Vec<f64>>,
    /// Span of the motion \[y\], which limits the rest level.
    pub(crate) span: f64,
    /// Whether the zero is known. Otherwise a constant is fitted too.
    pub(crate) zero_is_known: bool,
}

impl Estimate<'_> {
    /// Estimates the continued creep. Returns it with the new residual and start-up rows; `residual` is the residual
    /// without it.
    ///
    /// Continued creep looks like a start-up transient. It is therefore estimated without the `settling` rows and with
    /// them, and each segment takes the better estimate.
    pub(crate) fn continued(&self, residual: &[f64], settling: &[bool]) -> (Rest, Vec<f64>, Vec<bool>) {
        let remaining = |rest: &Rest| {
            let remains: Vec<f64> = residual.iter().zip(&rest.added).map(|(r, added)| r - added).collect();
            let starts = start_up_rows(self.samples, &remains);
            (remains, starts)
        };
        let mut best = self.rest(residual, settling);
        let (mut remains, mut starts) = remaining(&best);
        if settling != self.samples.settling {
            let other = self.rest(residual, &self.samples.settling);
            let (others, other_starts) = remaining(&other);
            if self.take_better(&mut best, &other, [(&remains, &starts), (&others, &other_starts)]) {
                (remains, starts) = remaining(&best);
            }
        }
        (best, remains, starts)
    }

    /// Estimates the continued creep from the first rows of each segment: 1/10 of the segment, or the longest start-up.
    /// `settling` rows are ignored.
    fn rest(&self, residual: &[f64], settling: &[bool]) -> Rest {
        let samples = self.samples;
        let mut rest = Rest { added: vec![0.0; samples.len()], away: vec![0.0; samples.segments.len()] };
        for ((i, segment), window) in samples.segments.iter().enumerate().zip(windows(samples)) {
            let Some(begins) = segment.clone().find(|k| !settling[*k]) else { continue };
            let tenth = (segment.len() / BEGINNING_DIVISOR).max(MIN_BEGINNING_ROWS);
            let rows = begins..(begins + tenth).max(segment.start + window).min(segment.end);
            let period = samples.period_of(i);
            let moved_before = [0.0, tenth as f64 * period, rows.len() as f64 * period];
            let shown = moved_before.map(|before| {
                let column = column(self.creep, before, period, rows.end - segment.start);
                let counts = rows.clone().filter(|k| !settling[*k]);
                let pairs: Vec<(f64, f64)> = counts.map(|k| (column[k - segment.start], residual[k])).collect();
                self.explained(&pairs).map(|(away, share)| (share, away, before))
            });
            let best = shown.into_iter().flatten().max_by(|a, b| a.0.total_cmp(&b.0));
            let Some((_, away, before)) = best.filter(|(share, ..)| *share >= MIN_EXPLAINED_SHARE) else { continue };
            rest.away[i] = away;
            let column = column(self.creep, before, period, segment.len());
            rest.added[segment.clone()].iter_mut().zip(column).for_each(|(added, x)| *added = away * x);
        }
        rest
    }

    /// Fits the amplitude of the continued creep to pairs of its unit response and the residual.
    ///
    /// Returns the amplitude and the share of the sum of squares that it explains. A constant is fitted too if the zero
    /// is not known.
    fn explained(&self, pairs: &[(f64, f64)]) -> Option<(f64, f64)> {
        let count = pairs.len().max(1) as f64;
        let mean_of = |sum: f64| if self.zero_is_known { 0.0 } else { sum / count };
        let (mean, shift) = (mean_of(pairs.iter().map(|p| p.0).sum()), mean_of(pairs.iter().map(|p| p.1).sum()));
        let all: f64 = pairs.iter().map(|(_, r)| (r - shift).powi(2)).sum();
        let (away, explained) = fitted(pairs.iter().map(|(x, r)| (x - mean, r - shift)), self.span)?;
        (all > 0.0).then(|| (away, explained / all))
    }

    /// Takes the estimate `other` for each segment in which it gives fewer start-up rows and no larger error in the
    /// rows that are not a start-up for either estimate. Returns whether there is such a segment. Each estimate has its
    /// residual and start-up rows.
    fn take_better(
        &self,
        rest: &mut Rest,
        other: &Rest,
        [(own_residual, own_starts), (residual, starts)]: [(&[f64], &[bool]); 2],
    ) -> bool {
        let mut any = false;
        for (i, segment) in self.samples.segments.iter().enumerate() {
            let count = |starts: &[bool]| starts[segment.clone()].iter().filter(|s| **s).count();
            let squares = |residual: &[f64]| {
                let rows = segment.clone().filter(|k| !own_starts[*k] && !starts[*k]);
                let rows: Vec<f64> = rows.map(|k| residual[k]).collect();
                let mean = if self.zero_is_known { 0.0 } else { rows.iter().sum::<f64>() / rows.len().max(1) as f64 };
                rows.iter().map(|r| (r - mean).powi(2)).sum::<f64>()
            };
            if count(starts) < count(own_starts) && squares(residual) <= squares(own_residual) {
                rest.away[i] = other.away[i];
                rest.added[segment.clone()].copy_from_slice(&other.added[segment.clone()]);
                any = true;
            }
        }
        any
    }
}

/// Returns the remaining creep in each row after a unit step that ended `before` seconds before the first row.
pub(crate) fn column(creep: &CreepParams<Vec<f64>>, before: f64, period: f64, rows: usize) -> Vec<f64> {
    let remaining =
        |seconds: f64| creep.shares.iter().zip(&creep.seconds).map(|(c, tau)| c * (-seconds / tau).exp()).sum();
    (0..rows).map(|k| remaining(before + k as f64 * period)).collect()
}

/// Returns for pairs (x, r) the factor within ±`span` that minimises Σ (r − factor x)², and the reduction from Σ r²;
/// `None` if all x are 0.
pub(crate) fn fitted(pairs: impl Iterator<Item = (f64, f64)>, span: f64) -> Option<(f64, f64)> {
    let (own, with) = pairs.fold((0.0, 0.0), |(own, with), (x, r)| (own + x * x, with + x * r));
    let factor = (own > 0.0).then(|| (with / own).clamp(-span, span))?;
    Some((factor, factor * (2.0 * with - factor * own)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_segment_takes_the_better_estimate() {
        let mut samples = Samples::of_columns(0.01, vec![0.0; 40], vec![0.0; 40]);
        samples.segments = vec![0..20, 20..40];
        let rest = |away: [f64; 2]| Rest { added: (0..40).map(|k| away[k / 20]).collect(), away: away.to_vec() };
        let starts = |rows: [usize; 2]| (0..40).map(|k| k % 20 < rows[k / 20]).collect::<Vec<bool>>();
        // Ramps with these slopes per row and any offset.
        let ramps = |of: [f64; 2]| (0..40).map(|k| 5.0 + of[k / 20] * (k % 20) as f64).collect::<Vec<f64>>();
        let mut own = rest([1.0, 2.0]);
        let creep = CreepParams { seconds: Vec::new(), shares: Vec::new() };
        let estimate = Estimate { samples: &samples, creep: &creep, span: 1.0, zero_is_known: false };
        let with = [(&ramps([1.0, 1.0])[..], &starts([5, 5])[..]), (&ramps([0.9, 1.1]), &starts([0, 0]))];
        assert!(estimate.take_better(&mut own, &rest([3.0, 4.0]), with));
        assert_eq!((own.away[0], own.added[0]), (3.0, 3.0), "fewer start-up rows and a smaller error");
        assert_eq!((own.away[1], own.added[39]), (2.0, 2.0), "a larger error");
        let same = [(&ramps([1.0, 1.0])[..], &starts([0, 5])[..]), (&ramps([0.5, 0.5]), &starts([0, 5]))];
        assert!(!estimate.take_better(&mut own, &rest([7.0, 7.0]), same), "as many start-up rows");
    }

    #[test]
    fn continued_creep_is_estimated_from_the_first_rows() {
        let creep = CreepParams { seconds: vec![0.5, 5.0, 50.0], shares: vec![0.01, 0.02, 0.02] };
        let mut samples = Samples::of_columns(0.01, vec![0.0; 4000], vec![0.0; 4000]);
        samples.segments = vec![0..2000, 2000..4000];
        samples.file_of_segment = vec![0, 0];
        let settling = vec![false; 4000];
        let away = [30.0, 0.0];
        let noise = |k: usize| 0.02 * (k as f64 * 1.7).sin();
        let unit = column(&creep, 0.0, 0.01, 2000);
        let truth: Vec<f64> = (0..4000).map(|k| away[k / 2000] * unit[k % 2000]).collect();
        for zero in [0.0, 0.3] {
            let residual: Vec<f64> = truth.iter().enumerate().map(|(k, y)| y + noise(k) + zero).collect();
            let estimate = Estimate { samples: &samples, creep: &creep, span: 100.0, zero_is_known: zero == 0.0 };
            let rest = estimate.rest(&residual, &settling);
            assert!((rest.away[0] / 30.0 - 1.0).abs() < 0.05 && rest.away[1] == 0.0, "{:?}", rest.away);
            let worst = rest.added.iter().zip(&truth).fold(0.0, |worst: f64, (a, b)| worst.max((a - b).abs()));
            assert!(worst < 0.05, "{worst}");
        }
        let estimate = Estimate { samples: &samples, creep: &creep, span: 100.0, zero_is_known: false };
        let nowhere = estimate.rest(&vec![0.5; 4000], &settling);
        assert!(nowhere.added.iter().all(|y| *y == 0.0));
    }
}
