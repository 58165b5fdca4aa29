#!/usr/bin/env python3
"""Independent examination set for a piezo diagnosis program: about 66 simulated actuators with other physics.

    python first.py OUT [--seed N] [id-prefix ...]

writes OUT/<id>/{train,test,twin-train,twin-test}.csv + truth.json and OUT/summary.csv (one row per case and effect). The twin is the
same actuator with the same drive and noise but none of the effects. Needs numpy, numba and scipy. One process.

Laws (field `base`): pi (continuous Prandtl-Ishlinskii by the Masing rule on the exact primary curve, or a bank with viscous walls),
preisach (Everett surface of non-Gaussian densities), kp (Krasnosel'skii-Pokrovskii ramps), ch (Coleman-Hodgdon/Duhem with nonlinear
curves), bw (Bouc-Wen), ja (Jiles-Atherton), dahl (generalised Dahl friction inside the elastic loop), walls (domain walls in random
pinning), rayleigh (hyperbolic Rayleigh law).

truth.json: id, base, model (to be fitted), effects, expect, accept (further accepted sets of names, [] if none), and the other
parameters. `accept` contains ["unknown"] for actuators without effects whose law a pi/preisach model cannot represent exactly
(Duhem class): there, "unexplained, no name" is true and a name is wrong.
summary.csv, per effect: raw_um = RMS of (all effects) - (all but this one), without noise, train record; left_um = the remainder
of that after the best linear refit of a generic basis (plays or preisach ramps), which no base model of that family can absorb;
misfit_um = the same basis on the clean twin.
"""
import csv, json, math, os, sys, time
for _k in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"): os.environ.setdefault(_k, "1")
import numpy as np, numba as nb
from scipy.signal import cont2discrete, lfilter

DEFAULT_SEED = 20417733
OS = 8                      # fine grid per sample

# =====================================================================================================================
# hysteresis laws, all on the normalised drive v (span 1) and from a rest state at v = 0
# =====================================================================================================================

@nb.njit(cache=True)
def _phi(x, kind, R):
    """Primary (virgin) curve of a play continuum; second derivative = density of thresholds."""
    if kind == 0:                       # exponential density
        return x - R * (1 - math.exp(-x / R))
    if kind == 1:                       # half-Cauchy density
        return R * x * math.atan(x / R) - 0.5 * R * R * math.log(1 + (x / R) ** 2)
    if kind == 2:                       # r exp(-r/R): no thresholds at zero
        e = math.exp(-x / R)
        return R * R * x - R ** 3 * (1 - e) - R * (R * R - (R * R + R * x) * e)
    return x * x / (1 + x / R)          # 3: hyperbolic Rayleigh


@nb.njit(cache=True)
def masing(v, kind, R):
    n = len(v); y = np.empty(n)
    sv = np.empty(20000); sy = np.empty(20000); k = 0
    vp = 0.0; yp = 0.0; ld = 0.0
    for i in range(n):
        x = v[i]; d = x - vp
        if d != 0.0:
            s = 1.0 if d > 0 else -1.0
            if ld != 0.0 and s != ld:
                sv[k] = vp; sy[k] = yp; k += 1
            ld = s
            while k > 0:
                if k >= 2:
                    if (x - sv[k - 2]) * s >= 0: k -= 2
                    else: break
                else:
                    if abs(x - sv[0]) >= 2 * abs(sv[0]) and (x - sv[0]) * sv[0] < 0: k = 0
                    else: break
            if k == 0:
                yp = _phi(abs(x), kind, R) * (1.0 if x >= 0 else -1.0)
            else:
                yp = sy[k - 1] + s * 2 * _phi(0.5 * abs(x - sv[k - 1]), kind, R)
            vp = x
        y[i] = yp
    return y


@nb.njit(cache=True)
def viscous_plays(v, dt, r, w, c, m):
    """Play operators with a non-Newtonian dashpot: overstress^m * c = speed of the element. c <= 0: no viscosity."""
    n = len(v); J = len(r); z = np.zeros(J); y = np.empty(n)
    for i in range(n):
        a = 0.0; x = v[i]
        for j in range(J):
            d = x - z[j]; o = abs(d) - r[j]
            if o > 0:
                s = 1.0 if d > 0 else -1.0
                if c > 0:
                    p = o
                    for _ in range(12):
                        q = dt * c * o ** (m - 1)
                        step = (o + q * o - p) / (1 + m * q); o -= step
                        if abs(step) < 1e-12: break
                    z[j] = x - s * (r[j] + o)
                else:
                    z[j] = x - s * r[j]
            a += w[j] * z[j]
        y[i] = a
    return y


@nb.njit(cache=True)
def _E(T, lo, h, N, a, b):
    fa = (a - lo) / h; fb = (b - lo) / h
    i = int(fa); j = int(fb)
    if i < 0: i = 0
    if j < 0: j = 0
    if i > N - 2: i = N - 2
    if j > N - 2: j = N - 2
    p = fa - i; q = fb - j
    return (1 - p) * (1 - q) * T[i, j] + p * (1 - q) * T[i + 1, j] + (1 - p) * q * T[i, j + 1] + p * q * T[i + 1, j + 1]


@nb.njit(cache=True)
def everett(v, T, lo, h):
    N = T.shape[0]; n = len(v); y = np.empty(n)
    e = np.empty(20000); ye = np.empty(20000); e[0] = lo; ye[0] = 0.0; k = 1; ld = 1.0
    vp = 0.0; yp = 2 * _E(T, lo, h, N, 0.0, lo)
    for i in range(n):
        x = v[i]; d = x - vp
        if d != 0.0:
            s = 1.0 if d > 0 else -1.0
            if s != ld:
                e[k] = vp; ye[k] = yp; k += 1; ld = s
            while k >= 3 and (x - e[k - 2]) * s >= 0: k -= 2
            if s > 0: yp = ye[k - 1] + 2 * _E(T, lo, h, N, x, e[k - 1])
            else: yp = ye[k - 1] - 2 * _E(T, lo, h, N, e[k - 1], x)
            vp = x
        y[i] = yp
    return y


@nb.njit(cache=True)
def kp_bank(v, s1, s2, a, w):
    n = len(v); J = len(s1); z = np.empty(J); y = np.empty(n); acc = 0.0
    for j in range(J):
        z[j] = -1.0
    vp = -10.0
    for j in range(J): acc += w[j] * z[j]
    for i in range(n):
        x = v[i]
        if x > vp:
            for j in range(J):
                q = 2 * (x - s2[j]) / a - 1
                if q > 1: q = 1.0
                if q > z[j]:
                    acc += w[j] * (q - z[j]); z[j] = q
        elif x < vp:
            for j in range(J):
                q = 2 * (x - s1[j]) / a - 1
                if q < -1: q = -1.0
                if q < z[j]:
                    acc += w[j] * (q - z[j]); z[j] = q
        vp = x; y[i] = acc
    return y


@nb.njit(cache=True)
def _fch(x, p):
    return p[0] * x + p[1] * math.tanh((x - p[2]) / p[3]) + p[4] * x * x


@nb.njit(cache=True)
def _dfch(x, p):
    t = math.tanh((x - p[2]) / p[3])
    return p[0] + p[1] * (1 - t * t) / p[3] + 2 * p[4] * x


@nb.njit(cache=True)
def coleman_hodgdon(v, alpha, p, g0, g1, mult):
    n = len(v); y = np.empty(n); z = _fch(v[0], p); y[0] = z
    for i in range(1, n):
        d = v[i] - v[i - 1]; a = alpha * mult[i]
        k1 = a * abs(d) * (_fch(v[i - 1], p) - z) + _dfch(v[i - 1], p) * (g0 + g1 * v[i - 1]) * d
        m = v[i - 1] + 0.5 * d
        k2 = a * abs(d) * (_fch(m, p) - z - 0.5 * k1) + _dfch(m, p) * (g0 + g1 * m) * d
        z += k2; y[i] = z
    return y


@nb.njit(cache=True)
def bouc_wen(v, n_, beta, gamma, lam):
    n = len(v); y = np.empty(n); z = 0.0; y[0] = v[0]
    for i in range(1, n):
        d = v[i] - v[i - 1]
        k1 = d - abs(z) ** n_ * (beta * abs(d) * (1.0 if z >= 0 else -1.0) + gamma * d)
        q = z + 0.5 * k1
        z += d - abs(q) ** n_ * (beta * abs(d) * (1.0 if q >= 0 else -1.0) + gamma * d)
        y[i] = v[i] - lam * z
    return y


@nb.njit(cache=True)
def _lang(x):
    if abs(x) < 1e-3: return x / 3.0
    return 1.0 / math.tanh(x) - 1.0 / x


@nb.njit(cache=True)
def _dlang(x):
    if abs(x) < 1e-2: return 1.0 / 3.0 - x * x / 15.0
    s = math.sinh(x)
    return 1.0 / (x * x) - 1.0 / (s * s)


@nb.njit(cache=True)
def jiles_atherton(v, a, k, c, al, mult):
    n = len(v); y = np.empty(n); M = 0.0; y[0] = 0.0
    for i in range(1, n):
        d = v[i] - v[i - 1]; s = 1.0 if d >= 0 else -1.0; kk = k * mult[i]; M0 = M; sl = 0.0
        for half in range(2):
            H = v[i - 1] if half == 0 else v[i - 1] + 0.5 * d
            m = M0 if half == 0 else M0 + 0.5 * d * sl
            x = (H + al * m) / a; Man = _lang(x); dMan = _dlang(x) / a
            irr = (Man - m) / (kk * s - al * (Man - m)) if (Man - m) * s > 0 else 0.0
            sl = (irr + c * dMan) / (1 + c)
        M = M0 + d * sl; y[i] = M
    return y


@nb.njit(cache=True)
def dahl_loop(v, rho, Fc, ex, mult):
    """Elastic actuator with parallel Dahl friction elements: dy + sum dF = dv, dF = rho |1 - s F/Fc|^ex sgn(.) dy."""
    n = len(v); K = len(rho); F = np.zeros(K); y = np.empty(n); Y = v[0]; y[0] = Y
    for i in range(1, n):
        d = v[i] - v[i - 1]
        if d != 0.0:
            s = 1.0 if d > 0 else -1.0; D = 1.0
            for k in range(K):
                q = 1 - s * F[k] / (Fc[k] * mult[i])
                D += rho[k] * abs(q) ** ex * (1.0 if q > 0 else -1.0)
            if D < 0.3: D = 0.3
            dy = 0.5 * d / D; D = 1.0
            for k in range(K):
                q = 1 - s * F[k] / (Fc[k] * mult[i])
                q = 1 - s * (F[k] + rho[k] * abs(q) ** ex * (1.0 if q > 0 else -1.0) * dy) / (Fc[k] * mult[i])
                D += rho[k] * abs(q) ** ex * (1.0 if q > 0 else -1.0)
            if D < 0.3: D = 0.3
            dy = d / D; Y += dy
            for k in range(K):
                q = 1 - s * F[k] / (Fc[k] * mult[i])
                F[k] += rho[k] * abs(q) ** ex * (1.0 if q > 0 else -1.0) * dy
        y[i] = Y
    return y


@nb.njit(cache=True)
def walls(v, x0, d, up, dn):
    """Domain walls that jump between pinning sites: site k of wall j at x0[j] + k d; leaves upwards at x + up, downwards at x - dn."""
    W, S = up.shape; n = len(v); y = np.empty(n); st = np.empty(W, np.int64); acc = 0.0
    for j in range(W):
        k = int((0.0 - x0[j]) / d + 0.5); st[j] = min(max(k, 0), S - 1); acc += x0[j] + st[j] * d
    for i in range(n):
        h = v[i]
        for j in range(W):
            k = st[j]
            while k < S - 1 and h >= x0[j] + k * d + up[j, k]:
                k += 1; acc += d
            while k > 0 and h <= x0[j] + k * d - dn[j, k]:
                k -= 1; acc -= d
            st[j] = k
        y[i] = acc / W
    return y


def law(base, rng, sym, bipolar, start, variant=None, width=None):
    """Returns (H(v, dt, rate) -> displacement normalised to span 1 and 0 at rest, loop width, description). `rate` is None or a dict
    with the multiplicative factors of a rate-dependent law. `start`: virgin (demagnetised) or remanent (cycled before, back to 0)."""
    lo, hi = (-0.5, 0.5) if bipolar else (0.0, 1.0)
    U = rng.uniform; d = {}
    one = lambda v: np.ones_like(v)
    if base in ("pi", "rayleigh"):
        kind = 3 if base == "rayleigh" else int(variant if variant is not None else rng.choice([0, 1, 2]))
        R = {0: U(.2, .4), 1: U(.15, .3), 2: U(.07, .12), 3: U(.5, 2.)}[kind]; d = dict(density=["exponential", "half-cauchy", "r*exp", "hyperbolic-rayleigh"][kind], R=R)
        raw = lambda v, dt, rate: masing(v, kind, R)
    elif base == "pibank":
        R = U(.2, .4); J = 72; r = (np.arange(J) + .5) / J * (1.02 if not bipolar else .55); w = np.exp(-r / R) * (1 - .3 * np.cos(9 * r)); w /= w.sum(); d = dict(density="exponential*(1-0.3cos)", R=R, plays=J)
        raw = lambda v, dt, rate: viscous_plays(v, dt, r, w, -1.0 if rate is None else rate["c"], 3.0 if rate is None else rate["m"])
    elif base == "preisach":
        N = 640; g0, g1 = lo - .45, hi + .45; h = (g1 - g0) / (N - 1); x = g0 + h * (np.arange(N)); A, B = np.meshgrid(x, x, indexing="ij")
        hh = .5 * (A - B); mm = .5 * (A + B); ok = hh >= 0; hs = np.where(ok, hh, 1.0) + .25 * h
        k = int(rng.integers(0, 3)); s = U(.10, .16)
        ph = [lambda q: np.exp(-.5 * (np.log(q / s) / .75) ** 2) / q, lambda q: (q / s) ** .4 * np.exp(-q / s * 1.3), lambda q: 1 / (1 + (q / s) ** 2.6)][k](hs)
        mid = .5 * (lo + hi); q = (mm - mid)
        if sym: pm = np.ones_like(q); nm = "uniform"
        else:
            j = int(rng.integers(0, 3)); c = U(-.2, .2)
            pm = [lambda: np.exp(-np.abs(q - c) / .35), lambda: .6 / (1 + ((q - c) / .22) ** 2) + .5, lambda: np.where(q < c, np.exp((q - c) / .5), np.exp(-(q - c) / .2)) + .35][j](); nm = ["laplace", "lorentz", "skewed"][j]
        mu = np.where(ok, ph * pm, 0.0); mu *= np.where(np.eye(N) > 0, .5, 1.0); mu /= mu.sum()
        # Everett: mass in {b >= beta, a <= alpha}
        C = np.cumsum(mu, axis=0); T = np.cumsum(C[:, ::-1], axis=1)[:, ::-1]; T = np.ascontiguousarray(T)
        d = dict(width_density=["lognormal", "gamma", "student-like"][k], scale=s, mean_density=nm)
        raw = lambda v, dt, rate: everett(v, T, g0, h)
    elif base == "kp":
        G = 34; g0, g1 = lo - .3, hi + .3; step = (g1 - g0) / G; a = U(1.6, 2.6) * step; pos = g0 + step * (np.arange(G) - .5 * a / step)
        i, j = np.meshgrid(np.arange(G), np.arange(G), indexing="ij"); ok = j >= i; s1, s2 = pos[i[ok]], pos[j[ok]]; hh = .5 * (s2 - s1); mm = .5 * (s1 + s2) + .5 * a - .5 * (lo + hi); s = U(.09, .16)
        w = np.exp(-hh / s) * (1 + hh / s)
        if not sym:
            c = U(-.25, .25); w = w * (np.maximum(0, 1 - np.abs(mm - c) / .7) + .15) * (1 + .35 * np.sin(5 * (s1 + c)))
        w = w / w.sum(); d = dict(kernels=len(w), ramp=a, scale=s, density="(1+h/s)exp(-h/s)" + ("" if sym else " * skewed triangle"))
        raw = lambda v, dt, rate: kp_bank(v, s1, s2, a, w)
    elif base == "ch":
        m = .5 * (lo + hi); p = np.array([1.0, U(.08, .18), m + U(-.12, .12), U(.15, .25), 0.0 if bipolar else U(.1, .3)]); al = U(7, 11); c0, c1 = U(.15, .3), U(.0, .15)
        d = dict(alpha=al, f="p0 v + p1 tanh((v-p2)/p3) + p4 v^2", p=p.tolist(), g="f'(v)(g0+g1 v)", g0=c0, g1=c1)
        raw = lambda v, dt, rate: coleman_hodgdon(v, al, p, c0, c1, one(v) if rate is None else rate["mult"])
    elif base == "bw":
        n_ = float(variant if variant else rng.choice([1, 1.5, 2])); zs = U(.08, .125); sh = U(.5, .68); tot = zs ** -n_; lam = U(.7, .8)
        d = dict(n=n_, z_sat=zs, beta=sh * tot, gamma=(1 - sh) * tot)
        raw = lambda v, dt, rate: bouc_wen(v, n_, sh * tot, (1 - sh) * tot, lam)
    elif base == "ja":
        a, k, c, al = U(.35, .8), U(.065, .095), U(.08, .2), U(.0, .05); d = dict(a=a, k=k, c=c, alpha=al)
        raw = lambda v, dt, rate: jiles_atherton(v, a, k, c, al, one(v) if rate is None else rate["mult"])
    elif base == "dahl":
        ex = float(rng.choice([1., 1.5, 2.])); rho = np.array([U(1.6, 2.3), U(.8, 1.3)]); F0 = np.array([.55, 1.15]) * U(.045, .06); d = dict(exponent=ex, rho=rho.tolist(), Fc=F0.tolist())
        raw = lambda v, dt, rate: dahl_loop(v, rho, F0, ex, one(v) if rate is None else rate["mult"])
    elif base == "walls":
        W, dd = 700, .026; S = int(2.4 / dd); x0 = -.95 + (lo + .0) + rng.uniform(0, dd, W); sc = U(.09, .14); sh = U(1.1, 1.6)
        up = sc * rng.weibull(sh, (W, S)) ; dn = sc * rng.weibull(sh, (W, S)); dn[:, 1:] = np.maximum(dn[:, 1:], dd * 1.001 - up[:, :-1]); d = dict(walls=W, pitch=dd, pinning="weibull", shape=sh, scale=sc)
        raw = lambda v, dt, rate: walls(v, x0, dd, up, dn)
    else: raise ValueError(base)

    ramp = lambda a, b: np.linspace(a, b, 400)[1:]
    demag = np.concatenate([[0.0]] + [ramp(a, b) for a, b in zip(*(lambda s: (s[:-1], s[1:]))(np.concatenate([[0.0], .55 * .955 ** np.arange(120) * (-1) ** np.arange(120), [0.0]])))])
    if start == "virgin": pre = demag if base in ("preisach", "kp", "walls") else np.zeros(1)
    else: pre = np.concatenate([[0.0], ramp(0, hi), ramp(hi, lo), ramp(lo, hi), ramp(hi, lo)] + ([ramp(lo, 0)] if bipolar else []))
    pre = np.ascontiguousarray(pre)

    def H0(v, dt, rate):
        if rate is not None and "mult" in rate: rate = dict(rate, mult=np.concatenate([np.ones(len(pre)), rate["mult"]]))
        y = raw(np.concatenate([pre, v]), dt, rate); return y[len(pre):] - y[len(pre) - 1]
    big = np.concatenate([np.linspace(lo, hi, 2000), np.linspace(hi, lo, 2000)]); t = np.concatenate([np.linspace(0, lo, 500), big, big, big]); yb = H0(t, 1e9, None)[-4000:]
    span = yb.max() - yb.min(); op = (yb[2000:][::-1] - yb[:2000]).max() / span
    target = width if width else U(.085, .19); kap = min(1.0, target / op)
    def H(v, dt, rate): return (1 - kap) * v + kap * H0(v, dt, rate) / span
    return H, kap * op, dict(d, mix=kap)



# =====================================================================================================================
# drives
# =====================================================================================================================

def smooth(x): x = np.clip(x, 0, 1); return x * x * (3 - 2 * x)


class Drive:
    """Returns waveforms: functions of time that start at rest. bip: -0.5..0.5, else 0..1."""
    def __init__(s, rng, bip): s.rng, s.bip = rng, bip
    def _map(s, x, a): return .5 * a * x if s.bip else a * .5 * (1 + x)          # x in -1..1
    def sine(s, f, a, n):
        return (lambda t: s._map(np.sin(2 * np.pi * f * t) if s.bip else -np.cos(2 * np.pi * f * t), a)), n / f
    def tri(s, f, a, n, off=0.0, rnd=.998):
        lead = .4 / f if off else 0.0
        def w(t):
            q = np.arcsin(rnd * np.sin(2 * np.pi * f * np.maximum(t - lead, 0) - (0 if s.bip else np.pi / 2))) / np.arcsin(rnd)
            return s._map(q, a) + off * smooth(t / lead if lead else 1.0)
        return w, n / f + lead
    def pl(s, pts, rate):                                                           # piecewise linear, constant |dv/dt|
        p = np.asarray(pts, float); tt = np.concatenate([[0], np.cumsum(np.abs(np.diff(p)) / rate)]); return (lambda t: np.interp(t, tt, p)), tt[-1]
    def stairs(s, levels, hold, rise):
        L = np.concatenate([[0.0], levels]); n = len(levels)
        def w(t):
            k = np.minimum((t / hold).astype(int), n); x = t - k * hold
            nxt = np.minimum(k, n); prv = np.maximum(k - 1, 0); return L[prv] + (L[nxt] - L[prv]) * smooth(x / rise)
        return w, (n + 1) * hold
    def chirp(s, f1, f2, a, T, taper=0.0):
        """Logarithmic sweep; the stroke falls as 1/f^taper (about mid-stroke), as is usual near a resonance."""
        k = math.log(f2 / f1) / T; fm = min(f1, f2)
        def w(t):
            x = (np.sin if s.bip else lambda q: -np.cos(q))(2 * np.pi * f1 * np.expm1(k * t) / k); g = (f1 / fm * np.exp(k * t)) ** -taper
            return s._map(g * x - (0 if s.bip else 1 - g) * (1 - smooth(t / (.06 * T) + .0)) if f2 > f1 else g * x - (0 if s.bip else (1 - g) * (1 - smooth(t / (.06 * T)))), a)
        return w, T
    def _noise(s, f, amp, a, T, ramp):
        ph = s.rng.uniform(0, 2 * np.pi, len(f)); g = np.arange(0, T * 1.02, min(T / 4000, .1 / f.max()))
        z = lambda t: sum(q * np.cos(2 * np.pi * fi * t + p) for fi, q, p in zip(f, amp, ph)); zz = z(g[g >= ramp * .5]); l, h = zz.min(), zz.max()
        def w(t):
            x = 2 * (z(t) - l) / (h - l) - 1; e = smooth(t / ramp); return s._map(np.clip(x, -1.02, 1.02), a) * e
        return w, T
    def walk(s, bw, a, T, lo=None, p=1.0, ramp=None):
        f = np.sort(s.rng.uniform(0, 1, 46)); fl = lo or max(bw / 60, 1.0 / T); f = fl * (bw / fl) ** f; return s._noise(f, f ** -(p - .5), a, T, ramp or .6 / fl if (ramp or .6 / fl) < .15 * T else .15 * T)
    def multisine(s, f0, ks, a, T, tilt=0.0):
        f = f0 * np.asarray(ks, float); return s._noise(f, f ** -tilt, a, T, .12 / f0 if .12 / f0 > 4 / f.max() else 4 / f.max())
    def fm(s, f1, f2, P, a, T):
        """Logarithmic chirps up and down without a pause; the stroke changes between sweeps."""
        g = np.linspace(0, T, int(T * 400 * max(1, f2 / 20)) + 2); q = np.abs((g / P) % 2 - 1); ph = np.concatenate([[0], np.cumsum(2 * np.pi * f1 * (f2 / f1) ** (1 - .5 * (q[1:] + q[:-1])) * np.diff(g))])
        return (lambda t: s._map((np.sin if s.bip else lambda x: -np.cos(x))(np.interp(t, g, ph)), 1.0) * a * (.62 + .38 * np.cos(2 * np.pi * t / (2.7 * P)))), T
    def am(s, f, a, n, kind="tri", depth=.72, ratio=9.3):
        w0, T = s.tri(f, 1.0, n) if kind == "tri" else s.sine(f, 1.0, n)
        return (lambda t: w0(t) * a * (1 - depth * .5 * (1 - np.cos(2 * np.pi * f / ratio * t + 1.1)))), T


def steps_levels(rng, n, bip, lo=.08, hi=1.0):
    while True:
        L = rng.uniform(lo, hi, n); L[rng.integers(0, n)] = hi; L[0] = rng.uniform(.4, .7)
        if np.all(np.abs(np.diff(L)) > .12): return L - .5 if bip else L

def updown(n, a=1.0): k = np.arange(1, n + 1) / n; return a * np.concatenate([k, k[::-1][1:], [0.0]])

# =====================================================================================================================
# temperature and load over the time of the record
# =====================================================================================================================

def temp_profile(kind, swing, dur, rng):
    g = np.linspace(0, dur, 4001)
    if kind == "room": x = np.sin(2 * np.pi * g / (dur * rng.uniform(.45, .6)) + rng.uniform(0, 6)) + .45 * np.sin(2 * np.pi * g / (dur * rng.uniform(.17, .25)) + rng.uniform(0, 6))
    elif kind == "steps":
        n = 7; lv = np.array([0, 1, .35, .8, .1, .6, -.1]) + rng.uniform(-.12, .12, n); b = np.linspace(0, dur, n + 1)[:-1] + np.r_[0, rng.uniform(-.03, .03, n - 1) * dur]; x = np.zeros_like(g)
        for i in range(n): x = x + (lv[i] - (lv[i - 1] if i else lv[0])) * (1 - np.exp(-np.maximum(g - b[i], 0) / (dur * .012)))
        x = x + lv[0]
    else:
        k = np.array([0, .25, .55, .8, 1.0]) + np.r_[0, rng.uniform(-.05, .05, 3), 0]; x = np.interp(g, k * dur, [0.0, 1.0, .2, .75, .4])
        w = np.ones(81) / 81; x = np.convolve(np.pad(x, 40, mode="edge"), w, "valid")
    x = (x - x.min()) / (x.max() - x.min()); return g, rng.uniform(20, 23) + swing * x


def load_profile(kind, amp, dur, rng):
    n = int(min(400000, max(4000, dur / .002))); g = np.linspace(0, dur, n); dt = g[1]
    if kind == "steps":
        x = np.zeros(n); t = 0.0; m = dur / 17
        while t < dur: l = rng.uniform(.3, 1.7) * m; x[(g >= t) & (g < t + l)] = rng.choice([0, .35, .6, 1.0, -.3]); t += l
        e = math.exp(-dt / .02); x = lfilter([1 - e], [1, -e], x)
    elif kind == "sine": x = np.sin(2 * np.pi * g / (dur / rng.uniform(5.5, 9.5)) + .3) * .5 + .5 + .2 * np.sin(2 * np.pi * g / (dur / 23.7))
    else:
        f = rng.uniform(2, 26, 14) / dur; x = sum(np.cos(2 * np.pi * fi * g + rng.uniform(0, 6.28)) for fi in f); x /= np.abs(x).max()
    return g, amp * x

# =====================================================================================================================
# simulation
# =====================================================================================================================

def lin(num, den, x, dt):
    b, a, _ = cont2discrete((np.atleast_1d(num), np.atleast_1d(den)), dt, method="foh"); return lfilter(np.ravel(b), a, x - x[0]) + x[0] * num[-1] / den[-1]


def creep_conv(y, dt, L):
    n = len(y); k = L((np.arange(n) + .5) * dt); m = 1 << int(np.ceil(np.log2(2 * n))); dy = np.diff(y, prepend=0.0)
    return np.fft.irfft(np.fft.rfft(dy, m) * np.fft.rfft(k, m), m)[:n]


def creep(y, dt, c):
    out = 0.0 * y; ys = y[::OS]; tf = np.arange(len(y)); dts = dt * OS
    if c["law"] == "log": out = creep_conv(ys, dts, lambda t: c["per_decade"] * np.log10(1 + t / c["t0_s"]))
    elif c["law"] == "fractional": out = creep_conv(ys, dts, lambda t: c["k"] * ((t + c["t0_s"]) ** c["alpha"] - c["t0_s"] ** c["alpha"]))
    else:
        out = np.zeros_like(ys)
        for k, tau in zip(c["share"], c["tau_s"]): out += k * lin([1.0], [tau, 1.0], ys, dts) - k * ys[0] * 0
    return np.interp(tf, np.arange(len(out)) * OS, out)


def slew(v, lim):
    y = np.empty_like(v); s = v[0]
    return _slew(v, y, s, lim)

@nb.njit(cache=True)
def _slew(v, y, s, lim):
    for i in range(len(v)):
        d = v[i] - s
        if d > lim: d = lim
        if d < -lim: d = -lim
        s += d; y[i] = s
    return y


def record(case, part, names):
    """Returns a dict of arrays; `names`: effects of the case that act. Displacements in um."""
    H, S, fs = case["_H"], case["stroke_um"], case["fs"]; eff = {k: v for k, v in case["effects"].items() if k in names}
    dt = 1.0 / (fs * OS); segs = case["_drive"][part]; mid = case["starts_mid_cycle"]; out = dict(seg=[], t=[], v=[], y=[], T=[], F=[]); clock = 0.0
    dur = sum(T for _, T in segs) + case["gap_s"] * (len(segs) - 1); tg, Tg, Ta = case["_temp"][part]; lg, Lg = case["_load"][part]
    for k, (w, T) in enumerate(segs):
        warm = case["_warm"] if mid else 0.0; n = int(round((T) * fs)); nw = int(round(warm * fs)); t = (np.arange((n + nw) * OS) - nw * OS) * dt; v0 = w(t + nw / fs); ck = clock + t; v = v0
        if "saturation" in eff and eff["saturation"]["at"] == "amplifier":
            s = eff["saturation"]
            if "hi" in s: v = np.minimum(v, s["hi"]) if not s.get("knee") else s["hi"] - s["knee"] * np.logaddexp(0, (s["hi"] - v) / s["knee"])
            if "lo" in s: v = np.maximum(v, s["lo"])
        if "slew" in eff: v = slew(v, eff["slew"]["span_per_s"] * dt)
        if "lag" in eff:
            e = eff["lag"]; v = lin([1.0], np.polymul([e["s"], 1.0], [e["s2"], 1.0]) if "s2" in e else [e["s"], 1.0], v, dt)
        if "asymmetry" in eff and eff["asymmetry"]["at"] == "input": v = bend(v, eff["asymmetry"])
        rate = None
        if "rate-dependence" in eff:
            e = eff["rate-dependence"]; r = np.gradient(v, dt); r = lin([1.0], [e.get("relax_s", 5e-4), 1.0], r - r[0], dt) + r[0]
            if e["law"] == "viscous-walls": rate = dict(c=e["c"], m=e["m"])
            elif e["law"] == "asinh-field": v = v - e["v"] * np.arcsinh(r / e["r0"])
            elif e["law"] == "power-coercivity": rate = dict(mult=1 + e["q"] * (np.abs(r) / e["r0"]) ** e["p"])
            elif e["law"] == "log-friction": rate = dict(mult=1 + e["q"] * np.arcsinh(np.abs(r) / e["r0"]))
            elif e["law"] == "duhem-relaxation": rate = dict(mult=(1 + np.abs(r) / e["r0"]) ** -e["p"])
        y = S * H(v, dt, rate)
        if "asymmetry" in eff and eff["asymmetry"]["at"] == "output": y = S * bend(y / S, eff["asymmetry"])
        Ti = np.interp(ck, tg, Tg); Fi = np.interp(ck, lg, Lg)
        if "temperature" in eff:
            e = eff["temperature"]; Th = (np.interp(ck, tg, Ta) if e.get("thermal_lag_s") else Ti) - case["_T0"]
            y = y * (1 + e["per_K"] * Th) + e.get("expansion_um_per_K", 0.0) * (Th - (case["_Tz"][part] - case["_T0"]))
        if "gain-steps" in eff:
            g = np.ones_like(ck)
            for tt, q in eff["gain-steps"][part]: g[ck >= tt] = q
            y = y * g
        if "creep" in eff: y = y + creep(y, dt, eff["creep"])
        if "load" in eff: y = y - Fi * eff["load"]["um_per_N"]
        if "hidden-load" in eff: y = y - Fi * eff["hidden-load"]["um_per_N"]
        if "resonance" in eff:
            e = eff["resonance"]; acc = 0.0
            for hz, z, a in zip(e["hz"], e["zeta"], e["share"]):
                wn = 2 * np.pi * hz; acc = acc + a * lin([1.0], [1 / wn ** 2, 2 * z / wn, 1.0], y, dt)
            if "zero_hz" in e:
                w0 = 2 * np.pi * e["zero_hz"]; wn = 2 * np.pi * e["hz"][0]; z = e["zeta"][0]; acc = lin([1 / w0 ** 2, 2 * e["zero_zeta"] / w0, 1.0], np.polymul([1 / wn ** 2, 2 * z / wn, 1.0], [1 / (2 * np.pi * e["roll_hz"]), 1.0]), y, dt)
            y = acc
        if "saturation" in eff and eff["saturation"]["at"] == "stop":
            s = eff["saturation"]; c = s["hi"] * S; kn = s["knee"] * S; y = y - (1 - s["slope"]) * (kn * np.logaddexp(0, (y - c) / kn) if kn > 0 else np.maximum(y - c, 0))
        if "delay" in eff:
            e = eff["delay"]["s"]; y = np.interp(t - e, t, y, left=y[0])
        if "drift" in eff:
            e = eff["drift"]; c = np.maximum(ck, 0); f = {"linear": c / dur, "settling": 1 - np.exp(-c / e.get("s", 1.0)), "smooth": smooth(.15 + .8 * c / dur) - smooth(.15) }[e["law"]]; y = y + e["um"] * f * (dur / case["_dur"]["train"] if e["law"] == "linear" else 1.0)
        if "interference" in eff:
            e = eff["interference"]
            for m, q, p in e["lines"]: y = y + q * np.sin(2 * np.pi * m * e["hz"] * ck + p)
        if "slips" in eff:
            for tt, q in eff["slips"][part]: y = y + q * (ck >= tt)
        if "telegraph" in eff:
            tt = np.asarray(eff["telegraph"][part]); y = y + eff["telegraph"]["um"] * (np.searchsorted(tt, ck) % 2)
        s = slice(nw * OS, None, OS); ys = y[s]
        out["seg"].append(np.full(n, k)); out["t"].append(ck[s]); out["v"].append(v0[s]); out["y"].append(ys); out["T"].append(Ti[s]); out["F"].append(Fi[s]); clock += T + case["gap_s"]
    o = {k: np.concatenate(x) for k, x in out.items()}
    if mid: o["y"] = o["y"] - case["_y0"][part] if "_y0" in case else o["y"]
    return o


def bend(x, e):
    if e["curve"] == "quadratic": return (x + e["k"] * x * x) / (1 + e["k"])
    if e["curve"] == "exponential": return np.expm1(e["k"] * x) / np.expm1(e["k"])
    if e["curve"] == "power": return np.sign(x) * ((np.abs(x) + .05) ** e["k"] - .05 ** e["k"]) / (1.05 ** e["k"] - .05 ** e["k"])
    raise ValueError


def noise_of(case, part, n):
    r = np.random.default_rng([case["seed"], 11 if part == "train" else 12]); e = case["noise"]; x = r.normal(0, e["white_um"], n)
    if e.get("pink_um"):
        f = np.fft.rfftfreq(n, 1.0 / case["fs"]); A = np.zeros(len(f)); A[1:] = np.maximum(f[1:], 5 * f[1]) ** -.5; p = np.fft.irfft(A * np.exp(2j * np.pi * r.uniform(0, 1, len(f))), n); x = x + p / p.std() * e["pink_um"]
    return x


def basis(model, v, seg, lo, hi):
    cols = []
    for k in np.unique(seg):
        u = v[seg == k]
        if model == "pi":
            r = np.concatenate([np.linspace(0, .5, 33)[1:], np.linspace(.5, 1, 9)[1:]]); B = np.column_stack([viscous_plays(u, 1.0, np.array([q]), np.ones(1), -1.0, 3.0) for q in r])
        else:
            G = 21; st = (hi - lo) / G; p = lo + st * np.arange(G); B = []
            for i in range(G):
                for j in range(i, G): B.append(kp_bank(u, np.array([p[i]]), np.array([p[j]]), st, np.ones(1)))
            B = np.column_stack(B)
        cols.append(np.column_stack([np.ones(len(u)), u, B]))
    return np.vstack(cols)

# =====================================================================================================================
# the list of cases
# =====================================================================================================================

UNREPRESENTABLE = {"ch", "bw", "ja", "dahl"}

def build(seed):
    master = np.random.default_rng(seed); cases = []
    def add(tag, base, model, exp, effects=None, expect=None, accept=(), noise=None, temp=None, load=None, bip=False, variant=None, hide=(), width=None, stroke=None):
        i = len(cases) + 1; cs = int(master.integers(1, 1 << 31)); rng = np.random.default_rng(cs); U = rng.uniform
        S = float(stroke or np.round(np.exp(U(np.log(5), np.log(100))), 1)); volt = float(rng.choice([100, 120]) if bip else rng.choice([60, 75, 100, 120, 150]))
        c = dict(id=f"{i:02d}-{tag}", base=base if base != "pibank" else "pi", model=model, seed=cs, experiment=exp[0], stroke_um=S, volt_span=volt, bipolar=bip)
        sym = model == "pi"; start = "virgin" if model == "pi" else "remanent"
        c["_H"], wd, desc = law(base, np.random.default_rng([cs, 1]), sym, bip, start, variant, width); c["loop_width"] = round(wd, 4); c["law"] = desc; c["start"] = start
        d = Drive(np.random.default_rng([cs, 2]), bip); x = exp[1](d, rng); c.update(fs=x["fs"], gap_s=x.get("gap", 2.0), starts_mid_cycle=bool(x.get("warm")), _warm=x.get("warm", 0.0))
        # time grid: durations are whole samples
        c["_drive"] = {p: [(w, round(T * x["fs"]) / x["fs"] if not x.get("warm") else round((T - x["warm"]) * x["fs"]) / x["fs"]) for w, T in x[p]] for p in ("train", "test")}
        c["_dur"] = {p: sum(T for _, T in c["_drive"][p]) + c["gap_s"] * (len(c["_drive"][p]) - 1) for p in ("train", "test")}
        # noise
        nk = noise or rng.choice(["white", "pink", "12-bit", "16-bit"]); q = 10 ** U(-3.8, -3.2)
        if nk == "white": nz = dict(kind=nk, white_um=q * S, lsb_um=S * 1.3 / 65536)
        elif nk == "pink": nz = dict(kind=nk, white_um=.6 * q * S, pink_um=min(.7 * q, 2e-4) * S, lsb_um=S * 1.3 / 65536)
        elif nk == "12-bit": nz = dict(kind=nk, white_um=U(1.2e-4, 2.2e-4) * S, lsb_um=1.25 * S / 4096)
        else: nz = dict(kind=nk, white_um=U(1e-4, 2e-4) * S, lsb_um=1.25 * S / 65536)
        c["noise"] = nz; c["noise_um"] = float(np.sqrt(nz["white_um"] ** 2 + nz.get("pink_um", 0) ** 2 + nz["lsb_um"] ** 2 / 12))
        # surroundings
        c["_temp"], c["_load"], c["_Tz"] = {}, {}, {}; c["columns"] = [k for k, z in (("temperature_degc", temp), ("load_n", load)) if z and k not in hide]
        lagT = (effects or (lambda *_: {}))(c, np.random.default_rng([cs, 3])).get("temperature", {}).get("thermal_lag_s", 0.0)
        for k, p in enumerate(("train", "test")):
            r = np.random.default_rng([cs, 20 + k]); D = c["_dur"][p] + 1e-9
            g, T = temp_profile(temp[0], temp[1], D, r) if temp else (np.array([0, D]), np.array([22.0, 22.0])); Ta = T
            if lagT: e = math.exp(-g[1] / lagT); Ta = lfilter([1 - e], [1, -e], T - T[0]) + T[0]
            c["_temp"][p] = (g, T, Ta); c["_Tz"][p] = float(T[0]); c["_load"][p] = load_profile(load[0], load[1], D, r) if load else (np.array([0, D]), np.zeros(2))
        c["_T0"] = 22.0
        c["effects"] = (effects or (lambda *_: {}))(c, np.random.default_rng([cs, 3]))
        c["expect"] = list(expect) if expect is not None else list(c["effects"])
        c["accept"] = [list(a) for a in accept]
        if not c["effects"] and base in (UNREPRESENTABLE | ({"walls"} if model == "pi" else set())): c["accept"].append(["unknown"])
        cases.append(c)

    # ---- experiments: name, function(drive, rng) -> dict(fs, train, test[, gap, warm])
    j = lambda r: r.uniform(.93, 1.07)
    def sines(fs, tr, te, gap=2.0): return "sines", lambda d, r: (lambda q: dict(fs=fs, gap=gap, train=[d.sine(f * q, a, n) for f, a, n in tr], test=[d.sine(f * q, a, n) for f, a, n in te]))(j(r))
    def one_sine(fs, f, n, a=1.0, at=.75, nt=None, warm=0): return "one sine" + (" from mid-cycle" if warm else ""), lambda d, r: (lambda q: dict(fs=fs, train=[d.sine(f * q, a, n)], test=[d.sine(f * q, at, nt or n * .7)], **({"warm": warm / (f * q)} if warm else {})))(j(r))
    def raster(fs, tr, te, rnd=.998, gap=2.0): return "AFM raster", lambda d, r: (lambda q: dict(fs=fs, gap=gap, train=[d.tri(f * q, a, n, off, rnd) for f, a, n, off in tr], test=[d.tri(f * q, a, n, off, rnd) for f, a, n, off in te]))(j(r))
    def stairs(fs, hold, n=8, rise=.01, gap=120.0, m=9): return "stairs", lambda d, r: dict(fs=fs, gap=gap, train=[d.stairs(updown(n) - (0 if not d.bip else .5), hold, rise), d.stairs(steps_levels(r, m, d.bip), hold * 1.3, rise)], test=[d.stairs(steps_levels(r, m, d.bip), hold, rise)])
    def chirps(fs, f1, f2, T, a=(1.0, .5), gap=2.0, taper=0.0): return "log chirps", lambda d, r: (lambda q: dict(fs=fs, gap=gap, train=[d.chirp(f1 * q, f2 * q, k, T, taper) for k in a] + ([d.sine(f1 * 2.2, 1.0, 3)] if taper else []), test=[d.chirp(f2 * .8 * q, f1 * 1.5 * q, .8 * a[0], T * .7, taper), d.sine(f1 * 4, .9, 6)]))(j(r))
    def walk(fs, bw, T, p=1.0, warm=0, lo=None, seg=2): return "random walk" + (" from mid-cycle" if warm else ""), lambda d, r: dict(fs=fs, train=[d.walk(bw, 1.0, T, lo, p) for _ in range(1 if warm else seg)], test=[d.walk(bw * .8, .85, T * .6 + warm, lo, p)], **({"warm": warm} if warm else {}))
    def multis(fs, f0, ks, T, tilt=0.0, seg=2, a=(1.0, .6)): return "multisine", lambda d, r: (lambda q: dict(fs=fs, train=[d.multisine(f0 * q, ks, a[i % 2], T, tilt) for i in range(seg)], test=[d.multisine(f0 * q * 1.07, ks, .85, T * .7, tilt)]))(j(r))
    def forc(fs, rate, n=6, gap=120.0): return "reversal curves", lambda d, r: (lambda P: dict(fs=fs, gap=gap, train=[d.pl(P, rate)], test=[d.pl([0, .9, .15, .6, .3, 1.0, .5, .75, 0, .4, .2, .95, 0], rate * 1.3)]))(np.concatenate([[0.0]] + [[1.0, 1 - (i + 1) / n] for i in range(n)] + [[1.0 * (n - i) / n, 0.0] for i in range(1, n, 2)]))
    def mid(fs, f, n, kind="tri", ratio=9.3, nt=None, wc=1.37): return f"one long record from mid-cycle (AM {kind})", lambda d, r: (lambda q: dict(fs=fs, warm=wc / (f * q), train=[d.am(f * q, 1.0, n, kind, ratio=ratio)], test=[d.am(f * q * 1.2, .9, (nt or n * .6), kind, depth=.6, ratio=ratio * .8)]))(j(r))
    def midchirps(fs, f1, f2, P, T, warm): return "repeated log chirps from mid-cycle", lambda d, r: dict(fs=fs, warm=warm, train=[d.fm(f1, f2, P, 1.0, T + warm)], test=[d.fm(f1 * 1.2, f2 * .8, P * .8, .88, .6 * T + warm)])
    def mixed(fs, make, gap=120.0): return "mixed", lambda d, r: dict(fs=fs, gap=gap, **make(d, r))
    # ---- effect drawers
    U = lambda r, a, b: float(r.uniform(a, b))
    def E(**k): return lambda c, r: {n.replace("_", "-"): f(c, r) for n, f in k.items()}
    clog = lambda a=.010, b=.02, t0=.06: lambda c, r: dict(law="log", per_decade=U(r, a, b), t0_s=t0)
    cfrac = lambda k0, k1: lambda c, r: dict(law="fractional", k=U(r, k0, k1), alpha=U(r, .12, .25), t0_s=.05)
    cexp = lambda tau, k: lambda c, r: dict(law="exponentials", tau_s=[float(t * r.uniform(.8, 1.25)) for t in tau], share=[float(q * r.uniform(.85, 1.2)) for q in k])
    mode = lambda a, b, z0=.012, z1=.03: lambda c, r: dict(hz=[U(r, a, b)], zeta=[U(r, z0, z1)], share=[1.0])
    lag1 = lambda a, b: lambda c, r: dict(s=U(r, a, b))
    dly = lambda a, b: lambda c, r: dict(s=U(r, a, b))
    loadc = lambda lo, hi: lambda c, r: dict(um_per_N=U(r, lo, hi) * c["stroke_um"] / c["_load_amp"])
    hum = lambda hz, rms, lines: lambda c, r: (lambda a: dict(hz=hz * U(r, .9992, 1.0008), lines=[[m, float(a * q), U(r, 0, 6.28)] for m, q in lines]))(U(r, *rms) * c["stroke_um"] * math.sqrt(2 / sum(q * q for _, q in lines)))
    drift = lambda law_, a, b, s=None: lambda c, r: dict(law=law_, um=U(r, a, b) * c["stroke_um"] * float(r.choice([-1, 1])), **({"s": s(c) * U(r, .85, 1.15)} if s else {}))
    field = lambda a, b, r0=.3: lambda c, r: dict(law="asinh-field", v=U(r, a, b), r0=r0, relax_s=1e-3)
    tk = lambda a, b, **kw: lambda c, r: dict(per_K=U(r, a, b), **{k: (f(c, r)) for k, f in kw.items()})
    bnd = lambda at, curve, a, b: lambda c, r: dict(at=at, curve=curve, k=U(r, a, b))
    def wl(f):      # loads need the amplitude of the case
        def g(c, r): c["_load_amp"] = max(abs(c["_load"]["train"][1]).max(), 1e-9) if c["_load"] else 1.0; return f(c, r)
        return g

    wide = [(.2, 1.0, 1.25), (1, .7, 3), (3, 1.0, 6), (10, .85, 12), (30, 1.0, 24)]; widet = [(.5, .9, 2), (2, .6, 3), (6, 1.0, 8), (20, .75, 16)]
    mod_ = [(.5, 1.0, 2), (1, .7, 2), (2, .9, 4), (5, .5, 5)]; modt = [(.8, .85, 2), (3, 1.0, 4)]

    # ================= none (12)
    add("none", "pi", "pi", sines(1000, mod_, modt), noise="white")
    add("none", "preisach", "preisach", walk(500, 6, 12), noise="pink")
    add("none", "kp", "preisach", forc(200, .4), noise="12-bit")
    add("none-temp", "ch", "preisach", mid(50, .25, 60), noise="16-bit", temp=("room", 9.0))
    add("none", "bw", "preisach", multis(1000, .5, [1, 2, 3, 5, 7, 11, 13, 17], 6, .4), noise="white", variant=1.5, bip=True)
    add("none", "ja", "preisach", chirps(10000, 1, 200, 3.0), noise="pink")
    add("none-load", "dahl", "preisach", raster(1000, [(1, 1.0, 3, 0), (4, .6, 8, .2), (10, .8, 15, 0)], [(2, .8, 5, .1), (7, 1.0, 12, 0)]), noise="12-bit", load=("steps", 3.0))
    add("none-temp", "walls", "pi", stairs(100, 2.0), noise="white", temp=("ramp", 7.0))
    add("none", "pi", "pi", one_sine(500, 5, 13, nt=9), noise="12-bit", variant=1)
    add("none-load", "kp", "pi", mid(10000, 30, 45, "sine"), noise="white", load=("random", 5.0))
    add("none", "bw", "pi", sines(2000, [(2, 1.0, 4), (5, .6, 6), (10, 1.0, 10), (20, .8, 16)], [(3, .9, 4), (12, .7, 12)]), noise="16-bit", variant=1)
    add("none-temp", "rayleigh", "pi", walk(200, 2, 40, seg=1), noise="pink", temp=("steps", 8.0))
    # ================= outside the list (5)
    def slips(c, r):
        sg = float(r.choice([-1, 1])); return {p: [[(f + U(r, -.05, .05)) * c["_dur"][p], sg * (-1) ** i * U(r, .013, .022) * c["stroke_um"]] for i, f in enumerate((.14, .33, .58, .81))] for p in ("train", "test")}
    def rtn(c, r): return dict(um=U(r, .009, .014) * c["stroke_um"], **{p: np.cumsum(r.exponential(.22, int(c["_dur"][p] / .22 * 1.6) + 5)).tolist() for p in ("train", "test")})
    def gsteps(c, r): return {p: [[f * c["_dur"][p] * U(r, .95, 1.05), g] for f, g in zip((.2, .45, .62, .85), (.965, 1.02, .98, 1.03))] for p in ("train", "test")}
    add("slips", "pi", "pi", walk(500, 5, 12), E(slips=slips), ["unknown"], noise="white")
    add("telegraph", "ch", "preisach", sines(1000, mod_, modt, gap=1.0), E(telegraph=rtn), ["unknown"])
    add("gain-steps", "preisach", "preisach", raster(1000, [(3, 1.0, 36, 0)], [(4, .9, 28, 0)]), E(gain_steps=gsteps), ["unknown"])
    add("slew-limit", "kp", "pi", mixed(5000, lambda d, r: dict(train=[d.stairs(steps_levels(r, 14, False), .06, .0015), d.tri(6, 1.0, 6), d.tri(22, .9, 14)], test=[d.stairs(steps_levels(r, 12, False), .05, .0015), d.tri(30, .6, 15), d.tri(10, 1.0, 5)]), gap=2.0), E(slew=lambda c, r: dict(span_per_s=U(r, 55, 75))), ["unknown"])
    add("hidden-load", "dahl", "preisach", sines(1000, [(1, 1.0, 3), (2, .7, 6), (5, .9, 15), (9, .6, 20)], [(1.5, .8, 4), (4, 1.0, 10)]), E(hidden_load=wl(loadc(.012, .02))), ["unknown"], load=("steps", 4.0), hide=("load_n",))
    # ================= creep (4)
    add("creep-log", "preisach", "preisach", stairs(100, 4.0), E(creep=clog(.02, .028)), noise="white")
    add("creep-fractional", "pi", "pi", forc(100, .12, 5), E(creep=cfrac(.05, .07)))
    add("creep-exps", "ja", "preisach", walk(50, .4, 200, 1.2, seg=1, lo=.025), E(creep=cexp((1.0, 8.0, 45.0), (.024, .036, .045))), width=.10)
    add("creep-log", "bw", "preisach", stairs(200, 2.5, n=5, m=11), E(creep=clog(.018, .026, .04)), variant=2)
    # ================= rate-dependence (5)
    add("rate-viscous-walls", "pibank", "pi", sines(1000, wide, widet), E(rate_dependence=lambda c, r: dict(law="viscous-walls", m=3.0, c=100.0 / U(r, .075, .1) ** 3)), width=.17)
    add("rate-log-field", "kp", "preisach", chirps(1000, .3, 40, 9), E(rate_dependence=field(.006, .009)))
    add("rate-duhem", "ch", "preisach", sines(1000, wide, widet), E(rate_dependence=lambda c, r: dict(law="duhem-relaxation", r0=.5, p=U(r, .11, .15))), width=.13)
    add("rate-log-friction", "dahl", "preisach", raster(2000, [(.5, 1.0, 2, 0), (3, .7, 5, .2), (15, 1.0, 15, 0), (40, .8, 30, .1)], [(1, .9, 2, 0), (8, .8, 8, .1), (25, 1.0, 16, 0)]), E(rate_dependence=lambda c, r: dict(law="log-friction", q=U(r, .14, .2), r0=.5, relax_s=1e-3)), width=.12)
    add("rate-power", "ja", "preisach", sines(1000, wide, widet), bip=True, effects=E(rate_dependence=lambda c, r: dict(law="power-coercivity", q=U(r, .4, .6), p=U(r, .3, .45), r0=30.0)), width=.13)
    # ================= resonance (4)
    add("resonance", "ch", "preisach", chirps(5000, 2, 260, 2.2, (1.0, .5), taper=.85), E(resonance=mode(120, 190)))
    add("resonance-two-modes", "preisach", "preisach", multis(10000, 4, [1, 2, 3, 5, 8, 13, 21, 34, 41, 46, 51, 56, 62, 70, 80, 90, 97, 103, 109, 116], 1.1, 1.1), E(resonance=lambda c, r: dict(hz=[U(r, 170, 230), U(r, 380, 460)], zeta=[U(r, .015, .03), U(r, .015, .03)], share=[.78, .22])))
    add("resonance-antiresonance", "walls", "pi", chirps(5000, 2, 300, 2.2, (1.0, .5), taper=.85), E(resonance=lambda c, r: (lambda f: dict(hz=[f], zeta=[U(r, .015, .03)], share=[1.0], zero_hz=f * U(r, 1.3, 1.5), zero_zeta=.02, roll_hz=20 * f))(U(r, 120, 170))))
    add("resonance-ringing", "bw", "preisach", mixed(5000, lambda d, r: dict(train=[d.stairs(steps_levels(r, 16, False), .09, .009), d.stairs(updown(6), .08, .007)], test=[d.stairs(steps_levels(r, 14, False), .1, .008)]), gap=2.0), E(resonance=mode(85, 130, .015, .04)), variant=1.5)
    # ================= lag (3)
    add("lag-rc", "kp", "pi", multis(5000, 3, [1, 2, 3, 5, 8, 13, 20, 29], 1.2, .3), E(lag=lag1(.0012, .002)))
    add("lag-overdamped", "ja", "preisach", sines(2500, [(1, 1.0, 2), (4, .8, 4), (12, 1.0, 10), (35, .7, 20), (80, .5, 40)], [(2, .9, 3), (20, .8, 14), (55, .6, 25)]), E(lag=lambda c, r: (lambda s: dict(s=s, s2=.25 * s))(U(r, .0010, .0016))), accept=[["delay", "lag"]])
    add("lag-one-sine", "pi", "pi", one_sine(20000, 40, 27, warm=3.3), E(lag=lag1(.0007, .001)), accept=[["delay"], ["rate-dependence"], ["resonance"]])
    # ================= delay (3)
    add("delay", "dahl", "preisach", chirps(2000, 1, 60, 3.0, (1.0, .6)), E(delay=dly(.0012, .0018)))
    add("delay", "walls", "pi", walk(10000, 150, .9, 1.0), E(delay=dly(.0009, .0014)))
    add("delay", "ch", "preisach", raster(5000, [(5, 1.0, 4, 0), (20, .7, 12, .2), (45, .9, 25, 0)], [(10, .8, 6, .1), (32, 1.0, 16, 0)], rnd=.9995), E(delay=dly(.0008, .0013)))
    # ================= temperature (4)
    add("temp-gain", "bw", "preisach", mid(50, .3, 90), E(temperature=tk(.0035, .006)), temp=("room", 8.0), variant=1)
    add("temp-gain-lag", "preisach", "preisach", mid(50, .3, 110, ratio=7.3), E(temperature=tk(.005, .007, thermal_lag_s=lambda c, r: U(r, 12, 30))), temp=("steps", 10.0))
    add("temp-gain-expansion", "walls", "pi", walk(50, .5, 240, seg=1, warm=9.0, lo=.03), E(temperature=tk(.0025, .004, expansion_um_per_K=lambda c, r: U(r, .0015, .003) * c["stroke_um"])), temp=("room", 7.0))
    add("temp-one-sine", "dahl", "preisach", one_sine(100, .6, 110), E(temperature=tk(.0038, .0055)), temp=("ramp", 9.0), bip=True)
    # ================= load (2)
    add("load", "ja", "preisach", walk(200, 2.5, 30, 1.6), E(load=wl(loadc(.022, .035))), load=("steps", 8.0), width=.11)
    add("load", "pi", "pi", raster(2000, [(6, 1.0, 14, 0), (15, .6, 30, .3)], [(9, .9, 20, 0)]), E(load=wl(loadc(.012, .025))), load=("sine", 20.0))
    # ================= saturation (3)
    add("saturation-rail", "kp", "pi", sines(1000, [(1, 1.0, 3), (2, .6, 3), (5, .85, 8), (3, 1.0, 4)], [(1.5, .92, 3), (4, 1.0, 6)]), E(saturation=lambda c, r: dict(at="amplifier", hi=U(r, .84, .9))))
    add("saturation-both-rails", "rayleigh", "pi", multis(1000, .5, [1, 2, 3, 4, 6, 9], 6, .5, a=(1.0, .9)), E(saturation=lambda c, r: dict(at="amplifier", hi=U(r, .34, .38), lo=-U(r, .34, .38))), bip=True)
    add("saturation-stop", "preisach", "pi", forc(200, .6, gap=5.0), E(saturation=lambda c, r: dict(at="stop", hi=U(r, .84, .9), knee=.008, slope=U(r, .05, .12))))
    # ================= asymmetry (3)
    add("asymmetry-input", "pi", "pi", walk(500, 4, 12), E(asymmetry=bnd("input", "quadratic", .2, .35)))
    add("asymmetry-output", "walls", "pi", raster(1000, [(2, 1.0, 4, 0), (5, .5, 8, .45), (8, .7, 14, .05)], [(3, .9, 6, 0), (6, .5, 10, .3)]), E(asymmetry=bnd("output", "exponential", .35, .6)))
    add("asymmetry-one-sine", "preisach", "pi", one_sine(500, 2, 14), E(asymmetry=bnd("input", "exponential", .5, .8)))
    # ================= drift (3)
    add("drift-linear", "dahl", "preisach", mid(100, .5, 80, "sine", wc=1.5), E(drift=drift("linear", .03, .05)), bip=True)
    add("drift-settling", "bw", "preisach", sines(500, [(1, 1.0, 5), (2, .7, 8), (4, 1.0, 16), (1, .85, 4), (7, .6, 25)], [(1.5, .9, 6), (3, .7, 9), (1, 1.0, 3)], gap=4.0), bip=True, effects=E(drift=drift("settling", .025, .045, lambda c: .3 * c["_dur"]["train"])), variant=1.5)
    add("drift-smooth", "ch", "preisach", raster(500, [(2, 1.0, 5, 0), (5, .6, 10, .2), (8, .9, 16, 0), (3, .7, 7, .1), (6, 1.0, 12, 0), (2, .8, 5, 0)], [(4, .9, 8, 0), (7, .6, 14, .2), (2, 1.0, 4, 0)], gap=3.0), E(drift=drift("smooth", .045, .065)))
    # ================= interference (2)
    add("hum-50", "ja", "preisach", forc(1000, 1.1, 5, gap=3.0), E(interference=hum(50.0, (.004, .007), [(1, 1.0), (2, .25), (3, .4)])))
    add("tone", "kp", "preisach", stairs(250, 1.2, n=6, m=8, gap=3.0), E(interference=hum(23.7, (.0045, .008), [(1, 1.0)])))
    # ================= two effects (10)
    sc = lambda f2, hold=3.0: lambda d, r: dict(train=[d.stairs(steps_levels(r, 5, False), hold, .05), d.chirp(1.5, f2, .9, 3.0, .8), d.sine(.7, 1.0, 2)], test=[d.stairs(steps_levels(r, 3, False), hold, .05), d.chirp(f2 * .85, 2.0, .8, 2.0, .8)])
    add("creep+resonance", "pi", "pi", mixed(1000, sc(160)), E(creep=clog(.017, .024), resonance=mode(80, 110)))
    add("lag+hum-60", "preisach", "preisach", multis(5000, 2, [1, 2, 3, 5, 8, 13, 19, 27, 37], 1.8, .4), E(lag=lag1(.0012, .002), interference=hum(60.0, (.004, .006), [(1, 1.0), (3, .35), (5, .15)])))
    add("temp+load", "kp", "preisach", mid(50, .3, 100), E(temperature=tk(.004, .006), load=wl(loadc(.02, .03))), temp=("room", 8.0), load=("steps", 12.0))
    add("delay+asymmetry", "walls", "pi", chirps(5000, 2, 90, 2.0, (1.0, .6)), E(delay=dly(.0006, .0009), asymmetry=bnd("output", "quadratic", .2, .3)))
    add("drift+tone", "ja", "preisach", sines(1000, [(.5, 1.0, 2), (1, .7, 3), (3, .9, 6), (7, 1.0, 7)], [(.8, .85, 2), (2, 1.0, 4), (5, .7, 5)], gap=3.0), E(drift=drift("settling", .03, .045, lambda c: .35 * c["_dur"]["train"]), interference=hum(87.3, (.004, .006), [(1, 1.0), (2, .3)])))
    add("rate+creep", "bw", "preisach", mixed(500, lambda d, r: dict(train=[d.stairs(steps_levels(r, 5, False), 3.5, .08), d.sine(.4, 1.0, 2), d.sine(2, .8, 4), d.sine(8, 1.0, 10), d.sine(25, .9, 20)], test=[d.stairs(steps_levels(r, 3, False), 3.0, .08), d.sine(1, .9, 2), d.sine(5, .7, 6), d.sine(16, 1.0, 14)])), E(rate_dependence=field(.006, .009), creep=cexp((.6, 9.0), (.02, .035))), variant=2)
    add("resonance+load", "ch", "preisach", chirps(4000, 2, 180, 2.8, (1.0, .55), gap=1.0, taper=.8), E(resonance=mode(90, 135, .015, .03), load=wl(loadc(.02, .03))), load=("steps", 30.0))
    add("saturation+creep", "rayleigh", "pi", mixed(200, lambda d, r: dict(train=[d.stairs(updown(7), 2.0, .02), d.tri(.8, 1.0, 4), d.stairs(steps_levels(r, 6, False), 3.0, .02), d.sine(.5, 1.0, 3)], test=[d.stairs(steps_levels(r, 5, False), 2.5, .02), d.tri(.6, .97, 3)])), E(saturation=lambda c, r: dict(at="amplifier", hi=U(r, .86, .91)), creep=cexp((.8, 12.0), (.035, .05))))
    add("asymmetry+resonance", "kp", "pi", chirps(5000, 2, 200, 2.5, (1.0, .5), taper=.8), E(asymmetry=bnd("input", "quadratic", .25, .35), resonance=mode(100, 140)))
    add("lag+drift", "dahl", "preisach", midchirps(1000, 1.0, 30, 2.0, 16.0, 1.31), E(lag=lag1(.002, .003), drift=drift("linear", .06, .08)))
    # ================= three effects (3)
    add("creep+resonance+hum", "bw", "preisach", mixed(1000, sc(140)), E(creep=clog(.02, .028), resonance=mode(72, 95, .015, .03), interference=hum(50.0, (.004, .006), [(1, 1.0), (3, .4)])), variant=1)
    add("temp+load+lag", "ja", "preisach", mixed(500, lambda d, r: dict(train=[d.sine(.5, 1.0, 3), d.sine(3, .8, 12), d.sine(10, 1.0, 40), d.chirp(.5, 25, .9, 8.0), d.sine(.8, .7, 5), d.sine(20, .6, 60)], test=[d.sine(.7, .9, 3), d.chirp(20, .7, 1.0, 6.0), d.sine(6, .7, 20), d.sine(15, .85, 40)]), gap=4.0), E(temperature=tk(.004, .006), load=wl(loadc(.02, .03)), lag=lag1(.003, .0045)), temp=("room", 8.0), load=("steps", 10.0))
    add("asymmetry+creep+delay", "preisach", "pi", mixed(1000, lambda d, r: dict(train=[d.stairs(steps_levels(r, 5, False), 3.0, .05), d.chirp(1, 60, .9, 3.0), d.sine(.7, 1.0, 2)], test=[d.stairs(steps_levels(r, 3, False), 2.5, .05), d.chirp(50, 1.5, .7, 2.0)])), E(asymmetry=bnd("input", "quadratic", .22, .32), creep=clog(.02, .027), delay=dly(.0015, .0024)))
    return cases


def write_csv(path, case, o, y):
    n = len(y); r = np.random.default_rng([case["seed"], 77, int(1e3 * o["t"][-1])]); cols, fmt, A = [], [], []
    if not case["starts_mid_cycle"]: cols.append("segment"); fmt.append("%d"); A.append(o["seg"])
    cols += ["time_s", "voltage_v", "displacement_um"]; fmt += ["%.6f", "%.3f", "%.6f"]; A += [o["t"], o["v"] * case["volt_span"], y]
    if "temperature_degc" in case["columns"]: cols.append("temperature_degc"); fmt.append("%.3f"); A.append(np.round(o["T"] + r.normal(0, .012, n), 2))
    if "load_n" in case["columns"]: cols.append("load_n"); fmt.append("%.4f"); A.append(o["F"] * 1.0 + r.normal(0, 1.5e-3 * max(np.abs(o["F"]).max(), 1e-9), n))
    np.savetxt(path, np.column_stack(A), delimiter=",", header=",".join(cols), comments="", fmt=fmt)


def run(case, out):
    d = os.path.join(out, case["id"]); os.makedirs(d, exist_ok=True); full = list(case["effects"]); rows = []; S = case["stroke_um"]; clean = {}
    if case["starts_mid_cycle"]:
        case["_y0"] = {p: 0.0 for p in ("train", "test")}
        for p in ("train", "test"): case["_y0"][p] = float(record(case, p, [])["y"].mean())
    for p in ("train", "test"):
        nz = None
        for tag, names in (("", full), ("twin-", [])):
            o = record(case, p, names); clean[tag + p] = o
            if nz is None: nz = noise_of(case, p, len(o["y"]))
            y = o["y"] + nz; q = case["noise"]["lsb_um"]; y = np.round(y / q) * q; assert np.all(np.isfinite(y)), case["id"]
            write_csv(f"{d}/{tag}{p}.csv", case, o, y)
    case["rows"] = dict(train=len(clean["train"]["y"]), test=len(clean["test"]["y"]))
    lo, hi = (-.5, .5) if case["bipolar"] else (0.0, 1.0); tr = clean["train"]; B = basis(case["model"], tr["v"], tr["seg"], lo, hi); n = len(tr["y"])
    keep = np.arange(n)[:: max(1, n // 4000)]
    if case["starts_mid_cycle"]: keep = keep[keep > .12 * n]
    Bk = B[keep]; sc_ = np.sqrt((Bk ** 2).mean(0)) + 1e-12; Bk = Bk / sc_; s, u = np.linalg.eigh(Bk.T @ Bk); u = Bk @ (u[:, s > 1e-11 * s[-1]] / np.sqrt(s[s > 1e-11 * s[-1]]))
    left = lambda x: float(np.sqrt(np.mean((x[keep] - u @ (u.T @ x[keep])) ** 2))); rms = lambda x: float(np.sqrt(np.mean(x ** 2)))
    mis = left(clean["twin-train"]["y"]); nu = case["noise_um"]
    base = dict(id=case["id"], law=case["base"], model=case["model"], experiment=case["experiment"], fs_hz=case["fs"], rows_train=n, rows_test=len(clean["test"]["y"]), stroke_um=S, volt_span=case["volt_span"], bipolar=int(case["bipolar"]), loop_pct=round(100 * case["loop_width"], 1), noise=case["noise"]["kind"], noise_um=round(nu, 6), noise_pct=round(100 * nu / S, 4))
    for e in full or [""]:
        r = dict(base, effect=e or "-", expect="+".join(case["expect"]) or "none", accept=" | ".join("+".join(a) or "none" for a in case["accept"]))
        if e:
            rest = [x for x in full if x != e]; dtr = clean["train"]["y"] - (record(case, "train", rest)["y"] if rest else clean["twin-train"]["y"]); dte = clean["test"]["y"] - (record(case, "test", rest)["y"] if rest else clean["twin-test"]["y"]); l = left(dtr)
            r.update(raw_um=round(rms(dtr), 5), raw_test_um=round(rms(dte), 5), raw_per_noise=round(rms(dtr) / nu, 1), raw_pct=round(100 * rms(dtr) / S, 3), left_um=round(l, 5), left_per_noise=round(l / nu, 1), left_pct=round(100 * l / S, 3), left_per_misfit=round(l / mis, 2))
        r.update(misfit_um=round(mis, 5), misfit_pct=round(100 * mis / S, 3)); rows.append(r)
    json.dump({k: v for k, v in case.items() if not k.startswith("_")}, open(f"{d}/truth.json", "w"), indent=1)
    return rows


def main():
    a = sys.argv[1:]; seed = DEFAULT_SEED
    if "--seed" in a: i = a.index("--seed"); seed = int(a[i + 1]); del a[i:i + 2]
    if not a: sys.exit(__doc__)
    out, want = a[0], a[1:]; os.makedirs(out, exist_ok=True); t0 = time.time(); rows = []
    for c in build(seed):
        if want and not any(c["id"].startswith(w) for w in want): continue
        rr = run(c, out); rows += rr
        for r in rr: print(f'{r["id"]:26s} {r["law"]:9s} {r["model"]:9s} {r["rows_train"]:6d} {r["loop_pct"]:5.1f}% {r["effect"]:16s} raw {r.get("raw_um", 0):8.4f} um = {r.get("raw_per_noise", 0):6.1f} noise = {r.get("raw_pct", 0):6.3f}% span | left {r.get("left_per_noise", 0):6.1f} noise {r.get("left_pct", 0):6.3f}% | misfit {r["misfit_pct"]:.3f}% noise {r["noise_pct"]:.3f}%', flush=True)
    keys = []
    for r in rows: keys += [k for k in r if k not in keys]
    with open(os.path.join(out, "summary.csv"), "w", newline="") as f: w = csv.DictWriter(f, keys); w.writeheader(); w.writerows(rows)
    print(f"{len(set(r['id'] for r in rows))} cases, {time.time() - t0:.0f} s", flush=True)


if __name__ == "__main__": main()
