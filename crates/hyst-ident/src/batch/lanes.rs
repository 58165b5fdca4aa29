//! Vectors of eight numbers, one for each candidate of a pass.

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// Number of candidates of a pass.
pub const LANES: usize = 8;

/// One number for each of eight candidates.
///
/// Every operation acts on each lane alone, in the same order as on one number. So a candidate's result depends neither
/// on the other candidates nor on the instruction set of the processor.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub struct Lanes(pub [f64; LANES]);

/// 1/2!, 1/3!, … 1/13!
const FACTORIALS: [f64; 12] = [
    0.5,
    1.0 / 6.0,
    1.0 / 24.0,
    1.0 / 120.0,
    1.0 / 720.0,
    1.0 / 5_040.0,
    1.0 / 40_320.0,
    1.0 / 362_880.0,
    1.0 / 3_628_800.0,
    1.0 / 39_916_800.0,
    1.0 / 479_001_600.0,
    1.0 / 6_227_020_800.0,
];

impl Lanes {
    /// Zero in all lanes.
    pub const ZERO: Self = Self([0.0; LANES]);

    /// Returns the same number in all lanes.
    #[inline(always)]
    pub fn all(x: f64) -> Self {
        Self([x; LANES])
    }

    /// Applies a function to each lane.
    #[inline(always)]
    pub fn map(self, f: impl Fn(f64) -> f64) -> Self {
        let mut out = self;
        for x in &mut out.0 {
            *x = f(*x);
        }
        out
    }

    #[inline(always)]
    fn with(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        let mut out = self;
        for (x, y) in out.0.iter_mut().zip(other.0) {
            *x = f(*x, y);
        }
        out
    }

    /// Returns `self · factor + other`, rounded once.
    #[inline(always)]
    pub fn times_plus(self, factor: Self, other: Self) -> Self {
        let mut out = other;
        for ((out, x), y) in out.0.iter_mut().zip(self.0).zip(factor.0) {
            *out = x.mul_add(y, *out);
        }
        out
    }

    /// Returns `1 − e^(−x)` for x ≥ 0, to about one unit in the last place.
    #[inline(always)]
    pub fn fallen(self) -> Self {
        // −x = k ln 2 + r with |r| ≤ ln 2 / 2. Adding 1.5 · 2⁵² rounds and puts k into the last bits.
        const ROUND: f64 = 6_755_399_441_055_744.0;
        const LN_2: [f64; 2] = [6.931_471_803_691_238e-1, 1.908_214_929_270_587_7e-10];
        // Above this e^(−x) is below the rounding of one.
        const FAR: f64 = 40.0;
        // One operation on all lanes at a time: the compiler does not vectorise a longer function of each lane.
        let y = -self.at_most(Self::all(FAR));
        let rounded = y.times_plus(Self::all(std::f64::consts::LOG2_E), Self::all(ROUND));
        let k = rounded - Self::all(ROUND);
        let r = k.times_plus(Self::all(-LN_2[1]), k.times_plus(Self::all(-LN_2[0]), y));
        // e^r − 1 = r + r² (1/2! + r/3! + …).
        // Pairs of terms, then pairs of pairs (Estrin's scheme), to avoid a long chain of dependent sums.
        let (r2, one) = (r * r, |i: usize| Self::all(FACTORIALS[i]));
        let pair = |i: usize| r.times_plus(one(i + 1), one(i));
        let four = |i: usize| r2.times_plus(pair(i + 2), pair(i));
        let r4 = r2 * r2;
        let series = (r4 * r4).times_plus(four(8), r4.times_plus(four(4), four(0)));
        let rise = r2.times_plus(series, r);
        let power = rounded.map(|x| f64::from_bits(x.to_bits().wrapping_add(1023) << 52));
        -power.times_plus(rise, power - Self::all(1.0))
    }

    /// Returns `a` in the lanes in which `f` holds for `self` and `other`, otherwise `b`.
    #[inline(always)]
    pub fn choose(self, other: Self, f: impl Fn(f64, f64) -> bool, a: Self, b: Self) -> Self {
        let mut out = b;
        for (l, out) in out.0.iter_mut().enumerate() {
            if f(self.0[l], other.0[l]) {
                *out = a.0[l];
            }
        }
        out
    }

    /// Returns the smaller number; `self` if one is NaN.
    #[inline(always)]
    pub fn at_most(self, other: Self) -> Self {
        // One instruction; `f64::min` takes four because of NaN.
        self.with(other, |x, y| if y < x { y } else { x })
    }

    /// Returns the larger number; `self` if one is NaN.
    #[inline(always)]
    pub fn at_least(self, other: Self) -> Self {
        self.with(other, |x, y| if y > x { y } else { x })
    }
}

impl Add for Lanes {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        self.with(other, |x, y| x + y)
    }
}

impl AddAssign for Lanes {
    #[inline(always)]
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for Lanes {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        self.with(other, |x, y| x - y)
    }
}

impl Mul for Lanes {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        self.with(other, |x, y| x * y)
    }
}

impl Mul<f64> for Lanes {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: f64) -> Self {
        self.map(|x| x * other)
    }
}

impl Div for Lanes {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        self.with(other, |x, y| x / y)
    }
}

impl Neg for Lanes {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.map(|x| -x)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fallen_matches_expm1() {
        for k in 0..20_000 {
            let x = 1e-9 * 1.0015f64.powi(k);
            let found = Lanes::all(x).fallen().0[3];
            let exact = -libm::expm1(-x);
            assert!((found - exact).abs() <= 3e-16 * exact, "{x}: {found} {exact}");
        }
        assert_eq!(Lanes::ZERO.fallen(), Lanes::ZERO);
        assert!(Lanes::all(f64::NAN).fallen().0[0].is_nan());
    }
}
