//! The number type: `f32` or `f64`, with the functions of `libm` on every platform.

use core::fmt::Debug;
use core::ops::{Add, AddAssign, Div, Mul, MulAssign, Neg, Sub, SubAssign};

/// A real number of the signal path.
///
/// It has only operations whose results are bit-identical on every target: the four IEEE operations, comparisons, and
/// functions that `libm` computes in software.
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
    /// Distance from 1 to the next larger value.
    const EPSILON: Self;

    /// Returns the nearest value to `x`.
    fn from_f64(x: f64) -> Self;
    /// Returns the value as `f64` (exact).
    fn to_f64(self) -> f64;
    /// Returns whether the value is neither infinite nor NaN.
    fn is_finite(self) -> bool;
    /// |x|.
    fn abs(self) -> Self;
    /// Returns the largest integer not above x.
    fn floor(self) -> Self;
    /// sin x, x in rad.
    fn sin(self) -> Self;
    /// tan x, x in rad.
    fn tan(self) -> Self;
    /// atan x \[rad\].
    fn atan(self) -> Self;
    /// √x.
    fn sqrt(self) -> Self;
    /// eˣ.
    fn exp(self) -> Self;
    /// eˣ − 1 without cancellation near 0.
    fn exp_m1(self) -> Self;
    /// ln x.
    fn ln(self) -> Self;
    /// ln(1 + x) without cancellation near 0.
    fn ln_1p(self) -> Self;
    /// tanh x.
    fn tanh(self) -> Self;
    /// xʸ.
    fn powf(self, y: Self) -> Self;

    /// Returns the larger of two values; the second if the first is NaN.
    #[inline]
    fn at_least(self, low: Self) -> Self {
        if self > low { self } else { low }
    }
    /// Returns the smaller of two values; the second if the first is NaN.
    #[inline]
    fn at_most(self, high: Self) -> Self {
        if self < high { self } else { high }
    }
    /// Returns the value as an index: 0 for a negative value or NaN, `last` for a value that is too large.
    #[inline]
    fn index(self, last: usize) -> usize {
        // `as` saturates and maps NaN to 0, so this neither panics nor wraps.
        (self.to_f64() as usize).min(last)
    }
}

macro_rules! real {
    ($t:ident, $($name:ident = $function:path),+) => {
        impl Real for $t {
            const ZERO: Self = 0.0;
            const ONE: Self = 1.0;
            const EPSILON: Self = $t::EPSILON;
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
            fn powf(self, y: Self) -> Self {
                real!(@pow $t)(self, y)
            }
            $(#[inline]
            fn $name(self) -> Self {
                $function(self)
            })+
        }
    };
    (@pow f32) => { libm::powf };
    (@pow f64) => { libm::pow };
}

real!(
    f32,
    floor = libm::floorf,
    sin = libm::sinf,
    tan = libm::tanf,
    atan = libm::atanf,
    sqrt = libm::sqrtf,
    exp = libm::expf,
    exp_m1 = libm::expm1f,
    ln = libm::logf,
    ln_1p = libm::log1pf,
    tanh = libm::tanhf
);
real!(
    f64,
    floor = libm::floor,
    sin = libm::sin,
    tan = libm::tan,
    atan = libm::atan,
    sqrt = libm::sqrt,
    exp = libm::exp,
    exp_m1 = libm::expm1,
    ln = libm::log,
    ln_1p = libm::log1p,
    tanh = libm::tanh
);
