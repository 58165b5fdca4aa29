//! The workspace in a MATLAB 7.3 file: structs are groups, and cells refer to datasets in the group `#refs#`.

use std::borrow::Cow;
use std::collections::HashMap;

use hdf5_reader::dataset::Dataset;
use hdf5_reader::group::Group;
use hdf5_reader::messages::datatype::Datatype;
use hdf5_reader::reference::read_object_references;

use super::attributes::Attributes;
use super::filters::unreadable;
use super::values;
use crate::record::source::gather::Budget;
use crate::record::source::mat::from_codes;
use crate::record::source::mat::tree::{Array, Structs, Value};

/// Deepest nesting of structs.
const MAX_DEPTH: u32 = 32;
/// Largest number of arrays of a file, including those in cells and structs.
const MAX_ARRAYS: usize = 200_000;
/// The attribute with the class of an array, such as `double`.
const CLASS: [&str; 1] = ["MATLAB_class"];
const OBJECT: &str =
    "is a MATLAB object; save its parts as arrays, for example t = x.Time; y = x.Data; save file.mat t y";

/// Reads the variables of a file.
pub(super) fn variables(root: &Group, budget: &mut Budget) -> Result<Structs<'static>, String> {
    let mut reader = Reader { root, budget, objects: None, left: MAX_ARRAYS };
    let (names, values) = reader.members("", root, MAX_DEPTH)?;
    Ok(Structs { names, elements: vec![values] })
}

/// The target of a reference.
#[derive(Clone)]
enum Object {
    Dataset(Box<Dataset>),
    Group(Group),
}

struct Reader<'r> {
    root: &'r Group,
    budget: &'r mut Budget,
    /// The objects in `#refs#` by address; `None` until they are needed.
    objects: Option<HashMap<u64, Object>>,
    /// Number of further arrays that are allowed.
    left: usize,
}

impl Reader<'_> {
    /// Reads the datasets and groups of a group. Names that begin with # are internal names of MATLAB.
    fn members(&mut self, path: &str, group: &Group, depth: u32) -> Result<(Vec<String>, Vec<Array<'static>>), String> {
        let depth = depth
            .checked_sub(1)
            .ok_or_else(|| format!("structs are nested more than {MAX_DEPTH} deep; save only the signals"))?;
        let (groups, datasets) = group.member_names().map_err(|error| unreadable(path, &error))?;
        let (mut names, mut values) = (Vec::new(), Vec::new());
        let below = |name: &str| if path.is_empty() { name.to_owned() } else { format!("{path}.{name}") };
        for name in datasets.into_iter().filter(|name| !name.starts_with('#')) {
            let path = below(&name);
            let dataset = group.dataset(&name).map_err(|error| unreadable(&path, &error))?;
            values.push(self.dataset(&path, &dataset, depth)?);
            names.push(name);
        }
        for name in groups.into_iter().filter(|name| !name.starts_with('#')) {
            let path = below(&name);
            let inner = group.group(&name).map_err(|error| unreadable(&path, &error))?;
            values.push(self.group(&path, &inner, depth)?);
            names.push(name);
        }
        Ok((names, values))
    }

    fn claim(&mut self) -> Result<(), String> {
        self.left =
            self.left.checked_sub(1).ok_or_else(|| format!("more than {MAX_ARRAYS} arrays; save only the signals"))?;
        Ok(())
    }

    /// Reads a struct or an array of structs. In an array of structs each field is a dataset of references.
    fn group(&mut self, path: &str, group: &Group, depth: u32) -> Result<Array<'static>, String> {
        self.claim()?;
        let attributes = Attributes::of_group(group);
        if attributes.get("MATLAB_sparse").is_some() {
            return Ok(Array::unread("is sparse; save full(…) of it"));
        }
        if attributes.text(&CLASS).is_some_and(|class| class != "struct") {
            return Ok(Array::unread(OBJECT));
        }
        let (names, values) = self.members(path, group, depth)?;
        let lengths: Option<Vec<usize>> = values
            .iter()
            .map(|value| match &value.value {
                Value::Structs(inner) if inner.names.is_empty() => Some(inner.elements.len()),
                _ => None,
            })
            .collect();
        let count = match lengths.as_deref() {
            Some([first, rest @ ..]) if rest.iter().all(|length| length == first) => *first,
            _ => {
                return Ok(Array {
                    dims: vec![1, 1],
                    value: Value::Structs(Structs { names, elements: vec![values] }),
                });
            }
        };
        let mut elements: Vec<Vec<Array<'static>>> = vec![Vec::new(); count];
        for value in values {
            if let Value::Structs(inner) = value.value {
                for (element, field) in elements.iter_mut().zip(inner.elements) {
                    element.extend(field);
                }
            }
        }
        Ok(Array { dims: vec![1, count], value: Value::Structs(Structs { names, elements }) })
    }

    fn dataset(&mut self, path: &str, dataset: &Dataset, depth: u32) -> Result<Array<'static>, String> {
        self.claim()?;
        let attributes = Attributes::of_dataset(dataset);
        let class = attributes.text(&CLASS);
        let class = class.as_deref();
        if attributes.get("MATLAB_object_decode").is_some() {
            return Ok(Array::unread(OBJECT));
        }
        // MATLAB stores arrays column by column, so the dimensions are reversed.
        let mut dims = values::dims(dataset).unwrap_or_default();
        dims.reverse();
        while dims.len() < 2 {
            dims.push(1);
        }
        if attributes.number("MATLAB_empty").is_some_and(|empty| empty != 0.0) {
            return Ok(Array { dims: vec![0, 0], value: Value::empty() });
        }
        if matches!(dataset.dtype(), Datatype::Reference { .. }) {
            return self.references(path, dataset, dims, class == Some("cell"), depth);
        }
        let Some(storage) = values::storage(dataset.dtype()) else {
            let value = match dataset.dtype() {
                Datatype::Compound { .. } => Value::Unread("is complex; save real(…) or abs(…) of it".to_owned()),
                _ => Value::Text(values::texts(dataset, self.budget).unwrap_or_default()),
            };
            return Ok(Array { dims, value });
        };
        let bytes = values::bytes(path, dataset, 1, self.budget)?;
        if class == Some("char") {
            let codes: Vec<u16> = storage.all(&bytes).into_iter().map(|code| code as u16).collect();
            return Ok(Array { value: Value::Text(from_codes(&codes, dims[0])), dims });
        }
        Ok(Array { dims, value: Value::Numbers { bytes: Cow::Owned(bytes), storage } })
    }

    /// Reads cells, or one field of an array of structs. The structs then have no names.
    fn references(
        &mut self,
        path: &str,
        dataset: &Dataset,
        dims: Vec<usize>,
        is_cell: bool,
        depth: u32,
    ) -> Result<Array<'static>, String> {
        let depth = depth
            .checked_sub(1)
            .ok_or_else(|| format!("cells are nested more than {MAX_DEPTH} deep; save only the signals"))?;
        let bytes = values::bytes(path, dataset, 1, self.budget)?;
        let addresses = read_object_references(&bytes, 8).map_err(|error| unreadable(path, &error))?;
        let mut values = Vec::new();
        for address in addresses {
            values.push(match self.object(address)? {
                Some(Object::Dataset(dataset)) => self.dataset(path, &dataset, depth)?,
                Some(Object::Group(group)) => self.group(path, &group, depth)?,
                None => {
                    self.claim()?;
                    Array::unread("has an invalid reference")
                }
            });
        }
        let value = if is_cell {
            Value::Cells(values)
        } else {
            Value::Structs(Structs {
                names: Vec::new(),
                elements: values.into_iter().map(|value| vec![value]).collect(),
            })
        };
        Ok(Array { dims, value })
    }

    fn object(&mut self, address: u64) -> Result<Option<Object>, String> {
        if self.objects.is_none() {
            let mut objects = HashMap::new();
            if let Ok(group) = self.root.group("#refs#") {
                let (groups, datasets) = group.member_names().map_err(|error| unreadable("#refs#", &error))?;
                for name in datasets.iter().chain(&groups).take(MAX_ARRAYS) {
                    if let Ok(dataset) = group.dataset(name) {
                        objects.insert(dataset.address(), Object::Dataset(Box::new(dataset)));
                    } else if let Ok(inner) = group.group(name) {
                        objects.insert(inner.address(), Object::Group(inner));
                    }
                }
            }
            self.objects = Some(objects);
        }
        Ok(self.objects.as_ref().and_then(|objects| objects.get(&address)).cloned())
    }
}
