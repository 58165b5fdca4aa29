"""Operators as model files: what is written is what comes back, and nothing is replaced unasked."""

import json
from pathlib import Path

import hyst
import numpy as np
import pytest
from cases import CASES, PERIOD

KINDS = {path.stem for path in (Path(__file__).parents[2] / "docs" / "models").glob("*.json")}
# Variants that files do not hold.
UNFILED = {"dpm, drifting"} | {c.label for c in CASES if "memory" in c.parameters}
FILED = [c for c in CASES if c.label not in UNFILED]
PI = dict(gain=0.1, thresholds=[10.0, 20.0], weights=[0.02, 0.01])
RANGE = dict(input_range=(0.0, 100.0))


def ends(case):
    return dict(input_range=(case.u.min(), case.u.max()))


@pytest.mark.parametrize("case", FILED, ids=lambda c: c.label)
def test_an_operator_comes_back_from_its_file(case, tmp_path):
    model, path = case.model(), tmp_path / "model.json"
    model.save(path, **ends(case))
    loaded = hyst.Model.load(path)
    assert loaded == model.to_model(**ends(case)) and model.to_json(**ends(case)) == path.read_text()
    assert (loaded.input_range, loaded.zero) == ((case.u.min(), case.u.max()), 0.0)
    operator = loaded.operator(getattr(model, "period", 0) or PERIOD)
    y = model.simulate(case.u, **case.surroundings)
    assert np.array_equal(operator.simulate(case.u, **case.surroundings), y)
    # The file of the file's operator is the same file.
    assert operator.to_json() == path.read_text()


@pytest.mark.parametrize("case", [c for c in FILED if c.inverse is not None], ids=lambda c: c.label)
def test_its_inverse_comes_back_too(case):
    model = case.model()
    y = model.simulate(case.u, **case.surroundings)
    operator = model.to_model(**ends(case)).operator(getattr(model, "period", 0) or PERIOD)
    # What a file's inverse leaves to the file and to itself: the inputs of a search and how near it comes.
    options = {name: x for name, x in case.inverse.items() if name == "bandwidth_hz"}
    u, own = (x.compensate(y, **case.surroundings, **o) for x, o in ((operator, options), (model, case.inverse)))
    assert operator.inverse(**options).bandwidth_hz == model.inverse(**case.inverse).bandwidth_hz
    assert np.allclose(u, own, rtol=0, atol=case.inverse_tolerance * np.ptp(case.u))


def test_every_kind_of_file_is_tried():
    assert len(KINDS) == 16 and {c.model().to_model(**ends(c)).kind for c in FILED} == KINDS


@pytest.mark.parametrize("label", sorted(UNFILED))
def test_variants_that_files_do_not_hold_say_so(label, tmp_path):
    case = next(c for c in CASES if c.label == label)
    with pytest.raises(hyst.ModelFileError, match=f"{case.name}: .*(memory=|stack form)"):
        case.model().save(tmp_path / "model.json", **ends(case))
    assert not list(tmp_path.iterdir())


def test_a_file_says_what_it_was_told():
    pi = hyst.Pi(**PI)
    said = json.loads(pi.to_json(input_range=(-20.0, 120.0), input_column="force_in_n", output_column="displacement_nm"))
    assert said["schema"] == "hyst.model/1" and said["fitted_on"] == []
    assert said["input"] == {"column": "force_in_n", "unit": "N", "low": -20.0, "high": 120.0}
    rest = [pi.reset(-20.0), pi.reset(120.0)]
    assert said["output"] == {"column": "displacement_nm", "unit": "nm", "low": rest[0], "high": rest[1]}
    units = {"gain": "nm/N", "thresholds": "N", "weights": "nm/N"}
    assert said["stages"] == [{"stage": "pi", **PI, "units": units}]
    assert pi.to_model(**RANGE, output_range=(-1.0, 9.0)).output_range == (-1.0, 9.0)
    # A grid is a range, and a sample period a rate.
    assert hyst.Preisach(low=-5.0, high=50.0, density=[1.0]).to_model().input_range == (-5.0, 50.0)
    assert hyst.Lag(seconds=0.01, period=2e-3).to_model(**RANGE).to_dict()["recorded_at_hz"] == 500.0
    # What acts beside no hysteresis.
    creep = hyst.Creep(seconds=[1.0], shares=[0.1], period=1e-3).to_model(**RANGE)
    assert (creep.kind, creep.effects) == ("pi", ["creep"])


def test_a_file_of_arrays_serves_the_record_methods():
    model = hyst.Pi(**PI).to_model(**RANGE)
    t = np.arange(2000) * 1e-3
    u = 50.0 * (1 - np.cos(2 * np.pi * t))
    y = model.simulate(hyst.Record(t, u)).outputs
    assert np.array_equal(y, hyst.Pi(**PI).simulate(u))
    assert np.allclose(model.compensate(hyst.Record(t, outputs=y)).inputs, u, rtol=0, atol=1e-9)


def test_the_drive_between_samples_is_kept_and_a_period_repeats():
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
    said = linear.simulate(once, periodic=True).outputs
    assert np.array_equal(said, linear.simulate(twice).outputs[300:])
    # Straight lines through a sine of 150 Hz at 750 Hz have 87.5 % of it.
    more = np.std(band.simulate(once, periodic=True).outputs) / np.std(said)
    assert 1.1 < more < 1.2
    file["input"]["between_samples"] = "cubic"
    with pytest.raises(hyst.ModelFileError, match="band-limited"):
        hyst.Model.loads(json.dumps(file))


def test_nothing_is_replaced_unasked(tmp_path):
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
    "said, error, message",
    [
        ({}, TypeError, "give input_range="),
        (dict(input_range=(1.0, 0.0)), hyst.ParameterError, "input_range must be two finite numbers"),
        (dict(input_range=(0.0, np.nan)), hyst.ParameterError, "input_range"),
        (dict(RANGE, output_range=(3.0, 2.0)), hyst.ParameterError, "output_range"),
        (dict(RANGE, input_column="volts"), hyst.ParameterError, "input_column must be voltage_v"),
        (dict(RANGE, output_column="volume_l"), ValueError, "output_column is"),
    ],
)
def test_ends_that_make_no_file(said, error, message, tmp_path):
    for call in (hyst.Pi(**PI).to_model, hyst.Pi(**PI).to_json, lambda **k: hyst.Pi(**PI).save(tmp_path / "a.json", **k)):
        with pytest.raises(error, match=message):
            call(**said)
    assert not list(tmp_path.iterdir())


def test_an_electromechanical_model_gives_the_unit_that_its_file_states():
    case = next(c for c in CASES if c.label == "td-em, plays")
    metres = np.ptp(hyst.TdEm(**case.parameters, per_metre=1.0).simulate(case.u, **case.surroundings))
    # Unless told otherwise both are in micrometres.
    assert case.model().per_metre == 1e6 and case.model().to_model(**ends(case)).output_column == "displacement_um"
    for per_metre, unit in ((1e6, "um"), (1e9, "nm"), (1e3, "mm")):
        model, column = hyst.TdEm(**case.parameters, per_metre=per_metre), f"displacement_{unit}"
        assert np.ptp(model.simulate(case.u, **case.surroundings)) == pytest.approx(per_metre * metres, rel=1e-12)
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


def test_what_is_no_operator_of_a_class():
    pi = hyst.Pi(**PI)
    with pytest.raises(TypeError, match="its model in `of`"):
        pi.inverse().to_model(**RANGE)
    model = pi.to_model(**RANGE)
    assert model.operator(1e-3).to_model() == model
    with pytest.raises(TypeError, match="has its ranges"):
        model.operator(1e-3).to_model(**RANGE)
