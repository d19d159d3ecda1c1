"""Metrics of recorded runs. Each takes a Dataset from `simulate` or `simulate_many`; times and bounds are in its units.

include/fracgyro/sim/metrics.hpp computes the same quantities without a record (`measure_many`); a test compares them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from .. import _core
from ..arguments import NO_NUMBERS, number, real, short
from ..scenario import Scenario, check_scenario
from ..scenario.kinds import AXES, ENTRIES
from ..scenario.scales import si_unit
from ..scenario.to_core import core_setup, only_laws
from ..scenario.volts_core import plant_at_bias
from ..simulation.dataset import metrics_dataset, units_of
from ..simulation.measure import measure_many
from ..simulation.user_controller import ControllerLike
from ..simulation.user_plant import PlantLike
from .metric_names import UNITS
from .scenarios import of_each, scale, time_unit
from .tasks import drive, frequency_response, step_response

__all__ = [
    "chattering",
    "cut",
    "damping_error",
    "drive",
    "effort",
    "frequency_response",
    "lyapunov",
    "rate_error",
    "rate_settling_time",
    "rmse",
    "saturated_share",
    "settling_time",
    "step_response",
    "stiffness_error",
    "summary",
    "surface_settling_time",
    "true_rate",
]

Window = tuple[float | None, float | None]
STEADY: Window = (10.0, None)  # nondimensional

# Nondimensional defaults, converted to the units of a run.
TRANSIENT, ERROR_BOUND, SURFACE_BOUND, RATE_TOLERANCE = 10.0, 0.01, 0.06, 0.1


def cut(run: xr.Dataset, window: Window) -> xr.Dataset:
    """The samples with window[0] <= t < window[1], in the unit of time of the run; None: no end.

    Raises ValueError if there are none.

    >>> fg.metrics.cut(fg.simulate(fg.Scenario.paper()), (10, None)).sizes["time"]
    70001
    """
    inside = _inside(run, window)
    if not inside.any():
        raise ValueError(f"window is {window}: the run has no sample in it")
    return run.isel(time=np.flatnonzero(inside))


def rmse(run: xr.Dataset, window: Window = (None, None)) -> xr.DataArray:
    """Root mean square of the tracking error over `axis`, in the unit of position; `window` as in `cut`.

    >>> run = fg.simulate(fg.Scenario.paper())
    >>> bool((fg.metrics.rmse(run, window=(10, None)) < 1e-4).all())
    True
    """
    return _rms(cut(run, window)["error"])


def settling_time(run: xr.Dataset, bound: float | None = None) -> xr.DataArray:
    """Time after which ‖e‖ stays within `bound` (unit of position; 0.01 q0 if left out); NaN if it never does.

    >>> float(fg.metrics.settling_time(fg.simulate(fg.Scenario.paper()))) < 5
    True
    """
    limit = ERROR_BOUND * scale(run, "q0") if bound is None else xr.DataArray(bound)
    return _settled(_size(run["error"]) <= limit, run["time"])


def surface_settling_time(run: xr.Dataset, bound: float | None = None) -> xr.DataArray:
    """Time after which ‖s‖ stays within `bound` (unit of velocity; 0.06 q0 ω0 if left out); NaN if it never does.

    >>> float(fg.metrics.surface_settling_time(fg.simulate(fg.Scenario.paper()))) < 5
    True
    """
    limit = SURFACE_BOUND * scale(run, "q0*omega0") if bound is None else xr.DataArray(bound)
    return _settled(_size(run["surface"]) <= limit, run["time"])


def chattering(run: xr.Dataset, window: Window | None = None) -> xr.DataArray:
    """RMS of the second difference of u between samples, relative to the RMS of u; over `axis`.

    `window`: as in `cut`; by default from t = 10 on, nondimensional.

    A smooth force of angular frequency w sampled every h gives (w h)²; one that alternates at every sample gives 4.

    >>> bool((fg.metrics.chattering(fg.simulate(fg.Scenario.paper())) < 0.01).all())
    True
    """
    force = cut(run, (TRANSIENT * time_unit(run), None) if window is None else window)["control"]
    bend = force.diff("time", n=2)
    return _rms(bend) / _rms(force)


def saturated_share(run: xr.Dataset) -> xr.DataArray:
    """Share of the samples in which the force of either axis is at controller.force_limit.

    >>> float(fg.metrics.saturated_share(fg.simulate(fg.Scenario.paper())))
    0.0
    """
    limit = of_each(run, lambda s: s.controller.force_limit) * scale(run, "m*omega0^2*q0")
    at_limit = abs(run["control"]) >= limit * (1 - 1e-12)  # unit conversion rounds
    found: xr.DataArray = at_limit.any("axis").mean("time")
    return found


def effort(run: xr.Dataset, window: Window = (None, None)) -> xr.DataArray:
    """Root mean square of the control force over `axis`, in the unit of force; `window` as in `cut`.

    >>> fg.metrics.effort(fg.simulate(fg.Scenario.paper())).round(-1).values.tolist()
    [250.0, 380.0]
    """
    return _rms(cut(run, window)["control"])


def rate_error(run: xr.Dataset) -> xr.DataArray:
    """Estimate of the angular rate minus the simulated value, over `time`, in the unit of rate.

    >>> run = fg.simulate(fg.Scenario.paper().replace({"adaptation.kind": "composite"}))
    >>> abs(float(fg.metrics.rate_error(run)[-1])) < 0.005
    True
    """
    return run["rate_estimate"] - true_rate(run)


def true_rate(run: xr.Dataset) -> xr.DataArray:
    """Simulated angular rate, in the unit of rate; over `time` for a dynamic rate.

    >>> float(fg.metrics.true_rate(fg.simulate(fg.Scenario.paper())))
    0.1
    """
    if "angular_rate" in run:
        return run["angular_rate"]
    return of_each(run, lambda s: s.plant.nondimensional()[2]) * scale(run, "omega0")


def rate_settling_time(run: xr.Dataset, tolerance: float = 0.1) -> xr.DataArray:
    """Time after which the rate estimate stays within `tolerance` of the simulated rate; NaN if it never does.

    `tolerance` is relative to the simulated rate, or to the largest magnitude of a dynamic rate.

    >>> run = fg.simulate(fg.Scenario.paper().replace({"adaptation.kind": "composite"}))
    >>> float(fg.metrics.rate_settling_time(run)) < 10
    True
    """
    size = abs(true_rate(run))
    size = size.max("time") if "time" in size.dims else size
    return _settled(abs(rate_error(run)) <= tolerance * size, run["time"])


def damping_error(run: xr.Dataset) -> xr.DataArray:
    """‖D̂ - D‖/‖D‖ over `time` (Frobenius norms); D includes plant.damping_deviation.

    >>> round(float(fg.metrics.damping_error(fg.simulate(fg.Scenario.paper()))[0]), 3)
    0.05
    """
    truth = of_each(run, lambda s: _true_matrices(s)[0], "entry") * scale(run, "m*omega0")
    if "damping_drift" in run:
        truth = truth * (1.0 + run["damping_drift"]) + _by_entries(run, 0) * scale(run, "m*omega0")
    return _relative(run["damping_estimate"], truth)


def stiffness_error(run: xr.Dataset) -> xr.DataArray:
    """‖K̂ - K‖/‖K‖ over `time` (Frobenius norms); K includes plant.stiffness_deviation.

    >>> round(float(fg.metrics.stiffness_error(fg.simulate(fg.Scenario.paper()))[0]), 3)
    0.05
    """
    truth = of_each(run, lambda s: _true_matrices(s)[1], "entry") * scale(run, "m*omega0^2")
    if "stiffness_drift" in run:
        truth = truth * (1.0 + run["stiffness_drift"]) + _by_entries(run, 1) * scale(run, "m*omega0^2")
    return _relative(run["stiffness_estimate"], truth)


def lyapunov(run: xr.Dataset, bounds: tuple[float, float, float]) -> xr.DataArray:
    """V of eq. (39) over `time`, for a nondimensional run and the true bounds (b0, b1, b2) of eq. (12).

    V = ½ sᵀs + tr(D̃M⁻¹D̃ᵀ)/2 + tr(K̃N⁻¹K̃ᵀ)/2 + tr(Ω̃P⁻¹Ω̃ᵀ)/2 + ½ Σ b̃ᵢ²/xᵢ. Raises ValueError for a run in SI units,
    or with another adaptation.kind than gradient.

    >>> run = fg.simulate(fg.Scenario.paper().replace({"disturbance.kind": "none"}))
    >>> v = fg.metrics.lyapunov(run, bounds=(2.0, 1.0, 1.0))
    >>> bool(v[-1] < v[0])
    True
    """
    if run.attrs.get("units") != "nondimensional":
        raise ValueError(f"units is {run.attrs.get('units')}: V of eq. (39) requires a nondimensional run")
    if other := max(of_each(run, lambda s: "" if only_laws(s) else s.adaptation.kind).values.flat):
        raise ValueError(f"adaptation.kind is {other}: it must be gradient for V of eq. (39)")
    weights = xr.DataArray([1.0, 2.0, 1.0], dims="entry")  # xy occurs twice in the matrix
    d = run["damping_estimate"] - of_each(run, lambda s: _true_matrices(s)[0], "entry")
    k = run["stiffness_estimate"] - of_each(run, lambda s: _true_matrices(s)[1], "entry")
    symmetric = run["rate_symmetric_estimate"]
    rate = 2.0 * rate_error(run) ** 2 + (weights * symmetric**2).sum("entry")
    b = run["bound_estimate"] - xr.DataArray(list(bounds), dims="bound")
    x = of_each(run, lambda s: s.adaptation.bound_gain, "bound")
    found: xr.DataArray = 0.5 * (
        (run["surface"] ** 2).sum("axis")
        + (weights * d**2).sum("entry") / of_each(run, lambda s: s.adaptation.damping_gain)
        + (weights * k**2).sum("entry") / of_each(run, lambda s: s.adaptation.stiffness_gain)
        + rate / of_each(run, lambda s: s.adaptation.rate_gain)
        + (b**2 / x).sum("bound")
    )
    return found


def summary(
    run: xr.Dataset,
    transient: float | None = None,
    error_bound: float | None = None,
    surface_bound: float | None = None,
    rate_tolerance: float = RATE_TOLERANCE,
) -> xr.Dataset:
    """All metrics of a run as one row, with the names of `measure_many`.

    Metrics of channels that the controller does not report are NaN.

    `transient`, `error_bound` and `surface_bound` are in the units of the run; by default they are 10, 0.01 and 0.06,
    nondimensional. The run should be recorded at every step: with run.record_every > 1 the metrics are estimates, and
    chattering is wrong. Raises TypeError or ValueError for a bound that is not a positive number.

    >>> sorted(fg.metrics.summary(fg.simulate(fg.Scenario.paper())))[:3]
    ['bound_0_halfway', 'bound_final', 'chattering']
    """
    transient = TRANSIENT * time_unit(run) if transient is None else number("transient", transient, least=0.0)
    for threshold, bound in {"error_bound": error_bound, "surface_bound": surface_bound}.items():
        if bound is not None:
            number(threshold, bound, above=0.0)
    number("rate_tolerance", rate_tolerance, above=0.0)
    early, late = (None, transient), (transient, None)
    windows: dict[str, Window] = {"whole": (None, None), "transient": early, "steady": late}
    run = run.assign({name: _nothing(run, name) for name in NOT_OF_ALL if name not in run})
    off = rate_error(run)
    run = run.assign(off=off)
    half = 0.5 * float(run["time"][-1])
    figures = xr.Dataset(
        {
            "rmse": xr.concat([_or_nan(rmse, run, w) for w in windows.values()], dim="window").assign_coords(
                window=list(windows)
            ),
            "error_settling_time": settling_time(run, error_bound),
            "surface_settling_time": surface_settling_time(run, surface_bound),
            "chattering": _or_nan(chattering, run, late),
            "effort": effort(run),
            "rate_error": off.isel(time=-1, drop=True),
            "rate_error_rms": _or_nan(lambda r, w: _rms(cut(r, w)["off"]), run, late),
            "rate_error_peak": abs(off).max("time"),
            "rate_settling_time": rate_settling_time(run, rate_tolerance),
            "damping_error": damping_error(run).isel(time=-1, drop=True),
            "stiffness_error": stiffness_error(run).isel(time=-1, drop=True),
            "bound_final": run["bound_estimate"].isel(time=-1, drop=True),
            "bound_0_halfway": run["bound_estimate"].sel(bound=0, time=slice(None, half)).isel(time=-1, drop=True),
            "largest_force": abs(run["control"]).max(["time", "axis"]),
            "saturated_share": saturated_share(run),
        }
    )
    for name, values in figures.items():
        values.attrs = units_of([si_unit(unit) for unit in UNITS[str(name)]] if run.attrs["units"] == "SI" else ["1"])
    return figures


# Channels that not every controller reports, with the dimension and labels of their columns.
NOT_OF_ALL: dict[str, tuple[str, list[str] | list[int]] | None] = {
    "surface": ("axis", AXES),
    "damping_estimate": ("entry", ENTRIES),
    "stiffness_estimate": ("entry", ENTRIES),
    "rate_estimate": None,
    "bound_estimate": ("bound", [0, 1, 2]),
}


def _nothing(run: xr.Dataset, name: str) -> xr.DataArray:
    columns = NOT_OF_ALL[name]
    nothing = xr.full_like(run["error"].isel(axis=0, drop=True), np.nan).assign_attrs(units="1")
    if columns is None:
        return nothing
    dimension, labels = columns
    return nothing.expand_dims({dimension: labels})


def measured(
    scenario: Scenario, controller: ControllerLike | None = None, plant: PlantLike | None = None
) -> xr.Dataset:
    """`summary` of a run of the scenario, in memory that does not grow with its length.

    `controller`, `plant`: as in `simulate`. Also has `diverged_at`, up to which a diverged run is measured; NaN for
    other runs.
    """
    check_scenario(scenario)
    if controller is None and plant is None:
        values = _core.measure_device_runs([core_setup(scenario)], _core.MetricsParams())[0]
        rows = metrics_dataset(values[np.newaxis], {})
    else:
        rows = measure_many([scenario], controller=controller, plant=plant)
    return in_units(scenario, rows).isel(run=0)


def in_units(scenario: Scenario, rows: xr.Dataset) -> xr.Dataset:
    """Rows of `measure_many` in the units of the scenario's runs."""
    rows = rows[list(UNITS)]
    if scenario.run.units == "SI":
        for figure, units in UNITS.items():
            factors = [scenario.plant.scales.of(unit) for unit in units]
            rows[figure] = rows[figure] * (factors if len(factors) > 1 else factors[0])
            rows[figure].attrs = units_of([si_unit(unit) for unit in units])
    return rows


def _or_nan(metric: Callable[[xr.Dataset, Window], xr.DataArray], run: xr.Dataset, window: Window) -> xr.DataArray:
    """The metric; NaN if the run has no sample in the window."""
    return metric(run, window) if _inside(run, window).any() else metric(run, (None, None)) * np.nan


def _inside(run: xr.Dataset, window: Window) -> NDArray[np.bool_]:
    rule = f"window is {short(window)}: it must be (from, until), two numbers, or None for an open end"
    if not isinstance(window, Sequence | np.ndarray) or isinstance(window, NO_NUMBERS) or len(window) != 2:
        raise ValueError(rule)
    try:
        start, end = (None if edge is None else real("window", edge) for edge in window)
    except TypeError:
        raise ValueError(rule) from None
    if any(edge is not None and math.isnan(edge) for edge in (start, end)):
        raise ValueError(rule)
    time = run["time"].values
    return (time >= (-np.inf if start is None else start)) & (time < (np.inf if end is None else end))


def _size(values: xr.DataArray) -> xr.DataArray:
    return (values**2).sum("axis", skipna=False) ** 0.5


def _rms(values: xr.DataArray) -> xr.DataArray:
    """Root mean square over `time`; NaN without samples."""
    squares = values**2
    return (squares.mean("time", skipna=False) if values.sizes["time"] else squares.sum("time") * np.nan) ** 0.5


def _settled(inside: xr.DataArray, time: xr.DataArray) -> xr.DataArray:
    """Time of the first sample from which `inside` is true to the end; NaN if none."""
    outside = ~inside.transpose(..., "time").values
    last = outside.shape[-1] - 1 - np.argmax(outside[..., ::-1], axis=-1)
    first = np.where(outside.any(axis=-1), last + 1, 0)
    times = np.append(time.values, np.nan)
    dimensions = [d for d in inside.dims if d != "time"]
    return xr.DataArray(times[first], dims=dimensions)


def _relative(estimate: xr.DataArray, truth: xr.DataArray) -> xr.DataArray:
    weights = xr.DataArray([1.0, 2.0, 1.0], dims="entry")
    off = (weights * (estimate - truth) ** 2).sum("entry", skipna=False)
    return (off / (weights * truth**2).sum("entry")) ** 0.5


def _by_entries(run: xr.Dataset, of: int) -> xr.DataArray:
    """Change of D (0) or K (1) with temperature at each time, beyond their common growth, nondimensional."""

    def warmer(scenario: Scenario) -> NDArray[np.float64]:
        scale = 1.0 if run.attrs["units"] == "SI" else scenario.plant.scales.time
        end = scenario.run.duration * scenario.plant.scales.time
        times, changes = np.transpose(scenario.device.temperature(end))
        return np.asarray(np.interp(scale * run["time"].values, times, changes))

    with np.errstate(over="ignore"):  # a drift near the largest double is infinite per kelvin
        drift = of_each(run, lambda s: s.device.drifts(*_true_matrices(s))[of], "entry")
    return drift * of_each(run, warmer, "time") if drift.any() else xr.DataArray(0.0)


def _true_matrices(scenario: Scenario) -> tuple[np.ndarray, np.ndarray]:
    """D and K, nondimensional, with their deviations."""
    damping, stiffness, _, more_damping, more_stiffness = plant_at_bias(scenario).nondimensional()
    return damping + more_damping, stiffness + more_stiffness
