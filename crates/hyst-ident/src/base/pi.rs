//! The Prandtl-Ishlinskii operator as columns: the identity and play operators.

use std::ops::Range;

use hyst_core::play;
use nalgebra::DMatrix;

use super::choice::{self, Bank, CANDIDATES};
use super::past::WithPast;
use super::{Basis, Drag, SIDE_BY_SIDE, with_sign};
use crate::Samples;
use crate::lsq::{self, Bounds};

/// Number of play operators with thresholds inside the record's swing.
const LOOPS: usize = 15;
/// Number of play operators that only the first rise from virgin memory reaches.
const VIRGIN: usize = 5;
/// Minimum of p₀, as a share of the mean gain: the inverse then amplifies by at most 20.
const MIN_GAIN_SHARE: f64 = 0.05;
/// Maximum weight of a play operator that only the first rise from rest moves, in mean gains. Only those rows separate
/// its weight from the sensor's zero, and they may be start-up rows.
const MAX_VIRGIN_WEIGHT: f64 = 2.0;
/// Step of the difference quotients along a threshold, as a share of the input.
const STEP: f64 = 1e-6;

/// Play operators with fixed thresholds, and the minimum of p₀.
#[derive(Clone, Debug)]
pub(crate) struct PiBasis {
    pub(crate) thresholds: Vec<f64>,
    pub(crate) floor: f64,
    /// Threshold above which only the first rise from rest moves a play operator.
    pub(crate) virgin: f64,
    /// Whether the output falls while the operator rises: weights stay positive, columns change their sign.
    pub(crate) falls: bool,
}

impl PiBasis {
    /// Returns even thresholds over the range of the record's input: up to half its swing, and up to its largest
    /// magnitude for the first rise from rest.
    pub(crate) fn for_samples(samples: &Samples) -> Self {
        let (low, high) = samples.input_range();
        let gain = samples.output_span() / (high - low).max(f64::MIN_POSITIVE);
        let thresholds = even(samples, LOOPS, VIRGIN);
        Self { thresholds, floor: MIN_GAIN_SHARE * gain, virgin: 0.5 * (high - low), falls: samples.falls }
    }

    /// Returns a basis with a fraction `1/by` of the play operators.
    pub(crate) fn coarser(samples: &Samples, by: usize) -> Self {
        Self { thresholds: even(samples, LOOPS.div_ceil(by), VIRGIN.div_ceil(by)), ..Self::for_samples(samples) }
    }

    /// Returns a basis with twice as many play operators.
    pub(crate) fn finer(samples: &Samples) -> Self {
        Self { thresholds: even(samples, 2 * LOOPS, 2 * VIRGIN), ..Self::for_samples(samples) }
    }

    /// Returns at most `most` thresholds, chosen by the record. Without a number: thresholds that predict left-out
    /// parts of the record clearly better than these and are no more. Returns `None` if there are none. `through` maps
    /// the output of a play operator to the measured output.
    pub(crate) fn chosen(
        &self,
        samples: &Samples,
        drag: &Drag,
        through: &(dyn Fn(&mut [Vec<f64>]) + Sync),
        most: Option<usize>,
    ) -> Option<Self> {
        let all = WithPast::new(&samples.input, &samples.segments, &samples.pasts);
        let elements = |r: &[f64]| {
            let plays = plays(&all.drive, &all.segments, r, drag);
            let mut plays = with_sign(self.falls, plays.iter().map(|play| all.own(play)).collect());
            through(&mut plays);
            plays
        };
        let bank = |rows| {
            let mut identity = with_sign(self.falls, vec![samples.input.clone()]);
            through(&mut identity);
            let identity = identity.swap_remove(0);
            let candidates = even(samples, CANDIDATES, CANDIDATES / 4);
            Bank::new(samples, vec![(identity, Bounds::above(self.floor))], candidates, &elements, rows)
        };
        let quick = bank(choice::ROWS);
        let thresholds = most.map_or_else(|| quick.better_than(&self.thresholds), |most| quick.at_most(most))?;
        let thresholds = bank(lsq::ROWS).from(thresholds)?;
        Some(Self { thresholds, ..*self })
    }
}

/// Returns even thresholds: `loops` inside the swing of a record and, if it shows a first rise from rest beyond that,
/// `virgin` more.
fn even(samples: &Samples, loops: usize, virgin: usize) -> Vec<f64> {
    let (low, high) = samples.input_range();
    let (half, reach) = ((high - low) / 2.0, low.abs().max(high.abs()));
    let mut thresholds: Vec<f64> = (1..=loops).map(|i| half * i as f64 / (loops + 1) as f64).collect();
    // Only segments that start near rest show the virgin curve.
    let starts_at_rest = samples.segments.iter().any(|s| samples.input[s.start].abs() < 0.1 * reach);
    if starts_at_rest && reach > 1.05 * half {
        thresholds.extend((0..virgin).map(|i| half + (reach - half) * i as f64 / virgin as f64));
    }
    thresholds
}

impl Basis for PiBasis {
    fn columns(&self, of: Range<usize>, drive: &[f64], segments: &[Range<usize>], drag: &Drag) -> Vec<Vec<f64>> {
        let identity = of.contains(&0).then(|| drive.to_vec());
        let thresholds = &self.thresholds[of.start.max(1) - 1..of.end.max(1) - 1];
        with_sign(self.falls, identity.into_iter().chain(plays(drive, segments, thresholds, drag)).collect())
    }

    fn is_odd(&self) -> bool {
        true
    }

    fn is_zero_unless_moved(&self) -> bool {
        true
    }

    fn bounds(&self) -> Vec<Bounds> {
        let mut bounds = vec![Bounds::above(0.0); self.thresholds.len() + 1];
        bounds[0] = Bounds::above(self.floor);
        let steepest = MAX_VIRGIN_WEIGHT * self.floor / MIN_GAIN_SHARE;
        for (bound, _) in bounds[1..].iter_mut().zip(&self.thresholds).filter(|(_, r)| **r >= self.virgin) {
            bound.upper = steepest;
        }
        bounds
    }

    fn penalty(&self, level: f64) -> Option<DMatrix<f64>> {
        // Thresholds that the record hardly separates share their weight instead of alternating.
        let n = self.len();
        Some(DMatrix::from_diagonal_element(n, n, 1e-9 * level))
    }
}

/// Play operators with weights, and the derivatives of their output with respect to the thresholds: the columns of a
/// fit of both near an optimum.
pub(crate) struct PlaysWithSlopes<'a> {
    pub(crate) plays: &'a PiBasis,
    /// p₀, then the weights.
    pub(crate) weights: &'a [f64],
}

impl Basis for PlaysWithSlopes<'_> {
    fn columns(&self, of: Range<usize>, drive: &[f64], segments: &[Range<usize>], drag: &Drag) -> Vec<Vec<f64>> {
        let step = STEP * drive.iter().fold(0.0, |m: f64, u| m.max(u.abs()));
        let plain = self.plays.len();
        let slope = |i: usize| -> Vec<f64> {
            let (r, w) = (self.plays.thresholds[i], self.weights[i + 1]);
            let w = if self.plays.falls { -w } else { w };
            let (up, down) = (one_play(drive, segments, r + step, drag), one_play(drive, segments, r - step, drag));
            up.iter().zip(down).map(|(up, down)| 0.5 * w * (up - down) / step).collect()
        };
        let mut columns = self.plays.columns(of.start.min(plain)..of.end.min(plain), drive, segments, drag);
        columns.extend((of.start.max(plain)..of.end.max(plain)).map(|c| slope(c - plain)));
        columns
    }

    fn bounds(&self) -> Vec<Bounds> {
        let mut bounds = self.plays.bounds();
        bounds.extend(vec![Bounds::FREE; self.plays.thresholds.len()]);
        bounds
    }

    fn penalty(&self, level: f64) -> Option<DMatrix<f64>> {
        let n = self.len();
        Some(DMatrix::from_diagonal_element(n, n, 1e-9 * level))
    }
}

/// Returns the output of a play operator over a drive, with virgin memory at the start of each segment.
pub(crate) fn play_column(drive: &[f64], segments: &[Range<usize>], r: f64) -> Vec<f64> {
    one_play(drive, segments, r, &Drag::NONE)
}

/// Returns the output of a play operator with drag over a drive, with virgin memory at the start of each segment.
fn one_play(drive: &[f64], segments: &[Range<usize>], r: f64, drag: &Drag) -> Vec<f64> {
    let mut column = vec![0.0; drive.len()];
    run_plays([&mut column], drive, segments, [r], drag);
    column
}

/// Returns the outputs of play operators with drag over a drive, with virgin memory at the start of each segment.
pub(super) fn plays(drive: &[f64], segments: &[Range<usize>], thresholds: &[f64], drag: &Drag) -> Vec<Vec<f64>> {
    let mut columns = vec![vec![0.0; drive.len()]; thresholds.len()];
    for (columns, thresholds) in columns.chunks_mut(SIDE_BY_SIDE).zip(thresholds.chunks(SIDE_BY_SIDE)) {
        match (columns, thresholds) {
            ([a, b, c, d], [p, q, r, s]) => run_plays([a, b, c, d], drive, segments, [*p, *q, *r, *s], drag),
            ([a, b, c], [p, q, r]) => run_plays([a, b, c], drive, segments, [*p, *q, *r], drag),
            ([a, b], [p, q]) => run_plays([a, b], drive, segments, [*p, *q], drag),
            (columns, thresholds) => {
                columns.iter_mut().zip(thresholds).for_each(|(c, r)| run_plays([c], drive, segments, [*r], drag));
            }
        }
    }
    columns
}

fn run_plays<const N: usize>(
    mut columns: [&mut Vec<f64>; N],
    drive: &[f64],
    segments: &[Range<usize>],
    r: [f64; N],
    drag: &Drag,
) {
    for (i, segment) in segments.iter().enumerate() {
        let out = columns.each_mut().map(|c| &mut c[segment.clone()]);
        match drag.of(i) {
            None => follow(out, &drive[segment.clone()], r, |_, to| to),
            Some(drag) => follow(out, &drive[segment.clone()], r, |p, to| drag.towards(p, to)),
        }
    }
}

/// Runs play operators; `follows(p, to)` returns the next state of one at p that would be at `to` without drag.
fn follow<const N: usize>(mut out: [&mut [f64]; N], drive: &[f64], r: [f64; N], follows: impl Fn(f64, f64) -> f64) {
    let mut p = [0.0; N];
    for (k, u) in drive.iter().enumerate() {
        let mut to = p;
        to.iter_mut().zip(&r).for_each(|(p, r)| *p = play(*p, *u, *r));
        // The device has rested at its first input.
        p = if k == 0 { to } else { std::array::from_fn(|j| follows(p[j], to[j])) };
        for (out, p) in out.iter_mut().zip(p) {
            out[k] = p;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn play_operators_run_together_equal_single_ones() {
        let drive: Vec<f64> =
            (0..700).map(|k| 5.0 * (0.01 * f64::from(k)).sin() + (0.3 * f64::from(k)).sin()).collect();
        let segments = [0..1, 1..300, 300..700];
        let thresholds = [0.2, 0.5, 1.0, 1.7, 2.6, 3.0, 4.1];
        for count in 0..=thresholds.len() {
            let columns = plays(&drive, &segments, &thresholds[..count], &Drag::NONE);
            assert_eq!(columns.len(), count);
            for (column, r) in columns.iter().zip(thresholds) {
                for segment in segments.clone() {
                    let mut p = 0.0;
                    for k in segment {
                        p = play(p, drive[k], r);
                        assert_eq!(column[k], p, "row {k}, threshold {r} of {count}");
                    }
                }
            }
        }
    }
}
