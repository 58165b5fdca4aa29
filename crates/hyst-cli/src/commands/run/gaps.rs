//! Gaps: sample periods for which a device received no value.
//! During a gap the device holds its last value and does not measure.

use hyst_hw::Sample;
use serde::Serialize;

use crate::recording::missing;

/// Gaps of a run, in which the line or this computer was too slow for the sample rate.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub(in crate::commands) struct Gaps {
    /// Number of gaps.
    pub(in crate::commands) times: usize,
    /// Sum of the missing periods.
    periods: usize,
}

/// Finds gaps between samples.
#[derive(Clone, Copy, Debug)]
pub(super) struct GapFinder {
    rate_hz: f64,
    gaps: Gaps,
    /// Segment and sample before the next one.
    last: Option<(usize, Sample)>,
}

impl GapFinder {
    pub(super) fn new(rate_hz: f64) -> Self {
        Self { rate_hz, gaps: Gaps::default(), last: None }
    }

    /// Takes the next sample; returns the number of periods that are missing before it, if there are any.
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
    /// Returns a sentence about the gaps, if there are any.
    pub(in crate::commands) fn text(&self) -> Option<String> {
        let Self { times, periods } = *self;
        (times > 0).then(|| {
            format!(
                "the line was too slow for this sample rate: the device received no value {times} times and held the last one, for \
                 {periods} periods in total. After each gap the record has a new segment, and a fit would assume that it \
                 starts at rest. Record again with a lower sample rate or a faster line before you fit it"
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::tests::at;

    #[test]
    fn gaps_within_segments_are_counted() {
        let mut finder = GapFinder::new(100.0);
        let mut missing = Vec::new();
        for (segment, period) in [(0, 1), (0, 2), (0, 5), (0, 6), (0, 8), (1, 20), (1, 21)] {
            missing.extend(finder.take(segment, &at(period)));
        }
        assert_eq!(missing, [2, 1]);
        assert_eq!(finder.gaps(), Gaps { times: 2, periods: 3 });
        assert!(finder.gaps().text().unwrap().contains("for 3 periods"));
        assert_eq!(Gaps::default().text(), None);
    }
}
