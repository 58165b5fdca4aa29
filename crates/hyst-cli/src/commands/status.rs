//! `status`: how a device stands. Nothing moves.

use hyst_hw::Daq;
use hyst_hw::wire::{Fault, State};
use serde::Serialize;

use crate::cli::StatusArgs;
use crate::device::{AnyDevice, DeviceError, Wishes};
use crate::exit::{CommandError, CommandResult};
use crate::output::Report;
use crate::{recording, text};

#[derive(Serialize)]
struct Summary {
    device: String,
    /// `idle`, `running`, `stopping` or `fault`.
    state: &'static str,
    fault: Option<Stated>,
    /// What it puts out \[V\].
    present_v: f32,
    output: f32,
    unit: &'static str,
    low_v: f64,
    high_v: f64,
    rest_v: f64,
    /// \[V/s\]
    max_slew_v_per_s: f64,
    min_rate_hz: f64,
    max_rate_hz: f64,
    /// Whether it can be handed a controller.
    follows: bool,
    #[serde(skip)]
    symbol: &'static str,
}

/// A fault, by its number and in words.
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
    let mut daq = AnyDevice::open(&args.daq, &Wishes::default())?;
    let can = daq.capabilities().clone();
    let Some(remote) = daq.remote() else {
        return Err(CommandError::bad_input(
            "a simulated plant stands at rest whenever no command plays it: ask a device at the other end of a line",
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
        let stands = match (self.state, &self.fault) {
            (_, Some(Stated { code, text })) if moves => format!("still on its way to rest after fault {code}: {text}"),
            (_, Some(Stated { code, text })) => format!(
                "stands with fault {code}: {text}; when that is mended, clear it (hystctl stop --clear, or run --clear)"
            ),
            ("idle", _) => "at rest, and can be started".to_owned(),
            ("stopping", _) => "comes to rest".to_owned(),
            _ => "runs".to_owned(),
        };
        let rates = if self.min_rate_hz == self.max_rate_hz {
            format!("{} Hz", self.max_rate_hz)
        } else {
            format!("{} to {} Hz", self.min_rate_hz, self.max_rate_hz)
        };
        let loops = if self.follows { "; takes a controller" } else { "" };
        format!(
            "{}: {stands}\nputs out {volts} V, shows {output} {}\ncan do {} to {} V, rests at {} V, at most {} V/s, {rates}{loops}",
            self.device,
            self.symbol,
            short(self.low_v),
            short(self.high_v),
            short(self.rest_v),
            short(self.max_slew_v_per_s)
        )
    }
}
