//! Slow adaptation of the weights of a Prandtl-Ishlinskii operator while it runs.
//!
//! The output is linear in gain and weights, so recursive least squares with forgetting follows them (Kuhnen and Krejčí 2009 on adaptive inverse
//! hysteresis control; Ljung 1999, ch. 11 on the recursion). After each step they are projected onto what keeps the operator invertible: a gain
//! above a share of its first value, weights that are not negative.

use super::pi::{Pi, PiState};
use crate::error::within;
use crate::{Env, Error, Real, Stage};

/// How weights are adapted. `N` plays at most; `M` has to be `N + 2`: gain, weights and the sensor's zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adaptation<T> {
    /// λ: what a sample counts for one sample later.
    forgetting: T,
    /// Largest variance of a weight, over its first one: forgetting stops where nothing is learned.
    most: T,
    /// Least gain over the first one.
    least_gain: T,
}

/// First variance of each weight: those of the model are taken as nearly right.
const FIRST: f64 = 1e-2;

impl<T: Real> Adaptation<T> {
    /// Forgets with a time constant of `samples` samples: the weights follow what changes more slowly than that.
    ///
    /// # Errors
    /// If there are fewer than 10 samples, or more than a million.
    pub fn new(samples: f64) -> Result<Self, Error> {
        within("adaptation samples", samples, (10.0..=1e6).contains(&samples), "from 10 to a million")?;
        Ok(Self {
            forgetting: T::from_f64(1.0 - 1.0 / samples),
            most: T::from_f64(100.0 * FIRST),
            least_gain: T::from_f64(0.1),
        })
    }

    /// Begins with the weights of an operator and a sensor zero \[y\].
    ///
    /// # Errors
    /// If `M` is not `N + 2`, or the gain is not positive.
    pub fn begin<const N: usize, const M: usize>(&self, first: &Pi<T, N>, zero: T) -> Result<Adapted<T, N, M>, Error> {
        if M != N + 2 {
            return Err(Error::Capacity { name: "adapted numbers", needed: N + 2, holds: M });
        }
        let gain = first.gain().to_f64();
        within("pi.gain", gain, gain > 0.0, "positive to be adapted")?;
        let mut numbers = [T::ZERO; M];
        let of = [first.gain()].into_iter().chain(first.all_weights().iter().copied()).chain([zero]);
        numbers.iter_mut().zip(of).for_each(|(to, from)| *to = from);
        let mut covariance = [[T::ZERO; M]; M];
        for (k, row) in covariance.iter_mut().enumerate() {
            if let Some(own) = row.get_mut(k) {
                *own = T::from_f64(FIRST);
            }
        }
        Ok(Adapted { numbers, covariance, first_gain: first.gain() })
    }

    /// Runs the operator by one sample with the weights as they are, compares its output with the measured one \[y\], and moves the weights. Gives the error before
    /// that; a measurement that is no number changes nothing.
    ///
    /// The input should be of the order of one: in a device's volts the first variance, which is the same for all numbers, would mean another thing for the
    /// zero than for the gain. So it is divided by `scale` \[u\].
    pub fn step<const N: usize, const M: usize>(
        &self,
        operator: &mut Pi<T, N>,
        s: &mut PiState<T, N>,
        adapted: &mut Adapted<T, N, M>,
        input: T,
        (measured, scale): (T, T),
    ) -> T {
        let predicted = operator.step(s, &Env::default(), input) + adapted.zero();
        let error = measured - predicted;
        if !(error.is_finite() && scale.is_finite()) || scale <= T::ZERO {
            return T::ZERO;
        }
        let per_scale = T::ONE / scale;
        let mut x = [T::ZERO; M];
        let of = [s.input()].into_iter().chain(s.plays().iter().copied()).map(|p| p * per_scale).chain([T::ONE]);
        x.iter_mut().zip(of).for_each(|(to, from)| *to = from);
        let gains = adapted.learn(self, &x);
        // The numbers are per scaled input; the zero is not.
        for (k, (number, gain)) in adapted.numbers.iter_mut().zip(gains).enumerate() {
            let change = gain * error * if k <= N { per_scale } else { T::ONE };
            if change.is_finite() {
                *number += change;
            }
        }
        adapted.project(self, N);
        operator.set(adapted.numbers.first().copied().unwrap_or_default(), adapted.weights());
        error
    }
}

/// Gain, weights and zero as they are by now, and how sure they are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adapted<T, const N: usize, const M: usize> {
    /// Gain, weights, zero.
    numbers: [T; M],
    covariance: [[T; M]; M],
    first_gain: T,
}

impl<T: Real, const N: usize, const M: usize> Adapted<T, N, M> {
    /// Sensor zero \[y\].
    pub fn zero(&self) -> T {
        self.numbers.last().copied().unwrap_or_default()
    }

    fn weights(&self) -> &[T] {
        self.numbers.get(1..=N).unwrap_or_default()
    }

    /// The gain vector of one sample; the covariance after it.
    fn learn(&mut self, how: &Adaptation<T>, x: &[T; M]) -> [T; M] {
        let mut px = [T::ZERO; M];
        for (to, row) in px.iter_mut().zip(&self.covariance) {
            *to = row.iter().zip(x).fold(T::ZERO, |sum, (p, x)| sum + *p * *x);
        }
        let seen = px.iter().zip(x).fold(T::ZERO, |sum, (p, x)| sum + *p * *x);
        let share = T::ONE / (how.forgetting + seen.at_least(T::ZERO));
        let mut gains = px;
        gains.iter_mut().for_each(|g| *g *= share);
        let back = T::ONE / how.forgetting;
        let mut largest = T::ZERO;
        for (k, (row, gain)) in self.covariance.iter_mut().zip(&gains).enumerate() {
            for (p, other) in row.iter_mut().zip(&px) {
                *p -= *gain * *other;
            }
            largest = largest.at_least(row.get(k).copied().unwrap_or_default());
        }
        // What is not excited would be forgotten without end.
        if largest * back <= how.most {
            self.covariance.iter_mut().flatten().for_each(|p| *p *= back);
        }
        self.settle();
        gains
    }

    /// Symmetric, and no variance below zero, whatever rounding does.
    fn settle(&mut self) {
        for i in 0..M {
            for j in 0..i {
                let of =
                    |a: usize, b: usize| self.covariance.get(a).and_then(|row| row.get(b)).copied().unwrap_or_default();
                let mean = T::from_f64(0.5) * (of(i, j) + of(j, i));
                for (a, b) in [(i, j), (j, i)] {
                    if let Some(p) = self.covariance.get_mut(a).and_then(|row| row.get_mut(b)) {
                        *p = mean;
                    }
                }
            }
            if let Some(p) = self.covariance.get_mut(i).and_then(|row| row.get_mut(i)) {
                *p = p.at_least(T::ZERO);
            }
        }
    }

    fn project(&mut self, how: &Adaptation<T>, plays: usize) {
        let least = how.least_gain * self.first_gain;
        if let Some(gain) = self.numbers.first_mut() {
            *gain = gain.at_least(least);
        }
        self.numbers.iter_mut().skip(1).take(plays).for_each(|w| *w = w.at_least(T::ZERO));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Invert;
    use proptest::prelude::*;

    const N: usize = 4;
    const M: usize = N + 2;

    fn pi(gain: f64, scale: f64) -> Pi<f64, N> {
        let weights = [0.02, 0.015, 0.01, 0.004].map(|w| w * scale);
        Pi::new(gain, &[4.0, 10.0, 20.0, 35.0], &weights).unwrap()
    }

    /// Loops of several sizes over 0 … 100.
    fn drive(k: usize) -> f64 {
        let t = k as f64 * 1e-3;
        50.0 + 30.0 * (3.1 * t).sin() + 15.0 * (8.3 * t).sin() + 5.0 * (23.0 * t).sin()
    }

    #[test]
    fn weights_that_have_changed_are_followed() {
        let (truth, how) = (pi(0.12, 1.3), Adaptation::new(5000.0).unwrap());
        let mut operator = pi(0.1, 1.0);
        let mut adapted: Adapted<f64, N, M> = how.begin(&operator, 0.0).unwrap();
        let (mut s, mut true_s) = (operator.state(), truth.state());
        let mut errors = [0.0f64; 2];
        for k in 0..60_000 {
            let u = drive(k);
            let y = truth.step(&mut true_s, &Env::default(), u) + 0.5;
            let error = how.step(&mut operator, &mut s, &mut adapted, u, (y, 50.0));
            errors[usize::from(k >= 50_000)] += error * error / if k >= 50_000 { 1e4 } else { 5e4 };
        }
        assert!(errors[1].sqrt() < 1e-3 && errors[0].sqrt() > 0.01, "{errors:?}");
        assert!((adapted.zero() - 0.5).abs() < 0.02 && (operator.gain() - 0.12).abs() < 2e-3, "{adapted:?}");
    }

    #[test]
    fn a_drive_that_stands_still_teaches_nothing_and_blows_nothing_up() {
        let how = Adaptation::new(100.0).unwrap();
        let mut operator = pi(0.1, 1.0);
        let mut adapted: Adapted<f64, N, M> = how.begin(&operator, 0.0).unwrap();
        let mut s = operator.state();
        for k in 0..200_000 {
            let noise = 1e-3 * (k as f64 * 1.7).sin();
            how.step(&mut operator, &mut s, &mut adapted, 40.0, (4.0 + noise, 50.0));
        }
        assert!(adapted.covariance.iter().flatten().all(|p| p.abs() <= 1.01), "{adapted:?}");
        assert!(operator.invert().is_ok());
    }

    #[test]
    fn rooms_and_times_that_do_not_fit_are_refused() {
        let how = Adaptation::<f64>::new(100.0).unwrap();
        let wrong: Result<Adapted<f64, N, 5>, _> = how.begin(&pi(0.1, 1.0), 0.0);
        assert!(matches!(wrong, Err(Error::Capacity { needed: 6, holds: 5, .. })));
        for samples in [0.0, 9.0, 2e6, f64::NAN] {
            Adaptation::<f32>::new(samples).unwrap_err();
        }
    }

    proptest! {
        #[test]
        fn whatever_is_measured_the_operator_stays_invertible(
            measured in proptest::collection::vec(prop_oneof![-1e3..1e3f64, Just(f64::NAN), Just(f64::INFINITY)], 1..400),
            samples in 10.0..1e4f64,
        ) {
            let how = Adaptation::new(samples).unwrap();
            let mut operator = pi(0.1, 1.0);
            let mut adapted: Adapted<f64, N, M> = how.begin(&operator, 0.0).unwrap();
            let mut s = operator.state();
            for (k, y) in measured.iter().enumerate() {
                let error = how.step(&mut operator, &mut s, &mut adapted, drive(97 * k), (*y, 50.0));
                prop_assert!(error.is_finite());
            }
            prop_assert!(operator.invert().is_ok());
        }
    }
}
