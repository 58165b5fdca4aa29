//! The linear part of the electromechanical model: C ∥ R, the coupling ψ, a mass on a spring with a damper.
//!
//! `C v̇ = i − v/R − ψ ẏ`, `m ÿ + b ẏ + k y = ψ v` (eq. 3–7 of the paper). The current is linear between samples, so
//! there is the particular solution `x_p = g i + q i̇`. The step over one period is then
//! `x₁ = x₀ + g Δi + (Φ − I)(x₀ − x_p)`, exactly, at any period. In the scaled state (v√C, y√k, ẏ√m) the energy is
//! ½|x|². Without a current it never grows, also if ψ changes at every sample. Therefore the step is stable for every
//! period and any change of temperature.

use crate::{Complex, Real};

type Matrix = [[f64; 3]; 3];

/// Data for the exact step, all SI.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Circuit {
    pub(super) capacitance: f64,
    pub(super) resistance: f64,
    pub(super) mass: f64,
    pub(super) stiffness: f64,
    pub(super) damping: f64,
    pub(super) period: f64,
}

/// The exact step at one coupling ψ.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Step<T> {
    /// Φ − I in the scaled state.
    growth: [[T; 3]; 3],
    /// State at rest per ampere.
    rest: [T; 3],
    /// Particular solution per ampere and sample.
    ramp: [T; 3],
}

fn product(a: &Matrix, b: &Matrix) -> Matrix {
    let mut c = [[0.0; 3]; 3];
    for (row, x) in c.iter_mut().zip(a) {
        for (p, y) in x.iter().zip(b) {
            for (slot, q) in row.iter_mut().zip(y) {
                *slot += p * q;
            }
        }
    }
    c
}

/// Computes e^A − I by scaling, a Taylor series of 12 terms, and squaring: `(I + E)² − I = 2E + E²`.
fn growth(a: &Matrix) -> Matrix {
    let norm = a.iter().map(|row| row.iter().fold(0.0, |s, x| s + x.abs())).fold(0.0, f64::max);
    let (mut halvings, mut scale) = (0, 1.0);
    while norm * scale > 0.25 && halvings < 200 {
        scale *= 0.5;
        halvings += 1;
    }
    let mut small = *a;
    for x in small.iter_mut().flatten() {
        *x *= scale;
    }
    let (mut e, mut term) = (small, small);
    for n in 2..=12 {
        term = product(&term, &small);
        for (x, sum) in term.iter_mut().flatten().zip(e.iter_mut().flatten()) {
            *x /= f64::from(n);
            *sum += *x;
        }
    }
    for _ in 0..halvings {
        let square = product(&e, &e);
        for (x, q) in e.iter_mut().flatten().zip(square.iter().flatten()) {
            *x = 2.0 * *x + *q;
        }
    }
    e
}

impl Circuit {
    /// Returns the displacement per ampere at rest and coupling ψ \[m/A\].
    pub(super) fn gain(&self, psi: f64) -> f64 {
        psi * self.resistance / self.stiffness
    }

    /// Computes the exact step at coupling ψ \[N/V = A s/m\].
    pub(super) fn step<T: Real>(&self, psi: f64) -> Step<T> {
        let Self { capacitance: c, resistance: r, mass: m, stiffness: k, damping: b, period: h } = *self;
        let coupling = psi / libm::sqrt(m * c);
        let omega = libm::sqrt(k / m);
        let a = [[-h / (r * c), 0.0, -h * coupling], [0.0, 0.0, h * omega], [h * coupling, -h * omega, -h * b / m]];
        let scale = [libm::sqrt(c), libm::sqrt(k), libm::sqrt(m)];
        let velocity = psi * r / k;
        let voltage = -r * (r * c + psi * velocity);
        let rest = [r, psi * r / k, 0.0];
        let ramp = [voltage / h, (psi * voltage - b * velocity) / (k * h), velocity / h];
        let scaled = |x: [f64; 3]| {
            let mut out = [T::ZERO; 3];
            for ((o, x), s) in out.iter_mut().zip(x).zip(scale) {
                *o = T::from_f64(x * s);
            }
            out
        };
        Step { growth: growth(&a).map(|row| row.map(T::from_f64)), rest: scaled(rest), ramp: scaled(ramp) }
    }

    /// Returns the displacement per unit of the scaled state \[m\].
    pub(super) fn displacement<T: Real>(&self) -> T {
        T::from_f64(1.0 / libm::sqrt(self.stiffness))
    }

    /// Computes the response of the sampled circuit from current to displacement at `z⁻¹`, divided by its gain at rest.
    pub(super) fn response(&self, psi: f64, z1: Complex) -> Complex {
        let Step { growth, rest, ramp } = self.step::<f64>(psi);
        let rise = Complex::from(1.0) - z1;
        // (I (1 − z⁻¹) − E z⁻¹) X = g (1 − z⁻¹) − E (g z⁻¹ + q (1 − z⁻¹))
        let mut rows = [[Complex::default(); 4]; 3];
        for (i, (row, e)) in rows.iter_mut().zip(growth).enumerate() {
            let mut right = Complex::default();
            for (j, e) in e.iter().enumerate() {
                let diagonal = if i == j { rise } else { Complex::default() };
                if let Some(slot) = row.get_mut(j) {
                    *slot = diagonal - z1 * *e;
                }
                let (g, q) = (rest.get(j).copied().unwrap_or(0.0), ramp.get(j).copied().unwrap_or(0.0));
                right = right - (z1 * g + rise * q) * *e;
            }
            let g = rest.get(i).copied().unwrap_or(0.0);
            row[3] = right + rise * g;
        }
        let det = |columns: [usize; 3]| {
            let at = |r: usize, c: usize| {
                let column = columns.get(c).copied().unwrap_or(0);
                rows.get(r).and_then(|row| row.get(column)).copied().unwrap_or_default()
            };
            at(0, 0) * (at(1, 1) * at(2, 2) - at(1, 2) * at(2, 1))
                - at(0, 1) * (at(1, 0) * at(2, 2) - at(1, 2) * at(2, 0))
                + at(0, 2) * (at(1, 0) * at(2, 1) - at(1, 1) * at(2, 0))
        };
        det([0, 3, 2]) / det([0, 1, 2]) * (1.0 / rest[1])
    }
}

impl<T: Real> Step<T> {
    /// Returns the state at rest at current `i`.
    pub(super) fn rest(&self, i: T) -> [T; 3] {
        self.rest.map(|g| g * i)
    }

    /// Returns the state one period later, if the current changes from `from` to `to`.
    #[inline]
    pub(super) fn advance(&self, x: &[T; 3], from: T, to: T) -> [T; 3] {
        let change = to - from;
        let mut deviation = *x;
        for ((d, g), q) in deviation.iter_mut().zip(&self.rest).zip(&self.ramp) {
            *d -= *g * from + *q * change;
        }
        let mut next = *x;
        for ((n, g), row) in next.iter_mut().zip(&self.rest).zip(&self.growth) {
            let mut sum = *g * change;
            for (e, d) in row.iter().zip(&deviation) {
                sum += *e * *d;
            }
            *n += sum;
        }
        next
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::PI;

    const PSI: f64 = 7.2971e-4;

    fn circuit(period: f64) -> Circuit {
        let p = crate::TdEmParams::PRINTED;
        Circuit {
            capacitance: p.capacitance,
            resistance: p.resistance,
            mass: p.mass,
            stiffness: p.stiffness,
            damping: p.damping,
            period,
        }
    }

    /// ω = 5004 rad/s and ζ = 0.0357, from which the paper computed k and b.
    #[test]
    fn stiffness_and_damping_agree_with_the_measured_mode() {
        let (c, w, zeta) = (circuit(1.0), 5004.0, 0.0357);
        assert!((c.mass * w * w / c.stiffness - 1.0).abs() < 1e-4);
        assert!((2.0 * zeta * w * c.mass / c.damping - 1.0).abs() < 1e-3);
    }

    /// One step and a thousand steps over one period give the same state, for a current that is linear over the period.
    #[test]
    fn step_is_exact() {
        let (h, fine) = (2e-3, 1000u32);
        let (whole, part) = (circuit(h).step::<f64>(PSI), circuit(h / f64::from(fine)).step::<f64>(PSI));
        let mut x = [0.3, -0.2, 0.5];
        let mut one = x;
        let currents = [0.0, 2.0, -1.0, 5.0];
        for pair in currents.windows(2) {
            let (a, b) = (pair[0], pair[1]);
            one = whole.advance(&one, a, b);
            for k in 0..fine {
                let at = |k: u32| a + (b - a) * f64::from(k) / f64::from(fine);
                x = part.advance(&x, at(k), at(k + 1));
            }
            for (p, q) in x.iter().zip(one) {
                assert!((p - q).abs() < 1e-11, "{x:?} {one:?}");
            }
        }
    }

    /// The sampled response equals G(s) of eq. 8 far below half the sample rate.
    #[test]
    fn sampled_response_equals_the_transfer_function() {
        let c = circuit(2e-5);
        for hz in [1.0, 30.0, 150.0, 500.0] {
            let w = 2.0 * PI * hz;
            // (mC s³ + (bC + m/R) s² + (kC + b/R + ψ²) s + k/R) at s = jω
            let re = c.stiffness / c.resistance - (c.damping * c.capacitance + c.mass / c.resistance) * w * w;
            let im = (c.stiffness * c.capacitance + c.damping / c.resistance + PSI * PSI) * w
                - c.mass * c.capacitance * w * w * w;
            let expected = Complex::from(c.stiffness / c.resistance) / Complex { re, im };
            let sampled = c.response(PSI, Complex::polar(1.0, -w * c.period));
            // A drive that is linear between samples has the response sinc²(f h).
            let x = PI * hz * c.period;
            let hold = (libm::sin(x) / x) * (libm::sin(x) / x);
            assert!((sampled - expected * hold).abs() < 2e-5 * expected.abs(), "{hz}: {sampled:?} {expected:?}");
        }
    }

    #[test]
    fn energy_never_grows_at_any_period_and_any_change_of_the_coupling() {
        for period in [1e-9, 1e-6, 1e-4, 1e-2, 1.0, 1e3, 1e9] {
            let c = circuit(period);
            let mut x = [1.0, -1.0, 1.0];
            for k in 0..2000 {
                let before = x.iter().map(|x| x * x).sum::<f64>();
                x = c.step::<f64>(PSI * (1.0 + f64::from(k % 7))).advance(&x, 0.0, 0.0);
                assert!(x.iter().map(|x| x * x).sum::<f64>() <= before * (1.0 + 1e-12), "{period}");
            }
        }
    }
}
