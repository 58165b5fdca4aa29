"""Fleets from Python: threads and Ray give the same rows; finished rows are not repeated."""

import json
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import hyst
import hyst.fleet

pandas = pytest.importorskip("pandas")
pytest.importorskip("pyarrow")


def actuator(k):
    """Returns a record of play operators followed by a lag of k ms, with noise."""
    rng = np.random.default_rng(k)
    t = np.arange(3000) * 1e-3
    u = 50 - 50 * np.cos(2 * np.pi * (0.5 + 0.5 * t) * t) * (0.4 + 0.2 * t)
    u = np.clip(u, 0, 100)
    y = hyst.Pi(gain=0.05, thresholds=[4.0, 12.0, 25.0], weights=[0.02, 0.015, 0.01]).simulate(u)
    y = hyst.Lag(seconds=1e-3 * k, period=1e-3).simulate(y) if k else y
    return hyst.Record(t, u, y + rng.normal(0, 0.003, len(t)), name=f"P-{k}")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("fleet")
    for k in (0, 3):
        actuator(k).save(path / f"P-{k}.csv")
    (path / "torn.csv").write_text("time_s,voltage_v,displacement_um\n0,1\n")
    return path


def rows(fleet):
    """Returns the rows without the values that differ between runs, and without the folder."""
    found = {}
    for row in fleet:
        row.pop("took_s")
        row["file"] = os.path.basename(row["file"])
        found[row["file"]] = json.dumps(row, sort_keys=True)
    return found


def test_a_fleet_is_a_table_and_a_page(folder, tmp_path):
    out = tmp_path / "results.parquet"
    fleet = hyst.fleet.diagnose(folder, out, model="pi", reports=tmp_path / "reports")
    assert (len(fleet), fleet.done, list(fleet.failed)) == (3, 3, [str(folder / "torn.csv")])
    assert "2 of 3 actuators diagnosed, 1 failed" in repr(fleet)
    table = pandas.read_parquet(out)
    assert len(table) == 3 and table.rmse_before.notna().sum() == 2
    assert "line 2" in table.error.dropna().iloc[0]
    one = hyst.diagnose(folder / "P-3.csv", hyst.fit(folder / "P-3.csv"))
    mine = table[table.file.str.endswith("P-3.csv")].iloc[0]
    assert mine.rmse_after == one.findings["after"]["train"]["rmse"]
    assert mine.effects == ",".join(one.effects)
    page = hyst.fleet.summary(folder, out, tmp_path / "fleet.html")
    assert "2 of 3 actuators diagnosed" in page and (tmp_path / "fleet.html").read_text() == page
    # Nothing is repeated: the journal does not change.
    journal = (tmp_path / "results.parquet.journal").read_bytes()
    hyst.fleet.diagnose(folder, out, model="pi", reports=tmp_path / "reports")
    assert (tmp_path / "results.parquet.journal").read_bytes() == journal


def test_records_and_mappings(folder, tmp_path):
    messages = []
    entries = [actuator(2), {"file": folder / "P-0.csv", "serial": "A-7", "date": "2026-05-02"}]
    fleet = hyst.fleet.diagnose(entries, tmp_path / "r.parquet", model="pi", progress=messages.append)
    assert fleet.done == 2 and not fleet.failed and len(messages) == 2
    assert [row["serial"] for row in fleet] == [None, "A-7"]
    # A record with the same content is the same actuator.
    before = (tmp_path / "r.parquet.journal").read_bytes()
    hyst.fleet.diagnose(entries, tmp_path / "r.parquet", model="pi")
    assert (tmp_path / "r.parquet.journal").read_bytes() == before


def test_an_exception_keeps_finished_rows(folder, tmp_path):
    def stop(line):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        hyst.fleet.diagnose(folder, tmp_path / "r.parquet", model="pi", jobs=1, progress=stop)
    done = len((tmp_path / "r.parquet.journal").read_text().splitlines())
    assert 1 <= done < 3 and len(pandas.read_parquet(tmp_path / "r.parquet")) == done
    assert hyst.fleet.diagnose(folder, tmp_path / "r.parquet", model="pi").done == 3


def test_ctrl_c_stops_it_quickly_and_keeps_finished_rows(folder, tmp_path):
    started = threading.Event()
    timer = threading.Thread(target=lambda: (started.wait(60), os.kill(os.getpid(), signal.SIGINT)))
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        hyst.fleet.diagnose(folder, tmp_path / "r.parquet", model="pi", jobs=1, progress=lambda line: started.set())
        time.sleep(60)
    assert len((tmp_path / "r.parquet.journal").read_text().splitlines()) >= 1


def test_invalid_fleets_are_rejected(tmp_path, folder):
    for wrong in ({"model": "nonsense"}, {"zero": "per_record"}, {"map": {"nonsense": "x"}}):
        with pytest.raises(ValueError, match=next(iter(wrong.values())) if "map" not in wrong else "nonsense"):
            hyst.fleet.diagnose(folder, tmp_path / "r.parquet", **wrong)
    with pytest.raises(ValueError, match="'name' is not known"):
        hyst.fleet.diagnose([{"file": "a", "name": "b"}], tmp_path / "r.parquet")
    with pytest.raises(ValueError, match="named twice"):
        hyst.fleet.diagnose(["a", "a"], tmp_path / "r.parquet")
    with pytest.raises(ValueError, match="give a folder"):
        hyst.fleet.diagnose(tmp_path / "absent", tmp_path / "r.parquet")
    with pytest.raises(FileNotFoundError, match="there is no such fleet"):
        hyst.fleet.summary([], tmp_path / "r.parquet")


DRIVER = """
import sys, hyst.fleet
hyst.fleet.diagnose(sys.argv[1], sys.argv[2], model="pi", address=sys.argv[3] or None, jobs=2)
"""


def on_ray(folder, out):
    """Starts a driver in a separate process group, which includes Ray's processes."""
    return subprocess.Popen([sys.executable, "-c", DRIVER, folder, out, "local"], start_new_session=True)


def test_ray_gives_the_same_rows_and_survives_kills(folder, tmp_path):
    pytest.importorskip("ray")
    here = rows(hyst.fleet.diagnose(folder, tmp_path / "here.parquet", model="pi"))
    out = tmp_path / "ray.parquet"
    journal = tmp_path / "ray.parquet.journal"
    driver = on_ray(folder, out)
    while driver.poll() is None and (not journal.exists() or not journal.read_text()):
        time.sleep(0.02)
    assert driver.poll() is None, "the driver has ended early"
    os.killpg(driver.pid, signal.SIGKILL)
    driver.wait()
    kept = journal.read_text()
    assert kept, "no row was finished before the kill"
    assert on_ray(folder, out).wait(timeout=300) == 0
    # Finished rows are not repeated and do not change.
    assert journal.read_text().startswith(kept[: kept.rfind("\n") + 1])
    assert rows(hyst.fleet.diagnose(folder, out, model="pi")) == here
