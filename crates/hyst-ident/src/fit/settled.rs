//! Fits a basis to the rows that count: without start-up rows, and after the drive history of each segment.

use super::options::FitOptions;
use crate::base::{Basis, PiBasis};
use crate::criteria::{MIN_RMSE_DROP, MINOR_SHARE};
use crate::error::FitError;
use crate::lsq::{BLOCKS, Blocks, ROWS};
use crate::memory;
use crate::nested::{Fitted, Hypothesis, Problem};
use crate::samples::Samples;
use crate::settle::{start_up_rows, started, windows, without_beginnings};

/// A fit, and its residual in some rows or in every row \[y\].
type FitAndResidual = (Fitted, Vec<f64>);
/// Estimates the drive history of each segment from a fit and its residual in every row. The first flags mark the
/// segments to estimate, the second ones those in which a memory other than rest is expected.
type Recalls<'a> = dyn Fn(&Samples, &FitAndResidual, &[bool], &[bool]) -> Result<Vec<Vec<f64>>, FitError> + 'a;

/// Maximum number of estimates of the drive history, each from the fit with the previous one.
const RECALLS: usize = 2;

/// Fits the basis and finds the start-up rows and the drive history of each segment. Sets `samples.settling` and
/// `samples.pasts`. Returns the fit and its residual in the rows that it used.
pub(crate) fn fit_settled(
    samples: &mut Samples,
    basis: &dyn Basis,
    options: &FitOptions,
    name: &dyn Fn() -> String,
) -> Result<FitAndResidual, FitError> {
    let run = |samples: &Samples, basis: &dyn Basis| everywhere(samples, basis, options.zero_per_record, name);
    let mut all = run(samples, basis)?;
    if samples.mark_spikes(&all.1) {
        all = run(samples, basis)?;
    }
    let (mut found, late) = start_up_found(samples, all, None, |samples| run(samples, basis))?;
    if memory::standing_out_where_followed(samples, &late.1).contains(&true) {
        // The drive history is estimated with play operators for every base: their few unknowns need few rows.
        samples.settling.copy_from_slice(&samples.blind);
        let plays = PiBasis::for_samples(samples);
        let recalls = |samples: &Samples, (fitted, residual): &FitAndResidual, asked: &[bool], surely: &[bool]| {
            let blocks = Blocks::new(samples, BLOCKS, ROWS);
            let problem = Problem::new(samples, &plays, &blocks, options.zero_per_record);
            memory::recalled(samples, residual, asked, surely, |samples| problem.motion_in(fitted, samples))
                .map_err(|source| FitError::Stage { record: name(), source })
        };
        let by_plays = recalled(samples, |samples| run(samples, &plays), &recalls)?;
        samples.settling.copy_from_slice(&samples.blind);
        let all = run(samples, basis)?;
        (found, _) = start_up_found(samples, all, Some(&by_plays), |samples| run(samples, basis))?;
    }
    Ok(within(samples, found))
}

/// Estimates the drive history of each segment with play operators and sets `samples.pasts`. Returns their residual in
/// each row.
fn recalled(
    samples: &mut Samples,
    run: impl Fn(&Samples) -> Result<FitAndResidual, FitError>,
    recalls: &Recalls<'_>,
) -> Result<Vec<f64>, FitError> {
    let (mut found, mut late) = start_up_found(samples, run(samples)?, None, &run)?;
    let asked = memory::standing_out_where_followed(samples, &late.1);
    if !asked.contains(&true) {
        return Ok(found.1);
    }
    // A part of the history shows in the whole record. Without a start-up, or near 0 V where a sensor transient may be
    // the cause, only the last reversals are estimated.
    let rest = without_beginnings(samples);
    let starts = started(samples, &samples.settling);
    let surely: Vec<bool> = memory::away(samples).iter().zip(starts).map(|(away, starts)| *away && starts).collect();
    let histories =
        memory::with_histories(&rest, &surely, &mut |samples: &Samples| Ok::<_, FitError>(run(samples)?.0.squares))?;
    if histories.pasts != samples.pasts {
        samples.pasts = histories.pasts;
        samples.settling.copy_from_slice(&samples.blind);
        let all = run(samples)?;
        (found, late) = start_up_found(samples, all, None, &run)?;
    }
    for _ in 0..RECALLS {
        let pasts = memory::kept(&samples.pasts, recalls(samples, &late, &asked, &surely)?);
        if pasts == samples.pasts {
            break;
        }
        let mut recalled = Samples { pasts, settling: samples.blind.clone(), ..samples.clone() };
        let all = run(&recalled)?;
        let with_past = start_up_found(&mut recalled, all, None, &run)?;
        let count = |samples: &Samples| samples.settling.iter().filter(|s| **s).count();
        // The history must leave fewer start-up rows, or as many and a clearly smaller error.
        let (now, then) = (count(samples), count(&recalled));
        let errs_less = with_past.0.0.rmse() <= (1.0 - MIN_RMSE_DROP) * found.0.rmse();
        if then > now || (then == now && !errs_less) {
            break;
        }
        *samples = recalled;
        (found, late) = with_past;
    }
    Ok(found.1)
}

/// Finds the start-up rows, given a fit to all rows, and sets `samples.settling`. Returns the fit to the rows that
/// count and the fit without the start-up windows. `beside` is the residual of another basis in each row.
fn start_up_found(
    samples: &mut Samples,
    all: FitAndResidual,
    beside: Option<&[f64]>,
    run: impl Fn(&Samples) -> Result<FitAndResidual, FitError>,
) -> Result<(FitAndResidual, FitAndResidual), FitError> {
    let windows = windows(samples);
    let without = without_beginnings(samples);
    let late = run(&without)?;
    let rms_late = |r: &[f64]| {
        let kept = r.iter().zip(&without.settling).filter(|(_, s)| !**s);
        let (sum, n) = kept.fold((0.0, 0usize), |(sum, n), (r, _)| (sum + r * r, n + 1));
        (sum / n.max(1) as f64).sqrt()
    };
    // If the fit without the start-up windows is much better on the rest, the windows disagree with the rest and are
    // judged by that fit. The same applies if a record starts away from 0 V, because its memory is unknown. Otherwise
    // they belong to the record and contain its virgin curve.
    let (low, high) = samples.input_range();
    let away = samples.segments.iter().any(|s| samples.input[s.start].abs() > MINOR_SHARE * low.abs().max(high.abs()));
    let judged_late = away || rms_late(&all.1) > 1.5 * rms_late(&late.1);
    let mut residual = if judged_late { late.1.clone() } else { all.1.clone() };
    // A fit without these rows may lack weights that only they determine. Rows that the other basis follows are no
    // start-up rows.
    if let Some(beside) = beside.filter(|_| judged_late) {
        for (s, w) in samples.segments.iter().zip(&windows) {
            let rows = s.start..s.start + w;
            let squares = |r: &[f64]| rows.clone().filter(|k| !samples.blind[*k]).map(|k| r[k] * r[k]).sum::<f64>();
            if squares(beside) < squares(&residual) {
                residual[rows.clone()].copy_from_slice(&beside[rows]);
            }
        }
    }
    samples.settling = start_up_rows(samples, &residual);
    let found = if samples.settling.iter().any(|s| *s) { run(samples)? } else { all };
    Ok((found, late))
}

/// Fits the rows that count. Returns the fit and its residual in every row.
fn everywhere(
    samples: &Samples,
    basis: &dyn Basis,
    zero_per_file: bool,
    name: &dyn Fn() -> String,
) -> Result<FitAndResidual, FitError> {
    let blocks = Blocks::new(samples, BLOCKS, ROWS);
    let problem = Problem::new(samples, basis, &blocks, zero_per_file);
    let stage = |source| FitError::Stage { record: name(), source };
    let fitted =
        problem.fit(&Hypothesis::default()).map_err(stage)?.ok_or_else(|| FitError::Unsolvable { record: name() })?;
    let residual = problem.residual(&fitted).map_err(stage)?;
    Ok((fitted, residual))
}

/// Reduces the residual of a fit to the rows that the fit used.
fn within(samples: &Samples, (fitted, residual): FitAndResidual) -> FitAndResidual {
    let left = Blocks::new(samples, BLOCKS, ROWS).all_used(samples).map(|k| residual[k]).collect();
    (fitted, left)
}

/// Fits the rows that count. Returns the fit and its residual in the rows that it used.
pub(super) fn solved(
    samples: &Samples,
    basis: &dyn Basis,
    zero_per_file: bool,
    name: &dyn Fn() -> String,
) -> Result<FitAndResidual, FitError> {
    Ok(within(samples, everywhere(samples, basis, zero_per_file, name)?))
}
