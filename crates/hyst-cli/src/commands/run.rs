//! `run`: plays a drive on a device, or follows a reference with a model.

mod adapt;
mod control;
pub(super) mod gaps;
mod guard;
pub(super) mod interrupt;
pub(super) mod job;
mod live;
mod monitor;
mod parallel;
pub(super) mod play;
pub(super) mod shape;
mod sweep;
mod view;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use hyst_core::PidParams;
use hyst_hw::{ClockFit, Daq};
use hyst_ident::range;
use hyst_ident::tracking::{Harmonic, Tracking, Turning};
use serde::Serialize;

use super::compensate::Compensation;
use super::status::Stated;
use crate::cli::{Control, PidGains, RunArgs};
use crate::device::{AnyDevice, DeviceOptions};
use crate::exit::{CommandError, CommandResult, Exit};
use crate::log::{LoggedModel, RunInfo, RunLog};
use crate::output::{self, Report, Target};
use crate::recording::ExtraColumns;
use crate::{recording, text};
use adapt::{Adapting, Change};
use gaps::Gaps;
use job::{Followed, HandedOver, Job, PidReport};
use parallel::Watched;
use play::Played;

/// Report of a run.
#[derive(Debug, Serialize)]
struct Summary {
    device: String,
    rate_hz: f64,
    samples: usize,
    segments: usize,
    unit: &'static str,
    lowest_output: f64,
    highest_output: f64,
    /// `None` if a drive was played.
    tracking: Option<Tracking>,
    compensation: Option<Compensation>,
    /// `None` if a drive was played.
    control: Option<Control>,
    /// `None` without a PID.
    pid: Option<Gains>,
    /// Whether the loop was closed on the device.
    loop_on_device: bool,
    /// Whether the model explained the measured output; `None` if that was not monitored.
    watch: Option<WatchSummary>,
    /// Minimum and maximum of the estimated force, relative to the start of the run \[N\].
    /// `None` without an estimate.
    force_n: Option<(f64, f64)>,
    /// Sample periods without a value for the device.
    gaps: Gaps,
    /// The device's clock relative to this computer's; `None` if the device uses this computer's clock.
    clock: Option<ClockSummary>,
    /// Whether the drive was corrected for the measured temperature.
    temperature_followed: bool,
    /// Difference between actuator and model at the end of the run; `None` without `--adapt`.
    adapted: Option<Change>,
    log: Option<String>,
    record: Option<String>,
    #[serde(skip)]
    model: Option<String>,
    #[serde(skip)]
    symbol: &'static str,
}

/// An offset is reported if the RMSE without it is below this share of the RMSE.
const MAX_SHARE_WITHOUT_OFFSET: f64 = 0.5;

/// Whether the model explained the measured output.
#[derive(Clone, Copy, Debug, Serialize)]
struct WatchSummary {
    explains: bool,
    /// First time at which the model did not explain the output, by the device's clock \[s\].
    lost_at_s: Option<f64>,
    /// RMS residual of the last block \[output unit\].
    residual_rms: f64,
    /// RMS residual of the model on its training record \[output unit\].
    fitted_rms: f64,
}

impl WatchSummary {
    fn text(&self, unit: &str) -> Option<String> {
        let (now, fitted) = (text::short(self.residual_rms), text::short(self.fitted_rms));
        self.lost_at_s.map(|at| {
            format!(
                "from {} s on the model did not explain the output: RMS residual {now} {unit} at the end, {fitted} {unit} on \
                 the training record",
                text::short(at)
            )
        })
    }

    fn new(Watched { lost_at, residual, fitted_rmse }: Watched) -> Self {
        Self { explains: lost_at.is_none(), lost_at_s: lost_at, residual_rms: residual, fitted_rms: fitted_rmse }
    }
}

/// The device's clock relative to this computer's.
#[derive(Clone, Copy, Debug, Serialize)]
struct ClockSummary {
    /// Start of period 0 of the run \[s since 1970-01-01 UTC\], and its uncertainty \[s\].
    began_unix_s: f64,
    uncertainty_s: f64,
    /// Frequency error of the device's clock, positive if it is faster \[ppm\]; `None` for a short run.
    faster_ppm: Option<f64>,
}

impl ClockSummary {
    fn new(ClockFit { began_unix_s, faster_ppm, uncertainty_s }: ClockFit) -> Self {
        Self { began_unix_s, uncertainty_s, faster_ppm }
    }

    /// Returns metadata of a log.
    fn entries(&self) -> BTreeMap<String, String> {
        let mut entries = BTreeMap::from([
            ("began_unix_s".to_owned(), self.began_unix_s.to_string()),
            ("uncertainty_s".to_owned(), self.uncertainty_s.to_string()),
        ]);
        entries.extend(self.faster_ppm.map(|ppm| ("faster_ppm".to_owned(), ppm.to_string())));
        entries
    }
}

/// The PID of a run.
#[derive(Debug, Serialize)]
struct Gains {
    /// Proportional gain \[V/y\].
    proportional: f64,
    /// Integral gain \[V/(y s)\].
    integral: f64,
    /// Derivative gain \[V s/y\].
    derivative: f64,
    /// Crossover frequency of the loop, from the model \[Hz\]; `None` for given gains.
    crossover_hz: Option<f64>,
    /// Share of the samples in which the drive was at a limit \[%\].
    /// For a loop on the device only samples with a tracking error count.
    limited_percent: Option<f64>,
    /// Reason for these gains.
    why: String,
}

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

impl Gains {
    fn of(PidReport { gains, why, crossover_hz, limited_percent }: PidReport<'_>) -> Self {
        let (PidParams { proportional, integral, derivative, .. }, why) = (*gains, why.to_owned());
        Self { proportional, integral, derivative, crossover_hz, limited_percent, why }
    }

    fn text(&self, symbol: &str) -> String {
        let short = text::short;
        let mut line = format!(
            "PID: {} V/{symbol}, {} V/({symbol} s), {} V s/{symbol} ({})",
            short(self.proportional),
            short(self.integral),
            short(self.derivative),
            self.why
        );
        if let Some(share) = self.limited_percent.filter(|share| *share > 0.0) {
            line += &format!("; the drive was at a limit in {} of the samples", text::percent(share));
        }
        line
    }
}

/// Returns lines about delay, turning points and harmonics.
fn tracking_details(tracking: &Tracking, unit: &str) -> String {
    let short = text::short;
    let mut lines = Vec::new();
    if let Some(delay) = tracking.delay_s {
        let how = if delay < 0.0 { "earlier" } else { "later" };
        lines.push(format!("compared with the reference {} ms {how} (--allow-delay)", short(1e3 * delay.abs())));
    }
    if let Some(Turning { points, near_percent, rmse, max_abs, rmse_between }) = tracking.turning {
        lines.push(format!(
            "near {} (within {} of the time to the next one): RMSE {} {unit}, largest {} {unit}; between them RMSE {} {unit}",
            text::count(points, "turning point"),
            text::percent(near_percent),
            short(rmse),
            short(max_abs),
            short(rmse_between)
        ));
    }
    if !tracking.harmonics.is_empty() {
        let harmonic = |h: &Harmonic| format!("{} Hz {} at {:.2}°", short(h.frequency_hz), short(h.gain), h.phase_deg);
        let harmonics: Vec<String> = tracking.harmonics.iter().map(harmonic).collect();
        lines.push(format!("gain and phase of the harmonics: {}", harmonics.join(", ")));
    }
    lines.iter().map(|line| format!("\n          {line}")).collect()
}

impl Summary {
    fn text(&self) -> String {
        let (short, unit) = (text::short, self.symbol);
        let mut lines = vec![format!(
            "{}: {} at {} Hz in {}, output {} to {} {unit}",
            self.device,
            text::count(self.samples, "sample"),
            self.rate_hz,
            text::count(self.segments, "segment"),
            short(self.lowest_output),
            short(self.highest_output)
        )];
        lines.extend(self.tracking.as_ref().map(|t| {
            let (rmse, share, most) = (short(t.rmse), text::percent(t.nrmse_percent), short(t.max_abs));
            let late = short(t.rmse_last_half);
            let mut line = format!(
                "tracking: RMSE {rmse} {unit} ({share} of the reference's span), largest {most} {unit}; RMSE of the last half {late} {unit}"
            );
            // Only for feedforward without limits: otherwise hysteresis, a limit or a slow loop causes the offset.
            let free = self.compensation.as_ref().is_some_and(Compensation::is_unlimited);
            let is_offset = t.rmse_about_mean < MAX_SHARE_WITHOUT_OFFSET * t.rmse;
            if self.control == Some(Control::Feedforward) && free && is_offset {
                let (above, offset) = (if t.mean < 0.0 { "below" } else { "above" }, short(t.mean.abs()));
                line += &format!(
                    "\n          most of it is an offset: the output is {offset} {unit} {above} the reference, and without the \
                     offset the RMSE is {} {unit}; the cause is the sensor zero or the history of earlier runs (--control \
                     pid+feedforward removes it)",
                    short(t.rmse_about_mean)
                );
            }
            line + &tracking_details(t, unit)
        }));
        lines.extend(self.pid.as_ref().map(|pid| pid.text(self.symbol)));
        lines.extend(self.compensation.as_ref().map(Compensation::text));
        if self.loop_on_device {
            lines.push("the loop was closed on the device".to_owned());
        }
        if self.temperature_followed {
            lines.push("the drive was corrected for the measured temperature".to_owned());
        }
        if let Some(change) = &self.adapted {
            lines.push(match change.updates {
                0 => "adapted: nothing was learned, because the drive did not cover its range in both directions"
                    .to_owned(),
                _ => format!("adapted: {}", change.text(unit)),
            });
        }
        lines.extend(self.force_n.map(|(low, high)| {
            format!(
                "force: {} to {} N relative to the start of the run; the history of earlier runs appears as a force, too; the \
                 model is not monitored during a force estimate",
                short(low),
                short(high)
            )
        }));
        lines.extend(self.gaps.text());
        lines.extend(self.watch.and_then(|watch| watch.text(unit)));
        if let (Some(WatchSummary { explains: false, .. }), Some(log), Some(model)) =
            (self.watch, &self.log, &self.model)
        {
            // The output must not be the model that is read.
            let extended =
                if Path::new(model).ends_with("extended.json") { "extended-again.json" } else { "extended.json" };
            lines.push(format!("next: hystctl diagnose {log} --model {model} -o {extended}"));
        }
        lines.extend(self.log.iter().map(|path| format!("log: {path}")));
        lines.extend(self.record.iter().map(|path| format!("record: {path}")));
        lines.join("\n")
    }
}
