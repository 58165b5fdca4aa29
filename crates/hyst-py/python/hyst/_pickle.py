"""How ``pickle`` makes objects of the compiled half again."""

from typing import Any

from . import _hyst


def restore(kind: str, state: bytes) -> Any:
    """The object of a class of ``_hyst`` that has this state."""
    return getattr(_hyst, kind)._restore(state)
