"""Objectives for numba from the equations of the models: RMSE over a record.

Each is a function ``f(x, u, y, degc, starts) -> float`` of one candidate. ``batch`` returns a function that evaluates
rows of candidates on all cores.
"""

import math

import numba
import numpy as np

PLAYS = 9
REFERENCE_DEGC = 23.0


# With fastmath the compiler vectorises the sum over the play operators: 1.4 times as fast.
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
def _advance(alpha, rate, q, distance):
    """Returns q after a distance with dq/dσ = α − rate q."""
    x = rate * distance
    length = -math.expm1(-x) / rate if abs(x) > 1e-12 else distance
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
            distance = abs(u[k] - before)
            sign = -1.0 if u[k] < before else 1.0
            before = u[k]
            q = sign * g
            # dq/dσ = α − β q − γ |q|: an exponential on either side of q = 0.
            rate = beta + gamma if q > 0.0 or (q == 0.0 and alpha >= 0.0) else beta - gamma
            if q * alpha < 0.0:
                to_zero = math.log1p(-rate * q / alpha) / rate if rate * distance > 1e-12 else -q / alpha
                if distance < to_zero:
                    q = _advance(alpha, rate, q, distance)
                else:
                    q = _advance(alpha, 2.0 * beta - rate, 0.0, distance - to_zero)
            else:
                q = _advance(alpha, rate, q, distance)
            g = sign * q
            error = k0 * u[k] + g - y[k]
            total += error * error
    return math.sqrt(total / len(u))


def batch(one):
    """Returns a function that evaluates rows of candidates on all cores."""

    @numba.njit(parallel=True)
    def many(points, u, y, degc, starts):
        costs = np.empty(len(points))
        for i in numba.prange(len(points)):
            costs[i] = one(points[i], u, y, degc, starts)
        return costs

    return many


class BudgetSpent(Exception):
    """All evaluations are used."""


class Objective:
    """An objective over a record. It counts evaluations, stores the minimum cost, and ends a search at its budget."""

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
        # Compile before the measurement.
        middle = 0.5 * (self.lower + self.upper)
        self.one(middle, *self.data)
        self.many(middle[None], *self.data)
        self.reset()

    def reset(self):
        """Resets the number of evaluations and the minimum cost."""
        self.count, self.best = 0, math.inf

    def check(self, probes):
        """Checks that the objective agrees with that in Rust to 1e-9 at all probes."""
        for probe in probes:
            point = np.array(probe["point"])
            for cost in (self.one(point, *self.data), self.many(point[None], *self.data)[0]):
                if not abs(cost - probe["cost"]) <= 1e-9 * probe["cost"]:
                    raise SystemExit(f"the objectives differ at {point}: {cost} here, {probe['cost']} in Rust")

    def cost(self, x):
        """Returns the cost of one candidate."""
        if self.count == self.evaluations:
            raise BudgetSpent
        self.count += 1
        cost = self.one(np.asarray(x, dtype=float), *self.data)
        if not cost < self.no_model:
            return self.no_model
        self.best = min(self.best, cost)
        return cost

    def costs(self, points):
        """Returns the costs of candidates in rows."""
        points = np.ascontiguousarray(points[: self.evaluations - self.count])
        if len(points) == 0:
            raise BudgetSpent
        self.count += len(points)
        costs = self.many(points, *self.data)
        costs = np.where(costs < self.no_model, costs, self.no_model)
        self.best = min(self.best, costs.min())
        return costs
