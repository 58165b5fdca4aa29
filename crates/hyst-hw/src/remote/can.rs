//! A CAN bus as a line: messages in several frames, by ISO-TP.

use std::collections::VecDeque;
use std::io;
use std::thread::sleep;
use std::time::{Duration, Instant};

use super::Line;
use crate::wire::{CanData, IsoTp, IsoTpError, MAX_FRAME};

/// Identifier of the frames to a device, unless another one was agreed on.
pub const TO_DEVICE: u32 = 0x6a0;
/// Identifier of the frames from it.
pub const FROM_DEVICE: u32 = 0x6a1;

/// Largest identifier of 11 bits, and of 29.
pub(super) const SHORT: u32 = 0x7ff;
pub(super) const LARGEST: u32 = 0x1fff_ffff;

/// How long the other end may take to allow the next frames, unless told otherwise. The standard says a second; who asked has asked again
/// by then.
const ALLOWS: Duration = Duration::from_millis(100);

/// A bus that carries frames, classic ones and of CAN FD.
///
/// Identifiers up to 0x7ff are those of 11 bits, greater ones those of 29; a frame of 29 bits with a smaller one is passed over.
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
    allows: Duration,
    came: VecDeque<u8>,
}

impl<B: Bus> CanLine<B> {
    /// To the device that listens to the identifier `to` and speaks with `from`, over classic frames or those of CAN FD.
    /// A device is at the other end: it has the two the other way round.
    pub fn new(bus: B, to: u32, from: u32, fd: bool) -> Self {
        Self { bus, tp: IsoTp::new(fd), to, from, allows: ALLOWS, came: VecDeque::new() }
    }

    /// The same, to another end that may take so long to allow the next frames of a message.
    #[must_use]
    pub fn patient(self, allows: Duration) -> Self {
        Self { allows, ..self }
    }

    /// The bus.
    pub fn bus_mut(&mut self) -> &mut B {
        &mut self.bus
    }

    /// Waits for a frame and sends what may be sent after it; whether it allowed to go on.
    fn hear(&mut self, patience: Duration) -> io::Result<bool> {
        let waited = self.tp.waits();
        if let Some((id, data)) = self.bus.receive(patience)?
            && id == self.from
            && let Some(message) = self.tp.take(&data)
        {
            self.came.extend(message);
        }
        let allowed = waited && !self.tp.waits();
        self.speak()?;
        Ok(allowed)
    }

    /// Sends all that may be sent.
    fn speak(&mut self) -> io::Result<()> {
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
            IsoTpError::TooLong => io::Error::new(io::ErrorKind::InvalidInput, "more bytes than a message may have"),
            IsoTpError::Busy => io::Error::new(io::ErrorKind::ResourceBusy, "another message is on its way"),
        })?;
        self.speak()?;
        let mut last = Instant::now();
        while self.tp.busy() {
            let Some(left) = self.allows.checked_sub(last.elapsed()) else {
                // Who asked will ask again.
                self.tp.give_up();
                break;
            };
            if self.hear(left)? {
                last = Instant::now();
            }
        }
        Ok(())
    }

    fn receive(&mut self, bytes: &mut [u8], patience: Duration) -> io::Result<usize> {
        let began = Instant::now();
        while self.came.is_empty() {
            // Who has no patience gets what is there.
            let left = patience.saturating_sub(began.elapsed());
            self.hear(left)?;
            if left.is_zero() {
                break;
            }
        }
        let count = self.came.len().min(bytes.len());
        for (place, byte) in bytes.iter_mut().zip(self.came.drain(..count)) {
            *place = byte;
        }
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A device that allows one frame at a time, and takes its time over it.
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
    fn a_slow_device_gets_all_of_a_message() {
        let bus = Slow { frames: Vec::new(), takes: ALLOWS * 2 / 5 };
        let mut line = CanLine::new(bus, TO_DEVICE, FROM_DEVICE, false);
        // A first frame of 6 bytes and four of 7.
        line.send(&[7; 34]).unwrap();
        let heads: Vec<(u32, u8)> = line.bus_mut().frames.iter().map(|(id, data)| (*id, data[0])).collect();
        assert_eq!(heads, [0x10, 0x21, 0x22, 0x23, 0x24].map(|head| (TO_DEVICE, head)));
    }

    #[test]
    fn what_is_there_is_heard_without_patience() {
        let bus = Slow { frames: Vec::new(), takes: Duration::ZERO };
        let mut line = CanLine::new(bus, TO_DEVICE, FROM_DEVICE, false);
        line.tp.send(&[7; 34]).unwrap();
        line.speak().unwrap();
        assert_eq!(line.receive(&mut [0; 10], Duration::ZERO).unwrap(), 0);
        assert_eq!(line.bus_mut().frames.len(), 2);
    }
}
