//! An operator that is not linear in its parameters, as its output and the derivatives with respect to the parameters.
//!
//! Near the parameters p, the model f(u; p) is approximated by `f(u; p) + Σᵢ wᵢ cᵢ ∂f/∂pᵢ`, with cᵢ the value of the
//! parameter: the weights are relative changes. A model that was fitted without a missing effect has taken up a part of
//! it; small changes of its parameters correct that.

use std::ops::Range;
use std::sync::Arc;

use hyst_core::{Error, Params, Stage};
use nalgebra::DMatrix;
use rayon::prelude::*;

use super::{Basis, Drag, with_sign};
use crate::drive::{Drive, Passes};
use crate::lsq::Bounds;
use crate::model::{Base, Operator};
use crate::samples::PerSegment;
use crate::{BetweenSamples, Samples};

/// Step of the difference quotients, as a share of a parameter.
const STEP: f64 = 1e-4;
/// Maximum change of a parameter as a share of it, and maximum change of the output as a share of it; the larger one
/// applies. The linearisation is inaccurate beyond it.
const MAX_RELATIVE_CHANGE: f64 = 0.3;
const MAX_MOTION_CHANGE: f64 = 0.05;
/// Maximum number of parameters that are changed: those that move the output most.
const MAX_PARAMETERS: usize = 16;
/// Minimum motion for a relative change of 1, as a share of the output; below it the motion is rounding.
const MIN_MOTION_SHARE: f64 = 1e-6;
/// Regularisation of the changes, for parameters that the record cannot separate.
const PENALTY: f64 = 1e-7;

/// A linearised operator of any kind.
#[derive(Clone, Debug)]
pub(crate) struct LinearisedBasis {
    pub(crate) base: Base,
    falls: bool,
    between: BetweenSamples,
    /// Minimum and maximum input of its record.
    range: [f64; 2],
    operator: Arc<PerSegment<Operator>>,
    slopes: Vec<Slope>,
    /// Segments and environment of that record.
    samples: Arc<Samples>,
}

/// An operator with one parameter changed in both directions.
#[derive(Clone, Debug)]
struct Slope {
    /// Index of the parameter in the order of a visit.
    parameter: usize,
    /// Bounds of the relative change.
    bounds: Bounds,
    /// Root of Σ motion² for a relative change of 1 \[y\].
    motion: f64,
    sides: Sides,
}

/// An operator with one parameter increased and decreased, and the difference as a share of it.
#[derive(Clone, Debug)]
struct Sides {
    above: Arc<PerSegment<Operator>>,
    below: Arc<PerSegment<Operator>>,
    apart: f64,
}

impl LinearisedBasis {
    /// Linearises an operator for a record, whose drive continues `between` the samples as given.
    ///
    /// # Errors
    /// If the operator cannot be built at the record's sample period.
    pub(crate) fn new(base: &Base, falls: bool, between: BetweenSamples, samples: &Samples) -> Result<Self, Error> {
        let (low, high) = samples.input_range();
        let (base, range) = (base.clone(), [low, high]);
        let operator = Arc::new(built(&base, range, samples, between)?);
        let plane =
            Self { base, falls, between, range, operator, slopes: Vec::new(), samples: Arc::new(samples.clone()) };
        let mut count = 0;
        plane.base.clone().visit(&mut |_, _| count += 1);
        let mut slopes = plane.slopes(0..count);
        slopes.sort_by(|a, b| b.motion.total_cmp(&a.motion));
        slopes.truncate(MAX_PARAMETERS);
        Ok(Self { slopes, ..plane })
    }

    /// Returns the operator with its parameters changed by these weights.
    pub(crate) fn operator(&self, weights: &[f64]) -> Base {
        let mut base = self.base.clone();
        let mut at = 0;
        base.visit(&mut |_, x| {
            let slope = self.slopes.iter().position(|slope| slope.parameter == at);
            if let Some(weight) = slope.and_then(|slope| weights.get(1 + slope)) {
                *x *= 1.0 + weight;
            }
            at += 1;
        });
        admissible(base)
    }

    /// Returns the operator with other parameters, without derivatives; `None` if there is no such operator.
    pub(crate) fn at(&self, base: Base) -> Option<Self> {
        let operator = built(&base, self.range, &self.samples, self.between).ok()?;
        Some(Self { base, operator: Arc::new(operator), ..self.alone() })
    }

    /// Adds the derivatives with respect to the parameters that `other` has.
    pub(crate) fn with_slopes_of(self, other: &Self) -> Self {
        let slopes = self.slopes(other.slopes.iter().map(|slope| slope.parameter));
        Self { slopes, ..self }
    }

    /// Returns the same for another record within the input range of its own.
    pub(crate) fn on(&self, samples: &Samples) -> Option<Self> {
        let there = Self { samples: Arc::new(samples.clone()), ..self.clone() };
        // With several sample periods the operator has to be rebuilt.
        if self.samples.periods.is_empty() {
            Some(there)
        } else {
            Some(there.at(self.base.clone())?.with_slopes_of(self))
        }
    }

    /// Returns the operator without derivatives.
    pub(crate) fn alone(&self) -> Self {
        Self {
            base: self.base.clone(),
            operator: Arc::clone(&self.operator),
            samples: Arc::clone(&self.samples),
            slopes: Vec::new(),
            ..*self
        }
    }

    /// Returns the derivatives with respect to these parameters. Parameters that are zero, do not move the output, or
    /// cannot be changed are skipped.
    fn slopes(&self, parameters: impl Iterator<Item = usize>) -> Vec<Slope> {
        let Samples { input, segments, .. } = self.samples.as_ref();
        let output = size(&self.driven(&self.operator, input, segments));
        let slope = |parameter: usize| {
            let limits = self.limits(parameter)?;
            let here = || Arc::clone(&self.operator);
            // At a bound of a parameter there is one side only.
            let sides = match (self.changed(parameter, STEP), self.changed(parameter, -STEP)) {
                (Some(above), Some(below)) => Sides { above, below, apart: 2.0 * STEP },
                (Some(above), None) => Sides { above, below: here(), apart: STEP },
                (None, Some(below)) => Sides { above: here(), below, apart: STEP },
                (None, None) => return None,
            };
            let motion = size(&self.moved_by(&sides, input, segments));
            let farthest = MAX_RELATIVE_CHANGE.max(MAX_MOTION_CHANGE * output / motion);
            let bounds = Bounds { lower: limits.lower.max(-farthest), upper: limits.upper.min(farthest) };
            let moves = motion.is_finite() && motion > MIN_MOTION_SHARE * output;
            moves.then_some(Slope { parameter, bounds, motion, sides })
        };
        parameters.collect::<Vec<_>>().into_par_iter().filter_map(slope).collect()
    }

    /// Returns the bounds of a parameter's relative change; `None` if it is zero.
    fn limits(&self, parameter: usize) -> Option<Bounds> {
        let (mut at, mut limits) = (0, None);
        self.base.clone().visit(&mut |meta, x| {
            if at == parameter && *x != 0.0 {
                let ends = [meta.lower / *x - 1.0, meta.upper / *x - 1.0];
                limits = Some(Bounds { lower: ends[0].min(ends[1]).min(0.0), upper: ends[0].max(ends[1]).max(0.0) });
            }
            at += 1;
        });
        limits
    }

    /// Returns the operator with a parameter changed by a relative amount.
    fn changed(&self, parameter: usize, by: f64) -> Option<Arc<PerSegment<Operator>>> {
        let (mut base, mut at) = (self.base.clone(), 0);
        base.visit(&mut |_, x| {
            if at == parameter {
                *x *= 1.0 + by;
            }
            at += 1;
        });
        built(&base, self.range, &self.samples, self.between).ok().map(Arc::new)
    }

    /// Returns the output over a drive. The drive may have history rows before each segment of the record; they use the
    /// environment of its first row.
    fn driven(&self, operator: &PerSegment<Operator>, drive: &[f64], segments: &[Range<usize>]) -> Vec<f64> {
        let own = |i: usize| segments[i].end - self.samples.segments[i].len()..segments[i].end;
        let past = |i: usize| &drive[segments[i].start..own(i).start];
        let rows: Vec<f64> = (0..segments.len()).flat_map(|i| drive[own(i)].iter().copied()).collect();
        let mut output = vec![0.0; rows.len()];
        Drive::of(&self.samples, &rows, self.between, Passes::Once).run_from(
            operator,
            |state, i, env, u0| {
                let stage = operator.of(i);
                let mut all = past(i).iter().copied().chain([u0]);
                let start = stage.reset(state, env, all.next().unwrap_or(u0));
                all.fold(start, |_, u| stage.step(state, env, u))
            },
            &mut output,
        );
        let mut column = vec![0.0; drive.len()];
        for (i, of) in self.samples.segments.iter().enumerate() {
            column[own(i)].copy_from_slice(&output[of.clone()]);
        }
        column
    }

    fn moved_by(&self, sides: &Sides, drive: &[f64], segments: &[Range<usize>]) -> Vec<f64> {
        let mut moved = self.driven(&sides.above, drive, segments);
        let below = self.driven(&sides.below, drive, segments);
        moved.iter_mut().zip(&below).for_each(|(a, b)| *a = (*a - b) / sides.apart);
        moved
    }
}

fn built(
    base: &Base,
    range: [f64; 2],
    samples: &Samples,
    between: BetweenSamples,
) -> Result<PerSegment<Operator>, Error> {
    Drive::new(samples, between, Passes::Once).stages(|sampling| Operator::new(base, range, sampling))
}

fn size(rows: &[f64]) -> f64 {
    rows.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// Restores conditions between parameters. The bounds of the weights keep each single parameter in its range.
fn admissible(mut base: Base) -> Base {
    if let Base::BoucWen(p) = &mut base {
        let most = p.beta.abs();
        p.gamma = p.gamma.max(-most).min(most);
    }
    base
}

impl Basis for LinearisedBasis {
    fn columns(&self, of: Range<usize>, drive: &[f64], segments: &[Range<usize>], _drag: &Drag) -> Vec<Vec<f64>> {
        let column = |i: usize| match i.checked_sub(1) {
            None => self.driven(&self.operator, drive, segments),
            Some(slope) => self.moved_by(&self.slopes[slope].sides, drive, segments),
        };
        with_sign(self.falls, of.map(column).collect())
    }

    fn together(&self) -> usize {
        1
    }

    fn over(&self, samples: &Samples) -> Option<Box<dyn Basis>> {
        Some(Box::new(self.on(samples)?))
    }

    fn drags(&self) -> bool {
        false
    }

    fn bounds(&self) -> Vec<Bounds> {
        std::iter::once(Bounds { lower: 1.0, upper: 1.0 }).chain(self.slopes.iter().map(|s| s.bounds)).collect()
    }

    fn penalty(&self, level: f64) -> Option<DMatrix<f64>> {
        let weight = |r, c| if r == c && r > 0 { PENALTY * level } else { 0.0 };
        (!self.slopes.is_empty()).then(|| DMatrix::from_fn(self.len(), self.len(), weight))
    }
}

#[cfg(test)]
mod tests {
    use hyst_core::BoucWenParams;

    use super::*;

    fn samples() -> Samples {
        let input: Vec<f64> = (0..1200).map(|k| f64::from(k) * 0.02).map(|t| 5.0 + 4.0 * t * (1.0 - t.cos())).collect();
        let output = input.iter().map(|u| 0.3 * u).collect();
        Samples::of_columns(1e-2, input, output)
    }

    fn plane(n: f64, samples: &Samples) -> LinearisedBasis {
        let base = BoucWenParams { k0: 0.4, alpha: -0.2, beta: 0.03, gamma: -0.01, n };
        LinearisedBasis::new(&Base::BoucWen(base), false, BetweenSamples::Linear, samples).unwrap()
    }

    fn output(plane: &LinearisedBasis, drive: &[f64], segments: &[Range<usize>]) -> Vec<f64> {
        plane.columns(0..1, drive, segments, &Drag::NONE).remove(0)
    }

    #[test]
    fn the_linearisation_predicts_small_changes_of_the_parameters() {
        let samples = samples();
        let plane = plane(1.2, &samples);
        assert_eq!(plane.len(), 6, "the output and five parameters");
        let weights = [1.0, 1e-3, -2e-3, 2e-3, -1e-3, 1e-3];
        let moved = plane.at(plane.operator(&weights)).unwrap();
        let there = output(&moved, &samples.input, &samples.segments);
        let columns = plane.columns(0..6, &samples.input, &samples.segments, &Drag::NONE);
        for (k, there) in there.iter().enumerate() {
            let said: f64 = columns.iter().zip(weights).map(|(column, w)| w * column[k]).sum();
            // Second order in changes of 2e-3.
            assert!((there - said).abs() < 1e-5 * 30.0, "row {k}: {there} {said}");
            assert!(k == 0 || (there - columns[0][k]).abs() > 1e-4, "row {k} has not moved");
        }
    }

    #[test]
    fn a_step_leaves_the_parameters_valid() {
        let samples = samples();
        let plane = plane(1.2, &samples);
        let slope_of = |parameter: usize| plane.slopes.iter().position(|slope| slope.parameter == parameter).unwrap();
        // Beta falls below the magnitude of gamma.
        let mut weights = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        weights[1 + slope_of(2)] = -0.8;
        let Base::BoucWen(p) = plane.operator(&weights) else { panic!("another kind") };
        assert!((p.beta - 0.006).abs() < 1e-12 && (p.gamma + p.beta).abs() < 1e-12, "{p:?}");
        assert!(plane.at(Base::BoucWen(p)).is_some());
        // Valid parameters are unchanged, and a positive gamma is limited too.
        let valid = Base::BoucWen(BoucWenParams { gamma: 0.02, beta: 0.03, ..p });
        assert_eq!(admissible(valid.clone()), valid);
        let Base::BoucWen(p) = admissible(Base::BoucWen(BoucWenParams { gamma: 0.05, beta: 0.03, ..p })) else {
            panic!()
        };
        assert_eq!(p.gamma, 0.03);
    }

    #[test]
    fn a_drive_history_acts_like_the_same_rows_of_a_record() {
        let whole = samples();
        let past = 300;
        let rest = Samples::of_columns(1e-2, whole.input[past..].to_vec(), whole.output[past..].to_vec());
        let (of_whole, of_rest) = (plane(1.2, &whole), plane(1.2, &rest));
        let in_one = output(&of_whole, &whole.input, &whole.segments);
        assert_eq!(output(&of_rest, &whole.input, &whole.segments)[past..], in_one[past..]);
        let forgotten = output(&of_rest, &rest.input, &rest.segments);
        assert!((forgotten[0] - in_one[past]).abs() > 0.1, "{} {}", forgotten[0], in_one[past]);
        // Also for another record.
        assert_eq!(output(&of_rest.on(&whole).unwrap(), &whole.input, &whole.segments), in_one);
    }

    #[test]
    fn a_parameter_at_its_bound_is_changed_to_one_side() {
        let plane = plane(1.0, &samples());
        let bounds = plane.bounds();
        assert_eq!(bounds.len(), 6);
        assert_eq!(bounds.iter().filter(|b| b.lower == 0.0 && b.upper > 0.0).count(), 1);
    }
}
