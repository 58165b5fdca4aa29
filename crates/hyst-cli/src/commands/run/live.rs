//! A drive that is corrected during the run for the measured temperature and by the adaptation.

use hyst_hw::Revision;
use hyst_ident::compensate::{CompensateError, CompensateOptions, Drive, Follower};
use hyst_ident::model::Model;
use hyst_ident::record::Record;

use super::adapt::Adapting;

/// The drive of a model whose gain depends on the measured temperature, or of an adapted model.
#[derive(Debug)]
pub(in crate::commands) struct Live {
    follower: Follower,
    drive: Drive,
    adapting: Option<Adapting>,
}

impl Live {
    /// Creates the drive of `reference` for an actuator that is held at the first voltages of `plan`.
    /// The drive moves from there to the corrected voltage with `slew` \[V/s\].
    pub(super) fn new(
        model: &Model,
        reference: &Record,
        options: &CompensateOptions,
        plan: &Drive,
        slew: f64,
        adapting: Option<Adapting>,
    ) -> Result<Self, CompensateError> {
        let follower = Follower::new(model, reference, options)?;
        let held = follower.segments().iter().map(|rows| plan.voltage[rows.start]).collect();
        let follower = follower.held_at(held, slew);
        let drive = follower.stated();
        Ok(Self { follower, drive, adapting })
    }

    /// Replaces the planned drive of the next rows by the drive for the latest temperature.
    pub(super) fn revise(&mut self, revision: &mut Revision<'_>) {
        let temperature = revision.latest.and_then(|sample| sample.temperature_degc);
        for volts in revision.drive_v.iter_mut() {
            let limited = match &self.adapting {
                Some(adapting) => self.follower.next_aimed(temperature, |begins, r| adapting.aim(begins, r)),
                None => self.follower.next(temperature),
            };
            let row = self.drive.voltage.len();
            *volts = limited.drive;
            self.drive.voltage.push(limited.drive);
            self.drive.voltage_limited.extend(limited.voltage.then_some(row));
            self.drive.slew_limited.extend(limited.slew.then_some(row));
        }
    }

    /// Returns the drive that was played so far.
    pub(super) fn drive(&self) -> &Drive {
        &self.drive
    }
}
