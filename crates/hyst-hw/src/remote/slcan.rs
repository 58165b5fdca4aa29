//! CAN over a serial line: the text protocol of the LAWICEL CANUSB and CAN232 ("slcan").
//!
//! It includes the usual extension for CAN FD.
//!
//! | text | meaning |
//! |---|---|
//! | `S6\r` | bit rate 500 kbit/s (0 … 8: 10, 20, 50, 100, 125, 250, 500, 800, 1000 kbit/s) |
//! | `O\r`, `C\r` | open the bus, close the bus |
//! | `tIIILDD…\r` | frame: identifier of 11 bits, length, data, all hexadecimal |
//! | `TIIIIIIIILDD…\r` | frame with an identifier of 29 bits |
//! | `dIIILDD…\r`, `DIIIIIIIILDD…\r` | CAN FD frames; `b`, `B`: with bit-rate switching |

use std::collections::VecDeque;
use std::io;
use std::time::{Duration, Instant};

use super::can::{Bus, MAX_EXTENDED_ID, MAX_STANDARD_ID};
use super::line::Line;
use crate::wire::CanData;

/// Bit rates of the adapters \[bit/s\]; the index is the number in the `S` command.
const RATES: [u32; 9] = [10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000];
/// Lengths of a frame; the index is the length code.
const LENGTHS: [usize; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];
/// Maximum length of a line; the rest of a longer line is ignored.
const MAX_LINE: usize = 160;
/// A CAN adapter on a serial line.
#[derive(Debug)]
pub struct Slcan<L> {
    line: L,
    text: Vec<u8>,
    received: VecDeque<(u32, CanData)>,
}

impl<L: Line> Slcan<L> {
    /// Opens the bus with this bit rate.
    ///
    /// # Errors
    /// If the adapters do not support the bit rate, or if the connection is lost.
    pub fn open(mut line: L, bits_per_s: u32) -> io::Result<Self> {
        let rate = RATES.iter().position(|rate| *rate == bits_per_s).ok_or_else(|| {
            let known: Vec<String> = RATES.iter().map(u32::to_string).collect();
            let advice = format!("CAN adapters do not support {bits_per_s} bit/s; give one of {}", known.join(", "));
            io::Error::new(io::ErrorKind::InvalidInput, advice)
        })?;
        // End an incomplete line of another program, and close the bus: the bit rate can only be set on a closed bus.
        line.send(format!("\r\rC\rS{rate}\rO\r").as_bytes())?;
        Ok(Self { line, text: Vec::new(), received: VecDeque::new() })
    }

    /// Returns the serial line.
    pub fn line_mut(&mut self) -> &mut L {
        &mut self.line
    }
}

/// Formats a frame as text; `None` for an invalid identifier or length.
///
/// Frames with more than 8 bytes are CAN FD frames.
fn format_frame(id: u32, data: &[u8]) -> Option<String> {
    let code = LENGTHS.iter().position(|length| *length == data.len()).filter(|_| id <= MAX_EXTENDED_ID)?;
    let letter = match (code > 8, id > MAX_STANDARD_ID) {
        (false, false) => 't',
        (false, true) => 'T',
        (true, false) => 'd',
        (true, true) => 'D',
    };
    let mut text =
        if id > MAX_STANDARD_ID { format!("{letter}{id:08X}{code:X}") } else { format!("{letter}{id:03X}{code:X}") };
    for byte in data {
        text.push_str(&format!("{byte:02X}"));
    }
    text.push('\r');
    Some(text)
}

/// Parses hexadecimal digits; `None` for other characters.
fn number(digits: &str) -> Option<u32> {
    let all = digits.bytes().all(|digit| digit.is_ascii_hexdigit());
    u32::from_str_radix(digits, 16).ok().filter(|_| all)
}

/// Parses a line of text; `None` if it is not a frame.
fn read(text: &[u8]) -> Option<(u32, CanData)> {
    // The answer to an earlier command may precede the frame.
    let text = std::str::from_utf8(text).ok()?.trim_start_matches(['z', 'Z', '\u{7}']);
    let (digits, ids, fd) = match text.chars().next()? {
        't' => (3, 0..=MAX_STANDARD_ID, false),
        'T' => (8, MAX_STANDARD_ID + 1..=MAX_EXTENDED_ID, false),
        'd' | 'b' => (3, 0..=MAX_STANDARD_ID, true),
        'D' | 'B' => (8, MAX_STANDARD_ID + 1..=MAX_EXTENDED_ID, true),
        _ => return None,
    };
    let id = number(text.get(1..=digits)?).filter(|id| ids.contains(id))?;
    let code = number(text.get(digits + 1..digits + 2)?)?;
    let length = *LENGTHS.get(code as usize).filter(|_| fd || code <= 8)?;
    let hex = text.get(digits + 2..)?;
    // Some adapters append a time stamp.
    let byte = |i: usize| Some(number(hex.get(2 * i..2 * i + 2)?)? as u8);
    Some((id, (0..length).map(byte).collect::<Option<CanData>>()?))
}

impl<L: Line> Bus for Slcan<L> {
    fn send(&mut self, id: u32, data: &[u8]) -> io::Result<()> {
        let text = format_frame(id, data).ok_or_else(|| {
            io::Error::new(io::ErrorKind::InvalidInput, "not a CAN frame: identifier above 29 bits, or invalid length")
        })?;
        self.line.send(text.as_bytes())
    }

    fn receive(&mut self, patience: Duration) -> io::Result<Option<(u32, CanData)>> {
        let began = Instant::now();
        let mut bytes = [0; 1024];
        while self.received.is_empty() {
            let left = patience.saturating_sub(began.elapsed());
            let count = self.line.receive(&mut bytes, left)?;
            for byte in &bytes[..count] {
                match byte {
                    b'\r' => {
                        self.received.extend(read(&self.text));
                        self.text.clear();
                    }
                    _ if self.text.len() < MAX_LINE => self.text.push(*byte),
                    _ => {}
                }
            }
            if left.is_zero() {
                break;
            }
        }
        Ok(self.received.pop_front())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn frames_are_written_as_adapters_read_them() {
        assert_eq!(format_frame(0x123, &[0x11, 0xAB]).unwrap(), "t123211AB\r");
        assert_eq!(format_frame(0x1ABCDEF, &[]).unwrap(), "T01ABCDEF0\r");
        let fd = format_frame(0x7ff, &[0xCC; 12]).unwrap();
        assert_eq!(fd, format!("d7FF9{}\r", "CC".repeat(12)));
        assert_eq!(format_frame(1, &[0; 9]), None);
        assert_eq!(format_frame(0x2000_0000, &[]), None);
    }

    #[test]
    fn text_that_is_not_a_frame_is_ignored() {
        let foreign = [&b"T000001230"[..], b"t8000", b"T200000000", b"r1230"];
        let odd =
            [&b""[..], b"z", b"\x07", b"t", b"t12", b"t1239", b"t1232A", b"txyz0", b"t1231+1", b"V1013", b"N\xff"];
        for text in odd.into_iter().chain(foreign) {
            assert_eq!(read(text), None, "{text:?}");
        }
        assert_eq!(read(b"zt12301"), Some((0x123, CanData::new())), "an answer, a frame and a time stamp");
    }

    proptest! {
        #[test]
        fn a_frame_is_read_back_from_its_text(id in 0u32..0x2000_0000, code in 0usize..16, seed: u8) {
            let data: CanData = (0..LENGTHS[code]).map(|i| seed.wrapping_mul(i as u8 + 3)).collect();
            let text = format_frame(id, &data).unwrap();
            prop_assert_eq!(read(text.trim_end().as_bytes()), Some((id, data)));
        }

        #[test]
        fn arbitrary_bytes_do_not_panic(bytes: Vec<u8>) {
            let _ = read(&bytes);
        }
    }
}
