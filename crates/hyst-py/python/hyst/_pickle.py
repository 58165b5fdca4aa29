"""Restores pickled objects of the compiled part."""

from typing import Any

from . import _hyst


def restore(kind: str, state: bytes) -> Any:
    """Returns an object of the class ``kind`` of ``_hyst`` with this state."""
    return getattr(_hyst, kind)._restore(state)
