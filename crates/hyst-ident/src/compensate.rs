//! `compensate`: computes the drive that makes the actuator follow a reference, for a whole reference or sample by
//! sample while the actuator runs.

use std::ops::Range;

use hyst_core::{CompensatorOptions, CompensatorState, Env, Limited, Limits, Sampling, Stage};

use crate::model::capacity::{CREEP, TAPS};
use crate::model::{Compensator, InverseState, Model};
use crate::record::{Record, RecordError};
use crate::samples::Samples;
use crate::settle::start_up_rows;
use crate::simulate::other_unit;

/// Options of a compensation.
#[derive(Clone, Copy, Debug)]
pub struct CompensateOptions {
    /// Voltage limits \[V\]; if not given, the range of the record that the model was fitted to.
    pub voltage: Option<(f64, f64)>,
    /// Slew limit \[V/s\]; infinite for none.
    pub slew: f64,
    /// Band in which lag, delay and resonances are inverted \[Hz\]; chosen if not given.
    pub bandwidth_hz: Option<f64>,
    /// Temperature \[°C\] if the reference has no temperature column.
    pub temperature: Option<f64>,
}

impl Default for CompensateOptions {
    fn default() -> Self {
        Self { voltage: None, slew: f64::INFINITY, bandwidth_hz: None, temperature: None }
    }
}

/// A drive and its properties.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Drive {
    /// Input of the actuator at the rows of the reference \[V\].
    pub voltage: Vec<f64>,
    /// Preview \[samples\]; the ends of the reference are held for that long.
    pub lead: usize,
    /// Band in which the dynamic stages are inverted \[Hz\]; `None` if there are none.
    pub bandwidth_hz: Option<f64>,
    /// Largest relative error of that inversion inside its band.
    pub band_error: f64,
    /// Lowest and highest allowed voltage \[V\].
    pub limits: (f64, f64),
    /// Rows at which the voltage limit acted.
    pub voltage_limited: Vec<usize>,
    /// Rows at which the slew limit acted.
    pub slew_limited: Vec<usize>,
    /// Tracking error of the model with this drive.
    pub missed: Missed,
}

/// Tracking error: reference minus the output of the model for a drive, without sensor effects.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Missed {
    /// Root mean square \[output unit\].
    pub rmse: f64,
    /// Maximum \[output unit\].
    pub largest: f64,
    /// Row of the maximum, from 0.
    pub row: usize,
    /// Number of start-up rows: the drive starts at rest, but a reference that already moves, or an inverse with
    /// preview, requires a motion before the first row.
    pub settling_rows: usize,
    /// Root mean square over the other rows \[output unit\].
    pub settled_rmse: f64,
    /// Maximum over the other rows \[output unit\].
    pub settled_largest: f64,
}

/// Errors of the compensation of a reference.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum CompensateError {
    /// The reference is not usable.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The reference is outside the stroke.
    #[error(
        "{record}: row {} (time {time:.6} s): {value:.6} {unit} is outside what the actuator reaches, {low:.6} to {high:.6} {unit}; scale or shift the reference", row + 1
    )]
    OutOfReach {
        /// The reference.
        record: String,
        /// First such row, from 0.
        row: usize,
        /// Time of the row \[s\].
        time: f64,
        /// Value of the row.
        value: f64,
        /// Unit of the values.
        unit: String,
        /// Lowest output of the actuator.
        low: f64,
        /// Highest output of the actuator.
        high: f64,
    },
    /// A column is missing.
    #[error("{record}: column {column} is missing; {advice}")]
    Missing {
        /// The reference.
        record: String,
        /// The column.
        column: String,
        /// What to do.
        advice: String,
    },
    /// The band is too wide for the sample rate.
    #[error(
        "--bandwidth {hz} Hz is more than {limit} Hz, a quarter of the sample rate of {record}; give a lower bandwidth, or sample the reference faster"
    )]
    Bandwidth {
        /// The reference.
        record: String,
        /// Requested band \[Hz\].
        hz: f64,
        /// Widest possible band \[Hz\].
        limit: f64,
    },
    /// The model has no inverse at this sample rate, or an option is out of range.
    #[error("{0}")]
    Inverse(#[from] hyst_core::Error),
}

/// Distance from the drive's range to the limits of an "unlimited" drive, as a multiple of the range.
const UNLIMITED_RANGES: f64 = 100.0;
/// Margin on the stroke, as a share of it: noise and drift changed the ends of the record too.
const STROKE_MARGIN: f64 = 0.01;

/// Computes the drive for a reference with the inverse of the model.
///
/// # Errors
/// See [`CompensateError`].
pub fn compensate(model: &Model, reference: &Record, options: &CompensateOptions) -> Result<Drive, CompensateError> {
    let mut follower = Follower::new(model, reference, options)?;
    let mut drive = follower.stated();
    for segment in follower.segments().to_vec() {
        for row in segment {
            let limited = follower.next(None);
            drive.voltage.push(limited.drive);
            if limited.voltage {
                drive.voltage_limited.push(row);
            }
            if limited.slew {
                drive.slew_limited.push(row);
            }
        }
    }
    drive.missed = tracking_error(model, &mut follower, &drive.voltage)?;
    Ok(drive)
}

/// Returns the tracking error of the model for a drive.
fn tracking_error(model: &Model, follower: &mut Follower, drive: &[f64]) -> Result<Missed, CompensateError> {
    let predicted = follower.predicted(model, drive)?;
    let residual: Vec<f64> = follower.samples.output.iter().zip(predicted).map(|(wanted, y)| wanted - y).collect();
    // A reference has no input: the start-up rows are found from the drive.
    follower.samples.input = drive.to_vec();
    let settling = start_up_rows(&follower.samples, &residual);
    let mut missed = Missed { settling_rows: settling.iter().filter(|s| **s).count(), ..Missed::default() };
    let (mut all, mut settled) = (0.0, 0.0);
    for (row, (error, settling)) in residual.iter().map(|r| r.abs()).zip(settling).enumerate() {
        all += error * error;
        if error > missed.largest {
            (missed.largest, missed.row) = (error, row);
        }
        if !settling {
            settled += error * error;
            missed.settled_largest = missed.settled_largest.max(error);
        }
    }
    missed.rmse = (all / drive.len().max(1) as f64).sqrt();
    missed.settled_rmse = (settled / (drive.len() - missed.settling_rows).max(1) as f64).sqrt();
    Ok(missed)
}

/// Compensation sample by sample, for a device whose temperature is only known at run time.
#[derive(Debug)]
pub struct Follower {
    compensator: Box<Compensator>,
    state: Box<State>,
    limits: Limits<f64>,
    /// Lowest and highest voltage \[V\].
    range: (f64, f64),
    samples: Samples,
    row: usize,
    segment: usize,
    before: f64,
    /// Voltage at which the actuator is held before each segment \[V\]; empty if unknown.
    held: Vec<f64>,
    /// Present offset of the drive, because the actuator was held at another voltage \[V\].
    offset: f64,
    /// Decrease of the offset per row \[V\].
    fade: f64,
}

type State = CompensatorState<f64, InverseState, CREEP, TAPS>;

impl Follower {
    /// Prepares to follow a reference from its first row.
    ///
    /// # Errors
    /// See [`CompensateError`].
    pub fn new(model: &Model, reference: &Record, options: &CompensateOptions) -> Result<Self, CompensateError> {
        reference.need_one_sample_period("a reference")?;
        let samples = Samples::from_record(reference).at_temperature(options.temperature);
        check(model, reference, &samples, options)?;
        let own = CompensatorOptions { bandwidth_hz: options.bandwidth_hz };
        // Rounded, because the period comes from a time column and the limit is printed.
        let limit = (0.25e6 / samples.period).round() / 1e6;
        let compensator = model.compensator(samples.period, &own).map_err(|why| match (why, options.bandwidth_hz) {
            // A model without dynamics needs no band and accepts any.
            (hyst_core::Error::OutOfRange { name: "preview band", .. }, Some(hz)) if hz > limit => {
                CompensateError::Bandwidth { record: reference.name(), hz, limit }
            }
            (why, _) => why.into(),
        });
        let compensator = Box::new(compensator?);
        let (low, high) = options.voltage.unwrap_or((model.input.low, model.input.high));
        let limits = Limits::new(low, high, options.slew, &Sampling { period: samples.period })?;
        let state = Box::new(compensator.state());
        Ok(Self {
            compensator,
            state,
            limits,
            range: (low, high),
            samples,
            row: 0,
            segment: 0,
            before: 0.0,
            held: Vec::new(),
            offset: 0.0,
            fade: 0.0,
        })
    }

    /// Starts each segment from the voltage `held` \[V\] at which the actuator is held, the first drive of a plan. The
    /// measured temperature may require another voltage; the difference then decreases at `slew` \[V/s\] and not in one
    /// step.
    #[must_use]
    pub fn held_at(mut self, held: Vec<f64>, slew: f64) -> Self {
        self.fade = slew * self.samples.period;
        self.held = held;
        self
    }

    /// Returns the drive of all rows for other reference values, which may be outside the stroke. Only the limits of
    /// the inverse hysteresis apply.
    pub(crate) fn along(mut self, values: &[f64]) -> Result<Vec<f64>, hyst_core::Error> {
        let span = self.range.1 - self.range.0;
        let (low, high) = (self.range.0 - UNLIMITED_RANGES * span, self.range.1 + UNLIMITED_RANGES * span);
        self.limits = Limits::new(low, high, f64::INFINITY, &Sampling { period: self.samples.period })?;
        self.samples.output = values.to_vec();
        Ok(values.iter().map(|_| self.next(None).drive).collect())
    }

    /// Returns the output of the model for a drive, without sensor effects.
    pub(crate) fn predicted(&self, model: &Model, drive: &[f64]) -> Result<Vec<f64>, hyst_core::Error> {
        let chain = Box::new(model.without_sensor().build(self.samples.period)?);
        let mut state = Box::new(chain.state());
        let mut outputs = Vec::with_capacity(drive.len());
        for segment in &self.samples.segments {
            for row in segment.clone() {
                let (env, u) = (self.env(row, None), drive[row]);
                outputs.push(if row == segment.start {
                    chain.reset(&mut state, &env, u)
                } else {
                    chain.step(&mut state, &env, u)
                });
            }
        }
        Ok(outputs)
    }

    /// Returns the segments of the reference.
    pub fn segments(&self) -> &[Range<usize>] {
        &self.samples.segments
    }

    /// Returns a drive without voltages: preview, band and band error.
    pub fn stated(&self) -> Drive {
        Drive {
            voltage: Vec::with_capacity(self.samples.len()),
            lead: self.compensator.lead(),
            bandwidth_hz: self.compensator.bandwidth_hz(),
            band_error: self.compensator.error(),
            limits: self.range,
            voltage_limited: Vec::new(),
            slew_limited: Vec::new(),
            missed: Missed::default(),
        }
    }

    /// Returns the surroundings at a row, with the newer `temperature` if given.
    fn env(&self, row: usize, temperature: Option<f64>) -> Env<f64> {
        let mut env = self.samples.env(row);
        if let Some(t) = temperature {
            env.temperature = t;
        }
        env
    }

    /// Returns the drive of the next row \[V\], within the limits. `temperature` \[°C\] is the last measured one, if
    /// any; it changes little over the preview. After the last row the last drive is held.
    pub fn next(&mut self, temperature: Option<f64>) -> Limited<f64> {
        self.next_aimed(temperature, |_, reference| reference)
    }

    /// The same for reference values changed by `aim`. It is called for each row in order, a preview ahead of the
    /// drive, with a flag for the first row of a segment.
    pub fn next_aimed(&mut self, temperature: Option<f64>, mut aim: impl FnMut(bool, f64) -> f64) -> Limited<f64> {
        let Some(segment) = self.samples.segments.get(self.segment).cloned() else {
            return Limited { drive: self.before, voltage: false, slew: false };
        };
        let last = segment.end - 1;
        let lead = self.compensator.lead();
        let starts = self.row == segment.start;
        let mut feed = |this: &mut Self, row: usize, first: bool| {
            let row = row.min(last);
            let env = this.env(row, temperature);
            let aimed = aim(first, this.samples.output[row]);
            if first {
                this.compensator.reset(&mut this.state, &env, aimed)
            } else {
                this.compensator.step(&mut this.state, &env, aimed)
            }
        };
        let required = if starts {
            let first = feed(self, segment.start, true);
            (1..=lead).fold(first, |_, ahead| feed(self, segment.start + ahead, false))
        } else {
            feed(self, self.row + lead, false)
        };
        let required = if required.is_finite() { required } else { self.before };
        let inside = self.limits.apply(required, required);
        let before = match self.held.get(self.segment) {
            Some(held) if starts => {
                self.offset = held - inside.drive;
                *held
            }
            None if starts => inside.drive,
            _ => {
                self.offset -= self.offset.clamp(-self.fade, self.fade);
                self.before
            }
        };
        let limited = self.limits.apply(before, inside.drive + self.offset);
        let limited = Limited { voltage: inside.voltage || limited.voltage, ..limited };
        self.before = limited.drive;
        self.row += 1;
        if self.row == segment.end {
            self.segment += 1;
        }
        limited
    }
}

fn check(
    model: &Model,
    reference: &Record,
    samples: &Samples,
    options: &CompensateOptions,
) -> Result<(), CompensateError> {
    let missing = |column: &str, advice: &str| {
        Err(CompensateError::Missing { record: reference.name(), column: column.into(), advice: advice.into() })
    };
    match reference.output_unit() {
        Some(unit) if unit.column() == model.output.column => {}
        Some(unit) => return missing(&model.output.column, &other_unit(unit)),
        None => return missing(&model.output.column, "the reference gives the wanted output"),
    }
    if let Some((column, why)) = model.lacking(samples) {
        return missing(column, why);
    }
    // A model without temperature effect does not depend on it.
    let (coldest, warmest) =
        samples.temperature.as_ref().map_or((0.0, 0.0), |t| crate::statistics::range(t.iter().copied()));
    // With limits wider than the record, the model extrapolates.
    let range = options.voltage.unwrap_or((model.input.low, model.input.high));
    let range = [range.0.min(model.input.low), range.1.max(model.input.high)];
    // The larger of the range of the training record and the model's range from rest to full drive.
    let (least, most) = model.at_rest(range, [coldest, warmest])?;
    let (low, high) = (least.min(model.output.low), most.max(model.output.high));
    let margin = STROKE_MARGIN * (high - low);
    match samples.output.iter().position(|y| *y < low - margin || *y > high + margin) {
        Some(row) => Err(CompensateError::OutOfReach {
            record: reference.name(),
            row,
            time: samples.time[row],
            value: samples.output[row],
            unit: reference.output_unit().map_or_else(String::new, |u| u.symbol().into()),
            low,
            high,
        }),
        None => Ok(()),
    }
}
