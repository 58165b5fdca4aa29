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

/// The tolerance, as a share of the model's travel.
const TOLERANCE: f64 = 0.02;

impl Running {
    /// The loop at a sample period \[s\], before its first reference.
    fn new(recipe: &Recipe, period: f32) -> Option<Self> {
        let (tracking, lead) = Follower::built(recipe, period)?;
        let OperatorParams::Pi(pi) = &recipe.model.operator else { return None };
        let [low, high] = recipe.model.input;
        let slope = pi.gain + pi.weights.iter().sum::<f64>();
        let tolerance = (TOLERANCE * (slope * (high - low)).abs()) as f32;
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
        self.running.as_ref().map(|run| run.due)
    }
}
