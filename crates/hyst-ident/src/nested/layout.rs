//! Which unknown stands where.

use std::ops::Range;

use hyst_core::{CurveSide, HARMONIC_PARTS};
use nalgebra::DVector;

use super::Hypothesis;

/// Hats of a wandering over a record.
pub(crate) const HATS: usize = 32;

/// Places of the unknowns that are solved for, in this order; the nonlinear parameters come behind them.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Layout {
    pub(crate) weights: Range<usize>,
    pub(crate) zeros: Range<usize>,
    /// A line, then what settles.
    pub(crate) drift: Range<usize>,
    /// Sine and cosine, then those of the harmonics.
    pub(crate) tone: Range<usize>,
    pub(crate) load: Range<usize>,
    /// Thermal expansion.
    pub(crate) expansion: Range<usize>,
    /// Plays of the widening.
    pub(crate) widening: Range<usize>,
    /// Dead zones of the asymmetry.
    pub(crate) zones: Range<usize>,
    pub(crate) zero_hats: Range<usize>,
    pub(crate) gain_hats: Range<usize>,
    /// What is still owed to the time before each segment.
    pub(crate) owed: Range<usize>,
}

impl Layout {
    /// Of a record in which what goes on from before takes `owed` unknowns.
    pub(crate) fn of(h: &Hypothesis, weights: usize, zeros: usize, owed: usize) -> Self {
        let mut end = 0;
        let mut next = |count: usize| {
            end += count;
            end - count..end
        };
        let some = |present: bool, count: usize| if present { count } else { 0 };
        let e = &h.effects;
        Self {
            weights: next(weights),
            zeros: next(zeros),
            drift: next(e.drift.map_or(0, |p| if p.seconds > 0.0 { 2 } else { 1 })),
            tone: next(some(e.interference.is_some(), 2 + HARMONIC_PARTS)),
            load: next(some(e.load.is_some(), 1)),
            expansion: next(some(e.temperature.is_some_and(|p| p.expansion != 0.0), 1)),
            widening: next(e.widening.as_ref().map_or(0, |p| p.weights.len())),
            zones: next(e.curve(CurveSide::Output).map_or(0, |a| a.thresholds.len())),
            zero_hats: next(some(h.zero_wanders, HATS)),
            gain_hats: next(some(h.gain_wanders, HATS)),
            owed: next(some(h.goes_on, owed)),
        }
    }

    /// The places of each kind, in order.
    fn kinds(&self) -> [Range<usize>; 11] {
        let Self { weights, zeros, drift, tone, load, expansion, widening, zones, zero_hats, gain_hats, owed } =
            self.clone();
        [weights, zeros, drift, tone, load, expansion, widening, zones, zero_hats, gain_hats, owed]
    }

    /// A solution in this layout as it stands in another one, and the places there that this one does not have, or has in another number.
    pub(super) fn carried(&self, solution: &DVector<f64>, to: &Self) -> (DVector<f64>, Vec<usize>) {
        let mut z = DVector::zeros(to.len());
        let mut places = Vec::new();
        for (from, to) in self.kinds().into_iter().zip(to.kinds()) {
            if from.len() == to.len() {
                z.rows_mut(to.start, to.len()).copy_from(&solution.rows(from.start, from.len()));
            } else {
                places.extend(to);
            }
        }
        (z, places)
    }

    /// How many there are.
    pub(crate) fn len(&self) -> usize {
        self.owed.end
    }
}

#[cfg(test)]
mod tests {
    use hyst_core::LoadParams;

    use super::*;
    use crate::model::Effects;

    #[test]
    fn what_a_layout_lacks_is_told_and_the_rest_keeps_its_values() {
        let load = Hypothesis::of(Effects { load: Some(LoadParams { per_newton: 0.0 }), ..Effects::default() });
        let (three, one) = (Layout::of(&load, 2, 3, 0), Layout::of(&load, 2, 1, 0));
        let z = DVector::from_vec(vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        // Two weights, the zeros of three files, the load.
        let (carried, places) = three.carried(&z, &one);
        assert_eq!((carried.as_slice(), places.as_slice()), ([1.0, 2.0, 0.0, 6.0].as_slice(), [2].as_slice()));
    }
}
