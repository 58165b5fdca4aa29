//! A PID on this computer, with or without a feedforward.

use hyst_core::{Build, Pid, PidParams, PidState, Sampling};
use hyst_hw::Revision;
use hyst_hw::wire::{Lasting, PATIENCE_S};

use crate::exit::{CommandError, CommandResult};

/// A loop that is closed sample by sample.
#[derive(Debug)]
pub(super) struct ClosedLoop {
    pid: Pid<f64>,
    state: PidState<f64>,
    /// Whether the planned drive is fed forward.
    /// If not, only its first value is used, which is held before the reference.
    feedforward: bool,
    /// Wanted output of each segment.
    wanted: Vec<Vec<f64>>,
    /// Maximum change of the drive from one sample to the next \[V\].
    step_v: f64,
    last_v: f64,
    /// Number of samples in which the drive is at a limit.
    limited: usize,
    /// Duration of the present saturation: drive at a limit and tracking error above `tolerance`.
    saturation: Lasting,
    /// Maximum duration of a saturation \[samples\], and whether one was longer.
    patience: f32,
    too_long: bool,
    /// Tracking error below which a drive at a limit is not a saturation \[output unit\].
    tolerance: f64,
    samples: usize,
}

impl ClosedLoop {
    /// Creates the loop for references `wanted` with a sample period \[s\].
    /// `tolerance` is the tracking error below which a drive at a limit is not a saturation \[output unit\].
    pub(super) fn new(
        params: &PidParams,
        feedforward: bool,
        wanted: Vec<Vec<f64>>,
        period: f64,
        slew_v_per_s: f64,
        tolerance: f64,
    ) -> CommandResult<Self> {
        let pid: Pid<f64> = params.build(&Sampling { period }).map_err(CommandError::bad_input)?;
        let step_v = slew_v_per_s * period;
        let state = pid.state();
        Ok(Self {
            pid,
            state,
            feedforward,
            wanted,
            step_v,
            last_v: 0.0,
            limited: 0,
            saturation: Lasting::default(),
            patience: PATIENCE_S / period as f32,
            too_long: false,
            tolerance,
            samples: 0,
        })
    }

    /// Replaces the planned drive of the next rows by the output of the controller.
    pub(super) fn revise(&mut self, revision: &mut Revision<'_>) {
        let measured = revision.latest.map_or(f64::NAN, |sample| sample.output);
        let Some(wanted) = self.wanted.get(revision.segment) else { return };
        for (row, volts) in revision.rows.clone().zip(revision.drive_v.iter_mut()) {
            let planned = *volts;
            let forward = if self.feedforward { planned } else { 0.0 };
            if row == 0 {
                self.pid.take_over(&mut self.state, planned, measured, forward);
                self.last_v = planned;
            }
            // The latest measurement belongs to the previous row. With feedforward it is compared with the reference of
            // that row, so that an exact feedforward has no error.
            let reference_row = if self.feedforward { row.saturating_sub(1) } else { row };
            let reference = wanted.get(reference_row).copied().unwrap_or(measured);
            let asked = self.pid.step(&mut self.state, reference, measured, forward);
            *volts = asked.clamp(self.last_v - self.step_v, self.last_v + self.step_v);
            self.pid.applied(&mut self.state, *volts);
            let limited = self.state.limited() || *volts != asked;
            self.limited += usize::from(limited);
            let away = self.state.limited() && (reference - measured).abs() > self.tolerance;
            self.too_long |= self.saturation.step(away, self.patience);
            self.samples += 1;
            self.last_v = *volts;
        }
    }

    /// Whether a saturation (drive at a limit, output away from its reference) has lasted too long.
    pub(super) fn limited_too_long(&self) -> bool {
        self.too_long
    }

    /// Returns the share of the samples in which the drive is at a limit \[%\].
    pub(super) fn limited_percent(&self) -> f64 {
        100.0 * self.limited as f64 / self.samples.max(1) as f64
    }
}
