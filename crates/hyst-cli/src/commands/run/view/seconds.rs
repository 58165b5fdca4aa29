//! The last seconds of a run, as far as a picture shows them.

use std::collections::VecDeque;

use super::Seen;

/// How far a picture looks back \[s\], and how many points it has.
const WINDOW_S: f64 = 5.0;
const POINTS: f64 = 400.0;

/// The last seconds.
#[derive(Debug, Default)]
pub(super) struct Seconds {
    /// The newest of each fraction of a second.
    points: VecDeque<Seen>,
    /// Squared errors since the beginning, and how many.
    squares: f64,
    count: f64,
}

/// A line of a picture: times \[s\] and values.
pub(super) type Curve = Vec<(f64, f64)>;

impl Seconds {
    /// Takes a sample.
    pub(super) fn add(&mut self, seen: Seen) {
        if let Some(wanted) = seen.wanted.filter(|_| seen.sample.output.is_finite()) {
            self.squares += (seen.sample.output - wanted).powi(2);
            self.count += 1.0;
        }
        let place = |seen: &Seen| (seen.sample.time_s * POINTS / WINDOW_S).floor();
        match self.points.back_mut() {
            Some(last) if place(last) == place(&seen) => *last = seen,
            _ => self.points.push_back(seen),
        }
        let now = seen.sample.time_s;
        while self.points.front().is_some_and(|first| first.sample.time_s < now - WINDOW_S) {
            self.points.pop_front();
        }
    }

    /// The newest sample.
    pub(super) fn now(&self) -> Option<&Seen> {
        self.points.back()
    }

    /// Root of the mean squared error since the beginning; `None` without a reference.
    pub(super) fn rmse(&self) -> Option<f64> {
        (self.count > 0.0).then(|| (self.squares / self.count).sqrt())
    }

    /// One of the values over the time.
    pub(super) fn curve(&self, of: impl Fn(&Seen) -> Option<f64>) -> Curve {
        let point = |seen: &Seen| of(seen).filter(|y| y.is_finite()).map(|y| (seen.sample.time_s, y));
        self.points.iter().filter_map(point).collect()
    }

    /// From when to when \[s\].
    pub(super) fn window(&self) -> (f64, f64) {
        let first = self.points.front().map_or(0.0, |seen| seen.sample.time_s);
        (first, first + WINDOW_S)
    }
}
