//! The tree of a MATLAB workspace: arrays of numbers, texts, cells and structs.

use std::borrow::Cow;

use crate::record::source::elements::{Kind, Storage};

/// An array, stored column by column.
#[derive(Clone, Debug)]
pub(crate) struct Array<'a> {
    /// Rows, columns and further dimensions.
    pub(crate) dims: Vec<usize>,
    pub(crate) value: Value<'a>,
}

/// The value of an array.
#[derive(Clone, Debug)]
pub(crate) enum Value<'a> {
    Numbers {
        bytes: Cow<'a, [u8]>,
        storage: Storage,
    },
    /// Rows of characters.
    Text(Vec<String>),
    Cells(Vec<Array<'a>>),
    Structs(Structs<'a>),
    /// The reason why the array is not read.
    Unread(String),
}

/// A struct or an array of structs.
#[derive(Clone, Debug, Default)]
pub(crate) struct Structs<'a> {
    pub(crate) names: Vec<String>,
    /// The structs. Each has one value per field, in the order of the names.
    pub(crate) elements: Vec<Vec<Array<'a>>>,
}

/// One struct.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fields<'t, 'a> {
    pub(crate) names: &'t [String],
    pub(crate) values: &'t [Array<'a>],
}

impl Value<'_> {
    /// Makes an empty array of numbers.
    pub(crate) fn empty() -> Self {
        let storage = Storage { kind: Kind::F64, big_endian: false };
        Self::Numbers { bytes: Cow::Borrowed(&[]), storage }
    }
}

impl<'a> Structs<'a> {
    /// Returns the structs.
    pub(crate) fn iter(&self) -> impl Iterator<Item = Fields<'_, 'a>> {
        self.elements.iter().map(|values| Fields { names: &self.names, values })
    }
}

impl<'t, 'a> Fields<'t, 'a> {
    /// Returns the fields with their names.
    pub(crate) fn iter(self) -> impl Iterator<Item = (&'t str, &'t Array<'a>)> {
        self.names.iter().map(String::as_str).zip(self.values)
    }

    /// Finds the first field with one of these names, ignoring case. Returns its number and value.
    pub(crate) fn get(self, names: &[&str]) -> Option<(usize, &'t Array<'a>)> {
        names.iter().find_map(|wanted| {
            let at = self.names.iter().position(|name| name.eq_ignore_ascii_case(wanted))?;
            Some((at, self.values.get(at)?))
        })
    }

    /// Returns the text of the first field with one of these names and one line of text.
    pub(crate) fn text(self, names: &[&str]) -> Option<&'t str> {
        names.iter().find_map(|name| self.get(&[name])?.1.text())
    }
}

impl<'a> Array<'a> {
    pub(crate) fn unread(why: impl Into<String>) -> Self {
        Self { dims: Vec::new(), value: Value::Unread(why.into()) }
    }

    /// Returns a text of one line that is not blank. It may be the only cell of a cell array.
    pub(crate) fn text(&self) -> Option<&str> {
        match &self.value {
            Value::Text(lines) => match lines.as_slice() {
                [line] => Some(line.trim()).filter(|line| !line.is_empty()),
                _ => None,
            },
            Value::Cells(cells) => match cells.as_slice() {
                [only] if matches!(only.value, Value::Text(_)) => only.text(),
                _ => None,
            },
            _ => None,
        }
    }

    /// Returns several texts: a cell array of texts, or rows of characters.
    pub(crate) fn texts(&self) -> Option<Vec<String>> {
        let texts: Vec<String> = match &self.value {
            Value::Text(lines) => lines.iter().map(|line| line.trim().to_owned()).collect(),
            Value::Cells(cells) => cells
                .iter()
                .map(|cell| match &cell.value {
                    Value::Text(lines) if lines.len() <= 1 => Some(cell.text().unwrap_or_default().to_owned()),
                    _ => None,
                })
                .collect::<Option<_>>()?,
            _ => return None,
        };
        (texts.len() > 1).then_some(texts)
    }

    /// Returns the number of elements.
    pub(crate) fn count(&self) -> Option<usize> {
        count(&self.dims)
    }

    /// Returns the number of an array with one element.
    pub(crate) fn scalar(&self) -> Option<f64> {
        match &self.value {
            Value::Numbers { bytes, storage } if self.count() == Some(1) => storage.all(bytes).first().copied(),
            _ => None,
        }
    }

    /// Returns whether this is an array of at least two numbers.
    pub(crate) fn is_numbers(&self) -> bool {
        matches!(self.value, Value::Numbers { .. }) && self.count().is_some_and(|count| count > 1)
    }

    pub(crate) fn structs(&self) -> Option<&Structs<'a>> {
        match &self.value {
            Value::Structs(structs) => Some(structs),
            _ => None,
        }
    }
}

/// Returns the product of dimensions; `None` if it overflows.
pub(crate) fn count(dims: &[usize]) -> Option<usize> {
    dims.iter().try_fold(1_usize, |product, dim| product.checked_mul(*dim))
}
