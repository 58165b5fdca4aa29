//! What a trial assumes besides the rate-independent base.

use hyst_core::{CurveSide, TemperatureParams};

use crate::base::DragParams;
use crate::model::{Effect, Effects, InputSide};

/// Something that a trial may add to the base: an effect that has a name, or what has none.
///
/// Those without a name compete with the effects so that what nobody put on the list (a jump, a step of the gain, a force that was not
/// recorded, an amplifier at its limit) finds its place there and draws no wrong name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Cause {
    /// An effect of the closed list.
    Effect(Effect),
    /// The zero wanders in time.
    ZeroWanders,
    /// The gain wanders in time.
    GainWanders,
    /// What is slow, a creep or the warming of the actuator, goes on from what was before each segment.
    GoesOn,
    /// The drive is not followed where it is steep: an amplifier whose current is limited.
    SlewLimit,
}

impl Cause {
    /// The effect, if it is one.
    pub(crate) fn effect(self) -> Option<Effect> {
        match self {
            Self::Effect(e) => Some(e),
            Self::ZeroWanders | Self::GainWanders | Self::GoesOn | Self::SlewLimit => None,
        }
    }

    /// Whether it stands for what is on no list.
    pub(crate) fn is_nameless(self) -> bool {
        matches!(self, Self::ZeroWanders | Self::GainWanders | Self::SlewLimit)
    }
}

/// A set of causes with their parameters.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Hypothesis {
    /// Stages around the hysteresis.
    pub(crate) effects: Effects,
    /// Drag of the plays: rate-dependence. In a model it belongs to the base.
    pub(crate) drag: Option<DragParams>,
    /// Whether the zero wanders.
    pub(crate) zero_wanders: bool,
    /// Whether the gain wanders.
    pub(crate) gain_wanders: bool,
    /// Whether what is slow goes on from before each segment.
    pub(crate) goes_on: bool,
    /// Steepest slope that the amplifier follows \[V/s\], if it has one.
    pub(crate) slew_limit: Option<f64>,
}

/// Relative difference up to which two values of a parameter lead to the same optimum.
const SAME: f64 = 0.02;

/// A parameter as it is searched, with the cause that it belongs to.
pub(crate) struct Unknown<'a> {
    pub(crate) cause: Cause,
    pub(crate) name: String,
    pub(crate) lower: f64,
    pub(crate) upper: f64,
    pub(crate) value: &'a mut f64,
}

impl Hypothesis {
    /// These effects alone.
    pub(crate) fn of(effects: Effects) -> Self {
        Self { effects, ..Self::default() }
    }

    /// Causes that are present, in the chain's order; a second mode counts once more.
    pub(crate) fn causes(&self) -> Vec<Cause> {
        let mut list: Vec<Effect> = self.effects.names();
        if self.drag.is_some() && !list.contains(&Effect::RateDependence) {
            list.push(Effect::RateDependence);
            list.sort();
        }
        let mut causes: Vec<Cause> = list.into_iter().map(Cause::Effect).collect();
        causes.extend(self.zero_wanders.then_some(Cause::ZeroWanders));
        causes.extend(self.gain_wanders.then_some(Cause::GainWanders));
        causes.extend(self.goes_on.then_some(Cause::GoesOn));
        causes.extend(self.slew_limit.map(|_| Cause::SlewLimit));
        causes
    }

    /// Whether something has states that need not be at rest when a segment begins, and that a record may show.
    fn is_slow(&self) -> bool {
        self.effects.creep.is_some() || self.expands_late().is_some()
    }

    /// Time by which an expansion comes later than the temperature \[s\].
    pub(super) fn expands_late(&self) -> Option<f64> {
        self.effects.temperature.filter(|p| p.expansion != 0.0 && p.seconds > 0.0).map(|p| p.seconds)
    }

    /// Whether there is room for (another) one.
    pub(crate) fn has_room(&self, cause: Cause) -> bool {
        match cause {
            Cause::Effect(Effect::RateDependence) => {
                self.drag.is_none() && self.effects.has_room(Effect::RateDependence)
            }
            Cause::Effect(e) => self.effects.has_room(e),
            Cause::ZeroWanders => !self.zero_wanders,
            Cause::GainWanders => !self.gain_wanders,
            Cause::GoesOn => self.is_slow() && !self.goes_on,
            Cause::SlewLimit => self.slew_limit.is_none(),
        }
    }

    /// The same without `cause` (the last one, if there are two).
    pub(crate) fn without(&self, cause: Cause) -> Self {
        let mut less = self.clone();
        match cause {
            Cause::Effect(Effect::RateDependence) => {
                less.drag = None;
                less.effects = self.effects.without(Effect::RateDependence);
            }
            Cause::Effect(e) => {
                less.effects = self.effects.without(e);
                less.goes_on &= less.is_slow();
            }
            Cause::GoesOn => less.goes_on = false,
            Cause::ZeroWanders => less.zero_wanders = false,
            Cause::GainWanders => less.gain_wanders = false,
            Cause::SlewLimit => less.slew_limit = None,
        }
        less
    }

    /// Numbers that a cause brings here: of two that a record cannot tell apart, the one with fewer is the simpler.
    pub(crate) fn complexity(&self, cause: Cause) -> usize {
        match cause {
            // A curve of time is free of the drive and imitates all that happens once in a record; a creep is tied to the drive.
            Cause::Effect(Effect::Drift) if self.effects.drift.is_some_and(|p| p.seconds > 0.0) => {
                let goes_on = self.effects.drift.is_some_and(|p| p.per_second != 0.0);
                Effect::Creep.complexity() + 1 + usize::from(goes_on)
            }
            Cause::Effect(Effect::Temperature) => {
                let more = |p: TemperatureParams| usize::from(p.expansion != 0.0) + usize::from(p.seconds > 0.0);
                Effect::Temperature.complexity() + self.effects.temperature.map_or(0, more)
            }
            Cause::Effect(Effect::RateDependence) => {
                let weights = self.effects.widening.as_ref().map_or(0, |p| p.weights.len());
                Effect::RateDependence.complexity() + weights
            }
            Cause::Effect(e) => e.complexity(),
            // No cause of its own: an actuator is seldom at rest when a record begins.
            Cause::GoesOn => 0,
            Cause::ZeroWanders | Cause::GainWanders => super::HATS,
            Cause::SlewLimit => 1,
        }
    }

    /// Whether anything changes what drives the hysteresis, or how it follows.
    pub(super) fn changes_the_base(&self) -> bool {
        self.effects.input_side() != InputSide::default() || self.drag.is_some() || self.slew_limit.is_some()
    }

    /// Whether the hysteresis is driven, and follows, as in another set.
    pub(super) fn drives_alike(&self, other: &Self) -> bool {
        self.drag == other.drag
            && self.slew_limit == other.slew_limit
            && self.effects.input_side() == other.effects.input_side()
            && self.effects.widening == other.effects.widening
    }

    /// Whether the output depends on the weights by more than a sum: it is then solved in rounds, each linear around the one before.
    pub(super) fn is_bent(&self) -> bool {
        self.effects.curve(CurveSide::Output).is_some() || self.effects.saturation.is_some() || self.gain_wanders
    }

    /// Calls `f` for every parameter that enters the output nonlinearly, always in the same order.
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

    /// Whether both hold the same parameters of nearly the same values.
    pub(crate) fn is_near(&self, other: &Self) -> bool {
        let (own, others) = (self.nonlinear(), other.nonlinear());
        let near = |a: f64, b: f64| (a - b).abs() <= SAME * a.abs().max(b.abs());
        self.causes() == other.causes()
            && own.len() == others.len()
            && own.iter().zip(&others).all(|((a, _), (b, _))| near(*a, *b))
    }

    /// Values and bounds of the nonlinear parameters.
    pub(super) fn nonlinear(&self) -> Vec<(f64, crate::lsq::Bounds)> {
        let mut values = Vec::new();
        self.clone()
            .visit_nonlinear(&mut |p| values.push((*p.value, crate::lsq::Bounds { lower: p.lower, upper: p.upper })));
        values
    }
}
