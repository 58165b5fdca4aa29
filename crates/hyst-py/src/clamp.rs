//! Inverses that stay at the end of their inputs where a reference is out of reach, and the warning about it.

use std::sync::Arc;

use pyo3::prelude::*;

use crate::arrays::Surroundings;
use crate::errors;
use crate::runner::Engine;

/// Inputs that an inverse does not leave.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ends {
    /// Lowest \[u\].
    pub(crate) low: f64,
    /// Highest \[u\].
    pub(crate) high: f64,
    /// How far an input may be from the exact one \[u\].
    pub(crate) tolerance: f64,
}

/// A miss below this share of what the ends reach is rounding.
const ROUNDING: f64 = 1e-6;

/// The ends of an inverse, and the model that tells what they reach.
pub(crate) struct Clamp {
    pub(crate) ends: Ends,
    pub(crate) model: Arc<dyn Engine>,
}

/// Samples of a reference that are not reached.
struct Missed {
    samples: usize,
    largest: f64,
    /// Where it is missed most.
    at: usize,
}

impl Clamp {
    /// Warns of the samples of `reference` for which `found`, the inverse's answer, stayed at an end.
    ///
    /// # Errors
    /// If the caller turns warnings into exceptions.
    pub(crate) fn warn(
        &self,
        py: Python<'_>,
        env: &Surroundings<'_>,
        (name, reference): (&str, &[f64]),
        found: &[f64],
    ) -> PyResult<()> {
        let Some(Missed { samples, largest, at }) = py.detach(|| self.missed(env, reference, found)) else {
            return Ok(());
        };
        let (of, Ends { low, high, .. }) = (reference.len(), self.ends);
        let message = format!(
            "{samples} of {of} samples of {name} are not reached by any input from {low:?} to {high:?}, by {largest:.4e} at most ({name}[{at}]); the nearer end was taken there"
        );
        errors::out_of_range(py, &message)
    }

    fn missed(&self, env: &Surroundings<'_>, reference: &[f64], found: &[f64]) -> Option<Missed> {
        let Ends { low, high, tolerance } = self.ends;
        let at_end = |u: &f64| *u <= low || *u >= high;
        if !found.iter().any(at_end) {
            return None;
        }
        // The ends and what an inverse answers between them are finite.
        let rest = |u: f64| self.model.simulate(env, &[u]).ok()?.first().copied();
        let fine = (rest(high)? - rest(low)?).abs() * (ROUNDING + 10.0 * tolerance / (high - low));
        let reached = self.model.simulate(env, found).ok()?;
        let misses = reached.iter().zip(reference).map(|(y, wanted)| (y - wanted).abs());
        let missed = found.iter().zip(misses).enumerate().filter(|(_, (u, miss))| at_end(u) && *miss > fine);
        missed.fold(None, |sum, (k, (_, miss))| {
            let Missed { samples, largest, at } = sum.unwrap_or(Missed { samples: 0, largest: 0.0, at: k });
            let (largest, at) = if miss > largest { (miss, k) } else { (largest, at) };
            Some(Missed { samples: samples + 1, largest, at })
        })
    }
}
