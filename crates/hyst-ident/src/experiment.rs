//! The next experiment: what a diagnosis leaves open, and the drive that decides most of it in the least time.
//!
//! A diagnosis leaves questions: an effect that may act or not, one that is named but might be another, one whose size is not well known. Each
//! is a pair of effects of which the best-fitting one imitates the other. For every drive of [`separations`] the part that cannot be imitated
//! is known as a multiple `r` of the noise, root mean square over the record; with `n` rows it adds `n r²` to the evidence (twice the logarithm
//! of the likelihood ratio). The drive is played for which the evidence, up to what decides a question, summed over all questions and
//! divided by the time, is largest (a design for discrimination, Atkinson and Fedorov 1975).

use serde::Serialize;

use crate::diagnose::{Findings, RemainderKind};
use crate::excite::{Drive, ExciteError, Limits, SeparateOptions, separations};
use crate::model::Effect;

/// Evidence that decides a question: twice the logarithm of a likelihood ratio of e¹⁵, which leaves room for a misfit of the base that is
/// not white.
const DECIDES: f64 = 30.0;
/// Durations that are tried \[s\]; the shortest is what a few slow loops need.
const DURATIONS_S: [f64; 3] = [4.0, 8.0, 16.0];
/// Questions that a drive is chosen for, the most open first.
const MAX_QUESTIONS: usize = 4;
/// An effect that nearly every other one is told from by several rates and holds, and its own rival.
const USUAL_RIVAL: (Effect, Effect) = (Effect::Lag, Effect::Creep);

/// What is to be known in the end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aim {
    /// Probability that each named effect has, and that no suspect reaches the complement of.
    pub probability: f64,
    /// Standard error of the best known parameter of each effect, as a share of its value.
    pub precision: f64,
}

/// What is open.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "what")]
pub enum Question {
    /// Whether an effect acts.
    Suspect {
        /// The effect.
        effect: Effect,
        /// What it could be instead.
        rival: Effect,
        /// Probability that it acts.
        probability: f64,
    },
    /// Whether a named effect is the right one.
    Name {
        /// The effect.
        effect: Effect,
        /// What it could be instead.
        rival: Effect,
        /// Probability that it acts.
        probability: f64,
    },
    /// How large a named effect is.
    Size {
        /// The effect.
        effect: Effect,
        /// What does nearly the same.
        rival: Effect,
        /// Standard error of its best known parameter, as a share of its value.
        error: f64,
    },
    /// What acts besides: something is left that nothing explains.
    Rest,
}

impl Question {
    /// The effects that a drive has to tell apart.
    fn pair(&self) -> Option<(Effect, Effect)> {
        match self {
            Self::Suspect { effect, rival, .. }
            | Self::Name { effect, rival, .. }
            | Self::Size { effect, rival, .. } => Some((*effect, *rival)),
            Self::Rest => None,
        }
    }

    /// How open it is, from 0 to 1.
    fn openness(&self) -> f64 {
        match self {
            Self::Suspect { probability, .. } => 1.0 - (2.0 * probability - 1.0).abs(),
            Self::Name { probability, .. } => 1.0 - probability,
            Self::Size { error, .. } => 0.1 * error.min(1.0),
            Self::Rest => 0.0,
        }
    }

    /// The question in words.
    pub fn words(&self) -> String {
        match self {
            Self::Suspect { effect, probability, .. } => {
                format!("whether {effect} acts (probability {probability:.2})")
            }
            Self::Name { effect, rival, probability } => {
                format!("whether it is {effect} or {rival} (probability {probability:.2})")
            }
            Self::Size { effect, error, .. } => format!("the size of {effect} (known to {:.0} %)", 100.0 * error),
            Self::Rest => "what is left, which nothing explains".to_owned(),
        }
    }
}

/// What findings leave open, the most open first; empty where all is known as well as was asked.
pub fn open_questions(findings: &Findings, aim: Aim) -> Vec<Question> {
    let usual = |effect: Effect| if effect == USUAL_RIVAL.0 { USUAL_RIVAL.1 } else { USUAL_RIVAL.0 };
    let mut open = Vec::new();
    for suspect in findings.suspects.iter().filter(|s| s.probability > 1.0 - aim.probability) {
        let (effect, rival) = (suspect.name, usual(suspect.name));
        open.push(Question::Suspect { effect, rival, probability: suspect.probability });
    }
    for named in &findings.effects {
        let effect = named.name;
        let rival = named.alternatives.iter().map(|other| other.name).find(|other| *other != effect);
        let rival = rival.unwrap_or(usual(effect));
        if named.probability < aim.probability {
            open.push(Question::Name { effect, rival, probability: named.probability });
            continue;
        }
        let share =
            |found: &crate::diagnose::Found| Some((found.std_error? / found.value).abs()).filter(|e| e.is_finite());
        let error = named.parameters.values().filter_map(share).fold(f64::INFINITY, f64::min);
        if error.is_finite() && error > aim.precision {
            open.push(Question::Size { effect, rival, error });
        }
    }
    if findings.remainder.kind == RemainderKind::Unexplained {
        open.push(Question::Rest);
    }
    open.sort_by(|a, b| b.openness().total_cmp(&a.openness()));
    open
}

/// The experiment that was chosen.
#[derive(Clone, Debug)]
pub struct Choice {
    /// Its drive.
    pub drive: Drive,
    /// What it is, in words.
    pub name: &'static str,
    /// Questions that it decides by itself, as expected.
    pub decides: usize,
    /// Evidence that is expected, as a share of what decides each question, and mean over them.
    pub expected: f64,
}

/// Chooses the drive that decides most of `questions` per second, not longer than `seconds_left`; `None` where no question is one of two effects
/// or no time is left. `noise` is what is left of the output, noise and misfit, as a share of its span.
///
/// # Errors
/// When no drive keeps to the limits.
pub fn choose(
    questions: &[Question],
    limits: &Limits,
    noise: f64,
    sensors: (bool, bool),
    seconds_left: f64,
) -> Result<Option<Choice>, ExciteError> {
    let mut pairs: Vec<(Effect, Effect)> = Vec::new();
    for pair in questions.iter().filter_map(Question::pair) {
        if !pairs.contains(&pair) && pairs.len() < MAX_QUESTIONS {
            pairs.push(pair);
        }
    }
    let mut best: Option<(f64, Choice)> = None;
    let durations = DURATIONS_S.into_iter().filter(|duration| *duration <= seconds_left);
    for duration_s in if pairs.is_empty() { Vec::new() } else { durations.collect() } {
        let options =
            SeparateOptions { duration_s, noise: noise.clamp(1e-6, 0.5), thermometer: sensors.0, load_cell: sensors.1 };
        for (drive, tried) in separations(&pairs, limits, &options)? {
            let rows = drive.voltage().len() as f64;
            let share = |left: f64| (rows * left * left / DECIDES).min(1.0);
            let shares: Vec<f64> = tried.iter().map(|tried| share(tried.left())).collect();
            let expected = shares.iter().sum::<f64>() / shares.len() as f64;
            let seconds = rows / limits.rate_hz;
            let decides = shares.iter().filter(|share| **share >= 1.0).count();
            if best.as_ref().is_none_or(|(rate, _)| expected / seconds > *rate) {
                best = Some((expected / seconds, Choice { drive, name: tried[0].drive, decides, expected }));
            }
        }
    }
    Ok(best.map(|(_, choice)| choice).filter(|choice| choice.expected > 0.0))
}
