//! The drag on a sliding play.

use crate::error::{coefficient, within};
use crate::{Error, Real};

/// Coefficients of the law `o = λ v + √(J v)` between the speed v \[u/s\] of a play and its overdrive o \[u\], at one
/// sample period.
///
/// Backward Euler over a sample h: the play moves by `h v`, which reduces the overdrive by the same amount:
/// `(λ + h) v + √(J v) = o`. With `j = J / (4 (λ + h))` and `x = (λ + h) v` that is `x + 2 √(j x) = o`, so
///
/// ```text
/// √x = √(j + o) − √j = o / (√(j + o) + √j),    the play moves by a x,    a = h / (h + λ).
/// ```
///
/// x rises with o, with a slope below one. A play stays behind its input at any sample period, and plays keep their
/// order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Drag<T> {
    /// a
    pub(super) slide: T,
    /// √j \[√u\]; if it is zero, x = o.
    root: T,
}

impl<T: Real> Drag<T> {
    /// Creates the coefficients from λ = `seconds` and J = `volt_seconds` at the sample period `h` \[s\].
    pub(super) fn new(seconds: f64, volt_seconds: f64, h: f64) -> Result<Self, Error> {
        const J: &str = "rate-dependence.volt_seconds";
        let lambda = within("rate-dependence.seconds", seconds, seconds >= 0.0, "zero or positive")?;
        let impulse = within(J, volt_seconds, volt_seconds >= 0.0, "zero or positive")?;
        let root = coefficient(J, 0.5 * libm::sqrt(impulse / (h + lambda)))?;
        Ok(Self { slide: T::from_f64(h / (h + lambda)), root })
    }

    /// Returns zero drag: the play follows its input at once beyond the threshold.
    pub(super) fn none() -> Self {
        Self { slide: T::ONE, root: T::ZERO }
    }

    /// Returns whether a play moves in proportion to its overdrive.
    pub(super) fn is_linear(&self) -> bool {
        self.root == T::ZERO
    }

    /// Computes the motion of a play in one sample, if its input is `beyond` its threshold \[u, signed\]; for J = 0.
    #[inline]
    pub(super) fn linear(&self, beyond: T) -> T {
        self.slide * beyond
    }

    /// Computes the same for J > 0, and its derivative with respect to `beyond`: `a x` and `a x'`, with
    /// `x' = 1 − √j/√(j + o) = √x/√(j + o)`.
    #[inline]
    pub(super) fn rooted(&self, beyond: T) -> (T, T) {
        // Most plays rest, and a square root is expensive.
        if beyond == T::ZERO {
            return (T::ZERO, T::ZERO);
        }
        let root = (self.root * self.root + beyond.abs()).sqrt();
        let share = beyond / (root + self.root);
        (self.slide * share * share.abs(), self.slide * share.abs() / root)
    }

    /// Computes the overdrive of a single play if the output change `push` \[y\] comes from the input with `gain`
    /// \[y/u\] and from the play with `weight` \[y/u\]: the o with `gain o + weight a x = push`. Valid for J > 0,
    /// `gain` > 0 and `gain + weight a` > 0.
    ///
    /// With `t = √x` it is `(gain + weight a) t² + 2 gain √j t = push`.
    pub(super) fn overdrive_of_one(&self, gain: T, weight: T, push: T) -> T {
        let linear = gain * self.root;
        let t = push / (linear + (linear * linear + (gain + weight * self.slide) * push).sqrt());
        t * (t + self.root + self.root)
    }
}
