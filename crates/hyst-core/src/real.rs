//! The number type: `f32` or `f64`, with `libm`'s functions on every platform.

use core::fmt::Debug;
use core::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// A real number of the signal path.
///
/// Only operations whose result is the same bit for bit on every target are here: the four IEEE
/// ones, comparisons, and what `libm` computes in software.
pub trait Real:
    Copy
    + Debug
    + Default
    + PartialOrd
    + Send
    + Sync
    + 'static
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
{
    /// 0.
    const ZERO: Self;
    /// 1.
    const ONE: Self;

    /// Nearest value to `x`.
    fn from_f64(x: f64) -> Self;
    /// The value as `f64` (exact).
    fn to_f64(self) -> f64;
    /// Whether the value is neither infinite nor NaN.
    fn is_finite(self) -> bool;
    /// |x|.
    fn abs(self) -> Self;
    /// Largest integer not above x.
    fn floor(self) -> Self;
    /// sin x, x in rad.
    fn sin(self) -> Self;

    /// The larger of two values; the second if the first is NaN.
    #[inline]
    fn at_least(self, low: Self) -> Self {
        if self > low { self } else { low }
    }
    /// The smaller of two values; the second if the first is NaN.
    #[inline]
    fn at_most(self, high: Self) -> Self {
        if self < high { self } else { high }
    }
    /// The value as an index: negative and NaN give 0, too large gives `last`.
    #[inline]
    fn index(self, last: usize) -> usize {
        // `as` saturates and sends NaN to 0, so this can neither panic nor wrap.
        (self.to_f64() as usize).min(last)
    }
}

macro_rules! real {
    ($t:ty, $floor:path, $sin:path) => {
        impl Real for $t {
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            #[inline]
            fn from_f64(x: f64) -> Self {
                x as $t
            }
            #[inline]
            fn to_f64(self) -> f64 {
                f64::from(self)
            }
            #[inline]
            fn is_finite(self) -> bool {
                self.is_finite()
            }
            #[inline]
            fn abs(self) -> Self {
                if self < 0.0 { -self } else { self }
            }
            #[inline]
            fn floor(self) -> Self {
                $floor(self)
            }
            #[inline]
            fn sin(self) -> Self {
                $sin(self)
            }
        }
    };
}

real!(f32, libm::floorf, libm::sinf);
real!(f64, libm::floor, libm::sin);
