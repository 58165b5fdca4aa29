"""Twelfth examination: 72 simulated piezo actuators of 29 hysteresis laws, each with a twin; run `python -B twelfth.py DIR [id-prefix ...]`.

Needs numpy and numba. A law maps a drive u, which fills -1 to 1 in the training record, to an output that is scaled to -1 to 1. Effects
act before the law (on u) or behind it (on the scaled output). The twin has the same actuator, drive and noise, and no effect.
The table on stderr says for each effect: its share in noise floors behind a fitted gain and offset, and (in brackets) behind a
fitted sum of plays as well, in the training record; the share in the test record; both when only this effect is taken away.
"""
import functools
import json
import os
import sys
from types import SimpleNamespace

import numpy as np
from numba import njit

# ---------------------------------------------------------------- hysteresis laws


@njit
def plays(u, r, w, wide):
    """Returns the weighted sum of plays, at rest in the first sample; `wide` multiplies the thresholds."""
    y, p = np.empty(len(u)), np.full(len(r), u[0])
    for n in range(len(u)):
        total = 0.0
        for i in range(len(r)):
            p[i] = max(u[n] - r[i] * wide[n], min(u[n] + r[i] * wide[n], p[i]))
            total += w[i] * p[i]
        y[n] = total
    return y


@njit
def interpolate(table, limit, a, b):
    """Returns a square table over -limit to limit at (a, b)."""
    scale = (len(table) - 1) / (2 * limit)
    x, z = (a + limit) * scale, (b + limit) * scale
    i, j = min(int(x), len(table) - 2), min(int(z), len(table) - 2)
    x, z = x - i, z - j
    return (table[i, j] * (1 - x) + table[i + 1, j] * x) * (1 - z) + (table[i, j + 1] * (1 - x) + table[i + 1, j + 1] * x) * z


LIMIT = 1.2


@njit
def everett(u, table, limit):
    """Returns the Preisach output from an Everett table with a stack of extremes, from negative saturation."""
    y, high, low, base = np.empty(len(u)), np.empty(len(u) + 2), np.empty(len(u) + 2), np.zeros(len(u) + 2)
    low[0], n, rising, last = -limit, 0, True, -limit
    for k in range(len(u)):
        now = max(-limit, min(limit, u[k]))
        if now > last and not rising:
            low[n] = last
            base[n] = base[n - 1] + interpolate(table, limit, high[n], low[n - 1]) - interpolate(table, limit, high[n], last)
            rising = True
        if now < last and rising:
            n, rising = n + 1, False
            high[n] = last
        if rising:
            while n > 0 and now >= high[n]:
                n -= 1
            y[k] = base[n] + interpolate(table, limit, now, low[n])
        else:
            while n > 1 and now <= low[n - 1]:
                n -= 1
            y[k] = base[n - 1] + interpolate(table, limit, high[n], low[n - 1]) - interpolate(table, limit, high[n], now)
        last = now
    return y


@njit
def kernels(u, up, down, slope, w):
    """Returns the Krasnosel'skii-Pokrovskii sum: ridges of finite slope instead of relays."""
    y, s = np.empty(len(u)), np.full(len(up), -1.0)
    for n in range(len(u)):
        total = 0.0
        for i in range(len(up)):
            rise = max(-1.0, min(1.0, 2 * (u[n] - up[i]) / slope - 1))
            fall = max(-1.0, min(1.0, 2 * (u[n] - down[i]) / slope + 1))
            s[i] = min(max(s[i], rise), fall)
            total += w[i] * s[i]
        y[n] = total
    return y


@njit
def domains(u, coercive, bias, wide):
    """Returns the mean of units that switch at bias +- coercive field; `wide` multiplies the coercive fields."""
    y, s = np.empty(len(u)), np.full(len(bias), -1.0)
    for n in range(len(u)):
        for i in range(len(s)):
            if u[n] > bias[i] + coercive[i] * wide[n]:
                s[i] = 1
            elif u[n] < bias[i] - coercive[i] * wide[n]:
                s[i] = -1
        y[n] = s.mean()
    return y


@njit
def slip(u, k, f, stiffness):
    """Returns the charge q of generalised Maxwell slip: u = stiffness q + sum of elasto-slide elements, solved by Newton steps."""
    y, s, q = np.empty(len(u)), np.zeros(len(k)), u[0] / stiffness
    for n in range(len(u)):
        new = q
        for _ in range(12):
            force, slope = stiffness * new, stiffness
            for i in range(len(k)):
                trial = s[i] + k[i] * (new - q)
                force += max(-f[i], min(f[i], trial))
                slope += k[i] if abs(trial) < f[i] else 0.0
            new += (u[n] - force) / slope
        for i in range(len(k)):
            s[i] = max(-f[i], min(f[i], s[i] + k[i] * (new - q)))
        q = new
        y[n] = q
    return y


@njit
def duhem(u, f, g, up, down):
    """Returns y of dy = rate |du| (f(u) - y) + g(u) du with the rate `up` where the drive rises and `down` where it falls."""
    y = np.empty(len(u))
    y[0] = f[0]
    for n in range(1, len(u)):
        d = u[n] - u[n - 1]
        y[n] = y[n - 1] + g[n] * d + (f[n] - y[n - 1]) * (1 - np.exp(-(up if d > 0 else down) * abs(d)))
    return y


@njit
def friction(u, kind, p, wide):
    """Returns z of 0 Bouc-Wen (beta, gamma, n), 1 Dahl (limit, exponent), 2 elasto-plastic LuGre (limit, breakaway)."""
    y, z = np.zeros(len(u)), 0.0
    for n in range(1, len(u)):
        d = (u[n] - u[n - 1]) / 8
        for _ in range(8):
            if kind == 0:
                z += d - p[0] * abs(d) * abs(z) ** (p[2] - 1) * z - p[1] * d * abs(z) ** p[2]
            elif kind == 1:
                z += d * max(0.0, 1 - np.sign(d) * z / p[0]) ** p[1]
            else:
                limit = p[0] * wide[n]
                share = max(0.0, min(1.0, (abs(z) - p[1] * limit) / ((1 - p[1]) * limit))) if d * z > 0 else 0.0
                z += d * (1 - share * share * (3 - 2 * share) * abs(z) / limit)
        y[n] = z
    return y


@njit
def jiles(u, a, k, alpha, c):
    """Returns the Jiles-Atherton magnetisation, as polarisation."""
    y, m = np.zeros(len(u)), 0.0
    for n in range(1, len(u)):
        d = (u[n] - u[n - 1]) / 4
        for j in range(4):
            x = (u[n - 1] + j * d + alpha * m) / a
            man = x / 3 if abs(x) < 1e-3 else 1 / np.tanh(x) - 1 / x
            slope = (1 / 3 if abs(x) < 1e-2 else 1 / x**2 - 1 / np.sinh(x) ** 2) / a
            sign = 1.0 if d > 0 else -1.0
            gap = man - m
            irreversible = gap / (k * sign - alpha * gap) if gap * sign > 0 else 0.0
            m += d * ((1 - c) * irreversible + c * slope) / (1 - alpha * c * slope)
        y[n] = m
    return y


@njit
def takacs(u, sharp, half, reach):
    """Returns hyperbolic-tangent branches; after a reversal the distance to the new branch decays with the way."""
    y, sign, gap, start = np.zeros(len(u)), 1.0, 0.0, u[0]
    for n in range(1, len(u)):
        d = u[n] - u[n - 1]
        if d * sign < 0:
            sign, start = -sign, u[n - 1]
            gap = y[n - 1] - np.tanh(sharp * (start - sign * half))
        y[n] = np.tanh(sharp * (u[n] - sign * half)) + gap * np.exp(-abs(u[n] - start) / reach)
    return y


@njit
def product(u, p, c, limit):
    """Returns a tensor-product map of hat functions of the drive and of an internal state."""
    return np.array([interpolate(c, limit, max(-limit, min(limit, u[n])), max(-limit, min(limit, p[n]))) for n in range(len(u))])


@functools.lru_cache(maxsize=None)
def density_table(name):
    """Returns the Everett table of a named Preisach density, scaled to 2 over the full drive."""
    edge = np.linspace(-LIMIT, LIMIT, 481)
    mid = (edge[1:] + edge[:-1]) / 2
    a, b = np.meshgrid(mid, mid, indexing="ij")
    c, m = (a - b) / 2, (a + b) / 2
    c = np.maximum(c, 1e-9)
    mu = dict(
        gauss=lambda: np.exp(-(((c - 0.2) / 0.2) ** 2) / 2 - ((m / 0.45) ** 2) / 2),
        lorentz=lambda: 1 / (1 + ((c - 0.12) / 0.18) ** 2) / (1 + (m / 0.5) ** 2),
        lognormal=lambda: np.exp(-(np.log(c / 0.22) ** 2) / 0.7 - ((m / 0.55) ** 2) / 2) / c,
        skewed=lambda: np.exp(-c / 0.25 - (((m - 0.25 + 0.4 * c) / 0.5) ** 2) / 2),
        bimodal=lambda: np.exp(-(((c - 0.1) / 0.08) ** 2) / 2 - (m / 0.6) ** 2) + 0.5 * np.exp(-(((c - 0.42) / 0.12) ** 2) / 2 - (m / 0.35) ** 2),
    )[name]() * np.where(a > b, 1, np.where(a == b, 0.5, 0))
    table = np.zeros((481, 481))
    table[1:, :-1] = np.cumsum(np.cumsum(mu[:, ::-1], 1)[:, ::-1], 0)
    return table * 2 / everett_at(table, 1, -1)


@functools.lru_cache(maxsize=None)
def masing_table(name):
    """Returns the Everett table of a law whose branches depend on the distance from the reversal only."""
    x = np.linspace(-LIMIT, LIMIT, 481)
    d = np.abs(x[:, None] - x[None, :])
    table = dict(rayleigh=d**2, power=d**1.55, exponential=d - 0.6 * (1 - np.exp(-d / 0.6)), osgood=d**3 / (1 + d**2))[name]
    return table * 2 / everett_at(table, 1, -1)


def everett_at(table, a, b):
    """Returns one value of an Everett table."""
    return interpolate(table, LIMIT, float(a), float(b))


def preisach(name, share):
    """Returns a Preisach law of a density with a reversible rest."""
    return lambda u, k: (1 - share) * u + share * everett(u, density_table(name), LIMIT)


def masing(name, share):
    """Returns a law of congruent branches with a reversible rest."""
    return lambda u, k: (1 - share) * u + share * everett(u, masing_table(name), LIMIT)


def prandtl(r, w, linear):
    """Returns a Prandtl-Ishlinskii law; the plays together have the weight 1."""
    r = np.asarray(r, float)
    w = np.asarray(w, float)
    return lambda u, k: linear * u + plays(u, r, w / w.sum(), k.wide)


def bouc(share, *p):
    """Returns displacement = drive - share of the Bouc-Wen state, scaled by its limit."""
    limit = (1 / (p[0] + p[1])) ** (1 / p[2])
    return lambda u, k: u - share * friction(u, 0, np.array(p), k.wide) / limit


def generalised(u, k):
    """Generalised Prandtl-Ishlinskii: plays of an odd bent drive, and the bent drive itself."""
    bent = np.tanh(1.1 * u) / np.tanh(1.1)
    r = np.linspace(0.03, 0.75, 20)
    return 0.7 * bent + plays(bent, r, 0.1 * np.exp(-r / 0.35), k.wide)


def backlash(u, k):
    """A gear with backlash that drives a sliding joint."""
    q = plays(u, np.array([0.05]), np.array([1.0]), k.wide)
    return q - 0.42 * friction(q, 1, np.array([0.28, 1.0]), k.wide)


def tensor(u, k):
    """A tensor-product map on a 9 x 9 grid of the drive and of a play, odd about the middle."""
    p = plays(u, np.array([0.3]), np.array([1.0]), k.wide)
    x = np.linspace(-LIMIT, LIMIT, 9)
    rough = np.random.default_rng(3).normal(0, 0.012, (9, 9))
    c = 0.65 * np.tanh(1.2 * x)[:, None] + 0.4 * x[None, :] * (1 - 0.15 * x[:, None] ** 2) + rough - rough[::-1, ::-1]
    return product(u, p, c, LIMIT)


def neural(u, k):
    """A small odd network of the drive and four plays."""
    rng = np.random.default_rng(8)
    x = np.array([u] + [plays(u, np.array([r]), np.array([1.0]), k.wide) for r in (0.06, 0.15, 0.3, 0.5)])
    return 0.6 * u + np.abs(rng.normal(0, 0.2, 7)) @ np.tanh(np.abs(rng.normal(0, 0.55, (7, 5))) @ x)


def switching(u, k):
    """1500 domains with lognormal coercive and normal bias fields, and a reversible rest."""
    rng = np.random.default_rng(5)
    return 0.65 * u + 0.5 * domains(u, 0.28 * np.exp(rng.normal(0, 0.5, 1500)), rng.normal(0, 0.4, 1500), k.wide)


def pokrovskii(u, k):
    """Krasnosel'skii-Pokrovskii kernels on a 13 x 13 half plane."""
    x = np.linspace(-1.1, 0.95, 13)
    up, down = (v[np.tril_indices(13)] for v in np.meshgrid(x, x, indexing="ij"))
    w = np.exp(-(up - down) / 0.5 - (((up + down) / 2 + 0.02) / 0.7) ** 2)
    return 0.4 * u + kernels(u, up, down, 0.3, w / w.sum())


R = np.linspace(0.02, 0.9, 30)
LAWS = {
    "preisach-gauss": preisach("gauss", 0.55),
    "preisach-lorentz": preisach("lorentz", 0.6),
    "preisach-lognormal": preisach("lognormal", 0.5),
    "preisach-skewed": preisach("skewed", 0.5),
    "preisach-bimodal": preisach("bimodal", 0.55),
    "rayleigh": masing("rayleigh", 0.45),
    "masing-power": masing("power", 0.75),
    "masing-exponential": masing("exponential", 0.7),
    "masing-osgood": masing("osgood", 0.65),
    "pi-exponential": prandtl(R, np.exp(-R / 0.35), 0.4),
    "pi-lognormal": prandtl(R, np.exp(-(np.log(R / 0.25) ** 2) / 0.5) / R, 0.6),
    "pi-power": prandtl(R, R**-0.6, 0.7),
    "pi-five": prandtl([0.05, 0.14, 0.29, 0.47, 0.72], [0.3, 0.25, 0.2, 0.15, 0.1], 0.4),
    "generalised-pi": generalised,
    "maxwell-slip": lambda u, k: slip(u, np.geomspace(0.6, 0.1, 9), np.linspace(0.012, 0.08, 9), 1.0),
    "bouc-wen-1": bouc(0.16, 3.0, 1.0, 1.0),
    "bouc-wen-1.5": bouc(0.18, 5.0, 2.0, 1.5),
    "bouc-wen-2": bouc(0.15, 9.0, 3.0, 2.0),
    "duhem": lambda u, k: duhem(u, 1.1 * np.tanh(1.3 * u), 0.65 / np.cosh(0.7 * u) ** 2, 1.9 * (1 + k.sided), 1.9 * (1 - k.sided)),
    "coleman-hodgdon": lambda u, k: duhem(u, u, np.full(len(u), 0.6), 2.2 * (1 + k.sided), 2.2 * (1 - k.sided)),
    "jiles-atherton": lambda u, k: 0.45 * u + jiles(u, 0.3, 0.22, 0.06, 0.15),
    "dahl": lambda u, k: u - 0.3 * friction(u, 1, np.array([0.38, 1.6]), k.wide),
    "lugre": lambda u, k: u - 0.6 * friction(u, 2, np.array([0.24, 0.35]), k.wide),
    "backlash-friction": backlash,
    "tensor-product": tensor,
    "neural": neural,
    "domain-switching": switching,
    "krasnoselskii-pokrovskii": pokrovskii,
    "takacs": lambda u, k: 0.6 * u + 0.5 * takacs(u, 1.5, 0.22, 0.35),
}

# ---------------------------------------------------------------- experiments: s from lo (0 or -1) to 1 over the relative time x


def wave(phase, lo):
    """A sine that starts at 0; one-sided if lo is 0."""
    return (1 - np.cos(phase)) / 2 if lo == 0 else np.sin(phase)


def edge(x, share=0.03):
    """A window that starts and ends at 0."""
    return np.clip(np.minimum(x, 1 - x) / share, 0, 1) ** 2 * (3 - 2 * np.clip(np.minimum(x, 1 - x) / share, 0, 1))


def fill(s, lo):
    """Scales a signal to lo ... 1."""
    return lo + (s - s.min()) / np.ptp(s) * (1 - lo)


def sine(n):
    return lambda x, lo, rng: wave(2 * np.pi * n * x, lo)


def tri(n):
    return lambda x, lo, rng: 1 - np.abs(2 * ((n * x) % 1) - 1) if lo == 0 else 2 / np.pi * np.arcsin(np.sin(2 * np.pi * n * x))


def grow(n, power=1.0):
    return lambda x, lo, rng: x**power * wave(2 * np.pi * n * x, lo)


def decay(n, power=1.0):
    return lambda x, lo, rng: (1 - x) ** power * wave(2 * np.pi * n * x, lo)


def chirp(n0, n1):
    """From n0 to n1 cycles per record, logarithmically."""
    rate = np.log(n1 / n0)
    return lambda x, lo, rng: wave(2 * np.pi * n0 / rate * (np.exp(rate * x) - 1), lo) * edge(np.maximum(x, 0.5))


def multisine(n0, n1, count):
    def make(x, lo, rng):
        s = sum(rng.uniform(0.6, 1) * np.sin(2 * np.pi * (f * x + rng.uniform())) for f in np.geomspace(n0, n1, count) * rng.uniform(0.95, 1.05, count))
        return fill(s, lo) * edge(x)
    return make


def walk(n):
    """A reflected random walk of n smooth moves."""
    def make(x, lo, rng):
        knots = np.abs((np.cumsum(rng.normal(0, 0.55, n + 1)) + 1) % 4 - 2)
        i = np.minimum((x * n).astype(int), n - 1)
        f = x * n - i
        return fill(knots[i] + (knots[i + 1] - knots[i]) * f * f * (3 - 2 * f), lo) * edge(x)
    return make


def path(levels):
    """Straight moves of one speed through levels."""
    way = np.concatenate([[0], np.cumsum(np.abs(np.diff(levels)) + 1e-9)])
    return lambda x, lo, rng: np.interp(x, way / way[-1], levels)


def minor(n, depth):
    """A major loop with n minor loops on each branch."""
    def make(x, lo, rng):
        levels = [0.0]
        for a, b in [(0, 1), (1, lo), (lo, 1), (1, 0)]:
            for p in np.linspace(a, b, n + 2)[1:-1] + rng.uniform(-0.02, 0.02, n):
                levels += [p, np.clip(p - np.sign(b - a) * depth * rng.uniform(0.6, 1.2), lo, 1)]
            levels += [b]
        return path(levels)(x, lo, rng)
    return make


def reversals(n):
    """First-order reversal curves from the upper end."""
    return lambda x, lo, rng: path([0, 1] + [v for p in np.linspace(0.9, lo, n) for v in (p, 1)] + [0])(x, lo, rng)


def levels_held(levels, times, ramp):
    """Ramps of `ramp` of the dwell, then holds."""
    end = np.cumsum(times) / np.sum(times)
    start = np.concatenate([[0], end[:-1]])
    knots = np.concatenate([[0, 0.01], np.ravel(np.column_stack([start + ramp * np.min(times) / np.sum(times), end]))])
    knots[0], knots[1] = -1, 0
    before = np.concatenate([[0, 0], np.repeat(levels, 2)])
    return lambda x: np.interp(x, np.maximum.accumulate(knots), before)


def stairs(n, cycles=1, ramp=0.2):
    """n steps up and down again, `cycles` times."""
    def make(x, lo, rng):
        top = np.linspace(0, 1, n + 1)
        one = np.concatenate([top, top[-2::-1]]) if lo == 0 else np.concatenate([top, np.linspace(1, -1, 2 * n + 1)[1:], np.linspace(-1, 0, n + 1)[1:]])
        levels = np.concatenate([one] + [one[1:]] * (cycles - 1))
        return levels_held(levels, np.ones(len(levels)), ramp)(x)
    return make


def holds(n, ramp=0.15):
    """Random levels, held for random times."""
    def make(x, lo, rng):
        levels = rng.uniform(lo, 1, n)
        levels[0], levels[1], levels[-1] = 1, lo, 0
        return levels_held(levels, np.exp(rng.uniform(0, 1.5, n)), ramp)(x)
    return make


def sequence(*parts):
    """Experiments one after the other: (share of the time, experiment[, amplitude])."""
    def make(x, lo, rng):
        share = np.array([p[0] for p in parts])
        ends = np.concatenate([[0], np.cumsum(share) / share.sum()])
        s = np.zeros(len(x))
        for (_, experiment, *amplitude), a, b in zip(parts, ends, ends[1:]):
            rows = (x >= a) & ((x < b) | (b == 1))
            s[rows] = (amplitude or [1])[0] * experiment((x[rows] - a) / (b - a), lo, rng)
        return s
    return make


def rates(form, *parts):
    """Bursts of one form: (share of the time, cycles[, amplitude])."""
    return sequence(*[(share, form(n), *a) for share, n, *a in parts])


# ---------------------------------------------------------------- recorded temperature and load over the relative time


def profile(kind, mean, size, noise=0.0):
    """Returns a recorded quantity: its true course, and the noise of its sensor."""
    def make(x, rng):
        p = rng.uniform()
        if kind == "cycle":
            v = np.sin(2 * np.pi * (2.3 * x + p))
        elif kind == "warm":
            v = 2 * (1 - np.exp(-6 * x / (0.9 + 0.2 * p))) - 1 - 1.2 * np.maximum(0, x - 0.55) / 0.45
        elif kind == "steps":
            v = rng.permutation(np.linspace(-1, 1, 9))[np.minimum((x * 9).astype(int), 8)]
        elif kind == "tone":
            v = np.sin(2 * np.pi * (11.7 * x + p)) * (0.6 + 0.4 * np.sin(2 * np.pi * (1.7 * x + p)))
        elif kind == "bumps":
            v = 2 * sum(np.exp(-(((x - c) / 0.035) ** 2)) for c in np.linspace(0.08, 0.9, 6) + rng.uniform(-0.05, 0.05, 6)) - 1
        elif kind == "walk":
            v = 2 * walk(14)(x, 0, rng) - 1
        else:
            v = np.zeros(len(x))
        return mean + size * v
    return make, noise


# ---------------------------------------------------------------- effects


@njit
def relax(x, step):
    """A first-order lag from rest, step = sample time / time constant."""
    y, e = np.empty(len(x)), 1 - np.exp(-step)
    y[0] = x[0]
    for n in range(1, len(x)):
        y[n] = y[n - 1] + e * ((x[n] + x[n - 1]) / 2 - y[n - 1])
    return y


@njit
def mode(x, w, z):
    """A mode from rest: w = angular frequency times sample time, z = damping ratio; exact for a held input."""
    wd, y, q, v = w * np.sqrt(1 - z * z), np.empty(len(x)), x[0], 0.0
    e, c, s = np.exp(-z * w), np.cos(wd), np.sin(wd)
    y[0] = q
    for n in range(1, len(x)):
        m = (x[n] + x[n - 1]) / 2
        d = q - m
        k = (v + z * w * d) / wd
        q, v = m + e * (d * c + k * s), e * (-z * w * (d * c + k * s) + wd * (k * c - d * s))
        y[n] = q
    return y


def effect(name, before=None, behind=None, about=""):
    return SimpleNamespace(name=name, before=before, behind=behind, about=about)


def speed(u, k):
    """The rate of the drive, smoothed over a few fine samples."""
    return relax(np.gradient(u, k.dt), 0.3)


def delay(tau):
    return effect("delay", lambda u, k: np.interp(k.t - tau, k.t, u), about=f"dead time {tau} s")


def lag(*taus, sensor=False):
    def act(x, k):
        for tau in taus:
            x = relax(x, k.dt / tau)
        return x
    return effect("lag", *((None, act) if sensor else (act, None)), about=f"{'sensor' if sensor else 'amplifier'} poles {taus} s")


def bent(size, form, before=False):
    """A curve before or behind the law that bends one end more than the other."""
    def act(x, k):
        if form == "square":
            return x + size * (x * x - 1)
        if form == "exponential":
            return 2 * np.expm1(size * (x + 1)) / np.expm1(2 * size) - 1
        return x + size * np.logaddexp(0, (x - 0.1) / 0.12) * 0.12  # two slopes
    return effect("asymmetry", *((act, None) if before else (None, act)), about=f"{form} curve {'before' if before else 'behind'} the law")


def sided(size):
    def act(u, k):
        k.sided = size
        return u
    return effect("asymmetry", act, about="rising and falling branches approach at different rates")


def excess(size, power, scale):
    """A field that resists with a power of the rate, as the excess loss of Bertotti."""
    return effect("rate-dependence", lambda u, k: u - size * np.sign(v := speed(u, k)) * np.abs(v / scale) ** power, about=f"resisting field ~ rate^{power}")


def logfield(size, scale):
    return effect("rate-dependence", lambda u, k: u - size * np.arcsinh(speed(u, k) / scale), about="resisting field ~ log rate")


def widening(size, scale, form):
    """Thresholds that follow the rate: logarithmic, a power, or falling as of Stribeck."""
    def act(u, k):
        v = np.abs(speed(u, k)) / scale
        k.wide = 1 + size * (np.log1p(v) if form == "log" else np.exp(-v**0.6) - 1 if form == "stribeck" else v**form)
        return u
    return effect("rate-dependence", act, about=f"thresholds widen: {form} of the rate")


def temperature(gain=0.0, offset=0.0, width=0.0, late=0.0, mean=25.0):
    def act(y, k):
        d = k.temperature - mean
        if late:
            d = relax(d, k.dt / late)
        return y + gain * d * (y - k.zero) + offset * d + width * d * (y - k.u)
    return effect("temperature", None, act, about=f"gain {gain}, offset {offset}, loop {width} per K, {late} s late")


def creep(first, last, count, size, power=0.0, before=False):
    """Relaxations with time constants from first to last; power 0 is logarithmic creep, other powers weigh the slow ones."""
    taus = np.geomspace(first, last, count)
    weights = taus**power / np.sum(taus**power) * size
    def act(y, k):
        return y + sum(w * relax(y, k.dt / tau) for tau, w in zip(taus, weights))
    return effect("creep", *((act, None) if before else (None, act)), about=f"{count} relaxations {first} to {last} s, weights ~ tau^{power}")


def load(compliance=0.0, gain=0.0, width=0.0, harden=0.0, mean=0.0):
    def act(y, k):
        f = k.load - mean
        return y - compliance * f / (1 + harden * np.abs(f)) + gain * f * (y - k.zero) + width * f * (y - k.u)
    return effect("load", None, act, about=f"compliance {compliance}, gain {gain}, loop {width} per N, hardening {harden}")


def resonance(*modes):
    """Modes (Hz, damping ratio, share); the rest follows at once."""
    def act(y, k):
        return (1 - sum(g for _, _, g in modes)) * y + sum(g * mode(y, 2 * np.pi * f * k.dt, z) for f, z, g in modes)
    return effect("resonance", None, act, about=f"modes (Hz, damping, share) {modes}")


def stop(high=9.0, low=-9.0, rest=0.0, before=False):
    """Stops of a hardness; rest is the slope that remains."""
    def act(y, k):
        c = np.clip(y, low, high)
        return c + rest * (y - c)
    return effect("saturation", *((act, None) if before else (None, act)), about=f"stops at {low} and {high}, slope {rest} beyond, {'before' if before else 'behind'} the law")


def soft(high, knee):
    """A smooth limit at both ends."""
    def act(y, k):
        y = y - knee * np.logaddexp(0, (y - high) / knee)
        return y + knee * np.logaddexp(0, (-high - y) / knee)
    return effect("saturation", None, act, about=f"soft limits at +-{high}, knee {knee}")


def drift(form, size):
    def act(y, k):
        x = np.maximum(k.x, 0)
        return y + size * dict(linear=x, settling=1 - np.exp(-x / 0.22), root=np.sqrt(x), turning=4 * x * (1 - 0.8 * x))[form]
    return effect("drift", None, act, about=f"{form} drift")


def tones(*parts):
    """Tones (Hz, size) with random phases."""
    return effect("interference", None, lambda y, k: y + sum(a * np.sin(2 * np.pi * (f * k.t + k.rng.uniform())) for f, a in parts), about=f"tones (Hz, size) {parts}")


def unknown(form, size, n=12):
    def act(y, k):
        x, rng = np.maximum(k.x, 0), k.rng
        at = np.sort(rng.uniform(0.03, 0.97, n))
        piece = np.searchsorted(at, x)
        if form == "slipping mount":  # lets go at a high load, and jumps towards it
            trip = np.cumsum(np.diff(np.abs(y) > 0.3, prepend=False))
            way = np.zeros(len(y))
            for j, limit in enumerate(rng.uniform(0.5, 1.4, trip[-1] + 1)):
                rows = np.flatnonzero((trip == j) & (np.abs(y) > max(0.3, limit)))
                if len(rows):
                    way[rows[0] :] += np.sign(y[rows[0]]) * size * rng.uniform(0.3, 1.5)
            return y + way
        if form == "gain steps":
            return y + size * rng.choice([-1, -0.4, 0.3, 1], n + 1)[piece] * (y - k.zero)
        if form == "telegraph":
            return y + size * ((rng.integers(0, 2) + piece) % 2)
        if form == "freezing sensor":
            out, width = y.copy(), size * rng.uniform(0.4, 1.6, n)
            for a, w in zip(at, width):
                rows = np.flatnonzero((x >= a) & (x < a + w) & (k.x > 0))
                out[rows] = y[rows[0]] if len(rows) else 0
            return out
        if form == "neighbour":  # moves when it wants to, with the flank of its own controller
            return y + relax(size * rng.uniform(-1, 1, n + 1)[piece], 1500 / len(y))
        noise = rng.normal(0, 1, len(y))  # wandering zero
        slow = relax(relax(noise, 3 * n / len(y)), 3 * n / len(y))
        return y + size * slow / np.std(slow)
    return effect("unknown", None, act, about=form)


# ---------------------------------------------------------------- cases


def case(name, law, model, volts, stroke, fs, rows, train, test, noise, *effects, pre="poled", cut=0.0, over=1, temp=None, force=None, accept=(), smooth=0.0):
    """One case. noise = white and 1/f in percent of span, bits (0: none), spikes; cut = share of the drive before the record begins."""
    return SimpleNamespace(**locals())


FLAT = profile("flat", 23.0, 0.0, 0.03)


def cases():
    """Returns the 72 cases: 18 without an effect, 34 with one, 14 with two, 6 with an unknown disturbance."""
    fast = rates(tri, (0.55, 3), (0.2, 8), (0.15, 40), (0.1, 110))
    fast_test = rates(tri, (0.2, 20, 0.9), (0.6, 3), (0.2, 70, 0.8))
    return [
        case("forc", "preisach-gauss", "preisach", (0, 150), 38, 100, (9000, 6000), reversals(12), minor(4, 0.3), (0.05, 0.02, 16, 0)),
        case("one-sine", "pi-exponential", "pi", (0, 100), 15, 1000, (6000, 6000), sine(6), decay(8), (0.1, 0, 14, 0), pre="random", cut=0.1),
        case("growing-bipolar", "rayleigh", "pi", (-200, 200), 4.5, 200, (8000, 5000), grow(16), walk(30), (0.15, 0.05, 0, 0), pre="demag"),
        case("step-and-hold", "maxwell-slip", "maxwell-slip", (0, 120), 22, 50, (6000, 4500), holds(40), minor(3, 0.25), (0.03, 0.03, 16, 0)),
        case("bursts", "bouc-wen-1", "bouc-wen", (-20, 120), 60, 500, (10000, 8000), rates(sine, (0.4, 3), (0.3, 4, 0.6), (0.3, 6, 0.8)), multisine(3, 20, 8), (0.08, 0, 16, 3)),
        case("walk-unseen-start", "bouc-wen-2", "bouc-wen", (-10, 10), 100, 2000, (16000, 8000), walk(60), decay(12), (0.2, 0, 12, 0), pre="random", cut=0.1),
        case("falling", "duhem", "preisach", (0, 150), -9, 1000, (12000, 9000), minor(4, 0.35), walk(30), (0.12, 0.04, 0, 0)),
        case("afm", "coleman-hodgdon", "pi", (0, 100), 12, 10000, (20000, 12000), tri(10), rates(tri, (0.5, 4), (0.5, 6, 0.6)), (0.06, 0.06, 14, 0), cut=0.15, smooth=5e-4),
        case("decaying", "jiles-atherton", "preisach", (-200, 200), 50, 100, (5000, 4000), decay(14), walk(20), (0.25, 0, 0, 4), pre="demag"),
        case("multisine", "dahl", "bouc-wen", (0, 150), 80, 250, (7500, 5000), multisine(3, 20, 9), rates(sine, (0.5, 4), (0.5, 5, 0.5)), (0.05, 0, 16, 0)),
        case("chirp", "lugre", "bouc-wen", (-30, 150), 30, 5000, (30000, 12000), chirp(3, 60), grow(8), (0.15, 0.05, 14, 0), pre="random"),
        case("gear", "backlash-friction", "pi", (0, 100), 120, 50, (3000, 2500), stairs(9, 2, 0.5), minor(3, 0.4), (0.1, 0, 16, 0)),
        case("map", "tensor-product", "preisach", (-10, 10), 20, 400, (12000, 8000), walk(70), reversals(8), (0.1, 0.05, 0, 0), pre="demag"),
        case("network", "neural", "preisach", (0, 120), 7, 20000, (40000, 20000), multisine(4, 40, 11), rates(tri, (0.5, 4), (0.5, 7, 0.6)), (0.2, 0.1, 16, 0), cut=0.05, pre="random"),
        case("domains", "domain-switching", "preisach", (-20, 120), 45, 100, (4000, 3000), minor(3, 0.4), decay(7), (0.15, 0, 16, 0), temp=profile("walk", 24, 0.4, 0.02)),
        case("short", "takacs", "preisach", (-200, 200), 16, 1000, (1500, 1500), sine(4), decay(5), (0.1, 0, 14, 0), cut=0.25, pre="random"),
        case("kernels", "krasnoselskii-pokrovskii", "preisach", (0, 150), -28, 200, (10000, 6000), reversals(14), stairs(8, 1, 0.6), (0.04, 0.02, 16, 0)),
        case("bystanders", "pi-five", "pi", (0, 100), 33, 100, (15000, 9000), walk(80), minor(4, 0.3), (0.08, 0.04, 16, 0), temp=profile("walk", 26, 6, 0.03), force=profile("bumps", 15, 12, 0.05)),
        # delay
        case("delay-chirp", "preisach-lorentz", "preisach", (0, 100), 10, 5000, (20000, 10000), chirp(2, 400), walk(180), (0.08, 0.02, 16, 0), delay(7e-4), over=4),
        case("delay-afm", "pi-five", "pi", (0, 150), 25, 20000, (24000, 12000), rates(tri, (0.3, 3), (0.3, 20), (0.4, 60)), rates(tri, (0.5, 5), (0.5, 25, 0.8)), (0.1, 0, 14, 0), delay(2.6e-4), over=4, smooth=2e-4),
        case("delay-multisine", "masing-power", "pi", (-10, 10), -40, 500, (12000, 8000), multisine(8, 240, 14), walk(90), (0.12, 0, 0, 0), delay(0.012), over=4, cut=0.1, pre="random"),
        # lag
        case("lag-chirp", "pi-lognormal", "pi", (0, 150), 18, 2000, (24000, 12000), chirp(3, 1200), multisine(4, 300, 15), (0.1, 0.03, 16, 0), lag(9e-4), over=8),
        case("lag-two-poles", "coleman-hodgdon", "pi", (0, 100), 30, 1000, (14000, 9000), rates(sine, (0.3, 3), (0.3, 20), (0.2, 60), (0.2, 150)), chirp(3, 350), (0.1, 0, 14, 0), lag(0.0012, 0.0008, sensor=True), over=8, accept=[["delay", "lag"]]),
        case("lag-steps", "bouc-wen-1.5", "bouc-wen", (0, 120), 65, 500, (8000, 6000), sequence((0.5, holds(18, 0.05)), (0.5, multisine(2, 60, 9))), sequence((0.5, walk(40)), (0.5, holds(9, 0.05))), (0.06, 0, 16, 0), lag(0.02), over=4),
        # asymmetry
        case("asymmetry-square", "pi-exponential", "pi", (-200, 200), 6, 200, (9000, 6000), grow(14, 0.6), walk(30), (0.15, 0, 14, 0), bent(0.18, "square"), pre="demag"),
        case("asymmetry-drive", "maxwell-slip", "pi", (0, 150), 55, 100, (7000, 5000), minor(4, 0.3), decay(9), (0.1, 0.03, 16, 0), bent(0.22, "exponential", before=True), temp=FLAT),
        case("asymmetry-branches", "coleman-hodgdon", "pi", (-10, 10), 90, 2000, (16000, 8000), rates(sine, (0.4, 4), (0.3, 4, 0.5), (0.3, 4, 0.75)), tri(5), (0.02, 0, 16, 0), sided(0.75), cut=0.1, pre="random"),
        # rate dependence
        case("rate-root", "pi-exponential", "pi", (0, 100), 14, 5000, (36000, 18000), fast, fast_test, (0.1, 0, 16, 0), excess(0.05, 0.5, 100), over=2),
        case("rate-log", "domain-switching", "preisach", (0, 150), 42, 1000, (16000, 10000), fast, fast_test, (0.12, 0, 0, 0), widening(0.13, 0.2, "log")),
        case("rate-stribeck", "lugre", "bouc-wen", (-20, 120), 24, 2000, (24000, 12000), rates(sine, (0.5, 2), (0.25, 10), (0.15, 40), (0.1, 100)), rates(sine, (0.6, 3, 0.9), (0.2, 10), (0.2, 60)), (0.05, 0, 16, 0), widening(0.6, 20, "stribeck"), over=2),
        # temperature
        case("warm-gain", "preisach-lorentz", "preisach", (0, 100), 30, 50, (12000, 8000), sequence((0.6, minor(5, 0.3)), (0.4, sine(9))), walk(60), (0.06, 0.03, 16, 0), temperature(gain=0.006, late=4), temp=profile("cycle", 25, 8, 0.02)),
        case("warm-offset", "pi-power", "pi", (0, 150), -80, 50, (9000, 6000), walk(70), tri(12), (0.1, 0.05, 14, 0), temperature(gain=-0.003, offset=0.018), temp=profile("walk", 25, 7, 0.03), force=profile("flat", 20, 0, 0.05)),
        case("warm-loop", "masing-exponential", "pi", (-200, 200), 8, 100, (18000, 9000), sine(45), rates(sine, (0.5, 12), (0.5, 14, 0.7)), (0.04, 0, 16, 0), temperature(width=0.05, late=3), temp=profile("steps", 25, 10, 0.02), cut=0.05, pre="random"),
        # creep
        case("creep-log", "pi-five", "pi", (0, 150), 12, 50, (10000, 7000), stairs(6, 3, 0.03), sequence((0.5, tri(5)), (0.5, holds(12, 0.05))), (0.06, 0.02, 16, 0), creep(0.1, 600, 12, 0.2), temp=FLAT),
        case("creep-power", "preisach-gauss", "preisach", (0, 100), 40, 100, (12000, 9000), sequence((0.7, holds(24, 0.05)), (0.3, sine(8))), stairs(5, 2, 0.05), (0.08, 0, 16, 0), creep(0.05, 80, 10, 0.14, 0.3)),
        case("creep-two", "maxwell-slip", "maxwell-slip", (-10, 10), 70, 200, (16000, 9000), sequence((0.5, holds(14, 0.05)), (0.5, rates(tri, (0.6, 3), (0.4, 20)))), sequence((0.5, sine(4)), (0.5, holds(8, 0.05))), (0.05, 0, 16, 0), creep(0.4, 9, 2, 0.12)),
        case("creep-drive", "dahl", "bouc-wen", (0, 150), 100, 50, (13000, 8000), sequence((0.4, walk(60)), (0.6, holds(20, 0.05))), holds(16, 0.05), (0.1, 0.03, 0, 0), creep(0.5, 120, 8, 0.15, 0.1, before=True)),
        # load
        case("load-steps", "pi-lognormal", "pi", (0, 150), 20, 100, (8000, 6000), minor(4, 0.3), sine(8), (0.2, 0.1, 14, 3), load(compliance=0.004, mean=20), force=profile("steps", 20, 18, 0.05)),
        case("load-gain", "rayleigh", "pi", (-200, 200), 3, 500, (15000, 9000), sine(40), walk(60), (0.06, 0.02, 16, 0), load(gain=-0.004, compliance=0.0008, mean=25), force=profile("cycle", 25, 20, 0.1), cut=0.1, pre="random"),
        case("load-hardening", "bouc-wen-2", "bouc-wen", (0, 120), 110, 100, (9000, 6000), walk(50), decay(9), (0.15, 0, 14, 0), load(compliance=0.012, width=0.006, harden=0.05, mean=5), force=profile("bumps", 25, 20, 0.05), temp=FLAT),
        # resonance
        case("ringing-afm", "pi-exponential", "pi", (0, 100), 9, 20000, (30000, 15000), rates(tri, (0.4, 4), (0.3, 9), (0.3, 24)), rates(tri, (0.5, 3), (0.5, 15, 0.9)), (0.08, 0.02, 16, 0), resonance((420, 0.02, 1.0)), over=4, smooth=1e-4),
        case("two-modes", "masing-osgood", "pi", (-10, 10), 50, 4000, (24000, 12000), chirp(2, 1100), multisine(3, 500, 20), (0.15, 0, 0, 0), resonance((135, 0.08, 0.3), (240, 0.05, 0.4)), over=6, pre="demag"),
        case("ringing-steps", "preisach-bimodal", "preisach", (0, 150), 75, 2000, (14000, 9000), holds(30, 0.1), stairs(5, 2, 0.1), (0.05, 0, 16, 0), resonance((95, 0.02, 1.0)), over=6),
        # saturation
        case("stop-upper", "pi-power", "pi", (0, 150), 35, 100, (7000, 5000), minor(4, 0.35), sine(7), (0.28, 0.05, 12, 0), stop(high=0.7, rest=0.04)),
        case("soft-limits", "masing-exponential", "pi", (-200, 200), 25, 500, (10000, 8000), grow(18), walk(40), (0.08, 0.03, 16, 0), soft(0.72, 0.05), pre="demag"),
        case("clipped-drive", "pi-five", "pi", (0, 150), -18, 1000, (12000, 6000), rates(sine, (0.4, 4), (0.3, 4, 0.7), (0.3, 4, 0.9)), walk(30), (0.12, 0, 0, 0), stop(high=0.72, low=-0.8, before=True), cut=0.05),
        # drift
        case("drift-linear", "preisach-skewed", "preisach", (0, 100), 28, 100, (8000, 6000), tri(10), minor(3, 0.3), (0.08, 0.02, 16, 0), drift("linear", -0.12)),
        case("drift-settling", "pi-lognormal", "pi", (0, 150), 5, 50, (11000, 7000), sequence((0.5, tri(6)), (0.5, walk(40))), minor(3, 0.3), (0.1, 0.05, 14, 0), drift("settling", -0.16), temp=FLAT, cut=0.1, pre="random"),
        case("drift-turning", "bouc-wen-1", "bouc-wen", (-20, 120), 48, 200, (9000, 6000), rates(sine, (0.5, 8), (0.5, 10, 0.7)), multisine(5, 40, 9), (0.07, 0, 16, 0), drift("turning", -0.07)),
        # interference
        case("mains", "pi-exponential", "pi", (0, 100), 11, 1000, (10000, 8000), sine(7), decay(9), (0.08, 0, 14, 0), tones((50, 0.025), (100, 0.006), (150, 0.012)), cut=0.1, pre="random"),
        case("pump", "takacs", "preisach", (-200, 200), 13, 100, (9000, 6000), stairs(6, 2, 0.4), walk(25), (0.1, 0.03, 0, 0), tones((7.3, 0.03))),
        case("beating", "coleman-hodgdon", "pi", (0, 120), 66, 400, (12000, 9000), walk(60), tri(8), (0.06, 0, 16, 3), tones((23.1, 0.02), (24.6, 0.014))),
        # two effects
        case("lag-creep", "pi-exponential", "pi", (0, 150), 17, 1000, (36000, 20000), sequence((0.4, chirp(3, 700)), (0.6, holds(16, 0.01))), sequence((0.5, walk(150)), (0.5, holds(8, 0.01))), (0.06, 0, 16, 0), lag(0.003), creep(0.3, 60, 8, 0.14), over=3),
        case("ringing-creep", "pi-lognormal", "pi", (0, 100), 32, 5000, (40000, 25000), sequence((0.6, holds(16, 0.01)), (0.4, chirp(3, 500))), stairs(4, 2, 0.01), (0.06, 0, 16, 0), resonance((230, 0.03, 1.0)), creep(0.05, 20, 8, 0.12), over=4),
        case("warm-loaded", "masing-power", "pi", (0, 150), 45, 50, (10000, 7000), walk(60), minor(4, 0.3), (0.08, 0.03, 16, 0), temperature(offset=0.008, gain=0.002), load(compliance=0.004, mean=15), temp=profile("walk", 25, 8, 0.02), force=profile("tone", 15, 12, 0.05)),
        case("drift-hum", "generalised-pi", "preisach", (-10, 10), 27, 500, (12000, 8000), rates(sine, (0.5, 7), (0.5, 8, 0.7)), walk(40), (0.08, 0, 16, 0), drift("linear", -0.14), tones((50, 0.025)), pre="demag"),
        case("asymmetry-creep", "maxwell-slip", "pi", (0, 120), 95, 50, (11000, 8000), sequence((0.5, minor(3, 0.3)), (0.5, stairs(5, 2, 0.03))), holds(24, 0.05), (0.06, 0, 16, 0), bent(0.3, "two slopes"), creep(0.3, 150, 9, 0.16)),
        case("rate-hum", "pi-power", "pi", (0, 100), 10, 4000, (32000, 16000), fast, fast_test, (0.08, 0, 16, 0), logfield(0.012, 1.0), tones((312.5, 0.025)), over=2),
        case("warm-drift", "duhem", "preisach", (0, 150), -21, 50, (9000, 7000), tri(18), walk(40), (0.06, 0.02, 16, 0), temperature(gain=0.006), drift("root", -0.14), temp=profile("tone", 25, 7, 0.02)),
        case("loaded-ringing", "bouc-wen-1.5", "bouc-wen", (-20, 120), 58, 2000, (16000, 12000), chirp(2, 400), sequence((0.5, holds(12, 0.02)), (0.5, walk(90))), (0.08, 0, 16, 0), load(compliance=0.006, mean=10), resonance((110, 0.05, 1.0)), over=6, force=profile("bumps", 15, 12, 0.05)),
        case("delay-asymmetry", "pi-exponential", "pi", (-200, 200), 7, 2000, (20000, 10000), multisine(4, 250, 16), walk(100), (0.08, 0, 16, 0), delay(0.0036), bent(0.14, "square"), over=4, cut=0.05, pre="random"),
        case("creep-warm", "krasnoselskii-pokrovskii", "preisach", (0, 150), 36, 50, (12000, 9000), sequence((0.6, holds(22, 0.04)), (0.4, tri(8))), stairs(5, 2, 0.05), (0.06, 0.02, 16, 0), creep(0.3, 200, 9, 0.16), temperature(offset=0.006, late=5), temp=profile("cycle", 25, 7, 0.02)),
        case("rate-drift", "rayleigh", "pi", (0, 100), 16, 2000, (28000, 14000), fast, fast_test, (0.08, 0, 16, 0), excess(0.05, 0.4, 40), drift("turning", -0.06), over=2),
        case("delay-stop", "pi-five", "pi", (0, 150), 40, 5000, (25000, 12000), rates(sine, (0.3, 3), (0.3, 20), (0.4, 110, 0.9)), rates(sine, (0.5, 6), (0.5, 30, 0.8)), (0.1, 0, 14, 0), delay(0.001), stop(high=0.6, rest=0.1), over=4),
        case("lag-loaded", "coleman-hodgdon", "pi", (0, 100), 62, 200, (12000, 8000), multisine(6, 240, 16), sequence((0.5, tri(20)), (0.5, walk(40))), (0.2, 0, 14, 4), lag(0.04), load(compliance=0.005, gain=-0.002, mean=15), over=4, force=profile("steps", 20, 15, 0.05)),
        case("stop-hum", "backlash-friction", "pi", (-10, 10), 115, 1000, (10000, 8000), grow(14, 0.7), walk(40), (0.06, 0, 16, 0), stop(high=0.75, low=-0.75), tones((16.7, 0.02), (33.4, 0.01)), pre="demag"),
        # unknown
        case("slipping-mount", "pi-exponential", "pi", (-200, 200), 19, 200, (10000, 8000), sine(16), walk(40), (0.08, 0, 16, 0), unknown("slipping mount", 0.06), pre="demag"),
        case("gain-steps", "preisach-lognormal", "preisach", (0, 150), 33, 200, (12000, 8000), walk(60), minor(4, 0.3), (0.08, 0, 16, 0), unknown("gain steps", 0.07, 9)),
        case("telegraph", "bouc-wen-1", "bouc-wen", (0, 120), 52, 500, (10000, 8000), walk(50), decay(10), (0.1, 0, 14, 0), unknown("telegraph", 0.08, 60)),
        case("freezing-sensor", "pi-lognormal", "pi", (0, 100), 14, 1000, (14000, 9000), sine(25), multisine(5, 40, 9), (0.1, 0, 14, 0), unknown("freezing sensor", 0.006, 10), cut=0.05),
        case("neighbour", "masing-power", "pi", (-10, 10), 30, 500, (12000, 9000), walk(50), sine(9), (0.1, 0.03, 0, 0), unknown("neighbour", 0.09, 26), pre="demag"),
        case("wandering-zero", "coleman-hodgdon", "pi", (0, 100), 23, 100, (15000, 9000), tri(24), minor(4, 0.3), (0.08, 0, 16, 0), unknown("wandering zero", 0.06, 12), cut=0.1, pre="random"),
    ]


# ---------------------------------------------------------------- simulation


def record(c, number, which, scale=None):
    """Simulates one record. Returns drive, columns, and a function of the list of effects that returns the scaled output."""
    rng = np.random.default_rng([12, number, which])
    rows = c.rows[which]
    lo = -1 if c.volts[0] == -c.volts[1] else 0
    skipped = int(c.cut * rows)
    x = np.arange((rows + skipped) * c.over) / ((rows + skipped) * c.over)
    rest = -1 - 2 * c.volts[0] / (c.volts[1] - c.volts[0]) if c.volts[0] < 0 and lo == 0 else None
    lead = 0.0 if rest is None or skipped else 0.02  # from 0 V to the lower end
    s = (c.test if which else c.train)(np.maximum(0, x - lead) / (1 - lead), lo, rng)
    u = (s if lo else 2 * s - 1) if which == 0 else (0.94 * s if lo else 1.88 * s - 0.97)
    if lead:
        u = np.where(x < lead, rest + (u[0] - rest) * x / lead, u)
    dt = 1 / (c.fs * c.over)
    if c.smooth:
        u = relax(relax(u, dt / c.smooth), dt / c.smooth)
    before = {
        "poled": [1, -1],
        "demag": [v * (-1) ** i for i, v in enumerate(np.linspace(1, 0, 60))],
        "random": [1, -1, *rng.uniform(-1, 1, 5)],
    }[c.pre]
    before = np.concatenate([np.linspace(a, b, 150) for a, b in zip([u[0], *before], [*before, u[0]])])
    k = SimpleNamespace(dt=dt, t=(np.arange(len(x)) - skipped * c.over) * dt, u=u, zero=-1.0 if lo == 0 else 0.0)
    k.x = k.t / (rows * c.over * dt)
    columns = {}
    for name, key, spec in [("temperature_degc", "temperature", c.temp), ("load_n", "load", c.force)]:
        if spec:
            setattr(k, key, spec[0](np.clip(k.x, 0, 1), rng))
            columns[name] = (getattr(k, key)[skipped * c.over :: c.over] + spec[1] * rng.normal(0, 1, rows))

    def output(effects):
        k.sided = 0.0
        k.wide = np.ones(len(u))
        y = u
        for number_of, e in enumerate(c.effects):
            if e in effects and e.before:
                k.rng = np.random.default_rng([13, number, which, number_of])
                y = e.before(y, k)
        now = len(before)
        k.wide = np.concatenate([np.full(now, k.wide[0]), k.wide])
        y = LAWS[c.law](np.concatenate([before, y]), k)[now:]
        if scale:
            y = (y - scale[0]) / scale[1]
        for number_of, e in enumerate(c.effects):
            if e in effects and e.behind:
                k.rng = np.random.default_rng([13, number, which, number_of])
                y = e.behind(y, k)
        return y[skipped * c.over :: c.over]

    return u[skipped * c.over :: c.over], columns, output, rng


def disturbance(c, rows, rng):
    """Returns white and 1/f noise in half spans, and the same with spikes."""
    white, pink, _, spikes = c.noise
    spectrum = np.fft.rfft(rng.normal(0, 1, rows)) / np.sqrt(np.maximum(1, np.arange(rows // 2 + 1)))
    coloured = np.fft.irfft(spectrum, rows)
    noise = 0.02 * (white * rng.normal(0, 1, rows) + pink * coloured / np.std(coloured))
    spiked = noise.copy()
    spiked[rng.integers(0, rows, spikes)] += rng.choice([-1, 1], spikes) * rng.uniform(0.02, 0.06, spikes)
    return noise, spiked


def shares(d, u, y):
    """Returns the rms of a difference behind a fit of offset, drive and output, and behind one with plays of the drive as well."""
    simple = np.column_stack([np.ones(len(u)), u, y])
    r = np.linspace(0.03, 0.9, 14)
    rich = np.column_stack([simple, *[plays(u, np.array([v]), np.array([1.0]), np.ones(len(u))) for v in r]])
    return [float(np.sqrt(np.mean((d - a @ np.linalg.lstsq(a, d, rcond=None)[0]) ** 2))) for a in (simple, rich)]


def write(path, table):
    """Writes columns with six significant digits."""
    with open(path, "w") as file:
        file.write(",".join(table) + "\n")
        line = ",".join(["%.9g"] + ["%.6g"] * (len(table) - 1)) + "\n"
        file.writelines([line % values for values in zip(*(column.tolist() for column in table.values()))])


def build(c, number, folder):
    """Writes one case. Returns its lines of the table."""
    drive, _, base, _ = record(c, number, 0)
    y = base([])
    scale = (float(y.max() + y.min()) / 2, float(np.ptp(y)) / 2)
    assert np.ptp(drive) > 1.9, f"{c.name}: the drive does not fill the range"
    zero = np.random.default_rng([14, number]).uniform(-0.4, 1.2) * abs(c.stroke)
    os.makedirs(folder, exist_ok=True)
    lines = []
    for which, name in enumerate(("train", "test")):
        u, columns, output, rng = record(c, number, which, scale)
        u_volts = c.volts[0] + (u + 1) / 2 * (c.volts[1] - c.volts[0])
        unit = (c.volts[1] - c.volts[0]) / 2**16
        twin, real = output([]), output(list(c.effects))
        noise, spiked = disturbance(c, len(u), rng)
        step = 2.6 / 2 ** c.noise[2] if c.noise[2] else 0.0
        for prefix, y in (("twin-", twin), ("", real)):
            y = y + spiked
            y = np.round(y / step) * step if step else y
            table = dict(time_s=np.arange(len(u)) / c.fs, voltage_v=np.round(u_volts / unit) * unit, displacement_um=zero + c.stroke / 2 * (y + 1))
            table.update(columns)
            assert all(np.isfinite(v).all() for v in table.values()), c.name
            assert c.effects or np.array_equal(real, twin), c.name
            write(f"{folder}/{prefix}{name}.csv", table)
        floor = np.sqrt(np.mean(noise**2) + step**2 / 12)
        if which and (u.min() < -1.001 or u.max() > 1.001):
            lines.append("  !! the test record leaves the range")
        for i, e in enumerate(c.effects):
            d = real - output([o for o in c.effects if o is not e])
            a, b = (v / floor for v in shares(d, u, twin))
            lines.append([e.name, a, b] if which == 0 else lines[i] + [a])
    effects = [v for v in lines if isinstance(v, list) and len(v) == 4]
    text = "  ".join(f"{n} {a:.0f} ({b:.0f}) {t:.0f}" for n, a, b, t in effects)
    weak = " !!" if any(a < 8 or t < 4 for _, a, _, t in effects) or any(isinstance(v, str) for v in lines) else ""
    truth = dict(expect=sorted(e.name for e in c.effects), accept=[sorted(a) for a in c.accept], base=c.law, model=c.model, about="; ".join(e.about for e in c.effects))
    with open(f"{folder}/truth.json", "w") as file:
        json.dump(truth, file, indent=1)
    loop = np.std(twin - u)
    return f"{os.path.basename(folder):24} {c.law:24} {c.model:12} {c.rows[0]:6} rows {c.rows[0] / c.fs:7.2f} s  floor {50 * floor:.3f} %  loop {50 * loop:4.1f} %  {text}{weak}", effects


def main():
    folder, *prefixes = sys.argv[1:]
    everything = cases()
    assert len(everything) == 72 and len({c.name for c in everything}) == 72
    worst, seen = [], set()
    for number, c in enumerate(everything, 1):
        name = f"t{number:02}-{c.name}"
        if prefixes and not name.startswith(tuple(prefixes)):
            continue
        line, effects = build(c, number, f"{folder}/{name}")
        worst += [e[1] for e in effects]
        with open(f"{folder}/{name}/train.csv") as file:
            digest = hash(file.read())
        assert digest not in seen, f"{name} is not new"
        seen.add(digest)
        print(line, file=sys.stderr, flush=True)
    rows = [r for c in everything for r in c.rows]
    print(f"{len(everything)} cases, {len({c.law for c in everything})} laws, rows {min(rows)} to {max(rows)}, mean {np.mean(rows):.0f}; least share {min(worst, default=0):.1f} floors", file=sys.stderr)


if __name__ == "__main__":
    main()
