"""Users' plants, compared with runs without them; writes benchmarks/results/user_plant.md."""

from __future__ import annotations

import argparse
import ctypes
import statistics
import time
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory

import fracgyro as fg
import numpy as np
from fracgyro.export.compilers import system_compiler
from fracgyro.interop.matrices import matrices
from machine import command, machine, on_one_core, write

MEASURES_CODE = True
DEPENDS_ON = [
    "sliding_mode",
    "include/fracgyro/sim/user_plant.hpp",
    "bindings/bind_user_plant.cpp",
    "bindings/record_run.cpp",
]

PAPER = fg.Scenario.paper()
DAMPING, STIFFNESS, RATE, _, _ = PAPER.plant.nondimensional()
NUMBERS: list[float] = [*DAMPING.tolist(), *STIFFNESS.tolist()]
DXX, DXY, DYY, KXX, KXY, KYY = NUMBERS
IN_C = """
void gyroscope(const double* in, const double* s, const double* p, double* out) {
    out[0] = s[2];
    out[1] = s[3];
    out[2] = in[1] - p[0] * s[2] - p[1] * s[3] - p[3] * s[0] - p[4] * s[1] + 2.0 * in[3] * s[3];
    out[3] = in[2] - p[1] * s[2] - p[2] * s[3] - p[4] * s[0] - p[5] * s[1] - 2.0 * in[3] * s[2];
}
void runge_kutta(const double* in, const double* s, const double* p, double* out) {
    const double h = in[6];
    double k1[4], k2[4], k3[4], k4[4], at[4];
    gyroscope(in, s, p, k1);
    for (int i = 0; i < 4; ++i) at[i] = s[i] + 0.5 * h * k1[i];
    gyroscope(in, at, p, k2);
    for (int i = 0; i < 4; ++i) at[i] = s[i] + 0.5 * h * k2[i];
    gyroscope(in, at, p, k3);
    for (int i = 0; i < 4; ++i) at[i] = s[i] + h * k3[i];
    gyroscope(in, at, p, k4);
    for (int i = 0; i < 4; ++i) out[i] = s[i] + h / 6.0 * ((k1[i] + k4[i]) + 2.0 * (k2[i] + k3[i]));
}
void exact(const double* in, const double* s, const double* p, double* out) {
    for (int i = 0; i < 4; ++i, p += 6)
        out[i] = p[0] * s[0] + p[1] * s[1] + p[2] * s[2] + p[3] * s[3] + p[4] * in[1] + p[5] * in[2];
}
"""

BUILT_IN = "`fg.simulate(scenario)`"
NATIVE = "`plant=` C function, derivative"
RUNGE_KUTTA = "`plant=` C function, a Runge-Kutta step"
EXACT = "`plant=` C function, the exact step"
LAW = "`controller=` Python callable"
CALLABLE = "`plant=` Python callable"
# The run that each is compared with, and the mark.
MARKS = {NATIVE: (BUILT_IN, 1.5), RUNGE_KUTTA: (BUILT_IN, 1.5), EXACT: (BUILT_IN, 1.5), CALLABLE: (LAW, 3.0)}


def gyroscope(time: float, state: tuple[float, ...], force: tuple[float, float]) -> tuple[float, ...]:
    """The paper's gyroscope."""
    x, y, vx, vy = state
    ax = force[0] - DXX * vx - DXY * vy - KXX * x - KXY * y + 2 * RATE * vy
    ay = force[1] - DXY * vx - DYY * vy - KXY * x - KYY * y - 2 * RATE * vx
    return vx, vy, ax, ay


def law(s: fg.Sample) -> tuple[float, float]:
    """The PD of docs/controllers.md."""
    (x, y), (rx, ry) = s.position, s.reference
    ex, ey = x - rx, y - ry
    dx, dy = s.velocity[0] - s.reference_velocity[0], s.velocity[1] - s.reference_velocity[1]
    ux = KXX * rx + KXY * ry + s.reference_acceleration[0] - 4e4 * ex - 280 * dx
    uy = KXY * rx + KYY * ry + s.reference_acceleration[1] - 4e4 * ey - 280 * dy
    return ux, uy


def compiled(folder: str) -> dict[str, fg.native.Plant]:
    """The gyroscope as C functions: the derivative, steps made of it, and the exact step."""
    source, library = Path(folder) / "gyroscope.c", Path(folder) / "gyroscope.so"
    source.write_text(IN_C, encoding="utf-8")
    system_compiler("-x", "c", "-O2", "-shared", "-fPIC", source, "-o", library)
    values = {"dxx": DXX, "dxy": DXY, "dyy": DYY, "kxx": KXX, "kxy": KXY, "kyy": KYY}
    found = ctypes.CDLL(str(library))
    a, b, _, _ = matrices(PAPER, sampled=True)
    rows = {f"m{place}": float(value) for place, value in enumerate(np.hstack([a, b]).flat)}
    return {
        NATIVE: fg.native.Plant(found.gyroscope, parameters=values),
        RUNGE_KUTTA: fg.native.Plant(step=found.runge_kutta, parameters=values),
        EXACT: fg.native.Plant(step=found.exact, parameters=rows),
    }


def simulated(plant: fg.native.Plant) -> Callable[[], object]:
    return lambda: fg.simulate(PAPER, plant=plant)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=25)
    rounds = parser.parse_args().rounds
    on_one_core()
    with TemporaryDirectory() as folder:
        tasks: dict[str, Callable[[], object]] = {
            BUILT_IN: lambda: fg.simulate(PAPER),
            **{name: simulated(plant) for name, plant in compiled(folder).items()},
            LAW: lambda: fg.simulate(PAPER, controller=law),
            CALLABLE: lambda: fg.simulate(PAPER, plant=gyroscope),
        }
        seconds: dict[str, list[float]] = {name: [] for name in tasks}
        for _ in range(rounds + 1):
            for name, task in tasks.items():
                begin = time.perf_counter()
                task()
                seconds[name].append(time.perf_counter() - begin)
    for times in seconds.values():
        del times[0]  # the first call includes one-time setup

    def row(name: str) -> str:
        times = seconds[name]
        median, least, most = (1e3 * f(times) for f in (statistics.median, min, max))
        found = f"| {name} | {median:.1f} ms | {least:.1f} to {most:.1f} ms |"
        if name not in MARKS:
            return f"{found} – | – | – | – |"
        other, mark = MARKS[name]
        ratios = sorted(one / base for one, base in zip(times, seconds[other], strict=True))
        middle = statistics.median(ratios)
        return f"{found} {other} | {middle:.2f} | {ratios[0]:.2f} to {ratios[-1]:.2f} | at most {mark} |"

    write(
        "user_plant",
        [
            "# Users' plants\n",
            f"Made by `{command()}`.\n",
            f"Machine: {machine('xarray')}; on one core.\n",
            f"The paper's scenario, {PAPER.run.steps + 1:,} samples, every channel kept. Plants have the equations of "
            "the paper's gyroscope, and are called four times a step if they compute a derivative; the callable is "
            f"plain Python without NumPy, and C is compiled with -O2. In turn, {rounds} rounds after one that does not "
            "count; ratios within a round.\n",
            "| | median | range | over | ratio | range | mark |",
            "|---|---|---|---|---|---|---|",
            *map(row, seconds),
        ],
    )


if __name__ == "__main__":
    main()
