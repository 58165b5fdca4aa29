//! How far a variable can go before the record objects.

use super::projection::Projection;
use crate::optimize::Space;

/// Halvings with which the end of an interval is found.
const HALVINGS: i32 = 12;

/// The part of one variable's side of the box, a part of 0 … 1, that the record allows, the other searched variables held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Interval {
    pub(crate) low: f64,
    pub(crate) high: f64,
}

impl Interval {
    /// The standard error that goes with it, as a share of the box. The interval is that of two standard errors to either side; where
    /// the record allows the whole box, it says no more than the box does, in which every place is as good.
    pub(crate) fn std_error(self) -> f64 {
        let all = self.low <= 0.0 && self.high >= 1.0;
        (self.high - self.low) / if all { 12f64.sqrt() } else { 4.0 }
    }
}

/// Where the sum of squares is no more than `most` along variable `d`, the linear parameters solved for anew (a section
/// of the likelihood). A slope at the minimum does not show what this does: an activation that is saturated stays so, however far
/// its sharpness goes.
pub(crate) fn interval(projection: &Projection<'_>, space: &Space, point: &[f64], d: usize, most: f64) -> Interval {
    let allowed = |x: f64| {
        let mut to = point.to_vec();
        to[d] = x;
        projection.squares(&space.values(&to)) <= most
    };
    let end = |side: f64| {
        if allowed(side) {
            return side;
        }
        let (mut inside, mut outside) = (point[d], side);
        // Most intervals are narrower than what halvings come to.
        let nearest = inside + (outside - inside) / f64::from(1 << HALVINGS);
        if !allowed(nearest) {
            return inside;
        }
        for _ in 0..HALVINGS {
            let middle = 0.5 * (inside + outside);
            if allowed(middle) { inside = middle } else { outside = middle }
        }
        inside
    };
    let (low, high) = rayon::join(|| end(0.0), || end(1.0));
    Interval { low, high }
}
