"""Checks of a scenario in volts that concern several of its tables."""

from __future__ import annotations

from typing import Any

from .kinds import PLANT_KINDS
from .table import message_error, toml_value
from .volts_core import IDEAL_ELECTRONICS, NO_ELECTRODES, at_bias, has_volts, plant_at_bias


def check_volts(scenario: Any) -> None:
    """Raises PydanticCustomError, in one sentence, for the first thing that is wrong with electrodes or electronics."""
    if not has_volts(scenario):
        return
    _check_tables(scenario)
    _check_electronics(scenario)
    least = plant_at_bias(scenario).effective_stiffness().smallest_eigenvalue()
    if not least > 0:
        raise message_error(
            f"electrodes soften plant.stiffness to a smallest eigenvalue of {least:.6g} N/m: it must be positive, as "
            "a mass without springs pulls in; lower a bias"
        )


def _check_tables(scenario: Any) -> None:
    plant, device, electronics = scenario.plant, scenario.device, scenario.electronics
    table = "electrodes" if scenario.electrodes != NO_ELECTRODES else "electronics"
    if plant.kind != PLANT_KINDS[0]:
        raise message_error(f"plant.kind is {toml_value(plant.kind)}: it must be {PLANT_KINDS[0]} with {table}")
    pickoffs = scenario.electrodes.of("pickoff")
    if device.sensing != "position" and (pickoffs or electronics != IDEAL_ELECTRONICS):
        said = "electrodes of role pickoff" if pickoffs else "electronics"
        raise message_error(
            f"device.sensing is {toml_value(device.sensing)}: it must be position with {said}, which read positions"
        )
    if any(at_bias(scenario).noise):
        for name in ("position_noise", "position_noise_density"):
            if value := getattr(device, name):
                raise message_error(
                    f"device.{name} is {toml_value(value)}: it must be 0.0 with electronics.amplifier charge, from "
                    "which the noise follows"
                )
    for name, one in scenario.electrodes.named():
        if one.role == "pickoff" and not one.bias and not electronics.carrier_voltage:
            raise message_error(f"{name}.bias is 0.0: a pick-off must have a bias or electronics.carrier_voltage")


def _check_electronics(scenario: Any) -> None:
    e, electrodes = scenario.electronics, scenario.electrodes
    step = scenario.run.step * scenario.plant.scales.time
    sampled = e.sample_delay + e.aperture
    if sampled >= step:
        name = "aperture" if e.aperture else "sample_delay"
        raise message_error(
            f"electronics.{name} is {toml_value(getattr(e, name))}: sample_delay plus aperture must be less than a "
            f"step, which is {step:.6g} s"
        )
    if e.update_delay >= step:
        raise message_error(
            f"electronics.update_delay is {toml_value(e.update_delay)}: it must be less than a step, which is "
            f"{step:.6g} s; whole steps are device.delay"
        )
    if any(e.feedthrough) and not (electrodes.of("force") and electrodes.of("pickoff")):
        raise message_error(
            f"electronics.feedthrough is {toml_value(e.feedthrough)}: it needs electrodes of role force and of role "
            "pickoff"
        )
    if e.amplifier != "ideal" and not electrodes.of("pickoff"):
        raise message_error(
            f"electronics.amplifier is {toml_value(e.amplifier)}: it must be ideal without electrodes of role pickoff"
        )
    plates = [one for one in electrodes.of("force") if one.kind == "plate" and one.pair]
    if e.linearized and not plates:
        raise message_error("electronics.linearized is true: it needs pairs of plates of role force")
