"""Properties for all parameters and inputs, tested with random ones."""

import hyst
import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st

CELLS = 5


def numbers(low, high):
    return st.floats(low, high, allow_subnormal=False)


def signals(low=-50.0, high=50.0, most=60):
    return st.lists(numbers(low, high), min_size=1, max_size=most).map(np.array)


@st.composite
def pis(draw):
    steps = draw(st.lists(st.tuples(numbers(0.1, 10.0), numbers(0.0, 1.0)), max_size=12))
    thresholds = np.cumsum([s for s, _ in steps])
    return hyst.Pi(gain=draw(numbers(0.05, 2.0)), thresholds=thresholds, weights=[w for _, w in steps])


@st.composite
def preisachs(draw):
    n = CELLS * (CELLS + 1) // 2
    density = np.array(draw(st.lists(numbers(0.0, 1.0), min_size=n, max_size=n)))
    # The reversible part makes it invertible.
    diagonal = np.arange(CELLS) * (np.arange(CELLS) + 3) // 2
    density[diagonal] += 0.05
    once = draw(st.lists(numbers(0.0, 1.0), min_size=CELLS, max_size=CELLS))
    return hyst.Preisach(low=-50.0, high=50.0, density=density, once=once, rest=-50.0)


operators = st.one_of(pis(), preisachs())


@given(operators, signals())
def test_inverse_after_model(model, u):
    again = model.compensate(model.simulate(u))
    assert np.max(np.abs(again - u)) <= 1e-9 * 100


@given(operators, signals())
def test_model_after_inverse(model, u):
    y_ref = model.simulate(u)[::-1].copy()
    y = model.simulate(model.compensate(y_ref))
    assert np.max(np.abs(y - y_ref)) <= 1e-9 * max(np.ptp(y_ref), 1.0)


@given(operators, signals(), st.randoms(use_true_random=False))
def test_wiping_out(model, u, random):
    """A loop within the range of the present extrema has no effect after the input has left it."""
    low, high = sorted((random.uniform(-50.0, 50.0), random.uniform(-50.0, 50.0)))
    inside = np.array([random.uniform(low, high) for _ in range(8)])
    without = np.concatenate([u, [high, low, high]])
    with_loop = np.concatenate([u, [high, low], inside, [low, high]])
    onward = np.array([random.uniform(-50.0, 50.0) for _ in range(8)])
    a = model.simulate(np.concatenate([without, onward]))[-9:]
    b = model.simulate(np.concatenate([with_loop, onward]))[-9:]
    assert np.allclose(a, b, rtol=0, atol=1e-12 * (1 + np.abs(a).max()))


@given(operators, signals(), numbers(-50.0, 50.0), numbers(-50.0, 50.0))
def test_rising_input_rising_output(model, u, a, b):
    """After the same history, the larger input gives the larger output."""
    assume(b > a)
    low, high = (model.simulate(np.append(u, x))[-1] for x in (a, b))
    assert low <= high + 1e-12 * (1 + abs(high))


@given(pis(), signals(), numbers(0.1, 10.0))
def test_pi_scales(model, u, s):
    scaled = hyst.Pi(gain=model.gain, thresholds=s * model.thresholds, weights=model.weights)
    assert np.allclose(scaled.simulate(s * u), s * model.simulate(u), rtol=1e-12, atol=1e-12 * s * 50)
    assert np.array_equal(model.simulate(-u), -model.simulate(u))


@given(pis(), signals())
def test_pi_is_rate_independent(model, u):
    """Repeated and intermediate samples do not change the outputs at the others."""
    slow = np.repeat(u, 3)
    between = (u[:-1] + u[1:]) / 2
    slow[2:-1:3] = between
    assert np.allclose(model.simulate(slow)[::3], model.simulate(u), rtol=0, atol=1e-12 * 1000)


@given(numbers(0.1, 60.0), signals())
def test_play_and_stop_add_up(r, u):
    total = hyst.Play(radius=r).simulate(u) + hyst.Stop(limit=r).simulate(u)
    assert np.allclose(total, u, rtol=0, atol=1e-12 * 50)


linear_stages = st.one_of(
    st.builds(lambda tau: hyst.Lag(seconds=tau, period=1e-3), numbers(0.0, 1.0)),
    st.builds(lambda d: hyst.Delay(seconds=d, period=1e-3), numbers(0.0, 0.05)),
    st.builds(
        lambda hz, z, g: hyst.Resonance(hz=hz, damping=z, gain=g, period=1e-3),
        numbers(1.0, 400.0),
        numbers(0.001, 0.9),
        numbers(0.0, 1.0),
    ),
    st.builds(lambda tau, c: hyst.Creep(seconds=[tau], shares=[c], period=1e-3), numbers(1e-3, 100.0), numbers(0.0, 0.5)),
)


@given(linear_stages, st.lists(st.tuples(numbers(-9, 9), numbers(-9, 9)), min_size=1, max_size=60), numbers(-3, 3))
def test_superposition(stage, pairs, s):
    u, v = np.array(pairs).T.copy()
    together = stage.simulate(u + s * v)
    assert np.allclose(together, stage.simulate(u) + s * stage.simulate(v), rtol=0, atol=1e-11 * 40)


@given(linear_stages, numbers(-9, 9))
def test_a_constant_input_gives_a_constant_output(stage, u0):
    y = stage.simulate(np.full(50, u0))
    assert np.allclose(y, y[0], rtol=0, atol=1e-12 * (1 + abs(y[0])))
