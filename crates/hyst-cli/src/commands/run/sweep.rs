//! Detects that a drive has covered its range in both directions.
//! This erases the history of earlier drives in that range.

/// Tolerance of reaching an end, as a share of the range.
const END_TOLERANCE: f64 = 0.05;

/// The range of a drive, and whether both of its ends were reached.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sweep {
    low: f64,
    high: f64,
    /// The high end when the low end was last reached, and the low end when the high end was last reached.
    high_at_low: f64,
    low_at_high: f64,
}

impl Sweep {
    /// Creates the state before the first voltage.
    pub(super) fn new() -> Self {
        Self { low: f64::INFINITY, high: f64::NEG_INFINITY, high_at_low: f64::NEG_INFINITY, low_at_high: f64::INFINITY }
    }

    /// Takes the next voltage.
    /// Returns whether the drive has covered its range so far in both directions. True for a constant drive.
    pub(super) fn take(&mut self, volts: f64) -> bool {
        (self.low, self.high) = (self.low.min(volts), self.high.max(volts));
        let tolerance = END_TOLERANCE * (self.high - self.low);
        if volts <= self.low + tolerance {
            self.high_at_low = self.high;
        }
        if volts >= self.high - tolerance {
            self.low_at_high = self.low;
        }
        self.high - self.high_at_low <= tolerance && self.low_at_high - self.low <= tolerance
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_covers_its_range_after_one_period_and_after_each_growth() {
        let mut sweep = Sweep::new();
        let sine = |k: i32, size: f64| size * (1.0 - (f64::from(k) * std::f64::consts::TAU / 100.0).cos());
        let covered: Vec<bool> = (0..400).map(|k| sweep.take(sine(k, if k < 200 { 1.0 } else { 2.0 }))).collect();
        assert!(!covered[60] && !covered[80] && covered[99] && covered[130] && covered[199]);
        assert!(!covered[250] && !covered[280] && covered[299] && covered[399]);
        let mut constant = Sweep::new();
        assert!((0..10).all(|_| constant.take(5.0)));
    }
}
