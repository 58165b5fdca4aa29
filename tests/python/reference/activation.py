"""Activation-function models (paper 4, eq. 2): ``z = k0 u + alpha u' + beta f(gamma u)``."""

import numpy as np
from scipy.special import expit

FUNCTIONS = {
    "Atan": np.arctan,
    "Sigmoid": expit,
    "Softplus": lambda x: np.logaddexp(0.0, x),
    "Softsign": lambda x: x / (1 + np.abs(x)),
    "Tanh": np.tanh,
}

# Paper 4, tables 2-6, 0-40-0 V at 10 Hz; beta of softsign for softsign(gamma u), see the notes on table 5.
PRINTED = {
    "Atan": dict(k0=0.1516, alpha=-0.00017, beta=0.1996, gamma=1000.0),
    "Sigmoid": dict(k0=0.1516, alpha=-0.00017, beta=0.3131, gamma=1000.0),
    "Softplus": dict(k0=0.1411, alpha=-0.00017, beta=0.4503, gamma=0.0342),
    "Softsign": dict(k0=0.1516, alpha=-0.00017, beta=100 / 318.2799, gamma=318.2799),
    "Tanh": dict(k0=0.1517, alpha=-0.00017, beta=0.3121, gamma=113971.0),
}


def activation(name, u, period, *, k0, alpha, beta, gamma):
    u = np.asarray(u)
    rate = np.diff(u, prepend=u[0]) / period
    return k0 * u + alpha * rate + beta * FUNCTIONS[name](gamma * u)
