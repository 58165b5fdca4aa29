//! `stop`: an emergency stop from another terminal.

use serde::Serialize;

use crate::cli::StopArgs;
use crate::device::AnyDevice;
use crate::exit::CommandResult;
use crate::output::Report;

#[derive(Serialize)]
struct Summary {
    device: String,
    /// What it put out when it was told \[V\].
    present_v: f64,
}

/// Runs the command.
pub(super) fn run(args: &StopArgs) -> CommandResult {
    let report = Report::new(args.json.json, &[])?;
    let (device, present_v) = AnyDevice::emergency_stop(&args.daq)?;
    let said = format!(
        "{device}: comes to rest from {present_v} V, and starts again only once its fault is cleared (hystctl run --clear)"
    );
    report.print(&said, &Summary { device, present_v })
}
