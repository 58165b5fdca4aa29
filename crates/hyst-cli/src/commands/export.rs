//! `export`: a model's parameters for a board.

use hyst_ident::export;

use crate::cli::{ExportArgs, ExportFormat};
use crate::exit::CommandResult;
use crate::{input, output};

/// Runs the command.
pub(super) fn run(args: &ExportArgs) -> CommandResult {
    output::check(&[&args.model], &[&args.output])?;
    let (model, _) = input::model(&args.model)?;
    let bytes = match args.format {
        ExportFormat::Postcard => export::block(&model)?,
        ExportFormat::Rust => export::rust(&model).into_bytes(),
        ExportFormat::C => export::c(&model)?.into_bytes(),
    };
    args.output.write(|out| out.write_all(&bytes))
}
