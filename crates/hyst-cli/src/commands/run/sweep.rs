//! Whether a drive has gone over its range both ways: what an actuator remembers of earlier drives within that range is wiped out then.

/// Reaching an end to this share of the range is enough.
const SLACK: f64 = 0.05;

/// The range of a drive, and how far its ends are known.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sweep {
    low: f64,
    high: f64,
    /// The high end when the low one was reached last, and the other way round.
    high_at_low: f64,
    low_at_high: f64,
}

impl Sweep {
    /// Before the first drive.
    pub(super) fn new() -> Self {
        Self { low: f64::INFINITY, high: f64::NEG_INFINITY, high_at_low: f64::NEG_INFINITY, low_at_high: f64::INFINITY }
    }

    /// Takes the next drive; gives whether it has gone both ways over all of its range so far. One that stands still has.
    pub(super) fn take(&mut self, volts: f64) -> bool {
        (self.low, self.high) = (self.low.min(volts), self.high.max(volts));
        let slack = SLACK * (self.high - self.low);
        if volts <= self.low + slack {
            self.high_at_low = self.high;
        }
        if volts >= self.high - slack {
            self.low_at_high = self.low;
        }
        self.high - self.high_at_low <= slack && self.low_at_high - self.low <= slack
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sine_is_through_after_a_period_and_again_after_it_has_grown() {
        let mut sweep = Sweep::new();
        let sine = |k: i32, size: f64| size * (1.0 - (f64::from(k) * std::f64::consts::TAU / 100.0).cos());
        let through: Vec<bool> = (0..400).map(|k| sweep.take(sine(k, if k < 200 { 1.0 } else { 2.0 }))).collect();
        assert!(!through[60] && !through[80] && through[99] && through[130] && through[199]);
        assert!(!through[250] && !through[280] && through[299] && through[399]);
        let mut still = Sweep::new();
        assert!((0..10).all(|_| still.take(5.0)));
    }
}
