//! `simulate`: what a model says about a record.

use hyst_ident::BetweenSamples;
use hyst_ident::metrics::{Errors, Mape, mape};
use hyst_ident::record::{Extra, Need};
use hyst_ident::simulate::{Extrapolated, SimulateOptions, Zero, simulate_with};
use serde::Serialize;

use crate::cli::SimulateArgs;
use crate::exit::CommandResult;
use crate::output::{self, Report, say};
use crate::{input, text};

/// What is said about a simulation.
#[derive(Debug, Serialize)]
struct Summary {
    record: String,
    output: String,
    unit: String,
    rows: usize,
    settling_rows: usize,
    zero: Zero,
    /// Whether the segments were passed twice.
    periodic: bool,
    /// How the drive goes on between samples, as the model's file says.
    between_samples: BetweenSamples,
    /// Constant that was added for the record, with `--zero per-record`.
    zeros: Vec<f64>,
    /// Angle in rad by which the tone of the model is ahead of the model's clock: the first rows show it; 0 where the clock goes on.
    tone_ahead_rad: f64,
    /// How far away from the first motion of each segment the actuator had rested before, in the output's unit: the first rows show by how much a creep goes
    /// on; 0 from rest.
    creep_away: Vec<f64>,
    /// None without a measured output.
    errors: Option<Errors>,
    /// Inputs beyond the range of the record that the model was fitted to.
    extrapolated: Extrapolated,
    /// None without a measured output.
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
            "note: {} has {} already; in the output this simulation stands in its place",
            args.input.display(),
            text::listed(&replaced)
        ));
    }
    if zero == Zero::PerRecord && simulated.errors.is_none() {
        say("note: without a measured output --zero per-record has no effect");
    }
    if simulated.extrapolated.rows > 0 {
        let beyond = text::extrapolation("input", &text::from_one(simulated.extrapolated), &model.input);
        say(&format!("warning: {beyond}; the prediction is extrapolated there"));
    }
    // What could not be compared is an error of the simulation already.
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
        // People and JSON count rows from 1, where there is one.
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
                let mut text = format!("{}: {rows} ({} settling), ", self.record, self.settling_rows);
                text.push_str(&text::errors(errors, unit));
                if let Some(mape) = &self.mape {
                    text.push_str(&format!("\n{}", text::mape(mape)));
                }
                for zero in &self.zeros {
                    text.push_str(&format!(
                        "\nsensor zero of the record: {} {unit} from the model's",
                        text::short(*zero)
                    ));
                }
                if self.tone_ahead_rad != 0.0 {
                    text.push_str(&format!(
                        "\nphase of the tone, from the first rows: {}° from that of the model's clock",
                        text::short(self.tone_ahead_rad.to_degrees())
                    ));
                }
                let crept: Vec<f64> = self.creep_away.iter().copied().filter(|away| *away != 0.0).collect();
                if let Some(largest) = crept.iter().copied().reduce(|a, b| if b.abs() > a.abs() { b } else { a }) {
                    text.push_str(&format!(
                        "\ncreep continues from before the record in {} of {}: the actuator rested {} {unit} from where it starts",
                        crept.len(),
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
