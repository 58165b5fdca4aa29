"""Fits, diagnoses and scores the cases of a script in this folder: `python score.py HYSTCTL CASES [id-prefix ...]` (needs numpy).

ok     the names, or the declared indistinguishable alternatives, are the expected set or an accepted set (`unknown`: no
       name, and the verdict is unexplained)
WRONG  a name that is in no accepted set
0.98   probability of each name, in order
ratio  test error of the extended model divided by that of the same kind of model fitted to the twin without the effects
Errors are computed from the output of `simulate`, not read from the findings.
"""
import itertools
import json
import os
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor

import numpy as np


def run(*arguments):
    """Runs a command on one thread; two cases run in parallel."""
    environment = dict(os.environ, RAYON_NUM_THREADS="1")
    done = subprocess.run([str(a) for a in arguments], capture_output=True, text=True, timeout=900, env=environment)
    if done.returncode:
        raise RuntimeError(f"{arguments[1]}: exit code {done.returncode}: {done.stderr.strip()[-300:]}")


def rmse(hystctl, model, record, folder):
    """Returns the error of a model on a record without start-up rows; NaN if fewer than half of the rows remain."""
    out = f"{folder}/simulated.csv"
    run(hystctl, "simulate", "--model", model, record, "-o", out)
    table = np.genfromtxt(out, delimiter=",", names=True)
    predicted = next(name for name in table.dtype.names if name.startswith("predicted_"))
    counts = table["settling"] == 0
    if counts.mean() < 0.5:
        return float("nan")
    return float(np.sqrt(np.mean((table["displacement_um"] - table[predicted])[counts] ** 2)))


def score(hystctl, case):
    """Scores one case: names, whether they are right, and errors."""
    with open(f"{case}/truth.json") as file:
        truth = json.load(file)
    accepted = [sorted(names) for names in [truth["expect"], *truth.get("accept", [])]]
    with tempfile.TemporaryDirectory() as folder:
        base, extended, found, twin = (f"{folder}/{name}.json" for name in ("base", "extended", "found", "twin"))
        run(hystctl, "fit", f"{case}/train.csv", "--model", truth["model"], "-o", base, "--seed", 1)
        run(hystctl, "fit", f"{case}/twin-train.csv", "--model", truth["model"], "-o", twin, "--seed", 1)
        run(hystctl, "diagnose", f"{case}/train.csv", "--test", f"{case}/test.csv", "--model", base, "-o", extended, "--findings", found)
        with open(found) as file:
            findings = json.load(file)
        before, after = (rmse(hystctl, model, f"{case}/test.csv", folder) for model in (base, extended))
        clean = rmse(hystctl, twin, f"{case}/twin-test.csv", folder)
    ties = [
        [effect["name"], *(a["name"] for a in effect["alternatives"] if a.get("indistinguishable"))]
        for effect in findings["effects"]
    ]
    named = [names[0] for names in ties]
    if not named and findings["verdict"] == "unexplained":
        named, ties = ["unknown"], [["unknown"]]
    known = set(itertools.chain(*accepted))
    return dict(
        expected=truth["expect"],
        law=truth["base"],
        named=named,
        probabilities=[effect["probability"] for effect in findings["effects"]],
        ok=any(sorted(reading) in accepted for reading in itertools.product(*ties)),
        wrong=[names[0] for names in ties if names[0] != "unknown" and not known & set(names)],
        before=before,
        after=after,
        ratio=after / clean,
    )


def main():
    hystctl, folder, *prefixes = sys.argv[1:]
    cases = sorted(name for name in os.listdir(folder) if os.path.isdir(f"{folder}/{name}"))
    cases = [name for name in cases if not prefixes or name.startswith(tuple(prefixes))]

    def attempt(name):
        try:
            return score(hystctl, f"{folder}/{name}")
        except RuntimeError as error:
            return str(error)

    results = []
    with ThreadPoolExecutor(2) as pool:
        for name, result in zip(cases, pool.map(attempt, cases)):
            results.append(result)
            if isinstance(result, str):
                print(f"{name:26} not scored: {result}", flush=True)
                continue
            mark = "ok" if result["ok"] else "WRONG" if result["wrong"] else "missed"
            expected, named = (",".join(result[key]) or "-" for key in ("expected", "named"))
            probable = " ".join(f"{p:.2f}" for p in result["probabilities"])
            errors = f"{result['before']:.4f} -> {result['after']:.4f} um, ratio {result['ratio']:.2f}"
            print(f"{name:26} {mark:6} {result['law']:10} expected {expected:26} named {named:26} {probable:14} {errors}", flush=True)
    scored = [result for result in results if not isinstance(result, str)]
    ratios = [result["ratio"] for result in scored if np.isfinite(result["ratio"])]
    print(f"{sum(r['ok'] for r in scored)} of {len(results)} right, {sum(bool(r['wrong']) for r in scored)} with a wrong name, "
          f"{len(results) - len(scored)} not scored; ratio median {np.median(ratios):.2f}, 90th percentile {np.quantile(ratios, 0.9):.2f}")


if __name__ == "__main__":
    main()
