//! The controller of a device: feedforward with the inverse of a model.
//!
//! A PID and a force observer are optional.

use heapless::Deque;
use hyst_core::{
    Build, Chain, Compensator, CompensatorOptions, Env, ForceObserver, OperatorParams, Pi, PidParams, Sampling, Stage,
    Tracking, TrackingState,
};

use super::board::Shown;
use super::control::Control;
use super::recipe::{self, MOST_ELEMENTS, MOST_PLAYS, Recipe};

/// Maximum dead time of a model on a device (samples).
const MAX_DELAY: usize = 32;
/// Maximum number of taps of a preview filter on a device.
const MAX_TAPS: usize = 257;
/// Maximum delay between reference and output, caused by the preview of the inverse (samples).
const MAX_LEAD: usize = 320;

type Actuator = Chain<f32, Pi<f32, MOST_PLAYS>, MAX_DELAY, MOST_ELEMENTS>;
type Inverse = Compensator<f32, Pi<f32, MOST_PLAYS>, MAX_DELAY, MOST_ELEMENTS, MAX_TAPS>;
type Loop = Tracking<f32, Inverse, MAX_LEAD>;
type Observer = ForceObserver<f32, Actuator>;

/// Follows references with a model of play operators and effects.
///
/// All arithmetic is `f32`, in `hyst-core`, so a host computes the same bits.
#[derive(Debug, Default)]
pub struct Follower {
    recipe: Option<Recipe>,
    running: Option<Running>,
    force_estimate: Option<ForceEstimate>,
}

#[derive(Debug)]
struct ForceEstimate {
    observer: Observer,
    state: <Actuator as Stage<f32>>::State,
    /// Force estimate at the begin of the run, which counts as zero \[N\].
    zero_force: f32,
}

impl ForceEstimate {
    fn new(recipe: &Recipe, period: f32) -> Option<Self> {
        let chain = actuator(recipe, &Sampling { period: f64::from(period) })?;
        let state = chain.state();
        Some(Self { observer: recipe.force?.observer(chain).ok()?, state, zero_force: 0.0 })
    }
}

#[derive(Debug)]
struct Running {
    tracking: Loop,
    state: TrackingState<f32, <Inverse as Stage<f32>>::State, MAX_LEAD>,
    lead: usize,
    /// References that are not yet due.
    ///
    /// An output that is measured together with a reference belongs to the previous reference.
    pending: Deque<f32, MAX_LEAD>,
    due: f32,
    /// Largest error that does not count as saturation \[output unit\]; see [`SATURATION_TOLERANCE`].
    tolerance: f32,
    limited: bool,
}

/// Error that does not count as saturation, as a share of the model's travel.
///
/// References may reach the ends of the range.
pub const SATURATION_TOLERANCE: f64 = 0.02;

impl Running {
    /// Builds the loop for a sample period \[s\], before its first reference.
    fn new(recipe: &Recipe, period: f32) -> Option<Self> {
        let (tracking, lead) = Follower::build_loop(recipe, period)?;
        let OperatorParams::Pi(pi) = &recipe.model.operator else { return None };
        let [low, high] = recipe.model.input;
        let slope = pi.gain + pi.weights.iter().sum::<f64>();
        let tolerance = (SATURATION_TOLERANCE * (slope * (high - low)).abs()) as f32;
        let state = tracking.state();
        Some(Self { tracking, state, lead, pending: Deque::new(), due: 0.0, tolerance, limited: false })
    }
}

impl Follower {
    /// Returns a follower without a model.
    pub const fn new() -> Self {
        Self { recipe: None, running: None, force_estimate: None }
    }

    /// Builds the loop for a sample period \[s\].
    ///
    /// `None` if it is too large for this device, or if no such loop exists.
    fn build_loop(recipe: &Recipe, period: f32) -> Option<(Loop, usize)> {
        let sampling = Sampling { period: f64::from(period) };
        let chain = actuator(recipe, &sampling)?;
        let inverse: Inverse = chain.compensator(&sampling, &CompensatorOptions::default()).ok()?;
        let lead = inverse.lead();
        let [low, high] = recipe.model.input;
        let no_feedback = PidParams {
            proportional: 0.0,
            integral: 0.0,
            derivative: 0.0,
            derivative_hz: 1.0,
            proportional_weight: 0.0,
            derivative_weight: 0.0,
            anti_windup_seconds: 1.0,
            low,
            high,
        };
        let pid = recipe.pid.unwrap_or(no_feedback).build(&sampling).ok()?;
        // The output at the end of a period is the effect of the previous drive.
        Some((Tracking::new(inverse, lead + 1, pid).ok()?, lead))
    }
}

/// Builds the model for a sample period; `None` if it is too large for this device.
fn actuator(recipe: &Recipe, sampling: &Sampling) -> Option<Actuator> {
    let OperatorParams::Pi(pi) = &recipe.model.operator else { return None };
    let pi: Pi<f32, MOST_PLAYS> = pi.build(&()).ok()?;
    recipe.model.around(pi, sampling).ok()
}

/// Returns the delay between reference and output (samples), caused by the preview of the inverse.
///
/// `bytes` is a recipe, `period` the sample period \[s\]. `None` if a device of this kind cannot run it.
pub fn lateness(bytes: &[u8], period: f32) -> Option<usize> {
    let recipe = recipe::read(bytes).ok()?;
    Follower::build_loop(&recipe, period).map(|(_, lead)| lead)
}

fn env(shown: &Shown) -> Env<f32> {
    Env { time: 0.0, temperature: shown.temperature_degc, load: shown.load_n }
}

/// The same as [`env()`] without load, because the observer estimates the load.
fn unloaded_env(shown: &Shown) -> Env<f32> {
    Env { load: 0.0, ..env(shown) }
}

impl Control for Follower {
    fn load(&mut self, bytes: &[u8]) -> bool {
        (self.running, self.force_estimate) = (None, None);
        self.recipe = recipe::read(bytes).ok().filter(|r| matches!(r.model.operator, OperatorParams::Pi(_)));
        self.recipe.is_some()
    }

    fn ready(&self) -> bool {
        self.recipe.is_some()
    }

    fn prepare(&mut self, period: f32, shown: &Shown, volts: f32, force: bool) -> bool {
        self.force_estimate =
            self.recipe.as_ref().filter(|_| force).and_then(|recipe| ForceEstimate::new(recipe, period));
        if let Some(ForceEstimate { observer, state, zero_force }) = &mut self.force_estimate {
            *zero_force = observer.reset(state, &unloaded_env(shown), volts, shown.output);
        }
        self.running = self.recipe.as_ref().and_then(|recipe| Running::new(recipe, period));
        self.running.is_some()
    }

    fn force(&mut self, volts: f32, shown: &Shown) -> Option<f32> {
        let ForceEstimate { observer, state, zero_force } = self.force_estimate.as_mut()?;
        Some(observer.step(state, &unloaded_env(shown), volts, shown.output) - *zero_force)
    }

    fn begin(&mut self, reference: f32, shown: &Shown, volts: f32) {
        let corrects = self.recipe.as_ref().is_some_and(|r| r.pid.is_some());
        let Some(Running { tracking, state, due, .. }) = &mut self.running else { return };
        if corrects {
            tracking.reset(state, &env(shown), reference, shown.output, volts);
        } else {
            // Without a PID an initial offset would remain. So the drive goes to the feedforward value, at the slew
            // limit.
            tracking.reset_to_feedforward(state, &env(shown), reference);
        }
        *due = reference;
    }

    fn step(&mut self, reference: f32, shown: &Shown) -> f32 {
        let Some(run) = &mut self.running else { return f32::NAN };
        // There is room: the preview of a loop is at most `MAX_LEAD`.
        let _ = run.pending.push_back(reference);
        if run.pending.len() > run.lead + 1 {
            run.due = run.pending.pop_front().unwrap_or(run.due);
        }
        let drive = run.tracking.step(&mut run.state, &env(shown), reference, shown.output);
        let away = (run.due - shown.output).abs() > run.tolerance;
        run.limited = away && run.state.pid().limited();
        drive
    }

    fn applied(&mut self, volts: f32) {
        if let Some(Running { tracking, state, .. }) = &mut self.running {
            tracking.applied(state, volts);
        }
    }

    fn limited(&self) -> bool {
        self.running.as_ref().is_some_and(|run| run.limited)
    }

    fn due(&self) -> Option<f32> {
        let run = self.running.as_ref()?;
        // The reference that becomes due now, once the queue is as long as the preview.
        Some(run.pending.front().filter(|_| run.pending.len() > run.lead).copied().unwrap_or(run.due))
    }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;
    use std::vec::Vec;

    use super::*;
    use crate::wire::{
        Ask, Board, Device, Exchange, Fault, Identity, Mode, Request, Start, State, Tell, Unit, recipe_head,
    };
    use hyst_core::{ChainParams, DelayParams, EffectParams, PiParams, write_block};
    use proptest::prelude::*;

    const GAIN: f32 = 0.2;

    /// An actuator that equals its model: a dead time and a gain.
    struct Perfect {
        waiting: VecDeque<f32>,
        dead: usize,
        /// Error of its sensor \[µm\].
        sensor_error: f32,
    }

    impl Board for Perfect {
        fn measure(&mut self) -> Shown {
            if self.waiting.len() > self.dead + 1 {
                self.waiting.pop_front();
            }
            Shown { output: GAIN * self.waiting[0] + self.sensor_error, temperature_degc: 0.0, load_n: 0.0 }
        }
        fn put_out(&mut self, volts: f32) {
            self.waiting.push_back(volts);
        }
    }

    fn identity() -> Identity {
        Identity {
            name: heapless::Vec::new(),
            min_v: 0.0,
            max_v: 100.0,
            rest_v: 0.0,
            max_slew_v_per_s: 1e5,
            min_rate_hz: 1000.0,
            max_rate_hz: 1000.0,
            output: Unit::Micrometre,
            temperature: false,
            load: false,
            follows: true,
            queue: 0,
            model: 0,
        }
    }

    /// Returns the state after 2 s of a run that follows 5 Hz with a permitted tracking error `error`.
    ///
    /// The actuator has a dead time of `dead` samples, and the sensor an offset of `sensor_error` \[µm\].
    fn ended(dead: usize, error: f32, sensor_error: f32) -> State {
        let model: ChainParams<Vec<f64>> = ChainParams {
            falls: false,
            operator: OperatorParams::Pi(PiParams {
                gain: f64::from(GAIN),
                thresholds: Vec::new(),
                weights: Vec::new(),
            }),
            effects: EffectParams {
                delay: (dead > 0).then_some(DelayParams { seconds: 1e-3 * dead as f64 }),
                ..EffectParams::default()
            },
            zero: 0.0,
            input: [0.0, 100.0],
        };
        let mut follower = Follower::new();
        let bytes = [&recipe_head(None, None)[..], write_block(&model, &mut [0; 1024]).unwrap()].concat();
        assert!(follower.load(&bytes));
        let mut device: Device<Follower, 1024, 1024> = Device::new(identity(), follower);
        let sum = crate::wire::model_sum(&bytes);
        for (part, offset) in bytes.chunks(64).zip((0..).step_by(64)) {
            let chunk =
                crate::wire::Chunk { offset, total: bytes.len() as u32, sum, bytes: part.iter().copied().collect() };
            device.answer(&Request { number: 1, ask: Ask::Model(chunk) });
        }
        let mut board = Perfect { waiting: core::iter::repeat_n(0.0, dead + 1).collect(), dead, sensor_error };
        let start = Start {
            session: 1,
            mode: Mode::Reference,
            rate_hz: 1000.0,
            low_v: 0.0,
            high_v: 100.0,
            slew_v_per_s: 1e5,
            hottest_degc: f32::INFINITY,
            error,
            silence_s: 5.0,
            force: false,
        };
        let Tell::Status(_) = device.answer(&Request { number: 2, ask: Ask::Start(start) }).tell else {
            panic!("it starts")
        };
        for k in 0..2000_u16 {
            // The references are sent one by one, as the device has room for them.
            let reference = 8.0 - 8.0 * (core::f32::consts::TAU * 5.0 * 1e-3 * f32::from(k)).cos();
            let heard = u32::from(k.saturating_sub(1));
            let drives = core::iter::once(reference).collect();
            let exchange = Exchange { session: 1, heard, first: u32::from(k), drives };
            device.answer(&Request { number: 3, ask: Ask::Exchange(exchange) });
            device.tick(&mut board);
        }
        device.state()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]

        /// An output is compared with the reference that caused it.
        ///
        /// One period earlier or later would be an error of 0.25 µm.
        #[test]
        fn an_exact_model_has_no_tracking_error(dead in 0..20_usize) {
            prop_assert_eq!(ended(dead, 0.01, 0.0), State::Running);
            prop_assert_eq!(ended(dead, 0.01, 0.02), State::Fault(Fault::TrackingError));
        }
    }
}
