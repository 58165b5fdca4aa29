"""Plots of the objects with matplotlib."""

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ._hyst import Diagnosis, Drive, Model, Record, Simulation

_Values = NDArray[np.float64]


def _axes(ax: Any) -> Any:
    if ax is not None:
        return ax
    try:
        import matplotlib.pyplot as plt
    except ImportError as error:
        raise ImportError("plot needs matplotlib: pip install matplotlib") from error
    return plt.subplots(layout="constrained")[1]


def _label(column: str) -> str:
    """Returns the axis label of a column: ``voltage_v`` becomes Voltage [V]."""
    units = {"v": "V", "um": "µm", "nm": "nm", "mm": "mm", "n": "N", "degc": "°C", "s": "s"}
    name, _, unit = column.rpartition("_")
    if not name:
        return column
    name = name.removesuffix("_in").replace("_", " ")
    return f"{name.capitalize()} [{units.get(unit, unit)}]"


def _pieces(segments: Sequence[tuple[int, int]], x: _Values, y: _Values) -> tuple[_Values, _Values]:
    """Returns the values of all segments with nan between them, so that no line connects two segments."""
    gaps = [start for start, _ in segments[1:]]
    return np.insert(x, gaps, np.nan), np.insert(y, gaps, np.nan)


def record(record: Record, kind: str, ax: Any, options: dict[str, Any]) -> Any:
    """Plots output over input, or output over time (without an output, the input)."""
    ax, segments = _axes(ax), record.segments
    u, y = record.inputs, record.outputs
    options = {"linewidth": 0.8, "label": record.name, **options}
    if kind == "loop":
        if u is None or y is None:
            raise ValueError('a loop needs input and output: give kind="time" to plot one of them over time')
        ax.plot(*_pieces(segments, u, y), **options)
        ax.set(xlabel=_label(record.input_column), ylabel=_label(record.output_column or ""))
    elif kind == "time":
        values, column = (u, record.input_column) if y is None else (y, record.output_column)
        if values is not None:
            ax.plot(*_pieces(segments, record.timepts, values), **options)
        ax.set(xlabel="Time [s]", ylabel=_label(column or ""))
    else:
        raise ValueError(f'kind is {kind!r}; it must be "loop" or "time"')
    return ax


def simulation(simulation: Simulation, kind: str, ax: Any, options: dict[str, Any]) -> Any:
    """Plots the prediction over the input, or over time, without start-up rows."""
    ax = _axes(ax)
    if kind not in ("loop", "time"):
        raise ValueError(f'kind is {kind!r}; it must be "loop" or "time"')
    y = np.where(simulation.settling, np.nan, simulation.outputs)
    options = {"linewidth": 0.8, "label": "predicted", **options}
    ax.plot(simulation.inputs if kind == "loop" else simulation.timepts, y, **options)
    ax.set(xlabel="Input" if kind == "loop" else "Time [s]", ylabel="Predicted output")
    return ax


def drive(drive: Drive, ax: Any, options: dict[str, Any]) -> Any:
    """Plots the drive over time, with dots where a limit acted."""
    ax = _axes(ax)
    ax.plot(drive.timepts, drive.inputs, **{"linewidth": 0.8, "label": "drive", **options})
    limited = sorted({*drive.voltage_limited, *drive.slew_limited})
    if limited:
        ax.plot(drive.timepts[limited], drive.inputs[limited], ".", color="tab:red", label="limited")
    ax.set(xlabel="Time [s]", ylabel="Drive [V]")
    return ax


def model(model: Model, period: float, temperature: float | None, ax: Any, options: dict[str, Any]) -> Any:
    """Plots loops of the model for a decaying sine over ``input_range``, from its lower end."""
    ax = _axes(ax)
    low, high = model.input_range
    turns, rows = 5, 5000
    phase = np.linspace(0.0, turns, rows)
    u = low + (high - low) * (1.0 - phase / (turns + 1)) * 0.5 * (1.0 - np.cos(2.0 * np.pi * phase))
    environment = {} if temperature is None else {"temperature": temperature}
    y = model.operator(period).simulate(u, time=0.0, load=0.0, **environment)
    ax.plot(u, y, **{"linewidth": 0.8, "label": model.kind, **options})
    ax.set(xlabel=_label(model.input_column), ylabel=_label(model.output_column))
    return ax


def diagnosis(
    diagnosis: Diagnosis, models: Sequence[Model], record: Record, zero: Literal["none", "per-record"], ax: Any, options: dict[str, Any]
) -> Any:
    """Plots the residuals of the diagnosed and of the extended model over time, without start-up rows."""
    ax = _axes(ax)
    y = record.outputs
    if y is None:
        raise ValueError("a residual needs a measured output")
    names = ["before"] if not diagnosis.effects else ["before", f"with {', '.join(diagnosis.effects)}"]
    for name, model in zip(names, models, strict=False):
        predicted = model.simulate(record, zero=zero)
        residual = np.where(predicted.settling, np.nan, y - predicted.outputs)
        ax.plot(*_pieces(record.segments, record.timepts, residual), **{"linewidth": 0.8, "label": name, **options})
    unit = _label(record.output_column or "").rpartition(" ")[2]
    ax.set(xlabel="Time [s]", ylabel=f"Measured − predicted {unit}")
    ax.legend()
    return ax
