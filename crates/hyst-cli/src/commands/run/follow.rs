//! Plans a run that follows a reference with a model.

use std::path::Path;

use hyst_core::ForceParams;
use hyst_hw::wire::{lateness, recipe_head};
use hyst_hw::{Capabilities, RecordOptions};
use hyst_ident::compensate::{CompensateOptions, Drive, compensate};
use hyst_ident::export::block;
use hyst_ident::model::Model;
use hyst_ident::record::Record;

use super::adapt::Adapting;
use super::followed::Followed;
use super::gains::{Chosen, Closed};
use super::handed_over::HandedOver;
use super::job::{Job, split, steepest_step};
use super::limits::play_options;
use super::live::Live;
use super::shape::Shape;
use crate::cli::{Control, RunArgs, VoltageLimits};
use crate::commands::compensate::options;
use crate::exit::{CommandError, CommandResult};
use crate::{input, recording};

/// Default hold time at the first value of a reference \[s\].
/// The model assumes that the actuator has settled there.
const DEFAULT_SETTLE_S: f64 = 2.0;

/// Maximum slope of the device over the slope of the planned drive, for a loop on the device.
const LOOP_SLEW_MARGIN: f64 = 4.0;

/// Block length of a drive that is corrected during the run \[s\].
const LIVE_BLOCK_S: f64 = 0.05;

/// Creates the job that follows a reference with a model.
pub(super) fn follow(
    args: &RunArgs,
    device: &Capabilities,
    model: &Path,
    reference: &Path,
    limits: VoltageLimits,
) -> CommandResult<Job> {
    let (model, json) = input::model(model)?;
    let (driven, measured) = (&model.input.column, &model.output.column);
    if driven != "voltage_v" {
        let message = format!(
            "the model's input is {driven}, but the device is driven by voltage_v; fit a model to records of that column"
        );
        return Err(CommandError::bad_input(message));
    }
    if measured != device.output.column() {
        let message = format!(
            "the model's output is {measured}, but the device measures {}; fit a model to records of that column",
            device.output.column()
        );
        return Err(CommandError::bad_input(message));
    }
    let reference = match Shape::named(reference)? {
        Some(shape) => {
            let usual = model.recorded_at_hz.clamp(device.min_rate_hz, device.max_rate_hz);
            let rate_hz = args.map.rate.unwrap_or(usual);
            shape.record(reference, recording::unit(device.output), rate_hz)?
        }
        // With another rate the actuator would move faster or slower than the reference file says.
        None if args.map.rate.is_some() => {
            return Err(CommandError::bad_input(
                "--rate needs a reference such as sine:LOW,HIGH,HZ,SECONDS; a reference file is played at its own times",
            ));
        }
        None => input::reference(reference, &args.map, &model)?,
    };
    if args.pid.is_some() && !args.control.closes() {
        return Err(CommandError::bad_input("--pid needs --control pid or --control pid+feedforward"));
    }
    if args.limits.bandwidth.is_some() && !args.control.inverts() {
        return Err(CommandError::bad_input("--bandwidth needs --control feedforward or --control pid+feedforward"));
    }
    let mut options = options(&args.limits);
    // Default limits: the range of the model within the range of the device.
    options.voltage = Some(match args.limits.limit {
        Some(limit) => (limit.low, limit.high),
        None => (limits.low.max(model.input.low), limits.high.min(model.input.high)),
    });
    options.slew = options.slew.min(device.max_slew_v_per_s);
    options.temperature = input::temperature(args.temperature, &model, &reference);
    let mut play = play_options(args, device, &reference);
    play.settle_s = args.settle.unwrap_or(DEFAULT_SETTLE_S);
    // The drive follows a measured temperature; the plan uses the given one or the reference temperature of the
    // model.
    let measured = model.effects.temperature.filter(|_| device.temperature && args.control.inverts());
    if let Some(gain) = measured {
        options.temperature = options.temperature.or(Some(gain.reference_degc));
    }
    let adapting = match &args.adapt {
        Some(file) if args.control == Control::Feedforward => Some(Adapting::new(&model, &json, file.as_deref())?),
        Some(_) => {
            return Err(CommandError::bad_input(
                "--adapt corrects the inverse of the model and works only with --control feedforward; give that",
            ));
        }
        None => None,
    };
    if measured.is_some() || adapting.is_some() {
        play.block = (LIVE_BLOCK_S * play.rate_hz).clamp(1.0, play.block as f64) as usize;
    }
    let (low, high) = options.voltage.unwrap_or((limits.low, limits.high));
    if args.control.closes() && device.queued {
        let degc = options.temperature;
        // A reference that the inverse refuses may still work with the loop, or ends with a fault that has the
        // reason.
        let plan = compensate(&model, &reference, &options).ok();
        let job = hand_over(args, device, model, json, reference, (options, (low, high), plan), play)?;
        return Ok(Job { degc, ..job });
    }
    let drive = args.control.inverts().then(|| compensate(&model, &reference, &options)).transpose()?;
    let planned = match &drive {
        Some(drive) => drive.voltage.clone(),
        None => straight(&model, &reference, low, high)?,
    };
    let live = match &drive {
        Some(drive) if measured.is_some() || adapting.is_some() => {
            Some(Live::new(&model, &reference, &options, drive, play.slew_v_per_s, adapting.clone())?)
        }
        _ => None,
    };
    let segments = split(&reference, &planned);
    let closed = if args.control.closes() {
        play.block = 1;
        let wanted = split(&reference, reference.output().unwrap_or_default());
        Some(Closed::new(args, &model, (low, high), wanted, (1.0 / play.rate_hz, options.slew))?)
    } else {
        None
    };
    let wanted = reference.output().unwrap_or_default().iter().copied().map(Some).collect();
    let followed = Followed {
        model,
        json,
        reference,
        options,
        control: args.control,
        drive,
        live,
        adapting,
        closed,
        held_s: play.settle_s,
    };
    Ok(Job { degc: options.temperature, ..Job::new(args, device, segments, play, wanted, Some(followed)) })
}

/// Creates the job of a device that closes the loop itself.
/// Its measurements arrive too late for a loop on this computer.
fn hand_over(
    args: &RunArgs,
    device: &Capabilities,
    model: Model,
    json: String,
    reference: Record,
    (options, limits, plan): (CompensateOptions, (f64, f64), Option<Drive>),
    mut play: RecordOptions,
) -> CommandResult<Job> {
    if args.control != Control::PidFeedforward {
        return Err(CommandError::bad_input(
            "the measurements of this device arrive too late for a loop on this computer, and the loop on the device needs \
             the inverse of the model; give --control pid+feedforward",
        ));
    }
    if model.needs_temperature() && !device.temperature {
        return Err(CommandError::bad_input(
            "the model's gain depends on a temperature that this device does not measure; give --control feedforward with \
             --temperature, or a model without this effect",
        ));
    }
    let period = 1.0 / play.rate_hz;
    // The loop starts and ends at the rest voltage, which may be outside the range of the model.
    let rest_v = device.voltage.rest_v;
    let limits = (limits.0.min(rest_v), limits.1.max(rest_v));
    let Chosen { gains, why, .. } = Chosen::new(args, &model, limits, period)?;
    let block = block(&model).map_err(CommandError::bad_input)?;
    let force = args.kout.map(|stiffness| ForceParams { stiffness, kappa: 1.0, chi: 0.0 });
    let recipe = [recipe_head(Some(&gains), force.as_ref()).as_slice(), &block].concat();
    let late = lateness(&recipe, period as f32).ok_or_else(|| {
        CommandError::bad_input(
            "the device cannot invert this model at this sample rate: it inverts pi models of limited size; fit a model with \
             --model pi, or give --control feedforward",
        )
    })?;
    let rows = split(&reference, reference.output().unwrap_or_default());
    let range = rows.iter().flatten().fold((model.output.low, model.output.high), |(l, h), y| (l.min(*y), h.max(*y)));
    // The ramps cover the range in one second.
    play.slew_v_per_s = (range.1 - range.0).max(f64::MIN_POSITIVE);
    let held = |rows: &Vec<f64>| [&rows[..], &vec![rows.last().copied().unwrap_or_default(); late]].concat();
    let segments = rows.iter().map(held).collect();
    let delayed =
        |rows: &Vec<f64>| std::iter::repeat_n(None, late).chain(rows.iter().copied().map(Some)).collect::<Vec<_>>();
    let wanted = rows.iter().flat_map(delayed).collect();
    let followed = Followed {
        model,
        json,
        reference,
        options,
        control: args.control,
        drive: None,
        live: None,
        adapting: None,
        closed: None,
        held_s: play.settle_s,
    };
    // During the ramp to the reference the drive covers its range in about one second.
    let planned = plan.as_ref().map_or(f64::INFINITY, |plan| {
        let rows = followed.reference.segments().iter();
        rows.map(|rows| steepest_step(&plan.voltage[rows.clone()])).fold(0.0, f64::max) / period
    });
    let least = (limits.1 - limits.0).max(RecordOptions::at(play.rate_hz).slew_v_per_s);
    let default = (LOOP_SLEW_MARGIN * planned.max(least)).min(device.max_slew_v_per_s);
    let slew_v_per_s = args.limits.slew.unwrap_or(default);
    let handed_over = Some(HandedOver { recipe, range, late, gains, why, slew_v_per_s, plan });
    Ok(Job { handed_over, ..Job::new(args, device, segments, play, wanted, Some(followed)) })
}

/// Returns the drive of a constant gain: a straight line through the ends of the model's range.
/// The drive is clamped to the limits.
fn straight(model: &Model, reference: &Record, low: f64, high: f64) -> CommandResult<Vec<f64>> {
    let wanted = match reference.output_unit() {
        Some(unit) if unit.column() == model.output.column => reference.output().unwrap_or_default(),
        _ => {
            let (column, file) = (&model.output.column, reference.name());
            return Err(CommandError::bad_input(format!(
                "{file}: column {column} is missing; the reference needs the output column of the model"
            )));
        }
    };
    let (gain, at_low) = model.straight_line().map_err(CommandError::bad_input)?;
    Ok(wanted.iter().map(|y| (model.input.low + (y - at_low) / gain).clamp(low, high)).collect())
}
