//! Which experiment comes next, and why.

use hyst_hw::{Daq, RecordOptions};
use hyst_ident::diagnose::Findings;
use hyst_ident::excite::{Drive, Identification, Limits};
use hyst_ident::experiment::{Aim, Question, choose, open_questions};
use hyst_ident::range;
use hyst_ident::record::Record;
use serde::Serialize;

use crate::cli::CloseLoopArgs;
use crate::exit::{CommandError, CommandResult, Exit};
use crate::{host, recording, text};

/// A drive that was played.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Experiment {
    /// What it is.
    pub(super) drive: String,
    /// How long it took, rests included \[s\].
    pub(super) seconds: f64,
    /// What it was chosen for, where experiments are chosen.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) why: Option<String>,
}

/// The experiments of a run.
pub(super) struct Plan {
    limits: Limits,
    seed: u64,
    /// What is to be known, and the time for it \[s\]; `None` for the usual experiments.
    chosen: Option<(Aim, f64)>,
    spent: f64,
    /// What comes next, if it was chosen.
    next: Option<(Drive, Experiment)>,
}

impl Plan {
    pub(super) fn new(args: &CloseLoopArgs, daq: &impl Daq) -> Self {
        let range = daq.capabilities().voltage;
        Self {
            limits: Limits { rate_hz: args.rate, lo_v: range.min_v, hi_v: range.max_v, slew_v_per_s: None },
            seed: args.seed,
            chosen: args.until.map(|probability| (Aim { probability, precision: args.precision }, args.within)),
            spent: 0.0,
            next: None,
        }
    }

    /// Time of all experiments so far \[s\].
    pub(super) fn spent(&self) -> f64 {
        self.spent
    }

    /// Lets no later drive be steeper \[V/s\], and begins anew.
    pub(super) fn stay_below(&mut self, v_per_s: f64) {
        self.limits.slew_v_per_s = Some(v_per_s);
        self.next = None;
    }

    /// Plays the next experiment.
    pub(super) fn play(&mut self, daq: &mut impl Daq, turn: u32) -> CommandResult<(Experiment, Record)> {
        let (drive, experiment) = match self.next.take() {
            Some(chosen) => chosen,
            None => self.identification(turn, self.chosen.map(|_| "a first look".to_owned()))?,
        };
        let segments: Vec<&[f64]> = drive.segments().iter().map(|rows| &drive.voltage()[rows.clone()]).collect();
        let recording = hyst_hw::record(daq, &segments, &RecordOptions::at(self.limits.rate_hz), |_| host::going())
            .map_err(|failure| CommandError::new(Exit::DeviceLost, anyhow::anyhow!("{failure}")))?;
        self.spent += experiment.seconds;
        let unit = recording::unit(daq.capabilities().output);
        Ok((experiment, recording::to_record(&recording, &format!("train-{turn}.csv"), unit)?))
    }

    /// The identification drive of a turn: the usual one, or a short one where experiments are chosen.
    fn identification(&self, turn: u32, why: Option<String>) -> CommandResult<(Drive, Experiment)> {
        let (rate, seed) = (self.limits.rate_hz, self.seed.wrapping_add(u64::from(turn) << 32));
        let (name, drive) = match self.chosen {
            None => ("identification", Identification::at_rate(rate, seed)),
            Some(_) => ("short identification", Identification::short(rate, seed)),
        };
        let drive = drive.within_slew(&self.limits, &|_| true).drive(&self.limits)?;
        let seconds = seconds(&drive);
        Ok((drive, Experiment { drive: name.to_owned(), seconds, why }))
    }

    /// Looks at what is open, and chooses the next experiment; the second part says why there is none.
    pub(super) fn next(
        &mut self,
        findings: &Findings,
        train: &Record,
        turn: u32,
    ) -> CommandResult<(Vec<Question>, Option<String>)> {
        let Some((aim, within)) = self.chosen else { return Ok((Vec::new(), None)) };
        let open = open_questions(findings, aim);
        if open.is_empty() {
            return Ok((open, Some(format!("all that was asked is known after {} s", text::short(self.spent)))));
        }
        let words = text::listed(&open.iter().map(Question::words).collect::<Vec<_>>());
        let left = within - self.spent;
        let (low, high) = range(train.output().unwrap_or_default().iter().copied());
        let missed = findings.after.train.map_or(findings.noise_floor, |errors| errors.rmse).max(findings.noise_floor);
        let sensors = (train.temperature().is_some(), train.load().is_some());
        if let Some(choice) = choose(&open, &self.limits, missed / (high - low), sensors, left)? {
            let seconds = seconds(&choice.drive);
            let experiment = Experiment { drive: choice.name.to_owned(), seconds, why: Some(words) };
            self.next = Some((choice.drive, experiment));
            return Ok((open, None));
        }
        // What nothing explains may show under another drive.
        let (drive, experiment) = self.identification(turn + 1, Some(words.clone()))?;
        if open.contains(&Question::Rest) && experiment.seconds <= left {
            self.next = Some((drive, experiment));
            return Ok((open, None));
        }
        Ok((open, Some(format!("no drive in the {} s that are left decides {words}", text::short(left.max(0.0))))))
    }
}

fn seconds(drive: &Drive) -> f64 {
    let time = drive.time();
    time.last().unwrap_or(&0.0) - time.first().unwrap_or(&0.0)
}
