//! `fit`: a model of the hysteresis from records.

use std::path::Path;

use std::ops::ControlFlow;

use hyst_core::PiParams;
use hyst_ident::fit::{Fit, fit_with};
use hyst_ident::identify::{Determined, Estimate, TradeOff};
use hyst_ident::metrics::Errors;
use hyst_ident::model::{Base, Model};
use hyst_ident::optimize::{Spread, Stopped};
use hyst_ident::record::Record;
use hyst_ident::simulate::{Zero, simulate};
use serde::Serialize;

use crate::cli::FitArgs;
use crate::exit::CommandResult;
use crate::output::{self, Report};
use crate::progress::Progress;
use crate::{input, text};

/// What is said about a fit.
#[derive(Debug, Serialize)]
struct Summary {
    model: &'static str,
    output: String,
    unit: String,
    rows: usize,
    settling_rows: usize,
    zero: Zero,
    errors: Option<Errors>,
    base: Option<BaseSummary>,
    sensor_zero: f64,
    how: String,
    seed: u64,
    evaluations: u64,
    /// Standard errors, correlations and what the record does not determine.
    estimate: Option<Estimate>,
    /// How the searches ended, and how their costs scatter.
    trials: Option<TrialsSummary>,
    #[serde(skip)]
    input_unit: String,
    #[serde(skip)]
    seen: String,
}

/// Searches with different draws.
#[derive(Debug, Serialize)]
struct TrialsSummary {
    count: usize,
    costs: Option<Spread>,
    stopped: Vec<Stopped>,
}

/// The hysteresis in a few numbers.
#[derive(Debug, Serialize)]
#[serde(untagged)]
enum BaseSummary {
    /// `p0` is the gain of the part without hysteresis.
    Pi { p0: f64, plays: usize, plays_with_weight: usize },
    /// Cells of the Preisach triangle.
    Preisach { cells: usize, cells_with_density: usize },
}

/// Runs the command.
pub(super) fn run(args: &FitArgs) -> CommandResult {
    let read: Vec<&Path> = args.train.iter().map(AsRef::as_ref).collect();
    output::check(&read, &[&args.output])?;
    let report = Report::new(args.json.json, &[&args.output])?;
    let record = input::training(&args.train, &args.map.map)?;
    let zero = args.zero.get();

    let options = args.search.options(zero == Zero::PerRecord)?;
    let doing = format!("fitting {} to {}", args.model, text::count(record.rows(), "row"));
    let progress = Progress::spinner(&doing);
    let Fit { model, how, estimate, trials, evaluations } = fit_with(&record, args.model, &options, &mut |p| {
        progress.say(&format!("{doing}: {} of at most {} evaluations", p.evaluations, p.budget));
        ControlFlow::Continue(())
    })?;
    let simulated = simulate(&model, &record, zero)?;
    drop(progress);

    args.output.write(|out| out.write_all(model.to_json().as_bytes()))?;
    let summary = Summary {
        model: args.model.name(),
        output: args.output.to_string(),
        unit: model.output.unit.clone(),
        rows: record.rows(),
        settling_rows: simulated.settling.iter().filter(|settling| **settling).count(),
        zero,
        errors: simulated.errors,
        base: base_summary(&model),
        sensor_zero: model.zero,
        how,
        seed: options.seed,
        evaluations,
        trials: trials.map(|t| TrialsSummary {
            count: t.found.len(),
            costs: t.costs(),
            stopped: t.found.iter().map(|f| f.stopped).collect(),
        }),
        estimate,
        input_unit: model.input.unit.clone(),
        seen: seen(&record, &model),
    };
    report.print(&summary.text(), &summary)
}

/// What the record looks like: a slip of a unit shows here.
fn seen(record: &Record, model: &Model) -> String {
    let (time, period) = (record.time(), record.sample_period());
    let active = record.rows() as f64 * period;
    let lab = time.last().copied().unwrap_or_default() - time.first().copied().unwrap_or_default();
    format!(
        "record: {}, {} Hz, {} s of drive in {} s; input {} to {} {}, output {} to {} {}",
        text::count(record.segments().len(), "segment"),
        text::short(1.0 / period),
        text::short(active),
        text::short(lab),
        text::short(model.input.low),
        text::short(model.input.high),
        model.input.unit,
        text::short(model.output.low),
        text::short(model.output.high),
        text::symbol(&model.output.unit)
    )
}

fn base_summary(model: &Model) -> Option<BaseSummary> {
    let nonzero = |weights: &[f64]| weights.iter().filter(|w| **w != 0.0).count();
    match &model.base {
        Base::Pi(PiParams { gain, weights, .. }) => {
            Some(BaseSummary::Pi { p0: *gain, plays: weights.len(), plays_with_weight: nonzero(weights) })
        }
        Base::Preisach(spec) => {
            Some(BaseSummary::Preisach { cells: spec.density.len(), cells_with_density: nonzero(&spec.density) })
        }
        _ => None,
    }
}

impl Summary {
    fn text(&self) -> String {
        let unit = text::symbol(&self.unit);
        let mut lines = vec![format!(
            "{} fitted to {} ({} settling): {}",
            self.model,
            text::count(self.rows, "row"),
            self.settling_rows,
            self.output
        )];
        lines.push(self.seen.clone());
        lines.extend(self.errors.map(|errors| text::errors(&errors, unit)));
        lines.extend(self.base.as_ref().map(|base| match base {
            BaseSummary::Pi { p0, plays, plays_with_weight } => {
                format!(
                    "p0 {} {unit}/{}, {plays_with_weight} of {plays} plays with weight",
                    text::short(*p0),
                    self.input_unit
                )
            }
            BaseSummary::Preisach { cells, cells_with_density } => {
                format!("{cells_with_density} of {cells} cells with density")
            }
        }));
        lines.push(format!("sensor zero {} {unit}", text::short(self.sensor_zero)));
        lines.push(self.how.clone());
        if let Some(TrialsSummary { count, costs: Some(costs), .. }) = self.trials.as_ref().filter(|t| t.count > 1) {
            lines.push(format!(
                "{count} trials: what they left from {} to {}, median {} {unit}",
                text::short(costs.lowest),
                text::short(costs.highest),
                text::short(costs.median)
            ));
        }
        lines.extend(self.estimate.as_ref().map(parameters));
        lines.join("\n")
    }
}

/// Parameters with their standard errors, and what the record does not say.
fn parameters(estimate: &Estimate) -> String {
    let mut lines = Vec::new();
    let width = estimate.parameters.iter().map(|p| p.name.len()).max().unwrap_or(0);
    for p in &estimate.parameters {
        let what = match p.determined {
            Determined::Yes => "",
            Determined::NearZero => "  (zero within its error)",
            Determined::Together => "  (known only together with others)",
            Determined::No => "  (NOT determined by this record)",
        };
        lines.push(format!("  {:width$}  {} ± {}{what}", p.name, text::short(p.value), text::short(p.std_error)));
    }
    for TradeOff { changes, std_error } in estimate.trade_offs.iter().take(3) {
        let part = |(name, share): &(String, f64)| format!("{name} {:+.2}", share);
        lines.push(format!(
            "  free by {}: {} together leave no trace",
            text::percent(100.0 * std_error),
            changes.iter().map(part).collect::<Vec<_>>().join(", ")
        ));
    }
    lines.join("\n")
}
