//! The duration of a condition.

/// Longest interruption that does not reset the duration, as a share of the patience.
///
/// An oscillating error crosses zero, but is still too large.
const MAX_INTERRUPTION: f32 = 0.2;

/// Measures how long a condition has lasted.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Lasting {
    periods: u32,
    /// Periods of the present interruption.
    interruption: u32,
}

impl Lasting {
    /// Takes the condition in the next period.
    ///
    /// Returns whether it has lasted for more than `patience` periods.
    pub fn step(&mut self, is: bool, patience: f32) -> bool {
        self.interruption = if is { 0 } else { self.interruption.saturating_add(1) };
        if self.interruption as f32 > MAX_INTERRUPTION * patience {
            self.periods = 0;
        } else if is || self.periods > 0 {
            self.periods = self.periods.saturating_add(1);
        }
        is && self.periods as f32 > patience
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_interruptions_do_not_reset_the_duration_and_long_ones_do() {
        let ends = |pattern: &dyn Fn(u32) -> bool| {
            let mut lasting = Lasting::default();
            (0..1000).find(|k| lasting.step(pattern(*k), 50.0))
        };
        assert_eq!(ends(&|_| true), Some(50));
        assert_eq!(ends(&|_| false), None);
        // An interruption of 10 of 50 periods does not reset the duration, one of 11 does. The result is true only
        // while the condition holds.
        assert_eq!(ends(&|k| k % 20 >= 10), Some(70));
        assert_eq!(ends(&|k| k % 22 >= 11), None);
    }
}
