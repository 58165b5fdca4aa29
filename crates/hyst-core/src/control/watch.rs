//! Whether a model still explains what it runs beside.

use crate::error::within;
use crate::{Error, Real};

/// A one-sided cumulative sum (Page 1954) over mean squares of blocks of the residual: `g ← max(0, g + m/σ² − k)`, an alarm at `g > h`.
///
/// Residuals of a model are correlated from sample to sample, so single ones tell nothing: a block should be longer than what the residual remembers.
/// σ is what the model has left in its own training record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Watch<T> {
    per_variance: T,
    allowed: T,
    threshold: T,
    block: u32,
}

/// Sums under way.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WatchState<T> {
    sum: T,
    count: u32,
    height: T,
    /// Root mean square of the last whole block \[y\].
    last: T,
}

impl<T: Real> WatchState<T> {
    /// Root mean square of the last whole block \[y\].
    pub fn last_rms(&self) -> T {
        self.last
    }
}

impl<T: Real> Watch<T> {
    /// Against a residual of `sigma` \[y\], in blocks of `block` samples; residuals up to `factor` times as large are taken as usual, and an alarm
    /// comes after the excess of `patience` blocks that are twice as large as allowed.
    ///
    /// # Errors
    /// If sigma is not positive, the factor not above 1, the patience not positive, or a block empty.
    pub fn new(sigma: f64, factor: f64, patience: f64, block: u32) -> Result<Self, Error> {
        within("watch.sigma", sigma, sigma > 0.0, "positive")?;
        within("watch.factor", factor, factor > 1.0, "above 1")?;
        within("watch.patience", patience, patience > 0.0, "positive")?;
        within("watch.block", f64::from(block), block > 0, "one or more")?;
        let allowed = factor * factor;
        Ok(Self {
            per_variance: T::from_f64(1.0 / (sigma * sigma)),
            allowed: T::from_f64(allowed),
            // A block of twice the allowed size adds 4 − 1 times what is allowed.
            threshold: T::from_f64(3.0 * allowed * patience),
            block,
        })
    }

    /// Takes one residual \[y\]; whether the model has stopped explaining what is measured. One that is no number is passed over. An alarm lasts until the residual is
    /// small again for as long.
    pub fn step(&self, s: &mut WatchState<T>, residual: T) -> bool {
        if residual.is_finite() {
            s.sum += residual * residual;
            s.count += 1;
        }
        if s.count >= self.block {
            let mean = s.sum / T::from_f64(f64::from(s.count));
            let excess = mean * self.per_variance - self.allowed;
            // As high as twice the threshold at most: what is over is forgotten in the time that it took to be told.
            s.height = (s.height + excess).at_least(T::ZERO).at_most(self.threshold + self.threshold);
            s.last = mean.sqrt();
            (s.sum, s.count) = (T::ZERO, 0);
        }
        s.height > self.threshold
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Correlated noise of unit variance.
    fn noise(k: u32) -> f64 {
        let t = f64::from(k);
        (0.11 * t).sin() + 0.7 * (0.023 * t + 1.0).sin() + 0.7 * (0.37 * t + 2.0).sin()
    }

    fn first_alarm(size: impl Fn(u32) -> f64) -> Option<u32> {
        let watch = Watch::<f64>::new(1.0, 1.5, 3.0, 200).unwrap();
        let mut s = WatchState::default();
        (0..100_000).find(|k| watch.step(&mut s, size(*k) * noise(*k)))
    }

    #[test]
    fn what_the_training_left_alarms_nobody_and_a_residual_that_grows_does() {
        assert_eq!(first_alarm(|_| 1.0), None);
        assert_eq!(first_alarm(|_| 1.3), None);
        let at = first_alarm(|k| if k < 40_000 { 1.0 } else { 3.0 }).unwrap();
        assert!((40_000..42_000).contains(&at), "{at}");
        // The further off, the sooner.
        assert!(first_alarm(|k| if k < 40_000 { 1.0 } else { 2.0 }).unwrap() > at);
        assert!(first_alarm(|k| if k < 40_000 { 1.0 } else { 1e9 }).unwrap() <= 40_200);
    }

    #[test]
    fn an_alarm_ends_when_the_model_explains_again_and_no_number_is_nothing() {
        let watch = Watch::<f32>::new(0.1, 1.5, 3.0, 10).unwrap();
        let mut s = WatchState::default();
        assert!(!(0..1000).any(|_| watch.step(&mut s, f32::NAN)));
        assert!((0..1000).any(|_| watch.step(&mut s, 10.0)));
        assert!((s.last_rms() - 10.0).abs() < 1e-4);
        assert!((0..1000).map(|_| watch.step(&mut s, 0.05)).last() == Some(false));
        for (sigma, factor, patience, block) in
            [(0.0, 1.5, 1.0, 1), (1.0, 1.0, 1.0, 1), (1.0, 2.0, 0.0, 1), (1.0, 2.0, 1.0, 0), (f64::NAN, 2.0, 1.0, 1)]
        {
            Watch::<f32>::new(sigma, factor, patience, block).unwrap_err();
        }
    }
}
