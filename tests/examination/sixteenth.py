"""Writes a sixteenth set of made-up records for the diagnosis: `python -B sixteenth.py DIR [id-prefix ...]` (needs numpy, scipy, numba).

Each case is a folder DIR/xNN-short-name with
  train.csv, test.csv            time_s, voltage_v, displacement_um and, where recorded, temperature_degc or load_n
  twin-train.csv, twin-test.csv  the same drive, hysteresis law and noise without any of the effects
  truth.json                     expected effects, other accepted sets, law, kind of model to fit, a text about the effects
66 cases: 16 without an effect (one for each law), 32 with one effect, 14 with two, 4 with a fault that has no name ("unknown").

Sixteen rate-independent laws, all odd about the middle of the drive: two Preisach densities, Krasnosel'skii-Pokrovskii kernels,
two Masing laws, plays behind a sinh, plays with nonlinear read-outs, Iwan sliders, Coleman-Hodgdon, Bouc-Wen, Dahl, an
elastoplastic bristle, Jiles-Atherton, walls in random pinning fields, Stoner-Wohlfarth grains, Landau grains. A law h is
scaled to its major loop; the actuator does x + part (h - x), the loop 5 to 20 % open. Inside, drive and motion are -1 to 1.

The table on stderr shows for each effect and record the RMS of the difference that this effect alone makes (mean removed) in
standard deviations of the noise and in percent of the span and, in brackets, what a least-squares fit of gain, offset and
12 plays of the drive leaves of it in standard deviations of the noise. A line with !! is a rule that the case breaks:
training 5 standard deviations and 1 % (drift, interference 0.3 %), 4 left; test 2.5; temperature, load: |r| < 0.3 with the drive.
"""
import json
import math
import os
import sys
from functools import lru_cache
from types import SimpleNamespace

import numpy as np
from numba import njit
from scipy.signal import cont2discrete, fftconvolve, lfilter
from scipy.special import betaincinv, expit

# ---------------------------------------------------------------------------------------------------- hysteresis laws

EDGE, GRID = 1.7, 850

@njit
def look(table, a, b):
    i, j = (a + EDGE) * GRID / (2 * EDGE), (b + EDGE) * GRID / (2 * EDGE)
    m, n = min(max(int(i), 0), GRID - 1), min(max(int(j), 0), GRID - 1)
    p, q = i - m, j - n
    return (1 - p) * ((1 - q) * table[m, n] + q * table[m, n + 1]) + p * ((1 - q) * table[m + 1, n] + q * table[m + 1, n + 1])

@njit
def everett(x, table):
    """Return-point memory: turning points on a stack; a table of the Everett function gives the increments."""
    sx, sy, top, up = np.zeros(len(x) + 2), np.zeros(len(x) + 2), 0, True
    sx[0], sy[0] = -EDGE, -0.5 * table[GRID, 0]
    out, last, y = np.zeros(len(x)), -EDGE, sy[0]
    for i in range(len(x)):
        v = x[i]
        if v != last:
            if (v > last) != up:
                top += 1
                sx[top], sy[top], up = last, y, v > last
            while top >= 2 and (v >= sx[top - 1] if up else v <= sx[top - 1]):
                top -= 2
            step = look(table, max(v, sx[top]), min(v, sx[top]))
            y = sy[top] + step if up else sy[top] - step
            last = v
        out[i] = y
    return out

@lru_cache(None)
def density(kind):
    """Everett table of a Preisach density, mirrored behind the diagonal."""
    c = -EDGE + (np.arange(GRID) + 0.5) * 2 * EDGE / GRID
    a, b = np.meshgrid(c, c, indexing="ij")
    half, middle = np.maximum(a - b, 1e-9) / 2, (a + b) / 2
    gauss = np.exp(-np.log(half / 0.32) ** 2 / 0.5 - (middle / 0.55) ** 2 / 2)
    cauchy = 1 / ((1 + ((a - 0.25) / 0.45) ** 2) * (1 + ((b + 0.25) / 0.45) ** 2))
    mu = (gauss if kind == "gauss" else cauchy) * np.where(a > b, 1, np.where(a == b, 0.5, 0))
    table = np.zeros((GRID + 1, GRID + 1))
    table[1:, :-1] = np.cumsum(np.cumsum(mu[:, ::-1], 1)[:, ::-1], 0)
    table = np.tril(table)
    return (table + table.T) / table.max()

@lru_cache(None)
def masing(size, power):
    """Masing's rule for the curve s + size s^power."""
    s = np.abs(np.subtract.outer(*[np.linspace(-EDGE, EDGE, GRID + 1)] * 2)) / 2
    return 2 * (s + size * s**power)

@njit
def plays(x, radii):
    out, p = np.zeros((len(x), len(radii))), np.zeros(len(radii))
    for i in range(len(x)):
        for j in range(len(radii)):
            p[j] = min(max(p[j], x[i] - radii[j]), x[i] + radii[j])
            out[i, j] = p[j]
    return out

@njit
def stops(x, bounds):
    """One stop whose bound changes in time."""
    out, e = np.zeros(len(x)), 0.0
    for i in range(1, len(x)):
        e = min(max(e + x[i] - x[i - 1], -bounds[i]), bounds[i])
        out[i] = e
    return out

def sinh_play(x):
    r = 0.05 * np.arange(1, 11)
    return plays(np.sinh(1.1 * x) / np.sinh(1.1), r) @ np.exp(-3 * r)
def read_out(x):
    r = np.array([0.04, 0.1, 0.17, 0.27, 0.4, 0.55, 0.7])
    p = plays(x, r)
    dead = p[:, 3] - np.clip(p[:, 3], -0.25, 0.25)
    return p @ np.array([0.5, 0.7, 0.8, 0.6, 0.4, 0.3, 0.2]) + 0.5 * p[:, 2] ** 3 + 0.8 * dead
def iwan(x):
    """Sliders with a power-law density of slip limits: what they hold back."""
    f = 0.8 * (np.arange(1, 33) / 32) ** 2
    return 1.5 * x - (x[:, None] - plays(x, f)) @ (f**-0.15 / 32)

@njit
def kernels(x, centres, width, weight):
    """Krasnosel'skii-Pokrovskii: ramps of +-0.2 that rise behind and fall before their centre."""
    state, out = -np.ones(len(centres)), np.zeros(len(x))
    for i in range(len(x)):
        for j in range(len(centres)):
            high = min(max((x[i] - centres[j] + width[j]) / 0.2, -1), 1)
            low = min(max((x[i] - centres[j] - width[j]) / 0.2, -1), 1)
            state[j] = min(max(state[j], low), high)
            out[i] += weight[j] * state[j]
    return out

def kp(x):
    p, c = (v.ravel() for v in np.meshgrid(np.linspace(-1.5, 1.5, 31), np.linspace(0.02, 0.8, 9)))
    return kernels(x, p, c, np.exp(-((p / 0.8) ** 2) / 2 - c / 0.3))

@njit
def bristle(x, kind):
    """Laws of the form dz = f(z, x, sign dx) dx, in short steps."""
    z, out, last = 0.0, np.zeros(len(x)), x[0]
    for i in range(len(x)):
        n = int(abs(x[i] - last) / 0.004) + 1
        d = (x[i] - last) / n
        s = 1.0 if d > 0 else -1.0
        for m in range(n):
            v = last + (m + 0.5) * d
            if kind == 0:  # Coleman-Hodgdon: z is the motion
                z += 2.4 * abs(d) * (1.1 * v - 0.1 * v**3 - z) + (0.62 - 0.12 * v * v) * d
            elif kind == 1:  # Bouc-Wen
                a = abs(z) / 0.34
                z += d * (1 - a**1.6 * (0.62 * np.sign(z) * s + 0.38))
            elif kind == 2:  # Dahl
                a = 1 - s * z / 0.5
                z += d * np.sign(a) * abs(a) ** 1.4
            elif kind == 3:  # elastoplastic: sticks up to a breakaway
                a = abs(z) / 0.3
                part = 0.0 if z * s < 0 or a < 0.35 else 1.0 if a > 1 else 0.5 - 0.5 * np.cos(np.pi * (a - 0.35) / 0.65)
                z += d * (1 - part * s * z / 0.3)
            else:  # Jiles-Atherton with a Langevin curve
                h = (v + 0.15 * z) / 0.45
                h = h if abs(h) > 1e-3 else 1e-3
                m0, slope = 1 / np.tanh(h) - 1 / h, 1 / h**2 - 1 / np.sinh(h) ** 2
                irr = (m0 - z) / (0.3 * s - 0.15 * (m0 - z)) if (m0 - z) * s > 0 else 0.0
                z += d * (0.75 * irr + 0.25 * slope / 0.45)
        last = x[i]
        out[i] = z if kind == 0 or kind == 4 else x[i] - (0.36 if kind == 2 else 0.75) * z
    return out

@njit
def walls(x, field, first, pitch):
    """Domain walls in random pinning fields: each stands at the first place that holds it."""
    out = np.zeros(len(x))
    for w in range(len(field)):
        f, i = field[w], 1
        for j in range(len(x)):
            while f[i] < x[j]:
                i += 1
            while f[i - 1] > x[j]:
                i -= 1
            g = f[i] - f[i - 1]
            out[j] += first + pitch * (i - 1 + ((x[j] - f[i - 1]) / g if g > 0 else 0.5))
    return out / len(field)

@lru_cache(None)
def pinning_fields():
    rng, places = np.random.default_rng(1616), np.linspace(-3, 3, 1201)
    rough = rng.normal(0, 1, (200, 1201 + 160))
    bell = np.exp(-np.linspace(-2.5, 2.5, 81) ** 2)
    smooth = np.array([np.convolve(r, bell, "same")[80:-80] for r in rough])
    field = 0.33 * smooth / smooth.std()
    return places + np.r_[field, -field[:, ::-1]]

@njit
def bistable(x, scale, bias, limit, which, curves, mass):
    """Grains with two branches: the upper one is a curve over -1 to 3 and ends at -limit; at first half of them are down."""
    out = np.zeros(len(x))
    for g in range(len(scale)):
        s, c, n = -1.0 if 2 * g < len(scale) else 1.0, curves[which[g]], curves.shape[1] - 1
        for i in range(len(x)):
            h = (x[i] - bias[g]) / scale[g]
            if s * h < -limit[g]:
                s = -s
            q = min(max((s * h + 1) * n / 4, 0), n - 1e-9)
            m = int(q)
            out[i] += mass[g] * s * (c[m] + (q - m) * (c[m + 1] - c[m]))
    return out

@lru_cache(None)
def stoner_grains():
    rng, h = np.random.default_rng(1617), np.linspace(-1, 3, 801)
    angles = np.linspace(0.08, 1.5, 15)
    curves, ends = [], []
    for a in angles:
        phi = np.linspace(1e-3, a + 1.5, 6000)
        field = -np.sin(2 * (phi - a)) / (2 * np.sin(phi))
        stop = np.argmin(field)
        curves.append(np.interp(h, field[stop::-1], np.cos(phi[stop::-1])))
        ends.append(-field[stop])
    which, scale = np.tile(np.arange(15), 40), np.tile(0.78 * np.exp(0.55 * rng.normal(0, 1, 300)), 2)
    return scale, np.zeros(600), np.array(ends)[which], which, np.array(curves), np.sin(angles[which]) / 600

@lru_cache(None)
def landau_grains():
    rng, p = np.random.default_rng(1618), np.linspace(1 / math.sqrt(3), 2.2, 4000)
    curve = np.interp(np.linspace(-1, 3, 801), p**3 - p, p)
    a, bias = rng.uniform(0.2, 1.1, 600), 0.35 * rng.normal(0, 1, 600)
    scale = np.tile(a**1.5, 2)
    return scale, np.r_[bias, -bias], np.full(1200, 2 / math.sqrt(27)), np.zeros(1200, np.int64), curve[None], np.tile(a**0.5, 2) / 1200

LAWS = {
    "preisach-gauss": lambda x: everett(x, density("gauss")), "preisach-cauchy": lambda x: everett(x, density("cauchy")),
    "rayleigh": lambda x: everett(x, masing(0.6, 2)), "ramberg": lambda x: everett(x, masing(0.9, 2.7)),
    "kp": kp, "sinh-play": sinh_play, "read-out": read_out, "iwan": iwan,
    "coleman": lambda x: bristle(x, 0), "bouc-wen": lambda x: bristle(x, 1), "dahl": lambda x: bristle(x, 2),
    "elastoplastic": lambda x: bristle(x, 3), "jiles": lambda x: bristle(x, 4),
    "pinning": lambda x: walls(x, pinning_fields(), -3.0, 0.005),
    "stoner": lambda x: bistable(x, *stoner_grains()), "landau": lambda x: bistable(x, *landau_grains()),
}

@lru_cache(None)
def major(law):
    """Returns middle, half span and opening of the major loop."""
    one = np.r_[np.linspace(-1, 1, 801), np.linspace(1, -1, 801)[1:]]
    h = LAWS[law](np.tile(one, 4))[-1601:]
    rise, fall = h[:801], h[800:][::-1]
    half = (h.max() - h.min()) / 2
    return (h.max() + h.min()) / 2, half, np.max(fall - rise) / (2 * half)

# ------------------------------------------------------------------------------- drives: functions of time and of a generator

def wave(p):
    return np.sin(2 * np.pi * p)
def tri(p):
    return 2 / np.pi * np.arcsin(np.sin(2 * np.pi * p))
def rounded(p):
    """A scanner's triangle without its higher harmonics."""
    return sum((-1) ** m * wave((2 * m + 1) * p) / (2 * m + 1) ** 2 for m in range(6))
def saw(p):
    """Slow forth, quick back, with a smoothed return."""
    q = (p + 0.4) % 1
    return np.where(q < 0.8, q / 0.4 - 1, np.cos(np.pi * (q - 0.8) / 0.2))
def sines(*parts):
    return lambda t, rng: sum(a * wave(f * t + rng.uniform()) for f, a in parts)
def cycles(f, shape=wave, phase=0.0):
    return lambda t, rng: shape(f * t + phase)
def swell(f, first, last, shape=wave):
    """A wave whose amplitude grows or shrinks."""
    return lambda t, rng: shape(f * t) * (first + (last - first) * np.clip(t / t[-1], 0, 1))
def schedule(*steps, shape=wave):
    """Frequencies one after another: (frequency, seconds, amplitude)."""
    def drive(t, rng):
        ends = np.cumsum([s for _, s, _ in steps])
        i = np.minimum(np.searchsorted(ends, np.maximum(t, 0) % ends[-1], "right"), len(steps) - 1)
        f, a = np.array([[f, a] for f, _, a in steps]).T
        p = np.cumsum(f[i]) * (t[1] - t[0])
        ease = np.convolve(np.r_[np.full(20, a[i[0]]), a[i], np.full(20, a[i[-1]])], np.ones(41) / 41, "valid")
        return ease * shape(p - p[np.argmin(np.abs(t))])
    return drive

def raster(line, frame, fast=0.6, shape=rounded):
    """AFM: fast lines and a slow axis through the same piezo."""
    return lambda t, rng: fast * shape(line * t) / np.max(np.abs(shape(np.arange(400) / 400))) + (1 - fast) * tri(frame * t - 0.23)
def chirp(first, last, shape=wave):
    def drive(t, rng):
        rate = np.log(last / first) / t[-1]
        return shape(np.where(t > 0, first * np.expm1(rate * np.maximum(t, 0)) / rate, first * t) + 0.1)
    return drive
def band(low, high, slope=0.5, lines=90):
    def drive(t, rng):
        f = low * (high / low) ** rng.uniform(0, 1, lines)
        return sum(v**-slope * wave(v * t + q) for v, q in zip(f, rng.uniform(0, 1, lines)))
    return drive
def moves(levels, dwell, ramp, smooth=False, slew=False):
    """Goes to levels (a list, or a function of the generator) with a ramp in seconds (slew: per unit) and dwells; repeats."""
    def drive(t, rng):
        goal = np.array(levels(rng) if callable(levels) else levels, float)
        goal = np.tile(goal, 1 + int((t[-1] - t[0]) / (len(goal) * (dwell + ramp * (0.3 if slew else 1)))))
        times = np.abs(np.diff(goal)) * ramp if slew else np.full(len(goal) - 1, ramp)
        start = t[0] + dwell + np.r_[0, np.cumsum(times + dwell)[:-1]]
        i = np.clip(np.searchsorted(start, t, "right") - 1, 0, len(start) - 1)
        part = np.clip((t - start[i]) / np.maximum(times[i], 1e-9), 0, 1)
        part = 0.5 - 0.5 * np.cos(np.pi * part) if smooth else part
        return goal[i] + (goal[i + 1] - goal[i]) * part
    return drive

def spots(n, spread=1.0):
    return lambda rng: np.r_[rng.uniform(-1, 1, n - 4) * spread, -1, 0.2, 1, -0.1]
def updown(n):
    return list(np.linspace(-1, 1, n)) + list(np.linspace(1, -1, n))[1:-1]
def reversal(n):
    """First-order reversal curves."""
    return [v for a in np.linspace(-0.95, 0.85, n) for v in (1, a)] + [1, -1]
def jog(n, size):
    """Small steps about places far apart."""
    return lambda rng: np.ravel(np.r_[-0.9, 0.8, rng.uniform(-0.9, 0.9, n)][:, None] + size * np.array([0, 1, 0, -1, 0, 2, 0]))
def then(wait, drive):
    """The drive after a wait at its first value."""
    return lambda t, rng: drive(np.maximum(t - t[0] - wait, 0) + 1e-12 * t, rng)
def bursts(f, on, off):
    """Bursts of whole cycles with rests."""
    def drive(t, rng):
        q = t % (on + off)
        size = np.array([1, 0.55, 0.8, 0.35])[(t // (on + off)).astype(int) % 4]
        return np.where(q < on, size * np.sin(2 * np.pi * np.round(f * on) / on * q), 0)
    return drive

# ------------------------------------------------------------------------------------------------------------- effects

def effect(name, about, post=None, pre=None, width=None, where=None):
    """post: behind the hysteresis; pre: before it, as is post where it is the drive or amplifier; width: factor of the loop."""
    pre, post = (post, None) if where in ("drive", "amplifier") else (pre, post)
    return SimpleNamespace(name=name, about=about, pre=pre, width=width, post=post)

def pole(y, tau, k):
    """First-order low-pass, exact for straight lines between samples; begins at rest."""
    a, r = math.exp(-k.dt / tau), tau / k.dt
    return y[0] + lfilter([1 - r * (1 - a), r * (1 - a) - a], [1, -a], y - y[0])
def delay(seconds, where="sensor"):
    return effect("delay", f"dead time of {1e3 * seconds:g} ms at the {where}", lambda y, k: np.interp(k.t - seconds, k.t, y), where=where)

def lag(*taus, order=1.0, where="sensor"):
    """Real poles, or one Davidson-Cole low-pass 1 / (1 + s tau)^order as a mean of poles."""
    def f(y, k):
        if order < 1:
            return sum(pole(y, taus[0] * b, k) for b in betaincinv(order, 1 - order, (np.arange(60) + 0.5) / 60)) / 60
        for tau in taus:
            y = pole(y, tau, k)
        return y
    return effect("lag", f"low-pass of the {where}, time constants {taus} s, order {order} each", f, where=where)

def bend(size, power):
    """Behind the hysteresis: the upper end bends."""
    return effect("asymmetry", f"motion + {size} ((y + 1) / 2)^{power}", lambda y, k: y + size * np.maximum((y + 1) / 2, 0) ** power)

def exponential(size):
    """Before the hysteresis: steeper towards one end."""
    return effect("asymmetry", f"drive through exp({size} x / 2)", pre=lambda x, k: 2 * np.expm1(size * (x + 1) / 2) / math.expm1(size) - 1)

@njit
def two_sided(x, size):
    """A play whose gap opens towards the upper end, less the same one with the mean gap."""
    a = b = 0.0
    out = np.zeros(len(x))
    for i in range(len(x)):
        g = 0.22 * (1 + size * x[i])
        a = min(max(a, x[i] - g), x[i] + g)
        b = min(max(b, x[i] - 0.22), x[i] + 0.22)
        out[i] = a - b
    return out

def branches(size, weight):
    return effect("asymmetry", f"a play with gap 0.22 (1 + {size} x), weight {weight}", lambda y, k: y + weight * two_sided(k.x, size))

def speed(k, tau=0.0):
    v = np.abs(np.gradient(k.x, k.dt))
    return pole(v, tau, k) if tau else v
def rate(size, v0, power=0.0):
    """Stops whose bounds rise with a power or (thermally activated walls) the logarithm of the rate."""
    def f(y, k):
        v, ones = speed(k) / v0, np.ones(len(y))
        grow = 1 + size * (v**power if power else np.log1p(v))
        return y - 0.5 * sum(stops(k.x, b * grow) - stops(k.x, b * ones) for b in (0.06, 0.12, 0.22))
    return effect("rate-dependence", f"thresholds grow with {size} x {'power %g' % power if power else 'ln(1 +)'} of rate / {v0:g}", f)

def rate_width(size, v0, power, tau):
    return effect("rate-dependence", f"loop 1 + {size} (rate / {v0:g})^{power} wide, rate averaged for {tau:g} s",
                  width=lambda k: 1 + size * (speed(k, tau) / v0) ** power)

def thermal(gain=0.0, zero=0.0, width=0.0, tau=0.0, bow=0.0):
    """Parts for a swing of the temperature; tau: thermal lag behind the recorded one; bow: curvature."""
    def theta(k):
        v = pole(k.temperature, tau, k) if tau else k.temperature
        return v + bow * v * v
    about = f"temperature swing: gain {gain}, zero {zero}, loop {width}, lag {tau:g} s, curvature {bow}"
    return effect("temperature", about, width=(lambda k: 1 + width * theta(k)) if width else None,
                  post=(lambda y, k: y * (1 + gain * theta(k)) + zero * theta(k)) if gain or zero else None)

def creep(kind, size, t0, power=0.0):
    """Each change of the motion is followed by a slow one."""
    law = dict(log=lambda s: np.log10(1 + s), stretched=lambda s: -np.expm1(-(s**power)), power=lambda s: s**power)[kind]
    def f(y, k):
        return y + size * fftconvolve(np.diff(y, prepend=y[0]), law((k.t - k.t[0] + 0.5 * k.dt) / t0))[: len(y)]
    return effect("creep", f"{kind} creep {size} after {t0:g} s {power or ''}".strip(), f)

def load(deflect=0.0, slope=0.0, gain=0.0, power=1.0):
    """Parts for a swing of the force: deflection (stiffness depends on the position, or a power of the force) and gain."""
    def f(y, k):
        return y * (1 + gain * k.load) - deflect * np.sign(k.force) * np.abs(k.force) ** power * (1 + slope * y)
    return effect("load", f"force: deflection {deflect} (1 + {slope} y) F^{power}, gain {gain}", f)

def resonance(f0, damping, part=1.0, second=None):
    """A mode carries a part of the motion, or two modes."""
    def f(y, k):
        out = (1 - part) * y
        for share, f1, z in ((0.75, f0, damping), (0.25, *second)) if second else ((1, f0, damping),):
            w = 2 * np.pi * f1
            num, den, _ = cont2discrete(([w * w], [1, 2 * z * w, w * w]), k.dt, "foh")
            out = out + part * share * (y[0] + lfilter(num.ravel(), den, y - y[0]))
        return out
    return effect("resonance", f"mode at {f0:g} Hz, damping {damping}, part {part}, second {second}", f)

def knee(y, limit, width):
    """Upper limit, hard (width 0) or with a knee."""
    return limit - width * np.logaddexp(0, (limit - y) / width) if width else np.minimum(y, limit)
def saturation(top=None, bottom=None, width=0.0, where="sensor"):
    def f(y, k):
        y = knee(y, top, width) if top is not None else y
        return -knee(-y, -bottom, width) if bottom is not None else y
    return effect("saturation", f"limits {bottom} {top}, knee {width}, at the {where}", f, where=where)

def drift(about, law):
    """law: function of time, the training record being 1 long."""
    return effect("drift", f"zero follows {about}", lambda y, k: y + law(np.maximum(k.t, 0) / k.length))

def tone(f, size, harmonics=(), beat=0.0):
    def g(y, k):
        p = k.rng.uniform()
        wavy = sum(a * wave((m + 1) * (f * k.t + p) + 0.13 * m) for m, a in enumerate((1, *harmonics)))
        return y + size * (1 + beat * wave(2.6 / k.length * k.t + p)) * wavy
    return effect("interference", f"tone at {f:g} Hz, size {size}, harmonics {harmonics}, beat {beat}", g)

def slips(count, size):
    """A mount that slips: jumps of both signs."""
    def f(y, k):
        n = max(3, round(count * k.t[-1] / k.length))
        at = k.t[-1] * (np.arange(n) + k.rng.uniform(0.2, 0.8, n)) / n
        jumps = size * k.rng.uniform(0.6, 1.4, n) * np.resize([1, -1, -1, 1, 1, -1], n) * k.rng.choice([-1, 1])
        return y + (k.t[:, None] > at) @ jumps
    return effect("unknown", f"{count} slips of the mount of about {size}", f)

def gain_wander(size):
    def f(y, k):
        v = sum(wave(a * k.t / k.length + p) for a, p in zip(k.rng.uniform(1, 9, 24), k.rng.uniform(0, 1, 24)))
        return y * (1 + size * v / np.std(v))
    return effect("unknown", "gain wanders without a recorded cause", f)

def zero_wander(size):
    """A bounded random walk of the sensor's zero."""
    def f(y, k):
        v = lfilter([1], [1, -math.exp(-12 * k.dt / k.length)], k.rng.normal(0, 1, len(y)))
        return y + size * pole(v - v.mean(), 0.01 * k.length, k) / np.std(v)
    return effect("unknown", "zero of the sensor wanders without a law", f)

def pushes(size):
    """A force that nobody records: presses of random length and size."""
    def f(y, k):
        n = 14
        at, long = np.sort(k.rng.uniform(0, 1, n)) * k.t[-1], k.rng.uniform(0.01, 0.05, n) * k.length
        force = sum(a * (expit((k.t - b) / (0.05 * c)) - expit((k.t - b - c) / (0.05 * c)))
                    for a, b, c in zip(k.rng.uniform(0.4, 1.5, n) * k.rng.choice([-1, 1], n), at, long))
        return y - size * force * (1 + 0.3 * y)
    return effect("unknown", "unrecorded force presses at random", f)

def course(kind, s, rng):
    """Course of a temperature or force from -1 to 1 over a record (s from 0 to 1)."""
    s = np.maximum(s, 0)
    p, q = rng.uniform(0, 1, 4), (5.3 * s + rng.uniform()) % 1
    at, level = np.sort(rng.uniform(0, 1, 9)), np.r_[-0.1, np.resize([1, -0.6, 0.3, -1, 0.8, -0.2], 9) * rng.uniform(0.8, 1, 9)]
    return dict(warm=1 - 2 * np.exp(-3.2 * s) + 0.12 * wave(4.3 * s + p[0]),
                cycles=2.2 * np.where(q < 0.35, 1 - np.exp(-q / 0.15), 0.9 * np.exp(-(q - 0.35) / 0.3)) - 1.1,
                day=wave(1.35 * s + p[0]) + 0.15 * wave(7.1 * s),
                steps=level[np.searchsorted(at, s)],
                press=np.clip(3.2 * wave(2.6 * s + p[0]), -1, 1),
                waves=sum(wave(f * s + a) for f, a in zip((2.3, 3.7, 5.9, 8.3), p)) / 2.2)[kind]

# --------------------------------------------------------------------------------------------------------------- cases

def C(name, law, loop, fs, seconds, train, test, volts, stroke, noise, effects=(), model="pi", temp=None, force=None,
      cut=0.0, accept=()):
    """noise: white and 1/f in percent of the stroke, bits of a sensor of 1.6 strokes (0: none), spikes;
    temp, force: course, rest, swing, noise; cut: seconds before the first row."""
    return SimpleNamespace(**locals())

CASES = [
    # none
    C("two-sines", "preisach-gauss", 0.13, 1000, (6, 5), sines((1, 1), (4.3, 0.4)), sines((1.7, 1), (3.1, 0.6)), (-30, 150), 32,
      (0.08, 0.03, 16, 0), model="preisach", cut=0.4),
    C("reversals", "preisach-cauchy", 0.16, 200, (84, 50), moves(reversal(9), 0, 2, slew=True), moves(spots(30), 0, 1.5), (0, 100), 12,
      (0.15, 0, 14, 0)),
    C("raster", "kp", 0.10, 10000, (3, 2), raster(13, 0.5), raster(19, 0.8, 0.7), (-10, 10), 2.4, (0.12, 0.06, 0, 6), cut=0.1),
    C("swell", "rayleigh", 0.15, 500, (14, 9), swell(0.9, 0.15, 1), swell(1.3, 1, 0.3), (-200, 200), 60, (0.05, 0.05, 15, 0)),
    C("trapezoids", "ramberg", 0.08, 100, (90, 66), moves([-1, 1], 2.4, 1.2), moves([-1, 0.9, -0.3, 0.5], 1.6, 1.5), (0, 60), 18,
      (0.2, 0, 12, 0)),
    C("walk", "sinh-play", 0.12, 250, (60, 40), moves(spots(70), 0.1, 0.7, True), moves(spots(50, 0.8), 0.3, 0.5, True), (0, 150), 105,
      (0.06, 0.1, 16, 3)),
    C("stairs", "read-out", 0.18, 50, (240, 150), moves(updown(12), 2, 0.1), moves(spots(70), 1.6, 0.1), (-20, 130), 210, (0.1, 0, 14, 0),
      model="maxwell-slip", temp=("day", 24, 3, 0.04)),
    C("chirp", "iwan", 0.11, 4000, (8, 6), chirp(0.5, 45), chirp(30, 0.8), (-5, 5), 1.2, (0.25, 0.1, 0, 0), model="dpm"),
    C("one-sine", "coleman", 0.14, 2000, (3, 2), cycles(2.7), cycles(4.1, wave, 0.3), (0, 1000), 36, (0.1, 0, 13, 0), cut=0.1),
    C("decays", "bouc-wen", 0.17, 300, (24, 20), swell(0.6, 1, 0.2, tri), swell(0.45, 0.4, 1, tri), (-500, 500), 88, (0.1, 0, 15, 0),
      model="bouc-wen"),
    C("sines", "dahl", 0.07, 600, (16, 12), sines((0.4, 1), (1.1, 0.7), (2.9, 0.3)), sines((0.7, 1), (1.9, 0.5)), (0, 120), 15,
      (0.04, 0.02, 16, 4), model="bouc-wen", force=("waves", 20, 12, 0.1), cut=1),
    C("noise", "elastoplastic", 0.20, 20000, (2.99, 1.4), band(3, 160), band(5, 120), (-15, 15), 5.5, (0.3, 0, 0, 0), model="maxwell-slip"),
    C("many-rates", "jiles", 0.12, 1500, (18, 12), schedule((0.4, 7.5, 1), (2, 4, 0.8), (9, 3, 1), (31, 1.5, 0.6)),
      schedule((1, 5, 1), (16, 2, 0.8), (5, 3, 0.6)), (-100, 100), 45, (0.1, 0.05, 16, 0), model="dpm"),
    C("jogs", "pinning", 0.15, 120, (110, 80), moves(jog(9, 0.12), 0.6, 0.5), moves(jog(7, 0.2), 0.5, 0.4), (0, 75), 9, (0.05, 0, 12, 0)),
    C("bursts", "stoner", 0.09, 800, (14, 10), bursts(2, 2.5, 1), bursts(3, 1.5, 0.7), (-60, 60), -24, (0.1, 0.05, 14, 0),
      model="preisach"),
    C("short", "landau", 0.06, 50, (8.5, 8), sines((0.6, 1), (1.43, 0.4)), sines((0.9, 1), (0.37, 0.5)), (0, 150), 140, (0.08, 0, 15, 0)),
    # one effect
    C("delay-daq", "sinh-play", 0.12, 5000, (2, 1.5), sines((12, 1), (31, 0.5)), sines((19, 1), (7, 0.6)), (0, 150), 30,
      (0.08, 0.04, 16, 0), [delay(2.3e-3)], cut=0.1),
    C("delay-raster", "kp", 0.09, 20000, (2.5, 1.8), raster(34, 0.8, 0.7, saw), raster(45, 1.2, 0.6, tri), (-120, 120), 4,
      (0.15, 0.05, 0, 0), [delay(1e-3, "drive")], cut=0.05),
    C("delay-network", "iwan", 0.15, 100, (60, 45), moves(spots(60), 0.3, 0.3), band(0.2, 1.5), (0, 100), 75, (0.2, 0, 14, 5),
      [delay(0.064)], "maxwell-slip"),
    C("lag-amplifier", "read-out", 0.10, 10000, (1.6, 1.2), moves(spots(60, 0.8), 0.012, 0.003), cycles(22, tri), (0, 130), 22,
      (0.2, 0.1, 0, 0), [lag(1.6e-3, where="amplifier")]),
    C("lag-two-poles", "coleman", 0.12, 4000, (4, 3), band(3, 90), sines((11, 1), (37, 0.5), (64, 0.3)), (-10, 10), 1, (0.2, 0, 13, 0),
      [lag(1.3e-3, 0.8e-3)], cut=0.2),
    C("lag-broad", "ramberg", 0.14, 1000, (12, 9), moves([-1, 1, -0.4, 0.6], 0.12, 0.05), moves(updown(7), 0.15, 0.02), (0, 200), 160,
      (0.1, 0.08, 15, 0), [lag(0.035, order=0.6)], cut=0.3),
    C("asym-upper", "preisach-gauss", 0.10, 400, (15, 12), cycles(0.8, tri, 0.3), swell(0.5, 0.4, 1, tri), (0, 150), 38,
      (0.15, 0.05, 14, 0), [bend(0.45, 2.5)], "preisach", cut=0.3),
    C("asym-exponential", "stoner", 0.13, 150, (70, 50), moves(spots(80), 0.2, 0.5, True), moves(spots(60), 0, 0.8), (-75, 75), -110,
      (0.08, 0.05, 0, 0), [exponential(0.45)]),
    C("asym-branches", "pinning", 0.14, 250, (60, 40), moves(reversal(11), 0, 1.1, slew=True), sines((0.3, 1), (0.83, 0.6)), (0, 90), 14,
      (0.08, 0, 15, 0), [branches(0.6, 0.4)]),
    C("rate-log", "sinh-play", 0.13, 2000, (26, 17), schedule((0.15, 13.4, 1), (0.9, 7, 0.9), (6, 4, 1), (40, 1.6, 0.9), shape=tri),
      schedule((0.3, 10, 1), (2.2, 4, 0.9), (17, 3, 0.8), shape=tri), (-100, 100), 28, (0.1, 0.05, 16, 0), [rate(0.22, 0.6)], "dpm"),
    C("rate-power", "rayleigh", 0.17, 1000, (30, 20), schedule((0.2, 10, 1), (1.3, 6.2, 1), (0.4, 5, 0.6), (8, 4, 0.8), (24, 2.5, 1)),
      schedule((0.5, 6, 1), (12, 3, 1), (3, 4, 0.7)), (0, 150), 50, (0.12, 0, 15, 0), [rate_width(0.75, 60, 0.4, 0.03)], cut=0.5),
    C("rate-stops", "iwan", 0.11, 3000, (16, 11), chirp(0.25, 60), chirp(50, 0.3), (-20, 20), 3, (0.15, 0.1, 0, 0), [rate(0.5, 60, 0.35)]),
    C("temp-zero-lag", "dahl", 0.09, 100, (300, 200), sines((0.11, 1), (0.37, 0.5)), sines((0.2, 1), (0.07, 0.7)), (0, 120), 26,
      (0.1, 0.1, 14, 0), [thermal(zero=0.11, tau=14)], temp=("cycles", 23, 4, 0.03), cut=20),
    C("temp-gain", "landau", 0.12, 60, (400, 260), cycles(0.31, tri), moves(spots(90), 0.5, 2.2), (-30, 150), 17, (0.2, 0, 12, 0),
      [thermal(gain=0.09, zero=0.02, bow=0.25)], "preisach", temp=("warm", 35, 14, 0.1)),
    C("temp-loop", "bouc-wen", 0.20, 200, (160, 110), swell(0.5, 1, 0.75), cycles(0.8, wave, 0.2), (-200, 200), 65, (0.1, 0.05, 16, 0),
      [thermal(width=0.55, gain=0.02)], "bouc-wen", temp=("day", 60, 30, 0.2)),
    C("creep-log", "preisach-cauchy", 0.15, 100, (200, 140), moves(updown(9), 6, 0.15), moves(spots(40, 0.9), 5, 0.15), (0, 100), 80,
      (0.06, 0.05, 16, 0), [creep("log", 0.05, 0.2)]),
    C("creep-stretched", "kp", 0.12, 500, (60, 40), moves([-1, 0.4, -0.5, 1], 1.8, 0.2, True),
      moves([-0.9, 0.9, 0.1, 0.7, -0.4], 1.5, 0.3, True), (0, 60), 11, (0.12, 0, 13, 4), [creep("stretched", 0.12, 1.1, 0.45)], "preisach"),
    C("creep-power", "iwan", 0.08, 150, (130, 90), then(9, moves(jog(5, 0.15), 1.5, 0.3)), then(5, moves(jog(4, 0.2), 1.2, 0.3)),
      (-50, 150), 290, (0.08, 0.05, 15, 0), [creep("power", 0.05, 1.0, 0.3)]),
    C("load-stiffness", "coleman", 0.10, 200, (100, 70), sines((0.23, 1), (0.71, 0.4)), cycles(0.4, tri), (0, 150), 55, (0.1, 0.1, 15, 0),
      [load(deflect=0.07, slope=0.35)], force=("steps", 0, 40, 0.3), cut=1),
    C("load-gain", "ramberg", 0.16, 300, (60, 45), cycles(0.9), swell(1.4, 0.5, 1), (-250, 250), 90, (0.15, 0.05, 14, 0), [load(gain=0.10)],
      "maxwell-slip", force=("press", 500, 350, 3), cut=0.5),
    C("load-contact", "elastoplastic", 0.13, 80, (150, 110), moves(spots(90), 0.6, 0.9, True), moves(updown(6), 0.7, 0.4), (0, 75), 8,
      (0.1, 0, 13, 0), [load(deflect=0.09, power=0.667)], force=("waves", 6, 5.5, 0.05)),
    C("ring-steps", "read-out", 0.12, 8000, (2, 1.4), moves(spots(30), 0.06, 0.0012), moves(updown(6), 0.07, 0.0008), (0, 100), 16,
      (0.2, 0.1, 0, 0), [resonance(310, 0.025)]),
    C("ring-chirp", "jiles", 0.08, 6000, (6, 4), chirp(2, 330), chirp(260, 3), (-10, 10), 1.6, (0.3, 0, 14, 0), [resonance(480, 0.02)],
      "dpm"),
    C("ring-raster", "kp", 0.13, 20000, (2.2, 1.6), raster(46, 0.9, 0.8, saw), raster(55, 1.3, 0.6, tri), (-150, 150), 95,
      (0.1, 0.05, 16, 0), [resonance(320, 0.03, 0.9, second=(760, 0.02))], cut=0.05),
    C("stop-hard", "preisach-cauchy", 0.11, 200, (40, 30), sines((0.5, 1), (1.27, 0.5)), moves(spots(40), 0.2, 0.5), (0, 120), 48,
      (0.1, 0, 14, 0), [saturation(top=0.55)], cut=1),
    C("stop-knee", "dahl", 0.10, 1000, (10, 8), swell(1.6, 0.5, 1), sines((0.9, 1), (2.3, 0.3)), (-60, 60), 7, (0.12, 0.06, 16, 0),
      [saturation(0.74, -0.78, 0.03, "motion")], "bouc-wen"),
    C("amplifier-limit", "sinh-play", 0.15, 2500, (6, 4), moves(spots(60), 0.02, 0.08), cycles(3.1), (-80, 160), -72, (0.1, 0.05, 15, 0),
      [saturation(bottom=-0.72, where="amplifier")]),
    C("drift-line", "rayleigh", 0.12, 50, (300, 200), cycles(0.13, tri, 0.1), sines((0.09, 1), (0.21, 0.7)), (0, 150), 31,
      (0.12, 0.05, 14, 0), [drift("a line, slightly bent", lambda s: 0.03 * s * s - 0.13 * s)], cut=4),
    C("drift-settling", "stoner", 0.10, 400, (60, 40), moves(spots(70), 0.1, 0.7, True), cycles(0.7), (-40, 40), 3.5, (0.15, 0.05, 0, 0),
      [drift("two exponentials", lambda s: 0.1 * np.exp(-s / 0.07) + 0.08 * np.exp(-s / 0.45))], "preisach"),
    C("mains", "landau", 0.13, 2000, (5, 3.5), cycles(1.3, tri, 0.2), sines((0.9, 1), (3.3, 0.5)), (0, 100), 20, (0.1, 0.05, 14, 0),
      [tone(50, 0.022, (0.2, 0.45, 0, 0.2))], cut=0.2),
    C("alias-tone", "coleman", 0.09, 130, (50, 40), moves(spots(50), 0.2, 0.8, True), swell(0.3, 1, 0.4), (-30, 150), 120,
      (0.08, 0.02, 16, 3), [tone(50.02, 0.017)]),
    C("pump", "iwan", 0.16, 700, (20, 14), moves(updown(10), 0.5, 0.05), moves(spots(30), 0.4, 0.06), (0, 60), 6, (0.12, 0, 15, 0),
      [tone(23.6, 0.022, (0.5,), 0.35)], "maxwell-slip"),
    # two effects
    C("creep-temp", "ramberg", 0.12, 50, (500, 320), moves(updown(7), 8, 0.2), moves(spots(40), 7, 0.2), (0, 150), 64, (0.06, 0.04, 16, 0),
      [creep("log", 0.05, 0.3), thermal(zero=0.08, gain=0.03)], temp=("waves", 22, 2.5, 0.02)),
    C("lag-limit", "sinh-play", 0.13, 5000, (3, 2), moves(spots(70), 0.015, 0.025), cycles(17, tri), (-150, 150), 40, (0.1, 0.05, 0, 0),
      [lag(2.6e-3, where="amplifier"), saturation(top=0.6)]),
    C("delay-mains", "bouc-wen", 0.15, 3000, (4, 3), swell(9, 0.5, 1, tri), sines((6, 1), (14, 0.5)), (-500, 500), 34, (0.1, 0, 14, 0),
      [delay(4e-3), tone(60, 0.02, (0, 0.4))], "bouc-wen"),
    C("asym-drift", "elastoplastic", 0.11, 100, (120, 80), cycles(0.35, tri), moves(spots(60), 0.4, 0.8), (0, 120), 25, (0.1, 0.05, 15, 0),
      [exponential(-0.4), drift("a parabola", lambda s: 0.4 * (s - 0.4) ** 2)], "maxwell-slip", cut=2),
    C("rate-temp", "iwan", 0.14, 800, (60, 40), schedule((0.2, 10, 1), (1.5, 5, 0.9), (11, 3, 1), (34, 1.5, 0.9)),
      schedule((0.5, 8, 1), (4, 4, 0.8), (21, 2, 1)), (-60, 60), 19, (0.1, 0.05, 16, 0),
      [rate(0.5, 40, 0.35), thermal(gain=0.08, zero=-0.02)], "dpm", temp=("cycles", 40, 9, 0.05)),
    C("load-creep", "preisach-gauss", 0.14, 100, (160, 110), moves(spots(44), 3.2, 0.2), moves(updown(8), 2.6, 0.2), (0, 100), 46,
      (0.08, 0, 15, 0), [load(deflect=0.07, slope=-0.25), creep("stretched", 0.13, 1.5, 0.5)], "preisach", force=("steps", 10, 30, 0.2)),
    C("ring-asym", "pinning", 0.10, 8000, (2.4, 1.8), moves(spots(40), 0.05, 0.0015), moves(spots(36), 0.04, 0.001), (0, 75), 13,
      (0.15, 0.05, 0, 0), [bend(-0.22, 2.0), resonance(265, 0.03)]),
    C("stop-drift", "jiles", 0.09, 150, (80, 60), sines((0.21, 1), (0.64, 0.6)), moves(spots(60), 0.3, 0.7, True), (-100, 100), -150,
      (0.1, 0.05, 14, 0), [drift("settling", lambda s: -0.12 * np.exp(-s / 0.3)), saturation(bottom=-0.62, width=0.015)], cut=2),
    C("delay-asym", "kp", 0.12, 400, (30, 22), moves(spots(90), 0.1, 0.12), band(0.4, 4), (0, 130), 58, (0.12, 0, 13, 0),
      [delay(0.022, "drive"), bend(0.2, 3)]),
    C("lag-hum", "read-out", 0.10, 4000, (4, 3), moves(updown(8), 0.06, 0.004), moves(spots(40), 0.04, 0.004), (-20, 120), 27,
      (0.1, 0.05, 16, 4), [lag(4.2e-3, 1.1e-3), tone(150, 0.02, (0.3,))]),
    C("rate-asym", "rayleigh", 0.16, 1500, (24, 16), schedule((0.25, 8, 1), (1.6, 5, 1), (9, 3, 0.8), (45, 1.5, 1), shape=tri),
      schedule((0.6, 6, 1), (4, 3, 0.9), (25, 2, 0.9), shape=tri), (0, 150), 42, (0.08, 0.04, 16, 0), [rate(0.24, 0.8), bend(0.18, 2.2)],
      "dpm"),
    C("temp-load", "landau", 0.11, 80, (240, 160), cycles(0.27), sines((0.19, 1), (0.53, 0.5)), (-30, 150), 88, (0.1, 0.05, 15, 0),
      [thermal(zero=0.09, tau=9), load(deflect=0.06, slope=0.3)], temp=("cycles", 28, 6, 0.04), force=("press", 0, 60, 0.5), cut=2),
    C("ring-tone", "stoner", 0.12, 10000, (2, 1.5), raster(37, 0.8, 0.7, saw), moves(spots(40), 0.03, 0.002), (-15, 15), 2, (0.15, 0, 0, 0),
      [resonance(420, 0.03), tone(137, 0.03, (0.4,))], cut=0.05),
    C("creep-limit", "preisach-cauchy", 0.10, 100, (180, 130), moves(spots(50), 3, 0.3, True), moves(spots(36), 2.5, 0.3), (0, 60), 10,
      (0.1, 0, 14, 0), [creep("power", 0.05, 1.0, 0.28), saturation(top=0.62)]),
    # a fault without a name
    C("slipping", "dahl", 0.12, 150, (80, 60), sines((0.3, 1), (0.77, 0.5)), cycles(0.5, tri), (0, 150), 35, (0.1, 0.05, 15, 0),
      [slips(7, 0.09)], "maxwell-slip", cut=1),
    C("gain-wander", "sinh-play", 0.14, 300, (50, 40), cycles(0.9, wave, 0.1), swell(1.3, 0.6, 1, tri), (-100, 100), 52, (0.12, 0, 14, 0),
      [gain_wander(0.06)], cut=0.5),
    C("zero-wander", "kp", 0.10, 200, (70, 50), moves(spots(80), 0.1, 0.7, True), sines((0.4, 1), (1.1, 0.6)), (0, 100), 5,
      (0.1, 0.05, 0, 0), [zero_wander(0.06)]),
    C("pushes", "coleman", 0.11, 250, (60, 45), cycles(0.8, tri, 0.2), moves(spots(50), 0.1, 0.7), (-10, 120), 200, (0.1, 0.05, 16, 0),
      [pushes(0.13)], "maxwell-slip", cut=0.5),
]

# -------------------------------------------------------------------------------------------------------------- writing

def record(c, number, which, scale=None):
    """Returns times, drive and recorded columns of the rows, and a function that gives the motion with chosen effects."""
    rng = np.random.default_rng([1600, number, which])
    k = SimpleNamespace(dt=1 / c.fs, length=c.seconds[0])
    k.t = np.arange(round((c.cut + c.seconds[which]) * c.fs) + 1) / c.fs - c.cut
    rows = k.t > -0.5 / c.fs
    x = (c.test if which else c.train)(k.t, rng)
    low, high = x[rows].min(), x[rows].max()
    ends = (rng.uniform(-0.98, -0.8), rng.uniform(0.8, 0.98)) if which else (-1, 1)
    k.x = x = np.clip(ends[0] + (x - low) * (ends[1] - ends[0]) / (high - low), -1, 1)
    columns = {}
    for column, key, spec in (("temperature_degc", "temperature", c.temp), ("load_n", "load", c.force)):
        if spec:
            kind, rest, swing, noise = spec
            value = np.clip(course(kind, k.t / k.t[-1], rng), -1.2, 1.2) * (0.9 if which else 1)
            setattr(k, key, value)
            k.force = value + rest / swing
            columns[column] = np.round((rest + swing * value + noise * rng.normal(0, 1, len(x))) / (noise / 4))[rows] * (noise / 4)
    cycled, rested, wild = [1, -1, 1, -1], 0.93 ** np.arange(60) * (-1) ** np.arange(60), [1, -1, *rng.uniform(-1, 1, 9)]
    turns = np.r_[-1, (cycled, rested, wild)[number % 3], x[0]]
    past = np.concatenate([np.linspace(a, b, 150, endpoint=False) for a, b in zip(turns, turns[1:])])
    middle, half, opening = major(c.law)
    known = {}
    def output(effects):
        v = x
        for e in effects:
            v = e.pre(v, k) if e.pre else v
        key = tuple(e.about for e in effects if e.pre)
        if key not in known:
            known[key] = (LAWS[c.law](np.r_[past, v])[len(past) :] - middle) / half
        away = c.loop / opening * (known[key] - v)
        for e in effects:
            away = away * e.width(k) if e.width else away
        y = v + away
        for i, e in enumerate(c.effects):
            k.rng = np.random.default_rng([1601, number, which, i])
            y = e.post(y, k) if e.post and e in effects else y
        y = y[rows]
        return y if scale is None else (y - scale[0]) / scale[1]
    return k.t[rows], x[rows], columns, output, rng

def disturbance(c, n, rng):
    """Returns white and 1/f noise in parts of the stroke, and spikes."""
    f = np.fft.rfftfreq(2 * n)[1:]
    pink = np.fft.irfft(np.r_[0, np.exp(2j * np.pi * rng.uniform(0, 1, len(f))) / np.sqrt(f)], 2 * n)[:n]
    spikes = np.zeros(n)
    spikes[rng.integers(0, n, c.noise[3])] = rng.choice([-1, 1], c.noise[3]) * rng.uniform(0.04, 0.2, c.noise[3])
    return 0.01 * (c.noise[0] * rng.normal(0, 1, n) + c.noise[1] * (pink - pink.mean()) / np.std(pink)), spikes

def rest_of(d, *columns):
    a = np.column_stack([np.ones(len(d)), *columns])
    return float(np.std(d - a @ np.linalg.lstsq(a, d, rcond=None)[0]))

def build(c, number, folder):
    """Writes one case and returns its lines of the table."""
    part = c.loop / major(c.law)[2]
    assert 0.05 <= c.loop <= 0.2 and part <= 1, (c.name, major(c.law))
    plain = record(c, number, 0)[3]([])
    scale = (plain.min(), np.ptp(plain))
    zero = np.random.default_rng([1602, number]).uniform(-0.4, 0.6) * abs(c.stroke)
    step = 1.6 / 2 ** c.noise[2] if c.noise[2] else 0
    text, bad, sizes, reach = "", [], [], []
    os.makedirs(folder, exist_ok=True)
    for which, name in enumerate(("train", "test")):
        t, x, columns, output, rng = record(c, number, which, scale)
        volts = c.volts[0] + np.round((x + 1) * 2**15) * (c.volts[1] - c.volts[0]) / 2**16
        twin, real = output([]), output(c.effects)
        noise, spikes = disturbance(c, len(x), rng)
        for prefix, y in (("twin-", twin), ("", real)):
            y = y + noise + spikes
            y = np.round(y / step) * step if step else y
            table = dict(time_s=t, voltage_v=volts, displacement_um=zero + c.stroke * y, **columns)
            body = np.column_stack(list(table.values()))
            assert np.isfinite(body).all(), c.name
            form = ["%.9g"] + ["%.7g"] * (len(table) - 1)
            np.savetxt(f"{folder}/{prefix}{name}.csv", body, form, ",", header=",".join(table), comments="")
        assert bool(c.effects) != np.array_equal(real, twin), c.name
        sizes.append(len(x))
        reach += [x.min(), x.max()]
        floor = math.sqrt(np.var(noise) + step**2 / 12)
        bank = plays(x, np.geomspace(0.03, 0.9, 12))
        for e in c.effects:
            d = real - output([o for o in c.effects if o is not e])
            size, left = float(np.std(d)), rest_of(d, x, bank)
            text += f"  {name} {e.name} {size / floor:.1f} {100 * size:.2f} % ({left / floor:.1f})"
            least = 0.003 if e.name in ("drift", "interference") else 0.01
            if size < (2.5 if which else 5) * floor or which == 0 and (size < least or left < 4 * floor):
                bad.append(f"{name} {e.name} too small")
        r = np.abs(np.triu(np.corrcoef([x, *columns.values()]), 1)).max() if columns else 0
        bad += [f"{name} drive, temperature or load go together, r {r:.2f}"] if r > 0.3 else []
    assert 400 <= min(sizes) <= max(sizes) <= 60000 and reach[0] <= reach[2] < reach[3] <= reach[1], (c.name, sizes, reach)
    about = "; ".join(e.about for e in c.effects)
    truth = dict(expect=sorted(e.name for e in c.effects), accept=list(c.accept), base=c.law, model=c.model, about=about)
    with open(f"{folder}/truth.json", "w") as file:
        json.dump(truth, file, indent=1)
    line = f"{os.path.basename(folder):22} {c.law:15} {c.model:12} part {part:.2f} {sizes[0]:6} {sizes[1]:6} rows {sizes[0] / c.fs:6.1f} s"
    return line + text + "".join(f"\n  !! {b}" for b in bad)

def main():
    """Writes the cases whose names begin with a prefix, or all."""
    folder, *prefixes = sys.argv[1:]
    assert len(CASES) == 66 and set(LAWS) == {c.law for c in CASES if not c.effects}
    for number, c in enumerate(CASES, 1):
        name = f"x{number:02}-{c.name}"
        if not prefixes or name.startswith(tuple(prefixes)):
            print(build(c, number, f"{folder}/{name}"), file=sys.stderr, flush=True)

if __name__ == "__main__":
    main()
