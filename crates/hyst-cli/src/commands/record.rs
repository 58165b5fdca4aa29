//! `record`: records the sensors of a device at rest.

use std::path::Path;

use hyst_hw::Daq;
use hyst_ident::range;
use serde::Serialize;

use super::run::gaps::Gaps;
use super::run::job::Job;
use super::run::limits::thermometer;
use super::run::play::{Played, play};
use crate::cli::RecordArgs;
use crate::device::{AnyDevice, DeviceOptions};
use crate::exit::{CommandError, CommandResult, Exit};
use crate::log::{RunInfo, RunLog};
use crate::output::{self, Report, Target};
use crate::{recording, text};

/// Default sample rate, within the range of the device \[Hz\].
const DEFAULT_RATE_HZ: f64 = 1000.0;
/// Maximum number of samples.
const MAX_SAMPLES: f64 = 1e8;

/// Report of a recording.
#[derive(Debug, Serialize)]
struct Summary {
    device: String,
    rate_hz: f64,
    samples: usize,
    unit: &'static str,
    /// Voltage of the device at rest \[V\].
    rest_v: f64,
    /// Mean output \[output unit\].
    mean: f64,
    /// Standard deviation of the output \[output unit\].
    deviation: f64,
    /// Maximum minus minimum of the output \[output unit\].
    span: f64,
    /// Missing sample periods.
    gaps: Gaps,
    log: Option<String>,
    record: Option<String>,
    #[serde(skip)]
    symbol: &'static str,
}

/// Runs the command.
pub(super) fn run(args: &RecordArgs) -> CommandResult {
    let log = args.log.clone().map(Target::File);
    let written: Vec<&Target> = log.iter().chain(&args.output).collect();
    if written.is_empty() {
        return Err(CommandError::bad_input("the measured data would be lost; give -o, --log or both"));
    }
    if args.log.as_deref() == Some(Path::new("-")) {
        return Err(CommandError::bad_input("--log needs a file: a log cannot be written to stdout"));
    }
    let read: Vec<&Path> = args.daq.file().into_iter().collect();
    output::check(&read, &written)?;
    let report = Report::new(args.json.json, &written)?;
    let device_options = DeviceOptions { noise: args.seed, hottest_degc: args.hottest, ..DeviceOptions::default() };
    let mut daq = AnyDevice::open(&args.daq, &device_options)?;
    daq.observe();
    let can = daq.capabilities().clone();
    let rate_hz = args.rate.unwrap_or(DEFAULT_RATE_HZ.clamp(can.min_rate_hz, can.max_rate_hz));
    let rows = (args.seconds * rate_hz).round();
    if !(1.0..=MAX_SAMPLES).contains(&rows) {
        let message = format!(
            "{} s at {rate_hz} Hz are {rows} samples, expected 1 to {MAX_SAMPLES}; give another --seconds or --rate",
            args.seconds
        );
        return Err(CommandError::bad_input(message));
    }
    if daq.present_v() != can.voltage.rest_v {
        let message = format!(
            "{} is at {} V, but rests at {} V, so it would move at the end; ramp it to rest first (hystctl stop)",
            can.device,
            daq.present_v(),
            can.voltage.rest_v
        );
        return Err(CommandError::bad_input(message));
    }
    thermometer(args.hottest, &can)?;
    let mut job = Job::at_rest(&can, rows as usize, rate_hz, args);
    let unit = recording::unit(can.output);
    let info = RunInfo { device: &can.device, output: unit, sample_rate_hz: rate_hz, model: None };
    let mut log = match &args.log {
        Some(path) => Some(RunLog::beside_older(path, &info).map_err(|error| CommandError::new(Exit::Failed, error))?),
        None => None,
    };
    let played = play(&mut daq, &mut job, log.as_mut());
    if let Some((path, older)) = log.as_ref().and_then(|log| Some((log.path(), log.older()?))) {
        output::print_renamed(path, older);
    }
    let closed = log.filter(|log| log.samples() > 0).map_or(Ok(()), RunLog::finish);
    let Played { recording, gaps, error, .. } = played?;
    if let Some(error) = error {
        if let Some(target) = &args.output {
            recording::keep_partial(recording, Vec::new(), target, unit);
        }
        return Err(error);
    }
    let recording = recording::split(recording);
    if let Some(target) = &args.output {
        let record = recording::to_record(&recording, &target.to_string(), unit)?;
        target.write_measured(|out| record.write_with(out, &[]).map_err(output::io_error))?;
    }
    // After the record, which may be on another disk than a log that could not be closed.
    closed?;
    let measured: Vec<f64> = recording.segments.iter().flat_map(|s| &s.samples).map(|s| s.output).collect();
    let count = measured.len().max(1) as f64;
    let mean = measured.iter().sum::<f64>() / count;
    let deviation = (measured.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / count).sqrt();
    let (low, high) = range(measured.iter().copied());
    let summary = Summary {
        device: can.device,
        rate_hz: recording.rate_hz,
        samples: measured.len(),
        unit: unit.suffix(),
        rest_v: can.voltage.rest_v,
        mean,
        deviation,
        span: high - low,
        gaps,
        log: args.log.as_ref().map(|path| path.display().to_string()),
        record: args.output.as_ref().map(ToString::to_string),
        symbol: unit.symbol(),
    };
    report.print(&summary.text(), &summary)
}

impl Summary {
    fn text(&self) -> String {
        let (short, unit) = (text::short, self.symbol);
        let mut lines = vec![format!(
            "{}: {} at {} Hz, nothing moved; mean output {} {unit} at {} V, standard deviation {} {unit}, span {} {unit}",
            self.device,
            text::count(self.samples, "sample"),
            self.rate_hz,
            short(self.mean),
            short(self.rest_v),
            short(self.deviation),
            short(self.span)
        )];
        lines.extend(self.gaps.text());
        lines.extend(self.log.iter().map(|path| format!("log: {path}")));
        lines.extend(self.record.iter().map(|path| format!("record: {path}")));
        lines.join("\n")
    }
}
