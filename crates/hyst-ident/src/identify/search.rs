//! A whole identification: global search, polish, standard errors.

use std::ops::ControlFlow;

use super::Family;
use super::polish::{Polished, SETTLED, polish};
use super::projection::{Left, Projected, Projection, space};
use super::slopes::{Ended, Optimum};
use super::uncertainty::Estimate;
use crate::Samples;
use crate::fit::FitError;
use crate::model::Base;
use crate::optimize::{Method, Progress, Space, Stop, Trials, trials};

/// How to search.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SearchOptions {
    pub(crate) method: Method,
    pub(crate) evaluations: u64,
    pub(crate) seed: u64,
    pub(crate) trials: usize,
}

/// What was identified.
#[derive(Clone, Debug)]
pub(crate) struct Identified {
    pub(crate) base: Base,
    pub(crate) zeros: Vec<f64>,
    pub(crate) estimate: Estimate,
    /// Searched variables that are held at a side of their box.
    pub(crate) ended: Vec<Ended>,
    /// The global searches; `None` if nothing had to be searched.
    pub(crate) trials: Option<Trials>,
    pub(crate) evaluations: u64,
}

/// Where a search and its polish have ended.
#[derive(Clone, Debug)]
pub(crate) struct Located {
    pub(super) values: Vec<f64>,
    projected: Projected,
    trials: Option<Trials>,
    evaluations: u64,
}

/// Relative fall of the sum of squares at which a polish ends that another one follows.
const ROUGHLY: f64 = 1e-6;
/// Points from which a polish starts, besides the best: ends of trials are many, valleys few.
const STARTS: usize = 3;

/// A family and the settled rows that it is identified from.
pub(crate) struct Identification<'a> {
    family: &'a dyn Family,
    pub(crate) samples: &'a Samples,
    zero_per_record: bool,
    projection: Projection<'a>,
    /// `None` if nothing has to be searched.
    space: Option<Space>,
    name: &'a str,
}

impl<'a> Identification<'a> {
    /// `name` is what errors call the record.
    ///
    /// # Errors
    /// If the bounds are no box.
    pub(crate) fn new(
        family: &'a dyn Family,
        samples: &'a Samples,
        zero_per_record: bool,
        name: &'a str,
    ) -> Result<Self, FitError> {
        let space = space(family).transpose().map_err(|source| FitError::Space { record: name.into(), source })?;
        let projection = Projection::new(family, samples, zero_per_record);
        Ok(Self { family, samples, zero_per_record, projection, space, name })
    }

    fn unsolvable(&self) -> FitError {
        FitError::Unsolvable { record: self.name.into() }
    }

    /// Searches globally and polishes, roughly, where the best trials have ended. Where `beginnings` of the record are given, with the same model
    /// over them, the global search looks at those alone; the polish sees all.
    ///
    /// # Errors
    /// If the search is set up wrongly, or no parameters within the bounds give a finite output.
    pub(crate) fn search(
        &self,
        beginnings: Option<(&dyn Family, &Samples)>,
        how: &SearchOptions,
        watch: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Located, FitError> {
        let Some(space) = &self.space else { return self.at_once() };
        let quick = beginnings.map(|(family, rows)| Projection::new(family, rows, self.zero_per_record));
        let cost = Left { projection: quick.as_ref().unwrap_or(&self.projection), dimensions: space.dimensions() };
        let stop = Stop { tolerance: 1e-6, stall: 60, ..Stop::after(how.evaluations) };
        let found = trials(space, &cost, &how.method, &stop, how.seed, how.trials, &mut |_, p| watch(p))
            .map_err(|source| FitError::Search { record: self.name.into(), source })?;
        let mut order: Vec<usize> = (0..found.found.len()).collect();
        order.sort_by(|a, b| found.found[*a].cost.total_cmp(&found.found[*b].cost));
        let mut best: Option<Polished> = None;
        let mut evaluations: u64 = found.found.iter().map(|f| f.evaluations).sum();
        for trial in order.iter().take(STARTS) {
            let start = space.point(&found.found[*trial].values);
            // Most of the way costs little over few rows.
            let nearer = quick.as_ref().and_then(|quick| polish(quick, space, &start, ROUGHLY));
            evaluations += nearer.as_ref().map_or(0, |p| p.evaluations);
            let start = nearer.map_or(start, |p| p.point);
            let Some(p) = polish(&self.projection, space, &start, ROUGHLY) else { continue };
            evaluations += p.evaluations;
            if best.as_ref().is_none_or(|b| p.projected.squares() < b.projected.squares()) {
                best = Some(p);
            }
        }
        let best = best.ok_or_else(|| self.unsolvable())?;
        let values = space.values(&best.point);
        Ok(Located { values, projected: best.projected, trials: Some(found), evaluations })
    }

    /// Polishes, roughly, from where another identification with the same variables has ended: of a drive that goes on otherwise
    /// between its samples.
    ///
    /// # Errors
    /// If there is no finite output at that point.
    pub(crate) fn roughly_from(&self, from: &Located) -> Result<Located, FitError> {
        self.from(from, ROUGHLY)
    }

    /// Polishes to the end from where another identification with the same variables has ended: of other rows.
    ///
    /// # Errors
    /// If there is no finite output at that point.
    pub(crate) fn polish(&self, from: &Located) -> Result<Located, FitError> {
        self.from(from, SETTLED)
    }

    fn from(&self, from: &Located, settled: f64) -> Result<Located, FitError> {
        let Some(space) = &self.space else { return self.at_once() };
        let start = space.point(&from.values);
        let p = polish(&self.projection, space, &start, settled).ok_or_else(|| self.unsolvable())?;
        Ok(Located {
            values: space.values(&p.point),
            projected: p.projected,
            trials: from.trials.clone(),
            evaluations: from.evaluations + p.evaluations,
        })
    }

    /// Where there is nothing to search.
    fn at_once(&self) -> Result<Located, FitError> {
        let projected = self.projection.at(&[]).ok_or_else(|| self.unsolvable())?;
        Ok(Located { values: Vec::new(), projected, trials: None, evaluations: 1 })
    }

    /// Measured minus predicted in every row, `NaN` in those that do not count.
    pub(crate) fn residual(&self, at: &Located) -> Vec<f64> {
        let mut residual = vec![f64::NAN; self.samples.len()];
        for (k, r) in self.projection.rows.iter().zip(at.projected.residual.as_slice()) {
            residual[*k] = *r;
        }
        residual
    }

    /// The model there, and what the rows say about its parameters.
    pub(crate) fn conclude(&self, mut at: Located) -> Identified {
        self.in_order(&mut at.values);
        let base = self.family.base(&at.values, &at.projected.linear);
        let (estimate, ended) = Optimum {
            family: self.family,
            samples: self.samples,
            projection: &self.projection,
            space: self.space.as_ref(),
            values: &at.values,
            projected: &at.projected,
        }
        .estimate();
        Identified { base, zeros: at.projected.zeros, estimate, ended, trials: at.trials, evaluations: at.evaluations }
    }

    /// Brings values into the model's order, if each is within the bounds of its new place.
    fn in_order(&self, values: &mut Vec<f64>) {
        let Some(space) = &self.space else { return };
        let mut other = values.clone();
        self.family.in_order(&mut other);
        if space.variables().iter().zip(&other).all(|(v, x)| (v.lower..=v.upper).contains(x)) {
            *values = other;
        }
    }
}
