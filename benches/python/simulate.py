"""A million samples through PI-16 from Python, against the same loop timed inside Rust: at most 1.2 times as long.

Run it with a Python that has the package: ``pip install ./crates/hyst-py``, then ``python benches/python/simulate.py``.
"""

import subprocess
import sys
import time
from pathlib import Path

import hyst
import numpy as np

ROWS, RUNS, MOST = 1_000_000, 15, 1.2
ROOT = Path(__file__).parents[2]
RUST = ["cargo", "run", "--quiet", "--release", "--package", "hyst-benches", "--example", "simulate_pi"]


def seconds_in_rust():
    return float(subprocess.run(RUST, cwd=ROOT, check=True, capture_output=True, text=True).stdout)


def seconds_in_python():
    k = np.arange(ROWS)
    u = 60.0 * (1.0 - np.cos(0.01 * k)) * (0.5 + 0.5 * np.sin(0.0013 * k))
    pi = hyst.Pi(gain=0.1, thresholds=3.5 * np.arange(1, 17), weights=np.full(16, 0.01))
    shortest = np.inf
    for _ in range(RUNS):
        start = time.perf_counter()
        pi.simulate(u)
        shortest = min(shortest, time.perf_counter() - start)
    return shortest


def main():
    seconds_in_rust()  # builds it
    # Turn by turn, so that both see the machine as it is.
    rust, python = min(seconds_in_rust() for _ in range(3)), min(seconds_in_python() for _ in range(3))
    rust = min(rust, seconds_in_rust())
    ratio = python / rust
    print(f"PI-16, {ROWS} samples: Rust {1e3 * rust:.2f} ms, Python {1e3 * python:.2f} ms, ratio {ratio:.3f} (at most {MOST})")
    return ratio > MOST


if __name__ == "__main__":
    sys.exit(main())
