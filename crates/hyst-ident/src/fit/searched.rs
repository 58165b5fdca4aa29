//! Models that are identified by search.

use std::ops::ControlFlow;

use hyst_core::Kind;

use super::basis::ROWS_PER_UNKNOWN;
use super::check::{check, sign_matters};
use super::model::{model_of, with_errors};
use super::options::{FitOptions, Optimizer};
use super::result::Fit;
use crate::BetweenSamples;
use crate::error::FitError;
use crate::identify::{
    Ended, Family, Form, Identification, Located, OtherParameter, SearchOptions, family_of, largest_input,
};
use crate::model::ZERO;
use crate::optimize::{Method, Progress, SearchError};
use crate::record::Record;
use crate::samples::Samples;
use crate::settle::start_up_rows;

/// Maximum number of rows of a global search.
const MAX_SEARCH_ROWS: usize = 12_000;
/// Maximum ratio of the residual with a band-limited drive to that with a linear one, at which the band-limited one is
/// used.
const MAX_RESIDUAL_RATIO: f64 = 0.99;

pub(super) fn fit(
    record: &Record,
    kind: Kind,
    options: &FitOptions,
    watch: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Fit, FitError> {
    let mut samples = Samples::from_record(record);
    check(record, &samples, false)?;
    // The operators increase. For a decreasing output they are fitted to its negative, and the model inverts the sign.
    samples.falls &= sign_matters(kind);
    if samples.falls {
        samples.output.iter_mut().for_each(|y| *y = -*y);
    }
    if kind_needs_temperature(kind) && samples.temperature.is_none() {
        return Err(FitError::Missing {
            record: record.name(),
            column: "temperature_degc".into(),
            advice: format!("{} models the temperature dependence", kind.name()),
        });
    }
    let name = record.name();
    let setup = Setup { kind, options, name: &name, largest: largest_input(&samples) };
    let Searched { best, left, how } = setup.search(&samples, watch)?;
    // Rows that still ring, or that depend on the memory from before the record, do not count.
    samples.settling = best.settling;
    let (mut found, given) = {
        let family = setup.family(&samples, best.between)?;
        let identification = Identification::new(&family, &samples, options.zero_per_record, &name)?;
        (identification.conclude(identification.polish(&best.located)?), family.given())
    };
    let mut zero = found.zeros.iter().sum::<f64>() / found.zeros.len().max(1) as f64;
    if samples.falls {
        samples.output.iter_mut().for_each(|y| *y = -*y);
        zero = -zero;
        let zeros = found.estimate.parameters.iter_mut().filter(|p| p.name.starts_with(ZERO));
        zeros.for_each(|p| p.value = -p.value);
    }
    let mut model = model_of(record, &samples, found.base.clone(), zero, options.seed);
    model.between_samples = best.between;
    let how = [how].into_iter().chain(given).chain(found.ended.iter().map(at_bound)).collect::<Vec<_>>();
    let fit = Fit::at_once(with_errors(model, &found.estimate), &how.join("; "));
    let (trials, evaluations) = (found.trials, found.evaluations);
    Ok(Fit { estimate: Some(found.estimate), trials, evaluations, between_samples: left, ..fit })
}

/// Describes a searched variable that ended at a bound, with the option that widens it if the model allows more.
fn at_bound(Ended { name, bound, beyond }: &Ended) -> String {
    let more = if *beyond { format!("; widen it with --bounds {name}=LOW..HIGH") } else { String::new() };
    format!("{name} ended at its bound {bound}{more}")
}

fn kind_needs_temperature(kind: Kind) -> bool {
    matches!(kind, Kind::TdPi | Kind::TdEm)
}

/// A fit to all rows with one interpolation of the drive between samples.
struct Tried {
    between: BetweenSamples,
    located: Located,
    residual: Vec<f64>,
    settling: Vec<bool>,
}

impl Tried {
    fn new(between: BetweenSamples, identification: &Identification<'_>, located: Located) -> Self {
        let residual = identification.residual(&located);
        Self { between, settling: start_up_rows(identification.samples, &residual), residual, located }
    }

    /// Chooses the other fit if its residual is smaller. Returns the residual of each too \[y\], over the rows that are
    /// start-up for neither.
    fn or(self, other: Self) -> (Self, Vec<(BetweenSamples, f64)>) {
        let counts = |k: &usize| !self.settling[*k] && !other.settling[*k];
        let rmse = |t: &Self| {
            let kept: Vec<f64> = (0..t.residual.len()).filter(counts).map(|k| t.residual[k] * t.residual[k]).collect();
            (kept.iter().sum::<f64>() / kept.len().max(1) as f64).sqrt()
        };
        let (own, others) = (rmse(&self), rmse(&other));
        let left = vec![(self.between, own), (other.between, others)];
        (if others < MAX_RESIDUAL_RATIO * own { other } else { self }, left)
    }
}

/// The best fit to all rows.
struct Searched {
    best: Tried,
    /// Residual of each interpolation, if several were tried.
    left: Vec<(BetweenSamples, f64)>,
    /// Description of the search.
    how: String,
}

/// What to fit, and with which options.
struct Setup<'a> {
    kind: Kind,
    options: &'a FitOptions,
    /// Name of the record in errors.
    name: &'a str,
    /// Largest |input| of the record.
    largest: f64,
}

impl<'a> Setup<'a> {
    /// Returns the interpolation of the drive between samples, and a second one to try.
    fn ways(&self) -> (BetweenSamples, Option<BetweenSamples>) {
        match (self.kind, self.options.form.between_samples) {
            (Kind::BoucWenOscillator, None) => (BetweenSamples::Linear, Some(BetweenSamples::BandLimited)),
            (_, way) => (way.unwrap_or_default(), None),
        }
    }

    /// Returns the family over these rows, with the caller's bounds.
    fn family<'s>(&self, samples: &'s Samples, between: BetweenSamples) -> Result<Bounded<'s>, FitError>
    where
        'a: 's,
    {
        let Self { kind, options, largest, .. } = *self;
        let form = Form { between_samples: Some(between), ..options.form };
        let advice = "it is linear in all its parameters, there is nothing to search: use auto or convex";
        let linear = || FitError::Optimizer { kind: kind.name(), optimizer: "a search".into(), advice };
        let family = Bounded { family: family_of(kind, samples, largest, &form).ok_or_else(linear)?, options };
        let variables = family.variables();
        let unknowns = variables.len() + family.linear().len() + 1;
        let (settled, needed) = (samples.settling.iter().filter(|s| !**s).count(), ROWS_PER_UNKNOWN * unknowns);
        if settled < needed {
            return Err(FitError::TooShort { record: self.name.into(), rows: settled, unknowns, needed });
        }
        for bound in &options.bounds {
            if !variables.iter().any(|v| v.name == bound.name) {
                let names: Vec<&str> = variables.iter().map(|v| v.name.as_str()).collect();
                let names = if names.is_empty() { "nothing".into() } else { names.join(", ") };
                return Err(FitError::UnknownBounds { name: bound.name.clone(), kind: kind.name(), names });
            }
        }
        Ok(family)
    }

    /// Returns the rows of a global search, if not all are used: a part of the record suffices to find the optimum
    /// roughly.
    fn beginnings(&self, samples: &Samples) -> Option<Samples> {
        // An oscillator is integrated in many substeps, and its periods are short.
        let most = if self.kind == Kind::BoucWenOscillator { MAX_SEARCH_ROWS / 6 } else { MAX_SEARCH_ROWS };
        (samples.len() > most).then(|| samples.beginnings(most))
    }

    /// Searches over all rows, then tries every interpolation of the drive from the result.
    fn search(
        &self,
        samples: &Samples,
        watch: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Searched, FitError> {
        let (first, other) = self.ways();
        let family = self.family(samples, first)?;
        let (search, how) = self.search_of(&family)?;
        let identification = Identification::new(&family, samples, self.options.zero_per_record, self.name)?;
        let beginnings = self.beginnings(samples);
        let shorter = beginnings.as_ref().map(|rows| self.family(rows, first)).transpose()?;
        let quick = shorter.as_ref().zip(beginnings.as_ref()).map(|(family, rows)| (family as &dyn Family, rows));
        let located = identification.search(quick, &search, watch)?;
        let linear = Tried::new(first, &identification, located);
        let (best, left) = match other {
            None => (linear, Vec::new()),
            Some(other) => {
                let family = self.family(samples, other)?;
                let identification = Identification::new(&family, samples, self.options.zero_per_record, self.name)?;
                let located = identification.roughly_from(&linear.located)?;
                linear.or(Tried::new(other, &identification, located))
            }
        };
        Ok(Searched { best, left, how })
    }

    /// Returns the search over a family's variables, and its description.
    fn search_of(&self, family: &dyn Family) -> Result<(SearchOptions, String), FitError> {
        let Self { options, kind, .. } = *self;
        // Levenberg-Marquardt finds an oscillator from a nearby start, because its output is smooth in all variables.
        let each = if kind == Kind::BoucWenOscillator { 200 } else { 1500 };
        let variables = family.variables().len();
        let (method, how) = self.method(variables, family.linear().len())?;
        let method = options.population.map_or(method, |p| method.with_population(p));
        let search = SearchOptions {
            method,
            evaluations: options.evaluations.unwrap_or(each * variables.max(1) as u64),
            seed: options.seed,
            trials: options.trials,
        };
        let setup = |source| FitError::Search { record: self.name.into(), source: SearchError::Method(source) };
        method.build(variables.max(1), search.evaluations, search.seed).map_err(setup)?;
        Ok((search, how))
    }

    fn method(&self, variables: usize, linear: usize) -> Result<(Method, String), FitError> {
        let wrong = |optimizer: &str, advice| {
            Err(FitError::Optimizer { kind: self.kind.name(), optimizer: optimizer.into(), advice })
        };
        let name = match &self.options.optimizer {
            Optimizer::Convex if variables > 0 => {
                return wrong("convex", "it is not linear in all its parameters: use auto, de, pso or gwo");
            }
            Optimizer::Search(name) if variables == 0 => {
                return wrong(
                    name,
                    "it is linear in all its parameters, there is nothing to search: use auto or convex",
                );
            }
            Optimizer::Search(name) => name.as_str(),
            Optimizer::Auto | Optimizer::Convex => "de",
        };
        let method = Method::named(name, variables)
            .map_err(|e| FitError::Search { record: String::new(), source: SearchError::Method(e) })?;
        let count = |n: usize, what: &str| format!("{n} {what}{}", if n == 1 { "" } else { "s" });
        let how = if variables == 0 {
            let chosen = if self.kind == Kind::MaxwellSlip { ", widths chosen by the record" } else { "" };
            format!("convex: {} solved for at once{chosen}", count(linear, "weight"))
        } else {
            let chosen = if self.options.optimizer == Optimizer::Auto { " (auto: not linear in these)" } else { "" };
            format!(
                "{name}: {} searched{chosen}, {} solved for at each trial, then Levenberg-Marquardt",
                count(variables, "variable"),
                count(linear, "parameter")
            )
        };
        Ok((method, how))
    }
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

    fn between_samples(&self) -> BetweenSamples {
        self.family.between_samples()
    }

    fn identified(&self, name: &str) -> bool {
        self.family.identified(name)
    }

    fn other_parameter(&self, name: &str) -> OtherParameter {
        self.family.other_parameter(name)
    }

    fn in_order(&self, values: &mut [f64]) {
        self.family.in_order(values);
    }

    fn given(&self) -> Option<String> {
        self.family.given()
    }
}
