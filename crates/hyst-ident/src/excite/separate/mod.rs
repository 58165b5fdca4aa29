//! The record that would tell two effects apart.
//!
//! Two effects are confused when the best-fitting one of them imitates the other. [`separate`] computes, for each of a family of
//! drives, how much of one effect's mark on the output the other cannot imitate, and the other way round, and takes the drive
//! that leaves most. The actuator is the chain of `hyst-core` with a typical ceramic's loop and typical parameters of each
//! effect; its loop's weights, gain and zero are free as well, as a fit leaves them.

mod drives;
mod family;
mod imitation;
mod rig;
#[cfg(test)]
mod tests;
mod words;

use serde::Serialize;

use super::{Drive, ExciteError, Limits, require};
use crate::model::Effect;
use family::Family;
use rig::Rig;

/// What [`separate`] is to reckon with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeparateOptions {
    /// Duration of the record \[s\].
    pub duration_s: f64,
    /// Standard deviation of the sensor's noise as a share of the output's span.
    pub noise: f64,
    /// Whether the record has `temperature_degc`.
    pub thermometer: bool,
    /// Whether the record has `load_n`.
    pub load_cell: bool,
    /// Seed of levels and phases.
    pub seed: u64,
}

impl Default for SeparateOptions {
    fn default() -> Self {
        Self { duration_s: 30.0, noise: 1e-3, thermometer: false, load_cell: false, seed: 1 }
    }
}

/// How well a record tells two effects apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// What cannot be imitated is as large as the noise in every single row.
    Clear,
    /// It is a tenth of the noise or more: seen in the mean of many rows, if the base model misses no more than that.
    Faint,
    /// No drive of the family leaves as much.
    NotByADrive,
}

/// One drive that was tried. Figures are root mean squares over the record, as multiples of the sensor's noise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Tried {
    /// The drive, in words.
    pub drive: &'static str,
    /// What of the first effect the second cannot imitate.
    pub first_left: f64,
    /// What of the second effect the first cannot imitate.
    pub second_left: f64,
}

impl Tried {
    /// The smaller of both: whichever effect it is, as much is left.
    pub fn left(&self) -> f64 {
        self.first_left.min(self.second_left)
    }
}

/// The answer of [`separate`].
#[derive(Clone, Debug, PartialEq)]
pub struct Separation {
    /// Whether a drive tells the two apart.
    pub verdict: Verdict,
    /// All drives, the best first.
    pub tried: Vec<Tried>,
    /// The best drive.
    pub drive: Drive,
    /// How the two differ, what to look at, and what to measure besides, in words.
    pub reason: String,
}

/// Finds the drive that tells `a` from `b`. Takes about a second.
///
/// # Errors
/// When the two are the same, an option is out of range, or no drive of the family keeps to the limits.
pub fn separate(a: Effect, b: Effect, limits: &Limits, options: &SeparateOptions) -> Result<Separation, ExciteError> {
    let mut best: Option<(Tried, Drive)> = None;
    let mut tried = Vec::new();
    for (drive, found) in separations(&[(a, b)], limits, options)? {
        let found = found[0];
        if best.as_ref().is_none_or(|(best, _)| found.left() > best.left()) {
            best = Some((found, drive));
        }
        tried.push(found);
    }
    tried.sort_by(|a, b| b.left().total_cmp(&a.left()));
    let (found, drive) = best.ok_or(ExciteError::Nothing)?;
    let verdict = match found.left() {
        left if left >= 1.0 => Verdict::Clear,
        left if left >= 0.1 => Verdict::Faint,
        _ => Verdict::NotByADrive,
    };
    let reason = words::reason((a, b), verdict, &found, options);
    Ok(Separation { verdict, tried, drive, reason })
}

/// How well each drive of the family tells the effects of each pair apart, in the order of the pairs.
///
/// # Errors
/// As those of [`separate`], and without a pair.
pub fn separations(
    pairs: &[(Effect, Effect)],
    limits: &Limits,
    options: &SeparateOptions,
) -> Result<Vec<(Drive, Vec<Tried>)>, ExciteError> {
    limits.check()?;
    require("duration_s", options.duration_s, (4.0..=120.0).contains(&options.duration_s), "between 4 and 120")?;
    require("noise", options.noise, options.noise > 0.0 && options.noise < 1.0, "above 0 and below 1")?;
    require("rate_hz", limits.rate_hz, limits.rate_hz >= 20.0, "at least 20 for the dynamics of an actuator")?;
    if pairs.is_empty() {
        return Err(ExciteError::Nothing);
    }
    if let Some((a, _)) = pairs.iter().find(|(a, b)| a == b) {
        return Err(ExciteError::Same { effect: a.name() });
    }
    let mut refused = None;
    let mut tried = Vec::new();
    for candidate in drives::family(limits, options) {
        let drive = match candidate.drive(limits) {
            Ok(drive) => drive,
            Err(error) => {
                refused = refused.or(Some(error));
                continue;
            }
        };
        let rig = Rig::new(&candidate, limits, options)?;
        let of = |(a, b): &(Effect, Effect)| {
            let (first, second) = (Family::new(&rig, *a), Family::new(&rig, *b));
            compare(candidate.name, &rig, &first, &second, options.noise)
        };
        tried.push((drive, pairs.iter().map(of).collect()));
    }
    if tried.is_empty() { Err(refused.unwrap_or(ExciteError::Nothing)) } else { Ok(tried) }
}

fn compare(drive: &'static str, rig: &Rig, first: &Family, second: &Family, noise: f64) -> Tried {
    Tried {
        drive,
        first_left: second.cannot_imitate(rig, first.mark()) / noise,
        second_left: first.cannot_imitate(rig, second.mark()) / noise,
    }
}
