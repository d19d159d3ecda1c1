"""Studies: many scenarios from one file.

Reading order: space.py (which fields vary), controller.py, file.py, folder.py; then sweep/run.py, page one of
`fracgyro sweep`, and tune/run.py, that of `fracgyro tune`.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from typing import TYPE_CHECKING

from ..simulation.outside import ControllerLike
from . import sweep as _sweep  # noqa: F401  or these folders, once imported, would take the functions' names
from . import tune as _tune  # noqa: F401

if TYPE_CHECKING:
    from .sweep.run import Sweep
    from .tune.run import Tuned

__all__ = ["sweep", "tune"]


def sweep(
    study: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    controller: ControllerLike | None = None,
    resume: bool = False,
    scheduler: str | None = None,
    progress: Callable[[int, int], object] | None = None,
) -> Sweep:
    """Every run of the study file, as Parquet in the folder `out`/runs, and `out`/summary.html.

    The rows are the same whatever the processors, the interruptions and their order.
    `controller`, in the place of the scenarios' own: as in `fracgyro.simulate`. Parameters of a native.Law may vary in
    the study, as `law.NAME`. study.json says which controller it was: its name, its parameters, and the hash of its
    code, of what it takes from its own package and of its attributes, or of the library that a C function lies in.
    `resume`: finish what lies in `out`, with the same controller. `scheduler`: the address of a Dask cluster to run on,
    without a controller; left out, this machine. `progress` is called with (runs finished, all runs).
    Raises ValueError in one sentence: a bad study, before anything runs; an `out` that is in use, or holds another
    study or one of another controller; a cluster that cannot be reached or keeps failing; and what `simulate` raises of
    a controller.
    """
    from .sweep.run import sweep as run

    return run(study, out, controller=controller, resume=resume, scheduler=scheduler, progress=progress)


def tune(
    study: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    controller: ControllerLike | None = None,
    resume: bool = False,
    progress: Callable[[float, float, str], object] | None = None,
) -> Tuned:
    """Searches as the study file says, and compares what it chose with the base scenario on held-out seeds.

    Writes tuned.toml, tune.html, trials.csv and, of several objectives, pareto.csv, pareto.svg and pareto.png into the
    folder `out`. The trials are kept in `out`/study.db or in the study's storage as they are finished.
    `controller`: as in `sweep`; the result has it, with the parameters that were chosen.
    `resume`: go on with the study that `out` holds, up to the file's number of trials.
    `progress` is called with (runs finished, all runs, what is being done).
    On one machine the result depends only on the study file and the controller, not on interruptions or the number of
    processors.
    Raises ValueError in one sentence: a bad study, before anything runs; an `out` that is in use or holds another
    study or one of another controller; a storage that cannot be used; no trial that keeps every constraint; and what
    `simulate` raises of a controller.
    """
    from .tune.run import tune as run

    return run(study, out, controller=controller, resume=resume, progress=progress)
