//! Slopes of a model's output with respect to its parameters, and the standard errors that they give.

use hyst_core::{Params, Sampling};
use nalgebra::DMatrix;
use rayon::prelude::*;

use super::family::Family;
use super::uncertainty::{Estimate, Evidence};
use crate::Samples;
use crate::drive::{Drive, Passes};
use crate::model::{Base, Operator};

/// Relative step of the difference quotients.
const STEP: f64 = 1e-5;

/// Names and values of a model's parameters in the order of their visit.
pub(crate) fn parameters_of(base: &Base) -> Vec<(String, f64)> {
    let mut list: Vec<(String, f64)> = Vec::new();
    base.clone().visit(&mut |meta, x| list.push((meta.name.to_owned(), *x)));
    let name = |i: usize| {
        let same = |j: &usize| list[*j].0 == list[i].0;
        if (0..list.len()).filter(same).count() > 1 {
            format!("{}[{}]", list[i].0, (0..i).filter(same).count())
        } else {
            list[i].0.clone()
        }
    };
    (0..list.len()).map(|i| (name(i), list[i].1)).collect()
}

/// The model with its `which`-th parameter changed.
fn changed(base: &Base, which: usize, to: f64) -> Base {
    let (mut other, mut i) = (base.clone(), 0);
    other.visit(&mut |_, x| {
        if i == which {
            *x = to;
        }
        i += 1;
    });
    other
}

/// Standard errors of the parameters of `base`, which was fitted to the settled rows of `samples` together with sensor zeros.
///
/// The covariance is `σ² κ (JᵀJ)⁻¹` with J the slopes of the output by central differences, σ² the mean square of
/// what is left and κ its rows per independent one.
pub(crate) fn estimate(
    family: &dyn Family,
    base: &Base,
    samples: &Samples,
    zero_per_record: bool,
    residual: &[f64],
) -> Estimate {
    let all = parameters_of(base);
    let which: Vec<usize> = (0..all.len()).filter(|i| family.identified(&all[*i].0)).collect();
    let (low, high) = samples.input_range();
    let drive = Drive::new(samples, family.between_samples(), Passes::Once);
    let cx = Sampling { period: drive.period() };
    let simulated = |base: &Base| {
        let operator = Operator::new(base, [low, high], &cx).ok()?;
        let mut y = vec![0.0; samples.len()];
        drive.run(&operator, &mut y);
        Some(y)
    };
    let scale = |i: usize| {
        let own = all[i].1.abs();
        let scale = family.scale(base, &all[i].0).unwrap_or(own);
        if scale > 0.0 { scale } else { 1.0 }
    };
    // Slopes per scale, the mean of each file (or of all) taken off: the zeros are fitted too.
    let slope = |i: &usize| -> Vec<f64> {
        let scale = scale(*i);
        let step = STEP * scale;
        let side = |sign: f64| simulated(&changed(base, *i, all[*i].1 + sign * step));
        let (up, down) = (side(1.0), side(-1.0));
        let of = |a: &[f64], b: &[f64], width: f64| a.iter().zip(b).map(|(a, b)| (a - b) / width * scale).collect();
        let mut slope: Vec<f64> = match (up, down) {
            (Some(a), Some(b)) => of(&a, &b, 2.0 * step),
            // At a bound of the model there is one side only.
            (Some(a), None) => simulated(base).map_or_else(Vec::new, |y| of(&a, &y, step)),
            (None, Some(b)) => simulated(base).map_or_else(Vec::new, |y| of(&y, &b, step)),
            (None, None) => Vec::new(),
        };
        slope.resize(samples.len(), 0.0);
        centre(&mut slope, samples, zero_per_record);
        slope
    };
    let slopes: Vec<Vec<f64>> = which.par_iter().map(slope).collect();
    let settled: Vec<usize> = (0..samples.len()).filter(|k| !samples.settling[*k]).collect();
    let n = which.len();
    let normal = DMatrix::from_fn(n, n, |i, j| settled.iter().map(|k| slopes[i][*k] * slopes[j][*k]).sum::<f64>());
    let zeros = if zero_per_record { samples.files() } else { 1 };
    Estimate::of(Evidence {
        parameters: which.iter().map(|i| all[*i].clone()).collect(),
        scales: which.iter().map(|i| scale(*i)).collect(),
        normal,
        residual,
        unknowns: n + zeros,
        held: Vec::new(),
    })
}

fn centre(slope: &mut [f64], samples: &Samples, zero_per_record: bool) {
    let files = if zero_per_record { samples.files() } else { 1 };
    for file in 0..files {
        let own: Vec<usize> = samples
            .segments
            .iter()
            .zip(&samples.file_of_segment)
            .filter(|(_, f)| !zero_per_record || **f == file)
            .flat_map(|(s, _)| s.clone())
            .filter(|k| !samples.settling[*k])
            .collect();
        let mean = own.iter().map(|k| slope[*k]).sum::<f64>() / own.len().max(1) as f64;
        own.iter().for_each(|k| slope[*k] -= mean);
    }
}
