"""Every model against its reference, and what holds for all of them."""

import copy
import pickle

import conftest
import hyst
import numpy as np
import pytest
from cases import CASES
from drives import one_way
from reference import activation, fractional

each_case = pytest.mark.parametrize("case", CASES, ids=lambda c: c.label)


def span(x):
    return np.ptp(x)


@pytest.mark.parametrize("case", [c for c in CASES if c.reference], ids=lambda c: c.label)
def test_is_its_reference(case):
    y = case.model().simulate(case.u, **case.surroundings)
    expected = case.reference(case.u)
    assert np.max(np.abs(y - expected)) <= case.tolerance * span(expected)


@each_case
def test_step_is_simulate(case):
    model = case.model()
    y = model.simulate(case.u, **case.surroundings)

    def at(k):
        return {name: x if np.isscalar(x) else x[k] for name, x in case.surroundings.items()}

    assert model.reset(case.u[0], **at(0)) == y[0]
    assert all(model.step(case.u[k], **at(k)) == y[k] for k in range(1, len(case.u)))
    # A simulation neither uses nor moves that history, a reset clears it, and a first step is a reset.
    assert np.array_equal(model.simulate(case.u, **case.surroundings), y)
    assert model.reset(case.u[0], **at(0)) == y[0] and model.step(case.u[1], **at(1)) == y[1]
    fresh = case.model()
    assert fresh.step(case.u[0], **at(0)) == y[0] and fresh.step(case.u[1], **at(1)) == y[1]


@each_case
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_sample_that_is_no_number_counts_as_the_last_one(case, bad):
    first = {name: x if np.isscalar(x) else x[0] for name, x in case.surroundings.items()}
    model, twin = case.model(), case.model()
    for m in (model, twin):
        m.reset(case.u[0], **first)
        m.step(case.u[1], **first)
    assert model.step(bad, **first) == twin.step(case.u[1], **first)
    assert model.step(case.u[2], **first) == twin.step(case.u[2], **first)
    for call in (case.model().step, model.reset):
        with pytest.raises(ValueError, match="must be finite"):
            call(bad, **first)


@pytest.mark.parametrize("case", [c for c in CASES if c.inverse is not None], ids=lambda c: c.label)
def test_inverse(case):
    model = case.model()
    y = model.simulate(case.u, **case.surroundings)
    inverse = model.inverse(**case.inverse)
    assert inverse.of is model and inverse.inverse() is model and inverse.lead == 0
    for u in (model.compensate(y, **case.surroundings, **case.inverse), inverse.simulate(y, **case.surroundings)):
        assert case.folds or np.max(np.abs(u - case.u)) <= case.inverse_tolerance * span(case.u)
        again = model.simulate(u, **case.surroundings)
        assert np.max(np.abs(again - y)) <= case.inverse_tolerance * span(y)


@each_case
def test_parameters_come_back(case):
    model = case.model()
    for name, value in case.parameters.items():
        assert np.array_equal(getattr(model, name), value)
    for twin in (pickle.loads(pickle.dumps(model)), copy.deepcopy(model)):
        assert type(twin) is type(model) and repr(twin) == repr(model)
        y = model.simulate(case.u, **case.surroundings)
        assert np.array_equal(twin.simulate(case.u, **case.surroundings), y)
    assert repr(model).startswith(case.name + "(")


def test_the_list_of_missing_models_is_true():
    appeared = {name for name in conftest.NOT_IN_THIS_BUILD if hasattr(hyst, name)}
    assert not appeared, f"take {appeared} off NOT_IN_THIS_BUILD in conftest.py"


def test_no_model_is_without_a_case():
    models = {n for n in hyst.__all__ if isinstance(getattr(hyst, n), type) and issubclass(getattr(hyst, n), hyst.Operator)}
    assert models - {"Operator", "Inverse"} <= {case.name for case in CASES}


@pytest.mark.parametrize("name", ["delay", "lag", "resonance", "resonance beside a stiff part"])
def test_dynamics_are_inverted_in_a_band(name):
    case = next(c for c in CASES if c.label == name)
    model = case.model()
    inverse = model.inverse(bandwidth_hz=40.0)
    assert inverse.lead > 0 and inverse.bandwidth_hz == pytest.approx(40.0) and inverse.band_error < 0.01
    t = np.arange(4000) * 1e-3
    reference = np.sin(2 * np.pi * 3.0 * t) + 0.4 * np.sin(2 * np.pi * 17.0 * t)
    u = model.compensate(reference, bandwidth_hz=40.0)
    # Away from the ends, at which the reference has a kink.
    miss = np.abs(model.simulate(u) - reference)[800:-800].max()
    assert miss <= 1.4 * inverse.band_error
    # The inverse itself is early by its lead.
    assert np.array_equal(inverse.simulate(reference)[inverse.lead :], u[: -inverse.lead])


@pytest.mark.parametrize("name", ["play", "stop", "drift", "interference"])
def test_what_has_no_inverse_says_why(name):
    model = next(c for c in CASES if c.label == name).model()
    with pytest.raises(hyst.NotInvertibleError, match="no inverse: "):
        model.inverse()
    with pytest.raises(hyst.NotInvertibleError):
        model.compensate(np.zeros(3))


@pytest.mark.parametrize("label, way_out", [("dpm", "set fade above 0"), ("dpm, drifting", "leave drifting= out")])
def test_what_steps_has_no_inverse(label, way_out):
    model = next(c for c in CASES if c.label == label).model()
    with pytest.raises(hyst.NotInvertibleError, match=f"no inverse: .*{way_out}"):
        model.inverse(low=model.low, high=model.high)
    if not model.drifting:
        with pytest.raises(hyst.NotInvertibleError, match=way_out):
            model.to_model().operator(model.period).inverse()


@pytest.mark.parametrize("name", activation.FUNCTIONS)
def test_activation_inverses(name):
    """alpha < 0: solved backwards in time, with a preview of ln(1e9) |alpha| / k0 for 1e-9, twice that where the activation
    switches at zero. alpha > 0: a sample at a time."""
    u, printed = one_way(2000, 5.0, 40.0), activation.PRINTED[name]
    model = conftest.build(name, **printed, period=1e-4)
    y = model.simulate(u)
    lead = model.inverse(tolerance=1e-9).lead
    switches = 1 if name == "Softplus" else 2
    assert lead * 1e-4 == pytest.approx(switches * np.log(1e9) * abs(printed["alpha"]) / printed["k0"], rel=0.25)
    again = model.compensate(y, tolerance=1e-9)
    # The reference is held after its end, where the drive was still moving.
    assert np.max(np.abs(again - u)[: -2 * lead]) <= 1e-7 * span(u)
    model = conftest.build(name, **dict(printed, alpha=-printed["alpha"]), period=1e-4)
    assert model.inverse().lead == 0
    assert np.max(np.abs(model.compensate(model.simulate(u)) - u)) <= 1e-9 * span(u)
    with pytest.raises(TypeError, match="tolerance is of no use here: this inverse takes no options"):
        model.inverse(tolerance=1e-9)


def test_an_activation_inverse_is_that_of_its_file_and_says_why_there_is_none():
    given = dict(k0=1.0, alpha=-0.01, beta=0.5, gamma=0.1, period=1e-3)
    model = hyst.Tanh(**given)
    operator = model.to_model(input_range=(0.0, 10.0)).operator(1e-3)
    assert operator.inverse().lead == model.inverse(tolerance=1e-10).lead > model.inverse().lead > 0
    for tolerance in (0.0, 1.0, np.nan):
        with pytest.raises(hyst.ParameterError, match="tolerance"):
            model.inverse(tolerance=tolerance)
    # It falls within a sample, whatever the sign of alpha.
    for alpha in (0.01, -0.001):
        falling = hyst.Tanh(**dict(given, alpha=alpha, beta=-30.0, gamma=1.0, period=1e-2))
        with pytest.raises(hyst.NotInvertibleError, match="must rise with the input within a sample"):
            falling.inverse()
