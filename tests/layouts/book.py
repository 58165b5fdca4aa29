"""The record that every layout holds, and the list of what a reader has to find in each file."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]
Columns = dict[str, Array]

SEED = 25
RATE_HZ = 1000
ROWS_PER_BRANCH = 250
# The drive runs from one turning point to the next: two full loops, then smaller loops inside them.
TURNING_POINTS_V = (0, 100, 0, 100, 20, 80, 20, 80, 35, 65, 35, 65, 0)
THRESHOLDS_V = np.array([1.0, 3.0, 6.0, 10.0, 15.0, 22.0, 30.0, 42.0])
WEIGHTS_UM_PER_V = np.array([0.008, 0.007, 0.006, 0.005, 0.004, 0.004, 0.003, 0.003])
STIFFNESS_UM_PER_V = 0.07
# Start of the experiment for formats with an absolute clock: 2024-05-13 08:21:14 UTC.
START_UNIX_S = 1_715_588_474
# A unit conversion costs one or two roundings; this is far above them and far below any real error.
CONVERTED = 1e-12


def drive() -> Array:
    """Voltage without noise: half cosines between the turning points."""
    phase = np.arange(ROWS_PER_BRANCH) / ROWS_PER_BRANCH
    shape = 0.5 * (1 - np.cos(np.pi * phase))
    pairs = zip(TURNING_POINTS_V, TURNING_POINTS_V[1:], strict=False)
    return np.concatenate([start + (end - start) * shape for start, end in pairs])


def prandtl_ishlinskii(voltage: Array) -> Array:
    """Displacement in µm: a linear part plus weighted play operators that start at rest."""
    state = np.zeros_like(THRESHOLDS_V)
    output = np.empty_like(voltage)
    for row, u in enumerate(voltage):
        state = np.clip(state, u - THRESHOLDS_V, u + THRESHOLDS_V)
        output[row] = STIFFNESS_UM_PER_V * u + WEIGHTS_UM_PER_V @ state
    return output


def simulate() -> Columns:
    """Return the record: time, noisy voltage and displacement, temperature, load; and the output without noise."""
    rng = np.random.default_rng(SEED)
    voltage = drive()
    clean = prandtl_ishlinskii(voltage)
    rows = len(voltage)
    time = np.arange(rows) / RATE_HZ
    return {
        "time_s": time,
        "voltage_v": voltage + rng.normal(0, 2e-3, rows),
        "displacement_um": clean + rng.normal(0, 2e-3, rows),
        "temperature_degc": 22.0 + 0.8 * (1 - np.exp(-time / 1.5)),
        "load_n": 5.0 + 0.5 * np.sin(2 * np.pi * 0.7 * time),
        "clean_um": clean,
    }


class Book:
    """Collects the expected result of every layout and stores the reference arrays."""

    def __init__(self, folder: Path) -> None:
        """Create the output folder and simulate the record."""
        self.folder = folder
        self.record = simulate()
        self.entries: list[dict[str, Any]] = []
        (folder / "truth").mkdir(parents=True, exist_ok=True)

    def path(self, name: str) -> Path:
        """Return the path of a file of this set."""
        return self.folder / name

    def take(self, *names: str) -> Columns:
        """Return the named columns of the record; without names: time, voltage and displacement."""
        return {name: self.record[name] for name in names or ("time_s", "voltage_v", "displacement_um")}

    def truth(self, name: str, values: Array) -> str:
        """Store a reference array once and return its file name."""
        values = np.ascontiguousarray(values, dtype=np.float64)
        file = f"{name}-{hashlib.sha256(values.tobytes()).hexdigest()[:8]}.npy"
        np.save(self.folder / "truth" / file, values)
        return file

    def read(
        self,
        file: str,
        writer: str,
        columns: Mapping[str, Array],
        options: Sequence[str] = (),
        *,
        tolerance: float | None = None,
        segments: int | None = 1,
        left_out: int = 0,
        says: Sequence[str] = (),
        **extra: Any,  # noqa: ANN401
    ) -> None:
        """Expect these columns. Without a tolerance the values have to be the same bit for bit.

        `segments=None` accepts any number of segments. Fields in `extra`:
        `time_from="start"` compares time from the first row on; `time_tolerance_s` replaces 1e-9 s;
        `resampled=True` accepts any even time grid within the record and compares with the reference at these times;
        `free_rows` are rows of the reference that may be missing, empty or of any value;
        `loose` are tolerances of single columns; `alternative` is a second outcome that is honest too;
        `partial=True` accepts the first rows alone.
        """
        stored = {name: self.truth(name, np.asarray(values)) for name, values in columns.items()}
        self.entries.append(
            {
                "file": file,
                "writer": writer,
                "options": list(options),
                "outcome": "read",
                "exact": tolerance is None,
                "tolerance": tolerance or 0.0,
                "columns": stored,
                "segments": segments,
                "rows": len(columns["time_s"]),
                "says": list(says),
                "left_out": left_out,
                **extra,
            }
        )

    def ask(
        self, file: str, writer: str, says: Sequence[str] = (), options: Sequence[str] = (), *, paste: bool = True
    ) -> None:
        """Expect a question: exit code 2 and a `--map` line. With `paste` that line has to lead to a record."""
        self._stop("ask", file, writer, says, options, {"paste": paste})

    def refuse(self, file: str, writer: str, says: Sequence[str] = (), options: Sequence[str] = ()) -> None:
        """Expect a refusal: exit code 2 and one bounded message."""
        self._stop("refuse", file, writer, says, options, {})

    def _stop(
        self, outcome: str, file: str, writer: str, says: Sequence[str], options: Sequence[str], extra: dict[str, Any]
    ) -> None:
        self.entries.append(
            {"file": file, "writer": writer, "options": list(options), "outcome": outcome, "says": list(says), **extra}
        )

    def save(self) -> None:
        """Write `expected.json`: one entry a line."""
        lines = ",\n".join(json.dumps(entry, ensure_ascii=False) for entry in self.entries)
        self.path("expected.json").write_text(f"[\n{lines}\n]\n", encoding="utf-8")


def mapped(**sources: str) -> list[str]:
    """Return the options that map columns of the record to names in the file."""
    return [part for target, source in sources.items() for part in ("--map", f"{target}={source}")]
