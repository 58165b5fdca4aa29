//! The picture of a response: gain, phase and coherence over frequency.

use std::ops::Range;

use hyst_ident::linear::{Mode, ResponseLine, Structure};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::canvas::{Area, Drawn, Format};
use crate::exit::CommandResult;
use crate::text;

const MEASURED: RGBColor = RGBColor(30, 110, 190);
const MODEL: RGBColor = RGBColor(200, 80, 40);
const FAINT: RGBColor = RGBColor(150, 150, 150);

/// Draws the picture.
pub(super) fn draw(format: Format, found: &Structure, unit: &str, title: &str) -> CommandResult<Vec<u8>> {
    format.draw((1100, 1000), |root| panels(root, &Shown::new(found), unit, title))
}

/// Data of the picture, up to the end of the band; above the band there is only noise.
struct Shown<'a> {
    hz: Range<f64>,
    lines: Vec<&'a ResponseLine>,
    /// Frequency, gain and phase \[quarter turns\] of the model.
    model: Vec<(f64, f64, f64)>,
    modes: Vec<&'a Mode>,
    order: usize,
}

impl<'a> Shown<'a> {
    fn new(found: &'a Structure) -> Self {
        let all = &found.response.lines;
        let (low, high) = (all.first().map_or(1.0, |l| l.hz), all.last().map_or(10.0, |l| l.hz));
        let hz = low..high.min(found.band_hz).max(2.0 * low);
        let model = |i: i32| {
            let hz = low * (found.band_hz / low).powf(f64::from(i) / 1500.0);
            let h = found.model.response(hz);
            (hz, h.abs(), h.arg().to_degrees() / 90.0)
        };
        Self {
            lines: all.iter().filter(|line| hz.contains(&line.hz)).collect(),
            model: (0..=1500).map(model).collect(),
            modes: found.modes.iter().filter(|mode| hz.contains(&mode.hz)).collect(),
            order: found.model.order(),
            hz,
        }
    }
}

fn panels(root: &Area<'_>, shown: &Shown<'_>, unit: &str, title: &str) -> Drawn {
    let root = root.titled(title, ("sans-serif", 22))?;
    let (above, below) = root.split_vertically(440);
    let (middle, below) = below.split_vertically(280);
    gain(&above, shown, unit)?;
    phase(&middle, shown)?;
    coherence(&below, shown)?;
    Ok(())
}

/// Creates axes with the grid of all panels.
macro_rules! axes {
    ($area:expr, $hz:expr, $y:expr, $x_room:expr) => {{
        let mut builder = ChartBuilder::on($area);
        builder.margin(10).x_label_area_size($x_room).y_label_area_size(80);
        builder.build_cartesian_2d($hz.clone().log_scale(), $y)?
    }};
}

macro_rules! mesh {
    ($chart:expr, $name:expr, $labels:expr, $format:expr, $x_name:expr) => {
        $chart
            .configure_mesh()
            .x_desc($x_name)
            .y_desc($name)
            .light_line_style(BLACK.mix(0.06))
            .bold_line_style(BLACK.mix(0.12))
            .label_style(("sans-serif", 13))
            .axis_desc_style(("sans-serif", 15))
            .y_labels($labels)
            .x_label_formatter(&|x| tick(*x))
            .y_label_formatter($format)
            .draw()?
    };
}

fn gain(area: &Area<'_>, shown: &Shown<'_>, unit: &str) -> Drawn {
    let values = shown.lines.iter().map(|l| l.gain).chain(shown.model.iter().map(|m| m.1)).filter(|g| *g > 0.0);
    let (low, high) = values.fold((f64::INFINITY, 0.0_f64), |(low, high), g| (low.min(g), high.max(g)));
    // Room at the top for the names of the modes.
    let (low, high) = (low.max(1e-6 * high) / 1.6, high * 4.0);
    let mut chart = axes!(area, shown.hz, (low..high).log_scale(), 24);
    mesh!(chart, format!("gain [{unit}]"), 10, &|y: &f64| tick(*y), "");
    for mode in &shown.modes {
        chart.draw_series([PathElement::new([(mode.hz, low), (mode.hz, high)], FAINT.mix(0.5).stroke_width(1))])?;
    }
    let edge = |l: &&ResponseLine, g: f64| (l.hz, g.clamp(low, high));
    let upper = shown.lines.iter().map(|l| edge(l, l.gain_band().1));
    let lower = shown.lines.iter().rev().map(|l| edge(l, l.gain_band().0));
    chart
        .draw_series([Polygon::new(upper.chain(lower).collect::<Vec<_>>(), MEASURED.mix(0.25))])?
        .label("95 % band")
        .legend(|(x, y)| Rectangle::new([(x, y - 4), (x + 18, y + 4)], MEASURED.mix(0.25).filled()));
    let measured: Vec<(f64, f64)> = shown.lines.iter().map(|l| edge(l, l.gain)).collect();
    chart
        .draw_series([PathElement::new(measured, MEASURED.mix(0.5).stroke_width(4))])?
        .label("measured")
        .legend(|(x, y)| PathElement::new([(x, y), (x + 18, y)], MEASURED.mix(0.5).stroke_width(4)));
    let model: Vec<(f64, f64)> = shown.model.iter().map(|m| (m.0, m.1.clamp(low, high))).collect();
    chart
        .draw_series([PathElement::new(model, MODEL.stroke_width(1))])?
        .label(format!("ARMAX of order {}", shown.order))
        .legend(|(x, y)| PathElement::new([(x, y), (x + 18, y)], MODEL.stroke_width(1)));
    // Names of the large modes, at alternating heights so that neighbours do not overlap.
    let tallest = shown.modes.iter().fold(0.0_f64, |most, m| most.max(m.peak));
    let named = shown.modes.iter().filter(|m| m.peak > 0.02 * tallest && m.damping < 0.3);
    for (k, mode) in named.enumerate() {
        let name = format!("{} Hz, damping {}", text::short(mode.hz), text::percent(100.0 * mode.damping));
        let height = high / f64::powi(1.3, 1 + (k % 3) as i32);
        // The name is on the side of the line with more room.
        let left = mode.hz > (shown.hz.start * shown.hz.end).sqrt();
        let (at, side) = if left { (mode.hz / 1.01, HPos::Right) } else { (mode.hz * 1.01, HPos::Left) };
        let style = ("sans-serif", 13).into_font().color(&BLACK.mix(0.75)).pos(Pos::new(side, VPos::Center));
        chart.draw_series([Text::new(name, (at, height), style)])?;
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::LowerLeft)
        .background_style(WHITE.mix(0.85))
        .border_style(BLACK.mix(0.2))
        .label_font(("sans-serif", 13))
        .draw()?;
    Ok(())
}

fn phase(area: &Area<'_>, shown: &Shown<'_>) -> Drawn {
    // Quarter turns, so that the axis is labelled at multiples of 90°.
    let mut chart = axes!(area, shown.hz, -2.0..2.0, 24);
    mesh!(chart, "phase [deg]", 5, &|y: &f64| tick(90.0 * y), "");
    let measured: Vec<(f64, f64)> = shown.lines.iter().map(|l| (l.hz, l.phase.to_degrees() / 90.0)).collect();
    let model: Vec<(f64, f64)> = shown.model.iter().map(|m| (m.0, m.2)).collect();
    for (line, style) in [(measured, MEASURED.mix(0.5).stroke_width(4)), (model, MODEL.stroke_width(1))] {
        // A line that crosses ±180° continues on the other side.
        for piece in line.chunk_by(|a, b| (a.1 - b.1).abs() < 2.0) {
            chart.draw_series([PathElement::new(piece.to_vec(), style)])?;
        }
    }
    Ok(())
}

fn coherence(area: &Area<'_>, shown: &Shown<'_>) -> Drawn {
    let mut chart = axes!(area, shown.hz, 0.0..1.03, 42);
    mesh!(chart, "coherence", 6, &|y: &f64| tick(*y), "frequency [Hz]");
    let line: Vec<(f64, f64)> = shown.lines.iter().map(|l| (l.hz, l.coherence)).collect();
    chart.draw_series([PathElement::new(line, MEASURED.stroke_width(1))])?;
    Ok(())
}

/// Formats a number on an axis as short as possible.
fn tick(x: f64) -> String {
    let usual = x == 0.0 || (1e-3..1e5).contains(&x.abs());
    if usual { format!("{}", (x * 1e6).round() / 1e6) } else { format!("{x:.0e}") }
}
