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
/// Until the next answer has come, by which all of the line's others have, a request that was sent twice counts as waited for too shortly.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Retransmit {
    round_trips: [Duration; LATELY],
    next: usize,
    doubtful: Option<Doubtful>,
}

/// A request that was sent more than once, and what stood where it was put down.
#[derive(Clone, Copy, Debug)]
struct Doubtful {
    number: u32,
    before: Duration,
}

impl Retransmit {
    /// An answer came so long after its request was first sent, after it was sent so often.
    pub(super) fn answered(&mut self, number: u32, sent: u32, took: Duration) {
        if let Some(lost) = self.doubtful.take() {
            self.next = (self.next + LATELY - 1) % LATELY;
            self.round_trips[self.next] = lost.before;
        }
        self.doubtful = (sent > 1).then_some(Doubtful { number, before: self.round_trips[self.next] });
        self.round_trips[self.next] = took;
        self.next = (self.next + 1) % LATELY;
    }

    /// An answer came to a request that had one already.
    pub(super) fn answered_again(&mut self, number: u32) {
        self.doubtful = self.doubtful.filter(|doubtful| doubtful.number != number);
    }

    /// How long to wait first: `usual` on a quick line, and no longer than `most`.
    pub(super) fn first(&self, usual: Duration, most: Duration) -> Duration {
        let quickest = self.round_trips.iter().min().copied().unwrap_or_default();
        (SLOWER * quickest).min(most).max(usual)
    }
}
