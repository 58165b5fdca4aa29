//! Plays the passes of learning on a device.

use std::path::Path;

use hyst_hw::{Daq, Recording};
use hyst_ident::learn::{Ended, LearnedDrive, Learner};
use hyst_ident::model::Model;
use hyst_ident::record::{Extra, Record};

use crate::cli::LearnArgs;
use crate::commands::run::interrupt;
use crate::commands::run::job::Job;
use crate::commands::run::play::{self, Played};
use crate::device::AnyDevice;
use crate::exit::{CommandError, CommandResult, Exit};
use crate::log::{LoggedModel, RunInfo, RunLog};
use crate::output::{self, Target, say};
use crate::{recording, text};

/// Maximum number of repetitions of a pass in which the device did not receive a value in time.
const MAX_REPLAYS: u32 = 4;

/// Passes on a device.
pub(super) struct Passes<'a> {
    pub(super) device: AnyDevice,
    pub(super) job: Job,
    pub(super) args: &'a LearnArgs,
    pub(super) model: &'a Model,
    pub(super) json: &'a str,
    /// Records of the passes.
    pub(super) records: Vec<Record>,
    pub(super) rate_hz: f64,
}

impl<'a> Passes<'a> {
    /// Plays all passes. If an error ends them, the best drive so far is written.
    pub(super) fn all(&mut self, mut learner: Learner<'a>) -> CommandResult<(Learner<'a>, Ended)> {
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
pub(super) fn write_drive(to: &Target, model: &Model, learner: &Learner<'_>, drive: &LearnedDrive) -> CommandResult {
    let extra = [Extra::numbers(&model.input.column, &drive.voltage)];
    to.write_measured(|out| learner.reference().write_with(out, &extra).map_err(output::io_error))
}
