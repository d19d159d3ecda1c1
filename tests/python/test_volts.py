"""A device in volts: its tables, what controllers know of it, and runs against an integration written out again."""

from __future__ import annotations

import math
import pickle
import re
import subprocess
from pathlib import Path
from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from click.testing import CliRunner
from fracgyro.cli import cli
from fracgyro.export.compilers import FLAGS, compiler
from fracgyro.export.fmu import fmu
from fracgyro.export.settings import without_plant
from fracgyro.scenario import ScenarioError
from fracgyro.scenario.device_core import device_values, sensor_variance
from fracgyro.scenario.named import exactly_sensed
from fracgyro.scenario.terms import first_part, frame_terms, terms
from fracgyro.scenario.to_core import core_numbers, datasheet
from fracgyro.scenario.volts_core import at_bias, has_volts, plant_at_bias
from scipy.integrate import solve_ivp

EPSILON = 8.8541878128e-12
BOLTZMANN = 1.380649e-23


def plates(role: str, angle: float, **fields: Any) -> dict[str, Any]:
    return {"role": role, "angle": angle, "count": 150, "gap": 4e-6, "area": 1.2e-8, "bias": 2.0, **fields}


def combs(role: str, angle: float, **fields: Any) -> dict[str, Any]:
    own = {"kind": "comb", "count": 200, "gap": 2e-6, "overlap": 2e-5, "thickness": 6e-5, "bias": 5.0}
    return {"role": role, "angle": angle, **own, **fields}


def both(make: Any, role: str, **fields: Any) -> list[dict[str, Any]]:
    return [make(role, angle, **fields) for angle in (0.0, math.pi / 2)]


QUIET = {"device.position_noise_density": 0.0, "disturbance": {"kind": "none"}, "run.duration": 20.0}
DUAL = fg.Scenario.shipped("dual_mass").replace(QUIET)
VOLTS = [*both(combs, "force"), *both(combs, "pickoff")]
CHARGE = {
    "electronics.amplifier": "charge",
    "electronics.feedback_resistance": 1e7,
    "electronics.input_capacitance": 4e-12,
    "electronics.voltage_noise": 5e-9,
}


def in_volts(changes: dict[str, Any] | None = None, electrodes: list[dict[str, Any]] | None = None) -> fg.Scenario:
    return DUAL.replace({"electrodes": VOLTS if electrodes is None else electrodes, **(changes or {})})


# -- The tables -------------------------------------------------------------------------------------------------------


def test_tables_in_volts_come_back_from_their_text_with_units() -> None:
    text = """
[[electrodes]]
role = "force"
kind = "comb"
bias = "5 V"
gap = "2 um"

[[electrodes]]
role = "force"
angle = "90 deg"
bias = 5.0
range = "10 V"
bits = 16

[electronics]
pole = ["1 MHz", 2e6]
sample_delay = "1 ns"
"""
    made = fg.Scenario.from_toml(f'device.sensing = "position"\n{text}')
    first, second = made.electrodes.each
    assert (first.kind, first.bias, first.gap, second.range) == ("comb", 5.0, 2e-6, 10.0)
    assert second.angle == math.pi / 2
    assert made.electronics.pole == (1e6, 2e6)
    assert made.electronics.sample_delay == 1e-9
    again = fg.Scenario.from_toml(made.to_toml())
    assert again == made
    assert again.to_toml() == made.to_toml()
    assert 'bias = "5 V"' in made.to_toml()
    assert fg.Scenario.from_toml(made.in_si().to_toml()) == made
    assert fg.Scenario().replace(made.changes()) == made


REFUSED: list[tuple[str, dict[str, Any], str]] = [
    ("offset", {"electrodes": [plates("tuning", 0.0, offset=4e-6)]}, "electrodes[0].offset is 4e-06: its magnitude"),
    ("kind", {"electrodes": [combs("quadrature", 0.0)]}, 'electrodes[0].kind is "comb": it must be skewed'),
    ("nulling", {"electrodes": [plates("tuning", 0.0, nulling=1.0)]}, "electrodes[0].nulling is 1.0: it must be 0.0"),
    ("noise", {"electrodes": [plates("tuning", 0.0, noise=1e-6)]}, "electrodes[0].noise is 1e-06: it must be 0.0"),
    ("bits", {"electrodes": both(combs, "force", bits=12)}, "electrodes[0].bits is 12 and electrodes[0].range is inf"),
    ("bias", {"electrodes": both(combs, "force", bias=0.0)}, "electrodes[0].bias is 0.0: it must be other than 0"),
    ("axes", {"electrodes": [combs("force", 0.0)]}, "electrodes of role force have one direction"),
    ("field", {"electrodes": [{"gab": 1e-6}]}, "electrodes[0].gab is not a known field; did you mean"),
    ("number", {"electrodes": [{"gap": -1e-6}]}, "electrodes[0].gap is -1e-06: it must be greater than 0"),
    ("many", {"electrodes": [{}] * 13}, "it must be a list of at most 12 tables"),
    ("noise", {"electronics.voltage_noise": 5e-9}, "electronics.voltage_noise is 5e-09: it needs"),
    ("carrier", {"electronics.carrier_voltage": 1.0}, "a carrier must have both"),
    ("late", {"electronics.sample_delay": 1e-5}, "electronics.sample_delay is 1e-05: sample_delay plus aperture"),
    ("held", {"electronics.update_delay": 1e-5}, "electronics.update_delay is 1e-05: it must be less than a step"),
    ("apart", {"electronics.feedthrough": [0.0, 1e-15, 0.0, 0.0]}, "it needs electrodes of role force and of role"),
    ("amplifier", {"electronics.amplifier": "charge"}, "must be ideal without electrodes of role pickoff"),
    ("linear", {"electronics.linearized": True}, "it needs pairs of plates of role force"),
    ("sensing", {"electronics.pole": 1e6, "device.sensing": "full"}, 'device.sensing is "full": it must be position'),
    ("plant", {"electronics.pole": 1e6, "plant.kind": "duffing"}, 'plant.kind is "duffing": it must be gyroscope'),
    ("common", {"device.common_mode_frequency": [1e4, 1e4]}, "device.common_mode_frequency is [10000.0, 10000.0]: it"),
    (
        "poles",
        {"electrodes": VOLTS, "electronics.amplifier": "transimpedance", "electronics.pole": [1e6, math.inf]},
        "electronics.pole is [1000000.0, inf]: it must be finite on both axes",
    ),
    ("leak", {"electrodes": VOLTS, "electronics.feedthrough_lag": 0.1}, "electronics.feedthrough_lag is 0.1: it needs"),
    ("flicker", {"electronics.carrier_flicker": 1e-5}, "it needs electronics.carrier_frequency"),
    ("soft", {"electrodes": [plates("tuning", 0.0, bias=60.0)]}, "electrodes soften plant.stiffness to a smallest"),
    (
        "softest",
        {"electrodes": [plates("tuning", 0.0), plates("tuning", 0.0, bias=60.0)]},
        "; electrodes[1] softens most, by 1792.97 N/m at a bias of 60 V",
    ),
    ("infinite", {"electrodes": [plates("tuning", 0.0, bias=1e300)]}, "electrodes[0] softens most, by inf N/m at a"),
    (
        "degrees",
        {"electrodes": [plates("tuning", 90.0)]},
        "electrodes[0].angle is 90.0: it is in rad, and its magnitude",
    ),
    (
        "converter",
        {"electrodes": [plates("tuning", 0.0, range=9.0, bits=8)]},
        "electrodes[0].bits is 8: it must be 0 for",
    ),
    (
        "single",
        {"electrodes": {"role": "force"}},
        "electrodes is one table: it must be a list of tables, each headed [[",
    ),
    ("text", {"electrodes": "none"}, "electrodes is 'none': it must be a list of tables, each headed [[electrodes]]"),
    (
        "parted",
        {"electrodes": both(combs, "force", overlap=1e-6)},
        "electrodes[0].overlap is 1e-06: it must be greater",
    ),
    (
        "parted skewed",
        {"electrodes": [combs("quadrature", 0.0, kind="skewed", overlap=1e-6)]},
        "electrodes[0].overlap is 1e-06: it must be greater",
    ),
    (
        "slow carrier",
        {"electrodes": VOLTS, "electronics.carrier_frequency": 5e3, "electronics.carrier_voltage": 1.0},
        "electronics.carrier_frequency is 5000.0: it must be greater than twice the resonance",
    ),
    ("jitter", {"electronics.jitter": 1.0}, "electronics.jitter is 1.0: it must be less than a step, which is"),
    (
        "converters",
        {
            "electrodes": both(combs, "force", range=10.0, bits=12),
            "device.actuator_bits": 8,
            "device.actuator_limit": 1e-5,
        },
        "device.actuator_bits is 8: it must be 0 with electrodes[0].bits, which is the converter, of 12 bits",
    ),
    ("place", {"electrodes[0].bias": 1.0}, "electrodes[0] is not in the scenario: it has 0 electrodes"),
    ("unnumbered", {"electrodes.gap": 1e-6}, "electrodes.gap is not a known field; did you mean electrodes[0].gap?"),
    ("pickoff", {"electrodes": both(combs, "pickoff", bias=0.0)}, "electrodes[0].bias is 0.0: a pick-off must have"),
    (
        "density",
        {"electrodes": VOLTS, **CHARGE, "device.position_noise_density": 1e-13},
        "device.position_noise_density is 1e-13: it must be 0.0 with electronics.amplifier charge",
    ),
]


@pytest.mark.parametrize(("changes", "said"), [case[1:] for case in REFUSED], ids=[case[0] for case in REFUSED])
def test_what_cannot_be_is_refused_in_one_sentence(changes: dict[str, Any], said: str) -> None:
    with pytest.raises(ScenarioError) as refused:
        DUAL.replace(changes)
    assert said in str(refused.value)


def test_a_number_of_a_list_of_tables_is_set_by_the_name_that_messages_have() -> None:
    made = in_volts().replace({"electrodes[2].bias": 4.0, "electrodes[0].range": "8 V"})
    assert [one.bias for one in made.electrodes.each] == [5.0, 5.0, 4.0, 5.0]
    assert [one.range for one in made.electrodes.each] == [8.0, math.inf, math.inf, math.inf]
    with pytest.raises(
        ScenarioError, match=r"^electrodes\[1\]\.gab is not a known field; did you mean electrodes\[1\]"
    ):
        made.replace({"electrodes[1].gab": 1e-6})
    with pytest.raises(ScenarioError, match=r"^electrodes\[1\]\.gap is -1e-06: it must be greater than 0"):
        made.replace({"electrodes[1].gap": -1e-6})
    with pytest.raises(ScenarioError, match=r"^electrodes and electrodes\[1\] are both given"):
        made.replace({"electrodes": VOLTS, "electrodes[1].gap": 1e-6})
    pushed = DUAL.replace({"disturbance": [{"kind": "none"}, {"kind": "pulse", "amplitude": [1.0, 0.0], "width": 1.0}]})
    later = pushed.replace({"disturbance[1].start": 3.0, "disturbance[0].seed": 7})
    assert later.differences(pushed) == {
        "disturbance[1].start": (3.0, 0.0),
        "disturbance.seed": (7, pushed.disturbance.seed),
    }


# -- Knowledge of controllers ------------------------------------------------------------------------------------------


def test_estimates_start_from_the_stiffness_at_bias() -> None:
    made = in_volts(electrodes=[plates("tuning", math.pi / 2, bias=7.2541)])
    softer = 2 * EPSILON * 150 * 1.2e-8 * 7.2541**2 / (4e-6) ** 3
    assert at_bias(made).softening == pytest.approx([0.0, 0.0, softer], abs=1e-9 * softer)
    assert plant_at_bias(made).stiffness.yy == pytest.approx(made.plant.stiffness.yy - softer)
    known = core_numbers(made)["adaptation.initial_stiffness.yy"]
    ratio, scale = made.adaptation.initial_ratio, made.plant.scales.stiffness
    assert known == pytest.approx(ratio * (made.plant.stiffness.yy - softer) / scale, rel=1e-12)


def test_an_exactly_sensed_device_has_its_springs_at_bias_and_no_volts() -> None:
    exact, shipped = exactly_sensed("dual_mass_volts"), fg.Scenario.shipped("dual_mass_volts")
    assert not has_volts(exact)
    assert exact.plant.stiffness == plant_at_bias(shipped).stiffness
    assert (exact.device.sensing, exact.adaptation.kind) == ("full", "composite")


def test_what_is_told_is_the_nominal_device() -> None:
    plain, odd = at_bias(in_volts()), in_volts(electrodes=[{**one, "fringe": 1.2, "offset": 1e-7} for one in VOLTS])
    np.testing.assert_array_equal(at_bias(odd).gain, plain.gain)
    np.testing.assert_array_equal(at_bias(odd).charge, plain.charge)
    assert plain.gain[0] == pytest.approx(4 * 200 * EPSILON * 6e-5 * 5.0 / 2e-6)


def test_noise_of_the_amplifiers_and_steps_of_the_driver_are_told() -> None:
    amplified = {**CHARGE, "electronics.current_noise": 3e-14}
    made = in_volts(amplified, [*both(combs, "force", range=10.0, bits=12), *both(combs, "pickoff")])
    slope, comb = 4 * 200 * EPSILON * 6e-5 / 2e-6, 4 * 200 * EPSILON * 6e-5 * 2e-5 / 2e-6
    omega = math.sqrt(at_bias_stiffness(made) / made.plant.mass)
    wanted = math.hypot(5e-9 * (comb + 4e-12), math.hypot(math.sqrt(4 * BOLTZMANN * 300 / 1e7), 3e-14) / omega) / (
        5.0 * slope
    )
    assert at_bias(made).noise[0] == pytest.approx(wanted, rel=1e-12)
    step = made.run.step * made.plant.scales.time
    deviations = np.sqrt(sensor_variance(device_values(made), "position")) * made.plant.scales.length
    assert deviations[0] == pytest.approx(wanted * math.sqrt(0.5 / step), rel=1e-12)
    assumed, by_steps = datasheet(made), datasheet(made.replace({"controller.kind": "internal_model"}))
    assert assumed.position_noise == pytest.approx(math.sqrt(np.mean(deviations**2)) / made.plant.scales.length)
    code = float(at_bias(made).gain[0]) * 20.0 / 2**12 / made.plant.scales.force
    assert by_steps.force_noise == pytest.approx(code / math.sqrt(12))
    assert assumed.force_noise == 0.0  # the joint filter takes the code itself


def test_noise_of_the_drivers_is_white_stated_and_as_large_as_it_says() -> None:
    """A density n up to half the sampling frequency f is n sqrt(f/2) V, and gives the force of a volt times that."""
    drivers = [combs("force", 0.0, noise=2e-6), combs("force", math.pi / 2, noise=5e-6)]
    made = in_volts(electrodes=[*drivers, *both(combs, "pickoff")])
    step, scales = made.run.step * made.plant.scales.time, made.plant.scales
    wanted = np.array([2e-6, 5e-6]) * math.sqrt(0.5 / step)
    rest = {"run.initial_position": (0.0, 0.0), "run.initial_velocity": (0.0, 0.0)}
    still = made.replace({**rest, "run.record_every": 1, "run.duration": 500.0})
    run = fg.simulate(still, controller=lambda sample: (0.0, 0.0))
    volts = run["drive_voltage"].values
    np.testing.assert_allclose(volts.std(axis=0), wanted, rtol=0.03)
    correlation = np.corrcoef(np.concatenate([volts[1:], volts[:-1]], axis=1).T)
    assert np.abs(correlation - np.eye(4)).max() < 0.04
    gain = float(at_bias(made).gain[0])
    forces = run["applied_control"].values * scales.force
    np.testing.assert_allclose(forces, gain * volts, rtol=1e-9)
    assert datasheet(made).force_noise == pytest.approx(gain * wanted[1] / scales.force)


def at_bias_stiffness(made: fg.Scenario) -> float:
    return float(plant_at_bias(made).stiffness.xx)


# -- Runs -------------------------------------------------------------------------------------------------------------


class Given:
    """Forces of a fixed course, nondimensional."""

    def __call__(self, sample: Any) -> tuple[float, float]:
        return force_at(sample.time)


def force_at(time: float) -> tuple[float, float]:
    return 1e-3 * math.sin(1.7 * time), -8e-4 * math.cos(0.6 * time)


def moved_force(one: Any, q: np.ndarray, volts: np.ndarray, shift: np.ndarray) -> np.ndarray:
    """The same with the common mode at `shift`, less what it pulls on a mass at rest without the driver."""
    none = np.zeros(2)
    return force_of(one, q + shift, volts) - force_of(one, shift, none) + force_of(one, none, none)


def force_of(one: Any, q: np.ndarray, volts: np.ndarray) -> np.ndarray:
    """N at q in m: half of V^2 dC/dq of every part."""
    n = np.array([math.cos(one.angle), math.sin(one.angle)])
    across = np.array([-n[1], n[0]])
    v = float(n @ volts) if one.role == "force" else 0.0
    x, y = float(n @ q) + one.offset, float(across @ q)
    f = 0.5 * EPSILON * one.fringe * one.count
    total = np.zeros(2)
    for side in (1.0, -1.0) if one.pair else (1.0,):
        square = f * (one.bias + side * v) ** 2
        if one.kind == "plate":
            total += square * one.area / (one.gap - side * x) ** 2 * side * n
        else:
            near, far = one.gap - y, one.gap + y
            total += square * one.thickness * (1 / near + 1 / far) * side * n
            total += square * one.thickness * (one.overlap + side * x) * (1 / near**2 - 1 / far**2) * across
    return total


def oracle(made: fg.Scenario, steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions and samples of them at each step, nondimensional: everything in SI, integrated."""
    plant, e, scales = made.plant, made.electronics, made.plant.scales
    h, m = made.run.step * scales.time, plant.mass
    stiff = np.array([[plant.stiffness.xx, plant.stiffness.xy], [plant.stiffness.xy, plant.stiffness.yy]])
    damp = np.array([[plant.damping.xx, plant.damping.xy], [plant.damping.xy, plant.damping.yy]])
    turn = 2 * m * plant.angular_rate * np.array([[0.0, -1.0], [1.0, 0.0]])
    gain, charge = at_bias(made).gain[[0, 2]], at_bias(made).charge[[0, 2]]
    passes = np.reshape(e.feedthrough, (2, 2)) / charge[:, None]  # m/V
    pole = 2 * math.pi * np.array(e.pole)
    common = np.array([math.tau * each if math.isfinite(each) else 0.0 for each in made.device.common_mode_frequency])
    push = sum((np.array(each.amplitude) for each in made.disturbance.entries if each.amplitude), np.zeros(2))
    push *= scales.acceleration * (common > 0)
    quality = np.array(made.device.common_mode_quality)

    def derivative(_: float, state: np.ndarray, volts: np.ndarray) -> np.ndarray:
        q, v, z, shift, moves = state.reshape(5, 2)
        force = sum((moved_force(one, q, volts, shift) for one in made.electrodes.each), np.zeros(2))
        read = reading(made, q + shift) - reading(made, shift) + passes @ volts
        away = push - common / quality * moves - common**2 * shift
        return np.concatenate([v, (force - (damp + turn) @ v - stiff @ q) / m, pole * (read - z), moves, away])

    q, v = np.array(made.run.initial_position), np.array(made.run.initial_velocity)
    resonance = np.sqrt(np.diag(stiff) / m - at_bias(made).softening[[0, 2]] / m)
    lag = resonance / pole
    first = (q - lag * v * scales.rate / resonance) / (1 + lag**2)
    bent = reading(made, q * scales.length) / scales.length - q
    state = np.concatenate([q * scales.length, v * scales.velocity, first * scales.length, np.zeros(4)])
    positions, samples = [q], [first + bent]
    before = np.zeros(2)
    for n in range(steps):
        now = np.array(force_at(n * made.run.step)) * scales.force / gain
        t, sampled = 0.0, h - e.sample_delay
        for until, volts in ((e.update_delay, before), (sampled, now), (h, now)):
            if until > t:
                found = solve_ivp(derivative, (t, until), state, args=(volts,), rtol=1e-11, atol=1e-20, method="DOP853")
                state, t = found.y[:, -1], until
            if until == sampled and len(samples) == n + 1:
                samples.append(state[4:6] / scales.length)
        positions.append(state[:2] / scales.length)
        before = now
    return np.array(positions), np.array(samples)


def reading(made: fg.Scenario, q: np.ndarray) -> np.ndarray:
    """The position as pick-offs along x and y read it, m: the difference of their capacitances over its slope."""
    found = np.zeros(2)
    for one in made.electrodes.of("pickoff"):
        axis = int(abs(math.sin(one.angle)) > 0.5)
        x, y = q[axis] + one.offset, (q[1] if axis == 0 else -q[0])
        if one.kind == "plate":
            found[axis] = one.fringe * (
                one.gap**2 / 2 * (1 / (one.gap - x) - 1 / (one.gap + x))
                - one.gap**2 / 2 * (1 / (one.gap - one.offset) - 1 / (one.gap + one.offset))
            )
        else:
            found[axis] = one.fringe * (x * one.gap / 2 * (1 / (one.gap - y) + 1 / (one.gap + y)) - one.offset)
    return found


@pytest.mark.parametrize("make", [plates, combs])
def test_a_run_is_that_of_its_equations(make: Any) -> None:
    odd = {"fringe": 1.1, "offset": 5e-8}
    electrodes = [*both(make, "force", **odd), *both(make, "pickoff", **odd), plates("tuning", 0.3, offset=1e-7)]
    made = in_volts(
        {
            "run.step": 0.01,
            "run.duration": 1.5,
            "run.initial_position": [0.1, 0.05],
            "run.initial_velocity": [-0.1, 0.06],
            "electronics.pole": [3e5, 1e6],
            "electronics.feedthrough": [1e-16, 2e-15, -1e-15, 3e-16],
            "electronics.sample_delay": 1.1e-7,
            "electronics.update_delay": 0.7e-7,
        },
        electrodes,
    )
    run = fg.simulate(made, controller=Given())
    positions, samples = oracle(made, 150)
    np.testing.assert_allclose(run["position"], positions, atol=1e-6)
    np.testing.assert_allclose(run["measured_position"][1:], samples[1:], atol=1e-6)
    plain = fg.simulate(DUAL.replace({name: value for name, value in made.changes().items() if "run." in name}))
    assert abs(plain["position"].values - positions[: plain.sizes["time"]]).max() > 1e-4


@pytest.mark.parametrize("drifts", [False, True])
def test_an_acceleration_shifts_the_gaps_by_the_common_mode(drifts: bool) -> None:
    """300 g, for shifts of up to a third of the gap: what they do grows with their squares."""
    made = in_volts(
        {
            "run.step": 0.01,
            "run.duration": 1.5,
            "run.initial_position": [0.1, 0.05],
            "run.initial_velocity": [-0.1, 0.06],
            "electronics.pole": [1e6, 1e6],
            "disturbance": [{"kind": "step", "quantity": "acceleration", "amplitude": [0.8, -1.2]}],
            "device.acceleration_share": [0.0, 0.0],
            "device.common_mode_frequency": [9000.0, 12000.0],
            "device.common_mode_quality": [2.0, 5.0],
            **({"device.stiffness_drift": 1e-9, "device.temperature_ramp": 1.0} if drifts else {}),
        },
        [*both(plates, "force", bias=4.0), *both(plates, "pickoff"), plates("tuning", 0.3, bias=6.0)],
    )
    run = fg.simulate(made, controller=Given())
    positions, samples = oracle(made, 150)
    np.testing.assert_allclose(run["position"], positions, atol=2e-6)
    np.testing.assert_allclose(run["measured_position"][1:], samples[1:], atol=2e-6)
    still = fg.simulate(made.replace({"device.common_mode_frequency": [math.inf, math.inf]}), controller=Given())
    assert abs(still["position"].values - positions).max() > 5e-5
    assert abs(still["measured_position"].values - samples).max() > 1e-3


def test_an_acceleration_that_shifts_gaps_is_no_number_that_a_target_can_set() -> None:
    shaken = {"kind": "sine", "quantity": "acceleration", "amplitude": [0.1, 0.2], "frequency": [1.0, 1.0]}
    small = {"run.initial_position": [0.1, 0.05], "run.initial_velocity": [-0.1, 0.06], "run.duration": 1.5}
    made = in_volts({"disturbance": [shaken], **small})
    assert (first_part(made)["kind"], terms(made)) == ("sine", [])
    shifts = made.replace({"device.common_mode_frequency": [9000.0, 12000.0]})
    assert first_part(shifts)["kind"] == "none"
    assert terms(shifts) == frame_terms(shifts)
    stiff = fg.simulate(shifts.replace({"device.common_mode_frequency": [1e7, 1e7]}), controller=Given())
    still = fg.simulate(made, controller=Given())
    np.testing.assert_allclose(stiff["position"], still["position"], rtol=0.0, atol=1e-9)


def test_a_carrier_that_flickers_scales_both_readings() -> None:
    bound = 1e-4
    made = in_volts(
        {
            "electronics.carrier_frequency": 1e6,
            "electronics.carrier_voltage": 1.0,
            "electronics.carrier_flicker": bound,
            "run.record_every": 1,
            "run.duration": 10_000.0,
            "run.initial_position": [0.1, 0.1],
            "run.initial_velocity": [0.0, 0.0],
            "plant.damping": {"xx": 0.0, "xy": 0.0, "yy": 0.0},
        }
    )
    run = fg.simulate(made, controller=lambda sample: (0.0, 0.0))
    ideal = fg.simulate(made.replace({"electronics.carrier_flicker": 0.0}), controller=lambda sample: (0.0, 0.0))
    read, plain = run["measured_position"].values, ideal["measured_position"].values
    x, y = (read / plain).T
    clear = abs(plain).min(axis=1) > 0.005
    np.testing.assert_allclose(x[clear], y[clear], rtol=1e-12)
    gain = np.where(abs(plain[:, 0]) > abs(plain[:, 1]), x, y) - 1.0
    for length in (64, 512):  # flicker has the same Allan deviation at all times
        means = gain[: len(gain) // length * length].reshape(-1, length).mean(axis=1)
        assert math.sqrt(np.mean(np.diff(means) ** 2) / 2) == pytest.approx(0.664 * bound, rel=0.12)


def test_a_mass_that_is_pulled_in_says_by_which_electrode() -> None:
    electrodes = [plates("tuning", 0.0), plates("tuning", math.pi / 2, bias=40.0, pair=False)]
    with pytest.raises(fg.DivergedError, match=r"the mass touched electrodes\[1\], of role tuning") as ended:
        fg.simulate(in_volts(electrodes=electrodes), controller=lambda sample: (0.0, 0.0))
    assert ended.value.electrode == 1
    assert np.isfinite(ended.value.run["position"]).all()


def test_electrodes_without_voltages_change_no_bit() -> None:
    given = fg.simulate(DUAL)
    off = fg.simulate(in_volts(electrodes=[plates("tuning", 0.0, bias=0.0, gap=4e-5)]))
    for name in given:
        np.testing.assert_array_equal(given[name], off[name])


# The noise-free force rebalance of a device with 300 deg/s of quadrature: its output in deg/h after it has settled.
HERTZ = 1 / 3925.0
REBALANCE = {
    "controller.kind": "force_rebalance",
    "reference.kind": ["sine", "rest"],
    "controller.pll_bandwidth": 100 * HERTZ,
    "controller.amplitude_bandwidth": 100 * HERTZ,
    "controller.amplitude_integral": 20 * HERTZ,
    "controller.demodulation_bandwidth": 2000 * HERTZ,
    "controller.rebalance_bandwidth": 200 * HERTZ,
    "controller.output_bandwidth": 90 * HERTZ,
    "plant.angular_rate": 0.0,
    "run.initial_position": [0.0, 0.0],
    "run.initial_velocity": [1.0, 0.0],
    "run.duration": 2000.0,
    "run.record_every": 10,
}


def bias(made: fg.Scenario) -> float:
    """deg/h: the mean of the second half of a run."""
    rate = fg.simulate(made)["rate_estimate"].values * made.plant.scales.rate
    return float(np.degrees(rate[len(rate) // 2 :].mean()) * 3600)


def test_a_pole_turns_quadrature_into_rate_for_force_rebalance() -> None:
    plant = DUAL.plant
    coupled = 2 * plant.mass * plant.reference_frequency * math.radians(300.0)
    still = DUAL.replace({**REBALANCE, "plant.stiffness_deviation": {"xx": 0.0, "xy": coupled, "yy": 0.0}})
    of_itself = bias(still)
    late = still.replace({"electronics.pole": 1e6})
    pole = bias(late.replace({"datasheet.lag": 0.0})) - of_itself
    closed = 300.0 * 3600 * math.sin(math.atan(3925.29 / 1e6))
    assert abs(pole) == pytest.approx(closed, rel=0.03)
    assert abs(of_itself) < 0.01 * closed
    assert abs(bias(late) - of_itself) < 1e-4 * closed  # known, as everything that the datasheet leaves out
    step = still.run.step * still.plant.scales.time
    parts = {
        "electronics.sample_delay": 0.3 * step,
        "electronics.update_delay": 0.4 * step,
        "electronics.aperture": 0.5 * step,
    }
    assert abs(bias(still.replace(parts)) - of_itself) < 1e-4 * closed
    hidden = 300.0 * 3600 * math.sin(0.95 * still.run.step)
    assert abs(bias(still.replace({**parts, "datasheet.lag": 0.0})) - of_itself) == pytest.approx(hidden, rel=0.03)


def test_the_automotive_device_reads_its_rate_with_the_noise_of_such_a_part() -> None:
    made = fg.Scenario.load(Path(__file__).resolve().parents[2] / "examples/scenarios/automotive.toml")
    rate = fg.simulate(made)["rate_estimate"].values[-40_000:] / float(made.plant.angular_rate)
    read = np.degrees(rate * made.plant.angular_rate * made.plant.scales.rate)
    assert read.mean() == pytest.approx(300.0 * (1 + made.run.step**2 / 24), rel=0.003)  # 16 samples a period
    # White over an output of 90 Hz, a band of pi/2 times that: 0.01 to 0.02 deg/s/sqrt(Hz).
    assert 0.01 < read.std() / math.sqrt(90.0 * math.pi / 2) < 0.02


def test_a_transimpedance_amplifier_reads_the_same_rate_a_quarter_turn_early() -> None:
    shipped = fg.Scenario.shipped("dual_mass_volts")
    made = shipped.replace(
        {
            **REBALANCE,
            "plant.angular_rate": math.radians(200.0),
            "run.initial_position": (0.0, 0.0),
            "electronics.feedthrough": (0.0,) * 4,
            "run.duration": 0.2 * shipped.plant.scales.rate,
        }
    )

    def read(changes: dict[str, Any]) -> float:
        rate = fg.simulate(made.replace(changes))["rate_estimate"].values
        return float(rate[-len(rate) // 10 :].mean() * made.plant.scales.rate / made.plant.angular_rate)

    amplifier = {"electronics.amplifier": "transimpedance"}
    assert read(amplifier) == pytest.approx(read({}), rel=2e-3)
    with pytest.raises(fg.DivergedError):  # a law that takes the quarter turn for none
        read({**amplifier, "datasheet.lag": 0.0})
    with pytest.raises(ScenarioError, match="amplifier is transimpedance, which reads the velocity"):
        shipped.replace(amplifier)


# -- Other targets ----------------------------------------------------------------------------------------------------


def test_a_controller_is_exported_for_the_stiffness_at_bias() -> None:
    made = in_volts(electrodes=[plates("tuning", math.pi / 2, bias=7.0)])
    mechanical = DUAL.replace({"plant.stiffness": dict(plant_at_bias(made).stiffness)})
    assert core_numbers(without_plant(made)) == core_numbers(without_plant(mechanical))
    assert core_numbers(without_plant(made)) != core_numbers(without_plant(DUAL))


@pytest.mark.parametrize("of_run", ["nondimensional", "SI"])
def test_a_plant_in_volts_is_the_plant_between_its_drivers_and_amplifiers(of_run: str) -> None:
    made = fg.Scenario.shipped("dual_mass_volts").replace({"run.units": of_run})
    at, scales, feedback = at_bias(made), made.plant.scales, made.electronics.feedback_capacitance
    force, length = (1.0, 1.0) if of_run == "SI" else (scales.force, scales.length)
    plant, in_forces = fg.Plant(made, units="V"), fg.Plant(made)
    for step in range(40):
        drive = (0.3 * step - 4.0, 12.0 if step == 20 else -0.2)  # beyond the range of 10 V once
        found = plant.step(drive)
        wanted = in_forces.step((drive[0] * at.gain[0] / force, drive[1] * at.gain[2] / force))
        outputs = [q * length * c / feedback for q, c in zip(wanted.position, at.charge[[0, 2]], strict=True)]
        assert found.position == pytest.approx(outputs, rel=1e-12)
        assert found.time == pytest.approx((step + 1) * made.run.step * scales.time, rel=1e-12)
    assert np.abs(plant.motion.position).max() > 1.0  # V: 5 um times 1.44 pC/um over 2 pF
    resumed = pickle.loads(pickle.dumps(plant))
    assert resumed.step((1.0, 1.0)).position == plant.step((1.0, 1.0)).position


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"electronics.feedback_capacitance": 0.0}, "electronics.feedback_capacitance is 0.0: in units"),
        (
            {"electrodes": both(combs, "pickoff"), "electronics.feedthrough": (0.0,) * 4},
            "electrodes of role force are missing: in units",
        ),
        ({"electronics": {}}, 'electronics.amplifier is "ideal": in units "V" it must be charge'),
    ],
    ids=["capacitance", "drivers", "amplifier"],
)
def test_a_plant_in_volts_needs_drivers_and_amplifiers(changes: dict[str, Any], said: str) -> None:
    made = fg.Scenario.shipped("dual_mass_volts").replace(changes)
    with pytest.raises(ScenarioError) as refused:
        fg.Plant(made, units="V")
    assert said in str(refused.value)
    with pytest.raises(ValueError, match=re.escape("units is 'mV': it must be \"V\" or None")):
        fg.Plant(made, units="mV")


@pytest.mark.parametrize("kind", ["fractional_fast_terminal", "lqg"])
def test_a_controller_that_knows_the_rounded_force_is_that_of_the_loop(kind: str) -> None:
    made = fg.Scenario.shipped("dual_mass_volts").replace({"controller.kind": kind, "run.duration": 20.0})
    wanted = fg.simulate(made.replace({"run.record_every": 1}))["control"].values

    def forces(knows: bool) -> Any:
        controller, plant = fg.Controller(made), fg.Plant(made)
        motion, found = plant.motion, []
        for _ in wanted:
            found.append(controller.step(motion.time, motion.position))
            motion = plant.step(found[-1])
            if knows:
                assert plant.rounded is not None
                controller.acted(plant.rounded)
        return np.array(found)

    np.testing.assert_array_equal(forces(knows=True), wanted)
    step = 20.0 / 2**16 * at_bias(made).gain[[0, 2]] / made.plant.scales.force
    assert np.abs(forces(knows=False) - wanted).max() > 0.1 * step.min()
    with pytest.raises(ValueError, match=r"^force is \[nan, 0\.0\]"):
        fg.Controller(made).acted([math.nan, 0.0])


WITH_ROUNDING = """
#include "fracgyro.h"
#include <stdio.h>
int main(void) {
    static fracgyro_state state;
    fracgyro_init(&state);
    fracgyro_vector position, acting, force;
    while (scanf("%la %la %la %la", &position.x, &position.y, &acting.x, &acting.y) == 4) {
        const fracgyro_motion motion = {position, {0, 0}};
        fracgyro_step(&state, &motion, &force);
        fracgyro_acted(&state, &acting);
        printf("%a %a\\n", force.x, force.y);
    }
    return 0;
}
"""


def test_firmware_that_knows_the_rounded_force_has_the_bits_of_the_controller(tmp_path: Path) -> None:
    made = fg.Scenario.shipped("dual_mass_volts").replace({"guard.checked": True})
    controller, plant = fg.Controller(made), fg.Plant(made)
    motion, rows, wanted = plant.motion, [], []
    for step in range(300):
        position = (math.nan, 0.0) if step in (100, 101) else motion.position
        wanted.append(controller.step(controller.time, position))
        motion = plant.step(wanted[-1])
        assert plant.rounded is not None
        controller.acted(plant.rounded)
        rows.append([*position, *plant.rounded])
    fg.export.firmware(made, tmp_path / "firmware", "double")
    (tmp_path / "firmware/rounding.c").write_text(WITH_ROUNDING, encoding="utf-8")
    words = [*compiler(), "-O1", *FLAGS, "-Iinclude", "fracgyro.cpp", "-x", "c++", "rounding.c", "-o", "rounding"]
    subprocess.run(words, cwd=tmp_path / "firmware", check=True)
    given = "\n".join(" ".join(float.hex(each) for each in row) for row in rows)
    ran = subprocess.run([tmp_path / "firmware/rounding"], input=given, capture_output=True, text=True, check=True)
    found = [[float.fromhex(each) for each in line.split()] for line in ran.stdout.splitlines()]
    np.testing.assert_array_equal(found, wanted)


def test_a_target_that_cannot_state_the_rounded_force_needs_its_steps_as_noise(tmp_path: Path) -> None:
    made = fg.Scenario.shipped("dual_mass_volts")
    step = 20.0 / 2**16 * at_bias(made).gain[[0, 2]].max() / made.plant.scales.force
    noise = math.hypot(datasheet(made).force_noise or math.nan, step / math.sqrt(12))
    for export in (
        lambda given: fg.export.matlab(given, tmp_path / "matlab"),
        lambda given: fmu(given, tmp_path / "controller.fmu", content="controller"),
    ):
        with pytest.raises(ScenarioError, match=r"^datasheet\.force_noise is not given: .*, (\S+)$") as refused:
            export(made)
        assert float(str(refused.value).split()[-1]) == pytest.approx(noise, rel=1e-5)
        export(made.replace({"datasheet.force_noise": noise}))
    # Without rounding, or without a filter of the motion, nothing is missing.
    exact = [{**dict(one), "bits": 0} for one in made.electrodes.each]
    fg.export.matlab(made.replace({"electrodes": exact}), tmp_path / "exact")
    plain = made.replace({"controller.kind": "pid", "controller.observer_bandwidth": 1.0, "adaptation": {}})
    fg.export.matlab(plain, tmp_path / "pid")


def test_a_replay_of_a_run_whose_drivers_round_is_refused(tmp_path: Path) -> None:
    made = fg.Scenario.shipped("dual_mass_volts").replace({"run.duration": 2.0, "run.record_every": 1})
    fg.simulate(made).to_netcdf(tmp_path / "run.nc", engine="h5netcdf")
    with pytest.raises(ValueError, match=r"run\.nc was recorded with electrodes whose drivers round the force"):
        fg.export.replay(tmp_path / "run.nc", "host")


# -- fracgyro scenario FILE --at-bias ----------------------------------------------------------------------------------


def printed_at_bias(name: str) -> dict[str, list[float]]:
    """Numbers of each row of the command, by its name."""
    found = CliRunner().invoke(cli, ["scenario", name, "--at-bias"])
    assert found.exit_code == 0, found.output
    rows = (re.split(r"\s{2,}", line.strip(), maxsplit=1) for line in found.stdout.splitlines()[1:])
    numbers = re.compile(r"-?\d[\d.]*(?:e[+-]?\d+)?")
    return {row: [float(each) for each in numbers.findall(values)] for row, values in rows}


def test_at_bias_prints_the_closed_forms_of_the_dual_mass_device() -> None:
    """Each number from the published dimensions, DEVICE.md's table of electrodes written out again."""
    found, omega = printed_at_bias("dual_mass_volts"), (math.tau * 3925.29, math.tau * 3978.45)
    drive = 4 * 404700 * EPSILON * 6e-5 * 5.0 / 1e-3  # N/V, combs: 4 N eps t V/g
    push = 2 * 58 * EPSILON * 1.078481e-8 * 5.0 / 4e-6**2  # pairs of plates: 2 N eps a V/g^2
    comb, plate = 2 * 67667 * EPSILON * 6e-5 / 1e-3, 100 * EPSILON * 1.0571e-8 / 4e-6  # F/m, F: one side
    charges = [2 * comb * 5.0, 2 * plate / 4e-6 * 5.0]
    assert found["frequencies x, y"] == pytest.approx([3925.29, 3978.45], rel=1e-8)
    assert found["charge of the pick-offs"] == pytest.approx(charges, rel=1e-5)
    assert found["capacitance"] == pytest.approx([2 * comb * 2e-5, 2 * plate], rel=1e-5)
    assert found["force per volt"] == pytest.approx([drive, push], rel=1e-5)
    assert found["full scale"] == pytest.approx([10 * drive, 10 * push], rel=1e-5)
    assert found["one step of the converters"] == pytest.approx([20 * drive / 2**16, 20 * push / 2**16], rel=1e-5)
    noise = [
        math.hypot(1e-8 * (capacitance + 22e-12), math.sqrt(4 * BOLTZMANN * 300 / 1e10) / w) / charge
        for capacitance, charge, w in zip(found["capacitance"], charges, omega, strict=True)
    ]
    assert found["noise of the position"] == pytest.approx(noise, rel=1e-5)


def test_at_bias_prints_the_published_pull_in_and_the_softening() -> None:
    found = printed_at_bias("dual_mass_volts")
    assert abs(found["quadrature"][0]) < 1e-6
    pickoff, force = 2 * EPSILON * 100 * 1.0571e-8 * 25, 2 * EPSILON * 58 * 1.078481e-8 * 25
    combs = 4 * EPSILON * 30 * 6e-5 * 1e-5 / 5e-6**3 * (1 + 2.5**-3) * (5.0**2 + 5.0**2)  # four groups at V_0 +- v
    walls = 4 * EPSILON * (404700 + 67667) * 6e-5 * 2e-5 * 25 / 1e-3**3  # combs of x, across their fingers
    assert found["softening xx, yy"][1] == pytest.approx((pickoff + force) / 4e-6**3 + combs + walls, rel=1e-5)
    # sqrt(k g^3/(2 eps A)), with k_yy at bias: 44.5232 V.
    volts = math.sqrt(1.42e-6 * (math.tau * 3978.45) ** 2 * 4e-6**3 / (2 * EPSILON * 150 * 1.078481e-8))
    assert found["pull-in of electrodes[4]"] == pytest.approx([volts, 0.0], rel=1e-5)


def test_a_scenario_without_electrodes_has_no_bias() -> None:
    found = CliRunner().invoke(cli, ["scenario", "dual_mass", "--at-bias"], standalone_mode=False)
    assert "electrodes are missing: a scenario without them has no bias" in str(found.exception)
