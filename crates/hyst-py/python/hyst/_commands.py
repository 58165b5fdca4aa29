"""The commands of the command line as functions of records, models and arrays.

Each function takes the options of its command as keywords, with ``_`` for ``-``: ``--max-error Y`` in
``hystctl compare --help`` is ``max_error=Y``. ``True`` sets an option without a value; a list or tuple gives several
values.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from ._call import call, options_of
from ._device_commands import close_loop, learn, record, run
from ._files import AnyRecord, Files, PathLike, Records, temporary_files
from ._hyst import Model, Record, _main, read_record
from ._report import Report, Run, columns_of

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


def _reported(command: Sequence[str], options: Mapping[str, Any], files: Files, *, writes: bool = False) -> Report:
    """Runs a command on files. ``writes``: whether it writes a result file."""
    arguments = [*command, *options_of(options)]
    path = files.new("result.csv")
    if writes:
        arguments += ["-o", str(path)]
    text, content, _ = call(arguments)
    return Report(text, content, columns_of(path))


def info(path: AnyRecord, **options: Any) -> Report:
    """Reports format, channels, units, rate, noise and problems of a file (``hystctl info``)."""
    with temporary_files() as files:
        return _reported(["info", files.record(path)], options, files)


def compare(records: Records, *, test: AnyRecord | None = None, models: Sequence[str] | str = "all", **options: Any) -> Report:
    """Fits every model to a record and compares them (``hystctl compare``)."""
    with temporary_files() as files:
        options |= {"models": models, "test": None if test is None else files.record(test)}
        return _reported(["compare", *files.records(records)], options, files)


def excite(kind: str, *, output: PathLike | None = None, **options: Any) -> Record:
    """Creates a drive for identification or test of an actuator (``hystctl excite``).

    Parameters
    ----------
    kind : str
        ``identification``, ``sine``, ``sweep`` and the others that ``hystctl excite --help`` lists.
    output : path, optional
        File to write the drive to; by default it is only returned.
    """
    return _drive(["excite", kind], output, options)


def separate(effect: str, other: str, *, output: PathLike | None = None, **options: Any) -> Record:
    """Creates a drive whose record distinguishes two effects (``hystctl excite separate``)."""
    return _drive(["excite", "separate", effect, other], output, options)


def _drive(command: Sequence[str], output: PathLike | None, options: Mapping[str, Any]) -> Record:
    with temporary_files() as files:
        path = Path(output) if output is not None else files.new("drive.csv")
        call([*command, *options_of(options), "-o", str(path)])
        return read_record(path, need="input", name=str(path) if output is not None else " ".join(command))


def response(records: Records, **options: Any) -> Report:
    """Computes frequency response, coherence and structural modes (``hystctl response``)."""
    with temporary_files() as files:
        return _reported(["response", *files.records(records)], options, files, writes=True)


def gain(records: Records, **options: Any) -> Report:
    """Computes gain and phase of sines over amplitude and frequency (``hystctl gain``)."""
    with temporary_files() as files:
        return _reported(["gain", *files.records(records)], options, files, writes=True)


def loop(record: AnyRecord, *, phase: float, **options: Any) -> Report:
    """Computes width and straightness of a loop, with and without the structure's phase [deg] (``hystctl loop``)."""
    with temporary_files() as files:
        options |= {"phase": phase}
        return _reported(["loop", files.record(record)], options, files, writes=True)


def force(record: AnyRecord, model: Model | PathLike, *, free: AnyRecord | None = None, **options: Any) -> Report:
    """Estimates an external force without a force sensor (``hystctl force``); ``columns`` contains it [N]."""
    with temporary_files() as files:
        options |= {"model": files.model(model), "free": None if free is None else files.record(free)}
        return _reported(["force", files.record(record)], options, files, writes=True)


def export(model: Model | PathLike, format: Literal["c", "rust", "postcard"], *, name: str | None = None) -> bytes:
    """Returns model parameters for a board: C header, Rust source or a block of bytes (``hystctl export``)."""
    with temporary_files() as files:
        path = files.new("export")
        call(["export", files.model(model), *options_of({"format": format, "name": name}), "-o", str(path)])
        return path.read_bytes()


def devices() -> Report:
    """Lists serial ports and CAN interfaces (``hystctl devices``)."""
    text, content, stdout = call(["devices"])
    return Report(text or stdout.decode().rstrip(), content, {})


def main() -> None:
    """Runs the command line ``hystctl``."""
    # The handler of Python would wait for the end of the command.
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    sys.exit(_main(["hystctl", *sys.argv[1:]]))
