"""Averages of the rate estimate of long runs, computed during the run, in memory of their number."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..scenario import Scenario
from ..scenario.device_core import is_ideal
from ..scenario.to_core import core_setup
from .many import setups_of, threads_available
from .user_controller import ControllerLike, UserController


def rate_means(
    scenario: Scenario,
    seeds: Sequence[int],
    *,
    every: int,
    block: int,
    controller: ControllerLike | None = None,
) -> NDArray[np.float64]:
    """Means of the nondimensional rate estimate, (seed, output), over `block` samples each, `every` steps apart.

    The samples are those of `simulate_many` with run.record_every = `every`. `controller`: as in `simulate_many`; it
    must report rate_estimate. A run that diverges is NaN throughout.
    """
    threads, setups = threads_available(), [setup for _, setup in setups_of([core_setup(scenario)], seeds, 1)]
    if controller is None:
        means, lasted = _core.rate_means(setups, every, block, threads, not is_ideal(scenario))
    else:
        means, lasted = UserController(controller).rate_means([scenario] * len(setups), setups, every, block, threads)
    return np.where(lasted[:, np.newaxis] > scenario.run.steps, means, np.nan)
