"""PID and force observer: operators with two input signals."""

import hyst
import numpy as np
import pytest
from reference import fractional


def pid_reference(r, y, ff, *, kp, ki, kd, period, low, high, derivative_hz, b, c, anti_windup):
    """Astrom and Hagglund, Advanced PID Control, chapter 3: backward differences, back-calculation."""
    filter_time = 1 / (2 * np.pi * derivative_hz)
    integral, derivative, before, out = 0.0, 0.0, None, []
    for reference, measured, feedforward in zip(r, y, ff):
        now = c * reference - measured
        slope = 0.0 if before is None else (now - before) / period
        before = now
        # T_f d' + d = kd slope, backward Euler.
        derivative = (filter_time * derivative + period * kd * slope) / (filter_time + period)
        wanted = feedforward + kp * (b * reference - measured) + integral + derivative
        drive = np.clip(wanted, low, high)
        integral += period * ki * (reference - measured) + min(period / anti_windup, 1.0) * (drive - wanted)
        out.append(drive)
    return np.array(out)


def test_pid_agrees_with_its_reference():
    rng = np.random.default_rng(11)
    r, y, ff = 5 + rng.normal(size=(3, 400)).cumsum(axis=1) * 0.1
    gains = dict(kp=2.0, ki=300.0, kd=1e-3, period=1e-3, low=0.0, high=20.0, derivative_hz=80.0, b=0.7, c=0.3, anti_windup=0.02)
    pid = hyst.Pid(**gains)
    drive = np.array([pid.step(*row) for row in zip(r, y, ff)])
    expected = pid_reference(r, y, ff, **gains)
    assert np.max(np.abs(drive - expected)) < 1e-9 * 20
    assert 0 < np.count_nonzero((drive == 0) | (drive == 20)) < 400
    pid.reset()
    assert pid.step(r[0], y[0], ff[0]) == drive[0]


def test_pid_takes_over_and_reports_its_limit():
    pid = hyst.Pid(kp=2.0, ki=100.0, period=1e-3, low=0.0, high=100.0)
    pid.take_over(40.0, 4.0)
    assert pid.step(4.0, 4.0) == pytest.approx(40.0, abs=1e-12) and not pid.limited
    assert pid.step(1e3, 4.0) == 100.0 and pid.limited
    with pytest.raises(hyst.ParameterError, match="pid.high"):
        hyst.Pid(kp=1.0, ki=1.0, period=1e-3, low=1.0, high=0.0)


def test_force_observer_agrees_with_its_reference():
    rng = np.random.default_rng(7)
    x, free = rng.normal(size=50), rng.normal(size=50)
    observer = hyst.ForceObserver(k_out=fractional.K_OUT, kappa=0.98, chi=0.01)
    expected = fractional.external_force(x, free, fractional.K_OUT, 0.98, 0.01)
    assert np.allclose(observer.simulate(x, free), expected, rtol=1e-12)
    with pytest.raises(ValueError, match="50 samples"):
        observer.simulate(x, free[:-1])


def test_calibration_is_a_least_squares_fit():
    rng = np.random.default_rng(8)
    free = rng.normal(size=200) + 1e4
    x = 1.02 * free - 3.0 + 0.01 * rng.normal(size=200)
    observer = hyst.ForceObserver.calibrated(x, free, k_out=1.08)
    kappa, chi = np.polyfit(free - 1e4, x, 1)
    assert observer.kappa == pytest.approx(kappa, rel=1e-9)
    assert observer.kappa * 1e4 + observer.chi == pytest.approx(chi, rel=1e-12)
    with pytest.raises(ValueError, match="does not move"):
        hyst.ForceObserver.calibrated(x, np.ones(200), k_out=1.08)
