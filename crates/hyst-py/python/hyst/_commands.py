"""The commands of the command line as functions of records, models and arrays.

Each function takes the options of its command as keywords, with ``_`` for ``-``: ``--max-error Y`` in
``hystctl compare --help`` is ``max_error=Y``. ``True`` sets an option without a value; a list or tuple gives several
values.
"""

from __future__ import annotations

import json
import os
import re
import signal
import sys
import tempfile
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from html import escape
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._errors import CommandError, DeviceError, InputError, RecordError
from ._hyst import Drive, Model, Record, _command, _main, read_record
from .daq import Daq

__all__ = [
    "Report",
    "Run",
    "close_loop",
    "compare",
    "devices",
    "excite",
    "export",
    "force",
    "gain",
    "info",
    "learn",
    "loop",
    "record",
    "response",
    "run",
    "separate",
]

_PathLike: TypeAlias = str | os.PathLike[str]
_AnyRecord: TypeAlias = Record | _PathLike
_Records: TypeAlias = _AnyRecord | Sequence[_AnyRecord]


_PACKAGE = os.path.dirname(__file__)
#: Prefix of the temporary folder of a call.
_PREFIX = "hyst-call-"
#: Path of such a folder in a text.
_TEMPORARY = re.compile(rf"[^\s\"']*{_PREFIX}[^/\\\s\"']*[/\\]+")
#: Exit code for a lost device or for data at risk.
DEVICE_LOST = 3


class Report(Mapping[str, Any]):
    """Report of a command: its text (``print(report)``) and the content of ``--json`` (``report["rows"]``).

    ``columns`` contains the columns of the file that the command line writes with ``-o``, if there is one.
    """

    def __init__(self, text: str, content: Mapping[str, Any], columns: Mapping[str, NDArray[np.float64]]) -> None:
        self.text = text
        self.columns = dict(columns)
        self._content = dict(content)

    def __getitem__(self, name: str) -> Any:
        return self._content[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._content)

    def __len__(self) -> int:
        return len(self._content)

    def __repr__(self) -> str:
        return self.text

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self.text)}</pre>"


class Run(Report):
    """Report of a run, with the measured ``record``."""

    def __init__(
        self, text: str, content: Mapping[str, Any], columns: Mapping[str, NDArray[np.float64]], record: Record
    ) -> None:
        super().__init__(text, content, columns)
        self.record = record


class _Files:
    """File arguments of a command. Objects are written to temporary files."""

    def __init__(self, folder: str) -> None:
        self._folder = Path(folder)
        self._used: set[str] = set()

    def new(self, name: str) -> Path:
        """Returns an unused path with a name like ``name``."""
        stem, ending = os.path.splitext(os.path.basename(name))
        k = 1
        while name in self._used:
            k += 1
            name = f"{stem}-{k}{ending}"
        self._used.add(name)
        return self._folder / name

    def record(self, given: _AnyRecord) -> str:
        if not isinstance(given, Record):
            return os.fspath(given)
        path = self.new("record.npy")
        given.save(path)
        return str(path)

    def records(self, given: _Records) -> list[str]:
        if isinstance(given, (Record, str, os.PathLike)):
            given = [given]
        return [self.record(one) for one in given]

    def model(self, given: Model | _PathLike) -> str:
        if not isinstance(given, Model):
            return os.fspath(given)
        path = self.new("model.json")
        given.save(path)
        return str(path)

    def signal(self, given: ArrayLike | _AnyRecord | Drive, rate: float | None, column: str) -> str:
        """Returns the file of a drive or reference: a file, a record, or values at ``rate`` [Hz]."""
        if isinstance(given, (str, os.PathLike, Record)):
            return self.record(given)
        if isinstance(given, Drive):
            made = Record(given.timepts, given.inputs, name="drive")
        else:
            values = np.asarray(given, float)
            if rate is None:
                raise InputError("an array has no times: give rate= [Hz]")
            times = np.arange(len(values)) / rate
            made = Record(times, values) if column == "voltage_v" else Record(times, None, values, output_column=column)
        path = self.new("drive.csv" if column == "voltage_v" else "reference.csv")
        made.save(path)
        return str(path)


@contextmanager
def _files() -> Iterator[_Files]:
    with tempfile.TemporaryDirectory(prefix=_PREFIX) as folder:
        yield _Files(folder)


def _options(options: Mapping[str, Any]) -> list[str]:
    """Converts keywords to options of the command line."""
    arguments: list[str] = []
    for name, value in options.items():
        option = "--" + name.rstrip("_").replace("_", "-")
        if value is None or value is False:
            continue
        if value is True:
            arguments.append(option)
        elif isinstance(value, Mapping):
            arguments += [f"{option}={key}={column}" for key, column in value.items()]
        elif isinstance(value, (list, tuple)):
            arguments.append(f"{option}=" + ",".join(str(part) for part in value))
        else:
            arguments.append(f"{option}={os.fspath(value) if isinstance(value, os.PathLike) else value}")
    return arguments


def _without_folder(text: str) -> str:
    """Removes the temporary folder from paths in a text."""
    return _TEMPORARY.sub("", text)


def _say(line: str) -> None:
    """Warns with a line that the command line prints to stderr."""
    # Notes about temporary files are omitted.
    if _TEMPORARY.search(line) and ("existed and was renamed to" in line or "saved in" in line):
        return
    level, frame = 1, sys._getframe()
    # Warn with the line of the caller.
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_PACKAGE):
        level, frame = level + 1, frame.f_back
    warnings.warn(_without_folder(line).removeprefix("note: "), UserWarning, stacklevel=level)


def _call(arguments: Sequence[str], daq: object = None) -> tuple[str, dict[str, Any], bytes]:
    """Runs a command and returns its text, its JSON content and its other output to stdout."""
    code, error, text, content, stdout, raised, interrupt = _command(list(arguments), daq, _say)
    error = _without_folder(error or f"ended with {code}")
    if interrupt is not None:
        # A device that may still be driven has priority over the exception that ended the run.
        if code == DEVICE_LOST:
            raise DeviceError(error) from interrupt
        raise interrupt
    if raised is not None:
        if hasattr(raised, "add_note"):
            raised.add_note(error)
        raise raised
    if code:
        raise {2: InputError, DEVICE_LOST: DeviceError}.get(code, CommandError)(error)
    return _without_folder(text), json.loads(_without_folder(content)) if content else {}, stdout


def _columns(path: Path) -> dict[str, NDArray[np.float64]]:
    """Reads the columns of a result file. A missing number becomes nan."""
    if not path.exists():
        return {}
    with path.open(encoding="utf-8") as file:
        names = file.readline().strip().split(",")
    values = np.genfromtxt(path, delimiter=",", skip_header=1, ndmin=2)
    return {name: values[:, k] for k, name in enumerate(names)}


def _reported(command: Sequence[str], options: Mapping[str, Any], files: _Files, *, writes: bool = False) -> Report:
    """Runs a command on files. ``writes``: whether it writes a result file."""
    arguments = [*command, *_options(options)]
    path = files.new("result.csv")
    if writes:
        arguments += ["-o", str(path)]
    text, content, _ = _call(arguments)
    return Report(text, content, _columns(path))


def info(path: _AnyRecord, **options: Any) -> Report:
    """Reports format, channels, units, rate, noise and problems of a file (``hystctl info``)."""
    with _files() as files:
        return _reported(["info", files.record(path)], options, files)


def compare(records: _Records, *, test: _AnyRecord | None = None, models: Sequence[str] | str = "all", **options: Any) -> Report:
    """Fits every model to a record and compares them (``hystctl compare``)."""
    with _files() as files:
        options |= {"models": models, "test": None if test is None else files.record(test)}
        return _reported(["compare", *files.records(records)], options, files)


def excite(kind: str, *, output: _PathLike | None = None, **options: Any) -> Record:
    """Creates a drive for identification or test of an actuator (``hystctl excite``).

    Parameters
    ----------
    kind : str
        ``identification``, ``sine``, ``sweep`` and the others that ``hystctl excite --help`` lists.
    output : path, optional
        File to write the drive to; by default it is only returned.
    """
    return _drive(["excite", kind], output, options)


def separate(effect: str, other: str, *, output: _PathLike | None = None, **options: Any) -> Record:
    """Creates a drive whose record distinguishes two effects (``hystctl excite separate``)."""
    return _drive(["excite", "separate", effect, other], output, options)


def _drive(command: Sequence[str], output: _PathLike | None, options: Mapping[str, Any]) -> Record:
    with _files() as files:
        path = Path(output) if output is not None else files.new("drive.csv")
        _call([*command, *_options(options), "-o", str(path)])
        return read_record(path, need="input", name=str(path) if output is not None else " ".join(command))


def response(records: _Records, **options: Any) -> Report:
    """Computes frequency response, coherence and structural modes (``hystctl response``)."""
    with _files() as files:
        return _reported(["response", *files.records(records)], options, files, writes=True)


def gain(records: _Records, **options: Any) -> Report:
    """Computes gain and phase of sines over amplitude and frequency (``hystctl gain``)."""
    with _files() as files:
        return _reported(["gain", *files.records(records)], options, files, writes=True)


def loop(record: _AnyRecord, *, phase: float, **options: Any) -> Report:
    """Computes width and straightness of a loop, with and without the structure's phase [deg] (``hystctl loop``)."""
    with _files() as files:
        options |= {"phase": phase}
        return _reported(["loop", files.record(record)], options, files, writes=True)


def force(record: _AnyRecord, model: Model | _PathLike, *, free: _AnyRecord | None = None, **options: Any) -> Report:
    """Estimates an external force without a force sensor (``hystctl force``); ``columns`` contains it [N]."""
    with _files() as files:
        options |= {"model": files.model(model), "free": None if free is None else files.record(free)}
        return _reported(["force", files.record(record)], options, files, writes=True)


def export(model: Model | _PathLike, format: Literal["c", "rust", "postcard"], *, name: str | None = None) -> bytes:
    """Returns model parameters for a board: C header, Rust source or a block of bytes (``hystctl export``)."""
    with _files() as files:
        path = files.new("export")
        _call(["export", files.model(model), *_options({"format": format, "name": name}), "-o", str(path)])
        return path.read_bytes()


def devices() -> Report:
    """Lists serial ports and CAN interfaces (``hystctl devices``)."""
    text, content, stdout = _call(["devices"])
    return Report(text or stdout.decode().rstrip(), content, {})


def _device(daq: Daq | _PathLike) -> tuple[list[str], Daq | None]:
    """Returns the option ``--daq``, and the device if it is a Python object."""
    if isinstance(daq, (str, os.PathLike)):
        return ["--daq", os.fspath(daq)], None
    return ["--daq", "host:"], daq


def run(
    daq: Daq | str,
    *,
    drive: ArrayLike | _AnyRecord | Drive | None = None,
    reference: ArrayLike | _AnyRecord | None = None,
    model: Model | _PathLike | None = None,
    rate: float | None = None,
    record: _PathLike | None = None,
    log: _PathLike | None = None,
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
    with _files() as files:
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
            text, content, _ = _call(["run", *device, *_options(options)], own)
        except BaseException as error:
            # The rows measured so far; a log contains more.
            with suppress(RecordError):
                error.record = _measured(path, None) if record is None and path.exists() else None  # type: ignore[attr-defined]
            raise
        if record is None:
            content.pop("record", None)
        measured = _measured(path, record)
        return Run(_without(text, path if record is None else None), content, _columns(path), measured)


def learn(
    daq: Daq | str,
    model: Model | _PathLike,
    reference: ArrayLike | _AnyRecord,
    *,
    rate: float | None = None,
    output: _PathLike | None = None,
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
    with _files() as files:
        device, own = _device(daq)
        path = Path(output) if output is not None else files.new("learned.csv")
        column = output_column or (model.output_column if isinstance(model, Model) else "displacement_um")
        options |= {"model": files.model(model), "reference": files.signal(reference, rate, column), "output": path}
        before = path.stat().st_mtime_ns if path.exists() else None
        try:
            text, content, _ = _call(["learn", *device, *_options(options)], own)
        except BaseException as error:
            # An older file of this name is not from this run.
            fresh = path.exists() and path.stat().st_mtime_ns != before
            error.columns = _columns(path) if fresh else None  # type: ignore[attr-defined]
            raise
        if output is None:
            content.pop("output", None)
        return Report(_without(text, path if output is None else None), content, _columns(path))


def record(daq: Daq | str, seconds: float, *, output: _PathLike | None = None, **options: Any) -> Run:
    """Records the sensors while nothing moves (``hystctl record``)."""
    with _files() as files:
        device, own = _device(daq)
        path = Path(output) if output is not None else files.new("measured.csv")
        options |= {"seconds": seconds}
        text, content, _ = _call(["record", *device, *_options(options), "-o", str(path)], own)
        return Run(_without(text, path if output is None else None), content, _columns(path), _measured(path, output))


def close_loop(daq: str, out: _PathLike, **options: Any) -> Report:
    """Repeats experiment, fit, diagnosis and compensation until no effect is found (``hystctl close-loop``)."""
    text, content, _ = _call(["close-loop", "--daq", daq, *_options({**options, "out": out})])
    return Report(text, content, {})


def _measured(path: Path, kept: _PathLike | None) -> Record:
    """Reads the record of a run."""
    return read_record(path, name=None if kept is not None else "measured")


def _without(text: str, path: Path | None) -> str:
    """Returns a report without the lines about a temporary file."""
    return text if path is None else "\n".join(line for line in text.splitlines() if str(path) not in line)


def main() -> None:
    """Runs the command line ``hystctl``."""
    # The handler of Python would wait for the end of the command.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(_main(["hystctl", *sys.argv[1:]]))
