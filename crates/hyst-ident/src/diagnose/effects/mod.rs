//! The effects that a diagnosis can name, one file each. [`of`] is the list of them.

mod asymmetry;
mod creep;
mod delay;
mod drift;
mod interference;
mod kind;
mod lag;
mod late;
mod law;
mod load;
mod rate_dependence;
mod resonance;
pub(super) mod saturation;
mod temperature;

pub use kind::EffectKind;
pub(super) use law::Law;

use crate::model::Effect;

/// Returns what the diagnosis knows about an effect.
pub(super) fn of(effect: Effect) -> &'static dyn Law {
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
    fn every_law_is_that_of_its_effect() {
        for effect in Effect::ALL {
            assert_eq!(of(effect).effect(), effect);
        }
    }
}
