"""Read every layout back with its own library and look for the reference columns in it.

Usage: python readback.py OUTDIR

A reference column is found if one numeric column of the file has the same values, bit for bit or up to a unit. Files
whose clock or sensor has a fault are compared in the rows that are free of it. Text is split into cells by hand.
"""

from __future__ import annotations

import codecs
import gzip
import json
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import openpyxl
import polars as pl
import pyarrow as pa
import pyarrow.feather as feather
import pyarrow.ipc as ipc
import pyarrow.parquet as pq
import zstandard
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory as ProtobufDecoder
from mcap_ros2.decoder import DecoderFactory as Ros2Decoder
from nptdms import TdmsFile
from scipy.io import loadmat

from book import START_UNIX_S

UNIT_FACTORS = (1.0, 1e-3, 1e3, 1e-6, 1e6, -1.0)
START_NS = START_UNIX_S * 10**9
# The reference of a resampled column lies between its samples.
RESAMPLED_FACTOR = 3.0
Found = Iterator[np.ndarray]


def main() -> int:
    """Check all readable files of the set."""
    folder = Path(sys.argv[1])
    entries = json.loads((folder / "expected.json").read_text(encoding="utf-8"))
    bad = 0
    readable = [entry for entry in entries if entry["outcome"] == "read" and not entry.get("partial")]
    for entry in readable:
        columns = list(read(folder / entry["file"]))
        missing = [name for name, file in entry["columns"].items() if not _found(folder, name, file, columns, entry)]
        bad += bool(missing)
        if missing:
            print(f"FAIL {entry['file']}: {len(columns)} columns, not found: {', '.join(missing)}")
    print(f"{len(readable) - bad} of {len(readable)} entries found in their files")
    return bad > 0


def read(path: Path) -> Found:
    """Yield all numeric columns of a file."""
    readers: dict[str, Callable[[Path], Found]] = {
        ".mat": _mat,
        ".h5": _hdf5,
        ".tdms": _tdms,
        ".parquet": lambda p: _table(pq.read_table(p)),
        ".feather": lambda p: _table(feather.read_table(p)),
        ".arrows": lambda p: _table(ipc.open_stream(p.read_bytes()).read_all()),
        ".arrow": _polars,
        ".xlsx": _xlsx,
        ".npy": lambda p: _numbers(np.load(p)),
        ".npz": lambda p: (column for array in np.load(p).values() for column in _numbers(array)),
        ".mcap": _mcap,
    }
    yield from readers.get(path.suffix, _text)(path)


def _found(folder: Path, name: str, file: str, columns: list[np.ndarray], entry: dict[str, Any]) -> bool:
    truth = np.load(folder / "truth" / file)
    if name == "time_s" and (entry["options"][:1] == ["--rate"] or not _has_clock(entry["file"])):
        return True
    keep = np.ones(len(truth), dtype=bool)
    keep[entry.get("free_rows", [])] = False
    tolerance = max(entry["tolerance"], entry.get("time_tolerance_s", 0.0) if name == "time_s" else 0.0)
    tolerance *= RESAMPLED_FACTOR if entry.get("resampled") else 1.0
    if name in entry.get("loose", {}):
        return any(np.ptp(column) > 0.9 * np.ptp(truth) for column in columns if 0 < len(column) < len(truth))
    for column in columns:
        values = _unique_rows(column, columns) if len(column) > len(truth) else column
        if len(values) != len(truth):
            continue
        if name == "time_s" and entry.get("time_from") == "start":
            values, reference = values - values[0], truth - truth[0]
        else:
            reference = truth
        span = np.ptp(reference)
        for factor in UNIT_FACTORS:
            exact = tolerance == 0 and factor in (1.0, -1.0) and not entry.get("time_from")
            limit = 0.0 if exact else max(tolerance, 1e-12) * span
            if np.all(np.abs(values[keep] * factor - reference[keep]) <= limit):
                return True
    return False


def _has_clock(file: str) -> bool:
    """Return whether the file has a time column; the others have a period in their header."""
    without = ("tdms-waveform", "tdms-ten", "tdms-float", "tdms-no", "tdms-two", "tdms-linear", "lvm-no-x", "txt-pi")
    return not file.startswith(without)


def _unique_rows(column: np.ndarray, columns: list[np.ndarray]) -> np.ndarray:
    same = np.column_stack([one for one in columns if len(one) == len(column)])
    changed = np.append(True, np.any(np.diff(same, axis=0) != 0, axis=1))
    return column[changed]


def _numbers(array: np.ndarray) -> Found:
    array = np.asarray(array)
    if array.dtype.names:
        for name in array.dtype.names:
            yield from _numbers(array[name])
    elif array.dtype.kind == "M":
        yield (array - array.flat[0]).astype("timedelta64[ns]").astype(np.float64) * 1e-9
    elif array.dtype.kind in "fiu":
        array = array.astype(np.float64)
        if array.ndim == 2 and 1 not in array.shape:
            yield from (array[:, k] for k in range(min(array.shape[1], 10)))
            yield from array[:10]
        else:
            yield array.ravel()


def _mat(path: Path) -> Found:
    if h5py.is_hdf5(path):
        yield from _hdf5(path)
        return

    def walk(item: object) -> Found:
        if isinstance(item, dict):
            for value in item.values():
                yield from walk(value)
        elif isinstance(item, np.ndarray) and (item.dtype == object or item.dtype.names):
            for value in item.flat:
                yield from walk(list(value) if item.dtype.names else value)
        elif isinstance(item, list | tuple):
            for value in item:
                yield from walk(value)
        elif isinstance(item, np.ndarray):
            yield from _numbers(item)

    yield from walk(loadmat(path))


def _hdf5(path: Path) -> Found:
    with h5py.File(path) as file:
        arrays: list[tuple[str, np.ndarray]] = []

        def visit(name: str, item: object) -> None:
            if isinstance(item, h5py.Dataset) and item.dtype.kind != "O":
                values = item[()]
                if "scale_factor" in item.attrs:
                    values = values * item.attrs["scale_factor"] + item.attrs["add_offset"]
                arrays.append((name, values))

        file.visititems(visit)
    for _, array in arrays:
        yield from _numbers(array)
    # One group a segment: join the pieces in the order of their numbers.
    runs: dict[str, dict[int, np.ndarray]] = {}
    for name, array in arrays:
        if match := re.fullmatch(r"run_(\d+)/(.+)", name):
            runs.setdefault(match[2], {})[int(match[1])] = array
    for parts in runs.values():
        yield np.concatenate([parts[key] for key in sorted(parts)])


def _tdms(path: Path) -> Found:
    for group in TdmsFile.read(path).groups():
        for channel in group.channels():
            yield from _numbers(channel[:])


def _table(table: pa.Table) -> Found:
    for column in table.columns:
        if pa.types.is_dictionary(column.type):
            column = column.combine_chunks().dictionary_decode()
        if pa.types.is_timestamp(column.type) or not pa.types.is_string(column.type):
            yield from _numbers(column.to_numpy())


def _polars(path: Path) -> Found:
    data = path.read_bytes()
    frame = pl.read_ipc(data) if data.startswith(b"ARROW1") else pl.read_ipc_stream(data)
    for series in frame:
        yield from _numbers(series.to_numpy())


def _xlsx(path: Path) -> Found:
    for sheet in openpyxl.load_workbook(path, read_only=True).worksheets:
        yield from _cells([[_cell(value) for value in row] for row in sheet.iter_rows(values_only=True)])


def _cell(value: object) -> float:
    if hasattr(value, "timestamp"):
        return value.timestamp()
    return float(value) if isinstance(value, int | float) else np.nan


def _mcap(path: Path) -> Found:
    series: dict[str, list[float]] = {}

    def walk(name: str, value: Any) -> None:  # noqa: ANN401
        if isinstance(value, dict):
            for key, one in value.items():
                walk(f"{name}.{key}", one)
        elif isinstance(value, int | float):
            series.setdefault(name, []).append(float(value))
        elif hasattr(value, "DESCRIPTOR"):
            for field in value.DESCRIPTOR.fields:
                walk(f"{name}.{field.name}", getattr(value, field.name))
        elif hasattr(value, "__slots__"):
            for field in value.__slots__:
                walk(f"{name}.{field}", getattr(value, field))

    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[Ros2Decoder(), ProtobufDecoder()])
        start = None
        for schema, channel, message in reader.iter_messages():
            start = message.log_time if start is None else start
            series.setdefault(f"{channel.topic} time", []).append((message.log_time - start) * 1e-9)
            if channel.message_encoding == "json":
                walk(channel.topic, json.loads(message.data))
            else:
                factories = (Ros2Decoder(), ProtobufDecoder())
                decoders = (factory.decoder_for(channel.message_encoding, schema) for factory in factories)
                walk(channel.topic, next(decode for decode in decoders if decode)(message.data))
    yield from (np.array(values) for values in series.values())


def _text(path: Path) -> Found:
    data = path.read_bytes()
    if path.suffix == ".gz":
        data = gzip.decompress(data)
    elif path.suffix == ".zst":
        data = zstandard.ZstdDecompressor().decompressobj().decompress(data)
    if data.startswith(codecs.BOM_UTF16_LE):
        text = data.decode("utf-16")
    else:
        text = data.decode("latin-1")
    separator = next((mark for mark in (";", "\t") if text.count(mark) > 1000), None)
    if separator and text.count(",") > text.count("."):
        text = text.replace(",", ".")
    separator = separator or ("," if text.count(",") > 1000 else None)
    rows = [line.replace('"', "").split(separator) for line in text.splitlines() if line and line[0] not in "#%"]
    yield from _cells([[_number(cell) for cell in row] for row in rows])


def _number(cell: str) -> float:
    cell = cell.strip()
    if re.match(r"\d{4}-\d\d-\d\d[T ]", cell):
        return float((np.datetime64(cell.replace("+00:00", ""), "ns").astype(np.int64) - START_NS) * 1e-9)
    try:
        return float(cell)
    except ValueError:
        return np.nan


def _cells(rows: list[list[float]]) -> Found:
    """Yield the columns below the header, with the rows that have at least two numbers."""
    kept = [row for row in rows if np.sum(~np.isnan(row)) >= 2]
    width = max(map(len, kept), default=0)
    table = np.array([row + [np.nan] * (width - len(row)) for row in kept])
    for first in {0, 1, 2, max(len(table) - 3000, 0)}:
        yield from table[first:].T if len(table) else ()


if __name__ == "__main__":
    sys.exit(main())
