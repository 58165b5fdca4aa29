//! `close-loop`: measure, find what the model lacks, add it, compensate, measure again.

use std::fs;
use std::path::{Path, PathBuf};

use hyst_hw::{Daq, RecordOptions};
use hyst_ident::atomic_file::write_atomic;
use hyst_ident::diagnose::{DiagnoseOptions, FOLLOWED, RemainderKind, diagnose_until};
use hyst_ident::excite::{Drive, Identification, Limits};
use hyst_ident::fit::{FitOptions, fit};
use hyst_ident::metrics::Errors;
use hyst_ident::model::{Kind, Model};
use hyst_ident::record::Record;
use hyst_ident::simulate::{Zero, simulate};
use serde::Serialize;

use crate::cli::CloseLoopArgs;
use crate::device::{AnyDevice, Wishes};
use crate::exit::{CommandError, CommandResult, Exit};
use crate::host;
use crate::output::{self, Report};
use crate::progress::Progress;
use crate::tracking::{Files, Run, Task};
use crate::{recording, text};

/// One turn.
#[derive(Debug, Serialize)]
struct Turn {
    turn: u32,
    /// Kind of the base.
    base: Kind,
    /// Errors of the model of the turn before on this turn's record, which it has not seen.
    before: Option<Errors>,
    /// Effects that were found in this turn.
    found: Vec<String>,
    remainder: RemainderKind,
    /// Slope from which on the drive was not followed \[V/s\]; the next turn's stays below.
    slew_limit: Option<f64>,
    /// What is left, in words.
    left: String,
    /// Error of the followed reference \[output unit\].
    tracking_rmse: f64,
    tracking_max_abs: f64,
    /// The same of what the sensor showed: drift and tone that were found in it are not taken out.
    tracking_shown_rmse: f64,
}

/// What came of it.
#[derive(Debug, Serialize)]
struct Summary {
    unit: String,
    /// Error of the same reference by a plain gain \[output unit\].
    plain_gain_rmse: f64,
    /// By the inverse of the base model alone.
    base_inverse_rmse: f64,
    turns: Vec<Turn>,
    /// Why it ended.
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
            "close-loop runs simulated plants alone (sim:PLANT.toml): an actuator that moves for minutes wants somebody beside it; go the same way with excite, run, fit, diagnose and run again, with --limit and --slew",
        ));
    }
    let mut device = AnyDevice::open(&args.daq, &Wishes::default())?;
    fs::create_dir_all(out)
        .map_err(|e| CommandError::failed(format!("{}: {e}; choose another folder with --out", out.display())))?;
    let report = Report::new(args.json.json, &[])?;
    let progress = Progress::spinner("closing the loop");
    let summary = turns(&mut device, args, &progress)?;
    drop(progress);
    write(out, "summary.json", &output::json(&summary)?)?;
    report.print(&said(&summary), &summary)
}

fn turns<D: Daq>(daq: &mut D, args: &CloseLoopArgs, progress: &Progress) -> CommandResult<Summary> {
    let out = &args.out;
    let file = |name: &str, turn: u32, ending: &str| out.join(format!("{name}-{turn}.{ending}"));
    let (mut records, mut model): (Vec<Record>, Option<Model>) = (Vec::new(), None);
    let mut list: Vec<Turn> = Vec::new();
    let mut kind = args.model;
    let (mut slew, mut unit) = (None, None);
    let (mut plain, mut base_alone) = (f64::NAN, f64::NAN);
    let mut ended = format!("all {} turns are done; give more with --turns", args.turns);
    for turn in 1..=args.turns {
        progress.say(&format!("turn {turn}: experiment"));
        let record = experiment(daq, args, turn, slew)?;
        let mut csv = Vec::new();
        record.write_csv(&mut csv).map_err(output::io_error)?;
        write_atomic(file("train", turn, "csv"), |f| f.write_all(&csv))?;
        let record = record.kept_as(&csv);
        unit = record.output_unit();
        let before = model.as_ref().map(|m| simulate(m, &record, Zero::None)).transpose()?.and_then(|s| s.errors);
        records.push(record);
        let train = Record::join(records.clone())?;
        progress.say(&format!("turn {turn}: fit"));
        let options = FitOptions { seed: args.seed, ..FitOptions::default() };
        let start = match model.take().filter(|m| m.base.kind() == kind) {
            Some(model) => model,
            None => fit(&train, kind, &options)?,
        };
        let told = |what: &str| progress.say(&format!("turn {turn}: {what}"));
        let options = DiagnoseOptions { zero: Zero::None, seed: args.seed };
        let found = diagnose_until(&train, None, &start, &options, &told, &host::stopping())?;
        progress.say(&format!("turn {turn}: following a reference"));
        let task = Task::of(&found.extended, &train, args.rate);
        if turn == 1 {
            plain = task.judge(&task.by_gain(daq, &train, &start)?, &found.extended).rmse;
            base_alone = task.judge(&task.through(daq, &start, None)?, &found.extended).rmse;
        }
        let files = Files { log: &file("run", turn, "mcap"), drive: &file("drive", turn, "csv") };
        let Run { rmse, max_abs, shown_rmse, .. } =
            task.judge(&task.through(daq, &found.extended, Some(&files))?, &found.extended);
        let name = |path: PathBuf| path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        write(out, &name(file("model", turn, "json")), &found.extended.to_json())?;
        write(out, &name(file("findings", turn, "json")), &output::json(&found.findings)?)?;
        let names: Vec<String> = found.findings.effects.iter().map(|e| e.name.to_string()).collect();
        let remainder = &found.findings.remainder;
        let too_coarse = remainder.kind == RemainderKind::BaseCapacity && kind == Kind::Pi;
        let nothing_new = names.is_empty();
        list.push(Turn {
            turn,
            base: kind,
            before,
            found: names,
            remainder: remainder.kind,
            slew_limit: remainder.slew_limit,
            left: remainder.description.clone(),
            tracking_rmse: rmse,
            tracking_max_abs: max_abs,
            tracking_shown_rmse: shown_rmse,
        });
        if let Some(limit) = remainder.slew_limit {
            // What the amplifier has not followed says little of the actuator: all is measured anew, less steeply.
            slew = Some(FOLLOWED * limit);
            records.clear();
            continue;
        }
        if too_coarse {
            // What is left is a map of the input's history: a richer one is fitted, and the effects are looked for anew on it.
            kind = Kind::Preisach;
        } else if nothing_new {
            ended = "nothing more is found".to_owned();
            break;
        }
        model = Some(found.extended);
    }
    Ok(Summary {
        unit: unit.map_or("", |u| u.suffix()).to_owned(),
        plain_gain_rmse: plain,
        base_inverse_rmse: base_alone,
        turns: list,
        ended,
        folder: out.clone(),
    })
}

/// Plays the identification drive of a turn over the device's range, no steeper than `slew` \[V/s\].
fn experiment<D: Daq>(daq: &mut D, args: &CloseLoopArgs, turn: u32, slew: Option<f64>) -> CommandResult<Record> {
    let range = daq.capabilities().voltage;
    let limits = Limits { rate_hz: args.rate, lo_v: range.min_v, hi_v: range.max_v, slew_v_per_s: slew };
    let seed = args.seed.wrapping_add(u64::from(turn) << 32);
    let drive: Drive = Identification::at_rate(args.rate, seed).within_slew(&limits, &|_| true).drive(&limits)?;
    let segments: Vec<&[f64]> = drive.segments().iter().map(|rows| &drive.voltage()[rows.clone()]).collect();
    let recording = hyst_hw::record(daq, &segments, &RecordOptions::at(args.rate), |_| host::going())
        .map_err(|failure| CommandError::new(Exit::DeviceLost, anyhow::anyhow!("{failure}")))?;
    recording::to_record(&recording, &format!("train-{turn}.csv"), recording::unit(daq.capabilities().output))
}

fn write(folder: &Path, name: &str, content: &str) -> CommandResult {
    Ok(write_atomic(folder.join(name), |out| out.write_all(content.as_bytes()))?)
}

fn said(summary: &Summary) -> String {
    let unit = text::symbol(&summary.unit);
    let head =
        ["turn", "base", "found", &format!("on a new record [{unit}]"), &format!("tracking RMS [{unit}]"), "max"];
    let mut rows = vec![head.map(ToOwned::to_owned).to_vec()];
    let blank = |first: &str, rmse: f64| {
        let cells = [first, "", "", "", &text::short(rmse), ""];
        cells.map(ToOwned::to_owned).to_vec()
    };
    rows.push(blank("plain gain", summary.plain_gain_rmse));
    rows.push(blank("base inverse", summary.base_inverse_rmse));
    for t in &summary.turns {
        let slow = t.slew_limit.map(|_| "a slow amplifier");
        let found: Vec<&str> = t.found.iter().map(String::as_str).chain(slow).collect();
        rows.push(vec![
            t.turn.to_string(),
            t.base.name().to_owned(),
            if found.is_empty() { "nothing".to_owned() } else { text::listed(&found) },
            t.before.map_or_else(String::new, |e| text::short(e.rmse)),
            text::short(t.tracking_rmse),
            text::short(t.tracking_max_abs),
        ]);
    }
    let left = summary.turns.last().map_or("", |t| t.left.as_str());
    let shown = summary.turns.last().filter(|t| (t.tracking_shown_rmse / t.tracking_rmse - 1.0).abs() > 0.01);
    let sensor = shown.map_or_else(String::new, |t| {
        let rmse = text::short(t.tracking_shown_rmse);
        format!("in the sensor: the last error is {rmse} {unit} with the drift and the tone that were found in it\n")
    });
    format!(
        "{}\n{sensor}ended: {}\nleft: {left}\nwritten: {}",
        text::table(&rows),
        summary.ended,
        summary.folder.display()
    )
}
