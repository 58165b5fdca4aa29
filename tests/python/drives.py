"""Drives for the tests: several frequencies, nested and minor loops, no repeated extrema."""

import numpy as np


def _mix(n, seed, wave):
    rng = np.random.default_rng(seed)
    frequencies = np.array([3.1, 7.7, 19.3, 31.9]) * rng.uniform(0.9, 1.1, 4)
    weights = np.array([1.0, 0.7, 0.35, 0.15]) * rng.uniform(0.8, 1.2, 4)
    k = np.arange(n)[:, None]
    return wave(2 * np.pi * frequencies * k / n) @ weights / weights.sum()


def both_ways(n, amplitude, seed=1):
    """Returns a drive that starts at 0, within ±amplitude."""
    return amplitude * _mix(n, seed, np.sin)


def one_way(n, low, high, seed=1):
    """Returns a drive that starts at ``low``, within ``low`` ... ``high``."""
    return low + (high - low) * (0.5 - 0.5 * _mix(n, seed, np.cos))


def on_lattice(u, low, step):
    return low + step * np.round((u - low) / step)
