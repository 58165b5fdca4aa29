"""Compare a record CSV with the reference columns of a layout."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import numpy as np

TIME_TOLERANCE_S = 1e-9
CONVERTED = 1e-12
# A resampled record may lose or gain a row at each end, and a few where two clocks do not overlap.
RESAMPLED_ROWS = 3
GRID_SHIFTS = 21
UNITS = {
    "displacement_nm": ("displacement_um", 1e-3),
    "displacement_mm": ("displacement_um", 1e3),
    "time_ms": ("time_s", 1e-3),
    "time_us": ("time_s", 1e-6),
}

Entry = dict[str, Any]
Table = dict[str, np.ndarray]


def compare(entry: Entry, folder: Path, out: Path) -> list[str]:
    """Compare the canonical CSV with the reference columns."""
    try:
        table = load(out)
    except (ValueError, csv.Error) as error:
        return [f"output cannot be read: {error}"]
    truth = {name: np.load(folder / "truth" / file) for name, file in entry["columns"].items()}
    exact = entry["exact"] and all(name in table for name in truth)
    for name, (target, factor) in UNITS.items():
        if name in table and target not in table:
            table[target] = table.pop(name) * factor
    segment = table.pop("segment", np.zeros(1))
    if set(table) != set(truth):
        return [f"columns {', '.join(sorted(table))}; expected {', '.join(sorted(truth))}"]
    problems = []
    segments = len(np.unique(segment))
    if entry["segments"] is not None and segments != entry["segments"]:
        problems.append(f"{segments} segments, expected {entry['segments']}")
    if entry.get("time_from") == "start":
        for columns in (table, truth):
            columns["time_s"] = columns["time_s"] - columns["time_s"][0]
    limit = {name: max(entry["tolerance"], 0.0 if exact else CONVERTED) for name in truth} | entry.get("loose", {})
    if entry.get("resampled"):
        return problems + compare_resampled(entry, table, truth, limit)
    at, wrong = align(entry, table["time_s"], truth["time_s"])
    if wrong:
        return [*problems, wrong]
    counted = ~np.isin(at, entry.get("free_rows", []))
    for name in truth:
        if name != "time_s":
            problems += differences(name, table[name][counted], truth[name][at][counted], limit[name], truth[name])
    return problems


def align(entry: Entry, times: np.ndarray, truth: np.ndarray) -> tuple[np.ndarray, str]:
    """Return the reference row of each output row, and what is wrong with time or the number of rows."""
    tolerance = entry.get("time_tolerance_s", TIME_TOLERANCE_S)
    middle = (truth[1:] + truth[:-1]) / 2
    at = np.searchsorted(middle, times)
    off = np.abs(times - truth[at])
    if len(times) == 0 or not np.all(off <= tolerance):
        worst = int(np.argmax(np.where(np.isnan(off), np.inf, off))) if len(times) else 0
        found = f"time {times[worst]:.9g} s in row {worst + 1}" if len(times) else "no rows"
        return at, f"{found}; no reference row within {tolerance:.0e} s"
    missing = np.setdiff1d(np.arange(len(truth)), at)
    if entry.get("partial"):
        missing = missing[missing < at.max()]
    missing = np.setdiff1d(missing, entry.get("free_rows", []))
    if len(missing):
        return at, f"{len(times)} rows, expected {entry['rows']}; missing reference row {missing[0] + 1}"
    if np.any(np.diff(at) <= 0):
        return at, f"{len(times)} rows, expected {entry['rows']}; some come twice or out of order"
    return at, ""


def compare_resampled(entry: Entry, table: Table, truth: Table, limit: dict[str, float]) -> list[str]:
    """Compare at the times of the output. The even grid may start anywhere within the time tolerance."""
    times, tolerance = table["time_s"], entry["time_tolerance_s"]
    if abs(len(times) - entry["rows"]) > RESAMPLED_ROWS:
        return [f"{len(times)} rows, expected about {entry['rows']}"]
    if np.ptp(np.diff(times)) > 2 * TIME_TOLERANCE_S:
        return [f"time steps from {np.diff(times).min():.9g} to {np.diff(times).max():.9g} s; an even grid is expected"]
    first, last = truth["time_s"][[0, -1]]
    if times[0] < first - 2 * tolerance or times[-1] > last + 2 * tolerance + RESAMPLED_ROWS * np.diff(times[:2])[0]:
        return [f"time from {times[0]:.9g} to {times[-1]:.9g} s, the record has {first:.9g} to {last:.9g} s"]

    def at(name: str, shift: float) -> np.ndarray:
        return np.interp(times + shift, truth["time_s"], truth[name])

    kept = ~np.isin(np.arange(len(times)), entry.get("free_rows", []))
    times = times[kept]
    shifts = np.linspace(-tolerance, tolerance, GRID_SHIFTS)
    best = min(shifts, key=lambda shift: np.abs(table["voltage_v"][kept] - at("voltage_v", shift)).max())
    problems = []
    for name in truth:
        if name != "time_s":
            problems += differences(name, table[name][kept], at(name, best), limit[name], truth[name])
    return problems


def differences(name: str, values: np.ndarray, reference: np.ndarray, limit: float, truth: np.ndarray) -> list[str]:
    """Report the largest difference if it is above `limit` times the span of the reference."""
    span = float(np.ptp(truth))
    error = np.abs(values - reference)
    # NaN is not within the limit.
    if np.all(error <= limit * span):
        return []
    row = int(np.argmax(np.where(np.isnan(error), np.inf, error)))
    expected = "the same bits" if limit == 0 else f"at most {limit:.0e} of the span"
    return [f"{name} is {values[row]!r}, expected {reference[row]!r} (row {row + 1}, {expected})"]


def load(out: Path) -> Table:
    """Read the record CSV: one header line, numbers, empty cells as NaN."""
    with out.open(newline="", encoding="utf-8") as file:
        rows = list(csv.reader(file))
    cells = [[float(cell) if cell else np.nan for cell in row] for row in rows[1:]]
    matrix = np.array(cells, dtype=np.float64).reshape(len(cells), len(rows[0]))
    return {name: matrix[:, k] for k, name in enumerate(rows[0])}
