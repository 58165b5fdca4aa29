//! How far a variable can go before the record objects.

/// The nearest place that is looked at, as a share of the way to the side of the box: an interval that ends before it counts as none.
const NEAREST: f64 = 1.0 / 4096.0;
/// Most places that are tried to find the end of an interval.
const TRIALS: usize = 16;
/// How near to the end one of them counts as there: as a part of its distance on a parabola, anywhere on a plateau of that height.
const NEAR: f64 = 0.01;
/// Share of the rise below which none is told from rounding.
const LOWEST: f64 = 1e-12;

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

/// How far from `place` towards a `side` of the box, 0 or 1, a sum of squares is no more than `least + rise` (a section of the
/// likelihood); `least` is that at `place`. A slope at the minimum does not show what this does: an activation that is saturated stays
/// so, however far its sharpness goes.
pub(crate) fn end(squares: impl Fn(f64) -> f64, place: f64, side: f64, (least, rise): (f64, f64)) -> f64 {
    let at = |distance: f64| if distance < 0.0 { place + distance.exp() * (side - place) } else { side };
    // Over logarithms of the distance a parabola is a straight line; 0 where it has risen by `rise`.
    let height = |distance: f64| {
        let squares = squares(at(distance));
        if squares.is_nan() { f64::INFINITY } else { 0.5 * ((squares - least) / rise).max(LOWEST).ln() }
    };
    let (mut outside, mut far) = (0.0, height(0.0));
    if far <= 0.0 {
        return side;
    }
    let (mut inside, mut near) = (NEAREST.ln(), height(NEAREST.ln()));
    if near > 0.0 {
        return place;
    }
    // Regula falsi; an end that stays counts half as much each time (Illinois), so that none stays for long.
    let mut stayed = 0.0;
    for _ in 0..TRIALS {
        let part = if far.is_finite() { near / (near - far) } else { 0.5 };
        let between = inside + part * (outside - inside);
        let here = height(between);
        if here.abs() <= NEAR || outside - inside <= NEAR {
            return at(between);
        }
        if here < 0.0 {
            (inside, near) = (between, here);
            far *= if stayed > 0.0 { 0.5 } else { 1.0 };
            stayed = 1.0;
        } else {
            (outside, far) = (between, here);
            near *= if stayed < 0.0 { 0.5 } else { 1.0 };
            stayed = -1.0;
        }
    }
    at(inside)
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::cell::Cell;

    /// The interval of a section that has risen by 1 at the ends, and how often it was looked at.
    fn of(place: f64, rise: impl Fn(f64) -> f64) -> (Interval, usize) {
        let looks = Cell::new(0);
        let squares = |x: f64| {
            looks.set(looks.get() + 1);
            7.0 + rise(x)
        };
        let [low, high] = [0.0, 1.0].map(|side| end(squares, place, side, (7.0, 1.0)));
        (Interval { low, high }, looks.get())
    }

    #[test]
    fn the_ends_of_a_section_are_found() {
        let close = |found: f64, expected: f64, place: f64| {
            assert!((found - expected).abs() <= 0.02 * (expected - place).abs(), "{found}, {expected} expected");
        };
        for width in [0.0007, 0.02, 0.19] {
            // A parabola; one that a saturating curve flattens; steeper and flatter ones.
            let sections: [fn(f64) -> f64; 4] =
                [|far| far * far, |far| 4.0 * far * far / (3.0 + far * far), |far| far.powi(4), f64::abs];
            for section in sections {
                let section = |x: f64| section((x - 0.3) / width);
                let (found, looks) = of(0.3, section);
                close(found.low, 0.3 - width, 0.3);
                close(found.high, 0.3 + width, 0.3);
                assert!(looks <= 16, "{looks} for {width}");
            }
        }
        // A wall, behind which there is no model, and a plateau before it.
        let (found, _) = of(0.4, |x| if x > 0.6 { f64::INFINITY } else { 0.1 });
        close(found.high, 0.6, 0.4);
        assert_eq!(found.low, 0.0);
        assert_eq!(of(0.4, |x| if x > 0.6 { f64::NAN } else { 0.1 }).0, found);
    }

    #[test]
    fn what_the_record_does_not_object_to_is_the_whole_box() {
        let (found, looks) = of(0.3, |_| 0.5);
        assert_eq!((found, looks), (Interval { low: 0.0, high: 1.0 }, 2));
        assert!((found.std_error() - 1.0 / 12f64.sqrt()).abs() < 1e-12);
        // At the side there is nowhere to go.
        assert_eq!(of(1.0, |x| 1e9 * (1.0 - x)).0, Interval { low: 1.0, high: 1.0 });
    }

    #[test]
    fn a_fit_that_leaves_nothing_allows_nothing() {
        for side in [0.0, 1.0] {
            assert_eq!(end(|x| (x - 0.5).abs(), 0.5, side, (0.0, 0.0)), 0.5);
        }
    }
}
