"""A seventh independent examination: `python seventh.py OUT --seed N [--only x07,x12]` (needs numpy, scipy, numba).

Writes OUT/xNN-name/{train,test,twin-train,twin-test}.csv and truth.json, and prints one line per case. The twin is the same actuator with
the same drives and noise level, without the effects. Everything is computed at four times the rate of the record, in normalised units
(drive: half span or span = 1; output: range of the twin's train record = 1). Sizes of effects are set with a small fit of the case's kind
(16 play operators, or a KP grid of 12 levels): its remainder of the effect is 3 to 20 times the noise and at least 0.7 of its remainder of
the twin. The report gives both (n, M), the remainder of a finer fit, the rivals (~) that the train record cannot distinguish from the
effect, and SIZE! if the size was not reached; `bent` is the share of the twin's misfit that a static cubic explains.
"""
import argparse
import itertools
import json
import os

import numpy as np
from numba import njit
from scipy.interpolate import CubicSpline
from scipy.optimize import minimize_scalar, nnls
from scipy.signal import butter, cont2discrete, fftconvolve, filtfilt, lfilter

OVER = 4  # fine steps per row

# ---------------------------------------------------------------- operators


@njit(cache=True)
def play_sum(x, r, w, wide):
    """Weighted play operators with virgin memory; thresholds r times the factor wide[k]."""
    z, y = np.zeros(len(r)), np.empty(len(x))
    for k in range(len(x)):
        s = 0.0
        for i in range(len(r)):
            d = r[i] * wide[k]
            z[i] = min(max(z[i], x[k] - d), x[k] + d)
            s += w[i] * z[i]
        y[k] = s
    return y


@njit(cache=True)
def stop_sum(x, r, w, wide):
    """Weighted elasto-slip elements."""
    z, y, last = np.zeros(len(r)), np.empty(len(x)), 0.0
    for k in range(len(x)):
        s = 0.0
        for i in range(len(r)):
            d = r[i] * wide[k]
            z[i] = min(max(z[i] + x[k] - last, -d), d)
            s += w[i] * z[i]
        y[k], last = s, x[k]
    return y


@njit(cache=True)
def bent_plays(x, r, w, up, down):
    """Generalised plays with a separate quadratic envelope for each direction."""
    z, y = np.zeros(len(r)), np.empty(len(x))
    for k in range(len(x)):
        s = 0.0
        for i in range(len(r)):
            low, high = x[k] + up * x[k] ** 2 - r[i], x[k] + down * x[k] ** 2 + r[i]
            z[i] = min(max(z[i], low), max(high, low))
            s += w[i] * z[i]
        y[k] = s
    return y


@njit(cache=True)
def kp_sum(x, high, low, ridge, w):
    """Krasnosel'skii-Pokrovskii kernels; virgin memory is split along high = -low."""
    z = np.where(high + low > 0, -1.0, 1.0)
    y = np.empty(len(x))
    for k in range(len(x)):
        s = 0.0
        for i in range(len(w)):
            rise, fall = min(max((x[k] - high[i]) / ridge, -1), 1), min(max((x[k] - low[i]) / ridge, -1), 1)
            z[i] = min(max(z[i], rise), fall)
            s += w[i] * z[i]
        y[k] = s
    return y


@njit(cache=True)
def shape(kind, p, x):
    """Virgin curve of the stack laws: 1 power law of Rayleigh's type, 2 line and tanh."""
    if kind == 1:
        z = min(abs(x), 1.0)  # linear beyond half a span: thresholds up to there suffice
        return np.sign(x) * (p[0] * abs(x) + p[1] * (z ** p[2] + p[2] * (abs(x) - z)))
    return p[0] * x + np.tanh(p[1] * x)


@njit(cache=True)
def everett(table, top, a, b):
    """Bilinear interpolation of the integral of the relay density over low >= b, high <= a."""
    n = len(table) - 1
    i, j = (a + top) / (2 * top) * n, (b + top) / (2 * top) * n
    m, q = min(max(int(i), 0), n - 1), min(max(int(j), 0), n - 1)
    f, g = i - m, j - q
    return ((1 - f) * ((1 - g) * table[m, q] + g * table[m, q + 1]) + f * ((1 - g) * table[m + 1, q] + g * table[m + 1, q + 1]))


@njit(cache=True)
def virgin(kind, p, table, top, x):
    """First magnetisation curve."""
    if kind == 0:
        return np.sign(x) * everett(table, top, abs(x), -abs(x))
    return shape(kind, p, x)


@njit(cache=True)
def stack_law(x, kind, p, table, top):
    """Laws with wiping-out memory: 0 relays (Everett table), 1 Masing branches of a power law, 2 scaled tanh branches that close (Takacs)."""
    X, Y, n = np.zeros(4000), np.zeros(4000), 0
    y, last, now, d = np.empty(len(x)), 0.0, 0.0, 0.0
    for k in range(len(x)):
        v = x[k]
        step = np.sign(v - last)
        if step != 0 and step != d:
            if d != 0:
                n += 1
                X[n], Y[n] = last, now
            d = step
        while n >= 2 and (v - X[n - 1]) * d >= 0:
            n -= 2
        if n == 1 and abs(v) >= abs(X[1]):
            n = 0
        if n == 0:
            now = virgin(kind, p, table, top, v)
        elif kind == 0:
            now = Y[n] + d * 2 * everett(table, top, max(v, X[n]), min(v, X[n]))
        elif kind == 1:
            now = Y[n] + 2 * shape(1, p, (v - X[n]) / 2)
        else:
            goal, level = (X[n - 1], Y[n - 1]) if n > 1 else (-X[1], -Y[1])
            b, br, bg = shape(2, p, v - d * p[2]), shape(2, p, X[n] - d * p[2]), shape(2, p, goal - d * p[2])
            now = level + (Y[n] - level) * (b - bg) / (br - bg)
        y[k], last = now, v
    return y


@njit(cache=True)
def slope(kind, x, h, d, p):
    """dh/dx of the differential laws in direction d."""
    if kind == 0:  # Coleman-Hodgdon
        return d * p[0] * (p[1] * np.tanh(x / p[1]) - h) + p[2] / np.cosh(x / p[1]) ** 2
    if kind == 1:  # Tellinen (Duhem between two limiting curves)
        high, low = np.tanh((x + p[0]) / p[1]), np.tanh((x - p[0]) / p[1])
        return (high - h) / (high - low) * (1 - low * low) / p[1] if d > 0 else (h - low) / (high - low) * (1 - high * high) / p[1]
    if kind == 2:  # Bouc-Wen
        return (1 - abs(h) ** p[1] * (1 - p[2] + p[2] * d * np.sign(h))) / p[0]
    if kind == 3:  # Dahl
        return max(1 - d * h, 0.0) ** p[1] / p[0]
    field = (x + p[1] * h) / p[0]  # Jiles-Atherton
    if abs(field) < 1e-2:
        curve, rise = field / 3, 1 / 3
    else:
        curve, rise = 1 / np.tanh(field) - 1 / field, 1 / field**2 - 1 / np.sinh(field) ** 2
    gap = curve - h
    move = gap / (d * p[2] - p[1] * gap) if gap * d > 0 else 0.0
    return (1 - p[3]) * move + p[3] * rise / p[0]


@njit(cache=True)
def ode_law(x, kind, p):
    """Differential laws by midpoint steps of at most 1/1000 of the drive: independent of the rate."""
    h, last, y = 0.0, 0.0, np.empty(len(x))
    for k in range(len(x)):
        gap = x[k] - last
        if gap != 0:
            n, d = int(abs(gap) * 1000) + 1, np.sign(gap)
            e = gap / n
            for i in range(n):
                at = last + i * e
                h += e * slope(kind, at + e / 2, h + e / 2 * slope(kind, at, h, d, p), d, p)
        y[k], last = h, x[k]
    return y


@njit(cache=True)
def overstress(x, dt, a, v0, power):
    """Inner drive that lags by a (v/v0)^power, or by a asinh(v/v0) if power is 0; implicit steps."""
    e, y = x[0], np.empty(len(x))
    for k in range(len(x)):
        gap = x[k] - e
        lo, hi = 0.0, abs(gap) / dt
        for _ in range(45):
            v = (lo + hi) / 2
            if v * dt + a * ((v / v0) ** power if power > 0 else np.arcsinh(v / v0)) < abs(gap):
                lo = v
            else:
                hi = v
        e += np.sign(gap) * lo * dt
        y[k] = e
    return y


@njit(cache=True)
def reversals(x, least):
    """Returns the rows of reversals after a change of at least `least`."""
    out, d, peak = np.zeros(len(x)), 0, x[0]
    for k in range(len(x)):
        if d == 0 and abs(x[k] - x[0]) > least:
            d, peak = (1 if x[k] > x[0] else -1), x[k]
        elif d != 0 and (x[k] - peak) * d > 0:
            peak = x[k]
        elif d != 0 and (peak - x[k]) * d > least:
            out[k], d, peak = 1, -d, x[k]
    return out


# ---------------------------------------------------------------- laws


def relay_table(rng, heavy):
    """Returns the Everett table of a symmetric relay density: lognormal x Gauss, or Lorentz x Lorentz."""
    top, n = 2.2, 240
    g = (np.arange(n) + 0.5) / n * 2 * top - top
    a, b = np.meshgrid(g, g, indexing="ij")
    width, centre = np.maximum((a - b) / 2, 1e-3), (a + b) / 2
    if heavy:
        m, s, q = rng.uniform(0.12, 0.3), rng.uniform(0.08, 0.2), rng.uniform(0.4, 0.8)
        mu = 1 / (1 + ((width - m) / s) ** 2) / (1 + (centre / q) ** 2)
    else:
        m, s, q = rng.uniform(0.18, 0.32), rng.uniform(0.45, 0.8), rng.uniform(0.4, 0.7)
        mu = np.exp(-0.5 * (np.log(width / m) / s) ** 2 - 0.5 * (centre / q) ** 2)
    mu *= np.where(a > b, 1.0, 0.0) + 0.5 * (np.abs(a - b) < 1e-9)
    table = np.zeros((n + 1, n + 1))
    table[1:, :-1] = np.cumsum(np.cumsum(mu[:, ::-1], axis=1)[:, ::-1], axis=0)
    return table / table[n, 0], top


def make_law(name, rng, amp, bipolar):
    """A law h(x, wide); `wide` scales the thresholds of plays and stops, other laws ignore it."""
    half = 1 / amp  # drives of half span 1
    full = half if bipolar else 1.0  # laws that saturate: unipolar drives stay on one side of a span of 2
    u = rng.uniform
    one = np.ones(1)
    r = np.linspace(0, 0.95, 40)
    wides = lambda x, wide: np.ones(len(x)) if wide is None else wide
    if name in ("play-exp", "play-bump", "maxwell"):
        if name == "play-exp":
            w = np.exp(-r / u(0.15, 0.4))
        elif name == "play-bump":
            w = np.exp(-(((r - u(0.2, 0.42)) / u(0.08, 0.16)) ** 2)) + 0.15 * np.exp(-r / 0.1)
        else:
            w = np.append(0, r[1:] ** -u(0.2, 0.9)) * (1 - 0.8 * r)
        w, k = w / w.sum(), u(0.7, 1.6)
        if name == "maxwell":
            return lambda x, wide=None: (1.1 + k) * half * x - stop_sum(half * x, r, w, wides(x, wide))
        return lambda x, wide=None: k * half * x + play_sum(half * x, r, w, wides(x, wide))
    if name == "gpi":
        bend, w, k, s = u(0.2, 0.45), np.exp(-r / u(0.12, 0.3)), u(0.8, 1.5), u(0.8, 1.0)
        w /= w.sum()
        bent = lambda x: s * full * x * (1 + bend * (s * full * x) ** 2)
        return lambda x, wide=None: k * bent(x) + play_sum(bent(x), r * (1 if bipolar else 0.5), w, wides(x, wide))
    if name in ("relay-gauss", "relay-lorentz"):
        table, top = relay_table(rng, name == "relay-lorentz")
        k = u(0.25, 0.6)
        return lambda x, wide=None: k * full * x + stack_law(full * x, 0, one, table, top)
    if name == "kp":
        g = np.linspace(-1.15, 1.15, 15)
        i, j = np.tril_indices(len(g))
        hi, lo = g[i], g[j]
        w = np.exp(-0.5 * (((hi - lo) / 2 - u(0.1, 0.3)) / u(0.12, 0.25)) ** 2 - 0.5 * ((hi + lo - u(-0.3, 0.3)) / 1.3) ** 2) * u(0.6, 1.4, len(hi))
        w, ridge, k = w / w.sum(), u(0.13, 0.25), u(0.2, 0.5)
        return lambda x, wide=None: k * full * x + kp_sum(full * x, hi, lo, ridge, w)
    if name in ("rayleigh", "takacs"):
        rayleigh = name == "rayleigh"
        p = np.array([1.0, u(0.2, 0.5), u(1.5, 2.6)] if rayleigh else [u(0.3, 0.6), u(1.0, 1.7), u(0.12, 0.25)])
        table = np.zeros((2, 2))
        scale = half if rayleigh else full
        return lambda x, wide=None: stack_law(scale * x, 1 if rayleigh else 2, p, table, 1.0)
    if name == "coleman-hodgdon":
        p = np.array([u(2, 4.5), u(1.8, 3.5), u(0.5, 0.75)])
        return lambda x, wide=None: ode_law(half * x, 0, p)
    if name == "tellinen":
        p, k = np.array([u(0.12, 0.28), u(0.6, 0.95)]), u(0.15, 0.4)
        return lambda x, wide=None: k * full * x + ode_law(full * x, 1, p)
    if name == "bouc-wen":
        p, k = np.array([u(0.25, 0.6), u(1.0, 2.2), u(0.5, 0.9)]), u(2.0, 3.0)
        return lambda x, wide=None: k * half * x - p[0] * ode_law(half * x, 2, p)
    if name == "dahl":
        p, q, k = np.array([u(0.12, 0.3), u(0.8, 1.6)]), np.array([u(0.4, 0.8), u(0.8, 1.6)]), u(2.6, 3.6)
        return lambda x, wide=None: k * half * x - p[0] * ode_law(half * x, 3, p) - q[0] * ode_law(half * x, 3, q)
    if name == "jiles-atherton":
        p, k = np.array([u(0.3, 0.5), u(0.02, 0.15), u(0.15, 0.3), u(0.1, 0.3)]), u(0.15, 0.35)
        return lambda x, wide=None: k * full * x + ode_law(full * x, 4, p)
    assert name == "mixture", name
    first, second = make_law("play-exp", rng, amp, bipolar), make_law("bouc-wen", rng, amp, bipolar)
    s = u(0.4, 0.7)
    return lambda x, wide=None: s * first(x, wide) + (1 - s) * second(x)


# ---------------------------------------------------------------- drives: a segment is (x of time, rows, rows before the record)


def triangle(phase):
    """Returns a triangle with the phase of a sine."""
    return 2 / np.pi * np.arcsin(np.sin(phase))


def rest(c, a):
    """Returns the phase at which c + a sin is at, or nearest to, the rest position 0."""
    return np.arcsin(np.clip(-c / a, -1, 1))


def path(times, levels, smooth=False):
    """Piecewise linear (or smooth) function through levels, held at both ends."""
    def course(t):
        if not smooth:
            return np.interp(t, times, levels)
        i = np.clip(np.searchsorted(times, t, "right") - 1, 0, len(times) - 2)
        s = np.clip((t - times[i]) / (times[i + 1] - times[i]), 0, 1)
        return levels[i] + (levels[i + 1] - levels[i]) * s * s * (3 - 2 * s)
    return course


def drive(kind, rng, o, test):
    """Returns the segments of one record; the test has other amplitudes, frequencies, levels or another sequence."""
    c, A, n, fs, mid, f = o["c"], o["A"], o["n"], o["fs"], o["mid"], np.atleast_1d(o.get("f", 1.0)).astype(float)
    D, u = n / fs, rng.uniform
    turn = lambda: u(0, 2 * np.pi)
    wave = lambda form, f, a, m, ph: lambda t: m + a * form(2 * np.pi * f * t + ph)
    if kind == "sine":
        f, a = (f[0] * (u(0.5, 0.7) if test else 1)), A * (u(0.65, 0.85) if test else 1)
        m = c if mid else c - A + a if c > 0 else c
        return [(wave(np.sin, f, a, m, turn() if mid else rest(m, a)), n, int(2.3 * fs / f) if mid else 0)], f
    if kind in ("sines", "afm"):
        form = np.sin if kind == "sines" else triangle
        sizes = np.atleast_1d(o.get("sizes", [1.0, 0.7, 0.4]))
        pairs = [(q, s) for s in sizes for q in f] if o.get("cross", True) else list(zip(f, sizes))
        if test:
            best = 1 if o.get("top") else u(0.85, 0.97)
            pairs = [(q * u(0.6, 0.85), best if s == max(sizes) else s * u(0.75, 0.9)) for q, s in pairs]
            first = {0, len(f) - 1}  # the largest size and the fastest drive stay in the test
            others = rng.permutation([i for i in range(len(pairs)) if i not in first])
            pairs = [pairs[i] for i in rng.permutation([*first, *others[: max(2, len(pairs) * 2 // 3) - len(first)]])]
        rows = np.array([q**-0.6 for q, _ in pairs])
        rows = np.maximum(rows / rows.sum() * n, [2.1 * fs / q for q, _ in pairs]).astype(int)
        segments = []
        for (q, s), k in zip(pairs, rows):
            a = A * s
            m = c + (u(-1, 1) if o.get("shift") else (-1 if c > 0 and not mid else 0)) * (A - a)
            segments.append((wave(form, q, a, m, turn() if mid else rest(m, a)), k, int(2.2 * fs / q) if mid else 0))
        return segments, max(q for q, _ in pairs)
    if kind == "chirp":
        lo, hi = f[0] * (u(1.0, 1.3) if test else 1), f[1] * (u(0.8, 1.0) if test else 1)
        down = bool(test) != bool(o.get("down"))
        segments = []
        for a in np.array(o.get("sizes", [1.0])) * A * (u(0.7, 0.85) if test else 1):
            k = n // len(o.get("sizes", [1.0]))
            T = k / fs
            m = c if mid else c - A + a if c > 0 else c
            ph = turn() if mid else rest(m, a)
            b = np.log(hi / lo) / T

            def x(t, a=a, m=m, ph=ph, b=b, T=T):
                up = lambda s: 2 * np.pi * lo * np.where(s > 0, np.expm1(b * np.maximum(s, 0)) / b, s)
                over = lambda s: np.where(s > T, 2 * np.pi * hi * (s - T), 0)
                return m + a * np.sin(ph + (up(np.full(1, T)) - up(np.minimum(T - t, T)) - over(T - t) if down else up(t)))
            segments.append((x, k, int(1.8 * fs / (hi if down else lo)) if mid else 0))
        return segments, hi
    if kind == "multisine":
        k = int(rng.integers(5, 10))
        q, ph, w = np.exp(u(np.log(f[0]), np.log(f[1]), k)), u(0, 2 * np.pi, k), u(0.4, 1, k)
        w = w * q**-o.get("tilt", 0.3)
        total = lambda t: sum(wi * np.sin(2 * np.pi * qi * t + pi) for wi, qi, pi in zip(w, q, ph))
        used = total(np.arange(n) / fs)
        middle, top = (used.max() + used.min()) / 2, np.ptp(used) / 2 / (u(0.8, 0.93) if test else 1)
        start = 0 if mid else D * 0.04
        ease = lambda t: 1 if mid else np.clip(t / start, 0, 1) ** 2 * (3 - 2 * np.clip(t / start, 0, 1))
        return [(lambda t: ease(t) * (c + A / top * (total(t) - middle)), n, n // 4 if mid else 0)], q.max()
    if kind == "noise":
        q = f[0] * (u(0.75, 0.95) if test else 1)
        size = int(n * 1.35) + 40
        num, den = butter(2, min(q / (fs / 2), 0.8))
        s = filtfilt(num, den, rng.standard_normal(size))
        used = s[int(0.32 * n) : int(1.32 * n)]
        s = (s - (used.max() + used.min()) / 2) * 2 * A / np.ptp(used) * (u(0.8, 0.95) if test else 1)
        spline = CubicSpline((np.arange(size) - int(0.32 * n)) / fs, s)
        start = 0 if mid else D * 0.03
        ease = lambda t: 1 if mid else np.clip(t / start, 0, 1)
        return [(lambda t: ease(t) * (c + spline(t)), n, int(0.3 * n) if mid else 0)], q
    if kind == "decay":
        q, least = f[0] * (u(0.65, 0.85) if test else 1), u(0.06, 0.12)
        grow = bool(test) != bool(o.get("grow"))
        age = lambda t: np.clip((t - (0 if grow else 1.5 / q)) / (D - 1.5 / q), 0, 1)
        size = lambda t: A * (least + (1 - least) * age(t) if grow else least ** age(t))
        back, ph = (1.6 * fs / q, turn()) if mid else (0, 0)
        ease = lambda t: 1 if mid else np.clip(t * q, 0, 1)
        return [(lambda t: ease(t) * (c + size(t) * np.sin(2 * np.pi * q * t + ph)), n, int(back))], q
    if kind == "stairs":
        k, slew = int(rng.integers(7, 11)), o.get("slew", 0.03)
        levels = np.r_[np.linspace(0, 1, k), np.linspace(1, 0.1, k - 2)[1:], np.linspace(0.1, 0.8, k - 3)[1:]]
        levels = c - A + 2 * A * np.clip(levels + u(-0.03, 0.03, len(levels)), 0, 1)
        if test or o.get("random"):
            levels = c + A * u(-1, 1, len(levels) - (3 if test else 0))
        if not test and o.get("random"):
            levels[[1, 4]] = c - A, c + A
        levels = np.r_[0, levels]
        hold = D / len(levels)
        at = np.arange(1, len(levels)) * hold
        at = at + hold * u(-0.2, 0.2, len(at)) if test or o.get("random") else at
        times = np.r_[-1e-9, np.column_stack([at, at + slew * hold]).ravel()]
        return [(path(times, np.repeat(levels, 2)[:-1], True), n, 0)], 1 / (np.pi * slew * hold)
    if kind == "walk":
        k = int(f[0] * D * (u(0.6, 0.8) if test else 1))
        gaps = u(0.4, 1.6, k) if not mid else u(0.4, 1.6, k + 4)
        held = o.get("held", 0.3)
        levels, times, x, t = [0.0 if not mid else c], [0.0], 0.0, 0.0
        for i, gap in enumerate(gaps):
            x = np.clip(x + A * u(-1.3, 1.3), c - A, c + A) if rng.random() < 0.8 else c + A * rng.choice([-1, 1]) * u(0.85, 1)
            if not test and i in (len(gaps) // 3, len(gaps) // 2):  # the train record reaches both ends
                x = c - A if i == len(gaps) // 3 else c + A
            t += gap * (1 - held)
            levels.append(x), times.append(t)
            if held and rng.random() < 0.7:
                t += gap * held
                levels.append(x), times.append(t)
        times = np.array(times)
        times *= D * (1.3 if mid else 1) / times[-1]
        levels = np.array(levels)
        if not mid:
            return [(path(times, levels), n, 0)], f[0]
        return [(lambda t: np.interp(t + 0.28 * D, times, levels), n, int(0.25 * n))], f[0]
    assert kind == "forc", kind
    k = int(rng.integers(8, 13)) - (3 if test else 0)
    low = np.linspace(0.85, 0, k) if not test else rng.permutation(np.linspace(0.8, 0.07, k))
    high = np.ones(k) if not test else u(0.82, 0.97, k)
    levels = c - A + 2 * A * np.r_[(A - c) / (2 * A), high[0], np.column_stack([low, high]).ravel()]
    times = np.r_[0, np.cumsum(np.abs(np.diff(levels)))]
    return [(path(times * D / times[-1], levels), n, 0)], len(levels) / D


class Record:
    """Returns times and drive of one record, rows and fine steps, with temperature and load as functions of absolute time."""

    def __init__(self, kind, rng, o, test, clock):
        self.rng_key, self.o = int(rng.integers(1 << 31)), o
        segments, self.fast = drive(kind, rng, o, test)
        fs = o["fs"]
        self.dt, self.parts, begin = 1 / fs, [], round(clock * fs) / fs
        self.start = begin
        for x, rows, before in segments:
            rel = np.arange(-before * OVER, (rows - 1) * OVER + 1) / (fs * OVER)
            fine = np.asarray(x(rel), dtype=float)
            self.parts.append((begin + rel, fine, before * OVER))
            begin += (rows + int(rng.uniform(0.05, 0.15) * rows) + 1) / fs
        self.t = np.concatenate([t[b::OVER] for t, _, b in self.parts])
        self.x = np.concatenate([x[b::OVER] for _, x, b in self.parts])
        self.segment = np.concatenate([np.full(len(t[b::OVER]), i) for i, (t, _, b) in enumerate(self.parts)])
        self.mid = o["mid"]
        span = self.t[-1] - self.start
        p, a, ph = span * rng.uniform(0.2, 0.65, 3), rng.uniform(0.4, 1, 3), rng.uniform(0, 2 * np.pi, 3)
        course = lambda t: np.sin(2 * np.pi * np.subtract.outer(t, self.start)[..., None] / p + ph) @ a
        swing, base = rng.uniform(6, 18) / np.ptp(course(np.linspace(self.start, self.start + span, 300))), rng.uniform(21, 26)
        self.heat = lambda t: base + swing * course(t)
        k = int(rng.integers(9, 15))
        levels, at = o["force"] * rng.uniform(0, 1, k), self.start + span * np.sort(rng.uniform(0, 1, k - 1))
        q = rng.uniform(0.11, 0.23) * self.fast if o["load"] == "sine" else 0
        if o["load"] == "sine":
            self.push = lambda t: o["force"] * (0.5 + 0.5 * np.sin(2 * np.pi * q * t + ph[0]))
        else:
            self.push = lambda t: np.interp(t, np.sort(np.r_[at, at + 0.01 * span]), np.repeat(levels, 2)[1:-1])


# ---------------------------------------------------------------- effects


def smooth(x, dt, tau):
    """First-order low-pass, at rest at the beginning."""
    q = np.exp(-dt / tau)
    return lfilter([1 - q], [1, -q], x - x[0]) + x[0]


def rate_of(x, dt):
    """Returns the absolute rate, smoothed over two rows."""
    return smooth(np.abs(np.gradient(x, dt)), dt, 2 * OVER * dt)


def law_of_rate(v, e):
    """Returns a power or the logarithm of the rate divided by the slow reference rate."""
    return (v / e["v0"]) ** e["power"] if e["power"] > 0 else np.log1p(v / e["v0"])


def chain(case, record, effects):
    """Returns the output without noise, in ranges of the twin's train record. Effects act in the order of the chain."""
    has = {(e["name"], e["kind"]): e for e in effects}
    by = lambda name, *kinds: next((has[name, k] for k in kinds if (name, k) in has), None)
    parts, span = [], case["duration"]
    rng = np.random.default_rng(record.rng_key)
    whole = record.t[-1] - record.start
    for t, x, before in record.parts:
        dt, drive_x, wide = t[1] - t[0], x, None
        if e := by("delay", "pure"):
            x = np.interp(t - e["a"] * case["tref"], t, x)
        if e := by("lag", "amplifier"):
            x = smooth(x, dt, e["a"] * case["tref"])
        if e := by("rate-dependence", "overstress"):
            x = overstress(x, dt, e["a"], e["v0"], e["power"])
        if e := by("rate-dependence", "thresholds"):
            wide = 1 + e["a"] * law_of_rate(rate_of(x, dt), e)
        y = case["law"](x, wide) / case["range"]
        if e := by("asymmetry", "branches"):
            z, r = x / case["A"], np.linspace(0.03, 0.8, 14)
            w = np.exp(-r / 0.3) / np.exp(-r / 0.3).sum() / 2
            y = y + e["a"] * bent_plays(z, r, w, -e["up"] / 2, -e["down"] / 2)
        if e := by("asymmetry", "electrostriction"):
            y = y + e["a"] * y * y
        if e := by("rate-dependence", "width"):
            y = y + e["a"] * law_of_rate(rate_of(x, dt), e) * (y - case["chord"] * x)
        if e := by("temperature", "gain", "zero", "width", "both"):
            warm = record.heat(t)
            warm = (smooth(warm, dt, e["lag"] * span) if e["lag"] else warm) - 23
            warm = warm * e["a"] / 10
            y = {"gain": y * (1 + warm), "zero": y + warm, "both": y * (1 + warm) - 0.6 * warm, "width": y + warm * (y - case["chord"] * x)}[e["kind"]]
        if e := by("creep", "log", "exponentials", "power"):
            s = np.arange(len(y)) * dt
            kernel = {
                "log": lambda s: np.log10(1 + s / (e["fast"] * span)) / np.log10(1 + 1 / e["fast"]),
                "power": lambda s: (s / span) ** e["fast"],
                "exponentials": lambda s: sum(w * -np.expm1(-s / (q * span)) for w, q in zip(e["weights"], e["taus"])),
            }[e["kind"]](s)
            y = y + e["a"] * fftconvolve(np.diff(y, prepend=y[0]), kernel)[: len(y)]
        if e := by("load", "spring", "softening"):
            force = record.push(t) / case["force"]
            y = y - e["a"] * force * (1 if e["kind"] == "spring" else 0.5 + 0.8 * y)
        if e := by("resonance", "mode"):
            w = 2 * np.pi * e["f0"]
            num, den, _ = cont2discrete(([1.0], [1 / w**2, 2 * e["zeta"] / w, 1]), dt, method="foh")
            y = y + e["a"] * (lfilter(num.ravel(), den, y - y[0]) - (y - y[0]))
        if e := by("saturation", "hard", "soft"):
            for sign, edge in ((1, case["high"]), (-1, -case["low"])):
                if sign > 0 or e["both"]:
                    over = np.maximum(sign * y - (edge - e["a"]), 0)
                    y = y - sign * over if e["kind"] == "hard" else y - sign * (over + 0.5 * e["a"] * np.expm1(-over / (0.5 * e["a"])))
        if e := by("lag", "sensor"):
            y = smooth(y, dt, e["a"] * case["tref"])
        if e := by("drift", "line", "settling", "sqrt"):
            s = np.maximum(t, 0) / span
            y = y + e["a"] * e["sign"] * {"line": s, "sqrt": np.sqrt(s), "settling": -np.expm1(-s / e["tau"])}[e["kind"]]
        if e := by("interference", "mains", "tone"):
            y = y + e["a"] * sum(w * np.sin(2 * np.pi * k * e["f"] * t + p) for k, w, p in e["tones"])
        if e := by("unknown", "slips", "telegraph", "wander", "backlash", "contact"):
            s = (t - record.start) / whole
            if e["kind"] == "wander":
                gen = np.random.default_rng(record.rng_key)
                knots = np.linspace(-0.4, 1.05, 22)
                y = y * (1 + e["a"] * CubicSpline(knots, gen.standard_normal(22))(s))
            elif e["kind"] == "backlash":
                at = np.flatnonzero(reversals(drive_x, 0.05 * case["A"]))
                jumps = rng.choice([-1, 1], len(at) + 1) * rng.uniform(0.3, 1, len(at) + 1)
                y = y + e["a"] * smooth(jumps[np.searchsorted(at, np.arange(len(t)), "right")], dt, 2 * OVER * dt)
            else:
                gen = np.random.default_rng(record.rng_key)
                k = {"slips": 14, "telegraph": 40, "contact": 16}[e["kind"]]
                at, size = np.sort(gen.uniform(0, 1, k)), gen.uniform(0.4, 1, k) * gen.permutation(np.resize([-1, 1], k))
                level = np.r_[0, np.cumsum(size)] if e["kind"] == "slips" else np.resize([0.0, 1.0], k + 1)
                level = level[np.searchsorted(at, s, "right")]
                y = y * (1 + e["a"] * level) if e["kind"] == "contact" else y + e["a"] * level
        parts.append(y[before::OVER])
    return np.concatenate(parts)


# smallest size of interest, first and largest plausible size of each effect (delay and lag: over 1/(2 pi f) of the fastest tone; temperature: per 10 K)
SIZES = {
    "delay": (0.02, 0.08, 1.2), "lag": (0.02, 0.08, 1.2), "rate-dependence": (0.004, 0.03, 4.0), "creep": (0.01, 0.03, 0.5), "resonance": (0.01, 0.2, 1.0),
    "temperature": (0.005, 0.03, 2.5), "load": (0.005, 0.03, 0.5), "asymmetry": (0.02, 0.05, 1.5), "saturation": (0.05, 0.06, 0.4), "drift": (0.005, 0.02, 0.6),
    "interference": (0.0015, 0.004, 0.2), "unknown": (0.003, 0.01, 0.5),
}


def make_effect(name, kind, rng, o, record):
    """Draws the parameters of an effect except its size."""
    u, e = rng.uniform, dict(name=name, kind=kind)
    if name == "rate-dependence":
        rate = np.abs(np.gradient(record.x, record.t))
        e |= dict(power=o["power"], v0=max(np.quantile(rate, 0.2), 1e-3 * rate.max()))
    if name == "temperature":
        e |= dict(lag=o.get("thermal", 0) * u(0.8, 1.2))
    if name == "creep":
        fast = dict(log=np.exp(u(np.log(5e-4), np.log(5e-3))), power=u(0.15, 0.35)).get(kind, 0)
        taus = [u(0.01, 0.02), u(0.06, 0.12), u(0.3, 0.6)][: o.get("terms", 3)]
        weights = u(0.5, 1, len(taus))
        e |= dict(fast=fast, taus=taus, weights=list(weights / weights.sum()))
    if name == "resonance":
        e |= dict(f0=o["f0"] * u(0.85, 1.15), zeta=u(0.012, 0.06))
    if name == "saturation":
        e |= dict(both=o.get("both", False))
    if name == "asymmetry":
        e |= dict(up=u(0.2, 0.5), down=-u(0.2, 0.5))
    if name == "drift":
        e |= dict(sign=rng.choice([-1, 1]), tau=u(0.15, 0.35))
    if name == "interference":
        mains = rng.choice([50, 60]) + u(-0.05, 0.05)
        tones = [(1, 1.0, u(0, 6.28))] + [(k, w * u(0.6, 1.2), u(0, 6.28)) for k, w in o.get("harmonics", {}).items()]
        e |= dict(f=mains if kind == "mains" else o["tone"] * u(0.85, 1.15), tones=tones)
    return e


# ---------------------------------------------------------------- a small fit


class Fit:
    """Linear least squares on play operators or a KP grid: `left` is the remainder of a signal (RMS), with optional extra columns."""

    def __init__(self, record, o, model, plays=16, levels=12):
        c, A = o["c"], o["A"]
        columns = [np.ones(len(record.x)), record.x]
        begins = np.flatnonzero(np.r_[True, np.diff(record.segment) > 0])
        cut = lambda run: np.concatenate([run(part) for part in np.split(record.x, begins[1:])])
        if model == "pi":
            for r in A * np.linspace(0.03, 0.92, plays):
                columns.append(cut(lambda x, r=r: play_sum(x, np.array([r]), np.ones(1), np.ones(len(x)))))
        else:
            g = c + A * np.linspace(-1, 1, levels)
            ridge = g[1] - g[0]
            for i, j in zip(*np.tril_indices(levels)):
                columns.append(cut(lambda x, i=i, j=j: kp_sum(x, g[i : i + 1], g[j : j + 1], ridge, np.ones(1))))
        keep = np.ones(len(record.x), bool)
        if record.mid:
            for b, e in zip(begins, np.r_[begins[1:], len(keep)]):
                keep[b : b + (e - b) // 4] = False
        rows = np.flatnonzero(keep)
        self.rows = rows[:: max(1, len(rows) // 5000)]
        self.matrix = np.column_stack(columns)[self.rows]
        self.basis = self.span(self.matrix)

    @staticmethod
    def span(matrix):
        matrix = matrix / (np.sqrt((matrix**2).mean(0)) + 1e-12)
        w, v = np.linalg.eigh(matrix.T @ matrix)
        return np.linalg.qr(matrix @ v[:, w > 1e-10 * w[-1]])[0]

    def left(self, y, extra=None):
        basis = self.basis if extra is None else self.span(np.column_stack([self.matrix, *(e[self.rows] for e in extra)]))
        y = y[self.rows]
        return float(np.sqrt(np.mean((y - basis @ (basis.T @ y)) ** 2)))


def rival_names(case, fit, e, signal, noise, twin_left):
    """Returns the effects that could replace e in this train record: the remainder of their best version is below a fifth of the noise
    or of the twin's misfit."""
    record, twin, name = case["train"], case["twin"], e["name"]
    least = max(0.2 * noise, 0.2 * twin_left)
    found = []
    others = {"delay": [("lag", "amplifier")], "lag": [("delay", "pure")], "rate-dependence": [("lag", "amplifier"), ("delay", "pure")]}.get(name, [])
    for other, kind in others:
        miss = lambda q: fit.left(twin + signal - chain(case, record, [dict(name=other, kind=kind, a=np.exp(q))]))
        at = min(np.linspace(-4.6, 0.7, 9), key=miss)
        if minimize_scalar(miss, bounds=(at - 0.7, at + 0.7), method="bounded", options=dict(xatol=2e-3)).fun < least:
            found.append(other)
    s = (record.t - record.start) / case["duration"]
    courses = [s, np.sqrt(np.maximum(s, 0)), np.exp(-s / 0.15), np.exp(-s / 0.35)]
    if (name == "creep" or (name == "temperature" and e["kind"] == "zero")) and fit.left(signal, courses) < least:
        found.append("drift")
    if name == "drift":
        slow = [chain(case, record, [dict(name="creep", kind="exponentials", a=1.0, weights=[1.0], taus=[q])]) - twin for q in (0.01, 0.03, 0.1, 0.3, 1.0)]
        rest_of = lambda y: y[fit.rows] - fit.basis @ (fit.basis.T @ y[fit.rows])
        shares, misfit = nnls(np.column_stack([rest_of(y) for y in slow]), rest_of(signal))
        if misfit / np.sqrt(len(fit.rows)) < least and shares.sum() < 0.6:  # creep only adds to the output
            found.append("creep")
    if name == "saturation" and fit.left(signal, [twin**2, twin**3]) < least:
        found.append("asymmetry")
    return found


# ---------------------------------------------------------------- noise and files


STEP = 1.3 / 4096  # of a 12-bit converter, in ranges


def add_noise(y, n, kind, rng):
    """Returns noise of total RMS n: white; `pink`: half of its power 1/f; `12bit`: with quantisation; `spikes`: also single wrong rows."""
    white = np.sqrt(n * n - STEP**2 / 12) if "12bit" in kind else n
    out = white * rng.standard_normal(len(y))
    if "pink" in kind:
        spectrum = np.fft.rfft(rng.standard_normal(len(y)))
        spectrum /= np.sqrt(np.maximum(np.arange(len(spectrum)), 1))
        pink = np.fft.irfft(spectrum, len(y))
        out = (out + white * pink / pink.std()) / np.sqrt(2)
    if "spikes" in kind:
        hit = rng.random(len(y)) < 0.002
        out[hit] += n * rng.uniform(15, 60, hit.sum()) * rng.choice([-1, 1], hit.sum())
    return np.round((y + out) / STEP) * STEP if "12bit" in kind else y + out


def write(path, record, case, y, rng):
    """Writes one CSV; the time in s, ms or us; temperature and load if the case records them."""
    unit, factor = case["clock"]
    decimals = max(0, int(np.ceil(-np.log10(record.dt * factor) + 3)))
    columns, formats = [], []
    if len(record.parts) > 1:
        columns, formats = [("segment", record.segment)], ["%d"]
    columns += [(f"time_{unit}", record.t * factor), ("voltage_v", case["volt"] * record.x)]
    formats += [f"%.{decimals}f", "%.5f"]
    out = case["um"] * case["sign"] * y + case["offset"]
    columns.append(("displacement_um", out))
    formats.append(f"%.{max(3, int(np.ceil(-np.log10(case['um'] * case['noise']) + 1.3)))}f")
    if case["with_heat"]:
        columns.append(("temperature_degc", record.heat(record.t) + 0.02 * rng.standard_normal(len(y))))
        formats.append("%.3f")
    if case["with_load"]:
        columns.append(("load_n", record.push(record.t) + 0.002 * case["force"] * rng.standard_normal(len(y))))
        formats.append("%.4f")
    np.savetxt(path, np.column_stack([c for _, c in columns]), fmt=formats, delimiter=",", header=",".join(k for k, _ in columns), comments="")


# ---------------------------------------------------------------- cases: law, kind of model, drive, rate (Hz), rows, span, effects, options

U, B, P = "unipolar", "bipolar", "partly"
CASES = {
    # no effect
    "x01-plain-sines": ("play-exp", "pi", "sines", 1000, 9000, U, [], dict(f=2.3, sizes=[1, 0.75, 0.5, 0.3])),
    "x02-plain-forc": ("relay-gauss", "preisach", "forc", 200, 5000, B, [], {}),
    "x03-plain-12bit": ("kp", "preisach", "stairs", 100, 6000, U, [], dict(noise="12bit")),
    "x04-plain-pink": ("coleman-hodgdon", "preisach", "decay", 500, 8000, B, [], dict(f=1.7, noise="pink")),
    "x05-plain-spikes": ("dahl", "pi", "afm", 5000, 12000, U, [], dict(f=[4, 13], sizes=[1, 0.5], noise="spikes")),
    "x06-plain-quiet": ("takacs", "preisach", "walk", 100, 6000, B, [], dict(f=1.1, quiet=True)),
    "x07-plain-negative": ("mixture", "pi", "multisine", 2000, 14000, U, [], dict(f=[0.7, 9], mid=True, sign=-1)),
    "x08-plain-short": ("jiles-atherton", "preisach", "sine", 50, 400, B, [], dict(f=0.43, mid=True)),
    "x09-plain-long": ("maxwell", "pi", "noise", 10000, 52000, B, [], dict(f=25, mid=True, idle="temperature")),
    "x10-plain-chirp": ("bouc-wen", "pi", "chirp", 4000, 16000, U, [], dict(f=[0.8, 30], noise="pink", idle="load", mid=True)),
    "x11-plain-rough": ("tellinen", "preisach", "sines", 250, 5000, B, [], dict(f=[0.6, 1.9], sizes=[1, 0.6, 0.35], noise="12bit spikes", sign=-1)),
    # one effect
    "x12-delay-chirp": ("play-bump", "pi", "chirp", 5000, 15000, U, [("delay", "pure")], dict(f=[1, 60], mid=True, least=0.15)),
    "x13-delay-sines": ("relay-lorentz", "preisach", "sines", 4000, 14000, B, [("delay", "pure")], dict(f=[2, 14, 90], sizes=[1, 0.6], idle="temperature", least=0.15)),
    "x14-delay-sine": ("rayleigh", "pi", "sine", 1000, 3000, B, [("delay", "pure")], dict(f=3.7, mid=True, accept=[["lag"], ["rate-dependence"], []])),
    "x15-lag-afm": ("kp", "preisach", "afm", 10000, 16000, U, [("lag", "amplifier")], dict(f=[3, 15, 75], sizes=[1, 0.6], least=0.15)),
    "x16-lag-multisine": ("play-exp", "pi", "multisine", 2000, 12000, B, [("lag", "amplifier")], dict(f=[0.5, 45], mid=True, least=0.15)),
    "x17-lag-sensor": ("bouc-wen", "pi", "chirp", 8000, 20000, P, [("lag", "sensor")], dict(f=[1, 150], sizes=[1, 0.5])),
    "x18-rate-power": ("play-exp", "pi", "sines", 1000, 12000, U, [("rate-dependence", "thresholds")], dict(f=[0.4, 3, 21], sizes=[1, 0.55], power=0.5)),
    "x19-rate-log": ("maxwell", "pi", "afm", 2000, 15000, B, [("rate-dependence", "thresholds")], dict(f=[0.6, 5, 40], sizes=[1, 0.5], power=0)),
    "x20-rate-overstress": ("relay-gauss", "preisach", "chirp", 2000, 20000, B, [("rate-dependence", "overstress")], dict(f=[0.3, 30], sizes=[1, 0.6], power=0.3)),
    "x21-rate-width": ("coleman-hodgdon", "preisach", "sines", 500, 10000, B, [("rate-dependence", "width")], dict(f=[0.25, 1.6, 10], sizes=[1, 0.6], power=0.4, idle="temperature")),
    "x22-rate-overlog": ("mixture", "pi", "afm", 3000, 16000, U, [("rate-dependence", "overstress")], dict(f=[0.8, 6, 45], sizes=[1, 0.5], power=0, noise="spikes")),
    "x23-creep-log": ("play-bump", "pi", "stairs", 50, 2600, U, [("creep", "log")], {}),
    "x24-creep-terms": ("relay-lorentz", "preisach", "stairs", 50, 9000, B, [("creep", "exponentials")], dict(random=True, noise="12bit")),
    "x25-creep-two": ("dahl", "pi", "sines", 50, 9000, U, [("creep", "exponentials")], dict(f=[0.04, 0.3], sizes=[1, 0.5, 0.3], shift=True, terms=2)),
    "x26-creep-power": ("takacs", "preisach", "walk", 100, 12000, B, [("creep", "power")], dict(f=0.35, held=0.7)),
    "x27-creep-afm": ("kp", "preisach", "afm", 50, 8000, U, [("creep", "log")], dict(f=[0.05, 0.4], sizes=[1, 0.6, 0.35], shift=True)),
    "x28-mode-chirp": ("play-exp", "pi", "chirp", 20000, 30000, U, [("resonance", "mode")], dict(f=[5, 650], f0=900, mid=True)),
    "x29-mode-steps": ("relay-gauss", "preisach", "stairs", 5000, 15000, B, [("resonance", "mode")], dict(slew=0.006, f0=420)),
    "x30-mode-afm": ("tellinen", "preisach", "afm", 20000, 20000, B, [("resonance", "mode")], dict(f=[7, 28, 61], sizes=[1, 0.6], f0=640)),
    "x31-mode-noise": ("gpi", "preisach", "noise", 10000, 40000, B, [("resonance", "mode")], dict(f=500, f0=700, mid=True, noise="pink")),
    "x32-heat-gain": ("play-bump", "pi", "walk", 50, 10000, U, [("temperature", "gain")], dict(f=0.5, mid=True)),
    "x33-heat-zero": ("coleman-hodgdon", "preisach", "sine", 50, 5000, U, [("temperature", "zero")], dict(f=0.21, mid=True)),
    "x34-heat-lagged": ("relay-lorentz", "preisach", "sine", 100, 16000, U, [("temperature", "gain")], dict(f=0.31, thermal=0.07, noise="12bit")),
    "x35-heat-width": ("maxwell", "pi", "multisine", 100, 12000, B, [("temperature", "width")], dict(f=[0.05, 0.9], mid=True)),
    "x36-heat-both": ("rayleigh", "pi", "decay", 50, 9000, U, [("temperature", "both")], dict(f=0.2, grow=True, thermal=0.05)),
    "x37-load-steps": ("gpi", "preisach", "forc", 200, 8000, U, [("load", "spring")], dict(load="steps")),
    "x38-load-sine": ("dahl", "pi", "noise", 1000, 12000, P, [("load", "softening")], dict(f=4, load="sine", mid=True)),
    "x39-bent-square": ("play-exp", "pi", "sines", 200, 2200, B, [("asymmetry", "electrostriction")], dict(f=1.3, sizes=[1, 0.75, 0.5, 0.25])),
    "x40-bent-branches": ("maxwell", "pi", "walk", 200, 10000, B, [("asymmetry", "branches")], dict(f=1.5)),
    "x41-clip-hard": ("play-bump", "pi", "sines", 1000, 3000, U, [("saturation", "hard")], dict(f=5, sizes=[1, 0.9, 0.7, 0.45], top=True, noise="12bit")),
    "x42-clip-soft": ("rayleigh", "pi", "decay", 1000, 9000, B, [("saturation", "soft")], dict(f=2.9, both=True, grow=True)),
    "x43-clip-both": ("relay-gauss", "preisach", "walk", 500, 14000, B, [("saturation", "hard")], dict(f=1.2, held=0.1, both=True)),
    "x44-drift-line": ("jiles-atherton", "preisach", "forc", 50, 3000, B, [("drift", "line")], {}),
    "x45-drift-settling": ("play-exp", "pi", "afm", 500, 12000, U, [("drift", "settling")], dict(f=[0.9, 4], sizes=[1, 0.7, 0.4], sign=-1)),
    "x46-drift-sqrt": ("kp", "preisach", "multisine", 100, 9000, B, [("drift", "sqrt")], dict(f=[0.15, 1.5], mid=True)),
    "x47-hum-harmonics": ("takacs", "preisach", "walk", 2000, 16000, B, [("interference", "mains")], dict(f=3, harmonics={2: 0.2, 3: 0.5, 5: 0.25}, mid=True)),
    "x48-hum-sine": ("dahl", "pi", "sine", 500, 5000, U, [("interference", "mains")], dict(f=3.37, mid=True)),
    "x49-tone-chirp": ("relay-lorentz", "preisach", "chirp", 20000, 20000, B, [("interference", "tone")], dict(f=[4, 80], tone=1730, mid=True, idle="load")),
    # two effects
    "x50-creep-heat": ("play-bump", "pi", "stairs", 50, 10000, U, [("creep", "log"), ("temperature", "gain")], dict(random=True)),
    "x51-mode-drift": ("relay-gauss", "preisach", "chirp", 4000, 24000, B, [("resonance", "mode"), ("drift", "line")], dict(f=[1, 400], f0=260)),
    "x52-lag-hum": ("rayleigh", "pi", "multisine", 2000, 14000, U, [("lag", "amplifier"), ("interference", "mains")], dict(f=[0.8, 37], harmonics={3: 0.4}, mid=True)),
    "x53-delay-creep": ("coleman-hodgdon", "preisach", "sines", 1000, 16000, B, [("delay", "pure"), ("creep", "exponentials")], dict(f=[0.5, 5, 33], sizes=[1, 0.6], shift=True)),
    "x54-heat-load": ("mixture", "pi", "walk", 100, 12000, U, [("temperature", "zero"), ("load", "spring")], dict(f=0.6, load="steps", mid=True)),
    "x55-drift-tone": ("kp", "preisach", "forc", 1000, 14000, U, [("drift", "settling"), ("interference", "tone")], dict(tone=87, sign=-1)),
    "x56-bent-creep": ("play-exp", "pi", "stairs", 100, 9000, B, [("asymmetry", "electrostriction"), ("creep", "exponentials")], dict(terms=2)),
    "x57-clip-hum": ("maxwell", "pi", "sines", 1000, 10000, P, [("saturation", "hard"), ("interference", "mains")], dict(f=2.13, sizes=[1, 0.85, 0.6, 0.4], top=True, mid=True)),
    "x58-load-drift": ("tellinen", "preisach", "decay", 100, 10000, B, [("load", "spring"), ("drift", "sqrt")], dict(f=0.37, load="sine")),
    "x59-rate-heat": ("relay-lorentz", "preisach", "chirp", 200, 20000, B, [("rate-dependence", "overstress"), ("temperature", "zero")], dict(f=[0.05, 4], sizes=[1, 0.6], power=0.4)),
    # unlisted disturbances
    "x60-slips": ("play-exp", "pi", "sine", 500, 8000, U, [("unknown", "slips")], dict(f=1.9, mid=True)),
    "x61-telegraph": ("relay-gauss", "preisach", "noise", 1000, 15000, B, [("unknown", "telegraph")], dict(f=6, mid=True)),
    "x62-hidden-heat": ("coleman-hodgdon", "preisach", "afm", 200, 12000, U, [("unknown", "wander")], dict(f=[0.7], sizes=[1, 0.5], mid=True)),
    "x63-backlash": ("bouc-wen", "pi", "multisine", 1000, 12000, B, [("unknown", "backlash")], dict(f=[0.8, 6])),
    "x64-contact": ("kp", "preisach", "decay", 500, 10000, U, [("unknown", "contact")], dict(f=2.2)),
}


def build(name, number, seed, out):
    """Draws, scales and writes one case. Returns its line of the report."""
    law, model, kind, fs, n, span, effects, o = CASES[name]
    rng = np.random.default_rng([seed, number])
    u = rng.uniform
    c, A = {U: (0.5, 0.5), B: (0.0, 1.0), P: (0.4, 0.6)}[span]
    o = dict(c=c, A=A, n=int(n * u(0.85, 1.15)), fs=fs, mid=False, load="steps", force=float(np.exp(u(np.log(2), np.log(80))))) | o
    if "f" in o:
        o["f"] = np.atleast_1d(o["f"]) * u(0.9, 1.1)
    case = dict(A=A, law=make_law(law, rng, A, span == B), force=o["force"], clock=[("s", 1.0), ("ms", 1e3), ("us", 1e6)][rng.choice(3, p=[0.6, 0.25, 0.15] if fs > 900 else [0.75, 0.25, 0])])
    case |= dict(volt=np.round(np.exp(u(np.log(5), np.log(200))) / (2 * A), 2), um=np.exp(u(0, np.log(150))), sign=o.get("sign", 1))
    case |= dict(offset=case["um"] * rng.choice([0, u(-0.5, 0.5)]), with_heat=False, with_load=False)
    names = [e for e, _ in effects]
    case["with_heat"] = "temperature" in names or o.get("idle") == "temperature"
    case["with_load"] = "load" in names or o.get("idle") == "load"
    train = case["train"] = Record(kind, rng, o, False, 0.0)
    goes_on = {"drift", "interference"} & set(names) and effects != [("drift", "settling")]  # a settling drift: both records start after switching on
    test = Record(kind, rng, o, True, (train.t[-1] * 1.02 + 1) if goes_on else 0.0)
    case |= dict(duration=train.t[-1] - train.start, tref=1 / (2 * np.pi * train.fast), range=1.0)
    raw = chain(case, train, [])
    case["range"] = np.ptp(raw)
    twin = case["twin"] = raw / case["range"]
    case |= dict(high=twin.max(), low=twin.min(), chord=np.polyfit(train.x, twin, 1)[0])
    fit = Fit(train, o, model)
    base = fit.left(twin)
    drawn = [make_effect(effect, form, rng, o, train) for effect, form in effects]
    least = [fit.left(chain(case, train, [e | dict(a=o.get("least", SIZES[e["name"]][0]))]) - twin) for e in drawn]
    noise = np.exp(u(np.log(3e-5), np.log(6e-4)))
    if "12bit" in o.get("noise", ""):
        noise = max(noise if effects else 0, u(1.05, 1.5) * STEP / 12**0.5)
    noise = max(noise, min(max(least, default=0) / 12, 1.2e-3), base / 40)
    goals = [max(u(4, 12) * noise, u(0.9, 1.5) * base) for _ in effects]
    if goals:
        noise = max(noise, max(goals) / 14)
        goals = [max(goal, u(3.6, 6) * noise) for goal in goals]
    if o.get("quiet"):
        noise = 1.5e-5
    case["noise"] = noise
    fine = Fit(train, o, model, 40, 22) if effects else None
    report, accept = [], [set(names)]
    for e, goal in zip(drawn, goals):
        effect, form = e["name"], e["kind"]
        _, e["a"], most = SIZES[effect]
        for _ in range(14):
            left = fit.left(chain(case, train, [e]) - twin)
            if 0.93 < left / goal < 1.07:
                break
            e["a"] = min(e["a"] * np.clip(goal / max(left, 1e-9), 0.25, 4), most)
        signal = chain(case, train, [e]) - twin
        seen = fine.left(signal) / noise
        rivals = rival_names(case, fit, e, signal, noise, base)
        accept = [s - {effect} | {r} for s in accept for r in [effect, *rivals]] + ([s - {effect} for s in accept] if seen < 2 else [])  # a finer model may explain it
        small = "" if left >= 3 * noise and left >= 0.7 * base and left <= 20 * noise else " SIZE!"
        report.append(f"{effect}/{form} a={e['a']:.4g} {left / noise:.1f}n {left / base:.1f}M fine {seen:.1f}n{small}{' ~' + ','.join(rivals) if rivals else ''}")
    accept = [sorted(s) for s in accept[1:]] + o.get("accept", [])
    centred = (train.x - c) / A
    flat = fit.left(twin, [centred**2, centred**3]) if model == "pi" else base
    bent = 1 - (flat / base) ** 2
    curved = {"asymmetry", "saturation"} - set(names)
    if bent > 0.3 and base > 2 * noise and "unknown" not in names:
        accept += [sorted({*s, b}) for s in [names, *accept] for b in sorted(curved)]
    accept = [list(s) for s in dict.fromkeys(tuple(s) for s in accept) if list(s) != sorted(names)]
    folder = f"{out}/{name}"
    os.makedirs(folder, exist_ok=True)
    for prefix, acting in (("", drawn), ("twin-", [])):
        for part, record in (("train", train), ("test", test)):
            y = add_noise(chain(case, record, acting), noise, o.get("noise", ""), rng)
            write(f"{folder}/{prefix}{part}.csv", record, case, y, rng)
    plain = lambda v: v.item() if isinstance(v, np.generic) else [plain(i) for i in v] if isinstance(v, (list, tuple)) else v
    details = [{k: plain(v) for k, v in e.items()} for e in drawn]
    for e in details:
        if e["name"] in ("delay", "lag"):
            e["seconds"] = e["a"] * case["tref"]
    loop = np.ptp(twin - case["chord"] * train.x)
    words = f"{law} under {kind} ({span}{', begins in mid-cycle' if o['mid'] else ''}), " + (" and ".join(f"{a}: {b}" for a, b in effects) or "no effect")
    truth = dict(expect=names, accept=accept, model=model, base=law, description=words + (f", {o['noise']}" if "noise" in o else ""), drive=kind, span=span,
                 rate_hz=fs, rows=len(train.x), volt_per_unit=float(case["volt"]), range_um=float(case["um"]), noise_um=float(case["um"] * noise),
                 misfit_of_small_fit_um=float(case["um"] * base), effects=details)
    with open(f"{folder}/truth.json", "w") as file:
        json.dump(truth, file, indent=1)
    extra = f" accept {accept}" if accept else ""
    return (f"{name:21} {law:15} {model:8} {kind:9} {fs:5} Hz {len(train.x):5}/{len(test.x):5} rows {len(train.parts)} seg {case['volt'] * 2 * A:5.0f} V {case['um']:5.1f} um "
            f"noise {noise:.1e} misfit {base:.1e} ({base / noise:4.1f}n) off line {loop:.2f} bent {bent:4.2f}  {'; '.join(report) or '-'}{extra}")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out")
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--only", default="")
    arguments = parser.parse_args()
    wanted = tuple(p for p in arguments.only.split(",") if p)
    for number, name in enumerate(CASES):
        if not wanted or name.startswith(wanted):
            print(build(name, number, arguments.seed, arguments.out), flush=True)


if __name__ == "__main__":
    main()
