//! Protobuf messages. Their descriptors are in the schema.

use std::fmt::Display;
use std::panic::{AssertUnwindSafe, catch_unwind};

use prost_reflect::prost::Message;
use prost_reflect::prost_types::{FileDescriptorProto, FileDescriptorSet};
use prost_reflect::{DescriptorPool, DynamicMessage, MessageDescriptor, ReflectMessage, Value};

use super::series::Series;

/// Largest message \[bytes\]. Decoded, it takes about fifty times its size. Larger messages are images and point
/// clouds.
const MAX_MESSAGE: usize = 1 << 20;
/// Supported versions of the schema language. No name means proto2.
const SYNTAXES: [&str; 3] = ["", "proto2", "proto3"];
/// Deepest nesting of fields.
const MAX_DEPTH: usize = 32;

/// The message type of a schema.
#[derive(Clone, Debug)]
pub(crate) struct Kind(MessageDescriptor);

impl Kind {
    /// Parses a schema. `name` is the name of the message type, such as `lab.Sample`.
    ///
    /// # Errors
    /// If the descriptors are damaged or do not contain the message type.
    pub(crate) fn parse(name: &str, schema: &[u8]) -> Result<Self, String> {
        let damaged = |error: &dyn Display| format!("its schema is damaged ({error})");
        let set = FileDescriptorSet::decode(schema).map_err(|error| damaged(&error))?;
        // The crate panics at any other syntax, including editions.
        if let Some(other) = set.file.iter().map(FileDescriptorProto::syntax).find(|syntax| !SYNTAXES.contains(syntax))
        {
            let other = super::words::shortened(other);
            return Err(format!(
                "its schema is in the Protobuf syntax {other:?}; only proto2 and proto3 are supported"
            ));
        }
        let pool = without_panic(|| DescriptorPool::from_file_descriptor_set(set).map_err(|error| damaged(&error)))?;
        let kind = pool.get_message_by_name(name.trim_start_matches('.'));
        kind.map(Self).ok_or_else(|| format!("its schema does not define {:?}", super::words::shortened(name)))
    }

    /// Reports the numbers of a message.
    ///
    /// # Errors
    /// If the message is damaged, or too large.
    pub(crate) fn decode(&self, message: &[u8], series: &mut Series) -> Result<(), String> {
        if message.len() > MAX_MESSAGE {
            return Err(format!("it has {} bytes; the limit is {MAX_MESSAGE} bytes", message.len()));
        }
        without_panic(|| {
            let message = DynamicMessage::decode(self.0.clone(), message).map_err(|error| error.to_string())?;
            report(&message, series, MAX_DEPTH);
            Ok(())
        })
    }
}

/// Calls the Protobuf crate and converts a panic to an error, because the crate may panic on damaged data.
fn without_panic<T>(call: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    catch_unwind(AssertUnwindSafe(call)).unwrap_or_else(|_| Err("it is damaged".to_owned()))
}

fn report(message: &DynamicMessage, series: &mut Series, depth: usize) {
    let Some(depth) = depth.checked_sub(1) else { return };
    for field in message.descriptor().fields() {
        // A number that is not in the message is 0, unless the field has presence.
        if field.supports_presence() && !message.has_field(&field) {
            continue;
        }
        let back = series.enter(field.name());
        report_value(&message.get_field(&field), series, depth);
        series.leave(back);
    }
}

fn report_value(value: &Value, series: &mut Series, depth: usize) {
    match value {
        Value::Bool(value) => series.number(f64::from(u8::from(*value))),
        Value::I32(value) | Value::EnumNumber(value) => series.number(f64::from(*value)),
        Value::U32(value) => series.number(f64::from(*value)),
        Value::I64(value) => series.number(*value as f64),
        Value::U64(value) => series.number(*value as f64),
        Value::F32(value) => series.number(f64::from(*value)),
        Value::F64(value) => series.number(*value),
        Value::Message(message) => report(message, series, depth),
        Value::List(values) => {
            if !matches!(values.first(), Some(Value::String(_) | Value::Bytes(_))) && series.array(values.len()) {
                for (index, value) in values.iter().enumerate() {
                    let back = series.enter_element(index);
                    report_value(value, series, depth);
                    series.leave(back);
                }
            }
        }
        Value::String(_) | Value::Bytes(_) | Value::Map(_) => {}
    }
}
