"""Plants other than the linear gyroscope: what they cannot be combined with; the limits of a scenario."""

from __future__ import annotations

import math
from dataclasses import dataclass

from .. import _core
from .device import CUBIC, MATRIX_DRIFTS, Device, Rate
from .kinds import PLANT_KINDS
from .scales import Scales
from .schema import Plant
from .table import message_error, toml_value

# Fields of [device] that act on the stiffness and damping of the gyroscope.
OF_THE_GYROSCOPE = ("stiffness_drift", "damping_drift", *CUBIC, *MATRIX_DRIFTS)
# Fields of [device] that act as a dynamic rate.
RATE_NOISE = ("bias_instability", "rate_random_walk")


def conflict(plant: Plant, rate: Rate, device: Device, takes_rate: bool, name: str) -> str | None:
    """The field that a plant other than the gyroscope cannot have, in one sentence; `name`: the plant in it."""
    for field in OF_THE_GYROSCOPE:
        value = getattr(device, field)
        if value not in (0.0, (0.0, 0.0)):
            wanted = toml_value(type(device).model_fields[field].default)
            return f"device.{field} is {toml_value(value)}: it must be {wanted} with {name}, which has its own springs"
    if rate.transverse_points is not None:
        return f"rate.transverse_points is given: it must be left out with {name}, on which such rates do not act"
    moving = rate.kind != "constant"
    if moving and plant.centrifugal:
        return f"plant.centrifugal is true: it must be false with {name} when rate.kind is {toml_value(rate.kind)}"
    if takes_rate:
        return None
    if moving:
        return f"rate.kind is {toml_value(rate.kind)}: it must be constant with {name}, which takes no angular rate"
    for field in RATE_NOISE:
        if value := getattr(device, field):
            return f"device.{field} is {toml_value(value)}: it must be 0.0 with {name}, which takes no angular rate"
    return None


def check_kind(plant: Plant, rate: Rate, device: Device) -> None:
    """Raises if plant.kind cannot have the rate or the device."""
    if plant.kind == PLANT_KINDS[0]:
        return
    takes_rate = _core.plant_takes_rate[PLANT_KINDS.index(plant.kind)]
    if found := conflict(plant, rate, device, takes_rate, f"plant.kind {plant.kind}"):
        raise message_error(found)


@dataclass(frozen=True)
class Constraints:
    """Limits of a scenario in the units of its runs; infinite where it has none.

    >>> fg.Scenario.paper().replace({"controller.force_limit": 50.0}).constraints().force
    50.0
    """

    force: float  #: largest force on an axis: the least of force limit, actuator limit and drivers
    position: tuple[float, float]  #: motion that the sensors measure, the gap: device.position_range
    velocity: tuple[float, float]  #: the same for device.velocity_range
    angular_rate: float  #: largest magnitude of Omega_z during the run; infinite for noise, which is Gaussian


def constraints(plant: Plant, rate: Rate, device: Device, force_limit: float, drive: float, si: bool) -> Constraints:
    scales = plant.scales
    of = scales if si else Scales(1.0, 1.0, 1.0)

    def ranges(reach: tuple[float, float], scale: float, unit: float) -> tuple[float, float]:
        return reach[0] / scale * unit, reach[1] / scale * unit

    return Constraints(
        force=min(force_limit, device.actuator_limit / scales.force, drive / scales.force) * of.force,
        position=ranges(device.position_range, scales.length, of.length),
        velocity=ranges(device.velocity_range, scales.velocity, of.velocity),
        angular_rate=_largest_rate(plant, rate) / scales.rate * of.rate,
    )


def _largest_rate(plant: Plant, rate: Rate) -> float:
    """Largest magnitude of Omega_z, rad/s."""
    mean, amplitude, levels = plant.angular_rate, float(rate.amplitude or 0.0), int(rate.levels)
    if rate.kind == "table":
        return max(abs(value) for _, value in rate.points or ())
    if rate.kind == "noise":
        return math.inf
    ends: dict[str, tuple[float, ...]] = {"constant": (0.0,), "step": (amplitude,), "staircase": (amplitude * levels,)}
    reached: tuple[float, ...] = (0.0, *ends.get(rate.kind, (amplitude, -amplitude)))
    return max(abs(mean + end) for end in reached)
