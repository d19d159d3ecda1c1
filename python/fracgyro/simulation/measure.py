"""Metrics of many runs, without their records."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import chain, islice

import numpy as np
import xarray as xr

from .. import _core
from ..arguments import number, short
from ..scenario import Scenario
from ..scenario.to_core import check_single, core_setup
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
    thresholds = {
        "transient": transient,
        "error_bound": error_bound,
        "surface_bound": surface_bound,
        "rate_tolerance": rate_tolerance,
    }
    params = _params(thresholds)
    threads, widest = threads_available(), _core.lane_counts()[-1]
    parts: list[np.ndarray] = []
    places: list[int] = []
    waiting = setups_of(map(core_setup, scenarios), seeds, SCENARIOS_PER_NOISE)
    # Depends only on the scenarios, not on the machine: grouping changes results in the last digits.
    chunk = _chunk(scenarios[0].run.steps)
    if user_controller is None and own_plant is None:

        def measured(setups: list[_core.DeviceSetup]) -> np.ndarray:
            lanes = 1 if len(setups) <= MAX_SINGLE_RUNS else widest
            return _core.measure_runs(setups, params, threads, lanes, single_precision)

        whole = _in_chunks(waiting, chunk, measured, progress)
        figures = metrics_dataset(whole, thresholds)
        return figures if seeds is None else figures.assign_coords(seed_of_each(scenarios, seeds))
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
        else:
            with running(own_plant):
                parts.append(_core.measure_device_runs(setups, params, threads))
        if progress:
            progress(len(setups))
    whole = np.concatenate(parts)[np.argsort(places)]
    figures = metrics_dataset(whole, thresholds)
    return figures if seeds is None else figures.assign_coords(seed_of_each(scenarios, seeds))


def measure_setups(
    setups: Iterable[_core.DeviceSetup],
    seeds: Sequence[int],
    few: bool,
    progress: Callable[[int], object] | None = None,
    meanwhile: Callable[[], object] | None = None,
    **thresholds: float,
) -> xr.Dataset:
    """The variables of `measure_many` for set-ups, which are made while runs continue, with each of the seeds.

    `few`: each run by itself. Otherwise all share lanes, so a run does not depend on the others. `meanwhile`: called
    while the last ones run.
    """
    params, threads = _params(thresholds), threads_available()
    lanes = 1 if few else _core.lane_counts()[-1]
    all_setups = iter(setups)
    first = next(all_setups)

    def measured(some: list[_core.DeviceSetup]) -> np.ndarray:
        return _core.measure_runs(some, params, threads, lanes)

    waiting = setups_of(chain([first], all_setups), seeds, SCENARIOS_PER_NOISE)
    return metrics_dataset(_in_chunks(waiting, _chunk(first.steps), measured, progress, meanwhile), thresholds)


def _params(thresholds: Mapping[str, float]) -> _core.MetricsParams:
    params = _core.MetricsParams()
    for name, value in thresholds.items():
        limit = {"least": 0.0} if name == "transient" else {"above": 0.0}
        setattr(params, name, number(name, value, **limit))
    return params


def _chunk(steps: int) -> int:
    return min(max(CHUNK, CHUNK_STEPS // steps), CHUNK_RUNS)


def _in_chunks(
    waiting: Iterator[tuple[int, _core.DeviceSetup]],
    chunk: int,
    measured: Callable[[list[_core.DeviceSetup]], np.ndarray],
    progress: Callable[[int], object] | None,
    meanwhile: Callable[[], object] | None = None,
) -> np.ndarray:
    """Rows of all runs in the order of their places. A chunk runs while the next one is made ready."""
    parts: list[np.ndarray] = []
    places: list[int] = []

    def keep(rows: np.ndarray) -> None:
        parts.append(rows)
        if progress:
            progress(len(rows))

    taken = list(islice(waiting, chunk))
    if len(taken) < chunk and meanwhile is None:  # all of them
        keep(measured([setup for _, setup in taken]))
        places.extend(place for place, _ in taken)
        return parts[0][np.argsort(places)]
    with ThreadPoolExecutor(1) as pool:
        while taken:
            running = pool.submit(measured, [setup for _, setup in taken])
            places.extend(place for place, _ in taken)
            taken = list(islice(waiting, chunk))
            if meanwhile and not taken:
                meanwhile()
            keep(running.result())
    return np.concatenate(parts)[np.argsort(places)]
