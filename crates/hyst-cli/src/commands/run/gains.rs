//! The PID of a run and its gains, given or from the model.

use hyst_core::PidParams;
use hyst_hw::wire::SATURATION_TOLERANCE;
use hyst_ident::loop_gains;
use hyst_ident::model::Model;

use super::control::ClosedLoop;
use crate::cli::{PidGains, RunArgs};
use crate::exit::{CommandError, CommandResult};
use crate::output::say;
use crate::text;

/// A PID with its gains and their reason.
#[derive(Debug)]
pub(super) struct Closed {
    pub(super) running: ClosedLoop,
    pub(super) gains: PidParams,
    /// Crossover frequency of gains from the model \[Hz\].
    pub(super) crossover_hz: Option<f64>,
    /// Reason for the gains.
    pub(super) why: String,
}

impl Closed {
    pub(super) fn new(
        args: &RunArgs,
        model: &Model,
        limits: (f64, f64),
        wanted: Vec<Vec<f64>>,
        (period, slew): (f64, f64),
    ) -> CommandResult<Self> {
        let Chosen { gains, crossover_hz, why } = Chosen::new(args, model, limits, period)?;
        let tolerance = SATURATION_TOLERANCE * (model.output.high - model.output.low);
        let running = ClosedLoop::new(&gains, args.control.inverts(), wanted, period, slew, tolerance)?;
        Ok(Self { running, gains, crossover_hz, why })
    }
}

/// Gains and result of a PID.
#[derive(Clone, Copy, Debug)]
pub(super) struct PidReport<'a> {
    pub(super) gains: &'a PidParams,
    /// Reason for the gains.
    pub(super) why: &'a str,
    /// Crossover frequency of gains from the model \[Hz\].
    pub(super) crossover_hz: Option<f64>,
    /// Share of the samples with the drive at a limit \[%\].
    pub(super) limited_percent: Option<f64>,
}

/// Maximum ratio of a given integral gain and that from the model.
/// Above it the loop has no stability margin.
const MAX_GAIN_RATIO: f64 = 2.0;

/// Gains of a PID, given or from the model.
pub(super) struct Chosen {
    pub(super) gains: PidParams,
    pub(super) crossover_hz: Option<f64>,
    pub(super) why: String,
}

impl Chosen {
    pub(super) fn new(args: &RunArgs, model: &Model, limits: (f64, f64), period: f64) -> CommandResult<Self> {
        let own = loop_gains(model, period, limits).map_err(CommandError::bad_input)?;
        let (gains, why) = match args.pid {
            Some(PidGains { proportional, integral, derivative }) => {
                // Without an integral there is no windup.
                let back = if integral == 0.0 { 1.0 } else { (proportional / integral).abs().max(10.0 * period) };
                let given = PidParams { proportional, integral, derivative, anti_windup_seconds: back, ..own.pid };
                let ratio = integral / own.pid.integral;
                let turned = |gain: f64| gain * own.pid.integral < 0.0;
                if turned(integral) || (integral == 0.0 && turned(proportional)) {
                    return Err(CommandError::bad_input(
                        "--pid: the gain has the wrong sign for this model, and the output would move away from its reference; \
                         change the sign",
                    ));
                }
                if ratio > MAX_GAIN_RATIO {
                    say(&format!(
                        "note: the integral gain {} is {} times the gain with a stability margin of two; the loop may oscillate",
                        text::short(integral),
                        text::short(ratio)
                    ));
                }
                (given, "as given".to_owned())
            }
            None => {
                let why = match own.mode_hz {
                    Some(hz) => format!("limited by the model's mode at {} Hz", text::short(hz)),
                    None => "limited by sample period and dead time".to_owned(),
                };
                (own.pid, format!("bandwidth {} Hz, {why}", text::short(own.crossover_hz)))
            }
        };
        Ok(Self { gains, crossover_hz: args.pid.is_none().then_some(own.crossover_hz), why })
    }
}
