//! Panels of pictures: axes, a legend and lines.

use plotters::coord::ranged1d::{Ranged, ValueFormatter};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::canvas::{Area, Canvas, Drawn};

/// Name, colour and pieces of a line.
type Curve = (String, RGBColor, Vec<Vec<(f64, f64)>>);

/// A panel with axes, a legend and lines.
pub(crate) struct Chart {
    title: String,
    x: String,
    y: String,
    curves: Vec<Curve>,
    log: bool,
    log_across: bool,
    bounds: Option<(f64, f64)>,
    small: bool,
}

/// Margin around the entries of a legend, length of its lines, and height of its rows \[pixels\].
const LEGEND_MARGIN: i32 = 14;
const LEGEND_LINE: i32 = 18;
const LEGEND_HEIGHT: i32 = 17;
/// Maximum number of points of a curve; more are not visible on a screen.
const MAX_POINTS: usize = 4000;

impl Chart {
    /// Creates an empty panel; an empty description of an axis takes no room.
    pub(crate) fn new(title: &str, x: &str, y: &str) -> Self {
        Self {
            title: title.into(),
            x: x.into(),
            y: y.into(),
            curves: Vec::new(),
            log: false,
            log_across: false,
            bounds: None,
            small: false,
        }
    }

    /// Returns the panel with a logarithmic vertical axis; values of zero and below are not drawn.
    pub(crate) fn logarithmic(self) -> Self {
        Self { log: true, ..self }
    }

    /// Returns the panel with small letters and without a legend, for pictures with many panels.
    pub(crate) fn small(self) -> Self {
        Self { small: true, ..self }
    }

    /// Adds a function of time, in pieces.
    pub(crate) fn curve(&mut self, name: &str, colour: RGBColor, pieces: &[Vec<(f64, f64)>]) {
        let points = pieces.iter().map(Vec::len).sum();
        self.curves.push((name.into(), colour, pieces.iter().map(|p| thinned(p, points)).collect()));
    }

    /// Adds a path, for example a loop: its points are connected in their order.
    pub(crate) fn path(&mut self, name: &str, colour: RGBColor, x: &[f64], y: &[f64]) {
        self.paths(name, colour, &[x.iter().copied().zip(y.iter().copied()).collect()]);
    }

    /// Adds a path in pieces.
    pub(crate) fn paths(&mut self, name: &str, colour: RGBColor, pieces: &[Vec<(f64, f64)>]) {
        let points: usize = pieces.iter().map(Vec::len).sum();
        let step = points.div_ceil(MAX_POINTS).max(1);
        let thinned = pieces.iter().map(|piece| piece.iter().copied().step_by(step).collect()).collect();
        self.curves.push((name.into(), colour, thinned));
    }

    /// Returns the panel with bounds of the vertical axis, for panels that are compared on one scale.
    pub(crate) fn between(self, low: f64, high: f64) -> Self {
        Self { bounds: Some((low, high)), ..self }
    }

    /// Returns the panel with a logarithmic horizontal axis.
    pub(crate) fn log_across(self) -> Self {
        Self { log_across: true, ..self }
    }

    /// Draws the panel unless all curves are empty.
    pub(crate) fn draw_if_any(&self, area: &Area<'_>) -> Drawn {
        if self.curves.iter().any(|(_, _, pieces)| pieces.iter().any(|piece| !piece.is_empty())) {
            self.draw(area)
        } else {
            Ok(())
        }
    }

    /// Draws the panel.
    pub(crate) fn draw(&self, area: &Area<'_>) -> Drawn {
        let shown = |p: &&(f64, f64)| !self.log || p.1 > 0.0;
        let points = || self.curves.iter().flat_map(|c| c.2.iter().flatten()).filter(shown);
        let ends = |f: fn(&(f64, f64)) -> f64| {
            points().map(f).fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)))
        };
        let range = |f: fn(&(f64, f64)) -> f64, margin: f64| {
            let (low, high) = ends(f);
            let room = margin * (high - low).max(1e-9);
            low - room..high + room
        };
        // Labels of the values, and of the axis if it has one.
        let room = match (self.small, self.x.is_empty(), self.y.is_empty()) {
            (true, x, y) => (if x { 18 } else { 32 }, if y { 48 } else { 60 }),
            (false, x, _) => (if x { 22 } else { 38 }, 62),
        };
        let below;
        let mut builder = if self.small {
            let mut builder = ChartBuilder::on(area);
            builder.caption(&self.title, ("sans-serif", 14));
            builder
        } else {
            below = self.legend(area)?;
            ChartBuilder::on(&below)
        };
        builder.margin(if self.small { 4 } else { 8 }).x_label_area_size(room.0).y_label_area_size(room.1);
        let across = range(|p| p.0, 0.0);
        if self.log {
            let (low, high) = self.bounds.unwrap_or_else(|| ends(|p| p.1));
            let up = (low / 1.3..high * 1.3).log_scale();
            if self.log_across {
                self.lines(builder.build_cartesian_2d(across.log_scale(), up)?)
            } else {
                self.lines(builder.build_cartesian_2d(across, up)?)
            }
        } else {
            let up = self.bounds.map_or_else(|| range(|p| p.1, 0.08), |(low, high)| low..high);
            self.lines(builder.build_cartesian_2d(across, up)?)
        }
    }

    fn lines<'a, X, Y>(&self, mut chart: ChartContext<'a, Canvas<'a>, Cartesian2d<X, Y>>) -> Drawn
    where
        X: Ranged<ValueType = f64> + ValueFormatter<f64>,
        Y: Ranged<ValueType = f64> + ValueFormatter<f64>,
    {
        let letters = if self.small { 10 } else { 13 };
        let mut mesh = chart.configure_mesh();
        mesh.x_desc(&self.x)
            .y_desc(&self.y)
            .light_line_style(WHITE)
            .label_style(("sans-serif", letters))
            .axis_desc_style(("sans-serif", letters + 1));
        if self.small {
            mesh.x_labels(4).y_labels(6);
        }
        mesh.draw()?;
        for (_, colour, pieces) in &self.curves {
            let colour = *colour;
            // plotters does not clip lines at the bounds, so values outside are moved to them.
            let (low, high) = self.bounds.unwrap_or((f64::NEG_INFINITY, f64::INFINITY));
            let shown = |piece: &Vec<(f64, f64)>| {
                let drawn = piece.iter().filter(|p| !self.log || p.1 > 0.0);
                drawn.map(|(x, y)| (*x, y.clamp(low, high))).collect()
            };
            let lines = pieces.iter().map(|piece| {
                let points: Vec<(f64, f64)> = shown(piece);
                PathElement::new(points, colour.stroke_width(1))
            });
            chart.draw_series(lines)?;
        }
        Ok(())
    }

    /// Draws title and legend above the panel, where they cover no line, and returns the area below.
    ///
    /// The legend takes at most half of the area; curves without room in it have no entry.
    fn legend<'a>(&self, area: &Area<'a>) -> Result<Area<'a>, Box<dyn std::error::Error>> {
        let (width, height) = area.dim_in_pixel();
        let style = ("sans-serif", 13).into_text_style(area).pos(Pos::new(HPos::Left, VPos::Center));
        let title = ("sans-serif", 18).into_text_style(area);
        area.draw_text(&self.title, &title, (LEGEND_MARGIN, 6))?;
        // Entries start right of the title and continue in rows below it.
        let mut x = 2 * LEGEND_MARGIN + area.estimate_text_size(&self.title, &title)?.0 as i32;
        let mut y = 17;
        for (name, colour, _) in self.curves.iter().filter(|(name, _, _)| !name.is_empty()) {
            let wide = LEGEND_LINE + 6 + area.estimate_text_size(name, &style)?.0 as i32;
            if x + wide > width as i32 && x > 2 * LEGEND_MARGIN {
                (x, y) = (LEGEND_MARGIN, y + LEGEND_HEIGHT);
            }
            if y > LEGEND_HEIGHT && y > height as i32 / 2 - LEGEND_HEIGHT {
                y -= LEGEND_HEIGHT;
                break;
            }
            area.draw(&PathElement::new([(x, y), (x + LEGEND_LINE, y)], colour.stroke_width(3)))?;
            area.draw_text(name, &style, (x + LEGEND_LINE + 6, y))?;
            x += wide + LEGEND_MARGIN;
        }
        Ok(area.margin(y + 10, 0, 0, 0))
    }
}

/// Thins a piece of a curve: keeps minimum and maximum of each stretch of points.
///
/// `of` is the number of points of the whole curve.
fn thinned(points: &[(f64, f64)], of: usize) -> Vec<(f64, f64)> {
    let stretch = (2 * of).div_ceil(MAX_POINTS).max(1);
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
