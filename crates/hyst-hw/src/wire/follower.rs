//! A model's inverse in front, a PID behind it and a force observer beside it: how a device follows references.

use heapless::Deque;
use hyst_core::{
    Build, Chain, Compensator, CompensatorOptions, Env, ForceObserver, OperatorParams, Pi, PidParams, Sampling, Stage,
    Tracking, TrackingState,
};

use super::device::{Control, Shown};
use super::recipe::{self, MOST_ELEMENTS, MOST_PLAYS, Recipe};

/// Samples of dead time that a device has room for.
const DELAY: usize = 32;
/// Taps of a preview filter that a device has room for.
const TAPS: usize = 257;
/// Samples by which a device may lag behind the references, because its inverse looks ahead.
const LEAD: usize = 320;

type Actuator = Chain<f32, Pi<f32, MOST_PLAYS>, DELAY, MOST_ELEMENTS>;
type Inverse = Compensator<f32, Pi<f32, MOST_PLAYS>, DELAY, MOST_ELEMENTS, TAPS>;
type Loop = Tracking<f32, Inverse, LEAD>;
type Observer = ForceObserver<f32, Actuator>;

/// Follows references with a model of plays and what surrounds them. All arithmetic is `f32`, in `hyst-core`: a host gets the same bits.
#[derive(Debug, Default)]
pub struct Follower {
    recipe: Option<Recipe>,
    running: Option<Running>,
    watching: Option<Watching>,
}

#[derive(Debug)]
struct Watching {
    observer: Observer,
    state: <Actuator as Stage<f32>>::State,
    /// What the observer says before anything acts: the sensor's zero of today \[N\].
    at_rest: f32,
}

impl Watching {
    fn new(recipe: &Recipe, period: f32) -> Option<Self> {
        let chain = actuator(recipe, &Sampling { period: f64::from(period) })?;
        let state = chain.state();
        Some(Self { observer: recipe.force?.observer(chain).ok()?, state, at_rest: 0.0 })
    }
}

#[derive(Debug)]
struct Running {
    tracking: Loop,
    state: TrackingState<f32, <Inverse as Stage<f32>>::State, LEAD>,
    lead: usize,
    /// References that are not due yet: the output that is measured with one of them belongs to the one before.
    early: Deque<f32, LEAD>,
    due: f32,
    /// A limit that leaves less than this is of no account: references may touch the ends of the range \[output unit\].
    tolerance: f32,
    limited: bool,
}

/// What a limit may leave of an error as of no account, as a share of the model's travel: references may touch the ends of the range.
pub const SATURATION_TOLERANCE: f64 = 0.02;

impl Running {
    /// The loop at a sample period \[s\], before its first reference.
    fn new(recipe: &Recipe, period: f32) -> Option<Self> {
        let (tracking, lead) = Follower::built(recipe, period)?;
        let OperatorParams::Pi(pi) = &recipe.model.operator else { return None };
        let [low, high] = recipe.model.input;
        let slope = pi.gain + pi.weights.iter().sum::<f64>();
        let tolerance = (SATURATION_TOLERANCE * (slope * (high - low)).abs()) as f32;
        let state = tracking.state();
        Some(Self { tracking, state, lead, early: Deque::new(), due: 0.0, tolerance, limited: false })
    }
}

impl Follower {
    /// Without a model.
    pub const fn new() -> Self {
        Self { recipe: None, running: None, watching: None }
    }

    /// The loop at a sample period \[s\]. `None` where this device has no room for it, or where there is no such loop.
    fn built(recipe: &Recipe, period: f32) -> Option<(Loop, usize)> {
        let sampling = Sampling { period: f64::from(period) };
        let chain = actuator(recipe, &sampling)?;
        let inverse: Inverse = chain.compensator(&sampling, &CompensatorOptions::default()).ok()?;
        let lead = inverse.lead();
        let [low, high] = recipe.model.input;
        let still = PidParams {
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
        let pid = recipe.pid.unwrap_or(still).build(&sampling).ok()?;
        // What is measured at the end of a period is what the drive of the period before has made.
        Some((Tracking::new(inverse, lead + 1, pid).ok()?, lead))
    }
}

/// The model at a sample period. `None` where this device has no room for it.
fn actuator(recipe: &Recipe, sampling: &Sampling) -> Option<Actuator> {
    let OperatorParams::Pi(pi) = &recipe.model.operator else { return None };
    let pi: Pi<f32, MOST_PLAYS> = pi.build(&()).ok()?;
    recipe.model.around(pi, sampling).ok()
}

/// Samples by which the output is later than the references: the inverse of what these bytes describe looks ahead. `None` where no device of this kind can
/// follow with it at a sample period \[s\].
pub fn lateness(bytes: &[u8], period: f32) -> Option<usize> {
    let recipe = recipe::read(bytes).ok()?;
    Follower::built(&recipe, period).map(|(_, lead)| lead)
}

fn env(shown: &Shown) -> Env<f32> {
    Env { time: 0.0, temperature: shown.temperature_degc, load: shown.load_n }
}

/// As [`env()`], free: a measured load is what the observer is to find.
fn free(shown: &Shown) -> Env<f32> {
    Env { load: 0.0, ..env(shown) }
}

impl Control for Follower {
    fn load(&mut self, bytes: &[u8]) -> bool {
        (self.running, self.watching) = (None, None);
        self.recipe = recipe::read(bytes).ok().filter(|r| matches!(r.model.operator, OperatorParams::Pi(_)));
        self.recipe.is_some()
    }

    fn ready(&self) -> bool {
        self.recipe.is_some()
    }

    fn prepare(&mut self, period: f32, shown: &Shown, volts: f32, force: bool) -> bool {
        self.watching = self.recipe.as_ref().filter(|_| force).and_then(|recipe| Watching::new(recipe, period));
        if let Some(Watching { observer, state, at_rest }) = &mut self.watching {
            *at_rest = observer.reset(state, &free(shown), volts, shown.output);
        }
        self.running = self.recipe.as_ref().and_then(|recipe| Running::new(recipe, period));
        self.running.is_some()
    }

    fn force(&mut self, volts: f32, shown: &Shown) -> Option<f32> {
        let Watching { observer, state, at_rest } = self.watching.as_mut()?;
        Some(observer.step(state, &free(shown), volts, shown.output) - *at_rest)
    }

    fn begin(&mut self, reference: f32, shown: &Shown, volts: f32) {
        let corrects = self.recipe.as_ref().is_some_and(|r| r.pid.is_some());
        let Some(Running { tracking, state, due, .. }) = &mut self.running else { return };
        if corrects {
            tracking.reset(state, &env(shown), reference, shown.output, volts);
        } else {
            // Without a PID nothing would ever take a first difference back: the drive goes where the model has it, at the slew limit.
            tracking.reset_to_feedforward(state, &env(shown), reference);
        }
        *due = reference;
    }

    fn step(&mut self, reference: f32, shown: &Shown) -> f32 {
        let Some(run) = &mut self.running else { return f32::NAN };
        // There is room: no loop is built that looks further ahead.
        let _ = run.early.push_back(reference);
        if run.early.len() > run.lead + 1 {
            run.due = run.early.pop_front().unwrap_or(run.due);
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
        // The one that comes due now, once there are as many as the inverse looks ahead.
        Some(run.early.front().filter(|_| run.early.len() > run.lead).copied().unwrap_or(run.due))
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

    /// An actuator that does what the model says: a gain behind a dead time.
    struct Perfect {
        waiting: VecDeque<f32>,
        dead: usize,
        /// What its sensor adds \[µm\].
        beside: f32,
    }

    impl Board for Perfect {
        fn measure(&mut self) -> Shown {
            if self.waiting.len() > self.dead + 1 {
                self.waiting.pop_front();
            }
            Shown { output: GAIN * self.waiting[0] + self.beside, temperature_degc: 0.0, load_n: 0.0 }
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

    /// How a run ends that follows one period of 5 Hz at most `error` away, on an actuator with so many samples of dead time and a sensor that is off
    /// by `beside`.
    fn ended(dead: usize, error: f32, beside: f32) -> State {
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
        let mut board = Perfect { waiting: core::iter::repeat_n(0.0, dead + 1).collect(), dead, beside };
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
            // The device is given what it has room for, one by one.
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

        /// An output is held against the reference whose drive it answers: a period earlier or later would be 0.25 µm off.
        #[test]
        fn what_follows_perfectly_has_no_tracking_error(dead in 0..20_usize) {
            prop_assert_eq!(ended(dead, 0.01, 0.0), State::Running);
            prop_assert_eq!(ended(dead, 0.01, 0.02), State::Fault(Fault::TrackingError));
        }
    }
}
