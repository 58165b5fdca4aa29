//! Drag on sliding plays, as [`hyst_core::ViscousPi`] has it: an overdrive `o = λ v + √(J v)` moves a play at the speed v.

use crate::Samples;

/// λ and J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct DragParams {
    /// λ \[s\]: loops widen with the rate.
    pub(crate) seconds: f64,
    /// J \[V s\]: loops widen with the root of the rate.
    pub(crate) volt_seconds: f64,
}

impl DragParams {
    /// In each segment of a record.
    pub(crate) fn over(self, samples: &Samples) -> Drag {
        if self == Self::default() {
            return Drag::NONE;
        }
        let at = |period: f64| Overdrive { period, stiff: self.seconds + period, root: self.volt_seconds.sqrt() };
        match samples.periods.as_slice() {
            [] => Drag(Some(at(samples.period)), Vec::new()),
            periods => Drag(Some(at(samples.period)), periods.iter().map(|period| at(*period)).collect()),
        }
    }
}

/// A drag at the sample period of each segment: that of any, or one for each; plays follow at once without.
#[derive(Clone, Debug)]
pub(crate) struct Drag(Option<Overdrive>, Vec<Overdrive>);

/// A drag at a sample period.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Overdrive {
    period: f64,
    /// λ + h
    stiff: f64,
    /// √J
    root: f64,
}

impl Drag {
    /// Plays that follow at once.
    pub(crate) const NONE: Self = Self(None, Vec::new());

    /// In a segment, by its number; none where plays follow at once.
    pub(crate) fn of(&self, segment: usize) -> Option<Overdrive> {
        self.1.get(segment).copied().or(self.0)
    }
}

impl Overdrive {
    /// Where a play at `p` comes in a sample in which it would be at `to` without drag.
    pub(crate) fn towards(&self, p: f64, to: f64) -> f64 {
        let over = to - p;
        if over == 0.0 {
            return to;
        }
        let o = over.abs();
        // (λ + h) v + √(J v) = o: backward Euler.
        let speed = 2.0 * o / (self.root + (self.root * self.root + 4.0 * self.stiff * o).sqrt());
        p + (self.period * speed * speed).copysign(over)
    }
}
