"""Custom DAQ devices: a Python object with four methods is a device for ``hyst.run``.

``hyst.run(MyDaq(), …)`` plays drives and references on it, as ``hystctl run`` does: it checks all voltages before
anything moves, ramps to the first value and back to rest, and writes every sample to the log. At every end of the run
the drive is at rest.

Template::

    import numpy as np
    import hyst

    class MyDaq:
        def capabilities(self) -> hyst.daq.Capabilities:
            return hyst.daq.Capabilities("my bench", min_v=0, max_v=100, max_rate_hz=1000, output="displacement_um")

        def start(self, rate_hz: float) -> float:
            ...  # start the sample clock; the drive does not change
            return rate_hz  # the actual sample rate of the device

        def exchange(self, drive):
            ...  # put out drive[0], drive[1], … [V], a sample period apart, and measure the output at each
            return np.zeros(len(drive))  # one output per drive sample

        def stop(self) -> None:
            ...  # the drive is already at rest: stop the clock, hold the outputs at the rest voltage

``hyst.daq.ni`` (National Instruments, with nidaqmx) and ``hyst.daq.serial`` (instruments with text commands) are
complete adapters.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, Protocol, TypeAlias, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["Capabilities", "Daq", "Measured"]

OutputColumn: TypeAlias = Literal["displacement_um", "displacement_nm", "displacement_mm", "force_n"]

#: Return value of ``exchange``: the outputs, or a mapping with ``output`` and, if available, ``drive`` (measured drive
#: voltages [V]), ``temperature`` [°C] and ``load`` [N], all of equal length.
Measured: TypeAlias = ArrayLike | Mapping[str, ArrayLike]


@dataclass(frozen=True)
class Capabilities:
    """Capabilities of a device, requested before a run, and again after an exception of ``exchange``.

    Parameters
    ----------
    device : str
        Name of the device in logs and messages.
    min_v, max_v : float
        Minimum and maximum voltage that may be put out [V].
    rest_v : float
        Rest voltage of the device [V].
    present_v : float, optional
        Present voltage [V]; default: the rest voltage. Give it, because the ramp to rest after an exception of
        ``exchange`` starts there. Without it the ramp starts at the end of the previous block, and a device with a
        queue is not ramped.
    max_slew_v_per_s : float
        Maximum slew rate of the voltage [V/s].
    min_rate_hz, max_rate_hz : float
        Minimum and maximum rate of the sample clock [Hz].
    max_block : int
        Maximum number of drive samples of one ``exchange``. A stop request takes effect after the present block.
    output : str
        Quantity and unit of the output: ``displacement_um``, ``displacement_nm``, ``displacement_mm`` or ``force_n``.
    temperature, load : bool
        Whether ``exchange`` returns ``temperature`` [°C] and ``load`` [N] too.
    queued : bool
        Whether the device has a queue, so that measured samples are returned later than their drive samples. Feedback
        control is then not possible.
    deadline_s : float
        Maximum duration of a call in addition to that of its own and of the pending samples [s]; for ``stop``, the
        total. A longer call ends the run as a lost device.
    """

    device: str
    min_v: float
    max_v: float
    rest_v: float = 0.0
    present_v: float | None = None
    max_slew_v_per_s: float = math.inf
    min_rate_hz: float = 1e-3
    max_rate_hz: float = 1e6
    max_block: int = 256
    output: OutputColumn = "displacement_um"
    temperature: bool = False
    load: bool = False
    queued: bool = False
    deadline_s: float = 2.0


@runtime_checkable
class Daq(Protocol):
    """A device: idle, then ``start``, any number of ``exchange``, then ``stop``.

    An exception of a method ends the run: the drive is ramped to rest if ``exchange`` still works, ``stop`` is called,
    the log is closed, and ``hyst.run`` raises the exception. ``capabilities`` is first called on the thread of the
    caller. All further calls come from one other thread, one at a time. After a call that exceeded its deadline, a
    third thread calls ``stop``.
    """

    def capabilities(self) -> Capabilities:
        """Returns the capabilities of the device. Nothing moves."""
        ...

    def start(self, rate_hz: float) -> float | None:
        """Starts the sample clock and returns its actual rate [Hz] (``None``: as requested). The drive is unchanged."""
        ...

    def exchange(self, drive: NDArray[np.float64]) -> Measured:
        """Puts out the voltages ``drive`` [V], one per sample period, and returns one measurement for each.

        Each drive sample has one measured sample, in order. A device with a queue (``queued=True``) may return fewer;
        later calls return the others. With an empty ``drive`` it returns the available samples, and is called again
        until none is pending. Between two calls a device without a queue holds its last voltage.
        """
        ...

    def stop(self) -> None:
        """Stops the clock and holds the outputs at the rest voltage.

        After a run the drive is already at rest. If ``exchange`` raised and does not accept the ramp either, the drive
        may be at any voltage. ``stop`` may be called on a stopped device.
        """
        ...


