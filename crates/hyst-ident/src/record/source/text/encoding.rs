//! Decoding of text: UTF-8, UTF-16 and Latin-1.

use std::borrow::Cow;

use crate::record::error::RecordError;

/// Decodes the text of a file. Returns a note if the file is read as Latin-1.
pub(super) fn decode<'a>(file: &str, bytes: &'a [u8]) -> Result<(Cow<'a, str>, Option<String>), RecordError> {
    if let Some(rest) = bytes.strip_prefix(b"\xff\xfe") {
        return Ok((utf16(rest, u16::from_le_bytes), None));
    }
    if let Some(rest) = bytes.strip_prefix(b"\xfe\xff") {
        return Ok((utf16(rest, u16::from_be_bytes), None));
    }
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    match zeros(bytes) {
        Zeros::None => {}
        Zeros::Odd => return Ok((utf16(bytes, u16::from_le_bytes), None)),
        Zeros::Even => return Ok((utf16(bytes, u16::from_be_bytes), None)),
        Zeros::Anywhere => return Err(RecordError::UnknownFormat { file: file.to_owned() }),
    }
    match std::str::from_utf8(bytes) {
        Ok(text) => Ok((line_ends(Cow::Borrowed(text)), None)),
        Err(error) => {
            let is_control = |byte: &u8| byte.is_ascii_control() && !byte.is_ascii_whitespace() && *byte != 0x1a;
            if bytes.iter().take(4096).any(is_control) {
                return Err(RecordError::UnknownFormat { file: file.to_owned() });
            }
            let line = 1 + bytes[..error.valid_up_to()].iter().filter(|byte| **byte == b'\n').count();
            let text: String = bytes.iter().map(|byte| char::from(*byte)).collect();
            Ok((line_ends(Cow::Owned(text)), Some(format!("line {line} is not UTF-8; the file is read as Latin-1"))))
        }
    }
}

fn utf16<'a>(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Cow<'a, str> {
    let units = bytes.chunks_exact(2).map(|pair| unit([pair[0], pair[1]]));
    let text: String = char::decode_utf16(units).map(|c| c.unwrap_or(char::REPLACEMENT_CHARACTER)).collect();
    line_ends(Cow::Owned(text))
}

/// The places of zeros in the first bytes. In UTF-16 text every other byte is zero.
enum Zeros {
    None,
    Odd,
    Even,
    Anywhere,
}

fn zeros(bytes: &[u8]) -> Zeros {
    let beginning = &bytes[..bytes.len().min(4096)];
    let at = |odd: usize| beginning.iter().skip(odd).step_by(2).filter(|byte| **byte == 0).count();
    let half = beginning.len() / 2;
    match (at(0), at(1)) {
        (0, 0) => Zeros::None,
        (0, odd) if 2 * odd > half => Zeros::Odd,
        (even, 0) if 2 * even > half => Zeros::Even,
        _ => Zeros::Anywhere,
    }
}

/// Replaces line ends `\r` by `\n`, unless the text has line ends `\n` or `\r\n`.
fn line_ends(text: Cow<'_, str>) -> Cow<'_, str> {
    if text.contains('\r') && !text.contains('\n') { Cow::Owned(text.replace('\r', "\n")) } else { text }
}
