"""Fractional-order models (paper 3, eq. 5-15) by Gruenwald-Letnikov sums over the whole past."""

import numpy as np

# Paper 3, sections 3.2 and 4.2.
IFM = dict(a=5.7342, b=6.8754, c=0.8885, alpha=0.6596, beta=0.9742, tau=0.0015, delta=1.7615)
LFDM = dict(a=6.573, b=1.459, c=0.198, alpha=0.176, beta=0.466)
K_OUT = 1.08  # N/um


def weights(order, n):
    """Eq. 13."""
    w = np.ones(n)
    for k in range(1, n):
        w[k] = (1 - (order + 1) / k) * w[k - 1]
    return w


def derivative(g, order, period, memory=None):
    """Eq. 12 for the deviation from ``g[0]``; truncated after ``memory`` samples."""
    n = len(g)
    w, g = weights(order, n), np.asarray(g) - g[0]
    cut = n if memory is None else memory + 1
    return np.array([w[: min(k + 1, cut)] @ g[k::-1][: min(k + 1, cut)] for k in range(n)]) / period**order


def equation(u, a, b, c, alpha, beta, period, memory=None):
    """Solves ``x + c D^beta x = a u + b D^alpha u`` (eq. 5, and eq. 15 for u_d), settled at ``u[0]``."""
    n = len(u)
    cut = n if memory is None else memory + 1
    right = a * (u - u[0]) + b * derivative(u, alpha, period, memory)
    w, scale = weights(beta, n), c / period**beta
    x = np.zeros(n)
    for k in range(1, n):
        past = x[k - 1 :: -1][: min(k, cut - 1)]
        x[k] = (right[k] - scale * (w[1 : len(past) + 1] @ past)) / (1 + scale)
    return a * u[0] + x


def lfdm(u, period, *, a, b, c, alpha, beta, memory=None):
    """Eq. 5, 6."""
    return equation(np.asarray(u), a, b, c, alpha, beta, period, memory)


def ifm(u, period, *, a, b, c, alpha, beta, tau, delta, memory=None):
    """Eq. 7-11, 15: ``x = h + delta u``, h driven by ``u(t - tau) - u(t)``, u constant before the first sample."""
    t = np.arange(len(u)) * period
    u_d = np.interp(t - tau, t, u, left=u[0]) - u
    return equation(u_d, a, b, c, alpha, beta, period, memory) + delta * np.asarray(u)


def lfdm_response(hz, *, a, b, c, alpha, beta):
    s = 2j * np.pi * np.asarray(hz)
    return (a + b * s**alpha) / (1 + c * s**beta)


def ifm_response(hz, *, a, b, c, alpha, beta, tau, delta):
    s = 2j * np.pi * np.asarray(hz)
    return delta + lfdm_response(hz, a=a, b=b, c=c, alpha=alpha, beta=beta) * (np.exp(-tau * s) - 1)


def external_force(x, free, k_out, kappa=1.0, chi=0.0):
    """Eq. 4, 16: ``f = k_out (x - (kappa x0 + chi))`` [N]."""
    return k_out * (x - (kappa * free + chi))
