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
mod tests {
    use super::*;
    use core::f64::consts::PI;
    use proptest::prelude::*;
    use std::vec::Vec;

    const DEGC: [f64; 5] = [23.0, 29.0, 33.0, 35.0, 39.0];
    /// Measured mean slopes of the paper \[µm/V\].
    const MEASURED: [f64; 5] = [0.1509, 0.1523, 0.1606, 0.1627, 0.1735];
    /// Mean slopes of the published parameters, recomputed independently.
    const RECOMPUTED: [f64; 5] = [0.1475, 0.1558, 0.1615, 0.1645, 0.1706];

    fn at(degc: f64) -> Env<f64> {
        Env { temperature: degc, ..Env::default() }
    }

    /// Returns input and output of the second cycle of 200 sin(2π 0.1 t) V at 0.2 ms.
    fn cycle(degc: f64) -> Vec<(f64, f64)> {
        let model: TdPi<f64, 9> = TdPiParams::PRINTED.build(&()).unwrap();
        let mut s = model.state();
        model.reset(&mut s, &at(degc), 0.0);
        let drive = |k: u32| 200.0 * libm::sin(2.0 * PI * 0.1 * 2e-4 * f64::from(k));
        let mut loop_ = Vec::new();
        for k in 0..100_000 {
            let y = model.step(&mut s, &at(degc), drive(k));
            if k >= 50_000 {
                loop_.push((drive(k), y));
            }
        }
        loop_
    }

    #[test]
    fn slopes_over_temperature_agree_with_the_paper() {
        for ((degc, measured), recomputed) in DEGC.iter().zip(MEASURED).zip(RECOMPUTED) {
            let pairs = cycle(*degc);
            let n = pairs.len() as f64;
            let (mu, my) = pairs.iter().fold((0.0, 0.0), |(a, b), (u, y)| (a + u / n, b + y / n));
            let (uy, uu) =
                pairs.iter().fold((0.0, 0.0), |(a, b), (u, y)| (a + (u - mu) * (y - my), b + (u - mu) * (u - mu)));
            let slope = uy / uu;
            assert!((slope - recomputed).abs() < 6e-5, "{degc} °C: {slope}");
            assert!((slope / measured - 1.0).abs() < 0.025, "{degc} °C: {slope}, measured {measured}");
            if *degc == 23.0 {
                let top = pairs.iter().fold(0.0f64, |m, (_, y)| m.max(y.abs()));
                assert!((top - 28.5).abs() < 0.15, "{top}");
            }
        }
    }

    #[test]
    fn weights_at_r_0_follow_the_formula() {
        // The published list swaps two entries. The formula gives 0.977, 1.032, 1.070, 1.090, 1.130.
        for (degc, p0) in DEGC.iter().zip([0.977, 1.032, 1.070, 1.090, 1.130]) {
            // A rise within the first threshold moves only the r = 0 play: its slope is p₀ a₀.
            let model: TdPi<f64, 9> = TdPiParams::PRINTED.build(&()).unwrap();
            let mut s = model.state();
            model.reset(&mut s, &at(*degc), 4.0);
            let rise = model.step(&mut s, &at(*degc), 6.0);
            let mut s = model.state();
            let rise = rise - model.reset(&mut s, &at(*degc), 4.0);
            assert!((rise / (2.0 * TdPiParams::PRINTED.a0) - p0).abs() < 5e-4, "{degc}: {rise}");
        }
    }

    #[test]
    fn eq_25_without_the_envelope_on_the_identity_disagrees_with_the_measurement() {
        // The r = 0 play is close to 0.06 u here. Replace it by p₀ u.
        let top = cycle(23.0).iter().fold(0.0f64, |m, (u, y)| m.max((y + 0.977 * (u - 0.06 * u)).abs()));
        assert!((top - 212.0).abs() < 1.0, "{top}");
    }

    #[test]
    fn inverse_returns_30_micrometres_at_five_temperatures_and_over_a_ramp() {
        let model: TdPi<f64, 9> = TdPiParams::PRINTED.build(&()).unwrap();
        let inverse = model.invert().unwrap();
        let ramp = |k: u32| 23.0 + 16.0 * f64::from(k) / 20_000.0;
        let mut temperatures: Vec<std::boxed::Box<dyn Fn(u32) -> f64>> = std::vec![std::boxed::Box::new(ramp)];
        for degc in DEGC {
            temperatures.push(std::boxed::Box::new(move |_| degc));
        }
        for degc in temperatures {
            let (mut a, mut b) = (model.state(), inverse.state());
            for k in 0..20_000u32 {
                let t = 1e-3 * f64::from(k);
                let reference = 30.0 * libm::sin(2.0 * PI * 0.1 * t) * (1.0 - 0.3 * libm::sin(2.0 * PI * 1.7 * t));
                let e = at(degc(k));
                let drive = inverse.step(&mut b, &e, reference);
                let y = model.step(&mut a, &e, drive);
                assert!((y - reference).abs() < 1e-9 * 60.0, "{k}: {y} {reference}");
            }
        }
    }

    proptest! {
        /// Random models, references with reversals at every scale, and a temperature that changes at every sample.
        #[test]
        fn inverse_reaches_every_reference(
            alpha in 0.1..3.0f64,
            epsilon in 0.05..3.0f64,
            tau in 0.0..1.0f64,
            eta in -0.03..0.03f64,
            slope in 0.03..2.0f64,
            gap in 0.0..2.0f64,
            offset in -1.0..1.0f64,
            plays in 0u16..=12,
            turns in prop::collection::vec((-1.0..1.0f64, -10.0..40.0f64), 20..120),
        ) {
            let params = TdPiParams {
                alpha, epsilon, tau, eta, a0: slope, a1: offset - gap, b0: slope, b1: offset + gap, plays, reference_degc: 23.0,
            };
            let model: TdPi<f64, 12> = params.build(&()).unwrap();
            let inverse = model.invert().unwrap();
            let (mut a, mut b) = (model.state(), inverse.state());
            let span = 60.0;
            for (k, (y, degc)) in turns.iter().enumerate() {
                let e = at(*degc);
                let reference = 0.5 * span * y;
                let (drive, reached);
                if k == 0 {
                    drive = inverse.reset(&mut b, &e, reference);
                    reached = model.reset(&mut a, &e, drive);
                } else {
                    drive = inverse.step(&mut b, &e, reference);
                    reached = model.step(&mut a, &e, drive);
                }
                prop_assert!((reached - reference).abs() <= 1e-9 * span, "{k}: {reached} {reference}");
            }
        }
    }

    #[test]
    fn drive_jumps_at_reversals_as_stated() {
        let model: TdPi<f64, 9> = TdPiParams::PRINTED.build(&()).unwrap();
        let inverse = model.invert().unwrap();
        let mut s = inverse.state();
        for k in 0..=1000 {
            inverse.step(&mut s, &at(23.0), 0.02 * f64::from(k));
        }
        let drive = inverse.step(&mut s, &at(23.0), 20.0);
        let jump = drive - inverse.step(&mut s, &at(23.0), 20.0 - 1e-9);
        assert!((jump - model.at_reference().envelope().jump(drive)).abs() < 1e-6, "{jump}");
        assert!((7.2..9.7).contains(&jump));
    }

    #[test]
    fn a_non_finite_temperature_is_replaced_by_the_last_finite_one() {
        let model: TdPi<f64, 9> = TdPiParams::PRINTED.build(&()).unwrap();
        let (mut a, mut b) = (model.state(), model.state());
        model.step(&mut a, &at(35.0), 100.0);
        model.step(&mut b, &at(35.0), 100.0);
        assert_eq!(model.step(&mut a, &at(f64::NAN), 120.0), model.step(&mut b, &at(35.0), 120.0));
        assert_eq!(model.step(&mut a, &at(35.0), f64::NAN), model.step(&mut b, &at(35.0), 120.0));
    }

    #[test]
    fn bad_parameters_are_named() {
        let named = |p: TdPiParams| match Build::<TdPi<f32, 9>>::build(&p, &()) {
            Err(Error::NonFinite(name) | Error::OutOfRange { name, .. }) => name,
            other => panic!("{other:?}"),
        };
        let p = TdPiParams::PRINTED;
        assert_eq!(named(TdPiParams { a0: -1.0, ..p }), "td-pi.a0");
        assert_eq!(named(TdPiParams { b1: f64::NAN, ..p }), "td-pi.b1");
        assert_eq!(named(TdPiParams { tau: -20.0, ..p }), "td-pi.tau");
        assert_eq!(named(TdPiParams { alpha: 0.0, ..p }), "td-pi.alpha");
    }

    #[test]
    fn scaled_parameters_give_the_same_model() {
        let p = TdPiParams::PRINTED;
        let s = 3.7;
        let scaled = TdPiParams {
            alpha: p.alpha * s,
            epsilon: p.epsilon / s,
            tau: p.tau / s,
            a0: p.a0 * s,
            a1: p.a1 * s,
            b0: p.b0 * s,
            b1: p.b1 * s,
            ..p
        };
        let (a, b): (TdPi<f64, 9>, TdPi<f64, 9>) = (p.build(&()).unwrap(), scaled.build(&()).unwrap());
        let (mut x, mut y) = (a.state(), b.state());
        for k in 0..500 {
            let u = 150.0 * libm::sin(0.11 * f64::from(k));
            assert!((a.step(&mut x, &at(30.0), u) - b.step(&mut y, &at(30.0), u)).abs() < 1e-12);
        }
        assert!(matches!(
            Build::<TdPi<f64, 4>>::build(&p, &()),
            Err(Error::Capacity { name: "td-pi.plays", needed: 9, holds: 4 })
        ));
    }
}
