//! `run`: plays a drive on a device, or follows a reference with a model.

mod adapt;
mod control;
mod follow;
pub(super) mod followed;
mod gains;
pub(super) mod gaps;
mod guard;
mod handed_over;
pub(super) mod interrupt;
pub(super) mod job;
pub(super) mod limits;
mod live;
mod monitor;
mod parallel;
pub(super) mod play;
mod read;
pub(super) mod shape;
mod summary;
mod sweep;
mod values;
mod view;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use hyst_hw::Daq;
use hyst_ident::range;
use hyst_ident::tracking::Tracking;

use super::status::Stated;
use crate::cli::{PidGains, RunArgs};
use crate::device::{AnyDevice, DeviceOptions};
use crate::exit::{CommandError, CommandResult, Exit};
use crate::log::{LoggedModel, RunInfo, RunLog};
use crate::output::{self, Report, Target};
use crate::recording::{self, ExtraColumns};
use adapt::Adapting;
use followed::Followed;
use handed_over::HandedOver;
use job::Job;
use play::Played;
use summary::{ClockSummary, Gains, Summary, WatchSummary};

/// Runs the command.
pub(super) fn run(args: &RunArgs) -> CommandResult {
    let log = args.log.clone().map(Target::File);
    let written: Vec<&Target> = log.iter().chain(&args.record).collect();
    if args.drive.is_some() && written.is_empty() {
        return Err(CommandError::bad_input("the measured data would be lost; give --record, --log or both"));
    }
    if args.log.as_deref() == Some(Path::new("-")) {
        return Err(CommandError::bad_input("--log needs a file: a log cannot be written to stdout"));
    }
    let mut read: Vec<&Path> = args.daq.file().into_iter().collect();
    read.extend([&args.model, &args.reference, &args.drive].into_iter().filter_map(|path| path.as_deref()));
    let kept = args.adapt.clone().flatten().map(Target::File);
    output::check(&read, &[&written[..], &kept.iter().collect::<Vec<_>>()].concat())?;
    let report = Report::new(args.json.json, &written)?;
    let device_options = DeviceOptions {
        noise: args.seed,
        voltage: args.limits.limit.map(|limit| (limit.low, limit.high)),
        slew_v_per_s: args.limits.slew,
        force: args.kout.is_some() && args.control.closes(),
        silence_s: args.silence,
        hottest_degc: args.hottest,
        error: args.max_error,
    };
    on_device(&mut AnyDevice::open(&args.daq, &device_options)?, args, report)
}

/// Runs the job on a device.
fn on_device(daq: &mut AnyDevice, args: &RunArgs, report: Report) -> CommandResult {
    let mut job = Job::read(args, daq.capabilities())?;
    if args.record.is_none() && args.log.is_none() {
        output::say("note: the measured data are not saved; give --record, --log or both");
    }
    if let Some(predicted) = job.predicted_error() {
        output::say(&format!("note: {predicted}"));
    }
    let unit = recording::unit(daq.capabilities().output);
    let device = daq.capabilities().device.clone();
    let model = job.followed.as_ref().map(|followed| LoggedModel { model: &followed.model, json: &followed.json });
    let info = RunInfo { device: &device, output: unit, sample_rate_hz: job.options.rate_hz, model };
    let create =
        |path: &PathBuf| RunLog::beside_older(path, &info).map_err(|error| CommandError::new(Exit::Failed, error));
    let mut log = args.log.as_ref().map(create).transpose()?;
    if let Some(log) = &mut log {
        log.note("asked", asked(args)).map_err(|error| CommandError::new(Exit::Failed, error))?;
    }
    // From here on only the device can refuse the run.
    if let Some(fault) = if args.clear { clear(daq)? } else { None }
        && let Some(log) = &mut log
    {
        log.note("cleared", BTreeMap::from([("fault".to_owned(), fault)]))?;
    }
    if let Some(HandedOver { recipe, range, .. }) = &job.handed_over {
        daq.follow(recipe, *range)?;
    }
    daq.gentle(job.steepest());
    let played = play::play(daq, &mut job, log.as_mut());
    // The measured data are written in any case; the first error is reported.
    if let Some((path, older)) = log.as_ref().and_then(|log| Some((log.path(), log.older()?))) {
        output::print_renamed(path, older);
    }
    let noted = match (log.as_mut().filter(|log| log.samples() > 0), daq.clock()) {
        (Some(log), Some(clock)) => log.note("clock", ClockSummary::new(clock).entries()),
        _ => Ok(()),
    };
    let adapting = job.followed.as_ref().and_then(|followed| followed.adapting.as_ref());
    let adapted = adapting.map(Adapting::change);
    let noted = match (log.as_mut().filter(|log| log.samples() > 0), &adapted) {
        (Some(log), Some(change)) => noted.and(log.note("adapted", change.entries())),
        _ => noted,
    };
    let closed = noted.and(log.filter(|log| log.samples() > 0).map_or(Ok(()), RunLog::finish));
    let Played { mut recording, mut forces, watched, gaps, error } = played?;
    job.align(&mut recording, &mut forces);
    let forces = forces.concat();
    let rows: usize = recording.segments.iter().map(|segment| segment.samples.len()).sum();
    let force_n = forces.first().map(|_| range(forces.iter().copied()));
    let wanted = job.followed.as_ref().map(|followed| followed.wanted_at(&recording));
    let wanted = wanted.map(|wanted| (format!("reference_{}", unit.suffix()), wanted));
    let forces = (forces.len() == rows).then(|| ("estimated_force_n".to_owned(), forces));
    let columns: ExtraColumns = wanted.into_iter().chain(forces).collect();
    if let Some(error) = error {
        if let Some(target) = &args.record {
            recording::keep_partial(recording, columns, target, unit);
        }
        return Err(error);
    }
    let recording = recording::split(recording);
    if let Some(target) = &args.record {
        let record = recording::to_record(&recording, &target.to_string(), unit)?;
        target.write_measured(|out| record.write_with(out, &recording::extra(&columns)).map_err(output::io_error))?;
    }
    // After the record, which may be on another disk than a log that could not be closed.
    closed?;
    if let (Some(Some(file)), Some(adapting)) =
        (&args.adapt, job.followed.as_ref().and_then(|followed| followed.adapting.as_ref()))
    {
        adapting.keep(file)?;
    }
    let measured: Vec<f64> = recording.segments.iter().flat_map(|s| &s.samples).map(|s| s.output).collect();
    let (low, high) = range(measured.iter().copied());
    let follows = |followed: &Followed| {
        let segments = followed.reference.segments();
        Tracking::of(followed.wanted(), &measured, segments, recording.rate_hz, args.allow_delay)
            .map_err(CommandError::failed)
    };
    let summary = Summary {
        device,
        rate_hz: recording.rate_hz,
        samples: measured.len(),
        segments: recording.segments.len(),
        unit: unit.suffix(),
        lowest_output: low,
        highest_output: high,
        tracking: job.followed.as_ref().map(follows).transpose()?,
        compensation: job.followed.as_ref().and_then(Followed::compensation),
        control: job.followed.as_ref().map(|followed| followed.control),
        pid: job.pid(&recording).map(Gains::of),
        loop_on_device: job.handed_over.is_some(),
        watch: watched.map(WatchSummary::new),
        force_n,
        gaps,
        clock: daq.clock().map(ClockSummary::new),
        temperature_followed: daq.capabilities().temperature
            && job.followed.as_ref().is_some_and(Followed::needs_temperature),
        adapted,
        log: args.log.as_ref().map(|path| path.display().to_string()),
        record: args.record.as_ref().map(ToString::to_string),
        model: args.model.as_ref().map(|path| path.display().to_string()),
        symbol: unit.symbol(),
    };
    report.print(&summary.text(), &summary)
}

/// Clears the fault of an earlier run, prints it and returns it.
pub(super) fn clear(daq: &mut AnyDevice) -> CommandResult<Option<String>> {
    let Some(Stated { code, text }) = daq.clear()?.map(Stated::of) else { return Ok(None) };
    output::say(&format!("note: cleared fault {code} of an earlier run: {text}"));
    Ok(Some(format!("{code}: {text}")))
}

/// Returns the arguments of a run as metadata of its log.
fn asked(args: &RunArgs) -> BTreeMap<String, String> {
    let path = |path: &Option<PathBuf>| path.as_ref().map(|path| path.display().to_string());
    let control = args.control.to_possible_value().map(|value| value.get_name().to_owned());
    let limits = &args.limits;
    let number = |number: Option<f64>| number.map(|number| number.to_string());
    let entries = [
        ("drive", path(&args.drive)),
        ("reference", path(&args.reference)),
        ("model", path(&args.model)),
        ("control", args.reference.as_ref().and(control)),
        (
            "pid",
            args.pid.map(|PidGains { proportional, integral, derivative }| {
                format!("{proportional},{integral},{derivative}")
            }),
        ),
        ("limit_v", limits.limit.map(|limit| format!("{},{}", limit.low, limit.high))),
        ("slew_v_per_s", number(limits.slew)),
        ("bandwidth_hz", number(limits.bandwidth)),
        ("temperature_degc", number(args.temperature.degc)),
        ("hottest_degc", number(args.hottest)),
        ("max_error", number(args.max_error)),
        ("adapt", args.adapt.as_ref().map(|file| path(file).unwrap_or_else(|| "true".to_owned()))),
        ("allow_delay", args.allow_delay.then(|| "true".to_owned())),
        ("silence_s", number(args.silence)),
        ("rate_hz", number(args.map.rate)),
        ("settle_s", number(args.settle)),
        ("rest_s", Some(args.rest.to_string())),
        ("kout", number(args.kout)),
        ("seed", args.seed.map(|seed| seed.to_string())),
    ];
    entries.into_iter().filter_map(|(key, value)| Some((key.to_owned(), value?))).collect()
}
