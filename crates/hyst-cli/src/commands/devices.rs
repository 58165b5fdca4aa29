//! `devices`: lists serial ports and CAN interfaces. Nothing is sent, nothing moves.

use hyst_hw::{Interface, Port, interfaces, ports};
use serde::Serialize;

use crate::cli::DevicesArgs;
use crate::exit::CommandResult;
use crate::output::Report;
use crate::text::table;

/// A port as `--daq` takes it.
#[derive(Serialize)]
struct Found {
    daq: String,
    port: String,
    what: String,
}

/// Describes a CAN interface.
fn can(interface: Interface) -> Found {
    let Interface { name, up, fd } = interface;
    let state = if up { "up" } else { "down" };
    // FD is only offered: other nodes on the bus may not support it.
    let kind = if fd { format!("CAN; can:{name},fd for CAN FD frames") } else { "CAN".to_owned() };
    Found { daq: format!("can:{name}"), what: format!("{kind}; {state}"), port: name }
}

pub(super) fn run(args: &DevicesArgs) -> CommandResult {
    let serial =
        ports().into_iter().map(|Port { name, what }| Found { daq: format!("serial:{name}"), port: name, what });
    let found: Vec<Found> = serial.chain(interfaces().into_iter().map(can)).collect();
    let text = if found.is_empty() {
        "no serial port and no CAN interface found\ndevices without a port: sim:PLANT.toml (simulated plant), tcp:HOST:PORT \
         (simulator or bridge)"
            .to_owned()
    } else {
        let rows = found.iter().map(|f| vec![f.daq.clone(), f.what.clone()]);
        table(&std::iter::once(vec!["--daq".to_owned(), "description".to_owned()]).chain(rows).collect::<Vec<_>>())
    };
    Report::new(args.json.json, &[])?.print(&text, &found)
}
