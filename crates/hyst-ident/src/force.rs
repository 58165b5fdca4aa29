//! Estimates an external force without a force sensor.
//!
//! The difference between the measured displacement and the prediction of a model of the free actuator is a force on
//! the output's stiffness, `f̂ = k_out (x − (κ x̂₀ + χ))` ([`hyst_core::ForceObserver`]).

use hyst_core::{AffineFit, Build, ForceObservation, ForceParams};

use crate::error::FitError;
use crate::metrics::Errors;
use crate::model::{Effect, Model};
use crate::record::Record;
use crate::simulate::{Extrapolated, SimulateOptions, simulate_with};

/// Rows without an external force, from which κ and χ are estimated by least squares.
#[derive(Clone, Copy, Debug)]
pub enum Free<'a> {
    /// Unknown: κ = 1 and χ = 0.
    Unknown,
    /// All rows of another record.
    Record(&'a Record),
    /// The rows of the record itself up to this time \[s\].
    Until(f64),
}

/// Options of an estimation.
#[derive(Clone, Copy, Debug)]
pub struct ForceOptions<'a> {
    /// Output stiffness k_out \[N/output unit\].
    pub stiffness: f64,
    /// Rows without an external force.
    pub free: Free<'a>,
    /// Temperature \[°C\] for a record without a temperature column.
    pub temperature: Option<f64>,
}

/// Estimated force over a record.
#[derive(Clone, Debug)]
pub struct EstimatedForce {
    /// Force in each row \[N\].
    pub force: Vec<f64>,
    /// Stiffness, κ and χ.
    pub params: ForceParams,
    /// Number of rows from which κ and χ were estimated.
    pub free_rows: usize,
    /// Errors against the column `load_n`, if the record has it.
    pub errors: Option<Errors>,
    /// Inputs outside of the model's range.
    pub extrapolated: Extrapolated,
    /// Maximum force that a change of the gain by 1 % imitates \[N\].
    pub per_gain_percent: f64,
}

/// Reason why the force cannot be estimated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ForceError {
    /// The model cannot be simulated over the record.
    #[error(transparent)]
    Simulate(#[from] FitError),
    /// The displacement is missing.
    #[error("{record}: column {column} is missing; the force is estimated from this measured output")]
    NoOutput {
        /// The record.
        record: String,
        /// The column.
        column: String,
    },
    /// κ and χ cannot be estimated.
    #[error(
        "{record}: the prediction is constant over the {rows} rows without a force, so κ cannot be estimated; give rows in which the drive \
         moves, or omit the rows without a force"
    )]
    Still {
        /// The record with these rows.
        record: String,
        /// Number of rows.
        rows: usize,
    },
    /// Invalid stiffness.
    #[error(transparent)]
    Params(#[from] hyst_core::Error),
}

/// Estimates the force over a record with a model of the free actuator.
///
/// A compliance in the model is ignored, because the force would otherwise be part of the prediction.
///
/// # Errors
/// See [`ForceError`].
pub fn estimate_force(
    model: &Model,
    record: &Record,
    options: &ForceOptions<'_>,
) -> Result<EstimatedForce, ForceError> {
    let model = Model { effects: model.effects.without(Effect::Load), ..model.clone() };
    let free = |record: &Record| -> Result<_, ForceError> {
        let options = SimulateOptions { temperature: options.temperature, at_rest: true, ..SimulateOptions::default() };
        let simulated = simulate_with(&model, record, &options)?;
        let no_output = || ForceError::NoOutput { record: record.name(), column: model.output.column.clone() };
        Ok((simulated, record.output().ok_or_else(no_output)?.to_vec()))
    };
    let (simulated, measured) = free(record)?;
    let (mut kappa, mut chi, mut free_rows) = (1.0, 0.0, 0);
    let mut fit = AffineFit::default();
    let mut still = record.name();
    let mut rows = |count: usize, free: &[f64], measured: &[f64]| {
        free_rows = count;
        free.iter().zip(measured).for_each(|(x0, x)| fit.add(*x0, *x));
    };
    match options.free {
        Free::Unknown => {}
        Free::Record(other) => {
            let (simulated, measured) = free(other)?;
            still = other.name();
            rows(measured.len(), &simulated.predicted, &measured);
        }
        Free::Until(end) => {
            let count = record.time().iter().take_while(|t| **t <= end).count();
            rows(count, &simulated.predicted[..count], &measured[..count]);
        }
    }
    if !matches!(options.free, Free::Unknown) {
        (kappa, chi) = fit.solve().ok_or(ForceError::Still { record: still, rows: free_rows })?;
    }
    let params = ForceParams { stiffness: options.stiffness, kappa, chi };
    let observation: ForceObservation<f64> = params.build(&())?;
    let force: Vec<f64> = measured.iter().zip(&simulated.predicted).map(|(x, x0)| observation.force(*x, *x0)).collect();
    let of = |load: &[f64]| Errors::of(load, &force, &vec![false; force.len()]).ok();
    let errors = record.load().and_then(of);
    // The gain acts on the travel from the output at zero input, which is the zero of the sensor.
    let travel = simulated.predicted.iter().map(|x0| (kappa * (x0 - model.zero)).abs()).fold(0.0, f64::max);
    let per_gain_percent = 0.01 * options.stiffness * travel;
    let extrapolated = simulated.extrapolated;
    Ok(EstimatedForce { params, free_rows, errors, extrapolated, per_gain_percent, force })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::{FitOptions, fit_with};
    use crate::record::{Columns, OutputUnit};
    use hyst_core::Kind;
    use std::f64::consts::TAU;
    use std::ops::ControlFlow;

    /// A linear actuator with 0.2 µm/V, from 3 s under a force of up to 4 N on 0.8 N/µm.
    fn record(gain: f64, zero: f64, name: &str) -> Record {
        let time: Vec<f64> = (0..6000).map(|k| f64::from(k) * 1e-3).collect();
        let input: Vec<f64> = time.iter().map(|t| 40.0 - 40.0 * (TAU * 0.7 * t).cos()).collect();
        let force = |t: &f64| if *t > 3.0 { -4.0 * (TAU * 2.0 * (t - 3.0)).sin().powi(2) } else { 0.0 };
        let output = time.iter().zip(&input).map(|(t, u)| zero + gain * u + force(t) / 0.8).collect();
        let load = time.iter().map(force).collect();
        Record::from_samples(Columns {
            name: name.into(),
            time,
            input: Some(input),
            output: Some((OutputUnit::Micrometre, output)),
            load: Some(load),
            ..Columns::default()
        })
        .unwrap()
    }

    fn model() -> Model {
        let mut free = record(0.2, 0.0, "free");
        let rows = free.time().iter().take_while(|t| **t <= 3.0).count();
        free = Record::from_samples(Columns {
            name: "free".into(),
            time: free.time()[..rows].to_vec(),
            input: Some(free.input()[..rows].to_vec()),
            output: Some((OutputUnit::Micrometre, free.output().unwrap()[..rows].to_vec())),
            ..Columns::default()
        })
        .unwrap();
        let options = FitOptions { seed: 1, ..FitOptions::default() };
        fit_with(&free, Kind::Pi, &options, &mut |_| ControlFlow::Continue(())).unwrap().model
    }

    #[test]
    fn a_force_is_estimated_with_a_changed_gain_and_zero() {
        let (model, loaded) = (model(), record(0.21, 1.5, "loaded"));
        let estimate =
            |free| estimate_force(&model, &loaded, &ForceOptions { stiffness: 0.8, free, temperature: None }).unwrap();
        let corrected = estimate(Free::Until(3.0));
        assert!(
            (corrected.params.kappa - 1.05).abs() < 1e-3 && (corrected.params.chi - 1.5).abs() < 1e-2,
            "{:?}",
            corrected.params
        );
        assert_eq!(corrected.free_rows, 3001);
        assert!(corrected.errors.unwrap().max_abs < 0.02, "{:?}", corrected.errors);
        // Uncorrected, the changes of gain and zero look like a force.
        let uncorrected = estimate(Free::Unknown);
        assert!(uncorrected.errors.unwrap().max_abs > 1.0, "{:?}", uncorrected.errors);
        assert_eq!((uncorrected.params.kappa, uncorrected.params.chi), (1.0, 0.0));
    }

    #[test]
    fn kappa_cannot_be_estimated_from_a_constant_prediction() {
        let (model, loaded) = (model(), record(0.2, 0.0, "loaded"));
        let free = Free::Until(0.0);
        let refused = estimate_force(&model, &loaded, &ForceOptions { stiffness: 0.8, free, temperature: None });
        assert!(matches!(refused, Err(ForceError::Still { rows: 1, .. })), "{refused:?}");
        for stiffness in [0.0, -1.0, f64::NAN] {
            let options = ForceOptions { stiffness, free: Free::Unknown, temperature: None };
            assert!(matches!(estimate_force(&model, &loaded, &options), Err(ForceError::Params(_))));
        }
    }
}
