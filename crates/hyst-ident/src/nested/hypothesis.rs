//! A hypothesis: the causes that a trial adds to the rate-independent base.

use hyst_core::{CurveSide, TemperatureParams};

use super::wander::HATS;
use crate::base::DragParams;
use crate::model::{Effect, Effects, InputSide};

/// A cause that a trial may add to the base: a listed effect, or an unlisted cause.
///
/// Unlisted causes compete with the effects. They absorb disturbances that are not on the list (a jump, a step of the
/// gain, an unrecorded force, an amplifier at its limit), so that no wrong effect is named for them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Cause {
    /// An effect of the list.
    Effect(Effect),
    /// The sensor's zero wanders in time.
    ZeroWanders,
    /// The gain wanders in time.
    GainWanders,
    /// Slow states (creep, thermal expansion) are not at rest at the start of a segment.
    InitialState,
    /// The output does not follow steep slopes of the drive: the amplifier is current-limited.
    SlewLimit,
}

impl Cause {
    /// Returns the effect, if the cause is one.
    pub(crate) fn effect(self) -> Option<Effect> {
        match self {
            Self::Effect(e) => Some(e),
            Self::ZeroWanders | Self::GainWanders | Self::InitialState | Self::SlewLimit => None,
        }
    }

    /// Returns whether the cause is not on the list of effects.
    pub(crate) fn is_unlisted(self) -> bool {
        matches!(self, Self::ZeroWanders | Self::GainWanders | Self::SlewLimit)
    }
}

/// A set of causes with their parameters.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Hypothesis {
    /// Stages around the hysteresis.
    pub(crate) effects: Effects,
    /// Drag of the play operators (rate-dependence). In a model it belongs to the base.
    pub(crate) drag: Option<DragParams>,
    /// Whether the sensor's zero wanders.
    pub(crate) zero_wanders: bool,
    /// Whether the gain wanders.
    pub(crate) gain_wanders: bool,
    /// Whether slow states have their own initial values in each segment.
    pub(crate) initial_state: bool,
    /// Steepest slope that the amplifier follows \[V/s\], if it is limited.
    pub(crate) slew_limit: Option<f64>,
}

/// Relative difference of a parameter up to which two starts count as the same.
const SAME_START_TOLERANCE: f64 = 0.02;

/// A nonlinear parameter with its cause and bounds.
pub(crate) struct Unknown<'a> {
    pub(crate) cause: Cause,
    pub(crate) name: String,
    pub(crate) lower: f64,
    pub(crate) upper: f64,
    pub(crate) value: &'a mut f64,
}

impl Hypothesis {
    /// Returns a hypothesis with these effects only.
    pub(crate) fn of(effects: Effects) -> Self {
        Self { effects, ..Self::default() }
    }

    /// Returns the causes in the order of the signal chain; a second mode is listed again.
    pub(crate) fn causes(&self) -> Vec<Cause> {
        let mut list: Vec<Effect> = self.effects.names();
        if self.drag.is_some() && !list.contains(&Effect::RateDependence) {
            list.push(Effect::RateDependence);
            list.sort();
        }
        let mut causes: Vec<Cause> = list.into_iter().map(Cause::Effect).collect();
        causes.extend(self.zero_wanders.then_some(Cause::ZeroWanders));
        causes.extend(self.gain_wanders.then_some(Cause::GainWanders));
        causes.extend(self.initial_state.then_some(Cause::InitialState));
        causes.extend(self.slew_limit.map(|_| Cause::SlewLimit));
        causes
    }

    /// Returns whether there are slow states that need not be at rest at the start of a segment.
    fn is_slow(&self) -> bool {
        self.effects.creep.is_some() || self.expands_late().is_some()
    }

    /// Returns the time constant of a late thermal expansion \[s\].
    pub(super) fn expands_late(&self) -> Option<f64> {
        self.effects.temperature.filter(|p| p.expansion != 0.0 && p.seconds > 0.0).map(|p| p.seconds)
    }

    /// Returns whether the cause can be added (once more).
    pub(crate) fn has_room(&self, cause: Cause) -> bool {
        match cause {
            Cause::Effect(Effect::RateDependence) => {
                self.drag.is_none() && self.effects.has_room(Effect::RateDependence)
            }
            Cause::Effect(e) => self.effects.has_room(e),
            Cause::ZeroWanders => !self.zero_wanders,
            Cause::GainWanders => !self.gain_wanders,
            Cause::InitialState => self.is_slow() && !self.initial_state,
            Cause::SlewLimit => self.slew_limit.is_none(),
        }
    }

    /// Returns the hypothesis without `cause` (without the last one, if there are two).
    pub(crate) fn without(&self, cause: Cause) -> Self {
        let mut less = self.clone();
        match cause {
            Cause::Effect(Effect::RateDependence) => {
                less.drag = None;
                less.effects = self.effects.without(Effect::RateDependence);
            }
            Cause::Effect(e) => {
                less.effects = self.effects.without(e);
                less.initial_state &= less.is_slow();
            }
            Cause::InitialState => less.initial_state = false,
            Cause::ZeroWanders => less.zero_wanders = false,
            Cause::GainWanders => less.gain_wanders = false,
            Cause::SlewLimit => less.slew_limit = None,
        }
        less
    }

    /// Returns the number of parameters of a cause. Of two causes that a record cannot separate, the one with fewer is
    /// the simpler.
    pub(crate) fn complexity(&self, cause: Cause) -> usize {
        match cause {
            // A function of time is independent of the drive and imitates any single event of a record; a creep depends
            // on the drive.
            Cause::Effect(Effect::Drift) if self.effects.drift.is_some_and(|p| p.seconds > 0.0) => {
                let has_slope = self.effects.drift.is_some_and(|p| p.per_second != 0.0);
                Effect::Creep.complexity() + 1 + usize::from(has_slope)
            }
            Cause::Effect(Effect::Temperature) => {
                let more = |p: TemperatureParams| {
                    [p.expansion != 0.0, p.direct != 0.0, p.seconds > 0.0].into_iter().map(usize::from).sum::<usize>()
                };
                Effect::Temperature.complexity() + self.effects.temperature.map_or(0, more)
            }
            Cause::Effect(Effect::Load) => {
                let changes_the_gain = self.effects.load.is_some_and(|p| p.gain_per_newton != 0.0);
                Effect::Load.complexity() + usize::from(changes_the_gain)
            }
            Cause::Effect(Effect::RateDependence) => {
                let weights = self.effects.widening.as_ref().map_or(0, |p| p.weights.len());
                Effect::RateDependence.complexity() + weights
            }
            Cause::Effect(e) => e.complexity(),
            // No cause of its own: an actuator is seldom at rest when a record begins.
            Cause::InitialState => 0,
            Cause::ZeroWanders | Cause::GainWanders => HATS,
            Cause::SlewLimit => 1,
        }
    }

    /// Returns whether a cause changes the drive of the hysteresis or its rate-dependence.
    pub(super) fn changes_the_base(&self) -> bool {
        self.effects.input_side() != InputSide::default() || self.drag.is_some() || self.slew_limit.is_some()
    }

    /// Returns whether the hysteresis has the same drive and rate-dependence as in another hypothesis.
    pub(super) fn has_same_drive(&self, other: &Self) -> bool {
        self.drag == other.drag
            && self.slew_limit == other.slew_limit
            && self.effects.input_side() == other.effects.input_side()
            && self.effects.widening == other.effects.widening
    }

    /// Returns whether the output is nonlinear in the weights. It is then solved in rounds, each linearised around the
    /// previous one.
    pub(super) fn is_nonlinear_in_weights(&self) -> bool {
        let side = CurveSide::Output;
        self.effects.curve(side).is_some() || self.effects.limits(side).is_some() || self.gain_wanders
    }

    /// Calls `f` for every nonlinear parameter, always in the same order.
    pub(crate) fn visit_nonlinear(&mut self, f: &mut dyn FnMut(Unknown<'_>)) {
        if let Some(value) = &mut self.slew_limit {
            let (lower, upper) = (0.0, f64::INFINITY);
            f(Unknown { cause: Cause::SlewLimit, name: "volts_per_second".into(), lower, upper, value });
        }
        if let Some(drag) = &mut self.drag {
            let cause = Cause::Effect(Effect::RateDependence);
            for (name, upper, value) in
                [("seconds", 1.0, &mut drag.seconds), ("volt_seconds", f64::INFINITY, &mut drag.volt_seconds)]
            {
                f(Unknown { cause, name: name.into(), lower: 0.0, upper, value });
            }
        }
        self.effects.visit_nonlinear(&mut |p| {
            f(Unknown { cause: Cause::Effect(p.effect), name: p.name, lower: p.lower, upper: p.upper, value: p.value });
        });
    }

    /// Returns whether both have the same parameters with nearly the same values.
    pub(crate) fn is_near(&self, other: &Self) -> bool {
        let (own, others) = (self.nonlinear(), other.nonlinear());
        let near = |a: f64, b: f64| (a - b).abs() <= SAME_START_TOLERANCE * a.abs().max(b.abs());
        self.causes() == other.causes()
            && own.len() == others.len()
            && own.iter().zip(&others).all(|((a, _), (b, _))| near(*a, *b))
    }

    /// Returns the values and bounds of the nonlinear parameters.
    pub(super) fn nonlinear(&self) -> Vec<(f64, crate::lsq::Bounds)> {
        let mut values = Vec::new();
        self.clone()
            .visit_nonlinear(&mut |p| values.push((*p.value, crate::lsq::Bounds { lower: p.lower, upper: p.upper })));
        values
    }
}
