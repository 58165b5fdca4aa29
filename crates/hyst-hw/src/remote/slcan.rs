//! CAN over a serial line: the text protocol of the LAWICEL CANUSB and CAN232 ("slcan"), with the letters for CAN FD that others have
//! added to it.
//!
//! | text | what |
//! |---|---|
//! | `S6\r` | 500 kbit/s (0 … 8: 10, 20, 50, 100, 125, 250, 500, 800, 1000) |
//! | `O\r`, `C\r` | open, close |
//! | `tIIILDD…\r` | frame: identifier of 11 bits, length, data, all hexadecimal |
//! | `TIIIIIIIILDD…\r` | the same with 29 bits |
//! | `dIIILDD…\r`, `DIIIIIIIILDD…\r` | of CAN FD; `b`, `B` at the higher rate |

use std::collections::VecDeque;
use std::io;
use std::time::{Duration, Instant};

use super::Line;
use super::can::{Bus, LARGEST, SHORT};
use crate::wire::CanData;

/// Bits a second that the adapters know, in the order of their numbers.
const RATES: [u32; 9] = [10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000];
/// Lengths of a frame by their code.
const LENGTHS: [usize; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64];
/// Most characters of a line; what is longer is noise.
const LONGEST: usize = 160;
/// An adapter at the end of a serial line.
#[derive(Debug)]
pub struct Slcan<L> {
    line: L,
    text: Vec<u8>,
    came: VecDeque<(u32, CanData)>,
}

impl<L: Line> Slcan<L> {
    /// Opens the bus at so many bits a second.
    ///
    /// # Errors
    /// When the adapters do not know that rate, or the line is gone.
    pub fn open(mut line: L, bits_per_s: u32) -> io::Result<Self> {
        let rate = RATES.iter().position(|rate| *rate == bits_per_s).ok_or_else(|| {
            let known: Vec<String> = RATES.iter().map(u32::to_string).collect();
            let advice = format!("a CAN adapter knows no {bits_per_s} bit/s; it knows {}", known.join(", "));
            io::Error::new(io::ErrorKind::InvalidInput, advice)
        })?;
        // What another program has left of a line is ended, and the bus closed first: an open one takes no rate.
        line.send(format!("\r\rC\rS{rate}\rO\r").as_bytes())?;
        Ok(Self { line, text: Vec::new(), came: VecDeque::new() })
    }

    /// The serial line.
    pub fn line_mut(&mut self) -> &mut L {
        &mut self.line
    }
}

/// A frame as text. Frames of more than 8 bytes are of CAN FD; their lengths are those that it knows.
fn written(id: u32, data: &[u8]) -> Option<String> {
    let code = LENGTHS.iter().position(|length| *length == data.len()).filter(|_| id <= LARGEST)?;
    let letter = match (code > 8, id > SHORT) {
        (false, false) => 't',
        (false, true) => 'T',
        (true, false) => 'd',
        (true, true) => 'D',
    };
    let mut text = if id > SHORT { format!("{letter}{id:08X}{code:X}") } else { format!("{letter}{id:03X}{code:X}") };
    for byte in data {
        text.push_str(&format!("{byte:02X}"));
    }
    text.push('\r');
    Some(text)
}

/// What hexadecimal digits, and nothing but them, stand for.
fn number(digits: &str) -> Option<u32> {
    let all = digits.bytes().all(|digit| digit.is_ascii_hexdigit());
    u32::from_str_radix(digits, 16).ok().filter(|_| all)
}

/// The frame that a line of text holds, if it holds one.
fn read(text: &[u8]) -> Option<(u32, CanData)> {
    // An answer to what was sent before may stand in front.
    let text = std::str::from_utf8(text).ok()?.trim_start_matches(['z', 'Z', '\u{7}']);
    let (digits, ids, fd) = match text.chars().next()? {
        't' => (3, 0..=SHORT, false),
        'T' => (8, SHORT + 1..=LARGEST, false),
        'd' | 'b' => (3, 0..=SHORT, true),
        'D' | 'B' => (8, SHORT + 1..=LARGEST, true),
        _ => return None,
    };
    let id = number(text.get(1..=digits)?).filter(|id| ids.contains(id))?;
    let code = number(text.get(digits + 1..digits + 2)?)?;
    let length = *LENGTHS.get(code as usize).filter(|_| fd || code <= 8)?;
    let hex = text.get(digits + 2..)?;
    // Some adapters add a time.
    let byte = |i: usize| Some(number(hex.get(2 * i..2 * i + 2)?)? as u8);
    Some((id, (0..length).map(byte).collect::<Option<CanData>>()?))
}

impl<L: Line> Bus for Slcan<L> {
    fn send(&mut self, id: u32, data: &[u8]) -> io::Result<()> {
        let text = written(id, data).ok_or_else(|| {
            io::Error::new(io::ErrorKind::InvalidInput, "no CAN frame is of that identifier and length")
        })?;
        self.line.send(text.as_bytes())
    }

    fn receive(&mut self, patience: Duration) -> io::Result<Option<(u32, CanData)>> {
        let began = Instant::now();
        let mut bytes = [0; 1024];
        while self.came.is_empty() {
            let left = patience.saturating_sub(began.elapsed());
            let count = self.line.receive(&mut bytes, left)?;
            for byte in &bytes[..count] {
                match byte {
                    b'\r' => {
                        self.came.extend(read(&self.text));
                        self.text.clear();
                    }
                    _ if self.text.len() < LONGEST => self.text.push(*byte),
                    _ => {}
                }
            }
            if left.is_zero() {
                break;
            }
        }
        Ok(self.came.pop_front())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn frames_are_written_as_adapters_read_them() {
        assert_eq!(written(0x123, &[0x11, 0xAB]).unwrap(), "t123211AB\r");
        assert_eq!(written(0x1ABCDEF, &[]).unwrap(), "T01ABCDEF0\r");
        let fd = written(0x7ff, &[0xCC; 12]).unwrap();
        assert_eq!(fd, format!("d7FF9{}\r", "CC".repeat(12)));
        assert_eq!(written(1, &[0; 9]), None);
        assert_eq!(written(0x2000_0000, &[]), None);
    }

    #[test]
    fn what_is_no_frame_is_passed_over() {
        let foreign = [&b"T000001230"[..], b"t8000", b"T200000000", b"r1230"];
        let odd =
            [&b""[..], b"z", b"\x07", b"t", b"t12", b"t1239", b"t1232A", b"txyz0", b"t1231+1", b"V1013", b"N\xff"];
        for text in odd.into_iter().chain(foreign) {
            assert_eq!(read(text), None, "{text:?}");
        }
        assert_eq!(read(b"zt12301"), Some((0x123, CanData::new())), "an answer, a frame and a time");
    }

    proptest! {
        #[test]
        fn a_frame_comes_back(id in 0u32..0x2000_0000, code in 0usize..16, seed: u8) {
            let data: CanData = (0..LENGTHS[code]).map(|i| seed.wrapping_mul(i as u8 + 3)).collect();
            let text = written(id, &data).unwrap();
            prop_assert_eq!(read(text.trim_end().as_bytes()), Some((id, data)));
        }

        #[test]
        fn whatever_comes_does_no_harm(bytes: Vec<u8>) {
            let _ = read(&bytes);
        }
    }
}
