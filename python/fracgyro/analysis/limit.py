"""The physical limit of tracking: the least error that any controller can have, for a linear scenario.

It is computed, not simulated, and takes well below a second; limit_law.py and limit_start.py have the derivation.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ..arguments import NO_NUMBERS, number, real, short
from ..scenario import Scenario, check_scenario
from ..scenario.kinds import AXES
from ..scenario.scales import si_unit
from ..simulation.dataset import VERSION, time_scale, units_of
from .limit_law import Estimate, Law
from .limit_model import Feedforward, Model, assumptions
from .limit_start import transient_error
from .metrics import TRANSIENT

__all__ = ["tracking"]


def tracking(
    scenario: Scenario,
    chattering: float | Sequence[float] | NDArray[np.float64] | None = None,
    *,
    transient: float | None = None,
) -> xr.Dataset:
    """The least errors of any controller that knows the plant, the noise and the reference, in the units of run.units.

    `chattering`: the ceiling of `fg.metrics.chattering` on either axis; several make a dimension; None: no ceiling.
    `transient`: the time from which on errors are steady, in the unit of time of the runs; by default 10,
    nondimensional. Controller and adaptation of the scenario have no effect, except controller.force_limit.

    Variables, over `axis`: `rmse_steady`, the RMS error after a long time, and `chattering_reached`, both also over
    `chattering` if several are given; `rmse_transient`, that before `transient`, of a run without noise within the
    force limit; `filter_error`, that of the best estimate of the position. `price`: rho of the law, in squares of the
    unit of position. The attribute `assumptions` has one statement per line.

    The steady law minimizes the sum of the squares of both axes: the error of one axis could be a few percent smaller
    at the expense of the other.

    Raises ScenarioError for a scenario without a limit: a nonlinear or varying plant, a disturbance other than white
    noise, a force limit below the force that the reference needs. Raises TypeError or ValueError for another invalid
    argument, among them a ceiling that no law keeps.

    >>> limit = fg.limit.tracking(fg.Scenario.paper(), chattering=[0.0035, 0.05])
    >>> limit["rmse_steady"].sel(axis="x").values.round(9).tolist()
    [2.173e-06, 5.78e-07]
    """
    check_scenario(scenario)
    ceilings = _ceilings(chattering)
    unit = time_scale(scenario)
    until = TRANSIENT if transient is None else number("transient", transient, least=0.0) / unit
    model = Model.of(scenario)
    feedforward = Feedforward.of(scenario, model, until)
    estimate = Estimate.of(model)
    law = Law(model, feedforward, estimate)
    found = [law.within(ceiling) for ceiling in ceilings.ravel().tolist()]
    shape, dims = ceilings.shape, ["chattering"] * ceilings.ndim
    length = scenario.plant.scales.length if scenario.run.units == "SI" else 1.0
    figures = {
        "rmse_steady": ([*dims, "axis"], length * np.reshape([each.error for each in found], (*shape, 2)), "q0"),
        "chattering_reached": ([*dims, "axis"], np.reshape([each.chattering for each in found], (*shape, 2)), "1"),
        "price": (dims, length**2 * np.reshape([each.price for each in found], shape), "q0^2"),
        "rmse_transient": (["axis"], length * _transient(scenario, until), "q0"),
        "filter_error": (["axis"], length * np.sqrt(np.diag(estimate.present)[:2]), "q0"),
    }
    si = scenario.run.units == "SI"
    variables = {
        name: (dimensions, values, units_of([si_unit(of) if si else "1"]))
        for name, (dimensions, values, of) in figures.items()
    }
    attributes = {
        "scenario": scenario.to_toml(),
        "version": VERSION,
        "units": scenario.run.units,
        "assumptions": "\n".join(assumptions(scenario)),
    }
    return xr.Dataset(variables, coords={"axis": AXES, "chattering": (dims, ceilings)}, attrs=attributes)


@lru_cache(maxsize=32)
def _transient(scenario: Scenario, until: float) -> NDArray[np.float64]:
    """Kept, as it does not depend on the ceiling."""
    return transient_error(scenario, Model.of(scenario), until)


def _ceilings(chattering: object) -> NDArray[np.float64]:
    if chattering is None:
        return np.array(math.inf)
    several = isinstance(chattering, Sequence | np.ndarray) and not isinstance(chattering, NO_NUMBERS)
    given = np.asarray(chattering, dtype=object)
    if several and (given.ndim != 1 or not given.size):
        raise ValueError(f"chattering is {short(chattering)}: it must be a number, a list of numbers, or None")
    for value in given.ravel():
        if not real("chattering", value) > 0.0:
            raise ValueError(f"chattering is {short(value)}: it must be greater than 0")
    return np.asarray(given, dtype=float)
