//! Creates an operator from the keywords of a class.

use std::sync::Arc;

use hyst_core::{Build, Error, Sampling, Stage};
use pyo3::prelude::*;

use crate::arrays::Needs;
use crate::channels::Channels;
use crate::errors;
use crate::inversion::{Built, Inverted, Options};
use crate::keep::Keep;
use crate::operator::Operator;
use crate::runner::Runner;

/// Context in which a stage is built.
pub(crate) trait Context {
    /// Returns the context of a sample period \[s\], if there is one.
    fn at(period: Option<f64>) -> Self;
}

impl Context for () {
    fn at(_: Option<f64>) {}
}

impl Context for Sampling {
    fn at(period: Option<f64>) -> Self {
        // The build rejects NaN.
        Self { period: period.unwrap_or(f64::NAN) }
    }
}

impl Operator {
    /// Returns the operator of a class. `params` converts its keywords `given` to parameters of the core, from which
    /// the stage is built. `inverse` is the method of inversion.
    ///
    /// # Errors
    /// `ParameterError` with the message of the core.
    pub(crate) fn of_class<P, Q, S>(
        name: &'static str,
        needs: Needs,
        given: &P,
        params: impl FnOnce(&P) -> Result<Q, Error>,
        period: Option<f64>,
        inverse: impl Fn(&Built<'_, P, Q, S>, &Options) -> PyResult<Inverted> + Send + Sync + 'static,
    ) -> PyResult<Self>
    where
        P: Clone + Send + Sync + 'static,
        Q: Build<S, Context: Context> + Keep + Send + Sync + 'static,
        S: Stage<f64> + Send + Sync + 'static,
        S::State: Send + Sync,
    {
        let params = Arc::new(params(given).map_err(errors::core)?);
        let runner = Arc::new(Runner::new(params.build(&Context::at(period)).map_err(errors::core)?));
        let (engine, given, kept) = (Arc::clone(&runner), given.clone(), Arc::clone(&params));
        let inversion = move |options: &Options| {
            inverse(&Built { given: &given, params: &*params, stage: &*runner.stage, period }, options)
        };
        let to_model = move |channels: &Channels| {
            let kept = kept.keep().map_err(|why| errors::no_model_file(format!("{name}: {why}")))?;
            channels.model(kept, period)
        };
        Ok(Self::new(name, needs, engine, inversion, to_model))
    }
}
