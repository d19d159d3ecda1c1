"""From a study file to its rows and their summary."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import pyarrow as pa

from ... import _core
from ...files import whole_file
from ...scenario.table import format_value
from ...simulation.many import at_most
from ...simulation.user_controller import ControllerLike
from ..cluster import connected, measured_there
from ..folder import free_if_nothing_came, locked
from ..preview import Preview, first_rows, seconds
from .block_files import BlockFiles
from .blocks import Block, blocks
from .design import read_plan
from .effects import Rows
from .indices import Sensitivity, sensitivity
from .summary import write_summary, write_summary_of_totals


@dataclass(frozen=True)
class Sweep:
    """Result of a sweep: paths of the rows and the summary, counts and time."""

    data: Path  #: folder of Parquet files
    summary: Path
    runs: int
    resumed: int  #: runs that were already finished
    diverged: int
    seconds: float
    sensitivity: Sensitivity | None = None  #: only for the design sobol_indices


def sweep(
    study: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    controller: ControllerLike | None = None,
    resume: bool = False,
    scheduler: str | None = None,
    jobs: int | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> Sweep:
    """Runs a study file. Writes the rows as Parquet into `out`/runs, and `out`/summary.html.

    The design sobol_indices also writes `out`/indices.csv. The rows do not depend on the processors, interruptions or
    execution order.

    `controller`: replaces the scenarios' controllers, as in `fracgyro.simulate`. Parameters of a native.Law may vary in
    the study, as `law.NAME`. study.json identifies the controller by its name, parameters, and a hash of its code, its
    attributes and everything it uses from its own package, or of a C function's library. `resume`: finish the study in
    `out`, with the same controller. `scheduler`: address of a Dask cluster, without a controller; by default this
    machine is used. `jobs`: number of its processors to use, by default all. `progress`: called with (runs finished,
    all runs).

    Raises ValueError for an invalid study, before anything runs; an `out` that is in use or has another study or
    controller; a cluster that cannot be reached or fails repeatedly; also the errors that `simulate` raises for a
    controller.

    >>> with open("orders.toml", "w") as file:
    ...     print("fixed.run.duration = 12.0", file=file)
    ...     print("vary.controller.order = [0.8, 0.9]", file=file)
    >>> fg.study.sweep("orders.toml", "orders").runs
    2
    """
    begin = time.perf_counter()
    if controller is not None and scheduler is not None:
        raise ValueError(
            f"scheduler is {format_value(scheduler)}: it must be left out, as a user's controller runs only in this "
            "process"
        )
    plan = read_plan(study, controller)
    work = blocks(plan)
    if jobs is not None and scheduler is not None:
        raise ValueError(f"jobs is {jobs}: it must be left out with scheduler, whose workers use their machines")
    with at_most(jobs), nullcontext() if scheduler is None else connected(scheduler) as cluster, locked(Path(out)):
        folder = BlockFiles(out, plan, work, resume=resume)
        waiting = [block for block in work if not folder.finished(block)]
        done = resumed = plan.runs - sum(block.runs for block in waiting)

        def advance(runs: int) -> None:
            nonlocal done
            done += runs
            if progress:
                progress(done, plan.runs)

        advance(0)
        with free_if_nothing_came(folder.path, resume=resume):
            measured = measured_there(cluster, waiting, advance) if cluster else measured_here(waiting, advance)
            _write(folder, measured)
        summary = folder.path / "summary.html"
        if not plan.study.quantiles:
            totals = folder.totals(work)
            write_summary_of_totals(summary, totals)
            return Sweep(folder.runs, summary, plan.runs, resumed, totals.diverged, time.perf_counter() - begin)
        rows = Rows.of(plan, folder.read(work, list(dict.fromkeys(["point", "seed", "diverged_at", *plan.study.show]))))
        found = sensitivity(rows) if plan.study.design.kind == "sobol_indices" else None
        if found is not None:
            with whole_file(folder.path / "indices.csv") as scratch:
                scratch.write_text(found.csv(), encoding="utf-8", newline="\n")
        write_summary(summary, rows, found)
    return Sweep(folder.runs, summary, plan.runs, resumed, rows.diverged, time.perf_counter() - begin, found)


def preview(study: str | os.PathLike[str], *, controller: ControllerLike | None = None) -> Preview:
    """The size and the estimated time of a sweep, which is not run. Raises ValueError for an invalid study."""
    plan = read_plan(study, controller)
    steps = plan.facts.steps * len(plan.seeds)
    return Preview(
        plan.runs,
        len(plan.points),
        len(plan.seeds),
        steps,
        seconds(plan.scenario(0), plan.runs, steps, controller, plan.tasks),
        first_rows(plan.fields, plan.points),
    )


def _write(folder: BlockFiles, measured: Iterator[tuple[Block, pa.Table]]) -> None:
    """Writes each block while the next one runs."""
    with ThreadPoolExecutor(1) as writer:
        written: list[Future[None]] = []
        for block, table in measured:
            for before in written:
                before.result()
            written = [writer.submit(folder.write, block, table)]
    for last in written:
        last.result()


def measured_here(work: list[Block], progress: Callable[[int], object]) -> Iterator[tuple[Block, pa.Table]]:
    """Each block with its rows. The set-ups of a block are made while the one before runs."""
    ready: dict[int, list[_core.DeviceSetup]] = {}

    def prepare(place: int) -> None:
        if (setups := work[place].setups()) is not None:
            ready[place] = list(setups)

    for place, block in enumerate(work):
        following = partial(prepare, place + 1) if place + 1 < len(work) else None
        yield block, block.measure(progress, ready.pop(place, None), following)
