//! `compensate`: the drive that makes the actuator follow a reference.

use hyst_ident::compensate::{CompensateOptions, Drive, Missed, compensate};
use hyst_ident::model::{Channel, Effect, Model};
use hyst_ident::range;
use hyst_ident::record::{Extra, Need, Record};
use hyst_ident::simulate::Extrapolated;
use serde::Serialize;

use super::run::shape::Shape;
use crate::cli::{CompensateArgs, LimitArgs};
use crate::exit::{CommandError, CommandResult};
use crate::output::{self, Report, say};
use crate::{input, text};

/// What is said about a compensation.
#[derive(Debug, Serialize)]
pub(super) struct Compensation {
    rows: usize,
    /// Where the drive was written; none where it runs live.
    output: Option<String>,
    /// Where the drive starts \[V\].
    first: f64,
    lowest: f64,
    highest: f64,
    lead_samples: usize,
    lead_s: f64,
    /// None where no dynamic stage was inverted.
    bandwidth_hz: Option<f64>,
    /// Largest relative error of the inversion inside its band.
    band_error: f64,
    voltage_limited_rows: usize,
    /// Of these, rows in which the reference asks for less than the lower limit.
    voltage_limited_low_rows: usize,
    slew_limited_rows: usize,
    #[serde(skip)]
    limits: (f64, f64),
    /// Where the drive leaves the range that the model was fitted to; rows count from 1.
    extrapolated: Extrapolated,
    #[serde(skip)]
    input: Channel,
    /// Effects that are in the sensor.
    not_compensated: Vec<&'static str>,
    /// How long the device was held at the first value before \[s\]; none where nothing was played.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) held_s: Option<f64>,
    /// What the model itself misses with this drive; none where it runs live.
    missed: Option<Missed>,
    #[serde(skip)]
    unit: String,
    #[serde(skip)]
    output_unit: String,
}

/// Runs the command.
pub(super) fn run(args: &CompensateArgs) -> CommandResult {
    output::check(&[&args.model, &args.reference], &[&args.output])?;
    let report = Report::new(args.json.json, &[&args.output])?.on_stderr();
    let (model, _) = input::model(&args.model)?;
    let shape = Shape::named(&args.reference)?;
    let reference = match shape {
        Some(_) if !args.map.map.is_empty() => {
            return Err(CommandError::bad_input("--map is for a reference in a file"));
        }
        Some(shape) => {
            shape.record(&args.reference, input::output_unit(&model)?, args.map.rate.unwrap_or(model.recorded_at_hz))?
        }
        None => input::record(&args.reference, &args.map, Need::Output)?,
    };
    let temperature = input::temperature(args.temperature, &model, &reference);
    let options = CompensateOptions { temperature, ..options(&args.limits) };
    let drive = compensate(&model, &reference, &options)?;

    // The reference file keeps its own input, if it has one: no output is an input's file.
    let column = model.input.column.as_str();
    let replaced = shape.is_none() && !input::present(&args.reference, &[column])?.is_empty();
    let extra = [Extra::numbers(column, &drive.voltage)];
    args.output.write(|out| reference.write_with(out, &extra).map_err(output::io_error))?;
    if replaced {
        say(&format!(
            "note: {} has {column} already; in {} the computed drive stands in its place",
            args.reference.display(),
            args.output
        ));
    }
    let mut compensation = Compensation::new(&model, &reference, &drive);
    // People and JSON count rows from 1.
    compensation.missed = Some(Missed { row: drive.missed.row + 1, ..drive.missed });
    compensation.output = Some(args.output.to_string());
    report.print(&compensation.text(), &compensation)
}

/// The limits of the command line, as the library takes them.
pub(super) fn options(limits: &LimitArgs) -> CompensateOptions {
    CompensateOptions {
        voltage: limits.limit.map(|limit| (limit.low, limit.high)),
        slew: limits.slew.unwrap_or(f64::INFINITY),
        bandwidth_hz: limits.bandwidth,
        temperature: None,
    }
}

/// Whether a row that the voltage limit acted on was to go below the lower one: one that the slew keeps from it is on its way there.
fn below(drive: &Drive, row: usize) -> bool {
    let (low, high) = drive.limits;
    let volts = drive.voltage[row];
    if volts <= low || volts >= high { volts <= low } else { row > 0 && volts < drive.voltage[row - 1] }
}

impl Compensation {
    /// Whether no limit held the drive anywhere.
    pub(super) fn is_unlimited(&self) -> bool {
        self.voltage_limited_rows == 0 && self.slew_limited_rows == 0
    }

    pub(super) fn new(model: &Model, reference: &Record, drive: &Drive) -> Self {
        let (lowest, highest) = range(drive.voltage.iter().copied());
        let in_the_sensor = model.effects.names().into_iter().filter(|effect| !effect.acts_on_the_motion());
        Self {
            rows: drive.voltage.len(),
            output: None,
            first: drive.voltage.first().copied().unwrap_or_default(),
            lowest,
            highest,
            lead_samples: drive.lead,
            lead_s: drive.lead as f64 * reference.sample_period(),
            bandwidth_hz: drive.bandwidth_hz,
            band_error: drive.band_error,
            voltage_limited_rows: drive.voltage_limited.len(),
            voltage_limited_low_rows: drive.voltage_limited.iter().filter(|k| below(drive, **k)).count(),
            limits: drive.limits,
            slew_limited_rows: drive.slew_limited.len(),
            extrapolated: text::from_one(Extrapolated::of(model, &drive.voltage)),
            input: model.input.clone(),
            not_compensated: in_the_sensor.map(Effect::name).collect(),
            unit: model.input.unit.clone(),
            output_unit: model.output.unit.clone(),
            held_s: None,
            missed: None,
        }
    }

    pub(super) fn text(&self) -> String {
        let (unit, short) = (&self.unit, text::short);
        let mut lines = vec![format!(
            "drive: {}, {} to {} {unit}; limited by voltage in {}, by slew in {}",
            text::count(self.rows, "row"),
            short(self.lowest),
            short(self.highest),
            text::count(self.voltage_limited_rows, "row"),
            text::count(self.slew_limited_rows, "row")
        )];
        let (low, all) = (self.voltage_limited_low_rows, self.voltage_limited_rows);
        // Where dynamics are inverted a quick part of a reference asks for more than the place that it goes to.
        let quick = match self.bandwidth_hz {
            Some(_) => "; where only quick parts do, round them off or lower --bandwidth",
            None => "",
        };
        for (rows, what, end, advice) in [
            (low, "less", self.limits.0, "shift it up, or shrink it about a higher middle"),
            (all - low, "more", self.limits.1, "shift it down or shrink it"),
        ] {
            if rows > 0 {
                lines.push(format!(
                    "in {} the reference asks for {what} than {} {unit}: {advice}{quick}",
                    text::count(rows, "row"),
                    short(end)
                ));
            }
        }
        // The range is that of a measured voltage: it ends a little beside the wanted one.
        if self.extrapolated.largest > 1e-3 * (self.input.high - self.input.low) {
            let beyond = text::extrapolation("drive", &self.extrapolated, &self.input);
            lines.push(format!("{beyond}: narrow --limit, or fit a wider record"));
        }
        if self.slew_limited_rows > 0 {
            lines.push(
                "where the slew is limited the actuator cannot follow: slow the reference down or shrink it".to_owned(),
            );
        }
        let lead = format!(
            "preview {} ({} s), rows aligned with the reference",
            text::count(self.lead_samples, "sample"),
            short(self.lead_s)
        );
        lines.push(match self.bandwidth_hz {
            Some(hz) => format!(
                "{lead}; dynamics inverted up to {} Hz, to within {} there",
                short(hz),
                text::percent(100.0 * self.band_error)
            ),
            None => lead,
        });
        if let Some(missed) = &self.missed {
            let unit = text::symbol(&self.output_unit);
            let mut line = format!(
                "with this drive the model itself misses the reference by {} {unit} RMS, {} at most (row {})",
                short(missed.rmse),
                short(missed.largest),
                missed.row
            );
            if missed.settling_rows > 0 {
                line += &format!(
                    "; after {} of start-up (the actuator begins at rest) by {} {unit} RMS, {} at most",
                    text::count(missed.settling_rows, "row"),
                    short(missed.settled_rmse),
                    short(missed.settled_largest)
                );
            }
            lines.push(line);
        }
        if self.first.abs() > 0.01 * (self.highest - self.lowest) {
            let first = short(self.first);
            lines.push(match self.held_s {
                None => format!(
                    "the drive starts at {first} {unit}: ramp there first and hold; the model takes the actuator as settled at the first value"
                ),
                Some(seconds) => format!(
                    "before the reference began the device was ramped to {first} {unit} and held there for {seconds} s; the model takes the actuator as settled there, as after a ramp from rest: what creeps longer (--settle holds longer) and what earlier runs have left shows at first"
                ),
            });
        }
        if !self.not_compensated.is_empty() {
            let (effects, verb) =
                (text::listed(&self.not_compensated), if self.not_compensated.len() == 1 { "is" } else { "are" });
            lines.push(format!("{effects} {verb} in the sensor, not in the motion, and {verb} not compensated"));
        }
        if let Some(output) = &self.output {
            lines.push(format!("written: {output}"));
        }
        lines.join("\n")
    }
}
