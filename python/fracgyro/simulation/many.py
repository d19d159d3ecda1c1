"""Runs of simulate_many and measure_many: validation, order and threads."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from itertools import count, islice
from typing import Any

import numpy as np

from .. import _core
from ..arguments import short
from ..scenario import Scenario
from .processors import processors

_jobs: ContextVar[int | None] = ContextVar("jobs", default=None)


@contextmanager
def at_most(jobs: int | None) -> Iterator[None]:
    """Context manager: runs use at most this many processors; None: all. Raises ValueError unless it is positive.

    Results do not depend on it.
    """
    if jobs is not None and (isinstance(jobs, bool) or not isinstance(jobs, int) or jobs < 1):
        raise ValueError(f"jobs is {short(jobs)}: it must be a number of processors, at least 1")
    token = _jobs.set(jobs)
    try:
        yield
    finally:
        _jobs.reset(token)


def threads_available() -> int:
    """Number of processors that this process may use, at most those of `at_most`."""
    found = processors()
    return min(found, _jobs.get() or found)


def check_many(scenarios: Sequence[Scenario], seeds: Sequence[int] | None) -> int:
    """Number of runs per scenario. Raises TypeError or ValueError for invalid scenarios or seeds."""
    if not isinstance(scenarios, list | tuple) or not all(isinstance(s, Scenario) for s in scenarios):
        raise TypeError(f"scenarios is {short(scenarios)}: it must be a list of Scenario")
    if not scenarios:
        raise ValueError("scenarios is empty: it must have at least one scenario")
    if seeds is None:
        return 1
    _check_seeds(seeds)
    return len(seeds)


def seed_of_each(scenarios: Sequence[Scenario], seeds: Sequence[int] | None) -> dict[str, Any]:
    """The coordinate `seed` of the runs, or nothing without seeds."""
    return {} if seeds is None else {"seed": ("run", np.tile(np.array(seeds), len(scenarios)))}


def setups_of(
    all_setups: Iterable[_core.DeviceSetup], seeds: Sequence[int] | None, group: int
) -> Iterator[tuple[int, _core.DeviceSetup]]:
    """Every run with its index in the result; within groups of `group` set-ups, ordered by seed.

    Changes the set-ups, which must not be used elsewhere.
    """
    if seeds is None:
        yield from enumerate(all_setups)
        return
    waiting = iter(all_setups)
    for first in count(0, group):
        setups = list(islice(waiting, group))
        if not setups:
            return
        for at, seed in enumerate(seeds):
            for i, setup in enumerate(setups, first):
                seeded = _core.DeviceSetup(setup) if at + 1 < len(seeds) else setup
                seeded.seed = int(seed)
                yield i * len(seeds) + at, seeded


def _check_seeds(seeds: Sequence[int]) -> None:
    if not isinstance(seeds, Sequence | np.ndarray) or isinstance(seeds, str | bytes | bytearray | memoryview):
        raise TypeError(f"seeds is {short(seeds)}: it must be a list of seeds, such as range(8)")
    if not len(seeds):
        raise ValueError("seeds is empty: it must have at least one seed")
    if len(set(seeds)) < len(seeds):
        raise ValueError("seeds holds a seed twice: they must be different")
    for seed in seeds:
        if isinstance(seed, bool) or not (isinstance(seed, int | np.integer) and 0 <= seed < 2**63):
            raise ValueError(f"seeds holds {short(seed)}: every seed must be an integer from 0 to 2^63 - 1")
