//! Errors of a device at the other end of a line, with what to do.

use std::io;

use crate::wire::{Fault, PROTOCOL, Refusal};

/// Errors of a device at the other end of a line.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RemoteError {
    /// The connection is lost.
    #[error(
        "{line}: the connection is lost: {source}; a running device ramps to rest by its watchdog; \
         check the cable and the power supply, then run again"
    )]
    Line {
        /// Name of the line.
        line: String,
        /// Error of the operating system.
        source: io::Error,
    },
    /// No answer, or only damaged ones, arrived in time.
    #[error("{line}: no answer within {seconds} s ({broken} damaged frames received): {advice}")]
    Silent {
        /// Name of the line.
        line: String,
        /// Waiting time \[s\].
        seconds: f64,
        /// Number of damaged frames that arrived.
        broken: u32,
        /// What to do.
        advice: &'static str,
    },
    /// Host and device use different versions of the protocol.
    #[error(
        "{line}: the device speaks version {device} of the protocol, this program version {PROTOCOL}; update the older one"
    )]
    Version {
        /// Name of the line.
        line: String,
        /// Version of the device.
        device: u16,
    },
    /// The device refuses the request.
    #[error("{line}: {refusal}")]
    Refused {
        /// Name of the line.
        line: String,
        /// Reason.
        refusal: Refusal,
    },
    /// The device ended an earlier run with a fault that is not yet cleared.
    #[error(
        "{line}: fault {} of an earlier run is not cleared ({fault}): the device does not start; \
         fix the cause, then type hystctl stop --clear (or give --clear to run)",
        fault.code()
    )]
    Standing {
        /// Name of the line.
        line: String,
        /// The fault.
        fault: Fault,
    },
    /// The device ended the run with a fault.
    #[error("{line}: the device ended the run and ramps to rest (fault {}): {fault}", fault.code())]
    Fault {
        /// Name of the line.
        line: String,
        /// The fault.
        fault: Fault,
    },
    /// The run was stopped, but not by this program.
    #[error(
        "{line}: another program stopped the device; it ramps to rest; find out which program uses the device, then run again"
    )]
    Stopped {
        /// Name of the line.
        line: String,
    },
    /// The device no longer knows the run.
    #[error("{line}: the device no longer knows this run: {refusal}; check whether it was switched off and on")]
    Left {
        /// Name of the line.
        line: String,
        /// Refusal of the device.
        refusal: Refusal,
    },
    /// The device does not come to rest.
    #[error("{line}: the device is not at rest after {seconds} s and may still be driven; switch its amplifier off")]
    Restless {
        /// Name of the line.
        line: String,
        /// Waiting time \[s\].
        seconds: f64,
    },
    /// The device answers, but its clock has stopped.
    #[error(
        "{line}: the device answers, but has played and measured nothing for {seconds} s: \
         its clock has stopped, and its watchdog with it; switch its amplifier off"
    )]
    Stands {
        /// Name of the line.
        line: String,
        /// Waiting time \[s\].
        seconds: f64,
    },
    /// The device does not support the sample rate.
    #[error(
        "{line}: {asked_hz} Hz is outside the device's {low_hz} to {high_hz} Hz; \
         give --rate (excite, record, references such as sine:), or resample the file"
    )]
    Rate {
        /// Name of the line.
        line: String,
        /// Requested rate \[Hz\].
        asked_hz: f64,
        /// Slowest rate \[Hz\].
        low_hz: f64,
        /// Fastest rate \[Hz\].
        high_hz: f64,
    },
    /// A value is out of range.
    #[error("{what} = {value}: {advice}")]
    Value {
        /// Name of the value.
        what: &'static str,
        /// The value.
        value: f64,
        /// What to give instead.
        advice: &'static str,
    },
    /// The answer does not match the request.
    #[error(
        "{line}: the device's answer does not match the request; check that its firmware speaks hystctl's protocol"
    )]
    Answer {
        /// Name of the line.
        line: String,
    },
    /// The calls are out of order.
    #[error("calls out of order: start the device before exchange, and stop it before the next start")]
    Order,
}
