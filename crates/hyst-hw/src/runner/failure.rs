//! Why a recording is not complete, and what there is of it.

use super::Recording;

/// Why a recording is not complete; `E` is the device's error.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Cause<E> {
    /// No drive segment was given.
    #[error("nothing to play: give at least one drive segment")]
    NoSegment,
    /// A drive segment has no sample.
    #[error("drive segment {segment} is empty")]
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
    /// A value in [`RecordOptions`](super::RecordOptions) makes no sense; nothing was played.
    #[error("{name} = {value}: {advice}")]
    Option {
        /// Field of [`RecordOptions`](super::RecordOptions).
        name: &'static str,
        /// Its value.
        value: f64,
        /// What to give instead.
        advice: &'static str,
    },
    /// The device does not run at the rate that the drive is meant for; nothing was played.
    #[error("asked for {asked_hz} Hz, the device runs at {actual_hz} Hz: resample the drive or choose another rate")]
    Rate {
        /// Rate asked for (Hz).
        asked_hz: f64,
        /// Rate of the device (Hz).
        actual_hz: f64,
    },
    /// The device neither takes nor returns samples.
    #[error("the device stalls: {outstanding} samples have not come back")]
    Stalled {
        /// Samples accepted but not measured.
        outstanding: usize,
    },
    /// The device broke the contract of [`Daq::exchange`](crate::Daq::exchange): more samples than it was given.
    #[error("the device returns samples for drive that it was not given")]
    Surplus,
    /// The progress callback asked to stop; the device was ramped to rest.
    #[error("stopped on request")]
    Cancelled,
    /// All was played and measured, but the device could not be stopped.
    #[error("the record is complete, but the device could not be stopped and may still be driven: {0}")]
    Stop(E),
    /// The device's own error.
    #[error(transparent)]
    Device(E),
}

/// An incomplete recording: why, and what was measured until then.
#[derive(Debug, Clone, PartialEq)]
pub struct Failure<E> {
    /// Why the recording is not complete.
    pub cause: Cause<E>,
    /// What was measured until then; the last segment may be incomplete.
    pub partial: Recording,
    /// The device's error when, after the cause, it could not be stopped either: its drive may still be on.
    pub not_stopped: Option<E>,
    /// Whether the device may have left its rest: it stood elsewhere, or something else was put to it.
    pub driven: bool,
}

impl<E: std::error::Error> std::fmt::Display for Failure<E> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let (Cause::Stop(error), false) = (&self.cause, self.driven) {
            return write!(
                f,
                "the record is complete, but the device did not take the stop; nothing was driven: {error}"
            );
        }
        self.cause.fmt(f)?;
        let Some(error) = &self.not_stopped else { return Ok(()) };
        f.write_str(if self.driven {
            "; the device could not be stopped and may still be driven"
        } else {
            "; the device did not take the stop, nothing was driven"
        })?;
        // What is gone is gone for the stop too.
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
    fn failure_speaks_with_its_causes_voice() {
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
        assert_eq!(segment.to_string(), "drive segment 2 is empty");
        let driven = Failure { not_stopped: Some(CableOut(std::fmt::Error)), ..segment };
        assert!(driven.to_string().ends_with("may still be driven: cable out"), "{driven}");
        let twice = Failure { cause: Cause::Device(CableOut(std::fmt::Error)), ..driven };
        assert_eq!(twice.to_string(), "cable out; the device could not be stopped and may still be driven");
        let resting = Failure { driven: false, ..twice };
        assert_eq!(resting.to_string(), "cable out; the device did not take the stop, nothing was driven");
        let complete = Failure { cause: Cause::Stop(CableOut(std::fmt::Error)), not_stopped: None, ..resting };
        assert!(complete.to_string().ends_with("did not take the stop; nothing was driven: cable out"), "{complete}");
    }
}
