"""Who takes part in the task `track`: one entry each.

Ranges are those of the literature or of a first coarse search, widened where a best value lay at an end.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from fracgyro.scenario.kinds import kinds_with

from .contender import Contained, Contender, Gain

PAPER = "paper"  # the reference of all ratios

BY_PERIOD = "0.6 over the step, where the sampled loop is unstable"

# Gains of sliding surfaces. The gain within the layer, rho/delta, stays below 0.8 over the step.
ORDER = Gain("controller.order", 0.1, 1.0, log=False, above="1 is the integer order")
FRACTIONAL_GAIN = Gain("controller.fractional_gain", 1.0, 1e5)
LINEAR_GAIN = Gain("controller.fractional_gain", 1.0, 1000.0, above="1 over the step")
TERMINAL_GAIN = Gain("controller.terminal_gain", 1e-2, 1000.0, below="0 is the law without it")
EXPONENT = Gain(
    "controller.terminal_exponent", 0.35, 0.95, log=False, below="the loop magnifies rounding", above="1 is linear"
)
LAYER = Gain("controller.layer_thickness", 1e-3, 300.0, above="as wide as the start, so that the law is linear")
RHO = Gain("adaptation.initial_bound", 1.0, 800.0, shape=(1.0, 0.0, 0.0), times=LAYER.field, above="0.8 over the step")
OBSERVER = Gain("controller.observer_bandwidth", 20.0, 800.0, above="0.8 over the step, where it rings")
LAWS = Gain(
    "adaptation.damping_gain",
    1e-2,
    1e5,
    also=("adaptation.stiffness_gain", "adaptation.rate_gain"),
    below="0 learns nothing",
)
STABLE: dict[str, Any] = {"controller.switching_limit": 0.8}
NO_LAWS = dict.fromkeys((LAWS.field, *LAWS.also), 1e-12)
CONSTANT_BOUND: dict[str, Any] = {"adaptation.bound_gain": (1e-12, 1e-12, 1e-12)}
PID = (
    Gain("controller.natural_frequency", 5.0, 600.0, above=BY_PERIOD),
    Gain("controller.damping_ratio", 0.1, 10.0),
    Gain("controller.integral_frequency", 0.01, 2000.0),
)
LATE = "an unknown delay then makes the loop unstable"
RESONANT = (
    PID[0],
    Gain("controller.damping_ratio", 0.1, 1.2, log=False, above=LATE),
    Gain("controller.resonator_gain", 0.05, 60.0),
)
INTEGRAL = (
    Gain("controller.surface_gain", 3.0, 600.0),
    Gain("controller.reaching_rate", 5.0, 800.0, above="0.8 over the step"),
    Gain("controller.integral_rate", 0.01, 500.0, below="0 is the law without it"),
    Gain("controller.disturbance_observer", 3.0, 400.0, above=LATE),
)
DYNAMIC = (
    Gain("controller.surface_gain", 3.0, 600.0),
    Gain("controller.reaching_rate", 3.0, 600.0),
    Gain("controller.force_bandwidth", 10.0, 800.0, above="0.8 over the step"),
)
FIXED_TIME = (
    Gain("controller.near_gain", 0.1, 300.0, below="0 is the law without it"),
    Gain("controller.far_gain", 0.1, 300.0, below="0 is the law without it"),
    Gain("controller.near_exponent", 0.4, 0.95, log=False, below="the loop magnifies rounding", above="1 is linear"),
    Gain("controller.far_exponent", 1.05, 1.95, log=False, below="1 is linear", above="2 is the range of the field"),
    Gain("controller.near_reaching", 0.1, 3000.0),
    Gain("controller.far_reaching", 1.0, 3000.0),
)
PRESCRIBED = (
    Gain("controller.bound_final", 1e-3, 0.5),
    Gain("controller.bound_rate", 0.1, 20.0),
    Gain("controller.barrier_scale", 2e-3, 50.0, below="the step raises it"),
    Gain("controller.damper_root", 0.01, 1000.0, below="0 is the law without it"),
    Gain("controller.damper_cube", 0.01, 1e4, below="0 is the law without it"),
    Gain("controller.damper", 10.0, 800.0, above="0.8 over the step"),
)
NETWORK = (
    Gain("controller.surface_gain", 3.0, 600.0),
    Gain("controller.reaching_rate", 10.0, 800.0, above="0.8 over the step"),
    Gain("controller.learning_frequency", 1.0, 150.0, above=LATE),
    Gain("controller.weight_leak", 1e-4, 3.0, below="0 is the law without it"),
)
PREDICTION = (
    Gain("controller.prediction_rate", 3.0, 800.0),
    Gain("controller.prediction_weight", 0.01, 100.0, below="0 is the law without it"),
)
WIDTH = Gain("controller.node_width", 0.2, 3.0, above="the nodes are nearly one constant")
TWISTING = (
    Gain("controller.surface_gain", 1.0, 1000.0, above="1 over the step"),
    Gain("controller.twisting_gain", 0.1, 500.0),
    Gain("controller.integral_gain", 1.0, 1e5),
)

ORIGINAL = "Complexity 2020, 8542961"
BATUR = "Fei and Batur, ISA Transactions 48 (2009) 73, doi 10.1016/j.isatra.2008.08.004 (from memory)"
CASCADED = "doi 10.3390/mi12020190 (abstract read); docs/decisions/0053"
POLYAKOV = "Polyakov 2012, doi 10.1109/TAC.2011.2179869 (from memory); docs/decisions/0053"
BOUNDED = "2023, doi 10.1049/cth2.12484 (abstract and code read); docs/decisions/0053"
NEURAL = "doi 10.1155/2014/159047 (abstract read); docs/decisions/0053"
COMPOSITE = "doi 10.1109/TNNLS.2019.2919931 (abstract read); docs/decisions/0053"
STEPPED = "doi 10.3390/mi9070338 (abstract read); docs/decisions/0053"
TWISTED = "doi 10.1371/journal.pone.0189457 (abstract read)"


def kind(name: str, adaptation: str = "gradient") -> dict[str, Any]:
    """The kind of controller and, if it has a choice, of adaptation, whatever the scenario has."""
    chosen = {"adaptation.kind": adaptation} if name in kinds_with("adaptation.kind") else {}
    return {"controller.kind": name, **chosen}


# Gains of the nonsingular surfaces, whose second exponent is the first of e.
NONSINGULAR = (
    Gain("controller.nonsingular_velocity_gain", 1e-5, 10.0),
    Gain("controller.velocity_exponent", 1.05, 1.95, log=False, below="1 is linear", above="2 is the first exponent"),
    Gain("controller.reaching_gain", 5.0, 1e5),
    Gain("controller.switching_gain", 0.1, 1e6, below="0 is the law without it"),
)
FAST = Gain("controller.nonsingular_position_gain", 1e-3, 1000.0, below="0 is the law without it")
NONSINGULAR_LAYER = Gain("controller.nonsingular_layer", 1e-5, 10.0)
POWER = Gain("controller.reaching_exponent", 0.05, 0.95, log=False, below="0 is the layer", above="1 is linear")
ESO = (
    Gain("controller.natural_frequency", 5.0, 600.0, above=BY_PERIOD),
    Gain("controller.extended_observer_bandwidth", 20.0, 800.0, above="0.8 over the step"),
)
DAMPER = Gain("controller.velocity_gain", 0.3, 1500.0)
ZHENG = "Zheng, Dong and Gao, doi 10.1109/CCA.2007.4389216 (abstract read)"
HOROWITZ = "Park and Horowitz, JMEMS 12 (2003) 101, doi 10.1109/JMEMS.2002.807468 (from memory)"
YANG = "Feng, Yu and Man, doi 10.1016/S0005-1098(02)00147-4; Yang and Yang 2011 (both from memory)"

# Values that turn a law into a special case of itself, or nearly so at the end of a range.
INTEGER: dict[str, float] = {ORDER.field: 1.0}
NO_TERMINAL: dict[str, float] = {TERMINAL_GAIN.field: TERMINAL_GAIN.low, EXPONENT.field: EXPONENT.high}
LEARNS_NOTHING: dict[str, float] = {LAWS.field: LAWS.low}
LINEAR_SURFACE: dict[str, float] = {**INTEGER, **NO_TERMINAL}

SURFACE = (ORDER, FRACTIONAL_GAIN, TERMINAL_GAIN, EXPONENT, LAYER, RHO)
UNFILTERED = (
    Contender(
        PAPER,
        "the paper's controller",
        ORIGINAL,
        kind("fractional_fast_terminal") | STABLE,
        (*SURFACE, LAWS),
        observer=OBSERVER,
        contains=(
            Contained("paper_no_terminal", NO_TERMINAL),
            Contained("paper_integer_order", INTEGER),
            Contained("paper_no_adaptation", LEARNS_NOTHING),
        ),
    ),
    Contender("paper_as_published", "the paper's own gains, not tuned", ORIGINAL, kind("fractional_fast_terminal"), ()),
    Contender(
        "paper_no_terminal",
        "the paper's without λ2",
        ORIGINAL,
        kind("fractional") | STABLE,
        (ORDER, FRACTIONAL_GAIN, LAYER, RHO, LAWS),
        group=PAPER,
        observer=OBSERVER,
        contains=(Contained("linear", INTEGER),),
    ),
    Contender(
        "paper_integer_order",
        "the paper's with α = 1: conventional fast terminal",
        ORIGINAL,
        kind("fast_terminal") | STABLE,
        (LINEAR_GAIN, TERMINAL_GAIN, EXPONENT, LAYER, RHO, LAWS),
        group=PAPER,
        observer=OBSERVER,
        contains=(Contained("linear", NO_TERMINAL),),
    ),
    Contender(
        "paper_no_adaptation",
        "the paper's, which learns nothing of the plant",
        ORIGINAL,
        kind("fractional_fast_terminal") | STABLE | NO_LAWS,
        SURFACE,
        group=PAPER,
        observer=OBSERVER,
    ),
    Contender(
        "paper_least_squares",
        "the paper's with least squares",
        f"{ORIGINAL}; docs/decisions/0016",
        kind("fractional_fast_terminal", adaptation="composite") | STABLE,
        (*SURFACE, LAWS),
        group=PAPER,
        observer=OBSERVER,
        contains=(Contained("linear_least_squares", LINEAR_SURFACE),),
    ),
    Contender(
        "paper_joint",
        "the paper's with the joint Kalman filter",
        f"{ORIGINAL}; docs/decisions/0024",
        kind("fractional_fast_terminal", adaptation="joint") | STABLE,
        SURFACE,
        group=PAPER,
    ),
    Contender(
        "linear",
        "adaptive linear sliding mode",
        BATUR,
        kind("linear") | STABLE | CONSTANT_BOUND,
        (LINEAR_GAIN, LAYER, RHO, LAWS),
        observer=OBSERVER,
    ),
    Contender(
        "linear_least_squares",
        "linear sliding mode with least squares",
        f"{BATUR}; docs/decisions/0016",
        kind("linear", adaptation="composite") | STABLE | CONSTANT_BOUND,
        (LINEAR_GAIN, LAYER, RHO, LAWS),
        observer=OBSERVER,
    ),
    Contender(
        "super_twisting",
        "super-twisting with the nominal plant",
        f"Levant 1993 (from memory); for gyroscopes {TWISTED}",
        kind("super_twisting") | NO_LAWS,
        TWISTING,
        observer=OBSERVER,
    ),
    Contender(
        "super_twisting_adaptive",
        "adaptive super-twisting",
        TWISTED,
        kind("super_twisting"),
        (*TWISTING, LAWS),
        observer=OBSERVER,
        contains=(Contained("super_twisting", LEARNS_NOTHING),),
    ),
    Contender("pid", "PID with feedforward of the nominal plant", "textbook", kind("pid"), PID, observer=OBSERVER),
    Contender(
        "resonant",
        "PD with resonators at the reference's frequencies",
        "textbook; docs/decisions/0046",
        kind("resonant") | {"controller.integral_frequency": 0.0},
        RESONANT,
        observer=OBSERVER,
    ),
    Contender(
        "integral_sliding",
        "integral sliding mode with a disturbance observer",
        "Ohnishi 1987 (from memory); docs/decisions/0051",
        kind("integral_sliding"),
        INTEGRAL,
        observer=OBSERVER,
    ),
    Contender(
        "pid_least_squares",
        "PID on the plant that least squares find",
        "certainty equivalence; docs/decisions/0016",
        kind("least_squares_pid"),
        PID,
        observer=OBSERVER,
    ),
    *(
        Contender(
            f"{name}{suffix}",
            f"{words}{which}",
            source,
            kind(name) | {"controller.delay_margin": margin},
            (Gain("controller.loop_bandwidth", 0.02, fastest, above=f"beyond {fastest} it is limited"),),
        )
        for name, words, source in (
            ("lqg", "LQG on the joint Kalman filter", "textbook; docs/decisions/0024, 0049"),
            (
                "internal_model",
                "oscillators at the reference's frequencies in a constant Kalman filter",
                "internal model principle; docs/decisions/0047",
            ),
        )
        for suffix, which, margin, fastest in (
            ("", "", 1.0, 1.1),
            ("_exact_delay", ", designed for exactly the stated delay", 0.0, 2.5),
        )
    ),
    Contender(
        "park_horowitz",
        "adaptive control of Park and Horowitz",
        HOROWITZ,
        kind("park_horowitz"),
        (DAMPER, LAWS),
        observer=OBSERVER,
    ),
    Contender(
        "nonsingular_terminal",
        "adaptive nonsingular terminal sliding mode with a layer",
        YANG,
        kind("nonsingular_terminal")
        | {"controller.nonsingular_position_gain": 0.0, "controller.reaching_exponent": 0.0},
        (*NONSINGULAR, NONSINGULAR_LAYER, LAWS),
        observer=OBSERVER,
    ),
    Contender(
        "nonsingular_fast_terminal",
        "adaptive nonsingular fast terminal sliding mode with power reaching",
        f"{YANG}; for gyroscopes doi 10.1155/2019/6840639 (abstract read)",
        kind("nonsingular_terminal"),
        (FAST, *NONSINGULAR, POWER, LAWS),
        observer=OBSERVER,
    ),
    Contender(
        "adrc",
        "active disturbance rejection without a model",
        ZHENG,
        kind("disturbance_rejection") | {"controller.nominal_model": False},
        ESO,
        classes=("P",),
    ),
    Contender(
        "adrc_nominal",
        "active disturbance rejection with the nominal plant",
        ZHENG,
        kind("disturbance_rejection") | {"controller.nominal_model": True},
        ESO,
        classes=("P",),
    ),
    Contender(
        "dynamic",
        "adaptive dynamic sliding mode",
        CASCADED,
        kind("dynamic"),
        (*DYNAMIC, LAWS),
        observer=OBSERVER,
    ),
    Contender(
        "fixed_time",
        "adaptive fixed-time sliding mode",
        POLYAKOV,
        kind("fixed_time"),
        (*FIXED_TIME, LAWS),
        observer=OBSERVER,
    ),
    Contender(
        "prescribed",
        "prescribed performance on the nominal plant",
        BOUNDED,
        kind("prescribed"),
        (*PRESCRIBED, LAWS),
        observer=OBSERVER,
    ),
    *(
        Contender(
            name,
            f"sliding mode with {words}",
            NEURAL,
            kind("network") | {"controller.basis": basis},
            (*NETWORK, *more),
            observer=OBSERVER,
        )
        for name, basis, words, more in (
            ("network", "gaussian", "a network of 16 Gaussian nodes on the orbit", (WIDTH,)),
            ("network_constant", "constant", "a network of one constant node: an integral", ()),
            ("network_chebyshev", "chebyshev", "Chebyshev polynomials of degree 2", ()),
        )
    ),
    Contender(
        "network_predicted",
        "that network with 16 nodes, which also learns from a prediction",
        COMPOSITE,
        kind("network"),
        (*NETWORK, WIDTH, *PREDICTION),
        observer=OBSERVER,
        contains=(Contained("network", {PREDICTION[1].field: PREDICTION[1].low}),),
    ),
    Contender(
        "backstepping",
        "adaptive backstepping: the linear surface with one term more",
        STEPPED,
        kind("linear") | STABLE | {"controller.coupling": 1.0},
        (LINEAR_GAIN, LAYER, RHO, LAWS),
        observer=OBSERVER,
    ),
)

FILTER = replace(OBSERVER, low=1.0, below="the nominal plant only")
FILTERED_PID = (
    replace(PID[0], high=400.0, above=LATE),
    Gain("controller.damping_ratio", 0.6, 1.0, log=False, below=LATE, above=LATE),
    replace(PID[2], high=150.0, above=LATE),
)


def filtered(name: str, **changes: Any) -> Contender:
    """A contender on a Kalman filter of the nominal plant, which no exact measurement needs."""
    (law,) = (contender for contender in UNFILTERED if contender.name == name)
    gains = changes.pop("gains", law.gains)
    return replace(
        law,
        name=f"{name}_kalman",
        words=f"{law.words} on a Kalman filter of the nominal plant",
        source=f"{law.source}; docs/decisions/0048",
        fixed={**law.fixed, "controller.filter": "kalman"},
        gains=(*gains, FILTER),
        observer=None,
        without_noise=False,
        **{"contains": (), **changes},
    )


# One of each family of laws that has no filter of its own.
CONTENDERS = (
    *UNFILTERED,
    filtered(PAPER, group=PAPER, contains=(Contained("linear_kalman", LINEAR_SURFACE),)),
    filtered("linear"),
    filtered("super_twisting"),
    filtered("nonsingular_terminal"),
    filtered("pid", gains=FILTERED_PID),
    filtered("resonant"),
    filtered("integral_sliding"),
    filtered("park_horowitz"),
)
