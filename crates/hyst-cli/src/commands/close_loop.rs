//! `close-loop`: repeats experiment, diagnosis, extension and compensation on a simulated plant.

use std::fs;
use std::path::{Path, PathBuf};

use hyst_hw::Daq;
use hyst_ident::atomic_file::write_atomic;
use hyst_ident::diagnose::{DiagnoseOptions, FOLLOWED, Findings, RemainderKind, diagnose_until};
use hyst_ident::experiment::Question;
use hyst_ident::fit::{FitOptions, fit};
use hyst_ident::metrics::Errors;
use hyst_ident::model::{Kind, Model};
use hyst_ident::record::Record;
use hyst_ident::simulate::{Zero, simulate};
use serde::Serialize;

use crate::cli::CloseLoopArgs;
use crate::device::{AnyDevice, DeviceOptions};
use crate::exit::{CommandError, CommandResult};
use crate::hosted;
use crate::output::{self, Report};
use crate::progress::Progress;
use crate::text;
use crate::tracking::{Files, Run, Task};
use plan::{Experiment, Plan};

mod plan;

/// Minimum sample rate of chosen experiments \[Hz\].
/// A lower rate cannot separate the typical dynamics of actuators.
const MIN_RATE_HZ: f64 = 20.0;

/// One turn.
#[derive(Debug, Serialize)]
struct Turn {
    turn: u32,
    /// The drive and its purpose.
    experiment: Experiment,
    /// Kind of the base model.
    base: Kind,
    /// Errors of the previous turn's model on this turn's record, which it was not fitted to.
    before: Option<Errors>,
    /// Effects named in this turn.
    found: Vec<String>,
    remainder: RemainderKind,
    /// Slope above which the amplifier did not follow the drive \[V/s\].
    /// The drives of later turns stay below.
    slew_limit: Option<f64>,
    /// Description of the remainder.
    left: String,
    /// Undecided questions if experiments are chosen; empty if all are decided.
    #[serde(skip_serializing_if = "Option::is_none")]
    open: Option<Vec<Question>>,
    /// Tracking errors; with chosen experiments only in the last turn.
    #[serde(flatten)]
    tracking: Option<Tracking>,
}

/// Errors of the followed reference.
#[derive(Clone, Copy, Debug, Serialize)]
struct Tracking {
    /// RMS error without drift and interference of the sensor \[output unit\].
    tracking_rmse: f64,
    tracking_max_abs: f64,
    /// RMS error with drift and interference of the sensor \[output unit\].
    tracking_shown_rmse: f64,
}

/// Report of all turns.
#[derive(Debug, Serialize)]
struct Summary {
    unit: String,
    /// RMS tracking error of the same reference with a plain gain \[output unit\].
    plain_gain_rmse: f64,
    /// RMS tracking error with the inverse of the base model \[output unit\].
    base_inverse_rmse: f64,
    turns: Vec<Turn>,
    /// Time of all experiments \[s\].
    seconds: f64,
    /// Reason for the end.
    ended: String,
    folder: PathBuf,
}

/// Runs the command.
pub(super) fn run(args: &CloseLoopArgs) -> CommandResult {
    let out = &args.out;
    if fs::read_dir(out).is_ok_and(|mut files| files.next().is_some()) {
        let message = format!("{}: the folder is not empty; give another one with --out", out.display());
        return Err(CommandError::bad_input(message));
    }
    if args.daq.file().is_none() {
        return Err(CommandError::bad_input(
            "close-loop runs only simulated plants (sim:PLANT.toml), because a real actuator that moves for minutes needs \
             supervision; use excite, run, fit and diagnose in turn, with --limit and --slew",
        ));
    }
    if args.until.is_some() && args.rate < MIN_RATE_HZ {
        return Err(CommandError::bad_input(format!(
            "--rate: --until needs a sample rate of at least {MIN_RATE_HZ} Hz"
        )));
    }
    let mut device = AnyDevice::open(&args.daq, &DeviceOptions::default())?;
    fs::create_dir_all(out)
        .map_err(|e| CommandError::failed(format!("{}: {e}; choose another folder with --out", out.display())))?;
    let report = Report::new(args.json.json, &[])?;
    let progress = Progress::spinner("starting");
    let summary = turns(&mut device, args, &progress)?;
    drop(progress);
    write(out, "summary.json", &output::json(&summary)?)?;
    report.print(&report_text(&summary), &summary)
}

fn turns<D: Daq>(daq: &mut D, args: &CloseLoopArgs, progress: &Progress) -> CommandResult<Summary> {
    let out = &args.out;
    let file = |name: &str, turn: u32, ending: &str| out.join(format!("{name}-{turn}.{ending}"));
    let most = args.turns.unwrap_or(if args.until.is_some() { 12 } else { 4 });
    let (mut records, mut model): (Vec<Record>, Option<Model>) = (Vec::new(), None);
    let mut list: Vec<Turn> = Vec::new();
    let mut kind = args.model;
    let mut unit = None;
    let mut plan = Plan::new(args, daq);
    // Tracking errors with a plain gain and with the inverse of the base model, after the first tracking.
    let mut without_effects = None;
    let mut ended = format!("all {most} turns are finished; give more with --turns");
    for turn in 1..=most {
        progress.set_message(&format!("turn {turn}: experiment"));
        let (experiment, record) = plan.play(daq, turn)?;
        let mut csv = Vec::new();
        record.write_csv(&mut csv).map_err(output::io_error)?;
        write_atomic(file("train", turn, "csv"), |f| f.write_all(&csv))?;
        let record = record.kept_as(&csv);
        unit = record.output_unit();
        let before = model.as_ref().map(|m| simulate(m, &record, Zero::None)).transpose()?.and_then(|s| s.errors);
        records.push(record);
        let train = Record::join(records.clone())?;
        let report = |what: &str| progress.set_message(&format!("turn {turn}: {what}"));
        let fitted = |kind: Kind| {
            report("fit");
            fit(&train, kind, &FitOptions { seed: args.seed, ..FitOptions::default() })
        };
        let options = DiagnoseOptions { zero: Zero::None, seed: args.seed };
        let diagnosed = |start: &Model| diagnose_until(&train, None, start, &options, &report, &hosted::stopping());
        // With chosen experiments the model is fitted again to all records, so that each probability uses all data.
        let mut start = match model.take().filter(|m| m.base.kind() == kind && args.until.is_none()) {
            Some(model) => model,
            None => fitted(kind)?,
        };
        let mut found = diagnosed(&start)?;
        if args.until.is_some() && is_too_coarse(&found.findings, kind) {
            // A finer base model needs no new experiment.
            kind = Kind::Preisach;
            start = fitted(kind)?;
            found = diagnosed(&start)?;
        }
        let name = |path: PathBuf| path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        write(out, &name(file("model", turn, "json")), &found.extended.to_json())?;
        write(out, &name(file("findings", turn, "json")), &output::json(&found.findings)?)?;
        let names: Vec<String> = found.findings.effects.iter().map(|e| e.name.to_string()).collect();
        let remainder = &found.findings.remainder;
        let too_coarse = is_too_coarse(&found.findings, kind);
        let is_slow = remainder.slew_limit.is_some();
        // Records that the amplifier did not follow decide nothing.
        let (open, why) = match args.until {
            Some(_) if !is_slow => plan.next(&found.findings, &train)?,
            _ => (Vec::new(), None),
        };
        let ends = why.or_else(|| {
            let done = args.until.is_none() && names.is_empty() && !(is_slow || too_coarse);
            done.then(|| "no further effect is found".to_owned())
        });
        let tracking = if args.until.is_none() || ends.is_some() || turn == most {
            progress.set_message(&format!("turn {turn}: following a reference"));
            let task = Task::of(&found.extended, &train, args.rate);
            if without_effects.is_none() {
                let plain = task.judge(&task.by_gain(daq, &train, &start)?, &found.extended).rmse;
                let base_alone = task.judge(&task.through(daq, &start, None)?, &found.extended).rmse;
                without_effects = Some((plain, base_alone));
            }
            let files = Files { log: &file("run", turn, "mcap"), drive: &file("drive", turn, "csv") };
            let Run { rmse, max_abs, shown_rmse, .. } =
                task.judge(&task.through(daq, &found.extended, Some(&files))?, &found.extended);
            Some(Tracking { tracking_rmse: rmse, tracking_max_abs: max_abs, tracking_shown_rmse: shown_rmse })
        } else {
            None
        };
        list.push(Turn {
            turn,
            experiment,
            base: kind,
            before,
            found: names,
            remainder: remainder.kind,
            slew_limit: remainder.slew_limit,
            left: remainder.description.clone(),
            open: args.until.map(|_| open),
            tracking,
        });
        if let Some(why) = ends {
            ended = why;
            break;
        }
        if let Some(limit) = remainder.slew_limit {
            // Records that the amplifier did not follow are useless for the actuator: measure again with a lower slope.
            plan.stay_below(FOLLOWED * limit);
            records.clear();
            continue;
        }
        if too_coarse {
            // The remainder is hysteresis: fit a finer base model in the next turn and search the effects again.
            kind = Kind::Preisach;
        }
        model = Some(found.extended);
    }
    let (plain, base_alone) = without_effects.unwrap_or((f64::NAN, f64::NAN));
    Ok(Summary {
        unit: unit.map_or("", |u| u.suffix()).to_owned(),
        plain_gain_rmse: plain,
        base_inverse_rmse: base_alone,
        turns: list,
        seconds: plan.spent(),
        ended,
        folder: out.clone(),
    })
}

/// Whether the remainder is hysteresis that a finer base model describes.
fn is_too_coarse(findings: &Findings, kind: Kind) -> bool {
    findings.remainder.kind == RemainderKind::BaseCapacity && kind == Kind::Pi
}

fn write(folder: &Path, name: &str, content: &str) -> CommandResult {
    Ok(write_atomic(folder.join(name), |out| out.write_all(content.as_bytes()))?)
}

fn report_text(summary: &Summary) -> String {
    let unit = text::symbol(&summary.unit);
    let head =
        ["turn", "base", "found", &format!("RMS on a new record [{unit}]"), &format!("tracking RMS [{unit}]"), "max"];
    let mut rows = vec![head.map(ToOwned::to_owned).to_vec()];
    let blank = |first: &str, rmse: f64| {
        let cells = [first, "", "", "", &text::short(rmse), ""];
        cells.map(ToOwned::to_owned).to_vec()
    };
    rows.push(blank("plain gain", summary.plain_gain_rmse));
    rows.push(blank("base inverse", summary.base_inverse_rmse));
    let chosen = summary.turns.iter().any(|t| t.experiment.why.is_some());
    for t in &summary.turns {
        let slow = t.slew_limit.map(|_| "slow amplifier");
        let found: Vec<&str> = t.found.iter().map(String::as_str).chain(slow).collect();
        rows.push(vec![
            t.turn.to_string(),
            t.base.name().to_owned(),
            if found.is_empty() { "nothing".to_owned() } else { text::listed(&found) },
            t.before.map_or_else(String::new, |e| text::short(e.rmse)),
            t.tracking.map_or_else(String::new, |t| text::short(t.tracking_rmse)),
            t.tracking.map_or_else(String::new, |t| text::short(t.tracking_max_abs)),
        ]);
    }
    let remainder = summary.turns.last().map_or("", |t| t.left.as_str());
    let last = summary.turns.last().and_then(|t| t.tracking);
    let shown = last.filter(|t| (t.tracking_shown_rmse / t.tracking_rmse - 1.0).abs() > 0.01);
    let sensor = shown.map_or_else(String::new, |t| {
        let rmse = text::short(t.tracking_shown_rmse);
        format!("with drift and interference of the sensor the last tracking error is {rmse} {unit} RMS\n")
    });
    let experiments: String = summary
        .turns
        .iter()
        .filter_map(|t| {
            let Experiment { drive, seconds, why } = &t.experiment;
            Some(format!("experiment {}: {drive}, {} s, to decide: {}\n", t.turn, text::short(*seconds), why.as_ref()?))
        })
        .collect();
    let time = if chosen { format!("experiments: {} s\n", text::short(summary.seconds)) } else { String::new() };
    format!(
        "{}\n{experiments}{time}{sensor}ended: {}\nremainder: {remainder}\nwritten: {}",
        text::table(&rows),
        summary.ended,
        summary.folder.display()
    )
}
