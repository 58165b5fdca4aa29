//! `compensate`: the drive that makes the actuator follow a reference.

use hyst_core::{CompensatorOptions, Limits, Sampling, Stage};

use crate::model::Model;
use crate::record::Record;
use crate::samples::Samples;

/// What a compensation may be told.
#[derive(Clone, Copy, Debug)]
pub struct CompensateOptions {
    /// Voltage limits \[V\]; the range of the record that the model was fitted to, if not given.
    pub voltage: Option<(f64, f64)>,
    /// Slew limit \[V/s\]; infinite for none.
    pub slew: f64,
    /// Band in which lag, delay and resonances are inverted \[Hz\]; chosen if not given.
    pub bandwidth_hz: Option<f64>,
}

impl Default for CompensateOptions {
    fn default() -> Self {
        Self { voltage: None, slew: f64::INFINITY, bandwidth_hz: None }
    }
}

/// A drive, and what it took to get it.
#[derive(Clone, Debug)]
pub struct Drive {
    /// Input of the actuator at the reference's rows \[V\].
    pub voltage: Vec<f64>,
    /// Samples of preview that were used; the reference's ends are held for that long.
    pub lead: usize,
    /// Band in which the dynamic stages are inverted \[Hz\]; `None` if there are none.
    pub bandwidth_hz: Option<f64>,
    /// Largest relative error of that inversion inside its band.
    pub band_error: f64,
    /// Rows at which the voltage limit acted.
    pub voltage_limited: Vec<usize>,
    /// Rows at which the slew limit acted.
    pub slew_limited: Vec<usize>,
}

/// Why a reference cannot be compensated.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CompensateError {
    /// Beyond the stroke.
    #[error(
        "{record}: row {row} (time {time} s): {value} {unit} is outside what the actuator reaches, {low:.6} to {high:.6} {unit}; scale or shift the reference"
    )]
    OutOfReach {
        /// The reference.
        record: String,
        /// First such row, from 0.
        row: usize,
        /// Its time \[s\].
        time: f64,
        /// The value there.
        value: f64,
        /// Unit of the values.
        unit: String,
        /// Lowest output that the training record reached.
        low: f64,
        /// Highest output that the training record reached.
        high: f64,
    },
    /// A column is needed.
    #[error("{record}: column {column} is missing; {advice}")]
    Missing {
        /// The reference.
        record: String,
        /// The column.
        column: String,
        /// What to do.
        advice: String,
    },
    /// The model has no inverse at this sample rate, or an option is out of range.
    #[error("{0}")]
    Inverse(#[from] hyst_core::Error),
}

/// Margin on the reach, as a share of the stroke: noise and drift moved the record's own ends.
const MARGIN: f64 = 0.01;

/// Inverts the model along a reference.
///
/// # Errors
/// See [`CompensateError`].
pub fn compensate(model: &Model, reference: &Record, options: &CompensateOptions) -> Result<Drive, CompensateError> {
    let samples = Samples::from_record(reference);
    check(model, reference, &samples)?;
    let compensator =
        Box::new(model.compensator(samples.period, &CompensatorOptions { bandwidth_hz: options.bandwidth_hz })?);
    let (low, high) = options.voltage.unwrap_or((model.input.low, model.input.high));
    let limits = Limits::new(low, high, options.slew, &Sampling { period: samples.period })?;
    let lead = compensator.lead();
    let mut drive = Drive {
        voltage: vec![0.0; samples.len()],
        lead,
        bandwidth_hz: compensator.bandwidth_hz(),
        band_error: compensator.error(),
        voltage_limited: Vec::new(),
        slew_limited: Vec::new(),
    };
    let mut state = Box::new(compensator.state());
    for segment in &samples.segments {
        let last = segment.end - 1;
        let first = compensator.reset(&mut state, &samples.env(segment.start), samples.output[segment.start]);
        if lead == 0 {
            drive.voltage[segment.start] = first;
        }
        for ahead in segment.start + 1..segment.end + lead {
            let row = ahead.min(last);
            let wanted = compensator.step(&mut state, &samples.env(row), samples.output[row]);
            if ahead >= segment.start + lead {
                drive.voltage[ahead - lead] = wanted;
            }
        }
        let mut before = drive.voltage[segment.start];
        for row in segment.clone() {
            let limited = limits.apply(before, drive.voltage[row]);
            before = limited.drive;
            drive.voltage[row] = limited.drive;
            if limited.voltage {
                drive.voltage_limited.push(row);
            }
            if limited.slew {
                drive.slew_limited.push(row);
            }
        }
    }
    Ok(drive)
}

fn check(model: &Model, reference: &Record, samples: &Samples) -> Result<(), CompensateError> {
    let missing = |column: &str, advice: &str| {
        Err(CompensateError::Missing { record: reference.name(), column: column.into(), advice: advice.into() })
    };
    if reference.output_unit().is_none_or(|u| u.column() != model.output.column) {
        return missing(
            &model.output.column,
            "the reference must be in the output that the model was fitted to; use --map if it has another name",
        );
    }
    if model.needs_temperature() && reference.temperature().is_none() {
        return missing("temperature_degc", "the model's gain depends on it");
    }
    let (low, high) = (model.output.low, model.output.high);
    let margin = MARGIN * (high - low);
    match samples.output.iter().position(|y| *y < low - margin || *y > high + margin) {
        Some(row) => Err(CompensateError::OutOfReach {
            record: reference.name(),
            row,
            time: samples.time[row],
            value: samples.output[row],
            unit: model.output.unit.clone(),
            low,
            high,
        }),
        None => Ok(()),
    }
}
