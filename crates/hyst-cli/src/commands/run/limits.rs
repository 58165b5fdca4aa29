//! Limits of a run: those of the command line and of the device.

use hyst_hw::{Capabilities, RecordOptions};
use hyst_ident::record::Record;

use crate::cli::{RunArgs, VoltageLimits};
use crate::exit::{CommandError, CommandResult};

/// Refuses a limit on the temperature for a device that does not measure it.
pub(in crate::commands) fn thermometer(hottest_degc: Option<f64>, device: &Capabilities) -> CommandResult {
    if hottest_degc.is_some() && !device.temperature {
        let message = format!(
            "--hottest: {} does not measure a temperature; leave --hottest out and monitor the temperature another way",
            device.device
        );
        return Err(CommandError::bad_input(message));
    }
    Ok(())
}

/// Returns the limits of the drive: those of the command line, or of the device.
pub(super) fn limits(args: &RunArgs, device: &Capabilities) -> CommandResult<VoltageLimits> {
    let (low, high, rest) = (device.voltage.min_v, device.voltage.max_v, device.voltage.rest_v);
    match args.limits.limit {
        None => Ok(VoltageLimits { low, high }),
        Some(limit) if device.queued && !(limit.low..=limit.high).contains(&rest) => {
            Err(CommandError::bad_input(format!(
                "--limit {},{} excludes {rest} V, at which the device rests; give limits that include it",
                limit.low, limit.high
            )))
        }
        Some(limit) if limit.low >= low && limit.high <= high => Ok(limit),
        Some(limit) => Err(CommandError::bad_input(format!(
            "--limit {},{} exceeds the range of the device, {low} to {high} V; give limits within it",
            limit.low, limit.high
        ))),
    }
}

/// Returns how a record is played: sample rate, rests and slope of the ramps.
pub(super) fn play_options(args: &RunArgs, device: &Capabilities, record: &Record) -> RecordOptions {
    let rate_hz = 1.0 / record.sample_period();
    let whole = rate_hz.round();
    // 1 / 0.00001 is not exactly 100000.
    let rate_hz = if (rate_hz - whole).abs() < 1e-9 * rate_hz { whole } else { rate_hz };
    let mut options = RecordOptions::at(rate_hz);
    options.rest_s = args.rest;
    options.slew_v_per_s = options.slew_v_per_s.min(args.limits.slew.unwrap_or(device.max_slew_v_per_s));
    options
}
