//! Force observer: estimates an external force without a force sensor.
//!
//! The measured displacement minus the modelled displacement of the free actuator is the deflection of the output
//! stiffness by the force: `f̂ = k_out (x − x₀)` (fractional-order force observer paper, eq. 4 and 16).

use crate::error::{coefficient, within};
use crate::{Build, Env, Error, Meta, Params, Real, Stage};

/// Parameters of `f̂ = k_out (x − (κ x̂₀ + χ))`: κ and χ correct slow changes of gain and zero of the free
/// displacement.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ForceParams {
    /// Output stiffness k_out \[N/y\], positive.
    pub stiffness: f64,
    /// Gain κ of the modelled free displacement.
    pub kappa: f64,
    /// Zero χ of the modelled free displacement \[y\].
    pub chi: f64,
}

impl Params for ForceParams {
    fn visit(&mut self, f: &mut dyn FnMut(&Meta, &mut f64)) {
        const INF: f64 = f64::INFINITY;
        f(&Meta { name: "stiffness", unit: "N/y", lower: 0.0, upper: INF }, &mut self.stiffness);
        f(&Meta { name: "kappa", unit: "", lower: 0.5, upper: 2.0 }, &mut self.kappa);
        f(&Meta { name: "chi", unit: "y", lower: -INF, upper: INF }, &mut self.chi);
    }
}

impl ForceParams {
    /// Returns the observer with a model of the free actuator.
    ///
    /// # Errors
    /// If a number is not finite or the stiffness not positive.
    pub fn observer<T: Real, M>(&self, free: M) -> Result<ForceObserver<T, M>, Error> {
        Ok(ForceObserver { free, observation: self.build(&())? })
    }
}

/// Coefficients of `f̂ = k_out (x − (κ x̂₀ + χ))`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceObservation<T> {
    stiffness: T,
    kappa: T,
    chi: T,
}

impl<T: Real> Build<ForceObservation<T>> for ForceParams {
    type Context = ();
    fn build(&self, (): &()) -> Result<ForceObservation<T>, Error> {
        Ok(ForceObservation {
            stiffness: coefficient(
                "force.stiffness",
                within("force.stiffness", self.stiffness, self.stiffness > 0.0, "positive")?,
            )?,
            kappa: coefficient("force.kappa", self.kappa)?,
            chi: coefficient("force.chi", self.chi)?,
        })
    }
}

impl<T: Real> ForceObservation<T> {
    /// Computes the force \[N\] from the measured displacement and the modelled free one \[y\].
    #[inline]
    pub fn force(&self, measured: T, free: T) -> T {
        self.stiffness * (measured - (self.kappa * free + self.chi))
    }
}

/// Force observer of a loaded actuator: a model of the free actuator and the output stiffness.
///
/// ```
/// use hyst_core::{Env, ForceParams, Pi, Stage};
/// let free = Pi::<f64, 1>::new(0.1, &[10.0], &[0.02])?; // µm, V
/// let observer = ForceParams { stiffness: 1.08, kappa: 1.0, chi: 0.0 }.observer(free)?; // N/µm
/// let (mut s, env) = (free.state(), Env::default());
/// let mut true_free = free.state();
/// let x = free.step(&mut true_free, &env, 50.0) - 2.0; // pushed back by 2 µm
/// assert!((observer.step(&mut s, &env, 50.0, x) + 2.16).abs() < 1e-12); // −2.16 N
/// # Ok::<(), hyst_core::Error>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ForceObserver<T, M> {
    free: M,
    observation: ForceObservation<T>,
}

impl<T: Real, M: Stage<T>> ForceObserver<T, M> {
    /// Sets the free model to rest at drive `u0` and returns the force \[N\] at measured displacement `x`.
    pub fn reset(&self, s: &mut M::State, env: &Env<T>, u0: T, x: T) -> T {
        self.observation.force(x, self.free.reset(s, env, u0))
    }

    /// Returns the estimated force \[N\] one sample later, at drive `u` and measured displacement `x`.
    #[inline]
    pub fn step(&self, s: &mut M::State, env: &Env<T>, u: T, x: T) -> T {
        self.observation.force(x, self.free.step(s, env, u))
    }
}

/// Recursive least squares of κ and χ: `x ≈ κ x̂₀ + χ` over samples without a force.
///
/// The sums are of deviations from running means (Welford), so a large offset costs no precision.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AffineFit<T> {
    count: u32,
    mean_free: T,
    mean_measured: T,
    /// Σ (x̂₀ − mean)².
    variance_sum: T,
    /// Σ (x̂₀ − mean)(x − mean).
    covariance_sum: T,
}

impl<T: Real> AffineFit<T> {
    /// Adds one sample: modelled free displacement and measured displacement \[y\].
    pub fn add(&mut self, free: T, measured: T) {
        if !free.is_finite() || !measured.is_finite() || self.count == u32::MAX {
            return;
        }
        self.count += 1;
        let share = T::ONE / T::from_f64(f64::from(self.count));
        let deviation = free - self.mean_free;
        self.mean_free += deviation * share;
        self.mean_measured += (measured - self.mean_measured) * share;
        self.variance_sum += deviation * (free - self.mean_free);
        self.covariance_sum += deviation * (measured - self.mean_measured);
    }

    /// Returns κ and χ; `None` while the free displacement is constant.
    pub fn solve(&self) -> Option<(T, T)> {
        let kappa = self.covariance_sum / self.variance_sum;
        let chi = self.mean_measured - kappa * self.mean_free;
        (self.variance_sum > T::ZERO && kappa.is_finite()).then_some((kappa, chi))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn least_squares_recovers_kappa_and_chi() {
        let mut fit = AffineFit::default();
        assert_eq!(fit.solve(), None);
        for k in 0..1000 {
            let free = 1e6 + libm::sin(0.1 * f64::from(k));
            fit.add(free, 1.03 * free - 0.7 + 1e-3 * libm::cos(0.1 * f64::from(k)));
        }
        fit.add(f64::NAN, 1.0);
        let (kappa, chi) = fit.solve().unwrap();
        assert!((kappa - 1.03).abs() < 1e-4, "{kappa}");
        assert!((kappa * 1e6 + chi - (1.03e6 - 0.7)).abs() < 1e-3);
    }

    #[test]
    fn a_force_on_a_known_stiffness_is_estimated() {
        let o: ForceObservation<f32> = ForceParams { stiffness: 1.08, kappa: 1.02, chi: -0.1 }.build(&()).unwrap();
        let free = 7.0;
        assert!((o.force(1.02 * free - 0.1 + 2.0 / 1.08, free) - 2.0).abs() < 1e-5);
        let bad: Result<ForceObservation<f32>, _> = ForceParams { stiffness: 0.0, kappa: 1.0, chi: 0.0 }.build(&());
        assert!(matches!(bad, Err(Error::OutOfRange { name: "force.stiffness", .. })));
    }
}
