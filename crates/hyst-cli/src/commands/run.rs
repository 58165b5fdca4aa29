//! `run`: plays a drive, or a reference through a model, on a device.

mod adapt;
mod beside;
mod control;
pub(super) mod gaps;
mod guard;
pub(super) mod interrupt;
pub(super) mod job;
mod live;
mod lookout;
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
use crate::device::{AnyDevice, Wishes};
use crate::exit::{CommandError, CommandResult, Exit};
use crate::log::{LoggedModel, RunInfo, RunLog};
use crate::output::{self, Report, Target};
use crate::recording::Beside;
use crate::{recording, text};
use adapt::{Adapting, Change};
use beside::Watched;
use gaps::Gaps;
use job::{Followed, HandedOver, Job, Told};
use play::Played;

/// What is said about a run.
#[derive(Debug, Serialize)]
struct Summary {
    device: String,
    rate_hz: f64,
    samples: usize,
    segments: usize,
    unit: &'static str,
    lowest_output: f64,
    highest_output: f64,
    /// None when a drive was played.
    tracking: Option<Tracking>,
    compensation: Option<Compensation>,
    /// None when a drive was played.
    control: Option<Control>,
    /// None without a PID.
    pid: Option<Gains>,
    /// Whether the device closed the loop.
    loop_on_device: bool,
    /// Whether the model still explains the device; none where that was not watched.
    watch: Option<WatchSummary>,
    /// Lowest and highest estimated force, counted from what acted when the run began \[N\]; none where none is estimated.
    force_n: Option<(f64, f64)>,
    /// Periods for which the device had nothing to put out.
    gaps: Gaps,
    /// The device's clock against this computer's; none where it has no other.
    clock: Option<ClockSummary>,
    /// Whether the drive was corrected by the measured temperature on the way.
    temperature_followed: bool,
    /// How the actuator differs from its model, as learned by the end; none where that was not asked for.
    adapted: Option<Change>,
    log: Option<String>,
    record: Option<String>,
    #[serde(skip)]
    model: Option<String>,
    #[serde(skip)]
    symbol: &'static str,
}

/// An offset is told where less than this share of the error is left without it.
const MOSTLY_OFFSET: f64 = 0.5;

/// Whether the model still explains the device.
#[derive(Clone, Copy, Debug, Serialize)]
struct WatchSummary {
    explains: bool,
    /// When it stopped doing so for the first time, by the device's clock \[s\].
    lost_at_s: Option<f64>,
    /// Of the last block \[output unit\].
    residual_rms: f64,
    /// Of the model's own record \[output unit\].
    fitted_rms: f64,
}

impl WatchSummary {
    fn text(&self, unit: &str) -> Option<String> {
        let (now, fitted) = (text::short(self.residual_rms), text::short(self.fitted_rms));
        self.lost_at_s.map(|at| {
            format!(
                "from {} s on the model did not explain the device: {now} {unit} of residual at the end, {fitted} {unit} where it was fitted",
                text::short(at)
            )
        })
    }

    fn new(Watched { lost_at, residual, trained_to }: Watched) -> Self {
        Self { explains: lost_at.is_none(), lost_at_s: lost_at, residual_rms: residual, fitted_rms: trained_to }
    }
}

/// The device's clock against this computer's.
#[derive(Clone, Copy, Debug, Serialize)]
struct ClockSummary {
    /// When period 0 of the run began \[s since 1970-01-01 UTC\], and to what that is known \[s\].
    began_unix_s: f64,
    uncertainty_s: f64,
    /// By how much the device's clock is faster; none for a short run.
    faster_ppm: Option<f64>,
}

impl ClockSummary {
    fn new(ClockFit { began_unix_s, faster_ppm, uncertainty_s }: ClockFit) -> Self {
        Self { began_unix_s, uncertainty_s, faster_ppm }
    }

    /// As a log has it.
    fn entries(&self) -> BTreeMap<String, String> {
        let mut entries = BTreeMap::from([
            ("began_unix_s".to_owned(), self.began_unix_s.to_string()),
            ("uncertainty_s".to_owned(), self.uncertainty_s.to_string()),
        ]);
        entries.extend(self.faster_ppm.map(|ppm| ("faster_ppm".to_owned(), ppm.to_string())));
        entries
    }
}

/// A PID that took part.
#[derive(Debug, Serialize)]
struct Gains {
    /// \[V/y\]
    proportional: f64,
    /// \[V/(y s)\]
    integral: f64,
    /// \[V s/y\]
    derivative: f64,
    /// Where the loop's gain falls below one, as the model has it; none for given gains \[Hz\].
    crossover_hz: Option<f64>,
    /// Share of the samples in which a limit held the drive; on a device, and the output away from its reference \[%\].
    limited_percent: Option<f64>,
    /// Why the gains are these, in words.
    why: String,
}

/// Runs the command.
pub(super) fn run(args: &RunArgs) -> CommandResult {
    let log = args.log.clone().map(Target::File);
    let written: Vec<&Target> = log.iter().chain(&args.record).collect();
    if args.drive.is_some() && written.is_empty() {
        return Err(CommandError::bad_input("what is measured would be lost: give --record, --log or both"));
    }
    if args.log.as_deref() == Some(Path::new("-")) {
        return Err(CommandError::bad_input("--log needs a file: a log cannot be written to stdout"));
    }
    let mut read: Vec<&Path> = args.daq.file().into_iter().collect();
    read.extend([&args.model, &args.reference, &args.drive].into_iter().filter_map(|path| path.as_deref()));
    let kept = args.adapt.clone().flatten().map(Target::File);
    output::check(&read, &[&written[..], &kept.iter().collect::<Vec<_>>()].concat())?;
    let report = Report::new(args.json.json, &written)?;
    let wishes = Wishes {
        noise: args.seed,
        voltage: args.limits.limit.map(|limit| (limit.low, limit.high)),
        slew_v_per_s: args.limits.slew,
        force: args.kout.is_some() && args.control.closes(),
        silence_s: args.silence,
        hottest_degc: args.hottest,
        error: args.max_error,
    };
    on_device(&mut AnyDevice::open(&args.daq, &wishes)?, args, report)
}

/// The run on a device.
fn on_device(daq: &mut AnyDevice, args: &RunArgs, report: Report) -> CommandResult {
    let mut job = Job::read(args, daq.capabilities())?;
    if args.record.is_none() && args.log.is_none() {
        output::say("note: what is measured is not kept; give --record, --log or both");
    }
    if let Some(foreseen) = job.foreseen() {
        output::say(&format!("note: {foreseen}"));
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
    // All that can be refused has been, but by the device itself.
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
    // What was measured is kept in any case; the first error is the one to tell.
    if let Some((path, older)) = log.as_ref().and_then(|log| Some((log.path(), log.older()?))) {
        output::tell_set_aside(path, older);
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
    let beside: Beside = wanted.into_iter().chain(forces).collect();
    if let Some(error) = error {
        if let Some(target) = &args.record {
            recording::keep_partial(recording, beside, target, unit);
        }
        return Err(error);
    }
    let recording = recording::split(recording);
    if let Some(target) = &args.record {
        let record = recording::to_record(&recording, &target.to_string(), unit)?;
        target.write_measured(|out| record.write_with(out, &recording::extra(&beside)).map_err(output::io_error))?;
    }
    // The record may lie on another disk than a log that could not be closed.
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

/// Clears the fault of an earlier run, and says which it was.
pub(super) fn clear(daq: &mut AnyDevice) -> CommandResult<Option<String>> {
    let fault = daq.clear()?.map(Stated::of).map(|Stated { code, text }| format!("{code}: {text}"));
    fault.iter().for_each(|fault| output::say(&format!("note: cleared fault {fault}, of an earlier run")));
    Ok(fault)
}

/// What was asked for, as a log has it.
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
    fn of(Told { gains, why, crossover_hz, limited_percent }: Told<'_>) -> Self {
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
            line += &format!("; a limit held its drive in {} of the samples", text::percent(share));
        }
        line
    }
}

/// What is said of delay, turning points and harmonics, each in a line of its own.
fn tracking_details(tracking: &Tracking, unit: &str) -> String {
    let short = text::short;
    let mut lines = Vec::new();
    if let Some(delay) = tracking.delay_s {
        let how = if delay < 0.0 { "earlier" } else { "later" };
        lines.push(format!("against the reference {} ms {how}, which was allowed", short(1e3 * delay.abs())));
    }
    if let Some(Turning { points, near_percent, rmse, max_abs, rmse_between }) = tracking.turning {
        lines.push(format!(
            "near {} ({} of the way to the next one): RMSE {} {unit}, largest {} {unit}; between them RMSE {} {unit}",
            text::count(points, "turning point"),
            text::percent(near_percent),
            short(rmse),
            short(max_abs),
            short(rmse_between)
        ));
    }
    if !tracking.harmonics.is_empty() {
        let said = |h: &Harmonic| format!("{} Hz {} at {:.2}°", short(h.frequency_hz), short(h.gain), h.phase_deg);
        let said: Vec<String> = tracking.harmonics.iter().map(said).collect();
        lines.push(format!("gain and phase of the harmonics: {}", said.join(", ")));
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
            // Without the inverse it is the hysteresis, with feedback a limit or a loop that is too slow.
            let free = self.compensation.as_ref().is_some_and(Compensation::is_unlimited);
            if self.control == Some(Control::Feedforward) && free && t.rmse_about_mean < MOSTLY_OFFSET * t.rmse {
                let (above, offset) = (if t.mean < 0.0 { "below" } else { "above" }, short(t.mean.abs()));
                line += &format!(
                    "\n          most of it is an offset: it stands {offset} {unit} {above} the reference, and RMSE {} {unit} is left about that; the sensor's zero, or what earlier runs have left in the actuator (--control pid+feedforward takes it)",
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
            lines.push("the drive was corrected by the measured temperature on the way".to_owned());
        }
        if let Some(change) = &self.adapted {
            lines.push(match change.updates {
                0 => "adapted: nothing was learned; the drive has to go over its range both ways first".to_owned(),
                _ => format!("adapted: {}", change.text(unit)),
            });
        }
        lines.extend(self.force_n.map(|(low, high)| {
            format!(
                "force: {} to {} N beyond what acted when the run began, and what the actuator remembered of earlier runs; the model is not watched meanwhile",
                short(low),
                short(high)
            )
        }));
        lines.extend(self.gaps.text());
        lines.extend(self.watch.and_then(|watch| watch.text(unit)));
        if let (Some(WatchSummary { explains: false, .. }), Some(log), Some(model)) =
            (self.watch, &self.log, &self.model)
        {
            // Not over the model that is read.
            let extended =
                if Path::new(model).ends_with("extended.json") { "extended-again.json" } else { "extended.json" };
            lines.push(format!("next: hystctl diagnose {log} --model {model} -o {extended}"));
        }
        lines.extend(self.log.iter().map(|path| format!("log: {path}")));
        lines.extend(self.record.iter().map(|path| format!("record: {path}")));
        lines.join("\n")
    }
}
