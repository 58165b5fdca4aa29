//! Picture of a demo: loop, residual and tracking errors.

use hyst_ident::diagnose::Findings;
use hyst_ident::record::Record;
use plotters::prelude::*;

use super::outcome::Runs;
use crate::canvas::{Area, Drawn, Format};
use crate::chart::Chart;
use crate::exit::CommandResult;
use crate::text;

const BEFORE: RGBColor = RGBColor(200, 80, 40);
const AFTER: RGBColor = RGBColor(30, 110, 190);
const MEASURED: RGBColor = RGBColor(120, 120, 120);

/// Draws the picture as SVG.
pub(super) fn draw(
    test: &Record,
    before: &[f64],
    after: &[f64],
    runs: &Runs,
    findings: &Findings,
) -> CommandResult<Vec<u8>> {
    Format::Svg.draw((1400, 1000), |root| panels(root, test, before, after, runs, findings))
}

fn panels(root: &Area<'_>, test: &Record, before: &[f64], after: &[f64], runs: &Runs, findings: &Findings) -> Drawn {
    let names: Vec<&str> = findings.effects.iter().map(|e| e.name.name()).collect();
    let found =
        if names.is_empty() { "no effect named".to_owned() } else { format!("named: {}", text::listed(&names)) };
    let root = root.titled(&format!("Model, residual and tracking; {found}"), ("sans-serif", 26))?;
    let (top, bottom) = root.split_vertically(480);
    let (left, right) = top.split_horizontally(560);
    let unit = text::symbol(&findings.unit);
    let (u, y) = (test.input(), test.output().unwrap_or_default());
    // Only the nested loops of the first segment: all segments together are not readable.
    let nested = test.segments().first().cloned().unwrap_or(0..0);
    let mut volts = Chart::new("test record: nested loops", "voltage [V]", &format!("output [{unit}]"));
    volts.path("measured", MEASURED, &u[nested.clone()], &y[nested.clone()]);
    volts.path("base model", BEFORE, &u[nested.clone()], &before[nested.clone()]);
    volts.path("extended model", AFTER, &u[nested.clone()], &after[nested]);
    volts.draw(&left)?;

    let residual = |p: &[f64]| -> Vec<Vec<(f64, f64)>> {
        let row = |k: usize| (test.time()[k], y[k] - p[k]);
        test.segments().iter().map(|rows| rows.clone().map(row).collect()).collect()
    };
    let rmse = |e: Option<hyst_ident::metrics::Errors>| {
        e.map_or_else(String::new, |e| format!("RMS {} {unit}", text::short(e.rmse)))
    };
    let mut residuals = Chart::new("test record: measured minus model", "time [s]", &format!("residual [{unit}]"));
    residuals.curve(&format!("base, {}", rmse(findings.before.test)), BEFORE, &residual(before));
    residuals.curve(&format!("extended, {}", rmse(findings.after.test)), AFTER, &residual(after));
    residuals.draw(&right)?;

    let (above, below) = bottom.split_vertically(170);
    let with = |v: &[f64]| vec![runs.time.iter().copied().zip(v.iter().copied()).collect()];
    let mut reference = Chart::new("tracking: reference, relative to rest", "", &format!("[{unit}]"));
    reference.curve("reference", BLACK, &with(&runs.travel));
    reference.draw(&above)?;
    let mut errors = Chart::new("tracking: error on the actuator", "time [s]", &format!("error [{unit}]"));
    for (name, run, colour) in [
        ("plain gain", &runs.plain, MEASURED),
        ("base inverse", &runs.base, BEFORE),
        ("extended inverse", &runs.extended, AFTER),
    ] {
        errors.curve(&format!("{name}, RMS {} {unit}", text::short(run.rmse)), colour, &with(&run.error));
    }
    errors.draw(&below)?;
    Ok(())
}
