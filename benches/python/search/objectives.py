"""The objectives as one writes them for numba, from the equations of the models: root mean square error over a record.

Each has the shape ``f(x, u, y, degc, starts) -> float`` for one candidate. ``batch`` makes of it one that evaluates rows of
candidates on all cores.
"""

import math

import numba
import numpy as np

PLAYS = 9
REFERENCE_DEGC = 23.0


# fastmath lets the compiler vectorise the sum over the plays: it is 1.4 times faster with it.
@numba.njit(fastmath=True, nogil=True)
def td_pi(x, u, y, degc, starts):
    alpha, epsilon, tau, eta, a0, a1, b0, b1 = x[0], x[1], x[2], x[3], x[4], x[5], x[6], x[7]
    r, w, play = np.empty(PLAYS + 1), np.empty(PLAYS + 1), np.empty(PLAYS + 1)
    for i in range(PLAYS + 1):
        r[i] = alpha * i
        w[i] = epsilon * math.exp(-tau * r[i])
    total = 0.0
    for s in range(len(starts) - 1):
        # The temperature is constant within a segment.
        factor = math.exp(eta * (degc[starts[s]] - REFERENCE_DEGC))
        play[:] = 0.0
        for k in range(starts[s], starts[s + 1]):
            left, right = a0 * u[k] + a1, b0 * u[k] + b1
            out = 0.0
            for i in range(PLAYS + 1):
                play[i] = max(left - r[i], min(right + r[i], play[i]))
                out += w[i] * play[i]
            error = factor * out - y[k]
            total += error * error
    return math.sqrt(total / len(u))


@numba.njit(nogil=True)
def _towards(alpha, rate, q, way):
    """q after a way with dq/dσ = α − rate q."""
    x = rate * way
    length = -math.expm1(-x) / rate if abs(x) > 1e-12 else way
    return q + (alpha - rate * q) * length


@numba.njit(nogil=True)
def bouc_wen(x, u, y, degc, starts):
    k0, alpha, beta, gamma = x[0], x[1], x[2], x[3]
    if abs(gamma) > beta:
        return math.inf
    total = 0.0
    for s in range(len(starts) - 1):
        before, g = 0.0, 0.0
        for k in range(starts[s], starts[s + 1]):
            way = abs(u[k] - before)
            sign = -1.0 if u[k] < before else 1.0
            before = u[k]
            q = sign * g
            # dq/dσ = α − β q − γ |q|: an exponential on either side of q = 0.
            rate = beta + gamma if q > 0.0 or (q == 0.0 and alpha >= 0.0) else beta - gamma
            if q * alpha < 0.0:
                to_zero = math.log1p(-rate * q / alpha) / rate if rate * way > 1e-12 else -q / alpha
                if way < to_zero:
                    q = _towards(alpha, rate, q, way)
                else:
                    q = _towards(alpha, 2.0 * beta - rate, 0.0, way - to_zero)
            else:
                q = _towards(alpha, rate, q, way)
            g = sign * q
            error = k0 * u[k] + g - y[k]
            total += error * error
    return math.sqrt(total / len(u))


def batch(one):
    """Rows of candidates on all cores."""

    @numba.njit(parallel=True)
    def many(points, u, y, degc, starts):
        costs = np.empty(len(points))
        for i in numba.prange(len(points)):
            costs[i] = one(points[i], u, y, degc, starts)
        return costs

    return many


class Spent(Exception):
    """All evaluations are spent."""


class Objective:
    """An objective over a record that counts its evaluations, keeps the lowest cost, and ends a search that goes on for too long."""

    def __init__(self, task):
        table = np.genfromtxt(task["record"], delimiter=",", names=True)
        segment = table["segment"]
        starts = np.flatnonzero(np.diff(segment)) + 1
        self.data = (
            np.ascontiguousarray(table["voltage_v"]),
            np.ascontiguousarray(table["displacement_um"]),
            np.ascontiguousarray(table["temperature_degc"]),
            np.concatenate([[0], starts, [len(table)]]),
        )
        self.lower, self.upper = np.array(task["lower"]), np.array(task["upper"])
        self.dimensions, self.evaluations, self.no_model = len(self.lower), task["evaluations"], task["no_model"]
        self.one = {"td-pi": td_pi, "bouc-wen": bouc_wen}[task["name"]]
        self.many = batch(self.one)
        # Compiled before any clock runs.
        middle = 0.5 * (self.lower + self.upper)
        self.one(middle, *self.data)
        self.many(middle[None], *self.data)
        self.again()

    def again(self):
        self.count, self.best = 0, math.inf

    def check(self, probes):
        """That this is the same function as in Rust: within 1e-9 at all probes."""
        for probe in probes:
            point = np.array(probe["point"])
            for cost in (self.one(point, *self.data), self.many(point[None], *self.data)[0]):
                if not abs(cost - probe["cost"]) <= 1e-9 * probe["cost"]:
                    raise SystemExit(f"the objectives differ at {point}: {cost} here, {probe['cost']} in Rust")

    def cost(self, x):
        """Of one candidate."""
        if self.count == self.evaluations:
            raise Spent
        self.count += 1
        cost = self.one(np.asarray(x, dtype=float), *self.data)
        if not cost < self.no_model:
            return self.no_model
        self.best = min(self.best, cost)
        return cost

    def costs(self, points):
        """Of candidates in rows."""
        points = np.ascontiguousarray(points[: self.evaluations - self.count])
        if len(points) == 0:
            raise Spent
        self.count += len(points)
        costs = self.many(points, *self.data)
        costs = np.where(costs < self.no_model, costs, self.no_model)
        self.best = min(self.best, costs.min())
        return costs
