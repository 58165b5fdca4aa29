"""HDF5 files written by h5py."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np

from book import CONVERTED, Book, Columns, mapped

H5PY = f"h5py {h5py.__version__} (HDF5 {h5py.version.hdf5_version})"
UNITS = {"time": "s", "voltage": "V", "displacement": "µm"}


def write(book: Book) -> None:
    """Write all HDF5 layouts."""
    _flat(book)
    _units(book)
    _tables(book)
    _storage(book)
    _scaled(book)
    _groups(book)


def _flat(book: Book) -> None:
    plain = book.take()
    for version in ("earliest", "latest"):
        name = f"hdf5-flat-{version}.h5"
        with h5py.File(book.path(name), "w", libver=version) as file:
            for column, values in plain.items():
                file[column] = values
        book.read(name, H5PY, plain)

    with h5py.File(book.path("hdf5-no-units.h5"), "w") as file:
        for name, values in zip(("t", "drive", "sensor"), plain.values(), strict=True):
            file[f"log/{name}"] = values
    book.ask("hdf5-no-units.h5", H5PY, ["/log/drive", "/log/sensor"])
    options = mapped(time_s="/log/t", voltage_v="/log/drive", displacement_um="/log/sensor")
    book.read("hdf5-no-units.h5", H5PY, plain, options)

    with h5py.File(book.path("hdf5-no-time.h5"), "w") as file:
        for column in ("voltage_v", "displacement_um"):
            file[column] = plain[column]
    book.ask("hdf5-no-time.h5", H5PY, ["--rate"], paste=False)
    book.read("hdf5-no-time.h5", H5PY, plain, ["--rate", "1000"])


def _units(book: Book) -> None:
    plain = book.take()
    with h5py.File(book.path("hdf5-units-attribute.h5"), "w") as file:
        _with_units(file, plain, "units")
    book.read("hdf5-units-attribute.h5", H5PY, plain)

    with h5py.File(book.path("hdf5-nested-unit-fixed.h5"), "w", libver="latest") as file:
        file.attrs["title"] = "piezo stack 7"
        group = file.create_group("experiment/raw")
        for name, values in zip(UNITS, plain.values(), strict=True):
            group[name] = values
            group[name].attrs["unit"] = np.bytes_(UNITS[name].replace("µ", "u"))
        file["experiment/settings/gains"] = np.eye(4)
    book.read("hdf5-nested-unit-fixed.h5", H5PY, plain)

    # netCDF-4 style: time is a dimension scale of the two signals.
    with h5py.File(book.path("hdf5-dimension-scales.h5"), "w") as file:
        _with_units(file, plain, "units")
        file["time"].make_scale("time")
        for name in ("voltage", "displacement"):
            file[name].dims[0].attach_scale(file["time"])
    book.read("hdf5-dimension-scales.h5", H5PY, plain)


def _tables(book: Book) -> None:
    plain = book.take()
    matrix = np.column_stack(list(plain.values()))
    with h5py.File(book.path("hdf5-table-columns.h5"), "w") as file:
        file["data"] = matrix
        file["data"].attrs["columns"] = list(plain)
    book.read("hdf5-table-columns.h5", H5PY, plain)

    with h5py.File(book.path("hdf5-table-names-units.h5"), "w") as file:
        file["run/data"] = matrix
        file["run/data"].attrs["names"] = np.array(list(UNITS), dtype="S")
        file["run/data"].attrs["units"] = np.array(["s", "V", "um"], dtype="S")
    book.read("hdf5-table-names-units.h5", H5PY, plain)

    with h5py.File(book.path("hdf5-table-bare.h5"), "w") as file:
        file["run/data"] = matrix
    book.ask("hdf5-table-bare.h5", H5PY, [r"/run/data"])
    options = mapped(time_s="/run/data[1]", voltage_v="/run/data[2]", displacement_um="/run/data[3]")
    book.read("hdf5-table-bare.h5", H5PY, plain, options)

    compound = np.empty(len(matrix), dtype=[(name, "<f8") for name in plain] + [("flag", "u1")])
    compound["flag"] = 1
    for name, values in plain.items():
        compound[name] = values
    with h5py.File(book.path("hdf5-compound.h5"), "w") as file:
        file.create_dataset("table", data=compound, chunks=(512,), compression="gzip")
    book.read("hdf5-compound.h5", H5PY, plain)


def _storage(book: Book) -> None:
    plain = book.take()
    gzip = {"chunks": (700,), "compression": "gzip", "shuffle": True, "fletcher32": True}
    _stored(book.path("hdf5-gzip-shuffle.h5"), plain, "earliest", **gzip)
    book.read("hdf5-gzip-shuffle.h5", H5PY, plain)
    growing = {"chunks": (128,), "maxshape": (None,), "compression": "gzip"}
    _stored(book.path("hdf5-growing-latest.h5"), plain, "latest", **growing)
    book.read("hdf5-growing-latest.h5", H5PY, plain)
    _stored(book.path("hdf5-lzf.h5"), plain, "earliest", chunks=(700,), compression="lzf")
    book.read("hdf5-lzf.h5", H5PY, plain, alternative="refuse")

    single = {name: values.astype(np.float32) for name, values in plain.items()}
    single["time_s"] = plain["time_s"]
    _stored(book.path("hdf5-float32.h5"), single, "earliest")
    book.read("hdf5-float32.h5", H5PY, {name: values.astype(np.float64) for name, values in single.items()})
    swapped = {name: values.astype(">f8") for name, values in plain.items()}
    _stored(book.path("hdf5-big-endian.h5"), swapped, "earliest")
    book.read("hdf5-big-endian.h5", H5PY, plain)


def _scaled(book: Book) -> None:
    """Integer codes with the attributes of the netCDF (CF) convention: value = code · scale_factor + add_offset.

    The values in volts and µm are right and a question is honest; codes taken as volts are wrong.
    """
    plain = book.take()
    steps = {"voltage_v": (0.004, 50.0), "displacement_um": (0.0005, 6.0)}
    columns = {"time_s": plain["time_s"]}
    with h5py.File(book.path("hdf5-scaled-codes.h5"), "w") as file:
        file["time"] = plain["time_s"]
        file["time"].attrs["units"] = "s"
        for column, (step, offset) in steps.items():
            name, unit = column.split("_")
            codes = np.round((plain[column] - offset) / step).astype(np.int16)
            file[name] = codes
            file[name].attrs.update({"units": {"v": "V", "um": "um"}[unit], "scale_factor": step, "add_offset": offset})
            columns[column] = codes * step + offset
    book.read("hdf5-scaled-codes.h5", H5PY, columns, tolerance=CONVERTED, alternative="ask")


def _groups(book: Book) -> None:
    """One group a segment on one clock. Names sort as run_1, run_10, run_11, run_12, run_2."""
    plain = book.take()
    runs = 12
    segment = np.repeat(np.arange(runs), len(plain["time_s"]) // runs)
    columns = plain | {"time_s": np.round(plain["time_s"] + 0.5 * segment, 3)}
    with h5py.File(book.path("hdf5-group-per-segment.h5"), "w") as file:
        for run in range(runs):
            for name, values in columns.items():
                file[f"run_{run + 1}/{name}"] = values[segment == run]
    book.read("hdf5-group-per-segment.h5", H5PY, columns, segments=runs)

    # A hard link back to the parent makes a cycle, a soft link leads nowhere. Both have to end.
    with h5py.File(book.path("hdf5-cycle.h5"), "w") as file:
        for name, values in plain.items():
            file[f"run/{name}"] = values
        file["run/again"] = file["run"]
        file["run/nowhere"] = h5py.SoftLink("/missing")
    book.read("hdf5-cycle.h5", H5PY, plain, alternative="ask")


def _with_units(file: h5py.File, plain: Columns, attribute: str) -> None:
    for (name, unit), values in zip(UNITS.items(), plain.values(), strict=True):
        file[name] = values
        file[name].attrs[attribute] = unit


def _stored(path: Path, columns: dict[str, np.ndarray], version: str, **storage: object) -> None:
    with h5py.File(path, "w", libver=version) as file:
        for name, values in columns.items():
            file.create_dataset(name, data=values, **storage)
