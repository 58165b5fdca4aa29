"""Fleets of actuators: fits and diagnoses each one, and returns a table, a page, and one row per actuator.

::

    import hyst.fleet

    fleet = hyst.fleet.diagnose("records/", "results.parquet", reports="reports/")
    print(fleet)                      # 295 of 300 actuators …
    fleet.failed                      # {"records/P-017.csv": "…, line 1: …"}
    hyst.fleet.summary("records/", "results.parquet", "fleet.html")
    pandas.read_parquet("results.parquet")

Finished rows are written to a journal next to the table. After an interruption, the same call continues with the
remaining actuators. Files that have changed are processed again.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from hashlib import sha256
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import Any, Literal, TypeAlias

from ._hyst import Record, _fleet_check, _fleet_entries, _fleet_row, _FleetJournal, _Stop
from ._progress import bar

__all__ = ["Fleet", "diagnose", "summary"]

_PathLike: TypeAlias = str | os.PathLike[str]
#: A folder, a list (text or CSV with the column ``file``), or records with their data.
_Records: TypeAlias = _PathLike | Sequence[_PathLike | Record | Mapping[str, str]]

#: Submitted Ray tasks per core: enough to keep every core busy, and few enough that the memory of the driver does not
#: grow with the fleet.
TASKS_PER_CORE = 4


class Fleet:
    """Results of a fleet: one dictionary per actuator, read from the journal on demand."""

    def __init__(self, journal: _FleetJournal, entries: list[str], output: Path) -> None:
        self._journal, self._entries = journal, entries
        self.output = output
        self.done, self._failed = journal.count(entries)

    def __len__(self) -> int:
        return len(self._entries)

    def __iter__(self) -> Iterator[dict[str, Any]]:
        for entry in self._entries:
            for text in self._journal.rows([entry]):
                row = json.loads(text)
                # As in the table: the result, or the error.
                outcome = row.pop("outcome")
                yield {**row, **outcome.get("Ok", {}), "error": outcome.get("Err")}

    @property
    def failed(self) -> dict[str, str]:
        """Errors of the records without a diagnosis, by file."""
        return {row["file"]: row["error"] for row in self if row["error"] is not None}

    def __repr__(self) -> str:
        return f"{self.done - self._failed} of {len(self)} actuators diagnosed, {self._failed} failed: {self.output}"


#: Keys of an actuator.
KEYS = ("file", "test", "serial", "date")


def _entries(records: _Records, output: Path) -> list[str]:
    """Returns the actuators as JSON."""
    if isinstance(records, (str, os.PathLike)):
        return _fleet_entries(records, output)
    entries = []
    for record in records:
        if isinstance(record, Mapping):
            if unknown := [key for key in record if key not in KEYS]:
                raise ValueError(f"{unknown[0]!r} is not known as a key of an actuator; give {', '.join(KEYS)}")
            entries.append({key: None if value is None else str(value) for key, value in record.items()})
        else:
            entries.append({"file": str(_kept(record, output)) if isinstance(record, Record) else os.fspath(record)})
    named = [(entry["file"], entry.get("test")) for entry in entries]
    seen: set[tuple[str | None, str | None]] = set()
    for name in named:
        if name in seen:
            raise ValueError(f"{name[0]} is named twice; name each actuator once")
        seen.add(name)
    return [json.dumps(entry) for entry in entries]


def _kept(record: Record, output: Path) -> Path:
    """Writes a record to a file for other processes and returns its path. Its name contains a hash of the content."""
    folder = output.with_name(output.name + ".records")
    folder.mkdir(exist_ok=True)
    name = "".join(c if c.isalnum() or c in "._-" else "_" for c in Path(record.name).stem)
    new = folder / f".{name}-{os.getpid()}.npy"
    record.save(new)
    path = folder / f"{name}-{sha256(new.read_bytes()).hexdigest()[:12]}.npy"
    new.replace(path)
    return path


def diagnose(
    records: _Records,
    output: _PathLike,
    *,
    model: str = "auto",
    zero: Literal["none", "per-record"] = "none",
    seed: int = 1,
    map: Mapping[str, str] | None = None,
    rate: float | None = None,
    reports: _PathLike | None = None,
    jobs: int | None = None,
    address: str | None = None,
    progress: bool | Callable[[str], object] | None = None,
) -> Fleet:
    """Fits and diagnoses every actuator, and writes the result table.

    Parameters
    ----------
    records : path, or sequence of paths, Records or mappings
        A folder of records; a list (one path per line, or a CSV table with the column ``file`` and optionally ``test``,
        ``serial`` and ``date``); or the same as mappings.
    output : path
        The table (Parquet), with one row per actuator. Its journal is next to it.
    model : str
        Kind of the base model; ``auto`` uses pi or preisach, whichever fits the record better.
    zero, seed, map, rate
        As for ``diagnose`` and ``read_record``.
    reports : path, optional
        Folder for the reports of the actuators.
    jobs : int, optional
        Number of actuators in parallel; default: number of cores. Each has one thread, which does not need Python's
        lock.
    address : str, optional
        Address of a Ray cluster (``"auto"``, ``"local"``, ``"ray://head:10001"``) whose workers do the work. Needs
        ``pip install ray`` and access of the workers to the files. A worker that dies is replaced, and its actuator is
        processed again.
    progress : bool or callable, optional
        Whether a progress bar is shown; by default in a terminal or a notebook. A function is called with each finished
        file.

    Returns
    -------
    Fleet
        The rows, and the errors in ``failed``. A record that cannot be read or fitted is a row with its error.
    """
    path = Path(output)
    entries = _entries(records, path)
    options = json.dumps(
        {
            "model": model,
            "zero_per_record": zero == "per-record",
            "seed": seed,
            "map": [f"{name}={column}" for name, column in (map or {}).items()],
            "rate": rate,
        }
    )
    if zero not in ("none", "per-record"):
        raise ValueError(f'zero is {zero!r}; it must be "none" or "per-record"')
    _fleet_check(options)
    if reports is not None:
        Path(reports).mkdir(parents=True, exist_ok=True)
    folder = None if reports is None else os.path.abspath(reports)
    journal = _FleetJournal(path)
    due = journal.due(entries, options, folder is not None)
    shown = bar("fleet", len(due), progress)
    done = 0

    def keep(row: str | None) -> None:
        nonlocal done
        if row is None:
            return
        journal.add(row)
        done += 1
        if shown is not None:
            shown.say(json.loads(row)["file"], done)

    try:
        if address:
            _on_ray(due, options, folder, address, keep)
        else:
            _on_threads(due, options, folder, jobs, keep)
    finally:
        # The finished rows are written in any case.
        if shown is not None:
            shown.close()
        journal.write(entries, path)
        journal.unlock()
    return Fleet(journal, entries, path)


_Keep: TypeAlias = Callable[["str | None"], None]


def _on_threads(due: list[str], options: str, reports: str | None, jobs: int | None, keep: _Keep) -> None:
    """Computes rows on the cores of this machine and calls ``keep`` with each finished one."""
    workers = jobs or os.cpu_count() or 1
    stop = _Stop()
    waiting: set[Future[str | None]] = set()
    rest = iter(due)
    with ThreadPoolExecutor(workers) as pool:
        try:
            while True:
                while len(waiting) < 2 * workers and (entry := next(rest, None)) is not None:
                    waiting.add(pool.submit(_fleet_row, entry, options, reports, stop))
                if not waiting:
                    return
                ready = wait(waiting, return_when=FIRST_COMPLETED).done
                for row in ready:
                    waiting.discard(row)
                    keep(row.result())
        except BaseException:
            # Stop the rows in progress, and keep the finished ones.
            stop.stop()
            for row in waiting:
                row.cancel()
            for row in wait(waiting).done:
                if not row.cancelled() and row.exception() is None and (text := row.result()) is not None:
                    with suppress(BaseException):
                        keep(text)
            raise


def _row(entry: str, options: str, reports: str | None) -> str | None:
    """Computes a row. Ray cannot run a compiled function directly."""
    return _fleet_row(entry, options, reports)


def _with_absolute_paths(entry: str) -> str:
    """Returns an actuator with absolute paths, for another working folder."""
    given = json.loads(entry)
    return json.dumps({key: os.path.abspath(value) if key in ("file", "test") and value else value for key, value in given.items()})


def _without_a_worker(entry: str, options: str, error: BaseException) -> str:
    """Returns the row of an actuator on which every worker died. Without a hash of its files it is repeated next time."""
    known = {"test": None, "serial": None, "date": None, **json.loads(entry)}
    why = f"no worker returned a result: {type(error).__name__}"
    return json.dumps({**known, "sha256": None, "options": options, "took_s": 0.0, "outcome": {"Err": why}})


def _with_given_names(row: str, entry: str) -> str:
    """Returns a row with the given names."""
    return json.dumps({**json.loads(row), **json.loads(entry)})


def _on_ray(due: list[str], options: str, reports: str | None, address: str, keep: _Keep) -> None:
    """Computes rows on a Ray cluster and calls ``keep`` with each finished one."""
    try:
        ray = import_module("ray")
    except ImportError:
        raise ImportError("address= needs Ray: pip install ray") from None
    if not due:
        return
    if not ray.is_initialized():
        ray.init(address=address, log_to_driver=False)
    # If a worker dies, Ray repeats its actuator on another one.
    task = ray.remote(num_cpus=1, max_retries=5)(_row)
    max_tasks = TASKS_PER_CORE * max(1, int(ray.cluster_resources().get("CPU", 1)))
    waiting: dict[Any, str] = {}
    rest = iter(due)
    try:
        while True:
            while len(waiting) < max_tasks and (entry := next(rest, None)) is not None:
                waiting[task.remote(_with_absolute_paths(entry), options, reports)] = entry
            if not waiting:
                return
            ready, _ = ray.wait(list(waiting), num_returns=1)
            for done in ready:
                entry = waiting.pop(done)
                try:
                    row = ray.get(done)
                except ray.exceptions.RayError as error:
                    row = _without_a_worker(entry, options, error)
                keep(None if row is None else _with_given_names(row, entry))
    finally:
        for row in waiting:
            ray.cancel(row, force=True)


def summary(records: _Records, output: _PathLike, page: _PathLike | None = None) -> str:
    """Returns the page of a fleet: the effects of each actuator, parameters with control limits in the order of dates
    or serial numbers, outliers, failures, and links to the reports.

    Parameters
    ----------
    records, output
        As for ``diagnose``. The journal next to ``output`` is read.
    page : path, optional
        File for the page (HTML).

    Returns
    -------
    str
        The page.
    """
    path = Path(output)
    if not path.with_name(path.name + ".journal").exists():
        raise FileNotFoundError(f"{path}.journal: there is no such fleet; call hyst.fleet.diagnose first")
    title = f"Fleet {Path(records).name}" if isinstance(records, (str, os.PathLike)) else f"Fleet {path.stem}"
    # Without a file, the links are relative to the folder of the table.
    folder = Path(path if page is None else page).parent
    html = _FleetJournal(path, read_only=True).page(_entries(records, path), title, folder)
    if page is not None:
        Path(page).write_text(html, encoding="utf-8")
    return html
