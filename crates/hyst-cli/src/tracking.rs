//! Tracking of a demanding reference on a device, with a plain gain or with a model's inverse.

use std::ops::ControlFlow;
use std::path::Path;

use hyst_hw::{Daq, Phase, RecordOptions, Sample};
use hyst_ident::atomic_file::write_atomic;
use hyst_ident::compensate::{CompensateOptions, Follower, compensate};
use hyst_ident::model::Model;
use hyst_ident::record::{Columns, Extra, OutputUnit, Record};

use crate::exit::{CommandError, CommandResult, Exit};
use crate::log::{LogError, LoggedModel, LoggedSample, RunInfo, RunLog};
use crate::output;

/// Length of the reference \[s\].
const SECONDS: f64 = 12.0;

/// Slope of the ramps to the start of the reference and back to rest \[V/s\].
const RAMP_V_PER_S: f64 = 1000.0;

/// Errors of a tracking run.
pub(crate) struct Run {
    /// Measured motion minus reference, without drift and interference of the sensor \[output unit\].
    pub(crate) error: Vec<f64>,
    /// RMS of `error` \[output unit\].
    pub(crate) rmse: f64,
    /// RMS error with drift and interference of the sensor \[output unit\].
    pub(crate) shown_rmse: f64,
    /// Maximum of `error` \[output unit\].
    pub(crate) max_abs: f64,
}

/// A reference to follow.
pub(crate) struct Task {
    /// Sample rate \[Hz\].
    rate_hz: f64,
    /// Sensor value before the first motion \[output unit\].
    /// All models follow the reference from this value, whatever their own zero is.
    rest: f64,
    /// Wanted displacement from rest \[output unit\].
    pub(crate) travel: Vec<f64>,
}

/// Files of a run: its log and its drive.
pub(crate) struct Files<'a> {
    pub(crate) log: &'a Path,
    pub(crate) drive: &'a Path,
}

impl Task {
    /// Creates the reference for the stroke of a model, from the rest value of its training record.
    pub(crate) fn of(model: &Model, train: &Record, rate_hz: f64) -> Self {
        let rest = rest(train, model);
        Self { rate_hz, rest, travel: travel(model.output.high - rest, rate_hz) }
    }

    /// Returns the times of the samples \[s\].
    pub(crate) fn time(&self) -> Vec<f64> {
        (0..self.travel.len()).map(|k| k as f64 / self.rate_hz).collect()
    }

    /// Follows the reference with a constant gain, without a model.
    pub(crate) fn by_gain<D: Daq>(&self, daq: &mut D, train: &Record, model: &Model) -> CommandResult<Vec<Sample>> {
        let gain = mean_gain(train, self.rest);
        let (low, high) = (model.input.low, model.input.high);
        let drive: Vec<f64> = self.travel.iter().map(|y| (y / gain).clamp(low, high)).collect();
        self.play(daq, &drive, |_| {}, |_| Ok(()))
    }

    /// Follows the reference with a model's inverse.
    ///
    /// The temperature is only known during the run: the plan is made for the reference temperature and revised with
    /// each measured one.
    pub(crate) fn through<D: Daq>(
        &self,
        daq: &mut D,
        model: &Model,
        files: Option<&Files<'_>>,
    ) -> CommandResult<Vec<Sample>> {
        let reference = self.reference(model)?;
        let temperature = model.effects.temperature.map(|t| t.reference_degc);
        let options = CompensateOptions { temperature, ..CompensateOptions::default() };
        let plan = compensate(model, &reference, &options)?;
        let mut follower =
            Follower::new(model, &reference, &options)?.held_at(plan.voltage[..1].to_vec(), RAMP_V_PER_S);
        let revise = |r: &mut hyst_hw::Revision<'_>| {
            for v in r.drive_v.iter_mut() {
                *v = follower.next(r.latest.and_then(|s| s.temperature_degc)).drive;
            }
        };
        let Some(files) = files else { return self.play(daq, &plan.voltage, revise, |_| Ok(())) };
        let json = model.to_json();
        let device = daq.capabilities().device.clone();
        let output = OutputUnit::of_column(&model.output.column).unwrap_or(OutputUnit::Micrometre);
        let info = RunInfo {
            device: &device,
            output,
            sample_rate_hz: self.rate_hz,
            model: Some(LoggedModel { model, json: &json }),
        };
        let lost = |e: LogError| CommandError::new(Exit::DeviceLost, e);
        let mut log = RunLog::create(files.log, &info).map_err(lost)?;
        let mut rows = reference.output().unwrap_or_default().iter();
        let followed = self.play(daq, &plan.voltage, revise, |s| {
            let reference = rows.next().copied();
            log.sample(&LoggedSample::new(0, Phase::Record, s, reference)).map_err(lost)
        })?;
        log.finish().map_err(lost)?;
        let drive: Vec<f64> = followed.iter().map(|s| s.drive_v).collect();
        write_atomic(files.drive, |file| {
            reference.write_with(file, &[Extra::numbers("voltage_v", &drive)]).map_err(output::io_error)
        })?;
        Ok(followed)
    }

    /// Computes the errors.
    /// The sensor drift and interference of the model are removed from the motion.
    pub(crate) fn judge(&self, samples: &[Sample], model: &Model) -> Run {
        let shown: Vec<f64> = samples.iter().zip(&self.travel).map(|(s, y)| s.output - self.rest - y).collect();
        let error: Vec<f64> = shown.iter().zip(samples).map(|(e, s)| e - in_the_sensor(model, s.time_s)).collect();
        let rms = |e: &[f64]| (e.iter().map(|e| e * e).sum::<f64>() / e.len().max(1) as f64).sqrt();
        Run {
            rmse: rms(&error),
            shown_rmse: rms(&shown),
            max_abs: error.iter().fold(0.0, |m, e| m.max(e.abs())),
            error,
        }
    }

    /// Returns the reference in the coordinates of the sensor.
    fn reference(&self, model: &Model) -> CommandResult<Record> {
        let unit = OutputUnit::of_column(&model.output.column).unwrap_or(OutputUnit::Micrometre);
        let columns = Columns {
            name: "reference".into(),
            time: self.time(),
            output: Some((unit, self.travel.iter().map(|y| self.rest + y).collect())),
            // The load is unknown before the run.
            load: model.effects.load.map(|_| vec![0.0; self.travel.len()]),
            ..Columns::default()
        };
        Ok(Record::from_samples(columns)?)
    }

    fn play<D: Daq>(
        &self,
        daq: &mut D,
        drive: &[f64],
        revise: impl FnMut(&mut hyst_hw::Revision<'_>),
        mut each: impl FnMut(&Sample) -> CommandResult,
    ) -> CommandResult<Vec<Sample>> {
        // Small blocks, so that a revision uses a recent measurement.
        let options = RecordOptions { block: 50, slew_v_per_s: RAMP_V_PER_S, ..RecordOptions::at(self.rate_hz) };
        let mut failed = None;
        let recording = hyst_hw::record_with(daq, &[drive], &options, revise, |news| {
            if news.phase == Phase::Record {
                failed = news.samples.iter().find_map(|s| each(s).err());
            }
            if failed.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        match (failed, recording) {
            (Some(error), _) => Err(error),
            (None, Ok(recording)) => Ok(recording.segments.into_iter().flat_map(|s| s.samples).collect()),
            (None, Err(failure)) => Err(CommandError::new(Exit::DeviceLost, anyhow::anyhow!("{failure}"))),
        }
    }
}

/// Returns drift and interference of the sensor at a time, as a model has them \[output unit\].
fn in_the_sensor(model: &Model, time_s: f64) -> f64 {
    let drift = model.effects.drift.map_or(0.0, |drift| drift.at(time_s));
    let tone = model.effects.interference.map_or(0.0, |tone| tone.at(time_s));
    drift + tone
}

/// Returns the mean output before the drive first moves by 0.1 % of its range \[output unit\].
fn rest(train: &Record, model: &Model) -> f64 {
    let (time, u, y) = (train.time(), train.input(), train.output().unwrap_or_default());
    let (start, range) = (u.first().copied().unwrap_or(0.0), model.input.high - model.input.low);
    let still = u.iter().take_while(|u| (*u - start).abs() <= 1e-3 * range).count().min(y.len());
    let sum: f64 = time[..still].iter().zip(y).map(|(t, y)| y - in_the_sensor(model, *t)).sum();
    sum / still.max(1) as f64
}

/// Returns a displacement within 85 % of the stroke \[output unit\].
/// It has slow and fast motion, nested loops and a hold.
fn travel(stroke: f64, rate_hz: f64) -> Vec<f64> {
    let smooth = |x: f64| 0.5 - 0.5 * (std::f64::consts::PI * x.clamp(0.0, 1.0)).cos();
    let shape = |t: f64| {
        let wave = |hz: f64, amplitude: f64| amplitude * (2.0 * std::f64::consts::PI * hz * t).sin();
        // Moves between 1 s and 9 s, then holds two thirds of the stroke.
        let moving = smooth((t - 1.0) / 0.5) * (1.0 - smooth((t - 8.5) / 0.5));
        0.48 * smooth(t)
            + moving * (wave(0.7, 0.19) + wave(4.0, 0.1) + wave(11.0, 0.06))
            + 0.18 * smooth((t - 9.0) / 0.5)
    };
    (0..(SECONDS * rate_hz) as usize).map(|k| stroke * shape(k as f64 / rate_hz)).collect()
}

/// Returns the slope of the line through the rest point, by least squares \[output unit/V\].
fn mean_gain(record: &Record, zero: f64) -> f64 {
    let (u, y) = (record.input(), record.output().unwrap_or_default());
    let (cross, own) = u.iter().zip(y).fold((0.0, 0.0), |(c, o), (u, y)| (c + u * (y - zero), o + u * u));
    cross / own
}
