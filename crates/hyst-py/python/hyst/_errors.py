"""Exceptions and warnings of the package."""


class HystError(Exception):
    """Anything that this package finds wrong with a model or a record."""


class ParameterError(HystError, ValueError):
    """A parameter is not finite, out of range, or a list is too long; the message names it."""


class NotInvertibleError(HystError, ValueError):
    """The model has no inverse; the message says why."""


class RecordError(HystError, ValueError):
    """A record cannot be read, made, or used with this model; the message names file, line and column."""


class NoRecordError(RecordError, FileNotFoundError):
    """There is no file of this name to read a record from."""


class ModelFileError(HystError, ValueError):
    """A model file cannot be read or written."""


class NoModelError(ModelFileError, FileNotFoundError):
    """There is no file of this name to read a model from."""


class FitError(HystError, ValueError):
    """A record cannot be fitted or diagnosed."""


class RangeWarning(UserWarning):
    """Something was asked beyond the range in which a model or its inverse holds; the message says in how many samples, and by
    how much."""


class ReachError(HystError, ValueError):
    """A reference leaves what the actuator reaches."""


class CommandError(HystError, RuntimeError):
    """What was asked for could not be done, though nothing was wrong with what was given."""


class InputError(HystError, ValueError):
    """An argument or an input file is wrong; the message names it and says what to do."""


class DeviceError(HystError, RuntimeError):
    """A device is lost, or what was measured is at risk; the message says what is safe."""
