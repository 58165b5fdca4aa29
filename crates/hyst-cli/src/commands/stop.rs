//! `stop`: emergency stop from another terminal.

use hyst_hw::Daq;
use serde::Serialize;

use crate::cli::StopArgs;
use crate::device::{AnyDevice, DeviceOptions};
use crate::exit::CommandResult;
use crate::output::Report;
use crate::text;

use super::status::Stated;

#[derive(Serialize)]
struct Summary {
    device: String,
    /// Voltage at the time of the command \[V\].
    present_v: f64,
    /// Whether the command cleared a fault; otherwise it stopped the device.
    cleared: bool,
    /// The fault that was cleared, if there was one.
    fault: Option<Stated>,
}

/// Runs the command.
pub(super) fn run(args: &StopArgs) -> CommandResult {
    let report = Report::new(args.json.json, &[])?;
    if args.clear {
        let mut daq = AnyDevice::open(&args.daq, &DeviceOptions::default())?;
        let fault = daq.clear()?.map(Stated::of);
        let (device, present_v) = (daq.capabilities().device.clone(), daq.present_v());
        let was = match &fault {
            Some(Stated { code, text }) => format!("; cleared fault {code}: {text}"),
            None => "; there was no fault to clear".to_owned(),
        };
        let volts = text::short(present_v);
        let text = format!("{device}: at {volts} V without a fault, ready to start{was}");
        return report.print(&text, &Summary { device, present_v, cleared: true, fault });
    }
    let (device, present_v) = AnyDevice::emergency_stop(&args.daq)?;
    let volts = text::short(present_v);
    let text = format!(
        "{device}: ramps to rest from {volts} V; it starts again only after its fault is cleared (hystctl stop --clear or \
         hystctl run --clear)"
    );
    report.print(&text, &Summary { device, present_v, cleared: false, fault: None })
}
