"""Bring your own DAQ: a Python object with four methods is a device for ``hyst.run``.

``hyst.run(MyDaq(), …)`` plays drives and references on it with the runner of ``hystctl run``: voltages are checked before anything moves, ramps
go to the first value and back to rest, every sample goes to the log as it comes in, and however the run ends, the drive ends at rest.

A skeleton to copy::

    import numpy as np
    import hyst

    class MyDaq:
        def capabilities(self) -> hyst.daq.Capabilities:
            return hyst.daq.Capabilities("my bench", min_v=0, max_v=100, max_rate_hz=1000, output="displacement_um")

        def start(self, rate_hz: float) -> float:
            ...  # start the sample clock; the drive stays where it is
            return rate_hz  # the rate that the device really runs at

        def exchange(self, drive):
            ...  # put out drive[0], drive[1], … [V], a sample period apart, and measure the output at each
            return np.zeros(len(drive))  # one output per drive sample

        def stop(self) -> None:
            ...  # the drive is at rest already: stop the clock, leave the outputs at the rest voltage

``hyst.daq.ni`` (National Instruments, by nidaqmx) and ``hyst.daq.serial`` (an instrument that takes and gives lines of text) are complete.
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

#: What ``exchange`` returns: the outputs, or a mapping with ``output`` and, as the device has them, ``drive`` (the voltages that were put
#: out [V]), ``temperature`` [°C] and ``load`` [N], all of one length.
Measured: TypeAlias = ArrayLike | Mapping[str, ArrayLike]


@dataclass(frozen=True)
class Capabilities:
    """What a device can do; before a run, and again after an ``exchange`` that has raised.

    Parameters
    ----------
    device : str
        What the device is called in logs and messages.
    min_v, max_v : float
        Lowest and highest voltage that may be put out [V].
    rest_v : float
        Voltage at which the device rests [V].
    present_v : float, optional
        Voltage that it puts out now [V]; the rest voltage if not given. Say it: after an ``exchange`` that has raised, the ramp to rest begins there; without it
        it begins at the end of the block before, and there is no ramp for a device with a queue.
    max_slew_v_per_s : float
        Steepest slope of the voltage [V/s].
    min_rate_hz, max_rate_hz : float
        Slowest and fastest sample clock [Hz].
    max_block : int
        Most drive samples that one ``exchange`` is given. A run that shall stop stops behind the block that is under way.
    output : str
        Quantity and unit of the output: ``displacement_um``, ``displacement_nm``, ``displacement_mm`` or ``force_n``.
    temperature, load : bool
        Whether ``exchange`` returns ``temperature`` [°C] and ``load`` [N] too.
    queued : bool
        Whether drives wait in a queue, so that measured samples come later than the drives that were handed over; a loop cannot be closed then.
    deadline_s : float
        How long a call may take beyond the time that its samples and those that are still out take [s]; of ``stop``, in all. A call that takes longer ends
        the run as a lost device.
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

    A method that raises ends the run: the drive is ramped to rest as far as ``exchange`` still works, ``stop`` is called, the log is closed,
    and the exception comes out of ``hyst.run``. ``capabilities`` is called first, on the caller's thread; all further calls come from one other thread, one at a
    time. After a call that missed its deadline ``stop`` is called from a third.
    """

    def capabilities(self) -> Capabilities:
        """What the device can do. Nothing moves."""
        ...

    def start(self, rate_hz: float) -> float | None:
        """Starts the sample clock and returns the rate that the device really runs at [Hz] (``None``: as asked). The drive stays where it is."""
        ...

    def exchange(self, drive: NDArray[np.float64]) -> Measured:
        """Puts out the voltages ``drive`` [V], a sample period apart, and returns what was measured at each.

        Each drive sample gives one measured sample, in order. A device with a queue (``queued=True``) may return fewer than it was given; the rest comes
        with later calls. With an empty ``drive`` it returns what is ready, and is called again until nothing is out. Between two calls a device without
        a queue holds its last voltage.
        """
        ...

    def stop(self) -> None:
        """Stops the clock and leaves the outputs at the rest voltage.

        After a run the drive is there already; after an ``exchange`` that raised, and does not take the ramp either, it may be anywhere. It may be called
        when the device is stopped already.
        """
        ...


