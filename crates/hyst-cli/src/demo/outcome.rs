//! Results of a demo and their report.

use std::path::Path;

use hyst_hw::PlantConfig;
use hyst_ident::diagnose::{Diagnosis, Verdict};
use hyst_ident::metrics::Errors;
use hyst_ident::model::{Effect, Model};

use crate::text;
use crate::tracking::Run;

/// Runs with one reference: plain gain, inverse of the base model, inverse of the extended model.
pub(super) struct Runs {
    pub(super) time: Vec<f64>,
    /// Wanted displacement from rest \[output unit\].
    pub(super) travel: Vec<f64>,
    pub(super) plain: Run,
    pub(super) base: Run,
    pub(super) extended: Run,
}

/// Results of a demo.
pub(super) struct Outcome<'a> {
    pub(super) diagnosis: &'a Diagnosis,
    pub(super) model: &'a Model,
    pub(super) runs: &'a Runs,
    pub(super) config: &'a PlantConfig,
}

impl Outcome<'_> {
    pub(super) fn text(&self, out: &Path) -> String {
        let (f, runs) = (&self.diagnosis.findings, self.runs);
        let unit = text::symbol(&f.unit);
        let error = |e: Option<Errors>| {
            e.map_or_else(String::new, |e| {
                format!("{} {unit} ({})", text::short(e.rmse), text::percent(e.nrmse_percent))
            })
        };
        let rows: usize = self.model.fitted_on.iter().map(|f| f.rows).sum();
        let mut lines = vec![
            format!("fit        {} on {rows} rows of an identification experiment", self.model.base.kind()),
            format!("           RMSE {} on a test record, which is never fitted", error(f.before.test)),
        ];
        if f.effects.is_empty() {
            lines.push(format!("found      no effect: {}", verdict(f.verdict)));
        }
        for effect in &f.effects {
            let mut evidence = effect.evidence.iter();
            lines.push(format!("found      {}: {}", effect.name, evidence.next().map_or("", String::as_str)));
            lines.extend(evidence.map(|line| format!("           {line}")));
            for other in effect.ties() {
                lines.push(format!("           the record cannot distinguish it from {}", other.name));
            }
        }
        lines.push(format!("extended   RMSE {} → {} on the test record", error(f.before.test), error(f.after.test)));
        lines.push(format!("remainder  {}", f.remainder.description));
        lines.push("tracking   RMS error of a reference on the actuator:".to_owned());
        let against = |run: &Run| {
            let times = runs.plain.rmse / run.rmse;
            format!("{} {unit}, {times:.1} times smaller than with the plain gain", text::short(run.rmse))
        };
        lines.push(format!("             plain gain        {} {unit}", text::short(runs.plain.rmse)));
        lines.push(format!("             base inverse      {}", against(&runs.base)));
        lines.push(format!("             extended inverse  {}", against(&runs.extended)));
        let sensor: Vec<&str> =
            f.effects.iter().map(|e| e.name).filter(|e| !e.acts_on_the_motion()).map(Effect::name).collect();
        if !sensor.is_empty() {
            let (effects, verb) = (text::listed(&sensor), if sensor.len() == 1 { "is" } else { "are" });
            lines.push(format!(
                "           {effects} {verb} in the sensor, not in the motion: removed from all three errors (the last one is {} \
                 {unit} with it) and not compensated",
                text::short(runs.extended.shown_rmse)
            ));
        }
        let (truth, named) = (self.truth(), self.named());
        let (modes, found) = (self.config.modes.len(), self.diagnosis.extended.effects.resonances.len());
        let of_modes = match (modes, found) {
            (_, 0) => String::new(),
            (modes, found) if found < modes => format!(", {found} of its {modes} modes"),
            (modes, found) if found > modes => format!(", but with {found} modes instead of {modes}"),
            _ => String::new(),
        };
        let had = if truth.is_empty() { "no effect".to_owned() } else { text::listed(&truth) };
        lines.push(format!(
            "truth      the plant file has {had}: {}{of_modes}",
            if truth == named { "found correctly" } else { "NOT found correctly" }
        ));
        lines.push(format!("written    {}", out.display()));
        lines.join("\n")
    }

    fn truth(&self) -> Vec<&'static str> {
        let mut names = self.config.effects();
        names.sort_unstable();
        names
    }

    fn named(&self) -> Vec<&'static str> {
        let mut names: Vec<&str> = self.diagnosis.findings.effects.iter().map(|e| e.name.name()).collect();
        names.sort_unstable();
        names.dedup();
        names
    }

    pub(super) fn summary(&self) -> serde_json::Value {
        let f = &self.diagnosis.findings;
        serde_json::json!({
            "named": self.named(),
            "switched_on": self.truth(),
            "verdict": f.verdict,
            "unit": f.unit,
            "test": { "before": f.before.test, "after": f.after.test },
            "tracking_rmse": {
                "plain_gain": self.runs.plain.rmse,
                "base_inverse": self.runs.base.rmse,
                "extended_inverse": self.runs.extended.rmse,
            },
            "tracking_max_abs": {
                "plain_gain": self.runs.plain.max_abs,
                "base_inverse": self.runs.base.max_abs,
                "extended_inverse": self.runs.extended.max_abs,
            },
        })
    }
}

fn verdict(v: Verdict) -> &'static str {
    match v {
        Verdict::Explained => "explained",
        Verdict::NothingMissing => "the residual is at the noise floor",
        Verdict::BaseTooCoarse => "the base model is too coarse",
        Verdict::Unexplained => "the residual matches none of the known effects",
    }
}
