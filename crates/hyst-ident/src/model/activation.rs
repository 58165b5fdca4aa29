//! The inverse of an activation-function model on the host: a sample at a time where that is stable, else backwards in time.

use hyst_core::{Activation, ActivationInverse, AntiCausal, Env, Error, Invert, Stage};

/// References that a preview of the host holds.
const REFERENCES: usize = 8192;
/// What the preview may miss, of the largest |α u̇|.
const TOLERANCE: f64 = 1e-10;

/// One of the two inverses.
#[derive(Clone, Debug)]
pub(super) enum HostActivationInverse {
    Causal(ActivationInverse<f64>),
    AntiCausal(Box<AntiCausal<f64, REFERENCES>>),
}

/// The history of one of the two.
#[derive(Clone, Debug)]
#[allow(clippy::large_enum_variant, reason = "boxed by its owner")]
pub(super) enum HostActivationState {
    Causal(<ActivationInverse<f64> as Stage<f64>>::State),
    AntiCausal(<AntiCausal<f64, REFERENCES> as Stage<f64>>::State),
}

impl HostActivationInverse {
    pub(super) fn of(model: &Activation<f64>) -> Result<Self, Error> {
        match model.invert() {
            Ok(inverse) => Ok(Self::Causal(inverse)),
            Err(why) => match model.anti_causal(TOLERANCE) {
                Ok(inverse) => Ok(Self::AntiCausal(Box::new(inverse))),
                // A preview that is too long says more than that the causal inverse is unstable.
                Err(capacity @ Error::Capacity { .. }) => Err(capacity),
                Err(_) => Err(why),
            },
        }
    }

    pub(super) fn lead(&self) -> usize {
        match self {
            Self::Causal(_) => 0,
            Self::AntiCausal(inverse) => inverse.lead(),
        }
    }
}

impl Stage<f64> for HostActivationInverse {
    type State = HostActivationState;

    fn state(&self) -> HostActivationState {
        match self {
            Self::Causal(inverse) => HostActivationState::Causal(inverse.state()),
            Self::AntiCausal(inverse) => HostActivationState::AntiCausal(inverse.state()),
        }
    }

    fn reset(&self, s: &mut HostActivationState, e: &Env<f64>, u0: f64) -> f64 {
        match (self, s) {
            (Self::Causal(inverse), HostActivationState::Causal(s)) => inverse.reset(s, e, u0),
            (Self::AntiCausal(inverse), HostActivationState::AntiCausal(s)) => inverse.reset(s, e, u0),
            // A history of the other one: begin one of this.
            (_, s) => {
                *s = self.state();
                self.reset(s, e, u0)
            }
        }
    }

    fn step(&self, s: &mut HostActivationState, e: &Env<f64>, u: f64) -> f64 {
        match (self, s) {
            (Self::Causal(inverse), HostActivationState::Causal(s)) => inverse.step(s, e, u),
            (Self::AntiCausal(inverse), HostActivationState::AntiCausal(s)) => inverse.step(s, e, u),
            (_, s) => self.reset(s, e, u),
        }
    }
}
