"""Records, fits, diagnoses and compensation: the interface of the identification."""

import json
import pickle

import hyst
import numpy as np
import pytest
from drives import one_way
from reference import linear, plays

RATE = 500.0
R = np.array([5.0, 12.0, 20.0, 30.0, 45.0])
W = np.array([0.02, 0.015, 0.012, 0.01, 0.01])


def actuator(n, seed, mode=None):
    """Returns time, drive and output of a Prandtl-Ishlinskii actuator, optionally with a mode."""
    rng = np.random.default_rng(seed)
    # Slow loops, then steps between levels, as an identification needs.
    levels = np.repeat(np.concatenate([[0.0], rng.uniform(0, 100, n // 200)]), 100)[: n // 2]
    u = np.concatenate([one_way(n - len(levels), 0.0, 100.0, seed), np.convolve(levels, np.ones(20) / 20)[: len(levels)]])
    y = plays.prandtl_ishlinskii(u, 0.1, R, W)
    if mode:
        y = linear.resonance(y, *mode, 1.0, 1 / RATE)
    return np.arange(n) / RATE, u, y + 0.002 * rng.normal(size=n)


def record(n=8000, seed=1, mode=None):
    return hyst.Record(*actuator(n, seed, mode), name=f"seed {seed}")


@pytest.fixture(scope="module")
def fitted():
    return hyst.fit(record())


def csv(path, columns):
    names = ",".join(columns)
    np.savetxt(path, np.column_stack(list(columns.values())), delimiter=",", header=names, comments="", fmt="%.9f")
    return path


def test_a_record_returns_its_columns():
    t, u, y = actuator(300, 1)
    warm = np.full(300, 21.5)
    r = hyst.Record(t, u, y, temperature=warm, segment=[0] * 100 + [1] * 200, output_column="force_n", name="a")
    assert np.allclose(r.timepts, t) and np.array_equal(r.inputs, u) and np.array_equal(r.outputs, y)
    assert np.array_equal(r.temperature, warm) and r.load is None
    assert r.segments == [(0, 100), (100, 300)] and r.period == pytest.approx(1 / RATE) and len(r) == 300
    assert (r.input_column, r.output_column, r.name) == ("voltage_v", "force_n", "a")
    assert hyst.Record(t, outputs=y).inputs is None
    both = hyst.Record.join([hyst.Record(t, u, y, name="a"), hyst.Record(t, u, y, name="b")])
    assert len(both) == 600 and both.name == "a + b"


def test_an_invalid_record_is_rejected():
    t, u, y = actuator(300, 1)
    with pytest.raises(hyst.RecordError, match="voltage_v"):
        hyst.Record(t, u[:-1], y)
    with pytest.raises(hyst.RecordError, match="increase"):
        hyst.Record(t[::-1].copy(), u, y)
    with pytest.raises(ValueError, match=r"inputs\[7\]"):
        hyst.Record(t, np.where(np.arange(300) == 7, np.nan, u), y)
    with pytest.raises(ValueError, match="output_column"):
        hyst.Record(t, u, y, output_column="volume_l")
    with pytest.raises(TypeError, match="complex128"):
        hyst.Record(t, u * 1j, y)
    with pytest.raises(ValueError, match=r"segment\[2\] is 0.5"):
        hyst.Record(t[:3], u[:3], y[:3], segment=[0, 0, 0.5])


def test_reading(tmp_path):
    t, u, y = actuator(300, 1)
    path = csv(tmp_path / "a.csv", {"time_s": t, "Vin": u, "displacement_um": y})
    names = {"voltage_v": "Vin"}
    r = hyst.read_record(path, map=names)
    assert np.allclose(r.inputs, u, atol=1e-9) and r.output_column == "displacement_um"
    assert len(hyst.read_record([path, str(path)], map=names)) == 600
    with pytest.raises(hyst.RecordError, match=r"a\.csv, line 1.*in Python --map NAME=COLUMN is map="):
        hyst.read_record(path)
    with pytest.raises(hyst.RecordError, match="cannot be read"):
        hyst.read_record(tmp_path / "nothing.csv")
    with pytest.raises(hyst.RecordError, match="NAME=COLUMN|not a column name of the record format"):
        hyst.read_record(path, map={"volts": "Vin"})
    with pytest.raises(ValueError, match="need is"):
        hyst.read_record(path, need="everything")
    with pytest.raises(TypeError, match="path"):
        hyst.read_record(3)


def test_fit_and_simulate(fitted):
    assert fitted.kind == "pi" and fitted.effects == [] and fitted.input_column == "voltage_v"
    test = record(seed=2)
    simulated = fitted.simulate(test)
    assert simulated.errors["nrmse_percent"] < 0.5
    kept = ~simulated.settling
    assert simulated.errors["rmse"] == pytest.approx(hyst.rmse(test.outputs, simulated.outputs, settling=simulated.settling))
    assert simulated.errors["rmse"] == pytest.approx(np.sqrt(np.mean((simulated.outputs - test.outputs)[kept] ** 2)))
    assert np.array_equal(simulated.inputs, test.inputs) and np.array_equal(simulated.timepts, test.timepts)
    assert simulated.zeros == [] and len(fitted.simulate(test, zero="per-record").zeros) == 1
    # The same model as an operator on arrays.
    assert np.array_equal(fitted.operator(test.period).simulate(test.inputs), simulated.outputs)


def test_a_fit_to_arrays_equals_a_fit_to_the_record(fitted):
    t, u, y = actuator(8000, 1)
    of_arrays = hyst.fit(timepts=t, inputs=u, outputs=y)
    assert of_arrays.to_dict()["stages"] == fitted.to_dict()["stages"]
    assert hyst.fit([record()]).to_dict()["stages"] == fitted.to_dict()["stages"]
    assert hyst.fit(record(), model="preisach").kind == "preisach"


def test_invalid_fits_are_rejected():
    t, u, y = actuator(300, 1)
    with pytest.raises(TypeError, match="either a record"):
        hyst.fit()
    with pytest.raises(TypeError, match="either a record"):
        hyst.fit(record(), inputs=u)
    with pytest.raises(ValueError, match="no model has this name"):
        hyst.fit(record(), model="polynomial")
    with pytest.raises(ValueError, match="zero is"):
        hyst.fit(record(), zero="some")
    with pytest.raises(hyst.FitError, match="constant"):
        hyst.fit(timepts=t, inputs=np.ones(300), outputs=y)
    with pytest.raises(hyst.FitError, match="too few"):
        hyst.fit(timepts=t[:20], inputs=u[:20], outputs=y[:20])
    with pytest.raises(TypeError, match="must be a Record, a path"):
        hyst.fit(3)


def bouc_wen(n=3000):
    """Returns time, drive and output of a Bouc-Wen actuator with n = 1: its differential equation in small steps."""
    t = np.arange(n) / 1000.0
    u = 50.0 + 50.0 * np.sin(31.0 * t) * np.cos(2.0 * t)
    k0, alpha, beta, gamma = 0.12, -0.05, 0.02, -0.008
    h, y = 0.0, np.empty(n)
    before = 0.0
    for k in range(n):
        for step in np.full(50, (u[k] - before) / 50.0):
            h += alpha * step - beta * abs(step) * h - gamma * step * abs(h)
        before = u[k]
        y[k] = k0 * u[k] + h
    return t, u, y


def test_a_search_has_the_options_of_the_command_line():
    t, u, y = bouc_wen()
    arrays = dict(timepts=t, inputs=u, outputs=y, model="bouc-wen")
    searched = dict(optimizer="pso", seed=3, trials=2, evaluations=800, population=20, form="zhu")
    found = hyst.fit(**arrays, **searched)
    stage = found.to_dict()["stages"][0]
    assert found.to_dict()["seed"] == 3 and stage["n"] == 1.0
    for name, truth in dict(k0=0.12, alpha=-0.05, beta=0.02, gamma=-0.008).items():
        assert stage[name] == pytest.approx(truth, rel=0.02, abs=2e-4), name
    assert hyst.fit(**arrays, **searched).to_dict() == found.to_dict()
    # Bounds that exclude the true value are respected.
    within = hyst.fit(**arrays, seed=3, bounds={"gamma/beta": (0.1, 0.5)}).to_dict()["stages"][0]
    ratio = abs(within["gamma"] / within["beta"])
    assert 0.1 - 1e-9 <= ratio <= 0.5 + 1e-9
    # With the form of Xie, the exponent is searched too. Its lower bound is 1; held there, it has no standard error.
    free = hyst.fit(**arrays, form="xie", evaluations=2000).to_dict()["stages"][0]
    assert free["n"] == pytest.approx(1.0, abs=0.1)
    assert ("n" in free["std_errors"]) == (free["n"] > 1.0) and "n" not in stage["std_errors"]
    other = hyst.fit(**arrays, form="xie", evaluations=2000, bounds={"n": (1.5, 3.0)}).to_dict()["stages"][0]
    assert 1.5 <= other["n"] <= 3.0


def test_thresholds_and_elements_are_chosen():
    r = record()
    few = hyst.fit(r, thresholds=4).to_dict()["stages"][0]
    assert 1 <= len(few["thresholds"]) <= 4 and few["std_errors"]
    bank = hyst.fit(r, model="maxwell-slip", elements=3, form="backlash").to_dict()["stages"][0]
    assert bank["reading"] == "backlash" and 1 <= len(bank["widths"]) <= 3


def test_impossible_searches_are_rejected():
    r = record(1000)

    def rejected(error, message, **options):
        with pytest.raises(error, match=message):
            hyst.fit(r, model=options.pop("model", "bouc-wen"), **options)

    rejected(ValueError, "seed=", optimizer="de")
    rejected(ValueError, "annealing", optimizer="annealing", seed=1)
    rejected(ValueError, "unknown form", form="square")
    rejected(ValueError, "band-limited", model="bouc-wen-oscillator", between_samples="cubic")
    rejected(TypeError, "bounds", bounds=[("gamma/beta", 0.0, 1.0)])
    rejected(hyst.FitError, "gamma/beta", bounds={"gamma/beta": (1.0, -1.0)})
    rejected(hyst.FitError, "it searches", bounds={"alpha": (0.0, 1.0)})
    rejected(hyst.FitError, "finite output", bounds={"gamma/beta": (-3.0, -2.0)})
    rejected(hyst.FitError, "population = 0", population=0)
    rejected(hyst.FitError, "0 evaluations", evaluations=0)
    rejected(hyst.FitError, "trials = 0", trials=0)
    rejected(hyst.FitError, "nothing to search", model="preisach", optimizer="de", seed=1)
    rejected(hyst.FitError, "thresholds", thresholds=3)
    rejected(hyst.RecordError, "temperature_degc", model="td-pi")
    rejected(OverflowError, "negative", trials=-1)


def test_files(fitted, tmp_path):
    path = tmp_path / "model.json"
    fitted.save(path)
    again = hyst.Model.load(path)
    assert again == fitted and again == hyst.Model.loads(path.read_text()) and again == pickle.loads(pickle.dumps(fitted))
    assert json.loads(path.read_text()) == fitted.to_dict() and fitted.dumps() == path.read_text()
    assert fitted.to_dict()["fitted_on"][0]["file"] == "seed 1"
    newer = path.read_text().replace("hyst.model/1", "hyst.model/9")
    with pytest.raises(hyst.ModelFileError, match="update"):
        hyst.Model.loads(newer)
    with pytest.raises(hyst.ModelFileError, match="nothing.json"):
        hyst.Model.load(tmp_path / "nothing.json")
    with pytest.raises(hyst.ModelFileError, match="line 1"):
        hyst.Model.loads("{")
    with pytest.raises(hyst.ModelFileError):
        fitted.save(tmp_path / "no folder" / "model.json")


def test_compensation(fitted):
    t = np.arange(4000) / RATE
    wanted = 5.0 - 4.0 * np.cos(2 * np.pi * 1.0 * t) * np.cos(2 * np.pi * 0.13 * t)
    drive = fitted.compensate(hyst.Record(t, outputs=wanted), limit=(0.0, 120.0))
    reached = plays.prandtl_ishlinskii(drive.inputs, 0.1, R, W)
    assert np.sqrt(np.mean((reached - wanted) ** 2)) < 0.005 * np.ptp(wanted)
    assert drive.lead == 0 and drive.bandwidth_hz is None and drive.voltage_limited == []
    operator = fitted.operator(1 / RATE)
    assert np.allclose(operator.compensate(wanted), drive.inputs, rtol=0, atol=1e-12 * 100)
    assert fitted.compensate(hyst.Record(t, outputs=wanted), limit=(0.0, 30.0)).voltage_limited != []
    assert fitted.compensate(hyst.Record(t, outputs=wanted), slew=50.0).slew_limited != []
    with pytest.raises(hyst.ReachError, match="outside what the actuator reaches"):
        fitted.compensate(hyst.Record(t, outputs=10 * wanted))
    with pytest.raises(hyst.RecordError, match="displacement_um is missing"):
        fitted.compensate(hyst.Record(t, outputs=wanted, output_column="displacement_nm"))


def test_diagnosis():
    train, test = record(mode=(61.0, 0.05)), record(seed=2, mode=(61.0, 0.05))
    model = hyst.fit(train)
    messages = []
    found = hyst.diagnose(train, model, test=test, progress=messages.append)
    assert found.effects == ["resonance"] and found.verdict == "explained" and messages
    assert found.extended.effects == ["resonance"] and model.effects == []
    effect = found.findings["effects"][0]
    assert effect["name"] == "resonance" and effect["parameters"]["hz"]["value"] == pytest.approx(61.0, rel=0.02)
    before, after = (found.findings[k]["test"]["rmse"] for k in ("before", "after"))
    assert after < 0.2 * before
    assert found.extended.simulate(test).errors["rmse"] == pytest.approx(after)
    # The inverse of the extended model has a preview.
    operator = found.extended.operator(train.period)
    inverse = operator.inverse()
    assert inverse.lead > 0 and inverse.bandwidth_hz > 0 and "resonance" in repr(operator)
    wanted = np.ascontiguousarray(4.0 - 3.0 * np.cos(2 * np.pi * 2.0 * train.timepts[:2000]))
    reached = operator.simulate(operator.compensate(wanted))
    assert np.abs(reached - wanted)[500:-500].max() < 0.02 * np.ptp(wanted)

    def stop(_):
        raise KeyError("stop")

    with pytest.raises(KeyError):
        hyst.diagnose(train, model, progress=stop)


def test_metrics():
    y, p = np.array([0.0, 1.0, 2.0, 4.0]), np.array([9.0, 1.0, 5.0, 0.0])
    settling = np.array([True, False, False, False])
    assert hyst.rmse(y, p, settling=settling) == pytest.approx(np.sqrt(25 / 3))
    assert hyst.nrmse(y, p, settling=settling) == pytest.approx(100 * np.sqrt(25 / 3) / 3)
    assert hyst.max_abs(y, p) == 9.0 and hyst.max_abs(y, p, settling=settling) == 4.0
    assert hyst.mape(y, p, settling=settling) == pytest.approx(2.5 / 3)
    assert hyst.smape(y, p, settling=settling) == pytest.approx((3 / 3.5 + 2) / 3)
    assert hyst.peak_to_valley(y, p, settling=settling) == 7.0
    assert hyst.mape(np.zeros(2), np.ones(2)) is None
    with pytest.raises(hyst.RecordError, match="3 values"):
        hyst.rmse(y, p[:3])
    with pytest.raises(hyst.RecordError, match="start-up rows"):
        hyst.rmse(y, p, settling=np.ones(4, dtype=bool))
    with pytest.raises(TypeError, match="bool"):
        hyst.rmse(y, p, settling=np.ones(4))
