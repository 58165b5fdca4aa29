"""Display of records and models in notebooks: a table and a small plot, as self-contained HTML."""

from collections.abc import Iterable
from html import escape

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._hyst import Model, Record
from ._plot import _label

_Piece = tuple[ArrayLike, ArrayLike]

#: Maximum number of points of a plot.
POINTS = 10_000
WIDTH, HEIGHT, LEFT, BELOW = 390, 270, 68, 40


def _table(rows: Iterable[tuple[str, object]]) -> str:
    cells = "".join(f"<tr><th style='text-align:left'>{escape(k)}</th><td>{escape(str(v))}</td></tr>" for k, v in rows)
    return f"<table>{cells}</table>"


def _plot(all_pieces: Iterable[_Piece], x_label: str, y_label: str) -> str:
    """Returns an SVG with a line per piece, and with the limits of both axes."""
    pieces = [(np.asarray(x, float), np.asarray(y, float)) for x, y in all_pieces]
    pieces = [piece for piece in pieces if len(piece[0])]
    if not pieces:
        return ""
    step = -(-sum(len(x) for x, _ in pieces) // POINTS)
    pieces = [(x[::step], y[::step]) for x, y in pieces]

    def ends(k: int) -> tuple[float, float]:
        low, high = float(min(p[k].min() for p in pieces)), float(max(p[k].max() for p in pieces))
        return (low, high) if high > low else (low - 1.0, high + 1.0)

    (left, right), (low, high) = ends(0), ends(1)
    wide, tall = WIDTH - LEFT - 8, HEIGHT - BELOW - 8
    lines = []
    for x, y in pieces:
        across = LEFT + wide * (x - left) / (right - left)
        up = 8 + tall * (high - y) / (high - low)
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(across, up))
        lines.append(f"<polyline points='{points}' fill='none' stroke='#0072b2' stroke-width='1'/>")

    def text(x: float, y: float, words: str, anchor: str, turn: str = "") -> str:
        return f"<text x='{x}' y='{y}' text-anchor='{anchor}' font-size='11'{turn}>{escape(words)}</text>"

    below, middle = HEIGHT - BELOW + 14, LEFT + wide / 2
    axes = [
        f"<rect x='{LEFT}' y='8' width='{wide}' height='{tall}' fill='none' stroke='#999'/>",
        text(LEFT, below, f"{left:.3g}", "start"),
        text(LEFT + wide, below, f"{right:.3g}", "end"),
        text(middle, below + 16, x_label, "middle"),
        text(LEFT - 4, 8 + tall, f"{low:.3g}", "end"),
        text(LEFT - 4, 18, f"{high:.3g}", "end"),
        text(12, 8 + tall / 2, y_label, "middle", f" transform='rotate(-90 12 {8 + tall / 2})'"),
    ]
    return f"<svg width='{WIDTH}' height='{HEIGHT}' style='background:white'>{''.join(axes + lines)}</svg>"


def _span(values: NDArray[np.float64]) -> str:
    return f"{values.min():.4g} to {values.max():.4g}"


def record(record: Record) -> str:
    """Returns rows, segments, sample rate and ranges of a record, and its loops."""
    u, y, t = record.inputs, record.outputs, record.timepts
    rows = [
        ("record", record.name),
        ("rows", f"{len(record)} in {len(record.segments)} segments"),
        ("sample rate [Hz]", f"{1.0 / record.period:.6g}"),
    ]
    input_label, output_label = _label(record.input_column), _label(record.output_column or "")
    columns = [(input_label, u), (output_label, y)]
    columns += [("Temperature [°C]", record.temperature), ("Load [N]", record.load)]
    rows += [(name, _span(values)) for name, values in columns if values is not None]
    rows += [("note", note) for note in record.notes]
    if u is not None and y is not None:
        x, v, labels = u, y, (input_label, output_label)
    elif u is not None:
        x, v, labels = t, u, ("Time [s]", input_label)
    elif y is not None:
        x, v, labels = t, y, ("Time [s]", output_label)
    else:
        return _table(rows)
    pieces = [(x[a:b], v[a:b]) for a, b in record.segments]
    return _table(rows) + _plot(pieces, *labels)


def model(model: Model) -> str:
    """Returns kind, effects and ranges of a model, and its loops if it does not need a temperature."""
    low, high = model.input_range
    rows = [
        ("model", model.kind),
        ("effects", ", ".join(model.effects) or "none"),
        (_label(model.input_column), f"{low:.4g} to {high:.4g}"),
        (_label(model.output_column), "{:.4g} to {:.4g}".format(*model.output_range)),
    ]
    turns = np.linspace(0.0, 4.0, POINTS)
    u = low + (high - low) * (1.0 - turns / 5.0) * 0.5 * (1.0 - np.cos(2.0 * np.pi * turns))
    try:
        y = model.operator(1e-3).simulate(u, load=0.0, time=0.0)
    except (TypeError, ValueError):
        return _table(rows)
    return _table(rows) + _plot([(u, y)], _label(model.input_column), _label(model.output_column))
