//! Competition of causes: probes rank all of them, and only those that may win are fitted in full.

use hyst_core::Error;
use rayon::prelude::*;

use super::judge::{Judge, Probed};
use crate::diagnose::scan::Scan;
use crate::diagnose::trial::Trial;
use crate::diagnose::{score, starts};
use crate::nested::{Cause, Hypothesis, Probe};

/// Largest Σ residual² of a probe, relative to that of the leader, at which it is fitted in full. Larger than
/// `LARGE_RATIO` of the search, so that no probe is dropped that the search would have followed.
const MAX_RATIO_TO_LEADER: f64 = 4.0;
/// The same, relative to the best law of its own cause.
const MAX_RATIO_TO_OWN: f64 = 2.0;
/// Gain of a probe, relative to the gain that an effect needs, above which it is fitted in full and above which it is
/// reported.
const MIN_GAIN_TO_FIT: f64 = 0.5;
const MIN_GAIN_TO_REPORT: f64 = 0.2;
/// Largest ratio of the gain that an effect needed when a cause was probed to the gain that it needs now, at which the
/// probes still serve: a cause was probed from a twentieth of that gain on.
const MAX_FALL_OF_LEAST_GAIN: f64 = 2.0;

/// State of a cause that is added to a fit.
enum Attempt {
    /// Fitted before, with the result.
    Known(Option<Box<Hypothesis>>),
    /// Results of the probes from each start.
    Probed(Vec<Probe>),
}

impl Judge<'_> {
    /// Adds a cause to a scanned fit.
    pub(super) fn trials(&self, scan: &Scan<'_>, cause: Cause) -> Result<Option<Trial>, Error> {
        Ok(self.race(&[(scan, cause)])?.into_iter().next().flatten())
    }

    /// Adds each cause to its scanned fit; results are in the order of `jobs`. Probes rank all of them. Only those that
    /// may still win, and whose gain may suffice for an effect, are fitted in full.
    pub(super) fn race(&self, jobs: &[(&Scan<'_>, Cause)]) -> Result<Vec<Option<Trial>>, Error> {
        // Each trial is computed independently and collected in order, so threads change nothing.
        let attempts: Vec<Result<Attempt, Error>> =
            jobs.par_iter().map(|(scan, cause)| self.attempt(scan, *cause)).collect();
        let attempts: Vec<Attempt> = attempts.into_iter().collect::<Result<_, _>>()?;
        let probes = attempts.iter().flat_map(|attempt| match attempt {
            Attempt::Known(_) => &[],
            Attempt::Probed(probes) => probes.as_slice(),
        });
        let leader = probes.map(|probe| probe.squares).fold(f64::INFINITY, f64::min);
        let finished: Vec<Result<Option<Trial>, Error>> = jobs
            .par_iter()
            .zip(&attempts)
            .map(|((scan, cause), attempt)| match attempt {
                Attempt::Known(found) => found.as_ref().map_or(Ok(None), |found| self.refit(found)),
                Attempt::Probed(probes) => self.finished(scan, *cause, probes, leader),
            })
            .collect();
        finished.into_iter().collect()
    }

    /// Returns whether a probe of any of the causes gains so much that it would be fitted in full.
    pub(super) fn may_win(&self, scan: &Scan<'_>, causes: &[Cause]) -> Result<bool, Error> {
        let wins = |probe: &Probe| scan.from.squares - probe.squares >= MIN_GAIN_TO_FIT * scan.least_gain;
        let found: Vec<Result<bool, Error>> =
            causes.par_iter().map(|cause| Ok(self.new_probes(scan, *cause)?.iter().any(wins))).collect();
        found.into_iter().try_fold(false, |any, wins| Ok(any || wins?))
    }

    /// Returns the known result of a cause, or its probes.
    fn attempt(&self, scan: &Scan<'_>, cause: Cause) -> Result<Attempt, Error> {
        let from = &scan.from.hypothesis;
        // Swaps may request the same fit again.
        let known = self.known.lock().ok().and_then(|known| {
            let same = known.iter().find(|(parent, of, _)| *of == cause && parent == from);
            same.map(|(.., found)| found.clone())
        });
        if let Some(found) = known {
            return Ok(Attempt::Known(found.map(Box::new)));
        }
        Ok(Attempt::Probed(self.probes(scan, cause)?))
    }

    /// Returns the results of a probe from each start of a cause.
    fn probes(&self, scan: &Scan<'_>, cause: Cause) -> Result<Vec<Probe>, Error> {
        let from = &scan.from.hypothesis;
        // A swap adds the same causes to the same set as the search before it. A cause that was not promising then, but
        // would be now, must be probed.
        let is_same = |p: &&Probed| {
            p.cause == cause && p.from == *from && p.least_gain <= MAX_FALL_OF_LEAST_GAIN * scan.least_gain
        };
        let known = self.probed.lock().ok().and_then(|p| p.iter().find(is_same).map(|p| p.probes.clone()));
        if let Some(known) = known {
            return Ok(known);
        }
        let probes = self.new_probes(scan, cause)?;
        if let Ok(mut probed) = self.probed.lock() {
            let (from, least_gain, probes) = (from.clone(), scan.least_gain, probes.clone());
            probed.push(Probed { from, cause, least_gain, probes });
        }
        Ok(probes)
    }

    /// Runs a probe from each start of a cause.
    fn new_probes(&self, scan: &Scan<'_>, cause: Cause) -> Result<Vec<Probe>, Error> {
        let starts = starts::starts(scan, cause)?;
        let probes: Vec<Result<Option<Probe>, Error>> =
            starts.par_iter().map(|start| scan.prober.probe(start)).collect();
        probes.into_iter().filter_map(Result::transpose).collect()
    }

    /// Returns the best result of a cause; probes that may win against the leader are fitted to convergence.
    fn finished(&self, scan: &Scan<'_>, cause: Cause, probes: &[Probe], leader: f64) -> Result<Option<Trial>, Error> {
        let gain = |probe: &Probe| scan.from.squares - probe.squares;
        let own = probes.iter().map(|probe| probe.squares).fold(f64::INFINITY, f64::min);
        // Of probes with nearly the same parameters only the first is fitted.
        let is_first =
            |at: &usize| !probes[..*at].iter().any(|other| other.hypothesis.is_near(&probes[*at].hypothesis));
        let apart: Vec<&Probe> = (0..probes.len()).filter(is_first).map(|at| &probes[at]).collect();
        let may_win = |probe: &&Probe| {
            // In a single loop all late effects end alike, however different the probes are.
            let is_near = self.problem.only_loop.is_some()
                || (probe.squares <= MAX_RATIO_TO_LEADER * leader && probe.squares <= MAX_RATIO_TO_OWN * own);
            is_near && gain(probe) >= MIN_GAIN_TO_FIT * scan.least_gain
        };
        let fits: Vec<Result<Option<Trial>, Error>> = apart
            .par_iter()
            .map(|probe| match may_win(probe) {
                true => self.refit(&probe.hypothesis),
                // Reported for comparison, not refitted.
                false if gain(probe) >= MIN_GAIN_TO_REPORT * scan.least_gain => {
                    let as_it_is = self.problem.fit_linear(&probe.hypothesis)?;
                    Ok(as_it_is.and_then(|fit| Trial::of(self.problem, fit)))
                }
                false => Ok(None),
            })
            .collect();
        let mut fitted: Vec<Trial> = fits.into_iter().filter_map(Result::transpose).collect::<Result<_, _>>()?;
        // When fitted to convergence, a bank of relaxations may also take up a lag, beyond what a creep can be. If the
        // result is implausible, the unrefined probes count instead.
        let creeps = apart.iter().any(|probe| probe.hypothesis.effects.creep != scan.from.hypothesis.effects.creep);
        let overreaches = creeps && !fitted.iter().any(|trial| score::sensible(self.problem, trial));
        if overreaches {
            for probe in apart.iter().filter(|probe| may_win(probe)) {
                let as_it_is = self.problem.fit_linear(&probe.hypothesis)?;
                fitted.extend(as_it_is.and_then(|fit| Trial::of(self.problem, fit)));
            }
        }
        let found = self.best_law(fitted);
        // Results from dropped or unrefined probes are not stored as known.
        if !overreaches
            && apart.iter().all(may_win)
            && let Ok(mut known) = self.known.lock()
        {
            let found = found.as_ref().map(|t| t.fit.hypothesis.clone());
            known.push((scan.from.hypothesis.clone(), cause, found));
        }
        Ok(found)
    }

    /// Returns the law that represents a cause.
    fn best_law(&self, mut fitted: Vec<Trial>) -> Option<Trial> {
        // A law with parameters at a bound imitates a simpler law.
        if fitted.iter().any(|trial| score::sensible(self.problem, trial)) {
            fitted.retain(|trial| score::sensible(self.problem, trial));
        }
        // The simplest law that is not clearly worse; of equally simple ones the better.
        fitted.sort_by_key(|trial| trial.fit.solution.len());
        let mut best: Option<usize> = None;
        for (at, trial) in fitted.iter().enumerate() {
            let better = best.is_none_or(|best| {
                let best = &fitted[best];
                let is_simple = trial.fit.solution.len() == best.fit.solution.len();
                trial.total() < best.total() && (is_simple || score::clearly_better(best, trial, self.seed))
            });
            best = if better { Some(at) } else { best };
        }
        best.map(|best| fitted.swap_remove(best))
    }
}
