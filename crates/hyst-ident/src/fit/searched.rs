//! Models that are identified by search.

use std::ops::ControlFlow;

use hyst_core::Kind;

use super::{Fit, FitError, FitOptions, Optimizer, check, fitted_on, model_of, with_errors};
use crate::identify::{Family, Identified, SearchOptions, family_of, identify};
use crate::optimize::{Method, Progress, SearchError};
use crate::record::Record;
use crate::samples::Samples;
use crate::settle::start_up_rows;

/// Most rows that a global search looks at.
const SEARCHED: usize = 12_000;
/// Rows for each unknown that a fit needs.
const ROWS_EACH: usize = 3;

pub(super) fn fit(
    record: &Record,
    kind: Kind,
    options: &FitOptions,
    watch: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Fit, FitError> {
    let mut samples = Samples::from_record(record);
    check(record, &samples, super::sign_matters(kind))?;
    if kind_needs_temperature(kind) && samples.temperature.is_none() {
        return Err(FitError::Missing {
            record: record.name(),
            column: "temperature_degc".into(),
            advice: format!("{} is a model of it", kind.name()),
        });
    }
    let name = || record.name();
    let all = run(&samples, kind, options, &name, watch)?;
    // What is still ringing or remembers what was before the record says nothing about the model.
    let centred: Vec<f64> = all.0.residual.iter().map(|r| if r.is_finite() { *r } else { 0.0 }).collect();
    samples.settling = start_up_rows(&samples, &centred);
    let (found, how) =
        if samples.settling.iter().any(|s| *s) { run(&samples, kind, options, &name, watch)? } else { all };
    let zero = found.zeros.iter().sum::<f64>() / found.zeros.len().max(1) as f64;
    let mut model = model_of(record, &samples, found.base.clone(), zero, options.seed);
    model.fitted_on = fitted_on(record, &samples);
    let fit = Fit::at_once(with_errors(model, &found.estimate), &how);
    Ok(Fit { estimate: Some(found.estimate), trials: found.trials, evaluations: found.evaluations, ..fit })
}

fn kind_needs_temperature(kind: Kind) -> bool {
    matches!(kind, Kind::TdPi | Kind::TdEm)
}

/// One identification over the rows that count, and in words how it was done.
fn run(
    samples: &Samples,
    kind: Kind,
    options: &FitOptions,
    name: &dyn Fn() -> String,
    watch: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<(Identified, String), FitError> {
    if matches!(kind, Kind::Preisach | Kind::Dpm) {
        let advice = "it is linear in all its parameters, there is nothing to search: use auto or convex";
        return Err(FitError::Optimizer { kind: kind.name(), optimizer: "a search".into(), advice });
    }
    let unsupported = FitError::Unsupported { what: kind.name(), done: "fitted" };
    let family = family_of(kind, samples, &options.form).ok_or(unsupported)?;
    let family = Bounded { family, options };
    let variables = family.variables();
    let unknowns = variables.len() + family.linear().len() + 1;
    let settled = samples.settling.iter().filter(|s| !**s).count();
    let needed = ROWS_EACH * unknowns;
    if settled < needed {
        return Err(FitError::TooShort { record: name(), rows: settled, unknowns, needed });
    }
    for bound in &options.bounds {
        if !variables.iter().any(|v| v.name == bound.name) {
            let names: Vec<&str> = variables.iter().map(|v| v.name.as_str()).collect();
            let names = if names.is_empty() { "nothing".into() } else { names.join(", ") };
            return Err(FitError::UnknownBounds { name: bound.name.clone(), kind: kind.name(), names });
        }
    }
    let (method, how) = method(kind, options, variables.len(), family.linear().len())?;
    let method = options.population.map_or(method, |p| method.with_population(p));
    let search = SearchOptions {
        method,
        evaluations: options.evaluations.unwrap_or(1500 * variables.len().max(1) as u64),
        seed: options.seed,
        trials: options.trials,
        zero_per_record: options.zero_per_record,
    };
    let setup = |source| FitError::Search { record: name(), source: SearchError::Method(source) };
    method.build(variables.len().max(1), search.evaluations, search.seed).map_err(setup)?;
    // The valley shows in a part of the record.
    // An oscillator is an equation of motion in many substeps, and periods of it are short.
    let searched = if kind == Kind::BoucWenOscillator { SEARCHED / 6 } else { SEARCHED };
    let beginnings = (!variables.is_empty() && samples.len() > searched).then(|| samples.beginnings(searched));
    let quick = beginnings.as_ref().and_then(|b| Some((family_of(kind, b, &options.form)?, b)));
    let quick = quick.as_ref().map(|(family, rows)| (family.as_ref(), *rows));
    let found = identify(&family, samples, quick, &search, name, watch)?;
    Ok((found, how))
}

/// The search, and why it.
fn method(kind: Kind, options: &FitOptions, variables: usize, linear: usize) -> Result<(Method, String), FitError> {
    let wrong =
        |optimizer: &str, advice| Err(FitError::Optimizer { kind: kind.name(), optimizer: optimizer.into(), advice });
    let name = match &options.optimizer {
        Optimizer::Convex if variables > 0 => {
            return wrong("convex", "it is not linear in all its parameters: use auto, de, pso or gwo");
        }
        Optimizer::Search(name) if variables == 0 => {
            return wrong(name, "it is linear in all its parameters, there is nothing to search: use auto or convex");
        }
        Optimizer::Search(name) => name.as_str(),
        Optimizer::Auto | Optimizer::Convex => "de",
    };
    let method = Method::named(name, variables)
        .map_err(|e| FitError::Search { record: String::new(), source: SearchError::Method(e) })?;
    let count = |n: usize, what: &str| format!("{n} {what}{}", if n == 1 { "" } else { "s" });
    let how = if variables == 0 {
        let chosen = if kind == Kind::MaxwellSlip { ", widths chosen by the record" } else { "" };
        format!("convex: {} solved for at once{chosen}", count(linear, "weight"))
    } else {
        let chosen = if options.optimizer == Optimizer::Auto { " (auto: not linear in these)" } else { "" };
        format!(
            "{name}: {} searched{chosen}, {} solved for at each trial, then Levenberg-Marquardt",
            count(variables, "variable"),
            count(linear, "parameter")
        )
    };
    Ok((method, how))
}

/// A family with the caller's bounds.
struct Bounded<'a> {
    family: Box<dyn Family + 'a>,
    options: &'a FitOptions,
}

impl Family for Bounded<'_> {
    fn variables(&self) -> Vec<crate::optimize::Variable> {
        let mut list = self.family.variables();
        for v in &mut list {
            if let Some(b) = self.options.bounds.iter().find(|b| b.name == v.name) {
                (v.lower, v.upper) = (b.lower, b.upper);
            }
        }
        list
    }

    fn linear(&self) -> Vec<crate::identify::Linear> {
        self.family.linear()
    }

    fn columns(&self, values: &[f64], columns: &mut nalgebra::DMatrix<f64>) -> Result<(), hyst_core::Error> {
        self.family.columns(values, columns)
    }

    fn base(&self, values: &[f64], linear: &[f64]) -> crate::model::Base {
        self.family.base(values, linear)
    }

    fn scale(&self, base: &crate::model::Base, name: &str) -> Option<f64> {
        self.family.scale(base, name)
    }

    fn identified(&self, name: &str) -> bool {
        self.family.identified(name)
    }
}
