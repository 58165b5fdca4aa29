//! The basis of a base model that is linear in its weights, for a record.

use hyst_core::{Grid, PiParams, ViscousPiParams};

use crate::base::{Basis, LinearisedBasis, PiBasis, PreisachBasis};
use crate::error::FitError;
use crate::model::{Base, Kind, Model};
use crate::samples::Samples;

/// Cells along one edge of the Preisach triangle.
pub(crate) const CELLS: usize = 24;
/// Minimum number of cells along an edge, for a short record.
const MIN_CELLS: usize = 8;
/// Minimum number of rows for each unknown.
pub(super) const ROWS_PER_UNKNOWN: usize = 3;

/// A basis of a kind, with the grid or the thresholds for a record.
#[derive(Clone)]
pub(crate) enum BasisOf {
    Pi(PiBasis),
    Preisach(PreisachBasis),
    /// A linearised operator of another kind.
    Linearised(Box<LinearisedBasis>),
}

impl BasisOf {
    pub(crate) fn as_ref(&self) -> &dyn Basis {
        match self {
            Self::Pi(b) => b,
            Self::Preisach(b) => b,
            Self::Linearised(b) => b.as_ref(),
        }
    }

    pub(crate) fn len(&self) -> usize {
        self.as_ref().len()
    }

    /// Returns the operator with these weights. Weights below 1e-9 of their sum are solver residue and set to zero.
    pub(crate) fn operator(&self, weights: &[f64]) -> Base {
        let smallest = 1e-9 * weights.iter().map(|w| w.abs()).sum::<f64>();
        let clean: Vec<f64> = weights.iter().map(|w| if w.abs() < smallest { 0.0 } else { *w }).collect();
        match self {
            Self::Pi(b) => {
                Base::Pi(PiParams { gain: clean[0], thresholds: b.thresholds.clone(), weights: clean[1..].to_vec() })
            }
            Self::Preisach(b) => Base::Preisach(b.spec(&clean)),
            Self::Linearised(b) => b.operator(weights),
        }
    }
}

pub(crate) fn basis_for(kind: Kind, samples: &Samples) -> Result<BasisOf, FitError> {
    Ok(match kind {
        Kind::Pi => BasisOf::Pi(PiBasis::for_samples(samples)),
        Kind::Preisach => {
            // A short record determines a coarser triangle.
            let most = samples.len() / ROWS_PER_UNKNOWN;
            let finest = |cells: &usize| PreisachBasis::for_samples(samples, *cells).len() <= most;
            let cells = (MIN_CELLS..=CELLS).rev().find(finest).unwrap_or(MIN_CELLS);
            BasisOf::Preisach(PreisachBasis::for_samples(samples, cells))
        }
        other => return Err(FitError::NoBasis { kind: other.name() }),
    })
}

/// Returns the basis of a model's base for a record that it was fitted to, with its own thresholds or grid.
pub(crate) fn basis_of(model: &Model, samples: &Samples) -> Result<BasisOf, hyst_core::Error> {
    Ok(match &model.base {
        Base::Pi(PiParams { thresholds, .. })
        | Base::ViscousPi(ViscousPiParams { pi: PiParams { thresholds, .. }, .. }) => {
            BasisOf::Pi(PiBasis { thresholds: thresholds.clone(), ..PiBasis::for_samples(samples) })
        }
        Base::Preisach(spec) => {
            let grid = Grid { low: spec.low, high: spec.high, cells: spec.cells };
            BasisOf::Preisach(PreisachBasis {
                grid,
                rest: spec.rest,
                ..PreisachBasis::for_samples(samples, spec.cells)
            })
        }
        _ => BasisOf::Linearised(Box::new(LinearisedBasis::new(
            &model.base,
            model.falls,
            model.between_samples,
            samples,
        )?)),
    })
}
