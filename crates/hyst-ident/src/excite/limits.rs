//! Limits of the device and its amplifier.

use super::error::{ExciteError, positive, require};

/// Limits of the device and its amplifier.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Rows per second \[Hz\].
    pub rate_hz: f64,
    /// The lowest voltage \[V\], at which the device rests.
    pub lo_v: f64,
    /// The highest voltage \[V\].
    pub hi_v: f64,
    /// The maximum slope from one row to the next \[V/s\]; `None` for no limit.
    pub slew_v_per_s: Option<f64>,
}

impl Limits {
    pub(super) fn span(&self) -> f64 {
        self.hi_v - self.lo_v
    }

    pub(super) fn check(&self) -> Result<(), ExciteError> {
        positive("rate_hz", self.rate_hz)?;
        require("lo_v", self.lo_v, self.lo_v.is_finite(), "a finite number")?;
        require("hi_v", self.hi_v, self.hi_v.is_finite() && self.hi_v > self.lo_v, "above lo_v")?;
        require("hi_v", self.hi_v, self.span().abs() < 1e9, "less than 1e9 V above lo_v")?;
        self.slew_v_per_s.map_or(Ok(()), |slew| positive("slew_v_per_s", slew))
    }
}
