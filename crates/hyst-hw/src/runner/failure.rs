//! The reason why a recording is incomplete, and the samples measured until then.

use super::recording::Recording;

/// Reason why a recording is incomplete; `E` is the error type of the device.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Cause<E> {
    /// No drive segment was given.
    #[error("nothing to play: give at least one drive segment")]
    NoSegment,
    /// A drive segment has no sample.
    #[error("drive segment {segment} is empty: give at least one sample")]
    EmptySegment {
        /// Segment, from 0.
        segment: usize,
    },
    /// A drive sample is not a finite number; nothing was played.
    #[error("drive segment {segment}, sample {row}: {volts} is not a finite voltage; nothing was played")]
    NonFinite {
        /// Segment, from 0.
        segment: usize,
        /// Sample in the segment, from 0.
        row: usize,
        /// The value.
        volts: f64,
    },
    /// A drive sample is outside the device's range; nothing was played.
    #[error("drive segment {segment}, sample {row}: {volts} V is outside {min_v} to {max_v} V; nothing was played")]
    OutOfRange {
        /// Segment, from 0.
        segment: usize,
        /// Sample in the segment, from 0.
        row: usize,
        /// The value (V).
        volts: f64,
        /// Lowest voltage of the device (V).
        min_v: f64,
        /// Highest voltage of the device (V).
        max_v: f64,
    },
    /// A value in [`RecordOptions`](super::RecordOptions) is invalid; nothing was played.
    #[error("{name} = {value}: {advice}")]
    Option {
        /// Field of [`RecordOptions`](super::RecordOptions).
        name: &'static str,
        /// Its value.
        value: f64,
        /// What to give instead.
        advice: &'static str,
    },
    /// The device does not run at the requested rate; nothing was played.
    #[error("the device runs at {actual_hz} Hz instead of {asked_hz} Hz: resample the drive or choose another rate")]
    Rate {
        /// Requested rate (Hz).
        asked_hz: f64,
        /// Actual rate of the device (Hz).
        actual_hz: f64,
    },
    /// The device neither accepts drives nor returns samples.
    #[error(
        "the device stalls: it accepts no drive and returns no samples ({outstanding} are missing); check the device, then run again"
    )]
    Stalled {
        /// Number of accepted drive samples without a measurement.
        outstanding: usize,
    },
    /// The device returns more samples than [`Daq::exchange`](crate::Daq::exchange) permits.
    #[error(
        "the device returned more samples than it was given drive samples; correct its driver: one sample for each drive sample"
    )]
    Surplus,
    /// The progress callback requested a stop; the device was ramped to rest.
    #[error("stopped on request")]
    Cancelled,
    /// The record is complete, but the device could not be stopped.
    #[error(
        "the record is complete, but the device could not be stopped and may still be driven; switch its amplifier off: {0}"
    )]
    Stop(E),
    /// Error of the device.
    #[error(transparent)]
    Device(E),
}

/// An incomplete recording: the reason, and the samples measured until then.
#[derive(Debug, Clone, PartialEq)]
pub struct Failure<E> {
    /// Reason why the recording is incomplete.
    pub cause: Cause<E>,
    /// Samples measured until then; the last segment may be incomplete.
    pub partial: Recording,
    /// Error of the device if it also could not be stopped: its drive may still be on.
    pub not_stopped: Option<E>,
    /// Whether the device may have left its rest voltage.
    ///
    /// This is true if it was not at rest at the start, or if it was sent another drive.
    pub driven: bool,
}

impl<E: std::error::Error> std::fmt::Display for Failure<E> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let (Cause::Stop(error), false) = (&self.cause, self.driven) {
            return write!(
                f,
                "the record is complete, but the device did not confirm the stop; it was never driven: {error}"
            );
        }
        self.cause.fmt(f)?;
        let Some(error) = &self.not_stopped else { return Ok(()) };
        f.write_str(if self.driven {
            "; the device could not be stopped and may still be driven; switch its amplifier off"
        } else {
            "; the device did not confirm the stop, but it was never driven"
        })?;
        // After a lost connection, the stop often fails with the same error.
        let (why, error) = (self.cause.to_string(), error.to_string());
        if error == why { Ok(()) } else { write!(f, ": {error}") }
    }
}

impl<E: std::error::Error + 'static> std::error::Error for Failure<E> {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        self.cause.source()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::error::Error;

    #[test]
    fn a_failure_prints_its_cause_and_whether_the_device_is_driven() {
        #[derive(Debug, thiserror::Error)]
        #[error("cable out")]
        struct CableOut(#[source] std::fmt::Error);

        let failure = Failure {
            cause: Cause::Device(CableOut(std::fmt::Error)),
            partial: Recording::default(),
            not_stopped: None,
            driven: true,
        };
        assert_eq!(failure.to_string(), "cable out");
        assert!(failure.source().is_some_and(|source| source.is::<std::fmt::Error>()));
        let segment = Failure {
            cause: Cause::<CableOut>::EmptySegment { segment: 2 },
            partial: Recording::default(),
            not_stopped: None,
            driven: true,
        };
        assert_eq!(segment.to_string(), "drive segment 2 is empty: give at least one sample");
        let driven = Failure { not_stopped: Some(CableOut(std::fmt::Error)), ..segment };
        assert!(driven.to_string().ends_with("may still be driven; switch its amplifier off: cable out"), "{driven}");
        let twice = Failure { cause: Cause::Device(CableOut(std::fmt::Error)), ..driven };
        assert_eq!(
            twice.to_string(),
            "cable out; the device could not be stopped and may still be driven; switch its amplifier off"
        );
        let resting = Failure { driven: false, ..twice };
        assert_eq!(resting.to_string(), "cable out; the device did not confirm the stop, but it was never driven");
        let complete = Failure { cause: Cause::Stop(CableOut(std::fmt::Error)), not_stopped: None, ..resting };
        assert!(
            complete.to_string().ends_with("did not confirm the stop; it was never driven: cable out"),
            "{complete}"
        );
    }
}
