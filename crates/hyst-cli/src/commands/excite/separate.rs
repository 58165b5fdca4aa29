//! `excite separate`: makes the drive that separates two effects best.

use hyst_ident::excite::{Limits, SeparateOptions, Separation, Tried, Verdict, separate};
use serde::Serialize;

use super::options::in_options;
use crate::cli::SeparateArgs;
use crate::exit::CommandResult;
use crate::output::{self, Report};
use crate::progress::Progress;
use crate::text;

/// Report of a separation.
#[derive(Debug, Serialize)]
struct Summary<'a> {
    output: String,
    first: &'static str,
    second: &'static str,
    verdict: Verdict,
    reason: &'a str,
    rows: usize,
    /// Maximum slope \[V/s\].
    steepest_v_per_s: f64,
    segments: &'a [&'static str],
    tried: &'a [Tried],
}

/// Runs the command.
pub(super) fn run(args: &SeparateArgs) -> CommandResult {
    let common = &args.common;
    output::check(&[], &[&common.output])?;
    let report = Report::new(common.json.json, &[&common.output])?;
    let limits = Limits { rate_hz: common.rate, lo_v: common.low, hi_v: common.high, slew_v_per_s: common.slew };
    let options = SeparateOptions {
        duration_s: args.seconds,
        noise: args.noise,
        thermometer: args.thermometer,
        load_cell: args.load_cell,
        ..SeparateOptions::default()
    };
    let progress = Progress::spinner("trying drives");
    let found = separate(args.first, args.second, &limits, &options).map_err(in_options)?;
    drop(progress);
    common.output.write(|out| found.drive.write_csv(out).map_err(output::io_error))?;
    let summary = Summary {
        output: common.output.to_string(),
        first: args.first.name(),
        second: args.second.name(),
        verdict: found.verdict,
        reason: &found.reason,
        rows: found.drive.voltage().len(),
        steepest_v_per_s: found.drive.steepest(),
        segments: found.drive.shapes(),
        tried: &found.tried,
    };
    report.print(&summary.text(&found), &summary)
}

/// Maximum number of drives in the printed table.
const MAX_LISTED: usize = 6;

impl Summary<'_> {
    fn text(&self, found: &Separation) -> String {
        let head = [
            "residual / noise",
            &format!("{} fitted by {}", self.first, self.second),
            &format!("{} fitted by {}", self.second, self.first),
        ];
        let row = |t: &Tried| vec![t.drive.to_owned(), text::short(t.first_left), text::short(t.second_left)];
        let rows: Vec<Vec<String>> = std::iter::once(head.map(str::to_owned).to_vec())
            .chain(found.tried.iter().take(MAX_LISTED).map(row))
            .collect();
        format!(
            "{}\n\n{}\n{}: {}, maximum slope {} V/s, {}: {}",
            self.reason,
            text::table(&rows),
            self.output,
            text::count(self.rows, "row"),
            text::short(self.steepest_v_per_s),
            text::count(self.segments.len(), "segment"),
            self.segments.join(", ")
        )
    }
}
