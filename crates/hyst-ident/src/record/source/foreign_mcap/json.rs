//! The numbers of a JSON message.

use std::fmt;

use serde::de::{DeserializeSeed, Deserializer, Error, IgnoredAny, MapAccess, SeqAccess, Visitor};

use super::series::Series;

/// Reports the numbers of a message. The parser limits the nesting.
///
/// # Errors
/// If the message is not valid JSON.
pub(crate) fn decode(message: &[u8], series: &mut Series) -> Result<(), String> {
    let Err(error) = parse(message, series) else { return Ok(()) };
    // Python and other languages write NaN, which is not valid JSON.
    if let Some(message) = without_nan(message) {
        series.discard();
        series.begin();
        if parse(&message, series).is_ok() {
            return Ok(());
        }
    }
    Err(format!("not valid JSON: {error}"))
}

fn parse(message: &[u8], series: &mut Series) -> Result<(), serde_json::Error> {
    let mut parser = serde_json::Deserializer::from_slice(message);
    Value(series).deserialize(&mut parser)?;
    parser.end()
}

/// A value of any kind at the path of the series. No tree is built, because a tree of many small values needs far more
/// memory than the message.
struct Value<'a>(&'a mut Series);

impl<'de> DeserializeSeed<'de> for Value<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, from: D) -> Result<(), D::Error> {
        from.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for Value<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a value")
    }

    fn visit_bool<E: Error>(self, value: bool) -> Result<(), E> {
        self.0.number(f64::from(u8::from(value)));
        Ok(())
    }

    fn visit_i64<E: Error>(self, value: i64) -> Result<(), E> {
        self.0.number(value as f64);
        Ok(())
    }

    fn visit_u64<E: Error>(self, value: u64) -> Result<(), E> {
        self.0.number(value as f64);
        Ok(())
    }

    fn visit_f64<E: Error>(self, value: f64) -> Result<(), E> {
        self.0.number(value);
        Ok(())
    }

    fn visit_str<E: Error>(self, _: &str) -> Result<(), E> {
        Ok(())
    }

    /// A null has no number.
    fn visit_unit<E: Error>(self) -> Result<(), E> {
        Ok(())
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        let series = self.0;
        while let Some(back) = map.next_key_seed(Key(&mut *series))? {
            map.next_value_seed(Value(&mut *series))?;
            series.leave(back);
        }
        Ok(())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut elements: A) -> Result<(), A::Error> {
        let (series, mut length) = (self.0, 0);
        let wanted = series.wanted_elements();
        loop {
            let more = if length < wanted {
                let back = series.enter_element(length);
                let more = elements.next_element_seed(Value(&mut *series))?.is_some();
                series.leave(back);
                more
            } else {
                elements.next_element::<IgnoredAny>()?.is_some()
            };
            if !more {
                break;
            }
            length += 1;
        }
        series.array(length);
        Ok(())
    }
}

/// A key. The series enters its field.
struct Key<'a>(&'a mut Series);

impl<'de> DeserializeSeed<'de> for Key<'_> {
    type Value = usize;

    fn deserialize<D: Deserializer<'de>>(self, from: D) -> Result<usize, D::Error> {
        from.deserialize_str(self)
    }
}

impl Visitor<'_> for Key<'_> {
    type Value = usize;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a key")
    }

    fn visit_str<E: Error>(self, key: &str) -> Result<usize, E> {
        Ok(self.0.enter(key))
    }
}

/// Returns the message with null for NaN and infinities; `None` if it has neither.
fn without_nan(message: &[u8]) -> Option<Vec<u8>> {
    let mut changed = Vec::with_capacity(message.len());
    let (mut rest, mut in_text, mut found) = (message, false, false);
    while let Some((byte, after)) = rest.split_first() {
        let word =
            [b"-Infinity".as_slice(), b"Infinity", b"NaN"].into_iter().find(|word| !in_text && rest.starts_with(word));
        if let Some(word) = word {
            changed.extend(b"null");
            (rest, found) = (&rest[word.len()..], true);
            continue;
        }
        // A character after a backslash does not end a text.
        let taken = if in_text && *byte == b'\\' { 2.min(rest.len()) } else { 1 };
        in_text ^= *byte == b'"';
        changed.extend(&rest[..taken]);
        rest = if taken == 1 { after } else { &rest[taken..] };
    }
    found.then_some(changed)
}
