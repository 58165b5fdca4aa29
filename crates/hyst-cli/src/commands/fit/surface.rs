//! What is said of a measured Everett surface and of a mirror function.

use hyst_ident::everett::{Breach, BreachRule, ClassicalPart, DpmReport, FodReport, PeakShape};
use hyst_ident::model::Model;

use crate::text;

/// Rows of a table that a person reads; `--json` has all of them.
const SHOWN: usize = 20;

/// Notes for stderr: what is wrong with a surface and what was done about it, what a mirror function does not know.
pub(super) fn notes(surface: Option<&FodReport>, dynamics: Option<&DpmReport>, model: &Model) -> Vec<String> {
    let (unit, input) = (text::symbol(&model.output.unit), model.input.unit.as_str());
    let classical = dynamics.and_then(|d| match &d.classical {
        ClassicalPart::Fod(report) => Some(report),
        ClassicalPart::LeastSquares => None,
    });
    let mut notes = Vec::new();
    if let Some(report) = surface.or(classical) {
        if !report.breaches.is_empty() {
            notes.push(breaches(&report.breaches, unit, input));
        }
        notes.extend(report.moved.map(|m| {
            format!(
                "note: the measured surface falls somewhere, so the nearest valid one was taken: {} moved by more than their standard error, the farthest by {} {unit} ({} standard errors), all of them by {} {unit} RMS; --as-measured refuses that",
                text::count(m.nodes, "node"),
                text::short(m.largest),
                text::short(m.largest_sigmas),
                text::short(m.rms),
            )
        }));
    }
    if let Some(report) = dynamics.filter(|d| !d.untouched.is_empty()) {
        let mut rows = vec![vec![format!("rate [{input}/s]"), format!("change [{input}]")]];
        rows.extend(report.untouched.iter().map(|n| vec![text::short(n.rate), text::short(n.change)]));
        notes.push(format!(
            "note: no row comes near {} of the mirror function; there it follows their neighbours:\n{}",
            text::count(report.untouched.len(), "node"),
            text::table(&rows)
        ));
    }
    notes
}

fn breaches(all: &[Breach], unit: &str, input: &str) -> String {
    let head = ["rule", &format!("alpha [{input}]"), &format!("beta [{input}]"), &format!("by [{unit}]"), "sigmas"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    rows.extend(all.iter().take(SHOWN).map(|b| {
        let rule = match b.rule {
            BreachRule::Positive => "is negative",
            BreachRule::RisesWithAlpha => "falls with alpha",
            BreachRule::FallsWithBeta => "rises with beta",
        };
        vec![rule.to_owned(), text::short(b.alpha), text::short(b.beta), text::short(b.by), text::short(b.sigmas)]
    }));
    let more = all.len().saturating_sub(SHOWN);
    let rest = if more > 0 { format!("and {more} more, which --json lists\n") } else { String::new() };
    format!(
        "warning: in {} the measured surface is no Everett surface, by more than 3 standard errors:\n{}{rest}a structure that rings does this: drive half-sine peaks of several durations, with rest between them",
        text::count(all.len(), "cell"),
        text::table(&rows)
    )
}

/// The measured surface in two lines.
pub(super) fn measured(s: &FodReport, unit: &str) -> String {
    let family = |f: &hyst_ident::everett::Family| {
        let shape = match f.shape {
            PeakShape::Triangle => "triangular",
            PeakShape::HalfSine => "half-sine",
            PeakShape::Other => "other",
        };
        format!("{} {shape} of {} s", f.curves, text::short(f.peak_s))
    };
    let families: Vec<String> = s.families.iter().map(family).collect();
    let scatter =
        s.scatter.map_or_else(String::new, |x| format!(", durations differ by {} {unit} RMS", text::short(x)));
    let passed = match s.passed_over {
        0 => String::new(),
        n => format!("; {} passed over", text::count(n, "other excursion")),
    };
    format!(
        "Everett surface of {} cells a side from first-order descent curves: {}{passed}\nnoise {} {unit}, standard error of a node up to {} {unit}{scatter}, {} violated",
        s.cells,
        text::listed(&families),
        text::short(s.noise),
        text::short(s.std_error),
        text::count(s.breaches.len(), "cell"),
    )
}

/// The mirror function in a few lines.
pub(super) fn dynamics(d: &DpmReport, unit: &str, input: &str) -> String {
    let classical = match &d.classical {
        ClassicalPart::Fod(report) => measured(report, unit),
        ClassicalPart::LeastSquares => "classical part by least squares".to_owned(),
    };
    let bound = if d.bound == 0 { String::new() } else { format!(", {} at a bound", text::count(d.bound, "node")) };
    let left_out = d
        .rmse_left_out
        .map_or_else(String::new, |e| format!(", {} {unit} each with what the others say", text::short(e)));
    format!(
        "{classical}\n{} of about {} {input}/s, up to {} {input}/s in the others\nmirror function from {} to {}{bound}, steps fade over {} {input}\nRMSE of the faster segments {} {unit} without the mirror function, {} {unit} with it{left_out}",
        text::count(d.slow_segments, "slow segment"),
        text::short(d.rates[0]),
        text::short(d.rates[1]),
        text::short(d.xi[0]),
        text::short(d.xi[1]),
        text::short(d.fade),
        text::short(d.rmse_classical),
        text::short(d.rmse)
    )
}
