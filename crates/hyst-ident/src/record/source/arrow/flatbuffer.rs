//! Tables of FlatBuffers, the encoding of Arrow messages. Every access is checked: a field outside the buffer is
//! absent.

/// A table inside a buffer.
#[derive(Clone, Copy)]
pub(super) struct Table<'a> {
    buffer: &'a [u8],
    at: usize,
}

/// Returns the bytes of an element at `at`.
fn bytes<const N: usize>(buffer: &[u8], at: usize) -> Option<[u8; N]> {
    buffer.get(at..at.checked_add(N)?)?.try_into().ok()
}

pub(super) fn u32_at(buffer: &[u8], at: usize) -> Option<u32> {
    bytes(buffer, at).map(u32::from_le_bytes)
}

pub(super) fn i64_at(buffer: &[u8], at: usize) -> Option<i64> {
    bytes(buffer, at).map(i64::from_le_bytes)
}

fn u16_at(buffer: &[u8], at: usize) -> Option<u16> {
    bytes(buffer, at).map(u16::from_le_bytes)
}

impl<'a> Table<'a> {
    /// Returns the root table of a buffer.
    pub(super) fn root(buffer: &'a [u8]) -> Option<Self> {
        Some(Self { buffer, at: u32_at(buffer, 0)? as usize })
    }

    /// Returns the place of a field; `None` if the field has its default.
    fn field(&self, number: usize) -> Option<usize> {
        let back = i64::from(u32_at(self.buffer, self.at)?.cast_signed());
        // The list of fields may be before the table or after it.
        let fields = usize::try_from(i64::try_from(self.at).ok()?.checked_sub(back)?).ok()?;
        let entry = 4 + 2 * number;
        if entry + 2 > usize::from(u16_at(self.buffer, fields)?) {
            return None;
        }
        let offset = u16_at(self.buffer, fields.checked_add(entry)?)?;
        (offset != 0).then_some(self.at + usize::from(offset))
    }

    pub(super) fn u8(&self, number: usize, default: u8) -> u8 {
        self.field(number).and_then(|at| self.buffer.get(at).copied()).unwrap_or(default)
    }

    pub(super) fn i16(&self, number: usize, default: i16) -> i16 {
        self.field(number).and_then(|at| u16_at(self.buffer, at)).map_or(default, u16::cast_signed)
    }

    pub(super) fn i32(&self, number: usize, default: i32) -> i32 {
        self.field(number).and_then(|at| u32_at(self.buffer, at)).map_or(default, u32::cast_signed)
    }

    pub(super) fn i64(&self, number: usize, default: i64) -> i64 {
        self.field(number).and_then(|at| i64_at(self.buffer, at)).unwrap_or(default)
    }

    /// Returns the place of the object that a field refers to.
    fn target(&self, number: usize) -> Option<usize> {
        let at = self.field(number)?;
        at.checked_add(u32_at(self.buffer, at)? as usize)
    }

    pub(super) fn table(&self, number: usize) -> Option<Self> {
        Some(Self { buffer: self.buffer, at: self.target(number)? })
    }

    pub(super) fn text(&self, number: usize) -> Option<&'a str> {
        let bytes = self.vector(number, 1)?;
        std::str::from_utf8(bytes).ok()
    }

    /// Returns the bytes of a vector whose elements have `width` bytes.
    pub(super) fn vector(&self, number: usize, width: usize) -> Option<&'a [u8]> {
        let at = self.target(number)?;
        let length = (u32_at(self.buffer, at)? as usize).checked_mul(width)?;
        let start = at.checked_add(4)?;
        self.buffer.get(start..start.checked_add(length)?)
    }

    /// Returns the tables of a vector of tables.
    pub(super) fn tables(&self, number: usize) -> impl Iterator<Item = Self> + use<'a> {
        let buffer = self.buffer;
        let start = self.target(number).map_or(0, |at| at.saturating_add(4));
        let count = self.vector(number, 4).map_or(0, |vector| vector.len() / 4);
        (0..count).filter_map(move |k| {
            let at = start + 4 * k;
            Some(Self { buffer, at: at.checked_add(u32_at(buffer, at)? as usize)? })
        })
    }

    /// Returns the pairs of a vector of keys and values.
    pub(super) fn pairs(&self, number: usize) -> impl Iterator<Item = (&'a str, &'a str)> + use<'a> {
        self.tables(number).filter_map(|pair| Some((pair.text(0)?, pair.text(1)?)))
    }
}
