//! A Preisach model from first-order descent curves.

use hyst_core::PreisachParams;
use serde::Serialize;

use super::{Breach, EverettError, Family, Moved, Surface};
use crate::fit::{FitError, check, model_of};
use crate::model::{Base, Model};
use crate::record::Record;
use crate::samples::Samples;

/// What a fit from descent curves may be told.
#[derive(Clone, Copy, Debug, Default)]
pub struct FodOptions {
    /// Cells along one edge of the grid; as many as there are heights, if not given.
    pub cells: Option<usize>,
    /// Take the measured surface as it is or not at all; else the nearest valid one where it is not monotone.
    pub as_measured: bool,
    /// Recorded with the model; nothing is drawn at random.
    pub seed: u64,
}

/// A Preisach model whose Everett surface was measured, and what was found on the way.
#[derive(Clone, Debug)]
pub struct FodFit {
    /// The model.
    pub model: Model,
    /// The surface as measured.
    pub surface: Surface,
    /// What was found.
    pub report: FodReport,
}

/// What the descent curves of a record show.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FodReport {
    /// Cells along one edge of the grid.
    pub cells: usize,
    /// The families of peaks that were averaged.
    pub families: Vec<Family>,
    /// Excursions of the input that are no first-order descent curve, or of too few of a kind.
    pub passed_over: usize,
    /// Standard deviation of the sensor's noise \[output unit\].
    pub noise: f64,
    /// Largest standard error of a node that this leaves \[output unit\].
    pub std_error: f64,
    /// Scatter of the nodes between families \[output unit\]; absent for one family.
    pub scatter: Option<f64>,
    /// Cells that break a rule of Everett surfaces by more than 3 standard errors, the clearest first.
    pub breaches: Vec<Breach>,
    /// By how much the surface was moved to be valid; absent where it was taken as measured.
    pub moved: Option<Moved>,
}

/// Measures the Everett surface of a record of first-order descent curves and makes a Preisach model of it.
///
/// # Errors
/// As [`Surface::measure`]; [`EverettError::NotMonotone`] with `as_measured` where the surface is not.
pub fn fit_fod(record: &Record, options: &FodOptions) -> Result<FodFit, FitError> {
    record.need_one_sample_period("a surface of first-order curves")?;
    let samples = Samples::from_record(record);
    check(record, &samples, samples.falls)?;
    let surface = Surface::measure(&record.name(), &samples, options.cells)?;
    let (valid, report) = checked(&surface, &record.name(), options.as_measured)?;
    let base = Base::Preisach(valid.params());
    let model = model_of(record, &samples, base, surface.zero, options.seed);
    // What an operator refuses is said here and not when the file is read.
    model.build(samples.period).map_err(|source| FitError::Stage { record: record.name(), source })?;
    Ok(FodFit { model, surface, report })
}

/// The surface that an operator can be built of: the measured one, or the nearest valid one where it falls and may be
/// moved. And what is to be said about it.
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

/// Whether a record is made of first-order descent curves and nothing else, so that [`fit_fod`] suits it.
pub fn shows_only_curves(record: &Record) -> bool {
    let samples = Samples::from_record(record);
    let (low, high) = samples.input_range();
    high > low && Surface::measure("", &samples, None).is_ok_and(|surface| surface.passed_over == 0)
}

impl Surface {
    /// The parameters of the operator that has this surface, at rest at the low end.
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
