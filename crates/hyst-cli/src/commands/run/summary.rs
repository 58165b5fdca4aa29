//! Report of a run.

use std::collections::BTreeMap;
use std::path::Path;

use hyst_core::PidParams;
use hyst_hw::ClockFit;
use hyst_ident::tracking::{Harmonic, Tracking, Turning};
use serde::Serialize;

use super::adapt::Change;
use super::gains::PidReport;
use super::gaps::Gaps;
use super::parallel::Watched;
use crate::cli::Control;
use crate::commands::compensate::Compensation;
use crate::text;

/// Report of a run.
#[derive(Debug, Serialize)]
pub(super) struct Summary {
    pub(super) device: String,
    pub(super) rate_hz: f64,
    pub(super) samples: usize,
    pub(super) segments: usize,
    pub(super) unit: &'static str,
    pub(super) lowest_output: f64,
    pub(super) highest_output: f64,
    /// `None` if a drive was played.
    pub(super) tracking: Option<Tracking>,
    pub(super) compensation: Option<Compensation>,
    /// `None` if a drive was played.
    pub(super) control: Option<Control>,
    /// `None` without a PID.
    pub(super) pid: Option<Gains>,
    /// Whether the loop was closed on the device.
    pub(super) loop_on_device: bool,
    /// Whether the model explained the measured output; `None` if that was not monitored.
    pub(super) watch: Option<WatchSummary>,
    /// Minimum and maximum of the estimated force, relative to the start of the run \[N\].
    /// `None` without an estimate.
    pub(super) force_n: Option<(f64, f64)>,
    /// Sample periods without a value for the device.
    pub(super) gaps: Gaps,
    /// The device's clock relative to this computer's; `None` if the device uses this computer's clock.
    pub(super) clock: Option<ClockSummary>,
    /// Whether the drive was corrected for the measured temperature.
    pub(super) temperature_followed: bool,
    /// Difference between actuator and model at the end of the run; `None` without `--adapt`.
    pub(super) adapted: Option<Change>,
    pub(super) log: Option<String>,
    pub(super) record: Option<String>,
    #[serde(skip)]
    pub(super) model: Option<String>,
    #[serde(skip)]
    pub(super) symbol: &'static str,
}

/// An offset is reported if the RMSE without it is below this share of the RMSE.
const MAX_SHARE_WITHOUT_OFFSET: f64 = 0.5;

/// Whether the model explained the measured output.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct WatchSummary {
    explains: bool,
    /// First time at which the model did not explain the output, by the device's clock \[s\].
    lost_at_s: Option<f64>,
    /// RMS residual of the last block \[output unit\].
    residual_rms: f64,
    /// RMS residual of the model on its training record \[output unit\].
    fitted_rms: f64,
}

impl WatchSummary {
    fn text(&self, unit: &str) -> Option<String> {
        let (now, fitted) = (text::short(self.residual_rms), text::short(self.fitted_rms));
        self.lost_at_s.map(|at| {
            format!(
                "from {} s on the model did not explain the output: RMS residual {now} {unit} at the end, {fitted} {unit} on \
                 the training record",
                text::short(at)
            )
        })
    }

    pub(super) fn new(Watched { lost_at, residual, fitted_rmse }: Watched) -> Self {
        Self { explains: lost_at.is_none(), lost_at_s: lost_at, residual_rms: residual, fitted_rms: fitted_rmse }
    }
}

/// The device's clock relative to this computer's.
#[derive(Clone, Copy, Debug, Serialize)]
pub(super) struct ClockSummary {
    /// Start of period 0 of the run \[s since 1970-01-01 UTC\], and its uncertainty \[s\].
    began_unix_s: f64,
    uncertainty_s: f64,
    /// Frequency error of the device's clock, positive if it is faster \[ppm\]; `None` for a short run.
    faster_ppm: Option<f64>,
}

impl ClockSummary {
    pub(super) fn new(ClockFit { began_unix_s, faster_ppm, uncertainty_s }: ClockFit) -> Self {
        Self { began_unix_s, uncertainty_s, faster_ppm }
    }

    /// Returns metadata of a log.
    pub(super) fn entries(&self) -> BTreeMap<String, String> {
        let mut entries = BTreeMap::from([
            ("began_unix_s".to_owned(), self.began_unix_s.to_string()),
            ("uncertainty_s".to_owned(), self.uncertainty_s.to_string()),
        ]);
        entries.extend(self.faster_ppm.map(|ppm| ("faster_ppm".to_owned(), ppm.to_string())));
        entries
    }
}

/// The PID of a run.
#[derive(Debug, Serialize)]
pub(super) struct Gains {
    /// Proportional gain \[V/y\].
    proportional: f64,
    /// Integral gain \[V/(y s)\].
    integral: f64,
    /// Derivative gain \[V s/y\].
    derivative: f64,
    /// Crossover frequency of the loop, from the model \[Hz\]; `None` for given gains.
    crossover_hz: Option<f64>,
    /// Share of the samples in which the drive was at a limit \[%\].
    /// For a loop on the device only samples with a tracking error count.
    limited_percent: Option<f64>,
    /// Reason for these gains.
    why: String,
}

impl Gains {
    pub(super) fn of(PidReport { gains, why, crossover_hz, limited_percent }: PidReport<'_>) -> Self {
        let (PidParams { proportional, integral, derivative, .. }, why) = (*gains, why.to_owned());
        Self { proportional, integral, derivative, crossover_hz, limited_percent, why }
    }

    fn text(&self, symbol: &str) -> String {
        let short = text::short;
        let mut line = format!(
            "PID: {} V/{symbol}, {} V/({symbol} s), {} V s/{symbol} ({})",
            short(self.proportional),
            short(self.integral),
            short(self.derivative),
            self.why
        );
        if let Some(share) = self.limited_percent.filter(|share| *share > 0.0) {
            line += &format!("; the drive was at a limit in {} of the samples", text::percent(share));
        }
        line
    }
}

/// Returns lines about delay, turning points and harmonics.
fn tracking_details(tracking: &Tracking, unit: &str) -> String {
    let short = text::short;
    let mut lines = Vec::new();
    if let Some(delay) = tracking.delay_s {
        let how = if delay < 0.0 { "earlier" } else { "later" };
        lines.push(format!("compared with the reference {} ms {how} (--allow-delay)", short(1e3 * delay.abs())));
    }
    if let Some(Turning { points, near_percent, rmse, max_abs, rmse_between }) = tracking.turning {
        lines.push(format!(
            "near {} (within {} of the time to the next one): RMSE {} {unit}, largest {} {unit}; between them RMSE {} {unit}",
            text::count(points, "turning point"),
            text::percent(near_percent),
            short(rmse),
            short(max_abs),
            short(rmse_between)
        ));
    }
    if !tracking.harmonics.is_empty() {
        let harmonic = |h: &Harmonic| format!("{} Hz {} at {:.2}°", short(h.frequency_hz), short(h.gain), h.phase_deg);
        let harmonics: Vec<String> = tracking.harmonics.iter().map(harmonic).collect();
        lines.push(format!("gain and phase of the harmonics: {}", harmonics.join(", ")));
    }
    lines.iter().map(|line| format!("\n          {line}")).collect()
}

impl Summary {
    pub(super) fn text(&self) -> String {
        let (short, unit) = (text::short, self.symbol);
        let mut lines = vec![format!(
            "{}: {} at {} Hz in {}, output {} to {} {unit}",
            self.device,
            text::count(self.samples, "sample"),
            self.rate_hz,
            text::count(self.segments, "segment"),
            short(self.lowest_output),
            short(self.highest_output)
        )];
        lines.extend(self.tracking.as_ref().map(|t| {
            let (rmse, share, most) = (short(t.rmse), text::percent(t.nrmse_percent), short(t.max_abs));
            let late = short(t.rmse_last_half);
            let mut line = format!(
                "tracking: RMSE {rmse} {unit} ({share} of the reference's span), largest {most} {unit}; RMSE of the last half {late} {unit}"
            );
            // Only for feedforward without limits: otherwise hysteresis, a limit or a slow loop causes the offset.
            let free = self.compensation.as_ref().is_some_and(Compensation::is_unlimited);
            let is_offset = t.rmse_about_mean < MAX_SHARE_WITHOUT_OFFSET * t.rmse;
            if self.control == Some(Control::Feedforward) && free && is_offset {
                let (above, offset) = (if t.mean < 0.0 { "below" } else { "above" }, short(t.mean.abs()));
                line += &format!(
                    "\n          most of it is an offset: the output is {offset} {unit} {above} the reference, and without the \
                     offset the RMSE is {} {unit}; the cause is the sensor zero or the history of earlier runs (--control \
                     pid+feedforward removes it)",
                    short(t.rmse_about_mean)
                );
            }
            line + &tracking_details(t, unit)
        }));
        lines.extend(self.pid.as_ref().map(|pid| pid.text(self.symbol)));
        lines.extend(self.compensation.as_ref().map(Compensation::text));
        if self.loop_on_device {
            lines.push("the loop was closed on the device".to_owned());
        }
        if self.temperature_followed {
            lines.push("the drive was corrected for the measured temperature".to_owned());
        }
        if let Some(change) = &self.adapted {
            lines.push(match change.updates {
                0 => "adapted: nothing was learned, because the drive did not cover its range in both directions"
                    .to_owned(),
                _ => format!("adapted: {}", change.text(unit)),
            });
        }
        lines.extend(self.force_n.map(|(low, high)| {
            format!(
                "force: {} to {} N relative to the start of the run; the history of earlier runs appears as a force, too; the \
                 model is not monitored during a force estimate",
                short(low),
                short(high)
            )
        }));
        lines.extend(self.gaps.text());
        lines.extend(self.watch.and_then(|watch| watch.text(unit)));
        if let (Some(WatchSummary { explains: false, .. }), Some(log), Some(model)) =
            (self.watch, &self.log, &self.model)
        {
            // The output must not be the model that is read.
            let extended =
                if Path::new(model).ends_with("extended.json") { "extended-again.json" } else { "extended.json" };
            lines.push(format!("next: hystctl diagnose {log} --model {model} -o {extended}"));
        }
        lines.extend(self.log.iter().map(|path| format!("log: {path}")));
        lines.extend(self.record.iter().map(|path| format!("record: {path}")));
        lines.join("\n")
    }
}
