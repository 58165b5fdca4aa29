//! The interval of a variable that the record allows.

/// Smallest distance that is examined, as a share of the distance to the side of the box: a shorter interval counts as
/// empty.
const MIN_DISTANCE: f64 = 1.0 / 4096.0;
/// Maximum number of trials for the end of an interval.
const MAX_TRIALS: usize = 16;
/// Tolerance of the end: relative distance on a parabola.
const END_TOLERANCE: f64 = 0.01;
/// Share of the rise below which a rise is rounding.
const MIN_RISE_SHARE: f64 = 1e-12;

/// The interval of one variable that the record allows, as fractions 0 … 1 of its box, with the other searched
/// variables held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Interval {
    pub(crate) low: f64,
    pub(crate) high: f64,
}

impl Interval {
    /// Returns the equivalent standard error, as a share of the box. The interval covers two standard errors to either
    /// side. If the record allows the whole box, it is that of a uniform distribution over the box.
    pub(crate) fn std_error(self) -> f64 {
        let all = self.low <= 0.0 && self.high >= 1.0;
        (self.high - self.low) / if all { 12f64.sqrt() } else { 4.0 }
    }
}

/// Returns the end of the interval between `place` and a `side` of the box (0 or 1) in which the sum of squares is at
/// most `least + rise` (a section of the likelihood). `least` is the sum at `place`. A slope at the minimum does not
/// show this: a saturated activation stays saturated, however large its sharpness.
pub(crate) fn end(squares: impl Fn(f64) -> f64, place: f64, side: f64, (least, rise): (f64, f64)) -> f64 {
    let at = |distance: f64| if distance < 0.0 { place + distance.exp() * (side - place) } else { side };
    // Over the logarithm of the distance a parabola is a straight line; it is 0 at a rise of `rise`.
    let height = |distance: f64| {
        let squares = squares(at(distance));
        if squares.is_nan() { f64::INFINITY } else { 0.5 * ((squares - least) / rise).max(MIN_RISE_SHARE).ln() }
    };
    let (mut outside, mut far) = (0.0, height(0.0));
    if far <= 0.0 {
        return side;
    }
    let (mut inside, mut near) = (MIN_DISTANCE.ln(), height(MIN_DISTANCE.ln()));
    if near > 0.0 {
        return place;
    }
    // Regula falsi. An end that stays is halved each time (Illinois method), so that none stays long.
    let mut stayed = 0.0;
    for _ in 0..MAX_TRIALS {
        let part = if far.is_finite() { near / (near - far) } else { 0.5 };
        let between = inside + part * (outside - inside);
        let here = height(between);
        if here.abs() <= END_TOLERANCE || outside - inside <= END_TOLERANCE {
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

    /// Returns the interval of a section that rises by 1 at its ends, and the number of evaluations.
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
            // A parabola; one flattened by saturation; steeper and flatter ones.
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
        // A wall, beyond which there is no model, and a plateau before it.
        let (found, _) = of(0.4, |x| if x > 0.6 { f64::INFINITY } else { 0.1 });
        close(found.high, 0.6, 0.4);
        assert_eq!(found.low, 0.0);
        assert_eq!(of(0.4, |x| if x > 0.6 { f64::NAN } else { 0.1 }).0, found);
    }

    #[test]
    fn a_section_without_a_rise_allows_the_whole_box() {
        let (found, looks) = of(0.3, |_| 0.5);
        assert_eq!((found, looks), (Interval { low: 0.0, high: 1.0 }, 2));
        assert!((found.std_error() - 1.0 / 12f64.sqrt()).abs() < 1e-12);
        // At the side the interval is empty.
        assert_eq!(of(1.0, |x| 1e9 * (1.0 - x)).0, Interval { low: 1.0, high: 1.0 });
    }

    #[test]
    fn an_exact_fit_allows_no_interval() {
        for side in [0.0, 1.0] {
            assert_eq!(end(|x| (x - 0.5).abs(), 0.5, side, (0.0, 0.0)), 0.5);
        }
    }
}
