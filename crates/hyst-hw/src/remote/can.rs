//! A CAN bus as a line: ISO-TP splits messages into frames.

use std::collections::VecDeque;
use std::io;
use std::thread::sleep;
use std::time::{Duration, Instant};

use super::line::Line;
use crate::wire::{CanData, IsoTp, IsoTpError, MAX_FRAME};

/// Default identifier of the frames to a device.
pub const TO_DEVICE: u32 = 0x6a0;
/// Default identifier of the frames from a device.
pub const FROM_DEVICE: u32 = 0x6a1;

/// Largest standard identifier (11 bits).
pub(super) const MAX_STANDARD_ID: u32 = 0x7ff;
/// Largest extended identifier (29 bits).
pub(super) const MAX_EXTENDED_ID: u32 = 0x1fff_ffff;

/// Default time to wait for a flow-control frame of the receiver.
///
/// The standard has 1 s (N_Bs), but by then the host repeats the request.
const FLOW_CONTROL_TIMEOUT: Duration = Duration::from_millis(100);

/// A CAN bus that carries classic frames and CAN FD frames.
///
/// Identifiers up to 0x7ff are standard (11 bits), larger ones are extended (29 bits). An extended frame with an
/// identifier up to 0x7ff is ignored.
pub trait Bus {
    /// Sends a frame.
    ///
    /// # Errors
    /// If the connection to the bus is lost.
    fn send(&mut self, id: u32, data: &[u8]) -> io::Result<()>;

    /// Waits for a frame for at most `patience`; returns `None` if none arrives.
    ///
    /// # Errors
    /// If the connection to the bus is lost.
    fn receive(&mut self, patience: Duration) -> io::Result<Option<(u32, CanData)>>;
}

/// The connection to one device on a bus.
#[derive(Debug)]
pub struct CanLine<B> {
    bus: B,
    tp: IsoTp<MAX_FRAME>,
    /// Identifiers of frames to and from the device.
    to: u32,
    from: u32,
    flow_control_timeout: Duration,
    received: VecDeque<u8>,
}

impl<B: Bus> CanLine<B> {
    /// Returns the connection to the device that receives identifier `to` and sends `from`.
    ///
    /// `fd`: with CAN FD frames.
    ///
    /// At the device's end of a connection, exchange the two identifiers.
    pub fn new(bus: B, to: u32, from: u32, fd: bool) -> Self {
        Self {
            bus,
            tp: IsoTp::new(fd),
            to,
            from,
            flow_control_timeout: FLOW_CONTROL_TIMEOUT,
            received: VecDeque::new(),
        }
    }

    /// Sets the time to wait for a flow-control frame.
    #[must_use]
    pub fn patient(self, flow_control_timeout: Duration) -> Self {
        Self { flow_control_timeout, ..self }
    }

    /// Returns the bus.
    pub fn bus_mut(&mut self) -> &mut B {
        &mut self.bus
    }

    /// Receives a frame and sends the frames that are then permitted.
    ///
    /// Returns whether a flow-control frame arrived.
    fn receive_frame(&mut self, patience: Duration) -> io::Result<bool> {
        let waited = self.tp.waits();
        if let Some((id, data)) = self.bus.receive(patience)?
            && id == self.from
            && let Some(message) = self.tp.take(&data)
        {
            self.received.extend(message);
        }
        let allowed = waited && !self.tp.waits();
        self.send_frames()?;
        Ok(allowed)
    }

    /// Sends all frames that are permitted now.
    fn send_frames(&mut self) -> io::Result<()> {
        while let Some(frame) = self.tp.frame() {
            self.bus.send(self.to, &frame)?;
            if self.tp.busy() && !self.tp.waits() {
                sleep(self.tp.pause());
            }
        }
        Ok(())
    }
}

impl<B: Bus> Line for CanLine<B> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.tp.give_up();
        self.tp.send(bytes).map_err(|error| match error {
            IsoTpError::TooLong => {
                io::Error::new(io::ErrorKind::InvalidInput, "the message is longer than ISO-TP allows")
            }
            IsoTpError::Busy => io::Error::new(io::ErrorKind::ResourceBusy, "another message is still being sent"),
        })?;
        self.send_frames()?;
        let mut last = Instant::now();
        while self.tp.busy() {
            let Some(left) = self.flow_control_timeout.checked_sub(last.elapsed()) else {
                // The host repeats the request.
                self.tp.give_up();
                break;
            };
            if self.receive_frame(left)? {
                last = Instant::now();
            }
        }
        Ok(())
    }

    fn receive(&mut self, bytes: &mut [u8], patience: Duration) -> io::Result<usize> {
        let began = Instant::now();
        while self.received.is_empty() {
            // Without patience, only frames that have already arrived.
            let left = patience.saturating_sub(began.elapsed());
            self.receive_frame(left)?;
            if left.is_zero() {
                break;
            }
        }
        let count = self.received.len().min(bytes.len());
        for (place, byte) in bytes.iter_mut().zip(self.received.drain(..count)) {
            *place = byte;
        }
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A device that permits one frame at a time, after a delay.
    struct Slow {
        frames: Vec<(u32, CanData)>,
        takes: Duration,
    }

    impl Bus for Slow {
        fn send(&mut self, id: u32, data: &[u8]) -> io::Result<()> {
            self.frames.push((id, data.iter().copied().collect()));
            Ok(())
        }
        fn receive(&mut self, _: Duration) -> io::Result<Option<(u32, CanData)>> {
            sleep(self.takes);
            Ok(Some((FROM_DEVICE, [0x30, 1, 0].into_iter().collect())))
        }
    }

    #[test]
    fn a_device_with_slow_flow_control_receives_the_whole_message() {
        let bus = Slow { frames: Vec::new(), takes: FLOW_CONTROL_TIMEOUT * 2 / 5 };
        let mut line = CanLine::new(bus, TO_DEVICE, FROM_DEVICE, false);
        // A first frame with 6 bytes and four with 7 bytes.
        line.send(&[7; 34]).unwrap();
        let heads: Vec<(u32, u8)> = line.bus_mut().frames.iter().map(|(id, data)| (*id, data[0])).collect();
        assert_eq!(heads, [0x10, 0x21, 0x22, 0x23, 0x24].map(|head| (TO_DEVICE, head)));
    }

    #[test]
    fn frames_that_have_arrived_are_received_without_patience() {
        let bus = Slow { frames: Vec::new(), takes: Duration::ZERO };
        let mut line = CanLine::new(bus, TO_DEVICE, FROM_DEVICE, false);
        line.tp.send(&[7; 34]).unwrap();
        line.send_frames().unwrap();
        assert_eq!(line.receive(&mut [0; 10], Duration::ZERO).unwrap(), 0);
        assert_eq!(line.bus_mut().frames.len(), 2);
    }
}
