//! Computes a Preisach model from first-order descent curves.

use hyst_core::PreisachParams;
use serde::Serialize;

use super::{Breach, EverettError, Family, Moved, Surface};
use crate::error::FitError;
use crate::fit::{check, model_of};
use crate::model::{Base, Model};
use crate::record::Record;
use crate::samples::Samples;

/// Options of a fit from descent curves.
#[derive(Clone, Copy, Debug, Default)]
pub struct FodOptions {
    /// Cells along one edge of the grid; if not given, the number of peak heights.
    pub cells: Option<usize>,
    /// Whether a surface that is not monotone is an error. Otherwise the nearest valid one is used.
    pub as_measured: bool,
    /// Stored in the model; nothing is random.
    pub seed: u64,
}

/// A Preisach model from a measured Everett surface, with its report.
#[derive(Clone, Debug)]
pub struct FodFit {
    /// The model.
    pub model: Model,
    /// The measured surface.
    pub surface: Surface,
    /// Result of the fit.
    pub report: FodReport,
}

/// Result of a fit from descent curves.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FodReport {
    /// Cells along one edge of the grid.
    pub cells: usize,
    /// The families of peaks that were averaged.
    pub families: Vec<Family>,
    /// Excursions of the input that are not first-order descent curves, or too few of a family.
    pub passed_over: usize,
    /// Standard deviation of the sensor noise \[output unit\].
    pub noise: f64,
    /// Largest resulting standard error of a node \[output unit\].
    pub std_error: f64,
    /// Scatter of the nodes between families \[output unit\]; absent for one family.
    pub scatter: Option<f64>,
    /// Cells that break a rule of Everett surfaces by more than 3 standard errors, the largest breach first.
    pub breaches: Vec<Breach>,
    /// Correction that made the surface valid; absent if the measured surface was used.
    pub moved: Option<Moved>,
}

/// Measures the Everett surface of a record of first-order descent curves and builds a Preisach model of it.
///
/// # Errors
/// As [`Surface::measure`]; with `as_measured`, [`EverettError::NotMonotone`].
pub fn fit_fod(record: &Record, options: &FodOptions) -> Result<FodFit, FitError> {
    record.need_one_sample_period("a surface of first-order curves")?;
    let samples = Samples::from_record(record);
    check(record, &samples, samples.falls)?;
    let surface = Surface::measure(&record.name(), &samples, options.cells)?;
    let (valid, report) = checked(&surface, &record.name(), options.as_measured)?;
    let base = Base::Preisach(valid.params());
    let model = model_of(record, &samples, base, surface.zero, options.seed);
    // Reports invalid parameters now and not when the model file is read.
    model.build(samples.period).map_err(|source| FitError::Stage { record: record.name(), source })?;
    Ok(FodFit { model, surface, report })
}

/// Returns a surface from which an operator can be built, with its report: the measured surface, or the nearest valid
/// one if it falls and `as_measured` is not set.
pub(super) fn checked(
    surface: &Surface,
    record: &str,
    as_measured: bool,
) -> Result<(Surface, FodReport), EverettError> {
    let breaches = surface.breaches();
    let (valid, moved) = match surface.steps_back() {
        0 => (surface.clone(), None),
        nodes if as_measured => {
            let (record, beyond) = (record.to_owned(), breaches.len());
            return Err(EverettError::NotMonotone { record, nodes, beyond });
        }
        _ => {
            let (valid, moved) = surface.nearest_valid()?;
            (valid, Some(moved))
        }
    };
    let nodes = (1..=surface.grid.cells).flat_map(|i| (0..i).map(move |j| (i, j)));
    let report = FodReport {
        cells: surface.grid.cells,
        families: surface.families.clone(),
        passed_over: surface.passed_over,
        noise: surface.noise,
        std_error: nodes.map(|(i, j)| surface.std_error(i, j)).fold(0.0, f64::max),
        scatter: (surface.families.len() > 1).then(|| surface.scatter()),
        breaches,
        moved,
    };
    Ok((valid, report))
}

/// Returns whether a record contains only first-order descent curves. [`fit_fod`] is then suitable.
pub fn shows_only_curves(record: &Record) -> bool {
    let samples = Samples::from_record(record);
    let (low, high) = samples.input_range();
    high > low && Surface::measure("", &samples, None).is_ok_and(|surface| surface.passed_over == 0)
}

impl Surface {
    /// Returns the parameters of the operator with this surface, at rest at the low end.
    pub fn params(&self) -> PreisachParams<Vec<f64>> {
        let cells = self.grid.cells;
        let mut params = PreisachParams {
            low: self.grid.low,
            high: self.grid.high,
            cells,
            rest: self.grid.low,
            density: vec![0.0; cells * (cells + 1) / 2],
            once: vec![0.0; cells],
        };
        let set = params.set_surface(|i, j| self.value(i, j), |i| self.virgin(i));
        assert!(set.is_ok(), "the lists have the lengths of the grid");
        params
    }
}
