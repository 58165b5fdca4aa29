"""The searches of this project beside those that an engineer would take instead: cost after equally many evaluations, and time.

    python3 benches/python/peers.py [--only TASK]

One command: it makes a virtual environment below `target/` with scipy, pygmo, pyswarms, mealpy and numba from PyPI, builds the
Rust side (`benches/examples/peers.rs`, with the crate metaheuristics-nature), and prints a table for each task. The record, the
box, the root mean square error that is minimised, the number of evaluations and the seeds are the same for all; the objective is
checked to agree between Rust and numba to 1e-9 before anything is timed. Of each library's settings (`search/tools.py`) the
table has the one with the lowest median; all of them are in `target/peers/results.json`.

Ends with 1 if the median of `hystctl` is above the best peer's, or its time above a fifth of scipy's.
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
# Two searches that end at the same optimum differ in their last digits.
SAME = 1e-6
FASTER = 5.0


def in_environment():
    """Goes on in the virtual environment, which it makes if need be."""
    if all(importlib.util.find_spec(package) for package in PACKAGES):
        return
    python = FOLDER / "venv" / "bin" / "python"
    if Path(sys.prefix) == python.parents[1]:
        sys.exit(f"{python.parents[1]} lacks one of {', '.join(PACKAGES)}: delete that folder and start again")
    if not python.exists():
        venv.create(python.parents[1], with_pip=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", *PACKAGES], check=True)
    os.execv(python, [python, __file__, *sys.argv[1:]])


def run(tool, objective, seeds):
    """One tool over all seeds, in the shape in which the Rust side reports."""
    from search.objectives import Spent

    name, setting, search = tool
    results = []
    for seed in seeds:
        objective.again()
        wall, cpu = time.perf_counter(), time.process_time()
        try:
            search(objective, seed)
        except Spent:
            pass
        wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
        results.append({"cost": objective.best, "evaluations": objective.count, "wall": wall, "cpu": cpu})
    return {"tool": name, "setting": setting, "results": results}


def median(run, what):
    return statistics.median(result[what] for result in run["results"])


def best_settings(runs):
    """Of each tool the setting with the lowest median cost; of this project all."""
    best = {}
    for one in runs:
        key = one["setting"] if one["tool"].startswith("hystctl") else one["tool"]
        if key not in best or median(one, "cost") < median(best[key], "cost"):
            best[key] = one
    return list(best.values())


def table(task):
    floor = task["floor"]
    lines = [
        "| tool | setting | median | lowest | highest | wall [s] | all cores [s] | evaluations |",
        "|---|---|---:|---:|---:|---:|---:|---:|",
    ]
    for one in best_settings(task["runs"]):
        costs = sorted(result["cost"] / floor for result in one["results"])
        # A system that does not count the time on cores says nothing.
        cpu = "" if one["results"][0]["cpu"] is None else f"{median(one, 'cpu'):.2f}"
        lines.append(
            f"| {one['tool']} | {one['setting']} | {statistics.median(costs):.6f} | {costs[0]:.6f} | {costs[-1]:.6f} "
            f"| {median(one, 'wall'):.2f} | {cpu} | {median(one, 'evaluations'):.0f} |"
        )
    return "\n".join(lines)


def verdict(task):
    """Whether this project's search, on all cores, is where it should be; and in words."""
    ours = next(one for one in task["runs"] if one["tool"] == "hystctl")
    peers = [one for one in task["runs"] if not one["tool"].startswith("hystctl")]
    best = min(peers, key=lambda one: median(one, "cost"))
    scipy = min((one for one in peers if one["tool"] == "scipy"), key=lambda one: median(one, "wall"))
    ratio = median(scipy, "wall") / median(ours, "wall")
    ahead = median(ours, "cost") <= median(best, "cost") * (1 + SAME)
    words = (
        f"{task['name']}: median {median(ours, 'cost') / task['floor']:.6f} noise floors, best peer "
        f"{median(best, 'cost') / task['floor']:.6f} ({best['tool']}, {best['setting']}); "
        f"{ratio:.1f} times as fast as scipy's fastest setting"
    )
    return ahead and ratio >= FASTER, words


def machine():
    lines = Path("/proc/cpuinfo").read_text().splitlines() if Path("/proc/cpuinfo").exists() else []
    model = next((line.split(":")[1].strip() for line in lines if line.startswith("model name")), platform.processor())
    load = f", load {os.getloadavg()[0]:.1f} at the start" if hasattr(os, "getloadavg") else ""
    return f"{model}, {os.cpu_count()} cores{load}; Python {platform.python_version()}"


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", help="one task alone: td-pi or bouc-wen")
    only = parser.parse_args().only
    in_environment()
    from search.objectives import Objective
    from search.tools import tools

    where = machine()
    report = subprocess.run([*RUST, FOLDER], cwd=ROOT, check=True, stdout=subprocess.PIPE, text=True)
    tasks = [task for task in json.loads(report.stdout)["tasks"] if only in (None, task["name"])]
    if not tasks:
        parser.error(f"there is no task {only}")
    good = True
    print(where)
    for task in tasks:
        objective = Objective(task)
        objective.check(task["probes"])
        for tool in tools():
            print(f"{task['name']}: {tool[0]}, {tool[1]}", file=sys.stderr)
            task["runs"].append(run(tool, objective, task["seeds"]))
        (FOLDER / "results.json").write_text(json.dumps({"machine": where, "tasks": tasks}, indent=1))
        reached, words = verdict(task)
        good &= reached
        print(f"\n{task['name']}, {len(task['names'])} parameters; cost in noise floors of {task['floor']:.4g} µm\n")
        print(table(task))
        print(f"\n{words}")
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
