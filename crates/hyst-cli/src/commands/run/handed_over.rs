//! A controller that runs on the device.

use hyst_core::PidParams;
use hyst_hw::Recording;
use hyst_hw::wire::SATURATION_TOLERANCE;
use hyst_ident::compensate::Drive;

use super::followed::Followed;

/// A controller that runs on the device.
#[derive(Debug)]
pub(super) struct HandedOver {
    /// The controller in the format of the device.
    pub(super) recipe: Vec<u8>,
    /// Minimum and maximum reference \[output unit\].
    pub(super) range: (f64, f64),
    /// Delay of the output relative to the references \[rows\].
    pub(super) late: usize,
    pub(super) gains: PidParams,
    pub(super) why: String,
    pub(super) slew_v_per_s: f64,
    /// Drive of the model's inverse, if it could be computed; the drive of the loop is close to it.
    pub(super) plan: Option<Drive>,
}

impl HandedOver {
    /// Returns the share of the rows with the drive at a limit and a tracking error \[%\].
    pub(super) fn limited_percent(&self, recording: &Recording, followed: &Followed) -> f64 {
        let PidParams { low, high, .. } = self.gains;
        // The device computes with f32.
        let (near, step) = (1e-5 * (high - low), 0.999 * self.slew_v_per_s / recording.rate_hz);
        let tolerance = SATURATION_TOLERANCE * (followed.model.output.high - followed.model.output.low);
        let wanted = followed.wanted();
        let (mut held, mut rows) = (0, 0);
        for segment in &recording.segments {
            for (k, sample) in segment.samples.iter().enumerate() {
                let before = k.checked_sub(1).map_or(sample.drive_v, |k| segment.samples[k].drive_v);
                let at_end = sample.drive_v <= low + near || sample.drive_v >= high - near;
                let away = wanted.get(rows).is_some_and(|wanted| (sample.output - wanted).abs() > tolerance);
                held += usize::from(away && (at_end || (sample.drive_v - before).abs() >= step));
                rows += 1;
            }
        }
        100.0 * held as f64 / rows.max(1) as f64
    }
}
