//! Standard errors that allow for correlated residuals.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};

use super::effects;
use crate::criteria::{MIN_STD_ERRORS, MINOR_SHARE};
use crate::lsq::Share;
use crate::model::Effect;
use crate::nested::{Cause, Fitted};

/// Effects whose law the record does not determine: a parameter is not significantly different from the value at which
/// its effect vanishes (for the damping of a mode: from zero; for a saturation limit: from one outside of the output's
/// range).
pub(super) struct Undetermined {
    uncertain: Vec<Effect>,
    insignificant: Vec<Effect>,
}

impl Undetermined {
    /// `span` is the range of the output \[y\].
    pub(super) fn of(fit: &Fitted, span: f64) -> Self {
        Self { uncertain: within(fit, span, MIN_STD_ERRORS), insignificant: within(fit, span, MINOR_SHARE) }
    }

    /// Returns whether this is evidence against a cause. A parameter without any significance is, even if the error is
    /// far lower with the cause.
    pub(super) fn contradicts(&self, cause: Cause, far_better: impl FnOnce() -> bool) -> bool {
        let Some(effect) = cause.effect() else { return false };
        self.insignificant.contains(&effect) || self.uncertain.contains(&effect) && !far_better()
    }
}

/// Returns the effects with a parameter that is fewer than `std_errors` standard errors from the value at which it
/// vanishes.
fn within(fit: &Fitted, span: f64, std_errors: f64) -> Vec<Effect> {
    let errors = standard_errors(fit, 0.0);
    // A parameter at a bound has no error; bounds are checked elsewhere.
    let unsure = |key: &str, value: f64| errors.get(key).is_some_and(|error| value.abs() < std_errors * error);
    let of = |effect: &Effect| effects::of(*effect).is_undetermined(&fit.hypothesis.effects, &unsure, span);
    Effect::ALL.into_iter().filter(of).collect()
}

/// Returns the standard errors of all effects' parameters, by `stage.parameter`.
///
/// Jackknife over blocks: each block b is left out of the normal equations once, and the solution changes by `(H −
/// H_b)⁻¹ s_b`, with s_b the gradient that the block contributes. The covariance is (B − 1)/B times the sum of the
/// outer products of these changes. So a misfit that is correlated inside a block increases the errors, and so does a
/// parameter that only one block determines. Parameters at a bound are held there and get no error. `start_s` is the
/// time of the record's first row \[s\].
pub(super) fn standard_errors(fit: &Fitted, start_s: f64) -> BTreeMap<String, f64> {
    let mut errors = BTreeMap::new();
    let Some(columns) = fit.shares.first().map(Share::columns) else { return errors };
    let total = Share::sum(columns, fit.shares.iter());
    let n = total.unknowns();
    let z = &fit.solution;
    let free: Vec<usize> = (0..n)
        .filter(|i| {
            let b = fit.bounds[*i];
            let room = 1e-9 * (1.0 + z[*i].abs());
            z[*i] - b.lower > room && b.upper - z[*i] > room && total.matrix[(*i, *i)] > 0.0
        })
        .collect();
    let scale: Vec<f64> = free.iter().map(|i| total.matrix[(*i, *i)].sqrt()).collect();
    let h = DMatrix::from_fn(free.len(), free.len(), |r, c| {
        let (i, j) = (free[r], free[c]);
        (total.matrix[(i, j)] + fit.penalty[(i, j)]) / (scale[r] * scale[c]) + if r == c { 1e-12 } else { 0.0 }
    });
    let Some(whole) = h.clone().cholesky() else { return errors };
    let mut covariance = DMatrix::zeros(free.len(), free.len());
    for share in fit.shares.iter() {
        let (full, gram) = (share.score(z), share.gram());
        let score = DVector::from_fn(free.len(), |r, _| full[free[r]] / scale[r]);
        let others = DMatrix::from_fn(free.len(), free.len(), |r, c| {
            h[(r, c)] - gram.matrix[(free[r], free[c])] / (scale[r] * scale[c])
        });
        // If the other blocks determine nothing, the change is that of all blocks.
        let moved = others.cholesky().unwrap_or_else(|| whole.clone()).solve(&score);
        covariance.ger(1.0, &moved, &moved, 1.0);
    }
    let blocks = fit.shares.len() as f64;
    covariance *= (blocks - 1.0) / blocks;
    let covariance_of = |a: usize, b: usize| {
        let place = |unknown: usize| free.iter().position(|i| *i == unknown);
        let (r, c) = (place(a)?, place(b)?);
        Some(covariance[(r, c)] / (scale[r] * scale[c]))
    };
    let of = |unknown: usize| Some(covariance_of(unknown, unknown)?.max(0.0).sqrt());

    let mut hypothesis = fit.hypothesis.clone();
    let layout = fit.layout();
    let mut next = layout.len();
    let (mut creep, mut hz) = (Vec::new(), None);
    hypothesis.visit_nonlinear(&mut |p| {
        match p.cause.effect() {
            Some(Effect::Creep) => creep.push(next),
            Some(Effect::Interference) => hz = Some(next),
            _ => {}
        }
        if let (Some(e), Some(effect)) = (of(next), p.cause.effect()) {
            let (stage, name) = match p.name.strip_suffix("_2") {
                Some(name) => (format!("{effect}_2"), name.to_owned()),
                None => (effect.to_string(), p.name.clone()),
            };
            errors.insert(format!("{stage}.{name}"), e);
        }
        next += 1;
    });
    // Neighbouring shares are far less certain than their sum.
    let shares = || creep.iter().flat_map(|a| creep.iter().map(move |b| (*a, *b)));
    let total: f64 = shares().filter_map(|(a, b)| covariance_of(a, b)).sum();
    if total > 0.0 {
        errors.insert("creep.total".into(), total.sqrt());
    }
    if let Some(p) = &fit.hypothesis.effects.widening {
        // Neighbouring weights are far less certain than their sum.
        let plays = || layout.widening.clone().zip(&p.thresholds);
        let pairs = plays().flat_map(|a| plays().map(move |b| (a, b)));
        let parts = pairs.filter_map(|((a, r), (b, s))| Some(r * s * covariance_of(a, b)?));
        let variance: f64 = parts.sum::<f64>() * p.growth * p.growth;
        if variance > 0.0 {
            errors.insert("rate-dependence.extra_half_width".into(), variance.sqrt());
        }
    }
    let mut put = |name: String, unknown: Option<usize>| {
        if let Some(e) = unknown.and_then(of) {
            errors.insert(name, e);
        }
    };
    put("drift.per_second".into(), layout.drift.clone().next());
    put("drift.settling".into(), layout.drift.clone().nth(1));
    put("load.per_newton".into(), layout.load.clone().next());
    put("temperature.expansion".into(), layout.expansion.clone().next());
    put("temperature.direct".into(), layout.direct.clone().next());
    for (i, unknown) in layout.zones.clone().enumerate() {
        put(format!("asymmetry.weights[{i}]"), Some(unknown));
    }
    if let (Some(tone), Some(sine), Some(hz)) = (fit.hypothesis.effects.interference, layout.tone.clone().next(), hz) {
        // Amplitude and phase follow from the sine and cosine parts. The phase refers to time zero. A frequency error δ
        // changes the phase at the first row by 2π t₀ δ.
        let (s, c) = tone.phase.sin_cos();
        let a = tone.amplitude.max(f64::MIN_POSITIVE);
        let away = -2.0 * std::f64::consts::PI * start_s;
        let variance = |slopes: [(usize, f64); 3]| -> Option<f64> {
            let mut sum = 0.0;
            for (i, x) in slopes {
                for (j, y) in slopes {
                    if x != 0.0 && y != 0.0 {
                        sum += x * y * covariance_of(i, j)?;
                    }
                }
            }
            Some(sum.max(0.0))
        };
        let amplitude = variance([(sine, c), (sine + 1, s), (hz, 0.0)]);
        let phase = variance([(sine, -s / a), (sine + 1, c / a), (hz, away)]);
        errors.extend(amplitude.map(|v| ("interference.amplitude".into(), v.sqrt())));
        errors.extend(phase.map(|v| ("interference.phase".into(), v.sqrt())));
    }
    errors
}
