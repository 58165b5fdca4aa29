//! Reports about a measured Everett surface and a mirror function.

use hyst_ident::everett::{Breach, BreachRule, ClassicalPart, DpmReport, FodReport, PeakShape};
use hyst_ident::model::Model;

use crate::text;

/// Maximum number of rows of a printed table; `--json` has all rows.
const MAX_ROWS: usize = 20;

/// Returns notes about violations of a surface, and about undetermined nodes of a mirror function.
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
                "note: the measured surface is not monotone; the nearest monotone surface was taken. {} changed by more \
                 than their standard error, by {} {unit} at most ({} standard errors) and {} {unit} RMS; --as-measured \
                 refuses such a surface",
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
            "note: no row is near {} of the mirror function; the values there follow from neighbouring nodes:\n{}",
            text::count(report.untouched.len(), "node"),
            text::table(&rows)
        ));
    }
    notes
}

fn breaches(all: &[Breach], unit: &str, input: &str) -> String {
    let head = ["rule", &format!("alpha [{input}]"), &format!("beta [{input}]"), &format!("by [{unit}]"), "sigmas"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    rows.extend(all.iter().take(MAX_ROWS).map(|b| {
        let rule = match b.rule {
            BreachRule::Positive => "is negative",
            BreachRule::RisesWithAlpha => "falls with alpha",
            BreachRule::FallsWithBeta => "rises with beta",
        };
        vec![rule.to_owned(), text::short(b.alpha), text::short(b.beta), text::short(b.by), text::short(b.sigmas)]
    }));
    let more = all.len().saturating_sub(MAX_ROWS);
    let rest = if more > 0 { format!("and {more} more, which --json lists\n") } else { String::new() };
    format!(
        "warning: in {} the measured surface violates the conditions of an Everett surface by more than 3 standard \
         errors:\n{}{rest}a ringing structure causes this: record half-sine peaks of several durations with rests \
         between them (hystctl excite forc --seconds 1,2,4)",
        text::count(all.len(), "cell"),
        text::table(&rows)
    )
}

/// Describes the measured surface in two lines.
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
        s.scatter.map_or_else(String::new, |x| format!(", difference between durations {} {unit} RMS", text::short(x)));
    let ignored = match s.passed_over {
        0 => String::new(),
        n => format!("; {} ignored", text::count(n, "other excursion")),
    };
    format!(
        "Everett surface of {} cells per side from first-order descent curves: {}{ignored}\nnoise {} {unit}, standard error \
         of a node up to {} {unit}{scatter}, conditions violated in {}",
        s.cells,
        text::listed(&families),
        text::short(s.noise),
        text::short(s.std_error),
        text::count(s.breaches.len(), "cell"),
    )
}

/// Describes the mirror function in a few lines.
pub(super) fn dynamics(d: &DpmReport, unit: &str, input: &str) -> String {
    let classical = match &d.classical {
        ClassicalPart::Fod(report) => measured(report, unit),
        ClassicalPart::LeastSquares => "classical part by least squares".to_owned(),
    };
    let bound = if d.bound == 0 { String::new() } else { format!(", {} at a bound", text::count(d.bound, "node")) };
    let left_out =
        d.rmse_left_out.map_or_else(String::new, |e| format!(", {} {unit} cross-validated by segment", text::short(e)));
    let [slowest, fastest] = d.rates.map(text::short);
    let (rates, rows) = if d.slow_segments == 0 {
        (format!("branches of {slowest} to {fastest} {input}/s"), "all rows")
    } else {
        let slow = text::count(d.slow_segments, "slow segment");
        let rates = format!("{slow} of about {slowest} {input}/s, up to {fastest} {input}/s in the other segments");
        (rates, "the faster segments")
    };
    format!(
        "{classical}\n{rates}\nmirror function from {} to {}{bound}, steps fade over {} {input}\nRMSE of {rows} {} {unit} \
         without the mirror function, {} {unit} with it{left_out}",
        text::short(d.xi[0]),
        text::short(d.xi[1]),
        text::short(d.fade),
        text::short(d.rmse_classical),
        text::short(d.rmse)
    )
}
