//! `compensate`: computes the drive that makes an actuator follow a reference.

use hyst_ident::compensate::{CompensateOptions, Drive, Missed, compensate};
use hyst_ident::model::{Channel, Effect, Model};
use hyst_ident::range;
use hyst_ident::record::{Extra, Record};
use hyst_ident::simulate::Extrapolated;
use serde::Serialize;

use super::run::shape::Shape;
use crate::cli::{CompensateArgs, LimitArgs};
use crate::exit::{CommandError, CommandResult};
use crate::output::{self, Report, say};
use crate::{input, text};

/// Report of a compensation.
#[derive(Debug, Serialize)]
pub(super) struct Compensation {
    rows: usize,
    /// File of the drive; `None` if the drive is played.
    output: Option<String>,
    /// First voltage of the drive \[V\].
    first: f64,
    lowest: f64,
    highest: f64,
    lead_samples: usize,
    lead_s: f64,
    /// `None` if no dynamic stage was inverted.
    bandwidth_hz: Option<f64>,
    /// Maximum relative error of the inversion inside its band.
    band_error: f64,
    voltage_limited_rows: usize,
    /// Voltage-limited rows in which the reference needs a voltage below the lower limit.
    voltage_limited_low_rows: usize,
    slew_limited_rows: usize,
    #[serde(skip)]
    limits: (f64, f64),
    /// Rows in which the drive is outside the range that the model was fitted to; rows count from 1.
    extrapolated: Extrapolated,
    #[serde(skip)]
    input: Channel,
    /// Effects in the sensor.
    not_compensated: Vec<&'static str>,
    /// Hold time of the first value before the reference \[s\]; `None` if nothing was played.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) held_s: Option<f64>,
    /// Tracking error that the model predicts for this drive; `None` if the drive is played.
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
            return Err(CommandError::bad_input("--map needs a reference in a file; leave --map out"));
        }
        Some(shape) => {
            shape.record(&args.reference, input::output_unit(&model)?, args.map.rate.unwrap_or(model.recorded_at_hz))?
        }
        None => input::reference(&args.reference, &args.map, &model)?,
    };
    let temperature = input::temperature(args.temperature, &model, &reference);
    let options = CompensateOptions { temperature, ..options(&args.limits) };
    let drive = compensate(&model, &reference, &options)?;

    // An input column of the reference file is replaced in the output; the reference file itself is not changed.
    let column = model.input.column.as_str();
    let replaced = shape.is_none() && !input::present(&args.reference, &[column])?.is_empty();
    let extra = [Extra::numbers(column, &drive.voltage)];
    args.output.write(|out| reference.write_with(out, &extra).map_err(output::io_error))?;
    if replaced {
        say(&format!(
            "note: {} already has {column}; {} has the computed drive instead",
            args.reference.display(),
            args.output
        ));
    }
    let mut compensation = Compensation::new(&model, &reference, &drive);
    // Reports and JSON count rows from 1.
    compensation.missed = Some(Missed { row: drive.missed.row + 1, ..drive.missed });
    compensation.output = Some(args.output.to_string());
    report.print(&compensation.text(), &compensation)
}

/// Returns the limits of the command line as options of the library.
pub(super) fn options(limits: &LimitArgs) -> CompensateOptions {
    CompensateOptions {
        voltage: limits.limit.map(|limit| (limit.low, limit.high)),
        slew: limits.slew.unwrap_or(f64::INFINITY),
        bandwidth_hz: limits.bandwidth,
        temperature: None,
    }
}

/// Whether a row limited by voltage needs a voltage below the lower limit.
/// A row that is also limited by slew moves towards its limit.
fn below(drive: &Drive, row: usize) -> bool {
    let (low, high) = drive.limits;
    let volts = drive.voltage[row];
    if volts <= low || volts >= high { volts <= low } else { row > 0 && volts < drive.voltage[row - 1] }
}

impl Compensation {
    /// Whether no row of the drive is limited.
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
        // With inverted dynamics a fast part of the reference needs more voltage than its position.
        let fast = match self.bandwidth_hz {
            Some(_) => "; if only fast parts do, smooth them or reduce --bandwidth",
            None => "",
        };
        for (rows, what, end, advice) in [
            (low, "less", self.limits.0, "shift the reference up or reduce its amplitude"),
            (all - low, "more", self.limits.1, "shift the reference down or reduce its amplitude"),
        ] {
            if rows > 0 {
                lines.push(format!(
                    "in {} the reference needs {what} than {} {unit}: {advice}{fast}",
                    text::count(rows, "row"),
                    short(end)
                ));
            }
        }
        // The range is that of a measured voltage, which differs slightly from the commanded one.
        if self.extrapolated.largest > 1e-3 * (self.input.high - self.input.low) {
            let beyond = text::extrapolation("drive", &self.extrapolated, &self.input);
            lines.push(format!("{beyond}: narrow --limit or fit a record with a wider range"));
        }
        if self.slew_limited_rows > 0 {
            lines.push(
                "the actuator cannot follow where the slew is limited: slow the reference down or reduce its amplitude"
                    .to_owned(),
            );
        }
        let lead = format!(
            "preview {} ({} s), rows aligned with the reference",
            text::count(self.lead_samples, "sample"),
            short(self.lead_s)
        );
        lines.push(match self.bandwidth_hz {
            Some(hz) => format!(
                "{lead}; dynamics inverted up to {} Hz with an error of at most {}",
                short(hz),
                text::percent(100.0 * self.band_error)
            ),
            None => lead,
        });
        if let Some(missed) = &self.missed {
            let unit = text::symbol(&self.output_unit);
            let mut line = format!(
                "tracking error that the model predicts for this drive: {} {unit} RMS, {} at most (row {})",
                short(missed.rmse),
                short(missed.largest),
                missed.row
            );
            if missed.settling_rows > 0 {
                line += &format!(
                    "; after {} (the actuator starts from rest) {} {unit} RMS, {} at most",
                    text::count(missed.settling_rows, "start-up row"),
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
                    "the drive starts at {first} {unit}: ramp to this value and hold it first; the model assumes that the actuator \
                     has settled there"
                ),
                Some(seconds) => format!(
                    "before the reference the device was ramped to {first} {unit} and held for {seconds} s; the model assumes that \
                     the actuator has settled there after a ramp from rest. Slower creep (--settle holds longer) and the \
                     history of earlier runs appear as an error at the start"
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
