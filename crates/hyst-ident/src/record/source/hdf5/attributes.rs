//! Attributes of datasets and groups.

use hdf5_reader::attribute_api::Attribute;
use hdf5_reader::dataset::Dataset;
use hdf5_reader::group::Group;

use super::values;

/// Longest list of texts in an attribute. Longer lists are data.
const MAX_TEXTS: u64 = 100_000;

/// The attributes of one object.
pub(super) struct Attributes(Vec<Attribute>);

impl Attributes {
    pub(super) fn of_dataset(dataset: &Dataset) -> Self {
        Self(dataset.attributes())
    }

    /// Returns the attributes of a group; empty if they are damaged, because they are not essential.
    pub(super) fn of_group(group: &Group) -> Self {
        Self(group.attributes().unwrap_or_default())
    }

    pub(super) fn get(&self, name: &str) -> Option<&Attribute> {
        self.0.iter().find(|attribute| attribute.name == name)
    }

    /// Returns the texts of the first attribute with one of these names (ignoring case) that has texts.
    pub(super) fn texts(&self, names: &[&str]) -> Option<Vec<String>> {
        names.iter().find_map(|name| self.0.iter().filter(|a| a.name.eq_ignore_ascii_case(name)).find_map(texts))
    }

    /// Returns the text of the first such attribute, if it has one text.
    pub(super) fn text(&self, names: &[&str]) -> Option<String> {
        self.texts(names)
            .and_then(|texts| <[String; 1]>::try_from(texts).ok())
            .map(|[text]| text)
            .filter(|text| !text.is_empty())
    }

    /// Returns the number of an attribute.
    pub(super) fn number(&self, name: &str) -> Option<f64> {
        self.get(name).and_then(number)
    }

    /// Returns all attributes that are one number.
    pub(super) fn numbers(&self) -> impl Iterator<Item = (&str, f64)> {
        self.0.iter().filter_map(|attribute| Some((attribute.name.as_str(), number(attribute)?)))
    }
}

fn number(attribute: &Attribute) -> Option<f64> {
    let storage = values::storage(&attribute.datatype)?;
    if attribute.num_elements().ok()? != 1 {
        return None;
    }
    storage.all(&attribute.raw_data).first().copied()
}

fn texts(attribute: &Attribute) -> Option<Vec<String>> {
    let count = attribute.num_elements().ok().filter(|count| *count <= MAX_TEXTS)?;
    let texts = if count == 1 { attribute.read_string().ok().map(|text| vec![text]) } else { None };
    let texts = texts.or_else(|| attribute.read_strings().ok())?;
    Some(texts.iter().map(|text| text.trim_matches(['\0', ' ', '\n', '\t']).to_owned()).collect())
}
