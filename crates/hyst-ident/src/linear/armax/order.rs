//! Chooses the order by cross-validation.

use std::ops::Range;

use rayon::prelude::*;
use serde::Serialize;

use super::delay::estimate_delay;
use super::fit::{Delay, Fitted, fit, search};
use super::model::Armax;
use super::prediction::Signals;
use crate::Samples;
use crate::linear::LinearError;

/// Choice of the order.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Order {
    /// The one of these that [`choose_order`] chooses.
    Auto(Vec<usize>),
    /// This one.
    Fixed(usize),
}

impl Default for Order {
    /// Even orders up to 20: a mode needs two.
    fn default() -> Self {
        Self::Auto((1..=10).map(|n| 2 * n).collect())
    }
}

/// One order in the comparison. Errors are RMS over rows that were left out of the fit \[y\].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct OrderRow {
    /// The order n.
    pub order: usize,
    /// Cross-validated one-step prediction error.
    pub one_step: f64,
    /// Cross-validated error of a simulation from the input only; infinite for an unstable model.
    pub simulation: f64,
    /// Akaike's criterion `N ln(V) + 2 p` on all rows; V is the mean squared prediction error of the scaled signals, p
    /// the number of unknowns.
    pub aic: f64,
    /// Schwarz's criterion `N ln(V) + p ln(N)` on all rows.
    pub bic: f64,
}

/// The comparison, and the model of the chosen order, fitted to all rows.
#[derive(Clone, Debug)]
pub struct OrderChoice {
    /// All orders that could be fitted, from the lowest up.
    pub table: Vec<OrderRow>,
    /// The model.
    pub model: Armax,
    /// Reason for this order, in words.
    pub reason: String,
}

/// Maximum ratio of a prediction error to the best one.
const MAX_PREDICTION_RATIO: f64 = 1.05;
/// Number of blocks that are left out in turn.
const BLOCKS: usize = 12;
/// Number of fits, each without every third block.
const FOLDS: usize = 3;
/// Search steps of such a fit, from the model of all rows.
const FOLD_STEPS: usize = 3;

/// Chooses the order by cross-validation.
///
/// The record is cut into twelve blocks, and every third block is left out in turn. The result is the lowest order with
/// a simulation error of at most one standard error above the best (of the difference, over the blocks), and a
/// prediction error of at most 5 % above the best. Orders are tried from the lowest up, until two in a row do not
/// improve the simulation.
///
/// Modes, inversions and plots depend on the simulation, but it does not show a mode that the drive hardly excites;
/// prediction does. Prediction alone continues to add poles for the misfit of the hysteresis.
///
/// # Errors
/// If no order can be fitted: the error of the first.
pub fn choose_order(samples: &Samples, orders: &[usize], delay: Delay) -> Result<OrderChoice, LinearError> {
    let delay = match delay {
        Delay::Auto => estimate_delay(samples)?,
        Delay::Rows(delay) => delay,
    };
    let signals = Signals::new(samples)?;
    let mut orders = orders.to_vec();
    orders.sort_unstable();
    let mut first_error = None;
    let mut candidates: Vec<Candidate> = Vec::new();
    // Always two at a time, so that the compared orders do not depend on the number of threads.
    for orders in orders.chunks(2) {
        let tried: Vec<Result<Candidate, LinearError>> =
            orders.par_iter().map(|order| Candidate::new(samples, &signals, *order, delay)).collect();
        let least = |of: &[Candidate]| of.iter().map(|c| c.row.simulation).fold(f64::INFINITY, f64::min);
        let before = least(&candidates);
        let known = candidates.len();
        for tried in tried {
            match tried {
                Ok(candidate) => candidates.push(candidate),
                Err(error) => first_error = first_error.or(Some(error)),
            }
        }
        if known > 0 && least(&candidates[known..]) >= before {
            break;
        }
    }
    let (chosen, reason) = choose(&candidates).ok_or_else(|| first_error.unwrap_or(LinearError::Unfit { order: 0 }))?;
    let model = candidates[chosen].fitted.model(&signals);
    Ok(OrderChoice { table: candidates.iter().map(|candidate| candidate.row).collect(), model, reason })
}

/// An order with its errors.
struct Candidate {
    row: OrderRow,
    fitted: Fitted,
    /// Mean squared error of each block that was left out.
    simulation: Vec<f64>,
}

impl Candidate {
    fn new(samples: &Samples, signals: &Signals, order: usize, delay: usize) -> Result<Self, LinearError> {
        let fitted = fit(signals, order, delay)?;
        let shape = fitted.shape;
        let blocks = blocks(&signals.rows);
        let (mut one_step, mut simulation) = (vec![0.0; blocks.len()], vec![0.0; blocks.len()]);
        for fold in 0..FOLDS {
            let kept = signals.only(joined(&blocks, &signals.rows, |block| block % FOLDS != fold));
            let model = search(&kept, shape, fitted.theta.clone(), FOLD_STEPS).model(&kept);
            // Over whole segments, so that each block has its true history.
            let predicted = model.prediction_errors(samples)?;
            let simulated = model.simulate(samples)?;
            for (block, rows) in blocks.iter().enumerate().filter(|(block, _)| block % FOLDS == fold) {
                let mean = |error: &dyn Fn(usize) -> f64| {
                    rows.clone().map(|t| error(t).powi(2)).sum::<f64>() / rows.len().max(1) as f64
                };
                one_step[block] = mean(&|t| predicted[t]);
                let error = mean(&|t| samples.output[t] - simulated[t]);
                simulation[block] = if error.is_finite() { error } else { f64::INFINITY };
            }
        }
        let count = signals.count(shape).max(1) as f64;
        let loss = count * (fitted.cost / count).ln();
        let unknowns = shape.unknowns() as f64;
        let mean = |x: &[f64]| x.iter().sum::<f64>() / x.len().max(1) as f64;
        let row = OrderRow {
            order,
            one_step: mean(&one_step).sqrt(),
            simulation: mean(&simulation).sqrt(),
            aic: loss + 2.0 * unknowns,
            bic: loss + unknowns * count.ln(),
        };
        Ok(Self { row, fitted, simulation })
    }
}

/// Returns blocks of about equal length, none across two segments.
fn blocks(segments: &[Range<usize>]) -> Vec<Range<usize>> {
    let rows: usize = segments.iter().map(ExactSizeIterator::len).sum();
    let target = (rows / BLOCKS).max(1);
    let cut = |s: &Range<usize>| {
        let pieces = (s.len() as f64 / target as f64).round().max(1.0) as usize;
        let (start, len) = (s.start, s.len());
        let at = move |i: usize| start + len * i / pieces;
        (0..pieces).map(move |i| at(i)..at(i + 1))
    };
    segments.iter().flat_map(cut).collect()
}

/// Returns the blocks that are kept; neighbours in one segment are joined.
fn joined(blocks: &[Range<usize>], segments: &[Range<usize>], keep: impl Fn(usize) -> bool) -> Vec<Range<usize>> {
    let begins = |row: usize| segments.iter().any(|s| s.start == row);
    let mut pieces: Vec<Range<usize>> = Vec::new();
    for (_, rows) in blocks.iter().enumerate().filter(|(block, _)| keep(*block)) {
        match pieces.last_mut() {
            Some(last) if last.end == rows.start && !begins(rows.start) => last.end = rows.end,
            _ => pieces.push(rows.clone()),
        }
    }
    pieces
}

/// Returns the lowest order that is as good as the best one within the scatter of the blocks, and the reason.
fn choose(candidates: &[Candidate]) -> Option<(usize, String)> {
    let usable = |c: &&Candidate| c.row.simulation.is_finite() && c.row.one_step.is_finite();
    let best = |error: fn(&OrderRow) -> f64| {
        candidates.iter().filter(usable).min_by(|a, b| error(&a.row).total_cmp(&error(&b.row)))
    };
    let (predicts, simulates) = (best(|row| row.one_step)?, best(|row| row.simulation)?);
    let as_good = |c: &Candidate| {
        c.row.one_step <= MAX_PREDICTION_RATIO * predicts.row.one_step && !exceeds(&c.simulation, &simulates.simulation)
    };
    let chosen = candidates.iter().position(|c| usable(&c) && as_good(c));
    let chosen = chosen.or_else(|| candidates.iter().position(|c| c.row.order == predicts.row.order))?;
    let reason = format!(
        "lowest order with a simulation error of {} left-out blocks within one standard error of the best (order {}), and a \
         prediction error within 5 % (order {})",
        simulates.simulation.len(),
        simulates.row.order,
        predicts.row.order
    );
    Some((chosen, reason))
}

/// Returns whether the mean of `a − b` exceeds 0 by more than its standard error.
fn exceeds(a: &[f64], b: &[f64]) -> bool {
    let n = a.len() as f64;
    let mean = a.iter().zip(b).map(|(a, b)| a - b).sum::<f64>() / n;
    let variance = a.iter().zip(b).map(|(a, b)| (a - b - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    mean > (variance / n).sqrt()
}
