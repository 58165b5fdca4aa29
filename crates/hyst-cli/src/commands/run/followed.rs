//! A reference that is followed with a model.

use hyst_hw::Recording;
use hyst_ident::compensate::{CompensateOptions, Drive};
use hyst_ident::model::Model;
use hyst_ident::record::Record;

use super::adapt::Adapting;
use super::gains::Closed;
use super::live::Live;
use crate::cli::Control;
use crate::commands::compensate::Compensation;
use crate::text;

/// A reference and the model that computes its drive.
#[derive(Debug)]
pub(in crate::commands) struct Followed {
    pub(in crate::commands) model: Model,
    /// Text of the model file.
    pub(in crate::commands) json: String,
    pub(in crate::commands) reference: Record,
    /// Limits and temperature of the drive.
    pub(in crate::commands) options: CompensateOptions,
    /// Controller that computes the drive.
    pub(super) control: Control,
    /// Drive planned by the model's inverse; `None` without an inverse.
    pub(super) drive: Option<Drive>,
    /// Drive that is corrected during the run, for a measured temperature or an adapted model.
    pub(in crate::commands) live: Option<Live>,
    /// The adaptation of `--adapt`.
    pub(super) adapting: Option<Adapting>,
    /// PID on this computer.
    pub(super) closed: Option<Closed>,
    /// Hold time at the first value of a segment \[s\].
    pub(super) held_s: f64,
}

/// Minimum predicted tracking error that is reported.
/// As a share of the standard deviation of the reference, and of the output range of the model.
const MIN_ERROR_SHARE: f64 = 0.05;
const MIN_ERROR_SHARE_OF_RANGE: f64 = 1e-3;

impl Followed {
    /// Returns the wanted output of all segments.
    pub(super) fn wanted(&self) -> &[f64] {
        self.reference.output().unwrap_or_default()
    }

    /// Returns a sentence about the predicted tracking error of a drive and its causes, if it is large.
    pub(super) fn predicted_error(&self, drive: &Drive) -> Option<String> {
        let Drive { bandwidth_hz, voltage_limited, slew_limited, missed, .. } = drive;
        let wanted = self.wanted();
        let count = wanted.len().max(1) as f64;
        let mean = wanted.iter().sum::<f64>() / count;
        let spread = (wanted.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / count).sqrt();
        let (low, high) = (self.model.output.low, self.model.output.high);
        if missed.settled_rmse <= (MIN_ERROR_SHARE * spread).max(MIN_ERROR_SHARE_OF_RANGE * (high - low)) {
            return None;
        }
        let mut why = Vec::new();
        for (rows, what) in [(voltage_limited, "voltage"), (slew_limited, "slew")] {
            if !rows.is_empty() {
                why.push(format!("the {what} is limited in {} of {}", rows.len(), text::count(wanted.len(), "row")));
            }
        }
        if let (Some(hz), true) = (bandwidth_hz, why.is_empty()) {
            why.push(format!("dynamics are inverted only up to {} Hz", text::short(*hz)));
        }
        let unit = text::symbol(&self.model.output.unit);
        let (missed, why) = (text::short(missed.settled_rmse), why.join(", "));
        let why = if why.is_empty() { String::new() } else { format!(" ({why})") };
        Some(format!("for the planned drive the model predicts a tracking error of {missed} {unit} RMS{why}"))
    }

    /// Returns the wanted output at each row of a recording, whose segments may have ended early.
    pub(super) fn wanted_at(&self, recording: &Recording) -> Vec<f64> {
        let wanted = self.wanted();
        let rows = self.reference.segments().iter().zip(&recording.segments);
        rows.flat_map(|(rows, segment)| wanted[rows.clone()].iter().take(segment.samples.len())).copied().collect()
    }

    /// Whether the drive is corrected during the run and depends on the temperature.
    pub(super) fn needs_temperature(&self) -> bool {
        self.live.is_some() && self.model.effects.temperature.is_some()
    }

    /// Returns the report of the drive that was played.
    pub(super) fn compensation(&self) -> Option<Compensation> {
        let drive = self.live.as_ref().map(Live::drive).or(self.drive.as_ref())?;
        let mut compensation = Compensation::new(&self.model, &self.reference, drive);
        compensation.held_s = Some(self.held_s);
        Some(compensation)
    }
}
