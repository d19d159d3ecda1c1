"""Simulation: scenarios in, xarray Datasets out."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from importlib.metadata import version
from itertools import islice
from typing import Any

import numpy as np
import xarray as xr

from . import _core, bounded
from .arguments import check_scenario, number, short
from .scenario import Scenario
from .setup import composite, core_setup, is_ideal

AXES = ["x", "y"]
ENTRIES = ["xx", "xy", "yy"]
# Runs between two looks at the keyboard and the progress callback: recorded; measured, by their steps and at most.
CHUNK, CHUNK_STEPS, CHUNK_RUNS = 32, 20_000_000, 4096
LARGEST_RECORD = 2 * 10**9  # bytes; a limit that depends on no machine, as its memory does
TOGETHER = 32  # scenarios whose runs with the same seed share its noise, which is then drawn once

# channel: (dimension of its columns or None, symbol and meaning, scale and unit in SI)
CHANNELS: dict[str, tuple[str | None, str, list[tuple[str, str]]]] = {
    "position": ("axis", "position q", [("length", "m")]),
    "velocity": ("axis", "velocity v", [("velocity", "m/s")]),
    "reference": ("axis", "reference r", [("length", "m")]),
    "error": ("axis", "tracking error e = q - r", [("length", "m")]),
    "error_rate": ("axis", "rate of the tracking error", [("velocity", "m/s")]),
    "surface": ("axis", "sliding surface s", [("velocity", "m/s")]),
    "control": ("axis", "control force u", [("force", "N")]),
    "disturbance": ("axis", "disturbance force d", [("force", "N")]),
    "damping_estimate": ("entry", "estimate of the damping D", [("damping", "N s/m")]),
    "stiffness_estimate": ("entry", "estimate of the stiffness K", [("stiffness", "N/m")]),
    "rate_estimate": (None, "estimate of the angular rate: skew part of Omega", [("rate", "rad/s")]),
    "rate_symmetric_estimate": (
        "entry",
        "symmetric part of the estimate of Omega; not zero under the printed law only",
        [("rate", "rad/s")],
    ),
    "bound_estimate": (
        "bound",
        "estimates of the bounds b0, b1, b2",
        [("force", "N"), ("stiffness", "N/m"), ("damping", "N s/m")],
    ),
    "rate_deviation": (
        None,
        "standard deviation of the estimate of the angular rate; 0 without data",
        [("rate", "rad/s")],
    ),
    "rate_trusted": (None, "1 where the motion tells the angular rate from the other parameters", [("one", "1")]),
}
OF_COMPOSITE = ["rate_deviation", "rate_trusted"]  # channels that only composite adaptation has
# Further ones of runs whose rate moves or whose device is not ideal
DEVICE_CHANNELS: dict[str, tuple[str | None, str, list[tuple[str, str]]]] = {
    "angular_rate": (None, "angular rate Omega_z", [("rate", "rad/s")]),
    "stiffness_drift": (None, "what the stiffness has grown by, as a fraction", [("one", "1")]),
    "measured_position": ("axis", "position as the controller has it", [("length", "m")]),
    "measured_velocity": ("axis", "velocity as the controller has it, measured or observed", [("velocity", "m/s")]),
    "applied_control": ("axis", "force that the actuator gives for u", [("force", "N")]),
}
COORDINATES = {"axis": AXES, "entry": ENTRIES, "bound": [0, 1, 2]}


class DivergedError(ValueError):
    """The run left all bounds. `run` holds what was computed until then."""

    def __init__(self, scenario: Scenario, time: float, run: xr.Dataset) -> None:
        step = scenario.run.step
        shorter = f"try run.step = {step / 2:g} or less, or smaller gains"
        why = f"run.step is {step:g}, which is too long for these gains; {shorter}"
        if grown := bounded.cause(scenario, run):
            gain, b = grown
            why = (
                f"the bound estimates had grown to [{', '.join(f'{each:.3g}' for each in b)}], so that rho h/delta "
                f"was {gain:.3g}, and from about 2 on the sampled loop is unstable; "
                "controller.switching_limit = 0.5 bounds them"
            )
        super().__init__(f"the run diverged at t = {time:.6g}: {why}")
        self.run = run


def threads_available() -> int:
    """Processors this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def simulate(scenario: Scenario) -> xr.Dataset:
    """One closed-loop run.

    Returns a Dataset with the variables of `CHANNELS` over `time` (and axis, entry or bound), sampled every
    `scenario.run.record_every` steps, in the units that `scenario.run.units` names. Position, velocity and error are
    the true ones. With adaptation.kind composite the estimates of D, K and Omega_z are those of its least squares,
    which the force believes from when rate_trusted is first true; rate_deviation and rate_trusted say how well Omega_z
    is known; with gradient, which does not know, there are no such variables. Those of `DEVICE_CHANNELS` are there when
    [rate] moves or [device] is not the ideal one.
    Raises DivergedError, which carries the samples until then, when the motion leaves all bounds.
    """
    check_scenario(scenario)
    _check_size([scenario], 1)
    rows, lasted = _core.record_runs([core_setup(scenario)], scenario.run.record_every, 1, not is_ideal(scenario))
    samples = int(lasted[0])
    if samples <= scenario.run.steps:
        kept = -(-samples // scenario.run.record_every)
        run = _dataset(rows[0, :kept], scenario)
        raise DivergedError(scenario, samples * scenario.run.step, _known(run, [scenario]))
    return _known(_dataset(rows[0], scenario), [scenario])


def simulate_many(
    scenarios: Sequence[Scenario],
    *,
    seeds: Sequence[int] | None = None,
    metrics_only: bool = False,
    single_precision: bool = False,
    transient: float = 10.0,
    error_bound: float = 0.01,
    surface_bound: float = 0.06,
    rate_tolerance: float = 0.1,
    progress: Callable[[int], object] | None = None,
) -> xr.Dataset:
    """Many runs on all processors.

    With `seeds`: every scenario once with each of these values of disturbance.seed in place of its own; the runs of the
    first scenario come first, and a coordinate `seed` says which is which.
    Without `metrics_only`: the variables of `simulate` with a leading `run` dimension; all scenarios must then share
    run.duration, run.step, run.record_every and run.units. A run that diverges holds NaN from then on.
    With `metrics_only`: the metrics of each run (see `fracgyro.metrics.summary`, whose parameters `transient` to
    `rate_tolerance` are), nondimensional, in memory that does not grow with the length of the runs. A run that
    diverges is measured until then. Runs then go side by side in the lanes of a register (docs/decisions/0011): the
    metrics are those of `simulate` to rounding, and the same whatever the number of processors. Where the loop itself
    magnifies rounding, as it does with controller.terminal_exponent below some 0.35, they differ as much as those of
    two runs whose gains differ in the last place do: by percents.
    `single_precision`, with `metrics_only`: twice as many runs in a register. Metrics of a run then differ by some
    percent, their means over seeds by less (docs/decisions/0011 has figures).
    Runs whose rate moves or whose device is not ideal go one by one, in double precision (docs/decisions/0017).
    In both, `diverged_at` says when a run diverged and is NaN for the others.
    `progress` is called with the number of runs finished since the last call.
    Raises TypeError when `scenarios` is no list of scenarios or `seeds` no list of integers; ValueError when one of
    them is empty, a seed is given twice or outside 0 to 2^63 - 1, `single_precision` comes without `metrics_only` or,
    without `metrics_only`, the scenarios do not match.
    """
    if not isinstance(scenarios, list | tuple) or not all(isinstance(s, Scenario) for s in scenarios):
        raise TypeError(f"scenarios is {short(scenarios)}: it must be a list of Scenario")
    if not scenarios:
        raise ValueError("scenarios is empty: there is nothing to simulate")
    first = scenarios[0]
    if seeds is not None:
        _check_seeds(seeds)
    if not metrics_only:
        if single_precision:
            raise ValueError("single_precision is True without metrics_only: recorded runs are in double precision")
        _check_alike(scenarios)
        _check_size(scenarios, 1 if seeds is None else len(seeds))
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
    device = not all(map(is_ideal, scenarios))
    threads, lanes = threads_available(), _core.lane_counts()[-1]
    parts, lasted = [], []
    places: list[int] = []
    waiting = _setups(scenarios, seeds, TOGETHER if metrics_only else 1)
    # Of the scenarios alone, never of the machine: what runs side by side changes results in the last places.
    chunk = min(max(CHUNK, CHUNK_STEPS // first.run.steps), CHUNK_RUNS) if metrics_only else CHUNK
    while taken := list(islice(waiting, chunk)):
        setups = [setup for _, setup in taken]
        if metrics_only:
            places.extend(place for place, _ in taken)
            parts.append(_core.measure_runs(setups, params, threads, lanes, single_precision))
        else:
            rows, samples = _core.record_runs(setups, first.run.record_every, threads, device)
            parts.append(rows)
            lasted.append(samples)
        if progress:
            progress(len(setups))
    whole = parts[0] if len(parts) == 1 else np.concatenate(parts)
    label: dict[str, Any] = {} if seeds is None else {"seed": ("run", np.tile(np.array(seeds), len(scenarios)))}
    if metrics_only:
        whole = whole[np.argsort(places)]
        return metrics_dataset(whole, thresholds).assign_coords(label)
    run = _dataset(whole, first)
    samples = np.concatenate(lasted)
    time = np.where(samples > first.run.steps, np.nan, samples * first.run.step)
    run["diverged_at"] = ("run", time * _time_scale(first), {"long_name": "time of divergence"})
    run = _known(run, scenarios, 1 if seeds is None else len(seeds))
    del run.attrs["scenario"]
    texts = np.repeat([s.to_toml() for s in scenarios], 1 if seeds is None else len(seeds))
    return run.assign_coords(scenario=("run", texts), **label)


def _setups(
    scenarios: Sequence[Scenario], seeds: Sequence[int] | None, together: int
) -> Iterator[tuple[int, _core.DeviceSetup]]:
    """Every run and its place in the result. Of so many scenarios at a time, those with the same seed come together."""
    if seeds is None:
        yield from enumerate(map(core_setup, scenarios))
        return
    for first in range(0, len(scenarios), together):
        setups = [core_setup(scenario) for scenario in scenarios[first : first + together]]
        for at, seed in enumerate(seeds):
            for i, setup in enumerate(setups, first):
                seeded, disturbance = _core.DeviceSetup(setup), _core.DisturbanceParams(setup.disturbance)
                disturbance.seed = int(seed)
                seeded.disturbance = disturbance
                yield i * len(seeds) + at, seeded


def _check_seeds(seeds: Sequence[int]) -> None:
    if not isinstance(seeds, Sequence | np.ndarray) or isinstance(seeds, str | bytes | bytearray | memoryview):
        raise TypeError(f"seeds is {short(seeds)}: it must be a list of seeds, as range(8) is")
    if not len(seeds):
        raise ValueError("seeds is empty: there is nothing to simulate")
    if len(set(seeds)) < len(seeds):
        raise ValueError("seeds holds a seed twice: they must be different")
    for seed in seeds:
        if isinstance(seed, bool) or not (isinstance(seed, int | np.integer) and 0 <= seed < 2**63):
            raise ValueError(f"seeds holds {short(seed)}: every seed must be an integer from 0 to 2^63 - 1")


def _check_alike(scenarios: Sequence[Scenario]) -> None:
    for field in ("duration", "step", "record_every", "units"):
        values = {getattr(s.run, field) for s in scenarios}
        if len(values) > 1:
            raise ValueError(
                f"run.{field} is {' and '.join(map(str, sorted(values)))}: "
                "it must be the same in all scenarios unless metrics_only is true"
            )


def _check_size(scenarios: Sequence[Scenario], times: int) -> None:
    """Raises ValueError when the record of every scenario, so many times, would be larger than is allowed."""
    run, runs = scenarios[0].run, len(scenarios) * times
    ideal = all(map(is_ideal, scenarios))
    columns = sum(width for _, width in _core.channels + (() if ideal else _core.device_channels))
    samples = run.steps // run.record_every + 1
    if (size := 8 * columns * samples * runs) > LARGEST_RECORD:
        raise ValueError(
            f"run.record_every is {run.record_every}: {runs} runs of {samples} samples of {columns} numbers are "
            f"{size / 1e9:.3g} GB, and a record may be at most {LARGEST_RECORD / 1e9:g} GB; make it larger, take fewer "
            "runs at a time, or have simulate_many with metrics_only measure them without a record"
        )


def _time_scale(scenario: Scenario) -> float:
    return scenario.plant.scales.time if scenario.run.units == "SI" else 1.0


def _dataset(rows: np.ndarray, scenario: Scenario) -> xr.Dataset:
    """Rows (..., sample, column) as a Dataset; every variable is a view of them unless units must change."""
    si = scenario.run.units == "SI"
    scales = scenario.plant.scales
    leading = ["run"] * (rows.ndim - 2)
    variables = {}
    column = 0
    narrow = sum(width for _, width in _core.channels) == rows.shape[-1]
    recorded = _core.channels if narrow else _core.channels + _core.device_channels
    for name, width in recorded:
        dimension, meaning, units = (CHANNELS | DEVICE_CHANNELS)[name]
        values = rows[..., column : column + width] if dimension else rows[..., column]
        if si:
            factors = [getattr(scales, scale) for scale, _ in units]
            values = values * (factors if len(factors) > 1 else factors[0])
        unit = ", ".join(u for _, u in units) if si else "1"
        dimensions = [*leading, "time", *([dimension] if dimension else [])]
        variables[name] = (dimensions, values, {"long_name": meaning, "units": unit})
        column += width
    step = scenario.run.step * scenario.run.record_every
    time = np.arange(rows.shape[-2]) * step * _time_scale(scenario)
    attributes = {"long_name": "time", "units": "s" if si else "1"}
    return xr.Dataset(
        variables,
        coords={"time": ("time", time, attributes), **COORDINATES},
        attrs={
            "scenario": scenario.to_toml(),
            "version": version("fracgyro"),
            "units": scenario.run.units,
        },
    )


def _known(run: xr.Dataset, scenarios: Sequence[Scenario], times: int = 1) -> xr.Dataset:
    """What the runs cannot tell is left out, or NaN where others can. `times`: runs of each scenario."""
    knowing = np.repeat([composite(scenario) for scenario in scenarios], times)
    if not knowing.any():
        return run.drop_vars(OF_COMPOSITE)
    if not knowing.all():
        for name in OF_COMPOSITE:
            run[name] = run[name].where(xr.DataArray(knowing, dims="run"))
    return run


def metrics_dataset(values: np.ndarray, thresholds: dict[str, float]) -> xr.Dataset:
    by_name = dict(zip(_core.metric_names, values.T, strict=True))
    windows = ["whole", "transient", "steady"]
    rmse = np.stack([[by_name.pop(f"rmse_{w}_{a}") for a in AXES] for w in windows])
    grouped = {"rmse": (["run", "window", "axis"], np.moveaxis(rmse, -1, 0))}
    for name in ("chattering", "effort"):
        grouped[name] = (["run", "axis"], np.stack([by_name.pop(f"{name}_{a}") for a in AXES], axis=-1))
    bounds = np.stack([by_name.pop(f"bound_{i}") for i in range(3)], axis=-1)
    grouped["bound_final"] = (["run", "bound"], bounds)
    figures = xr.Dataset(
        {**grouped, **{name: ("run", column) for name, column in by_name.items()}},
        coords={"window": windows, "axis": AXES, "bound": COORDINATES["bound"]},
        attrs={"version": version("fracgyro"), "units": "nondimensional", **thresholds},
    )
    for variable in figures.data_vars.values():
        variable.attrs["units"] = "1"
    return figures
