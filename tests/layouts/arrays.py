"""NumPy files."""

from __future__ import annotations

from typing import Any

import numpy as np

from book import CONVERTED, Book, mapped

NUMPY = f"numpy {np.__version__}"


def write(book: Book) -> None:
    """Write all NumPy layouts. A matrix in a `.npy` file has no name: its columns are called 1, 2, 3."""
    plain = book.take()
    matrix = np.column_stack(list(plain.values()))
    by_number = mapped(time_s="1", voltage_v="2", displacement_um="3")
    for name, array in (("npy-matrix.npy", matrix), ("npy-matrix-fortran.npy", np.asfortranarray(matrix))):
        np.save(book.path(name), array)
        book.ask(name, NUMPY)
        book.read(name, NUMPY, plain, by_number)
    single = matrix.astype(np.float32)
    np.save(book.path("npy-matrix-float32.npy"), single)
    truth = {name: single[:, k].astype(np.float64) for k, name in enumerate(plain)}
    book.read("npy-matrix-float32.npy", NUMPY, truth, by_number, time_tolerance_s=3e-7)

    _structured(book)
    _archives(book)


def _structured(book: Book) -> None:
    plain = book.take()
    for file, kind in (("npy-structured.npy", "<f8"), ("npy-structured-big-endian.npy", ">f8")):
        table = np.empty(len(plain["time_s"]), dtype=[(name, kind) for name in plain])
        for name, values in plain.items():
            table[name] = values
        np.save(book.path(file), table)
        book.read(file, NUMPY, plain)

    mixed = np.empty(len(plain["time_s"]), dtype=[("time_us", "<u4"), ("voltage_v", "<f8"), ("displacement_um", "<f4")])
    mixed["time_us"] = 1000 * np.arange(len(mixed))
    mixed["voltage_v"] = plain["voltage_v"]
    mixed["displacement_um"] = plain["displacement_um"]
    np.save(book.path("npy-structured-mixed.npy"), mixed)
    truth = plain | {"displacement_um": mixed["displacement_um"].astype(np.float64)}
    book.read("npy-structured-mixed.npy", NUMPY, truth, tolerance=CONVERTED)


def _archives(book: Book) -> None:
    plain: dict[str, Any] = book.take()
    warm: dict[str, Any] = book.take("time_s", "voltage_v", "displacement_um", "temperature_degc")
    np.savez(book.path("npz-named.npz"), **plain)
    book.read("npz-named.npz", NUMPY, plain)
    np.savez_compressed(book.path("npz-compressed.npz"), **warm, settings=np.eye(3), operator=np.array("A. Person"))
    book.read("npz-compressed.npz", NUMPY, warm)

    matrix = np.column_stack(list(plain.values()))
    np.savez(book.path("npz-matrix-columns.npz"), data=matrix, columns=np.array(list(plain)))
    book.read("npz-matrix-columns.npz", NUMPY, plain)
    options = mapped(time_s="data[1]", voltage_v="data[2]", displacement_um="data[3]")
    book.read("npz-matrix-columns.npz", NUMPY, plain, options)

    np.savez(book.path("npz-no-units.npz"), t=plain["time_s"], u=plain["voltage_v"], y=plain["displacement_um"])
    book.ask("npz-no-units.npz", NUMPY, [r"\bu\b", r"\by\b"])
    book.read("npz-no-units.npz", NUMPY, plain, mapped(time_s="t", voltage_v="u", displacement_um="y"))
