//! Which causes may be added to a fit, and why a record cannot show the others.

use super::effects;
use super::single_loop::only_one_loop;
use crate::model::Effect;
use crate::nested::{Cause, Fitted, Hypothesis, Problem};

/// Returns the causes that may be added to a fit. A curve is not among them: the screening basis bends by itself. The
/// model's own base is checked for a curve at the end.
pub(super) fn candidates(problem: &Problem<'_>, fit: &Fitted) -> Vec<Cause> {
    let effects = Effect::ALL.into_iter().filter(|e| *e != Effect::Asymmetry).map(Cause::Effect);
    effects
        .chain([Cause::ZeroWanders, Cause::GainWanders, Cause::InitialState, Cause::SlewLimit])
        .filter(|c| fit.hypothesis.has_room(*c) && hidden(*c, problem).is_none())
        .collect()
}

/// Returns why a record cannot show a cause; `None` if it can.
pub(super) fn hidden(cause: Cause, problem: &Problem<'_>) -> Option<&'static str> {
    match cause {
        Cause::Effect(effect) => effects::of(effect).hidden(problem),
        Cause::SlewLimit => only_one_loop(problem),
        _ => None,
    }
}

/// Returns the causes of a set beyond those in `already`, each once.
pub(super) fn new_causes(h: &Hypothesis, already: &[Cause]) -> Vec<Cause> {
    let mut names = h.causes();
    for known in already {
        if let Some(at) = names.iter().position(|n| n == known) {
            names.remove(at);
        }
    }
    names.dedup();
    names
}

#[cfg(test)]
mod tests {
    use hyst_core::{LagParams, ResonanceParams};

    use super::*;
    use crate::model::Effects;

    #[test]
    fn one_of_two_modes_may_be_known_before() {
        let mode = |hz| ResonanceParams { hz, damping: 0.02, gain: 1.0 };
        let lag = Some(LagParams { seconds: 0.01 });
        let h = Hypothesis::of(Effects { lag, resonances: vec![mode(40.0), mode(90.0)], ..Effects::default() });
        let (lag, resonance) = (Cause::Effect(Effect::Lag), Cause::Effect(Effect::Resonance));
        assert_eq!(new_causes(&h, &[]), [lag, resonance]);
        assert_eq!(new_causes(&h, &[resonance]), [lag, resonance]);
        assert_eq!(new_causes(&h, &[resonance, lag]), [resonance]);
        assert_eq!(new_causes(&h, &[resonance, resonance]), [lag]);
        assert_eq!(new_causes(&h.without(resonance), &[resonance]), [lag]);
    }
}
