"""Many actuators: each fitted and diagnosed, as one table, one page, and a row each to compute with.

::

    import hyst.fleet

    fleet = hyst.fleet.diagnose("records/", "results.parquet", reports="reports/")
    print(fleet)                      # 295 of 300 actuators …
    fleet.failed                      # {"records/P-017.csv": "…, line 1: …"}
    hyst.fleet.summary("records/", "results.parquet", "fleet.html")
    pandas.read_parquet("results.parquet")

What is done is kept in a journal beside the table as it comes: the same call continues where the last one was ended, by whatever; files that have
changed are done again.
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
#: A folder, a list (text or CSV with the column ``file``), or records with what is known of them.
_Records: TypeAlias = _PathLike | Sequence[_PathLike | Record | Mapping[str, str]]

#: Tasks that wait with Ray for each core: enough that none is idle, and few enough that a driver's memory does not grow with the fleet.
WAITING = 4


class Fleet:
    """What is known of a fleet: a row each, as a dictionary, read from the journal as it is asked for."""

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
                # As the table has it: what was found, or the error.
                outcome = row.pop("outcome")
                yield {**row, **outcome.get("Ok", {}), "error": outcome.get("Err")}

    @property
    def failed(self) -> dict[str, str]:
        """Why records have no diagnosis, by their files."""
        return {row["file"]: row["error"] for row in self if row["error"] is not None}

    def __repr__(self) -> str:
        return f"{self.done - self._failed} of {len(self)} actuators diagnosed, {self._failed} failed: {self.output}"


#: What is known of an actuator.
KEYS = ("file", "test", "serial", "date")


def _entries(records: _Records, output: Path) -> list[str]:
    """The actuators, as JSON."""
    if isinstance(records, (str, os.PathLike)):
        return _fleet_entries(records, output)
    entries = []
    for record in records:
        if isinstance(record, Mapping):
            if unknown := [key for key in record if key not in KEYS]:
                raise ValueError(f"{unknown[0]!r} is not known of an actuator; give {', '.join(KEYS)}")
            entries.append({key: None if value is None else str(value) for key, value in record.items()})
        else:
            entries.append({"file": str(_kept(record, output)) if isinstance(record, Record) else os.fspath(record)})
    named = [(entry["file"], entry.get("test")) for entry in entries]
    seen: set[tuple[str | None, str | None]] = set()
    for name in named:
        if name in seen:
            raise ValueError(f"{name[0]} is named twice; an actuator is named once")
        seen.add(name)
    return [json.dumps(entry) for entry in entries]


def _kept(record: Record, output: Path) -> Path:
    """A file of a record of this process, which other processes read too; one of the same content is there already."""
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
    """Fits and diagnoses every actuator, and writes the table of results.

    Parameters
    ----------
    records : path, or sequence of paths, Records or mappings
        A folder of records; a list (a path in each line, or a CSV table with the column ``file`` and, as it has them, ``test``, ``serial`` and
        ``date``); or the same as mappings.
    output : path
        The table (Parquet): one row an actuator. Its journal lies beside it.
    model : str
        Kind of the model that is fitted; ``auto`` takes pi or preisach, whichever explains a record better.
    zero, seed, map, rate
        As for ``diagnose`` and ``read_record``.
    reports : path, optional
        Folder for the report of each actuator.
    jobs : int, optional
        Actuators at a time, one for each core if not given. Each has one thread, which does not need Python's lock.
    address : str, optional
        Of a Ray cluster (``"auto"``, ``"local"``, ``"ray://head:10001"``): its workers do the work instead. Needs ``pip install ray``, and that
        they see the files. A worker that dies is replaced, and its actuator is done again.
    progress : bool or callable, optional
        Whether a bar is shown; in a terminal or a notebook if not given. A function is given each file that is done.

    Returns
    -------
    Fleet
        Its rows one at a time, and what ``failed``. Records that cannot be read or fitted are rows with the reason.
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
        # What is done is shown in any case.
        if shown is not None:
            shown.close()
        journal.write(entries, path)
        journal.unlock()
    return Fleet(journal, entries, path)


_Keep: TypeAlias = Callable[["str | None"], None]


def _on_threads(due: list[str], options: str, reports: str | None, jobs: int | None, keep: _Keep) -> None:
    """Rows on the cores of this machine; ``keep`` is given each as it comes."""
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
            # Those that are being computed end within moments; what is done already is kept.
            stop.stop()
            for row in waiting:
                row.cancel()
            for row in wait(waiting).done:
                if not row.cancelled() and row.exception() is None and (text := row.result()) is not None:
                    with suppress(BaseException):
                        keep(text)
            raise


def _row(entry: str, options: str, reports: str | None) -> str | None:
    """A task: Ray takes no compiled function."""
    return _fleet_row(entry, options, reports)


def _there(entry: str) -> str:
    """An actuator whose files are found from another folder."""
    given = json.loads(entry)
    return json.dumps({key: os.path.abspath(value) if key in ("file", "test") and value else value for key, value in given.items()})


def _without_a_worker(entry: str, options: str, error: BaseException) -> str:
    """The row of an actuator on which every worker died. Without the hash of its files it is done again next time."""
    known = {"test": None, "serial": None, "date": None, **json.loads(entry)}
    why = f"no worker came back with it: {type(error).__name__}"
    return json.dumps({**known, "sha256": None, "options": options, "took_s": 0.0, "outcome": {"Err": why}})


def _named(row: str, entry: str) -> str:
    """A row with the names that were given."""
    return json.dumps({**json.loads(row), **json.loads(entry)})


def _on_ray(due: list[str], options: str, reports: str | None, address: str, keep: _Keep) -> None:
    """Rows on a Ray cluster; ``keep`` is given each as it comes."""
    try:
        ray = import_module("ray")
    except ImportError:
        raise ImportError("address= needs Ray: pip install ray") from None
    if not due:
        return
    if not ray.is_initialized():
        ray.init(address=address, log_to_driver=False)
    # A worker that dies takes its actuator with it: Ray does it again on another.
    task = ray.remote(num_cpus=1, max_retries=5)(_row)
    most = WAITING * max(1, int(ray.cluster_resources().get("CPU", 1)))
    waiting: dict[Any, str] = {}
    rest = iter(due)
    try:
        while True:
            while len(waiting) < most and (entry := next(rest, None)) is not None:
                waiting[task.remote(_there(entry), options, reports)] = entry
            if not waiting:
                return
            ready, _ = ray.wait(list(waiting), num_returns=1)
            for done in ready:
                entry = waiting.pop(done)
                try:
                    row = ray.get(done)
                except ray.exceptions.RayError as error:
                    row = _without_a_worker(entry, options, error)
                keep(None if row is None else _named(row, entry))
    finally:
        for row in waiting:
            ray.cancel(row, force=True)


def summary(records: _Records, output: _PathLike, page: _PathLike | None = None) -> str:
    """The page of a fleet: which actuators show which effects, parameters with control limits in the order of dates or serial numbers, what
    stands out, what failed, with links to the reports.

    Parameters
    ----------
    records, output
        As for ``diagnose``, whose journal beside ``output`` is read.
    page : path, optional
        Where to write it (HTML).

    Returns
    -------
    str
        The page.
    """
    path = Path(output)
    if not path.with_name(path.name + ".journal").exists():
        raise FileNotFoundError(f"{path}.journal: there is no such fleet; hyst.fleet.diagnose makes it")
    title = f"Fleet {Path(records).name}" if isinstance(records, (str, os.PathLike)) else f"Fleet {path.stem}"
    html = _FleetJournal(path, read_only=True).page(_entries(records, path), title)
    if page is not None:
        Path(page).write_text(html, encoding="utf-8")
    return html
