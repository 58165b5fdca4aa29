//! Computes what each effect can add to the output: its signature with typical parameters, and the nodes near which it
//! may imitate other effects.

use std::f64::consts::{PI, TAU};

use hyst_core::{
    AsymmetryParams, CreepParams, DelayParams, EffectParams, InterferenceParams, LagParams, ResonanceParams,
    SaturationParams,
};
use nalgebra::DVector;
use realfft::RealFftPlanner;

use super::imitation::Node;
use super::rig::Rig;
use crate::model::Effect;

type Effects = EffectParams<Vec<f64>>;

/// Typical times and frequencies of an actuator, limited to what the sample period resolves.
struct Typical {
    /// Delay, lag and drag \[s\].
    time: f64,
    mode: ResonanceParams,
    tone_hz: f64,
}

impl Typical {
    fn at(period: f64) -> Self {
        Self {
            time: f64::max(1e-3, period),
            mode: ResonanceParams { hz: f64::min(150.0, 0.15 / period), damping: 0.02, gain: 0.5 },
            tone_hz: f64::min(50.0, 0.12 / period),
        }
    }
}

/// Amplitude of an interfering tone, as a share of span.
const TONE_SHARE: f64 = 0.005;
/// Drift of the sensor over a record, as a share of span.
const DRIFT_SHARE: f64 = 0.02;
/// Deflection by the applied load, as a share of span.
const LOAD_SHARE: f64 = 0.02;
/// Relative change of gain per kelvin.
const PER_KELVIN: f64 = 0.005;
/// Time constants of the creep bank \[s\] and the share of each.
const CREEP: [f64; 6] = [0.1, 0.32, 1.0, 3.2, 10.0, 32.0];
const CREEP_SHARE: f64 = 0.006;
/// Dead zones of the curve after the hysteresis, as shares of the maximum output.
const ZONES: [f64; 4] = [0.2, 0.4, 0.6, 0.8];

/// One effect on one drive.
pub(super) struct Family {
    effect: Effect,
    signature: DVector<f64>,
    nodes: Vec<Node>,
}

impl Family {
    pub(super) fn new(rig: &Rig, effect: Effect) -> Self {
        let typical = Typical::at(rig.period);
        let column = |values: Vec<f64>| rig.loop_residual(values);
        let linear = |values: Vec<Vec<f64>>| vec![Node::linear(values.into_iter().map(column).collect())];
        let (signature, nodes) = match effect {
            Effect::Delay | Effect::Lag | Effect::RateDependence => {
                let add = |seconds: f64| timing(rig, effect, seconds);
                let grid = [0.2, 0.35, 0.6, 1.0, 1.7, 3.0, 5.0, 8.5];
                (add(typical.time), grid.map(|g| node_at(&add, g * typical.time)).into_iter().collect())
            }
            Effect::Resonance => (resonance(rig, typical.mode), modes(rig, typical.mode)),
            Effect::Saturation => {
                let top = rig.base_output.iter().copied().fold(0.0, f64::max);
                let add = |high: f64, knee: f64| saturation(rig, high * top, knee);
                (add(1.0, 0.1), stops(&add))
            }
            Effect::Asymmetry => {
                let columns = zones(rig);
                (&columns[1] * 0.05 + &columns[2] * 0.05, vec![Node::linear(columns)])
            }
            Effect::Creep => {
                let columns: Vec<_> = CREEP.iter().filter_map(|tau| creep(rig, *tau)).collect();
                let signature = columns.iter().fold(DVector::zeros(rig.rows()), |sum, c| sum + c * CREEP_SHARE);
                (signature, vec![Node::linear(columns)])
            }
            Effect::Temperature => {
                let by =
                    |f: &dyn Fn(usize) -> f64| (0..rig.rows()).map(|t| rig.base_output[t] * f(t)).collect::<Vec<f64>>();
                let kelvin = rig.temperature();
                let signature = column(by(&|t| PER_KELVIN * kelvin[t]));
                // An unmeasured temperature can be any slow function of time.
                let unknown = || (1..=SLOW_FUNCTIONS).map(|k| by(&|t| slow(rig, k, t))).collect();
                (signature, linear(if rig.thermometer { vec![by(&|t| kelvin[t])] } else { unknown() }))
            }
            Effect::Load => {
                let load = rig.load();
                let unknown = || {
                    (1..=SLOW_FUNCTIONS)
                        .map(|k| (0..rig.rows()).map(|t| slow(rig, k, t)).collect::<Vec<f64>>())
                        .collect()
                };
                let signature = column(load.iter().map(|f| LOAD_SHARE * f).collect());
                (signature, linear(if rig.load_cell { vec![load] } else { unknown() }))
            }
            Effect::Drift => {
                let end = rig.times.last().copied().unwrap_or(1.0).max(f64::MIN_POSITIVE);
                let ramp: Vec<f64> = rig.times.iter().map(|t| t / end).collect();
                (column(ramp.clone()) * DRIFT_SHARE, linear(vec![ramp]))
            }
            Effect::Interference => {
                let tone =
                    InterferenceParams { hz: typical.tone_hz, amplitude: TONE_SHARE, phase: 0.7, ..Default::default() };
                let signature = rig.added(0.0, &Effects { interference: Some(tone), ..Effects::default() });
                // The nodes depend on the frequencies of the other effect's signature.
                (signature.unwrap_or_else(|| DVector::zeros(rig.rows())), Vec::new())
            }
        };
        Self { effect, signature, nodes }
    }

    /// Returns the contribution to the output with typical parameters, after a fit of the loop.
    pub(super) fn signature(&self) -> &DVector<f64> {
        &self.signature
    }

    /// Returns the RMS residual of another effect's signature after the best imitation by this effect.
    pub(super) fn imitation_residual(&self, rig: &Rig, signature: &DVector<f64>) -> f64 {
        let absent = signature.norm() / (signature.len().max(1) as f64).sqrt();
        let least = |nodes: &[Node]| nodes.iter().map(|node| node.residual_rms(signature)).fold(absent, f64::min);
        if self.effect == Effect::Interference { least(&tones(rig, signature)) } else { least(&self.nodes) }
    }
}

/// Number of slow functions of time that represent unmeasured surroundings.
const SLOW_FUNCTIONS: usize = 8;

/// Returns the k-th slow function of time.
fn slow(rig: &Rig, k: usize, t: usize) -> f64 {
    let end = rig.times.last().copied().unwrap_or(1.0).max(f64::MIN_POSITIVE);
    // The first is a straight line, because a cosine series needs many terms for it.
    if k == 1 { rig.times[t] / end } else { (PI * (k - 1) as f64 * rig.times[t] / end).cos() }
}

/// Returns the node at one value of an effect's only parameter.
fn node_at(add: &dyn Fn(f64) -> DVector<f64>, at: f64) -> Node {
    let step = 0.05 * at;
    let slope = (add(at + step) - add(at - step)) / (2.0 * step);
    Node { offset: add(at), columns: vec![(slope, 0.4 * at)] }
}

fn or_zero(rig: &Rig, added: Option<DVector<f64>>) -> DVector<f64> {
    added.unwrap_or_else(|| DVector::zeros(rig.rows()))
}

fn timing(rig: &Rig, effect: Effect, seconds: f64) -> DVector<f64> {
    let none = Effects::default();
    let added = match effect {
        Effect::Delay => rig.added(0.0, &Effects { delay: Some(DelayParams { seconds }), ..none }),
        Effect::Lag => rig.added(0.0, &Effects { lag: Some(LagParams { seconds }), ..none }),
        _ => rig.added(seconds, &none),
    };
    or_zero(rig, added)
}

fn resonance(rig: &Rig, mode: ResonanceParams) -> DVector<f64> {
    or_zero(rig, rig.added(0.0, &Effects { resonances: [Some(mode), None], ..Effects::default() }))
}

/// Returns nodes of modes of any gain, at frequencies and damping ratios close enough for the derivatives.
fn modes(rig: &Rig, typical: ResonanceParams) -> Vec<Node> {
    let highest = 0.4 / rig.period;
    let hz = [0.2, 0.3, 0.45, 0.67, 1.0, 1.5, 2.2].map(|g| g * typical.hz);
    let mut nodes = Vec::new();
    for hz in hz.into_iter().filter(|hz| *hz < highest) {
        for damping in [0.02, 0.1, 0.4] {
            let at = |hz: f64, damping: f64| resonance(rig, ResonanceParams { hz, damping, gain: 1.0 });
            let by_hz = (at(1.01 * hz, damping) - at(0.99 * hz, damping)) / 0.02;
            let by_damping = (at(hz, 1.05 * damping) - at(hz, 0.95 * damping)) / 0.1;
            // Linear in the gain; the other two columns are relative steps times the gain.
            nodes.push(Node::linear(vec![at(hz, damping), by_hz, by_damping]));
        }
    }
    nodes
}

fn saturation(rig: &Rig, high: f64, knee: f64) -> DVector<f64> {
    let stop = SaturationParams::behind(high - 2.0, high, knee);
    or_zero(rig, rig.added(0.0, &Effects { saturation: Some(stop), ..Effects::default() }))
}

/// Returns nodes of stops at several levels with several knee widths.
fn stops(add: &dyn Fn(f64, f64) -> DVector<f64>) -> Vec<Node> {
    let mut nodes = Vec::new();
    for high in [0.85, 0.92, 1.0, 1.08, 1.18] {
        for knee in [0.03, 0.08, 0.16] {
            let by_high = (add(high + 0.01, knee) - add(high - 0.01, knee)) / 0.02;
            let by_knee = (add(high, knee + 0.01) - add(high, knee - 0.01)) / 0.02;
            nodes.push(Node { offset: add(high, knee), columns: vec![(by_high, 0.05), (by_knee, 0.5 * knee)] });
        }
    }
    nodes
}

/// Returns the contribution of each dead zone with a weight of 1.
fn zones(rig: &Rig) -> Vec<DVector<f64>> {
    let top = rig.base_output.iter().copied().fold(0.0, f64::max);
    let zone = |share: f64| {
        let curve = AsymmetryParams::behind(vec![share * top], vec![1.0]);
        or_zero(rig, rig.added(0.0, &Effects { asymmetry: Some(curve), ..Effects::default() }))
    };
    ZONES.map(zone).into_iter().collect()
}

/// Returns the contribution of one creep element with a share of 1.
fn creep(rig: &Rig, tau: f64) -> Option<DVector<f64>> {
    let bank = CreepParams { seconds: vec![tau], shares: vec![1.0] };
    rig.added(0.0, &Effects { creep: Some(bank), ..Effects::default() })
}

/// Returns nodes of tones at the strongest frequencies of a signature.
fn tones(rig: &Rig, signature: &DVector<f64>) -> Vec<Node> {
    let length = (2 * rig.rows()).next_power_of_two();
    let fft = RealFftPlanner::<f64>::new().plan_fft_forward(length);
    let (mut padded, mut spectrum) = (fft.make_input_vec(), fft.make_output_vec());
    padded.iter_mut().zip(signature.iter()).for_each(|(p, m)| *p = *m);
    // Cannot fail: the lengths come from the planner.
    let _ = fft.process(&mut padded, &mut spectrum);
    let power: Vec<f64> = spectrum.iter().map(|c| c.norm_sqr()).collect();
    let mut peaks: Vec<usize> =
        (1..power.len() - 1).filter(|i| power[*i] >= power[i - 1] && power[*i] > power[i + 1]).collect();
    peaks.sort_by(|a, b| power[*b].total_cmp(&power[*a]));
    peaks.truncate(6);
    let middle = 0.5 * rig.times.last().copied().unwrap_or(0.0);
    let node = |peak: usize| {
        let hz = peak as f64 / (length as f64 * rig.period);
        let of = |f: &dyn Fn(f64, f64) -> f64| {
            rig.loop_residual(rig.times.iter().map(|t| f(TAU * (hz * t).fract(), t - middle)).collect())
        };
        // The last two columns are a small change of the frequency.
        Node::linear(vec![
            of(&|angle, _| angle.cos()),
            of(&|angle, _| angle.sin()),
            of(&|angle, t| t * angle.cos()),
            of(&|angle, t| t * angle.sin()),
        ])
    };
    peaks.into_iter().map(node).collect()
}
