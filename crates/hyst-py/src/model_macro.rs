//! Generates the Python class of a model from one entry of the table in `models/`.

use numpy::PyArray1;
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::List;

/// A parameter of a model in Python.
pub(crate) trait Parameter {
    /// Returns the value of the property: a number, or a new array.
    fn to_python(&self, py: Python<'_>) -> PyResult<Py<PyAny>>;
    /// Returns the text in `repr`.
    fn text(&self) -> String;
    /// Returns bits that are equal for equal values only.
    fn bits(&self) -> Vec<u64>;
}

macro_rules! plain_parameters {
    ($($type:ty: $bits:expr,)*) => { $(
        impl Parameter for $type {
            fn to_python(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
                self.into_py_any(py)
            }
            fn text(&self) -> String {
                format!("{self:?}")
            }
            fn bits(&self) -> Vec<u64> {
                let bits: fn(&$type) -> Vec<u64> = $bits;
                bits(self)
            }
        }
    )* };
}
plain_parameters! {
    f64: |x| vec![x.to_bits()],
    u16: |x| vec![u64::from(*x)],
    usize: |x| vec![*x as u64],
    String: |x| x.bytes().map(u64::from).collect(),
}

impl Parameter for bool {
    fn to_python(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.into_py_any(py)
    }
    fn text(&self) -> String {
        if *self { "True" } else { "False" }.to_owned()
    }
    fn bits(&self) -> Vec<u64> {
        vec![u64::from(*self)]
    }
}

impl Parameter for List {
    fn to_python(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        PyArray1::from_slice(py, &self.0).into_py_any(py)
    }
    fn text(&self) -> String {
        match self.0.as_slice() {
            [a, b, c, .., z] if self.0.len() > 10 => format!("[{a:?}, {b:?}, {c:?}, ..., {z:?}]"),
            all => format!("{all:?}"),
        }
    }
    fn bits(&self) -> Vec<u64> {
        self.0.iter().map(|x| x.to_bits()).collect()
    }
}

impl<P: Parameter> Parameter for Option<P> {
    fn to_python(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.as_ref().map_or_else(|| Ok(py.None()), |p| p.to_python(py))
    }
    fn text(&self) -> String {
        self.as_ref().map_or_else(|| "None".to_owned(), Parameter::text)
    }
    fn bits(&self) -> Vec<u64> {
        // None must differ from an empty list.
        self.as_ref().map_or_else(|| vec![u64::MAX, 0], |p| [vec![1], p.bits()].concat())
    }
}

/// Returns `Name(first=1.0, second=[2.0])`.
pub(crate) fn repr(name: &str, parameters: &[(&str, &dyn Parameter)]) -> String {
    let list: Vec<String> = parameters.iter().map(|(name, value)| format!("{name}={}", value.text())).collect();
    format!("{name}({})", list.join(", "))
}

/// Returns the arguments from which `pickle` and `copy` build the object: its parameters, without the history.
pub(crate) fn arguments<'py>(
    py: Python<'py>,
    parameters: &[(&str, &dyn Parameter)],
) -> PyResult<((), Bound<'py, PyDict>)> {
    let keywords = PyDict::new(py);
    for (name, value) in parameters {
        keywords.set_item(name, value.to_python(py)?)?;
    }
    Ok(((), keywords))
}

/// Generates the Python classes of models, and `add_to`, which adds them to a module. Each entry has the keywords of
/// the class (with documentation and defaults), the parameters of the core, the stage that is built from them (at a
/// sample period, if there is one), the method of inversion (`inversion.rs`) and the quantities of the environment that
/// it needs.
macro_rules! models {
    ($(
        $(#[$doc:meta])*
        class $name:ident {
            $( $(#[$field_doc:meta])* $field:ident : $type:ty $(= $default:tt)?, )*
        }
        params: $params:expr,
        stage: $stage:ty,
        $(period: $period:expr,)?
        inverse: $inverse:expr,
        needs: [$($need:ident),*],
    )*) => {
        $(
            $(#[$doc])*
            #[pyo3::pyclass(extends = $crate::operator::Operator, frozen, module = "hyst")]
            #[derive(Clone)]
            struct $name {
                $($field: $type,)*
            }

            impl $name {
                fn list(&self) -> Vec<(&'static str, &dyn $crate::model_macro::Parameter)> {
                    vec![$((stringify!($field), &self.$field as &dyn $crate::model_macro::Parameter)),*]
                }
            }

            #[pyo3::pymethods]
            impl $name {
                #[new]
                #[pyo3(signature = (*, $($field $(= $default)?),*))]
                #[allow(clippy::too_many_arguments, reason = "keywords of one call")]
                fn new($($field: $type),*) -> pyo3::PyResult<pyo3::PyClassInitializer<Self>> {
                    let given = Self { $($field),* };
                    let needs = $crate::arrays::Needs { $($need: true,)* ..Default::default() };
                    let periods: &[fn(&Self) -> f64] = &[$($period)?];
                    let period = periods.first().map(|period| period(&given));
                    let base = $crate::operator::Operator::of_class::<_, _, $stage>(
                        stringify!($name), needs, &given, $params, period, $inverse,
                    )?;
                    Ok(pyo3::PyClassInitializer::from(base).add_subclass(given))
                }

                $(
                    $(#[$field_doc])*
                    #[getter]
                    fn $field(&self, py: pyo3::Python<'_>) -> pyo3::PyResult<pyo3::Py<pyo3::PyAny>> {
                        $crate::model_macro::Parameter::to_python(&self.$field, py)
                    }
                )*

                fn __repr__(&self) -> String {
                    $crate::model_macro::repr(stringify!($name), &self.list())
                }

                /// Returns whether the parameters are bit-identical. The history is not compared.
                fn __eq__(&self, other: &pyo3::Bound<'_, pyo3::PyAny>) -> bool {
                    let Ok(other) = other.cast::<Self>() else { return false };
                    self.list().iter().zip(other.get().list()).all(|((_, own), (_, other))| own.bits() == other.bits())
                }

                fn __hash__(&self) -> u64 {
                    use std::hash::{DefaultHasher, Hash, Hasher};
                    let mut hasher = DefaultHasher::new();
                    stringify!($name).hash(&mut hasher);
                    self.list().iter().for_each(|(_, own)| own.bits().hash(&mut hasher));
                    hasher.finish()
                }

                fn __getnewargs_ex__<'py>(
                    &self,
                    py: pyo3::Python<'py>,
                ) -> pyo3::PyResult<((), pyo3::Bound<'py, pyo3::types::PyDict>)> {
                    $crate::model_macro::arguments(py, &self.list())
                }
            }
        )*

        /// Adds the classes of this file to a module.
        pub(super) fn add_to(module: &pyo3::Bound<'_, pyo3::types::PyModule>) -> pyo3::PyResult<()> {
            use pyo3::types::PyModuleMethods;
            $(module.add_class::<$name>()?;)*
            Ok(())
        }
    };
}
pub(crate) use models;
