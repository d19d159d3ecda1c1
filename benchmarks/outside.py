"""Controllers from outside, and what a call from Python costs; writes benchmarks/results/outside.md."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from typing import Any

import fracgyro as fg
import numba
from machine import command, machine, on_one_core, write

MEASURES_CODE = True
DEPENDS_ON = ["sliding_mode", "pid"]

ROUNDS, CALLS = 15, 20_000
PAPER = fg.Scenario.paper().replace({"controller.kind": "pid"})
KP, KD = 1600.0, 56.0


def pd(s: fg.Sample) -> tuple[float, float]:
    (x, y), (vx, vy), (rx, ry), (rvx, rvy) = s.position, s.velocity, s.reference, s.reference_velocity
    return -KP * (x - rx) - KD * (vx - rvx), -KP * (y - ry) - KD * (vy - rvy)


def pid_law() -> fg.native.Law:
    """The built-in PID as a Numba function."""
    c, (damping, stiffness, rate, _, _) = PAPER.controller, PAPER.plant.nondimensional()
    ratio, square = PAPER.adaptation.initial_ratio, c.natural_frequency**2
    names = ["dxx", "dxy", "dyy", "kxx", "kxy", "kyy", "twice_rate", "kp", "kd", "ki"]
    gains = [square, 2 * c.damping_ratio * c.natural_frequency, PAPER.run.step * c.integral_frequency * square]
    values = [*(ratio * damping), *(ratio * stiffness), 2 * ratio * rate, *gains]
    pointer = numba.types.CPointer(numba.types.double)

    @numba.cfunc(numba.types.void(pointer, pointer, pointer, pointer))
    def law(a: Any, integral: Any, p: Any, out: Any) -> None:
        x, y, vx, vy = a[5], a[6], a[7], a[8]
        ex, ey = a[1] - x, a[2] - y
        fx = p[0] * vx + p[1] * vy - p[6] * vy + p[3] * x + p[4] * y + a[9]
        fy = p[1] * vx + p[2] * vy + p[6] * vx + p[4] * x + p[5] * y + a[10]
        out[0] = fx - p[7] * ex - p[8] * (a[3] - vx) - integral[0]
        out[1] = fy - p[7] * ey - p[8] * (a[4] - vy) - integral[1]
        integral[0] += p[9] * ex
        integral[1] += p[9] * ey

    return fg.native.Law(law, 2, dict(zip(names, map(float, values), strict=True)))


def controller_steps() -> None:
    controller, position, velocity, step = fg.Controller(PAPER), (0.5, 0.5), (0.1, 0.1), PAPER.run.step
    for n in range(CALLS):
        controller.step(n * step, position, velocity)


def plant_steps() -> None:
    plant, force = fg.Plant(PAPER), (1.0, 2.0)
    for _ in range(CALLS):
        plant.step(force)


def empty_calls() -> None:
    nothing, force = (lambda time, position, velocity: None), (1.0, 2.0)
    for n in range(CALLS):
        nothing(n * 1e-3, force, force)


def main() -> None:
    on_one_core()
    law = pid_law()
    measured: dict[str, Callable[[], object]] = {
        "built-in PID": lambda: fg.simulate(PAPER),
        "the same PID, numba.cfunc": lambda: fg.simulate(PAPER, law),
        "PD, Python callable of plain floats": lambda: fg.simulate(PAPER, pd),
        "fg.Controller(...).step": controller_steps,
        "fg.Plant(...).step": plant_steps,
        "a Python function that does nothing": empty_calls,
    }
    times: dict[str, list[float]] = {name: [] for name in measured}
    for _ in range(ROUNDS + 1):
        for name, run in measured.items():
            begin = time.perf_counter()
            run()
            times[name].append(time.perf_counter() - begin)
    median = {name: statistics.median(all_times[1:]) for name, all_times in times.items()}
    best = {name: min(all_times[1:]) for name, all_times in times.items()}
    runs, calls = list(measured)[:3], list(measured)[3:]
    ratio = statistics.median(b / a for a, b in zip(*(times[name][1:] for name in runs[:2]), strict=True))
    write(
        "outside",
        [
            "# Controllers from outside\n",
            f"Made by `{command()}`.\n",
            f"Machine: {machine('numba')}; on one core.\n",
            f"`fg.simulate` of {PAPER.run.steps + 1:,} samples with every channel kept, median and best of {ROUNDS}, "
            "in turn:\n",
            "| controller | median | best |",
            "|---|---|---|",
            *(f"| {name} | {1e3 * median[name]:.1f} ms | {1e3 * best[name]:.1f} ms |" for name in runs),
            f"\nNumba's function takes {ratio:.2f} times the time of the built-in controller (median of the pairs).\n",
            f"One call, from loops of {CALLS:,}; the controller is the PID:\n",
            "| call | median | best |",
            "|---|---|---|",
            *(
                f"| {name} | {1e6 * median[name] / CALLS:.2f} us | {1e6 * best[name] / CALLS:.2f} us |"
                for name in calls
            ),
        ],
    )


if __name__ == "__main__":
    main()
