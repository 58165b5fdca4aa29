//! Finds the drive whose record separates two effects.
//!
//! Two effects are confused if one can imitate the other. For each candidate drive, [`separate`] computes the part of
//! one effect's signature in the output that the other effect cannot imitate, and vice versa. It returns the drive with
//! the largest such part. The actuator is the chain of `hyst-core` with the loop of a typical ceramic and typical
//! parameters of each effect. The weights, gain and zero of the loop are free, as in a fit.

mod drives;
mod family;
mod imitation;
mod result;
mod rig;
#[cfg(test)]
mod tests;
mod words;

use super::error::require;
use super::{Drive, ExciteError, Limits};
use crate::model::Effect;
use family::Family;
pub use result::{SeparateOptions, Separation, Tried, Verdict};
use rig::Rig;

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
