"""Objects in other code: equality, pickles, copies, tables, exceptions."""

import copy
import pickle

import hyst
import numpy as np
import pytest
from test_records import actuator, record


@pytest.fixture(scope="module")
def objects():
    train = record(4000, 2)
    model = hyst.fit(train)
    t, u, _ = actuator(600, 3)
    wanted = hyst.Record(np.arange(600) / 500.0, outputs=5.0 + 3.0 * np.sin(np.arange(600) / 50.0))
    return {
        "operator": hyst.Pi(gain=0.1, thresholds=[10.0, 20.0], weights=[0.02, 0.01]),
        "record": train,
        "model": model,
        "simulation": model.simulate(hyst.Record(t, u)),
        "drive": model.compensate(wanted),
        "diagnosis": hyst.diagnose(train, model),
    }


KINDS = ["operator", "record", "model", "simulation", "drive", "diagnosis"]


@pytest.mark.parametrize("kind", KINDS)
def test_a_pickle_and_copies_are_equal(objects, kind):
    own = objects[kind]
    others = [pickle.loads(pickle.dumps(own, protocol)) for protocol in range(2, pickle.HIGHEST_PROTOCOL + 1)]
    for other in [*others, copy.copy(own), copy.deepcopy(own)]:
        assert type(other) is type(own) and other == own and not other != own and repr(other) == repr(own)
    assert own != 3 and own != None and own != objects[KINDS[KINDS.index(kind) - 1]]  # noqa: E711


def test_different_objects_are_not_equal(objects):
    t, u, y = actuator(300, 1)
    own = hyst.Record(t, u, y, name="a")
    assert own == hyst.Record(list(t), u.tolist(), y, name="a")
    for other in (
        hyst.Record(t, u, y, name="b"),
        hyst.Record(t, u, np.nextafter(y, 1e9), name="a"),
        hyst.Record(t, u, name="a"),
        hyst.Record(t, u, y, output_column="force_n", name="a"),
        hyst.Record(t, u, y, segment=[0] * 100 + [1] * 200, name="a"),
        hyst.Record(2 * t, u, y, name="a"),
    ):
        assert own != other
    pi = objects["operator"]
    assert pi == hyst.Pi(gain=0.1, thresholds=(10, 20), weights=[0.02, 0.01]) and hash(pi) == hash(copy.copy(pi))
    assert pi != hyst.Pi(gain=0.1, thresholds=[10.0, 20.0], weights=[0.02, 0.02])
    assert hyst.Play(radius=1.0) != hyst.Stop(limit=1.0)


def test_a_pickled_record_fits_to_the_same_model(objects):
    assert hyst.fit(pickle.loads(pickle.dumps(objects["record"]))) == objects["model"]


def test_an_invalid_state_is_rejected():
    with pytest.raises(ValueError, match="not a state of hyst"):
        hyst.Record._restore(b"\xff\xff\xff")


def test_missing_files_raise_file_not_found_error(tmp_path):
    for read in (hyst.read_record, hyst.Model.load, hyst.fit):
        with pytest.raises(FileNotFoundError) as caught:
            read(tmp_path / "none.csv")
        assert isinstance(caught.value, hyst.HystError) and isinstance(caught.value, ValueError)
        assert "none.csv" in str(caught.value)
    (tmp_path / "bad.csv").write_text("a,b\n1,2\n2,3\n")
    with pytest.raises(hyst.RecordError) as caught:
        hyst.read_record(tmp_path / "bad.csv")
    assert not isinstance(caught.value, FileNotFoundError)
    with pytest.raises(ValueError):
        hyst.Pi(gain=0.1, thresholds=[1.0], weights=[-0.2]).inverse()


def frames():
    pandas, polars = pytest.importorskip("pandas"), pytest.importorskip("polars")
    return {"pandas": pandas.DataFrame, "polars": polars.DataFrame, "dict": dict}


@pytest.mark.parametrize("library", ["pandas", "polars", "dict"])
def test_tables_become_records(library):
    make = frames()[library]
    t, u, y = actuator(300, 1)
    plain = hyst.Record(t, u, y, name="frame")
    by_role = hyst.Record.from_frame(make({"t": t, "V": u, "x": y}), time="t", voltage="V", displacement="x")
    assert by_role == plain
    by_heading = make({"Time [ms]": 1e3 * t, "Drive (V)": u, "Position, nm": 1e3 * y, "remark": ["a"] * 300})
    own = hyst.Record.from_frame(by_heading)
    assert own.output_column == "displacement_nm" and np.allclose(own.outputs, 1e3 * y) and own.period == plain.period
    own = hyst.Record.from_frame(by_heading, displacement="Position, nm")
    assert own.output_column == "displacement_um" and np.allclose(own.outputs, y)
    gaps = y.copy()
    gaps[20] = np.nan
    own = hyst.Record.from_frame(make({"time_s": t, "voltage_v": u, "displacement_um": gaps}))
    assert len(own) == 300 and "1 row without displacement_um" in own.notes[0]
    with pytest.raises(hyst.RecordError, match="its unit is not stated"):
        hyst.Record.from_frame(make({"t": t, "V": u, "x": y}))
    with pytest.raises(hyst.RecordError, match="speed"):
        hyst.Record.from_frame(make({"t": t, "V": u, "x": y}), speed="V")


@pytest.mark.parametrize("library", ["pandas", "polars"])
def test_records_become_tables(library):
    frames()
    t, u, y = actuator(300, 1)
    own = hyst.Record(t, u, y, temperature=np.full(300, 21.5), segment=[3] * 100 + [5] * 200, name="frame")
    frame = own.to_frame(library)
    assert list(frame.columns) == ["segment", "time_s", "voltage_v", "displacement_um", "temperature_degc"]
    assert hyst.Record.from_frame(frame) == own
    with pytest.raises(ValueError, match="polars"):
        own.to_frame("excel")


def test_an_index_of_dates_is_the_time():
    pandas = pytest.importorskip("pandas")
    t, u, y = actuator(300, 1)
    dates = pandas.Timestamp("2024-05-31 12:00") + pandas.to_timedelta(np.arange(300) * 2, unit="ms")
    frame = pandas.DataFrame({"voltage_v": u, "displacement_um": y}, index=dates)
    own = hyst.Record.from_frame(frame)
    assert own.period == 2e-3 and np.array_equal(own.inputs, u)
