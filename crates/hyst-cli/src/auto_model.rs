//! The value `auto` of `--model`: fits a base model to records and diagnoses it.

use std::ops::ControlFlow;

use hyst_ident::diagnose::{DiagnoseOptions, Diagnosis, diagnose_until};
use hyst_ident::fit::{FitOptions, fit_with};
use hyst_ident::model::{Kind, Model};
use hyst_ident::record::Record;
use hyst_ident::simulate::Zero;
use hyst_ident::stop::Stop;

use crate::exit::{CommandError, CommandResult};

/// Value of `--model` for a base model that is fitted to the records.
pub(crate) const AUTO: &str = "auto";

/// Returns the kind of model with this name; `None` for `auto`.
pub(crate) fn kind_of(name: &str) -> CommandResult<Option<Kind>> {
    match name {
        AUTO => Ok(None),
        name => name.parse().map(Some).map_err(|error| CommandError::bad_input(format!("{name}: {error}, or {AUTO}"))),
    }
}

/// Fits a model to the records and diagnoses it.
/// Returns the model, the text of its file and the diagnosis.
///
/// Without a kind it fits pi, and then the base model that the diagnosis recommends, if it recommends one.
pub(crate) fn fitted_and_diagnosed(
    train: &Record,
    test: Option<&Record>,
    kind: Option<Kind>,
    options: &DiagnoseOptions,
    report: &(dyn Fn(&str) + Sync),
    stop: &Stop,
) -> CommandResult<(Model, String, Diagnosis)> {
    let fitting = FitOptions { zero_per_record: options.zero == Zero::PerRecord, ..FitOptions::default() };
    let of = |kind: Kind| {
        report(&format!("fitting {kind}"));
        let mut watch = |_| if stop.is_stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) };
        let model = fit_with(train, kind, &fitting, &mut watch)?.model;
        let diagnosis = diagnose_until(train, test, &model, options, report, stop)?;
        let text = model.to_json();
        Ok::<_, CommandError>((model, text, diagnosis))
    };
    let first = of(kind.unwrap_or(Kind::Pi))?;
    match &first.2.findings.base_advice {
        Some(advice) if kind.is_none() => of(advice.model),
        _ => Ok(first),
    }
}
