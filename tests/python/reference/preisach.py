"""Preisach: relays one by one, signed sums of Everett values (paper 2), the dynamic model (paper 1)."""

import numpy as np
from scipy.interpolate import RegularGridInterpolator


def triangle(flat):
    """Returns a list in the order of ``numpy.tril_indices`` as a square matrix."""
    cells = int((np.sqrt(8 * len(flat) + 1) - 1) / 2)
    square = np.zeros((cells, cells))
    square[np.tril_indices(cells)] = flat
    return square


class Relays:
    """A square lattice of relays, ``refine`` to a side in each cell of constant density.

    Exact for inputs on the lattice ``low + k step``. Cells on the diagonal are reversible: linear in the input. ``once``
    are relays that switch up in an interval and never down again.
    """

    def __init__(self, low, high, density, once=None, refine=8, rest=None):
        self.density = triangle(density)
        self.cells = len(self.density)
        self.once = np.zeros(self.cells) if once is None else np.asarray(once, dtype=float)
        self.low, self.refine = low, refine
        self.step = (high - low) / (self.cells * refine)
        self.rest = low if rest is None else rest
        relay = np.kron(self.density - np.diag(np.diag(self.density)), np.ones((refine, refine))) / refine**2
        self.alpha, self.beta = np.nonzero(np.tril(np.ones_like(relay)))
        self.weight = relay[self.alpha, self.beta]

    def index(self, u):
        k = (np.asarray(u) - self.low) / self.step
        assert np.allclose(k, np.round(k), atol=1e-9), "inputs must be on the lattice"
        return np.round(k).astype(int)

    def _reversible(self, m):
        return float(np.sum(np.diag(self.density) * np.clip((m - np.arange(self.cells) * self.refine) / self.refine, 0, 1)))

    def _once(self, highest):
        return float(np.sum(self.once * np.clip((highest - np.arange(self.cells) * self.refine) / self.refine, 0, 1)))

    def simulate(self, u):
        rest = int(self.index(self.rest))
        # At rest, a relay whose interval contains the input is up if its centre is below the input; on the line, half of
        # the relays are.
        centre = self.alpha + self.beta + 1 - 2 * rest
        up = np.where(self.alpha < rest, 1.0, np.where(self.beta >= rest, 0.0, np.where(centre < 0, 1.0, (centre == 0) / 2)))
        offset = up @ self.weight + self._reversible(rest) + self._once(rest)
        highest, y = rest, []
        for m in self.index(u):
            up[self.alpha < m] = 1.0
            up[self.beta >= m] = 0.0
            highest = max(highest, m)
            y.append(up @ self.weight + self._reversible(m) + self._once(highest) - offset)
        return np.array(y)


def dominating(u):
    """Returns the indices of the dominating extrema of an input that starts at the bottom of its range, by brute force:
    the largest value so far, the smallest after it, the largest after that ... and the last sample."""
    places, start, sign = [], 0, 1
    while True:
        rest = sign * np.asarray(u[start:])
        k = start + len(rest) - 1 - int(np.argmax(rest[::-1]))
        places.append(k)
        if k == len(u) - 1:
            return places
        start, sign = k + 1, -sign


def everett_of_relays(relays):
    """``E(alpha, beta)``: the output gained from beta up to alpha, as the double integral over its triangle."""

    def value(alpha, beta):
        a, b = int(relays.index(alpha)), int(relays.index(beta))
        inside = (relays.alpha < a) & (relays.beta >= b)
        return relays.weight[inside].sum() + relays._reversible(a) - relays._reversible(b)

    return value


def everett_sum(u, low, everett):
    """Paper 2, section 3.1: the output as a signed sum of Everett values of the dominating extrema, virgin at ``low``."""
    y = []
    for k in range(len(u)):
        levels = [low, *(u[i] for i in dominating(u[: k + 1]))]
        signs = [np.sign(b - a) for a, b in zip(levels, levels[1:])]
        y.append(sum(s * everett(max(a, b), min(a, b)) for s, a, b in zip(signs, levels, levels[1:])))
    return np.array(y)


# Paper 1, section III: the grid of the mirror function, D in V/ms and P in V.
DPM_RATES = np.arange(2.0, 17.0, 2.0)
DPM_CHANGES = np.arange(-80.0, 81.0, 20.0)


def mirror(rates, changes, nodes):
    """Paper 1, eq. 20: bilinear in the cells; 1 at D = 0, clamped beyond the other edges. ``nodes[i, j]`` is at
    ``(rates[i], changes[j])``."""
    rates, nodes = np.concatenate([[0.0], rates]), np.vstack([np.ones(len(changes)), nodes])
    inside = RegularGridInterpolator((rates, changes), nodes)
    return lambda d, p: float(inside((np.clip(d, rates[0], rates[-1]), np.clip(p, changes[0], changes[-1])))[()])


def dpm(u, classical, xi, period, clock=False):
    """Paper 1, eq. 6 and 7: one term, weighted by the mirror function, for each dominating extremum.

    ``classical`` is the output of the classical model on the same samples; the mirror function weighs its change on every
    branch between dominating extrema. ``xi(D, P)`` takes V/s and V. The input starts settled at the bottom of its range.

    D is the change divided by a time. With ``clock`` it is the time from one extremum to the next (eq. 3, 4). Otherwise it
    is the time that the input spent on the branch, as in the package: without closed loops, and including the sample in
    which the branch was left.
    """
    histories = [[0, *(i for i in dominating(u[: k + 1]) if i > 0)] for k in range(len(u))]
    # Number of samples of the branch that starts at sample a.
    spent = np.zeros(len(u), dtype=int)
    y = []
    for k, places in enumerate(histories):
        if k > 0:
            spent[places[-2]] += 1
        f = classical[0]
        for a, b in zip(places, places[1:]):
            p, samples = u[b] - u[a], b - a if clock else spent[a] + (b != k)
            f += xi(abs(p) / (samples * period), p) * (classical[b] - classical[a])
        y.append(f)
    return np.array(y)


def dpm_recursive(u, classical, xi, period, clock=False):
    """Paper 1, eq. 17: from the last reversal of the input, dominating or not. ``clock`` as in ``dpm``."""
    y, base, turn, direction = [classical[0]], classical[0], 0, 0

    def after(k, samples):
        p = u[k] - u[turn]
        return base + xi(abs(p) / (samples * period), p) * (classical[k] - classical[turn])

    for k in range(1, len(u)):
        now = int(np.sign(u[k] - u[k - 1]))
        if now * direction < 0:
            base = after(k - 1, k - 1 - turn + (not clock))
            turn = k - 1
        direction = now or direction
        y.append(after(k, k - turn))
    return np.array(y)


def inverse_surface(f, top, below):
    """Paper 2, eq. 5 (without the factor 1/2 of eq. 2): the input as a signed sum of inverse Everett values of the
    dominating extrema of the output ``f``, virgin at 0. ``top(f_alpha)`` is the input of a first ascent to ``f_alpha``,
    and ``below(alpha, drop)`` the input at which the descent from there has fallen by ``drop``.

    It is exact only on first-order curves: the inverse of a Preisach operator is not congruent.
    """

    def value(high, low):
        alpha = top(high)
        return alpha - below(alpha, high - low)

    u = []
    for k in range(len(f)):
        levels = [0.0, *(f[i] for i in dominating(f[: k + 1]))]
        signs = [np.sign(b - a) for a, b in zip(levels, levels[1:])]
        u.append(sum(s * value(max(a, b), min(a, b)) for s, a, b in zip(signs, levels, levels[1:])))
    return np.array(u)
