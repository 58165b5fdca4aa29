//! One named effect in numbers and words: its law, its parameters and its evidence.

use std::collections::BTreeMap;

use super::context::Context;
use super::effects::{self, EffectKind};
use super::findings::{Alternative, Finding, Found};
use super::search::Named;
use crate::digits::short;
use crate::model::Effect;

/// Builds the finding of a named effect.
pub(super) fn finding(m: &Context<'_>, named: &Named) -> Finding {
    let unit = m.symbol();
    let after = named.cv_with;
    let j = &named.judgement;
    // First the evidence that a person can check on the device, then the statistics.
    let mut evidence: Vec<String> = effects::of(named.effect).signature(m).into_iter().collect();
    evidence.push(format!(
        "cross-validated error {} {unit} without it, {} {unit} with it; better in {:.1} % of {} bootstrap draws",
        short(named.cv_without),
        short(after),
        100.0 * j.confidence,
        super::score::DRAWS
    ));
    evidence.push(format!(
        "explains {:.0} % of the residual variance above the noise floor; its RMS is {:.1} noise floors",
        100.0 * j.share,
        j.over_noise
    ));
    if j.sensor_tone {
        evidence.push(
            "the tone is present throughout the record and far above the residual at neighbouring frequencies; neither the drive nor a \
             misfit of the base model causes such a tone"
                .into(),
        );
    }
    Finding {
        name: named.effect,
        kind: EffectKind::of(named.effect),
        law: effects::of(named.effect).law(m.extended).map(str::to_owned),
        probability: named.evidence(m.left).probability(),
        parameters: parameters(m, named.effect),
        evidence,
        alternatives: named
            .rivals
            .iter()
            .map(|i| Alternative { name: i.effect, cv_rmse: i.cv_rmse, indistinguishable: i.tie })
            .collect(),
        cv_rmse_before: named.cv_without,
        cv_rmse_after: after,
    }
}

fn parameters(m: &Context<'_>, effect: Effect) -> BTreeMap<String, Found> {
    let mut list = BTreeMap::new();
    effects::of(effect).parameters(m, &mut |stage, name, value, unit| {
        let std_error = m.errors.get(&format!("{stage}.{name}")).copied();
        // A second mode has its own stage.
        let suffix = stage.strip_prefix(effect.name()).unwrap_or_default();
        list.insert(format!("{name}{suffix}"), Found { value, std_error, unit: unit.into() });
    });
    list
}
