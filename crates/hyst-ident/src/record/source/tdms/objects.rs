//! Objects of a TDMS file: the file, its groups and their channels, with properties and values.

use std::collections::HashMap;

use super::bytes::Kind;

/// A property of an object.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Property {
    Number(f64),
    Text(String),
    /// A time stamp \[2⁻⁶⁴ s since 1904\].
    Time(i128),
}

/// The place of values in a DAQmx buffer.
#[derive(Clone, Debug)]
pub(crate) struct Scaler {
    pub(crate) kind: Kind,
    pub(crate) buffer: usize,
    /// The byte in a row of the buffer; for a digital line the bit.
    pub(crate) offset: usize,
    pub(crate) id: u32,
    pub(crate) is_digital: bool,
}

/// The raw data of a channel in each chunk of a segment.
#[derive(Clone, Debug)]
pub(crate) struct Index {
    pub(crate) kind: Kind,
    /// Number of values in a chunk.
    pub(crate) count: u64,
    /// Size in a chunk \[bytes\].
    pub(crate) bytes: u64,
    pub(crate) scalers: Vec<Scaler>,
    /// Size of a row in each DAQmx buffer \[bytes\].
    pub(crate) widths: Vec<usize>,
}

/// Values of a channel, before scaling.
#[derive(Clone, Debug, Default)]
pub(crate) enum Values {
    #[default]
    None,
    Numbers(Vec<f64>),
    /// Time stamps \[2⁻⁶⁴ s since 1904\].
    Times(Vec<i128>),
    /// Values of DAQmx scalers, by their numbers.
    Scalers(Vec<(u32, Vec<f64>)>),
}

impl Values {
    pub(crate) fn rows(&self) -> usize {
        match self {
            Self::None => 0,
            Self::Numbers(values) => values.len(),
            Self::Times(values) => values.len(),
            Self::Scalers(scalers) => scalers.first().map_or(0, |(_, values)| values.len()),
        }
    }
}

/// The file, a group or a channel.
#[derive(Clone, Debug, Default)]
pub(crate) struct Object {
    /// Empty for the file.
    pub(crate) group: String,
    /// `None` for the file and for groups.
    pub(crate) channel: Option<String>,
    pub(crate) properties: HashMap<String, Property>,
    pub(crate) values: Values,
    pub(crate) index: Option<Index>,
    /// Start times in later segments, each with the row at which it applies.
    pub(crate) restarts: Vec<(usize, i128)>,
    /// Whether the sample period changes after the first value.
    pub(crate) changes_period: bool,
}

impl Object {
    pub(crate) fn name(&self) -> String {
        self.channel.as_ref().map_or_else(|| self.group.clone(), |channel| format!("{}/{channel}", self.group))
    }

    pub(crate) fn number(&self, property: &str) -> Option<f64> {
        if let Some(Property::Number(number)) = self.properties.get(property) { Some(*number) } else { None }
    }

    pub(crate) fn text(&self, property: &str) -> Option<&str> {
        if let Some(Property::Text(text)) = self.properties.get(property) { Some(text) } else { None }
    }

    pub(crate) fn time(&self, property: &str) -> Option<i128> {
        if let Some(Property::Time(time)) = self.properties.get(property) { Some(*time) } else { None }
    }

    /// Sets a property. The last value in the file applies, except for the start of a waveform, where the first value
    /// applies.
    pub(crate) fn set(&mut self, name: String, value: Property) {
        if self.values.rows() > 0 {
            match (name.as_str(), &value, self.properties.get(&name)) {
                ("wf_start_time", Property::Time(start), Some(_)) => {
                    self.restarts.push((self.values.rows(), *start));
                    return;
                }
                ("wf_start_offset", _, Some(_)) => return,
                ("wf_increment", _, Some(before)) => self.changes_period |= *before != value,
                _ => {}
            }
        }
        self.properties.insert(name, value);
    }
}
