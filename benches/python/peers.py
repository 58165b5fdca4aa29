"""Compares the searches of this project with other libraries: cost after the same number of evaluations, and time.

    python3 benches/python/peers.py [--only TASK]

It creates a virtual environment in `target/` with scipy, pygmo, pyswarms, mealpy and numba from PyPI, builds the Rust
part (`benches/examples/peers.rs`, with the crate metaheuristics-nature), and prints a table for each task. The record,
the search space, the minimised RMSE, the number of evaluations and the seeds are the same for all. The objectives in
Rust and numba must agree to 1e-9 before the measurement. Of the settings of each library (`search/tools.py`) the table
contains the one with the smallest median; `target/peers/results.json` contains all.

The exit code is 1 if the median of `hystctl` is above that of the best other library, or its time is above a fifth of
that of scipy.
"""

import argparse
import importlib.util
import json
import os
import platform
import statistics
import subprocess
import sys
import time
import venv
from pathlib import Path

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "target" / "peers"
PACKAGES = ["numpy", "numba", "scipy", "pygmo", "pyswarms", "mealpy"]
RUST = ["cargo", "run", "--quiet", "--release", "--package", "hyst-benches", "--example", "peers", "--"]
#: Relative difference of the cost of two searches that end at the same optimum.
COST_TOLERANCE = 1e-6
#: Minimum speed-up over scipy.
MIN_SPEED_UP = 5.0


def in_environment():
    """Continues in the virtual environment, and creates it if necessary."""
    if all(importlib.util.find_spec(package) for package in PACKAGES):
        return
    python = FOLDER / "venv" / "bin" / "python"
    if Path(sys.prefix) == python.parents[1]:
        sys.exit(f"one of {', '.join(PACKAGES)} is missing in {python.parents[1]}: delete this folder and start again")
    if not python.exists():
        venv.create(python.parents[1], with_pip=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", *PACKAGES], check=True)
    os.execv(python, [python, __file__, *sys.argv[1:]])


def run(tool, objective, seeds):
    """Runs one tool with all seeds and returns the results in the format of the Rust part."""
    from search.objectives import BudgetSpent

    name, setting, search = tool
    results = []
    for seed in seeds:
        objective.reset()
        wall, cpu = time.perf_counter(), time.process_time()
        try:
            search(objective, seed)
        except BudgetSpent:
            pass
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        results.append({"cost": objective.best, "evaluations": objective.count, "wall": wall, "cpu": cpu})
    return {"tool": name, "setting": setting, "results": results}


def median(run, what):
    return statistics.median(result[what] for result in run["results"])


def best_settings(runs):
    """Returns the setting with the smallest median cost of each tool, and all settings of this project."""
    best = {}
    for one in runs:
        key = one["setting"] if one["tool"].startswith("hystctl") else one["tool"]
        if key not in best or median(one, "cost") < median(best[key], "cost"):
            best[key] = one
    return list(best.values())


def table(task):
    floor = task["floor"]
    lines = [
        "| tool | setting | median | minimum | maximum | wall [s] | CPU [s] | evaluations |",
        "|---|---|---:|---:|---:|---:|---:|---:|",
    ]
    for one in best_settings(task["runs"]):
        costs = sorted(result["cost"] / floor for result in one["results"])
        # Empty if the system does not report CPU time.
        cpu = "" if one["results"][0]["cpu"] is None else f"{median(one, 'cpu'):.2f}"
        lines.append(
            f"| {one['tool']} | {one['setting']} | {statistics.median(costs):.6f} | {costs[0]:.6f} | {costs[-1]:.6f} "
            f"| {median(one, 'wall'):.2f} | {cpu} | {median(one, 'evaluations'):.0f} |"
        )
    return "\n".join(lines)


def verdict(task):
    """Returns whether the search of this project, on all cores, reaches its goals, and a summary."""
    ours = next(one for one in task["runs"] if one["tool"] == "hystctl")
    peers = [one for one in task["runs"] if not one["tool"].startswith("hystctl")]
    best = min(peers, key=lambda one: median(one, "cost"))
    scipy = min((one for one in peers if one["tool"] == "scipy"), key=lambda one: median(one, "wall"))
    ratio = median(scipy, "wall") / median(ours, "wall")
    is_best = median(ours, "cost") <= median(best, "cost") * (1 + COST_TOLERANCE)
    summary = (
        f"{task['name']}: median {median(ours, 'cost') / task['floor']:.6f} noise floors, best other library "
        f"{median(best, 'cost') / task['floor']:.6f} ({best['tool']}, {best['setting']}); "
        f"{ratio:.1f} times as fast as scipy's fastest setting"
    )
    return is_best and ratio >= MIN_SPEED_UP, summary


def machine():
    lines = Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else []
    model = next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), platform.processor())
    load = f", load {os.getloadavg()[0]:.1f} at the start" if hasattr(os, "getloadavg") else ""
    return f"{model}, {os.cpu_count()} cores{load}; Python {platform.python_version()}"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", help="run only one task: td-pi or bouc-wen")
    only = parser.parse_args().only
    in_environment()
    from search.objectives import Objective
    from search.tools import tools

    where = machine()
    report = subprocess.run([*RUST, FOLDER], cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True)
    tasks = [task for task in json.loads(report.stdout)["tasks"] if only in (None, task["name"])]
    if not tasks:
        parser.error(f"there is no task {only}")
    passed = True
    print(where)
    for task in tasks:
        objective = Objective(task)
        objective.check(task["probes"])
        for tool in tools():
            print(f"{task['name']}: {tool[0]}, {tool[1]}", file=sys.stderr)
            task["runs"].append(run(tool, objective, task["seeds"]))
        (FOLDER / "results.json").write_text(json.dumps({"machine": where, "tasks": tasks}, indent=1))
        reached, summary = verdict(task)
        passed &= reached
        print(f"\n{task['name']}, {len(task['names'])} parameters; cost in noise floors of {task['floor']:.4g} µm\n")
        print(table(task))
        print(f"\n{summary}")
    return 0 if passed else 1


if __name__ == "__main__":
    sys.exit(main())
