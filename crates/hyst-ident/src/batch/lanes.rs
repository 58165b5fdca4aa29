//! Eight numbers side by side, one for each candidate of a pass.

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};

/// Candidates of one pass.
pub const LANES: usize = 8;

/// One number for each of eight candidates. Every operation acts on each alone, in the same order as on one number: a candidate's
/// result does not depend on its neighbours or on the instructions that the processor has.
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
    /// Zero for all.
    pub const ZERO: Self = Self([0.0; LANES]);

    /// The same for all.
    #[inline(always)]
    pub fn all(x: f64) -> Self {
        Self([x; LANES])
    }

    /// A function of each number.
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

    /// `self · factor + other`, rounded once.
    #[inline(always)]
    pub fn times_plus(self, factor: Self, other: Self) -> Self {
        let mut out = other;
        for ((out, x), y) in out.0.iter_mut().zip(self.0).zip(factor.0) {
            *out = x.mul_add(y, *out);
        }
        out
    }

    /// `1 − e^(−x)` for x ≥ 0, to about one unit in the last place.
    #[inline(always)]
    pub fn fallen(self) -> Self {
        // −x = k ln 2 + r with |r| ≤ ln 2 / 2; the sum with 1.5 · 2⁵² rounds, and leaves k in its last bits.
        const ROUND: f64 = 6_755_399_441_055_744.0;
        const LN_2: [f64; 2] = [6.931_471_803_691_238e-1, 1.908_214_929_270_587_7e-10];
        // Beyond this nothing of e^(−x) shows beside one.
        const FAR: f64 = 40.0;
        // One operation on all lanes after the other: of a longer function of each the compiler makes no vectors.
        let y = -self.at_most(Self::all(FAR));
        let rounded = y.times_plus(Self::all(std::f64::consts::LOG2_E), Self::all(ROUND));
        let k = rounded - Self::all(ROUND);
        let r = k.times_plus(Self::all(-LN_2[1]), k.times_plus(Self::all(-LN_2[0]), y));
        // e^r − 1 = r + r² (1/2! + r/3! + …).
        // Pairs of terms, then pairs of pairs (Estrin): a long chain of sums would wait for each of them.
        let (r2, one) = (r * r, |i: usize| Self::all(FACTORIALS[i]));
        let pair = |i: usize| r.times_plus(one(i + 1), one(i));
        let four = |i: usize| r2.times_plus(pair(i + 2), pair(i));
        let r4 = r2 * r2;
        let series = (r4 * r4).times_plus(four(8), r4.times_plus(four(4), four(0)));
        let rise = r2.times_plus(series, r);
        let power = rounded.map(|x| f64::from_bits(x.to_bits().wrapping_add(1023) << 52));
        -power.times_plus(rise, power - Self::all(1.0))
    }

    /// `a` where `f` says so of this and another, `b` elsewhere.
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

    /// The smaller one; `self` where a number is none.
    #[inline(always)]
    pub fn at_most(self, other: Self) -> Self {
        // One instruction, where `f64::min` takes four for the sake of what is no number.
        self.with(other, |x, y| if y < x { y } else { x })
    }

    /// The larger one; `self` where a number is none.
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
    fn what_has_fallen_is_the_exponentials() {
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
