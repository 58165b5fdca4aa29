//! `export`: a model's parameters for a board, as a block of bytes, as Rust source, as a C header.

mod c;
mod inverse;
mod rust;
mod words;

pub use c::{CName, c};
pub use rust::rust;

use hyst_core::{BlockError, write_block};

use crate::BetweenSamples;
use crate::model::{FittedOn, Model};

/// The parameter block that firmware reads with [`hyst_core::read_block`].
///
/// # Errors
/// If the block would be larger than 16 MB.
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

/// What is lost on a board, if something is: it takes one sample after the other, and no band-limited drive can be told from what has
/// come of it so far.
pub fn lost(model: &Model) -> Option<&'static str> {
    (model.between_samples == BetweenSamples::BandLimited).then_some(
        "identified with a drive that is band-limited between samples, but a board sees it linear between them: \
         a sine at a fifth of the sample rate counts 12 % less, at a twentieth 1 %; sample faster",
    )
}

/// Text of the model file for a comment: what could end the comment or its line is left out.
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
