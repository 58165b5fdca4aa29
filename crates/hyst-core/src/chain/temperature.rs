//! Temperature dependence of gain, loop width and zero: `y = v (1 + α ΔT) + δ ΔT u + ε ΔT`, where
//! `τ dΔT/dt + ΔT = T − T₀`.
//!
//! v is the output of the hysteresis and u its drive. α changes the gain and the width of the loops alike, δ only the
//! gain: with δ = −α g, g the mean gain, the loops widen while the gain stays. ε is the thermal expansion of the mount, τ
//! the thermal time constant between thermometer and actuator.

use crate::chain::FirstOrder;
use crate::error::coefficient;
use crate::stage::finite_or;
use crate::{Build, Env, Error, Meta, Params, Real, Sampling, Stage};

/// Parameters of `y = v (1 + α ΔT) + δ ΔT u + ε ΔT`, `τ dΔT/dt + ΔT = T − T₀`. With α = δ = ε = 0 there is no temperature
/// dependence; with τ = 0 there is no thermal lag.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct TemperatureParams {
    /// Relative change of gain α \[1/K\].
    pub per_kelvin: f64,
    /// Temperature T₀ at which the gain is that of the hysteresis stage \[°C\]; a convention, not identified.
    pub reference_degc: f64,
    /// Thermal expansion ε \[y/K\].
    #[cfg_attr(feature = "serde", serde(default))]
    pub expansion: f64,
    /// Change of the gain beside the hysteresis δ \[y/(u K)\].
    #[cfg_attr(feature = "serde", serde(default))]
    pub direct: f64,
    /// Thermal time constant τ \[s\].
    #[cfg_attr(feature = "serde", serde(default))]
    pub seconds: f64,
}

impl Params for TemperatureParams {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        let any = f64::INFINITY;
        f(&Meta { name: "per_kelvin", unit: "1/K", lower: -any, upper: any }, &mut self.per_kelvin);
        f(&Meta { name: "expansion", unit: "y/K", lower: -any, upper: any }, &mut self.expansion);
        f(&Meta { name: "direct", unit: "y/(u K)", lower: -any, upper: any }, &mut self.direct);
        f(&Meta { name: "seconds", unit: "s", lower: 0.0, upper: 1e4 }, &mut self.seconds);
    }
}

/// Coefficients of the temperature stage at one sample period; the thermal lag is exact for a temperature that is
/// linear between samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Temperature<T> {
    per_kelvin: T,
    reference: T,
    expansion: T,
    direct: T,
    element: FirstOrder<T>,
}

impl<T: Real> Build<Temperature<T>> for TemperatureParams {
    type Context = Sampling;
    fn build(&self, cx: &Sampling) -> Result<Temperature<T>, Error> {
        Ok(Temperature {
            per_kelvin: coefficient("temperature.per_kelvin", self.per_kelvin)?,
            reference: coefficient("temperature.reference_degc", self.reference_degc)?,
            expansion: coefficient("temperature.expansion", self.expansion)?,
            direct: coefficient("temperature.direct", self.direct)?,
            element: FirstOrder::new("temperature.seconds", cx.checked()?, self.seconds)?,
        })
    }
}

/// History of the temperature stage: the last measured temperature, the temperature of the actuator \[K above T₀\], and
/// the last input.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TemperatureState<T> {
    measured: T,
    actuator: T,
    u: T,
}

impl<T: Real> Temperature<T> {
    /// Returns the temperature T₀ at which the gain is that of the hysteresis stage \[°C\].
    pub fn reference(&self) -> T {
        self.reference
    }

    /// Returns the factor `1 + α ΔT` and the shift `ε ΔT` for an actuator in thermal equilibrium at the measured
    /// temperature.
    #[inline]
    pub fn reset_felt(&self, s: &mut TemperatureState<T>, env: &Env<T>) -> (T, T) {
        let measured = finite_or(env.temperature - self.reference, T::ZERO);
        (s.measured, s.actuator) = (measured, measured);
        self.at(measured)
    }

    /// Returns the factor `1 + α ΔT` and the shift `ε ΔT` one sample period later.
    #[inline]
    pub fn step_felt(&self, s: &mut TemperatureState<T>, env: &Env<T>) -> (T, T) {
        let measured = finite_or(env.temperature - self.reference, s.measured);
        s.actuator = self.element.step(s.actuator, s.measured, measured);
        s.measured = measured;
        self.at(s.actuator)
    }

    /// Returns the gain beside the hysteresis `δ ΔT` at the temperature that the actuator has.
    #[inline]
    pub fn direct(&self, s: &TemperatureState<T>) -> T {
        self.direct * s.actuator
    }

    /// Returns factor and shift at `kelvin` above T₀.
    #[inline]
    fn at(&self, kelvin: T) -> (T, T) {
        (T::ONE + self.per_kelvin * kelvin, self.expansion * kelvin)
    }
}

/// The stage alone has no drive of a hysteresis: δ does not act.
impl<T: Real> Stage<T> for Temperature<T> {
    type State = TemperatureState<T>;
    fn state(&self) -> TemperatureState<T> {
        TemperatureState::default()
    }
    #[inline]
    fn reset(&self, s: &mut TemperatureState<T>, env: &Env<T>, u0: T) -> T {
        let (factor, shift) = self.reset_felt(s, env);
        s.u = finite_or(u0, T::ZERO);
        s.u * factor + shift
    }
    #[inline]
    fn step(&self, s: &mut TemperatureState<T>, env: &Env<T>, u: T) -> T {
        let (factor, shift) = self.step_felt(s, env);
        s.u = finite_or(u, s.u);
        s.u * factor + shift
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn built(p: TemperatureParams) -> Temperature<f64> {
        p.build(&Sampling { period: 0.1 }).unwrap()
    }

    fn at(temperature: f64) -> Env<f64> {
        Env { temperature, ..Env::default() }
    }

    #[test]
    fn without_a_thermal_lag_the_measured_temperature_acts_at_once() {
        let stage =
            built(TemperatureParams { per_kelvin: 0.01, reference_degc: 20.0, expansion: 0.2, ..Default::default() });
        let mut s = stage.state();
        assert_eq!(stage.reset(&mut s, &at(20.0), 5.0), 5.0);
        assert!((stage.step(&mut s, &at(23.0), 10.0) - (10.3 + 0.6)).abs() < 1e-12);
    }

    #[test]
    fn the_thermal_lag_follows_its_equation() {
        let stage = built(TemperatureParams { expansion: 1.0, seconds: 2.0, ..TemperatureParams::default() });
        let mut s = stage.state();
        stage.reset(&mut s, &at(0.0), 0.0);
        // A ramp of 1 K/s: T − τ (1 − exp(−t/τ)).
        for k in 1..=100 {
            let t = 0.1 * f64::from(k);
            let shift = stage.step(&mut s, &at(t), 0.0);
            assert!((shift - (t - 2.0 * (1.0 - libm::exp(-t / 2.0)))).abs() < 1e-12, "{shift} at {t}");
        }
    }

    #[test]
    fn a_dropout_of_the_thermometer_is_held() {
        let stage = built(TemperatureParams { expansion: 1.0, ..TemperatureParams::default() });
        let mut s = stage.state();
        stage.reset(&mut s, &at(2.0), 0.0);
        assert_eq!(stage.step(&mut s, &at(f64::NAN), 0.0), 2.0);
    }
}
