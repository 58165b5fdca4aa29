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
/// y − zero → saturation⁻¹ → resonances⁻¹ → ÷load → creep⁻¹ → ÷temperature → asymmetry⁻¹ (output side)
///   → −widening → HYSTERESIS⁻¹ → asymmetry⁻¹ (input side) → rate⁻¹ → (lag, delay)⁻¹ → u
/// ```
///
/// - Resonances, lag and delay are inverted in a band, with [`lead`](Self::lead) samples of preview.
///   [`error`](Self::error) returns the error.
/// - The rate is inverted by [`RateInverse`].
/// - The widening is evaluated at the drive that is extrapolated linearly from the last two samples. The error is the
///   second difference of the drive times the weights of the widening. If the inverse hysteresis needs preview, the
///   widening is evaluated at the last known drive.
/// - The change of the gain beside the hysteresis with temperature is evaluated at the same drive as the widening.
/// - All other stages are inverted exactly; the saturation only within its limits.
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

/// Number of times that the drive at rest is computed again with the gain beside the hysteresis.
const RESETS: usize = 8;

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
        x = at(T::ZERO);
        // The gain beside the hysteresis depends on the drive that is sought.
        if direct != T::ZERO {
            for _ in 0..RESETS {
                x = at(x);
            }
        }
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
        x
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
        if let Some(temperature) = &self.temperature {
            let (factor, shift) = temperature.step_felt(&mut s.thermal, e);
            let beside = temperature.direct(&s.thermal) * signed(self.falls, next);
            x = (x - shift - beside) / positive_or_held(&mut s.factor, factor);
        }
        if let Some(asymmetry) = &self.asymmetry {
            x = asymmetry.step(&mut (), e, x);
        }
        x = signed(self.falls, x);
        if let Some(widening) = &self.widening {
            x -= widening.at(&s.widening, next);
        }
        x = self.hysteresis.step(&mut s.hysteresis, e, x);
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
        match &self.input_side {
            Some(filter) => filter.step(&mut s.input_side, e, x),
            None => x,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        Activation, ActivationKind, ActivationParams, AntiCausal, AsymmetryParams, BoucWen, BoucWenParams, CreepParams,
        LagParams, LoadParams, Pi, ResonanceParams, SaturationParams, TemperatureParams,
    };
    use std::boxed::Box;
    use std::vec::Vec;

    const PERIOD: Sampling = Sampling { period: 1e-3 };
    type Plain = Chain<f64, Pi<f64, 4>, 64, 4>;

    fn pi() -> Pi<f64, 4> {
        Pi::new(0.1, &[5.0, 12.0, 25.0, 40.0], &[0.02, 0.02, 0.01, 0.01]).unwrap()
    }

    fn env(k: usize) -> Env<f64> {
        let t = 1e-3 * k as f64;
        Env { time: t, temperature: 23.0 + 5.0 * libm::sin(0.7 * t), load: 10.0 * libm::sin(1.3 * t) }
    }

    type Inverse<I> = Compensator<f64, I, 64, 4, 511>;

    /// Returns the maximum |output − reference| of a chain driven by its own compensator, and the stated error.
    fn worst(chain: &Plain, reference: impl Fn(usize) -> f64, rows: usize) -> (f64, f64) {
        let inverse: Box<Inverse<_>> = Box::new(chain.compensator(&PERIOD, &CompensatorOptions::default()).unwrap());
        (max_error(chain, &inverse, reference, rows), inverse.error())
    }

    /// Returns the maximum |output − reference| of a chain driven by a compensator, both from rest.
    fn max_error<H: Stage<f64>, I: Stage<f64>>(
        chain: &Chain<f64, H, 64, 4>,
        inverse: &Inverse<I>,
        reference: impl Fn(usize) -> f64,
        rows: usize,
    ) -> f64 {
        let (mut s, mut i) = (chain.state(), inverse.state());
        let lead = inverse.lead();
        let at = |k: usize| reference(k.min(rows - 1));
        let mut drive = Vec::new();
        let first = inverse.reset(&mut i, &env(0), at(0));
        if lead == 0 {
            drive.push(first);
        }
        for k in 1..rows + lead {
            let u = inverse.step(&mut i, &env(k), at(k));
            if k >= lead {
                drive.push(u);
            }
        }
        let mut worst = 0.0f64;
        for (k, u) in drive.iter().enumerate() {
            let y = if k == 0 { chain.reset(&mut s, &env(k), *u) } else { chain.step(&mut s, &env(k), *u) };
            // The last value of the reference is held for the preview; the error there is not checked.
            if k + lead < rows {
                worst = worst.max((y - at(k)).abs());
            }
        }
        worst
    }

    fn smooth(k: usize) -> f64 {
        let t = 1e-3 * k as f64;
        3.0 * (1.0 - libm::cos(6.0 * t)) + 1.0 * (1.0 - libm::cos(41.0 * t))
    }

    /// The error of a step is at most the weights of the widening times the second difference of the drive.
    #[test]
    fn the_error_of_an_inverted_widening_is_the_second_difference_of_the_drive() {
        let widening = crate::WideningParams {
            growth: 0.3,
            exponent: 0.4,
            reference_rate: 300.0,
            seconds: 4e-3,
            thresholds: [5.0, 12.0, 25.0],
            weights: [0.02, 0.02, 0.01],
        };
        for falls in [false, true] {
            let chain = Plain::new(pi()).with_widening(&widening, &PERIOD).unwrap().with_falling(falls);
            let inverse: Box<Inverse<_>> =
                Box::new(chain.compensator(&PERIOD, &CompensatorOptions::default()).unwrap());
            let (mut s, mut i) = (chain.state(), inverse.state());
            let reference = |k: usize| signed(falls, smooth(k));
            let first = inverse.reset(&mut i, &env(0), reference(0));
            chain.reset(&mut s, &env(0), first);
            let (mut last, mut before, mut widest) = (first, first, 0.0f64);
            for k in 1..4000 {
                widest = widest.max(chain.widening.unwrap().at(&s.widening, last).abs());
                let u = inverse.step(&mut i, &env(k), reference(k));
                let error = (chain.step(&mut s, &env(k), u) - reference(k)).abs();
                let bound = widening.weights.iter().sum::<f64>() * (u - 2.0 * last + before).abs();
                assert!(error <= bound + 1e-12, "row {k}: {error} {bound}");
                (before, last) = (last, u);
            }
            // The widening was large enough for a test.
            assert!(widest > 0.2 * widening.extra_half_width(), "{widest}");
        }
    }

    /// The gain beside the hysteresis acts on the drive that is sought; the error is the second difference of the drive
    /// times that gain.
    #[test]
    fn a_loop_width_that_changes_with_temperature_is_inverted_within_the_bound() {
        let p =
            TemperatureParams { per_kelvin: 0.02, reference_degc: 20.0, expansion: 0.1, direct: -2e-3, seconds: 2.0 };
        for falls in [false, true] {
            let chain = Plain::new(pi()).with_temperature(&p, &PERIOD).unwrap().with_falling(falls);
            let inverse: Box<Inverse<_>> =
                Box::new(chain.compensator(&PERIOD, &CompensatorOptions::default()).unwrap());
            let (mut s, mut i) = (chain.state(), inverse.state());
            let reference = |k: usize| signed(falls, smooth(k));
            let first = inverse.reset(&mut i, &env(0), reference(0));
            let start = chain.reset(&mut s, &env(0), first);
            assert!((start - reference(0)).abs() < 1e-9, "{start}");
            let (mut last, mut before, mut largest) = (first, first, 0.0f64);
            for k in 1..4000 {
                let u = inverse.step(&mut i, &env(k), reference(k));
                let error = (chain.step(&mut s, &env(k), u) - reference(k)).abs();
                let beside = chain.temperature.unwrap().direct(&s.thermal).abs();
                assert!(error <= beside * (u - 2.0 * last + before).abs() + 1e-9, "row {k}: {error}");
                (before, last, largest) = (last, u, largest.max(beside * u.abs()));
            }
            assert!(largest > 0.1, "{largest}");
        }
    }

    #[test]
    fn static_stages_and_creep_are_inverted_exactly() {
        let temperature =
            TemperatureParams { per_kelvin: 0.006, reference_degc: 23.0, expansion: 0.1, direct: 0.0, seconds: 2.0 };
        let chain = Plain::new(pi())
            .with_zero(4.0)
            .with_temperature(&temperature, &PERIOD)
            .and_then(|c| {
                c.with_creep(&CreepParams { seconds: &[0.05, 0.5, 5.0], shares: &[0.02, 0.02, 0.02] }, &PERIOD)
            })
            .and_then(|c| c.with_asymmetry(&AsymmetryParams::behind([2.0, -0.5], [0.2, -0.1])))
            .and_then(|c| c.with_asymmetry(&AsymmetryParams::before([15.0, 45.0], [0.3, -0.2])))
            .and_then(|c| c.with_load(&LoadParams { per_newton: 0.05, gain_per_newton: 0.01 }))
            .and_then(|c| c.with_saturation(&SaturationParams { low: -4.0, high: 10.0, knee: 0.3 }))
            .unwrap();
        let (rising, stated) = worst(&chain, |k| 4.0 + smooth(k), 4000);
        assert!(rising < 1e-11 && stated == 0.0, "{rising}");
        let (falling, _) = worst(&chain.with_falling(true), |k| 4.0 - 0.4 * smooth(k), 4000);
        assert!(falling < 1e-11, "{falling}");
    }

    #[test]
    fn a_resonance_is_inverted_within_the_stated_error() {
        for gain in [1.0, 0.9, 0.6] {
            let mode = ResonanceParams { hz: 90.0, damping: 0.02, gain };
            let chain = Plain::new(Pi::new(0.1, &[], &[]).unwrap()).with_resonance(&mode, &PERIOD).unwrap();
            let (worst, stated) = worst(&chain, smooth, 4000);
            assert!(stated < 5e-3 && worst < 8.0 * stated.max(1e-6), "gain {gain}: {worst} {stated}");
        }
    }

    #[test]
    fn lag_delay_and_resonance_are_inverted_around_hysteresis() {
        let chain = Plain::new(pi())
            .with_delay(&DelayParams { seconds: 3.4e-3 }, &PERIOD)
            .and_then(|c| c.with_lag(&LagParams { seconds: 4e-3 }, &PERIOD))
            .and_then(|c| c.with_resonance(&ResonanceParams { hz: 110.0, damping: 0.03, gain: 0.95 }, &PERIOD))
            .unwrap();
        let (worst, stated) = worst(&chain, smooth, 4000);
        // The drive has a corner at each reversal, which a band-limited inverse of the lag cannot follow.
        assert!(stated < 5e-3 && worst < 5e-3 * 8.0, "{worst} {stated}");
    }

    /// The inverse of Bouc-Wen is a search. The inverse of an activation model needs preview. Both are in a chain with
    /// a mode.
    #[test]
    fn a_compensator_accepts_a_given_inverse() {
        let mode = ResonanceParams { hz: 90.0, damping: 0.02, gain: 0.9 };
        let options = CompensatorOptions::default();

        let params = BoucWenParams { k0: 0.12, alpha: 0.05, beta: 0.02, gamma: 0.01, n: 1.0 };
        let bouc_wen: BoucWen<f64> = params.build(&()).unwrap();
        let inverse = bouc_wen.inverse(-200.0, 300.0, 1e-12).unwrap();
        let given = InverseHysteresis { inverse, lead: 0, band: None };
        let chain: Chain<f64, _, 64, 4> = Chain::new(bouc_wen).with_resonance(&mode, &PERIOD).unwrap();
        let inverse: Box<Inverse<_>> = Box::new(chain.compensator_with(given, &PERIOD, &options).unwrap());
        let error = max_error(&chain, &inverse, smooth, 4000);
        assert!(inverse.error() < 5e-3 && error < 8.0 * inverse.error(), "{error} {}", inverse.error());

        let params = ActivationParams { k0: 0.15, alpha: -1e-4, beta: 0.4, gamma: 0.05 };
        let tanh: Activation<f64> = (ActivationKind::Tanh, params).build(&PERIOD).unwrap();
        let inverse: AntiCausal<f64, 128> = tanh.anti_causal(1e-12).unwrap();
        let given = InverseHysteresis { lead: inverse.lead(), inverse, band: None };
        let chain: Chain<f64, _, 64, 4> = Chain::new(tanh).with_resonance(&mode, &PERIOD).unwrap();
        let inverse: Box<Inverse<_>> = Box::new(chain.compensator_with(given, &PERIOD, &options).unwrap());
        let error = max_error(&chain, &inverse, smooth, 4000);
        assert!(inverse.lead() > inverse.hysteresis().lead() && inverse.hysteresis().lead() > 0);
        assert!(inverse.error() < 5e-3 && error < 8.0 * inverse.error(), "{error} {}", inverse.error());
    }

    #[test]
    fn a_band_that_needs_too_many_taps_is_rejected() {
        let slow = ResonanceParams { hz: 2.0, damping: 0.02, gain: 1.0 };
        let chain = Plain::new(pi()).with_resonance(&slow, &PERIOD).unwrap();
        let built: Result<Compensator<f64, _, 64, 4, 511>, _> =
            chain.compensator(&PERIOD, &CompensatorOptions::default());
        assert!(matches!(built, Err(Error::Capacity { name: "preview taps", .. })));
    }
}
