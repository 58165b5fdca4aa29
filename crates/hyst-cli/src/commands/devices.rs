//! `hystctl devices`: what is connected. Nothing is sent, nothing moves.

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

/// A CAN interface with all that it carries.
fn can(interface: Interface) -> Found {
    let Interface { name, up, fd } = interface;
    let state = if up { "up" } else { "down" };
    // That the interface can do FD does not say that the others on the bus can.
    let kind = if fd { format!("CAN; with can:{name},fd in frames of CAN FD") } else { "CAN".to_owned() };
    Found { daq: format!("can:{name}"), what: format!("{kind}; {state}"), port: name }
}

pub(super) fn run(args: &DevicesArgs) -> CommandResult {
    let serial =
        ports().into_iter().map(|Port { name, what }| Found { daq: format!("serial:{name}"), port: name, what });
    let found: Vec<Found> = serial.chain(interfaces().into_iter().map(can)).collect();
    let text = if found.is_empty() {
        "no serial port and no CAN interface is connected\na device without one: sim:PLANT.toml (the simulated plant), tcp:HOST:PORT (a simulator or a bridge)"
            .to_owned()
    } else {
        let rows = found.iter().map(|f| vec![f.daq.clone(), f.what.clone()]);
        table(&std::iter::once(vec!["--daq".to_owned(), "what".to_owned()]).chain(rows).collect::<Vec<_>>())
    };
    Report::new(args.json.json, &[])?.print(&text, &found)
}
