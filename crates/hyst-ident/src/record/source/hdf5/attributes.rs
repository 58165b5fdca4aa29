//! Attributes of datasets and groups.

use hdf5_reader::attribute_api::Attribute;
use hdf5_reader::dataset::Dataset;
use hdf5_reader::group::Group;

use super::values;

/// Lists and numbers in attributes are short; what is longer is data.
const MOST_TEXTS: u64 = 100_000;

/// The attributes of one object.
pub(super) struct Attributes(Vec<Attribute>);

impl Attributes {
    pub(super) fn of_dataset(dataset: &Dataset) -> Self {
        Self(dataset.attributes())
    }

    /// Those of a group; none where they are damaged, for the data can do without.
    pub(super) fn of_group(group: &Group) -> Self {
        Self(group.attributes().unwrap_or_default())
    }

    pub(super) fn get(&self, name: &str) -> Option<&Attribute> {
        self.0.iter().find(|attribute| attribute.name == name)
    }

    /// Texts of the first attribute with one of these names, whatever the case, that has texts.
    pub(super) fn texts(&self, names: &[&str]) -> Option<Vec<String>> {
        names.iter().find_map(|name| self.0.iter().filter(|a| a.name.eq_ignore_ascii_case(name)).find_map(texts))
    }

    /// The same, where it is one text.
    pub(super) fn text(&self, names: &[&str]) -> Option<String> {
        self.texts(names)
            .and_then(|texts| <[String; 1]>::try_from(texts).ok())
            .map(|[text]| text)
            .filter(|text| !text.is_empty())
    }

    /// The number of an attribute.
    pub(super) fn number(&self, name: &str) -> Option<f64> {
        self.get(name).and_then(number)
    }

    /// All attributes that are one number.
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
    let count = attribute.num_elements().ok().filter(|count| *count <= MOST_TEXTS)?;
    let texts = if count == 1 { attribute.read_string().ok().map(|text| vec![text]) } else { None };
    let texts = texts.or_else(|| attribute.read_strings().ok())?;
    Some(texts.iter().map(|text| text.trim_matches(['\0', ' ', '\n', '\t']).to_owned()).collect())
}
