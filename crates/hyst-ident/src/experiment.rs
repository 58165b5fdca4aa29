//! The next experiment: what a diagnosis leaves open, and the drive that decides most of it in the least time.
//!
//! A diagnosis leaves questions: an effect that may act or not, one that is named but might be another, one whose size is not well known. Each
//! is a pair of effects of which the best-fitting one imitates the other. For every drive of [`separations`] the part that cannot be imitated
//! is known as a multiple `r` of the noise, root mean square over the record; with `n` rows it adds `n r²` to the evidence (twice the logarithm
//! of the likelihood ratio). The drive is played for which the evidence, up to what decides a question, summed over all questions and
//! divided by the time, is largest (a design for discrimination, Atkinson and Fedorov 1975).

use serde::Serialize;

use crate::diagnose::{Findings, RemainderKind, usual_rival};
use crate::excite::{Drive, ExciteError, Identification, Limits, SeparateOptions, separations};
use crate::model::Effect;
use crate::range;
use crate::record::Record;

/// Evidence that decides a question: twice the logarithm of a likelihood ratio of e¹⁵, which leaves room for a misfit of the base that is
/// not white.
const DECISIVE_EVIDENCE: f64 = 30.0;
/// Durations that are tried \[s\]; the shortest is what a few slow loops need.
const DURATIONS_S: [f64; 3] = [4.0, 8.0, 16.0];
/// Questions that a drive is chosen for, the most open first.
const MAX_QUESTIONS: usize = 4;

/// What is to be known in the end.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aim {
    /// Probability that each named effect has. No effect without a name has half of one or more: a diagnosis calls such an effect a suspect.
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
        relative_error: f64,
    },
    /// What acts besides: something is left that nothing explains.
    Unexplained,
}

impl Question {
    /// The effects that a drive has to tell apart.
    fn pair(&self) -> Option<(Effect, Effect)> {
        match self {
            Self::Suspect { effect, rival, .. }
            | Self::Name { effect, rival, .. }
            | Self::Size { effect, rival, .. } => Some((*effect, *rival)),
            Self::Unexplained => None,
        }
    }

    /// How open it is, from 0 to 1.
    fn openness(&self) -> f64 {
        match self {
            Self::Suspect { probability, .. } => 1.0 - (2.0 * probability - 1.0).abs(),
            Self::Name { probability, .. } => 1.0 - probability,
            Self::Size { relative_error, .. } => 0.1 * relative_error.min(1.0),
            Self::Unexplained => 0.0,
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
            Self::Size { effect, relative_error, .. } => {
                format!("how large {effect} is (known to {:.0} %)", 100.0 * relative_error)
            }
            Self::Unexplained => "what the unexplained residual is".to_owned(),
        }
    }
}

/// What findings leave open, the most open first; empty where all is known as well as was asked.
pub fn open_questions(findings: &Findings, aim: Aim) -> Vec<Question> {
    let mut open = Vec::new();
    for suspect in &findings.suspects {
        let (effect, rival) = (suspect.name, suspect.rival.unwrap_or(usual_rival(suspect.name)));
        open.push(Question::Suspect { effect, rival, probability: suspect.probability });
    }
    for named in &findings.effects {
        let effect = named.name;
        let rival = named.alternatives.iter().map(|other| other.name).find(|other| *other != effect);
        let rival = rival.unwrap_or(usual_rival(effect));
        if named.probability < aim.probability {
            open.push(Question::Name { effect, rival, probability: named.probability });
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
    open.sort_by(|a, b| b.openness().total_cmp(&a.openness()));
    open
}

/// An experiment to play.
#[derive(Clone, Debug)]
pub struct Experiment {
    /// Its drive.
    pub drive: Drive,
    /// What it is, in words.
    pub name: &'static str,
    /// What it was chosen for, in words.
    pub why: String,
    /// How long it takes, rests included \[s\].
    pub seconds: f64,
}

impl Experiment {
    fn new(drive: Drive, name: &'static str, why: String) -> Self {
        let seconds = seconds(&drive);
        Self { drive, name, why, seconds }
    }
}

/// How long a drive takes, rests included \[s\].
fn seconds(drive: &Drive) -> f64 {
    let time = drive.time();
    time.last().unwrap_or(&0.0) - time.first().unwrap_or(&0.0)
}

/// What comes next.
#[derive(Clone, Debug)]
pub enum Next {
    /// An experiment.
    Play(Box<Experiment>),
    /// None, for this reason.
    End(String),
}

/// Chooses one experiment after the other.
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
    /// For drives within `limits` and, all together, `within_s` seconds.
    pub fn new(limits: Limits, aim: Aim, within_s: f64, seed: u64) -> Self {
        Self { limits, aim, within_s, seed, planned: 0, spent_s: 0.0 }
    }

    /// The time of all experiments that were handed out \[s\].
    pub fn spent(&self) -> f64 {
        self.spent_s
    }

    /// Lets no later drive be steeper \[input unit/s\].
    pub fn stay_below(&mut self, slew: f64) {
        self.limits.slew_v_per_s = Some(slew);
    }

    /// A first look: a short identification drive, of which each call gives another one.
    ///
    /// # Errors
    /// When no drive keeps to the limits.
    pub fn first(&mut self) -> Result<Next, ExciteError> {
        let first = self.identification("a first look".to_owned())?;
        if first.seconds > self.left() {
            return Ok(Next::End(self.no_time(first.seconds)));
        }
        self.count(&first);
        Ok(Next::Play(Box::new(first)))
    }

    /// Time that is left \[s\].
    fn left(&self) -> f64 {
        (self.within_s - self.spent_s).max(0.0)
    }

    fn no_time(&self, needed: f64) -> String {
        let left = self.left();
        format!(
            "{left:.1} of {} s are left, and the next experiment takes {needed:.1} s; allow more time",
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

    /// What comes after the diagnosis of `record`, all that was measured so far, and what is open.
    ///
    /// # Errors
    /// When no drive keeps to the limits.
    pub fn next(&mut self, findings: &Findings, record: &Record) -> Result<(Vec<Question>, Next), ExciteError> {
        let open = open_questions(findings, self.aim);
        if open.is_empty() {
            let why = format!(
                "all that was asked is known after {:.1} s of experiments: each effect has a probability of {} or more and a parameter known to {} %",
                self.spent_s,
                self.aim.probability,
                100.0 * self.aim.precision
            );
            return Ok((open, Next::End(why)));
        }
        let words = open.iter().map(Question::words).collect::<Vec<_>>().join(", ");
        let (low, high) = range(record.output().unwrap_or_default().iter().copied());
        // What is missed is noise for whoever tells two effects apart.
        let missed = findings.after.train.map_or(0.0, |errors| errors.rmse).max(findings.noise_floor);
        let options = SeparateOptions {
            noise: (missed / (high - low)).clamp(1e-6, 0.5),
            thermometer: record.temperature().is_some(),
            load_cell: record.load().is_some(),
            // No drive is played twice: other levels and phases say more.
            seed: self.seed.wrapping_add(self.planned + 1),
            ..SeparateOptions::default()
        };
        let shortest = DURATIONS_S[0];
        if self.left() < shortest {
            return Ok((open, Next::End(format!("{}, for {words}", self.no_time(shortest)))));
        }
        let next = match choose(&open, &self.limits, &options, self.left())? {
            Some((drive, name)) => Some(Experiment::new(drive, name, words.clone())),
            // What nothing explains may show under another drive.
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
                "no drive within the limits decides {words}; measure temperature or load besides, if these may act"
            ),
        };
        Ok((open, Next::End(end)))
    }
}

/// The drive that decides most of `questions` per second, not longer than `seconds_left`; `None` where none of them is one of two effects or no
/// time is left.
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
