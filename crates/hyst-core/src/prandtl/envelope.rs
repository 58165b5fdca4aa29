//! The generalised play of radius 0: what envelope functions do to the input of a Prandtl-Ishlinskii operator.
//!
//! A generalised play has its own curve on each side, `F_r ← max(γₗ(u) − r, min(γᵣ(u) + r, F_r))` (Visintin 1994; Al Janaideh,
//! Rakheja and Su 2011). Where γₗ ≤ γᵣ all of them share one memory: `F_r = play_r(G)` with `G ← max(γₗ(u), min(γᵣ(u), G))`. There a
//! generalised Prandtl-Ishlinskii operator is an ordinary one behind `G`, and its inverse is the ordinary inverse before `G⁻¹`.

use crate::error::{finite, within};
use crate::{Env, Error, Invert, Real, Stage};

/// A rising envelope function γ.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "kebab-case"))]
pub enum Curve {
    /// `γ(u) = slope u + offset`.
    Linear {
        /// Slope, positive.
        slope: f64,
        /// Offset.
        offset: f64,
    },
    /// `γ(u) = height tanh(rate u + shift) + offset`: saturates.
    Tanh {
        /// Height, positive.
        height: f64,
        /// Rate \[1/u\], positive.
        rate: f64,
        /// Shift.
        shift: f64,
        /// Offset.
        offset: f64,
    },
}

impl Curve {
    /// `γ(u) = u`.
    pub const IDENTITY: Self = Self::Linear { slope: 1.0, offset: 0.0 };

    fn checked<T: Real>(self, name: &'static str) -> Result<Shape<T>, Error> {
        const MUST: &str = "positive: an envelope rises";
        Ok(match self {
            Self::Linear { slope, offset } => Shape::Linear {
                slope: T::from_f64(within(name, slope, slope > 0.0, MUST)?),
                offset: T::from_f64(finite(name, offset)?),
            },
            Self::Tanh { height, rate, shift, offset } => Shape::Tanh {
                height: T::from_f64(within(name, height, height > 0.0, MUST)?),
                rate: T::from_f64(within(name, rate, rate > 0.0, MUST)?),
                shift: T::from_f64(finite(name, shift)?),
                offset: T::from_f64(finite(name, offset)?),
            },
        })
    }
}

/// A curve in the precision of the signal path.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Shape<T> {
    Linear { slope: T, offset: T },
    Tanh { height: T, rate: T, shift: T, offset: T },
}

impl<T: Real> Shape<T> {
    #[inline]
    fn value(&self, u: T) -> T {
        match *self {
            Self::Linear { slope, offset } => slope * u + offset,
            Self::Tanh { height, rate, shift, offset } => height * (rate * u + shift).tanh() + offset,
        }
    }

    /// The input with γ(u) = x. Beyond what a saturating curve reaches: the input at which it is within rounding of its end.
    #[inline]
    fn inverse(&self, x: T) -> T {
        match *self {
            Self::Linear { slope, offset } => (x - offset) / slope,
            Self::Tanh { height, rate, shift, offset } => {
                let most = T::ONE - T::EPSILON;
                let z = ((x - offset) / height).at_most(most).at_least(-most);
                // atanh z = ln(1 + 2z / (1 − z)) / 2
                let angle = ((z + z) / (T::ONE - z)).ln_1p() * T::from_f64(0.5);
                (angle - shift) / rate
            }
        }
    }
}

/// The generalised play of radius 0, `G ← max(γₗ(u), min(γᵣ(u), G))`, from `G = 0`.
///
/// γₗ is the left side, which pushes while the input rises, γᵣ the right side, which pulls while it falls. With γₗ = γᵣ it is a
/// memory-free map. Where γₗ > γᵣ the left side wins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Envelope<T> {
    left: Shape<T>,
    right: Shape<T>,
}

impl<T: Real> Envelope<T> {
    /// From the two sides.
    ///
    /// # Errors
    /// If a number is not finite, or a curve does not rise.
    pub fn new(left: Curve, right: Curve) -> Result<Self, Error> {
        Ok(Self { left: left.checked("envelope.left")?, right: right.checked("envelope.right")? })
    }

    /// The two sides at an input: γₗ(u), γᵣ(u).
    #[inline]
    pub(super) fn sides(&self, u: T) -> (T, T) {
        (self.left.value(u), self.right.value(u))
    }

    /// How far the inverse's drive jumps when the reference turns at drive `u`: from the left side to the right one
    /// \[u\]. Negative where γₗ > γᵣ.
    pub fn jump(&self, u: T) -> T {
        u - self.right.inverse(self.left.value(u))
    }
}

/// History of a generalised play or of its inverse.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EnvelopeState<T> {
    /// The play G.
    g: T,
    /// The drive: the last input of the play, the last output of the inverse \[u\].
    u: T,
}

impl<T: Real> EnvelopeState<T> {
    /// The last input of the play.
    #[inline]
    pub(super) fn drive(&self) -> T {
        self.u
    }
}

impl<T: Real> Stage<T> for Envelope<T> {
    type State = EnvelopeState<T>;

    fn state(&self) -> Self::State {
        EnvelopeState::default()
    }

    fn reset(&self, s: &mut Self::State, e: &Env<T>, u0: T) -> T {
        *s = EnvelopeState::default();
        self.step(s, e, u0)
    }

    #[inline]
    fn step(&self, s: &mut Self::State, _: &Env<T>, u: T) -> T {
        if u.is_finite() {
            s.u = u;
            s.g = s.g.at_most(self.right.value(u)).at_least(self.left.value(u));
        }
        s.g
    }
}

/// The inverse of a generalised play of radius 0: the drive on the side that the reference is moving on. While the
/// reference stands still, so does the drive; where it turns, the drive jumps across the play.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnvelopeInverse<T> {
    forward: Envelope<T>,
}

impl<T: Real> Invert<T> for Envelope<T> {
    type Inverse = EnvelopeInverse<T>;
    fn invert(&self) -> Result<Self::Inverse, Error> {
        Ok(EnvelopeInverse { forward: *self })
    }
}

impl<T: Real> Stage<T> for EnvelopeInverse<T> {
    type State = EnvelopeState<T>;

    fn state(&self) -> Self::State {
        EnvelopeState::default()
    }

    fn reset(&self, s: &mut Self::State, e: &Env<T>, u0: T) -> T {
        *s = EnvelopeState::default();
        if u0 == T::ZERO {
            // Virgin memory shows 0 for every drive between the sides: the one nearest to 0.
            let Envelope { left, right } = &self.forward;
            s.u = T::ZERO.at_most(left.inverse(u0)).at_least(right.inverse(u0));
            return s.u;
        }
        self.step(s, e, u0)
    }

    #[inline]
    fn step(&self, s: &mut Self::State, _: &Env<T>, u: T) -> T {
        let Envelope { left, right } = &self.forward;
        if u > s.g {
            s.u = left.inverse(u);
            s.g = u;
        } else if u < s.g {
            // Where γₗ > γᵣ the left side alone decides, and its drive is the smaller one.
            s.u = right.inverse(u).at_most(left.inverse(u));
            s.g = u;
        }
        s.u
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn curve() -> impl Strategy<Value = Curve> {
        prop_oneof![
            (0.05..3.0f64, -2.0..2.0f64).prop_map(|(slope, offset)| Curve::Linear { slope, offset }),
            (2.0..5.0f64, 0.01..0.08f64, -0.3..0.3f64, -0.5..0.5f64)
                .prop_map(|(height, rate, shift, offset)| Curve::Tanh { height, rate, shift, offset }),
        ]
    }

    proptest! {
        #[test]
        fn inverse_reaches_every_reference(left in curve(), right in curve(), u in prop::collection::vec(-20.0..20.0f64, 50..200)) {
            let play = Envelope::<f64>::new(left, right).unwrap();
            let inverse = play.invert().unwrap();
            let e = Env::default();
            let (mut seen, mut reached, mut i) = (play.state(), play.state(), inverse.state());
            // Also where virgin memory is pushed at drive 0.
            let reference = play.reset(&mut seen, &e, u[0]);
            let first = inverse.reset(&mut i, &e, reference);
            prop_assert!((play.reset(&mut reached, &e, first) - reference).abs() < 1e-11);
            for u in &u {
                let reference = play.step(&mut seen, &e, *u);
                let drive = inverse.step(&mut i, &e, reference);
                prop_assert!((play.step(&mut reached, &e, drive) - reference).abs() < 1e-11, "{reference}");
            }
        }

        /// The identity on which the inverse rests: F_r = play_r ∘ G.
        #[test]
        fn every_generalised_play_is_a_play_behind_the_envelope(r in 0.1..5.0f64, gap in 0.0..3.0f64, slope in 0.2..2.0f64, u in prop::collection::vec(-20.0..20.0f64, 50..200)) {
            let (left, right) = (Curve::Linear { slope, offset: -gap }, Curve::Linear { slope, offset: gap });
            let envelope = Envelope::<f64>::new(left, right).unwrap();
            let (mut s, mut p, mut f) = (envelope.state(), 0.0, 0.0f64);
            for u in &u {
                f = f64::max(slope * u - gap - r, f64::min(slope * u + gap + r, f));
                p = crate::play(p, envelope.step(&mut s, &Env::default(), *u), r);
                prop_assert!((p - f).abs() < 1e-12);
            }
        }
    }

    #[test]
    fn a_curve_that_does_not_rise_is_refused() {
        let flat = Curve::Linear { slope: 0.0, offset: 1.0 };
        assert!(matches!(
            Envelope::<f64>::new(flat, Curve::IDENTITY),
            Err(Error::OutOfRange { name: "envelope.left", .. })
        ));
    }
}
