//! The effects that a diagnosis can name, one file each. [`of`] is the list of them.

mod asymmetry;
mod creep;
mod delay;
mod diagnosable;
mod drift;
mod interference;
mod kind;
mod lag;
mod late;
mod load;
mod rate_dependence;
mod resonance;
pub(super) mod saturation;
mod temperature;

pub(super) use diagnosable::Diagnosable;
pub use kind::EffectKind;

use crate::model::Effect;

/// Returns what the diagnosis knows about an effect.
pub(super) fn of(effect: Effect) -> &'static dyn Diagnosable {
    match effect {
        Effect::Delay => &delay::Delay,
        Effect::Lag => &lag::Lag,
        Effect::Asymmetry => &asymmetry::Asymmetry,
        Effect::RateDependence => &rate_dependence::RateDependence,
        Effect::Temperature => &temperature::Temperature,
        Effect::Creep => &creep::Creep,
        Effect::Load => &load::Load,
        Effect::Resonance => &resonance::Resonance,
        Effect::Saturation => &saturation::Saturation,
        Effect::Drift => &drift::Drift,
        Effect::Interference => &interference::Interference,
    }
}

impl EffectKind {
    /// Returns the class of an effect.
    pub fn of(effect: Effect) -> Self {
        of(effect).kind()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_effect_is_registered_under_its_name() {
        for effect in Effect::ALL {
            assert_eq!(of(effect).effect(), effect);
        }
    }
}
