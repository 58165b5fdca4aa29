"""An examination of 72 simulated piezo actuators, written without knowledge of the program: `python -B tenth.py OUTDIR`.

Every case is one actuator: a drive, the hysteresis law, and a chain of effects around it, all on a grid finer than the record:
  voltage -> delay -> amplifier lag -> rail -> curve before -> hysteresis (width by rate and temperature) -> curve after
  -> load -> creep -> structure -> temperature -> stop -> drift -> faults -> tone -> noise -> converter
The drive also runs before the record starts and in its gaps; those rows act on the actuator but are not in the CSV.
In addition to the fields for score.py, truth.json has "check": for each effect its RMS (with - without it, no noise) divided by the noise,
divided by the RMS of the hysteresis (output minus its best line in voltage), and, after a fit of 24 play operators and a constant, by the noise.
"""
import json
import math
import os
import sys

for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.signal import butter, cont2discrete, lfilter, sosfiltfilt
from scipy.stats import cauchy, gamma, lognorm, norm

# ------------------------------------------------------------------------------------------------------------ hysteresis laws
# Each has the input x (about -1 to 1), time t, width factor s (array) and its parameters, and returns an output of about the same size.
# A rate-independent law is solved exactly from one reversal to the next (closed form, quadrature or sorted events), not by steps.
# If the width changes with time, its elements are computed at every fine step.


def runs(x):
    """Returns monotone runs: (first, last, direction); samples first + 1 to last move in that direction or rest."""
    d = np.diff(x)
    way = np.where(np.abs(d) < 1e-13, 0, np.sign(d)).astype(int)
    moving = np.flatnonzero(way)
    if moving.size == 0:
        return [(0, x.size - 1, 1)]
    turn = moving[1:][way[moving[1:]] != way[moving[:-1]]]
    edges = [0, *turn.tolist(), x.size - 1]
    signs = [way[moving[0]], *way[turn].tolist()]
    return list(zip(edges[:-1], edges[1:], signs))


def plays(x, s, r, p):
    """Weighted sum of play operators."""
    y = np.empty(x.size)
    if np.ptp(s) > 0:
        f, w, a = np.zeros(r.size), np.empty(r.size), np.empty(r.size)
        for i, (u, k) in enumerate(zip(x.tolist(), s.tolist())):
            np.multiply(r, k, out=w)
            np.subtract(u, w, out=a)
            np.maximum(f, a, out=f)
            np.add(u, w, out=a)
            np.minimum(f, a, out=f)
            y[i] = p @ f
        return y
    r = r * s[0]
    f = np.clip(0.0, x[0] - r, x[0] + r)
    y[0] = p @ f
    for first, last, way in runs(x):
        u, g = way * x[first + 1 : last + 1], way * f
        order = np.argsort(g + r)  # each play operator moves from x = g + r on
        at, q = (g + r)[order], p[order]
        slope = np.concatenate([[0.0], np.cumsum(q)])
        level = np.concatenate([[0.0], np.cumsum(q * at)])
        k = np.searchsorted(at, u)
        y[first + 1 : last + 1] = way * (p @ g + slope[k] * u - level[k])
        f = way * np.maximum(g, u[-1] - r)
    return y


def pi_density(x, t, s, p):
    """Prandtl-Ishlinskii with a few hundred random thresholds of a continuous density."""
    rng = np.random.default_rng(p.get("seed", 1))
    n = p.get("n", 300)
    q = (np.arange(n) + rng.random(n)) / n
    kind = p.get("density", "gamma")
    if kind == "gamma":
        r = gamma.ppf(q * 0.995, p.get("shape", 1.6), scale=p.get("scale", 0.2))
    elif kind == "lognormal":
        r = lognorm.ppf(q * 0.995, p.get("shape", 0.8), scale=p.get("scale", 0.22))
    else:
        r = p.get("scale", 0.9) * q ** p.get("shape", 1.3)
    h = p.get("h", 0.6)
    return (1 - h) * x + plays(x, s, r, np.full(n, h / n))


def maxwell_slip(x, t, s, p):
    """Goldfarb and Celanovic: y + sum of stick-slip forces(y) = x; the input of the elements is the displacement, not the voltage."""
    rng = np.random.default_rng(p.get("seed", 2))
    n = p.get("n", 70)
    q = (np.arange(n) + rng.random(n)) / n
    k = np.full(n, p.get("h", 0.45) / n) * (1.2 - 0.4 * q)
    limit = k * (p.get("reach", 1.1) * q ** p.get("shape", 1.5) + 0.004)
    force, here = np.zeros(n), 0.0
    y = np.empty(x.size)
    for first, last, way in [(-1, 0, int(np.sign(x[0])) or 1), *runs(x)]:
        start, now = way * force, way * here
        slip = now + (limit - start) / k  # displacement at which each element slips
        order = np.argsort(slip)
        slopes = 1 + k.sum() - np.concatenate([[0.0], np.cumsum(k[order])])
        ys = np.concatenate([[now], slip[order], [slip.max() + 9.0]])
        xs = now + start.sum() + np.concatenate([[0.0], np.cumsum(np.diff(ys) * slopes)])
        out = np.interp(way * x[first + 1 : last + 1], xs, ys)
        y[first + 1 : last + 1] = way * out
        force = way * np.minimum(start + k * (out[-1] - now), limit)
        here = way * out[-1]
    return y


def madelung(x, virgin, branch):
    """Reversals by Madelung's rules. branch(x, turn, target): the branch from a reversal; target: the reversal before it."""
    y = np.empty(x.size)
    y[0] = virgin(x[0])
    stack = []
    for first, last, way in runs(x):
        here = (x[first], y[first])
        if stack or first > 0 or x[0] * way < 0:
            stack.append(here)
        i = first + 1
        while i <= last:
            if not stack:
                y[i : last + 1] = virgin(x[i : last + 1])
                break
            turn = stack[-1]
            target = stack[-2] if len(stack) > 1 else (-turn[0], -turn[1])
            u = x[i : last + 1]
            n = int(np.searchsorted(way * u, way * target[0], side="right"))
            if n:
                y[i : i + n] = branch(u[:n], turn, target)
            i += n
            if i <= last:
                del stack[-2:]
    return y


def of_curve(x, phi):
    """Every branch is twice the virgin curve at half the distance."""
    return madelung(
        x,
        lambda u: np.sign(u) * phi(np.abs(u)),
        lambda u, turn, target: turn[1] + 2 * np.sign(u - turn[0]) * phi(np.abs(u - turn[0]) / 2),
    )


def rayleigh(x, t, s, p):
    """Rayleigh's law: branches are parabolas."""
    a, b = p.get("a", 0.75), p.get("b", 0.28)
    return of_curve(x, lambda d: a * d + b * d * d)


def pi_curve(x, t, s, p):
    """Prandtl-Ishlinskii of an exponential density in closed form, without discrete thresholds."""
    a, b, c = p.get("a", 0.55), p.get("b", 0.5), p.get("c", 0.3)
    return of_curve(x, lambda d: a * d + b * (d + c * np.expm1(-d / c)))


def pi_hyperbola(x, t, s, p):
    """Prandtl-Ishlinskii with a hyperbolic virgin curve (density of 1 / (c + r)^3)."""
    a, b, c = p.get("a", 0.6), p.get("b", 0.45), p.get("c", 0.35)
    return of_curve(x, lambda d: a * d + b * d * d / (c + d))


def takacs(x, t, s, p):
    """Takacs: tanh branches; each ends in the previous reversal."""
    a, b, c = p.get("a", 0.8), p.get("b", 0.5), p.get("c", 0.5)
    low, high = np.tanh(a * (-1 - c)), np.tanh(a * (1 - c))

    def branch(u, turn, target):
        z = (u - turn[0]) / (target[0] - turn[0]) if target[0] != turn[0] else np.ones(u.size)
        return turn[1] + (target[1] - turn[1]) * ((1 - b) * z + b * (np.tanh(a * (2 * z - 1 - c)) - low) / (high - low))

    return madelung(x, lambda u: u * (1 - b) + b * np.tanh(a * u) / np.tanh(a), branch)


def spread(n, p, seed):
    """Returns centres and half-widths of relays: a low-discrepancy sequence and the inverse distribution functions."""
    g = 1.32471795724474602596
    i = np.arange(1, n + 1)
    a = (0.5 + seed * 0.137 + i / g) % 1 * 0.998 + 0.001
    b = (0.5 + seed * 0.291 + i / g**2) % 1 * 0.998 + 0.001
    kind = p.get("density", "gauss")
    if kind == "gauss":
        return norm.ppf(a, p.get("c0", 0.0), p.get("cs", 0.8)), np.abs(norm.ppf(b, p.get("h0", 0.28), p.get("hs", 0.14)))
    if kind == "lognormal":
        return norm.ppf(a, p.get("c0", 0.0), p.get("cs", 0.8)), lognorm.ppf(b, p.get("hs", 0.6), scale=p.get("h0", 0.25))
    return cauchy.ppf(a, p.get("c0", 0.0), p.get("cs", 0.7)), np.abs(cauchy.ppf(b, p.get("h0", 0.25), p.get("hs", 0.1)))


def preisach(x, t, s, p):
    """Relays of a density; with coupling the mean polarisation acts on each (moving Preisach, domain switching) and they switch in avalanches."""
    h = p.get("h", 0.7)
    y = np.empty(x.size)
    if np.ptp(s) > 0:
        centre, half = spread(p.get("n", 3000), p, p.get("seed", 1))
        on = x[0] > centre
        w = np.empty(half.size)
        for i, (u, k) in enumerate(zip((x).tolist(), s.tolist())):
            np.multiply(half, k, out=w)
            np.copysign(w, 0.5 - on, out=w)  # an open relay switches at centre + w, a closed relay at centre - w
            np.add(centre, w, out=w)
            np.less(w, u, out=on)
            y[i] = np.count_nonzero(on)
        return (1 - h) * x + h * (2 * y / half.size - 1)
    centre, half = spread(p.get("n", 12000), p, p.get("seed", 1))
    n, coupling = half.size, p.get("coupling", 0.0)
    up, down = centre + half * s[0], centre - half * s[0]
    by_up, by_down = np.argsort(up), np.argsort(down)[::-1]
    on = x[0] > centre
    first_run = int(np.sign(np.ptp(x))) and runs(x)[0][2]
    count = np.count_nonzero(on)
    y[0] = 2 * count / n - 1
    for first, last, way in [(-1, 0, first_run or 1), *runs(x)]:
        u = x[first + 1 : last + 1]
        if way > 0:
            order = by_up[~on[by_up]]
            need = up[order]
        else:
            order = by_down[on[by_down]]
            need = -down[order]
        polar = way * (2 * count / n - 1) + 2 * np.arange(order.size) / n
        need = np.maximum.accumulate(need - coupling * polar) if order.size else need
        k = np.searchsorted(need, way * u, side="right")
        y[first + 1 : last + 1] = 2 * (count + way * k) / n - 1
        on[order[: k[-1]]] = way > 0
        count += way * k[-1]
    return (1 - h) * x + h * y


def ridges(x, t, s, p):
    """Krasnosel'skii-Pokrovskii kernels: relays with a slope (linear or tanh) instead of a jump."""
    n = p.get("n", 400)
    centre, half = spread(n, p, p.get("seed", 1))
    wide = p.get("width", 0.2) * (0.6 + 0.8 * ((np.arange(n) * 0.618) % 1))
    ridge = np.tanh if p.get("smooth") else lambda z: np.clip(z, -1, 1)
    state = ridge((x[0] - centre) / wide)
    y = np.empty(x.size)
    y[0] = state.mean()
    for first, last, way in runs(x):
        z = ridge((x[first + 1 : last + 1, None] - centre - way * half) / wide)
        z = np.maximum(z, state) if way > 0 else np.minimum(z, state)
        y[first + 1 : last + 1] = z.mean(1)
        state = z[-1]
    h = p.get("h", 0.7)
    return (1 - h) * x + h * y


def bouc_wen(x, t, s, p):
    """Bouc and Wen, by the tabulated integral of dx = dz / (1 - |z|^n (gamma + beta sign(z dx)))."""
    scale, n, beta, gam = p.get("scale", 0.35), p.get("n", 1.4), p.get("beta", 0.65), p.get("gamma", 0.35)
    most = (beta + gam) ** (-1 / n)
    grid = most * np.concatenate([np.linspace(-1, 0, 3000)[:-1], -np.expm1(-np.linspace(0, 22, 6000))])
    middle = (grid[1:] + grid[:-1]) / 2

    def rate(z):
        return 1 / (1 - np.abs(z) ** n * (gam + beta * np.sign(z)))

    ends = rate(grid)
    path = np.concatenate([[0.0], np.cumsum(np.diff(grid) * (ends[1:] + 4 * rate(middle) + ends[:-1]) / 6)])
    z = np.empty(x.size)
    z[0] = 0.0
    for first, last, way in runs(x):
        start = np.interp(way * z[first], grid, path)
        z[first + 1 : last + 1] = way * np.interp(start + np.abs(x[first + 1 : last + 1] - x[first]) / scale, path, grid)
    return x - p.get("h", 0.2) * z


def dahl(x, t, s, p):
    """Dahl: dz = (1 - z sign(dx))^power dx, in closed form."""
    scale, power = p.get("scale", 0.4), p.get("power", 1.4)
    z = np.empty(x.size)
    z[0] = 0.0
    for first, last, way in runs(x):
        d = np.abs(x[first + 1 : last + 1] - x[first]) / scale
        left = 1 - way * z[first]
        if power == 1:
            left = left * np.exp(-d)
        else:
            left = np.maximum(left ** (1 - power) + (power - 1) * d, 0) ** (1 / (1 - power))
        z[first + 1 : last + 1] = way * (1 - left)
    return x - p.get("h", 0.2) * z


def lugre(x, t, s, p, g=0.0, v0=1.0, power=1.0):
    """Bristles: dz/dt = v - |v| z / g(v), force z + damp dz/dt, g(v) = 1 + g q / (1 + q), q = (|v| / v0)^power; exact within a step."""
    scale, damp, dt = p.get("scale", 0.35), p.get("damp", 2e-5), t[1] - t[0]
    v = np.diff(x, prepend=x[0]) / dt
    q = (np.abs(v) / v0) ** power
    strength = 1 + g * q / (1 + q)
    end = strength * np.sign(v)
    decay = np.exp(-np.abs(v) * dt / scale / strength)
    z = np.empty(x.size)
    here = 0.0
    for i, (e, d) in enumerate(zip(end.tolist(), decay.tolist())):
        here = e + (here - e) * d if d < 1 else here
        z[i] = here
    return x - p.get("h", 0.2) * (z + damp * np.diff(z, prepend=z[0]) / dt)


def coleman_hodgdon(x, t, s, p):
    """Coleman and Hodgdon: dy = alpha |dx| (f(x) - y) + a dx, f = b x + c tanh(x / w), by its integrating factor."""
    alpha, b, c, w, a = p.get("alpha", 3.0), p.get("b", 0.8), p.get("c", 0.15), p.get("w", 1.2), p.get("a", 0.6)
    y = np.empty(x.size)
    y[0] = a * x[0]
    for first, last, way in runs(x):
        reach = np.abs(x[last] - x[first])
        d = np.linspace(0, reach, 1500)
        u = x[first] + way * d
        g = np.exp(alpha * d) * (alpha * (b * u + c * np.tanh(u / w)) + way * a)
        total = np.concatenate([[0.0], np.cumsum((g[1:] + g[:-1]) / 2 * (d[1] - d[0]))])
        y[first + 1 : last + 1] = np.interp(np.abs(x[first + 1 : last + 1] - x[first]), d, np.exp(-alpha * d) * (y[first] + total))
    return y


def jiles_atherton(x, t, s, p):
    """Jiles and Atherton: dM/dH by Heun's rule between turning points."""
    field, a, k, alpha, c = p.get("field", 1.3), p.get("a", 1.0), p.get("k", 0.5), p.get("alpha", 0.3), p.get("c", 0.2)

    def slope(u, m, way):
        q = (u + alpha * m) / a
        if abs(q) < 1e-3:
            still, rise = q / 3, 1 / 3 / a
        else:
            coth = 1 / math.tanh(q)
            still, rise = coth - 1 / q, (1 - coth * coth + 1 / (q * q)) / a
        full = (1 - c) * max(0.0, way * (still - (m - c * still) / (1 - c))) / k + c * rise
        return full / (1 - alpha * full)

    m = np.empty(x.size)
    m[0] = 0.0
    for first, last, way in runs(x):
        n = int(abs(x[last] - x[first]) * field / 0.004) + 2
        u = np.linspace(x[first], x[last], n) * field
        h = float(u[1] - u[0])
        way = float(way)
        out = [float(m[first])]
        for v in u[:-1].tolist():
            one = slope(v, out[-1], way)
            out.append(out[-1] + h / 2 * (one + slope(v + h, out[-1] + h * one, way)))
        m[first + 1 : last + 1] = np.interp(way * x[first + 1 : last + 1] * field, way * u, out)
    h = p.get("h", 0.6)
    return (1 - h) * x + h * m * 2.4 / field


LAWS = {
    "pi-density": pi_density, "maxwell-slip": maxwell_slip, "rayleigh": rayleigh, "pi-curve": pi_curve, "pi-hyperbola": pi_hyperbola,
    "takacs": takacs, "preisach-gauss": preisach, "preisach-lognormal": preisach, "preisach-lorentz": preisach, "domain-switching": preisach,
    "krasnoselskii": ridges, "smooth-relays": ridges, "bouc-wen": bouc_wen, "dahl": dahl, "lugre": lugre, "coleman-hodgdon": coleman_hodgdon,
    "jiles-atherton": jiles_atherton,
}  # fmt: skip
PRESET = {
    "preisach-lognormal": dict(density="lognormal"), "preisach-lorentz": dict(density="lorentz"), "smooth-relays": dict(smooth=True),
    "domain-switching": dict(coupling=0.18, density="lognormal"),
}  # fmt: skip

# ------------------------------------------------------------------------------------------------------------ drives
# A drive is a list of moves (target, seconds, shape) or a function of time, with values from -1 to 1 over the voltage range.


def moves(steps, start, tau):
    """Evaluates moves; shape l: linear, c: half a cosine (sine between two extremes), h: hold."""
    ends, seconds, shapes = zip(*steps)
    knots = np.concatenate([[0.0], np.cumsum(seconds)])
    values = np.concatenate([[start], ends])
    i = np.clip(np.searchsorted(knots, tau, side="right") - 1, 0, len(steps) - 1)
    share = np.clip((tau - knots[i]) / np.maximum(knots[i + 1] - knots[i], 1e-12), 0, 1)
    cosine = np.array([shape == "c" for shape in shapes])[i]
    share = np.where(cosine, (1 - np.cos(np.pi * share)) / 2, share)
    return values[i] + (values[i + 1] - values[i]) * share


def drive(spec, tau, rng, fs):
    """Returns the drive from 0 to the last time of tau. Generator and logger have one clock: moves last whole sample periods."""
    kind, p = spec[0], dict(spec[1]) if len(spec) > 1 else {}
    total, steps, used = tau[-1], [], 0.0
    shape = p.get("shape", "l")
    top, low = p.get("top", 1.0), p.get("low", -1.0)
    start = p.get("start", low)
    if kind == "cycle":  # cycles of one rate and span
        half = 0.5 / p["f"]
        for k in range(int(total / half) + 2):
            steps.append((top if k % 2 == 0 else low, half, shape))
    elif kind == "rates":  # blocks of several rates and spans
        k = 0
        while used < total:
            f, low, top, cycles = p["blocks"][k % len(p["blocks"])]
            for c in range(int(2 * cycles)):
                steps.append((top if c % 2 == 0 else low, 0.5 / f, shape))
            used += cycles / f
            k += 1
    elif kind == "turns":  # random reversals, at one or several rates
        here, k = start, 0
        while used < total:
            there = rng.uniform(0.1, 1) * (1 if k % 2 == 0 else -1)
            speed = p["speed"] * rng.choice(p.get("factors", [1.0]))
            seconds = abs(there - here) / speed
            steps.append((there, seconds, shape))
            used += seconds
            here, k = there, k + 1
    elif kind == "stairs":  # up and down in steps with holds
        levels = np.linspace(low, top, p["steps"])
        order = np.concatenate([levels[1:], levels[-2::-1]])
        if p.get("shuffle"):
            order = rng.uniform(low, top, 200)
        while used < total:
            for level in order:
                steps += [(level, p["edge"], shape), (level, p["hold"], "h")]
                used += p["edge"] + p["hold"]
    elif kind == "forc":  # first-order reversal curves
        start = top
        for level in np.linspace(top - 0.2, low, p["curves"]):
            seconds = (top - level) / p["speed"]
            steps += [(level, seconds, shape), (top, seconds, shape)]
            used += 2 * seconds
        steps = steps * (int(total / used) + 1)
    elif kind == "decay":  # sweep with decreasing (or increasing) span about a centre
        centre, half, n = p.get("centre", 0.0), 0.5 / p["f"], p["n"]
        k = 0
        while used < total + half:
            share = 1 - (k % n) / n if not p.get("grow") else ((k % n) + 1) / n
            steps.append((centre + (1 if k % 2 == 0 else -1) * share * (1 - abs(centre)), half, shape))
            used += half
            k += 1
        start = p.get("start", centre)
    elif kind == "raster":  # images: fast lines of one size and position, then the next image
        k = 0
        while used < total:
            low, top, f = p["frames"][k % len(p["frames"])]
            for c in range(p["lines"]):
                steps += [(top, 0.5 / f, "l"), (low, 0.5 / f, "l")]
            used += p["lines"] / f
            k += 1
    if steps:
        return moves([(v, max(1, round(seconds * fs)) / fs, shape) for v, seconds, shape in steps], start, tau)
    if kind == "chirp":
        if p.get("linear"):
            phase = 2 * np.pi * (p["f0"] * tau + (p["f1"] - p["f0"]) * tau**2 / 2 / total)
        else:
            rate = np.log(p["f1"] / p["f0"]) / total
            phase = 2 * np.pi * p["f0"] * np.expm1(rate * tau) / rate
        return p.get("centre", 0.0) + p.get("amp", 1.0) * np.sin(phase + p.get("phase", -np.pi / 2))
    if kind == "multisine":
        x = sum(np.cos(2 * np.pi * f * tau + rng.uniform(0, 2 * np.pi)) / f ** p.get("tilt", 0.5) for f in p["f"])
    else:  # walk
        width = max(1, int(round(1 / (tau[1] - tau[0]) / p["f"] / 12)))
        coarse = rng.standard_normal(tau.size // width + 3)
        x = np.interp(np.arange(tau.size) / width, np.arange(coarse.size), coarse)
        x = sosfiltfilt(butter(2, [p["f"] / p.get("span", 40), p["f"]], "band", fs=1 / (tau[1] - tau[0]), output="sos"), x)
    x = x - (x.max() + x.min()) / 2
    return x / np.abs(x).max() * p.get("amp", 1.0) + p.get("centre", 0.0)


def history(kind, first, seconds, rest, tau, rng):
    """Returns the drive history before the record; it ends at the start of the drive."""
    if kind == "rest":
        targets = [first]
    elif kind == "cycled":
        targets = [1.0, -1.0, 1.0, -1.0, first]
    elif kind == "partial":
        targets = [*(rng.uniform(0.2, 0.9, 5) * np.array([1, -1, 1, -1, 1])), first]
    else:
        targets = [*(0.85**k * (-1) ** k for k in range(18)), first]
    return moves([*((v, seconds / (len(targets) + 1), "c") for v in targets), (first, seconds, "h")], rest, tau)


def ambient(spec, tau, rng):
    """Returns an independent slow temperature or force: kind wave, steps or walk, about level."""
    total = tau[-1] - tau[0]
    kind = spec.get("kind", "wave")
    z = (tau - tau[0]) / total
    if kind == "wave":
        y = np.sin(2 * np.pi * (spec.get("cycles", 1.4) * z + rng.random())) + 0.35 * np.sin(2 * np.pi * (2.6 * z + rng.random()))
    elif kind == "steps":
        n = spec.get("steps", 12)
        knots = np.cumsum(rng.uniform(0.6, 1.4, n))
        levels = rng.uniform(-1, 1, n + 1)
        y = moves([s for a, b in zip(np.diff(knots, prepend=0) / knots[-1], levels) for s in ((b, a * 0.1, "c"), (b, a * 0.9, "h"))], 0.0, z)
    else:
        coarse = rng.standard_normal(spec.get("n", 30) + 4)
        fine = np.interp(z * spec.get("n", 30), np.arange(coarse.size), coarse)
        y = lfilter(*butter(2, 2 * spec.get("n", 30) / 2 / tau.size), fine - fine[0])
    return spec["level"] + spec["amp"] * y / np.abs(y).max()


# ------------------------------------------------------------------------------------------------------------ effects


def linear(num, den, y, dt):
    """A continuous filter with an input that is linear between fine steps, settled at the start."""
    b, a, _ = cont2discrete((num, den), dt, method="foh")
    return y[0] * num[-1] / den[-1] + lfilter(np.ravel(b), a, y - y[0])


def creep(p, y, dt):
    """Returns y plus the superposition of the step responses of its increments."""
    t = np.arange(y.size) * dt
    kind = p["kind"]
    if kind == "log":
        j = p["g"] * np.log10(1 + t / p["t0"])
    elif kind == "power":
        j = p["g"] * (t / p["t0"]) ** p["power"]
    elif kind == "relax":
        j = sum(g * -np.expm1(-t / tau) for g, tau in p["terms"])
    else:
        j = p["g"] * -np.expm1(-((t / p["tau"]) ** p["beta"]))
    n = next_fast_len(2 * y.size)
    return y + irfft(rfft(np.diff(y, prepend=y[0]), n) * rfft(j, n), n)[: y.size]


def soft_stop(y, edge, knee, slope):
    """Identity below the edge, `slope` above it, with a knee between."""
    if knee <= 0:
        return np.where(y > edge, edge + slope * (y - edge), y)
    return y - (1 - slope) * knee * np.logaddexp(0, (y - edge) / knee)


def stops(p, y):
    if "high" in p:
        y = soft_stop(y, p["high"], p.get("knee", 0), p.get("slope", 0.0))
    if "low" in p:
        y = -soft_stop(-y, -p["low"], p.get("knee", 0), p.get("slope", 0.0))
    return y


def curve(p, y):
    if p.get("kind") == "exp":
        return 2 * np.expm1(p["a"] * (y + 1) / 2) / np.expm1(p["a"]) - 1
    return y + p.get("a", 0.0) * (y * y - 1) + p.get("b", 0.0) * (y**3 - y)


def width(p, v):
    q = np.abs(v) / p["v0"]
    if p["kind"] == "power":
        return 1 + p["g"] * q ** p["power"]
    if p["kind"] == "log":
        return 1 + p["g"] * np.log1p(q)
    return 1 + p["g"] * q / (1 + q)


class Record:
    """Time, drive, temperature and load of one record, the same for every set of effects."""

    def __init__(self, case, which):
        rng = self.rng = np.random.default_rng([case["seed"], which])
        spec = case["drives"][which]
        n = case["rows"][which]
        fine = case.get("fine", 3)
        step = 1 / case["fs"] / fine
        gaps = case.get("gaps", [])
        cut = int(case.get("cut", 0.0) * n)
        span = cut + n / (1 - sum(b - a for a, b in gaps))
        tau = np.arange(int(span * fine) + 1) * step
        main = drive(spec, tau, rng, case["fs"])
        before = int(case.get("before", 0.15) * n) * fine
        past = np.arange(before) * step
        rest = case.get("rest", 0.0 if case["volts"][0] < -30 else -1.0)
        old = history(case.get("history", "cycled"), main[0], past[-1] / 2, rest, past, rng)
        self.x = np.clip(np.concatenate([old, main]), -1, 1)
        self.t = np.concatenate([past - past[-1] - step, tau])
        self.dt = step
        z = (tau / tau[-1]) * 1.0
        keep = np.ones(tau.size, bool)
        for a, b in gaps:
            keep &= (z < a) | (z >= b)
        rows = np.arange(cut * fine, tau.size, fine)
        rows = rows[keep[rows]][:n]
        self.rows = before + rows
        self.temperature = ambient(case["temp"], self.t, rng) if "temp" in case else None
        self.force = ambient(case["load"], self.t, rng) if "load" in case else None
        self.spin = rng.random(8)


def actuator(case, rec, effects, norm=None):
    """Returns the displacement without noise in the rows of the record. norm: (low, span) of the law, from the record without effects."""
    e, t, dt = effects, rec.t, rec.dt
    x = rec.x
    unknown = e.get("unknown", {})
    if "delay" in e:
        x = np.interp(t - e["delay"], t, x)
    if "lag" in e:
        for tau in e["lag"]:
            x = linear([1.0], [tau, 1.0], x, dt)
    if e.get("saturation", {}).get("at") == "rail":
        x = stops(e["saturation"], x)
    if e.get("asymmetry", {}).get("at") == "before":
        x = curve(e["asymmetry"], x)
    s = np.ones(x.size)
    extra = {}
    temp = None
    if "temperature" in e:
        temp = rec.temperature - case["temp"]["level"]
        if e["temperature"].get("lag"):
            temp = linear([1.0], [e["temperature"]["lag"], 1.0], temp, dt)
        s = s * (1 + e["temperature"].get("width", 0.0) * temp)
    if "rate-dependence" in e:
        if case["law"] == "lugre":
            extra = e["rate-dependence"]
        else:
            s = s * width(e["rate-dependence"], np.diff(x, prepend=x[0]) / dt)
    p = {"seed": case["seed"], **PRESET.get(case["law"], {}), **case.get("p", {})}
    y = LAWS[case["law"]](x, t, s, p, **extra)
    if norm is None:
        seen = y[rec.rows]
        norm = (seen.min(), np.ptp(seen))
    y = 2 * (y - norm[0]) / norm[1] - 1
    if e.get("asymmetry", {}).get("at") == "behind":
        y = curve(e["asymmetry"], y)
    stroke = case["stroke"] / 2
    if "load" in e:
        f = rec.force
        y = y * (1 + e["load"].get("gain", 0.0) * f) + e["load"].get("zero", 0.0) * f / stroke
    if "creep" in e:
        y = creep(e["creep"], y, dt)
    if "resonance" in e:
        modes = e["resonance"]
        whole = y * (1 - sum(m.get("share", 1.0) for m in modes))
        for m in modes:
            w = 2 * np.pi * m["f"]
            whole = whole + m.get("share", 1.0) * linear([w * w], [1.0, 2 * m["zeta"] * w, w * w], y, dt)
        y = whole
    if unknown.get("kind") == "jump":
        y = np.where(t > unknown["at"] * t[-1], y * (1 + unknown["g"]), y)
    if unknown.get("kind") == "fade":
        y = y * (1 + unknown["g"] * -np.expm1(-np.maximum(t, 0) / (unknown["tau"] * t[-1])))
    if unknown.get("kind") == "clock":  # the clock of the converter is slow and is corrected from time to time
        phase = (t / t[-1] * unknown["n"]) % 1.0
        y = np.interp(t - unknown["seconds"] * phase, t, y)
    if unknown.get("kind") == "loose":  # the coupling is in one of two positions; some reversals switch it
        turns = np.flatnonzero(np.diff(np.sign(np.diff(rec.x))) != 0)
        rng = np.random.default_rng([case["seed"], 77, int(rec.spin[0] * 1e6)])
        seat = np.zeros(t.size)
        seat[turns[rng.random(turns.size) < unknown["p"]]] = 1
        y = y + unknown["g"] * ((np.cumsum(seat) % 2) - 0.5)
    if "temperature" in e:
        y = y * (1 + e["temperature"].get("gain", 0.0) * temp) + e["temperature"].get("zero", 0.0) * temp / stroke
    if e.get("saturation", {}).get("at") == "stop":
        y = stops(e["saturation"], y)
    y = (y * stroke * (-1 if case.get("negative") else 1) + case.get("zero", 1.7))[rec.rows]
    t = t[rec.rows]
    if "drift" in e:
        since = t - t[0]
        y = y + e["drift"].get("line", 0.0) * since + e["drift"].get("settle", 0.0) * np.exp(-since / e["drift"].get("tau", 1.0))
    if "interference" in e:
        for k, (f, a) in enumerate(e["interference"]):
            y = y + a * np.sin(2 * np.pi * (f * t + rec.spin[k]))
    if unknown.get("kind") == "knocks":
        for k in range(unknown["n"]):
            when = t[0] + (k + 0.2 + 0.6 * rec.spin[k % 8]) / unknown["n"] * (t[-1] - t[0])
            since = np.maximum(t - when, 0)
            size = unknown["g"] * (1.5 - rec.spin[(k + 3) % 8]) * (-1 if rec.spin[(5 * k + 1) % 8] > 0.5 else 1)
            y = y + np.where(t > when, size * np.exp(-since / unknown["tau"]), 0)
    if unknown.get("kind") == "fringe":
        for k in range(unknown["n"]):
            when = t[0] + (k + 0.2 + 0.6 * rec.spin[k % 8]) / unknown["n"] * (t[-1] - t[0])
            y = y + np.where(t > when, unknown["step"] * (-1 if k % 3 == 1 else 1), 0)
    return y, norm


# ------------------------------------------------------------------------------------------------------------ sensor and files


def noise(case, n, rng):
    kind, share = case.get("noise", ("white", 0.0006))
    white = rng.standard_normal(n)
    if kind == "white":
        mix = white
    else:
        f = np.fft.rfftfreq(n)
        f[0] = f[1]
        pink = np.fft.irfft(np.fft.rfft(rng.standard_normal(n)) / np.sqrt(f), n)
        pink = pink / pink.std()
        mix = pink if kind == "pink" else (white + pink) / np.sqrt(2)
    mix = mix * share * case["stroke"]
    for i in rng.integers(0, n, case.get("spikes", 0)):
        mix[i] += rng.choice([-1, 1]) * rng.uniform(8, 25) * share * case["stroke"]
    return mix


def write(path, case, rec, y, seed):
    rng = np.random.default_rng([case["seed"], seed])
    n = y.size
    t = rec.t[rec.rows]
    if not case.get("clock_runs"):
        t = t - t[0]
    low, high = case["volts"]
    lsb = (high - low) * 1.05 / 2 ** case.get("bits", 16)
    volts = (low + high) / 2 + rec.x[rec.rows] * (high - low) / 2
    volts = np.round(volts / lsb) * lsb
    step = case["stroke"] * 1.3 / 2 ** case.get("bits", 16)
    y = np.round((y + noise(case, n, rng)) / step) * step
    columns = [("time_s", t, "%.7f"), ("voltage_v", volts, "%.5f"), ("displacement_um", y, "%.6f")]
    if rec.temperature is not None:
        columns.append(("temperature_degc", rec.temperature[rec.rows] + 0.01 * rng.standard_normal(n), "%.3f"))
    if rec.force is not None:
        columns.append(("load_n", rec.force[rec.rows] + 0.001 * case["load"]["amp"] * rng.standard_normal(n), "%.4f"))
    table = np.column_stack([c[1] for c in columns])
    assert np.isfinite(table).all() and (np.diff(t) > 0).all() and 400 <= n <= 60000, path
    line = ",".join(c[2] for c in columns) + "\n"
    with open(path, "w") as file:
        file.write(",".join(c[0] for c in columns) + "\n")
        file.write((line * n) % tuple(table.ravel().tolist()))


def visible(case, rec, effects, y, clean, norm):
    """Returns for each effect: its RMS divided by the noise, divided by the RMS of the hysteresis, and, after a fit of play operators,
    divided by the noise."""
    x = rec.x[rec.rows]
    base = np.column_stack([x, np.ones(x.size)])
    loop = (clean - base @ np.linalg.lstsq(base, clean, rcond=None)[0]).std()
    r = np.linspace(0, 1, 25)[:24] ** 1.5
    play = np.column_stack([plays(x, np.ones(x.size), np.array([v]), np.ones(1)) for v in r] + [np.ones(x.size)])
    sigma = case.get("noise", ("white", 0.0006))[1] * case["stroke"]
    every = max(1, x.size // 5000)
    found = {}
    for name in effects:
        without = actuator(case, rec, {k: v for k, v in effects.items() if k != name}, norm)[0] if len(effects) > 1 else clean
        delta = y - without
        rms = np.sqrt(np.mean(delta**2))
        d, b = delta[::every], play[::every]
        left = (d - b @ np.linalg.lstsq(b, d, rcond=None)[0]).std()
        found[name] = [round(rms / sigma, 1), round(rms / loop, 3), round(left / sigma, 1)]
    return found, loop / sigma


# ------------------------------------------------------------------------------------------------------------ cases
CASES = []


def add(name, law, model, fs, rows, train, test, **rest):
    CASES.append(dict(name=name, law=law, model=model, fs=fs, rows=rows, drives=(train, test), stroke=rest.pop("stroke", 12.0),
                      volts=rest.pop("volts", (0, 150)), **rest))  # fmt: skip


def rates(*blocks, shape="l"):
    return "rates", dict(blocks=blocks, shape=shape, start=blocks[0][1])


def cycle(f, **p):
    return "cycle", dict(f=f, **p)


def turns(speed, **p):
    return "turns", dict(speed=speed, **p)


def stairs(steps, edge, hold, **p):
    return "stairs", dict(steps=steps, edge=edge, hold=hold, **p)


def chirp(f0, f1, **p):
    return "chirp", dict(f0=f0, f1=f1, **p)


def decay(f, n, **p):
    return "decay", dict(f=f, n=n, **p)


def forc(curves, speed):
    return "forc", dict(curves=curves, speed=speed)


def walk(f, **p):
    return "walk", dict(f=f, **p)


def sines(*f, **p):
    return "multisine", dict(f=f, **p)


def raster(lines, *frames):
    return "raster", dict(lines=lines, frames=frames, start=frames[0][0])


BIP, TEN, LOW = (-200, 200), (0, 10), (-20, 120)

# ---- without an effect (16); some record a temperature or a force without influence
add("sine", "pi-density", "pi", 1000, (4000, 3000), cycle(2, shape="c"), decay(2, 12, shape="c"))
add("afm", "maxwell-slip", "pi", 20000, (8000, 6000), cycle(20), turns(80, start=-0.5), volts=LOW, stroke=30, history="rest", cut=0.03, bits=14)
add("sweeps-gaps", "pi-curve", "pi", 500, (6000, 4000), rates((1, -1, 1, 2), (4, -0.9, 0.6, 4), (8, -1, 1, 8)), turns(5),
    volts=TEN, stroke=100, gaps=[(0.3, 0.36), (0.7, 0.78)], noise=("mixed", 0.0006))  # fmt: skip
add("decaying", "rayleigh", "pi", 200, (5000, 4000), decay(0.8, 30), walk(1.0), volts=BIP, stroke=6, negative=True, noise=("pink", 0.0005))
add("forc", "preisach-gauss", "preisach", 200, (12000, 6000), forc(16, 1.2), turns(1.0, start=1.0), noise=("white", 0.0008), bits=14)
add("walk", "preisach-lognormal", "preisach", 100, (9000, 5000), walk(0.5), decay(0.3, 24), volts=LOW, stroke=45, history="partial", spikes=4)
add("stairs", "preisach-lorentz", "preisach", 250, (8000, 4000), stairs(15, 0.08, 0.25), stairs(15, 0.08, 0.25, shuffle=True), volts=BIP, stroke=9)
add("rates", "bouc-wen", "bouc-wen", 2000, (10000, 6000), rates((2, -1, 1, 2), (10, -0.5, 1, 8), (5, -1, 0.2, 4), (20, -0.4, 0.4, 10), shape="c"),
    walk(8), p=dict(n=1.3), noise=("mixed", 0.0007), history="partial")  # fmt: skip
add("triangles", "dahl", "bouc-wen", 400, (4000, 3000), decay(1.0, 14), turns(4), p=dict(power=1.25), volts=TEN, stroke=2.5, bits=12, noise=("white", 0.0012))
add("chirp", "coleman-hodgdon", "bouc-wen", 1000, (9000, 5000), chirp(0.5, 20), turns(12), noise=("pink", 0.0015), p=dict(c=0.05))
add("growing", "jiles-atherton", "preisach", 500, (12000, 8000), decay(0.7, 28, grow=True, shape="c"), chirp(0.3, 6), volts=LOW, stroke=20, noise=("white", 0.001))
add("frames", "takacs", "pi", 5000, (10000, 6000), raster(5, (-0.9, 0.9, 6), (-0.2, 0.6, 12), (-0.9, -0.1, 9)), turns(20), noise=("white", 0.0015),
    p=dict(a=0.5, b=0.6, c=0.4), stroke=80)  # fmt: skip
add("warm-nothing", "krasnoselskii", "preisach", 50, (7000, 5000), turns(0.7), walk(0.2), temp=dict(level=24, amp=2.5), history="decay", cut=0.04)
add("force-nothing", "pi-hyperbola", "pi", 100, (5000, 4000), stairs(11, 0.1, 0.5), turns(1.5), load=dict(level=4, amp=3, kind="steps"), bits=14, spikes=3)
add("long-fast", "lugre", "bouc-wen", 20000, (60000, 20000), decay(15, 40), decay(15, 24, centre=0.2), volts=TEN, stroke=5, noise=("white", 0.001), fine=2)
add("short", "domain-switching", "preisach", 50, (400, 400), walk(2.0, span=12), turns(4), noise=("white", 0.0015), history="partial", fine=10, p=dict(coupling=0.1))

# ---- one effect (34)
add("delay", "pi-density", "pi", 5000, (12000, 6000), chirp(1, 90), rates((20, -1, 1, 6), (60, -0.6, 0.5, 12), (5, -1, 0.5, 2), shape="c"),
    effects=dict(delay=0.0011), p=dict(density="lognormal"))  # fmt: skip
add("delay", "preisach-gauss", "preisach", 2000, (10000, 6000), rates((2, -1, 1, 2), (25, -0.6, 1, 12), (10, -1, 0.3, 6), (50, -0.5, 0.5, 20)), turns(60, factors=[0.2, 1, 2]),
    effects=dict(delay=0.002), volts=BIP, negative=True)  # fmt: skip
add("delay", "bouc-wen", "bouc-wen", 1000, (8000, 5000), sines(1.1, 2.7, 6.1, 13.7, 29), walk(25), effects=dict(delay=0.003), noise=("mixed", 0.0008), p=dict(n=1.0))
add("lag", "maxwell-slip", "pi", 4000, (12000, 6000), chirp(1, 70), sines(5, 17, 31, 63), effects=dict(lag=[0.0012]), stroke=18)
add("lag", "rayleigh", "pi", 1000, (8000, 5000), stairs(9, 0.004, 0.12), stairs(9, 0.004, 0.12, shuffle=True), effects=dict(lag=[0.012]), volts=TEN, bits=14)
add("lag-two", "preisach-lognormal", "preisach", 2000, (12000, 6000), rates((2, -1, 1, 2), (30, -1, 0.6, 12), (8, -0.6, 1, 6), (60, -0.6, 0.4, 20)), sines(4, 11, 26, 58),
    effects=dict(lag=[0.0022, 0.0012]))  # fmt: skip
add("rate-power", "pi-density", "pi", 1000, (12000, 8000), rates((0.5, -1, 1, 1), (12, -1, 1, 6), (3, -0.6, 0.8, 3), (30, -0.6, 0.6, 12), shape="c"), turns(40, factors=[0.05, 0.3, 1]),
    effects={"rate-dependence": dict(kind="power", g=0.35, v0=20.0, power=0.4)})  # fmt: skip
add("rate-log", "preisach-gauss", "preisach", 500, (9000, 6000), rates((0.3, -1, 1, 1), (6, -1, 0.7, 6), (1.5, -0.6, 1, 2), (15, -0.8, 0.6, 10)), turns(20, factors=[0.05, 0.3, 1]),
    effects={"rate-dependence": dict(kind="log", g=0.12, v0=0.5)}, fine=3, volts=LOW)  # fmt: skip
add("rate-bristles", "lugre", "bouc-wen", 1000, (10000, 6000), rates((0.5, -1, 1, 1), (10, -1, 1, 8), (2, -0.7, 0.9, 2), (25, -0.7, 0.5, 12)), walk(6),
    effects={"rate-dependence": dict(g=0.7, v0=15.0, power=1.0)}, fine=10, stroke=40)  # fmt: skip
add("rate-bounded", "pi-density", "pi", 2000, (12000, 8000), raster(6, (-1, 1, 4), (-0.4, 0.7, 30), (-1, 0.2, 1.5), (-0.8, 0.9, 12)), decay(6, 30),
    effects={"rate-dependence": dict(kind="bounded", g=0.6, v0=25.0)}, volts=TEN, noise=("pink", 0.0006))  # fmt: skip
add("creep-log", "pi-density", "pi", 50, (9000, 6000), stairs(7, 0.3, 6.0), stairs(7, 0.3, 6.0, shuffle=True), effects=dict(creep=dict(kind="log", g=0.018, t0=0.1)), history="rest")
add("creep-power", "rayleigh", "pi", 50, (8000, 5000), rates((0.05, -1, 1, 1), (0.5, -1, 0.2, 5), (0.1, -0.6, 1, 1), (1, 0, 0.8, 8)), stairs(6, 0.5, 5.0, shuffle=True),
    effects=dict(creep=dict(kind="power", g=0.03, t0=1.0, power=0.22)), volts=BIP)  # fmt: skip
add("creep-modes", "preisach-gauss", "preisach", 50, (10000, 6000), turns(1.2, factors=[0.1, 1, 3]), stairs(8, 0.4, 6.0, shuffle=True),
    effects=dict(creep=dict(kind="relax", terms=[(0.012, 0.7), (0.014, 6.0), (0.02, 45.0)])), noise=("mixed", 0.0006), negative=True)  # fmt: skip
add("creep-stretched", "dahl", "bouc-wen", 100, (9000, 6000), stairs(9, 0.2, 3.0), walk(0.3), effects=dict(creep=dict(kind="stretched", g=0.075, tau=4.0, beta=0.5)), stroke=25, p=dict(power=1.1))
add("drift-line", "maxwell-slip", "pi", 500, (8000, 5000), rates((2, -1, 1, 4), (4, -0.6, 0.6, 6)), turns(8), effects=dict(drift=dict(line=0.02)), volts=LOW)
add("drift-settling", "preisach-lorentz", "preisach", 200, (9000, 6000), decay(0.8, 20), walk(0.8), effects=dict(drift=dict(settle=0.3, tau=9.0)), history="cycled")
add("drift-both", "bouc-wen", "bouc-wen", 1000, (9000, 6000), cycle(3, shape="c"), decay(4, 18), effects=dict(drift=dict(line=-0.025, settle=-0.3, tau=2.0)), p=dict(n=1.7), volts=TEN)
add("temperature", "pi-density", "pi", 50, (9000, 6000), turns(1.5), decay(0.4, 22), temp=dict(level=22, amp=4, cycles=1.6),
    effects=dict(temperature=dict(gain=0.004, zero=0.03)), p=dict(density="uniform"))  # fmt: skip
add("temperature-lag", "preisach-lognormal", "preisach", 50, (12000, 8000), walk(0.4, span=12), turns(1.0), temp=dict(level=30, amp=5, kind="steps", steps=9),
    effects=dict(temperature=dict(zero=0.15, lag=14.0)), stroke=30)  # fmt: skip
add("temperature-loop", "pi-density", "pi", 50, (10000, 6000), cycle(0.5), turns(1.8), temp=dict(level=25, amp=10, cycles=2.2),
    effects=dict(temperature=dict(width=0.022, gain=0.003)), volts=BIP, noise=("mixed", 0.0005))  # fmt: skip
add("load", "pi-hyperbola", "pi", 200, (8000, 5000), decay(0.9, 24), turns(3), load=dict(level=10, amp=10, kind="steps"), effects=dict(load=dict(zero=-0.02)))
add("load-stiff", "smooth-relays", "preisach", 200, (9000, 6000), turns(3), walk(0.8), load=dict(level=20, amp=15, kind="walk"),
    effects=dict(load=dict(zero=-0.01, gain=-0.0015)), bits=14)  # fmt: skip
add("load-gain", "dahl", "bouc-wen", 500, (8000, 5000), rates((2, -1, 1, 3), (5, -0.5, 1, 5)), decay(3, 20), load=dict(level=6, amp=5, kind="wave", cycles=3.3),
    effects=dict(load=dict(gain=0.007)), volts=TEN, p=dict(power=1.2))  # fmt: skip
add("resonance", "pi-curve", "pi", 10000, (12000, 8000), cycle(12, top=0.8), turns(50), effects=dict(resonance=[dict(f=330, zeta=0.012)]), volts=LOW)
add("resonance-two", "pi-density", "pi", 10000, (15000, 10000), chirp(5, 360, amp=0.3, centre=-0.4), sines(13, 37, 110, 260, amp=0.3, centre=-0.4),
    effects=dict(resonance=[dict(f=290, zeta=0.03, share=0.2), dict(f=520, zeta=0.02, share=0.1)]), noise=("mixed", 0.0008))  # fmt: skip
add("resonance-steps", "preisach-lorentz", "preisach", 2000, (10000, 6000), stairs(9, 0.003, 0.15), stairs(9, 0.003, 0.15, shuffle=True),
    effects=dict(resonance=[dict(f=95, zeta=0.05)]), stroke=60)  # fmt: skip
add("stop-hard", "pi-density", "pi", 500, (7000, 5000), decay(2, 24), turns(8), effects=dict(saturation=dict(at="stop", high=0.78)))
add("rail-both", "maxwell-slip", "pi", 1000, (8000, 5000), rates((3, -1, 1, 4), (6, -0.5, 1, 4), (6, -1, 0.5, 4), shape="c"), walk(6), volts=TEN,
    effects=dict(saturation=dict(at="rail", high=0.85, low=-0.9)))  # fmt: skip
add("stop-soft", "bouc-wen", "bouc-wen", 500, (8000, 5000), decay(1.5, 22, shape="c"), turns(6), effects=dict(saturation=dict(at="stop", low=-0.7, knee=0.03, slope=0.25)),
    p=dict(n=1.5), negative=True)  # fmt: skip
add("curve-before", "pi-curve", "pi", 1000, (8000, 5000), decay(3, 26), walk(5), effects=dict(asymmetry=dict(at="before", a=0.08)), history="partial")
add("curve-behind", "rayleigh", "pi", 500, (8000, 5000), rates((1, -1, 1, 2), (2, -0.2, 1, 3), (2, -1, 0.1, 3)), turns(6),
    effects=dict(asymmetry=dict(at="behind", a=-0.06, b=0.05)), volts=BIP, stroke=15)  # fmt: skip
add("curve-exp", "bouc-wen", "bouc-wen", 500, (8000, 5000), decay(1.2, 20, shape="c"), turns(6), effects=dict(asymmetry=dict(at="before", kind="exp", a=0.45)), p=dict(n=1.2))
add("mains", "takacs", "pi", 1000, (8000, 5000), decay(1.7, 24), turns(6), effects=dict(interference=[(49.98, 0.23), (149.94, 0.06)]), noise=("white", 0.0015),
    p=dict(a=0.5, b=0.6, c=0.4))  # fmt: skip
add("mains-alias", "krasnoselskii", "preisach", 80, (6000, 4000), turns(1.6), walk(0.5), effects=dict(interference=[(50.02, 0.16)]), volts=LOW, stroke=20)

# ---- two effects (16)
add("creep-temp", "pi-density", "pi", 50, (12000, 8000), stairs(7, 0.3, 5.0), stairs(7, 0.3, 5.0, shuffle=True), temp=dict(level=23, amp=4, kind="steps", steps=11),
    effects=dict(creep=dict(kind="log", g=0.016, t0=0.1), temperature=dict(zero=0.05)))  # fmt: skip
add("lag-creep", "pi-curve", "pi", 500, (15000, 8000), stairs(6, 0.01, 1.2), stairs(6, 0.01, 1.2, shuffle=True),
    effects=dict(lag=[0.025], creep=dict(kind="log", g=0.02, t0=0.05)), volts=TEN)  # fmt: skip
add("drift-mains", "rayleigh", "pi", 1000, (9000, 6000), rates((2, -1, 1, 3), (5, -0.6, 0.7, 6)), decay(3, 22), effects=dict(drift=dict(line=0.04), interference=[(50.01, 0.1)]))
add("delay-curve", "pi-density", "pi", 2000, (12000, 8000), chirp(0.7, 40), rates((10, -1, 1, 6), (30, -0.6, 0.6, 12), (3, -1, 0.4, 2), shape="c"),
    effects=dict(delay=0.0022, asymmetry=dict(at="behind", a=0.07)))  # fmt: skip
add("ring-creep", "maxwell-slip", "pi", 1000, (15000, 9000), stairs(6, 0.004, 0.9), stairs(6, 0.004, 0.9, shuffle=True),
    effects=dict(resonance=[dict(f=70, zeta=0.04)], creep=dict(kind="relax", terms=[(0.018, 0.12), (0.03, 0.9)])), volts=LOW)  # fmt: skip
add("load-creep", "krasnoselskii", "preisach", 50, (12000, 8000), stairs(7, 0.3, 4.0), turns(1.0, factors=[0.1, 1, 3]), load=dict(level=15, amp=12, kind="steps", steps=14),
    effects=dict(load=dict(zero=-0.02), creep=dict(kind="log", g=0.018, t0=0.1)))  # fmt: skip
add("rate-drift", "pi-density", "pi", 500, (10000, 7000), rates((0.4, -1, 1, 1), (8, -1, 0.8, 6), (2, -0.7, 1, 3), (20, -0.6, 0.6, 12)), turns(25, factors=[0.05, 0.3, 1]),
    effects={"rate-dependence": dict(kind="log", g=0.15, v0=0.6), "drift": dict(line=0.02)})  # fmt: skip
add("stop-lag", "pi-density", "pi", 2000, (12000, 7000), chirp(1, 50), walk(30), effects=dict(saturation=dict(at="stop", high=0.75), lag=[0.002]))
add("temp-load", "domain-switching", "preisach", 50, (12000, 8000), turns(1.2), decay(0.3, 30), temp=dict(level=21, amp=3, cycles=1.7),
    load=dict(level=8, amp=7, kind="steps", steps=17), effects=dict(temperature=dict(gain=0.003, zero=0.05), load=dict(zero=-0.03)))  # fmt: skip
add("ring-mains", "jiles-atherton", "preisach", 4000, (12000, 8000), stairs(8, 0.002, 0.1), stairs(8, 0.002, 0.1, shuffle=True),
    effects=dict(resonance=[dict(f=210, zeta=0.03)], interference=[(50.0, 0.14)]), volts=BIP)  # fmt: skip
add("delay-drift", "bouc-wen", "bouc-wen", 1000, (9000, 6000), rates((2, -1, 1, 3), (12, -0.7, 1, 8), (25, -0.6, 0.5, 12), shape="c"), walk(15),
    effects=dict(delay=0.003, drift=dict(settle=0.35, tau=3.0)))  # fmt: skip
add("curve-stop", "pi-curve", "pi", 500, (9000, 6000), decay(1.6, 28), turns(6), effects=dict(asymmetry=dict(at="before", a=0.08), saturation=dict(at="stop", high=0.8)))
add("creep-mains", "dahl", "bouc-wen", 160, (12000, 8000), stairs(7, 0.2, 2.5), turns(1.5, factors=[0.1, 1, 3]),
    effects=dict(creep=dict(kind="power", g=0.03, t0=1.0, power=0.2), interference=[(49.97, 0.12)]), p=dict(power=1.2))  # fmt: skip
add("temp-delay", "pi-hyperbola", "pi", 100, (12000, 8000), rates((0.3, -1, 1, 2), (2, -0.7, 0.7, 8), (4, -0.5, 0.8, 8), shape="c"), walk(2.5), temp=dict(level=26, amp=4, cycles=2.1),
    effects=dict(temperature=dict(gain=0.004, zero=0.03), delay=0.022))  # fmt: skip
add("load-ring", "maxwell-slip", "pi", 5000, (15000, 9000), cycle(8, top=0.9), turns(35), load=dict(level=12, amp=10, kind="wave", cycles=3.7),
    effects=dict(load=dict(zero=-0.015), resonance=[dict(f=260, zeta=0.02)]), volts=TEN)  # fmt: skip
add("lag-temp", "rayleigh", "pi", 200, (15000, 9000), rates((0.3, -1, 1, 2), (3, -0.8, 0.8, 8), (8, -0.6, 0.6, 12)), sines(0.3, 0.9, 2.3, 5.1), temp=dict(level=20, amp=5, kind="walk", n=8),
    effects=dict(lag=[0.018], temperature=dict(zero=0.05)), volts=LOW)  # fmt: skip

# ---- unlisted effects (6)
add("gain-jump", "pi-density", "pi", 500, (8000, 5000), rates((1.5, -1, 1, 3), (3, -0.6, 0.8, 4)), turns(6), effects=dict(unknown=dict(kind="jump", at=0.55, g=-0.06)), volts=BIP)
add("gain-fade", "preisach-lorentz", "preisach", 200, (9000, 6000), turns(3), walk(0.8), effects=dict(unknown=dict(kind="fade", g=-0.12, tau=0.4)), volts=BIP)
add("knocks", "maxwell-slip", "pi", 1000, (9000, 6000), decay(2.3, 26), turns(9), effects=dict(unknown=dict(kind="knocks", n=9, g=0.9, tau=0.05)))
add("fringe-slips", "pi-curve", "pi", 1000, (9000, 6000), cycle(3, shape="c"), decay(3, 18), effects=dict(unknown=dict(kind="fringe", n=6, step=0.316)), stroke=20)
add("clock", "bouc-wen", "bouc-wen", 1000, (9000, 6000), rates((3, -1, 1, 4), (9, -0.6, 0.8, 8), shape="c"), walk(10), effects=dict(unknown=dict(kind="clock", n=5.3, seconds=0.004)))
add("loose", "rayleigh", "pi", 500, (9000, 6000), turns(7), decay(2, 24), effects=dict(unknown=dict(kind="loose", g=0.05, p=0.2)), volts=LOW)


def main():
    out = sys.argv[1]
    wanted = sys.argv[2:]
    for number, case in enumerate(CASES, 1):
        case["seed"] = 1000 + number
        name = f"y{number:02d}-{case['name']}"
        if wanted and not name.startswith(tuple(wanted)):
            continue
        folder = os.path.join(out, name)
        os.makedirs(folder, exist_ok=True)
        effects = case.get("effects", {})
        train, test = Record(case, 0), Record(case, 1)
        clean, norm = actuator(case, train, {})
        clean_test, _ = actuator(case, test, {}, norm)
        y, y_test = clean, clean_test
        check, loop = {}, None
        if effects:
            y, y_test = actuator(case, train, effects, norm)[0], actuator(case, test, effects, norm)[0]
            check, loop = visible(case, train, effects, y, clean, norm)
        for file, rec, values, seed in (("train", train, y, 1), ("test", test, y_test, 2), ("twin-train", train, clean, 3), ("twin-test", test, clean_test, 4)):
            write(os.path.join(folder, f"{file}.csv"), case, rec, values, seed)
        truth = dict(expect=sorted(effects), accept=case.get("accept", []), base=case["law"], model=case["model"], check=check)
        with open(os.path.join(folder, "truth.json"), "w") as file:
            json.dump(truth, file, indent=1)


if __name__ == "__main__":
    main()
