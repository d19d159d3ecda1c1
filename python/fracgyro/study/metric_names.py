"""The columns of metrics: name, words and unit of each. fracgyro.metrics says what they measure."""

from __future__ import annotations

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
}
