//! `fit`: fits a hysteresis model to records.

use std::path::Path;

mod convergence;
mod surface;

use hyst_core::PiParams;
use hyst_ident::everett::{DpmReport, FodOptions, FodReport, fit_dpm, fit_fod, shows_only_curves};
use hyst_ident::fit::{Fit, FitOptions, fit_with};
use hyst_ident::identify::{Determined, Estimate, TableEstimate, TradeOff};
use hyst_ident::metrics::Errors;
use hyst_ident::model::{Base, Kind, Model};
use hyst_ident::optimize::{Spread, Stopped};
use hyst_ident::record::Record;
use hyst_ident::simulate::{Zero, simulate};
use hyst_ident::{BetweenSamples, range};
use serde::Serialize;

use crate::canvas::Format;
use crate::cli::{FitArgs, FitFrom};
use crate::exit::{CommandError, CommandResult};
use crate::hosted;
use crate::output::{self, Report};
use crate::progress::Progress;
use crate::report::next::{files, further, quoted};
use crate::{input, text};

/// Report of a fit.
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
    /// The gain is negative.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    falls: bool,
    how: String,
    /// Interpolation of the drive between samples.
    between_samples: BetweenSummary,
    seed: u64,
    evaluations: u64,
    /// Standard errors, correlations and undetermined parameters.
    estimate: Option<Estimate>,
    /// How well the record determines the cells of a Preisach triangle or the nodes of a mirror function.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    tables: Vec<TableEstimate>,
    /// Ends and costs of the searches.
    trials: Option<TrialsSummary>,
    /// Everett surface from first-order descent curves, with `--from fod`.
    #[serde(skip_serializing_if = "Option::is_none")]
    surface: Option<FodReport>,
    /// Rate dependence, with `--model dpm`.
    #[serde(skip_serializing_if = "Option::is_none")]
    dynamics: Option<DpmReport>,
    #[serde(skip)]
    input_unit: String,
    #[serde(skip)]
    seen: String,
    /// Command that diagnoses the model.
    #[serde(skip)]
    next: Option<String>,
}

/// Interpolation of the drive between samples.
#[derive(Debug, Serialize)]
struct BetweenSummary {
    taken: BetweenSamples,
    /// RMSE of each interpolation that was tried; empty if none was compared.
    tried: Vec<TriedBetween>,
}

#[derive(Debug, Serialize)]
struct TriedBetween {
    between_samples: BetweenSamples,
    rmse: f64,
}

/// Searches with different random draws.
#[derive(Debug, Serialize)]
struct TrialsSummary {
    count: usize,
    costs: Option<Spread>,
    stopped: Vec<Stopped>,
}

/// Main numbers of the hysteresis.
#[derive(Debug, Serialize)]
#[serde(untagged)]
enum BaseSummary {
    /// Prandtl-Ishlinskii: `p0` is the gain of the part without hysteresis.
    Pi { p0: f64, plays: usize, plays_with_weight: usize },
    /// Cells of the Preisach triangle.
    Preisach { cells: usize, cells_with_density: usize },
}

/// Runs the command.
pub(super) fn run(args: &FitArgs) -> CommandResult {
    let read: Vec<&Path> = args.train.iter().map(AsRef::as_ref).collect();
    let written: Vec<_> = [&args.output].into_iter().chain(&args.trace).chain(&args.picture).collect();
    output::check(&read, &written)?;
    args.picture.as_ref().map(Format::of).transpose()?;
    let report = Report::new(args.json.json, &written)?;
    let record = input::training(&args.train, &args.map)?;
    let zero = args.zero.get();

    let options = args.search.options(zero == Zero::PerRecord)?;
    options.suits(args.model)?;
    let doing = format!("fitting {} to {}", args.model, text::count(record.rows(), "row"));
    let progress = Progress::spinner(&doing);
    let Identified { fit, surface, dynamics } = identify(args, &record, &options, &|done, budget| {
        progress.set_message(&format!("{doing}: {done} of at most {budget} evaluations"));
    })?;
    convergence::check(args, &fit)?;
    let Fit { model, how, estimate, tables, trials, evaluations, between_samples } = fit;
    let tried = |(between_samples, rmse)| TriedBetween { between_samples, rmse };
    let simulated = simulate(&model, &record, zero)?;
    drop(progress);

    args.output.write(|out| out.write_all(model.to_json().as_bytes()))?;
    if let Some(trials) = &trials {
        let polished = estimate.as_ref().map(|e| e.left);
        convergence::write(args, trials, polished, text::symbol(&model.output.unit))?;
    }
    let notes = surface::notes(surface.as_ref(), dynamics.as_ref(), &model);
    notes.iter().for_each(|note| output::say(note));
    if args.model == Kind::Preisach && args.from.is_none() && shows_only_curves(&record) {
        output::say(
            "note: this record has only first-order descent curves; --from fod measures the Everett surface directly",
        );
    }
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
        falls: model.falls,
        how,
        between_samples: BetweenSummary {
            taken: model.between_samples,
            tried: between_samples.into_iter().map(tried).collect(),
        },
        seed: options.seed,
        evaluations,
        trials: trials.map(|t| TrialsSummary {
            count: t.found.len(),
            costs: t.costs(),
            stopped: t.found.iter().map(|f| f.stopped).collect(),
        }),
        estimate,
        tables,
        surface,
        dynamics,
        input_unit: model.input.unit.clone(),
        seen: seen(&record, &model),
        next: args.output.file().map(|path| {
            let reading = further(&input::reading(&args.map, &args.zero));
            format!("hystctl diagnose {}{reading} --model {}", files(&record), quoted(&path.display().to_string()))
        }),
    };
    report.print(&summary.text(), &summary)
}

/// A fitted model with the reports of its identification.
struct Identified {
    fit: Fit,
    surface: Option<FodReport>,
    dynamics: Option<DpmReport>,
}

/// Identifies the model; `report` receives the number of evaluations so far and its maximum.
fn identify(
    args: &FitArgs,
    record: &Record,
    options: &FitOptions,
    report: &dyn Fn(u64, u64),
) -> CommandResult<Identified> {
    let fod = args.from == Some(FitFrom::Fod);
    if fod && args.model != Kind::Preisach {
        let message = format!(
            "--from fod does not apply to {}; give --model preisach (dpm detects descent curves without this option)",
            args.model
        );
        return Err(CommandError::bad_input(message));
    }
    if args.as_measured && !fod {
        return Err(CommandError::bad_input("--as-measured needs a measured surface; add --from fod"));
    }
    if fod && !options.convex() {
        return Err(CommandError::bad_input("--from fod measures the surface without a search; leave --optimizer out"));
    }
    if fod {
        let options = FodOptions { as_measured: args.as_measured, seed: options.seed, cells: None };
        let found = fit_fod(record, &options)?;
        let fit = Fit::at_once(found.model, "a surface measured from first-order descent curves");
        return Ok(Identified { fit, surface: Some(found.report), dynamics: None });
    }
    if args.model == Kind::Dpm && options.convex() {
        let found = fit_dpm(record, options)?;
        let dynamics = Some(found.report.clone());
        return Ok(Identified { fit: found.into(), surface: None, dynamics });
    }
    let fit = fit_with(record, args.model, options, &mut |p| {
        report(p.evaluations, p.budget);
        hosted::going()
    })?;
    Ok(Identified { fit, surface: None, dynamics: None })
}

/// Describes the record in a line, in which a wrong unit is visible.
fn seen(record: &Record, model: &Model) -> String {
    let (time, periods) = (record.time(), record.sample_periods());
    let active: f64 = record.segments().iter().zip(&periods).map(|(rows, period)| rows.len() as f64 * period).sum();
    let rates = range(periods.iter().map(|period| 1.0 / period));
    let rates = if rates.0 < rates.1 {
        format!("{} to {}", text::short(rates.0), text::short(rates.1))
    } else {
        text::short(rates.0)
    };
    let lab = time.last().copied().unwrap_or_default() - time.first().copied().unwrap_or_default();
    format!(
        "record: {}, {rates} Hz, {} s of drive in {} s; input {} to {} {}, output {} to {} {}",
        text::count(record.segments().len(), "segment"),
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
            "{} fitted to {} (start-up rows: {}): {}",
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
                    "linear gain p0 {} {unit}/{}, {plays_with_weight} of {plays} play operators with a weight",
                    text::short(*p0),
                    self.input_unit
                )
            }
            BaseSummary::Preisach { cells, cells_with_density } => {
                format!("{cells_with_density} of {cells} cells with a density")
            }
        }));
        lines.extend(self.surface.as_ref().map(|s| surface::measured(s, unit)));
        lines.extend(self.dynamics.as_ref().map(|d| surface::dynamics(d, unit, &self.input_unit)));
        lines.push(format!("sensor zero {} {unit}", text::short(self.sensor_zero)));
        if self.falls {
            lines.push("negative gain: the output falls while the input rises".to_owned());
        }
        lines.push(self.how.clone());
        lines.extend(self.between_samples.text(unit));
        if let Some(TrialsSummary { count, costs: Some(costs), .. }) = self.trials.as_ref().filter(|t| t.count > 1) {
            lines.push(format!(
                "{count} trials: RMS residual from {} to {}, median {} {unit}",
                text::short(costs.lowest),
                text::short(costs.highest),
                text::short(costs.median)
            ));
        }
        // The explanation comes first, so that an undetermined weight does not alarm.
        if let Some(parts) = match &self.base {
            Some(BaseSummary::Pi { .. }) => Some("play operators"),
            Some(BaseSummary::Preisach { .. }) => Some("cells"),
            None => None,
        } {
            lines.push(format!(
                "neighbouring {parts} can replace each other: one that the record does not determine does not impair \
                 predictions within the range of the record"
            ));
        }
        lines.extend(self.estimate.as_ref().map(parameters));
        lines.extend(self.tables.iter().map(text::known));
        lines.extend(self.next.iter().map(|command| format!("next, find missing effects: {command}")));
        lines.join("\n")
    }
}

impl BetweenSummary {
    /// Returns a line about the interpolations that were compared, if there were any.
    fn text(&self, unit: &str) -> Option<String> {
        let tried = |t: &TriedBetween| format!("{} RMSE {} {unit}", t.between_samples, text::short(t.rmse));
        let tried: Vec<String> = self.tried.iter().map(tried).collect();
        (!tried.is_empty()).then(|| format!("drive between samples: {}; taken: {}", tried.join(", "), self.taken))
    }
}

/// Returns the parameters with their standard errors, and what the record does not determine.
fn parameters(estimate: &Estimate) -> String {
    let mut lines = Vec::new();
    let width = estimate.parameters.iter().map(|p| p.name.len()).max().unwrap_or(0);
    for p in &estimate.parameters {
        let what = match p.determined {
            Determined::Yes => "",
            Determined::NearZero => "  (zero within its error)",
            Determined::Together => "  (determined only together with others)",
            Determined::No => "  (not determined by this record)",
        };
        lines.push(format!("  {:width$}  {} ± {}{what}", p.name, text::short(p.value), text::short(p.std_error)));
    }
    if !estimate.held.is_empty() {
        lines.push(format!("  at a bound: {}", text::listed(&estimate.held)));
    }
    for TradeOff { changes, std_error } in estimate.trade_offs.iter().take(3) {
        let part = |(name, share): &(String, f64)| format!("{name} {share:+.2}");
        lines.push(format!(
            "  undetermined to {}: the joint change {} hardly changes the prediction",
            text::percent(100.0 * std_error),
            changes.iter().map(part).collect::<Vec<_>>().join(", ")
        ));
    }
    lines.join("\n")
}
