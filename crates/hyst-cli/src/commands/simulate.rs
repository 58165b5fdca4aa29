//! `simulate`: predicts the output of a record with a model.

use hyst_ident::BetweenSamples;
use hyst_ident::metrics::{Errors, Mape, mape};
use hyst_ident::record::{Extra, Need};
use hyst_ident::simulate::{Extrapolated, SimulateOptions, Zero, simulate_with};
use serde::Serialize;

use crate::cli::SimulateArgs;
use crate::exit::CommandResult;
use crate::output::{self, Report, say};
use crate::{input, text};

/// Report of a simulation.
#[derive(Debug, Serialize)]
struct Summary {
    record: String,
    output: String,
    unit: String,
    rows: usize,
    settling_rows: usize,
    zero: Zero,
    /// Whether the model ran through each segment twice.
    periodic: bool,
    /// Interpolation of the drive between samples, from the model file.
    between_samples: BetweenSamples,
    /// Constant that was added for the record, with `--zero per-record`.
    zeros: Vec<f64>,
    /// Phase of the interference relative to the model's clock \[rad\], estimated from the first rows.
    /// 0 if the clock continues.
    tone_ahead_rad: f64,
    /// Distance between the earlier rest position and the start of each segment \[output unit\].
    /// Estimated from the creep in the first rows; 0 for a start from rest.
    creep_away: Vec<f64>,
    /// `None` without a measured output.
    errors: Option<Errors>,
    /// Inputs outside the range that the model was fitted to.
    extrapolated: Extrapolated,
    /// `None` without a measured output.
    mape: Option<Mape>,
}

/// Runs the command.
pub(super) fn run(args: &SimulateArgs) -> CommandResult {
    output::check(&[&args.model, &args.input], &[&args.output])?;
    let report = Report::new(args.json.json, &[&args.output])?.on_stderr();
    let (model, _) = input::model(&args.model)?;
    let predicted_column = input::output_unit(&model)?.predicted_column();
    let record = input::record(&args.input, &args.map, Need::Input)?;
    let zero = args.zero.get();
    let temperature = input::temperature(args.temperature, &model, &record);
    let simulated = simulate_with(
        &model,
        &record,
        &SimulateOptions { zero, temperature, periodic: args.periodic, ..SimulateOptions::default() },
    )?;

    let replaced = input::present(&args.input, &[&predicted_column, "settling"])?;
    let extra =
        [Extra::numbers(&predicted_column, &simulated.predicted), Extra::flags("settling", &simulated.settling)];
    args.output.write(|out| record.write_with(out, &extra).map_err(output::io_error))?;
    if !replaced.is_empty() {
        say(&format!(
            "note: {} already has {}; the output has this simulation instead",
            args.input.display(),
            text::listed(&replaced)
        ));
    }
    if zero == Zero::PerRecord && simulated.errors.is_none() {
        say("note: --zero per-record has no effect without a measured output");
    }
    if simulated.extrapolated.rows > 0 {
        let beyond = text::extrapolation("input", &text::from_one(simulated.extrapolated), &model.input);
        say(&format!("warning: {beyond}; the prediction is extrapolated there"));
    }
    // `None` also for an error: `simulate_with` has compared the same rows and has reported it.
    let mape = record.output().and_then(|y| mape(y, &simulated.predicted, &simulated.settling).ok());
    let summary = Summary {
        record: args.input.display().to_string(),
        output: args.output.to_string(),
        unit: model.output.unit.clone(),
        rows: record.rows(),
        settling_rows: simulated.settling.iter().filter(|settling| **settling).count(),
        zero,
        periodic: args.periodic,
        between_samples: model.between_samples,
        zeros: simulated.zeros,
        tone_ahead_rad: simulated.tone_ahead.first().copied().unwrap_or(0.0),
        creep_away: simulated.creep_away,
        errors: simulated.errors,
        // Reports and JSON count rows from 1.
        extrapolated: text::from_one(simulated.extrapolated),
        mape,
    };
    report.print(&summary.text(), &summary)
}

impl Summary {
    fn text(&self) -> String {
        let unit = text::symbol(&self.unit);
        let rows = text::count(self.rows, "row");
        let text = match &self.errors {
            None => format!("{}: {rows}, no measured output to compare with", self.record),
            Some(errors) => {
                let mut text = format!("{}: {rows} (start-up rows: {}), ", self.record, self.settling_rows);
                text.push_str(&text::errors(errors, unit));
                if let Some(mape) = &self.mape {
                    text.push_str(&format!("\n{}", text::mape(mape)));
                }
                for zero in &self.zeros {
                    text.push_str(&format!(
                        "\nsensor zero of the record: {} {unit} relative to the model's",
                        text::short(*zero)
                    ));
                }
                if self.tone_ahead_rad != 0.0 {
                    text.push_str(&format!(
                        "\nphase of the interference, estimated from the first rows: {}° relative to the model's clock",
                        text::short(self.tone_ahead_rad.to_degrees())
                    ));
                }
                let continued: Vec<f64> = self.creep_away.iter().copied().filter(|away| *away != 0.0).collect();
                if let Some(largest) = continued.iter().copied().reduce(|a, b| if b.abs() > a.abs() { b } else { a }) {
                    text.push_str(&format!(
                        "\ncreep from before the record continues in {} of {}: the actuator had rested {} {unit} away from the start",
                        continued.len(),
                        text::count(self.creep_away.len(), "segment"),
                        text::short(largest)
                    ));
                }
                text
            }
        };
        format!("{text}\nwritten: {}", self.output)
    }
}
