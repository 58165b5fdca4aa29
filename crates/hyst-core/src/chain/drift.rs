//! Drift of the sensor: `y = v + ρ t + A (1 − e^(−(t − t₀)/τ))`, t the lab clock.

use crate::error::{coefficient, within};
use crate::{Build, Env, Error, Meta, Params, Real, Stage};

/// Parameters of `y = v + ρ t + A (1 − e^(−(t − t₀)/τ))`, t the lab clock. Before t₀ the settling term is zero. With
/// ρ = A = 0 there is no drift.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DriftParams {
    /// Rate ρ \[output unit per s\].
    pub per_second: f64,
    /// Final value A of the settling term \[output unit\].
    #[cfg_attr(feature = "serde", serde(default))]
    pub settling: f64,
    /// Time constant τ of the settling \[s\]; zero without settling.
    #[cfg_attr(feature = "serde", serde(default))]
    pub seconds: f64,
    /// Start t₀ of the settling on the lab clock \[s\]; a convention, not identified.
    #[cfg_attr(feature = "serde", serde(default))]
    pub since_s: f64,
}

impl DriftParams {
    /// Returns the drift at a time of the lab clock \[output unit\].
    pub fn at(&self, time_s: f64) -> f64 {
        self.per_second * time_s + self.settling * self.settled(time_s)
    }

    /// Returns the settled share, 0 to 1, at a time of the lab clock.
    pub fn settled(&self, time_s: f64) -> f64 {
        if self.seconds > 0.0 { -libm::expm1(-((time_s - self.since_s) / self.seconds).at_least(0.0)) } else { 0.0 }
    }
}

impl Params for DriftParams {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        const INF: f64 = f64::INFINITY;
        f(&Meta { name: "per_second", unit: "y/s", lower: -INF, upper: INF }, &mut self.per_second);
        f(&Meta { name: "settling", unit: "y", lower: -INF, upper: INF }, &mut self.settling);
        f(&Meta { name: "seconds", unit: "s", lower: 0.0, upper: INF }, &mut self.seconds);
    }
}

/// Coefficients of the drift stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drift<T> {
    per_second: T,
    settling: T,
    /// 1/τ; zero without settling.
    rate: T,
    since: T,
}

impl<T: Real> Build<Drift<T>> for DriftParams {
    type Context = ();
    fn build(&self, (): &()) -> Result<Drift<T>, Error> {
        within("drift.seconds", self.seconds, self.seconds >= 0.0, "zero or positive")?;
        let rate = if self.seconds > 0.0 { 1.0 / self.seconds } else { 0.0 };
        Ok(Drift {
            per_second: coefficient("drift.per_second", self.per_second)?,
            settling: coefficient("drift.settling", self.settling)?,
            rate: coefficient("drift.seconds", rate)?,
            since: coefficient("drift.since_s", self.since_s)?,
        })
    }
}

impl<T: Real> Drift<T> {
    #[inline]
    fn at(&self, env: &Env<T>) -> T {
        let line = self.per_second * env.time;
        if self.settling == T::ZERO {
            return line;
        }
        let elapsed = ((env.time - self.since) * self.rate).at_least(T::ZERO);
        line - self.settling * (-elapsed).exp_m1()
    }
}

impl<T: Real> Stage<T> for Drift<T> {
    type State = ();
    fn state(&self) {}
    #[inline]
    fn reset(&self, (): &mut (), env: &Env<T>, u0: T) -> T {
        u0 + self.at(env)
    }
    #[inline]
    fn step(&self, (): &mut (), env: &Env<T>, u: T) -> T {
        u + self.at(env)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn settling_starts_at_its_time_and_ends_at_its_final_value() {
        let p = DriftParams { per_second: 0.01, settling: 0.5, seconds: 20.0, since_s: 1000.0 };
        let stage: Drift<f64> = p.build(&()).unwrap();
        let at = |time: f64| stage.step(&mut (), &Env { time, ..Env::default() }, 2.0) - 2.0;
        for (time, share) in [(0.0, 0.0), (1000.0, 0.0), (1020.0, 1.0 - libm::exp(-1.0)), (9000.0, 1.0)] {
            assert!((at(time) - 0.01 * time - 0.5 * share).abs() < 1e-9, "{time}");
            assert!((at(time) - p.at(time)).abs() < 1e-12, "{time}");
        }
    }

    #[test]
    fn a_linear_drift_has_no_settling() {
        let stage: Drift<f32> = DriftParams { per_second: 0.5, ..DriftParams::default() }.build(&()).unwrap();
        assert_eq!(stage.step(&mut (), &Env { time: 4.0, ..Env::default() }, 1.0), 3.0);
        let rejected: Result<Drift<f64>, _> = DriftParams { seconds: -1.0, ..DriftParams::default() }.build(&());
        assert!(matches!(rejected, Err(Error::OutOfRange { name: "drift.seconds", .. })));
    }
}
