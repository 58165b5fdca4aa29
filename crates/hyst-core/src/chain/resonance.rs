//! A structural mode: `y = v + g (x − v)`, `ẍ + 2ζω ẋ + ω² x = ω² v`.
//!
//! With g = 1 the mode has the whole motion. With g < 1 the rest of the structure is stiff and follows at once, as in a
//! modal sum.

use crate::error::{finite, within};
use crate::stage::finite_or;
use crate::{Build, Complex, Env, Error, Meta, Params, Real, Sampling, Stage};

/// Parameters of a structural mode. With gain zero there is no resonance.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ResonanceParams {
    /// Undamped natural frequency ω/2π \[Hz\].
    pub hz: f64,
    /// Damping ratio ζ, 0 ≤ ζ < 1.
    pub damping: f64,
    /// Share g of the mode in the static output.
    pub gain: f64,
}

impl Params for ResonanceParams {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        f(&Meta { name: "hz", unit: "Hz", lower: 0.0, upper: f64::INFINITY }, &mut self.hz);
        f(&Meta { name: "damping", unit: "", lower: 1e-4, upper: 0.5 }, &mut self.damping);
        f(&Meta { name: "gain", unit: "", lower: 0.0, upper: 1.2 }, &mut self.gain);
    }
}

/// Coefficients of a mode at one sample period. They are the exact solution for an input that is linear between
/// samples, so the discretisation does not change the damping.
///
/// State: position x and scaled velocity w = ẋ/ω. With σ = Δv/(ωh) the particular solution is `x_p = v − 2ζσ`,
/// `w_p = σ`. The transition matrix Φ rotates and damps the difference to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Resonance<T> {
    phi: [[T; 2]; 2],
    /// 1/(ωh)
    slope: T,
    /// 2ζ
    twice_damping: T,
    gain: T,
    hz: f64,
    /// Frequency of the antiresonance divided by that of the mode; infinite for g ≥ 1.
    antiresonance: f64,
}

impl<T: Real> Build<Resonance<T>> for ResonanceParams {
    type Context = Sampling;
    fn build(&self, cx: &Sampling) -> Result<Resonance<T>, Error> {
        let h = cx.checked()?;
        within("resonance.hz", self.hz, self.hz > 0.0, "positive")?;
        let zeta = within("resonance.damping", self.damping, (0.0..1.0).contains(&self.damping), "from 0 to below 1")?;
        finite("resonance.gain", self.gain)?;
        let angle = 2.0 * core::f64::consts::PI * self.hz * h;
        let root = libm::sqrt(1.0 - zeta * zeta);
        let decay = libm::exp(-zeta * angle);
        let (sin, cos) = libm::sincos(root * angle);
        let phi = [
            [decay * (cos + zeta / root * sin), decay * sin / root],
            [-decay * sin / root, decay * (cos - zeta / root * sin)],
        ];
        Ok(Resonance {
            phi: phi.map(|row| row.map(T::from_f64)),
            slope: T::from_f64(1.0 / angle),
            twice_damping: T::from_f64(2.0 * zeta),
            gain: T::from_f64(self.gain),
            hz: self.hz,
            antiresonance: if self.gain < 1.0 { 1.0 / libm::sqrt(1.0 - self.gain) } else { f64::INFINITY },
        })
    }
}

/// History of a mode: last input, position, velocity over ω.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ResonanceState<T> {
    v: T,
    x: T,
    w: T,
}

impl<T: Real> Stage<T> for Resonance<T> {
    type State = ResonanceState<T>;

    fn state(&self) -> Self::State {
        ResonanceState::default()
    }

    #[inline]
    fn reset(&self, s: &mut Self::State, _: &Env<T>, u0: T) -> T {
        let u0 = finite_or(u0, T::ZERO);
        *s = ResonanceState { v: u0, x: u0, w: T::ZERO };
        u0
    }

    #[inline]
    fn step(&self, s: &mut Self::State, _: &Env<T>, u: T) -> T {
        let u = finite_or(u, s.v);
        let slope = (u - s.v) * self.slope;
        let bend = self.twice_damping * slope;
        let (dx, dw) = (s.x - s.v + bend, s.w - slope);
        s.x = u - bend + (self.phi[0][0] * dx + self.phi[0][1] * dw);
        s.w = slope + (self.phi[1][0] * dx + self.phi[1][1] * dw);
        s.v = u;
        u + self.gain * (s.x - u)
    }
}

impl<T: Real> Resonance<T> {
    /// Returns the maximum useful band of an inversion \[Hz\]: 2.5 times the frequency of the mode, where the inverse
    /// amplifies by 5, but at most 0.4 times the antiresonance f/√(1 − g). The filter falls to zero at twice its band,
    /// and the inverse rings at the antiresonance.
    pub(crate) fn highest_band(&self) -> f64 {
        self.hz * (0.4 * self.antiresonance).at_most(2.5)
    }

    /// Returns the response of the sampled stage at `z⁻¹`.
    pub fn response(&self, z1: Complex) -> Complex {
        let phi = self.phi.map(|row| row.map(T::to_f64));
        let (slope, twice) = (self.slope.to_f64(), self.twice_damping.to_f64());
        // Input 1, last input z1. X = A + φ₀₀ z1 X + φ₀₁ z1 W, W = B + φ₁₀ z1 X + φ₁₁ z1 W.
        let rise = (Complex::from(1.0) - z1) * slope;
        let bend = rise * twice;
        let (dx, dw) = (bend - z1, Complex::default() - rise);
        let a = Complex::from(1.0) - bend + dx * phi[0][0] + dw * phi[0][1];
        let b = rise + dx * phi[1][0] + dw * phi[1][1];
        let (p, q) = (Complex::from(1.0) - z1 * phi[0][0], Complex::from(1.0) - z1 * phi[1][1]);
        let cross = z1 * z1 * (phi[0][1] * phi[1][0]);
        let x = (a * q + z1 * b * phi[0][1]) / (p * q - cross);
        let gain = self.gain.to_f64();
        x * gain + (1.0 - gain)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mode(h: f64) -> Resonance<f64> {
        ResonanceParams { hz: 90.0, damping: 0.03, gain: 1.0 }.build(&Sampling { period: h }).unwrap()
    }

    /// Response to a ramp u = t from rest (closed form), at two sample periods.
    #[test]
    fn a_ramp_response_is_exact_at_any_sample_period() {
        let (w, z) = (2.0 * core::f64::consts::PI * 90.0, 0.03);
        let wd = w * libm::sqrt(1.0 - z * z);
        for h in [1e-4, 2.7e-3] {
            let (m, e) = (mode(h), Env::default());
            let mut s = m.state();
            m.reset(&mut s, &e, 0.0);
            for k in 1..300 {
                let t = h * f64::from(k);
                let y = m.step(&mut s, &e, t);
                let decay = libm::exp(-z * w * t);
                let expected = t - 2.0 * z / w
                    + decay * (2.0 * z / w * libm::cos(wd * t) + (2.0 * z * z - 1.0) / wd * libm::sin(wd * t));
                assert!((y - expected).abs() < 1e-11, "{h} {k} {y} {expected}");
            }
        }
    }

    #[test]
    fn the_simulated_response_is_the_stated_one() {
        let (h, hz) = (1e-3, 60.0);
        let m: Resonance<f64> =
            ResonanceParams { hz: 90.0, damping: 0.05, gain: 0.8 }.build(&Sampling { period: h }).unwrap();
        let (mut s, e) = (m.state(), Env::default());
        let (mut re, mut im) = (0.0, 0.0);
        for k in 0..2_000 {
            let phase = 2.0 * core::f64::consts::PI * hz * h * f64::from(k);
            let y = m.step(&mut s, &e, libm::sin(phase));
            if k >= 1_000 {
                re += 2.0 * y * libm::sin(phase) / 1000.0;
                im += 2.0 * y * libm::cos(phase) / 1000.0;
            }
        }
        let stated = m.response(Complex::polar(1.0, -2.0 * core::f64::consts::PI * hz * h));
        assert!((stated - Complex { re, im }).abs() < 1e-6, "{stated:?} {re} {im}");
    }
}
