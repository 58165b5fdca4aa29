//! What each effect can add to the output: its mark with typical parameters, and the nodes around which it may imitate others.

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

/// Typical figures. Times and frequencies of an actuator, as far as its samples show them.
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
const TONE: f64 = 0.005;
/// What a drifting sensor goes in a record, as a share of span.
const DRIFT: f64 = 0.02;
/// What the load that is put on moves, as a share of span.
const LOAD: f64 = 0.02;
/// Relative change of gain per kelvin.
const PER_KELVIN: f64 = 0.005;
/// Time constants of the creep bank \[s\] and the share of each.
const CREEP: [f64; 6] = [0.1, 0.32, 1.0, 3.2, 10.0, 32.0];
const CREEP_SHARE: f64 = 0.006;
/// Dead zones of the curve behind the hysteresis, as shares of the greatest output.
const ZONES: [f64; 4] = [0.2, 0.4, 0.6, 0.8];

/// One effect on one drive.
pub(super) struct Family {
    suspect: Effect,
    mark: DVector<f64>,
    nodes: Vec<Node>,
}

impl Family {
    pub(super) fn new(rig: &Rig, suspect: Effect) -> Self {
        let typical = Typical::at(rig.period);
        let column = |values: Vec<f64>| rig.left_by_the_loop(values);
        let linear = |values: Vec<Vec<f64>>| vec![Node::linear(values.into_iter().map(column).collect())];
        let (mark, nodes) = match suspect {
            Effect::Delay | Effect::Lag | Effect::RateDependence => {
                let add = |seconds: f64| timing(rig, suspect, seconds);
                let grid = [0.2, 0.35, 0.6, 1.0, 1.7, 3.0, 5.0, 8.5];
                (add(typical.time), grid.map(|g| along(&add, g * typical.time)).into_iter().collect())
            }
            Effect::Resonance => (resonance(rig, typical.mode), modes(rig, typical.mode)),
            Effect::Saturation => {
                let top = rig.plain.iter().copied().fold(0.0, f64::max);
                let add = |high: f64, knee: f64| saturation(rig, high * top, knee);
                (add(1.0, 0.1), ends(&add))
            }
            Effect::Asymmetry => {
                let columns = zones(rig);
                (&columns[1] * 0.05 + &columns[2] * 0.05, vec![Node::linear(columns)])
            }
            Effect::Creep => {
                let columns: Vec<_> = CREEP.iter().filter_map(|tau| creep(rig, *tau)).collect();
                let mark = columns.iter().fold(DVector::zeros(rig.rows()), |sum, c| sum + c * CREEP_SHARE);
                (mark, vec![Node::linear(columns)])
            }
            Effect::Temperature => {
                let by = |f: &dyn Fn(usize) -> f64| (0..rig.rows()).map(|t| rig.plain[t] * f(t)).collect::<Vec<f64>>();
                let kelvin = rig.temperature();
                let mark = column(by(&|t| PER_KELVIN * kelvin[t]));
                // A temperature that nobody measures is any slow function of time.
                let unknown = || (1..=SLOW).map(|k| by(&|t| slow(rig, k, t))).collect();
                (mark, linear(if rig.thermometer { vec![by(&|t| kelvin[t])] } else { unknown() }))
            }
            Effect::Load => {
                let load = rig.load();
                let unknown =
                    || (1..=SLOW).map(|k| (0..rig.rows()).map(|t| slow(rig, k, t)).collect::<Vec<f64>>()).collect();
                let mark = column(load.iter().map(|f| LOAD * f).collect());
                (mark, linear(if rig.load_cell { vec![load] } else { unknown() }))
            }
            Effect::Drift => {
                let end = rig.times.last().copied().unwrap_or(1.0).max(f64::MIN_POSITIVE);
                let ramp: Vec<f64> = rig.times.iter().map(|t| t / end).collect();
                (column(ramp.clone()) * DRIFT, linear(vec![ramp]))
            }
            Effect::Interference => {
                let tone =
                    InterferenceParams { hz: typical.tone_hz, amplitude: TONE, phase: 0.7, ..Default::default() };
                let mark = rig.added(0.0, &Effects { interference: Some(tone), ..Effects::default() });
                // What it can imitate depends on the frequencies of the other's mark.
                (mark.unwrap_or_else(|| DVector::zeros(rig.rows())), Vec::new())
            }
        };
        Self { suspect, mark, nodes }
    }

    /// What it adds to the output with typical parameters, without what a fit of the loop takes away.
    pub(super) fn mark(&self) -> &DVector<f64> {
        &self.mark
    }

    /// Root mean square of what this effect, at its best, misses of another's mark.
    pub(super) fn cannot_imitate(&self, rig: &Rig, mark: &DVector<f64>) -> f64 {
        let absent = mark.norm() / (mark.len().max(1) as f64).sqrt();
        let least = |nodes: &[Node]| nodes.iter().map(|node| node.misses(mark)).fold(absent, f64::min);
        if self.suspect == Effect::Interference { least(&tones(rig, mark)) } else { least(&self.nodes) }
    }
}

/// Slow functions that stand for surroundings that nobody measures.
const SLOW: usize = 8;

/// The k-th slow function of time.
fn slow(rig: &Rig, k: usize, t: usize) -> f64 {
    let end = rig.times.last().copied().unwrap_or(1.0).max(f64::MIN_POSITIVE);
    // The straight line first: a cosine series takes many terms for one.
    if k == 1 { rig.times[t] / end } else { (PI * (k - 1) as f64 * rig.times[t] / end).cos() }
}

/// The node at one value of an effect's only parameter.
fn along(add: &dyn Fn(f64) -> DVector<f64>, at: f64) -> Node {
    let step = 0.05 * at;
    let slope = (add(at + step) - add(at - step)) / (2.0 * step);
    Node { offset: add(at), columns: vec![(slope, 0.4 * at)] }
}

fn or_nothing(rig: &Rig, added: Option<DVector<f64>>) -> DVector<f64> {
    added.unwrap_or_else(|| DVector::zeros(rig.rows()))
}

fn timing(rig: &Rig, suspect: Effect, seconds: f64) -> DVector<f64> {
    let none = Effects::default();
    let added = match suspect {
        Effect::Delay => rig.added(0.0, &Effects { delay: Some(DelayParams { seconds }), ..none }),
        Effect::Lag => rig.added(0.0, &Effects { lag: Some(LagParams { seconds }), ..none }),
        _ => rig.added(seconds, &none),
    };
    or_nothing(rig, added)
}

fn resonance(rig: &Rig, mode: ResonanceParams) -> DVector<f64> {
    or_nothing(rig, rig.added(0.0, &Effects { resonances: [Some(mode), None], ..Effects::default() }))
}

/// Modes of any gain at frequencies and damping ratios between which the derivatives lead.
fn modes(rig: &Rig, typical: ResonanceParams) -> Vec<Node> {
    let highest = 0.4 / rig.period;
    let hz = [0.2, 0.3, 0.45, 0.67, 1.0, 1.5, 2.2].map(|g| g * typical.hz);
    let mut nodes = Vec::new();
    for hz in hz.into_iter().filter(|hz| *hz < highest) {
        for damping in [0.02, 0.1, 0.4] {
            let at = |hz: f64, damping: f64| resonance(rig, ResonanceParams { hz, damping, gain: 1.0 });
            let by_hz = (at(1.01 * hz, damping) - at(0.99 * hz, damping)) / 0.02;
            let by_damping = (at(hz, 1.05 * damping) - at(hz, 0.95 * damping)) / 0.1;
            // Linear in the gain; relative steps of the two others, each times the gain.
            nodes.push(Node::linear(vec![at(hz, damping), by_hz, by_damping]));
        }
    }
    nodes
}

fn saturation(rig: &Rig, high: f64, knee: f64) -> DVector<f64> {
    let stop = SaturationParams { low: high - 2.0, high, knee };
    or_nothing(rig, rig.added(0.0, &Effects { saturation: Some(stop), ..Effects::default() }))
}

/// Stops at several places with knees of several widths.
fn ends(add: &dyn Fn(f64, f64) -> DVector<f64>) -> Vec<Node> {
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

/// What each dead zone adds with a weight of one.
fn zones(rig: &Rig) -> Vec<DVector<f64>> {
    let top = rig.plain.iter().copied().fold(0.0, f64::max);
    let zone = |share: f64| {
        let curve = AsymmetryParams::behind(vec![share * top], vec![1.0]);
        or_nothing(rig, rig.added(0.0, &Effects { asymmetry: Some(curve), ..Effects::default() }))
    };
    ZONES.map(zone).into_iter().collect()
}

/// What one creep element adds with a share of one.
fn creep(rig: &Rig, tau: f64) -> Option<DVector<f64>> {
    let bank = CreepParams { seconds: vec![tau], shares: vec![1.0] };
    rig.added(0.0, &Effects { creep: Some(bank), ..Effects::default() })
}

/// Tones at the strongest frequencies of a mark, on the lab's clock.
fn tones(rig: &Rig, mark: &DVector<f64>) -> Vec<Node> {
    let length = (2 * rig.rows()).next_power_of_two();
    let fft = RealFftPlanner::<f64>::new().plan_fft_forward(length);
    let (mut padded, mut spectrum) = (fft.make_input_vec(), fft.make_output_vec());
    padded.iter_mut().zip(mark.iter()).for_each(|(p, m)| *p = *m);
    // Lengths are the planner's own: this cannot fail.
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
            rig.left_by_the_loop(rig.times.iter().map(|t| f(TAU * (hz * t).fract(), t - middle)).collect())
        };
        // The last two turn the tone's frequency a little.
        Node::linear(vec![
            of(&|angle, _| angle.cos()),
            of(&|angle, _| angle.sin()),
            of(&|angle, t| t * angle.cos()),
            of(&|angle, t| t * angle.sin()),
        ])
    };
    peaks.into_iter().map(node).collect()
}
