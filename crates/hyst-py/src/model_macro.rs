//! The Python class of a model, from one entry of the table in `models.rs`.

use numpy::PyArray1;
use pyo3::IntoPyObjectExt;
use pyo3::prelude::*;
use pyo3::types::PyDict;

/// A parameter of a model as Python sees it.
pub(crate) trait Parameter {
    /// The value of the property: a number, or a new array.
    fn to_python(&self, py: Python<'_>) -> PyResult<Py<PyAny>>;
    /// As `repr` shows it.
    fn text(&self) -> String;
}

macro_rules! plain_parameters {
    ($($type:ty),*) => { $(
        impl Parameter for $type {
            fn to_python(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
                self.into_py_any(py)
            }
            fn text(&self) -> String {
                format!("{self:?}")
            }
        }
    )* };
}
plain_parameters!(f64, u16, usize, String);

impl Parameter for bool {
    fn to_python(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.into_py_any(py)
    }
    fn text(&self) -> String {
        if *self { "True" } else { "False" }.to_owned()
    }
}

impl Parameter for Vec<f64> {
    fn to_python(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        PyArray1::from_slice(py, self).into_py_any(py)
    }
    fn text(&self) -> String {
        match self.as_slice() {
            [a, b, c, .., z] if self.len() > 10 => format!("[{a:?}, {b:?}, {c:?}, ..., {z:?}]"),
            all => format!("{all:?}"),
        }
    }
}

impl<P: Parameter> Parameter for Option<P> {
    fn to_python(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        self.as_ref().map_or_else(|| Ok(py.None()), |p| p.to_python(py))
    }
    fn text(&self) -> String {
        self.as_ref().map_or_else(|| "None".to_owned(), Parameter::text)
    }
}

/// `Name(first=1.0, second=[2.0])`
pub(crate) fn repr(name: &str, parameters: &[(&str, &dyn Parameter)]) -> String {
    let list: Vec<String> = parameters.iter().map(|(name, value)| format!("{name}={}", value.text())).collect();
    format!("{name}({})", list.join(", "))
}

/// What `pickle` and `copy` build the object from: its parameters. The history does not travel.
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

/// Python classes of models, each from its parameters (with their documentation and defaults), its stage, how that is
/// built of them, the way in which it is inverted (`inverse.rs`) and the surroundings that it needs; and `add_to`,
/// which puts them all into a module. A default is a number, a word or an expression
/// in parentheses.
macro_rules! models {
    ($(
        $(#[$doc:meta])*
        class $name:ident {
            $( $(#[$field_doc:meta])* $field:ident : $type:ty $(= $default:tt)?, )*
        }
        stage: $stage:ty,
        build: $build:expr,
        inverse: $inverse:expr,
        needs: [$($need:ident),*],
    )*) => {
        $(
            $(#[$doc])*
            #[pyclass(extends = Operator, frozen, module = "hyst")]
            #[derive(Clone)]
            struct $name {
                $($field: $type,)*
            }

            impl $name {
                fn list(&self) -> Vec<(&'static str, &dyn Parameter)> {
                    vec![$((stringify!($field), &self.$field as &dyn Parameter)),*]
                }
            }

            #[pymethods]
            impl $name {
                #[new]
                #[pyo3(signature = (*, $($field $(= $default)?),*))]
                #[allow(clippy::too_many_arguments, reason = "keywords of one call")]
                fn new($($field: $type),*) -> PyResult<PyClassInitializer<Self>> {
                    let parameters = Self { $($field),* };
                    let needs = Needs { $($need: true,)* ..Needs::default() };
                    let build: fn(&Self) -> Result<$stage, Error> = $build;
                    let base = Operator::new(stringify!($name), needs, &parameters, build, $inverse)?;
                    Ok(PyClassInitializer::from(base).add_subclass(parameters))
                }

                $(
                    $(#[$field_doc])*
                    #[getter]
                    fn $field(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
                        Parameter::to_python(&self.$field, py)
                    }
                )*

                fn __repr__(&self) -> String {
                    repr(stringify!($name), &self.list())
                }

                fn __getnewargs_ex__<'py>(&self, py: Python<'py>) -> PyResult<((), Bound<'py, PyDict>)> {
                    arguments(py, &self.list())
                }
            }
        )*

        /// Adds the class of every model to a module.
        pub(crate) fn add_to(module: &Bound<'_, PyModule>) -> PyResult<()> {
            $(module.add_class::<$name>()?;)*
            Ok(())
        }
    };
}
pub(crate) use models;
