"""Who takes part in the task `track`: one entry each.

Ranges are those of the literature or of a first coarse search, widened where a best value lay at an end.
"""

from __future__ import annotations

from typing import Any

from .contender import Contender, Gain

PAPER = "paper"  # the reference of all ratios

BY_PERIOD = "0.6 over the step: above, the sampled loop is unstable"
BY_DEFINITION = "by definition"

# Of sliding surfaces. rho over layer_thickness, the gain within the layer, stays below 0.8 over the step.
LINEAR_GAIN = Gain("controller.fractional_gain", 1.0, 300.0)
TERMINAL_GAIN = Gain("controller.terminal_gain", 1e-2, 100.0)
EXPONENT = Gain("controller.terminal_exponent", 0.35, 0.95, log=False, limit="below, the loop magnifies rounding")
ORDER = Gain("controller.order", 0.3, 1.0, log=False, limit=BY_DEFINITION)
LAYER = Gain("controller.layer_thickness", 1e-4, 2.0)
LAWS = Gain("adaptation.damping_gain", 1e-2, 1e4, also=("adaptation.stiffness_gain", "adaptation.rate_gain"))
STABLE: dict[str, Any] = {"controller.switching_limit": 0.8}
NO_LAWS = dict.fromkeys((LAWS.field, *LAWS.also), 1e-12)
CONSTANT_BOUND: dict[str, Any] = {
    "adaptation.initial_bound": (10.0, 0.0, 0.0),
    "adaptation.bound_gain": (1e-12, 1e-12, 1e-12),
}
PID = (
    Gain("controller.natural_frequency", 5.0, 600.0, limit=BY_PERIOD),
    Gain("controller.damping_ratio", 0.1, 10.0),
    Gain("controller.integral_frequency", 0.01, 300.0),
)
TWISTING = (
    Gain("controller.surface_gain", 1.0, 500.0),
    Gain("controller.twisting_gain", 0.1, 500.0),
    Gain("controller.integral_gain", 1.0, 1e5),
)

FEI = "Fei and Lu, Complexity 2020, 8542961"
BATUR = "Fei and Batur, ISA Transactions 48 (2009) 73, doi 10.1016/j.isatra.2008.08.004"


def kind(name: str, **adaptation: str) -> dict[str, Any]:
    return {"controller.kind": name, **{f"adaptation.{field}": value for field, value in adaptation.items()}}


SURFACE = (ORDER, LINEAR_GAIN, TERMINAL_GAIN, EXPONENT, LAYER)
CONTENDERS = (
    Contender(PAPER, "the paper's controller", FEI, kind("fractional_fast_terminal") | STABLE, (*SURFACE, LAWS)),
    Contender("paper_as_published", "the paper's own gains, not tuned", FEI, kind("fractional_fast_terminal"), ()),
    Contender(
        "paper_no_terminal",
        "the paper's without λ2",
        FEI,
        kind("fractional") | STABLE,
        (ORDER, LINEAR_GAIN, LAYER, LAWS),
        group=PAPER,
    ),
    Contender(
        "paper_integer_order",
        "the paper's with α = 1: conventional fast terminal",
        FEI,
        kind("fast_terminal") | STABLE,
        (LINEAR_GAIN, TERMINAL_GAIN, EXPONENT, LAYER, LAWS),
        group=PAPER,
    ),
    Contender(
        "paper_no_adaptation",
        "the paper's, which learns nothing of the plant",
        FEI,
        kind("fractional_fast_terminal") | STABLE | NO_LAWS,
        SURFACE,
        group=PAPER,
    ),
    Contender(
        "paper_least_squares",
        "the paper's with least squares",
        f"{FEI}; docs/decisions/0016",
        kind("fractional_fast_terminal", kind="composite") | STABLE,
        (*SURFACE, LAWS),
        group=PAPER,
    ),
    Contender(
        "paper_joint",
        "the paper's with the joint Kalman filter",
        f"{FEI}; docs/decisions/0024",
        kind("fractional_fast_terminal", kind="joint") | STABLE,
        SURFACE,
        observes=True,
        group=PAPER,
    ),
    Contender(
        "linear",
        "adaptive linear sliding mode",
        BATUR,
        kind("linear") | STABLE | CONSTANT_BOUND,
        (LINEAR_GAIN, LAYER, LAWS),
    ),
    Contender(
        "linear_least_squares",
        "linear sliding mode with least squares",
        f"{BATUR}; docs/decisions/0016",
        kind("linear", kind="composite") | STABLE | CONSTANT_BOUND,
        (LINEAR_GAIN, LAYER, LAWS),
    ),
    Contender(
        "super_twisting",
        "super-twisting with the nominal plant",
        "Levant 1993; for gyroscopes doi 10.1371/journal.pone.0189457",
        kind("super_twisting") | NO_LAWS,
        TWISTING,
    ),
    Contender(
        "super_twisting_adaptive",
        "adaptive super-twisting",
        "doi 10.1371/journal.pone.0189457",
        kind("super_twisting"),
        (*TWISTING, LAWS),
    ),
    Contender("pid", "PID with feedforward of the nominal plant", "textbook", kind("pid"), PID),
)
