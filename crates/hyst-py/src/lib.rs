//! The Python package `hyst`: models of `hyst-core` and the identification of `hyst-ident` on NumPy arrays.
//!
//! This crate contains no models. A signal is a view of a NumPy array, passes through a stage with Python's lock
//! released, and is returned as a new array. `models/` is the table of models. A new model needs an entry there, a
//! class in the stub `python/hyst/_hyst.pyi` and a case in `tests/python/cases.py`.
#![allow(rustdoc::broken_intra_doc_links, reason = "docstrings of Python classes, in which [V] is a unit")]

mod arrays;
mod channels;
mod clamp;
mod command;
mod control;
mod daq;
mod errors;
mod fleet;
mod frame;
mod identify;
mod interrupt;
mod inverse;
mod inversion;
mod keep;
mod metrics;
mod model;
mod model_macro;
mod models;
mod of_class;
mod operator;
mod operator_methods;
mod pickle;
mod plot;
mod progress;
mod read_options;
mod read_record;
mod record;
mod results;
mod runner;

use pyo3::prelude::*;

/// Compiled part of the package `hyst`; import `hyst` instead.
#[pymodule]
mod _hyst {
    #[pymodule_export]
    use crate::command::{_command, _main};
    #[pymodule_export]
    use crate::control::{ForceObserver, Pid};
    #[pymodule_export]
    use crate::fleet::{_FleetJournal, _Stop, _fleet_check, _fleet_entries, _fleet_row};
    #[pymodule_export]
    use crate::identify::{Diagnosis, diagnose, fit};
    #[pymodule_export]
    use crate::inverse::Inverse;
    #[pymodule_export]
    use crate::metrics::{mape, max_abs, nrmse, peak_to_valley, rmse, smape};
    #[pymodule_export]
    use crate::model::Model;
    #[pymodule_export]
    use crate::operator::{_History, Operator};
    #[pymodule_export]
    use crate::read_record::read_record;
    #[pymodule_export]
    use crate::record::Record;
    #[pymodule_export]
    use crate::results::{Drive, Simulation};

    #[pymodule_init]
    fn init(module: &super::Bound<'_, super::PyModule>) -> super::PyResult<()> {
        use super::PyModuleMethods;
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        crate::models::add_to(module)
    }
}
