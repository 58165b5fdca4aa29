"""Writes a seventeenth set of simulated records for the diagnosis: `python -B seventeenth.py DIR [id-prefix ...]` (numpy, scipy, numba).

Each case is a folder DIR/yNN-short-name with
  train.csv, test.csv            time_s, voltage_v, displacement_um and, where recorded, temperature_degc or load_n
  twin-train.csv, twin-test.csv  the same drive, hysteresis law and noise without any of the effects
  truth.json                     expected effects, other accepted sets, law, kind of model to fit, a text about the effects
66 cases: 16 without an effect (one for each law), 32 with one effect, 14 with two, 4 with a fault that has no name ("unknown").

Sixteen rate-independent laws, odd about the middle of the drive: Preisach with a Gaussian and with a Lorentzian density, a moving
Preisach law, Krasnosel'skii-Pokrovskii kernels, plays between tanh curves, plays with two groups of thresholds, Segalman's Iwan
sliders, Ramberg-Osgood with Masing branches, Coleman-Hodgdon, Bouc-Wen, Dahl, an elastoplastic bristle, Jiles-Atherton, Tellinen,
Stoner-Wohlfarth grains, walls in random pinning fields. A law h is scaled to +-1 at the tips of its major loop; laws of friction
forces, which lead, are mirrored to 2 x - h. The actuator does x + part (h - x); `part` gives the wanted opening of the loop.
Inside, drive and motion run from -1 to 1, times are fractions of the record's length and rates are per record length.

The table on stderr shows for each effect and record the RMS of the difference that the effect alone makes (mean removed) in
standard deviations of the noise and in percent of the span and, in brackets, what a least-squares fit of gain, offset and 12
plays of the drive leaves of it in standard deviations of the noise. `!!` marks a broken rule: training 5 standard deviations
and 1 % (drift, interference 0.3 %), 4 left; test 2.5; |r| < 0.3 between temperature or load and the drive; loop 5 to 20 % open.
For a Preisach kind of model, whose density need not be symmetric, asymmetry and saturation are tried on 300 relays as well
(`relays`): where these leave less than 4 standard deviations the model lacks nothing and the set without the name is accepted.
"""
import json
import os
import sys
import time
import zlib
from types import SimpleNamespace

import numpy as np
from numba import njit
from scipy.signal import cont2discrete, lfilter

# ---------------------------------------------------------------- hysteresis laws: path of the drive -> state of the law

EDGE = 1.1  # end of the tables; no drive goes further

@njit
def everett_at(table, a, b):
    """Bilinear interpolation of an Everett function on a square grid from -EDGE to EDGE."""
    m = table.shape[0] - 1
    p, q = (a + 1.1) / 2.2 * m, (b + 1.1) / 2.2 * m
    i, j = min(max(int(p), 0), m - 1), min(max(int(q), 0), m - 1)
    p, q = p - i, q - j
    return (1 - p) * ((1 - q) * table[i, j] + q * table[i, j + 1]) + p * ((1 - q) * table[i + 1, j] + q * table[i + 1, j + 1])
@njit
def branch(kind, table, power, a, b):
    """Change of output on the way from turning point b to a: an Everett table or twice a Ramberg-Osgood curve of half the way."""
    if kind == 0:
        return everett_at(table, max(a, b), min(a, b)) * (1.0 if a >= b else -1.0)
    half = 0.5 * abs(a - b)
    return 2 * (half + table[0, 0] * half**power) * (1.0 if a >= b else -1.0)
@njit
def memory(path, kind, table, power, moving):
    """Return-point memory: a stack of turning points. `moving` feeds the output back into the drive (moving Preisach)."""
    points, values = np.empty(len(path) + 2), np.empty(len(path) + 2)
    points[0], values[0] = -1.1, -0.5 * branch(kind, table, power, 1.1, -1.1)
    n, last, y, out = 1, -1.1, values[0], np.empty(len(path))
    for k in range(len(path)):
        low, high = path[k] - 1.5 * moving, path[k] + 1.5 * moving
        value, count, x = y, n, last
        for _ in range(45 if moving > 0 else 1):
            x, count = 0.5 * (low + high), n
            if (n % 2 == 1 and x < last) or (n % 2 == 0 and x > last):
                points[n], values[n] = last, y
                count = n + 1
            while count >= 3 and ((count % 2 == 1 and x >= points[count - 2]) or (count % 2 == 0 and x <= points[count - 2])):
                count -= 2
            value = values[count - 1] + branch(kind, table, power, x, points[count - 1])
            low, high = (low, x) if x - moving * value > path[k] else (x, high)
        n, last, y = count, x, value
        out[k] = y
    return out
def everett(density, m=320):
    """Integrates a density(alpha, beta) over the triangles between each pair of turning points; output span 2."""
    grid = np.linspace(-EDGE, EDGE, m + 1)
    mid = 0.5 * (grid[1:] + grid[:-1])
    a, b = np.meshgrid(mid, mid, indexing="ij")
    cells = np.where(a > b, density(a, b), 0) + 0.5 * np.where(a == b, density(a, b), 0)
    table = np.zeros((m + 1, m + 1))
    table[1:, :-1] = np.cumsum(np.cumsum(cells[:, ::-1], axis=1)[:, ::-1], axis=0)  # relays with alpha < a and beta > b
    table /= table[-1, 0] / 2
    return np.tril(table) + np.tril(table, -1).T
def preisach(density, moving=0.0):
    return lambda path, p: memory(path, 0, everett(lambda a, b: density(a, b, p)), 0.0, moving * p[1])
def gauss(a, b, p):
    return np.exp(-0.5 * (((a - b) / 2 - 0.35 * p[1]) / (0.22 * p[0])) ** 2 - 0.5 * ((a + b) / 0.9) ** 2)
def lorentz(a, b, p):
    return 1 / (1 + ((a - 0.25 * p[0]) / 0.35) ** 2) / (1 + ((b + 0.25 * p[0]) / 0.35) ** 2)
def exponential(a, b, p):
    return np.exp(-(a - b) / (0.5 * p[0])) * (0.3 + 1 / np.cosh((a + b) / 0.7))
@njit
def kernels(path, lower, upper, weight, ramp):
    state, out, last = np.full(len(lower), -1.0), np.zeros(len(path)), -1.1
    for k in range(len(path)):
        x = path[k]
        for i in range(len(lower)):
            if x > last:
                state[i] = max(state[i], min(max(2 * (x - upper[i]) / ramp - 1, -1), 1))
            else:
                state[i] = min(state[i], min(max(2 * (x - lower[i]) / ramp + 1, -1), 1))
            out[k] += weight[i] * state[i]
        last = x
    return out
def krasnoselskii(path, p):
    """Kernels that rise from `upper` on and fall from `lower` on, over a ramp."""
    ramp = 0.3 * p[0]
    mid, half = np.meshgrid(np.linspace(-1.0, 1.0, 25), np.linspace(0.02, 0.8, 14))
    weight = np.exp(-np.abs(mid) / 0.8 - half / (0.4 * p[1]))
    return kernels(path, (mid - half).ravel(), (mid + half).ravel(), weight.ravel(), ramp)
@njit
def plays(path, radius, weight, curve):
    """Plays between tanh(curve (x - r)) and tanh(curve (x + r)); curve 0: ordinary plays."""
    z, out = np.zeros(len(radius)), np.zeros(len(path))
    for k in range(len(path)):
        for i in range(len(radius)):
            low, high = path[k] - radius[i], path[k] + radius[i]
            if curve > 0:
                low, high = np.tanh(curve * low), np.tanh(curve * high)
            z[i] = min(max(z[i], low), high)
            out[k] += weight[i] * z[i]
    return out
def tanh_plays(path, p):
    radius = np.linspace(0, 0.7, 30)
    return plays(path, radius, np.exp(-radius / (0.3 * p[0])), 1.1 * p[1])
def two_groups(path, p):
    """Thresholds crowd about 0.12 and 0.5 and thin out as a power towards 0."""
    radius = (np.arange(60) + 0.5) / 60 * 0.85
    weight = np.exp(-(((radius - 0.12 * p[0]) / 0.05) ** 2)) + 0.8 * np.exp(-(((radius - 0.5 * p[1]) / 0.09) ** 2)) + 0.1 * radius**0.4
    weight[0] += 2.0
    return plays(path, radius, weight, 0.0)
def iwan(path, p):
    """Sliders whose strengths are spread as a power law up to the largest, with a part at the largest (Segalman)."""
    radius = (np.arange(70) + 0.5) / 70 * 0.9 * p[0]
    weight = radius ** (-0.45 * p[1])
    weight[-1] += 0.4 * weight.sum()
    return weight.sum() * path - plays(path, radius, weight, 0.0)
@njit
def slope(kind, x, h, way, p):
    """dh/dx of the laws that are differential equations; `way` is the sign of dx."""
    if kind == 0:  # Coleman-Hodgdon
        return way * 2.2 * p[0] * (1.1 * x + 0.25 * x**3 - h) + 0.35 + 0.12 * p[1] * x * x
    if kind == 1:  # Bouc-Wen
        n = 1.6 * p[0]
        return 2.2 - 1.5 * p[1] * way * abs(h) ** (n - 1) * h - 0.6 * abs(h) ** n
    if kind == 2:  # Dahl
        return 2.4 * p[0] * max(1 - way * h, 0.0) ** (1.5 * p[1])
    if kind == 3:  # elastoplastic bristle: elastic up to a breakaway, steady slip from 1 on
        start = 0.25 * p[0]
        if way * h <= start:
            return 2.0 * p[1]
        share = 1.0 if way * h >= 1 else 0.5 - 0.5 * np.cos(np.pi * (way * h - start) / (1 - start))
        return 2.0 * p[1] * max(1 - share * way * h, 0.0)
    if kind == 4:  # Jiles-Atherton with reversible part
        field = (x + 0.06 * h) / (0.32 * p[0])
        anhysteretic = field / 3 if abs(field) < 1e-3 else 1 / np.tanh(field) - 1 / field
        steep = (1 / 3 if abs(field) < 1e-2 else 1 / field**2 - 1 / np.sinh(field) ** 2) / (0.32 * p[0])
        lack = anhysteretic - h
        walls = 0.0 if lack * way <= 0 else 0.85 * lack / (0.28 * p[1] * way - 0.06 * lack)
        return walls + 0.15 * steep
    rise, fall = np.tanh(1.5 * p[0] * (x - 0.28 * p[1])), np.tanh(1.5 * p[0] * (x + 0.28 * p[1]))  # Tellinen
    limit = rise if way > 0 else fall
    share = (fall - h) / (fall - rise) if way > 0 else (h - rise) / (fall - rise)
    return 0.12 + share * (1.5 * p[0] * (1 - limit * limit) - 0.12)
@njit
def differential(path, kind, p):
    out, h, x = np.empty(len(path)), 0.0, 0.0
    for k in range(len(path)):
        count = int(np.ceil(abs(path[k] - x) / 0.001))
        if count > 0:
            step = (path[k] - x) / count
            way = 1.0 if step > 0 else -1.0
            for _ in range(count):
                h += step * slope(kind, x + step / 2, h + step / 2 * slope(kind, x, h, way, p), way, p)
                x += step
            x = path[k]
        out[k] = h
    return out
def stoner_wohlfarth(path, p):
    """Grains with an easy axis at psi: field and moment by the angle theta of the moment; at the end of a branch it jumps."""
    out = np.zeros(len(path))
    for psi in (np.arange(20) + 0.5) / 20 * np.pi / 2:
        theta = np.linspace(0.02 * psi, np.pi, 6001)[:-1]
        field = -0.5 * np.sin(2 * (theta - psi)) / np.sin(theta)
        end = np.argmax(np.diff(field) > 0)  # the branch from large fields down ends here
        field, moment = field[end::-1], np.cos(theta[end::-1])
        for strength in 0.22 + 0.7 * ((np.arange(32) + 0.5) / 32) ** (1.5 * p[0]):
            switch = -field[0] * strength
            up = kernels(path, np.array([-switch]), np.array([switch]), np.ones(1), 1e-9)
            out += up * np.interp(up * path / strength, field, moment)
    return out
@njit
def walls(path, pull, width):
    """Each wall sits where a spring to the drive balances its random pinning field and jumps where that place vanishes."""
    out, count, m = np.zeros(len(path)), pull.shape[0], pull.shape[1]
    for w in range(count):
        i, way, last, g = m // 2, 1, -10.0, pull[w]
        while g[i] > path[0]:
            i -= 1
        for k in range(len(path)):
            x = path[k]
            if (x - last) * way < 0:
                i, way = i + way, -way
            while (g[i + way] - x) * way <= 0:
                i += way
            out[k] += ((i + way * (x - g[i]) / (g[i + way] - g[i])) / (m - 1) * 2 - 1) * width
            last = x
    return out / count
def pinning(path, p):
    rng = np.random.default_rng(int(1e6 * p[2]))
    place = np.linspace(-2, 2, 2401)
    fields = []
    for _ in range(90):
        waves = rng.uniform(6, 26, 7)
        field = 0.9 * p[0] * rng.uniform(0.3, 1) * np.mean(np.sin(waves[:, None] * place + rng.uniform(0, 6.28, (7, 1))), axis=0)
        fields += [place + 2 * field, place - 2 * field[::-1]]
    return walls(path, np.array(fields), 2.0)
LAWS = {  # function, whether it leads
    "preisach-gauss": (preisach(gauss), False), "preisach-lorentz": (preisach(lorentz), False),
    "preisach-moving": (preisach(exponential, 0.13), False), "kp-kernels": (krasnoselskii, False), "tanh-plays": (tanh_plays, False),
    "two-groups": (two_groups, False), "pinning": (pinning, False), "iwan": (iwan, True), "stoner-wohlfarth": (stoner_wohlfarth, False),
    "ramberg-osgood": (lambda u, p: memory(u, 1, np.full((1, 1), 0.8 * p[0]), 2.4 * p[1], 0.0), False),
    "coleman-hodgdon": (lambda u, p: differential(u, 0, p), False), "bouc-wen": (lambda u, p: differential(u, 1, p), True),
    "dahl": (lambda u, p: differential(u, 2, p), True), "bristle": (lambda u, p: differential(u, 3, p), True),
    "jiles-atherton": (lambda u, p: differential(u, 4, p), False), "tellinen": (lambda u, p: differential(u, 5, p), False),
}
def make_law(name, seed, opening):
    """Returns path -> hysteretic part with the wanted opening of the major loop, and the share used."""
    raw, leads = LAWS[name]
    p = np.random.default_rng(seed).uniform(0.88, 1.12, 3)
    ramp = np.linspace(-1, 1, 801)
    h = raw(np.concatenate([np.linspace(0, 1, 400), -ramp, ramp, -ramp, ramp]), p)
    down, up = h[-1602:-801][::-1], h[-801:]
    tip = 0.5 * (up[-1] - down[0])
    part = opening / (np.max(np.abs(down - up)) / 2 / tip)
    def hysteretic(path):
        rest = raw(path, p) / tip - path
        return part * (-rest if leads else rest)
    return hysteretic, part

# ---------------------------------------------------------------- experiments: rows, random numbers -> drive, -1 to 1

def wave(phase, shape, low):
    """One period is 1; starts at 0 rising or, if low, at the lower end."""
    phase = phase - (0.25 if low else 0)
    return np.sin(2 * np.pi * phase) if shape == "sin" else 2 / np.pi * np.arcsin(np.sin(2 * np.pi * phase))
def chain(parts, ramp):
    """Joins parts; a straight way of `ramp` rows bridges each gap."""
    out = [parts[0]]
    for part in parts[1:]:
        if abs(part[0] - out[-1][-1]) > 0.03:
            out.append(np.linspace(out[-1][-1], part[0], max(int(ramp), 3))[1:-1])
        out.append(part)
    return np.concatenate(out)
def blocks(n, rng, cycles=(2, 6, 18), amps=None, rest=0.03, shape="sin", low=False):
    """Blocks of equal length with different rates and rests after each."""
    amps, parts = amps or [1.0] * len(cycles), []
    rows = int(n * (1 - rest * len(cycles)) / len(cycles))
    for count, amp in zip(cycles, amps):
        parts.append(amp * wave(np.arange(rows + 1) / rows * count, shape, low))
        if rest:
            parts.append(np.full(int(n * rest), parts[-1][-1]))
    return chain(parts, n / 60)
def sine(n, rng, cycles=6, low=False):
    return wave(np.arange(n) / n * cycles, "sin", low)
def raster(n, rng, lines=(8, 24), rest=0.3):
    """Lines to and fro as triangles from the lower end; a rest after each line; blocks of different rate."""
    parts = []
    for count in lines:
        rows = int(n / len(lines) / count)
        line = wave(np.arange(int(rows * (1 - rest)) + 1) / int(rows * (1 - rest)), "tri", True)
        parts += [np.concatenate([line, np.full(rows - len(line), line[-1])])] * count
    return chain(parts, n / 60)
def decay(n, rng, cycles=14, end=0.08):
    tau = np.arange(n) / n
    return np.cos(2 * np.pi * cycles * tau) * end**tau
def stairs(n, rng, levels=6, ramp=0.1, mixed=False):
    """Up and down in equal steps, or to random levels; straight ramps, then holds."""
    grid = np.linspace(-1, 1, levels)
    grid = rng.permutation(np.concatenate([grid, rng.uniform(-0.9, 0.9, levels)])) if mixed else np.concatenate([grid, grid[-2::-1]])
    if mixed:
        grid[:2] = [-1, 1]
    rows = n // len(grid)
    move = max(int(rows * ramp), 2)
    parts = [np.full(rows, grid[0])]
    for a, b in zip(grid, grid[1:]):
        parts.append(np.concatenate([np.linspace(a, b, move), np.full(rows - move, b)]))
    return np.concatenate(parts)
def chirp(n, rng, first=1.5, last=60.0, shape="sin"):
    """Rate grows by a constant factor per time."""
    k = np.log(last / first)
    return wave(first / k * np.expm1(k * np.arange(n) / n), shape, False)
def walk(n, rng, knots=40, hold=0.0, spread=0.8):
    """Straight ways between random levels, durations spread by a factor exp(spread), holds at a share of the knots."""
    level = rng.uniform(0.15, 1, knots) * np.where(np.arange(knots) % 2, 1, -1) + rng.uniform(-0.4, 0.4, knots)
    level = np.clip(level, -1, 1)
    level[[0, knots // 3, knots // 3 + 1]] = [0, 1, -1]
    length, levels, lengths = np.exp(spread * rng.standard_normal(knots)), [level[0]], [0.0]
    for x, dt in zip(level[1:], length[1:]):
        levels, lengths = levels + [x], lengths + [dt]
        if rng.uniform() < hold:
            levels, lengths = levels + [x], lengths + [3 * np.exp(0.4 * rng.standard_normal())]
    at = np.cumsum(lengths)
    return np.interp(np.arange(n) / (n - 1), at / at[-1], levels)
def smooth(n, rng, top=25, slope=0.7):
    """Sum of sines with random phases at rates that are no multiples of each other, up to `top` per record."""
    rate = np.sort(rng.uniform(0.7, top, 28))
    u = np.sum(np.sin(2 * np.pi * rate[:, None] * np.arange(n) / n + rng.uniform(0, 6.28, (28, 1))) / rate[:, None] ** slope, axis=0)
    u -= 0.5 * (u.max() + u.min())
    return u / np.abs(u).max()
def multisine(n, rng, rates=(3, 7.3, 17.7, 41.1), slope=0.5):
    rate = np.array(rates)[:, None]
    u = np.sum(np.sin(2 * np.pi * rate * np.arange(n) / n + rng.uniform(0, 6.28, rate.shape)) / rate**slope, axis=0)
    return (u - 0.5 * (u.max() + u.min())) / (0.5 * np.ptp(u))
def reversals(n, rng, count=9):
    """First-order reversal curves from the upper end."""
    ends = np.ones(2 * count + 1)
    ends[1::2] = np.linspace(0.7, -1, count)
    return np.interp(np.arange(n) / n * 2 * count, np.arange(2 * count + 1), ends)
def protocol(n, rng, slow=2, fast=25, hold=0.12):
    """Slow triangles, a hold, nested loops, a hold at a high level, fast sines, a hold at a low level, a random walk."""
    rows = int(n * (1 - 3 * hold) / 4)
    parts = [wave(np.arange(rows) / rows * slow, "tri", False)]
    nested = np.interp(np.arange(rows) / rows * 8, np.arange(9), [0, 0.9, -0.7, 0.8, -0.3, 0.5, 0.1, 0.95, 0.75])
    parts += [np.full(int(n * hold), 0.0), nested, np.full(int(n * hold), nested[-1])]
    parts += [0.85 * wave(np.arange(rows) / rows * fast, "sin", False), np.full(int(n * hold), -0.8), walk(rows, rng, 12)]
    return chain(parts, n / 80)

# ---------------------------------------------------------------- effects: (name, stage, function of the state)

STAGES = ("drive", "width", "motion", "creep", "mode", "stop", "zero", "out")
@njit
def play(u, radius):
    """A play whose threshold may differ from row to row."""
    z, x = np.empty(len(u)), u[0]
    for i in range(len(u)):
        x = min(max(x, u[i] - radius[i]), u[i] + radius[i])
        z[i] = x
    return z
def low_pass(x, tau, dt):
    """First-order low-pass, exact for straight ways between rows; starts settled."""
    a = np.exp(-dt / tau)
    b = (1 - a) * tau / dt
    return x[0] + lfilter([1 - b, b - a], [1, -a], x - x[0])
def rate_of(s):
    """Rate of the drive, straight differences smoothed over 3 rows, per record length."""
    return low_pass(np.diff(s.u, prepend=s.u[0]) / s.dt, 3 * s.dt, s.dt)
def effect(name, stage):
    """Turns a function of the state s and a signal x into a maker of effects: x is the motion y, the drive u or the hysteretic
    part d, and what the function returns takes its place (creep, whatever it follows, adds to the motion)."""
    def decorate(function):
        def maker(*args, of="d" if stage == "width" else "y", **options):
            put = "y" if name == "creep" else of
            return name, "drive" if put == "u" else stage, lambda s: setattr(s, put, function(s, getattr(s, of), *args, **options))
        return maker
    return decorate
@effect("creep", "creep")
def creep(s, x, parts):
    """Slow parts that follow motion, hysteretic part or drive: [(share, time), ...]."""
    return s.y + sum(share * low_pass(x, tau, s.dt) for share, tau in parts)
def log_creep(share, first, last, power=0.0, of="y"):
    """Times spread evenly in the logarithm (creep by the logarithm of time) or weighted by a power (creep by a power of time)."""
    tau = np.geomspace(first, last, 14)
    return creep(list(zip(share * tau**power / np.sum(tau**power), tau)), of=of)
@effect("delay", "out")
def delay(s, x, time_):
    return np.interp(s.t - time_, s.t, x)
@effect("lag", "out")
def lag(s, x, *times):
    """Low-passes of first order one after the other."""
    for tau in times:
        x = low_pass(x, tau, s.dt)
    return x
@effect("lag", "out")
def broad_lag(s, x, first, last):
    """Mean of low-passes with times spread evenly in the logarithm."""
    return np.mean([low_pass(x, tau, s.dt) for tau in np.geomspace(first, last, 8)], axis=0)
@effect("resonance", "mode")
def resonance(s, y, rate, damping, share=1.0):
    """A share of the motion goes through a mode with this rate per record length."""
    w = 2 * np.pi * rate
    b, a, _ = cont2discrete(([w * w], [1, 2 * damping * w, w * w]), s.dt, "foh")
    return y + share * (lfilter(b.ravel(), a, y - y[0]) - (y - y[0]))
@effect("rate-dependence", "width")
def rate_width(s, d, law):
    """Opening of the loop grows or falls with the rate."""
    return d * (1 + law(np.abs(rate_of(s))))
@effect("rate-dependence", "motion")
def rate_gain(s, y, law):
    return s.origin + (y - s.origin) * (1 - law(np.abs(rate_of(s))))
@effect("rate-dependence", "motion")
def rate_friction(s, y, size, knee):
    """A friction of thermally activated slip: inverse sinh of the rate, against the motion."""
    return y - size * np.arcsinh(rate_of(s) / knee)
@effect("rate-dependence", "motion")
def rate_plays(s, y, size, knee, power):
    """A further play whose threshold grows with a power of the rate."""
    return y + 0.5 * (play(s.u, size * (np.abs(rate_of(s)) / knee) ** power) - s.u)
def environment(name, gain=0.0, zero=0.0, width=0.0, lagging=0.0, curve=None):
    """Gain about zero volts, zero and width change with the recorded quantity, -1 to 1 in its range, after a lag, by a curve."""
    def changed(s, y):
        x = low_pass(s.aux, lagging, s.dt) if lagging else s.aux
        x = curve(x) if curve else x
        return s.origin + (y + width * x * s.d - s.origin) * (1 + gain * x) + zero * x
    return effect(name, "motion")(changed)()
@effect("drift", "zero")
def drift(s, y, curve):
    return y + curve(s.t)
@effect("saturation", "stop")
def stop(s, x, low, high, knee=0.0):
    """Limits at low and high (None: no limit); a knee rounds them."""
    for level, way in ((low, -1), (high, 1)):
        if level is not None:
            over = (x - level) * way
            x = x - way * (np.logaddexp(0, over / knee) * knee if knee else np.maximum(over, 0))
    return x
@effect("asymmetry", "motion")
def asymmetry(s, x, curve):
    return curve(x)
@effect("asymmetry", "width")
def uneven_branches(s, d, share):
    """The rising branch is wider than the falling one (sign of the hysteretic part)."""
    return d + share * np.sqrt(d**2 + 1e-4)
@effect("interference", "zero")
def interference(s, y, size, rate, harmonics=(1.0,), phase=1.0):
    return y + size * sum(h * np.sin(2 * np.pi * rate * k * s.t + phase * k) for k, h in enumerate(harmonics, 1))
@effect("unknown", "zero")
def telegraph(s, y, size, dwell, seed):
    """The zero jumps between two values at random moments, dwell times exponential."""
    times = np.cumsum(np.random.default_rng(seed + s.test).exponential(dwell, 4000))
    return y + size * (np.searchsorted(times, s.t) % 2 - 0.5)
@effect("unknown", "motion")
def humid_gain(s, y, size, seed):
    """Gain about the middle follows a humidity that nobody recorded: smooth, random, about 9 swings in a record."""
    return y * (1 + size * smooth(len(s.t), np.random.default_rng(seed + s.test), 9, 0.2))
@effect("unknown", "zero")
def knocks(s, y, size, count, rate, damping, seed):
    """Knocks from outside at random moments of random strength and sign, each rings down; the drive has no part in them."""
    rng = np.random.default_rng(seed + s.test)
    for at, a in zip(rng.uniform(0, 1, count), size * rng.uniform(0.4, 1.3, count) * rng.choice([-1, 1], count)):
        x = np.maximum(s.t - at, 0) * 2 * np.pi * rate
        y = y + a * np.exp(-damping * x) * np.sin(x)
    return y
@effect("unknown", "zero")
def slips(s, y, size, count, seed):
    """The clamp slips to and fro: many sudden steps of the zero at random moments, each to a new random level."""
    rng = np.random.default_rng(seed + s.test)
    level = size * rng.uniform(-1, 1, count + 1)
    return y + level[np.searchsorted(np.sort(rng.uniform(0, 1, count)), s.t)]

# ---------------------------------------------------------------- recorded temperature or load, -1 to 1

def surroundings(kind, n, rng):
    tau = np.arange(n) / n
    if kind == "cycle":
        x = np.sin(2 * np.pi * (rng.uniform(1.2, 2.2) * tau + rng.uniform())) + 0.3 * np.sin(2 * np.pi * (4.3 * tau + rng.uniform()))
    elif kind == "plateaus":
        x = low_pass(rng.permutation(np.linspace(-1, 1, 9))[np.minimum((tau * 9).astype(int), 8)], 0.02, 1 / n)
    elif kind == "pulses":
        x = low_pass((np.sin(2 * np.pi * rng.uniform(5, 9) * tau + rng.uniform(0, 6)) > rng.uniform(-0.3, 0.5)).astype(float), 0.004, 1 / n)
    else:
        x = smooth(n, rng, 7, 0.5)
    return 2 * (x - x.min()) / np.ptp(x) - 1

# ---------------------------------------------------------------- cases

CASES = []

def case(name, law, opening, rows, rate, train, test, noise, volts, travel, effects=(), aux=None, accept=(), skip=0.0, model=None, about="",
         share=0.8, top=0.95, lift=0.0):
    """rows and rows per second of the training record; `share`, `top`, `lift`: length, amplitude and middle of the test record;
    noise: standard deviation in percent of the span and words for its kind; skip: share of the record cut off at its beginning."""
    CASES.append(SimpleNamespace(**{k: v for k, v in locals().items()}, id=f"y{len(CASES) + 1:02d}-{name}"))

def ex(function, **options):
    return lambda n, rng: function(n, rng, **options)

# without an effect, one for each law; some with a recorded quantity that does nothing
case("clean-gauss", "preisach-gauss", 0.13, 6000, 500, ex(blocks), ex(walk), (0.1, ""), (0, 100), 12)
case("clean-lorentz", "preisach-lorentz", 0.10, 4000, 100, ex(reversals), ex(blocks, cycles=(3, 9)), (0.05, "12 bit"), (-20, 130), 38)
case("clean-moving", "preisach-moving", 0.16, 5000, 1000, ex(decay), ex(smooth), (0.2, "spikes"), (0, 60), 9, top=0.9)
case("clean-kp", "kp-kernels", 0.12, 8000, 2000, ex(protocol), ex(blocks, shape="tri"), (0.08, ""), (-100, 100), 60, skip=0.15)
case("clean-tanh", "tanh-plays", 0.09, 3000, 50, ex(stairs, levels=7), ex(walk, hold=0.3), (0.15, ""), (0, 150), 95)
case("clean-two-groups", "two-groups", 0.14, 12000, 5000, ex(raster, lines=(12, 40)), ex(blocks, shape="tri", low=True), (0.3, "1/f"), (0, 75), 4.5)
case("clean-iwan", "iwan", 0.18, 2500, 250, ex(walk, knots=50), ex(decay), (0.03, ""), (-50, 50), 20)
case("clean-masing", "ramberg-osgood", 0.07, 4500, 400, ex(chirp, last=40), ex(multisine, rates=(2, 5.3, 12.1)), (0.06, ""), (0, 1000), 140)
case("clean-hodgdon", "coleman-hodgdon", 0.11, 9000, 1000, ex(blocks, cycles=(3, 10, 30), amps=[1, 0.7, 0.4]), ex(walk), (0.1, "12 bit"), (0, 120),
     15)
case("clean-bouc-wen", "bouc-wen", 0.15, 3500, 200, ex(multisine), ex(chirp, last=30), (0.5, ""), (-30, 150), 50, aux=("temperature", "cycle", 21,
     34))
case("clean-dahl", "dahl", 0.08, 500, 50, ex(sine, cycles=5), ex(sine, cycles=4), (0.05, ""), (0, 100), 7)
case("clean-bristle", "bristle", 0.12, 7000, 2000, ex(smooth), ex(decay), (0.1, "spikes"), (-10, 110), 30)
case("clean-jiles", "jiles-atherton", 0.17, 5500, 800, ex(walk, hold=0.25), ex(reversals), (0.12, ""), (-2.5, 2.5), 85, aux=("load", "plateaus", 0,
     30))
case("clean-tellinen", "tellinen", 0.10, 4000, 100, ex(blocks, cycles=(2, 7), shape="tri", low=True), ex(stairs, levels=6), (0.07, ""), (0, 200), 18)
case("clean-grains", "stoner-wohlfarth", 0.06, 10000, 10000, ex(chirp, first=3, last=120, shape="tri"), ex(smooth, top=50), (0.15, ""), (0, 10), 2.2,
     skip=0.1)
case("clean-pinning", "pinning", 0.09, 6000, 300, ex(protocol, fast=12), ex(walk, knots=30), (0.1, "1/f"), (0, 140), 25)
# creep
case("creep-one-time", "ramberg-osgood", 0.11, 6000, 100, ex(stairs, levels=7), ex(walk, hold=0.4, knots=25), (0.05, ""), (0, 100), 14,
     [creep([(0.07, 0.03)])], about="one relaxation of 3 % of the record, 7 % of the motion")
case("creep-log", "preisach-lorentz", 0.13, 9000, 50, ex(protocol), ex(stairs, levels=5), (0.04, ""), (-20, 120), 40, [log_creep(0.09, 0.003, 0.3)],
     about="creep by the logarithm of time over two decades")
case("creep-power", "bristle", 0.10, 8000, 200, ex(walk, knots=30, hold=0.45), ex(protocol), (0.05, "1/f"), (0, 150), 110, [log_creep(0.10, 0.004,
     0.25, 0.3)], skip=0.1, about="creep by a power of time, record begins in mid-cycle")
case("creep-of-walls", "pinning", 0.18, 12000, 1000, ex(blocks, cycles=(1.5, 5), rest=0.25), ex(stairs, levels=5, mixed=True), (0.04, ""), (-60, 60),
     22, [creep([(0.2, 0.015), (0.15, 0.06), (0.15, 0.15)], of="d")], about="the hysteretic part creeps with three times")
# delay
case("delay-sines", "tanh-plays", 0.12, 9000, 5000, ex(blocks, cycles=(4, 18, 60)), ex(multisine, rates=(5, 21.3, 60.7)), (0.08, ""), (0, 75), 6,
     [delay(3.4 / 9000)], about="the sensor answers 3.4 rows late")
case("delay-chirp", "coleman-hodgdon", 0.09, 40000, 20000, ex(chirp, first=4, last=800, shape="tri"), ex(smooth, top=480, slope=0.3), (0.1, ""),
     (-100, 100), 3, [delay(6.5 / 40000, of="u")], about="the drive reaches the actuator 6.5 rows late")
# lag
case("lag-driver", "jiles-atherton", 0.12, 8000, 2000, ex(blocks, cycles=(3, 15, 60), shape="tri"), ex(walk, knots=90), (0.1, "12 bit"), (0, 150), 28,
     [lag(6 / 8000, of="u")], about="the amplifier charges the actuator through a resistor, 6 rows")
case("lag-broad", "two-groups", 0.15, 12000, 4000, ex(smooth, top=90, slope=0.4), ex(chirp, first=2, last=100), (0.15, ""), (-20, 100), 45,
     [broad_lag(2 / 12000, 25 / 12000)], about="broad low-pass of the output, times over a decade")
case("lag-sensor", "iwan", 0.08, 6000, 1000, ex(multisine, rates=(3, 11.3, 37.9, 88.3), slope=0.3), ex(blocks, cycles=(4, 20), shape="tri"), (0.12,
     "spikes"), (0, 60), 10, [lag(4 / 6000, 7 / 6000)], about="two low-passes of first order in the sensor")
# resonance
case("mode-chirp", "preisach-gauss", 0.10, 16000, 10000, ex(chirp, first=3, last=700), ex(smooth, top=400, slope=0.2), (0.2, ""), (0, 100), 8,
     [resonance(520, 0.07, 0.12)], about="the chirp passes a mode that carries 12 % of the motion")
case("mode-raster", "dahl", 0.13, 20000, 20000, ex(raster, lines=(15, 60)), ex(blocks, cycles=(10, 45), shape="tri"), (0.1, ""), (0, 150), 5,
     [resonance(1300, 0.02)], about="the turns of the raster ring a mode of the whole motion")
case("mode-stairs", "bouc-wen", 0.11, 7000, 1000, ex(stairs, levels=8, ramp=0.03), ex(walk, knots=70), (0.08, ""), (-50, 50), 33, [resonance(260,
     0.04, 0.6)], about="fast ramps between stairs ring a mode that carries 60 % of the motion")
# rate dependence
case("rate-root", "kp-kernels", 0.12, 10000, 2000, ex(blocks, cycles=(1, 5, 20, 80), rest=0.04), ex(walk, knots=60, hold=0.1, spread=1.2), (0.06, ""),
     (0, 100), 16, [rate_width(lambda v: 0.5 * np.sqrt(v / 200))], about="opening grows with the root of the rate")
case("rate-log", "preisach-moving", 0.14, 12000, 1000, ex(blocks, cycles=(1, 8, 60), shape="tri", rest=0.05), ex(protocol, fast=15), (0.05, "1/f"),
     (-30, 130), 70, [rate_width(lambda v: 0.28 * np.log10(1 + v / 3))], about="opening grows with the logarithm of the rate")
case("rate-gain", "tellinen", 0.09, 9000, 500, ex(blocks, cycles=(1, 5, 25), shape="tri", rest=0.06), ex(raster, lines=(3, 30), rest=0.2), (0.08, ""),
     (0, 120), 24, [rate_gain(lambda v: 0.03 * np.log10(1 + v / 4))], about="gain falls with the logarithm of the rate")
case("rate-friction", "stoner-wohlfarth", 0.08, 8000, 4000, ex(blocks, cycles=(1, 5, 25, 75), rest=0.04, shape="tri"), ex(smooth, top=40, slope=1.0),
     (0.1, ""), (-10, 10), 1.8, [rate_friction(0.009, 4)], about="thermally activated slip: inverse sinh of the rate against the motion")
# temperature
case("temperature-gain", "iwan", 0.13, 6000, 100, ex(walk, knots=60), ex(blocks, cycles=(5, 9)), (0.1, ""), (0, 150), 52, [environment("temperature",
     gain=0.05)], aux=("temperature", "cycle", 18, 46), about="gain by 10 % over the range")
case("temperature-zero", "coleman-hodgdon", 0.15, 5000, 50, ex(blocks, cycles=(5, 11), low=True), ex(smooth, top=12), (0.08, "12 bit"), (0, 100), 20,
     [environment("temperature", zero=0.05, lagging=0.04)], aux=("temperature", "plateaus", 20, 35),
     about="zero follows the temperature with a lag of 4 % of the record")
case("temperature-width", "preisach-gauss", 0.17, 8000, 200, ex(smooth, top=30), ex(walk, knots=40), (0.06, ""), (-100, 100), 31,
     [environment("temperature", width=-0.6)], aux=("temperature", "random", -15, 60), about="the loop becomes narrower with temperature")
case("temperature-curve", "ramberg-osgood", 0.10, 7000, 100, ex(chirp, first=4, last=50), ex(decay, cycles=20), (0.12, "spikes"), (0, 75), 11,
     [environment("temperature", gain=-0.05, zero=-0.04, curve=lambda x: x + 0.35 * x * x)], aux=("temperature", "cycle", 5, 40),
     about="gain and zero by a bent curve of temperature")
# load
case("load-spring", "bouc-wen", 0.09, 5000, 500, ex(blocks, cycles=(4, 13)), ex(walk), (0.1, ""), (0, 120), 60, [environment("load", zero=-0.06)],
     aux=("load", "pulses", 0, 80), about="the load compresses the actuator")
case("load-stiffness", "kp-kernels", 0.14, 6000, 1000, ex(walk, knots=70), ex(multisine, rates=(4, 9.3, 21.7)), (0.12, ""), (-20, 150), 17,
     [environment("load", gain=-0.08)], aux=("load", "random", 5, 25), about="the load takes gain")
case("load-contact", "tanh-plays", 0.11, 4000, 100, ex(raster, lines=(8, 20), rest=0.2), ex(decay, cycles=16), (0.1, "1/f"), (0, 100), 90,
     [environment("load", zero=-0.05, width=0.15, curve=lambda x: 2 * (0.5 + 0.5 * x) ** (2 / 3) - 1)], aux=("load", "plateaus", 0, 12),
     about="contact: zero by the power 2/3 of the load, loop becomes wider")
# drift
case("drift-settling", "two-groups", 0.12, 6000, 200, ex(walk, knots=50), ex(blocks, cycles=(6, 14, 25), amps=[1, 0.5, 0.9], rest=0), (0.06, ""), (0,
     100), 13, [drift(lambda t: 0.05 * np.exp(-t / 0.3))], about="zero settles with 30 % of the record")
case("drift-smooth", "jiles-atherton", 0.10, 9000, 1000, ex(raster, lines=(25, 45), rest=0.1), ex(smooth, top=60), (0.2, ""), (-3, 3), 42,
     [drift(lambda t: 0.045 * np.sin(4.4 * t + 0.6) + 0.02 * t)], about="zero wanders smoothly")
# saturation
case("stop-drive", "pinning", 0.12, 5000, 500, ex(blocks, cycles=(3, 8), amps=[1, 0.9], shape="tri"), ex(walk, knots=36), (0.1, ""), (0, 150), 19,
     [stop(-0.78, 0.78, of="u")], about="the amplifier clips the drive at both ends", top=1.0)
case("stop-upper", "preisach-lorentz", 0.15, 7000, 1000, ex(protocol), ex(smooth, top=14), (0.08, "12 bit"), (0, 100), 27, [stop(None, 0.7)],
     about="a hard stop at the upper end of the motion", top=1.0)
case("stop-knee", "dahl", 0.10, 4500, 300, ex(walk, knots=60), ex(blocks, cycles=(4, 9)), (0.1, ""), (-75, 75), 65, [stop(-0.72, 0.72, 0.025)],
     about="stops with a knee at both ends of the motion", top=0.99)
# asymmetry
case("bent-square", "stoner-wohlfarth", 0.09, 6000, 2000, ex(decay, cycles=18), ex(walk), (0.1, ""), (0, 12), 3,
     [asymmetry(lambda y: y + 0.13 * y * y)], about="a square of the motion", top=0.9)
case("bent-branches", "bristle", 0.16, 8000, 400, ex(reversals, count=12), ex(blocks, cycles=(4, 11), amps=[1, 0.6]), (0.06, ""), (-20, 120), 48,
     [uneven_branches(0.6)], about="the branches are of different width")
# interference
case("tone-harmonics", "tellinen", 0.13, 10000, 2500, ex(blocks, cycles=(3, 11, 29), shape="tri"), ex(walk), (0.08, ""), (0, 60), 8,
     [interference(0.02, 10000 / 2500 * 50, (1, 0, 0.5, 0, 0.2))], about="mains of 50 Hz with odd harmonics")
case("tone-one-sine", "preisach-moving", 0.09, 3000, 1000, ex(sine, cycles=7), ex(sine, cycles=5, low=True), (0.06, "spikes"), (0, 100), 21,
     [interference(0.015, 38.4)], about="one sine as drive, a tone of 12.8 Hz")
# two effects
case("creep-temperature", "tanh-plays", 0.11, 10000, 50, ex(walk, knots=34, hold=0.4), ex(stairs, levels=6, mixed=True), (0.05, ""), (0, 150), 34,
     [log_creep(0.08, 0.003, 0.1), environment("temperature", gain=0.05)], aux=("temperature", "cycle", 20, 50),
     about="creep by the logarithm, gain by temperature")
case("rate-load", "iwan", 0.15, 9000, 1000, ex(blocks, cycles=(1, 6, 30, 70), rest=0.03), ex(walk, knots=60, hold=0.1, spread=0.8), (0.06, ""), (0,
     100), 15, [rate_width(lambda v: 0.6 * v / (v + 60)), environment("load", zero=-0.05)], aux=("load", "random", 0, 40),
     about="opening saturates with rate, load compresses")
case("delay-tone", "kp-kernels", 0.08, 12000, 8000, ex(multisine, rates=(6, 23.3, 91.9, 231), slope=0.3), ex(chirp, first=5, last=140), (0.1, ""),
     (-50, 50), 4, [delay(5.7 / 12000), interference(0.02, 377.3, (1, 0.4))], skip=0.1, about="delay of 5.7 rows, tone with second harmonic")
case("mode-creep", "ramberg-osgood", 0.13, 12000, 1000, ex(stairs, levels=6, ramp=0.02), ex(walk, knots=60, hold=0.3, spread=0.5), (0.06, ""), (0, 120), 29,
     [resonance(330, 0.03), creep([(0.04, 0.012), (0.04, 0.06)])], about="stairs ring a mode, then two relaxations")
case("lag-drift", "preisach-gauss", 0.12, 8000, 1000, ex(smooth, top=120, slope=0.3), ex(blocks, cycles=(3, 9, 28), shape="tri"), (0.12, "1/f"), (-20,
     130), 77, [lag(8 / 8000), drift(lambda t: 0.1 * (t - 0.5))], about="low-pass of first order, zero drifts along a line")
case("stop-drift", "bouc-wen", 0.11, 5000, 250, ex(walk, knots=50), ex(blocks, cycles=(5, 12), shape="tri"), (0.1, ""), (0, 100), 10, [stop(-0.75,
     None), drift(lambda t: 0.14 * t * t - 0.02 * t)], about="a hard stop at the lower end, zero drifts along a parabola", top=1.0)
case("bent-load", "preisach-lorentz", 0.10, 6000, 500, ex(multisine, rates=(3, 8.3, 19.1)), ex(decay, cycles=15), (0.1, ""), (0, 75), 23,
     [asymmetry(lambda y: y + 0.25 * (np.exp(0.9 * y) - 1 - 0.9 * y)), environment("load", gain=-0.05)], aux=("load", "plateaus", 0, 60), skip=0.12,
     about="exponential curve of the motion, load takes gain")
case("bent-creep", "coleman-hodgdon", 0.12, 9000, 100, ex(protocol, hold=0.13), ex(stairs, levels=6), (0.05, ""), (-30, 150), 55,
     [asymmetry(lambda u: u + 0.08 * (1 - u * u), of="u"), log_creep(0.09, 0.004, 0.2, of="u")],
     about="a square of the drive, creep by the logarithm")
case("rate-tone", "bristle", 0.14, 10000, 2000, ex(blocks, cycles=(1, 6, 35), shape="tri", rest=0.04), ex(walk, knots=50, spread=1.2), (0.08, ""), (0,
     100), 18, [rate_plays(0.25, 140, 0.5), interference(0.016, 163.7)], about="thresholds grow with the root of the rate, a tone")
case("rate-temperature", "two-groups", 0.16, 8000, 500, ex(walk, knots=60, spread=0.9), ex(blocks, cycles=(2, 10, 45), shape="tri"), (0.06, ""), (0,
     150), 100, [rate_width(lambda v: 0.42 * np.log10(1 + v / 5)), environment("temperature", zero=0.06, lagging=0.03)], aux=("temperature", "random",
     15, 40), about="opening by the logarithm of the rate, zero follows the temperature with a lag")
case("mode-stop", "jiles-atherton", 0.09, 14000, 14000, ex(raster, lines=(12, 45), rest=0.25), ex(blocks, cycles=(10, 40), shape="tri"), (0.1, ""),
     (0, 100), 6.5, [resonance(430, 0.02), stop(None, 0.72, of="u")], about="the raster rings a mode, the amplifier clips at the upper end", top=1.0)
case("creep-load", "pinning", 0.13, 9000, 200, ex(stairs, levels=9, mixed=True), ex(walk, knots=30, hold=0.4), (0.05, "12 bit"), (-100, 100), 44,
     [creep([(0.09, 0.02)]), environment("load", zero=-0.06)], aux=("load", "pulses", 10, 50), about="one relaxation, load compresses")
case("drift-tone", "tellinen", 0.11, 7000, 1000, ex(chirp, first=3, last=70), ex(smooth, top=25), (0.1, ""), (0, 60), 7,
     [drift(lambda t: 0.06 * np.exp(-t / 0.25)), interference(0.02, 271.0, (1, 0.3, 0.3))], about="zero settles, tone with harmonics")
case("lag-temperature", "dahl", 0.10, 10000, 2000, ex(walk, knots=200), ex(multisine, rates=(6, 27.7, 83.3), slope=0.3), (0.1, ""), (-20, 120), 36,
     [lag(9 / 10000, of="u"), environment("temperature", gain=-0.05)], aux=("temperature", "plateaus", 10, 45),
     about="amplifier lags, gain falls with temperature")
# faults without a name
case("unknown-telegraph", "stoner-wohlfarth", 0.10, 8000, 1000, ex(blocks, cycles=(4, 12, 25)), ex(walk), (0.1, ""), (0, 10), 2.5, [telegraph(0.045,
     0.02, 11)], about="the zero jumps between two values at random moments")
case("unknown-humidity", "preisach-moving", 0.12, 7000, 100, ex(walk, knots=80), ex(blocks, cycles=(12, 30)), (0.08, ""), (-60, 60), 26,
     [humid_gain(0.09, 5)], about="gain follows a humidity that nobody recorded")
case("unknown-knocks", "iwan", 0.13, 12000, 5000, ex(smooth, top=50), ex(blocks, cycles=(5, 15, 40)), (0.1, ""), (0, 100), 9, [knocks(0.16, 24, 480,
     0.03, 21)], about="knocks from outside at random moments ring down")
case("unknown-slips", "coleman-hodgdon", 0.09, 6000, 500, ex(blocks, cycles=(5, 14), shape="tri", low=True), ex(smooth, top=20), (0.08, ""), (0, 120),
     32, [slips(0.06, 16, 31)], about="the clamp slips to and fro at random moments")

MODELS = ["pi"] * 27 + ["preisach"] * 16 + ["maxwell-slip"] * 11 + ["bouc-wen"] * 10 + ["dpm"] * 2
for chosen, kind in zip(CASES, np.random.default_rng(1717).permutation(MODELS)):  # drawn without a look at law or effect
    chosen.model = str(kind)

# ---------------------------------------------------------------- records

def noise_of(n, spread, words, rng):
    """White noise or half its power as 1/f; a few spikes separately."""
    noise = rng.standard_normal(n)
    if "1/f" in words:
        spectrum = np.fft.rfft(rng.standard_normal(n))
        pink = np.fft.irfft(spectrum / np.sqrt(np.maximum(np.arange(len(spectrum)), 1)) * (np.arange(len(spectrum)) > 0), n)
        noise = np.sqrt(0.5) * noise + np.sqrt(0.5) * pink / pink.std()
    spikes = np.zeros(n)
    if "spikes" in words:
        at = rng.choice(n, 6, replace=False)
        spikes[at] = spread * rng.uniform(8, 15, 6) * rng.choice([-1, 1], 6)
    return spread * noise, spikes
def make_record(c, test):
    """Drive, surroundings, path before the record; everything that all variants of a record share."""
    seed = zlib.crc32(f"{c.name} {'test' if test else 'train'}".encode())
    rng = np.random.default_rng(seed)
    rows = int(c.rows * (c.share if test else 1))
    whole = int(rows / (1 - c.skip))
    u = (c.test if test else c.train)(whole, rng)
    u = np.concatenate([u, np.full(max(whole - len(u), 0), u[-1])])[:whole]
    first = whole - rows
    if test:
        u = c.top * u + c.lift
    turns = 0.97 ** np.arange(120) * np.where(np.arange(120) % 2, -1, 1) if rng.uniform() < 0.6 else np.array([-1.0, 1.0, -1.0])
    r = SimpleNamespace(u=u, first=first, before=turns, dt=1 / c.rows, t=(np.arange(whole) - first) / c.rows, test=int(test), aux=None)
    r.rng = rng
    if c.aux:
        for attempt in range(200):
            r.aux = surroundings(c.aux[1], whole, np.random.default_rng(seed + 1 + attempt)) * (0.85 if test else 1)
            r.r = np.corrcoef(r.aux[first:], u[first:])[0, 1]
            if abs(r.r) < 0.15:
                break
    return r
def simulate(c, r, law, effects):
    low, high = c.volts
    s = SimpleNamespace(t=r.t, dt=r.dt, u=r.u.copy(), aux=r.aux, test=r.test, origin=-(low + high) / (high - low))
    for stage in STAGES:
        if stage == "width":
            s.d = law(np.concatenate([r.before, s.u]))[len(r.before):]
        if stage == "motion":
            s.y = s.u + s.d
        for name, at, function in effects:
            if at == stage:
                function(s)
    return s.y[r.first:]
def columns_of_plays(u):
    return np.array([np.ones(len(u)), u, *(play(u, np.full(len(u), np.ptp(u) * k / 26)) for k in range(1, 13))]).T
def columns_of_relays(u):
    edges = np.linspace(u.min(), u.max(), 26)[1:-1]
    relays = [kernels(u, np.array([b]), np.array([a]), np.ones(1), 1e-9) for a in edges for b in edges if b <= a]
    return np.array([np.ones(len(u)), u, *relays]).T
def left(columns, y):
    return float(np.sqrt(np.mean((y - columns @ np.linalg.lstsq(columns, y, rcond=None)[0]) ** 2)))
def write(path, c, rate, u, y, aux):
    low, high = c.volts
    table = [np.arange(len(u)) / rate, low + (high - low) * (u + 1) / 2, y]
    head, form = "time_s,voltage_v,displacement_um", ["%.7g", "%.6g", "%.7g"]
    if c.aux:
        head += ",temperature_degc" if c.aux[0] == "temperature" else ",load_n"
        table.append(aux)
        form.append("%.6g")
    np.savetxt(path, np.array(table).T, delimiter=",", header=head, comments="", fmt=form)
def make_case(c, folder):
    law, part = make_law(c.law, zlib.crc32(f"{c.name} law".encode()), c.opening)
    marks, accept, figures, expect = [], [list(names) for names in c.accept], {}, sorted(name for name, *_ in c.effects)
    os.makedirs(folder, exist_ok=True)
    if not (0.05 <= c.opening <= 0.2 and part < 1.3):
        marks.append(f"!! opening {c.opening}, part {part:.2f}")
    for test in (False, True):
        r = make_record(c, test)
        twin = simulate(c, r, law, [])
        if not test:
            span = np.ptp(twin)
        spread = c.noise[0] / 100 * span
        noise, spikes = noise_of(len(twin), spread, c.noise[1], r.rng)
        step = 2.6 / 4096 if "12 bit" in c.noise[1] else 0
        sd = np.sqrt(np.var(noise) + step**2 / 12)
        u, aux = r.u[r.first:], None
        if c.aux:
            low, high = c.aux[2:]
            aux = (low + high) / 2 + (high - low) / 2 * r.aux[r.first:] + 0.002 * (high - low) * r.rng.standard_normal(len(u))
            if abs(r.r) >= 0.3:
                marks.append(f"!! r {r.r:.2f}")
        if np.abs(r.u).max() > 1.0001:
            marks.append(f"!! drive {np.abs(r.u).max():.2f}")
        for name, *rest_ in c.effects:
            alone = simulate(c, r, law, [(name, *rest_)]) - twin
            size, rest = alone.std() / sd, left(columns_of_plays(u), alone) / sd
            percent = 100 * alone.std() / span
            bad = size < 2.5 if test else size < 5 or rest < 4 or percent < (0.3 if name in ("drift", "interference") else 1)
            figures.setdefault(name, []).append(f"{size:6.1f} sd {percent:5.2f} % [{rest:5.1f}]{' !!' if bad else ''}")
            if not test and c.model in ("preisach", "dpm") and name in ("asymmetry", "saturation"):
                thin = np.linspace(0, len(u) - 1, min(len(u), 6000)).astype(int)
                rest = left(columns_of_relays(u)[thin], alone[thin]) / sd
                figures[name].append(f"relays [{rest:.1f}]")
                if rest < 4:
                    accept += [[n for n in names if n != name] for names in [expect, *accept]]
        whole = simulate(c, r, law, c.effects)
        for y, prefix in ((whole, ""), (twin, "twin-")):
            y = np.round((y + noise + spikes) / step) * step if step else y + noise + spikes
            write(f"{folder}/{prefix}{'test' if test else 'train'}.csv", c, c.rate, u, c.travel * (0.55 + 0.5 * y), aux)
    with open(f"{folder}/truth.json", "w") as file:
        json.dump(dict(expect=expect, accept=accept, base=c.law, model=c.model, about=c.about or "no effect"), file, indent=1)
    print(f"{c.id:24} {c.law:17} {c.model:13} part {part:4.2f} rows {len(u)} {' '.join(marks)} {accept or ''}", file=sys.stderr)
    for name, texts in figures.items():
        print(f"    {name:16} {' | '.join(texts)}", file=sys.stderr)
    sys.stderr.flush()

def main():
    folder, *prefixes = sys.argv[1:]
    begun = time.time()
    for c in CASES:
        if not prefixes or c.id.startswith(tuple(prefixes)):
            make_case(c, f"{folder}/{c.id}")
    print(f"{time.time() - begun:.0f} s", file=sys.stderr)

if __name__ == "__main__":
    main()
