"""Exceptions and warnings of the package."""


class HystError(Exception):
    """Base class of the errors of this package."""


class ParameterError(HystError, ValueError):
    """A parameter is not finite or out of range, or a list is too long. The message contains its name."""


class NotInvertibleError(HystError, ValueError):
    """The model has no inverse. The message contains the reason."""


class RecordError(HystError, ValueError):
    """A record cannot be read, created, or used with this model. The message contains file, line and column."""


class NoRecordError(RecordError, FileNotFoundError):
    """The file of a record does not exist."""


class ModelFileError(HystError, ValueError):
    """A model file cannot be read or written."""


class NoModelError(ModelFileError, FileNotFoundError):
    """The file of a model does not exist."""


class FitError(HystError, ValueError):
    """A record cannot be fitted or diagnosed."""


class RangeWarning(UserWarning):
    """A simulation or an inverse is outside its valid range. The message contains the number of samples and the
    distance."""


class ReachError(HystError, ValueError):
    """A reference is outside what the actuator reaches."""


class CommandError(HystError, RuntimeError):
    """The command failed, although its arguments are valid."""


class InputError(HystError, ValueError):
    """An argument or an input file is invalid. The message contains its name and how to fix it."""


class DeviceError(HystError, RuntimeError):
    """A device is lost, or measured data are at risk. The message states which data are safe."""
