//! Monitors the residual of a model and reports when it has grown.

use crate::error::within;
use crate::{Error, Real};

/// One-sided cumulative sum (CUSUM, Page 1954) of the mean squares m of blocks of the residual:
/// `g ← max(0, g + m/σ² − k)`, with an alarm at `g > h`.
///
/// The residual of a model is correlated from sample to sample. A block should therefore be longer than its correlation
/// time. σ is the RMSE of the model on its training record.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Watch<T> {
    /// 1/σ².
    per_variance: T,
    /// k: allowed mean square divided by σ².
    allowed: T,
    /// h: alarm threshold.
    threshold: T,
    /// Samples per block.
    block: u32,
}

/// State of a [`Watch`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct WatchState<T> {
    /// Σ residual² of the block in progress.
    squares: T,
    /// Samples of the block in progress.
    count: u32,
    /// g: cumulative sum.
    cusum: T,
    /// RMS of the last complete block \[y\].
    last: T,
}

impl<T: Real> WatchState<T> {
    /// Returns the RMS of the last complete block \[y\].
    pub fn last_rms(&self) -> T {
        self.last
    }
}

impl<T: Real> Watch<T> {
    /// Returns a monitor for a usual residual of `sigma` \[y\], in blocks of `block` samples. A residual of up to
    /// `factor` times `sigma` is allowed. The alarm threshold is the excess of `patience` blocks with twice the allowed
    /// residual.
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
            // A block with twice the allowed residual adds 4 − 1 times the allowed mean square.
            threshold: T::from_f64(3.0 * allowed * patience),
            block,
        })
    }

    /// Takes one residual \[y\] and returns whether there is an alarm. A residual that is not finite is ignored. An
    /// alarm ends when the residual has been small again for as long as it took to raise it.
    pub fn step(&self, s: &mut WatchState<T>, residual: T) -> bool {
        if residual.is_finite() {
            s.squares += residual * residual;
            s.count += 1;
        }
        if s.count >= self.block {
            let mean = s.squares / T::from_f64(f64::from(s.count));
            let excess = mean * self.per_variance - self.allowed;
            // Limit to twice the threshold, so that an alarm ends in about the time that it took to raise it.
            s.cusum = (s.cusum + excess).at_least(T::ZERO).at_most(self.threshold + self.threshold);
            s.last = mean.sqrt();
            (s.squares, s.count) = (T::ZERO, 0);
        }
        s.cusum > self.threshold
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
    fn only_a_residual_that_has_grown_raises_an_alarm() {
        assert_eq!(first_alarm(|_| 1.0), None);
        assert_eq!(first_alarm(|_| 1.3), None);
        let at = first_alarm(|k| if k < 40_000 { 1.0 } else { 3.0 }).unwrap();
        assert!((40_000..42_000).contains(&at), "{at}");
        // A larger residual raises the alarm earlier.
        assert!(first_alarm(|k| if k < 40_000 { 1.0 } else { 2.0 }).unwrap() > at);
        assert!(first_alarm(|k| if k < 40_000 { 1.0 } else { 1e9 }).unwrap() <= 40_200);
    }

    #[test]
    fn an_alarm_ends_with_a_small_residual_and_nan_is_ignored() {
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
