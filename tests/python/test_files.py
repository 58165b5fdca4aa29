"""Operators as model files: a file gives the same operator again, and files are replaced only on request."""

import json
from pathlib import Path

import hyst
import numpy as np
import pytest
from cases import CASES, PERIOD

KINDS = {path.stem for path in (Path(__file__).parents[2] / "docs" / "models").glob("*.json")}
# Variants without a file format.
WITHOUT_FILE = {"dpm, drifting"} | {c.label for c in CASES if "memory" in c.parameters}
WITH_FILE = [c for c in CASES if c.label not in WITHOUT_FILE]
PI = dict(gain=0.1, thresholds=[10.0, 20.0], weights=[0.02, 0.01])
RANGE = dict(input_range=(0.0, 100.0))


def ends(case):
    return dict(input_range=(case.u.min(), case.u.max()))


@pytest.mark.parametrize("case", WITH_FILE, ids=lambda c: c.label)
def test_an_operator_is_restored_from_its_file(case, tmp_path):
    model, path = case.model(), tmp_path / "model.json"
    model.save(path, **ends(case))
    loaded = hyst.Model.load(path)
    assert loaded == model.to_model(**ends(case)) and model.to_json(**ends(case)) == path.read_text()
    assert (loaded.input_range, loaded.zero) == ((case.u.min(), case.u.max()), 0.0)
    operator = loaded.operator(getattr(model, "period", 0) or PERIOD)
    y = model.simulate(case.u, **case.environment)
    assert np.array_equal(operator.simulate(case.u, **case.environment), y)
    # The restored operator gives the same file.
    assert operator.to_json() == path.read_text()


@pytest.mark.parametrize("case", [c for c in WITH_FILE if c.inverse is not None], ids=lambda c: c.label)
def test_an_inverse_is_restored_from_its_file(case):
    model = case.model()
    y = model.simulate(case.u, **case.environment)
    operator = model.to_model(**ends(case)).operator(getattr(model, "period", 0) or PERIOD)
    # The inverse of a file has only the option of the bandwidth: range and tolerance of a search come from the file.
    options = {name: x for name, x in case.inverse.items() if name == "bandwidth_hz"}
    u, own = (x.compensate(y, **case.environment, **o) for x, o in ((operator, options), (model, case.inverse)))
    assert operator.inverse(**options).bandwidth_hz == model.inverse(**case.inverse).bandwidth_hz
    assert np.allclose(u, own, rtol=0, atol=case.inverse_tolerance * np.ptp(case.u))


def test_every_kind_of_file_is_tested():
    assert len(KINDS) == 16 and {c.model().to_model(**ends(c)).kind for c in WITH_FILE} == KINDS


@pytest.mark.parametrize("label", sorted(WITHOUT_FILE))
def test_variants_without_a_file_format_are_rejected(label, tmp_path):
    case = next(c for c in CASES if c.label == label)
    with pytest.raises(hyst.ModelFileError, match=f"{case.name}: .*(memory=|stack form)"):
        case.model().save(tmp_path / "model.json", **ends(case))
    assert not list(tmp_path.iterdir())


def test_a_file_contains_the_given_ranges_and_columns():
    pi = hyst.Pi(**PI)
    file = json.loads(pi.to_json(input_range=(-20.0, 120.0), input_column="force_in_n", output_column="displacement_nm"))
    assert file["schema"] == "hyst.model/1" and file["fitted_on"] == []
    assert file["input"] == {"column": "force_in_n", "unit": "N", "low": -20.0, "high": 120.0}
    rest = [pi.reset(-20.0), pi.reset(120.0)]
    assert file["output"] == {"column": "displacement_nm", "unit": "nm", "low": rest[0], "high": rest[1]}
    units = {"gain": "nm/N", "thresholds": "N", "weights": "nm/N"}
    assert file["stages"] == [{"stage": "pi", **PI, "units": units}]
    assert pi.to_model(**RANGE, output_range=(-1.0, 9.0)).output_range == (-1.0, 9.0)
    # A grid gives the range, and a sample period the rate.
    assert hyst.Preisach(low=-5.0, high=50.0, density=[1.0]).to_model().input_range == (-5.0, 50.0)
    assert hyst.Lag(seconds=0.01, period=2e-3).to_model(**RANGE).to_dict()["recorded_at_hz"] == 500.0
    # An effect without hysteresis.
    creep = hyst.Creep(seconds=[1.0], shares=[0.1], period=1e-3).to_model(**RANGE)
    assert (creep.kind, creep.effects) == ("pi", ["creep"])


def test_a_model_of_an_operator_has_the_record_methods():
    model = hyst.Pi(**PI).to_model(**RANGE)
    t = np.arange(2000) * 1e-3
    u = 50.0 * (1 - np.cos(2 * np.pi * t))
    y = model.simulate(hyst.Record(t, u)).outputs
    assert np.array_equal(y, hyst.Pi(**PI).simulate(u))
    assert np.allclose(model.compensate(hyst.Record(t, outputs=y)).inputs, u, rtol=0, atol=1e-9)


def test_the_interpolation_of_the_drive_is_stored_and_a_period_repeats():
    own = dict(mass=0.002, damping=0.01, stiffness=50.0, alpha=50.0, beta=1.0, gamma=0.8, delta=-1.1, nu=1.0)
    oscillator = hyst.BoucWenOscillator(**own, period=1 / 750)
    text = oscillator.to_json(input_range=(-150.0, 150.0), input_column="force_in_n", output_column="displacement_mm")
    linear = hyst.Model.loads(text)
    file = json.loads(text)
    file["input"]["between_samples"] = "band-limited"
    band = hyst.Model.loads(json.dumps(file))
    assert (linear.between_samples, band.between_samples) == ("linear", "band-limited")
    assert json.loads(band.dumps())["input"] == file["input"]
    t = np.arange(600) / 750
    u = np.tile(60.0 * np.sin(2 * np.pi * 150 * t[:300] + 0.5), 2)
    once = hyst.Record(t[:300], u[:300], input_column="force_in_n")
    twice = hyst.Record(t, u, input_column="force_in_n")
    outputs = linear.simulate(once, periodic=True).outputs
    assert np.array_equal(outputs, linear.simulate(twice).outputs[300:])
    # Linear interpolation of a sine of 150 Hz at 750 Hz has 87.5 % of its amplitude.
    ratio = np.std(band.simulate(once, periodic=True).outputs) / np.std(outputs)
    assert 1.1 < ratio < 1.2
    file["input"]["between_samples"] = "cubic"
    with pytest.raises(hyst.ModelFileError, match="band-limited"):
        hyst.Model.loads(json.dumps(file))


def test_files_are_replaced_only_on_request(tmp_path):
    pi, path = hyst.Pi(**PI), tmp_path / "model.json"
    path.write_text("older")
    with pytest.raises(FileExistsError, match=r"model\.json: .*overwrite=True"):
        pi.save(path, **RANGE)
    with pytest.raises(FileExistsError):
        pi.to_model(**RANGE).save(path, overwrite=False)
    assert path.read_text() == "older"
    pi.save(str(path), overwrite=True, **RANGE)
    assert path.read_text() == pi.to_json(**RANGE)
    with pytest.raises(hyst.ModelFileError, match="does not exist"):
        pi.save(tmp_path / "absent" / "model.json", **RANGE)
    assert [p.name for p in tmp_path.iterdir()] == ["model.json"]


@pytest.mark.parametrize(
    "options, error, message",
    [
        ({}, TypeError, "give input_range="),
        (dict(input_range=(1.0, 0.0)), hyst.ParameterError, "input_range must be two finite numbers"),
        (dict(input_range=(0.0, np.nan)), hyst.ParameterError, "input_range"),
        (dict(RANGE, output_range=(3.0, 2.0)), hyst.ParameterError, "output_range"),
        (dict(RANGE, input_column="volts"), hyst.ParameterError, "input_column must be voltage_v"),
        (dict(RANGE, output_column="volume_l"), ValueError, "output_column is"),
    ],
)
def test_invalid_ranges_and_columns_are_rejected(options, error, message, tmp_path):
    for call in (hyst.Pi(**PI).to_model, hyst.Pi(**PI).to_json, lambda **k: hyst.Pi(**PI).save(tmp_path / "a.json", **k)):
        with pytest.raises(error, match=message):
            call(**options)
    assert not list(tmp_path.iterdir())


def test_an_electromechanical_model_has_the_unit_of_its_file():
    case = next(c for c in CASES if c.label == "td-em, plays")
    metres = np.ptp(hyst.TdEm(**case.parameters, per_metre=1.0).simulate(case.u, **case.environment))
    # By default both are in micrometres.
    assert case.model().per_metre == 1e6 and case.model().to_model(**ends(case)).output_column == "displacement_um"
    for per_metre, unit in ((1e6, "um"), (1e9, "nm"), (1e3, "mm")):
        model, column = hyst.TdEm(**case.parameters, per_metre=per_metre), f"displacement_{unit}"
        assert np.ptp(model.simulate(case.u, **case.environment)) == pytest.approx(per_metre * metres, rel=1e-12)
        text = model.to_json(**ends(case), output_column=column)
        assert hyst.Model.loads(text).output_column == column
        wrong = json.loads(text)
        wrong["stages"][0]["per_metre"] = 1.0
        for other in ("um", "nm", "mm"):
            wrong["output"]["column"] = f"displacement_{other}"
            with pytest.raises(hyst.ModelFileError, match=r"per_metre must be 1e\d, because the output is in " + other):
                hyst.Model.loads(json.dumps(wrong))
            if other != unit:
                with pytest.raises(hyst.ParameterError, match=f"per_metre must be .* in {other}"):
                    model.to_model(**ends(case), output_column=f"displacement_{other}")
        with pytest.raises(hyst.ParameterError, match="output.column must be displacement_um"):
            model.to_model(**ends(case), output_column="force_n")


def test_inverses_and_operators_of_files_have_no_own_ranges():
    pi = hyst.Pi(**PI)
    with pytest.raises(TypeError, match="its model in `of`"):
        pi.inverse().to_model(**RANGE)
    model = pi.to_model(**RANGE)
    assert model.operator(1e-3).to_model() == model
    with pytest.raises(TypeError, match="has its ranges"):
        model.operator(1e-3).to_model(**RANGE)
