//! Periods in which a device had nothing to put out: it holds its last value then, and nothing is measured.

use serde::Serialize;

/// Where the line or this computer was too slow for the rate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub(in crate::commands) struct Gaps {
    /// How often.
    times: usize,
    /// Periods altogether.
    periods: usize,
}

/// Looks for gaps between samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct GapFinder {
    rate_hz: f64,
    gaps: Gaps,
    /// Segment and time of the last sample \[s\].
    last: Option<(usize, f64)>,
}

impl GapFinder {
    pub(super) fn new(rate_hz: f64) -> Self {
        Self { rate_hz, gaps: Gaps::default(), last: None }
    }

    /// Takes the next sample's segment and time \[s\]; gives the periods that are missing before the first sample for which some are.
    pub(super) fn take(&mut self, segment: usize, time_s: f64) -> Option<usize> {
        let before = self.last.replace((segment, time_s)).filter(|(s, _)| *s == segment);
        let periods = ((time_s - before?.1) * self.rate_hz).round() as usize;
        let missing = periods.saturating_sub(1);
        self.gaps.periods += missing;
        self.gaps.times += usize::from(missing > 0);
        (missing > 0 && self.gaps.times == 1).then_some(missing)
    }

    pub(super) fn gaps(&self) -> Gaps {
        self.gaps
    }
}

impl Gaps {
    /// What happened, if it did.
    pub(in crate::commands) fn text(&self) -> Option<String> {
        let Self { times, periods } = *self;
        (times > 0).then(|| {
            format!(
                "the line was too slow for this rate: {times} times the device had nothing to put out and held its last value, for {periods} periods altogether; take a lower rate or a quicker line"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_is_missing_within_a_segment_counts() {
        let mut finder = GapFinder::new(100.0);
        let mut told = Vec::new();
        for (segment, period) in [(0, 1), (0, 2), (0, 5), (0, 6), (0, 8), (1, 20), (1, 21)] {
            told.extend(finder.take(segment, f64::from(period) / 100.0));
        }
        assert_eq!(told, [2]);
        assert_eq!(finder.gaps(), Gaps { times: 2, periods: 3 });
        assert!(finder.gaps().text().unwrap().contains("for 3 periods"));
        assert_eq!(Gaps::default().text(), None);
    }
}
