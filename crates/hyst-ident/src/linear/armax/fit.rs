//! Fits an ARMAX model: least squares of the prediction error.

use nalgebra::DVector;

use super::delay::estimate_delay;
use super::model::Armax;
use super::prediction::{Shape, Signals};
use super::start::LongArx;
use crate::Samples;
use crate::linear::LinearError;
use crate::linear::error::{require, require_one_period};

/// The delay of the input.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Delay {
    /// The result of [`estimate_delay`].
    #[default]
    Auto,
    /// This number of rows.
    Rows(usize),
}

/// Options of the fit of an ARMAX model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ArmaxOptions {
    /// The order n of A, B and C, 1 to 40. Two for each mode.
    pub order: usize,
    /// The delay of the input.
    pub delay: Delay,
}

/// Steps from each start, before only the better one is continued.
const FIRST_STEPS: usize = 8;
/// Maximum number of further steps.
const MAX_STEPS: usize = 40;
/// Minimum relative fall of the cost per step; a smaller fall is insignificant in a record.
const MIN_COST_FALL: f64 = 1e-5;
/// Damping of the first step, for columns of unit length.
const INITIAL_LAMBDA: f64 = 1e-6;

/// Fits an ARMAX model: least squares of the one-step prediction error over all segments.
///
/// The search has two starts, both from a long ARX model. For any disturbance: its prediction errors replace e in a
/// linear fit (Hannan and Rissanen 1982). For white sensor noise: its simulation from the input is reduced to the order
/// n (Steiglitz and McBride 1965), with C = A. From both, Levenberg-Marquardt steps reduce the prediction error. Roots
/// of C outside the unit circle are reflected. The better result is returned.
///
/// # Errors
/// If the order is out of range, a column is constant, there are too few rows, or no model of the order fits.
pub fn fit_armax(samples: &Samples, options: &ArmaxOptions) -> Result<Armax, LinearError> {
    require_one_period(samples)?;
    let delay = match options.delay {
        Delay::Auto => estimate_delay(samples)?,
        Delay::Rows(delay) => delay,
    };
    let signals = Signals::new(samples)?;
    let fitted = fit(&signals, options.order, delay)?;
    Ok(fitted.model(&signals))
}

/// A fit on scaled signals.
#[derive(Clone)]
pub(super) struct Fitted {
    pub(super) shape: Shape,
    pub(super) theta: DVector<f64>,
    /// Sum of squared prediction errors.
    pub(super) cost: f64,
}

impl Fitted {
    /// Returns the model in the units of the record, with covariance.
    pub(super) fn model(&self, signals: &Signals) -> Armax {
        let unknowns = self.shape.unknowns();
        let freedom = signals.count(self.shape).saturating_sub(unknowns).max(1) as f64;
        let noise = (self.cost / freedom).sqrt();
        let gram = signals.linearised(self.shape, &self.theta).and_then(|triangle| triangle.inverse_gram());
        let covariance = gram.unwrap_or_else(|| nalgebra::DMatrix::from_element(unknowns, unknowns, f64::INFINITY));
        signals.model(self.shape, &self.theta, noise, &(covariance * (noise * noise)))
    }
}

/// Fits a model of one order and delay.
pub(super) fn fit(signals: &Signals, order: usize, delay: usize) -> Result<Fitted, LinearError> {
    require("order", order as f64, (1..=40).contains(&order), "between 1 and 40")?;
    require("delay", delay as f64, delay <= 10_000, "at most 10000 rows")?;
    let shape = Shape { n: order, delay };
    let longest = signals.rows.iter().map(ExactSizeIterator::len).max().unwrap_or(0);
    let needed = 10 * shape.unknowns() + delay;
    if longest < needed {
        let remedy = "record longer, or lower the order";
        return Err(LinearError::TooShort { what: "this order", needed, found: longest, remedy });
    }
    let unfit = || LinearError::Unfit { order };
    let long = LongArx::fit(signals, shape).ok_or_else(unfit)?;
    let best = [long.extended(signals, shape), long.reduced(signals, shape)]
        .into_iter()
        .flatten()
        .map(|start| search(signals, shape, start, FIRST_STEPS))
        .min_by(|a, b| a.cost.total_cmp(&b.cost))
        .filter(|best| best.cost.is_finite())
        .ok_or_else(unfit)?;
    Ok(search(signals, shape, best.theta, MAX_STEPS))
}

/// Levenberg-Marquardt search from a start with a stable C.
pub(super) fn search(signals: &Signals, shape: Shape, start: DVector<f64>, steps: usize) -> Fitted {
    let mut best = Fitted { shape, cost: signals.cost(shape, &start), theta: start };
    let (mut lambda, mut small_steps) = (INITIAL_LAMBDA, 0);
    for _ in 0..steps {
        let Some(triangle) = signals.linearised(shape, &best.theta) else { break };
        let before = best.cost;
        // Shortens the step until the cost falls; if none does, this is the minimum.
        while lambda < 1e8 {
            let theta = triangle.solve(lambda).map(|step| shape.with_stable_c(&best.theta + step));
            let cost = theta.as_ref().map_or(f64::INFINITY, |theta| signals.cost(shape, theta));
            match theta {
                Some(theta) if cost < best.cost => {
                    best = Fitted { theta, cost, ..best };
                    lambda = f64::max(lambda / 10.0, 1e-12);
                    break;
                }
                _ => lambda *= 10.0,
            }
        }
        if best.cost > before * (1.0 - MIN_COST_FALL) {
            // A short step in a curved valley has a small fall too: stops only after a second one with the initial
            // damping.
            small_steps += 1;
            if small_steps == 2 {
                break;
            }
            lambda = INITIAL_LAMBDA;
        }
    }
    best
}
