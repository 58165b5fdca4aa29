"""MATLAB files: versions 4 and 5 written by scipy.io, version 7.3 written by hdf5storage and by h5py."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import h5py
import hdf5storage
import numpy as np
import scipy
from scipy.io import savemat

from book import Array, Book, mapped

SCIPY = f"scipy {scipy.__version__}"
HDF5STORAGE = f"hdf5storage {hdf5storage.__version__}"
H5PY = f"h5py {h5py.__version__} as MATLAB 7.3"
USER_BLOCK_BYTES = 512


def write(book: Book) -> None:
    """Write all MATLAB layouts."""
    _flat(book)
    _structs(book)
    _matrices(book)
    _simulink(book)
    _dspace(book)
    _version_73(book)


def _flat(book: Book) -> None:
    plain = book.take()
    warm = book.take("time_s", "voltage_v", "displacement_um", "temperature_degc")
    savemat(book.path("mat-v4-flat.mat"), plain, format="4", oned_as="column")
    book.read("mat-v4-flat.mat", SCIPY, plain)

    savemat(book.path("mat-v5-flat-row.mat"), plain, oned_as="row")
    book.read("mat-v5-flat-row.mat", SCIPY, plain)

    savemat(book.path("mat-v5-flat-column-compressed.mat"), warm, oned_as="column", do_compression=True)
    book.read("mat-v5-flat-column-compressed.mat", SCIPY, warm)

    single = {name: values.astype(np.float32) for name, values in plain.items()}
    savemat(book.path("mat-v5-single.mat"), single, do_compression=True)
    book.read("mat-v5-single.mat", SCIPY, _double(single), time_tolerance_s=3e-7)

    bare = {"t": plain["time_s"], "u": plain["voltage_v"], "y": plain["displacement_um"]}
    savemat(book.path("mat-v5-no-units.mat"), bare)
    book.ask("mat-v5-no-units.mat", SCIPY, [r"\bt\b", r"\bu\b", r"\by\b"])
    book.read("mat-v5-no-units.mat", SCIPY, plain, mapped(time_s="t", voltage_v="u", displacement_um="y"))


def _structs(book: Book) -> None:
    plain = book.take()
    savemat(book.path("mat-v5-struct.mat"), {"data": plain}, oned_as="column")
    book.read("mat-v5-struct.mat", SCIPY, plain)

    rig: dict[str, Any] = {
        "operator": "A. Person",
        "settings": {"gain": 2.0, "matrix": np.eye(3), "notes": np.array(["first", "second"], dtype=object)},
        "run": {"comment": "closed lid", "signals": plain},
    }
    savemat(book.path("mat-v5-nested.mat"), {"rig": rig, "version": 3.0, "empty": []}, do_compression=True)
    book.read("mat-v5-nested.mat", SCIPY, plain)

    bare = {"time": plain["time_s"], "in": plain["voltage_v"], "out": plain["displacement_um"]}
    savemat(book.path("mat-v5-struct-no-units.mat"), {"data": bare}, oned_as="column")
    book.ask("mat-v5-struct-no-units.mat", SCIPY, ["data.in", "data.out"])
    options = mapped(time_s="data.time", voltage_v="data.in", displacement_um="data.out")
    book.read("mat-v5-struct-no-units.mat", SCIPY, plain, options)


def _matrices(book: Book) -> None:
    plain = book.take()
    matrix = np.column_stack(list(plain.values()))
    names = np.array(["Time (s)", "Voltage (V)", "Displacement (um)"], dtype=object)
    options = mapped(time_s="data[1]", voltage_v="data[2]", displacement_um="data[3]")

    savemat(book.path("mat-v5-matrix-names.mat"), {"data": matrix, "names": names})
    book.read("mat-v5-matrix-names.mat", SCIPY, plain)
    book.read("mat-v5-matrix-names.mat", SCIPY, plain, options)

    savemat(book.path("mat-v5-matrix.mat"), {"data": matrix}, do_compression=True)
    book.ask("mat-v5-matrix.mat", SCIPY, [r"data\[[123]\]"])
    book.read("mat-v5-matrix.mat", SCIPY, plain, options)


def _simulink(book: Book) -> None:
    """Simulink: `timeseries` saved as plain structs, and "To Workspace" in the format "Structure With Time"."""
    plain = book.take()
    series = {
        name: {
            "Name": name,
            "Time": plain["time_s"],
            "TimeInfo": {"Units": "seconds", "Start": 0.0, "End": 2.999, "Increment": 0.001},
            "Data": plain[column],
            "DataInfo": {"Units": unit, "Interpolation": "linear"},
        }
        for name, column, unit in (("voltage", "voltage_v", "V"), ("displacement", "displacement_um", "um"))
    }
    savemat(book.path("mat-v5-timeseries-units.mat"), series, oned_as="column")
    book.read("mat-v5-timeseries-units.mat", SCIPY, plain)

    short = {name: {"Time": one["Time"], "Data": one["Data"]} for name, one in series.items()}
    savemat(book.path("mat-v5-timeseries.mat"), short, oned_as="column")
    book.ask("mat-v5-timeseries.mat", SCIPY, ["voltage.Data", "displacement.Data"])
    options = mapped(time_s="voltage.Time", voltage_v="voltage.Data", displacement_um="displacement.Data")
    book.read("mat-v5-timeseries.mat", SCIPY, plain, options)

    # Simulink defines `time` as simulation time in seconds. `tout` is the solver's time and comes along.
    signals = _struct_array(
        [
            {"values": _column(plain[name]), "dimensions": 1.0, "label": name, "blockName": f"rig/{name}"}
            for name in ("voltage_v", "displacement_um")
        ]
    )
    out = {"time": _column(plain["time_s"]), "signals": signals, "blockName": "rig/To Workspace"}
    savemat(book.path("mat-v5-structure-with-time.mat"), {"out": out, "tout": _column(plain["time_s"])})
    book.read("mat-v5-structure-with-time.mat", SCIPY, plain)


def _dspace(book: Book) -> None:
    """dSPACE ControlDesk: X has the time axis, Y the variables, each with name, unit and data."""
    warm = book.take("time_s", "voltage_v", "displacement_um", "temperature_degc")
    paths = ("Model Root/Amplifier/Out1", "Model Root/Sensor/Out1", "Model Root/Temperature/Out1")
    for file, units in (("mat-v5-controldesk.mat", ("s", "V", "µm", "°C")), ("mat-v5-controldesk-no-units.mat", None)):
        unit = units or ("s", "-", "-", "-")
        x = {"Name": "Time", "Type": 4.0, "Unit": unit[0], "Data": warm["time_s"]}
        y = [
            {"Name": path, "Type": 8.0, "Unit": unit[k + 1], "XIndex": 1.0, "Data": values}
            for k, (path, values) in enumerate(zip(paths, list(warm.values())[1:], strict=True))
        ]
        capture = {"HostService": "Platform", "TriggerEnabled": 0.0}
        experiment = {"X": _struct_array([x]), "Y": _struct_array(y), "Capture": capture, "RTProgram": "rig.sdf"}
        savemat(book.path(file), {"exp1": experiment}, oned_as="row")
    book.read("mat-v5-controldesk.mat", "scipy as dSPACE ControlDesk", warm)
    options = mapped(voltage_v=paths[0], displacement_um=paths[1], temperature_degc=paths[2])
    book.read("mat-v5-controldesk.mat", "scipy as dSPACE ControlDesk", warm, options)
    book.ask("mat-v5-controldesk-no-units.mat", "scipy as dSPACE ControlDesk", [paths[0], paths[1]])
    book.read("mat-v5-controldesk-no-units.mat", "scipy as dSPACE ControlDesk", warm, options)


def _version_73(book: Book) -> None:
    plain = book.take()
    warm = book.take("time_s", "voltage_v", "displacement_um", "temperature_degc")
    for name in ("mat73-flat.mat", "mat73-struct.mat"):
        book.path(name).unlink(missing_ok=True)  # hdf5storage adds to a file that is there
    hdf5storage.savemat(str(book.path("mat73-flat.mat")), dict(warm), format="7.3", oned_as="column")
    book.read("mat73-flat.mat", HDF5STORAGE, warm)
    hdf5storage.savemat(str(book.path("mat73-struct.mat")), {"data": dict(plain)}, format="7.3", oned_as="row")
    book.read("mat73-struct.mat", HDF5STORAGE, plain)

    with _matlab_73(book.path("mat73-h5py-struct.mat")) as file:
        group = file.create_group("rig/run")
        for struct in (file["rig"], group):
            struct.attrs["MATLAB_class"] = np.bytes_("struct")
        for name, values in plain.items():
            _numbers(group, name, values[:, None])
        _text(file["rig"], "operator", "A. Person")
    _user_block(book.path("mat73-h5py-struct.mat"))
    book.read("mat73-h5py-struct.mat", H5PY, plain)

    with _matlab_73(book.path("mat73-h5py-matrix-names.mat")) as file:
        _numbers(file, "data", np.column_stack(list(plain.values())))
        refs = file.create_group("#refs#")
        labels = ("Time (s)", "Voltage (V)", "Displacement (µm)")
        cells = [_text(refs, letter, label).ref for letter, label in zip("abc", labels, strict=True)]
        names = file.create_dataset("names", data=np.array([[cell] for cell in cells], dtype=h5py.ref_dtype))
        names.attrs["MATLAB_class"] = np.bytes_("cell")
    _user_block(book.path("mat73-h5py-matrix-names.mat"))
    book.read("mat73-h5py-matrix-names.mat", H5PY, plain)
    options = mapped(time_s="data[1]", voltage_v="data[2]", displacement_um="data[3]")
    book.read("mat73-h5py-matrix-names.mat", H5PY, plain, options)


def _matlab_73(path: Path) -> h5py.File:
    return h5py.File(path, "w", userblock_size=USER_BLOCK_BYTES)


def _numbers(parent: h5py.Group, name: str, matrix: Array) -> None:
    """MATLAB stores columns first, so the dataset is the transposed matrix."""
    data = parent.create_dataset(name, data=matrix.T, compression="gzip", compression_opts=3)
    data.attrs["MATLAB_class"] = np.bytes_("double")


def _text(parent: h5py.Group, name: str, text: str) -> h5py.Dataset:
    codes = np.frombuffer(text.encode("utf-16-le"), dtype="<u2")
    data = parent.create_dataset(name, data=codes[:, None])
    data.attrs["MATLAB_class"] = np.bytes_("char")
    data.attrs["MATLAB_int_decode"] = np.int32(2)
    return data


def _user_block(path: Path) -> None:
    """Write MATLAB's header into the user block: 116 bytes of text, an offset, version 2.0, byte order mark."""
    text = b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Mon May 13 08:21:14 2024 HDF5 schema 1.00 ."
    with path.open("r+b") as file:
        file.write(text.ljust(116) + bytes(8) + b"\x00\x02IM")


def _struct_array(items: Sequence[Mapping[str, Any]]) -> np.ndarray:
    """Return a 1×n struct array."""
    array = np.empty((1, len(items)), dtype=[(name, object) for name in items[0]])
    for k, item in enumerate(items):
        for name, value in item.items():
            array[0, k][name] = value
    return array


def _column(values: Array) -> Array:
    return values[:, None]


def _double(columns: Mapping[str, np.ndarray]) -> dict[str, Array]:
    return {name: values.astype(np.float64) for name, values in columns.items()}
