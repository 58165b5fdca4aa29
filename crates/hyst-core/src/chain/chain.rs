//! The actuator: a hysteresis operator and optional stages around it, in physical order.

use crate::stage::{hold, rest};
use crate::{
    Asymmetry, AsymmetryParams, Build, Creep, CreepParams, CreepState, CurveSide, Delay, DelayParams, DelayState,
    Drift, DriftParams, Env, Error, Interference, InterferenceParams, Lag, LagParams, LagState, Load, LoadParams, Rate,
    RateParams, RateState, Real, Resonance, ResonanceParams, ResonanceState, Sampling, Saturation, SaturationParams,
    Stage, Temperature, TemperatureParams, TemperatureState, Widening, WideningParams, WideningState,
};

/// Maximum number of structural modes of a chain.
pub const MAX_RESONANCES: usize = 2;

/// Maximum number of dead zones of an asymmetry of a chain.
pub const MAX_DEAD_ZONES: usize = 8;

/// Signal chain of an actuator. Every stage except the hysteresis is optional:
///
/// ```text
/// u → saturation (input side) → delay → lag → rate → asymmetry (input side) → ±(HYSTERESIS + widening)
///   → asymmetry (output side) → ×temperature → +creep → ×load → resonance(s) → saturation (output side)
///   → +drift → +interference → +zero → y
/// ```
///
/// `H` is the hysteresis, `D` the capacity of the delay in samples, `C` the capacity of the creep bank in elements.
#[derive(Clone, Debug, PartialEq)]
pub struct Chain<T, H, const D: usize, const C: usize> {
    /// Limits of the drive.
    pub input_saturation: Option<Saturation<T>>,
    /// Dead time.
    pub delay: Option<Delay<T, D>>,
    /// Lag of the amplifier.
    pub lag: Option<Lag<T>>,
    /// Rate-dependent hysteresis: an overdrive that grows with the rate of the drive.
    pub rate: Option<Rate<T>>,
    /// Asymmetry before the hysteresis operator.
    pub input_curve: Option<Asymmetry<T, MAX_DEAD_ZONES>>,
    /// Hysteresis operator.
    pub hysteresis: H,
    /// Rate-dependent widening of the loops, in parallel with the hysteresis operator.
    pub widening: Option<Widening<T>>,
    /// Whether the output falls when the operator rises (negative gain).
    pub falls: bool,
    /// Asymmetry after the hysteresis operator.
    pub asymmetry: Option<Asymmetry<T, MAX_DEAD_ZONES>>,
    /// Temperature dependence of gain, loop width and zero.
    pub temperature: Option<Temperature<T>>,
    /// Creep bank.
    pub creep: Option<Creep<T, C>>,
    /// Compliance and gain under the load.
    pub load: Option<Load<T>>,
    /// Structural modes, in series.
    pub resonances: [Option<Resonance<T>>; MAX_RESONANCES],
    /// Limits of the motion.
    pub saturation: Option<Saturation<T>>,
    /// Drift of the sensor.
    pub drift: Option<Drift<T>>,
    /// Tone in the sensor.
    pub interference: Option<Interference<T>>,
    /// Sensor zero \[output unit\]: the output at rest.
    pub zero: T,
}

/// History of a chain.
#[derive(Clone, Debug)]
pub struct ChainState<T, S, const D: usize, const C: usize> {
    input: T,
    temperature: T,
    load: T,
    delay: DelayState<T, D>,
    lag: LagState<T>,
    rate: RateState<T>,
    hysteresis: S,
    pub(super) widening: WideningState<T>,
    pub(super) thermal: TemperatureState<T>,
    creep: CreepState<T, C>,
    resonances: [ResonanceState<T>; MAX_RESONANCES],
}

impl<T: Real, H, const D: usize, const C: usize> Chain<T, H, D, C> {
    /// Returns a chain of the hysteresis alone, with a sensor zero of 0.
    pub fn new(hysteresis: H) -> Self {
        Self {
            input_saturation: None,
            delay: None,
            lag: None,
            rate: None,
            input_curve: None,
            hysteresis,
            widening: None,
            falls: false,
            asymmetry: None,
            temperature: None,
            creep: None,
            load: None,
            resonances: [None; MAX_RESONANCES],
            saturation: None,
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

    /// Adds rate-dependent hysteresis.
    ///
    /// # Errors
    /// As [`RateParams::build`].
    pub fn with_rate(mut self, p: &RateParams, cx: &Sampling) -> Result<Self, Error> {
        self.rate = Some(p.build(cx)?);
        Ok(self)
    }

    /// Adds a widening of the loops with rate, in proportion to their width.
    ///
    /// # Errors
    /// As [`WideningParams::build`].
    pub fn with_widening<L: AsRef<[f64]>>(mut self, p: &WideningParams<L>, cx: &Sampling) -> Result<Self, Error> {
        self.widening = Some(p.build(cx)?);
        Ok(self)
    }

    /// Adds an asymmetry after the hysteresis or before it.
    ///
    /// # Errors
    /// As [`AsymmetryParams::build`].
    pub fn with_asymmetry<L: AsRef<[f64]>>(mut self, p: &AsymmetryParams<L>) -> Result<Self, Error> {
        let curve = Some(p.build(&())?);
        match p.side {
            CurveSide::Output => self.asymmetry = curve,
            CurveSide::Input => self.input_curve = curve,
        }
        Ok(self)
    }

    /// Adds the compliance and the gain under the measured load.
    ///
    /// # Errors
    /// As [`LoadParams::build`].
    pub fn with_load(mut self, p: &LoadParams) -> Result<Self, Error> {
        self.load = Some(p.build(&())?);
        Ok(self)
    }

    /// Adds limits of the motion or of the drive.
    ///
    /// # Errors
    /// As [`SaturationParams::build`].
    pub fn with_saturation(mut self, p: &SaturationParams) -> Result<Self, Error> {
        let limits = Some(p.build(&())?);
        match p.side {
            CurveSide::Output => self.saturation = limits,
            CurveSide::Input => self.input_saturation = limits,
        }
        Ok(self)
    }

    /// Adds a dependence on temperature.
    ///
    /// # Errors
    /// As [`TemperatureParams::build`].
    pub fn with_temperature(mut self, p: &TemperatureParams, cx: &Sampling) -> Result<Self, Error> {
        self.temperature = Some(p.build(cx)?);
        Ok(self)
    }

    /// Adds a creep bank.
    ///
    /// # Errors
    /// As [`CreepParams::build`].
    pub fn with_creep<L: AsRef<[f64]>>(mut self, p: &CreepParams<L>, cx: &Sampling) -> Result<Self, Error> {
        self.creep = Some(p.build(cx)?);
        Ok(self)
    }

    /// Adds one more structural mode.
    ///
    /// # Errors
    /// As [`ResonanceParams::build`], and if the chain already has [`MAX_RESONANCES`] modes.
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

    /// Sets whether the output falls when the operator rises.
    pub fn with_falling(mut self, falls: bool) -> Self {
        self.falls = falls;
        self
    }

    /// Sets the sensor zero \[output unit\].
    pub fn with_zero(mut self, zero: f64) -> Self {
        self.zero = T::from_f64(zero);
        self
    }
}

/// Returns `x` with the sign of the gain: −x if the output falls.
#[inline]
pub(super) fn signed<T: Real>(falls: bool, x: T) -> T {
    if falls { -x } else { x }
}

/// Returns `f` of the stage, or `x` without a stage.
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
            input: T::ZERO,
            temperature: T::ZERO,
            load: T::ZERO,
            delay: DelayState::new(),
            lag: LagState::default(),
            rate: RateState::default(),
            hysteresis: self.hysteresis.state(),
            widening: WideningState::default(),
            thermal: TemperatureState::default(),
            creep: CreepState::new(),
            resonances: [ResonanceState::default(); MAX_RESONANCES],
        }
    }

    /// A temperature that is not finite counts as T₀ of the temperature stage (0 °C without one). A load that is not
    /// finite counts as zero.
    fn reset(&self, s: &mut Self::State, e: &Env<T>, u0: T) -> T {
        self.reset_after(s, e, u0, &[])
    }

    /// The last finite value replaces an input, temperature or load that is not finite.
    #[inline]
    fn step(&self, s: &mut Self::State, e: &Env<T>, u: T) -> T {
        let (temperature, load) = (hold(&mut s.temperature, e.temperature), hold(&mut s.load, e.load));
        let e = &Env { temperature, load, ..*e };
        let u = hold(&mut s.input, u);
        let mut x = through(&self.input_saturation, u, |g, x| g.step(&mut (), e, x));
        x = through(&self.delay, x, |g, x| g.step(&mut s.delay, e, x));
        x = through(&self.lag, x, |g, x| g.step(&mut s.lag, e, x));
        x = through(&self.rate, x, |g, x| g.step(&mut s.rate, e, x));
        x = through(&self.input_curve, x, |g, x| g.step(&mut (), e, x));
        let drive = signed(self.falls, x);
        let memory = self.hysteresis.step(&mut s.hysteresis, e, x);
        let memory = through(&self.widening, memory, |g, memory| memory + g.step(&mut s.widening, e, x));
        x = signed(self.falls, memory);
        x = through(&self.asymmetry, x, |g, x| g.step(&mut (), e, x));
        x = through(&self.temperature, x, |g, x| g.step(&mut s.thermal, e, x) + g.direct(&s.thermal) * drive);
        x = through(&self.creep, x, |g, x| g.step(&mut s.creep, e, x));
        x = through(&self.load, x, |g, x| g.step(&mut (), e, x));
        for (g, s) in self.resonances.iter().zip(&mut s.resonances) {
            x = through(g, x, |g, x| g.step(s, e, x));
        }
        x = through(&self.saturation, x, |g, x| g.step(&mut (), e, x));
        x = through(&self.drift, x, |g, x| g.step(&mut (), e, x));
        through(&self.interference, x, |g, x| g.step(&mut (), e, x)) + self.zero
    }
}

impl<T: Real, H: Stage<T>, const D: usize, const C: usize> Chain<T, H, D, C> {
    /// Resets as [`reset`](Stage::reset), but with the memory of a drive history: `past` \[u\], oldest first, one
    /// sample each. The history is slow enough that delay, lag and rate pass it unchanged. All
    /// other stages are at rest at `u0`. Values in `past` that are not finite are ignored.
    pub fn reset_after(&self, s: &mut ChainState<T, H::State, D, C>, e: &Env<T>, u0: T, past: &[T]) -> T {
        s.temperature = self.temperature.as_ref().map_or(T::ZERO, Temperature::reference);
        let (temperature, load) = (hold(&mut s.temperature, e.temperature), rest(&mut s.load, e.load));
        let e = &Env { temperature, load, ..*e };
        let u0 = rest(&mut s.input, u0);
        let mut x = through(&self.input_saturation, u0, |g, x| g.reset(&mut (), e, x));
        x = through(&self.delay, x, |g, x| g.reset(&mut s.delay, e, x));
        x = through(&self.lag, x, |g, x| g.reset(&mut s.lag, e, x));
        x = through(&self.rate, x, |g, x| g.reset(&mut s.rate, e, x));
        x = through(&self.input_curve, x, |g, x| g.reset(&mut (), e, x));
        let drive = signed(self.falls, x);
        let mut past = past.iter().filter(|u| u.is_finite());
        s.widening = WideningState::default();
        let widen = |s: &mut WideningState<T>, u: T| self.widening.iter().for_each(|g| g.rest(s, u));
        x = match past.next() {
            None => {
                widen(&mut s.widening, x);
                self.hysteresis.reset(&mut s.hysteresis, e, x)
            }
            Some(first) => {
                let bent = |u: T| {
                    let limited = through(&self.input_saturation, u, |g, u| g.reset(&mut (), e, u));
                    through(&self.input_curve, limited, |g, u| g.reset(&mut (), e, u))
                };
                self.hysteresis.reset(&mut s.hysteresis, e, bent(*first));
                widen(&mut s.widening, bent(*first));
                for u in past {
                    self.hysteresis.step(&mut s.hysteresis, e, bent(*u));
                    widen(&mut s.widening, bent(*u));
                }
                widen(&mut s.widening, x);
                self.hysteresis.step(&mut s.hysteresis, e, x)
            }
        };
        x = signed(self.falls, x);
        x = through(&self.asymmetry, x, |g, x| g.reset(&mut (), e, x));
        x = through(&self.temperature, x, |g, x| g.reset(&mut s.thermal, e, x) + g.direct(&s.thermal) * drive);
        x = through(&self.creep, x, |g, x| g.reset(&mut s.creep, e, x));
        x = through(&self.load, x, |g, x| g.reset(&mut (), e, x));
        for (g, s) in self.resonances.iter().zip(&mut s.resonances) {
            x = through(g, x, |g, x| g.reset(s, e, x));
        }
        x = through(&self.saturation, x, |g, x| g.reset(&mut (), e, x));
        x = through(&self.drift, x, |g, x| g.reset(&mut (), e, x));
        through(&self.interference, x, |g, x| g.reset(&mut (), e, x)) + self.zero
    }
}

#[cfg(test)]
mod tests;
