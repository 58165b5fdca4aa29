//! Effects that help but are not sure enough to be named, and the record that would decide.

use super::findings::{EffectKind, Suspect};
use super::probability::{Evidence, NAMED, SUSPECTED};
use super::score::Judgement;
use super::search::Search;
use crate::digits::short;
use crate::model::{Effect, Model};
use crate::samples::Samples;

/// Share of the slope at which an amplifier has been seen to fall behind that a drive may have.
pub const FOLLOWED: f64 = 0.8;

/// What only a record that drives several rates and amplitudes can tell apart.
const USUAL_RIVAL: Effect = Effect::Lag;

/// Range and rate of a record's drive as options of `excite`, and the slope that the amplifier follows where it has not followed every one
/// \[input unit/s\].
pub fn drive_options(model: &Model, period: f64, slew_limit: Option<f64>) -> String {
    // Six digits: a period as printed gives a rate that is a whole number but for rounding.
    let digits = |x: f64| format!("{x:.6}").trim_end_matches('0').trim_end_matches('.').to_owned();
    let slew = slew_limit.map(|limit| format!(" --slew {}", short(FOLLOWED * limit)));
    let (low, high) = (digits(model.input.low), digits(model.input.high));
    format!("--low {low} --high {high} --rate {}{}", digits(1.0 / period), slew.unwrap_or_default())
}

/// What is known of each effect that helps beside those that were named, but by too little; `left` is what is left in noise floors.
pub(super) fn near(found: &Search, named: &[Effect], left: f64) -> Vec<Near> {
    let others = |effect: Effect| found.near.iter().filter(move |(other, ..)| *other != effect);
    let of = |(effect, cv_rmse, judgement): &(Effect, f64, Judgement)| {
        let rival = others(*effect).min_by(|a, b| a.1.total_cmp(&b.1));
        let next_best = rival.map_or(1.0 / judgement.ratio, |(_, other, _)| other / cv_rmse);
        let evidence = Evidence { judgement: *judgement, next_best, left };
        Near { effect: *effect, cv_rmse: *cv_rmse, rival: rival.map(|(other, ..)| *other), evidence }
    };
    found.near.iter().filter(|(effect, ..)| !named.contains(effect)).map(of).collect()
}

/// An effect that helps, but by too little to be named.
pub(super) struct Near {
    pub(super) effect: Effect,
    cv_rmse: f64,
    /// What does nearly as well.
    rival: Option<Effect>,
    pub(super) evidence: Evidence,
}

/// Those of them that are suspects, the most probable first.
pub(super) fn suspects(near: &[Near], model: &Model, samples: &Samples, slew_limit: Option<f64>) -> Vec<Suspect> {
    let options = drive_options(model, samples.period, slew_limit);
    let has = |column: &Option<Vec<f64>>, option: &'static str| if column.is_some() { option } else { "" };
    let sensors = format!("{}{}", has(&samples.temperature, " --thermometer"), has(&samples.load, " --load-cell"));
    let of = |n: &Near| {
        let usual = if n.effect == USUAL_RIVAL { Effect::Creep } else { USUAL_RIVAL };
        let (name, other) = (n.effect, n.rival.unwrap_or(usual));
        Suspect {
            name,
            kind: EffectKind::of(name),
            probability: n.evidence.probability(),
            cv_rmse: n.cv_rmse,
            command: format!("hystctl excite separate {name} {other} {options}{sensors} -o next.csv"),
        }
    };
    let mut all: Vec<Suspect> = near.iter().map(of).filter(|s| (SUSPECTED..NAMED).contains(&s.probability)).collect();
    all.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    all
}
