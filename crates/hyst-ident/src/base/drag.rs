//! Drag on sliding play operators, as in [`hyst_core::ViscousPi`]: an overdrive `o = λ v + √(J v)` moves a play
//! operator at the speed v.

use crate::Samples;

/// The drag parameters λ and J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct DragParams {
    /// λ \[s\]: the loop widens with the rate.
    pub(crate) seconds: f64,
    /// J \[V s\]: the loop widens with the square root of the rate.
    pub(crate) volt_seconds: f64,
}

impl DragParams {
    /// Returns the drag in each segment of a record.
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

/// Drag at the sample period of each segment: one for all segments, or one for each. Without drag, play operators
/// follow at once.
#[derive(Clone, Debug)]
pub(crate) struct Drag(Option<Overdrive>, Vec<Overdrive>);

/// Drag at one sample period.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Overdrive {
    period: f64,
    /// λ + h
    stiff: f64,
    /// √J
    root: f64,
}

impl Drag {
    /// No drag: play operators follow at once.
    pub(crate) const NONE: Self = Self(None, Vec::new());

    /// Returns the drag in a segment; `None` if play operators follow at once.
    pub(crate) fn of(&self, segment: usize) -> Option<Overdrive> {
        self.1.get(segment).copied().or(self.0)
    }
}

impl Overdrive {
    /// Returns the next state of a play operator at `p` that would be at `to` without drag.
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
