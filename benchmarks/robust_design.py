"""Designs against a step of delay that is not stated: a late share of the force, and H-infinity with a Kalman filter.

Writes benchmarks/results/robust_design.md. Computed from the linear loop of the paper's x axis; nothing is simulated.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from machine import command, machine, write
from scipy.linalg import LinAlgError, expm, solve_discrete_are, solve_discrete_lyapunov
from scipy.optimize import brentq
from words import short

DEPENDS_ON = ["lqg", "internal_model", "include/fracgyro/control/smooth_feedback.hpp"]
STEP, STIFFNESS, DAMPING, DISTURBANCE = 1e-3, 355.3, 0.01, 1.0
NOISE = {"F": (7.07e-5, 7.07e-5), "P": (7.07e-5,)}
FORCE = 249.4  # RMS of the force along the reference
CEILINGS = (0.0035, 0.05)
WEIGHTS = (1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0, 50.0)
MARGINS = (0.0, 0.5, 1.0)
Design = Callable[[float], np.ndarray]
# In units of the step, in which position, velocity and force are of the same order.
UNITS = np.array([STEP**2, STEP])


def plant() -> tuple[np.ndarray, np.ndarray]:
    flow = np.array([[0.0, 1.0, 0.0], [-STIFFNESS * STEP**2, -DAMPING * STEP, 1.0], [0.0, 0.0, 0.0]])
    held = expm(flow)
    return held[:2, :2], held[:2, 2:]


F, G = plant()


def kalman(sensing: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gain, rows of the measured quantities and their covariance."""
    sensors = len(NOISE[sensing])
    rows, r = np.eye(2)[:sensors], np.diag((np.array(NOISE[sensing]) / UNITS[:sensors]) ** 2)
    p = solve_discrete_are(F.T, rows.T, DISTURBANCE**2 * G @ G.T, r)
    return p @ rows.T @ np.linalg.inv(rows @ p @ rows.T + r), rows, r


def late_share(bandwidth: float, margin: float) -> np.ndarray:
    """Feedback of [e, its rate, two forces], by `delay_margin`."""
    bandwidth = min(bandwidth, 1.1 + 1.4 * (1 - margin) ** 3)
    late = margin * max(0.0, 1 - 0.29 / bandwidth)
    a, b = extended(1 - late)
    a[:2, 2:3] += late * G
    return regulator(a, b, np.diag([1.0, 0, 0, 0]), np.array([[bandwidth**-8]]), np.zeros((4, 1)))


def extended(share: float = 1.0) -> tuple[np.ndarray, np.ndarray]:
    """The map of [e, its rate, two forces] and of the second difference of the force."""
    a, b = np.zeros((4, 4)), np.zeros((4, 1))
    a[:2, :2] = F
    a[:2, 2:3], a[:2, 3:4], b[:2] = 2 * share * G, -share * G, share * G
    a[2, 2:] = 2, -1
    a[3, 2] = b[2, 0] = 1
    return a, b


def regulator(a: np.ndarray, b: np.ndarray, q: np.ndarray, r: np.ndarray, s: np.ndarray) -> np.ndarray:
    """The feedback to the force, of which the first input is the second difference; others are the opponent's."""
    x = solve_discrete_are(a, b, q, r, s=s)
    both = r + b.T @ x @ b
    if (np.diag(both)[1:] >= 0).any():
        raise ValueError("the opponent can make the sum infinite")
    gain: np.ndarray = np.linalg.solve(both, b.T @ x @ a + s.T)[0]
    return gain - np.array([0, 0, 2, -1])


def h_infinity(bandwidth: float, weight: float) -> np.ndarray:
    """The same for the worst force that is at most the last change of the force away from the wanted one.

    A game: the disturbing force w maximizes and the second difference v minimizes e^2 + price v^2 + scale (change^2 -
    w^2). A hidden step is w = -change, so that small gain proves stability; `scale` is the constant scaling of mu.
    """
    scale = weight * bandwidth**-6
    a, b = extended()
    change = np.array([[0.0, 0.0, 1.0, -1.0, 1.0]])  # u, from the states and v
    both = scale * change.T @ change
    both[0, 0] += 1
    both[4, 4] += bandwidth**-8
    pushes = np.vstack([G, np.zeros((2, 1))])
    r = np.diag([both[4, 4], -scale])
    s = np.hstack([both[:4, 4:], np.zeros((4, 1))])
    return regulator(a, np.hstack([b, pushes]), both[:4, :4], r, s)


def measure(gain: np.ndarray, sensing: str, late: int) -> tuple[float, float]:
    """RMS error and chattering of the loop with the filter, for a force that comes `late` steps too late."""
    k, rows, r = kalman(sensing)
    # State: e and its rate, two forces, the prediction. The force is u = -gain [estimate, forces].
    correct = np.hstack([k @ rows, np.zeros((2, 2)), np.eye(2) - k @ rows])
    u = -(gain[:2] @ correct) - np.concatenate([np.zeros(2), gain[2:], np.zeros(2)])
    of_noise = -(gain[:2] @ k)
    a, b = np.zeros((6, 6)), np.zeros((6, 1 + len(r)))
    a[:2, :2] = F
    b[:2, :1] = DISTURBANCE * G
    if late:
        a[:2, 2:3] = G
    else:
        a[:2] += G * u
        b[:2, 1:] += G * of_noise
    a[2] = u
    b[2, 1:] = of_noise
    a[3, 2] = 1
    a[4:] = F @ correct + G * u
    b[4:, 1:] = F @ k + G * of_noise
    if np.abs(np.linalg.eigvals(a)).max() >= 1:
        return math.inf, math.inf
    noise = np.diag([1.0, *np.diag(r)])
    p = solve_discrete_lyapunov(a, b @ noise @ b.T)
    bend = u - np.array([0, 0, 2, -1, 0, 0])
    variance = bend @ p @ bend + of_noise @ r @ of_noise
    return STEP**2 * math.sqrt(p[0, 0]), math.sqrt(variance) / FORCE


def at_ceiling(design: Design, sensing: str, ceiling: float) -> np.ndarray | None:
    """The fastest design at this chattering."""
    above = 0.0
    for bandwidth in np.geomspace(0.4, 4.0, 48):
        try:
            over = measure(design(bandwidth), sensing, 0)[1] - ceiling
        except (LinAlgError, ValueError):
            break
        if over > 0 and above > 0:
            if not math.isfinite(over):
                break
            found = brentq(lambda w: measure(design(w), sensing, 0)[1] - ceiling, above, bandwidth)
            return design(found)
        above = bandwidth
    return None if above == 0.0 else design(above)


@dataclass(frozen=True)
class Result:
    name: str
    known: float
    used: float
    hidden: float  # error with a hidden step over the error without


def result(name: str, design: Design, sensing: str, ceiling: float) -> Result | None:
    gain = at_ceiling(design, sensing, ceiling)
    if gain is None:
        return None
    known, used = measure(gain, sensing, 0)
    return Result(name, known, used, measure(gain, sensing, 1)[0] / known)


def designs(sensing: str, ceiling: float) -> list[Result]:
    """The late share with three margins, and of the H-infinity designs the best that bears a hidden step."""
    shares = [
        result(f"late share, margin {margin:g}", partial(late_share, margin=margin), sensing, ceiling)
        for margin in MARGINS
    ]
    robust = [result(f"H∞, weight {w:g}", partial(h_infinity, weight=w), sensing, ceiling) for w in WEIGHTS]
    bears = [one for one in robust if one is not None and one.hidden <= 2.0]
    return [one for one in shares if one is not None] + [min(bears, key=lambda one: one.known)]


def main() -> None:
    lines = []
    for sensing in NOISE:
        for ceiling in CEILINGS:
            for one in designs(sensing, ceiling):
                factor = f"{one.hidden:.2f}" if math.isfinite(one.hidden) else "unstable"
                cell = f"{sensing}, ≤ {ceiling:g}"
                lines.append(f"| {cell} | {one.name} | {short(one.known, 3)} | {short(one.used, 2)} | {factor} |")
    write(
        "robust_design",
        [
            "# Designs against a hidden step of delay",
            "",
            f"Computed by `{command()}`. Machine: {machine('scipy')}.",
            "",
            "The linear loop of the paper's x axis, plant known, with its stationary Kalman filter: RMS error in q0 "
            "and chattering at the ceiling, or as fast as the design becomes, and the factor on the error if the force "
            "comes a step later than the design assumes. F: positions and velocities with noise of 7.07e-5; P: "
            "positions only. Late share: `controller.delay_margin`. H∞: the feedback that is optimal against the worst "
            "force that differs from the wanted one by at most its last change, with the weight, the constant scaling "
            "of μ, that has the least error among " + ", ".join(f"{w:g}" for w in WEIGHTS) + ".",
            "",
            "| cell | design | error | chattering | with a hidden step |",
            "|---|---|---|---|---|",
            *lines,
        ],
    )


if __name__ == "__main__":
    main()
