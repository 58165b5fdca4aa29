"""Models of piezo hysteresis, their inverses, identification and diagnosis.

Every model is a class with keyword parameters and the methods of ``Operator``: ``simulate``, ``reset``, ``step``,
``inverse``, ``compensate``. ``fit``, ``diagnose`` and ``Model`` work on records. A signal is anything that NumPy
converts to a one-dimensional array of numbers; contiguous arrays of float64 are not copied.
"""

from . import _commands, _hyst, daq, fleet
from ._commands import *  # noqa: F403
from ._errors import (
    CommandError,
    DeviceError,
    FitError,
    HystError,
    InputError,
    ModelFileError,
    NoModelError,
    NoRecordError,
    NotInvertibleError,
    ParameterError,
    RangeWarning,
    ReachError,
    RecordError,
)
from ._hyst import *  # noqa: F403
from ._hyst import __version__ as __version__

__all__ = [
    "CommandError",
    "DeviceError",
    "FitError",
    "HystError",
    "InputError",
    "ModelFileError",
    "NoModelError",
    "NoRecordError",
    "NotInvertibleError",
    "ParameterError",
    "RangeWarning",
    "ReachError",
    "RecordError",
    "daq",
    "fleet",
    *_commands.__all__,
    *(name for name in dir(_hyst) if not name.startswith("_")),
]
