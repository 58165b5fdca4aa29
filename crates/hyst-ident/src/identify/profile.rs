//! How far a variable can go before the record objects.

use super::projection::Projection;
use crate::optimize::Space;

/// Halvings with which the end of an interval is found.
const HALVINGS: i32 = 12;

/// The values of one variable that the record allows, the other searched ones held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Interval {
    pub(crate) low: f64,
    pub(crate) high: f64,
    /// Whether it goes on to a side of the box.
    pub(crate) open: bool,
}

/// Where the sum of squares is less than `rise` above its minimum along variable `d`, the linear parameters solved for anew (a section
/// of the likelihood). A slope at the minimum does not show what this does: an activation that is saturated stays so, however far
/// its sharpness goes.
pub(crate) fn interval(
    projection: &Projection<'_>,
    space: &Space,
    point: &[f64],
    d: usize,
    rise: f64,
) -> Option<Interval> {
    let least = projection.at(&space.values(point))?.squares();
    let at = |x: f64| {
        let mut to = point.to_vec();
        to[d] = x;
        space.values(&to)
    };
    let allowed = |x: f64| projection.at(&at(x)).is_some_and(|p| p.squares() <= least + rise);
    let end = |side: f64| {
        if allowed(side) {
            return (side, true);
        }
        let (mut inside, mut outside) = (point[d], side);
        // Most intervals are narrower than what halvings come to.
        let nearest = inside + (outside - inside) / f64::from(1 << HALVINGS);
        if !allowed(nearest) {
            return (inside, false);
        }
        for _ in 0..HALVINGS {
            let middle = 0.5 * (inside + outside);
            if allowed(middle) { inside = middle } else { outside = middle }
        }
        (inside, false)
    };
    let ((low, at_low), (high, at_high)) = rayon::join(|| end(0.0), || end(1.0));
    Some(Interval { low: at(low)[d], high: at(high)[d], open: at_low || at_high })
}
