//! The temperature-dependent electromechanical model (TD-EM) and its band-limited inverse.
//!
//! Paper: "On hysteresis modeling of a piezoelectric precise positioning system under variable temperature", eq. 1–8.

use super::circuit::{Circuit, Step};
use super::slip::{MaxwellSlip, MaxwellSlipParams, SlipReading};
use crate::error::{finite, within};
use crate::stage::{hold, rest};
use crate::{
    Build, Delay, DelayParams, DelayState, Env, Error, GpiInverse, GpiInverseState, GpiState, Invert, Meta, Params,
    Preview, PreviewState, Real, Sampling, Stage,
};

/// Parameters of the model. A Maxwell-slip bank gives the *current* `i = H(u)` (eq. 2), which charges `C ∥ R`. The
/// voltage across it drives a mass on a spring through the coupling `ψ(T) = ψ₂ T² + ψ₁ T + ψ₀` (eq. 1, 3–7).
///
/// At rest `y = ψ(T) R H(u) / k`: only the products ψ R gᵢ and the widths dᵢ can be identified from displacement.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct TdEmParams<L> {
    /// Bank from voltage \[u\] to current \[A\].
    pub slip: MaxwellSlipParams<L>,
    /// Capacitance C \[F\].
    pub capacitance: f64,
    /// Resistance R \[Ω\].
    pub resistance: f64,
    /// Mass m \[kg\].
    pub mass: f64,
    /// Stiffness k \[N/m\].
    pub stiffness: f64,
    /// Damping b \[N s/m\].
    pub damping: f64,
    /// Coupling: ψ₀, ψ₁, ψ₂ of ψ(T) \[N/V with T in °C\].
    pub coupling: [f64; 3],
    /// Output units per metre: 1e6 for µm.
    pub per_metre: f64,
}

impl TdEmParams<[f64; 10]> {
    /// The published parameters of a piezoelectric tube (input V, output µm).
    pub const PRINTED: Self = Self {
        slip: MaxwellSlipParams {
            reading: SlipReading::Backlash,
            widths: [7.9475, 15.8950, 23.8425, 31.7900, 39.7375, 47.6850, 55.6325, 63.5800, 71.5275, 79.4749],
            gains: [0.3346, 0.0798, 0.0042, 0.00632, 0.0354, 0.0256, 0.0245, 0.0387, 0.0622, 0.0346],
        },
        capacitance: 48.65e-6,
        resistance: 21.6879,
        mass: 0.0026442,
        stiffness: 6.62107e4,
        damping: 0.9453015,
        coupling: [8.83e-4, -1.466e-5, 3.477e-7],
        per_metre: 1e6,
    };
}

impl<L: AsMut<[f64]>> Params for TdEmParams<L> {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        const INF: f64 = f64::INFINITY;
        for d in self.slip.widths.as_mut() {
            f(&Meta { name: "slip.widths", unit: "u", lower: 0.0, upper: INF }, d);
        }
        for g in self.slip.gains.as_mut() {
            f(&Meta { name: "slip.gains", unit: "A/u", lower: 0.0, upper: INF }, g);
        }
        let mut one = |name, unit, lower, x: &mut f64| f(&Meta { name, unit, lower, upper: INF }, x);
        one("capacitance", "F", 0.0, &mut self.capacitance);
        one("resistance", "Ohm", 0.0, &mut self.resistance);
        one("mass", "kg", 0.0, &mut self.mass);
        one("stiffness", "N/m", 0.0, &mut self.stiffness);
        one("damping", "N s/m", 0.0, &mut self.damping);
        for (x, unit) in self.coupling.iter_mut().zip(["N/V", "N/(V K)", "N/(V K^2)"]) {
            one("coupling", unit, -INF, x);
        }
    }
}

/// The model at one sample period, with at most `N` slip elements. The linear part is solved exactly for a current that
/// is linear between samples. It is stable at any sample period and for any change of temperature.
///
/// When the temperature changes, the exact step is computed again (a 3×3 matrix exponential in `f64`). Temperatures are
/// limited to the range from −273 to 1000 °C. A non-finite temperature is replaced by the last finite one.
///
/// ```
/// use hyst_core::{Build, Env, Sampling, Stage, TdEm, TdEmParams};
/// let tube: TdEm<f64, 10> = TdEmParams::PRINTED.build(&Sampling { period: 2e-4 })?;
/// let (mut s, env) = (tube.state(), Env { temperature: 23.0, ..Env::default() });
/// let y = tube.reset(&mut s, &env, 200.0); // µm at rest at 200 V
/// assert!((y - 28.7).abs() < 0.1);
/// # Ok::<(), hyst_core::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TdEm<T, const N: usize> {
    slip: MaxwellSlip<T, N>,
    circuit: Circuit,
    coupling: [f64; 3],
    /// Output per scaled displacement.
    output: T,
    per_metre: f64,
}

impl<T: Real, L: AsRef<[f64]>, const N: usize> Build<TdEm<T, N>> for TdEmParams<L> {
    type Context = Sampling;
    fn build(&self, cx: &Sampling) -> Result<TdEm<T, N>, Error> {
        let positive = |name, x: f64| within(name, x, x > 0.0, "positive");
        let circuit = Circuit {
            capacitance: positive("td-em.capacitance", self.capacitance)?,
            resistance: positive("td-em.resistance", self.resistance)?,
            mass: positive("td-em.mass", self.mass)?,
            stiffness: positive("td-em.stiffness", self.stiffness)?,
            damping: within("td-em.damping", self.damping, self.damping >= 0.0, "zero or positive")?,
            period: cx.checked()?,
        };
        for c in self.coupling {
            finite("td-em.coupling", c)?;
        }
        let per_metre = positive("td-em.per_metre", self.per_metre)?;
        // The checks of the bank, with the names of this model.
        let slip = self.slip.build(&()).map_err(|e| match e {
            Error::NonFinite("maxwell-slip.widths") => Error::NonFinite("td-em.slip.widths"),
            Error::NonFinite(_) => Error::NonFinite("td-em.slip.gains"),
            Error::OutOfRange { must, .. } => Error::OutOfRange { name: "td-em.slip.widths", must },
            Error::Lengths(_) => Error::Lengths("td-em.slip.widths and td-em.slip.gains"),
            Error::Capacity { needed, holds, .. } => Error::Capacity { name: "td-em.slip elements", needed, holds },
            other => other,
        })?;
        Ok(TdEm {
            slip,
            coupling: self.coupling,
            output: circuit.displacement::<T>() * T::from_f64(per_metre),
            circuit,
            per_metre,
        })
    }
}

/// History of the model, and the exact step at the last temperature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TdEmState<T, const N: usize> {
    slip: GpiState<T, N>,
    x: [T; 3],
    current: T,
    degc: T,
    step: Step<T>,
}

/// Temperature range of the model \[°C\]. A temperature outside it is a fault of the sensor.
const MIN_DEGC: f64 = -273.0;
const MAX_DEGC: f64 = 1000.0;

/// Returns the last finite temperature, limited to the range of the model.
#[inline]
fn temperature<T: Real>(held: &mut T, e: &Env<T>) -> T {
    let degc = hold(held, e.temperature);
    *held = degc.at_least(T::from_f64(MIN_DEGC)).at_most(T::from_f64(MAX_DEGC));
    *held
}

/// Temperature before the first sample \[°C\].
const ROOM_DEGC: f64 = 23.0;

impl<T: Real, const N: usize> TdEm<T, N> {
    /// Returns ψ(T) \[N/V\].
    pub fn coupling(&self, degc: f64) -> f64 {
        let [c0, c1, c2] = self.coupling;
        c0 + degc * (c1 + degc * c2)
    }

    /// Returns the output per ampere at rest \[y/A\].
    fn gain(&self, degc: f64) -> f64 {
        self.circuit.gain(self.coupling(degc)) * self.per_metre
    }

    fn at_temperature(&self, s: &mut TdEmState<T, N>, e: &Env<T>) {
        let before = s.degc;
        if temperature(&mut s.degc, e) != before {
            s.step = self.circuit.step(self.coupling(s.degc.to_f64()));
        }
    }

    /// Builds the inverse: the inverse of the linear part in a band with preview, then the exact inverse of the slip
    /// bank.
    ///
    /// The filter is designed for `degc` \[°C\]. At other temperatures the gain at rest follows ψ(T) exactly. The
    /// remaining error of the dynamics is ψ² relative to k C (1.6e-7 with the published parameters). The band is
    /// `bandwidth_hz`; by default 0.16 of the sample rate, and at most 2.5 times the frequency of the mode.
    /// [`lead`](TdEmInverse::lead) and [`error`](TdEmInverse::error) return the resulting preview and error.
    ///
    /// # Errors
    /// If the bank has no inverse or the filter does not fit in `P` taps.
    pub fn band_limited<const P: usize>(
        &self,
        degc: f64,
        bandwidth_hz: Option<f64>,
    ) -> Result<TdEmInverse<T, N, P>, Error> {
        let h = self.circuit.period;
        let mode = libm::sqrt(self.circuit.stiffness / self.circuit.mass) / (2.0 * core::f64::consts::PI);
        let band = bandwidth_hz.map_or((2.5 * mode * h).at_most(0.16), |hz| hz * h);
        let psi = self.coupling(finite("td-em temperature", degc)?);
        let gain = self.gain(degc);
        if !(gain.is_finite() && gain > 0.0) {
            return Err(Error::NotInvertible("td-em.coupling must be positive at the temperature of the filter"));
        }
        let filter: Preview<T, P> = Preview::new(band, |z1| self.circuit.response(psi, z1))?;
        let late = DelayParams { seconds: filter.lead() as f64 }.build(&Sampling { period: 1.0 })?;
        Ok(TdEmInverse { filter, late, slip: self.slip.invert()?, forward: *self })
    }
}

impl<T: Real, const N: usize> Stage<T> for TdEm<T, N> {
    type State = TdEmState<T, N>;

    fn state(&self) -> Self::State {
        TdEmState {
            slip: self.slip.state(),
            x: [T::ZERO; 3],
            current: T::ZERO,
            degc: T::from_f64(ROOM_DEGC),
            step: self.circuit.step(self.coupling(ROOM_DEGC)),
        }
    }

    fn reset(&self, s: &mut Self::State, e: &Env<T>, u0: T) -> T {
        *s = self.state();
        self.at_temperature(s, e);
        s.current = self.slip.reset(&mut s.slip, e, u0);
        s.x = s.step.rest(s.current);
        self.output * s.x[1]
    }

    #[inline]
    fn step(&self, s: &mut Self::State, e: &Env<T>, u: T) -> T {
        self.at_temperature(s, e);
        let current = self.slip.step(&mut s.slip, e, u);
        s.x = s.step.advance(&s.x, s.current, current);
        s.current = current;
        self.output * s.x[1]
    }
}

/// The inverse of a TD-EM model: takes the reference and the temperature of time k + lead, and returns the drive of
/// time k.
#[derive(Clone, Debug, PartialEq)]
pub struct TdEmInverse<T, const N: usize, const P: usize> {
    filter: Preview<T, P>,
    late: Delay<T, P>,
    slip: GpiInverse<T, N>,
    forward: TdEm<T, N>,
}

impl<T: Real, const N: usize, const P: usize> TdEmInverse<T, N, P> {
    /// Returns the number of samples of the future reference that are needed.
    pub fn lead(&self) -> usize {
        self.filter.lead()
    }

    /// Returns the largest relative error of the inverse of the linear part inside its band.
    pub fn error(&self) -> f64 {
        self.filter.error()
    }

    /// Returns the band in which the linear part is inverted \[Hz\].
    pub fn bandwidth_hz(&self) -> f64 {
        self.filter.bandwidth() / self.forward.circuit.period
    }

    /// Returns the current at which the output is `y` at rest, at a temperature.
    #[inline]
    fn current(&self, y: T, degc: T) -> T {
        y / T::from_f64(self.forward.gain(degc.to_f64()))
    }
}

/// History of the inverse of a TD-EM model.
#[derive(Clone, Debug, PartialEq)]
pub struct TdEmInverseState<T, const N: usize, const P: usize> {
    filter: PreviewState<T, P>,
    late: DelayState<T, P>,
    slip: GpiInverseState<T, N>,
    degc: T,
    reference: T,
}

impl<T: Real, const N: usize, const P: usize> Stage<T> for TdEmInverse<T, N, P> {
    type State = TdEmInverseState<T, N, P>;

    fn state(&self) -> Self::State {
        TdEmInverseState {
            filter: self.filter.state(),
            late: self.late.state(),
            slip: self.slip.state(),
            degc: T::from_f64(ROOM_DEGC),
            reference: T::ZERO,
        }
    }

    fn reset(&self, s: &mut Self::State, e: &Env<T>, u0: T) -> T {
        *s = self.state();
        let (degc, y) = (temperature(&mut s.degc, e), rest(&mut s.reference, u0));
        self.late.reset(&mut s.late, e, degc);
        let y = self.filter.reset(&mut s.filter, e, y);
        self.slip.reset(&mut s.slip, e, self.current(y, degc))
    }

    #[inline]
    fn step(&self, s: &mut Self::State, e: &Env<T>, u: T) -> T {
        let (degc, y) = (temperature(&mut s.degc, e), hold(&mut s.reference, u));
        let y = self.filter.step(&mut s.filter, e, y);
        let then = self.late.step(&mut s.late, e, degc);
        self.slip.step(&mut s.slip, e, self.current(y, then))
    }
}

#[cfg(test)]
mod tests;
