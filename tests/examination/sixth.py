"""Sixth examination: 64 simulated piezo actuators, each with a clean twin, for a program that identifies hysteresis and diagnoses effects.

`python sixth.py OUT --seed N [--only w07,w12] [--report FILE]` writes OUT/wNN-name/{train,test,twin-train,twin-test}.csv and truth.json.
The drive is normalised to x = 0..1 over the voltage range, the output to y = 0..1 over the stroke. There are sixteen hysteresis laws.
All are rate-independent and act on a time grid OS times finer than the record; differential laws use further substeps in x. Linear
dynamics are exact for inputs that are linear between the fine samples, and keep their state across blocks of different sample periods.
The size of each effect is set by its remainder after an ordinary fit (play operators, or a grid of Krasnosel'skii-Pokrovskii kernels)."""
import argparse, json, math, os, time
import numpy as np
from scipy.signal import lfilter

PI2 = 2 * np.pi


# ------------------------------------------------------------------------------------------------ hysteresis laws
def clip_bank(x, lo, hi, w, z0, chunk=1000):
    """Operators z <- clip(z, lo(x), hi(x)): play operators, KP kernels, relays and generalised plays. Returns sum w z."""
    z = np.array(z0, float); y = np.empty(len(x))
    for k in range(0, len(x), chunk):
        a, b = lo(x[k:k + chunk], k), hi(x[k:k + chunk], k); Z = np.empty_like(a)
        for i in range(len(a)):
            np.maximum(z, a[i], out=z); np.minimum(z, b[i], out=z); Z[i] = z
        y[k:k + chunk] = Z @ w
    return y


def plays(r, w, w0):
    """Play operators, with an optional factor on the thresholds per sample and a bend that moves only the descending side."""
    def run(x, scale=None, bend=0.0):
        s = np.ones(len(x)) if scale is None else scale
        lo = lambda v, k: v[:, None] - r * s[k:k + len(v), None]
        hi = lambda v, k: v[:, None] + r * s[k:k + len(v), None] + bend * (4 * v * (1 - v))[:, None] * (r / r.max())
        return w0 * x + clip_bank(x, lo, hi, w, np.zeros(len(r)))
    return run


def play_few(rng):
    """Seven play operators with irregular thresholds and weights."""
    r = np.array([.012, .035, .06, .11, .17, .29, .41]) * rng.uniform(.8, 1.2, 7); w = rng.uniform(.1, 1, 7) * rng.choice([.3, 1.6], 7)
    return plays(r, .45 * w / w.sum(), .55)


def play_dense(rng):
    """Sixty play operators whose weights have a maximum over the threshold, unlike the usual exponential."""
    r = np.linspace(.006, .48, 60); w = (r / .1) ** rng.uniform(.2, .8) * np.exp(-(r / rng.uniform(.2, .3)) ** 2)
    return plays(r, .5 * w / w.sum(), .5)


def maxwell_slip(rng):
    """Massless Maxwell elements: the strain of the voltage minus the sum of springs that slip at their break forces."""
    n = 12; brk = np.geomspace(.008, .35, n) * rng.uniform(.85, 1.15, n); k = np.geomspace(1, .25, n) * rng.uniform(.6, 1.4, n); k *= .5 / k.sum()
    return plays(brk, k, 1 - k.sum())     # x - sum k stop(x) = (1 - sum k) x + sum k play(x)


def relays(mid, half, rng, w0):
    """Relays of given centres and half widths, random weights."""
    up, dn = mid + half, mid - half; w = rng.uniform(.4, 1.6, len(up)); w *= (1 - w0) / w.sum()
    def run(x, **_):
        lo = lambda v, k: (v[:, None] >= up).astype(float)
        hi = lambda v, k: (v[:, None] > dn).astype(float)
        return w0 * x + clip_bank(x, lo, hi, w, np.zeros(len(up)))
    return run


def relays_lumps(rng):
    """Preisach density with two separate clusters over a weak background."""
    n = 1400; c = rng.choice(3, n, p=[.35, .3, .35])
    mid = np.choose(c, [rng.normal(.3, .1, n), rng.normal(.7, .08, n), rng.uniform(0, 1, n)])
    half = np.abs(np.choose(c, [rng.normal(.06, .03, n), rng.normal(.17, .04, n), rng.uniform(0, .2, n)]))
    return relays(mid, half, rng, .45)


def relays_ring(rng):
    """Preisach density on a half ring: wide loops in the middle, narrow loops at both ends, all with random deviations."""
    n = 1400; ph = rng.uniform(0, np.pi, n); R = rng.normal(.36, .05, n)
    return relays(.5 + R * np.cos(ph), np.abs(.55 * R * np.sin(ph)) + .002, rng, .5)


def kp(rng):
    """Krasnosel'skii-Pokrovskii: kernels with ridges of finite width on a coarse triangle, Lorentzian weights off centre."""
    g = np.linspace(-.05, 1, 20); A, B = np.meshgrid(g, g); keep = A >= B; up, dn = A[keep], B[keep]; wid = rng.uniform(.08, .16)
    w = 1 / (1 + ((up - dn) / .12) ** 2) / (1 + ((up + dn) / 2 - rng.uniform(.4, .6)) ** 2 / .12) * rng.uniform(.5, 1.5, len(up)); w *= .7 / w.sum()
    ramp = lambda v, p: np.clip((v[:, None] - p) / wid, 0, 1)
    return lambda x, **_: .3 * x + clip_bank(x, lambda v, k: ramp(v, up), lambda v, k: ramp(v, dn), w, np.zeros(len(up)))


def genplay(rng):
    """Generalised plays between saturating envelopes with different left and right sides."""
    k, c = rng.uniform(2.0, 2.6), rng.uniform(.45, .55); r = np.linspace(.03, .5, 25); q = rng.uniform(.5, .8); w = np.exp(-r / .25); w *= .5 / w.sum()
    lo = lambda v, j: np.tanh(k * (v[:, None] - c) - r); hi = lambda v, j: np.tanh(k * (v[:, None] - c) + q * r)
    return lambda x, **_: .35 * x + clip_bank(x, lo, hi, w, np.tanh(-k * c * np.ones(25)))


def ode(rate, z0, y, dmax=1 / 800):
    """Integrates dz = rate(x, z, sign dx) dx by the midpoint rule in steps of at most dmax; returns y(x, z)."""
    def run(x, **_):
        z = z0; out = np.empty(len(x)); v0 = 0.0
        for i, v1 in enumerate(x.tolist()):
            d = v1 - v0
            if d:
                n = int(abs(d) / dmax) + 1; h = d / n; s = 1.0 if d > 0 else -1.0
                for j in range(n):
                    v = v0 + j * h; zm = z + .5 * h * rate(v, z, s); z += h * rate(v + .5 * h, zm, s)
            out[i] = z; v0 = v1
        return y(x, out)
    return run


def coleman_hodgdon(rng):
    """Duhem model in the form of Coleman and Hodgdon with linear f and g."""
    a, b, c = rng.uniform(3, 7), 1.0, rng.uniform(.3, .5)
    return ode(lambda v, z, s: a * s * (b * (v - .5) - z) + c, -.5, lambda x, z: .4 * x + .6 * z)


def duhem_tanh(rng):
    """Coleman-Hodgdon with an f that bends (tanh) and a g that falls towards the ends."""
    a, k, c = rng.uniform(3, 6), rng.uniform(1.6, 2.4), rng.uniform(.4, .55)
    f = lambda v: .5 * math.tanh(k * (v - .5)) / math.tanh(k * .5)
    return ode(lambda v, z, s: a * s * (f(v) - z) + c * (1 - 1.5 * (v - .5) ** 2), -.5, lambda x, z: .45 * x + .55 * z)


def bouc_wen(rng):
    """Bouc-Wen with an unusual exponent and different beta and gamma."""
    n, A, zu = rng.choice([1.0, 1.6, 2.4]), 1.0, rng.uniform(.12, .2); q = rng.uniform(.65, .9); be, ga = q * A / zu ** n, (1 - q) * A / zu ** n
    def rate(v, z, s):
        p = abs(z) ** n; return A - be * (s if z > 0 else -s) * p - ga * p
    return ode(rate, -zu, lambda x, z: x - .55 * z)


def dahl(rng):
    """Dahl friction with an exponent: a spring to the frame that yields gradually."""
    i, f, sg = rng.choice([.7, 1.0, 1.6]), rng.uniform(.14, .24), rng.uniform(1.2, 2.0)
    rate = lambda v, z, s: sg * max(1 - s * z / f, 0.0) ** i
    return ode(rate, 0.0, lambda x, z: x - .85 * z / (sg * 2 ** i))


def jiles_atherton(rng):
    """Jiles-Atherton, with no negative susceptibility after a reversal; H = -1..1 over the range."""
    a, al, kk, c = rng.uniform(.35, .5), .2, rng.uniform(.18, .28), rng.uniform(.15, .3)
    L = lambda q: 1 / math.tanh(q) - 1 / q if abs(q) > 1e-3 else q / 3
    dL = lambda q: 1 / q ** 2 - 1 / math.sinh(q) ** 2 if abs(q) > 1e-2 else 1 / 3
    def rate(v, m, s):
        he = (2 * v - 1) + al * m; q = he / a; e = L(q) - m; irr = e / (s * kk - al * e) if e * s > 0 else 0.0
        chi = (1 - c) * irr + c * dL(q) / a; return 2 * max(chi, 0.0) / (1 - al * c * dL(q) / a)
    return ode(rate, -L(1 / a), lambda x, m: .5 * x + .3 * m)


def stack_law(branch, top):
    """Madelung's rules with a stack of reversals; branch(base, target, x) gives the output from base to target."""
    def run(x, **_):
        st = [(0.0, 0.0)]; up = True; last = y = 0.0; out = np.empty(len(x))
        for i, v in enumerate(x.tolist()):
            if v != last:
                if (v > last) != up: st.append((last, y)); up = not up
                if up:
                    while len(st) >= 3 and v >= st[-2][0]: del st[-2:]
                else:
                    while len(st) >= 4 and v <= st[-2][0]: del st[-2:]
                y = branch(st[-1], st[-2] if len(st) > 1 else top, v); last = v
            out[i] = y
        return out
    return run


def takacs(rng):
    """Tanh branches as of Takacs, scaled into the box of the last two reversals; small loops are straighter than large ones."""
    b, c, k = rng.uniform(2.2, 3.2), rng.uniform(.6, .75), rng.uniform(.5, .75); t0, t1 = math.tanh(-b * c), math.tanh(b * (1 - c))
    def branch(p, q, v):
        w = q[0] - p[0]; s = (v - p[0]) / w; kap = k * min(abs(w), 1.0) ** .6
        return p[1] + (q[1] - p[1]) * ((1 - kap) * s + kap * (math.tanh(b * (s - c)) - t0) / (t1 - t0))
    return stack_law(branch, (1.0, 1.0))


def everett(E):
    """A law given by its Everett function E(higher, lower)."""
    return stack_law(lambda p, q, v: p[1] + E(v, p[0]) if v >= p[0] else p[1] - E(p[0], v), (1.0, 1.0))


def everett_power(rng):
    """Everett function of the difference only: a line and a power (Rayleigh's law for the power 2)."""
    p, b = rng.uniform(1.35, 2.2), rng.uniform(.35, .5)
    return everett(lambda a, c: (1 - b) * (a - c) + b * (a - c) ** p)


def everett_hill(rng):
    """Everett function with a hill along the diagonal: loops of one size are widest away from the middle of the range."""
    p, b, m, s = rng.uniform(1.4, 1.8), rng.uniform(.4, .5), rng.uniform(.8, 1.2), rng.uniform(.5, .8)
    return everett(lambda a, c: (1 - b) * (a - c) + b * (a - c) ** p * (.4 + .6 * math.exp(-((a + c - m) / s) ** 2)))


def domain_wall(rng):
    """Seventy domain walls in pinning potentials: each stays in its minimum until that minimum vanishes, then jumps."""
    M, G = 70, 1800; z = np.linspace(-.35, 1.35, G); F = np.tile(z, (M, 1)); A = rng.uniform(.03, .3, M)
    for i in range(M):
        q = rng.uniform(8, 60, 14); F[i] += A[i] * (np.sin(PI2 * np.outer(z, q) + rng.uniform(0, PI2, 14)) / np.sqrt(7) ** 1.0 * .7).sum(1)
    F[:, 0] = -9; F[:, -1] = 9; ar = np.arange(M)
    def run(x, **_):
        j = np.ones(M, int); out = np.empty(len(x)); last = None
        for i, h in enumerate(x.tolist()):
            if h != last:
                up = last is None or h > last
                while True:
                    m = F[ar, j] < h if up else F[ar, j - 1] > h
                    if not m.any(): break
                    j = j + m if up else j - m
                last = h
            out[i] = z[j].mean()
        return .35 * x + .65 * out
    return run


LAWS = {"play-few": play_few, "play-dense": play_dense, "maxwell-slip": maxwell_slip, "relays-lumps": relays_lumps, "relays-ring": relays_ring,
        "krasnoselskii-pokrovskii": kp, "generalized-play": genplay, "coleman-hodgdon": coleman_hodgdon, "duhem-tanh": duhem_tanh,
        "bouc-wen": bouc_wen, "dahl": dahl, "jiles-atherton": jiles_atherton, "takacs": takacs, "everett-power": everett_power,
        "everett-hill": everett_hill, "domain-wall": domain_wall}
PLAYS = ("play-few", "play-dense", "maxwell-slip")


def make_law(name, rng):
    """Returns run(x), normalised so that the settled loop over the whole range goes from 0 to 1."""
    run = LAWS[name](rng); g = np.linspace(0, 1, 400); p = run(np.concatenate([g, g[::-1], g, g[::-1]])); y1, y0 = p[1199], p[1599]
    return lambda x, **kw: (run(x, **kw) - y0) / (y1 - y0)


# ------------------------------------------------------------------------------------------------ drives
def wave(kind, t, f, T, rng):
    """Returns the waveform at times t (negative times: before the record), 0..1."""
    if kind == "sine": return .5 - .5 * np.cos(PI2 * f * t)
    if kind == "sinem": return .5 + .5 * np.sin(PI2 * f * t)
    if kind == "tri": return 1 - np.abs(1 - 2 * np.mod(f * t, 1))
    if kind == "afm": return .5 - np.arcsin(.985 * np.cos(PI2 * f * t)) / 2 / np.arcsin(.985)      # triangle with rounded reversals
    if kind == "saw": p = np.mod(f * t, 1); return np.where(p < .82, p / .82, (1 - p) / .18)
    if kind == "chirp":
        R = 12.0; ph = np.where(t < 0, f * t, f * T / np.log(R) * (R ** (np.clip(t, 0, None) / T) - 1)); return .5 - .5 * np.cos(PI2 * ph)
    if kind == "decay": return .5 - .5 * np.clip(1 - np.maximum(t, 0) / (1.02 * T), 0, 1) * (2 * np.abs(1 - 2 * np.mod(f * t, 1)) - 1)
    if kind == "grow": return .5 - .5 * (.15 + .85 * np.clip(t / T, 0, 1)) * np.cos(PI2 * f * t)
    if kind in ("walk", "multi"):
        n = 70 if kind == "walk" else 7; q = f * (np.exp(rng.uniform(np.log(.04), 0, n)) if kind == "walk" else np.array([.13, .29, .41, .57, .73, .91, 1.]))
        a = q ** -.5 * rng.uniform(.5, 1.2, n); ph = rng.uniform(0, PI2, n); x = np.zeros(len(t))
        for i in range(n): x += a[i] * np.sin(PI2 * q[i] * t + ph[i])
        return (x - x.min()) / (x.max() - x.min())
    if kind == "minor":
        q = rng.uniform(.13, .19); g = lambda p: 2 * np.abs(1 - 2 * np.mod(p, 1)) - 1
        x = 1 - np.abs(1 - 2 * np.mod(f * t, 1)) - q * g(11 * f * t); return np.clip((x + q) / (1 + 2 * q), 0, 1)
    if kind in ("stairs", "steps"):
        k = np.floor(f * t).astype(int); k -= k.min(); n = k.max() + 2; h = int(rng.integers(5, 8)); i = np.arange(n + 1)
        lv = (h - np.abs(np.mod(i, 2 * h) - h)) / h if kind == "stairs" else np.where(i % 5 == 0, rng.choice([0, 1.], n + 1), rng.uniform(0, 1, n + 1))
        if kind == "stairs": lv = np.clip(lv + np.where((lv > 0) & (lv < 1), rng.uniform(-.3, .3, n + 1) / h, 0), 0, 1)
        e = np.clip((f * t - np.floor(f * t)) / .012, 0, 1); return lv[k] + (lv[k + 1] - lv[k]) * e
    raise ValueError(kind)


SETS = {  # (waveform, factor of f, periods, lowest, highest, factor of the sample rate)
    "sine1": [("sine", 1, 9, 0, 1, 1)], "sinem1": [("sinem", 1, 9, .02, .98, 1)], "sine1s": [("sine", 1.4, 7, .1, .8, 1)],
    "long": [("sine", 1, 16, 0, 1, 1)], "longtri": [("tri", 1, 14, 0, 1, 1)],
    "sines3": [("sine", 1, 4, 0, 1, 1), ("sine", 3, 8, 0, .6, 1), ("sine", 9, 24, .15, .95, 1)],
    "sines4": [("sine", 1, 3, 0, 1, 1), ("sine", 4, 8, 0, 1, 1), ("sine", 15, 30, 0, 1, 1), ("sine", 8, 14, .2, .7, 1)],
    "sinesR": [("sine", 1, 4, 0, 1, 1), ("sine", 5, 8, .05, .8, 5), ("sine", 20, 24, 0, 1, 20)],
    "triR": [("tri", 1, 3, 0, 1, 1), ("afm", 10, 16, 0, 1, 10)], "afm1": [("afm", 1, 12, 0, 1, 1)], "tri1": [("tri", 1, 10, 0, 1, 1)],
    "afm2": [("tri", 1, 4, 0, 1, 1), ("afm", 6, 20, .1, .9, 1)], "saw": [("saw", 1, 10, 0, .95, 1)],
    "stairs": [("stairs", 1, 26, 0, 1, 1)], "steps": [("steps", 1, 22, 0, 1, 1)], "steps2": [("steps", 1, 14, .05, .95, 1), ("tri", .5, 4, 0, 1, 1)],
    "stairchirp": [("stairs", 1, 18, 0, 1, 1), ("chirp", 4, 16, 0, 1, 10)], "stairwalk": [("stairs", 1, 20, 0, 1, 1), ("walk", 2, 40, 0, 1, 1)],
    "chirp": [("chirp", 1, 14, 0, 1, 1)], "chirp2": [("chirp", 1, 10, 0, 1, 1), ("decay", 1.5, 12, 0, 1, 1)],
    "chirpR": [("decay", 1, 10, 0, 1, 1), ("chirp", 8, 24, 0, 1, 16)], "walk": [("walk", 1, 60, 0, 1, 1)], "walk2": [("walk", .8, 30, 0, 1, 1), ("tri", .5, 4, 0, 1, 1)],
    "walks": [("walk", .85, 30, .05, .95, 1)], "multi": [("multi", 1, 26, 0, 1, 1)], "decay": [("decay", 1, 14, 0, 1, 1)], "decays": [("decay", 1.1, 9, .1, .9, 1)],
    "minor": [("minor", .25, 3, 0, 1, 1)], "minor1": [("minor", .3, 1.5, .05, .95, 1)], "grow": [("grow", 1, 10, 0, 1, 1)], "tris": [("tri", 1.2, 6, .1, .85, 1)],
    "mixR": [("minor", .25, 1, 0, 1, 1), ("multi", 5, 30, 0, 1, 5)], "stairss": [("stairs", 1.1, 15, .06, .94, 1)], "stepss": [("steps", 1, 12, .05, .95, 1)]}


def drive(spec, f, fs, start, wander, os_, rng, slow=1.0):
    """Returns the blocks of the fine drive as a dict: x, t, slices of the blocks with their steps, recorded indices and segments.

    start: rest (minutes at the first voltage, nothing before), used (driven, then rest), mid (the waveform ran before), lost (random
    moves, no rest). Gaps between segments are smooth moves; with wander the actuator makes random moves in them."""
    X, D, rec, seg, tseg = [], [], [], [], []; last = 0.0; clock = 0.0; n0 = 0
    def add(x, dt): nonlocal last, clock, n0; X.append(np.asarray(x, float)); D.append(dt); last = X[-1][-1]; clock += dt * len(x); n0 += len(x)
    def move(to, T, n=60): add(last + (to - last) * (.5 - .5 * np.cos(np.pi * np.arange(1, n + 1) / n)), T / n)
    for k, (kind, kf, cyc, lo, hi, kfs) in enumerate(spec):
        F, FS = f * kf * slow, fs * kfs; dt = 1 / FS; n = int(round(cyc / F * FS)); dtf = dt / os_; pre = 0
        if k == 0 and start == "mid": pre = int(rng.uniform(1.3, 2.9) / F * FS) * os_ if kind not in ("walk",) else int(6 / F * FS) * os_
        t = (np.arange(n * os_ + pre) - pre) * dtf; w = lo + (hi - lo) * wave(kind, t, F, n * dt, rng)
        if k == 0 and start == "mid" and kind in ("sine", "sinem", "tri", "afm", "saw"): pass
        if kind in ("walk", "multi") and not pre: r = np.clip(t / (.05 * n * dt), 0, 1); w = w[0] + (w - w[0]) * r * r * (3 - 2 * r)
        if k == 0:
            if start != "rest":
                for a in rng.uniform(0, 1, 3): move(1.0 if rng.random() < .4 else a, .5 / f); move(0.0 if rng.random() < .4 else .5 * a, .5 / f)
            move(w[0], .7 / f)
            if start in ("rest", "used"): add(np.full(40, w[0]), max(5 / f, 60.0) / 40)
            if pre: add(w[:pre], dtf); w = w[pre:]
            clock = -dtf; 
        else:
            if wander: move(rng.uniform(.5, 1), .4 / f); move(rng.uniform(0, .4), .4 / f)
            m = 60; g = (.1 if f > .4 else 1.0); goal = np.ceil((clock + .5 / f) / g + 1) * g; T = goal - dtf - clock
            move(w[0], T)
        tseg.append(round(clock + dtf, 6)); i0 = n0; add(w, dtf); rec.append(i0 + np.arange(n) * os_); seg.append(np.full(n, k))
    t = np.concatenate([np.full(len(x), d) for x, d in zip(X, D)]).cumsum(); x = np.clip(np.concatenate(X), 0, 1); t -= t[rec[0][0]]
    tt = np.concatenate([t0 + np.arange(len(r)) / (fs * s[5]) for t0, r, s in zip(tseg, rec, spec)])
    ends = np.cumsum([len(b) for b in X]); rec = np.concatenate(rec)
    assert np.abs(t[rec] - tt).max() < 1e-6 * max(1, tt[-1])
    return dict(x=x, t=t, blocks=[(e - len(b), e, d) for e, b, d in zip(ends, X, D)], rec=rec, seg=np.concatenate(seg), tr=tt, T=tt[-1], n=len(rec))


# ------------------------------------------------------------------------------------------------ linear dynamics
def pole(D, u, p):
    """Solves z' = p z + u over the blocks, exact for u linear between samples; starts in equilibrium."""
    z = -u[0] / p; prev = u[0]; out = np.empty(len(u), complex if isinstance(p, complex) else float)
    for a, b, dt in D["blocks"]:
        q = p * dt; E = np.exp(q); g1 = (E - 1 - q) / (p * q) if abs(q) > 1e-3 else dt * (.5 + q / 6); g0 = (E - 1) / p - g1 if abs(q) > 1e-3 else dt * (.5 + q / 3)
        v = np.concatenate([[prev], u[a:b]]); o, _ = lfilter([1.0], [1.0, -E], g0 * v[:-1] + g1 * v[1:], zi=np.array([E * z])); out[a:b] = o; z = o[-1]; prev = u[b - 1]
    return out


def low(D, u, tau): return pole(D, u, -1 / tau) / tau


def mode(D, u, hz, zeta):
    """Second-order system with unit gain, as one complex pole."""
    w = PI2 * hz; wd = w * np.sqrt(1 - zeta ** 2); return 2 * np.real(pole(D, u, complex(-zeta * w, wd)) * w * w / (2j * wd))


# ------------------------------------------------------------------------------------------------ effects
def surroundings(D, spec, rng):
    """Returns temperature and force over the fine time; they do not depend on the drive."""
    s = D["t"] / D["T"]; T0 = rng.uniform(20, 27); A = spec.get("swing", 0); a, b = rng.uniform(.9, 1.7), rng.uniform(2.2, 3.6); p = rng.uniform(0, PI2, 2)
    temp = T0 + A * (.42 * np.sin(PI2 * a * s + p[0]) + .14 * np.sin(PI2 * b * s + p[1]))
    if spec.get("same_T0") is not None: temp += spec["same_T0"] - T0
    F = spec.get("force", 0); kind = spec.get("force_kind", "walk"); n = 9
    if kind == "weights": lv = rng.uniform(0, 1, 40); k = np.clip(np.floor(np.maximum(s, 0) * n).astype(int), 0, 39); force = F * low(D, lv[k], D["T"] / 900)
    else: q = rng.uniform(2, 11, 8); force = F * (.5 + .5 * np.tanh(.45 * sum(np.sin(PI2 * f * s + h) for f, h in zip(q, rng.uniform(0, PI2, 8)))))
    return temp, force


def busy(kind):
    """Returns the approximate highest relevant frequency of a waveform, divided by its f."""
    return 12 if kind == "chirp" else 11 if kind == "minor" else 5 if kind in ("tri", "saw", "afm", "decay") else 1


def defaults(name, kind, f, D, fs, rng):
    """Returns the first guess of an effect: parameters, the parameter that sets its size, its power in the residual, bounds."""
    T = D["T"]; U = rng.uniform; hi = f * D["fmax"]
    if name == "lag": return dict(kind=kind or "output", tau_s=.05 / (PI2 * hi)), "tau_s", 1, (1e-6, .8 / (PI2 * hi))
    if name == "delay": return dict(seconds=.04 / (PI2 * hi)), "seconds", 1, (1e-6, .8 / (PI2 * hi))
    if name == "resonance": return dict(hz=min(fs * D["kmax"] / U(9, 14), 60 * hi), zeta=round(U(.012, .05), 4)), "hz", -1, ((1.8 if D["fmax"] > 5 else 2.5) * hi, fs * D["kmax"] / 7)
    if name == "creep":
        kind = kind or "log"; p = dict(kind=kind, fraction=.08)
        if kind == "log": p.update(tmin_s=T / 400, tmax_s=5 * T)
        if kind == "few": p.update(taus_s=[round(T * q, 4) for q in ([U(.012, .03), U(.15, .5)] if U() < .5 else [U(.01, .02), U(.05, .08), U(.3, .7)])])
        if kind == "fractional": p.update(exponent=U(.15, .35), tmin_s=T / 500, tmax_s=6 * T)
        return p, "fraction", 1, (.01, .22)
    if name == "rate-dependence":
        kind = kind or "power"; p = dict(kind=kind, kappa=.03, vref_per_s=2 * f)
        if kind == "power": p["power"] = round(U(.25, .6), 3)
        if kind == "root": p["power"] = .5
        if kind == "threshold-power": p["power"] = round(U(.3, .7), 3)
        return p, "kappa", 1, (.002, .6)
    if name == "temperature":
        kind = kind or "gain"; return dict(kind=kind, per_K=.004, lag_s=T / 25 if "lagged" in kind else 0), "per_K", 1, (.0002, .06)
    if name == "drift":
        kind = kind or "line"; return dict(kind=kind, fraction=.02, tau_s=T * U(.2, .4) if kind == "settling" else None), "fraction", 1, (.002, .3)
    if name == "load": return dict(kind=kind or "compliance", per_N=.001), "per_N", 1, (1e-5, .02)
    if name == "saturation": return dict(kind=kind or "stop", cut=.12), "cut", 1.3, (.03, .3)
    if name == "asymmetry": return dict(kind=kind or "outcurve", amount=.06), "amount", 1, (.01, .3)
    if name == "interference":
        n = fs; hz = (U(49.9, 50.1) if kind == "mains" else U(59.9, 60.1) if kind == "us" else n / U(7, 23))
        return dict(kind=kind or "tone", hz=hz, fraction=.005, harmonics=[1, .0, .35] if kind and 3 * hz < .5 * n else [1]), "fraction", 1, (.0005, .1)
    if name == "telegraph": return dict(fraction=.01, rate_hz=14 / T), "fraction", 1, (.001, .1)
    if name == "stickslip": return dict(fraction=.03), "fraction", 1, (.004, .12)
    if name == "gainstep": return dict(fraction=.02, at=[U(.35, .6), U(.4, .7)]), "fraction", 1, (.003, .15)
    raise ValueError(name)


def plant(C, D, eff, temp, force, cache, part):
    """Returns the clean output (0..1 of the stroke) over the fine time with the effects eff."""
    x, t = D["x"], D["t"]; kw = {}; e = eff.get
    if (a := e("lag")) and a["kind"] == "input": x = low(D, x, a["tau_s"])
    if (a := e("saturation")) and a["kind"] == "rail": x = np.minimum(x, 1 - a["cut"])
    if (a := e("asymmetry")) and a["kind"] == "incurve": x = x + a["amount"] * 4 * x * (1 - x) * (.5 + x) * .7
    if (a := e("asymmetry")) and a["kind"] == "branch": kw["bend"] = a["amount"]
    v = np.gradient(x, t) if "rate-dependence" in eff else None; a = e("rate-dependence"); vr = a and np.abs(v) / a["vref_per_s"]
    if a and a["kind"] == "threshold-log": kw["scale"] = 1 + a["kappa"] * np.log(1 + 3 * vr)
    if a and a["kind"] == "threshold-power": kw["scale"] = 1 + a["kappa"] * vr ** a["power"]
    key = (part,) if x is D["x"] and not kw else None
    y = cache.get(key) if key else None
    if y is None:
        y = C["run"](x, **kw)
        if key: cache[key] = y
    if a and a["kind"] in ("power", "root"): y = y - a["kappa"] * np.sign(v) * vr ** a["power"]
    if a and a["kind"] == "width-log": y = x + (y - x) * (1 + a["kappa"] * np.log(1 + 3 * vr))
    b = e("temperature")
    if b:
        th = temp - 23.0; th = low(D, th, b["lag_s"]) if b["lag_s"] else th
        if "gain" in b["kind"]: y = y * (1 + b["per_K"] * th)
        if "width" in b["kind"]: y = x + (y - x) * (1 + 4 * b["per_K"] * th)
    g = e("load")
    if g and g["kind"] == "stiffness": y = y * (1 - g["per_N"] * force)
    if (a := e("asymmetry")) and a["kind"] == "outcurve": y = y + a["amount"] * 4 * y * (1 - y)
    if (a := e("asymmetry")) and a["kind"] == "cubic": y = y + a["amount"] * 8 * (y - .5) * y * (1 - y)
    if (a := e("creep")):
        taus = a.get("taus_s") or np.geomspace(a["tmin_s"], a["tmax_s"], 22); w = np.ones(len(taus)) if a["kind"] != "fractional" else np.power(taus, a["exponent"])
        w = a["fraction"] * w / w.sum() * (1 if a["kind"] == "few" else 1.6); y = y + sum(k * low(D, y, q) for k, q in zip(w, taus))
    if g and g["kind"] == "compliance": y = y - g["per_N"] * force
    if b and "zero" in b["kind"]: y = y + b["per_K"] * th
    if (a := e("saturation")) and a["kind"] != "rail":
        c = a["cut"]
        if a["kind"] in ("stop", "both"): y = np.minimum(y, 1 - c)
        if a["kind"] in ("both",): y = np.maximum(y, .6 * c)
        if a["kind"] == "soft": s = .02; y = y - s * np.logaddexp(0, (y - 1 + c) / s)
    if (a := e("resonance")): y = mode(D, y, a["hz"], a["zeta"])
    if (a := e("stickslip")):
        o = np.empty(len(y)); m = y[0]; d = a["fraction"]
        for i, q in enumerate(y.tolist()):
            if q - m > d or m - q > d: m = q
            o[i] = m
        y = o
    if (a := e("gainstep")): s = t / D["T"]; y = y * (1 - a["fraction"] * (s > a["at"][part == "test"]))
    if (a := e("lag")) and a["kind"] == "output": y = low(D, y, a["tau_s"])
    if (a := e("delay")): y = np.interp(t - a["seconds"], t, y)
    if (a := e("drift")):
        s = np.maximum(t, 0); T = a["span_s"]
        y = y + a["fraction"] * (s / T if a["kind"] == "line" else np.sqrt(s / T) if a["kind"] == "sqrt" else 1 - np.exp(-s / a["tau_s"]))
    if (a := e("interference")): y = y + a["fraction"] * sum(h * np.sin(PI2 * a["hz"] * (i + 1) * t + 1.3 * i + C["phase"] * (1 + (part == "test"))) for i, h in enumerate(a["harmonics"]) if h)
    if (a := e("telegraph")):
        r = np.random.default_rng(C["seed"] + (part == "test")); T = r.exponential(1 / a["rate_hz"], 4000).cumsum(); y = y + a["fraction"] * (np.searchsorted(T, np.maximum(t, 0)) % 2)
    return y


def noise(C, n, part):
    """Returns additive noise as a fraction of the stroke; the quantisation is applied when the file is written."""
    r = np.random.default_rng(C["seed"] * 3 + 11 * (part == "test")); s = C["sigma"]; k = C["noise"]; e = r.normal(0, s, n)
    if k == "pink":
        F = np.fft.rfft(r.normal(0, 1, n)); q = np.arange(len(F)); q[0] = 1; p = np.fft.irfft(F / np.maximum(q, 3) ** .5, n); e = .6 * e + .8 * s * p / p.std()
    if k == "spikes": i = r.choice(n, max(4, n // 1500), replace=False); e[i] += r.choice([-1, 1], len(i)) * s * r.uniform(8, 25, len(i))
    return e


# ------------------------------------------------------------------------------------------------ check: remainder after an ordinary fit
def projector(C, D):
    """Returns an orthonormal basis of the outputs of an ordinary model on the training record (with known history)."""
    os_ = C["os"]; first = D["rec"][0]; idx = np.concatenate([np.arange(0, first, os_), D["rec"]]); inside = np.zeros(len(D["x"]), bool); inside[idx] = True
    for a, b, d in D["blocks"]:
        if not inside[a:b].any(): inside[a:b] = True
    idx = np.flatnonzero(inside); x = D["x"][idx]; keep = np.isin(idx, D["rec"]); rows = np.cumsum(keep) - 1; st = max(1, D["n"] // 3500)
    use = keep & (rows % st == 0)
    if C["model"] == "pi": r = np.linspace(.008, .95, 40) ** 1.3; lo, hi = x[:, None] - r, x[:, None] + r; z = np.zeros(len(r))
    else:
        g = np.linspace(-.06, 1, 21); A, B = np.meshgrid(g, g); k = A >= B; w = g[1] - g[0]
        lo, hi = np.clip((x[:, None] - A[k]) / w, 0, 1), np.clip((x[:, None] - B[k]) / w, 0, 1); z = np.zeros(k.sum())
    Z = []
    for i in range(len(x)):
        z = np.minimum(np.maximum(z, lo[i]), hi[i])
        if use[i]: Z.append(z)
    M = np.column_stack([np.array(Z), x[use], np.ones(use.sum())]); U, s, _ = np.linalg.svd(M, full_matrices=False); Q = U[:, s > 1e-5 * s[0]]
    def resid(y): d = y[D["rec"]][::st]; return float(np.std(d - Q @ (Q.T @ d)))
    return resid


# ------------------------------------------------------------------------------------------------ the cases
# name, law, model, effects ("name:kind"), train, test, base frequency, sample rate, start, volts, options
TABLE = [
 ("plain", "play-few", "pi", "", "sines3", "walks", 1, 500, "rest", 0, {"noise": "white"}),
 ("plain-warm", "play-dense", "pi", "", "afm2", "tris", .1, 100, "mid", 1, {"noise": "pink", "swing": 9}),
 ("plain-stairs", "maxwell-slip", "pi", "", "stairs", "stairss", 2, 400, "rest", 2, {"noise": "quant"}),
 ("plain-one-sine", "dahl", "pi", "", "sine1", "sine1s", 5, 2000, "mid", 3, {"noise": "white"}),
 ("plain-walk", "everett-power", "pi", "", "walk", "decays", 8, 1000, "lost", 4, {"noise": "spikes"}),
 ("plain-lumps", "relays-lumps", "preisach", "", "decay", "minor1", 1, 500, "used", 1, {"noise": "pink"}),
 ("plain-loaded", "relays-ring", "preisach", "", "minor", "walks", .4, 200, "mid", 0, {"noise": "white", "force": 40}),
 ("plain-steps", "krasnoselskii-pokrovskii", "preisach", "", "steps2", "stepss", 2, 500, "rest", 2, {"noise": "quant"}),
 ("plain-rates", "generalized-play", "preisach", "", "sinesR", "triR", .5, 100, "mid", 3, {"noise": "spikes"}),
 ("plain-ja", "jiles-atherton", "preisach", "", "sines3", "decays", 2, 1000, "used", 4, {"noise": "pink"}),
 ("plain-takacs", "takacs", "preisach", "", "minor", "walks", 1, 500, "lost", 1, {"noise": "quant"}),
 # one effect
 ("lag-chirp", "play-dense", "pi", "lag", "chirp2", "grow", 5, 1000, "rest", 0, {}),
 ("lag-amp", "krasnoselskii-pokrovskii", "preisach", "lag:input", "sinesR", "multi", 1, 250, "mid", 1, {}),
 ("lag-walk", "domain-wall", "pi", "lag", "walk2", "sine1s", 20, 2000, "lost", 2, {}),
 ("delay-chirp", "relays-lumps", "preisach", "delay", "chirp", "sine1s", 10, 2500, "used", 3, {}),
 ("delay-afm", "bouc-wen", "pi", "delay", "afm2", "tris", 8, 4000, "mid", 4, {}),
 ("delay-multi", "everett-hill", "preisach", "delay", "multi", "walks", 20, 2000, "lost", 0, {}),
 ("mode-afm", "coleman-hodgdon", "pi", "resonance", "afm2", "tris", 8, 10000, "mid", 1, {}),
 ("mode-steps", "takacs", "preisach", "resonance", "steps", "stepss", 20, 5000, "rest", 2, {}),
 ("mode-chirp", "everett-power", "pi", "resonance", "chirpR", "tris", 2, 250, "used", 3, {}),
 ("mode-saw", "duhem-tanh", "preisach", "resonance", "saw", "tris", 40, 20000, "mid", 4, {}),
 ("creep-stairs", "maxwell-slip", "pi", "creep:log", "stairs", "stairss", .25, 50, "rest", 0, {}),
 ("creep-steps", "relays-ring", "preisach", "creep:few", "steps2", "stepss", .2, 50, "lost", 1, {}),
 ("creep-minor", "play-few", "pi", "creep:fractional", "stairwalk", "walks", .5, 100, "used", 2, {}),
 ("creep-rates", "jiles-atherton", "preisach", "creep:log", "stairchirp", "stairss", .2, 50, "rest", 4, {}),
 ("rate-sines", "play-dense", "pi", "rate-dependence:threshold-log", "sines4", "walks", 2, 2000, "rest", 1, {}),
 ("rate-split", "maxwell-slip", "pi", "rate-dependence:threshold-power", "sinesR", "mixR", .5, 100, "mid", 0, {}),
 ("rate-root", "everett-hill", "preisach", "rate-dependence:root", "sines4", "grow", 3, 2000, "used", 2, {}),
 ("rate-width", "krasnoselskii-pokrovskii", "preisach", "rate-dependence:width-log", "chirpR", "sine1s", 1, 250, "mid", 3, {}),
 ("rate-power", "dahl", "pi", "rate-dependence:power", "triR", "tris", 1, 200, "lost", 4, {}),
 ("warm-load", "play-few", "pi", "temperature:gain load:compliance", "long", "tris", .1, 50, "rest", 0, {"swing": 12, "force": 30}),
 ("warm-zero", "takacs", "preisach", "temperature:zero-lagged", "longtri", "walks", .08, 50, "mid", 1, {"swing": 8}),
 ("warm-width", "generalized-play", "preisach", "temperature:width", "long", "sine1s", .1, 50, "used", 3, {"swing": 18}),
 ("drift-line", "domain-wall", "pi", "drift:line", "sinem1", "sine1s", 1, 200, "mid", 4, {}),
 ("drift-tone", "everett-hill", "preisach", "drift:settling interference", "sine1", "walks", .5, 100, "lost", 1, {}),
 ("drift-sqrt", "coleman-hodgdon", "pi", "drift:sqrt", "tri1", "sine1s", .2, 50, "rest", 2, {}),
 ("load-weights", "bouc-wen", "pi", "load:compliance", "tri1", "sine1s", .5, 200, "mid", 0, {"force": 60, "force_kind": "weights"}),
 ("load-stiff", "relays-lumps", "preisach", "load:stiffness", "long", "tris", .5, 100, "used", 1, {"force": 45}),
 ("load-walk", "duhem-tanh", "preisach", "load:compliance", "walk", "grow", 2, 200, "lost", 2, {"force": 25}),
 ("stop-top", "dahl", "pi", "saturation:stop", "minor", "decays", 2, 500, "rest", 1, {}),
 ("rail", "play-dense", "pi", "saturation:rail", "sines3", "grow", 1, 400, "used", 3, {}),
 ("stop-both", "everett-power", "pi", "saturation:both", "decay", "walks", 3, 1000, "mid", 4, {}),
 ("bent-output", "play-few", "pi", "asymmetry:outcurve", "decay", "minor1", 1, 250, "mid", 0, {}),
 ("bent-branch", "play-dense", "pi", "asymmetry:branch", "minor", "tris", 1, 400, "rest", 2, {}),
 ("bent-drift", "maxwell-slip", "pi", "asymmetry:cubic drift:line", "walk", "decays", 3, 500, "lost", 1, {}),
 ("hum-stop", "dahl", "pi", "interference:mains saturation:stop", "sine1", "sine1s", 1, 1000, "mid", 0, {}),
 ("tone", "krasnoselskii-pokrovskii", "preisach", "interference", "stairs", "stairss", 4, 500, "used", 4, {}),
 ("odd-telegraph", "everett-power", "preisach", "telegraph", "sines3", "tris", 1, 400, "mid", 1, {}),
 ("odd-stickslip", "coleman-hodgdon", "preisach", "stickslip", "grow", "tris", 1, 500, "rest", 0, {}),
 ("odd-gainstep", "relays-ring", "preisach", "gainstep", "long", "grow", 1, 200, "used", 2, {}),
 # two effects
 ("creep-mode", "domain-wall", "pi", "creep:log resonance", "stairs", "stairss", 5, 2000, "rest", 0, {}),
 ("lag-warm", "play-few", "pi", "lag temperature:gain", "sines4", "walks", .08, 50, "mid", 1, {"swing": 11}),
 ("creep-hum", "jiles-atherton", "preisach", "creep:few interference:us", "stairs", "stairss", 1, 500, "lost", 2, {}),
 ("delay-load", "everett-hill", "preisach", "delay load:compliance", "sines4", "multi", 2, 1000, "used", 3, {"force": 30}),
 ("drift-mode", "duhem-tanh", "preisach", "drift:settling resonance", "chirp2", "tris", 10, 5000, "mid", 4, {}),
 ("creep-rate", "maxwell-slip", "pi", "creep:log rate-dependence:threshold-log", "stairchirp", "stairss", .3, 100, "rest", 0, {}),
 ("bent-creep", "play-dense", "pi", "asymmetry:outcurve creep:fractional", "stairwalk", "walks", .4, 100, "used", 3, {}),
 ("bent-lag", "everett-power", "pi", "asymmetry:incurve lag", "chirp2", "grow", 5, 2000, "mid", 1, {}),
 ("stop-drift", "bouc-wen", "pi", "saturation:soft drift:line", "sines3", "decays", 1, 250, "lost", 4, {}),
 ("load-mode", "bouc-wen", "pi", "load:stiffness resonance", "saw", "tris", 10, 5000, "mid", 2, {"force": 50}),
 ("rate-tone", "krasnoselskii-pokrovskii", "preisach", "rate-dependence:power interference", "mixR", "grow", 2, 500, "used", 0, {}),
 ("creep-warm-hum", "relays-lumps", "preisach", "creep:log temperature:zero interference:mains", "stairwalk", "walks", .4, 250, "rest", 1, {"swing": 9}),
 ("lag-drift-load", "play-few", "pi", "lag drift:line load:compliance", "sinesR", "walks", .5, 100, "mid", 3, {"force": 35, "force_kind": "weights"}),
 ("mode-creep-load", "generalized-play", "preisach", "resonance creep:few load:compliance", "steps", "stepss", 5, 2000, "used", 2, {"force": 20}),
]
VOLTS = [(0, 100), (-10, 10), (0, 150), (-30, 150), (0, 1000)]
CURVED = ("generalized-play",)   # the loop itself saturates on one side: the name asymmetry is acceptable for the twin


def build(i, row, seed, out):
    name, law, model, effs, trn, tst, f, fs, start, vr, opt = row; rng = np.random.default_rng([seed, i]); wid = f"w{i + 1:02d}"
    vlo, vhi = VOLTS[vr]; stroke = round(float(np.exp(rng.uniform(np.log(2 if vr == 1 else 8), np.log(40 if vr == 1 else 200)))), 2)
    kind = opt.get("noise") or str(rng.choice(["white", "white", "pink", "quant", "spikes"]))
    C = dict(run=make_law(law, rng), model=model, sigma=float(np.exp(rng.uniform(np.log(.0006), np.log(.0025)))), noise=kind, phase=rng.uniform(0, 6), seed=int(rng.integers(1 << 30)))
    C["sigma"] = max(C["sigma"], .0012 if law == "domain-wall" else 0) * (.4 if kind == "quant" else 1); lsb = 1.25 / 4096 if kind == "quant" else 1e-6; f = round(f * rng.uniform(.85, 1.2), 3)
    rows = sum(s[2] / s[1] * s[5] for s in SETS[trn]) * fs / f; C["os"] = os_ = 4 if rows < 9000 else 2
    wander = bool(rng.random() < .25); nseg = len(SETS[trn]); tstart = {"rest": "rest", "used": "used", "mid": "mid", "lost": "lost"}[start] if rng.random() < .75 else ("mid" if start == "rest" else "used")
    D = {"train": drive(SETS[trn], f, fs, start, wander, os_, np.random.default_rng(C["seed"] + 5))}
    a = D["train"]; rate = lambda d: np.abs(np.diff(d["x"][d["rec"]]) / np.maximum(np.diff(d["tr"]), 1e-9))
    stepped = any(s[0] in ("steps", "stairs") for s in SETS[trn]); vmax = rate(a).max(); lo, hi = a["x"][a["rec"]].min(), a["x"][a["rec"]].max()
    kfs = max(s[5] for s in SETS[trn]); k0 = SETS[tst]; slow = 1.0
    tfs = fs * (kfs if kfs > 1 and not stepped and max(s[5] for s in k0) == 1 else 1); tf = f * (2.5 if tfs > fs else 1)
    tfs = fs * min(kfs, 5) if tfs > fs else fs; tfs = tfs if abs(1e6 / tfs - round(1e6 / tfs)) < 1e-9 else fs
    for _ in range(8):     # the test stays within the rates and the range of the training
        b = drive(k0, tf, tfs, tstart, wander, os_, np.random.default_rng(C["seed"] + 6), slow)
        if rate(b).max() <= 1.02 * vmax: break
        slow *= max(.3, .97 * vmax / rate(b).max())
    fast = any(e in effs for e in ("lag", "delay", "resonance", "rate")) and not stepped or "test_f" in opt
    if fast and rate(b).max() < .6 * vmax:
        tfs = fs * kfs; most = tfs / 40 / max(tf * s[1] * (1 if busy(s[0]) == 5 else busy(s[0])) for s in k0); slow = max(slow, min(.8 * vmax / rate(b).max() * slow, most))
        n = sum(s[2] / s[1] * s[5] for s in k0) / (tf * slow) * tfs; m = max(1, math.ceil(1500 / n)); k0 = [(q[0], q[1], q[2] * m) + q[3:] for q in k0]
        b = drive(k0, tf, tfs, tstart, wander, os_, np.random.default_rng(C["seed"] + 6), slow)
    q = b["x"]; 
    if q[b["rec"]].min() < lo or q[b["rec"]].max() > hi:
        ql, qh = q.min(), q.max(); L = max(ql, lo); H = min(qh, hi); b["x"] = L + (q - ql) / (qh - ql) * (H - L)
    D["test"] = b
    a["fmax"] = max(s[1] * busy(s[0]) for s in SETS[trn]); a["kmax"] = kfs
    temp, force = {}, {}; o = dict(opt, same_T0=23.0 + rng.uniform(-1, 1))
    for p in D: temp[p], force[p] = surroundings(D[p], o, np.random.default_rng(C["seed"] + 20 + (p == "test")))
    cache = {}; none = plant(C, a, {}, temp["train"], force["train"], cache, "train"); res = projector(C, a); r0 = res(none); sg = max(C["sigma"], np.hypot(C["sigma"], lsb / 3.46)); info = []
    eff = {}
    for e in effs.split():
        en, _, ek = e.partition(":"); p, main, pw, (l, h) = defaults(en, ek, f, a, fs, rng); goal = float(np.exp(rng.uniform(np.log(6), np.log(30 if en != "creep" else 14)))); p = {k: v for k, v in p.items() if v is not None}
        if en == "drift": p["span_s"] = float(a["T"])
        for _ in range(5):
            r = res(plant(C, a, {en: p}, temp["train"], force["train"], cache, "train")); m = np.sqrt(max(r * r - r0 * r0, (.3 * sg) ** 2)) / sg
            if .75 < m / goal < 1.33: break
            new = float(np.clip(p[main] * np.clip((goal / m) ** (1 / pw), .2, 5), l, h))
            if new == p[main]: break
            p[main] = new
        r = res(plant(C, a, {en: p}, temp["train"], force["train"], cache, "train")); m = np.sqrt(max(r * r - r0 * r0, 0)) / sg
        info.append((en, main, p[main], m)); eff[en] = {k: (float(f"{v:.6g}") if isinstance(v, float) else v) for k, v in p.items()}
    accept = []; odd = {"telegraph", "stickslip", "gainstep"}; expect = [("unknown" if e in odd else e) for e in eff]
    if "lag" in eff or "delay" in eff:      # whether the record can distinguish a lag from a delay
        one = "lag" if "lag" in eff else "delay"; other = "delay" if one == "lag" else "lag"; y = plant(C, a, {one: eff[one]}, temp["train"], force["train"], cache, "train"); best = 9
        for k in np.linspace(.6, 1.6, 15):
            s = eff[one].get("tau_s", eff[one].get("seconds")) * k; al = {"delay": {"seconds": s}} if other == "delay" else {"lag": {"kind": "output", "tau_s": s}}
            best = min(best, res(y - plant(C, a, al, temp["train"], force["train"], cache, "train")) / sg)
        info.append((f"{one}-as-{other}", "", 0, best))
        if best < .35: accept.append([other if e == one else e for e in expect])
    if eff.get("saturation", {}).get("kind") == "soft": accept.append(["asymmetry" if e == "saturation" else e for e in expect])
    if law in CURVED: accept.append(expect + ["asymmetry"])
    # write
    d = os.path.join(out, f"{wid}-{name}"); os.makedirs(d, exist_ok=True); stats = {}; off = round(float(rng.choice([0, 0, rng.uniform(-.3, .3)])) * stroke, 3)
    for part in D:
        E = D[part]; n = noise(C, E["n"], part); rec = E["rec"]; y0 = none if part == "train" else plant(C, E, {}, temp[part], force[part], cache, part); y1 = plant(C, E, eff, temp[part], force[part], cache, part)
        nr = np.random.default_rng(C["seed"] + 40 + (part == "test")); cols = ["time_s", "voltage_v", "displacement_um"]; u = vlo + (vhi - vlo) * E["x"][rec]; u = np.round(u / ((vhi - vlo) / 65536)) * ((vhi - vlo) / 65536) if C["seed"] % 3 == 0 else u
        more, fmt = [], ["%.9g", "%.7g", "%.7g"]
        if "swing" in opt: cols.append("temperature_degc"); more.append(np.round((temp[part][rec] + nr.normal(0, .015, E["n"])) / .01) * .01); fmt.append("%.2f")
        if "force" in opt: cols.append("load_n"); more.append(force[part][rec] + nr.normal(0, .003 * opt["force"], E["n"])); fmt.append("%.5g")
        if len(set(E["seg"])) > 1 or i % 7 == 0: cols.append("segment"); more.append(E["seg"]); fmt.append("%d")
        for pre, y in (("", y1), ("twin-", y0)):
            z = np.round((y[rec] + n) / lsb) * lsb * stroke + off
            np.savetxt(f"{d}/{pre}{part}.csv", np.column_stack([E["tr"], u, z] + more), delimiter=",", header=",".join(cols), comments="", fmt=fmt)
        stats[part] = float(np.std((y1 - y0)[rec]) / sg)
    params = {e: dict(p, stroke_um=stroke) for e, p in eff.items()}
    json.dump(dict(id=wid, base=law, model=model, effects=params, expect=expect, accept=accept), open(f"{d}/truth.json", "w"), indent=1)
    s = f"{wid} {name:16s} {law:24s} {model:8s} {start:4s}/{tstart:4s} fs={sorted(set(float(fs * q[5]) for q in SETS[trn]))} rows={a['n']}/{b['n']} T={a['T']:.4g}/{b['T']:.4g}s noise={kind} {sg:.5f} base={r0 / sg:.1f} diff={stats['train']:.0f}/{stats['test']:.0f}"
    s += f" testrate={rate(b).max() / vmax:.2f} wander={int(wander and nseg > 1)} | " + "; ".join(f"{e} {m}={v:.4g} -> {k:.1f}{' <<<' if (k < 3 or k > 60) and '-as-' not in e else ''}" for e, m, v, k in info) + (f" accept={accept}" if accept else "")
    return s


if __name__ == "__main__":
    ap = argparse.ArgumentParser(); ap.add_argument("out"); ap.add_argument("--seed", type=int, required=True); ap.add_argument("--only", default=""); ap.add_argument("--report"); A = ap.parse_args(); only = set(A.only.split(",")) - {""}
    for i, row in enumerate(TABLE):
        if only and f"w{i + 1:02d}" not in only: continue
        t0 = time.time(); s = build(i, row, A.seed, A.out) + f" [{time.time() - t0:.0f}s]"; print(s, flush=True)
        if A.report: open(A.report, "a").write(s + "\n")
