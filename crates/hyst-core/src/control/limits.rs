//! Limits of the drive: voltage and slew rate.

use crate::error::{coefficient, finite, within};
use crate::{Error, Real, Sampling};

/// Voltage and slew-rate limits of an amplifier, for one sample period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits<T> {
    low: T,
    high: T,
    step: T,
}

/// A limited drive, and the limits that acted on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limited<T> {
    /// Limited drive \[V\].
    pub drive: T,
    /// Whether the voltage limit acted.
    pub voltage: bool,
    /// Whether the slew-rate limit acted.
    pub slew: bool,
}

impl<T: Real> Limits<T> {
    /// Returns limits: voltage from `low` to `high` \[V\], slew rate at most `slew` \[V/s\] (infinite for no limit).
    ///
    /// # Errors
    /// If a bound is not finite, `low ≥ high` or the slew rate is not positive.
    pub fn new(low: f64, high: f64, slew: f64, sampling: &Sampling) -> Result<Self, Error> {
        finite("voltage minimum", low)?;
        within("voltage maximum", high, high > low, "above the minimum")?;
        if slew.is_nan() || slew <= 0.0 {
            return Err(Error::OutOfRange { name: "slew", must: "positive" });
        }
        let step = slew * sampling.checked()?;
        let (low, high) = (coefficient("voltage minimum", low)?, coefficient("voltage maximum", high)?);
        Ok(Self { low, high, step: T::from_f64(step) })
    }

    /// Returns the allowed drive nearest to `wanted`, one period after `last`; for NaN, `last`.
    #[inline]
    pub fn apply(&self, last: T, wanted: T) -> Limited<T> {
        let wanted = if wanted.is_finite() { wanted } else { last };
        let inside = wanted.at_least(self.low).at_most(self.high);
        let slewed = inside.at_least(last - self.step).at_most(last + self.step);
        // If `last` is outside the range, the voltage limit has priority over the slew-rate limit.
        let drive = slewed.at_least(self.low).at_most(self.high);
        // A change by rounding alone does not count as limited.
        let rounding = T::EPSILON * T::from_f64(64.0) * (self.high - self.low).at_least(wanted.abs());
        Limited {
            drive: if drive.is_finite() { drive } else { last },
            voltage: (inside - wanted).abs() > rounding,
            slew: drive != inside,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_limit_acts_and_is_reported() {
        let l = Limits::<f64>::new(0.0, 120.0, 1000.0, &Sampling { period: 1e-3 }).unwrap();
        assert_eq!(l.apply(50.0, 50.5), Limited { drive: 50.5, voltage: false, slew: false });
        assert_eq!(l.apply(50.0, 60.0), Limited { drive: 51.0, voltage: false, slew: true });
        assert_eq!(l.apply(119.5, 130.0), Limited { drive: 120.0, voltage: true, slew: false });
        assert_eq!(l.apply(130.0, 130.0).drive, 120.0, "the voltage limit has priority");
        assert_eq!(l.apply(60.0, f64::NAN).drive, 60.0, "NaN holds the last drive");
    }
}
