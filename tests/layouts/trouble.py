"""Records with the faults of real clocks and sensors."""

from __future__ import annotations

from typing import Any

import numpy as np

from book import SEED, Book
from text import LOGGER, as_printed, lines, printed, save

FORMATS = ["%.6f", "%.5f", "%.6f"]
HEAD = "time_s,voltage_v,displacement_um"
JITTER_S = 1e-6
SPIKE_ROW = 1234
SPIKE_SPANS = 50
# The sensor saturates at this displacement: both large loops reach it.
SATURATION_UM = 9.5


def write(book: Book) -> None:
    """Write all faulty records."""
    _clock(book)
    _gaps(book)
    _missing(book)
    _sensor(book)


def _clock(book: Book) -> None:
    """A clock that scatters by 1 µs around 1 kHz. The first and the last sample are in time."""
    time, voltage, displacement = book.take().values()
    jitter = np.random.default_rng(SEED + 1).normal(0, JITTER_S, len(time))
    jitter[[0, -1]] = 0
    body = lines([time + jitter, voltage, displacement], ["%.9f", *FORMATS[1:]])
    save(book, "csv-jitter.csv", [HEAD, *body])
    truth = printed(book)
    settings: dict[str, Any] = {"tolerance": 1e-3, "resampled": True, "time_tolerance_s": 3e-6}
    book.read("csv-jitter.csv", LOGGER, truth, says=["jitter"], **settings)


def _gaps(book: Book) -> None:
    truth = printed(book)
    gap = truth | {"time_s": as_printed(truth["time_s"] + (np.arange(len(truth["time_s"])) >= 1800), FORMATS[0])}
    save(book, "csv-gap.csv", [HEAD, *lines(list(gap.values()), FORMATS)])
    book.read("csv-gap.csv", LOGGER, gap, segments=2, says=["gap|segment"])

    body = lines(list(truth.values()), FORMATS)
    repeated = [line for row, line in enumerate(body) for _ in range(2 if row in {10, 500, 501, 1700, 2998} else 1)]
    save(book, "csv-duplicate-rows.csv", [HEAD, *repeated])
    book.read("csv-duplicate-rows.csv", LOGGER, truth, says=[r"\b5\b"])


def _missing(book: Book) -> None:
    truth = printed(book)
    body = lines(list(truth.values()), FORMATS)
    for name, row, cell in (
        ("csv-one-nan.csv", 777, "NaN"),
        ("csv-empty-cell.csv", 2100, ""),
    ):
        time, voltage, _ = body[row].split(",")
        save(book, name, [HEAD, *body[:row], f"{time},{voltage},{cell}", *body[row + 1 :]])
        book.read(name, LOGGER, truth, segments=None, left_out=1, free_rows=[row])
    rows = range(1000, 1003)
    holes = [f"{line.rsplit(',', 1)[0]},NA" if row in rows else line for row, line in enumerate(body)]
    save(book, "csv-three-na.csv", [HEAD, *holes])
    book.read("csv-three-na.csv", LOGGER, truth, segments=None, left_out=3, free_rows=list(rows))


def _sensor(book: Book) -> None:
    truth = printed(book)
    displacement = truth["displacement_um"]
    span = float(np.ptp(displacement))
    spike = displacement.copy()
    spike[SPIKE_ROW] = round(float(displacement[SPIKE_ROW]) + SPIKE_SPANS * span, 6)
    save(book, "csv-spike.csv", [HEAD, *lines([truth["time_s"], truth["voltage_v"], spike], FORMATS)])
    # The row counts from 0 or 1, or is the line of the file; the distance depends a little on how the span is taken.
    where = rf"\b({SPIKE_ROW}|{SPIKE_ROW + 1}|{SPIKE_ROW + 2}|1[.,]234)\b"
    settings: dict[str, Any] = {"segments": None, "free_rows": [SPIKE_ROW]}
    book.read("csv-spike.csv", LOGGER, truth, says=[where, r"\b(4[5-9]|5[0-9])([.,]\d+)?\b"], **settings)

    high = book.record["clean_um"] > SATURATION_UM
    flat = np.where(high, SATURATION_UM, np.minimum(displacement, SATURATION_UM - 1e-3))
    clipped = truth | {"displacement_um": as_printed(flat, FORMATS[2])}
    save(book, "csv-saturated.csv", [HEAD, *lines(list(clipped.values()), FORMATS)])
    rows = np.flatnonzero(high).tolist()
    settings = {"segments": None, "left_out": len(rows), "free_rows": rows}
    book.read("csv-saturated.csv", LOGGER, clipped, **settings)
