"""Requests beyond a range cause a warning with the number of samples and the largest excess; others do not."""

import re
import warnings

import hyst
import numpy as np
import pytest
from cases import CASES
from drives import both_ways

BOUC_WEN = dict(k0=0.15, alpha=0.05, beta=0.06, gamma=-0.02)
WIDE = both_ways(500, 40.0)


def silent(call):
    with warnings.catch_warnings():
        warnings.simplefilter("error", hyst.RangeWarning)
        return call()


def warned(call):
    """Returns the result of the call, and count, size and index of its only warning."""
    with pytest.warns(hyst.RangeWarning) as caught:
        result = call()
    assert len(caught) == 1 and caught[0].filename == __file__
    found = re.fullmatch(r"(\d+) of 500 samples of \w+ are not reached .* by (\S+) at most \(\w+\[(\d+)\]\).*", str(caught[0].message))
    return result, int(found[1]), float(found[2]), int(found[3])


def check(model, u, y, reported):
    count, largest, at = reported
    error = np.abs(model.simulate(u) - y)
    missed = error > 1e-5 * np.ptp(y)
    assert 0 < missed.sum() == count and at == np.argmax(error) and largest == pytest.approx(error.max(), rel=1e-3)


@pytest.mark.parametrize("case", [c for c in CASES if c.inverse is not None], ids=lambda c: c.label)
def test_a_reference_within_reach_causes_no_warning(case):
    model = case.model()
    y = model.simulate(case.u, **case.environment)
    silent(lambda: model.compensate(y, **case.environment, **case.inverse))
    silent(lambda: model.inverse(**case.inverse).simulate(y, **case.environment))


def test_a_searched_inverse_warns_beyond_its_range():
    model = hyst.BoucWen(**BOUC_WEN)
    y = model.simulate(WIDE)
    u, *reported = warned(lambda: model.compensate(y, low=-15.0, high=12.0))
    assert u.min() == -15.0 and u.max() == 12.0
    check(model, u, y, reported)
    inverse = model.inverse(low=-15.0, high=12.0)
    again, *reported_again = warned(lambda: inverse.simulate(y))
    assert np.array_equal(again, u) and reported_again == reported
    # Sample by sample there is no warning.
    assert silent(lambda: [inverse.reset(y[0]), *(inverse.step(x) for x in y[1:])]) == list(u)
    # Resting at the end of the range causes no warning.
    held = np.full(500, 12.0)
    silent(lambda: model.compensate(model.simulate(held), low=-15.0, high=12.0))


def test_a_saturation_warns_beyond_its_limits():
    for knee in (0.0, 0.2):
        saturation = hyst.Saturation(low=-20.0, high=25.0, knee=knee)
        u, *reported = warned(lambda: saturation.compensate(WIDE))
        check(saturation, u, WIDE, reported)


def test_the_operator_of_a_file_warns_beyond_its_range():
    model = hyst.BoucWen(**BOUC_WEN)
    # The inverse of a file extends the range by its width on either side: here from -15 to 15.
    operator = model.to_model(input_range=(-5.0, 5.0)).operator(1e-3)
    y = model.simulate(WIDE)
    u, *reported = warned(lambda: operator.compensate(y))
    assert np.abs(u).max() == 15.0
    check(model, u, y, reported)
    silent(lambda: model.to_model(input_range=(-20.0, 20.0)).operator(1e-3).compensate(y))


def test_a_warning_can_be_an_error():
    model = hyst.BoucWen(**BOUC_WEN)
    assert issubclass(hyst.RangeWarning, UserWarning)
    with pytest.raises(hyst.RangeWarning, match="not reached"):
        silent(lambda: model.compensate(model.simulate(WIDE), low=-1.0, high=1.0))


def test_a_prediction_reports_extrapolated_rows():
    model = hyst.Pi(gain=0.1, thresholds=[10.0], weights=[0.02]).to_model(input_range=(-10.0, 30.0))
    t = np.arange(500) * 1e-3
    beyond = np.maximum(WIDE - 30.0, -10.0 - WIDE)
    with pytest.warns(hyst.RangeWarning, match=f"in {(beyond > 0).sum()} of 500 rows") as caught:
        reported = model.simulate(hyst.Record(t, WIDE)).extrapolated
    assert caught[0].filename == __file__
    assert reported == {"rows": (beyond > 0).sum(), "largest": beyond.max(), "row": np.argmax(beyond)}
    within = silent(lambda: model.simulate(hyst.Record(t, np.clip(WIDE, -10.0, 30.0))))
    assert within.extrapolated == {"rows": 0, "largest": 0.0, "row": 0}


def test_a_constant_temperature_replaces_a_column():
    model = hyst.Temperature(per_kelvin=0.01, reference_degc=20.0).to_model(input_range=(-50.0, 50.0))
    t = np.arange(500) * 1e-3
    with pytest.raises(hyst.RecordError, match=r"temperature_degc is missing.*in Python temperature="):
        model.simulate(hyst.Record(t, WIDE))
    given = model.simulate(hyst.Record(t, WIDE), temperature=30.0).outputs
    assert np.allclose(given, 1.1 * WIDE, rtol=1e-14)
    assert np.array_equal(given, model.simulate(hyst.Record(t, WIDE, temperature=np.full(500, 30.0))).outputs)
    with pytest.raises(ValueError, match="finite"):
        model.simulate(hyst.Record(t, WIDE), temperature=np.nan)
