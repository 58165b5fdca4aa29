//! Five activation-function models and Bouc-Wen on sines of three voltages and eight frequencies, after Xie et al.
//! (Tables 2 to 7, Figures 6 to 11), on a simulated actuator of random relays.

use std::f64::consts::TAU;
use std::ops::ControlFlow;

use hyst_hw::{Actuator, Bed, Plant, PlantConfig, Sensor, Viscosity};
use hyst_ident::compare::{Compared, compare};
use hyst_ident::fit::{FitOptions, Optimizer};
use hyst_ident::model::Kind;
use hyst_ident::record::OutputUnit;

use crate::measured;

/// Rows per second.
const RATE: f64 = 10_000.0;
/// Cycles of each sine, as in the paper.
const CYCLES: f64 = 5.0;
/// Highest voltages \[V\]; the lowest is 0.
pub const VOLTS: [f64; 3] = [20.0, 40.0, 60.0];
/// Frequencies \[Hz\].
pub const HERTZ: [f64; 8] = [10.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0, 80.0];
/// The paper's models in its order, and the model with which it compares them.
pub const MODELS: [Kind; 6] = [Kind::Atan, Kind::Sigmoid, Kind::Softplus, Kind::Softsign, Kind::Tanh, Kind::BoucWen];
/// 30 particles × 200 iterations.
pub const PAPERS_EVALUATIONS: u64 = 6000;

/// One voltage at one frequency.
#[derive(Clone, Debug)]
pub struct Case {
    /// Highest voltage \[V\].
    pub volts: f64,
    /// Frequency \[Hz\].
    pub hz: f64,
    /// The models in the order of [`MODELS`].
    pub models: Vec<Compared>,
}

/// Returns an actuator with 0.145 µm/V, as in the paper; its loop widens slightly with frequency.
fn actuator(seed: u64) -> PlantConfig {
    let actuator = Actuator {
        min_v: 0.0,
        max_v: 60.0,
        rest_v: 0.0,
        gain_um_per_v: 0.145,
        loop_share: 0.1,
        bed: Bed::Relays,
        relays: 15_000,
    };
    let sensor = Sensor { range_um: [-2.0, 12.0], bits: 16, noise_um: 0.001, offset_um: 0.0, max_rate_hz: 20_000.0 };
    PlantConfig { viscosity: Some(Viscosity { volt_seconds: 1e-3 }), ..PlantConfig::bare(seed, actuator, sensor) }
}

/// Runs the 24 cases on the actuator of a seed. Each model is fitted to each case separately; the paper's particle
/// swarm searches its nonlinear parameters.
///
/// # Panics
/// If one of the steps fails.
pub fn run(seed: u64, evaluations: u64) -> Vec<Case> {
    let mut plant = Plant::new(actuator(seed)).expect("the actuator is valid");
    let options = FitOptions {
        seed,
        optimizer: Optimizer::Search("pso-xie".into()),
        evaluations: Some(evaluations),
        ..FitOptions::default()
    };
    let cases = VOLTS.into_iter().flat_map(|volts| HERTZ.map(|hz| (volts, hz)));
    cases
        .map(|(volts, hz)| {
            let rows = (CYCLES / hz * RATE) as usize;
            let drive: Vec<f64> =
                (0..=rows).map(|k| volts * (0.5 - 0.5 * (TAU * hz * k as f64 / RATE).cos())).collect();
            let record = measured(&mut plant, &[&drive], RATE, OutputUnit::Micrometre, &format!("{volts} V, {hz} Hz"));
            let comparison = compare(&record, None, &MODELS, &options, &mut |_| ControlFlow::Continue(()));
            let mut models = comparison.expect("the record suits the models").models;
            models.sort_by_key(|m| MODELS.iter().position(|kind| *kind == m.kind));
            Case { volts, hz, models }
        })
        .collect()
}

/// Returns the kinds, sorted by RMSE.
pub fn ranking(case: &Case) -> Vec<Kind> {
    let mut order: Vec<&Compared> = case.models.iter().collect();
    order.sort_by(|a, b| a.train.errors.rmse.total_cmp(&b.train.errors.rmse));
    order.iter().map(|m| m.kind).collect()
}
