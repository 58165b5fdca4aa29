//! Simulates the prediction of a model for a record.

use hyst_core::CreepParams;
use serde::{Deserialize, Serialize};

use crate::creep_rest::{self, Estimate};
use crate::criteria::MIN_RMSE_DROP;
use crate::drive::{Drive, Passes};
use crate::error::FitError;
use crate::memory;
use crate::metrics::Errors;
use crate::model::{HostChain, Model};
use crate::record::{OutputUnit, Record};
use crate::samples::{PerSegment, Samples};
use crate::settle::{centre, first_cycles, start_up_rows, started, windows};
use crate::statistics::range;
use crate::tone_phase;

/// How the sensor's zero is treated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Zero {
    /// The model's zero is used.
    #[default]
    None,
    /// A constant per file is estimated and added to the prediction.
    PerRecord,
}

/// Options of a simulation.
#[derive(Clone, Copy, Debug, Default)]
pub struct SimulateOptions {
    /// How the sensor's zero is treated.
    pub zero: Zero,
    /// Temperature \[°C\] for a record without a temperature column.
    pub temperature: Option<f64>,
    /// Whether each segment is one period of a steady state.
    /// It passes the model twice, and the second pass counts.
    pub periodic: bool,
    /// Whether a creep starts at rest regardless of the first rows.
    /// Needed if an unknown force moves the output too.
    pub at_rest: bool,
}

/// Inputs outside of the range that a model was fitted to.
/// The prediction for them is an extrapolation.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Extrapolated {
    /// Rows with such an input.
    pub rows: usize,
    /// Largest distance from the range \[input unit\].
    pub largest: f64,
    /// Row of the largest distance, from 0.
    pub row: usize,
}

impl Extrapolated {
    /// Finds the inputs outside of the range that `model` was fitted to.
    pub fn of(model: &Model, input: &[f64]) -> Self {
        let mut found = Self::default();
        for (row, u) in input.iter().enumerate() {
            let beyond = (u - model.input.high).max(model.input.low - u);
            if beyond > 0.0 {
                found.rows += 1;
                if beyond > found.largest {
                    (found.largest, found.row) = (beyond, row);
                }
            }
        }
        found
    }
}

/// Prediction of a model for a record.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Simulation {
    /// Output \[output unit\], per row.
    pub predicted: Vec<f64>,
    /// Rows that do not count: start-up rows, and rows in which the sensor is saturated or has a spike.
    pub settling: Vec<bool>,
    /// Constant added per file; empty with [`Zero::None`].
    pub zeros: Vec<f64>,
    /// Errors against the measured output, if there is one.
    pub errors: Option<Errors>,
    /// Phase lead \[rad\] of the model's tone in each file, estimated from its first rows.
    /// It is 0 if the clock continues.
    pub tone_ahead: Vec<f64>,
    /// Initial deviation of the creep in each segment \[output unit\].
    /// It is the level of the earlier rest minus the motion in the first row, and 0 if the segment starts at rest.
    pub creep_away: Vec<f64>,
    /// Inputs outside of the model's range.
    pub extrapolated: Extrapolated,
    /// Segments that do not start at rest, but after drive reversals from before the record or after a cycle like their
    /// first one.
    pub(crate) in_mid_cycle: Vec<bool>,
}

/// Simulates a model over a record at the recorded temperatures, as [`simulate_with`] does.
///
/// # Errors
/// As [`simulate_with`].
pub fn simulate(model: &Model, record: &Record, zero: Zero) -> Result<Simulation, FitError> {
    simulate_with(model, record, &SimulateOptions { zero, ..SimulateOptions::default() })
}

/// Simulates a model over a record.
///
/// The memory of each segment starts virgin. If the first rows show another state, the segment starts from the state
/// that leaves fewer start-up rows: after the last drive reversals, or after its own first cycle. The phase of a tone
/// is estimated from the first rows of each file, the initial state of a creep from those of each segment. The model's
/// file says how the drive is interpolated between samples.
///
/// # Errors
/// If the record lacks a column that the model uses, or its units differ from the model's.
pub fn simulate_with(model: &Model, record: &Record, options: &SimulateOptions) -> Result<Simulation, FitError> {
    let mut samples = Samples::from_record(record).at_temperature(options.temperature);
    check(model, record, &samples)?;
    let passes = if options.periodic { Passes::Periodic } else { Passes::Once };
    let drive = Drive::new(&samples, model.between_samples, passes);
    let chain = drive
        .stages(|sampling| model.build(sampling.period))
        .map_err(|source| FitError::Stage { record: record.name(), source })?;
    let mut predicted = vec![0.0; samples.len()];
    drive.run(&chain, &mut predicted);
    let mut zeros = Vec::new();
    let mut errors = None;
    let mut tone_ahead = vec![0.0; record.sources().len()];
    let mut creep_away = vec![0.0; samples.segments.len()];
    let mut in_mid_cycle = vec![false; samples.segments.len()];
    let mut settling = samples.settling.clone();
    if let Some(output) = record.output() {
        let tone = model.effects.interference.filter(|tone| tone.amplitude > 0.0);
        let files = record.rows_of_files();
        let less = |y: &[f64], p: &[f64]| -> Vec<f64> { y.iter().zip(p).map(|(y, p)| y - p).collect() };
        // A tone with a wrong phase would hide the start of the memory.
        let in_phase = |samples: &Samples, predicted: &[f64], settling: &[bool], ahead: &mut Vec<f64>| {
            let Some(tone) = &tone else { return vec![0.0; output.len()] };
            *ahead = tone_phase::ahead(samples, tone, &less(output, predicted), settling, &files);
            tone_phase::change(samples, tone, ahead, &files)
        };
        let turned = in_phase(&samples, &predicted, &samples.settling, &mut tone_ahead);
        samples.output = less(output, &turned);
        let measured = samples.output.clone();
        let missed = |predicted: &[f64]| less(&measured, predicted);
        let mut residual = missed(&predicted);
        samples.mark_spikes(&residual);
        settling = start_up_rows(&samples, &residual);
        let starts = started(&samples, &settling);
        let asked = memory::standing_out(&samples, &residual);
        // A period of a steady state has its own history.
        if !options.periodic && (starts.contains(&true) || asked.contains(&true)) {
            let from_rest = residual.clone();
            let drive = || Drive::new(&samples, model.between_samples, passes);
            let mut others = Vec::new();
            // The drive may have reversed before the record started, ...
            let creep = model.effects.creep.as_ref().filter(|_| !options.at_rest);
            let beginnings = Beginnings { asked: &asked, starts: &starts };
            let pasts = recalled(&samples, &from_rest, &drive(), &chain, &beginnings, creep);
            if pasts.iter().any(|past| !past.is_empty()) {
                let mut turned = vec![0.0; samples.len()];
                drive().run_from(&chain, |s, i, env, u0| chain.of(i).reset_after(s, env, u0, &pasts[i]), &mut turned);
                others.push(turned);
            }
            // ... or it was cycled as in the segment itself.
            let history = histories(&samples, &starts);
            if history.iter().any(|rows| *rows > 0) {
                let mut cycled = vec![0.0; samples.len()];
                drive().after(history).run(&chain, &mut cycled);
                others.push(cycled);
            }
            for other in others {
                let (left, now) = (missed(&other), start_up_rows(&samples, &missed(&predicted)));
                let after = start_up_rows(&samples, &left);
                for (segment, in_mid_cycle) in samples.segments.iter().zip(&mut in_mid_cycle) {
                    let starting = |rows: &[bool]| rows[segment.clone()].iter().filter(|s| **s).count();
                    // The error of the rows that the model follows from rest must not grow.
                    let squares = |residual: &[f64]| {
                        segment.clone().filter(|k| !settling[*k]).map(|k| residual[k] * residual[k]).sum::<f64>()
                    };
                    let (fewer, as_many) = (starting(&after) < starting(&now), starting(&after) == starting(&now));
                    let enough = if as_many { (1.0 - MIN_RMSE_DROP).powi(2) } else { 1.0 };
                    if (fewer || as_many) && squares(&left) <= enough * squares(&from_rest) {
                        predicted[segment.clone()].copy_from_slice(&other[segment.clone()]);
                        *in_mid_cycle = true;
                    }
                }
            }
            residual = missed(&predicted);
            settling = start_up_rows(&samples, &residual);
        }
        // A creep from before the record continues in it.
        if let Some(creep) = model.effects.creep.as_ref().filter(|_| !options.periodic && !options.at_rest) {
            let (low, high) = range(predicted.iter().copied());
            let zero_is_known = options.zero == Zero::None;
            let estimate = Estimate { samples: &samples, creep, span: high - low, zero_is_known };
            let (rest, left, now) = estimate.continued(&residual, &settling);
            predicted.iter_mut().zip(rest.added).for_each(|(p, rest)| *p += rest);
            creep_away = rest.away;
            (residual, settling) = (left, now);
        }
        if tone.is_some() {
            let turned = in_phase(&samples, &predicted, &settling, &mut tone_ahead);
            predicted.iter_mut().zip(turned).for_each(|(p, turned)| *p += turned);
            residual = less(output, &predicted);
            settling = start_up_rows(&samples, &residual);
        }
        if options.zero == Zero::PerRecord {
            for rows in files {
                let settled = || rows.clone().filter(|k| !settling[*k]);
                let mean = settled().map(|k| residual[k]).sum::<f64>() / settled().count().max(1) as f64;
                predicted[rows.clone()].iter_mut().for_each(|p| *p += mean);
                zeros.push(mean);
            }
        }
        errors = Some(
            Errors::of(output, &predicted, &settling)
                .map_err(|source| FitError::Compare { record: record.name(), source })?,
        );
    }
    let extrapolated = Extrapolated::of(model, &samples.input);
    Ok(Simulation { predicted, settling, zeros, errors, tone_ahead, creep_away, extrapolated, in_mid_cycle })
}

/// Returns the number of rows of the first cycle of each segment with start-up rows.
fn histories(samples: &Samples, starts: &[bool]) -> Vec<usize> {
    first_cycles(samples)
        .into_iter()
        .zip(starts)
        .map(|(cycle, starts)| cycle.filter(|_| *starts).unwrap_or(0))
        .collect()
}

/// Segments whose drive history is estimated, and segments with start-up rows.
struct Beginnings<'a> {
    asked: &'a [bool],
    starts: &'a [bool],
}

/// Returns the drive history after which the model follows the first rows of each segment best. `residual` is the
/// residual of a start from rest.
fn recalled(
    samples: &Samples,
    residual: &[f64],
    drive: &Drive<'_>,
    chain: &PerSegment<HostChain>,
    of: &Beginnings<'_>,
    creep: Option<&CreepParams<Vec<f64>>>,
) -> Vec<Vec<f64>> {
    let windows = windows(samples);
    let (centred, away) = (centre(samples, residual, &windows, &samples.blind), memory::away(samples));
    let past = |i: usize| -> Vec<f64> {
        let rows = samples.segments[i].start..samples.segments[i].start + windows[i];
        if !(of.asked[i] || of.starts[i]) || rows.is_empty() {
            return Vec::new();
        }
        let zero = residual[rows.start] - centred[rows.start];
        // The initial creep is a further unknown of the same rows.
        let nothing = || vec![0.0; windows[i]];
        let unit = creep.map_or_else(nothing, |creep| creep_rest::column(creep, 0.0, samples.period_of(i), windows[i]));
        let squares = |past: &[f64]| -> f64 {
            let chain = chain.of(i);
            let output =
                drive.beginning(i, windows[i], chain, |state, env, u0| chain.reset_after(state, env, u0, past));
            let left = rows.clone().zip(output).filter(|(k, _)| !samples.blind[*k]);
            let left = left.map(|(k, v)| (k, samples.output[k] - zero - v));
            let left: Vec<(f64, f64)> = left.map(|(k, r)| (unit[k - rows.start], r)).collect();
            let all: f64 = left.iter().map(|(_, r)| r * r).sum();
            all - creep_rest::fitted(left.into_iter(), samples.output_span()).map_or(0.0, |(_, taken)| taken)
        };
        let level = memory::level(samples, &centred, &windows, i);
        let mut candidates = memory::Candidates::new(samples.input[rows.start], samples.input_range());
        memory::continued(samples, i).into_iter().for_each(|past| candidates.add(past));
        candidates.best(level, away[i] && of.starts[i], squares)
    };
    (0..of.asked.len()).map(past).collect()
}

/// Returns what to do if the output of a record is in this unit instead of the model's.
pub(crate) fn other_unit(unit: OutputUnit) -> String {
    format!(
        "it has {} instead: convert its values and rename the column, or fit a model to records in that unit",
        unit.column()
    )
}

fn check(model: &Model, record: &Record, samples: &Samples) -> Result<(), FitError> {
    let missing =
        |column: &str, advice: String| Err(FitError::Missing { record: record.name(), column: column.into(), advice });
    if record.input().is_empty() || record.input_column() != model.input.column {
        return missing(&model.input.column, "the model was fitted with it; use --map if it has another name".into());
    }
    if let Some(unit) = record.output_unit().filter(|u| u.column() != model.output.column) {
        return missing(&model.output.column, other_unit(unit));
    }
    match model.lacking(samples) {
        Some((column, why)) => missing(column, why.into()),
        None => Ok(()),
    }
}
