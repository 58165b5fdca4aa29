//! Runs commands of the command line within Python, without a process and without parsing of printed text.

use std::ffi::OsString;
use std::sync::Arc;

use hyst_cli::host::{Ended, Host, HostDaq, command as run_command};
use pyo3::prelude::*;
use pyo3::types::PyBytes;

use crate::daq::PythonDaq;
use crate::interrupt::until_interrupted;

/// Runs one command: its arguments without the name of the program, the device for ``--daq host:``, and a function that
/// is called with each line that the command line prints to stderr.
///
/// Returns the exit code, the error message, the report as text and as JSON, the other output to stdout, the exception
/// of the device, and the exception that ended the command (of a signal or of ``say``).
#[pyfunction]
#[pyo3(signature = (arguments, daq=None, say=None))]
#[allow(clippy::type_complexity, reason = "a tuple for Python")]
pub(crate) fn _command<'py>(
    py: Python<'py>,
    arguments: Vec<String>,
    daq: Option<Py<PyAny>>,
    say: Option<Py<PyAny>>,
) -> PyResult<(u8, Option<String>, String, Option<String>, Bound<'py, PyBytes>, Option<Py<PyAny>>, Option<Py<PyAny>>)> {
    let device = daq.map(|daq| PythonDaq::new(py, daq)).transpose()?;
    let raised = device.as_ref().map(PythonDaq::raised);
    let arguments = std::iter::once("hystctl".to_owned()).chain(arguments).map(OsString::from);
    let work = move |stop: &Arc<_>, lines: std::sync::mpsc::Sender<String>| {
        let daq = device.map(|daq| Box::new(daq) as Box<dyn HostDaq>);
        let say = Box::new(move |line: &str| {
            // Fails if the receiver has ended; the line is then not needed.
            let _ = lines.send(line.to_owned());
        });
        run_command(arguments, Host { daq, stop: Arc::clone(stop), say: Some(say) })
    };
    let forward = |py: Python<'_>, line: String| match &say {
        Some(say) => say.call1(py, (line,)).map(|_| ()),
        None => Ok(()),
    };
    let (Ended { exit, error, text, json, stdout }, interrupt) = until_interrupted(py, work, forward)?;
    let raised = raised.and_then(|raised| raised.lock().ok()?.take());
    let value = |error: PyErr| error.into_value(py).into_any();
    let (raised, interrupt) = (raised.map(value), interrupt.map(value));
    Ok((exit, error, text, json.map(|json| json.to_string()), PyBytes::new(py, &stdout), raised, interrupt))
}

/// Runs the command line with these arguments, the first of which is the name of the program, and returns its exit
/// code.
#[pyfunction]
pub(crate) fn _main(py: Python<'_>, arguments: Vec<String>) -> u8 {
    py.detach(|| hyst_cli::run(arguments.into_iter().map(OsString::from)))
}
