"""Third examination of `hystctl diagnose`: `python third.py OUT [--seed N]` writes OUT/<id>/{train,test,twin-train,twin-test}.csv and
OUT/<id>/truth.json. Each effect is scaled so that the part that play operators cannot absorb is several noise floors (see `size`)."""
import argparse
import json
import os

import numpy as np
from numba import njit
from scipy.signal import lfilter

# ------------------------------------------------------------------ laws (input x in about [-1, 1], output about [-1, 1])


@njit(cache=True)
def plays(x, r, w0):
    out = np.empty((len(r), len(x)))
    for k in range(len(r)):
        w = w0
        for i in range(len(x)):
            w = min(max(w, x[i] - r[k]), x[i] + r[k])
            out[k, i] = w
    return out


@njit(cache=True)
def play_sum(x, r, c, w0):
    out = np.zeros(len(x))
    for k in range(len(r)):
        w = w0
        for i in range(len(x)):
            w = min(max(w, x[i] - r[k]), x[i] + r[k])
            out[i] += c[k] * w
    return out


@njit(cache=True)
def everett(table, lim, a, b, kind, p, q):
    if kind == 1:
        d = a - b
        return p * d + q * d * d
    n = table.shape[0] - 1
    s, t = (a + lim) / (2 * lim) * n, (b + lim) / (2 * lim) * n
    i, j = min(max(int(s), 0), n - 1), min(max(int(t), 0), n - 1)
    s, t = s - i, t - j
    return ((1 - s) * ((1 - t) * table[i, j] + t * table[i, j + 1]) + s * ((1 - t) * table[i + 1, j] + t * table[i + 1, j + 1]))


@njit(cache=True)
def stacked(x, table, lim, kind, p, q):
    """Branches between stored reversals, with wiping out: Preisach by its Everett function, Rayleigh by parabolas."""
    ext, val = np.empty(len(x) + 5), np.empty(len(x) + 5)
    ext[0], val[0] = -lim, 0.0
    top, up, last, y = 0, True, -lim, 0.0
    out = np.empty(len(x))
    for i in range(len(x)):
        if x[i] != last:
            now = x[i] > last
            if now != up:
                top += 1
                ext[top], val[top], up = last, y, now
            if up:
                while top >= 2 and x[i] >= ext[top - 1]:
                    top -= 2
                y = val[top] + everett(table, lim, x[i], ext[top], kind, p, q)
            else:
                while top >= 2 and x[i] <= ext[top - 1]:
                    top -= 2
                y = val[top] - everett(table, lim, ext[top], x[i], kind, p, q)
            last = x[i]
        out[i] = y
    return out


@njit(cache=True)
def kp(x, s1, s2, c, width):
    out = np.zeros(len(x))
    for k in range(len(c)):
        w = -1.0
        for i in range(len(x)):
            lo = min(max((x[i] - s1[k]) / width, -1.0), 1.0)
            hi = min(max((x[i] - s2[k]) / width, -1.0), 1.0)
            w = min(max(w, lo), hi)
            out[i] += c[k] * w
    return out


@njit(cache=True)
def ode(x, kind, a, b, g, n):
    out = np.empty(len(x))
    z, last = 0.0, x[0]
    for i in range(len(x)):
        for _ in range(4):
            dx = (x[i] - last) / 4
            s = 1.0 if dx > 0 else -1.0
            if kind == 0:  # Bouc-Wen
                z += a * dx - b * abs(dx) * abs(z) ** (n - 1) * z - g * dx * abs(z) ** n
            elif kind == 1:  # Coleman-Hodgdon, z is the output
                z += a * abs(dx) * (b * x[i] - z) + g * dx
            elif kind == 2:  # Dahl
                z += a * dx * max(1 - s * z / b, 0.0) ** n
            else:  # Jiles-Atherton
                h = x[i] / a
                man = h / 3 if abs(h) < 1e-3 else 1 / np.tanh(h) - 1 / h
                gap = man - z
                if gap * s > 0:
                    z += abs(dx) * gap / b
        last = x[i]
        out[i] = z
    return out


def make_law(name, rng):
    v = lambda lo, hi: float(rng.uniform(lo, hi))
    if name == "play":
        r = (np.arange(80) + 0.5) / 80
        c = np.exp(-r / v(0.2, 0.5)) * (1 + 0.5 * np.cos(4 * r))
        c *= v(0.25, 0.5) / c.sum()
        return lambda x: 0.75 * x + play_sum(x, r, c, x[0])
    if name == "maxwell":  # a spring in parallel with sliding springs
        limit = np.geomspace(0.01, 0.9, 25)
        k = limit ** v(0.2, 0.6)
        k *= v(0.3, 0.5) / k.sum()
        return lambda x: 1.2 * x - sum(ki * (x - w) for ki, w in zip(k, plays(x, limit, x[0])))
    if name == "rayleigh":
        q = v(0.06, 0.12)
        return lambda x: stacked(x, np.zeros((2, 2)), 1.3, 1, 0.7, q) - 0.9
    if name == "preisach":
        lim, n = 1.3, 260
        g = np.linspace(-lim, lim, n + 1)
        m = (g[1:] + g[:-1]) / 2
        A, B = np.meshgrid(m, m, indexing="ij")
        h, u = (A - B) / 2, (A + B) / 2
        mu = np.exp(-np.maximum(h, 0) / (0.2 + v(0.05, 0.15) * np.tanh(2 * u))) * (1 + v(0.3, 0.5) * u + 0.4 * np.sin(3 * A) * np.cos(2 * B))
        total = np.zeros((n + 1, n + 1))
        total[1:, 1:] = mu.cumsum(0).cumsum(1)
        d = np.arange(n + 1)  # square beta..alpha of a density mirrored on its diagonal, halved
        sym = np.where(A >= B, mu, mu.T)
        S = np.zeros((n + 1, n + 1))
        S[1:, 1:] = sym.cumsum(0).cumsum(1)
        E = (S[d, d][:, None] + S[d, d][None, :] - S - S.T) / 2
        E *= v(0.8, 1.1) / E[-30, 30]
        return lambda x: stacked(x, E, lim, 0, 0.0, 0.0) + 0.7 * x
    if name == "kp":
        s = np.linspace(-1.1, 1.1, 17)
        pairs = [(a, b) for a in s for b in s if a >= b]
        s1, s2 = np.array(pairs).T
        c = np.exp(-(s1 - s2) / v(0.25, 0.45)) * (1 + v(0.2, 0.5) * s1 + 0.2 * s2)
        c *= 0.8 / c.sum()
        return lambda x: 0.5 * x + kp(x, s1.copy(), s2.copy(), c, 0.35)
    if name == "boucwen":
        b, n, d = v(2, 4), v(1.0, 1.6), v(0.12, 0.2)
        return lambda x: x - d * ode(x, 0, 2.0, b, b * 0.2, n)
    if name == "coleman":
        a, g = v(0.8, 1.4), v(0.78, 0.88)
        return lambda x: ode(x, 1, a, 1.0, g, 1.0)
    if name == "dahl":
        a, n = v(1.5, 3), v(1.0, 1.5)
        return lambda x: x - 0.2 * ode(x, 2, a, 0.6, 0.0, n)
    k = v(0.2, 0.4)
    return lambda x: 0.8 * x + 0.5 * ode(x, 3, 0.5, k, 0.0, 0.0)  # jiles


# ------------------------------------------------------------------ drives: list of segments on the fine grid, in [-1, 1]


def tri(p):
    return 1 - 4 * np.abs(np.mod(p, 1) - 0.5)


def drive(kind, n, over, cycles, rng, test, segments):
    """Returns segments (each a fine array) of x, about n rows in total; `cycles` at the highest rate would fill the record."""
    N = n * over
    s = np.arange(N) / N
    if kind == "sine":
        amp = rng.uniform(0.6, 0.85) if test else 1.0
        return [-amp * np.cos(2 * np.pi * cycles * s)]
    if kind in ("multi", "afm"):
        rates = np.array([0.8, 0.15, 0.4] if test else [0.1, 0.25, 0.5, 1.0])
        amps = np.array([0.7, 0.9, 0.5] if test else [1.0, 0.6, 1.0, 0.9])
        per = N // len(rates)
        parts, wave = [], (lambda p: -np.cos(2 * np.pi * p)) if kind == "multi" else tri
        for r, a in zip(rates, amps):
            c = max(1, round(cycles * r / len(rates)))
            length = int(min(c / (cycles * r) * N, per * 1.5))
            p = np.arange(length) / length * c
            parts.append(-1 + a * (wave(p) + 1))
        return parts if segments else [np.concatenate(parts)]
    if kind == "decay":
        half = N // 2
        q = np.arange(half) / half
        c = max(4, round(cycles * 0.35))
        one = (0.85 if test else 1.0) * (1 - 0.95 * q) * np.sin(2 * np.pi * c * q)
        f = np.array([0.13, 0.31, 0.55, 0.8]) * cycles / 2 * (0.9 if test else 1)
        ph = rng.uniform(0, 2 * np.pi, 4)
        two = sum(np.sin(2 * np.pi * fi * q + p) / (1 + i) for i, (fi, p) in enumerate(zip(f, ph)))
        two *= (0.75 if test else 0.95) / np.abs(two).max()
        w = np.minimum(q * 12, 1)
        two = two * w * w * (3 - 2 * w)
        return [one, two] if segments else [np.concatenate([one, two + (one[-1] - two[0])])]
    if kind == "stair":
        steps = 22
        lv = np.concatenate([np.linspace(-1, 1, 8), np.linspace(1, -1, 8)[1:], rng.uniform(-0.9, 0.9, steps - 15)])
        if test:
            lv = rng.uniform(-0.95, 0.95, steps)
        per = N // steps
        ramp = max(per // 12, 4)
        if test:
            ramp = int(ramp * 3.2)
        out, last = [], lv[0]
        for level in lv:
            q = np.minimum(np.arange(per) / ramp, 1)
            out.append(last + (level - last) * q * q * (3 - 2 * q))
            last = level
        return [np.concatenate(out)]
    if kind == "chirp":
        r0, r1 = 0.08, 1.0
        inst = r0 * (r1 / r0) ** s
        if test:
            inst = inst[::-1] * 0.9
        p = np.cumsum(inst) / N * cycles
        env = 0.85 * (1 - 0.35 * np.sin(2 * np.pi * 3.3 * s) ** 2) if test else 1 - 0.4 * np.sin(2 * np.pi * 2.3 * s) ** 2
        return [-env * np.cos(2 * np.pi * p)]
    noise = rng.standard_normal(N)  # walk
    pole = np.exp(-2 * np.pi * cycles / N)
    slow = np.exp(-2 * np.pi * cycles / N / 12)
    x = lfilter([1 - slow], [1, -slow], noise)
    for _ in range(2):
        x = lfilter([1 - pole], [1, -pole], x)
    x -= np.linspace(x[0], x[-1], N)
    x = 2 * (x - x.min()) / np.ptp(x) - 1
    return [(0.85 if test else 1.0) * x]


# ------------------------------------------------------------------ effects

FORMS = {
    "delay": ["pure"], "lag": ["first"], "asymmetry": ["quadratic", "bent"], "rate-dependence": ["power", "log", "viscous"],
    "temperature": ["gain", "expansion", "lagged"], "creep": ["log", "fractional", "exponentials"], "load": ["linear", "stiffness"],
    "resonance": ["second"], "saturation": ["soft", "hard", "rail"], "drift": ["line", "settling"], "interference": ["50", "harmonics"],
    "unknown": ["telegraph", "slips", "force", "gain-steps"],
}
TIES = {
    "delay": ["lag", "rate-dependence"], "lag": ["delay", "rate-dependence"], "rate-dependence": ["delay", "lag"], "creep": ["drift", "lag"],
    "drift": ["creep"], "saturation": ["asymmetry"], "asymmetry": ["saturation"], "resonance": ["delay", "lag"], "temperature": ["drift"],
}


def lowpass(y, tau, dt, slices):
    p = np.exp(-dt / tau)
    out = np.empty_like(y)
    for a, b in slices:
        out[a:b] = lfilter([1 - p], [1, -p], y[a:b] - y[a]) + y[a]
    return out


def slow_wave(t, rng, pieces):
    s = (t - t[0]) / (t[-1] - t[0])
    return sum(rng.uniform(0.4, 1) / k ** 0.7 * np.sin(2 * np.pi * k * 0.83 * s + rng.uniform(0, 6.28)) for k in range(1, pieces + 1))


class World:
    """One record on the fine grid, with voltage, temperature and load."""

    def __init__(self, case, law, which, rng):
        over, fs = case["over"], case["fs"]
        self.case, self.law, self.dt = case, law, 1 / (fs * over)
        parts = drive(case["drive"], case["rows"] if which == "train" else int(case["rows"] * 0.7), over, case["cycles"] * (1 if which == "train" else 0.7), rng, which == "test", case["segments"])
        parts = [p[: len(p) // over * over] for p in parts]
        lo, hi = case["range"]
        zero = (0 - (lo + hi) / 2) / ((hi - lo) / 2)
        head = []
        if lo < 0:
            k = np.arange(6000) / 6000
            head.append(zero + (1 - k) * min(1 - zero, 1 + zero) * np.sin(2 * np.pi * 30 * k))
        first = parts[0][0]
        if case["start"] == "mid":  # the drive runs before the record begins: the cut is within the first cycles
            k = np.arange(8000) / 8000
            head += [np.linspace(zero, 0, 500), 0.9 * np.sin(2 * np.pi * 2 * k)]
            cut = int(0.13 * len(parts[0])) // over * over
            self.lead = cut
        else:
            self.lead = 0
        head.append(np.linspace(head[-1][-1] if head else zero, first, 1500))
        head = np.concatenate(head)
        self.head, self.x, self.slices, t, at, a = len(head), np.concatenate([head, *parts]), [], [], 0.0, 0
        for p in parts:
            self.slices.append((a, a + len(p)))
            t.append(at + np.arange(len(p)) * self.dt)
            at = t[-1][-1] + 3 + 40 / fs
            a += len(p)
        self.t = np.concatenate(t)
        n = len(self.t)
        s = (self.t - self.t[0]) / (self.t[-1] - self.t[0])
        self.temp = slow_wave(self.t, rng, 2)
        self.temp = 24 + (5 if which == "train" else 4) * self.temp / np.abs(self.temp).max() + rng.choice([-1, 1]) * 2 * (s - 0.5)
        self.force = slow_wave(self.t, rng, 7)
        self.force = 10 * (1 + (0.95 if which == "train" else 0.8) * self.force / np.abs(self.force).max())
        self.hidden = slow_wave(self.t, rng, 9)
        phases = rng.uniform(0, 6.28, 3)
        self.hum = [np.sin(2 * np.pi * 50.02 * k * self.t + p) for k, p in zip((1, 2, 3), phases)]
        k = 14
        jumps = np.sort(rng.uniform(0.03, 0.97, k))
        self.telegraph = np.where(np.searchsorted(np.sort(rng.uniform(0, 1, 40)), s) % 2, 1.0, -1.0)
        signs = rng.choice([-1.0, 1.0], k)
        self.steps = np.concatenate([[0], np.cumsum(signs * rng.uniform(0.5, 1, k))])[np.searchsorted(jumps, s)]
        self.steps -= self.steps.mean()
        v = np.zeros(n)
        for a, b in self.slices:
            v[a:b] = np.gradient(self.x[self.head + a:self.head + b], self.dt)
        self.v = lowpass(v, 0.7 / fs, self.dt, self.slices)
        if which == "train":
            case["vref"] = float(np.quantile(np.abs(self.v), 0.9))
        self.vn = self.v / case["vref"]
        self.cache = {}

    def signal(self, effects):
        """Returns the displacement (fraction of half a stroke) for effects: list of (name, form, size)."""
        got = {name: (form, size) for name, form, size in effects}
        case, dt, sl, h = self.case, self.dt, self.slices, self.head
        x = self.x
        inside = []
        if "rate-dependence" in got:
            form, c = got["rate-dependence"]
            a = np.abs(self.vn)
            phi = {"power": a ** case["power"], "log": np.log1p(a / 0.1) / 2.4, "viscous": a}[form]
            x = np.concatenate([x[:h], x[h:] - c * np.sign(self.vn) * phi])
            inside.append(("r", form, c))
        if got.get("saturation", ("",))[0] == "rail":
            x = np.minimum(x, 1 - got["saturation"][1])
            inside.append(("s", got["saturation"][1]))
        key = tuple(inside)
        if key not in self.cache:
            if len(self.cache) > 3:
                self.cache = {k: w for k, w in self.cache.items() if k == ()}
            self.cache[key] = self.law(np.ascontiguousarray(x))[h:]
        y = self.cache[key].copy()
        if "asymmetry" in got:
            form, c = got["asymmetry"]
            y = y + c * (y * y if form == "quadratic" else np.exp(0.9 * y) - 0.9 * y)
        s = (self.t - self.t[0]) / case["length"]
        if "temperature" in got:
            form, c = got["temperature"]
            dT = (self.temp - 24) / 5
            if form == "lagged":
                dT = (lowpass(self.temp, case["length"] / 12, dt, [(0, len(y))]) - 24) / 5
            y = y + (c * dT if form == "expansion" else c * dT * (y + 1) + (0.4 * c * dT if form == "lagged" else 0))
        if "load" in got:
            form, c = got["load"]
            f = self.force / 10
            y = y - (c * f if form == "linear" else c * f * (1 + 0.4 * (y + 1)))
        if got.get("unknown", ("",))[0] == "gain-steps":
            y = y + got["unknown"][1] * self.steps * (y + 1)
        if "creep" in got:
            form, c = got["creep"]
            T = case["length"]
            if form == "exponentials":
                terms = [(0.02 * T, 0.5), (0.2 * T, 0.5)]
            else:
                taus = np.geomspace(3 / case["fs"], 2 * T, 12)
                w = np.ones(12) if form == "log" else (taus / taus[0]) ** 0.25
                terms = list(zip(taus, w / w.sum()))
            y = y + c * sum(w * lowpass(y, tau, dt, sl) for tau, w in terms)
        if got.get("saturation", ("",))[0] in ("soft", "hard"):
            form, c = got["saturation"]
            top = case["top"]
            if form == "hard":
                y = np.minimum(y, top - c)
            else:
                knee = top - 0.7
                e = np.maximum(y - knee, 0)
                y = np.minimum(y, knee) + e / (1 + (c * e) ** 2) ** 0.5
        if "resonance" in got:
            w0 = case["w0"] / np.sqrt(got["resonance"][1])
            z, out = case["zeta"], np.empty_like(y)
            wd = w0 * np.sqrt(1 - z * z)
            e = np.exp(-z * w0 * dt)
            a1, a2 = -2 * e * np.cos(wd * dt), e * e
            for a, b in sl:
                out[a:b] = lfilter([1 + a1 + a2], [1, a1, a2], y[a:b] - y[a]) + y[a]
            y = out
        if "lag" in got:
            y = lowpass(y, got["lag"][1] * case["unit"], dt, sl)
        if "delay" in got:
            k = got["delay"][1] * case["unit"] / dt
            out = np.empty_like(y)
            for a, b in sl:
                i = np.arange(b - a)
                out[a:b] = np.interp(i - k, i, y[a:b])
            y = out
        if "drift" in got:
            form, c = got["drift"]
            y = y + c * (s - 0.5 if form == "line" else 1 - np.exp(-s / 0.3))
        if "interference" in got:
            form, c = got["interference"]
            y = y + c * (self.hum[0] if form == "50" else self.hum[0] + 0.5 * self.hum[1] + 0.4 * self.hum[2])
        if "unknown" in got:
            form, c = got["unknown"]
            if form != "gain-steps":
                y = y + c * {"telegraph": self.telegraph, "slips": self.steps, "force": self.hidden}[form]
        return y[self.rows()]

    def rows(self):
        return np.arange(self.lead, len(self.t), self.case["over"])

    def basis(self, preisach):
        i = self.rows()
        step = max(1, len(i) // 4000)
        r = np.concatenate([[0], np.geomspace(0.01, 0.95, 16)])
        p = plays(self.x[: self.head + i[-1] + 1], r, self.x[0])[:, self.head + i[::step]]
        cols = [np.ones(p.shape[1]), *p] + ([*(p * p), *(p ** 3)] if preisach else [])
        u, sv, _ = np.linalg.svd(np.array(cols).T, full_matrices=False)
        return u[:, sv > 1e-9 * sv[0]], step


def rms(a):
    return float(np.sqrt(np.mean(a * a)))


def size(world, effects, noise, wish, rng):
    """Sets the sizes: the remainder of each effect after the play basis is `wish` noise floors (or 1.5 misfits); at most 10 % of the
    stroke in total."""
    case = world.case
    q, step = world.basis(case["model"] == "preisach")
    left = lambda d: d - q @ (q.T @ d)
    clean = world.signal([])[::step]
    stroke = clean.max() - clean.min()
    case["top"] = float(world.signal([]).max())
    misfit = rms(left(clean))
    out, info = [], {}
    for name, form in effects:
        target = max(wish * noise, 1.5 * misfit)
        c = 0.03
        for _ in range(14):
            d = world.signal([(name, form, c)])[::step] - clean
            got, peak = rms(left(d)), np.abs(d - d.mean()).max() / stroke
            goal = min(target / max(got, 1e-12), 0.095 / len(effects) ** 0.7 / max(peak, 1e-12))
            c *= float(np.clip(goal, 0.2, 5)) ** (0.7 if name in ("saturation", "rate-dependence") else 0.95)
            c = min(c, 0.5) if name == "saturation" and form != "soft" else min(c, 3e4)
        d = world.signal([(name, form, c)])[::step] - clean
        info[name] = dict(form=form, size=c, left_in_noise=rms(left(d)) / noise, left_in_misfit=rms(left(d)) / max(misfit, 1e-12), peak_of_stroke=float(np.abs(d - d.mean()).max() / stroke))
        ties = []
        for alt in TIES.get(name, []):
            cols = []
            for f in FORMS[alt]:
                cols.append(left(world.signal([(alt, f, c if alt in ("lag", "delay") and name in ("lag", "delay") else 0.03)])[::step] - clean))
            e = left(d)
            if min(rms(e - col * (col @ e) / max(col @ col, 1e-30)) for col in cols) < max(0.25 * noise, 0.3 * misfit):
                ties.append(alt)
        info[name]["ties"] = ties
        out.append((name, form, c))
    return out, info, misfit


# ------------------------------------------------------------------ cases: effects ; law ; drive ; range ; rate ; rows ; cycles ; start ; sensor

RANGES = {"u": (0, 150), "b": (-20, 120), "s": (-10, 10), "k": (0, 1000), "c": (0, 100), "w": (-30, 150)}
CASES = """
- ; play ; sine ; u ; 1000 ; 4000 ; 8 ; rest ; white
- ; preisach ; multi ; b ; 2000 ; 12000 ; 60 ; mid ; pink
- ; kp ; decay ; u ; 500 ; 5000 ; 40 ; rest ; q14
- ; boucwen ; afm ; s ; 5000 ; 10000 ; 60 ; rest ; white
- ; coleman ; walk ; k ; 200 ; 6000 ; 40 ; rest ; white
- ; maxwell ; stair ; u ; 50 ; 700 ; 22 ; rest ; q12
- ; rayleigh ; chirp ; s ; 10000 ; 20000 ; 60 ; mid ; spikes
- ; jiles ; multi ; w ; 1000 ; 8000 ; 40 ; rest ; pink
- ; play/T ; afm ; c ; 100 ; 20000 ; 150 ; rest ; spikes
- ; preisach/L ; walk ; u ; 400 ; 9000 ; 60 ; rest ; q16
unknown:telegraph ; play ; sine ; u ; 500 ; 8000 ; 16 ; rest ; white
unknown:slips ; maxwell ; walk ; b ; 200 ; 8000 ; 50 ; rest ; pink
unknown:force ; preisach ; multi ; s ; 400 ; 12000 ; 80 ; rest ; white
unknown:gain-steps ; rayleigh ; afm ; k ; 1000 ; 10000 ; 60 ; mid ; q14
unknown:telegraph ; kp ; chirp ; u ; 2000 ; 15000 ; 60 ; rest ; white
delay:pure ; play ; chirp ; u ; 10000 ; 20000 ; 80 ; rest ; white
delay:pure ; preisach ; afm ; b ; 5000 ; 15000 ; 100 ; rest ; q14
delay:pure ; boucwen ; multi ; s ; 20000 ; 24000 ; 100 ; mid ; pink
lag:first ; maxwell ; afm ; u ; 2000 ; 10000 ; 80 ; rest ; white
lag:first ; kp ; stair ; k ; 500 ; 6000 ; 22 ; rest ; white
lag:first ; rayleigh ; multi ; c ; 4000 ; 12000 ; 80 ; mid ; spikes
asymmetry:quadratic ; play ; decay ; s ; 1000 ; 6000 ; 40 ; rest ; white
asymmetry:bent ; maxwell ; walk ; u ; 100 ; 3000 ; 40 ; rest ; q12
asymmetry:quadratic ; coleman ; multi ; b ; 1000 ; 8000 ; 40 ; mid ; pink
rate-dependence:power ; play ; afm ; u ; 2000 ; 16000 ; 100 ; rest ; white
rate-dependence:log ; preisach ; multi ; k ; 1000 ; 16000 ; 100 ; rest ; pink
rate-dependence:viscous ; rayleigh ; chirp ; s ; 5000 ; 20000 ; 80 ; rest ; white
rate-dependence:power ; dahl ; multi ; w ; 2000 ; 12000 ; 60 ; mid ; q14
temperature:gain ; play ; sine ; u ; 50 ; 12000 ; 60 ; rest ; white
temperature:expansion ; kp ; walk ; b ; 50 ; 40000 ; 200 ; rest ; pink
temperature:lagged ; maxwell ; afm ; c ; 100 ; 20000 ; 120 ; rest ; q16
creep:log ; play ; stair ; u ; 100 ; 8000 ; 22 ; rest ; white
creep:fractional ; preisach ; stair ; k ; 200 ; 10000 ; 22 ; rest ; q16
creep:exponentials ; rayleigh ; walk ; b ; 100 ; 12000 ; 50 ; rest ; white
load:linear ; boucwen ; multi ; u ; 200 ; 8000 ; 60 ; rest ; white
load:stiffness ; preisach ; decay ; s ; 500 ; 8000 ; 60 ; rest ; spikes
resonance:second ; play ; afm ; u ; 20000 ; 30000 ; 100 ; rest ; white
resonance:second ; kp ; stair ; b ; 5000 ; 12000 ; 22 ; rest ; q14
saturation:hard ; play ; multi ; u ; 1000 ; 8000 ; 40 ; rest ; white
saturation:rail ; maxwell ; walk ; s ; 500 ; 8000 ; 60 ; rest ; white
drift:line ; preisach ; sine ; c ; 200 ; 9000 ; 30 ; rest ; white
drift:settling ; coleman ; multi ; u ; 500 ; 12000 ; 60 ; mid ; white
interference:50 ; rayleigh ; walk ; k ; 1000 ; 9000 ; 30 ; rest ; white
interference:harmonics ; dahl ; stair ; u ; 2000 ; 12000 ; 22 ; rest ; q14
creep:log temperature:expansion ; play ; stair ; u ; 50 ; 16000 ; 22 ; rest ; white
drift:line interference:50 ; preisach ; afm ; b ; 1000 ; 12000 ; 50 ; rest ; white
delay:pure asymmetry:quadratic ; maxwell ; chirp ; s ; 10000 ; 20000 ; 80 ; rest ; white
lag:first load:linear ; play ; afm ; u ; 1000 ; 16000 ; 100 ; rest ; pink
resonance:second interference:harmonics ; maxwell ; stair ; k ; 5000 ; 15000 ; 22 ; rest ; white
rate-dependence:power asymmetry:bent ; play ; multi ; b ; 1000 ; 16000 ; 80 ; rest ; white
saturation:soft delay:pure ; maxwell ; multi ; u ; 5000 ; 16000 ; 80 ; rest ; q14
creep:fractional interference:50 ; kp ; stair ; c ; 500 ; 14000 ; 22 ; rest ; white
temperature:gain drift:line ; preisach ; multi ; u ; 50 ; 20000 ; 150 ; rest ; white
load:linear creep:log ; rayleigh ; stair ; s ; 200 ; 12000 ; 22 ; rest ; white
asymmetry:quadratic drift:settling ; play ; walk ; w ; 500 ; 10000 ; 60 ; rest ; q16
lag:first temperature:lagged ; maxwell ; afm ; u ; 100 ; 30000 ; 400 ; rest ; white
resonance:second load:stiffness ; preisach ; afm ; b ; 10000 ; 24000 ; 80 ; rest ; white
rate-dependence:log temperature:expansion ; play ; afm ; k ; 200 ; 24000 ; 150 ; rest ; spikes
delay:pure drift:line interference:harmonics ; play ; multi ; u ; 2000 ; 16000 ; 80 ; rest ; white
creep:log load:linear asymmetry:quadratic ; maxwell ; stair ; s ; 100 ; 14000 ; 22 ; rest ; white
lag:first temperature:gain interference:50 ; kp ; afm ; u ; 400 ; 24000 ; 150 ; rest ; white
resonance:second load:linear drift:line ; play ; stair ; b ; 2000 ; 20000 ; 22 ; rest ; white
"""


def sensor_noise(n, sigma, kind, rng):
    e = rng.standard_normal(n)
    if kind == "pink":
        f = np.fft.rfftfreq(n)
        f[0] = f[1]
        p = np.fft.irfft(np.fft.rfft(rng.standard_normal(n)) / np.sqrt(f), n)
        e = 0.8 * e + 0.6 * p / p.std()
    e *= sigma
    if kind == "spikes":
        at = rng.choice(n, 4, replace=False)
        e[at] += rng.choice([-1, 1], 4) * rng.uniform(15, 40, 4) * sigma
    return e


def write(path, world, y, case, columns):
    i = world.rows()
    lo, hi = case["range"]
    cols = [world.t[i] - world.t[i[0]], (lo + hi) / 2 + (hi - lo) / 2 * world.x[world.head + i], y]
    names, fmt = ["time_s", "voltage_v", "displacement_um"], ["%.7f", "%.6g", "%.8g"]
    # The device rests during a gap in time; a new segment starts after it.
    step = np.diff(cols[0])
    if (step > 1.5 * np.median(step)).any():
        segment = np.concatenate([[0], np.cumsum(step > 1.5 * np.median(step))])
        names.append("segment"), cols.append(segment), fmt.append("%d")
    if "T" in columns:
        names.append("temperature_degc"), cols.append(world.temp[i]), fmt.append("%.3f")
    if "L" in columns:
        names.append("load_n"), cols.append(world.force[i]), fmt.append("%.4f")
    np.savetxt(path, np.array(cols).T, delimiter=",", fmt=fmt, header=",".join(names), comments="")
    assert all(np.isfinite(c).all() for c in cols), path


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("out")
    parser.add_argument("--seed", type=int, default=31)
    args = parser.parse_args()
    for number, line in enumerate(CASES.strip().splitlines(), 1):
        rng = np.random.default_rng([args.seed, number])
        what, lawname, kind, span, fs, rows, cycles, start, sensor = [w.strip() for w in line.split(";")]
        effects = [] if what == "-" else [tuple(w.split(":")) for w in what.split()]
        lawname, _, extra = lawname.partition("/")
        columns = extra + ("T" if "temperature" in what else "") + ("L" if "load" in what else "")
        rows, cycles, fs = int(rows), float(cycles), float(fs)
        over = 8 if rows < 5000 else 5
        if kind in ("multi", "afm", "chirp", "decay", "walk"):
            cycles = min(cycles, rows / 25)
        length = rows / fs
        case = dict(range=RANGES[span], fs=fs, rows=rows, cycles=cycles, drive=kind, over=over, start=start, length=length,
                    segments=kind in ("multi", "decay") and number % 3 == 0 and not any(e in what for e in ("drift", "creep")) and start == "rest",
                    model="preisach" if lawname in ("preisach", "kp") else "pi", power=float(rng.choice([0.35, 0.6, 1.6])), zeta=float(rng.uniform(0.02, 0.06)),
                    unit=length / cycles)
        # resonance: size 0.03 is a frequency of 1/sqrt(0.03) = 6 times w0; a larger size lowers it
        case["w0"] = 2 * np.pi * cycles / length * (1.2 if kind != "stair" else 3.0)
        law = make_law(lawname, rng)
        train, test = (World(case, law, w, rng) for w in ("train", "test"))
        clean = train.signal([])
        lo, hi = clean.min(), clean.max()
        stroke = float(rng.choice([6, 15, 30, 60, 100]))
        scale = stroke / (hi - lo)
        sigma = float(rng.uniform(0.0006, 0.0015)) * (hi - lo) * (0.45 if kind == "stair" else 1)
        bits = int(sensor[1:]) if sensor[0] == "q" else 0
        lsb = 1.3 * (hi - lo) / 2 ** bits if bits else 0.0
        floor = float(np.hypot(sigma, lsb / 12 ** 0.5))
        sized, info, misfit = size(train, effects, floor, rng.uniform(5, 10), rng)
        name = f"t{number:02d}"
        folder = f"{args.out}/{name}"
        os.makedirs(folder, exist_ok=True)
        spans = []
        for which, world in (("train", train), ("test", test)):
            e = None
            for prefix, active in (("", sized), ("twin-", [])):
                y = world.signal(active)
                if e is None:
                    e = sensor_noise(len(y), sigma, sensor, rng)
                y = (y - lo + e)
                if bits:
                    y = np.round(y / lsb) * lsb
                write(f"{folder}/{prefix}{which}.csv", world, y * scale, case, columns)
                spans.append(f"{np.ptp(y) * scale:.2f}")
        expect = [n for n, _ in effects]
        accept = [[alt if n == own else n for n in expect] for own in expect for alt in info[own]["ties"] if alt not in expect]
        if misfit > 3 * floor and expect != ["unknown"] and not expect:
            accept.append(["unknown"])  # the law is outside the class of the model
        dims = {n: dict(i) for n, i in info.items()}
        for n, form, c in sized:
            if n in ("delay", "lag"):
                dims[n]["tau_s"] = c * case["unit"]
            elif n == "resonance":
                dims[n].update(frequency_hz=case["w0"] / np.sqrt(c) / 2 / np.pi, damping=case["zeta"])
            elif n == "rate-dependence" and form == "power":
                dims[n]["exponent"] = case["power"]
        truth = dict(id=name, base=lawname, model=case["model"], effects=dims, expect=expect, accept=accept, drive=kind, start=start, sensor=sensor,
                     noise_um=floor * scale, misfit_um=misfit * scale, stroke_um=stroke)
        with open(f"{folder}/truth.json", "w") as file:
            json.dump(truth, file, indent=1)
        print(name, lawname, kind, f"rows {len(train.rows())}", what, f"spans {' '.join(spans)} noise {floor * scale:.4f} misfit {misfit * scale:.4f}",
              " ".join(f"{n}: {i['left_in_noise']:.1f} noise {i['left_in_misfit']:.1f} misfit peak {100 * i['peak_of_stroke']:.1f}% {i['ties'] or ''}" for n, i in dims.items()), flush=True)


if __name__ == "__main__":
    main()
