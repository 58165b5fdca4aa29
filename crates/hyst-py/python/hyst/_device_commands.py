"""The commands that drive or read a device."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from ._call import call, options_of
from ._errors import RecordError
from ._files import AnyRecord, PathLike, temporary_files
from ._hyst import Drive, Model, Record, read_record
from ._report import Report, Run, columns_of
from .daq import Daq


def _device(daq: Daq | PathLike) -> tuple[list[str], Daq | None]:
    """Returns the option ``--daq``, and the device if it is a Python object."""
    if isinstance(daq, (str, os.PathLike)):
        return ["--daq", os.fspath(daq)], None
    return ["--daq", "host:"], daq


def run(
    daq: Daq | str,
    *,
    drive: ArrayLike | AnyRecord | Drive | None = None,
    reference: ArrayLike | AnyRecord | None = None,
    model: Model | PathLike | None = None,
    rate: float | None = None,
    record: PathLike | None = None,
    log: PathLike | None = None,
    output_column: str | None = None,
    **options: Any,
) -> Run:
    """Plays a drive, or a reference through a model, on a device and records the output (``hystctl run``).

    All arguments are checked before anything moves. The drive is ramped to the first value and back to rest. At every
    end of the run, including Ctrl-C, the drive is at rest and the log is kept.

    Parameters
    ----------
    daq : hyst.daq.Daq or str
        A Python device, or a device of the command line: ``sim:plant.toml``, ``serial:/dev/ttyACM0``, ``can:can0``, …
    drive : array, Record, Drive or path, optional
        Voltages to play [V]; an array requires ``rate``.
    reference : array, Record or path, optional
        Wanted output; requires ``model``. An array requires ``rate`` and, if it is not a displacement in µm,
        ``output_column``.
    model : Model or path, optional
        Model that computes the drive of a reference.
    rate : float, optional
        Sample rate of arrays [Hz].
    record, log : path, optional
        Files for the record and for the log (MCAP) with every sample.
    **options
        Options of ``hystctl run --help``: ``control``, ``limit=(low, high)``, ``slew``, ``max_error``, ``settle``, …

    Raises
    ------
    InputError
        If an argument is rejected. Nothing has moved.
    DeviceError
        If the device was lost or returned invalid data.
    Exception
        Exception of a Python device, after the end of the run. Its attribute ``record`` contains the measured rows
        (``None`` if there are none, or if ``record`` is a file, which then contains them).
    """
    with temporary_files() as files:
        device, own = _device(daq)
        path = Path(record) if record is not None else files.new("measured.csv")
        column = output_column or (model.output_column if isinstance(model, Model) else "displacement_um")
        options |= {
            "drive": None if drive is None else files.signal(drive, rate, "voltage_v"),
            "reference": None if reference is None else files.signal(reference, rate, column),
            "model": None if model is None else files.model(model),
            "log": log,
            "record": path,
        }
        try:
            text, content, _ = call(["run", *device, *options_of(options)], own)
        except BaseException as error:
            # The rows measured so far; a log contains more.
            with suppress(RecordError):
                error.record = _measured(path, None) if record is None and path.exists() else None  # type: ignore[attr-defined]
            raise
        if record is None:
            content.pop("record", None)
        measured = _measured(path, record)
        return Run(_without(text, path if record is None else None), content, columns_of(path), measured)


def learn(
    daq: Daq | str,
    model: Model | PathLike,
    reference: ArrayLike | AnyRecord,
    *,
    rate: float | None = None,
    output: PathLike | None = None,
    output_column: str | None = None,
    **options: Any,
) -> Report:
    """Improves the drive of a repeated reference in several measured passes (``hystctl learn``).

    ``columns`` of the report contains the best drive (``voltage_v``) and the reference, with a hold before and after
    it. ``passes`` contains RMSE and repeatability of each pass.

    Parameters
    ----------
    daq : hyst.daq.Daq or str
        As for :func:`run`.
    model : Model or path
        Model that computes the first drive.
    reference : array, Record or path
        Wanted output, one segment. An array requires ``rate`` [Hz] and, if it is not in the unit of the model,
        ``output_column``.
    output : path, optional
        File for the drive.
    **options
        Options of ``hystctl learn --help``: ``passes``, ``plays``, ``max_error``, ``limit=(low, high)``, ``slew``,
        ``logs``, ``extended``, …

    Raises
    ------
    InputError
        If an argument is rejected. Nothing has moved.
    CommandError
        If the output does not follow the reference, or learning was stopped.
    DeviceError
        If the device was lost, or a limit was exceeded.

    The attribute ``columns`` of the last two contains the best drive so far, as in the report; ``None`` before the end
    of the first pass. ``output`` also contains it.
    """
    with temporary_files() as files:
        device, own = _device(daq)
        path = Path(output) if output is not None else files.new("learned.csv")
        column = output_column or (model.output_column if isinstance(model, Model) else "displacement_um")
        options |= {"model": files.model(model), "reference": files.signal(reference, rate, column), "output": path}
        before = path.stat().st_mtime_ns if path.exists() else None
        try:
            text, content, _ = call(["learn", *device, *options_of(options)], own)
        except BaseException as error:
            # An older file of this name is not from this run.
            fresh = path.exists() and path.stat().st_mtime_ns != before
            error.columns = columns_of(path) if fresh else None  # type: ignore[attr-defined]
            raise
        if output is None:
            content.pop("output", None)
        return Report(_without(text, path if output is None else None), content, columns_of(path))


def record(daq: Daq | str, seconds: float, *, output: PathLike | None = None, **options: Any) -> Run:
    """Records the sensors while nothing moves (``hystctl record``)."""
    with temporary_files() as files:
        device, own = _device(daq)
        path = Path(output) if output is not None else files.new("measured.csv")
        options |= {"seconds": seconds}
        text, content, _ = call(["record", *device, *options_of(options), "-o", str(path)], own)
        return Run(_without(text, path if output is None else None), content, columns_of(path), _measured(path, output))


def close_loop(daq: str, out: PathLike, **options: Any) -> Report:
    """Repeats experiment, fit, diagnosis and compensation until no effect is found (``hystctl close-loop``)."""
    text, content, _ = call(["close-loop", "--daq", daq, *options_of({**options, "out": out})])
    return Report(text, content, {})


def _measured(path: Path, kept: PathLike | None) -> Record:
    """Reads the record of a run."""
    return read_record(path, name=None if kept is not None else "measured")


def _without(text: str, path: Path | None) -> str:
    """Returns a report without the lines about a temporary file."""
    return text if path is None else "\n".join(line for line in text.splitlines() if str(path) not in line)
