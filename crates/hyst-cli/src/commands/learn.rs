//! `learn`: the drive of a reference that repeats, improved pass by pass.

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
use crate::device::{AnyDevice, Wishes};
use crate::exit::{CommandError, CommandResult, Exit};
use crate::log::{LoggedModel, RunInfo, RunLog};
use crate::output::{self, Report, Target, say};
use crate::progress::Progress;
use crate::{recording, text};

/// How often a pass is played again in which the device had no next value in time.
const REPLAYS: u32 = 4;

/// An effect that the passes show.
#[derive(Debug, Serialize)]
struct Found {
    effect: &'static str,
    probability: f64,
}

/// What is said about learning.
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
    /// Root mean square of what differs from play to play, as known after the first pass and after the last one \[output unit\].
    repeatability_estimate: f64,
    repeatability: f64,
    /// By how much the error of the best pass is smaller than that of the first one.
    improvement: f64,
    /// Root mean square and largest value of the correction, reference less what the model predicts for the drive \[output unit\].
    correction_rms: f64,
    correction_max_abs: f64,
    /// Effects that explain it; none where it was not looked for.
    found: Option<Vec<Found>>,
    output: String,
    logs: Option<String>,
    /// The model with these effects, if it was written.
    extended: Option<String>,
    /// How long the first value was held before each play \[s\].
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
    let wishes = Wishes {
        noise: args.seed,
        voltage: args.limits.limit.map(|limit| (limit.low, limit.high)),
        slew_v_per_s: args.limits.slew,
        force: false,
        silence_s: args.silence,
        hottest_degc: args.hottest,
        error: args.max_error,
    };
    let mut device = AnyDevice::open(&args.daq, &wishes)?;
    let mut job = Job::read(&args.to_run(), device.capabilities())?;
    let Some(followed) = job.followed.as_mut() else {
        return Err(CommandError::bad_input("give --model and --reference"));
    };
    // The same drive in each play of a pass: a temperature that moves is one of the things that do not repeat.
    if followed.live.take().is_some()
        && let (None, Some(degc)) = (args.temperature.degc, followed.options.temperature)
    {
        say(&format!(
            "note: the first drive is planned for {} °C, where the model's gain is stated; --temperature gives that of today",
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
    if let Some(foreseen) = job.foreseen() {
        say(&format!("note: {foreseen}"));
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
    /// What the passes measured.
    records: Vec<Record>,
    rate_hz: f64,
}

impl<'a> Passes<'a> {
    /// All passes. Whatever ends them, the best drive so far is kept.
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
                    None => "and each play gives the same".to_owned(),
                };
                let held = if pass.limited_rows == 0 {
                    String::new()
                } else {
                    format!("; a limit held the drive in {}", text::count(pass.limited_rows, "row"))
                };
                say(&format!("pass {number}: RMSE {} {symbol}, {repeats}{held}", text::short(pass.rmse)));
            }
            if let Some(ended) = ended {
                return Ok((learner, ended));
            }
            if interrupt::stopping().is_stopped() {
                let error = CommandError::failed("stopped on request; the device was brought to rest");
                return Err(self.kept(&learner, error));
            }
        }
    }

    /// The error that ended it, once the best drive so far is written.
    fn kept(&self, learner: &Learner<'_>, error: CommandError) -> CommandError {
        let Some((best, pass, drive)) = learner.best() else { return error };
        let symbol = recording::unit(self.device.capabilities().output).symbol();
        let what = format!("the best drive so far, of pass {}, RMSE {} {symbol},", best + 1, text::short(pass.rmse));
        say(&match write_drive(&self.args.output, self.model, learner, drive) {
            Ok(()) => format!("note: {what} is kept in {}", self.args.output),
            Err(error) => format!("warning: {what} cannot be kept there: {}", error.text()),
        });
        error
    }

    /// One pass: the outputs of each play at the rows of the drive. A pass in which the device had to wait for its drive is played again: a host that
    /// is held up now and then spoils some, a line that is too slow all of them.
    fn plays(&mut self, learner: &Learner<'_>, number: usize) -> CommandResult<Vec<Vec<f64>>> {
        let name = self.args.logs.as_ref().map(|folder| folder.join(format!("pass-{number}.mcap")));
        let (mut recording, mut gaps) = self.played(learner, name.as_deref())?;
        for again in 1..=REPLAYS {
            if gaps == 0 {
                break;
            }
            let ending = if again == 1 { "again".to_owned() } else { format!("again-{again}") };
            let name = self.args.logs.as_ref().map(|folder| folder.join(format!("pass-{number}-{ending}.mcap")));
            say(&format!(
                "note: pass {number} is played again: the device had no next value in time, so its drive was another one"
            ));
            (recording, gaps) = self.played(learner, name.as_deref())?;
        }
        if gaps > 0 {
            return Err(CommandError::failed(
                "the line is too slow for this rate: the device held old values on the way; use a faster line, or a reference with fewer samples a second",
            ));
        }
        self.rate_hz = recording.rate_hz;
        // The first play is left out: the actuator remembers other drives in it.
        recording.segments.drain(..recording.segments.len().min(1));
        let outputs = recording.segments.iter().map(|s| s.samples.iter().map(|s| s.output).collect()).collect();
        let unit = recording::unit(self.device.capabilities().output);
        let record = recording::to_record(&recording::split(recording), &format!("pass {number}"), unit)?;
        self.records.push(record);
        Ok(outputs)
    }

    /// All plays of a pass, the first one included, and how often the device had to wait.
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

/// Writes a drive with its reference; an older file keeps its content under another name.
fn write_drive(to: &Target, model: &Model, learner: &Learner<'_>, drive: &LearnedDrive) -> CommandResult {
    let extra = [Extra::numbers(&model.input.column, &drive.voltage)];
    to.write_measured(|out| learner.reference().write_with(out, &extra).map_err(output::io_error))
}

/// Writes the drive, looks for what the model lacks, and sums up.
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
            let why = if found.is_some() { ": the passes show no effect to add to the model" } else { "" };
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

/// What the model lacks on all passes together; none where a diagnosis cannot say.
fn diagnosed(args: &LearnArgs, model: &Model, records: &[Record]) -> CommandResult<Option<Diagnosis>> {
    if records.is_empty() {
        return Ok(None);
    }
    let progress = Progress::spinner("what the model had wrong");
    let joined = Record::join(records.to_vec())?;
    let options = DiagnoseOptions { zero: Zero::PerRecord, seed: args.seed.unwrap_or(1) };
    let told = |what: &str| progress.say(&format!("what the model had wrong: {what}"));
    match diagnose_until(&joined, None, model, &options, &told, &interrupt::stopping()) {
        Ok(found) => Ok(Some(found)),
        Err(error) => {
            drop(progress);
            say(&format!("note: what the model had wrong cannot be diagnosed on these passes: {error}"));
            Ok(None)
        }
    }
}

impl Summary {
    fn text(&self) -> String {
        let (short, unit) = (text::short, self.symbol);
        let mut rows = vec![
            ["pass", &format!("RMSE [{unit}]"), "largest", "repeating part", "over repeatability"]
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
            Ended::AtFloor => "the error is that of playing the same drive again",
            Ended::NoGain => "the last passes brought less than 5 %",
            Ended::Worse => {
                "three passes in a row were worse than the best: the model is too far from this actuator; fit it anew, or add what diagnose finds"
            }
            Ended::Passes => "all passes are done; give more with --passes",
        };
        let mut lines = vec![
            text::table(&rows),
            format!("ended: {why}"),
            format!(
                "repeatability: {} {unit} (estimated at {} {unit} after the first pass); error {} times smaller than that of the model's inverse",
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
                (true, _) => "no effect that the model lacks explains it".to_owned(),
                (false, Some(path)) => format!("the model lacks {}; with that: {path}", text::listed(&names)),
                (false, None) => {
                    format!("the model lacks {}; --extended MODEL writes one with that", text::listed(&names))
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
