//! One picture of a demo: loop, residual, tracking errors.

use hyst_ident::diagnose::Findings;
use hyst_ident::record::Record;
use plotters::prelude::*;

use super::tracking::Runs;
use crate::exit::{CommandError, CommandResult};
use crate::text;

const BEFORE: RGBColor = RGBColor(200, 80, 40);
const AFTER: RGBColor = RGBColor(30, 110, 190);
const MEASURED: RGBColor = RGBColor(120, 120, 120);

/// The picture as SVG.
pub(super) fn draw(
    test: &Record,
    before: &[f64],
    after: &[f64],
    runs: &Runs,
    findings: &Findings,
) -> CommandResult<String> {
    let mut svg = String::new();
    // Drawing into a string fails only on a bug in the numbers' ranges.
    panels(&mut svg, test, before, after, runs, findings)
        .map_err(|e| CommandError::failed(format!("the picture could not be drawn: {e}")))?;
    Ok(svg)
}

type Drawn = Result<(), Box<dyn std::error::Error>>;

fn panels(svg: &mut String, test: &Record, before: &[f64], after: &[f64], runs: &Runs, findings: &Findings) -> Drawn {
    let root = SVGBackend::with_string(svg, (1400, 1000)).into_drawing_area();
    root.fill(&WHITE)?;
    let names: Vec<&str> = findings.effects.iter().map(|e| e.name.name()).collect();
    let found =
        if names.is_empty() { "no effect named".to_owned() } else { format!("named: {}", text::listed(&names)) };
    let root = root.titled(&format!("Model, residual and tracking; {found}"), ("sans-serif", 26))?;
    let (top, bottom) = root.split_vertically(480);
    let (left, right) = top.split_horizontally(560);
    let unit = text::symbol(&findings.unit);
    let (u, y) = (test.input(), test.output().unwrap_or_default());
    // The first segment's nested loops; all of them at once would be a blot.
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
    let mut left_over = Chart::new("test record: measured minus model", "time [s]", &format!("residual [{unit}]"));
    left_over.curve(&format!("base, {}", rmse(findings.before.test)), BEFORE, &residual(before));
    left_over.curve(&format!("extended, {}", rmse(findings.after.test)), AFTER, &residual(after));
    left_over.draw(&right)?;

    let (above, below) = bottom.split_vertically(170);
    let with = |v: &[f64]| vec![runs.time.iter().copied().zip(v.iter().copied()).collect()];
    let mut reference = Chart::new("tracking: wanted travel", "", &format!("[{unit}]"));
    reference.curve("wanted", BLACK, &with(&runs.travel));
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
    root.present()?;
    Ok(())
}

/// Name, colour and pieces of a line.
type Curve = (String, RGBColor, Vec<Vec<(f64, f64)>>);

/// A panel with axes, a legend and lines.
struct Chart {
    title: String,
    x: String,
    y: String,
    curves: Vec<Curve>,
}

/// Points of one curve that are drawn: more than this no screen shows.
const POINTS: usize = 4000;

impl Chart {
    fn new(title: &str, x: &str, y: &str) -> Self {
        Self { title: title.into(), x: x.into(), y: y.into(), curves: Vec::new() }
    }

    /// A function of time, in pieces.
    fn curve(&mut self, name: &str, colour: RGBColor, pieces: &[Vec<(f64, f64)>]) {
        let points = pieces.iter().map(Vec::len).sum();
        self.curves.push((name.into(), colour, pieces.iter().map(|p| thinned(p, points)).collect()));
    }

    /// A path, as a loop is: evenly thinned, in the order in which it was passed.
    fn path(&mut self, name: &str, colour: RGBColor, x: &[f64], y: &[f64]) {
        let step = x.len().div_ceil(POINTS).max(1);
        let points = x.iter().copied().zip(y.iter().copied()).step_by(step).collect();
        self.curves.push((name.into(), colour, vec![points]));
    }

    fn draw<B: DrawingBackend>(&self, area: &DrawingArea<B, plotters::coord::Shift>) -> Drawn
    where
        B::ErrorType: 'static,
    {
        let points = || self.curves.iter().flat_map(|c| c.2.iter().flatten());
        let range = |f: fn(&(f64, f64)) -> f64, margin: f64| {
            let (low, high) =
                points().map(f).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
            let room = margin * (high - low).max(1e-9);
            low - room..high + room
        };
        let mut chart = ChartBuilder::on(area)
            .caption(&self.title, ("sans-serif", 18))
            .margin(8)
            .x_label_area_size(if self.x.is_empty() { 22 } else { 38 })
            .y_label_area_size(62)
            .build_cartesian_2d(range(|p| p.0, 0.0), range(|p| p.1, 0.08))?;
        chart
            .configure_mesh()
            .x_desc(&self.x)
            .y_desc(&self.y)
            .light_line_style(WHITE)
            .label_style(("sans-serif", 13))
            .axis_desc_style(("sans-serif", 14))
            .draw()?;
        for (name, colour, pieces) in &self.curves {
            let colour = *colour;
            let lines = pieces.iter().map(|piece| PathElement::new(piece.clone(), colour.stroke_width(1)));
            chart
                .draw_series(lines)?
                .label(name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(3)));
        }
        chart
            .configure_series_labels()
            .position(SeriesLabelPosition::UpperLeft)
            .background_style(WHITE.mix(0.85))
            .border_style(BLACK.mix(0.2))
            .label_font(("sans-serif", 13))
            .draw()?;
        Ok(())
    }
}

/// Keeps the lowest and the highest point of each stretch, so that no peak is lost; `of` is the whole curve's
/// number of points.
fn thinned(points: &[(f64, f64)], of: usize) -> Vec<(f64, f64)> {
    let stretch = (2 * of).div_ceil(POINTS).max(1);
    if stretch <= 2 {
        return points.to_vec();
    }
    let mut kept = Vec::new();
    for part in points.chunks(stretch) {
        let by = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
        let (low, high) = (part.iter().min_by(by), part.iter().max_by(by));
        if let (Some(low), Some(high)) = (low, high) {
            let (first, second) = if low.0 <= high.0 { (low, high) } else { (high, low) };
            kept.extend([*first, *second]);
        }
    }
    kept
}
