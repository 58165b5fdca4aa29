"""Models of piezo hysteresis, their inverses, identification and diagnosis.

Every model is a class with keyword parameters and the methods of ``Operator``: ``simulate``, ``reset``, ``step``,
``inverse``, ``compensate``. ``fit``, ``diagnose`` and ``Model`` work on records. Signals are contiguous numpy arrays of
float64.
"""

from . import _hyst
from ._errors import (
    FitError,
    HystError,
    ModelFileError,
    NotInvertibleError,
    ParameterError,
    RangeWarning,
    ReachError,
    RecordError,
)
from ._hyst import *  # noqa: F403
from ._hyst import __version__ as __version__

__all__ = [
    "FitError",
    "HystError",
    "ModelFileError",
    "NotInvertibleError",
    "ParameterError",
    "RangeWarning",
    "ReachError",
    "RecordError",
    *(name for name in dir(_hyst) if not name.startswith("_")),
]
