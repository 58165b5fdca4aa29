//! The job of a run: what is played on a device, and how.

use std::net::SocketAddr;

use hyst_hw::{Capabilities, RecordOptions, Recording};
use hyst_ident::record::Record;

use super::followed::Followed;
use super::gains::{Closed, PidReport};
use super::handed_over::HandedOver;
use super::parallel::{Force, ParallelModel};
use crate::cli::{RecordArgs, RunArgs};
use crate::exit::{CommandError, CommandResult};
use crate::recording;

/// Everything that is needed before a device moves.
#[derive(Debug)]
pub(in crate::commands) struct Job {
    /// Voltages of each segment \[V\].
    pub(in crate::commands) segments: Vec<Vec<f64>>,
    /// How the segments are played.
    pub(in crate::commands) options: RecordOptions,
    /// Reference and model; `None` for a drive that is played unchanged.
    pub(in crate::commands) followed: Option<Followed>,
    /// Wanted output at each voltage; `None` for a drive.
    pub(in crate::commands) wanted: Vec<Option<f64>>,
    /// Controller on the device; with it `segments` holds references \[output unit\].
    pub(super) handed_over: Option<HandedOver>,
    /// Symbol of the output unit.
    pub(super) symbol: &'static str,
    /// Whether a record is written.
    pub(super) recorded: bool,
    /// Name of the option for a log, for messages.
    pub(in crate::commands) log_option: &'static str,
    /// Address for viewers.
    pub(super) live: Option<SocketAddr>,
    /// Whether a progress bar is shown instead of a plot.
    pub(super) plain: bool,
    /// Maximum temperature \[°C\] and maximum tracking error \[output unit\] of the run.
    pub(super) hottest_degc: Option<f64>,
    pub(super) greatest_error: Option<f64>,
    /// Temperature if none is measured \[°C\], and stiffness for a force estimate \[N/output unit\].
    pub(super) degc: Option<f64>,
    pub(super) stiffness: Option<f64>,
}

/// Maximum slope of the device over the slope of the planned drive.
/// The margin is for corrections during the run.
const SLEW_MARGIN: f64 = 1.5;

impl Job {
    /// Creates a job without a loop on the device.
    pub(super) fn new(
        args: &RunArgs,
        device: &Capabilities,
        segments: Vec<Vec<f64>>,
        options: RecordOptions,
        wanted: Vec<Option<f64>>,
        followed: Option<Followed>,
    ) -> Self {
        Self {
            segments,
            options,
            followed,
            wanted,
            handed_over: None,
            symbol: recording::unit(device.output).symbol(),
            recorded: args.record.is_some(),
            log_option: "--log",
            live: args.live,
            plain: args.plain,
            hottest_degc: args.hottest,
            greatest_error: args.max_error,
            degc: None,
            stiffness: args.kout,
        }
    }

    /// Creates a job that records a device at rest, without a drive and without a model.
    pub(in crate::commands) fn at_rest(device: &Capabilities, rows: usize, rate_hz: f64, args: &RecordArgs) -> Self {
        Self {
            segments: vec![vec![device.voltage.rest_v; rows]],
            options: RecordOptions::at(rate_hz),
            followed: None,
            wanted: vec![None; rows],
            handed_over: None,
            symbol: recording::unit(device.output).symbol(),
            recorded: args.output.is_some(),
            log_option: "--log",
            live: args.live,
            plain: args.plain,
            hottest_degc: args.hottest,
            greatest_error: None,
            degc: None,
            stiffness: None,
        }
    }

    /// Creates the model that runs in parallel with the device; `None` without a reference.
    pub(super) fn parallel_model(&self) -> CommandResult<Option<ParallelModel>> {
        let Some(followed) = &self.followed else { return Ok(None) };
        let on_device = self.handed_over.is_some();
        let force = self.stiffness.map(|stiffness| if on_device { Force::OnDevice } else { Force::Here(stiffness) });
        let model =
            ParallelModel::new(&followed.model, self.options.rate_hz, self.degc, force, followed.adapting.clone())?;
        if model.is_none() && self.stiffness.is_some() && !on_device {
            return Err(CommandError::bad_input(
                "--kout needs a model that runs sample by sample, but a model with a band-limited drive between samples needs \
                 the whole drive; estimate the force after the run with hystctl force",
            ));
        }
        Ok(model)
    }

    /// Returns the slope that the device must allow \[V/s\].
    pub(in crate::commands) fn steepest(&self) -> f64 {
        if let Some(HandedOver { slew_v_per_s, .. }) = self.handed_over {
            return slew_v_per_s;
        }
        let steep = |volts: &[f64]| steepest_step(volts) * self.options.rate_hz;
        let steepest = self.segments.iter().map(|volts| steep(volts)).fold(0.0, f64::max);
        SLEW_MARGIN * steepest.max(self.options.slew_v_per_s)
    }

    /// Returns a sentence about the predicted tracking error of the planned drive, if it is large.
    pub(in crate::commands) fn predicted_error(&self) -> Option<String> {
        let followed = self.followed.as_ref()?;
        let plan = self.handed_over.as_ref().and_then(|handed| handed.plan.as_ref());
        followed.predicted_error(followed.drive.as_ref().or(plan)?)
    }

    /// Removes the rows (and forces) before the output has reached the start of a reference.
    pub(super) fn align(&self, recording: &mut Recording, forces: &mut [Vec<f64>]) {
        let Some(HandedOver { late, .. }) = self.handed_over else { return };
        for segment in &mut recording.segments {
            segment.samples.drain(..late.min(segment.samples.len()));
        }
        for forces in forces {
            forces.drain(..late.min(forces.len()));
        }
    }

    /// Returns the PID of the run; `None` without one.
    pub(super) fn pid(&self, recording: &Recording) -> Option<PidReport<'_>> {
        if let (Some(handed), Some(followed)) = (&self.handed_over, &self.followed) {
            let limited_percent = Some(handed.limited_percent(recording, followed));
            return Some(PidReport { gains: &handed.gains, why: &handed.why, crossover_hz: None, limited_percent });
        }
        let Closed { running, gains, crossover_hz, why } = self.followed.as_ref()?.closed.as_ref()?;
        let limited_percent = Some(running.limited_percent());
        Some(PidReport { gains, why, crossover_hz: *crossover_hz, limited_percent })
    }
}

/// Returns the largest step between successive voltages \[V\].
pub(super) fn steepest_step(volts: &[f64]) -> f64 {
    volts.windows(2).map(|pair| (pair[1] - pair[0]).abs()).fold(0.0, f64::max)
}

/// Returns the values of each segment of a record.
pub(super) fn split(record: &Record, values: &[f64]) -> Vec<Vec<f64>> {
    record.segments().iter().map(|rows| values[rows.clone()].to_vec()).collect()
}
