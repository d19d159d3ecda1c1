"""Metrics of many runs, without their records."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import islice

import numpy as np
import xarray as xr

from .. import _core
from ..arguments import number, short
from ..scenario import Scenario
from ..scenario.to_core import check_single
from .dataset import metrics_dataset
from .many import check_many, seed_of_each, setups_of, threads_available
from .native import Law
from .outside import ControllerLike, Outside

# Runs between two looks at the keyboard and the progress callback: by their steps, and at most.
CHUNK, CHUNK_STEPS, CHUNK_RUNS = 32, 20_000_000, 4096
FEW = 2  # runs that go by themselves: as long as a block of lanes takes, there is time for them on one processor
TOGETHER = 32  # scenarios whose runs with the same seed share its noise, which is then drawn once


def measure_many(
    scenarios: Sequence[Scenario],
    *,
    seeds: Sequence[int] | None = None,
    controller: ControllerLike | Sequence[Law] | None = None,
    single_precision: bool = False,
    transient: float = 10.0,
    error_bound: float = 0.01,
    surface_bound: float = 0.06,
    rate_tolerance: float = 0.1,
    progress: Callable[[int], object] | None = None,
) -> xr.Dataset:
    """The metrics of many runs, in memory that does not grow with their length.

    Returns the variables of `fracgyro.metrics.summary`, whose parameters `transient` to `rate_tolerance` are, over
    `run`, nondimensional; NaN where a controller does not report what they are of. `seeds` and `progress`: as in
    `simulate_many`. Scenarios may differ in everything. A run that diverges is measured until then, and `diverged_at`
    says when; it is NaN for the others.

    Runs go side by side in the lanes of a register (docs/decisions/0011): the metrics are those of `simulate` to
    rounding, and the same whatever the number of processors. Where the loop itself magnifies rounding, as it does with
    controller.terminal_exponent below some 0.35, they differ as much as those of two runs whose gains differ in the
    last place do: by percents. Runs whose rate moves or whose device is not ideal go one by one (docs/decisions/0017).

    `single_precision`: twice as many runs in a register. Metrics of a run then differ by some percent, their means over
    seeds by less (docs/decisions/0011 has figures). `controller`, in the place of the scenarios' own: as in
    `simulate_many`, one run by one, in double precision; of its reports only rate_estimate is looked at. A list of
    native.Law has one for each scenario.

    Raises TypeError when `scenarios` is not a list of scenarios or `seeds` no list of integers; ValueError when one of
    them is empty, a seed is given twice or outside 0 to 2^63 - 1, `single_precision` comes with a `controller` or
    cannot hold a coefficient, or a list does not have a law for each scenario; and what `simulate` raises of a
    controller.

    >>> rows = fg.measure_many([fg.Scenario.paper()], seeds=range(20))
    >>> rows["rmse"].dims, bool((rows["rmse"].sel(window="steady") < 1e-4).all())
    (('run', 'window', 'axis'), True)
    """
    times = check_many(scenarios, seeds)
    laws = controller if isinstance(controller, list | tuple) else None
    if laws is not None and (len(laws) != len(scenarios) or not all(isinstance(law, Law) for law in laws)):
        raise ValueError(
            f"controller is {short(laws)}: a list must have a native.Law for each scenario, of which there are "
            f"{len(scenarios)}"
        )
    outside = None if controller is None else Outside(laws[0] if laws else controller)
    if outside and single_precision:
        raise ValueError("single_precision is True with a controller: those from outside are in double precision")
    for scenario in scenarios if single_precision else ():
        check_single(scenario)
    params = _core.MetricsParams()
    thresholds = {
        "transient": transient,
        "error_bound": error_bound,
        "surface_bound": surface_bound,
        "rate_tolerance": rate_tolerance,
    }
    for name, value in thresholds.items():
        limit = {"least": 0.0} if name == "transient" else {"above": 0.0}
        setattr(params, name, number(name, value, **limit))
    threads, widest = threads_available(), _core.lane_counts()[-1]
    parts: list[np.ndarray] = []
    places: list[int] = []
    waiting = setups_of(scenarios, seeds, TOGETHER)
    # A function of the scenarios, never of the machine: what runs side by side changes results in the last places.
    chunk = min(max(CHUNK, CHUNK_STEPS // scenarios[0].run.steps), CHUNK_RUNS)
    while taken := list(islice(waiting, chunk)):
        setups = [setup for _, setup in taken]
        places.extend(place for place, _ in taken)
        if outside:
            owners = [place // times for place, _ in taken]
            each = [laws[owner] for owner in owners] if laws else None
            parts.append(outside.measure([scenarios[owner] for owner in owners], setups, params, threads, each))
        else:
            lanes = 1 if len(setups) <= FEW else widest
            parts.append(_core.measure_runs(setups, params, threads, lanes, single_precision))
        if progress:
            progress(len(setups))
    whole = np.concatenate(parts)[np.argsort(places)]
    figures = metrics_dataset(whole, thresholds)
    return figures if seeds is None else figures.assign_coords(seed_of_each(scenarios, seeds))
