//! Builds a model from a fit.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::Path;

use hyst_core::ViscousPiParams;

use super::basis::BasisOf;
use crate::BetweenSamples;
use crate::base::DragParams;
use crate::identify::Estimate;
use crate::model::{Base, Channel, Effects, FittedOn, Model, ZERO, unit_of};
use crate::nested::Fitted;
use crate::record::{Record, Source};
use crate::samples::Samples;
use crate::statistics::range;

/// Adds the standard errors to a model, and the names of the parameters that the record does not determine.
pub(super) fn with_errors(mut model: Model, estimate: &Estimate) -> Model {
    let stage = model.base.kind().name();
    // The sensor's zero belongs to no stage.
    let key = |name: &str| if name == ZERO { name.into() } else { format!("{stage}.{name}") };
    let finite = estimate.parameters.iter().filter(|p| p.std_error.is_finite());
    model.std_errors = finite.map(|p| (key(&p.name), p.std_error)).collect();
    model.undetermined = estimate.undetermined().into_iter().filter(|name| *name != ZERO).map(key).collect();
    model
}

/// Builds a model from a fit.
pub(crate) fn to_model(record: &Record, samples: &Samples, basis: &BasisOf, fitted: &Fitted, seed: u64) -> Model {
    let zero = fitted.zeros.iter().sum::<f64>() / fitted.zeros.len().max(1) as f64;
    let base = match (basis.operator(&fitted.weights), fitted.hypothesis.drag) {
        (Base::Pi(pi), Some(DragParams { seconds, volt_seconds })) => {
            Base::ViscousPi(ViscousPiParams { pi, seconds, volt_seconds })
        }
        (base, _) => base,
    };
    Model { effects: fitted.hypothesis.effects.clone(), ..model_of(record, samples, base, zero, seed) }
}

/// Builds a model without effects that was fitted to the settled rows of a record.
pub(crate) fn model_of(record: &Record, samples: &Samples, base: Base, zero: f64, seed: u64) -> Model {
    let unit = record.output_unit();
    let (low, high) = samples.input_range();
    let (least, most) = range(samples.settled_output());
    Model {
        input: Channel { column: record.input_column().into(), unit: unit_of(record.input_column()), low, high },
        between_samples: BetweenSamples::Linear,
        output: Channel {
            column: unit.map_or("", |u| u.column()).into(),
            unit: unit.map_or("", |u| u.suffix()).into(),
            low: least,
            high: most,
        },
        falls: samples.falls,
        zero,
        base,
        effects: Effects::default(),
        std_errors: BTreeMap::new(),
        undetermined: BTreeSet::new(),
        rmse: None,
        recorded_at_hz: 1.0 / samples.period,
        fitted_on: fitted_on(record, samples),
        seed,
        version: env!("CARGO_PKG_VERSION").into(),
    }
}

fn fitted_on(record: &Record, samples: &Samples) -> Vec<FittedOn> {
    let of_file = |(source, rows): (&Source, Range<usize>)| {
        let settling_rows = samples.settling[rows.clone()].iter().filter(|s| **s).count();
        FittedOn {
            file: Path::new(&source.name)
                .file_name()
                .map_or_else(|| source.name.clone(), |n| n.to_string_lossy().into_owned()),
            sha256: source.sha256.clone().unwrap_or_default(),
            rows: rows.len() - settling_rows,
            settling_rows,
        }
    };
    record.sources().iter().zip(record.rows_of_files()).map(of_file).collect()
}
