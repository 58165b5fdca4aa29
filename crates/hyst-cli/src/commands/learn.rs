//! `learn`: improves the drive of a repeated reference pass by pass.

use std::fs;
use std::path::{Path, PathBuf};

use hyst_hw::{Daq, Recording};
use hyst_ident::diagnose::{DiagnoseOptions, Diagnosis, diagnose_until};
use hyst_ident::learn::{Ended, LearnOptions, LearnedDrive, Learner, Pass};
use hyst_ident::model::Model;
use hyst_ident::record::{Extra, Record};
use hyst_ident::simulate::Zero;
use serde::Serialize;

use super::run::interrupt;
use super::run::job::{Followed, Job};
use super::run::play::{self, Played};
use crate::cli::LearnArgs;
use crate::device::{AnyDevice, DeviceOptions};
use crate::exit::{CommandError, CommandResult, Exit};
use crate::log::{LoggedModel, RunInfo, RunLog};
use crate::output::{self, Report, Target, say};
use crate::progress::Progress;
use crate::{recording, text};

/// Maximum number of repetitions of a pass in which the device did not receive a value in time.
const MAX_REPLAYS: u32 = 4;

/// A missing effect that the passes show.
#[derive(Debug, Serialize)]
struct Found {
    effect: &'static str,
    probability: f64,
}

/// Report of learning.
#[derive(Debug, Serialize)]
struct Summary {
    device: String,
    rate_hz: f64,
    unit: &'static str,
    plays: u32,
    passes: Vec<Pass>,
    /// The best pass, from 1.
    best: usize,
    ended: Ended,
    /// RMS of the difference between plays of one drive \[output unit\].
    /// Estimated after the first pass and after the last pass.
    repeatability_estimate: f64,
    repeatability: f64,
    /// RMS error of the first pass over that of the best pass.
    improvement: f64,
    /// RMS and maximum of the correction \[output unit\].
    /// The correction is the reference minus the model's prediction for the drive.
    correction_rms: f64,
    correction_max_abs: f64,
    /// Missing effects that explain the correction; `None` without a diagnosis.
    found: Option<Vec<Found>>,
    output: String,
    logs: Option<String>,
    /// File of the extended model, if it was written.
    extended: Option<String>,
    /// Hold time of the first value before each play \[s\].
    settle_s: f64,
    #[serde(skip)]
    symbol: &'static str,
}

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

/// Passes on a device.
struct Passes<'a> {
    device: AnyDevice,
    job: Job,
    args: &'a LearnArgs,
    model: &'a Model,
    json: &'a str,
    /// Records of the passes.
    records: Vec<Record>,
    rate_hz: f64,
}

impl<'a> Passes<'a> {
    /// Plays all passes. If an error ends them, the best drive so far is written.
    fn all(&mut self, mut learner: Learner<'a>) -> CommandResult<(Learner<'a>, Ended)> {
        let symbol = recording::unit(self.device.capabilities().output).symbol();
        let mut number = 0;
        loop {
            number += 1;
            let taken =
                self.plays(&learner, number).and_then(|plays| learner.take(&plays).map_err(CommandError::failed));
            let ended = match taken {
                Ok(ended) => ended,
                Err(error) => return Err(self.kept(&learner, error)),
            };
            if let Some(pass) = learner.passes().last() {
                let repeats = match pass.over_repeatability() {
                    Some(times) => format!(
                        "{} times the repeatability of {} {symbol}",
                        text::short(times),
                        text::short(pass.repeatability)
                    ),
                    None => "equal in all plays".to_owned(),
                };
                let limited = if pass.limited_rows == 0 {
                    String::new()
                } else {
                    format!("; the drive is at a limit in {}", text::count(pass.limited_rows, "row"))
                };
                say(&format!("pass {number}: RMSE {} {symbol}, {repeats}{limited}", text::short(pass.rmse)));
            }
            if let Some(ended) = ended {
                return Ok((learner, ended));
            }
            if interrupt::stopping().is_stopped() {
                let error = CommandError::failed("stopped on request; the device was ramped to rest");
                return Err(self.kept(&learner, error));
            }
        }
    }

    /// Writes the best drive so far and returns the error that ended the passes.
    fn kept(&self, learner: &Learner<'_>, error: CommandError) -> CommandError {
        let Some((best, pass, drive)) = learner.best() else { return error };
        let symbol = recording::unit(self.device.capabilities().output).symbol();
        let what = format!("the best drive so far (pass {}, RMSE {} {symbol})", best + 1, text::short(pass.rmse));
        say(&match write_drive(&self.args.output, self.model, learner, drive) {
            Ok(()) => format!("note: {what} is saved in {}", self.args.output),
            Err(error) => format!("warning: {what} could not be saved: {}", error.text()),
        });
        error
    }

    /// Plays one pass; returns the outputs of each play at the rows of the drive.
    ///
    /// A pass in which the device had to wait for its drive is repeated, because the delay may be a single one of this
    /// computer. If all repetitions have gaps, the line is too slow.
    fn plays(&mut self, learner: &Learner<'_>, number: usize) -> CommandResult<Vec<Vec<f64>>> {
        let name = self.args.logs.as_ref().map(|folder| folder.join(format!("pass-{number}.mcap")));
        let (mut recording, mut gaps) = self.played(learner, name.as_deref())?;
        for again in 1..=MAX_REPLAYS {
            if gaps == 0 {
                break;
            }
            let ending = if again == 1 { "again".to_owned() } else { format!("again-{again}") };
            let name = self.args.logs.as_ref().map(|folder| folder.join(format!("pass-{number}-{ending}.mcap")));
            say(&format!(
                "note: pass {number} is repeated: the device did not receive its next value in time and held the last one"
            ));
            (recording, gaps) = self.played(learner, name.as_deref())?;
        }
        if gaps > 0 {
            return Err(CommandError::failed(
                "the line is too slow for this sample rate: the device held old values; use a faster line or a reference \
                 with a lower sample rate",
            ));
        }
        self.rate_hz = recording.rate_hz;
        // The first play is left out, because it depends on earlier drives.
        recording.segments.drain(..recording.segments.len().min(1));
        let outputs = recording.segments.iter().map(|s| s.samples.iter().map(|s| s.output).collect()).collect();
        let unit = recording::unit(self.device.capabilities().output);
        let record = recording::to_record(&recording::split(recording), &format!("pass {number}"), unit)?;
        self.records.push(record);
        Ok(outputs)
    }

    /// Plays all plays of a pass, including the first one.
    /// Returns the recording and how often the device had to wait.
    fn played(&mut self, learner: &Learner<'_>, log: Option<&Path>) -> CommandResult<(Recording, usize)> {
        let plays = self.args.plays as usize;
        let unit = recording::unit(self.device.capabilities().output);
        self.job.segments = vec![learner.drive().voltage.clone(); plays + 1];
        let wanted: Vec<Option<f64>> =
            learner.reference().output().unwrap_or_default().iter().copied().map(Some).collect();
        self.job.wanted = wanted.repeat(plays + 1);
        let name = self.device.capabilities().device.clone();
        let info = RunInfo {
            device: &name,
            output: unit,
            sample_rate_hz: self.job.options.rate_hz,
            model: Some(LoggedModel { model: self.model, json: self.json }),
        };
        let mut log = log
            .map(|path| RunLog::create(path, &info).map_err(|error| CommandError::new(Exit::Failed, error)))
            .transpose()?;
        self.device.gentle(self.job.steepest());
        let played = play::play(&mut self.device, &mut self.job, log.as_mut());
        let closed = log.filter(|log| log.samples() > 0).map_or(Ok(()), RunLog::finish);
        let Played { recording, gaps, error, .. } = played?;
        if let Some(error) = error {
            return Err(error);
        }
        closed?;
        Ok((recording, gaps.times))
    }
}

/// Writes a drive with its reference; an existing file is renamed.
fn write_drive(to: &Target, model: &Model, learner: &Learner<'_>, drive: &LearnedDrive) -> CommandResult {
    let extra = [Extra::numbers(&model.input.column, &drive.voltage)];
    to.write_measured(|out| learner.reference().write_with(out, &extra).map_err(output::io_error))
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

impl Summary {
    fn text(&self) -> String {
        let (short, unit) = (text::short, self.symbol);
        let mut rows = vec![
            ["pass", &format!("RMSE [{unit}]"), "maximum", "repeating part", "RMSE / repeatability"]
                .map(str::to_owned)
                .to_vec(),
        ];
        rows.extend(self.passes.iter().zip(1..).map(|(pass, number)| {
            let mark = if number == self.best { " best" } else { "" };
            vec![
                format!("{number}{mark}"),
                short(pass.rmse),
                short(pass.max_abs),
                short(pass.repeating),
                pass.over_repeatability().map_or_else(|| "-".to_owned(), short),
            ]
        }));
        let why = match self.ended {
            Ended::AtFloor => "the error has reached the repeatability",
            Ended::NoGain => "the last passes reduced the error by less than 5 %",
            Ended::Worse => {
                "three successive passes were worse than the best one: the model does not match this actuator; fit it again or \
                 add the effects that diagnose finds"
            }
            Ended::Passes => "all passes are played; give more with --passes",
        };
        let mut lines = vec![
            text::table(&rows),
            format!("ended: {why}"),
            format!(
                "repeatability: {} {unit} (estimate after the first pass: {} {unit}); error {} times smaller than with the \
                 model's inverse",
                short(self.repeatability),
                short(self.repeatability_estimate),
                short(self.improvement)
            ),
            format!(
                "correction: {} {unit} RMS, {} {unit} at most",
                short(self.correction_rms),
                short(self.correction_max_abs)
            ),
        ];
        if let Some(found) = &self.found {
            let names: Vec<String> =
                found.iter().map(|f| format!("{} (probability {})", f.effect, short(f.probability))).collect();
            lines.push(match (names.is_empty(), &self.extended) {
                (true, _) => "missing effects: none explains the correction".to_owned(),
                (false, Some(path)) => format!("missing effects: {}; extended model: {path}", text::listed(&names)),
                (false, None) => {
                    format!("missing effects: {}; --extended MODEL writes the extended model", text::listed(&names))
                }
            });
        }
        lines.extend(self.logs.iter().map(|folder| format!("logs: {folder}")));
        lines.push(format!("drive: {}", self.output));
        lines.push(format!(
            "next: hystctl run --daq DEVICE --drive {} --settle {} --record measured.csv",
            self.output,
            short(self.settle_s)
        ));
        lines.join("\n")
    }
}
