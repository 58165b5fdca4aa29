//! Warning of an inverse that is at the end of its input range, because it cannot reach the reference.

use std::sync::Arc;

use pyo3::prelude::*;

use crate::arrays::Environment;
use crate::errors;
use crate::runner::Engine;

/// Input range of an inverse.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Ends {
    /// Minimum input \[u\].
    pub(crate) low: f64,
    /// Maximum input \[u\].
    pub(crate) high: f64,
    /// Maximum error of an input \[u\].
    pub(crate) tolerance: f64,
}

/// An error below this share of the output range counts as rounding.
const ROUNDING_SHARE: f64 = 1e-6;

/// Input range of an inverse, and the model that computes the output at its ends.
pub(crate) struct Clamp {
    pub(crate) ends: Ends,
    pub(crate) model: Arc<dyn Engine>,
}

/// Samples of a reference that the inverse cannot reach.
struct Unreached {
    samples: usize,
    /// Maximum error \[y\], and its sample.
    largest: f64,
    at: usize,
}

impl Clamp {
    /// Warns of the samples of `reference` for which the input `found` is at an end of the range.
    ///
    /// # Errors
    /// If the caller turns warnings into exceptions.
    pub(crate) fn warn(
        &self,
        py: Python<'_>,
        env: &Environment<'_>,
        (name, reference): (&str, &[f64]),
        found: &[f64],
    ) -> PyResult<()> {
        let Some(Unreached { samples, largest, at }) = py.detach(|| self.unreached(env, reference, found)) else {
            return Ok(());
        };
        let (of, Ends { low, high, .. }) = (reference.len(), self.ends);
        let message = format!(
            "{samples} of {of} samples of {name} are not reached by any input from {low:?} to {high:?}; they are missed by {largest:.4e} at most ({name}[{at}]), with the input at the nearer end"
        );
        errors::out_of_range(py, &message)
    }

    /// Returns the samples with an input at an end and an error above rounding.
    fn unreached(&self, env: &Environment<'_>, reference: &[f64], found: &[f64]) -> Option<Unreached> {
        let Ends { low, high, tolerance } = self.ends;
        let at_end = |u: &f64| *u <= low || *u >= high;
        if !found.iter().any(at_end) {
            return None;
        }
        // The ends of the range and the inputs of an inverse are finite.
        let at_rest = |u: f64| self.model.simulate(env, &[u]).ok()?.first().copied();
        let allowed = (at_rest(high)? - at_rest(low)?).abs() * (ROUNDING_SHARE + 10.0 * tolerance / (high - low));
        let reached = self.model.simulate(env, found).ok()?;
        let errors = reached.iter().zip(reference).map(|(y, wanted)| (y - wanted).abs());
        let unreached = found.iter().zip(errors).enumerate().filter(|(_, (u, error))| at_end(u) && *error > allowed);
        unreached.fold(None, |sum, (k, (_, error))| {
            let Unreached { samples, largest, at } = sum.unwrap_or(Unreached { samples: 0, largest: 0.0, at: k });
            let (largest, at) = if error > largest { (error, k) } else { (largest, at) };
            Some(Unreached { samples: samples + 1, largest, at })
        })
    }
}
