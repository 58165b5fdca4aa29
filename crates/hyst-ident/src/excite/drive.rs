//! A drive: segments at printable voltages, with rests between them.

use std::io::Write;
use std::ops::Range;

use super::error::{ExciteError, require};
use super::limits::Limits;
use super::shapes::Shape;
use crate::record::{Columns, Extra, Record, RecordError, WriteError};

/// Voltages over time, in segments between which the device rests.
#[derive(Clone, Debug, PartialEq)]
pub struct Drive {
    segments: Vec<Range<usize>>,
    shapes: Vec<&'static str>,
    time: Vec<f64>,
    voltage: Vec<f64>,
    decimals: usize,
    rate_hz: f64,
}

impl Drive {
    /// Computes one segment of each shape, with `rest_s` seconds of rest between them (usually 1).
    ///
    /// Voltages are rounded to the four to six decimals that [`write_csv`](Self::write_csv) prints.
    ///
    /// # Errors
    /// If a field of `limits` or of a shape is out of its range, or a segment exceeds the slew limit. The message names
    /// the field.
    pub fn new(shapes: &[Shape], limits: &Limits, rest_s: f64) -> Result<Self, ExciteError> {
        limits.check()?;
        require("rest_s", rest_s, (0.0..=1e6).contains(&rest_s), "between 0 and 1e6")?;
        if shapes.is_empty() {
            return Err(ExciteError::Nothing);
        }
        let grid = VoltageGrid::new(limits)?;
        let mut drive = Self {
            segments: Vec::with_capacity(shapes.len()),
            shapes: Vec::with_capacity(shapes.len()),
            time: Vec::new(),
            voltage: Vec::new(),
            decimals: grid.decimals,
            rate_hz: limits.rate_hz,
        };
        let mut start = 0.0;
        for shape in shapes {
            let first = drive.time.len();
            drive.voltage.extend(shape.unit_samples(limits)?.into_iter().map(|s| grid.voltage(limits, s)));
            grid.check_slew(limits, shape, &drive.voltage[first..])?;
            let rows = first..drive.voltage.len();
            drive.time.extend(rows.clone().map(|row| start + (row - first) as f64 / limits.rate_hz));
            // Whole microseconds print exactly.
            start = ((start + rows.len() as f64 / limits.rate_hz + rest_s) * 1e6).round() / 1e6;
            drive.segments.push(rows);
            drive.shapes.push(shape.name());
        }
        Ok(drive)
    }

    /// Returns the rows of each segment, in order and without gaps.
    pub fn segments(&self) -> &[Range<usize>] {
        &self.segments
    }

    /// Returns the name of each segment's shape, for example `decaying-sine`.
    pub fn shapes(&self) -> &[&'static str] {
        &self.shapes
    }

    /// Returns the time \[s\]; it continues across segments.
    pub fn time(&self) -> &[f64] {
        &self.time
    }

    /// Returns the drive \[V\].
    pub fn voltage(&self) -> &[f64] {
        &self.voltage
    }

    /// Returns the maximum slope from one row of a segment to the next \[V/s\].
    pub fn steepest(&self) -> f64 {
        let segments = self.segments.iter().map(|rows| &self.voltage[rows.clone()]);
        segments.map(|volts| steepest_step(volts) * self.rate_hz).fold(0.0, f64::max)
    }

    /// Returns the drive as a record without an output; messages use `name`.
    ///
    /// # Errors
    /// If every segment has fewer than two rows.
    pub fn to_record(&self, name: &str) -> Result<Record, RecordError> {
        let labels = (0..).zip(&self.segments).flat_map(|(label, rows)| std::iter::repeat_n(label, rows.len()));
        Record::from_samples(Columns {
            name: name.to_owned(),
            segment: Some(labels.collect()),
            time: self.time.clone(),
            input: Some(self.voltage.clone()),
            ..Columns::default()
        })
    }

    /// Writes the columns `segment`, `time_s` and `voltage_v`.
    ///
    /// # Errors
    /// If `out` cannot be written.
    pub fn write_csv(&self, out: impl Write) -> Result<(), WriteError> {
        let record = self.to_record("drive").map_err(std::io::Error::other)?;
        record.write_with(out, &[Extra::rounded("voltage_v", &self.voltage, self.decimals)])
    }
}

/// Returns the largest step from one row to the next \[V\].
fn steepest_step(voltage: &[f64]) -> f64 {
    voltage.windows(2).fold(0.0, |most, w| f64::max(most, (w[1] - w[0]).abs()))
}

/// The voltages that can be printed, as integer multiples of the last decimal.
struct VoltageGrid {
    decimals: usize,
    scale: f64,
    lowest: f64,
    highest: f64,
}

impl VoltageGrid {
    fn new(limits: &Limits) -> Result<Self, ExciteError> {
        // About a millionth of the span, within four to six decimals.
        let decimals = (6.0 - limits.span().log10().floor()).clamp(4.0, 6.0) as usize;
        let scale = 10_f64.powi(decimals as i32);
        let mut lowest = (limits.lo_v * scale).ceil();
        let mut highest = (limits.hi_v * scale).floor();
        // The products above are rounded: correct to the outermost value inside the limits.
        lowest -= f64::from((lowest - 1.0) / scale >= limits.lo_v);
        lowest += f64::from(lowest / scale < limits.lo_v);
        highest += f64::from((highest + 1.0) / scale <= limits.hi_v);
        highest -= f64::from(highest / scale > limits.hi_v);
        require("hi_v", limits.hi_v, highest - lowest >= 10.0, "at least 1e-5 V above lo_v")?;
        Ok(Self { decimals, scale, lowest, highest })
    }

    /// Returns the voltage for a share `s` of the span.
    fn voltage(&self, limits: &Limits, s: f64) -> f64 {
        let exact = limits.lo_v + s * limits.span();
        (exact * self.scale).round().clamp(self.lowest, self.highest) / self.scale
    }

    fn check_slew(&self, limits: &Limits, shape: &Shape, voltage: &[f64]) -> Result<(), ExciteError> {
        let Some(limit) = limits.slew_v_per_s else { return Ok(()) };
        let needed = steepest_step(voltage) * limits.rate_hz;
        if needed <= limit * (1.0 + 1e-9) {
            return Ok(());
        }
        Err(ExciteError::Slew { shape: shape.name(), needed, limit, remedy: shape.remedy() })
    }
}
