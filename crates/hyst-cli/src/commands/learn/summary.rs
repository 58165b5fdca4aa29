//! Report of learning.

use hyst_ident::learn::{Ended, Pass};
use serde::Serialize;

use crate::text;

/// A missing effect that the passes show.
#[derive(Debug, Serialize)]
pub(super) struct Found {
    pub(super) effect: &'static str,
    pub(super) probability: f64,
}

/// Report of learning.
#[derive(Debug, Serialize)]
pub(super) struct Summary {
    pub(super) device: String,
    pub(super) rate_hz: f64,
    pub(super) unit: &'static str,
    pub(super) plays: u32,
    pub(super) passes: Vec<Pass>,
    /// The best pass, from 1.
    pub(super) best: usize,
    pub(super) ended: Ended,
    /// RMS of the difference between plays of one drive \[output unit\].
    /// Estimated after the first pass and after the last pass.
    pub(super) repeatability_estimate: f64,
    pub(super) repeatability: f64,
    /// RMS error of the first pass over that of the best pass.
    pub(super) improvement: f64,
    /// RMS and maximum of the correction \[output unit\].
    /// The correction is the reference minus the model's prediction for the drive.
    pub(super) correction_rms: f64,
    pub(super) correction_max_abs: f64,
    /// Missing effects that explain the correction; `None` without a diagnosis.
    pub(super) found: Option<Vec<Found>>,
    pub(super) output: String,
    pub(super) logs: Option<String>,
    /// File of the extended model, if it was written.
    pub(super) extended: Option<String>,
    /// Hold time of the first value before each play \[s\].
    pub(super) settle_s: f64,
    #[serde(skip)]
    pub(super) symbol: &'static str,
}

impl Summary {
    pub(super) fn text(&self) -> String {
        let (short, unit) = (text::short, self.symbol);
        let mut rows = vec![
            ["pass", &format!("RMSE [{unit}]"), "maximum", "repeating part", "RMSE / repeatability"]
                .map(str::to_owned)
                .to_vec(),
        ];
        rows.extend(self.passes.iter().zip(1..).map(|(pass, number)| {
            let mark = if number == self.best { " best" } else { "" };
            vec![
                format!("{number}{mark}"),
                short(pass.rmse),
                short(pass.max_abs),
                short(pass.repeating),
                pass.over_repeatability().map_or_else(|| "-".to_owned(), short),
            ]
        }));
        let why = match self.ended {
            Ended::AtFloor => "the error has reached the repeatability",
            Ended::NoGain => "the last passes reduced the error by less than 5 %",
            Ended::Worse => {
                "three successive passes were worse than the best one: the model does not match this actuator; fit it again or \
                 add the effects that diagnose finds"
            }
            Ended::Passes => "all passes are played; give more with --passes",
        };
        let mut lines = vec![
            text::table(&rows),
            format!("ended: {why}"),
            format!(
                "repeatability: {} {unit} (estimate after the first pass: {} {unit}); error {} times smaller than with the \
                 model's inverse",
                short(self.repeatability),
                short(self.repeatability_estimate),
                short(self.improvement)
            ),
            format!(
                "correction: {} {unit} RMS, {} {unit} at most",
                short(self.correction_rms),
                short(self.correction_max_abs)
            ),
        ];
        if let Some(found) = &self.found {
            let names: Vec<String> =
                found.iter().map(|f| format!("{} (probability {})", f.effect, short(f.probability))).collect();
            lines.push(match (names.is_empty(), &self.extended) {
                (true, _) => "missing effects: none explains the correction".to_owned(),
                (false, Some(path)) => format!("missing effects: {}; extended model: {path}", text::listed(&names)),
                (false, None) => {
                    format!("missing effects: {}; --extended MODEL writes the extended model", text::listed(&names))
                }
            });
        }
        lines.extend(self.logs.iter().map(|folder| format!("logs: {folder}")));
        lines.push(format!("drive: {}", self.output));
        lines.push(format!(
            "next: hystctl run --daq DEVICE --drive {} --settle {} --record measured.csv",
            self.output,
            short(self.settle_s)
        ));
        lines.join("\n")
    }
}
