//! `stop`: an emergency stop from another terminal.

use hyst_hw::Daq;
use serde::Serialize;

use crate::cli::StopArgs;
use crate::device::{AnyDevice, Wishes};
use crate::exit::CommandResult;
use crate::output::Report;
use crate::text;

use super::status::Stated;

#[derive(Serialize)]
struct Summary {
    device: String,
    /// What it put out when it was told \[V\].
    present_v: f64,
    /// Whether it was to be cleared; else it was told to stop.
    cleared: bool,
    /// The fault that was cleared, if there was one.
    fault: Option<Stated>,
}

/// Runs the command.
pub(super) fn run(args: &StopArgs) -> CommandResult {
    let report = Report::new(args.json.json, &[])?;
    if args.clear {
        let mut daq = AnyDevice::open(&args.daq, &Wishes::default())?;
        let fault = daq.clear()?.map(Stated::of);
        let (device, present_v) = (daq.capabilities().device.clone(), daq.present_v());
        let was = match &fault {
            Some(Stated { code, text }) => format!("; cleared was fault {code}: {text}"),
            None => "; there was none to clear".to_owned(),
        };
        let volts = text::short(present_v);
        let said = format!("{device}: stands at {volts} V without a fault, and can be started{was}");
        return report.print(&said, &Summary { device, present_v, cleared: true, fault });
    }
    let (device, present_v) = AnyDevice::emergency_stop(&args.daq)?;
    let volts = text::short(present_v);
    let said = format!(
        "{device}: comes to rest from {volts} V, and starts again only once its fault is cleared (hystctl stop --clear, or run --clear)"
    );
    report.print(&said, &Summary { device, present_v, cleared: false, fault: None })
}
