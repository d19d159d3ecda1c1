"""Contenders of the task `rate`.

The drive's frequency is 1 in all units here. Ranges are those of the literature or of a first coarse search, widened
where a best value lay at an end. The rate estimate of adaptive super-twisting and of the nonsingular surfaces is by the
same law (44) as those of `paper` and `linear`.
"""

from __future__ import annotations

import math
from typing import Any

from .contender import Contender, Gain
from .track_contenders import BATUR, EXPONENT, HOROWITZ, ORDER, ORIGINAL, STABLE, ZHENG, kind

REBALANCE = "force_rebalance"  # the reference of all ratios
BY_PERIOD = "0.8 over the step, where the sampled loop is unstable"
LELAND = "Leland, doi 10.1109/JSEN.2005.844538 (abstract read)"

# Solved for in each trial, so that all have the same bandwidth.
OUTPUT = Gain("controller.output_bandwidth", 1e-4, 10.0)
DEMODULATED = Gain("controller.rate_bandwidth", 1e-4, 10.0)
LAW = Gain("adaptation.rate_gain", 1e-5, 100.0)
FORGETTING = Gain("adaptation.rate_forgetting", 1e-4, 10.0)

FRACTIONAL_GAIN = Gain("controller.fractional_gain", 0.01, 20.0, above="1 over the step")
TERMINAL_GAIN = Gain("controller.terminal_gain", 1e-4, 10.0, below="0 is the law without it")
LAYER = Gain("controller.layer_thickness", 1e-5, 1.0, above="the limit of the force ends before the layer")
RHO = Gain("adaptation.initial_bound", 0.05, 16.0, shape=(1.0, 0.0, 0.0), times=LAYER.field, above=BY_PERIOD)
LEARNS = Gain(
    "adaptation.damping_gain", 1e-5, 10.0, also=("adaptation.stiffness_gain",), below="0 learns neither D nor K"
)
OBSERVER = Gain("controller.observer_bandwidth", 0.2, 16.0, above=BY_PERIOD)
FREQUENCY = Gain("controller.natural_frequency", 1e-3, 10.0, above=BY_PERIOD)
PID = (FREQUENCY, Gain("controller.damping_ratio", 0.1, 10.0), Gain("controller.integral_frequency", 1e-6, 1.0))
CONSTANT_BOUND: dict[str, Any] = {"adaptation.bound_gain": (1e-12, 1e-12, 1e-12)}

DRIVE = (
    Gain("controller.pll_bandwidth", 1e-3, 0.1),
    Gain("controller.amplitude_bandwidth", 1e-3, 0.5),
    Gain("controller.amplitude_integral", 1e-4, 0.1, below="0 is the control without it"),
    Gain("controller.demodulation_bandwidth", 0.02, 2.0),
)
# One axis is driven, and the other starts at rest.
ONE_AXIS: dict[str, Any] = {"reference.amplitude": (1.0, 0.0), "run.initial_position": (0.0, 0.0)}

SURFACE = (ORDER, FRACTIONAL_GAIN, TERMINAL_GAIN, EXPONENT, LAYER, RHO)
CONTENDERS = (
    Contender(
        REBALANCE,
        "force rebalance with PLL and AGC",
        LELAND,
        kind("force_rebalance") | ONE_AXIS,
        (*DRIVE, Gain("controller.rebalance_bandwidth", 2e-3, 0.5)),
        bandwidth=OUTPUT,
    ),
    Contender(
        "open_loop",
        "open loop with PLL and AGC",
        LELAND,
        kind("open_loop") | ONE_AXIS,
        DRIVE,
        bandwidth=OUTPUT,
    ),
    Contender(
        "lqg",
        "LQG on the joint Kalman filter, as shipped",
        "textbook; docs/decisions/0024, 0049",
        kind("lqg"),
        (),
        bandwidth=FORGETTING,
    ),
    Contender(
        "paper_joint",
        "the paper's controller with the joint Kalman filter, as shipped",
        f"{ORIGINAL}; docs/decisions/0024",
        kind("fractional_fast_terminal", adaptation="joint"),
        (),
        bandwidth=FORGETTING,
    ),
    Contender(
        "paper",
        "the paper's controller",
        ORIGINAL,
        kind("fractional_fast_terminal") | STABLE | CONSTANT_BOUND,
        (*SURFACE, LEARNS),
        observer=OBSERVER,
        bandwidth=LAW,
    ),
    Contender(
        "paper_least_squares",
        "the paper's with least squares",
        f"{ORIGINAL}; docs/decisions/0016",
        kind("fractional_fast_terminal", adaptation="composite") | STABLE | CONSTANT_BOUND,
        (*SURFACE, LEARNS),
        observer=OBSERVER,
        bandwidth=FORGETTING,
    ),
    Contender(
        "linear",
        "adaptive linear sliding mode",
        BATUR,
        kind("linear") | STABLE | CONSTANT_BOUND,
        (FRACTIONAL_GAIN, LAYER, RHO, LEARNS),
        observer=OBSERVER,
        bandwidth=LAW,
    ),
    Contender(
        "park_horowitz",
        "adaptive control of Park and Horowitz",
        HOROWITZ,
        kind("park_horowitz"),
        (Gain("controller.velocity_gain", 1e-3, 20.0), LEARNS),
        observer=OBSERVER,
        bandwidth=LAW,
    ),
    Contender(
        "pid_least_squares",
        "PID on the plant that least squares find",
        "certainty equivalence; docs/decisions/0016",
        kind("least_squares_pid"),
        PID,
        observer=OBSERVER,
        bandwidth=FORGETTING,
    ),
    *(
        Contender(
            name,
            f"active disturbance rejection {words}",
            ZHENG,
            kind("disturbance_rejection") | {"controller.nominal_model": nominal},
            (FREQUENCY, Gain("controller.extended_observer_bandwidth", 0.2, 16.0, above=BY_PERIOD)),
            classes=("P",),
            bandwidth=DEMODULATED,
        )
        for name, words, nominal in (
            ("adrc", "without a model", False),
            ("adrc_nominal", "with the nominal plant", True),
        )
    ),
)


def drives_one_axis(contender: Contender) -> bool:
    """True if only one axis is driven, which determines the Cramér-Rao bound."""
    amplitude = contender.fixed.get("reference.amplitude", (math.nan, math.nan))
    return bool(amplitude[1] == 0.0)
