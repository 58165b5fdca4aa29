"""Arrays in and out, errors, threads."""

import threading
import time

import hyst
import numpy as np
import pytest

PI = hyst.Pi(gain=0.1, thresholds=[10.0, 20.0], weights=[0.02, 0.01])
WARM = hyst.Temperature(per_kelvin=0.01, reference_degc=20.0)
U = 50.0 * np.sin(np.linspace(0.0, 30.0, 500))


def test_outputs_are_new_float64_arrays():
    before = U.copy()
    y, again = PI.simulate(U), PI.simulate(U)
    assert y.dtype == np.float64 and y.shape == U.shape and y.flags.writeable and y.flags.c_contiguous
    assert np.array_equal(y, again) and not np.shares_memory(y, again) and not np.shares_memory(y, U)
    assert np.array_equal(U, before)
    y[:] = 0.0
    assert np.array_equal(PI.simulate(U), again)


def test_read_only_mapped_and_sliced_arrays_are_signals(tmp_path):
    locked = U.copy()
    locked.flags.writeable = False
    on_disk = np.memmap(tmp_path / "u", dtype=float, mode="w+", shape=U.shape)
    on_disk[:] = U
    for u in (locked, on_disk, np.stack([U, U])[1], np.concatenate([[0.0], U])[1:]):
        assert np.array_equal(PI.simulate(u), PI.simulate(U))


WHOLE = np.round(U).astype(int)


@pytest.mark.parametrize(
    "u",
    [
        list(WHOLE),
        tuple(WHOLE.tolist()),
        range(-3, 60),
        WHOLE,
        WHOLE.astype(np.int8),
        WHOLE.astype(np.uint16),
        WHOLE.astype(np.float32),
        WHOLE.astype(np.float16),
        WHOLE.astype(">f8"),
        WHOLE.astype(object),
        WHOLE > 3,
        U[::2],
        U[::-1],
        np.stack([U, U])[:, 7:].T[:, 1],
        np.ma.masked_array(U, mask=np.zeros(len(U), bool)),
        np.array(memoryview(U)),
    ],
    ids=lambda u: f"{type(u).__name__}-{getattr(u, 'dtype', '')}",
)
def test_whatever_numpy_converts_is_a_signal(u):
    same = np.ascontiguousarray(u, dtype=float)
    assert np.array_equal(PI.simulate(u), PI.simulate(same))
    assert np.array_equal(PI.compensate(u), PI.compensate(same))
    assert np.array_equal(WARM.simulate(same, temperature=u), WARM.simulate(same, temperature=same))


def test_columns_of_tables_are_signals():
    pandas, polars = pytest.importorskip("pandas"), pytest.importorskip("polars")
    for column in (
        pandas.Series(U),
        pandas.Series(U, index=np.arange(len(U))[::-1]),
        pandas.Series(WHOLE, dtype="Int64"),
        pandas.Series(U, dtype="Float64"),
        polars.Series(U),
        polars.Series(WHOLE),
        pandas.DataFrame({"u": U, "v": WHOLE})["u"],
    ):
        assert np.array_equal(PI.simulate(column), PI.simulate(np.asarray(column, dtype=float)))
    assert hyst.Pi(gain=0.1, thresholds=pandas.Series([10, 20]), weights=polars.Series([0.02, 0.01])) == PI
    with pytest.raises(ValueError, match=r"u\[1\] is NaN"):
        PI.simulate(pandas.Series([1.0, None, 3.0]))
    with pytest.raises(ValueError, match=r"u\[1\] is NaN"):
        PI.simulate(polars.Series([1.0, None, 3.0]))


def test_an_empty_input_gives_an_empty_output():
    for y in (PI.simulate(np.empty(0)), PI.compensate(np.empty(0)), hyst.Lag(seconds=1e-2, period=1e-3).compensate(np.empty(0))):
        assert y.shape == (0,) and y.dtype == np.float64


@pytest.mark.parametrize(
    "u, error, message",
    [
        (3.0, TypeError, "not one number"),
        (np.array(1.0), TypeError, "not one number"),
        (None, TypeError, "not None"),
        ("abc", TypeError, "not str"),
        ({1.0, 2.0}, TypeError, "not set"),
        (np.zeros(3, dtype=complex), TypeError, "complex128"),
        (np.array(["1.0"]), TypeError, "<U3"),
        (["1.0", "2.0"], TypeError, "<U3"),
        (np.array([1.0, "a"], dtype=object), TypeError, "object"),
        (np.array(["2024-01-01"], dtype="M8[s]"), TypeError, "datetime64"),
        ([[1.0, 2.0], [3.0, 4.0]], ValueError, "one dimension, not 2"),
        ([[1.0], [2.0, 3.0]], TypeError, "real numbers"),
        (np.zeros((2, 2)), ValueError, "one dimension, not 2"),
        (np.ma.masked_array([1.0, 2.0], mask=[False, True]), ValueError, r"u\[1\] is NaN"),
        (np.array([0.0, np.nan]), ValueError, r"u\[1\]"),
        (np.array([np.inf, 0.0]), ValueError, r"u\[0\]"),
    ],
)
def test_invalid_signals_are_rejected(u, error, message):
    with pytest.raises(error, match=message):
        PI.simulate(u)
    with pytest.raises(error, match=message.replace("u", "y_ref", 1) if message.startswith("u") else None):
        PI.compensate(u)


@pytest.mark.parametrize("row", [0, 1, 512, 513, 1024, 1199])
@pytest.mark.parametrize("number", [np.nan, -np.inf])
def test_a_number_that_is_not_finite_is_named_at_any_position(row, number):
    u = np.linspace(0.0, 50.0, 1200)
    u[row] = number
    # The inverse of the third model has a preview.
    previewed = hyst.Resonance(hz=50.0, damping=0.5, period=1e-3)
    for run, name in ((PI.simulate, "u"), (PI.compensate, "y_ref"), (previewed.compensate, "y_ref")):
        with pytest.raises(ValueError, match=rf"^{name}\[{row}\] is (?i:{number}); signals must be finite"):
            run(u)


def test_environment():
    t = np.linspace(20.0, 30.0, len(U))
    assert np.array_equal(WARM.simulate(U, temperature=20.0), U)
    assert np.allclose(WARM.simulate(U, temperature=t), U * (1 + 0.01 * (t - 20.0)), rtol=1e-14)
    assert WARM.step(2.0, temperature=np.float64(30.0)) == pytest.approx(2.2)
    assert np.array_equal(WARM.simulate(U, temperature=25), WARM.simulate(U, temperature=np.full(len(U), 25.0)))
    # Columns that a model does not use are allowed.
    assert np.array_equal(PI.simulate(U, temperature=t, load=3.0, time=t), PI.simulate(U))


@pytest.mark.parametrize(
    "given, error, message",
    [
        ({}, TypeError, "Temperature depends on temperature"),
        (dict(temperature=U[:-1]), ValueError, "499 values, but the signal has 500"),
        (dict(temperature="warm"), TypeError, "not str"),
        (dict(temperature=np.nan), ValueError, "finite"),
        (dict(temperature=np.where(U == U[3], np.nan, 20.0)), ValueError, r"temperature\[3\]"),
        (dict(temperature=np.zeros((500, 2))), ValueError, "one dimension, not 2"),
    ],
)
def test_an_invalid_environment_is_rejected(given, error, message):
    with pytest.raises(error, match=message):
        WARM.simulate(U, **given)


def test_a_missing_environment_is_rejected_sample_by_sample():
    for call in (WARM.reset, WARM.step):
        with pytest.raises(TypeError, match="depends on temperature"):
            call(1.0)
    with pytest.raises(TypeError, match="depends on temperature"):
        WARM.compensate(U)
    with pytest.raises(TypeError, match="depends on temperature"):
        WARM.inverse().simulate(U)
    with pytest.raises((TypeError, ValueError)):
        WARM.step(1.0, temperature=U)


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda: hyst.Pi(gain=np.nan, thresholds=[], weights=[]), "pi.gain"),
        (lambda: hyst.Pi(gain=1.0, thresholds=[1.0], weights=[]), "pi.thresholds and pi.weights"),
        (lambda: hyst.Pi(gain=1.0, thresholds=[2.0, 1.0], weights=[1.0, 1.0]), "pi.thresholds"),
        (lambda: hyst.Pi(gain=1.0, thresholds=np.arange(1.0, 66.0), weights=np.ones(65)), "65 needed"),
        (lambda: hyst.Play(radius=-1.0), "positive"),
        (lambda: hyst.Lag(seconds=-1.0, period=1e-3), "lag.seconds"),
        (lambda: hyst.Lag(seconds=1.0, period=0.0), "sample period"),
        (lambda: hyst.Delay(seconds=60.0, period=1e-3), "holds 8192"),
        (lambda: hyst.Resonance(hz=50.0, damping=1.5, period=1e-3), "resonance.damping"),
        (lambda: hyst.Preisach(low=0.0, high=1.0, density=[1.0, 1.0]), "preisach"),
        (lambda: hyst.Preisach(low=1.0, high=0.0, density=[1.0]), "preisach"),
        (lambda: hyst.Preisach(low=0.0, high=1.0, density=[-1.0]), "preisach"),
        (lambda: hyst.Preisach(low=0.0, high=1.0, density=[1.0], once=[1.0, 2.0]), "preisach.once"),
        (lambda: hyst.Preisach(low=0.0, high=1.0, density=np.ones(65 * 33)), "holds 65"),
    ],
)
def test_wrong_parameters_are_named(make, message):
    with pytest.raises(hyst.ParameterError, match=message) as caught:
        make()
    assert isinstance(caught.value, ValueError) and isinstance(caught.value, hyst.HystError)


def test_wrong_calls_are_type_errors():
    for call in (
        lambda: hyst.Pi(0.1, [], []),
        lambda: hyst.Pi(gain=0.1),
        lambda: hyst.Pi(gain="a", thresholds=[], weights=[]),
        lambda: hyst.Pi(gain=0.1, thresholds=3.0, weights=[]),
        lambda: hyst.Operator(),
        lambda: PI.step("a"),
        lambda: PI.step(U),
    ):
        with pytest.raises(TypeError):
            call()
    with pytest.raises(AttributeError):
        PI.gain = 3.0


def test_options_of_an_inverse():
    with pytest.raises(TypeError, match="low is of no use here"):
        PI.inverse(low=0.0)
    with pytest.raises(TypeError, match="bandwidth_hz is of no use here"):
        PI.compensate(U, bandwidth_hz=10.0)
    with pytest.raises(hyst.NotInvertibleError, match="no inverse: "):
        hyst.Pi(gain=0.1, thresholds=[1.0], weights=[-0.2]).inverse()
    with pytest.raises(hyst.ParameterError):
        hyst.Lag(seconds=1e-2, period=1e-3).inverse(bandwidth_hz=400.0)


def test_errors_have_one_root():
    for name in hyst.__all__:
        if name.endswith("Error"):
            assert issubclass(getattr(hyst, name), hyst.HystError) and getattr(hyst, name).__doc__


def test_the_lock_is_released():
    u = np.tile(U, 4000)
    running, ticks = threading.Event(), 0

    def work():
        running.set()
        PI.simulate(u)

    start = time.perf_counter()
    PI.simulate(u)
    alone = time.perf_counter() - start
    worker = threading.Thread(target=work)
    worker.start()
    running.wait()
    while worker.is_alive():
        time.sleep(alone / 100)
        ticks += 1
    # If the lock were held, there would be one or two.
    assert ticks > 10


def test_threads_share_a_model():
    outputs = [None] * 8

    def work(i):
        outputs[i] = PI.simulate(U + i)

    threads = [threading.Thread(target=work, args=(i,)) for i in range(8)]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    assert all(np.array_equal(y, PI.simulate(U + i)) for i, y in enumerate(outputs))


def test_everything_has_a_docstring():
    for name in hyst.__all__:
        thing = getattr(hyst, name)
        assert thing.__doc__, name
        if isinstance(thing, type):
            for attribute, value in vars(thing).items():
                if not attribute.startswith("_"):
                    assert value.__doc__, f"{name}.{attribute}"
