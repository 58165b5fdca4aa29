//! A device that is a Python object (`hyst.daq.Daq`).
//!
//! Its methods are called on one thread of their own, so that one that does not return is noticed: the run ends, and `stop` is called from another
//! thread. What the object returns is checked, as nothing is known of it.

use std::collections::{BTreeMap, VecDeque};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use hyst_cli::host::{HostDaq, HostDaqError};
use hyst_hw::{Capabilities, Daq, OutputUnit, Sample, VoltageRange};
use numpy::{PyArray1, PyReadonlyArray1};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyMapping;

/// Ramp to rest where nobody has said how steep it may be \[V/s\].
const USUAL_SLEW: f64 = 100.0;
/// How long a device with a queue is left alone before it is asked again.
const PAUSE: Duration = Duration::from_millis(2);

/// What is asked of the object.
enum Call {
    Start(f64),
    Exchange(Vec<f64>),
    /// Where the drive is.
    Present,
    Stop,
}

/// What it answers.
enum Answer {
    Rate(f64),
    Columns(BTreeMap<&'static str, Vec<f64>>),
    /// What is no columns: `exchange` has done its work all the same.
    Nonsense(PyErr),
    /// \[V\], where the object says it.
    Present(Option<f64>),
    Stopped,
}

/// The exception of the object that ended the run.
pub(crate) type Raised = Arc<Mutex<Option<PyErr>>>;

/// A Python object as a device.
pub(crate) struct PythonDaq {
    object: Arc<Py<PyAny>>,
    calls: Sender<Call>,
    answers: Receiver<PyResult<Answer>>,
    raised: Raised,
    capabilities: Capabilities,
    deadline: Duration,
    present_v: f64,
    /// While the clock runs \[Hz\].
    rate_hz: Option<f64>,
    slew_v_per_s: f64,
    /// Drives whose samples have not come back.
    out: VecDeque<f64>,
    /// Samples that have come back since the device was opened.
    done: u64,
    /// Whether a call has not returned in time.
    hangs: bool,
    /// Whether `exchange` has raised: part of its block may have been put out.
    is_unsure: bool,
}

impl PythonDaq {
    /// The device; nothing moves.
    ///
    /// # Errors
    /// What `capabilities` raises, or what is wrong with what it returns.
    pub(crate) fn new(py: Python<'_>, object: Py<PyAny>) -> PyResult<Self> {
        let told = object.bind(py).call_method0("capabilities")?;
        let (capabilities, present_v, deadline) = capabilities(&told)?;
        for method in ["start", "exchange", "stop"] {
            if !object.bind(py).getattr(method)?.is_callable() {
                return Err(PyTypeError::new_err(format!("the device's {method} is not a method")));
            }
        }
        let (object, raised) = (Arc::new(object), Raised::default());
        let (calls, asked) = channel();
        let (answer, answers) = channel();
        let own = Arc::clone(&object);
        // It ends with the sender of its calls.
        thread::Builder::new().name("hyst daq".to_owned()).spawn(move || {
            for call in asked {
                if answer.send(Python::attach(|py| ask(own.bind(py), call))).is_err() {
                    break;
                }
            }
        })?;
        Ok(Self {
            object,
            calls,
            answers,
            raised,
            slew_v_per_s: capabilities.max_slew_v_per_s.min(USUAL_SLEW),
            capabilities,
            deadline,
            present_v,
            rate_hz: None,
            out: VecDeque::new(),
            done: 0,
            hangs: false,
            is_unsure: false,
        })
    }

    /// Where the exception that ended a run will be.
    pub(crate) fn raised(&self) -> Raised {
        Arc::clone(&self.raised)
    }

    /// Asks the object, and waits no longer than its deadline beyond `seconds`.
    fn ask(&mut self, what: &str, call: Call, seconds: f64) -> Result<Answer, HostDaqError> {
        if self.hangs {
            return Err(lost(format!("{}: an earlier call has not returned", self.capabilities.device)));
        }
        let patience = self.deadline + Duration::try_from_secs_f64(seconds).unwrap_or_default();
        let answer = match self.calls.send(call) {
            Ok(()) => self.answers.recv_timeout(patience),
            Err(_) => Err(RecvTimeoutError::Disconnected),
        };
        match answer {
            Ok(Ok(answer)) => Ok(answer),
            Ok(Err(error)) => {
                let message = format!("{}: {what} raised {error}", self.capabilities.device);
                self.keep(error);
                Err(lost(message))
            }
            Err(_) => {
                self.hangs = true;
                Err(lost(format!(
                    "{}: {what} did not return within {:.3} s; see what it waits for, or give it more time with deadline_s",
                    self.capabilities.device,
                    patience.as_secs_f64()
                )))
            }
        }
    }

    /// Keeps an exception for the caller, and says it in words.
    fn keep(&self, error: PyErr) -> HostDaqError {
        let message = format!("{}: {error}", self.capabilities.device);
        // The first one says what happened.
        if let Ok(mut raised) = self.raised.lock() {
            raised.get_or_insert(error);
        }
        lost(message)
    }

    /// Hands over drives; what has come back is not looked at, and may be an exception.
    fn hand_over(&mut self, drive_v: &[f64]) -> Result<PyResult<BTreeMap<&'static str, Vec<f64>>>, HostDaqError> {
        let Some(rate_hz) = self.rate_hz else {
            return Err(lost(format!("{}: the sample clock does not run", self.capabilities.device)));
        };
        let seconds = (drive_v.len() + self.out.len()) as f64 / rate_hz;
        let answer =
            self.ask("exchange", Call::Exchange(drive_v.to_vec()), seconds).inspect_err(|_| self.is_unsure = true)?;
        self.out.extend(drive_v);
        self.present_v = drive_v.last().copied().unwrap_or(self.present_v);
        Ok(match answer {
            Answer::Columns(columns) => Ok(columns),
            Answer::Nonsense(error) => Err(error),
            _ => Ok(BTreeMap::new()),
        })
    }

    /// Hands over drives and gives what has come back, which is checked.
    fn pass(&mut self, drive_v: &[f64]) -> Result<Vec<Sample>, HostDaqError> {
        let mut columns = self.hand_over(drive_v)?.map_err(|error| self.keep(error))?;
        let rate_hz = self.rate_hz.unwrap_or(1.0);
        let device = &self.capabilities.device;
        let wrong = |what: String| lost(format!("{device}: exchange returned {what}"));
        let mut column = |name: &str, needed: bool| match columns.remove(name) {
            None if needed => Err(wrong(format!("no \"{name}\", which its capabilities have"))),
            found => Ok(found),
        };
        let outputs = column("output", true)?.unwrap_or_default();
        let temperature = column("temperature", self.capabilities.temperature)?;
        let load = column("load", self.capabilities.load)?;
        let drives = column("drive", false)?;
        let n = outputs.len();
        if n > self.out.len() || !self.capabilities.queued && n != drive_v.len() {
            let given = if self.capabilities.queued { self.out.len() } else { drive_v.len() };
            return Err(wrong(format!("{n} samples for {given} drive samples; it has to return one for each")));
        }
        let named = [
            ("output", Some(&outputs)),
            ("temperature", temperature.as_ref()),
            ("load", load.as_ref()),
            ("drive", drives.as_ref()),
        ];
        for (name, values) in named.into_iter().filter_map(|(name, values)| Some((name, values?))) {
            if values.len() != n {
                return Err(wrong(format!("{} values of \"{name}\" beside {n} of \"output\"", values.len())));
            }
            if let Some(k) = values.iter().position(|value| !value.is_finite()) {
                return Err(wrong(format!("{} as \"{name}\" of sample {k}; it has to be a number", values[k])));
            }
        }
        let mut samples = Vec::with_capacity(n);
        for (k, output) in outputs.into_iter().enumerate() {
            let drive_v = self.out.pop_front().unwrap_or(self.present_v);
            self.done += 1;
            samples.push(Sample {
                time_s: self.done as f64 / rate_hz,
                drive_v: drives.as_ref().map_or(drive_v, |drives| drives[k]),
                output,
                temperature_degc: temperature.as_ref().map(|values| values[k]),
                load_n: load.as_ref().map(|values| values[k]),
                force_n: None,
            });
        }
        Ok(samples)
    }

    /// Ramps to rest and stays there for `seconds`; what is measured meanwhile is nobody's.
    fn go_to_rest(&mut self, seconds: f64) -> Result<(), HostDaqError> {
        let (rate_hz, rest_v) = (self.rate_hz.unwrap_or(1.0), self.capabilities.voltage.rest_v);
        let step = self.slew_v_per_s / rate_hz;
        let steps = ((self.present_v - rest_v).abs() / step).ceil().max(0.0) as usize;
        let from = self.present_v;
        let ramp = (1..=steps).map(|k| from + (rest_v - from) * k as f64 / steps as f64);
        let still = std::iter::repeat_n(rest_v, (seconds * rate_hz).round() as usize);
        let drives: Vec<f64> = ramp.chain(still).collect();
        // A device whose measurements make no sense is still brought to rest.
        for block in drives.chunks(self.capabilities.max_block) {
            let n = self.hand_over(block)?.map_or(0, |columns| columns.get("output").map_or(0, Vec::len));
            self.forget(n);
        }
        let began = Instant::now();
        let patience = self.deadline + Duration::try_from_secs_f64(self.out.len() as f64 / rate_hz).unwrap_or_default();
        while !self.out.is_empty() {
            let n = self.hand_over(&[])?.map_or(0, |columns| columns.get("output").map_or(0, Vec::len));
            self.forget(n);
            if n == 0 && !self.out.is_empty() {
                if began.elapsed() > patience {
                    let (device, out) = (&self.capabilities.device, self.out.len());
                    return Err(lost(format!("{device}: {out} samples have not come back")));
                }
                thread::sleep(PAUSE);
            }
        }
        Ok(())
    }

    /// Samples that have come back and are nobody's; without a queue all have.
    fn forget(&mut self, n: usize) {
        let n = if self.capabilities.queued { n.min(self.out.len()) } else { self.out.len() };
        self.out.drain(..n);
        self.done += n as u64;
    }

    /// Whether a ramp can begin where the drive is. After an `exchange` that has raised the object is asked; without an answer it is where it was before
    /// that block, of a device without a queue.
    fn knows_where_it_is(&mut self) -> bool {
        if !self.is_unsure {
            return true;
        }
        self.out.clear();
        match self.ask("capabilities", Call::Present, 0.0) {
            Ok(Answer::Present(Some(volts))) if self.capabilities.voltage.contains(volts) => {
                self.present_v = volts;
                true
            }
            _ => !self.capabilities.queued && !self.hangs,
        }
    }

    /// Calls `stop` of an object one of whose methods hangs, from another thread.
    fn stop_from_outside(&self) -> Result<(), HostDaqError> {
        let (answer, answered) = channel();
        let own = Arc::clone(&self.object);
        let spawned = thread::Builder::new().spawn(move || {
            // Nobody may wait for it any more.
            let _ = answer.send(Python::attach(|py| ask(own.bind(py), Call::Stop).map_err(|error| error.to_string())));
        });
        let device = &self.capabilities.device;
        match spawned.map(|_| answered.recv_timeout(self.deadline)) {
            Ok(Ok(Ok(_))) => Ok(()),
            Ok(Ok(Err(error))) => Err(lost(format!("{device}: stop raised: {error}"))),
            _ => Err(lost(format!("{device}: stop did not return either"))),
        }
    }
}

impl Daq for PythonDaq {
    type Error = HostDaqError;

    fn capabilities(&self) -> &Capabilities {
        &self.capabilities
    }

    fn present_v(&self) -> f64 {
        self.present_v
    }

    fn start(&mut self, rate_hz: f64) -> Result<f64, HostDaqError> {
        let Capabilities { min_rate_hz, max_rate_hz, .. } = self.capabilities;
        if !(min_rate_hz..=max_rate_hz).contains(&rate_hz) {
            let message =
                format!("{}: {rate_hz} Hz is outside {min_rate_hz} to {max_rate_hz} Hz", self.capabilities.device);
            return Err(HostDaqError { message, refused: true });
        }
        let Answer::Rate(actual_hz) = self.ask("start", Call::Start(rate_hz), 0.0)? else { return Ok(rate_hz) };
        // The clock runs, whatever is wrong with its rate.
        self.rate_hz = Some(if actual_hz > 0.0 && actual_hz.is_finite() { actual_hz } else { rate_hz });
        Ok(actual_hz)
    }

    fn exchange(&mut self, drive_v: &[f64], measured: &mut Vec<Sample>) -> Result<usize, HostDaqError> {
        let range = self.capabilities.voltage;
        if let Some(k) = drive_v.iter().position(|volts| !range.contains(*volts)) {
            let message = format!(
                "{}: drive sample {k} is {} V, outside {} to {} V",
                self.capabilities.device, drive_v[k], range.min_v, range.max_v
            );
            return Err(HostDaqError { message, refused: true });
        }
        let began = Instant::now();
        loop {
            measured.extend(self.pass(drive_v)?);
            // With nothing to hand over it waits for a sample.
            if !drive_v.is_empty() || !measured.is_empty() || self.out.is_empty() || began.elapsed() > self.deadline {
                return Ok(drive_v.len());
            }
            thread::sleep(PAUSE);
        }
    }

    fn rest(&mut self, seconds: f64) -> Result<(), HostDaqError> {
        self.go_to_rest(seconds)
    }

    fn stop(&mut self) -> Result<(), HostDaqError> {
        if self.hangs {
            return self.stop_from_outside();
        }
        if self.rate_hz.is_some() && self.knows_where_it_is() {
            // A device that has raised may still take a ramp; where it does not, `stop` has to do.
            let _ = self.go_to_rest(0.0);
        }
        self.rate_hz = None;
        self.out.clear();
        if self.hangs { self.stop_from_outside() } else { self.ask("stop", Call::Stop, 0.0).map(|_| ()) }
    }
}

impl HostDaq for PythonDaq {
    fn gentle(&mut self, slew_v_per_s: f64) {
        self.slew_v_per_s = slew_v_per_s.min(self.capabilities.max_slew_v_per_s);
    }
}

fn lost(message: String) -> HostDaqError {
    HostDaqError { message, refused: false }
}

/// Calls a method of the object.
fn ask(object: &Bound<'_, PyAny>, call: Call) -> PyResult<Answer> {
    match call {
        Call::Start(rate_hz) => {
            let told = object.call_method1("start", (rate_hz,))?;
            Ok(Answer::Rate(if told.is_none() { rate_hz } else { told.extract()? }))
        }
        Call::Exchange(drive) => {
            let drive = PyArray1::from_vec(object.py(), drive);
            let told = object.call_method1("exchange", (drive,))?;
            Ok(columns(&told).map_or_else(Answer::Nonsense, Answer::Columns))
        }
        Call::Present => Ok(Answer::Present(object.call_method0("capabilities")?.getattr("present_v")?.extract()?)),
        Call::Stop => object.call_method0("stop").map(|_| Answer::Stopped),
    }
}

/// What `exchange` has returned: the outputs, or a mapping.
fn columns(told: &Bound<'_, PyAny>) -> PyResult<BTreeMap<&'static str, Vec<f64>>> {
    let Ok(mapping) = told.cast::<PyMapping>() else {
        return Ok(BTreeMap::from([("output", numbers(told, "output")?)]));
    };
    let mut found = BTreeMap::new();
    for name in ["output", "drive", "temperature", "load"] {
        if mapping.contains(name)? {
            found.insert(name, numbers(&mapping.get_item(name)?, name)?);
        }
    }
    Ok(found)
}

fn numbers(values: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<f64>> {
    let numpy = values.py().import("numpy")?;
    let made = numpy.call_method1("atleast_1d", (values,)).and_then(|array| array.call_method1("astype", ("float64",)));
    let array: Result<PyReadonlyArray1<'_, f64>, _> = made.and_then(|array| array.extract());
    match array {
        Ok(array) => Ok(array.as_array().to_vec()),
        Err(_) => Err(PyTypeError::new_err(format!(
            "exchange returned {} as \"{name}\"; it has to be a one-dimensional array of numbers",
            values.get_type().name()?
        ))),
    }
}

/// The capabilities, the voltage that is put out, and how long a call may take.
fn capabilities(told: &Bound<'_, PyAny>) -> PyResult<(Capabilities, f64, Duration)> {
    let number = |name: &str| -> PyResult<f64> {
        told.getattr(name)?.extract().map_err(|_| PyTypeError::new_err(format!("capabilities: {name} is not a number")))
    };
    let flag = |name: &str| -> PyResult<bool> { told.getattr(name)?.extract() };
    let voltage = VoltageRange { min_v: number("min_v")?, max_v: number("max_v")?, rest_v: number("rest_v")? };
    let wrong = |what: String| Err(PyValueError::new_err(format!("capabilities: {what}")));
    if !(voltage.min_v.is_finite() && voltage.max_v.is_finite() && voltage.min_v < voltage.max_v) {
        return wrong(format!("the voltages {} to {} V are no range", voltage.min_v, voltage.max_v));
    }
    if !voltage.contains(voltage.rest_v) {
        return wrong(format!("rest_v = {} V is outside {} to {} V", voltage.rest_v, voltage.min_v, voltage.max_v));
    }
    let present = told.getattr("present_v")?;
    let present_v = if present.is_none() { voltage.rest_v } else { present.extract()? };
    if !voltage.contains(present_v) {
        return wrong(format!("present_v = {present_v} V is outside {} to {} V", voltage.min_v, voltage.max_v));
    }
    let column: String = told.getattr("output")?.extract()?;
    let units = [OutputUnit::Micrometre, OutputUnit::Nanometre, OutputUnit::Millimetre, OutputUnit::Newton];
    let Some(output) = units.into_iter().find(|unit| unit.column() == column) else {
        return wrong(format!("output = {column:?} is none of {}", units.map(OutputUnit::column).join(", ")));
    };
    let (min_rate_hz, max_rate_hz, slew) =
        (number("min_rate_hz")?, number("max_rate_hz")?, number("max_slew_v_per_s")?);
    if !(min_rate_hz > 0.0 && max_rate_hz >= min_rate_hz && slew > 0.0) {
        return wrong("rates and slew have to be greater than 0, and max_rate_hz not below min_rate_hz".to_owned());
    }
    let max_block: usize = told.getattr("max_block")?.extract()?;
    let seconds = number("deadline_s")?;
    let Some(deadline) = Duration::try_from_secs_f64(seconds).ok().filter(|_| seconds > 0.0 && max_block > 0) else {
        return wrong("deadline_s and max_block have to be greater than 0".to_owned());
    };
    let capabilities = Capabilities {
        device: told.getattr("device")?.extract()?,
        voltage,
        max_slew_v_per_s: slew,
        min_rate_hz,
        max_rate_hz,
        max_block,
        output,
        temperature: flag("temperature")?,
        load: flag("load")?,
        queued: flag("queued")?,
    };
    Ok((capabilities, present_v, deadline))
}
