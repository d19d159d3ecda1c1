"""The held feedforward: errors in closed form, exact for sines on every device, of order h² for other references."""

from __future__ import annotations

from typing import Any

import fracgyro as fg
import numpy as np
import pytest
from fracgyro.scenario.shipped import NAMES
from numpy.typing import NDArray
from scipy.linalg import expm

Complex = NDArray[np.complex128]
SCENARIOS = {"paper": fg.Scenario.paper(), **{name: fg.Scenario.shipped(name) for name in NAMES if name != "paper"}}


def ideal(name: str, law: str = "pid", **controller: Any) -> fg.Scenario:
    """The plant and the reference of a scenario, without noise, the nominal plant exact, started on the reference."""
    known = SCENARIOS[name]
    r = known.reference
    amplitude, frequency, phase = map(np.array, (r.amplitude, r.frequency, r.phase))
    start = {
        "initial_position": (amplitude * np.sin(phase)).tolist(),
        "initial_velocity": (amplitude * frequency * np.cos(phase)).tolist(),
    }
    return fg.Scenario(
        plant=known.plant,
        reference=known.reference,
        disturbance={"kind": "none"},
        run={"step": known.run.step, "duration": 20000 * known.run.step, **start},
        controller={"kind": law, **controller},
        adaptation={"initial_ratio": 1.0},
    )


def matrices(scenario: fg.Scenario) -> tuple[NDArray[np.float64], ...]:
    """D + 2 Omega, K, and the sampled map of [q, v] under a held force."""
    d, k, rate, *_ = scenario.plant.nondimensional()
    c = np.array([[d[0], d[1] - 2 * rate], [d[1] + 2 * rate, d[2]]])
    stiffness = np.array([[k[0], k[1]], [k[1], k[2]]])
    held = np.zeros((6, 6))
    held[:2, 2:4] = held[2:4, 4:] = np.eye(2)
    held[2:4, :2], held[2:4, 2:4] = -stiffness, -c
    powers = expm(held * scenario.run.step)
    return c, stiffness, powers[:4, :4], powers[:4, 4:]


def frequencies(scenario: fg.Scenario) -> list[tuple[float, Complex]]:
    """Each frequency of the reference with its phasors of x and y: r = Im sum R e^(jwt)."""
    r = scenario.reference
    both = []
    for axis in range(2):
        phasor = np.zeros(2, complex)
        phasor[axis] = r.amplitude[axis] * np.exp(1j * r.phase[axis])
        both.append((r.frequency[axis], phasor))
    return both


def steady_error(scenario: fg.Scenario, w: float, phasor: Complex, force: Complex) -> Complex:
    """Phasor of e in the linear loop of `pid` with this phasor of feedforward."""
    p, h = scenario.controller, scenario.run.step
    _, _, f, g = matrices(scenario)
    z = np.exp(1j * w * h)
    square = p.natural_frequency**2
    gain = np.hstack(
        [
            (square + h * p.integral_frequency * square / (z - 1)) * np.eye(2),
            2 * p.damping_ratio * p.natural_frequency * np.eye(2),
        ]
    )
    along = np.concatenate([phasor, 1j * w * phasor])
    state = np.linalg.solve(z * np.eye(4) - f + g @ gain, g @ (force + gain @ along))
    return np.asarray(state[:2] - phasor)


def continuous(scenario: fg.Scenario, w: float, phasor: Complex) -> Complex:
    c, k, _, _ = matrices(scenario)
    return np.asarray((k + 1j * w * c - w**2 * np.eye(2)) @ phasor)


def inverse(scenario: fg.Scenario, w: float, phasor: Complex) -> Complex:
    """The force under which the sampled positions are the reference: the inverse of the sampled plant."""
    _, _, f, g = matrices(scenario)
    plant = np.linalg.solve(np.exp(1j * w * scenario.run.step) * np.eye(4) - f, g)[:2]
    return np.linalg.solve(plant, phasor)


def held(scenario: fg.Scenario, w: float, phasor: Complex) -> Complex:
    half = w * scenario.run.step / 2
    return continuous(scenario, w, phasor) * np.exp(1j * half) / np.sinc(half / np.pi)


def projected(run: Any, scenario: fg.Scenario) -> list[Complex]:
    """Phasors of the recorded error at the frequencies of the reference, over the second half of a run."""
    late = slice(len(run.time) // 2, None)
    time, error = run.time.values[late], run.error.values[late]
    waves = [w for w, _ in frequencies(scenario)]
    columns = np.column_stack([part(w * time) for w in waves for part in (np.sin, np.cos)])
    found, *_ = np.linalg.lstsq(columns, error, rcond=None)
    assert np.abs(error - columns @ found).max() < 1e-9
    return [found[2 * i] + 1j * found[2 * i + 1] for i in range(len(waves))]


@pytest.mark.parametrize("name", SCENARIOS)
def test_on_every_device_it_is_the_inverse_of_the_sampled_plant(name: str) -> None:
    for w, phasor in frequencies(SCENARIOS[name]):
        exact = inverse(SCENARIOS[name], w, phasor)
        wrong = np.abs(held(SCENARIOS[name], w, phasor) - exact).max()
        assert wrong < 3e-8 * np.abs(exact).max()
        assert wrong < 1e-4 * np.abs(continuous(SCENARIOS[name], w, phasor) - exact).max()


@pytest.mark.parametrize("name", SCENARIOS)
def test_the_steady_error_of_pid_is_that_of_the_linear_loop_with_the_inverse(name: str) -> None:
    """Only the velocity's ripple under the hold is left; a tenth or less of the error of a late force."""
    speed = 0.2 / SCENARIOS[name].run.step
    scenario = ideal(name, natural_frequency=speed, integral_frequency=0.0)
    found = projected(fg.simulate(scenario), scenario)
    for (w, phasor), error in zip(frequencies(scenario), found, strict=True):
        expected = steady_error(scenario, w, phasor, inverse(scenario, w, phasor))
        late = steady_error(scenario, w, phasor, continuous(scenario, w, phasor))
        np.testing.assert_allclose(error, expected, rtol=0, atol=1e-4 * np.abs(late).max() + 1e-13)
        assert np.abs(error).max() < 0.1 * np.abs(late).max()


@pytest.mark.parametrize("integral", [0.0, 20.0])
def test_the_prediction_is_exact_with_the_held_formula(integral: float) -> None:
    scenario = ideal("paper", integral_frequency=integral)
    found = projected(fg.simulate(scenario), scenario)
    for (w, phasor), error in zip(frequencies(scenario), found, strict=True):
        np.testing.assert_allclose(error, steady_error(scenario, w, phasor, held(scenario, w, phasor)), atol=1e-11)


def test_every_sine_of_a_sum_has_its_own_hold() -> None:
    base = ideal("dual_mass", natural_frequency=4.0, integral_frequency=0.0)
    waves = [(1.0, 0.7, 0.2), (0.5, 4.3, 1.0), (0.1, 11.0, -0.4)]
    terms = [{"amplitude": (a, a / 2), "frequency": (w, w), "phase": (p, p)} for a, w, p in waves]
    scenario = base.replace({"reference": {"kind": "sines", "terms": terms, "offset": (0.1, -0.2)}})
    run = fg.simulate(scenario)
    late = slice(len(run.time) // 2, None)
    time, error = run.time.values[late], run.error.values[late]
    expected, late_force = np.zeros_like(error), np.zeros_like(error)
    for amplitude, w, p in waves:
        phasor = amplitude * np.exp(1j * p) * np.array([1.0, 0.5])
        turn = np.exp(1j * w * time)[:, None]
        expected += (steady_error(base, w, phasor, held(base, w, phasor)) * turn).imag
        late_force += (steady_error(base, w, phasor, continuous(base, w, phasor)) * turn).imag
    np.testing.assert_allclose(error, expected, atol=1e-11)
    assert np.abs(expected).max() < 0.1 * np.abs(late_force).max()


OTHERS: dict[str, dict[str, Any]] = {
    "ramp": {"kind": "ramp", "slope": (0.5, -0.2), "smoothing": 0.2, "smoothing_order": 4},
    "step": {"kind": "step", "amplitude": (0.5, -0.2), "smoothing": 0.2, "smoothing_order": 6},
    "chirp": {"kind": "chirp", "frequency": (1.0, 3.0), "final_frequency": (6.0, 0.5), "end": 8.0},
    "staircase": {"kind": "staircase", "amplitude": (0.2, -0.1), "levels": 5, "smoothing": 0.2, "smoothing_order": 6},
}


@pytest.mark.parametrize("kind", OTHERS)
def test_the_error_of_other_references_falls_with_the_square_of_the_step(kind: str) -> None:
    def error(step: float) -> float:
        run = fg.simulate(
            ideal("paper", integral_frequency=0.0).replace(
                {
                    "reference": OTHERS[kind],
                    "run": {"step": step, "duration": 6.0, "initial_position": (0.0, 0.0)},
                }
            )
        )
        return float(np.abs(run.error.values[run.time.values > 1.0]).max())

    coarse, fine = error(2e-3), error(1e-3)
    assert coarse < 2e-5
    assert coarse / fine == pytest.approx(4.0, rel=0.15)


@pytest.mark.parametrize("kind", ["fractional_fast_terminal", "fractional", "fast_terminal", "linear"])
def test_held_feedforward_takes_the_late_force_out_of_the_papers_laws(kind: str) -> None:
    error = {}
    for feedforward in ("continuous", "held"):
        run = fg.simulate(ideal("paper", kind, feedforward=feedforward, adaptive=False))
        error[feedforward] = float(fg.metrics.rmse(run, (10.0, None)).max())
    assert error["held"] < 0.1 * error["continuous"]


def test_the_papers_force_is_continuous_unless_asked() -> None:
    paper = fg.Scenario.paper()
    assert paper.controller.feedforward == fg.Scenario.paper("printed").controller.feedforward == "continuous"
    short = paper.replace({"run.duration": 0.2})
    one, other = (fg.simulate(short.replace({"controller.feedforward": name})) for name in ("continuous", "held"))
    np.testing.assert_array_equal(one["control"], fg.simulate(short)["control"])
    assert (one["control"].values[0] != other["control"].values[0]).all()


@pytest.mark.parametrize("delay", [1, 3])
def test_a_known_delay_moves_the_held_point(delay: int) -> None:
    """With `lqg`, whose filter knows the delay: the steady error grows with the delay of its feedback only."""
    known = ideal("paper", "lqg", loop_bandwidth=0.06).replace({"device.delay": delay})
    hidden = known.replace({"datasheet.delay": 0})
    error = [float(fg.metrics.rmse(fg.simulate(s), (10.0, None)).max()) for s in (known, hidden)]
    assert error[0] < 0.5 * error[1]


def test_a_reference_at_rest_has_the_same_force_now_as_held() -> None:
    still = {"reference": {"kind": "rest", "offset": (0.3, -0.1)}, "run.duration": 0.1}
    one, other = (
        fg.simulate(fg.Scenario.paper().replace({**still, "controller.feedforward": name}))["control"].values
        for name in ("continuous", "held")
    )
    np.testing.assert_array_equal(one, other)
