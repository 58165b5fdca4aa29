//! Complex arithmetic for the frequency responses of sampled stages.

use core::ops::{Add, Div, Mul, Sub};

/// A complex number in the frequency domain. It is `f64`, because it is used only when coefficients are built.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Complex {
    /// Real part.
    pub re: f64,
    /// Imaginary part.
    pub im: f64,
}

impl Complex {
    /// Returns `r e^(jφ)`, φ in rad.
    pub fn polar(r: f64, phase: f64) -> Self {
        Self { re: r * libm::cos(phase), im: r * libm::sin(phase) }
    }
    /// Returns the magnitude.
    pub fn abs(self) -> f64 {
        libm::hypot(self.re, self.im)
    }
    /// Returns the phase in (−π, π] \[rad\].
    pub fn arg(self) -> f64 {
        libm::atan2(self.im, self.re)
    }
    /// Returns the principal value of `selfᵖ`. For zero: 0, and 1 for p = 0.
    pub fn powf(self, p: f64) -> Self {
        Self::polar(libm::pow(self.abs(), p), p * self.arg())
    }
}

impl From<f64> for Complex {
    fn from(re: f64) -> Self {
        Self { re, im: 0.0 }
    }
}

impl Add for Complex {
    type Output = Self;
    fn add(self, o: Self) -> Self {
        Self { re: self.re + o.re, im: self.im + o.im }
    }
}
impl Sub for Complex {
    type Output = Self;
    fn sub(self, o: Self) -> Self {
        Self { re: self.re - o.re, im: self.im - o.im }
    }
}
impl Mul for Complex {
    type Output = Self;
    fn mul(self, o: Self) -> Self {
        Self { re: self.re * o.re - self.im * o.im, im: self.re * o.im + self.im * o.re }
    }
}
impl Div for Complex {
    type Output = Self;
    fn div(self, o: Self) -> Self {
        let d = o.re * o.re + o.im * o.im;
        Self { re: (self.re * o.re + self.im * o.im) / d, im: (self.im * o.re - self.re * o.im) / d }
    }
}
impl Add<f64> for Complex {
    type Output = Self;
    fn add(self, o: f64) -> Self {
        Self { re: self.re + o, im: self.im }
    }
}
impl Mul<f64> for Complex {
    type Output = Self;
    fn mul(self, o: f64) -> Self {
        Self { re: self.re * o, im: self.im * o }
    }
}
