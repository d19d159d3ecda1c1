"""The rate estimate of runs of any length, averaged while they run: in the memory of the averages."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..scenario import Scenario
from ..scenario.to_core import is_ideal
from .many import setups_of, threads_available
from .outside import ControllerLike, Outside


def rate_means(
    scenario: Scenario,
    seeds: Sequence[int],
    *,
    every: int,
    block: int,
    controller: ControllerLike | None = None,
) -> NDArray[np.float64]:
    """Means of the nondimensional rate estimate, (seed, output), each of `block` samples that are `every` steps apart.

    The samples are those of `simulate_many` with run.record_every = `every`, which see for `controller`; it must report
    rate_estimate. NaN throughout for a run that diverges.
    """
    threads, setups = threads_available(), [setup for _, setup in setups_of([scenario], seeds, 1)]
    if controller is None:
        means, lasted = _core.rate_means(setups, every, block, threads, not is_ideal(scenario))
    else:
        means, lasted = Outside(controller).rate_means([scenario] * len(setups), setups, every, block, threads)
    return np.where(lasted[:, np.newaxis] > scenario.run.steps, means, np.nan)
