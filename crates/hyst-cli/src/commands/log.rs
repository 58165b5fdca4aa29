//! `log`: inspects the log of a run, converts it to a record, or recovers a log that was cut off.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use hyst_ident::record::{LogEvent, LogSample, RunLog};
use serde::Serialize;

use crate::cli::{LogArgs, LogCommand, LogConvertArgs, LogInfoArgs, LogRecoverArgs};
use crate::exit::{CommandError, CommandResult};
use crate::input;
use crate::log::recovered;
use crate::output::{self, Report};
use crate::report::next::quoted;
use crate::text;

/// Runs the command.
pub(super) fn run(args: &LogArgs) -> CommandResult {
    match &args.command {
        LogCommand::Info(args) => info(args),
        LogCommand::Convert(args) => convert(args),
        LogCommand::Recover(args) => recover(args),
    }
}

fn read(path: &Path) -> CommandResult<(Vec<u8>, RunLog)> {
    let name = path.display().to_string();
    let bytes = fs::read(path).map_err(|error| CommandError::bad_input(format!("{name}: cannot be read: {error}")))?;
    let log = RunLog::parse(&name, &bytes)?;
    Ok((bytes, log))
}

/// Report of a log.
#[derive(Debug, Serialize)]
struct Summary {
    log: String,
    /// Whether it was closed; if not, it was cut off.
    closed: bool,
    /// Damaged chunks of samples and other damaged records, which are left out.
    damaged: usize,
    samples: usize,
    /// Gaps within segments; after each a new segment begins.
    holes: usize,
    /// Samples of segments, without those of ramps.
    record_samples: usize,
    segments: usize,
    /// Duration \[s\].
    seconds: f64,
    /// RMS of output minus reference \[output unit\]; `None` without a reference.
    tracking_rmse: Option<f64>,
    model: bool,
    metadata: BTreeMap<String, String>,
    /// Events during the run.
    events: Vec<LogEvent>,
    #[serde(skip)]
    symbol: &'static str,
}

impl Summary {
    fn new(path: &Path, log: &RunLog) -> Self {
        let record = log.record_samples();
        let errors: Vec<f64> = record.iter().filter_map(|s| Some(s.output - s.reference?)).collect();
        let rmse = (errors.iter().map(|e| e * e).sum::<f64>() / errors.len().max(1) as f64).sqrt();
        let time = |s: Option<&LogSample>| s.map_or(0.0, |s| s.time_s);
        let mut segments: Vec<u64> = record.iter().map(|s| s.segment).collect();
        segments.dedup();
        Self {
            log: path.display().to_string(),
            closed: !log.lost.cut_off,
            damaged: log.lost.damaged,
            holes: log.lost.holes,
            samples: log.samples.len(),
            record_samples: record.len(),
            segments: segments.len(),
            seconds: time(log.samples.last()) - time(log.samples.first()),
            tracking_rmse: (!errors.is_empty()).then_some(rmse),
            model: log.model.is_some(),
            metadata: log.metadata.clone(),
            events: log.events.clone(),
            symbol: log.unit().map_or("", |unit| unit.symbol()),
        }
    }

    fn text(&self) -> String {
        let mut lines = vec![format!(
            "{}: {} over {} s, {} of them in {}; {}",
            self.log,
            text::count(self.samples, "sample"),
            text::short(self.seconds),
            self.record_samples,
            text::count(self.segments, "segment"),
            if self.closed {
                "closed".to_owned()
            } else {
                format!("cut off; hystctl log recover {} -o whole.mcap makes a closed log from it", quoted(&self.log))
            }
        )];
        lines.extend(input::damage(self.damaged));
        lines.extend(input::gaps(self.holes));
        lines.extend(
            self.tracking_rmse
                .map(|rmse| format!("output minus reference: RMSE {} {}", text::short(rmse), self.symbol)),
        );
        let line = |event: &LogEvent| format!("at {} s {}: {}", text::short(event.time_s), event.kind, event.text);
        lines.extend(self.events.iter().map(line));
        lines.extend(self.metadata.iter().map(|(key, value)| format!("  {key}: {value}")));
        lines.extend(self.model.then(|| "  attached: model.json".to_owned()));
        lines.join("\n")
    }
}

fn info(args: &LogInfoArgs) -> CommandResult {
    let (_, log) = read(&args.log)?;
    let summary = Summary::new(&args.log, &log);
    Report::new(args.json.json, &[])?.print(&summary.text(), &summary)
}

fn convert(args: &LogConvertArgs) -> CommandResult {
    output::check(&[&args.log], &[&args.output])?;
    let (_, log) = read(&args.log)?;
    if log.samples.is_empty() {
        let what = input::damage(log.lost.damaged).unwrap_or_else(|| "it ends before the first sample".to_owned());
        return Err(CommandError::bad_input(format!("{}: the log has no sample: {what}", args.log.display())));
    }
    let text = log.csv(&args.log.display().to_string(), args.ramps)?;
    input::losses(log.lost).iter().for_each(|loss| output::say(&format!("note: {loss}")));
    if !args.ramps && !log.samples.iter().any(LogSample::is_record) {
        let many = text::count(log.samples.len(), "sample");
        output::say(&format!("note: the log has {many}, all of them in ramps; --ramps includes them"));
    }
    args.output.write(|out| out.write_all(text.as_bytes()))
}

/// Report of a recovery.
#[derive(Debug, Serialize)]
struct Recovered {
    log: String,
    output: String,
    samples: usize,
    /// Whether the log was closed before.
    was_closed: bool,
    /// Damaged chunks of samples and other damaged records, which were left out.
    damaged: usize,
}

fn recover(args: &LogRecoverArgs) -> CommandResult {
    output::check(&[&args.log], &[&args.output])?;
    output::refuse_terminal(&args.output, "a log")?;
    let report = Report::new(args.json.json, &[&args.output])?.on_stderr();
    let (bytes, log) = read(&args.log)?;
    let whole = recovered(&bytes).map_err(CommandError::failed)?;
    args.output.write(|out| out.write_all(&whole))?;
    let done = Recovered {
        log: args.log.display().to_string(),
        output: args.output.to_string(),
        samples: log.samples.len(),
        was_closed: !log.lost.cut_off,
        damaged: log.lost.damaged,
    };
    let how = if !log.lost.cut_off { "was already closed" } else { "was cut off" };
    let line = format!("{} {how}; {}: {}", done.log, done.output, text::count(done.samples, "sample"));
    let lines: Vec<String> = std::iter::once(line).chain(input::damage(done.damaged)).collect();
    report.print(&lines.join("\n"), &done)
}
