//! A complete identification: global search, local refinement, standard errors.

use std::ops::ControlFlow;

use super::Family;
use super::polish::{CONVERGED_FALL, Polished, polish};
use super::projection::{Projected, Projection, ResidualRms, space};
use super::slopes::{Ended, Optimum};
use super::uncertainty::Estimate;
use crate::Samples;
use crate::error::FitError;
use crate::model::Base;
use crate::optimize::{Method, Progress, Space, Stop, Trials, trials};

/// Options of a search.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SearchOptions {
    pub(crate) method: Method,
    pub(crate) evaluations: u64,
    pub(crate) seed: u64,
    pub(crate) trials: usize,
}

/// Result of an identification.
#[derive(Clone, Debug)]
pub(crate) struct Identified {
    pub(crate) base: Base,
    pub(crate) zeros: Vec<f64>,
    pub(crate) estimate: Estimate,
    /// Searched variables that are held at a side of their box.
    pub(crate) ended: Vec<Ended>,
    /// The global searches; `None` if nothing was searched.
    pub(crate) trials: Option<Trials>,
    pub(crate) evaluations: u64,
}

/// Result of a search and its refinement.
#[derive(Clone, Debug)]
pub(crate) struct Located {
    pub(super) values: Vec<f64>,
    projected: Projected,
    trials: Option<Trials>,
    evaluations: u64,
}

/// Relative fall of the sum of squares at which a rough refinement ends; a final one follows.
const ROUGH_FALL: f64 = 1e-6;
/// Maximum number of trials whose results are refined: many trials end in the same few valleys.
const MAX_REFINED_TRIALS: usize = 3;

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
    /// Prepares an identification; `name` is the name of the record in errors.
    ///
    /// # Errors
    /// If the bounds are invalid.
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

    /// Searches globally and refines the best results roughly.
    /// If `beginnings` of the record are given, with the same model over them, the global search uses only those rows.
    /// The refinement uses all rows.
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
        let cost =
            ResidualRms { projection: quick.as_ref().unwrap_or(&self.projection), dimensions: space.dimensions() };
        let stop = Stop { tolerance: 1e-6, stall: 60, ..Stop::after(how.evaluations) };
        let found = trials(space, &cost, &how.method, &stop, how.seed, how.trials, &mut |_, p| watch(p))
            .map_err(|source| FitError::Search { record: self.name.into(), source })?;
        let mut order: Vec<usize> = (0..found.found.len()).collect();
        order.sort_by(|a, b| found.found[*a].cost.total_cmp(&found.found[*b].cost));
        let mut best: Option<Polished> = None;
        let mut evaluations: u64 = found.found.iter().map(|f| f.evaluations).sum();
        for trial in order.iter().take(MAX_REFINED_TRIALS) {
            let start = space.point(&found.found[*trial].values);
            // Search over the few rows first, because this costs little.
            let nearer = quick.as_ref().and_then(|quick| polish(quick, space, &start, ROUGH_FALL));
            evaluations += nearer.as_ref().map_or(0, |p| p.evaluations);
            let start = nearer.map_or(start, |p| p.point);
            let Some(p) = polish(&self.projection, space, &start, ROUGH_FALL) else { continue };
            evaluations += p.evaluations;
            if best.as_ref().is_none_or(|b| p.projected.squares() < b.projected.squares()) {
                best = Some(p);
            }
        }
        let best = best.ok_or_else(|| self.unsolvable())?;
        let values = space.values(&best.point);
        Ok(Located { values, projected: best.projected, trials: Some(found), evaluations })
    }

    /// Refines roughly from the result of another identification with the same variables, for another interpolation of
    /// the drive between samples.
    ///
    /// # Errors
    /// If the output at that point is not finite.
    pub(crate) fn roughly_from(&self, from: &Located) -> Result<Located, FitError> {
        self.from(from, ROUGH_FALL)
    }

    /// Refines to convergence from the result of another identification with the same variables, over other rows.
    ///
    /// # Errors
    /// If the output at that point is not finite.
    pub(crate) fn polish(&self, from: &Located) -> Result<Located, FitError> {
        self.from(from, CONVERGED_FALL)
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

    /// Solves without a search.
    fn at_once(&self) -> Result<Located, FitError> {
        let projected = self.projection.at(&[]).ok_or_else(|| self.unsolvable())?;
        Ok(Located { values: Vec::new(), projected, trials: None, evaluations: 1 })
    }

    /// Returns measured minus predicted output in every row, `NaN` in rows that do not count.
    pub(crate) fn residual(&self, at: &Located) -> Vec<f64> {
        let mut residual = vec![f64::NAN; self.samples.len()];
        for (k, r) in self.projection.rows.iter().zip(at.projected.residual.as_slice()) {
            residual[*k] = *r;
        }
        residual
    }

    /// Returns the model, and the estimates of its parameters.
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

    /// Sorts the values into the model's order, if each is within the bounds of its new position.
    fn in_order(&self, values: &mut Vec<f64>) {
        let Some(space) = &self.space else { return };
        let mut other = values.clone();
        self.family.in_order(&mut other);
        if space.variables().iter().zip(&other).all(|(v, x)| (v.lower..=v.upper).contains(x)) {
            *values = other;
        }
    }
}
