"""The tables of a scenario: pydantic models, one per TOML table, validated here once and nowhere else.

Defaults are the paper's values, eqs (47)-(53), in the corrected reading. [plant], [rate] and [device] are in SI,
everything else is nondimensional. A field's description becomes its comment in the TOML.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple, Self

import numpy as np
from pydantic import Field, create_model, model_validator

from .disturbance import FORCE
from .kinds import KINDS, MEANINGS, PLANT_KINDS, PLANT_MEANINGS, plant_fields, plants_with, table_fields
from .scales import Scales
from .table import (
    MAX_STEPS,
    ZERO,
    Pair,
    Symmetric,
    Table,
    Vector,
    as_tuple,
    field,
    message_error,
    of_other_kinds,
    toml_value,
)

SCALED = ("1/omega0", "q0*omega0", "omega0^2*q0", "m*omega0^2*q0", "m*omega0", "m*omega0^2")  # finite in SI
Gain = Annotated[float, Field(gt=-1)]  # error of one
HOLD_TOLERANCE = 1e-9  # relative: how far disturbance.hold may be from a whole number of steps
RANK_TOLERANCE = 1e-12  # relative to the largest entry: an eigenvalue below this is rounding, i.e. zero


class Readings(NamedTuple):
    """Values of one switch between the paper as printed and as corrected; docs/errata.md has the reasons."""

    printed: str
    corrected: str


ERRATA_SWITCHES = {
    "controller.layer": Readings("quadratic", "linear"),
    "controller.derivative": Readings("caputo", "riemann_liouville"),
    "controller.rate_law": Readings("printed", "skew"),
}


if TYPE_CHECKING:

    class _Plant(Table):
        kind: str = PLANT_KINDS[0]

        def __getattr__(self, name: str) -> Any: ...

else:
    PLANTS = [f"{kind}: {meaning}" for kind, meaning in zip(PLANT_KINDS, PLANT_MEANINGS, strict=True)]
    _Plant = create_model(
        "_Plant",
        __base__=Table,
        kind=(Literal[PLANT_KINDS], field(PLANT_KINDS[0], "; ".join(PLANTS) + ".")),
        **plant_fields(),
    )


class Plant(_Plant):
    """The gyroscope, eqs (1), (2), (9) and (47), or another plant; SI units."""

    mass: float = field(1.8e-7, "m, kg: proof mass.", gt=0, unit="kg")
    damping: Symmetric = field(
        Symmetric(xx=1.8e-6, xy=3.6e-7, yy=1.8e-6),
        "D, N s/m: positive semidefinite; xy couples the axes. Zeros: undamped.",
        unit="N s/m",
    )
    stiffness: Symmetric = field(
        Symmetric(xx=63.955, xy=12.779, yy=95.92),
        "K, N/m: positive definite; xy couples the axes, and 0.0 uncouples them.",
        unit="N/m",
    )
    damping_deviation: Symmetric = field(
        ZERO, "Delta D, N s/m, eq. (9): added to damping, unknown to the controller. Zeros: off.", unit="N s/m"
    )
    stiffness_deviation: Symmetric = field(
        ZERO,
        "Delta K, N/m, eq. (9): added to stiffness, unknown to the controller; the sum stays positive "
        "definite. Zeros: off.",
        unit="N/m",
    )
    angular_rate: float = field(100.0, "Omega_z, rad/s: the rate to be sensed; Coriolis force. 0.0: off.", unit="rad/s")
    transverse_rate: Pair = field(
        (0.0, 0.0), "[Omega_x, Omega_y], rad/s: acts only when centrifugal is true. Zeros: off.", unit="rad/s"
    )
    centrifugal: bool = field(
        False,
        "Eq. (1): stiffness xx loses m (Omega_y^2 + Omega_z^2), yy loses m (Omega_x^2 + Omega_z^2) and "
        "xy gains m Omega_x Omega_y. false: off, eq. (2).",
    )
    reference_length: float = field(1e-6, "q0, m: the unit of length of every other table.", gt=0, unit="m")
    reference_frequency: float = field(
        1000.0, "omega0, rad/s: 1/omega0 is the unit of time of every other table.", gt=0, unit="rad/s"
    )

    @property
    def kinds(self) -> tuple[str, ...]:
        return (str(self.kind),)

    @property
    def scales(self) -> Scales:
        return Scales(self.mass, self.reference_length, self.reference_frequency)

    def effective_stiffness(self) -> Symmetric:
        """K as it acts in eq. (1), N/m: softened when `centrifugal`; without Delta K."""
        if not self.centrifugal:
            return self.stiffness
        m, (x, y), z = self.mass, self.transverse_rate, self.angular_rate
        return self.stiffness.plus(-m * (y * y + z * z), m * x * y, -m * (x * x + z * z))

    def nondimensional(self) -> tuple[Vector, Vector, float, Vector, Vector]:
        """D, K (the effective one), Omega_z, Delta D, Delta K of eqs (5), (9); matrices as [xx, xy, yy]."""
        scales = self.scales
        return (
            self.damping.entries() / scales.damping,
            self.effective_stiffness().entries() / scales.stiffness,
            self.angular_rate / scales.rate,
            self.damping_deviation.entries() / scales.damping,
            self.stiffness_deviation.entries() / scales.stiffness,
        )

    @model_validator(mode="after")
    def _check(self) -> Self:
        for name, info in type(self).model_fields.items():
            kinds, value = plants_with(name), getattr(self, name)
            if kinds and self.kind not in kinds and value != info.default:
                raise of_other_kinds(f"plant.{name}", value, kinds, self.kind)
        _check_definite("plant.damping", self.damping, semi=True, unit="N s/m")
        _check_definite("plant.stiffness", self.stiffness)
        effective = self.effective_stiffness()
        _check_definite("plant.stiffness less its centrifugal part", effective)
        deviation = self.stiffness_deviation
        total = effective.plus(deviation.xx, deviation.xy, deviation.yy)
        _check_definite("plant.stiffness plus plant.stiffness_deviation", total)
        with np.errstate(all="ignore"):
            if not all(0 < self.scales.of(unit) < math.inf for unit in SCALED) or not all(
                np.isfinite(part).all() for part in self.nondimensional()
            ):
                raise message_error(
                    f"plant.mass is {toml_value(self.mass)}: with plant.reference_length and "
                    "plant.reference_frequency it must give finite nondimensional numbers"
                )
        return self


def _check_definite(name: str, matrix: Symmetric, *, semi: bool = False, unit: str = "N/m") -> None:
    least, zero = matrix.smallest_eigenvalue(), RANK_TOLERANCE * np.abs(matrix.entries()).max()
    if not (least >= -zero if semi else least > zero):  # in this form NaN fails, too
        wanted = "positive semidefinite" if semi else "positive definite"
        smallest = f"its smallest eigenvalue is {least:.6g} {unit}"
        raise message_error(f"{name} is {toml_value(matrix)}: it must be {wanted}, but {smallest}")


if TYPE_CHECKING:

    class _OfCore(Table):
        """Fields that the core lists (kinds.py)."""

        def __getattr__(self, name: str) -> Any: ...

    class _Controller(_OfCore): ...

    class _Adaptation(_OfCore): ...

    class _Guard(_OfCore): ...

    class _Datasheet(_OfCore): ...

else:
    KIND_MEANINGS = [f"{kind}: {meaning}" for kind, meaning in zip(KINDS, MEANINGS, strict=True)]
    _Controller = create_model(
        "_Controller",
        __base__=Table,
        kind=(Literal[KINDS], field(KINDS[0], "; ".join(KIND_MEANINGS) + ".")),
        **table_fields("controller", order=0.9),
    )
    _Adaptation = create_model("_Adaptation", __base__=Table, **table_fields("adaptation"))
    _Guard = create_model("_Guard", __base__=Table, **table_fields("guard", derived=True))
    _Datasheet = create_model("_Datasheet", __base__=Table, **table_fields("datasheet", derived=True))


class Controller(_Controller):
    """Kind of the controller; each kind has its own fields."""

    filter: Literal["none", "kalman"] = field(
        "none",
        "kalman: the controller receives position and velocity as a constant Kalman filter of the nominal plant "
        "estimates them, with the noise and delay of [datasheet]. none: as measured, with device.sensing position the "
        "velocity of the observer.",
    )
    observer_bandwidth: float = field(
        300.0,
        "Unit omega0, > 0: bandwidth of the velocity observer, or that at which filter kalman finds the acceleration "
        "that the nominal plant lacks. device.sensing full with filter none: off, velocity is measured.",
        gt=0,
        unit="omega0",
    )
    event_threshold: float = field(
        0.0,
        "a, unit of force: event trigger, the force is sent only if it differs on an axis by a and the share "
        "event_share from the one that acts. With event_share 0.0, 0.0: off, every step.",
        ge=0,
        unit=FORCE,
    )
    event_share: float = field(0.0, "b: share of the acting force that event_threshold has more. 0.0: off.", ge=0)
    compensation_bandwidth: float = field(
        0.0,
        "L, unit omega0: disturbance observer around any kind, the bandwidth at which the force that the nominal plant "
        "lacks is estimated from the velocity and taken off; L times run.step at most about 0.3. An angular rate is "
        "part of that force: kinds that estimate it with a deviation, or drive a sine, have none. 0.0: off.",
        ge=0,
        unit="omega0",
    )

    @model_validator(mode="after")
    def _check(self) -> Self:
        if self.layer_thickness == 0 and self.switching_limit < math.inf:
            raise message_error(
                f"controller.switching_limit is {toml_value(self.switching_limit)}: it must be inf when "
                "controller.layer_thickness is 0.0, as rho h/delta is then infinite"
            )
        return self


class Adaptation(_Adaptation):
    """Initial estimates of the plant and their adaptation; each kind has its own fields."""

    initial_ratio: float = field(
        0.95,
        "Estimates of D, K, Omega_z at t = 0 over their true values, > 0; a law that learns nothing keeps them. 1.0: "
        "off, no error.",
        gt=0,
    )
    initial_rate: float | None = field(
        None, "Unit omega0: estimate of Omega_z at t = 0. Not set: initial_ratio times the true value.", unit="omega0"
    )


class Guard(_Guard):
    """Limits on accepted samples in Python, FMU, browser and firmware; `simulate` accepts all."""


class Datasheet(_Datasheet):
    """Device as the controller knows it; adaptation.kind joint and controller.filter kalman need noise and delay."""

    pickoff_gain_error: Annotated[tuple[Gain, Gain], as_tuple("x y", expand=True)] = field(
        (0.0, 0.0),
        "[x, y], > -1: measurements are divided by 1 plus this before the controller; what device.pickoff_gain_error "
        "is found to be. Zeros: off.",
        unit="1",
    )
    pickoff_misalignment: float = field(
        0.0,
        "rad: angle from the axes of [plant] to those of the pick-offs by which measurements are turned back, after "
        "their gains. 0.0: off.",
        unit="rad",
    )


class Run(Table):
    """Duration, step and record."""

    duration: float = field(80.0, "Unit 1/omega0: end of the run, at least one step.", gt=0, unit="1/omega0")
    step: float = field(
        1e-3, "h, unit 1/omega0: period of control. The paper's loop diverges from about 5e-3.", gt=0, unit="1/omega0"
    )
    initial_position: Pair = field((0.5, 0.5), "q(0) [x, y], unit q0, eq. (49). Zeros: starts centered.", unit="q0")
    initial_velocity: Pair = field(
        (0.0, 0.0), "v(0) [x, y], unit q0 omega0, eq. (49). Zeros: at rest.", unit="q0*omega0"
    )
    record_every: int = field(
        1, "Steps from one recorded sample to the next. 1: off, all are kept.", ge=1, le=MAX_STEPS
    )
    kernel_tolerance: float = field(
        3e-5,
        "Largest relative error of the exponentials; 1e-9 to 1e-1. 3e-5: errors of a hundredth of those that the step "
        "makes; each power of ten below costs three exponentials.",
        ge=1e-9,
        le=1e-1,
    )
    units: Literal["nondimensional", "SI"] = field(
        "nondimensional", "Units of the results: nondimensional, or SI (s, m, N). nondimensional: off."
    )

    @property
    def steps(self) -> int:
        return round(self.duration / self.step)

    @model_validator(mode="after")
    def _check(self) -> Self:
        duration, step = toml_value(self.duration), toml_value(self.step)
        if self.duration < self.step:
            raise message_error(f"run.duration is {duration}: it must be at least run.step, which is {step}")
        if not self.duration / self.step < MAX_STEPS + 0.5:
            raise message_error(f"run.duration is {duration}: it must be at most {MAX_STEPS} steps of {step}")
        return self
