//! `--adapt`: the inverse aims at what the measured output, against the predicted one, asks for.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::rc::Rc;
use std::time::{SystemTime, UNIX_EPOCH};

use hyst_core::{Adaptation, AdaptationOptions, Adapted};
use hyst_ident::BetweenSamples;
use hyst_ident::model::Model;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use crate::exit::{CommandError, CommandResult};
use crate::output::{self, Target};
use crate::text;

/// Plays between predicted and measured output, and all numbers: gain, weights, zero.
const PLAYS: usize = 4;
const NUMBERS: usize = PLAYS + 2;

/// Least and greatest residual of a model that an update is weighed by, as a share of its output's range: a fit to a record of its own knows less than it says.
const SIGMA: (f64, f64) = (1e-3, 0.05);
/// A change is logged from this share on, of the gain or of the output's range.
const LOGGED: f64 = 0.005;
const DAY_S: f64 = 86_400.0;

/// What is adapted, by the computation of the drive and by the model beside the device.
#[derive(Clone, Debug)]
pub(in crate::commands) struct Adapting(Rc<RefCell<Inner>>);

#[derive(Debug)]
struct Inner {
    how: Adaptation<f64, PLAYS, NUMBERS>,
    state: Adapted<f64, PLAYS, NUMBERS>,
    span: f64,
    /// Whether the estimate was updated since the change was looked at.
    updated: bool,
    logged: Change,
    /// What an earlier run knew.
    kept: Option<Kept>,
    model_sha256: String,
}

/// How the actuator differs from its model.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub(super) struct Change {
    /// Of a stroke over the whole range \[%\].
    pub(super) gain_percent: f64,
    /// How much wider the loop of such a stroke is, in its middle \[output unit\].
    pub(super) loop_width: f64,
    /// \[output unit\]
    pub(super) zero: f64,
    /// Updates of the estimate.
    pub(super) updates: u32,
    /// Since the first run of the kept adaptation \[s\]; none of a run on its own.
    pub(super) over_s: Option<f64>,
}

/// A file of what was learned.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Kept {
    /// Of the model's file.
    model_sha256: String,
    /// When the first run began, in seconds since 1970.
    since_unix_s: f64,
    /// Gain, weights of the plays, zero over the output's range.
    numbers: Vec<f64>,
}

fn now_unix_s() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64())
}

impl Adapting {
    /// For a model; from what `file` keeps, if it is there.
    pub(super) fn new(model: &Model, json: &str, file: Option<&Path>) -> CommandResult<Self> {
        if model.between_samples != BetweenSamples::Linear {
            return Err(CommandError::bad_input(
                "--adapt needs a model that can be run as the drive comes; this one has to know all of it (band-limited)",
            ));
        }
        let range = (model.output.low, model.output.high);
        let span = range.1 - range.0;
        let sigma = model.rmse.map_or(SIGMA.1, |rmse| (rmse / span).clamp(SIGMA.0, SIGMA.1));
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

    /// Where the inverse has to aim to reach `reference`; whether a segment begins with it.
    pub(super) fn aim(&self, begins: bool, reference: f64) -> f64 {
        let Inner { how, state, .. } = &mut *self.0.borrow_mut();
        if begins {
            how.aim_anew(state);
        }
        how.aim(state, reference)
    }

    /// The device was at rest, and so is the model.
    pub(super) fn begin_segment(&self) {
        let Inner { how, state, .. } = &mut *self.0.borrow_mut();
        how.see_anew(state);
    }

    /// Takes the zero that the sensor has before a reference begins \[output unit\].
    pub(super) fn zero(&self, zero: f64) {
        let Inner { how, state, .. } = &mut *self.0.borrow_mut();
        how.set_zero(state, zero);
    }

    /// Takes a sample, and gives the output that was expected.
    pub(super) fn take(&self, predicted: f64, measured: f64, trusted: bool) -> f64 {
        let Inner { how, state, updated, .. } = &mut *self.0.borrow_mut();
        *updated |= how.learn(state, predicted, measured, trusted);
        how.expected(state, predicted).unwrap_or(predicted)
    }

    /// How the actuator differs from its model by now.
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

    /// The same, if it is another one than was given last.
    pub(super) fn news(&self) -> Option<Change> {
        if !std::mem::take(&mut self.0.borrow_mut().updated) {
            return None;
        }
        let now = self.change();
        let Inner { logged, span, .. } = &mut *self.0.borrow_mut();
        let moved = (now.gain_percent - logged.gain_percent).abs() > 100.0 * LOGGED
            || (now.loop_width - logged.loop_width).abs() > LOGGED * *span
            || (now.zero - logged.zero).abs() > LOGGED * *span;
        moved.then(|| *logged = now)?;
        Some(now)
    }

    /// Keeps what was learned for the next run.
    pub(super) fn keep(&self, file: &Path) -> CommandResult {
        let Inner { state, kept, model_sha256, .. } = &*self.0.borrow();
        let kept = Kept {
            model_sha256: model_sha256.clone(),
            since_unix_s: kept.as_ref().map_or_else(now_unix_s, |kept| kept.since_unix_s),
            numbers: state.numbers().to_vec(),
        };
        let text = output::json(&kept)?;
        Target::File(file.to_owned()).write(|out| out.write_all(text.as_bytes()))
    }
}

impl Kept {
    fn read(file: &Path, model_sha256: &str) -> CommandResult<Self> {
        let name = file.display();
        let text = fs::read_to_string(file).map_err(|error| CommandError::bad_input(format!("{name}: {error}")))?;
        let kept: Self = serde_json::from_str(&text).map_err(|error| {
            CommandError::bad_input(format!("{name}: {error}; give a file that --adapt wrote, or a new name"))
        })?;
        let finite = kept.numbers.iter().chain([&kept.since_unix_s]).all(|x| x.is_finite());
        if kept.numbers.len() != NUMBERS || !finite {
            let message = format!("{name}: numbers has to hold {NUMBERS} finite numbers; give a new name");
            return Err(CommandError::bad_input(message));
        }
        if kept.model_sha256 != model_sha256 {
            let message = format!(
                "{name}: this was learned beside another model; give that model, or a new name for what this one lacks"
            );
            return Err(CommandError::bad_input(message));
        }
        Ok(kept)
    }
}

impl Change {
    /// In words.
    pub(super) fn text(&self, unit: &str) -> String {
        let over = match self.over_s {
            Some(over) if over >= DAY_S => format!(" in {:.0} days", over / DAY_S),
            Some(over) if over >= 3600.0 => format!(" in {:.1} hours", over / 3600.0),
            _ => String::new(),
        };
        format!(
            "gain {:+.2} %{over}, loop wider by {} {unit}, zero {:+.3e} {unit}, against the model",
            self.gain_percent,
            text::short(self.loop_width),
            self.zero
        )
    }

    /// As a log has it.
    pub(super) fn entries(&self) -> BTreeMap<String, String> {
        BTreeMap::from([
            ("gain_percent".to_owned(), self.gain_percent.to_string()),
            ("loop_width".to_owned(), self.loop_width.to_string()),
            ("zero".to_owned(), self.zero.to_string()),
            ("updates".to_owned(), self.updates.to_string()),
        ])
    }
}
