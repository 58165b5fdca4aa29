//! A rich base for the search for effects (screening basis).
//!
//! Every Preisach operator is `∫ ψ_r(play_r(u)) dr` with one curve ψ_r per threshold. A Prandtl-Ishlinskii operator is
//! the case of straight lines. Here ψ_r is a polynomial of degree 3, so that the residual of a fit is not misfit of the
//! base, which would otherwise be mistaken for an effect. A bank that relaxes with the travel of the drive
//! ([`travel`](super::travel)) represents hysteresis that is no superposition of relays: an effect is named only if no
//! rate-independent memory explains it as well. An operator that is not linear in its parameters is an additional
//! column; it may ring, lag or depend on the temperature.

use std::ops::Range;

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::pi::plays;
use super::travel::TravelBank;
use super::{Basis, Drag, LinearisedBasis, PiBasis, SIDE_BY_SIDE};
use crate::Samples;
use crate::lsq::Bounds;
use crate::repetition::only_loop;

/// Minimum number of rows for each unknown of the base: with fewer, noise looks like an effect.
pub(crate) const ROWS_PER_UNKNOWN: usize = 10;
/// Maximum divisor of the number of play operators, for the shortest records.
const MAX_DIVISOR: usize = 5;

/// Play operators with quadratic and cubic curves, and a bank that relaxes with travel.
#[derive(Clone, Debug)]
pub(crate) struct ScreeningBasis {
    linear: PiBasis,
    curved: Vec<f64>,
    middle: f64,
    half: f64,
    travel: TravelBank,
    drags: bool,
    kept: Option<Box<LinearisedBasis>>,
    /// Whether the curves of a play operator have degrees 3 and 5, and not 2 and 3.
    is_odd: bool,
}

impl ScreeningBasis {
    /// Builds the basis for the input range of a record. `drags` allows a drag, if the base that is finally extended
    /// has one too. `kept` is that base if its parameters are held.
    pub(crate) fn for_samples(samples: &Samples, drags: bool, kept: Option<Box<LinearisedBasis>>) -> Self {
        Self::with_curves(samples, drags, &kept, false)
    }

    /// Builds a basis of the same size that is odd about the middle of the drive: curves of degree 3 and 5, and the
    /// odd read-outs of the bank. It represents symmetric hysteresis whatever its law, but no curve that bends one end
    /// of the loop.
    pub(crate) fn odd(samples: &Samples, drags: bool) -> Self {
        Self::with_curves(samples, drags, &None, true)
    }

    fn with_curves(samples: &Samples, drags: bool, kept: &Option<Box<LinearisedBasis>>, is_odd: bool) -> Self {
        // A short record determines fewer curves. The weights have either sign.
        let plays = |by| PiBasis { falls: false, ..PiBasis::coarser(samples, by) };
        let of = |by: usize| Self::of(samples, plays(by), drags, kept.clone(), is_odd);
        let fits = |basis: &Self| ROWS_PER_UNKNOWN * basis.len() <= samples.len();
        (1..MAX_DIVISOR).map(of).find(fits).unwrap_or_else(|| of(MAX_DIVISOR))
    }

    fn of(samples: &Samples, linear: PiBasis, drags: bool, kept: Option<Box<LinearisedBasis>>, is_odd: bool) -> Self {
        let (low, high) = samples.input_range();
        // The identity (r = 0) and every second play.
        let curved = std::iter::once(0.0).chain(linear.thresholds.iter().copied().skip(1).step_by(2)).collect();
        let repeats = only_loop(samples).is_some();
        let travel = if repeats { TravelBank::none() } else { TravelBank::new(low, high, is_odd) };
        Self { linear, curved, middle: 0.5 * (low + high), half: 0.5 * (high - low), travel, drags, kept, is_odd }
    }

    /// Returns the end of the columns of the play operators, and the end of those of the bank.
    fn ends(&self) -> (usize, usize) {
        let plays = self.linear.len() + 2 * self.curved.len();
        (plays, plays + self.travel.len())
    }

    /// Returns the two curves of a play operator's output, zero at output zero: a square and a cubic, or a cubic and a
    /// quintic.
    #[inline]
    fn curves(&self, p: f64) -> [f64; 2] {
        let cubic = |x: f64| x * (x * x - 0.6);
        let quintic = |x: f64| x * ((x * x - 10.0 / 9.0) * x * x + 5.0 / 21.0);
        let scale = 1.0 / self.half;
        let (x, x0) = ((p - self.middle) * scale, -self.middle * scale);
        let cube = self.half * (cubic(x) - cubic(x0));
        if self.is_odd { [cube, self.half * (quintic(x) - quintic(x0))] } else { [self.half * (x * x - x0 * x0), cube] }
    }
}

impl Basis for ScreeningBasis {
    fn columns(&self, of: Range<usize>, drive: &[f64], segments: &[Range<usize>], drag: &Drag) -> Vec<Vec<f64>> {
        let (curved, (played, kept)) = (self.linear.len(), self.ends());
        let mut columns = self.linear.columns(of.start.min(curved)..of.end.min(curved), drive, segments, drag);
        let of_curved = of.start.max(curved).min(played)..of.end.max(curved).min(played);
        // Two curves for each play operator.
        let first = (of_curved.start - curved) / 2;
        let thresholds = &self.curved[first..(of_curved.end - curved).div_ceil(2).max(first)];
        let mut plays = plays(drive, segments, thresholds, drag);
        // The identity has no drag.
        thresholds.iter().zip(&mut plays).filter(|(r, _)| **r == 0.0).for_each(|(_, p)| p.copy_from_slice(drive));
        columns.extend(of_curved.map(|c| -> Vec<f64> {
            let (p, which) = (plays[(c - curved) / 2 - first].iter(), (c - curved) % 2);
            p.map(|p| self.curves(*p)[which]).collect()
        }));
        let of_travel = of.start.max(played).min(kept) - played..of.end.max(played).min(kept) - played;
        columns.extend(self.travel.columns(of_travel, drive, segments));
        if let Some(own) = self.kept.as_ref().filter(|_| of.end > kept) {
            // Scaled to volts like the other columns, because one penalty applies to all.
            let size = |column: &[f64]| column.iter().fold(0.0, |m: f64, y| m.max(y.abs()));
            let mut own = own.columns(of.start.max(kept) - kept..of.end - kept, drive, segments, drag);
            for column in &mut own {
                let scale = size(drive) / size(column);
                column.iter_mut().filter(|_| scale.is_finite()).for_each(|y| *y *= scale);
            }
            columns.extend(own);
        }
        columns
    }

    /// Computes the line and the curves of each play operator in one pass.
    fn combined(&self, weights: &[f64], drive: &[f64], segments: &[Range<usize>], drag: &Drag) -> Option<Vec<f64>> {
        if self.kept.is_some() {
            return None;
        }
        let (of_plays, of_travel) = weights.split_at(self.ends().0);
        let (straight, bent) = of_plays.split_at(self.linear.len());
        let curves: Vec<(f64, [f64; 2])> =
            self.curved.iter().copied().zip(bent.chunks(2).map(|w| [w[0], w[1]])).collect();
        // The line of each threshold; the identity has threshold 0 and no drag.
        let add = |v: &mut [f64], p: &[f64], w: f64, bend: Option<[f64; 2]>| match bend {
            Some([first, second]) => v.iter_mut().zip(p).for_each(|(v, p)| {
                let [a, b] = self.curves(*p);
                *v += w * p + first * a + second * b;
            }),
            None => v.iter_mut().zip(p).for_each(|(v, p)| *v += w * p),
        };
        let bend = |r: f64| curves.iter().find(|(threshold, _)| *threshold == r).map(|(_, w)| *w);
        let part = |(thresholds, weights): (&[f64], &[f64])| {
            let mut v = vec![0.0; drive.len()];
            for (p, (r, w)) in plays(drive, segments, thresholds, drag).iter().zip(thresholds.iter().zip(weights)) {
                add(&mut v, p, *w, bend(*r));
            }
            v
        };
        let thresholds = &self.linear.thresholds;
        let pieces: Vec<(&[f64], &[f64])> =
            thresholds.chunks(SIDE_BY_SIDE).zip(straight[1..].chunks(SIDE_BY_SIDE)).collect();
        let parts: Vec<Vec<f64>> = pieces.into_par_iter().map(part).collect();
        let mut v = vec![0.0; drive.len()];
        add(&mut v, drive, straight[0], bend(0.0));
        parts.iter().for_each(|part| v.iter_mut().zip(part).for_each(|(v, x)| *v += x));
        let relaxed = self.travel.columns(0..self.travel.len(), drive, segments);
        relaxed.iter().zip(of_travel).for_each(|(e, w)| v.iter_mut().zip(e).for_each(|(v, e)| *v += w * e));
        Some(v)
    }

    fn may_widen(&self) -> bool {
        self.kept.is_none()
    }

    fn over(&self, samples: &Samples) -> Option<Box<dyn Basis>> {
        let kept = self.kept.as_ref()?.on(samples)?;
        Some(Box::new(Self { kept: Some(Box::new(kept)), ..self.clone() }))
    }

    fn drags(&self) -> bool {
        self.drags
    }

    fn is_odd(&self) -> bool {
        self.is_odd
    }

    fn bounds(&self) -> Vec<Bounds> {
        vec![Bounds::FREE; self.ends().1 + self.kept.as_ref().map_or(0, |own| own.len())]
    }

    fn penalty(&self, level: f64) -> Option<DMatrix<f64>> {
        let n = self.len();
        Some(DMatrix::from_diagonal_element(n, n, 1e-8 * level))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A drive that is mirrored about the middle of its range mirrors each column.
    #[test]
    fn the_columns_of_an_odd_basis_mirror_with_the_drive() {
        /// Rows of full sweeps.
        const SWEEPS: usize = 14_000;
        // Full sweeps first: they overwrite the memory of the start, which is not mirrored.
        let wave = |k: usize| (0.02 * k as f64).cos() * if k < SWEEPS { 50.0 } else { 0.003 * k as f64 };
        let drive: Vec<f64> = (0..SWEEPS + 900).map(|k| 50.0 + wave(k)).collect();
        let mirrored: Vec<f64> = (0..SWEEPS + 900).map(|k| 50.0 - wave(k)).collect();
        let output = drive.iter().map(|u| 0.1 * u).collect();
        let samples = Samples::of_columns(1e-3, drive, output);
        let is_mirrored = |basis: &dyn Basis| {
            let of = |drive: &[f64]| basis.columns(0..basis.len(), drive, &samples.segments, &Drag::NONE);
            of(&samples.input).iter().zip(&of(&mirrored)).all(|(a, b)| {
                let middle = (a[SWEEPS - 1] + b[SWEEPS - 1]) / 2.0;
                (SWEEPS..SWEEPS + 900).all(|k| (a[k] + b[k] - 2.0 * middle).abs() < 1e-4)
            })
        };
        let odd = ScreeningBasis::odd(&samples, true);
        assert!(odd.is_odd() && is_mirrored(&odd));
        assert!(!is_mirrored(&ScreeningBasis::for_samples(&samples, true, None)));
    }
}
