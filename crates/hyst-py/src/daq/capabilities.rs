//! The capabilities of the Python object, checked.

use std::time::Duration;

use hyst_hw::{Capabilities, OutputUnit, VoltageRange};
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;

/// Reads the return value of `capabilities`: the capabilities, the present voltage, and the deadline of a call.
pub(super) fn capabilities(returned: &Bound<'_, PyAny>) -> PyResult<(Capabilities, f64, Duration)> {
    let number = |name: &str| -> PyResult<f64> {
        returned
            .getattr(name)?
            .extract()
            .map_err(|_| PyTypeError::new_err(format!("capabilities: {name} is not a number")))
    };
    let flag = |name: &str| -> PyResult<bool> { returned.getattr(name)?.extract() };
    let voltage = VoltageRange { min_v: number("min_v")?, max_v: number("max_v")?, rest_v: number("rest_v")? };
    let wrong = |what: String| Err(PyValueError::new_err(format!("capabilities: {what}")));
    if !(voltage.min_v.is_finite() && voltage.max_v.is_finite() && voltage.min_v < voltage.max_v) {
        return wrong(format!(
            "the voltages {} to {} V are no range; give finite voltages with min_v below max_v",
            voltage.min_v, voltage.max_v
        ));
    }
    if !voltage.contains(voltage.rest_v) {
        return wrong(format!("rest_v = {} V is outside {} to {} V", voltage.rest_v, voltage.min_v, voltage.max_v));
    }
    let present = returned.getattr("present_v")?;
    let present_v = if present.is_none() { voltage.rest_v } else { present.extract()? };
    if !voltage.contains(present_v) {
        return wrong(format!("present_v = {present_v} V is outside {} to {} V", voltage.min_v, voltage.max_v));
    }
    let column: String = returned.getattr("output")?.extract()?;
    let units = [OutputUnit::Micrometre, OutputUnit::Nanometre, OutputUnit::Millimetre, OutputUnit::Newton];
    let Some(output) = units.into_iter().find(|unit| unit.column() == column) else {
        return wrong(format!("output = {column:?}; expected one of {}", units.map(OutputUnit::column).join(", ")));
    };
    let (min_rate_hz, max_rate_hz, slew) =
        (number("min_rate_hz")?, number("max_rate_hz")?, number("max_slew_v_per_s")?);
    if !(min_rate_hz > 0.0 && max_rate_hz >= min_rate_hz && slew > 0.0) {
        return wrong("rates and slew must be greater than 0, and max_rate_hz at least min_rate_hz".to_owned());
    }
    let max_block: usize = returned.getattr("max_block")?.extract()?;
    let seconds = number("deadline_s")?;
    let Some(deadline) = Duration::try_from_secs_f64(seconds).ok().filter(|_| seconds > 0.0 && max_block > 0) else {
        return wrong("deadline_s and max_block must be greater than 0".to_owned());
    };
    let capabilities = Capabilities {
        device: returned.getattr("device")?.extract()?,
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
