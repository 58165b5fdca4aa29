"""Compares reading a million rows with other libraries: `python benches/python/read.py [ROWS]`.

Needs `hyst` from a release build, numpy, pandas, scipy, h5py, pyarrow and npTDMS. Times are medians of five in one run.
Each reader returns three columns of doubles. `hyst` also checks roles, units and evenly spaced times.
"""
import statistics
import sys
import tempfile
import time
from pathlib import Path

import h5py
import hyst
import nptdms
import numpy as np
import pandas
import pyarrow.feather
import pyarrow.parquet
import scipy.io

NAMES = ("time_s", "voltage_v", "displacement_um")


def median(read, times=5):
    """Returns the median time of a reader [s]."""
    spent = []
    for _ in range(times):
        start = time.perf_counter()
        read()
        spent.append(time.perf_counter() - start)
    return statistics.median(spent)


def tdms(path):
    """Reads one channel per column."""
    with nptdms.TdmsFile.open(path) as file:
        return [file["record"][name][:] for name in NAMES]


def hdf5(path):
    """Reads one dataset per column."""
    with h5py.File(path) as file:
        return [file[name][:] for name in NAMES]


def main():
    """Writes the files, reads them and prints a table."""
    rows = int(sys.argv[1]) if len(sys.argv) > 1 else 1_000_000
    t = np.arange(rows) / 1000.0
    u = np.round(60.0 - 60.0 * np.cos(0.7 * t), 4)
    y = np.round(0.12 * u + 0.3 * np.sin(0.7 * t - 0.2), 5)
    frame = pandas.DataFrame(dict(zip(NAMES, (t, u, y))))
    with tempfile.TemporaryDirectory() as folder:
        folder = Path(folder)
        frame.to_csv(folder / "a.csv", index=False)
        np.save(folder / "a.npy", frame.to_records(index=False))
        scipy.io.savemat(folder / "a.mat", {name: frame[name].to_numpy() for name in NAMES})
        with h5py.File(folder / "a.h5", "w") as file:
            for name in NAMES:
                file[name] = frame[name].to_numpy()
        with nptdms.TdmsWriter(folder / "a.tdms") as file:
            file.write_segment([nptdms.ChannelObject("record", name, frame[name].to_numpy()) for name in NAMES])
        table = pyarrow.Table.from_pandas(frame, preserve_index=False)
        pyarrow.parquet.write_table(table, folder / "a.parquet")
        pyarrow.feather.write_feather(table, folder / "a.feather")
        peers = {
            "a.csv": lambda path: pandas.read_csv(path),
            "a.npy": lambda path: np.load(path),
            "a.mat": lambda path: scipy.io.loadmat(path),
            "a.h5": hdf5,
            "a.tdms": tdms,
            "a.parquet": lambda path: pyarrow.parquet.read_table(path).to_pandas(),
            "a.feather": lambda path: pyarrow.feather.read_feather(path),
        }
        print(f"{'file':<12}{'MB':>7}{'hyst':>10}{'peer':>10}{'ratio':>8}{'MB/s':>8}")
        for name, peer in peers.items():
            path = folder / name
            own, other = median(lambda: hyst.read_record(path)), median(lambda: peer(path))
            size = path.stat().st_size / 1e6
            print(f"{name:<12}{size:>7.1f}{own:>9.3f}s{other:>9.3f}s{own / other:>8.2f}{size / own:>8.0f}")


if __name__ == "__main__":
    main()
