"""Entry point of `fracgyro compare`: tunes all contenders, then evaluates them on unseen seeds and plants."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

from fracgyro.scenario import ScenarioError
from fracgyro.scenario.table import format_value
from fracgyro.study.folder import claim, free_if_nothing_came, locked

from . import kept
from .cost import costs
from .files import Finished, Piece
from .output import write_gains, write_json
from .plan import Comparison, planned
from .report import write_report
from .rows import Tuned, made
from .task import Task
from .workers import Workers, workers


@dataclass(frozen=True)
class Compared:
    """Result of a comparison: paths, and `rows` as in compare.json."""

    task: Task
    data: Path  #: compare.json
    report: Path
    rows: list[dict[str, Any]]
    limits: list[dict[str, Any]]  #: as in compare.json, by scenario and sensing
    resumed: int  #: pieces of work that were found finished
    seconds: float


def compare(
    task: str,
    out: str | os.PathLike[str],
    *,
    scenarios: Sequence[str | os.PathLike[str]] = (),
    only: Sequence[str] = (),
    classes: Sequence[str] = (),
    noise: Sequence[float] = (),
    controller: str | None = None,
    trials: int | None = None,
    quick: bool = False,
    resume: bool = False,
    scheduler: str | None = None,
    storage: str | None = None,
    searched: str | os.PathLike[str] | None = None,
    progress: Callable[[float, float, str], object] | None = None,
) -> Compared:
    """Tunes and evaluates every contender of a task, track or rate.

    Writes compare.json, report.html and gains/ into the folder `out`.

    `scenarios`, `classes` (F: all is measured, P: positions only) and `noise` (of the positions, m/sqrt(Hz)) replace
    those of the task. `only`: names of contenders. `controller`: FILE.py:NAME, an additional contender. `trials`,
    `quick`: reduced effort. `resume`: finish the comparison in `out`. `scheduler`: address of a Dask cluster.
    `storage`: address of a database for finished trials. `searched`: an earlier compare.json; its searches are kept if
    their best gains still have the same errors on the training seeds. `progress`: called with (runs finished, all runs,
    current step). docs/compare.md has the rules.

    Raises ValueError for invalid input, before anything runs; an `out` that is in use or has another comparison; a
    cluster or database that cannot be used; also the errors that a user's controller raises.

    >>> chosen = {"only": ["pid"], "classes": ["F"], "noise": [0.0]}
    >>> found = lab.compare("track", "look", **chosen, quick=True)  # doctest: +SKIP
    >>> found.rows[0]["name"]  # doctest: +SKIP
    'pid'
    """
    begin = time.perf_counter()
    plan = planned(
        task,
        scenarios=scenarios,
        only=only,
        classes=classes,
        noise=noise,
        controller=controller,
        trials=trials,
        quick=quick,
        storage=storage,
    )
    if scheduler is not None and controller is not None:
        raise ScenarioError(
            f"--scheduler is {format_value(scheduler)}: it must be left out with --controller, which runs where its "
            "file is"
        )
    if storage is not None:
        from fracgyro.study.tune.search import storage_at

        storage_at(storage).engine.dispose()  # creates the tables once, before many workers start
    head = {
        "task": plan.task.name,
        "class": list(dict.fromkeys(cell.information for cell in plan.cells)),
        "noise": list(dict.fromkeys(cell.noise for cell in plan.cells)),
        "version": version("fracgyro"),
        "effort": asdict(plan.effort),
    }
    earlier = {} if searched is None else kept.read(Path(searched))
    with finished(plan, Path(out), resume=resume, scheduler=scheduler, earlier=earlier, progress=progress) as done:
        report = done.folder / "report.html"
        write_report(report, plan, list(done.rows.values()), done.limits)
        write_json(done.folder / "compare.json", {**head, "limits": done.limits}, list(done.rows.values()))
    return Compared(
        plan.task,
        done.folder / "compare.json",
        report,
        list(done.rows.values()),
        done.limits,
        done.resumed,
        time.perf_counter() - begin,
    )


@dataclass(frozen=True)
class Done:
    """A finished plan."""

    folder: Path
    rows: dict[str, dict[str, Any]]  # rows of compare.json, by name
    limits: list[dict[str, Any]]
    judged: dict[str, dict[str, Any]]  # results of `Judging.measure`, by name of the row
    resumed: int  # pieces of work that were found finished


@contextmanager
def finished(
    plan: Comparison,
    out: Path,
    *,
    resume: bool,
    scheduler: str | None = None,
    earlier: Mapping[str, Mapping[str, Any]] | None = None,
    progress: Callable[[float, float, str], object] | None = None,
) -> Iterator[Done]:
    """Context manager: the plan, carried out in the folder `out`, which stays locked until the end.

    `earlier`: rows of an earlier comparison by name, of which searches are kept.
    Raises ValueError if `out` is in use or has the results of another plan, or the cluster cannot be used.
    """
    with workers(scheduler) as side_by_side, locked(out):
        folder = claim(out, plan.parts(), {}, resume=resume)
        work = _Work(plan, Finished(folder), side_by_side, earlier or {}, progress)
        with free_if_nothing_came(folder, resume=resume):
            rows = work.done()
        yield Done(folder, rows, work.limits, work.judged, work.resumed)


class _Work:
    """The remaining work of a comparison: tunings, then evaluations."""

    def __init__(
        self,
        plan: Comparison,
        finished: Finished,
        side_by_side: Workers[Any],
        earlier: Mapping[str, Mapping[str, Any]],
        progress: Callable[[float, float, str], object] | None,
    ) -> None:
        self._plan, self._finished, self._workers, self._progress = plan, finished, side_by_side, progress
        self._earlier = earlier
        self.resumed = 0
        self.limits: list[dict[str, Any]] = []
        self.judged: dict[str, dict[str, Any]] = {}
        self._runs = 0
        tunings = sum(plan.tuning(row, {}).runs for wave in plan.waves() for row in wave)
        self._total = tunings + sum(plan.judging(row, {}).runs for row in plan.rows)

    def done(self) -> dict[str, dict[str, Any]]:
        """The rows, by name."""
        plan = self._plan
        tuned = {row.name: Tuned(plan.untuned(row)) for row in plan.rows if not row.contender.gains}
        for wave in plan.waves():
            best = {name: found.values for name, found in tuned.items()}
            pieces = {row.name: plan.tuning(row, best) for row in wave}
            for name, piece in pieces.items():
                held = None if self._finished.has(piece) else self._earlier.get(name)
                if held is not None and (result := kept.searches(piece, held)) is not None:
                    self._finished.write(piece, result)
            self._run(list(pieces.values()), "tuning")
            tuned |= {name: Tuned.of(self._finished.read(piece)) for name, piece in pieces.items()}
        judgings = {
            row.name: plan.judging(row, values, tuned[row.name].searched)
            for row in plan.rows
            if (values := tuned[row.name].values) is not None
        }
        self._total = self._runs + sum(piece.runs for piece in judgings.values())
        self._run(list(judgings.values()), "judging")
        self.judged = {name: self._finished.read(piece) for name, piece in judgings.items()}
        self.limits = plan.limits()
        found = made(plan, tuned, self.judged, self.limits)
        first = {row.contender.name: judgings[row.name] for row in reversed(plan.rows) if row.name in judgings}
        timed = costs({name: piece.scenario() for name, piece in first.items() if piece.contender.own is None})
        for row in plan.rows:
            found[row.name]["cost"] = timed.get(row.contender.name)
        write_gains(self._finished.folder / "gains", judgings, found)
        return found

    def _run(self, pieces: Sequence[Piece], doing: str) -> None:
        left = [piece for piece in pieces if not self._finished.has(piece)]
        self.resumed += len(pieces) - len(left)

        def advance(runs: int) -> None:
            self._runs += runs
            if self._progress:
                self._progress(self._runs, self._total, doing)

        advance(sum(piece.runs for piece in pieces) - sum(piece.runs for piece in left))
        for piece, result in self._workers(left, advance):
            self._finished.write(piece, result)
