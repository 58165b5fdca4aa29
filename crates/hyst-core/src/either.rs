//! One of two stages, selected by a parameter.

use crate::{Env, Error, Invert, Real, Stage};

/// One of two stages, or the state of one of two.
#[derive(Clone, Debug, PartialEq)]
#[allow(clippy::large_enum_variant, reason = "there is no heap to box a variant; an owner with a heap boxes the whole")]
pub enum Either<A, B> {
    /// The first of the two.
    First(A),
    /// The second of the two.
    Second(B),
}

impl<T: Real, A: Stage<T>, B: Stage<T>> Stage<T> for Either<A, B> {
    type State = Either<A::State, B::State>;

    fn state(&self) -> Self::State {
        match self {
            Self::First(a) => Either::First(a.state()),
            Self::Second(b) => Either::Second(b.state()),
        }
    }

    fn reset(&self, s: &mut Self::State, e: &Env<T>, u0: T) -> T {
        match (self, s) {
            (Self::First(a), Either::First(s)) => a.reset(s, e, u0),
            (Self::Second(b), Either::Second(s)) => b.reset(s, e, u0),
            // The state belongs to the other stage: start a new one.
            (Self::First(a), s) => {
                let mut fresh = a.state();
                let y = a.reset(&mut fresh, e, u0);
                *s = Either::First(fresh);
                y
            }
            (Self::Second(b), s) => {
                let mut fresh = b.state();
                let y = b.reset(&mut fresh, e, u0);
                *s = Either::Second(fresh);
                y
            }
        }
    }

    fn step(&self, s: &mut Self::State, e: &Env<T>, u: T) -> T {
        match (self, s) {
            (Self::First(a), Either::First(s)) => a.step(s, e, u),
            (Self::Second(b), Either::Second(s)) => b.step(s, e, u),
            (_, s) => self.reset(s, e, u),
        }
    }
}

impl<T: Real, A: Invert<T>, B: Invert<T>> Invert<T> for Either<A, B> {
    type Inverse = Either<A::Inverse, B::Inverse>;
    fn invert(&self) -> Result<Self::Inverse, Error> {
        Ok(match self {
            Self::First(a) => Either::First(a.invert()?),
            Self::Second(b) => Either::Second(b.invert()?),
        })
    }

    fn lead(inverse: &Self::Inverse) -> usize {
        match inverse {
            Either::First(a) => A::lead(a),
            Either::Second(b) => B::lead(b),
        }
    }

    fn band(inverse: &Self::Inverse) -> Option<(f64, f64)> {
        match inverse {
            Either::First(a) => A::band(a),
            Either::Second(b) => B::band(b),
        }
    }
}
