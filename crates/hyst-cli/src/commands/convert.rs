//! `convert`: converts a file of any readable format to a record or another format.

use hyst_ident::record::FileKind;
use serde::Serialize;

use crate::cli::ConvertArgs;
use crate::exit::{CommandError, CommandResult};
use crate::output::{self, Report, Target, io_error};
use crate::{input, text};

/// Report of a conversion.
#[derive(Debug, Serialize)]
struct Summary {
    output: String,
    rows: usize,
    segments: usize,
    notes: Vec<String>,
}

/// Returns the format that the ending of the output's name selects.
fn kind(output: &Target) -> CommandResult<FileKind> {
    let Some(path) = output.file() else { return Ok(FileKind::Csv) };
    let ending = path.extension().map(|ending| ending.to_string_lossy().into_owned()).unwrap_or_default();
    FileKind::of_ending(&ending).ok_or_else(|| {
        let known: Vec<String> = FileKind::ALL.iter().map(|kind| format!(".{}", kind.ending())).collect();
        CommandError::bad_input(format!(
            "{output}: the ending of the name selects the format, but it is not one of {}; give another name",
            text::listed(&known)
        ))
    })
}

/// Runs the command.
pub(super) fn run(args: &ConvertArgs) -> CommandResult {
    output::check(&[&args.input], &[&args.output])?;
    let kind = kind(&args.output)?;
    let report = Report::new(args.json.json, &[&args.output])?;
    let record = input::any(&args.input, &args.map)?;
    input::refuse_constant(&record)?;
    args.output.write(|out| record.write_as(kind, out).map_err(io_error))?;
    let summary = Summary {
        output: args.output.to_string(),
        rows: record.rows(),
        segments: record.segments().len(),
        notes: record.notes().to_vec(),
    };
    let text = format!(
        "{}: {} in {}, {} samples per second",
        summary.output,
        text::count(summary.rows, "row"),
        text::count(summary.segments, "segment"),
        text::short(1.0 / record.sample_period())
    );
    report.print(&text, &summary)
}
