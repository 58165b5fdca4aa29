"""Every model against its reference, and properties of all models."""

import copy
import pickle

import conftest
import hyst
import numpy as np
import pytest
from cases import CASES, N
from drives import one_way
from reference import activation, fractional

each_case = pytest.mark.parametrize("case", CASES, ids=lambda c: c.label)


def span(x):
    return np.ptp(x)


@pytest.mark.parametrize("case", [c for c in CASES if c.reference], ids=lambda c: c.label)
def test_a_model_agrees_with_its_reference(case):
    y = case.model().simulate(case.u, **case.environment)
    expected = case.reference(case.u)
    assert np.max(np.abs(y - expected)) <= case.tolerance * span(expected)


@each_case
def test_steps_agree_with_simulate(case):
    model = case.model()
    y = model.simulate(case.u, **case.environment)

    def at(k):
        return {name: x if np.isscalar(x) else x[k] for name, x in case.environment.items()}

    assert model.reset(case.u[0], **at(0)) == y[0]
    assert all(model.step(case.u[k], **at(k)) == y[k] for k in range(1, len(case.u)))
    # A simulation neither uses nor changes that state, a reset clears it, and a first step is a reset.
    assert np.array_equal(model.simulate(case.u, **case.environment), y)
    assert model.reset(case.u[0], **at(0)) == y[0] and model.step(case.u[1], **at(1)) == y[1]
    fresh = case.model()
    assert fresh.step(case.u[0], **at(0)) == y[0] and fresh.step(case.u[1], **at(1)) == y[1]


@each_case
@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_an_invalid_sample_counts_as_the_last_one(case, bad):
    first = {name: x if np.isscalar(x) else x[0] for name, x in case.environment.items()}
    model, twin = case.model(), case.model()
    for m in (model, twin):
        m.reset(case.u[0], **first)
        m.step(case.u[1], **first)
    assert model.step(bad, **first) == twin.step(case.u[1], **first)
    assert model.step(case.u[2], **first) == twin.step(case.u[2], **first)
    for call in (case.model().step, model.reset):
        with pytest.raises(ValueError, match="must be finite"):
            call(bad, **first)


def each_inverse(*finds):
    found = [c for c in CASES if c.inverse is not None and c.finds in finds]
    return pytest.mark.parametrize("case", found, ids=lambda c: c.label)


def other_reference(y):
    """Returns a reference in the span of ``y`` that is not the output of a drive."""
    k = np.arange(len(y))
    return y.min() + span(y) * (0.5 - 0.45 * np.cos(13e-3 * k) * np.cos(4.1e-3 * k))


@each_inverse("drive", "reference")
def test_the_inverse_reaches_the_reference(case):
    """M ∘ M⁻¹ = 1"""
    model = case.model()
    y = model.simulate(case.u, **case.environment)
    inverse = model.inverse(**case.inverse)
    assert inverse.of is model and inverse.inverse() is model
    assert inverse.lead == 0 and inverse.bandwidth_hz is None and inverse.band_error == 0.0
    for reference in (y, other_reference(y)) if case.finds == "reference" else (y,):
        u = model.compensate(reference, **case.environment, **case.inverse)
        assert np.array_equal(inverse.simulate(reference, **case.environment), u)
        reached = model.simulate(u, **case.environment)
        assert np.max(np.abs(reached - reference)) <= case.inverse_tolerance * span(y)


@each_inverse("drive")
def test_the_inverse_recovers_the_drive(case):
    """M⁻¹ ∘ M = 1"""
    model = case.model()
    u = model.compensate(model.simulate(case.u, **case.environment), **case.environment, **case.inverse)
    assert np.max(np.abs(u - case.u)) <= case.inverse_tolerance * span(case.u)


@each_inverse("nearly")
def test_an_approximate_inverse_reaches_the_reference_within_its_tolerance(case):
    model = case.model()
    y = model.simulate(case.u, **case.environment)
    reached = model.simulate(model.compensate(y, **case.environment, **case.inverse), **case.environment)
    assert np.max(np.abs(reached - y)) <= case.inverse_tolerance * span(y)


@each_inverse("band")
def test_dynamics_are_inverted_in_a_band(case):
    model, hz = case.model(), case.inverse["bandwidth_hz"]
    inverse = model.inverse(**case.inverse)
    assert inverse.lead > 0 and inverse.bandwidth_hz == pytest.approx(hz) and inverse.band_error < 0.01
    t, size = np.arange(N) * model.period, 14.0
    reference = 10.0 * np.sin(2 * np.pi * 0.075 * hz * t) + 4.0 * np.sin(2 * np.pi * 0.425 * hz * t)
    u = model.compensate(reference, **case.environment, **case.inverse)
    # Away from the ends, at which the reference has a kink.
    error = np.abs(model.simulate(u, **case.environment) - reference)[400:-400].max()
    assert error <= size * (inverse.band_error + case.inverse_tolerance)
    # The inverse itself is early by its lead.
    early = inverse.simulate(reference, **case.environment)
    assert np.array_equal(early[inverse.lead :], u[: -inverse.lead])


@pytest.mark.parametrize("case", [c for c in CASES if c.inverse is None], ids=lambda c: c.label)
def test_a_model_without_an_inverse_gives_the_reason(case):
    model = case.model()
    with pytest.raises(hyst.NotInvertibleError, match="no inverse: .+"):
        model.inverse()
    with pytest.raises(hyst.NotInvertibleError, match="no inverse: .+"):
        model.compensate(np.zeros(3), **{name: 1.0 for name in case.environment})


def test_an_inverse_is_exact_on_one_side_of_crossing_envelopes():
    """Both drives belong to one model. The drive that stays on one side is the case "envelopes apart"."""
    across, apart = (next(c for c in CASES if c.label == label) for label in ("gpi", "gpi, envelopes apart"))
    model = across.model()
    assert repr(model) == repr(apart.model())
    y = model.simulate(across.u)
    error = np.abs(model.simulate(model.compensate(y)) - y)
    assert error.max() > 1e-3 * span(y)
    crossed = np.argmax(model.compensate(y) < -25.0)
    assert crossed > 0 and error[:crossed].max() <= 1e-12 * span(y)


@each_case
def test_parameters_can_be_read_and_copied(case):
    model = case.model()
    for name, value in case.parameters.items():
        assert np.array_equal(getattr(model, name), value)
    for twin in (pickle.loads(pickle.dumps(model)), copy.deepcopy(model)):
        assert type(twin) is type(model) and repr(twin) == repr(model)
        y = model.simulate(case.u, **case.environment)
        assert np.array_equal(twin.simulate(case.u, **case.environment), y)
    assert repr(model).startswith(case.name + "(")


def test_the_list_of_missing_models_is_correct():
    present = {name for name in conftest.NOT_IN_THIS_BUILD if hasattr(hyst, name)}
    assert not present, f"remove {present} from NOT_IN_THIS_BUILD in conftest.py"


def test_every_model_has_a_case():
    models = {n for n in hyst.__all__ if isinstance(getattr(hyst, n), type) and issubclass(getattr(hyst, n), hyst.Operator)}
    assert models - {"Operator", "Inverse"} <= {case.name for case in CASES}


@pytest.mark.parametrize("label, advice", [("dpm", "set fade above 0"), ("dpm, drifting", "leave drifting= out")])
def test_a_model_with_jumps_has_no_inverse(label, advice):
    model = next(c for c in CASES if c.label == label).model()
    with pytest.raises(hyst.NotInvertibleError, match=f"no inverse: .*{advice}"):
        model.inverse(low=model.low, high=model.high)
    if not model.drifting:
        with pytest.raises(hyst.NotInvertibleError, match=advice):
            model.to_model().operator(model.period).inverse()


def test_every_kind_of_inverse_is_tested():
    assert {c.finds for c in CASES} == {"drive", "reference", "band", "preview", "nearly", "part"}
    assert {c.name for c in CASES if c.finds == "preview"} == set(activation.FUNCTIONS)


@pytest.mark.parametrize("name", activation.FUNCTIONS)
def test_activation_inverses(name):
    """alpha < 0: solved backwards in time, with a preview of ln(1e9) |alpha| / k0 for 1e-9, twice that if the
    activation switches at zero. alpha > 0: sample by sample."""
    u, printed = one_way(2000, 5.0, 40.0), activation.PRINTED[name]
    model = conftest.build(name, **printed, period=1e-4)
    y = model.simulate(u)
    lead = model.inverse(tolerance=1e-9).lead
    switches = 1 if name == "Softplus" else 2
    # In addition to the tolerance: the size of the rate, and the error of the output divided by that of the drive.
    tau = abs(printed["alpha"]) / printed["k0"]
    asked = np.log(1e9) + np.log(2 * (1 + 2 * tau / 1e-4))
    assert lead * 1e-4 == pytest.approx(switches * asked * tau, rel=0.12)
    again = model.compensate(y, tolerance=1e-9)
    # The reference is held after its end, at which the drive was not at rest.
    assert np.max(np.abs(again - u)[: -2 * lead]) <= 1e-7 * span(u)
    model = conftest.build(name, **dict(printed, alpha=-printed["alpha"]), period=1e-4)
    assert model.inverse().lead == 0
    assert np.max(np.abs(model.compensate(model.simulate(u)) - u)) <= 1e-9 * span(u)
    with pytest.raises(TypeError, match="tolerance is of no use here: this inverse takes no options"):
        model.inverse(tolerance=1e-9)


def test_an_activation_inverse_agrees_with_that_of_its_file():
    given = dict(k0=1.0, alpha=-0.01, beta=0.5, gamma=0.1, period=1e-3)
    model = hyst.Tanh(**given)
    operator = model.to_model(input_range=(0.0, 10.0)).operator(1e-3)
    assert operator.inverse().lead == model.inverse(tolerance=1e-10).lead > model.inverse().lead > 0
    for tolerance in (0.0, 1.0, np.nan):
        with pytest.raises(hyst.ParameterError, match="tolerance"):
            model.inverse(tolerance=tolerance)
    # No inverse if the output falls within a sample, for either sign of alpha.
    for alpha in (0.01, -0.001):
        falling = hyst.Tanh(**dict(given, alpha=alpha, beta=-30.0, gamma=1.0, period=1e-2))
        with pytest.raises(hyst.NotInvertibleError, match="must rise with the input within a sample"):
            falling.inverse()
