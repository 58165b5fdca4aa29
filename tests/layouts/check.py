"""Convert every layout with `hystctl` and compare the result with what the file holds.

Usage: python check.py HYSTCTL DIR [PREFIX...]

DIR comes from `write.py`. With prefixes only the files whose names begin with one of them are checked. One line a
layout goes to stdout, then a total; the exit code is 1 if any layout fails. Needs numpy and Linux.
"""

from __future__ import annotations

import json
import os
import re
import resource
import shlex
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from compare import compare

MAX_SECONDS = 20.0
MAX_PEAK_MB = 300.0
MAX_MESSAGE_CHARACTERS = 2000
# A reader that believes a forged size dies at this limit instead of taking the machine with it.
ADDRESS_SPACE_BYTES = 8 << 30
POLL_S = 0.005

Entry = dict[str, Any]


@dataclass
class Run:
    """What one call of the tool did."""

    code: int
    message: str
    seconds: float
    peak_mb: float


def main() -> int:
    """Check the layouts."""
    if len(sys.argv) < 3:
        print(__doc__, file=sys.stderr)
        return 2
    tool, folder, prefixes = sys.argv[1], Path(sys.argv[2]), tuple(sys.argv[3:])
    entries = json.loads((folder / "expected.json").read_text(encoding="utf-8"))
    chosen = [entry for entry in entries if not prefixes or entry["file"].startswith(prefixes)]
    if not chosen:
        print("no layout begins with " + ", ".join(prefixes), file=sys.stderr)
        return 2
    passed: Counter[str] = Counter()
    for entry in chosen:
        with tempfile.TemporaryDirectory() as work:
            first, problems = check(tool, folder, entry, Path(work) / "out.csv")
        passed[entry["outcome"]] += not problems
        name = " ".join([entry["file"], *map(shlex.quote, entry["options"])])
        state = "FAIL" if problems else "ok"
        print(f"{state:4} {entry['outcome']:6} {first.seconds:6.2f} s {first.peak_mb:5.0f} MB  {name}")
        for problem in problems:
            print(f"       {problem}")
        if problems and first.message.strip():
            print("       stderr: " + first.message.strip().splitlines()[0][:300])
        sys.stdout.flush()
    wanted = Counter(entry["outcome"] for entry in chosen)
    parts = [
        f"{outcome} {passed[outcome]} of {wanted[outcome]}" for outcome in ("read", "ask", "refuse") if wanted[outcome]
    ]
    print(f"{passed.total()} of {wanted.total()} passed: {', '.join(parts)}")
    return int(passed.total() < wanted.total())


def check(tool: str, folder: Path, entry: Entry, out: Path) -> tuple[Run, list[str]]:
    """Convert one file; return the run and what is wrong with it."""
    file = folder / entry["file"]
    run = convert(tool, file, entry["options"], out)
    problems = limits(run)
    outcome = entry["outcome"]
    if run.code == 2 and entry.get("alternative") in ("ask", "refuse"):
        return run, problems + stopped(entry["alternative"], entry["file"], run, out)
    if outcome == "read":
        if run.code != 0:
            return run, [*problems, f"exit code {run.code}, expected 0"]
        if not out.exists():
            return run, [*problems, "no output file"]
        problems += compare(entry, folder, out) + mentions(entry, run.message, file)
    else:
        problems += stopped(outcome, entry["file"], run, out) + mentions(entry, run.message, file)
        if outcome == "ask" and entry["paste"] and not problems:
            problems += paste(tool, file, entry["options"], run.message, out)
    return run, problems


def convert(tool: str, file: Path, options: list[str], out: Path) -> Run:
    """Run `hystctl convert`; measure time and peak memory of the child."""
    with tempfile.TemporaryFile() as stderr:
        start = time.monotonic()
        child = subprocess.Popen(
            [tool, "convert", str(file), *options, str(out)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=stderr,
            preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (ADDRESS_SPACE_BYTES, ADDRESS_SPACE_BYTES)),
        )
        while True:
            done, status, usage = os.wait4(child.pid, os.WNOHANG)
            if done:
                break
            if time.monotonic() - start > MAX_SECONDS:
                child.send_signal(signal.SIGKILL)
                _, status, usage = os.wait4(child.pid, 0)
                break
            time.sleep(POLL_S)
        child.returncode = os.waitstatus_to_exitcode(status)
        seconds = time.monotonic() - start
        stderr.seek(0)
        message = stderr.read(100 * MAX_MESSAGE_CHARACTERS).decode("utf-8", "replace")
    return Run(child.returncode, message, seconds, usage.ru_maxrss / 1024)


def limits(run: Run) -> list[str]:
    """Time, memory and length of the message are bounded for every file."""
    problems = []
    if run.seconds > MAX_SECONDS:
        problems.append(f"took more than {MAX_SECONDS:.0f} s")
    if run.peak_mb > MAX_PEAK_MB:
        problems.append(f"took {run.peak_mb:.0f} MB, at most {MAX_PEAK_MB:.0f} MB expected")
    if len(run.message) > MAX_MESSAGE_CHARACTERS:
        problems.append(f"message of {len(run.message)} characters or more, at most {MAX_MESSAGE_CHARACTERS} expected")
    if "panicked" in run.message:
        problems.append("panicked")
    return problems


def stopped(outcome: str, name: str, run: Run, out: Path) -> list[str]:
    """A question and a refusal end with exit code 2, name the file and leave no output."""
    problems = []
    if run.code != 2:
        problems.append(f"exit code {run.code}, expected 2")
    if out.exists():
        problems.append("an output file was left")
    if name not in run.message:
        problems.append("the message does not name the file")
    if outcome == "ask" and "--map" not in run.message and "--rate" not in run.message:
        problems.append("the message has no --map line")
    return problems


def mentions(entry: Entry, message: str, file: Path) -> list[str]:
    """Words (regular expressions) that the message needs, and the number of rows left out. File names do not count."""
    text = message.replace(str(file), "").replace(entry["file"], "")
    words = list(entry["says"])
    if entry.get("left_out"):
        words.append(rf"\b{entry['left_out']}\b")
    return [f"the message lacks {word}" for word in words if not re.search(word, text, re.IGNORECASE)]


def paste(tool: str, file: Path, options: list[str], message: str, out: Path) -> list[str]:
    """Run again with the options that the message suggests."""
    suggested = suggestion(message)
    if not suggested:
        return ["no --map line that a shell can split"]
    run = convert(tool, file, options + suggested, out)
    if run.code == 0:
        return []
    lines = run.message.strip().splitlines()
    return [f"the suggested {shlex.join(suggested)} ends with exit code {run.code}: {lines[0][:200] if lines else ''}"]


def suggestion(message: str) -> list[str]:
    """Return the options of the line with the most `--map`; a backslash continues a line."""
    best: list[str] = []
    for line in message.replace("\\\n", " ").splitlines():
        _, found, rest = line.partition("--map")
        if not found:
            continue
        try:
            words = shlex.split((found + rest).replace("`", " "))
        except ValueError:
            continue
        options: list[str] = []
        for word, following in zip(words, [*words[1:], ""], strict=True):
            if word in ("--map", "--rate") and following:
                options += [word, following]
            elif word.startswith(("--map=", "--rate=")):
                options.append(word)
        if len(options) > len(best):
            best = options
    return best


if __name__ == "__main__":
    sys.exit(main())
