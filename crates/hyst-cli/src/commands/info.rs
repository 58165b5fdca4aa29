//! `info`: shows what a file holds, its possible problems, and the next command.

use std::collections::HashSet;
use std::path::Path;

use hyst_ident::noise::{noise_floor, quantisation};
use hyst_ident::range;
use hyst_ident::record::{Channel, ColumnMap, MAX_CHANNELS, OutputUnit, Reading, Record, RecordError, Survey};
use hyst_ident::spikes::spikes_of;
use ratatui::buffer::Buffer;
use ratatui::layout::Rect;
use ratatui::symbols::Marker;
use ratatui::widgets::Widget;
use ratatui::widgets::canvas::{Canvas, Points};
use serde::Serialize;

use crate::cli::InfoArgs;
use crate::exit::{CommandError, CommandResult};
use crate::output::Report;
use crate::report::next::{further, quoted};
use crate::{input, text};

/// A channel in the report.
#[derive(Debug, Serialize)]
struct ChannelSummary {
    name: String,
    /// Column of the record that it is read as.
    role: Option<&'static str>,
    /// Unit stated by the file.
    unit: Option<&'static str>,
    /// Unit stated by `--map`, which replaces that of the file.
    mapped_unit: Option<&'static str>,
    /// Factor from the numbers of the file to `mapped_unit`, if `--map` has one.
    scale: Option<f64>,
    /// Whether the file states the unit outside the name of the channel.
    #[serde(skip)]
    unit_outside_name: bool,
    rows: usize,
    missing: usize,
    min: Option<f64>,
    max: Option<f64>,
    /// Smallest difference between two values.
    resolution: f64,
}

/// The record in the report.
#[derive(Debug, Serialize)]
struct RecordSummary {
    rows: usize,
    sample_rate_hz: f64,
    seconds: f64,
    segments: usize,
    /// Whether uneven times were resampled to an even grid; a note has the size of the jitter.
    resampled: bool,
    /// Source of the times.
    times: Option<String>,
    input: Option<String>,
    output: Option<&'static str>,
    temperature: bool,
    load: bool,
    /// White noise of the output, standard deviation \[output unit\].
    noise: Option<f64>,
    /// `noise` as a share of the output's span.
    noise_share: Option<f64>,
}

#[derive(Debug, Serialize)]
struct Summary {
    file: String,
    format: String,
    channels: Vec<ChannelSummary>,
    record: Option<RecordSummary>,
    /// Reason why the channels are not a record, and what to type.
    missing: Option<String>,
    /// Possible problems of the record.
    warnings: Vec<String>,
    /// What was done to read the record.
    notes: Vec<String>,
    next: Option<String>,
    #[serde(skip)]
    picture: String,
}

/// Runs the command.
pub(super) fn run(args: &InfoArgs) -> CommandResult {
    let how = Reading { map: ColumnMap::parse(&args.map.map)?, rate: args.map.rate };
    let survey = Survey::read(&args.file, &how)?;
    let summary = summary(args, survey);
    let report = Report::new(args.json.json, &[])?;
    report.print(&summary.text(), &summary)?;
    // A file without channels is bad input. Channels that are not a record yet are a valid result of `info`.
    match (summary.channels.is_empty(), &summary.missing) {
        (true, Some(why)) => Err(CommandError::bad_input(why.clone())),
        _ => Ok(()),
    }
}

/// Columns and factors of `--map` for units other than V, µm and s.
const OTHER_UNITS: &str = "displacement_nm, displacement_mm, force_n, time_ms, time_us, and 0.001*COLUMN for mV";
/// Place of a number in a proposed option.
const SCALE: &str = "=GAIN*";

fn summary(args: &InfoArgs, survey: Survey) -> Summary {
    let file = args.file.display().to_string();
    let (record, missing, advice) = match survey.record {
        Ok(record) => (Some(record), None, None),
        Err(RecordError::Columns { problems, options, .. }) if !options.is_empty() => {
            let next = format!("hystctl info {} {options}", quoted(&file));
            let how = if options.contains(SCALE) {
                "Put the number into the command below and run it"
            } else {
                "If columns and units are right, run the command below (for a sensor in V with GAIN*COLUMN, where GAIN is \
                 its scale in µm/V)"
            };
            (None, Some(format!("{problems}. {how}; --map also takes {OTHER_UNITS}")), Some(next))
        }
        Err(error) => (None, Some(error.to_string()), None),
    };
    let mut warnings: Vec<String> = survey.channels.iter().filter_map(constant).collect();
    let text = |(name, cell): &(String, String)| format!("\"{name}\" is not read: it holds text (\"{cell}\")");
    warnings.extend(survey.texts.iter().map(text));
    warnings.extend(record.iter().flat_map(input::warnings));
    let is_shown = |note: &&String| {
        // The table shows the roles of the channels, and a warning has more about a log that was cut off.
        (!note.contains(" is read as ") || note.contains("converted")) && !note.starts_with("the log was cut off")
    };
    let notes = record.iter().flat_map(|record| record.notes().iter().filter(is_shown).cloned()).collect();
    let options = further(&input::columns(&args.map));
    let next = match &record {
        Some(record) if cannot_be_fitted(record) => None,
        Some(record) => next(&file, record, &options),
        None => advice,
    };
    let times = survey.times;
    let channel = |c: &Channel| ChannelSummary {
        name: c.name.clone(),
        role: c.role,
        unit: c.unit,
        mapped_unit: c.mapped_unit,
        scale: c.scale,
        unit_outside_name: c.unit_outside_name,
        rows: c.rows,
        missing: c.missing,
        min: c.range.map(|r| r.0),
        max: c.range.map(|r| r.1),
        resolution: c.step,
    };
    Summary {
        file,
        format: survey.format,
        channels: survey.channels.iter().map(channel).collect(),
        picture: record.as_ref().map(picture).unwrap_or_default(),
        record: record.as_ref().map(|record| of_record(record, times.clone())),
        missing: missing.map(|why| match &times {
            Some(times) if record.is_none() => format!("{why}. Times come from {times}"),
            _ => why,
        }),
        warnings,
        notes,
        next,
    }
}

/// Whether a record has input and output, but one of them is constant, so that a fit refuses it.
fn cannot_be_fitted(record: &Record) -> bool {
    !record.input().is_empty() && record.output().is_some() && input::refuse_constant(record).is_err()
}

/// Returns a warning about a constant channel. A segment, a temperature or a load may be constant.
fn constant(channel: &Channel) -> Option<String> {
    let (low, high) = channel.range?;
    let is_fitted = channel.role.is_none_or(|role| matches!(role, "input" | "output" | "time"));
    (low == high && is_fitted).then(|| {
        format!(
            "\"{}\" is constant, {} in every row; it cannot be fitted as an input or output",
            channel.name,
            text::short(low)
        )
    })
}

fn of_record(record: &Record, times: Option<String>) -> RecordSummary {
    // Noise below the steps of a converter is not visible.
    let noise = record.output().map(|y| noise_floor(y, record.segments()).max(quantisation(y)));
    let spikes = spikes_of(record);
    let spiked: HashSet<usize> = spikes.iter().map(|spike| spike.row).collect();
    let is_spike = |row: usize| spiked.contains(&row);
    let span = record.output().map(|y| {
        let (low, high) = range((0..y.len()).filter(|row| !is_spike(*row)).map(|row| y[row]));
        high - low
    });
    let time = record.time();
    RecordSummary {
        rows: record.rows(),
        sample_rate_hz: 1.0 / record.sample_period(),
        seconds: time.last().unwrap_or(&0.0) - time.first().unwrap_or(&0.0),
        segments: record.segments().len(),
        resampled: record.resampled(),
        times,
        input: (!record.input().is_empty()).then(|| record.input_column().to_owned()),
        output: record.output_unit().map(|unit| unit.column()),
        temperature: record.temperature().is_some(),
        load: record.load().is_some(),
        noise,
        noise_share: noise.zip(span).map(|(noise, span)| noise / span).filter(|share| share.is_finite()),
    }
}

/// Returns the next command for this record.
fn next(file: &str, record: &Record, options: &str) -> Option<String> {
    let model = Path::new(file).file_stem().map_or("model".into(), |stem| stem.to_string_lossy());
    let model = quoted(&format!("{model}-pi.json"));
    let file = quoted(file);
    match (record.input().is_empty(), record.output().is_some()) {
        (false, true) => Some(format!("hystctl fit {file}{options} --model pi -o {model}")),
        (false, false) => Some(format!("hystctl simulate --model MODEL.json {file}{options} -o predicted.csv")),
        (true, true) => Some(format!("hystctl compensate --model MODEL.json {file}{options} -o drive.csv")),
        (true, false) => None,
    }
}

/// Width and height of the picture \[characters\].
const PICTURE: (u16, u16) = (64, 18);
/// Maximum number of points of the picture.
const MAX_POINTS: usize = 20_000;

/// Returns a plot of output over input, or of one of them over time, as text.
fn picture(record: &Record) -> String {
    let time = record.time();
    let (x, y, names) = match (record.input(), record.output()) {
        (u, Some(y)) if !u.is_empty() => {
            (u, y, (record.input_column(), record.output_unit().map_or("", |unit| unit.column())))
        }
        (_, Some(y)) => (time, y, ("time_s", record.output_unit().map_or("", |unit| unit.column()))),
        (u, None) => (time, u, ("time_s", record.input_column())),
    };
    let step = x.len().div_ceil(MAX_POINTS).max(1);
    let spiked: HashSet<usize> = spikes_of(record).iter().map(|spike| spike.row).collect();
    let points: Vec<(f64, f64)> =
        (0..x.len()).step_by(step).filter(|k| !spiked.contains(k)).map(|k| (x[k], y[k])).collect();
    let bounds = |of: fn(&(f64, f64)) -> f64| {
        let (low, high) = range(points.iter().map(of));
        if high > low { [low, high] } else { [low - 1.0, low + 1.0] }
    };
    let (across, up) = (bounds(|p| p.0), bounds(|p| p.1));
    let area = Rect::new(0, 0, PICTURE.0, PICTURE.1);
    let mut buffer = Buffer::empty(area);
    Canvas::default()
        .marker(Marker::Braille)
        .x_bounds(across)
        .y_bounds(up)
        .paint(|context| context.draw(&Points { coords: &points, color: ratatui::style::Color::Reset }))
        .render(area, &mut buffer);
    let line = |row: u16| {
        let cells: String = (0..PICTURE.0).map(|column| buffer[(column, row)].symbol()).collect();
        format!("  {}", cells.trim_end())
    };
    let lines: Vec<String> = (0..PICTURE.1).map(line).collect();
    format!(
        "  vertical: {}, {} to {}\n{}\n  horizontal: {}, {} to {}",
        names.1,
        text::short(up[0]),
        text::short(up[1]),
        lines.join("\n"),
        names.0,
        text::short(across[0]),
        text::short(across[1])
    )
}

/// Formats a resolution; the resolution of doubles is often very small and is written with an exponent.
fn resolution(step: f64) -> String {
    if step > 0.0 && step < 1e-4 { format!("{step:.1e}") } else { text::short(step) }
}

impl Summary {
    fn text(&self) -> String {
        let mut lines = vec![format!("{}: {}", self.file, self.format), String::new()];
        let wide = self.channels.iter().map(|c| c.name.chars().count()).max().unwrap_or(0).clamp(7, 40);
        lines.push(format!(
            "  {:wide$}  {:11}  {:>8}  {:>11}  {:>11}  {:>12}  {:>8}  {:>7}",
            "channel", "read as", "unit", "min", "max", "resolution", "rows", "missing"
        ));
        for c in &self.channels {
            let number = |value: Option<f64>| value.map_or("-".to_owned(), text::short);
            let name: String = c.name.chars().take(40).collect();
            let scale = c.scale.map_or_else(String::new, |scale| format!("{scale} "));
            let unit = match (c.unit, c.mapped_unit) {
                (_, Some(unit)) => format!("{scale}{unit}*"),
                (Some(unit), None) => unit.to_owned(),
                (None, None) if matches!(c.role, Some("segment")) || c.name == "segment" => "-".to_owned(),
                (None, None) => "?".to_owned(),
            };
            lines.push(format!(
                "  {name:wide$}  {:11}  {unit:>8}  {:>11}  {:>11}  {:>12}  {:>8}  {:>7}",
                c.role.unwrap_or("-"),
                number(c.min),
                number(c.max),
                resolution(c.resolution),
                c.rows,
                c.missing
            ));
        }
        if self.channels.iter().any(|c| c.mapped_unit.is_some()) {
            lines.push("  * from --map, not from the file".to_owned());
        }
        if self.channels.iter().any(|c| c.unit_outside_name) {
            lines.push("  units that are not in a name come from the header, a row of units or attributes".to_owned());
        }
        if self.channels.len() == MAX_CHANNELS {
            lines.push(format!("  (only the first {MAX_CHANNELS} channels)"));
        }
        lines.push(String::new());
        if let Some(record) = &self.record {
            lines.push(format!(
                "record: {} over {} s in {}, {} samples per second, times {}",
                text::count(record.rows, "row"),
                text::short(record.seconds),
                text::count(record.segments, "segment"),
                text::short(record.sample_rate_hz),
                if record.resampled { "uneven (note below)" } else { "even within rounding" }
            ));
            let uses = [
                ("times from", record.times.as_deref()),
                ("input", record.input.as_deref()),
                ("output", record.output),
                ("temperature", record.temperature.then_some("temperature_degc")),
                ("load", record.load.then_some("load_n")),
            ];
            let uses = uses.into_iter().filter_map(|(what, name)| Some(format!("{what} {}", name?)));
            lines.push(uses.collect::<Vec<_>>().join(", "));
            if let (Some(noise), Some(share), Some(column)) = (record.noise, record.noise_share, record.output) {
                let unit = OutputUnit::of_column(column).map_or("", OutputUnit::symbol);
                lines.push(format!(
                    "white noise of the output: {} {unit} RMS, {} of its span",
                    text::short(noise),
                    text::percent(100.0 * share)
                ));
            }
        }
        lines.extend(self.notes.iter().map(|note| format!("note: {note}")));
        match (self.warnings.as_slice(), &self.record) {
            ([], Some(_)) => {
                let notes = if self.notes.is_empty() { "" } else { "; the notes show what was done to read the file" };
                let mapped = self.channels.iter().any(|c| c.mapped_unit.is_some());
                let units = if mapped { "; units marked * are from --map" } else { "" };
                lines.push(format!("warnings: none{notes}{units}"));
            }
            (warnings, _) => lines.extend(warnings.iter().map(|what| format!("warning: {what}"))),
        }
        if !self.picture.is_empty() {
            lines.extend([String::new(), self.picture.clone()]);
        }
        lines.extend(self.missing.iter().flat_map(|why| [String::new(), format!("not a record yet: {why}")]));
        if self.missing.is_some() && self.next.is_some() {
            lines.push("sample rate, noise and further warnings need known columns and units".to_owned());
        }
        lines.extend(self.next.iter().flat_map(|next| [String::new(), format!("next: {next}")]));
        if self.next.as_ref().is_some_and(|next| next.contains("MODEL.json")) {
            lines.push("(MODEL.json is a model file written by hystctl fit)".to_owned());
        }
        if self.next.as_ref().is_some_and(|next| next.contains(SCALE)) {
            lines.push(
                "(GAIN is the scale of the sensor from its data sheet or its calibration: 2 if 10 V are 20 µm)"
                    .to_owned(),
            );
        }
        lines.join("\n")
    }
}
