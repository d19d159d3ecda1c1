"""From a scenario to what the compiled core takes: nondimensional numbers and the designed modes."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from . import _core, modes
from .scenario import Scenario

# A design takes milliseconds, and studies ask for few different ones.
_design = lru_cache(maxsize=1024)(modes.design)

SHORTEST_RANGE = 10.0  # the modes cover at least this many steps, however short the run


def core_modes(order: float, step: float, duration: float, tolerance: float) -> _core.Modes:
    """Modes of I^(1-order) for samples `step` apart over `duration`; none for order 0 and 1, which need none.

    Raises ValueError when order, step, duration or tolerance are outside what `modes.design` allows.
    """
    gamma = math.gamma(2.0 - order)
    if order in (0.0, 1.0):
        return _core.Modes(order, gamma, np.empty(0), np.empty(0))
    designed = _design(order, step, max(duration, SHORTEST_RANGE * step), tolerance)
    return _core.Modes(order, gamma, designed.rates, designed.weights, designed.error)


def composite(scenario: Scenario) -> bool:
    """Whether least squares run beside the laws (44)."""
    return scenario.adaptation.kind == "composite" and scenario.controller.adaptive


def controller_params(scenario: Scenario) -> _core.ControllerParams:
    """Parameters of eqs (16), (35), (44), (46)."""
    c, a, run = scenario.controller, scenario.adaptation, scenario.run
    damping, stiffness, rate, _, _ = scenario.plant.nondimensional()
    params = _core.ControllerParams()
    params.step = run.step

    reference = _core.ReferenceParams()
    reference.amplitude = scenario.reference.amplitude
    reference.frequency = scenario.reference.frequency
    reference.phase = scenario.reference.phase
    params.reference = reference

    surface = _core.SurfaceParams()
    surface.fractional_gain = c.fractional_gain
    surface.terminal_gain = c.terminal_gain
    surface.terminal_exponent = c.terminal_exponent
    surface.singularity_floor = c.singularity_floor
    surface.riemann_liouville = c.derivative == "riemann_liouville"
    if c.kind.startswith("fractional"):
        surface.modes = core_modes(c.order, run.step, run.duration, run.mode_tolerance)
    params.surface = surface

    control = _core.ControlParams()
    control.layer_thickness = c.layer_thickness
    control.layer = _core.Layer.quadratic if c.layer == "quadratic" else _core.Layer.linear
    control.force_limit = c.force_limit
    params.control = control

    # With known parameters, eqs (20) and (34), the estimates start at the truth and stay there.
    ratio = a.initial_ratio if c.adaptive else 1.0
    initial = _core.Estimates()
    initial.damping = ratio * damping
    initial.stiffness = ratio * stiffness
    initial.rate = ratio * rate if a.initial_rate is None or not c.adaptive else a.initial_rate
    initial.bound = a.initial_bound

    adaptation = _core.AdaptationParams()
    adaptation.adaptive = c.adaptive
    adaptation.printed_rate_law = c.rate_law == "printed"
    adaptation.damping_gain = a.damping_gain
    adaptation.stiffness_gain = a.stiffness_gain
    adaptation.rate_gain = a.rate_gain
    adaptation.bound_gain = a.bound_gain
    adaptation.initial = initial
    adaptation.leakage = a.leakage
    adaptation.dead_zone = a.dead_zone
    adaptation.projection = a.projection
    adaptation.composite = composite(scenario)
    adaptation.forgetting = a.forgetting
    adaptation.rate_forgetting = a.rate_forgetting
    params.adaptation = adaptation
    return params


def plant_params(scenario: Scenario) -> _core.PlantParams:
    """Parameters of eqs (9) and (13)."""
    params = _core.PlantParams()
    (
        params.damping,
        params.stiffness,
        params.rate,
        params.damping_deviation,
        params.stiffness_deviation,
    ) = scenario.plant.nondimensional()
    params.initial_position = scenario.plant.initial_position
    params.initial_velocity = scenario.plant.initial_velocity
    return params


def disturbance_params(scenario: Scenario) -> _core.DisturbanceParams:
    """Parameters of the force d of eq. (9)."""
    d = scenario.disturbance
    params = _core.DisturbanceParams()
    params.kind = getattr(_core.DisturbanceKind, d.kind)
    hold = scenario.run.step if d.hold is None else d.hold
    if d.kind == "noise":
        params.hold = round(hold / scenario.run.step)
        # White noise of density S, held for h, has variance S/h.
        params.standard_deviation = math.sqrt(d.density / hold) if d.density is not None else d.standard_deviation
    params.seed = d.seed
    params.amplitude, params.frequency, params.phase = d.amplitude, d.frequency, d.phase
    return params


def core_setup(scenario: Scenario) -> _core.Setup:
    """One run for the compiled loop."""
    setup = _core.Setup()
    setup.kind = scenario.controller.kind
    setup.controller = controller_params(scenario)
    setup.plant = plant_params(scenario)
    setup.disturbance = disturbance_params(scenario)
    setup.steps = scenario.run.steps
    return setup
