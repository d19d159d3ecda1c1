"""The names of metrics: quantity of each, and words and unit of each column. metrics.py says what they measure."""

from __future__ import annotations

import difflib

METRICS = {
    **{
        f"rmse_{window}_{axis}": (f"RMS error of {axis}, {words}", "q0")
        for window, words in (("whole", "whole run"), ("transient", "transient"), ("steady", "steady"))
        for axis in "xy"
    },
    "chattering_x": ("chattering of u in x", ""),
    "chattering_y": ("chattering of u in y", ""),
    "effort_x": ("RMS force in x", "m ω0² q0"),
    "effort_y": ("RMS force in y", "m ω0² q0"),
    "bound_final_0": ("estimate of b0 at the end", "m ω0² q0"),
    "bound_final_1": ("estimate of b1 at the end", "m ω0²"),
    "bound_final_2": ("estimate of b2 at the end", "m ω0"),
    "error_settling_time": ("settling time of the error", "1/ω0"),
    "surface_settling_time": ("settling time of the surface", "1/ω0"),
    "rate_error": ("rate error at the end", "ω0"),
    "rate_error_rms": ("RMS rate error, steady", "ω0"),
    "rate_error_peak": ("largest rate error", "ω0"),
    "rate_settling_time": ("settling time of the rate", "1/ω0"),
    "damping_error": ("relative error of D at the end", ""),
    "stiffness_error": ("relative error of K at the end", ""),
    "bound_0_halfway": ("estimate of b0 halfway", "m ω0² q0"),
    "largest_force": ("largest force", "m ω0² q0"),
    "saturated_share": ("share of samples at the force limit", ""),
}

# The quantity of each metric, and its unit in SI.
UNITS = {
    "rmse": "length",
    "error_settling_time": "time",
    "surface_settling_time": "time",
    "chattering": "",
    "effort": "force",
    "rate_error": "rate",
    "rate_error_rms": "rate",
    "rate_error_peak": "rate",
    "rate_settling_time": "time",
    "damping_error": "",
    "stiffness_error": "",
    "bound_final": "",  # each its own
    "bound_0_halfway": "force",
    "largest_force": "force",
    "saturated_share": "",
    "diverged_at": "time",
}
SI = {"length": "m", "time": "s", "velocity": "m/s", "force": "N", "rate": "rad/s"}


def nondimensional_unit(metric: str) -> str:
    """Of a metric, which has one column or several; theirs one after the other where they differ."""
    columns = [metric] if metric in METRICS else [name for name in METRICS if name.startswith(f"{metric}_")]
    return ", ".join(dict.fromkeys(METRICS[name][1] for name in columns))


def metric_hint(name: str) -> str:
    """What may be meant by a name that is not a column of METRICS."""
    near = difflib.get_close_matches(name, METRICS)
    return f"did you mean {near[0]}?" if near else f"known are {', '.join(METRICS)}"
