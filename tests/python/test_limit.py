"""The limit of tracking against a published table, its own law simulated, and every contender."""

from __future__ import annotations

from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from fracgyro import _core
from fracgyro.scenario.linear import continuous
from fracgyro.scenario.to_core import core_setup
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm, solve_discrete_are
from scipy.optimize import minimize

PAPER = fg.Scenario.paper().replace({"controller.force_limit": 1000.0})
DUAL_MASS = fg.Scenario.shipped("dual_mass")
DEVICES = {name: fg.Scenario.shipped(name) for name in ("dual_mass", "disc", "tuned_in_air", "paper_resonance")}
DEVICES["paper"] = PAPER
KNOWN = {"disturbance.kind": "none", "controller.kind": "pid"}


def sensed(scenario: fg.Scenario, information: str, noise: float) -> fg.Scenario:
    """In class F positions and velocities are measured, in class P positions; `noise` in m/sqrt(Hz)."""
    full = information == "F"
    return scenario.replace(
        {
            "device.sensing": "full" if full else "position",
            "device.position_noise_density": noise,
            "device.velocity_noise_density": noise * scenario.plant.reference_frequency if full else 0.0,
        }
    )


def steady(scenario: fg.Scenario, ceiling: float | None = None) -> np.ndarray:
    found: np.ndarray = fg.limit.tracking(scenario, ceiling)["rmse_steady"].values
    return found


# -- The table ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("information", "noise", "ceiling", "x", "y", "own"),
    [
        ("F", 1e-13, 0.0035, 3.12e-6, 2.91e-6, 2.23e-6),
        ("F", 1e-13, 0.05, 2.31e-6, 2.30e-6, 2.23e-6),
        ("P", 1e-13, 0.0035, 3.85e-5, 3.71e-5, 2.77e-5),
        ("P", 1e-13, 0.05, 3.20e-5, 3.15e-5, 2.77e-5),
        ("F", 0.0, 0.0035, 2.17e-6, 1.85e-6, 0.0),
        ("F", 0.0, 0.05, 5.78e-7, 5.53e-7, 0.0),
    ],
)
def test_the_limit_is_that_of_an_independent_program(
    information: str, noise: float, ceiling: float, x: float, y: float, own: float
) -> None:
    found = fg.limit.tracking(sensed(PAPER, information, noise), ceiling)
    assert found["rmse_steady"].values == pytest.approx([x, y], rel=3e-3)
    assert float(found["filter_error"].sel(axis="x")) == pytest.approx(own, rel=3e-3)
    assert float(found["chattering_reached"].max()) == pytest.approx(ceiling, rel=1e-6)


def test_the_limit_of_the_transient_is_that_of_an_independent_program() -> None:
    coarse = PAPER.replace({"run.step": 2e-3, "disturbance.hold": 2e-3})
    assert fg.limit.tracking(coarse)["rmse_transient"].values == pytest.approx([0.0190, 0.0231], abs=5e-5)
    assert fg.limit.tracking(PAPER)["rmse_transient"].values == pytest.approx([0.01865, 0.02285], abs=5e-6)


# -- Simulated ---------------------------------------------------------------------------------------------------------


def simulated(scenario: fg.Scenario, price: float, settling: int, runs: int = 48, steps: int = 4000) -> Any:
    """RMS error, and chattering, of filter and feedback at this price, in a simulation with another formulation.

    State: motion, forces that wait, and the last two. The sensors have no errors but noise.
    """
    whole = np.array(_core.plant_map(core_setup(scenario.replace({"controller.kind": "pid"}))))
    f, g = whole[:, :4], whole[:, 4:]
    step, delay = scenario.run.step, scenario.device.delay
    given, device, scales = scenario.disturbance, scenario.device, scenario.plant.scales
    sigma = given.standard_deviation if given.density is None else (given.density / step) ** 0.5
    per_sample = (0.5 / (step * scales.time)) ** 0.5
    noises = [device.position_noise_density * per_sample / scales.length]
    if device.sensing == "full":
        noises.append(device.velocity_noise_density * per_sample / scales.velocity)
    c, noise = np.eye(4)[: 2 * len(noises)], np.repeat(noises, 2)
    before = np.zeros((4, 4))
    for _ in range(20_000):
        s = c @ before @ c.T + np.diag(noise**2)
        after = before - before @ c.T @ np.linalg.pinv(s) @ c @ before
        now = f @ after @ f.T + sigma**2 * g @ g.T
        if np.abs(now - before).max() <= 1e-12 * np.abs(now).max():
            break
        before = now
    kalman = before @ c.T @ np.linalg.pinv(c @ before @ c.T + np.diag(noise**2))
    # The force along the reference: from the frequency response, one frequency per axis.
    r, frequencies = scenario.reference, np.array(scenario.reference.frequency)
    turns = np.exp(1j * frequencies * step)
    responses = [np.linalg.solve(turn * np.eye(4) - f, g) for turn in turns]
    phasors = -1j * np.array(r.amplitude) * np.exp(1j * np.array(r.phase))
    forces = np.array([np.linalg.inv(w[:2])[:, axis] * phasors[axis] for axis, w in enumerate(responses)])
    motions = np.array([w @ force for w, force in zip(responses, forces, strict=True)])
    rms = np.sqrt((np.abs(forces) ** 2 / 2).sum(axis=0))
    # u(n) acts at n + delay: the motion by then follows from the waiting forces. The cost is that of e at n + delay.
    size = 4 + 4
    a, b = np.zeros((size, size)), np.vstack([g, np.eye(2), np.zeros((2, 2))])
    a[:4, :4], a[6:, 4:6] = f, np.eye(2)
    change = np.hstack([np.zeros((2, 4)), -2 * np.eye(2), np.eye(2)])  # u + change x = second difference
    w2 = price * np.diag(1 / rms**2)
    unit = np.diag([1e6, 1e6, 1e3, 1e3, *1 / rms, *1 / rms])  # for the solver
    q = np.diag([1.0, 1.0, *np.zeros(6)]) + change.T @ w2 @ change
    back = np.linalg.inv(unit)
    x = solve_discrete_are(
        unit @ a @ back, unit @ b @ np.diag(rms), 1e12 * back @ q @ back, 1e12 * price * np.eye(2),
        s=1e12 * back @ change.T @ w2 @ np.diag(rms),
    )  # fmt: skip
    x = unit @ x @ unit / 1e12
    gain = np.linalg.solve(w2 + b.T @ x @ b, b.T @ x @ a + w2 @ change)
    powers = [np.linalg.matrix_power(f, k) for k in range(delay + 1)]
    rng = np.random.default_rng(1)

    def along(phasor: np.ndarray, n: int) -> np.ndarray:
        return np.real(np.exp(1j * frequencies * step * n) @ phasor)

    state = np.repeat(along(motions, 0)[np.newaxis], runs, axis=0)
    guess = state - along(motions, 0)
    waiting = [np.zeros((runs, 2)) for _ in range(delay)]
    last = [np.zeros((runs, 2)), np.zeros((runs, 2))]
    square, asked, requests = np.zeros(2), [], []
    for n in range(settling + steps):
        measured = state @ c.T + noise * rng.standard_normal((runs, len(c)))
        guess = guess + (measured - (along(motions, n) + guess) @ c.T) @ kalman.T
        ahead = guess @ powers[delay].T
        for k, force in enumerate(waiting):
            ahead = ahead + force @ (powers[delay - 1 - k] @ g).T
        u = -np.hstack([ahead, *last]) @ gain.T
        last = [u, last[0]]
        waiting.append(u)
        force = waiting.pop(0)
        if n >= settling:
            square += ((state[:, :2] - along(motions, n)[:2]) ** 2).mean(axis=0)
            requests.append(u + along(forces, n + delay))
        state = state @ f.T + (force + along(forces, n) + sigma * rng.standard_normal((runs, 2))) @ g.T
        guess = guess @ f.T + force @ g.T
    asked = np.array(requests)
    chattering = np.sqrt((np.diff(asked, 2, axis=0) ** 2).mean(axis=(0, 1)) / (asked**2).mean(axis=(0, 1)))
    return np.sqrt(square / steps), chattering


@pytest.mark.parametrize(
    ("scenario", "ceiling", "settling"),
    [
        (sensed(PAPER, "F", 1e-13), 0.0035, 400),
        (sensed(PAPER, "P", 1e-13), 0.05, 400),
        (sensed(PAPER, "F", 0.0), 0.05, 400),
        (sensed(PAPER, "P", 1e-13).replace({"device.delay": 3}), 0.01, 400),
        (DEVICES["tuned_in_air"], 0.02, 5000),
    ],
)
def test_the_law_simulated_has_the_error_and_the_chattering_of_the_limit(
    scenario: fg.Scenario, ceiling: float, settling: int
) -> None:
    found = fg.limit.tracking(scenario, ceiling)
    error, chattering = simulated(scenario, float(found["price"]), settling)
    assert error == pytest.approx(found["rmse_steady"].values, rel=0.03)
    assert chattering == pytest.approx(found["chattering_reached"].values, rel=0.03)


@pytest.mark.parametrize("changes", [{}, {"device.delay": 2}, {"reference.amplitude": (0.4, -0.3)}])
def test_the_limit_of_the_transient_is_attained_by_a_run(changes: dict[str, Any]) -> None:
    scenario = PAPER.replace({**KNOWN, "run.duration": 10.0, **changes})
    limit, delay, count = 1000.0, scenario.device.delay, 96
    free = fg.simulate(scenario, lambda sample: (0.0, 0.0))["position"].values[: count + delay + 1]
    whole = np.array(_core.plant_map(core_setup(scenario)))
    answer = [(np.linalg.matrix_power(whole[:, :4], k) @ whole[:, 4:])[:2] for k in range(count)]
    matrix = limit * np.block(
        [[answer[n - k] if k <= n else np.zeros((2, 2)) for k in range(count)] for n in range(count)]
    )
    reference = np.array(_core.reference(core_setup(scenario), count + delay + 1, 1))[:, :2]
    wanted = (reference - free)[delay + 1 :].ravel()
    found = minimize(
        lambda u: (((matrix @ u - wanted) ** 2).sum(), 2 * matrix.T @ (matrix @ u - wanted)),
        np.zeros(2 * count), jac=True, bounds=[(-1.0, 1.0)] * (2 * count), method="L-BFGS-B",
        options={"maxiter": 2000, "maxfun": 4000, "ftol": 1e-15, "gtol": 1e-10},
    )  # fmt: skip
    plan = limit * found.x.reshape(count, 2)
    late = np.zeros(2)
    run = fg.simulate(scenario, lambda sample: (plan[n] if (n := round(sample.time / 1e-3)) < count else late).tolist())
    squares = (run["error"].values[: count + delay + 1] ** 2).sum(axis=0)
    reached, best = np.sqrt(squares / 10_000), fg.limit.tracking(scenario)["rmse_transient"].values
    assert np.linalg.norm(reached) == pytest.approx(np.linalg.norm(best), rel=2e-3)
    assert reached == pytest.approx(best, rel=1e-2)


LONG = {"run.duration": 30.0, "run.kernel_tolerance": 3e-5}
KINDS = ("fractional_fast_terminal", "lqg", "least_squares_pid", "pid", "super_twisting")


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("information", ["F", "P"])
@pytest.mark.parametrize("noise", [0.0, 1e-13])
def test_no_controller_is_better(kind: str, information: str, noise: float) -> None:
    """At its own chattering; the sum of both axes, which the law minimizes."""
    base = sensed(PAPER, information, noise).replace({"controller.kind": kind, "adaptation.initial_ratio": 1.0, **LONG})
    runs = fg.measure_many([base.replace({"disturbance.seed": seed}) for seed in (1, 2)])
    _no_better(base, runs)


@pytest.mark.parametrize("kind", ["lqg", "fractional_fast_terminal"])
def test_no_controller_is_better_on_a_device(kind: str) -> None:
    base = DUAL_MASS.replace({"controller.kind": kind, "run.duration": 2000.0})
    _no_better(base, fg.measure_many([base]))


def _no_better(scenario: fg.Scenario, runs: Any) -> None:
    for each in (runs.isel(run=n) for n in range(runs.sizes["run"])):
        error = float(np.linalg.norm(each["rmse"].sel(window="steady")))
        ceiling = float(each["chattering"].max())
        # The mean of a window differs from that of all time: 4 %, so does the chattering.
        assert error >= 0.93 * np.linalg.norm(steady(scenario, 1.05 * ceiling))


# -- Properties --------------------------------------------------------------------------------------------------------


@settings(max_examples=12, deadline=None)
@given(
    st.sampled_from(sorted(DEVICES)),
    st.sampled_from("FP"),
    st.floats(-16.0, -11.0),
    st.floats(-2.3, 0.0),
    st.floats(0.1, 1.0),
)
def test_less_noise_and_more_chattering_lower_the_limit(
    device: str, information: str, noise: float, ceiling: float, less: float
) -> None:
    scenario = DEVICES[device]
    loud, quiet = sensed(scenario, information, 10**noise), sensed(scenario, information, 10 ** (noise - less))
    low, high = np.linalg.norm(fg.limit.tracking(loud, [10**ceiling, 10 ** (ceiling + less)])["rmse_steady"], axis=-1)
    assert high <= low * (1 + 1e-9)
    assert np.linalg.norm(steady(quiet, 10**ceiling)) <= low * (1 + 1e-9)
    assert np.linalg.norm(steady(loud)) <= high * (1 + 1e-9)
    assert fg.limit.tracking(loud)["filter_error"].max() <= steady(loud).max()


@pytest.mark.parametrize(
    "scenario", [sensed(PAPER, "P", 1e-13), DUAL_MASS.replace({"run.initial_position": (0.0, 0.9)})]
)
def test_units_do_not_matter(scenario: fg.Scenario) -> None:
    bare = fg.limit.tracking(scenario, 0.02)
    si = fg.limit.tracking(scenario.replace({"run.units": "SI"}), 0.02)
    length, scales = scenario.plant.reference_length, {"price": 2, "chattering_reached": 0}
    for name, values in bare.items():
        np.testing.assert_allclose(si[name], values * length ** scales.get(str(name), 1), rtol=1e-12)
    assert (si["rmse_steady"].attrs["units"], si["price"].attrs["units"]) == ("m", "m^2")
    later = {"transient": 5.0 / scenario.plant.reference_frequency}
    found = fg.limit.tracking(scenario.replace({"run.units": "SI"}), **later)["rmse_transient"] / length
    np.testing.assert_allclose(found, fg.limit.tracking(scenario, transient=5.0)["rmse_transient"], rtol=1e-9)


def test_without_noise_nothing_is_left_but_the_start() -> None:
    found = fg.limit.tracking(sensed(PAPER, "F", 0.0).replace(KNOWN), 0.001)
    assert not found["rmse_steady"].any()
    assert not found["filter_error"].any()
    assert found["rmse_transient"].all()
    assert not steady(sensed(PAPER, "P", 1e-13).replace(KNOWN)).any()


def test_errors_of_gain_and_axes_that_are_known_cost_nothing_with_exact_sensors() -> None:
    changes = {"device.pickoff_gain_error": (0.1, -0.2), "device.pickoff_misalignment": 0.3, "device.delay": 1}
    plain = sensed(PAPER, "F", 0.0).replace({"device.delay": 1})
    np.testing.assert_allclose(steady(plain.replace(changes), 0.05), steady(plain, 0.05), rtol=1e-9)
    forces = {"device.force_gain_error": (0.5, 0.5)}
    np.testing.assert_allclose(steady(plain.replace(forces), 0.05), steady(plain, 0.05), rtol=1e-9)


def test_delay_raises_the_limit_and_converters_add_noise() -> None:
    base = sensed(PAPER, "P", 1e-13)
    errors = [np.linalg.norm(steady(base.replace({"device.delay": delay}), 0.05)) for delay in (0, 1, 5, 40)]
    assert errors == sorted(errors)
    assert errors[-1] > 1.1 * errors[0]
    coarse = base.replace({"device.position_range": (2e-6, 2e-6), "device.position_bits": 12})
    assert (steady(coarse, 0.05) > 1.1 * steady(base, 0.05)).all()
    assert "white noise" in fg.limit.tracking(coarse).attrs["assumptions"]


def test_noise_that_adds_up_is_one_noise() -> None:
    parts = [{"kind": "noise", "standard_deviation": 0.6}, {"kind": "noise", "density": 0.64e-3}, {"kind": "none"}]
    base = sensed(PAPER, "P", 1e-13)
    np.testing.assert_allclose(steady(base.replace({"disturbance": parts}), 0.05), steady(base, 0.05), rtol=1e-9)


# -- Plants and references ---------------------------------------------------------------------------------------------

GENERAL = {"plant.kind": "general", "plant.mass_ratio": 1.3, "plant.damping_asymmetry": 1e-7}


def test_the_matrices_are_those_of_the_simulated_plants() -> None:
    for changes in ({}, GENERAL | {"plant.stiffness_asymmetry": -5.0}, {"plant.centrifugal": True}):
        scenario = PAPER.replace({**KNOWN, "run.duration": 0.2, "run.initial_velocity": (3.0, -2.0), **changes})
        run = fg.simulate(scenario, lambda sample: (100.0, -50.0))
        whole = np.zeros((6, 6))
        whole[:4, :4], whole[:4, 4:] = continuous(scenario)
        ended = expm(whole * 0.2) @ np.array([0.5, 0.5, 3.0, -2.0, 100.0, -50.0])
        np.testing.assert_allclose(run["position"].values[-1], ended[:2], rtol=1e-9)


def test_a_general_plant_that_is_the_gyroscope_has_its_limit() -> None:
    base = sensed(PAPER, "P", 1e-13)
    np.testing.assert_allclose(steady(base.replace({"plant.kind": "general"}), 0.05), steady(base, 0.05), rtol=1e-12)
    assert (steady(base.replace(GENERAL), 0.05) != steady(base, 0.05)).all()


def test_references_are_equivalent_however_they_are_described() -> None:
    base = sensed(PAPER, "F", 1e-13).replace({"run.duration": 30.0})
    r = base.reference
    terms = [
        {"amplitude": [1.0, 0.0], "frequency": [-r.frequency[0], 0.0], "phase": [np.pi, 0.0]},
        {"amplitude": [0.0, 1.0], "frequency": [0.0, r.frequency[1]], "phase": [0.0, r.phase[1]]},
    ]
    wanted = steady(base, 0.0035)
    several = base.replace({"reference.kind": "sines", "reference.terms": terms})
    np.testing.assert_allclose(steady(several, 0.0035), wanted, rtol=1e-9)
    wave = {"reference.kind": "chirp", "reference.final_frequency": r.frequency, "reference.end": 30.0}
    np.testing.assert_allclose(steady(base.replace(wave), 0.0035), wanted, rtol=0.02)  # over 20 of time


# -- Refused -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"plant.kind": "duffing"}, "plant.kind is duffing: it must be gyroscope or general"),
        ({"plant.kind": "resonator"}, "plant.kind is resonator"),
        ({"rate.kind": "sine", "rate.amplitude": 1.0, "rate.frequency": 9.0}, "rate.kind is sine: it must be constant"),
        (
            {"plant.centrifugal": True, "rate.transverse_points": [[0.0, 1.0, 2.0]]},
            "rate.transverse_points is given: it must be left out",
        ),
        ({"device.cubic_stiffness": (1e9, 0.0)}, r"device.cubic_stiffness is \[1000000000.0, 0.0\]: it must be \["),
        ({"device.stiffness_drift": -30.0}, "device.stiffness_drift is -30.0: it must be 0.0"),
        ({"device.frequency_temperature_coefficient": 2.0}, "device.frequency_temperature_coefficient is 2.0"),
        ({"device.damping_drift": 3.0}, "device.damping_drift is 3.0"),
        ({"device.bias_instability": 1e-3}, "device.bias_instability is 0.001"),
        ({"device.rate_random_walk": 1e-3}, "device.rate_random_walk is 0.001"),
        (
            {"disturbance.kind": "sine", "disturbance.amplitude": (1.0, 0.0)},
            "disturbance.kind is sine: it must be none or noise",
        ),
        ({"disturbance": [{"kind": "none"}, {"kind": "step", "amplitude": [1.0, 0.0]}]}, r"disturbance\[1\].kind is s"),
        ({"disturbance.hold": 2e-3}, "disturbance.hold is 0.002: it must be run.step, 0.001"),
        ({"disturbance.hold": None, "disturbance.band": (1.0, 9.0)}, "disturbance.band is"),
        ({"disturbance.start": 2.0}, "disturbance.start is 2.0: it must be left out"),
        ({"disturbance.end": 12.0}, "disturbance.end is 12.0: it must be left out"),
        ({"controller.force_limit": 500.0}, "controller.force_limit is 500: it must be at least 548"),
        ({"device.actuator_limit": 1e-6}, "device.actuator_limit is 1e-06: it must be at least 9.87"),
    ],
)
def test_scenarios_without_a_limit_are_refused_in_one_sentence(changes: dict[str, Any], message: str) -> None:
    with pytest.raises(fg.ScenarioError, match=message) as raised:
        fg.limit.tracking(PAPER.replace(changes))
    assert "limit of tracking" in str(raised.value)


@pytest.mark.parametrize(
    ("chattering", "kind", "message"),
    [
        (0.0, ValueError, "chattering is 0.0: it must be greater than 0"),
        ([0.01, float("nan")], ValueError, "chattering is nan: it must be greater than 0"),
        ("low", TypeError, "chattering is 'low': it must be a number"),
        ([], ValueError, r"chattering is \[\]: it must be a number, a list of numbers, or None"),
        (5e-6, ValueError, "chattering is 5e-06: it must be greater than 9.6.*e-06"),
    ],
)
def test_ceilings_are_positive_and_can_be_kept(chattering: Any, kind: type[Exception], message: str) -> None:
    with pytest.raises(kind, match=message):
        fg.limit.tracking(PAPER, chattering)


def test_a_front_has_its_ceilings_as_a_dimension_and_ends_at_no_ceiling() -> None:
    found = fg.limit.tracking(sensed(PAPER, "P", 1e-13), [0.01, 0.1, np.inf])
    assert found["rmse_steady"].dims == ("chattering", "axis")
    assert float(found["chattering"][-1]) == np.inf
    assert (np.diff(found["rmse_steady"].values, axis=0) < 0).all()
    none = fg.limit.tracking(sensed(PAPER, "P", 1e-13))
    assert none["rmse_steady"].dims == ("axis",)
    assert float(none["price"]) == 0.0
    np.testing.assert_array_equal(found["rmse_steady"].isel(chattering=-1), none["rmse_steady"])
