//! Python methods of the class `Operator`.

use std::path::PathBuf;

use numpy::PyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::channels::Channels;
use crate::inverse::Inverse;
use crate::inversion::Options;
use crate::model::{Model, save};
use crate::operator::{_History, Operator};

#[pymethods]
impl Operator {
    /// Returns the output for an input signal.
    ///
    /// Each call starts at rest at ``u[0]``: linear parts are settled, the memory is virgin and then gets ``u[0]``. The
    /// history of ``step`` is not changed.
    ///
    /// Parameters
    /// ----------
    /// u : ndarray of float64, shape (n,), contiguous
    ///     Input [V, or the unit of the parameters].
    /// temperature : float or ndarray of float64, shape (n,), optional
    ///     Temperature [°C].
    /// load : float or ndarray of float64, shape (n,), optional
    ///     External load [N].
    /// time : float or ndarray of float64, shape (n,), optional
    ///     Lab clock [s]. Only models of the sensor use it.
    ///
    /// Returns
    /// -------
    /// ndarray of float64, shape (n,)
    ///     Output, a new array.
    ///
    /// Raises
    /// ------
    /// TypeError
    ///     If ``u`` cannot be converted to an array of float64, or if a quantity that the model needs is missing.
    /// ValueError
    ///     If ``u`` is not one-dimensional or not finite, or if lengths differ.
    #[pyo3(signature = (u, *, temperature=None, load=None, time=None))]
    fn simulate<'py>(
        &self,
        py: Python<'py>,
        u: &Bound<'py, PyAny>,
        temperature: Option<&Bound<'py, PyAny>>,
        load: Option<&Bound<'py, PyAny>>,
        time: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        self.output(py, u, [temperature, load, time])
    }

    /// Sets the history of the object to rest at ``u0`` and returns the output there.
    ///
    /// Parameters
    /// ----------
    /// u0 : float
    ///     Input at rest.
    /// temperature, load, time : float, optional
    ///     Temperature [°C], external load [N], lab clock [s].
    #[pyo3(signature = (u0, *, temperature=None, load=None, time=None))]
    fn reset(
        &self,
        u0: f64,
        temperature: Option<&Bound<'_, PyAny>>,
        load: Option<&Bound<'_, PyAny>>,
        time: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<f64> {
        self.run_sample(u0, [temperature, load, time], |engine, env, u| u.is_finite().then(|| engine.reset(env, u)))
    }

    /// Returns the output one sample later, at input ``u``, and updates the history of the object.
    ///
    /// Without an earlier ``reset`` the first ``step`` is a ``reset``. The last finite input replaces an input that is
    /// not finite.
    ///
    /// Parameters
    /// ----------
    /// u : float
    ///     Input.
    /// temperature, load, time : float, optional
    ///     Temperature [°C], external load [N], lab clock [s].
    #[pyo3(signature = (u, *, temperature=None, load=None, time=None))]
    fn step(
        &self,
        u: f64,
        temperature: Option<&Bound<'_, PyAny>>,
        load: Option<&Bound<'_, PyAny>>,
        time: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<f64> {
        self.run_sample(u, [temperature, load, time], |engine, env, u| engine.step(env, u))
    }

    /// Returns the history of the object, for ``_resume``; ``None`` before the first sample.
    fn _history(&self) -> Option<_History> {
        self.history()
    }

    /// Continues from a history of this object.
    fn _resume(&self, history: &_History) -> PyResult<()> {
        self.resume(history)
            .then_some(())
            .ok_or_else(|| PyValueError::new_err("this is the history of another operator"))
    }

    /// Returns the inverse: it computes the input with which the model follows a reference.
    ///
    /// Parameters
    /// ----------
    /// low, high : float, optional
    ///     Input range, required for a model that is inverted by search.
    /// tolerance : float, optional
    ///     Maximum error of the input of a search; default 1e-9 of the range. For an activation-function model that is
    ///     inverted backwards in time: maximum error of the preview, relative to the maximum |α u̇|; default 1e-9.
    /// bandwidth_hz : float, optional
    ///     Band in which a dynamic model is inverted [Hz]; by default chosen from the model.
    ///
    /// Raises
    /// ------
    /// NotInvertibleError
    ///     If there is no inverse. The message contains the reason.
    /// TypeError
    ///     If the inverse of this model does not accept a given option.
    ///
    /// Warns
    /// -----
    /// RangeWarning
    ///     By ``simulate`` of the inverse, if it cannot reach all samples within its input range, with the number of
    ///     samples and the error. ``step`` uses the nearer end of the range without a warning.
    #[pyo3(signature = (*, low=None, high=None, tolerance=None, bandwidth_hz=None))]
    fn inverse(
        slf: &Bound<'_, Self>,
        low: Option<f64>,
        high: Option<f64>,
        tolerance: Option<f64>,
        bandwidth_hz: Option<f64>,
    ) -> PyResult<Py<Inverse>> {
        let (base, inverted) = slf.get().inverted(&Options { low, high, tolerance, bandwidth_hz })?;
        let inverse = Inverse {
            of: slf.clone().unbind(),
            lead: inverted.lead,
            bandwidth_hz: inverted.bandwidth_hz,
            band_error: inverted.band_error,
        };
        Py::new(slf.py(), PyClassInitializer::from(base).add_subclass(inverse))
    }

    /// Computes the input with which the model follows a reference: ``inverse`` over an array, aligned with the
    /// reference.
    ///
    /// If the inverse needs preview, the first and last value of the reference are held.
    ///
    /// Parameters
    /// ----------
    /// y_ref : ndarray of float64, shape (n,), contiguous
    ///     Reference, in the unit of the output.
    /// temperature, load, time : float or ndarray of float64, shape (n,), optional
    ///     Temperature [°C], external load [N], lab clock [s].
    /// low, high, tolerance, bandwidth_hz : float, optional
    ///     As in ``inverse``.
    ///
    /// Returns
    /// -------
    /// ndarray of float64, shape (n,)
    ///     Input, a new array.
    ///
    /// Warns
    /// -----
    /// RangeWarning
    ///     If no input from ``low`` to ``high`` (for ``Saturation``: no input at all) reaches some samples, with their
    ///     number and the error. The input is then the nearer end of the range.
    #[pyo3(signature = (y_ref, *, temperature=None, load=None, time=None, low=None, high=None, tolerance=None, bandwidth_hz=None))]
    #[allow(clippy::too_many_arguments, reason = "keywords of one call")]
    fn compensate<'py>(
        &self,
        py: Python<'py>,
        y_ref: &Bound<'py, PyAny>,
        temperature: Option<&Bound<'py, PyAny>>,
        load: Option<&Bound<'py, PyAny>>,
        time: Option<&Bound<'py, PyAny>>,
        low: Option<f64>,
        high: Option<f64>,
        tolerance: Option<f64>,
        bandwidth_hz: Option<f64>,
    ) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let options = Options { low, high, tolerance, bandwidth_hz };
        self.drive(py, y_ref, [temperature, load, time], &options)
    }

    /// Returns the model for a file that ``Model.load`` and hystctl can read.
    ///
    /// It contains only the parameters: no history, no sample period, and no options of an inverse (``filter_degc`` of
    /// ``TdEm``). A stage that is not a hysteresis is combined with the identity ``Pi(gain=1, ...)``.
    ///
    /// Parameters
    /// ----------
    /// input_range : (float, float), optional
    ///     Minimum and maximum input for which the parameters are valid [u]. Computed drives are limited to this range;
    ///     a prediction outside it causes a warning. Required, except for ``Preisach`` and ``Dpm``, which have a grid.
    /// output_range : (float, float), optional
    ///     Minimum and maximum output [y]; default: those at rest at the ends of ``input_range``.
    /// input_column : str, optional
    ///     ``voltage_v`` (default), or ``QUANTITY_in_UNIT``.
    /// output_column : str, optional
    ///     ``displacement_um`` (default), ``displacement_nm``, ``displacement_mm`` or ``force_n``. The parameters must
    ///     be in these units; they are not converted.
    ///
    /// Raises
    /// ------
    /// TypeError
    ///     If ``input_range`` is required and missing, if a range or column is given for the operator of a ``Model``,
    ///     or if this is an inverse.
    /// ModelFileError
    ///     If files do not support the variant: a short ``memory``, a ``drifting`` model.
    /// ParameterError
    ///     If a range is not finite or not in order, if ``input_column`` is not a name of an input, or if
    ///     ``output_column`` is not the output unit of ``TdEm`` (``per_metre``).
    /// ValueError
    ///     If ``output_column`` is unknown.
    #[pyo3(signature = (*, input_range=None, output_range=None, input_column=None, output_column=None))]
    fn to_model(
        &self,
        input_range: Option<(f64, f64)>,
        output_range: Option<(f64, f64)>,
        input_column: Option<String>,
        output_column: Option<String>,
    ) -> PyResult<Model> {
        self.model(&Channels { input_range, output_range, input_column, output_column }).map(Model)
    }

    /// Returns the text of a ``model.json``, with the arguments and errors of ``to_model``.
    #[pyo3(signature = (*, input_range=None, output_range=None, input_column=None, output_column=None))]
    fn to_json(
        &self,
        input_range: Option<(f64, f64)>,
        output_range: Option<(f64, f64)>,
        input_column: Option<String>,
        output_column: Option<String>,
    ) -> PyResult<String> {
        Ok(self.to_model(input_range, output_range, input_column, output_column)?.0.to_json())
    }

    /// Writes a ``model.json`` atomically, with the other arguments and errors of ``to_model``.
    ///
    /// Parameters
    /// ----------
    /// path : str or path-like
    ///     The file.
    /// overwrite : bool
    ///     Whether an existing file is replaced.
    ///
    /// Raises
    /// ------
    /// FileExistsError
    ///     If the file exists and ``overwrite`` is false. The file is not changed.
    /// ModelFileError
    ///     If the file cannot be written.
    #[pyo3(signature = (path, *, overwrite=false, input_range=None, output_range=None, input_column=None, output_column=None))]
    fn save(
        &self,
        path: PathBuf,
        overwrite: bool,
        input_range: Option<(f64, f64)>,
        output_range: Option<(f64, f64)>,
        input_column: Option<String>,
        output_column: Option<String>,
    ) -> PyResult<()> {
        save(&self.to_model(input_range, output_range, input_column, output_column)?.0, &path, overwrite)
    }

    /// Samples of preview; 0 for a model.
    #[getter]
    fn lead(&self) -> usize {
        0
    }

    fn __repr__(&self) -> String {
        format!("Operator({})", self.name())
    }
}
