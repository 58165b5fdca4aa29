"""File arguments of a command: records, models and signals, which are written to temporary files."""

from __future__ import annotations

import os
import re
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from ._errors import InputError
from ._hyst import Drive, Model, Record

PathLike: TypeAlias = str | os.PathLike[str]
AnyRecord: TypeAlias = Record | PathLike
Records: TypeAlias = AnyRecord | Sequence[AnyRecord]

#: Prefix of the temporary folder of a call.
_PREFIX = "hyst-call-"
#: Path of such a folder in a text.
TEMPORARY = re.compile(rf"[^\s\"']*{_PREFIX}[^/\\\s\"']*[/\\]+")


class Files:
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

    def record(self, given: AnyRecord) -> str:
        if not isinstance(given, Record):
            return os.fspath(given)
        path = self.new("record.npy")
        given.save(path)
        return str(path)

    def records(self, given: Records) -> list[str]:
        if isinstance(given, (Record, str, os.PathLike)):
            given = [given]
        return [self.record(one) for one in given]

    def model(self, given: Model | PathLike) -> str:
        if not isinstance(given, Model):
            return os.fspath(given)
        path = self.new("model.json")
        given.save(path)
        return str(path)

    def signal(self, given: ArrayLike | AnyRecord | Drive, rate: float | None, column: str) -> str:
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
def temporary_files() -> Iterator[Files]:
    with tempfile.TemporaryDirectory(prefix=_PREFIX) as folder:
        yield Files(folder)


def without_folder(text: str) -> str:
    """Removes the temporary folder from paths in a text."""
    return TEMPORARY.sub("", text)
