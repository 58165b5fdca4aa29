//! Suspects: effects that help but are not certain enough to be named, with the experiment that would decide.

use super::effects::EffectKind;
use super::findings::Suspect;
use super::probability::{Evidence, NAMED, SUSPECTED};
use super::search::{NearMiss, Search};
use crate::digits::short;
use crate::model::{Effect, Model};
use crate::samples::Samples;

/// Maximum slope of the next drive, as a share of the slope that the amplifier did not follow.
pub const FOLLOWED: f64 = 0.8;

/// Returns the effect that is hardest to separate from `effect`, if the search found no rival.
pub fn usual_rival(effect: Effect) -> Effect {
    if effect == Effect::Lag { Effect::Creep } else { Effect::Lag }
}

/// Returns the options of `excite` for a record's range and rate, and a slope for a slow amplifier.
///
/// `slew_limit` is the slope that the amplifier did not follow \[input unit/s\].
pub fn drive_options(model: &Model, period: f64, slew_limit: Option<f64>) -> String {
    // Six digits: a period as printed gives a rate that is an integer up to rounding.
    let digits = |x: f64| format!("{x:.6}").trim_end_matches('0').trim_end_matches('.').to_owned();
    let slew = slew_limit.map(|limit| format!(" --slew {}", short(FOLLOWED * limit)));
    let (low, high) = (digits(model.input.low), digits(model.input.high));
    format!("--low {low} --high {high} --rate {}{}", digits(1.0 / period), slew.unwrap_or_default())
}

/// Evidence for an effect that was nearly named.
pub(super) struct Candidate {
    pub(super) effect: Effect,
    cv_rmse: f64,
    /// The closest rival.
    rival: Option<Effect>,
    pub(super) evidence: Evidence,
}

/// Returns the candidates: effects that help in addition to the named ones, but too little. `left` is the final error
/// in noise floors.
pub(super) fn candidates(found: &Search, named: &[Effect], left: f64) -> Vec<Candidate> {
    let of = |near: &NearMiss| {
        let others = found.near.iter().filter(|other| other.effect != near.effect);
        let rival = others.min_by(|a, b| a.cv_rmse.total_cmp(&b.cv_rmse));
        let next_best = rival.map_or(1.0 / near.judgement.ratio, |other| other.cv_rmse / near.cv_rmse);
        let evidence = Evidence { judgement: near.judgement, next_best, left };
        Candidate { effect: near.effect, cv_rmse: near.cv_rmse, rival: rival.map(|other| other.effect), evidence }
    };
    found.near.iter().filter(|near| !named.contains(&near.effect)).map(of).collect()
}

/// Returns the candidates that are suspects, most probable first.
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
