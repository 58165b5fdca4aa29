//! Parameters of the stages around an operator, and of a whole chain.

use super::OperatorParams;
use crate::{
    AsymmetryParams, Chain, CreepParams, DelayParams, DriftParams, Error, InterferenceParams, LagParams, LoadParams,
    MAX_RESONANCES, RateParams, Real, ResonanceParams, Sampling, SaturationParams, TemperatureParams, WideningParams,
};

/// The optional stages of a chain, in the order of the chain. `L` is any list of numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct EffectParams<L> {
    /// Dead time.
    pub delay: Option<DelayParams>,
    /// Lag of the amplifier.
    pub lag: Option<LagParams>,
    /// Widening of the loop with the rate of the drive.
    pub rate: Option<RateParams>,
    /// Widening of each loop with the rate, in proportion to its width.
    pub widening: Option<WideningParams<L>>,
    /// Static curve after or before the hysteresis.
    pub asymmetry: Option<AsymmetryParams<L>>,
    /// Change of gain and zero with temperature.
    pub temperature: Option<TemperatureParams>,
    /// Creep bank.
    pub creep: Option<CreepParams<L>>,
    /// Compliance under an external load.
    pub load: Option<LoadParams>,
    /// Structural modes in series.
    pub resonances: [Option<ResonanceParams>; MAX_RESONANCES],
    /// Limits of the motion (mechanical stops) or of the drive.
    pub saturation: Option<SaturationParams>,
    /// Drift of the sensor.
    pub drift: Option<DriftParams>,
    /// Tone in the sensor.
    pub interference: Option<InterferenceParams>,
}

impl<L: AsRef<[f64]>> EffectParams<L> {
    /// Builds the chain of these stages around an operator.
    ///
    /// # Errors
    /// Names the parameter that is not finite, out of range or too long for `D` or `C`.
    pub fn around<T: Real, H, const D: usize, const C: usize>(
        &self,
        hysteresis: H,
        cx: &Sampling,
    ) -> Result<Chain<T, H, D, C>, Error> {
        let mut chain = Chain::new(hysteresis);
        if let Some(p) = &self.delay {
            chain = chain.with_delay(p, cx)?;
        }
        if let Some(p) = &self.lag {
            chain = chain.with_lag(p, cx)?;
        }
        if let Some(p) = &self.rate {
            chain = chain.with_rate(p, cx)?;
        }
        if let Some(p) = &self.widening {
            chain = chain.with_widening(p, cx)?;
        }
        if let Some(p) = &self.asymmetry {
            chain = chain.with_asymmetry(p)?;
        }
        if let Some(p) = &self.temperature {
            chain = chain.with_temperature(p, cx)?;
        }
        if let Some(p) = &self.creep {
            chain = chain.with_creep(p, cx)?;
        }
        if let Some(p) = &self.load {
            chain = chain.with_load(p)?;
        }
        for p in self.resonances.iter().flatten() {
            chain = chain.with_resonance(p, cx)?;
        }
        if let Some(p) = &self.saturation {
            chain = chain.with_saturation(p)?;
        }
        if let Some(p) = &self.drift {
            chain = chain.with_drift(p)?;
        }
        if let Some(p) = &self.interference {
            chain = chain.with_interference(p)?;
        }
        Ok(chain)
    }
}

/// A whole actuator: everything that firmware needs from a model. `L` is the list of the operator (plays, cells of a
/// triangle). `E` is the list of the stages around it (creep elements, dead zones), which is much shorter.
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ChainParams<L, E = L> {
    /// The memory operator.
    pub operator: OperatorParams<L>,
    /// The stages around it.
    pub effects: EffectParams<E>,
    /// Whether the output falls where the operator rises.
    pub falls: bool,
    /// Reading of the sensor at rest \[y\].
    pub zero: f64,
    /// Minimum and maximum of the inputs from which the model was identified \[u\].
    pub input: [f64; 2],
}

impl<L, E: AsRef<[f64]>> ChainParams<L, E> {
    /// Builds the chain of the stages around an operator that was built from [`operator`](Self::operator), with the
    /// sensor zero.
    ///
    /// # Errors
    /// Names the parameter that is not finite, out of range or too long for `D` or `C`.
    pub fn around<T: Real, H, const D: usize, const C: usize>(
        &self,
        hysteresis: H,
        cx: &Sampling,
    ) -> Result<Chain<T, H, D, C>, Error> {
        Ok(self.effects.around(hysteresis, cx)?.with_falling(self.falls).with_zero(self.zero))
    }
}
