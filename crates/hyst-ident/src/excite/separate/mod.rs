//! Finds the drive whose record separates two effects.
//!
//! Two effects are confused if one can imitate the other. For each candidate drive, [`separate`] computes the part of
//! one effect's signature in the output that the other effect cannot imitate, and vice versa. It returns the drive with
//! the largest such part. The actuator is the chain of `hyst-core` with the loop of a typical ceramic and typical
//! parameters of each effect. The weights, gain and zero of the loop are free, as in a fit.

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

/// Options of [`separate`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeparateOptions {
    /// Duration of the record \[s\].
    pub duration_s: f64,
    /// Standard deviation of the sensor noise as a share of the span of the output.
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

/// How well a record separates two effects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Verdict {
    /// The part that cannot be imitated is at least as large as the noise (RMS).
    Clear,
    /// It is at least a tenth of the noise: visible in the mean of many rows, if the misfit of the base model is not
    /// larger.
    Faint,
    /// It is smaller for all candidate drives.
    NotByADrive,
}

/// Result of one candidate drive. Values are RMS over the record, as multiples of the sensor noise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Tried {
    /// Name of the drive.
    pub drive: &'static str,
    /// Part of the first effect that the second cannot imitate.
    pub first_left: f64,
    /// Part of the second effect that the first cannot imitate.
    pub second_left: f64,
}

impl Tried {
    /// Returns the smaller of both, which applies whichever effect is present.
    pub fn left(&self) -> f64 {
        self.first_left.min(self.second_left)
    }
}

/// Result of [`separate`].
#[derive(Clone, Debug, PartialEq)]
pub struct Separation {
    /// Whether a drive separates the two effects.
    pub verdict: Verdict,
    /// All drives, the best first.
    pub tried: Vec<Tried>,
    /// The best drive.
    pub drive: Drive,
    /// Explanation: how the two effects differ, where to look, and what else to measure.
    pub reason: String,
}

/// Finds the drive that separates `a` from `b`. Takes about a second.
///
/// # Errors
/// If the two are the same, an option is out of range, or no candidate drive is within the limits.
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

/// Computes how well each candidate drive separates the effects of each pair, in the order of the pairs.
///
/// # Errors
/// As [`separate`], and if there is no pair.
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
    let mut first_error = None;
    let mut tried = Vec::new();
    for candidate in drives::family(limits, options) {
        let drive = match candidate.drive(limits) {
            Ok(drive) => drive,
            Err(error) => {
                first_error = first_error.or(Some(error));
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
    if tried.is_empty() { Err(first_error.unwrap_or(ExciteError::Nothing)) } else { Ok(tried) }
}

fn compare(drive: &'static str, rig: &Rig, first: &Family, second: &Family, noise: f64) -> Tried {
    Tried {
        drive,
        first_left: second.imitation_residual(rig, first.signature()) / noise,
        second_left: first.imitation_residual(rig, second.signature()) / noise,
    }
}
