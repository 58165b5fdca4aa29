"""The package ``nidaqmx`` of National Instruments: its import, and advice on its errors."""

from __future__ import annotations

import importlib
from typing import Any, cast

__all__ = ["ADVICE", "advice", "cause_of", "vendor"]

_SAMPLES_NOT_YET_AVAILABLE = -200284
_RAN_DRY = "the drive queue ran dry, because no samples were handed over in time: give a larger queue_s (now {queue_s:g} s) or a lower rate"
_TOO_FAST = "the card cannot convert this fast: give a lower rate, or leave out the monitor or temperature input"
_NOT_READ = "measured samples were lost, because they were not read in time: give a lower rate"
_IN_USE = "another program or task uses the card: close it, for example the test panel of NI MAX"
_NO_DEVICE = "there is no such device or channel: compare the names with those in NI MAX, and check power and cable"
#: What to do about an error, by its code in ``nidaqmx.error_codes.DAQmxErrors``.
ADVICE = {
    -200290: _RAN_DRY,
    -200291: _RAN_DRY,
    -200462: _RAN_DRY,
    -200621: _RAN_DRY,
    -200016: _RAN_DRY,
    -200018: _RAN_DRY,
    -200294: "the card wants more samples before it starts: give a larger queue_s (now {queue_s:g} s)",
    -200019: _TOO_FAST,
    -200081: _TOO_FAST,
    -200332: _TOO_FAST,
    -200010: _NOT_READ,
    -200279: _NOT_READ,
    -200361: _NOT_READ,
    _SAMPLES_NOT_YET_AVAILABLE: "no sample came in: check that the clock terminal {terminal} exists (NI MAX, Device Routes), or give clock",
    -50103: _IN_USE,
    -200022: _IN_USE,
    -200170: _NO_DEVICE,
    -200220: _NO_DEVICE,
    -200324: _NO_DEVICE,
    -201003: _NO_DEVICE,
    -89120: "the card has no clock terminal {terminal}: give clock, for example clock='/cDAQ1/ao/SampleClock'",
    -89136: "the inputs cannot use the clock terminal {terminal}: use an output and inputs of one card, or give clock",
    -200077: "the card does not support a value: compare voltage range, input_range_v and rate with its data sheet",
    -200561: "a voltage is beyond what the card puts out: check amplifier_gain, min_v and max_v",
}


def vendor() -> Any:
    """Imports the package ``nidaqmx`` as ``Any``, because it has no type stubs."""
    try:
        for module in ("constants", "errors", "stream_readers", "stream_writers"):
            importlib.import_module(f"nidaqmx.{module}")
        return importlib.import_module("nidaqmx")
    except ImportError as error:
        raise ImportError("hyst.daq.ni needs the package nidaqmx: pip install nidaqmx (and the driver NI-DAQmx from ni.com)") from error


def cause_of(ni: Any, error: Exception, output: Any) -> Exception:
    """Why no sample came in: the error of the task ``output`` if it has one, because the inputs use its clock."""
    if getattr(error, "error_code", None) == _SAMPLES_NOT_YET_AVAILABLE and output is not None:
        try:
            output.is_task_done()
        except ni.errors.Error as of_output:
            return cast(Exception, of_output)
    return error


def advice(error: Exception, queue_s: float, terminal: str) -> str:
    """What is wrong and what to do, then the driver's words.

    ``queue_s`` is the present length of the queue [s], ``terminal`` the terminal of the sample clock.
    """
    code = getattr(error, "error_code", None)
    unknown = "install the driver NI-DAQmx from ni.com" if code is None else "look up this error in the help of NI-DAQmx"
    text = ADVICE.get(code or 0, unknown).format(queue_s=queue_s, terminal=terminal)
    return f"{text}. NI-DAQmx: {' '.join(str(error).split())}"
