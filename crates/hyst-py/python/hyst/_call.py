"""Calls of the command line with options, warnings and errors of Python."""

from __future__ import annotations

import json
import os
import sys
import warnings
from collections.abc import Mapping, Sequence
from typing import Any

from ._errors import CommandError, DeviceError, InputError
from ._files import TEMPORARY, without_folder
from ._hyst import _command

_PACKAGE = os.path.dirname(__file__)
#: Exit code for a lost device or for data at risk.
DEVICE_LOST = 3


def options_of(options: Mapping[str, Any]) -> list[str]:
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


def _say(line: str) -> None:
    """Warns with a line that the command line prints to stderr."""
    # Notes about temporary files are omitted.
    if TEMPORARY.search(line) and ("existed and was renamed to" in line or "saved in" in line):
        return
    level, frame = 1, sys._getframe()
    # Warn with the line of the caller.
    while frame.f_back is not None and frame.f_code.co_filename.startswith(_PACKAGE):
        level, frame = level + 1, frame.f_back
    warnings.warn(without_folder(line).removeprefix("note: "), UserWarning, stacklevel=level)


def call(arguments: Sequence[str], daq: object = None) -> tuple[str, dict[str, Any], bytes]:
    """Runs a command and returns its text, its JSON content and its other output to stdout."""
    code, error, text, content, stdout, raised, interrupt = _command(list(arguments), daq, _say)
    error = without_folder(error or f"ended with {code}")
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
    return without_folder(text), json.loads(without_folder(content)) if content else {}, stdout
