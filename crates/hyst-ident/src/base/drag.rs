//! Drag on sliding plays, as [`hyst_core::ViscousPi`] has it: an overdrive `o = λ v + √(J v)` moves a play at the speed v.

/// λ and J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct DragParams {
    /// λ \[s\]: loops widen with the rate.
    pub(crate) seconds: f64,
    /// J \[V s\]: loops widen with the root of the rate.
    pub(crate) volt_seconds: f64,
}

impl DragParams {
    pub(crate) fn at(self, period: f64) -> Drag {
        Drag { period, stiff: self.seconds + period, root: self.volt_seconds.sqrt(), none: self == Self::default() }
    }
}

/// A drag at a sample period.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Drag {
    period: f64,
    /// λ + h
    stiff: f64,
    /// √J
    root: f64,
    none: bool,
}

impl Drag {
    /// Plays that follow at once.
    pub(crate) const NONE: Self = Self { period: 1.0, stiff: 1.0, root: 0.0, none: true };

    /// Whether plays follow at once.
    pub(crate) fn is_none(&self) -> bool {
        self.none
    }

    /// Where a play at `p` comes in a sample in which it would be at `to` without drag.
    pub(crate) fn towards(&self, p: f64, to: f64) -> f64 {
        let over = to - p;
        if self.none || over == 0.0 {
            return to;
        }
        let o = over.abs();
        // (λ + h) v + √(J v) = o: backward Euler.
        let speed = 2.0 * o / (self.root + (self.root * self.root + 4.0 * self.stiff * o).sqrt());
        p + (self.period * speed * speed).copysign(over)
    }
}
