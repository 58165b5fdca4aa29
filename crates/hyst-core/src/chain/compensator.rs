//! The inverse of a chain: from a reference to the drive that makes the actuator follow it.

use super::chain::signed;
use super::preview::{Preview, PreviewState};
use crate::stage::{hold, rest};
use crate::{
    AsymmetryInverse, Build, Chain, Complex, CreepInverse, CreepInverseState, Delay, DelayParams, DelayState, Env,
    Error, Invert, Load, MAX_DEAD_ZONES, RateInverse, RateState, Real, Sampling, SaturationInverse, Stage, Temperature,
    TemperatureState, Widening, WideningState,
};

/// How the dynamic stages are inverted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CompensatorOptions {
    /// Band in which lag, delay and resonances are inverted \[Hz\], at most a quarter of the sample
    /// rate. `None` chooses: 0.16 of the sample rate, on the output side at most 2.5 times the lowest
    /// mode's frequency and 0.4 of an antiresonance.
    pub bandwidth_hz: Option<f64>,
}

/// The inverse chain, stage by stage from the output back to the input:
///
/// `y − zero → saturation⁻¹ → resonances⁻¹ → −load → creep⁻¹ → ÷temperature → asymmetry⁻¹ → −widening, HYSTERESIS⁻¹, asymmetry⁻¹ → rate⁻¹ → (lag, delay)⁻¹ → u`.
///
/// All but rate, widening, resonances, lag and delay is inverted exactly (saturation as far as its limits can be reached); of the rate see [`RateInverse`]. What a widening
/// adds is taken where the drive would be if it went on as it did: off by the second difference of the drive, times the weights of the widening. With an
/// inverse hysteresis that needs preview it is that of the last drive that is known. Resonances, lag and delay are inverted in
/// a band with [`lead`](Self::lead) samples of preview; [`error`](Self::error) states how well. Drift
/// and interference are in the sensor, not in the motion: the drive does not follow them.
///
/// `HI` is the inverse hysteresis, `D` the capacity of the delay, `C` that of the creep bank, `N` the
/// taps that one preview filter can hold.
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
    /// Preview besides that of the filters: whole samples of dead time, and what the inverse hysteresis needs.
    whole_samples: usize,
    /// The share of the inverse hysteresis in it.
    hysteresis_lead: usize,
    /// Band \[Hz\] and error of the inverse hysteresis, if it has dynamics of its own.
    hysteresis_band: Option<(f64, f64)>,
    surroundings: Delay<T, N>,
    sample_rate: f64,
}

/// History of a compensator.
#[derive(Clone, Debug)]
pub struct CompensatorState<T, S, const C: usize, const N: usize> {
    reference: T,
    degc: T,
    newton: T,
    factor: T,
    output_side: PreviewState<T, N>,
    load: DelayState<T, N>,
    creep: CreepInverseState<T, C>,
    temperature: DelayState<T, N>,
    felt: TemperatureState<T>,
    hysteresis: S,
    widening: WideningState<T>,
    /// Where the hysteresis was driven to before the last input of the widening.
    before: T,
    rate: RateState<T>,
    input_side: PreviewState<T, N>,
}

/// The gain over temperature, or the last one that was positive.
fn usable<T: Real>(held: &mut T, factor: T) -> T {
    if factor > T::ZERO { hold(held, factor) } else { *held }
}

/// Band that is chosen where no mode narrows it \[cycles per sample\]. The filter fades out up to twice
/// the band; near half the sample rate a sampled lag or mode passes next to nothing, and its inverse
/// would amplify a hundredfold.
const WIDEST: f64 = 0.16;

/// The inverse of a hysteresis operator, and what a compensator around it has to know of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct InverseHysteresis<I> {
    /// The inverse operator.
    pub inverse: I,
    /// Samples of preview that it needs: its `step` takes the reference of time k + lead, returns the drive of time k.
    pub lead: usize,
    /// Band in which it holds \[Hz\] and its largest relative error there; `None` if it holds at all frequencies.
    pub band: Option<(f64, f64)>,
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
        let inverse = self.hysteresis.invert()?;
        let (lead, band) = (H::lead(&inverse), H::band(&inverse));
        self.compensator_with(InverseHysteresis { inverse, lead, band }, sampling, options)
    }
}

impl<T: Real, H, const D: usize, const C: usize> Chain<T, H, D, C> {
    /// Builds the compensator of this chain around an inverse that the hysteresis does not choose itself: a search
    /// ([`BoucWen::inverse`](crate::BoucWen::inverse), [`Search`](crate::Search) on a [`Dpm`](crate::Dpm)), one with preview
    /// ([`Activation::anti_causal`](crate::Activation::anti_causal)), one for a band
    /// ([`TdEm::band_limited`](crate::TdEm::band_limited)).
    ///
    /// # Errors
    /// If the creep has no inverse, or the preview filters do not fit in `N` taps.
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
            let band = options.bandwidth_hz.map_or((lowest * h).at_most(WIDEST), |hz| hz * h);
            Some(Preview::new(band, |z1| modes().fold(Complex::from(1.0), |r, m| r * m.response(z1)))?)
        } else {
            None
        };
        let fraction = self.delay.as_ref().filter(|d| d.fraction_response(Complex::default()).re < 1.0);
        let input_side = if self.lag.is_some() || fraction.is_some() {
            let band = options.bandwidth_hz.map_or(WIDEST, |hz| hz * h);
            Some(Preview::new(band, |z1| {
                let lag = self.lag.as_ref().map_or(Complex::from(1.0), |l| l.response(z1));
                fraction.map_or(Complex::from(1.0), |d| d.fraction_response(z1)) * lag
            })?)
        } else {
            None
        };
        // The temperature that divides a sample, and the load that is taken from it, belong to that sample.
        let late = output_side.as_ref().map_or(0, Preview::lead);
        Ok(Compensator {
            zero: self.zero,
            surroundings: DelayParams { seconds: late as f64 }.build(&Sampling { period: 1.0 })?,
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
    /// Samples by which the reference must be known ahead: the drive that `step` returns belongs to
    /// the time `lead` samples before that of the reference it was given.
    pub fn lead(&self) -> usize {
        let half = |p: &Option<Preview<T, N>>| p.as_ref().map_or(0, Preview::lead);
        half(&self.output_side) + half(&self.input_side) + self.whole_samples
    }

    /// Taps of the longest preview filter, and no less than the smallest `N` that can be built: another compensator of the same chain
    /// at the same sample period needs no more.
    pub fn taps(&self) -> usize {
        let half = |p: &Option<Preview<T, N>>| p.as_ref().map_or(0, Preview::lead);
        2 * half(&self.output_side).max(half(&self.input_side)).max(1) + 1
    }

    /// Samples of preview that the inverse hysteresis takes.
    pub fn hysteresis_lead(&self) -> usize {
        self.hysteresis_lead
    }

    /// Band in which the dynamic stages are inverted \[Hz\]; `None` if there are none.
    pub fn bandwidth_hz(&self) -> Option<f64> {
        [&self.output_side, &self.input_side]
            .into_iter()
            .flatten()
            .map(|p| p.bandwidth() * self.sample_rate)
            .chain(self.hysteresis_band.map(|(hz, _)| hz))
            .reduce(|a, b| a.at_most(b))
    }

    /// Largest relative error of the band-limited inversion inside its band.
    pub fn error(&self) -> f64 {
        let own = self.hysteresis_band.map_or(0.0, |(_, error)| error);
        [&self.output_side, &self.input_side].into_iter().flatten().fold(own, |sum, p| sum + p.error())
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
            reference: T::ZERO,
            degc: T::ZERO,
            newton: T::ZERO,
            factor: T::ONE,
            output_side: PreviewState::new(),
            load: DelayState::new(),
            creep: CreepInverseState::new(),
            temperature: DelayState::new(),
            felt: TemperatureState::default(),
            hysteresis: self.hysteresis.state(),
            widening: WideningState::default(),
            before: T::ZERO,
            rate: RateState::default(),
            input_side: PreviewState::new(),
        }
    }

    /// As if the reference had been `u0` for ever: memory virgin, then at the drive for `u0`.
    fn reset(&self, s: &mut Self::State, e: &Env<T>, u0: T) -> T {
        s.degc = self.temperature.as_ref().map_or(T::ZERO, Temperature::reference);
        s.factor = T::ONE;
        let e = &Env { temperature: hold(&mut s.degc, e.temperature), load: rest(&mut s.newton, e.load), ..*e };
        let mut x = rest(&mut s.reference, u0) - self.zero;
        if let Some(saturation) = &self.saturation {
            x = saturation.reset(&mut (), e, x);
        }
        if let Some(filter) = &self.output_side {
            filter.reset(&mut s.output_side, e, x);
        }
        self.surroundings.reset(&mut s.temperature, e, e.temperature);
        self.surroundings.reset(&mut s.load, e, e.load);
        if let Some(load) = &self.load {
            x -= load.deflection(e);
        }
        if let Some(creep) = &self.creep {
            x = creep.reset(&mut s.creep, e, x);
        }
        if let Some(temperature) = &self.temperature {
            let (factor, shift) = temperature.reset_felt(&mut s.felt, e);
            x = (x - shift) / usable(&mut s.factor, factor);
        }
        if let Some(asymmetry) = &self.asymmetry {
            x = asymmetry.reset(&mut (), e, x);
        }
        x = self.hysteresis.reset(&mut s.hysteresis, e, signed(self.falls, x));
        if let Some(widening) = &self.widening {
            widening.reset(&mut s.widening, e, x);
        }
        s.before = x;
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

    /// Takes the reference and the surroundings of time k + lead, returns the drive of time k. A reference or
    /// temperature that is no finite number is replaced by the last one that was, a temperature at which the model
    /// has no gain left by the last gain.
    fn step(&self, s: &mut Self::State, e: &Env<T>, u: T) -> T {
        let e = &Env { temperature: hold(&mut s.degc, e.temperature), load: hold(&mut s.newton, e.load), ..*e };
        let mut x = hold(&mut s.reference, u) - self.zero;
        if let Some(saturation) = &self.saturation {
            x = saturation.step(&mut (), e, x);
        }
        if let Some(filter) = &self.output_side {
            x = filter.step(&mut s.output_side, e, x);
        }
        // From here on everything belongs to the sample that left the filter.
        let e = &Env {
            temperature: self.surroundings.step(&mut s.temperature, e, e.temperature),
            load: self.surroundings.step(&mut s.load, e, e.load),
            ..*e
        };
        if let Some(load) = &self.load {
            x -= load.deflection(e);
        }
        if let Some(creep) = &self.creep {
            x = creep.step(&mut s.creep, e, x);
        }
        if let Some(temperature) = &self.temperature {
            let (factor, shift) = temperature.step_felt(&mut s.felt, e);
            x = (x - shift) / usable(&mut s.factor, factor);
        }
        if let Some(asymmetry) = &self.asymmetry {
            x = asymmetry.step(&mut (), e, x);
        }
        x = signed(self.falls, x);
        if let Some(widening) = &self.widening {
            let last = s.widening.u;
            let next = if self.hysteresis_lead == 0 { last + (last - s.before) } else { last };
            x -= widening.at(&s.widening, next);
        }
        x = self.hysteresis.step(&mut s.hysteresis, e, x);
        if let Some(widening) = &self.widening {
            s.before = s.widening.u;
            widening.step(&mut s.widening, e, x);
        }
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

    /// Largest |reached − reference| of a chain driven by its own compensator, and the error that this states.
    fn worst(chain: &Plain, reference: impl Fn(usize) -> f64, rows: usize) -> (f64, f64) {
        let inverse: Box<Inverse<_>> = Box::new(chain.compensator(&PERIOD, &CompensatorOptions::default()).unwrap());
        (missed(chain, &inverse, reference, rows), inverse.error())
    }

    /// Largest |reached − reference| of a chain driven by a compensator, both from rest.
    fn missed<H: Stage<f64>, I: Stage<f64>>(
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
            // The end of the reference is held for the preview: nothing is claimed there.
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

    /// What a step misses is at most the weights of the widening times the second difference of the drive.
    #[test]
    fn a_widening_is_inverted_but_for_the_second_difference_of_the_drive() {
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
                let missed = (chain.step(&mut s, &env(k), u) - reference(k)).abs();
                let bound = widening.weights.iter().sum::<f64>() * (u - 2.0 * last + before).abs();
                assert!(missed <= bound + 1e-12, "row {k}: {missed} {bound}");
                (before, last) = (last, u);
            }
            // It had something to invert.
            assert!(widest > 0.2 * widening.extra_half_width(), "{widest}");
        }
    }

    #[test]
    fn all_but_the_dynamic_stages_is_inverted_exactly() {
        let warm = TemperatureParams { per_kelvin: 0.006, reference_degc: 23.0, expansion: 0.1, seconds: 2.0 };
        let chain = Plain::new(pi())
            .with_zero(4.0)
            .with_temperature(&warm, &PERIOD)
            .and_then(|c| {
                c.with_creep(&CreepParams { seconds: &[0.05, 0.5, 5.0], shares: &[0.02, 0.02, 0.02] }, &PERIOD)
            })
            .and_then(|c| c.with_asymmetry(&AsymmetryParams::behind([2.0, -0.5], [0.2, -0.1])))
            .and_then(|c| c.with_asymmetry(&AsymmetryParams::before([15.0, 45.0], [0.3, -0.2])))
            .and_then(|c| c.with_load(&LoadParams { per_newton: 0.05 }))
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
    fn lag_delay_and_resonance_around_hysteresis() {
        let chain = Plain::new(pi())
            .with_delay(&DelayParams { seconds: 3.4e-3 }, &PERIOD)
            .and_then(|c| c.with_lag(&LagParams { seconds: 4e-3 }, &PERIOD))
            .and_then(|c| c.with_resonance(&ResonanceParams { hz: 110.0, damping: 0.03, gain: 0.95 }, &PERIOD))
            .unwrap();
        let (worst, stated) = worst(&chain, smooth, 4000);
        // Where the drive turns it has a corner, which no band-limited lag inverse follows.
        assert!(stated < 5e-3 && worst < 5e-3 * 8.0, "{worst} {stated}");
    }

    /// Bouc-Wen has no closed form, a printed activation model needs a preview: both in a chain with a mode.
    #[test]
    fn around_an_inverse_that_is_given() {
        let mode = ResonanceParams { hz: 90.0, damping: 0.02, gain: 0.9 };
        let options = CompensatorOptions::default();

        let params = BoucWenParams { k0: 0.12, alpha: 0.05, beta: 0.02, gamma: 0.01, n: 1.0 };
        let bouc_wen: BoucWen<f64> = params.build(&()).unwrap();
        let inverse = bouc_wen.inverse(-200.0, 300.0, 1e-12).unwrap();
        let given = InverseHysteresis { inverse, lead: 0, band: None };
        let chain: Chain<f64, _, 64, 4> = Chain::new(bouc_wen).with_resonance(&mode, &PERIOD).unwrap();
        let inverse: Box<Inverse<_>> = Box::new(chain.compensator_with(given, &PERIOD, &options).unwrap());
        let most = missed(&chain, &inverse, smooth, 4000);
        assert!(inverse.error() < 5e-3 && most < 8.0 * inverse.error(), "{most} {}", inverse.error());

        let params = ActivationParams { k0: 0.15, alpha: -1e-4, beta: 0.4, gamma: 0.05 };
        let tanh: Activation<f64> = (ActivationKind::Tanh, params).build(&PERIOD).unwrap();
        let inverse: AntiCausal<f64, 128> = tanh.anti_causal(1e-12).unwrap();
        let given = InverseHysteresis { lead: inverse.lead(), inverse, band: None };
        let chain: Chain<f64, _, 64, 4> = Chain::new(tanh).with_resonance(&mode, &PERIOD).unwrap();
        let inverse: Box<Inverse<_>> = Box::new(chain.compensator_with(given, &PERIOD, &options).unwrap());
        let most = missed(&chain, &inverse, smooth, 4000);
        assert!(inverse.lead() > inverse.hysteresis().lead() && inverse.hysteresis().lead() > 0);
        assert!(inverse.error() < 5e-3 && most < 8.0 * inverse.error(), "{most} {}", inverse.error());
    }

    #[test]
    fn a_band_that_needs_more_taps_than_there_are_says_so() {
        let slow = ResonanceParams { hz: 2.0, damping: 0.02, gain: 1.0 };
        let chain = Plain::new(pi()).with_resonance(&slow, &PERIOD).unwrap();
        let built: Result<Compensator<f64, _, 64, 4, 511>, _> =
            chain.compensator(&PERIOD, &CompensatorOptions::default());
        assert!(matches!(built, Err(Error::Capacity { name: "preview taps", .. })));
    }
}
