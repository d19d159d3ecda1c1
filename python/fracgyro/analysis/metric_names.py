"""Names of metrics, and label and unit of each column. metrics.py defines them."""

from __future__ import annotations

import difflib

# Label of each column, and its nondimensional unit in the core's notation.
COLUMNS = {
    **{
        f"rmse_{window}_{axis}": (f"RMS error of {axis}, {words}", "q0")
        for window, words in (("whole", "whole run"), ("transient", "transient"), ("steady", "steady"))
        for axis in "xy"
    },
    "chattering_x": ("chattering of u in x", "1"),
    "chattering_y": ("chattering of u in y", "1"),
    "effort_x": ("RMS force in x", "m*omega0^2*q0"),
    "effort_y": ("RMS force in y", "m*omega0^2*q0"),
    "bound_final_0": ("estimate of b0 at the end", "m*omega0^2*q0"),
    "bound_final_1": ("estimate of b1 at the end", "m*omega0^2"),
    "bound_final_2": ("estimate of b2 at the end", "m*omega0"),
    "error_settling_time": ("settling time of the error", "1/omega0"),
    "surface_settling_time": ("settling time of the surface", "1/omega0"),
    "rate_error": ("rate error at the end", "omega0"),
    "rate_error_rms": ("RMS rate error, steady", "omega0"),
    "rate_error_peak": ("largest rate error", "omega0"),
    "rate_settling_time": ("settling time of the rate", "1/omega0"),
    "damping_error": ("relative error of D at the end", "1"),
    "stiffness_error": ("relative error of K at the end", "1"),
    "bound_0_halfway": ("estimate of b0 halfway", "m*omega0^2*q0"),
    "largest_force": ("largest force", "m*omega0^2*q0"),
    "saturated_share": ("share of samples at the force limit", "1"),
}


def written(unit: str) -> str:
    """A nondimensional unit as text; empty for 1."""
    return "" if unit == "1" else unit.replace("omega0", "ω0").replace("^2", "²").replace("*", " ")


METRICS = {column: (words, written(unit)) for column, (words, unit) in COLUMNS.items()}
NAMES = (
    "rmse",
    "error_settling_time",
    "surface_settling_time",
    "chattering",
    "effort",
    "rate_error",
    "rate_error_rms",
    "rate_error_peak",
    "rate_settling_time",
    "damping_error",
    "stiffness_error",
    "bound_final",
    "bound_0_halfway",
    "largest_force",
    "saturated_share",
)


def columns(metric: str) -> list[str]:
    """The columns of a metric."""
    return [metric] if metric in COLUMNS else [name for name in COLUMNS if name.startswith(f"{metric}_")]


# Nondimensional units of each metric: one, or one per column.
UNITS = {name: tuple(dict.fromkeys(COLUMNS[column][1] for column in columns(name))) for name in NAMES}
UNITS["diverged_at"] = ("1/omega0",)


def nondimensional_unit(metric: str) -> str:
    """The units of a metric as text, separated by commas if its columns differ."""
    return ", ".join(map(written, UNITS[metric]))


def metric_hint(name: str) -> str:
    """Hint for an unknown name: the nearest column of METRICS, or all of them."""
    near = difflib.get_close_matches(name, METRICS)
    return f"did you mean {near[0]}?" if near else f"known are {', '.join(METRICS)}"
