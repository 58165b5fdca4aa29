//! The generalised Prandtl-Ishlinskii operator: an envelope function on each side, for asymmetric loops.

use super::envelope::{Curve, Envelope, EnvelopeInverse, EnvelopeState, LEFT, RIGHT};
use crate::stage::{finite_or, hold};
use crate::{Build, Env, Error, Invert, Meta, Params, Pi, PiState, Real, Stage};

/// Parameters of `y = p₀ F₀(u) + Σᵢ wᵢ F_{rᵢ}(u)` with the generalised plays
/// `F_r ← max(γₗ(u) − r, min(γᵣ(u) + r, F_r))`. `L` is any list of numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct GpiParams<L> {
    /// Envelope γₗ of the rising side.
    pub left: Curve,
    /// Envelope γᵣ of the falling side. An exact inverse needs γᵣ ≥ γₗ over the range of the drive.
    pub right: Curve,
    /// Weight p₀ of the play of radius 0 \[y per unit of γ\].
    pub gain: f64,
    /// Radii rᵢ \[unit of γ\], positive and strictly rising.
    pub thresholds: L,
    /// Weights wᵢ \[y per unit of γ\].
    pub weights: L,
}

impl<L: AsMut<[f64]>> Params for GpiParams<L> {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        self.left.visit(&LEFT, f);
        self.right.visit(&RIGHT, f);
        f(&Meta { name: "gain", unit: "y", lower: 0.0, upper: f64::INFINITY }, &mut self.gain);
        for r in self.thresholds.as_mut() {
            f(&Meta { name: "thresholds", unit: "", lower: 0.0, upper: f64::INFINITY }, r);
        }
        for w in self.weights.as_mut() {
            f(&Meta { name: "weights", unit: "y", lower: 0.0, upper: f64::INFINITY }, w);
        }
    }
}

/// Generalised Prandtl-Ishlinskii operator with at most `N` plays (Al Janaideh, Rakheja and Su 2011). The
/// temperature-dependent Prandtl-Ishlinskii model uses the same envelopes.
///
/// ```
/// use hyst_core::{Build, Curve, Env, Gpi, GpiParams, Invert, Stage};
/// let gpi: Gpi<f64, 2> = GpiParams {
///     left: Curve::Linear { slope: 1.0, offset: -0.5 },
///     right: Curve::Linear { slope: 1.1, offset: 0.5 },
///     gain: 0.1,
///     thresholds: [10.0, 20.0],
///     weights: [0.02, 0.01],
/// }
/// .build(&())?;
/// let inverse = gpi.invert()?;
/// let (mut forward, mut backward, env) = (gpi.state(), inverse.state(), Env::default());
/// for reference in [0.0, 1.0, 4.0, 2.5, 3.0] {
///     let drive = inverse.step(&mut backward, &env, reference);
///     assert!((gpi.step(&mut forward, &env, drive) - reference).abs() < 1e-12);
/// }
/// # Ok::<(), hyst_core::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gpi<T, const N: usize> {
    envelope: Envelope<T>,
    pi: Pi<T, N>,
}

impl<T: Real, const N: usize> Gpi<T, N> {
    /// Creates an operator from an envelope followed by an ordinary operator.
    pub fn new(envelope: Envelope<T>, pi: Pi<T, N>) -> Self {
        Self { envelope, pi }
    }

    /// Returns the envelope.
    pub fn envelope(&self) -> &Envelope<T> {
        &self.envelope
    }
}

impl<T: Real, L: AsRef<[f64]>, const N: usize> Build<Gpi<T, N>> for GpiParams<L> {
    type Context = ();
    fn build(&self, (): &()) -> Result<Gpi<T, N>, Error> {
        let envelope = Envelope::new(self.left, self.right)?;
        // The checks of the ordinary operator, with the names of this model.
        let pi = Pi::new(self.gain, self.thresholds.as_ref(), self.weights.as_ref()).map_err(|e| match e {
            Error::NonFinite("pi.gain") => Error::NonFinite("gpi.gain"),
            Error::NonFinite("pi.thresholds") => Error::NonFinite("gpi.thresholds"),
            Error::NonFinite(_) => Error::NonFinite("gpi.weights"),
            Error::OutOfRange { must, .. } => Error::OutOfRange { name: "gpi.thresholds", must },
            Error::Lengths(_) => Error::Lengths("gpi.thresholds and gpi.weights"),
            Error::Capacity { needed, holds, .. } => Error::Capacity { name: "gpi plays", needed, holds },
            other => other,
        })?;
        Ok(Gpi { envelope, pi })
    }
}

/// History of a generalised operator: the play of radius 0 with the last input, and the other plays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GpiState<T, const N: usize> {
    envelope: EnvelopeState<T>,
    plays: [T; N],
}

/// History of the inverse of a generalised operator.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GpiInverseState<T, const N: usize> {
    envelope: EnvelopeState<T>,
    pi: PiState<T, N>,
    /// The last reference, and the nearest reference that the envelopes can reach.
    reference: T,
    reached: T,
}

impl<T: Real, const N: usize> Stage<T> for Gpi<T, N> {
    type State = GpiState<T, N>;

    fn state(&self) -> Self::State {
        GpiState { envelope: self.envelope.state(), plays: [T::ZERO; N] }
    }

    fn reset(&self, s: &mut Self::State, e: &Env<T>, u0: T) -> T {
        *s = self.state();
        self.step(s, e, finite_or(u0, T::ZERO))
    }

    #[inline]
    fn step(&self, s: &mut Self::State, e: &Env<T>, u: T) -> T {
        let g = self.envelope.step(&mut s.envelope, e, u);
        let (left, right) = self.envelope.sides(s.envelope.drive());
        self.pi.between(&mut s.plays, left, right, g)
    }
}

/// The inverse: the inverse Prandtl-Ishlinskii operator, then the inverse envelope of the active branch. It is exact
/// where γₗ ≤ γᵣ along the drive; where the envelopes cross, the operator is not an envelope followed by an ordinary
/// operator. The drive jumps across the envelope when the reference reverses ([`Envelope::jump`]). If a slew limit
/// prevents the jump, the output has an error at the reversal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GpiInverse<T, const N: usize> {
    pi: Pi<T, N>,
    envelope: EnvelopeInverse<T>,
}

impl<T: Real, const N: usize> Invert<T> for Gpi<T, N> {
    type Inverse = GpiInverse<T, N>;
    fn invert(&self) -> Result<Self::Inverse, Error> {
        Ok(GpiInverse { pi: self.pi.invert()?, envelope: self.envelope.invert()? })
    }
}

impl<T: Real, const N: usize> GpiInverse<T, N> {
    /// Returns the play G for a reference. If saturating envelopes cannot reach this G, the nearest reference that they
    /// can reach replaces it, so the plays of model and inverse stay equal. Bisection finds it in 64 steps.
    fn reached(&self, s: &mut GpiInverseState<T, N>, e: &Env<T>, y: T) -> T {
        let y = hold(&mut s.reference, y);
        let before = s.pi;
        let g = self.pi.step(&mut s.pi, e, y);
        let (low, high) = self.envelope.reach();
        if g >= low && g <= high {
            s.reached = y;
            return g;
        }
        let (mut inside, mut outside) = (s.reached, y);
        for _ in 0..64 {
            let middle = inside + (outside - inside) * T::from_f64(0.5);
            let g = self.pi.step(&mut before.clone(), e, middle);
            if g >= low && g <= high { inside = middle } else { outside = middle }
        }
        s.pi = before;
        s.reached = inside;
        self.pi.step(&mut s.pi, e, inside)
    }
}

impl<T: Real, const N: usize> Stage<T> for GpiInverse<T, N> {
    type State = GpiInverseState<T, N>;

    fn state(&self) -> Self::State {
        GpiInverseState { envelope: self.envelope.state(), pi: self.pi.state(), reference: T::ZERO, reached: T::ZERO }
    }

    fn reset(&self, s: &mut Self::State, e: &Env<T>, u0: T) -> T {
        self.pi.reset(&mut s.pi, e, T::ZERO);
        s.reference = T::ZERO;
        let g = self.reached(s, e, finite_or(u0, T::ZERO));
        self.envelope.reset(&mut s.envelope, e, g)
    }

    #[inline]
    fn step(&self, s: &mut Self::State, e: &Env<T>, u: T) -> T {
        let g = self.reached(s, e, u);
        self.envelope.step(&mut s.envelope, e, g)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn inverse_reaches_every_reference(
            gap in 0.0..4.0f64,
            slopes in (0.3..2.0f64, 0.3..2.0f64),
            gain in 0.02..2.0f64,
            steps in prop::collection::vec((0.1..5.0f64, 0.0..1.0f64), 8),
            references in prop::collection::vec(-30.0..30.0f64, 50..200),
        ) {
            let mut at = 0.0;
            let mut thresholds = [0.0; 8];
            let mut weights = [0.0; 8];
            for ((r, w), (d, x)) in thresholds.iter_mut().zip(&mut weights).zip(&steps) {
                at += d;
                (*r, *w) = (at, *x);
            }
            let params = GpiParams {
                left: Curve::Linear { slope: slopes.0, offset: -gap },
                // Above the left side over the range of the references (50 u, at the smaller slope).
                right: Curve::Linear { slope: slopes.1, offset: gap + 60.0 / 0.02 * (slopes.1 - slopes.0).abs() },
                gain, thresholds, weights,
            };
            let gpi: Gpi<f64, 8> = params.build(&()).unwrap();
            let inverse = gpi.invert().unwrap();
            let e = Env::default();
            let (mut a, mut b) = (gpi.state(), inverse.state());
            for y in &references {
                let drive = inverse.step(&mut b, &e, *y);
                prop_assert!((gpi.step(&mut a, &e, drive) - y).abs() < 60.0 * 1e-12);
            }
        }
    }

    /// Saturating sides: reachable references are reached. One that is not reachable has no effect on later samples.
    #[test]
    fn saturating_envelopes_do_not_wind_up() {
        let side = |offset| Curve::Tanh { height: 90.0, rate: 0.01, shift: 0.0, offset };
        let params = GpiParams {
            left: side(-1.0),
            right: side(1.0),
            gain: 0.15,
            thresholds: [5.0, 15.0, 30.0],
            weights: [0.04, 0.03, 0.02],
        };
        let gpi: Gpi<f64, 3> = params.build(&()).unwrap();
        let inverse = gpi.invert().unwrap();
        let (mut a, mut b, e) = (gpi.state(), inverse.state(), Env::default());
        gpi.reset(&mut a, &e, inverse.reset(&mut b, &e, 0.0));
        let most = gpi.clone().step(&mut gpi.state(), &e, 1e6);
        for k in 0..3000 {
            // From k = 1000 to 1100 the reference is beyond the maximum.
            let y = if (1000..1100).contains(&k) { 2.0 * most } else { 0.7 * most * libm::sin(0.03 * f64::from(k)) };
            let reached = gpi.step(&mut a, &e, inverse.step(&mut b, &e, y));
            let expected = y.at_most(most);
            assert!((reached - expected).abs() < 1e-9 * most, "{k}: {reached}, expected {expected}");
        }
    }

    #[test]
    fn a_reset_to_a_non_finite_input_is_a_reset_to_zero() {
        let side = |offset| Curve::Linear { slope: 1.0, offset };
        let params = GpiParams { left: side(3.0), right: side(5.0), gain: 0.15, thresholds: [5.0], weights: [0.04] };
        let gpi: Gpi<f64, 1> = params.build(&()).unwrap();
        let (mut s, e) = (gpi.state(), Env::default());
        assert_eq!(gpi.reset(&mut s, &e, f64::NAN), gpi.reset(&mut s, &e, 0.0));
    }

    /// With two identity envelopes the operator is the ordinary one.
    #[test]
    fn without_envelopes_it_equals_the_ordinary_operator() {
        let params = GpiParams {
            left: Curve::IDENTITY,
            right: Curve::IDENTITY,
            gain: 0.1,
            thresholds: [5.0, 12.0],
            weights: [0.02, 0.03],
        };
        let gpi: Gpi<f64, 2> = params.build(&()).unwrap();
        let pi = Pi::<f64, 2>::new(0.1, &[5.0, 12.0], &[0.02, 0.03]).unwrap();
        let (mut a, mut b, e) = (gpi.state(), pi.state(), Env::default());
        for k in 0..500 {
            let u = 40.0 * libm::sin(0.21 * f64::from(k)) * libm::sin(0.013 * f64::from(k));
            assert_eq!(gpi.step(&mut a, &e, u), pi.step(&mut b, &e, u));
        }
    }
}
