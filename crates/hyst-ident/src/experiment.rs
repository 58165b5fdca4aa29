//! Chooses the next experiment: the drive that answers the open questions of a diagnosis in the least time.
//!
//! Open questions are an effect that may act or not, a named effect that may be another one, and an effect of uncertain
//! size. Each question is a pair of effects, one of which can imitate the other. For every drive of [`separations`] the
//! RMS part that cannot be imitated is known as a multiple `r` of the noise. With `n` rows it adds `n r²` to the
//! evidence (twice the logarithm of the likelihood ratio). The evidence of each question is limited to the decisive
//! value. The drive with the largest sum over all questions per second is chosen (a design for discrimination, Atkinson
//! and Fedorov 1975).

use serde::Serialize;

use crate::diagnose::{Findings, RemainderKind, usual_rival};
use crate::excite::{Drive, ExciteError, Identification, Limits, SeparateOptions, separations};
use crate::model::Effect;
use crate::range;
use crate::record::Record;

/// Evidence that answers a question: twice the logarithm of a likelihood ratio of e¹⁵. The large ratio leaves a margin
/// for a misfit of the base model that is not white.
const DECISIVE_EVIDENCE: f64 = 30.0;
/// Candidate durations \[s\]; the shortest is long enough for a few slow loops.
const DURATIONS_S: [f64; 3] = [4.0, 8.0, 16.0];
/// Maximum number of questions for which a drive is chosen, the most uncertain first.
const MAX_QUESTIONS: usize = 4;

/// Required result of the experiments.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aim {
    /// Minimum probability of each named effect. Suspects of the diagnosis, effects that may act but are not named, are
    /// questions too.
    pub probability: f64,
    /// Maximum standard error of the best known parameter of each effect, as a share of its value.
    pub precision: f64,
}

/// An open question.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case", tag = "what")]
pub enum Question {
    /// Whether an effect acts.
    Suspect {
        /// The effect.
        effect: Effect,
        /// The effect that it may be instead.
        rival: Effect,
        /// Probability that it acts.
        probability: f64,
    },
    /// Whether a named effect is the right one.
    Name {
        /// The effect.
        effect: Effect,
        /// The effect that it may be instead.
        rival: Effect,
        /// Probability that it acts.
        probability: f64,
    },
    /// How large a named effect is.
    Size {
        /// The effect.
        effect: Effect,
        /// The effect with nearly the same signature.
        rival: Effect,
        /// Standard error of its best known parameter, as a share of its value.
        relative_error: f64,
    },
    /// Cause of the remainder that no effect explains.
    Unexplained,
}

impl Question {
    /// Returns the effects that a drive has to separate.
    fn pair(&self) -> Option<(Effect, Effect)> {
        match self {
            Self::Suspect { effect, rival, .. }
            | Self::Name { effect, rival, .. }
            | Self::Size { effect, rival, .. } => Some((*effect, *rival)),
            Self::Unexplained => None,
        }
    }

    /// Returns the uncertainty, from 0 to 1.
    fn uncertainty(&self) -> f64 {
        match self {
            Self::Suspect { probability, .. } => 1.0 - (2.0 * probability - 1.0).abs(),
            Self::Name { probability, .. } => 1.0 - probability,
            Self::Size { relative_error, .. } => 0.1 * relative_error.min(1.0),
            Self::Unexplained => 0.0,
        }
    }

    /// Returns the question in words.
    pub fn words(&self) -> String {
        match self {
            Self::Suspect { effect, probability, .. } => {
                format!("whether {effect} acts (probability {probability:.2})")
            }
            Self::Name { effect, rival, probability } => {
                format!("whether it is {effect} or {rival} (probability {probability:.2})")
            }
            Self::Size { effect, relative_error, .. } => {
                format!("how large {effect} is (known to {:.0} %)", 100.0 * relative_error)
            }
            Self::Unexplained => "what the unexplained residual is".to_owned(),
        }
    }
}

/// Returns the open questions, the most uncertain first; empty if the findings meet the aim.
pub fn open_questions(findings: &Findings, aim: Aim) -> Vec<Question> {
    let mut open = Vec::new();
    for suspect in &findings.suspects {
        let (effect, rival) = (suspect.name, suspect.rival.unwrap_or(usual_rival(suspect.name)));
        open.push(Question::Suspect { effect, rival, probability: suspect.probability });
    }
    for named in &findings.effects {
        let effect = named.name;
        let rivals = named.ties().chain(&named.alternatives).map(|other| other.name);
        let rival = rivals.into_iter().find(|other| *other != effect).unwrap_or(usual_rival(effect));
        // Effects that the records cannot distinguish share the probability.
        let probability = named.probability / (1 + named.ties().count()) as f64;
        if probability < aim.probability {
            open.push(Question::Name { effect, rival, probability });
            continue;
        }
        let share =
            |found: &crate::diagnose::Found| Some((found.std_error? / found.value).abs()).filter(|e| e.is_finite());
        let error = named.parameters.values().filter_map(share).fold(f64::INFINITY, f64::min);
        if error.is_finite() && error > aim.precision {
            open.push(Question::Size { effect, rival, relative_error: error });
        }
    }
    if findings.remainder.kind == RemainderKind::Unexplained {
        open.push(Question::Unexplained);
    }
    open.sort_by(|a, b| b.uncertainty().total_cmp(&a.uncertainty()));
    open
}

/// An experiment.
#[derive(Clone, Debug)]
pub struct Experiment {
    /// Its drive.
    pub drive: Drive,
    /// Name of the drive in messages.
    pub name: &'static str,
    /// Questions for which it was chosen, in words.
    pub why: String,
    /// Duration with rests \[s\].
    pub seconds: f64,
}

impl Experiment {
    fn new(drive: Drive, name: &'static str, why: String) -> Self {
        let seconds = seconds(&drive);
        Self { drive, name, why, seconds }
    }
}

/// Returns the duration of a drive with rests \[s\].
fn seconds(drive: &Drive) -> f64 {
    let time = drive.time();
    time.last().unwrap_or(&0.0) - time.first().unwrap_or(&0.0)
}

/// The next step.
#[derive(Clone, Debug)]
pub enum Next {
    /// An experiment.
    Play(Box<Experiment>),
    /// The end, with the reason.
    End(String),
}

/// Chooses experiments one after another.
#[derive(Clone, Debug)]
pub struct Planner {
    limits: Limits,
    aim: Aim,
    within_s: f64,
    seed: u64,
    planned: u64,
    spent_s: f64,
}

impl Planner {
    /// Creates a planner for drives within `limits` and with a total duration of at most `within_s` seconds.
    pub fn new(limits: Limits, aim: Aim, within_s: f64, seed: u64) -> Self {
        Self { limits, aim, within_s, seed, planned: 0, spent_s: 0.0 }
    }

    /// Returns the total duration of the experiments so far \[s\].
    pub fn spent(&self) -> f64 {
        self.spent_s
    }

    /// Sets the slew limit of later drives \[input unit/s\].
    pub fn stay_below(&mut self, slew: f64) {
        self.limits.slew_v_per_s = Some(slew);
    }

    /// Returns a short identification drive for the first record; each call returns another one.
    ///
    /// # Errors
    /// If no drive is within the limits.
    pub fn first(&mut self) -> Result<Next, ExciteError> {
        let first = self.identification("first record".to_owned())?;
        if first.seconds > self.left() {
            return Ok(Next::End(self.no_time(first.seconds)));
        }
        self.count(&first);
        Ok(Next::Play(Box::new(first)))
    }

    /// Returns the remaining time \[s\].
    fn left(&self) -> f64 {
        (self.within_s - self.spent_s).max(0.0)
    }

    fn no_time(&self, needed: f64) -> String {
        let left = self.left();
        format!(
            "{left:.1} s of {} s remain, but the next experiment takes {needed:.1} s; allow more time",
            self.within_s
        )
    }

    fn identification(&self, why: String) -> Result<Experiment, ExciteError> {
        let seed = self.seed.wrapping_add((self.planned + 1) << 32);
        let drive = Identification::short(self.limits.rate_hz, seed).within_slew(&self.limits, &|_| true);
        Ok(Experiment::new(drive.drive(&self.limits)?, "short identification", why))
    }

    fn count(&mut self, experiment: &Experiment) {
        self.planned += 1;
        self.spent_s += experiment.seconds;
    }

    /// Returns the open questions after the diagnosis of `record`, which contains all data so far, and the next step.
    ///
    /// # Errors
    /// If no drive is within the limits.
    pub fn next(&mut self, findings: &Findings, record: &Record) -> Result<(Vec<Question>, Next), ExciteError> {
        let open = open_questions(findings, self.aim);
        if open.is_empty() {
            let why = format!(
                "all questions are answered after {:.1} s of experiments: each effect has a probability of at least {} and a parameter known to {} %",
                self.spent_s,
                self.aim.probability,
                100.0 * self.aim.precision
            );
            return Ok((open, Next::End(why)));
        }
        let words = open.iter().map(Question::words).collect::<Vec<_>>().join(", ");
        let (low, high) = range(record.output().unwrap_or_default().iter().copied());
        // The residual acts as noise in the separation of two effects.
        let residual = findings.after.train.map_or(0.0, |errors| errors.rmse).max(findings.noise_floor);
        let options = SeparateOptions {
            noise: (residual / (high - low)).clamp(1e-6, 0.5),
            thermometer: record.temperature().is_some(),
            load_cell: record.load().is_some(),
            // Each drive has other levels and phases, which adds information.
            seed: self.seed.wrapping_add(self.planned + 1),
            ..SeparateOptions::default()
        };
        let shortest = DURATIONS_S[0];
        if self.left() < shortest {
            return Ok((open, Next::End(format!("{}, for {words}", self.no_time(shortest)))));
        }
        let next = match choose(&open, &self.limits, &options, self.left())? {
            Some((drive, name)) => Some(Experiment::new(drive, name, words.clone())),
            // Another drive may show the cause of an unexplained remainder.
            None if open.contains(&Question::Unexplained) => Some(self.identification(words.clone())?),
            None => None,
        };
        let end = match next {
            Some(next) if next.seconds <= self.left() => {
                self.count(&next);
                return Ok((open, Next::Play(Box::new(next))));
            }
            Some(next) => format!("{}, for {words}", self.no_time(next.seconds)),
            None => format!(
                "no drive within the limits can decide {words}; also record temperature or load if these may act"
            ),
        };
        Ok((open, Next::End(end)))
    }
}

/// Returns the drive that decides most of `questions` per second, not longer than `seconds_left`; `None` if no question
/// is about two effects or no time remains.
fn choose(
    questions: &[Question],
    limits: &Limits,
    options: &SeparateOptions,
    seconds_left: f64,
) -> Result<Option<(Drive, &'static str)>, ExciteError> {
    let mut pairs: Vec<(Effect, Effect)> = Vec::new();
    for pair in questions.iter().filter_map(Question::pair) {
        if !pairs.contains(&pair) && pairs.len() < MAX_QUESTIONS {
            pairs.push(pair);
        }
    }
    if pairs.is_empty() {
        return Ok(None);
    }
    let mut best: Option<(f64, (Drive, &'static str))> = None;
    for duration_s in DURATIONS_S.into_iter().filter(|duration| *duration <= seconds_left) {
        for (drive, tried) in separations(&pairs, limits, &SeparateOptions { duration_s, ..*options })? {
            let rows = drive.voltage().len() as f64;
            let share = |left: f64| (rows * left * left / DECISIVE_EVIDENCE).min(1.0);
            let decided: f64 = tried.iter().map(|tried| share(tried.left())).sum();
            let seconds = seconds(&drive);
            let per_second = decided / seconds;
            if seconds <= seconds_left && per_second > best.as_ref().map_or(0.0, |(most, _)| *most) {
                best = Some((per_second, (drive, tried[0].drive)));
            }
        }
    }
    Ok(best.map(|(_, choice)| choice))
}
