//! A controller as bytes: a model, and optionally a PID and a force observer.
//!
//! | bytes | content |
//! |---|---|
//! | 4 | `HYCT` |
//! | 1 | version of this format |
//! | 1 | bit 0: contains a PID; bit 1: contains a force observer |
//! | 0 or 72 | the nine numbers of [`PidParams`] in their order, `f64`, little endian |
//! | 0 or 24 | the three numbers of [`ForceParams`] in their order, `f64`, little endian |
//! | 4 | CRC-32 (ISO-HDLC) of all bytes before, little endian |
//! | n | the model: a [block](hyst_core::read_block), which has its own checksum |

use core::fmt;

use hyst_core::{BlockError, ChainParams, ForceParams, List, PidParams, read_block};

/// Version of this format.
pub const RECIPE: u8 = 1;

const MAGIC: [u8; 4] = *b"HYCT";
const PID_NUMBERS: usize = 9;
const FORCE_NUMBERS: usize = 3;
const WITH_PID: u8 = 1;
const WITH_FORCE: u8 = 2;
const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);
/// Maximum number of bytes before the model.
pub const MOST_HEAD: usize = MAGIC.len() + 2 + 8 * (PID_NUMBERS + FORCE_NUMBERS) + 4;

/// Maximum number of plays of a model on a device.
pub const MOST_PLAYS: usize = 64;
/// Maximum number of creep elements, or of dead zones of an asymmetry, of a model on a device.
pub const MOST_ELEMENTS: usize = 16;

/// A model with the capacity of a device.
pub type Model = ChainParams<List<MOST_PLAYS>, List<MOST_ELEMENTS>>;

/// A controller: the model for the feedforward, and optionally a PID and a force observer.
#[derive(Debug, Clone, PartialEq)]
pub struct Recipe {
    /// Feedback, if any.
    pub pid: Option<PidParams>,
    /// Force observer, if any. It converts the residual of the unloaded actuator's model to a force.
    pub force: Option<ForceParams>,
    /// The model.
    pub model: Model,
}

/// Errors on reading a recipe.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RecipeError {
    /// The bytes do not begin with `HYCT`.
    NotARecipe,
    /// The bytes have another version.
    Version(u8),
    /// Bytes are missing at the end.
    Truncated,
    /// The checksum of the gains does not match.
    Corrupt,
    /// The model cannot be read.
    Model(BlockError),
}

impl fmt::Display for RecipeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotARecipe => f.write_str("not a controller: it does not begin with HYCT"),
            Self::Version(version) => {
                write!(f, "controller version {version}, this build reads {RECIPE}: update the older of the two")
            }
            Self::Truncated => f.write_str("the controller is incomplete: send it again"),
            Self::Corrupt => f.write_str("the controller is damaged: send it again"),
            Self::Model(error) => error.fmt(f),
        }
    }
}

impl core::error::Error for RecipeError {}

fn of_pid(pid: &PidParams) -> [f64; PID_NUMBERS] {
    [
        pid.proportional,
        pid.integral,
        pid.derivative,
        pid.derivative_hz,
        pid.proportional_weight,
        pid.derivative_weight,
        pid.anti_windup_seconds,
        pid.low,
        pid.high,
    ]
}

/// Returns the bytes before the model's block.
pub fn head(pid: Option<&PidParams>, force: Option<&ForceParams>) -> heapless::Vec<u8, MOST_HEAD> {
    let mut bytes = heapless::Vec::new();
    let with = if pid.is_some() { WITH_PID } else { 0 } | if force.is_some() { WITH_FORCE } else { 0 };
    // All bytes fit, by the definition of `MOST_HEAD`.
    let _ = bytes.extend_from_slice(&MAGIC);
    let _ = bytes.extend_from_slice(&[RECIPE, with]);
    let of_force = force.map(|f| [f.stiffness, f.kappa, f.chi]);
    for number in pid.map(of_pid).iter().flatten().chain(of_force.iter().flatten()) {
        let _ = bytes.extend_from_slice(&number.to_le_bytes());
    }
    let sum = CRC.checksum(&bytes).to_le_bytes();
    let _ = bytes.extend_from_slice(&sum);
    bytes
}

/// Reads a recipe.
///
/// # Errors
/// See [`RecipeError`].
pub fn read(bytes: &[u8]) -> Result<Recipe, RecipeError> {
    let fixed = MAGIC.len() + 2;
    if bytes.get(..MAGIC.len()) != Some(&MAGIC[..]) {
        return Err(RecipeError::NotARecipe);
    }
    let (Some(version), Some(with)) = (bytes.get(fixed - 2), bytes.get(fixed - 1)) else {
        return Err(RecipeError::Truncated);
    };
    if *version != RECIPE {
        return Err(RecipeError::Version(*version));
    }
    let (with_pid, with_force) = (with & WITH_PID != 0, with & WITH_FORCE != 0);
    let numbers = if with_pid { PID_NUMBERS } else { 0 } + if with_force { FORCE_NUMBERS } else { 0 };
    let end = fixed + 8 * numbers;
    let (Some(front), Some(stated), Some(block)) = (bytes.get(..end), bytes.get(end..end + 4), bytes.get(end + 4..))
    else {
        return Err(RecipeError::Truncated);
    };
    if CRC.checksum(front).to_le_bytes() != *stated {
        return Err(RecipeError::Corrupt);
    }
    let mut read = front[fixed..].chunks_exact(8).filter_map(|b| b.try_into().ok()).map(f64::from_le_bytes);
    let mut next = || read.next().unwrap_or_default();
    let pid = with_pid.then(|| PidParams {
        proportional: next(),
        integral: next(),
        derivative: next(),
        derivative_hz: next(),
        proportional_weight: next(),
        derivative_weight: next(),
        anti_windup_seconds: next(),
        low: next(),
        high: next(),
    });
    let force = with_force.then(|| ForceParams { stiffness: next(), kappa: next(), chi: next() });
    Ok(Recipe { pid, force, model: read_block(block).map_err(RecipeError::Model)? })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wire::model_sum;

    /// Head and block end with their own checksums.
    ///
    /// The checksum of the whole controller must still depend on the gains.
    #[test]
    fn controllers_that_differ_only_in_gains_have_different_checksums() {
        let forces = [1.0, 2.0].map(|stiffness| {
            let mut bytes: Vec<u8> =
                head(None, Some(&ForceParams { stiffness, kappa: 1.0, chi: 0.0 })).iter().copied().collect();
            let block = b"any model";
            bytes.extend_from_slice(block);
            bytes.extend_from_slice(&CRC.checksum(block).to_le_bytes());
            bytes
        });
        assert_ne!(model_sum(&forces[0]), model_sum(&forces[1]));
        assert_eq!(CRC.checksum(&forces[0]), CRC.checksum(&forces[1]), "a second CRC-32 would not distinguish them");
    }
}
