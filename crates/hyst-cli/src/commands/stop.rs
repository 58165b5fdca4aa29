//! `stop`: an emergency stop from another terminal.

use serde::Serialize;

use crate::cli::StopArgs;
use crate::device::{AnyDevice, Wishes};
use crate::exit::{CommandError, CommandResult};
use crate::output::Report;

#[derive(Serialize)]
struct Summary {
    device: String,
}

/// Runs the command.
pub(super) fn run(args: &StopArgs) -> CommandResult {
    let report = Report::new(args.json.json, &[])?;
    let AnyDevice::Remote(mut remote) = AnyDevice::open(&args.daq, &Wishes::default())? else {
        return Err(CommandError::bad_input("a simulated plant runs in the command that plays it; press Ctrl-C there"));
    };
    let device = hyst_hw::Daq::capabilities(&*remote).device.clone();
    remote.emergency_stop().map_err(crate::device::DeviceError::from)?;
    let said =
        format!("{device}: comes to rest, and starts again only once its fault is cleared (hystctl run --clear)");
    report.print(&said, &Summary { device })
}
