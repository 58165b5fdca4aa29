//! `export`: the parameters of a model for firmware, as a block of bytes, Rust source or a C header.

mod c;
mod inverse;
mod rust;
mod words;

pub use c::{CName, c};
pub use rust::rust;

use hyst_core::{BlockError, write_block};

use crate::BetweenSamples;
use crate::model::{FittedOn, Model};

/// Returns the parameter block that firmware reads with [`hyst_core::read_block`].
///
/// # Errors
/// If the block is larger than 16 MB.
pub fn block(model: &Model) -> Result<Vec<u8>, BlockError> {
    let params = model.to_params();
    let mut size = 4096;
    loop {
        let mut buffer = vec![0; size];
        match write_block(&params, &mut buffer) {
            Ok(bytes) => return Ok(bytes.to_vec()),
            Err(BlockError::NoRoom) if size < 16 << 20 => size *= 2,
            Err(error) => return Err(error),
        }
    }
}

/// Returns the limitation of the model on a board, if there is one.
///
/// A board processes one sample at a time, so it cannot interpolate a band-limited drive.
pub fn lost(model: &Model) -> Option<&'static str> {
    (model.between_samples == BetweenSamples::BandLimited).then_some(
        "identified with a drive that is band-limited between samples, but a board interpolates it linearly: \
         this reduces a sine at 1/5 of the sample rate by 12 %, at 1/20 by 1 %; use a higher sample rate",
    )
}

/// Removes from a text of the model file all characters that could end a comment or its line.
fn harmless(text: &str) -> String {
    text.replace("*/", "").chars().filter(|c| !c.is_control()).collect()
}

fn origin(model: &Model) -> String {
    let of_file = |f: &FittedOn| match f.sha256.as_str() {
        "" => f.file.clone(),
        sum => format!("{} (sha256 {sum})", f.file),
    };
    let files: Vec<String> = model.fitted_on.iter().map(of_file).collect();
    let from = if files.is_empty() { String::new() } else { format!(", fitted on {}", files.join(", ")) };
    harmless(&format!(
        "Parameters of the model {}, input {} [{}], output {} [{}]{from}.",
        model.base.kind(),
        model.input.column,
        model.input.symbol(),
        model.output.column,
        model.output.symbol()
    ))
}
