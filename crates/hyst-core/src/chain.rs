//! The actuator: a hysteresis operator and the optional stages around it, in physical order.

use crate::{
    Build, Creep, CreepParams, CreepState, Delay, DelayParams, DelayState, Drift, DriftParams, Env, Error,
    Interference, InterferenceParams, Lag, LagParams, LagState, Real, Resonance, ResonanceParams, ResonanceState,
    Sampling, Stage, Temperature, TemperatureParams,
};

/// Structural modes that one chain can hold.
pub const MAX_RESONANCES: usize = 2;

/// `u → delay → lag → HYSTERESIS → ×temperature → +creep → resonance(s) → +drift → +interference →
/// + zero → y`, every stage but the hysteresis optional.
///
/// `H` is the hysteresis, `D` the samples the delay can hold, `C` the elements of the creep bank.
#[derive(Clone, Debug, PartialEq)]
pub struct Chain<T, H, const D: usize, const C: usize> {
    /// Dead time.
    pub delay: Option<Delay<T, D>>,
    /// Lag of the amplifier.
    pub lag: Option<Lag<T>>,
    /// The memory operator.
    pub hysteresis: H,
    /// Gain over temperature.
    pub temperature: Option<Temperature<T>>,
    /// Creep bank.
    pub creep: Option<Creep<T, C>>,
    /// Structural modes, one after the other.
    pub resonances: [Option<Resonance<T>>; MAX_RESONANCES],
    /// Drift of the sensor.
    pub drift: Option<Drift<T>>,
    /// Tone in the sensor.
    pub interference: Option<Interference<T>>,
    /// What the sensor shows at rest \[output unit\].
    pub zero: T,
}

/// History of a chain.
#[derive(Clone, Debug)]
pub struct ChainState<T, S, const D: usize, const C: usize> {
    delay: DelayState<T, D>,
    lag: LagState<T>,
    hysteresis: S,
    creep: CreepState<T, C>,
    resonances: [ResonanceState<T>; MAX_RESONANCES],
}

impl<T: Real, H, const D: usize, const C: usize> Chain<T, H, D, C> {
    /// A chain of the hysteresis alone, sensor zero 0.
    pub fn new(hysteresis: H) -> Self {
        Self {
            delay: None,
            lag: None,
            hysteresis,
            temperature: None,
            creep: None,
            resonances: [None; MAX_RESONANCES],
            drift: None,
            interference: None,
            zero: T::ZERO,
        }
    }

    /// Adds a dead time.
    ///
    /// # Errors
    /// As [`DelayParams::build`].
    pub fn with_delay(mut self, p: &DelayParams, cx: &Sampling) -> Result<Self, Error> {
        self.delay = Some(p.build(cx)?);
        Ok(self)
    }

    /// Adds a lag.
    ///
    /// # Errors
    /// As [`LagParams::build`].
    pub fn with_lag(mut self, p: &LagParams, cx: &Sampling) -> Result<Self, Error> {
        self.lag = Some(p.build(cx)?);
        Ok(self)
    }

    /// Adds a dependence on temperature.
    ///
    /// # Errors
    /// As [`TemperatureParams::build`].
    pub fn with_temperature(mut self, p: &TemperatureParams) -> Result<Self, Error> {
        self.temperature = Some(p.build(&())?);
        Ok(self)
    }

    /// Adds a creep bank.
    ///
    /// # Errors
    /// As [`CreepParams::build`].
    pub fn with_creep(mut self, p: &CreepParams<'_>, cx: &Sampling) -> Result<Self, Error> {
        self.creep = Some(p.build(cx)?);
        Ok(self)
    }

    /// Adds one more structural mode.
    ///
    /// # Errors
    /// As [`ResonanceParams::build`], and if the chain has no room for another one.
    pub fn with_resonance(mut self, p: &ResonanceParams, cx: &Sampling) -> Result<Self, Error> {
        let built = p.build(cx)?;
        match self.resonances.iter_mut().find(|r| r.is_none()) {
            Some(slot) => *slot = Some(built),
            None => {
                return Err(Error::Capacity { name: "resonances", needed: MAX_RESONANCES + 1, holds: MAX_RESONANCES });
            }
        }
        Ok(self)
    }

    /// Adds a drift of the sensor.
    ///
    /// # Errors
    /// As [`DriftParams::build`].
    pub fn with_drift(mut self, p: &DriftParams) -> Result<Self, Error> {
        self.drift = Some(p.build(&())?);
        Ok(self)
    }

    /// Adds a tone in the sensor.
    ///
    /// # Errors
    /// As [`InterferenceParams::build`].
    pub fn with_interference(mut self, p: &InterferenceParams) -> Result<Self, Error> {
        self.interference = Some(p.build(&())?);
        Ok(self)
    }

    /// Sets what the sensor shows at rest \[output unit\].
    pub fn with_zero(mut self, zero: f64) -> Self {
        self.zero = T::from_f64(zero);
        self
    }
}

/// Applies `f` of a stage if it is there.
#[inline]
fn through<T, G>(stage: &Option<G>, x: T, f: impl FnOnce(&G, T) -> T) -> T {
    match stage {
        Some(stage) => f(stage, x),
        None => x,
    }
}

impl<T: Real, H: Stage<T>, const D: usize, const C: usize> Stage<T> for Chain<T, H, D, C> {
    type State = ChainState<T, H::State, D, C>;

    fn state(&self) -> Self::State {
        ChainState {
            delay: DelayState::new(),
            lag: LagState::default(),
            hysteresis: self.hysteresis.state(),
            creep: CreepState::new(),
            resonances: [ResonanceState::default(); MAX_RESONANCES],
        }
    }

    fn reset(&self, s: &mut Self::State, e: &Env<T>, u0: T) -> T {
        let mut x = through(&self.delay, u0, |g, x| g.reset(&mut s.delay, e, x));
        x = through(&self.lag, x, |g, x| g.reset(&mut s.lag, e, x));
        x = self.hysteresis.reset(&mut s.hysteresis, e, x);
        x = through(&self.temperature, x, |g, x| g.reset(&mut (), e, x));
        x = through(&self.creep, x, |g, x| g.reset(&mut s.creep, e, x));
        for (g, s) in self.resonances.iter().zip(&mut s.resonances) {
            x = through(g, x, |g, x| g.reset(s, e, x));
        }
        x = through(&self.drift, x, |g, x| g.reset(&mut (), e, x));
        through(&self.interference, x, |g, x| g.reset(&mut (), e, x)) + self.zero
    }

    #[inline]
    fn step(&self, s: &mut Self::State, e: &Env<T>, u: T) -> T {
        let mut x = through(&self.delay, u, |g, x| g.step(&mut s.delay, e, x));
        x = through(&self.lag, x, |g, x| g.step(&mut s.lag, e, x));
        x = self.hysteresis.step(&mut s.hysteresis, e, x);
        x = through(&self.temperature, x, |g, x| g.step(&mut (), e, x));
        x = through(&self.creep, x, |g, x| g.step(&mut s.creep, e, x));
        for (g, s) in self.resonances.iter().zip(&mut s.resonances) {
            x = through(g, x, |g, x| g.step(s, e, x));
        }
        x = through(&self.drift, x, |g, x| g.step(&mut (), e, x));
        through(&self.interference, x, |g, x| g.step(&mut (), e, x)) + self.zero
    }
}
