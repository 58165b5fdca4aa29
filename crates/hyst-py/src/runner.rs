//! Common interface of all stages.

use std::any::Any;
use std::sync::{Mutex, PoisonError};

use hyst_core::{Env, Stage};

use crate::arrays::{Environment, not_finite};

/// Samples per block.
const BLOCK: usize = 512;

/// Index of the first input that is not finite.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct NotFinite(pub(crate) usize);

/// Operations of a stage for Python.
pub(crate) trait Engine: Send + Sync {
    /// Returns the output for an input signal, from rest.
    ///
    /// # Errors
    /// If an input is not finite.
    fn simulate(&self, env: &Environment<'_>, u: &[f64]) -> Result<Vec<f64>, NotFinite>;
    /// As [`simulate`](Self::simulate) for a stage with `lead` samples of preview. The first and last input are held,
    /// and the outputs are aligned with the inputs.
    ///
    /// # Errors
    /// If an input is not finite.
    fn follow(&self, env: &Environment<'_>, u: &[f64], lead: usize) -> Result<Vec<f64>, NotFinite>;
    /// Sets the history to rest at `u0` and returns the output.
    fn reset(&self, env: &Env<f64>, u0: f64) -> f64;
    /// Returns the output one sample later. The first sample sets the history to rest. The last finite input replaces
    /// an input that is not finite; `None` if there is none yet.
    fn step(&self, env: &Env<f64>, u: f64) -> Option<f64>;
    /// Returns a copy of the history; `None` before the first sample.
    fn history(&self) -> Option<AnyHistory>;
    /// Continues from a history. Returns false if it is not a history of this engine.
    fn resume(&self, history: &AnyHistory) -> bool;
}

/// A history of any engine.
pub(crate) type AnyHistory = Box<dyn Any + Send + Sync>;

/// Checks that all inputs are finite. The first of them has the index `from`.
fn check_finite(from: usize, inputs: &[f64]) -> Result<(), NotFinite> {
    not_finite(inputs).map_or(Ok(()), |k| Err(NotFinite(from + k)))
}

/// A stage with a history.
pub(crate) struct Runner<S: Stage<f64>> {
    pub(crate) stage: Box<S>,
    history: Mutex<Option<Box<History<S>>>>,
}

struct History<S: Stage<f64>> {
    state: S::State,
    /// The last finite input.
    last: f64,
}

impl<S: Stage<f64>> Runner<S> {
    pub(crate) fn new(stage: S) -> Self {
        Self { stage: Box::new(stage), history: Mutex::new(None) }
    }
}

impl<S> Engine for Runner<S>
where
    S: Stage<f64> + Send + Sync + 'static,
    S::State: Send + Sync,
{
    fn simulate(&self, env: &Environment<'_>, u: &[f64]) -> Result<Vec<f64>, NotFinite> {
        let Some((first, rest)) = u.split_first() else { return Ok(Vec::new()) };
        check_finite(0, &u[..1])?;
        let mut state = Box::new(self.stage.state());
        // Not zeroed first, because zeroing takes longer than a fast model.
        let mut y = Vec::with_capacity(u.len());
        y.push(self.stage.reset(&mut state, &env.at(0), *first));
        let (mut environment, mut outputs) = ([env.at(0); BLOCK], [0.0; BLOCK]);
        for inputs in rest.chunks(BLOCK) {
            // Checked per block, while the inputs are in the cache.
            check_finite(y.len(), inputs)?;
            if !env.constant() {
                for (slot, k) in environment.iter_mut().zip(y.len()..y.len() + inputs.len()) {
                    *slot = env.at(k);
                }
            }
            self.stage.block(&mut state, &environment, inputs, &mut outputs);
            y.extend_from_slice(&outputs[..inputs.len()]);
        }
        Ok(y)
    }

    fn follow(&self, env: &Environment<'_>, u: &[f64], lead: usize) -> Result<Vec<f64>, NotFinite> {
        if lead == 0 {
            return self.simulate(env, u);
        }
        let (Some(first), Some(last)) = (u.first(), u.len().checked_sub(1)) else { return Ok(Vec::new()) };
        check_finite(0, u)?;
        let mut state = Box::new(self.stage.state());
        self.stage.reset(&mut state, &env.at(0), *first);
        let mut step = |k: usize| {
            let k = k.min(last);
            self.stage.step(&mut state, &env.at(k), u[k])
        };
        for k in 1..lead {
            step(k);
        }
        Ok((0..u.len()).map(|k| step(k + lead)).collect())
    }

    fn reset(&self, env: &Env<f64>, u0: f64) -> f64 {
        let mut history = self.history.lock().unwrap_or_else(PoisonError::into_inner);
        let own = history.get_or_insert_with(|| Box::new(History { state: self.stage.state(), last: u0 }));
        own.last = u0;
        self.stage.reset(&mut own.state, env, u0)
    }

    fn step(&self, env: &Env<f64>, u: f64) -> Option<f64> {
        let mut history = self.history.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(own) = history.as_deref_mut() {
            if u.is_finite() {
                own.last = u;
            }
            return Some(self.stage.step(&mut own.state, env, own.last));
        }
        drop(history);
        u.is_finite().then(|| self.reset(env, u))
    }

    fn history(&self) -> Option<AnyHistory> {
        let history = self.history.lock().unwrap_or_else(PoisonError::into_inner);
        history.as_deref().map(|own| -> AnyHistory { Box::new((own.state.clone(), own.last)) })
    }

    fn resume(&self, history: &AnyHistory) -> bool {
        let Some((state, last)) = history.downcast_ref::<(S::State, f64)>() else { return false };
        let mut own = self.history.lock().unwrap_or_else(PoisonError::into_inner);
        *own = Some(Box::new(History { state: state.clone(), last: *last }));
        true
    }
}
