//! A device that is a Python object (`hyst.daq.Daq`).
//!
//! A separate thread calls its methods. If a call does not return in time, the run ends, and another thread calls
//! `stop`. All return values are checked.

mod call;
mod capabilities;

use std::collections::{BTreeMap, VecDeque};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::{Duration, Instant};

use hyst_cli::host::{HostDaq, HostDaqError};
use hyst_hw::{Capabilities, Daq, Sample};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;

use call::{Answer, Call, ask};
use capabilities::capabilities;

/// Default slew rate of the ramp to rest \[V/s\].
const DEFAULT_SLEW: f64 = 100.0;
/// Pause between two calls of a device with a queue.
const POLL_INTERVAL: Duration = Duration::from_millis(2);

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
    /// Sample rate \[Hz\] while the clock runs.
    rate_hz: Option<f64>,
    slew_v_per_s: f64,
    /// Drive samples without a measured sample yet.
    pending: VecDeque<f64>,
    /// Number of measured samples since the device was opened.
    done: u64,
    /// Whether a call has not returned in time.
    hangs: bool,
    /// Whether `exchange` has raised: it may have put out a part of its block.
    voltage_unknown: bool,
}

impl PythonDaq {
    /// Opens the device. Nothing moves.
    ///
    /// # Errors
    /// The exception of `capabilities`, or an error if its return value is invalid.
    pub(crate) fn new(py: Python<'_>, object: Py<PyAny>) -> PyResult<Self> {
        let returned = object.bind(py).call_method0("capabilities")?;
        let (capabilities, present_v, deadline) = capabilities(&returned)?;
        for method in ["start", "exchange", "stop"] {
            if !object.bind(py).getattr(method)?.is_callable() {
                return Err(PyTypeError::new_err(format!("the device's {method} is not a method")));
            }
        }
        let (object, raised) = (Arc::new(object), Raised::default());
        let (calls, received) = channel();
        let (answer, answers) = channel();
        let own = Arc::clone(&object);
        // The thread ends when the sender of the calls is dropped.
        thread::Builder::new().name("hyst daq".to_owned()).spawn(move || {
            for call in received {
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
            slew_v_per_s: capabilities.max_slew_v_per_s.min(DEFAULT_SLEW),
            capabilities,
            deadline,
            present_v,
            rate_hz: None,
            pending: VecDeque::new(),
            done: 0,
            hangs: false,
            voltage_unknown: false,
        })
    }

    /// Returns the cell that receives the exception that ends a run.
    pub(crate) fn raised(&self) -> Raised {
        Arc::clone(&self.raised)
    }

    /// Calls the object and waits for at most `seconds` plus its deadline.
    fn ask(&mut self, what: &str, call: Call, seconds: f64) -> Result<Answer, HostDaqError> {
        if self.hangs {
            return Err(lost(format!("{}: an earlier call has not returned", self.capabilities.device)));
        }
        let limit = self.deadline + Duration::try_from_secs_f64(seconds).unwrap_or_default();
        let answer = match self.calls.send(call) {
            Ok(()) => self.answers.recv_timeout(limit),
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
                    "{}: {what} did not return within {:.3} s; check what it waits for, or give a larger deadline_s",
                    self.capabilities.device,
                    limit.as_secs_f64()
                )))
            }
        }
    }

    /// Stores an exception for the caller and returns its message.
    fn keep(&self, error: PyErr) -> HostDaqError {
        let message = format!("{}: {error}", self.capabilities.device);
        // The first exception is the cause of the others.
        if let Ok(mut raised) = self.raised.lock() {
            raised.get_or_insert(error);
        }
        lost(message)
    }

    /// Passes drive samples to the object. The returned columns are not checked; `Err` contains the error of invalid
    /// ones.
    fn hand_over(&mut self, drive_v: &[f64]) -> Result<PyResult<BTreeMap<&'static str, Vec<f64>>>, HostDaqError> {
        let Some(rate_hz) = self.rate_hz else {
            return Err(lost(format!("{}: the sample clock is not running", self.capabilities.device)));
        };
        let seconds = (drive_v.len() + self.pending.len()) as f64 / rate_hz;
        let answer = self
            .ask("exchange", Call::Exchange(drive_v.to_vec()), seconds)
            .inspect_err(|_| self.voltage_unknown = true)?;
        self.pending.extend(drive_v);
        self.present_v = drive_v.last().copied().unwrap_or(self.present_v);
        Ok(match answer {
            Answer::Columns(columns) => Ok(columns),
            Answer::Invalid(error) => Err(error),
            _ => Ok(BTreeMap::new()),
        })
    }

    /// Passes drive samples to the object and returns the measured samples, checked.
    fn pass(&mut self, drive_v: &[f64]) -> Result<Vec<Sample>, HostDaqError> {
        let mut columns = self.hand_over(drive_v)?.map_err(|error| self.keep(error))?;
        let rate_hz = self.rate_hz.unwrap_or(1.0);
        let device = &self.capabilities.device;
        let wrong = |what: String| lost(format!("{device}: exchange returned {what}"));
        let mut column = |name: &str, needed: bool| match columns.remove(name) {
            None if needed => Err(wrong(format!("no \"{name}\", expected as stated by its capabilities"))),
            found => Ok(found),
        };
        let outputs = column("output", true)?.unwrap_or_default();
        let temperature = column("temperature", self.capabilities.temperature)?;
        let load = column("load", self.capabilities.load)?;
        let drives = column("drive", false)?;
        let n = outputs.len();
        if n > self.pending.len() || !self.capabilities.queued && n != drive_v.len() {
            let given = if self.capabilities.queued { self.pending.len() } else { drive_v.len() };
            return Err(wrong(format!("{n} samples for {given} drive samples; expected one for each")));
        }
        let named = [
            ("output", Some(&outputs)),
            ("temperature", temperature.as_ref()),
            ("load", load.as_ref()),
            ("drive", drives.as_ref()),
        ];
        for (name, values) in named.into_iter().filter_map(|(name, values)| Some((name, values?))) {
            if values.len() != n {
                return Err(wrong(format!(
                    "{} values of \"{name}\" and {n} of \"output\"; expected equal lengths",
                    values.len()
                )));
            }
            if let Some(k) = values.iter().position(|value| !value.is_finite()) {
                return Err(wrong(format!("{} as \"{name}\" of sample {k}; expected a finite number", values[k])));
            }
        }
        let mut samples = Vec::with_capacity(n);
        for (k, output) in outputs.into_iter().enumerate() {
            let drive_v = self.pending.pop_front().unwrap_or(self.present_v);
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

    /// Ramps to rest and holds for `seconds`. The measured samples are discarded.
    fn go_to_rest(&mut self, seconds: f64) -> Result<(), HostDaqError> {
        let (rate_hz, rest_v) = (self.rate_hz.unwrap_or(1.0), self.capabilities.voltage.rest_v);
        let step = self.slew_v_per_s / rate_hz;
        let steps = ((self.present_v - rest_v).abs() / step).ceil().max(0.0) as usize;
        let from = self.present_v;
        let ramp = (1..=steps).map(|k| from + (rest_v - from) * k as f64 / steps as f64);
        let hold = std::iter::repeat_n(rest_v, (seconds * rate_hz).round() as usize);
        let drives: Vec<f64> = ramp.chain(hold).collect();
        // A device that returns invalid measurements is also ramped to rest.
        for block in drives.chunks(self.capabilities.max_block) {
            let n = self.hand_over(block)?.map_or(0, |columns| columns.get("output").map_or(0, Vec::len));
            self.discard(n);
        }
        let began = Instant::now();
        let limit =
            self.deadline + Duration::try_from_secs_f64(self.pending.len() as f64 / rate_hz).unwrap_or_default();
        while !self.pending.is_empty() {
            let n = self.hand_over(&[])?.map_or(0, |columns| columns.get("output").map_or(0, Vec::len));
            self.discard(n);
            if n == 0 && !self.pending.is_empty() {
                if began.elapsed() > limit {
                    let (device, pending) = (&self.capabilities.device, self.pending.len());
                    return Err(lost(format!("{device}: {pending} samples were not returned")));
                }
                thread::sleep(POLL_INTERVAL);
            }
        }
        Ok(())
    }

    /// Discards `n` measured samples; without a queue, all that are pending.
    fn discard(&mut self, n: usize) {
        let n = if self.capabilities.queued { n.min(self.pending.len()) } else { self.pending.len() };
        self.pending.drain(..n);
        self.done += n as u64;
    }

    /// Returns whether the present voltage is known, so that a ramp can start. After an exception of `exchange` the
    /// object is asked for it. If it does not answer, a device without a queue counts as at the voltage before that
    /// block.
    fn knows_voltage(&mut self) -> bool {
        if !self.voltage_unknown {
            return true;
        }
        self.pending.clear();
        match self.ask("capabilities", Call::Present, 0.0) {
            Ok(Answer::Present(Some(volts))) if self.capabilities.voltage.contains(volts) => {
                self.present_v = volts;
                true
            }
            _ => !self.capabilities.queued && !self.hangs,
        }
    }

    /// Calls `stop` from another thread, for an object with a method that hangs.
    fn stop_on_other_thread(&self) -> Result<(), HostDaqError> {
        let (answer, answered) = channel();
        let own = Arc::clone(&self.object);
        let spawned = thread::Builder::new().spawn(move || {
            // The receiver may have timed out.
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
        // The clock runs, even if the returned rate is invalid.
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
            // Without drive samples, wait for a measured sample.
            if !drive_v.is_empty() || !measured.is_empty() || self.pending.is_empty() || began.elapsed() > self.deadline
            {
                return Ok(drive_v.len());
            }
            thread::sleep(POLL_INTERVAL);
        }
    }

    fn rest(&mut self, seconds: f64) -> Result<(), HostDaqError> {
        self.go_to_rest(seconds)
    }

    fn stop(&mut self) -> Result<(), HostDaqError> {
        if self.hangs {
            return self.stop_on_other_thread();
        }
        if self.rate_hz.is_some() && self.knows_voltage() {
            // A device that has raised may still accept a ramp. If it does not, only `stop` remains.
            let _ = self.go_to_rest(0.0);
        }
        self.rate_hz = None;
        self.pending.clear();
        if self.hangs { self.stop_on_other_thread() } else { self.ask("stop", Call::Stop, 0.0).map(|_| ()) }
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
