//! A whole identification: global search, polish, standard errors.

use std::ops::ControlFlow;

use rayon::prelude::*;

use super::Family;
use super::polish::polish;
use super::profile::interval;
use super::projection::{Left, Projection, space};
use super::slopes::estimate;
use super::uncertainty::Estimate;
use crate::Samples;
use crate::fit::FitError;
use crate::model::Base;
use crate::optimize::{Method, Progress, Stop, Trials, trials};

/// How to search.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SearchOptions {
    pub(crate) method: Method,
    pub(crate) evaluations: u64,
    pub(crate) seed: u64,
    pub(crate) trials: usize,
    pub(crate) zero_per_record: bool,
}

/// What was identified.
#[derive(Clone, Debug)]
pub(crate) struct Identified {
    pub(crate) base: Base,
    pub(crate) zeros: Vec<f64>,
    pub(crate) estimate: Estimate,
    /// The global searches; `None` if nothing had to be searched.
    pub(crate) trials: Option<Trials>,
    pub(crate) evaluations: u64,
    /// Measured minus predicted in every row, `NaN` in those that do not count.
    pub(crate) residual: Vec<f64>,
}

/// Points from which a polish starts, besides the best: ends of trials are many, valleys few.
const STARTS: usize = 3;

/// Identifies a family from the settled rows. Where `beginnings` of the record are given, with the same model over them, the
/// global search looks at those alone; the polish sees all.
///
/// # Errors
/// If the bounds are no box, the search is set up wrongly, or no parameters within the bounds give a finite output.
pub(crate) fn identify(
    family: &dyn Family,
    samples: &Samples,
    beginnings: Option<(&dyn Family, &Samples)>,
    how: &SearchOptions,
    name: &dyn Fn() -> String,
    watch: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Identified, FitError> {
    let projection = Projection::new(family, samples, how.zero_per_record);
    let unsolvable = || FitError::Unsolvable { record: name() };
    let mut intervals = Vec::new();
    let (values, projected, searched, evaluations) = match space(family) {
        None => (Vec::new(), projection.at(&[]).ok_or_else(unsolvable)?, None, 1),
        Some(space) => {
            let space = space.map_err(|source| FitError::Space { record: name(), source })?;
            let quick = beginnings.map(|(family, rows)| Projection::new(family, rows, how.zero_per_record));
            let cost = Left { projection: quick.as_ref().unwrap_or(&projection), dimensions: space.dimensions() };
            let stop = Stop { tolerance: 1e-6, stall: 60, ..Stop::after(how.evaluations) };
            let found = trials(&space, &cost, &how.method, &stop, how.seed, how.trials, &mut |_, p| watch(p))
                .map_err(|source| FitError::Search { record: name(), source })?;
            let mut order: Vec<usize> = (0..found.found.len()).collect();
            order.sort_by(|a, b| found.found[*a].cost.total_cmp(&found.found[*b].cost));
            let mut best = None;
            let mut evaluations: u64 = found.found.iter().map(|f| f.evaluations).sum();
            for trial in order.iter().take(STARTS) {
                let Some(p) = polish(&projection, &space, &space.point(&found.found[*trial].values)) else { continue };
                evaluations += p.evaluations;
                let better = |b: &super::polish::Polished| p.projected.squares() < b.projected.squares();
                if best.as_ref().is_none_or(better) {
                    best = Some(p);
                }
            }
            let best = best.ok_or_else(unsolvable)?;
            // Two standard errors of noise like what is left.
            let freedom = projection.rows.len().saturating_sub(space.dimensions() + projection.unknowns()).max(1);
            let rise = 4.0 * best.projected.squares() / freedom as f64;
            let section = |d: usize| interval(&projection, &space, &best.point, d, rise);
            let sections: Vec<_> = (0..space.dimensions()).into_par_iter().map(section).collect();
            let named = space.variables().iter().zip(sections);
            intervals.extend(named.filter_map(|(variable, section)| Some((variable.name.clone(), section?))));
            (space.values(&best.point), best.projected, Some(found), evaluations)
        }
    };
    let base = family.base(&values, &projected.linear);
    let left = projected.residual.as_slice();
    let mut estimate = estimate(family, &base, samples, how.zero_per_record, left);
    for (name, interval) in intervals {
        estimate.widen(&name, interval);
    }
    let mut residual = vec![f64::NAN; samples.len()];
    for (k, r) in projection.rows.iter().zip(left) {
        residual[*k] = *r;
    }
    Ok(Identified { base, zeros: projected.zeros, estimate, trials: searched, evaluations, residual })
}
