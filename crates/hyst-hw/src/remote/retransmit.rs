//! The time to wait for an answer before a request is sent again.

use std::time::Duration;

/// Number of recent requests whose answer times are kept.
const ROUND_TRIPS: usize = 4;
/// Wait for an answer, as a multiple of the shortest of the recent answer times.
const TIMEOUT_FACTOR: u32 = 2;

/// Recent answer times of a line.
///
/// If the wait is shorter than the answer time, the line fills with repeated requests and their answers. A request that
/// was sent twice is ambiguous:
///
/// - One answer: a frame was lost. The measured time says nothing about the answer time (Karn's rule, RFC 6298) and is
///   dropped. Otherwise the wait would grow with each lost frame.
/// - Two answers: the wait was too short, and the measured time is kept.
///
/// The second answer, if there is one, arrives before the answer to the next request. Until then the measured time is
/// kept.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Retransmit {
    round_trips: [Duration; ROUND_TRIPS],
    next: usize,
    ambiguous: Option<Ambiguous>,
}

/// A request that was sent more than once, and the older answer time that its answer time replaced.
#[derive(Clone, Copy, Debug)]
struct Ambiguous {
    number: u32,
    replaced: Duration,
}

impl Retransmit {
    /// Records the first answer to a request that was sent `sent` times.
    ///
    /// `took`: time since it was first sent.
    pub(super) fn answered(&mut self, number: u32, sent: u32, took: Duration) {
        if let Some(lost) = self.ambiguous.take() {
            self.next = (self.next + ROUND_TRIPS - 1) % ROUND_TRIPS;
            self.round_trips[self.next] = lost.replaced;
        }
        self.ambiguous = (sent > 1).then_some(Ambiguous { number, replaced: self.round_trips[self.next] });
        self.round_trips[self.next] = took;
        self.next = (self.next + 1) % ROUND_TRIPS;
    }

    /// Records a second answer to a request.
    pub(super) fn answered_again(&mut self, number: u32) {
        self.ambiguous = self.ambiguous.filter(|ambiguous| ambiguous.number != number);
    }

    /// Returns the first wait for an answer: at least `usual`, and otherwise at most `most`.
    pub(super) fn first(&self, usual: Duration, most: Duration) -> Duration {
        let quickest = self.round_trips.iter().min().copied().unwrap_or_default();
        (TIMEOUT_FACTOR * quickest).min(most).max(usual)
    }
}
