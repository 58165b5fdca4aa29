"""Draws piezo actuators with known troubles: `python eleventh.py DIR` writes the case folders (needs numpy, scipy, numba).

Everything here is made from physics of its own: a timeline (unrecorded history, segments, gaps) is built on a fine grid, the drive passes
amplifier, hysteresis law, body, mechanics and sensor, and only the recorded rows are written.
"""
import json
import os
import sys
import time
import zlib

import numpy as np
from numba import njit
from scipy.interpolate import PchipInterpolator

# ---------------------------------------------------------------------------------------------------------------- hysteresis kernels


@njit
def k_plays(s, r, w, w0, f):
    """Prandtl-Ishlinskii; f scales the radii at each instant."""
    y = np.empty(s.size)
    z = np.full(r.size, s[0])
    for k in range(s.size):
        acc = w0 * s[k]
        for i in range(r.size):
            ri = r[i] * f[k]
            if s[k] - ri > z[i]:
                z[i] = s[k] - ri
            elif s[k] + ri < z[i]:
                z[i] = s[k] + ri
            acc += w[i] * z[i]
        y[k] = acc
    return y


@njit
def k_maxwell(s, c, lim, d, f):
    """Massless springs that slip at a force: x = d s - sum of forces."""
    y = np.empty(s.size)
    q = np.zeros(c.size)
    prev = s[0]
    for k in range(s.size):
        ds = s[k] - prev
        prev = s[k]
        acc = d * s[k]
        for i in range(c.size):
            top = lim[i] * f[k]
            v = q[i] + c[i] * ds
            if v > top:
                v = top
            elif v < -top:
                v = -top
            q[i] = v
            acc -= v
        y[k] = acc
    return y


@njit
def k_relays(s, mid, half, w, w0, f):
    """Independent bistable units; f widens them at each instant."""
    y = np.empty(s.size)
    st = np.full(mid.size, -1.0)
    for k in range(s.size):
        acc = w0 * s[k]
        for i in range(mid.size):
            hw = half[i] * f[k]
            if s[k] >= mid[i] + hw:
                st[i] = 1.0
            elif s[k] <= mid[i] - hw:
                st[i] = -1.0
            acc += w[i] * st[i]
        y[k] = acc
    return y


@njit
def k_kp(s, up, down, width, w, w0):
    """Krasnosel'skii-Pokrovskii kernels: a ridge of finite slope instead of the jump."""
    y = np.empty(s.size)
    st = np.full(up.size, -1.0)
    for k in range(s.size):
        acc = w0 * s[k]
        for i in range(up.size):
            a = 2.0 * (s[k] - up[i]) / width[i] - 1.0
            a = min(1.0, max(-1.0, a))
            b = 2.0 * (s[k] - down[i]) / width[i] + 1.0
            b = min(1.0, max(-1.0, b))
            st[i] = min(max(st[i], a), b)
            acc += w[i] * st[i]
        y[k] = acc
    return y


@njit
def k_walls(s, barrier, w, w0):
    """Domain walls, each in its own rough landscape; a wall stops at the first place that holds the field."""
    y = np.empty(s.size)
    n = barrier.shape[1]
    at = np.zeros(barrier.shape[0], np.int64)
    for k in range(s.size):
        acc = 0.0
        for j in range(at.size):
            i = at[j]
            while i < n - 1 and barrier[j, i] < s[k]:
                i += 1
            while i > 0 and barrier[j, i - 1] > s[k]:
                i -= 1
            at[j] = i
            acc += w[j] * i
        y[k] = acc / n + w0 * s[k]
    return y


@njit
def k_smooth(s, kind, p, f):
    """Differential laws in small steps of the drive. kind 0 Bouc-Wen, 1 Coleman-Hodgdon, 2 Dahl, 3 Duhem, 4 Jiles-Atherton."""
    y = np.empty(s.size)
    h = 0.0
    if kind == 1 or kind == 3:
        h = p[1] * s[0]
    prev = s[0]
    for k in range(s.size):
        total = s[k] - prev
        n = int(abs(total) / 0.002) + 1
        ds = total / n
        sg = 1.0 if ds >= 0 else -1.0
        for j in range(n):
            h0 = h
            a = 0.0
            for half in range(2):
                hh = h0 if half == 0 else h0 + 0.5 * a
                pos = prev + (0.5 * half) * ds
                if kind == 0:
                    m = abs(hh) ** p[4]
                    a = ds * (p[1] - m * (p[3] + p[2] * (1.0 if sg * hh > 0 else -1.0)))
                elif kind == 1:
                    a = abs(ds) * p[0] * (p[1] * pos - hh) + ds * p[2]
                elif kind == 2:
                    q = 1.0 - sg * hh / (p[2] * f[k])
                    a = ds * p[1] * (abs(q) ** p[3]) * (1.0 if q >= 0 else -1.0)
                elif kind == 3:
                    a = ds * p[2] * (1.0 + p[3] * np.tanh(p[0] * sg * (p[1] * pos - hh)))
                else:
                    # p: Ms, shape a, coupling, pinning, reversible share
                    he = pos + p[2] * hh
                    th = np.tanh(he / p[1])
                    man = p[0] * th
                    gap = man - hh
                    irr = 0.0
                    if gap * sg > 0:
                        irr = gap / (sg * p[3] * (1.0 - p[4]) - p[2] * gap)
                    slope = ((1.0 - p[4]) * max(irr, 0.0) + p[4] * p[0] * (1.0 - th * th) / p[1])
                    slope = slope / (1.0 - p[4] * p[2] * p[0] * (1.0 - th * th) / p[1])
                    a = ds * slope
            h = h0 + a
            prev += ds
        prev = s[k]
        if kind == 0 or kind == 2:
            y[k] = p[0] * s[k] - h
        elif kind == 4:
            y[k] = p[5] * s[k] + h
        else:
            y[k] = h
    return y


@njit
def everett(a, b, mode, table, lim):
    """Output change of a branch from b up to a (or from a down to b)."""
    if mode == 0:
        q = (a - b) / (2.0 * lim) * (table.shape[1] - 1)
        i = min(int(q), table.shape[1] - 2)
        return table[0, i] + (q - i) * (table[0, i + 1] - table[0, i])
    n = table.shape[0] - 1
    qa = (a + lim) / (2.0 * lim) * n
    qb = (b + lim) / (2.0 * lim) * n
    i = max(0, min(int(qa), n - 1))
    j = max(0, min(int(qb), n - 1))
    x = qa - i
    z = qb - j
    return ((1 - x) * (1 - z) * table[i, j] + x * (1 - z) * table[i + 1, j] + (1 - x) * z * table[i, j + 1] + x * z * table[i + 1, j + 1])


@njit
def k_memory(s, mode, table, lim, p):
    """Laws with return-point memory: 0 Masing of a backbone, 1 Preisach by its Everett surface, 2 Takacs branches between turning points."""
    y = np.empty(s.size)
    pu = np.empty(4000)
    px = np.empty(4000)
    pu[0] = -lim
    px[0] = -1.0
    pu[1] = lim
    px[1] = 1.0
    n = 1
    up = True
    prev = -lim
    x = -1.0
    for k in range(s.size):
        v = s[k]
        if v != prev:
            if (v > prev) != up:
                pu[n] = prev
                px[n] = x
                n += 1
                up = not up
            while n >= 3 and ((up and v >= pu[n - 2]) or (not up and v <= pu[n - 2])):
                n -= 2
            b = pu[n - 1]
            if mode < 2:
                x = px[n - 1] + (everett(v, b, mode, table, lim) if up else -everett(b, v, mode, table, lim))
            else:
                goal = pu[n - 2] if n >= 2 else lim
                gx = px[n - 2] if n >= 2 else 1.0
                sh = p[1] if up else -p[1]
                g0 = np.tanh(p[0] * (b - sh)) + p[2] * b
                g1 = np.tanh(p[0] * (goal - sh)) + p[2] * goal
                g = np.tanh(p[0] * (v - sh)) + p[2] * v
                x = px[n - 1] + (gx - px[n - 1]) * (g - g0) / (g1 - g0)
            prev = v
        y[k] = x
    return y


# ------------------------------------------------------------------------------------------------------------------ dynamic kernels


@njit
def k_lowpass(t, x, tau):
    y = np.empty(x.size)
    z = x[0]
    y[0] = z
    for k in range(1, x.size):
        z += (1.0 - np.exp(-(t[k] - t[k - 1]) / tau)) * (0.5 * (x[k] + x[k - 1]) - z)
        y[k] = z
    return y


@njit
def k_mode(t, x, w, zeta):
    """Oscillator, exact for a drive that is constant within each fine step."""
    y = np.empty(x.size)
    z = x[0]
    v = 0.0
    y[0] = z
    wd = w * np.sqrt(1.0 - zeta * zeta)
    for k in range(1, x.size):
        dt = t[k] - t[k - 1]
        q = 0.5 * (x[k] + x[k - 1])
        e = np.exp(-zeta * w * dt)
        c = np.cos(wd * dt)
        sn = np.sin(wd * dt)
        a = z - q
        b = (v + zeta * w * a) / wd
        z = q + e * (a * c + b * sn)
        v = e * (-zeta * w * (a * c + b * sn) + wd * (b * c - a * sn))
        y[k] = z
    return y


@njit
def k_duffing(t, x, w, zeta, k3):
    y = np.empty(x.size)
    z = x[0]
    v = 0.0
    y[0] = z
    for k in range(1, x.size):
        dt = t[k] - t[k - 1]
        if w * dt > 3.0:
            z = x[k]
            for _ in range(20):
                z -= (z + k3 * z ** 3 - x[k]) / (1.0 + 3.0 * k3 * z * z)
            v = 0.0
        else:
            n = int(w * dt / 0.03) + 1
            d = dt / n
            for j in range(n):
                q = x[k - 1] + (x[k] - x[k - 1]) * (j + 0.5) / n
                v += 0.5 * d * (w * w * (q - z - k3 * z ** 3) - 2 * zeta * w * v)
                z += d * v
                v += 0.5 * d * (w * w * (q - z - k3 * z ** 3) - 2 * zeta * w * v)
        y[k] = z
    return y


# ------------------------------------------------------------------------------------------------------------------------------ laws

LIM = 1.05
NOTHING = np.zeros((1, 2))


class Law:
    """A hysteresis law on the drive scaled to -1..1, normalised so that its full loop spans 1."""

    def __init__(self, name, seed=0):
        self.name = name
        rng = np.random.default_rng(zlib.crc32(name.encode()) + seed)
        self.raw = getattr(self, "_" + name.split("/")[0].replace("-", "_"))(rng, *name.split("/")[1:])
        down, up = np.linspace(1, -1, 400), np.linspace(-1, 1, 400)
        ref = np.concatenate([np.linspace(0, 1, 200), down, up, down, up])
        h = self.raw(ref, np.ones(ref.size))
        self.scale = h[-1] - h[-400]
        self.mid = 0.5 * (h[-1] + h[-400])

    def __call__(self, s, f=None):
        """Output; f scales the width of the loops, inside the law where it has thresholds."""
        one = np.ones(s.size)
        inside = self.name.startswith(("prandtl", "maxwell", "relays", "switching", "dahl"))
        h = (self.raw(s, f if f is not None and inside else one) - self.mid) / self.scale
        return h if f is None or inside else 0.5 * s + f * (h - 0.5 * s)

    def _prandtl(self, rng, density):
        n = 60
        r = (np.arange(n) + 0.5) / n
        w = {"uniform": np.ones(n), "exponential": np.exp(-r / 0.25), "bump": np.exp(-0.5 * ((r - 0.3) / 0.12) ** 2),
             "power": (r + 0.02) ** -0.7}.get(density)
        share = 0.45
        if density == "few":
            r, w, share = np.sort(rng.uniform(0.03, 0.8, 7)), rng.uniform(0.4, 1, 7), 0.4
        w = share * w / np.sum(w * (1 - r))
        return lambda s, f: k_plays(s, r, w, 1 - share, f)

    def _generalised_prandtl(self, rng, curve):
        n = 50
        r = (np.arange(n) + 0.5) / n * 0.8
        w = np.exp(-r / 0.3)
        w = 0.7 * w / w.sum()
        bend = {"tanh": lambda s: np.tanh(1.1 * s) / np.tanh(1.1), "sinh": lambda s: np.sinh(1.2 * s) / np.sinh(1.2)}[curve]
        return lambda s, f: k_plays(bend(s), r, w, 0.0, f) + 0.3 * s

    def _maxwell(self, rng):
        n = 14
        lim, c = rng.uniform(0.02, 0.9, n), rng.uniform(0.2, 1, n)
        c *= 0.55 / c.sum()
        return lambda s, f: k_maxwell(s, c, c * lim, 1.15, f)

    def _relays(self, rng):
        n = 2500
        mid, half = rng.normal(0, 0.7, n), np.abs(rng.normal(0.05, 0.2, n)) + 0.005
        w = rng.uniform(0.5, 1.5, n) / n
        return lambda s, f: k_relays(s, mid, half, w, 0.5, f)

    def _switching(self, rng):
        n = 2500
        half, mid = 0.16 * np.exp(0.6 * rng.normal(size=n)), rng.laplace(0, 0.5, n)
        w = np.exp(0.4 * rng.normal(size=n)) / n
        return lambda s, f: k_relays(s, mid, half, w, 0.7, f)

    def _kp(self, rng):
        n = 500
        mid, half, width = rng.uniform(-0.9, 0.9, n), rng.gamma(2, 0.08, n), rng.uniform(0.1, 0.5, n)
        w = rng.uniform(0.3, 1, n)
        w /= w.sum()
        return lambda s, f: k_kp(s, mid + half - width / 2, mid - half + width / 2, width, w, 0.6)

    def _walls(self, rng):
        n, m = 350, 240
        z = np.linspace(-1.25, 1.25, m)
        rough = np.zeros((n, m))
        for k in range(1, m):
            rough[:, k] = 0.93 * rough[:, k - 1] + 0.055 * rng.normal(size=n)
        w = rng.uniform(0.5, 1.5, n)
        w /= w.sum()
        barrier = z[None, :] + rough
        return lambda s, f: k_walls(s, barrier, w, 0.35)

    def _bouc_wen(self, rng, n):
        n = float(n)
        sat = rng.uniform(0.2, 0.28)
        a = rng.uniform(0.55, 0.75)
        ratio = rng.uniform(0.55, 0.75)
        q = a / sat ** n
        p = np.array([1.0 + a * 0.4, a, ratio * q, (1 - ratio) * q, n])
        return lambda s, f: k_smooth(s, 0, p, f)

    def _coleman_hodgdon(self, rng):
        p = np.array([rng.uniform(2.2, 3.2), 1.0, rng.uniform(0.5, 0.62)])
        return lambda s, f: k_smooth(s, 1, p, f)

    def _dahl(self, rng, power):
        p = np.array([1.35, rng.uniform(0.8, 0.95), rng.uniform(0.14, 0.2), float(power)])
        return lambda s, f: k_smooth(s, 2, p, f)

    def _duhem(self, rng):
        p = np.array([rng.uniform(4, 6), 1.0, 0.7, rng.uniform(0.75, 0.9)])
        return lambda s, f: k_smooth(s, 3, p, f)

    def _jiles_atherton(self, rng):
        p = np.array([1.0, 0.95, 0.05, 0.24, 0.25, 0.5])
        return lambda s, f: k_smooth(s, 4, p, f)

    def _backbone(self, rng, curve):
        x = np.linspace(0, LIM, 800)
        if curve == "rayleigh":
            y = x + 0.5 * x ** 2
        elif curve == "ramberg-osgood":
            force = np.linspace(0, 6, 6000)
            y = 0.6 * x + 0.6 * np.interp(x, 1.2 * force ** 0.8, force)
        else:
            y = 0.7 * x + 0.5 * (x - 0.35 * (1 - np.exp(-x / 0.35)))
        table = np.vstack([2 * y, 2 * y])
        return lambda s, f: k_memory(s, 0, table, LIM, np.zeros(3))

    def _preisach(self, rng, shape):
        n = 240
        g = np.linspace(-LIM, LIM, n + 1)
        c = 0.5 * (g[1:] + g[:-1])
        up, down = np.meshgrid(c, c, indexing="ij")
        half, mid = 0.5 * (up - down), 0.5 * (up + down)
        if shape == "gauss":
            mu = np.exp(-0.5 * ((half - 0.12) / 0.15) ** 2 - 0.5 * (mid / 0.5) ** 2)
        elif shape == "lopsided":
            mu = np.exp(-0.5 * ((half - 0.1) / 0.18) ** 2 - 0.5 * ((mid - 0.12) / 0.5) ** 2)
            mu += 0.25 * np.exp(-0.5 * ((half - 0.3) / 0.08) ** 2 - 0.5 * ((mid + 0.3) / 0.2) ** 2)
        else:
            mu = np.exp(-half / 0.22) * (1 + 0.4 * np.cos(5 * mid))
        mu = np.where(up > down, mu, np.where(up == down, 0.5 * mu, 0))
        # E[i, j]: all units with down >= g[j] and up <= g[i]
        acc = np.zeros((n + 1, n + 1))
        acc[1:, :-1] = np.cumsum(np.cumsum(mu, 0)[:, ::-1], 1)[:, ::-1]
        table = acc / acc[n, 0] + 0.5 * (g[:, None] - g[None, :]) / LIM
        return lambda s, f: k_memory(s, 1, table, LIM, np.zeros(3))

    def _takacs(self, rng):
        p = np.array([1.3, 0.22, 0.8])
        return lambda s, f: k_memory(s, 2, NOTHING, LIM, p)


# ---------------------------------------------------------------------------------------------------------------------------- drives


def sine(f, lo, hi, start=-90.0):
    return lambda t: 0.5 * (lo + hi) + 0.5 * (hi - lo) * np.sin(2 * np.pi * f * t + np.radians(start))


def unit_triangle(phase, skew=0.5):
    """0 at phase 0, 1 at phase skew, 0 at phase 1."""
    p = np.mod(phase, 1.0)
    return np.where(p < skew, p / skew, (1 - p) / (1 - skew))


def triangle(f, lo, hi, start=0.0, skew=0.5):
    return lambda t: lo + (hi - lo) * unit_triangle(f * t + start, skew)


def cycles(plan, kind="triangle"):
    """Whole cycles one after the other: (frequency, lo, hi, how many); each begins and ends at its lo (blended where the los differ)."""
    durations = [n / f for f, _, _, n in plan]
    edges = np.concatenate([[0], np.cumsum(durations)])

    def drive(t):
        t = np.clip(t, 0, edges[-1] * (1 - 1e-12))
        k = np.clip(np.searchsorted(edges, t, side="right") - 1, 0, len(plan) - 1)
        f, lo, hi, n = (np.array([p[i] for p in plan], float)[k] for i in range(4))
        after = np.array([p[1] for p in plan[1:]] + [plan[-1][1]], float)[k]
        q = f * (t - edges[k])
        shape = unit_triangle(q) if kind == "triangle" else 0.5 - 0.5 * np.cos(2 * np.pi * q)
        last = (q > n - 0.5)
        foot = np.where(last, after, lo)
        return foot + (hi - foot) * shape

    drive.length = edges[-1]
    return drive


def sweep(f0, f1, length, lo, hi, log=True, fade=1.0):
    """Chirp from the low end; the amplitude shrinks to `fade` at the end."""
    def drive(t):
        t = np.clip(t, 0, None)
        if log:
            c = np.log(f1 / f0) / length
            phase = f0 * np.expm1(c * t) / c
        else:
            phase = f0 * t + 0.5 * (f1 - f0) * t ** 2 / length
        a = 0.5 * (hi - lo) * (1 + (fade - 1) * np.clip(t / length, 0, 1))
        return 0.5 * (lo + hi) - a * np.cos(2 * np.pi * phase)
    return drive


def walk(seed, length, fc, lo, hi, first=None, pause=0.0):
    """Smooth random targets, about fc turns a second; a share `pause` of them is held."""
    rng = np.random.default_rng(seed)
    times, values = [0.0], [lo + (hi - lo) * rng.uniform() if first is None else first]
    while times[-1] < length + 1 / fc:
        times.append(times[-1] + rng.uniform(0.25, 0.9) / fc)
        values.append(values[-1] if rng.uniform() < pause else rng.uniform(lo, hi))
    curve = PchipInterpolator(times, values)
    return lambda t: curve(np.clip(t, 0, times[-1]))


def tones(seed, freqs, length, lo, hi, tilt=0.0):
    rng = np.random.default_rng(seed)
    freqs = np.asarray(freqs, float)
    ph, a = rng.uniform(0, 2 * np.pi, freqs.size), freqs ** -tilt
    raw = lambda t: sum(ai * np.sin(2 * np.pi * fi * t + p) for ai, fi, p in zip(a, freqs, ph))
    probe = raw(np.linspace(-0.1 * length, length, 40000))
    b, c = probe.min(), probe.max()
    return lambda t: lo + (hi - lo) * np.clip((raw(t) - b) / (c - b), 0, 1)


def points(*pairs):
    """Straight lines through (time, voltage)."""
    t0, v0 = np.array(pairs, float).T
    return lambda t: np.interp(t, t0, v0)


def stairs(levels, hold, rise):
    """Levels, each reached by a ramp of `rise` seconds and held to `hold`."""
    pairs = [(0.0, levels[0])]
    for k, (a, b) in enumerate(zip(levels[:-1], levels[1:])):
        pairs += [((k + 1) * hold, a), ((k + 1) * hold + rise, b)]
    return points(*pairs)


def levels(seed, n, lo, hi, first):
    """Random levels that really differ from each other."""
    rng = np.random.default_rng(seed)
    out = [first]
    while len(out) < n:
        v = rng.uniform(lo, hi)
        if abs(v - out[-1]) > 0.2 * (hi - lo):
            out.append(v)
    return out


def decay(f, lo, hi, length, last=0.08, centre=None):
    c = 0.5 * (lo + hi) if centre is None else centre
    return lambda t: c + (0.5 * (lo + hi) - c) * np.exp(-3 * np.clip(t, 0, None) / length) + 0.5 * (hi - lo) * last ** (
        np.clip(t, 0, None) / length) * np.sin(2 * np.pi * f * t)


def forc(lo, hi, n, rate, first):
    """First-order reversal curves: down from the top to a reversal, back to the top."""
    pairs, t = [(0.0, first)], abs(hi - first) / rate
    pairs.append((t, hi))
    for v in np.linspace(hi, lo, n + 1)[1:]:
        for target in (v, hi):
            t += (hi - v) / rate
            pairs.append((t, target))
    drive = points(*pairs)
    drive.length = t
    return drive


# -------------------------------------------------------------------------------------------------------------------------- timeline


class Timeline:
    """Fine grid of a record with its unrecorded history and gaps."""

    def __init__(self, segments, start, volts, seed, gap=3.0):
        rng = np.random.default_rng(seed)
        lo, hi = volts
        home = min(max(0.0, lo), hi)
        t, u, row, seg = [], [], [], []
        _, _, drive, os0 = segments[0]
        first = float(drive(np.zeros(1))[0])

        def add(when, what):
            t.append(np.asarray(when, float)), u.append(np.asarray(what, float))
            row.append(np.zeros(len(when), bool)), seg.append(np.zeros(len(when), int))

        def path(begin, values, each):
            """Straight lines through values, `each` seconds a piece."""
            q = np.linspace(0, len(values) - 1, 150 * (len(values) - 1) + 1)
            add(begin + q * each, np.interp(q, np.arange(len(values)), values))

        # long ago: shrinking loops about 0 V (as far as the amplifier goes), then an exercise cycle and a long rest
        shrink = [home + (hi - home if k % 2 == 0 else lo - home) * 0.9 ** k for k in range(40)]
        path(-30000.0, [home, *shrink, home], 5.0)
        path(-20000.0, [home, hi, home if start != "mid" else lo, home], 5.0)
        add([-300.0], [home])
        if start == "rest":
            if abs(first - home) > 1e-9:
                path(-8.0, [home, first], 1.0)
                add([-3.0], [first])
        elif start == "unknown":
            turns = [home, *rng.uniform(lo, hi, 5), first]
            path(-40.0, turns, 5.0)
            add([-5.0], [first])
        elif start == "mid":
            fs, n, _, os_ = segments[0]
            span = min(n, 4000) / fs
            k = np.arange(-int(span * fs * os_), 0)
            begin = float(drive(np.array([k[0] / (fs * os_)]))[0])
            path(-span - 6.0, [home, begin], 4.0)
            add(k / (fs * os_), drive(k / (fs * os_)))
        at = 0.0
        for index, (fs, n, drive, os_) in enumerate(segments):
            if index:
                v = float(drive(np.zeros(1))[0])
                q = np.linspace(0, 1, 202)[1:-1]
                add(at + q * gap, u[-1][-1] + (v - u[-1][-1]) * np.clip(q / 0.6, 0, 1))
                at += gap
            k = np.arange((n - 1) * os_ + 1)
            t.append(at + k / (fs * os_)), u.append(np.asarray(drive(k / (fs * os_)), float))
            row.append(k % os_ == 0), seg.append(np.full(k.size, index))
            at = t[-1][-1]
        self.t, self.u, self.row, self.seg = (np.concatenate(a) for a in (t, u, row, seg))
        assert np.all(np.diff(self.t) > 0)
        self.parts = len(segments)


# ----------------------------------------------------------------------------------------------------------------------- the actuator


def respond(case, line, fx, seed):
    """Displacement of every fine sample, before noise, and what is recorded beside it. fx: list of (kind, parameters)."""
    rng = np.random.default_rng(seed + 77)
    lo, hi = case["volts"]
    stroke = case["stroke"]
    t, u = line.t, line.u
    kinds = {}
    for kind, *p in fx:
        kinds.setdefault(kind, []).append(p)
    on = lambda name: kinds.get(name, [])
    for (tau,) in on("delay"):
        u = np.interp(t - tau, t, u)
    for (tau,) in on("lag"):
        u = k_lowpass(t, u, tau)
    scaled = lambda v: (v - 0.5 * (lo + hi)) / (0.5 * (hi - lo))
    s = scaled(u)
    zero = 0.5 * float(scaled(min(max(0.0, lo), hi)))
    for a, b in on("clip"):
        s = np.clip(s, a, b)
    for (curve,) in on("bend-before"):
        s = curve(s)
    f = None
    if on("rate"):
        law, c, r0, p = on("rate")[0]
        rate = np.abs(np.gradient(u, t))
        f = 1 + c * (rate / r0) ** p if law == "power" else 1 + c * np.log10(1 + rate / r0)
    warm = None
    if case.get("temperature"):
        curve, thermal = case["temperature"]
        measured = curve(np.clip(t, 0, None))
        warm = measured - 23.0
        if thermal:
            # the body lags behind the probe; settled at the start
            warm = k_lowpass(t, warm, thermal)
    if on("temp-width"):
        w = 1 + on("temp-width")[0][0] * warm
        f = w if f is None else f * w
    x = stroke * (case["law"](s, f) - zero)
    for (c,) in on("temp-gain"):
        x = x * (1 + c * warm)
    if on("wander"):
        size, corner = on("wander")[0]
        knots = np.arange(0, t[-1] + 3 / corner, 1 / corner)
        x = x * (1 + size * PchipInterpolator(knots, rng.normal(size=knots.size))(np.clip(t, 0, None)))
    if on("gain-steps"):
        (size, n) = on("gain-steps")[0]
        when = np.sort(rng.uniform(0.08, 0.92, n)) * t[-1]
        x = x * (1 - size * (np.searchsorted(when, t) % 2))
    for taus, cs in on("creep"):
        x = x + sum(c * k_lowpass(t, x, tau) for tau, c in zip(taus, cs))
    for (c,) in on("temp-zero"):
        x = x + c * warm
    if case.get("load"):
        force = case["load"](np.clip(t, 0, None))
        for (curve,) in on("load"):
            x = x - curve(force)
    for low, high, slope in on("stop"):
        # in shares of the stroke; slope 0 is rigid
        low, high = low * stroke, high * stroke
        x = np.where(x > high, high + slope * (x - high), np.where(x < low, low + slope * (x - low), x))
    for low, high, sharp in on("soft-stop"):
        # a pad that grows stiff smoothly
        low, high, sharp = low * stroke, high * stroke, sharp * stroke
        x = np.where(x > high, high + sharp * np.log1p(np.clip(x - high, 0, None) / sharp), x)
        x = np.where(x < low, low - sharp * np.log1p(np.clip(low - x, 0, None) / sharp), x)
    for fn, zeta, share in on("mode"):
        x = (1 - share) * x + share * k_mode(t, x, 2 * np.pi * fn, zeta)
    for fn, zeta, share, k3 in on("duffing"):
        x = (1 - share) * x + share * k_duffing(t, x, 2 * np.pi * fn, zeta, k3 / stroke ** 2)
    for (tau,) in on("sensor-lag"):
        x = k_lowpass(t, x, tau)
    for (curve,) in on("bend-behind"):
        x = stroke * curve(x / stroke)
    now = np.clip(t, 0, None)
    for (curve,) in on("drift"):
        x = x + stroke * curve(now)
    for list_ in on("tone"):
        x = x + sum(a * stroke * np.sin(2 * np.pi * f0 * t + ph) for f0, a, ph in list_[0])
    if on("slip"):
        size, n = on("slip")[0]
        when = (np.arange(n) + rng.uniform(0.25, 0.75, n)) / n * t[-1]
        jumps = size * stroke * rng.choice([-1, 1, 1], n) * rng.uniform(0.7, 1.3, n)
        x = x + np.concatenate([[0], np.cumsum(jumps)])[np.searchsorted(when, t)]
    if on("telegraph"):
        size, dwell = on("telegraph")[0]
        flips = np.cumsum(rng.exponential(dwell, int(4 * t[-1] / dwell) + 20))
        x = x + size * stroke * (np.searchsorted(flips, now) % 2)
    if on("neighbour"):
        size, f0 = on("neighbour")[0]
        x = x + size * stroke * unit_triangle(f0 * now + rng.uniform(), 0.9)
    x = case["sign"] * x
    recorded = {"time_s": t[line.row], "voltage_v": line.u[line.row], "displacement_um": x[line.row]}
    if case.get("temperature"):
        recorded["temperature_degc"] = measured[line.row]
    if case.get("load"):
        recorded["load_n"] = force[line.row]
    if line.parts > 1:
        recorded["segment"] = line.seg[line.row] + 1
    return recorded, on("freeze")


def disturb(case, recorded, seed, freeze):
    """Sensor offset, noise, spikes, converters."""
    rng = np.random.default_rng(seed)
    n = recorded["time_s"].size
    stroke = case["stroke"]
    white, pink, bits, spikes = case["noise"]
    noise = white * stroke * rng.normal(size=n)
    spectrum = np.fft.rfft(rng.normal(size=n))
    spectrum[0] = 0
    spectrum[1:] /= np.sqrt(np.arange(1, spectrum.size))
    flicker = np.fft.irfft(spectrum, n)
    noise += pink * stroke * flicker / flicker.std()
    hit = rng.integers(5, n - 5, spikes)
    noise[hit] += rng.choice([-1, 1], spikes) * rng.uniform(0.03, 0.12, spikes) * stroke
    y = recorded["displacement_um"] + case["offset"] * stroke + noise
    for every, long in freeze:
        pick = np.random.default_rng(seed + 5)
        at = int(every * pick.uniform(0.3, 1))
        while at + long < n:
            y[at:at + int(long * pick.uniform(0.6, 1.3))] = y[at]
            at += int(every * pick.uniform(0.6, 1.4))
    step = 1.7 * stroke / 2 ** bits
    recorded["displacement_um"] = np.round(y / step) * step
    if case["adc"]:
        lo, hi = case["volts"]
        step = 1.2 * (hi - lo) / 2 ** case["adc"]
        recorded["voltage_v"] = np.round((recorded["voltage_v"] + 0.3 * step * rng.normal(size=n)) / step) * step
    if "temperature_degc" in recorded:
        recorded["temperature_degc"] = np.round(recorded["temperature_degc"] + 0.01 * rng.normal(size=n), 2)
    if "load_n" in recorded:
        size = np.ptp(recorded["load_n"])
        recorded["load_n"] = recorded["load_n"] + 0.001 * size * rng.normal(size=n)
    return recorded, noise


FORMAT = {"time_s": "%.7f", "voltage_v": "%.5f", "displacement_um": "%.6f", "temperature_degc": "%.2f", "load_n": "%.4f", "segment": "%d"}


def write(path, recorded):
    names = list(recorded)
    rows = zip(*(recorded[name].tolist() for name in names))
    line = ",".join(FORMAT[name] for name in names)
    with open(path, "w") as file:
        file.write(",".join(names) + "\n")
        file.write("\n".join([line % row for row in rows]) + "\n")


# ----------------------------------------------------------------------------------------------------------------------------- cases

CASES = []
WHITE = (0.0010, 0.0, 16, 0)


def case(name, law, model, volts, stroke, train, test, fx=(), expect=(), accept=(), noise=WHITE, start=("rest", "rest"), sign=1, offset=0.0,
         adc=0, temperature=None, load=None, gap=3.0):
    """Noise: white, 1/f (shares of the stroke), bits, spikes; drawn with the offset where not given. temperature: (train curve, test curve, thermal lag); load: (train curve, test curve); segments: (fs, rows, drive, oversampling)."""
    rng = np.random.default_rng(1000 + len(CASES))
    if noise is WHITE:
        noise = (rng.uniform(0.0006, 0.0013), rng.choice([0, 0, 0.0003, 0.0006]), int(rng.integers(12, 17)), int(rng.choice([0, 0, 0, 4])))
        offset = rng.choice([0, 0.15, -0.3, 0.6])
    CASES.append(dict(id=f"z{len(CASES) + 1:02d}-{name}", law=law, model=model, volts=volts, stroke=stroke, segments=(train, test), fx=list(fx),
                      expect=list(expect), accept=[list(a) for a in accept], noise=noise, start=start, sign=sign, offset=offset, adc=adc,
                      heat=temperature, weight=load, gap=gap))


def swing(mean, size, period, phase=0.0, ripple=0.0):
    """Temperature of a room with a heater that cycles."""
    return lambda t: mean + size * np.sin(2 * np.pi * t / period + phase) + ripple * np.sin(2 * np.pi * t / (0.37 * period) + 1)


def weights(values, each, soft=0.3):
    """Weights put on and taken off."""
    pairs = [(0.0, values[0])]
    for k in range(1, len(values)):
        pairs += [(k * each, values[k - 1]), (k * each + soft, values[k])]
    return points(*pairs)


def logcreep(per_decade, first, last):
    taus = np.logspace(np.log10(first), np.log10(last), 3 * int(np.ceil(np.log10(last / first))) + 1)
    return taus, np.full(taus.size, per_decade * np.log10(taus[1] / taus[0]))


def powercreep(size, exponent, first, last):
    """size: what has been crept after `last`, of the step."""
    taus, _ = logcreep(1, first, last)
    c = taus ** exponent
    return taus, size * c / c.sum()


def build():
    A, B, C, D, E, F, G = (0, 150), (-20, 120), (-200, 200), (0, 10), (0, 100), (-30, 150), (-10, 10)

    # ---- no effect
    case("none-sine", Law("prandtl/uniform"), "pi", A, 20, [(500, 3000, sine(1, 0, 140), 4)], [(500, 2500, sine(0.7, 10, 110), 4)])
    case("none-afm", Law("prandtl/exponential"), "pi", B, 8,
         [(5000, 9000, cycles([(8, -15, 115, 6), (8, 0, 90, 5), (8, 20, 70, 3), (8, -15, 115, 3)]), 4)],
         [(5000, 5000, cycles([(10, -5, 100, 5), (10, 10, 80, 5)]), 4)], start=("unknown", "unknown"), adc=16, noise=(0.0006, 0.0005, 16, 0))
    case("none-decay", Law("backbone/rayleigh"), "pi", C, 60, [(200, 6000, decay(1, -195, 195, 30), 6)],
         [(200, 4000, walk(5, 20, 1.2, -180, 180, 0), 6)], noise=(0.0008, 0, 14, 0))
    case("none-walk", Law("backbone/ramberg-osgood"), "pi", A, 15, [(1000, 12000, walk(3, 12, 4, 0, 150, 0), 4)],
         [(1000, 6000, sine(3, 5, 130), 4)], noise=(0.0008, 0.0004, 16, 5), start=("rest", "unknown"))
    case("none-forc", Law("preisach/lopsided"), "preisach", A, 30, [(100, 12050, forc(0, 148, 14, 20, 0), 6)],
         [(100, 5000, walk(8, 50, 0.5, 0, 145, 0), 6)], offset=0.4)
    case("none-relays", Law("relays"), "preisach", C, 100, [(400, 6000, decay(1.1, -195, 195, 15), 2)],
         [(400, 4000, walk(9, 10, 2, -170, 170, 0), 2)], noise=(0.001, 0, 12, 0), start=("unknown", "unknown"))
    case("none-tones", Law("kp"), "preisach", E, 12, [(2000, 8000, tones(4, [1.3, 2.9, 4.7, 7.9], 4, 2, 98), 3)],
         [(2000, 5000, walk(12, 2.5, 9, 5, 95), 3)], start=("mid", "unknown"), noise=(0.0012, 0, 16, 0))
    case("none-rates", Law("maxwell"), "pi", A, 16,
         [(2000, 8000, triangle(0.5, 0, 140), 3), (2000, 6000, triangle(3, 0, 100), 3), (2000, 4000, triangle(25, 0, 140), 3)],
         [(2000, 6000, cycles([(1, 5, 120, 1), (6, 5, 130, 4), (15, 20, 100, 15)]), 3)], start=("rest", "unknown"))
    case("none-amplitudes", Law("bouc-wen/1"), "bouc-wen", G, 5,
         [(1000, 9000, cycles([(1, 0, 9.5, 2), (1, -9.5, 9.5, 3), (1, -5, 7, 2), (1, -3, 3, 2)], "sine"), 4)],
         [(1000, 5000, walk(14, 5, 2, -9, 9, 0), 4)], sign=-1)
    case("none-chirp", Law("bouc-wen/2"), "bouc-wen", C, 40, [(2000, 12000, sweep(0.5, 30, 6, -180, 180), 4)],
         [(2000, 6000, tones(21, [1.1, 3.7, 8.3, 17], 3, -170, 170, 0.4), 4)], start=("unknown", "unknown"), noise=(0.0012, 0, 13, 0))
    case("none-growing", Law("coleman-hodgdon"), "bouc-wen", A, 25,
         [(300, 6000, cycles([(0.5, 0, v, 1) for v in (30, 50, 70, 90, 110, 130, 145, 145, 80, 40)]), 4)],
         [(300, 4200, walk(31, 14, 1, 0, 140, 0), 4)], sign=-1, noise=(0.001, 0.0003, 16, 4))
    case("none-ja", Law("jiles-atherton"), "preisach", C, 50,
         [(250, 8000, cycles([(0.5, -190, 190, 5), (0.5, -140, 140, 4), (0.5, -90, 90, 4), (0.5, -190, 190, 3)], "sine"), 4)],
         [(250, 4000, cycles([(0.4, -170, 170, 3), (0.6, -110, 110, 5)]), 4)], start=("unknown", "unknown"))
    case("none-dahl", Law("dahl/1"), "bouc-wen", F, 10, [(1000, 10000, walk(41, 10, 3, -28, 145, 0), 4)],
         [(1000, 5000, triangle(2, -20, 130), 4)], start=("rest", "unknown"), noise=(0.0008, 0.0013, 15, 0))
    case("none-duhem", Law("duhem"), "bouc-wen", D, 2, [(500, 6000, cycles([(1, 0, 9.8, 4), (1, 1, 8, 4), (1, 2, 6, 4)], "sine"), 4)],
         [(500, 3500, tones(44, [0.9, 2.3], 7, 0.5, 9.5), 4)], noise=(0.0014, 0, 16, 0), start=("rest", "unknown"))
    case("none-stairs", Law("generalised-prandtl/sinh"), "preisach", E, 22,
         [(100, 9000, stairs([0, 20, 40, 60, 80, 100, 75, 50, 25, 0, 60, 30, 90, 10, 50, 0, 100, 0], 5, 0.5), 6)],
         [(100, 5000, stairs(levels(51, 17, 0, 100, 0), 3, 0.6), 6)])
    case("none-warm", Law("takacs"), "preisach", C, 35, [(100, 12000, walk(61, 120, 0.6, -195, 195, 0), 6)],
         [(100, 6000, sine(0.5, -180, 180), 6)], temperature=(swing(24, 3, 70), swing(24, 2.5, 45, 1), 0), start=("rest", "unknown"))
    case("none-walls", Law("walls"), "preisach", A, 18, [(200, 9000, forc(0, 150, 11, 40, 0), 3)],
         [(200, 5000, decay(0.8, 0, 145, 25), 3)], noise=(0.0012, 0, 12, 0), start=("rest", "unknown"))
    case("none-fast-load", Law("prandtl/few"), "pi", B, 14,
         [(20000, 30000, triangle(20, -10, 110), 1), (20000, 30000, cycles([(40, 0, 80, 20), (30, -10, 115, 30)]), 1)],
         [(20000, 20000, tones(71, [7, 19, 33], 1, -10, 110), 1)],
         load=(lambda t: 20 + 9 * np.sin(2 * np.pi * 1.3 * t + 0.4), lambda t: 20 + 8 * np.sin(2 * np.pi * 2.1 * t)), start=("mid", "unknown"))
    case("none-short", Law("prandtl/power"), "pi", D, 3, [(50, 420, cycles([(0.5, 0, 9, 2), (0.625, 0, 6, 3)], "sine"), 12)],
         [(50, 400, sine(0.4, 0.5, 8), 12)], noise=(0.0015, 0, 14, 0))

    # ---- delay
    case("delay", Law("prandtl/exponential", 1), "pi", A, 20, [(2000, 14000, sweep(1, 60, 7, 0, 140), 4)],
         [(2000, 6000, tones(101, [4, 11, 23, 37], 3, 5, 135, 0.5), 4)], [("delay", 0.003)], ["delay"], start=("rest", "unknown"))
    case("delay", Law("coleman-hodgdon", 2), "bouc-wen", B, 30,
         [(20000, 20000, cycles([(10, -10, 110, 3), (25, -10, 110, 6), (25, 10, 80, 5), (50, -10, 60, 13)]), 2)],
         [(20000, 12000, cycles([(40, -5, 90, 8), (20, 0, 100, 8)], "sine"), 2)], [("delay", 0.0019)], ["delay"], start=("unknown", "unknown"))
    case("delay", Law("preisach/gauss"), "preisach", C, 55, [(500, 12000, walk(111, 24, 5, -195, 195, 0), 5)],
         [(500, 5000, sweep(0.5, 6, 10, -180, 180), 5)], [("delay", 0.0217)], ["delay"], start=("rest", "rest"), noise=(0.0012, 0, 14, 0))

    # ---- lag
    case("lag", Law("bouc-wen/1.5"), "bouc-wen", A, 12, [(2000, 16000, sweep(0.5, 60, 8, 0, 145), 4)],
         [(2000, 7000, tones(121, [3, 9, 21, 41], 3.5, 5, 140, 0.4), 4)], [("lag", 0.005)], ["lag"], start=("rest", "unknown"))
    case("lag", Law("backbone/iwan"), "pi", E, 40, [(1000, 12000, stairs(levels(131, 30, 0, 100, 0), 0.4, 0.004), 4)],
         [(1000, 5000, triangle(3, 5, 90), 4)], [("lag", 0.03)], ["lag"], start=("rest", "unknown"), noise=(0.0009, 0.0004, 16, 0))
    case("lag", Law("kp", 3), "preisach", F, 9,
         [(8000, 24000, cycles([(2, -25, 140, 2), (10, -25, 140, 8), (40, -25, 140, 24), (80, 0, 100, 48)]), 2)],
         [(8000, 12000, tones(141, [5, 17, 43, 71], 1.5, -20, 130, 0.4), 2)], [("sensor-lag", 0.0013)], ["lag"], sign=-1,
         start=("unknown", "unknown"))

    # ---- rate-dependence
    case("rate", Law("prandtl/bump"), "pi", A, 20,
         [(1000, 10000, triangle(0.2, 0, 140), 3), (1000, 5000, triangle(1, 0, 140), 3), (1000, 3000, triangle(6, 0, 140), 3),
          (1000, 2000, triangle(20, 0, 110), 6)],
         [(1000, 8000, cycles([(0.4, 5, 120, 2), (3, 5, 130, 6), (12, 10, 100, 12)], "sine"), 6)],
         [("rate", "log", 0.28, 20.0, 0)], ["rate-dependence"], start=("rest", "unknown"))
    case("rate", Law("switching"), "preisach", C, 70,
         [(400, 14000, cycles([(0.1, -190, 190, 2), (0.5, -190, 190, 3), (2.5, -190, 190, 8), (8, -190, 190, 20)], "sine"), 2)],
         [(400, 6000, cycles([(0.25, -160, 160, 2), (1.5, -170, 170, 6), (5, -150, 150, 10)]), 2)],
         [("rate", "power", 0.75, 3000.0, 0.28)], ["rate-dependence"], start=("unknown", "unknown"))
    case("rate", Law("dahl/1", 4), "bouc-wen", B, 18, [(1000, 24000, sweep(0.1, 20, 24, -18, 118), 4)],
         [(1000, 8000, cycles([(0.3, -10, 100, 1), (2, -10, 110, 5), (9, 0, 90, 18)]), 4)],
         [("rate", "power", 1.1, 4000.0, 0.3)], ["rate-dependence"], start=("unknown", "unknown"), noise=(0.0008, 0, 16, 4))
    case("rate", Law("backbone/rayleigh", 2), "pi", E, 50,
         [(50, 2000, sine(0.05, 0, 95), 10), (100, 1200, sine(0.25, 0, 95), 20), (500, 1600, sine(1.25, 0, 95), 20), (2500, 2000, sine(6, 0, 95), 20)],
         [(500, 5000, cycles([(0.2, 0, 80, 1), (1, 0, 90, 2), (4, 0, 85, 12)], "sine"), 10)],
         [("rate", "log", 0.6, 15.0, 0)], ["rate-dependence"], start=("unknown", "unknown"))

    # ---- creep
    case("creep", Law("prandtl/uniform", 1), "pi", A, 25, [(50, 9000, stairs([0, 145, 30, 100, 60, 0, 120, 20, 80, 0], 18, 0.4), 8)],
         [(50, 5000, stairs([0, 130, 60, 115, 30, 100], 16, 0.5), 8)], [("creep", *logcreep(0.05, 0.1, 200))], ["creep"])
    case("creep", Law("preisach/exponential"), "preisach", C, 90,
         [(100, 16000, points((0, 0), (4, 190), (24, 190), (30, -190), (50, -190), (54, 50), (80, 50), (84, 150), (88, -100), (110, -100), (118, 190), (126, -190),
                              (134, 0), (160, 0)), 6)],
         [(100, 8000, points((0, 0), (4, 150), (24, 150), (30, -120), (55, -120), (60, 60), (80, 60)), 6)],
         [("creep", *powercreep(0.25, 0.2, 0.3, 100))], ["creep"], noise=(0.0009, 0.0003, 16, 0))
    case("creep", Law("bouc-wen/1", 3), "bouc-wen", A, 10, [(100, 15000, walk(151, 150, 0.25, 0, 145, 0, 0.45), 6)],
         [(100, 8000, stairs([0, 80, 20, 130, 50, 0], 14, 1.0), 6)], [("creep", np.array([1.2, 14.0]), np.array([0.07, 0.12]))], ["creep"], adc=16)
    case("creep", Law("dahl/1", 5), "pi", G, 6, [(200, 16000, stairs([0, 9, -9, 5, -5, 9, 0, -9, 3, -4, 0, 9, -9], 6, 0.3), 4)],
         [(200, 8000, stairs([0, -6, 8, -8, 4, 0, 7, -3], 5, 0.4), 4)], [("creep", *logcreep(0.06, 0.05, 60))], ["creep"], sign=-1)

    # ---- drift
    case("drift", Law("backbone/rayleigh", 1), "pi", A, 20, [(200, 16000, sine(1.5, 0, 140, 35), 4)], [(200, 6000, walk(161, 30, 2, 0, 130, 0), 4)],
         [("drift", lambda t: -0.0011 * t)], ["drift"], start=("mid", "rest"))
    case("drift", Law("bouc-wen/2", 3), "bouc-wen", C, 45,
         [(200, 14000, lambda t: np.interp(t, (0, 10, 12, 30, 32, 50, 52, 60, 62), (190, 190, 120, 120, 190, 190, 60, 60, 190)) * np.sin(2 * np.pi * 1.1 * t), 4)],
         [(200, 8000, lambda t: np.interp(t, (0, 15, 25, 40), (150, 150, 90, 90)) * np.sin(2 * np.pi * 1.5 * t), 4)],
         [("drift", lambda t: 0.12 * (1 - np.exp(-t / 16)))], ["drift"])
    case("drift", Law("takacs", 1), "preisach", C, 30,
         [(150, 5000, walk(171, 34, 1.5, -190, 190, 0), 4), (150, 5000, cycles([(1, -150, 150, 33)], "sine"), 4), (150, 5000, walk(172, 34, 1.5, -190, 190, 0), 4)],
         [(150, 6000, walk(173, 40, 1, -180, 180, 0), 4)], [("drift", lambda t: -0.0012 * t)], ["drift"], noise=(0.001, 0.0004, 16, 0))

    # ---- temperature
    warm = (swing(24, 4.5, 110, 0.5, 0.6), swing(24, 4, 70, 2))
    case("temperature", Law("prandtl/exponential", 3), "pi", A, 28, [(100, 22000, triangle(0.5, 0, 140, 0.3), 4)], [(100, 9000, walk(181, 90, 0.5, 0, 130, 0), 4)],
         [("temp-gain", 0.011)], ["temperature"], temperature=(*warm, 0), start=("mid", "rest"))
    case("temperature", Law("kp", 5), "preisach", E, 15, [(50, 14000, walk(191, 280, 0.35, 0, 100, 0), 4)], [(50, 7000, sine(0.2, 5, 90), 4)],
         [("temp-zero", 0.12)], ["temperature"], temperature=(swing(25, 4, 130, 1.0, 0.8), swing(25, 3.5, 90, 0.2), 8.0), start=("rest", "unknown"))
    case("temperature", Law("bouc-wen/1", 6), "bouc-wen", C, 80, [(100, 24000, cycles([(0.5, -190, 190, 60), (0.4, -130, 130, 24), (0.5, -190, 190, 30)], "sine"), 4)],
         [(100, 9000, cycles([(0.6, -170, 170, 54)]), 4)], [("temp-width", 0.06)], ["temperature"],
         temperature=(swing(24, 6, 95, 0.2), swing(24, 5, 60, 1.3), 0), start=("unknown", "unknown"))
    case("temperature", Law("coleman-hodgdon", 4), "bouc-wen", F, 20, [(80, 18000, walk(201, 225, 0.5, -28, 148, 0), 4)],
         [(80, 8000, cycles([(0.4, -20, 120, 40)], "sine"), 4)], [("temp-gain", 0.007), ("temp-zero", -0.08)], ["temperature"],
         temperature=(swing(26, 5, 140, 2.0, 0.5), swing(26, 4.5, 75, 0.6), 5.0), start=("rest", "unknown"), noise=(0.0008, 0.0004, 16, 5))

    # ---- load
    case("load", Law("prandtl/few", 2), "pi", A, 22, [(200, 14000, sine(0.8, 0, 140, 150), 4)], [(200, 6000, walk(211, 30, 1, 0, 130, 0), 4)],
         [("load", lambda q: 0.035 * q)], ["load"], load=(weights([0, 20, 50, 10, 0, 35, 50, 25, 5], 8), weights([10, 45, 0, 30, 20], 6)), start=("mid", "rest"))
    case("load", Law("maxwell", 2), "pi", B, 12, [(500, 12000, walk(221, 24, 2, -20, 118, 0), 4)], [(500, 6000, triangle(2, -10, 100), 4)],
         [("load", lambda q: 0.09 * np.clip(q, 0, None) ** (2 / 3))], ["load"],
         load=(lambda t: 30 + 28 * np.sin(2 * np.pi * 0.23 * t), lambda t: 30 + 25 * np.sin(2 * np.pi * 0.41 * t + 1)), start=("rest", "unknown"))
    case("load", Law("jiles-atherton", 1), "preisach", C, 60,
         [(200, 12000, cycles([(1, -190, 190, 25), (1, -120, 120, 15), (1, -190, 190, 20)], "sine"), 4)], [(200, 6000, cycles([(0.8, -160, 160, 24)]), 4)],
         [("load", lambda q: 0.05 * q)], ["load"], load=(walk(231, 60, 0.3, -40, 60), walk(232, 30, 0.4, -35, 55)), start=("unknown", "unknown"),
         noise=(0.001, 0, 13, 0))

    # ---- resonance
    case("resonance", Law("prandtl/uniform", 4), "pi", A, 15, [(8000, 32000, sweep(5, 600, 4, 30, 110, fade=0.4), 4)],
         [(8000, 12000, tones(241, [9, 31, 77, 160, 240, 330, 420], 1.5, 35, 105, 0.3), 4)], [("mode", 290.0, 0.05, 0.25)], ["resonance"], start=("unknown", "unknown"))
    case("resonance", Law("bouc-wen/1", 8), "bouc-wen", B, 60, [(20000, 24000, cycles([(20, -10, 110, 10), (31, 0, 90, 12), (17, -10, 110, 5)]), 3)],
         [(20000, 12000, cycles([(25, -5, 100, 15)]), 3)], [("mode", 413.0, 0.012, 1.0)], ["resonance"], start=("unknown", "unknown"), noise=(0.0007, 0, 16, 0))
    case("resonance", Law("duhem", 2), "bouc-wen", E, 8, [(5000, 20000, stairs(levels(251, 41, 0, 98, 0), 0.1, 0.003), 4)],
         [(5000, 10000, stairs(levels(252, 14, 5, 95, 5), 0.15, 0.003), 4)], [("mode", 135.0, 0.03, 0.4)], ["resonance"], start=("rest", "unknown"))
    case("resonance", Law("preisach/gauss", 1), "preisach", C, 100, [(4000, 24000, tones(261, np.arange(3, 180, 1.37), 6, -190, 190, 0.7), 4)],
         [(4000, 10000, sweep(4, 170, 2.5, -120, 120, fade=0.3), 4)], [("mode", 118.0, 0.02, 0.2)], ["resonance"], start=("mid", "unknown"))

    # ---- saturation
    case("saturation", Law("prandtl/exponential", 6), "pi", A, 30,
         [(200, 9000, cycles([(1, 0, 148, 12), (1, 0, 110, 6), (1, 20, 148, 9), (1, 0, 148, 18)], "sine"), 4)],
         [(200, 5000, walk(271, 25, 1, 0, 145, 0), 4)], [("stop", -9.0, 0.72, 0.0)], ["saturation"])
    case("saturation", Law("bouc-wen/1", 9), "bouc-wen", C, 50, [(500, 12000, cycles([(2, -195, 195, 20), (2, -120, 120, 8), (2, -195, 195, 20)]), 4)],
         [(500, 5000, walk(281, 10, 2, -190, 190, 0), 4)], [("clip", -0.72, 0.72)], ["saturation"], start=("unknown", "unknown"))
    case("saturation", Law("maxwell", 5), "pi", G, 4, [(1000, 12000, walk(291, 12, 3, -9.9, 9.9, 0), 4)],
         [(1000, 6000, cycles([(2, -9, 9, 6), (2, -7, 9.5, 6)], "sine"), 4)], [("stop", -0.33, 0.36, 0.12)], ["saturation"], start=("rest", "unknown"))

    # ---- asymmetry
    case("asymmetry", Law("prandtl/bump", 2), "pi", A, 35, [(200, 9000, cycles([(1, 0, 148, 10), (1, 10, 100, 10), (1, 50, 148, 10), (1, 0, 60, 15)], "sine"), 4)],
         [(200, 5000, walk(301, 25, 1, 0, 140, 0), 4)], [("bend-before", lambda s: s + 0.17 * (s * s - 1))], ["asymmetry"])
    case("asymmetry", Law("bouc-wen/1", 10), "bouc-wen", C, 40, [(400, 12000, walk(311, 30, 1.5, -195, 195, 0), 4)], [(400, 6000, triangle(1, -170, 170), 4)],
         [("bend-behind", lambda x: np.expm1(0.9 * x) / 0.9)], ["asymmetry"], start=("rest", "unknown"))
    case("asymmetry", Law("maxwell", 7), "pi", B, 11, [(1000, 10000, decay(4, -18, 118, 10, 0.15), 4)], [(1000, 5000, tones(321, [1.7, 4.3], 5, -10, 110), 4)],
         [("bend-behind", lambda x: x - 0.22 * x ** 2 - 0.08 * x ** 3)], ["asymmetry"], start=("unknown", "unknown"), adc=15)

    # ---- interference
    case("interference", Law("prandtl/power", 2), "pi", A, 10, [(1000, 10000, triangle(2, 0, 140, 0.72, 0.7), 4)], [(1000, 5000, walk(331, 5, 4, 0, 130, 0), 4)],
         [("tone", [(50.02, 0.011, 0.3), (150.06, 0.003, 1)])], ["interference"], start=("mid", "rest"))
    case("interference", Law("walls", 1), "preisach", C, 25, [(250, 8000, walk(341, 32, 1, -190, 190, 0), 3)], [(250, 5000, decay(0.9, -180, 180, 20), 3)],
         [("tone", [(59.97, 0.012, 2.0)])], ["interference"], start=("rest", "rest"), noise=(0.0014, 0, 13, 0))
    case("interference", Law("coleman-hodgdon", 6), "bouc-wen", D, 3, [(10000, 30000, cycles([(5, 0, 9.5, 5), (11, 0, 7, 22)], "sine"), 1)],
         [(10000, 12000, triangle(7, 0.5, 8.5), 1)], [("tone", [(50.0, 0.008, 0.0), (100.0, 0.006, 1.0), (250.0, 0.004, 2.0)])], ["interference"],
         start=("unknown", "unknown"))

    # ---- two effects
    case("creep-interference", Law("prandtl/uniform", 7), "pi", A, 18, [(200, 16000, stairs([0, 146, 40, 110, 70, 0, 120, 30, 90, 10], 8, 0.3), 4)],
         [(200, 8000, stairs([0, 135, 20, 100, 60], 8, 0.4), 4)], [("creep", *logcreep(0.06, 0.05, 80)), ("tone", [(50.03, 0.01, 0.5)])],
         ["creep", "interference"])
    case("resonance-drift", Law("bouc-wen/1", 12), "bouc-wen", C, 35,
         [(4000, 40000, cycles([(10, -180, 180, 30), (17, -180, 180, 34), (17, -110, 110, 34), (10, -180, 180, 30)]), 3)],
         [(4000, 20000, cycles([(13, -150, 150, 65)]), 3)], [("mode", 163.0, 0.015, 1.0), ("drift", lambda t: -0.012 * t)], ["resonance", "drift"],
         start=("unknown", "unknown"))
    case("temperature-creep", Law("prandtl/exponential", 8), "pi", E, 30, [(50, 15000, stairs(levels(351, 31, 0, 98, 0), 10, 0.5), 6)],
         [(50, 7500, stairs(levels(352, 19, 0, 95, 0), 8, 0.5), 6)],
         [("temp-gain", 0.010), ("creep", np.array([0.5, 4.0]), np.array([0.05, 0.08]))], ["temperature", "creep"],
         temperature=(swing(24, 5, 125, 0.7, 0.5), swing(24, 4, 85, 2.0), 0))
    case("load-drift", Law("backbone/iwan", 1), "pi", A, 20, [(200, 16000, walk(361, 80, 1.2, 0, 145, 0), 4)], [(200, 7000, sine(0.9, 0, 130), 4)],
         [("load", lambda q: 0.04 * q), ("drift", lambda t: -0.0012 * t)], ["load", "drift"],
         load=(weights([0, 30, 0, 45, 20, 0, 50, 10, 30, 0], 8), weights([20, 0, 45, 10, 30], 7)))
    case("delay-asymmetry", Law("prandtl/uniform", 9), "pi", B, 14, [(2000, 16000, sweep(0.5, 50, 8, -18, 118), 4)],
         [(2000, 7000, tones(371, [2.3, 9, 21, 33], 3.5, -10, 110, 0.5), 4)],
         [("delay", 0.0035), ("bend-behind", lambda x: x - 0.25 * x ** 2)], ["delay", "asymmetry"], start=("unknown", "unknown"))
    case("lag-interference", Law("kp", 8), "preisach", A, 26, [(1000, 16000, walk(381, 16, 8, 0, 148, 0), 4)], [(1000, 7000, sweep(0.5, 12, 7, 0, 140), 4)],
         [("lag", 0.012), ("tone", [(60.02, 0.011, 1.0)])], ["lag", "interference"])
    case("rate-drift", Law("prandtl/exponential", 10), "pi", C, 65,
         [(500, 24000, cycles([(0.25, -190, 190, 3), (1, -190, 190, 6), (5, -190, 190, 25), (12, -190, 190, 36), (0.25, -190, 190, 2), (5, -190, 190, 45), (1, -190, 190, 4)]), 3)],
         [(500, 8000, cycles([(0.5, -150, 150, 2), (3, -150, 150, 12), (9, -140, 140, 70)]), 3)],
         [("rate", "log", 0.33, 40.0, 0), ("drift", lambda t: -0.0022 * t)], ["rate-dependence", "drift"], start=("unknown", "unknown"))
    case("saturation-interference", Law("backbone/rayleigh", 4), "pi", A, 24, [(1000, 12000, cycles([(2, 0, 148, 12), (2, 0, 100, 4), (2, 30, 148, 8)]), 4)],
         [(1000, 6000, walk(391, 6, 3, 0, 145, 0), 4)], [("stop", -9.0, 0.74, 0.05), ("tone", [(49.98, 0.011, 0.0)])], ["saturation", "interference"])
    case("asymmetry-creep", Law("maxwell", 9), "pi", A, 32, [(50, 12000, stairs(levels(401, 21, 0, 145, 0), 12, 0.5), 8)],
         [(50, 6000, stairs(levels(402, 12, 0, 140, 0), 10, 0.6), 8)], [("bend-before", lambda s: s + 0.18 * (s * s - 1)), ("creep", *logcreep(0.05, 0.2, 100))],
         ["asymmetry", "creep"])
    case("temperature-load", Law("coleman-hodgdon", 8), "bouc-wen", E, 20, [(100, 20000, walk(411, 200, 0.6, 0, 98, 0), 4)],
         [(100, 8000, cycles([(0.5, 5, 90, 40)]), 4)], [("temp-zero", 0.17), ("load", lambda q: 0.03 * q)], ["temperature", "load"],
         temperature=(swing(24, 4, 71, 0.4, 1.6), swing(24, 3.5, 52, 1.5, 1), 0),
         load=(weights([0, 25, 50, 10, 40, 0, 30, 50, 20, 0], 19), weights([30, 0, 50, 20], 20)), start=("rest", "unknown"))
    case("delay-resonance", Law("preisach/exponential", 2), "preisach", C, 70, [(5000, 30000, sweep(2, 320, 6, -150, 150, fade=0.3), 4)],
         [(5000, 12000, tones(421, [5, 17, 41, 83, 130, 190, 250], 2.4, -130, 130, 0.4), 4)], [("delay", 0.0012), ("mode", 185.0, 0.06, 0.3)],
         ["delay", "resonance"], start=("unknown", "unknown"))
    case("rate-interference", Law("dahl/1", 12), "bouc-wen", A, 16,
         [(400, 4000, sine(0.2, 0, 140), 6), (400, 3200, sine(1, 0, 140), 6), (400, 2400, sine(6, 0, 140), 6), (400, 2000, sine(14, 0, 110), 6)],
         [(400, 6000, cycles([(0.4, 0, 120, 2), (3, 0, 130, 12), (10, 0, 100, 60)], "sine"), 6)],
         [("rate", "power", 1.7, 5000.0, 0.35), ("tone", [(50.05, 0.010, 0.0)])], ["rate-dependence", "interference"], start=("rest", "unknown"))
    case("temperature-drift", Law("bouc-wen/1", 13), "bouc-wen", C, 48, [(100, 24000, cycles([(0.8, -190, 190, 96), (0.8, -110, 110, 48), (0.8, -190, 190, 48)], "sine"), 4)],
         [(100, 9000, cycles([(0.7, -160, 160, 63)]), 4)], [("temp-width", 0.06), ("drift", lambda t: -0.0005 * t)], ["temperature", "drift"],
         temperature=(swing(24, 6, 105, 0.0), swing(24, 5, 70, 1.3), 0), start=("unknown", "unknown"))
    case("load-asymmetry", Law("prandtl/bump", 5), "pi", B, 13, [(300, 15000, walk(431, 50, 1.5, -19, 119, 0), 4)], [(300, 6000, triangle(1, -10, 100), 4)],
         [("load", lambda q: 0.025 * q), ("bend-before", lambda s: np.expm1(0.6 * s) / np.sinh(0.6) * 1.0)], ["load", "asymmetry"],
         load=(weights([0, 30, 10, 40, 0, 20, 45, 5, 30, 0], 5), weights([20, 0, 40, 10], 5)), start=("rest", "unknown"))
    case("saturation-drift", Law("bouc-wen/2", 14), "bouc-wen", G, 7, [(200, 12000, cycles([(1, -9.8, 9.8, 25), (1, -6, 6, 10), (1, -9.8, 9.8, 25)]), 4)],
         [(200, 6000, walk(441, 30, 1, -9.5, 9.5, 0), 4)], [("stop", -9.0, 0.30, 0.0), ("drift", lambda t: -0.0016 * t)], ["saturation", "drift"],
         start=("unknown", "rest"))

    # ---- something real that no list has
    case("unknown-slip", Law("prandtl/exponential", 12), "pi", A, 20, [(200, 12000, sine(1, 0, 140, 20), 4)], [(200, 6000, walk(451, 30, 1, 0, 130, 0), 4)],
         [("slip", 0.03, 5)], ["unknown"], [["drift"]], start=("mid", "rest"))
    case("unknown-gain-steps", Law("bouc-wen/1", 15), "bouc-wen", C, 50, [(500, 12000, cycles([(2, -190, 190, 28), (2, -110, 110, 20)], "sine"), 4)],
         [(500, 6000, walk(461, 12, 2, -170, 170, 0), 4)], [("gain-steps", 0.09, 7)], ["unknown"], start=("unknown", "unknown"))
    case("unknown-telegraph", Law("preisach/gauss", 3), "preisach", A, 15, [(500, 14000, walk(471, 28, 2, 0, 145, 0), 4)], [(500, 6000, sine(1.3, 5, 130), 4)],
         [("telegraph", 0.03, 0.6)], ["unknown"], start=("rest", "unknown"))
    case("unknown-duffing", Law("prandtl/uniform", 11), "pi", C, 40, [(4000, 24000, sweep(2, 260, 6, -150, 150, log=False, fade=0.6), 4)],
         [(4000, 10000, sweep(220, 8, 2.5, -120, 120, log=False, fade=0.8), 4)], [("duffing", 120.0, 0.04, 0.35, 2.2)], ["unknown"], [["resonance"]],
         start=("unknown", "unknown"))
    case("unknown-neighbour", Law("maxwell", 12), "pi", B, 12, [(500, 14000, walk(481, 28, 2, -18, 118, 0), 4)], [(500, 6000, triangle(1, -10, 100), 4)],
         [("neighbour", 0.06, 0.83)], ["unknown"], [["interference"]], start=("rest", "unknown"))
    case("unknown-wander", Law("coleman-hodgdon", 10), "bouc-wen", E, 30, [(200, 16000, cycles([(1, 0, 98, 50), (1, 0, 60, 30)]), 4)],
         [(200, 7000, walk(491, 35, 1, 0, 95, 0), 4)], [("wander", 0.05, 0.12)], ["unknown"])
    case("unknown-freeze", Law("backbone/ramberg-osgood", 2), "pi", A, 9, [(1000, 12000, sine(3, 0, 140), 4)], [(1000, 6000, walk(501, 6, 4, 0, 130, 0), 4)],
         [("freeze", 1100, 60)], ["unknown"])


def draw(item):
    """The four records of a case, with the noise of each."""
    out = {}
    seed = zlib.crc32(item["id"].encode())
    for part, word in enumerate(("train", "test")):
        line = Timeline(item["segments"][part], item["start"][part], item["volts"], seed + 10 * part, item["gap"])
        now = dict(item)
        now["temperature"] = (item["heat"][part], item["heat"][2]) if item["heat"] else None
        now["load"] = item["weight"][part] if item["weight"] else None
        for twin in (False, True):
            recorded, freeze = respond(now, line, [] if twin else item["fx"], seed + 10 * part)
            recorded, noise = disturb(now, recorded, seed + 10 * part + 1, freeze)
            out[("twin-" if twin else "") + word] = (recorded, noise)
    return out


def main():
    folder = sys.argv[1]
    began = time.time()
    build()
    for item in CASES:
        os.makedirs(f"{folder}/{item['id']}", exist_ok=True)
        for name, (recorded, _) in draw(item).items():
            write(f"{folder}/{item['id']}/{name}.csv", recorded)
        truth = dict(expect=item["expect"], accept=item["accept"], base=item["law"].name.split("/")[0], model=item["model"])
        with open(f"{folder}/{item['id']}/truth.json", "w") as file:
            json.dump(truth, file, indent=1)
    print(f"{len(CASES)} cases in {time.time() - began:.0f} s")


if __name__ == "__main__":
    main()
