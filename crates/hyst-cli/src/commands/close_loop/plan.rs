//! Choice of the next experiment.

use hyst_hw::{Daq, RecordOptions};
use hyst_ident::diagnose::Findings;
use hyst_ident::excite::{Identification, Limits};
use hyst_ident::experiment::{self, Aim, Next, Planner, Question};
use hyst_ident::record::Record;
use serde::Serialize;

use crate::cli::CloseLoopArgs;
use crate::exit::{CommandError, CommandResult, Exit};
use crate::{hosted, recording};

/// A drive that was played.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Experiment {
    /// Name of the drive.
    pub(super) drive: &'static str,
    /// Duration, rests included \[s\].
    pub(super) seconds: f64,
    /// Purpose, if experiments are chosen.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) why: Option<String>,
}

/// The experiments of a run.
pub(super) struct Plan {
    limits: Limits,
    seed: u64,
    /// Chooses experiments; `None` for identification drives.
    planner: Option<Planner>,
    spent: f64,
    /// Next experiment, if it was chosen.
    next: Option<Box<experiment::Experiment>>,
}

impl Plan {
    pub(super) fn new(args: &CloseLoopArgs, daq: &impl Daq) -> Self {
        let range = daq.capabilities().voltage;
        let limits = Limits { rate_hz: args.rate, lo_v: range.min_v, hi_v: range.max_v, slew_v_per_s: None };
        let aim = args.until.map(|probability| Aim { probability, precision: args.precision });
        let planner = aim.map(|aim| Planner::new(limits, aim, args.within, args.seed));
        Self { limits, seed: args.seed, planner, spent: 0.0, next: None }
    }

    /// Returns the time of all experiments so far \[s\].
    pub(super) fn spent(&self) -> f64 {
        self.spent
    }

    /// Limits the slope of all later drives \[V/s\] and starts again.
    pub(super) fn stay_below(&mut self, v_per_s: f64) {
        self.limits.slew_v_per_s = Some(v_per_s);
        self.planner.iter_mut().for_each(|planner| planner.stay_below(v_per_s));
        self.next = None;
    }

    /// Plays the next experiment; returns it with its record.
    pub(super) fn play(&mut self, daq: &mut impl Daq, turn: u32) -> CommandResult<(Experiment, Record)> {
        let (drive, name, why) = match (self.next.take(), &mut self.planner) {
            (Some(next), _) => (next.drive, next.name, Some(next.why)),
            (None, Some(planner)) => match planner.first()? {
                Next::Play(first) => (first.drive, first.name, Some(first.why)),
                Next::End(why) => return Err(CommandError::bad_input(format!("--within: {why}"))),
            },
            (None, None) => {
                let seed = self.seed.wrapping_add(u64::from(turn) << 32);
                let usual = Identification::at_rate(self.limits.rate_hz, seed).within_slew(&self.limits, &|_| true);
                (usual.drive(&self.limits)?, "identification", None)
            }
        };
        let segments: Vec<&[f64]> = drive.segments().iter().map(|rows| &drive.voltage()[rows.clone()]).collect();
        let recording = hyst_hw::record(daq, &segments, &RecordOptions::at(self.limits.rate_hz), |_| hosted::going())
            .map_err(|failure| CommandError::new(Exit::DeviceLost, anyhow::anyhow!("{failure}")))?;
        let seconds = drive.time().last().unwrap_or(&0.0) - drive.time().first().unwrap_or(&0.0);
        self.spent += seconds;
        let unit = recording::unit(daq.capabilities().output);
        let record = recording::to_record(&recording, &format!("train-{turn}.csv"), unit)?;
        Ok((Experiment { drive: name, seconds, why }, record))
    }

    /// Chooses the next experiment.
    /// Returns the undecided questions, and the reason if there is no next experiment.
    pub(super) fn next(
        &mut self,
        findings: &Findings,
        train: &Record,
    ) -> CommandResult<(Vec<Question>, Option<String>)> {
        let Some(planner) = &mut self.planner else { return Ok((Vec::new(), None)) };
        let (open, next) = planner.next(findings, train)?;
        match next {
            Next::Play(next) => {
                self.next = Some(next);
                Ok((open, None))
            }
            Next::End(why) => Ok((open, Some(why))),
        }
    }
}
