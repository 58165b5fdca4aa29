#!/usr/bin/env python3
"""Independent set of actuator cases (voltage -> displacement), numpy and scipy only.

    python eighth.py OUT [--seed N] [--only w07,w12] [--check]

Every case: OUT/wNN-name/{train,test,twin-train,twin-test}.csv and truth.json.  The twin is the same actuator with the same drives and
noise level, without the effects.  Printed for each case: rows, rate, RMS(output - twin output) before noise in % of the range and as a
multiple of the noise.  --check adds the part of that difference that play operators and relays (free signs, offset) cannot absorb, and
tests the files.

x is the drive in units of the half range, -1..1.  All laws and filters run on a grid `over` times finer than the samples, after a
history up, down and to the first value; filters start settled there.  Order: [rail] - [curve before] - [lag of the amplifier] -
hysteresis (with rate-dependence) - [curve after] - [creep] - um - [compliance, temperature, disturbances] - [modes] - [stop] -
[delay or lag of the sensor] - [drift, tone] - samples, noise, converter.
"""
import argparse
import json
import math
import os
import zlib

import numpy as np
from scipy.ndimage import map_coordinates
from scipy.signal import cont2discrete, lfilter

LIMIT = 1.3  # the memory of the laws covers -1.3..1.3


# ---------------------------------------------------------------------------------------------------------------- hysteresis laws
def plays(x, r, scale=None, up=None, down=None):
    """Mean of (generalised) plays; `scale` multiplies the thresholds sample by sample."""
    up = x if up is None else up
    down = up if down is None else down
    z = np.zeros(r.size)
    y = np.empty(x.size)
    a, b, s = up.tolist(), down.tolist(), r
    for i in range(x.size):
        if scale is not None:
            s = r * scale[i]
        np.maximum(z, a[i] - s, out=z)
        np.minimum(z, b[i] + s, out=z)
        y[i] = np.add.reduce(z)
    return y / r.size


def maxwell(x, scale=None, n=400, mean=0.33, c=0.42):
    """Maxwell slip: sliders with exponentially distributed limits; the sum of the stops is subtracted from the voltage."""
    r = -mean * np.log1p(-(np.arange(n) + 0.5) / n)
    return x - c * (x - plays(x, r, scale))


def powerpi(x, scale=None, n=250, p=2.1, top=1.5, w=0.5):
    """Prandtl-Ishlinskii, thresholds by a power law (dense near zero)."""
    r = top * ((np.arange(n) + 0.5) / n) ** p
    return (1 - 0.6 * w) * x + w * plays(x, r, scale)


def gplay(x, n=220, k=0.9, shift=0.12, skew=0.93):
    """Generalised plays between two tanh envelopes."""
    up = np.tanh(k * x + shift) / k
    down = skew * np.tanh(k * x + 0.3 * shift) / k + 0.06
    down = np.maximum(down, up)
    r = 0.55 * ((np.arange(n) + 0.5) / n) ** 1.4
    return 0.45 * x + 0.7 * plays(x, r, None, up, down)


def turning(x, everett, corner):
    """A law with return-point memory: everett(a, b) is the change on a branch from b up to a (or down)."""
    n = x.size
    hi, lo, base, sign = (np.empty(n) for _ in range(4))
    stack, value = [-LIMIT], [0.0]  # alternating minima and maxima
    d = np.sign(np.diff(x))
    keep = np.flatnonzero(d)
    ends = []
    if keep.size:
        turn = keep[1:][d[keep[1:]] != d[keep[:-1]]]
        ends = [int(k) for k in turn] + [n - 1]
    start, first = 0, 0
    up = True
    if keep.size and d[keep[0]] < 0:  # rise to the first value, then fall
        stack.append(float(x[0]))
        value.append(corner(x[0], -LIMIT))
        up = False
    xs = x
    for end in ends or [n - 1]:
        seg = xs[start:end + 1]
        last = float(xs[end])
        i = start
        while i <= end:
            top = stack[-1]
            # the branch from `top` ends at the extreme before it
            bound = stack[-2] if len(stack) > 1 else None
            if bound is None or len(stack) == 1:
                j = end + 1
            elif up:
                j = start + int(np.searchsorted(seg, bound, "right"))
            else:
                j = start + int(np.searchsorted(-seg, -bound, "right"))
            if len(stack) == 2 and not up:
                j = end + 1
            j = max(j, i)
            if j > i:
                if up:
                    hi[i:j], lo[i:j], sign[i:j] = xs[i:j], top, 1.0
                else:
                    hi[i:j], lo[i:j], sign[i:j] = top, xs[i:j], -1.0
                base[i:j] = value[-1]
                i = j
            if i <= end:
                stack.pop(), stack.pop(), value.pop(), value.pop()
        top, v = stack[-1], value[-1]
        stack.append(last)
        value.append(v + corner(last, top) if up else v - corner(top, last))
        start = end + 1
        up = not up
    return base + sign * everett(hi, lo)


def rayleigh(x, a=0.55, knee=0.6, d0=0.75):
    """Domain walls: Rayleigh's law at small amplitude, the widening saturates at large ones (Masing branches)."""
    def e(p, q):
        d = p - q
        return d0 * d + a * d * d / (2 * (1 + d / (2 * knee)))
    return turning(x, e, lambda p, q: float(e(p, q)))


TABLES = {}


def density(x, kind):
    """Preisach density, integrated on a fine grid; the Everett function is interpolated."""
    n = 661
    if kind not in TABLES:
        g = np.linspace(-LIMIT, LIMIT, n)
        beta, alpha = np.meshgrid(g, g, indexing="ij")
        m, r = (alpha + beta) / 2, (alpha - beta) / 2
        if kind == "gauss":
            mu = np.exp(-((m - 0.1) / 0.75) ** 2 / 2) * np.exp(-((r - 0.18) / 0.22) ** 2 / 2)
        else:
            mu = 1 / (1 + ((m + 0.05) / 0.6) ** 2) / (1 + ((r - 0.12) / 0.15) ** 2)
        mu[r < 0] = 0
        mu[r == 0] *= 0.5
        mu /= mu.sum()
        part = np.cumsum(np.cumsum(mu[::-1], axis=0)[::-1], axis=1)
        TABLES[kind] = 0.85 * part
    table, h = TABLES[kind], 2 * LIMIT / (n - 1)
    w = 0.62

    def e(p, q):
        return w * (p - q) + map_coordinates(table, [(q + LIMIT) / h, (p + LIMIT) / h], order=1, mode="nearest")
    return turning(x, e, lambda p, q: float(e(np.array([p]), np.array([q]))[0]))


def relays(x, n=3500):
    """Preisach: relays with lognormal coercive fields and logistic bias fields, plus a reversible slope."""
    rng = np.random.default_rng(77)
    r = 0.2 * np.exp(0.7 * rng.standard_normal(n))
    m = np.clip(rng.logistic(0.08, 0.38, n), -2, 2)
    up, down = np.sort(m + r), np.sort(m - r)
    order_up, order_down = np.argsort(m + r), np.argsort(m - r)
    state = np.zeros(n, bool)
    total, y, previous = 0, np.empty(x.size), -9.0
    for i, v in enumerate(x.tolist()):
        if v > previous:
            a, b = np.searchsorted(up, (previous, v), "right")
            if b > a:
                k = order_up[a:b]
                total += int(np.count_nonzero(~state[k]))
                state[k] = True
        elif v < previous:
            a, b = np.searchsorted(down, (v, previous), "right")
            if b > a:
                k = order_down[a:b]
                total -= int(np.count_nonzero(state[k]))
                state[k] = False
        previous, y[i] = v, total
    return 0.6 * x + 0.6 * y / n


def kp(x, n=38, width=0.16):
    """Krasnosel'skii-Pokrovskii kernels with ridges on a triangle of thresholds."""
    g = np.linspace(-1.15, 1.15, n)
    a, b = np.meshgrid(g, g, indexing="ij")
    keep = b >= a
    a, b = a[keep], b[keep]
    w = np.exp(-(b - a) / 0.35) * np.exp(-((a + b) / 2 - 0.1) ** 2 / 1.1)
    w /= w.sum()
    z, y = -np.ones(a.size), np.empty(x.size)
    p, q = np.empty_like(z), np.empty_like(z)
    ka, kb = a / width, b / width
    for i, v in enumerate((x / width).tolist()):
        np.subtract(v, kb, out=p)
        np.minimum(p, 1, out=p)
        np.maximum(z, p, out=z)
        np.subtract(v, ka, out=q)
        np.maximum(q, -1, out=q)
        np.minimum(z, q, out=z)
        y[i] = w.dot(z)
    return 0.5 * x + 0.55 * y


def boucwen(x, n=1.3, top=0.24, share=0.62, c=0.5):
    total = 1 / top ** n
    be, ga = share * total, (1 - share) * total
    z, y, previous = 0.0, [], float(x[0])
    for v in x.tolist():
        d = v - previous
        if d:
            m = int(abs(d) / 0.004) + 1
            h = d / m
            for _ in range(m):
                k = h * (1 - abs(z) ** n * (be * (1 if h * z > 0 else -1) + ga))
                q = z + 0.5 * k
                z += h * (1 - abs(q) ** n * (be * (1 if h * q > 0 else -1) + ga))
        previous = v
        y.append(z)
    return x - c * np.array(y)


def duhem(x, al=3.2, g=0.68):
    """Coleman-Hodgdon with linear f and constant g; the exact step over each increment."""
    w, y, previous = float(x[0]), [], float(x[0])
    for v in x.tolist():
        d = v - previous
        if d:
            # w' = s al (x - w) + g per unit of x
            s = 1.0 if d > 0 else -1.0
            q = (g - 1) / (s * al)
            w = v + q + (w - previous - q) * math.exp(-al * abs(d))
        previous = v
        y.append(w)
    return np.array(y)


def jiles(x, a=0.55, k=0.22, al=0.06, c=0.15, lin=0.35):
    m, y, previous = 0.0, [], float(x[0])

    def slope(h, m, s):
        e = (h + al * m) / a
        if abs(e) < 1e-3:
            man, dman = e / 3, 1 / (3 * a)
        else:
            t = math.tanh(e)
            man, dman = 1 / t - 1 / e, (1 - 1 / t ** 2 + 1 / e ** 2) / a
        dif = man - m
        irr = dif / (k * s - al * dif) if dif * s > 0 else 0.0
        return (1 - c) * irr + c * dman
    for v in x.tolist():
        d = v - previous
        if d:
            s = 1.0 if d > 0 else -1.0
            n = int(abs(d) / 0.005) + 1
            h = d / n
            for j in range(n):
                p = previous + j * h
                mid = m + 0.5 * h * slope(p, m, s)
                m += h * slope(p + 0.5 * h, mid, s)
        previous = v
        y.append(m)
    return lin * x + 1.5 * np.array(y)


LAWS = {
    "maxwell-slip": maxwell, "power-pi": powerpi, "rayleigh": rayleigh, "tanh-play": gplay, "kp": kp, "bouc-wen": boucwen,
    "preisach-gauss": lambda x: density(x, "gauss"), "preisach-lorentz": lambda x: density(x, "lorentz"), "relays": relays,
    "duhem": duhem, "jiles-ath": jiles,
}


# ------------------------------------------------------------------------------------------------------------------------- drives
def piece(f, rng, kind, *p):
    """Returns one piece of a drive on the grid of f samples per second."""
    def axis(length):
        return np.arange(int(round(length * f))) / f
    if kind in ("sin", "tri", "low", "bump"):  # frequency, amplitude, middle, cycles
        freq, amp, mid, cycles = p
        ph = axis(cycles / freq) * freq
        if kind == "sin":
            return mid + amp * np.sin(2 * np.pi * ph)
        if kind == "bump":
            return mid - amp * np.cos(2 * np.pi * ph)
        if kind == "tri":
            return mid + amp * (1 - 4 * np.abs((ph + 0.25) % 1 - 0.5))
        return mid + amp * (1 - 2 * np.abs(2 * (ph % 1) - 1))
    if kind == "stairs":  # levels, hold, ramp
        levels, hold, ramp = p
        out, last = [], levels[0]
        for v in levels:
            n = max(int(round(ramp * f)), 1)
            out += [last + (v - last) * np.arange(1, n + 1) / n, np.full(int(round(hold * f)), v)]
            last = v
        return np.concatenate(out)
    if kind == "chirp":  # from, to, duration, amplitude, middle
        f0, f1, length, amp, mid = p
        t = axis(length)
        k = math.log(f1 / f0) / length
        return mid + amp * np.sin(2 * np.pi * f0 * np.expm1(k * t) / k)
    if kind == "multi":  # frequencies, duration, amplitude, middle
        freqs, length, amp, mid = p
        t = axis(length)
        s = sum(np.sin(2 * np.pi * q * t + ph) / (i + 1) ** 0.35 for i, (q, ph) in enumerate(zip(freqs, rng.uniform(0, 2 * np.pi, len(freqs)))))
        return mid + amp * s / np.max(np.abs(s))
    if kind == "walk":  # duration, corner frequency, amplitude, middle
        length, corner, amp, mid = p
        t = axis(length)
        kn = np.cumsum(rng.standard_normal(int(length * corner * 4) + 20) * 0.55)
        kn = 2 * np.abs((kn / 2.2 + 0.5) % 2 - 1) - 1  # reflected walk
        u = np.interp(np.arange(t.size + 2 * f / corner) * corner * 3 / f, np.arange(kn.size), kn)
        e = math.exp(-2 * np.pi * corner / f)
        for _ in range(2):
            u = lfilter([1 - e], [1, -e], u)
        u = u[-t.size:]
        return mid + amp * (2 * (u - u.min()) / np.ptp(u) - 1)
    if kind == "fork":  # bottom, top, reversals, seconds per unit
        low, high, revs, rate = p
        pts = [high]
        for r in revs:
            pts += [r, high]
        pts += [low]
        out = []
        for a, b in zip(pts[:-1], pts[1:]):
            n = max(int(abs(b - a) * rate * f), 2)
            out.append(a + (b - a) * np.arange(n) / n)
        return np.concatenate(out)
    if kind == "afm":  # line frequency, amplitude, lines, slow range
        line, amp, lines, slow = p
        ph = axis(lines / line) * line
        mid = slow * (2 * np.interp(ph, [0, lines], [0, 1]) - 1) if slow else 0.0
        ph = ph % 1
        ph = np.where(ph < 0.46, ph / 0.92, np.where(ph < 0.5, 0.5, np.where(ph < 0.96, 0.5 + (ph - 0.5) / 0.92, 1.0)))
        return mid + amp * (1 - 2 * np.abs(2 * ph - 1))
    if kind == "hold":
        return np.full(int(round(p[1] * f)), p[0])
    raise ValueError(kind)


def drive(f, rng, pieces, join=0.1):
    out = []
    for p in pieces:
        y = piece(f, rng, *p)
        if out and abs(out[-1][-1] - y[0]) > 1e-3:
            n = max(int(join * abs(out[-1][-1] - y[0]) * f), 4)
            out.append(out[-1][-1] + (y[0] - out[-1][-1]) * np.arange(1, n) / n)
        out.append(y)
    x = np.concatenate(out)
    assert np.max(np.abs(x)) <= 1.001, np.max(np.abs(x))
    return x


# ------------------------------------------------------------------------------------------------------------------------ filters
def low(y, tau, f):
    """First-order filter with an input that is linear between the points."""
    h = 1 / (f * tau)
    e = math.exp(-h)
    b1 = (1 - e) / h - e
    b0 = 1 - (1 - e) / h
    return lfilter([b0, b1], [1, -e], y - y[0]) + y[0]


def mode(y, f0, zeta, f):
    w = 2 * np.pi * f0
    num, den, _ = cont2discrete(([w * w], [1, 2 * zeta * w, w * w]), 1 / f, "foh")
    return lfilter(num.ravel(), den, y - y[0]) + y[0]


def creep(y, kind, size, f):
    if kind == "log":
        taus = np.geomspace(0.02, 3000, 22)
        weights = np.full(22, size * np.log10(taus[1] / taus[0]))
    elif kind == "power":
        taus = np.geomspace(0.03, 2000, 22)
        weights = taus ** 0.17
        weights *= size * 0.23 / weights[10]
    else:
        taus, weights = np.array(kind[0]), np.array(kind[1]) * size
    return y + sum(w * (low(y, tau, f) - y[0]) for tau, w in zip(taus, weights))


def profile(kind, t, rng):
    """Returns force (unit) or temperature (kelvin, unit) over time."""
    length = t[-1]
    if kind == "weights":
        edges = np.sort(rng.uniform(0.06, 0.94, 6)) * length
        levels = [0, 0.5, 1.0, 0.25, 0.8, 0.0, 0.6]
        return low(np.array(levels)[np.searchsorted(edges, t)], max(0.004 * length, 0.01), 1 / (t[1] - t[0]))
    if kind == "shaker":
        q = rng.uniform(7.3, 8.6) / length
        return 0.5 + 0.35 * np.sin(2 * np.pi * q * t + 1) + 0.15 * np.sin(2 * np.pi * 2.7 * q * t)
    if kind == "hand":
        u = lfilter([1], [1, -0.85], rng.standard_normal(60))
        u = np.interp(t, np.linspace(0, length, 60), u)
        u = low(low(u, length / 70, 1 / (t[1] - t[0])), length / 70, 1 / (t[1] - t[0]))
        return (u - u.min()) / np.ptp(u)
    if kind == "aircon":
        period = length / 2.4
        ph = (t / period + rng.uniform(0.1, 0.3)) % 1
        u = np.where(ph < 0.6, ph / 0.6, (1 - ph) / 0.4)
        return low(u, period / 12, 1 / (t[1] - t[0]))
    if kind == "heater":
        on = ((t > 0.12 * length) & (t < 0.45 * length)) | ((t > 0.72 * length) & (t < 0.85 * length))
        return low(on * 1.0, 0.1 * length, 1 / (t[1] - t[0]))
    if kind == "door":
        return -low(((t > 0.3 * length) & (t < 0.5 * length)) * 1.0, 0.05 * length, 1 / (t[1] - t[0])) + 0.5 * (1 - np.exp(-t / (0.5 * length)))
    raise ValueError(kind)


def noise(n, rng, kind, fs):
    w = rng.standard_normal(n)
    if kind == "white":
        return w
    q = np.fft.rfftfreq(n, 1 / fs)
    q[0] = q[1]
    p = np.fft.irfft(np.fft.rfft(rng.standard_normal(n)) / np.sqrt(q), n)
    p /= p.std()
    return p if kind == "pink" else (w + p) / math.sqrt(2)


# --------------------------------------------------------------------------------------------------------------------- one record
LAST = {}
VOLTS = {"150": (75, 75), "100": (50, 50), "120": (45, 75), "pm10": (0, 10), "cmd": (5, 5), "pm200": (0, 200)}


def record(case, x, lead, f, aux, eff, size, seed):
    """Returns the clean displacement on the fine grid.  `size`: range in um and extremes of the clean train record (None: no effects)."""
    t = (np.arange(x.size) - lead) / f
    u = x
    if "rail" in eff:
        u = np.clip(u, -1.0, eff["rail"])
    if "before" in eff:
        a, b = eff["before"]
        u = u + a * (u * u - 1) + b * (u ** 3 - u)
    if "amplag" in eff:
        u = low(u, eff["amplag"], f)
    path = np.concatenate([np.linspace(0, 0.97, 250), np.linspace(0.97, -0.97, 500)[1:], np.linspace(-0.97, u[0], 500)[1:]])
    law = LAWS[case["law"]]
    full = np.concatenate([path, u])
    if "rate" in eff:
        kind, k, ref, p = eff["rate"]
        v = low(np.abs(np.gradient(u)) * f, 3 / f, f)
        g = 1 + k * (np.log10(1 + v / ref) if kind == "log" else (v / ref) ** p)
        y = law(full, np.concatenate([np.full(path.size, g[0]), g]))[path.size:]
    else:
        key = (case["law"], full.tobytes())
        if LAST.get("key") != key:  # the twin is computed first
            LAST.update(key=key, value=law(full))
        y = LAST["value"][path.size:].copy()
    if "behind" in eff:
        a, b = eff["behind"]
        y = y + a * y * y + b * y ** 3
    if "bend" in eff:
        y = np.expm1(eff["bend"] * y) / eff["bend"]
    if "creep" in eff:
        y = creep(y, *eff["creep"], f)
    y = case["um"] / 2 * case["sign"] * y + 0.37 * case["um"]
    if size is None:
        return y
    span, bottom, top = size
    s = case["sign"]
    if "load" in eff:
        a, b = eff["load"]
        y = y - s * span * (a * aux["unit"] + b * aux["unit"] ** 2)
    if "heat" in eff:
        gain, expansion, tau = eff["heat"]
        rise = low(aux["rise"], tau, f) if tau else aux["rise"]
        y = y + gain * rise * (y - bottom) + expansion * span * rise
    if "fade" in eff:
        loss, tau = eff["fade"]
        y = y - loss * (1 - np.exp(-np.maximum(t, 0) / tau)) * (y - bottom)
    if "crack" in eff:
        y = y - eff["crack"] * (t > 0.42 * t[-1]) * (y - bottom)
    if "cyclic" in eff:
        period, a = eff["cyclic"]
        y = y + a * span * np.sin(2 * np.pi * y / period + 0.7)
    if "modes" in eff:
        y0, add = y, 0
        for f0, zeta, part in eff["modes"]:
            add = add + part * (mode(y0, f0, zeta, f) - y0)
        y = y0 + add
    if "stop" in eff:  # soft: the slope falls to `rest` within `width` around the level
        side, level, width, rest = eff["stop"]
        edge = bottom + level * span
        over = (y - edge) * side
        w = width * span
        y = y - side * (1 - rest) * (w * np.logaddexp(0, over / w) if w else np.maximum(over, 0))
    if "delay" in eff:
        y = np.interp(t - eff["delay"], t, y)
    if "lag" in eff:
        y = low(y, eff["lag"], f)
    if "skew" in eff:
        y = np.interp(t - eff["skew"] * np.maximum(t, 0), t, y)
    if "drift" in eff:
        kind, a, tau = eff["drift"]
        tt = np.maximum(t, 0)
        y = y + a * span * (tt / tau if kind == "line" else 1 - np.exp(-tt / tau))
    if "tone" in eff:
        rng = np.random.default_rng(seed)
        for q, a in eff["tone"]:
            y = y + a * span * np.sin(2 * np.pi * q * t + rng.uniform(0, 6.28))
    return y


# -------------------------------------------------------------------------------------------------------------------------- cases
def plan():
    """Defines each case: name, law, model, samples/s, refinement, volts, um, train pieces, test pieces, effects, names, and further settings."""
    cases = []

    def add(name, law, model, fs, over, volts, um, train, test, eff=None, expect=(), **more):
        cases.append(dict(dict(name=name, law=law, model=model, fs=fs, over=over, volts=volts, um=abs(um), sign=1 if um > 0 else -1,
                               train=train, test=test, eff=eff or {}, expect=list(expect), accept=[], snr=70, noise="white", bits=16,
                               lead=0.0, force=None, temp=None, join=0.1), **more))

    def decay(kind, f, amps, mid=0.0, n=1):
        return [(kind, f, a, mid, n) for a in amps]

    def rising(f, tops, n=1, kind="low"):  # all cycles from the lower end
        return [(kind, f, (h + 0.95) / 2, (h - 0.95) / 2, n) for h in tops]
    A8 = [0.95, 0.82, 0.7, 0.57, 0.45, 0.32, 0.2, 0.1]
    A6 = [0.93, 0.75, 0.58, 0.42, 0.26, 0.12]
    FORK = [-0.8, -0.6, -0.4, -0.2, 0.0, 0.2, 0.4, 0.6]
    st = [-0.95, -0.5, 0.1, 0.6, 0.95, 0.4, -0.2, -0.7, 0.3, 0.8, 0.0, -0.9]
    st2 = [-0.95, 0.2, 0.9, 0.5, -0.4, -0.85, -0.1, 0.7, 0.25, -0.6]

    # ---- no effect
    add("decay-tri", "maxwell-slip", "pi", 500, 4, "150", 18, decay("tri", 0.5, A8, 0, 1), decay("sin", 0.8, A6[:5], 0.02, 2), snr=72)
    add("two-rates", "power-pi", "pi", 2000, 2, "100", 92, [("low", 0.8, .93, 0, 1), ("low", 8, .6, -.2, 8), ("sin", 30, .4, .3, 30), ("low", 2, .9, 0, 2), ("sin", 3, .25, .5, 5)],
        [("sin", 15, .85, 0, 20), ("low", 1.5, .5, -.3, 3), ("low", 4, .7, .2, 6)], noise="mixed", snr=68)
    add("afm-small", "rayleigh", "pi", 1000, 4, "pm200", -9, [("afm", 2, .9, 6, 0), ("afm", 4, .2, 12, .6), ("afm", 4, .08, 8, .8)], [("afm", 3, .5, 12, .4), ("sin", 1, .9, 0, 2)], snr=74)
    add("forks", "relays", "preisach", 200, 5, "150", 30, [("low", .2, .95, 0, 1), ("fork", -.95, .95, FORK, 1.2)], [("low", .3, .95, 0, 1), ("walk", 18, .4, .9, 0)], snr=66, bits=14)
    add("stairs-still", "preisach-gauss", "preisach", 400, 4, "cmd", 60, [("stairs", st, 1.2, .1)] + decay("low", .5, A6[:4]), [("stairs", st2, 1.0, .1), ("sin", .7, .8, 0, 4)], snr=70, noise="pink")
    add("kp-sines", "kp", "preisach", 1000, 3, "150", 14, decay("bump", 2, A8, 0, 2), decay("low", 3, A6, .03, 2) + [("sin", 5, .5, -.2, 6)], snr=76)
    add("tanh-walk", "tanh-play", "preisach", 500, 4, "120", 25, decay("low", .5, [.95, .6], 0, 1) + [("walk", 16, .8, .95, 0)], [("walk", 12, 1.0, .93, 0)], snr=68)
    add("duhem-sines", "duhem", "preisach", 1000, 3, "150", 80, decay("bump", 1, A6, 0, 2), rising(1.5, [.9, .5, .2, -.2], 3), snr=64, bits=12)
    add("chirp", "bouc-wen", "bouc-wen", 2000, 3, "100", 110, [("bump", 1, .95, 0, 2), ("chirp", .5, 40, 5, .9, 0), ("sin", 5, .4, 0, 6)], [("chirp", 1, 30, 4, .7, .1), ("low", 2, .9, 0, 3)], snr=70)
    add("rod-warm", "jiles-ath", "preisach", 200, 5, "pm10", 45, decay("sin", .25, A8, 0, 1) + decay("bump", .4, [.9, .5], 0, 3), [("walk", 25, .3, .9, 0), ("bump", .3, .95, 0, 2)], temp=("aircon", 3.0), snr=68)
    add("multisine-force", "maxwell-slip", "pi", 2000, 2, "120", 22, [("multi", [.7, 1.9, 4.3, 9.1, 17], 6, .95, 0)], [("multi", [.9, 2.3, 6.1, 13], 5, .9, 0)], force=("shaker", 12), snr=71)
    add("stairs-bw", "bouc-wen", "bouc-wen", 250, 6, "150", -35, [("stairs", st, 1.5, .3)] + decay("sin", .4, [.95, .6, .3], 0, 2), [("stairs", st2, 1.2, .3), ("tri", .5, .9, 0, 3)], snr=69, noise="mixed")
    add("mid-cycle", "preisach-lorentz", "preisach", 1000, 3, "150", 12, decay("bump", 1.3, [.95, .95, .7, .5, .85, .3], 0, 2), decay("tri", 2, A6, -.03, 2), lead=.31, noise="pink", snr=70)

    # ---- delay
    many = [("low", 1, .93, 0, 2), ("sin", 12, .6, .2, 18), ("low", 30, .5, -.3, 40), ("sin", 55, .35, .1, 70), ("low", 4, .8, 0, 5)]
    many2 = [("chirp", 2, 70, 3, .6, 0), ("low", 6, .9, 0, 8), ("sin", 40, .5, .2, 40)]
    add("delay-afm", "maxwell-slip", "pi", 4000, 3, "150", 6, [("afm", 10, .92, 14, 0), ("afm", 30, .5, 40, .3), ("afm", 2, .7, 1, 0)], [("afm", 20, .8, 30, 0), ("afm", 5, .5, 6, .3)], {"delay": .00085}, ["delay"], snr=68)
    add("delay-rates", "preisach-gauss", "preisach", 5000, 2, "100", 33, many, many2, {"delay": .0011}, ["delay"], snr=68)
    add("delay-one-sine", "kp", "preisach", 500, 6, "150", 75, decay("bump", 3, [.95, .7, .45], 0, 7), decay("bump", 3, [.85, .5], 0, 8), {"delay": .004}, ["delay"], accept=[["lag"], ["rate-dependence"]], snr=64, bits=12)
    add("delay-multi", "power-pi", "pi", 2000, 5, "cmd", 100, [("bump", .8, .95, 0, 1), ("multi", [1.1, 3.7, 11, 29, 61], 5, .95, 0)], [("multi", [.9, 5.3, 17, 47], 5, .9, 0)], {"delay": .0022}, ["delay"], noise="mixed", snr=65)
    # ---- lag
    add("lag-amplifier", "relays", "preisach", 5000, 3, "150", 28, many, many2, {"amplag": .0014}, ["lag"], snr=70)
    add("lag-steps", "maxwell-slip", "pi", 2000, 5, "120", 40, [("stairs", st, .12, .002), ("low", 3, .9, 0, 3), ("low", 20, .5, .1, 30), ("stairs", st2, .08, .002)], [("stairs", st2[::-1], .1, .002), ("sin", 15, .8, 0, 15)], {"lag": .0045}, ["lag"], snr=69)
    add("lag-filter", "rayleigh", "pi", 10000, 2, "pm200", 4.5, [("low", 6, .95, 0, 3), ("afm", 60, .6, 40, .2), ("low", 150, .3, 0, 60)], [("chirp", 5, 200, .9, .7, 0), ("afm", 30, .9, 12, 0)], {"lag": .0004}, ["lag"], snr=67)
    add("lag-bw", "bouc-wen", "bouc-wen", 4000, 3, "100", 120, [("bump", 1, .95, 0, 1), ("chirp", 1, 90, 3, .8, 0), ("low", 8, .7, .1, 8)], [("multi", [1.3, 6, 19, 51], 3, .9, 0)], {"lag": .0011}, ["lag"], snr=68)
    # ---- creep
    hold = [("stairs", [-.95, .3, .3, .9, -.2, -.8], 6, .1), ("low", .5, .95, 0, 2), ("low", 5, .6, .2, 8), ("stairs", [-.5, .7, .1, -.9], 5, .1)]
    hold2 = [("low", 2, .9, 0, 3), ("stairs", [-.9, .8, .0, -.6, .5], 7, .15), ("sin", 1, .7, 0, 4)]
    add("creep-stairs", "power-pi", "pi", 200, 5, "150", 16, hold, hold2, {"creep": ("log", .018)}, ["creep"], snr=70)
    add("creep-relays", "relays", "preisach", 100, 8, "150", 105, [("stairs", st, 8, .3)] + decay("low", .2, [.95, .7, .45], 0, 2), [("stairs", st2, 9, .3), ("low", .3, .9, 0, 3)], {"creep": ("log", .028)}, ["creep"], snr=66, noise="mixed")
    add("creep-power", "preisach-lorentz", "preisach", 100, 8, "100", 20, hold + decay("bump", .3, [.9, .5], 0, 2), hold2, {"creep": ("power", .02)}, ["creep"], snr=69)
    add("creep-two", "maxwell-slip", "pi", 150, 6, "pm200", -11, [("stairs", st2, 6, .2), ("tri", .3, .95, 0, 2), ("tri", 3, .6, 0, 9)], hold2, {"creep": (((.5, 9.0), (.018, .03)), 1.0)}, ["creep"], snr=71)
    add("creep-bw", "bouc-wen", "bouc-wen", 100, 8, "150", 50, [("stairs", st, 6, .4)] + decay("bump", .25, [.95, .6], 0, 2), [("stairs", st2, 7, .4), ("bump", .3, .8, 0, 3)], {"creep": ("log", .025)}, ["creep"], snr=69)
    # ---- rate
    rates = [("low", .1, .95, 0, 1), ("low", 1, .95, 0, 3), ("low", 10, .95, 0, 12), ("low", .3, .6, .1, 1), ("low", 5, .6, -.2, 6), ("sin", 20, .7, .1, 20)]
    rates2 = [("low", .2, .8, 0, 1), ("low", 3, .8, 0, 5), ("sin", 12, .9, 0, 15), ("sin", .5, .5, .2, 2)]
    add("rate-log", "maxwell-slip", "pi", 1000, 3, "150", 19, rates, rates2, {"rate": ("log", .2, .5, 0)}, ["rate-dependence"], snr=71)
    add("rate-power", "power-pi", "pi", 1000, 3, "100", 65, rates, rates2, {"rate": ("pow", .22, 10., .4)}, ["rate-dependence"], snr=70, noise="mixed")
    add("rate-preisach", "maxwell-slip", "preisach", 800, 3, "cmd", 38, [("low", .12, .95, 0, 1), ("low", 2, .95, 0, 4), ("low", 18, .95, 0, 24), ("low", .4, .5, .3, 1), ("low", 8, .5, .3, 8), ("bump", 12, .7, -.1, 12)], rates2, {"rate": ("log", .22, .3, 0)}, ["rate-dependence"], snr=70)
    # ---- asymmetry
    add("asym-behind", "maxwell-slip", "pi", 500, 4, "150", 24, decay("low", .5, A8, 0, 1), rising(.8, [.9, .5, 0, -.4], 2), {"behind": (.075, -.03)}, ["asymmetry"], snr=70)
    add("asym-before", "rayleigh", "pi", 1000, 3, "cmd", -50, [("bump", .8, .95, 0, 2), ("multi", [.9, 2.1, 4.7, 8.3], 6, .93, 0)], [("multi", [1.3, 3.1, 6.1], 6, .9, 0)], {"before": (.08, -.05)}, ["asymmetry"], snr=68)
    add("asym-exp", "power-pi", "pi", 250, 5, "pm10", 30, rising(.3, [.95, .6, .3, 0, -.3, -.6]) + decay("sin", .5, [.9, .5, .25], 0, 2), [("walk", 20, .4, .93, 0)], {"bend": .28}, ["asymmetry"], snr=66, bits=14, noise="mixed")
    # ---- load
    add("load-weights", "kp", "preisach", 200, 5, "150", 90, decay("low", .25, A8, 0, 1) + decay("bump", .5, [.9, .6], .0, 2), [("walk", 20, .4, .93, 0), ("low", .5, .9, 0, 3)], {"load": (.04, 0.)}, ["load"], force=("weights", 20), snr=70)
    add("load-shaker", "maxwell-slip", "pi", 1000, 3, "120", 13, decay("tri", 1.5, A8, 0, 2), decay("sin", 2, A6, 0, 2), {"load": (.03, .0)}, ["load"], force=("shaker", 150), snr=72)
    add("load-hand", "jiles-ath", "preisach", 300, 4, "100", -70, [("low", .4, .95, 0, 3), ("low", .6, .6, .1, 4), ("walk", 18, .5, .9, 0)], rising(.6, [.9, .6, .3, 0, -.3], 2), {"load": (.03, .015)}, ["load"], force=("hand", 40), snr=68)
    # ---- saturation
    add("sat-adc", "power-pi", "pi", 500, 4, "150", 21, decay("tri", .5, A8, 0, 1) + rising(.6, [.9, .5, .1]), decay("sin", .7, [.93, .85, .6, .9], .0, 2), {"adc": .93}, ["saturation"], snr=69)
    add("sat-stop", "preisach-lorentz", "preisach", 500, 4, "150", 85, rising(.7, [.95, .8, .65, .5, .3, 0, -.4], 1) + decay("tri", .8, [.93, .7, .5, .3], 0, 1) + [("low", 1, .3, .65, 2)], [("walk", 14, .6, .95, 0), ("low", .6, .9, 0, 2)], {"stop": (1, .87, .0, .02)}, ["saturation"], snr=71)
    add("sat-soft", "maxwell-slip", "pi", 1000, 3, "100", 45, rising(1, [.95, .8, .6, .4, .1, -.3], 1) + [("low", 2, .25, .7, 3), ("low", 2, .25, 0, 3)], [("multi", [.7, 1.9, 3.3], 6, .95, 0)], {"stop": (1, .86, .025, .1)}, ["saturation"], accept=[["asymmetry"]], snr=69)
    add("sat-rail", "relays", "preisach", 400, 4, "cmd", 32, decay("tri", .5, A8, 0, 1) + rising(.6, [.95, .85, .5, .1]), [("walk", 16, .6, .97, 0), ("tri", .7, .93, 0, 2)], {"rail": .72}, ["saturation"], snr=69)
    # ---- temperature
    slow = decay("low", .1, [.95, .8, .65, .5, .35], 0, 1) + [("low", .2, .9, 0, 6), ("bump", .15, .6, .2, 5), ("low", .2, .9, 0, 5)]
    slow2 = [("bump", .12, .9, 0, 4), ("walk", 50, .15, .9, 0)]
    add("temp-expand", "tanh-play", "preisach", 100, 6, "150", 15, slow, slow2, {"heat": (0., .008, 6.)}, ["temperature"], temp=("heater", 5.0), snr=71)
    add("temp-gain", "maxwell-slip", "pi", 100, 6, "150", 100, slow, slow2, {"heat": (.0055, .0, 0.)}, ["temperature"], temp=("aircon", 7.0), snr=70)
    add("temp-both", "preisach-gauss", "preisach", 60, 10, "120", 28, slow + decay("low", .1, [.9, .5], 0, 2), slow2, {"heat": (.003, -.006, 4.)}, ["temperature"], temp=("door", 5.0), snr=69, noise="mixed")
    # ---- drift
    add("drift-line", "jiles-ath", "preisach", 100, 8, "pm10", 40, decay("sin", .2, [.95, .6, .8, .4, .95, .7, .9, .3], 0, 2), [("walk", 50, .2, .92, 0), ("bump", .2, .9, 0, 3)], {"drift": ("line", .035, 80.)}, ["drift"], snr=68)
    add("drift-warmup", "power-pi", "pi", 250, 4, "150", 8, decay("low", .5, A6, 0, 3) + decay("bump", .8, [.9, .5], 0, 6), decay("tri", .6, [.9, .7, .4], 0, 6), {"drift": ("exp", .035, 11.)}, ["drift"], snr=70)
    add("drift-bw", "bouc-wen", "bouc-wen", 200, 5, "100", -60, decay("tri", .5, [.95, .7, .95, .4, .95, .7], 0, 4), [("bump", .7, .9, 0, 12), ("tri", .5, .6, .1, 12)], {"drift": ("line", .025, 45.)}, ["drift"], snr=69, lead=.7)
    # ---- interference
    add("hum", "rayleigh", "pi", 1000, 3, "pm200", 3, decay("tri", 1, A8, 0, 1) + [("afm", 3, .5, 9, .3)], [("afm", 2, .85, 12, 0)], {"tone": [(49.98, .005), (149.94, .0012)]}, ["interference"], snr=68)
    add("hum-alias", "kp", "preisach", 80, 8, "150", 95, decay("low", .15, A8, 0, 1) + [("walk", 30, .2, .9, 0)], [("bump", .2, .9, 0, 7), ("walk", 20, .25, .8, 0)], {"tone": [(50.03, .006)]}, ["interference"], snr=66, bits=14)
    # ---- resonance
    add("mode-corners", "duhem", "pi", 5000, 6, "120", 80, [("low", 2, .95, 0, 2), ("low", 12, .8, 0, 20), ("low", 20, .4, .3, 20), ("stairs", st2, .1, .003)], [("low", 8, .9, 0, 12), ("low", 25, .6, 0, 30)], {"modes": [(210., .018, 1.)]}, ["resonance"], snr=70)
    add("mode-chirp", "preisach-gauss", "preisach", 4000, 6, "100", 200, [("bump", 2, .95, 0, 2), ("chirp", 4, 60, 1.2, .4, 0), ("chirp", 60, 190, 1.3, .08, .1), ("low", 5, .7, .1, 5)], [("chirp", 40, 170, 2, .08, .1), ("low", 6, .9, 0, 6)], {"modes": [(128., .07, 1.)]}, ["resonance"], snr=68)
    add("mode-afm", "power-pi", "pi", 10000, 5, "pm200", 5, [("low", 5, .95, 0, 1), ("afm", 25, .9, 14, 0), ("afm", 60, .5, 30, .3), ("low", 10, .3, .4, 2)], [("afm", 40, .8, 30, .1)], {"modes": [(640., .02, .7), (1150., .03, .2)]}, ["resonance"], snr=69)
    add("mode-bw", "bouc-wen", "bouc-wen", 4000, 6, "150", 150, [("low", 2, .95, 0, 2), ("stairs", st, .15, .006), ("low", 10, .7, 0, 10)], [("stairs", st2, .15, .006), ("low", 6, .9, 0, 6)], {"modes": [(95., .05, 1.)]}, ["resonance"], snr=70)
    # ---- unlisted effects
    add("interferometer", "maxwell-slip", "pi", 1000, 3, "150", 2.2, decay("low", .8, A8, 0, 1), [("bump", 1, .9, 0, 3), ("walk", 5, 1.5, .9, 0)], {"cyclic": (.3164, .006)}, ["unknown"], snr=72)
    add("depoling", "relays", "preisach", 200, 5, "150", 34, decay("low", .5, [.95, .95, .6, .95, .8, .95, .5, .95], 0, 3), decay("bump", .6, [.9, .7, .9], 0, 8), {"fade": (.05, 14.)}, ["unknown"], snr=70)
    add("two-clocks", "power-pi", "pi", 1000, 4, "cmd", 70, decay("low", 2, [.95, .6, .95, .3], 0, 8) + decay("bump", 6, [.9, .5], 0, 30), [("multi", [1.1, 3.1, 7.3], 20, .95, 0)], {"skew": .00055}, ["unknown"], accept=[["delay"]], snr=68)
    add("crack", "preisach-lorentz", "preisach", 250, 5, "120", -26, decay("low", .6, [.95, .7, .5, .95, .85, .3, .6, .95], 0, 2), decay("tri", .8, [.9, .6, .9, .4], 0, 5), {"crack": .04}, ["unknown"], snr=70)

    # ---- two effects
    add("creep-mode", "power-pi", "pi", 2000, 7, "150", 90, [("stairs", [-.95, .4, .9, -.3, .2], 2.2, .005), ("low", 2, .9, 0, 3), ("low", 10, .6, .1, 10), ("stairs", [.7, -.8], 2.2, .005)], [("stairs", [-.9, .7, -.1, .3], 2.5, .005), ("low", 5, .8, 0, 6)],
        {"creep": ("log", .022), "modes": [(140., .03, 1.)]}, ["creep", "resonance"], snr=70)
    add("creep-delay", "preisach-gauss", "preisach", 1000, 4, "100", 27, [("stairs", [-.95, .4, .9, -.3, .2], 3, .05), ("low", 1, .95, 0, 2), ("sin", 15, .6, .1, 15), ("low", 30, .4, -.2, 30)], [("low", 5, .9, 0, 6), ("stairs", [-.8, .6, -.2], 4, .05), ("sin", 20, .5, .2, 20)],
        {"creep": ("log", .024), "delay": .0016}, ["creep", "delay"], snr=69)
    add("asym-lag", "maxwell-slip", "pi", 3000, 3, "150", 17, rising(2, [.95, .6, .2, -.2]) + [("low", 15, .9, 0, 10), ("sin", 40, .5, .3, 30), ("low", 40, .4, -.4, 30)], [("chirp", 2, 60, 2.5, .8, 0), ("low", 5, .9, 0, 5)],
        {"bend": .22, "lag": .0013}, ["asymmetry", "lag"], snr=69)
    add("drift-hum", "kp", "preisach", 500, 4, "cmd", 55, decay("low", .6, [.95, .6, .8, .3, .95, .45, .7], 0, 1) + decay("bump", .8, [.9, .6, .3, .95], 0, 2), decay("tri", .7, [.95, .7, .5, .9], 0, 3), {"drift": ("line", .035, 20.), "tone": [(60.02, .006)]}, ["drift", "interference"], snr=68)
    add("temp-creep", "power-pi", "pi", 80, 8, "150", 23, [("stairs", st, 6, .3), ("low", .2, .9, 0, 6), ("low", .1, .9, 0, 2), ("stairs", st2[:5], 6, .3)], [("stairs", st2, 7, .3), ("low", .2, .9, 0, 7)], {"heat": (0., .009, 5.), "creep": ("log", .02)}, ["temperature", "creep"], temp=("aircon", 6.0), snr=70)
    add("load-mode", "preisach-lorentz", "preisach", 2500, 8, "120", 130, [("low", 1, .95, 0, 2), ("stairs", st2, .15, .006), ("low", 8, .7, 0, 12), ("low", 3, .5, .2, 4)], [("low", 6, .9, 0, 12), ("stairs", st, .12, .006)], {"load": (.04, 0.), "modes": [(115., .04, 1.)]}, ["load", "resonance"], force=("weights", 60), snr=70)
    add("sat-lag", "relays", "preisach", 4000, 3, "150", 42, rising(3, [.95, .8, .6, .3, -.1]) + [("low", 25, .4, .5, 20), ("sin", 50, .4, -.2, 40), ("low", 10, .95, 0, 6)], [("chirp", 3, 60, 2, .8, 0), ("low", 5, .93, 0, 4)], {"stop": (1, .88, 0., .0), "lag": .0012}, ["saturation", "lag"], snr=69)
    add("rate-drift", "maxwell-slip", "pi", 600, 4, "100", 31, rates, rates2, {"rate": ("log", .2, .5, 0), "drift": ("exp", .04, 5.)}, ["rate-dependence", "drift"], snr=70)
    add("temp-delay", "rayleigh", "pi", 200, 10, "150", 12, [("low", .3, .95, 0, 4), ("sin", 3, .6, .2, 30), ("low", 6, .5, -.2, 60), ("low", .5, .9, 0, 6), ("sin", 9, .4, 0, 60)], [("low", 1, .9, 0, 10), ("multi", [.5, 1.7, 4.1, 8.3], 20, .9, 0)], {"heat": (.004, .005, 2.), "delay": .009}, ["temperature", "delay"], temp=("heater", 6.0), snr=70)
    add("hum-mode", "tanh-play", "preisach", 4000, 6, "150", 160, [("low", 2, .95, 0, 2), ("low", 10, .6, .1, 12), ("stairs", st, .1, .003)], [("low", 7, .9, 0, 10), ("stairs", st2, .1, .003)], {"tone": [(50.01, .0065)], "modes": [(230., .03, 1.)]}, ["interference", "resonance"], snr=69)
    add("asym-creep", "maxwell-slip", "pi", 150, 6, "pm10", -19, [("stairs", st, 4, .15)] + rising(.4, [.9, .5, .1, -.3]) + [("low", 2, .9, 0, 6)], [("stairs", st2, 5, .15), ("bump", .5, .9, 0, 4)], {"creep": ("log", .022), "behind": (.08, 0.)}, ["asymmetry", "creep"], snr=70)
    add("bw-lag-drift", "bouc-wen", "bouc-wen", 1000, 4, "100", 75, [("low", 1, .95, 0, 4), ("low", 8, .7, .1, 24), ("sin", 20, .5, 0, 60), ("low", 1, .6, 0, 3)], [("chirp", .5, 30, 6, .9, 0), ("low", 2, .9, 0, 8)], {"lag": .0025, "drift": ("line", .03, 12.)}, ["lag", "drift"], snr=69)
    add("load-creep", "preisach-gauss", "preisach", 150, 6, "150", 48, [("stairs", st, 4, .2), ("low", .3, .95, 0, 3), ("low", 3, .6, .1, 12)], [("stairs", st2, 5, .2), ("low", .5, .9, 0, 5)], {"load": (.04, 0.), "creep": ("log", .024)}, ["load", "creep"], force=("hand", 25), snr=70)
    # ---- a few more, model Bouc-Wen
    add("bw-single", "bouc-wen", "bouc-wen", 500, 4, "pm10", 20, [("sin", 1, .9, 0, 12)], [("sin", 1.5, .7, .05, 12)], lead=.4, snr=70)
    add("bw-load", "bouc-wen", "bouc-wen", 500, 4, "150", 65, decay("low", 1, A6, 0, 2), decay("sin", 1.5, [.9, .6, .3], 0, 4), {"load": (.035, .0)}, ["load"], force=("hand", 30), snr=70)
    add("bw-hum-alias", "duhem", "bouc-wen", 120, 8, "cmd", 88, decay("bump", .4, A8, 0, 2), [("walk", 25, .3, .9, 0), ("bump", .5, .9, 0, 4)], {"tone": [(49.97, .007)]}, ["interference"], snr=68)
    add("bw-delay", "bouc-wen", "bouc-wen", 4000, 3, "120", 36, many[:4], many2, {"delay": .0009}, ["delay"], snr=68)
    return cases


# --------------------------------------------------------------------------------------------------------------------- generation
def basis(v):
    """Returns play operators and a Preisach plane of relays for the check."""
    x = 2 * (v - v.min()) / np.ptp(v) - 1
    r = np.linspace(0, 0.98, 26)
    g = np.linspace(-0.95, 0.95, 15)
    a, b = np.meshgrid(g, g)
    a, b = a[a > b], b[a > b]
    z, s = np.zeros(r.size), -np.ones(a.size)
    out = np.empty((x.size, r.size + a.size + 1))
    for i, u in enumerate(x.tolist()):
        np.maximum(z, u - r, out=z)
        np.minimum(z, u + r, out=z)
        s[a < u] = 1
        s[b > u] = -1
        out[i, :r.size], out[i, r.size:-1], out[i, -1] = z, s, 1
    return out, r.size


def left(change, v, model):
    step = max(v.size // 6000, 1)
    full, n = basis(v)
    full = full if model == "preisach" else np.hstack([full[:, :n], full[:, -1:]])
    full, change = full[::step], change[::step]
    g = full.T @ full + 1e-7 * len(change) * np.eye(full.shape[1])
    return float(np.std(change - full @ np.linalg.solve(g, full.T @ change)))


def jitter(eff, rng):
    """Sizes vary by a tenth with the seed."""
    def vary(v):
        return float(v * rng.uniform(0.9, 1.1))
    eff = dict(eff)
    for key in ("delay", "lag", "amplag", "skew", "crack", "bend"):
        if key in eff:
            eff[key] = vary(eff[key])
    if "creep" in eff:
        eff["creep"] = (eff["creep"][0], vary(eff["creep"][1]))
    if "modes" in eff:
        eff["modes"] = [(vary(a), vary(b), c) for a, b, c in eff["modes"]]
    if "tone" in eff:
        eff["tone"] = [(a, vary(b)) for a, b in eff["tone"]]
    for key in ("load", "heat", "before", "behind"):
        if key in eff:
            k = vary(1)
            eff[key] = (eff[key][0] * k, eff[key][1] * k, *eff[key][2:])
    if "rate" in eff:
        eff["rate"] = (eff["rate"][0], vary(eff["rate"][1]), *eff["rate"][2:])
    if "drift" in eff:
        eff["drift"] = (eff["drift"][0], vary(eff["drift"][1]), eff["drift"][2])
    return eff


def generate(out, number, case, seed, check):
    key = zlib.crc32(case["name"].encode())
    fs, over = case["fs"], case["over"]
    f = fs * over
    eff = jitter(case["eff"], np.random.default_rng([seed, key, 9]))
    folder = os.path.join(out, f"w{number:02d}-{case['name']}")
    os.makedirs(folder, exist_ok=True)
    middle, half = VOLTS[case["volts"]]
    size, text = None, ""
    for index, part in enumerate(("train", "test")):
        rng = np.random.default_rng([seed, key, index])
        x = drive(f, rng, case[part], case["join"])
        # whole cycles may precede the record; otherwise the actuator rests for 0.5 s or 40 samples
        lead = int(round(case["lead"] * f))
        if not lead:
            lead = max(int(0.5 * f), 40 * over)
            x = np.concatenate([np.full(lead, x[0]), x])
        lead -= lead % over
        t = (np.arange(x.size) - lead) / f
        aux, columns = {}, {}
        take = slice(lead, None, over)
        if case["force"]:
            kind, newton = case["force"]
            unit = np.concatenate([np.zeros(lead), profile(kind, t[lead:], rng)])
            unit[:lead] = unit[lead]
            aux["unit"] = unit
            columns["load_n"] = np.round((unit * newton + newton * 0.002 * rng.standard_normal(x.size))[take], 4)
        if case["temp"]:
            kind, kelvin = case["temp"]
            unit = np.concatenate([np.zeros(lead), profile(kind, t[lead:], rng)])
            unit[:lead] = unit[lead]
            aux["rise"] = kelvin * unit
            columns["temperature_degc"] = np.round(22.4 + aux["rise"][take] + 0.012 * rng.standard_normal(t[take].size), 2)
        twin = record(case, x, lead, f, aux, {}, None, 0)
        if size is None:
            s = twin[lead:]
            size = (float(np.ptp(s)), float(s.min()), float(s.max()))
            level = size[0] * 10 ** (-case["snr"] / 20)
            lsb = 1.35 * size[0] / 2 ** case["bits"]
        tone_seed = [seed, key, 5, index]
        real = record(case, x, lead, f, aux, eff, size, tone_seed) if case["eff"] else twin
        v = (middle + half * x)[take]
        times = np.arange(v.size) / fs
        clean = {}
        for j, (prefix, y) in enumerate((("", real), ("twin-", twin))):
            y = y[take]
            r = np.random.default_rng([seed, key, 20 + index, j])
            z = y + level * noise(y.size, r, case["noise"], fs)
            c = y
            if "adc" in eff and not prefix:
                edge = size[1] + eff["adc"] * size[0]
                z, c = np.minimum(z, edge), np.minimum(y, edge)
            z = np.round(z / lsb) * lsb
            clean[prefix] = c
            table = np.column_stack([times, v, z, *columns.values()])
            assert np.all(np.isfinite(table)) and 2000 <= len(table) <= 60000, len(table)
            digits = ["%.6f", "%.5f", "%.6f"] + ["%.4f"] * len(columns)
            with open(os.path.join(folder, f"{prefix}{part}.csv"), "w") as file:
                file.write(",".join(["time_s", "voltage_v", "displacement_um", *columns]) + "\n")
                file.write("\n".join(map((",".join(digits)).__mod__, map(tuple, table.tolist()))) + "\n")
            if check:
                assert np.max(np.abs(np.diff(np.round(times, 6)) - 1 / fs)) < 2e-6
                assert "adc" in eff or np.ptp(z) < 1.35 * size[0] * 1.3, "converter"
        change = clean[""] - clean["twin-"]
        total = np.std(change)
        text += f" | {part} {v.size} rows {times[-1]:.1f} s, change {100 * total / size[0]:.2f} % {total / level:.1f} noises"
        if check:
            text += f", twin misfit {100 * left(clean['twin-'], v, case['model']) / size[0]:.2f} %"
        if check and case["eff"]:
            rest = left(change, v, case["model"])
            text += f", not absorbed {100 * rest / size[0]:.2f} % {rest / level:.1f}"
            if part == "train" and (rest < 0.003 * size[0] or rest < 3 * level):
                text += " SMALL"
    with open(os.path.join(folder, "truth.json"), "w") as file:
        json.dump({"expect": case["expect"], "accept": case["accept"], "base": case["law"], "model": case["model"]}, file)
    print(f"w{number:02d}-{case['name']:16} {case['law']:16} {case['model']:9} {','.join(case['expect']) or '-':26} {fs} Hz{text}", flush=True)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("out")
    parser.add_argument("--seed", type=int, default=80117)
    parser.add_argument("--only")
    parser.add_argument("--check", action="store_true")
    args = parser.parse_args()
    only = set(args.only.split(",")) if args.only else None
    for number, case in enumerate(plan(), 1):
        if only is None or f"w{number:02d}" in only:
            generate(args.out, number, case, args.seed, args.check)


if __name__ == "__main__":
    main()
