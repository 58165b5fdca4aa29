//! Records (`hyst_ident::record`).

use std::path::PathBuf;
use std::sync::Arc;

use hyst_ident::atomic_file::{create_atomic, write_atomic};
use hyst_ident::record::{self as core, Columns, FileKind, OutputUnit};
use numpy::PyArray1;
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString, PyTuple};

use crate::arrays::{Signal, array, integers};
use crate::read_options::{map_arguments, needed, reading};
use crate::{errors, frame, pickle, plot};

/// Measured time series of an actuator: evenly sampled columns over the lab clock, in segments. The device is at rest
/// between segments.
///
/// Parameters
/// ----------
/// timepts : array_like, shape (n,)
///     Time [s], even within each segment.
/// inputs : array_like, shape (n,), optional
///     Input, in the unit at the end of ``input_column``.
/// outputs : array_like, shape (n,), optional
///     Output, in the unit at the end of ``output_column``.
/// temperature, load : array_like, shape (n,), optional
///     Temperature [°C], external load [N].
/// segment : array_like of int, shape (n,), optional
///     A label per row. The device is at rest between rows with different labels. Default: one segment.
/// input_column : str
///     ``voltage_v``, or ``QUANTITY_in_UNIT``.
/// output_column : str
///     ``displacement_um``, ``displacement_nm``, ``displacement_mm`` or ``force_n``.
/// name : str
///     Name of the record in messages and models.
///
/// Raises
/// ------
/// RecordError
///     If columns differ in length, values are not finite, time is not evenly spaced or not rising, or a label occurs
///     again.
#[pyclass(frozen, module = "hyst")]
pub(crate) struct Record(pub(crate) Arc<core::Record>);

impl Record {
    pub(crate) fn wrap(record: core::Record) -> Self {
        Self(Arc::new(record))
    }
}

/// Parses the argument `output_column`.
pub(crate) fn output_unit(column: &str) -> PyResult<OutputUnit> {
    OutputUnit::of_column(column).ok_or_else(|| {
        let known = OutputUnit::ALL.map(OutputUnit::column).join(", ");
        PyValueError::new_err(format!("output_column is {column:?}; it must be one of {known}"))
    })
}

/// Creates a record from the columns of a call.
#[allow(clippy::too_many_arguments, reason = "keywords of one call")]
pub(crate) fn of_arrays(
    timepts: &Bound<'_, PyAny>,
    inputs: Option<&Bound<'_, PyAny>>,
    outputs: Option<&Bound<'_, PyAny>>,
    temperature: Option<&Bound<'_, PyAny>>,
    load: Option<&Bound<'_, PyAny>>,
    segment: Option<&Bound<'_, PyAny>>,
    input_column: &str,
    output_column: &str,
    name: &str,
) -> PyResult<Record> {
    let column = |name: &str, x: &Bound<'_, PyAny>| Ok::<_, PyErr>(Signal::new(name, x)?.values()?.to_vec());
    let optional = |name: &str, x: Option<&Bound<'_, PyAny>>| x.map(|x| column(name, x)).transpose();
    let unit = output_unit(output_column)?;
    let columns = Columns {
        name: name.to_owned(),
        segment: segment.map(|labels| integers("segment", labels)).transpose()?,
        time: column("timepts", timepts)?,
        input_column: input_column.to_owned(),
        input: optional("inputs", inputs)?,
        output: optional("outputs", outputs)?.map(|y| (unit, y)),
        temperature: optional("temperature", temperature)?,
        load: optional("load", load)?,
    };
    Ok(Record::wrap(core::Record::from_samples(columns).map_err(errors::record)?))
}

#[pymethods]
impl Record {
    #[new]
    #[pyo3(signature = (timepts, inputs=None, outputs=None, *, temperature=None, load=None, segment=None, input_column="voltage_v", output_column="displacement_um", name="record"))]
    #[allow(clippy::too_many_arguments, reason = "keywords of one call")]
    fn new(
        timepts: &Bound<'_, PyAny>,
        inputs: Option<&Bound<'_, PyAny>>,
        outputs: Option<&Bound<'_, PyAny>>,
        temperature: Option<&Bound<'_, PyAny>>,
        load: Option<&Bound<'_, PyAny>>,
        segment: Option<&Bound<'_, PyAny>>,
        input_column: &str,
        output_column: &str,
        name: &str,
    ) -> PyResult<Self> {
        of_arrays(timepts, inputs, outputs, temperature, load, segment, input_column, output_column, name)
    }

    /// Joins records of several files or experiments. Each keeps its own clock.
    #[staticmethod]
    fn join(records: Vec<Bound<'_, Self>>) -> PyResult<Self> {
        let records = records.iter().map(|r| (*r.get().0).clone()).collect();
        Ok(Self::wrap(core::Record::join(records).map_err(errors::record)?))
    }

    /// Time of the lab clock [s], shape (n,).
    #[getter]
    fn timepts<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        array(py, self.0.time().to_vec())
    }

    /// Input, in the unit at the end of ``input_column``, shape (n,); None in a reference.
    #[getter]
    fn inputs<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        let input = self.0.input();
        (!input.is_empty()).then(|| array(py, input.to_vec()))
    }

    /// Output, in the unit at the end of ``output_column``, shape (n,); None if there is none.
    #[getter]
    fn outputs<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        self.0.output().map(|y| array(py, y.to_vec()))
    }

    /// Temperature [°C], shape (n,); None if it was not measured.
    #[getter]
    fn temperature<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        self.0.temperature().map(|x| array(py, x.to_vec()))
    }

    /// External load [N], shape (n,); None if it was not measured.
    #[getter]
    fn load<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        self.0.load().map(|x| array(py, x.to_vec()))
    }

    /// First row and last row + 1 of each segment.
    #[getter]
    fn segments(&self) -> Vec<(usize, usize)> {
        self.0.segments().iter().map(|s| (s.start, s.end)).collect()
    }

    /// Column name of the input, with the unit.
    #[getter]
    fn input_column(&self) -> &str {
        self.0.input_column()
    }

    /// Column name of the output, with the unit; None if there is none.
    #[getter]
    fn output_column(&self) -> Option<&'static str> {
        self.0.output_unit().map(OutputUnit::column)
    }

    /// Sample period [s]; the shortest if segments differ.
    #[getter]
    fn period(&self) -> f64 {
        self.0.sample_period()
    }

    /// Sample period of each segment [s].
    #[getter]
    fn periods(&self) -> Vec<f64> {
        self.0.sample_periods()
    }

    /// Names of the files of the rows.
    #[getter]
    fn name(&self) -> String {
        self.0.name()
    }

    /// Changes made while reading the files, as sentences: converted units, omitted rows, resampled times.
    #[getter]
    fn notes(&self) -> Vec<String> {
        self.0.notes().to_vec()
    }

    /// Creates a record from a table: a DataFrame of pandas or polars, a Dataset of xarray, a dict of arrays.
    ///
    /// Columns are identified by their headings (``Time (s)``, ``Voltage [mV]``, ``disp_nm``), as in a file, or by
    /// keywords: ``Record.from_frame(df, time="t", voltage="V", displacement="x")``. A named index or an index of dates
    /// is also a column. Rows without a value are omitted, and uneven times are resampled; ``notes`` reports both.
    ///
    /// Parameters
    /// ----------
    /// frame : DataFrame, Dataset or dict
    ///     The table.
    /// map : dict of str to str, optional
    ///     Columns for the names of the record format, as in ``read_record``.
    /// need : {"both", "input", "output"}
    ///     Required columns.
    /// rate : float, optional
    ///     Sample rate [Hz] of a table without times.
    /// name : str
    ///     Name of the record in messages and models.
    /// **columns : str
    ///     Names of columns, by ``time`` [s], ``voltage`` [V], ``displacement`` [µm], ``force`` [N, an output],
    ///     ``temperature`` [°C], ``load`` [N], ``segment``, or a name of the record format such as ``displacement_nm``.
    ///     A unit in the heading of the column has priority.
    ///
    /// Raises
    /// ------
    /// RecordError
    ///     If the table is not valid. The message contains column, row, and how to fix it.
    #[staticmethod]
    #[pyo3(signature = (frame, *, map=None, need="both", rate=None, name="frame", **columns))]
    fn from_frame(
        frame: &Bound<'_, PyAny>,
        map: Option<&Bound<'_, PyDict>>,
        need: &str,
        rate: Option<f64>,
        name: &str,
        columns: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let mut arguments = map_arguments(map)?;
        for (role, column) in columns.into_iter().flatten() {
            let role = role.extract::<String>()?;
            let canonical = match role.as_str() {
                "time" => "time_s",
                "voltage" => "voltage_v",
                "displacement" => "displacement_um",
                "force" => "force_n",
                "temperature" => "temperature_degc",
                "load" => "load_n",
                other => other,
            };
            arguments.push(format!("{canonical}={}", column.str()?));
        }
        let how = reading(&arguments, rate)?;
        let record = core::Record::from_table(name, frame::columns(frame)?, how, needed(need)?);
        Ok(Self::wrap(record.map_err(errors::record)?))
    }

    /// Writes the record in the format of the file name extension: ``.csv``, ``.npy``, ``.mat`` or ``.tdms``.
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
    /// ValueError
    ///     If the extension is unknown.
    #[pyo3(signature = (path, *, overwrite=true))]
    fn save(&self, path: PathBuf, overwrite: bool) -> PyResult<()> {
        let ending = path.extension().map(|ending| ending.to_string_lossy().into_owned()).unwrap_or_default();
        let Some(kind) = FileKind::of_ending(&ending) else {
            let known: Vec<String> = FileKind::ALL.iter().map(|kind| format!(".{}", kind.ending())).collect();
            let message = format!("{}: the name must end in one of {}", path.display(), known.join(", "));
            return Err(PyValueError::new_err(message));
        };
        let write = |out: &mut dyn std::io::Write| self.0.write_as(kind, out).map_err(std::io::Error::other);
        if overwrite { write_atomic(&path, write) } else { create_atomic(&path, write) }.map_err(errors::written)
    }

    /// Returns the record as a DataFrame, with the columns of the record format.
    ///
    /// Parameters
    /// ----------
    /// library : {"pandas", "polars"}
    ///     Library of the DataFrame.
    #[pyo3(signature = (library="pandas"))]
    fn to_frame<'py>(&self, py: Python<'py>, library: &str) -> PyResult<Bound<'py, PyAny>> {
        if !["pandas", "polars"].contains(&library) {
            return Err(PyValueError::new_err(format!("library is {library:?}; it must be \"pandas\" or \"polars\"")));
        }
        let columns = PyDict::new(py);
        if self.0.segments().len() > 1 {
            let labels = self.0.segments().iter().zip(self.0.labels());
            let of_rows = labels.flat_map(|(rows, label)| std::iter::repeat_n(*label, rows.len()));
            columns.set_item("segment", PyArray1::from_iter(py, of_rows))?;
        }
        columns.set_item("time_s", self.timepts(py))?;
        let further = [
            (self.0.input_column(), self.inputs(py)),
            (self.output_column().unwrap_or_default(), self.outputs(py)),
            ("temperature_degc", self.temperature(py)),
            ("load_n", self.load(py)),
        ];
        for (name, values) in further.into_iter().filter_map(|(name, values)| Some((name, values?))) {
            columns.set_item(name, values)?;
        }
        py.import(library)?.getattr("DataFrame")?.call1((columns,))
    }

    /// Plots output over input, or over time; needs matplotlib.
    ///
    /// Parameters
    /// ----------
    /// kind : {"loop", "time"}
    ///     Output over the input, or over time.
    /// ax : matplotlib.axes.Axes, optional
    ///     Axes to plot in; by default a new figure.
    /// **options
    ///     Options of the line, as in ``matplotlib.axes.Axes.plot``.
    ///
    /// Returns
    /// -------
    /// matplotlib.axes.Axes
    #[pyo3(signature = (*, kind="loop", ax=None, **options))]
    fn plot<'py>(
        slf: &Bound<'py, Self>,
        kind: &str,
        ax: Option<&Bound<'py, PyAny>>,
        options: Option<&Bound<'py, PyDict>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let kind = PyString::new(slf.py(), kind).into_any();
        plot::drawn("record", slf.as_any(), &[kind], ax, options)
    }

    /// Returns whether names, columns, segments and sample periods are bit-identical.
    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        let Ok(other) = other.cast::<Self>() else { return false };
        let (own, other) = (&self.0, &other.get().0);
        let columns = |r: &core::Record| {
            [Some(r.time()), Some(r.input()), r.output(), r.temperature(), r.load()].map(|x| x.map(<[f64]>::to_vec))
        };
        (own.name(), own.input_column(), own.output_unit()) == (other.name(), other.input_column(), other.output_unit())
            && (own.segments(), own.labels(), own.sample_periods())
                == (other.segments(), other.labels(), other.sample_periods())
            && own.missing() == other.missing()
            && columns(own) == columns(other)
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyTuple>> {
        pickle::reduced(slf.as_any(), &*slf.get().0)
    }

    /// Restores the object from the state of `__reduce__`.
    #[staticmethod]
    fn _restore(state: &[u8]) -> PyResult<Self> {
        pickle::restored(state).map(Self::wrap)
    }

    fn __len__(&self) -> usize {
        self.0.rows()
    }

    /// Returns a table and a plot for notebooks.
    fn _repr_html_<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        slf.py().import("hyst._html")?.call_method1("record", (slf,))
    }

    fn __repr__(&self) -> String {
        let (rows, segments) = (self.0.rows(), self.0.segments().len());
        format!(
            "<Record {:?}: {rows} rows in {segments} segments, period {:?} s>",
            self.0.name(),
            self.0.sample_period()
        )
    }
}
