//! Effects that help but are not sure enough to be named, and the record that would decide.

use super::findings::{EffectKind, Suspect};
use super::probability::{Evidence, NAMED, SUSPECTED};
use super::search::{Near, Search};
use crate::digits::short;
use crate::model::{Effect, Model};
use crate::samples::Samples;

/// Share of the slope at which an amplifier has been seen to fall behind that a drive may have.
pub const FOLLOWED: f64 = 0.8;

/// What an effect is told from where nothing else comes near: only a record that drives several rates and amplitudes tells it from a lag.
pub fn usual_rival(effect: Effect) -> Effect {
    if effect == Effect::Lag { Effect::Creep } else { Effect::Lag }
}

/// Range and rate of a record's drive as options of `excite`, and the slope that the amplifier follows where it has not followed every one
/// \[input unit/s\].
pub fn drive_options(model: &Model, period: f64, slew_limit: Option<f64>) -> String {
    // Six digits: a period as printed gives a rate that is a whole number but for rounding.
    let digits = |x: f64| format!("{x:.6}").trim_end_matches('0').trim_end_matches('.').to_owned();
    let slew = slew_limit.map(|limit| format!(" --slew {}", short(FOLLOWED * limit)));
    let (low, high) = (digits(model.input.low), digits(model.input.high));
    format!("--low {low} --high {high} --rate {}{}", digits(1.0 / period), slew.unwrap_or_default())
}

/// What is known of an effect that came near to be named.
pub(super) struct Candidate {
    pub(super) effect: Effect,
    cv_rmse: f64,
    /// What does nearly as well.
    rival: Option<Effect>,
    pub(super) evidence: Evidence,
}

/// What is known of each effect that helps beside those that were named, but by too little; `left` is what is left in noise floors.
pub(super) fn candidates(found: &Search, named: &[Effect], left: f64) -> Vec<Candidate> {
    let of = |near: &Near| {
        let others = found.near.iter().filter(|other| other.effect != near.effect);
        let rival = others.min_by(|a, b| a.cv_rmse.total_cmp(&b.cv_rmse));
        let next_best = rival.map_or(1.0 / near.judgement.ratio, |other| other.cv_rmse / near.cv_rmse);
        let evidence = Evidence { judgement: near.judgement, next_best, left };
        Candidate { effect: near.effect, cv_rmse: near.cv_rmse, rival: rival.map(|other| other.effect), evidence }
    };
    found.near.iter().filter(|near| !named.contains(&near.effect)).map(of).collect()
}

/// Those of them that are suspects, the most probable first.
pub(super) fn suspects(
    candidates: &[Candidate],
    model: &Model,
    samples: &Samples,
    slew_limit: Option<f64>,
) -> Vec<Suspect> {
    let options = drive_options(model, samples.period, slew_limit);
    let has = |column: &Option<Vec<f64>>, option: &'static str| if column.is_some() { option } else { "" };
    let sensors = format!("{}{}", has(&samples.temperature, " --thermometer"), has(&samples.load, " --load-cell"));
    let of = |n: &Candidate| {
        let (name, other) = (n.effect, n.rival.unwrap_or(usual_rival(n.effect)));
        Suspect {
            name,
            kind: EffectKind::of(name),
            probability: n.evidence.probability(),
            cv_rmse: n.cv_rmse,
            rival: Some(other),
            command: format!("hystctl excite separate {name} {other} {options}{sensors} -o next.csv"),
        }
    };
    let mut all: Vec<Suspect> =
        candidates.iter().map(of).filter(|s| (SUSPECTED..NAMED).contains(&s.probability)).collect();
    all.sort_by(|a, b| b.probability.total_cmp(&a.probability));
    all
}
