"""Bouc-Wen: paper 3 eq. 18, paper 4 eq. 6 and 7, and the Bouc-Wen oscillator, by ``scipy.integrate.solve_ivp``."""

import numpy as np
from scipy.integrate import solve_ivp

TIGHT = dict(method="DOP853", rtol=1e-12, atol=1e-15)

# Paper 3, section 4.2.
PAPER_3 = dict(a=0.971, b=1.486, gamma=1.97e-7, d=1.910)


def along(u, slope):
    """Solves ``dh/du = slope(sign of du, h)`` along the input, from h = 0 at u = 0: sample by sample, so that the
    solver restarts at every reversal."""
    h, at, values = 0.0, 0.0, []
    for now in u:
        if now != at:
            s = np.sign(now - at)
            h = solve_ivp(lambda x, h: s * slope(s, h), (0.0, abs(now - at)), [h], **TIGHT).y[0, -1]
            at = now
        values.append(h)
    return np.array(values)


def paper_3(u, a, b, gamma, d):
    """Eq. 18: ``x = d u - h``, ``h' = a u' - b |u'| h - gamma u' |h|``."""
    return d * np.asarray(u) - along(u, lambda s, h: a - b * s * h - gamma * np.abs(h))


def paper_4(u, k0, alpha, beta, gamma, n):
    """Eq. 6, 7: ``z = k0 u + g``, ``g' = alpha u' - beta |u'| |g|^(n-1) g - gamma u' |g|^n``."""

    def slope(s, g):
        return alpha - beta * s * np.abs(g) ** (n - 1) * g - gamma * np.abs(g) ** n

    return k0 * np.asarray(u) + along(u, slope)


# Noel and Schoukens, the Bouc-Wen benchmark: kg, N s/m, N/m.
OSCILLATOR = dict(mass=2.0, damping=10.0, stiffness=5e4, alpha=5e4, beta=1e3, gamma=0.8, delta=-1.1, nu=1.0)


def oscillator(u, period, *, mass, damping, stiffness, alpha, beta, gamma, delta, nu):
    """``m y'' + c y' + k y + z = u``, ``z' = alpha y' - beta (gamma |y'| |z|^(nu-1) z + delta y' |z|^nu)``, from rest at
    u = 0; u is linear between samples."""

    def rates(t, x, u0, slope):
        y, v, z = x
        hysteresis = alpha * v - beta * (gamma * abs(v) * abs(z) ** (nu - 1) * z + delta * v * abs(z) ** nu)
        return [v, (u0 + slope * t - damping * v - stiffness * y - z) / mass, hysteresis]

    assert u[0] == 0.0
    x, y = np.zeros(3), [0.0]
    for before, now in zip(u, u[1:]):
        x = solve_ivp(rates, (0.0, period), x, args=(before, (now - before) / period), **TIGHT).y[:, -1]
        y.append(x[0])
    return np.array(y)
