//! Causes that compete: all are ranked by probes, and only what may win is fitted in full.

use hyst_core::Error;
use rayon::prelude::*;

use super::scan::Scan;
use super::score;
use super::search::{DRIFT, Judge};
use super::starts;
use super::trial::Trial;
use super::uncertainty::Undetermined;
use crate::nested::{Cause, Hypothesis, Probe};

/// Σ residual² of a probe, over that of the leader, up to which it is fitted in full: more than `BEAM_WITHIN` of the search, so that what is given up would not
/// have been carried on.
const MAX_RATIO_TO_LEADER: f64 = 4.0;
/// The same over that of the best law of its cause.
const MAX_RATIO_TO_OWN: f64 = 2.0;
/// Gain of a probe, over that which an effect has to have, from which on it is fitted in full, and from which on it is reported.
const MIN_GAIN_TO_FIT: f64 = 0.5;
const MIN_GAIN_TO_REPORT: f64 = 0.2;

/// What is known of a cause added to a fit.
enum Attempt {
    /// It was fitted before: what came of it.
    Known(Option<Box<Hypothesis>>),
    /// Where a probe from each start has led.
    Begun(Vec<Probe>),
}

impl Judge<'_> {
    /// A cause added to a scanned fit.
    pub(super) fn trials(&self, scan: &Scan<'_>, cause: Cause) -> Result<Option<Trial>, Error> {
        Ok(self.race(&[(scan, cause)])?.into_iter().next().flatten())
    }

    /// Each cause added to its scanned fit, in order. All are ranked by probes; only those that may still win, and may gain as
    /// much as an effect has to, are fitted in full.
    pub(super) fn race(&self, jobs: &[(&Scan<'_>, Cause)]) -> Result<Vec<Option<Trial>>, Error> {
        // Each trial is computed alone and collected in order: threads change nothing.
        let attempts: Vec<Result<Attempt, Error>> =
            jobs.par_iter().map(|(scan, cause)| self.attempt(scan, *cause)).collect();
        let attempts: Vec<Attempt> = attempts.into_iter().collect::<Result<_, _>>()?;
        let probes = attempts.iter().flat_map(|attempt| match attempt {
            Attempt::Known(_) => &[],
            Attempt::Begun(probes) => probes.as_slice(),
        });
        let leader = probes.map(|probe| probe.squares).fold(f64::INFINITY, f64::min);
        let ended: Vec<Result<Option<Trial>, Error>> = jobs
            .par_iter()
            .zip(&attempts)
            .map(|((scan, cause), attempt)| match attempt {
                Attempt::Known(found) => found.as_ref().map_or(Ok(None), |found| self.refit(found)),
                Attempt::Begun(probes) => self.ended(scan, *cause, probes, leader),
            })
            .collect();
        ended.into_iter().collect()
    }

    /// What is known of a cause, or how it begins.
    fn attempt(&self, scan: &Scan<'_>, cause: Cause) -> Result<Attempt, Error> {
        let from = &scan.from.hypothesis;
        // The same fit may be asked for again when effects are swapped.
        let known = self.known.lock().ok().and_then(|known| {
            let same = known.iter().find(|(parent, of, _)| *of == cause && parent == from);
            same.map(|(.., found)| found.clone())
        });
        if let Some(found) = known {
            return Ok(Attempt::Known(found.map(Box::new)));
        }
        Ok(Attempt::Begun(self.probes(scan, cause)?))
    }

    /// Where a probe from each start of a cause leads.
    fn probes(&self, scan: &Scan<'_>, cause: Cause) -> Result<Vec<Probe>, Error> {
        let starts = starts::starts(scan, cause)?;
        let probes: Vec<Result<Option<Probe>, Error>> =
            starts.par_iter().map(|start| scan.vantage.probe(start)).collect();
        probes.into_iter().filter_map(Result::transpose).collect()
    }

    /// The best of what came of some starts, those fitted to the end that may win against what leads.
    fn ended(&self, scan: &Scan<'_>, cause: Cause, probes: &[Probe], leader: f64) -> Result<Option<Trial>, Error> {
        let gain = |probe: &Probe| scan.from.squares - probe.squares;
        let own = probes.iter().map(|probe| probe.squares).fold(f64::INFINITY, f64::min);
        // Of those that lead to one place the first stands for all.
        let is_first =
            |at: &usize| !probes[..*at].iter().any(|other| other.hypothesis.is_near(&probes[*at].hypothesis));
        let apart: Vec<&Probe> = (0..probes.len()).filter(is_first).map(|at| &probes[at]).collect();
        let may_win = |probe: &&Probe| {
            // In one loop all that is late is alike in the end, however far apart its laws begin.
            let is_near = self.problem.only_loop.is_some()
                || (probe.squares <= MAX_RATIO_TO_LEADER * leader && probe.squares <= MAX_RATIO_TO_OWN * own);
            is_near && gain(probe) >= MIN_GAIN_TO_FIT * scan.least_gain
        };
        let fits: Vec<Result<Option<Trial>, Error>> = apart
            .par_iter()
            .map(|probe| match may_win(probe) {
                true => self.refit(&probe.hypothesis),
                // It is reported beside the others.
                false if gain(probe) >= MIN_GAIN_TO_REPORT * scan.least_gain => {
                    let as_it_is = self.problem.fit_linear(&probe.hypothesis)?;
                    Ok(as_it_is.and_then(|fit| Trial::of(self.problem, fit)))
                }
                false => Ok(None),
            })
            .collect();
        let mut fitted: Vec<Trial> = fits.into_iter().filter_map(Result::transpose).collect::<Result<_, _>>()?;
        // Fitted to the end, a bank of relaxations also takes the part of a lag, beyond what a creep can be. Where it is not sensible then, it counts
        // as its probes left it.
        let creeps = apart.iter().any(|probe| probe.hypothesis.effects.creep != scan.from.hypothesis.effects.creep);
        let overreaches = creeps && !fitted.iter().any(|trial| score::sensible(self.problem, trial));
        if overreaches {
            for probe in apart.iter().filter(|probe| may_win(probe)) {
                let as_it_is = self.problem.fit_linear(&probe.hypothesis)?;
                fitted.extend(as_it_is.and_then(|fit| Trial::of(self.problem, fit)));
            }
        }
        let found = self.best_law(fitted);
        // What was given up, or stands as a probe left it, is not known to its end.
        if !overreaches
            && apart.iter().all(may_win)
            && let Ok(mut known) = self.known.lock()
        {
            let found = found.as_ref().map(|t| t.fit.hypothesis.clone());
            known.push((scan.from.hypothesis.clone(), cause, found));
        }
        Ok(found)
    }

    /// Which of the laws of one cause stands for it.
    fn best_law(&self, mut fitted: Vec<Trial>) -> Option<Trial> {
        // A law whose parameters end at a bound stands for another that is simpler.
        if fitted.iter().any(|trial| score::sensible(self.problem, trial)) {
            fitted.retain(|trial| score::sensible(self.problem, trial));
        }
        // A drift that slows down without end has to show both that it settles and that it goes on.
        let slows_down =
            |trial: &Trial| trial.fit.hypothesis.effects.drift.is_some_and(|p| p.seconds > 0.0 && p.per_second != 0.0);
        let is_loose = |trial: &Trial| Undetermined::of(&trial.fit).speaks_against(DRIFT, || false);
        if fitted.iter().any(|trial| !slows_down(trial)) {
            fitted.retain(|trial| !slows_down(trial) || !is_loose(trial));
        }
        // Of the laws of one cause the simplest that is not clearly beaten; of equally simple ones the better.
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

    /// A set whose temperature expands, with a drift in the place of the expansion where that does as well: a zero that moves as steadily as the
    /// temperature may as well drift. Asked once all else is known, since what is still missing hides which it is.
    pub(super) fn drifts_instead(&self, set: &Trial) -> Result<Option<Trial>, Error> {
        let mut still = set.fit.hypothesis.clone();
        let Some(temperature) = still.effects.temperature.as_mut().filter(|p| p.expansion != 0.0) else {
            return Ok(None);
        };
        temperature.expansion = 0.0;
        if !still.has_room(DRIFT) {
            return Ok(None);
        }
        let Some(still) = self.problem.fit(&still)? else { return Ok(None) };
        let drifts = self.trials(&self.scan(&still)?, DRIFT)?;
        Ok(drifts.filter(|drifts| !score::clearly_better(drifts, set, self.seed)))
    }
}
