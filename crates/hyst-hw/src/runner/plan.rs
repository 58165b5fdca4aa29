//! The drive of a segment on the device: approach, record, retreat.

use super::failure::Cause;
use super::recording::{Phase, RecordOptions, Revision};
use crate::daq::{Sample, VoltageRange};

/// Longest ramp and hold. They are stored in memory; longer ones are probably a wrong unit.
const LONGEST_RAMP_S: f64 = 600.0;
const LONGEST_SETTLE_S: f64 = 3600.0;

/// All drive samples of one segment.
///
/// They are in one array, so that a device with a queue does not run empty within a segment.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Plan {
    pub(super) drive_v: Vec<f64>,
    /// First sample of the record.
    record: usize,
    /// First sample of the retreat.
    retreat: usize,
    /// First sample that is not yet revised.
    revised: usize,
}

/// Segment of a revision, and the newest measurement.
#[derive(Debug, Clone, Copy)]
pub(super) struct RevisionContext<'a> {
    pub(super) segment: usize,
    pub(super) latest: Option<&'a Sample>,
}

impl Plan {
    /// Returns the plan of a drive: ramp from `present_v`, hold, drive, ramp to `rest_v`.
    pub(super) fn new(drive: &[f64], present_v: f64, rest_v: f64, options: &RecordOptions) -> Self {
        let step_v = options.slew_v_per_s / options.rate_hz;
        let mut drive_v = Vec::new();
        if let Some(&first) = drive.first() {
            ramp(&mut drive_v, present_v, first, step_v);
            let settle = (options.settle_s * options.rate_hz).round() as usize;
            drive_v.extend(std::iter::repeat_n(first, settle));
        }
        let record = drive_v.len();
        drive_v.extend_from_slice(drive);
        let retreat = drive_v.len();
        let mut plan = Self { drive_v, record, retreat, revised: record };
        plan.come_to_rest(rest_v, step_v);
        plan
    }

    /// Calls `revise` for the record up to sample `end` of the plan, once for each sample.
    ///
    /// After the last sample, the retreat is computed again from the new end of the drive.
    pub(super) fn revise(
        &mut self,
        end: usize,
        context: RevisionContext<'_>,
        rest_v: f64,
        options: &RecordOptions,
        revise: &mut impl FnMut(&mut Revision<'_>),
    ) {
        let end = end.min(self.retreat);
        if self.revised >= end {
            return;
        }
        let RevisionContext { segment, latest } = context;
        let rows = self.revised - self.record..end - self.record;
        revise(&mut Revision { segment, rows, drive_v: &mut self.drive_v[self.revised..end], latest });
        self.revised = end;
        if end == self.retreat {
            self.drive_v.truncate(self.retreat);
            self.come_to_rest(rest_v, options.slew_v_per_s / options.rate_hz);
        }
    }

    /// Drops all samples after the first `sent` ones and retreats from there.
    pub(super) fn cut(&mut self, sent: usize, rest_v: f64, options: &RecordOptions) {
        if sent < self.retreat {
            self.drive_v.truncate(sent);
            self.record = self.record.min(sent);
            self.retreat = sent;
            self.come_to_rest(rest_v, options.slew_v_per_s / options.rate_hz);
        }
    }

    fn come_to_rest(&mut self, rest_v: f64, step_v: f64) {
        if let Some(&last) = self.drive_v.last().filter(|last| **last != rest_v) {
            ramp(&mut self.drive_v, last, rest_v, step_v);
            self.drive_v.push(rest_v);
        }
    }

    /// Returns the phase of sample `index`, and the index at which this phase ends.
    pub(super) fn phase(&self, index: usize) -> (Phase, usize) {
        if index < self.record {
            (Phase::Approach, self.record)
        } else if index < self.retreat {
            (Phase::Record, self.retreat)
        } else {
            (Phase::Retreat, self.drive_v.len())
        }
    }
}

/// Appends values strictly between `from` and `to`, evenly spaced by at most `step_v`.
fn ramp(drive_v: &mut Vec<f64>, from: f64, to: f64, step_v: f64) {
    let steps = ((to - from).abs() / step_v).ceil() as usize;
    drive_v.extend((1..steps).map(|k| from + (to - from) * k as f64 / steps as f64));
}

/// Checks options and all segments before anything moves.
pub(super) fn check<E>(
    segments: &[impl AsRef<[f64]>],
    range: VoltageRange,
    options: &RecordOptions,
) -> Result<(), Cause<E>> {
    let demand = |name, value: f64, fits: bool, advice| {
        if value.is_finite() && fits { Ok(()) } else { Err(Cause::Option { name, value, advice }) }
    };
    demand("rate_hz", options.rate_hz, options.rate_hz > 0.0, "give a rate above 0 Hz")?;
    let longest_ramp_s = (range.max_v - range.min_v) / options.slew_v_per_s;
    let slew_fits = options.slew_v_per_s > 0.0 && longest_ramp_s <= LONGEST_RAMP_S;
    let advice = "give a slew rate in V/s above 0 that crosses the voltage range within 600 s";
    demand("slew_v_per_s", options.slew_v_per_s, slew_fits, advice)?;
    let settle_fits = (0.0..=LONGEST_SETTLE_S).contains(&options.settle_s);
    demand("settle_s", options.settle_s, settle_fits, "give a time from 0 to 3600 s")?;
    demand("rest_s", options.rest_s, options.rest_s >= 0.0, "give a time of 0 s or more")?;
    let tolerance = options.rate_tolerance;
    demand("rate_tolerance", tolerance, tolerance >= 0.0, "give a relative difference of 0 or more")?;
    if segments.is_empty() {
        return Err(Cause::NoSegment);
    }
    for (segment, drive) in segments.iter().enumerate() {
        let drive = drive.as_ref();
        if drive.is_empty() {
            return Err(Cause::EmptySegment { segment });
        }
        if let Some((row, &volts)) = drive.iter().enumerate().find(|(_, volts)| !range.contains(**volts)) {
            return Err(if volts.is_finite() {
                Cause::OutOfRange { segment, row, volts, min_v: range.min_v, max_v: range.max_v }
            } else {
                Cause::NonFinite { segment, row, volts }
            });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options() -> RecordOptions {
        RecordOptions { slew_v_per_s: 100.0, settle_s: 0.02, ..RecordOptions::at(100.0) }
    }

    fn phases(plan: &Plan) -> (usize, usize, usize) {
        let count = |phase| (0..plan.drive_v.len()).filter(|i| plan.phase(*i).0 == phase).count();
        (count(Phase::Approach), count(Phase::Record), count(Phase::Retreat))
    }

    #[test]
    fn ramps_keep_the_slew_rate_and_are_not_part_of_the_record() {
        let plan = Plan::new(&[5.0, 6.0, 2.5], 0.0, 0.0, &options());
        // 1, 2, 3, 4 and two samples of the hold; the record; 1.67, 0.83, 0.
        assert_eq!(phases(&plan), (6, 3, 3));
        assert_eq!(plan.drive_v[..9], [1.0, 2.0, 3.0, 4.0, 5.0, 5.0, 5.0, 6.0, 2.5]);
        assert_eq!(plan.drive_v.last(), Some(&0.0));
    }

    #[test]
    fn a_drive_from_rest_to_rest_has_no_ramps() {
        let plan = Plan::new(&[0.0, 3.0, 0.0], 0.0, 0.0, &RecordOptions { settle_s: 0.0, ..options() });
        assert_eq!(plan.drive_v, [0.0, 3.0, 0.0]);
        assert_eq!(phases(&plan), (0, 3, 0));
    }

    #[test]
    fn a_cut_plan_retreats_from_the_present_voltage() {
        let mut plan = Plan::new(&[5.0, 6.0, 2.5], 0.0, 0.0, &options());
        plan.cut(3, 0.0, &options());
        assert_eq!(plan.drive_v, [1.0, 2.0, 3.0, 2.0, 1.0, 0.0]);
        assert_eq!(phases(&plan), (3, 0, 3));
        let mut plan = Plan::new(&[5.0, 6.0, 2.5], 0.0, 0.0, &options());
        plan.cut(8, 0.0, &options());
        assert_eq!(phases(&plan), (6, 2, 6));
        // A retreat that has begun is not changed.
        let before = plan.clone();
        plan.cut(10, 0.0, &options());
        assert_eq!(plan, before);
    }
}
