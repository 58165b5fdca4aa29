//! The inverse of a model without a closed-form inverse: a bounded search for the input.

use crate::error::{coefficient, finite, within};
use crate::stage::{hold, rest};
use crate::{Env, Error, Probe, Real, Stage};

/// Inverse by search, of a model whose output rises with the present input.
///
/// For each sample it searches the input `u` with `model(u) = y` and starts at the last input. First the width of the
/// bracket doubles until it contains the root. Then regula falsi (Illinois) follows. Every third step is a bisection
/// unless the two steps before it have halved the bracket. The search ends when the bracket is at most `tolerance`
/// wide. Then the input is within `tolerance` of the exact one, and the output within the model's steepest slope times
/// `tolerance`.
///
/// There are at most [`EVALUATIONS`](Self::EVALUATIONS) evaluations. At most 12 of them find the bracket. Every three
/// of the others at least halve it. So for any model the input is found to 2⁻³⁸ of the range or to the precision of
/// `T`. Whether a smaller tolerance is met depends on the shape of the curve. For an output that no input of the range
/// reaches, the result is the nearer end of the range.
///
/// If the output falls briefly after a reversal (a fold), the search crosses the fold: the input jumps, and the output
/// is still reached.
#[derive(Clone, Debug, PartialEq)]
pub struct Search<T, M> {
    model: M,
    low: T,
    high: T,
    tolerance: T,
}

/// History of a search: the history of the model, the last input and the last reference.
#[derive(Clone, Debug, PartialEq)]
pub struct SearchState<T, S> {
    model: S,
    u: T,
    reference: T,
}

impl<T: Real, M> Search<T, M> {
    /// Maximum number of evaluations of the model for one sample.
    pub const EVALUATIONS: usize = 128;

    /// Creates a search over inputs from `low` to `high`, to within `tolerance` \[all in the input unit of the model\].
    ///
    /// # Errors
    /// If a number is not finite, `low ≥ high`, or the tolerance is not positive.
    pub fn new(model: M, low: f64, high: f64, tolerance: f64) -> Result<Self, Error> {
        finite("search.low", low)?;
        within("search.high", high, high > low, "above search.low")?;
        within("search.tolerance", tolerance, tolerance > 0.0, "positive")?;
        let (low, high): (T, T) = (coefficient("search.low", low)?, coefficient("search.high", high)?);
        // A range that overflows has no finite middle.
        if !(high - low).is_finite() {
            return Err(Error::NonFinite("search.high minus search.low"));
        }
        Ok(Self { model, low, high, tolerance: T::from_f64(tolerance) })
    }

    /// Returns the model that is inverted.
    pub fn model(&self) -> &M {
        &self.model
    }

    /// Returns the maximum error of an input \[input unit\].
    pub fn tolerance(&self) -> T {
        self.tolerance
    }

    /// Returns the root of the rising function `f`. The search starts at `start`.
    fn root(&self, start: T, mut f: impl FnMut(T) -> T) -> T {
        let half = T::from_f64(0.5);
        let (mut a, mut fa) = (start, f(start));
        if !fa.is_finite() || fa == T::ZERO {
            return start;
        }
        let up = fa < T::ZERO;
        let end = if up { self.high } else { self.low };
        let mut width = (self.high - self.low) * T::from_f64(1.0 / 1024.0);
        let (mut b, mut fb) = (a, fa);
        let mut remaining = Self::EVALUATIONS;
        while remaining > 0 && (fb < T::ZERO) == up && fb != T::ZERO {
            if b == end {
                return end;
            }
            (a, fa) = (b, fb);
            b = if up { (b + width).at_most(self.high) } else { (b - width).at_least(self.low) };
            width += width;
            fb = f(b);
            remaining -= 1;
        }
        // From here on the root is between a and b. An end that is kept twice gets half its value (Illinois), so
        // neither end stays forever.
        let (mut kept, mut before) = (0i8, (b - a).abs());
        for i in 0..remaining {
            if fb == T::ZERO || (b - a).abs() <= self.tolerance {
                break;
            }
            let secant = a - fa * ((b - a) / (fb - fa));
            let slow = i % 3 == 2 && (b - a).abs() > before * half;
            let inside = (secant > a.at_most(b)) && (secant < a.at_least(b));
            let c = if slow || !inside { a + (b - a) * half } else { secant };
            if c == a || c == b {
                break;
            }
            let fc = f(c);
            if (fc < T::ZERO) == (fb < T::ZERO) {
                (b, fb) = (c, fc);
                fa = if kept == 1 { fa * half } else { fa };
                kept = 1;
            } else {
                (a, fa) = (c, fc);
                fb = if kept == -1 { fb * half } else { fb };
                kept = -1;
            }
            // Taken after a bisection, if there was one: the next three steps must halve this width.
            if i % 3 == 2 {
                before = (b - a).abs();
            }
        }
        if fa.abs() < fb.abs() { a } else { b }
    }
}

impl<T: Real, M: Probe<T>> Stage<T> for Search<T, M> {
    type State = SearchState<T, M::State>;

    fn state(&self) -> Self::State {
        SearchState { model: self.model.state(), u: T::ZERO.at_least(self.low).at_most(self.high), reference: T::ZERO }
    }

    /// Sets the model to rest at the input whose output is `u0`.
    fn reset(&self, s: &mut Self::State, e: &Env<T>, u0: T) -> T {
        let (start, y) = (T::ZERO.at_least(self.low).at_most(self.high), rest(&mut s.reference, u0));
        s.u = self.root(start, |u| self.model.reset(&mut s.model, e, u) - y);
        self.model.reset(&mut s.model, e, s.u);
        s.u
    }

    fn step(&self, s: &mut Self::State, e: &Env<T>, u: T) -> T {
        let y = hold(&mut s.reference, u);
        s.u = self.root(s.u, |trial| self.model.probe(&s.model, e, trial) - y);
        self.model.step(&mut s.model, e, s.u);
        s.u
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `y = u³ + u − u_last / 2`: rises with u and has a memory.
    #[derive(Clone)]
    struct Cubic;
    impl Stage<f64> for Cubic {
        type State = f64;
        fn state(&self) -> f64 {
            0.0
        }
        fn reset(&self, s: &mut f64, _: &Env<f64>, u0: f64) -> f64 {
            *s = u0;
            u0 * u0 * u0 + u0 * 0.5
        }
        fn step(&self, s: &mut f64, e: &Env<f64>, u: f64) -> f64 {
            let y = self.probe(s, e, u);
            *s = u;
            y
        }
    }
    impl Probe<f64> for Cubic {
        fn probe(&self, s: &f64, _: &Env<f64>, u: f64) -> f64 {
            u * u * u + u - s * 0.5
        }
    }

    #[test]
    fn every_reachable_output_is_reached_to_the_tolerance() {
        let inverse = Search::new(Cubic, -50.0, 50.0, 1e-12).unwrap();
        let (mut s, mut forward, e) = (inverse.state(), 0.0, Env::default());
        let first = inverse.reset(&mut s, &e, 3.0);
        assert!((Cubic.reset(&mut forward, &e, first) - 3.0).abs() < 1e-10);
        for k in 0..2000 {
            let y = 900.0 * libm::sin(0.7 * f64::from(k)) * libm::cos(0.013 * f64::from(k));
            let u = inverse.step(&mut s, &e, y);
            // Slope at most 3·10² + 1 where |y| ≤ 1000.
            assert!((Cubic.step(&mut forward, &e, u) - y).abs() < 1e-9);
        }
    }

    /// The slope rises by a factor of 10⁹ at 0.3: the secant does not help.
    struct Kink;
    impl Stage<f64> for Kink {
        type State = ();
        fn state(&self) {}
        fn reset(&self, (): &mut (), _: &Env<f64>, u0: f64) -> f64 {
            (u0 - 0.3) * if u0 < 0.3 { 1e-9 } else { 1.0 }
        }
        fn step(&self, (): &mut (), e: &Env<f64>, u: f64) -> f64 {
            self.reset(&mut (), e, u)
        }
    }
    impl Probe<f64> for Kink {
        fn probe(&self, (): &(), e: &Env<f64>, u: f64) -> f64 {
            self.reset(&mut (), e, u)
        }
    }

    #[test]
    fn input_is_found_to_a_small_part_of_the_range_at_a_kink() {
        let range = 100.0;
        let inverse = Search::new(Kink, -50.0, 50.0, 1e-300).unwrap();
        let (mut s, e) = (inverse.state(), Env::default());
        for k in 0..2000 {
            let u = 49.0 * libm::sin(1.7 * f64::from(k));
            let found = inverse.step(&mut s, &e, Kink.step(&mut (), &e, u));
            assert!((found - u).abs() <= range * libm::exp2(-38.0), "{found} {u}");
        }
    }

    /// Steps of 1 over 1e-10 V, with nearly flat treads of 1e-9 V between them: every secant is wrong.
    #[test]
    fn input_is_found_to_a_small_part_of_the_range_on_a_staircase() {
        struct Stairs;
        impl Stage<f64> for Stairs {
            type State = ();
            fn state(&self) {}
            fn reset(&self, (): &mut (), _: &Env<f64>, u0: f64) -> f64 {
                let (pitch, tread) = (1.1e-9, 1e-9);
                let place = u0 / pitch;
                let inside = (place - libm::floor(place)) * pitch;
                libm::floor(place) + if inside > tread { (inside - tread) / (pitch - tread) } else { 1e-10 * inside }
            }
            fn step(&self, (): &mut (), e: &Env<f64>, u: f64) -> f64 {
                self.reset(&mut (), e, u)
            }
        }
        impl Probe<f64> for Stairs {
            fn probe(&self, (): &(), e: &Env<f64>, u: f64) -> f64 {
                self.reset(&mut (), e, u)
            }
        }
        let inverse = Search::new(Stairs, -50.0, 50.0, 1e-300).unwrap();
        let (mut s, e) = (inverse.state(), Env::default());
        for k in 0..500 {
            let u = 49.0 * libm::sin(1.7 * f64::from(k));
            let found = inverse.step(&mut s, &e, Stairs.step(&mut (), &e, u));
            assert!((found - u).abs() <= 100.0 * libm::exp2(-38.0) + 1.1e-9, "{found} {u}");
        }
    }

    #[test]
    fn unreachable_outputs_give_the_end_of_the_range() {
        let inverse = Search::new(Cubic, -2.0, 3.0, 1e-9).unwrap();
        let (mut s, e) = (inverse.state(), Env::default());
        inverse.reset(&mut s, &e, 0.0);
        assert_eq!(inverse.step(&mut s, &e, 1e9), 3.0);
        assert_eq!(inverse.step(&mut s, &e, -1e9), -2.0);
        assert!(inverse.step(&mut s, &e, f64::NAN).is_finite());
    }
}
