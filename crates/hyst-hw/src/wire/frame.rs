//! Frames on a byte stream.
//!
//! A frame is a message in [postcard](https://postcard.jamesmunns.com) and its CRC-32 (ISO-HDLC, least significant byte
//! first), both with COBS encoding (Cheshire and Baker 1999), which contains no zero bytes, and a final zero byte.
//! After lost bytes, a receiver is synchronised again at the next zero. The CRC fails to detect a damaged frame with a
//! probability of about 2⁻³².

use core::fmt;

use serde::Serialize;
use serde::de::DeserializeOwned;

/// Maximum number of bytes of a message in postcard.
pub const MAX_PAYLOAD: usize = 512;
/// Bytes of the checksum.
const SUM: usize = 4;
/// Maximum number of bytes of a frame: encoded message and checksum, and the zero.
pub const MAX_FRAME: usize = cobs::max_encoding_length(MAX_PAYLOAD + SUM) + 1;

const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// Errors of encoding and decoding frames.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum FrameError {
    /// The message or frame is too long.
    TooLong,
    /// Invalid COBS encoding: bytes were lost or added.
    Stuffing,
    /// The frame is shorter than a checksum.
    TooShort,
    /// The checksum does not match: bytes were changed.
    Sum,
    /// The checksum matches, but the bytes are not a message of this protocol.
    Message,
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::TooLong => "the message is too long for a frame",
            Self::Stuffing => "bytes of the frame were lost or added in transmission",
            Self::TooShort => "the frame has no checksum",
            Self::Sum => "bytes of the frame were changed in transmission",
            Self::Message => "the frame does not contain a message of this version of the protocol",
        })
    }
}

impl core::error::Error for FrameError {}

/// Writes a message as a frame to the start of a buffer and returns that part of the buffer.
///
/// A buffer of [`MAX_FRAME`] bytes is large enough for every frame. The function needs about as many bytes of stack.
///
/// # Errors
/// [`FrameError::TooLong`] if the message has more than [`MAX_PAYLOAD`] bytes, or if the buffer is too small;
/// [`FrameError::Message`] if postcard cannot encode the message.
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
    // If the buffer is one byte too short and the last byte is zero, `try_encode` returns a length above the buffer's.
    let frame = buffer.get_mut(..=stuffed).ok_or(FrameError::TooLong)?;
    frame[stuffed] = 0;
    Ok(frame)
}

/// Collects bytes until a frame is complete.
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
    /// Bytes since the last zero; at most one more than the buffer holds.
    length: usize,
}

impl Default for Deframer {
    fn default() -> Self {
        Self::new()
    }
}

impl Deframer {
    /// Returns a deframer at the start of a frame.
    pub const fn new() -> Self {
        Self { bytes: [0; MAX_FRAME], length: 0 }
    }

    /// Takes bytes from the front of `input` up to the end of a frame and returns its message.
    ///
    /// `None` if no frame ends.
    ///
    /// Zeros at the start of a frame are ignored, so a sender may begin with a zero to end an incomplete frame.
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

    /// Returns the messages in bytes that arrive in pieces of this size.
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
    fn the_bytes_of_a_frame_follow_the_standards() {
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
        // Variant, first and count take one byte each (two from 128 on), each value four.
        assert_eq!(frame(&values(127)).len(), cobs::max_encoding_length(511 + SUM) + 1);
        assert_eq!(encode(&values(128), &mut [0; 2 * MAX_FRAME]), Err(FrameError::TooLong));
        for byte in 0..=u8::MAX {
            // One byte, four of its checksum, one that COBS adds, the zero. Some checksums end in a zero.
            for room in 0..7 {
                assert_eq!(encode(&byte, &mut vec![0; room]), Err(FrameError::TooLong), "{byte} {room}");
            }
            assert!(encode(&byte, &mut [0; 7]).is_ok());
        }
    }

    #[test]
    fn invalid_frames_are_reported_and_the_next_frame_arrives() {
        let good = frame(&Message::Quiet);
        let after = |bad: &[u8]| received(&[bad, &good].concat(), 3);
        let expected = |error| vec![Err(error), Ok(Message::Quiet)];
        assert_eq!(after(&[5, 1, 0]), expected(FrameError::Stuffing));
        assert_eq!(after(&[2, 1, 0]), expected(FrameError::TooShort));
        assert_eq!(after(&[6, 1, 1, 1, 1, 1, 0]), expected(FrameError::Sum));
        assert_eq!(after(&[[7; 2 * MAX_FRAME].as_slice(), &[0]].concat()), expected(FrameError::TooLong));
        // A valid frame with another content, and one with bytes after the message.
        for other in [encode(&9u8, &mut [0; 9]).unwrap(), encode(&(0u8, 0u8), &mut [0; 9]).unwrap()] {
            assert_eq!(after(other), expected(FrameError::Message));
        }
        assert_eq!(after(&[0, 0, 0]), vec![Ok(Message::Quiet)]);
    }

    proptest! {
        #[test]
        fn messages_arrive_in_pieces_of_any_size(sent in proptest::collection::vec(messages(), 1..5), piece in 1usize..700) {
            let bytes: Vec<u8> = sent.iter().flat_map(frame).collect();
            let arrived: Vec<Message> = received(&bytes, piece).into_iter().map(Result::unwrap).collect();
            prop_assert_eq!(arrived, sent);
        }

        /// After one changed, lost or added byte, only the messages that contain it are lost.
        #[test]
        fn one_bad_byte_damages_at_most_two_messages(
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
        fn a_frame_after_arbitrary_bytes_arrives(bytes in proptest::collection::vec(any::<u8>(), 0..2000), piece in 1usize..2000) {
            let good = frame(&Message::Quiet);
            let arrived = received(&[&bytes[..], &[0], &good].concat(), piece);
            prop_assert_eq!(arrived.last(), Some(&Ok(Message::Quiet)));
        }
    }
}
