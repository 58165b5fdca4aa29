//! One of two stages, as a parameter chooses.

use hyst_core::{Env, Error, Invert, Stage};

/// One of two stages, or the history of one of two.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant, reason = "one per model, and boxed by its owner")]
pub(crate) enum Either<A, B> {
    First(A),
    Second(B),
}

impl<A: Stage<f64>, B: Stage<f64>> Stage<f64> for Either<A, B> {
    type State = Either<A::State, B::State>;

    fn state(&self) -> Self::State {
        match self {
            Self::First(a) => Either::First(a.state()),
            Self::Second(b) => Either::Second(b.state()),
        }
    }

    fn reset(&self, s: &mut Self::State, e: &Env<f64>, u0: f64) -> f64 {
        match (self, s) {
            (Self::First(a), Either::First(s)) => a.reset(s, e, u0),
            (Self::Second(b), Either::Second(s)) => b.reset(s, e, u0),
            // A history of the other one: begin one of this.
            (_, s) => {
                *s = self.state();
                self.reset(s, e, u0)
            }
        }
    }

    fn step(&self, s: &mut Self::State, e: &Env<f64>, u: f64) -> f64 {
        match (self, s) {
            (Self::First(a), Either::First(s)) => a.step(s, e, u),
            (Self::Second(b), Either::Second(s)) => b.step(s, e, u),
            (_, s) => self.reset(s, e, u),
        }
    }
}

impl<A: Invert<f64>, B: Invert<f64>> Invert<f64> for Either<A, B> {
    type Inverse = Either<A::Inverse, B::Inverse>;
    fn invert(&self) -> Result<Self::Inverse, Error> {
        Ok(match self {
            Self::First(a) => Either::First(a.invert()?),
            Self::Second(b) => Either::Second(b.invert()?),
        })
    }
}
