//! The inverse of a chain: computes the drive that makes the actuator follow a reference.

use super::chain::signed;
use super::preview::{Preview, PreviewState};
use crate::stage::{finite_or, hold, rest};
use crate::{
    AsymmetryInverse, Build, Chain, Complex, CreepInverse, CreepInverseState, Delay, DelayParams, DelayState, Env,
    Error, Invert, Load, MAX_DEAD_ZONES, RateInverse, RateState, Real, Sampling, SaturationInverse, Stage, Temperature,
    TemperatureState, Widening, WideningState,
};

/// Options of the inversion of the dynamic stages.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CompensatorOptions {
    /// Band in which lag, delay and resonances are inverted \[Hz\]; at most a quarter of the sample rate. `None`
    /// selects 0.16 of the sample rate; on the output side at most 2.5 times the frequency of the lowest mode and 0.4
    /// times that of an antiresonance.
    pub bandwidth_hz: Option<f64>,
}

/// The inverse chain, stage by stage from the output back to the input:
///
/// ```text
/// y − zero → saturation⁻¹ (output side) → resonances⁻¹ → ÷load → creep⁻¹ → ÷temperature → asymmetry⁻¹ (output side)
///   → −widening → HYSTERESIS⁻¹ → asymmetry⁻¹ (input side) → rate⁻¹ → (lag, delay)⁻¹
///   → saturation⁻¹ (input side) → u
/// ```
///
/// - Resonances, lag and delay are inverted in a band, with [`lead`](Self::lead) samples of preview.
///   [`error`](Self::error) returns the error.
/// - The rate is inverted by [`RateInverse`].
/// - The widening is evaluated at the drive that is extrapolated linearly from the last two samples. The error is the
///   second difference of the drive times the weights of the widening. If the inverse hysteresis needs preview, the
///   widening is evaluated at the last known drive.
/// - The change of the gain beside the hysteresis with temperature depends on the drive that is sought. It is solved for
///   by secant steps, which evaluate the inverse hysteresis six times more. If the inverse hysteresis needs preview, the
///   gain acts on the last known drive; this is stable as long as it is smaller than the gain of the hysteresis.
/// - All other stages are inverted exactly; a saturation only within its limits.
/// - Drift and interference are in the sensor and not in the motion. The drive does not follow them.
///
/// `HI` is the inverse hysteresis, `D` the capacity of the delay, `C` the capacity of the creep bank, `N` the capacity
/// of a preview filter in taps.
#[derive(Clone, Debug)]
pub struct Compensator<T, HI, const D: usize, const C: usize, const N: usize> {
    zero: T,
    saturation: Option<SaturationInverse<T>>,
    output_side: Option<Preview<T, N>>,
    load: Option<Load<T>>,
    creep: Option<CreepInverse<T, C>>,
    temperature: Option<Temperature<T>>,
    asymmetry: Option<AsymmetryInverse<T, MAX_DEAD_ZONES>>,
    falls: bool,
    hysteresis: HI,
    widening: Option<Widening<T>>,
    input_curve: Option<AsymmetryInverse<T, MAX_DEAD_ZONES>>,
    rate: Option<RateInverse<T>>,
    input_side: Option<Preview<T, N>>,
    input_saturation: Option<SaturationInverse<T>>,
    /// Preview without the filters: whole samples of dead time plus the lead of the inverse hysteresis.
    whole_samples: usize,
    /// Lead of the inverse hysteresis \[samples\].
    hysteresis_lead: usize,
    /// Band \[Hz\] and error of the inverse hysteresis, if it is dynamic.
    hysteresis_band: Option<(f64, f64)>,
    /// Delays temperature and load by the lead of the output-side filter.
    environment: Delay<T, N>,
    sample_rate: f64,
}

/// History of a compensator.
#[derive(Clone, Debug)]
pub struct CompensatorState<T, S, const C: usize, const N: usize> {
    reference: T,
    degc: T,
    newton: T,
    factor: T,
    stiffness: T,
    output_side: PreviewState<T, N>,
    load: DelayState<T, N>,
    creep: CreepInverseState<T, C>,
    temperature: DelayState<T, N>,
    thermal: TemperatureState<T>,
    hysteresis: S,
    widening: WideningState<T>,
    /// Last two inputs of the hysteresis.
    last: T,
    last_but_one: T,
    rate: RateState<T>,
    input_side: PreviewState<T, N>,
}

/// Returns the temperature factor of the gain if it is positive, otherwise the last positive one.
fn positive_or_held<T: Real>(held: &mut T, factor: T) -> T {
    if factor > T::ZERO { hold(held, factor) } else { *held }
}

/// Default band without a low mode \[cycles per sample\]. The filter falls to zero at twice the band. Near half the
/// sample rate a sampled lag or mode passes almost nothing, and its inverse would amplify by a factor of 100.
const MAX_BAND: f64 = 0.16;

/// Number of secant steps to the drive with the gain beside the hysteresis.
const SECANTS: usize = 3;

/// The inverse of a hysteresis operator, with its lead and band.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InverseHysteresis<I> {
    /// The inverse operator.
    pub inverse: I,
    /// Samples of preview that it needs: its `step` takes the reference of time k + lead and returns the drive of time
    /// k.
    pub lead: usize,
    /// Band in which it is valid \[Hz\] and its maximum relative error in that band; `None` if it is valid at all
    /// frequencies.
    pub band: Option<(f64, f64)>,
}

impl<T: Real, H: Invert<T>, const D: usize, const C: usize> Chain<T, H, D, C> {
    /// Builds the compensator of this chain.
    ///
    /// # Errors
    /// If the hysteresis or the creep has no inverse, or a preview filter needs more than `N` taps.
    pub fn compensator<const N: usize>(
        &self,
        sampling: &Sampling,
        options: &CompensatorOptions,
    ) -> Result<Compensator<T, H::Inverse, D, C, N>, Error> {
        let inverse = self.hysteresis.invert()?;
        let (lead, band) = (H::lead(&inverse), H::band(&inverse));
        self.compensator_with(InverseHysteresis { inverse, lead, band }, sampling, options)
    }
}

impl<T: Real, H, const D: usize, const C: usize> Chain<T, H, D, C> {
    /// Builds the compensator of this chain around a given inverse of the hysteresis: a search
    /// ([`BoucWen::inverse`](crate::BoucWen::inverse), [`Search`](crate::Search) on a [`Dpm`](crate::Dpm)), an inverse
    /// with preview ([`Activation::anti_causal`](crate::Activation::anti_causal)), or a band-limited one
    /// ([`TdEm::band_limited`](crate::TdEm::band_limited)).
    ///
    /// # Errors
    /// If the creep has no inverse, or a preview filter needs more than `N` taps.
    pub fn compensator_with<I, const N: usize>(
        &self,
        hysteresis: InverseHysteresis<I>,
        sampling: &Sampling,
        options: &CompensatorOptions,
    ) -> Result<Compensator<T, I, D, C, N>, Error> {
        let h = sampling.checked()?;
        let modes = || self.resonances.iter().flatten();
        let output_side = if modes().next().is_some() {
            let lowest = modes().fold(f64::INFINITY, |f, m| f.at_most(m.highest_band()));
            let band = options.bandwidth_hz.map_or((lowest * h).at_most(MAX_BAND), |hz| hz * h);
            Some(Preview::new(band, |z1| modes().fold(Complex::from(1.0), |r, m| r * m.response(z1)))?)
        } else {
            None
        };
        let fraction = self.delay.as_ref().filter(|d| d.fraction_response(Complex::default()).re < 1.0);
        let input_side = if self.lag.is_some() || fraction.is_some() {
            let band = options.bandwidth_hz.map_or(MAX_BAND, |hz| hz * h);
            Some(Preview::new(band, |z1| {
                let lag = self.lag.as_ref().map_or(Complex::from(1.0), |l| l.response(z1));
                fraction.map_or(Complex::from(1.0), |d| d.fraction_response(z1)) * lag
            })?)
        } else {
            None
        };
        // Temperature and load must belong to the sample that leaves the output-side filter.
        let output_lead = output_side.as_ref().map_or(0, Preview::lead);
        Ok(Compensator {
            zero: self.zero,
            environment: DelayParams { seconds: output_lead as f64 }.build(&Sampling { period: 1.0 })?,
            output_side,
            saturation: self.saturation.as_ref().map(Invert::invert).transpose()?,
            load: self.load,
            creep: self.creep.as_ref().map(Invert::invert).transpose()?,
            temperature: self.temperature,
            asymmetry: self.asymmetry.as_ref().map(Invert::invert).transpose()?,
            whole_samples: self.delay.as_ref().map_or(0, Delay::whole_samples) + hysteresis.lead,
            falls: self.falls,
            hysteresis_lead: hysteresis.lead,
            hysteresis_band: hysteresis.band,
            hysteresis: hysteresis.inverse,
            widening: self.widening,
            input_curve: self.input_curve.as_ref().map(Invert::invert).transpose()?,
            rate: self.rate.as_ref().map(Invert::invert).transpose()?,
            input_side,
            input_saturation: self.input_saturation.as_ref().map(Invert::invert).transpose()?,
            sample_rate: 1.0 / h,
        })
    }
}

impl<T: Real, HI: Stage<T>, const D: usize, const C: usize, const N: usize> Compensator<T, HI, D, C, N> {
    /// Returns the samples of preview: `step` takes the reference of time k + lead and returns the drive of time k.
    pub fn lead(&self) -> usize {
        let lead_of = |p: &Option<Preview<T, N>>| p.as_ref().map_or(0, Preview::lead);
        lead_of(&self.output_side) + lead_of(&self.input_side) + self.whole_samples
    }

    /// Returns the number of taps of the longest preview filter, at least the smallest possible `N`. This `N` is
    /// sufficient for another compensator of the same chain at the same sample period.
    pub fn taps(&self) -> usize {
        let lead_of = |p: &Option<Preview<T, N>>| p.as_ref().map_or(0, Preview::lead);
        2 * lead_of(&self.output_side).max(lead_of(&self.input_side)).max(1) + 1
    }

    /// Returns the samples of preview of the inverse hysteresis.
    pub fn hysteresis_lead(&self) -> usize {
        self.hysteresis_lead
    }

    /// Returns the band in which the dynamic stages are inverted \[Hz\]; `None` without dynamic stages.
    pub fn bandwidth_hz(&self) -> Option<f64> {
        [&self.output_side, &self.input_side]
            .into_iter()
            .flatten()
            .map(|p| p.bandwidth() * self.sample_rate)
            .chain(self.hysteresis_band.map(|(hz, _)| hz))
            .reduce(|a, b| a.at_most(b))
    }

    /// Returns the maximum relative error of the band-limited inversion inside its band.
    pub fn error(&self) -> f64 {
        let of_hysteresis = self.hysteresis_band.map_or(0.0, |(_, error)| error);
        [&self.output_side, &self.input_side].into_iter().flatten().fold(of_hysteresis, |sum, p| sum + p.error())
    }

    /// Returns the inverse hysteresis.
    pub fn hysteresis(&self) -> &HI {
        &self.hysteresis
    }
}

/// Returns x = f(x) by secant steps (Aitken) from `start`: exact for a linear f, whatever its slope. A step is at most
/// twice as far as f moves the value, as for slopes up to 1/2.
fn fixed_point<T: Real>(start: T, mut f: impl FnMut(T) -> T) -> T {
    let mut x = start;
    for _ in 0..SECANTS {
        let first = f(x);
        let second = f(first);
        let (step, change) = (first - x, second - first);
        let most = (step + step).abs();
        x += finite_or(step * step / (step - change), step).at_least(-most).at_most(most);
    }
    x
}

impl<T: Real, HI: Stage<T>, const D: usize, const C: usize, const N: usize> Stage<T> for Compensator<T, HI, D, C, N> {
    type State = CompensatorState<T, HI::State, C, N>;

    fn state(&self) -> Self::State {
        CompensatorState {
            reference: T::ZERO,
            degc: T::ZERO,
            newton: T::ZERO,
            factor: T::ONE,
            stiffness: T::ONE,
            output_side: PreviewState::new(),
            load: DelayState::new(),
            creep: CreepInverseState::new(),
            temperature: DelayState::new(),
            thermal: TemperatureState::default(),
            hysteresis: self.hysteresis.state(),
            widening: WideningState::default(),
            last: T::ZERO,
            last_but_one: T::ZERO,
            rate: RateState::default(),
            input_side: PreviewState::new(),
        }
    }

    /// Resets to a reference that has always been `u0`: virgin memory, then the drive for `u0`.
    fn reset(&self, s: &mut Self::State, e: &Env<T>, u0: T) -> T {
        s.degc = self.temperature.as_ref().map_or(T::ZERO, Temperature::reference);
        (s.factor, s.stiffness) = (T::ONE, T::ONE);
        let e = &Env { temperature: hold(&mut s.degc, e.temperature), load: rest(&mut s.newton, e.load), ..*e };
        let mut x = rest(&mut s.reference, u0) - self.zero;
        if let Some(saturation) = &self.saturation {
            x = saturation.reset(&mut (), e, x);
        }
        if let Some(filter) = &self.output_side {
            filter.reset(&mut s.output_side, e, x);
        }
        self.environment.reset(&mut s.temperature, e, e.temperature);
        self.environment.reset(&mut s.load, e, e.load);
        if let Some(load) = &self.load {
            x = (x - load.deflection(e)) / positive_or_held(&mut s.stiffness, load.factor(e));
        }
        if let Some(creep) = &self.creep {
            x = creep.reset(&mut s.creep, e, x);
        }
        let (factor, shift, direct) = match &self.temperature {
            Some(temperature) => {
                let (factor, shift) = temperature.reset_felt(&mut s.thermal, e);
                (positive_or_held(&mut s.factor, factor), shift, temperature.direct(&s.thermal))
            }
            None => (T::ONE, T::ZERO, T::ZERO),
        };
        let (target, hysteresis) = (x, &mut s.hysteresis);
        let mut at = |drive: T| {
            let mut x = (target - shift - direct * signed(self.falls, drive)) / factor;
            if let Some(asymmetry) = &self.asymmetry {
                x = asymmetry.reset(&mut (), e, x);
            }
            self.hysteresis.reset(hysteresis, e, signed(self.falls, x))
        };
        let drive = if direct == T::ZERO { T::ZERO } else { fixed_point(T::ZERO, &mut at) };
        x = at(drive);
        if let Some(widening) = &self.widening {
            widening.reset(&mut s.widening, e, x);
        }
        (s.last, s.last_but_one) = (x, x);
        if let Some(curve) = &self.input_curve {
            x = curve.reset(&mut (), e, x);
        }
        if let Some(rate) = &self.rate {
            x = rate.reset(&mut s.rate, e, x);
        }
        if let Some(filter) = &self.input_side {
            filter.reset(&mut s.input_side, e, x);
        }
        match &self.input_saturation {
            Some(limits) => limits.reset(&mut (), e, x),
            None => x,
        }
    }

    /// Takes the reference, temperature and load of time k + lead and returns the drive of time k. The last finite
    /// value replaces a reference, temperature or load that is not finite. The last positive gain replaces a gain that
    /// the temperature makes zero or negative.
    fn step(&self, s: &mut Self::State, e: &Env<T>, u: T) -> T {
        let e = &Env { temperature: hold(&mut s.degc, e.temperature), load: hold(&mut s.newton, e.load), ..*e };
        let mut x = hold(&mut s.reference, u) - self.zero;
        if let Some(saturation) = &self.saturation {
            x = saturation.step(&mut (), e, x);
        }
        if let Some(filter) = &self.output_side {
            x = filter.step(&mut s.output_side, e, x);
        }
        // From here on all values belong to the sample that left the filter.
        let e = &Env {
            temperature: self.environment.step(&mut s.temperature, e, e.temperature),
            load: self.environment.step(&mut s.load, e, e.load),
            ..*e
        };
        if let Some(load) = &self.load {
            x = (x - load.deflection(e)) / positive_or_held(&mut s.stiffness, load.factor(e));
        }
        if let Some(creep) = &self.creep {
            x = creep.step(&mut s.creep, e, x);
        }
        // The drive that is sought, as the last two continue.
        let next = if self.hysteresis_lead == 0 { s.last + (s.last - s.last_but_one) } else { s.last };
        let (factor, shift, direct) = match &self.temperature {
            Some(temperature) => {
                let (factor, shift) = temperature.step_felt(&mut s.thermal, e);
                (positive_or_held(&mut s.factor, factor), shift, temperature.direct(&s.thermal))
            }
            None => (T::ONE, T::ZERO, T::ZERO),
        };
        let (target, widened) = (x - shift, &s.widening);
        let at = |hysteresis: &mut HI::State, drive: T| {
            let mut x = (target - direct * signed(self.falls, drive)) / factor;
            if let Some(asymmetry) = &self.asymmetry {
                x = asymmetry.step(&mut (), e, x);
            }
            x = signed(self.falls, x);
            if let Some(widening) = &self.widening {
                x -= widening.at(widened, drive);
            }
            self.hysteresis.step(hysteresis, e, x)
        };
        let drive = if direct != T::ZERO && self.hysteresis_lead == 0 {
            fixed_point(next, |drive| at(&mut s.hysteresis.clone(), drive))
        } else {
            next
        };
        x = at(&mut s.hysteresis, drive);
        if let Some(widening) = &self.widening {
            widening.step(&mut s.widening, e, x);
        }
        (s.last_but_one, s.last) = (s.last, finite_or(x, s.last));
        if let Some(curve) = &self.input_curve {
            x = curve.step(&mut (), e, x);
        }
        if let Some(rate) = &self.rate {
            x = rate.step(&mut s.rate, e, x);
        }
        if let Some(filter) = &self.input_side {
            x = filter.step(&mut s.input_side, e, x);
        }
        match &self.input_saturation {
            Some(limits) => limits.step(&mut (), e, x),
            None => x,
        }
    }
}

#[cfg(test)]
mod tests;
