//! Positions of the unknowns in the solution vector.

use std::ops::Range;

use hyst_core::{CurveSide, HARMONIC_PARTS};
use nalgebra::DVector;

use super::Hypothesis;
use super::wander::HATS;

/// Positions of the linear unknowns, in this order. The nonlinear parameters follow.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Layout {
    pub(crate) weights: Range<usize>,
    pub(crate) zeros: Range<usize>,
    /// Slope, then settling amplitude.
    pub(crate) drift: Range<usize>,
    /// Sine and cosine of the fundamental, then of the harmonics.
    pub(crate) tone: Range<usize>,
    pub(crate) load: Range<usize>,
    /// Thermal expansion.
    pub(crate) expansion: Range<usize>,
    /// Change of the gain beside the hysteresis with temperature.
    pub(crate) direct: Range<usize>,
    /// Play operators of the widening.
    pub(crate) widening: Range<usize>,
    /// Dead zones of the asymmetry.
    pub(crate) zones: Range<usize>,
    pub(crate) zero_hats: Range<usize>,
    pub(crate) gain_hats: Range<usize>,
    /// Initial deviations of slow states.
    pub(crate) initial: Range<usize>,
}

impl Layout {
    /// Returns the layout for a record whose initial deviations have `initial` unknowns.
    pub(crate) fn of(h: &Hypothesis, weights: usize, zeros: usize, initial: usize) -> Self {
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
            direct: next(some(e.temperature.is_some_and(|p| p.direct != 0.0), 1)),
            widening: next(e.widening.as_ref().map_or(0, |p| p.weights.len())),
            zones: next(e.curve(CurveSide::Output).map_or(0, |a| a.thresholds.len())),
            zero_hats: next(some(h.zero_wanders, HATS)),
            gain_hats: next(some(h.gain_wanders, HATS)),
            initial: next(some(h.initial_state, initial)),
        }
    }

    /// Returns the positions of each kind, in order.
    fn kinds(&self) -> [Range<usize>; 12] {
        let Self {
            weights,
            zeros,
            drift,
            tone,
            load,
            expansion,
            direct,
            widening,
            zones,
            zero_hats,
            gain_hats,
            initial,
        } = self.clone();
        [weights, zeros, drift, tone, load, expansion, direct, widening, zones, zero_hats, gain_hats, initial]
    }

    /// Maps a solution to another layout. Returns the mapped solution, and the positions there of the kinds that this
    /// layout does not have or has in another number.
    pub(super) fn mapped(&self, solution: &DVector<f64>, to: &Self) -> (DVector<f64>, Vec<usize>) {
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

    /// Returns the number of linear unknowns.
    pub(crate) fn len(&self) -> usize {
        self.initial.end
    }
}

#[cfg(test)]
mod tests {
    use hyst_core::LoadParams;

    use super::*;
    use crate::model::Effects;

    #[test]
    fn a_mapped_solution_keeps_its_values_and_lists_missing_positions() {
        let load = Hypothesis::of(Effects { load: Some(LoadParams::default()), ..Effects::default() });
        let (three, one) = (Layout::of(&load, 2, 3, 0), Layout::of(&load, 2, 1, 0));
        let z = DVector::from_vec(vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        // Two weights, the zeros of three files, the load.
        let (mapped, places) = three.mapped(&z, &one);
        assert_eq!((mapped.as_slice(), places.as_slice()), ([1.0, 2.0, 0.0, 6.0].as_slice(), [2].as_slice()));
    }
}
