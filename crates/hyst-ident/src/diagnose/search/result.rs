//! Results of a search: the best set, its named effects, their rivals and the near misses.

use crate::diagnose::probability::Evidence;
use crate::diagnose::score::Judgement;
use crate::diagnose::trial::Trial;
use crate::model::Effect;
use crate::nested::Hypothesis;

/// A named effect with its evidence.
pub(crate) struct Named {
    pub(crate) effect: Effect,
    /// Cross-validated RMSE without it, everything else refitted.
    pub(crate) cv_without: f64,
    /// Cross-validated RMSE with it.
    pub(crate) cv_with: f64,
    /// The best result of each other candidate instead, best first.
    pub(crate) rivals: Vec<Rival>,
    pub(crate) judgement: Judgement,
}

impl Named {
    /// Returns the evidence for the name; `left` is the final cross-validated error in noise floors.
    pub(crate) fn evidence(&self, left: f64) -> Evidence {
        let others = self.rivals.iter().filter(|i| i.judgement.sensible && !i.tie).map(|i| i.cv_rmse);
        let next_best = others.fold(self.cv_without, f64::min) / self.cv_with.max(f64::MIN_POSITIVE);
        Evidence { judgement: self.judgement, next_best, left }
    }

    /// Returns the effects that the record cannot distinguish from this one.
    pub(crate) fn ties(&self) -> Vec<Effect> {
        self.rivals.iter().filter(|rival| rival.tie).map(|rival| rival.effect).collect()
    }
}

/// Another effect instead of a named one.
#[derive(Clone)]
pub(crate) struct Rival {
    pub(crate) effect: Effect,
    /// Cross-validated RMSE with it.
    pub(crate) cv_rmse: f64,
    /// Whether the record cannot tell the two apart.
    pub(crate) tie: bool,
    /// The whole set, with its parameters.
    pub(crate) hypothesis: Hypothesis,
    pub(crate) judgement: Judgement,
}

/// An effect that improves a set, but too little to be named.
#[derive(Clone)]
pub(crate) struct NearMiss {
    pub(crate) effect: Effect,
    /// Cross-validated RMSE with it \[output unit\].
    pub(crate) cv_rmse: f64,
    pub(crate) judgement: Judgement,
}

/// Result of a search.
pub(crate) struct Search {
    pub(crate) best: Trial,
    pub(crate) named: Vec<Named>,
    /// Standard deviation of the white noise \[output unit\].
    pub(crate) noise: f64,
    /// Effects that improve the best set in every part of the record, but too little to be named.
    pub(crate) near: Vec<NearMiss>,
    /// Cross-validated RMSE with a zero wander in addition to the drift of the best set, if there is one \[output
    /// unit\].
    pub(crate) cv_rmse_with_wander: Option<f64>,
}
