//! What a trial assumes besides the rate-independent base.

use crate::base::DragParams;
use crate::model::{Effect, Effects, Parameter};

/// Something that a trial may add to the base: an effect that has a name, or a wandering that has none.
///
/// The wanderings are no explanations. They compete with the effects so that what nobody put on the list (a jump, a step of the
/// gain, a force that was not recorded) finds its place there and draws no wrong name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Cause {
    /// An effect of the closed list.
    Effect(Effect),
    /// The zero wanders in time.
    ZeroWanders,
    /// The gain wanders in time.
    GainWanders,
}

impl Cause {
    /// The effect, if it is one.
    pub(crate) fn effect(self) -> Option<Effect> {
        match self {
            Self::Effect(e) => Some(e),
            Self::ZeroWanders | Self::GainWanders => None,
        }
    }

    /// Numbers that it brings: between two that a record cannot tell apart, the one with fewer is the simpler.
    pub(crate) fn complexity(self) -> usize {
        match self {
            Self::Effect(e) => e.complexity(),
            Self::ZeroWanders | Self::GainWanders => super::HATS,
        }
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
}

impl Hypothesis {
    /// These effects alone.
    pub(crate) fn of(effects: Effects) -> Self {
        Self { effects, ..Self::default() }
    }

    /// Causes that are present, in the chain's order; a second mode counts once more.
    pub(crate) fn causes(&self) -> Vec<Cause> {
        let mut list: Vec<Effect> = self.effects.names();
        if self.drag.is_some() {
            list.push(Effect::RateDependence);
            list.sort();
        }
        let mut causes: Vec<Cause> = list.into_iter().map(Cause::Effect).collect();
        causes.extend(self.zero_wanders.then_some(Cause::ZeroWanders));
        causes.extend(self.gain_wanders.then_some(Cause::GainWanders));
        causes
    }

    /// Whether there is room for (another) one.
    pub(crate) fn has_room(&self, cause: Cause) -> bool {
        match cause {
            Cause::Effect(Effect::RateDependence) => self.drag.is_none(),
            Cause::Effect(e) => self.effects.has_room(e),
            Cause::ZeroWanders => !self.zero_wanders,
            Cause::GainWanders => !self.gain_wanders,
        }
    }

    /// The same without `cause` (the last one, if there are two).
    pub(crate) fn without(&self, cause: Cause) -> Self {
        let mut less = self.clone();
        match cause {
            Cause::Effect(Effect::RateDependence) => less.drag = None,
            Cause::Effect(e) => less.effects = self.effects.without(e),
            Cause::ZeroWanders => less.zero_wanders = false,
            Cause::GainWanders => less.gain_wanders = false,
        }
        less
    }

    /// Whether anything changes what drives the hysteresis, or how it follows.
    pub(super) fn changes_the_base(&self) -> bool {
        self.effects.input_side() != (None, None) || self.drag.is_some()
    }

    /// Whether the hysteresis is driven, and follows, as in another set.
    pub(super) fn drives_alike(&self, other: &Self) -> bool {
        self.drag == other.drag && self.effects.input_side() == other.effects.input_side()
    }

    /// Whether the output depends on the weights by more than a sum: it is then solved in rounds, each linear around the one before.
    pub(super) fn is_bent(&self) -> bool {
        self.effects.asymmetry.is_some() || self.effects.saturation.is_some() || self.gain_wanders
    }

    /// Calls `f` for every parameter that enters the output nonlinearly, always in the same order.
    pub(crate) fn visit_nonlinear(&mut self, f: &mut dyn FnMut(Parameter<'_>)) {
        if let Some(drag) = &mut self.drag {
            for (name, upper, value) in
                [("seconds", 1.0, &mut drag.seconds), ("volt_seconds", f64::INFINITY, &mut drag.volt_seconds)]
            {
                f(Parameter { effect: Effect::RateDependence, name: name.into(), lower: 0.0, upper, value });
            }
        }
        self.effects.visit_nonlinear(f);
    }

    /// Values and bounds of the nonlinear parameters.
    pub(super) fn nonlinear(&self) -> Vec<(f64, crate::lsq::Bounds)> {
        let mut values = Vec::new();
        self.clone()
            .visit_nonlinear(&mut |p| values.push((*p.value, crate::lsq::Bounds { lower: p.lower, upper: p.upper })));
        values
    }
}
