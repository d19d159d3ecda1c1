"""Metrics of one run, or of many seeds, as a table and as JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Iterator
from typing import Any

from ..analysis.metric_names import UNITS, nondimensional_unit, written
from ..scenario import Scenario
from ..scenario.kinds import SINE_DRIVES, reports

STEADY = ["chattering", "rate_error_rms"]  # metrics of the steady window, like rmse steady
# Metrics that are known if the controller reports what they need, and others that need the same.
OF_REPORTS = {
    "rate_error": ("rate_error_rms", "rate_error_peak", "rate_settling_time"),
    "damping_error": (),
    "stiffness_error": (),
    "bound_final": ("bound_0_halfway",),
}
Cell = Callable[[Any], Any]  # a scalar variable -> its JSON


def reported(figures: Any, surface: bool) -> Any:
    """The metrics without those of channels that the controller does not report; `surface`: it reports a surface."""
    missing = [] if surface else ["surface_settling_time"]
    for known, others in OF_REPORTS.items():
        missing += [known, *others] if bool(figures[known].isnull().all()) else []
    return figures.drop_vars(missing)


def shown(figures: Any, steady: bool) -> Any:
    """The metrics without those of the steady window, unless the run reaches it."""
    return figures if steady else figures.drop_vars(STEADY, errors="ignore").sel(window=["whole", "transient"])


def followed(scenario: Scenario, figures: Any) -> list[Any]:
    """The metrics, without the errors of a conventional drive: its sine sets only amplitude and frequency.

    A vibration whose line turns has no axis to be at rest.
    """
    if scenario.controller.kind not in SINE_DRIVES:
        return [figures]
    rest = figures.drop_vars(["rmse", "error_settling_time"])
    turns = any(each.name == "pattern_angle" for each in reports(scenario.controller.kind)[0])
    return [rest] if turns else [figures[["rmse"]].sel(axis=["y"]), rest]


def left_out(scenario: Scenario, figures: Any, transient: float) -> str:
    """The reason why `shown` leaves metrics out."""
    *names, last = ["rmse steady", *(name for name in STEADY if name in figures)]
    needing = f"{', '.join(names)} and {last}"
    return f"run.duration is {scenario.run.duration:g}: {needing} need samples from {transient:g}/ω0 on."


def plain(values: Any, cell: Cell) -> Any:
    """Values for JSON: nested by the labels of every dimension but `run`."""
    dimension = next((name for name in values.dims if name != "run"), None)
    if dimension is None:
        return cell(values)
    labels = values[dimension].values
    return {str(label): plain(values.isel({dimension: place}), cell) for place, label in enumerate(labels)}


def of_one(values: Any) -> float | None:
    """The value of one run; NaN, which means never, becomes null."""
    number = float(values)
    return number if number == number else None


def of_seeds(values: Any) -> dict[str, Any]:
    """Mean and 95 % interval over the runs; null, with the number of such runs, if some never have the value."""
    from ..analysis.confidence import mean_interval

    never = int(sum(map(math.isnan, values.values)))
    if never:
        return {"mean": None, "low": None, "high": None, "never": never}
    found = mean_interval(values.values)
    return {"mean": found.mean, "low": found.low, "high": found.high}


def rows(figures: Iterable[Any], si: bool, cell: Cell) -> Iterator[tuple[str, str, str]]:
    """Rows of the table: metric, value, unit."""
    for name, values in (each for part in figures for each in part.items()):
        in_si = values.attrs.get("units") or values.attrs["column_units"]
        unit = in_si.removeprefix("1") if si else nondimensional_unit(name) if name in UNITS else written(in_si)
        text = json.dumps(plain(values, cell), default=str)
        cells = json.loads(text, parse_float=lambda number: f"{float(number):.6g}")
        yield str(name), _words(cells, values.sizes.get("run", 1)), unit


def _words(cells: Any, runs: int) -> str:
    if cells is None:
        return "never"
    if not isinstance(cells, dict):
        return str(cells)
    if "mean" in cells:
        if cells["mean"] is None:
            return "never" if cells["never"] == runs else f"never in {cells['never']} of {runs} runs"
        return f"{cells['mean']} [{cells['low']}, {cells['high']}]"
    nested = any(isinstance(inner, dict) and "mean" not in inner for inner in cells.values())
    parts = [
        f"{label}: {_words(inner, runs)}" if nested else f"{label} {_words(inner, runs)}"
        for label, inner in cells.items()
    ]
    return ("\n" if nested else ", ").join(parts)
