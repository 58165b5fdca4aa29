//! Messages over a CAN bus: ISO 15765-2 (ISO-TP), classic frames of 8 bytes and FD frames of up to 64.
//!
//! No bus and no clock: [`IsoTp::frame`] gives the frames that are to be sent, [`IsoTp::take`] takes those that came, and who has a clock
//! waits for [`IsoTp::pause`] between them. A message that lost a frame is given up; who wants it asks again.

use core::time::Duration;

use heapless::Vec;

/// Most bytes of a CAN frame.
pub const MOST_CAN: usize = 64;
/// Most bytes of a message whose length fits in a first frame of the usual form.
const MOST_LENGTH: usize = 0xfff;
/// What one end tells the other about its message: go on, wait, there is no room for it.
const GO_ON: u8 = 0x30;
const WAIT: u8 = 0x31;
const NO_ROOM: u8 = 0x32;

/// Data of one CAN frame.
pub type CanData = Vec<u8, MOST_CAN>;

/// Lengths that a frame can have: all up to 8, beyond that those of CAN FD.
const LENGTHS: [usize; 7] = [12, 16, 20, 24, 32, 48, 64];
/// What fills a frame up to such a length.
const FILL: u8 = 0xcc;

/// Why a message is not sent.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum IsoTpError {
    /// The last one is not out yet.
    Busy,
    /// More bytes than there is room for.
    TooLong,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Sending {
    Nothing,
    /// All in one frame.
    Single,
    First,
    /// The other end has to say that it may go on.
    Waiting,
    Going,
}

/// One end of a connection, for messages of up to `N` bytes (4095 at most).
#[derive(Debug, Clone)]
pub struct IsoTp<const N: usize> {
    /// Bytes of a frame: 8, or 64.
    width: usize,
    sending: Sending,
    out: Vec<u8, N>,
    sent: usize,
    number: u8,
    /// Frames that may go before the other end has to be heard again; none if it does not matter.
    block: Option<u8>,
    /// What it wants between two frames.
    pause: Duration,
    /// What the other end is to be told about its message.
    answer: Option<u8>,
    into: Vec<u8, N>,
    /// Bytes of the message that comes; zero if none does.
    expected: usize,
    next: u8,
}

impl<const N: usize> IsoTp<N> {
    /// Over classic frames, or over those of CAN FD.
    pub const fn new(fd: bool) -> Self {
        Self {
            width: if fd { MOST_CAN } else { 8 },
            sending: Sending::Nothing,
            out: Vec::new(),
            sent: 0,
            number: 0,
            block: None,
            pause: Duration::ZERO,
            answer: None,
            into: Vec::new(),
            expected: 0,
            next: 0,
        }
    }

    /// Whether a message is on its way out.
    pub fn busy(&self) -> bool {
        self.sending != Sending::Nothing
    }

    /// Whether the other end has to allow what is still to be sent.
    pub fn waits(&self) -> bool {
        self.sending == Sending::Waiting
    }

    /// How long the other end wants to have between two frames of a message.
    pub fn pause(&self) -> Duration {
        self.pause
    }

    /// Gives up what is on its way out: the other end does not answer.
    pub fn give_up(&mut self) {
        self.sending = Sending::Nothing;
    }

    /// Begins to send a message.
    ///
    /// # Errors
    /// When another one is on its way, or it is too long.
    pub fn send(&mut self, message: &[u8]) -> Result<(), IsoTpError> {
        if self.busy() {
            return Err(IsoTpError::Busy);
        }
        self.out.clear();
        if message.len() > MOST_LENGTH || self.out.extend_from_slice(message).is_err() {
            return Err(IsoTpError::TooLong);
        }
        self.sent = 0;
        self.sending = if message.len() <= self.most_single() { Sending::Single } else { Sending::First };
        Ok(())
    }

    fn most_single(&self) -> usize {
        if self.width == 8 { 7 } else { self.width - 2 }
    }

    /// The next frame to send; none if there is nothing to send, or the other end has to be heard first.
    pub fn frame(&mut self) -> Option<CanData> {
        if let Some(answer) = self.answer.take() {
            // All of it in one go, without pauses.
            return Some(filled(&[answer, 0, 0], &[]));
        }
        let length = self.out.len();
        match self.sending {
            Sending::Nothing | Sending::Waiting => None,
            Sending::Single => {
                self.sending = Sending::Nothing;
                Some(match u8::try_from(length) {
                    Ok(short @ ..=7) => filled(&[short], &self.out),
                    _ => filled(&[0, length as u8], &self.out),
                })
            }
            Sending::First => {
                self.sent = self.width - 2;
                self.number = 1;
                self.sending = Sending::Waiting;
                Some(filled(&[0x10 | (length >> 8) as u8, length as u8], &self.out[..self.sent]))
            }
            Sending::Going => {
                let end = length.min(self.sent + self.width - 1);
                let frame = filled(&[0x20 | self.number], &self.out[self.sent..end]);
                self.number = (self.number + 1) & 0xf;
                self.sent = end;
                if end == length {
                    self.sending = Sending::Nothing;
                } else if let Some(left) = &mut self.block {
                    *left -= 1;
                    if *left == 0 {
                        self.sending = Sending::Waiting;
                    }
                }
                Some(frame)
            }
        }
    }

    /// Takes a frame that came; gives a message that is whole with it.
    pub fn take(&mut self, data: &[u8]) -> Option<&[u8]> {
        let (&head, rest) = data.split_first()?;
        match head >> 4 {
            0 => {
                // A length of its own byte comes with CAN FD.
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
                // Zero announces a length of four bytes.
                if length > N || length == 0 {
                    self.answer = Some(NO_ROOM);
                    return None;
                }
                // One that fits in a single frame does not come in several.
                if length <= bytes.len() {
                    return None;
                }
                self.into.extend_from_slice(bytes).ok()?;
                (self.expected, self.next, self.answer) = (length, 1, Some(GO_ON));
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
                    GO_ON => {
                        self.sending = Sending::Going;
                        self.block = rest.first().copied().filter(|frames| *frames > 0);
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

/// The time that a byte stands for: milliseconds, or tenths of them.
const fn pause(byte: u8) -> Duration {
    match byte {
        0..=0x7f => Duration::from_millis(byte as u64),
        0xf1..=0xf9 => Duration::from_micros(100 * (byte - 0xf0) as u64),
        // The standard has nothing for these; it takes them for the longest.
        _ => Duration::from_millis(0x7f),
    }
}

/// Head and bytes, filled up to a length that a frame can have.
fn filled(head: &[u8], bytes: &[u8]) -> CanData {
    let mut data = CanData::new();
    // Both together are a frame at most.
    let _ = data.extend_from_slice(head);
    let _ = data.extend_from_slice(bytes);
    let length = LENGTHS.iter().copied().find(|length| data.len() <= *length).unwrap_or(MOST_CAN);
    let _ = data.resize(if data.len() <= 8 { 8 } else { length }, FILL);
    data
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    type End = IsoTp<1024>;

    /// Frames go both ways until nobody has any; each is lost if `lost` says so.
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
    fn the_frames_are_those_of_the_standard() {
        let mut end = End::new(false);
        end.send(&[1, 2, 3]).unwrap();
        assert_eq!(end.send(&[4]), Err(IsoTpError::Busy));
        assert_eq!(end.frame().unwrap(), [3, 1, 2, 3, FILL, FILL, FILL, FILL]);
        assert_eq!(end.frame(), None);
        let message: std::vec::Vec<u8> = (0..20).collect();
        end.send(&message).unwrap();
        assert_eq!(end.frame().unwrap(), [0x10, 20, 0, 1, 2, 3, 4, 5]);
        assert_eq!(end.frame(), None);
        assert!(end.waits());
        // One frame, then another word; wait; go on.
        end.take(&[0x30, 1, 0]);
        assert_eq!(end.frame().unwrap(), [0x21, 6, 7, 8, 9, 10, 11, 12]);
        assert_eq!(end.frame(), None);
        end.take(&[0x31, 0, 0]);
        assert_eq!(end.frame(), None);
        end.take(&[0x30, 0, 0]);
        assert_eq!(end.frame().unwrap(), [0x22, 13, 14, 15, 16, 17, 18, 19]);
        assert!(!end.busy());
        // Of CAN FD.
        let mut end = End::new(true);
        end.send(&message).unwrap();
        let frame = end.frame().unwrap();
        assert_eq!((frame.len(), &frame[..4]), (24, &[0, 20, 0, 1][..]));
        assert_eq!(end.send(&[0; 1025]), Err(IsoTpError::TooLong));
    }

    #[test]
    fn the_other_end_says_how_fast() {
        let mut end = End::new(false);
        for (byte, micros) in [(0, 0), (20, 20_000), (0x7f, 127_000), (0xf1, 100), (0xf9, 900), (0x80, 127_000)] {
            end.give_up();
            end.send(&[0; 100]).unwrap();
            end.frame().unwrap();
            end.take(&[GO_ON, 0, byte]);
            assert_eq!(end.pause(), Duration::from_micros(micros), "{byte:#x}");
        }
    }

    #[test]
    fn a_message_without_room_is_refused() {
        let mut end = End::new(false);
        // 1025 bytes, and a length in four more bytes.
        for first in [[0x14, 1, 0, 1, 2, 3, 4, 5], [0x10, 0, 0, 0, 0x20, 0, 1, 2]] {
            assert_eq!(end.take(&first), None);
            assert_eq!(end.frame().unwrap()[..3], [NO_ROOM, 0, 0]);
            assert_eq!(end.take(&[0x21, 6, 7, 8, 9, 10, 11, 12]), None);
        }
        // Who is told so gives up.
        end.send(&[0; 100]).unwrap();
        end.frame().unwrap();
        end.take(&[NO_ROOM, 0, 0]);
        assert!(!end.busy() && end.frame().is_none());
        // A length of its own byte is of long frames.
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

        /// What arrives over a bus that loses frames is whole.
        #[test]
        fn nothing_arrives_in_part(
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
        fn any_frames_are_survived(frames in proptest::collection::vec(proptest::collection::vec(any::<u8>(), 0..65), 0..60)) {
            let mut end = End::new(true);
            let _ = end.send(&[7; 500]);
            for frame in &frames {
                let _ = end.take(frame);
                let _ = end.frame();
            }
        }
    }
}
