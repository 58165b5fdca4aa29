#!/usr/bin/env python
"""Fourth examination of `hystctl diagnose`: `python fourth.py OUT [--seed N]` writes 64 simulated actuators as
OUT/<id>/{train,test,twin-train,twin-test}.csv and OUT/<id>/truth.json. Each effect is scaled so that its remainder after a flexible
rate-independent model is 7 to 27 times the noise. All test records begin after a rest in the middle of the range."""
import os
for k in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
    os.environ.setdefault(k, "1")
import sys, json, argparse, itertools, time
import numpy as np
from numba import njit
from scipy import signal
from scipy.optimize import nnls

SEED = 759353
TEMP = "temperature_degc"
NAMES = ["delay", "lag", "rate-dependence", "creep", "temperature", "load", "resonance",
         "saturation", "asymmetry", "drift", "interference"]

# ------------------------------------------------------------------ hysteresis laws
# every kernel: v (drive, -1..1), thr (factor on thresholds), parameters -> z (-1..1 about)

@njit(cache=True)
def k_plays(v, thr, r, w):
    n = len(v); m = len(r); x = np.zeros(m); out = np.zeros(n)
    for i in range(n):
        s = 0.0
        for j in range(m):
            a = r[j]*thr[i]
            if x[j] < v[i]-a: x[j] = v[i]-a
            elif x[j] > v[i]+a: x[j] = v[i]+a
            s += w[j]*x[j]
        out[i] = s
    return out

@njit(cache=True)
def k_relays(v, thr, c, hw, w):
    n = len(v); m = len(c); x = np.empty(m); out = np.zeros(n)
    s = 0.0
    for j in range(m):
        x[j] = -1.0 if c[j] > 0 else 1.0
        s += w[j]*x[j]
    for i in range(n):
        vi = v[i]; q = thr[i]
        for j in range(m):
            if x[j] < 0:
                if vi >= c[j]+hw[j]*q:
                    x[j] = 1.0; s += 2*w[j]
            elif vi <= c[j]-hw[j]*q:
                x[j] = -1.0; s -= 2*w[j]
        out[i] = s
    return out

@njit(cache=True)
def k_kp(v, thr, c, hw, a, w):
    n = len(v); m = len(c); x = np.zeros(m); out = np.zeros(n)
    for i in range(n):
        s = 0.0
        for j in range(m):
            up = (v[i]-c[j]-hw[j]*thr[i])/a[j]; dn = (v[i]-c[j]+hw[j]*thr[i])/a[j]
            up = min(1.0, max(-1.0, up)); dn = min(1.0, max(-1.0, dn))
            if x[j] < up: x[j] = up
            elif x[j] > dn: x[j] = dn
            s += w[j]*x[j]
        out[i] = s
    return out

@njit(cache=True)
def k_boucwen(v, thr, A, beta, gamma, ne):
    n = len(v); out = np.zeros(n); z = 0.0
    for i in range(1, n):
        dv = v[i]-v[i-1]
        for _ in range(2):
            q = abs(z)/thr[i]
            p = q**ne
            sz = 1.0 if z > 0 else -1.0
            d = 0.5*dv
            z += A*d - beta*abs(d)*p*sz - gamma*d*p
        out[i] = z
    return out

@njit(cache=True)
def k_dahl(v, thr, sig, fc, ex):
    n = len(v); out = np.zeros(n); z = 0.0
    for i in range(1, n):
        dv = v[i]-v[i-1]
        s = 1.0 if dv > 0 else -1.0
        b = 1.0 - s*z/(fc*thr[i])
        sb = 1.0 if b > 0 else -1.0
        z += sig*sb*abs(b)**ex*dv
        out[i] = z
    return out

@njit(cache=True)
def k_slip(v, thr, k, f):
    n = len(v); m = len(k); z = np.zeros(m); out = np.zeros(n)
    for i in range(1, n):
        dv = v[i]-v[i-1]; s = 0.0
        for j in range(m):
            z[j] += k[j]*dv
            l = f[j]*thr[i]
            if z[j] > l: z[j] = l
            elif z[j] < -l: z[j] = -l
            s += z[j]
        out[i] = s
    return out

@njit(cache=True)
def k_ch(v, thr, al, b, c, g):
    n = len(v); out = np.zeros(n); z = 0.0
    for i in range(1, n):
        dv = v[i]-v[i-1]
        vm = 0.5*(v[i]+v[i-1])
        f = b*np.tanh(c*vm)/np.tanh(c)
        z += al/thr[i]*abs(dv)*(f-z) + g*dv
        out[i] = z
    return out

@njit(cache=True)
def k_ja(v, thr, a, alpha, k, cc):
    n = len(v); out = np.zeros(n); M = 0.0
    for i in range(1, n):
        dv = v[i]-v[i-1]
        he = v[i] + alpha*M
        x = he/a
        if abs(x) > 1e-3:
            man = 1/np.tanh(x) - 1/x
        else:
            man = x/3
        s = 1.0 if dv > 0 else -1.0
        kk = k*thr[i]
        dm = man-M
        if dm*s > 0:
            M += abs(dm)/(kk-alpha*abs(dm))*dv
        out[i] = (1-cc)*M + cc*man
    return out

@njit(cache=True)
def k_walls(v, thr, stiff, amp, kw, ph, mob, h):
    # overdamped walls in a random pinning force: mob <= 0: quasi-static
    n = len(v); m, q = amp.shape; x = np.zeros(m); out = np.zeros(n)
    for i in range(n):
        s = 0.0
        for j in range(m):
            kmax = stiff
            for l in range(q): kmax += amp[j, l]*kw[j, l]*thr[i]
            if mob <= 0:
                for it in range(400):
                    f = v[i] - stiff*x[j]
                    for l in range(q): f -= amp[j, l]*thr[i]*np.sin(kw[j, l]*x[j]+ph[j, l])
                    x[j] += f/kmax
                    if abs(f) < 2e-4: break
            else:
                ns = int(np.ceil(h*mob*kmax/0.7)); 
                if ns < 1: ns = 1
                for it in range(ns):
                    f = v[i] - stiff*x[j]
                    for l in range(q): f -= amp[j, l]*np.sin(kw[j, l]*x[j]+ph[j, l])
                    x[j] += f*mob*h/ns
            s += x[j]
        out[i] = s/m
    return out

@njit(cache=True)
def k_slew(v, lim):
    out = v.copy()
    for i in range(1, len(v)):
        d = v[i]-out[i-1]
        if d > lim: d = lim
        elif d < -lim: d = -lim
        out[i] = out[i-1]+d
    return out

@njit(cache=True)
def k_stick(y, th):
    out = y.copy(); k = 0; m = len(th); x = y[0]
    for i in range(len(y)):
        if abs(y[i]-x) > th[k]:
            x = y[i]; k = (k+1) % m
        out[i] = x
    return out

class Law:
    """y = (1-w) v + w z; w gives the loop the wanted width"""
    def __init__(self, name, rng, width=None):
        self.name = name; r = rng
        if name == "plays":
            n = r.integers(12, 40); th = np.sort(r.uniform(0.01, 0.95, n))
            w = r.exponential(1, n)*np.exp(-th*r.uniform(0, 3)); w /= (w*(1-th)).sum()
            self.f = lambda v, q: k_plays(v, q, th, w)
        elif name == "rayleigh":
            th = (np.arange(60)+.5)/60; w = np.ones(60); w /= (w*(1-th)).sum()
            self.f = lambda v, q: k_plays(v, q, th, w)
        elif name.startswith("relays"):
            n = 1200; kind = name[7:]
            if kind == "gauss":
                c = r.normal(0, .4, n); hw = np.abs(r.normal(.15, .2, n))
            elif kind == "uniform":
                a = r.uniform(-1.05, 1.05, n); b = r.uniform(-1.05, 1.05, n)
                c = (a+b)/2; hw = np.abs(a-b)/2
            elif kind == "lobes":
                c = np.where(r.random(n) < .6, r.normal(-.35, .25, n), r.normal(.4, .2, n))
                hw = r.exponential(.2, n)
            else:  # lorentz
                c = r.uniform(-1, 1, n); hw = np.abs(.25+.12*np.tan(np.pi*(r.random(n)-.5)*.9))
            w = r.uniform(.3, 1.7, n); w /= w.sum()
            self.f = lambda v, q: k_relays(v, q, c, hw, w)
        elif name == "kp":
            n = 150; c = r.normal(-.05, .45, n); hw = np.abs(r.normal(.1, .25, n)); a = r.uniform(.1, .5, n)
            w = r.uniform(.3, 1.7, n); w /= w.sum()
            self.f = lambda v, q: k_kp(v, q, c, hw, a, w)
        elif name == "bouc-wen":
            A = r.uniform(2.5, 4.5); be = A*r.uniform(.55, .8); ga = A-be; ne = r.uniform(1., 1.5)
            self.f = lambda v, q: v - k_boucwen(v, q, A, be, ga, ne)
        elif name == "dahl":
            sg = r.uniform(2.5, 4.5); ex = r.uniform(.9, 1.4)
            self.f = lambda v, q: v - k_dahl(v, q, sg, 1.0, ex)
        elif name == "maxwell-slip":
            n = r.integers(6, 14); k = r.uniform(.5, 1.5, n); d = np.sort(r.uniform(.03, .9, n)); f = k*d
            s = f.sum(); k = k/s; f = f/s
            self.f = lambda v, q: v - k_slip(v, q, k, f)
        elif name == "coleman-hodgdon":
            al = r.uniform(2., 4.); c = r.uniform(.4, 1.1); g = r.uniform(0, .3)
            self.f = lambda v, q: k_ch(v, q, al, 1.0, c, g)
        elif name == "jiles-atherton":
            a = r.uniform(.3, .5); k = r.uniform(.2, .35); alp = r.uniform(.02, .1); cc = r.uniform(.05, .2)
            self.f = lambda v, q: 1.4*k_ja(v, q, a, alp, k, cc)
        elif name == "domain-walls":
            m, q_ = 80, 3
            amp = r.uniform(.05, .3, (m, q_)); kw = r.uniform(10, 40, (m, q_)); ph = r.uniform(0, 6.283, (m, q_))
            ph = np.where(np.arange(q_) >= 0, ph, ph)
            self.mob = 0.0; self.h = 1.0
            self.f = lambda v, q: k_walls(v, q, 1.0, amp, kw, ph, self.mob, self.h)
        else:
            raise ValueError(name)
        t = np.linspace(0, 1, 4001)
        v = np.concatenate([np.linspace(0, -1, 1000), -np.cos(2*np.pi*t), -np.cos(2*np.pi*t)])
        z = self.f(v, np.ones(len(v)))[-4001:]
        up, dn = z[:2001], z[2000:][::-1]
        wd = np.max(np.abs(up-dn)); rg = z.max()-z.min()
        tgt = width or r.uniform(.06, .18)
        # (w*wd)/((1-w)*2+w*rg) = tgt
        wt = min(tgt*2/(wd-tgt*rg+2*tgt), .95)
        self.w = wt; self.width = wt*wd/((1-wt)*2+wt*rg)
        zz = (1-wt)*(-np.cos(2*np.pi*t))+wt*z
        self.mid = (zz.max()+zz.min())/2; self.half = (zz.max()-zz.min())/2
    def __call__(self, v, thr, mob=0.0, h=1.0):
        pre = np.linspace(0, v[0], 600)
        if self.name == "domain-walls": self.mob, self.h = 0.0, h
        vv = np.concatenate([pre, v]); q = np.concatenate([np.full(600, 1.0), thr])
        if mob > 0:
            self.mob = mob
            vv = np.concatenate([pre, np.full(4000, v[0]), v]); q = np.ones(len(vv))
        z = self.f(vv, q)[-len(v):]
        return ((1-self.w)*v+self.w*z-self.mid)/self.half

# ------------------------------------------------------------------ drives
def d_make(kind, rng, T0, h, P, mid):
    """Returns a list of segments (arrays, fine grid), and the rows (seconds) to skip at the beginning."""
    n = P.get("n", 10); A = P.get("amp", 1.0); dur = n*T0
    t = np.arange(int(round((dur*(1 if not mid else 1.0))/h))+1)*h
    skip = 0.0
    ph0 = -np.pi/2 if P.get("from", "low") == "low" else 0.0
    if kind == "sine":
        if mid: ph0 = rng.uniform(0, 6.28); skip = 2.0*T0; t = np.arange(int(round((dur+skip)/h))+1)*h
        return [A*np.sin(2*np.pi*t/T0+ph0)], skip
    if kind in ("grow", "decay"):
        if mid: skip = 1.37*T0; t = np.arange(int(round((dur+skip)/h))+1)*h
        e = np.clip((t)/(t[-1]), 0, 1); a = P.get("a0", .15)
        env = a+(1-a)*e if kind == "grow" else 1-(1-a)*e
        if P.get("uni"):
            return [-1+A*env*(1-np.cos(2*np.pi*t/T0))], skip
        on = np.clip(t/(.25*T0), 0, 1)
        return [A*env*np.sin(2*np.pi*t/T0)*on], skip
    if kind == "tri":
        sizes = P.get("sizes", [1.0]); out = []
        if mid: skip = rng.uniform(1.1, 1.9)*T0; t = np.arange(int(round((dur+skip)/h))+1)*h
        per = len(t)/len(sizes)
        tri = signal.sawtooth(2*np.pi*t/T0, .5)
        k = np.minimum((np.arange(len(t))/(T0/h)*len(sizes)/(t[-1]/T0+1e-9)).astype(int), len(sizes)-1)
        # the amplitude changes at the low end, after whole periods
        pk = np.minimum((np.floor(t/T0)*len(sizes)/np.ceil(t[-1]/T0)).astype(int), len(sizes)-1)
        a = np.array(sizes)[pk]
        if P.get("centre"):
            v = A*tri*a
            # avoid a step between amplitudes: move there at the same rate
            lim = 4.2/T0*h
            v = k_slew(v, lim)
        else:
            v = -A+A*(tri+1)*a
        return [v], skip
    if kind == "stairs":
        lv = P.get("levels", 10); tr = P.get("rise", .1)*T0
        if P.get("ladder"):
            up = np.linspace(-A, A, lv//2+1); lev = np.concatenate([up, up[::-1][1:]])
            lev = np.concatenate([lev, lev[1:]*.7-.3*A]) if P.get("twice") else lev
        else:
            lev = rng.uniform(-A, A, lv); lev[0] = -A if not mid else lev[0]; lev[2] = A; lev[4] = -A
            for i in range(1, lv):
                if abs(lev[i]-lev[i-1]) < .25*A:
                    lev[i] = np.clip(lev[i-1]-np.sign(lev[i-1]+1e-9)*rng.uniform(.5, 1)*A, -A, A)
        v = []
        nh = int(round((T0-tr)/h)); nr = max(2, int(round(tr/h)))
        for i, l in enumerate(lev):
            hold = int(nh*(1 if not P.get("uneven") else rng.uniform(.5, 1.8)))
            if i: v.append(lev[i-1]+(l-lev[i-1])*(.5-.5*np.cos(np.pi*np.arange(1, nr+1)/nr) if P.get("cos") else np.arange(1, nr+1)/nr))
            else: hold = max(4, hold//4)
            v.append(np.full(hold, l))
        v = np.concatenate(v)
        if mid: skip = 1.6*T0
        return [v], skip
    if kind == "chirp":
        ra = P.get("ratio", 20.)
        if mid: skip = 1.3*T0
        if P.get("lin"): ph = 2*np.pi/T0*(t+(ra-1)*t*t/(2*dur))
        else: L = np.log(ra); ph = 2*np.pi/T0*dur/L*(np.exp(t/dur*L)-1)
        return [A*np.sin(ph+ph0)*(1-P.get("taper", 0.)*t/t[-1])], skip
    if kind == "walk":
        tt = np.arange(int(round((dur+2*T0)/h)))
        x = rng.normal(size=len(tt))
        sos = signal.butter(3, min(.9, 2*h/T0), output="sos")
        x = signal.sosfilt(sos, x)
        slow = signal.sosfilt(signal.butter(2, min(.9, 2*h/T0/6), output="sos"), rng.normal(size=len(tt)))
        i0 = int(1.5*T0/h)
        x = x/x[i0:].std()+P.get("slow", 1.2)*slow/slow[i0:].std(); x = x[i0:]
        x = x-(x.max()+x.min())/2; x = x/np.abs(x).max()
        x = np.tanh(1.6*x)/np.tanh(1.6)*A
        if mid: skip = .12*dur
        else:
            nn = max(4, int(.5*T0/h)); e = np.clip(np.arange(len(x))/nn, 0, 1); x = x*(3*e**2-2*e**3)
        return [x], skip
    if kind == "segs":
        out = []
        for f, a, m in P["list"]:
            tt = np.arange(int(round(m*T0/f/h))+1)*h
            out.append(A*a*signal.sawtooth(2*np.pi*tt*f/T0, .5) if P.get('tri') else -A*a*np.cos(2*np.pi*tt*f/T0) if not P.get("low") else -A+A*a*(1-np.cos(2*np.pi*tt*f/T0)))
        if mid: skip = P["list"][0][2]*T0/P["list"][0][0]*.33
        return out, skip
    if kind == "nested":
        pts = P.get("points")
        if pts is None:
            pts = [-1]
            for a in P.get("tops", [1, .6, .2, .8, -.2, .4]):
                pts += [a]
                if P.get("minor"):
                    m_ = a-rng.uniform(.3, .6)*(a+1); pts += [m_, a-.1*(a-m_), m_+.2*(a-m_), a]
                pts += [-1]
        v = []
        for a, b in zip(pts[:-1], pts[1:]):
            k = max(8, int(round(abs(b-a)/4*T0/h))); s = np.arange(1, k+1)/k
            if P.get("cos"): s = .5-.5*np.cos(np.pi*s)
            v.append(A*(a+(b-a)*s))
            if P.get("hold"): v.append(np.full(int(P["hold"]*T0/h), A*b))
        v = np.concatenate(v)
        if mid: skip = .7*T0
        return [v], skip
    if kind == "multi":
        fs_ = P.get("f", [1, 2.7, 6.3]); am = P.get("a", [.6, .3, .2]); am = np.array(am)/sum(am)*A
        if mid: skip = 1.2*T0; t = np.arange(int(round((dur+skip)/h))+1)*h
        x = sum(a*np.sin(2*np.pi*f*t/T0+rng.uniform(0, 6.28)*(1 if mid else 0)) for f, a in zip(fs_, am))
        return [x], skip
    raise ValueError(kind)

class Rec:
    def __init__(self, drive, rng, fs, mid, os_, cols, tkind, lkind, scale=1.0):
        kind, T0, P = drive
        h = 1/(fs*os_); self.h = h; self.T0 = T0; self.kind = kind; self.P = P; self.os = os_; self.fs = fs
        segs, skip = d_make(kind, rng, T0, h, P, mid)
        v, rec, sg = [], [], []
        for i, s in enumerate(segs):
            if i:
                g = int(round(rng.uniform(.4, 1.2)*min(T0, len(segs[i-1])*h/2)/h/os_))*os_
                e = np.arange(1, g+1)/g
                v.append(v[-1][-1]+(s[0]-v[-1][-1])*(.5-.5*np.cos(np.pi*e))); rec.append(np.zeros(g, bool)); sg.append(np.full(g, -1))
            s = s[:len(s)//os_*os_] if len(s) > os_ else s
            v.append(s*scale); rec.append(np.ones(len(s), bool)); sg.append(np.full(len(s), i))
        v = np.concatenate(v); rec = np.concatenate(rec); sg = np.concatenate(sg)
        k0 = int(round(skip/h/os_))*os_
        rec[:k0] = False
        self.v = v; n = len(v); self.t = (np.arange(n)-k0)*h; self.n = n
        idx = np.arange(0, n, os_); self.dec = idx; self.idx = idx[rec[idx]]; self.seg = sg[self.idx]
        self.nseg = len(segs); self.rows = len(self.idx); self.dur = self.t[self.idx[-1]]
        self.seed = int(rng.integers(2**31))
        x = self.t/max(self.dur, 1e-9); self.x = x
        r = rng
        p1, p2 = r.uniform(0, 6.28, 2)
        self.Tn = {"cycle": lambda: np.sin(2*np.pi*1.6*x+p1)*.7+.3*np.sin(2*np.pi*.7*x+p2),
                   "warm": lambda: 2*(1-np.exp(-np.clip(x, 0, None)/.3))-1+.45*np.sin(2*np.pi*2.3*x+p1),
                   "oven": lambda: signal.lfilter(*_lp(h, self.dur/25), np.where(np.sin(2*np.pi*1.9*x+p1) > 0, 1., -1.)),
                   "room": lambda: _smooth(r, n, h, self.dur/5)}[tkind]()
        self.Fn = {"steps": lambda: signal.lfilter(*_lp(h, self.dur/400), _levels(r, n, 14)),
                   "noise": lambda: _smooth(r, n, h, self.dur/30),
                   "sine": lambda: .5+.5*np.sin(2*np.pi*6.37*x+p2),
                   "pulses": lambda: np.clip(np.sin(2*np.pi*7.7*x+p1)-.3, 0, None)}[lkind]()

def _lp(h, tau):
    a = 1-np.exp(-h/tau)
    return [a], [1, -(1-a)]
def lp(x, h, tau):
    b, a = _lp(h, tau)
    return signal.lfilter(b, a, x-x[0])+x[0]
def _smooth(r, n, h, tau):
    k = max(4, int(n*h/tau)+4); p = r.normal(size=k)
    from scipy.interpolate import CubicSpline
    y = CubicSpline(np.arange(k), p)(np.arange(n)*h/tau)
    return y/np.abs(y).max()
def _levels(r, n, k):
    e = np.sort(np.concatenate([[0], r.uniform(0, n, k-1), [n]])).astype(int); y = np.zeros(n)
    for a, b in zip(e[:-1], e[1:]): y[a:b] = r.uniform(0, 1)
    return y
def mode(x, h, f, z):
    w = 2*np.pi*f
    b, a, _ = signal.cont2discrete(([w*w], [1, 2*z*w, w*w]), h, method="foh")
    return signal.lfilter(b.ravel(), a, x-x[0])+x[0]

# ------------------------------------------------------------------ the actuator
def thr_of(R, v, e, s):
    rate = np.abs(np.gradient(v, R.h))/e["ref"]
    if e["law"] == "power": return 1+s*rate**e["p"]
    if e["law"] == "log": return 1+s*np.log1p(rate/e["r0"])
    if e["law"] == "thermal":  # walls that are thermally activated: arcsinh of the rate
        return 1+s*np.arcsinh(rate/e["r0"])
    return np.ones(len(v))

def creep_terms(e):
    return e["taus"], e["g"]

def simulate(C, R, eff):
    """Returns the clean record (normalised, every fine step); eff: {name: (dict, size)}."""
    v = R.v; h = R.h; t = R.t
    E = lambda n: eff.get(n, (None, 0.0))
    e, s = E("delay")
    if e: v = np.interp(t-s, t, v)
    e, s = E("lag")
    if e: v = lp(v, h, s)
    u, us = E("unknown"); uk = u["law"] if u else ""
    ur = np.random.default_rng(R.seed)
    if uk == "slew": v = k_slew(v, h*u["max"]/(1+us))
    sat, ss = E("saturation")
    if sat and sat["law"] == "rail":
        hi = 1-2*ss; v = np.minimum(v, hi)
    e, s = E("asymmetry")
    if e and e["law"] == "drive": v = v+s*(e["a2"]*(v*v-1)+e["a3"]*(v**3-v))
    e, s = E("rate-dependence"); mob = 0.0
    if e and e["law"] == "viscous": mob = 1/s; thr = np.ones(len(v))
    elif e: thr = thr_of(R, v, e, s)
    else: thr = np.ones(len(v))
    y = C.law(v, thr, mob, h)
    e, s = E("asymmetry")
    if e and e["law"] == "output": y = y+s*(e["a2"]*(y*y-1)+e["a3"]*(y**3-y))
    y0 = C.y0; add = np.zeros(R.n); gain = 1.0
    e, s = E("temperature")
    if e:
        T = lp(R.Tn, h, e["tau_of"]*R.dur) if e.get("tau_of") else R.Tn
        if "gain" in e["law"]: gain = gain*(1+s*T)
        if "expansion" in e["law"]: add = add+s*T*e.get("share", 1.)
    e, s = E("load")
    if e:
        if "gain" in e["law"]: gain = gain*(1-s*R.Fn)
        if "compliance" in e["law"]: add = add-s*R.Fn
    if uk == "gain-steps": gain = gain*(1+us*(2*_levels(ur, R.n, 9)-1))
    if uk == "gain-wander": gain = gain*(1+us*_smooth(ur, R.n, h, R.dur/7))
    y = (y-y0)*gain+y0
    e, s = E("creep")
    if e:
        c = sum(g*lp(y, h, tau) for tau, g in zip(e["taus"], e["g"]))
        y = y+s*(c-y0*sum(e["g"]))
    e, s = E("resonance")
    if e:
        m = sum(g*(mode(y, h, f, z)-y) for f, z, g in zip(e["f"], e["zeta"], e["g"]))
        y = y+s*m
    if sat and sat["law"] != "rail":
        hi, lo = 1-2*ss, -1+2*ss*sat.get("lower", 1.)
        so = sat.get("soft", 0.)*ss
        if sat["ends"] in ("both", "upper"):
            y = np.minimum(y, hi) if so == 0 else y-so*np.logaddexp(0, (y-hi)/so)
        if sat["ends"] in ("both", "lower"):
            y = np.maximum(y, lo) if so == 0 else y+so*np.logaddexp(0, (lo-y)/so)
    if uk == "stick-slip": y = k_stick(y, us*ur.uniform(.3, 1.3, 4096))
    e, s = E("drift")
    if e:
        x = t/C.dur
        xx = np.clip(x, 0, None)
        add = add+s*{"line": lambda: x, "settling": lambda: 1-np.exp(-xx/e["tau"]),
                     "s-shape": lambda: 1/(1+np.exp(-(x-e["at"])/e["wid"]))}[e["law"]]()
    e, s = E("interference")
    if e:
        for f, a, p in zip(e["f"], e["a"], e["ph"]): add = add+s*a*np.sin(2*np.pi*f*t+p+R.seed % 7)
    if uk == "telegraph":
        k = ur.exponential(R.dur/18, 400).cumsum()+t[0]; add = add+us*((np.searchsorted(k, t) % 2)-.5)
    if uk == "hidden-force":
        f = np.zeros(R.n)
        for _ in range(11):
            c, w = ur.uniform(0, R.dur), R.dur*ur.uniform(.006, .04); f += ur.normal()*np.exp(-.5*((t-c)/w)**2)
        add = add+us*f
    return y+add

def clean(C, R, eff): return simulate(C, R, eff)[R.idx]

# ------------------------------------------------------------------ judging
@njit(cache=True)
def b_plays(v, r):
    n = len(v); m = len(r); out = np.zeros((n, m)); x = np.zeros(m)
    for i in range(n):
        for j in range(m):
            if x[j] < v[i]-r[j]: x[j] = v[i]-r[j]
            elif x[j] > v[i]+r[j]: x[j] = v[i]+r[j]
            out[i, j] = x[j]
    return out
@njit(cache=True)
def b_cells(v, L, q):
    n = len(v); m = L*(L+1)//2; out = np.zeros((n, m)); k = 0
    for a in range(L):
        for b in range(a+1):
            for p in range(q):
                for o in range(q):
                    al = -1.02+2.04*(a+(p+.5)/q)/L; be = -1.02+2.04*(b+(o+.5)/q)/L
                    if be > al: al, be = be, al
                    x = -1.0 if al+be > 0 else 1.0
                    for i in range(n):
                        if v[i] >= al: x = 1.0
                        elif v[i] <= be: x = -1.0
                        out[i, k] += x/(q*q)
            k += 1
    return out

class Proj:
    def __init__(self, B):
        B = B-B.mean(0)*0; nrm = np.sqrt((B*B).mean(0)); B = B[:, nrm > 1e-9]/nrm[nrm > 1e-9]
        G = B.T@B/len(B); w, U = np.linalg.eigh(G); k = w > 1e-9*w[-1]
        self.Q = B@(U[:, k]/np.sqrt(w[k])); self.n = len(B)
    def __call__(self, d):
        d = d-self.Q@(self.Q.T@d/self.n)
        return d-self.Q@(self.Q.T@d/self.n)
rms = lambda x: float(np.sqrt(np.mean(np.square(x))))

class Judge:
    def __init__(self, C, R):
        self.C, self.R = C, R
        pre = np.linspace(0, R.v[0], 60)
        vd = np.concatenate([pre, R.v[R.dec]]); pos = np.searchsorted(R.dec, R.idx)+60
        k = max(1, -(-R.rows//16000)); self.sub = np.arange(0, R.rows, k); pos = pos[self.sub]
        amax = np.abs(R.v).max()
        P = b_plays(vd, amax*np.linspace(0.02, .95, 12))[pos]; v = vd[pos][:, None]
        one = np.ones((len(pos), 1))
        self.lin = Proj(np.hstack([one, v, P]))
        flex = [one, v, v*v, P, P*P]
        if C.model == "preisach": flex.append(b_cells(vd, 10, 4)[pos])
        self.flex = Proj(np.hstack(flex))
        self.base = clean(C, R, {}); b = self.base[self.sub]
        self.misfit = rms(self.flex(b)); self.misfit_lin = rms(self.lin(b))
        r = self.lin(b); yf = b-r
        A = np.stack([self.lin(yf**2), self.lin(yf**3)], 1)
        r1 = r-A@np.linalg.lstsq(A, r, rcond=None)[0]
        self.bend = np.sqrt(max(0, rms(r)**2-rms(r1)**2))
    def p(self, name): return self.lin if self.islin(name) else self.flex
    def islin(self, name): return name == "asymmetry" or (name == "saturation" and self.C.model == "pi" and self.R.kind == "sine")
    def mis(self, name): return self.misfit_lin if self.islin(name) else self.misfit
    def size(self, name, d): return rms(self.p(name)(d[self.sub]))
    # ---- dictionaries of rival explanations around the twin
    def rivals(self):
        if hasattr(self, "_r"): return self._r
        C, R, J = self.C, self.R, self; out = {}; h = R.h
        b = simulate(C, R, {}); S = lambda x: x[R.idx][self.sub]
        y = S(b); t = R.t; T0 = R.T0; dt = 1/R.fs
        tmin = .1*dt
        slow = T0/min(1, min([f for f, _, _ in R.P["list"]] if "list" in R.P else [1]))
        taus = np.geomspace(tmin, slow/3, 16)
        out["delay"] = [(S(np.interp(t-x, t, b)-b)[:, None], 1) for x in taus]
        out["lag"] = [(S(lp(b, h, x)-b)[:, None], 1) for x in taus]
        ref = np.sqrt(np.mean(np.gradient(R.v, h)**2))
        out["rate-dependence"] = [(S(C.law(R.v, thr_of(R, R.v, dict(law=l, p=p, r0=r0, ref=ref), .08), 0., h)-b)[:, None], 1)
                                  for l, p, r0 in (("power", .3, 0), ("power", .6, 0), ("power", 1., 0), ("log", 0, .05))]
        tc = np.geomspace(max(3*dt, T0/4), 3*R.dur, 7)
        out["creep"] = [(np.stack([S(lp(b, h, x)) for x in tc], 1), 1)]
        if "temperature" in C.cols:
            L = [lp(R.Tn, h, x*R.dur) for x in (.01, .05, .2)]
            out["temperature"] = [(np.stack([S(a*c) for a in (R.Tn, x)  for c in (1., b)], 1), 0) for x in L]
        if "load" in C.cols: out["load"] = [(np.stack([S(R.Fn), S(R.Fn*b)], 1), 0)]
        fm = min(R.fs/3, 150/T0)
        out["resonance"] = [(S(mode(b, h, f, z)-b)[:, None], 1) for f in np.geomspace(.5/T0, fm, 14) for z in (.01, .05, .15)]
        o = []
        for q in (.6, .75, .85, .92, .96, .985):
            lv = -1+2*q
            u = y-np.minimum(y, lv); l = y-np.maximum(y, -lv)
            o += [(-u[:, None], 1), (-l[:, None], 1), (-(u+l)[:, None], 1)]
            so = .1*(1-lv)+.02; o += [(-(so*np.logaddexp(0, (y-lv)/so))[:, None], 1), ((so*np.logaddexp(0, (-lv-y)/so))[:, None], 1)]
        out["saturation"] = o
        if C.model == "pi":
            o = [y**2, y**3, y**4]
            for q in (2, 3):
                vv = R.v+.02*R.v**q; o.append(S(C.law(vv, np.ones(R.n), 0., h)-b)/.02)
            out["asymmetry"] = [(np.stack(o, 1), 0)]
        x = t[R.idx][self.sub]/R.dur
        o = [(np.stack([x, x*x*0+np.exp(-x/a)], 1), 0) for a in (.02, .06, .15, .4)]
        o += [((1/(1+np.exp(-(x-c)/w)))[:, None], 0) for c in (.2, .35, .5, .65, .8) for w in (.03, .08, .2)]
        out["drift"] = o
        self._r = out; self._x = x
        return out
    def fit(self, d, names, lin=False):
        """Returns the RMS of d after fitting all named effects and the hysteresis."""
        R = self.rivals()
        pr = self.lin if lin or "asymmetry" in names else self.flex
        if any(n not in R and n != "interference" for n in names): return np.inf
        d = pr(d[self.sub]) if len(d) != len(self.sub) else pr(d)
        best = np.inf
        lists = []
        for n in names:
            if n == "interference": lists.append(self._tone(d, pr)); continue
            key = (n, id(pr))
            if not hasattr(self, "_pc"): self._pc = {}
            if key not in self._pc: self._pc[key] = [(np.stack([pr(c) for c in A.T], 1), s) for A, s in R[n]]
            L = self._pc[key]
            if len(names) > 1:  # only the best single ones
                L = sorted(L, key=lambda q: self._one(d, [q]))[:6]
            lists.append(L)
        for combo in itertools.product(*lists): best = min(best, self._one(d, combo))
        return best
    def _one(self, d, parts):
        cols = []
        for A, pos in parts:
            cols.append(A)
            if not pos: cols.append(-A)
        A = np.hstack(cols); nr = np.sqrt((A*A).mean(0))+1e-15; A = A/nr
        G = A.T@A/len(d); g = A.T@d/len(d)
        w, U = np.linalg.eigh(G); k = w > 1e-10*max(w[-1], 1e-30)
        H = (np.sqrt(w[k])[:, None]*U[:, k].T); f = (U[:, k].T@g)/np.sqrt(w[k])
        c, rn = nnls(H, f, maxiter=500)
        return float(np.sqrt(max(0, np.mean(d*d)-f@f+rn*rn)))
    def _tone(self, d, pr):
        R = self.R; t = R.t[R.idx][self.sub]
        if R.nseg > 1: n0 = np.sum(R.seg[self.sub] == R.seg[self.sub][0])
        else: n0 = len(t)
        dd = d[:n0]; dt = t[1]-t[0]
        F = np.abs(np.fft.rfft(dd*np.hanning(n0), 4*n0)); fr = np.fft.rfftfreq(4*n0, dt)
        F[fr < 2/(n0*dt)] = 0
        if R.kind in ("sine", "tri", "grow", "decay"):   # a tone locked to the drive does not count
            q = fr*R.T0; F[np.abs(q-np.round(q)) < 3*R.T0/(n0*dt)] = 0
        f = fr[np.argmax(F)]; out = []
        for ff in (f,):
            c = [g(2*np.pi*k*ff*t) for k in (1, 2, 3) for g in (np.sin, np.cos)]
            out.append((np.stack([pr(x) for x in c], 1), 0))
        return out

# ------------------------------------------------------------------ cases
class Case: pass
CASES = []
def C_(law, model, effects, train, test, fs, start="rest", **kw):
    CASES.append(dict(law=law, model=model, effects=effects, train=train, test=test, fs=fs, start=start, **kw))

def table():
    CASES.clear()
    S = lambda *l: list(l)
    # --- no effect (9)
    C_("plays", "pi", {}, ("decay", 1., dict(n=14)), ("tri", 1.5, dict(n=6, amp=.8)), 200, bits=12)
    C_("bouc-wen", "pi", {}, ("decay", .4, dict(n=50)), ("grow", .3, dict(n=20, amp=.85)), 500, "mid", decoy="temperature", noise=.15)
    C_("rayleigh", "pi", {}, ("stairs", 2., dict(levels=24, rise=.3, cos=1)), ("walk", 1.5, dict(n=20, amp=.85)), 100, pink=1)
    C_("maxwell-slip", "pi", {}, ("segs", .1, dict(list=[(1, 1, 6), (3, .7, 10), (8, .45, 20)])), ("walk", .05, dict(n=40, amp=.85)), 4000, "mid", decoy="load")
    C_("relays-gauss", "preisach", {}, ("nested", 4., dict(minor=1)), ("decay", 2., dict(n=9, amp=.9)), 200, spikes=.004)
    C_("jiles-atherton", "preisach", {}, ("chirp", .2, dict(n=20, ratio=15, taper=.6)), ("grow", .05, dict(n=20, amp=.9)), 4000, "mid", noise=.2)
    C_("kp", "preisach", {}, ("tri", .05, dict(n=24, sizes=[1, .75, .5, .3])), ("sine", .04, dict(n=12, amp=.85)), 10000, "mid", bits=12)
    C_("domain-walls", "preisach", {}, ("walk", .2, dict(n=90)), ("segs", .2, dict(list=[(1, .9, 5), (2, .5, 8)])), 500, pink=1)
    C_("coleman-hodgdon", "preisach", {}, ("segs", .5, dict(list=[(1, 1, 6), (1, .7, 6), (2, .4, 8)], low=1)), ("tri", .7, dict(n=8, amp=.9)), 400, neg=1, noise=.2)
    # --- unknown (7)
    C_("plays", "pi", {"unknown": dict(law="gain-steps")}, ("sine", .5, dict(n=40)), ("decay", .6, dict(n=30, amp=.95)), 200)
    C_("relays-lobes", "preisach", {"unknown": dict(law="gain-wander")}, ("tri", .1, dict(n=60, sizes=[1, .7, .9, .5, 1, .8])), ("walk", .1, dict(n=50, amp=.9)), 2000, "mid")
    C_("maxwell-slip", "pi", {"unknown": dict(law="telegraph")}, ("walk", .25, dict(n=80)), ("sine", .2, dict(n=60, amp=.9)), 400)
    C_("jiles-atherton", "preisach", {"unknown": dict(law="stick-slip")}, ("decay", 5., dict(n=14)), ("nested", 6., dict(amp=.9)), 100, noise=.08)
    C_("plays", "pi", {"unknown": dict(law="slew")}, ("walk", .02, dict(n=150)), ("multi", .03, dict(n=60, amp=.9, f=[1, 2.3])), 5000, "mid")
    C_("bouc-wen", "pi", {"unknown": dict(law="hidden-force")}, ("multi", .25, dict(n=40, f=[1, 1.37, 2.9])), ("tri", .3, dict(n=30, amp=.9)), 800)
    C_("kp", "preisach", {"unknown": dict(law="dropouts")}, ("chirp", 1., dict(n=30, ratio=8)), ("walk", .6, dict(n=40, amp=.9)), 250, "mid", bits=14)
    # --- one effect (34)
    D = lambda: {"delay": dict(law="transport")}
    C_("plays", "pi", D(), ("chirp", .05, dict(n=30, ratio=30, lin=1)), ("walk", .004, dict(n=100, amp=.9)), 10000, noise=.2, ratio=(22, 29))
    C_("relays-gauss", "preisach", D(), ("segs", .01, dict(list=[(.25, 1, 4), (1, .9, 14), (3, .7, 30)], tri=1)), ("sine", .008, dict(n=30, amp=.8)), 20000, "mid", noise=.06, ratio=(13, 19))
    C_("coleman-hodgdon", "preisach", D(), ("chirp", .1, dict(n=40, ratio=14, taper=.6)), ("walk", .04, dict(n=60, amp=.9)), 2500, noise=.1, ratio=(14, 20))
    L = lambda: {"lag": dict(law="first-order")}
    C_("bouc-wen", "pi", L(), ("tri", .02, dict(n=60, sizes=[1, .7, .4, .9])), ("walk", .015, dict(n=80, amp=.9)), 5000, "mid", noise=.1, ratio=(12, 17))
    C_("rayleigh", "pi", L(), ("stairs", .05, dict(levels=30, rise=.05)), ("segs", .05, dict(list=[(1, .9, 10), (4, .8, 20)])), 2000, noise=.1)
    C_("domain-walls", "preisach", L(), ("segs", .02, dict(list=[(.2, 1, 2), (1, .9, 8), (4, .8, 20)])), ("walk", .008, dict(n=80, amp=.75)), 10000, noise=.15, ratio=(20, 28), bits=16)
    RD = lambda **k: {"rate-dependence": k}
    C_("plays", "pi", RD(law="power", p=.5), ("segs", 1., dict(list=[(.2, 1, 3), (1, 1, 5), (5, 1, 10), (20, .9, 20)])), ("chirp", 1., dict(n=15, ratio=10, amp=.9)), 1000, noise=.06)
    C_("relays-uniform", "preisach", RD(law="log", r0=.02), ("segs", .5, dict(list=[(.1, 1, 2), (1, .9, 6), (10, .9, 20)])), ("tri", .4, dict(n=10, amp=.9)), 800, noise=.06)
    C_("domain-walls", "preisach", RD(law="thermal", r0=.01), ("segs", 2., dict(list=[(.15, 1, 2), (1, 1, 4), (6, .8, 12), (25, .8, 30)])), ("segs", 1., dict(list=[(.3, .9, 2), (3, .75, 6)])), 500, noise=.05)
    C_("dahl", "pi", RD(law="power", p=1.), ("chirp", .5, dict(n=24, ratio=40)), ("segs", .3, dict(list=[(1, .9, 4), (6, .8, 12)])), 1000, "mid", noise=.1)
    lt = lambda a, b, n: list(np.geomspace(a, b, n))
    CR = lambda taus, g, law: {"creep": dict(law=law, taus=taus, g=g)}
    C_("maxwell-slip", "pi", CR(lt(.05, 500, 9), [1]*9, "log"), ("stairs", 10., dict(levels=24, rise=.05)), ("stairs", 14., dict(levels=12, rise=.1, amp=.9)), 50, decoy="temperature")
    tf = lt(.02, 300, 10)
    C_("jiles-atherton", "preisach", CR(tf, [float(x**.25) for x in tf], "fractional"), ("stairs", 5., dict(levels=30, rise=.1, uneven=1)), ("decay", 10., dict(n=8, amp=.9)), 100, "mid", noise=.1)
    C_("relays-lorentz", "preisach", CR([1.5, 25.], [1., 1.3], "exponentials"), ("nested", 8., dict(hold=1.0, tops=[1, .5, .8, 0, .3])), ("stairs", 9., dict(levels=10, rise=.2, amp=.9)), 50)
    C_("plays", "pi", CR([.4, 3., 20.], [1., 1., 1.5], "exponentials"), ("walk", 1., dict(n=100, slow=2.)), ("stairs", 4., dict(levels=14, rise=.1, amp=.9)), 100, "mid", noise=.04, bits=12)
    TE = lambda **k: {"temperature": k}
    C_("plays", "pi", TE(law="gain"), ("sine", 2., dict(n=60)), ("decay", 3., dict(n=40, amp=.95)), 50, tk="cycle")
    C_("kp", "preisach", TE(law="expansion", tau_of=.04), ("tri", 4., dict(n=50, sizes=[1, .7, .4, .9])), ("walk", 3., dict(n=50, amp=.9)), 50, "mid", neg=1, tk="oven")
    C_("bouc-wen", "pi", TE(law="gain+expansion", share=.5), ("grow", 1.5, dict(n=100, a0=.3)), ("sine", 2., dict(n=60, amp=.9)), 100, tk="room", pink=1)
    LO = lambda **k: {"load": k}
    C_("rayleigh", "pi", LO(law="compliance"), ("tri", .5, dict(n=30, sizes=[1, .6, .8], centre=1)), ("walk", .4, dict(n=40, amp=.9)), 500, lk="steps", spikes=.003)
    C_("relays-gauss", "preisach", LO(law="gain"), ("grow", 1., dict(n=30, uni=1)), ("tri", 1.3, dict(n=20, amp=.9)), 200, lk="steps")
    C_("jiles-atherton", "preisach", LO(law="compliance"), ("segs", .2, dict(list=[(1, 1, 12), (2, .7, 20), (4, .5, 30)])), ("walk", .2, dict(n=40, amp=.9)), 500, "mid", lk="noise", decoy="temperature")
    RE = lambda f, z, g=None: {"resonance": dict(law="modes", f=f, zeta=z, g=g or [1.]*len(f))}
    C_("maxwell-slip", "pi", RE([310.], [.02]), ("chirp", .05, dict(n=40, ratio=25, amp=.95)), ("walk", .003, dict(n=200, amp=.85)), 5000)
    C_("domain-walls", "preisach", RE([85.], [.03]), ("stairs", .3, dict(levels=24, rise=.02)), ("tri", .1, dict(n=20, amp=.9)), 1000, noise=.06)
    C_("kp", "preisach", RE([700., 1450.], [.03, .02], [1., .7]), ("walk", .0022, dict(n=600)), ("chirp", .01, dict(n=25, ratio=14, amp=.85)), 10000, "mid")
    SA = lambda **k: {"saturation": k}
    C_("plays", "pi", SA(law="stop", ends="upper"), ("sine", .1, dict(n=25)), ("decay", .12, dict(n=20, amp=.98)), 2500, bits=16)
    C_("bouc-wen", "pi", SA(law="stop", ends="both", soft=.35), ("decay", .5, dict(n=20)), ("walk", .3, dict(n=50, amp=.94)), 400, "mid", noise=.15)
    C_("relays-lobes", "preisach", SA(law="stop", ends="both", lower=.7), ("walk", .5, dict(n=100)), ("tri", .8, dict(n=12, amp=.97)), 200, noise=.05)
    C_("plays", "pi", {"asymmetry": dict(law="output", a2=1., a3=.3)}, ("decay", .2, dict(n=25)), ("walk", .15, dict(n=50, amp=.95)), 1000, "mid")
    C_("dahl", "pi", {"asymmetry": dict(law="drive", a2=1., a3=0.)}, ("segs", .5, dict(list=[(1, 1, 6), (1, .7, 6), (2, .4, 6)])), ("sine", .4, dict(n=10, amp=.9)), 400, neg=1, noise=.22)
    DR = lambda **k: {"drift": k}
    C_("coleman-hodgdon", "preisach", DR(law="line"), ("sine", 1.25, dict(n=48)), ("tri", 1., dict(n=40, amp=.9)), 200, "mid", pink=1)
    C_("plays", "pi", DR(law="settling", tau=.18), ("walk", 1., dict(n=100)), ("grow", 1., dict(n=60, amp=.9)), 100, decoy="temperature", tk="cycle")
    C_("kp", "preisach", DR(law="s-shape", at=.52, wid=.1), ("nested", 20., dict(minor=1)), ("sine", 3., dict(n=30, amp=.9)), 100)
    def IN(f, a): return {"interference": dict(law="tones", f=f, a=a, ph=[.3, 1.1, 2.4, .9][:len(f)])}
    C_("relays-uniform", "preisach", IN([50.02, 100.04, 150.06], [1, .4, .3]), ("sine", .117, dict(n=30)), ("tri", .13, dict(n=20, amp=.9)), 5000)
    C_("maxwell-slip", "pi", IN([59.97], [1]), ("stairs", .7, dict(levels=20, rise=.15, cos=1)), ("walk", .4, dict(n=40, amp=.9)), 1000, "mid", spikes=.01)
    C_("domain-walls", "preisach", IN([49.98, 131.3], [1, .7]), ("decay", .9, dict(n=14)), ("walk", .7, dict(n=20, amp=.9)), 500)
    # --- two effects (14)
    U = lambda a, b: {**a, **b}
    C_("plays", "pi", U(TE(law="gain"), CR([.5, 4., 30.], [1, 1, 1.2], "exponentials")), ("stairs", 6., dict(levels=50, rise=.08)), ("stairs", 8., dict(levels=30, rise=.1, amp=.9)), 50, tk="oven")
    C_("maxwell-slip", "pi", U(RE([62.], [.02]), CR(lt(.1, 100, 7), [1]*7, "log")), ("stairs", 1., dict(levels=30, rise=.015)), ("stairs", 1.5, dict(levels=16, rise=.01, amp=.9)), 1000)
    C_("maxwell-slip", "pi", U(D(), SA(law="stop", ends="upper")), ("walk", .01, dict(n=300)), ("tri", .012, dict(n=40, amp=.97)), 5000, "mid", noise=.12, ratio=(11, 17))
    C_("relays-gauss", "preisach", U(L(), DR(law="line")), ("walk", .02, dict(n=150)), ("segs", .03, dict(list=[(1, .9, 20), (2, .6, 30)])), 4000, noise=.15, ratio=(18, 27))
    C_("plays", "pi", U(RD(law="log", r0=.05), IN([60.03, 180.09], [1, .5])), ("segs", 1., dict(list=[(.2, 1, 3), (2, 1, 8), (12, .9, 30)])), ("chirp", 1., dict(n=12, ratio=8, amp=.9)), 1000, noise=.06)
    C_("rayleigh", "pi", U({"asymmetry": dict(law="output", a2=1., a3=0.)}, DR(law="settling", tau=.25)), ("decay", .7, dict(n=40)), ("walk", .5, dict(n=60, amp=.95)), 250)
    C_("jiles-atherton", "preisach", U(LO(law="compliance"), CR(lt(.1, 200, 8), [1]*8, "log")), ("stairs", 6., dict(levels=40, rise=.1)), ("nested", 12., dict(amp=.9, hold=.4)), 50, lk="steps", noise=.1)
    C_("kp", "preisach", U(TE(law="expansion"), IN([50.03], [1])), ("tri", .9, dict(n=60, sizes=[1, .6, .8])), ("walk", .8, dict(n=60, amp=.9)), 250, "mid", tk="room", bits=14)
    C_("domain-walls", "preisach", U(RE([140.], [.03]), DR(law="s-shape", at=.45, wid=.12)), ("chirp", .08, dict(n=60, ratio=16, amp=.95)), ("walk", .007, dict(n=160, amp=.75)), 2000)
    C_("dahl", "pi", U(SA(law="stop", ends="lower", soft=.2), LO(law="compliance")), ("grow", .3, dict(n=40)), ("sine", .25, dict(n=40, amp=.97)), 500, lk="steps")
    C_("relays-uniform", "preisach", U(RD(law="power", p=.3), TE(law="gain")), ("segs", 4., dict(list=[(.2, 1, 3), (1, 1, 8), (8, .9, 40)])), ("chirp", 4., dict(n=14, ratio=6, amp=.9)), 100, "mid", tk="room", noise=.06)
    C_("kp", "preisach", U(D(), IN([50.02, 150.06], [1, .6])), ("walk", .02, dict(n=120)), ("chirp", .06, dict(n=25, ratio=5, amp=.9)), 4000, "mid", noise=.15, ratio=(20, 28))
    C_("plays", "pi", U({"asymmetry": dict(law="output", a2=1., a3=-.4)}, RE([440.], [.025])), ("walk", .004, dict(n=400)), ("tri", .01, dict(n=40, amp=.95)), 10000, spikes=.002)
    C_("relays-lorentz", "preisach", U(L(), LO(law="compliance")), ("walk", .02, dict(n=150)), ("chirp", .05, dict(n=30, ratio=6, amp=.9)), 4000, lk="noise", noise=.15, ratio=(18, 27))

RANGE = {"delay": (1e-4, 1.), "lag": (1e-4, 1.), "rate-dependence": (.003, 4.), "creep": (3e-4, .5), "temperature": (1e-4, .5),
         "load": (1e-4, .5), "resonance": (1e-3, 1.), "saturation": (.004, .2), "asymmetry": (2e-3, .35), "drift": (1e-4, .6),
         "interference": (1e-4, .3), "unknown": (5e-4, .6)}

def make(i, spec, seed, attempt, verbose=True):
    rng = np.random.default_rng([seed, i, attempt])
    C = Case(); C.id = f"u{i+1:02d}"; C.model = spec["model"]; C.spec = spec
    C.law = Law(spec["law"], rng)
    C.cols = set()
    for n in ("temperature", "load"):
        if n in spec["effects"] or spec.get("decoy") == n: C.cols.add(n)
    fs = spec["fs"]; mid = spec["start"] == "mid"
    lo, hi = [(0, 100), (0, 150), (-30, 150), (0, 10), (-10, 10), (0, 120), (-20, 120), (0, 60)][rng.integers(8)]
    C.lo, C.hi = lo, hi; C.y0 = -1+2*(0-lo)/(hi-lo)
    C.S = float(np.round(np.exp(rng.uniform(0.2, np.log(290))), 1 if True else 0))
    tk = spec.get("tk", "cycle"); lk = spec.get("lk", "noise")
    sc = rng.uniform(.93, 1.)
    rows = None
    tr = spec["train"]; te = spec["test"]
    est = 8
    C.R = Rec(tr, rng, fs, mid, est, C.cols, tk, lk, sc)
    if C.R.rows*8 < 40000:  # short records on a finer grid
        rng = np.random.default_rng([seed, i, attempt, 1])
        C.R = Rec(tr, rng, fs, mid, 16, C.cols, tk, lk, sc); est = 16
    C.dur = C.R.dur
    C.Q = Rec(te, rng, fs, False, est, C.cols, {"cycle": "room", "room": "cycle"}.get(tk, tk), lk, sc*.96)
    dT = rng.uniform(2, 9); Tb = rng.uniform(20, 30); F0 = float(np.round(np.exp(rng.uniform(np.log(2), np.log(150))), 1))
    assert 400 <= C.R.rows <= 60000, (C.id, C.R.rows)
    assert 300 <= C.Q.rows <= 60000, (C.id, C.Q.rows)
    J = Judge(C, C.R)
    nf = spec.get("noise") or float(np.exp(rng.uniform(np.log(.025), np.log(.15))))
    nf *= rng.uniform(.8, 1.2)
    bits = spec.get("bits")
    noise = 2*nf/100
    names = sorted(spec["effects"])
    # the noise must not be much smaller than the misfit of the law
    m = max([J.mis(n) for n in names] or [J.misfit if C.model == "preisach" else J.misfit_lin])
    ra = spec.get("ratio", (9, 24)); ratio = {n: rng.uniform(*ra) for n in names}
    if names: noise = max(noise, 2.3*m/max(min(ratio.values()), 1)) if not "unknown" in names else max(noise, 2.3*m/12)
    else: noise = max(noise, m/1.6)
    if names: noise = max(noise, m/2.5)
    noise = min(noise, 2*.3/100)
    if bits:
        C.fsr = 4.2 if bits == 12 else 2.6; lsb = C.fsr/2**bits; noise = max(noise, lsb/np.sqrt(12)*1.05)
    C.noise = noise
    eff = {}; warn = []; dd = {}
    ref = float(np.sqrt(np.mean(np.gradient(C.R.v, C.R.h)**2)))
    for n in names:
        e = dict(spec["effects"][n])
        if n == "rate-dependence": e["ref"] = ref
        if e["law"] == "slew": e["max"] = float(np.abs(np.gradient(C.R.v, C.R.h)).max())
        if n == "resonance": e["f"] = [float(f*rng.uniform(.9, 1.1)) for f in e["f"]]
        if n == "interference":
            k = rng.uniform(.9994, 1.0006); e["f"] = [float(f*k) for f in e["f"]]
        if n == "drift" : e["sign"] = 1
        other = clean(C, C.R, eff)
        if e["law"] == "dropouts":
            eff[n] = (e, 1.0); continue
        a, b = RANGE[n]
        if e['law'] == 'slew': b = 6.
        if e['law'] == 'stick-slip': b = .15
        if n in ("delay", "lag"): a, b = .02/fs, C.R.T0/3
        if n == "resonance": b = 1.0
        tgt = max(ratio[n]*noise, 2.3*J.mis(n))
        fn = lambda s: J.size(n, clean(C, C.R, {**eff, n: (e, s)})-other)
        if fn(b) < tgt: s = b
        elif fn(a) > tgt: s = a
        else:
            for _ in range(12):
                s = np.sqrt(a*b)
                if fn(s) < tgt: a = s
                else: b = s
            s = np.sqrt(a*b)
        sg = -1 if n in ("drift", "temperature", "asymmetry") and rng.random() < .45 else 1
        if n == "saturation" : sg = 1
        eff[n] = (e, float(sg*s))
    C.eff = eff
    full = clean(C, C.R, eff)
    rep = dict(id=C.id, width=C.law.width, rows=C.R.rows, noise=noise/2*100, misfit=J.misfit/noise, misfit_lin=J.misfit_lin/noise, bend=J.bend/noise)
    accept = []
    floor = max(noise, J.misfit)
    rep["vis"] = {}; rep["left"] = {}
    for n in names:
        if n == "unknown" and eff[n][0]["law"] == "dropouts": continue
        rest = {k: q for k, q in eff.items() if k != n}
        d = full-clean(C, C.R, rest)
        z = J.size(n, d); rep["vis"][n] = round(z/noise, 2)
        if not 5 <= z/noise <= 30.5: warn.append(f"{n} {z/noise:.1f} x noise")
        if z < 2*J.mis(n): warn.append(f"{n} {z/J.mis(n):.1f} x misfit")
        fl = max(noise, J.mis(n))
        pr = d
        left = {}
        for r in NAMES:
            if r in names: continue
            if n != "unknown":
                f = J.fit(d, [r]+[k for k in rest], J.islin(n)) if rest else J.fit(d, [r], J.islin(n))
            else: f = J.fit(d, [r])
            left[r] = round(f/noise, 2)
            if n != "unknown" and f < fl: accept.append(sorted([r]+list(rest)))
            if n == "unknown" and f < .7*z: warn.append(f"unknown explained by {r}: {f/z:.2f}")
        if rest:
            f = J.fit(d, list(rest), J.islin(n)); left["(other alone)"] = round(f/noise, 2)
            if f < 2*fl: warn.append(f"{n} hides behind {list(rest)}: {f/noise:.1f}")
        rep["left"][n] = left
    if len(names) == 2:
        d = full-J.base; left = {}
        for r in NAMES:
            f = J.fit(d, [r], "asymmetry" in names); left[r] = round(f/noise, 2)
            if f < floor: accept.append([r])
        rep["left"]["both"] = left
    # share of the misfit of the law that a rival could explain
    b = J.base; r0 = rms(J.flex(b[J.sub])); own = {}
    for r in NAMES:
        if r == "asymmetry": continue
        f = J.fit(b, [r]); own[r] = float(np.sqrt(max(0, r0*r0-f*f))/noise)
    own["asymmetry"] = J.bend/noise if C.model == "pi" else 0.0
    rep["own"] = {k: round(float(x), 2) for k, x in own.items() if x > .5 and np.isfinite(x)}
    if not names:
        for k, x in own.items():
            if x > 1.0: warn.append(f"law itself looks like {k}: {x:.2f} x noise")
    elif C.model == "pi" and "asymmetry" not in names and J.bend > noise:
        accept.append(sorted(names+["asymmetry"])); warn.append(f"law bends: {J.bend/noise:.2f}")
    acc = []
    for a in accept:
        if a not in acc and a != names: acc.append(a)
    C.accept = sorted(acc); C.names = names; rep["accept"] = acc; rep["warn"] = warn
    C.dT, C.Tb, C.F0, C.bits, C.rng = dT, Tb, F0, bits, rng
    return C, rep

def physical(C):
    out = {}; sg = -1 if C.spec.get("neg") else 1
    for n, (e, s) in C.eff.items():
        d = {"law": e["law"]}; S = C.S
        if n == "delay": d["delay_s"] = s
        elif n == "lag": d["tau_s"] = s
        elif n == "rate-dependence":
            d.update(k=s, reference_rate_v_per_s=e["ref"]*(C.hi-C.lo)/2, **{k: e[k] for k in ("p", "r0") if k in e})
        elif n == "creep": d.update(share=s, taus_s=e["taus"], weights=e["g"])
        elif n == "temperature":
            if "gain" in e["law"]: d["gain_per_c"] = s/C.dT
            if "expansion" in e["law"]: d["um_per_c"] = sg*s*e.get("share", 1.)*S/2/C.dT
            if e.get("tau_of"): d["tau_s"] = e["tau_of"]*C.R.dur
        elif n == "load": d.update({"gain_per_n": -s/C.F0} if e["law"] == "gain" else {"um_per_n": -s*S/2/C.F0})
        elif n == "resonance": d.update(f_hz=e["f"], zeta=e["zeta"], participation=[s*g for g in e["g"]])
        elif n == "saturation": d.update(ends=e["ends"], cut_of_stroke=s, soft=e.get("soft", 0.))
        elif n == "asymmetry": d.update(a2=s*e["a2"], a3=s*e["a3"])
        elif n == "drift": d.update(um=sg*s*S/2, **{k: (e[k]*C.dur) for k in ("tau", "at", "wid") if k in e})
        elif n == "interference": d.update(f_hz=e["f"], um=[s*a*S/2 for a in e["a"]])
        else: d.update(size=s)
        out[n] = d
    return out

def noise_of(C, R, rng):
    n = R.rows; sp = C.spec
    q = C.noise
    if C.bits: q = np.sqrt(max(0, q*q-(C.fsr/2**C.bits)**2/12))
    x = rng.normal(size=n)
    if sp.get("pink"):
        F = np.fft.rfft(rng.normal(size=n)); k = np.arange(len(F)); k[0] = 1
        p = np.fft.irfft(F/np.sqrt(np.maximum(k, 3)), n); p /= p.std(); x = .75*x+.66*p
    x = x*q
    if sp.get("spikes"):
        k = max(2, int(sp["spikes"]*n)); i = rng.choice(n, k, replace=False)
        x[i] += rng.choice([-1, 1], k)*C.noise*rng.uniform(8, 40, k)
    return x

def write(C, out):
    d = os.path.join(out, C.id); os.makedirs(d, exist_ok=True)
    sgn = -1 if C.spec.get("neg") else 1
    for R, nm in ((C.R, "train"), (C.Q, "test")):
        rng = np.random.default_rng([R.seed, 7]); nz = noise_of(C, R, rng)
        dr = np.random.default_rng([R.seed, 8])
        drops = [(int(dr.uniform(.03, .95)*R.rows), int(R.rows*dr.uniform(.0003, .001))+2, dr.random()) for _ in range(8)]
        cr = np.random.default_rng([R.seed, 9]); T = C.Tb+C.dT*R.Tn[R.idx]+.004*cr.normal(size=R.rows)
        F = C.F0*R.Fn[R.idx]+C.F0*5e-4*cr.normal(size=R.rows)
        for eff, pre in ((C.eff, ""), ({}, "twin-")):
            y = clean(C, R, eff)+nz
            if "unknown" in eff and eff["unknown"][0]["law"] == "dropouts":
                y0 = y.copy()
                for a, l, p in drops: y[a:a+l] = y0[a-1] if p < .6 else .85*y0[a:a+l]+.15*C.y0
            y = sgn*(y-C.y0)*C.S/2
            if C.bits:
                l = C.fsr/2**C.bits*C.S/2; y = np.round(y/l)*l
            u = C.lo+(R.v[R.idx]+1)/2*(C.hi-C.lo)
            t = np.round(R.t[R.idx]*R.fs)/R.fs
            cols = [t, u, y]; fmt = ["%.6f", "%.9g", "%.9g"]; head = ["time_s", "voltage_v", "displacement_um"]
            if "temperature" in C.cols: cols.append(T); fmt.append("%.4f"); head.append(TEMP)
            if "load" in C.cols: cols.append(F); fmt.append("%.5g"); head.append("load_n")
            if R.nseg > 1: cols.append(R.seg); fmt.append("%d"); head.append("segment")
            np.savetxt(os.path.join(d, pre+nm+".csv"), np.stack(cols, 1), fmt=fmt, delimiter=",", header=",".join(head), comments="")
    sp = C.spec
    sensor = "white" if not sp.get("pink") else "white + 1/f"
    if sp.get("spikes"): sensor += f", spikes {100*sp['spikes']:g} %"
    if C.bits: sensor += f", {C.bits} bit"
    truth = dict(id=C.id, base=C.law.name, model=C.model, effects=physical(C), expect=C.names, accept=C.accept, drive=sp["train"][0],
                 test_drive=sp["test"][0], start=sp["start"], sensor=sensor, noise_um=C.noise*C.S/2, stroke_um=C.S, gain=-1 if sgn < 0 else 1,
                 loop_of_stroke=C.law.width)
    json.dump(truth, open(os.path.join(d, "truth.json"), "w"), indent=1)

def main():
    ap = argparse.ArgumentParser(); ap.add_argument("out"); ap.add_argument("--seed", type=int, default=SEED)
    ap.add_argument("--only"); ap.add_argument("--temperature-name", default=TEMP); ap.add_argument("--dry", action="store_true"); ap.add_argument("--tries", type=int, default=4)
    a = ap.parse_args(); globals()["TEMP"] = a.temperature_name; table(); os.makedirs(a.out, exist_ok=True)
    assert len(CASES) == 64, len(CASES)
    reps = []
    for i, sp in enumerate(CASES):
        if a.only and f"u{i+1:02d}" not in a.only.split(","): continue
        t0 = time.time(); best = None
        for k in range(a.tries):
            C, rep = make(i, sp, a.seed, k); rep["attempt"] = k
            if best is None or len(rep["warn"]) < len(best[1]["warn"]): best = (C, rep)
            if not rep["warn"]: break
        C, rep = best
        if not a.dry: write(C, a.out)
        reps.append(rep)
        print(f"{C.id} {C.law.name:15s} {C.model:8s} {'+'.join(C.names) or '-':28s} {sp['train'][0]:7s}{sp['start']:5s} n={C.R.rows:5d} w={C.law.width:.3f} noise={rep['noise']:.3f}% mis={rep['misfit']:.2f}/{rep['misfit_lin']:.2f} vis={rep['vis']} acc={C.accept} own={rep['own']} try={rep['attempt']} {time.time()-t0:.1f}s" + (f"\n     WARN {rep['warn']}" if rep["warn"] else ""), flush=True)
        json.dump(reps, open(a.out.rstrip("/")+"-report.json", "w"), indent=1, default=float)

if __name__ == "__main__": main()
