//! Messages over a CAN bus: ISO 15765-2 (ISO-TP), classic frames of 8 bytes and FD frames of up to 64.
//!
//! There is no bus and no clock here: [`IsoTp::frame`] returns the frames to send, [`IsoTp::take`] takes the received
//! frames. A sender with a clock waits for [`IsoTp::pause`] between frames. A message with a lost frame is dropped; the
//! host repeats its request.

use core::time::Duration;

use heapless::Vec;

/// Maximum number of bytes of a CAN frame.
pub const MOST_CAN: usize = 64;
/// Maximum length of a message (bytes): 12 bits in the first frame.
const MAX_LENGTH: usize = 0xfff;
/// Flow-control frames: continue to send, wait, overflow.
const CONTINUE: u8 = 0x30;
const WAIT: u8 = 0x31;
const OVERFLOW: u8 = 0x32;

/// Data of one CAN frame.
pub type CanData = Vec<u8, MOST_CAN>;

/// Lengths of CAN FD frames above 8 bytes.
const LENGTHS: [usize; 7] = [12, 16, 20, 24, 32, 48, 64];
/// Padding byte.
const PADDING: u8 = 0xcc;

/// Errors on sending a message.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum IsoTpError {
    /// The previous message is not completely sent.
    Busy,
    /// The message is too long.
    TooLong,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Sending {
    Nothing,
    /// Single frame.
    Single,
    First,
    /// Waiting for a flow-control frame.
    Waiting,
    Consecutive,
}

/// One end of a connection, for messages of up to `N` bytes (at most 4095).
#[derive(Debug, Clone)]
pub struct IsoTp<const N: usize> {
    /// Maximum number of bytes of a frame: 8 or 64.
    width: usize,
    sending: Sending,
    out: Vec<u8, N>,
    sent: usize,
    number: u8,
    /// Number of frames until the next flow-control frame is needed; `None` if none is needed.
    block_left: Option<u8>,
    /// Minimum time between two frames, from the flow-control frame.
    pause: Duration,
    /// Flow-control frame to send.
    flow_control: Option<u8>,
    into: Vec<u8, N>,
    /// Length of the message that is being received; 0 if none is.
    expected: usize,
    next: u8,
}

impl<const N: usize> IsoTp<N> {
    /// Returns an end of a connection; `fd`: with CAN FD frames.
    pub const fn new(fd: bool) -> Self {
        Self {
            width: if fd { MOST_CAN } else { 8 },
            sending: Sending::Nothing,
            out: Vec::new(),
            sent: 0,
            number: 0,
            block_left: None,
            pause: Duration::ZERO,
            flow_control: None,
            into: Vec::new(),
            expected: 0,
            next: 0,
        }
    }

    /// Returns whether a message is being sent.
    pub fn busy(&self) -> bool {
        self.sending != Sending::Nothing
    }

    /// Returns whether the rest of the message waits for a flow-control frame.
    pub fn waits(&self) -> bool {
        self.sending == Sending::Waiting
    }

    /// Returns the minimum time between two frames of a message, as required by the receiver.
    pub fn pause(&self) -> Duration {
        self.pause
    }

    /// Drops the message that is being sent, because the receiver does not answer.
    pub fn give_up(&mut self) {
        self.sending = Sending::Nothing;
    }

    /// Begins to send a message.
    ///
    /// # Errors
    /// If the previous message is not completely sent, or if the message is too long.
    pub fn send(&mut self, message: &[u8]) -> Result<(), IsoTpError> {
        if self.busy() {
            return Err(IsoTpError::Busy);
        }
        self.out.clear();
        if message.len() > MAX_LENGTH || self.out.extend_from_slice(message).is_err() {
            return Err(IsoTpError::TooLong);
        }
        self.sent = 0;
        self.sending = if message.len() <= self.max_single() { Sending::Single } else { Sending::First };
        Ok(())
    }

    fn max_single(&self) -> usize {
        if self.width == 8 { 7 } else { self.width - 2 }
    }

    /// Returns the next frame to send; `None` if there is none, or if a flow-control frame is needed first.
    pub fn frame(&mut self) -> Option<CanData> {
        if let Some(flow_control) = self.flow_control.take() {
            // Block size 0 and pause 0: the sender may send all frames at once.
            return Some(padded(&[flow_control, 0, 0], &[]));
        }
        let length = self.out.len();
        match self.sending {
            Sending::Nothing | Sending::Waiting => None,
            Sending::Single => {
                self.sending = Sending::Nothing;
                Some(match u8::try_from(length) {
                    Ok(short @ ..=7) => padded(&[short], &self.out),
                    _ => padded(&[0, length as u8], &self.out),
                })
            }
            Sending::First => {
                self.sent = self.width - 2;
                self.number = 1;
                self.sending = Sending::Waiting;
                Some(padded(&[0x10 | (length >> 8) as u8, length as u8], &self.out[..self.sent]))
            }
            Sending::Consecutive => {
                let end = length.min(self.sent + self.width - 1);
                let frame = padded(&[0x20 | self.number], &self.out[self.sent..end]);
                self.number = (self.number + 1) & 0xf;
                self.sent = end;
                if end == length {
                    self.sending = Sending::Nothing;
                } else if let Some(left) = &mut self.block_left {
                    *left -= 1;
                    if *left == 0 {
                        self.sending = Sending::Waiting;
                    }
                }
                Some(frame)
            }
        }
    }

    /// Takes a received frame; returns the message if the frame completes one.
    pub fn take(&mut self, data: &[u8]) -> Option<&[u8]> {
        let (&head, rest) = data.split_first()?;
        match head >> 4 {
            0 => {
                // In long CAN FD frames, the length has its own byte.
                let (length, bytes) = match head & 0xf {
                    0 if data.len() > 8 => {
                        let (&length, bytes) = rest.split_first()?;
                        (usize::from(length), bytes)
                    }
                    0 => return None,
                    length => (usize::from(length), rest),
                };
                self.expected = 0;
                self.into.clear();
                self.into.extend_from_slice(bytes.get(..length)?).ok()?;
                (length > 0).then_some(self.into.as_slice())
            }
            1 => {
                let (&low, bytes) = rest.split_first()?;
                let length = usize::from(head & 0xf) << 8 | usize::from(low);
                self.expected = 0;
                self.into.clear();
                // A length of 0 announces a length field of four bytes, which is too long here.
                if length > N || length == 0 {
                    self.flow_control = Some(OVERFLOW);
                    return None;
                }
                // A message that fits in a single frame must not begin with a first frame.
                if length <= bytes.len() {
                    return None;
                }
                self.into.extend_from_slice(bytes).ok()?;
                (self.expected, self.next, self.flow_control) = (length, 1, Some(CONTINUE));
                None
            }
            2 if self.expected > 0 => {
                if head & 0xf != self.next {
                    self.expected = 0;
                    return None;
                }
                self.next = (self.next + 1) & 0xf;
                let missing = self.expected - self.into.len();
                self.into.extend_from_slice(&rest[..rest.len().min(missing)]).ok()?;
                if self.into.len() < self.expected {
                    return None;
                }
                self.expected = 0;
                Some(&self.into)
            }
            3 if self.sending == Sending::Waiting => {
                match head {
                    CONTINUE => {
                        self.sending = Sending::Consecutive;
                        self.block_left = rest.first().copied().filter(|frames| *frames > 0);
                        self.pause = rest.get(1).copied().map_or(Duration::ZERO, pause);
                    }
                    WAIT => {}
                    _ => self.sending = Sending::Nothing,
                }
                None
            }
            _ => None,
        }
    }
}

/// Decodes the minimum separation time (STmin): milliseconds, or tenths of milliseconds.
const fn pause(byte: u8) -> Duration {
    match byte {
        0..=0x7f => Duration::from_millis(byte as u64),
        0xf1..=0xf9 => Duration::from_micros(100 * (byte - 0xf0) as u64),
        // Reserved values count as the longest time, as in the standard.
        _ => Duration::from_millis(0x7f),
    }
}

/// Joins head and bytes, and pads them to a valid frame length.
fn padded(head: &[u8], bytes: &[u8]) -> CanData {
    let mut data = CanData::new();
    // Both together fit in a frame.
    let _ = data.extend_from_slice(head);
    let _ = data.extend_from_slice(bytes);
    let length = LENGTHS.iter().copied().find(|length| data.len() <= *length).unwrap_or(MOST_CAN);
    let _ = data.resize(if data.len() <= 8 { 8 } else { length }, PADDING);
    data
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    type End = IsoTp<1024>;

    /// Exchanges frames until both ends have none; a frame is lost if `lost` returns true.
    fn pass(from: &mut End, to: &mut End, lost: &mut impl FnMut() -> bool) -> std::vec::Vec<std::vec::Vec<u8>> {
        let mut arrived = std::vec::Vec::new();
        loop {
            let mut quiet = true;
            while let Some(frame) = from.frame() {
                quiet = false;
                if !lost()
                    && let Some(message) = to.take(&frame)
                {
                    arrived.push(message.to_vec());
                }
            }
            while let Some(frame) = to.frame() {
                quiet = false;
                if !lost() {
                    assert_eq!(from.take(&frame), None);
                }
            }
            if quiet {
                return arrived;
            }
        }
    }

    #[test]
    fn the_frames_follow_the_standard() {
        let mut end = End::new(false);
        end.send(&[1, 2, 3]).unwrap();
        assert_eq!(end.send(&[4]), Err(IsoTpError::Busy));
        assert_eq!(end.frame().unwrap(), [3, 1, 2, 3, PADDING, PADDING, PADDING, PADDING]);
        assert_eq!(end.frame(), None);
        let message: std::vec::Vec<u8> = (0..20).collect();
        end.send(&message).unwrap();
        assert_eq!(end.frame().unwrap(), [0x10, 20, 0, 1, 2, 3, 4, 5]);
        assert_eq!(end.frame(), None);
        assert!(end.waits());
        // Continue with one frame; wait; continue.
        end.take(&[0x30, 1, 0]);
        assert_eq!(end.frame().unwrap(), [0x21, 6, 7, 8, 9, 10, 11, 12]);
        assert_eq!(end.frame(), None);
        end.take(&[0x31, 0, 0]);
        assert_eq!(end.frame(), None);
        end.take(&[0x30, 0, 0]);
        assert_eq!(end.frame().unwrap(), [0x22, 13, 14, 15, 16, 17, 18, 19]);
        assert!(!end.busy());
        // CAN FD frames.
        let mut end = End::new(true);
        end.send(&message).unwrap();
        let frame = end.frame().unwrap();
        assert_eq!((frame.len(), &frame[..4]), (24, &[0, 20, 0, 1][..]));
        assert_eq!(end.send(&[0; 1025]), Err(IsoTpError::TooLong));
    }

    #[test]
    fn the_receiver_sets_the_time_between_frames() {
        let mut end = End::new(false);
        for (byte, micros) in [(0, 0), (20, 20_000), (0x7f, 127_000), (0xf1, 100), (0xf9, 900), (0x80, 127_000)] {
            end.give_up();
            end.send(&[0; 100]).unwrap();
            end.frame().unwrap();
            end.take(&[CONTINUE, 0, byte]);
            assert_eq!(end.pause(), Duration::from_micros(micros), "{byte:#x}");
        }
    }

    #[test]
    fn a_message_that_is_too_long_is_refused() {
        let mut end = End::new(false);
        // A length of 1025 bytes, and a length field of four bytes.
        for first in [[0x14, 1, 0, 1, 2, 3, 4, 5], [0x10, 0, 0, 0, 0x20, 0, 1, 2]] {
            assert_eq!(end.take(&first), None);
            assert_eq!(end.frame().unwrap()[..3], [OVERFLOW, 0, 0]);
            assert_eq!(end.take(&[0x21, 6, 7, 8, 9, 10, 11, 12]), None);
        }
        // The sender drops the message after an overflow frame.
        end.send(&[0; 100]).unwrap();
        end.frame().unwrap();
        end.take(&[OVERFLOW, 0, 0]);
        assert!(!end.busy() && end.frame().is_none());
        // A length in its own byte is invalid in a short frame.
        assert_eq!(end.take(&[0, 2, 1, 2, 0, 0, 0, 0]), None);
    }

    proptest! {
        #[test]
        fn messages_arrive(message in proptest::collection::vec(any::<u8>(), 1..1024), fd in any::<bool>()) {
            let (mut from, mut to) = (End::new(fd), End::new(fd));
            from.send(&message).unwrap();
            prop_assert_eq!(pass(&mut from, &mut to, &mut || false), vec![message]);
            prop_assert!(!from.busy());
        }

        /// Over a bus that loses frames, only complete messages arrive.
        #[test]
        fn only_complete_messages_arrive(
            messages in proptest::collection::vec(proptest::collection::vec(any::<u8>(), 1..300), 1..6),
            losses in proptest::collection::vec(0u8..10, 1..60),
        ) {
            let (mut from, mut to) = (End::new(false), End::new(false));
            let mut losses = losses.iter().cycle();
            for message in &messages {
                from.give_up();
                from.send(message).unwrap();
                for arrived in pass(&mut from, &mut to, &mut || losses.next() == Some(&0)) {
                    prop_assert_eq!(&arrived, message);
                }
            }
        }

        #[test]
        fn arbitrary_frames_do_not_panic(frames in proptest::collection::vec(proptest::collection::vec(any::<u8>(), 0..65), 0..60)) {
            let mut end = End::new(true);
            let _ = end.send(&[7; 500]);
            for frame in &frames {
                let _ = end.take(frame);
                let _ = end.frame();
            }
        }
    }
}
