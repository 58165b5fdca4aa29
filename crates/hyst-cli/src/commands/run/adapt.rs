//! `--adapt`: corrects the target of the inverse by the residual of the model.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::rc::Rc;
use std::time::{SystemTime, UNIX_EPOCH};

use hyst_core::{Adaptation, AdaptationOptions, Adapted};
use hyst_ident::BetweenSamples;
use hyst_ident::atomic_file::write_atomic;
use hyst_ident::model::Model;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::exit::{CommandError, CommandResult};
use crate::output;
use crate::text;

/// Number of play operators between predicted and measured output.
/// The adapted numbers are their weights, the gain and the zero.
const PLAYS: usize = 4;
const NUMBERS: usize = PLAYS + 2;

/// Bounds of the residual that weights an update, as a share of the output range.
/// The residual of a fit underestimates the error on other records. A model without a fit residual uses the upper
/// bound.
const SIGMA_BOUNDS: (f64, f64) = (1e-3, 0.05);
/// Minimum change that is logged, as a share of the gain or of the output range.
const MIN_LOGGED_CHANGE: f64 = 0.005;
const DAY_S: f64 = 86_400.0;

/// The adaptation, shared by the computation of the drive and the parallel model.
#[derive(Clone, Debug)]
pub(in crate::commands) struct Adapting(Rc<RefCell<Inner>>);

#[derive(Debug)]
struct Inner {
    how: Adaptation<f64, PLAYS, NUMBERS>,
    state: Adapted<f64, PLAYS, NUMBERS>,
    span: f64,
    /// Whether the estimate was updated since the last call of `new_change`.
    updated: bool,
    logged: Change,
    /// Adaptation of an earlier run.
    kept: Option<Kept>,
    model_sha256: String,
}

/// Difference between the actuator and its model.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub(super) struct Change {
    /// Change of the gain of a stroke over the whole range \[%\].
    pub(super) gain_percent: f64,
    /// Change of the loop width of such a stroke, in the middle of the range \[output unit\].
    pub(super) loop_width: f64,
    /// Change of the zero \[output unit\].
    pub(super) zero: f64,
    /// Number of updates of the estimate.
    pub(super) updates: u32,
    /// Time since the first run of a saved adaptation \[s\]; `None` without one.
    pub(super) over_s: Option<f64>,
}

/// File of an adaptation.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Kept {
    /// SHA-256 of the model file.
    model_sha256: String,
    /// Start of the first run \[s since 1970\].
    since_unix_s: f64,
    /// Gain, weights of the play operators, and zero over the output range.
    numbers: Vec<f64>,
}

fn now_unix_s() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64())
}

impl Adapting {
    /// Creates the adaptation of a model; continues from `file` if it exists.
    pub(super) fn new(model: &Model, json: &str, file: Option<&Path>) -> CommandResult<Self> {
        if model.between_samples != BetweenSamples::Linear {
            return Err(CommandError::bad_input(
                "--adapt needs a model that runs sample by sample, but a model with a band-limited drive between samples needs \
                 the whole drive; fit one with --between-samples linear",
            ));
        }
        let range = (model.output.low, model.output.high);
        let span = range.1 - range.0;
        let (least, greatest) = SIGMA_BOUNDS;
        let sigma = model.rmse.map_or(greatest, |rmse| (rmse / span).clamp(least, greatest));
        let options = AdaptationOptions { sigma, ..AdaptationOptions::default() };
        let how = Adaptation::new(range, &options).map_err(CommandError::bad_input)?;
        let model_sha256 = format!("{:x}", Sha256::digest(json));
        let kept = file.filter(|file| file.exists()).map(|file| Kept::read(file, &model_sha256)).transpose()?;
        let mut state = how.begin();
        if let Some(numbers) = kept.as_ref().and_then(|kept| <[f64; NUMBERS]>::try_from(&kept.numbers[..]).ok()) {
            state = how.begin_at(numbers);
        }
        Ok(Self(Rc::new(RefCell::new(Inner {
            how,
            state,
            span,
            updated: false,
            logged: Change::default(),
            kept,
            model_sha256,
        }))))
    }

    /// Returns the target of the inverse for `reference`; `begins` marks the first row of a segment.
    pub(super) fn aim(&self, begins: bool, reference: f64) -> f64 {
        let Inner { how, state, .. } = &mut *self.0.borrow_mut();
        if begins {
            how.aim_anew(state);
        }
        how.aim(state, reference)
    }

    /// Starts a segment: the model is at rest, like the device.
    pub(super) fn begin_segment(&self) {
        let Inner { how, state, .. } = &mut *self.0.borrow_mut();
        how.see_anew(state);
    }

    /// Sets the sensor zero before a reference \[output unit\].
    pub(super) fn zero(&self, zero: f64) {
        let Inner { how, state, .. } = &mut *self.0.borrow_mut();
        how.set_zero(state, zero);
    }

    /// Takes a sample; returns the predicted output of the adapted model.
    pub(super) fn take(&self, predicted: f64, measured: f64, trusted: bool) -> f64 {
        let Inner { how, state, updated, .. } = &mut *self.0.borrow_mut();
        *updated |= how.learn(state, predicted, measured, trusted);
        how.expected(state, predicted).unwrap_or(predicted)
    }

    /// Returns the present difference between the actuator and its model.
    pub(super) fn change(&self) -> Change {
        let Inner { how, state, span, kept, .. } = &*self.0.borrow();
        Change {
            gain_percent: 100.0 * (state.stroke_gain(how) - 1.0),
            loop_width: span * state.loop_width(how),
            zero: span * state.zero(),
            updates: state.updates(),
            over_s: kept.as_ref().map(|kept| (now_unix_s() - kept.since_unix_s).max(0.0)),
        }
    }

    /// Returns the difference if it has changed by more than [`MIN_LOGGED_CHANGE`] since the last one.
    pub(super) fn new_change(&self) -> Option<Change> {
        if !std::mem::take(&mut self.0.borrow_mut().updated) {
            return None;
        }
        let now = self.change();
        let Inner { logged, span, .. } = &mut *self.0.borrow_mut();
        let moved = (now.gain_percent - logged.gain_percent).abs() > 100.0 * MIN_LOGGED_CHANGE
            || (now.loop_width - logged.loop_width).abs() > MIN_LOGGED_CHANGE * *span
            || (now.zero - logged.zero).abs() > MIN_LOGGED_CHANGE * *span;
        moved.then(|| *logged = now)?;
        Some(now)
    }

    /// Saves the adaptation for the next run.
    pub(super) fn keep(&self, file: &Path) -> CommandResult {
        let Inner { state, kept, model_sha256, .. } = &*self.0.borrow();
        let kept = Kept {
            model_sha256: model_sha256.clone(),
            since_unix_s: kept.as_ref().map_or_else(now_unix_s, |kept| kept.since_unix_s),
            numbers: state.numbers().to_vec(),
        };
        let text = output::json(&kept)?;
        // The next run continues from this file: it replaces that of the earlier run.
        Ok(write_atomic(file, |out| out.write_all(text.as_bytes()))?)
    }
}

impl Kept {
    fn read(file: &Path, model_sha256: &str) -> CommandResult<Self> {
        let name = file.display();
        let text = fs::read_to_string(file).map_err(|error| CommandError::bad_input(format!("{name}: {error}")))?;
        let kept: Self = serde_json::from_str(&text).map_err(|error| {
            CommandError::bad_input(format!("{name}: {error}; give a file that --adapt wrote or a new name"))
        })?;
        let finite = kept.numbers.iter().chain([&kept.since_unix_s]).all(|x| x.is_finite());
        if kept.numbers.len() != NUMBERS || !finite {
            let message = format!("{name}: the field numbers needs {NUMBERS} finite numbers; give a new name");
            return Err(CommandError::bad_input(message));
        }
        if kept.model_sha256 != model_sha256 {
            let message = format!("{name}: this adaptation belongs to another model; give that model or a new name");
            return Err(CommandError::bad_input(message));
        }
        Ok(kept)
    }
}

impl Change {
    /// Returns the difference as a sentence.
    pub(super) fn text(&self, unit: &str) -> String {
        let over = match self.over_s {
            Some(over) if over >= DAY_S => format!(" in {:.0} days", over / DAY_S),
            Some(over) if over >= 3600.0 => format!(" in {:.1} hours", over / 3600.0),
            _ => String::new(),
        };
        format!(
            "gain {:+.2} %{over}, loop wider by {} {unit}, zero {:+.3e} {unit}, relative to the model",
            self.gain_percent,
            text::short(self.loop_width),
            self.zero
        )
    }

    /// Returns metadata of a log.
    pub(super) fn entries(&self) -> BTreeMap<String, String> {
        BTreeMap::from([
            ("gain_percent".to_owned(), self.gain_percent.to_string()),
            ("loop_width".to_owned(), self.loop_width.to_string()),
            ("zero".to_owned(), self.zero.to_string()),
            ("updates".to_owned(), self.updates.to_string()),
        ])
    }
}
