//! Selection of the decoder for the messages of a schema.

use std::collections::HashMap;

use super::series::Series;
use super::{json, json_units, protobuf, ros2};

/// A schema of the file.
#[derive(Clone, Debug, Default)]
pub(crate) struct Schema {
    pub(crate) name: String,
    pub(crate) encoding: String,
    pub(crate) data: Vec<u8>,
}

/// A decoder of messages.
#[derive(Debug)]
pub(crate) enum Decoder {
    /// JSON, with the units of the fields.
    Json(HashMap<String, String>),
    Ros2(ros2::Definitions),
    Protobuf(protobuf::Kind),
}

impl Decoder {
    /// Makes the decoder for messages with `encoding` and `schema`.
    ///
    /// # Errors
    /// The reason, if the encoding or the schema is not supported.
    pub(crate) fn new(encoding: &str, schema: Option<&Schema>) -> Result<Self, String> {
        let of = schema.map_or("", |schema| schema.encoding.as_str());
        match (encoding, of, schema) {
            ("json", "jsonschema", Some(schema)) => Ok(Self::Json(json_units::units(&schema.data))),
            ("json", ..) => Ok(Self::Json(HashMap::new())),
            ("cdr", "ros2msg", Some(schema)) => ros2::Definitions::parse(&schema.name, &schema.data).map(Self::Ros2),
            ("protobuf", "protobuf", Some(schema)) => {
                protobuf::Kind::parse(&schema.name, &schema.data).map(Self::Protobuf)
            }
            ("cdr" | "protobuf", _, None) => Err(format!("its schema is missing, which is needed to read {encoding}")),
            ("cdr" | "protobuf", ..) => Err(format!("its schema is in {of:?}, which is not supported")),
            _ => Err(format!("its messages are in {encoding:?}, which is not supported")),
        }
    }

    /// Returns the name of the encoding.
    pub(crate) fn words(&self) -> &'static str {
        match self {
            Self::Json(_) => "JSON",
            Self::Ros2(_) => "ROS 2",
            Self::Protobuf(_) => "Protobuf",
        }
    }

    /// Reports the numbers of a message.
    ///
    /// # Errors
    /// The reason, if the message is damaged.
    pub(crate) fn decode(&self, message: &[u8], series: &mut Series) -> Result<(), String> {
        match self {
            Self::Json(_) => json::decode(message, series),
            Self::Ros2(definitions) => definitions.decode(message, series),
            Self::Protobuf(kind) => kind.decode(message, series),
        }
    }

    /// Returns the units that the schema states, by path, with `[]` for an index.
    pub(crate) fn units(&self) -> HashMap<String, String> {
        match self {
            Self::Json(units) => units.clone(),
            Self::Ros2(definitions) => definitions.units(),
            // The schema does not contain the comments, which may state units.
            Self::Protobuf(_) => HashMap::new(),
        }
    }
}
