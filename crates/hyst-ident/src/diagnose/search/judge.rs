//! The context that all trials of a search share: the problem, the noise floor and the results known so far.

use std::sync::Mutex;

use hyst_core::Error;

use crate::criteria::{LARGE_RATIO, MIN_NOISE_FLOORS};
use crate::diagnose::scan::Scan;
use crate::diagnose::score::{self, Judgement};
use crate::diagnose::trial::Trial;
use crate::diagnose::trial_parameters::with_faster_creep;
use crate::model::Effect;
use crate::nested::{Cause, Fitted, Hypothesis, Probe, Problem};

/// Shared context of all judgements.
pub(super) struct Judge<'a> {
    pub(super) problem: &'a Problem<'a>,
    pub(super) noise: f64,
    pub(super) seed: u64,
    /// Results of adding a cause to a set. It is read before a race and written in it, so the result does not depend on
    /// threads.
    pub(super) known: Mutex<Vec<(Hypothesis, Cause, Option<Hypothesis>)>>,
    /// Results of the probes of a cause from a set; read and written like `known`.
    pub(super) probed: Mutex<Vec<Probed>>,
}

/// Results of the probes of a cause.
pub(super) struct Probed {
    /// The set that the cause was added to.
    pub(super) from: Hypothesis,
    pub(super) cause: Cause,
    /// Gain in Σ residual² that an effect needed then: what gained much less was not probed.
    pub(super) least_gain: f64,
    pub(super) probes: Vec<Probe>,
}

impl<'a> Judge<'a> {
    pub(super) fn new(problem: &'a Problem<'a>, noise: f64, seed: u64) -> Self {
        Self { problem, noise, seed, known: Mutex::default(), probed: Mutex::default() }
    }
}

impl Judge<'_> {
    /// Scans a fit for causes that may be added.
    pub(super) fn scan<'b>(&'b self, from: &'b Fitted) -> Result<Scan<'b>, Error> {
        Scan::new(self.problem, from, score::least_gain_from(from.rows as f64, from.squares, self.noise))
    }

    /// Refits a set of causes.
    pub(super) fn refit(&self, effects: &Hypothesis) -> Result<Option<Trial>, Error> {
        Ok(self.problem.fit(effects)?.and_then(|f| Trial::of(self.problem, f)))
    }

    /// Returns whether even a perfect model would gain less than an effect has to.
    pub(super) fn nothing_to_gain(&self, best: &Trial) -> bool {
        let above = best.total() / best.fit.rows.max(1) as f64 - self.noise * self.noise;
        above < (MIN_NOISE_FLOORS * self.noise).powi(2)
    }

    /// Returns a set without one cause. A small drag next to a creep may be a creep that is faster than the elements of
    /// the search: such elements are then added.
    pub(super) fn without(&self, set: &Trial, cause: Cause, already: &[Cause]) -> Result<Option<Trial>, Error> {
        let less = set.fit.hypothesis.without(cause);
        let Some(plain) = self.refit(&less)? else { return Ok(None) };
        let drags = cause == Cause::Effect(Effect::RateDependence);
        let creeps = less.effects.creep.is_some() && !already.contains(&Cause::Effect(Effect::Creep));
        let judged = self.judge(&plain, set);
        if !drags || !creeps || !judged.accepted() || judged.over_noise >= LARGE_RATIO {
            return Ok(Some(plain));
        }
        let faster = self.refit(&with_faster_creep(self.problem.samples, &plain.fit.hypothesis))?;
        let better = faster.filter(|t| t.total() < plain.total() && score::sensible(self.problem, t));
        Ok(Some(better.unwrap_or(plain)))
    }

    /// Judges `with` against `without`.
    pub(super) fn judge(&self, without: &Trial, with: &Trial) -> Judgement {
        score::judge(self.problem, without, with, self.noise, self.seed)
    }
}
