//! A drive that is corrected while it is played, by the temperature that is measured and by what is learned of the actuator.

use hyst_hw::Revision;
use hyst_ident::compensate::{CompensateError, CompensateOptions, Drive, Follower};
use hyst_ident::model::Model;
use hyst_ident::record::Record;

use super::adapt::Adapting;

/// The drive of a model whose gain depends on a temperature that is only known while the device runs, or that is adapted.
#[derive(Debug)]
pub(in crate::commands) struct Live {
    follower: Follower,
    drive: Drive,
    adapting: Option<Adapting>,
}

impl Live {
    /// A drive for `reference` from its first row on, of an actuator that is held at the first voltages of `plan`; it goes from there
    /// to what is asked for then at `slew` \[V/s\].
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

    /// Replaces what was planned for the next rows by what the newest temperature asks for.
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

    /// The drive as it was played so far.
    pub(super) fn drive(&self) -> &Drive {
        &self.drive
    }
}
