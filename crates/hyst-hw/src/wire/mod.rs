//! What goes over a serial line, a CAN bus or a socket, the same source on host and board: no heap, no clock, no device.
//!
//! - `frame.rs`: bytes to frames and back.

mod frame;

pub use frame::{Deframer, FrameError, MAX_FRAME, MAX_PAYLOAD, encode};
