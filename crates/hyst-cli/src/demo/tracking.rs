//! One reference, three ways to drive it: a plain gain, the base model's inverse, the extended one's.

use std::ops::ControlFlow;
use std::path::Path;

use hyst_hw::{Daq, Phase, RecordOptions, Sample};
use hyst_ident::atomic_file::write_atomic;
use hyst_ident::compensate::{CompensateOptions, Follower, compensate};
use hyst_ident::model::Model;
use hyst_ident::record::{Columns, Extra, OutputUnit, Record};

use super::RATE_HZ;
use crate::exit::{CommandError, CommandResult, Exit};
use crate::log::{LogError, LoggedModel, LoggedSample, RunInfo, RunLog};
use crate::output;

/// Length of the reference \[s\].
const SECONDS: f64 = 12.0;

/// One tracking run.
pub(super) struct Run {
    /// Measured motion minus reference \[output unit\].
    pub(super) error: Vec<f64>,
    pub(super) rmse: f64,
    pub(super) max_abs: f64,
}

/// All three.
pub(super) struct Runs {
    pub(super) time: Vec<f64>,
    /// Wanted displacement from rest \[output unit\].
    pub(super) travel: Vec<f64>,
    pub(super) plain: Run,
    pub(super) base: Run,
    pub(super) extended: Run,
}

/// Compensates one reference in three ways on the device. Writes `drive.csv` and `run.mcap` of the
/// extended inverse.
pub(super) fn track<D: Daq>(
    daq: &mut D,
    train: &Record,
    base: &Model,
    extended: &Model,
    out: &Path,
) -> CommandResult<Runs> {
    let travel = travel(extended);
    let reference = in_the_sensor(extended, &travel)?;
    let (top, bottom) = (base.input.high, base.input.low);

    let gain = mean_gain(train, extended.zero);
    let plain_drive: Vec<f64> = travel.iter().map(|y| (y / gain).clamp(bottom, top)).collect();
    let plain = play(daq, &plain_drive, |_| {}, |_| Ok(()))?;

    let base_drive = compensate(base, &reference, &CompensateOptions::default())?.voltage;
    let based = play(daq, &base_drive, |_| {}, |_| Ok(()))?;

    // What the model's gain needs to know of the temperature is only known while the device runs: the
    // plan is made for the reference temperature and revised with every measured one.
    let temperature = extended.effects.temperature.map(|t| t.reference_degc);
    let options = CompensateOptions { temperature, ..CompensateOptions::default() };
    let plan = compensate(extended, &reference, &options)?;
    let mut follower = Follower::new(extended, &reference, &options)?;
    let json = extended.to_json();
    let device = daq.capabilities().device.clone();
    let output = OutputUnit::of_column(&extended.output.column).unwrap_or(OutputUnit::Micrometre);
    let model = Some(LoggedModel { model: extended, json: &json });
    let info = RunInfo { device: &device, output, sample_rate_hz: RATE_HZ, model };
    let lost = |e: LogError| CommandError::new(Exit::DeviceLost, e);
    let mut log = RunLog::create(&out.join("run.mcap"), &info).map_err(lost)?;
    let revise = |r: &mut hyst_hw::Revision<'_>| {
        for v in r.drive_v.iter_mut() {
            *v = follower.next(r.latest.and_then(|s| s.temperature_degc)).drive;
        }
    };
    let mut rows = reference.output().unwrap_or_default().iter();
    let followed = play(daq, &plan.voltage, revise, |s| {
        let reference = rows.next().copied();
        log.sample(&LoggedSample::new(0, Phase::Record, s, reference)).map_err(lost)
    })?;
    log.finish().map_err(lost)?;

    let drive: Vec<f64> = followed.iter().map(|s| s.drive_v).collect();
    write_atomic(out.join("drive.csv"), |file| {
        reference.write_with(file, &[Extra::numbers("voltage_v", &drive)]).map_err(output::io_error)
    })?;
    let run = |samples: &[Sample]| judge(samples, &travel, extended);
    Ok(Runs {
        time: reference.time().to_vec(),
        plain: run(&plain),
        base: run(&based),
        extended: run(&followed),
        travel,
    })
}

/// A travel from rest that asks for everything: slow and fast motion, nested loops, a hold; within 85 % of
/// the stroke \[output unit\].
fn travel(model: &Model) -> Vec<f64> {
    let stroke = model.output.high - model.zero;
    let smooth = |x: f64| 0.5 - 0.5 * (std::f64::consts::PI * x.clamp(0.0, 1.0)).cos();
    let shape = |t: f64| {
        let wave = |hz: f64, amplitude: f64| amplitude * (2.0 * std::f64::consts::PI * hz * t).sin();
        // Moving from the second second to the ninth, then a hold at two thirds.
        let moving = smooth((t - 1.0) / 0.5) * (1.0 - smooth((t - 8.5) / 0.5));
        0.48 * smooth(t)
            + moving * (wave(0.7, 0.19) + wave(4.0, 0.1) + wave(11.0, 0.06))
            + 0.18 * smooth((t - 9.0) / 0.5)
    };
    (0..(SECONDS * RATE_HZ) as usize).map(|k| stroke * shape(k as f64 / RATE_HZ)).collect()
}

/// A travel as a reference in the sensor's coordinates.
fn in_the_sensor(model: &Model, travel: &[f64]) -> CommandResult<Record> {
    let unit = OutputUnit::of_column(&model.output.column).unwrap_or(OutputUnit::Micrometre);
    let columns = Columns {
        name: "reference".into(),
        time: (0..travel.len()).map(|k| k as f64 / RATE_HZ).collect(),
        output: Some((unit, travel.iter().map(|y| model.zero + y).collect())),
        ..Columns::default()
    };
    Ok(Record::from_samples(columns)?)
}

/// Slope through the rest point, by least squares: what somebody without a model would use.
fn mean_gain(record: &Record, zero: f64) -> f64 {
    let (u, y) = (record.input(), record.output().unwrap_or_default());
    let (cross, own) = u.iter().zip(y).fold((0.0, 0.0), |(c, o), (u, y)| (c + u * (y - zero), o + u * u));
    cross / own
}

fn play<D: Daq>(
    daq: &mut D,
    drive: &[f64],
    revise: impl FnMut(&mut hyst_hw::Revision<'_>),
    mut each: impl FnMut(&Sample) -> CommandResult,
) -> CommandResult<Vec<Sample>> {
    // Small blocks, so that a revision is not stale.
    let options = RecordOptions { block: 50, slew_v_per_s: 1000.0, ..RecordOptions::at(RATE_HZ) };
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

/// Error of the motion: drift and tone that the model found in the sensor are taken out of what it showed.
fn judge(samples: &[Sample], travel: &[f64], model: &Model) -> Run {
    let sensor = |t: f64| {
        let drift = model.effects.drift.map_or(0.0, |d| d.per_second * t);
        let tone = model
            .effects
            .interference
            .map_or(0.0, |i| i.amplitude * (2.0 * std::f64::consts::PI * (i.hz * t).fract() + i.phase).sin());
        drift + tone
    };
    let error: Vec<f64> =
        samples.iter().zip(travel).map(|(s, y)| s.output - model.zero - sensor(s.time_s) - y).collect();
    let n = error.len().max(1) as f64;
    Run {
        rmse: (error.iter().map(|e| e * e).sum::<f64>() / n).sqrt(),
        max_abs: error.iter().fold(0.0, |m, e| m.max(e.abs())),
        error,
    }
}
