//! `loop`: measures a loop before and after phase and gain of the structure are removed.

use hyst_ident::linear::{CorrectedLoop, LoopFigures, corrected_loop};
use hyst_ident::record::Need;
use serde::Serialize;

use crate::cli::LoopArgs;
use crate::exit::{CommandError, CommandResult};
use crate::output::{self, Report, Target};
use crate::{input, text};

/// Report of a loop.
#[derive(Debug, Serialize)]
struct Summary {
    record: String,
    over: String,
    hz: f64,
    cycles: usize,
    phase_deg: f64,
    gain: f64,
    raw: LoopFigures,
    corrected: LoopFigures,
}

/// Runs the command.
pub(super) fn run(args: &LoopArgs) -> CommandResult {
    let written: Vec<&Target> = args.output.iter().collect();
    let mut read = vec![args.record.as_path()];
    read.extend(args.reference.as_deref());
    output::check(&read, &written)?;
    let report = Report::new(args.json.json, &written)?;
    let record = input::record(&args.record, &args.map, Need::InputAndOutput)?;
    let measured = record.output().unwrap_or_default();
    let reference = match &args.reference {
        None => None,
        Some(path) => {
            let reference = input::record(path, &args.map, Need::Reference { temperature: false, load: false })?;
            if reference.rows() != record.rows() || reference.output_unit() != record.output_unit() {
                let message = format!(
                    "{}: the reference for {} needs {} of the same unit, but has {}",
                    path.display(),
                    args.record.display(),
                    text::count(record.rows(), "row"),
                    text::count(reference.rows(), "row")
                );
                return Err(CommandError::bad_input(message));
            }
            Some(reference)
        }
    };
    let (wanted, over) = match &reference {
        Some(reference) => (reference.output().unwrap_or_default(), "reference"),
        None => (record.input(), record.input_column()),
    };
    let period = record.need_one_sample_period("a hysteresis loop")?;
    let found = corrected_loop(period, wanted, measured, args.frequency, args.phase.to_radians())?;
    if let Some(target) = &args.output {
        target.write(|out| csv(out, &found))?;
    }
    let summary = Summary {
        record: args.record.display().to_string(),
        over: over.to_owned(),
        hz: found.hz,
        cycles: found.cycles,
        phase_deg: args.phase,
        gain: found.gain,
        raw: found.raw,
        corrected: found.corrected,
    };
    let mut text = summary.text();
    if let Some(Target::File(path)) = &args.output {
        text.push_str(&format!("\nloop: {}", path.display()));
    }
    report.print(&text, &summary)
}

fn csv(out: &mut dyn std::io::Write, found: &CorrectedLoop) -> std::io::Result<()> {
    writeln!(out, "wanted,measured,straightened")?;
    for ((wanted, measured), straightened) in found.wanted.iter().zip(&found.measured).zip(&found.straightened) {
        writeln!(out, "{wanted:.8e},{measured:.8e},{straightened:.8e}")?;
    }
    Ok(())
}

impl Summary {
    fn text(&self) -> String {
        let head = ["", "loop width", "RMS deviation from a line"].map(str::to_owned).to_vec();
        let row = |name: &str, figures: &LoopFigures| {
            vec![name.to_owned(), text::percent(figures.width_percent), text::percent(figures.rmse_percent)]
        };
        let rows = [
            head,
            row("as measured", &self.raw),
            row(&format!("without {} deg phase and gain", self.phase_deg), &self.corrected),
        ];
        format!(
            "{}: {} of {} Hz over {}; percentages of the output's span\n{}",
            self.record,
            text::count(self.cycles, "cycle"),
            text::short(self.hz),
            self.over,
            text::table(&rows)
        )
    }
}
