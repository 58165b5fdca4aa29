"""Fifteenth examination: 64 simulated actuators, each with a twin. Run `python -B fifteenth.py DIR [id-prefix ...]` (numpy and scipy).

15 cases have no effect, one for each of the 15 hysteresis laws; 32 have one effect, 13 have two, and 4 have something that is none of the
eleven (expect "unknown"). The drive u is -1 at the lowest and 1 at the highest voltage. A law makes a normalised output h of the drive and
of its past, which is played without recording. The output without effects is (1 - c) u + c h, with c such that the full loop is as open as
the case says, scaled to 0 to 1 in the training record. An effect acts on the drive, on the thresholds of the law (only laws made of plays)
or on the output; its sizes are parts of the span. The twin has the same drive, law and noise, but no effect. Files of a case: train.csv,
test.csv, twin-train.csv, twin-test.csv and truth.json.

The table on stderr gives for each effect the RMS of the difference that it alone makes (mean removed) in noise standard deviations and
in percent of the span, then in brackets what is left of it in noise standard deviations behind a fitted gain, offset and sum of plays; for
the test record only the first value. `!!` marks a case that breaks a rule: below 5 noise standard deviations (test: 2.5), below 1 % of the
span (drift and interference: 0.3 %), below 4 in brackets, a test drive outside of the range of the training drive, a loop outside of 5 to
20 %, a number of rows outside of 400 to 60000, a temperature or load correlated with the drive.
"""
import json
import math
import os
import sys
from types import SimpleNamespace

import numpy as np
from scipy.signal import cont2discrete, lfilter

QUIET = SimpleNamespace(gaps=None, flow=None, steps=None)

# ---------------------------------------------------------------- hysteresis laws: engines
def plays(x, r, k):
    """Returns the states of plays, one column each. k.gaps scales the thresholds of each row; k.flow makes the plays yield like a viscous
    material, with an overstress that grows with the cube root of the speed."""
    s, out = np.zeros(len(r)), np.empty((len(x), len(r)))
    for n, v in enumerate(x):
        g = r if k.gaps is None else r * k.gaps[n]
        target = np.minimum(np.maximum(s, v - g), v + g)
        if k.flow is None:
            s = target
        else:
            excess = target - s
            s = target - excess / np.sqrt(1 + 2 * excess**2 * k.steps[n] / k.flow**3)
        out[n] = s
    return out

def branches(x, change):
    """Returns the output of a law with return-point memory: change(a, b) is the change along the branch from a turn a to b."""
    corners, last, y, up, out = [(-1.05, 0.0)], -1.05, 0.0, True, np.empty(len(x))
    for n, v in enumerate(x.tolist()):
        if v != last:
            if (v > last) != up:
                corners.append((last, y))
                up = v > last
            while len(corners) > 2 and (v >= corners[-2][0] if up else v <= corners[-2][0]):
                del corners[-2:]
            a, b = corners[-1]
            y, last = b + change(a, v), v
        out[n] = y
    return out

def duhem(x, slope, most=0.02):
    """Integrates dy/dx = slope(x, y, sign of dx) by Heun's method, in steps of the drive of at most `most`."""
    last, y, out = float(x[0]), 0.0, np.empty(len(x))
    for n, v in enumerate(x.tolist()):
        parts = int(abs(v - last) / most) + 1
        d, sign, at = (v - last) / parts, 1.0 if v > last else -1.0, last
        if d:
            for _ in range(parts):
                first = slope(at, y, sign)
                y += d * (first + slope(at + d, y + d * first, sign)) / 2
                at += d
        last, out[n] = v, y
    return out

def everett(density, n=240):
    """Returns the change of a Preisach output along a branch, from a density of relays that switch on at a and off at b, by a table."""
    edges = np.linspace(-1.1, 1.1, n + 1)
    mid, cell = (edges[1:] + edges[:-1]) / 2, edges[1] - edges[0]
    a, b = np.meshgrid(mid, mid, indexing="ij")
    mass = np.where(a > b, density(a, b), np.where(a == b, density(a, b) / 2, 0.0)) * cell**2
    table = np.zeros((n + 1, n + 1))
    table[1:, :-1] = np.cumsum(np.cumsum(mass, axis=0)[:, ::-1], axis=1)[:, ::-1]
    table = table.tolist()

    def change(start, end):
        high, low = max(start, end), min(start, end)
        p, q = (high + 1.1) / cell, (low + 1.1) / cell
        i, j = min(int(p), n - 1), min(int(q), n - 1)
        p, q = p - i, q - j
        one, two = table[i], table[i + 1]
        value = (1 - p) * ((1 - q) * one[j] + q * one[j + 1]) + p * ((1 - q) * two[j] + q * two[j + 1])
        return value if end > start else -value

    return change

# ---------------------------------------------------------------- hysteresis laws
def bimodal(x, k):
    """Plays with two humps in the density of thresholds: easy walls and hard walls."""
    r = np.linspace(0.03, 0.93, 30)
    return plays(x, r, k) @ (np.exp(-(((r - 0.14) / 0.07) ** 2)) + 0.7 * np.exp(-(((r - 0.58) / 0.13) ** 2)))

def iwan(x, k):
    """Joint of sliders: a power-law density of thresholds that ends in a single strong slider."""
    r = np.linspace(0.0, 0.8, 37)[1:]
    w = r**-0.55
    w[-1] += 0.25 * w.sum()
    return plays(x, r, k) @ w

def masing(x, k):
    """Masing's rule with a skeleton that stiffens as a power of 1.7."""
    return branches(x, lambda a, b: math.copysign(2 * abs((b - a) / 2) ** 1.7, b - a))

def boucwen(x, k):
    """Bouc-Wen with exponent 2.4 and unequal shape factors."""
    z = duhem(x, lambda u, z, s: 4 * (1 - abs(z) ** 2.4 * (0.75 * math.copysign(1, s * z) + 0.25)))
    return x - 0.4 * z

def endochronic(x, k):
    """Endochronic theory: two exponential kernels of the length of the path of the drive, integrated exactly."""
    rates, q, last, out = np.array([2.5, 9.0]), np.zeros(2), x[0], np.empty(len(x))
    for n, v in enumerate(x):
        fade = np.exp(-rates * abs(v - last))
        q, last = q * fade + np.sign(v - last) * (1 - fade) / rates, v
        out[n] = q @ (1.0, 2.0)
    return x - 0.65 * out

def dahl(x, k):
    """Dahl friction with exponent 1.6."""
    z = duhem(x, lambda u, z, s: 5 * math.copysign(abs(1 - s * z) ** 1.6, 1 - s * z))
    return x - 0.45 * z

def hodgdon(x, k):
    """Coleman-Hodgdon: the output relaxes along the drive to a slightly S-shaped curve."""
    def slope(u, y, s):
        t = math.tanh(1.5 * u)
        return s * 2.2 * (0.8 * u + 0.2 * t - y) + 0.35 * (0.8 + 0.3 * (1 - t * t))
    return duhem(x, slope)

def stromsmoe(x, k):
    """Chua-Stromsmoe with the length of the path in place of the time."""
    def slope(u, y, s):
        e = u - y - 0.12 * y**3
        return s * (1 + 0.2 * y * y) * (3.2 * e + 1.5 * e**3)
    return duhem(x, slope, 0.01)

def jiles(x, k):
    """Jiles-Atherton with a Langevin curve and no wall motion against the field."""
    def slope(h, m, s):
        e = (h + 0.06 * m) / 0.55
        e = math.copysign(max(abs(e), 1e-3), e)
        ideal, gain = 1 / math.tanh(e) - 1 / e, (1 / e**2 - 1 / math.sinh(e) ** 2) / 0.55
        gap = (ideal - m) / 0.85
        wall = gap / (s * 0.35 - 0.06 * gap) if s * gap > 0 else 0.0
        return (0.85 * wall + 0.15 * gain) / (1 - 0.06 * 0.15 * gain)
    return duhem(x, slope)

def pinning(x, k):
    """Energy-based: cells with pinning fields of lognormal density, each with an arctangent curve of its reversible field."""
    p = (np.arange(24) + 0.5) / 24
    r = 0.3 * np.exp(0.55 * np.log(p / (1 - p)) / 1.7)
    return np.arctan(0.7 * plays(x, r, k)).mean(axis=1)

def meanfield(x, k):
    """Domains that feel their mean: plays of normal density whose drive is raised by the output before."""
    r = np.linspace(0.02, 0.78, 26)
    w = np.exp(-(((r - 0.33) / 0.17) ** 2) / 2)
    w, s, y, out = w / w.sum(), np.zeros(26), 0.0, np.empty(len(x))
    for n, v in enumerate(x):
        for _ in range(3):
            e = v + 0.22 * y
            g = r if k.gaps is None else r * k.gaps[n]
            s = np.minimum(np.maximum(s, e - g), e + g)
            y = float(s @ w)
        out[n] = y
    return out

def ridge(x, k):
    """Preisach with two ridges of Lorentz shape in the coercive field, modulated along the interaction field; odd-symmetric."""
    def density(a, b):
        c, m = (a - b) / 2, (a + b) / 2
        return (1 / (1 + ((c - 0.22) / 0.1) ** 2) + 0.5 / (1 + ((c - 0.6) / 0.15) ** 2)) * (1 + 0.35 * np.cos(4 * m)) * np.exp(-(m**2))
    TABLES["density"] = TABLES.get("density") or everett(density)
    return branches(x, TABLES["density"])

def product(x, k):
    """Preisach whose density is a product of two single densities; not symmetric: more relays switch at high voltage."""
    f = lambda v: v + 0.16 * v * v
    return branches(x, lambda a, b: (f(b) - f(a)) * abs(f(b) - f(a)))

def lattice(x, k):
    """Krasnoselskii-Pokrovskii: ramp relays on an irregular lattice of thresholds, mirrored to be odd-symmetric."""
    rng = np.random.default_rng(1507)
    c, m, w = rng.gamma(2.2, 0.15, 110), rng.normal(0, 0.5, 110), rng.uniform(0.3, 1, 110)
    on, off, w = np.r_[m + c, -m + c], np.r_[m - c, -m - c], np.r_[w, w]
    s, out = np.zeros(220), np.empty(len(x))
    for n, v in enumerate(x):
        s = np.minimum(np.maximum(s, np.clip((v - on) / 0.25, -1, 1)), np.clip((v - off) / 0.25, -1, 1))
        out[n] = s @ w
    return out

def perceptron(x, k):
    """Net of play neurons with one odd hidden layer and fixed weights."""
    rng = np.random.default_rng(1511)
    return np.tanh(plays(x, np.geomspace(0.05, 0.75, 9), k) @ rng.uniform(0, 0.25, (9, 6))) @ rng.uniform(0.5, 1, 6)

TABLES = {}
LAWS = {law.__name__: law for law in (bimodal, iwan, masing, boucwen, endochronic, dahl, hodgdon, stromsmoe, jiles, pinning, meanfield,
                                      ridge, product, lattice, perceptron)}

def major(law):
    """Returns the middle, the half span and the opening (part of the span) of the settled full loop of a law."""
    if law not in TABLES:
        down = np.cos(np.linspace(0, np.pi, 301))
        h = LAWS[law](np.r_[np.linspace(-1, 1, 300), np.tile(np.r_[down, -down], 3)], QUIET)[-602:]
        TABLES[law] = (h.max() + h.min()) / 2, np.ptp(h) / 2, np.abs(h[:301] - h[301:][::-1]).max() / np.ptp(h)
    return TABLES[law]

# ---------------------------------------------------------------- drives: pieces, functions of the sampling rate and a generator
def span(x, low=-1, high=1):
    return low + (x - x.min()) / np.ptp(x) * (high - low)

def soft(x, rows):
    """Rounds corners with a window of some rows and keeps the ends."""
    rows = int(rows) | 1
    window = np.hanning(rows + 2)[1:-1]
    return np.convolve(np.pad(x, rows // 2, mode="edge"), window / window.sum(), "valid")

def sine(f, n, a=1.0, mid=0.0):
    return lambda fs, rng: mid - a * np.cos(2 * np.pi * f * np.arange(round(n * fs / f)) / fs)

def raster(f, n, duty=0.5, a=1.0, mid=0.0, rounding=0.03):
    """Triangles that rise for a part `duty` of the period."""
    def piece(fs, rng):
        p = (f * np.arange(round(n * fs / f)) / fs) % 1
        return mid + a * span(soft(np.where(p < duty, p / duty, (1 - p) / (1 - duty)), rounding * fs / f))
    return piece

def chirp(f, g, seconds, a=1.0, mid=0.0):
    def piece(fs, rng):
        t = np.arange(round(seconds * fs)) / fs
        return mid - a * np.cos(2 * np.pi * f * seconds / math.log(g / f) * ((g / f) ** (t / seconds) - 1))
    return piece

def levels(values, hold, rise):
    """Holds at values (a list, or a function of the generator) with half-cosine edges."""
    def piece(fs, rng):
        v = np.asarray(values(rng) if callable(values) else values, float)
        rows = max(2, round(rise * fs))
        edge = (1 - np.cos(np.pi * np.arange(1, rows + 1) / rows)) / 2
        parts, at = [], v[0]
        for value in v:
            parts += [at + (value - at) * edge, np.full(round(hold * fs), value)]
            at = value
        return np.concatenate(parts)
    return piece

def stairs(n, hold, rise, a=1.0):
    return levels(np.r_[np.linspace(-a, a, n), np.linspace(a, -a, n)[1:]], hold, rise)

def holds(n, hold, rise, a=1.0):
    """Random levels, among them both ends."""
    def values(rng):
        v = rng.uniform(-a, a, n)
        v[rng.choice(np.arange(1, n), 2, replace=False)] = -a, a
        return v
    return levels(values, hold, rise)

def pulses(n, width, rise, a=1.0, base=-1.0):
    """Pulses of random heights from a base, the second of full height."""
    def values(rng):
        v = np.full(2 * n + 1, base)
        v[1::2] = base + (a - base) * rng.uniform(0.25, 1, n)
        v[3] = a
        return v
    return levels(values, width, rise)

def trapezoids(peaks, ramp, hold, base=-1.0):
    def piece(fs, rng):
        parts = []
        for peak in peaks:
            up = np.linspace(base, peak, max(2, round(ramp * fs)))
            parts += [up, np.full(round(hold * fs), peak), up[::-1], np.full(round(hold * fs), base)]
        return soft(np.concatenate(parts), 0.1 * ramp * fs)
    return piece

def walk(seconds, corner, a=1.0):
    """Random walk folded at the ends and smoothed at a corner frequency."""
    def piece(fs, rng):
        w = np.cumsum(rng.normal(0, 1, round(seconds * fs))) * math.sqrt(corner / fs) * 2
        return span(soft(1 - np.abs((w + 1) % 4 - 2), 0.6 * fs / corner), -a, a)
    return piece

def multisine(f, g, count, seconds, a=1.0, tilt=0.0):
    """Tones of random phase between two frequencies, with amplitudes that fall as a power of the frequency."""
    def piece(fs, rng):
        t, tones = np.arange(round(seconds * fs)) / fs, np.geomspace(f, g, count)
        x = sum((q / f) ** -tilt * np.cos(2 * np.pi * (q * t + p)) for q, p in zip(tones, rng.uniform(0, 1, count)))
        return span(x, -a, a)
    return piece

def ring(f, n, left=0.05, mid=0.0, a=1.0):
    """Sine whose amplitude falls exponentially to a part `left`."""
    def piece(fs, rng):
        p = np.arange(round(n * fs / f)) / (n * fs / f)
        return mid - (1 - abs(mid)) * a * left**p * np.cos(2 * np.pi * n * p)
    return piece

def reversals(n, seconds, a=1.0):
    """First-order reversal curves: from the top down to a deeper turn each time."""
    def piece(fs, rng):
        turns = np.concatenate([[a, t] for t in np.linspace(0.6 * a, -a, n)] + [[a]])
        rows = round(seconds * fs)
        steps = [np.linspace(p, q, max(3, round(rows * abs(q - p) / 2)), endpoint=False) for p, q in zip(turns, turns[1:])]
        return soft(np.concatenate(steps), 0.02 * rows)
    return piece

def minors(places, f):
    """Three loops around each of some places."""
    return lambda fs, rng: np.concatenate([sine(f, 3, a, mid)(fs, rng) for mid, a in places])

# ---------------------------------------------------------------- effects
def effect(name, about, drive=None, gaps=None, flow=None, out=None):
    return SimpleNamespace(name=name, about=about, drive=drive, gaps=gaps, flow=flow, out=out)

def late(x, tau, dt):
    """First-order lag, exact for straight lines between rows, settled at the first row."""
    a = math.exp(-dt / tau)
    b = (1 - a) * tau / dt
    return lfilter([1 - b, b - a], [1, -a], x - x[0]) + x[0]

def delay(tau):
    return effect("delay", f"dead time of {tau:g} s", out=lambda y, k: np.interp(k.t - tau, k.t, y))

def lag(tau, where="drive"):
    return effect("lag", f"{'amplifier' if where == 'drive' else 'sensor'} pole {tau:g} s", **{where: lambda x, k: late(x, tau, k.dt)})

def asymmetry(form, c, more=0.0):
    """square: bent, with a part `more` of third order; kink: another gain above `more`; branch: a play with only one bent edge."""
    def out(y, k):
        if form == "square":
            return y + c * (2 * y - 1) ** 2 * (1 + more * (2 * y - 1))
        if form == "kink":
            return y + c * 0.02 * np.logaddexp(0, (y - more) / 0.02)
        slow, state = np.empty(len(y)), 0.0
        low, high = k.u + 0.5 * (k.u**2 - 1) - 0.15, k.u + 0.15
        for n in range(len(y)):
            state = slow[n] = min(max(state, low[n]), high[n])
        return y + c * (slow - k.u)
    return effect("asymmetry", f"{form} {c:g}", out=out)

def rate(form, c, v0, p=0.4):
    """log: thresholds grow with the logarithm of the speed; flow: viscous yield of each play; power: friction that grows as a power."""
    speed = lambda k: np.gradient(k.u, k.dt) / v0
    if form == "log":
        return effect("rate-dependence", f"thresholds, log {c:g}", gaps=lambda k: 1 + c * np.log1p(np.abs(speed(k))))
    if form == "flow":
        return effect("rate-dependence", f"viscous yield {c:g}", flow=c)
    about = f"friction as power {p:g} of the speed, {c:g} at {v0:g}/s"
    return effect("rate-dependence", about, out=lambda y, k: y - c * speed(k) / (speed(k) ** 2 + 1e-4) ** ((1 - p) / 2))

def temperature(form, c, tau=0.0):
    body = lambda k: (late(k.temperature, tau, k.dt) if tau else k.temperature) - k.calm["temperature"]
    about = f"{form} {c:g}/K, thermal lag {tau:g} s"
    if form == "width":
        return effect("temperature", about, gaps=lambda k: 1 + c * body(k))
    return effect("temperature", about, out=(lambda y, k: y * (1 + c * body(k))) if form == "gain" else lambda y, k: y + c * body(k))

def load(form, c):
    force = lambda k: k.load - k.calm["load"]
    out = dict(compliance=lambda y, k: y + c * force(k), stiffness=lambda y, k: y * (1 + c * force(k)),
               contact=lambda y, k: y + c * np.sign(force(k)) * np.abs(force(k)) ** 0.7)[form]
    return effect("load", f"{form} {c:g}/N", out=out)

def creep(form, c, *taus):
    """log: equal shares over decades; power: shares that grow with the time constant; modes: a few exponentials."""
    if form == "modes":
        parts = list(zip(c, taus))
    else:
        times = np.geomspace(taus[0], taus[1], round(2 * math.log10(taus[1] / taus[0])) + 1)
        parts = [(0.5 * c * (1 if form == "log" else 1.6 * (q / times[-1]) ** 0.25), q) for q in times]
    return effect("creep", f"{form} {c} {taus}", out=lambda y, k: y + sum(w * (late(y, q, k.dt) - 0.5) for w, q in parts))

def resonance(*modes):
    """Modes (frequency, damping, share); the rest follows at once."""
    def out(y, k):
        z, total = y - y[0], sum(m[2] for m in modes)
        found = (1 - total) * z
        for f, damping, part in modes:
            w = 2 * np.pi * f
            b, a, _ = cont2discrete(([w * w], [1, 2 * damping * w, w * w]), k.dt, "foh")
            found = found + part * lfilter(b.ravel(), a, z)
        return found + y[0]
    return effect("resonance", " ".join(f"{f:g} Hz {d:g}" for f, d, _ in modes), out=out)

def saturation(form, low=None, high=None):
    """hard, soft: limits of the output; amplifier: limits of the drive."""
    if form == "amplifier":
        return effect("saturation", f"amplifier clips at {high}", drive=lambda x, k: np.minimum(x, high))
    def out(y, k):
        if form == "hard":
            return np.clip(y, low, high)
        y = np.where(y > high, high + (1 - high) * 0.6 * np.tanh((y - high) / (1 - high) / 0.6), y)
        return np.where(y < low, low + low * 0.6 * np.tanh((y - low) / low / 0.6), y)
    return effect("saturation", f"{form} {low} {high}", out=out)

def drift(form, c, tau=0.0):
    shape = dict(line=lambda t: t / t[-1], root=lambda t: np.sqrt(t / t[-1]), settling=lambda t: 1 - np.exp(-t / tau))[form]
    return effect("drift", f"{form} {c:g}", out=lambda y, k: y + c * shape(np.maximum(k.t, 0)))

def interference(*tones):
    hum = lambda k: sum(a * np.sin(2 * np.pi * (f * k.t + p)) for (f, a), p in zip(tones, k.rng.uniform(0, 1, len(tones))))
    return effect("interference", " ".join(f"{f:g} Hz" for f, _ in tones), out=lambda y, k: y + hum(k))

def unknown(form, c):
    """cracked-bond: less gain after the middle; slipping-zero: jumps at random times; scale-marks: a fixed error of the sensor along its
    way; cable-snags: held back for a while, on some rising passages of one place."""
    def out(y, k):
        x = k.t / k.t[-1]
        if form == "cracked-bond":
            return y * np.where(x > k.rng.uniform(0.4, 0.6), 1 - c, 1)
        if form == "slipping-zero":
            at = np.searchsorted(np.sort(k.rng.uniform(0, 1, 22)), x)
            return y + c * (k.rng.choice([-1, 1], 23) * k.rng.uniform(0.6, 1.3, 23))[at]
        if form == "scale-marks":
            waves = np.random.default_rng(1519).uniform((9, 0), (24, 1), (6, 2))
            return y + c / math.sqrt(3) * sum(np.sin(2 * np.pi * (w * y + p)) for w, p in waves)
        found = y.copy()
        for n in np.flatnonzero((y[:-1] < 0.6) & (y[1:] >= 0.6)):
            if k.rng.uniform() < 0.6:
                held = np.linspace(0, c * k.rng.uniform(0.6, 1.2), round(k.rng.uniform(0.15, 0.4) / k.dt))[: len(y) - n]
                found[n : n + len(held)] -= held
        return found
    return effect("unknown", f"{form} {c:g}", out=out)

# ---------------------------------------------------------------- cases
def case(name, law, model, volts, stroke, fs, train, test, loop, noise, *effects, **options):
    """noise: white, 1/f (percent of the span), steps of the sensor (um), spikes; options: cut (s), past, accept, temp, force."""
    c = dict(name=name, law=law, model=model, volts=volts, stroke=stroke, fs=fs, train=train, test=test, loop=loop, effects=effects,
             noise=(*noise, 0, 0, 0)[:4], cut=0.0, past="cycled", accept=[], temp=None, force=None)
    return SimpleNamespace(**{**c, **options})

CASES = [
    # no effect
    case("plain", "bimodal", "pi", (0, 150), 38, 1000, [sine(1, 4), sine(3, 9, 0.6, 0.2), sine(2, 6, 0.3, -0.5)], [raster(2, 8, 0.7, 0.85)],
         0.14, (0.1,), cut=0.3),
    case("plain", "iwan", "maxwell-slip", (-200, 200), 60, 500, [sine(0.5, 1), ring(0.5, 14)], [walk(20, 0.8, 0.9)], 0.11, (0.15,)),
    case("plain", "masing", "maxwell-slip", (0, 100), 12, 2000, [chirp(1, 60, 7)], [multisine(2, 40, 9, 4, 0.9)], 0.16, (0.08,),
         past="rested"),
    case("plain", "boucwen", "bouc-wen", (-150, 150), 22, 1000, [sine(2, 6), ring(3, 16, 0.1)], [sine(4, 12, 0.8), sine(1, 2, 0.5)], 0.1,
         (0.1,), cut=0.12),
    case("plain", "endochronic", "bouc-wen", (-100, 100), 31, 600, [sine(1, 5), raster(2, 8, 0.5, 0.6)], [sine(1.5, 9, 0.75)], 0.12,
         (0.2,)),
    case("plain", "dahl", "bouc-wen", (-60, 60), 5.5, 400, [walk(25, 1)], [sine(1, 10, 0.8)], 0.09, (0.2,), past="random"),
    case("plain", "hodgdon", "pi", (-100, 100), 80, 250, [raster(0.5, 5), raster(2, 10, 0.9, 0.7)], [stairs(9, 0.5, 0.1, 0.9)], 0.13,
         (0.1,)),
    case("plain", "stromsmoe", "preisach", (0, 1000), 100, 20, [trapezoids((1, 0.3, 0.7, -0.2, 1), 2, 1.5)], [sine(0.4, 8, 0.8)], 0.1,
         (0.1,)),
    case("plain", "jiles", "preisach", (0, 120), 16, 5000, [multisine(10, 300, 14, 1.6, 1, 0.5)], [chirp(20, 200, 1, 0.9)], 0.17, (0.1,)),
    case("plain", "pinning", "pi", (0, 75), 9, 800, [reversals(12, 0.8)], [walk(9, 2, 0.9)], 0.15, (0.05, 0, 0.02)),
    case("plain", "meanfield", "pi", (0, 200), 45, 50, [holds(50, 1, 0.2)], [stairs(12, 1, 0.2, 0.9)], 0.18, (0.1,), past="random"),
    case("plain", "ridge", "preisach", (-30, 150), 27, 600, [walk(20, 2)], [minors([(0.3, 0.6), (-0.4, 0.5), (0, 0.9)], 2)], 0.13,
         (0.1, 0, 0, 5)),
    case("plain", "product", "preisach", (0, 60), 2.4, 20000, [chirp(20, 800, 0.5), chirp(20, 800, 0.5, 0.5)], [sine(100, 30, 0.8)], 0.12,
         (0.1, 0.15)),
    case("plain", "lattice", "preisach", (0, 500), 70, 200, [stairs(15, 0.6, 0.1), minors([(0.6, 0.3), (0, 0.3), (-0.6, 0.3)], 1)],
         [ring(0.5, 10, 0.1, 0, 0.95)], 0.11, (0.1,)),
    case("plain", "perceptron", "pi", (0, 100), -14, 1500, [pulses(24, 0.12, 0.02)], [sine(5, 20, 0.9)], 0.12, (0.15,)),
    # one effect
    case("usb-latency", "iwan", "pi", (0, 120), 30, 2000, [chirp(1, 50, 6)], [multisine(2, 40, 8, 3, 0.9)], 0.13, (0.1,), delay(0.0017)),
    case("one-tone-late", "masing", "pi", (0, 100), 18, 1500, [sine(30, 60), sine(30, 60, 0.6), sine(30, 60, 0.3)], [sine(30, 60, 0.8)],
         0.12, (0.1,), delay(0.002), accept=[["lag"]]),
    case("trigger-pulses", "lattice", "preisach", (0, 200), 55, 500, [pulses(30, 0.25, 0.05), walk(8, 4)], [walk(10, 5, 0.9)], 0.1, (0.1,),
         delay(0.0085), cut=0.1),
    case("big-stack-amplifier", "hodgdon", "pi", (0, 150), 90, 1000, [chirp(0.5, 60, 10)], [sine(25, 50, 0.8), sine(4, 12, 0.9)], 0.12,
         (0.1,), lag(0.004)),
    case("slow-gauge", "bimodal", "pi", (0, 300), -26, 500, [holds(60, 0.25, 0.02)], [pulses(30, 0.2, 0.03, 0.9, -0.9)], 0.15, (0.15,),
         lag(0.025, "out"), past="random"),
    case("fast-tube", "boucwen", "bouc-wen", (-80, 80), 3, 20000, [sine(60, 6), multisine(100, 2500, 12, 0.9, 1, 0.3)],
         [chirp(60, 800, 0.6, 0.9)], 0.1, (0.15,), lag(0.00007)),
    case("electrostrictive", "iwan", "maxwell-slip", (-250, 250), 40, 400, [sine(1, 8), ring(1, 14, 0.1)], [walk(20, 1, 0.9)], 0.12,
         (0.12,), asymmetry("square", 0.06)),
    case("bent-lever", "pinning", "pi", (0, 100), 65, 800, [raster(2, 10), sine(3, 9, 0.6), sine(3, 9, 0.3, 0.3)], [chirp(1, 8, 6, 0.9)],
         0.1, (0.1,), asymmetry("kink", 0.22, 0.55)),
    case("two-branches", "meanfield", "pi", (0, 80), 7, 300, [sine(0.5, 5), ring(1, 14, 0.1), sine(1, 6, 0.4, 0.4)], [walk(25, 0.6, 0.95)],
         0.11, (0.1,), asymmetry("branch", 0.14)),
    case("eyring-walls", "pinning", "pi", (0, 150), 50, 2000,
         [sine(0.3, 2), sine(3, 9), sine(30, 60), sine(60, 90, 0.6), sine(0.6, 2, 0.6)], [sine(1, 3, 0.9), sine(15, 45, 0.8)], 0.16, (0.1,),
         rate("log", 0.11, 0.6)),
    case("viscous-yield", "bimodal", "pi", (-100, 100), 28, 2000, [raster(0.5, 2), raster(5, 12), raster(50, 120), sine(15, 45, 0.6)],
         [raster(2, 5, 0.5, 0.9), raster(20, 50, 0.5, 0.9)], 0.12, (0.1,), rate("flow", 0.045, 1)),
    case("damping-fluid", "endochronic", "preisach", (0, 90), 15, 1000,
         [raster(0.4, 2), raster(4, 16), raster(25, 80), raster(10, 40, 0.5, 0.5)], [sine(2, 6, 0.9), sine(12, 48, 0.8)], 0.08, (0.1,),
         rate("power", 0.04, 60, 0.35)),
    case("lab-heater", "bimodal", "pi", (0, 120), 35, 50, [sine(0.25, 75)], [walk(200, 0.2, 0.9)], 0.14, (0.1,),
         temperature("gain", 0.013, 12), temp=("heater", 26, 5, 0.03)),
    case("expanding-frame", "masing", "maxwell-slip", (0, 60), 11, 100, [walk(240, 0.4)], [sine(0.3, 48, 0.8)], 0.12, (0.2,),
         temperature("zero", 0.012), temp=("slow", 22, 3, 0.02)),
    case("warm-walls", "pinning", "pi", (0, 200), 48, 60, [sine(0.4, 110)], [raster(0.25, 50, 0.5, 0.9)], 0.17, (0.1,),
         temperature("width", 0.05), temp=("sawtooth", 40, 12, 0.05)),
    case("stair-creep", "hodgdon", "pi", (0, 100), 20, 200, [stairs(11, 6, 0.05), sine(0.5, 10)], [holds(16, 4, 0.05, 0.9)], 0.12,
         (0.07, 0.07), creep("log", 0.035, 0.1, 60)),
    case("press-creep", "jiles", "preisach", (0, 1000), 95, 50, [trapezoids((1, 0.4, 1, 0, 0.7), 0.6, 20), raster(0.5, 8)],
         [trapezoids((0.8, 0.2, 0.9), 0.8, 12)], 0.11, (0.08,), creep("power", 0.035, 0.3, 100)),
    case("glue-creep", "boucwen", "bouc-wen", (-120, 120), 13, 100, [holds(24, 7, 0.1), sine(1, 12)], [holds(14, 6, 0.1, 0.9)], 0.1, (0.1,),
         creep("modes", (0.05, 0.06), 0.8, 9)),
    case("weights", "perceptron", "pi", (0, 150), 24, 200, [sine(0.7, 60)], [walk(60, 0.5, 0.9)], 0.12, (0.1,), load("compliance", 0.0025),
         force=("weights", 20, 18, 0.1)),
    case("stiff-spring", "ridge", "preisach", (-50, 100), 8, 150, [walk(70, 0.8)], [sine(0.8, 40, 0.9)], 0.13, (0.15,),
         load("stiffness", 0.004), force=("slow", 40, 28, 0.3)),
    case("soft-contact", "iwan", "maxwell-slip", (0, 100), 33, 400, [raster(1.3, 50)], [raster(0.9, 25, 0.5, 0.9)], 0.1, (0.1, 0, 0.08),
         load("contact", 0.008), force=("gusts", 0, 9, 0.05), cut=0.35),
    case("step-ringing", "endochronic", "pi", (0, 100), 17, 4000, [holds(40, 0.12, 0.0015), sine(4, 6)],
         [pulses(14, 0.1, 0.003, 0.9, -0.9)], 0.1, (0.2,), resonance((180, 0.02, 0.5))),
    case("two-modes", "product", "preisach", (0, 130), 6, 10000, [sine(20, 4), chirp(30, 900, 2.5, 0.1), chirp(50, 900, 1, 0.08, 0.5)],
         [multisine(40, 700, 10, 1, 0.2), sine(15, 6, 0.9)], 0.12, (0.15,), resonance((310, 0.03, 0.6), (560, 0.045, 0.3))),
    case("flyback", "dahl", "bouc-wen", (-100, 100), 42, 1500, [raster(4, 24, 0.93, 1, 0, 0.04), raster(2.3, 9, 0.95, 0.6, 0, 0.02)],
         [raster(3, 18, 0.94, 0.85, 0, 0.03)], 0.1, (0.15,), resonance((90, 0.012, 0.9))),
    case("end-stops", "boucwen", "bouc-wen", (-140, 140), 52, 500, [sine(1, 6), ring(1, 14, 0.15)], [walk(15, 1, 0.98)], 0.12, (0.1, 0.08),
         saturation("hard", 0.07, 0.92)),
    case("rubber-stops", "masing", "pi", (0, 100), 21, 600, [walk(25, 2), sine(2, 8)], [sine(3, 24, 0.95)], 0.13, (0.1,),
         saturation("soft", 0.17, 0.83)),
    case("clipped-amplifier", "stromsmoe", "pi", (0, 140), -75, 1000, [sine(2, 8), raster(3, 15, 0.5, 0.7, 0.3), sine(3, 9, 0.5, -0.3)],
         [sine(4, 20, 0.97)], 0.09, (0.1,), saturation("amplifier", None, 0.72)),
    case("bolt-loosens", "lattice", "preisach", (0, 150), 29, 250, [sine(0.8, 20), sine(0.8, 12, 0.4, 0.5), sine(0.8, 12, 0.4, -0.5)],
         [sine(0.6, 24, 0.85)], 0.12, (0.1, 0, 0.1), drift("line", 0.06)),
    case("electronics-warm-up", "dahl", "pi", (-60, 60), 4, 300,
         [raster(1.1, 12), sine(1.5, 18, 0.4, 0.6), sine(1.5, 18, 0.4, -0.6), raster(1.1, 12)], [walk(40, 1, 0.9)], 0.09, (0.15,),
         drift("settling", 0.07, 9)),
    case("root-drift", "perceptron", "pi", (0, 120), 19, 200, [walk(80, 0.7)], [raster(0.7, 35, 0.5, 0.9)], 0.14, (0.15,),
         drift("root", 0.06)),
    case("mains-hum", "bimodal", "maxwell-slip", (0, 100), 10, 1000, [sine(1.7, 17), ring(1.7, 17)], [raster(2.3, 20, 0.5, 0.9)], 0.12,
         (0.06,), interference((50, 0.008), (150, 0.003))),
    case("turbo-pump", "meanfield", "pi", (0, 70), 2.2, 4000, [multisine(2, 30, 7, 5)], [chirp(2, 25, 4, 0.9)], 0.16, (0.1, 0.05),
         interference((823, 0.008), (411.5, 0.006)), cut=0.02),
    # two effects
    case("creep-delay", "iwan", "pi", (0, 150), 36, 1000, [holds(12, 2, 0.05), chirp(1, 40, 8)],
         [holds(6, 2, 0.05, 0.9), sine(20, 60, 0.8)], 0.12, (0.08,), creep("log", 0.04, 0.05, 20), delay(0.0025)),
    case("rate-heat", "pinning", "pi", (0, 100), 44, 300,
         [sine(0.2, 4), sine(2, 40), sine(12, 240), sine(0.2, 4), sine(12, 240), sine(2, 40, 0.6)], [sine(0.7, 20, 0.9), sine(6, 180, 0.8)],
         0.15, (0.1,), rate("log", 0.13, 0.6), temperature("gain", 0.009), temp=("slow", 24, 4, 0.03)),
    case("mode-delay", "ridge", "preisach", (0, 100), 14, 8000, [sine(8, 3), chirp(10, 500, 3, 0.1), holds(10, 0.06, 0.006, 0.9)],
         [multisine(15, 350, 9, 1.2, 0.3), sine(10, 5, 0.9)], 0.12, (0.15,), resonance((260, 0.03, 0.8)), delay(0.0006)),
    case("stop-creep", "masing", "pi", (0, 200), 58, 150, [holds(22, 5, 0.06), sine(0.7, 14)], [stairs(10, 4, 0.06, 0.97)], 0.13, (0.08,),
         saturation("hard", None, 0.84), creep("modes", (0.05, 0.04), 0.5, 7)),
    case("skew-load", "bimodal", "maxwell-slip", (-90, 90), 25, 300, [sine(0.9, 45), ring(0.9, 14, 0.1)], [walk(40, 0.6, 0.95)], 0.12,
         (0.08, 0.08), asymmetry("square", 0.05, 0.5), load("compliance", 0.004), force=("weights", 15, 12, 0.05)),
    case("pole-hum", "hodgdon", "pi", (0, 110), 12, 2000, [chirp(0.5, 70, 9)], [multisine(1, 45, 8, 5, 0.95)], 0.11, (0.06,), lag(0.003),
         interference((50, 0.009), (100, 0.004))),
    case("drift-pump", "product", "preisach", (0, 60), 3.2, 500, [walk(35, 1.5)], [sine(1.2, 24, 0.85)], 0.14, (0.08,),
         drift("settling", 0.08, 10), interference((29.3, 0.009), (117.2, 0.004))),
    case("oven-and-weights", "endochronic", "bouc-wen", (-150, 150), 62, 80, [sine(0.4, 90)], [sine(0.3, 50, 0.85)], 0.11, (0.1,),
         temperature("zero", 0.008), load("stiffness", 0.006), temp=("heater", 35, 6, 0.05), force=("gusts", 25, 16, 0.1)),
    case("creep-ringing", "jiles", "preisach", (0, 150), 31, 1500, [holds(26, 1.3, 0.003)], [stairs(8, 1, 0.003, 0.9)], 0.12, (0.1,),
         creep("modes", (0.05, 0.05), 0.12, 1.2), resonance((140, 0.015, 0.7))),
    case("skew-rate", "meanfield", "pi", (0, 100), 23, 600, [raster(0.3, 2), raster(3, 12), raster(30, 90), sine(8, 40, 0.5)],
         [sine(1, 4, 0.9), sine(15, 60, 0.9)], 0.15, (0.1,), rate("log", 0.14, 0.5), asymmetry("square", 0.06)),
    case("pole-stop", "stromsmoe", "pi", (0, 500), 72, 800, [chirp(0.5, 40, 10), walk(8, 2)], [sine(12, 48, 0.97), sine(2, 6, 0.97)], 0.09,
         (0.1,), lag(0.005), saturation("hard", 0.1, 0.88), cut=0.7),
    case("load-drift", "lattice", "preisach", (-20, 120), 34, 200, [walk(90, 0.7)], [raster(0.6, 30, 0.5, 0.9)], 0.12, (0.12, 0, 0.08),
         load("compliance", 0.006), drift("root", 0.08), force=("shaker", 10, 6, 0.05)),
    case("late-and-warm", "perceptron", "pi", (0, 130), 16, 150, [multisine(0.1, 4, 9, 150)], [walk(90, 1, 0.9)], 0.13, (0.1, 0, 0, 4),
         delay(0.021), temperature("gain", 0.012), temp=("sawtooth", 30, 5, 0.04)),
    # none of the eleven
    case("cracked-bond", "bimodal", "pi", (0, 100), 26, 300, [sine(1, 40)], [walk(30, 1, 0.9)], 0.13, (0.1,),
         unknown("cracked-bond", 0.13)),
    case("slipping-zero", "lattice", "preisach", (0, 150), 15, 250, [walk(60, 1)], [sine(0.8, 32, 0.9)], 0.12, (0.15,),
         unknown("slipping-zero", 0.03)),
    case("scale-marks", "iwan", "maxwell-slip", (0, 120), 88, 500, [raster(0.4, 6), ring(0.5, 10, 0.1)], [walk(20, 0.6, 0.9)], 0.1, (0.08,),
         unknown("scale-marks", 0.018)),
    case("cable-snags", "masing", "pi", (-100, 100), 46, 200, [sine(0.6, 40), raster(0.9, 30, 0.5, 0.8)], [sine(0.8, 40, 0.9)], 0.12,
         (0.12,), unknown("cable-snags", 0.12)),
]

# ---------------------------------------------------------------- records
def course(kind, x, rng):
    """Returns the shape of a temperature or load over the record, from -1 to 1; x is the part of the record."""
    p = rng.uniform(0, 1, 2)
    if kind in ("slow", "shaker"):
        f = 2.3 if kind == "slow" else 17.3
        w = np.sin(2 * np.pi * (f * x + p[0])) + 0.4 * np.sin(2 * np.pi * (2.23 * f * x + p[1]))
    elif kind == "sawtooth":
        w = np.abs((3.4 * x + p[0]) % 1 - 0.5)
    elif kind == "gusts":
        w = sum(np.sin(2 * np.pi * (f * x + q)) / math.sqrt(f) for f, q in zip(np.geomspace(2.7, 60, 14), rng.uniform(0, 1, 14)))
    else:
        at = np.searchsorted(np.sort((np.arange(1, 14) + rng.uniform(-0.4, 0.4, 13)) / 14), x)
        w = rng.uniform(0, 1, 14)[at] if kind == "weights" else (np.arange(14) % 2 + rng.uniform(-0.25, 0.25, 14))[at]
        w = late(w, 0.0005 if kind == "weights" else 0.03, x[1] - x[0])
    return span(w)

def record(c, number, which, scale=None):
    """Simulates one record. Returns time, drive, recorded columns, a function of a list of effects that returns the output, a generator."""
    rng = np.random.default_rng([1500, number, which])
    parts = []
    for piece in c.test if which else c.train:
        last = parts[-1][-1] if parts else None
        x = piece(c.fs, rng)
        if parts and abs(x[0] - last) > 0.01:
            rows = max(6, round(0.5 * np.abs(x[0] - last) / max(np.abs(np.diff(x)).mean(), 1e-3)))
            parts.append(last + (x[0] - last) * (1 - np.cos(np.pi * np.arange(1, rows) / rows)) / 2)
        parts.append(x)
    u = np.concatenate(parts)
    turns = dict(cycled=[1, -1, 1, -1], rested=0.9 ** np.arange(40) * (-1) ** np.arange(40), random=[1, -1, *rng.uniform(-1, 1, 7)])[c.past]
    turns = np.r_[-1, turns, u[0]]
    past = np.concatenate([np.linspace(a, b, 80, endpoint=False) for a, b in zip(turns, turns[1:])])
    k = SimpleNamespace(dt=1 / c.fs, u=u, t=np.arange(len(u)) / c.fs - c.cut, calm={})
    rows, columns = np.flatnonzero(k.t > -0.25 / c.fs), {}
    for column, key, spec in (("temperature_degc", "temperature", c.temp), ("load_n", "load", c.force)):
        if spec:
            kind, k.calm[key], swing, noise = spec
            values = k.calm[key] + swing * (0.9 if which else 1) * course(kind, np.arange(len(u)) / len(u), rng)
            setattr(k, key, values)
            columns[column] = values[rows] + noise * rng.normal(0, 1, len(rows))
    middle, half, opening = major(c.law)
    def output(effects):
        x, gaps, flow = u, np.ones(len(u)), None
        for e in effects:
            x = e.drive(x, k) if e.drive else x
            gaps = gaps * e.gaps(k) if e.gaps else gaps
            flow = e.flow or flow
        law = SimpleNamespace(gaps=np.r_[np.full(len(past), gaps[0]), gaps] if np.ptp(gaps) else None, flow=flow,
                              steps=np.r_[np.full(len(past), 1e3), np.full(len(u), k.dt)])
        h = (LAWS[c.law](np.r_[past, x], law)[len(past) :] - middle) / half
        part = c.loop / opening
        y = (1 - part) * x + part * h
        if scale:
            y = (y - scale[0]) / scale[1]
        for i, e in enumerate(c.effects):
            k.rng = np.random.default_rng([1501, number, which, i])
            y = e.out(y, k) if e.out and any(e is o for o in effects) else y
        return y[rows]
    return k.t[rows], u[rows], columns, output, rng

def disturbance(c, n, rng):
    """Returns white and 1/f noise in parts of the span, and spikes."""
    f = np.fft.rfftfreq(2 * n)[1:]
    pink = np.fft.irfft(np.r_[0, np.exp(2j * np.pi * rng.uniform(0, 1, len(f))) / np.sqrt(f)], 2 * n)[:n]
    spikes = np.zeros(n)
    spikes[rng.integers(0, n, c.noise[3])] = rng.choice([-1, 1], c.noise[3]) * rng.uniform(0.05, 0.15, c.noise[3])
    return 0.01 * (c.noise[0] * rng.normal(0, 1, n) + c.noise[1] * (pink - pink.mean()) / np.std(pink)), spikes

def left(d, *columns):
    a = np.column_stack([np.ones(len(d)), *columns])
    return float(np.std(d - a @ np.linalg.lstsq(a, d, rcond=None)[0]))

def build(c, number, folder):
    """Writes one case and returns its lines of the table."""
    assert c.loop <= 0.9 * major(c.law)[2], (c.law, major(c.law))
    plain = record(c, number, 0)[3]([])
    scale = (plain.min(), np.ptp(plain))
    zero = np.random.default_rng([1502, number]).uniform(-0.3, 0.7) * abs(c.stroke)
    step = c.noise[2] / abs(c.stroke)
    bad, text, ends, sizes = [], "", [], []
    os.makedirs(folder, exist_ok=True)
    for which, name in enumerate(("train", "test")):
        t, u, columns, output, rng = record(c, number, which, scale)
        volts = c.volts[0] + np.round((u + 1) * 2**15) * (c.volts[1] - c.volts[0]) / 2**16
        twin, real = output([]), output(list(c.effects))
        noise, spikes = disturbance(c, len(u), rng)
        for prefix, y in (("twin-", twin), ("", real)):
            y = y + noise + spikes
            y = np.round(y / step) * step if step else y
            table = dict(time_s=t, voltage_v=volts, displacement_um=zero + c.stroke * y, **columns)
            head, body = ",".join(table), np.column_stack(list(table.values()))
            assert np.isfinite(body).all(), c.name
            np.savetxt(f"{folder}/{prefix}{name}.csv", body, ["%.9g"] + ["%.6g"] * (len(table) - 1), ",", header=head, comments="")
        assert bool(c.effects) != np.array_equal(real, twin), c.name
        sizes.append(len(u))
        ends += [u.min(), u.max()]
        floor = math.sqrt(np.mean(noise**2) + step**2 / 12)
        bank = plays(u, np.geomspace(0.03, 0.85, 12), QUIET)
        for e in c.effects:
            d = real - output([o for o in c.effects if o is not e])
            size, rich = float(np.std(d)), left(d, twin, u, bank)
            text += f"  {name} {e.name} {size / floor:.0f} {100 * size:.1f} %" + ("" if which else f" ({rich / floor:.0f})")
            least = 0.003 if e.name in ("drift", "interference") else 0.01
            if size < (2.5 if which else 5) * floor or which == 0 and (size < least or rich < 4 * floor):
                bad.append(f"{name} {e.name} too small")
        bad += [f"{name} {key} follows the drive" for key, v in columns.items() if abs(np.corrcoef(v, u)[0, 1]) > 0.3]
    if ends[0] > -0.97 or ends[1] < 0.97 or ends[2] < ends[0] or ends[3] > ends[1] or ends[3] - ends[2] < 0.35 * (ends[1] - ends[0]):
        bad.append("range of the drive " + " ".join(f"{v:.2f}" for v in ends))
    assert 400 <= min(sizes) <= max(sizes) <= 60000 and 0.05 <= c.loop <= 0.2, (c.name, sizes)
    about = "; ".join(e.about for e in c.effects)
    truth = dict(expect=sorted(e.name for e in c.effects), accept=c.accept, base=c.law, model=c.model, about=about)
    with open(f"{folder}/truth.json", "w") as file:
        json.dump(truth, file, indent=1)
    line = f"{os.path.basename(folder):24} {c.law:11} {c.model:12} {sizes[0]:6} {sizes[1]:6} rows {sizes[0] / c.fs:6.1f} s{text}"
    return line + "".join(f"\n  !! {b}" for b in bad)

def main():
    """Writes the cases whose names begin with a prefix, or all."""
    folder, *prefixes = sys.argv[1:]
    assert len(CASES) == 64
    for number, c in enumerate(CASES, 1):
        name = f"w{number:02}-{c.name if c.effects else c.name + '-' + c.law}"
        if not prefixes or name.startswith(tuple(prefixes)):
            print(build(c, number, f"{folder}/{name}"), file=sys.stderr, flush=True)

if __name__ == "__main__":
    main()
