//! Closing the loop with measured data: find what a fitted model leaves over, name the effect that
//! explains it, add it, and show the error before and after.
//!
//! 1. **Search** on a rich rate-independent base (`base/screening.rs`), so that a coarse base model's
//!    own misfit is not taken for an effect: forward with a small beam, then elimination, then swaps.
//!    Every trial refits the whole nested model.
//! 2. **Judge** by cross-validation inside the training record: a block bootstrap must find the gain,
//!    and it must matter against the noise floor and against what is left.
//! 3. **Extend** the user's own model with the effects found, all weights refitted.

mod findings;
mod remainder;
mod score;
mod search;
mod spectrum;
mod starts;
mod trial;
mod uncertainty;

pub use findings::{Alternative, Errors as FoundErrors, Finding, Findings, Found, Remainder, RemainderKind, Verdict};

use crate::base::{Basis, ScreeningBasis};
use crate::fit::{BLOCKS, FitError, basis_of, check, to_model};
use crate::lsq::Blocks;
use crate::model::{Effect, Effects, Model};
use crate::nested::Problem;
use crate::record::Record;
use crate::samples::Samples;
use crate::simulate::{Zero, simulate};

/// What a diagnosis may be told.
#[derive(Clone, Copy, Debug)]
pub struct DiagnoseOptions {
    /// What is done with the sensor's zero.
    pub zero: Zero,
    /// Seed of the bootstrap.
    pub seed: u64,
}

impl Default for DiagnoseOptions {
    fn default() -> Self {
        Self { zero: Zero::None, seed: 1 }
    }
}

/// A diagnosis: the extended model and how it was found.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// The user's model with every effect that was found; the same model if none was.
    pub extended: Model,
    /// What was found, with evidence.
    pub findings: Findings,
}

/// Rows that the search needs for each unknown of its base: with fewer, noise looks like an effect.
const ROWS_PER_UNKNOWN: usize = 10;
/// Rows that the search uses at most.
const SEARCH_ROWS: usize = 16_000;
/// Rows that the final fit uses at most.
const FINAL_ROWS: usize = 40_000;

/// Diagnoses a model on the record that it was fitted to; `test` is only simulated, never fitted.
/// `progress` is told what is being done.
///
/// # Errors
/// See [`FitError`].
pub fn diagnose(
    train: &Record,
    test: Option<&Record>,
    model: &Model,
    options: &DiagnoseOptions,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Diagnosis, FitError> {
    let before = simulate(model, train, options.zero)?;
    let mut samples = Samples::from_record(train);
    check(train, &samples, true)?;
    samples.settling.clone_from(&before.settling);
    let stage = |source| FitError::Stage { record: train.name(), source };
    let per_record = options.zero == Zero::PerRecord;

    let screening = ScreeningBasis::for_samples(&samples);
    let (rows, needed) = (samples.settling.iter().filter(|s| !**s).count(), ROWS_PER_UNKNOWN * screening.len());
    if rows < needed {
        return Err(FitError::TooShort { record: train.name(), rows, unknowns: screening.len(), needed });
    }
    let blocks = Blocks::new(&samples, BLOCKS, SEARCH_ROWS);
    let problem = Problem::new(&samples, &screening, &blocks, per_record);
    let base =
        problem.fit(&model.effects).map_err(stage)?.ok_or_else(|| FitError::Unsolvable { record: train.name() })?;
    let found = search::search(&problem, base, options.seed, progress).map_err(stage)?;

    progress("refitting the model with what was found");
    let effects = &found.best.fit.effects;
    let errors = uncertainty::standard_errors(&found.best.fit);
    let mut extended = model.clone();
    if effects.names() != model.effects.names() {
        // The effects keep the parameters that the rich base gave them: refitted on a coarser base
        // they would take up its misfit. Only the base's weights and the zero are solved again.
        let own = basis_of(model, &samples)?;
        let motion_only = without_sensor_effects(&samples, effects);
        let final_blocks = Blocks::new(&samples, BLOCKS, FINAL_ROWS);
        let final_problem = Problem::new(&motion_only, own.as_ref(), &final_blocks, per_record);
        let moving = Effects { drift: None, interference: None, ..effects.clone() };
        let fit = final_problem
            .fit_linear(&moving)
            .map_err(stage)?
            .ok_or_else(|| FitError::Unsolvable { record: train.name() })?;
        // Its reach is that of the motion, not of the sensor.
        extended = to_model(train, &motion_only, &own, &fit, model.seed);
        extended.effects.clone_from(effects);
        extended.std_errors.clone_from(&errors);
    }

    progress("judging what is left");
    let after = simulate(&extended, train, options.zero)?;
    let remainder = remainder::judge(&problem, &found, &after, &samples, per_record).map_err(stage)?;
    let tests = test
        .map(|t| Ok::<_, FitError>((simulate(model, t, options.zero)?, simulate(&extended, t, options.zero)?)))
        .transpose()?;
    let findings = findings::collect(&findings::Material {
        model,
        extended: &extended,
        found: &found,
        errors: &errors,
        before: &before,
        after: &after,
        tests: tests.as_ref(),
        remainder,
        zero: options.zero,
        samples: &samples,
    });
    Ok(Diagnosis { extended, findings })
}

/// The record with drift and tone taken from its output.
fn without_sensor_effects(samples: &Samples, effects: &Effects) -> Samples {
    let mut motion = samples.clone();
    for (k, y) in motion.output.iter_mut().enumerate() {
        let t = samples.time[k];
        if let Some(drift) = effects.drift {
            *y -= drift.per_second * t;
        }
        if let Some(tone) = effects.interference {
            *y -= tone.amplitude * (2.0 * std::f64::consts::PI * (tone.hz * t).fract() + tone.phase).sin();
        }
    }
    motion
}

/// Whether a record can show an effect at all.
fn visible(effect: Effect, samples: &Samples) -> bool {
    match effect {
        Effect::Temperature => samples.temperature.as_ref().is_some_and(|t| {
            let (low, high) = crate::samples::range(t.iter().copied());
            high - low > 0.5
        }),
        _ => true,
    }
}
