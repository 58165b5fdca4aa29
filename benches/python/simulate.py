"""Compares a million samples through PI-16 in Python with the same loop in Rust: at most 1.1 times as long.

Run ``pip install ./crates/hyst-py``, then ``python benches/python/simulate.py``.
"""

import subprocess
import sys
import time
from pathlib import Path

import hyst
import numpy as np

ROWS, RUNS, MAX_RATIO = 1_000_000, 60, 1.1
ROOT = Path(__file__).parents[2]
EXAMPLE = ["--quiet", "--release", "--package", "hyst-benches", "--example", "simulate_pi"]


def main():
    k = np.arange(ROWS)
    u = 60.0 * (1.0 - np.cos(0.01 * k)) * (0.5 + 0.5 * np.sin(0.0013 * k))
    pi = hyst.Pi(gain=0.1, thresholds=3.5 * np.arange(1, 17), weights=np.full(16, 0.01))
    rust, python = [], []
    subprocess.run(["cargo", "build", *EXAMPLE], cwd=ROOT, check=True)
    with subprocess.Popen(["cargo", "run", *EXAMPLE], cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        # In turn, so that both have the same load of the machine.
        for _ in range(RUNS):
            print(file=process.stdin, flush=True)
            rust.append(float(process.stdout.readline()))
            start = time.perf_counter()
            pi.simulate(u)
            python.append(time.perf_counter() - start)
        process.stdin.close()
    shortest, middle = min(python) / min(rust), np.median(python) / np.median(rust)
    print(
        f"PI-16, {ROWS} samples: Rust {1e3 * min(rust):.2f} ms, Python {1e3 * min(python):.2f} ms at best, "
        f"ratio {shortest:.3f} (at most {MAX_RATIO}); of the medians {middle:.3f}"
    )
    return shortest > MAX_RATIO


if __name__ == "__main__":
    sys.exit(main())
