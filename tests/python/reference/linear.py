"""Linear stages, by ``scipy.signal.lsim`` with a first-order hold, and the electromechanical model (paper 5, eq. 1-8)."""

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.signal import StateSpace, lsim

from .plays import plays, stops


def settled(a, b, c, d, u, period):
    """Response of ``x' = a x + b u, y = c x + d u`` to ``u``, linear between samples, settled at ``u[0]``."""
    a, b = np.atleast_2d(a), np.reshape(b, (-1, 1))
    rest = -np.linalg.solve(a, b)[:, 0] * u[0]
    t = np.arange(len(u)) * period
    return lsim(StateSpace(a, b, np.reshape(c, (1, -1)), [[d]]), u, t, X0=rest, interp=True)[1]


def delay(u, seconds, period):
    t = np.arange(len(u)) * period
    return np.interp(t - seconds, t, u, left=u[0])


def lag(u, seconds, period):
    return settled([[-1 / seconds]], [1 / seconds], [1.0], 0.0, u, period)


def rate(u, volts, exponent, reference_rate, period):
    over = volts * (np.abs(np.diff(u, prepend=u[0])) / (reference_rate * period)) ** exponent
    out = np.empty_like(u)
    last = u[0]
    for k in range(len(u)):
        last = max(u[k] - over[k], min(u[k] + over[k], last))
        out[k] = last
    return out


def relaxing_rate(u, volts, exponent, reference_rate, period):
    """Solves each implicit step by bracketing its root."""
    out = np.empty_like(u)
    out[0] = last = u[0]
    for k in range(1, len(u)):
        sign, d = np.sign(u[k] - last), abs(u[k] - last)
        last += sign * brentq(lambda x, d=d: x + volts * (x / (reference_rate * period)) ** exponent - d, 0.0, d, xtol=1e-14)
        out[k] = last
    return out


def creep(u, seconds, shares, period):
    tau = np.asarray(seconds, dtype=float)
    return settled(np.diag(-1 / tau), 1 / tau, shares, 1.0, u, period)


def resonance(u, hz, damping, gain, period):
    w = 2 * np.pi * hz
    return settled([[0.0, 1.0], [-w * w, -2 * damping * w]], [0.0, w * w], [gain, 0.0], 1 - gain, u, period)


# Paper 5, section 5.1, in SI units.
TD_EM = dict(capacitance=48.65e-6, resistance=21.6879, mass=0.0026442, stiffness=6.62107e4, damping=0.9453015)
TD_EM_WIDTHS = np.array([7.9475, 15.8950, 23.8425, 31.7900, 39.7375, 47.6850, 55.6325, 63.5800, 71.5275, 79.4749])
TD_EM_SLOPES = np.array([0.3346, 0.0798, 0.0042, 0.00632, 0.0354, 0.0256, 0.0245, 0.0387, 0.0622, 0.0346])
TD_EM_PSI = (3.477e-7, -1.466e-5, 8.83e-4)


def coupling(temperature, coefficients=TD_EM_PSI):
    """Paper 5, section 5.1: psi(T), a parabola in degrees Celsius."""
    return np.polyval(coefficients, temperature)


def td_em(
    u, temperature, period, widths, slopes, *, capacitance, resistance, mass, stiffness, damping, psi=coupling, stop=False
):
    """Paper 5, eq. 1-7, in metres: bank -> current -> C parallel R with the coupled mass, spring and damper.

    A bank element is a backlash of total width ``widths[i]`` (a play of half of it) and slope ``slopes[i]``; with ``stop``
    an elasto-slip element with that yield. The current is linear between samples. psi(T) holds over the step that ends at
    its sample.
    """
    bank = stops(u, widths) if stop else plays(u, np.asarray(widths) / 2)
    current = bank @ np.asarray(slopes, dtype=float)
    temperature = np.broadcast_to(temperature, np.shape(u))

    def system(t):
        p = psi(t)
        a = np.array(
            [
                [-1 / (resistance * capacitance), 0.0, -p / capacitance],
                [0.0, 0.0, 1.0],
                [p / mass, -stiffness / mass, -damping / mass],
            ]
        )
        return a, np.array([1 / capacitance, 0.0, 0.0])

    def transition(t):
        # Input and its slope are states: the exponential includes the first-order hold.
        a, b = system(t)
        m = np.zeros((5, 5))
        m[:3, :3], m[:3, 3], m[3, 4] = a, b, 1.0
        return expm(m * period)

    transitions = {t: transition(t) for t in np.unique(temperature)}
    a, b = system(temperature[0])
    x = -np.linalg.solve(a, b) * current[0]
    y = np.empty(len(u))
    y[0] = x[1]
    for k in range(1, len(u)):
        z = np.concatenate([x, [current[k - 1], (current[k] - current[k - 1]) / period]])
        x = (transitions[temperature[k]] @ z)[:3]
        y[k] = x[1]
    return y
