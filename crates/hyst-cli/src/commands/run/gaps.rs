//! Periods in which a device had nothing to put out: it holds its last value then, and nothing is measured.

use hyst_hw::Sample;
use serde::Serialize;

use crate::recording::missing;

/// Where the line or this computer was too slow for the rate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub(in crate::commands) struct Gaps {
    /// How often.
    pub(in crate::commands) times: usize,
    /// Periods altogether.
    periods: usize,
}

/// Looks for gaps between samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct GapFinder {
    rate_hz: f64,
    gaps: Gaps,
    /// Segment and sample before.
    last: Option<(usize, Sample)>,
}

impl GapFinder {
    pub(super) fn new(rate_hz: f64) -> Self {
        Self { rate_hz, gaps: Gaps::default(), last: None }
    }

    /// Takes the next sample; gives the periods that are missing before it, if some are.
    pub(super) fn take(&mut self, segment: usize, sample: &Sample) -> Option<usize> {
        let (_, before) = self.last.replace((segment, *sample)).filter(|(last, _)| *last == segment)?;
        let periods = missing(&before, sample, self.rate_hz);
        self.gaps.periods += periods;
        self.gaps.times += usize::from(periods > 0);
        (periods > 0).then_some(periods)
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
                "the line was too slow for this rate: {times} times the device had nothing to put out and held its last value, for {periods} periods altogether; after each the record begins another segment, which a fit would take to begin at rest: take a lower rate or a quicker line before you fit this"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::tests::at;

    #[test]
    fn only_what_is_missing_within_a_segment_counts() {
        let mut finder = GapFinder::new(100.0);
        let mut told = Vec::new();
        for (segment, period) in [(0, 1), (0, 2), (0, 5), (0, 6), (0, 8), (1, 20), (1, 21)] {
            told.extend(finder.take(segment, &at(period)));
        }
        assert_eq!(told, [2, 1]);
        assert_eq!(finder.gaps(), Gaps { times: 2, periods: 3 });
        assert!(finder.gaps().text().unwrap().contains("for 3 periods"));
        assert_eq!(Gaps::default().text(), None);
    }
}
