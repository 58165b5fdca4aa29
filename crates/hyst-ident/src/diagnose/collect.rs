//! Collects the findings of a diagnosis.

use std::collections::BTreeMap;

use super::context::Context;
use super::findings::{BaseAdvice, Finding, Findings, OnRecords, Remainder, RemainderKind, Rows, Suspect, Verdict};
use super::limit::Limit;
use super::named::finding;
use super::search::Named;
use crate::model::{Base, Effect, Model};
use crate::samples::Samples;
use crate::simulate::{Simulation, Zero};

/// Schema of the findings that this version writes.
const SCHEMA: &str = "hyst.findings/2";

/// Inputs of the findings.
pub(super) struct Material<'a> {
    pub(super) model: &'a Model,
    pub(super) extended: &'a Model,
    pub(super) named: &'a [Named],
    pub(super) noise: f64,
    pub(super) errors: &'a BTreeMap<String, f64>,
    pub(super) before: &'a Simulation,
    pub(super) after: &'a Simulation,
    pub(super) tests: Option<&'a (Simulation, Simulation)>,
    pub(super) remainder: Remainder,
    pub(super) zero: Zero,
    pub(super) samples: &'a Samples,
    /// Cross-validated RMSE on the basis of the search with all effects found, in noise floors.
    pub(super) left: f64,
    pub(super) suspects: Vec<Suspect>,
    pub(super) limits: BTreeMap<Effect, Limit>,
    pub(super) base_advice: Option<BaseAdvice>,
    pub(super) rows: Rows,
}

/// Returns the thresholds of a base with play operators.
fn thresholds(base: &Base) -> Option<&[f64]> {
    match base {
        Base::Pi(p) => Some(&p.thresholds),
        Base::ViscousPi(p) => Some(&p.pi.thresholds),
        _ => None,
    }
}

/// Returns the findings of a diagnosis.
pub(super) fn findings(m: &Material<'_>) -> Findings {
    let context = Context { model: m.model, extended: m.extended, samples: m.samples, errors: m.errors, left: m.left };
    let effects: Vec<Finding> = m.named.iter().map(|n| finding(&context, n)).collect();
    let verdict = match (effects.is_empty(), m.remainder.kind) {
        (false, _) => Verdict::Explained,
        (true, RemainderKind::None) => Verdict::NothingMissing,
        (true, RemainderKind::BaseCapacity) => Verdict::BaseTooCoarse,
        (true, RemainderKind::Unexplained) => Verdict::Unexplained,
    };
    let on = |train: &Simulation, test: Option<&Simulation>| OnRecords {
        train: train.errors,
        test: test.and_then(|t| t.errors),
    };
    Findings {
        schema: SCHEMA.into(),
        base: m.model.base.kind(),
        unit: m.model.output.unit.clone(),
        noise_floor: m.noise,
        plays_placed_anew: thresholds(&m.extended.base)
            .filter(|new| thresholds(&m.model.base).is_some_and(|old| old != *new))
            .map(<[f64]>::len),
        zero: m.zero,
        verdict,
        before: on(m.before, m.tests.map(|t| &t.0)),
        effects,
        suspects: m.suspects.clone(),
        limits: m.limits.clone(),
        base_advice: m.base_advice.clone(),
        rows: m.rows.clone(),
        remainder: m.remainder.clone(),
        after: on(m.after, m.tests.map(|t| &t.1)),
    }
}
