//! Methods of inversion for the table of models.

use std::sync::Arc;

use hyst_core::{Chain, CompensatorOptions, Invert, Pi, Probe, Sampling, Search, Stage};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use crate::clamp::Ends;
use crate::errors;
use crate::keep::Keep;
use crate::runner::{Engine, Runner};
use hyst_ident::model::capacity::{DELAY, TAPS};

/// Options of an inverse. Each method accepts some of them and rejects the others.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Options {
    /// Minimum input of a search.
    pub(crate) low: Option<f64>,
    /// Maximum input of a search.
    pub(crate) high: Option<f64>,
    /// Maximum error of the input of a search.
    pub(crate) tolerance: Option<f64>,
    /// Band of a preview filter \[Hz\].
    pub(crate) bandwidth_hz: Option<f64>,
}

impl Options {
    /// Rejects options that are given but not in `taken`.
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

    /// Returns minimum input, maximum input and tolerance of a search. The default tolerance is 1e-9 of the range.
    ///
    /// # Errors
    /// `TypeError` if an end of the range is missing.
    pub(crate) fn range(&self) -> PyResult<(f64, f64, f64)> {
        self.only(&["low", "high", "tolerance"])?;
        let (Some(low), Some(high)) = (self.low, self.high) else {
            return Err(PyTypeError::new_err("this inverse searches the input: give low= and high=, the input range"));
        };
        Ok((low, high, self.tolerance.unwrap_or(1e-9 * (high - low))))
    }
}

/// A stage to invert: keywords of the class, parameters of the core, and the stage built from them.
pub(crate) struct Built<'a, P, Q, S> {
    pub(crate) given: &'a P,
    pub(crate) params: &'a Q,
    pub(crate) stage: &'a S,
    /// Sample period \[s\], if the class has one.
    pub(crate) period: Option<f64>,
}

/// An inverse with its lead, band and input range.
pub(crate) struct Inverted {
    pub(crate) engine: Arc<dyn Engine>,
    /// Samples of preview of the reference.
    pub(crate) lead: usize,
    /// Band in which it is valid \[Hz\]; `None` if it is valid at all frequencies.
    pub(crate) bandwidth_hz: Option<f64>,
    /// Maximum relative error in that band.
    pub(crate) band_error: f64,
    /// Input range. For an unreachable reference the inverse uses the nearer end.
    pub(crate) ends: Option<Ends>,
}

impl Inverted {
    /// Returns an inverse without preview that is valid at all frequencies.
    pub(crate) fn exact<I>(inverse: I) -> Self
    where
        I: Stage<f64> + Send + Sync + 'static,
        I::State: Send + Sync,
    {
        Self::in_band(inverse, 0, None)
    }

    /// Returns an inverse with `lead` samples of preview, and with its band \[Hz\] and the maximum relative error in it
    /// if it is not valid at all frequencies.
    pub(crate) fn in_band<I>(inverse: I, lead: usize, band: Option<(f64, f64)>) -> Self
    where
        I: Stage<f64> + Send + Sync + 'static,
        I::State: Send + Sync,
    {
        let (bandwidth_hz, band_error) = (band.map(|(hz, _)| hz), band.map_or(0.0, |(_, error)| error));
        Self { engine: Arc::new(Runner::new(inverse)), lead, bandwidth_hz, band_error, ends: None }
    }

    /// Adds an input range and the `tolerance` of the inputs.
    pub(crate) fn between(self, low: f64, high: f64, tolerance: f64) -> Self {
        Self { ends: Some(Ends { low, high, tolerance }), ..self }
    }
}

/// Inverts in closed form with [`Invert`].
pub(crate) fn closed<P, Q, S>(built: &Built<'_, P, Q, S>, options: &Options) -> PyResult<Inverted>
where
    S: Invert<f64>,
    S::Inverse: Send + Sync + 'static,
    <S::Inverse as Stage<f64>>::State: Send + Sync,
{
    options.only(&[])?;
    Ok(Inverted::exact(built.stage.invert().map_err(errors::core)?))
}

/// Inverts by a search from `low` to `high` to `tolerance`: [`Search`].
pub(crate) fn search<P, Q, S>(built: &Built<'_, P, Q, S>, options: &Options) -> PyResult<Inverted>
where
    S: Probe<f64> + Clone + Send + Sync + 'static,
    S::State: Send + Sync,
{
    let (low, high, tolerance) = options.range()?;
    let search = Search::new(built.stage.clone(), low, high, tolerance).map_err(errors::core)?;
    Ok(Inverted::exact(search).between(low, high, tolerance))
}

/// Returns a method that rejects the inversion, with the reason.
pub(crate) fn refused<P, Q, S>(why: &'static str) -> impl Fn(&Built<'_, P, Q, S>, &Options) -> PyResult<Inverted> {
    move |_, options| {
        options.only(&[])?;
        Err(errors::not_invertible(format!("no inverse: {why}")))
    }
}

/// The identity as a hysteresis operator.
type Identity = Pi<f64, 1>;
/// A chain of one stage.
type Alone = Chain<f64, Identity, DELAY, 1>;

/// Inverts with the compensator of a chain that contains only this stage.
pub(crate) fn compensator<P, Q: Keep, S>(built: &Built<'_, P, Q, S>, options: &Options) -> PyResult<Inverted> {
    options.only(&["bandwidth_hz"])?;
    // A stage without a period does not depend on its value.
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
