//! Standard errors that allow for correlated residuals.

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector};

use crate::lsq::Gram;
use crate::nested::{Fitted, Layout};

/// Standard error of every effect's parameters, by `stage.parameter`.
///
/// Block-wise sandwich: `H⁻¹ (Σ_b s_b s_bᵀ) H⁻¹` with s_b the gradient that block b contributes. A
/// misfit that is correlated inside a block widens the errors as it should. Parameters at a bound
/// are held there and get none.
pub(super) fn standard_errors(fit: &Fitted) -> BTreeMap<String, f64> {
    let mut errors = BTreeMap::new();
    let Some(columns) = fit.grams.first().map(|g| g.matrix.ncols()) else { return errors };
    let total = Gram::sum(columns, fit.grams.iter());
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
    let Some(inverse) = h.cholesky().map(|c| c.inverse()) else { return errors };
    let mut middle = DMatrix::zeros(free.len(), free.len());
    for gram in &fit.grams {
        let full = gram.score(z);
        let s = DVector::from_fn(free.len(), |r, _| full[free[r]] / scale[r]);
        middle += &s * s.transpose();
    }
    let blocks = fit.grams.len() as f64;
    let covariance = &inverse * middle * &inverse * (blocks / (blocks - 1.0).max(1.0));
    let of = |unknown: usize| {
        let r = free.iter().position(|i| *i == unknown)?;
        Some(covariance[(r, r)].max(0.0).sqrt() / scale[r])
    };

    let mut hypothesis = fit.hypothesis.clone();
    let layout = Layout::of(&hypothesis, fit.weights.len(), fit.zeros.len());
    let mut next = layout.len();
    hypothesis.visit_nonlinear(&mut |p| {
        if let Some(e) = of(next) {
            let (stage, name) = match p.name.strip_suffix("_2") {
                Some(name) => (format!("{}_2", p.effect), name.to_owned()),
                None => (p.effect.to_string(), p.name.clone()),
            };
            errors.insert(format!("{stage}.{name}"), e);
        }
        next += 1;
    });
    let mut put = |name: String, unknown: Option<usize>| {
        if let Some(e) = unknown.and_then(of) {
            errors.insert(name, e);
        }
    };
    put("drift.per_second".into(), layout.drift.clone().next());
    put("load.per_newton".into(), layout.load.clone().next());
    for (i, unknown) in layout.zones.clone().enumerate() {
        put(format!("asymmetry.weights[{i}]"), Some(unknown));
    }
    if let (Some(tone), Some(sine)) = (fit.hypothesis.effects.interference, layout.tone.clone().next())
        && let (Some(a), Some(b)) = (of(sine), of(sine + 1))
    {
        // Sine and cosine parts are nearly independent over many periods.
        let (s, c) = tone.phase.sin_cos();
        errors.insert("interference.amplitude".into(), (a * c).hypot(b * s));
        errors.insert("interference.phase".into(), (a * s).hypot(b * c) / tone.amplitude.max(f64::MIN_POSITIVE));
    }
    errors
}
