//! `export`: writes a model's parameters for firmware.

use hyst_ident::export;

use crate::cli::{ExportArgs, ExportFormat};
use crate::exit::{CommandError, CommandResult};
use crate::{input, output};

/// Runs the command.
pub(super) fn run(args: &ExportArgs) -> CommandResult {
    if args.name.is_some() && !matches!(args.format, ExportFormat::C) {
        let message = "--name needs --format c: the name of Rust source is that of its file, and a block has none";
        return Err(CommandError::bad_input(message));
    }
    output::check(&[&args.model], &[&args.output])?;
    if matches!(args.format, ExportFormat::Postcard) {
        output::refuse_terminal(&args.output, "a postcard block")?;
    }
    let (model, _) = input::model(&args.model)?;
    let bytes = match args.format {
        ExportFormat::Postcard => export::block(&model)?,
        ExportFormat::Rust => export::rust(&model).into_bytes(),
        ExportFormat::C => export::c(&model, &args.name.clone().unwrap_or_default())?.into_bytes(),
    };
    args.output.write(|out| out.write_all(&bytes))?;
    if let Some(lost) = export::lost(&model) {
        output::say(&format!("note: the model was {lost}"));
    }
    Ok(())
}
