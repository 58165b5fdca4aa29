"""Play and stop banks: Prandtl-Ishlinskii, generalised and temperature-dependent (paper 5, eq. 9-25), Maxwell slip."""

import numpy as np


def generalised_plays(left, right, r):
    """Paper 5, eq. 24: ``F_k = max(left_k - r, min(right_k + r, F_{k-1}))`` from F = 0; shape (n, len(r))."""
    r = np.atleast_1d(np.asarray(r, dtype=float))
    outputs = np.empty((len(left), len(r)))
    f = np.zeros(len(r))
    for k, (a, b) in enumerate(zip(left, right)):
        f = np.maximum(a - r, np.minimum(b + r, f))
        outputs[k] = f
    return outputs


def plays(u, r):
    """Paper 5, eq. 9."""
    return generalised_plays(u, u, r)


def stops(u, r):
    """Elasto-slip elements ``s_k = clip(s_{k-1} + u_k - u_{k-1}, -r, r)``, s = 0 at u = 0; shape (n, len(r))."""
    r = np.atleast_1d(np.asarray(r, dtype=float))
    outputs = np.empty((len(u), len(r)))
    s, before = np.zeros(len(r)), 0.0
    for k, now in enumerate(u):
        s = np.clip(s + (now - before), -r, r)
        outputs[k], before = s, now
    return outputs


def prandtl_ishlinskii(u, gain, thresholds, weights):
    return gain * u + plays(u, thresholds) @ np.asarray(weights, dtype=float)


def generalised_prandtl_ishlinskii(u, gain, thresholds, weights, left, right):
    """``left`` and ``right`` map an input to its envelopes; the identity is the play operator of width 0."""
    r = np.concatenate([[0.0], thresholds])
    w = np.concatenate([[gain], weights])
    return generalised_plays(left(u), right(u), r) @ w


# Paper 5, section 5.2: n = 9, T in degrees Celsius, u in V, y in um.
TD_PI = dict(
    alpha=0.9975, epsilon=0.9770, tau=0.4167, eta=0.0091, a0=0.0599, a1=-0.1759, b0=0.0606, b1=0.2651, n=9, t0=23.0
)


def td_pi_weights(temperature, *, alpha, epsilon, tau, eta, n, t0):
    """Paper 5, eq. 22 and section 5.2: thresholds ``r_i = alpha i`` and weights, i = 0 ... n; weights (len(T), n + 1)."""
    r = alpha * np.arange(n + 1)
    gain = epsilon * np.exp(eta * (np.asarray(temperature, dtype=float) - t0))
    return r, np.multiply.outer(gain, np.exp(-tau * r))


def td_pi(u, temperature, *, alpha, epsilon, tau, eta, a0, a1, b0, b1, n, t0):
    """Paper 5, eq. 25. Here the term i = 0 is a generalised play too; eq. 25 as printed uses the input itself."""
    r, p = td_pi_weights(np.broadcast_to(temperature, np.shape(u)), alpha=alpha, epsilon=epsilon, tau=tau, eta=eta, n=n, t0=t0)
    return np.sum(p * generalised_plays(a0 * u + a1, b0 * u + b1, r), axis=1)


def td_pi_as_printed(u, temperature, *, alpha, epsilon, tau, eta, a0, a1, b0, b1, n, t0):
    """Paper 5, eq. 25 as printed: ``p_0 v`` without envelope."""
    r, p = td_pi_weights(np.broadcast_to(temperature, np.shape(u)), alpha=alpha, epsilon=epsilon, tau=tau, eta=eta, n=n, t0=t0)
    return p[:, 0] * u + np.sum(p[:, 1:] * generalised_plays(a0 * u + a1, b0 * u + b1, r[1:]), axis=1)


def maxwell_slip(u, yields, stiffnesses):
    """``sum k_i stop_i(u)``; element i slips at the deflection ``yields[i]``."""
    return stops(u, yields) @ np.asarray(stiffnesses, dtype=float)


def viscous_prandtl_ishlinskii(u, gain, thresholds, weights, drag, period):
    """``drag p' = dead(u - p, r)`` by the backward Euler rule: each sample solves
    ``p_k - p_{k-1} = (period / drag) dead(u_k - p_k, r)``."""
    r, p = np.asarray(thresholds, dtype=float), np.zeros(len(thresholds))
    y = np.empty(len(u))
    for k, now in enumerate(u):
        if k == 0:
            p = np.clip(p, now - r, now + r)
        else:
            # Above, below or inside the band: the right side is linear in each case.
            ratio = period / drag
            above = (p + ratio * (now - r)) / (1 + ratio)
            below = (p + ratio * (now + r)) / (1 + ratio)
            p = np.where(now - r > p, above, np.where(now + r < p, below, p))
        y[k] = gain * now + p @ np.asarray(weights, dtype=float)
    return y


def root_viscous_prandtl_ishlinskii(u, gain, thresholds, weights, seconds, volt_seconds, period):
    """``|u - p| - r = seconds v + sqrt(volt_seconds v)`` by the backward Euler rule. The position of each play operator
    at the end of a sample is found by bisection: its speed must agree with the overdrive beyond its threshold."""
    r, p = np.asarray(thresholds, dtype=float), np.zeros(len(thresholds))
    y = np.empty(len(u))
    for k, now in enumerate(u):
        # Position at which the play operator would come to rest.
        rest = np.clip(p, now - r, now + r)
        if k == 0:
            p = rest
        else:
            near, far = p.copy(), rest.copy()
            for _ in range(60):
                end = 0.5 * (near + far)
                speed = np.abs(end - p) / period
                late = seconds * speed + np.sqrt(volt_seconds * speed) < np.abs(rest - end)
                near, far = np.where(late, end, near), np.where(late, far, end)
            p = np.where(rest == p, p, 0.5 * (near + far))
        y[k] = gain * now + p @ np.asarray(weights, dtype=float)
    return y
