//! The whole way from a record to a structure's modes.

use super::{
    Armax, ArmaxOptions, Delay, FrequencyResponse, LinearError, Mode, Order, OrderRow, WelchOptions, Zero, band_of,
    choose_order, decimate, fit_armax, periodic_response, response,
};
use crate::Samples;
use crate::linear::error::require_one_period;

/// How [`identify_structure`] works.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StructureOptions {
    /// The model's order.
    pub order: Order,
    /// Delay of the input, in rows of the band's rate.
    pub delay: Delay,
    /// Highest frequency of the model \[Hz\]; if not given, [`band_of`] the response.
    pub band_hz: Option<f64>,
    /// Length of Welch's windows \[s\].
    pub window_s: Option<f64>,
    /// Period of the drive \[s\]: averages over periods in place of Welch's.
    pub period_s: Option<f64>,
}

/// A structure as a record shows it.
#[derive(Clone, Debug)]
pub struct Structure {
    /// The frequency response.
    pub response: FrequencyResponse,
    /// Highest frequency that the model was fitted up to \[Hz\].
    pub band_hz: f64,
    /// Every how many rows one was kept for that.
    pub factor: usize,
    /// The model.
    pub model: Armax,
    /// Its modes, from the lowest frequency up.
    pub modes: Vec<Mode>,
    /// Its zeros.
    pub zeros: Vec<Zero>,
    /// The comparison of orders; empty where the order was given.
    pub orders: Vec<OrderRow>,
    /// Why this order.
    pub reason: String,
    /// Root mean square of what a simulation from the input alone misses, over the output's standard deviation.
    pub simulation_share: f64,
}

/// Estimates the response, brings the record down to the band that the drive reaches, and fits an ARMAX model there.
///
/// # Errors
/// As [`response`], [`periodic_response`], [`choose_order`] and [`fit_armax`].
pub fn identify_structure(samples: &Samples, options: &StructureOptions) -> Result<Structure, LinearError> {
    require_one_period(samples)?;
    let nyquist = 0.5 / samples.period;
    let welch = response(samples, &WelchOptions { window_s: options.window_s })?;
    let band_hz = options.band_hz.or_else(|| band_of(&welch)).unwrap_or(nyquist).min(nyquist);
    let response = match options.period_s {
        Some(period_s) => periodic_response(samples, period_s)?,
        None => welch,
    };
    let fewer = decimate(samples, band_hz);
    let (model, orders, reason) = match &options.order {
        Order::Auto(orders) => {
            let choice = choose_order(&fewer.samples, orders, options.delay)?;
            (choice.model, choice.table, choice.reason)
        }
        Order::Fixed(order) => {
            let model = fit_armax(&fewer.samples, &ArmaxOptions { order: *order, delay: options.delay })?;
            (model, Vec::new(), "given".to_owned())
        }
    };
    let simulated = model.simulate(&fewer.samples)?;
    let output = &fewer.samples.output;
    let mean = output.iter().sum::<f64>() / output.len() as f64;
    let missed = output.iter().zip(&simulated).map(|(y, s)| (y - s).powi(2)).sum::<f64>();
    let moved = output.iter().map(|y| (y - mean).powi(2)).sum::<f64>();
    Ok(Structure {
        response,
        band_hz,
        factor: fewer.factor,
        modes: model.modes()?,
        zeros: model.zeros()?,
        model,
        orders,
        reason,
        simulation_share: (missed / moved).sqrt(),
    })
}
