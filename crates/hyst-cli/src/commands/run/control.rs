//! A PID on the host: around a feedforward, or alone.

use hyst_core::{Build, Pid, PidParams, PidState, Sampling};
use hyst_hw::Revision;
use hyst_hw::wire::{Lasting, PATIENCE_S};

use crate::exit::{CommandError, CommandResult};

/// A loop that is closed sample by sample.
#[derive(Debug)]
pub(super) struct ClosedLoop {
    pid: Pid<f64>,
    state: PidState<f64>,
    /// Whether what was planned is fed forward; else it only says where the actuator is held before the reference begins.
    feedforward: bool,
    /// Wanted output of each segment.
    wanted: Vec<Vec<f64>>,
    /// Most that the drive may change from one sample to the next \[V\].
    step_v: f64,
    last_v: f64,
    /// Samples in which a limit held the drive.
    limited: usize,
    /// Whether, and for how long, that has kept the output away.
    held: Lasting,
    /// Samples after which that is too long, and whether it has been.
    patience: f32,
    too_long: bool,
    /// A limit that leaves less than this is of no account \[output unit\].
    tolerance: f64,
    samples: usize,
}

impl ClosedLoop {
    /// Around what is planned for `wanted`, at a sample period \[s\]; errors up to `tolerance` \[output unit\] are no sign of a drive that is held.
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
            held: Lasting::default(),
            patience: PATIENCE_S / period as f32,
            too_long: false,
            tolerance,
            samples: 0,
        })
    }

    /// Replaces what was planned for the next rows by what the loop makes of the newest measurement.
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
            // What was measured last belongs to the row before: a feedforward that is right leaves no error to that row's reference.
            let of = if self.feedforward { row.saturating_sub(1) } else { row };
            let reference = wanted.get(of).copied().unwrap_or(measured);
            let asked = self.pid.step(&mut self.state, reference, measured, forward);
            *volts = asked.clamp(self.last_v - self.step_v, self.last_v + self.step_v);
            self.pid.applied(&mut self.state, *volts);
            let limited = self.state.limited() || *volts != asked;
            self.limited += usize::from(limited);
            let away = self.state.limited() && (reference - measured).abs() > self.tolerance;
            self.too_long |= self.held.step(away, self.patience);
            self.samples += 1;
            self.last_v = *volts;
        }
    }

    /// Whether a limit has held the drive, and the output away from its reference, for too long.
    pub(super) fn limited_too_long(&self) -> bool {
        self.too_long
    }

    /// Share of the samples in which a limit held the drive \[%\].
    pub(super) fn limited_percent(&self) -> f64 {
        100.0 * self.limited as f64 / self.samples.max(1) as f64
    }
}
