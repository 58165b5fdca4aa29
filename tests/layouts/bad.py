"""Files that no record can be read from: cut off, forged, hostile, or about something else."""

from __future__ import annotations

import gzip
import io
import struct
import sys
import zipfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import zstandard
from mcap.writer import CompressionType, Writer
from scipy.io import savemat

from book import SEED, Book
from text import lines, printed

MIB = 1 << 20
BOMB_BYTES = 200_000_000
BOMB_VALUES = BOMB_BYTES // 8
MAT_NESTING = 50_000
JSON_NESTING = 200_000
GROUP_NESTING = 20_000
HEAD = "time_s,voltage_v,displacement_um"
PNG = bytes.fromhex("89504e470d0a1a0a0000000d49484452000000100000001008060000001ff3ff61")
FORGED = "forged header"
BOMB = "decompression bomb"
# These are cut at 60 % of their length. A reader may save what is there from a TDMS file or a log, and say so.
CUT_SHARE = 0.6
CUT = (
    "mat-v4-flat.mat",
    "mat-v5-flat-row.mat",
    "mat-v5-flat-column-compressed.mat",
    "mat73-flat.mat",
    "hdf5-flat-latest.h5",
    "parquet-snappy.parquet",
    "arrow-feather-lz4.feather",
    "arrow-stream.arrows",
    "xlsx-header.xlsx",
    "npy-structured.npy",
    "npz-named.npz",
    "csv-pandas.csv.gz",
    "csv-pandas.csv.zst",
)
CUT_OR_SAVED = ("tdms-ten-segments.tdms", "mcap-json-two-topics.mcap")


def write(book: Book) -> None:
    """Write all bad files. The layouts that are cut have to be there already."""
    _cut(book)
    _empty_and_foreign(book)
    _forged_sizes(book)
    _text(book)
    _bombs(book)
    _deep(book)
    _wide(book)


def _put(book: Book, name: str, data: bytes, what: str, says: tuple[str, ...] = ()) -> None:
    book.path(name).write_bytes(data)
    book.refuse(name, what, says)


def _cut(book: Book) -> None:
    for name in CUT:
        data = book.path(name).read_bytes()
        _put(book, f"bad-cut-{name}", data[: int(CUT_SHARE * len(data))], "cut off")
    for name in CUT_OR_SAVED:
        data = book.path(name).read_bytes()
        book.path(f"bad-cut-{name}").write_bytes(data[: int(CUT_SHARE * len(data))])
        original = next(entry for entry in book.entries if entry["file"] == name)
        columns = {column: np.load(book.folder / "truth" / file) for column, file in original["columns"].items()}
        says = ["cut|trunc|damag|incomplete|unfinished|corrupt|end of file|ends"]
        settings: dict[str, Any] = {"time_from": "start", "partial": True, "segments": None, "alternative": "refuse"}
        book.read(f"bad-cut-{name}", "cut off", columns, says=says, **settings)

    truth = printed(book)
    body = [HEAD, *lines(list(truth.values()), ["%.6f", "%.5f", "%.6f"])]
    last = body[1800].rsplit(",", 1)[0]
    _put(book, "bad-cut-csv.csv", "\n".join([*body[:1800], last]).encode(), "cut off", (r"\b1801\b",))


def _empty_and_foreign(book: Book) -> None:
    for name in ("bad-empty.csv", "bad-empty.mat", "bad-empty.parquet"):
        _put(book, name, b"", "empty file")
    for name, data in (("bad-header-only.csv", HEAD.encode() + b"\n"), ("bad-blank.csv", b"\n\n  \n")):
        _put(book, name, data, "no rows")
    noise = np.random.default_rng(SEED + 2).bytes(20_000)
    for suffix in ("mat", "h5", "tdms", "npy", "mcap", "csv"):
        _put(book, f"bad-noise.{suffix}", noise, "random bytes")
    for suffix in ("csv", "parquet", "xlsx"):
        _put(book, f"bad-picture.{suffix}", PNG + noise, "a picture under another name")
    _put(book, "bad-word.docx", _zip({"word/document.xml": b"<w:document/>"}), "another document in a ZIP archive")
    _put(book, "bad-old-workbook.xls", bytes.fromhex("d0cf11e0a1b11ae1") + noise, "workbook of before 2007")
    # Arrays of Python objects are pickled: to load them would run code from the file.
    stream = io.BytesIO()
    np.save(stream, np.array([{"time_s": 0.0}], dtype=object), allow_pickle=True)
    _put(book, "bad-pickle.npy", stream.getvalue(), "numpy with pickled objects")


def _forged_sizes(book: Book) -> None:
    """Headers that claim far more than the file has."""
    plain = book.take()
    for name, shape in (("bad-huge-rows.npy", "(1000000000000, 3)"), ("bad-overflow.npy", "(18446744073709551615, 3)")):
        claim = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}".ljust(117) + "\n"
        head = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(claim)) + claim.encode()
        _put(book, name, head + bytes(2400), FORGED)
    long_header = b"\x93NUMPY\x02\x00" + struct.pack("<I", 0xFFFFFFFF) + b"{'descr': '<f8'"
    _put(book, "bad-huge-header.npy", long_header, FORGED)

    data = bytearray(book.path("mat-v4-flat.mat").read_bytes())
    struct.pack_into("<2i", data, 4, 0x7FFFFFFF, 0x7FFFFFFF)
    _put(book, "bad-huge-dims-v4.mat", bytes(data), FORGED)
    stream = io.BytesIO()
    savemat(stream, plain, oned_as="column")
    data = bytearray(stream.getvalue())
    struct.pack_into("<I", data, 132, 0xFFFFFFF0)
    _put(book, "bad-huge-element-v5.mat", bytes(data), FORGED)
    data = bytearray(stream.getvalue())
    struct.pack_into("<2i", data, 160, 0x7FFFFFFF, 0x7FFFFFFF)
    _put(book, "bad-huge-dims-v5.mat", bytes(data), FORGED)

    # 8 TB a column, and none of it stored: HDF5 keeps only the fill value.
    with h5py.File(book.path("bad-huge-unwritten.h5"), "w") as file:
        for name in plain:
            file.create_dataset(name, shape=(2**40,), dtype="<f8", chunks=(4096,))
    book.refuse("bad-huge-unwritten.h5", "h5py, 2^40 rows without data")

    data = bytearray(book.path("parquet-snappy.parquet").read_bytes())
    data[-8:-4] = struct.pack("<I", 0x7FFFFFFF)
    _put(book, "bad-huge-footer.parquet", bytes(data), FORGED)
    data = bytearray(book.path("arrow-feather-lz4.feather").read_bytes())
    data[-10:-6] = struct.pack("<i", 0x7FFFFFFF)
    _put(book, "bad-huge-footer.feather", bytes(data), FORGED)
    data = bytearray(book.path("arrow-stream.arrows").read_bytes())
    data[4:8] = struct.pack("<i", 0x7FFFFFFF)
    _put(book, "bad-huge-message.arrows", bytes(data), FORGED)

    data = bytearray(book.path("tdms-waveform.tdms").read_bytes())
    at = data.find(struct.pack("<IQ", 1, len(plain["time_s"])))
    struct.pack_into("<Q", data, at + 4, 1 << 60)
    _put(book, "bad-huge-count.tdms", bytes(data), FORGED)
    magic = b"\x89MCAP0\r\n"
    _put(book, "bad-huge-record.mcap", magic + b"\x01" + struct.pack("<Q", 1 << 60) + b"abc", FORGED)
    chunk = struct.pack("<QQQII", 0, 1, 1 << 40, 0, 4) + b"zstd" + struct.pack("<Q", 4) + b"\x28\xb5\x2f\xfd"
    header = struct.pack("<BQII", 1, 8, 0, 0)
    record = header + struct.pack("<BQ", 6, len(chunk)) + chunk
    _put(book, "bad-huge-chunk.mcap", magic + record + magic, FORGED)


def _text(book: Book) -> None:
    truth = printed(book)
    rows = lines(list(truth.values()), ["%.6f", "%.5f", "%.6f"])
    faults = {
        "bad-word-in-cell.csv": ([*rows[:700], "0.7,oops,1.0", *rows[701:]], r"\b702\b"),
        "bad-ragged-row.csv": ([*rows[:700], rows[700] + ",1.0", *rows[701:]], r"\b702\b"),
        "bad-unsorted-time.csv": ([*rows[:700], rows[720], *rows[701:]], r"\b70[123]\b"),
    }
    for name, (body, says) in faults.items():
        _put(book, name, "\n".join([HEAD, *body, ""]).encode(), "faulty table", (says,))
    head = HEAD.replace("_um", "_furlong")
    _put(book, "bad-unknown-unit.csv", "\n".join([head, *rows, ""]).encode(), "unknown unit", ("furlong",))
    two = "\n".join(["time_s,voltage_v", *(row.rsplit(",", 1)[0] for row in rows), ""])
    for column, name in ((1, "bad-still-input.csv"), (2, "bad-still-output.csv")):
        still = [row.split(",") for row in rows]
        for cells in still:
            cells[column] = "1.5"
        _put(book, name, "\n".join([HEAD, *map(",".join, still), ""]).encode(), "a channel that never moves")
    wide = ",".join(f"channel {k}" for k in range(100_000))
    row = ",".join(["1.5"] * 100_000)
    _put(book, "bad-100000-columns.csv", f"{wide}\n{row}\n{row}\n".encode(), "100,000 columns")
    _put(book, "bad-one-line.csv", b"1.5," * 5_000_000, "one line of 20 MB")


def _zeros() -> Iterator[bytes]:
    block = bytes(MIB)
    for start in range(0, BOMB_BYTES, MIB):
        yield block[: min(MIB, BOMB_BYTES - start)]


def _bombs(book: Book) -> None:
    """Small files that unpack to 200 MB of zeros."""
    with gzip.GzipFile(book.path("bad-bomb.csv.gz"), "wb", mtime=0) as out:
        out.writelines(_zeros())
    with book.path("bad-bomb.csv.zst").open("wb") as raw, zstandard.ZstdCompressor().stream_writer(raw) as out:
        for block in _zeros():
            out.write(block)
    for name in ("bad-bomb.csv.gz", "bad-bomb.csv.zst"):
        book.refuse(name, BOMB)

    # One member claims 25 million rows; another claims 3000 rows and goes on after them.
    plain = book.take()
    _npz_bomb(book.path("bad-bomb-rows.npz"), BOMB_VALUES, plain)
    _npz_bomb(book.path("bad-bomb-tail.npz"), len(plain["time_s"]), plain)
    for name in ("bad-bomb-rows.npz", "bad-bomb-tail.npz"):
        book.refuse(name, BOMB)

    columns = plain | {"voltage_v": np.zeros(BOMB_VALUES)}
    savemat(book.path("bad-bomb.mat"), columns, do_compression=True)
    book.refuse("bad-bomb.mat", BOMB)

    with (
        zipfile.ZipFile(book.path("xlsx-header.xlsx")) as source,
        zipfile.ZipFile(book.path("bad-bomb.xlsx"), "w", zipfile.ZIP_DEFLATED) as target,
    ):
        for member in source.namelist():
            if not member.startswith("xl/worksheets/sheet"):
                target.writestr(member, source.read(member))
        with target.open("xl/worksheets/sheet1.xml", "w") as out:
            out.write(b'<worksheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"><sheetData>')
            for block in _zeros():
                out.write(block.replace(b"\0", b" "))
            out.write(b"</sheetData></worksheet>")
    book.refuse("bad-bomb.xlsx", BOMB)

    with book.path("bad-bomb.mcap").open("wb") as file:
        writer = Writer(file, compression=CompressionType.ZSTD)
        writer.start()
        channel = writer.register_channel("/amplifier", "json", writer.register_schema("Sample", "jsonschema", b"{}"))
        writer.add_message(channel, log_time=1, publish_time=1, data=bytes(BOMB_BYTES))
        writer.finish()
    book.refuse("bad-bomb.mcap", BOMB)


def _npz_bomb(path: Path, claimed_rows: int, plain: dict[str, np.ndarray]) -> None:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, values in plain.items():
            with archive.open(f"{name}.npy", "w", force_zip64=True) as out:
                if name != "voltage_v":
                    np.lib.format.write_array(out, values)
                    continue
                header = {"descr": "<f8", "fortran_order": False, "shape": (claimed_rows,)}
                np.lib.format.write_array_header_1_0(out, header)
                for block in _zeros():
                    out.write(block)


def _deep(book: Book) -> None:
    nested: dict[str, object] = {"time_s": np.arange(3.0)}
    for _ in range(MAT_NESTING):
        nested = {"a": nested}
    limit = sys.getrecursionlimit()
    sys.setrecursionlimit(20 * MAT_NESTING)
    savemat(book.path("bad-deep.mat"), nested)
    sys.setrecursionlimit(limit)
    book.refuse("bad-deep.mat", f"struct in struct, {MAT_NESTING} levels")

    with book.path("bad-deep-json.mcap").open("wb") as file:
        writer = Writer(file, compression=CompressionType.NONE)
        writer.start()
        channel = writer.register_channel("/amplifier", "json", writer.register_schema("Sample", "jsonschema", b"{}"))
        message = b'{"a":' * JSON_NESTING + b"1" + b"}" * JSON_NESTING
        for k in range(3):
            writer.add_message(channel, log_time=k, publish_time=k, data=message)
        writer.finish()
    book.refuse("bad-deep-json.mcap", f"JSON nested {JSON_NESTING} deep")

    with h5py.File(book.path("bad-deep.h5"), "w", libver="latest") as file:
        group = file
        for _ in range(GROUP_NESTING):
            group = group.create_group("a")
        group["time_s"] = np.arange(3.0)
    book.refuse("bad-deep.h5", f"group in group, {GROUP_NESTING} levels")

    with h5py.File(book.path("bad-many-datasets.h5"), "w") as file:
        for k in range(5000):
            file[f"channel with a long name number {k:05}"] = np.arange(4.0)
    book.refuse("bad-many-datasets.h5", "5000 datasets")


def _wide(book: Book) -> None:
    """Columns of different lengths do not make a table."""
    columns: dict[str, Any] = book.take()
    columns["displacement_um"] = columns["displacement_um"][:-100]
    stream = io.BytesIO()
    np.savez(stream, **columns)
    _put(book, "bad-lengths.npz", stream.getvalue(), "columns of different lengths", (r"\b2900\b",))


def _zip(members: dict[str, bytes]) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return stream.getvalue()
