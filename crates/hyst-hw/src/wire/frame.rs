//! Frames on a stream of bytes.
//!
//! A frame is a message in [postcard](https://postcard.jamesmunns.com), its CRC-32 (ISO-HDLC, least byte first), both stuffed so that no
//! byte of them is zero (COBS; Cheshire and Baker 1999), and a zero byte. So a receiver that comes in late, or has lost bytes, is
//! right again after the next zero; what was changed on the way is taken for a message once in 2³² times at most.

use core::fmt;

use serde::Serialize;
use serde::de::DeserializeOwned;

/// Most bytes of a message in postcard.
pub const MAX_PAYLOAD: usize = 512;
/// Bytes of the check sum.
const SUM: usize = 4;
/// Most bytes of a frame: message and check sum stuffed, and the zero.
pub const MAX_FRAME: usize = cobs::max_encoding_length(MAX_PAYLOAD + SUM) + 1;

const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// Why bytes are no message, or a message no frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameError {
    /// More bytes than any frame has.
    TooLong,
    /// The stuffing is broken: bytes were lost or added.
    Stuffing,
    /// Fewer bytes than a check sum.
    TooShort,
    /// The check sum is another one: bytes were changed.
    Sum,
    /// The bytes arrived as they were sent, but are no message of this protocol.
    Message,
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TooLong => "the message is longer than a frame can be",
            Self::Stuffing => "bytes of the frame were lost on the way",
            Self::TooShort => "the frame has no check sum",
            Self::Sum => "bytes of the frame were changed on the way",
            Self::Message => "the frame holds no message of this version of the protocol",
        })
    }
}

impl core::error::Error for FrameError {}

/// Writes a message as a frame to the beginning of a buffer, and gives that part of it. [`MAX_FRAME`] bytes hold any frame; the message is
/// put together in as many on the stack.
///
/// # Errors
/// [`FrameError::TooLong`] if the message has more than [`MAX_PAYLOAD`] bytes, or the buffer no room for it;
/// [`FrameError::Message`] if postcard has no form for it.
pub fn encode<'b>(message: &impl Serialize, buffer: &'b mut [u8]) -> Result<&'b [u8], FrameError> {
    let mut bytes = [0; MAX_PAYLOAD + SUM];
    let (payload, _) = bytes.split_at_mut(MAX_PAYLOAD);
    let length = match postcard::to_slice(message, payload) {
        Ok(payload) => payload.len(),
        Err(postcard::Error::SerializeBufferFull) => return Err(FrameError::TooLong),
        Err(_) => return Err(FrameError::Message),
    };
    let sum = CRC.checksum(&bytes[..length]).to_le_bytes();
    bytes[length..length + SUM].copy_from_slice(&sum);
    let room = buffer.len().saturating_sub(1);
    let stuffed = cobs::try_encode(&bytes[..length + SUM], &mut buffer[..room]).map_err(|_| FrameError::TooLong)?;
    // Without room for its last byte the stuffing is told to be one longer than the room, if that byte is a zero.
    let frame = buffer.get_mut(..=stuffed).ok_or(FrameError::TooLong)?;
    frame[stuffed] = 0;
    Ok(frame)
}

/// Collects bytes until a frame is whole.
///
/// ```
/// use hyst_hw::wire::{Deframer, MAX_FRAME, encode};
///
/// let mut buffer = [0; MAX_FRAME];
/// let sent = encode(&(7u32, 1.5f32), &mut buffer)?;
/// // Half of it arrives, then the rest with the beginning of another one.
/// let (mut first, mut second) = (&sent[..3], [&sent[3..], &[9, 9]].concat());
/// let mut deframer = Deframer::new();
/// assert_eq!(deframer.next::<(u32, f32)>(&mut first), None);
/// let mut rest = &second[..];
/// assert_eq!(deframer.next(&mut rest), Some(Ok((7u32, 1.5f32))));
/// assert_eq!(deframer.next::<(u32, f32)>(&mut rest), None);
/// # Ok::<(), hyst_hw::wire::FrameError>(())
/// ```
#[derive(Debug, Clone)]
pub struct Deframer {
    bytes: [u8; MAX_FRAME],
    /// Bytes since the last zero; one more than there is room for, however many more have come.
    length: usize,
}

impl Default for Deframer {
    fn default() -> Self {
        Self::new()
    }
}

impl Deframer {
    /// At the beginning of a frame.
    pub const fn new() -> Self {
        Self { bytes: [0; MAX_FRAME], length: 0 }
    }

    /// Takes bytes from the front of `input` up to the end of a frame, and gives its message; `None` if all are taken before one has
    /// ended. Zeros without anything before them are passed over: a sender may begin with one to end what was left before.
    pub fn next<M: DeserializeOwned>(&mut self, input: &mut &[u8]) -> Option<Result<M, FrameError>> {
        while let Some((byte, rest)) = input.split_first() {
            *input = rest;
            if *byte != 0 {
                if let Some(place) = self.bytes.get_mut(self.length) {
                    *place = *byte;
                }
                self.length = (self.length + 1).min(MAX_FRAME + 1);
            } else if self.length > 0 {
                let message = self.message();
                self.length = 0;
                return Some(message);
            }
        }
        None
    }

    fn message<M: DeserializeOwned>(&mut self) -> Result<M, FrameError> {
        let stuffed = self.bytes.get_mut(..self.length).ok_or(FrameError::TooLong)?;
        let length = cobs::decode_in_place(stuffed).map_err(|_| FrameError::Stuffing)?;
        let (payload, sum) = self.bytes[..length].split_last_chunk::<SUM>().ok_or(FrameError::TooShort)?;
        if CRC.checksum(payload) != u32::from_le_bytes(*sum) {
            return Err(FrameError::Sum);
        }
        match postcard::take_from_bytes(payload) {
            Ok((message, [])) => Ok(message),
            _ => Err(FrameError::Message),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde::Deserialize;

    #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
    enum Message {
        Quiet,
        Values { first: u32, values: Vec<f32> },
    }

    fn frame(message: &Message) -> Vec<u8> {
        encode(message, &mut [0; MAX_FRAME]).unwrap().to_vec()
    }

    /// What arrives of some bytes that come in pieces of this size.
    fn received(bytes: &[u8], piece: usize) -> Vec<Result<Message, FrameError>> {
        let mut deframer = Deframer::new();
        let mut all = Vec::new();
        for mut piece in bytes.chunks(piece) {
            while let Some(message) = deframer.next(&mut piece) {
                all.push(message);
            }
        }
        all
    }

    fn messages() -> impl Strategy<Value = Message> {
        let value = any::<u32>().prop_map(|bits| f32::from_bits(bits & 0xff7f_ffff));
        let values = (any::<u32>(), proptest::collection::vec(value, 0..100))
            .prop_map(|(first, values)| Message::Values { first, values });
        prop_oneof![Just(Message::Quiet), values]
    }

    #[test]
    fn the_bytes_of_a_frame_are_those_of_the_standards() {
        // Postcard: variant 1, varint 300, two values; CRC-32 of these bytes; COBS.
        let payload = [1, 0xac, 0x02, 2, 0, 0, 0x80, 0x3f, 0, 0, 0, 0];
        let sum = CRC.checksum(&payload).to_le_bytes();
        let mut expected = cobs::encode_vec(&[&payload[..], &sum].concat());
        expected.push(0);
        assert_eq!(frame(&Message::Values { first: 300, values: vec![1.0, 0.0] }), expected);
        // The check value of CRC-32/ISO-HDLC.
        assert_eq!(CRC.checksum(b"123456789"), 0xcbf4_3926);
    }

    #[test]
    fn a_message_or_a_buffer_of_the_wrong_size_is_refused() {
        let values = |count: usize| Message::Values { first: 1, values: vec![f32::from_bits(0x1111_1111); count] };
        // Variant, first, count (a byte each, two from 128 on), four for each value.
        assert_eq!(frame(&values(127)).len(), cobs::max_encoding_length(511 + SUM) + 1);
        assert_eq!(encode(&values(128), &mut [0; 2 * MAX_FRAME]), Err(FrameError::TooLong));
        for byte in 0..=u8::MAX {
            // A byte, its sum, one that COBS adds, the zero: some sums end in a zero.
            for room in 0..7 {
                assert_eq!(encode(&byte, &mut vec![0; room]), Err(FrameError::TooLong), "{byte} {room}");
            }
            assert!(encode(&byte, &mut [0; 7]).is_ok());
        }
    }

    #[test]
    fn what_is_no_frame_is_told_and_the_next_one_arrives() {
        let good = frame(&Message::Quiet);
        let after = |bad: &[u8]| received(&[bad, &good].concat(), 3);
        let told = |error| vec![Err(error), Ok(Message::Quiet)];
        assert_eq!(after(&[5, 1, 0]), told(FrameError::Stuffing));
        assert_eq!(after(&[2, 1, 0]), told(FrameError::TooShort));
        assert_eq!(after(&[6, 1, 1, 1, 1, 1, 0]), told(FrameError::Sum));
        assert_eq!(after(&[[7; 2 * MAX_FRAME].as_slice(), &[0]].concat()), told(FrameError::TooLong));
        // A whole frame of something else, and one with more than a message.
        for other in [encode(&9u8, &mut [0; 9]).unwrap(), encode(&(0u8, 0u8), &mut [0; 9]).unwrap()] {
            assert_eq!(after(other), told(FrameError::Message));
        }
        assert_eq!(after(&[0, 0, 0]), vec![Ok(Message::Quiet)]);
    }

    proptest! {
        #[test]
        fn messages_arrive_in_whatever_pieces(sent in proptest::collection::vec(messages(), 1..5), piece in 1usize..700) {
            let bytes: Vec<u8> = sent.iter().flat_map(frame).collect();
            let arrived: Vec<Message> = received(&bytes, piece).into_iter().map(Result::unwrap).collect();
            prop_assert_eq!(arrived, sent);
        }

        /// Of a stream with one changed, lost or added byte all messages arrive but those that it touched, and nothing else.
        #[test]
        fn one_bad_byte_costs_two_messages_at_most(
            sent in proptest::collection::vec(messages(), 1..6),
            place in any::<prop::sample::Index>(),
            byte in any::<u8>(),
            kind in 0..3,
        ) {
            let mut bytes: Vec<u8> = sent.iter().flat_map(frame).collect();
            let at = place.index(bytes.len());
            match kind {
                0 => bytes[at] = byte,
                1 => drop(bytes.remove(at)),
                _ => bytes.insert(at, byte),
            }
            let arrived: Vec<Message> = received(&bytes, 64).into_iter().filter_map(Result::ok).collect();
            prop_assert!(arrived.len() + 2 >= sent.len());
            let mut rest = sent.iter();
            prop_assert!(arrived.iter().all(|m| rest.any(|s| s == m)), "{:?} of {:?}", arrived, sent);
        }

        #[test]
        fn any_bytes_are_survived(bytes in proptest::collection::vec(any::<u8>(), 0..2000), piece in 1usize..2000) {
            let good = frame(&Message::Quiet);
            let arrived = received(&[&bytes[..], &[0], &good].concat(), piece);
            prop_assert_eq!(arrived.last(), Some(&Ok(Message::Quiet)));
        }
    }
}
