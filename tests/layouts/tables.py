"""Parquet and Arrow files written by pyarrow, polars and pandas; workbooks written by openpyxl and pandas."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
import openpyxl
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.feather as feather
import pyarrow.parquet as pq

from book import CONVERTED, START_UNIX_S, Array, Book, Columns, mapped
from text import as_printed

PYARROW = f"pyarrow {pa.__version__}"
POLARS = f"polars {pl.__version__}"
PANDAS = f"pandas {pd.__version__}"
OPENPYXL = f"openpyxl {openpyxl.__version__}"
START = datetime.fromtimestamp(START_UNIX_S, UTC).replace(tzinfo=None)
TITLES = ["Time [s]", "Voltage [V]", "Displacement [µm]"]


def write(book: Book) -> None:
    """Write all table layouts."""
    _parquet(book)
    _nulls(book)
    _clock(book)
    _arrow(book)
    _polars(book)
    _workbooks(book)
    _workbook_sheets(book)


def _parquet(book: Book) -> None:
    plain = book.take()
    warm = book.take("time_s", "voltage_v", "displacement_um", "temperature_degc")
    pq.write_table(pa.table(plain), book.path("parquet-snappy.parquet"), compression="snappy")
    book.read("parquet-snappy.parquet", PYARROW, plain)

    single = {name: values.astype(np.float32) for name, values in warm.items()} | {"time_s": plain["time_s"]}
    pq.write_table(pa.table(single), book.path("parquet-float32-zstd.parquet"), compression="zstd")
    book.read("parquet-float32-zstd.parquet", PYARROW, {name: one.astype(np.float64) for name, one in single.items()})

    # Small row groups, data pages of version 2, byte stream split, and a text column to leave alone.
    noted = pa.table(plain | {"note": ["ok"] * len(plain["time_s"])})
    pages = {"row_group_size": 500, "data_page_version": "2.0", "compression": "gzip", "use_dictionary": ["note"]}
    encoding = {"time_s": "BYTE_STREAM_SPLIT", "voltage_v": "BYTE_STREAM_SPLIT"}
    pq.write_table(noted, book.path("parquet-pages-v2-gzip.parquet"), column_encoding=encoding, **pages)
    book.read("parquet-pages-v2-gzip.parquet", PYARROW, plain)

    whole = np.round(1e3 * plain["displacement_um"]).astype(np.int32)
    milli = np.round(1e3 * plain["time_s"]).astype(np.int64)
    ints = pa.table({"time_ms": milli, "voltage_v": plain["voltage_v"], "displacement_nm": whole})
    pq.write_table(ints, book.path("parquet-integers.parquet"), compression="none")
    truth = plain | {"time_s": milli / 1e3, "displacement_um": whole / 1e3}
    book.read("parquet-integers.parquet", PYARROW, truth, tolerance=CONVERTED)

    frame = pd.DataFrame(plain).set_index("time_s")
    frame.to_parquet(book.path("parquet-pandas-index.parquet"))
    book.read("parquet-pandas-index.parquet", PANDAS, plain)

    bare = pa.table(list(plain.values()), names=["t", "u", "y"])
    pq.write_table(bare, book.path("parquet-no-units.parquet"))
    book.ask("parquet-no-units.parquet", PYARROW, [r"\bu\b", r"\by\b"])
    book.read("parquet-no-units.parquet", PYARROW, plain, mapped(time_s="t", voltage_v="u", displacement_um="y"))


def _nulls(book: Book) -> None:
    """Seven displacements are missing; the voltage is dictionary encoded because it has few levels."""
    plain = book.take()
    rows = [100, 101, 640, 1280, 1999, 2000, 2500]
    missing = np.zeros(len(plain["time_s"]), dtype=bool)
    missing[rows] = True
    levels = np.round(plain["voltage_v"], 1) + 0.0  # no negative zero
    table = pa.table(
        {
            "time_s": plain["time_s"],
            "voltage_v": pa.array(levels).dictionary_encode(),
            "displacement_um": pa.array(plain["displacement_um"], mask=missing),
        }
    )
    pq.write_table(table, book.path("parquet-nulls-dictionary.parquet"), compression="none")
    truth = plain | {"voltage_v": levels}
    expected: dict[str, Any] = {"segments": None, "left_out": len(rows), "free_rows": rows}
    book.read("parquet-nulls-dictionary.parquet", PYARROW, truth, **expected)
    feather.write_feather(table, book.path("arrow-nulls-dictionary.feather"))
    book.read("arrow-nulls-dictionary.feather", PYARROW, truth, **expected)


def _clock(book: Book) -> None:
    """Time as a timestamp."""
    plain = book.take()
    rest = {name: plain[name] for name in ("voltage_v", "displacement_um")}
    micro = START_UNIX_S * 10**6 + 1000 * np.arange(len(plain["time_s"]))
    naive = pa.array(micro, type=pa.timestamp("us"))
    pq.write_table(pa.table({"timestamp": naive} | rest), book.path("parquet-timestamp-us.parquet"))
    book.read("parquet-timestamp-us.parquet", PYARROW, plain, time_from="start")
    zoned = pa.array(1000 * micro, type=pa.timestamp("ns", tz="Europe/Berlin"))
    feather.write_feather(pa.table({"time": zoned} | rest), book.path("arrow-timestamp-ns-zone.feather"))
    book.read("arrow-timestamp-ns-zone.feather", PYARROW, plain, time_from="start")


def _arrow(book: Book) -> None:
    plain = book.take()
    table = pa.table(plain)
    for compression in ("lz4", "zstd", "uncompressed"):
        name = f"arrow-feather-{compression}.feather"
        feather.write_feather(table, book.path(name), compression=compression, chunksize=1000)
        book.read(name, PYARROW, plain)
    with pa.OSFile(str(book.path("arrow-stream.arrows")), "wb") as sink, pa.ipc.new_stream(sink, table.schema) as out:
        out.write_table(table, max_chunksize=640)
    book.read("arrow-stream.arrows", PYARROW, plain)


def _polars(book: Book) -> None:
    warm = book.take("time_s", "voltage_v", "displacement_um", "temperature_degc")
    frame = pl.DataFrame(warm)
    frame.write_parquet(book.path("parquet-polars.parquet"))
    book.read("parquet-polars.parquet", POLARS, warm)
    frame.write_ipc(book.path("arrow-polars.arrow"), compression="zstd")
    book.read("arrow-polars.arrow", POLARS, warm)
    clock = pl.Series("time", START_UNIX_S * 1000 + np.arange(len(frame))).cast(pl.Datetime("ms"))
    dated = frame.drop("time_s").insert_column(0, clock)
    dated.write_ipc_stream(book.path("arrow-polars-stream.arrow"))
    book.read("arrow-polars-stream.arrow", POLARS, warm, time_from="start")


def _workbooks(book: Book) -> None:
    plain = _sixteen_digits(book)
    rows = _rows(*plain.values())
    _workbook(book, "xlsx-header.xlsx", {"Sheet": [TITLES, *rows]})
    book.read("xlsx-header.xlsx", OPENPYXL, plain)

    above: list[list[Any]] = [
        ["Hysteresis of stack 7"],
        ["Operator", "A. Person"],
        ["Date", datetime(2024, 5, 13)],
        [],
        [],
    ]
    _workbook(book, "xlsx-titles.xlsx", {"Data": [*above, ["Zeit [s]", "Spannung [V]", "Weg [µm]"], *rows]})
    book.read("xlsx-titles.xlsx", OPENPYXL, plain)

    _workbook(book, "xlsx-units-row.xlsx", {"Data": [["Time", "Drive", "Sensor"], ["s", "V", "µm"], *rows]})
    book.read("xlsx-units-row.xlsx", OPENPYXL, plain)

    # A date is a number of days in double precision: time is exact to about 0.6 µs.
    clock = [START + timedelta(milliseconds=k) for k in range(len(rows))]
    dated = [[moment, *row[1:]] for moment, row in zip(clock, rows, strict=True)]
    _workbook(book, "xlsx-datetime.xlsx", {"Data": [["Time", *TITLES[1:]], *dated]})
    settings: dict[str, Any] = {"time_from": "start", "time_tolerance_s": 3e-6, "resampled": True, "tolerance": 1e-3}
    book.read("xlsx-datetime.xlsx", OPENPYXL, plain, **settings)

    pd.DataFrame(plain).to_excel(book.path("xlsx-pandas.xlsx"))
    book.read("xlsx-pandas.xlsx", PANDAS, plain)

    _workbook(book, "xlsx-no-units.xlsx", {"Data": [["Time", "Drive", "Sensor"], *rows]})
    book.ask("xlsx-no-units.xlsx", OPENPYXL, ["Drive", "Sensor"])
    options = mapped(time_s="Time", voltage_v="Drive", displacement_um="Sensor")
    book.read("xlsx-no-units.xlsx", OPENPYXL, plain, options)


def _workbook_sheets(book: Book) -> None:
    plain = _sixteen_digits(book)
    rows = _rows(*plain.values())
    info: list[list[Any]] = [["Experiment", "stack 7"], ["Amplifier", "20 V/V"], ["Serial number", 1234]]
    _workbook(book, "xlsx-info-sheet.xlsx", {"Info": info, "Data": [TITLES, *rows]})
    book.read("xlsx-info-sheet.xlsx", OPENPYXL, plain)

    # The first sheet has another actuator: the same drive, the output turned over.
    other = _rows(plain["time_s"], plain["voltage_v"], -plain["displacement_um"])
    _workbook(book, "xlsx-two-sheets.xlsx", {"Sheet1": [TITLES, *other], "Sheet2": [TITLES, *rows]})
    names = [f"Sheet2!{title}" for title in TITLES]
    options = mapped(time_s=names[0], voltage_v=names[1], displacement_um=names[2])
    book.read("xlsx-two-sheets.xlsx", OPENPYXL, plain, options)


def _workbook(book: Book, name: str, sheets: dict[str, list[Any]]) -> None:
    workbook = openpyxl.Workbook()
    workbook.remove(workbook.worksheets[0])
    for title, rows in sheets.items():
        sheet = workbook.create_sheet(title)
        for row in rows:
            sheet.append(row)
    workbook.save(book.path(name))


def _sixteen_digits(book: Book) -> Columns:
    """openpyxl writes 16 significant digits, one less than double precision needs."""
    return {name: as_printed(values, "%.16g") for name, values in book.take().items()}


def _rows(*columns: Array) -> list[list[Any]]:
    return [list(row) for row in zip(*(values.tolist() for values in columns), strict=True)]
