"""Reports of commands."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from html import escape
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ._hyst import Record


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


def columns_of(path: Path) -> dict[str, NDArray[np.float64]]:
    """Reads the columns of a result file. A missing number becomes nan."""
    if not path.exists():
        return {}
    with path.open(encoding="utf-8") as file:
        names = file.readline().strip().split(",")
    values = np.genfromtxt(path, delimiter=",", skip_header=1, ndmin=2)
    return {name: values[:, k] for k, name in enumerate(names)}
