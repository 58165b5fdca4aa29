//! Which causes may be added to a fit, and why a record cannot show the others.

use crate::model::Effect;
use crate::nested::{Cause, Fitted, Hypothesis, Problem};
use crate::statistics::range;

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
    let varies = |column: &[f64], least: f64| {
        let (low, high) = range(column.iter().copied());
        high - low > least
    };
    match cause {
        Cause::Effect(Effect::Temperature) => match &problem.samples.temperature {
            None => Some("the temperature was not recorded"),
            Some(degc) => (!varies(degc, 0.5)).then_some("the temperature changed by less than 0.5 K"),
        },
        Cause::Effect(Effect::Load) => match &problem.samples.load {
            None => Some("the load was not recorded"),
            Some(newtons) => (!varies(newtons, 0.0)).then_some("the load did not change"),
        },
        // In a single loop, an effect that changes its shape cannot be separated from the hysteresis. A late output
        // can, but not one late effect from another: the simplest represents all of them.
        Cause::Effect(Effect::RateDependence | Effect::Resonance | Effect::Saturation | Effect::Asymmetry)
        | Cause::SlewLimit => problem.only_loop.map(
            |_| "the record repeats one loop, which does not separate the effect from the shape of the hysteresis",
        ),
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
