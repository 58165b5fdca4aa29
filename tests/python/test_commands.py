"""The commands of the command line as Python functions."""

import os
import pickle
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import hyst

PLANT = """
seed = 3
[actuator]
max_v = 100
gain_um_per_v = 0.2
loop_share = 0.12
relays = 2000
[sensor]
range_um = [-10, 40]
noise_um = 0.005
"""


@pytest.fixture(scope="module")
def plant(tmp_path_factory):
    path = tmp_path_factory.mktemp("plant") / "plant.toml"
    path.write_text(PLANT)
    return f"sim:{path}"


@pytest.fixture(scope="module")
def train(plant):
    return hyst.run(plant, drive=hyst.excite("identification", high=100, seconds=20), seed=3).record


def test_a_drive_is_a_record(tmp_path):
    made = hyst.excite("identification", high=100, seconds=20, seed=4, output=tmp_path / "drive.csv")
    assert made.outputs is None and made.inputs.max() == 100 and len(made.segments) > 1
    assert hyst.excite("identification", high=100, seconds=20, seed=4).inputs.tolist() == made.inputs.tolist()
    with pytest.raises(hyst.InputError, match="--high"):
        hyst.excite("identification")
    assert len(hyst.separate("creep", "drift", high=100, seconds=20)) > 1000


def test_a_record_can_be_saved_and_read(train, tmp_path):
    for ending in ("csv", "npy", "mat", "tdms"):
        path = tmp_path / f"a.{ending}"
        train.save(path)
        again = hyst.read_record(path)
        assert again.outputs.tolist() == train.outputs.tolist() and again.segments == train.segments
        with pytest.raises(FileExistsError, match="overwrite=True"):
            train.save(path, overwrite=False)
    with pytest.raises(ValueError, match=".npy"):
        train.save(tmp_path / "a.xyz")


def test_reports_are_text_and_numbers(train, tmp_path):
    info = hyst.info(train)
    assert info["record"]["rows"] == len(train) and "samples per second" in repr(info)
    compared = hyst.compare(train, models=["pi", "preisach"])
    assert {row["model"] for row in compared["models"]} == {"pi", "preisach"}, dict(compared)
    assert "preisach" in str(compared) and "<pre>" in compared._repr_html_()
    assert hyst.gain(train, frequency=1).columns, "points of the gain"
    assert "hz" in " ".join(hyst.response(train).columns)
    assert pickle.loads(pickle.dumps(info)) == info


def test_errors_are_exceptions_with_the_message_of_the_command_line(train, tmp_path):
    with pytest.raises(hyst.InputError, match="nonsense"):
        hyst.compare(train, models=["nonsense"])
    with pytest.raises(hyst.InputError, match="absent.csv"):
        hyst.info(tmp_path / "absent.csv")
    with pytest.raises(hyst.InputError, match="unexpected argument"):
        hyst.info(train, no_such_option=1)


def test_force_export_and_loop(train, plant):
    model = hyst.fit(train)
    header = hyst.export(model, "c", name="stage")
    assert b"stage" in header
    assert hyst.export(model, "postcard") != header
    sine = hyst.run(plant, drive=50 - 50 * np.cos(2 * np.pi * np.arange(3000) / 1000), rate=1000).record
    assert hyst.loop(sine, phase=-5.0).columns
    forced = hyst.force(sine, model, kout=20)
    assert any("force" in name for name in forced.columns), forced.columns


@pytest.mark.parametrize("progress", [False, None, lambda line: None])
def test_ctrl_c_stops_a_search_and_a_diagnosis(train, progress):
    # Ten million evaluations take longer than any test.
    timer = threading.Timer(0.5, os.kill, [os.getpid(), signal.SIGINT])
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        hyst.fit(train, model="bouc-wen", optimizer="de", seed=1, evaluations=10_000_000, progress=progress)
    model = hyst.fit(train)
    timer = threading.Timer(0.2, os.kill, [os.getpid(), signal.SIGINT])
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        while True:
            hyst.diagnose(train, model, progress=progress)


@pytest.mark.skipif(sys.platform == "win32", reason="signals of Unix")
def test_ctrl_c_stops_the_command_line_of_the_wheel(train, tmp_path):
    train.save(tmp_path / "a.csv")
    line = [sys.executable, "-m", "hyst", "fit", "a.csv", "--model", "bouc-wen", "--optimizer", "de", "--seed", "1"]
    process = subprocess.Popen([*line, "--trials", "100000", "-o", "b.json"], cwd=tmp_path)
    time.sleep(2)
    process.send_signal(signal.SIGINT)
    assert process.wait(timeout=60) != 0 and not (tmp_path / "b.json").exists()


def test_notes_on_records_in_memory_are_warnings(train):
    rows = slice(*train.segments[0])
    y = np.minimum(train.outputs[rows], 15.0)
    clipped = hyst.Record(train.timepts[rows], train.inputs[rows], y)
    with pytest.warns(UserWarning, match="end of its range"):
        hyst.compare(clipped, models=["pi"])


def test_the_wheel_has_the_command_line(train, tmp_path):
    train.save(tmp_path / "a.csv")
    ran = subprocess.run([sys.executable, "-m", "hyst", "info", tmp_path / "a.csv"], capture_output=True, text=True)
    assert ran.returncode == 0 and "read as" in ran.stdout, ran.stderr
    ran = subprocess.run([sys.executable, "-m", "hyst", "info", "absent"], capture_output=True, text=True)
    assert ran.returncode == 2 and ran.stderr.startswith("error: absent"), ran.stderr
    assert subprocess.run([sys.executable, "-m", "hyst", "--help"], capture_output=True).returncode == 0
