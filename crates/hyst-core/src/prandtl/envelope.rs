//! The generalised play of radius 0: the effect of envelope functions on the input of a Prandtl-Ishlinskii operator.
//!
//! A generalised play has its own curve on each side: `F_r ← max(γₗ(u) − r, min(γᵣ(u) + r, F_r))` (Visintin 1994; Al
//! Janaideh, Rakheja and Su 2011). Where γₗ ≤ γᵣ, all of them share one memory: `F_r = play_r(G)` with
//! `G ← max(γₗ(u), min(γᵣ(u), G))`. A generalised Prandtl-Ishlinskii operator is then `G` followed by an ordinary one,
//! and its inverse is the ordinary inverse followed by `G⁻¹`.

use crate::error::{coefficient, within};
use crate::stage::finite_or;
use crate::{Env, Error, Invert, Meta, Real, Stage};

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
    /// `γ(u) = height tanh(rate u + shift) + offset`, which saturates.
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

    fn checked<T: Real>(self, names: &SideNames) -> Result<Shape<T>, Error> {
        let rising = |name, x: f64| coefficient(name, within(name, x, x > 0.0, "positive: an envelope rises")?);
        let any = |name, x: f64| coefficient(name, x);
        let SideNames { linear, tanh } = names;
        Ok(match self {
            Self::Linear { slope, offset } => {
                Shape::Linear { slope: rising(linear[0], slope)?, offset: any(linear[1], offset)? }
            }
            Self::Tanh { height, rate, shift, offset } => Shape::Tanh {
                height: rising(tanh[0], height)?,
                rate: rising(tanh[1], rate)?,
                shift: any(tanh[2], shift)?,
                offset: any(tanh[3], offset)?,
            },
        })
    }

    /// Visits the numbers in the order of their names. The first word of a name is the operator and not part of the
    /// path.
    pub(super) fn visit(&mut self, names: &SideNames, f: &mut dyn FnMut(&Meta, &mut f64)) {
        const INF: f64 = f64::INFINITY;
        let mut one = |name: &'static str, unit, lower, x: &mut f64| {
            f(&Meta { name: name.split_once('.').map_or(name, |(_, path)| path), unit, lower, upper: INF }, x);
        };
        let SideNames { linear, tanh } = names;
        match self {
            Self::Linear { slope, offset } => {
                one(linear[0], "1/u", 0.0, slope);
                one(linear[1], "", -INF, offset);
            }
            Self::Tanh { height, rate, shift, offset } => {
                one(tanh[0], "", 0.0, height);
                one(tanh[1], "1/u", 0.0, rate);
                one(tanh[2], "", -INF, shift);
                one(tanh[3], "", -INF, offset);
            }
        }
    }
}

/// Names of the numbers of one side: slope and offset; height, rate, shift and offset.
pub(super) struct SideNames {
    linear: [&'static str; 2],
    tanh: [&'static str; 4],
}

pub(super) const LEFT: SideNames = SideNames {
    linear: ["gpi.left.linear.slope", "gpi.left.linear.offset"],
    tanh: ["gpi.left.tanh.height", "gpi.left.tanh.rate", "gpi.left.tanh.shift", "gpi.left.tanh.offset"],
};
pub(super) const RIGHT: SideNames = SideNames {
    linear: ["gpi.right.linear.slope", "gpi.right.linear.offset"],
    tanh: ["gpi.right.tanh.height", "gpi.right.tanh.rate", "gpi.right.tanh.shift", "gpi.right.tanh.offset"],
};

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

    /// Returns minimum and maximum of γ, reduced by some rounding errors.
    fn reach(&self) -> (T, T) {
        match *self {
            Self::Linear { .. } => (T::from_f64(f64::NEG_INFINITY), T::from_f64(f64::INFINITY)),
            Self::Tanh { height, offset, .. } => {
                let most = height * (T::ONE - T::EPSILON * T::from_f64(64.0));
                (offset - most, offset + most)
            }
        }
    }

    /// Returns the input with γ(u) = x. For an x beyond the range of a saturating curve: the input at which the curve
    /// is within rounding of its limit.
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
/// The left side γₗ pushes while the input rises, the right side γᵣ pulls while it falls. With γₗ = γᵣ there is no
/// memory. Where γₗ > γᵣ, the left side decides.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Envelope<T> {
    left: Shape<T>,
    right: Shape<T>,
}

impl<T: Real> Envelope<T> {
    /// Creates the envelope from its two sides.
    ///
    /// # Errors
    /// If a number is not finite, or a curve does not rise. The name in the error is that of the generalised operator.
    pub fn new(left: Curve, right: Curve) -> Result<Self, Error> {
        Ok(Self { left: left.checked(&LEFT)?, right: right.checked(&RIGHT)? })
    }

    /// Returns the two sides at an input: γₗ(u), γᵣ(u).
    #[inline]
    pub(super) fn sides(&self, u: T) -> (T, T) {
        (self.left.value(u), self.right.value(u))
    }

    /// Returns minimum and maximum of the play G over all inputs, reduced by some rounding errors; infinite for lines.
    pub(super) fn reach(&self) -> (T, T) {
        (self.right.reach().0, self.left.reach().1)
    }

    /// Returns the jump of the drive of the inverse when the reference reverses at drive `u`, from the left side to the
    /// right one \[u\]. Negative where γₗ > γᵣ.
    pub fn jump(&self, u: T) -> T {
        u - self.right.inverse(self.left.value(u))
    }
}

/// History of a generalised play or of its inverse.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EnvelopeState<T> {
    /// The play G.
    g: T,
    /// The drive: last input of the play, or last output of the inverse \[u\].
    u: T,
}

impl<T: Real> EnvelopeState<T> {
    /// Returns the last input of the play.
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
        self.step(s, e, finite_or(u0, T::ZERO))
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

/// The inverse of a generalised play of radius 0: the drive on the side on which the reference moves. While the
/// reference is constant, the drive is constant. When the reference reverses, the drive jumps across the play.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnvelopeInverse<T> {
    forward: Envelope<T>,
}

impl<T: Real> EnvelopeInverse<T> {
    /// Returns minimum and maximum of G over all drives.
    pub(super) fn reach(&self) -> (T, T) {
        self.forward.reach()
    }
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
        let u0 = finite_or(u0, T::ZERO);
        if u0 == T::ZERO {
            // In virgin memory G is 0 for every drive between the sides. Take the drive nearest to 0.
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
            // Where γₗ > γᵣ, only the left side decides, and its drive is the smaller one.
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
            // Virgin memory may be pushed at drive 0.
            let reference = play.reset(&mut seen, &e, u[0]);
            let first = inverse.reset(&mut i, &e, reference);
            prop_assert!((play.reset(&mut reached, &e, first) - reference).abs() < 1e-11);
            for u in &u {
                let reference = play.step(&mut seen, &e, *u);
                let drive = inverse.step(&mut i, &e, reference);
                prop_assert!((play.step(&mut reached, &e, drive) - reference).abs() < 1e-11, "{reference}");
            }
        }

        /// The identity that the inverse uses: F_r = play_r ∘ G.
        #[test]
        fn every_generalised_play_is_the_envelope_followed_by_a_play(r in 0.1..5.0f64, gap in 0.0..3.0f64, slope in 0.2..2.0f64, u in prop::collection::vec(-20.0..20.0f64, 50..200)) {
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
    fn a_curve_that_does_not_rise_is_rejected() {
        let flat = Curve::Linear { slope: 0.0, offset: 1.0 };
        let rejected = |left, right| match Envelope::<f64>::new(left, right) {
            Err(Error::OutOfRange { name, .. } | Error::NonFinite(name)) => name,
            other => panic!("{other:?}"),
        };
        assert_eq!(rejected(flat, Curve::IDENTITY), "gpi.left.linear.slope");
        assert_eq!(rejected(Curve::IDENTITY, flat), "gpi.right.linear.slope");
        let tanh = |rate, shift| Curve::Tanh { height: 1.0, rate, shift, offset: 0.0 };
        assert_eq!(rejected(Curve::IDENTITY, tanh(-1.0, 0.0)), "gpi.right.tanh.rate");
        assert_eq!(rejected(tanh(1.0, f64::NAN), Curve::IDENTITY), "gpi.left.tanh.shift");
    }
}
