//! A CAN bus as a line: messages in several frames, by ISO-TP.

use std::collections::VecDeque;
use std::io;
use std::time::{Duration, Instant};

use super::Line;
use crate::wire::{CanData, IsoTp, IsoTpError, MAX_FRAME};

/// Identifier of the frames to a device, unless another one was agreed on.
pub const TO_DEVICE: u32 = 0x6a0;
/// Identifier of the frames from it.
pub const FROM_DEVICE: u32 = 0x6a1;

/// How long the other end may take to allow the next frames.
const ALLOWS: Duration = Duration::from_millis(100);

/// A bus that carries frames.
pub trait Bus {
    /// Sends a frame.
    ///
    /// # Errors
    /// When the bus is gone.
    fn send(&mut self, id: u32, data: &[u8]) -> io::Result<()>;

    /// Waits for a frame for at most `patience`; none is no error.
    ///
    /// # Errors
    /// When the bus is gone.
    fn receive(&mut self, patience: Duration) -> io::Result<Option<(u32, CanData)>>;
}

/// The connection to one device on a bus.
#[derive(Debug)]
pub struct CanLine<B> {
    bus: B,
    tp: IsoTp<MAX_FRAME>,
    /// Identifier of frames to the device, and of those from it.
    to: u32,
    from: u32,
    came: VecDeque<u8>,
}

impl<B: Bus> CanLine<B> {
    /// To the device that listens to the identifier `to` and speaks with `from`, over classic frames or those of CAN FD.
    pub fn new(bus: B, to: u32, from: u32, fd: bool) -> Self {
        Self { bus, tp: IsoTp::new(fd), to, from, came: VecDeque::new() }
    }

    /// The bus.
    pub fn bus_mut(&mut self) -> &mut B {
        &mut self.bus
    }

    /// Waits for a frame, and for what it asks for in return.
    fn hear(&mut self, patience: Duration) -> io::Result<()> {
        if let Some((id, data)) = self.bus.receive(patience)?
            && id == self.from
        {
            if let Some(message) = self.tp.take(&data) {
                self.came.extend(message);
            }
            self.speak()?;
        }
        Ok(())
    }

    /// Sends all that may be sent.
    fn speak(&mut self) -> io::Result<()> {
        while let Some(frame) = self.tp.frame() {
            self.bus.send(self.to, &frame)?;
        }
        Ok(())
    }
}

impl<B: Bus> Line for CanLine<B> {
    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.tp.give_up();
        self.tp.send(bytes).map_err(|error| match error {
            IsoTpError::TooLong => io::Error::new(io::ErrorKind::InvalidInput, "more bytes than a message may have"),
            IsoTpError::Busy => io::Error::new(io::ErrorKind::ResourceBusy, "another message is on its way"),
        })?;
        self.speak()?;
        let began = Instant::now();
        while self.tp.busy() {
            let Some(left) = ALLOWS.checked_sub(began.elapsed()) else {
                // Who asked will ask again.
                self.tp.give_up();
                break;
            };
            self.hear(left)?;
        }
        Ok(())
    }

    fn receive(&mut self, bytes: &mut [u8], patience: Duration) -> io::Result<usize> {
        let began = Instant::now();
        while self.came.is_empty() {
            let Some(left) = patience.checked_sub(began.elapsed()).filter(|left| !left.is_zero()) else { break };
            self.hear(left)?;
        }
        let count = self.came.len().min(bytes.len());
        for (place, byte) in bytes.iter_mut().zip(self.came.drain(..count)) {
            *place = byte;
        }
        Ok(count)
    }
}
