"""Fourteenth examination: 72 simulated piezo actuators, each with a twin; run `python -B fourteenth.py DIR [id-prefix ...]`.

Needs numpy, scipy and numba. An experiment is a list of forms; where two forms do not meet, a short ramp joins them. The drive u is -1 at
the lowest and 1 at the highest voltage of the training record. A hysteresis law makes an output of the drive and of its past, which is
played without recording. Without effects the output is scaled to -1 to 1 in the training record, and an effect has the same units: it acts
on the drive, on the thresholds of the law, or on the output. The twin has the same drive, actuator and noise, and no effect.

The table on stderr gives for each effect its RMS share in noise floors: in the training record behind the best gain and offset, in brackets
behind a fitted sum of plays of the drive as well, then in the test record behind gain and offset. A share is the difference that this
effect alone makes. The floor is the RMS of noise and quantisation. `!!` marks a case that breaks a rule of the examination: a share below
6 (test: 3) or above 80 floors or 8 % of the stroke, below 4 floors in brackets, a drive outside its range or that does not fill it, a
temperature or a load that follows the drive.
"""
import json
import math
import os
import sys
from types import SimpleNamespace

import numpy as np
from numba import njit
from scipy.ndimage import uniform_filter1d
from scipy.signal import cont2discrete, fftconvolve, lfilter
from scipy.special import erf

# ---------------------------------------------------------------- hysteresis laws: numerics
@njit
def bank(rise, fall, r, wide):
    """Returns the states of plays, one column each: pushed by `rise` from below and by `fall` from above; `wide` scales the gaps of a row."""
    q, s = np.empty((len(rise), len(r))), np.zeros(len(r))
    for n in range(len(rise)):
        for i in range(len(r)):
            low, high = rise[n] - r[i] * wide[n], fall[n] + r[i] * wide[n]
            if s[i] < low:
                s[i] = low
            elif s[i] > high:
                s[i] = high
            q[n, i] = s[i]
    return q

@njit
def trailing(u, steps, r, tau, m):
    """Returns the states of plays that yield slowly: what exceeds the gap relaxes as dx/dt = -x^m / tau, solved exactly in each step."""
    q, s = np.empty((len(u), len(r))), np.zeros(len(r))
    for n in range(len(u)):
        for i in range(len(r)):
            x = abs(u[n] - s[i]) - r[i]
            if x > 0:
                left = x * np.exp(-steps[n] / tau) if m == 1 else (x ** (1 - m) + (m - 1) * steps[n] / tau) ** (1 / (1 - m))
                s[i] += (x - left) * np.sign(u[n] - s[i])
            q[n, i] = s[i]
    return q

@njit
def slipping(u, spring, k, f, wide):
    """Returns the stretch of a spring beside elements of stiffness k that slip at the force f, advanced from slip to slip."""
    y, s, q, last = np.empty(len(u)), np.zeros(len(k)), 0.0, 0.0
    for n in range(len(u)):
        left = u[n] - last
        for i in range(len(k)):
            kept = min(f[i] * wide[n], max(-f[i] * wide[n], s[i]))
            left, s[i] = left + s[i] - kept, kept
        for _ in range(4 * len(k) + 4):
            if abs(left) < 1e-12:
                break
            sign, stiff = np.sign(left), spring
            for i in range(len(k)):
                stiff += k[i] if s[i] * sign < f[i] * wide[n] - 1e-11 else 0.0
            way = abs(left) / stiff
            for i in range(len(k)):
                if s[i] * sign < f[i] * wide[n] - 1e-11:
                    way = min(way, (f[i] * wide[n] - s[i] * sign) / k[i])
            for i in range(len(k)):
                if s[i] * sign < f[i] * wide[n] - 1e-11:
                    s[i] += sign * k[i] * way
            q, left = q + sign * way, left - sign * way * stiff
        y[n], last = q, u[n]
    return y

@njit
def backbone(x, kind, a, m):
    return x + a * abs(x) ** m * np.sign(x) if kind == 0 else x / (1 - a * abs(x))

@njit
def masing(u, kind, a, m):
    """Returns the output of a law with the first loading curve `backbone`, whose branches are twice that curve and close at old turns."""
    y, ex, ey = np.empty(len(u)), np.empty(len(u) + 1), np.empty(len(u) + 1)
    count, way, last, out = 0, 1.0, 0.0, 0.0
    for n in range(len(u)):
        x = u[n]
        if x != last:
            now = 1.0 if x > last else -1.0
            if now != way and n:
                ex[count], ey[count] = last, out
                count += 1
            way = now
        while count >= 2 and (x - ex[count - 2]) * way >= 0:
            count -= 2
        if count == 1 and x * way >= abs(ex[0]):
            count = 0
        out = backbone(x, kind, a, m) if count == 0 else ey[count - 1] + 2 * backbone((x - ex[count - 1]) / 2, kind, a, m)
        y[n], last = out, x
    return y

@njit
def friction(u, length, power, wide):
    """Returns Dahl's friction per stiffness, (1 - z / length)^power of the way, in closed form for each step."""
    z, s = np.empty(len(u)), 0.0
    for n in range(1, len(u)):
        way, l = abs(u[n] - u[n - 1]), length * wide[n]
        sign = np.sign(u[n] - u[n - 1])
        x = max(1e-9, 1 - sign * s / l)
        x = x * np.exp(-way / l) if power == 1 else (x ** (1 - power) + (power - 1) * way / l) ** (1 / (1 - power))
        s = sign * l * (1 - x) if sign else s
        z[n] = s
    z[0] = 0.0
    return z

@njit
def bouc_wen(u, beta, gamma, n, wide):
    """Returns z of dz/du = 1 - |z/wide|^n (beta sgn(du z) + gamma), by midpoints."""
    z, s = np.zeros(len(u)), 0.0
    for i in range(1, len(u)):
        d = u[i] - u[i - 1]
        cuts = int(abs(d) / 0.004) + 1
        for _ in range(cuts):
            half = s + 0.5 * d / cuts * (1 - abs(s / wide[i]) ** n * (beta * np.sign(d * s) + gamma))
            s += d / cuts * (1 - abs(half / wide[i]) ** n * (beta * np.sign(d * half) + gamma))
        z[i] = s
    return z

@njit
def hodgdon(u, alpha, slope, bend, g):
    """Returns y of dy = alpha |du| (f(u) - y) + g du with f = slope u - bend u^3 (Coleman and Hodgdon)."""
    y, s = np.zeros(len(u)), 0.0
    for i in range(1, len(u)):
        d = u[i] - u[i - 1]
        cuts = int(abs(d) / 0.01) + 1
        decay = np.exp(-alpha * abs(d) / cuts)
        for j in range(cuts):
            x = u[i - 1] + d * (j + 0.5) / cuts
            f = slope * x - bend * x**3
            s = f + (s - f) * decay + g * d / cuts
        y[i] = s
    return y

@njit
def tellinen(u, shift, size, reversible):
    """Returns the output of a Duhem law that approaches the branches tanh((u -+ shift) / size) as far as it is away from them (Tellinen)."""
    y, s = np.zeros(len(u)), 0.0
    for i in range(1, len(u)):
        d = u[i] - u[i - 1]
        cuts = int(abs(d) / 0.003) + 1
        for j in range(cuts):
            x = u[i - 1] + d * (j + 0.5) / cuts
            low, high = np.tanh((x - shift) / size), np.tanh((x + shift) / size)
            near = (high - s) / (high - low) if d > 0 else (s - low) / (high - low)
            end = low if d > 0 else high
            s += d / cuts * (reversible + min(1.0, max(0.0, near)) * ((1 - end**2) / size - reversible))
        y[i] = s
    return y

@njit
def jiles(u, a, alpha, pinning, c):
    """Returns the magnetisation-like output of Jiles and Atherton."""
    y, m = np.zeros(len(u)), 0.0
    for i in range(1, len(u)):
        d = u[i] - u[i - 1]
        cuts = int(abs(d) / 0.003) + 1
        for j in range(cuts):
            x = (u[i - 1] + d * (j + 0.5) / cuts + alpha * m) / a
            calm = x / 3 if abs(x) < 1e-3 else 1 / np.tanh(x) - 1 / x
            rise = 1 / (3 * a) if abs(x) < 1e-3 else (1 / x**2 - 1 / np.sinh(x) ** 2) / a
            moved = (calm - m) * np.sign(d)
            moved = moved / (pinning - alpha * moved) if moved > 0 else 0.0
            m += ((1 - c) * moved + c * rise) / (1 - alpha * c * rise) * d / cuts
        y[i] = m
    return y

@njit
def presliding(u, away, steady):
    """Returns the bristle of LuGre with an elastic range (Dupont): it only bends up to `away`, and slides at `steady`."""
    z, s = np.zeros(len(u)), 0.0
    for i in range(1, len(u)):
        d = u[i] - u[i - 1]
        cuts = int(abs(d) / 0.004) + 1
        for _ in range(cuts):
            bent = s * np.sign(d)
            part = min(1.0, max(0.0, (bent - away) / (steady - away)))
            s += d / cuts * (1 - 0.5 * (1 - np.cos(np.pi * part)) * bent / steady)
        z[i] = s
    return z

@njit
def ridges(u, up, down, width, w):
    """Returns the weighted sum of Krasnosel'skii-Pokrovskii kernels with cubic ridges."""
    y, s = np.zeros(len(u)), np.full(len(up), -1.0)
    for n in range(len(u)):
        for i in range(len(up)):
            a, b = min(1.0, max(0.0, (u[n] - up[i]) / width)), min(1.0, max(0.0, (u[n] - down[i]) / width))
            s[i] = max(2 * a * a * (3 - 2 * a) - 1, min(2 * b * b * (3 - 2 * b) - 1, s[i]))
            y[n] += w[i] * s[i]
    return y

# ---------------------------------------------------------------- hysteresis laws
def states(u, k, r):
    """Returns the plays of the drive as the effects have changed them."""
    if k.viscous:
        return trailing(u, k.steps, r, *k.viscous)
    return bank(*(k.bend(u) if k.bend else (u, u)), r, k.gaps)

def layered(r, w, linear, form=None):
    """Weighted plays; with a form, the Preisach law whose density at the coercive drive r integrates over the bias to form(bias, r)."""
    r, w = np.asarray(r, float), np.asarray(w) / np.sum(w) * (1 - linear)
    return lambda u, k: linear * u + (form(states(u, k, r), r) if form else states(u, k, r)) @ w

def scattered(count, seed):
    """Hysterons that saturate, with random gaps, biases and heights."""
    rng = np.random.default_rng(seed)
    r, b, s, w = rng.gamma(2.0, 0.09, count), rng.normal(0, 0.5, count), rng.uniform(0.3, 0.8, count), rng.uniform(0.5, 1.5, count)
    return lambda u, k: 0.4 * u + np.clip((states(u, k, r) - b) / s, -1, 1) @ (w / w.sum())

def neural(seed, hidden=9):
    """A layer of tanh units above plays, without biases, with positive weights."""
    rng, r = np.random.default_rng(seed), np.array([0.02, 0.07, 0.13, 0.22, 0.35, 0.55])
    inner, outer = rng.exponential(0.3, (6, hidden)), rng.exponential(1.0, hidden)
    return lambda u, k: 0.5 * u + np.tanh(states(u, k, r) @ inner) @ (outer / outer.sum())

def pokrovskii(n, width):
    """Kernels on a triangle, denser near the diagonal."""
    up, down = np.meshgrid(np.linspace(-1.0, 0.8, n), np.linspace(-1.15, 0.65, n), indexing="ij")
    kept = up > down
    up, down = up[kept], down[kept]
    w = np.exp(-((up - down) / 0.42)) * (1 + 0.4 * np.exp(-(((up + down + width) / 0.9) ** 2)))
    return lambda u, k: ridges(u, up, down, width, w / w.sum())

R40 = (np.arange(40) + 0.5) / 40
SLIPS = np.array([0.015, 0.04, 0.08, 0.14, 0.22, 0.33, 0.47, 0.65])
ENVELOPES = lambda u: (np.sinh(1.1 * u + 0.2), np.sinh(0.9 * u + 0.25) + 0.1)
LAWS = {
    "plays-exp": layered(0.9 * R40, np.exp(-0.9 * R40 / 0.23), 0.5),
    "plays-log": layered(np.geomspace(0.008, 0.75, 26), np.ones(26), 0.35),
    "stops-flat": layered(0.55 * R40, np.ones(40), 0.55),
    "preisach-gauss": layered(0.6 * R40, np.exp(-(((0.6 * R40 - 0.16) / 0.14) ** 2)), 0.3, lambda q, r: erf(q / 0.85)),
    "preisach-lorentz": layered(0.8 * R40, 1 / (1 + ((0.8 * R40 - 0.12) / 0.1) ** 2), 0.3, lambda q, r: np.arctan(q / 0.7)),
    "preisach-lognormal": layered(0.8 * R40, np.exp(-np.log(0.8 * R40 / 0.13) ** 2 / 1.1) / R40, 0.25, lambda q, r: np.tanh(q / 0.95)),
    "preisach-triangle": layered(0.5 * R40, np.ones(40), 0.4, lambda q, r: np.clip(q, r - 1.1, 1.1 - r)),
    "hysterons": scattered(70, 146),
    "neural": neural(147),
    "krasnoselskii": pokrovskii(16, 0.5),
    "maxwell": lambda u, k: slipping(u, 1.0, np.linspace(0.12, 0.05, 8), np.linspace(0.12, 0.05, 8) * SLIPS, k.gaps),
    "maxwell-steep": lambda u, k: slipping(u, 1.0, 0.6 * np.exp(-SLIPS[:6] / 0.1), 0.6 * np.exp(-SLIPS[:6] / 0.1) * SLIPS[:6], k.gaps),
    "ramberg-osgood": lambda u, k: masing(u, 0, 0.5, 1.7),
    "rayleigh": lambda u, k: masing(u, 0, 0.35, 2.0),
    "kondner": lambda u, k: masing(u, 1, 0.22, 1.0),
    "dahl": lambda u, k: u - 0.7 * friction(u, 0.17, 1.6, k.gaps),
    "endochronic": lambda u, k: u - 0.35 * friction(u, 0.07, 1.0, k.gaps) - 0.3 * friction(u, 0.3, 1.0, k.gaps),
    "lugre": lambda u, k: u - 0.6 * presliding(u, 0.03, 0.2),
    "bouc-wen": lambda u, k: u - 0.55 * bouc_wen(u, 2.6, 1.6, 1.0, k.gaps),
    "bouc-wen-sharp": lambda u, k: u - 0.6 * bouc_wen(u, 18.0, 9.0, 2.0, k.gaps),
    "coleman-hodgdon": lambda u, k: hodgdon(u, 2.6, 1.0, 0.06, 0.6),
    "tellinen": lambda u, k: tellinen(u, 0.14, 1.15, 0.2),
    "jiles-atherton": lambda u, k: jiles(u, 0.6, 0.1, 0.17, 0.15),
    "envelopes": lambda u, k: 0.3 * u + bank(*ENVELOPES(u), 0.55 * R40, k.gaps) @ np.exp(-R40 / 0.5) / 25,
}

# ---------------------------------------------------------------- experiments: a form makes rows at a rate from the last level
def sine(f, n, a=1.0, c=0.0, at=-0.25):
    return lambda rate, rng, last: c + a * np.sin(2 * np.pi * (f * np.arange(round(n / f * rate)) / rate + at))

def tri(f, n, a=1.0, c=0.0, rise=0.5, soft=0.0):
    """A scanner's triangle; `soft` is the part of a period in which a turn is rounded."""
    def form(rate, rng, last):
        x = f * np.arange(round(n / f * rate)) / rate % 1
        x = 2 * np.where(x < rise, x / rise, (1 - x) / (1 - rise)) - 1
        if soft:
            x = uniform_filter1d(x, max(1, round(soft / f * rate)), mode="wrap")
        return c + a * x / np.abs(x).max()
    return form

def fade(f, n, a, b, low=False):
    """Sines of n sizes from a to b, about 0 or above the lowest voltage."""
    def form(rate, rng, last):
        x = f * np.arange(round(n / f * rate)) / rate
        size = a + (b - a) * np.minimum(n - 1, np.floor(x)) / max(1, n - 1)
        return size * (1 - np.cos(2 * np.pi * x)) - 1 if low else size * np.sin(2 * np.pi * x)
    return form

def steps(levels, dwell, ramp):
    """Levels that are reached in a time and held; a number of levels means that many random ones."""
    def form(rate, rng, last):
        stops = levels
        if np.isscalar(levels):
            stops = np.r_[1, -1, rng.uniform(-1, 1, levels - 2)]
            stops = rng.permutation(stops)
        bend, out, old = (1 - np.cos(np.pi * np.arange(max(1, round(ramp * rate))) / max(1, round(ramp * rate)))) / 2, [], last
        for level in stops:
            old = level if old is None else old
            out += [old + (level - old) * bend, np.full(round(dwell * rate), level)]
            old = level
        return np.concatenate(out).astype(float)
    return form

def ladder(n, low=-1.0, high=1.0):
    return np.r_[np.linspace(low, high, n), np.linspace(high, low, n)[1:]]

def path(levels, speed):
    """Straight ways at one speed (half spans per second)."""
    def form(rate, rng, last):
        at = np.r_[0, np.cumsum(np.abs(np.diff(levels)))] / speed
        return np.interp(np.arange(round(at[-1] * rate)) / rate, at, levels)
    return form

def forc(n, speed, deepest=-1.0):
    """First-order reversal curves: from the top down to n turns, and back."""
    turns = np.linspace(0.8, deepest, n)
    return path(np.r_[-1, np.column_stack([np.ones(n), turns]).ravel(), 1], speed)

def chirp(f0, f1, seconds, a=1.0, c=0.0, straight=False):
    def form(rate, rng, last):
        t = np.arange(round(seconds * rate)) / rate
        turns = f0 * t + (f1 - f0) * t**2 / 2 / seconds if straight else f0 * seconds / np.log(f1 / f0) * ((f1 / f0) ** (t / seconds) - 1)
        return c + a * np.sin(2 * np.pi * (turns - 0.25))
    return form

def span(x, a):
    return a * (2 * (x - x.min()) / np.ptp(x) - 1)

def multisine(f0, f1, count, seconds, a=1.0, lean=0.0):
    """Tones at whole numbers of cycles with random phases; sizes fall as f^-lean."""
    def form(rate, rng, last):
        t, x = np.arange(round(seconds * rate)) / rate, 0.0
        for f in np.unique(np.round(np.geomspace(f0, f1, count) * seconds)) / seconds:
            x = x + f**-lean * np.sin(2 * np.pi * (f * t + rng.uniform()))
        return span(x, a)
    return form

def walk(seconds, corner, a=1.0):
    """A random walk without what is faster than a corner."""
    def form(rate, rng, last):
        rows = round(seconds * rate)
        f = np.fft.rfftfreq(2 * rows, 1 / rate)
        x = rng.normal(0, 1, len(f)) + 1j * rng.normal(0, 1, len(f))
        x *= np.exp(-((f / corner) ** 2)) / np.hypot(f, 3 / seconds)
        return span(np.fft.irfft(x, 2 * rows)[:rows], a)
    return form

def wander(seconds, n, a=1.0):
    """n half cosines between random levels; longer ways take longer."""
    def form(rate, rng, last):
        levels = span(rng.uniform(-1, 1, n + 1) + 0.6 * (-1) ** np.arange(n + 1), a)
        at = np.r_[0, np.cumsum(0.25 + np.abs(np.diff(levels)))]
        x = np.arange(round(seconds * rate)) / (seconds * rate) * at[-1]
        i = np.minimum(n - 1, np.searchsorted(at, x, "right") - 1)
        return levels[i] + (levels[i + 1] - levels[i]) * (1 - np.cos(np.pi * (x - at[i]) / (at[i + 1] - at[i]))) / 2
    return form

def minors(f, n, ratio, b):
    """Small loops along a large one."""
    def form(rate, rng, last):
        x = np.arange(round(n / f * rate)) / rate * f * 2 * np.pi
        return -(1 - b) * np.cos(x) - b * np.cos(ratio * x)
    return form

def sinc(every, width, n):
    """Pulses with random heights."""
    def form(rate, rng, last):
        t = np.arange(round(every * rate)) / rate - every / 2
        return span(np.concatenate([h * np.sinc(t / width) * np.cos(np.pi * t / every) ** 2 for h in np.r_[1, rng.uniform(0.3, 1, n - 1)]]), 1.0)
    return form

def prbs(bit, n, slew, levels=2):
    """Random levels for a time each, with a limited slew (seconds for a step)."""
    def form(rate, rng, last):
        x = rng.integers(0, levels, n)
        x[:2] = 0, levels - 1
        return span(uniform_filter1d(np.repeat(x.astype(float), round(bit * rate)), max(1, round(slew * rate)), mode="nearest"), 1.0)
    return form

def beat(f1, f2, seconds, a=1.0):
    return lambda rate, rng, last: -a / 2 * sum(np.cos(2 * np.pi * f * np.arange(round(seconds * rate)) / rate) for f in (f1, f2))

def hold(seconds):
    return lambda rate, rng, last: np.full(round(seconds * rate), -1.0 if last is None else last)

def course(kind, x, rng):
    """Returns a course of a recorded quantity between -1 and 1 over the part x of the record."""
    if kind == "constant":
        return np.zeros(len(x))
    if kind == "ramp":
        return rng.choice([-1, 1]) * (2 * x - 1)
    if kind == "hvac":  # a controller that switches
        return np.sin(2 * np.pi * (rng.uniform(2.1, 2.9) * x + rng.uniform())) * (0.75 + 0.25 * np.cos(4 * x))
    if kind == "shaker":
        return np.sin(2 * np.pi * rng.uniform(23, 31) * x)
    n = {"oven": 5, "weights": 9, "gusts": 60}[kind]
    levels = rng.permutation(np.linspace(-1, 1, n)) if n < 20 else span(rng.normal(0, 1, n), 1.0)
    if kind == "gusts":
        return np.interp(x * (n - 1), np.arange(n), levels)
    y, i = np.zeros(len(x)), np.minimum(n - 1, (x * n).astype(int))
    for j, level in enumerate(levels):  # each level is approached from the one before
        since, speed = np.maximum(0, x[i == j] * n - j), 2.5 if kind == "oven" else 30.0
        old = y[np.flatnonzero(i == j)[0] - 1] if j else level
        y[i == j] = level + (old - level) * np.exp(-speed * since)
    return y

# ---------------------------------------------------------------- effects
def effect(name, about, before=None, behind=None):
    return SimpleNamespace(name=name, about=about, before=before, behind=behind)

def filtered(x, num, den, dt):
    """Returns x behind a transfer function with the gain 1 at rest; between rows x is a line."""
    b, a, _ = cont2discrete((num, den), dt, "foh")
    return x[0] + lfilter(b.ravel(), a, x - x[0])

def delay(tau, sensor=False):
    act = lambda x, k: np.interp(k.t - tau, k.t, x)
    return effect("delay", f"{'sensor' if sensor else 'drive'} late by {tau} s", None if sensor else act, act if sensor else None)

def lag(*taus, sensor=True):
    def act(x, k):
        for tau in taus:
            x = filtered(x, [1], [tau, 1], k.dt)
        return x
    return effect("lag", f"{'sensor' if sensor else 'amplifier'} with time constants {taus}", None if sensor else act, act if sensor else None)

def cole(tau, alpha):
    """1 / (1 + (s tau)^alpha) as a distribution of time constants."""
    def act(y, k):
        x = np.linspace(-7.5, 7.5, 41) / alpha
        w = 1 / (np.cosh(alpha * x) - np.cos((1 - alpha) * np.pi))
        return sum(g * filtered(y, [1], [tau * np.exp(v), 1], k.dt) for g, v in zip(w / w.sum(), x))
    return effect("lag", f"fractional, time constant {tau}, order {alpha}", None, act)

def creep(form, size, *p):
    """What has crept t after a unit step of the output: logarithm (t0), power (t0, exponent), stretched (t0, exponent), or time constants."""
    def act(y, k):
        t = np.arange(len(y)) * k.dt
        if form == "log":
            h = np.log10(1 + t / p[0])
        elif form == "power":
            h = (t / p[0]) ** p[1]
        elif form == "stretched":
            h = 1 - np.exp(-((t / p[0]) ** p[1]))
        else:
            h = np.mean([1 - np.exp(-t / tau) for tau in p], axis=0)
        return y + size * fftconvolve(np.diff(y, prepend=y[0]), h)[: len(y)]
    return effect("creep", f"{form} {size} {p}", None, act)

def rate(form, size, scale, power=0.5):
    """Thresholds that grow with the speed (half spans per second)."""
    def act(u, k):
        v = np.abs(np.gradient(u, k.dt)) / scale
        k.wide = k.wide * (1 + size * {"power": lambda: v**power, "log": lambda: np.log(1 + v), "activated": lambda: np.arcsinh(v)}[form]())
        return u
    return effect("rate-dependence", f"thresholds, {form} {size} {scale} {power}", act)

def overstress(tau, m):
    def act(u, k):
        k.viscous = (tau, m)
        return u
    return effect("rate-dependence", f"thresholds that yield slowly, {tau} {m}", act)

def resonance(*modes):
    """Modes (Hz, damping, part of the stroke) in parallel."""
    def act(y, k):
        rest = 1 - sum(m[2] for m in modes)
        return rest * y + sum(g * filtered(y, [1], [(2 * np.pi * f) ** -2, z / (np.pi * f), 1], k.dt) for f, z, g in modes)
    return effect("resonance", f"modes {modes}", None, act)

def notched(f, z, zero):
    """A mode whose sensor sits beside it: a pair of zeros at another frequency."""
    poly = lambda f, z: [(2 * np.pi * f) ** -2, z / (np.pi * f), 1]
    return effect("resonance", f"mode {f} Hz, zero {zero} Hz", None, lambda y, k: filtered(y, poly(zero, z), poly(f, z), k.dt))

def saturation(form, at, low=None, slope=0.0):
    """A stop of the output (hard, knee), a rail of the drive, or both ends softly (tanh)."""
    def act(y, k):
        if form == "tanh":
            return at * np.tanh(y / at)
        if form == "knee":
            return y - (1 - slope) * 0.08 * np.logaddexp(0, (y - at) / 0.08)
        return np.minimum(at, y) + slope * np.maximum(0, y - at) if low is None else np.clip(y, low, at)
    return effect("saturation", f"{form} {at} {low} {slope}", *((act, None) if form == "rail" else (None, act)))

def asymmetry(form, size):
    def bent(x, k):
        return {"square": lambda: x + size * x**2, "exponential": lambda: np.expm1(2 * size * x) / (2 * size),
                "corner": lambda: x + size * np.maximum(0, x - 0.1)}[form]()
    def branch(u, k):
        k.bend = lambda u: (u, u + size * np.maximum(0, 1 + u) * np.maximum(0, 1.3 - u))
        return u
    if form == "branch":
        return effect("asymmetry", f"descending branch {size}", branch)
    return effect("asymmetry", f"{form} {size}", *((bent, None) if form == "exponential" else (None, bent)))

def temperature(late=0.0, gain=0.0, zero=0.0, curie=0.0, arrhenius=0.0):
    """Gain and zero per kelvin, a Curie point (kelvin above the mean), an activation of the thresholds; the actuator follows the sensor late."""
    def warm(k):
        T = filtered(k.temperature, [1], [late, 1], k.dt) if late else k.temperature
        return T - k.calm["temperature"]
    def before(u, k):
        T = k.calm["temperature"] + 273.15
        k.wide = k.wide * np.exp(arrhenius * (1 / (T + warm(k)) - 1 / T))
        return u
    def behind(y, k):
        d = warm(k)
        g = 1 / (1 - d / curie) - 1 if curie else gain * d
        return y + g * (y - k.zero) + zero * d
    text = f"late {late} s, gain {gain}, zero {zero}, curie {curie}, arrhenius {arrhenius}"
    return effect("temperature", text, before if arrhenius else None, behind if gain or zero or curie else None)

def load(compliance=0.0, gain=0.0, half=0.0, seat=0.0):
    """A zero and a gain per newton; `half`: the gain bends like F / (F + half); `seat`: a contact that closes like F^(2/3)."""
    def act(y, k):
        F = k.load - k.calm["load"]
        g = gain * (k.load / (k.load + half) - k.calm["load"] / (k.calm["load"] + half)) if half else gain * F
        press = np.sign(k.load) * np.abs(k.load) ** (2 / 3) - np.abs(k.calm["load"]) ** (2 / 3)
        return y + g * (y - k.zero) - compliance * F - seat * press
    return effect("load", f"compliance {compliance}, gain {gain}, half {half}, seat {seat}", None, act)

def drift(form, size, p=0.2):
    def act(y, k):
        x = np.maximum(0, k.x)
        return y + size * {"line": lambda: x, "root": lambda: np.sqrt(x), "settling": lambda: 1 - np.exp(-x / p),
                           "bow": lambda: x + p * x**2}[form]()
    return effect("drift", f"{form} {size} {p}", None, act)

def hum(f, *sizes, swell=0.0):
    """A tone and its harmonics; `swell`: the size breathes once in 0.4 of the record."""
    def act(y, k):
        at = k.rng.uniform(0, 1, len(sizes))
        tones = sum(a * np.sin(2 * np.pi * ((j + 1) * f * k.t + at[j])) for j, a in enumerate(sizes))
        return y + tones * (1 + swell * np.sin(2 * np.pi * (k.x / 0.4 + at[0])))
    return effect("interference", f"{f} Hz and harmonics {sizes}, swell {swell}", None, act)

def tones(*parts):
    act = lambda y, k: y + sum(a * np.sin(2 * np.pi * (f * k.t + k.rng.uniform())) for f, a in parts)
    return effect("interference", f"tones {parts}", None, act)

def unknown(form, size, n, stroke=0.0):
    """A disturbance that is none of the eleven effects; n is a number per record, or a frequency."""
    def smooth(k, cycles):
        x = np.arange(int(cycles) + 3)
        noise = k.rng.normal(0, 1, len(x))
        at = np.clip(k.x, 0, 1) * cycles + 1
        i = at.astype(int)
        w = (1 - np.cos(np.pi * (at - i))) / 2
        return noise[i] * (1 - w) + noise[i + 1] * w
    def act(y, k):
        if form == "bistable mount":  # the zero jumps between two values
            flips = np.sort(k.rng.uniform(0, 1, n))
            return y + size * (np.searchsorted(flips, k.x) % 2 - 0.5)
        if form == "footfalls":  # the table rings at once and calms down
            for at, height, f in zip(np.sort(k.rng.uniform(0, 1, n)), k.rng.uniform(0.4, 1.3, n), k.rng.uniform(7, 16, n)):
                since = np.maximum(0, k.t - at * k.t[-1])
                y = y + size * height * np.sin(2 * np.pi * f * since) * np.exp(-since * 5)
            return y
        if form == "cyclic error":  # an interferometer that mixes its beams: two periods in a wavelength of 0.633 um
            way = y * stroke / 2 / 0.3165 * 2 * np.pi
            return y + size * (np.sin(way) + 0.4 * np.sin(2 * way + 0.7))
        if form == "wandering clock":  # the rows are taken earlier or later than their times say
            return np.interp(k.t + size * smooth(k, n), k.t, y)
        return y + size * smooth(k, n) * (y - k.zero)  # a lamp behind a fibre sensor that flickers
    return effect("unknown", form, None, act)

# ---------------------------------------------------------------- cases
def case(name, law, model, volts, stroke, fs, train, test, noise, *effects, past=None, cut=0.0, over=1, temp=None, force=None, accept=()):
    """One case. noise = white and 1/f in percent of the stroke, bits (0: none); cut = seconds before the record; over = inner rows per row;
    temp and force = course, mean, half range, noise of the sensor."""
    bipolar, noise = volts[0] < -0.5 * volts[1], (*noise, 0, 0)[: max(3, len(noise))]
    past = past or ("fresh" if bipolar else "cycled")
    return SimpleNamespace(**locals())

def cases():
    return [
        # no effect
        case("three-rates", "plays-exp", "pi", (0, 100), 12, 1000, [sine(0.5, 3), sine(3, 9), sine(17, 51)], [sine(1, 3, 0.8), sine(9, 20)], (0.08,)),
        case("single-sine", "bouc-wen", "bouc-wen", (0, 150), 18, 200, [sine(1, 6)], [sine(1, 4, 0.85)], (0.1,)),
        case("few-rows", "kondner", "maxwell-slip", (-100, 100), 5.5, 50, [fade(0.5, 4, 1, 0.2)], [fade(0.7, 4, 1, 0.3)], (0.12,)),
        case("reversal-curves", "preisach-gauss", "preisach", (-20, 120), 30, 100, [forc(14, 0.8)], [walk(20, 0.8)], (0.07,)),
        case("pink-multisine", "maxwell", "maxwell-slip", (0, 75), 9, 2000, [multisine(1, 90, 25, 6)], [multisine(2, 70, 20, 3)], (0.04, 0.15)),
        case("twelve-bits", "preisach-triangle", "preisach", (0, 100), 65, 500, [tri(1, 5), tri(1, 5, 0.5, -0.4), tri(4, 16, 0.7)],
             [tri(2, 6), tri(1, 3, 0.6, 0.3)], (0.02, 0, 12)),
        case("mid-cycle", "ramberg-osgood", "pi", (0, 120), -14, 400, [sine(2, 13), sine(0.6, 4, 0.55, 0.3)], [sine(1, 7, 0.95)], (0.09,),
             past="rough", cut=1.13),
        case("staircase", "plays-log", "pi", (-30, 150), -40, 200, [steps(ladder(9), 0.8, 0.15)], [steps(12, 0.6, 0.2)], (0.1, 0.05)),
        case("log-chirp", "dahl", "bouc-wen", (0, 60), 3.2, 10000, [chirp(2, 220, 2.5)], [sine(60, 30), chirp(200, 10, 0.8, 0.8)], (0.12,)),
        case("random-walk", "neural", "preisach", (-200, 200), 7, 250, [walk(40, 1.5)], [wander(20, 40)], (0.08, 0.04)),
        case("sinc-pulses", "coleman-hodgdon", "bouc-wen", (0, 100), 21, 1000, [sinc(0.5, 0.035, 16)], [sinc(0.4, 0.05, 8)], (0.1,)),
        case("slewed-bits", "stops-flat", "pi", (-250, 250), 1.8, 20000, [prbs(0.004, 750, 0.0015, 5)], [prbs(0.003, 300, 0.002, 7)], (0.15,)),
        case("zooming-raster", "krasnoselskii", "preisach", (0, 150), 95, 5000,
             [tri(25, 60, soft=0.08), tri(25, 60, 0.3, -0.5, soft=0.08), tri(25, 60, 0.12, 0.4, soft=0.08)],
             [tri(15, 20, soft=0.05), tri(15, 20, 0.4, 0.2)], (0.05, 0.03)),
        case("minor-loops", "rayleigh", "maxwell-slip", (0, 100), 15, 300, [minors(0.2, 4, 13, 0.12)], [minors(0.3, 3, 9, 0.2)], (0.08,)),
        case("two-envelopes", "envelopes", "gpi", (0, 80), 16, 100, [fade(0.25, 8, 1, 0.2, True), fade(0.5, 6, 0.3, 1, True)],
             [sine(0.4, 4), sine(0.4, 4, 0.5, -0.3)], (0.1,)),
        case("domain-walls", "jiles-atherton", "lfdm", (-400, 400), 24, 600, [sine(1, 4), fade(2, 20, 1, 0.1)],
             [fade(1, 5, 0.5, 1), sine(1, 3, 0.7)], (0.1,)),
        case("idle-columns", "lugre", "bouc-wen", (0, 120), 8, 60, [wander(120, 90)], [wander(50, 40)], (0.1,), past="rough", cut=7.7,
             temp=("hvac", 24, 3, 0.03), force=("weights", 12, 10, 0.05)),
        # delay
        case("delay-chirp", "plays-exp", "pi", (0, 100), 6, 20000, [chirp(5, 500, 1.6)], [chirp(300, 20, 0.8), sine(350, 80, 0.7)], (0.08,),
             delay(0.000087)),
        case("delay-sines", "maxwell", "maxwell-slip", (0, 150), 20, 500, [sine(0.5, 3), sine(4, 16), sine(26, 91)], [sine(11, 40), sine(2, 5, 0.8)],
             (0.1,), delay(0.0017, sensor=True), over=4),
        case("delay-one-sine", "lugre", "bouc-wen", (0, 60), 4, 3000, [sine(25, 60)], [sine(25, 30, 0.8)], (0.06,), delay(0.0007), over=2,
             accept=[["lag"]]),
        # lag
        case("lag-amplifier", "ramberg-osgood", "pi", (0, 150), 80, 4000, [tri(8, 16), tri(20, 60), tri(40, 80)], [tri(30, 40), tri(12, 10, 0.7)],
             (0.1,), lag(0.0006, sensor=False)),
        case("lag-fractional", "preisach-lognormal", "preisach", (0, 100), 11, 1000, [steps(14, 0.45, 0.03), chirp(0.5, 40, 6)],
             [chirp(1, 30, 4), steps(6, 0.3, 0.03)], (0.08,), cole(0.0018, 0.85), accept=[["creep", "lag"]]),
        case("lag-two-poles", "dahl", "bouc-wen", (-100, 100), 2.5, 3000, [multisine(3, 210, 30, 5)], [multisine(5, 120, 15, 2)], (0.12,),
             lag(0.0003, 0.0002)),
        # creep
        case("creep-log", "plays-exp", "pi", (0, 100), 15, 50, [steps(12, 12, 0.3)], [steps(8, 8, 0.3)], (0.08,), creep("log", 0.032, 0.08)),
        case("creep-power", "preisach-gauss", "preisach", (0, 120), 28, 100, [steps(ladder(5), 7, 0.2), sine(0.5, 10), hold(15)],
             [steps(6, 6, 0.2), sine(0.8, 8)], (0.07,), creep("power", 0.03, 1.0, 0.28)),
        case("creep-two-times", "maxwell", "maxwell-slip", (-150, 150), 4, 80, [wander(90, 40), steps(6, 10, 0.4)],
             [wander(40, 15), steps(5, 8, 0.5)], (0.1,), creep("times", 0.08, 0.8, 9.0)),
        case("creep-stretched", "bouc-wen", "bouc-wen", (0, 75), 9.5, 200, [prbs(2.5, 30, 0.4, 5)], [prbs(2, 20, 0.5, 4)], (0.09,),
             creep("stretched", 0.07, 3.0, 0.5)),
        # rate-dependence
        case("rate-power", "plays-log", "pi", (0, 100), 13, 2000, [sine(0.5, 2), sine(5, 15), sine(50, 150)], [sine(25, 50), sine(2, 4, 0.8)], (0.1,),
             rate("power", 0.25, 20, 0.4)),
        case("rate-log", "maxwell", "maxwell-slip", (-100, 100), 33, 1000, [tri(0.4, 2), tri(2, 8), tri(10, 40), tri(30, 90)],
             [tri(1, 3), tri(20, 50, 0.8)], (0.1,), rate("log", 0.14, 0.5)),
        case("rate-activated", "preisach-lorentz", "preisach", (0, 100), 10, 1000, [chirp(0.2, 60, 15)], [chirp(40, 0.5, 8), sine(10, 20, 0.8)],
             (0.08,), rate("activated", 0.1, 1.0)),
        case("rate-overstress", "stops-flat", "pi", (0, 60), 2.2, 5000, [sine(2, 4), sine(20, 40), sine(90, 180)], [sine(45, 60), sine(6, 6, 0.8)],
             (0.1,), overstress(6e-5, 2)),
        # resonance
        case("mode-chirp", "bouc-wen-sharp", "bouc-wen", (0, 100), 5, 12000, [chirp(10, 420, 2)], [chirp(350, 20, 1), sine(150, 60)], (0.1,),
             resonance((940, 0.03, 1.0))),
        case("two-modes-steps", "stops-flat", "pi", (0, 150), 70, 5000, [steps(14, 0.25, 0.0022)], [steps(9, 0.2, 0.0022)], (0.08,),
             resonance((310, 0.02, 0.7), (870, 0.015, 0.2)), over=2),
        case("mode-raster", "krasnoselskii", "preisach", (0, 100), 110, 4000, [tri(30, 90, soft=0.015), tri(12, 30, 0.6)],
             [tri(20, 30, 0.9, soft=0.02), tri(35, 30, 0.5)], (0.07,), resonance((410, 0.035, 1.0)), over=2),
        # saturation
        case("hard-stop", "rayleigh", "pi", (0, 120), 44, 500, [fade(1, 10, 1, 0.3, True), fade(0.5, 4, 0.5, 1, True)],
             [sine(0.8, 4), sine(2, 6, 0.5)], (0.1,), saturation("hard", 0.8)),
        case("soft-both-ends", "plays-exp", "pi", (-200, 200), 6.5, 200, [walk(60, 1.0)], [fade(0.4, 8, 1, 0.3)], (0.08,), saturation("tanh", 1.5)),
        case("amplifier-rail", "maxwell", "maxwell-slip", (-30, 130), 12, 400, [multisine(0.5, 12, 14, 20)], [sine(1, 4), multisine(1, 10, 9, 8)],
             (0.1, 0.04), saturation("rail", 2.0, low=-0.66)),
        # asymmetry
        case("square-behind", "ramberg-osgood", "pi", (0, 100), 19, 600, [fade(1, 10, 1, 0.2, True), sine(2, 10)], [wander(9, 20)], (0.1,),
             asymmetry("square", 0.06)),
        case("bent-drive", "dahl", "bouc-wen", (0, 150), 36, 150, [sine(0.3, 6), sine(0.5, 8, 0.5, 0.4), sine(0.5, 8, 0.5, -0.4)],
             [tri(0.4, 5), sine(0.4, 4, 0.5)], (0.1,), asymmetry("exponential", 0.06)),
        case("branch-bulge", "plays-exp", "pi", (-100, 200), 25, 1000, [minors(0.5, 4, 11, 0.2), sine(1, 5)], [sine(2, 6, 0.9), walk(6, 4)], (0.1,),
             asymmetry("branch", 0.11)),
        # temperature
        case("warm-gain", "plays-log", "pi", (0, 100), 17, 60, [wander(300, 200)], [wander(120, 90)], (0.1,), temperature(late=12, gain=0.004),
             temp=("oven", 30, 9, 0.03)),
        case("warm-zero", "dahl", "bouc-wen", (-60, 60), 1.5, 50, [fade(0.4, 48, 1, 0.3)], [wander(60, 30)], (0.12,), temperature(late=4, zero=0.016),
             temp=("hvac", 21, 3, 0.02)),
        case("warm-width", "maxwell", "maxwell-slip", (0, 120), 10, 100, [sine(0.3, 40), fade(0.5, 20, 1, 0.3, True)],
             [sine(0.25, 8), wander(30, 20)], (0.08,), temperature(late=6, arrhenius=3000), temp=("ramp", 32, 14, 0.04)),
        case("warm-curie", "preisach-gauss", "preisach", (0, 100), 40, 80, [wander(150, 110)], [wander(70, 60)], (0.07, 0.03),
             temperature(curie=140, zero=-0.0008), temp=("oven", 26, 9, 0.05)),
        # load
        case("weights", "stops-flat", "pi", (0, 150), 60, 100, [sine(0.4, 24), wander(30, 20)], [wander(40, 30)], (0.1,), load(compliance=0.0022),
             force=("weights", 25, 20, 0.1)),
        case("shaken", "bouc-wen", "bouc-wen", (0, 100), 14, 500, [sine(3, 60), sine(7, 70, 0.6)], [sine(4, 40)], (0.1,), load(gain=-0.0014),
             force=("shaker", 40, 28, 0.2)),
        case("preload", "preisach-lognormal", "preisach", (0, 120), 35, 120, [wander(80, 90)], [wander(40, 50)], (0.08,),
             load(gain=-0.16, half=60, compliance=0.0003), force=("gusts", 60, 50, 0.3)),
        # drift
        case("drift-line", "plays-exp", "pi", (-100, 100), 3.4, 100, [sine(0.5, 30), walk(30, 1.0)], [wander(40, 30)], (0.12,), drift("line", 0.09)),
        case("drift-root", "preisach-triangle", "preisach", (-80, 80), 5, 200, [fade(1, 45, 1, 0.1)], [wander(25, 30)], (0.1,), drift("root", -0.1)),
        case("drift-settling", "kondner", "maxwell-slip", (-100, 100), 22, 150, [fade(0.5, 16, 1, 0.25), sine(1, 30, 0.8)], [sine(0.8, 20)], (0.08,),
             drift("settling", 0.1, 0.3)),
        # interference
        case("mains", "ramberg-osgood", "pi", (0, 100), 7, 1000, [sine(0.7, 5), sine(4, 20)], [sine(2, 8), walk(3, 5)], (0.1,),
             hum(49.97, 0.02, 0.006, 0.01)),
        case("pump", "endochronic", "bouc-wen", (0, 150), 15, 200, [tri(0.5, 10), tri(1, 10, 0.6)], [wander(14, 16)], (0.12,),
             hum(23.4, 0.025, 0.009, swell=0.4)),
        case("fans", "hysterons", "preisach", (-20, 130), 26, 2500, [wander(9, 50)], [sine(5, 20)], (0.08,),
             tones((87.3, 0.015), (118.6, 0.01), (401, 0.006))),
        # two effects
        case("creep-warm", "plays-exp", "pi", (0, 100), 16, 60, [steps(20, 6, 0.4), wander(60, 40)], [steps(8, 5, 0.4), wander(30, 20)], (0.1,),
             creep("log", 0.038, 0.1), temperature(zero=0.007), temp=("hvac", 23, 5, 0.03)),
        case("lag-mains", "dahl", "bouc-wen", (0, 80), 6, 2000, [sine(3, 6), sine(17, 34), sine(70, 140)], [chirp(2, 60, 3)], (0.1,),
             lag(0.0005), hum(50.02, 0.014, 0.004, 0.01)),
        case("mode-delay", "maxwell", "maxwell-slip", (-100, 100), 9, 10000, [chirp(5, 410, 2.4, straight=True)], [chirp(300, 5, 1.2, straight=True)],
             (0.1,), delay(0.00011, sensor=True), resonance((740, 0.04, 1.0)), over=2),
        case("rate-drift", "plays-log", "pi", (-120, 120), 3, 1000, [sine(0.5, 3), sine(4, 20), sine(25, 125)], [sine(10, 40), sine(2, 6, 0.8)],
             (0.1,), rate("log", 0.12, 2.0), drift("bow", 0.05, 0.6)),
        case("stop-mains", "kondner", "pi", (0, 150), 50, 800, [sine(0.5, 3), fade(1, 8, 1, 0.4, True)], [sine(0.7, 5)], (0.1,),
             saturation("knee", 0.75, slope=0.3), hum(60, 0.018, 0.005, 0.007)),
        case("load-warm", "preisach-lorentz", "preisach", (0, 100), 33, 50, [wander(200, 140)], [wander(90, 70)], (0.08,),
             load(seat=0.004), temperature(late=8, gain=0.005), temp=("oven", 28, 8, 0.04), force=("weights", 20, 18, 0.1)),
        case("bent-creep", "bouc-wen-sharp", "bouc-wen", (0, 100), 13, 80, [steps(20, 4, 0.3), sine(0.4, 16)], [steps(10, 4, 0.3), sine(0.6, 6)],
             (0.1,), asymmetry("square", -0.05), creep("times", 0.08, 1.1, 7.0)),
        case("corner-load", "maxwell-steep", "maxwell-slip", (0, 120), 20, 250, [fade(1, 24, 1, 0.2, True), sine(2, 20)], [sine(1.5, 20)], (0.1,),
             asymmetry("corner", 0.13), load(compliance=0.002), force=("gusts", 30, 24, 0.1)),
        case("zero-pair-pump", "stops-flat", "pi", (0, 60), 4.5, 8000, [prbs(0.03, 90, 0.003, 4), chirp(5, 200, 1)], [prbs(0.025, 60, 0.003, 3)],
             (0.1,), notched(480, 0.03, 560), tones((29.7, 0.014), (59.4, 0.008), (173, 0.006))),
        case("drift-tones", "tellinen", "preisach", (-75, 75), 2.8, 500, [wander(24, 40)], [wander(12, 20)], (0.1,), drift("root", 0.08),
             tones((16.67, 0.015), (100.1, 0.01))),
        case("rate-warm", "maxwell-steep", "maxwell-slip", (0, 100), 11, 400, [tri(0.5, 12), tri(5, 100), tri(20, 300), sine(0.5, 12)],
             [tri(1, 8), tri(12, 100), tri(3, 15)], (0.1,), rate("power", 0.3, 10, 0.35), temperature(gain=0.006), temp=("hvac", 27, 5, 0.03)),
        case("stop-delay", "rayleigh", "pi", (0, 130), 38, 1500, [sine(1, 3), sine(6, 18), sine(30, 75, 0.8), sine(60, 120, 0.6)],
             [sine(20, 40), sine(3, 9, 0.9)], (0.1,), delay(0.0007), saturation("hard", 0.78), over=2),
        case("creep-mode", "preisach-triangle", "preisach", (0, 100), 24, 1200, [steps(16, 1.8, 0.004)], [steps(10, 1.5, 0.004)], (0.08,),
             creep("log", 0.03, 0.05), resonance((165, 0.03, 0.6)), over=2),
        case("lag-load", "coleman-hodgdon", "bouc-wen", (-60, 60), 2, 600, [sine(1, 8), sine(8, 64), sine(30, 240)],
             [sine(15, 60), sine(4, 12, 0.8)], (0.1,), lag(0.0009, 0.0003), load(gain=0.003), force=("weights", 20, 15, 0.1)),
        # none of the eleven
        case("bistable-mount", "plays-exp", "pi", (0, 100), 10, 200, [wander(60, 90)], [wander(30, 45)], (0.1,), unknown("bistable mount", 0.09, 25)),
        case("footfalls", "neural", "preisach", (0, 150), 32, 250, [sine(0.4, 16), wander(20, 30)], [wander(30, 40)], (0.08,),
             unknown("footfalls", 0.12, 24)),
        case("cyclic-error", "maxwell", "maxwell-slip", (0, 100), 8.4, 400, [sine(0.2, 4), fade(0.25, 6, 1, 0.3, True)],
             [sine(0.15, 3), sine(0.2, 2, 0.6)], (0.04,), unknown("cyclic error", 0.01, 0, 8.4)),
        case("wandering-clock", "dahl", "bouc-wen", (-150, 150), 12, 1000, [sine(2, 10), sine(5, 30, 0.8), tri(3, 15)], [sine(4, 24)], (0.1,),
             unknown("wandering clock", 0.0016, 160), over=2),
        case("flickering-lamp", "ramberg-osgood", "pi", (0, 90), 27, 300, [sine(0.5, 10), sine(1.5, 30, 0.7)], [wander(25, 40)], (0.1,),
             unknown("flickering lamp", 0.02, 70)),
    ]

# ---------------------------------------------------------------- records
def record(c, number, which, scale=None):
    """Simulates one record. Returns times, drive, recorded columns, a function of the list of effects that returns the output, and a generator."""
    rng = np.random.default_rng([14, number, which])
    fine, pieces = c.fs * c.over, []
    for form in c.test if which else c.train:
        last = pieces[-1][-1] if pieces else None
        x = form(fine, rng, last)
        if pieces and abs(x[0] - last) > 0.02:
            rows = max(8, int(0.04 * len(x) * abs(x[0] - last)))
            pieces.append(last + (x[0] - last) * (1 - np.cos(np.pi * np.arange(1, rows) / rows)) / 2)
        pieces.append(x)
    u = np.concatenate(pieces) * (0.95 if which else 1.0)
    skip = round(c.cut * c.fs) * c.over
    turns = {
        "cycled": [1, -1, 1, -1, 1, -1],
        "fresh": np.geomspace(1, 0.01, 60) * (-1) ** np.arange(60),
        "rough": [1, -1, *np.random.default_rng([141, number, which]).uniform(-1, 1, 9)],
    }[c.past]
    turns = np.r_[0, turns, u[0]]
    past = np.concatenate([np.linspace(a, b, 100, endpoint=False) for a, b in zip(turns, turns[1:])])
    k = SimpleNamespace(dt=1 / fine, t=(np.arange(len(u)) - skip) / fine, zero=0.0 if c.bipolar else -1.0, calm={})
    k.x = np.arange(-skip, len(u) - skip) / (len(u) - skip)
    k.steps = np.r_[np.full(len(past), 1e3), np.full(len(u), k.dt)]
    rows, columns = np.arange(skip, len(u), c.over), {}
    for name, key, spec in [("temperature_degc", "temperature", c.temp), ("load_n", "load", c.force)]:
        if spec:
            values = spec[1] + spec[2] * course(spec[0], np.clip(k.x, 0, 1), rng)
            setattr(k, key, values)
            k.calm[key] = spec[1]
            columns[name] = values[rows] + spec[3] * rng.normal(0, 1, len(rows))

    def output(effects):
        """Returns the output with some of the effects, scaled by the output without effects."""
        k.wide, k.bend, k.viscous, x = np.ones(len(u)), None, None, u
        for e in effects:
            x = e.before(x, k) if e.before else x
        k.gaps = np.r_[np.full(len(past), k.wide[0]), k.wide]
        y = LAWS[c.law](np.r_[past, x], k)[len(past) :]
        if scale:
            y = (y - scale[0]) / scale[1]
        for i, e in enumerate(c.effects):
            k.rng = np.random.default_rng([142, number, which, i])
            y = e.behind(y, k) if e.behind and any(e is o for o in effects) else y
        return y[rows]

    return k.t[rows], u[rows], columns, output, rng

def disturbance(c, rows, rng):
    """Returns white and 1/f noise in half spans."""
    f = np.fft.rfftfreq(2 * rows)[1:]
    pink = np.fft.irfft(np.r_[0, rng.normal(0, 1, len(f)) * np.exp(2j * np.pi * rng.uniform(0, 1, len(f))) / np.sqrt(f)], 2 * rows)[:rows]
    return 0.02 * (c.noise[0] * rng.normal(0, 1, rows) + c.noise[1] * (pink - pink.mean()) / np.std(pink))

def left(d, *columns):
    a = np.column_stack([np.ones(len(d)), *columns])
    return float(np.sqrt(np.mean((d - a @ np.linalg.lstsq(a, d, rcond=None)[0]) ** 2)))

def share(d, u, y):
    """Returns the RMS of a difference behind offset and gain, and behind a sum of plays as well."""
    return left(d, y), left(d, y, u, bank(u, u, np.geomspace(0.02, 0.85, 14), np.ones(len(u))))

def write(path, table):
    """Writes columns: times with nine significant digits, other values with six."""
    with open(path, "w") as file:
        file.write(",".join(table) + "\n")
        np.savetxt(file, np.column_stack(list(table.values())), fmt=["%.9g" if name == "time_s" else "%.6g" for name in table], delimiter=",")

def build(c, number, folder):
    """Writes one case. Returns its lines of the table and its numbers of rows."""
    plain = record(c, number, 0)[3]([])
    scale = ((plain.max() + plain.min()) / 2, np.ptp(plain) / 2)
    zero = np.random.default_rng([143, number]).uniform(-0.4, 0.8) * abs(c.stroke)
    step = 2.5 / 2 ** c.noise[2] if c.noise[2] else 0.0
    warnings, found, sizes = [], {}, []
    os.makedirs(folder, exist_ok=True)
    for which, name in enumerate(("train", "test")):
        t, u, columns, output, rng = record(c, number, which, scale)
        sizes.append(len(u))
        lowest, unit = c.volts[0], (c.volts[1] - c.volts[0]) / 2**16
        volts = lowest + np.round((u + 1) * 2**15) * unit
        twin, real = output([]), output(list(c.effects))
        noise = disturbance(c, len(u), rng)
        for prefix, y in (("twin-", twin), ("", real)):
            y = np.round((y + noise) / step) * step if step else y + noise
            table = dict(time_s=t, voltage_v=volts, displacement_um=zero + c.stroke / 2 * (y + 1), **columns)
            assert all(np.isfinite(v).all() for v in table.values()), c.name
            write(f"{folder}/{prefix}{name}.csv", table)
        assert bool(c.effects) != np.array_equal(real, twin), c.name
        if np.ptp(u) < (1.4 if which else 1.95) or np.abs(u).max() > 1.0001:
            warnings.append(f"{name} drive {u.min():.2f} to {u.max():.2f}")
        warnings += [f"{name} {key} follows the drive" for key, v in columns.items() if abs(np.corrcoef(v, u)[0, 1]) > 0.3]
        floor = math.sqrt(np.mean(noise**2) + step**2 / 12)
        for e in c.effects:
            plain, rich = share(real - output([o for o in c.effects if o is not e]), u, twin)
            found.setdefault(e.name, []).extend([plain / floor] if which else [plain / floor, rich / floor])
            if plain < (3 if which else 6) * floor or which == 0 and (rich < 4 * floor or plain > 80 * floor) or plain > 0.16:
                warnings.append(f"{name} {e.name} {plain / floor:.1f} ({rich / floor:.1f}) floors, {50 * plain:.1f} %")
    truth = dict(expect=sorted(e.name for e in c.effects), accept=[sorted(a) for a in c.accept], base=c.law, model=c.model)
    truth["about"] = "; ".join(e.about for e in c.effects)
    with open(f"{folder}/truth.json", "w") as file:
        json.dump(truth, file, indent=1)
    text = "  ".join("{} {:.0f} ({:.0f}) {:.0f}".format(n, *v) for n, v in found.items())
    line = f"{os.path.basename(folder):24} {c.law:18} {c.model:12} {sizes[0]:6} {sizes[1]:6} rows {sizes[0] / c.fs:6.1f} s  "
    line += f"floor {50 * floor:.3f} %  loop {50 * left(twin, u):4.1f} %  {text}"
    return line + "".join(f"\n  !! {w}" for w in warnings), sizes

def main():
    """Writes the cases whose names begin with a prefix, or all."""
    folder, *prefixes = sys.argv[1:]
    everything, rows = cases(), []
    assert len(everything) == 72 and len({c.name for c in everything}) == 72
    for number, c in enumerate(everything, 1):
        name = f"v{number:02}-{c.name}"
        if prefixes and not name.startswith(tuple(prefixes)):
            continue
        line, sizes = build(c, number, f"{folder}/{name}")
        rows.append(sizes)
        print(line, file=sys.stderr, flush=True)
    rows = np.array(rows)
    print(f"{len({c.law for c in everything})} laws; training rows {rows[:, 0].min()} to {rows[:, 0].max()}, rows of both records {rows.sum()}",
          file=sys.stderr)

if __name__ == "__main__":
    main()
