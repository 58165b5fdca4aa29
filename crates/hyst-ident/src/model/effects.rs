//! The effects: optional stages around the base model, as parameters.

use std::fmt;
use std::str::FromStr;

use hyst_core::{
    AsymmetryParams, CreepParams, CurveSide, DelayParams, DriftParams, EffectParams, InterferenceParams, LagParams,
    LoadParams, MAX_RESONANCES, Meta, Params, RateParams, ResonanceParams, SaturationParams, TemperatureParams,
    WideningParams,
};
use serde::{Deserialize, Serialize};

/// An effect in addition to the hysteresis, in the order of the chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Effect {
    /// Dead time of the drive.
    Delay,
    /// First-order lag of the amplifier.
    Lag,
    /// A static nonlinearity before or after the hysteresis: one end of the loop is steeper.
    Asymmetry,
    /// Rate-dependent hysteresis: the loop widens with the rate of the drive.
    RateDependence,
    /// Gain and zero depend on temperature.
    Temperature,
    /// Slow relaxation after the drive has stopped.
    Creep,
    /// Compliance under an external force.
    Load,
    /// A structural mode.
    Resonance,
    /// A limit of the motion or of the drive.
    Saturation,
    /// Drift of the sensor.
    Drift,
    /// A tone in the sensor signal.
    Interference,
}

impl Effect {
    /// All effects, in the order of the chain.
    pub const ALL: [Self; 11] = [
        Self::Delay,
        Self::Lag,
        Self::Asymmetry,
        Self::RateDependence,
        Self::Temperature,
        Self::Creep,
        Self::Load,
        Self::Resonance,
        Self::Saturation,
        Self::Drift,
        Self::Interference,
    ];

    /// Returns the name in commands and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Delay => "delay",
            Self::Lag => "lag",
            Self::Asymmetry => "asymmetry",
            Self::RateDependence => "rate-dependence",
            Self::Temperature => "temperature",
            Self::Creep => "creep",
            Self::Load => "load",
            Self::Resonance => "resonance",
            Self::Saturation => "saturation",
            Self::Drift => "drift",
            Self::Interference => "interference",
        }
    }

    /// Returns the number of parameters.
    ///
    /// Of two effects that a record does not distinguish, the one with fewer parameters is the simpler explanation.
    pub(crate) fn complexity(self) -> usize {
        match self {
            Self::Delay | Self::Lag | Self::Temperature | Self::Load | Self::Drift => 1,
            Self::RateDependence | Self::Saturation => 2,
            Self::Resonance | Self::Interference => 3,
            Self::Creep => 4,
            Self::Asymmetry => 5,
        }
    }

    /// Returns whether the effect acts on the motion; false if it acts only on the sensor signal.
    pub fn acts_on_the_motion(self) -> bool {
        !matches!(self, Self::Drift | Self::Interference)
    }
}

impl fmt::Display for Effect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Effect {
    type Err = String;
    fn from_str(s: &str) -> Result<Self, String> {
        let names = || Self::ALL.map(Self::name).join(", ");
        let found = Self::ALL.into_iter().find(|e| e.name() == s);
        found.ok_or_else(|| format!("there is no effect {s:?}; the effects are {}", names()))
    }
}

/// Lower bound of a weight of an input curve (change of slope at a threshold). It keeps the curve increasing.
const MIN_CURVE_WEIGHT: f64 = -0.9;

/// A bank of creep elements, as parameters.
pub type CreepBank = CreepParams<Vec<f64>>;

/// Play operators whose thresholds grow with the rate, as parameters.
pub type Widening = WideningParams<Vec<f64>>;

/// The effects of a chain, and their parameters.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Effects {
    /// Dead time.
    pub delay: Option<DelayParams>,
    /// Lag.
    pub lag: Option<LagParams>,
    /// Rate dependence for any base model. `pi` also has play operators with drag.
    pub rate: Option<RateParams>,
    /// Rate dependence in proportion to the width of the loop, for any base model.
    pub widening: Option<Widening>,
    /// Temperature dependence of gain, loop width and zero.
    pub temperature: Option<TemperatureParams>,
    /// Creep bank.
    pub creep: Option<CreepBank>,
    /// Structural modes, at most [`MAX_RESONANCES`].
    pub resonances: Vec<ResonanceParams>,
    /// Drift.
    pub drift: Option<DriftParams>,
    /// Tone.
    pub interference: Option<InterferenceParams>,
    /// Curve before or after the hysteresis.
    pub asymmetry: Option<AsymmetryParams<Vec<f64>>>,
    /// Compliance and gain under load.
    pub load: Option<LoadParams>,
    /// Limits of the motion or of the drive.
    pub saturation: Option<SaturationParams>,
}

/// The stages before the hysteresis, in order.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct InputSide<'a> {
    pub(crate) saturation: Option<SaturationParams>,
    pub(crate) delay: Option<DelayParams>,
    pub(crate) lag: Option<LagParams>,
    pub(crate) rate: Option<RateParams>,
    pub(crate) curve: Option<&'a AsymmetryParams<Vec<f64>>>,
}

/// A parameter of a search, with its bounds and a reference to its value.
pub(crate) struct Parameter<'a> {
    pub(crate) effect: Effect,
    pub(crate) name: String,
    pub(crate) lower: f64,
    pub(crate) upper: f64,
    pub(crate) value: &'a mut f64,
}

impl Effects {
    /// Returns the effects that are present, in the order of the chain. A second mode is listed again.
    pub fn names(&self) -> Vec<Effect> {
        let mut names = Vec::new();
        let mut push = |present: bool, e: Effect| {
            if present {
                names.push(e);
            }
        };
        push(self.delay.is_some(), Effect::Delay);
        push(self.lag.is_some(), Effect::Lag);
        push(self.asymmetry.is_some(), Effect::Asymmetry);
        push(self.rate.is_some() || self.widening.is_some(), Effect::RateDependence);
        push(self.temperature.is_some(), Effect::Temperature);
        push(self.creep.is_some(), Effect::Creep);
        push(self.load.is_some(), Effect::Load);
        for _ in &self.resonances {
            push(true, Effect::Resonance);
        }
        push(self.saturation.is_some(), Effect::Saturation);
        push(self.drift.is_some(), Effect::Drift);
        push(self.interference.is_some(), Effect::Interference);
        names
    }

    /// Converts the effects to the parameters of `hyst-core`.
    pub fn to_params(&self) -> EffectParams<Vec<f64>> {
        let mut modes = self.resonances.iter().copied();
        EffectParams {
            delay: self.delay,
            lag: self.lag,
            rate: self.rate,
            widening: self.widening.clone(),
            asymmetry: self.asymmetry.clone(),
            temperature: self.temperature,
            creep: self.creep.clone(),
            load: self.load,
            resonances: std::array::from_fn(|_| modes.next()),
            saturation: self.saturation,
            drift: self.drift,
            interference: self.interference,
        }
    }

    /// Returns whether there is no effect.
    pub fn is_empty(&self) -> bool {
        self.names().is_empty()
    }

    /// Returns whether the chain can have this effect, or another mode.
    pub(crate) fn has_room(&self, effect: Effect) -> bool {
        let count = self.names().iter().filter(|e| **e == effect).count();
        count < if effect == Effect::Resonance { MAX_RESONANCES } else { 1 }
    }

    /// Returns the effects without `effect` (without the last one, if there are two modes).
    pub fn without(&self, effect: Effect) -> Self {
        let mut less = self.clone();
        match effect {
            Effect::Delay => less.delay = None,
            Effect::Lag => less.lag = None,
            Effect::Asymmetry => less.asymmetry = None,
            Effect::RateDependence => (less.rate, less.widening) = (None, None),
            Effect::Temperature => less.temperature = None,
            Effect::Creep => less.creep = None,
            Effect::Load => less.load = None,
            Effect::Resonance => {
                less.resonances.pop();
            }
            Effect::Saturation => less.saturation = None,
            Effect::Drift => less.drift = None,
            Effect::Interference => less.interference = None,
        }
        less
    }

    /// Returns the stages before the hysteresis.
    pub(crate) fn input_side(&self) -> InputSide<'_> {
        InputSide {
            saturation: self.limits(CurveSide::Input),
            delay: self.delay,
            lag: self.lag,
            rate: self.rate,
            curve: self.curve(CurveSide::Input),
        }
    }

    /// Returns the saturation, if it is on this side of the hysteresis.
    pub(crate) fn limits(&self, side: CurveSide) -> Option<SaturationParams> {
        self.saturation.filter(|p| p.side == side)
    }

    /// Returns the curve, if it is on this side of the hysteresis.
    pub(crate) fn curve(&self, side: CurveSide) -> Option<&AsymmetryParams<Vec<f64>>> {
        self.asymmetry.as_ref().filter(|p| p.side == side)
    }

    /// Calls `f` for every parameter that enters the output nonlinearly, always in the same order.
    ///
    /// Linear parameters are not visited: rate and height of a drift, compliance, thermal expansion, gain beside the
    /// hysteresis, weights of a widening
    /// and of an asymmetry after the hysteresis, amplitude and phase of a tone.
    pub(crate) fn visit_nonlinear(&mut self, f: &mut dyn FnMut(Parameter<'_>)) {
        fn pass(effect: Effect, suffix: &str, params: &mut dyn Params, f: &mut dyn FnMut(Parameter<'_>)) {
            params.visit(&mut |meta, value| {
                f(Parameter {
                    effect,
                    name: format!("{}{suffix}", meta.name),
                    lower: meta.lower,
                    upper: meta.upper,
                    value,
                });
            });
        }
        if let Some(p) = &mut self.delay {
            pass(Effect::Delay, "", p, f);
        }
        if let Some(p) = &mut self.lag {
            pass(Effect::Lag, "", p, f);
        }
        if let Some(p) = &mut self.rate {
            pass(Effect::RateDependence, "", p, f);
        }
        if let Some(p) = &mut self.widening {
            pass(Effect::RateDependence, "", p, &mut |parameter| {
                if parameter.name != "weights" {
                    f(parameter);
                }
            });
        }
        if let Some(p) = self.asymmetry.as_mut().filter(|p| p.side == CurveSide::Input) {
            let mut at = 0;
            p.visit(&mut |meta, value| {
                if meta.name == "weights" {
                    let name = format!("weights[{at}]");
                    f(Parameter { effect: Effect::Asymmetry, name, lower: MIN_CURVE_WEIGHT, upper: meta.upper, value });
                    at += 1;
                }
            });
        }
        if let Some(p) = &mut self.temperature {
            let lags = p.seconds > 0.0;
            pass(Effect::Temperature, "", p, &mut |parameter| {
                if parameter.name == "per_kelvin" || (parameter.name == "seconds" && lags) {
                    f(parameter);
                }
            });
        }
        if let Some(p) = self.load.as_mut().filter(|p| p.gain_per_newton != 0.0) {
            pass(Effect::Load, "", p, &mut |parameter| {
                if parameter.name == "gain_per_newton" {
                    f(parameter);
                }
            });
        }
        if let Some(bank) = &mut self.creep {
            let taus = bank.seconds.clone();
            let mut taus = taus.iter();
            bank.visit(&mut |meta: &Meta, value| {
                if let Some(tau) = (meta.name == "shares").then(|| taus.next()).flatten() {
                    let name = creep_share(*tau);
                    f(Parameter { effect: Effect::Creep, name, lower: meta.lower, upper: meta.upper, value });
                }
            });
        }
        for (i, p) in self.resonances.iter_mut().enumerate() {
            pass(Effect::Resonance, if i == 0 { "" } else { "_2" }, p, f);
        }
        if let Some(p) = &mut self.saturation {
            pass(Effect::Saturation, "", p, f);
        }
        if let Some(p) = self.drift.as_mut().filter(|p| p.seconds > 0.0) {
            pass(Effect::Drift, "", p, &mut |parameter| {
                if parameter.name == "seconds" {
                    f(parameter);
                }
            });
        }
        if let Some(p) = &mut self.interference {
            pass(Effect::Interference, "", p, &mut |parameter| {
                if parameter.name == "hz" {
                    f(parameter);
                }
            });
        }
    }
}

/// Returns the name of the share of a creep element with this time constant \[s\].
///
/// The name has three decimals, or more for short time constants, so that names are unique.
pub(crate) fn creep_share(seconds: f64) -> String {
    let decimals = (2.0 - seconds.log10().floor()).clamp(3.0, 12.0) as usize;
    format!("share_{seconds:.decimals$}s")
}
