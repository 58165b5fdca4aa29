//! Diagnosis: finds the effects that a fitted model misses, names them, adds them and reports the errors before and
//! after.
//!
//! First, a limit of the drive is searched (`rail.rs`), which any rich basis would represent. All steps see the limited
//! drive.
//!
//! 1. **Search** on a screening basis (`base/screening.rs`): rate-independent, with many unknowns, so that the misfit
//!    of a coarse base model is not mistaken for an effect. A forward beam search is followed by elimination and swaps.
//!    Every trial refits the whole nested model. An operator that is not refitted is one column of the screening basis.
//! 2. **Judge** each effect by cross-validation inside the training record. A block bootstrap must confirm the gain.
//!    The gain must also be large against the noise floor and against the residual. A tone of the sensor only has to be
//!    large against the noise floor.
//! 3. **Check** the result on a Preisach basis if that predicts better: drop the effects that it does not need and
//!    search for further ones. Check the model's base for a missing curve (asymmetry or saturation). If that base is not
//!    linear in its parameters, play operators replace it in this check (`stand_in.rs`).
//! 4. **Extend** the user's model with the effects and refit all its weights, or move its parameters if it is not linear
//!    in them (`follow.rs`). Estimate the start of each segment again.
//!    Refit the parameters of the effects too if the model then follows the record as well as the screening basis does.

mod advice;
mod causes;
mod changed;
mod collect;
mod colour;
mod context;
mod curve_search;
mod diagnosis;
mod effects;
mod evidence;
mod extension;
mod findings;
mod finer;
mod follow;
mod history;
mod limit;
mod limits;
mod named;
mod own_base;
mod own_model;
mod probability;
mod rail;
mod remainder;
mod rows;
mod scan;
mod score;
mod search;
mod settled;
mod shape;
mod single_loop;
mod spectrum;
mod stand_in;
mod start;
mod starts;
mod steps;
mod suspects;
mod tone;
mod trial;
mod trial_parameters;
mod uncertainty;

pub use diagnosis::{DiagnoseOptions, Diagnosis};
pub use effects::EffectKind;
pub use evidence::{Axis, Breakdown, Curve, MOST_POINTS, Mark, Part, Picture, Role, Style};
pub use findings::{
    Alternative, BaseAdvice, Change, Errors as FoundErrors, Finding, Findings, Found, LeftOut, MOST_LISTED, OnRecords,
    Remainder, RemainderKind, Rows, Suspect, Verdict,
};
pub use limit::Limit;
pub use probability::{FEATURES, Weighed};
pub use suspects::{FOLLOWED, drive_options, usual_rival};

use crate::fit::FitError;
use crate::model::Model;
use crate::record::Record;
use crate::stop::{Stop, until_stopped};
use steps::found_in;

/// Diagnoses a model on the record that it was fitted to.
///
/// `test` is simulated and never fitted. `progress` receives a line of text at each step.
///
/// # Errors
/// See [`FitError`].
pub fn diagnose(
    train: &Record,
    test: Option<&Record>,
    model: &Model,
    options: &DiagnoseOptions,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Diagnosis, FitError> {
    diagnose_until(train, test, model, options, progress, &Stop::default())
}

/// Diagnoses as [`diagnose`] does; `stop` ends the computation from another thread.
///
/// # Errors
/// See [`FitError`]; [`FitError::Stopped`] if `stop` ended it.
pub fn diagnose_until(
    train: &Record,
    test: Option<&Record>,
    model: &Model,
    options: &DiagnoseOptions,
    progress: &(dyn Fn(&str) + Sync),
    stop: &Stop,
) -> Result<Diagnosis, FitError> {
    let found = until_stopped(|| found_in(train, test, model, options, progress, stop));
    found.unwrap_or_else(|| Err(FitError::Stopped { record: train.name() }))
}
