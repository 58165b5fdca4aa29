//! The inverse of a chain: from a reference to the drive that makes the actuator follow it.

use crate::preview::{Preview, PreviewState};
use crate::{
    Build, Chain, Complex, CreepInverse, CreepState, Delay, DelayParams, DelayState, Env, Error, Invert, Real,
    Sampling, Stage, Temperature,
};

/// How the dynamic stages are inverted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CompensatorOptions {
    /// Band in which lag, delay and resonances are inverted \[Hz\]. `None` chooses: a quarter of the
    /// sample rate, on the output side at most 2.5 times the lowest mode's frequency, and never
    /// nearer than 0.6 to an antiresonance.
    pub bandwidth_hz: Option<f64>,
}

/// The inverse chain, stage by stage from the output back to the input:
///
/// `y − zero → resonances⁻¹ → creep⁻¹ → ÷temperature → HYSTERESIS⁻¹ → (lag, delay)⁻¹ → u`.
///
/// Creep, temperature and hysteresis are inverted exactly. Resonances, lag and delay are inverted in
/// a band with [`lead`](Self::lead) samples of preview; [`error`](Self::error) states how well. Drift
/// and interference are in the sensor, not in the motion: the drive does not follow them.
///
/// `HI` is the inverse hysteresis, `D` the capacity of the delay, `C` that of the creep bank, `N` the
/// taps that one preview filter can hold.
#[derive(Clone, Debug)]
pub struct Compensator<T, HI, const D: usize, const C: usize, const N: usize> {
    zero: T,
    output_side: Option<Preview<T, N>>,
    creep: Option<CreepInverse<T, C>>,
    temperature: Option<Temperature<T>>,
    hysteresis: HI,
    input_side: Option<Preview<T, N>>,
    /// Aligns the drive of a chain without lag and fraction: whole samples of dead time.
    whole_delay: usize,
    surroundings: Delay<T, N>,
    sample_rate: f64,
}

/// History of a compensator.
#[derive(Clone, Debug)]
pub struct CompensatorState<T, S, const C: usize, const N: usize> {
    output_side: PreviewState<T, N>,
    creep: CreepState<T, C>,
    temperature: DelayState<T, N>,
    hysteresis: S,
    input_side: PreviewState<T, N>,
}

impl<T: Real, H: Invert<T>, const D: usize, const C: usize> Chain<T, H, D, C> {
    /// Builds the compensator of this chain.
    ///
    /// # Errors
    /// If the hysteresis or the creep has no inverse, or the preview filters do not fit in `N` taps.
    pub fn compensator<const N: usize>(
        &self,
        sampling: &Sampling,
        options: &CompensatorOptions,
    ) -> Result<Compensator<T, H::Inverse, D, C, N>, Error> {
        let h = sampling.checked()?;
        let modes = || self.resonances.iter().flatten();
        let output_side = if modes().next().is_some() {
            let lowest = modes().fold(f64::INFINITY, |f, m| f.at_most(m.highest_band()));
            let band = options.bandwidth_hz.map_or((lowest * h).at_most(0.25), |hz| hz * h);
            Some(Preview::new(band, |z1| modes().fold(Complex::from(1.0), |r, m| r * m.response(z1)))?)
        } else {
            None
        };
        let fraction = self.delay.as_ref().filter(|d| d.fraction_response(Complex::default()).re < 1.0);
        let input_side = if self.lag.is_some() || fraction.is_some() {
            let band = options.bandwidth_hz.map_or(0.25, |hz| (hz * h).at_most(0.25));
            Some(Preview::new(band, |z1| {
                let lag = self.lag.as_ref().map_or(Complex::from(1.0), |l| l.response(z1));
                fraction.map_or(Complex::from(1.0), |d| d.fraction_response(z1)) * lag
            })?)
        } else {
            None
        };
        // The temperature that reaches the division belongs to the sample that is divided.
        let late = output_side.as_ref().map_or(0, Preview::lead);
        Ok(Compensator {
            zero: self.zero,
            surroundings: DelayParams { seconds: late as f64 }.build(&Sampling { period: 1.0 })?,
            output_side,
            creep: self.creep.as_ref().map(Invert::invert).transpose()?,
            temperature: self.temperature,
            hysteresis: self.hysteresis.invert()?,
            input_side,
            whole_delay: self.delay.as_ref().map_or(0, Delay::whole_samples),
            sample_rate: 1.0 / h,
        })
    }
}

impl<T: Real, HI: Stage<T>, const D: usize, const C: usize, const N: usize> Compensator<T, HI, D, C, N> {
    /// Samples by which the reference must be known ahead: the drive that `step` returns belongs to
    /// the time `lead` samples before that of the reference it was given.
    pub fn lead(&self) -> usize {
        let half = |p: &Option<Preview<T, N>>| p.as_ref().map_or(0, Preview::lead);
        half(&self.output_side) + half(&self.input_side) + self.whole_delay
    }

    /// Band in which the dynamic stages are inverted \[Hz\]; `None` if there are none.
    pub fn bandwidth_hz(&self) -> Option<f64> {
        [&self.output_side, &self.input_side]
            .into_iter()
            .flatten()
            .map(|p| p.bandwidth() * self.sample_rate)
            .reduce(|a, b| a.at_most(b))
    }

    /// Largest relative error of the band-limited inversion inside its band.
    pub fn error(&self) -> f64 {
        [&self.output_side, &self.input_side].into_iter().flatten().fold(0.0, |sum, p| sum + p.error())
    }

    /// The inverse hysteresis.
    pub fn hysteresis(&self) -> &HI {
        &self.hysteresis
    }
}

impl<T: Real, HI: Stage<T>, const D: usize, const C: usize, const N: usize> Stage<T> for Compensator<T, HI, D, C, N> {
    type State = CompensatorState<T, HI::State, C, N>;

    fn state(&self) -> Self::State {
        CompensatorState {
            output_side: PreviewState::new(),
            creep: CreepState::new(),
            temperature: DelayState::new(),
            hysteresis: self.hysteresis.state(),
            input_side: PreviewState::new(),
        }
    }

    /// As if the reference had been `u0` for ever: memory virgin, then at the drive for `u0`.
    fn reset(&self, s: &mut Self::State, e: &Env<T>, u0: T) -> T {
        let mut x = u0 - self.zero;
        if let Some(filter) = &self.output_side {
            filter.fill(&mut s.output_side, x);
        }
        if let Some(creep) = &self.creep {
            x = creep.reset(&mut s.creep, e, x);
        }
        if let Some(temperature) = &self.temperature {
            self.surroundings.reset(&mut s.temperature, e, e.temperature);
            x = x / temperature.factor(e);
        }
        x = self.hysteresis.reset(&mut s.hysteresis, e, x);
        if let Some(filter) = &self.input_side {
            filter.fill(&mut s.input_side, x);
        }
        x
    }

    /// Takes the reference and the surroundings of time k + lead, returns the drive of time k.
    fn step(&self, s: &mut Self::State, e: &Env<T>, u: T) -> T {
        let mut x = u - self.zero;
        if let Some(filter) = &self.output_side {
            x = filter.step(&mut s.output_side, x);
        }
        if let Some(creep) = &self.creep {
            x = creep.step(&mut s.creep, e, x);
        }
        if let Some(temperature) = &self.temperature {
            let then = self.surroundings.step(&mut s.temperature, e, e.temperature);
            x = x / temperature.factor(&Env { temperature: then, ..*e });
        }
        x = self.hysteresis.step(&mut s.hysteresis, e, x);
        match &self.input_side {
            Some(filter) => filter.step(&mut s.input_side, x),
            None => x,
        }
    }
}
