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
from .user_controller import ControllerLike, UserController
from .user_plant import PlantLike, UserPlant, put_into, running

# Runs between two checks for interrupts and progress: by their steps, and at most.
CHUNK, CHUNK_STEPS, CHUNK_RUNS = 32, 20_000_000, 4096
MAX_SINGLE_RUNS = 2  # up to this many runs, single runs are faster than a block of lanes
SCENARIOS_PER_NOISE = 32  # scenarios whose runs with the same seed share its noise, which is drawn once


def measure_many(
    scenarios: Sequence[Scenario],
    *,
    seeds: Sequence[int] | None = None,
    controller: ControllerLike | Sequence[Law] | None = None,
    plant: PlantLike | None = None,
    single_precision: bool = False,
    transient: float = 10.0,
    error_bound: float = 0.01,
    surface_bound: float = 0.06,
    rate_tolerance: float = 0.1,
    progress: Callable[[int], object] | None = None,
) -> xr.Dataset:
    """Metrics of many runs, in memory that does not grow with their length.

    Returns the variables of `fracgyro.metrics.summary` over `run`, nondimensional; NaN for metrics of channels that a
    controller does not report. `transient`, `error_bound`, `surface_bound` and `rate_tolerance`: thresholds as in
    `summary`, nondimensional. `seeds` and `progress`: as in `simulate_many`. Scenarios may differ in every field. A run
    that diverges is measured up to `diverged_at`, which is NaN for the others.

    Several runs share the lanes of a register (docs/decisions/0011): metrics agree with `simulate` to rounding and do
    not depend on the number of processors. If the loop amplifies rounding, as with controller.terminal_exponent below
    about 0.35, metrics differ by percents, as they do when a gain changes in its last digit. Runs with a dynamic rate
    or device imperfections run one by one (docs/decisions/0017).

    `single_precision`: twice as many runs per register. Metrics of a run then differ by some percent, their means over
    seeds by less (figures in docs/decisions/0011). `controller`: replaces the scenarios' controllers, as in
    `simulate_many`; runs go one by one in double precision, and only rate_estimate of its reports is used. A list of
    native.Law has one for each scenario. `plant`: replaces the gyroscope, as in `simulate`; runs go one by one, too.

    Raises TypeError if `scenarios` is not a list of scenarios or `seeds` is not a list of integers; ValueError for an
    empty list, a repeated seed or one outside 0 to 2^63 - 1, `single_precision` with a `controller`, a `plant` or
    a coefficient that exceeds it, or a list without a law for each scenario; also the errors that `simulate` raises for
    a controller or a plant.

    >>> rows = fg.measure_many([fg.Scenario.paper()], seeds=range(20))
    >>> rows["rmse"].dims, bool((rows["rmse"].sel(window="steady") < 1e-4).all())
    (('run', 'window', 'axis'), True)
    """
    times = check_many(scenarios, seeds)
    laws = controller if isinstance(controller, list | tuple) else None
    if laws is not None and (len(laws) != len(scenarios) or not all(isinstance(law, Law) for law in laws)):
        raise ValueError(
            f"controller is {short(laws)}: a list must have one native.Law for each of the {len(scenarios)} scenarios"
        )
    user_controller = None if controller is None else UserController(laws[0] if laws else controller)
    own_plant = None if plant is None else UserPlant(plant)
    if (user_controller or own_plant) and single_precision:
        what = "a controller" if user_controller else "a plant"
        raise ValueError(f"single_precision is True: it must be False with {what}, which runs in double precision")
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
    waiting = setups_of(scenarios, seeds, SCENARIOS_PER_NOISE)
    # Depends only on the scenarios, not on the machine: grouping changes results in the last digits.
    chunk = min(max(CHUNK, CHUNK_STEPS // scenarios[0].run.steps), CHUNK_RUNS)
    while taken := list(islice(waiting, chunk)):
        setups = [setup for _, setup in taken]
        places.extend(place for place, _ in taken)
        owners = [place // times for place, _ in taken]
        own = [scenarios[owner] for owner in owners]
        put_into(own_plant, setups, own)
        if user_controller:
            each = [laws[owner] for owner in owners] if laws else None
            with running(own_plant):
                parts.append(user_controller.measure(own, setups, params, threads, each))
        elif own_plant:
            with running(own_plant):
                parts.append(_core.measure_device_runs(setups, params, threads))
        else:
            lanes = 1 if len(setups) <= MAX_SINGLE_RUNS else widest
            parts.append(_core.measure_runs(setups, params, threads, lanes, single_precision))
        if progress:
            progress(len(setups))
    whole = np.concatenate(parts)[np.argsort(places)]
    figures = metrics_dataset(whole, thresholds)
    return figures if seeds is None else figures.assign_coords(seed_of_each(scenarios, seeds))
