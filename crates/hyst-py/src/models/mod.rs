//! Table of the models, one file per family.
//!
//! An entry has the class, its keywords with unit and range, the parameters of the core, the stage that is built from
//! them (at the sample period, if the class has one), the method of inversion (`closed`, `search`, `compensator`,
//! `refused` of `inversion.rs`, or a closure), and which of `temperature`, `load` and `time` it needs. Units: `u` is
//! that of the input, `y` that of the output. `keep.rs` converts the parameters to those of a model file.

mod activation;
mod bouc_wen;
mod fractional;
mod plays;
mod preisach;
mod slip;
mod stages;

use pyo3::prelude::*;

/// Adds the class of every model to a module.
pub(crate) fn add_to(module: &Bound<'_, PyModule>) -> PyResult<()> {
    plays::add_to(module)?;
    slip::add_to(module)?;
    preisach::add_to(module)?;
    fractional::add_to(module)?;
    bouc_wen::add_to(module)?;
    activation::add_to(module)?;
    stages::add_to(module)
}
