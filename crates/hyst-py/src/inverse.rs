//! The ways in which a stage is inverted, for the table of models to choose from.

use std::sync::Arc;

use hyst_core::{Chain, CompensatorOptions, Error, Invert, Pi, Probe, Sampling, Search, Stage};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use crate::errors;
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

/// An inverse, and what is to be known of it.
pub(crate) struct Inverted {
    pub(crate) engine: Arc<dyn Engine>,
    /// Samples by which the reference must be known ahead.
    pub(crate) lead: usize,
    /// Band in which it holds \[Hz\]; none if it holds at all frequencies.
    pub(crate) bandwidth_hz: Option<f64>,
    /// Largest relative error inside that band.
    pub(crate) band_error: f64,
}

impl Inverted {
    /// An inverse without preview that holds at all frequencies.
    pub(crate) fn exact<I>(inverse: I) -> Self
    where
        I: Stage<f64> + Send + Sync + 'static,
        I::State: Send,
    {
        Self { engine: Arc::new(Runner::new(inverse)), lead: 0, bandwidth_hz: None, band_error: 0.0 }
    }

    /// An inverse that has to know `lead` samples of the reference ahead.
    pub(crate) fn previewed<I>(inverse: I, lead: usize) -> Self
    where
        I: Stage<f64> + Send + Sync + 'static,
        I::State: Send,
    {
        Self { lead, ..Self::exact(inverse) }
    }
}

/// Closed form: [`Invert`].
pub(crate) fn closed<P, S>(_: &P, stage: &S, options: &Options) -> PyResult<Inverted>
where
    S: Invert<f64>,
    S::Inverse: Send + Sync + 'static,
    <S::Inverse as Stage<f64>>::State: Send,
{
    options.only(&[])?;
    Ok(Inverted::exact(stage.invert().map_err(errors::core)?))
}

/// By search from `low` to `high` to within `tolerance`: [`Search`].
pub(crate) fn search<P, S>(_: &P, stage: &S, options: &Options) -> PyResult<Inverted>
where
    S: Probe<f64> + Clone + Send + Sync + 'static,
    S::State: Send,
{
    let (low, high, tolerance) = options.range()?;
    Ok(Inverted::exact(Search::new(stage.clone(), low, high, tolerance).map_err(errors::core)?))
}

/// Refused, with the reason.
pub(crate) fn refused<P, S>(why: &'static str) -> impl Fn(&P, &S, &Options) -> PyResult<Inverted> {
    move |_, _, options| {
        options.only(&[])?;
        Err(errors::not_invertible(format!("no inverse: {why}")))
    }
}

/// The identity as a hysteresis operator.
type Identity = Pi<f64, 1>;
/// A chain of one stage, with room for the surroundings of the longest preview.
type Alone = Chain<f64, Identity, DELAY, 1>;

/// Through the compensator of a chain that holds nothing but the stage which `add` puts into it.
pub(crate) fn compensator(
    period: f64,
    options: &Options,
    add: impl FnOnce(Alone, &Sampling) -> Result<Alone, Error>,
) -> PyResult<Inverted> {
    options.only(&["bandwidth_hz"])?;
    let sampling = Sampling { period };
    let build = || {
        let chain = add(Chain::new(Identity::new(1.0, &[], &[])?), &sampling)?;
        chain.compensator::<TAPS>(&sampling, &CompensatorOptions { bandwidth_hz: options.bandwidth_hz })
    };
    let inverse = build().map_err(errors::core)?;
    let (lead, bandwidth_hz, band_error) = (inverse.lead(), inverse.bandwidth_hz(), inverse.error());
    Ok(Inverted { engine: Arc::new(Runner::new(inverse)), lead, bandwidth_hz, band_error })
}
