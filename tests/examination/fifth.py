#!/usr/bin/env python3
"""Independent set of 64 piezo-actuator cases (voltage -> displacement).

    python fifth.py OUTDIR [--seed N] [--only v07,v12]

Chain:  command -> [rail] -> [amplifier delay / lag] -> [curve before] -> hysteresis law (+ rate element)
        -> [curve after] -> [creep] -> [gains] -> um -> [expansion, compliance, unknowns] -> [modes]
        -> [stop] -> [sensor delay / lag] -> [zero drift, tone] -> sampling, noise, quantiser.
v is the normalised voltage (-1..1 over the amplifier's range).  Everything runs on a grid finer than the
samples. It starts before the record (pre-roll) and continues through the gaps between segments.
"""
import argparse, json, os, zlib
import numpy as np
from numba import njit
from scipy.optimize import lsq_linear

# ------------------------------------------------------------------ hysteresis laws (rate independent)
@njit(cache=True)
def k_boucwen(v, A, be, ga, n, z0):
    s = np.empty(v.size); z = z0; s[0] = z
    for i in range(1, v.size):
        d = v[i]-v[i-1]; m = int(abs(d)/0.004)+1; h = d/m
        for _ in range(m):
            sg = 1.0 if h*z > 0 else -1.0
            z += h*(A-abs(z)**n*(be*sg+ga))
        s[i] = z
    return s

@njit(cache=True)
def k_dahl(v, zc, w, ex):
    s = np.zeros(v.size); z = np.zeros(zc.size)
    for i in range(1, v.size):
        d = v[i]-v[i-1]; m = int(abs(d)/0.004)+1; h = d/m; sg = 1.0 if d > 0 else -1.0
        for _ in range(m):
            for k in range(zc.size):
                r = 1.0-sg*z[k]/zc[k]
                z[k] += h*(r**ex if r > 0 else -(-r)**ex)
        t = 0.0
        for k in range(zc.size): t += w[k]*z[k]
        s[i] = t
    return s

@njit(cache=True)
def k_stops(v, r, w):                      # Maxwell slip: springs with Coulomb sliders
    s = np.zeros(v.size); f = np.zeros(r.size)
    for i in range(1, v.size):
        d = v[i]-v[i-1]; t = 0.0
        for k in range(r.size):
            x = f[k]+d
            if x > r[k]: x = r[k]
            elif x < -r[k]: x = -r[k]
            f[k] = x; t += w[k]*x
        s[i] = t
    return s

@njit(cache=True)
def k_plays(v, r, w):
    s = np.zeros(v.size); p = np.full(r.size, v[0])
    for i in range(v.size):
        t = 0.0
        for k in range(r.size):
            x = p[k]
            if v[i]-r[k] > x: x = v[i]-r[k]
            elif v[i]+r[k] < x: x = v[i]+r[k]
            p[k] = x; t += w[k]*x
        s[i] = t
    return s

@njit(cache=True)
def k_masing(v, chi, nu, m):               # Rayleigh-like, Madelung memory on a stack of reversals
    N = v.size; s = np.zeros(N)
    ev = np.zeros(4000); ey = np.zeros(4000)
    ev[0] = v[0]; ey[0] = 0.0; n = 1; dirn = 0
    for i in range(1, N):
        d = v[i]-v[i-1]
        if d != 0.0:
            nd = 1 if d > 0 else -1
            if dirn != 0 and nd != dirn and n < 3998:
                ev[n] = v[i-1]; ey[n] = s[i-1]; n += 1
            dirn = nd
            while n >= 3:                  # if the branch has passed the last but one reversal, wipe out both
                if (dirn > 0 and v[i] >= ev[n-2]) or (dirn < 0 and v[i] <= ev[n-2]):
                    if n == 3 and abs(v[i]-ev[0]) < abs(ev[1]-ev[0]): break
                    n -= 2
                else: break
            if n == 2 and abs(v[i]-ev[0]) >= abs(ev[1]-ev[0]): n = 1
            x = abs(v[i]-ev[n-1])
            if n == 1:
                x = v[i]-ev[0]; sg = 1.0 if x > 0 else -1.0; x = abs(x)
                s[i] = sg*(chi*x+nu*x**(1+m))
            else:
                s[i] = ey[n-1]+dirn*2*(chi*x/2+nu*(x/2)**(1+m))
        else:
            s[i] = s[i-1]
    return s

@njit(cache=True)
def k_duhem(v, al, b, c, g, z0):           # Coleman-Hodgdon
    s = np.empty(v.size); z = z0; s[0] = z
    for i in range(1, v.size):
        d = v[i]-v[i-1]; m = int(abs(d)/0.004)+1; h = d/m; x = v[i-1]
        for _ in range(m):
            x += h
            f = b*np.tanh(c*x)/c
            z += al*abs(h)*(f-z)+g*h
        s[i] = z
    return s

@njit(cache=True)
def lang(x):
    if abs(x) < 1e-3: return x/3
    return 1/np.tanh(x)-1/x

@njit(cache=True)
def k_ja(v, a, al, k, c, m0):
    s = np.empty(v.size); M = m0; s[0] = M
    for i in range(1, v.size):
        d = v[i]-v[i-1]; n = int(abs(d)/0.002)+1; h = d/n; H = v[i-1]; de = 1.0 if d > 0 else -1.0
        for _ in range(n):
            H += h; He = H+al*M; x = He/a
            Man = lang(x)
            dMan = (1/3.0-x*x/15.0)/a if abs(x) < 0.05 else (1/(x*x)-1/np.sinh(x)**2)/a
            Mi = (M-c*Man)/(1-c)
            dm = Man-Mi
            dMi = 0.0
            if dm*de > 0: dMi = dm/(k*de-al*dm)
            dM = ((1-c)*dMi+c*dMan)/(1-al*c*dMan)
            M += dM*h
        s[i] = M
    return s

@njit(cache=True)
def k_relays(v, up, dn, wid, w):           # relays with a linear flank of width wid (KP kernel); wid small = relay
    s = np.empty(v.size); x = np.empty(up.size)
    for k in range(up.size):
        x[k] = 1.0 if (up[k]+dn[k])/2 < v[0] else -1.0
    for i in range(v.size):
        t = 0.0
        for k in range(up.size):
            hi = 1.0 if v[i] > up[k]+wid[k] else (-1.0 if v[i] < up[k] else 2*(v[i]-up[k])/wid[k]-1)
            lo = 1.0 if v[i] > dn[k] else (-1.0 if v[i] < dn[k]-wid[k] else 2*(v[i]-dn[k]+wid[k])/wid[k]-1)
            if x[k] < hi: x[k] = hi
            if x[k] > lo: x[k] = lo
            t += w[k]*x[k]
        s[i] = t
    return s

@njit(cache=True)
def k_pinning(v, kap, w, a):               # energy based: pinned field per cell, followed by an anhysteretic curve
    s = np.zeros(v.size); p = np.full(kap.size, v[0])
    for i in range(v.size):
        t = 0.0
        for k in range(kap.size):
            x = p[k]
            if v[i]-x > kap[k]: x = v[i]-kap[k]
            elif x-v[i] > kap[k]: x = v[i]+kap[k]
            p[k] = x; t += w[k]*np.tanh(x/a)*a
        s[i] = t
    return s

def make_law(name, rng):
    """Returns (callable v->s, sign).  y = v*(..) + sign*mu*s afterwards; sign -1: friction-like s, +1: lagging s."""
    U = rng.uniform
    if name == "bouc-wen":
        n = U(1, 1.6); be = U(2.5, 6); ga = be*U(-0.3, 0.3)
        return dict(n=n, beta=be, gamma=ga), (lambda v: k_boucwen(v, 1.0, be, ga, n, 0.0)), -1
    if name == "dahl":
        zc = np.sort(U(0.05, 0.7, 3)); w = U(0.4, 1, 3); ex = U(0.9, 1.5)
        return dict(zc=zc.tolist(), w=w.tolist(), exponent=ex), (lambda v: k_dahl(v, zc, w, ex)), -1
    if name == "maxwell-slip":
        r = np.exp(rng.normal(np.log(0.35), 0.8, 70)).clip(0.01, 1.3); w = rng.gamma(1.2, 1, 70)/70
        return dict(elements=70), (lambda v: k_stops(v, r, w)), -1
    if name == "rayleigh":
        chi, nu, m = 0.25, U(0.5, 0.9), U(0.75, 1.3)
        return dict(chi=chi, nu=nu, m=m), (lambda v: k_masing(v, chi, nu, m)), 1
    if name == "random-plays":
        r = U(0, 1, 150)**U(0.8, 1.6)*0.9; w = rng.gamma(0.7, 1, 150)/150
        return dict(elements=150), (lambda v: k_plays(v, r, w)), 1
    if name == "coleman-hodgdon":
        al = U(1.2, 3.5); b, c = 1.0, U(0.1, 0.4); g = U(0.3, 0.6)
        return dict(alpha=al, b=b, c=c, g=g), (lambda v: k_duhem(v, al, b, c, g, b*np.tanh(c*v[0])/c)), 1
    if name == "jiles-atherton":
        a, al, k, c = U(0.3, 0.45), U(0.02, 0.15), U(0.15, 0.35), U(0.1, 0.3)
        return dict(a=a, alpha=al, k=k, c=c), (lambda v: k_ja(v, a, al, k, c, float(lang(v[0]/a)))), 1
    if name == "kp":
        n = 260; dn0 = U(-1, 1, n); up0 = U(-1, 1, n); up = np.maximum(up0, dn0); dn = np.minimum(up0, dn0)
        wid = U(0.08, 0.35, n); w = np.exp(-(up+dn)**2/U(0.8, 2)-(up-dn)**2/U(0.3, 1.2)); w /= w.sum()
        return dict(kernels=n), (lambda v: k_relays(v, up, dn, wid, w)), 1
    if name == "relays-lorentz":
        n = 900; g = U(0.25, 0.5); hc = np.abs(U(0.05, 0.25)+0.15*rng.standard_t(2, n)).clip(0.005, 1.2)
        hi = (g*rng.standard_t(1.5, n)).clip(-1.4, 1.4)
        up, dn = hi+hc, hi-hc; wid = np.full(n, 0.03); w = np.full(n, 1/n)
        return dict(relays=n, spread=g), (lambda v: k_relays(v, up, dn, wid, w)), 1
    if name == "homogenised-energy":
        n = 900; hc = np.exp(rng.normal(np.log(U(0.12, 0.3)), U(0.4, 0.7), n)).clip(0.005, 1.3)
        hi = rng.normal(0, U(0.4, 0.6), n); up, dn = hi+hc, hi-hc
        wid = np.full(n, 0.04); w = rng.gamma(2, 1, n); w /= w.sum()
        return dict(wells=n), (lambda v: k_relays(v, up, dn, wid, w)), 1
    if name == "pinning-energy":
        n = 80; kap = np.abs(rng.normal(0.0, U(0.2, 0.5), n)); w = np.full(n, 1/n); a = U(1.2, 2.0)
        return dict(cells=n, a=a), (lambda v: k_pinning(v, kap, w, a)), 1
    raise KeyError(name)

PI_LAWS = ["bouc-wen", "dahl", "maxwell-slip", "rayleigh", "random-plays", "coleman-hodgdon"]
PR_LAWS = ["jiles-atherton", "kp", "relays-lorentz", "homogenised-energy", "pinning-energy"]

# ------------------------------------------------------------------ dynamic kernels (variable step)
@njit(cache=True)
def k_lag(u, dt, tau, x0):
    y = np.empty(u.size); x = x0; y[0] = x
    for i in range(1, u.size):
        q = dt[i]/tau
        e = np.exp(-q); a = 1-(1-e)/q if q > 1e-6 else q/2    # first order hold
        # exact for a linear input over the step
        x = e*x+((1-e)/q-e)*u[i-1]+a*u[i] if q > 1e-6 else x+q*(u[i]-x)
        y[i] = x
    return y

@njit(cache=True)
def k_mode(u, dt, w0, ze):
    y = np.empty(u.size); x = u[0]; p = 0.0; y[0] = x
    wd = w0*np.sqrt(1-ze*ze)
    for i in range(1, u.size):
        uu = 0.5*(u[i]+u[i-1]); h = dt[i]; a = x-uu; E = np.exp(-ze*w0*h); C = np.cos(wd*h); S = np.sin(wd*h)
        b = (p+ze*w0*a)/wd
        x = uu+E*(a*C+b*S)
        p = E*(-ze*w0*(a*C+b*S)+wd*(b*C-a*S))
        y[i] = x
    return y

@njit(cache=True)
def k_rdahl(v, dt, zc, v0, p):             # Dahl element with friction that grows with rate**p
    s = np.zeros(v.size); z = 0.0
    for i in range(1, v.size):
        d = v[i]-v[i-1]; r = zc*(0.02+abs(d)/dt[i]/v0)**p if p > 0 else zc
        q = np.exp(-abs(d)/r)
        z = z*q+(r*(1-q) if d > 0 else -r*(1-q))
        s[i] = z
    return s

@njit(cache=True)
def k_rplays(v, dt, r, w, k, v0):          # thermally activated: thresholds grow with the log of the rate
    s = np.zeros(v.size); p = np.full(r.size, v[0])
    for i in range(v.size):
        rate = abs(v[i]-v[i-1])/dt[i] if i else 0.0
        f = 1+k*np.log(1+rate/v0); t = 0.0
        for j in range(r.size):
            x = p[j]; rr = r[j]*f
            if v[i]-rr > x: x = v[i]-rr
            elif v[i]+rr < x: x = v[i]+rr
            p[j] = x; t += w[j]*x
        s[i] = t
    return s

@njit(cache=True)
def k_drelays(v, dt, up, dn, w, kk):       # relays that switch with a finite speed k*(v-threshold)
    s = np.empty(v.size); x = np.empty(up.size)
    for k in range(up.size): x[k] = 1.0 if (up[k]+dn[k])/2 < v[0] else -1.0
    for i in range(v.size):
        t = 0.0
        for k in range(up.size):
            if v[i] > up[k]:
                x[k] = min(1.0, x[k]+kk*(v[i]-up[k])*dt[i])
            elif v[i] < dn[k]:
                x[k] = max(-1.0, x[k]+kk*(v[i]-dn[k])*dt[i])
            t += w[k]*x[k]
        s[i] = t
    return s

@njit(cache=True)
def k_stick(y, q0, fs, fc, rnd):
    o = np.empty(y.size); q = y[0]; j = 0
    for i in range(y.size):
        d = y[i]-q
        if abs(d) > fs*rnd[j]:
            q = y[i]-(fc*rnd[j] if d > 0 else -fc*rnd[j]); j = (j+1) % rnd.size
        o[i] = q
    return o

# ------------------------------------------------------------------ small signals
def smooth(x):
    x = np.clip(x, 0, 1); return x*x*(3-2*x)

def rand_smooth(rng, t, tc, n=14):
    """Returns a smooth random function of time with a standard deviation of about 1 and correlation time tc."""
    f = rng.uniform(0.08, 1.0, n)/(2*tc); ph = rng.uniform(0, 2*np.pi, n); a = rng.uniform(0.5, 1, n)
    return (a[:, None]*np.sin(2*np.pi*f[:, None]*t[None]+ph[:, None])).sum(0)/np.sqrt((a**2).sum()/2)

def pink(rng, n):
    X = np.fft.rfft(rng.normal(size=n)); f = np.arange(X.size); f[0] = 1
    X = X/np.sqrt(f); X[0] = 0
    x = np.fft.irfft(X, n); return x/x.std()

# ------------------------------------------------------------------ drives: list of (fs, n, fun(t), scale period)
def tri(ph):
    ph = np.mod(ph, 1.0); return np.where(ph < .5, 4*ph-1, 3-4*ph)

def drive(kind, rng, P, test=False):
    """P: fs, f (base frequency), n rows, amp, off + extras.  Each fun is defined for t<0 too (pre-roll)."""
    fs, f, n, A = P["fs"], P["f"], P["n"], P["amp"]; off = P.get("off", 0.0); T = n/fs if fs else 1.0
    U = rng.uniform; segs = []
    ph0 = U(0, 1) if P["start"] == "mid" else -0.25
    if kind == "sine":
        segs.append((fs, n, lambda t: off+A*np.sin(2*np.pi*(f*t+ph0)), 1/f))
    elif kind in ("grow", "decay"):
        lo = U(0.15, 0.35)
        def fun(t):
            x = np.clip(t/T, 0, 1); e = lo+(1-lo)*(x if kind == "grow" else 1-x)
            return off+A*e*np.sin(2*np.pi*(f*t+ph0))
        segs.append((fs, n, fun, 1/f))
    elif kind == "triangle":
        segs.append((fs, n, lambda t: off+A*tri(f*t+ph0+0.25), 1/f))
    elif kind == "stairs":
        hold = P.get("hold", T/26); rise = P.get("rise", 4/fs); m = int(T/hold)+8
        up = P.get("steps", 6); q = np.arange(m)
        if P.get("random_stairs"):
            lev = U(-1, 1, m); lev[::5] = 0.95*np.sign(U(-1, 1, lev[::5].size))
        else:
            lev = tri((q+0.0)/(2*up))*np.where((q//(2*up)) % 2, U(0.55, 0.8), 1.0)
        pre = 6
        def fun(t):
            k = np.floor(t/hold).astype(int)+pre
            k = np.clip(k, 1, m-1); x = smooth((t-(k-pre)*hold)/rise)
            return off+A*(lev[k-1]+(lev[k]-lev[k-1])*x)
        segs.append((fs, n, fun, hold*2))
    elif kind == "chirp":
        f1 = P["f1"]; lg = P.get("log", True); tap = P.get("taper", 0.0); dn = P.get("down", False)
        def fun(t):
            x = np.clip(t, 0, T)
            if dn: xx = T-x
            else: xx = x
            if lg:
                L = np.log(f1/f)/T; p = f/L*(np.exp(L*xx)-1)
            else: p = f*xx+0.5*(f1-f)/T*xx**2
            if dn: p = -p
            p = p+np.where(t < 0, t*(f1 if dn else f), 0)
            return off+A*(1-tap*(xx/T))*np.sin(2*np.pi*(p+ph0))
        segs.append((fs, n, fun, 1/f))
    elif kind == "walk":
        tc = 1/(2*f); m = int(T/tc*2.2)+12; lev = np.cumsum(rng.normal(0, .55, m))
        lev = np.abs(np.mod(lev+1, 4)-2)-1           # reflect to -1..1
        tk = np.cumsum(U(0.4, 1.4, m))*tc-4*tc
        def fun(t):
            k = np.clip(np.searchsorted(tk, t)-1, 0, m-2); x = (t-tk[k])/(tk[k+1]-tk[k])
            return off+A*(lev[k]+(lev[k+1]-lev[k])*(smooth(x) if P.get("round", True) else np.clip(x, 0, 1)))
        segs.append((fs, n, fun, 2*tc))
    elif kind == "multisine":
        r = np.array(P.get("ratios", [1, 2.37, 4.13, 6.7])); a = np.array([1, .6, .4, .3])[:r.size]; ph = U(0, 1, r.size)
        tt = np.linspace(0, T, 20000); g = lambda t: sum(a[k]*np.sin(2*np.pi*(f*r[k]*t+ph[k])) for k in range(r.size))
        pk = np.abs(g(tt)).max()
        segs.append((fs, n, lambda t: off+A*np.clip(g(t)/pk, -1.02, 1.02), 1/f))
    elif kind in ("rates", "trirates"):
        for m in P["mult"]:
            ff = f*m; k = P.get("cycles", 4); s = min(P.get("spp", 250)*ff, P.get("fsmax", 20000.0))
            s = float(np.round(s, 0)) if s > 20 else 20.0
            ph = U(0, 1) if P["start"] == "mid" else -0.25
            w = (lambda t, ff=ff, ph=ph: off+A*np.sin(2*np.pi*(ff*t+ph))) if kind == "rates" else \
                (lambda t, ff=ff, ph=ph: off+A*tri(ff*t+ph+0.25))
            segs.append((s, max(400, int(k*s/ff)), w, 1/ff))
    elif kind == "amps":
        for a in P["amps"]:
            ph = U(0, 1) if P["start"] == "mid" else -0.25
            segs.append((fs, max(350, n//len(P["amps"])), lambda t, a=a, ph=ph: off+A*a*np.sin(2*np.pi*(f*t+ph)), 1/f))
    elif kind == "nested":                              # reversal curves from the lower end, growing and shrinking depth
        m = int(T*f*1.6)+10; lev = []
        for i in range(m):
            lev += [-0.98+0.25*U(0, .6)*(i % 3 == 1), [1.0, -.2, .25, .8, -.5, .55][i % 6]+U(-.08, .08)]
        lev = np.clip(np.array([-0.9, .9, -.9, .9]+lev), -1, 1)
        dt = np.abs(np.diff(lev)); tk = np.concatenate([[0], np.cumsum(dt)])/(4*f); tk -= tk[3]
        segs.append((fs, n, lambda t: off+A*np.interp(t, tk, lev), 1/f))
    else: raise KeyError(kind)
    return segs

class Rec: pass

def build(segs, start, vrest, osf, rng, gap=(2.0, 6.0), via=False, npre=2.2):
    """Returns the fine grid with pre-roll and gaps, and which fine points are samples."""
    T, V, S, G = [], [], [], []; t0 = 0.0; last = None; r = Rec(); trec, vrec, srec, irec = [], [], [], []; cnt = 0
    def put(t, v):
        nonlocal cnt
        T.append(t); V.append(v); cnt += t.size
    for j, (fs, n, fun, per) in enumerate(segs):
        dt = 1/fs/osf; blend = 0.35*per
        loc = np.arange((n-1)*osf+1)*dt
        v = fun(loc)
        if j == 0:
            if start == "rest":
                v = vrest+(v-vrest)*smooth(loc/blend)
                m = 200; put(-np.arange(m, 0, -1)*dt*4, np.full(m, vrest))
            else:
                m = int(npre*per/dt); m = min(m, 60000); tp = -np.arange(m, 0, -1)*dt; put(tp, fun(tp))
        else:
            g = float(np.round(rng.uniform(*gap), 1)); t0 = T[-1][-1]+g
            m = 600; tg = T[-1][-1]+np.arange(1, m)/m*g; x = np.arange(1, m)/m; a, b = V[-1][-1], v[0]
            vg = np.where(x < .5, a+(vrest-a)*smooth(2*x), vrest+(b-vrest)*smooth(2*x-1)) if via else a+(b-a)*smooth(x)
            put(tg, vg)
        if j: t0 = np.round(t0, 6)
        irec.append(cnt+np.arange(n)*osf); trec.append(t0+np.arange(n)/fs); srec.append(np.full(n, j))
        put(t0+loc, v)
    r.t = np.concatenate(T); r.v = np.concatenate(V); r.dt = np.concatenate([[r.t[1]-r.t[0]], np.diff(r.t)])
    r.i = np.concatenate(irec); r.trec = np.concatenate(trec); r.seg = np.concatenate(srec); r.nseg = len(segs)
    r.first = r.i[0]; r.T = r.trec[-1]; r.per = np.median([s[3] for s in segs]); r.fs = max(s[0] for s in segs)
    r.cache = {}
    return r

# ------------------------------------------------------------------ the chain
def curve(p, v):
    l = p["law"]
    if l.endswith("quadratic"): return v+p["a"]*(v*v-0.4)
    if l.endswith("exponential"):
        k = p["k"]; return (np.exp(k*v)-1)/np.sinh(k)
    if l.endswith("quad-cubic"): return v+p["a"]*(v*v-0.4)+p["b"]*v**3
    raise KeyError(l)

def simulate(c, r, on, which):
    """Returns the displacement on the fine grid with the effects named in `on`, without noise."""
    E = c["fx"]; has = lambda n: n in on and n in E
    v = r.v; key = tuple(sorted(n for n in on if n in ("delay", "lag", "asymmetry", "saturation", "rate-dependence")))
    if key in r.cache: h = r.cache[key]
    else:
        if has("saturation") and E["saturation"]["law"] == "amplifier-rail":
            p = E["saturation"]; v = np.clip(v, p.get("vlo", -9), p["vhi"])
        if has("delay") and E["delay"]["law"] == "amplifier": v = np.interp(r.t-E["delay"]["tau_s"], r.t, v)
        if has("lag") and E["lag"]["law"] == "amplifier": v = k_lag(v, r.dt, E["lag"]["tau_s"], v[0])
        if has("asymmetry") and E["asymmetry"]["law"].startswith("before"): v = curve(E["asymmetry"], v)
        h = c["lin"]*v+c["mu"]*c["law"](v)
        if "rate-dependence" in E:
            p = E["rate-dependence"]; a = "rate-dependence" in on; q = c["rd"]
            if p["law"] == "power-dahl": h = h-p["w"]*k_rdahl(v, r.dt, p["zc"], p["v0"], p["p"] if a else 0.0)
            elif p["law"] == "log-thresholds":
                h = h+p["w"]*k_rplays(v, r.dt, q["r"], q["w"], p["k"] if a else 0.0, p["v0"])
            else:
                h = h+p["w"]*k_drelays(v, r.dt, q["up"], q["dn"], q["rw"], p["k"] if a else 1e12)
        if has("asymmetry") and E["asymmetry"]["law"].startswith("behind"): h = curve(E["asymmetry"], h)
        r.cache[key] = h
    rr = r.fx[which]
    if has("creep"):
        p = E["creep"]; x = 0
        b = h[:max(r.first, 2)].mean()
        for tau, w in zip(p["taus_s"], p["weights"]): x = x+w*k_lag(h, r.dt, tau, b)
        h = h+x
    if has("temperature"): h = h*(1+E["temperature"].get("gain_per_k", 0)*(rr["Tbody"]-rr["T0"]))
    if has("load"): h = h*(1+E["load"].get("gain_per_n", 0)*(rr["F"]-rr["F0"]))
    if has("unknown"):
        p = E["unknown"]; l = p["law"]
        if l == "gain-wander": h = h*(1+p["size"]*rr["w"])
        if l == "depoling": h = h*(1-p["size"]*rr["w"])
    y = c["um"]*h
    if has("temperature"): y = y+E["temperature"].get("um_per_k", 0)*(rr["Tbody"]-rr["T0"])
    if has("load"):
        p = E["load"]; F = rr["F"]; m = p.get("hardening", 1.0)
        y = y+p["um_per_n"]*p["f_ref"]*np.sign(F)*np.abs(F/p["f_ref"])**m
    if has("unknown"):
        S = c["stroke"]
        if l in ("slip", "unrecorded-load", "telegraph"): y = y+p["size"]*S*rr["w"]
        if l == "stick-slip":
            q = k_stick(y, 0.0, p["fs"]*S, p["fc"]*S, rr["w"]); y = y-p["share"]*(y-q)
    if has("resonance"):
        p = E["resonance"]; z = y*(1-sum(p["share"]))
        for f0, ze, sh in zip(p["f_hz"], p["zeta"], p["share"]): z = z+sh*k_mode(y, r.dt, 2*np.pi*f0, ze)
        y = z
    if has("saturation") and E["saturation"]["law"] != "amplifier-rail":
        p = E["saturation"]; k = p.get("slope", 0.0)*1.0; wd = max(p.get("width", 0.0), 1e-9)
        sp = lambda x: wd*np.logaddexp(0, x/wd)
        if "hi" in p: y = y-(1-k)*sp(y-p["hi"])
        if "lo" in p: y = y+(1-k)*sp(p["lo"]-y)
    if has("delay") and E["delay"]["law"] == "sensor": y = np.interp(r.t-E["delay"]["tau_s"], r.t, y)
    if has("lag") and E["lag"]["law"] == "sensor": y = k_lag(y, r.dt, E["lag"]["tau_s"], y[0])
    if has("drift"):
        p = E["drift"]; S = p["size"]*c["stroke"]; x = np.maximum(r.t, 0)/p["T"]; l = p["law"]
        g = {"line": lambda: x, "settling": lambda: 1-np.exp(-x/p.get("tau", 1)), "sqrt": lambda: np.sqrt(x),
             "bow": lambda: np.sin(np.pi*p.get("q", 1)*x+p.get("ph", 0)), "log": lambda: np.log1p(x/p.get("tau", 1)),
             "two-settlings": lambda: 1.6*(1-np.exp(-x/p["tau"]))-1.1*(1-np.exp(-x/p["tau2"]))}[l]()
        y = y+S*g
    if has("interference"):
        p = E["interference"]
        for k, a in zip(p["harmonics"], p["amps_um"]):
            y = y+a*np.sin(2*np.pi*p["f_hz"]*k*r.t+rr["ph"]*k+k*k)
    return y

def side_channels(c, r, which, rng):
    """Temperature, load, tone phase and random functions of one record (the same for record and twin)."""
    d = {}; t = r.t; T = max(r.T, 1e-3)
    tp = c["plan"].get("temp")
    if tp:
        sp = c["dT"]; q = 0.9 if which == "test" else 1.0
        x = t/T
        if tp == "wander": g = rand_smooth(rng, t, T/6)*0.3
        elif tp == "heater": g = np.where(x < .3, 1-np.exp(-np.maximum(x, 0)/.1), (1-np.exp(-3))*np.exp(-np.maximum(x-.3, 0)/.22))-.4+0.05*rand_smooth(rng, t, T/9)
        elif tp == "updown": g = np.interp(x, [0, .35, .55, .8, 1], [-.4, .5, .1, .45, -.3])+0.04*rand_smooth(rng, t, T/8)
        elif tp == "levels":                     # an oven: one level per segment
            m = len(c["plan"]["mult"]); lev = c["levels"][:m] if which == "train" else c["levels"][:m][::-1][:r.nseg]
            si = np.searchsorted(r.t[r.i[np.flatnonzero(np.diff(r.seg, prepend=-1))]], t+1e-9)-1
            g = np.array(lev)[np.clip(si, 0, r.nseg-1)]*1.0
            g = k_lag(g, r.dt, 2.0, g[0])+0.02*rand_smooth(rng, t, max(T/20, 1e-3))
        d["T0"] = 23.0; d["T"] = d["T0"]+q*sp*g
        d["Tbody"] = d["T"]
    lp = c["plan"].get("load_kind")
    if lp:
        Fm = c["Fmax"]; q = 0.9 if which == "test" else 1.0
        if lp == "random": g = 0.5+0.24*rand_smooth(rng, t, c["plan"].get("load_tc", 0.8)*r.per)
        elif lp == "weights":
            m = 14; k = np.sort(rng.uniform(0, T, m)); lev = rng.choice([0, .25, .5, .75, 1.0], m+1)
            g = lev[np.searchsorted(k, t)]; g = k_lag(g, r.dt, max(T/400, 3*r.dt[-1]), g[0])
        elif lp == "sine": g = 0.5+0.5*np.sin(2*np.pi*(c["fload"]*t+rng.uniform()))
        d["F"] = q*Fm*np.clip(g, -.2, 1.2); d["F0"] = 0.0
    d["ph"] = rng.uniform(0, 2*np.pi)
    u = c["plan"].get("unknown")
    tr0 = 0.0
    if u == "gain-wander": d["w"] = rand_smooth(rng, t, c["plan"].get("tc", 0.07)*T)
    elif u == "depoling":
        td = rng.uniform(.35, .6)*T if which == "train" else -1e9
        d["w"] = smooth((t-td)/(0.01*T))
    elif u == "slip":
        m = 3 if which == "train" else 2; k = np.sort(rng.uniform(.1, .9, m))*T; s = rng.choice([-1, 1], m)*rng.uniform(.6, 1.2, m)
        s[:2] = [abs(s[0]), -abs(s[1])]
        d["w"] = sum(a*smooth((t-b)/(0.0008*T)) for a, b in zip(s, k))
    elif u == "unrecorded-load":
        m = 16; k = np.sort(rng.uniform(0, .97, m))*T; s = rng.choice([-1, 1], m)*rng.uniform(.5, 1.3, m); w = rng.uniform(.006, .03, m)*T
        d["w"] = sum(a*(smooth((t-b)/(0.08*x))-smooth((t-b-x)/(0.08*x))) for a, b, x in zip(s, k, w))
    elif u == "telegraph":
        k = np.cumsum(rng.exponential(T/18, 80)); d["w"] = (np.searchsorted(k, t) % 2)*1.0
    elif u == "stick-slip": d["w"] = rng.uniform(.6, 1.4, 997)
    return d

# ------------------------------------------------------------------ random effects
def draw(name, law, c, r, rng, b):
    U = rng.uniform; S = c["stroke"]; per = r.per; T = r.T; P = c["plan"]
    dtm = np.min(np.diff(r.trec))
    fmax = P.get("fmax", 1/per)
    if name == "delay": return dict(law=law, tau_s=float(max(U(0.012, 0.03)*b/fmax, (1.6+U(0, 1))*dtm)))
    if name == "lag": return dict(law=law, tau_s=float(U(0.03, 0.07)*b/fmax))
    if name == "rate-dependence":
        rates = np.abs(np.diff(r.v)/r.dt[1:])[r.i[1:]-1]; med = float(np.exp(np.log(rates[rates > 1e-9]).mean())); lo = float(np.quantile(rates[rates > 1e-9], .1))
        if law == "power-dahl": return dict(law=law, w=U(.5, .8), zc=U(.04, .07)*b**.7, p=U(.2, .4), v0=med)
        if law == "log-thresholds": return dict(law=law, w=.5, k=float(U(.12, .2)*b), v0=lo)
        if law == "dynamic-relays": return dict(law=law, w=.5, k=float(U(7, 14)*np.quantile(rates, .9)/b**1.2))
    if name == "creep":
        if law == "log":
            taus = np.geomspace(max(T/3000, 2*dtm), 30*T, 26); w = np.full(26, U(.010, .016)*b/2.3)
        elif law == "fractional":
            al = U(.12, .3); taus = np.geomspace(max(T/2000, 2*dtm), 8*T, 24); w = (taus/T)**al; w = w/w.sum()*U(.10, .2)*b
        elif law == "exponentials":
            taus = np.array([U(.012, .03), U(.08, .2)])*T; w = np.array([U(.03, .05), U(.03, .06)])*b
        elif law == "three-exponentials":
            taus = np.array([U(.006, .012), U(.03, .06), U(.2, .4)])*T; w = np.array([U(.02, .04), U(.02, .04), U(.02, .05)])*b
        return dict(law=law, taus_s=taus.tolist(), weights=w.tolist())
    if name == "temperature":
        d = dict(law=law)
        if law in ("expansion", "both"): d["um_per_k"] = float(rng.choice([-1, 1])*U(.0012, .003)*S*b*15/c["dT"])
        if law in ("gain", "both"): d["gain_per_k"] = float(rng.choice([-1, 1])*U(.002, .005)*b*15/c["dT"])
        return d
    if name == "load":
        d = dict(law=law, um_per_n=float(-U(.02, .05)*S*b/c["Fmax"]), f_ref=c["Fmax"])
        if law == "hardening": d["hardening"] = U(.7, .85)
        if law == "compliance+gain": d["gain_per_n"] = float(-U(.03, .06)*b/c["Fmax"])
        return d
    if name == "resonance":
        f0 = P["f0"]
        if law == "one": return dict(law=law, f_hz=[float(f0*U(.9, 1.1))], zeta=[U(*P.get("ze", (.01, .04)))], share=[float(min(1, U(*P["share"])*b))])
        return dict(law=law, f_hz=[float(f0*U(.9, 1.1)), float(f0*U(1.9, 2.5))], zeta=[U(.012, .03), U(.012, .03)],
                    share=[float(min(.6, U(*P["share"])*b)), float(min(.4, U(*P["share"])*.5*b))])
    if name == "saturation":
        lo, hi = c["yref"]; R = hi-lo; e = U(.10, .17)*b**.5
        flip = rng.uniform() < .4
        if law == "hard-one": return dict(law=law, **({"lo": lo+e*R} if flip else {"hi": hi-e*R}))
        if law == "hard-both": return dict(law=law, lo=lo+e*R, hi=hi-e*R*.8)
        if law == "soft-one": return dict(law=law, **({"lo": lo+e*R} if flip else {"hi": hi-e*R}), width=.008*R, slope=U(.1, .3))
        if law == "soft-both": return dict(law=law, lo=lo+e*R, hi=hi-e*R, width=.01*R, slope=U(.1, .25))
        vm = r.v[r.i].max(); vl = r.v[r.i].min(); return dict(law=law, vhi=float(vm-(vm-vl)*e*.8))
    if name == "asymmetry":
        s = rng.choice([-1, 1])
        if law.endswith("quadratic"): return dict(law=law, a=float(s*U(.05, .10)*b))
        if law.endswith("exponential"): return dict(law=law, k=float(s*U(.12, .24)*b))
        return dict(law=law, a=float(s*U(.04, .08)*b), b=float(-U(.03, .06)*b))
    if name == "drift":
        d = dict(law=law, size=float(rng.choice([-1, 1])*U(.025, .06)*b), T=float(T))
        if law == "settling": d["tau"] = U(.12, .3)
        if law == "log": d["tau"] = .05; d["size"] *= .4
        if law == "two-settlings": d["tau"] = U(.08, .15); d["tau2"] = U(.4, .7); d["size"] *= 1.5
        if law == "bow": d["q"] = U(.9, 1.6); d["ph"] = U(0, .5); d["size"] *= .7
        return d
    if name == "interference":
        f = P["tone"]; a = max(U(3, 8)*c["noise"], U(.002, .006)*S)*b**.5
        if law == "tone": return dict(law=law, f_hz=f, harmonics=[1], amps_um=[float(a)])
        return dict(law=law, f_hz=f, harmonics=[1, 2, 3], amps_um=[float(a), float(a*U(.2, .5)), float(a*U(.15, .4))])
    if name == "unknown":
        u = P["unknown"]
        sz = {"gain-wander": U(.012, .022), "depoling": U(.05, .08), "slip": U(.02, .045), "unrecorded-load": U(.012, .025), "telegraph": U(.012, .02), "stick-slip": 0}[u]
        d = dict(law=u, size=float(sz*b))
        if u == "stick-slip": d.update(fs=.035*b, fc=.004*b, share=U(.6, .9))
        return d
    raise KeyError(name)

# ------------------------------------------------------------------ the model of a user, only to check that the case is fair
def model_basis(c, r, k):
    v = r.v; step = max(1, c["os"]//2); idx = r.i
    rs = np.linspace(0.02, 1.6, 26)*(v[idx].max()-v[idx].min())/2
    B = [np.ones(idx.size), v[idx]]
    for q in rs: B.append(k_plays(v, np.array([q]), np.ones(1))[idx])
    if c["model"] == "preisach":
        g = np.linspace(v[idx].min(), v[idx].max(), 14)
        for a in range(1, 14):
            for b_ in range(a):
                B.append(k_relays(v, np.array([g[a]-(g[1]-g[0])]), np.array([g[b_]+(g[1]-g[0])*0]), np.array([(g[1]-g[0])]), np.ones(1))[idx])
    B = np.stack(B, 1)[k]
    B = B/(np.linalg.norm(B, axis=0)+1e-12)
    Uu, s, _ = np.linalg.svd(B, full_matrices=False)
    return Uu[:, s > s[0]*1e-4]

def resid(Q, d): return d-Q@(Q.T@d)

def rms(x): return float(np.sqrt(np.mean(x*x)))

def rival_columns(c, r, y, names):
    """Returns signatures (fine grid, um) of other effects that resemble this one; only used for `accept`."""
    i = r.i; t = r.t; x = np.maximum(t, 0)/r.T; out = {}
    dy = np.gradient(y, t)
    base = 1/c["plan"].get("fmax", 1/r.per)
    out["delay"] = [[np.interp(t-tau, t, y)-y] for tau in base*np.geomspace(.003, .12, 22)]
    out["lag"] = [[k_lag(y, r.dt, tau, y[0])-y] for tau in base*np.geomspace(.003, .2, 22)]
    yb = y[:max(r.first, 2)].mean()
    taus = r.T*np.geomspace(.003, 1.2, 6); S = c["stroke"]
    out["creep"] = [[k_lag(y, r.dt, tau, yb)*.1 for tau in taus]+[q*.08*S*np.exp(-np.maximum(t, 0)/tau) for tau in taus]
                    for q in ((1, -1) if c["plan"]["start"] == "mid" else (0,))]
    out["drift"] = [[x**k for k in range(1, 5)]+[np.exp(-x/q) for q in (.05, .15, .4)]]
    vv = np.abs(r.v).max()
    rt = np.abs(np.diff(r.v, prepend=r.v[0]))/r.dt; v0 = np.exp(np.log(rt[i][rt[i] > 1e-9]).mean())
    out["rate-dependence"] = [[k_rdahl(r.v, r.dt, .06, v0, p) for p in (.15, .3, .5)]]
    out["asymmetry"] = [[y**2, y**3, y**4, r.v**2, r.v**3, r.v**4]]
    lo, hi = y[i].min(), y[i].max()
    out["saturation"] = [[np.maximum(y-(hi-q*(hi-lo)), 0), np.maximum(lo+q*(hi-lo)-y, 0)] for q in (.05, .1, .15, .2, .25)]
    if "T" in r.fx["train"]: out["temperature"] = [[r.fx["train"]["T"], r.fx["train"]["T"]*y]]
    if "F" in r.fx["train"]: out["load"] = [[r.fx["train"]["F"], r.fx["train"]["F"]*y]]
    return {k: [[z[i] for z in cols] for cols in v_] for k, v_ in out.items() if k not in names}

# ------------------------------------------------------------------ the plan: 64 recordings
def plan():
    R = []
    def add(fx, drive, **k): R.append(dict(fx=fx, drive=drive, **k))
    # ---- no effect (10)
    add({}, "sine", fs=200, f=.5, n=2400, start="mid", base="bouc-wen")
    add({}, "grow", fs=100, f=.4, n=4000, start="rest", base="maxwell-slip", test="sine")
    add({}, "trirates", f=2, mult=[.2, 1, 5, 15], fs=0, n=0, start="mid", base="random-plays")
    add({}, "stairs", fs=50, f=.02, n=6000, hold=4.0, rise=.3, start="rest", base="kp", test="sine", testf=.05)
    add({}, "chirp", fs=5000, f=3, f1=80, n=15000, start="mid", base="relays-lorentz")
    add({}, "walk", fs=100, f=.3, n=12000, start="rest", base="pinning-energy", temp="wander")
    add({}, "multisine", fs=2000, f=5, n=12000, start="mid", base="jiles-atherton", osf=2)
    add({}, "amps", fs=500, f=2, n=6000, amps=[1, .7, .45, .25], start="mid", base="coleman-hodgdon")
    add({}, "nested", fs=50, f=.08, n=7000, start="rest", base="rayleigh")
    add({}, "decay", fs=1000, f=4, n=8000, start="mid", base="pinning-energy", load_kind="random", test="walk")
    # ---- unlisted effects (6)
    add({"unknown": ""}, "triangle", unknown="slip", fs=400, f=1.2, n=6000, start="mid", base="maxwell-slip")
    add({"unknown": ""}, "sine", unknown="gain-wander", fs=250, f=1, n=9000, start="mid", base="dahl")
    add({"unknown": ""}, "decay", unknown="stick-slip", fs=300, f=.5, n=9000, start="rest", base="random-plays", test="walk")
    add({"unknown": ""}, "multisine", unknown="unrecorded-load", fs=500, f=.6, n=15000, start="mid", base="homogenised-energy", osf=2)
    add({"unknown": ""}, "grow", unknown="telegraph", fs=200, f=.7, n=7000, start="rest", base="rayleigh", test="sine")
    add({"unknown": ""}, "walk", unknown="gain-wander", tc=.03, fs=100, f=.5, n=14000, start="mid", base="kp", test="multisine")
    # ---- one effect (32)
    add({"delay": "amplifier"}, "chirp", fs=20000, f=8, f1=160, n=24000, start="mid", base="random-plays", fmax=160, boost=1.6)
    add({"delay": "sensor"}, "rates", f=6, mult=[.3, 1, 3, 9], fs=0, n=0, spp=300, start="mid", base="homogenised-energy", fmax=54)
    add({"delay": "sensor"}, "walk", fs=4000, f=14, n=20000, start="rest", base="maxwell-slip", fmax=30, boost=1.5)
    add({"lag": "amplifier"}, "chirp", fs=10000, f=4, f1=120, n=30000, start="mid", base="dahl", fmax=120, taper=.4)
    add({"lag": "sensor"}, "trirates", f=4, mult=[.25, 1, 4, 10], fs=0, n=0, spp=400, start="mid", base="maxwell-slip", fmax=40)
    add({"lag": "sensor"}, "multisine", fs=3000, f=6, n=12000, ratios=[1, 2.37, 5.13, 9.7], start="mid", base="pinning-energy", fmax=50, osf=4)
    add({"rate-dependence": "power-dahl"}, "trirates", f=1, mult=[.1, .5, 2.5, 12, 50], fs=0, n=0, start="mid", base="maxwell-slip")
    add({"rate-dependence": "log-thresholds"}, "chirp", fs=1000, f=.1, f1=20, n=30000, start="mid", base="coleman-hodgdon")
    add({"rate-dependence": "dynamic-relays"}, "rates", f=1, mult=[.1, .4, 2, 8, 30], fs=0, n=0, start="mid", base="relays-lorentz")
    add({"creep": "log"}, "stairs", fs=50, f=.02, n=9000, hold=9.0, rise=.2, steps=4, start="rest", base="random-plays", test="stairs")
    add({"creep": "fractional"}, "stairs", fs=100, f=.1, n=12000, hold=6.0, rise=.1, random_stairs=True, start="rest", base="homogenised-energy", test="walk", testf=.15, osf=2)
    add({"creep": "three-exponentials"}, "walk", fs=50, f=.06, n=12000, start="mid", base="rayleigh", boost=1.5)
    add({"temperature": "gain"}, "sine", fs=50, f=.2, n=15000, start="mid", temp="wander", base="maxwell-slip")
    add({"temperature": "expansion"}, "nested", fs=50, f=.1, n=12000, start="rest", temp="updown", base="kp")
    add({"temperature": "both"}, "trirates", f=1, mult=[1, .5, 2, 1], cycles=8, fs=0, n=0, start="mid", temp="levels", gap=(60, 200), base="rayleigh")
    add({"load": "linear"}, "triangle", fs=200, f=.8, n=10000, start="mid", load_kind="random", base="pinning-energy")
    add({"load": "hardening"}, "grow", fs=200, f=.6, n=10000, start="rest", load_kind="weights", base="dahl", test="sine")
    add({"load": "compliance+gain"}, "multisine", fs=1000, f=2, n=16000, start="mid", load_kind="sine", fload=1.37, base="random-plays")
    add({"resonance": "one"}, "chirp", fs=16000, f=20, f1=900, log=False, n=32000, start="mid", f0=620, share=(.02, .05), base="bouc-wen", osf=6)
    add({"resonance": "one"}, "triangle", fs=10000, f=7, n=12000, start="mid", f0=410, share=(1, 1), ze=(.012, .03), base="kp", osf=6)
    add({"resonance": "two"}, "stairs", fs=8000, f=2, n=20000, hold=.06, rise=.0012, random_stairs=True, start="rest", f0=330, share=(.1, .3), base="random-plays", osf=6)
    add({"saturation": "hard-one"}, "grow", fs=300, f=.8, n=7000, start="rest", base="random-plays", test="sine")
    add({"saturation": "soft-both"}, "walk", fs=200, f=.6, n=12000, start="mid", base="maxwell-slip", test="decay")
    add({"saturation": "amplifier-rail"}, "triangle", fs=1000, f=5, n=5000, start="mid", base="coleman-hodgdon")
    add({"asymmetry": "before-quadratic"}, "decay", fs=200, f=.5, n=8000, start="mid", base="rayleigh", test="walk")
    add({"asymmetry": "behind-exponential"}, "amps", fs=400, f=1.5, n=6000, amps=[1, .75, .5, .3], start="rest", base="dahl")
    add({"asymmetry": "behind-quad-cubic"}, "nested", fs=100, f=.2, n=9000, start="rest", base="random-plays", test="sine")
    add({"drift": "line"}, "sine", fs=100, f=.7, n=700, start="mid", base="bouc-wen")
    add({"drift": "two-settlings"}, "triangle", fs=100, f=.5, n=9000, start="mid", base="relays-lorentz")
    add({"drift": "bow"}, "multisine", fs=200, f=.4, n=14000, start="mid", base="jiles-atherton", osf=2)
    add({"interference": "tone"}, "sine", fs=1000, f=1.3, n=8000, start="mid", tone=50.0, base="coleman-hodgdon")
    add({"interference": "harmonics"}, "walk", fs=2000, f=3, n=20000, start="mid", tone=87.3, base="homogenised-energy", osf=2)
    # ---- two (13)
    add({"delay": "sensor", "asymmetry": "behind-quadratic"}, "chirp", fs=8000, f=4, f1=90, n=24000, start="mid", base="maxwell-slip", fmax=90)
    add({"creep": "log", "temperature": "both"}, "stairs", fs=50, f=.02, n=16000, hold=8.0, rise=.3, random_stairs=True, start="rest", temp="wander", base="random-plays", test="stairs")
    add({"resonance": "one", "creep": "exponentials"}, "stairs", fs=5000, f=2, n=25000, hold=.22, rise=.0016, random_stairs=True, start="rest", f0=260, share=(.15, .5), base="dahl", osf=6)
    add({"lag": "amplifier", "interference": "tone"}, "rates", f=5, mult=[.3, 1, 3, 8], fs=0, n=0, spp=300, fsmax=6000, start="mid", tone=60.0, fmax=40, base="rayleigh")
    add({"rate-dependence": "power-dahl", "drift": "line"}, "trirates", f=1, mult=[.1, 5, .5, 20, 1.5], cycles=5, fs=0, n=0, start="mid", base="random-plays")
    add({"load": "linear", "asymmetry": "before-exponential"}, "walk", fs=200, f=.7, n=12000, start="mid", load_kind="weights", base="maxwell-slip", test="sine")
    add({"saturation": "hard-both", "drift": "settling"}, "sine", fs=200, f=.8, n=8000, start="mid", base="rayleigh")
    add({"temperature": "gain", "load": "linear"}, "multisine", fs=100, f=.3, n=20000, start="mid", temp="wander", load_kind="random", base="pinning-energy")
    add({"creep": "fractional", "interference": "tone"}, "stairs", fs=400, f=.1, n=20000, hold=2.4, rise=.03, random_stairs=True, start="rest", tone=50.0, base="kp", test="stairs", osf=2)
    add({"resonance": "one", "delay": "sensor"}, "chirp", fs=20000, f=15, f1=700, n=30000, start="mid", f0=480, share=(.02, .05), fmax=300, base="random-plays", osf=6, taper=.5)
    add({"asymmetry": "behind-exponential", "interference": "harmonics"}, "triangle", fs=1500, f=2.3, n=10000, start="mid", tone=50.0, base="dahl")
    add({"rate-dependence": "log-thresholds", "saturation": "soft-one"}, "trirates", f=1, mult=[.1, .6, 4, 25], fs=0, n=0, cycles=5, start="mid", base="maxwell-slip")
    add({"lag": "sensor", "temperature": "gain"}, "rates", f=3, mult=[1, 6, 2, 10, .5], cycles=7, fs=0, n=0, spp=200, start="mid", temp="levels", gap=(60, 200), fmax=30, base="bouc-wen")
    # ---- three (3)
    add({"drift": "sqrt", "interference": "tone", "asymmetry": "before-quadratic"}, "decay", fs=800, f=1, n=24000, start="mid", tone=60.0, base="random-plays", test="walk")
    add({"load": "compliance+gain", "temperature": "expansion", "creep": "exponentials"}, "stairs", fs=50, f=.05, n=18000, hold=10.0, rise=.3, random_stairs=True, start="rest", temp="updown", load_kind="weights", base="maxwell-slip", test="stairs")
    add({"lag": "sensor", "drift": "line", "interference": "harmonics"}, "chirp", fs=6000, f=1, f1=60, n=36000, start="mid", tone=137.0, fmax=60, base="homogenised-energy", osf=2)
    assert len(R) == 64
    return R

RANGES = [(0, 100), (0, 120), (0, 150), (-20, 120), (-100, 100), (-60, 60), (0, 100), (0, 150)]
SENSORS = ["white", "pink", "white+spikes", "white+12bit", "white+16bit", "white", "pink+16bit", "white"]

# ------------------------------------------------------------------ one case
def make_case(idx, p, seed):
    rng = np.random.default_rng([seed, idx]); U = rng.uniform
    c = dict(plan=p, base=p["base"], model="pi" if p["base"] in PI_LAWS else "preisach")
    c["lawpar"], c["law"], sgn = make_law(p["base"], rng)
    vlo, vhi = RANGES[rng.integers(len(RANGES))]; mid, half = (vlo+vhi)/2, (vhi-vlo)/2
    vrest = (0-mid)/half
    # loop opening 5..20 % of the stroke: mix the law with a line
    tt = np.linspace(0, 3, 6001); mv = vrest+(-np.cos(2*np.pi*tt)-vrest)*smooth(tt*3)
    s = c["law"](mv); a = s[4000:]; x = mv[4000:]
    Wd = np.abs(np.interp(np.linspace(-.9, .9, 50), x[1:1001], a[1:1001])-np.interp(np.linspace(-.9, .9, 50), x[:999:-1], a[:999:-1])).max()
    St = (a.max()-a.min())
    tgt = U(.04, .08) if "rate-dependence" in p["fx"] else U(.06, .19)
    if sgn < 0: mu = tgt*2/(Wd+tgt*St); c["lin"], c["mu"] = 1.0, -mu
    else: mu = tgt*2/(Wd-tgt*St+2*tgt) if Wd-tgt*St > 0 else 1.0; mu = min(mu*1.0, 3.0); c["mu"] = mu; c["lin"] = max(0.0, 1-mu*St/2) if mu*St/2 < 1 else 0.0
    if sgn > 0:
        # solve lin*2+mu*St = 2 and mu*Wd = 2*tgt; if the loop of the law alone is narrower than tgt, use the law alone
        mu = 2*tgt/Wd; lin = 1-mu*St/2
        if lin < 0: lin, mu = 0.0, 2/St
        c["mu"], c["lin"] = mu, lin
    stroke = float(np.round(np.exp(U(np.log(6), np.log(120))), 2)); sign = -1 if idx % 9 == 4 else 1
    c["um"] = sign*stroke/2; c["stroke"] = stroke
    if p["fx"].get("rate-dependence") in ("log-thresholds", "dynamic-relays"): c["lin"] *= .5; c["mu"] *= .5; s_rate = .5
    else: s_rate = 0.0
    full = c["lin"]*mv+c["mu"]*s+s_rate*mv          # with the rate element the base law has half of the stroke
    c["um"] *= 2/(full[4000:].max()-full[4000:].min())
    c["open"] = Wd*abs(c["mu"])/(full[4000:].max()-full[4000:].min())
    sensor = SENSORS[rng.integers(len(SENSORS))]; c["noise"] = float(stroke*np.exp(U(np.log(.0003), np.log(.002))))
    c["dT"] = U(9, 22); c["levels"] = (rng.permutation([-.5, .1, .5, -.2, .35])).tolist()
    c["Fmax"] = float(np.round(U(5, 60), 1)); c["fload"] = p.get("fload", 1.0)
    # rate elements have the same random parts in record and twin
    r_ = U(.05, .6, 14); up0 = U(-.9, .9, 260); hc = U(.03, .3, 260)
    c["rd"] = dict(r=r_, w=np.full(14, 1/14), up=up0*.8+hc, dn=up0*.8-hc, rw=np.full(260, 1/260))
    osf = p.get("osf", 4 if any(k in p["fx"] for k in ("delay", "lag", "rate-dependence")) else 3); c["os"] = osf
    amp = U(.9, .99); P = dict(p); P["amp"] = amp
    seed_d = rng.integers(1 << 30, size=4); via = bool(U() < .25)
    # train and test drives
    segs = drive(p["drive"], np.random.default_rng(seed_d[0]), P)
    tr = build(segs, p["start"], vrest, osf, np.random.default_rng(seed_d[1]), p.get("gap", (2., 6.)), via)
    Q = dict(p); tk = p.get("test", p["drive"]); sat = "saturation" in p["fx"]
    full_amp = sat or "asymmetry" in p["fx"]
    ta = amp*(U(.95, 1.0) if full_amp else U(.65, 1.01)); Q["amp"] = ta
    Q["off"] = 0.0 if full_amp or ta > .9*amp else float(rng.choice([-1, 1])*U(0, 1)*(amp-ta))
    fk = U(.75, 1.3)
    Q["start"] = p["start"] if U() < .8 else "mid"
    if tk in ("rates", "trirates"):
        m = p["mult"]; lo, hi = np.log(min(m)), np.log(max(m)); Q["mult"] = [float(np.exp(U(lo, hi))) for _ in range(max(3, len(m)-1))]
        if "temperature" in p["fx"]: Q["mult"] = Q["mult"][:4]
    elif tk == "chirp" and p["drive"] == "chirp": Q["f"] = p["f"]*U(1.0, 1.5); Q["f1"] = p["f1"]*U(.8, 1.0); Q["down"] = bool(U() < .5)
    elif tk == "stairs":
        Q["hold"] = p["hold"]*U(.7, 1.2)
    else: Q["f"] = p.get("testf", p["f"]*fk)
    if tk == "amps": Q["amps"] = [.9, .55, .35]
    if Q.get("n"): Q["n"] = int(max(700, p["n"]*U(.5, .8)))
    segs_t = drive(tk, np.random.default_rng(seed_d[2]), Q)
    te = build(segs_t, Q["start"], vrest, osf, np.random.default_rng(seed_d[3]), p.get("gap", (2., 6.)), via)
    for r, w in ((tr, "train"), (te, "test")):
        r.fx = {w: side_channels(c, r, w, np.random.default_rng([seed, idx, 7, w == "test"]))}
    for k in ("T", "F"):                             # the test stays within the range of the training record
        a, b_ = tr.fx["train"], te.fx["test"]
        if k in a:
            x, z = a[k][tr.i], b_[k][te.i]; w = .94*min(1.0, (x.max()-x.min())/(z.max()-z.min()+1e-12))
            m = (z.max()+z.min())/2; lo, hi = x.min()+w*(m-z.min()), x.max()-w*(z.max()-m)
            b_[k] = np.clip(m, min(lo, hi), max(lo, hi))+w*(b_[k]-m)
            if k == "T": b_["Tbody"] = b_["T"]
    names = list(p["fx"]); c["fx"] = {}
    # -------- draw the effects and check them; if too weak, draw again with a larger size
    kk = np.unique(np.linspace(0, tr.i.size-1, min(4000, tr.i.size)).astype(int))
    Qb = model_basis(c, tr, kk)
    y0 = simulate(c, tr, [], "train"); c["yref"] = (float(y0[tr.i].min()), float(y0[tr.i].max()))
    vis = {}; b = 1.0; why = ""; base_fix = {}
    bo = {n: p.get("boost", 1.0) for n in names}
    for n in names: c["fx"][n] = None
    erng = {n: np.random.default_rng([seed, idx, zlib.crc32(n.encode())]) for n in names}
    tries = 0
    todo = list(names)
    while todo and tries < 30:
        for n in todo: c["fx"][n] = draw(n, p["fx"][n], c, tr, erng[n], bo[n])
        tr.cache.clear(); te.cache.clear()
        if "saturation" in names and p["fx"]["saturation"] != "amplifier-rail" and tries == 0 and len(names) > 1:
            yy = simulate(c, tr, [n for n in names if n != "saturation"], "train")   # position of the stop together with the other effects
            if "drift" not in names: c["yref"] = (float(yy[tr.i].min()), float(yy[tr.i].max()))
            c["fx"]["saturation"] = draw("saturation", p["fx"]["saturation"], c, tr, erng["saturation"], bo["saturation"]); tr.cache.clear()
        y_all = simulate(c, tr, names, "train"); y_tw = simulate(c, tr, [], "train")
        misfit = rms(resid(Qb, y_tw[tr.i][kk])); floor = c["noise"]
        todo = []
        for n in names:
            d = (y_all-simulate(c, tr, [m for m in names if m != n], "train"))[tr.i]
            e = resid(Qb, d[kk])
            vis[n] = dict(rms=rms(d), left=rms(e), peak=float(np.quantile(np.abs(e), .99)))
            ok = vis[n]["left"] > max(2*floor, .8*misfit) and vis[n]["peak"] > 5*floor
            if not ok: todo.append(n); bo[n] *= 1.15
        tries += 1
    if not names: y_tw = y_all = y0; misfit = rms(resid(Qb, y0[tr.i][kk]))
    # -------- names that are indistinguishable on this record
    accept = []; dbg = {}
    if names and "unknown" not in names:
        for n in names:
            yb = simulate(c, tr, [m for m in names if m != n], "train"); d = (y_all-yb)[tr.i][kk]
            for rn, sets in rival_columns(c, tr, yb, names).items():
                best = 9e9
                for cols in sets:
                    C = np.stack(cols, 1)[kk]
                    if rn in ("delay", "lag"): e = resid(Qb, d-C[:, 0])
                    elif rn == "creep":
                        D = C-Qb@(Qb.T@C); D = D[:, np.abs(C).max(0) > 0]; e0 = resid(Qb, d)
                        e = e0-D@lsq_linear(D, e0, (0, 1)).x
                    else:
                        C = C/(np.abs(C).max(0)+1e-12); C = C-Qb@(Qb.T@C); e0 = resid(Qb, d)
                        co = np.linalg.lstsq(C, e0, rcond=1e-5)[0]; e = e0-C@co
                    best = min(best, rms(e))
                dbg[n+">"+rn] = best/floor
                if best < max(.8*floor, .35*misfit): accept.append(sorted([m for m in names if m != n]+[rn]))
    # -------- write
    rows = {}
    for r, w in ((tr, "train"), (te, "test")):
        nr = np.random.default_rng([seed, idx, 99, w == "test"]); n = r.i.size
        e = pink(nr, n) if sensor.startswith("pink") else nr.normal(size=n)
        e = e*c["noise"]
        if "spikes" in sensor:
            m = nr.uniform(size=n) < .002; e = e+m*nr.choice([-1, 1], n)*nr.uniform(8, 25, n)*c["noise"]
        lsb = 0
        if "bit" in sensor: lsb = stroke*1.6/2**(12 if "12" in sensor else 16)
        extra = {}
        if "T" in r.fx[w]: extra["temperature_degc"] = np.round(r.fx[w]["T"][r.i]+nr.normal(0, .03, n), 2)
        if "F" in r.fx[w]: extra["load_n"] = np.round(r.fx[w]["F"][r.i]+nr.normal(0, .004*c["Fmax"], n), 3)
        offs = stroke/2*1.1
        for tag, on in (("", names), ("twin-", [])):
            y = simulate(c, r, on, w)[r.i]+e+offs
            if lsb: y = np.round(y/lsb)*lsb
            rows[tag+w] = (r, y, extra)
    nz = c["noise"]
    if "bit" in sensor: nz = float(np.hypot(nz, lsb/np.sqrt(12)))
    fxj = {n: {k: (v if not isinstance(v, (np.floating, np.integer)) else v.item()) for k, v in c["fx"][n].items()} for n in names}
    truth = dict(id="v%02d" % (idx+1), base=p["base"], model=c["model"], effects=fxj, expect=sorted(names), accept=accept,
                 drive=p["drive"], test_drive=tk, start=p["start"], test_start=Q["start"], sensor=sensor, noise_um=nz,
                 stroke_um=stroke, loop_opening=float(c["open"]), volts=[vlo, vhi], gain_sign=sign, gap_via_rest=via if tr.nseg > 1 else None,
                 judged=dict(tries=tries, noise_rel=c["noise"]/stroke, model_misfit_in_noise=misfit/c["noise"], left_in_noise={n: vis[n]["left"]/c["noise"] for n in names}, rivals={k: round(v, 2) for k, v in dbg.items() if v < 4}))
    return truth, rows, (mid, half), tries >= 30

def write(out, truth, rows, scale):
    d = os.path.join(out, truth["id"]); os.makedirs(d, exist_ok=True); mid, half = scale
    for name, (r, y, extra) in rows.items():
        cols = [("time_s", r.trec, "%.8f"), ("voltage_v", mid+half*r.v[r.i], "%.4f"), ("displacement_um", y, "%.6f")]
        cols += [(k, v, "%.3f") for k, v in extra.items()]
        if r.nseg > 1: cols.append(("segment", r.seg, "%d"))
        np.savetxt(os.path.join(d, name+".csv"), np.stack([q[1] for q in cols], 1), fmt=[q[2] for q in cols], delimiter=",", header=",".join(q[0] for q in cols), comments="")
    json.dump(truth, open(os.path.join(d, "truth.json"), "w"), indent=1)

if __name__ == "__main__":
    ap = argparse.ArgumentParser(); ap.add_argument("out"); ap.add_argument("--seed", type=int, default=50713); ap.add_argument("--only")
    a = ap.parse_args(); only = set(a.only.split(",")) if a.only else None
    for i, p in enumerate(plan()):
        if only and "v%02d" % (i+1) not in only: continue
        t, rows, sc, weak = make_case(i, p, a.seed); write(a.out, t, rows, sc)
        j = t["judged"]
        print(t["id"], t["base"], t["model"], "+".join(t["expect"]) or "-", t["drive"], "rows", rows["train"][0].i.size, "open %.2f" % t["loop_opening"],
              "misfit %.1f (%.2f%%)" % (j["model_misfit_in_noise"], j["model_misfit_in_noise"]*100*j["noise_rel"]), {k: round(v, 1) for k, v in j["left_in_noise"].items()}, "tries", j["tries"], "WEAK" if weak else "", t["accept"], j["rivals"], flush=True)
