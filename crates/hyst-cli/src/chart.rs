//! Panels of pictures: axes, a legend and lines, as SVG.

use plotters::coord::Shift;
use plotters::coord::ranged1d::{Ranged, ValueFormatter};
use plotters::prelude::*;

use crate::exit::{CommandError, CommandResult};

/// What drawing returns.
pub(crate) type Drawn = Result<(), Box<dyn std::error::Error>>;

/// The picture that `panels` draws, as SVG.
pub(crate) fn drawn(panels: impl FnOnce(&mut String) -> Drawn) -> CommandResult<String> {
    let mut svg = String::new();
    // Drawing into a string fails only on a bug in the numbers' ranges.
    panels(&mut svg).map_err(|e| CommandError::failed(format!("the picture could not be drawn: {e}")))?;
    Ok(svg)
}

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
    legend: SeriesLabelPosition,
    small: bool,
}

/// Points of one curve that are drawn: more than this no screen shows.
const POINTS: usize = 4000;

impl Chart {
    /// An empty panel; a description that is empty takes no room.
    pub(crate) fn new(title: &str, x: &str, y: &str) -> Self {
        Self {
            title: title.into(),
            x: x.into(),
            y: y.into(),
            curves: Vec::new(),
            log: false,
            log_across: false,
            bounds: None,
            legend: SeriesLabelPosition::UpperLeft,
            small: false,
        }
    }

    /// The same with a logarithmic vertical axis: what is not positive is not drawn.
    pub(crate) fn logarithmic(self) -> Self {
        Self { log: true, ..self }
    }

    /// The same as one of many: small letters, no legend.
    pub(crate) fn small(self) -> Self {
        Self { small: true, ..self }
    }

    /// A function of time, in pieces.
    pub(crate) fn curve(&mut self, name: &str, colour: RGBColor, pieces: &[Vec<(f64, f64)>]) {
        let points = pieces.iter().map(Vec::len).sum();
        self.curves.push((name.into(), colour, pieces.iter().map(|p| thinned(p, points)).collect()));
    }

    /// A path, as a loop is: evenly thinned, in the order in which it was passed.
    pub(crate) fn path(&mut self, name: &str, colour: RGBColor, x: &[f64], y: &[f64]) {
        self.paths(name, colour, &[x.iter().copied().zip(y.iter().copied()).collect()]);
    }

    /// A path in pieces.
    pub(crate) fn paths(&mut self, name: &str, colour: RGBColor, pieces: &[Vec<(f64, f64)>]) {
        let points: usize = pieces.iter().map(Vec::len).sum();
        let step = points.div_ceil(POINTS).max(1);
        let thinned = pieces.iter().map(|piece| piece.iter().copied().step_by(step).collect()).collect();
        self.curves.push((name.into(), colour, thinned));
    }

    /// The same with these bounds of the vertical axis, as panels that are compared share them.
    pub(crate) fn between(self, low: f64, high: f64) -> Self {
        Self { bounds: Some((low, high)), ..self }
    }

    /// The same with its legend at the right.
    pub(crate) fn legend_right(self) -> Self {
        Self { legend: SeriesLabelPosition::UpperRight, ..self }
    }

    /// The same with a logarithmic horizontal axis too.
    pub(crate) fn log_across(self) -> Self {
        Self { log_across: true, ..self }
    }

    /// Draws it, unless there is nothing to draw.
    pub(crate) fn draw_if_any<B: DrawingBackend>(&self, area: &DrawingArea<B, Shift>) -> Drawn
    where
        B::ErrorType: 'static,
    {
        if self.curves.iter().any(|(_, _, pieces)| pieces.iter().any(|piece| !piece.is_empty())) {
            self.draw(area)
        } else {
            Ok(())
        }
    }

    /// Draws it.
    pub(crate) fn draw<B: DrawingBackend>(&self, area: &DrawingArea<B, Shift>) -> Drawn
    where
        B::ErrorType: 'static,
    {
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
        let (title, room) = if self.small { (14, (18, 48)) } else { (18, (38, 62)) };
        let mut builder = ChartBuilder::on(area);
        builder
            .caption(&self.title, ("sans-serif", title))
            .margin(if self.small { 4 } else { 8 })
            .x_label_area_size(if self.x.is_empty() { room.0.min(22) } else { room.0 })
            .y_label_area_size(room.1);
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

    fn lines<'a, B, X, Y>(&self, mut chart: ChartContext<'a, B, Cartesian2d<X, Y>>) -> Drawn
    where
        B: DrawingBackend + 'a,
        B::ErrorType: 'static,
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
        for (name, colour, pieces) in &self.curves {
            let colour = *colour;
            let shown = |piece: &Vec<(f64, f64)>| piece.iter().copied().filter(|p| !self.log || p.1 > 0.0).collect();
            let lines = pieces.iter().map(|piece| {
                let points: Vec<(f64, f64)> = shown(piece);
                PathElement::new(points, colour.stroke_width(1))
            });
            chart
                .draw_series(lines)?
                .label(name)
                .legend(move |(x, y)| PathElement::new([(x, y), (x + 18, y)], colour.stroke_width(3)));
        }
        if !self.small {
            chart
                .configure_series_labels()
                .position(self.legend.clone())
                .background_style(WHITE.mix(0.85))
                .border_style(BLACK.mix(0.2))
                .label_font(("sans-serif", 13))
                .draw()?;
        }
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
