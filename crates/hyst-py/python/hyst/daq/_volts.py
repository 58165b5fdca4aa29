"""What the adapters share: checks of their voltages, and the ramp to rest."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["check_limits", "checked_drive", "ramp"]


def check_limits(min_v: float, max_v: float, rest_v: float, present_v: float) -> None:
    """Raises ``ValueError`` unless the range is one, and the device rests and begins within it."""
    if not (math.isfinite(min_v) and math.isfinite(max_v) and min_v < max_v):
        raise ValueError(f"min_v = {min_v:g} V and max_v = {max_v:g} V are not a range: give finite voltages with min_v below max_v")
    for name, volts in (("rest_v", rest_v), ("present_v", present_v)):
        if not min_v <= volts <= max_v:
            raise ValueError(f"{name} = {volts:g} V is outside {min_v:g} to {max_v:g} V: give a voltage within min_v and max_v")


def checked_drive(drive: ArrayLike, min_v: float, max_v: float) -> NDArray[np.float64]:
    """The drive as contiguous float64; raises ``ValueError`` if a voltage may not be put out.

    Nothing is clamped, because a clamped drive would be another experiment than the requested one.
    """
    volts = np.ascontiguousarray(drive, dtype=np.float64)
    if volts.ndim != 1:
        raise ValueError(f"the drive has {volts.ndim} dimensions, expected 1: give a list of voltages")
    # A value that is not a number fails the comparison too.
    refused = np.flatnonzero(~((volts >= min_v) & (volts <= max_v)))
    if len(refused):
        row = int(refused[0])
        raise ValueError(f"drive sample {row} is {volts[row]:g} V, expected {min_v:g} to {max_v:g} V; nothing of this block was put out")
    return volts


def ramp(from_v: float, to_v: float, slew_v_per_s: float, step_s: float) -> list[float]:
    """Voltages from ``from_v`` (exclusive) to ``to_v`` (inclusive), ``step_s`` apart and no steeper than the slew; always at least one."""
    steps = max(1, math.ceil(abs(to_v - from_v) / (slew_v_per_s * step_s)))
    return [from_v + (to_v - from_v) * k / steps for k in range(1, steps)] + [to_v]
