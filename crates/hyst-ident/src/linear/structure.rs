//! Identifies the modes of a structure from a record.

use super::{
    Armax, ArmaxOptions, Delay, FrequencyResponse, LinearError, Mode, Order, OrderRow, WelchOptions, Zero, band_of,
    choose_order, decimate, fit_armax, periodic_response, response,
};
use crate::Samples;
use crate::linear::error::require_one_period;

/// Options of [`identify_structure`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StructureOptions {
    /// Order of the model.
    pub order: Order,
    /// Delay of the input, in rows after decimation.
    pub delay: Delay,
    /// Highest frequency of the model \[Hz\]; if not given, that of [`band_of`].
    pub band_hz: Option<f64>,
    /// Length of the Welch windows \[s\].
    pub window_s: Option<f64>,
    /// Period of the drive \[s\], for averages over periods instead of Welch's method.
    pub period_s: Option<f64>,
}

/// A structure identified from a record.
#[derive(Clone, Debug)]
pub struct Structure {
    /// The frequency response.
    pub response: FrequencyResponse,
    /// Highest frequency of the fit of the model \[Hz\].
    pub band_hz: f64,
    /// Decimation factor for that band.
    pub factor: usize,
    /// The model.
    pub model: Armax,
    /// Modes of the model, from the lowest frequency up.
    pub modes: Vec<Mode>,
    /// Zeros of the model.
    pub zeros: Vec<Zero>,
    /// Comparison of orders; empty if the order was given.
    pub orders: Vec<OrderRow>,
    /// Reason for this order.
    pub reason: String,
    /// RMS error of a simulation from the input only, divided by the standard deviation of the output.
    pub simulation_share: f64,
}

/// Estimates the response, reduces the record to the band of the drive, and fits an ARMAX model.
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
    let decimated = decimate(samples, band_hz);
    let (model, orders, reason) = match &options.order {
        Order::Auto(orders) => {
            let choice = choose_order(&decimated.samples, orders, options.delay)?;
            (choice.model, choice.table, choice.reason)
        }
        Order::Fixed(order) => {
            let model = fit_armax(&decimated.samples, &ArmaxOptions { order: *order, delay: options.delay })?;
            (model, Vec::new(), "given".to_owned())
        }
    };
    let simulated = model.simulate(&decimated.samples)?;
    let output = &decimated.samples.output;
    let mean = output.iter().sum::<f64>() / output.len() as f64;
    let squares = output.iter().zip(&simulated).map(|(y, s)| (y - s).powi(2)).sum::<f64>();
    let variation = output.iter().map(|y| (y - mean).powi(2)).sum::<f64>();
    Ok(Structure {
        response,
        band_hz,
        factor: decimated.factor,
        modes: model.modes()?,
        zeros: model.zeros()?,
        model,
        orders,
        reason,
        simulation_share: (squares / variation).sqrt(),
    })
}
