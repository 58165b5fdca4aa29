//! The ways in which a stage is inverted, for the table of models to choose from.

use std::sync::Arc;

use hyst_core::{Chain, CompensatorOptions, Invert, Pi, Probe, Sampling, Search, Stage};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use crate::clamp::Ends;
use crate::errors;
use crate::keep::Keep;
use crate::runner::{Engine, Runner};
use hyst_ident::model::capacity::{DELAY, TAPS};

/// What the caller asked of an inverse; each way takes some of it and refuses the rest.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Options {
    /// Lowest input of a search.
    pub(crate) low: Option<f64>,
    /// Highest input of a search.
    pub(crate) high: Option<f64>,
    /// How near a search comes to the input.
    pub(crate) tolerance: Option<f64>,
    /// Band of a preview filter \[Hz\].
    pub(crate) bandwidth_hz: Option<f64>,
}

impl Options {
    /// Refuses what is given but not in `taken`.
    pub(crate) fn only(&self, taken: &[&str]) -> PyResult<()> {
        let given = [
            ("low", self.low),
            ("high", self.high),
            ("tolerance", self.tolerance),
            ("bandwidth_hz", self.bandwidth_hz),
        ];
        match given.iter().find(|(name, value)| value.is_some() && !taken.contains(name)) {
            None => Ok(()),
            Some((name, _)) => {
                let takes = if taken.is_empty() {
                    "takes no options".to_owned()
                } else {
                    format!("takes {}", taken.join(", "))
                };
                Err(PyTypeError::new_err(format!("{name} is of no use here: this inverse {takes}")))
            }
        }
    }

    /// Lowest input, highest input and tolerance of a search. The tolerance is a billionth of the range if it is not given.
    ///
    /// # Errors
    /// `TypeError` if an end of the range is missing.
    pub(crate) fn range(&self) -> PyResult<(f64, f64, f64)> {
        self.only(&["low", "high", "tolerance"])?;
        let (Some(low), Some(high)) = (self.low, self.high) else {
            return Err(PyTypeError::new_err(
                "this inverse is a search for the input: give low= and high=, the range of inputs",
            ));
        };
        Ok((low, high, self.tolerance.unwrap_or(1e-9 * (high - low))))
    }
}

/// What there is to invert: keywords of a class, the core's parameters that they are, and what was built of these.
pub(crate) struct Built<'a, P, Q, S> {
    pub(crate) given: &'a P,
    pub(crate) params: &'a Q,
    pub(crate) stage: &'a S,
    /// Sample period \[s\] of a class that has one.
    pub(crate) period: Option<f64>,
}

/// An inverse, and what is to be known of it.
pub(crate) struct Inverted {
    pub(crate) engine: Arc<dyn Engine>,
    /// Samples by which the reference must be known ahead.
    pub(crate) lead: usize,
    /// Band in which it holds \[Hz\]; none if it holds at all frequencies.
    pub(crate) bandwidth_hz: Option<f64>,
    /// Largest relative error inside that band.
    pub(crate) band_error: f64,
    /// Inputs that it does not leave: the nearer end is taken for references beyond what they reach.
    pub(crate) ends: Option<Ends>,
}

impl Inverted {
    /// An inverse without preview that holds at all frequencies.
    pub(crate) fn exact<I>(inverse: I) -> Self
    where
        I: Stage<f64> + Send + Sync + 'static,
        I::State: Send + Sync,
    {
        Self::in_band(inverse, 0, None)
    }

    /// An inverse that has to know `lead` samples of the reference ahead, and its band \[Hz\] with the largest relative error
    /// in it, if it does not hold at all frequencies.
    pub(crate) fn in_band<I>(inverse: I, lead: usize, band: Option<(f64, f64)>) -> Self
    where
        I: Stage<f64> + Send + Sync + 'static,
        I::State: Send + Sync,
    {
        let (bandwidth_hz, band_error) = (band.map(|(hz, _)| hz), band.map_or(0.0, |(_, error)| error));
        Self { engine: Arc::new(Runner::new(inverse)), lead, bandwidth_hz, band_error, ends: None }
    }

    /// The same, which does not leave these inputs and finds them to within `tolerance`.
    pub(crate) fn between(self, low: f64, high: f64, tolerance: f64) -> Self {
        Self { ends: Some(Ends { low, high, tolerance }), ..self }
    }
}

/// Closed form: [`Invert`].
pub(crate) fn closed<P, Q, S>(built: &Built<'_, P, Q, S>, options: &Options) -> PyResult<Inverted>
where
    S: Invert<f64>,
    S::Inverse: Send + Sync + 'static,
    <S::Inverse as Stage<f64>>::State: Send + Sync,
{
    options.only(&[])?;
    Ok(Inverted::exact(built.stage.invert().map_err(errors::core)?))
}

/// By search from `low` to `high` to within `tolerance`: [`Search`].
pub(crate) fn search<P, Q, S>(built: &Built<'_, P, Q, S>, options: &Options) -> PyResult<Inverted>
where
    S: Probe<f64> + Clone + Send + Sync + 'static,
    S::State: Send + Sync,
{
    let (low, high, tolerance) = options.range()?;
    let search = Search::new(built.stage.clone(), low, high, tolerance).map_err(errors::core)?;
    Ok(Inverted::exact(search).between(low, high, tolerance))
}

/// Refused, with the reason.
pub(crate) fn refused<P, Q, S>(why: &'static str) -> impl Fn(&Built<'_, P, Q, S>, &Options) -> PyResult<Inverted> {
    move |_, options| {
        options.only(&[])?;
        Err(errors::not_invertible(format!("no inverse: {why}")))
    }
}

/// The identity as a hysteresis operator.
type Identity = Pi<f64, 1>;
/// A chain of one stage, with room for the surroundings of the longest preview.
type Alone = Chain<f64, Identity, DELAY, 1>;

/// Through the compensator of a chain that holds nothing but this stage.
pub(crate) fn compensator<P, Q: Keep, S>(built: &Built<'_, P, Q, S>, options: &Options) -> PyResult<Inverted> {
    options.only(&["bandwidth_hz"])?;
    // A stage without a period does not depend on it.
    let sampling = Sampling { period: built.period.unwrap_or(1.0) };
    let kept = built.params.keep().map_err(|why| errors::not_invertible(format!("no inverse: {why}")))?;
    let build = || {
        let chain: Alone = kept.effects.to_params().around(Identity::new(1.0, &[], &[])?, &sampling)?;
        chain.compensator::<TAPS>(&sampling, &CompensatorOptions { bandwidth_hz: options.bandwidth_hz })
    };
    let inverse = build().map_err(errors::core)?;
    let (lead, band) = (inverse.lead(), inverse.bandwidth_hz().map(|hz| (hz, inverse.error())));
    Ok(Inverted::in_band(inverse, lead, band))
}
