//! The temperature-dependent Prandtl-Ishlinskii model (TD-PI) and its exact inverse.
//!
//! Paper: "On hysteresis modeling of a piezoelectric precise positioning system under variable temperature", eq. 9–25
//! (model) and 33–43 (inverse).

use super::envelope::Curve;
use super::gpi::{Gpi, GpiInverse, GpiInverseState, GpiParams, GpiState};
use crate::error::{coefficient, finite, within};
use crate::stage::{hold, rest};
use crate::{Build, Env, Error, Invert, Meta, Params, Real, Stage};

/// Parameters of the TD-PI model: thresholds `rᵢ = α i`, weights `pᵢ(T) = ε e^(η (T − T₀)) e^(−τ rᵢ)`, i = 0 … n, and
/// linear envelopes `γₗ(u) = a₀ u + a₁` and `γᵣ(u) = b₀ u + b₁`.
///
/// Scaling α, a₀, a₁, b₀ and b₁ by s, and ε and τ by 1/s, gives the same model. Only εα, ατ, a₀/α, a₁/α, b₀/α, b₁/α and
/// η can be identified.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct TdPiParams {
    /// Spacing α of the thresholds \[unit of γ\], positive.
    pub alpha: f64,
    /// Weight ε at r = 0 and T₀ \[y per unit of γ\], positive.
    pub epsilon: f64,
    /// Decay τ of the weights with the threshold \[1 per unit of γ\].
    pub tau: f64,
    /// Relative change η of all weights with temperature \[1/K\].
    pub eta: f64,
    /// Slope a₀ of the envelope of the rising side \[unit of γ per u\], positive.
    pub a0: f64,
    /// Offset a₁ of the envelope of the rising side \[unit of γ\].
    pub a1: f64,
    /// Slope b₀ of the envelope of the falling side \[unit of γ per u\], positive.
    pub b0: f64,
    /// Offset b₁ of the envelope of the falling side \[unit of γ\].
    pub b1: f64,
    /// Number n of thresholds besides r = 0.
    pub plays: u16,
    /// Temperature T₀ at which the weights are ε e^(−τ rᵢ) \[°C\].
    pub reference_degc: f64,
}

impl TdPiParams {
    /// The published parameters of a piezoelectric tube (n = 9, T₀ = 23 °C; input V, output µm).
    pub const PRINTED: Self = Self {
        alpha: 0.9975,
        epsilon: 0.9770,
        tau: 0.4167,
        eta: 0.0091,
        a0: 0.0599,
        a1: -0.1759,
        b0: 0.0606,
        b1: 0.2651,
        plays: 9,
        reference_degc: 23.0,
    };
}

impl Params for TdPiParams {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        const INF: f64 = f64::INFINITY;
        let mut one = |name, unit, lower, upper, x: &mut f64| f(&Meta { name, unit, lower, upper }, x);
        one("alpha", "", 0.0, INF, &mut self.alpha);
        one("epsilon", "y", 0.0, INF, &mut self.epsilon);
        one("tau", "", 0.0, INF, &mut self.tau);
        one("eta", "1/K", -0.05, 0.05, &mut self.eta);
        one("a0", "1/u", 0.0, INF, &mut self.a0);
        one("a1", "", -INF, INF, &mut self.a1);
        one("b0", "1/u", 0.0, INF, &mut self.b0);
        one("b1", "", -INF, INF, &mut self.b1);
    }
}

/// The TD-PI model with at most `N` thresholds besides r = 0 (eq. 25):
/// `y = e^(η (T − T₀)) Σ_{i=0}^{n} ε e^(−τ rᵢ) F_{rᵢ}(u)`, with the generalised plays of eq. 24.
///
/// The figures of the paper decide two ambiguities of its text. The envelope applies to the identity term (the r = 0
/// play) too: with `p₀ u` the published parameters give ± 212 µm instead of ± 28.5 µm. All weights, also p₀, have the
/// same temperature factor, so the model is this factor times a model at T₀.
///
/// Range: |η (T − T₀)| below 80, so the factor is finite in `f32` too. A non-finite temperature is replaced by the last
/// finite one.
///
/// ```
/// use hyst_core::{Build, Env, Invert, Stage, TdPi, TdPiParams};
/// let model: TdPi<f64, 9> = TdPiParams::PRINTED.build(&())?;
/// let inverse = model.invert()?;
/// let (mut forward, mut backward) = (model.state(), inverse.state());
/// for (k, reference) in [5.0, 20.0, 12.0, 30.0, -30.0].into_iter().enumerate() {
///     let env = Env { temperature: 23.0 + 4.0 * k as f64, ..Env::default() }; // °C, may change at every sample
///     let drive = inverse.step(&mut backward, &env, reference);
///     assert!((model.step(&mut forward, &env, drive) - reference).abs() < 1e-9);
/// }
/// # Ok::<(), hyst_core::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TdPi<T, const N: usize> {
    at_reference: Gpi<T, N>,
    factor: Factor<T>,
}

/// `e^(η (T − T₀))`.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Factor<T> {
    eta: T,
    reference: T,
}

impl<T: Real> Factor<T> {
    #[inline]
    fn at(&self, held: &mut T, e: &Env<T>) -> T {
        (self.eta * (hold(held, e.temperature) - self.reference)).exp()
    }
}

impl<T: Real, const N: usize> Build<TdPi<T, N>> for TdPiParams {
    type Context = ();
    fn build(&self, (): &()) -> Result<TdPi<T, N>, Error> {
        within("td-pi.alpha", self.alpha, self.alpha > 0.0, "positive")?;
        within("td-pi.epsilon", self.epsilon, self.epsilon > 0.0, "positive")?;
        finite("td-pi.tau", self.tau)?;
        // The checks of the envelope, with the names of this model.
        within("td-pi.a0", self.a0, self.a0 > 0.0, "positive")?;
        within("td-pi.b0", self.b0, self.b0 > 0.0, "positive")?;
        finite("td-pi.a1", self.a1)?;
        finite("td-pi.b1", self.b1)?;
        let (mut thresholds, mut weights) = ([0.0; N], [0.0; N]);
        let n = usize::from(self.plays);
        if n > N {
            return Err(Error::Capacity { name: "td-pi.plays", needed: n, holds: N });
        }
        for (i, (r, p)) in thresholds.iter_mut().zip(&mut weights).enumerate() {
            *r = self.alpha * (i as f64 + 1.0);
            *p = self.epsilon * libm::exp(-self.tau * *r);
            if i < n {
                let _: T = coefficient("td-pi.tau", *p)?;
            }
        }
        let at_reference = GpiParams {
            left: Curve::Linear { slope: self.a0, offset: self.a1 },
            right: Curve::Linear { slope: self.b0, offset: self.b1 },
            gain: self.epsilon,
            thresholds: thresholds.get(..n).unwrap_or_default(),
            weights: weights.get(..n).unwrap_or_default(),
        }
        .build(&())?;
        let factor = Factor {
            eta: coefficient("td-pi.eta", self.eta)?,
            reference: coefficient("td-pi.reference_degc", self.reference_degc)?,
        };
        Ok(TdPi { at_reference, factor })
    }
}

impl<T: Real, const N: usize> TdPi<T, N> {
    /// Returns the model at the reference temperature.
    pub fn at_reference(&self) -> &Gpi<T, N> {
        &self.at_reference
    }
}

/// History of a TD-PI model: the history of the operator at T₀, and the last temperature.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TdPiState<T, const N: usize> {
    gpi: GpiState<T, N>,
    degc: T,
}

impl<T: Real, const N: usize> Stage<T> for TdPi<T, N> {
    type State = TdPiState<T, N>;

    fn state(&self) -> Self::State {
        TdPiState { gpi: self.at_reference.state(), degc: self.factor.reference }
    }

    fn reset(&self, s: &mut Self::State, e: &Env<T>, u0: T) -> T {
        s.degc = self.factor.reference;
        let y = self.at_reference.reset(&mut s.gpi, e, u0);
        self.factor.at(&mut s.degc, e) * y
    }

    #[inline]
    fn step(&self, s: &mut Self::State, e: &Env<T>, u: T) -> T {
        let y = self.at_reference.step(&mut s.gpi, e, u);
        self.factor.at(&mut s.degc, e) * y
    }
}

/// The exact inverse of a TD-PI model: division of the reference by the temperature factor, the inverse
/// Prandtl-Ishlinskii operator at T₀, then the inverse envelope of the active branch.
///
/// Eq. 40–43 scale thresholds and weights with temperature instead. That is equal at a constant temperature, and wrong
/// while it changes. (Eq. 43 lacks a bracket: `zⱼ − zⱼ₋₁ = (p₀ + p_T Σ_{i<j} pᵢ)(rⱼ − rⱼ₋₁)`.) With the published
/// envelopes the drive jumps at each reversal, by 7.3 V near 0 V and 9.6 V at 200 V: see
/// [`Envelope::jump`](crate::Envelope::jump).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TdPiInverse<T, const N: usize> {
    at_reference: GpiInverse<T, N>,
    factor: Factor<T>,
}

impl<T: Real, const N: usize> Invert<T> for TdPi<T, N> {
    type Inverse = TdPiInverse<T, N>;
    fn invert(&self) -> Result<Self::Inverse, Error> {
        Ok(TdPiInverse { at_reference: self.at_reference.invert()?, factor: self.factor })
    }
}

/// History of the inverse: the history of the inverse at T₀, the last temperature and the last reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TdPiInverseState<T, const N: usize> {
    gpi: GpiInverseState<T, N>,
    degc: T,
    reference: T,
}

impl<T: Real, const N: usize> Stage<T> for TdPiInverse<T, N> {
    type State = TdPiInverseState<T, N>;

    fn state(&self) -> Self::State {
        TdPiInverseState { gpi: self.at_reference.state(), degc: self.factor.reference, reference: T::ZERO }
    }

    fn reset(&self, s: &mut Self::State, e: &Env<T>, u0: T) -> T {
        s.degc = self.factor.reference;
        let y = rest(&mut s.reference, u0) / self.factor.at(&mut s.degc, e);
        self.at_reference.reset(&mut s.gpi, e, y)
    }

    #[inline]
    fn step(&self, s: &mut Self::State, e: &Env<T>, u: T) -> T {
        let y = hold(&mut s.reference, u) / self.factor.at(&mut s.degc, e);
        self.at_reference.step(&mut s.gpi, e, y)
    }
}

#[cfg(test)]
mod tests;
