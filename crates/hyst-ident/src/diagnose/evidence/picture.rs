//! Pictures as data, independent of how they are drawn.

use serde::{Deserialize, Deserializer, Serialize};

use crate::model::Effect;

/// Maximum number of points of a curve; a screen shows no more.
pub const MOST_POINTS: usize = 2000;

/// One axis.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Axis {
    /// What is on it.
    pub label: String,
    /// Symbol of its unit; empty for ratios.
    pub unit: String,
    /// Whether it is logarithmic.
    pub log: bool,
}

/// How a curve is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Style {
    /// Connected points.
    Line,
    /// Points alone.
    Points,
}

/// Role of a curve: the same role has the same style in every picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// The measurement.
    Measured,
    /// The given model, or the extended one without one effect.
    Without,
    /// The extended model.
    With,
    /// A reference for comparison, such as the noise floor.
    Reference,
}

/// One curve. A missing point (NaN, in files `null`) interrupts a line.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Curve {
    /// What it shows.
    pub name: String,
    /// How it is drawn.
    pub style: Style,
    /// Its role.
    pub role: Role,
    /// Values \[the x axis's unit\].
    pub x: Vec<f64>,
    /// Values \[the y axis's unit\].
    #[serde(deserialize_with = "null_as_nan")]
    pub y: Vec<f64>,
}

fn null_as_nan<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<f64>, D::Error> {
    let values: Vec<Option<f64>> = Deserialize::deserialize(deserializer)?;
    Ok(values.into_iter().map(|v| v.unwrap_or(f64::NAN)).collect())
}

/// A named position on the x axis, such as the frequency of a mode.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Mark {
    /// Position \[the x axis's unit\].
    pub at: f64,
    /// Its name.
    pub name: String,
}

/// One picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Picture {
    /// Effect that the picture is evidence for; `None` for the whole model.
    pub effect: Option<Effect>,
    /// Title.
    pub title: String,
    /// What the picture shows if the name is right.
    pub caption: String,
    /// Horizontal axis.
    pub x: Axis,
    /// Vertical axis.
    pub y: Axis,
    /// Curves, in drawing order.
    pub curves: Vec<Curve>,
    /// Positions with a vertical line.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub marks: Vec<Mark>,
}

impl Axis {
    pub(super) fn new(label: &str, unit: &str) -> Self {
        Self { label: label.into(), unit: unit.into(), log: false }
    }

    pub(super) fn log(self) -> Self {
        Self { log: true, ..self }
    }
}

impl Picture {
    pub(super) fn new(effect: Option<Effect>, title: &str, x: Axis, y: Axis, caption: impl Into<String>) -> Self {
        Self { effect, title: title.into(), caption: caption.into(), x, y, curves: Vec::new(), marks: Vec::new() }
    }

    /// Adds a function of x, thinned without losing peaks. Values that a logarithmic axis cannot show are dropped.
    pub(super) fn line(&mut self, role: Role, name: &str, x: &[f64], y: &[f64]) {
        let shown = |(x, y): &(f64, f64)| !(self.x.log && *x <= 0.0 || self.y.log && *y <= 0.0);
        let points: Vec<(f64, f64)> = x.iter().copied().zip(y.iter().copied()).filter(shown).collect();
        let (x, y) = thinned(&points, self.x.log).into_iter().unzip();
        self.curves.push(Curve { name: name.into(), style: Style::Line, role, x, y });
    }

    /// Adds single points.
    pub(super) fn points(&mut self, role: Role, name: &str, (x, y): (Vec<f64>, Vec<f64>)) {
        self.curves.push(Curve { name: name.into(), style: Style::Points, role, x, y });
    }

    /// Adds a path such as a loop: evenly thinned, in the order of the rows.
    pub(super) fn path(&mut self, role: Role, name: &str, x: &[f64], y: &[f64]) {
        let step = x.len().div_ceil(MOST_POINTS).max(1);
        let (x, y) = (x.iter().copied().step_by(step).collect(), y.iter().copied().step_by(step).collect());
        self.curves.push(Curve { name: name.into(), style: Style::Line, role, x, y });
    }

    /// Names a position on the x axis.
    pub(super) fn mark(&mut self, at: f64, name: String) {
        self.marks.push(Mark { at, name });
    }

    /// Returns whether the picture has content: every curve has at least two points.
    pub(super) fn shows(&self) -> bool {
        !self.curves.is_empty() && self.curves.iter().all(|c| c.x.len() > 1)
    }
}

/// Keeps the minimum and the maximum of each bin of the axis, and all interruptions.
fn thinned(points: &[(f64, f64)], log: bool) -> Vec<(f64, f64)> {
    if points.len() <= MOST_POINTS {
        return points.to_vec();
    }
    let place = |x: f64| if log { x.ln() } else { x };
    let (first, last) = (place(points[0].0), place(points[points.len() - 1].0));
    // Two points per bin, and some margin for interruptions.
    let stretches = 0.45 * MOST_POINTS as f64;
    let stretch = |p: &(f64, f64)| (((place(p.0) - first) / (last - first) * stretches) as usize, p.1.is_nan());
    let mut kept = Vec::new();
    for part in points.chunk_by(|a, b| stretch(a) == stretch(b)) {
        let by = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
        if let (Some(low), Some(high)) = (part.iter().min_by(by), part.iter().max_by(by)) {
            let (a, b) = if low.0 <= high.0 { (low, high) } else { (high, low) };
            kept.push(*a);
            if a.0 < b.0 && !a.1.is_nan() {
                kept.push(*b);
            }
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thinning_keeps_peaks_and_gaps() {
        let mut points: Vec<(f64, f64)> = (1..=50_000).map(|k| (f64::from(k), (0.01 * f64::from(k)).sin())).collect();
        points[31_234].1 = 7.0;
        points[12_345].1 = -5.0;
        points[40_000].1 = f64::NAN;
        for log in [false, true] {
            let kept = thinned(&points, log);
            assert!(kept.len() <= MOST_POINTS, "{}", kept.len());
            assert!(kept.contains(&(31_235.0, 7.0)) && kept.contains(&(12_346.0, -5.0)), "log {log}");
            assert!(kept.iter().any(|p| p.0 == 40_001.0 && p.1.is_nan()), "log {log}");
            assert!(kept.is_sorted_by(|a, b| a.0 < b.0), "log {log}");
        }
    }

    #[test]
    fn a_picture_is_read_back_as_written() {
        let (x, y) = (Axis::new("time", "s"), Axis::new("residual", "µm").log());
        let mut picture = Picture::new(Some(Effect::Creep), "t", x, y, "c");
        picture.line(Role::With, "a", &[1.0, 2.0, 3.0], &[1.0, f64::NAN, 0.0]);
        assert_eq!(picture.curves[0].x, [1.0, 2.0], "zero is not shown on a logarithmic axis");
        let read: Picture = serde_json::from_str(&serde_json::to_string(&picture).unwrap()).unwrap();
        assert!(read.curves[0].y[1].is_nan());
        assert_eq!(format!("{read:?}"), format!("{picture:?}"));
    }
}
