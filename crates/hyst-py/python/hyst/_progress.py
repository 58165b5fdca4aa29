"""Progress of long work: a bar of tqdm in a terminal or a notebook."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from typing import Any


class _Calls:
    """Calls a function of the caller with each line."""

    def __init__(self, function: Callable[[str], object]) -> None:
        self._function = function

    def say(self, text: str, done: int | None = None) -> None:
        self._function(text)

    def at(self, done: int) -> None:
        self._function(f"{done} evaluations")

    def close(self) -> None:
        """Does nothing."""


class _Bar:
    """A bar of tqdm. It disappears when it is closed."""

    def __init__(self, tqdm: Any, what: str, total: int | None) -> None:
        # Without a total there is no rate and no remaining time.
        bar_format = None if total else "{desc} [{elapsed}]"
        self._what = what
        self._tqdm = tqdm(desc=what, total=total, leave=False, bar_format=bar_format)

    def say(self, text: str, done: int | None = None) -> None:
        self._tqdm.set_description_str(f"{self._what}: {text}")
        if done is not None:
            self.at(done)

    def at(self, done: int) -> None:
        self._tqdm.update(done - self._tqdm.n)

    def close(self) -> None:
        self._tqdm.close()


def _is_shown() -> bool:
    """Returns whether a terminal, or a notebook with ipywidgets, can show a bar."""
    if "ipykernel" in sys.modules:
        return find_spec("ipywidgets") is not None
    return sys.stderr is not None and sys.stderr.isatty()


def bar(what: str, total: int | None, progress: Callable[[str], object] | bool | None) -> _Calls | _Bar | None:
    """Returns the bar for ``progress=``, or ``None``.

    ``None`` shows a bar in a terminal or a notebook if tqdm is installed, ``True`` always, ``False`` never. A function
    is called with each line.
    """
    if callable(progress):
        return _Calls(progress)
    if progress is False or progress is None and not _is_shown():
        return None
    try:
        # Imported dynamically, because tqdm has no types.
        tqdm = import_module("tqdm.auto").tqdm
    except ImportError:
        if progress is None:
            return None
        raise ImportError("progress=True needs tqdm: pip install tqdm") from None
    return _Bar(tqdm, what, total)
