//! `status`: shows the state of a device. Nothing moves.

use hyst_hw::Daq;
use hyst_hw::wire::{Fault, State};
use serde::Serialize;

use crate::cli::StatusArgs;
use crate::device::{AnyDevice, DeviceError, DeviceOptions};
use crate::exit::{CommandError, CommandResult};
use crate::output::Report;
use crate::{recording, text};

#[derive(Serialize)]
struct Summary {
    device: String,
    /// `idle`, `running`, `stopping` or `fault`.
    state: &'static str,
    fault: Option<Stated>,
    /// Present voltage \[V\].
    present_v: f32,
    output: f32,
    unit: &'static str,
    low_v: f64,
    high_v: f64,
    rest_v: f64,
    /// Maximum slope \[V/s\].
    max_slew_v_per_s: f64,
    min_rate_hz: f64,
    max_rate_hz: f64,
    /// Whether it accepts a controller.
    follows: bool,
    #[serde(skip)]
    symbol: &'static str,
}

/// A fault: number and description.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Stated {
    pub(super) code: u8,
    pub(super) text: String,
}

impl Stated {
    pub(super) fn of(fault: Fault) -> Self {
        Self { code: fault.code(), text: fault.to_string() }
    }
}

/// Runs the command.
pub(super) fn run(args: &StatusArgs) -> CommandResult {
    let report = Report::new(args.json.json, &[])?;
    let mut daq = AnyDevice::open(&args.daq, &DeviceOptions::default())?;
    let can = daq.capabilities().clone();
    let Some(remote) = daq.remote() else {
        return Err(CommandError::bad_input(
            "a simulated plant has no state: it is at rest unless a command plays it; give a device at a line, for example \
             serial:/dev/ttyACM0",
        ));
    };
    let status = remote.status().map_err(DeviceError::from)?;
    let (state, fault) = match status.state {
        State::Idle => ("idle", None),
        State::Running => ("running", None),
        State::Stopping => ("stopping", None),
        State::Fault(fault) => ("fault", Some(Stated::of(fault))),
    };
    let unit = recording::unit(can.output);
    let summary = Summary {
        state,
        fault,
        present_v: status.present_v,
        output: status.output,
        unit: unit.suffix(),
        low_v: can.voltage.min_v,
        high_v: can.voltage.max_v,
        rest_v: can.voltage.rest_v,
        max_slew_v_per_s: can.max_slew_v_per_s,
        min_rate_hz: can.min_rate_hz,
        max_rate_hz: can.max_rate_hz,
        follows: remote.identity().follows,
        device: can.device,
        symbol: unit.symbol(),
    };
    report.print(&summary.text(), &summary)
}

impl Summary {
    fn text(&self) -> String {
        let short = text::short;
        let (volts, output) = (short(self.present_v.into()), short(self.output.into()));
        let moves = f64::from(self.present_v) != self.rest_v;
        let state = match (self.state, &self.fault) {
            (_, Some(Stated { code, text })) if moves => format!("ramping to rest after fault {code}: {text}"),
            (_, Some(Stated { code, text })) => format!(
                "at rest with fault {code}: {text}; fix the cause, then clear the fault (hystctl stop --clear or \
                 hystctl run --clear)"
            ),
            ("idle", _) => "at rest, ready to start".to_owned(),
            ("stopping", _) => "ramping to rest".to_owned(),
            _ => "running".to_owned(),
        };
        let rates = if self.min_rate_hz == self.max_rate_hz {
            format!("{} Hz", self.max_rate_hz)
        } else {
            format!("{} to {} Hz", self.min_rate_hz, self.max_rate_hz)
        };
        let loops = if self.follows { "; accepts a controller" } else { "" };
        format!(
            "{}: {state}\ndrive {volts} V, output {output} {}\nrange {} to {} V, rests at {} V, maximum slope {} V/s, {rates}{loops}",
            self.device,
            self.symbol,
            short(self.low_v),
            short(self.high_v),
            short(self.rest_v),
            short(self.max_slew_v_per_s)
        )
    }
}
