//! `force`: estimates an external force without a force sensor.

use hyst_ident::force::{ForceOptions, Free, estimate_force};
use hyst_ident::metrics::Errors;
use hyst_ident::model::Effect;
use hyst_ident::range;
use hyst_ident::record::{Extra, Need};
use hyst_ident::simulate::Extrapolated;
use serde::Serialize;

use crate::cli::ForceArgs;
use crate::exit::{CommandError, CommandResult};
use crate::output::{self, Report, say};
use crate::{input, text};

/// Column of the estimate.
const COLUMN: &str = "estimated_force_n";

/// Report of an estimate.
#[derive(Debug, Serialize)]
struct Summary {
    record: String,
    output: String,
    rows: usize,
    /// \[N/output unit\]
    stiffness: f64,
    kappa: f64,
    /// \[output unit\]
    chi: f64,
    /// Number of rows without a force, from which κ and χ are computed.
    free_rows: usize,
    /// Maximum force that a change of the gain by 1 % imitates \[N\].
    n_per_gain_percent: f64,
    lowest_n: f64,
    highest_n: f64,
    /// Errors against the record's `load_n`; `None` without it.
    errors: Option<Errors>,
    extrapolated: Extrapolated,
    #[serde(skip)]
    unit: String,
}

/// Runs the command.
pub(super) fn run(args: &ForceArgs) -> CommandResult {
    let mut read = vec![args.model.as_path(), args.record.as_path()];
    read.extend(args.free.as_deref());
    output::check(&read, &[&args.output])?;
    let report = Report::new(args.json.json, &[&args.output])?.on_stderr();
    let (model, _) = input::model(&args.model)?;
    let record = input::record(&args.record, &args.map, Need::InputAndOutput)?;
    let other = args.free.as_ref().map(|path| input::record(path, &args.map, Need::InputAndOutput)).transpose()?;
    let free = match (&other, args.free_until) {
        (Some(other), _) => Free::Record(other),
        (None, Some(seconds)) => Free::Until(record.time().first().copied().unwrap_or_default() + seconds),
        (None, None) => Free::Unknown,
    };
    let own = model.effects.load.as_ref().filter(|load| load.per_newton > 0.0).map(|load| 1.0 / load.per_newton);
    let stiffness = args.kout.or(own).ok_or_else(|| {
        CommandError::bad_input("the stiffness is unknown, because the model has no compliance; give --kout")
    })?;
    let temperature = input::temperature(args.temperature, &model, &record);
    let estimated = estimate_force(&model, &record, &ForceOptions { stiffness, free, temperature })
        .map_err(CommandError::bad_input)?;

    let replaced = input::present(&args.record, &[COLUMN])?;
    let extra = [Extra::numbers(COLUMN, &estimated.force)];
    args.output.write(|out| record.write_with(out, &extra).map_err(output::io_error))?;
    if !replaced.is_empty() {
        say(&format!("note: {} already has {COLUMN}; the output has this estimate instead", args.record.display()));
    }
    if model.effects.names().contains(&Effect::Load) {
        say("note: the model's compliance is not used, because it would explain the force that is estimated");
    }
    if estimated.extrapolated.rows > 0 {
        let beyond = text::extrapolation("input", &text::from_one(estimated.extrapolated), &model.input);
        say(&format!("warning: {beyond}; the estimate is extrapolated there"));
    }
    let (low, high) = range(estimated.force.iter().copied());
    let summary = Summary {
        record: args.record.display().to_string(),
        output: args.output.to_string(),
        rows: record.rows(),
        stiffness,
        kappa: estimated.params.kappa,
        chi: estimated.params.chi,
        free_rows: estimated.free_rows,
        n_per_gain_percent: estimated.per_gain_percent,
        lowest_n: low,
        highest_n: high,
        errors: estimated.errors,
        extrapolated: text::from_one(estimated.extrapolated),
        unit: text::symbol(&model.output.unit).to_owned(),
    };
    report.print(&summary.text(), &summary)
}

impl Summary {
    fn text(&self) -> String {
        let short = text::short;
        let mut lines = vec![format!(
            "{}: {}, force {} to {} N with {} N/{}",
            self.record,
            text::count(self.rows, "row"),
            short(self.lowest_n),
            short(self.highest_n),
            short(self.stiffness),
            self.unit
        )];
        let per_percent = short(self.n_per_gain_percent);
        if self.free_rows > 0 {
            lines.push(format!(
                "κ = {}, χ = {} {} from {} without a force; an error of 1 % of the gain is a force of up to {per_percent} N",
                short(self.kappa),
                short(self.chi),
                self.unit,
                text::count(self.free_rows, "row")
            ));
        } else {
            lines.push(format!(
                "κ = 1, χ = 0: a change of the actuator since the fit appears as a force: a change of gain of 1 % as up to \
                 {per_percent} N, a change of zero of 1 {unit} as {} N; --free or --free-until corrects both",
                short(self.stiffness),
                unit = self.unit
            ));
        }
        lines.extend(self.errors.as_ref().map(|errors| {
            let (rmse, share) = (short(errors.rmse), text::percent(errors.nrmse_percent));
            format!("against load_n: RMSE {rmse} N ({share} of its span), largest {} N", short(errors.max_abs))
        }));
        lines.push(format!("written: {}", self.output));
        lines.join("\n")
    }
}
