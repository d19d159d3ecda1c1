"""A scenario as the core's structs, in round numbers: division by units, and the derived guard."""

from __future__ import annotations

import math
from typing import Any

import fracgyro as fg
import pytest
from fracgyro.scenario import device_core, to_core

# Units: 1/16 s, 1/4 m, 4 m/s, 128 N, 512 N/m, 16 rad/s. Natural frequencies 3 and 5.
ROUND = fg.Scenario.paper().replace(
    {
        "plant.mass": 2.0,
        "plant.reference_frequency": 16.0,
        "plant.reference_length": 0.25,
        "plant.stiffness": {"xx": 512 * 21.8, "xy": 512 * 6.4, "yy": 512 * 12.2},
        "plant.angular_rate": 32.0,
        "plant.damping": {"xx": 16.0, "xy": 4.0, "yy": 8.0},
        "disturbance.kind": "none",
        "disturbance.standard_deviation": None,
        "disturbance.hold": None,
        "run.step": 0.125,
        "run.duration": 8.0,
    }
)
QUIET = to_core.MIN_TOLERANCE


def device(**fields: Any) -> Any:
    return device_core.device_values(ROUND.replace({f"device.{name}": value for name, value in fields.items()}))


def guard(changes: dict[str, Any]) -> Any:
    return to_core.guard(ROUND.replace({"guard.checked": True, **changes}))


# -- Units


def test_noise_is_in_units_of_the_plant_and_a_density_reaches_half_the_sampling_frequency() -> None:
    assert device(position_noise=1.0)["position_noise"] == 4.0
    assert device(velocity_noise=1.0)["velocity_noise"] == 0.25
    # 128 samples a second: of a density of 1, 64 Hz make a variance of 64.
    assert device(position_noise_density=1.0)["position_noise"] == 8.0 * 4.0
    assert device(velocity_noise_density=1.0)["velocity_noise"] == 8.0 * 0.25


def test_flicker_noise_is_as_dense_as_the_white_one_at_its_corner() -> None:
    # Density A^2/omega, two-sided, equal to the white one, sigma^2/128 s, at omega = 2 pi f_c.
    found = device(position_noise=1.0, position_noise_corner=2.0, velocity_noise=1.0, velocity_noise_corner=32.0)
    assert found["position_flicker"] == pytest.approx(4.0 * math.sqrt(2 * math.pi * 2.0 / 128), rel=1e-15)
    assert found["velocity_flicker"] == pytest.approx(0.25 * math.sqrt(2 * math.pi * 32.0 / 128), rel=1e-15)
    assert device(position_noise=1.0)["position_flicker"] == 0.0


def test_what_acts_as_a_rate_is_in_units_of_the_plant_and_its_walk_goes_as_the_root_of_time() -> None:
    assert device(bias_instability=16.0)["bias_instability"] == 1.0
    assert device(rate_random_walk=16.0)["rate_walk_step"] == pytest.approx(math.sqrt(1 / 128), rel=1e-15)


def test_ranges_springs_and_temperatures_are_in_units_of_the_plant() -> None:
    for name, value in (("position_range", 0.5), ("velocity_range", 8.0)):
        assert device(**{name: value})[name] == [2.0, 2.0], name
    assert device(actuator_limit=256.0)["actuator_limit"] == 2.0
    assert device(position_range=[0.5, 0.25])["position_range"] == [2.0, 1.0]
    assert tuple(device(cubic_stiffness=(8192.0, 3 * 8192.0))["cubic_stiffness"]) == (1.0, 3.0)
    warm = device(stiffness_drift=-30.0)
    assert warm["stiffness_drift"] == pytest.approx(-3e-5, rel=1e-15)
    assert device(damping_drift=5e3)["damping_drift"] == pytest.approx(5e-3, rel=1e-15)
    ramp = ROUND.replace({"device.temperature_ramp": 4.0})
    assert device_core.profiles(ramp) == (([], []), ([0.0, 64.0], [0.0, 2.0]))  # half a second
    assert device(delay=3)["delay"] == 3
    turned = device(pickoff_gain_error=[0.5, 0.25], force_gain_error=0.125, force_misalignment=0.1)
    assert (turned["pickoff_gain_error"], turned["pickoff_misalignment"]) == ((0.5, 0.25), 0.0)
    assert (turned["force_gain_error"], turned["force_misalignment"]) == ((0.125, 0.125), 0.1)


def test_rates_are_in_units_of_the_plant_and_their_times_in_steps() -> None:
    def rate(*names: str, **fields: Any) -> list[Any]:
        values = device_core.rate_values(ROUND.replace({f"rate.{name}": value for name, value in fields.items()}))
        return [values[name] for name in names]

    step = rate("kind", "amplitude", "start_steps", kind="step", amplitude=8.0, start=0.5 / 16)
    assert step == ["staircase", 0.5, 4]
    climb = rate(
        "kind", "start_steps", "hold_steps", "levels", kind="staircase", amplitude=8.0, hold=0.75 / 16, levels=3
    )
    assert climb == ["staircase", 0, 6, 3]
    sine = rate("kind", "start_steps", "frequency", kind="sine", amplitude=8.0, start=0.5 / 16, frequency=32.0)
    assert sine == ["sine", 4, 2.0]
    table = ROUND.replace({"rate.kind": "table", "rate.points": [[0.0, 16.0], [0.5, 32.0]]})
    assert device_core.profiles(table)[0] == ([0.0, 64.0], [1.0, 2.0])


def test_noise_of_a_density_has_that_over_the_time_that_it_is_held() -> None:
    def disturbance(*names: str, **fields: Any) -> list[float]:
        found = to_core.core_numbers(ROUND.replace({f"disturbance.{name}": value for name, value in fields.items()}))
        return [found[f"disturbance.{name}"] for name in names]

    held = disturbance("hold_steps", "standard_deviation", kind="noise", density=8.0, hold=0.5)
    assert held == [4, 4.0]
    assert disturbance("standard_deviation", kind="noise", density=8.0) == [8.0]
    assert disturbance("standard_deviation", kind="noise", standard_deviation=3.0, hold=0.5) == [3.0]
    names = ("hold_steps", "amplitude.x", "amplitude.y")
    assert disturbance(*names, kind="sine", amplitude=(1.0, 2.0), density=8.0, hold=0.5) == [1, 1.0, 2.0]


def test_a_run_is_ideal_only_without_a_rate_that_moves_and_without_a_device() -> None:
    moving, noisy = {"rate.kind": "step", "rate.amplitude": 1.0}, {"device.position_noise": 1.0}
    assert device_core.is_ideal(ROUND)
    for changes in (moving, noisy, {**moving, **noisy}):
        assert not device_core.is_ideal(ROUND.replace(changes))


def test_estimates_start_at_a_share_of_the_truth_or_at_it_where_it_is_known() -> None:
    def initial(changes: dict[str, Any]) -> list[float]:
        found = to_core.core_numbers(ROUND.replace({"adaptation.initial_ratio": 0.5, **changes}))
        names = ("damping.xx", "damping.xy", "damping.yy", "stiffness.xx", "rate")
        return [found[f"adaptation.initial_{name}"] for name in names]

    assert initial({}) == pytest.approx([0.25, 0.0625, 0.125, 10.9, 1.0])
    assert initial({"controller.adaptive": False}) == pytest.approx([0.5, 0.125, 0.25, 21.8, 2.0])
    assert initial({"adaptation.initial_rate": 7.0})[-1] == 7.0
    assert initial({"adaptation.initial_rate": 7.0, "controller.adaptive": False})[-1] == 2.0


def test_the_boundary_layer_is_the_one_that_is_named() -> None:
    for place, layer in enumerate(("linear", "quadratic")):
        assert to_core.core_numbers(ROUND.replace({"controller.layer": layer}))["controller.layer"] == place


# -- The guard


def test_the_reference_reaches_its_amplitudes_and_at_most_their_speeds() -> None:
    reference = {"reference.amplitude": (1.0, -0.5), "reference.frequency": (4.0, 8.0)}
    assert to_core.reference_reach(ROUND.replace(reference)) == ((1.0, 0.5), (4.0, 4.0))


def test_patience_is_a_32nd_of_the_shortest_period_and_at_least_4() -> None:
    assert guard({"run.step": 1e-3}).patience == 39  # 2π/5/32 = 0.03927
    assert guard({}).patience == 4
    assert guard({"run.step": 1e-3, "guard.checked": False}).patience == 0
    assert guard({"run.step": 1e-3, "guard.patience": 7}).patience == 7


def test_saturation_is_borne_for_20_of_the_longest_periods_or_4_times_what_swinging_up_takes() -> None:
    def bears(limit: float, amplitude: tuple[float, float] = (-1.0, 0.5)) -> int:
        changes = {"run.step": 1e-3, "controller.force_limit": limit, "reference.amplitude": amplitude}
        return int(guard(changes).saturation_patience)

    assert bears(8.0) == 41_888  # 20 · 2π/3 = 41.888
    assert bears(0.5) == 80_000  # 8 · 5 · 1 / 0.5
    assert bears(0.5, (2.0, -3.0)) == 240_000
    assert bears(1e-9) == 10**9
    assert bears(math.inf) == 0
    assert to_core.guard(ROUND.replace({"controller.force_limit": 8.0})).saturation_patience == 0


@pytest.mark.parametrize(
    ("changes", "tolerance"),
    [
        ({"adaptation.initial_ratio": 1.0}, 0.1),
        ({"adaptation.initial_ratio": 0.96}, 0.1),
        ({"adaptation.initial_ratio": 0.8}, 2 * 0.25),
        ({"adaptation.initial_ratio": 0.8, "controller.adaptive": False}, 0.1),
        ({"adaptation.initial_ratio": 0.8, "guard.plant_tolerance": 0.3}, 0.3),
        ({"plant.stiffness_deviation": {"xx": 0.0, "xy": -5.45 * 512, "yy": 0.0}}, 2 * 0.25),
        ({"device.stiffness_drift": -1e5, "device.temperature_ramp": 4.0}, 2 * 0.1 * 2),  # half a second of it
        ({"device.stiffness_drift": -1e5, "device.temperature_points": [[0.0, -3.0], [1.0, 2.0]]}, 2 * 0.1 * 3),
        ({"device.pickoff_gain_error": [0.1, -0.2], "device.pickoff_misalignment": -0.1}, 2 * 0.3),
        ({"device.force_gain_error": [0.1, -0.2], "device.force_misalignment": -0.1}, 2 * 0.3),
    ],
)
def test_the_plant_may_be_off_by_twice_what_the_scenario_says_and_by_a_tenth(
    changes: dict[str, Any], tolerance: float
) -> None:
    assert guard({"adaptation.initial_ratio": 1.0, **changes}).plant_tolerance == pytest.approx(tolerance, rel=1e-12)


@pytest.mark.parametrize(
    ("changes", "tolerance"),
    [
        ({}, 0.0),
        ({"disturbance.kind": "noise", "disturbance.standard_deviation": 0.5}, 8 * 0.5),
        ({"disturbance.kind": "sine", "disturbance.amplitude": (1.0, -3.0)}, 3.0),
        ({"device.actuator_limit": 512.0, "device.actuator_bits": 4, "controller.force_limit": 4.0}, 2 * 4 / 16),
        ({"device.actuator_limit": 512.0, "controller.force_limit": 10.0}, 10.0 - 4.0),
        ({"device.actuator_limit": 512.0, "controller.force_limit": 3.0}, 0.0),
        ({"device.delay": 1, "controller.force_limit": 10.0}, 2 * 10.0),
        ({"controller.force_limit": 10.0}, 0.0),
    ],
)
def test_the_force_may_be_off_by_disturbance_converter_clipping_and_delay(
    changes: dict[str, Any], tolerance: float
) -> None:
    assert guard({"controller.force_limit": math.inf, **changes}).force_tolerance == pytest.approx(
        QUIET + tolerance, rel=1e-12
    )


def test_a_force_without_limit_that_is_late_or_clipped_has_a_bound_all_the_same() -> None:
    for changes in ({"device.delay": 1}, {"device.actuator_limit": 512.0}):
        assert guard({**changes, "controller.force_limit": math.inf}).force_tolerance == 1e9


def test_sensors_may_be_off_by_eight_deviations_and_a_level() -> None:
    found = guard({"device.position_noise": 0.25, "device.position_range": 0.5, "device.position_bits": 3})
    assert found.position_tolerance == pytest.approx(QUIET + 8 * 1.0 + 0.5, rel=1e-12)
    assert found.velocity_tolerance == QUIET
    found = guard({"device.velocity_noise": 4.0, "device.velocity_range": 8.0, "device.velocity_bits": 3})
    assert found.velocity_tolerance == pytest.approx(QUIET + 8 * 1.0 + 0.5, rel=1e-12)
    assert found.position_tolerance == QUIET
    found = guard({"device.position_range": [0.5, 0.25], "device.position_bits": 3})
    assert found.position_tolerance == pytest.approx(QUIET + 0.5, rel=1e-12)


def test_flicker_noise_counts_as_what_a_run_sees_of_it() -> None:
    # 64 steps: A^2/pi ln(64 pi) of 1/f, from one over the run to half the sampling frequency; A^2 = 2 pi 64/128 = pi.
    found = guard({"device.position_noise": 0.25, "device.position_noise_corner": 64.0}).position_tolerance
    assert 8 * math.sqrt(1 + math.log(64 * math.pi)) < found < 8 * math.sqrt(2 + math.log(64 * math.pi))


def test_what_is_set_stays_as_it_is() -> None:
    fields = {"plant_tolerance": 0.0, "force_tolerance": 0.0, "position_tolerance": 0.0, "velocity_tolerance": 0.0}
    fields |= {"patience": 0, "saturation_patience": 0}
    found = guard({"controller.force_limit": 8.0, **{f"guard.{name}": value for name, value in fields.items()}})
    assert {name: getattr(found, name) for name in fields} == fields
