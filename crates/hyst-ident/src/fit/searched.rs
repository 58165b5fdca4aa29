//! Models that are identified by search.

use std::ops::ControlFlow;

use hyst_core::Kind;

use super::{Fit, FitError, FitOptions, Optimizer, ROWS_EACH, check, model_of, with_errors};
use crate::BetweenSamples;
use crate::identify::{Beside, Ended, Family, Form, Identification, Located, SearchOptions, family_of, largest_input};
use crate::model::ZERO;
use crate::optimize::{Method, Progress, SearchError};
use crate::record::Record;
use crate::samples::Samples;
use crate::settle::start_up_rows;

/// Most rows that a global search looks at.
const SEARCHED: usize = 12_000;
/// Share of what a linear drive leaves that a band-limited one has to stay below: what makes no difference is linear.
const LESS: f64 = 0.99;

pub(super) fn fit(
    record: &Record,
    kind: Kind,
    options: &FitOptions,
    watch: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Fit, FitError> {
    let mut samples = Samples::from_record(record);
    check(record, &samples, false)?;
    // The operators rise: one that falls is fitted to the output with the other sign, which the model turns back.
    samples.falls &= super::sign_matters(kind);
    if samples.falls {
        samples.output.iter_mut().for_each(|y| *y = -*y);
    }
    if kind_needs_temperature(kind) && samples.temperature.is_none() {
        return Err(FitError::Missing {
            record: record.name(),
            column: "temperature_degc".into(),
            advice: format!("{} is a model of it", kind.name()),
        });
    }
    let name = record.name();
    let setup = Setup { kind, options, name: &name, largest: largest_input(&samples) };
    let Searched { best, left, how } = setup.search(&samples, watch)?;
    // What is still ringing or remembers what was before the record says nothing about the model.
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

/// Says where a searched variable has ended, and what to do about it if the model allows more.
fn at_bound(Ended { name, bound, beyond }: &Ended) -> String {
    let more = if *beyond { format!("; widen it with --bounds {name}=LOW..HIGH") } else { String::new() };
    format!("{name} ended at its bound {bound}{more}")
}

fn kind_needs_temperature(kind: Kind) -> bool {
    matches!(kind, Kind::TdPi | Kind::TdEm)
}

/// A fit to all rows with one way of the drive between them.
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

    /// The other one, if that leaves less; and what each leaves \[y\], over the rows that are a start-up for neither.
    fn or(self, other: Self) -> (Self, Vec<(BetweenSamples, f64)>) {
        let counts = |k: &usize| !self.settling[*k] && !other.settling[*k];
        let rmse = |t: &Self| {
            let kept: Vec<f64> = (0..t.residual.len()).filter(counts).map(|k| t.residual[k] * t.residual[k]).collect();
            (kept.iter().sum::<f64>() / kept.len().max(1) as f64).sqrt()
        };
        let (own, others) = (rmse(&self), rmse(&other));
        let left = vec![(self.between, own), (other.between, others)];
        (if others < LESS * own { other } else { self }, left)
    }
}

/// The best fit to all rows.
struct Searched {
    best: Tried,
    /// What each way leaves, if several were tried.
    left: Vec<(BetweenSamples, f64)>,
    /// In words, how it was found.
    how: String,
}

/// What is to be fitted, and how.
struct Setup<'a> {
    kind: Kind,
    options: &'a FitOptions,
    /// What errors call the record.
    name: &'a str,
    /// Largest |input| of the record.
    largest: f64,
}

impl<'a> Setup<'a> {
    /// How the drive may go on between samples.
    fn ways(&self) -> (BetweenSamples, Option<BetweenSamples>) {
        match (self.kind, self.options.form.between_samples) {
            (Kind::BoucWenOscillator, None) => (BetweenSamples::Linear, Some(BetweenSamples::BandLimited)),
            (_, way) => (way.unwrap_or_default(), None),
        }
    }

    /// The family over these rows, with the caller's bounds.
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
        let (settled, needed) = (samples.settling.iter().filter(|s| !**s).count(), ROWS_EACH * unknowns);
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

    /// The rows that a global search looks at, if they are not all: the valley shows in a part of the record.
    fn beginnings(&self, samples: &Samples) -> Option<Samples> {
        // An oscillator is an equation of motion in many substeps, and periods of it are short.
        let most = if self.kind == Kind::BoucWenOscillator { SEARCHED / 6 } else { SEARCHED };
        (samples.len() > most).then(|| samples.beginnings(most))
    }

    /// A search over all rows, and every way of the drive between them from where it has ended.
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

    /// The search of a family's variables, and in words what it is and why it.
    fn search_of(&self, family: &dyn Family) -> Result<(SearchOptions, String), FitError> {
        let Self { options, kind, .. } = *self;
        // From anywhere near, Levenberg-Marquardt finds an oscillator: its output is smooth in all variables.
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

    fn beside(&self, name: &str) -> Beside {
        self.family.beside(name)
    }

    fn in_order(&self, values: &mut [f64]) {
        self.family.in_order(values);
    }

    fn given(&self) -> Option<String> {
        self.family.given()
    }
}
