//! Reads the files of a run and plans it.

use std::path::Path;

use hyst_hw::Capabilities;
use hyst_ident::record::Need;

use super::follow::follow;
use super::job::{Job, split};
use super::limits::{limits, play_options, thermometer};
use crate::cli::{RunArgs, VoltageLimits};
use crate::exit::{CommandError, CommandResult};
use crate::input;

impl Job {
    /// Reads the files of `args` and computes the drive for a device with these capabilities.
    pub(in crate::commands) fn read(args: &RunArgs, device: &Capabilities) -> CommandResult<Self> {
        let limits = limits(args, device)?;
        thermometer(args.hottest, device)?;
        match (&args.model, &args.reference, &args.drive) {
            (Some(model), Some(reference), None) => follow(args, device, model, reference, limits),
            (None, None, Some(drive)) => play(args, device, drive, limits),
            _ => Err(CommandError::bad_input("give either --model and --reference, or --drive")),
        }
    }
}

/// Creates the job that plays a drive unchanged.
fn play(args: &RunArgs, device: &Capabilities, path: &Path, limits: VoltageLimits) -> CommandResult<Job> {
    if args.limits.bandwidth.is_some() {
        return Err(CommandError::bad_input("--bandwidth needs --model and --reference; a drive is played unchanged"));
    }
    if args.temperature.degc.is_some() {
        return Err(CommandError::bad_input(
            "--temperature needs --model and --reference; a drive is played unchanged",
        ));
    }
    if args.map.rate.is_some() {
        return Err(CommandError::bad_input(
            "--rate needs a reference such as sine:LOW,HIGH,HZ,SECONDS; a drive is played at its own times",
        ));
    }
    let drive = input::record(path, &args.map, Need::Drive)?;
    let (file, column) = (path.display(), drive.input_column());
    if column != "voltage_v" {
        let message = format!(
            "{file}: the input is {column}, but the device is driven by voltage_v; use --map if only the name differs"
        );
        return Err(CommandError::bad_input(message));
    }
    let (time, volts) = (drive.time(), drive.input());
    if let Some(row) = volts.iter().position(|u| !(limits.low..=limits.high).contains(u)) {
        let (t, u, VoltageLimits { low, high }) = (time[row], volts[row], limits);
        let message = format!(
            "{file}: at {t} s the drive is {u} V, outside {low} to {high} V; nothing was played; make a drive within \
             these limits"
        );
        return Err(CommandError::bad_input(message));
    }
    let slew = args.limits.slew.unwrap_or(device.max_slew_v_per_s);
    // Tolerance for a drive that was limited to this slew and rounded in its file.
    let step = slew * drive.need_one_sample_period("a drive that a device plays")? * (1.0 + 1e-6);
    let steep = |row: &usize| (volts[row + 1] - volts[*row]).abs() > step;
    if let Some(row) = drive.segments().iter().find_map(|s| (s.start..s.end - 1).find(steep)) {
        let message = format!(
            "{file}: after {} s the drive is steeper than {slew} V/s; nothing was played; make a slower drive",
            time[row]
        );
        return Err(CommandError::bad_input(message));
    }
    let wanted = vec![None; volts.len()];
    let mut options = play_options(args, device, &drive);
    options.settle_s = args.settle.unwrap_or(options.settle_s);
    Ok(Job::new(args, device, split(&drive, volts), options, wanted, None))
}
