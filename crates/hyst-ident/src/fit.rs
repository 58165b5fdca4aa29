//! Fits a base model to a record.

mod basis;
mod check;
pub(crate) mod convex;
mod model;
mod options;
mod result;
mod searched;
mod settled;

use std::ops::ControlFlow;

use crate::BetweenSamples;
use crate::everett::fit_dpm;
use crate::model::{Kind, Model};
use crate::optimize::Progress;
use crate::record::Record;
use crate::simulate::{Zero, simulate};

pub use crate::error::FitError;
pub(crate) use basis::{BasisOf, CELLS, basis_for, basis_of};
pub(crate) use check::{check, sign_matters};
pub(crate) use model::{model_of, to_model};
pub use options::{FitOptions, Optimizer, VariableBounds};
pub use result::Fit;
pub(crate) use settled::fit_settled;

/// Fits a base model to a record; start-up rows are left out.
///
/// # Errors
/// See [`FitError`].
pub fn fit(record: &Record, kind: Kind, options: &FitOptions) -> Result<Model, FitError> {
    fit_with(record, kind, options, &mut |_| ControlFlow::Continue(())).map(|fit| fit.model)
}

/// Fits as [`fit`] does and returns the details.
///
/// `watch` is called after every generation of a search and may end it. The best result so far is then polished and
/// returned.
///
/// # Errors
/// See [`FitError`].
pub fn fit_with(
    record: &Record,
    kind: Kind,
    options: &FitOptions,
    watch: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Fit, FitError> {
    if options.form.between_samples == Some(BetweenSamples::BandLimited) && kind != Kind::BoucWenOscillator {
        return Err(FitError::BandLimited { kind: kind.name() });
    }
    options.suits(kind)?;
    let convex = options.convex();
    let mut fit: Fit = match kind {
        Kind::Pi | Kind::Preisach if convex => convex::fit(record, kind, options)?,
        Kind::Dpm if convex => fit_dpm(record, options)?.into(),
        _ => searched::fit(record, kind, options, watch)?,
    };
    let zero = if options.zero_per_record { Zero::PerRecord } else { Zero::None };
    fit.model.rmse = simulate(&fit.model, record, zero)?.errors.map(|errors| errors.rmse);
    Ok(fit)
}
