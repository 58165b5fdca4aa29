//! ROS 2 messages in CDR version 1.

use super::ros2::{Count, Definitions, Field, Kind, Number};
use super::series::Series;

/// Deepest nesting of fields.
const MAX_DEPTH: usize = 32;

impl Definitions {
    /// Reports the numbers of a message.
    ///
    /// # Errors
    /// If the message is shorter than its definition, or in another encoding.
    pub(crate) fn decode(&self, message: &[u8], series: &mut Series) -> Result<(), String> {
        let (head, bytes) = message.split_first_chunk::<4>().ok_or("it is shorter than its encapsulation header")?;
        let is_little = match head[..2] {
            [0, 0] => false,
            [0, 1] => true,
            [high, low] => {
                return Err(format!(
                    "its CDR representation is 0x{high:02x}{low:02x}; only 0x0000 and 0x0001 are supported"
                ));
            }
            _ => false,
        };
        let mut cdr = Cdr { definitions: self, bytes, at: 0, is_little };
        cdr.fields(0, Some(series), MAX_DEPTH)
    }
}

struct Cdr<'a> {
    definitions: &'a Definitions,
    /// The bytes after the encapsulation header. Numbers are aligned relative to their start.
    bytes: &'a [u8],
    at: usize,
    is_little: bool,
}

impl<'a> Cdr<'a> {
    /// Reports the numbers of the fields of a definition, or skips them if `series` is `None`.
    fn fields(&mut self, number: usize, mut series: Option<&mut Series>, depth: usize) -> Result<(), String> {
        let depth = depth.checked_sub(1).ok_or_else(|| format!("its fields are nested more than {MAX_DEPTH} deep"))?;
        let definitions = self.definitions;
        let fields = &definitions.all[number];
        // A message without fields is encoded as one byte.
        if fields.is_empty() {
            return self.skip(1, 1);
        }
        for field in fields {
            let back = series.as_mut().map(|series| series.enter(&field.name));
            self.field(field, series.as_deref_mut(), depth).map_err(|error| in_field(error, &field.name))?;
            if let (Some(series), Some(back)) = (series.as_mut(), back) {
                series.leave(back);
            }
        }
        Ok(())
    }

    fn field(&mut self, field: &Field, mut series: Option<&mut Series>, depth: usize) -> Result<(), String> {
        let count = match field.count {
            Count::One => return self.value(field.kind, series, depth),
            Count::Fixed(count) => count,
            Count::Counted => self.length()?,
        };
        if field.kind != Kind::Text && series.as_mut().is_some_and(|series| !series.array(count)) {
            series = None;
        }
        if let (Kind::Number(number), None) = (field.kind, &series) {
            return self.skip(count, number.size());
        }
        for index in 0..count {
            let back = series.as_mut().map(|series| series.enter_element(index));
            self.value(field.kind, series.as_deref_mut(), depth)?;
            if let (Some(series), Some(back)) = (series.as_mut(), back) {
                series.leave(back);
            }
        }
        Ok(())
    }

    fn value(&mut self, kind: Kind, series: Option<&mut Series>, depth: usize) -> Result<(), String> {
        match kind {
            Kind::Fields(number) => self.fields(number, series, depth),
            Kind::Text => {
                let length = self.length()?;
                self.skip(length, 1)
            }
            Kind::Number(number) => {
                let value = self.number(number)?;
                if let Some(series) = series {
                    series.number(value);
                }
                Ok(())
            }
        }
    }

    fn number(&mut self, number: Number) -> Result<f64, String> {
        Ok(match number {
            Number::I8 => f64::from(i8::from_le_bytes(self.take()?)),
            Number::U8 => f64::from(u8::from_le_bytes(self.take()?)),
            Number::I16 => f64::from(i16::from_le_bytes(self.take()?)),
            Number::U16 => f64::from(u16::from_le_bytes(self.take()?)),
            Number::I32 => f64::from(i32::from_le_bytes(self.take()?)),
            Number::U32 => f64::from(u32::from_le_bytes(self.take()?)),
            Number::I64 => i64::from_le_bytes(self.take()?) as f64,
            Number::U64 => u64::from_le_bytes(self.take()?) as f64,
            Number::F32 => f64::from(f32::from_le_bytes(self.take()?)),
            Number::F64 => f64::from_le_bytes(self.take()?),
        })
    }

    fn length(&mut self) -> Result<usize, String> {
        let length = u32::from_le_bytes(self.take()?);
        usize::try_from(length).map_err(|error| error.to_string())
    }

    /// Reads the bytes of a number, in little-endian order.
    fn take<const SIZE: usize>(&mut self) -> Result<[u8; SIZE], String> {
        let at = self.at.next_multiple_of(SIZE);
        let mut bytes: [u8; SIZE] =
            *self.bytes.get(at..).and_then(|rest| rest.first_chunk()).ok_or_else(|| self.end())?;
        if !self.is_little {
            bytes.reverse();
        }
        self.at = at + SIZE;
        Ok(bytes)
    }

    /// Skips `count` numbers of `size` bytes.
    fn skip(&mut self, count: usize, size: usize) -> Result<(), String> {
        if count == 0 {
            return Ok(());
        }
        let end = count.checked_mul(size).and_then(|length| self.at.next_multiple_of(size).checked_add(length));
        self.at = end.filter(|end| *end <= self.bytes.len()).ok_or_else(|| self.end())?;
        Ok(())
    }

    fn end(&self) -> String {
        format!("it ends after {} bytes", self.bytes.len() + 4)
    }
}

/// Adds the name of the innermost field to an error.
fn in_field(error: String, name: &str) -> String {
    if error.contains("in the field") { error } else { format!("{error}, in the field {name}") }
}
