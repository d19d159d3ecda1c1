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
from fracgyro.export.compilers import system_compiler
from machine import command, machine, on_one_core, write

DEPENDS_ON = ["sliding_mode", "include/fracgyro/sim/user_plant.hpp", "bindings/bind_user_plant.cpp"]

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
"""

BUILT_IN = "`fg.simulate(scenario)`"
NATIVE = "`plant=` C function"
LAW = "`controller=` Python callable"
CALLABLE = "`plant=` Python callable"
# The run that each is compared with, and the mark.
MARKS = {NATIVE: (BUILT_IN, 1.5), CALLABLE: (LAW, 3.0)}


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


def compiled(folder: str) -> fg.native.Plant:
    source, library = Path(folder) / "gyroscope.c", Path(folder) / "gyroscope.so"
    source.write_text(IN_C, encoding="utf-8")
    system_compiler("-x", "c", "-O2", "-shared", "-fPIC", source, "-o", library)
    values = {"dxx": DXX, "dxy": DXY, "dyy": DYY, "kxx": KXX, "kxy": KXY, "kyy": KYY}
    return fg.native.Plant(ctypes.CDLL(str(library)).gyroscope, parameters=values)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=25)
    rounds = parser.parse_args().rounds
    on_one_core()
    with TemporaryDirectory() as folder:
        native = compiled(folder)
        tasks: dict[str, Callable[[], object]] = {
            BUILT_IN: lambda: fg.simulate(PAPER),
            NATIVE: lambda: fg.simulate(PAPER, plant=native),
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
            "the paper's gyroscope, and are called four times a step; the callable is plain Python without NumPy. In "
            f"turn, {rounds} rounds after one that does not count; ratios within a round.\n",
            "| | median | range | over | ratio | range | mark |",
            "|---|---|---|---|---|---|---|",
            *map(row, seconds),
        ],
    )


if __name__ == "__main__":
    main()
