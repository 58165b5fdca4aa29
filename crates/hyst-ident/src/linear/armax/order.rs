//! The order, by what models say about rows that they were not fitted to.

use std::ops::Range;

use rayon::prelude::*;
use serde::Serialize;

use super::delay::estimate_delay;
use super::fit::{Delay, Fitted, fit, search};
use super::model::Armax;
use super::prediction::Signals;
use crate::Samples;
use crate::linear::LinearError;

/// Which order to take.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Order {
    /// The one that [`choose_order`] chooses among these.
    Auto(Vec<usize>),
    /// This one.
    Fixed(usize),
}

impl Default for Order {
    /// Even orders up to 20: a mode takes two.
    fn default() -> Self {
        Self::Auto((1..=10).map(|n| 2 * n).collect())
    }
}

/// One order in the comparison. Errors are root mean squares over rows that the model was not fitted to \[y\].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct OrderRow {
    /// The order n.
    pub order: usize,
    /// Cross-validated error of a prediction one row ahead.
    pub one_step: f64,
    /// Cross-validated error of a simulation from the input alone; infinite where the model is not stable.
    pub simulation: f64,
    /// Akaike's criterion `N ln(V) + 2 p` on all rows, V the mean squared prediction error \[scaled signals\], p the unknowns.
    pub aic: f64,
    /// Schwarz's criterion `N ln(V) + p ln(N)` on all rows.
    pub bic: f64,
}

/// The comparison, and the model of the order chosen, fitted to all rows.
#[derive(Clone, Debug)]
pub struct OrderChoice {
    /// Every order that could be fitted, from the lowest up.
    pub table: Vec<OrderRow>,
    /// The model.
    pub model: Armax,
    /// Why this order, in words.
    pub reason: String,
}

/// How much more than the best a model's prediction may miss.
const PREDICTION: f64 = 1.05;
/// Pieces of the record that are left out in turn.
const BLOCKS: usize = 12;
/// Fits in which all blocks are left out once, every third block at a time.
const FOLDS: usize = 3;
/// Steps from the model of all rows to the one without the blocks left out.
const FOLD_STEPS: usize = 3;

/// Chooses the order by cross-validation: the record is cut into twelve blocks, every third is left out in turn, and what the
/// models miss in the blocks left out is compared. Taken is the lowest order whose simulation misses no more than one standard
/// error (over the blocks, of the difference) above the best one's, and whose prediction misses no more than 5 % above the best.
/// The comparison goes upwards, and ends when two orders in a row simulate no better than the ones before.
///
/// Simulation is what modes, inversions and pictures are for, but it would not see a mode that the drive hardly excites, which
/// prediction does; prediction alone would go on taking what hysteresis leaves for ever more poles.
///
/// # Errors
/// When no order can be fitted: the error of the first.
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
    // Two at a time whatever the number of threads, so that the same orders are compared everywhere.
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

/// An order with what it misses.
struct Candidate {
    row: OrderRow,
    fitted: Fitted,
    /// Mean squared errors of each block left out.
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
            // Over whole segments, so that a block begins with the history that it had.
            let predicted = model.prediction_errors(samples)?;
            let simulated = model.simulate(samples)?;
            for (block, rows) in blocks.iter().enumerate().filter(|(block, _)| block % FOLDS == fold) {
                let mean = |error: &dyn Fn(usize) -> f64| {
                    rows.clone().map(|t| error(t).powi(2)).sum::<f64>() / rows.len().max(1) as f64
                };
                one_step[block] = mean(&|t| predicted[t]);
                let missed = mean(&|t| samples.output[t] - simulated[t]);
                simulation[block] = if missed.is_finite() { missed } else { f64::INFINITY };
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

/// Blocks of about equal length, none across the border of two segments.
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

/// The blocks that are kept, neighbours of one segment in one piece.
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

/// The lowest order that misses no more than the best within the blocks' scatter, and the reason.
fn choose(candidates: &[Candidate]) -> Option<(usize, String)> {
    let usable = |c: &&Candidate| c.row.simulation.is_finite() && c.row.one_step.is_finite();
    let best = |figure: fn(&OrderRow) -> f64| {
        candidates.iter().filter(usable).min_by(|a, b| figure(&a.row).total_cmp(&figure(&b.row)))
    };
    let (predicts, simulates) = (best(|row| row.one_step)?, best(|row| row.simulation)?);
    let as_good = |c: &Candidate| {
        c.row.one_step <= PREDICTION * predicts.row.one_step && !exceeds(&c.simulation, &simulates.simulation)
    };
    let chosen = candidates.iter().position(|c| usable(&c) && as_good(c));
    let chosen = chosen.or_else(|| candidates.iter().position(|c| c.row.order == predicts.row.order))?;
    let reason = format!(
        "lowest order whose simulation of {} blocks left out is within one standard error of the best (order {}), and its \
         prediction within 5 % (order {})",
        simulates.simulation.len(),
        simulates.row.order,
        predicts.row.order
    );
    Some((chosen, reason))
}

/// Whether the mean of `a − b` is more than its standard error above zero.
fn exceeds(a: &[f64], b: &[f64]) -> bool {
    let n = a.len() as f64;
    let mean = a.iter().zip(b).map(|(a, b)| a - b).sum::<f64>() / n;
    let variance = a.iter().zip(b).map(|(a, b)| (a - b - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    mean > (variance / n).sqrt()
}
