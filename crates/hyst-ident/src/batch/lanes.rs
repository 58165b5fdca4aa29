//! Eight numbers side by side, one for each candidate of a pass.

use std::ops::{Add, AddAssign, Mul, Neg, Sub};

/// Candidates of one pass.
pub const LANES: usize = 8;

/// One number for each of eight candidates. Every operation acts on each alone, in the same order as on one number: a candidate's
/// result does not depend on its neighbours or on the instructions that the processor has.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub struct Lanes(pub [f64; LANES]);

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

impl Neg for Lanes {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.map(|x| -x)
    }
}
