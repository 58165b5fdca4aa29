//! The table of models, a file for each family.
//!
//! An entry names the class, its keywords with unit and range, the core's parameters that they are, the stage that is
//! built of these (at the sample period, if the class has one), how it is inverted (`closed`, `search`, `compensator`,
//! `refused` of `inversion.rs`, or a closure) and which of `temperature`, `load` and `time` it cannot do without. Units:
//! `u` is the input's, `y` the output's. What a model file keeps of the parameters is in `keep.rs`.

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
