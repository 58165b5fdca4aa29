//! How long to wait for an answer before a request is sent again.

use std::time::Duration;

/// Requests that are looked back on.
const LATELY: usize = 4;
/// By how much longer than the quickest of them the next one may take.
const SLOWER: u32 = 2;

/// What the last answers took.
///
/// A line that takes longer for an answer than the wait would be filled with requests that nobody needs, each with an answer of its own. Those
/// are how it is known: what was sent twice and answered once was lost on the way, which says nothing of how long an answer takes (Karn's rule
/// in RFC 6298), and a wait that lost frames made longer would lose more time with each. What was answered twice was waited for too shortly.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Retransmit {
    round_trips: [Duration; LATELY],
    next: usize,
    /// A request that was sent more than once, and how long after the first time an answer came.
    doubtful: Option<(u32, Duration)>,
}

impl Retransmit {
    /// An answer came so long after its request was first sent, after it was sent so often.
    pub(super) fn answered(&mut self, number: u32, sent: u32, took: Duration) {
        self.doubtful = (sent > 1).then_some((number, took));
        if sent == 1 {
            self.observe(took);
        }
    }

    /// An answer came to a request that had one already.
    pub(super) fn answered_again(&mut self, number: u32) {
        if let Some((_, took)) = self.doubtful.take_if(|doubtful| doubtful.0 == number) {
            self.observe(took);
        }
    }

    fn observe(&mut self, took: Duration) {
        self.round_trips[self.next] = took;
        self.next = (self.next + 1) % LATELY;
    }

    /// How long to wait first: `usual` on a quick line, and no longer than `most`.
    pub(super) fn first(&self, usual: Duration, most: Duration) -> Duration {
        let quickest = self.round_trips.iter().min().copied().unwrap_or_default();
        (SLOWER * quickest).min(most).max(usual)
    }
}
