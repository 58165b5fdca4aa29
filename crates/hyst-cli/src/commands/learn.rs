//! `learn`: improves the drive of a repeated reference pass by pass.

mod passes;
mod summary;

use std::fs;
use std::path::{Path, PathBuf};

use hyst_hw::Daq;
use hyst_ident::diagnose::{DiagnoseOptions, Diagnosis, diagnose_until};
use hyst_ident::learn::{Ended, LearnOptions, Learner, Pass};
use hyst_ident::model::Model;
use hyst_ident::record::Record;
use hyst_ident::simulate::Zero;

use super::run::followed::Followed;
use super::run::interrupt;
use super::run::job::Job;
use crate::cli::LearnArgs;
use crate::device::{AnyDevice, DeviceOptions};
use crate::exit::{CommandError, CommandResult};
use crate::output::{self, Report, Target, say};
use crate::progress::Progress;
use crate::{recording, text};
use passes::{Passes, write_drive};
use summary::{Found, Summary};

/// Runs the command.
pub(super) fn run(args: &LearnArgs) -> CommandResult {
    let written: Vec<&Target> = std::iter::once(&args.output).chain(&args.extended).collect();
    let read: Vec<&Path> =
        args.daq.file().into_iter().chain([args.model.as_path(), args.reference.as_path()]).collect();
    output::check(&read, &written)?;
    if let Some(folder) = &args.logs
        && fs::read_dir(folder).is_ok_and(|mut files| files.next().is_some())
    {
        let message = format!("{}: the folder is not empty; give another one with --logs", folder.display());
        return Err(CommandError::bad_input(message));
    }
    let report = Report::new(args.json.json, &written)?;
    let device_options = DeviceOptions {
        noise: args.seed,
        voltage: args.limits.limit.map(|limit| (limit.low, limit.high)),
        slew_v_per_s: args.limits.slew,
        force: false,
        silence_s: args.silence,
        hottest_degc: args.hottest,
        error: args.max_error,
    };
    let mut device = AnyDevice::open(&args.daq, &device_options)?;
    let mut job = Job::read(&args.to_run(), device.capabilities())?;
    let Some(followed) = job.followed.as_mut() else {
        return Err(CommandError::bad_input("give --model and --reference"));
    };
    // All plays of a pass have the same drive: a change of temperature does not repeat and is not corrected.
    if followed.live.take().is_some()
        && let (None, Some(degc)) = (args.temperature.degc, followed.options.temperature)
    {
        say(&format!(
            "note: the first drive is planned for {} °C, the reference temperature of the model; give the present temperature \
             with --temperature",
            text::short(degc)
        ));
    }
    job.log_option = "--logs";
    let Some(Followed { model, json, reference, options, .. }) = &job.followed else {
        return Err(CommandError::bad_input("give --model and --reference"));
    };
    let (model, json) = (model.clone(), json.clone());
    let options = LearnOptions { compensate: *options, passes: args.passes as usize, ..LearnOptions::default() };
    let learner = Learner::new(&model, reference, options).map_err(CommandError::bad_input)?;
    if let Some(predicted) = job.predicted_error() {
        say(&format!("note: {predicted}"));
    }
    if let Some(folder) = &args.logs {
        fs::create_dir_all(folder).map_err(|e| {
            CommandError::failed(format!("{}: {e}; choose another folder with --logs", folder.display()))
        })?;
    }
    if args.clear {
        super::run::clear(&mut device)?;
    }
    let mut passes = Passes { device, job, args, json: &json, model: &model, records: Vec::new(), rate_hz: 0.0 };
    let (learner, ended) = passes.all(learner)?;
    let Passes { device, records, rate_hz, job, .. } = passes;
    let summary = finish(args, &model, &learner, ended, &records, (device.capabilities(), rate_hz), &job)?;
    report.print(&summary.text(), &summary)
}

/// Writes the drive, diagnoses the error of the model, and returns the report.
fn finish(
    args: &LearnArgs,
    model: &Model,
    learner: &Learner<'_>,
    ended: Ended,
    records: &[Record],
    (device, rate_hz): (&hyst_hw::Capabilities, f64),
    job: &Job,
) -> CommandResult<Summary> {
    let passes: Vec<Pass> = learner.passes().collect();
    let (Some((best, pass, drive)), Some(first), Some(last)) = (learner.best(), passes.first(), passes.last()) else {
        return Err(CommandError::failed("no pass was played"));
    };
    write_drive(&args.output, model, learner, drive)?;
    let correction = learner.correction();
    let found = diagnosed(args, model, records)?;
    let names_any = found.as_ref().is_some_and(|found| !found.findings.effects.is_empty());
    let extended = match (&args.extended, &found) {
        (Some(target), Some(found)) if names_any => {
            target.write(|out| out.write_all(found.extended.to_json().as_bytes()))?;
            Some(target.to_string())
        }
        (Some(target), found) => {
            let why = if found.is_some() { ": the passes show no missing effect" } else { "" };
            say(&format!("note: {target} is not written{why}"));
            None
        }
        _ => None,
    };
    let unit = recording::unit(device.output);
    let named = |found: Diagnosis| -> Vec<Found> {
        let effects = found.findings.effects.iter();
        effects.map(|e| Found { effect: e.name.name(), probability: e.probability }).collect()
    };
    Ok(Summary {
        device: device.device.clone(),
        rate_hz,
        unit: unit.suffix(),
        plays: args.plays,
        best: best + 1,
        ended,
        repeatability_estimate: first.repeatability,
        repeatability: last.repeatability,
        improvement: first.rmse / pass.rmse.max(f64::MIN_POSITIVE),
        correction_rms: (correction.iter().map(|c| c * c).sum::<f64>() / correction.len().max(1) as f64).sqrt(),
        correction_max_abs: correction.iter().fold(0.0, |most, c| most.max(c.abs())),
        found: found.map(named),
        output: args.output.to_string(),
        logs: args.logs.as_ref().map(|folder: &PathBuf| folder.display().to_string()),
        extended,
        settle_s: job.options.settle_s,
        symbol: unit.symbol(),
        passes,
    })
}

/// Diagnoses the model on all passes together; `None` if that is not possible.
fn diagnosed(args: &LearnArgs, model: &Model, records: &[Record]) -> CommandResult<Option<Diagnosis>> {
    if records.is_empty() {
        return Ok(None);
    }
    let progress = Progress::spinner("diagnosing the model");
    let joined = Record::join(records.to_vec())?;
    let options = DiagnoseOptions { zero: Zero::PerRecord, seed: args.seed.unwrap_or(1) };
    let report = |what: &str| progress.set_message(&format!("diagnosing the model: {what}"));
    match diagnose_until(&joined, None, model, &options, &report, &interrupt::stopping()) {
        Ok(found) => Ok(Some(found)),
        Err(error) => {
            drop(progress);
            say(&format!("note: the error of the model cannot be diagnosed on these passes: {error}"));
            Ok(None)
        }
    }
}
