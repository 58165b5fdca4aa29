"""Ninth set of examination cases: 72 simulated records of piezo actuators, each with effects that a diagnosis must name.

Usage: `python ninth.py OUTDIR` (numpy and scipy; a fixed seed, under two minutes on one core). It prints how much the effects change each record.
Hysteresis laws, effects and drives have separate equations here. Nothing was tuned to the program before the set was first scored.
"""
import json
import os
import sys
import time

import numpy as np
from scipy.signal import butter, cont2discrete, fftconvolve, lfilter, sosfilt

SEED = 90417

# ---------------------------------------------------------------------------------------------------------------------
# Hysteresis laws. The drive is scaled to -1 .. 1 (the range of the voltage). `law(x, rate)` returns the output per sample;
# `rate` is None, an array of factors on the coercive thresholds, or a tuple for domains with a viscous overstress.
# ---------------------------------------------------------------------------------------------------------------------


class Everett:
    """Memory of reversals and an Everett function: the exact Preisach operator of a continuous density."""

    floor = -1.6

    def __call__(self, x, rate=None):
        assert rate is None
        turns, values, rising, previous = [self.floor], [0.0], True, float(x[0])
        since, base, sign = np.empty(len(x)), np.empty(len(x)), np.empty(len(x))
        for i, u in enumerate(x.tolist()):
            if rising and u < previous:
                values.append(values[-1] + float(self.increment(previous, turns[-1])))
                turns.append(previous)
                rising = False
            elif not rising and u > previous:
                values.append(values[-1] - float(self.increment(turns[-1], previous)))
                turns.append(previous)
                rising = True
            if rising:
                while len(turns) > 2 and u >= turns[-2]:
                    del turns[-2:], values[-2:]
            else:
                while len(turns) > 2 and u <= turns[-2]:
                    del turns[-2:], values[-2:]
            since[i], base[i], sign[i], previous = turns[-1], values[-1], 1.0 if rising else -1.0, u
        return base + sign * self.increment(np.maximum(since, x), np.minimum(since, x))


class Rayleigh(Everett):
    """Rayleigh's law: a branch of a loop is a parabola in the distance from its reversal."""

    name = "rayleigh"

    def __init__(self, quadratic):
        self.quadratic = quadratic

    def increment(self, high, low):
        d = high - low
        return d + self.quadratic * d * d


class Domains(Everett):
    """Domains with gamma-distributed coercive thresholds and a uniformly distributed bias over (and beyond) the range."""

    name = "domain-switching"

    def __init__(self, shape, scale, share):
        c = np.linspace(0, 2, 2001)
        density = c ** (shape - 1) * np.exp(-c / scale)
        density /= density.sum()
        # a domain pair with half-width c adds (d - 2 c) to a branch of length d
        d = np.linspace(0, 4, 801)
        irreversible = np.maximum(d[:, None] - 2 * c[None, :], 0) @ density
        self.d, self.e = d, (1 - share) * d + share * 2 * irreversible / irreversible[400]

    def increment(self, high, low):
        return np.interp(high - low, self.d, self.e)


class Preisach(Everett):
    """Preisach plane with a density of (half-width, bias) and a reversible part."""

    def __init__(self, name, density, share):
        self.name = name
        n, end = 641, 1.6
        edges = np.linspace(-end, end, n)
        mid = (edges[1:] + edges[:-1]) / 2
        up, down = mid[:, None], mid[None, :]
        plane = np.where(up >= down, density((up - down) / 2, (up + down) / 2), 0.0)
        plane[np.diag_indices(n - 1)] *= 0.5
        table = np.zeros((n, n))
        # all with the upper threshold below the row's edge and the lower threshold above the column's edge
        table[1:, :-1] = np.cumsum(np.cumsum(plane, axis=0)[:, ::-1], axis=1)[:, ::-1]
        self.edge, self.step = edges[0], edges[1] - edges[0]
        self.table, self.reversible = table, 0.0
        scale = self.increment(1.0, -1.0)
        self.table, self.reversible = table * share / scale, (1 - share) / 2

    def increment(self, high, low):
        a, b = (np.asarray(high) - self.edge) / self.step, (np.asarray(low) - self.edge) / self.step
        i = np.clip(a.astype(int), 0, len(self.table) - 2)
        j = np.clip(b.astype(int), 0, len(self.table) - 2)
        p, q, t = a - i, b - j, self.table
        inner = (1 - p) * ((1 - q) * t[i, j] + q * t[i, j + 1]) + p * ((1 - q) * t[i + 1, j] + q * t[i + 1, j + 1])
        return inner + self.reversible * (high - low)


def preisach_gauss(share=0.45, width=0.28, spread=0.16, bias=0.25, breadth=0.6):
    return Preisach("preisach-gauss", lambda c, m: np.exp(-(((c - width) / spread) ** 2) / 2 - ((m - bias) / breadth) ** 2 / 2), share)


def preisach_lorentz(share=0.45, width=0.2, spread=0.2, bias=-0.3, breadth=0.7):
    return Preisach("preisach-lorentz", lambda c, m: 1 / (1 + ((c - width) / spread) ** 2) / (1 + ((m - bias) / breadth) ** 2), share)


def preisach_lognormal(share=0.5, width=0.25, spread=0.6, tilt=0.35):
    def density(c, m):
        c = np.maximum(c, 1e-4)
        return np.exp(-((np.log(c / width) / spread) ** 2) / 2) / c * np.maximum(1 + tilt * m, 0.05)

    return Preisach("preisach-lognormal", density, share)


class Plays:
    """Prandtl-Ishlinskii: play operators; thresholds can grow with the rate, or the operators creep under a viscous overstress."""

    def __init__(self, name, weight, share, count=36, largest=0.9):
        self.name = name
        self.r = (np.arange(count) + 0.5) / count * largest
        w = weight(self.r)
        # `share` of the travel from -1 to 1 is from the play operators
        self.w = w * share * 2 / np.sum(w * (2 - 2 * self.r))
        self.reversible = 1 - share

    def __call__(self, x, rate=None):
        p, r, out = np.full(len(self.r), float(x[0])), self.r, np.empty(len(x))
        low, high, dot, w = np.empty_like(p), np.empty_like(p), np.dot, self.w
        if isinstance(rate, tuple):
            _, speed, power, steps = rate
            for i, u in enumerate(x.tolist()):
                # overstress beyond the threshold decays by d/dt over = -speed * over ** power (exact for a held drive)
                gap = u - p
                over = np.maximum(np.abs(gap) - r, 1e-12)
                left = (over ** (1 - power) + (power - 1) * speed * steps[i]) ** (1 / (1 - power))
                p += np.sign(gap) * (over - left)
                out[i] = dot(p, w)
        else:
            scale = None if rate is None else rate.tolist()
            for i, u in enumerate(x.tolist()):
                t = r if scale is None else r * scale[i]
                np.subtract(u, t, out=low)
                np.add(u, t, out=high)
                np.minimum(p, high, out=p)
                np.maximum(p, low, out=p)
                out[i] = dot(p, w)
        return out + self.reversible * x


def pi_power(share=0.5, power=0.5):
    return Plays("pi-power", lambda r: (r + 0.02) ** -power, share)


def pi_log(share=0.45, knee=0.9):
    return Plays("pi-log", lambda r: np.log((1 + knee) / (r + 0.01)), share)


def pi_weibull(share=0.45, scale=0.45, shape=1.6):
    return Plays("pi-weibull", lambda r: (r / scale) ** (shape - 1) * np.exp(-((r / scale) ** shape)), share)


class MaxwellSlip:
    """Springs with sliders in parallel (stops): the output is the drive minus the elastic parts that have not slipped."""

    name = "maxwell-slip"

    def __init__(self, share=0.3, scale=0.35, count=30):
        quantile = (np.arange(count) + 0.5) / count
        self.r = scale * (-np.log(1 - quantile)) ** (1 / 1.4)
        self.w = np.full(count, share / count)

    def __call__(self, x, rate=None):
        assert rate is None
        e, r, out, w = np.zeros(len(self.r)), self.r, np.empty(len(x)), self.w
        low = -r
        for i, d in enumerate(np.diff(x, prepend=x[0]).tolist()):
            e += d
            np.minimum(e, r, out=e)
            np.maximum(e, low, out=e)
            out[i] = np.dot(e, w)
        return x - out


class Envelopes:
    """Generalised plays: each element stays between a rising and a falling envelope (Krasnosel'skii-Pokrovskii, smooth relays)."""

    def __init__(self, name, ridge, density, share, ramp, widths=12, places=16, largest=0.75):
        self.name, self.ridge, self.ramp = name, ridge, ramp
        c, m = np.meshgrid((np.arange(widths) + 0.5) / widths * largest, np.linspace(-1.35, 1.35, places))
        self.c, self.m = c.ravel(), m.ravel()
        self.w = density(self.c, self.m)
        self.w /= self.w.sum()
        self.reversible = 0.0
        span = np.ptp(self(np.concatenate([np.linspace(1, -1, 50), np.linspace(-1, 1, 50)])))
        self.w *= 2 * share / span
        self.reversible = 1 - share

    def __call__(self, x, rate=None):
        out, p = np.empty(len(x)), None
        for start in range(0, len(x), 4000):
            part = x[start : start + 4000]
            c = self.c[None, :] if rate is None else self.c[None, :] * rate[start : start + 4000, None]
            rise = self.ridge((part[:, None] - self.m - c) / self.ramp)
            fall = self.ridge((part[:, None] - self.m + c) / self.ramp)
            p = fall[0].copy() if p is None else p
            for i in range(len(part)):
                np.minimum(p, fall[i], out=p)
                np.maximum(p, rise[i], out=p)
                out[start + i] = np.dot(p, self.w)
        return out + self.reversible * x


def kp(share=0.5, width=0.22, spread=0.2, bias=0.2, ramp=0.22):
    density = lambda c, m: np.exp(-(((c - width) / spread) ** 2)) * np.exp(-(((m - bias) / 0.9) ** 2))
    return Envelopes("krasnoselskii-pokrovskii", lambda z: np.clip(z, -1, 1), density, share, ramp)


def smooth_relays(share=0.5, width=0.25, bias=-0.15, ramp=0.2):
    density = lambda c, m: c * np.exp(-c / width * 2) / (1 + ((m - bias) / 0.8) ** 2)
    return Envelopes("smooth-relay", np.tanh, density, share, ramp)


class TanhPlays(Plays):
    """Play operators after one saturating envelope curve (generalised Prandtl-Ishlinskii)."""

    def __init__(self, share=0.5, slope=0.8, shift=0.2):
        super().__init__("generalised-pi", lambda r: np.exp(-2.5 * r), share)
        self.slope, self.shift = slope, shift

    def __call__(self, x, rate=None):
        ends = np.tanh(self.slope * np.array([-1.0, 1.0]) + self.shift)
        curve = np.tanh(self.slope * x + self.shift)
        return super().__call__(2 * (curve - ends[0]) / (ends[1] - ends[0]) - 1, rate)


class Differential:
    """Laws with one state that is integrated over the drive (midpoint rule in small steps)."""

    step, start = 0.02, 0.0

    def __call__(self, x, rate=None):
        slope, z, out, previous = self.slope, self.start, np.empty(len(x)), float(x[0])
        scales = np.ones(len(x)).tolist() if rate is None else rate.tolist()
        for i, u in enumerate(x.tolist()):
            d = u - previous
            if d:
                count = int(abs(d) / self.step) + 1
                h, sign, scale = d / count, 1.0 if d > 0 else -1.0, scales[i]
                for _ in range(count):
                    half = z + 0.5 * h * slope(previous, z, sign, scale)
                    z += h * slope(previous + 0.5 * h, half, sign, scale)
                    previous += h
            out[i], previous = z, u
        return self.output(x, out)


class BoucWen(Differential):
    name = "bouc-wen"

    def __init__(self, a=3.0, beta=2.2, gamma=0.8, n=1.4, share=0.16):
        self.a, self.beta, self.gamma, self.n, self.share = a, beta, gamma, n, share

    def slope(self, u, z, sign, scale):
        turn = 1.0 if z * sign > 0 else -1.0
        return self.a - abs(z) ** self.n * (self.gamma + self.beta * turn)

    def output(self, x, z):
        return x - self.share * z


class Dahl(Differential):
    """Dahl friction; with factors on the friction level, the slow limit of LuGre with a rate-dependent level."""

    def __init__(self, stiffness=3.5, share=0.15, power=1.0, name="dahl"):
        self.stiffness, self.share, self.power, self.name = stiffness, share, power, name

    def slope(self, u, z, sign, scale):
        rest = 1.0 - z * sign / scale
        return self.stiffness * (rest if self.power == 1.0 else abs(rest) ** self.power * (1.0 if rest > 0 else -1.0))

    def output(self, x, z):
        return x - self.share * z


class ColemanHodgdon(Differential):
    """dy/du = alpha sgn(du) (f(u) - y) + g(u) with a linear f and a constant g."""

    name, start = "coleman-hodgdon", -1.0

    def __init__(self, alpha=2.5, f=1.0, g=0.55):
        self.alpha, self.f, self.g = alpha, f, g

    def slope(self, u, y, sign, scale):
        return self.alpha * sign * (self.f * u - y) + self.g

    def output(self, x, y):
        return y


class Duhem(Differential):
    """Duhem model with a slightly saturating f and a g that follows it."""

    name, start = "duhem", -1.0

    def __init__(self, alpha=2.4, bend=0.45, part=0.6):
        self.alpha, self.bend, self.part = alpha, bend, part

    def slope(self, u, y, sign, scale):
        return self.alpha * sign * (u - self.bend * u * u * u / 6 - y) + self.part * (1 - self.bend * u * u / 2)

    def output(self, x, y):
        return y


class JilesAtherton(Differential):
    """Jiles-Atherton with a Langevin curve; the irreversible part never changes against the field."""

    name = "jiles-atherton"

    def __init__(self, field=1.1, pinning=0.17, coupling=0.12, reversible=0.35):
        self.field, self.pinning, self.coupling, self.reversible = field, pinning, coupling, reversible

    @staticmethod
    def langevin(z):
        z = np.where(np.abs(z) < 1e-3, 1e-3, z)
        return 1 / np.tanh(z) - 1 / z

    def slope(self, u, m, sign, scale):
        z = (self.field * u + self.coupling * m) * 3
        curve = z / 3 - z**3 / 45 if abs(z) < 0.1 else (1 + 2 / (np.exp(min(2 * z, 60)) - 1) if z > 0 else -1 - 2 / (np.exp(min(-2 * z, 60)) - 1)) - 1 / z
        gap = curve - m
        if gap * sign <= 0:
            return 0.0
        return self.field * gap / (sign * self.pinning - self.coupling * gap)

    def output(self, x, m):
        return (1 - self.reversible) * m + self.reversible * self.langevin((self.field * x + self.coupling * m) * 3)


# ---------------------------------------------------------------------------------------------------------------------
# Drives. Each returns a function of (seconds since the start of the piece, random numbers) with values in -1 .. 1.
# ---------------------------------------------------------------------------------------------------------------------


def wave(kind, cycles):
    """Unit triangle or sine that starts at its lower end."""
    if kind == "sine":
        return -np.cos(2 * np.pi * cycles)
    return 1 - 2 * np.abs(2 * (cycles % 1) - 1)


def cycles(kind, f, amp=1.0, bias=0.0, phase=0.0):
    return lambda t, rng: bias + amp * wave(kind, f * t + phase)


def swell(kind, f, first=1.0, last=0.1, bias=0.0, end=None):
    """Cycles with an amplitude that changes linearly from `first` to `last` and a centre that changes from `bias` to `end`."""

    def drive(t, rng):
        s = t / t[-1]
        return bias + ((bias if end is None else end) - bias) * s + (first + (last - first) * s) * wave(kind, f * t)

    return drive


def path(*levels):
    """Ramps of constant rate through the levels."""

    def drive(t, rng):
        way = np.concatenate([[0], np.cumsum(np.abs(np.diff(levels)))])
        return np.interp(t / t[-1] * way[-1], way, levels)

    return drive


def reversals(lows, top=1.0):
    """First-order reversal curves from the top."""
    levels = [-1.0]
    for low in lows:
        levels += [top, low]
    return path(*levels, top, -1.0)


def stairs(levels, ramp=0.1):
    """Holds at the levels, each reached by a short ramp."""

    def drive(t, rng):
        n = len(levels)
        times, values = [], []
        for k, level in enumerate(levels):
            times += [k + ramp if k else 0, k + 1]
            values += [level, level]
        return np.interp(t / t[-1] * n, times, values)

    return drive


def steps(count, rise, low=-1.0, high=1.0):
    """Random levels; the amplifier needs `rise` seconds from one to the next."""

    def drive(t, rng):
        levels = rng.uniform(low, high, count)
        levels[1:3] = high, low
        place = t / t[-1] * count
        k = np.minimum(place.astype(int), count - 1)
        since = (place - k) * t[-1] / count
        s = np.clip(since / rise, 0, 1)
        before = levels[np.maximum(k - 1, 0)]
        return before + (levels[k] - before) * s * s * (3 - 2 * s)

    return drive


def raster(f, scans, soft=0.04):
    """Lines of a scan, fast in both directions with rounded reversals; scan size and offset change between images."""

    def drive(t, rng):
        place = t / t[-1] * len(scans)
        at = np.arange(len(scans)) + 0.5
        width = 1.5 * len(scans) / (f * t[-1])
        size, middle = np.zeros_like(t), np.zeros_like(t)
        size += scans[0][0]
        middle += scans[0][1]
        for k in range(1, len(scans)):
            s = np.clip((place - at[k] + 0.5) / width, 0, 1)
            size += (scans[k][0] - scans[k - 1][0]) * s
            middle += (scans[k][1] - scans[k - 1][1]) * s
        line = wave("triangle", f * t)
        return middle + size * np.arcsin((1 - soft) * np.sin(np.pi / 2 * line)) / np.arcsin(1 - soft)

    return drive


def chirp(f0, f1, amp=1.0, bias=0.0, last=None, back=False):
    """Logarithmic sweep of the frequency; `last` is the amplitude at its end."""

    def drive(t, rng):
        s = t / t[-1]
        s = s[::-1] if back else s
        turns = f0 * t[-1] / np.log(f1 / f0) * ((f1 / f0) ** s - 1)
        size = amp + ((amp if last is None else last) - amp) * s
        return bias - size * np.cos(2 * np.pi * turns)

    return drive


def multisine(f0, f1, count, amp=1.0, bias=0.0, slope=0.5):
    """Tones over a band with random phases; higher tones are smaller."""

    def drive(t, rng):
        f = np.geomspace(f0, f1, count) * rng.uniform(0.95, 1.05, count)
        x = np.sum(f[:, None] ** -slope * np.sin(2 * np.pi * f[:, None] * t + rng.uniform(0, 2 * np.pi, count)[:, None]), axis=0)
        return bias + amp * (2 * (x - x.min()) / np.ptp(x) - 1)

    return drive


def walk(corner, amp=1.0, bias=0.0, order=2):
    """Low-passed noise that fills the range."""

    def drive(t, rng):
        fs = 1 / (t[1] - t[0])
        more = int(2 * fs / corner)
        sos = butter(order, corner, fs=fs, output="sos")
        x = sosfilt(sos, rng.standard_normal(len(t) + more))[more:]
        return bias + amp * (2 * (x - x.min()) / np.ptp(x) - 1)

    return drive


def sweeps(kind, frequencies, turns=2, amp=1.0, bias=0.0):
    """Sweeps at several rates in sequence; returns the drive and its seconds."""
    turns = np.broadcast_to(turns, len(frequencies))
    ends = np.concatenate([[0], np.cumsum(turns / np.array(frequencies))])

    def drive(t, rng):
        return bias + amp * wave(kind, np.interp(t, ends, np.concatenate([[0], np.cumsum(turns)])))

    return drive, float(ends[-1])


def record(fs, *pieces, pre=(1.0,), lead=0.0, pause=0.0):
    """An experiment: pieces of (drive, seconds); `pre` are levels of a slow earlier drive; the first `lead` seconds are not recorded.

    Pieces are connected by short ramps, or by a pause without recording.
    """
    return dict(fs=fs, pieces=pieces, pre=pre, lead=lead, pause=pause)


DEMAGNETISED = tuple(np.repeat(np.linspace(1, 0.04, 25), 2) * np.tile([1, -1], 25))

# ---------------------------------------------------------------------------------------------------------------------
# Temperature and load during the record: functions of s = 0 .. 1 along the record with values of about 0 .. 1.
# ---------------------------------------------------------------------------------------------------------------------


def hump(s, rng):
    """Warms up and cools down again."""
    a = rng.uniform(0.4, 0.6)
    return np.sin(np.pi * s ** (np.log(0.5) / np.log(a))) ** 2


def airing(s, rng):
    """Air conditioning that switches on and off: a sawtooth with exponential edges."""
    period, out, level, rise = rng.uniform(0.28, 0.36), np.empty(len(s)), 0.4, True
    gain = 1 - np.exp(-(s[1] - s[0]) / 0.08)
    for i, place in enumerate(s):
        rise = (place / period) % 1 < 0.55
        level += ((1.0 if rise else 0.0) - level) * gain
        out[i] = level
    return out


def heater(s, rng):
    """A heater that is on in the middle of the record."""
    on, off, tau = rng.uniform(0.1, 0.2), rng.uniform(0.5, 0.6), 0.12
    up = np.where(s > on, 1 - np.exp(-(s - on) / tau), 0.0)
    return np.where(s > off, (1 - np.exp(-(off - on) / tau)) * np.exp(-(s - off) / tau), up)


def weights(s, rng):
    """Weights that are added and removed."""
    times = np.sort(rng.uniform(0.08, 0.95, 7))
    levels = rng.permutation(np.array([0.0, 0.25, 0.5, 0.75, 1.0, 0.6, 0.1, 0.9]))
    return levels[np.searchsorted(times, s)]


def sway(s, rng):
    """A slow sinusoidal load."""
    f = rng.uniform(5.3, 7.7)
    return 0.5 - 0.5 * np.cos(2 * np.pi * (f * s + 0.3 * np.sin(2 * np.pi * s)))


def pushes(s, rng):
    """Low-passed random force."""
    sos = butter(2, 12 / len(s), output="sos")
    x = sosfilt(sos, rng.standard_normal(2 * len(s)))[len(s) :]
    return (x - x.min()) / np.ptp(x)


# ---------------------------------------------------------------------------------------------------------------------
# Effects. Sizes are shares of the displacement span unless stated otherwise.
# ---------------------------------------------------------------------------------------------------------------------


def creep_function(kind, **p):
    """Returns the response to a unit step of displacement minus the step."""
    if kind == "log":
        return lambda t: p["per_decade"] * np.log10(1 + t / p["t0"])
    if kind == "power":
        return lambda t: p["size"] * (t / 10) ** p["power"]
    if kind == "stretched":
        return lambda t: p["size"] * (1 - np.exp(-((t / p["tau"]) ** p["beta"])))
    return lambda t: sum(size * (1 - np.exp(-t / tau)) for size, tau in p["modes"])


def linear_filter(h, dt, numerator, denominator):
    """A linear system in continuous time, exact for a drive that is linear between samples, at rest before."""
    b, a, _ = cont2discrete((numerator, denominator), dt, method="foh")
    return h[0] + lfilter(np.ravel(b), a, h - h[0])


def rate_factor(rate, x, dt):
    """Returns the factor on the coercive thresholds for a rate of the drive (ranges of the voltage per second)."""
    speed = np.abs(np.gradient(x, dt)) / 2
    if rate["law"] == "log":
        return 1 + rate["size"] * np.log1p(speed / rate["v0"])
    return 1 + rate["size"] * (speed / rate["v0"]) ** rate["power"]


def curve(kind, size, x):
    """A bent curve with fixed ends."""
    if kind == "square":
        return x + size * (x * x - 1)
    if kind == "exponential":
        return 2 * np.expm1(size * (x + 1) / 2) / np.expm1(size) - 1
    return x + size * (x * x - 1) + 0.6 * size * (x**3 - x)


def noise(rng, n, kind):
    """Returns unit noise: white, pink or half of each."""
    white = rng.standard_normal(n)
    if kind == "white":
        return white
    spectrum = np.fft.rfft(rng.standard_normal(n))
    k = np.arange(len(spectrum))
    pink = np.fft.irfft(spectrum / np.sqrt(np.maximum(k, 4)), n)
    pink /= pink.std()
    return pink if kind == "pink" else (white + pink) / np.sqrt(2)


def timeline(run, over, rng):
    """Returns the fine time grid, the drive on it, and which of its points are recorded."""
    dt = 1 / run["fs"] / over
    parts, kept, last = [], [], None
    for drive, seconds in run["pieces"]:
        lead = run["lead"] if last is None else 0.0
        t = np.arange(int(round((seconds + lead) * run["fs"])) * over) * dt
        x = drive(t, rng)
        if last is not None:
            gap = run["pause"] if run["pause"] else max(0.02 * seconds * abs(x[0] - last), 3 / run["fs"])
            n = max(int(round(gap * run["fs"])), 2) * over
            parts.append(last + (x[0] - last) * (np.arange(n) + 1) / (n + 1))
            kept.append(np.full(n, not run["pause"]))
        parts.append(x)
        keep = np.ones(len(x), bool)
        keep[: int(round(lead * run["fs"])) * over] = False
        kept.append(keep)
        last = x[-1]
    x, keep = np.concatenate(parts), np.concatenate(kept)
    assert np.abs(x).max() < 1.0001, np.abs(x).max()
    rows = np.flatnonzero(keep & (np.arange(len(x)) % over == 0))
    return dt, x, rows


def span_of(law):
    """Returns offset and scale that map the outer loop to -1 .. 1, and the width of the loop as a share of its height."""
    up = np.linspace(-1, 1, 300)
    y = law(np.concatenate([up, up[::-1], up, up[::-1]]))[600:]
    return (y.max() + y.min()) / 2, 2 / np.ptp(y), np.abs(y[:300] - y[300:][::-1]).max() / np.ptp(y)


def motion(case, run, effects, dt, x, ambient):
    """Returns the displacement on the fine grid, in units of half the span, of the actuator with the given effects."""
    law, t = case["law"], np.arange(len(x)) * dt
    middle, scale, _ = case["norm"]
    rest = case["rest"]
    saturation, asymmetry, odd = (effects.get(name, {}) for name in ("saturation", "asymmetry", "unknown"))
    u = x
    if saturation.get("kind") == "rail":
        u = np.clip(x, saturation.get("low", -2), saturation.get("high", 2))
    levels = [float(np.clip(level, u.min(), u.max())) for level in run["pre"]] if run["pre"] else []
    turns = [*levels, float(u[0])]
    before = np.concatenate([[turns[0]], *(np.linspace(a, b, 40)[1:] for a, b in zip(turns, turns[1:]))])
    if not run["pre"]:
        before = u[:1]
    rate, factor = effects.get("rate-dependence"), None
    if rate and rate["law"] == "viscous":
        factor = ("viscous", rate["speed"], rate["power"], np.concatenate([np.full(len(before), 1e3), np.full(len(u), dt)]))
    elif rate:
        factor = np.concatenate([np.ones(len(before)), rate_factor(rate, u, dt)])
    drive = np.concatenate([before, u])
    if asymmetry.get("place") == "front":
        drive = curve(asymmetry["kind"], asymmetry["size"], drive)
    h = (law(drive, factor)[len(before) :] - middle) * scale
    if asymmetry.get("place") == "behind":
        h = curve(asymmetry["kind"], asymmetry["size"], h)
    if "creep" in effects:
        response = creep_function(**effects["creep"])(t)
        h = h + fftconvolve(np.diff(h, prepend=h[0]), response)[: len(h)]
    if "temperature" in effects:
        p, warm = effects["temperature"], ambient["temperature"] - case["temperature"]["base"]
        if p.get("lag"):
            warm = linear_filter(warm, dt, [1.0], [p["lag"], 1.0])
        h = h + p.get("gain", 0.0) * warm * (h - rest) + 2 * p.get("expansion", 0.0) * warm
    if "load" in effects:
        p, force = effects["load"], ambient["load"] / case["load"]["newton"]
        h = h - 2 * p["compliance"] * (force - p.get("stiffening", 0.0) * force * force) - p.get("gain", 0.0) * force * (h - rest)
    if odd.get("kind") == "gain-jump":
        h = rest + (h - rest) * np.where(t > odd["at"] * t[-1], odd["factor"], 1.0)
    if odd.get("kind") == "gain-fade":
        h = rest + (h - rest) * (1 - odd["size"] * t / (t + odd["half"]))
    if odd.get("kind") == "backlash":
        gap, out, p = odd["size"], np.empty(len(h)), h[0]
        for i, value in enumerate(h.tolist()):
            p = min(max(p, value - gap), value + gap)
            out[i] = p
        h = out
    if "lag" in effects:
        h = linear_filter(h, dt, [1.0], [effects["lag"], 1.0])
    if "resonance" in effects:
        modes = effects["resonance"]
        h = sum(part * linear_filter(h, dt, [(2 * np.pi * f) ** 2], [1.0, 4 * np.pi * f * z, (2 * np.pi * f) ** 2]) for f, z, part in modes)
    if "delay" in effects:
        h = np.interp(t - effects["delay"], t, h)
    if saturation.get("kind") == "stop":
        # a compliant stop: beyond its start the motion is compressed
        start, soft = saturation["start"], saturation["soft"]
        beyond = np.maximum(h - start, 0)
        h = np.where(h > start, start + soft * (1 - np.exp(-beyond / soft)), h)
    return h


def sensor(case, effects, t, h, rng, signs):
    """Returns the recorded displacement in micrometres, and that before noise, spikes and quantisation."""
    span, sense = case["span"], case["noise"]
    y = case["sign"] * span / 2 * (h + 1) + case["offset"]
    odd = effects.get("unknown", {})
    if "drift" in effects:
        p = effects["drift"]
        shape = {"line": lambda: t / p["over"], "settling": lambda: 1 - np.exp(-t / p["over"]), "root": lambda: (t / p["over"]) ** 0.6}
        y = y + span * p["size"] * shape[p["kind"]]()
    if "interference" in effects:
        for k, (f, size) in enumerate(effects["interference"]):
            y = y + span * size * np.sin(2 * np.pi * f * t + signs[k])
    if odd.get("kind") == "slips":
        for place, count in odd["slips"]:
            y = y + np.where(t > place * t[-1], count * odd["fringe"], 0.0)
    if odd.get("kind") == "cyclic":
        y = y + odd["size"] * np.sin(2 * np.pi * y / odd["fringe"] + signs[0])
    if odd.get("kind") == "knocks":
        for place in np.linspace(0.06, 0.93, odd["count"]) + 0.03 * np.sin(7 * signs[: odd["count"]]):
            since = t - place * t[-1]
            y = y + np.where(since > 0, span * odd["size"] * np.exp(-np.maximum(since, 0) / odd["tau"]) * np.sin(2 * np.pi * odd["f"] * since), 0.0)
    end = effects.get("saturation", {})
    limit = (-np.inf, np.inf)
    if end.get("kind") == "sensor":
        ends = [case["sign"] * span / 2 * (end[name] + 1) + case["offset"] if name in end else None for name in ("low", "high")]
        ends = ends if case["sign"] > 0 else ends[::-1]
        limit = (-np.inf if ends[0] is None else ends[0], np.inf if ends[1] is None else ends[1])
    clean = np.clip(y, *limit)
    y = y + span * 10 ** (-sense["db"] / 20) * noise(rng, len(y), sense["kind"])
    if sense.get("spikes"):
        rows = rng.choice(len(y), sense["spikes"], replace=False)
        y[rows] += span * rng.uniform(0.01, 0.03, len(rows)) * rng.choice([-1, 1], len(rows))
    y = np.clip(y, *limit)
    if sense.get("bits"):
        step = 1.25 * span / 2 ** sense["bits"]
        y = np.round(y / step) * step
    return y, clean


def write(place, columns):
    names, formats, values = zip(*columns)
    table = np.column_stack(values)
    line = ",".join(formats) + "\n"
    with open(place, "w") as file:
        file.write(",".join(names) + "\n")
        file.write((line * len(table)) % tuple(table.ravel().tolist()))


def build(case, index, folder):
    """Writes one case. Returns a line for the table."""
    case = dict(case)
    low, high = case["volts"]
    case["norm"] = span_of(case["law"])
    case["rest"] = (0 - (high + low) / 2) / ((high - low) / 2)
    effects = case["effects"]
    over = case.get("over") or (4 if {"delay", "lag", "resonance", "rate-dependence"} & set(effects) else 1)
    os.makedirs(folder)
    figures, counts = [], []
    for number, part in enumerate(("train", "test")):
        run = case[part]
        rng = np.random.default_rng([SEED, index, number])
        dt, x, rows = timeline(run, over, rng)
        ambient, columns = {}, []
        for quantity in ("temperature", "load"):
            if quantity not in case:
                continue
            p, s = case[quantity], np.linspace(0, 1, len(x))
            if quantity == "temperature":
                ambient[quantity] = p["base"] + p["swing"] * p["profile"](s, rng)
                seen = np.round((ambient[quantity][rows] + p["noise"] * rng.standard_normal(len(rows))) / p["step"]) * p["step"]
                columns.append(("temperature_degc", "%.4f", seen))
            else:
                ambient[quantity] = p["newton"] * p["profile"](s, rng)
                columns.append(("load_n", "%.4f", ambient[quantity][rows] + p["noise"] * p["newton"] * rng.standard_normal(len(rows))))
        t = (rows - rows[0]) * dt
        volts = (high + low) / 2 + (high - low) / 2 * x[rows]
        read = case["noise"].get("volts")
        if read:
            bits, quiet = read
            step = 1.1 * (high - low) / 2**bits
            volts = np.round((volts + (high - low) * 10 ** (-quiet / 20) * rng.standard_normal(len(volts))) / step) * step
        signs = rng.uniform(0, 2 * np.pi, 12)
        plain = motion(case, run, {}, dt, x, ambient)
        full = motion(case, run, effects, dt, x, ambient) if effects else plain
        head = [("time_s", "%.7f", t), ("voltage_v", "%.6f", volts)]
        clean = {}
        for twin, (name, h, what) in enumerate(((part, full, effects), (f"twin-{part}", plain, {}))):
            y, clean[name] = sensor(case, what, t, h[rows], np.random.default_rng([SEED, index, number, twin]), signs)
            assert np.isfinite(y).all() and len(y) == len(t)
            write(f"{folder}/{name}.csv", [*head, ("displacement_um", "%.6f", y), *columns])
        figures.append(np.sqrt(np.mean((clean[part] - clean[f"twin-{part}"]) ** 2)) / case["span"])
        counts.append(len(t))
    truth = dict(expect=sorted(effects), accept=case.get("accept", []), base=case["law"].name, model=case["model"])
    with open(f"{folder}/truth.json", "w") as file:
        json.dump(truth, file, indent=1)
    sigma = 10 ** (-case["noise"]["db"] / 20)
    return dict(id=os.path.basename(folder), **truth, width=case["norm"][2], figures=figures, sigma=sigma, counts=counts)


def check(folder, truth):
    """Checks that every file exists without missing values, and that the records of a pair have the same rows."""
    lengths = {}
    for part in ("train", "test", "twin-train", "twin-test"):
        with open(f"{folder}/{part}.csv") as file:
            text = file.read()
        assert "nan" not in text and "inf" not in text, folder
        lengths[part] = text.count("\n") - 1
    assert lengths["train"] == lengths["twin-train"] and lengths["test"] == lengths["twin-test"], folder
    assert 1500 <= min(lengths.values()) and max(lengths.values()) <= 60000, (folder, lengths)
    assert truth["model"] in ("pi", "preisach", "bouc-wen") and os.path.exists(f"{folder}/truth.json")
    assert "asymmetry" not in truth["expect"] or truth["model"] == "pi"


# ---------------------------------------------------------------------------------------------------------------------
# The cases.
# ---------------------------------------------------------------------------------------------------------------------

CASES = []


def case(name, model, law, train, test, volts, span, effects=None, accept=(), db=68, kind="white", sign=1, offset=0.0, **more):
    sense = dict(db=db, kind=kind, **{key: more.pop(key) for key in ("bits", "spikes", "volts_read") if key in more})
    if "volts_read" in sense:
        sense["volts"] = sense.pop("volts_read")
    CASES.append(
        (name, dict(model=model, law=law, train=train, test=test, volts=volts, span=span, effects=effects or {}, accept=list(accept), noise=sense, sign=sign, offset=offset, **more))
    )


def define():
    """Fills CASES."""
    stack, low_stack, bender, tube, lab, ten = (0, 150), (0, 100), (-20, 120), (-200, 200), (-10, 10), (0, 10)

    # --- without an effect -------------------------------------------------------------------------------------------
    case("nested-triangles", "pi", pi_power(), record(1000, (swell("triangle", 2, 1, 0.1), 10)),
         record(1000, (swell("sine", 3, 0.1, 1), 6), (walk(2), 4)), stack, 15, db=66)
    case("multisine-lab", "pi", pi_log(0.5), record(2000, (multisine(0.5, 30, 14), 6), pre=DEMAGNETISED),
         record(2000, (swell("triangle", 5, 0.2, 1), 4)), lab, 100, db=70, kind="pink")
    case("scan-pictures", "pi", MaxwellSlip(), record(1000, (raster(5, [(1, 0), (0.6, 0.2), (0.3, -0.5), (0.8, -0.1)]), 12)),
         record(1000, (raster(8, [(0.5, 0.4), (1, 0), (0.4, -0.3)]), 8)), bender, 90, db=64, kind="mixed", bits=12)
    case("quiet-stairs", "pi", Rayleigh(0.12), record(50, (stairs([-1, -0.5, 0, 0.5, 1, 0.5, 0, -0.5, -1, 0.2, -0.3, 0.7, -1]), 65)),
         record(50, (stairs([-1, 0.8, -0.2, 0.4, 0, -0.7, 1, -1]), 48)), low_stack, 10, db=66)
    case("rates-falling", "pi", Domains(2.0, 0.16, 0.5), record(2000, sweeps("triangle", [0.5, 2, 8, 25], [1, 3, 6, 20])),
         record(2000, sweeps("sine", [1, 5, 20], [2, 5, 15])), tube, 60, db=69, sign=-1, offset=12.0)
    case("one-sine", "pi", pi_weibull(), record(250, (cycles("sine", 1), 8), lead=0.6),
         record(250, (cycles("sine", 1, 0.8, -0.1), 6.4)), ten, 30, db=65, spikes=4)
    case("warm-room", "pi", pi_power(0.4, 0.7), record(50, (walk(0.15), 240)), record(50, (swell("triangle", 0.05, 1, 0.15), 200)),
         stack, 25, db=67, kind="mixed", temperature=dict(profile=hump, base=22.5, swing=2.5, noise=0.02, step=0.01))
    case("reversal-curves", "preisach", preisach_gauss(), record(500, (reversals([0.7, 0.4, 0.1, -0.2, -0.5, -0.8]), 24)),
         record(500, (walk(0.8), 16), (swell("triangle", 1, 1, 0.2), 8)), stack, 40, db=74)
    case("mid-cycle", "preisach", preisach_lorentz(), record(1000, (swell("sine", 1.5, 1, 0.1), 10), (walk(2), 6), lead=0.43),
         record(1000, (multisine(0.4, 9, 9), 9), pre=(1.0, -0.4)), bender, 120, db=63, kind="mixed", bits=14)
    case("fast-chirp", "preisach", preisach_lognormal(), record(20000, (chirp(5, 600, 1, 0, 0.5), 2.2)),
         record(20000, (walk(150), 0.5), (swell("triangle", 40, 1, 0.2), 0.4)), lab, 4, db=61)
    case("three-segments", "preisach", kp(), record(500, (cycles("triangle", 0.5), 6), (walk(1), 8), (swell("sine", 1, 1, 0.1), 8), pause=20.0),
         record(500, (reversals([0.5, 0, -0.5]), 8), (walk(1.2), 8), pause=10.0), stack, 18, db=68, bits=16)
    case("spring-preload", "preisach", smooth_relays(), record(1000, sweeps("sine", [0.5, 3, 12], [2, 6, 18]), (swell("triangle", 2, 1, 0.2), 5)),
         record(1000, (walk(4), 8)), low_stack, 9, db=69, load=dict(profile=lambda s, rng: 0.93 + 0.05 * pushes(s, rng), newton=30.0, noise=0.003))
    case("bent-envelope", "preisach", TanhPlays(), record(2000, (multisine(0.5, 20, 12), 5), (cycles("triangle", 2), 2)),
         record(2000, (swell("sine", 4, 0.1, 1), 4)), bender, 150, db=75, kind="pink")
    case("loops-of-bouc", "bouc-wen", BoucWen(), record(1000, (swell("triangle", 1, 1, 0.15), 12)),
         record(1000, (multisine(0.3, 6, 8), 10)), stack, 60, db=68, kind="white")
    case("langevin", "preisach", JilesAtherton(), record(500, (swell("triangle", 0.5, 1, 0.1), 20)),
         record(500, (walk(0.7), 14)), tube, 8, db=66, accept=[["unknown"]])
    case("magnet-like", "bouc-wen", ColemanHodgdon(), record(400, (reversals([0.5, 0, -0.5]), 12), (walk(1), 12)),
         record(400, (swell("sine", 1, 0.2, 1), 14)), lab, 22, db=67, kind="mixed", volts_read=(16, 95))

    # --- delay -------------------------------------------------------------------------------------------------------
    case("late-multisine", "pi", pi_power(0.45), record(5000, (multisine(2, 120, 16, slope=0.4), 2.4)),
         record(5000, (swell("triangle", 25, 1, 0.2), 1.0), (walk(50), 1.0)), stack, 15, dict(delay=0.00052), db=66)
    case("late-chirp", "preisach", preisach_gauss(0.4), record(10000, (chirp(5, 300, 1, 0, 0.6), 1.0), (steps(8, 0.004), 0.4)),
         record(10000, (multisine(10, 250, 12), 0.9)), lab, 6, dict(delay=0.00027), db=64, kind="mixed")
    case("late-one-sine", "bouc-wen", Dahl(), record(250, (swell("sine", 2, 1, 0.15), 12), lead=0.3), record(250, (swell("sine", 2, 0.2, 1), 10)),
         low_stack, 30, dict(delay=0.007), db=66, accept=[["lag"], ["rate-dependence"]])

    # --- lag ---------------------------------------------------------------------------------------------------------
    case("slow-amplifier", "pi", MaxwellSlip(0.28), record(2000, sweeps("triangle", [1, 4, 12, 30], [2, 5, 12, 30]), (steps(10, 0.002), 2)),
         record(2000, (chirp(1, 40, 1, 0, 0.5), 5)), stack, 30, dict(lag=0.0009), db=66)
    case("slow-kernel", "preisach", kp(0.45), record(4000, (walk(40), 2), (steps(12, 0.003), 1.2)),
         record(4000, (multisine(1, 80, 14), 2.5)), bender, 80, dict(lag=0.0011), db=65, kind="pink")
    case("slow-scan", "pi", Rayleigh(0.1), record(2000, (raster(4, [(1, 0), (0.5, 0.3)]), 4), (raster(16, [(1, 0), (0.4, -0.4)]), 3), (raster(40, [(0.9, 0), (0.5, 0.1)]), 2)),
         record(2000, (raster(25, [(0.7, 0.2), (1, 0)]), 2), (swell("sine", 8, 0.3, 1), 2)), lab, 100, dict(lag=0.0006), db=73, sign=-1)

    # --- rate dependence ---------------------------------------------------------------------------------------------
    case("wider-by-log", "pi", pi_weibull(0.45), record(1000, sweeps("triangle", [0.2, 1, 5, 20], [1, 3, 8, 20]), (walk(3), 4)),
         record(1000, sweeps("sine", [0.4, 3, 15], [1, 5, 15])), stack, 35, {"rate-dependence": dict(law="log", size=0.09, v0=0.4)}, db=67)
    case("wider-by-power", "preisach", smooth_relays(0.45), record(1000, sweeps("sine", [0.25, 1, 4, 16], [1, 3, 8, 24]), (swell("triangle", 4, 1, 0.2), 3)),
         record(1000, sweeps("triangle", [0.5, 2, 12], [1, 3, 15]), (walk(4), 3)), tube, 20, {"rate-dependence": dict(law="power", size=0.12, v0=1.0, power=0.35)}, db=66)
    case("wider-friction", "bouc-wen", Dahl(4.0, 0.13, name="lugre"), record(2000, sweeps("sine", [0.5, 2, 10, 40], [1, 3, 10, 30])),
         record(2000, sweeps("triangle", [1, 6, 30], [2, 6, 25])), lab, 50, {"rate-dependence": dict(law="log", size=0.1, v0=1.0)}, db=68, kind="mixed")

    # --- temperature -------------------------------------------------------------------------------------------------
    case("heater-run", "pi", pi_log(0.4), record(50, (swell("triangle", 0.1, 1, 0.3), 150), (walk(0.2), 150)), record(50, (walk(0.25), 240)),
         stack, 20, dict(temperature=dict(gain=0.003, expansion=0.0015)), db=67, temperature=dict(profile=heater, base=22.0, swing=9.0, noise=0.03, step=0.0625))
    case("air-conditioning", "preisach", preisach_lorentz(0.4), record(50, (walk(0.3), 300)), record(50, (swell("sine", 0.1, 0.3, 1), 250)),
         bender, 200, dict(temperature=dict(expansion=0.003, lag=8.0)), db=65, kind="mixed", temperature=dict(profile=airing, base=20.0, swing=7.0, noise=0.02, step=0.01))
    case("warm-gain", "preisach", preisach_lognormal(0.45), record(100, (cycles("triangle", 0.2), 60), (walk(0.5), 80), pause=12.0), record(100, (multisine(0.05, 0.8, 9), 110)),
         low_stack, 12, dict(temperature=dict(gain=0.004)), db=68, temperature=dict(profile=hump, base=24.0, swing=12.0, noise=0.04, step=0.01))

    # --- creep -------------------------------------------------------------------------------------------------------
    case("log-creep", "preisach", preisach_lognormal(0.45, 0.2, 0.7, -0.4), record(100, (stairs([-1, 0, 1, 0.3, -0.4, -1, 0.6, -0.2], 0.03), 120)),
         record(100, (stairs([-1, 0.7, -0.5, 0.2, 1, -1], 0.04), 80)), stack, 15, dict(creep=dict(kind="log", per_decade=0.013, t0=0.1)), db=68)
    case("power-creep", "preisach", preisach_gauss(0.45, bias=-0.2), record(50, (stairs([-1, -0.4, 0.2, 0.8, 0.1, -0.6, 1, -1], 0.05), 160), (walk(0.4), 40)),
         record(50, (stairs([-1, 1, -0.3, 0.5, -0.8], 0.05), 120)), bender, 250, dict(creep=dict(kind="power", size=0.025, power=0.25)), db=64, kind="mixed", bits=16)
    case("two-relaxations", "pi", Domains(1.5, 0.2, 0.45), record(100, (steps(14, 0.15), 110), (cycles("triangle", 0.5), 10)),
         record(100, (steps(9, 0.15), 80)), lab, 70, dict(creep=dict(kind="modes", modes=[(0.012, 1.2), (0.022, 14.0)])), db=66)
    case("stretched-creep", "bouc-wen", BoucWen(2.5, 1.8, 0.6, 1.2, 0.16), record(50, (stairs([-1, 0.5, -0.5, 1, 0, -1, 0.3], 0.04), 140), (cycles("triangle", 0.1), 40)),
         record(50, (stairs([-1, 0.9, 0.1, -0.7, 0.4], 0.05), 110)), low_stack, 45, dict(creep=dict(kind="stretched", size=0.04, tau=9.0, beta=0.6)), db=67)

    # --- load --------------------------------------------------------------------------------------------------------
    case("weights-on", "pi", MaxwellSlip(0.26), record(200, (swell("triangle", 0.5, 1, 0.2), 30), (walk(0.6), 20)), record(200, (walk(0.8), 40)),
         stack, 30, dict(load=dict(compliance=0.03)), db=66, load=dict(profile=weights, newton=60.0, noise=0.004))
    case("swaying-load", "preisach", smooth_relays(0.5, bias=0.2), record(500, (multisine(0.2, 4, 10), 20), pre=DEMAGNETISED), record(500, (swell("sine", 0.7, 1, 0.2), 16)),
         bender, 40, dict(load=dict(compliance=0.022, stiffening=0.25)), db=64, kind="mixed", load=dict(profile=sway, newton=12.0, noise=0.006))
    case("pushed-stack", "pi", pi_log(0.45), record(1000, (cycles("triangle", 1), 5), (walk(3), 7)), record(1000, (swell("triangle", 2, 0.2, 1), 8)),
         low_stack, 14, dict(load=dict(compliance=0.015, gain=0.01)), db=74, load=dict(profile=pushes, newton=400.0, noise=0.003))

    # --- resonance ---------------------------------------------------------------------------------------------------
    case("ringing-steps", "pi", pi_weibull(0.4), record(5000, (steps(24, 0.007), 1.6), (walk(25), 0.8)), record(5000, (steps(14, 0.007), 1.0), (multisine(5, 150, 12, 0.5), 0.6)),
         stack, 12, dict(resonance=[(210.0, 0.03, 1.0)]), db=65, kind="mixed")
    case("two-modes", "preisach", preisach_lognormal(0.4, tilt=-0.3), record(20000, (cycles("triangle", 25), 0.12), (chirp(20, 1800, 0.16, 0, 0.04), 1.9)),
         record(20000, (cycles("sine", 40), 0.1), (multisine(20, 1500, 20, 0.35, slope=0.8), 0.5)), tube, 3, dict(resonance=[(640.0, 0.05, 0.8), (1380.0, 0.035, 0.2)]), db=63)
    case("stage-mode", "bouc-wen", ColemanHodgdon(2.2, 1.0, 0.6), record(2000, (multisine(1, 90, 20, 0.7, slope=0.7), 4), (cycles("triangle", 2), 2)), record(2000, (cycles("sine", 3), 1.2), (chirp(2, 90, 0.3, 0, 0.06), 3)),
         low_stack, 100, dict(resonance=[(62.0, 0.06, 1.0)]), db=66)

    # --- saturation --------------------------------------------------------------------------------------------------
    case("rail", "pi", pi_power(0.4, 0.4), record(500, (swell("triangle", 0.5, 0.3, 1), 16), (walk(1), 8)), record(500, (multisine(0.2, 3, 8), 16)),
         bender, 100, dict(saturation=dict(kind="rail", high=0.8)), db=66)
    case("sensor-end", "preisach", preisach_gauss(0.5, bias=0.0), record(1000, (swell("sine", 1, 0.2, 1), 8), (swell("triangle", 1.5, 0.1, 0.5, -0.5), 6)),
         record(1000, (swell("sine", 2, 0.6, 0.15, -0.4), 5), (cycles("triangle", 1), 3), (walk(2), 4)),
         lab, 25, dict(saturation=dict(kind="sensor", low=-0.76)), db=68, kind="pink", bits=14)
    case("soft-stop", "pi", pi_log(0.45, 0.6), record(500, (reversals([0.5, 0.0, -0.5]), 12), (swell("triangle", 1, 1, 0.2), 8)), record(500, (multisine(0.3, 4, 9), 14)),
         stack, 180, dict(saturation=dict(kind="stop", start=0.55, soft=0.15)), db=65, accept=[["asymmetry"]])

    # --- asymmetry ---------------------------------------------------------------------------------------------------
    case("bent-behind", "pi", pi_log(0.45), record(500, (swell("triangle", 1, 1, 0.1), 18)), record(500, (walk(1), 14)),
         stack, 45, dict(asymmetry=dict(place="behind", kind="square", size=0.055)), db=66)
    case("bent-in-front", "pi", Domains(2.5, 0.12, 0.4), record(1000, (multisine(0.5, 12, 10), 8)), record(1000, (swell("sine", 2, 0.2, 1), 6)),
         lab, 5, dict(asymmetry=dict(place="front", kind="exponential", size=0.22)), db=61, kind="mixed")
    case("bent-twice", "pi", pi_weibull(0.5, 0.35), record(80, (reversals([0.6, 0.2, -0.2, -0.6]), 20), (walk(0.5), 20)), record(80, (swell("triangle", 0.4, 1, 0.2), 25)),
         bender, 130, dict(asymmetry=dict(place="behind", kind="cubic", size=-0.05)), db=64, bits=13, sign=-1)

    # --- drift -------------------------------------------------------------------------------------------------------
    case("even-drift", "pi", pi_power(0.5), record(100, (cycles("triangle", 0.25), 60), (walk(0.6), 40), pause=7.0), record(100, (multisine(0.1, 2, 9), 80)),
         stack, 7, dict(drift=dict(kind="line", size=0.018, over=100.0)), db=66)
    case("warming-sensor", "preisach", preisach_lorentz(0.45, bias=0.2), record(200, (swell("sine", 0.5, 1, 0.3), 40), (walk(0.8), 40)), record(200, (cycles("triangle", 0.4, 0.9), 60)),
         tube, 2, dict(drift=dict(kind="settling", size=-0.024, over=22.0)), db=63, kind="mixed")

    # --- interference ------------------------------------------------------------------------------------------------
    case("mains-hum", "preisach", smooth_relays(0.45), record(1000, (swell("triangle", 1, 1, 0.1), 10), (walk(2), 4)), record(1000, (multisine(0.3, 6, 9), 9)),
         stack, 11, dict(interference=[(50.02, 0.0032), (100.04, 0.0012), (150.06, 0.001)]), db=65)
    case("folded-hum", "pi", MaxwellSlip(0.3, 0.3), record(80, (walk(0.5), 60), (swell("triangle", 0.2, 1, 0.2), 50)), record(80, (cycles("sine", 0.25), 80)),
         low_stack, 28, dict(interference=[(59.97, 0.004)]), db=66, kind="mixed")

    # --- two effects -------------------------------------------------------------------------------------------------
    case("creep-and-drift", "preisach", preisach_gauss(0.4), record(50, (stairs([-1, 0.6, -0.3, 1, 0.2, -0.8, 0.4, -1], 0.04), 160)),
         record(50, (stairs([-1, 0.9, 0.1, -0.6, 0.5, -1], 0.05), 130)), stack, 20,
         dict(creep=dict(kind="modes", modes=[(0.02, 1.0), (0.02, 6.0)]), drift=dict(kind="line", size=0.025, over=160.0)), db=67)
    case("creep-and-lag", "pi", pi_log(0.4), record(500, (stairs([-1, 0.5, -0.5, 1, 0, -1], 0.01), 24), sweeps("triangle", [1, 4, 10], [2, 6, 15])),
         record(500, (steps(8, 0.02), 20), (chirp(0.5, 12, 0.9), 5)), bender, 110,
         dict(creep=dict(kind="log", per_decade=0.014, t0=0.1), lag=0.004), db=68)
    case("creep-and-hum", "bouc-wen", Duhem(), record(200, (stairs([-1, 0, 0.8, 0.2, -0.6, 1, -1], 0.04), 84)), record(200, (stairs([-1, 0.7, -0.2, 0.4, -1], 0.05), 60)),
         lab, 16, dict(creep=dict(kind="modes", modes=[(0.03, 4.0)]), interference=[(60.03, 0.004), (180.09, 0.0015)]), db=66)
    case("warm-creep", "preisach", preisach_lorentz(0.5), record(50, (stairs([-1, 0.4, -0.6, 0.9, -0.1, 0.5, -1, 0.2, 1, -0.4], 0.04), 250)),
         record(50, (stairs([-1, 0.8, -0.3, 0.3, -0.7, 1, -1], 0.04), 180)), low_stack, 9,
         dict(creep=dict(kind="stretched", size=0.04, tau=5.0, beta=0.7), temperature=dict(gain=0.0015, expansion=0.002)), db=66, temperature=dict(profile=airing, base=21.0, swing=7.0, noise=0.02, step=0.01))
    case("bent-and-slow", "pi", pi_power(0.45, 0.6), record(2000, (multisine(1, 50, 14), 3), (swell("triangle", 4, 1, 0.2), 3)), record(2000, sweeps("sine", [2, 7, 20], [3, 8, 25])),
         stack, 32, dict(asymmetry=dict(place="front", kind="square", size=0.045), lag=0.001), db=67)
    case("bent-and-drifting", "pi", Rayleigh(0.13), record(100, (swell("triangle", 0.3, 1, 0.2), 70), (cycles("sine", 0.2, 0.9), 40)), record(100, (multisine(0.1, 1.5, 9), 50), (cycles("triangle", 0.25), 40)),
         tube, 24, dict(asymmetry=dict(place="behind", kind="square", size=0.04), drift=dict(kind="root", size=0.02, over=110.0)), db=65, kind="mixed", sign=-1)
    case("viscous-hum", "pi", pi_weibull(0.45, 0.4, 1.4), record(500, sweeps("triangle", [0.2, 1, 5, 15], [1, 3, 8, 20]), (walk(2), 4)),
         record(500, sweeps("sine", [0.4, 3, 12], [2, 8, 20])), lab, 65,
         {"rate-dependence": dict(law="viscous", speed=2.0e5, power=4.0), "interference": [(49.97, 0.003)]}, db=66, over=2)
    case("mode-and-delay", "preisach", preisach_gauss(0.4, bias=0.1), record(10000, (cycles("sine", 20), 0.15), (chirp(10, 700, 0.3, 0, 0.05), 1.0), (steps(10, 0.004), 0.4)),
         record(10000, (cycles("triangle", 15), 0.2), (multisine(10, 600, 16, 0.5, slope=0.8), 0.7)), stack, 8, dict(resonance=[(430.0, 0.05, 1.0)], delay=0.0004), db=65)
    case("mode-and-hum", "pi", pi_log(0.4, 0.7), record(4000, (multisine(2, 200, 18, 0.8, slope=0.9), 2), (steps(16, 0.01), 1.0)), record(4000, (cycles("triangle", 5), 0.6), (chirp(3, 220, 0.25, 0, 0.05), 1.6)),
         low_stack, 55, dict(resonance=[(132.0, 0.04, 1.0)], interference=[(50.03, 0.004), (150.09, 0.002)]), db=67, bits=16)
    case("load-and-heat", "preisach", kp(0.45, bias=0.1), record(50, (walk(0.3), 150), (swell("triangle", 0.1, 1, 0.3), 130)), record(50, (multisine(0.02, 0.5, 9), 220)),
         stack, 28, dict(load=dict(compliance=0.022), temperature=dict(gain=0.002, expansion=0.0015)), db=66,
         load=dict(profile=weights, newton=150.0, noise=0.003), temperature=dict(profile=hump, base=23.0, swing=8.0, noise=0.03, step=0.01))
    case("load-and-creep", "pi", MaxwellSlip(0.3, 0.4), record(100, (steps(14, 0.1), 110)), record(100, (steps(9, 0.1), 75)),
         bender, 75, dict(load=dict(compliance=0.025), creep=dict(kind="log", per_decade=0.018, t0=0.2)), db=67, kind="mixed", load=dict(profile=sway, newton=5.0, noise=0.004))
    case("drift-and-hum", "preisach", smooth_relays(0.4, bias=0.1), record(250, (swell("triangle", 0.5, 1, 0.1), 30), (walk(1), 20)), record(250, (cycles("sine", 0.6, 0.95), 36)),
         low_stack, 17, dict(drift=dict(kind="line", size=-0.02, over=50.0), interference=[(50.01, 0.004), (100.02, 0.001)]), db=65, volts_read=(16, 92))
    case("warm-and-slow", "bouc-wen", Dahl(3.0, 0.16), record(100, (swell("triangle", 0.25, 1, 0.3), 60), (multisine(0.1, 5, 12), 60), (steps(20, 0.05), 40)),
         record(100, (multisine(0.2, 6, 10), 60), (cycles("triangle", 0.5), 60)), stack, 60,
         dict(lag=0.016, temperature=dict(gain=0.002, expansion=0.002)), db=67, temperature=dict(profile=heater, base=21.0, swing=8.0, noise=0.02, step=0.01))
    case("end-and-delay", "preisach", preisach_lognormal(0.45), record(2000, (swell("sine", 6, 0.3, 1), 4), (walk(12), 2), (multisine(1, 30, 10), 2)), record(2000, (chirp(1, 35, 1, 0, 0.6), 4), (swell("triangle", 5, 1, 0.3), 2)),
         lab, 35, dict(saturation=dict(kind="sensor", high=0.74), delay=0.0016), db=66)
    case("bent-and-warm", "pi", Domains(2.0, 0.15, 0.45), record(50, (walk(0.3), 160), (swell("triangle", 0.1, 0.3, 1), 120)), record(50, (swell("sine", 0.08, 1, 0.2), 240)),
         bender, 300, dict(asymmetry=dict(place="behind", kind="square", size=0.05), temperature=dict(expansion=0.0025)), db=66, temperature=dict(profile=airing, base=22.0, swing=6.0, noise=0.02, step=0.01))
    case("rate-and-creep", "preisach", kp(0.5, bias=-0.2), record(500, sweeps("triangle", [0.2, 1, 5, 15], [1, 3, 8, 20]), (stairs([-1, 0.5, -0.4, 1, 0.1, -1], 0.02), 36)),
         record(500, (stairs([-1, 0.8, -0.2, 0.4], 0.03), 22), sweeps("sine", [0.5, 3, 12], [1, 6, 15])), tube, 48,
         {"rate-dependence": dict(law="log", size=0.1, v0=0.4), "creep": dict(kind="modes", modes=[(0.02, 0.8), (0.02, 5.0)])}, db=67)
    case("end-and-hum", "bouc-wen", BoucWen(3.5, 2.5, 1.0, 1.0, 0.14), record(400, (swell("triangle", 0.5, 1, 0.3), 20), (walk(1), 10)), record(400, (multisine(0.2, 3, 8), 20)),
         stack, 90, dict(saturation=dict(kind="rail", high=0.78), interference=[(60.02, 0.004)]), db=66)
    case("slow-and-drifting", "bouc-wen", Dahl(2.8, 0.14, 1.4), record(500, (multisine(0.3, 20, 14), 16), (swell("triangle", 2, 1, 0.2), 12)), record(500, sweeps("sine", [0.5, 2, 6], [3, 10, 24]), (walk(4), 8)),
         low_stack, 6, dict(lag=0.005, drift=dict(kind="line", size=0.02, over=28.0)), db=66, kind="mixed")

    # --- not in the list ---------------------------------------------------------------------------------------------
    case("gain-jump", "pi", pi_power(0.45), record(200, (cycles("triangle", 0.5), 24), (walk(0.7), 20)), record(200, (multisine(0.2, 3, 9), 36)),
         bender, 100, dict(unknown=dict(kind="gain-jump", at=0.52, factor=0.955)), db=66)
    case("gain-fade", "preisach", preisach_gauss(0.45), record(100, (cycles("sine", 0.25), 60), (walk(0.5), 60)), record(100, (multisine(0.1, 1.5, 9), 90)),
         stack, 13, dict(unknown=dict(kind="gain-fade", size=0.09, half=25.0)), db=66)
    case("fringe-slips", "pi", Rayleigh(0.1), record(500, (walk(1), 14), (swell("triangle", 1, 1, 0.2), 12)), record(500, (multisine(0.3, 4, 9), 20)),
         low_stack, 16, dict(unknown=dict(kind="slips", fringe=0.3164, slips=[(0.13, 1), (0.31, -1), (0.48, -1), (0.69, 2), (0.86, -1)])), db=68)
    case("cyclic-error", "preisach", preisach_lorentz(0.4), record(1000, (swell("triangle", 0.5, 1, 0.15), 14), (walk(1), 6)), record(1000, (multisine(0.2, 3, 9), 14)),
         lab, 4.5, dict(unknown=dict(kind="cyclic", fringe=0.3164, size=0.022)), db=67)
    case("loose-coupling", "bouc-wen", BoucWen(3.0, 2.0, 0.8, 1.0, 0.12), record(500, (swell("triangle", 1, 1, 0.1), 16), (walk(1.5), 6)), record(500, (multisine(0.3, 4, 9), 14)),
         stack, 70, dict(unknown=dict(kind="backlash", size=0.035)), db=66)
    case("knocked-table", "pi", MaxwellSlip(0.28, 0.4), record(1000, (swell("sine", 1, 1, 0.2), 10), (walk(2), 4)), record(1000, (cycles("triangle", 1.5), 5), (multisine(0.4, 6, 9), 6)),
         stack, 10, dict(unknown=dict(kind="knocks", count=9, size=0.025, f=34.0, tau=0.16)), db=66)


def main():
    folder, start = sys.argv[1], time.time()
    define()
    # ids in random order, so that a number gives no information
    order = np.random.default_rng(SEED).permutation(len(CASES))
    lines = []
    for number, index in enumerate(order.tolist()):
        name, what = CASES[index]
        place = f"{folder}/x{number + 1:02d}-{name}"
        line = build(what, index, place)
        check(place, line)
        lines.append(line)
    print(f"{'id':24} {'model':9} {'law':24} {'expect':30} {'rows':>12} {'loop':>5}  train: of span, sigmas   test")
    for line in lines:
        size = "  ".join(f"{100 * f:6.3f} % {f / line['sigma']:6.1f}" for f in line["figures"])
        rows = "/".join(str(n) for n in line["counts"])
        print(f"{line['id']:24} {line['model']:9} {line['base']:24} {','.join(line['expect']) or '-':30} {rows:>12} {100 * line['width']:4.1f}%  {size}")
        assert not line["expect"] or min(line["figures"]) > 2 * line["sigma"] or line["expect"] == ["unknown"], line["id"]
    kinds = {"none": 0, "one": 0, "two": 0, "unknown": 0}
    for line in lines:
        kinds["unknown" if line["expect"] == ["unknown"] else ("none", "one", "two")[len(line["expect"])]] += 1
    models = {model: sum(line["model"] == model for line in lines) for model in ("pi", "preisach", "bouc-wen")}
    print(f"{len(lines)} cases: {kinds}; models {models}; {len({line['base'] for line in lines})} laws; {time.time() - start:.0f} s")


if __name__ == "__main__":
    main()
