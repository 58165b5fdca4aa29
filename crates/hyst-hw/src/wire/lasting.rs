//! Something that goes on for a while.

/// Breaks of up to this share of the patience do not end it: an error that swings through zero is there all the time.
const BREAK: f32 = 0.2;

/// For how long something has been so.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Lasting {
    periods: u32,
    /// Periods of a break that may end it.
    without: u32,
}

impl Lasting {
    /// Takes whether it is so in the next period; gives whether it has been for more than `patience` periods.
    pub fn step(&mut self, is: bool, patience: f32) -> bool {
        self.without = if is { 0 } else { self.without.saturating_add(1) };
        if self.without as f32 > BREAK * patience {
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
    fn short_breaks_do_not_count_and_long_ones_do() {
        let ends = |pattern: &dyn Fn(u32) -> bool| {
            let mut lasting = Lasting::default();
            (0..1000).find(|k| lasting.step(pattern(*k), 50.0))
        };
        assert_eq!(ends(&|_| true), Some(50));
        assert_eq!(ends(&|_| false), None);
        // Ten periods of a break are a fifth of fifty, eleven are more. It ends while it is so.
        assert_eq!(ends(&|k| k % 20 >= 10), Some(70));
        assert_eq!(ends(&|k| k % 22 >= 11), None);
    }
}
