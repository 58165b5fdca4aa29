//! Options of a recording, its samples, and the arguments of its callbacks.

use std::ops::Range;

use crate::daq::Sample;

/// Options of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordOptions {
    /// Sample rate (Hz).
    pub rate_hz: f64,
    /// Slew rate of the ramps to the first value of a drive and from its last value to rest (V/s).
    pub slew_v_per_s: f64,
    /// Hold time at the first value of a drive before its record begins (s).
    pub settle_s: f64,
    /// Rest time between two segments (s).
    pub rest_s: f64,
    /// Maximum number of drive samples per exchange; the limit of the device also applies.
    pub block: usize,
    /// Largest permitted relative difference between requested and actual rate.
    pub rate_tolerance: f64,
}

impl RecordOptions {
    /// Returns the default options for a rate (Hz).
    ///
    /// Ramps of 100 V/s, no hold, rests of 1 s, blocks of 256 samples, a rate tolerance of 0.1 %.
    #[must_use]
    pub fn at(rate_hz: f64) -> Self {
        Self { rate_hz, slew_v_per_s: 100.0, settle_s: 0.0, rest_s: 1.0, block: 256, rate_tolerance: 1e-3 }
    }
}

/// Phase of a segment to which a sample belongs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Phase {
    /// Ramp to the first value of the drive, and hold there; not part of the record.
    Approach,
    /// The requested drive.
    Record,
    /// Ramp back to rest; not part of the record.
    Retreat,
}

/// Argument of the progress callback: newly received samples, all of one phase.
#[derive(Debug, Clone, Copy)]
pub struct Progress<'a> {
    /// Present segment, counted from 0.
    pub segment: usize,
    /// Number of segments.
    pub segments: usize,
    /// Phase of the new samples.
    pub phase: Phase,
    /// The new samples, in order; empty during a rest.
    ///
    /// A log that stores them is complete even if a later step fails.
    pub samples: &'a [Sample],
    /// Number of record samples so far, over all segments.
    pub done: usize,
    /// Total number of record samples.
    pub total: usize,
}

/// Measured samples of one segment.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SegmentRecord {
    /// One sample per drive sample, with the time of the device's clock.
    ///
    /// The drive reaches a sample within one period and is measured then, so the first sample is one period after the
    /// preceding one.
    pub samples: Vec<Sample>,
    /// Ramp and hold before the record. They are part of the actuator's history, but not of the record.
    pub approach: Vec<Sample>,
    /// Ramp to rest after the record; not part of it.
    pub retreat: Vec<Sample>,
}

/// Measured samples of all segments.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Recording {
    /// Actual rate of the device (Hz); 0 if it never started.
    pub rate_hz: f64,
    /// Segments in the order of the drive.
    pub segments: Vec<SegmentRecord>,
}

/// A block of the drive before it is sent, with the newest measurement.
#[derive(Debug)]
pub struct Revision<'a> {
    /// Present segment, counted from 0.
    pub segment: usize,
    /// Rows of the segment's drive in this block. Each row is passed exactly once, in order.
    pub rows: Range<usize>,
    /// Drive of these rows (V); the callback may change it.
    pub drive_v: &'a mut [f64],
    /// The newest measured sample, approach included.
    pub latest: Option<&'a Sample>,
}
