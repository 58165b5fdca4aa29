//! The last seconds of a run, thinned for a plot.

use std::collections::VecDeque;

use crate::commands::run::values::Values;

/// Length \[s\] and number of points of the plot.
const WINDOW_S: f64 = 5.0;
const POINTS: f64 = 400.0;

/// The last seconds.
#[derive(Debug, Default)]
pub(super) struct Seconds {
    /// The latest values of each interval of `WINDOW_S / POINTS`.
    points: VecDeque<Values>,
    /// Sum and number of squared errors since the start.
    squares: f64,
    count: f64,
}

/// A curve of the plot: times \[s\] and values.
pub(super) type Curve = Vec<(f64, f64)>;

impl Seconds {
    /// Adds the values of a sample.
    pub(super) fn add(&mut self, values: Values) {
        if let Some(wanted) = values.wanted.filter(|_| values.sample.output.is_finite()) {
            self.squares += (values.sample.output - wanted).powi(2);
            self.count += 1.0;
        }
        let interval = |values: &Values| (values.sample.time_s * POINTS / WINDOW_S).floor();
        match self.points.back_mut() {
            Some(last) if interval(last) == interval(&values) => *last = values,
            _ => self.points.push_back(values),
        }
        let now = values.sample.time_s;
        while self.points.front().is_some_and(|first| first.sample.time_s < now - WINDOW_S) {
            self.points.pop_front();
        }
    }

    /// Returns the latest values.
    pub(super) fn now(&self) -> Option<&Values> {
        self.points.back()
    }

    /// Returns the RMS error since the start; `None` without a reference.
    pub(super) fn rmse(&self) -> Option<f64> {
        (self.count > 0.0).then(|| (self.squares / self.count).sqrt())
    }

    /// Returns one of the values over time.
    pub(super) fn curve(&self, of: impl Fn(&Values) -> Option<f64>) -> Curve {
        let point = |values: &Values| of(values).filter(|y| y.is_finite()).map(|y| (values.sample.time_s, y));
        self.points.iter().filter_map(point).collect()
    }

    /// Returns start and end of the plot \[s\].
    pub(super) fn window(&self) -> (f64, f64) {
        let first = self.points.front().map_or(0.0, |values| values.sample.time_s);
        (first, first + WINDOW_S)
    }
}
