"""Tests a fleet on local cores and on Ray: kills drivers and a worker, and compares the tables.

    python benches/python/fleet.py FOLDER [--count 300] [--only threads|ray]

Needs `hyst` from a release build and `pip install pandas pyarrow ray`. FOLDER (created) contains the records and the
tables. Takes about 45 minutes for 300 actuators on 2 cores. The exit code is 1 if a row is missing, duplicated or
different (between the tables, or from a single diagnosis), or if 2 workers are less than 1.7 times as fast as one.

The records are play operators with noise and, in turn, no effect, a lag, creep or a delay. The test checks that the
rows are complete and equal, not that the named effects are right.
"""

import argparse
import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import hyst
import hyst.fleet
import numpy as np
import pandas

CORRUPT, PERIOD = 5, 1e-3
#: Shares of the rows after which a worker and the driver are killed.
WORKER_KILLED, DRIVER_KILLED = 0.2, 0.5
MIN_SPEED_UP = 1.7


def actuator(k):
    """Returns a record of play operators for 3 s of a growing sweep, with the effect number k mod 4."""
    rng = np.random.default_rng(k)
    t = np.arange(3000) * PERIOD
    u = np.clip(50 - 50 * np.cos(2 * np.pi * (0.5 + 0.5 * t) * t) * (0.4 + 0.2 * t), 0, 100)
    weights = rng.uniform(0.5, 1.5, 3) * [0.02, 0.015, 0.01]
    y = hyst.Pi(gain=0.05, thresholds=[4.0, 12.0, 25.0], weights=weights).simulate(u)
    if k % 4 == 1:
        y = hyst.Lag(seconds=rng.uniform(2e-3, 8e-3), period=PERIOD).simulate(y)
    if k % 4 == 2:
        y = y + rng.uniform(0.05, 0.15) * hyst.Lag(seconds=rng.uniform(0.2, 0.8), period=PERIOD).simulate(y)
    if k % 4 == 3:
        delay = int(rng.integers(3, 12))
        y = np.concatenate([np.full(delay, y[0]), y[:-delay]])
    return hyst.Record(t, u, y + rng.normal(0, 0.003, len(t)))


def make(folder, count):
    """Writes `count` files. The last five are corrupt in five ways."""
    folder.mkdir(parents=True)
    for k in range(count):
        actuator(k).save(folder / f"P-{k:04}.csv")
    head = "time_s,voltage_v,displacement_um\n"
    good = (folder / f"P-{count - 1:04}.csv").read_text()
    broken = [b"", head.encode(), good.encode()[: len(head) + 7], good.replace("displacement_um", "x y").encode(), np.random.default_rng(0).bytes(4000)]
    for k, content in zip(range(count - CORRUPT, count), broken):
        (folder / f"P-{k:04}.csv").write_bytes(content)


DRIVE = """
import sys, hyst.fleet
folder, out, jobs, address = sys.argv[1:]
hyst.fleet.diagnose(folder, out, model="pi", jobs=int(jobs), address=address or None)
"""


def drive(folder, out, workers, ray):
    return subprocess.Popen([sys.executable, "-c", DRIVE, folder, out, str(workers), "auto" if ray else ""])


def lines(out):
    journal = out.with_name(out.name + ".journal")
    return journal.read_bytes().splitlines(keepends=True) if journal.exists() else []


def reach(driver, out, rows):
    """Waits until the journal has `rows` rows."""
    while len(lines(out)) < rows:
        if driver.poll() is not None:
            raise SystemExit(f"the driver ended with {driver.returncode} after {len(lines(out))} rows")
        time.sleep(0.05)


def resident(process):
    """Returns the resident memory of a process [MB]."""
    for line in Path(f"/proc/{process.pid}/status").read_text().splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1]) / 1024
    return 0.0


def worker_pid():
    """Returns a process of Ray that computes a row."""
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            if path.read_bytes().startswith(b"ray::_row"):
                return int(path.parent.name)
        except OSError:
            pass
    return None


class Cluster:
    """A local Ray cluster; without `ray` it does nothing."""

    def __init__(self, workers, ray):
        self.workers, self.program = workers, Path(sys.executable).with_name("ray") if ray else None

    def __enter__(self):
        if self.program:
            start = [self.program, "start", "--head", f"--num-cpus={self.workers}", "--include-dashboard=false"]
            subprocess.run(start, check=True, stdout=subprocess.DEVNULL)

    def __exit__(self, *_):
        if self.program:
            subprocess.run([self.program, "stop"], check=True, stdout=subprocess.DEVNULL)


def killed_and_resumed(records, out, count, ray):
    """Kills worker and driver, repeats the call, and returns the table and the checks."""
    with Cluster(2, ray):
        driver = drive(records, out, 2, ray)
        if ray:
            reach(driver, out, int(WORKER_KILLED * count))
            while (worker := worker_pid()) is None:
                time.sleep(0.01)
            os.kill(worker, signal.SIGKILL)
            print(f"  a worker killed at {len(lines(out))} rows", flush=True)
        reach(driver, out, int(DRIVER_KILLED * count))
        driver.kill()
        driver.wait()
        before = lines(out)
        # An incomplete last line is a row that was being written.
        before = before if not before or before[-1].endswith(b"\n") else before[:-1]
        print(f"  the driver killed at {len(before)} rows", flush=True)
        driver, memory = drive(records, out, 2, ray), []
        for part in (0.67, 0.97):
            reach(driver, out, int(part * count))
            memory.append((len(lines(out)) - len(before), resident(driver)))
        assert driver.wait() == 0
    after = lines(out)
    table = pandas.read_parquet(out)
    failed = table[table.error.notna()]
    files = [json.loads(line)["file"] for line in after]
    print(f"  {len(table) - len(failed)} results and {len(failed)} failures:")
    for _, row in failed.iterrows():
        print(f"    {row.error[:140]!r}")
    print("  driver's memory after " + ", ".join(f"{rows} rows {mb:.1f} MB" for rows, mb in memory))
    checks = {
        "rows before the kill untouched": after[: len(before)] == before,
        "nothing lost": sorted(map(os.path.basename, files)) == sorted(path.name for path in records.iterdir()),
        "nothing done twice": len(files) == len(set(files)) == count,
        f"{count - CORRUPT} results and {CORRUPT} failures": len(failed) == CORRUPT and len(table) == count,
    }
    return table, checks


def same(a, b):
    """Returns whether two tables are bit-identical, except the column of the time."""
    a, b = (t.drop(columns=["took_s"]).sort_values("file").reset_index(drop=True) for t in (a, b))
    return list(a.columns) == list(b.columns) and a.equals(b)


def one_by_one(records, table, count):
    """Compares twenty valid actuators with single calls of `fit` and `diagnose`."""
    equal, drawn = 0, random.Random(1).sample(range(count - CORRUPT), min(20, count - CORRUPT))
    for k in drawn:
        file = str(records / f"P-{k:04}.csv")
        one = hyst.diagnose(file, hyst.fit(file, model="pi"))
        row = table[table.file == file].iloc[0]
        found = (one.findings["before"]["train"]["rmse"], one.findings["after"]["train"]["rmse"], ",".join(one.effects))
        equal += found == (row.rmse_before, row.rmse_after, row.effects or "")
    return equal, len(drawn)


def seconds(records, out, workers, ray):
    with Cluster(workers, ray):
        start = time.perf_counter()
        assert drive(records, out, workers, ray).wait() == 0
        return time.perf_counter() - start


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--only", choices=["threads", "ray"])
    given = parser.parse_args()
    records = given.folder / "records"
    if not records.exists():
        make(records, given.count)
    tables, checks = {}, {}
    for name in [given.only] if given.only else ["threads", "ray"]:
        print(f"{name}: {given.count} actuators, {CORRUPT} corrupt", flush=True)
        tables[name], found = killed_and_resumed(records, given.folder / f"{name}.parquet", given.count, name == "ray")
        checks.update({f"{name}: {what}": passed for what, passed in found.items()})
        few = given.folder / "few"
        if not few.exists():
            few.mkdir()
            for path in sorted(records.iterdir())[: max(8, given.count // 8)]:
                (few / path.name).write_bytes(path.read_bytes())
        one, two = (seconds(few, given.folder / f"{name}-{workers}.parquet", workers, name == "ray") for workers in (1, 2))
        print(f"  {len(list(few.iterdir()))} actuators: 1 worker {one:.1f} s, 2 workers {two:.1f} s, speed-up {one / two:.2f}", flush=True)
        checks[f"{name}: 2 workers at least {MIN_SPEED_UP} times as fast as 1"] = one / two >= MIN_SPEED_UP
    if len(tables) == 2:
        checks["both tables equal"] = same(*tables.values())
    equal, drawn = one_by_one(records, next(iter(tables.values())), given.count)
    checks[f"one by one: {equal} of {drawn} equal"] = equal == drawn
    for what, passed in checks.items():
        print(f"{'yes' if passed else 'NO '}  {what}")
    return not all(checks.values())


if __name__ == "__main__":
    sys.exit(main())
